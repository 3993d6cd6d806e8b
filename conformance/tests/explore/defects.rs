//! The ten known defects of the original property locks, which model checking and a flight have found: each is looked for under
//! all schedules of a program in which it would show.
//!
//! What brings each of them back, in `stdlib/locks.esl` unless it says otherwise, and is seen to fail here, is said with it.

use esl::explore::Grain;

use crate::{check, endings};

const POWER: &str = "
  (define-property power (device))
  (to-achieve (power device value)
    (t (assert (list 'power device value))))
  (defun hold (&optional (value :on))
    (with-maintained-property (power 'camera value)
      (sleep 0)
      (without-interrupts (power 'camera))))
  (defun locks () (hash-table-count esl::*%locks*))";

/// That each schedule of a program ends well and writes one of these lines.
fn check_locks(text: &str, expected: &[&str]) {
    check(&format!("{POWER} {text}"), Grain::Changes, expected);
}

/// Back with: `%call-maintaining` releases after its body, not in a cleanup.
#[test]
fn an_abort_during_the_release_does_not_leak_the_lock() {
    check_locks("(let ((task (spawn (hold)))) (abort-task task) (print (locks)))", &["0"]);
}

/// Back with: `%call-maintaining` subscribes before the cleanup stands. A second abort comes while the first one is seen to.
#[test]
fn the_lock_is_acquired_inside_the_protection() {
    check_locks(
        "(let ((task (spawn (hold))))
           (spawn (abort-task task))
           (wait-for-task task)
           (print (locks)))",
        &["0"],
    );
}

/// Back with: `%await-change` waits whatever the count is.
#[test]
fn a_count_is_tested_and_waited_for_in_one_step() {
    check_locks(
        "(task-net (a (hold)) (b (hold)))
         (print (locks))",
        &["0"],
    );
}

/// Back with: `%achieve-as-owner` sets the state without looking at the property again.
#[test]
fn a_property_that_was_broken_meanwhile_does_not_count_as_achieved() {
    check_locks(
        "(let ((task (spawn (with-recovery-procedures ((:maintained-property-violation (abort :told))
                                                       (:condition-not-achieved (abort :told)))
                              (with-maintained-property (power 'camera :on)
                                (without-interrupts (power 'camera)))))))
           (assert '(power camera :off))
           (print (nth-value 1 (wait-for-task task))))",
        &[":ON", ":TOLD"],
    );
}

/// Back with: `%await-achievement` has the others wait before they look.
#[test]
fn a_secondary_subscriber_looks_before_it_waits() {
    check_locks(
        "(let ((first (spawn (hold))) (second (spawn (hold))))
           (print (list (nth-value 1 (wait-for-task first)) (nth-value 1 (wait-for-task second)))))",
        &["(:ON :ON)"],
    );
}

/// Back with: `%leave-lock` tells nobody.
#[test]
fn an_owner_that_dies_before_achieving_is_succeeded() {
    check_locks(
        "(let ((first (spawn (hold))) (second (spawn (hold))))
           (abort-task first)
           (print (nth-value 1 (wait-for-task second))))",
        &[":ON"],
    );
}

/// Back with: `%leave-lock` leaves the guard open, and `%tell-of-violation` asks for no lock.
#[test]
fn a_task_that_has_released_is_not_interrupted() {
    check_locks(
        "(defvar *where* nil)
         (spawn (with-recovery-procedures ((:maintained-property-violation (abort (setq *where* :after))))
                  (with-recovery-procedures ((:maintained-property-violation (abort (setq *where* :within)))
                                             (:condition-not-achieved (abort)))
                    (hold))
                  (sleep 0))
                (print *where*))
         (assert '(power camera :off))",
        &[":WITHIN", "NIL"],
    );
}

/// Back with: `Vm::wake_waiter` takes a pending abort from the task.
#[test]
fn a_wake_up_does_not_revive_an_aborted_task() {
    check_locks(
        "(defvar *go* (make-event))
         (let ((task (spawn (wait-for-events *go*) (hold) (print 'revived))))
           (sleep 0)
           (without-interrupts
             (abort-task task)
             (signal *go*))
           (print (list (wait-for-task task) (locks))))",
        &["(:ABORTED 0)"],
    );
}

/// Back with: in `events.esl`, a wait without a test takes the test of the wait before it.
#[test]
fn a_test_is_not_left_behind_for_the_next_wait() {
    check_locks(
        "(defvar *go* (make-event))
         (let ((task (spawn (with-recovery-procedures ((:timeout (abort)))
                              (wait-for-events *go* (lambda (value) (eql value 1)) :timeout 1))
                            (checkpoint :next)
                            (wait-for-events *go* :unless-count 0))))
           (checkpoint-wait task :next)
           (signal *go* 2)
           (print (nth-value 1 (wait-for-task task))))",
        &["2", "NIL"],
    );
}

/// Back with: `%run-daemon` waits before it looks.
#[test]
fn a_violation_before_the_daemon_first_waits_is_seen_to() {
    let text = format!(
        "{POWER}
         (spawn (with-automatic-recoveries (print (hold))))
         (assert '(power camera :off))"
    );
    // The change may come while the property is being achieved.
    let found = endings(&text, Grain::Changes);
    let outputs: Vec<&str> = found.endings.iter().map(|ending| ending.what.output.trim()).collect();
    assert!(outputs.iter().all(|&output| output == ":ON" || output.is_empty()), "{outputs:?}");
    let errors = found.endings.iter().map(|ending| &*ending.what.errors);
    let is_known = |errors: &str| errors.is_empty() || errors.contains(":CONDITION-NOT-ACHIEVED");
    assert!(errors.clone().all(is_known), "{:?}", errors.collect::<Vec<_>>());
}
