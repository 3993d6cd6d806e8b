//! Diagnostics of constant arguments are true: each builtin refuses, when it is called, each constant that
//! the kind of its parameter refuses; and calls return only with arguments and results of the types in the
//! builtin table.

use esl::Config;
use esl::host::VirtualHost;
use esl::program::{self, Source};
use esl_bytecode::builtin::{BUILTINS, BuiltinInfo, Visibility};
use esl_bytecode::kind::{ArgumentKind, ConstantClass, ValueType};

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

/// The classes of values, in the order of the samples' numbers in [`CALLER`].
const CLASSES: &[ValueType] = &[
    ValueType::NIL,
    ValueType::OTHER_SYMBOL,
    ValueType::INTEGER,
    ValueType::RATIO,
    ValueType::FLOAT,
    ValueType::COMPLEX,
    ValueType::CHARACTER,
    ValueType::STRING,
    ValueType::PAIR,
    ValueType::OTHER_ARRAY,
    ValueType::TABLE,
    ValueType::FUNCTION,
    ValueType::INSTANCE,
    ValueType::STREAM,
    ValueType::OTHER,
];

/// Calls builtins with all pairs of samples, and tells of calls that return against the table.
const CALLER: &str = r#"
(defstruct thing a)
(defun sample (number)
  (case number
    (0 nil) (1 'word) (2 7) (3 1/2) (4 7.5) (5 #c(1 2)) (6 #\x) (7 (copy-seq "text")) (8 (list 1 2))
    (9 (vector 1 2)) (10 (make-hash-table)) (11 #'list) (12 (make-thing)) (13 (make-string-output-stream))
    (14 (make-event)) (15 0) (16 1) (17 (make-array 2 :fill-pointer 0)) (18 (list (cons 1 2)))))
(defun class-number (value)
  (cond ((null value) 0) ((symbolp value) 1) ((integerp value) 2) ((rationalp value) 3)
        ((floatp value) 4) ((complexp value) 5) ((characterp value) 6) ((stringp value) 7)
        ((consp value) 8) ((arrayp value) 9) ((hash-table-p value) 10) ((functionp value) 11)
        ((thing-p value) 12) ((streamp value) 13) (t 14)))
(defun check (name arguments classes needs gives tests)
  (handler-case
      (let* ((value (apply name arguments)) (class (class-number value)))
        (unless (logbitp class gives)
          (format t "!!~a ~a gives ~a~%" name classes class))
        (when (and tests (not (eq (and value t) (logbitp (first classes) tests))))
          (format t "!!~a ~a tests~%" name classes))
        (loop for class in classes for need in needs
              unless (logbitp class need) do (format t "!!~a takes ~a~%" name classes)))
    (error () nil)))
(defun try (name counts needs gives tests)
  (dolist (count counts)
    (dotimes (first (if (> count 0) 19 1))
      (dotimes (second (if (> count 1) 19 1))
        (let* ((numbers (subseq (list first second 16 2) 0 count))
               (arguments (mapcar #'sample numbers)))
          (check name arguments (mapcar #'class-number arguments) needs gives tests))))))
"#;

fn mask(types: Option<ValueType>) -> u32 {
    let types = types.unwrap_or(ValueType::ANY);
    let bits = CLASSES.iter().enumerate().filter(|(_, class)| types.contains(**class));
    bits.map(|(index, _)| 1 << index).sum()
}

/// Returns the form that tries a builtin whose row says something about types.
fn trial(info: &BuiltinInfo) -> Option<String> {
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
    let most = info.arity.max.unwrap_or(2).min(4);
    let counts: Vec<String> = (info.arity.min..=most).map(|count| count.to_string()).collect();
    let needs: Vec<String> = needs.into_iter().map(|need| mask(need).to_string()).collect();
    let tests = info.tests.map_or("nil".to_string(), |tests| mask(Some(tests)).to_string());
    let (name, counts, needs) = (info.name, counts.join(" "), needs.join(" "));
    Some(format!("(try '{name} '({counts}) '({needs}) {} {tests})\n", mask(info.gives)))
}

#[test]
fn calls_of_builtins_return_only_as_their_types_say() {
    let public = BUILTINS.iter().filter(|info| info.visibility != Visibility::Internal);
    let trials: Vec<String> = public.filter_map(trial).collect();
    assert!(trials.len() > 200, "{} trials", trials.len());
    let text = format!("{CALLER}{}", trials.concat());
    let compiled = program::compile(&[Source::new("types.esl", text)]);
    let program = compiled.program.expect("the calls compile");
    let host = VirtualHost::new();
    let captured = host.captured();
    program::run(&program, Config::default(), Box::new(host)).expect("it runs");
    let output = captured.output();
    let wrong: Vec<&str> = output.lines().filter(|line| line.contains("!!")).collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
}
