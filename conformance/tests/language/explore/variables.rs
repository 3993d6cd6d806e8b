//! Switches at uses of special variables, which `Grain::Variables` adds: those that matter, and no others.

use esl_testing::explore::{Grain, grains};

use super::{check, compile, endings, outputs};

/// A variable, and changes of it with a call in between, before which the machine may preempt.
const SETUP: &str = "(defvar *n* 0) (defun one-more (n) (+ n 1))
    (defun update () (setq *n* (one-more *n*)))
    (defun update-by-name () (set '*n* (one-more (symbol-value '*n*))))";

/// Checks that two tasks come to these outputs, by fewer states than with points at all ticks.
fn check_two(one: &str, two: &str, at_end: &str, expected: &[&str]) {
    let text = format!("{SETUP} (task-net (one {one}) (two {two})) (princ {at_end})");
    let found = check(&text, Grain::Variables, expected);
    let all = check(&text, Grain::Ticks, expected);
    assert!(found.states < all.states, "{} states of {}", found.states, all.states);
}

#[test]
fn a_lost_update_is_found_at_the_grain_of_variables() {
    let text = format!("{SETUP} (task-net (one (update)) (two (update))) (princ *n*)");
    check(&text, Grain::Reads, &["2"]);
    check_two("(update)", "(update)", "*n*", &["1", "2"]);
    check_two("(update-by-name)", "(update)", "*n*", &["1", "2"]);
}

#[test]
fn a_critical_section_is_one_step_and_a_binding_is_the_tasks_own() {
    let update = "(without-interrupts (update))";
    check_two(update, update, "*n*", &["2"]);
    let bound = "(let ((*n* 5)) (update) (one-more *n*))";
    check_two(bound, bound, "*n*", &["0"]);
}

/// Places that only code refers to belong to a state: two states that differ in one are not the same.
#[test]
fn places_that_only_code_knows_belong_to_a_state() {
    let programs = [
        // A variable without a package.
        "(defmacro with-counter (v)
           `(progn (defvar ,v 0)
                   (defun bump () (setq ,v (one-more ,v)))
                   (defun total () ,v)))
         (defmacro with-new-counter () `(with-counter ,(gensym)))
         (with-new-counter)",
        // A variable of a function without a package.
        "(defmacro with-function (f)
           `(progn (let ((n 0)) (defun ,f (adds) (if adds (setq n (one-more n)) n)))
                   (defun bump () (,f t))
                   (defun total () (,f nil))))
         (defmacro with-new-function () `(with-function ,(gensym)))
         (with-new-function)",
        // An object that a form has made once.
        "(defun place () (load-time-value (list 0)))
         (defun bump () (setf (car (place)) (one-more (car (place)))))
         (defun total () (car (place)))",
    ];
    for program in programs {
        let text = format!(
            "(defun one-more (n) (+ n 1)) {program} (task-net (one (bump)) (two (bump))) (princ (total))"
        );
        check(&text, Grain::Ticks, &["1", "2"]);
        assert_eq!(grains(&compile(&text), None).last(), Some(&Grain::Ticks), "{text}");
    }
}

#[test]
fn a_variable_that_is_made_during_the_run_is_watched() {
    let text = "(defun one-more (n) (+ n 1))
         (eval (read-from-string \"(defvar *late* 0)\"))
         (eval (read-from-string \"(defun update () (setq *late* (one-more *late*)))\"))
         (task-net (one (update)) (two (update)))
         (princ (symbol-value (intern \"*LATE*\")))";
    check(text, Grain::Variables, &["1", "2"]);
}

#[test]
fn programs_end_as_with_switches_at_all_ticks() {
    // The actions of a task at a step, with its number in place of `#`.
    let steps =
        ["(setq *n* #)", "(push *n* seen-#)", "(assert '(mark #))", "(push (db-query '(mark ?)) seen-#)"];
    let pairs: Vec<String> = steps
        .iter()
        .flat_map(|one| steps.iter().map(move |two| format!("(one-more 1) {one} (one-more 2) {two}")))
        .collect();
    for (at, one) in pairs.iter().enumerate() {
        // Each with one that is like it and some others.
        for two in pairs.iter().skip(at).step_by(5) {
            let text = format!(
                "{SETUP} (let ((seen-1 '()) (seen-2 '()))
                   (task-net (one {}) (two {}))
                   (princ (list seen-1 seen-2 *n* (db-query '(mark ?what)))))",
                one.replace('#', "1"),
                two.replace('#', "2"),
            );
            let found = endings(&text, Grain::Variables);
            assert_eq!(outputs(&found), outputs(&endings(&text, Grain::Ticks)), "{text}");
        }
    }
}

// ---- what the library gives symbols

#[test]
fn documentation_and_functions_that_a_program_changes_belong_to_a_state() {
    // All tasks stand alike in both ways; what differs is a property of a symbol of the library.
    check(
        "(spawn
           (progn
             (choose nil (setf (documentation '*random-state* 'variable) \"changed\"))
             (sleep 0)
             (princ (if (equal (documentation '*random-state* 'variable) \"changed\") 'changed 'kept))))",
        Grain::Changes,
        &["CHANGED", "KEPT"],
    );
    check(
        "(defun before () 'kept)
         (spawn
           (progn
             (before)
             (choose nil (setf (symbol-function 'before) (lambda () 'changed)))
             (sleep 0)
             (princ (before))))",
        Grain::Changes,
        &["CHANGED", "KEPT"],
    );
}

#[test]
fn tasks_that_are_woken_at_the_same_time_go_in_any_order() {
    for wait in ["(sleep 2)", "(with-recovery-procedures ((:timeout nil)) (with-timeout 2 (sleep 3)))"] {
        let late = "(spawn (sleep 2) (setq *reply* 'here))";
        let text = format!("(defvar *reply* nil) {late} {wait} (print *reply*)");
        check(&text, Grain::Variables, &["HERE", "NIL"]);
    }
}
