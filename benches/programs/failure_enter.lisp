;;; failure_enter: entering a form that handles a condition while its body signals none.

(define-condition negative (serious-condition) ((x :initarg :x)))

(defun operate (x)
  (if (< x 0) (error 'negative :x x) x))

(let ((sum 0))
  (dotimes (i 5000000)
    (setq sum (mod (+ sum (handler-case (operate i)
                            (negative () 0)))
                   1000003)))
  (format t "~d~%" sum))
