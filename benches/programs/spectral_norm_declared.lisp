;;; spectral_norm, with declarations for SBCL: the vectors are specialized.

(declaim (optimize (speed 3) (safety 1)))

(deftype doubles () '(simple-array double-float (*)))

(declaim (inline matrix-element))

(defun matrix-element (i j)
  (declare (type (integer 0 100000) i j))
  (let ((ij (+ i j)))
    (/ 1.0 (+ (* ij (+ ij 1) 0.5) i 1))))

(defun multiply-av (n v av)
  (declare (type (integer 0 100000) n) (type doubles v av))
  (dotimes (i n)
    (let ((sum 0.0))
      (declare (type double-float sum))
      (dotimes (j n)
        (incf sum (* (matrix-element i j) (aref v j))))
      (setf (aref av i) sum))))

(defun multiply-atv (n v atv)
  (declare (type (integer 0 100000) n) (type doubles v atv))
  (dotimes (i n)
    (let ((sum 0.0))
      (declare (type double-float sum))
      (dotimes (j n)
        (incf sum (* (matrix-element j i) (aref v j))))
      (setf (aref atv i) sum))))

(defun multiply-atav (n v result scratch)
  (multiply-av n v scratch)
  (multiply-atv n scratch result))

(defun spectral-norm (n)
  (declare (type (integer 0 100000) n))
  (let ((u (make-array n :element-type 'double-float :initial-element 1.0))
        (v (make-array n :element-type 'double-float :initial-element 0.0))
        (scratch (make-array n :element-type 'double-float :initial-element 0.0))
        (vbv 0.0)
        (vv 0.0))
    (declare (type double-float vbv vv))
    (dotimes (i 10)
      (multiply-atav n u v scratch)
      (multiply-atav n v u scratch))
    (dotimes (i n)
      (incf vbv (* (aref u i) (aref v i)))
      (incf vv (* (aref v i) (aref v i))))
    (sqrt (the (double-float 0.0) (/ vbv vv)))))

(format t "~d~%" (floor (* (spectral-norm 640) 1000000000.0)))
