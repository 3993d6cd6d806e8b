//! The expansion of each kind of form.

use crate::{expand_lines, snapshot};

fn check(name: &str, lines: &str) {
    snapshot(name, &expand_lines(lines));
}

#[test]
fn variables() {
    check(
        "variables",
        "
        (let ((x 1) (y 2)) (list x y))
        (let ((x 1)) (let ((x 2) (y x)) (list x y)))
        (let* ((x 1) (y x)) (setq x y) (lambda () x))
        (let (a (b)) (list a b))
        (let () 1)
        (let ((*x* 1)) *x*)
        (let ((x 1)) (declare (special x)) x)
        (let ((x 1)) (list x (locally (declare (special x)) x)))
        (let* ((x 1) (y x)) (declare (special x)) y)
        (list :key t nil limit)
        (setq)
        (setq *x* 1 *y* 2)
        (let ((a 1) (b 2)) (psetq a b b a) (list a b))
        (let ((a 1)) (psetq a 1 a 2) a)
        (psetq)
        (multiple-value-bind (a *x*) (f 1) (list a *x*))
        (progv *x* *y* (g))
        (symbol-macrolet ((m (car *x*))) (list m (let ((m 1)) m)))
        (symbol-macrolet ((m (car *x*))) (setq m 9))
        ",
    );
}

#[test]
fn control() {
    check(
        "control",
        "
        (if (g) 1)
        (progn)
        (progn 1 2)
        (and) (or)
        (list (and) (or) (and (g)) (or (g)) (and 1 (g)) (or (f 1) (g)))
        (cond)
        (cond ((f 1) 2 3) ((g)) ((f 2)))
        (cond ((f 1) 2) (t 3))
        (block b (list (return-from b 1) 2))
        (block nil (return))
        (block b (g (lambda () (return-from b 2))))
        (block b (block b (return-from b 1)) (return-from b 2))
        (tagbody a (g) (go b) b (go a))
        (tagbody 1 (tagbody 2 (go 1)) nil nil)
        (catch 'k (throw 'k (values 1 2)))
        (unwind-protect (g) (f 1) (f 2))
        (multiple-value-call #'g (f 1) (values 1 2))
        (multiple-value-list (f 1))
        (multiple-value-prog1 (f 1) (g) (g))
        (multiple-value-setq (*x* *y*) (g))
        (multiple-value-setq () (g))
        (the fixnum (g))
        (list (eval-when (:execute) 1) (eval-when (:compile-toplevel) 2))
        (list (load-time-value (g)))
        (values) (values 1)
        (esl::%handler-case (g) (error (c) (list c)) (warning () 2) ((or a b) (*x*) *x*))
        (esl::%with-handlers (g) (f 1) (f 2))
        (esl::%with-mask (g) 1)
        ",
    );
}

#[test]
fn functions() {
    check(
        "functions",
        "
        (lambda (a &optional b (c a) (d 1 d-p) &rest r &key k (l 2 l-p) ((:out in)) &allow-other-keys) (list a b c d d-p r k l l-p in))
        (lambda (a &aux (b a) c) (list a b c))
        (lambda (*x* &optional (y *x*)) y)
        (lambda (a) \"documentation\" (declare (ignore a)) 1)
        (lambda () \"a value\")
        (esl::%named-lambda foo (x) (return-from foo x))
        (esl::%named-lambda (\"any\" name) (x) x)
        (flet ((h (x) x) ((setf h) (v x) (list v x))) (list (h 1) #'h (funcall #'h 2) #'(setf h) (setf (h 3) 4)))
        (flet ((g (x) (g x 1))) (g 1))
        (labels ((h (x) (if x (h (cdr x)) (return-from h 1)))) (h 1))
        (list #'car #'f #'(setf f) #'(lambda (x) x))
        (funcall #'f 1)
        (funcall 'f 1)
        (flet ((f () 1)) (funcall 'f 1))
        (funcall (g) 1 2)
        (funcall (lambda (x y) (list x y)) 1 2)
        ((lambda (x &optional (y 2)) (list x y)) 1)
        (apply #'g 1 *x*)
        (apply (g) *x*)
        (apply #'(setf f) 1 *x*)
        (flet ((h (&rest r) r)) (apply #'h *x*))
        (funcall)
        (point-y *x*)
        (esl::%slot 'point 2 *x*)
        (esl::%slot (g) 2 *x*)
        (esl::%instance-p 'point *x*)
        (flet ((list (&rest r) r)) `(1 ,*x*))
        ",
    );
}

#[test]
fn definitions() {
    check(
        "definitions",
        "
        (defun area (w &optional (h w)) \"doc\" (declare (type number w)) (* w h))
        (defun (setf foo) (v x) (list v x))
        (let ((n 0)) (defun count-up () (incf n)))
        (defmacro m (a (b &optional (c 3)) &body body) \"doc\" `(list ,a ,b ,c ,@body))
        (defmacro m (&whole w &environment e x &rest r &key (k 1 k-p) l) (list w e x r k k-p l))
        (defmacro m (a b c d . e) (list a b c d e))
        (defmacro m () 1)
        (declaim (special *new*) (optimize speed))
        (in-package \"ESL-USER\")
        ",
    );
}

#[test]
fn destructuring() {
    check(
        "destructuring",
        "
        (destructuring-bind (a (b &optional (c 3)) &rest d) *x* (list a b c d))
        (destructuring-bind (a &key (b 2 b-p) ((:c (d e)) *y*) &allow-other-keys) *x* (list a b b-p d e))
        (destructuring-bind (a . b) *x* (list a b))
        (destructuring-bind (&optional (a 1 a-p) (b a) . c) *x* (list a a-p b c))
        (destructuring-bind (&whole w (a) &aux (b a)) *x* (list w b))
        (destructuring-bind (a b) *x* (declare (ignore a)) b)
        (destructuring-bind () *x* 1)
        ",
    );
}

#[test]
fn backquote() {
    check(
        "backquote",
        "
        `a `() `:k `1 `(a b) `#(a b)
        `,*x*
        `(a ,*x* ,@*y* b c)
        `(,*x* b c)
        `(,@*x*)
        `(,@*x* ,@*y*)
        `(,@*x* . tail)
        `(a . ,*x*)
        `(1 ,@*x* . ,*y*)
        `(a ',*x* #',*y*)
        `((a ,*x*) (b c) d)
        `#(1 ,*x*)
        `#(1 ,*x* ,@*y* 2 3)
        `(1 #(a ,*x*))
        `(a `(b ,(c ,*x*)))
        `(a `(b ,',*x* ,',@*y*))
        `(a `(b ,,@*x*))
        ``(a ,,*x*)
        `(a `(b ,c))
        `(1 . `(2 . ,(3 . ,*x*)))
        ",
    );
}

#[test]
fn setting_places() {
    check(
        "setf",
        "
        (setf)
        (setf *x* 1 (car *x*) 2)
        (setf (car *x*) 5)
        (setf (caddr *x*) 5)
        (setf (third *x*) 5)
        (setf (nth (g) *x*) 5)
        (setf (rest *x*) 5)
        (setf (aref *x* (g)) (g 2))
        (setf (point-y *x*) 5)
        (setf (foo (g) 1) (g 2))
        (setf (gethash (g) *x* (f 1)) 5)
        (setf (short (g)) (f 1))
        (setf (short-macro (g)) (f 1))
        (setf (long (g) 1) (f 1))
        (setf (five (g)) (f 1))
        (setf (first-of *x*) 7)
        (setf (the cons (car *x*)) 1)
        (setf (values (car *x*) *y*) (g))
        (setf (values *x* (values *y* (car *x*))) (g))
        (setf (values) (g))
        (setf (getf (car *x*) :a) (g))
        (setf (getf *x* (g) (f 1)) 2)
        (setf (ldb (g) (car *x*)) 15)
        (setf (mask-field (g) *x*) 15)
        (setf (subseq *x* 1 (g)) \"XYZ\")
        (setf (apply #'aref *x* '(1)) 7)
        (setf (apply #'foo *x* *y*) 7)
        (symbol-macrolet ((m (car *x*))) (setf m 9))
        (let ((x 1)) (setf x 2))
        (flet ((car (x) x)) (setf (car 1) 2))
        ",
    );
}

#[test]
fn modifying_places() {
    check(
        "modify",
        "
        (let ((i 0)) (incf i) (decf i 5) i)
        (let ((i 0) (j 1)) (incf i j))
        (incf *x* (g))
        (incf (aref *x* (g)))
        (incf (car *x*) (f 1))
        (incf (getf *x* :a 10) 2)
        (incf (point-y *x*) *y*)
        (push (g) *x*)
        (push (g) (car *x*))
        (push 1 (car *x*))
        (pop *x*)
        (pop (car *x*))
        (pushnew (g) *x* :test #'eql)
        (pushnew (g) *x* :key (f 1))
        (pushnew (g) (car *x*) :test (f 1))
        (remf *x* :a)
        (remf (car *x*) (g))
        (psetf *x* (g) (car *y*) *x*)
        (psetf (values *x* *y*) (g) (car *y*) 1)
        (rotatef)
        (rotatef *x*)
        (rotatef *x* (car *y*) (cdr *y*))
        (shiftf *x* 9)
        (shiftf (car *x*) *y* (g))
        (shiftf (values *x* *y*) (g))
        (esl::%modify (old (k (g))) (car *x*) (append old k))
        (esl::%modify (old) *x* (cdr old) (car old))
        (symbol-macrolet ((m (car *x*))) (incf m) (push 1 m))
        ",
    );
}

#[test]
fn macros() {
    check(
        "macros",
        "
        (when *x* 1 2)
        (twice (when *x* (g)))
        (macrolet ((local (x) (list 'car x))) (local *x*))
        (macrolet ((local (x) (list 'car x))) (flet ((local (x) x)) (local 1)))
        (flet ((when (x) x)) (when 1))
        (improvable (improvable 1))
        (good-enough (improvable 1))
        (flet ((improvable (x) x)) (improvable 1))
        (funcall #'improvable 1)
        ",
    );
}
