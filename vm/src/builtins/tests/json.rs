use super::show_result;
use crate::builtins::json;
use crate::raise::Exit;
use crate::value::Value;
use crate::vm::Vm;

/// Returns what comes of reading a text from its first character on.
fn read(text: &str, are_tables: bool) -> String {
    let mut vm = Vm::for_tests();
    let string = vm.heap.alloc_str(text).unwrap();
    let result = json::value(&mut vm, &[string, Value::small(0), Value::boolean(are_tables)]);
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
    // The blanks are skipped by whoever takes over.
    assert_eq!(read(&format!("{}1", " ".repeat(9000)), false), "NIL ; 8192 ; T");
}
