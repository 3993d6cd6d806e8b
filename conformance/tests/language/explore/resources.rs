//! Resources under all schedules: nothing is held by a task that has ended, and no grant is lost, with an
//! abort or a preemption at every point.

use esl_testing::explore::Grain;

use super::check;

/// Two resources, and what is held of them and waited for.
const RESOURCES: &str = "
  (define-resource arm)
  (define-resource leg)
  (defvar *step* (make-event))
  (defun go-on () (signal *step*))
  (defun left ()
    (without-interrupts
      (mapcar (lambda (name)
                (+ (length (resource-holders name)) (length (resource-waiters name))
                   (svref (get name 'esl::%resource) 7) (svref (get name 'esl::%resource) 8)))
              '(arm leg))))";

fn check_resources(text: &str, expected: &[&str]) {
    check(&format!("{RESOURCES} {text}"), Grain::Changes, expected);
}

#[test]
fn an_abort_at_any_point_leaves_nothing_held() {
    check_resources(
        "(let ((holder (spawn (with-resources ((arm) (leg)) (go-on))))
               (waiter (spawn (with-resources ((leg) (arm)) (go-on)))))
           (abort-task holder)
           (wait-for-task waiter)
           (print (left)))",
        &["(0 0)"],
    );
}

#[test]
fn forms_that_share_some_resources_all_end() {
    check_resources(
        "(task-net (a (with-resources ((arm) (leg)) (go-on)))
                   (b (with-resource (leg :priority 7) (go-on)))
                   (c (with-resource (arm) (with-resource (leg)))))
         (print (left))",
        &["(0 0)"],
    );
}

#[test]
fn a_preempted_form_ends_before_the_grant_and_fails_once() {
    // The holder is preempted, or is done before the other request comes, or comes after it.
    check_resources(
        "(defvar *inside* 0)
         (defvar *failures* 0)
         (defun hold (priority)
           (with-resource (arm :priority priority :preemptible t)
             (incf *inside*)
             (unless (= *inside* 1) (print 'together))
             (unwind-protect (go-on)
               (decf *inside*))))
         (task-net (a (handler-case (hold 1)
                        (failure (failure)
                          (unless (equal (failure-cause failure) :resource-preempted) (print failure))
                          (incf *failures*))))
                   (b (hold 2)))
         (print (list *inside* *failures* (left)))",
        &["(0 0 (0 0))", "(0 1 (0 0))"],
    );
}

#[test]
fn preemption_abort_and_request_come_in_any_order() {
    check_resources(
        "(let* ((low (spawn (handler-case (with-resource (arm :priority 1 :preemptible t) (go-on))
                              (failure () nil))))
                (high (spawn (with-resources ((arm :priority 6) (leg)) nil))))
           (spawn (abort-task low))
           (wait-for-task low)
           (wait-for-task high)
           (with-resources ((arm :if-denied :fail) (leg)) (print (left))))",
        &["(2 2)"],
    );
}

#[test]
fn two_requests_that_preempt_and_an_abort_come_in_any_order() {
    // The aborted task requests the resource, holds it, or has been preempted.
    check_resources(
        "(define-resource seat :capacity 2)
         (defvar *inside* 0)
         (defun sit (priority)
           (handler-case
               (with-resource (seat :priority priority :preemptible t)
                 (incf *inside*)
                 (when (> *inside* 2) (print 'too-many))
                 (unwind-protect (go-on)
                   (decf *inside*)))
             (failure () nil)))
         (let ((tasks (list (spawn (sit 1)) (spawn (sit 5)) (spawn (sit 5)))))
           (abort-task (second tasks))
           (dolist (task tasks) (wait-for-task task))
           (let ((seat (get 'seat 'esl::%resource)))
             (print (list *inside* (resource-holders 'seat) (resource-waiters 'seat) (svref seat 7) (svref seat 8)
                          (svref (svref seat 11) 8) (svref (svref seat 12) 8) (reduce #'+ (svref seat 13))))))",
        &["(0 NIL NIL 0 0 0 0 0)"],
    );
}
