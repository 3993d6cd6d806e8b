//! Tokens, as the lexer finds them.

use esl_compiler::reader::lexer::Token;
use logos::Logos;

use crate::snapshot;

fn check(name: &str, source: &str) {
    let lexer = Token::lexer(source).spanned();
    let lines: Vec<String> = lexer
        .map(|(token, span)| {
            let token = token.map_or_else(|error| format!("{error:?}!"), |token| format!("{token:?}"));
            format!("{token:<16} {}", source[span].escape_debug())
        })
        .collect();
    snapshot(name, source, &lines.join("\n"));
}

#[test]
fn punctuation_ends_a_token() {
    check("tokens-punctuation", "(print'a(list\"a\"\"b\"'c`(d,e,@f,.g))#'h(1 . 2)(a.b)(1;comment\n2))");
}

#[test]
fn dispatching_marks() {
    check(
        "tokens-dispatch",
        r##"#(1) #3(a) #2A((1)) #\a #\( #\Space #\a'b #xFF #36rZZ #:g #:|a b|c #?x #+esl #-esl #1=a #1# #'f #.x #S(a) #*01 #P"x" #C(1 2) #<TASK a b> #@ #5 # x"##,
    );
}

#[test]
fn escapes_and_bars_are_part_of_a_name() {
    check("tokens-escapes", r"foo|a b|bar a\ b |x\|y| #|comment #| nested |# |# \#a c#d :|low| |a|:|b|");
}

#[test]
fn blanks_and_comments_are_skipped() {
    check("tokens-blanks", "a\tb\r\nc\rd\x0ce ; comment\r\nf;\n;; last");
}

#[test]
fn stray_characters_are_tokens_of_their_own() {
    check(
        "tokens-stray",
        "a\0\0b\u{a0}c \u{200b}\u{feff} (d\u{202e}) \"\0\u{a0}\" |\u{a0}| e\u{301}\u{200d}",
    );
}

#[test]
fn unfinished_texts() {
    check("tokens-unfinished-string", "a \"b\\\"c");
    check("tokens-unfinished-comment", "a #| b #| c |#");
    check("tokens-unfinished-bar", "a b|c");
    check("tokens-unfinished-escape", "a b\\");
    check("tokens-unfinished-character", "a #\\");
}
