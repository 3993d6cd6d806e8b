;;;; Forms that implementations of Common Lisp subsets tend to get wrong, one program each.

;; subforms of the place first, once each, left to right; then the value
;;; 1
(answer 1 (let ((i 0) (v (vector 0 0 0))) (setf (aref v (incf i)) (incf i)) (list i v)))

;; INCF evaluates the subforms of its place once
;;; 2
(answer 2 (let ((v (vector 1 2 3)) (i 0)) (incf (aref v (incf i)) 10) (list v i)))

;; PUSH: the item before the place
;;; 3
(answer 3 (let ((l (list nil)) (log nil)) (push (progn (push 'item log) 1) (car (progn (push 'place log) l))) (reverse log)))

;; POP once too
;;; 4
(answer 4 (let ((i 0) (v (vector (list 1 2) (list 3 4)))) (list (pop (aref v (1- (incf i)))) v i)))

;; parallel
;;; 5
(answer 5 (let ((a 1) (b 2)) (psetq a b b a) (list a b)))

;; ROTATEF returns NIL
;;; 6
(answer 6 (let ((v (vector 1 2 3))) (list (rotatef (aref v 0) (aref v 1) (aref v 2)) v)))

;; SHIFTF returns the first old value
;;; 7
(answer 7 (let ((a 1) (b 2)) (list (shiftf a b 9) a b)))

;; as many values as places
;;; 8
(answer 8 (let (a b) (list (multiple-value-list (setf (values a b) (values 1 2 3))) a b)))

;; a missing value is NIL
;;; 9
(answer 9 (let ((a 0) (b 0)) (setf (values a b) 5) (list a b)))

;; GETF place writes back to its inner place, with default
;;; 10
(answer 10 (let ((p nil)) (setf (getf p :a) 1) (incf (getf p :n 10)) p))

;; LDB place
;;; 11
(answer 11 (let ((x 0)) (setf (ldb (byte 4 4) x) 15) x))

;; SUBSEQ place replaces in place, never changes the length
;;; 12
(answer 12 (let ((s (copy-seq "abcdef"))) (setf (subseq s 1 3) "XYZ") s))

;; SETQ of a symbol macro is a SETF
;;; 13
(answer 13 (let ((l (list 1 2 3))) (symbol-macrolet ((m (cadr l))) (setq m 9) (incf m)) l))

;; APPLY place
;;; 14
(answer 14 (let ((a (vector 1 2))) (setf (apply #'aref a '(1)) 7) a))

;; with no pairs: NIL
;;; 15
(answer 15 (list (setf) (setq) (psetq)))

;; none at all
;;; 16
(answer 16 (multiple-value-list (values)))

;; an argument takes exactly one, NIL if none
;;; 17
(answer 17 (list (values) (values 1 2)))

;; the protected form's values survive the cleanup
;;; 18
(answer 18 (multiple-value-list (unwind-protect (values 1 2) (values 3 4))))

;; PROG1 takes one
;;; 19
(answer 19 (multiple-value-list (prog1 (values 1 2) 3)))

;; this one takes all
;;; 20
(answer 20 (multiple-value-list (multiple-value-prog1 (values 1 2) 3)))

;; OR: one value, but from the last form
;;; 21
(answer 21 (multiple-value-list (or (values 1 2) 3)))

;; ... all of them
;;; 22
(answer 22 (multiple-value-list (or nil (values 1 2))))

;; a COND clause without a body: one
;;; 23
(answer 23 (multiple-value-list (cond ((values 1 2)))))

;; last form of AND: all
;;; 24
(answer 24 (multiple-value-list (and 1 (values 1 2))))

;; SETQ: one
;;; 25
(answer 25 (multiple-value-list (let (a) (setq a (values 1 2)))))

;; THROW, RETURN-FROM carry all
;;; 26
(answer 26 (multiple-value-list (catch 'k (throw 'k (values 1 2)))))

;;; 27
(answer 27 (multiple-value-list (block b (unwind-protect (return-from b (values 1 2)) (values 9)))))

;; (VALUES) as a test is NIL
;;; 28
(answer 28 (multiple-value-list (if (values) 1 (values 2 3))))

;; padded with NIL
;;; 29
(answer 29 (multiple-value-bind (a b c) (values 1 2) (list a b c)))

;; all values of all forms
;;; 30
(answer 30 (multiple-value-call #'list 1 (values 2 3) (values)))

;; CASE, WHEN, TYPECASE, LET, PROGN, HANDLER-CASE pass all
;;; 31
(answer 31 (multiple-value-list (case 1 (1 (values 7 8)))))

;; no error: all the values
;;; 32
(answer 32 (multiple-value-list (ignore-errors (values 1 2))))

;; a called function gives one to its caller inside MAPCAR
;;; 33
(answer 33 (multiple-value-list (mapcar #'floor '(7) '(2))))

;; two values
;;; 34
(answer 34 (multiple-value-list (gethash 'k (make-hash-table) 'd)))

;; the leftmost of a repeated key wins
;;; 35
(answer 35 ((lambda (&key a) a) :a 1 :a 2))

;; an explicit NIL is not a missing argument
;;; 36
(answer 36 ((lambda (&key (a 5)) a) :a nil))

;; defaults see the parameters to their left
;;; 37
(answer 37 ((lambda (&key (a 1 a-p) (b (* a 2))) (list a a-p b)) :a 4))

;; &REST holds the keys too
;;; 38
(answer 38 ((lambda (&optional (a 1) &rest r &key k) (list a r k)) 2 :k 3))

;; another keyword name
;;; 39
(answer 39 ((lambda (&key ((:out in) 0)) in) :out 8))

;; the caller may allow others
;;; 40
(answer 40 ((lambda (&key a) a) :b 2 :allow-other-keys t :a 1))

;; otherwise an unknown key is an error
;;; 41
(answer 41 (handler-case ((lambda (&key a) a) :b 2) (program-error () 'program-error)))

;; an odd number of key arguments too
;;; 42
(answer 42 (handler-case ((lambda (&key a) a) :a) (program-error () 'program-error)))

;; wrong argument count
;;; 43
(answer 43 (handler-case (funcall (lambda (a) a)) (program-error () 'program-error)))

;; :B goes to the optional
;;; 44
(answer 44 (handler-case ((lambda (&optional a &key b) (list a b)) :b 1) (program-error () 'program-error)))

;;; 45
(answer 45 ((lambda (a &aux (b (1+ a))) (list a b)) 1))

;; nested
;;; 46
(answer 46 (destructuring-bind (a (b &optional (c 3)) &rest d) '(1 (2) 4 5) (list a b c d)))

;; dotted
;;; 47
(answer 47 (destructuring-bind (a . b) '(1 . 2) (list a b)))

;; must check the shape
;;; 48
(answer 48 (handler-case (destructuring-bind (a b) '(1) (list a b)) (error () 'error)))

;; &WHOLE is the whole form
;;; 49
(answer 49 (macrolet ((m (&whole w x &body b) `(list ',w ,x ,@b))) (m 1 2 3)))

;; RETURN-FROM out of a closure
;;; 50
(answer 50 (block b (mapc (lambda (x) (when (= x 2) (return-from b x))) '(1 2 3)) 'none))

;; the block has been left: an error, never a wild jump
;;; 51
(defun leaves () (block b (lambda () (return-from b 1))))
(answer 51 (handler-case (funcall (leaves)) (control-error () 'control-error)))

;; inside out
;;; 52
(answer 52 (let ((log nil)) (catch 'k (unwind-protect (unwind-protect (throw 'k 1) (push 'inner log)) (push 'outer log))) (reverse log)))

;; a THROW in a cleanup replaces the first one
;;; 53
(answer 53 (catch 'a (catch 'b (unwind-protect (throw 'a 1) (throw 'b 2))) 3))

;;; 54
(answer 54 (handler-case (throw 'nowhere 1) (control-error () 'control-error)))

;; TAGBODY returns NIL; tags are EQL
;;; 55
(answer 55 (let ((n 0)) (tagbody (go b) a (incf n 10) (go c) b (incf n) (go a) c) n))

;; in the result form the variable is NIL
;;; 56
(answer 56 (dolist (x '(1 2 3) x)))

;; ... here the count
;;; 57
(answer 57 (dotimes (i 3 i)))

;; one binding for the whole loop, as in SBCL
;;; 58
(answer 58 (let ((fs nil)) (dotimes (i 3) (push (lambda () i) fs)) (mapcar #'funcall fs)))

;; DO steps in parallel
;;; 59
(answer 59 (do ((a 1 b) (b 2 a) (n 0 (1+ n))) ((= n 3) (list a b))))

;; DO* one after another
;;; 60
(answer 60 (do* ((a 1 (1+ a)) (b a (* 10 a))) ((> a 2) (list a b))))

;; PROG = BLOCK NIL + LET + TAGBODY
;;; 61
(answer 61 (prog ((x 1)) (setq x 2) (return x)))

;; a key of NIL is an empty list of keys
;;; 62
(answer 62 (list (case nil (nil 'a) (t 'b)) (case nil ((nil) 'a) (t 'b))))

;; EQL
;;; 63
(answer 63 (list (case #\a (#\a 1)) (case "a" ("a" 1) (t 2)) (case 1.0 (1 'i) (1.0 'f))))

;;; 64
(answer 64 (handler-case (ecase 3 (1 'a)) (type-error () 'type-error)))

;;; 65
(answer 65 (handler-case (values 1 2) (:no-error (a b) (list b a))))

;; HANDLER-CASE unwinds before its clause
;;; 66
(answer 66 (let ((log nil)) (handler-case (unwind-protect (error "x") (push 'cleanup log)) (error () (push 'clause log))) (reverse log)))

;; HANDLER-BIND runs before any unwinding
;;; 67
(answer 67 (let ((log nil)) (block b (unwind-protect (handler-bind ((error (lambda (c) (declare (ignore c)) (push 'handler log) (return-from b nil)))) (error "x")) (push 'cleanup log))) (reverse log)))

;; a handler that returns declines
;;; 68
(answer 68 (let ((log nil)) (handler-case (handler-bind ((error (lambda (c) (declare (ignore c)) (push 'inner log)))) (error "x")) (error () (push 'outer log))) (reverse log)))

;; in a handler its own cluster is disabled
;;; 69
(answer 69 (handler-case (handler-bind ((error (lambda (c) (declare (ignore c)) (error 'type-error :datum 1 :expected-type 'list)))) (error "x")) (type-error () 'outer-saw-it)))

;; SIGNAL returns NIL when nobody takes it
;;; 70
(answer 70 (list (cl:signal 'condition) (handler-case (cl:signal 'condition) (condition () 'caught))))

;; NIL and the condition; PRINC of it gives its report
;;; 71
(answer 71 (multiple-value-bind (v c) (ignore-errors (error "n ~a" 1)) (list v (princ-to-string c))))

;;; 72
(answer 72 (restart-case (invoke-restart 'r 1 2) (r (a b) (list a b))))

;; the restart unwinds to RESTART-CASE
;;; 73
(answer 73 (handler-bind ((error (lambda (c) (declare (ignore c)) (invoke-restart 'use 5)))) (restart-case (+ 1 (error "x")) (use (v) v))))

;; values NIL and T
;;; 74
(answer 74 (with-simple-restart (r "why") (invoke-restart 'r)))

;; MUFFLE-WARNING
;;; 75
(answer 75 (handler-bind ((warning #'muffle-warning)) (warn "w") 'after))

;;; 76
(answer 76 (list (typep (make-condition 'simple-error) 'error) (typep (nth-value 1 (ignore-errors (car 1))) 'type-error) (typep (nth-value 1 (ignore-errors (/ 1 0))) 'division-by-zero)))

;;; 77
(answer 77 (handler-case (symbol-value (gensym)) (unbound-variable () 'unbound)))

;;; 78
(answer 78 (handler-case (funcall 'no-such-function-here) (undefined-function (c) (cell-error-name c))))

;; out of bounds: an index is a TYPE-ERROR, NTH is not
;;; 79
(answer 79 (list (handler-case (aref (vector 1) 5) (type-error () 'type-error)) (handler-case (char "a" 5) (type-error () 'type-error)) (nth 5 '(1))))

;; a special binding is seen by everything called inside it
;;; 80
(defvar *q1* 1)
(defun q1 () *q1*)
(answer 80 (let ((*q1* 2)) (list (q1) (funcall (let ((f (lambda () *q1*))) f)))))

;; DEFVAR keeps a value, DEFPARAMETER does not
;;; 81
(defvar *q2* 1)
(defvar *q2* 9)
(answer 81 *q2*)

;; any exit undoes the binding
;;; 82
(defvar *q3* 1)
(catch 'k (let ((*q3* 2)) (throw 'k nil)))
(answer 82 *q3*)

;; a special parameter is a dynamic binding
;;; 83
(defvar *q4* 1)
(answer 83 (flet ((f () *q4*)) ((lambda (*q4*) (f)) 7)))

;; lexical stays lexical
;;; 84
(answer 84 (let ((x 1)) (flet ((f () x)) (let ((x 2)) (list x (f))))))

;; LET in parallel
;;; 85
(answer 85 (let ((x 1)) (let ((x 2) (y x)) (list x y))))

;; closures share and keep the variable itself
;;; 86
(answer 86 (let ((fs (let ((n 0)) (list (lambda () (incf n)) (lambda () n))))) (funcall (first fs)) (funcall (second fs))))

;; LABELS sees itself; proper tail calls wanted
;;; 87
(answer 87 (labels ((ev (n) (if (= n 0) t (od (1- n)))) (od (n) (if (= n 0) nil (ev (1- n))))) (ev 10001)))

;; #'F names the local function, 'F the global one
;;; 88
(answer 88 (flet ((f (x) (list 'inner x))) (list (funcall #'f 1) (f 2))))

;;; 89
(answer 89 (list (eql 1 1.0) (= 1 1.0) (eql 1.5 1.5) (eql (expt 2 80) (expt 2 80)) (eql #\a #\a) (eql "a" "a")))

;; EQUAL goes into conses and strings only
;;; 90
(answer 90 (list (equal "ab" "ab") (equal "ab" "AB") (equal #(1) #(1)) (equal '(1 (2)) '(1 (2))) (equal 1 1.0)))

;; EQUALP: case, number type and array kind do not matter
;;; 91
(answer 91 (list (equalp "ab" "AB") (equalp #(1 2) #(1.0 2.0)) (equalp 1 1.0) (equalp '(#\a) '(#\A))))

;;; 92
(answer 92 (list (= 0.0 -0.0) (eql 0.0 -0.0) (equal 0.0 -0.0) (equalp 0.0 -0.0)))

;; hash tables and structures only by EQUALP
;;; 93
(answer 93 (let ((a (make-hash-table :test 'equal)) (b (make-hash-table :test 'equal))) (setf (gethash "k" a) 1 (gethash "k" b) 1) (list (equal a b) (equalp a b))))

;; the last argument is shared and may be any object
;;; 94
(answer 94 (list (append) (append nil 1) (append '(1) 2) (append '(1) '(2) nil)))

;; NILs skipped; a dotted end is fine
;;; 95
(answer 95 (list (nconc) (nconc nil (list 1) nil (list 2)) (nconc (list 1) 2)))

;;; 96
(answer 96 (list (last '(1 2 . 3)) (last '(1 2 3) 0) (last '(1 2 3) 2) (butlast '(1 2 . 3)) (butlast '(1 2 3) 5)))

;; MAPCAN joins with NCONC: it changes the lists it is given
;;; 97
(answer 97 (let ((l (list 1 2))) (list (mapcan #'list '(1 2)) (mapcan (lambda (x) (declare (ignore x)) l) '(1)) (eq l (mapcan (lambda (x) (declare (ignore x)) l) '(1))))))

;; ... dotted at the end
;;; 98
(answer 98 (mapcan #'identity (list (list 1) nil (list 2) 3)))

;; the shortest list ends it; MAPC returns its first list
;;; 99
(answer 99 (list (mapcar #'+ '(1 2 3) '(10 20)) (mapc #'identity '(1 2)) (maplist #'length '(1 2 3)) (mapcon #'list '(1 2))))

;; NIL elements of an alist are skipped
;;; 100
(answer 100 (list (member 2 '(1 2 3)) (member 2 '((1) (2)) :key #'car) (assoc 'b '((a . 1) nil (b . 2))) (rassoc 2 '((a . 1) (b . 2)))))

;; the test gets the item first, then the element
;;; 101
(answer 101 (member 5 '(1 7 3) :test #'<))

;; in ADJOIN and PUSHNEW the key applies to the item too
;;; 102
(answer 102 (list (adjoin 2 '(1 2)) (adjoin '(2 x) '((1) (2)) :key #'car) (let ((l (list 1))) (pushnew 1 l) l)))

;; order unspecified: this is SBCL's
;;; 103
(answer 103 (list (union '(1 2) '(2 3)) (intersection '(1 2 3) '(3 2)) (set-difference '(1 2 3) '(2)) (set-exclusive-or '(1 2) '(2 3))))

;;; 104
(answer 104 (list (nth 9 '(1)) (nthcdr 9 '(1)) (car nil) (cdr nil) (list-length '(1 2)) (list* 1 2 '(3)) (list* 1)))

;;; 105
(answer 105 (list (getf '(:a 1 :b 2) :b) (getf '(:a nil) :a 'd) (getf '() :a 'd) (let ((p (list :a 1 :b 2))) (list (remf p :a) p))))

;;; 106
(answer 106 (list (subst 'x 'b '(a (b . b))) (sublis '((a . 1) (b . 2)) '(a (b c))) (tree-equal '(1 (2)) '(1 (2)))))

;; LENGTH of a dotted list
;;; 107
(answer 107 (handler-case (length '(1 . 2)) (type-error () 'type-error)))

;;; 108
(answer 108 (list (ldiff '(1 2 3) nil) (let ((l '(1 2 3))) (ldiff l (cddr l))) (copy-list '(1 2 . 3)) (tailp nil '(1))))

;; the later one stays, unless FROM-END
;;; 109
(answer 109 (list (remove-duplicates '(1 2 1 3)) (remove-duplicates '(1 2 1 3) :from-end t)))

;;; 110
(answer 110 (list (remove 1 '(1 2 1 3 1) :count 2) (remove 1 '(1 2 1 3 1) :count 2 :from-end t) (remove 1 '(1 1) :count -1)))

;;; 111
(answer 111 (list (reduce #'- '(1 2 3)) (reduce #'- '(1 2 3) :from-end t) (reduce #'+ nil) (reduce #'list '(a)) (reduce #'list '(a) :initial-value 'i) (reduce #'+ '((1) (2)) :key #'car)))

;;; 112
(answer 112 (list (position #\a "banana" :from-end t) (position #\a "banana" :start 2) (search "na" "banana") (search "na" "banana" :from-end t) (mismatch "abc" "abd") (mismatch "ab" "ab")))

;;; 113
(answer 113 (list (find 3 '(1 2 3 4) :test #'<) (find-if #'evenp '(1 2 3 4) :from-end t) (count 1 #(1 2 1)) (count-if #'evenp '(1 2 4) :end 2)))

;; SORT destroys its list: use the value
;;; 114
(answer 114 (list (sort (list 3 1 2) #'<) (sort (vector 3 1 2) #'>) (stable-sort (list '(1 . a) '(0 . b) '(1 . c)) #'< :key #'car) (merge 'list (list 1 3) (list 2 4) #'<)))

;;; 115
(answer 115 (list (map 'list #'+ '(1 2) #(10 20 30)) (map 'string #'char-upcase "ab") (map nil #'identity '(1)) (map-into (vector 0 0 0) #'1+ '(1 2))))

;;; 116
(answer 116 (list (every #'< '(1 2) '(2 3)) (some #'evenp '(1 3)) (some (lambda (x) (and (evenp x) (* x 10))) '(1 2)) (every #'evenp nil) (notany #'evenp '(1))))

;;; 117
(answer 117 (list (subseq '(1 2 3) 1) (subseq "abc" 1 1) (handler-case (subseq "abc" 2 9) (error () 'error)) (copy-seq #(1 2))))

;;; 118
(answer 118 (list (concatenate 'list "ab" #(1)) (concatenate 'string "a" '(#\b)) (coerce "ab" 'list) (coerce '(1 2) 'vector) (coerce '(#\a) 'string)))

;;; 119
(answer 119 (list (substitute 9 1 '(1 2 1) :count 1) (substitute-if 0 #'evenp #(1 2 4) :from-end t :count 1) (replace (list 1 2 3 4) '(9 8) :start1 1) (fill (list 1 2 3) 0 :start 1)))

;; overlapping REPLACE of an object onto itself: what SBCL does
;;; 120
(answer 120 (let ((v (vector 1 2 3 4 5))) (replace v v :start1 1 :start2 0 :end2 4)))

;;; 121
(answer 121 (let ((v (make-array 2 :fill-pointer 0 :adjustable t))) (list (vector-push-extend 'a v) (vector-push-extend 'b v) (vector-push-extend 'c v) v (length v) (vector-pop v))))

;; full: NIL, no error
;;; 122
(answer 122 (let ((v (make-array 1 :fill-pointer 0))) (list (vector-push 'a v) (vector-push 'b v) v)))

;; AREF goes past the fill pointer, sequence functions do not
;;; 123
(answer 123 (let ((v (make-array 5 :fill-pointer 2 :initial-element 0))) (list (length v) (array-total-size v) (aref v 4) (coerce v 'list))))

;;; 124
(answer 124 (let ((a (make-array '(2 3) :initial-contents '((1 2 3) (4 5 6))))) (list (aref a 1 2) (array-dimensions a) (row-major-aref a 3) a)))

;; exact rationals, bignums without notice
;;; 125
(answer 125 (list (/ 6 4) (/ 4 2) (/ 2) (- 5) (+) (*) (expt 2 100) (expt 2 -2) (expt 0 0)))

;;; 126
(answer 126 (mapcar (lambda (f) (multiple-value-list (funcall f -7 2))) (list #'floor #'ceiling #'truncate #'round)))

;; ROUND: halves go to the even one
;;; 127
(answer 127 (list (multiple-value-list (round 5 2)) (multiple-value-list (round 7 2)) (multiple-value-list (round 2.5)) (multiple-value-list (floor 7.5)) (multiple-value-list (floor 7/2))))

;;; 128
(answer 128 (list (mod -7 2) (rem -7 2) (mod 7 -2) (rem 7 -2) (mod 5.5 2) (mod -1/2 1)))

;;; 129
(answer 129 (list (sqrt 16) (isqrt 17) (expt 4 1/2) (log 8 2) (exp 0) (exp 1) (atan 1 -1) (expt 2.0 3) (sqrt 2d0)))

;; contagion; MAX does not convert
;;; 130
(answer 130 (list (+ 1/2 0.5) (+ 1.0 1d0) (* 2 0.1) (max 1 2.0) (max 1.0 2) (float 1/3) (coerce 1/3 'double-float)))

;; float against rational is compared exactly
;;; 131
(answer 131 (list (= 1/3 (/ 1.0 3)) (< 1 2 3) (/= 1 2 1) (= 10000000000000000000001 1d22)))

;;; 132
(answer 132 (list (rational 0.5) (rationalize 0.1) (rational 0.1) (numerator 6/4) (truncate 1d10)))

;;; 133
(answer 133 (list (ash -5 -1) (ash 1 70) (logand -1 255) (logior 5 -8) (lognot 5) (integer-length -8) (logcount -1) (logbitp 70 -1) (ldb (byte 8 4) 43981)))

;; the shortest digits that read back; fixed from 1e-3 up to 1e7; a double shows d
;;; 134
(answer 134 (list 1.0 10.0 1000000.0 9999999.0 1.0e7 1.0e-3 1.0e-4 123456.79 1.0e10 1.5d0 1.0d20 0.1 (/ 1.0 3) (/ 1d0 3) -0.0))

;;; 135
(answer 135 (list (+ 0.1 0.2) (+ 0.1d0 0.2d0) 1e38))

;;; 136
(answer 136 (list (multiple-value-list (parse-integer " 42 ")) (multiple-value-list (parse-integer "12x" :junk-allowed t)) (parse-integer "ff" :radix 16) (parse-integer "-7") (handler-case (parse-integer "4 2") (parse-error () 'parse-error)) (parse-integer "" :junk-allowed t)))

;;; 137
(answer 137 (list (handler-case (/ 1 0) (division-by-zero () 'dz)) (handler-case (/ 1.0 0.0) (division-by-zero () 'dz)) (handler-case (mod 1 0) (division-by-zero () 'dz)) (handler-case (sqrt 'a) (type-error () 'te))))

;;; 138
(answer 138 (list (gcd) (lcm) (gcd 12 -18) (lcm 4 6) (signum -2.5) (abs -1/2) (evenp 0) (zerop -0.0) (minusp -0.0) (1+ 1/2)))

;; the index where they differ, not T
;;; 139
(answer 139 (list (string< "abc" "abd") (string< "abd" "abc") (string/= "a" "a") (string> "b" "a") (string<= "ab" "abc")))

;; string designators
;;; 140
(answer 140 (list (string= 'abc "ABC") (string= "abc" "xbcx" :start1 1 :start2 1 :end2 3) (string-equal "aB" "Ab") (string #\a) (string 'a)))

;;; 141
(answer 141 (list (string-capitalize "hello wORLD-foo 3com o'neill") (string-trim " x" " xax ") (string-upcase "aé") (string-left-trim "a" "aab")))

;;; 142
(answer 142 (list (digit-char-p #\7 8) (digit-char-p #\8 8) (digit-char 11 16) (char-code #\a) (char-name #\Space) (name-char "newline") (char-upcase #\a) (both-case-p #\1)))

;;; 143
(answer 143 (list (char< #\a #\b #\c) (char/= #\a #\b #\a) (char-equal #\a #\A) (alpha-char-p #\1) (alphanumericp #\_) (upper-case-p #\A)))

;;; 144
(answer 144 (list (reverse "abc") (sort (copy-seq "hello") #'char<) (subseq "hello" 1 3) (char "abc" 1) (length "λx")))

;;; 145
(answer 145 (with-output-to-string (s) (write-string "ab" s) (write-char #\c s) (terpri s) (princ 1 s)))

;;; 146
(answer 146 (with-input-from-string (s "one two (3)") (list (read s) (read-char s) (read-char s) (peek-char nil s) (read-line s) (read-line s nil 'eof))))

;; the default test is EQL: strings do not match
;;; 147
(answer 147 (let ((h (make-hash-table))) (setf (gethash "a" h) 1) (list (gethash "a" h) (hash-table-count h))))

;;; 148
(answer 148 (let ((h (make-hash-table :test 'equal))) (incf (gethash "a" h 0)) (push 1 (gethash 'l h)) (list (gethash "a" h) (gethash 'l h) (remhash 'l h) (remhash 'l h))))

;; REMHASH and SETF of the current entry are allowed during MAPHASH; SBCL walks in order of insertion
;;; 149
(answer 149 (let ((h (make-hash-table)) (ks nil)) (dotimes (i 5) (setf (gethash i h) i)) (maphash (lambda (k v) (if (oddp k) (remhash k h) (setf (gethash k h) (* v 10)))) h) (maphash (lambda (k v) (push (cons k v) ks)) h) (reverse ks)))

;;; 150
(answer 150 (let ((h (make-hash-table :test 'equalp))) (setf (gethash "A" h) 1 (gethash 1.0 h) 2) (list (gethash "a" h) (gethash 1 h))))

;; present with NIL against absent
;;; 151
(answer 151 (let ((h (make-hash-table))) (setf (gethash 1 h) nil) (list (multiple-value-list (gethash 1 h)) (multiple-value-list (gethash 2 h)))))

;;; 152
(defstruct pt (x 0) (y (+ 1 1)))
(answer 152 (let ((p (make-pt :x 5))) (setf (pt-y p) 7) (list p (pt-p p) (typep p 'pt) (equal p (copy-pt p)) (equalp p (copy-pt p)))))

;; inherited slots by both accessors; BOA constructor
;;; 153
(defstruct (pt3 (:include pt (x 10)) (:conc-name p3-) (:constructor mk3 (z &optional (y 1)))) z)
(answer 153 (let ((p (mk3 3))) (list p (p3-x p) (p3-z p) (pt-x p) (pt-p p))))

;;; 154
(answer 154 (handler-case (make-pt :nope 1) (program-error () 'program-error)))

;;; 155
(answer 155 (handler-case (pt-x 17) (type-error () 'type-error)))

;;; 156
(answer 156 (list (loop for i from 1 to 3 for j = (* i i) collect (list i j)) (loop for (k v) on '(:a 1 :b 2) by #'cddr collect (cons v k)) (loop for (a . b) in '((1 . 2)) collect (+ a b))))

;; empty: SUM and COUNT give 0
;;; 157
(answer 157 (list (loop for x in '(1 2 3) maximize x) (loop for x in nil sum x) (loop for x in nil collect x) (loop repeat 3 count t)))

;;; 158
(answer 158 (list (loop for x in '(1 2) always (< x 3)) (loop for x in '(1 2) thereis (and (= x 2) 'yes)) (loop for x in '(1 2) never (= x 2))))

;; SBCL has stepped past the end here
;;; 159
(answer 159 (loop for i from 1 to 5 finally (return i)))

;;; 160
(answer 160 (loop for x in '(1 2 3 4 5) when (evenp x) collect x into e and sum x into s else collect x into o end finally (return (list e s o))))

;;; 161
(answer 161 (loop with a = 1 and b = 2 for x = a then (+ x b) while (< x 8) collect x))

;; the first FOR clause to end stops the step of those after it
;;; 162
(answer 162 (loop for x in '(a b c) for i from 0 append (list i x)))

;;; 163
(answer 163 (let ((h (make-hash-table))) (setf (gethash 'a h) 1 (gethash 'b h) 2) (loop for k being the hash-keys of h using (hash-value v) collect (list k v))))

;;; 164
(answer 164 (loop named outer for i from 1 do (loop for j from 1 to 3 do (when (= (* i j) 6) (return-from outer (list i j))))))

;;; 165
(answer 165 (list (loop for c across "abc" collect c) (loop for i downfrom 3 to 1 collect i) (loop for i from 0 below 1 by 1/3 collect i) (loop for l on '(1 2) collect l)))

;;; 166
(answer 166 (let ((n 0)) (list (loop (when (> (incf n) 3) (return n))) (loop while (< n 6) do (incf n)) (loop until t collect 1))))

;; WHILE and UNTIL run the epilogue and return what was collected; RETURN does not
;;; 167
(answer 167 (loop for x in '(1 2 3) until (= x 3) collect x))

;; ~D of a non-integer is ~A
;;; 168
(answer 168 (format nil "~a|~s|~5a|~5@a|~5d|~5,'0d|~:d|~@d|~d" "x" "x" "ab" "ab" 42 42 1234567 5 "n"))

;;; 169
(answer 169 (format nil "~,2f|~6,2f|~f|~f|~,1f|~,0f|~5,1f|~f" 3.14159 2.5 3 0.125 0.25 2.5 -0.04 1e10))

;;; 170
(answer 170 (format nil "~e|~,2e|~$|~,3$|~g" 1500.0 0.00123 3.14159 2 1.5))

;;; 171
(answer 171 (format nil "~r|~:r|~@r|~:@r|~r|~2r|~8,5,'0r|~b|~o|~x|~:x" 21 21 14 14 -1000001 5 64 5 8 255 1048576))

;;; 172
(answer 172 (format nil "~{~a~^, ~}|~{~a=~a~^;~}|~:{<~a>~}|~@{~a ~}" '(1 2 3) '(a 1 b 2) '((1 x) (2)) 7 8))

;;; 173
(answer 173 (format nil "~[zero~;one~:;many~]|~[zero~;one~:;many~]|~:[no~;yes~]|~@[x=~a~]|~@[x=~a~]|" 0 9 nil 5 nil))

;;; 174
(answer 174 (format nil "~a ~*~a ~:*~a|~@*~a|~2@*~a" 1 2 3 4))

;;; 175
(answer 175 (format nil "~(ABC Def~)|~:(hello wORLD~)|~@(hello WORLD~)|~:@(abc~)" ))

;;; 176
(answer 176 (format nil "~d file~:p|~d file~:p|~d cit~:@p|~d cit~:@p" 1 2 1 2))

;;; 177
(answer 177 (format nil "~c|~:c|~@c|~?|~v,'xd|~va|~#[none~;one~:;some~]" #\a #\Space #\a "~a-~a" '(1 2) 5 42 4 'z 1 2))

;;; 178
(answer 178 (format nil "a~%b~&c~&~&d~~~3%e~10tf~2,4tg"))

;; tilde newline eats the newline and the blanks after it
;;; 179
(answer 179 (format nil "one ~
             two"))

;; ~:A prints NIL as ()
;;; 180
(answer 180 (format nil "~a ~s ~:a ~:s ~a" nil nil nil nil '(nil (quote x) #'f)))

;; too few arguments: an error; too many: ignored
;;; 181
(answer 181 (list (handler-case (format nil "~a") (error () 'error)) (format nil "~a" 1 2) (handler-case (format nil "~q" 1) (error () 'error))))

;;; 182
(answer 182 (list (prin1-to-string '(a . b)) (prin1-to-string '(1 . (2 . (3)))) (prin1-to-string "a\"b\\") (princ-to-string "a\"b") (prin1-to-string #\a) (prin1-to-string #\Space) (princ-to-string #\a)))

;;; 183
(answer 183 (list (prin1-to-string '|foo Bar|) (princ-to-string '|foo Bar|) (prin1-to-string 'foo) (prin1-to-string :k) (prin1-to-string '|1|) (prin1-to-string '||) (prin1-to-string (make-symbol "G"))))

;;; 184
(answer 184 (list (prin1-to-string ''x) (prin1-to-string '#'car) (prin1-to-string '(quote x y)) (prin1-to-string #(1 (2) "s"))))

;;; 185
(answer 185 (let ((*print-length* 2) (*print-level* 2)) (list (prin1-to-string '(1 2 3)) (prin1-to-string '(1 (2 (3)))))))

;;; 186
(answer 186 (let ((*print-base* 16) (*print-radix* t)) (list (prin1-to-string 255) (prin1-to-string 1/2))))

;;; 187
(answer 187 (let ((*print-case* :downcase)) (prin1-to-string '(Foo |Bar| :k))))

;; PRINT: newline before, space after; FRESH-LINE knows the column
;;; 188
(answer 188 (with-output-to-string (*standard-output*) (print 1) (prin1 'a) (princ "b") (fresh-line) (fresh-line) (write "c")))

;;; 189
(answer 189 (mapcar #'read-from-string '("1." "+5" "-0" "6/4" ".5" "1e3" "1d0" "1+" "+" "-" "1/2/3" "a.b" "..a" "1e" "#xFF" "#b-101" "#o17")))

;;; 190
(answer 190 (list (read-from-string "(a . b)") (read-from-string "(a .b)") (read-from-string "#(1 2)") (read-from-string "'x") (read-from-string "#'f") (read-from-string "#\\Space") (read-from-string "|a b|") (read-from-string "a\\b")))

;;; 191
(answer 191 (list (multiple-value-list (read-from-string "foo bar")) (multiple-value-list (read-from-string "(a)b")) (read-from-string "" nil 'eof) (handler-case (read-from-string "(1") (end-of-file () 'eof-error)) (read-from-string "xyz" t nil :start 1)))

;;; 192
(answer 192 (let ((x 1) (l '(2 3))) (list `(a ,x ,@l) `(,@l . ,x) `#(,x ,@l) `(1 ,@nil))))

;;; 193
(answer 193 (list (read-from-string "#| a #| b |# c |# d") (read-from-string "; c
e") (read-from-string "#:g") (read-from-string ":Key")))

;; the innermost definition of either kind wins
;;; 194
(answer 194 (macrolet ((m (x) `(* ,x 2))) (flet ((m (x) (list 'f x))) (m 3))))

;; SETF expands macro places
;;; 195
(defmacro my-first (l) `(car ,l))
(answer 195 (let ((l (list 1 2))) (setf (my-first l) 9) l))

;; the expansion itself is SBCL's own
;;; 196
(answer 196 (list (macroexpand-1 '(when a b)) (multiple-value-list (macroexpand-1 '(car x)))))

;;; 197
(defmacro swap2 (a b) (let ((g (gensym))) `(let ((,g ,a)) (setf ,a ,b ,b ,g))))
(answer 197 (let ((x 1) (y 2)) (swap2 x y) (list x y)))

;; EVAL does not see lexical variables
;;; 198
(answer 198 (list (eval '(let ((x 2)) (* x x))) (let ((x 5)) (declare (ignorable x)) (handler-case (eval 'x) (unbound-variable () 'null-lexical-environment)))))

;; a binding shadows a symbol macro
;;; 199
(answer 199 (symbol-macrolet ((x 'outer)) (let ((x 'inner)) x)))

;;; 200
(answer 200 (list (funcall (constantly 1) 2 3) (funcall (complement #'evenp) 2) (apply #'+ 1 2 '(3 4)) (apply #'list nil)))

;;; 201
(answer 201 (list (typep 5 '(integer 0 10)) (typep 5 '(or string (member 5 6))) (typep 1/2 'rational) (typep nil 'list) (typep 'a '(and symbol (not null))) (typep "a" '(satisfies stringp)) (typep (expt 2 70) 'fixnum)))

;;; 202
(answer 202 (list (coerce 1 'float) (coerce 'a 'symbol) (coerce "a" 'character) (coerce 1.5 'double-float) (coerce #'car 'function) (handler-case (coerce 1.5 'integer) (error () 'error))))

;;;; What was found since.

;; the order of sets, long ones too
;;; 203
(answer 203 (let ((a (loop for i below 25 collect i)) (b (loop for i from 20 below 50 collect i)))
              (list (union a b) (intersection a b) (set-difference a b) (set-exclusive-or a b)
                    (nunion (copy-list a) (copy-list b)) (nset-exclusive-or (copy-list a) (copy-list b)))))

;; duplicates stay
;;; 204
(answer 204 (let ((a (list 1 1 2)) (b (list 3 3)) (c (list 2))) (list (union a b) (set-difference a c) (intersection a c))))

;; the first word may begin with a digit
;;; 205
(answer 205 (list (format nil "~@(~a~)" "2 ITEMS") (format nil "~@(~a~)" "- iTEMS") (format nil "~:(~a~)" "2 items 3rd")))

;; of nothing
;;; 206
(answer 206 (list (loop for x in nil maximize x) (loop for x in nil minimize x) (loop for x in '(-3) maximize x)))

;; bounds that lie outside
;;; 207
(answer 207 (handler-case (replace (list 1 2 3) '(a b) :start1 1 :end1 5) (type-error () 'type-error)))

;; a handler for something that is no type
;;; 208
(answer 208 (handler-case (handler-case (error "x") (no-such-type208 () 1)) (error () 'outer)))

;; a # within a name
;;; 209
(answer 209 (list (prin1-to-string '|A#|) (prin1-to-string '|#A|) (read-from-string "a#") (princ-to-string '|A#|)))

;; a bound that is wrong, where nothing is to be done
;;; 210
(answer 210 (list (handler-case (remove 1 (vector 1 2) :end 5 :count 0) (type-error () 'type-error))
                  (handler-case (remove 1 (list 1 2) :start -1) (type-error () 'type-error))))

;; at the end of a hash table its variables are NIL
;;; 211
(answer 211 (let ((h (make-hash-table))) (setf (gethash 'a h) 1 (gethash 'b h) 2)
              (list (loop for k being the hash-keys of h using (hash-value v) finally (return (list k v)))
                    (loop for k being the hash-keys of h do (when (eq k 'a) (loop-finish)) finally (return k))
                    (loop for nil being the hash-keys of h count t))))

;; a variable that is there twice
;;; 212
(answer 212 (handler-case (eval '(loop with m = 0 for x in '(1 2) sum x into m)) (program-error () 'program-error)))

;; WHILE between iteration clauses
;;; 213
(answer 213 (with-input-from-string (in "12 ")
              (loop for d = (peek-char nil in nil nil) while (and d (digit-char-p d))
                    for v = (digit-char-p (read-char in)) then (+ (* 10 v) (digit-char-p (read-char in)))
                    finally (return v))))

;; classes: slots, initialization, other classes
;;; 214
(progn
  (defclass k214 () ((a :initarg :a :initform 1) (b :initarg :b) (c :allocation :class :initform 3)))
  (defclass l214 (k214) ((d :initform 4) (a :initform 2)))
  (defmethod initialize-instance :after ((object l214) &key (e 5)) (setf (slot-value object 'b) e))
  (defmethod slot-unbound (class (object k214) name) (declare (ignore class)) (list 'unbound name))
  (defmethod slot-missing (class (object k214) name operation &optional value)
    (declare (ignore class operation value))
    (list 'missing name))
  (defmethod update-instance-for-different-class :after ((old k214) (new l214) &key)
    (setf (slot-value new 'b) (list 'was (slot-value old 'a))))
  (defmethod update-instance-for-redefined-class :after ((object l214) added discarded values &key)
    (setf (slot-value object 'b) (list added discarded values)))
  (answer 214
          (let ((k (make-instance 'k214)) (l (make-instance 'l214 :e 6)))
            (with-slots (a (other b)) k
              (setf a 7)
              (list a other (slot-value k 'z) (slot-value l 'a) (slot-value l 'b) (slot-value l 'd)
                    (slot-boundp k 'b) (slot-exists-p k 'd) (slot-exists-p l 'd)
                    (progn (slot-makunbound l 'a) (slot-boundp l 'a))
                    (progn (reinitialize-instance k :a 8) a)
                    (progn (shared-initialize l '(a)) (slot-value l 'a))
                    (progn (setf (slot-value l 'c) 9) (slot-value k 'c))
                    (progn (change-class k 'l214) (slot-value k 'b))
                    (progn (make-instances-obsolete 'l214) (slot-value l 'b))
                    (slot-boundp (allocate-instance (find-class 'k214)) 'a)
                    (class-name (class-of l)) (typep k 'k214) (find-class 'm214 nil))))))

;; what generic functions do without a method
;;; 215
(progn
  (defgeneric g215 (x))
  (defmethod g215 ((x integer)) (call-next-method))
  (defmethod no-applicable-method ((function (eql #'g215)) &rest arguments) (list 'none arguments))
  (defmethod no-next-method ((function (eql #'g215)) method &rest arguments)
    (declare (ignore method))
    (list 'no-next arguments))
  (defclass p215 () ((x :initarg :x :accessor p215-x)))
  (answer 215 (list (g215 'a) (with-accessors ((x p215-x)) (make-instance 'p215 :x 1) (incf x)))))

;; clauses of LOOP joined by AND, and no variable
;;; 216
(answer 216 (list (loop for c across "ab" and i from 0 collect (list c i))
                    (let ((x 5)) (loop for y from x and x from 1 to 3 collect (list x y)))
                    (loop for x = 1 then (1+ x) and y = 0 then x repeat 3 collect (list x y))
                    (loop for nil on '(1 2) collect 1)))

;; leaving an iteration of FORMAT by parameters
;;; 217
(answer 217 (list (format nil "~{<~a~1,1^,>~}|" '(1 2 3)) (format nil "~{~v^<~a>~}|" '(1 a 0 b 2 c))
                    (format nil "~:{<~a~0:^~a>~}|" '((1 2) (3 4))) (format nil "~@{<~a~1,2,3^,>~}|" 1 2 3)
                    (format nil "~15,1,2,2,,,'E@e" -0.75)))

;; types of compound specifiers
;;; 218
(answer 218 (list (multiple-value-list (subtypep '(vector character) 'string))
                    (multiple-value-list (subtypep '(and symbol list) 'null))
                    (multiple-value-list (subtypep 'ratio '(and rational (not integer))))
                    (multiple-value-list (subtypep '(rational 0 1) 'integer))
                    (multiple-value-list (subtypep '(integer 0 5) '(not (integer 7 9)))) (type-of 0)))

;; the sign of minus zero
;;; 219
(answer 219 (list (rem -0.0 1) (mod -0.0 -1) (multiple-value-list (round -0.0))
                    (multiple-value-list (ffloor -0.0)) (multiple-value-list (ftruncate 0.0 -2))
                    (tanh 0.3856239926684798) (cosh 4.830571047624649)))

;; shared strings, and a radix for reading
;;; 220
(answer 220 (list (let ((s "ab") (*print-circle* t)) (prin1-to-string (list s s)))
                    (let ((*read-base* 16)) (read-from-string "(ff 1/F 10. 1e3 face)"))
                    (let ((i nil))
                      (with-input-from-string (s "(a) b" :index i) (declare (type stream s)) (read s))
                      i)
                    (write-to-string '(1 (2 (3))) :level 2)))

;; keys and tests that are called in a certain order
;;; 221
(answer 221 (list (sort (list :a) #'< :key #'1+) (remove-duplicates '(1 2 3 4) :test #'<)
                    (remove-duplicates '(4 3 2 1) :test #'< :from-end t)
                    (remove-duplicates '(3 4 5) :from-end t :test (lambda (x y) (= (- x y) 1)))))

;; a clause :NO-ERROR before others
;;; 222
(answer 222 (list (handler-case 1 (:no-error (x) (list :fine x)) (error () :failed))
                    (handler-case (car 1) (:no-error (x) (list :fine x)) (error () :failed))))

;; a macro that defines methods
;;; 223
(progn
  (defmacro define-shape223 (name)
    `(defgeneric ,name (x)
       (:method ((x t)) (list :any x))
       (:method ((x symbol)) (list :symbol (call-next-method)))))
  (define-shape223 shape223)
  (answer 223 (list (shape223 1) (shape223 'a))))

;; operations of bits
;;; 224
(answer 224 (list (bit-and #*0011 #*0101) (bit-ior #*0011 #*0101) (bit-xor #*0011 #*0101) (bit-eqv #*0011 #*0101)
                  (bit-nand #*0011 #*0101) (bit-nor #*0011 #*0101) (bit-andc1 #*0011 #*0101)
                  (bit-andc2 #*0011 #*0101) (bit-orc1 #*0011 #*0101) (bit-orc2 #*0011 #*0101) (bit-not #*0011)
                  (bit-vector-p #*1) (simple-bit-vector-p #*1) (bit-vector-p #(1))))

;; arrays of bits and bytes are told apart from others
;;; 225
(answer 225 (let ((bits (make-array 3 :element-type 'bit :initial-element 1))
                  (bytes (make-array 2 :element-type '(unsigned-byte 8) :initial-element 200)))
              (list bits bytes (array-element-type bits) (array-element-type bytes) (equal bits #*111)
                    (equalp bytes #(200 200)) (typep bytes '(vector (unsigned-byte 8))) (typep bits 'simple-vector)
                    (handler-case (setf (aref bits 0) (car (list 2))) (type-error () :refused))
                    (handler-case (setf (aref bytes 0) (car (list 256))) (type-error () :refused))
                    (concatenate 'bit-vector bits #*0) (coerce '(0 1) 'bit-vector)
                    (multiple-value-list (subtypep 'bit-vector '(array bit (*)))))))

;; displaced arrays share, until they grow
;;; 226
(answer 226 (let* ((all (vector 1 2 3 4 5 6))
                   (part (make-array 3 :displaced-to all :displaced-index-offset 2 :adjustable t :fill-pointer 2))
                   (square (make-array '(2 2) :displaced-to all :displaced-index-offset 1)))
              (setf (aref part 0) 'a (aref square 1 1) 'b)
              (list part square all (multiple-value-list (array-displacement square))
                    (progn (vector-push-extend 'c part) (vector-push-extend 'd part) (setf (aref part 1) 'e) part)
                    all
                    (adjust-array (make-array '(2 2) :adjustable t) '(1 3) :displaced-to all) (position 'b all))))

;; arithmetic of complex numbers
;;; 227
(answer 227 (list #C(1 2) (complex 1 0) (complex 1.5 0) (realpart #C(1 2)) (imagpart #C(1 2)) (conjugate #C(1 2))
                  (+ #C(1 2) #C(3 -2)) (- #C(1 2) 1/2) (* #C(1 2) #C(1 2)) (/ #C(1 2) #C(3 4)) (expt #C(1 1) 10)
                  (= #C(1 2) #C(1.0 2.0)) (eql #C(1 2) #C(1 2)) (zerop #C(0.0 0.0)) (abs #C(3.0 4.0))
                  (sqrt -4.0) (phase #C(0.0 1.0)) (cis 0.0) (upgraded-complex-part-type 'rational)
                  (handler-case (< #C(1 2) (car (list 1))) (type-error () :refused))))

;; broadcast, concatenated, two-way, echo and synonym streams
;;; 228
(defvar *out228*)
(answer 228 (let* ((a (make-string-output-stream)) (b (make-string-output-stream)) (c (make-string-output-stream))
                   (in (make-concatenated-stream (make-string-input-stream "12 (a") (make-string-input-stream " b) rest")))
                   (both (make-broadcast-stream a b))
                   (two (make-two-way-stream in both))
                   (echo (make-echo-stream two c))
                   (*out228* b)
                   (synonym (make-synonym-stream '*out228*)))
              (write-string "x" two)
              (let ((first (read echo)) (second (read two)))
                (write-string "y" synonym)
                (list first second (read-line in) (get-output-stream-string a) (get-output-stream-string b)
                      (get-output-stream-string c) (synonym-stream-symbol synonym)
                      (length (broadcast-stream-streams both)) (length (concatenated-stream-streams in))
                      (eq (two-way-stream-input-stream two) in) (eq (two-way-stream-output-stream two) both)
                      (eq (echo-stream-input-stream echo) two) (eq (echo-stream-output-stream echo) c)
                      (input-stream-p two) (output-stream-p in) (interactive-stream-p a)))))

;; sequences of characters
;;; 229
(answer 229 (let ((in (make-string-input-stream "abcdef")) (text (make-string 4 :initial-element #\-)) (list (list 1 2 3))
                  (out (make-string-output-stream)))
              (list (read-sequence text in :start 1 :end 3) text (read-sequence list in) list (read-sequence text in) text
                    (write-sequence "hello" out :start 1) (write-sequence '(#\a #\b) out) (get-output-stream-string out)
                    (stream-element-type in))))

;; names of files
;;; 230
(answer 230 (flet ((parts (name) (list (pathname-directory name) (pathname-name name) (pathname-type name))))
              (list (parts "/a/b/c.d.txt") (parts "x") (parts "a/b/") (parts ".hidden") (parts "/")
                    (namestring (make-pathname :directory '(:relative "a") :name "b" :type "c"))
                    (namestring (make-pathname :name "n" :defaults "/d/e.f"))
                    (namestring (merge-pathnames "b" "/c/d.e")) (namestring (merge-pathnames "x/y.z" "/c/d.e"))
                    (file-namestring "/a/b.c") (directory-namestring "/a/b.c") (namestring (pathname "q.r"))
                    (pathnamep #P"a") (pathnamep "a") (namestring (parse-namestring "p/q"))
                    (if (wild-pathname-p "*.c") t nil) (wild-pathname-p "a.c") (prin1-to-string #P"a/b"))))

;; literals made when they are read
;;; 231
(defstruct point231 (x 1) y)
(answer 231 (list '(#.(+ 1 2) #.(list 'a)) (let ((*print-circle* t)) (prin1-to-string '#1=(a . #1#)))
                  (point231-y (read-from-string "#S(point231 :y 5)")) (read-from-string "#*0101")
                  (handler-case (let ((*read-eval* nil)) (read-from-string "#.1")) (reader-error () :refused))
                  (let ((*read-suppress* t)) (read-from-string "(a b)"))
                  (read-from-string "#C(1 2)") (namestring (read-from-string "#P\"x\""))
                  (let ((*features* (cons :feature231 *features*))) (read-from-string "(#+feature231 a #-feature231 b)"))))

;; readtables
;;; 232
(answer 232 (let ((*readtable* (copy-readtable nil)))
              (set-macro-character #\[ (lambda (stream character) (declare (ignore character)) (cons :list (read-delimited-list #\] stream t))))
              (set-macro-character #\] (get-macro-character #\)))
              (set-macro-character #\! (lambda (stream character) (declare (ignore stream character)) (values)) t)
              (set-dispatch-macro-character #\# #\z (lambda (stream sub number) (declare (ignore sub)) (list number (read stream t nil t))))
              (make-dispatch-macro-character #\$)
              (set-dispatch-macro-character #\$ #\v (lambda (stream sub number) (declare (ignore stream number)) sub))
              (set-syntax-from-char #\% #\;)
              (list (read-from-string "(a [b [c] \"s\"] !d e!f #7z(g) $v % h
                                        i)")
                    (readtablep *readtable*) (readtable-case *readtable*) (nth-value 1 (get-macro-character #\!))
                    (if (get-dispatch-macro-character #\# #\z) t nil)
                    (mapcar (lambda (case) (setf (readtable-case *readtable*) case)
                              (symbol-name (read-from-string "aBc|d|")))
                            '(:upcase :downcase :preserve :invert)))))

;; methods combined by an operator, most specific first
;;; 233
(progn (defclass x233 () ()) (defclass y233 () ()) (defclass z233 (x233 y233) ()) (defclass w233 (y233) ()) (defclass v233 (z233 w233) ())
(defgeneric who233 (o) (:method-combination list))
(defmethod who233 list ((o x233)) 'x) (defmethod who233 list ((o y233)) 'y) (defmethod who233 list ((o z233)) 'z) (defmethod who233 list ((o w233)) 'w) (defmethod who233 list ((o v233)) 'v)
(answer 233 (who233 (make-instance 'v233))))

;; the order of methods for two arguments
;;; 234
(progn (defgeneric h234 (a b)) 
(defmethod h234 ((a integer) (b integer)) (list :ii (call-next-method)))
(defmethod h234 ((a number) (b integer)) (list :ni (next-method-p)))
(defmethod h234 ((a integer) b) (list :it (call-next-method a b)))
(defmethod h234 (a b) :tt)
(defmethod h234 :around ((a integer) b) (list :around (call-next-method)))
(defmethod h234 :before (a (b integer)) (princ "before "))
(defmethod h234 :after (a b) (princ "after "))
(answer 234 (list (h234 1 2) (h234 1.5 2) (h234 1 'a) (h234 'a 'b))))

;; structures that print themselves
;;; 235
(progn (defstruct p235 a b) (defmethod print-object ((o p235) s) (print-unreadable-object (o s :type t) (princ (p235-a o) s)))
(answer 235 (list (make-p235 :a 1) (princ-to-string (make-p235 :a "x")))))

;; slots that stay, come and go with CHANGE-CLASS
;;; 236
(progn (defclass d236 () ((a :initarg :a :initform 1) (b :initarg :b))) (defclass e236 () ((b :initform 7) (c :initarg :c :initform 8)))
(answer 236 (let* ((d (make-instance 'd236 :b 2)) (r (change-class d 'e236 :c 5))) (list (eq d r) (slot-value d 'b) (slot-value d 'c) (slot-exists-p d 'a) (class-name (class-of d))))))

;; shared parts of literals
;;; 237
(answer 237 (let ((*print-circle* t) (l '#1=(a . #1#)) (m '(#2=(1 2) #2# #3=#(#3#)))) (list (eq l (cdr l)) (eq (first m) (second m)) (prin1-to-string l) (prin1-to-string m))))

;; shared strings that are read
;;; 238
(answer 238 (let ((*print-circle* t)) (prin1-to-string (read-from-string "(#1=\"ab\" #1# #2=(x #2#) . #1#)"))))

;; bit vectors that are read
;;; 239
(answer 239 (list (read-from-string "#*") #*10110 (length #*) (read-from-string "#6*101") (bit #*10 1) (handler-case (read-from-string "#2*101") (reader-error () 'bad))))

;; where operations on bits leave their result
;;; 240
(answer 240 (let ((r (make-array 4 :element-type 'bit :initial-element 0))) (list (bit-and #*1100 #*1010 r) r (bit-ior #*1100 #*1010 t) (handler-case (bit-and #*1 #*10) (error () 'differ)) (eq (bit-not r r) r) r)))

;; bits of two dimensions
;;; 241
(answer 241 (let ((b (make-array '(2 3) :element-type 'bit :initial-element 1))) (setf (aref b 1 1) 0) (list b (bit-not b) (row-major-aref b 4) (array-total-size b) (array-dimensions b))))

;; fill pointers
;;; 242
(answer 242 (let ((v (make-array 3 :adjustable t :fill-pointer 0 :initial-contents '(a b c)))) (list v (vector-push 'x v) (vector-push 'y v) (vector-push 'z v) (vector-push 'w v) (vector-push-extend 'q v 10) v (vector-pop v) (setf (fill-pointer v) 1) v (length v) (array-dimension v 0) (aref v 2))))

;; an array that is adjusted
;;; 243
(answer 243 (let* ((a (make-array '(2 3) :adjustable t :initial-contents '((1 2 3) (4 5 6)))) (b (adjust-array a '(3 2) :initial-element 0))) (list (eq a b) b a)))

;; parts of sequences that are read
;;; 244
(answer 244 (let ((v (vector 0 0 0 0 0)) (l (list 0 0 0))) (with-input-from-string (s "abcdefgh") (list (read-sequence v s :start 1 :end 3) v (read-sequence l s :start 1) l (read-sequence v s) v (read-sequence v s)))))

;; parts of sequences that are written
;;; 245
(answer 245 (with-output-to-string (s) (write-sequence "hello" s :start 1 :end 3) (write-sequence (list #\x #\y) s) (write-sequence (vector #\p #\q #\r) s :end 2) (write-sequence "" s)))

;; broadcast streams
;;; 246
(answer 246 (let* ((a (make-string-output-stream)) (b (make-broadcast-stream)) (s (make-broadcast-stream a b))) (print 1 s) (fresh-line s) (terpri s) (write-char #\x s) (list (get-output-stream-string a) (write-line "gone" b) (broadcast-stream-streams b) (input-stream-p s) (output-stream-p s) (open-stream-p s) (progn (close s) (open-stream-p a)))))

;; concatenated streams, as far as they are read
;;; 247
(answer 247 (let ((s (make-concatenated-stream (make-string-input-stream "ab") (make-string-input-stream "") (make-string-input-stream (format nil "c~%d"))))) (list (read-char s) (peek-char nil s) (read-line s) (length (concatenated-stream-streams s)) (read-char s) (read-char s nil :eof) (read-line s nil :eof) (concatenated-stream-streams s))))

;; two-way streams
;;; 248
(answer 248 (let* ((o (make-string-output-stream)) (s (make-two-way-stream (make-string-input-stream "1 2") o))) (format s "~a" (+ (read s) (read s))) (list (get-output-stream-string o) (read s nil 'end) (input-stream-p s) (output-stream-p s))))

;; names merged with defaults
;;; 249
(answer 249 (mapcar #'namestring (list (merge-pathnames "a" "/b/c.d") (merge-pathnames "a/" "/b/c.d") (merge-pathnames "../x" "/b/c/d.e") (merge-pathnames "/a/b" "/c/d.e") (merge-pathnames "" "/b/c.d") (merge-pathnames "a.b" "c/") (merge-pathnames "x/y" "z/w.v") (merge-pathnames (make-pathname :type "q") "/a/b.c"))))

;; places behind symbols
;;; 250
(answer 250 (let ((x (list 1 2))) (symbol-macrolet ((a (car x)) (b (cadr x))) (list (setf a 10) (incf b 5) (multiple-value-setq (a b) (values 3 4)) x (let ((a 99)) (setq a 1) a) x (psetq a 7 b a) x (push 1 b) x))))

;; keys and rest of a local macro
;;; 251
(answer 251 (macrolet ((m (a &optional (b a) &rest c &key k &allow-other-keys) `'(,a ,b ,c ,k))) (list (m 1) (m 1 2) (m 1 2 :k 3) (m 1 2 :k 3 :l 4))))

;; local macros and functions around each other
;;; 252
(answer 252 (macrolet ((f (x) `(* 2 ,x))) (flet ((g (y) (f y))) (macrolet ((f (x) `(+ 1 ,x))) (list (g 4) (f 4) (flet ((f (x) (- x))) (f 4)))))))

;; a destructured macro
;;; 253
(answer 253 (macrolet ((m ((a (b &key c) . d) e) `'(,a ,b ,c ,d ,e))) (m (1 (2 :c 3) 4 5) 6)))

;; arrays that are equal
;;; 254
(answer 254 (list (equalp #2A((1 2)) #2A((1.0 2))) (equalp "aB" "Ab") (equalp #(1 2) (make-array 2 :fill-pointer 2 :adjustable t :initial-contents '(1 2))) (equal #*101 #*101) (equalp #*101 #(1 0 1)) (equal "a" (make-array 1 :element-type 'character :initial-element #\a :fill-pointer 1))))

;; INITIALIZE-INSTANCE around
;;; 255
(progn (defclass m255 () ((v :initform 0 :accessor m255-v))) (defmethod initialize-instance :around ((m m255) &rest args &key (twice nil) &allow-other-keys) (let ((r (call-next-method))) (setf (m255-v m) (list twice (length args))) r))
(answer 255 (m255-v (make-instance 'm255 :twice t))))

;; keys of methods
;;; 256
(progn (defgeneric k256 (x &key a) (:method ((x integer) &key a b) (list x a b)) (:method ((x t) &key a (c 1)) (list x a c)))
(answer 256 (list (k256 1 :a 2 :b 3) (k256 'x :c 4) (handler-case (k256 1 :zz 3) (error () 'unknown-key)) (k256 1 :c 5))))

;; EQL methods, and classes of the language
;;; 257
(progn (defgeneric e257 (x)) (defmethod e257 ((x (eql 5))) (list 'five (call-next-method))) (defmethod e257 ((x integer)) 'int) (defmethod e257 ((x (eql 'a))) 'sym-a) (defmethod e257 ((x null)) 'null) (defmethod e257 ((x list)) 'list) (defmethod e257 ((x sequence)) 'seq) (defmethod e257 ((x string)) (list 'str (call-next-method)))
(answer 257 (list (e257 5) (e257 6) (e257 'a) (e257 nil) (e257 '(1)) (e257 #(1)) (e257 "s") (handler-case (e257 #\a) (error () 'none)))))

;; the position in a string that is gathered
;;; 258
(answer 258 (let ((s (make-string-output-stream))) (write-string "abc" s) (list (file-position s) (get-output-stream-string s) (get-output-stream-string s))))

;; constructors by position
;;; 259
(progn (defstruct (q259 (:constructor mk259 (a &optional (b 2) &aux (c (+ a b)))) (:copier nil) (:predicate q259?) (:conc-name q-)) a b c)
(answer 259 (list (mk259 1) (q-c (mk259 1 5)) (q259? 1) (fboundp 'copy-q259))))

;; indexes of arrays
;;; 260
(answer 260 (list (svref #(1 2) 1) (handler-case (svref "ab" 0) (type-error () 'te)) (schar "ab" 0) (sbit #*01 1) (row-major-aref #2A((1 2) (3 4)) 2) (array-row-major-index #2A((1 2) (3 4)) 1 1) (array-in-bounds-p #(1 2) 2) (handler-case (aref #2A((1)) 0) (error () 'rank))))

;; restarts that belong to a condition
;;; 261
(answer 261 (let ((a (make-condition 'simple-error)) (b (make-condition 'simple-error))) (flet ((use (c) (restart-case (with-condition-restarts a (list (first (compute-restarts))) (use-value 1 c) 'none) (use-value (v) (list 'used v))))) (list (use a) (use nil) (use b)))))

;; ... also where a macro signals it
;;; 262
(answer 262 (macrolet ((oops (text) `(error ,text))) (handler-bind ((error (lambda (c) (invoke-restart (find-restart 'again c))))) (restart-case (handler-bind ((error (lambda (c) (declare (ignore c)) (error "another")))) (restart-case (oops "one") (again () 'inner))) (again () 'outer)))))

;; arguments of an interactive restart
;;; 263
(answer 263 (restart-case (invoke-restart-interactively 'give) (give (a b) :interactive (lambda () (list 1 2)) (list b a))))

;; T and OTHERWISE are keys of ECASE
;;; 264
(answer 264 (list (ecase t (t 1)) (handler-case (ecase 2 (t 1)) (type-error () 'te)) (handler-case (ecase 2 (otherwise 1)) (type-error () 'te))))

;; T is a type like any other
;;; 265
(answer 265 (list (typecase 'a (t 1) (symbol 2)) (etypecase 1 (symbol 1) (t 2))))

;; classes are types
;;; 266
(answer 266 (list (typep 1 (find-class 'integer)) (typep 'a (find-class 'integer)) (multiple-value-list (subtypep (find-class 'integer) 'number)) (coerce '(1 2) (find-class 'vector))))

;; functions (SETF symbol) of uninterned symbols
;;; 267
(answer 267 (let* ((s (make-symbol "G")) (n (list 'setf s))) (setf (fdefinition n) (lambda (v c) (rplaca c v) v)) (list (if (fboundp n) t nil) (fboundp s) (eval `(let ((c (list 1))) (list (setf (,s c) 2) c))))))

;; names that are none of functions
;;; 268
(answer 268 (list (handler-case (fboundp '(setf a b)) (type-error () 'te)) (handler-case (fboundp '(setf a . b)) (type-error () 'te)) (handler-case (fboundp 1) (type-error () 'te))))

;; floats with contents
;;; 269
(answer 269 (list (make-array 2 :element-type 'double-float :initial-contents '(1.0d0 2.0d0)) (make-array 2 :element-type 'double-float)))

;; types of sequences with a size
;;; 270
(answer 270 (list (map '(base-string 2) #'identity '(#\a #\b)) (handler-case (make-sequence 'cons 0) (type-error () 'te)) (handler-case (coerce #() 'cons) (error () 'error))))

;; methods agree with their generic function
;;; 271
(progn (defgeneric g271 (x &key a)) (answer 271 (mapcar (lambda (m) (handler-case (progn (eval m) 'taken) (error () 'refused))) '((defmethod g271 ((x integer)) x) (defmethod g271 ((x integer) &key b) b) (defmethod g271 ((x integer) &key a b) (list a b)) (defmethod g271 ((x string) &rest r) r)))))

;; the order in which parameters take precedence
;;; 272
(progn (defgeneric g272 (x y) (:argument-precedence-order y x) (:method ((x integer) (y t)) 1) (:method ((x t) (y integer)) 2)) (answer 272 (list (g272 1 1) (g272 1 'a) (typep #'g272 'generic-function))))

;; readers of several conditions
;;; 273
(progn (define-condition c273 (error) ((a :initarg :a :reader r273))) (define-condition d273 (error) ((b :initarg :b :reader r273))) (answer 273 (list (r273 (make-condition 'c273 :a 1)) (r273 (make-condition 'd273 :b 2)))))

;; the third value is a name or nothing
;;; 274
(answer 274 (list (length (multiple-value-list (function-lambda-expression (lambda (x) x)))) (handler-case (function-lambda-expression 1) (error () 'error))))

;; blocks around expanders
;;; 275
(progn (defsetf p275 (l) (v) (return-from p275 `(setf (car ,l) ,v))) (answer 275 (let ((l (list 1))) (setf (p275 l) 2) l)))

;; of floats in LOOP, and IT
;;; 276
(answer 276 (list (loop for x in nil sum x of-type double-float) (loop for x in '(1 2) count (oddp x) of-type fixnum) (let ((it 'z)) (loop for x in '(a) when x collect it and collect it))))

;; a class gets another name
;;; 277
(progn (defclass c277 () ((a :initform 1))) (answer 277 (let ((one (make-instance 'c277))) (setf (find-class 'd277) (find-class 'c277)) (list (typep one 'd277) (progn (setf (find-class 'c277) nil) (find-class 'c277 nil)) (slot-value (make-instance 'd277) 'a)))))

;; values of a list that is none
;;; 278
(answer 278 (list (handler-case (values-list '(1 . 2)) (type-error (c) (type-error-datum c))) (handler-case (boole boole-1 nil 1) (type-error () 'te))))
