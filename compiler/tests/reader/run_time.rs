//! Reading one datum from a place in a text, as running programs do.

use esl_compiler::reader::{BareEnvironment, read_datum};

use crate::show;

fn check(text: &str, start: usize, expected: &str, end: usize) {
    let (datum, offset) = read_datum(&mut BareEnvironment::new(), text, start).expect(text);
    assert_eq!(
        (datum.map_or("nothing".into(), |datum| show(&datum)).as_str(), offset),
        (expected, end),
        "{text}"
    );
}

#[test]
fn the_offset_after_the_datum_is_returned() {
    check("foo bar", 0, "FOO", 3);
    check("foo bar", 3, "BAR", 7);
    check("(a)b", 0, "(A)", 3);
    check("xyz", 1, "YZ", 3);
    check("é x", 0, "É", 2);
    check("a\"b\"", 0, "A", 1);
    check("a\"b\"", 1, "\"b\"", 4);
    check("#-esl a b c", 0, "B", 9);
}

#[test]
fn at_the_end_there_is_no_datum() {
    check("", 0, "nothing", 0);
    check("a ; rest", 1, "nothing", 8);
    check(" #| |# ", 0, "nothing", 7);
    check("a", 17, "nothing", 1);
}
