;;; fib, with declarations for SBCL.

(declaim (optimize (speed 3) (safety 1)))

(declaim (ftype (function (fixnum) (values fixnum &optional)) fib))
(defun fib (n)
  (declare (type fixnum n))
  (if (< n 2)
      n
      (the fixnum (+ (fib (- n 1)) (fib (- n 2))))))

(format t "~d~%" (fib 35))
