use proptest::prelude::*;
use serde_json::Value as Json;

use super::show_result;
use crate::builtins::json;
use crate::heap::Kind;
use crate::number::Number;
use crate::raise::{Exit, Outcome};
use crate::table::Table;
use crate::value::Value;
use crate::vm::Vm;

/// Reads a string from its first character on, in which `false` is `NIL` and `null` is `:NULL`.
fn read_value(vm: &mut Vm, string: Value, are_tables: bool) -> Outcome {
    let null = vm.names.keyword(&mut vm.heap, "NULL").unwrap();
    let are_tables = Value::boolean(are_tables);
    json::value(vm, &[string, Value::small(0), are_tables, are_tables, Value::NIL, null])
}

/// Returns what comes of reading a text from its first character on.
fn read(text: &str, are_tables: bool) -> String {
    let mut vm = Vm::for_tests();
    let string = vm.heap.alloc_str(text).unwrap();
    let result = read_value(&mut vm, string, are_tables);
    assert_eq!(result, Err(Exit::Values), "{text}");
    let values = vm.exchange.values.clone();
    show_result(&mut vm, &Ok(values.to_vec()))
}

#[test]
fn values_are_read() {
    for (text, expected) in [
        (" 12,", "12 ; 3 ; NIL"),
        ("-0.5e1", "-5.0 ; 6 ; NIL"),
        ("123456789012345678901234567890", "123456789012345678901234567890 ; 30 ; NIL"),
        ("[-0, 0]", "#(-0.0 0) ; 7 ; NIL"),
        ("[true, false,null]", "#(T NIL NULL) ; 18 ; NIL"),
        ("{}", "NIL ; 2 ; NIL"),
        ("[]x", "#() ; 2 ; NIL"),
        (r#"{"a": [1 ,2], "b":{"c":3}}"#, r#"(("a" . #(1 2)) ("b" ("c" . 3))) ; 26 ; NIL"#),
        (r#""a\n\u00e4\ud83d\ude00""#, "\"a\\nä😀\" ; 23 ; NIL"),
    ] {
        assert_eq!(read(text, false), expected, "{text}");
    }
    assert_eq!(read(r#"{"a":1}"#, true), "<Some(HashTable)> ; 7 ; NIL");
}

#[test]
fn faults_have_their_place() {
    for (text, at, reason) in [
        ("", 0, "expected a value"),
        ("[1 2]", 3, "expected `,` or `]`"),
        ("[1,]", 3, "expected a value"),
        ("{1:2}", 1, "expected a key, a string"),
        (r#"{"a" 2}"#, 5, "expected `:` after the key"),
        (r#"{"a":2"#, 6, "expected `,` or `}`"),
        ("tru", 0, "expected a value"),
        ("-", 1, "expected a digit"),
        ("1.", 2, "expected a digit"),
        ("[007]", 1, "expected no digit after a leading zero"),
        ("1e999", 0, "expected a number in the range of doubles"),
        ("\"abc", 4, "the string has no end"),
        ("\"a\nb\"", 2, "a control character in a string has to be escaped"),
        (r#""\x""#, 1, "expected one of \"\\/bfnrt or u after `\\`"),
        (r#""\ud83dx""#, 1, "expected the second half of a pair of surrogates"),
        (r#""\u12""#, 1, "expected four hexadecimal digits after `\\u`"),
    ] {
        assert_eq!(read(text, false), format!("NIL ; {at} ; {reason:?}"), "{text}");
    }
}

#[test]
fn what_is_long_or_deep_is_left_to_others() {
    assert_eq!(read(&"[".repeat(200), false), "NIL ; 0 ; T");
    assert_eq!(read(&format!(" [{}]", "1,".repeat(5000)), false), "NIL ; 1 ; T");
    assert_eq!(read(&format!("\"{}\"", "x".repeat(9000)), false), "NIL ; 0 ; T");
    assert_eq!(read(&"9".repeat(9000), false), "NIL ; 0 ; T");
    // The module `:json` skips the remaining blanks.
    assert_eq!(read(&format!("{}1", " ".repeat(9000)), false), "NIL ; 8192 ; T");
}

/// Returns what another library would have made of the text of a value.
fn as_json(vm: &mut Vm, v: Value) -> Json {
    if v.is_nil() || v == Value::T {
        return Json::Bool(v == Value::T);
    }
    match Number::of(&vm.heap, v) {
        Some(Number::Int(n)) => return n.to_big().to_string().parse().expect("it is a number"),
        Some(Number::Float(x)) => return Json::from(x),
        Some(Number::Ratio(_)) => unreachable!("no text of JSON is one"),
        None => {}
    }
    if let Some(text) = vm.heap.string_text(v) {
        return Json::String(text);
    }
    if let Some(items) = vm.heap.vector(v).map(<[Value]>::to_vec) {
        return items.into_iter().map(|item| as_json(vm, item)).collect();
    }
    if vm.heap.is(v, Kind::HashTable) {
        let table = Table::of(&vm.heap, v).expect("it is a table");
        let entries: Vec<(Value, Value)> =
            (0..table.used(&vm.heap)).filter_map(|entry| table.entry(&vm.heap, entry)).collect();
        let member = |(key, value)| (vm.heap.string_text(key).expect("it is a string"), as_json(vm, value));
        return Json::Object(entries.into_iter().map(member).collect());
    }
    Json::Null
}

/// Returns the value of a text, and the index after it; `None` if it is wrong.
fn value_of(text: &str) -> Option<(Json, usize)> {
    let mut vm = Vm::for_tests();
    let string = vm.heap.alloc_str(text).unwrap();
    read_value(&mut vm, string, true).expect_err("there are three values");
    let values = vm.exchange.values.clone();
    let end = values[1].as_index().expect("it is an index");
    values[2].is_nil().then(|| (as_json(&mut vm, values[0]), end))
}

fn any_json() -> impl Strategy<Value = Json> {
    let leaf = prop_oneof![
        Just(Json::Null),
        any::<bool>().prop_map(Json::from),
        any::<i64>().prop_map(Json::from),
        (-1000_i64..1000).prop_map(Json::from),
        any::<u64>().prop_map(Json::from),
        any::<f64>().prop_filter("JSON has no others", |x| x.is_finite()).prop_map(Json::from),
        any::<String>().prop_map(Json::from),
        "[a-z\"\\\\\n\u{7}]{0,9}".prop_map(Json::from),
    ];
    leaf.prop_recursive(5, 40, 6, |inner| {
        prop_oneof![
            prop::collection::vec(inner.clone(), 0..6).prop_map(Json::from),
            prop::collection::btree_map("[a-c\"\\\\]{0,3}", inner, 0..6)
                .prop_map(|members| Json::Object(members.into_iter().collect())),
        ]
    })
}

/// Returns a value without its numbers, which another library may have rounded otherwise.
fn without_numbers(value: Json) -> Json {
    match value {
        Json::Number(_) => Json::Null,
        Json::Array(items) => items.into_iter().map(without_numbers).collect(),
        Json::Object(members) => {
            Json::Object(members.into_iter().map(|(key, value)| (key, without_numbers(value))).collect())
        }
        value => value,
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]

    #[test]
    fn what_another_library_writes_is_read(value in any_json(), is_pretty: bool) {
        let text = if is_pretty { serde_json::to_string_pretty(&value) } else { serde_json::to_string(&value) };
        let text = text.unwrap();
        prop_assert_eq!(value_of(&text), Some((value, text.chars().count())));
    }

    #[test]
    fn what_another_library_refuses_is_refused(
        value in any_json(),
        at: prop::sample::Index,
        what in "[\\[\\]{},:\"\\\\u0-9eE.+ a-]{0,2}",
    ) {
        let mut characters: Vec<char> = serde_json::to_string(&value).unwrap().chars().collect();
        let at = at.index(characters.len());
        characters.splice(at..=at, what.chars());
        let text: String = characters.iter().collect();
        let ours = value_of(&text);
        let is_whole = |end: usize| characters[end..].iter().all(|&character| " \t\n\r".contains(character));
        let ours = ours.filter(|&(_, end)| is_whole(end)).map(|(value, _)| without_numbers(value));
        prop_assert_eq!(ours, serde_json::from_str(&text).ok().map(without_numbers), "{}", text);
    }
}
