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

/// A run has the settings that the system permits, and reports the others.
#[test]
#[cfg(target_os = "linux")]
fn a_run_in_real_time_locks_its_memory_and_has_a_priority_or_says_that_it_does_not() {
    let program = r#"
(with-open-file (in "/proc/self/stat")
  (let ((line (read-line in)))
    (let ((fields (loop for start = (+ 2 (position #\) line)) then (+ end 1)
                        for end = (position #\Space line :start start)
                        while end
                        collect (subseq line start end))))
      (print (list :priority (nth 37 fields) :policy (nth 38 fields))))))
(with-open-file (in "/proc/self/status")
  (loop for line = (read-line in nil)
        while line
        do (when (eql (search "VmLck:" line) 0)
             (print (list :locked (/= 0 (parse-integer line :start 7 :end (search "kB" line))))))))
(print (loop repeat 10 collect (length (make-list 100000))))"#;
    let folder = Folder::new("in-time");
    let source = folder.file("in-time.esl", program);
    let run = process::run(&mut eslvm(&["run", "--realtime=7", "--allow-read=/proc", &source]), "");
    assert_eq!(run.status, Some(0), "{}", run.errors);
    let said = |text: &str| run.errors.contains(&format!("eslvm: --realtime: {text}"));
    let expected =
        if said("the priority is not set") { "\"0\" :POLICY \"0\"" } else { "\"7\" :POLICY \"1\"" };
    assert!(run.output.contains(&format!("(:PRIORITY {expected})")), "{}{}", run.output, run.errors);
    let locked = if said("memory is not locked") { "(:LOCKED NIL)" } else { "(:LOCKED T)" };
    assert!(run.output.contains(locked), "{}{}", run.output, run.errors);
    let lines = |text: &str| text.lines().all(|line| line.starts_with("eslvm: --realtime: "));
    assert!(lines(&run.errors), "{}", run.errors);
    // Time is real.
    let refused = process::run(&mut eslvm(&["run", "--realtime", "--clock", "virtual", &source]), "");
    assert_eq!((refused.status, &*refused.output), (Some(2), ""));
    assert!(refused.errors.contains("`--realtime` has no effect on a virtual clock"), "{}", refused.errors);
    for conflicting in [["--realtime=0"].as_slice(), &["--realtime", "--state", "x"], &["--realtime=100"]] {
        let refused = process::run(&mut eslvm(&[["run"].as_slice(), conflicting, &[&source]].concat()), "");
        assert_eq!((refused.status, &*refused.output), (Some(2), ""), "{conflicting:?}");
    }
}
