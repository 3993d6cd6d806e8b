//! Calls that cannot succeed, and calls that may.

use esl::program::{Source, compile_with_core};
use esl_analysis::{AnalysisOptions, analyze};

/// Returns the warnings of the analysis for a program, each with the texts that it points at.
fn found(text: &str) -> Vec<String> {
    let mut compiled =
        compile_with_core(&[Source::new("a.esl", text)], &esl::module_path::ModulePath::none());
    assert!(!compiled.has_errors(), "{text}: {:?}", compiled.diagnostics);
    let cores = std::mem::take(&mut compiled.core);
    let found = analyze(cores, &compiled.sources, &AnalysisOptions::default()).0.findings;
    let place = |span: esl_bytecode::span::Span| &text[span.start as usize..span.end as usize];
    let shown = found.into_iter().filter(|found| found.code == "wrong-type").map(|found| {
        let further: Vec<&str> = found.secondary.iter().map(|label| place(label.span)).collect();
        format!("{} | {} | {}", found.message, place(found.primary.span), further.join(", "))
    });
    shown.collect()
}

fn check(text: &str, expected: &[&str]) {
    assert_eq!(found(text), expected, "{text}");
}

fn check_none(text: &str) {
    assert_eq!(found(text), [""; 0], "{text}");
}

#[test]
fn arguments_of_builtins_are_compared_with_their_table() {
    check("(defun f () (+ 1 (list 2)))", &["`+` needs a number, and gets a list | (list 2) | "]);
    check(
        "(defun f (x) (char-code (1+ x)))",
        &["`char-code` needs a character, and gets a number | (1+ x) | "],
    );
    check(
        "(defun f () (let ((x \"a\")) (print x) (+ 1 x)))",
        &["`+` needs a number, and gets a string | x | x"],
    );
    check(
        "(defun f (x) (length (if x 1 'a)))",
        &["`length` needs a sequence, and gets an integer or a symbol | (if x 1 'a) | "],
    );
    check("(print (gethash 1 (list 1)))", &["`gethash` needs a hash table, and gets a list | (list 1) | "]);
    check("(print (funcall (+ 1 2)))", &["`funcall` needs a function, and gets a number | (+ 1 2) | "]);
    check_none("(defun f (x) (+ 1 x)) (defun g (x) (length (if x \"a\" 1)))");
    check_none("(print (funcall (if (car '(1)) 'list #'vector) 1))");
    check_none("(defun f () (string-trim \" \" 'a)) (defun g () (elt (reverse \"ab\") 0))");
}

#[test]
fn functions_of_the_library_have_needs_and_results() {
    check("(print (remove-if #'evenp 5))", &["`remove-if` needs a sequence, and gets an integer | 5 | "]);
    check(
        "(defun f (x) (+ 1 (prin1-to-string x)))",
        &["`+` needs a number, and gets a string | (prin1-to-string x) | "],
    );
    // Through a function of the program.
    check(
        "(defun evens (numbers) (count-if #'evenp numbers))
         (print (evens 'all)) (print (length (evens '(1 2))))",
        &[
            "`evens` needs a sequence as `numbers`, and gets a symbol | 'all | (count-if #'evenp numbers)",
            "`length` needs a sequence, and gets a number | (evens '(1 2)) | ",
        ],
    );
    check(
        "(print (search \"a\" \"ba\" :start1 \"0\"))",
        &["`search` needs a number, and gets a string | \"0\" | "],
    );
    check_none("(print (remove-if #'evenp \"ab\")) (print (funcall #'make-list 'a))");
    // A function of the same name, one that a test scripts, and values in the place of failed calls.
    check_none("(with-world ((:answer (prin1-to-string *) :with 5)) (print (+ 1 (prin1-to-string 5))))");
    check_none("(print (with-recovery-procedures ((:type-error (x) \"a\")) (length (prin1-to-string 1))))");
}

#[test]
fn calls_of_functions_are_compared_with_what_these_need() {
    check(
        "(defun area (width height) (* width height))
         (defun f () (area 3 \"4\"))",
        &["`area` needs a number as `height`, and gets a string | \"4\" | (* width height)"],
    );
    // Through a function and its result.
    check(
        "(defun name (n) (if (> n 1) \"many\" \"one\"))
         (defun next (n) (+ n 1))
         (print (next (name 3)))",
        &["`next` needs a number as `n`, and gets a string | (name 3) | (+ n 1)"],
    );
    // Optional arguments, keywords, and a function that calls itself.
    check(
        "(defun f (a &optional (b 1) &key (c 2)) (list (+ a b) (length c)))
         (print (f 1 2 :c \"x\")) (print (f 1 'b))",
        &["`f` needs a number as `b`, and gets a symbol | 'b | (+ a b)"],
    );
    check(
        "(defun count-down (n) (if (zerop n) 'done (count-down (- n 1))))
         (print (length (count-down 3)))",
        &["`length` needs a sequence, and gets a symbol | (count-down 3) | "],
    );
    check(
        "(defun f (x) (labels ((twice (n) (* 2 n))) (print x) (twice \"2\")))",
        &["`twice` needs a number as `n`, and gets a string | \"2\" | (* 2 n)"],
    );
    check(
        "(defun f () (let ((next (lambda (n) (+ n 1)))) (funcall next 'a)))",
        &["`next` needs a number as `n`, and gets a symbol | 'a | (+ n 1)"],
    );
    check_none("(defun f (x) (if (stringp x) (length x) (+ x 1))) (print (f 1)) (print (f \"a\"))");
    check_none("(defun f (x) (cond ((null x) 0) (t (+ x 1)))) (print (f nil))");
    // A function that the program changes.
    check_none("(defun f (x) (+ x 1)) (setf (fdefinition 'f) #'length) (print (f \"a\"))");
    check_none("(defun f (x) (+ x 1)) (defun f (x) (length x)) (print (f \"a\"))");
    check_none("(defgeneric g (x)) (defmethod g ((x string)) x) (print (g 1))");
}

#[test]
fn branches_tell_what_a_variable_is() {
    check_none("(defun f () (let ((x (gethash 1 (make-hash-table)))) (when x (+ x 1))))");
    check("(defun f (x) (when (stringp x) (+ x 1)))", &["`+` needs a number, and gets a string | x | x"]);
    check("(defun f (x) (unless x (+ x 1)))", &["`+` needs a number, and gets `nil` | x | x"]);
    check_none("(defun f (x) (if (or (numberp x) (stringp x)) (if (numberp x) (+ x 1) (length x)) 0))");
    check_none("(defun f () (let ((x nil)) (dolist (y '(1 2)) (if x (+ x y) (setq x y)))))");
    check_none("(defun f (x) (typecase x (string (length x)) (number (+ x 1)) (cons (car x))))");
    check_none("(defun f () (let ((x \"a\")) (etypecase x (string (length x)) (number (+ x 1)))))");
    check_none("(defun f (x) (loop (when (numberp x) (return (+ x 1))) (when (listp x) (return (car x)))))");
}

#[test]
fn slots_belong_to_structures() {
    let program = "(defstruct point x y) (defstruct (pixel (:include point)) colour) (defstruct circle r)";
    check(
        &format!("{program} (defun f () (point-x (make-circle :r 1)))"),
        &[
            "a slot of point belongs to an instance of `pixel` or `point`, and not to an instance of `circle` \
         | (make-circle :r 1) | ",
        ],
    );
    check(
        &format!("{program} (defun f (p) (+ 1 (point-x p)) (length p))"),
        &["`length` needs a sequence, and gets an instance of `pixel` or `point` | p | p"],
    );
    check_none(&format!("{program} (defun f () (point-x (make-pixel :colour 1)))"));
    check_none(&format!("{program} (defun f (p) (if (point-p p) (point-x p) (circle-r p)))"));
}

#[test]
fn slots_have_their_declared_types() {
    let program = "(defstruct axle (width 1 :type number))
                   (defstruct wheel (radius 1 :type number) (name \"\" :type (or null string) :read-only t)
                              (axle nil :type (or null axle)) any)";
    let check_with = |text: &str, expected: &[&str]| check(&format!("{program} {text}"), expected);
    let check_none_with = |text: &str| check_none(&format!("{program} {text}"));
    // Read.
    check_with(
        "(defun f (w) (length (wheel-radius w)))",
        &["`length` needs a sequence, and gets a number | (wheel-radius w) | "],
    );
    check_with(
        "(defun f (w) (+ 1 (wheel-name w)))",
        &["`+` needs a number, and gets a string or `nil` | (wheel-name w) | "],
    );
    check_with(
        "(defun f (w) (+ 1 (wheel-axle w)))",
        &["`+` needs a number, and gets `nil` or an instance of `axle` | (wheel-axle w) | "],
    );
    check_with(
        "(defun f (w) (let ((axle (wheel-axle w))) (when axle (length axle))))",
        &["`length` needs a sequence, and gets an instance of `axle` | axle | axle"],
    );
    check_none_with("(defun f (w) (length (wheel-name w)) (+ 1 (wheel-any w)) (length (wheel-any w)))");
    // Given to constructors and assigned.
    check_with(
        "(defun f () (make-wheel :radius \"a\"))",
        &["`make-wheel` needs a number as `radius`, and gets a string | \"a\" | "],
    );
    check_with(
        "(defun f (w) (setf (wheel-radius w) (list 1)))",
        &["this slot takes a number, and gets a list | (wheel-radius w) | "],
    );
    check_none_with(
        "(defun f (w x) (setf (wheel-radius w) x) (setf (wheel-any w) 'a) (make-wheel :radius x))",
    );
    check_none("(defstruct none (slot nil :type nil)) (print 1)");
    // Old instances, structures that are defined twice, and values in the place of those that are refused.
    check_none_with("(load \"wheels.esl\") (defun f (w) (length (wheel-radius w)))");
    check_none_with("(define-upgrade (wheel) (old) (make-wheel :radius (length (wheel-radius old))))");
    check_none(
        "(defstruct a (b 1 :type number)) (defstruct a (b \"\" :type string))
                (defun f (a) (length (a-b a)))",
    );
    check_none_with(
        "(defun f () (with-recovery-procedures ((:type-error 1)) (make-wheel :radius (read))))
                     (defun g (w) (length (wheel-radius w)))",
    );
}

#[test]
fn failures_that_a_form_takes_are_meant() {
    check_none("(defun f () (handler-case (+ 1 (list 2)) (type-error () 0)))");
    check_none("(defun f () (ignore-errors (+ 1 (list 2))))");
    check_none("(defun f () (with-recovery-procedures ((:type-error (abort 0))) (+ 1 (list 2))))");
    check_none("(deftest f (fails :type-error (+ 1 (list 2))) (signals type-error (+ 1 (list 2))))");
    // The value of a clause stands for that of the sum.
    check_none(
        "(defun f (x) (with-recovery-procedures ((:type-error \"none\")) (let ((y (+ 1 x))) (length y))))
         (print (f 'a))",
    );
    check(
        "(defun f () (with-timeout 3 (+ 1 (list 2))))",
        &["`+` needs a number, and gets a list | (list 2) | "],
    );
}

#[test]
fn declared_types_are_compared_with_inferred_ones() {
    check(
        "(declaim (ftype (function (string) integer) twice)) (defun twice (n) (* 2 n))",
        &["`twice` is declared to take a string as argument 1, and needs a number \
           | (ftype (function (string) integer) twice) | (* 2 n)"],
    );
    check(
        "(declaim (ftype (function (t) (or list string)) size)) (defun size (x) (length x))",
        &["`size` is declared to return a string or a list, and returns an integer \
           | (ftype (function (t) (or list string)) size) | (defun size (x) (length x))"],
    );
    check_none("(declaim (ftype (function (number) (values number &optional)) f)) (defun f (n) (* 2 n))");
    check_none("(declaim (ftype (function () nil) f)) (defun f () (error \"it never returns\"))");
    check_none(
        "(declaim (ftype (function (&rest t) t) f) (ftype function g)) (defun f (n) n) (defun g () 1)",
    );
}

#[test]
fn code_that_is_made_at_run_time_may_define_anything_anew() {
    let program = "(defun name () \"a\") (defun f () (+ 1 (name)))";
    let warning = "`+` needs a number, and gets a string | (name) | ";
    for unknown in [
        "(eval (read))",
        "(eval (list 'defun 'name () 1))",
        "(eval '(defun name () 1))",
        "(eval '(eval (read)))",
        "(mapcar #'eval (read))",
        "(funcall (compile nil (list 'lambda () (read))))",
        "(compile 'name '(lambda () 1))",
    ] {
        check_none(&format!("{program} {unknown}"));
    }
    for known in ["(eval '(+ 1 2))", "(eval '(defun other () 1))", "(compile nil '(lambda () 1))"] {
        check(&format!("{program} {known}"), &[warning]);
    }
}
