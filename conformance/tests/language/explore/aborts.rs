//! Aborts by an operator, at any point: what the library's forms hold is given back, whichever of their tasks
//! ends, and whenever.

use std::collections::BTreeSet;

use esl::program::Ended;
use esl_testing::explore::{ExplorationScope, Grain, Settings, explore, follow};

use super::compile;

/// Returns the ends of a program with so many aborts: exit statuses, and what it has written.
fn ends(text: &str, settings: &Settings) -> BTreeSet<String> {
    let program = compile(text);
    let settings = Settings { output: false, ..*settings };
    let found = explore(&program, &settings).expect("it can start");
    assert!(
        found.limit.is_none() && found.endless.is_none() && found.livelock.is_none(),
        "{text}: {found:?}"
    );
    assert_eq!(ExplorationScope::new(&program, &settings, &found).aborts, settings.aborts);
    let end = |ended: Ended, output: &str| format!("{ended:?} {}", output.trim());
    for ending in &found.endings {
        let again = follow(&program, &settings, &ending.choices).expect("it can start");
        assert_eq!(again, ending.what, "{text}: {:?}", ending.choices);
    }
    found.endings.iter().map(|ending| end(ending.what.ended, &ending.what.output)).collect()
}

/// Returns the ends with at most one abort, which are the same with points left out and without.
fn ends_with_an_abort(text: &str) -> BTreeSet<String> {
    let settings = Settings { aborts: 1, ..Settings::default() };
    let some = ends(text, &settings);
    let all = ends(text, &Settings { reduce: false, ..settings });
    assert_eq!(some, all, "{text}");
    some
}

#[test]
fn an_abort_may_come_between_any_two_ticks_of_a_form_with_a_cleanup() {
    let text = "(defvar *stage* 0)
        (defun one-more (n) (+ n 1))
        (spawn (let ((stage 0))
                 (unwind-protect (progn (setq stage (one-more stage)) (setq stage (one-more stage)))
                   (setq *stage* (list stage)))))
        (sleep 1)
        (print *stage*)";
    let without = ends(text, &Settings::default());
    assert_eq!(without, ["Normally(0) (2)".to_owned()].into());
    // A first turn has a tick, so the abort comes before the task has begun, or after its first call.
    let expected = ["0", "(1)", "(2)"].map(|stage| format!("Normally(0) {stage}"));
    assert_eq!(ends_with_an_abort(text), expected.clone().into());
    // All ticks are points.
    let ticks = Settings { aborts: 1, grain: Grain::Ticks, ..Settings::default() };
    assert_eq!(ends(text, &ticks), expected.into());
}

#[test]
fn what_is_not_given_back_after_an_abort_is_found() {
    let text = "(defvar *is-held* nil)
        (spawn (setq *is-held* t) (sleep 1) (setq *is-held* nil))
        (sleep 2)
        (print *is-held*)";
    assert_eq!(ends(text, &Settings::default()).len(), 1);
    let expected = ["NIL", "T"].map(|held| format!("Normally(0) {held}"));
    assert_eq!(ends_with_an_abort(text), expected.into());
}

#[test]
fn forms_of_the_library_hold_nothing_after_an_abort() {
    let forms = [
        "(define-resource arm)
         (dotimes (i 2) (spawn (with-resource (arm) (sleep 1))))
         (sleep 5)
         (print (resource-holders 'arm))",
        "(define-fluent lamp 0)
         (spawn (wait-until (eql lamp 1)))
         (spawn (setf lamp 1))
         (sleep 1)
         (setf lamp 1)
         (print (and (plusp esl::*%watches*) esl::*%watches*))",
        "(spawn (pursue (left (sleep 1)) (right (sleep 2))))
         (sleep 5)
         (print (rest (list-tasks)))",
        "(spawn (supervise (:restarts 1 :within 10) (child :restart :transient (sleep 1))))
         (sleep 9)
         (print (rest (list-tasks)))",
    ];
    for text in forms {
        let found = ends_with_an_abort(text);
        assert_eq!(found, ["Normally(0) NIL".to_owned()].into(), "{text}");
    }
}
