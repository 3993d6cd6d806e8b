;;; failure_frames: a condition signalled a hundred calls inside the form that handles it.

(define-condition broken (serious-condition) ((x :initarg :x :reader broken-x)))

(defun descend (depth x)
  (if (= depth 0)
      (error 'broken :x x)
      (+ 1 (descend (- depth 1) x))))

(let ((sum 0))
  (dotimes (i 200000)
    (setq sum (mod (+ sum (handler-case (descend 100 i)
                            (broken (condition) (+ (broken-x condition) 1))))
                   1000003)))
  (format t "~d~%" sum))
