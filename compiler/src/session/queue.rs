//! The texts of a compilation, and the modules that they require, as one row of forms.
//!
//! Each text is read, and runs, in the package `ESL-USER` until it says otherwise. A form `(require "name")` of a text is
//! not a form like others: whoever reads the row is told, and may put a module in its place. The text of a module stands between
//! `(%enter-module "name")` and `(%leave-module "name")`, which see to the package and note that the module is there; what it
//! requires itself is put in its place likewise. A module is put in once, wherever it is required.
//!
//! Only a form that stands by itself at top level counts, with a name that is written out. All others are calls of the function,
//! which finds modules when the program runs.

use std::collections::VecDeque;
use std::sync::Arc;

use esl_bytecode::compile::Environment;
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::diagnostic::Diagnostic;
use esl_bytecode::module::{Constant, Module};
use esl_bytecode::span::{SourceId, Span};
use esl_bytecode::symbol::{Home, Symbol, USER_PACKAGE};
use rustc_hash::{FxHashMap, FxHashSet};

use crate::diagnostic::code;
use crate::expand::Expander;
use crate::reader::Reader;

/// What comes next in a row of forms.
#[derive(Debug)]
pub(super) enum Next {
    /// A form, which the expander has.
    Form,
    /// This module is required, by the form at this place.
    Require(String, Span),
    /// A module that comes compiled, for the form at this place.
    Module(Module, Span),
    /// Nothing.
    End,
}

/// A part of the row.
#[derive(Debug)]
enum Queued {
    /// The rest of a text.
    Text(Box<Reader>),
    /// A form that nobody has written.
    Form(Datum),
    /// A module that a compiled one requires, for the form at this place.
    Require(String, Span),
    /// A module that comes compiled, and the form that requires it.
    Module(Box<Module>, Span),
    /// The module of this name begins.
    Begun(String),
    /// The innermost module is over.
    Left,
}

/// The row of forms.
#[derive(Debug, Default)]
pub(super) struct FormQueue {
    row: VecDeque<Queued>,
    /// The modules whose texts are being read, the innermost last.
    inside: Vec<String>,
    /// All modules that were required, by their names in lower case.
    required: FxHashSet<String>,
    /// Those that the texts themselves require, not modules within them.
    apart: Vec<String>,
}

impl FormQueue {
    /// Adds a text at the end.
    pub(super) fn add(&mut self, source: SourceId, text: Arc<str>) {
        if !self.row.is_empty() {
            self.row.push_back(Queued::Form(call(Symbol::cl("IN-PACKAGE"), USER_PACKAGE, Span::default())));
        }
        self.row.push_back(Queued::Text(Box::new(Reader::new(source, text))));
    }

    /// Puts the text of a module before all that is left.
    pub(super) fn enter(&mut self, name: &str, span: Span, source: SourceId, text: Arc<str>) {
        self.put_in(name, span, Queued::Text(Box::new(Reader::new(source, text))));
    }

    /// Puts a module that comes compiled before all that is left.
    pub(super) fn enter_compiled(&mut self, name: &str, span: Span, module: Module) {
        let requires = module.requires.clone();
        self.put_in(name, span, Queued::Module(Box::new(module), span));
        for name in requires.into_iter().rev() {
            self.row.push_front(Queued::Require(name, span));
        }
    }

    fn put_in(&mut self, name: &str, span: Span, part: Queued) {
        self.add_call(name, span);
        self.row.push_front(Queued::Left);
        self.row.push_front(Queued::Form(call(Symbol::esl("%LEAVE-MODULE"), name, span)));
        self.row.push_front(part);
        self.row.push_front(Queued::Form(call(Symbol::esl("%ENTER-MODULE"), name, span)));
        self.row.push_front(Queued::Begun(name.to_lowercase()));
    }

    /// Puts a call of `require`, which finds the module when the program runs, before all that is left.
    pub(super) fn add_call(&mut self, name: &str, span: Span) {
        self.row.push_front(Queued::Form(call(Symbol::cl("REQUIRE"), name, span)));
    }

    /// The modules that the texts themselves require.
    pub(super) fn take_apart(&mut self) -> Vec<String> {
        std::mem::take(&mut self.apart)
    }

    /// Whether the next form belongs to a module that was put in.
    pub(super) fn is_inside_module(&self) -> bool {
        !self.inside.is_empty()
    }

    /// Gives the next form to the expander.
    pub(super) fn next(
        &mut self,
        environment: &mut dyn Environment,
        expander: &mut Expander,
        diagnostics: &mut Vec<Diagnostic>,
    ) -> Next {
        while let Some(part) = self.row.front_mut() {
            match part {
                Queued::Begun(name) => {
                    self.inside.push(std::mem::take(name));
                    self.row.pop_front();
                }
                Queued::Left => {
                    self.row.pop_front();
                    self.inside.pop();
                }
                Queued::Form(form) => {
                    let form = std::mem::replace(form, Datum::nil(Span::default()));
                    self.row.pop_front();
                    expander.begin_file_form(form);
                    return Next::Form;
                }
                Queued::Require(name, span) => {
                    let (name, span) = (std::mem::take(name), *span);
                    self.row.pop_front();
                    if self.required.insert(name.to_lowercase()) {
                        return Next::Require(name, span);
                    }
                }
                Queued::Module(module, span) => {
                    let next = Next::Module(std::mem::take(module), *span);
                    self.row.pop_front();
                    return next;
                }
                Queued::Text(reader) => match reader.next(environment) {
                    None => {
                        self.row.pop_front();
                    }
                    Some(Err(diagnostic)) => diagnostics.push(*diagnostic),
                    Some(Ok(form)) => {
                        let Some(name) = required(&form) else {
                            expander.begin_file_form(form);
                            return Next::Form;
                        };
                        let key = name.to_lowercase();
                        if self.inside.is_empty() && !self.apart.contains(&key) {
                            self.apart.push(key.clone());
                        }
                        if let Some(at) = self.inside.iter().position(|inside| *inside == key) {
                            diagnostics.push(*circular(&self.inside[at..], form.span()));
                            continue;
                        }
                        if self.required.insert(key) {
                            return Next::Require(name, form.span());
                        }
                        expander.begin_file_form(form);
                        return Next::Form;
                    }
                },
            }
        }
        Next::End
    }
}

/// The name of the module that a form requires, as that of a file: symbols are in lower case there.
fn required(form: &Datum) -> Option<String> {
    let [operator, name] = form.as_list()?[..] else { return None };
    let operator = operator.as_symbol()?;
    if !operator.is_in(esl_bytecode::symbol::CL_PACKAGE) || operator.name() != "REQUIRE" {
        return None;
    }
    match name.kind() {
        DatumKind::String(text) => Some(text.to_string()),
        DatumKind::Symbol(symbol) if symbol.is_keyword() => Some(symbol.name().to_lowercase()),
        _ => match name.as_list()?[..] {
            [quote, name] if *quote.as_symbol()? == Symbol::cl("QUOTE") => {
                Some(name.as_symbol()?.name().to_lowercase())
            }
            _ => None,
        },
    }
}

fn circular(modules: &[String], span: Span) -> Box<Diagnostic> {
    let names: Vec<String> = modules.iter().map(|name| format!("`{name}`")).collect();
    let message = match &names[..] {
        [name] => format!("the module {name} requires itself"),
        names => format!("the module {} requires itself, by way of {}", names[0], names[1..].join(", ")),
    };
    let help = "put what both need into a module of its own";
    Box::new(code::CIRCULAR_MODULE.at(span, message).help(help))
}

/// A call with a name.
fn call(operator: Symbol, name: &str, span: Span) -> Datum {
    Datum::list([Datum::symbol(operator, span), Datum::string(name, span)], span)
}

/// Gives the uninterned symbols of a module numbers that nothing else in the compilation has.
pub(super) fn renumber_uninterned(module: &mut Module, environment: &mut dyn Environment) {
    let mut fresh: FxHashMap<Symbol, Symbol> = FxHashMap::default();
    for constant in &mut module.constants {
        if let Constant::Symbol(symbol) | Constant::Class(symbol) = constant
            && let Home::Uninterned(_) = symbol.home()
        {
            let new = fresh
                .entry(symbol.clone())
                .or_insert_with_key(|symbol| Symbol::uninterned(environment.fresh(), symbol.name()));
            *symbol = new.clone();
        }
    }
}
