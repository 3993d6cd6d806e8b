;;; failure_handled: a condition whose handler leaves the form at once with a result.

(define-condition broken (serious-condition) ((x :initarg :x :reader broken-x)))

(defun operate (x)
  (error 'broken :x x))

(let ((sum 0))
  (dotimes (i 1000000)
    (setq sum (mod (+ sum (handler-case (operate i)
                            (broken (condition) (+ (broken-x condition) 1))))
                   1000003)))
  (format t "~d~%" sum))
