;;;; Stand-ins for the packages that the tests of foreign code bases use: test frameworks, and flexi-streams as
;;;; far as test data in Latin-1 need it. Loaded by ESL and SBCL alike, before the code bases; see `foreign`.

(defpackage "FOREIGN"
  (:use "COMMON-LISP")
  (:export "*PASSED*" "*FAILED*" "NOTE" "REPORT"))
(in-package "FOREIGN")

(defvar *passed* 0)
(defvar *failed* nil)

(defun note (name passed &optional detail)
  (if passed (incf *passed*) (push (list name detail) *failed*))
  passed)

(defun report (name)
  "Writes a line for the script."
  (format t "~&@@ ~a ~d ~d~%" name *passed* (+ *passed* (length *failed*)))
  (dolist (failed (reverse *failed*))
    (format t "@- ~a ~a~%" name
            (substitute #\Space #\Newline (let ((*print-pretty* nil)) (format nil "~{~s ~@[~a~]~}" failed))))))

;;; RT, under the names that code bases know it by

(defpackage "RTEST"
  (:use "COMMON-LISP")
  #-sbcl (:nicknames "RT")
  #+sbcl (:nicknames "RT" "SB-RT")
  (:export "DEFTEST" "DO-TESTS" "DO-TEST" "REM-ALL-TESTS" "*COMPILE-TESTS*" "*EXPECTED-FAILURES*"))
(in-package "RTEST")

(defvar *compile-tests* nil)
(defvar *expected-failures* nil)
(defvar *tests* nil)

(defmacro deftest (name form &rest values)
  `(progn (push (list ',name ',form ',values) *tests*) ',name))

(defun same (x y)
  "As EQUALP, but characters, and strings, count by case."
  (cond ((and (consp x) (consp y)) (and (same (car x) (car y)) (same (cdr x) (cdr y))))
        ((and (stringp x) (stringp y)) (string= x y))
        ((and (arrayp x) (arrayp y))
         (and (equal (array-dimensions x) (array-dimensions y))
              (dotimes (i (array-total-size x) t)
                (unless (same (row-major-aref x i) (row-major-aref y i)) (return nil)))))
        (t (eql x y))))

(defun rem-all-tests () (setq *tests* nil))

(defun do-tests ()
  (dolist (test (reverse *tests*) (null foreign:*failed*))
    (destructuring-bind (name form expected) test
      (let ((found (handler-case (multiple-value-list (funcall (compile nil `(lambda () ,form))))
                     (error (condition) (list 'failed (princ-to-string condition))))))
        (foreign:note name (same found expected) (prin1-to-string found))))))

;;; FiveAM

(defpackage "FIVEAM"
  (:use "COMMON-LISP")
  (:nicknames "5AM")
  (:export "TEST" "IS" "IS-TRUE" "IS-FALSE" "SIGNALS" "FINISHES" "PASS" "FAIL" "DEF-SUITE" "IN-SUITE"
           "IN-SUITE*" "RUN" "RUN!" "EXPLAIN!" "RESULTS-STATUS"))
(in-package "FIVEAM")

(defvar *tests* nil)
(defvar *current* nil)
(defmacro def-suite (&rest rest) (declare (ignore rest)) nil)
(defmacro in-suite (&rest rest) (declare (ignore rest)) nil)
(defmacro in-suite* (&rest rest) (declare (ignore rest)) nil)
(defmacro test (name &body body)
  (let ((name (if (consp name) (car name) name)))
    `(push (cons ',name (lambda () ,@body)) *tests*)))
(defmacro is (form &rest reason)
  (declare (ignore reason))
  `(foreign:note *current* (handler-case ,form (error () nil)) ',form))
(defmacro is-true (form &rest reason) (declare (ignore reason)) `(is ,form))
(defmacro is-false (form &rest reason) (declare (ignore reason)) `(is (not ,form)))
(defmacro signals (condition &body body)
  `(foreign:note *current*
                 (handler-case (progn ,@body nil)
                   (,(if (consp condition) (car condition) condition) () t)
                   (error () nil))
                 ',body))
(defmacro finishes (&body body) `(foreign:note *current* (handler-case (progn ,@body t) (error () nil)) ',body))
(defun run (&rest rest)
  (declare (ignore rest))
  (dolist (test (reverse *tests*))
    (let ((*current* (car test)))
      (handler-case (funcall (cdr test))
        (error (condition) (foreign:note *current* nil (princ-to-string condition)))))))
(defun run! (&rest rest) (declare (ignore rest)) (run))

;;; flexi-streams: streams and octets in Latin-1 or UTF-8 of ASCII

(defpackage "FLEXI-STREAMS"
  (:use "COMMON-LISP")
  (:nicknames "FLEX")
  (:export "OCTET" "MAKE-FLEXI-STREAM" "STRING-TO-OCTETS" "OCTETS-TO-STRING"))
(in-package "FLEXI-STREAMS")

(deftype octet () '(unsigned-byte 8))
(defun octets-to-string (octets &rest rest)
  (declare (ignore rest))
  (map 'string #'code-char octets))
(defun string-to-octets (string &key (start 0) end external-format)
  (declare (ignore external-format))
  (map '(vector (unsigned-byte 8)) #'char-code (subseq string start end)))
(defun make-flexi-stream (stream &rest rest)
  (declare (ignore rest))
  (let ((octets (make-array (file-length stream) :element-type 'octet)))
    (read-sequence octets stream)
    (make-string-input-stream (octets-to-string octets))))

(in-package "COMMON-LISP-USER")
