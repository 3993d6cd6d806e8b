//! `eslvm run --trace`: standard error gets the traces that are asked for, and nothing else.

use esl_conformance::process;

use crate::eslvm;

const PROGRAM: &str = "
(defvar *on* nil)
(defun on-p () *on*)
(to-achieve (on-p) (t (setq *on* t)))
(achieve (on-p))
(achieve (on-p))
(with-recovery-procedures ((:stuck :retries 2 (abort)))
  (fail :stuck))
(print 'done)
";

const GOALS: &str = "\
Attempting to achieve (ON-P)
(ON-P) achieved.
(ON-P) achieved. (No action needed.)
";

const FAILURES: &str = "Failure :STUCK, recovery available. (1 retry)\n";

/// Runs the program with further options; returns its status, standard output and standard error.
fn run(options: &[&str]) -> (i32, String, String) {
    let run = process::run(eslvm(&["run"]).args(options).arg("-"), PROGRAM);
    (run.status.unwrap_or(-1), run.output, run.errors)
}

#[test]
fn a_run_traces_what_is_asked_for() {
    for (options, expected) in [
        (&[][..], String::new()),
        (&["--trace", "failures"], FAILURES.to_string()),
        (&["--trace", "goals"], GOALS.to_string()),
        (&["--trace", "failures,goals"], format!("{GOALS}{FAILURES}")),
    ] {
        assert_eq!(run(options), (0, "\nDONE ".to_string(), expected), "{options:?}");
    }
}

#[test]
fn an_unknown_trace_is_refused() {
    let (status, output, errors) = run(&["--trace", "failings"]);
    assert_eq!((status, &*output), (2, ""));
    assert!(errors.contains("failings") && errors.contains("failures"), "{errors}");
}
