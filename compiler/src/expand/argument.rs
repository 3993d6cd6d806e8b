//! Constant arguments that a function refuses, and how messages show the parameters of a function.

use esl_bytecode::builtin::Builtin;
use esl_bytecode::datum::Datum;
use esl_bytecode::kind::{ArgumentKind, ConstantClass, ParameterKinds};
use esl_bytecode::symbol::Symbol;

use super::form::{constant_value, is_constant, on_one_line, plain, quoted};

/// Characters of a lambda list that a message shows.
const SHOWN: usize = 60;

/// Returns the first constant among the arguments of a builtin that it refuses, and what is wrong with it: "a
/// number here, not the string `"2"`".
pub(super) fn refused(builtin: Builtin, args: &[Datum]) -> Option<(&Datum, String)> {
    let kinds = ParameterKinds::of(builtin);
    args.iter()
        .enumerate()
        .find_map(|(index, argument)| Some((argument, refused_as(kinds.at(index)?, argument)?)))
}

/// As [`refused`], for the argument of a parameter of this name.
pub(super) fn refused_by(parameter: &str, argument: &Datum) -> Option<String> {
    refused_as(ArgumentKind::of_parameter(parameter)?, argument)
}

fn refused_as(kind: ArgumentKind, argument: &Datum) -> Option<String> {
    if !is_constant(argument) {
        return None;
    }
    let value = constant_value(argument)?;
    let class = ConstantClass::of(value.kind())?;
    (!kind.may_be(class)).then(|| format!("{} here, not {} {}", kind.noun(), class.noun(), quoted(argument)))
}

/// Returns how a function is called, between backticks: its name and its lambda list.
pub(super) fn usage(function: &Symbol, lambda_list: &Datum) -> String {
    let mut text = plain(function);
    for parameter in lambda_list.elements() {
        let shown = shown(parameter);
        if text.chars().count() + shown.chars().count() > SHOWN {
            text.push_str(" …");
            break;
        }
        text.push(' ');
        text.push_str(&shown);
    }
    format!("`({text})`")
}

/// Returns a parameter as messages show it: its name or key, and its default unless that is `NIL`.
fn shown(parameter: &Datum) -> String {
    let Some((named, rest)) = parameter.as_cons() else {
        return on_one_line(parameter, 30);
    };
    let key = named.as_cons().map_or(named, |(key, _)| key);
    let Some(symbol) = key.as_symbol() else { return on_one_line(parameter, 30) };
    let name = plain(symbol).trim_start_matches(':').to_string();
    match rest.elements().next().filter(|default| !default.is_nil()) {
        Some(default) => format!("({name} {})", on_one_line(default, 20)),
        None => name,
    }
}
