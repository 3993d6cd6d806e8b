//! Checks of forms as they are written, before macros of the library take them apart: format directives
//! against arguments, forms without a body, tests given to `assert`, the arguments of failures and of their
//! procedures, and names of types; and keywords of local functions.
//!
//! Only names of the language are checked, so what they mean is known. A form that a macro of the library
//! makes is not checked.

use std::sync::LazyLock;

use esl_bytecode::compile::Environment;
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::diagnostic::Diagnostic;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::{CL_PACKAGE, Symbol};
use rustc_hash::FxHashMap;

use super::argument::usage;
use super::directive::{arguments_of, unknown_directive};
use super::expander::Expander;
use super::form::{Form, is_known, name, on_one_line, operator, plain};
use super::global::CauseArguments;
use super::operation_check;
use super::origin::OriginId;
use super::trap::traps;
use super::type_use::{definition, handled_types, types};
use crate::diagnostic::code;
use crate::similar::is_like;

/// A check of a form.
type FormCheck = fn(&mut Expander, &dyn Environment, &Form, Option<OriginId>);

static CHECKS: LazyLock<FxHashMap<Symbol, FormCheck>> = LazyLock::new(|| {
    let standard: &[(&str, FormCheck)] = &[
        ("CASE", case),
        ("ECASE", case),
        ("CERROR", |expander, _, form, origin| expander.directives(form, 1, origin)),
        ("CHECK-TYPE", types),
        ("COERCE", types),
        ("CONCATENATE", types),
        ("CTYPECASE", types),
        ("DEFCLASS", definition),
        ("DEFINE-CONDITION", definition),
        ("DEFMETHOD", types),
        ("DEFSTRUCT", definition),
        ("DEFTYPE", definition),
        ("ERROR", error),
        ("ETYPECASE", types),
        ("FIND-CLASS", definition),
        ("FORMAT", format),
        ("HANDLER-BIND", handler),
        ("HANDLER-CASE", handler),
        ("MAKE-ARRAY", types),
        ("MAKE-CONDITION", types),
        ("MAKE-INSTANCE", types),
        ("MAKE-SEQUENCE", types),
        ("MAKE-STRING", types),
        ("MAP", types),
        ("MERGE", types),
        ("SIGNAL", types),
        ("SUBTYPEP", types),
        ("TYPECASE", types),
        ("TYPEP", types),
        ("WARN", error),
        ("IGNORE-ERRORS", guard),
        ("RESTART-CASE", guard),
    ];
    let own: &[(&str, FormCheck)] = &[
        ("ASSERT", assert),
        ("DEFINE-EXCLUSIVE", operation_check::exclusive),
        ("FAIL", fail),
        ("START", operation_check::start),
        ("WITH-RECOVERY-PROCEDURES", recovery),
        ("WITH-CLEANUP-PROCEDURE", body),
        ("WITH-BUDGET", body),
        ("WITH-GUARDIAN", body),
        ("WITH-MAINTAINED-PROPERTIES", body),
        ("WITH-MAINTAINED-PROPERTY", body),
        ("WITH-QUOTA", body),
        ("WITH-RESOURCE", body),
        ("WITH-RESOURCES", body),
        ("WITH-RIGHTS", body),
        ("WITH-SUSPENSION-PROCEDURES", body),
        ("WITH-TIMEOUT", body),
        ("WITH-WORLD", operation_check::world),
        ("WITHOUT-INTERRUPTS", body),
        ("%DEFINE-STARTER", operation_check::starter),
    ];
    let standard = standard.iter().map(|&(name, check)| (Symbol::cl(name), check));
    let own = own.iter().map(|&(name, check)| (Symbol::esl(name), check));
    standard.chain(own).collect()
});

/// Functions whose values are tests, beside those whose names end in `P`.
const TESTS: &[&str] =
    &["=", "/=", "<", ">", "<=", ">=", "EQ", "EQL", "EQUAL", "EQUALP", "NOT", "NULL", "STRING="];

impl Expander {
    /// Checks a form of the language as it is written.
    pub(super) fn check_written(
        &mut self,
        environment: &dyn Environment,
        form: &Form,
        origin: Option<OriginId>,
    ) {
        let Some(check) = CHECKS.get(&form.operator) else { return };
        // The expansion of a macro of the program may handle the failures of forms inside its call. A form
        // whose name begins with `%` stands in expansions of the library's macros only.
        if form.operator.name().starts_with('%')
            || is_known(self.origins.written(form.span, origin))
            || !self.origins.is_of_library(form.span, origin)
        {
            check(self, environment, form, origin);
        }
    }

    /// Whether a form that handles failures is around `span`.
    pub(super) fn is_guarded(&self, span: Span) -> bool {
        self.guards.iter().any(|guard| guard.contains(span))
    }

    /// Checks a control string, the part `at` of a form, against the arguments after it.
    fn directives(&mut self, form: &Form, at: usize, origin: Option<OriginId>) {
        let Some(DatumKind::String(control)) = form.args.get(at).map(Datum::kind) else { return };
        if let Some(directive) = unknown_directive(control)
            && !self.is_guarded(form.span)
        {
            let message = format!("there is no directive `{directive}`");
            let help = "`~a` prints a value for people, `~s` as it is read; a `~` by itself is written `~~`";
            self.report(code::WRONG_ARGUMENT.at(form.at(form.args[at].span()), message).help(help), origin);
            return;
        }
        let Some(takes) = arguments_of(control) else { return };
        let given = form.args.len() - at - 1;
        if given >= takes.min && takes.max.is_none_or(|max| given <= max) || self.is_guarded(form.span) {
            return;
        }
        let count = |count: usize| match count {
            1 => "1 argument".to_string(),
            count => format!("{count} arguments"),
        };
        let wanted = match takes.max {
            None => format!("at least {}", count(takes.min)),
            Some(_) => count(takes.min),
        };
        let message = format!(
            "the directives take {wanted}, but {given} {} given",
            if given == 1 { "is" } else { "are" }
        );
        let help = match given < takes.min {
            true => "add the missing arguments; a `~` by itself is written `~~`",
            false => "leave out the last arguments, or add a directive such as `~a` for each",
        };
        self.report(code::WRONG_ARGUMENT.at(form.at(form.args[at].span()), message).help(help), origin);
    }
}

/// `(format destination control argument*)`
fn format(expander: &mut Expander, _: &dyn Environment, form: &Form, origin: Option<OriginId>) {
    let Some(destination) = form.args.first() else { return };
    // A string without a fill pointer is never a destination.
    if let DatumKind::String(_) = destination.kind() {
        let message = "`format` takes a destination first, not its control string";
        let rest = form.args.iter().map(|part| on_one_line(part, 30)).collect::<Vec<_>>().join(" ");
        let help = format!("write `(format t {rest})` to print, `(format nil {rest})` for a string");
        let warning = code::WRONG_ARGUMENT.at(form.at(destination.span()), message);
        if !expander.is_guarded(form.span) {
            expander.report(warning.help(help), origin);
        }
        return;
    }
    expander.directives(form, 1, origin);
}

/// `(case key clause*)`
fn case(expander: &mut Expander, _: &dyn Environment, form: &Form, origin: Option<OriginId>) {
    let Some((last, others)) = form.args.split_last() else { return };
    let is_key =
        |clause: &Datum, names: &[&str]| operator(clause).is_some_and(|key| names.contains(&key.name()));
    // A program about programs may have the keys `if` and `else`.
    let is_about_words = others.iter().any(|clause| is_key(clause, &["IF", "THEN", "ELIF", "WHILE", "WHEN"]));
    if others.len() < 2 || !is_key(last, &["ELSE", "DEFAULT"]) || is_about_words {
        return;
    }
    let key = operator(last).map(|key| key.name().to_lowercase()).unwrap_or_default();
    let message = format!("this clause is for the symbol `{key}`, not for all other values");
    expander.report(
        code::FOREIGN_WORD.at(form.at(last.span()), message).help("write `(t …)` or `(otherwise …)`"),
        origin,
    );
}

/// `(assert fact)`
fn assert(expander: &mut Expander, _: &dyn Environment, form: &Form, origin: Option<OriginId>) {
    let Some(head) = form.args.first().and_then(operator) else { return };
    let test = head.name();
    let is_test = TESTS.contains(&test) || test.len() > 3 && test.ends_with('P');
    if !head.is_in(CL_PACKAGE) || !is_test {
        return;
    }
    let message = "`assert` adds a fact to the database in ESL, and this is a test";
    let written = on_one_line(&form.args[0], 40);
    let help = format!("write `(cl:assert {written})` to check it");
    expander.report(code::WRONG_ARGUMENT.at(form.at(form.args[0].span()), message).help(help), origin);
}

/// A form of the language that has a body after its required parts.
fn body(expander: &mut Expander, environment: &dyn Environment, form: &Form, origin: Option<OriginId>) {
    let Some(signature) = environment.signature(&form.operator) else { return };
    let is_keyword = |item: &Datum| item.as_symbol().is_some_and(|symbol| symbol.name().starts_with('&'));
    let has_whole = signature.lambda_list.elements().next().is_some_and(is_keyword);
    let parameters = signature.lambda_list.elements().skip(if has_whole { 2 } else { 0 });
    let required = parameters.take_while(|item| !is_keyword(item)).count();
    if form.args.len() != required || !is_known(form.datum.span()) {
        return;
    }
    let message = format!("{} has no body, so it runs nothing", name(&form.operator));
    let help = format!("it is written {}", usage(&form.operator, &signature.lambda_list));
    expander.report(code::MISSING_BODY.at(form.head(), message).help(help), origin);
}

/// `(fail cause argument*)`
fn fail(expander: &mut Expander, _: &dyn Environment, form: &Form, _: Option<OriginId>) {
    let Some((cause, arguments)) = form.args.split_first() else { return };
    if let Some(cause) = cause.as_symbol().filter(|cause| cause.is_keyword()) {
        let given = CauseArguments { count: arguments.len() as u32, place: form.span };
        expander.globals.note_failure(cause, given);
    }
}

/// `(with-recovery-procedures (clause*) . body)`
fn recovery(expander: &mut Expander, environment: &dyn Environment, form: &Form, origin: Option<OriginId>) {
    guard(expander, environment, form, origin);
    body(expander, environment, form, origin);
    expander.globals.traps.extend(traps(form));
    let Some(clauses) = form.args.first() else { return };
    for clause in clauses.elements() {
        let Some((head, _)) = clause.as_cons() else { continue };
        let (cause, count) = match head.as_cons() {
            None => (head.as_symbol(), 0),
            Some((cause, parameters)) => {
                let is_required =
                    |item: &&Datum| item.as_symbol().is_some_and(|symbol| !symbol.name().starts_with('&'));
                (cause.as_symbol(), parameters.elements().take_while(is_required).count())
            }
        };
        if let Some(cause) = cause {
            let named = CauseArguments { count: count as u32, place: form.at(head.span()) };
            expander.globals.note_procedure(cause, named);
        }
    }
}

/// `(error control argument*)`, `(error 'type argument*)`
fn error(expander: &mut Expander, environment: &dyn Environment, form: &Form, origin: Option<OriginId>) {
    expander.directives(form, 0, origin);
    types(expander, environment, form, origin);
}

/// A form that handles failures of some types.
fn handler(expander: &mut Expander, environment: &dyn Environment, form: &Form, origin: Option<OriginId>) {
    handled_types(expander, form, origin);
    guard(expander, environment, form, origin);
}

/// A form that handles failures.
fn guard(expander: &mut Expander, _: &dyn Environment, form: &Form, _: Option<OriginId>) {
    expander.guards.push(form.span);
}

/// The warning about a keyword that a local function does not take: `keys` are the number of arguments
/// before the keyword arguments, and the keywords.
pub(super) fn wrong_key(
    function: &str,
    keys: &(usize, Vec<Symbol>),
    args: &[Datum],
    form: &Form,
) -> Option<Diagnostic> {
    let (positional, keys) = keys;
    let given = args.get(*positional..)?;
    let is_known_key =
        |key: &Datum| key.as_symbol().is_none_or(|key| !key.is_keyword() || keys.contains(key));
    let names_all = |key: &Datum| key.as_symbol().is_some_and(|key| key.name() == "ALLOW-OTHER-KEYS");
    if given.iter().step_by(2).any(names_all) {
        return None;
    }
    if !given.len().is_multiple_of(2) {
        let message = format!("{function} takes keywords and values in pairs, but one of them is alone");
        return Some(code::WRONG_ARGUMENT_COUNT.at(form.span, message));
    }
    let unknown = given.iter().step_by(2).find(|key| !is_known_key(key))?;
    let symbol = unknown.as_symbol()?;
    let message = format!("{function} takes no keyword `:{}`", plain(symbol).trim_start_matches(':'));
    let warning = code::UNKNOWN_KEYWORD.at(form.at(unknown.span()), message);
    Some(match keys.iter().find(|key| is_like(key.name(), symbol.name())) {
        Some(key) => warning.help(format!("did you mean `:{}`?", key.name().to_lowercase())),
        None => warning,
    })
}
