//! The queue of forms of a compilation: its texts, and the modules that they require.
//!
//! Each text is read, and runs, in the package `ESL-USER` until it says otherwise; that of a file whose name
//! ends in `.lisp`, in `COMMON-LISP-USER`. At a form `(require "name")` of a text the queue asks for the
//! module ([`Next::Require`]), which may be put in the place of the form. The text of a module stands between
//! `(%enter-module "name")` and `(%leave-module "name")`, which set the package and note that the module is
//! present. Modules that it requires itself are put in likewise. Each module is put in once, wherever it is
//! required.
//!
//! Where a form that is run at compile time has set `*readtable*`, the program reads the forms after it, up
//! to the end of the text ([`Next::Read`]).
//!
//! Only a form that stands by itself at top level counts, with a literal name. All others are calls of the
//! function, which finds modules at run time.

use std::collections::VecDeque;
use std::path::Path;
use std::sync::Arc;

use esl_bytecode::compile::{Environment, MacroCall, MacroRef};
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::diagnostic::Diagnostic;
use esl_bytecode::locals::Locals;
use esl_bytecode::module::{Constant, Module};
use esl_bytecode::span::{SourceId, Span};
use esl_bytecode::symbol::{
    CL_PACKAGE, CL_USER_PACKAGE, Home, Symbol, USER_PACKAGE, setf_cell, symbol_of_setf_cell,
};
use rustc_hash::{FxHashMap, FxHashSet};

use crate::diagnostic::code;
use crate::expand::Expander;
use crate::reader::Reader;

/// Next item of the queue.
#[derive(Debug)]
pub(super) enum Next {
    /// A form, which the expander has received.
    Form,
    /// A form with calls that are to be made first.
    Calls(Datum),
    /// The program reads the next form itself, by this call.
    Read(MacroCall),
    /// A module that the form at this place requires.
    Require(String, Span),
    /// A compiled module, which the form at this place requires.
    Module(Module, Span),
    /// The end of the queue.
    End,
}

/// An item in the queue.
#[derive(Debug)]
enum QueueItem {
    /// The rest of a text.
    Text(Box<Reader>),
    /// A form that no text contains.
    Form(Datum),
    /// The form after which data are read in the standard syntax again, if they are not.
    StandardSyntax,
    /// A form of the text after it, whose calls have been made.
    Read(Datum),
    /// A module that a compiled one requires; the form at this place requires that one.
    Require(String, Span),
    /// A compiled module, and the place of the form that requires it.
    Module(Box<Module>, Span),
    /// The beginning of the module of this name.
    Begun(String),
    /// The end of the innermost module.
    Left,
}

/// The forms that are still to be compiled.
#[derive(Debug, Default)]
pub(super) struct FormQueue {
    row: VecDeque<QueueItem>,
    /// Modules whose texts are being read, the innermost last.
    inside: Vec<String>,
    /// Modules that were required, by their names in lower case.
    required: FxHashSet<String>,
    /// Modules that the texts themselves require.
    apart: Vec<String>,
    /// Number of errors before the current form, if that makes or enters a package.
    errors_before_package: Option<usize>,
    /// Bytes of the text that the program is given to read one form; 0 for [`READ_PART`].
    read_part: usize,
    /// Whether forms other than `require` are left out, since a module is missing that they may need.
    leaves_out_forms: bool,
}

/// Bytes of a text that the program is given to read one form from, at first; twice as many whenever the form
/// may go on after them. So reading a text takes time in proportion to the number of its forms.
const READ_PART: usize = 1 << 16;

impl FormQueue {
    /// Adds the text called `name` at the end.
    pub(super) fn add(&mut self, name: &str, source: SourceId, text: Arc<str>) {
        let package = if is_common_lisp(name) { CL_USER_PACKAGE } else { USER_PACKAGE };
        if !self.row.is_empty() {
            self.row.push_back(QueueItem::StandardSyntax);
        }
        if !self.row.is_empty() || package != USER_PACKAGE {
            self.row.push_back(QueueItem::Form(call(Symbol::cl("IN-PACKAGE"), package, Span::default())));
        }
        self.row.push_back(QueueItem::Text(Box::new(Reader::new(source, text))));
    }

    /// Puts the text of a module at the front.
    pub(super) fn enter(&mut self, name: &str, span: Span, source: SourceId, text: Arc<str>) {
        self.put_in(name, span, QueueItem::Text(Box::new(Reader::new(source, text))));
    }

    /// Puts a compiled module at the front.
    pub(super) fn enter_compiled(&mut self, name: &str, span: Span, module: Module) {
        let requires = module.requires.clone();
        self.put_in(name, span, QueueItem::Module(Box::new(module), span));
        for name in requires.into_iter().rev() {
            self.row.push_front(QueueItem::Require(name, span));
        }
    }

    /// Puts a module at the front, between the forms that enter and leave it.
    fn put_in(&mut self, name: &str, span: Span, part: QueueItem) {
        self.add_call(name, span);
        self.row.push_front(QueueItem::Left);
        self.row.push_front(QueueItem::Form(call(Symbol::esl("%LEAVE-MODULE"), name, span)));
        self.row.push_front(part);
        self.row.push_front(QueueItem::Form(call(Symbol::esl("%ENTER-MODULE"), name, span)));
        self.row.push_front(QueueItem::Begun(name.to_lowercase()));
    }

    /// Puts a call of `require`, which finds the module at run time, at the front.
    pub(super) fn add_call(&mut self, name: &str, span: Span) {
        self.row.push_front(QueueItem::Form(call(Symbol::cl("REQUIRE"), name, span)));
    }

    /// Puts a form whose calls have been made at the front.
    pub(super) fn put_back(&mut self, form: Datum) {
        self.row.push_front(QueueItem::Read(form));
    }

    /// Returns the call by which the program reads the next form of a text itself, of which `reader` has read
    /// what is before: `(%read-form part is-all)`.
    fn reading(reader: &Reader, size: usize) -> MacroCall {
        let (part, is_all) = reader.part(size.max(READ_PART));
        let span = reader.next_span();
        let operator = Symbol::esl("%READ-FORM");
        let is_all = if is_all { Datum::symbol(Symbol::cl("T"), span) } else { Datum::nil(span) };
        let form = [Datum::symbol(operator.clone(), span), Datum::string(part, span), is_all];
        MacroCall {
            function: MacroRef::Global(operator),
            form: Datum::list(form, span),
            locals: Locals::default(),
        }
    }

    /// Takes what the program has read: `(:form datum end)`, where END counts characters, `(:end)`, or
    /// `(:more)` if the part was too small.
    pub(super) fn take_read(&mut self, read: &Datum) {
        let Some(QueueItem::Text(reader)) = self.row.front_mut() else { return };
        let size = std::mem::take(&mut self.read_part).max(READ_PART);
        let items = read.as_list().unwrap_or_default();
        match (items.first().and_then(|kind| kind.as_symbol()).map(Symbol::name), &items[..]) {
            (Some("FORM"), [_, form, end]) => {
                reader.skip(match end.kind() {
                    DatumKind::Integer(end) => usize::try_from(end).unwrap_or(usize::MAX),
                    _ => usize::MAX,
                });
                let form = (*form).clone();
                self.row.push_front(QueueItem::Read(form));
            }
            (Some("MORE"), _) => self.read_part = size * 2,
            _ => reader.skip(usize::MAX),
        }
    }

    /// Leaves out the rest of a text that the program has failed to read. Returns where that begins.
    pub(super) fn give_up_reading(&mut self) -> Span {
        let Some(QueueItem::Text(reader)) = self.row.front_mut() else { return Span::default() };
        let span = reader.next_span();
        reader.skip(usize::MAX);
        span
    }

    /// Leaves out all forms from here on, except those that require modules.
    pub(super) fn leave_out_forms(&mut self) {
        self.leaves_out_forms = true;
    }

    /// Takes the modules that the texts themselves require.
    pub(super) fn take_apart(&mut self) -> Vec<String> {
        std::mem::take(&mut self.apart)
    }

    /// Whether the current form was to make or enter a package, and `expander` has found errors in it.
    pub(super) fn is_package_in_doubt(&self, expander: &Expander) -> bool {
        self.errors_before_package.is_some_and(|errors| expander.errors() > errors)
    }

    /// Whether the next form belongs to a module that was put in.
    pub(super) fn is_inside_module(&self) -> bool {
        !self.inside.is_empty()
    }

    /// Begins the next form in the expander, or returns what has to be done before.
    pub(super) fn next(
        &mut self,
        environment: &mut dyn Environment,
        expander: &mut Expander,
        diagnostics: &mut Vec<Diagnostic>,
    ) -> Next {
        self.errors_before_package = None;
        while let Some(part) = self.row.front_mut() {
            match part {
                QueueItem::Begun(name) => {
                    self.inside.push(std::mem::take(name));
                    self.row.pop_front();
                }
                QueueItem::Left => {
                    self.row.pop_front();
                    self.inside.pop();
                }
                QueueItem::Form(form) => {
                    let form = std::mem::replace(form, Datum::nil(Span::default()));
                    self.row.pop_front();
                    expander.begin_file_form(form);
                    return Next::Form;
                }
                QueueItem::StandardSyntax => {
                    self.row.pop_front();
                    if environment.has_own_syntax() {
                        expander.begin_file_form(standard_syntax());
                        return Next::Form;
                    }
                }
                QueueItem::Require(name, span) => {
                    let (name, span) = (std::mem::take(name), *span);
                    self.row.pop_front();
                    if self.required.insert(name.to_lowercase()) {
                        return Next::Require(name, span);
                    }
                }
                QueueItem::Module(module, span) => {
                    let next = Next::Module(std::mem::take(module), *span);
                    self.row.pop_front();
                    return next;
                }
                QueueItem::Read(form) => {
                    let form = std::mem::replace(form, Datum::nil(Span::default()));
                    self.row.pop_front();
                    if let Some(next) = self.begin(form, expander, diagnostics) {
                        return next;
                    }
                }
                QueueItem::Text(reader) if reader.is_sound() && environment.has_own_syntax() => {
                    if !reader.is_at_end() {
                        return Next::Read(FormQueue::reading(reader, self.read_part));
                    }
                    self.row.pop_front();
                }
                QueueItem::Text(reader) => match reader.next(environment) {
                    None => {
                        self.row.pop_front();
                    }
                    // The missing module may define the package.
                    Some(Err(fault)) if self.leaves_out_forms && is_about_names(fault.code) => {}
                    Some(Err(fault)) => diagnostics.push(*fault),
                    Some(Ok(form)) if form.has_calls() && !self.leaves_out_forms => return Next::Calls(form),
                    Some(Ok(form)) => {
                        if let Some(next) = self.begin(form, expander, diagnostics) {
                            return next;
                        }
                    }
                },
            }
        }
        Next::End
    }

    /// Begins a form of a text. Returns what comes next, unless the form is faulty.
    fn begin(
        &mut self,
        form: Datum,
        expander: &mut Expander,
        diagnostics: &mut Vec<Diagnostic>,
    ) -> Option<Next> {
        if let Some(name) = required(&form) {
            let key = name.to_lowercase();
            if self.inside.is_empty() && !self.apart.contains(&key) {
                self.apart.push(key.clone());
            }
            if let Some(at) = self.inside.iter().position(|inside| *inside == key) {
                diagnostics.push(*circular(&self.inside[at..], form.span()));
                return None;
            }
            if self.required.insert(key) {
                return Some(Next::Require(name, form.span()));
            }
        } else if self.leaves_out_forms {
            return None;
        } else {
            self.errors_before_package = is_about_package(&form).then(|| expander.errors());
        }
        expander.begin_file_form(form);
        Some(Next::Form)
    }
}

/// Whether a diagnostic of this code is about a package, or about a name in one.
fn is_about_names(code: &str) -> bool {
    [code::UNKNOWN_PACKAGE, code::NOT_EXTERNAL].iter().any(|about| about.name == code)
}

/// Whether a form makes a package or enters one.
fn is_about_package(form: &Datum) -> bool {
    let operator = form.as_cons().and_then(|(operator, _)| operator.as_symbol());
    operator.is_some_and(|symbol| {
        symbol.is_in(CL_PACKAGE) && matches!(symbol.name(), "DEFPACKAGE" | "IN-PACKAGE")
    })
}

/// Whether the file called `name` is written for Common Lisp.
fn is_common_lisp(name: &str) -> bool {
    Path::new(name).extension().is_some_and(|extension| extension.eq_ignore_ascii_case("lisp"))
}

/// Returns the name of the module that a form requires. As in names of files, symbols are in lower case.
fn required(form: &Datum) -> Option<String> {
    let [operator, name] = form.as_list()?[..] else { return None };
    let operator = operator.as_symbol()?;
    if !operator.is_in(CL_PACKAGE) || operator.name() != "REQUIRE" {
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
    let help = "put the definitions that both need into a module of their own";
    Box::new(code::CIRCULAR_MODULE.at(span, message).help(help))
}

/// Returns a call with a name as its argument.
fn call(operator: Symbol, name: &str, span: Span) -> Datum {
    Datum::list([Datum::symbol(operator, span), Datum::string(name, span)], span)
}

/// Returns the form after which data are read in the standard syntax again.
fn standard_syntax() -> Datum {
    let span = Span::default();
    let symbol = |name| Datum::symbol(Symbol::cl(name), span);
    let times = ["COMPILE-TOPLEVEL", "LOAD-TOPLEVEL", "EXECUTE"];
    let times = Datum::list(times.map(|time| Datum::symbol(Symbol::keyword(time), span)), span);
    let set = Datum::list([symbol("SETQ"), symbol("*READTABLE*"), Datum::nil(span)], span);
    Datum::list([symbol("EVAL-WHEN"), times, set], span)
}

/// Gives the uninterned symbols of a module numbers that are unique in the compilation.
pub(super) fn renumber_uninterned(module: &mut Module, environment: &mut dyn Environment) {
    let mut fresh: FxHashMap<Symbol, Symbol> = FxHashMap::default();
    for constant in &mut module.constants {
        if let Constant::Symbol(symbol) | Constant::Class(symbol) = constant
            && let Home::Uninterned(_) = symbol.home()
        {
            let named = symbol_of_setf_cell(symbol);
            let new = fresh
                .entry(named.clone().unwrap_or_else(|| symbol.clone()))
                .or_insert_with_key(|symbol| Symbol::uninterned(environment.fresh(), symbol.name()));
            *symbol = if named.is_some() { setf_cell(new) } else { new.clone() };
        }
    }
}
