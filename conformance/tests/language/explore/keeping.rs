//! Forms that keep something so, under all schedules: supervisors, watchers and quotas, with an abort, a
//! failure or a suspension at every point.

use super::composition::{NOTHING, check_bodies};

// ---- supervision

#[test]
fn a_child_is_restarted_when_it_has_ended_and_never_twice_at_a_time() {
    check_bodies(
        "(defvar *times* 0)
         (supervise (:restarts 2)
           (a :restart :transient :backoff (0 1 0)
             (unless (= *open* 0) (princ 'together))
             (body (go-on) (when (< (incf *times*) 3) (fail :lost)))))
         (princ (list *times* (left)))",
        &["(3 (0 1 0 0 0 0))"],
    );
}

#[test]
fn a_group_is_ended_before_it_is_restarted() {
    check_bodies(
        "(defvar *times* 0)
         (defvar *running* nil)
         (defmacro alone (name &body forms)
           `(progn
              (when (member ,name *running*) (princ 'twice))
              (push ,name *running*)
              (unwind-protect (progn ,@forms)
                (setq *running* (remove ,name *running*)))))
         (supervise (:strategy :one-for-all :restarts 1)
           (a :restart :transient :backoff (0 1 0)
             (alone 'a (go-on) (when (= (incf *times*) 1) (fail :lost))))
           (b :restart :transient (alone 'b (sleep 1))))
         (princ (list *times* *running* (left)))",
        &["(2 NIL (0 1 0 0 0 0))"],
    );
}

#[test]
fn too_many_failures_end_the_children_first() {
    check_bodies(
        "(princ (handler-case
                    (supervise (:restarts 0) (a (body (go-on) (fail :lost))) (b (body (sleep 1))))
                  (failure (failure) (list (failure-cause failure) *open*))))
         (princ (left))",
        &["(RESTARTS-EXHAUSTED 0)(0 1 0 0 0 0)"],
    );
}

#[test]
fn an_abort_leaves_no_child_wherever_the_supervisor_is() {
    check_bodies(
        "(let ((task (spawn (supervise (:restarts 1) (a :backoff (1 1 1) (body (go-on) (fail :lost)))))))
           (abort-task task)
           (princ (left)))",
        &[NOTHING],
    );
}

#[test]
fn an_abort_of_a_child_is_an_end_like_others() {
    check_bodies(
        "(defvar *child* nil)
         (let ((task (spawn (supervise (:restarts 1)
                              (a :restart :transient :backoff (0 1 0)
                                (setq *child* (current-task))
                                (body (go-on)))))))
           (when *child* (abort-task *child*))
           (wait-for-task task)
           (princ (list (task-status task) (left))))",
        &["(SUCCEEDED (0 1 0 0 0 0))"],
    );
}

#[test]
fn a_supervisor_and_its_child_are_suspended_wherever_they_are() {
    check_bodies(
        "(defvar *times* 0)
         (let ((task (spawn (supervise (:restarts 1)
                              (a :restart :transient :backoff (1 1 1)
                                (body (when (= (incf *times*) 1) (fail :lost))))))))
           (suspend-task task)
           (resume-task task)
           (wait-for-task task)
           (princ (list (task-status task) *times* (left))))",
        &["(SUCCEEDED 2 (0 1 0 0 0 0))"],
    );
}

#[test]
fn a_supervisor_and_its_group_are_suspended_wherever_they_are() {
    for (strategy, backoff, other) in [
        (":one-for-all", "(0 1 0)", "(sleep 1)"),
        (":one-for-all", "(1 1 1)", "(wait-until (> *times* 1))"),
        (":rest-for-one", "(0 1 0)", "(body (sleep 1))"),
    ] {
        check_bodies(
            &format!(
                "(defvar *times* 0)
                 (let ((task (spawn (supervise (:strategy {strategy} :restarts 1)
                                      (a :restart :transient :backoff {backoff}
                                        (when (= (incf *times*) 1) (fail :lost)))
                                      (b :restart :transient {other})))))
                   (suspend-task task)
                   (resume-task task)
                   (wait-for-task task)
                   (princ (list (task-status task) *times* (left))))"
            ),
            &["(SUCCEEDED 2 (0 1 0 0 0 0))"],
        );
    }
}

// ---- watchers beside other forms

#[test]
fn a_watcher_that_wants_a_resource_loses_no_pulse() {
    check_bodies(
        "(define-fluent button nil)
         (let ((count 0))
           (task-net
             (a (whenever button
                  (with-resource (arm) (incf count))
                  (when (= count 2) (return))))
             (b (sleep 1)
                (with-resource (arm)
                  (setf button t) (setf button nil))
                (setf button t)))
           (princ (list count (left))))",
        &["(2 (0 1 0 0 0 0))"],
    );
}

#[test]
fn a_watcher_that_is_suspended_loses_no_pulse() {
    check_bodies(
        "(define-fluent button nil)
         (let* ((count 0)
                (task (spawn (whenever button
                               (when (= (incf count) 2) (return))))))
           (sleep 1)
           (setf button t)
           (suspend-task task)
           (setf button nil)
           (setf button t)
           (resume-task task)
           (wait-for-task task)
           (princ (list count (left))))",
        &["(2 (0 1 0 0 0 0))"],
    );
}

#[test]
fn an_abort_ends_a_watcher_and_its_body_wherever_they_are() {
    check_bodies(
        "(define-fluent button nil)
         (let ((task (spawn (whenever button (body (with-resource (arm) (go-on)))))))
           (spawn (setf button t))
           (abort-task task)
           (wait-until button)
           (loop (unless (cdr (list-tasks)) (return)) (sleep 1))
           (princ (left)))",
        &[NOTHING],
    );
}

// ---- quotas

#[test]
fn a_task_too_many_ends_the_form_and_those_that_are_there() {
    check_bodies(
        "(princ (handler-case (with-quota (:tasks 1)
                                (task-net (a (body (go-on))) (b (body (go-on) (princ 'begun)))))
                  (failure (failure) (list (failure-cause failure) *open*))))
         (princ (left))",
        &["(QUOTA-EXHAUSTED 0)(0 1 0 0 0 0)"],
    );
}

#[test]
fn tasks_count_until_they_have_ended() {
    // The second is too many as long as the first one is there.
    check_bodies(
        "(princ (handler-case (with-quota (:tasks 1)
                                (let ((first (spawn (body (go-on)))))
                                  (go-on)
                                  (wait-for-task (spawn (go-on)))
                                  (wait-for-task first)
                                  'enough))
                  (failure (failure) (failure-cause failure))))
         (loop (unless (cdr (list-tasks)) (return)) (sleep 1))
         (princ (left))",
        &["ENOUGH(0 1 0 0 0 0)", "QUOTA-EXHAUSTED(0 1 0 0 0 0)"],
    );
}

#[test]
fn a_quota_that_a_task_inside_exceeds_ends_its_form_once() {
    check_bodies(
        "(defvar *ends* 0)
         (princ (handler-case (with-quota (:tasks 1)
                                (unwind-protect
                                     (task-net (a (body (wait-for-task (spawn (go-on))))))
                                  (incf *ends*)))
                  (failure (failure) (failure-cause failure))))
         (princ (list *ends* (left)))",
        &["QUOTA-EXHAUSTED(1 (0 1 0 0 0 0))"],
    );
}

#[test]
fn an_abort_ends_a_quota_wherever_it_is() {
    check_bodies(
        "(let ((task (spawn (handler-case (with-quota (:tasks 1)
                                            (task-net (a (body (go-on))) (b (go-on))))
                              (failure () nil)))))
           (abort-task task)
           (princ (left)))",
        &[NOTHING],
    );
}

#[test]
fn a_quota_is_suspended_wherever_it_is() {
    check_bodies(
        "(let ((task (spawn (handler-case (with-quota (:tasks 0) (spawn (princ 'begun)))
                              (failure (failure) (failure-cause failure))))))
           (suspend-task task)
           (resume-task task)
           (princ (list (multiple-value-list (wait-for-task task)) (left))))",
        &["((SUCCEEDED QUOTA-EXHAUSTED) (0 1 0 0 0 0))"],
    );
}
