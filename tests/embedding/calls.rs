//! Many calls between Rust and a program, which keep names and data from one to the next.

use esl::Data;

use super::{check, engine};

#[test]
fn a_call_means_what_its_name_means_now() {
    let mut engine = engine();
    check(&mut engine, "(progn (defun pace () 1) nil)", "NIL");
    assert_eq!(engine.call("pace", []), Ok(1));
    assert_eq!(engine.call("Pace", []), Ok(1));
    check(&mut engine, "(progn (defun pace () 2) nil)", "NIL");
    assert_eq!(engine.call("pace", []), Ok(2));
    let fleet = "(defpackage \"FLEET\" (:use \"COMMON-LISP\") (:export \"PACE\"))";
    check(&mut engine, &format!("(progn {fleet} nil)"), "NIL");
    check(&mut engine, "(progn (defun fleet:pace () 3) nil)", "NIL");
    assert_eq!(engine.call("pace", []), Ok(2));
    assert_eq!(engine.call("fleet:pace", []), Ok(3));
    check(&mut engine, "(shadowing-import 'fleet:pace)", "T");
    assert_eq!(engine.call("pace", []), Ok(3));
    // More names than are kept.
    for number in 0..20 {
        check(&mut engine, &format!("(progn (defun name-{number} () {number}) nil)"), "NIL");
    }
    for number in (0..20).chain(0..20) {
        assert_eq!(engine.call(&*format!("name-{number}"), []), Ok(number));
    }
}

#[test]
fn arguments_of_a_function_of_rust_are_those_of_its_call() {
    let mut engine = engine();
    engine.define("same", "(&rest things)", "The things.", |call| Ok(call.arguments()[0].clone())).unwrap();
    engine.define("second-of", "(a b)", "The second.", |call| Ok(call.arguments()[1].clone())).unwrap();
    for text in
        ["(1 2)", "(0.5 1)", "(2.5)", "(\"a\" 3 :ON)", "(7 \"b\")", "NIL", "(123456789012345678901 4)", "(5)"]
    {
        check(&mut engine, &format!("(apply #'same '{text})"), text);
        check(&mut engine, &format!("(second-of 1 '{text})"), text);
    }
    let kept: Vec<Data> =
        (0..3).map(|n| engine.call("second-of", [Data::Nil, n.into()]).expect("it returns")).collect();
    assert_eq!(kept, [0.into(), 1.into(), 2.into()]);
    // A function that is replaced is not called any more.
    engine.define("second-of", "(a b)", "The first.", |call| Ok(call.arguments()[0].clone())).unwrap();
    check(&mut engine, "(second-of 1 2)", "1");
}
