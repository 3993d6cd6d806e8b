//! Each form of coordination under all schedules, with an abort, a failure and a suspension at every point.
//!
//! The failure comes by a guardian, which interrupts the form wherever it is. Afterwards nothing is left:
//! every body that has begun was cleaned up once, and no task, claim, watch, source or suspension is there. A
//! form that was suspended and resumed ends as without. Forms with several bodies are suspended in
//! `composition` and `keeping`.

use super::composition::{NOTHING, check_bodies};

/// Returns the beginning of the programs. `others` runs beside a form, and ends by itself.
fn setup(others: &str) -> String {
    format!(
        "(defmacro outcome (form)
           `(handler-case ,form (failure (failure) (failure-cause failure))))
         (define-fluent door :closed)
         (define-fluent (is-open) (eq door :open))
         (define-property power (device))
         (defun await-others ()
           (loop (unless (cdr (list-tasks)) (return)) (sleep 1)))
         (defun end ()
           (await-others)
           (princ (list (left) (get 'power 'esl::%sources)
                        (svref (get 'arm 'esl::%resource) 7) (svref (get 'arm 'esl::%resource) 8))))
         (defun begin-others () {others})"
    )
}

/// Checks that a program ends with one of `outcomes`, and leaves nothing.
fn check_ends(text: &str, outcomes: &[&str]) {
    let mut ends: Vec<String> =
        outcomes.iter().map(|outcome| format!("{outcome}({NOTHING} NIL 0 0)")).collect();
    ends.sort_unstable();
    let ends: Vec<&str> = ends.iter().map(String::as_str).collect();
    check_bodies(text, &ends);
}

/// Checks that `form` leaves nothing when it is aborted at any point, nor when a failure comes at any point;
/// then it ends as one of `outcomes`, its value or the cause of its failure, or with that failure. A form
/// that takes time always ends with it, since time passes only when all tasks wait.
fn check_abort_and_failure(others: &str, form: &str, outcomes: &[&str]) {
    let setup = setup(others);
    check_ends(
        &format!("{setup} (let ((task (spawn (outcome {form})))) (begin-others) (abort-task task) (end))"),
        &[""],
    );
    let with_failure: Vec<&str> = outcomes.iter().copied().chain(["INJECTED"]).collect();
    check_ends(
        &format!(
            "{setup}
             (begin-others)
             (princ (outcome (with-guardian (go-on) (fail :injected) {form})))
             (end)"
        ),
        &with_failure,
    );
}

/// Checks that `form`, begun when the others have ended, ends with `outcome` when it is suspended and resumed
/// at any point.
fn check_suspension(others: &str, form: &str, outcome: &str) {
    let setup = setup(others);
    check_ends(
        &format!(
            "{setup}
             (begin-others)
             (await-others)
             (let ((task (spawn (princ (outcome {form})))))
               (suspend-task task)
               (resume-task task)
               (wait-for-task task)
               (end))"
        ),
        &[outcome],
    );
}

/// Checks all three; the first of `outcomes` is the one of a form that is suspended.
fn check_everywhere(others: &str, form: &str, outcomes: &[&str]) {
    check_abort_and_failure(others, form, outcomes);
    check_suspension(others, form, outcomes[0]);
}

#[test]
fn a_pursuit() {
    check_abort_and_failure("", "(pursue (a (body (go-on) 'a)) (b (body (sleep 1))))", &["A"]);
}

#[test]
fn alternatives_at_the_same_time() {
    check_abort_and_failure("", "(try-all (a (body (fail :lost))) (b (body (sleep 1) 'b)))", &[]);
}

#[test]
fn alternatives_in_order() {
    check_abort_and_failure("", "(try-in-order (a (body (fail :lost))) (b (body (go-on) 'b)))", &["B"]);
}

#[test]
fn a_partial_order() {
    check_abort_and_failure(
        "",
        "(values (partial-order ((a (body 'a)) (b (body (go-on)))) (:order a b)))",
        &["A"],
    );
}

#[test]
fn retries_with_back_off() {
    check_abort_and_failure(
        "",
        "(let ((times 0))
           (with-recovery-procedures ((:lost :retries 1 :backoff (1 2 10) (retry)))
             (body (with-resource (arm) (if (= (incf times) 1) (fail :lost) times)))))",
        &[],
    );
}

#[test]
fn a_wait_for_fluents() {
    check_everywhere("(spawn (setf door :open))", "(wait-until (is-open))", &["T"]);
}

#[test]
fn a_wait_for_facts() {
    check_everywhere("(spawn (assert '(power motor :on)))", "(wait-until (power 'motor :on))", &["T"]);
}

#[test]
fn a_wait_with_a_timeout() {
    let (others, form) =
        ("(spawn (sleep 1) (assert '(power motor :on)))", "(wait-until (power 'motor :on) :timeout 1)");
    check_abort_and_failure(others, form, &[]);
    check_suspension(others, form, "T");
}

#[test]
fn a_wait_for_something_that_stays() {
    let (others, form) = ("(spawn (assert '(power motor :on)))", "(wait-until (power 'motor :on) :for 1)");
    check_abort_and_failure(others, form, &[]);
    check_suspension(others, form, "T");
}

#[test]
fn a_watcher() {
    check_everywhere(
        "(spawn (setf door :open))",
        "(whenever (is-open) (body (go-on)) (return 'seen))",
        &["SEEN"],
    );
}

#[test]
fn a_watcher_of_the_latest() {
    check_everywhere(
        "(spawn (assert '(power motor :on)))",
        "(whenever ((power 'motor :on) :latest t) (body (go-on)) (return 'seen))",
        &["SEEN"],
    );
}

#[test]
fn a_resource() {
    check_everywhere(
        "(spawn (with-resource (arm) (go-on)))",
        "(with-resource (arm) (body (go-on)) 'had)",
        &["HAD"],
    );
}

#[test]
fn a_resource_that_is_preempted() {
    check_everywhere(
        "(spawn (with-resource (arm :priority 6) nil))",
        "(with-resource (arm :preemptible t) (body (go-on)) 'had)",
        &["HAD", "RESOURCE-PREEMPTED"],
    );
}

#[test]
fn several_resources() {
    check_everywhere(
        "(spawn (with-resource (arm) nil))",
        "(progn (define-resource leg) (with-resources ((leg) (arm)) (body (go-on)) 'had))",
        &["HAD"],
    );
}

#[test]
fn supervision_of_one() {
    check_abort_and_failure(
        "",
        "(let ((times 0))
           (supervise (:restarts 1)
             (a :restart :transient :backoff (1 1 1)
               (body (when (= (incf times) 1) (fail :lost)))))
           times)",
        &[],
    );
}

#[test]
fn supervision_of_a_group() {
    check_abort_and_failure(
        "",
        "(let ((times 0))
           (supervise (:strategy :rest-for-one :restarts 1)
             (a :restart :transient :backoff (0 1 0) (body (when (= (incf times) 1) (fail :lost))))
             (b :restart :temporary (body (sleep 1))))
           times)",
        &["2"],
    );
}

#[test]
fn a_quota() {
    check_abort_and_failure(
        "",
        "(with-quota (:tasks 1) (task-net (a (body (go-on)))) 'enough)",
        // The task of the guardian, too, belongs to its maker, outside.
        &["ENOUGH"],
    );
}

#[test]
fn a_quota_that_is_exhausted() {
    check_everywhere("", "(with-quota (:tasks 1) (task-net (a (body)) (b (body))))", &["QUOTA-EXHAUSTED"]);
}

#[test]
fn procedures_for_suspension() {
    check_everywhere("", "(with-suspension-procedures ((go-on) (go-on)) (body (go-on)) 'done)", &["DONE"]);
}
