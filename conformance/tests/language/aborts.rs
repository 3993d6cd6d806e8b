//! Aborts a nest of cleanups at every safepoint, and again at every later safepoint: each form that was
//! entered is cleaned up exactly once and completely, and the task ends.
//!
//! The test drives the machine tick by tick, so it misses no step. The outer loop stops when the nest
//! completes before the first abort, the inner loop when it has ended before the second.

use esl::host::VirtualHost;
use esl::program::{self, Source};
use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;
use esl_vm::task::TaskResult;
use esl_vm::value::Value;
use esl_vm::vm::Vm;

/// Each entry of a form has its own number. The log holds `in` for its body, `begin` and `end` for its
/// cleanup.
const PROGRAM: &str = "
(defvar *entries* 0)
(defvar *log* nil)
(defun note (what entry) (push (cons what entry) *log*))
(defun work () (dotimes (i 2) (identity i)))
(defmacro protecting (form body &body cleanup)
  `(let ((entry (incf *entries*)))
     (,form
       ,@(if (eq form 'unwind-protect) `((progn (note 'in entry) ,body)))
       (progn (note 'begin entry) ,@cleanup (note 'end entry))
       ,@(if (eq form 'unwind-protect) '() `((note 'in entry) ,body)))))

(defun nest ()
  (setq *entries* 0 *log* nil)
  (protecting unwind-protect
      (protecting with-cleanup-procedure
          (with-recovery-procedures ((:stuck :retries 1 (work) (retry))
                                     (:stuck (protecting unwind-protect (work) (work)) (fail :lost)))
            (protecting unwind-protect
                (progn (work) (fail :stuck))
              (work)
              (ignore-errors (error \"inside\"))))
        (sleep 0.001)
        (protecting unwind-protect (work) (work)))
    (catch 'out (protecting unwind-protect (throw 'out 1) (work)))))

(defun faults ()
  (let ((faults nil))
    (dotimes (i *entries* faults)
      (flet ((times (what) (count (cons what (+ i 1)) *log* :test #'equal)))
        (let ((in (times 'in)) (begun (times 'begin)) (ended (times 'end)))
          (unless (and (= begun ended) (<= in begun 1))
            (push (list (+ i 1) in begun ended) faults)))))))
";

fn call(machine: &mut Vm, name: &str) -> String {
    let function = symbol(machine, name);
    let values = machine.call(function, &[], u64::MAX).expect("it returns");
    machine.describe(values[0])
}

fn symbol(machine: &mut Vm, name: &str) -> Value {
    let name = Datum::symbol(Symbol::new(&"ESL-USER".into(), name), Span::default());
    machine.import(&name).expect("there is room for a symbol")
}

#[test]
fn each_cleanup_runs_once_wherever_its_task_is_aborted() {
    let program = program::compile(&[Source::new("nest", PROGRAM.to_string())]).program.expect("it compiles");
    let config = esl::Config { slice: 1, ..esl::Config::default() };
    let mut machine = program::machine(config, Box::new(VirtualHost::new())).expect("there is room");
    program::run_in(&mut machine, &program).expect("it can start");
    let nest = symbol(&mut machine, "NEST");
    let (mut first, mut runs, mut ends) = (0, 0, false);
    while !ends {
        for second in 0.. {
            let task = machine.spawn(nest, &[]).expect("there is room for a task");
            machine.run_until(Some(task), first);
            ends = !matches!(machine.result(task), TaskResult::Running);
            machine.abort(task);
            machine.run_until(Some(task), second);
            let is_over = !matches!(machine.result(task), TaskResult::Running);
            machine.abort(task);
            machine.run_until(Some(task), u64::MAX);
            let result = machine.result(task);
            machine.forget(task);
            let faults = call(&mut machine, "FAULTS");
            assert_eq!(
                faults, "NIL",
                "aborted after {first} ticks, and again after {second} more: (entry in begun ended)"
            );
            if ends {
                assert!(matches!(result, TaskResult::Failed(_)), "it fails unless it is aborted");
            } else {
                assert!(
                    matches!(result, TaskResult::Aborted | TaskResult::Failed(_)),
                    "{first} {second}: {result:?}"
                );
            }
            runs += 1;
            if is_over {
                break;
            }
        }
        first += 1;
    }
    assert!(runs > 5000, "{runs} runs, of {first} ticks");
}
