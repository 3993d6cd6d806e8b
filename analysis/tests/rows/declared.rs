//! Declarations `(declaim (fails name cause*))`, compared with programs.

use super::{check_findings, table};

/// Returns the codes and the messages of the findings about a program.
fn findings(text: &str) -> Vec<String> {
    let found = table(text).findings;
    found.iter().map(|found| format!("{} {}", found.code, found.message)).collect()
}

#[test]
fn declarations_are_checked_in_both_directions() {
    assert!(findings("(declaim (fails f :a)) (defun f () (fail :a))").is_empty());
    assert_eq!(
        findings("(declaim (fails f :a)) (defun f () (fail :b))"),
        [
            "declared-never `f` declares :a, but never fails with it",
            "undeclared-failure `f` may fail with :b, which it does not declare"
        ]
    );
    assert_eq!(
        findings("(declaim (fails main)) (defun f () (fail :b)) (f)"),
        ["undeclared-failure `main` may fail with :b, which it does not declare"]
    );
    assert!(
        findings("(declaim (fails main)) (defun f () (fail :b)) (ignore-errors (print (f)) (fail :c))").len()
            == 2
    );
}

#[test]
fn the_declarations_of_one_name_add_up() {
    let program = "(defun f () (fail :a) (fail :b))";
    assert!(findings(&format!("(declaim (fails f :a) (fails f :b)) {program}")).is_empty());
    assert_eq!(
        findings(&format!("(declaim (fails f :a)) (declaim (fails f :a)) {program}")),
        ["undeclared-failure `f` may fail with :b, which it does not declare"]
    );
}

#[test]
fn functions_that_set_places_have_declarations() {
    let program = "(defun g () 1) (defun (setf g) (value) (fail :a value)) (setf (g) 2)";
    assert!(findings(&format!("(declaim (fails (setf g) :a)) {program}")).is_empty());
    assert!(
        findings(&format!("(declaim (fails ((setf g)) :a) (fails (g (setf g)) :a)) {program}")).len() == 1
    );
    assert_eq!(
        findings(&format!("(declaim (fails (setf g))) {program}")),
        ["undeclared-failure `(setf g)` may fail with :a, which it does not declare"]
    );
}

#[test]
fn a_declaration_of_a_name_that_nothing_has_is_found() {
    let wrong = "declared-never `drvie` declares failures, but nothing defines or calls it";
    assert_eq!(findings("(declaim (fails drvie :a)) (defun drive () (fail :a))"), [wrong]);
    assert_eq!(findings("(declaim (fails drvie))"), [wrong]);
    // Functions of other files are called, or are operations; those of the language are trusted.
    for other in ["(drvie)", "(mapcar 'drvie '(1))", "(print #'drvie)", "(define-mock drvie () 1)"] {
        assert!(!findings(&format!("(declaim (fails drvie :a)) {other}")).contains(&wrong.into()), "{other}");
    }
    assert!(findings("(declaim (fails open :a) (fails :tasks :a) (fails main :a))").len() == 1);
}

#[test]
fn tasks_are_compared_with_their_declarations() {
    let text = |declared: &str| {
        format!(
            "(declaim (fails {declared}))
(define-cause :stuck ()) (define-cause :jammed (:stuck)) (define-cause :lost ())
(spawn (:name \"look\") (sleep 1) (fail :lost))
(spawn (:name \"drive\") (sleep 1) (fail :jammed))
(sleep 5)"
        )
    };
    let unhandled = |count: usize| vec![("unhandled-failure", 1); count];
    check_findings(&text(":tasks"), &unhandled(2));
    check_findings(&text(":tasks :stuck"), &unhandled(1));
    check_findings(&text(":tasks :stuck :lost"), &[]);
    check_findings(&text(":look"), &unhandled(1));
    check_findings(&text(":drive :jammed"), &[]);
    check_findings(&text(":main"), &[]);
}

#[test]
fn declarations_for_all_tasks_are_those_of_their_source() {
    let text = "(declaim (fails :tasks :stuck)) (declaim (fails :tasks :lost))
(define-cause :stuck ()) (define-cause :lost ()) (define-cause :cold ())
(spawn () (fail :stuck)) (spawn () (fail :lost)) (spawn () (fail :cold)) (sleep 5)";
    check_findings(text, &[("unhandled-failure", 1)]);
}
