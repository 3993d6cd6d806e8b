//! Fluents under all schedules: a waiting task sees every change that matters, whatever comes in between.

use esl_testing::explore::Grain;

use super::check;

#[test]
fn a_change_is_seen_wherever_it_comes() {
    check(
        "(define-fluent door :closed)
         (define-fluent lamp :off)
         (task-net
           (a (wait-until (and (eq door :open) (eq lamp :on))))
           (b (setf door :open))
           (c (setf lamp :on)))
         (princ 'done)",
        Grain::Reads,
        &["DONE"],
    );
}

#[test]
fn a_fact_is_seen_wherever_it_comes() {
    check(
        "(define-property power (device))
         (task-net
           (a (wait-until (and (power 'motor :on) (db-query '(ready)))))
           (b (assert '(power motor :on)))
           (c (assert '(ready))))
         (princ (list (get 'power 'esl::%sources) (get 'ready 'esl::%sources)))",
        Grain::Changes,
        &["(NIL NIL)"],
    );
}

#[test]
fn no_pulse_is_lost_and_none_is_seen_twice() {
    check(
        "(define-fluent button nil)
         (let ((count 0))
           (task-net
             (a (whenever button
                  (when (= (incf count) 2) (return))))
             (b (sleep 1)
                (dotimes (i 2) (setf button t) (setf button nil))))
           (princ (list count esl::*%watches*)))",
        Grain::Changes,
        &["(2 0)"],
    );
}

#[test]
fn an_abort_at_any_point_leaves_no_source() {
    check(
        "(let ((task (spawn (whenever (db-query '(ready)) nil))))
           (spawn (assert '(ready)))
           (abort-task task)
           (princ (list (get 'ready 'esl::%sources) esl::*%watches*)))",
        Grain::Changes,
        &["(NIL 0)"],
    );
}

#[test]
fn a_change_may_come_between_reading_a_fluent_and_setting_it() {
    check(
        "(define-fluent count 0)
         (task-net (a (setf count (+ count 1))) (b (setf count (+ count 1))))
         (princ count)",
        Grain::Changes,
        &["1", "2"],
    );
}
