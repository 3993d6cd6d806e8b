//! Places that call too many functions to be told apart.

use esl_analysis::FailureTable;

use crate::table;

/// Functions that all call each other as elements of one list, each from a place of its own; one fails.
fn functions_that_call_each_other(count: usize) -> String {
    let makers: String = (0..count)
        .map(|number| {
            format!("(push (lambda (x) (dolist (next *all*) (funcall next (list x {number} next)))) *all*)\n")
        })
        .collect();
    format!(
        "(define-cause :lost ()) (define-cause :late ())
(defvar *all* nil)
{makers}(push (lambda (x) (spawn (:name \"search\") (fail :lost)) (fail :lost x)) *all*)
(defun more (x) (when (> x 1) (fail :late)))
(defun go-on (x) (funcall (first *all*) x))
(declaim (fails more :late) (fails go-on))
(more 1) (go-on 1)"
    )
}

#[test]
fn too_many_functions_at_a_place_count_together() {
    let small = table(&functions_that_call_each_other(20));
    assert!(!small.is_incomplete && small.crowded.is_empty());
    let large = table(&functions_that_call_each_other(300));
    assert!(!large.is_incomplete);
    // The places of the functions, and that in GO-ON.
    assert_eq!(large.crowded.len(), 301);
    for table in [&small, &large] {
        let causes = |name: &str| -> Vec<&str> {
            let rows = &table.functions.iter().find(|row| row.name == name).expect("it is there").causes;
            rows.iter().map(|row| row.cause.as_str()).collect()
        };
        assert_eq!((causes("more"), causes("go-on")), (vec![":late"], vec![":lost"]));
        assert!(table.tasks.iter().any(|task| task.name == "search" && task.causes[0].cause == ":lost"));
        let codes: Vec<&str> = table.findings.iter().map(|found| found.code).collect();
        assert_eq!(codes, ["undeclared-failure"], "of GO-ON");
    }
    let help = |table: &FailureTable| table.findings[0].help.clone();
    assert_eq!(help(&small), None);
    assert!(help(&large).is_some_and(|text| text.starts_with("too many functions may be called at")));
}
