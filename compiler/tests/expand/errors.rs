//! Diagnostics of wrong and doubtful forms.

use esl_compiler::diagnostic::code::{ALL, DiagnosticCode, Stage};

use crate::host::FakeHost;
use crate::{codes, findings, snapshot};

fn check(name: &str, text: &str) {
    let text = text.trim();
    let found = findings(&mut FakeHost::new(), text);
    snapshot(&format!("errors-{name}"), &format!("{text}\n=====\n{found}"));
}

#[test]
fn malformed_special_forms() {
    check(
        "malformed",
        "
(let)
(let 5)
(let (x 1) x)
(let ((x 1 2)) x)
(let ((1 2)) 3)
(if)
(if 1 2 3 4)
(quote 1 2)
(setq *x*)
(setq 5 6)
(setf *x*)
(block (b) 1)
(throw 'a)
(tagbody \"text\")
(tagbody a a)
(go 1.5)
(function)
(function 5)
(lambda)
(flet (f) 1)
(flet ((f)) 1)
(flet ((5 ())) 1)
(multiple-value-bind x)
(eval-when (:never) 1)
(cond 5)
(cond ())
(defun)
(defun f)
(defun \"f\" ())
(defmacro (setf f) (x) x)
(1 2)
(\"f\" 1)
((f 1) 2)
(f 1 . 2)
(declare (special x))
(esl::%handler-case)
(esl::%handler-case (g) (error c))
(esl::%modify old *x* 1)
(in-package)
(in-package \"NOWHERE\")
",
    );
}

#[test]
fn wrong_lambda_lists() {
    check(
        "lambda-lists",
        "
(lambda 5 1)
(lambda (5) 1)
(lambda (a . b) 1)
(lambda (a a) 1)
(lambda (a &rest) 1)
(lambda (&rest a b) a b)
(lambda (&key a &optional b) a b)
(lambda (&optional (a 1 2)) a)
(lambda (&key ((a))) a)
(lambda (&body a) a)
(lambda (&optinal a) a)
(lambda (&aux (a 1 b)) a)
(lambda (pi-is-fine limit) pi-is-fine)
(lambda (nil) 1)
(lambda (:k) 1)
(defmacro m (&rest a . b) a b)
(destructuring-bind (a a) *x* a)
(flet ((f () 1) (f () 2)) (f))
(let ((a 1) (a 2)) a)
",
    );
}

#[test]
fn wrong_places() {
    check(
        "places",
        "
(setf 5 1)
(setf \"x\" 1)
(setf nil 1)
(setf t 1)
(setf limit 1)
(setf (if 1 2 3) 1)
(setf (point-x *x*) 1)
(setf (nowhere 1) 2)
(setf (apply (g) *x*) 1)
(setf (getf *x*) 1)
(incf 5)
(push 1)
(shiftf *x*)
(setq limit 1)
(let ((limit 1)) limit)
(let ((t 1)) 1)
",
    );
}

#[test]
fn unknown_exits() {
    check(
        "exits",
        "
(return 1)
(defun first-even (numbers)
  (return-from first-evn numbers))
(tagbody (go end))
(tagbody (go edn) start end)
(block b (macrolet ((m () (return-from b 1))) 2))
",
    );
}

#[test]
fn undefined_names() {
    check(
        "undefined",
        "
(funktion 1)
(print (undefined-one 1))
(print (undefined-one 2))
(print undefined-variable)
(setq undefined-variable 1)
#'undefined-two
#'(setf undefined-two)
(open-file 1)
(poit-y 1)
(pont-y 1)
(later 1)
(defun later (x) x)
",
    );
}

#[test]
fn wrong_numbers_of_arguments() {
    check(
        "argument-counts",
        "
(car)
(car 1 2)
(f 1 2)
(defun later (x &optional y) (list x y))
(later)
(later 1 2 3)
(funcall #'car 1 2)
(flet ((h (x) x)) (h) (funcall #'h 1 2))
((lambda (x) x))
(funcall (lambda (&rest r) r))
(apply #'car *x*)
(- )
",
    );
}

#[test]
fn unused_variables() {
    check(
        "unused",
        "
(let ((x 1)) 2)
(let ((x 1)) (setq x 2))
(defun h (a b &optional (c 1 c-p) &key k) a)
(let ((x 1)) (declare (ignore x)) 2)
(let ((x 1)) (declare (ignorable x)) 2)
(let ((*x* 1)) 2)
(destructuring-bind (a b) *x* a)
(defmacro m (a b) a)
(multiple-value-bind (a b) (g) b)
(when *x* (let ((y 1)) 2))
(dolist (x *x*) 1)
",
    );
}

#[test]
fn unreachable_code() {
    check(
        "unreachable",
        "
(defun h (x)
  (return-from h x)
  (print x))
(tagbody
  (go end)
  (print 1)
 end
  (print 2))
(cond (t 1) ((g) 2))
(cond ((g) 1) (t 2))
",
    );
}

#[test]
fn declarations() {
    check(
        "declarations",
        "
(let ((x 1)) (declare (ignorabel x)) x)
(let ((x 1)) (declare (type fixnum x) (fixnum x) (optimize speed) ((integer 0 9) x)) x)
(let ((x 1)) (declare . 5) x)
(let ((x 1)) (declare (special 5)) x)
(let ((x 1)) (print x) (declare (special x)))
",
    );
}

#[test]
fn macros_that_fail() {
    check(
        "macros",
        "
(failing 1)
(print (failing 2))
(wrong)
(when *x*
  (wrong))
(twice (let 5))
#'when
(funcall #'when 1)
(print (esl::%unquote *x*))
(esl::%backquote (esl::%unquote-splicing *x*))
",
    );
}

#[test]
fn calls_of_what_failed_to_be_defined_are_not_blamed() {
    assert_eq!(codes("(defun broken (5) 1) (broken 1 2 3)"), ["malformed-lambda-list"]);
    assert_eq!(codes("(defmacro broken (5) 1) (broken (let 5))"), ["malformed-lambda-list"]);
    assert_eq!(codes("(defmacro broken (x) (let 5) x) (broken (let 5))"), ["malformed-binding"]);
    assert_eq!(codes("(macrolet ((broken (5) 1)) (broken (let 5)))"), ["malformed-lambda-list"]);
}

#[test]
fn the_programs_in_the_table_of_codes_have_them() {
    // These need a library, or a machine that runs what is loaded: `conformance/tests/language/codes.rs` has
    // all.
    let needs_library = [
        "assignment-to-constant",
        "macro-failed",
        "compile-time-failure",
        "read-time-failure",
        "literal-object",
        "clause-falls-off",
        "unreachable-clause",
        "nothing-to-wait-for",
        "undeclared-cause",
        "unknown-type",
        "expansion-too-large",
        "outside-clause",
        "unknown-module",
        "circular-module",
        "name-not-in-subset",
        "read-only-slot",
        "amount-above-capacity",
        "missing-body",
        "concurrent-operation",
        "not-an-operation",
        "duplicate-definition",
    ];
    let stage = |code: &&&DiagnosticCode| code.stage == Stage::Expander;
    for code in ALL.iter().filter(stage).filter(|code| !needs_library.contains(&code.name)) {
        let found = |program: &str| {
            let (_, findings) = crate::expand_file(&mut FakeHost::locked(), program);
            findings.iter().any(|finding| finding.code == code.name)
        };
        assert!(found(code.failing), "{}", code.name);
        assert!(!found(code.repaired), "{}", code.name);
    }
}

#[test]
fn what_stands_in_a_call_of_something_left_out_is_not_looked_at() {
    let mut host = FakeHost::new();
    let open_file = host.symbol("open-file");
    host.globals.entry(open_file).or_default().locked = true;
    let (_, found) = crate::expand_file(&mut host, "(open-file ((stream 5) . x) (read-line stream))");
    let codes: Vec<&str> = found.iter().map(|finding| finding.code).collect();
    assert_eq!(codes, ["name-not-in-subset"]);
}

#[test]
fn macros_can_have_the_compiler_warn() {
    let mut host = FakeHost::new();
    host.define_macro("doubtful", "(esl::%compiler-warning \"unreachable-code\" \"so it is\" #1 #1)");
    let found = findings(&mut host, "(print (doubtful (f 1)))");
    let expected = "warning[unreachable-code]: so it is\n --> test.esl:1:18\n";
    assert!(found.starts_with(expected), "{found}");
    assert_eq!(codes("(esl::%compiler-warning \"no-such-code\" \"text\" nil)"), ["malformed-form"]);
}

#[test]
fn names_of_the_language_cannot_be_defined() {
    for form in [
        "(defun car (x) x)",
        "(defmacro car (x) x)",
        "(flet ((car (x) x)) (car 1))",
        "(macrolet ((car (x) x)) 1)",
        "(defun (setf car) (v x) (list v x))",
        "(esl::%proclaim-special 'car)",
    ] {
        let found = crate::findings(&mut FakeHost::locked(), form);
        assert!(found.starts_with("error[locked-name]"), "{form}: {found}");
    }
    assert_eq!(codes("(let ((car 1)) car)"), [""; 0]);
    // Macros of the language may, around what they are given.
    let mut host = FakeHost::locked();
    host.define_macro("with-car", "(flet ((car (x) x)) #1)");
    let with_car = host.symbol("with-car");
    host.globals.entry(with_car).or_default().locked = true;
    assert_eq!(findings(&mut host, "(with-car (car 1))"), "");
    let with_own = host.symbol("with-own");
    host.define_macro("with-own", "(flet ((car (x) x)) #1)");
    assert!(!host.globals[&with_own].locked);
    assert!(findings(&mut host, "(with-own (car 1))").starts_with("error[locked-name]"));
}
