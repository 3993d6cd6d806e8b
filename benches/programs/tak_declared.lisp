;;; tak, with declarations for SBCL.

(declaim (optimize (speed 3) (safety 1)))

(declaim (ftype (function (fixnum fixnum fixnum) (values fixnum &optional)) tak))
(defun tak (x y z)
  (declare (type fixnum x y z))
  (if (< y x)
      (tak (tak (- x 1) y z)
           (tak (- y 1) z x)
           (tak (- z 1) x y))
      z))

(let ((total 0))
  (declare (type fixnum total))
  (dotimes (i 24)
    (incf total (tak 24 16 (+ 8 (mod i 2)))))
  (format t "~d~%" total))
