//! Suspension under all schedules: a task that is suspended and resumed ends as without, an abort reaches it
//! wherever it is, and nothing is left.

use esl_testing::explore::Grain;

use super::check;

/// `left` counts the remaining suspensions; `go-on` is a step that others can see.
const LEFT: &str = "
  (defvar *step* (make-event))
  (defun go-on () (signal *step*))
  (defun left ()
    (if esl::*%suspensions* (hash-table-count esl::*%suspensions*) 0))";

fn check_suspension(text: &str, expected: &[&str]) {
    check(&format!("{LEFT} {text}"), Grain::Changes, expected);
}

#[test]
fn a_task_that_is_suspended_and_resumed_ends_as_without() {
    check_suspension(
        "(let ((task (spawn (go-on) (wait-for-task (spawn (go-on))) :value)))
           (suspend-task task)
           (resume-task task)
           (princ (list (multiple-value-list (wait-for-task task)) (left))))",
        &["((SUCCEEDED VALUE) 0)"],
    );
}

#[test]
fn nobody_goes_on_who_is_suspended() {
    check_suspension(
        "(let* ((count 0) (task (spawn (dotimes (i 2) (go-on) (incf count)))))
           (suspend-task task)
           (let ((before count))
             (go-on)
             (go-on)
             (unless (= before count) (princ 'moved)))
           (resume-task task)
           (wait-for-task task)
           (princ (list count (left))))",
        &["(2 0)"],
    );
}

#[test]
fn a_task_stands_still_when_suspend_task_returns() {
    check_suspension(
        "(let ((task (spawn (go-on) (go-on))))
           (suspend-task task)
           (princ (task-status task))
           (resume-task task)
           (suspend-task task)
           (princ (task-status task))
           (resume-task task)
           (wait-for-task task)
           (princ (left)))",
        &["SUCCEEDEDSUCCEEDED0", "SUSPENDEDSUCCEEDED0", "SUSPENDEDSUSPENDED0"],
    );
}

#[test]
fn an_abort_reaches_a_task_wherever_its_suspension_is() {
    check_suspension(
        "(define-resource arm)
         (let ((task (spawn (with-resource (arm) (go-on)))))
           (spawn (suspend-task task))
           (abort-task task)
           (princ (list (resource-holders 'arm) (resource-waiters 'arm))))",
        &["(NIL NIL)"],
    );
}

#[test]
fn suspensions_of_two_tasks_nest_by_count() {
    check_suspension(
        "(let ((task (spawn (go-on) (go-on))))
           (task-net (a (suspend-task task) (resume-task task))
                     (b (suspend-task task) (resume-task task)))
           (wait-for-task task)
           (princ (list (task-status task) (left))))",
        &["(SUCCEEDED 0)"],
    );
}

#[test]
fn a_cleanup_that_waits_for_its_own_tasks_comes_to_its_end() {
    check_suspension(
        "(let ((task (spawn (handler-case
                                (with-cleanup-procedure (task-net (inner (go-on))) (fail :lost))
                              (failure () :ended)))))
           (suspend-task task)
           (resume-task task)
           (princ (list (multiple-value-list (wait-for-task task)) (left))))",
        &["((SUCCEEDED ENDED) 0)"],
    );
}

#[test]
fn a_task_that_suspends_itself_stands_still_after_those_that_it_has_made() {
    check_suspension(
        "(let* ((count 0)
                (child nil)
                (task (spawn (setq child (spawn (go-on) (incf count)))
                             (suspend-task (current-task))
                             :resumed)))
           (sleep 1)
           (let ((before count))
             (go-on)
             (unless (= before count) (princ 'moved)))
           (resume-task task)
           (wait-for-task child)
           (princ (list (multiple-value-list (wait-for-task task)) count (left))))",
        &["((SUCCEEDED RESUMED) 1 0)"],
    );
}

#[test]
fn a_task_whose_maker_has_ended_stands_still_with_the_maker_of_that() {
    check_suspension(
        "(let* ((count 0)
                (task (spawn (spawn (spawn (go-on) (incf count)))
                             (wait-until (= count 1)))))
           (suspend-task task)
           (let ((before count))
             (go-on)
             (unless (= before count) (princ 'moved)))
           (resume-task task)
           (wait-for-task task)
           (princ (list count (left))))",
        &["(1 0)"],
    );
}

#[test]
fn a_task_that_waits_goes_on_where_it_was() {
    check_suspension(
        "(let* ((count 0)
                (child nil)
                (root (spawn (setq child (spawn (wait-for-events *step* :unless-count 0) (incf count)))
                             (wait-for-task child)
                             :ended)))
           (sleep 1)
           (task-net (a (suspend-task root) (resume-task root))
                     (b (suspend-task child) (resume-task child)))
           (go-on)
           (princ (list (nth-value 1 (wait-for-task root)) count (left))))",
        &["(ENDED 1 0)"],
    );
}

#[test]
fn nothing_is_left_when_those_are_aborted_who_suspend_and_are_suspended() {
    // The abort of either comes before the other's, after the note of the suspension, or later.
    check_suspension(
        "(let* ((task (spawn (go-on)))
                (operator (spawn (suspend-task task))))
           (spawn (abort-task operator))
           (abort-task task)
           (loop (unless (cdr (list-tasks)) (return)) (sleep 1))
           (princ (left)))",
        &["0"],
    );
}

#[test]
fn a_task_that_was_resumed_before_it_stood_still_can_be_suspended_again() {
    check_suspension(
        "(let* ((task (spawn (go-on)))
                (operator (spawn (suspend-task task) (resume-task task))))
           (abort-task operator)
           ;; The operator may not have come to resume it.
           (suspend-task task)
           (resume-task task)
           (resume-task task)
           (wait-for-task task)
           (princ (left)))",
        &["0"],
    );
}

#[test]
fn one_that_suspends_itself_in_a_cleanup_may_be_aborted_before_it_stands_still() {
    check_suspension(
        "(let ((task (spawn (unwind-protect (go-on) (suspend-task (current-task)) (go-on)) (go-on))))
           (abort-task task)
           (princ (list (task-status task) (left))))",
        &["(ABORTED 0)"],
    );
}

#[test]
fn a_task_that_suspends_itself_is_aborted_wherever_it_is() {
    check_suspension(
        "(let* ((count 0)
                (task (spawn (spawn (go-on) (incf count)) (suspend-task (current-task)))))
           (abort-task task)
           (loop (unless (cdr (list-tasks)) (return)) (sleep 1))
           (princ (list count (left))))",
        &["(0 0)", "(1 0)"],
    );
}
