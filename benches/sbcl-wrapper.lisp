;;; Compiles a benchmark program with SBCL, under the settings by which ESL measures itself: one float type, the double.
;;;
;;;     sbcl --script sbcl-wrapper.lisp PROGRAM.esl PROGRAM.fasl
;;;
;;; The result runs with `sbcl --script PROGRAM.fasl`: natively compiled code, no compile time.

(setf *read-default-float-format* 'double-float)

(destructuring-bind (source output) (rest sb-ext:*posix-argv*)
  ;; Notes and style warnings go to standard error; a program that does not compile cleanly must not be timed.
  (multiple-value-bind (fasl warnings-p failure-p)
      (let ((*standard-output* *error-output*)
            (*compile-verbose* nil)
            (*compile-print* nil))
        (compile-file (merge-pathnames source) :output-file (merge-pathnames output)))
    (declare (ignore warnings-p))
    (when (or failure-p (null fasl))
      (sb-ext:exit :code 1))))
