//! Large and hostile texts: each is read, or refused with a message, on a small native stack and in bounded
//! time.

use std::time::Instant;

use esl_compiler::reader::{MAX_DEPTH, MAX_DIGITS, MAX_NAME, MAX_RATIO_DIGITS, read_anything};

use crate::{codes, read_all, read_one};

/// Runs `check` on a stack of 256 KiB and fails if it takes far too long, as it would if work grew with the
/// square of the text.
fn small(check: impl FnOnce() + Send + 'static) {
    let start = Instant::now();
    let thread = std::thread::Builder::new().stack_size(256 << 10).spawn(check).expect("a thread");
    thread.join().expect("no panic");
    assert!(start.elapsed().as_secs() < 120, "took {:?}", start.elapsed());
}

fn nested(depth: usize) -> String {
    format!("{}{}", "(".repeat(depth), ")".repeat(depth))
}

#[test]
fn nesting_is_limited() {
    small(|| {
        assert_eq!(read_all(&nested(MAX_DEPTH)).len(), 1);
        assert_eq!(codes(&nested(MAX_DEPTH)), [""; 0]);
        assert_eq!(codes(&nested(MAX_DEPTH + 1)), ["nested-too-deeply"]);
        assert_eq!(codes(&format!("{}a", "'".repeat(MAX_DEPTH))), [""; 0]);
        assert_eq!(codes(&format!("{}a", "'".repeat(MAX_DEPTH + 1))), ["nested-too-deeply"]);
    });
}

#[test]
fn what_follows_a_form_that_is_too_deep_is_read() {
    small(|| {
        let text = format!("{} (b:c)", nested(1_000_000));
        assert_eq!(codes(&text), ["nested-too-deeply", "unknown-package"]);
        let text = format!("{}a (b:c)", "'".repeat(1_000_000));
        assert_eq!(codes(&text), ["nested-too-deeply", "unknown-package"]);
        let text = format!("({}) (b:c)", "#(".repeat(5_000) + &")".repeat(5_000));
        assert_eq!(codes(&text), ["nested-too-deeply", "unknown-package"]);
    });
}

#[test]
fn a_million_open_parentheses() {
    small(|| {
        assert_eq!(codes(&"(".repeat(1_000_000)), ["nested-too-deeply"]);
        assert_eq!(codes(&"(\n".repeat(1_000_000)), ["nested-too-deeply"]);
        assert_eq!(codes(&"#+(".repeat(1_000_000)), ["nested-too-deeply"]);
        assert_eq!(codes(&"`(,".repeat(1_000_000)), ["nested-too-deeply"]);
        assert_eq!(codes(&"#1=(".repeat(1_000_000)), ["unknown-label"; 100]);
        assert_eq!(codes(&")".repeat(1_000_000)), ["unexpected-close"]);
    });
}

#[test]
fn labels_do_not_get_around_the_limit() {
    small(|| {
        let mut text = String::from("(#0=(a)");
        for i in 1..MAX_DEPTH + 10 {
            text += &format!(" #{i}=(#{}#)", i - 1);
        }
        assert_eq!(codes(&(text + ")")), ["nested-too-deeply"]);
    });
}

#[test]
fn labels_do_not_stand_for_trees_without_bound() {
    small(|| {
        let mut text = String::from("(#0=(a a)");
        for i in 1..100 {
            text += &format!(" #{i}=(#{0}# #{0}#)", i - 1);
        }
        assert_eq!(codes(&(text + ")"))[0], "literal-too-large");
        assert_eq!(codes("(#99999999(a) #1000000(a) #1000000(b))"), ["literal-too-large"; 2]);
        assert_eq!(codes("#99999999999999(a)"), ["literal-too-large"]);
    });
}

#[test]
fn tokens_of_megabytes() {
    small(|| {
        let long = "a".repeat(1_000_000);
        assert_eq!(codes(&format!("\"{long}\" #|{long}|# ;{long}")), [""; 0]);
        assert_eq!(codes(&long), ["token-too-long"]);
        assert_eq!(codes(&format!("|{long}| #:{long} #?{long} :{long} b")), ["token-too-long"; 4]);
        assert_eq!(codes(&format!("#\\{long}")), ["invalid-character-name"]);
        assert_eq!(codes(&format!("#x{long}")), ["token-too-long"]);
        assert_eq!(codes(&format!("#xg{long}")), ["invalid-token"]);
        assert_eq!(codes(&"\0".repeat(1_000_000)), ["invalid-character"]);
        assert_eq!(codes(&"a".repeat(MAX_NAME)), [""; 0]);
        assert_eq!(codes(&"a".repeat(MAX_NAME + 1)), ["token-too-long"]);
    });
}

#[test]
fn giant_numbers() {
    small(|| {
        let digits = |count: usize| "7".repeat(count);
        assert_eq!(codes(&digits(MAX_DIGITS)), [""; 0]);
        assert_eq!(codes(&digits(MAX_DIGITS + 1)), ["token-too-long"]);
        assert_eq!(codes(&format!("{0}/{0}1", digits(MAX_RATIO_DIGITS - 1))), [""; 0]);
        assert_eq!(codes(&format!("1/{}", digits(MAX_RATIO_DIGITS + 1))), ["token-too-long"]);
        assert_eq!(codes(&format!("1.{}", digits(50_000))), [""; 0]);
        assert_eq!(codes(&format!("1e{}", digits(50_000))), ["float-out-of-range"]);
    });
}

#[test]
fn texts_of_many_lines() {
    small(|| {
        let text = "(defun f (x) (+ x 1)) ; a comment\n".repeat(100_000);
        assert_eq!(read_anything(text.as_bytes()), (100_000, 0));
        let text = format!("({})", "(a b \"c\")\n".repeat(100_000));
        assert_eq!(read_one(&text).elements().count(), 100_000);
        let text = "(a\n".repeat(1_000) + &"(b)\n".repeat(100_000);
        assert_eq!(codes(&text).len(), 101);
    });
}

#[test]
fn unclosed_lists_are_found_in_one_pass() {
    small(|| {
        let text = "(a\n".to_owned() + &"(b)\n".repeat(100_000);
        assert_eq!(read_anything(text.as_bytes()), (100_000, 1));
        let text = "(a\n".repeat(50) + &"(b)\n".repeat(100_000);
        assert_eq!(read_anything(text.as_bytes()), (100_000, 50));
    });
}

#[test]
fn strings_without_end_are_not_searched_for_over_and_over() {
    small(|| {
        let (_, errors) = read_anything("#\\\\\\\"\n(".repeat(100_000).as_bytes());
        assert!(errors > 0);
        let (_, errors) = read_anything("(\"\n".repeat(100_001).as_bytes());
        assert!(errors > 0);
        let (_, errors) = read_anything("(#|\n".repeat(100_001).as_bytes());
        assert!(errors > 0);
    });
}
