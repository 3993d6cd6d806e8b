//! Restarts as choices: procedures for interrupted calls that do a step twice, or never, are found.

use std::collections::BTreeSet;

use esl_testing::explore::{ExplorationScope, Grain, Settings, explore, follow};

use super::compile;

/// A device that counts what it has done, and says whether it has.
const DEVICE: &str = "(defvar *moved* 0)
    (define-mock move-arm (place) (incf *moved*) place)
    (define-mock arm-is-at (place) (and (plusp *moved*) place))
    (define-idempotent arm-is-at)
    ";

/// Returns the ends of a program with so many restarts.
fn ends(text: &str, settings: &Settings) -> BTreeSet<String> {
    let program = compile(text);
    let settings = Settings { output: false, ..*settings };
    let found = explore(&program, &settings).expect("it can start");
    assert!(found.limit.is_none() && found.endless.is_none(), "{text}: {found:?}");
    assert_eq!(ExplorationScope::new(&program, &settings, &found).crashes, settings.crashes);
    for ending in &found.endings {
        let again = follow(&program, &settings, &ending.choices).expect("it can start");
        assert_eq!(again, ending.what, "{text}: {:?}", ending.choices);
    }
    found.endings.iter().map(|ending| ending.what.output.trim().to_owned()).collect()
}

/// Returns the ends with at most so many restarts, which are the same with points left out and without.
fn ends_with(crashes: u32, text: &str) -> BTreeSet<String> {
    let settings = Settings { crashes, ..Settings::default() };
    let some = ends(text, &settings);
    assert_eq!(some, ends(text, &Settings { reduce: false, ..settings }), "{text}");
    some
}

fn set(texts: &[&str]) -> BTreeSet<String> {
    texts.iter().map(|&text| text.to_owned()).collect()
}

#[test]
fn a_procedure_that_does_a_step_twice_or_never_is_found() {
    let program = |procedure: &str| {
        format!(
            "{DEVICE} (with-recovery-procedures
                          (((:interrupted-by-restart) :retries :infinite {procedure}))
                        (move-arm 'tray))
             (princ *moved*)"
        )
    };
    let (twice, never) = (program("(retry)"), program("(abort nil)"));
    let right = program("(if (arm-is-at 'tray) (abort 'tray) (retry))");
    for text in [&twice, &never, &right] {
        assert_eq!(ends(text, &Settings::default()), set(&["1"]), "{text}");
    }
    assert_eq!(ends_with(1, &twice), set(&["1", "2"]));
    let two = Settings { crashes: 2, ..Settings::default() };
    assert_eq!(ends(&twice, &two), set(&["1", "2", "3"]));
    assert_eq!(ends_with(1, &never), set(&["0", "1"]));
    assert_eq!(ends(&right, &two), set(&["1"]));
}

#[test]
fn the_failure_and_the_news_are_those_of_a_durable_run() {
    let text = "(define-input *resumed*)
        (define-mock move-arm (place &key (speed 1)) (list place speed))
        (princ (with-recovery-procedures
                   (((:interrupted-by-restart operation arguments action)
                      (abort (list operation arguments (length action)
                                   (nth-value 1 (wait-for-event *resumed*))))))
                 (move-arm 'tray :speed 2)))";
    assert_eq!(ends_with(1, text), set(&["(TRAY 2)", "(MOVE-ARM (TRAY 2) 32 2)"]));
    // Nothing else is interrupted.
    let idempotent = "(define-mock ask () 1) (define-idempotent ask) (princ (ask))";
    assert_eq!(ends_with(1, idempotent), set(&["1"]));
}

#[test]
fn a_restart_interrupts_all_calls_that_are_under_way() {
    let text = "(defvar *unknown* nil)
        (define-mock work (name) (sleep 1) name)
        (defun careful (name)
          (with-recovery-procedures
              ((:interrupted-by-restart (push name *unknown*) (abort nil)))
            (work name)))
        (task-net (a (careful 'a)) (b (careful 'b)))
        (princ (sort *unknown* #'string<))";
    let changes = Settings { crashes: 1, grain: Grain::Changes, ..Settings::default() };
    assert_eq!(ends(text, &changes), set(&["NIL", "(A)", "(B)", "(A B)"]));
}

#[test]
fn scripts_of_a_world_are_interrupted_too() {
    let text = "(define-mock move-arm (place) place)
        (with-world ((:answer (move-arm tray) :with 'there))
          (princ (with-recovery-procedures ((:interrupted-by-restart (abort 'unknown)))
                   (move-arm 'tray)))
          (princ (length (world-calls 'move-arm))))";
    assert_eq!(ends(text, &Settings::default()), set(&["THERE1"]));
    assert_eq!(ends_with(1, text), set(&["THERE1", "UNKNOWN1"]));
}
