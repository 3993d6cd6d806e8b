//! Definitions: `defun`, `defmacro`, `declaim`, `load-time-value`; and the rule that programs cannot redefine
//! names of the language.

use esl_bytecode::builtin::Builtin;
use esl_bytecode::compile::{Environment, InternError};
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::diagnostic::Diagnostic;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::{Symbol, setf_cell};

use super::call::quoted_symbol;
use super::chunk::Purpose;
use super::expander::Expander;
use super::form::{Checked, Form, Make, fresh, name, on_one_line, operator, plain, quoted};
use super::function::{Body, FunctionParts, WrittenName};
use super::global::DefinedFunction;
use super::job::{Job, To};
use super::origin::OriginId;
use crate::core::{Callee, NodeKind};
use crate::diagnostic::code;

impl Expander {
    /// Refuses the definition of `symbol`, at `span` in `form`, as a function or macro if the name belongs to
    /// the language.
    ///
    /// Returns whether the unit may count on the definition: one that is written inside of another form is
    /// only warned of, since it may never run.
    fn check_definable(
        &mut self,
        environment: &dyn Environment,
        symbol: &Symbol,
        span: Span,
        form: &Form,
        to: To,
    ) -> Checked<bool> {
        if !environment.global(symbol).locked {
            return Ok(true);
        }
        if to.is_whole_chunk() || self.origins.is_of_library(form.span, to.origin) {
            return Err(locked(symbol, span));
        }
        let message =
            format!("{} belongs to the language, and this definition fails if it is run", name(symbol));
        self.report(code::LOCKED_NAME_INSIDE.at(span, message).help("choose another name"), to.origin);
        Ok(false)
    }

    /// Refuses the local definition of a name of the language; macros of the library may make those.
    pub(super) fn check_locally_definable(
        &self,
        environment: &dyn Environment,
        symbol: &Symbol,
        span: Span,
        origin: Option<OriginId>,
    ) -> Checked {
        if self.origins.is_of_library(span, origin) || !environment.global(symbol).locked {
            Ok(())
        } else {
            Err(locked(symbol, span))
        }
    }

    /// Refuses calls of the defining functions with a name of the language. Notes variables that they define
    /// inside other forms, which matters at the end of the unit.
    pub(super) fn check_defining(
        &mut self,
        environment: &dyn Environment,
        builtin: Builtin,
        form: &Form,
        to: To,
    ) -> Checked {
        let defines = matches!(
            builtin,
            Builtin::SetFunction | Builtin::SetMacro | Builtin::ProclaimSpecial | Builtin::DefineConstant
        );
        if !defines {
            return Ok(());
        }
        let Some(symbol) = form.args.iter().find_map(quoted_symbol) else { return Ok(()) };
        // Of a macro defined inside of another form, `defmacro` has warned.
        let is_warned_of = builtin == Builtin::SetMacro && !to.is_whole_chunk();
        if environment.global(&symbol).locked && !is_warned_of {
            return Err(locked(&symbol, form.span));
        }
        if matches!(builtin, Builtin::ProclaimSpecial | Builtin::DefineConstant) {
            self.globals.note_variable_definition(&symbol);
        }
        Ok(())
    }
}

fn locked(symbol: &Symbol, span: Span) -> Box<Diagnostic> {
    let message = format!("{} belongs to the language and cannot be defined", name(symbol));
    Box::new(code::LOCKED_NAME.at(span, message).help("choose another name"))
}

/// `(defun name lambda-list . body)`
pub(super) fn defun(
    expander: &mut Expander,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    let shape = "needs a name and a lambda list";
    let Some(named) = form.args.first() else { return Err(form.missing(shape)) };
    let Some(function) = WrittenName::of(named) else {
        let fault = form.not_a_name(named, "needs a name as its first part");
        // Scheme writes `(define (f x) …)`.
        return Err(match (operator(named), named.as_cons()) {
            (Some(function), Some((_, list))) => Box::new(fault.help(format!(
                "write `(defun {} {} …)`",
                plain(function),
                on_one_line(list, 40)
            ))),
            _ => fault,
        });
    };
    let outcome = define_function(expander, environment, &form, &function, to);
    if outcome.is_err() {
        // Its calls are not checked: the fault is here.
        expander.globals.note_broken_function(function.name);
    }
    outcome
}

fn define_function(
    expander: &mut Expander,
    environment: &mut dyn Environment,
    form: &Form,
    function: &WrittenName,
    to: To,
) -> Checked {
    let span = form.at(function.datum.span());
    let is_definable = expander.check_definable(environment, &function.name.symbol, span, form, to)?;
    form.takes(2..=usize::MAX, "needs a name and a lambda list")?;
    let parts = FunctionParts {
        name: Some(&function.datum),
        block: Some(&function.block()),
        list: &form.args[1],
        body: &form.args[2..],
    };
    let text = expander.lambda_text(environment, parts, form, to.origin)?;
    if is_definable {
        let keys = text.list.keys.as_ref().filter(|_| !text.list.allow_other_keys);
        let keys = keys.map(|keys| keys.iter().map(|key| key.key.clone()).collect());
        let (arity, lambda_list) = (text.arity(), text.shown.clone());
        let defined = DefinedFunction { arity, lambda_list, keys, place: span };
        expander.globals.note_definition(function.name.clone(), defined);
    }

    let mut call = to;
    if function.name.is_setf {
        call = expander.child(to);
        let value = expander.child(to);
        expander.fill(to, NodeKind::Progn(vec![call.node, value.node]));
        expander.fill(value, NodeKind::Constant(function.datum.clone()));
    }
    let cell = expander.child(call);
    expander.fill(cell, NodeKind::Constant(Datum::symbol(function.cell.clone(), to.span)));
    let closure = expander.child(call);
    expander.fill(call, NodeKind::Call(Callee::Builtin(Builtin::SetFunction), vec![cell.node, closure.node]));
    expander.closure(text, closure);
    Ok(())
}

/// `(defmacro name lambda-list . body)`
pub(super) fn defmacro(
    expander: &mut Expander,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    let symbol = form.symbol(0, "needs a symbol as its first part, and a lambda list")?;
    if expander.check_definable(environment, &symbol, form.at(form.args[0].span()), &form, to)? {
        expander.note_macro(&symbol);
        expander.globals.note_macro(&symbol, form.at(form.args[0].span()));
    }
    form.takes(2..=usize::MAX, "needs a name and a lambda list")?;
    // The definition keeps its place in the source, so that its unused variables are reported.
    let make = Make(form.datum.span());
    let shown = make.cl("MACRO-FUNCTION", [form.args[0].clone()]);
    let function = make.esl("%MACRO-LAMBDA", std::iter::once(shown).chain(form.args.iter().cloned()));
    let define = make.call_esl("%SET-MACRO", [make.quote(form.args[0].clone()), function]);
    expander.schedule([Job::Expand(define, to)]);
    Ok(())
}

/// `(declaim specifier*)`
pub(super) fn declaim(expander: &mut Expander, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    let effects = proclamations(expander, &form, to.origin)?;
    expander.schedule([Job::Expand(effects, to)]);
    Ok(())
}

/// Returns the form that carries out a `declaim`.
pub(super) fn proclamations(
    expander: &mut Expander,
    form: &Form,
    origin: Option<OriginId>,
) -> Checked<Datum> {
    let mut body = Body::default();
    let make = Make(form.span);
    let mut failures = Vec::new();
    for specifier in &form.args {
        failures.extend(declared_type(specifier));
        match declared_failures(expander, specifier, form)? {
            Some(declared) => failures.extend(declared),
            None => expander.declaration(specifier, &mut body, form, origin)?,
        }
    }
    if body.specials.is_empty() && body.written.is_empty() && failures.is_empty() {
        return Ok(make.nil());
    }
    let specials = body.specials.iter();
    let specials =
        specials.map(|symbol| make.call_esl("%PROCLAIM-SPECIAL", [make.quote(make.symbol(symbol))]));
    let written = body.written.iter().map(|(name, is_written)| {
        let to = if *is_written { make.symbol(&Symbol::cl("T")) } else { make.nil() };
        make.call_esl("%PROCLAIM-NOTINLINE", [make.quote(make.symbol(name)), to])
    });
    let effects = specials.chain(written).chain(failures);
    Ok(make.cl("EVAL-WHEN", std::iter::once(always(make)).chain(effects)))
}

/// Returns the forms that note `(ftype type name*)`, the type of functions. Only analyses read them.
fn declared_type(specifier: &Datum) -> Vec<Datum> {
    let items = specifier.as_list().unwrap_or_default();
    let [head, declared, names @ ..] = items.as_slice() else { return Vec::new() };
    if !head.as_symbol().is_some_and(|symbol| symbol.is_cl("FTYPE")) {
        return Vec::new();
    }
    let make = Make(specifier.span());
    let named = names.iter().filter_map(|name| name.as_symbol());
    let note = |name: &Symbol| {
        let indicator = make.quote(make.symbol(&Symbol::esl("%FTYPE")));
        make.call_esl("%PUT", [make.quote(make.symbol(name)), indicator, make.quote((*declared).clone())])
    };
    named.map(note).collect()
}

/// Returns the symbol under which a function is known that `named` names: a symbol, or `(setf symbol)`.
fn function_name(named: &Datum) -> Option<Symbol> {
    if let Some(symbol) = named.as_symbol() {
        return Some(symbol.clone());
    }
    match named.as_list()?.as_slice() {
        [head, place] if head.as_symbol()?.is_cl("SETF") => Some(setf_cell(place.as_symbol()?)),
        _ => None,
    }
}

/// Returns the forms that note `(fails name cause*)`: the causes of failures that may leave the function
/// `name`, or each of several in a list. Analyses read them; a run does not.
fn declared_failures(expander: &mut Expander, specifier: &Datum, form: &Form) -> Checked<Option<Vec<Datum>>> {
    let items = specifier.as_list().unwrap_or_default();
    let Some((head, rest)) = items.split_first() else { return Ok(None) };
    if !head.as_symbol().is_some_and(|symbol| symbol.name() == "FAILS" && !symbol.is_keyword()) {
        return Ok(None);
    }
    let malformed = |part: &Datum, what: &str| {
        let what = format!("needs {what} after `fails`, not {}", quoted(part));
        form.fault(code::MALFORMED_DECLARATION, part.span(), &what)
    };
    let Some((named, causes)) = rest.split_first() else {
        return Err(malformed(specifier, "the name of a function and causes"));
    };
    let names = match function_name(named) {
        Some(_) => vec![*named],
        None => {
            named.as_list().ok_or_else(|| malformed(named, "the name of a function, or a list of names"))?
        }
    };
    let mut symbols = Vec::new();
    for part in causes {
        let cause = part.as_symbol().ok_or_else(|| malformed(part, "causes, which are symbols,"))?;
        expander.globals.note_cause(cause, part.span());
        symbols.push(Make(part.span()).symbol(cause));
    }
    let make = Make(specifier.span());
    let mut forms = Vec::new();
    for named in names {
        let name = function_name(named).ok_or_else(|| malformed(named, "names of functions"))?;
        let indicator = make.quote(make.symbol(&Symbol::esl("%FAILS")));
        let causes = make.quote(make.items(symbols.iter().cloned()));
        forms.push(make.call_esl("%PUT", [make.quote(make.symbol(&name)), indicator, causes]));
    }
    Ok(Some(forms))
}

/// `(in-package name)`
pub(super) fn in_package(
    expander: &mut Expander,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    let enter = package_change(environment, &form)?;
    expander.schedule([Job::Expand(enter, to)]);
    Ok(())
}

/// Returns the form that makes the package of an `in-package` the current one.
pub(super) fn package_change(environment: &mut dyn Environment, form: &Form) -> Checked<Datum> {
    let make = Make(form.span);
    let named = match form.args.as_slice() {
        [named] => match named.kind() {
            DatumKind::String(text) => Some(text.to_string()),
            DatumKind::Symbol(symbol) => Some(symbol.name().to_string()),
            DatumKind::Character(c) => Some(c.to_string()),
            _ => None,
        },
        _ => None,
    };
    let Some(named) = named else {
        let shape = "takes the name of one package";
        form.takes(1..=1, shape)?;
        return Err(form.not_a_name(&form.args[0], shape));
    };
    // Looking up any name in the package shows whether the package exists.
    if let Err(InternError::NoPackage(_)) = environment.intern(Some(&named), "NIL", false) {
        let message = format!("the package {} does not exist", quoted(&form.args[0]));
        return Err(Box::new(code::UNKNOWN_PACKAGE.at(form.at(form.args[0].span()), message)));
    }
    let package = make.call_cl("FIND-PACKAGE", [Datum::string(&named, form.span)]);
    let enter = make.cl("SETQ", [make.symbol(&Symbol::cl("*PACKAGE*")), package]);
    Ok(make.cl("EVAL-WHEN", [always(make), enter]))
}

/// Returns the situations of a form that is evaluated whenever possible.
fn always(make: Make) -> Datum {
    let situations = ["COMPILE-TOPLEVEL", "LOAD-TOPLEVEL", "EXECUTE"];
    make.items(situations.map(|situation| make.symbol(&Symbol::keyword(situation))))
}

/// `(%compiler-warning code message where . body)`: expands to the body; reports a finding, of a code in the
/// table of codes, at the place of the datum `where`.
pub(super) fn compiler_warning(
    expander: &mut Expander,
    _: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    let [named, message, place, body @ ..] = form.args.as_slice() else {
        return Err(form.missing("takes a code, a message, a datum and forms"));
    };
    let (DatumKind::String(named), DatumKind::String(message)) = (named.kind(), message.kind()) else {
        return Err(form.malformed("needs strings as code and message"));
    };
    let Some(code) = code::find(named) else {
        return Err(form.malformed(&format!("knows no code {named}")));
    };
    let span = form.at(place.span());
    expander.report(code.at(span, message.to_string()), None);
    let jobs = expander.body(body.to_vec(), to);
    expander.schedule(jobs);
    Ok(())
}

/// `(load-time-value form [read-only])`: reads a variable with a fresh name, which a separate chunk sets
/// before the chunk around the form runs.
pub(super) fn load_time_value(
    expander: &mut Expander,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    form.takes(1..=2, "takes a form and at most one flag")?;
    let variable = fresh(environment, "LOAD-TIME-VALUE");
    expander.fill(to, NodeKind::Special(variable.clone()));
    let outer = expander.purpose();
    let purpose = Purpose { emit: outer.emit, load: outer.load, keep: false };
    let inside = expander.begin_chunk(to.span, to.origin, purpose);
    let (value, job) = expander.part(form.args[0].clone(), inside);
    expander.fill(inside, NodeKind::SetSpecial(variable, value));
    expander.schedule([job, Job::FinishChunk]);
    Ok(())
}
