//! The data that texts denote.

use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::symbol::Home;

use crate::{codes, read_all, read_one, show, snapshot};

/// Reads each line of `source` by itself.
fn check(name: &str, source: &str) {
    let shown: Vec<String> = source.lines().map(|line| show(&read_one(line))).collect();
    snapshot(name, source, &shown.join("\n"));
}

fn check_one(source: &str, expected: &str) {
    assert_eq!(show(&read_one(source)), expected, "{source}");
}

#[test]
fn names() {
    check(
        "data-names",
        "foo\nFoo\n|foo Bar|\na\\b\nfoo|bar|baz\n|a\\|b|\n||\nété\nstraße\n:key\n:|low|\ncl:car\ncl::car\n|1|\n1+\n|.|\n#:g\n#:|low|\nnil\nt\n()\ncl:nil\n:nil\n..a\na.b",
    );
}

#[test]
fn numbers() {
    check(
        "data-numbers",
        "1\n1.\n+5\n-0\n6/4\n-4/2\n.5\n1e3\n1d0\n1.5f0\n-0.0\n1e23\n5e-324\n1e-400\n1.7976931348623157e308\n#xFF\n#x-10\n#b101\n#o777\n#36rZZ\n#x1/F\n#2R11\n12345678901234567890123456789",
    );
}

#[test]
fn characters_and_strings() {
    check(
        "data-characters",
        "#\\a\n#\\A\n#\\space\n#\\SPACE\n#\\Newline\n#\\Linefeed\n#\\(\n#\\;\n#\\\\\n#\\|\n#\\λ\n#\\U+00E9\n#\\U00E9\n#\\U\n#\\Null\n#\\Del\n#\\U+1F600\n#\\ \n\"plain\"\n\"a\\\"b\"\n\"back\\\\slash\"\n\"\\a\\b\"\n\"\"\n\"λ\"",
    );
}

#[test]
fn lists_vectors_and_arrays() {
    check(
        "data-compound",
        "(1 2 3)\n(1 . 2)\n(1 2 . 3)\n(1 . (2 3))\n(a .b)\n(a. b)\n(1 .5)\n((a) b)\n#(1 2)\n#()\n#3(a b)\n#0()\n#2A((1 2) (3 4))\n#2A(\"ab\" #(1 2))\n#0A7\n#1A(1 2)\n#3A(((1) (2)))\n#2A()\n#2A(())\n#3A(())",
    );
}

#[test]
fn marks() {
    check(
        "data-marks",
        "'a\n#'car\n''a\n`(a ,b ,@c)\n`(a ,.b)\n`(a `(b ,(c ,d)))\n`#(,a ,@b)\n``(,,@a)\n`(a . ,b)\n`(a ',b)\n#?x",
    );
}

#[test]
fn marks_are_lists_of_esl_symbols() {
    let datum = read_one("`(a ,b ,@c #?d)");
    assert_eq!(
        print_all(&datum),
        "(ESL::%BACKQUOTE (ESL-USER::A (ESL::%UNQUOTE ESL-USER::B) (ESL::%UNQUOTE-SPLICING ESL-USER::C) (ESL::LOGICAL-VALUE ESL-USER::?D)))"
    );
}

/// A list with nothing abbreviated.
fn print_all(datum: &Datum) -> String {
    match datum.kind() {
        DatumKind::Cons(..) => {
            let items: Vec<String> =
                datum.as_list().expect("a proper list").into_iter().map(print_all).collect();
            format!("({})", items.join(" "))
        }
        DatumKind::Symbol(symbol) => format!("{symbol:?}"),
        _ => datum.to_string(),
    }
}

#[test]
fn features_choose_what_is_read() {
    check_one("(1 #+esl 2 #-esl 3 4)", "(1 2 4)");
    check_one("(#+common-lisp a #-common-lisp b)", "(A)");
    check_one("(#+:esl a)", "(A)");
    check_one("(#+(and esl common-lisp) a #+(and esl sbcl) b)", "(A)");
    check_one("(#+(or sbcl esl) a #+(or) b #+(and) c)", "(A C)");
    check_one("(#+(not sbcl) a #-(not sbcl) b)", "(A)");
    check_one("(#+(and (or sbcl esl) (not (and sbcl esl))) a)", "(A)");
    check_one("#-esl #-esl a b c", "C");
    check_one("#+sbcl #+esl a b", "B");
    check_one("#+esl #+sbcl a b", "B");
    check_one("'#+sbcl a b", "'B");
    check_one("(a #+sbcl b)", "(A)");
    check_one("(a . #-esl b c)", "(A . C)");
}

#[test]
fn what_a_feature_leaves_out_only_has_to_nest() {
    check_one(
        "(a #+sbcl (sb-ext:foo #.(bar) #S(x) #c(1 2) #*01 #1=x #1# ,y #<z> #\\Nonsense 1/0 (. .)) b)",
        "(A B)",
    );
    assert_eq!(codes("#+sbcl \"abc"), ["unclosed-string"]);
    assert_eq!(codes("#+sbcl (abc"), ["unclosed-list"]);
    assert_eq!(read_all("#+sbcl foo").len(), 0);
}

#[test]
fn labels_share_structure() {
    let datum = read_one("(#1=(a) #1# #2=b #2#)");
    let items = datum.as_list().unwrap();
    assert!(items[0].is_same(items[1]));
    assert!(items[2].is_same(items[3]));
    check_one("(#1=#2=(a) #1# #2#)", "((A) (A) (A))");
    check_one("(#10=\"x\" . #10#)", "(\"x\" . \"x\")");
    // Labels are known within one datum only.
    assert_eq!(codes("#1=a #1=b"), [""; 0]);
}

#[test]
fn each_uninterned_symbol_is_another() {
    let id = |datum: &Datum| match datum.as_symbol().unwrap().home() {
        Home::Uninterned(id) => *id,
        Home::Package(package) => panic!("in {package}"),
    };
    let datum = read_one("(#:a #:a #1=#:b #1#)");
    let items = datum.as_list().unwrap();
    assert_ne!(id(items[0]), id(items[1]));
    assert_eq!(id(items[2]), id(items[3]));
    assert_eq!(items[0].as_symbol().unwrap().name(), "A");
}

#[test]
fn data_know_where_they_were_written() {
    let text = "  (a 'b \"c\" #(d))";
    let datum = read_one(text);
    let part = |datum: &Datum| &text[datum.span().start as usize..datum.span().end as usize];
    assert_eq!(part(&datum), "(a 'b \"c\" #(d))");
    let parts: Vec<&str> = datum.as_list().unwrap().into_iter().map(part).collect();
    assert_eq!(parts, ["a", "'b", "\"c\"", "#(d)"]);
}

#[test]
fn a_text_may_begin_with_a_byte_order_mark_and_a_line_for_the_shell() {
    check_one("\u{feff}a", "A");
    check_one("#!/usr/bin/env -S eslvm run\na", "A");
    check_one("\u{feff}#! x (\r\na", "A");
    assert_eq!(read_all("#!only").len(), 0);
    assert_eq!(codes("a\n#!b"), ["foreign-notation"]);
}

#[test]
fn line_ends_of_all_kinds_are_blanks() {
    check_one("(a\r\nb\rc\n\rd)", "(A B C D)");
    check_one("(a ; comment\r\nb)", "(A B)");
    // Within a string they stay as they are.
    assert!(matches!(read_one("\"a\r\nb\"").kind(), DatumKind::String(s) if &**s == "a\r\nb"));
}
