;;; nqueens, with declarations for SBCL.

(declaim (optimize (speed 3) (safety 1)))

(defun safe-p (row placed)
  (declare (type fixnum row) (type list placed))
  (do ((rest placed (cdr rest))
       (distance 1 (+ distance 1)))
      ((or (null rest)
           (= (the fixnum (car rest)) row)
           (= (the fixnum (car rest)) (+ row distance))
           (= (the fixnum (car rest)) (- row distance)))
       (null rest))
    (declare (type fixnum distance) (type list rest))))

(defun place-queens (size column placed solutions)
  (declare (type fixnum size column) (type list placed solutions))
  (if (= column size)
      (cons placed solutions)
      (dotimes (row size solutions)
        (when (safe-p row placed)
          (setq solutions
                (place-queens size (+ column 1) (cons row placed) solutions))))))

(defun weigh (placed)
  (let ((weight 0)
        (column 0))
    (declare (type fixnum weight column))
    (dolist (row placed weight)
      (incf column)
      (incf weight (the fixnum (* column (the fixnum row)))))))

(defun nqueens (size)
  (let ((solutions (place-queens size 0 nil nil))
        (checksum 0))
    (declare (type fixnum checksum))
    (dolist (placed solutions)
      (setq checksum (mod (+ (* checksum 31) (the fixnum (weigh placed))) 1000003)))
    (format t "~d ~d~%" (length solutions) checksum)))

(dotimes (i 5)
  (nqueens (+ 7 i)))
(nqueens 11)
