//! Behaviour trees: the module `bt` beside py_trees, a library in Python that nobody here has written.
//!
//! The peer needs a package of the Python registry, which the test installs below `target/`. Where that is
//! not possible, the test is left out, and says so.
#![cfg(unix)]

use std::path::PathBuf;
use std::process::Command;

use esl_conformance::folder::Folder;
use esl_conformance::process;

use crate::{eslvm, venv};

const PACKAGE: &str = "py_trees==2.6.0";

/// Trees that are generated, and the seed of their generator.
const TREES: usize = 400;
const SEED: usize = 20;

fn path_of(name: &str) -> PathBuf {
    esl_conformance::root().join("trees/tests").join(name)
}

/// Returns the Python that has the packages; nothing if they cannot be installed.
fn python() -> Option<PathBuf> {
    venv::python("trees", &[PACKAGE], "import py_trees")
}

#[test]
fn leaves_begin_end_and_are_halted_in_the_order_of_py_trees() {
    let Some(python) = python() else { return };
    let folder = Folder::new("trees-py-trees");
    let path = folder.path().to_string_lossy().into_owned();
    let peer = Command::new(python)
        .arg(path_of("peers/py_trees_peer.py"))
        .args([&*path, &TREES.to_string(), &SEED.to_string()])
        .output()
        .expect("the peer can be started");
    assert!(peer.status.success(), "{}", String::from_utf8_lossy(&peer.stderr));
    let expected = String::from_utf8(peer.stdout).expect("the peer writes text");
    let program = std::fs::read_to_string(path_of("programs/orders.esl")).expect("the program can be read");
    let mut command = eslvm(&["run", &format!("--allow-read={path}"), "--clock", "virtual", "-"]);
    let found = process::run(&mut command, format!("{program}(main \"{path}\" {TREES})"));
    let found = found.quiet_output().expect("the program runs");
    let mut number_of_events = 0;
    for (number, (expected, found)) in expected.lines().zip(found.lines()).enumerate() {
        let tree =
            || std::fs::read_to_string(folder.path().join(format!("{number}.xml"))).unwrap_or_default();
        assert_eq!(expected.trim(), found.trim(), "tree {number} of seed {SEED}: {}", tree());
        number_of_events += expected.split(' ').count() - 1;
    }
    assert_eq!(found.lines().count(), TREES);
    assert!(number_of_events > 10 * TREES, "{number_of_events} events");
}

/// A tree with a decorator and a control node that the file declares.
const CUSTOM: &str = r#"<root BTCPP_format="4">
  <BehaviorTree ID="Main">
    <Shuffled first="1">
      <Patient attempts="{most}"><Grasp/></Patient>
      <Look/>
    </Shuffled>
  </BehaviorTree>
  <TreeNodesModel>
    <Decorator ID="Patient"><input_port name="attempts"/></Decorator>
    <Control ID="Shuffled"><input_port name="first"/></Control>
  </TreeNodesModel>
</root>"#;

#[test]
fn decorators_and_control_nodes_of_a_program_are_ticked() {
    let folder = Folder::new("trees-custom");
    folder.file("tree.xml", CUSTOM);
    let program = r#"(require :bt)
(define-cause :slipped ())
(defvar *grasps* 0)
(bt:define-leaf grasp ()
  (sleep 1)
  (when (< (incf *grasps*) 3)
    (fail :slipped)))
(bt:define-leaf look ()
  (unwind-protect (sleep 5)
    (format t "looked until ~d s~%" (round (now)))))
(bt:define-decorator patient (&key attempts)
  (unless (bt:memory)
    (setf (bt:memory) 0))
  (let ((status (bt:tick-child)))
    (cond ((and (eq status :failure) (< (incf (bt:memory)) attempts))
           (bt:reset-child)
           :running)
          (t status))))
;; Ticks the children from the one at FIRST on, each until it has ended, and the others behind the last one.
(bt:define-control shuffled (&key first)
  (let ((at (or (bt:memory) 0)) (count (bt:child-count)))
    (loop while (< at count)
          do (let ((status (bt:tick-child (mod (+ at first) count))))
               (setf (bt:memory) at)
               (unless (eq status :success)
                 (return-from shuffled status))
               (incf at)))
    :success))
(defun run (&rest options)
  (format t "~s~%" (handler-case (list (apply #'bt:run "tree.xml" options) *grasps* (round (now)))
                     (failure (f) (cons (failure-cause f) (failure-arguments f))))))
(defun patient-as (function &optional kind)
  (run :leaves (list (list "Patient" (lambda (&rest ports) (declare (ignore ports)) (funcall function))
                           kind))))
(run :blackboard '(("most" . 3)))
(setq *grasps* 0)
(run :blackboard '(("most" . 2)))
;; A node that is halted halts what it ticks.
(handler-case (with-timeout 2 (run)) (failure () (format t "~d~%" (round (now)))))
(patient-as (lambda () :done))
(patient-as (lambda () (bt:tick-child 1)))
(patient-as (lambda () t) :condition)
(format t "~s~%" (handler-case (bt:tick-child) (failure (f) (first (failure-arguments f)))))
"#;
    folder.file("main.esl", program);
    let mut command = eslvm(&["run", "--allow-read=.", "--clock", "virtual", "main.esl"]);
    let done = process::run(command.current_dir(folder.path()), "");
    let lines: Vec<&str> = done.output.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    let expected = [
        "looked until 5 s",
        "(:SUCCESS 3 8)",
        "looked until 13 s",
        "(:FAILURE 2 15)",
        "looked until 17 s",
        "17",
        "looked until 22 s",
        "(:TREE-ERROR \"the tick of `Patient` returned :DONE: expected :success, :failure, :running or :skipped\")",
        "looked until 27 s",
        "(:TREE-ERROR \"the node has no child 1, but 1 child\")",
        "(:TREE-ERROR \"line 4: `Patient` is a node of the kind :decorator here, but it is defined as :condition\")",
        "\"no node is being ticked: expected a call in the body of BT:DEFINE-DECORATOR or BT:DEFINE-CONTROL\"",
    ];
    assert_eq!(lines, expected, "{}{}", done.output, done.errors);
}
