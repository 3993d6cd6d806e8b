//! The known defects of the original property locks, found by model checking, in flight and by our own
//! exploration. For each, a program that would reveal it runs under all schedules, without the defect. Then
//! the test puts the defect back into the library, and the exploration must reveal it.

use esl::program::Ended;
use esl_testing::explore::{Grain, Settings, explore_with};
use esl_vm::vm::Vm;

use super::putting_back::{TextChange, changed_functions};
use super::{POWER, TWO_TASKS_ENDINGS, check, compile, two_tasks};

/// Functions of the programs: holding the lock of a property, and counting the locks.
const HOLD: &str = "
  (defun hold (&optional (value :on))
    (with-maintained-property (power 'camera value)
      (sleep 0)
      (without-interrupts (power 'camera))))
  (defun locks () (hash-table-count esl::*%locks*))";

/// The beginning of the protected form in `with-maintained-property`; the release of the lock follows.
const PROTECTED: &str = r"    (unwind-protect
         (progn
           (%subscribe subscription)
           (funcall body))";

/// Checks that a program ends well and writes one of the `expected` lines under every schedule, but not with
/// `changes` in the library.
fn check_locks(text: &str, expected: &[&str], changes: &[TextChange]) {
    let text = format!("{POWER} {HOLD} {text}");
    check(&text, Grain::Changes, expected);
    check_that_it_shows(&text, expected, changes);
}

/// Checks that, with `changes` in the library, a program ends badly or writes another line under some
/// schedule.
fn check_that_it_shows(text: &str, expected: &[&str], changes: &[TextChange]) {
    let defect = changed_functions(changes);
    let settings = Settings { grain: Grain::Changes, states: 50_000, ..Settings::default() };
    let prepare = |machine: &mut Vm| defect.put_into(machine);
    let found = explore_with(&compile(text), &settings, &prepare).expect("the program can start");
    let is_well = |ending: &esl_testing::explore::ExploredEnding<esl_testing::explore::Behaviour>| {
        let output = ending.what.output.split_whitespace().collect::<Vec<_>>().join(" ");
        ending.what.ended == Ended::Normally(0) && expected.contains(&&*output)
    };
    let is_ended = found.limit.is_none() && found.endless.is_none() && !found.has_cycle;
    assert!(
        !(is_ended && found.endings.iter().all(is_well)),
        "the exploration does not reveal the defect: {changes:?}"
    );
}

/// Defect: the lock is released after the body instead of in a cleanup.
#[test]
fn an_abort_during_the_release_does_not_leak_the_lock() {
    check_locks(
        "(let ((task (spawn (hold)))) (abort-task task) (print (locks)))",
        &["0"],
        &[("locks.esl", PROTECTED, "(multiple-value-prog1 (progn (%subscribe subscription) (funcall body))")],
    );
}

/// Defect: the subscription precedes the establishment of the cleanup. A second abort comes during the first.
#[test]
fn the_lock_is_acquired_inside_the_protection() {
    check_locks(
        "(let ((task (spawn (hold))))
           (spawn (abort-task task))
           (wait-for-task task)
           (print (locks)))",
        &["0"],
        &[("locks.esl", PROTECTED, "(%subscribe subscription) (unwind-protect (funcall body)")],
    );
}

/// Defect: the wait ignores the count.
#[test]
fn a_count_is_tested_and_waited_for_in_one_step() {
    check_locks(
        "(task-net (a (hold)) (b (hold)))
         (print (locks))",
        &["0"],
        &[("locks.esl", "(%wait (%lock-event lock) mark", "(%wait (%lock-event lock) nil")],
    );
}

/// Defect: the state is set without another look at the property.
#[test]
fn a_property_that_was_violated_meanwhile_does_not_count_as_achieved() {
    check_locks(
        "(let ((task (spawn (with-recovery-procedures ((:maintained-property-violation (abort :told))
                                                       (:condition-not-achieved (abort :told)))
                              (with-maintained-property (power 'camera :on)
                                (without-interrupts (power 'camera)))))))
           (assert '(power camera :off))
           (print (nth-value 1 (wait-for-task task))))",
        &[":ON", ":TOLD"],
        &[(
            "locks.esl",
            r"            ((%holds-p lock)
             (setf",
            r"            (t
             (setf",
        )],
    );
}

/// Defect: secondary subscribers wait before they look.
#[test]
fn a_secondary_subscriber_looks_before_it_waits() {
    check_locks(
        "(task-net
           (a (with-maintained-property (power 'camera :on)
                (wait-for-task b)))
           (b (hold)))
         (print (locks))",
        &["0"],
        &[(
            "locks.esl",
            r"        (case (%lock-state lock)
          (:achieved (return))
          (:achieving",
            r" (unless (eq owner subscription)
  (%await-change lock count))
 (case (%lock-state lock)
  (:achieved (return))
  (:achieving",
        )],
    );
}

/// Defect: an owner that leaves notifies no subscriber.
#[test]
fn an_owner_that_dies_before_achieving_is_succeeded() {
    check_locks(
        "(let ((first (spawn (hold))) (second (spawn (hold))))
           (abort-task first)
           (print (nth-value 1 (wait-for-task second))))",
        &[":ON"],
        &[(
            "locks.esl",
            r"             (signal (%lock-event lock))
             t)
            ((%lock-restorer",
            "t) ((%lock-restorer",
        )],
    );
}

/// Defect: the guard stays open and does not check the subscription.
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
        &[
            ("locks.esl", "      (%close-guard (%subscription-guard subscription))", ""),
            (
                "locks.esl",
                r"(%subscription-lock subscription) nil
            (%subscription-pending subscription) nil)",
                "(%subscription-lock subscription) nil)",
            ),
            (
                "locks.esl",
                r"(when (%subscription-lock subscription)
      (cond",
                "(progn (cond",
            ),
        ],
    );
}

/// The only defect outside the library: it returns if waking a waiter clears a pending abort of the task.
#[test]
fn a_wake_up_does_not_revive_an_aborted_task() {
    const TEXT: &str = "(defvar *go* (make-event))
         (let ((task (spawn (wait-for-events *go*) (hold) (print 'revived))))
           (sleep 0)
           (without-interrupts
             (abort-task task)
             (signal *go*))
           (print (list (wait-for-task task) (locks))))";
    check(&format!("{POWER} {HOLD} {TEXT}"), Grain::Changes, &["(:ABORTED 0)"]);
}

/// Defect: a wait without a test uses the test of the previous wait.
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
        &[(
            "events.esl",
            r"(%wait-options options)
",
            r"(%wait-options options)
  (setq test (or test (get '%wait 'test)))
  (setf (get '%wait 'test) test)
",
        )],
    );
}

/// Defect: the daemon waits before it looks.
#[test]
fn a_violation_before_the_daemon_first_waits_is_restored() {
    // The change may come during the achievement of the property.
    check_locks(
        "(spawn (with-recovery-procedures ((:condition-not-achieved (abort :not-achieved)))
                  (with-automatic-recoveries (print (hold))))
                (print 'ended))
         (assert '(power camera :off))",
        &[":ON ENDED"],
        &[(
            "locks.esl",
            "(let ((mark (%mark-events *%violation*)))",
            "(%wait *%violation* (%mark-events *%violation*) nil) (let ((mark (%mark-events *%violation*)))",
        )],
    );
}

/// Defect: the last task to release a lock does not end the task that restores the property, which then
/// violates the lock of the next subscriber. Found by exploring our own implementation.
#[test]
fn a_restoration_for_nobody_does_not_violate_the_next_lock() {
    check_that_it_shows(
        &two_tasks(),
        TWO_TASKS_ENDINGS,
        &[("locks.esl", "            ((%lock-restorer lock) :restoring)\n", "")],
    );
}
