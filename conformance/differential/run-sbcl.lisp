;;;; Runs a file of programs under SBCL: sbcl --script run-sbcl.lisp PRELUDE PROGRAMS
;;;;
;;;; ESL has one float type, the double: functions that convert a rational to a single float produce a double.

(defpackage "ESL" (:use "COMMON-LISP")
  (:shadow "FLOAT" "COERCE" "SQRT" "EXP" "LOG" "SIN" "COS" "TAN" "ASIN" "ACOS" "ATAN" "SINH" "COSH" "TANH"
           "ASINH" "ACOSH" "ATANH" "EXPT" "FFLOOR" "FCEILING" "FTRUNCATE" "FROUND"))
(in-package "ESL")
(defun double (x) (if (rationalp x) (cl:coerce x 'double-float) x))
(deftype float (&optional (low '*) (high '*)) `(cl:float ,low ,high))
(defun float (x &optional y) (declare (ignore y)) (double x))
(defun coerce (x type) (cl:coerce x (if (member type '(float single-float)) 'double-float type)))
(defun expt (base power) (if (integerp power) (cl:expt base power) (cl:expt (double base) (double power))))
(macrolet ((of-doubles (&rest names)
             `(progn ,@(loop for name in names
                             collect `(defun ,name (x &rest more)
                                        (apply ',(find-symbol (symbol-name name) "COMMON-LISP")
                                               (double x) (mapcar #'double more)))))))
  (of-doubles sqrt exp log sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh
              ffloor fceiling ftruncate fround))
(setf *print-pretty* nil *read-default-float-format* 'double-float)
;; Since there is one float type, the constants of the other types are those of the double.
(flet ((define-as-of-double (control)
         (dolist (type '("SINGLE" "SHORT" "LONG"))
           (let ((constant (format nil control type)))
             (shadow constant)
             (setf (symbol-value (intern constant))
                   (symbol-value (find-symbol (format nil control "DOUBLE") "COMMON-LISP")))
             (proclaim (list 'special (intern constant)))))))
  (mapc #'define-as-of-double
        '("MOST-POSITIVE-~a-FLOAT" "MOST-NEGATIVE-~a-FLOAT" "LEAST-POSITIVE-~a-FLOAT" "LEAST-NEGATIVE-~a-FLOAT"
          "LEAST-POSITIVE-NORMALIZED-~a-FLOAT" "LEAST-NEGATIVE-NORMALIZED-~a-FLOAT"
          "~a-FLOAT-EPSILON" "~a-FLOAT-NEGATIVE-EPSILON")))
(proclaim '(optimize (safety 3) (debug 1)))
(setf *error-output* (make-broadcast-stream))
(dolist (path (last sb-ext:*posix-argv* 2))
  (with-open-file (in path :external-format :utf-8)
    (loop for form = (read in nil in)
          until (eq form in)
          do (handler-case (handler-bind ((warning #'muffle-warning)) (eval form))
               (error (condition)
                 (format sb-sys:*stderr* "~a~%in ~s~%" condition form))))))
(finish-output)
