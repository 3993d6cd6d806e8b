//! Diagnostics of constant arguments are true: each builtin refuses, when it is called, each constant that
//! the kind of its parameter refuses; and calls return only with arguments and results of the types in the
//! builtin table.

use esl::Config;
use esl::host::VirtualHost;
use esl::program::{self, Source};
use esl_bytecode::builtin::{BUILTINS, BuiltinInfo, Visibility};
use esl_bytecode::kind::{ArgumentKind, ConstantClass, ValueType};
use esl_conformance::trials::{Trial, contradictions};

/// A constant of each class.
const CONSTANTS: &[(ConstantClass, &str)] = &[
    (ConstantClass::Integer, "7"),
    (ConstantClass::Number, "7.5"),
    (ConstantClass::Character, "#\\x"),
    (ConstantClass::String, "\"text\""),
    (ConstantClass::Nil, "nil"),
    (ConstantClass::Symbol, "'word"),
    (ConstantClass::Pair, "'(1 2)"),
    (ConstantClass::Vector, "#(1 2)"),
];

/// Returns a form whose value is of the kind.
fn sample(kind: Option<ArgumentKind>) -> &'static str {
    match kind {
        Some(ArgumentKind::Number | ArgumentKind::Integer) | None => "1",
        Some(ArgumentKind::Character) => "#\\a",
        Some(ArgumentKind::Text) => "\"ab\"",
        Some(ArgumentKind::List | ArgumentKind::Sequence) => "(list 1 2)",
        Some(ArgumentKind::Array) => "(vector 1 2)",
        Some(ArgumentKind::Table) => "(make-hash-table)",
        Some(ArgumentKind::Symbol) => "'a",
        Some(ArgumentKind::Function) => "#'list",
    }
}

/// Returns the calls of a builtin with one refused constant each.
fn calls(info: &BuiltinInfo) -> Vec<String> {
    let mut calls = Vec::new();
    let words: Vec<&str> = info.lambda_list.split_whitespace().collect();
    let names: Vec<&str> = words.into_iter().filter(|word| !word.starts_with('&')).collect();
    for (at, name) in names.iter().enumerate() {
        let Some(kind) = ArgumentKind::of_parameter(name) else { continue };
        for (class, constant) in CONSTANTS.iter().filter(|(class, _)| !kind.may_be(*class)) {
            let before = names[..at].iter().map(|name| sample(ArgumentKind::of_parameter(name)));
            let required = info.arity.min as usize;
            let after = names.iter().take(required).skip(at + 1);
            let after = after.map(|name| sample(ArgumentKind::of_parameter(name)));
            let arguments: Vec<&str> = before.chain([*constant]).chain(after).collect();
            let call = format!("({} {})", info.name, arguments.join(" "));
            calls.push(format!(
                "(handler-case (progn {call} (format t \"~a of class {class:?}~%\" '{}))\n  (error () nil))\n",
                call.replace("#'", "'")
            ));
        }
    }
    calls
}

#[test]
fn builtins_refuse_the_constants_that_the_compiler_warns_of() {
    let public = BUILTINS.iter().filter(|info| info.visibility != Visibility::Internal);
    let calls: Vec<String> = public.flat_map(calls).collect();
    assert!(calls.len() > 500, "{} calls", calls.len());
    let compiled = program::compile(&[Source::new("constants.esl", calls.concat())]);
    let program = compiled.program.expect("the calls compile");
    let host = VirtualHost::new();
    let captured = host.captured();
    program::run(&program, Config::default(), Box::new(host)).expect("it runs");
    assert_eq!(captured.output(), "", "these calls return");
}

/// Returns the trial of a builtin whose row says something about types.
fn trial(info: &BuiltinInfo) -> Option<Trial> {
    let mut needs = Vec::new();
    let mut is_rest = false;
    for word in info.lambda_list.split_whitespace() {
        match word {
            "&rest" => is_rest = true,
            "&optional" => {}
            name => needs.push(ArgumentKind::of_parameter(name).map(ArgumentKind::values)),
        }
    }
    let says = info.gives.is_some() || needs.iter().any(Option::is_some);
    if !says || matches!(info.name, "FUNCALL" | "APPLY") {
        return None;
    }
    if is_rest {
        let rest = needs.last().copied().flatten();
        needs.resize(4, rest);
    }
    let needs = needs.into_iter().map(|need| need.unwrap_or(ValueType::ANY)).collect();
    let most = info.arity.max.unwrap_or(2).min(4);
    let (name, counts) = (info.name.to_owned(), info.arity.min..=most);
    Some(Trial { name, counts, needs, gives: info.gives.unwrap_or(ValueType::ANY), tests: info.tests })
}

#[test]
fn calls_of_builtins_return_only_as_their_types_say() {
    let public = BUILTINS.iter().filter(|info| info.visibility != Visibility::Internal);
    let trials: Vec<Trial> = public.filter_map(trial).collect();
    assert!(trials.len() > 200, "{} trials", trials.len());
    let wrong = contradictions(&trials);
    assert!(wrong.is_empty(), "{wrong:#?}");
}
