//! The known defects of the original property locks, which model checking, a flight and our own exploration have found: each is
//! looked for under all schedules of a program in which it would show. Then it is put back into the library, and has to show.

use esl::explore::{Grain, Settings, explore_with};
use esl::program::Ended;
use esl_vm::vm::Vm;

use crate::putting_back::{Change, changed_functions};
use crate::{TWO_TASKS, TWO_TASKS_ENDINGS, check, compile};

const POWER: &str = "
  (define-property power (device))
  (to-achieve (power device value)
    (t (assert (list 'power device value))))
  (defun hold (&optional (value :on))
    (with-maintained-property (power 'camera value)
      (sleep 0)
      (without-interrupts (power 'camera))))
  (defun locks () (hash-table-count esl::*%locks*))";

/// That each schedule of a program ends well and writes one of these lines, and that this is no longer so with `changes` in the
/// library.
fn check_locks(text: &str, expected: &[&str], changes: &[Change]) {
    let text = format!("{POWER} {text}");
    check(&text, Grain::Changes, expected);
    check_that_it_shows(&text, expected, changes);
}

/// That some schedule of a program does not end well, or writes another line, with `changes` in the library.
fn check_that_it_shows(text: &str, expected: &[&str], changes: &[Change]) {
    let defect = changed_functions(changes);
    let settings = Settings { states: 50_000, ..Settings::default() };
    let prepare = |machine: &mut Vm| defect.put_into(machine);
    let found = explore_with(&compile(text), &settings, &prepare).expect("the program can be begun");
    let is_well = |ending: &esl::explore::Ending<esl::explore::Outcome>| {
        let output = ending.what.output.split_whitespace().collect::<Vec<_>>().join(" ");
        ending.what.ended == Ended::Normally(0) && expected.contains(&&*output)
    };
    let is_ended = found.is_complete && found.endless.is_none() && !found.has_cycle;
    assert!(!(is_ended && found.endings.iter().all(is_well)), "the defect does not show: {changes:?}");
}

/// It is released after the body, not in a cleanup.
#[test]
fn an_abort_during_the_release_does_not_leak_the_lock() {
    check_locks(
        "(let ((task (spawn (hold)))) (abort-task task) (print (locks)))",
        &["0"],
        &[(
            "locks.esl",
            r"    (unwind-protect
         (progn
           (%subscribe subscription)
           (funcall body))
      (%release subscription))",
            r"(multiple-value-prog1 (progn (%subscribe subscription) (funcall body))
  (%release subscription))",
        )],
    );
}

/// It is subscribed to before the cleanup stands. A second abort comes while the first one is seen to.
#[test]
fn the_lock_is_acquired_inside_the_protection() {
    check_locks(
        "(let ((task (spawn (hold))))
           (spawn (abort-task task))
           (wait-for-task task)
           (print (locks)))",
        &["0"],
        &[(
            "locks.esl",
            r"    (unwind-protect
         (progn
           (%subscribe subscription)
           (funcall body))",
            "(%subscribe subscription) (unwind-protect (funcall body)",
        )],
    );
}

/// It is waited for whatever the count is.
#[test]
fn a_count_is_tested_and_waited_for_in_one_step() {
    check_locks(
        "(task-net (a (hold)) (b (hold)))
         (print (locks))",
        &["0"],
        &[("locks.esl", "(%wait (%lock-event lock) count", "(%wait (%lock-event lock) nil")],
    );
}

/// The state is set without looking at the property again.
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
        &[(
            "locks.esl",
            r"after ACHIEVE has looked.
            ((%holds-p lock)",
            r"
            (t",
        )],
    );
}

/// The others wait before they look.
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

/// Nobody is told when it leaves.
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

/// The guard is left open, and does not ask for the lock.
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

/// The only one that is not in the library: back with a `Vm::wake_waiter` that takes a pending abort from the task.
#[test]
fn a_wake_up_does_not_revive_an_aborted_task() {
    const TEXT: &str = "(defvar *go* (make-event))
         (let ((task (spawn (wait-for-events *go*) (hold) (print 'revived))))
           (sleep 0)
           (without-interrupts
             (abort-task task)
             (signal *go*))
           (print (list (wait-for-task task) (locks))))";
    check(&format!("{POWER} {TEXT}"), Grain::Changes, &["(:ABORTED 0)"]);
}

/// A wait without a test takes the test of the wait before it.
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

/// The daemon waits before it looks.
#[test]
fn a_violation_before_the_daemon_first_waits_is_seen_to() {
    // The change may come while the property is being achieved.
    check_locks(
        "(spawn (with-recovery-procedures ((:condition-not-achieved (abort :not-achieved)))
                  (with-automatic-recoveries (print (hold))))
                (print 'ended))
         (assert '(power camera :off))",
        &[":ON ENDED"],
        &[(
            "locks.esl",
            "(let ((count (event-count *%violation*)))",
            "(%wait *%violation* (event-count *%violation*) nil) (let ((count (event-count *%violation*)))",
        )],
    );
}

/// The last one to release a lock leaves the task that restores it to itself: it violates the lock of whoever comes next. Found
/// by exploring our own.
#[test]
fn a_restoration_for_nobody_does_not_violate_the_next_lock() {
    check_that_it_shows(
        TWO_TASKS,
        TWO_TASKS_ENDINGS,
        &[("locks.esl", "            ((%lock-restorer lock) :restoring)\n", "")],
    );
}
