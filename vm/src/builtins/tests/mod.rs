//! Builtins called as a program would call them: a form of constants and calls, and what comes of it as text.
//!
//! The evaluator here knows nothing but builtins. Names of internal ones are written with their `%`.

use esl_bytecode::builtin::{BUILTINS, BuiltinInfo};
use esl_bytecode::symbol::Symbol;

use crate::builtins::NATIVES;
use crate::builtins::array::vector_elements;
use crate::equality::characters_of;
use crate::number::{self, Int, Number};
use crate::raise::{Exit, Expected, Raised};
use crate::value::Value;
use crate::vm::Vm;

mod anything;
mod arrays;
mod characters;
mod json;
mod lists;
mod numbers;
mod streams;
mod strings;
mod symbols;
mod tables;

/// Checks what a form gives: its values, or `type-error DATUM TYPE`, `slowly` and the like.
#[track_caller]
fn check(form: &str, expected: &str) {
    assert_eq!(evaluate(&mut Vm::for_tests(), form), expected, "{form}");
}

/// Checks forms, one after the other in one machine, in which `$0`, `$1` … are the values of those before.
#[track_caller]
fn check_all(cases: &[(&str, &str)]) {
    let mut vm = Vm::for_tests();
    let mut earlier = Vec::new();
    for (form, expected) in cases {
        let result = Evaluator { vm: &mut vm, earlier: &earlier }.run(form);
        assert_eq!(show_result(&mut vm, &result), *expected, "{form}");
        earlier.push(result.ok().and_then(|values| values.first().copied()).unwrap_or(Value::NIL));
    }
}

fn evaluate(vm: &mut Vm, form: &str) -> String {
    let result = Evaluator { vm, earlier: &[] }.run(form);
    show_result(vm, &result)
}

struct Evaluator<'a> {
    vm: &'a mut Vm,
    earlier: &'a [Value],
}

impl Evaluator<'_> {
    fn run(&mut self, form: &str) -> Result<Vec<Value>, Exit> {
        let tokens = tokens(form);
        let mut rest = tokens.as_slice();
        let values = self.form(&mut rest)?;
        assert!(rest.is_empty(), "{form} goes on with {rest:?}");
        Ok(values)
    }

    fn form(&mut self, rest: &mut &[String]) -> Result<Vec<Value>, Exit> {
        match rest[0].as_str() {
            "(" => {
                let info = row(&rest[1]);
                *rest = &rest[2..];
                let mut arguments = Vec::new();
                while rest[0] != ")" {
                    let values = self.form(rest)?;
                    arguments.push(values.first().copied().unwrap_or(Value::NIL));
                }
                *rest = &rest[1..];
                self.call(info, &arguments)
            }
            "'" => {
                *rest = &rest[1..];
                Ok(vec![self.datum(rest)])
            }
            _ => Ok(vec![self.datum(rest)]),
        }
    }

    fn call(&mut self, info: &BuiltinInfo, arguments: &[Value]) -> Result<Vec<Value>, Exit> {
        let count = arguments.len() as u32;
        let fits = count >= info.arity.min && info.arity.max.is_none_or(|max| count <= max);
        assert!(fits, "{} of {count} arguments", info.name);
        match NATIVES[info.builtin as usize](self.vm, arguments) {
            Ok(value) => Ok(vec![value]),
            Err(Exit::Values) => Ok(self.vm.exchange.values.clone()),
            Err(exit) => {
                assert!(exit != Exit::Slowly || info.slowly.is_some(), "{} has no twin", info.name);
                Err(exit)
            }
        }
    }

    fn datum(&mut self, rest: &mut &[String]) -> Value {
        let token = rest[0].clone();
        *rest = &rest[1..];
        match token.as_str() {
            "(" => self.list(rest),
            "#(" => {
                let list = self.list(rest);
                let items = crate::builtins::list::list_items(self.vm, list, usize::MAX).unwrap();
                self.vm.heap.alloc_vector(&items).unwrap()
            }
            _ => self.atom(&token),
        }
    }

    fn list(&mut self, rest: &mut &[String]) -> Value {
        let mut items = Vec::new();
        let mut tail = Value::NIL;
        while rest[0] != ")" {
            if rest[0] == "." {
                *rest = &rest[1..];
                tail = self.datum(rest);
            } else {
                let item = self.datum(rest);
                items.push(item);
            }
        }
        *rest = &rest[1..];
        self.vm.heap.list_with_tail(&items, tail).unwrap()
    }

    fn atom(&mut self, token: &str) -> Value {
        let vm = &mut *self.vm;
        if let Some(number) = token.strip_prefix('$') {
            return self.earlier[number.parse::<usize>().unwrap()];
        }
        if let Some(text) = token.strip_prefix('"') {
            return vm.heap.alloc_str(text).unwrap();
        }
        if let Some(name) = token.strip_prefix("#\\") {
            let mut characters = name.chars();
            return match (characters.next(), characters.next()) {
                (Some(c), None) => Value::character(c as u32).unwrap(),
                _ => Value::character(crate::character::named(name).unwrap()).unwrap(),
            };
        }
        if let Some(number) = parse_number(vm, token) {
            return number;
        }
        match token {
            "nil" => Value::NIL,
            "t" => Value::T,
            _ => vm.names.intern(&mut vm.heap, &Symbol::cl(&token.to_uppercase())).unwrap(),
        }
    }
}

fn row(name: &str) -> &'static BuiltinInfo {
    let name = name.to_uppercase();
    BUILTINS.iter().find(|info| info.name == name).unwrap_or_else(|| panic!("there is no builtin {name}"))
}

/// Parentheses, quotes, strings (with `"` in front), and words.
fn tokens(text: &str) -> Vec<String> {
    let mut tokens = Vec::new();
    let mut rest = text.trim_start();
    while let Some(first) = rest.chars().next() {
        let length = match first {
            '(' | ')' | '\'' => 1,
            '#' if rest[1..].starts_with('(') => 2,
            '"' => 1 + rest[1..].find('"').expect("a string ends"),
            '#' => {
                // The character itself may be a parenthesis.
                let second = rest[2..].chars().next().map_or(2, |c| 2 + c.len_utf8());
                rest[second..].find([' ', ')']).map_or(rest.len(), |at| second + at)
            }
            _ => rest.find([' ', '(', ')']).unwrap_or(rest.len()),
        };
        tokens.push(rest[..length].to_string());
        let after = if first == '"' { length + 1 } else { length };
        rest = rest[after..].trim_start();
    }
    tokens
}

/// Returns an integer (also as `2^70`), a ratio or a float.
fn parse_number(vm: &mut Vm, token: &str) -> Option<Value> {
    if let Some((numerator, denominator)) = token.split_once('/') {
        let (numerator, denominator) = (parse_number(vm, numerator)?, parse_number(vm, denominator)?);
        return number::divide(vm, numerator, denominator).ok();
    }
    if let Some(power) = token.strip_prefix("2^") {
        let n = Int::ONE.shifted_left(power.parse().ok()?);
        return vm.integer_value("", &n).ok();
    }
    if let Ok(n) = token.parse::<num_bigint::BigInt>() {
        return vm.integer_value("", &Int::from_big(n)).ok();
    }
    let starts_like_one = token.trim_start_matches('-').starts_with(|c: char| c.is_ascii_digit());
    let x = token.parse().ok().filter(|_| starts_like_one)?;
    vm.heap.float(x).ok()
}

fn show_result(vm: &mut Vm, result: &Result<Vec<Value>, Exit>) -> String {
    match result {
        Ok(values) if values.is_empty() => "no values".into(),
        Ok(values) => values.iter().map(|&v| show(vm, v)).collect::<Vec<_>>().join(" ; "),
        Err(Exit::Raise) => match vm.exchange.raised.take() {
            Some(Raised::Type(datum, expected)) => {
                let expected = match expected {
                    Expected::Type(name) => name.to_string(),
                    Expected::Index(limit) => format!("index below {limit}"),
                    Expected::Specifier(specifier) => show(vm, specifier),
                    Expected::Written(specifier) => specifier.to_string(),
                };
                format!("type-error {} {expected}", show(vm, datum))
            }
            Some(raised @ Raised::Bounds(..)) => {
                let arguments = raised.arguments(&mut vm.heap, &mut vm.names).unwrap();
                format!("type-error {} {}", show(vm, arguments[1]), show(vm, arguments[2]))
            }
            Some(Raised::Variable(symbol, datum, Expected::Type(name))) => {
                format!("type-error {} of {} {name}", show(vm, datum), show(vm, symbol))
            }
            Some(Raised::DivisionByZero(..)) => "division-by-zero".into(),
            Some(Raised::FloatOverflow(_)) => "floating-point-overflow".into(),
            Some(Raised::Arithmetic(..)) => "arithmetic-error".into(),
            Some(Raised::UnboundVariable(symbol)) => format!("unbound-variable {}", show(vm, symbol)),
            Some(Raised::EndOfFile(_)) => "end-of-file".into(),
            Some(Raised::Stream(_, text)) => format!("stream-error: {text}"),
            Some(Raised::Program(text)) => format!("program-error: {text}"),
            Some(Raised::Parse(text)) => format!("parse-error: {text}"),
            Some(Raised::Denied(right, object, flag)) => {
                format!("denied {} {object} {}", right.name(), flag.unwrap_or_default())
            }
            Some(Raised::File(name, text)) => format!("file-error {name}: {text}"),
            Some(Raised::Package(_, text)) => format!("package-error: {text}"),
            Some(Raised::Simple(text)) => format!("error: {text}"),
            other => format!("{other:?}"),
        },
        Err(exit) => format!("{exit:?}").to_lowercase(),
    }
}

/// Returns a datum as `prin1` would write it.
fn show(vm: &Vm, v: Value) -> String {
    let heap = &vm.heap;
    match Number::of(heap, v) {
        Some(Number::Int(n)) => return n.to_big().to_string(),
        Some(Number::Ratio(r)) => return format!("{}/{}", r.numerator.to_big(), r.denominator.to_big()),
        Some(Number::Float(x)) => return number::text::float_text(x),
        None => {}
    }
    if let Some(code) = v.as_character() {
        let name = crate::character::name(code).filter(|_| code != 32);
        return format!("#\\{}", name.unwrap_or_else(|| char::from_u32(code).unwrap().into()));
    }
    if let Some(characters) = characters_of(heap, v) {
        let text: String = characters.iter().filter_map(|&code| char::from_u32(code)).collect();
        return format!("{text:?}");
    }
    if let Some(symbol) = vm.names.object_of(heap, v).and_then(|object| heap.symbol(object)) {
        return heap.string_text(symbol.name).unwrap();
    }
    if let Some(elements) = vector_elements(heap, v) {
        let items: Vec<String> = (0..elements.len()).map(|at| show(vm, elements.get(at).unwrap())).collect();
        return format!("#({})", items.join(" "));
    }
    let (mut text, mut rest) = (String::from("("), v);
    let mut shown = 0;
    while let Some(pair) = heap.as_cons(rest) {
        shown += 1;
        if shown > 12 {
            return text[..16].to_string() + " ...)";
        }
        if text.len() > 1 {
            text.push(' ');
        }
        text += &show(vm, pair.car);
        rest = pair.cdr;
    }
    match (v.is_cons(), rest.is_nil()) {
        (false, _) => format!("<{:?}>", heap.kind(v)),
        (true, true) => text + ")",
        (true, false) => format!("{text} . {})", show(vm, rest)),
    }
}

#[test]
fn every_twin_is_named_for_its_builtin() {
    for info in BUILTINS {
        if let Some(twin) = info.slowly {
            assert_eq!(twin, format!("%SLOW-{}", info.name.trim_start_matches('%')));
        }
    }
}
