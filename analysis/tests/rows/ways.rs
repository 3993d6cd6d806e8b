//! Ways of functions and causes to a call: through events, conditions, restarts, tables, slots, functions
//! that share their arguments, methods of protocols.

use super::table;

/// Checks that the main task, or a task that it begins, may end by `:boo`, or by a cause that is not known.
#[track_caller]
fn ends(text: &str) {
    let program = format!("(define-cause :boo ()) (define-cause :bar ()) {text}");
    let table = table(&program);
    let mut causes = table.tasks.iter().flat_map(|task| &task.causes);
    let mut rows = Vec::new();
    let is_there = causes.any(|row| {
        rows.push(row.cause.clone());
        row.cause == ":boo" || row.cause.starts_with("any")
    });
    assert!(is_there, "{text}: {rows:?}");
}

#[test]
fn fluents_events_and_rules_call_functions() {
    ends("(define-fluent (y) (fail :boo)) (y)");
    ends(
        "(defvar *e* (make-event)) (defun near-p (d) (when (> d 10) (fail :boo)) t)
         (spawn (sleep 1) (signal *e* 20)) (wait-for-event *e* #'near-p)",
    );
    ends(
        "(define-rule (bad ?x) (level ?x ?n) (test (check-level #?n)))
         (defun check-level (n) (when (> n 5) (fail :boo)))
         (assert '(level a 9)) (print (db-query '(bad ?x)))",
    );
    ends("(print (db-query (list 'and '(a ?x) '(test (fail :boo)))))");
    ends("(defun q () `(and (a ?x) (test (fail ,:boo)))) (assert '(a 1)) (db-query (q))");
    ends(
        "(defun fly (x) x) (defun go-fly () (mapcar #'fly '(5)))
         (with-world ((:answer (fly 5) :failing (:boo left))) (go-fly))",
    );
}

#[test]
fn values_of_clauses_stand_for_those_of_calls() {
    ends(
        "(defun g () (fail :boo)) (defun need () (fail :bar))
         (with-recovery-procedures ((:bar (values #'g))) (funcall (need)))",
    );
    ends(
        "(with-recovery-procedures (((:bar f) (values f)))
           (funcall (fail :bar (lambda () (fail :boo)))))",
    );
}

#[test]
fn failures_signals_and_reports_have_arguments() {
    ends(
        "(handler-case (fail :bar (lambda () (fail :boo)))
           (failure (c) (funcall (first (failure-arguments c)))))",
    );
    ends(
        "(define-condition oops (error) ((work :initarg :work :reader oops-work)))
         (handler-case (error 'oops :work (lambda () (fail :boo))) (oops (c) (funcall (oops-work c))))",
    );
    ends(
        "(define-condition oops (error) ((x :initform (fail :boo))))
         (handler-case (error 'oops) (oops () 1))",
    );
    ends(
        "(define-input *jobs* :capacity 4) (defun job () (fail :boo))
         (spawn (:daemon t) (loop (funcall (wait-for-event *jobs*)))) (signal *jobs* #'job) (sleep 1)",
    );
}

#[test]
fn both_names_of_signals_pass_arguments() {
    for name in ["signal", "signal-event"] {
        ends(&format!(
            "(defvar *e* (make-event)) (spawn (sleep 1) ({name} *e* (lambda () (fail :boo))))
             (funcall (wait-for-event *e*))"
        ));
    }
}

#[test]
fn restarts_call_their_functions() {
    ends("(restart-bind ((r (lambda () (fail :boo)))) (invoke-restart 'r))");
    ends("(restart-bind ((r (lambda (f) (funcall f)))) (invoke-restart 'r (lambda () (fail :boo))))");
    ends(
        "(restart-case (invoke-restart-interactively 'r)
           (r (x) :interactive (lambda () (fail :boo)) x))",
    );
    ends("(restart-case (find-restart 'r) (r (x) :test (lambda (c) (fail :boo)) x))");
}

#[test]
fn data_has_functions_and_causes() {
    ends("(defstruct s (c :bar)) (defvar *s* (make-s)) (with-slots (c) *s* (setf c :boo)) (fail (s-c *s*))");
    ends("(defstruct s c) (funcall (slot-value (make-s :c (lambda () (fail :boo))) 'c))");
    ends("(defvar *h* nil) (progv '(*h*) (list (lambda () (fail :boo))) (funcall *h*))");
    for list in [
        "(let ((l (list 1))) (nconc l (list f)) (second l))",
        "(let ((l (list 1 2))) (push f (cdr l)) (second l))",
        "(let ((l (list 1 2))) (replace l (list f)) (first l))",
        "(let ((l (list 1 2))) (setf (subseq l 0 1) (list f)) (first l))",
        "(let ((l (list 1))) (map-into l (lambda () f)) (first l))",
        "(first (concatenate 'list (list f) '(1)))",
        "(first (subst f 'a '(a b)))",
        "(first (substitute f 'a '(a b)))",
        "(first (sublis (list (cons 'a f)) '(a b)))",
        "(first (adjoin f '(a b)))",
    ] {
        ends(&format!("(let ((f (lambda () (fail :boo)))) (funcall {list}))"));
    }
    ends(
        "(defun same (a b) (fail :boo)) (defun code (a) 1)
         (let ((h (make-hash-table :test 'same :hash-function 'code))) (setf (gethash 1 h) 2) (gethash 3 h))",
    );
    ends("(defun odd-one (x) (fail :boo)) (print (typep 3 '(satisfies odd-one)))");
    ends("(defun bang (x) (fail :boo)) (deftype odd-one () '(satisfies bang)) (print (typep 3 'odd-one))");
    ends("(setf (symbol-plist 'x) (list 'h (lambda () (fail :boo)))) (funcall (get 'x 'h))");
    ends(
        "(defvar *x* nil) (defun go-on () (funcall *x*))
         (let ((s (list '*x*))) (progv s (list (lambda () (fail :boo))) (go-on)))",
    );
    ends(
        "(assert '(handler a job)) (defun job () (fail :boo))
         (with-query-bindings '(handler a ?f) (funcall #?f))",
    );
    ends("(apply #'apply (lambda (a) (fail :boo)) (list (list 1)))");
}

#[test]
fn functions_may_be_made_or_found_by_name() {
    ends("(funcall (compile nil '(lambda () (fail :boo))))");
    ends("(funcall (coerce '(lambda () (fail :boo)) 'function))");
    ends("(defun bang () (fail :boo)) (funcall (intern \"BANG\"))");
    ends("(defun bang () (fail :boo)) (funcall (read-from-string \"bang\"))");
    ends("(defun w (e &rest opts) (apply #'wait-for-event e opts)) (w (make-event) :timeout 1) (fail :boo)");
}

#[test]
fn options_may_be_in_a_list() {
    let table = table("(defun w (e &rest opts) (apply #'wait-for-event e opts)) (w (make-event) :timeout 1)");
    assert_eq!(super::shown(&table.tasks[0].causes), ":timeout");
}

#[test]
fn classes_call_methods_of_the_program() {
    let class = "(defclass robot () ((arm :initarg :arm :reader arm)))";
    ends(&format!(
        "{class} (defmethod slot-unbound (class (r robot) (s (eql 'arm))) (fail :boo))
         (arm (make-instance 'robot))"
    ));
    ends(&format!(
        "{class} (defgeneric move (r)) (defmethod no-applicable-method ((g (eql #'move)) &rest r) (fail :boo))
         (move (make-instance 'robot))"
    ));
    ends(&format!(
        "{class} (defgeneric move (r)) (defmethod move ((r robot)) (call-next-method))
         (defmethod no-next-method ((g (eql #'move)) m &rest r) (fail :boo)) (move (make-instance 'robot))"
    ));
    ends(&format!(
        "{class} (funcall (arm (apply #'make-instance 'robot (list :arm (lambda () (fail :boo))))))"
    ));
}
