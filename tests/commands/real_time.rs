//! Behaviour that depends on the time that passes while a program runs.

use esl_conformance::process;

use crate::eslvm;
use crate::folder::Folder;

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
    let source = Folder::new("real-time").file("signalling.esl", program);
    let run = process::run(&mut eslvm(&["run", &source]), "");
    assert_eq!(run.output.split_whitespace().collect::<Vec<_>>(), [":TIMEOUT", "T", "T"]);
}
