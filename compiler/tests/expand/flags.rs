//! Flags of variables and blocks in the core language.

use esl_compiler::core::Core;

use crate::expand_file;
use crate::host::FakeHost;

fn core(text: &str) -> Core {
    let (mut chunks, findings) = expand_file(&mut FakeHost::new(), text);
    assert!(findings.iter().all(|finding| finding.code == "unused-variable"), "{findings:?}");
    chunks.remove(0).core
}

/// Assigned, captured, read: of the variable called `X`.
fn variable(text: &str) -> [bool; 3] {
    let core = core(text);
    let found = core.variables.iter().find(|variable| variable.name.name() == "X").expect("a variable X");
    [found.is_assigned, found.is_captured, found.is_read]
}

#[test]
fn variables_are_assigned_captured_and_read() {
    assert_eq!(variable("(let ((x 1)) 2)"), [false, false, false]);
    assert_eq!(variable("(let ((x 1)) x)"), [false, false, true]);
    assert_eq!(variable("(let ((x 1)) (setq x 2))"), [true, false, false]);
    assert_eq!(variable("(let ((x 1)) (lambda () x))"), [false, true, true]);
    assert_eq!(variable("(let ((x 1)) (lambda () (setq x 2)))"), [true, true, true]);
    assert_eq!(variable("(lambda (x) (flet ((f () x)) (f)))"), [false, true, true]);
    assert_eq!(variable("(lambda (&optional (y 1) (x y)) (incf x))"), [true, false, true]);
    assert_eq!(variable("(let ((x 1)) (multiple-value-setq (x) (g)))"), [true, false, false]);
}

#[test]
fn local_functions_are_variables_too() {
    assert_eq!(variable("(flet ((x () 1)) 2)"), [false, false, false]);
    assert_eq!(variable("(flet ((x () 1)) (x))"), [false, false, true]);
    assert_eq!(variable("(labels ((x () (x))) 1)"), [false, true, true]);
    assert_eq!(variable("(flet ((x () 1)) (lambda () #'x))"), [false, true, true]);
}

#[test]
fn blocks_are_used_and_captured() {
    let block = |text: &str| {
        let core = core(text);
        (core.blocks[0].is_used, core.blocks[0].is_captured)
    };
    assert_eq!(block("(block b 1)"), (false, false));
    assert_eq!(block("(block b (return-from b 1))"), (true, false));
    assert_eq!(block("(block b (lambda () (return-from b 1)))"), (true, true));
    assert_eq!(block("(defun h () (return-from h 1))"), (true, false));
}

#[test]
fn tagbodies_are_captured() {
    assert!(!core("(tagbody a (go a))").tagbodies[0].is_captured);
    assert!(core("(tagbody a (g (lambda () (go a))))").tagbodies[0].is_captured);
}

#[test]
fn parents_have_lower_numbers_than_their_children() {
    // The printer relies on it: a node that comes too early would be printed as a hole or as nothing.
    for text in
        ["(lambda (a &optional (b a) &aux (c b)) (cond (a) (b c) (t (list c))))", "(flet ((h (x) x)) (h 1))"]
    {
        let text = esl_compiler::expand::print::print(&core(text));
        assert!(!text.contains("%hole"), "{text}");
    }
}
