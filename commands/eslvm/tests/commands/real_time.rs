//! Behaviour that depends on the time that passes while a program runs.

use esl_conformance::folder::Folder;
use esl_conformance::process;

use crate::eslvm;

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

#[test]
fn the_time_of_the_processor_passes_only_while_something_is_computed() {
    // Time that the processor spends on other processes does not count, so this holds on a busy machine.
    let program = r"
(defun spent-by (function)
  (let ((begin (get-internal-run-time)))
    (funcall function)
    (- (get-internal-run-time) begin)))
(defvar *asleep* (spent-by (lambda () (sleep 0.5))))
(defvar *awake* (spent-by (lambda () (loop until (> (get-internal-run-time) 700000)))))
(print (list (< -1 *asleep* 400000) (>= (+ *awake* *asleep*) 0) (>= (get-internal-run-time) 700000)))";
    let source = Folder::new("processor-time").file("spending.esl", program);
    let run = process::run(&mut eslvm(&["run", &source]), "");
    assert_eq!(run.output.split_whitespace().collect::<Vec<_>>(), ["(T", "T", "T)"]);
}
