//! Values that are nested too deeply for Rust, which walks data by recursion.

use esl::data::MAX_DEPTH;
use esl::{Engine, Error};

/// Text of a form whose value is a list in a list, and so on.
fn nested(levels: usize) -> String {
    format!("(let ((l nil)) (dotimes (i {levels}) (setf l (list l))) l)")
}

#[test]
fn values_that_are_nested_too_deeply_are_refused() {
    let mut engine = Engine::new().expect("there is room");
    assert!(engine.eval(&nested(MAX_DEPTH)).is_ok());
    assert_eq!(engine.eval(&nested(MAX_DEPTH + 1)), Err(Error::NestedTooDeeply));
    assert_eq!(engine.eval(&nested(300_000)), Err(Error::NestedTooDeeply));
    let answer = engine.begin(&nested(300_000));
    engine.run();
    assert_eq!(answer.wait(), Err(Error::NestedTooDeeply));
}

#[test]
fn a_call_with_them_fails() {
    let mut engine = Engine::new().expect("there is room");
    engine.define("LOOK", "(value)", "Looks.", |_| Ok(1)).expect("it is a name");
    engine.define_operation("WATCH", "(value)", "Watches.", drop).expect("it is a name");
    for name in ["look", "watch"] {
        let call = format!("(handler-case ({name} {}) (failure (f) (failure-cause f)))", nested(300_000));
        assert_eq!(engine.eval(&call).map(|cause| cause.to_string()), Ok(":NESTED-TOO-DEEPLY".into()));
    }
}

#[test]
fn the_arguments_of_a_failure_are_cut() {
    let mut engine = Engine::new().expect("there is room");
    let Err(Error::Failed { arguments, .. }) = engine.eval(&format!("(fail :deep {})", nested(300_000)))
    else {
        panic!("it fails");
    };
    assert!(arguments[0].to_string().contains("(\"#\")"), "the argument is cut");
}
