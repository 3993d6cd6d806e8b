//! `eslvm run --trace`: what is asked for, and nothing else, is written to standard error.

use std::io::Write;
use std::process::{Command, Stdio};

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

/// Runs the program with further options: the status, standard output and standard error.
fn run(options: &[&str]) -> (i32, String, String) {
    let mut child = Command::new(env!("CARGO_BIN_EXE_eslvm"))
        .arg("run")
        .args(options)
        .arg("-")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the command is there");
    // A command that refuses its options does not read.
    let _ = child.stdin.take().expect("it is piped").write_all(PROGRAM.as_bytes());
    let output = child.wait_with_output().expect("it ends");
    let text = |bytes| String::from_utf8(bytes).expect("the command writes UTF-8");
    (output.status.code().unwrap_or(-1), text(output.stdout), text(output.stderr))
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
