//! Definitions: `defun`, `defmacro`, `declaim`, `load-time-value`, and the rule that what belongs to the language
//! stays as it is.

use esl_bytecode::builtin::Builtin;
use esl_bytecode::compile::{Environment, InternError};
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::diagnostic::Diagnostic;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;

use super::body::Body;
use super::call::quoted_symbol;
use super::chunk::Purpose;
use super::form::{Checked, Form, Make, fresh, name, quoted};
use super::lambda::{FunctionName, Parts};
use super::machine::{Job, Machine, To};
use crate::core::{Callee, NodeKind};
use crate::diagnostic::code;

impl Machine {
    /// Refuses to define `symbol` as a function or macro if it belongs to the language.
    pub(super) fn check_definable(
        &self,
        environment: &dyn Environment,
        symbol: &Symbol,
        span: Span,
    ) -> Checked {
        if environment.global(symbol).locked { Err(locked(symbol, span)) } else { Ok(()) }
    }

    /// As [`Machine::check_definable`] for a local definition, which may also come from a macro of the library.
    pub(super) fn check_locally_definable(
        &self,
        environment: &dyn Environment,
        symbol: &Symbol,
        span: Span,
        origin: Option<u32>,
    ) -> Checked {
        if self.is_of_library(span, origin) {
            Ok(())
        } else {
            self.check_definable(environment, symbol, span)
        }
    }

    /// Refuses calls of the functions that define, if what they define belongs to the language. What a definition inside
    /// another form defines is known at the end of the unit.
    pub(super) fn check_defining(
        &mut self,
        environment: &dyn Environment,
        builtin: Builtin,
        form: &Form,
    ) -> Checked {
        let defines = matches!(
            builtin,
            Builtin::SetFunction | Builtin::SetMacro | Builtin::ProclaimSpecial | Builtin::DefineConstant
        );
        if !defines {
            return Ok(());
        }
        let Some(symbol) = form.args.iter().find_map(quoted_symbol) else { return Ok(()) };
        if environment.global(&symbol).locked {
            return Err(locked(&symbol, form.span));
        }
        if matches!(builtin, Builtin::ProclaimSpecial | Builtin::DefineConstant) {
            self.unit.note_variable_definition(&symbol);
        }
        Ok(())
    }
}

fn locked(symbol: &Symbol, span: Span) -> Box<Diagnostic> {
    let message = format!("{} belongs to the language and cannot be defined", name(symbol));
    Box::new(code::LOCKED_NAME.at(span, message).help("choose another name"))
}

/// `(defun name lambda-list . body)`
pub(super) fn defun(machine: &mut Machine, environment: &mut dyn Environment, form: Form, to: To) -> Checked {
    let shape = "needs a name and a lambda list";
    let Some(function) = form.args.first().and_then(FunctionName::of) else {
        let span = form.args.first().map_or(form.span, Datum::span);
        return Err(form.malformed_at(span, shape));
    };
    let outcome = define_function(machine, environment, &form, &function, to);
    if outcome.is_err() {
        // Calls of it are not to be blamed for what is wrong here.
        machine.unit.note_broken_function(function.name);
    }
    outcome
}

fn define_function(
    machine: &mut Machine,
    environment: &mut dyn Environment,
    form: &Form,
    function: &FunctionName,
    to: To,
) -> Checked {
    machine.check_definable(environment, &function.name.symbol, form.at(function.datum.span()))?;
    form.takes(2..=usize::MAX, "needs a name and a lambda list")?;
    let parts = Parts {
        name: Some(&function.datum),
        block: Some(&function.block()),
        list: &form.args[1],
        body: &form.args[2..],
    };
    let text = machine.lambda_text(environment, parts, form, to.origin)?;
    machine.unit.note_definition(function.name.clone(), text.arity());

    let mut call = to;
    if function.name.is_setf {
        call = machine.child(to);
        let value = machine.child(to);
        machine.fill(to, NodeKind::Progn(vec![call.node, value.node]));
        machine.fill(value, NodeKind::Constant(function.datum.clone()));
    }
    let cell = machine.child(call);
    machine.fill(cell, NodeKind::Constant(Datum::symbol(function.cell.clone(), to.span)));
    let closure = machine.child(call);
    machine.fill(call, NodeKind::Call(Callee::Builtin(Builtin::SetFunction), vec![cell.node, closure.node]));
    machine.closure(text, closure);
    Ok(())
}

/// `(defmacro name lambda-list . body)`
pub(super) fn defmacro(
    machine: &mut Machine,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    let symbol = form.symbol(0, "needs a name and a lambda list")?;
    machine.check_definable(environment, &symbol, form.at(form.args[0].span()))?;
    machine.note_macro(&symbol);
    form.takes(2..=usize::MAX, "needs a name and a lambda list")?;
    // The definition keeps the place where it was written, so that its unused variables are reported.
    let make = Make(form.datum.span());
    let shown = make.cl("MACRO-FUNCTION", [form.args[0].clone()]);
    let function = make.esl("%MACRO-LAMBDA", std::iter::once(shown).chain(form.args.iter().cloned()));
    let define = make.call_esl("%SET-MACRO", [make.quote(form.args[0].clone()), function]);
    machine.schedule([Job::Expand(define, to)]);
    Ok(())
}

/// `(declaim specifier*)`
pub(super) fn declaim(machine: &mut Machine, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    let effects = proclamations(machine, &form, to.origin)?;
    machine.schedule([Job::Expand(effects, to)]);
    Ok(())
}

/// The form that does what a `declaim` says.
pub(super) fn proclamations(machine: &mut Machine, form: &Form, origin: Option<u32>) -> Checked<Datum> {
    let mut body = Body::default();
    for specifier in &form.args {
        machine.declaration(specifier, &mut body, form, origin)?;
    }
    let make = Make(form.span);
    if body.specials.is_empty() {
        return Ok(make.nil());
    }
    let effects = body
        .specials
        .iter()
        .map(|symbol| make.call_esl("%PROCLAIM-SPECIAL", [make.quote(make.symbol(symbol))]));
    Ok(make.cl("EVAL-WHEN", std::iter::once(always(make)).chain(effects)))
}

/// `(in-package name)`
pub(super) fn in_package(
    machine: &mut Machine,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    let enter = package_change(environment, &form)?;
    machine.schedule([Job::Expand(enter, to)]);
    Ok(())
}

/// The form that makes the package of an `in-package` the current one.
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
        return Err(form.malformed("takes the name of one package"));
    };
    // To ask for a name in the package tells whether there is one.
    if let Err(InternError::NoPackage(_)) = environment.intern(Some(&named), "NIL", false) {
        let message = format!("there is no package called {}", quoted(&form.args[0]));
        return Err(Box::new(code::UNKNOWN_PACKAGE.at(form.at(form.args[0].span()), message)));
    }
    let package = make.call_cl("FIND-PACKAGE", [Datum::string(&named, form.span)]);
    let enter = make.cl("SETQ", [make.symbol(&Symbol::cl("*PACKAGE*")), package]);
    Ok(make.cl("EVAL-WHEN", [always(make), enter]))
}

/// The situations in which a form is evaluated whenever it can be.
fn always(make: Make) -> Datum {
    let situations = ["COMPILE-TOPLEVEL", "LOAD-TOPLEVEL", "EXECUTE"];
    make.items(situations.map(|situation| make.symbol(&Symbol::keyword(situation))))
}

/// `(%compiler-warning code message where . body)`: the body; reports a warning, of a code in the table of codes, at the
/// place where the datum `where` was written.
pub(super) fn compiler_warning(
    machine: &mut Machine,
    _: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    let [named, message, place, body @ ..] = form.args.as_slice() else {
        return Err(form.malformed("takes a code, a message, a datum and forms"));
    };
    let (DatumKind::String(named), DatumKind::String(message)) = (named.kind(), message.kind()) else {
        return Err(form.malformed("needs strings as code and message"));
    };
    let Some(code) = code::find(named) else {
        return Err(form.malformed(&format!("knows no code {named}")));
    };
    let span = form.at(place.span());
    machine.report(code.at(span, message.to_string()), None);
    let jobs = machine.body(body.to_vec(), to);
    machine.schedule(jobs);
    Ok(())
}

/// `(load-time-value form [read-only])`: a chunk of its own, which runs before the one around it, sets a variable that
/// nobody else knows.
pub(super) fn load_time_value(
    machine: &mut Machine,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    form.takes(1..=2, "takes a form and at most one flag")?;
    let variable = fresh(environment, "LOAD-TIME-VALUE");
    machine.fill(to, NodeKind::Special(variable.clone()));
    let outer = machine.purpose();
    let purpose = Purpose { emit: outer.emit, load: outer.load, keep: false };
    let inside = machine.begin_chunk(to.span, to.origin, purpose);
    let (value, job) = machine.part(form.args[0].clone(), inside);
    machine.fill(inside, NodeKind::SetSpecial(variable, value));
    machine.schedule([job, Job::FinishChunk]);
    Ok(())
}
