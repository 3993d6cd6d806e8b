//! `eslvm explore`: programs that go on for ever, and conditions that have to come.

use esl_conformance::folder::Folder;

use crate::exploring::run;

#[test]
fn a_program_that_goes_on_for_ever_is_judged_by_its_conditions() {
    let folder = Folder::new("exploring-endless");
    folder.file(
        "lamp.esl",
        "(defvar *lamp* nil)
(leads-to lit (not *lamp*) *lamp*)
(task-net (off (loop (setq *lamp* nil) (sleep 0)))
          (on (loop (setq *lamp* t) (sleep 0))))
",
    );
    let explore = |options: &[&str]| {
        let (status, output, errors) = run(&folder, &[&["explore", "lamp.esl"], options].concat());
        assert_eq!(errors, "", "{output}");
        (status, output)
    };
    let (status, output) = explore(&["--endless"]);
    assert_eq!(status, Some(0), "{output}");
    assert!(output.starts_with("complete: ") && output.contains("(--endless)"), "{output}");
    let (status, output) = explore(&[]);
    assert_eq!(status, Some(1), "{output}");
    assert!(output.starts_with("finding 1: from here on, the program never ends"), "{output}");
    let (status, output) = explore(&["--endless", "--fairness", "none"]);
    assert_eq!(status, Some(1), "{output}");
    let expected =
        "finding 1: LIT never comes true while tasks go on for ever, if the schedule may be unfair\n";
    assert!(output.starts_with(expected), "{output}");
}

#[test]
fn a_livelock_is_found_and_told_with_what_repeats() {
    let folder = Folder::new("exploring-livelock");
    folder.file(
        "polite.esl",
        "(defvar *left* nil)
(defvar *right* nil)
(defun eat (first second)
  (loop
    (setf (symbol-value first) t)
    (sleep 0)
    (unless (symbol-value second)
      (setf (symbol-value first) nil)
      (return))
    (setf (symbol-value first) nil)
    (sleep 0)))
(task-net (a (eat '*left* '*right*)) (b (eat '*right* '*left*)))
",
    );
    let (status, output, errors) = run(&folder, &["explore", "polite.esl"]);
    assert_eq!((status, errors.as_str()), (Some(1), ""), "{output}");
    assert!(
        output.starts_with("finding 1: tasks can go on for ever, though each has its turns\n"),
        "{output}"
    );
    assert!(output.contains("\n  then ") && output.contains(" again, and so on\n  again: "), "{output}");
    let (_, output, _) = run(&folder, &["explore", "--json", "polite.esl"]);
    assert!(output.contains("\"repeated\":"), "{output}");
    let (status, ..) =
        run(&folder, &["run", "--budget", "100000", "--schedule", "polite-1.schedule", "polite.esl"]);
    assert_eq!(status, Some(5), "it goes on for ever");
}
