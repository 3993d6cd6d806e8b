;;; failure_retried: a condition whose handler repairs the cause and evaluates the form again.

(defvar *broken* nil)

(define-condition broken (serious-condition) ((x :initarg :x)))

(defun operate (x)
  (if *broken* (error 'broken :x x) x))

(let ((sum 0))
  (dotimes (i 1000000)
    (setq *broken* t)
    (setq sum (mod (+ sum (loop
                            (handler-case (return (operate i))
                              (broken () (setq *broken* nil)))))
                   1000003)))
  (format t "~d~%" sum))
