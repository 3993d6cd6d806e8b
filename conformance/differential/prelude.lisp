;;;; Loaded before the programs, by ESL and by SBCL: (ANSWER number form) prints the number and the outcome
;;;; of the form.

(defun kind-of-error (condition)
  (typecase condition
    (division-by-zero 'division-by-zero)
    (floating-point-overflow 'floating-point-overflow)
    (arithmetic-error 'arithmetic-error)
    (type-error 'type-error)
    (unbound-variable 'unbound-variable)
    (undefined-function 'undefined-function)
    (control-error 'control-error)
    (end-of-file 'end-of-file)
    (parse-error 'parse-error)
    (program-error 'program-error)
    (t 'error)))

(defun give-answer (number function)
  (let* ((values nil) (failure nil)
         (output (with-output-to-string (*standard-output*)
                   (handler-case (setq values (multiple-value-list (funcall function)))
                     (error (condition) (setq failure (kind-of-error condition)))))))
    (format t "~&;;; ~d~%" number)
    (unless (string= output "")
      (format t "prints ~s~%" output))
    (if failure
        (format t "fails with ~(~a~)~%" failure)
        (format t "~{~s~^ ~}~%" values))))

(defmacro answer (number form)
  `(give-answer ,number (lambda () ,form)))
