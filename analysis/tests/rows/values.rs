//! Functions that come out of calls of the library, of data, and of clauses.

use crate::check;

#[test]
fn the_value_of_a_clause_stands_for_that_of_the_failed_call() {
    let text = |cause: &str, call: &str| {
        format!(
            "(define-cause :x ()) (define-cause :y ())
             (defun give (x) {call})
             (defun f () (with-recovery-procedures (({cause} :retries :infinite (lambda () (fail :y))))
               (funcall (give 'a))))"
        )
    };
    check(&text(":x", "(fail :x x)"), ":y");
    check(&text(":type-error", "(car x)"), ":y");
    check(&text(":x", "(car x)"), "");
}

#[test]
fn changes_of_objects_are_told_apart() {
    // The value in a table is not the table.
    let text = |into: &str| {
        format!(
            "(defvar *all* (make-hash-table)) (defvar *one* (list 1))
             (defun keep (key value) (setf (gethash key *all*) value))
             (keep 1 *one*) (keep 2 (lambda () (fail :x)))
             (defun f () (funcall {into}))"
        )
    };
    check(&text("(gethash 2 *all*)"), ":x");
    check(&text("(first *one*)"), "");
    check(
        "(defvar *a* (list 1)) (nconc *a* (list (lambda () (fail :x)))) (defun f () (mapc #'funcall *a*))",
        ":x",
    );
    check(
        "(defvar *a* (list 1)) (setf (cdr *a*) (list (lambda () (fail :x)))) (defun f () (mapc #'funcall *a*))",
        ":x",
    );
    check(
        "(defvar *a* (vector 1)) (replace *a* (list (lambda () (fail :x)))) (defun f () (funcall (aref *a* 0)))",
        ":x",
    );
}

#[test]
fn functions_are_found_in_what_calls_of_the_library_return() {
    let f = |form: &str| format!("(defun give () (fail :x)) (defvar *l* (list #'give)) (defun f () {form})");
    for form in [
        "(funcall (first (mapcar (lambda (one) one) *l*)))",
        "(mapc #'funcall (mapcar #'identity *l*))",
        "(funcall (some (lambda (one) one) *l*))",
        "(funcall (first (mapc #'print *l*)))",
        "(funcall (first (member #'give *l*)))",
        "(funcall (cdr (assoc 'a (list (cons 'a #'give)))))",
        "(funcall (cdr (assoc 'a (acons 'a #'give nil))))",
        "(funcall (aref (make-array 1 :initial-contents *l*) 0))",
        "(funcall (aref (make-array '(1 1) :initial-contents (list *l*)) 0 0))",
        "(funcall (first (make-list 1 :initial-element #'give)))",
        "(maphash (lambda (key one) (funcall one)) (let ((all (make-hash-table))) (setf (gethash 1 all) #'give) all))",
    ] {
        check(&f(form), ":x");
    }
    for form in [
        "(funcall (mapcar (lambda (one) 1) *l*))",
        "(funcall (first (mapcar (lambda (one) #'list) *l*)))",
        "(funcall (position #'give *l*))",
        "(funcall (every (lambda (one) nil) *l*))",
        "(funcall (length *l*))",
    ] {
        check(&f(form), "");
    }
}
