//! Clauses that have been called before: a failure passes those that may be spent.

use super::check;

#[test]
fn a_clause_is_spent_if_another_begins_again_for_its_failure() {
    let clause = |limit: &str| {
        format!(
            "(defun f () (with-recovery-procedures ((:a {limit} (fail :b)) (:b :retries 2 (retry))) (fail :a)))"
        )
    };
    check(&clause(""), ":a :b");
    check(&clause(":retries :infinite"), ":b");
}

#[test]
fn a_cleanup_fails_while_control_leaves_for_a_clause_that_is_spent() {
    let with = |clauses: &str| {
        format!("(defun f () (with-recovery-procedures ({clauses}) (unwind-protect (fail :a) (fail :b))))")
    };
    check(&with("(:general-failure (abort 1))"), ":b");
    check(&with("(:a (abort 1)) (:b :retries :infinite (abort 2))"), "");
    check(&with("(:general-failure :retries :infinite (abort 1))"), "");
    // The cleanup of a function; a handler is in force until control has left.
    check(
        "(defun work () (unwind-protect (fail :a) (fail :b)))
         (defun f () (with-recovery-procedures ((:general-failure (abort 1))) (work)))",
        ":b",
    );
    check("(defun f () (handler-case (unwind-protect (fail :a) (fail :b)) (failure () 1)))", "");
    // A cleanup that runs before the search goes on has spent nothing.
    check(
        "(defun f () (with-recovery-procedures ((:b (abort 1))) (with-cleanup-procedure (fail :b) (fail :a))))",
        ":a",
    );
}

#[test]
fn a_clause_is_passed_by_what_comes_while_it_runs() {
    let with =
        |clauses: &str, body: &str| format!("(defun f () (with-recovery-procedures ({clauses}) {body}))");
    let timed = "(with-timeout 1 (fail :a))";
    check(&with("(:general-failure (fail :b))", timed), ":b :timeout");
    check(&with("(:general-failure (sleep 2) (abort 1))", timed), ":timeout");
    check(&with("(:general-failure :retries :infinite (sleep 2) (abort 1))", timed), "");
    // One that neither waits nor fails has left by then; and one for the limit itself does not run inside.
    check(&with("(:general-failure (abort 1))", timed), "");
    check(&with("(:timeout (sleep 2) (abort 1))", "(with-timeout 1 (fail :a))"), ":a");
    // A cleanup fails while control leaves, and has another clause called.
    let cleanup = "(unwind-protect (fail :a) (fail :b))";
    check(&with("(:a (abort 1)) (:b :retries :infinite (fail :a))", cleanup), ":a");
    check(&with("(:a (abort 1)) (:b :retries :infinite (retry))", cleanup), ":a");
    check(&with("(:a (fail :b)) (:b (fail :c)) (:c (abort 1))", "(fail :a)"), "");
    // A cleanup goes on after a failure that a form in it takes.
    let cleanup = "(unwind-protect (fail :a) (handler-case (fail :b) (failure () 1)))";
    check(&with("(:a (abort 1))", cleanup), "");
}

#[test]
fn a_clause_that_jumps_into_the_body_may_be_spent() {
    let with = |clause: &str, body: &str| {
        format!("(defun f () (with-recovery-procedures ((:a {clause})) {body} (fail :a)))")
    };
    check(&with("(throw 'on 1)", "(catch 'on (fail :a))"), ":a");
    check(&with("(continue)", "(with-simple-restart (continue \"Go on.\") (fail :a))"), ":a");
    check(&with("(return-from f 1)", "1"), "");
}
