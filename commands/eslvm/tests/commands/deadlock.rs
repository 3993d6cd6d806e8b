//! The report of a deadlock: every task that waits, what it waits for, and where in the program.

use esl_conformance::folder::Folder;
use esl_conformance::process;

use crate::eslvm;

/// Returns the lines of a report, with the file's name in place of its path.
fn lines(name: &str, report: &str) -> Vec<String> {
    let short = |line: &str| match (line.rfind(", "), line.rfind(name)) {
        (Some(comma), Some(at)) => format!("{}, {}", &line[..comma], &line[at..]),
        _ => line.to_string(),
    };
    report.lines().map(|line| short(line.trim())).collect()
}

/// A tail call leaves no frame of the function that waits; the report then names the form with which the task
/// began.
#[test]
fn every_task_that_waits_is_named_with_its_place() {
    let program = r#"(defvar *door* (make-event 'door)) (defvar *main* (current-task))
(defun await (event)
  (wait-for-event event))
(spawn (:name 'in-the-middle) (list (wait-for-event *door*)))
(spawn (:name 'at-the-end)
  (princ-to-string 'something)
  (wait-for-event *door*))
(spawn (:name 'by-a-function) (await *door*))
(spawn (:name 'one-of-two)
  (if *door* (checkpoint-wait (current-task) 'never) (wait-for-task *main*)))
(spawn (:name 'until)
  (wait-until (eq *door* nil)))
(task-net
  (left (wait-for-task right))
  (right (checkpoint-wait left 'done)))
"#;
    let source = Folder::new("deadlock").file("deadlock.esl", program);
    let run = process::run(&mut eslvm(&["run", "--clock", "virtual", &source]), "");
    assert_eq!(run.status, Some(4), "{}", run.errors);
    assert_eq!(
        lines("deadlock.esl", &run.errors),
        [
            "Deadlock: no task can ever run again.",
            "the main task waits for its tasks, deadlock.esl:13:1",
            "task IN-THE-MIDDLE waits for event DOOR, deadlock.esl:4:37",
            "task AT-THE-END waits for event DOOR, deadlock.esl:7:3",
            "task BY-A-FUNCTION waits for event DOOR, deadlock.esl:3:3",
            "task ONE-OF-TWO waits for checkpoint NEVER of task ONE-OF-TWO, deadlock.esl:10:7",
            "task UNTIL waits for (EQ *DOOR* NIL) to be true, deadlock.esl:12:3",
            "task LEFT waits for the end of task RIGHT, deadlock.esl:14:9",
            "task RIGHT waits for checkpoint DONE of task LEFT, deadlock.esl:15:10",
        ]
    );
}

/// Waits of the forms of coordination have names of their own: fluents, children, the suspending task.
#[test]
fn what_coordination_waits_for_is_named() {
    let program = r#"(define-fluent level 0)
(define-resource arm)
(defvar *never* (make-event 'never))
(spawn (:name 'holder)
  (with-resource (arm) (wait-until (> level 5))))
(spawn (:name 'waiter)
  (sleep 1)
  (with-resource (arm) t))
(spawn (:name 'watcher)
  (whenever (> level 7) (princ 'never)))
(spawn (:name 'supervisor)
  (supervise () (motor (wait-for-event *never*)) (lamp (wait-for-event *never*))))
(defvar *stopped* (spawn (:name 'stopped) (wait-for-event *never*)))
(sleep 2)
(suspend-task *stopped*)
"#;
    let source = Folder::new("coordination").file("coordination.esl", program);
    let run = process::run(&mut eslvm(&["run", "--clock", "virtual", &source]), "");
    assert_eq!(run.status, Some(4), "{}", run.errors);
    let lines = lines("coordination.esl", &run.errors);
    let reasons: Vec<&str> =
        lines.iter().filter_map(|line| line.rsplit_once(", ")).map(|(said, _)| said).collect();
    assert_eq!(
        reasons,
        [
            "task HOLDER waits for (> LEVEL 5) to be true by changes of LEVEL",
            "task WAITER waits for resource ARM, held by task HOLDER",
            "task WATCHER waits for (> LEVEL 7) to be true by changes of LEVEL",
            "task SUPERVISOR waits for the end of MOTOR or LAMP",
            "task STOPPED waits for RESUME-TASK, suspended by a task that has ended",
            "task MOTOR waits for event NEVER",
            "task LAMP waits for event NEVER",
        ]
    );
}
