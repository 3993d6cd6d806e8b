//! Texts that cannot be read, and how reading goes on after them.

use esl_bytecode::span::SourceId;
use esl_compiler::reader::{BareEnvironment, decode, is_unfinished, read_datum};

use crate::{codes, read_all, read_and_render, snapshot};

fn check(name: &str, source: &str) {
    snapshot(&format!("errors-{name}"), source, &read_and_render(source));
}

#[test]
fn an_unclosed_list_is_shown_at_its_opening() {
    check("unclosed-list", "(defun f (x)\n  (let ((y 1))\n    (+ x y)");
}

#[test]
fn a_form_in_column_0_suggests_the_missing_parenthesis() {
    check(
        "unclosed-list-before-a-form",
        "(print 0)\n\n(defun f (x)\n  (+ x 1)\n\n(defun g (x)\n  x)\n(print 'after",
    );
}

#[test]
fn a_mark_before_nothing() {
    check("missing-datum", "(a ')\n(b #')\n(c . ')\n(d #2A)\n(e #1=)\n(f #+esl)\n(g #+)\n(h '. i)");
    check("unfinished-datum", "a\n'");
    check("unfinished-feature", "a\n#+esl");
}

#[test]
fn dots() {
    check("dotted-list", "(1 . 2 3)\n(1 . )\n( . 2)\n(1 . 2 . 3)\n#(1 . 2)\n.\n(1 ... 2)");
}

#[test]
fn parentheses_that_close_nothing() {
    check("unexpected-close", "(print 1)) (print 2)\n)))\n(print 3)");
}

#[test]
fn strings_comments_and_bars_without_end() {
    check("unclosed-string", "(print \"hello)\n(print 1)\n");
    check("unclosed-string-far-from-its-cause", "(print \"hello)\n(print \"world\")\n(print 1)\n");
    check("unclosed-comment", "(print 1)\n#| a #| b |#\n(print 2)\n");
    check("unclosed-bar", "(print '|abc)\n(print 2)\n");
}

#[test]
fn tokens_that_denote_nothing() {
    check(
        "invalid-token",
        "(a:b:c cl: : #b12 #x #37r1 #r1 1/0 #: #:a:b #? #@ #<TASK a b> #12 #9A())\n(#+(xor a b) c)\n(#+(not) c)",
    );
    check("invalid-character-name", "(#\\Blank #\\Nonsense #\\New #\\U+D800)");
    check("float-out-of-range", "(list 1e400 -1d309)");
}

#[test]
fn names_of_unknown_packages() {
    check("unknown-package", "(lisp:list foo::bar |a b|:c)");
    check("not-external", "(cl:lst cl::lst cl:||)\nesl::own\nesl:own");
}

#[test]
fn commas() {
    check("comma-outside-backquote", "(a ,b)\n`(a ,(b ,c))\n`#2A((,a))");
    check("misplaced-splice", "`,@a\n`(a . ,@b)");
}

#[test]
fn labels() {
    check("labels", "(#1=a #2#)\n#1=(a #1#)\n(#1=a #1=b)\n#99999999999=a\n#1=#1#");
}

#[test]
fn literals_of_the_wrong_shape() {
    check("malformed-literal", "#2A((1 2) (3))\n#2A(1 2)\n#2A((1 . 2))\n#1(a b)\n#3()");
}

#[test]
fn characters_that_nobody_sees() {
    check("invalid-character", "(print\u{a0}1)\n(print \0\u{1}2)\n(pri\u{200b}nt 3)\n\u{202e}\n");
}

#[test]
fn one_datum_may_have_several_errors() {
    assert_eq!(
        codes("(a:b #\\Nonsense (1 . 2 3)) b:c"),
        ["unknown-package", "invalid-character-name", "dotted-list", "unknown-package"]
    );
}

#[test]
fn reading_goes_on_after_an_error() {
    let read = read_all("(1 . ) a\n(b\n(c) d");
    let shown: Vec<String> =
        read.iter().map(|r| r.as_ref().map_or_else(|e| e.code.into(), ToString::to_string)).collect();
    assert_eq!(shown, ["dotted-list", "A", "unclosed-list", "(C)", "D"]);
}

#[test]
fn reading_ends_after_a_hundred_errors() {
    let codes = codes(&") ".repeat(1000));
    assert_eq!(codes.len(), 101);
    assert_eq!(codes[100], "too-many-errors");
}

#[test]
fn unfinished_texts_are_told_from_wrong_ones() {
    let code = |text: &str| read_datum(&mut BareEnvironment::new(), text, 0).expect_err(text).code;
    for text in [
        "(a", "\"a", "#| a", "|a", "a|b", "#:|a", "'", "(a '", "a\\", "#\\", "(a \"b", "#+", "#+esl", "#1=",
        "`(a ,", "#(1", "#2A",
    ] {
        assert!(is_unfinished(code(text)), "{text}: {}", code(text));
    }
    for text in [")", "(1 . )", "#<b", "(b:c)", "#\\Nonsense", "(1 . 2 3)", ",a", "(a \0"] {
        assert!(!is_unfinished(code(text)), "{text}: {}", code(text));
    }
}

#[test]
fn bytes_that_are_no_text() {
    let decode = |bytes: &[u8]| decode(SourceId::default(), bytes.to_vec());
    let error = decode(b"(a\n\xe9)").expect_err("not UTF-8");
    assert_eq!(error.code, "invalid-utf-8");
    assert_eq!(error.message, "expected text in UTF-8, found byte 0xE9 at offset 3, line 2");
    assert_eq!(error.primary.span.start, 3);
    assert_eq!(decode("(é)".as_bytes()).as_deref(), Ok("(é)"));
}
