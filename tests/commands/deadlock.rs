//! The report of a deadlock: every task that waits, what it waits for, and where in the program.

use esl_conformance::process;

use crate::eslvm;
use crate::folder::Folder;

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
