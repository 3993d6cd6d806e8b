//! What depends on time that passes while a program runs.

use std::path::Path;
use std::process::Command;

/// Runs a program; what it has written.
fn run(name: &str, program: &str) -> String {
    let source = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::write(&source, program).expect("the program can be written");
    let output = Command::new(env!("CARGO_BIN_EXE_eslvm")).arg("run").arg(&source).output();
    String::from_utf8(output.expect("the command can be run").stdout).expect("text")
}

/// Each evaluation of the form is followed by another one, because it signals.
#[test]
fn a_form_that_signals_does_not_put_off_the_timeout_of_wait_until() {
    let program = r"
(defvar *event* (make-event))
(defvar *begin* (now))
(print (handler-case (wait-until (progn (signal *event*) nil) :timeout 0.01)
         (failure (failure) (failure-cause failure))))
(print (>= (- (now) *begin*) 0.01))
(print (wait-until (>= (now) (+ *begin* 0.01)) :timeout -1))";
    let output = run("signalling.esl", program);
    assert_eq!(output.split_whitespace().collect::<Vec<_>>(), [":TIMEOUT", "T", "T"]);
}
