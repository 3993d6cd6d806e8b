//! Tasks that belong to a form, under all schedules: with an abort, a failure or a suspension at every point,
//! each body that has begun is cleaned up once, and no task, claim or count is left.

use esl_testing::explore::Grain;

use super::check;

/// A body with a cleanup, and what is left of all of them: bodies that are open, tasks, claims, watches,
/// suspensions.
const BODIES: &str = "
  (define-resource arm)
  (defvar *step* (make-event))
  (defvar *open* 0)
  (defun go-on () (signal *step*))
  (defmacro body (&body forms)
    `(progn
       (incf *open*)
       (unwind-protect (progn ,@forms) (decf *open*))))
  (defun left ()
    (list *open* (length (list-tasks)) (length (resource-holders 'arm)) (length (resource-waiters 'arm))
          esl::*%watches*
          (if esl::*%suspensions* (hash-table-count esl::*%suspensions*) 0)))";

/// The result of `left` when only the main task is left.
pub(crate) const NOTHING: &str = "(0 1 0 0 0 0)";

/// Checks that a program with such bodies ends well under every schedule, with these outputs.
pub(crate) fn check_bodies(text: &str, expected: &[&str]) {
    check(&format!("{BODIES} {text}"), Grain::Changes, expected);
}

/// Checks that nothing is left of a form that is aborted at any point.
fn check_abort(form: &str) {
    check_bodies(&format!("(let ((task (spawn {form}))) (abort-task task) (princ (left)))"), &[NOTHING]);
}

/// Checks that a form which is suspended and resumed at any point ends as without, with these values.
fn check_suspension(form: &str, values: &str) {
    check_bodies(
        &format!(
            "(let ((task (spawn {form})))
               (suspend-task task)
               (resume-task task)
               (princ (list (multiple-value-list (wait-for-task task)) (left))))"
        ),
        &[&format!("({values} {NOTHING})")],
    );
}

#[test]
fn the_first_end_decides_a_pursuit() {
    check_bodies(
        "(princ (handler-case (pursue (a (body (go-on) 'a)) (b (body (go-on) (fail :lost))))
                  (failure (failure) (failure-cause failure))))
         (princ (left))",
        &["A(0 1 0 0 0 0)", "LOST(0 1 0 0 0 0)"],
    );
}

#[test]
fn an_abort_ends_a_pursuit_wherever_it_is() {
    check_abort("(pursue (a (body (go-on))) (b (body (sleep 1))))");
}

#[test]
fn a_pursuit_is_suspended_wherever_it_is() {
    check_suspension("(pursue (a (body (go-on) 'a)) (b (sleep 1)))", "(SUCCEEDED A)");
}

#[test]
fn an_alternative_begins_when_the_one_before_has_failed_and_ended() {
    check_bodies(
        "(princ (try-in-order (a (body (go-on) (fail :lost)))
                              (b (unless (= *open* 0) (princ 'together)) (body (go-on) 'b))))
         (princ (left))",
        &["B(0 1 0 0 0 0)"],
    );
}

#[test]
fn an_abort_ends_alternatives_wherever_they_are() {
    check_abort("(try-in-order (a (body (go-on) (fail :lost))) (b (body (go-on))))");
}

#[test]
fn alternatives_are_suspended_wherever_they_are() {
    check_suspension("(try-in-order (a (body (fail :lost))) (b (body 'b)))", "(SUCCEEDED B)");
}

#[test]
fn alternatives_at_the_same_time_are_suspended_wherever_they_are() {
    check_suspension("(try-all (a (fail :lost)) (b 'b))", "(SUCCEEDED B)");
    check_suspension("(try-all (a (body (fail :lost))) (b (sleep 1) 'b))", "(SUCCEEDED B)");
}

#[test]
fn a_partial_order_is_kept() {
    check_bodies(
        "(defvar *done* nil)
         (defun check-done (name)
           (unless (member name *done*) (princ 'too-early)))
         (princ (multiple-value-list
                  (partial-order ((c (check-done 'a) (check-done 'b) (go-on) 3)
                                  (a (go-on) (push 'a *done*) 1)
                                  (b (go-on) (push 'b *done*) 2))
                    (:order a c)
                    (:order b c))))
         (princ (left))",
        &["(3 1 2)(0 1 0 0 0 0)"],
    );
}

#[test]
fn a_failure_in_a_partial_order_lets_nothing_begin_that_comes_after() {
    check_bodies(
        "(princ (handler-case (partial-order ((a (body (go-on) (fail :lost))) (b (princ 'late)) (c (body (go-on))))
                                (:order a b))
                  (failure (failure) (failure-cause failure))))
         (princ (left))",
        &["LOST(0 1 0 0 0 0)"],
    );
}

#[test]
fn an_abort_ends_a_partial_order_wherever_it_is() {
    check_abort("(partial-order ((a (body (go-on))) (b (body (go-on)))) (:order a b))");
}

#[test]
fn a_partial_order_is_suspended_wherever_it_is() {
    check_suspension("(values (partial-order ((a 'a) (b (go-on))) (:order a b)))", "(SUCCEEDED A)");
}

#[test]
fn nothing_is_held_while_a_retry_waits() {
    // The other task gets the resource while the first one waits, or before or after that.
    check_bodies(
        "(task-net
           (a (let ((times 0))
                (with-recovery-procedures ((:lost :retries 1 :backoff (1 2 10) (retry)))
                  (body (with-resource (arm)
                          (go-on)
                          (when (= (incf times) 1) (fail :lost)))))))
           (b (with-timeout 0.5 (with-resource (arm) (go-on)))))
         (princ (left))",
        &[NOTHING],
    );
}

#[test]
fn an_abort_ends_retries_wherever_they_are() {
    check_abort(
        "(with-recovery-procedures ((:lost :retries 1 :backoff (1 2 10) (retry)))
           (body (with-resource (arm) (go-on) (fail :lost))))",
    );
}

#[test]
fn retries_are_suspended_wherever_they_are() {
    check_suspension(
        "(let ((times 0))
           (with-recovery-procedures ((:lost :retries 1 :backoff (1 2 10) (retry)))
             (body (go-on) (if (= (incf times) 1) (fail :lost) times))))",
        "(SUCCEEDED 2)",
    );
}
