//! Which forms become chunks of their own, and what happens to them.

use esl_compiler::expand::{Expander, print::print};

use crate::host::FakeHost;
use crate::{expand_file, finish_form, read_all};

/// The chunks of a file: `e` if emitted, `l` if loaded, `k` if kept, and the text.
fn chunks(text: &str) -> Vec<String> {
    let (chunks, findings) = expand_file(&mut FakeHost::new(), text);
    assert!(findings.is_empty(), "{findings:?}");
    chunks.iter().map(show).collect()
}

fn show(chunk: &esl_compiler::expand::Chunk) -> String {
    let marks = [(chunk.purpose.emit, 'e'), (chunk.purpose.load, 'l'), (chunk.purpose.keep, 'k')];
    let marks: String = marks.iter().filter(|(is_set, _)| *is_set).map(|(_, mark)| mark).collect();
    format!("{marks} {}", print(&chunk.core))
}

/// The chunks of a form given to `eval`.
fn evaluated(text: &str) -> Vec<String> {
    let mut host = FakeHost::new();
    let mut expander = Expander::new();
    let mut chunks = Vec::new();
    for form in read_all(&mut host, text) {
        expander.begin_evaluation(form);
        finish_form(&mut expander, &mut host, &mut chunks);
    }
    chunks.iter().map(show).collect()
}

#[test]
fn forms_in_progn_are_top_level_forms() {
    assert_eq!(chunks("(progn (g 1) (progn) (progn (g 2) 3 nil) (g 4))"), ["e (g 1)", "e (g 2)", "e (g 4)"]);
    assert_eq!(chunks("(locally (declare (special z)) (g z))"), ["e (g z)"]);
    assert_eq!(chunks("(symbol-macrolet ((z (g 1))) (g z) (f z))"), ["e (g (g 1))", "e (f (g 1))"]);
    assert_eq!(chunks("(twice (g))"), ["e (g)", "e (g)"]);
}

#[test]
fn definitions_are_loaded_at_compile_time_too() {
    let h = "(%set-function 'h (%named-lambda h () (block h 1)))";
    assert_eq!(chunks("(defun h () 1)"), [format!("el {h}")]);
    assert_eq!(chunks("(let () (defun h () 1))"), [format!("e {h}")]);
    assert_eq!(chunks("(progn (defun h () 1) (h))"), [format!("el {h}"), "e (h)".into()]);
    assert_eq!(chunks("(declaim (special v))"), ["el (%proclaim-special 'v)"]);
}

#[test]
fn eval_when_is_as_in_the_standard() {
    let cases: [(&str, &[&str]); 8] = [
        ("(:compile-toplevel :load-toplevel :execute)", &["el (g)"]),
        ("(:compile-toplevel :load-toplevel)", &["el (g)"]),
        ("(:load-toplevel :execute)", &["e (g)"]),
        ("(:load-toplevel)", &["e (g)"]),
        ("(:compile-toplevel :execute)", &["l (g)"]),
        ("(:compile-toplevel)", &["l (g)"]),
        ("(:execute)", &[]),
        ("()", &[]),
    ];
    for (situations, expected) in cases {
        assert_eq!(chunks(&format!("(eval-when {situations} (g))")), expected, "{situations}");
    }
    let around = |inner: &str| {
        chunks(&format!("(eval-when (:compile-toplevel :load-toplevel :execute) (eval-when {inner} (g)))"))
    };
    assert_eq!(around("(:load-toplevel :execute)"), ["el (g)"]);
    assert_eq!(around("(:load-toplevel)"), ["e (g)"]);
    assert_eq!(around("(:execute)"), ["l (g)"]);
}

#[test]
fn an_evaluated_form_is_evaluated_part_by_part() {
    assert_eq!(evaluated("(progn (g 1) (g 2))"), ["l (g 1)", "e (g 2)"]);
    assert_eq!(evaluated("(progn (g 1) (progn))"), ["l (g 1)", "e ()"]);
    assert_eq!(evaluated("(progn (g 1) 5)"), ["l (g 1)", "e 5"]);
    assert_eq!(evaluated("5"), ["e 5"]);
    assert_eq!(evaluated("(eval-when (:compile-toplevel) (g))"), ["e ()"]);
    assert_eq!(evaluated("(progn (eval-when (:execute) (g 1)) (g 2))"), ["l (g 1)", "e (g 2)"]);
    assert_eq!(evaluated("(twice (g))"), ["l (g)", "e (g)"]);
}

#[test]
fn local_macros_are_chunks_that_are_kept() {
    let mut host = FakeHost::new();
    let expander = host.template("(car #1)");
    host.local_macros.push(expander);
    let (chunks, findings) = expand_file(&mut host, "(macrolet ((m (x) (list 'car x))) (m *x*) (g (m *y*)))");
    assert!(findings.is_empty(), "{findings:?}");
    let shown: Vec<String> = chunks.iter().map(show).collect();
    assert!(shown[0].starts_with("lk (%named-lambda (macrolet m) (#:form #:environment)"), "{}", shown[0]);
    assert_eq!(shown[1..], ["e (car *x*)", "e (g (car *y*))"]);
}

#[test]
fn a_value_of_load_time_is_a_chunk_before_its_user() {
    let shown = chunks("(g (load-time-value (f 1)))");
    assert_eq!(shown, ["e (setq #:load-time-value (f 1))", "e (g #:load-time-value)"]);
    let shown = evaluated("(g (load-time-value (f 1)))");
    assert_eq!(shown, ["e (setq #:load-time-value (f 1))", "e (g #:load-time-value)"]);
}

#[test]
fn literals_have_no_effect_and_make_no_code() {
    assert_eq!(chunks("1 nil \"text\" :key (progn 1 2)"), [""; 0]);
}
