;;;; Made from `grammar.txt` with the seed 1997: change the grammar, not this file.

;;; 1
(answer 1 -7)

;;; 2
(answer 2 4611686018427387903)

;;; 3
(answer 3 (- (* (* -7/3 -7/3) 0) (+ (+ 1/2 1/2 22/7) 1/2 22/7)))

;;; 4
(answer 4 0.0)

;;; 5
(answer 5 (copy-seq "fresh"))

;;; 6
(answer 6 (copy-seq (remove #\a (format nil "a~10tb~5@tc~%~2,4td" ))))

;;; 7
(answer 7 (list 3 1 2))

;;; 8
(answer 8 (list 1 2 2 1))

;;; 9
(answer 9 (copy-list (rest (list 4611686018427387903 1000003 (rem 1000003 7)))))

;;; 10
(answer 10 (vector 4 3 2 1))

;;; 11
(answer 11 (copy-seq #()))

;;; 12
(answer 12 (reverse (copy-list '(1 2 3 4 5))))

;;; 13
(answer 13 #())

;;; 14
(answer 14 (copy-list '(1 2 3 4 5)))

;;; 15
(answer 15 (copy-seq #(1 2 3)))

;;; 16
(answer 16 (numerator (integer-length 0)))

;;; 17
(answer 17 nil)

;;; 18
(answer 18 (format nil "a~10tb~5@tc~%~2,4td" ))

;;; 19
(answer 19 0.1)

;;; 20
(answer 20 (list 12 (dpb (mod -7 7) (byte 3 3) (ash (gcd) 5)) 12))

;;; 21
(answer 21 #\Z)

;;; 22
(answer 22 #(1 2 3))

;;; 23
(answer 23 t)

;;; 24
(answer 24 (1+ (1+ (signum (gcd)))))

;;; 25
(answer 25 (1- (- -100000000000000000000 (- (isqrt (abs -100000000000000000000)) (* 1 1)))))

;;; 26
(answer 26 (abs 255))

;;; 27
(answer 27 (signum (integer-length -7)))

;;; 28
(answer 28 (lognot 1))

;;; 29
(answer 29 (integer-length (dpb (logcount (1- 255)) (byte 1 3) (* 4611686018427387903 (ash 4611686018427387903 2)))))

;;; 30
(answer 30 (logcount (logior (numerator 1/2) (mod 1 1))))

;;; 31
(answer 31 (isqrt (abs 255)))

;;; 32
(answer 32 (numerator (+ (* 22/7 (- 22/7 -7/3)) (- 1/2 22/7) -7/3)))

;;; 33
(answer 33 (denominator (* (- (* 22/7 -7/3) 22/7) 1/2)))

;;; 34
(answer 34 (list (float 0) (float -2.25) (float 1000003 1.0)))

;;; 35
(answer 35 (rational -2.25))

;;; 36
(answer 36 (rationalize 1.5))

;;; 37
(answer 37 (list (numberp (let ((v (vector 1 2 3)) (i 0)) (incf (aref v (incf i)) (ash 255 (- 5))) (decf (aref v i)) (list v i))) (realp (let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) (11) . 12) ((13) . 14) 15 16))) (list (caaaar x) (caaadr x) (caadar x) (caaddr x) (cadaar x) (cadadr x) (caddar x) (cadddr x)))) (rationalp (+)) (integerp (- (+ 1/2 (/ (*) (+))))) (floatp (rem (+ 0.1 (expt 3 (- 1))) -3)) (complexp (/ (/ (/ (+)) (*))))))

;;; 38
(answer 38 (list (evenp (ldb (byte 2 0) (logxor (ldb (byte 1 2) -100000000000000000000) (logand 12 12) 0))) (oddp (denominator (- -7/3 (+ 22/7 1/2 -7/3)))) (zerop (mod (expt 2 (- 0)) -3)) (plusp (- (rem (expt 1.5 0) -3) (mod (+) -3))) (minusp 1000003)))

;;; 39
(answer 39 (sqrt 2.0))

;;; 40
(answer 40 (list (sqrt 16) (sqrt 2) (exp -0.25) (log 10.0) (log 8 2) (exp 0)))

;;; 41
(answer 41 (list (sin -0.25) (cos 1.0) (tan 0.5) (asin 0.5) (acos 0.5) (atan 1.0e10) (atan 1 -1)))

;;; 42
(answer 42 (list (sinh 1.0) (cosh -0.25) (tanh 1.0) (asinh 1.0) (acosh 1.5) (atanh 0.25)))

;;; 43
(answer 43 (list (< (abs (- pi 3.141592653589793)) 1.0e-15)))

;;; 44
(answer 44 (+ (rationalize 0.0) (min (*) (min (expt 1.0e10 2) (*)))))

;;; 45
(answer 45 (- (/ (lognot (+ (gcd) 0)) 7) (* (- (+)) (rational (sqrt 2.0)))))

;;; 46
(answer 46 (* (/ 12 3) (list (float (logxor (lcm -100000000000000000000 (gcd)) (gcd 4611686018427387903 -100000000000000000000) (gcd))) (float 3.0e-5) (float (- (abs -7) (1+ -100000000000000000000)) 1.0))))

;;; 47
(answer 47 (+))

;;; 48
(answer 48 (*))

;;; 49
(answer 49 (- (*)))

;;; 50
(answer 50 (/ (isqrt (abs (lognot -7))) 3))

;;; 51
(answer 51 (/ (*) (max (expt (+ -7/3 -7/3 1/2) 1) (+) (+))))

;;; 52
(answer 52 (/ (min (list (float (denominator 1/2)) (float 0.0) (float (gcd) 1.0)) (* 1 (- (*) (*))))))

;;; 53
(answer 53 (+ (mod 1 1) (- -7/3 22/7) 22/7))

;;; 54
(answer 54 (* 1/2 (1- (ash 0 1))))

;;; 55
(answer 55 (- 22/7 (rem (logxor 255 -7 12) 3)))

;;; 56
(answer 56 (+ (ash 255 (- 0)) (logior (rem (gcd 1000003 (gcd)) 2) -100000000000000000000)))

;;; 57
(answer 57 (* (signum (abs -7)) 12))

;;; 58
(answer 58 (- (dpb (logand (+ 0 255) (ash 4611686018427387903 (- 2))) (byte 2 5) 1000003) -100000000000000000000))

;;; 59
(answer 59 (max 1.5 (*) (+)))

;;; 60
(answer 60 (min (*) (+)))

;;; 61
(answer 61 (expt 22/7 3))

;;; 62
(answer 62 (expt 7 (- 5)))

;;; 63
(answer 63 (expt -2.25 2))

;;; 64
(answer 64 (gcd (logior (logcount 4611686018427387903) (ldb (byte 3 0) 1000003)) 4611686018427387903))

;;; 65
(answer 65 (lcm (dpb 0 (byte 1 5) (numerator (* 1/2 -7/3))) (isqrt (abs 1000003))))

;;; 66
(answer 66 (gcd))

;;; 67
(answer 67 (list (multiple-value-list (floor 1.0e10 1)) (multiple-value-list (ceiling (/ (expt 7 (- 3))) 2))))

;;; 68
(answer 68 (list (multiple-value-list (truncate (mod (*) -3) 3)) (multiple-value-list (round (- (/ 1 1)) 7))))

;;; 69
(answer 69 (list (multiple-value-list (floor 22/7)) (multiple-value-list (round (* (+ (+ -7/3 22/7 -7/3) (- -7/3 1/2) 0) 22/7))) (multiple-value-list (ceiling (+ 1000003 (* 4611686018427387903 255) 1/2))) (multiple-value-list (truncate (+ (denominator -7/3) (* -7/3 (- 22/7 1/2)) (* (+ -7/3 1/2 22/7) -7/3))))))

;;; 70
(answer 70 (list (multiple-value-list (floor (integer-length (signum 255)) -100000000000000000000)) (multiple-value-list (truncate 1 12))))

;;; 71
(answer 71 (list (multiple-value-list (ffloor 3.0e-5 2.0)) (multiple-value-list (fceiling 3.0e-5)) (multiple-value-list (ftruncate 1.0e10)) (multiple-value-list (fround 3.0e-5))))

;;; 72
(answer 72 (mod -7 2))

;;; 73
(answer 73 (rem (logxor 0 1 255) 2))

;;; 74
(answer 74 (mod (+) -3))

;;; 75
(answer 75 (rem (expt (sqrt 2.0) 1) -3))

;;; 76
(answer 76 (list (= (+ (* (rem (*) -3) (- (+) (*))) (+)) (list (float (logior (abs 12) (lcm 12 1000003))) (float 0.1) (float (gcd (lcm 1 4611686018427387903) (ash -100000000000000000000 (- 3))) 1.0))) (/= (+) (rational -2.25) (+)) (< 1/2 (rational (sqrt 2.0))) (> (* -7/3 1/2) (*)) (<= (expt (gcd) 5) (+) (max (rationalize 3.0e-5) (min (/ (+)) (/ -7 1)) 1)) (>= (*) (expt -2.25 1))))

;;; 77
(answer 77 (= (/ (+ (+) (/ (*) (*))) (rational 1.0e10)) (rem 1/2 -3) (+)))

;;; 78
(answer 78 (ash 4611686018427387903 3))

;;; 79
(answer 79 (ash (logand 255 (logand (logand 1000003 -7) -100000000000000000000)) (- 2)))

;;; 80
(answer 80 (logand (1- (- (isqrt (abs 12)) (1+ -7))) (logior (logcount (lognot 0)) (rem (gcd) 7))))

;;; 81
(answer 81 (logior (mod 0 7) (lognot (gcd))))

;;; 82
(answer 82 (logxor 1 (signum (dpb (ash 12 0) (byte 7 2) (ldb (byte 2 1) 0))) (integer-length 12)))

;;; 83
(answer 83 (list (logandc1 -100000000000000000000 (logcount (denominator (- 22/7 22/7)))) (logandc2 (numerator 1/2) (1- 1)) (logeqv 255 -100000000000000000000) (lognand (gcd -7 (+ (lognot 1000003) (gcd 4611686018427387903 4611686018427387903))) 255)))

;;; 84
(answer 84 (list (lognor -7 (gcd)) (logorc1 (abs (signum (denominator -7/3))) (1- (ash (mod (gcd) 3) 2))) (logorc2 4611686018427387903 (rem 12 7))))

;;; 85
(answer 85 (list (logbitp 1 (dpb -100000000000000000000 (byte 1 1) (* (numerator -7/3) (integer-length 1000003)))) (logtest (1+ 12) 4611686018427387903)))

;;; 86
(answer 86 (ldb (byte 2 0) (- 255 (+ (ash -7 (- 5)) (ldb (byte 3 5) 1)))))

;;; 87
(answer 87 (dpb -7 (byte 1 3) (* 1000003 (logcount (logxor 255 1 -100000000000000000000)))))

;;; 88
(answer 88 (let ((spec (byte 7 5))) (list (byte-size spec) (byte-position spec) (ldb-test spec (abs 1000003)) (mask-field spec (1+ (+ (lcm (gcd) (gcd)) (- 0 12)))) (deposit-field 1000003 spec (lognot (gcd))))))

;;; 89
(answer 89 (let ((n 4611686018427387903)) (setf (ldb (byte 3 2) n) -7) (setf (mask-field (byte 2 0) n) (logcount -100000000000000000000)) n))

;;; 90
(answer 90 (list (boole boole-1 255 (1- (isqrt (abs (logior 0 -7))))) (boole boole-2 -100000000000000000000 (rem (logxor (ldb (byte 1 2) 0) (* 1 1000003) -7) 3)) (boole boole-and (+ (numerator (+ 1/2 22/7 22/7)) (lcm 1 4611686018427387903)) (ldb (byte 3 0) (ash (logior 4611686018427387903 1) (- 1)))) (boole boole-ior 1000003 (signum (numerator 1/2))) (boole boole-xor (abs -100000000000000000000) (logcount (isqrt (abs (ash 12 (- 3)))))) (boole boole-eqv (logand (- (lognot 255) (mod (gcd) 1)) (gcd (abs 0) (logxor 0 12 1))) (denominator (- 1000003 22/7))) (boole boole-nand -7 (lcm (logand 4611686018427387903 (+ 255 0)) (integer-length -100000000000000000000))) (boole boole-nor (dpb 255 (byte 2 2) (1- (gcd))) 255)))

;;; 91
(answer 91 (list (boole boole-andc1 0 (ash (signum (ash (gcd) 5)) 3)) (boole boole-andc2 (lcm (isqrt (abs 1)) 12) (* (rem -100000000000000000000 7) (denominator (- 1/2 -7/3)))) (boole boole-orc1 (gcd (1+ (+ 4611686018427387903 1)) (denominator 22/7)) 0) (boole boole-orc2 (1+ 1000003) (ash 1000003 (- 3))) (boole boole-c1 (gcd) (mod (gcd) 3)) (boole boole-c2 (1+ (* (dpb 255 (byte 1 0) 12) (logxor -7 (gcd) 1))) -7) (boole boole-clr (integer-length (lcm (lcm 12 -7) (numerator -7/3))) 1000003) (boole boole-set (dpb 4611686018427387903 (byte 2 3) (* 255 (logand 4611686018427387903 -100000000000000000000))) 4611686018427387903)))

;;; 92
(answer 92 (multiple-value-list (decode-float 0.0)))

;;; 93
(answer 93 (multiple-value-list (integer-decode-float (sqrt 2.0))))

;;; 94
(answer 94 (list (scale-float 1.5 2) (float-radix 1.5) (float-sign 0.1) (float-sign 0.1 2.0) (float-digits 1.5) (float-precision 1.0e10)))

;;; 95
(answer 95 (list most-positive-double-float (< -1.0e-300 least-negative-double-float 0 least-positive-double-float 1.0e-300) most-negative-double-float double-float-epsilon double-float-negative-epsilon))

;;; 96
(answer 96 (list most-positive-single-float most-positive-short-float most-positive-long-float most-negative-single-float most-negative-short-float most-negative-long-float))

;;; 97
(answer 97 (list single-float-epsilon short-float-epsilon long-float-epsilon single-float-negative-epsilon short-float-negative-epsilon long-float-negative-epsilon))

;;; 98
(answer 98 (= least-positive-single-float least-positive-short-float least-positive-long-float (- least-negative-single-float) (- least-negative-short-float) (- least-negative-long-float)))

;;; 99
(answer 99 (list least-positive-normalized-single-float least-positive-normalized-short-float least-positive-normalized-long-float least-negative-normalized-single-float least-negative-normalized-short-float least-negative-normalized-long-float))

;;; 100
(answer 100 (progn (pprint '(5 -5 5)) 'pretty))

;;; 101
(answer 101 (list least-positive-normalized-double-float least-negative-normalized-double-float))

;;; 102
(answer 102 (list (< most-positive-fixnum (expt 2 62)) (> most-negative-fixnum (- (expt 2 63)))))

;;; 103
(answer 103 (list (let ((s (make-random-state t))) (random-state-p s)) (random-state-p *random-state*) (< -1 (random 10) 10) (< (random 1.0) 1.0)))

;;; 104
(answer 104 (let* ((a (make-random-state t)) (b (make-random-state a))) (equal (list (random 1000 a) (random 1000 a)) (list (random 1000 b) (random 1000 b)))))

;;; 105
(answer 105 (multiple-value-list (parse-integer "42")))

;;; 106
(answer 106 (list (parse-integer "ff" :radix 16) (parse-integer " 12 x" :junk-allowed t) (parse-integer "a12b" :start 1 :end 3)))

;;; 107
(answer 107 (parse-integer "1x2"))

;;; 108
(answer 108 (prin1-to-string (*)))

;;; 109
(answer 109 (princ-to-string (with-output-to-string (s) (write-string (string-right-trim "dcy" (format nil "~[zero~;one~:;many~]|~:[no~;yes~]|~@[x=~a~]" 0 nil nil)) s) (write-char (char-upcase (char-downcase #\a)) s) (terpri s) (prin1 (handler-case (car (handler-case (symbol-value 'nothing109) (unbound-variable (c) (cell-error-name c)))) (type-error () 'type-error) (:no-error (x) (list x))) s) (princ (let ((s (make-symbol "S"))) (set s (loop for i from 1 to 0 append (list i i))) (setf (get s 'p) (list (multiple-value-list (decode-universal-time 3600000000 0)) (encode-universal-time 5 4 3 2 1 2001 0))) (setf (symbol-function s) (constantly 1000003)) (list (symbol-value s) (get s 'p) (get s 'q 'none) (funcall s (- 255 (gcd))) (if (remprop s 'p) t) (get s 'p) (if (fboundp s) t) (progn (makunbound s) (boundp s)) (progn (fmakunbound s) (fboundp s)))) s) (print (let ((l '(1 2 3 4 5 6 7 8 9 10 11))) (list (sixth l) (seventh l) (eighth l) (ninth l) (tenth l))) s) (fresh-line s) (write-line (string ':key) s) (write (stable-sort (list '(1 . a) '(0 . b) '(1 . c) '(0 . d)) #'< :key #'car) :stream s))))

;;; 110
(answer 110 (write-to-string (*) :base 8))

;;; 111
(answer 111 (write-to-string (let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) 11 . 12) (13 . 14) 15 16))) (list (caar x) (cadr x) (cdar x) (cddr x) (caaar x) (caadr x) (cadar x) (caddr x) (cdaar x) (cdadr x) (cddar x) (cdddr x))) :escape nil))

;;; 112
(answer 112 (let ((*print-base* 2) (*print-radix* t)) (prin1-to-string (rem (signum (logior 1 0)) 2))))

;;; 113
(answer 113 (let ((*print-length* 2) (*print-level* 1)) (prin1-to-string '(1 (2 (3)) 4 5))))

;;; 114
(answer 114 (let ((*print-case* :downcase) (*print-escape* nil)) (write-to-string '(Foo "x" |Bar|))))

;;; 115
(answer 115 (let ((*print-array* nil) (*print-gensym* nil)) (write-to-string (make-symbol "X"))))

;;; 116
(answer 116 (let ((*print-circle* nil) (*print-readably* nil) (*print-pretty* nil)) (write-to-string '((1 . 2) 3))))

;;; 117
(answer 117 (char-upcase (char-downcase (code-char (+ 65 1)))))

;;; 118
(answer 118 (char-downcase (char-upcase (code-char (+ 65 5)))))

;;; 119
(answer 119 (code-char (+ 65 1)))

;;; 120
(answer 120 (list (char-code #\5) (char-int (char-downcase #\-)) (char-name #\Newline) (name-char "space") (digit-char 1) (digit-char 11 16) (digit-char-p (char-downcase #\Space)) (digit-char-p #\f 16)))

;;; 121
(answer 121 (list (alpha-char-p (code-char (+ 65 5))) (alphanumericp #\Z) (graphic-char-p (char-upcase #\-)) (upper-case-p #\a) (lower-case-p (char-downcase (char-upcase #\Space))) (both-case-p (char-upcase #\Space)) (characterp (multiple-value-bind (v c) (ignore-errors (error 'simple-error :format-control "x ~a" :format-arguments '(1))) (list v (simple-condition-format-control c) (simple-condition-format-arguments c)))) (standard-char-p (code-char (+ 65 3)))))

;;; 122
(answer 122 (list (char= (code-char (+ 65 1)) #\Z) (char/= (code-char (+ 65 0)) (code-char (+ 65 0))) (char< (char-downcase (char-downcase (char-upcase #\-))) (code-char (+ 65 3)) #\5) (char> (char-downcase (char-upcase (char-upcase #\-))) (char-upcase (char-upcase (char-downcase #\Z)))) (char<= (char-downcase (code-char (+ 65 5))) #\5) (char>= #\Space (char-upcase (code-char (+ 65 2))))))

;;; 123
(answer 123 (list (char-equal (char-upcase (char-downcase (char-downcase #\5))) #\a) (char-not-equal (code-char (+ 65 1)) #\Z) (char-lessp (code-char (+ 65 2)) (code-char (+ 65 3))) (char-greaterp #\Z #\a) (char-not-greaterp (char-upcase (char-upcase #\5)) (char-downcase #\5)) (char-not-lessp (code-char (+ 65 1)) #\a)))

;;; 124
(answer 124 (list (character 'x) (character "y") (character (char-upcase (char-downcase (code-char (+ 65 0))))) (< 1000 char-code-limit)))

;;; 125
(answer 125 (string-upcase (let ((*print-case* :downcase) (*print-escape* nil)) (write-to-string '(Foo "x" |Bar|)))))

;;; 126
(answer 126 (string-downcase (string-trim "a Z" (princ-to-string (list (multiple-value-list (decode-universal-time 3600000000 0)) (encode-universal-time 5 4 3 2 1 2001 0)))) :start 1))

;;; 127
(answer 127 (string-capitalize (format nil "~c|~:c|~@c|~?|~%~&~~|~|" #\Space (char-downcase (code-char (+ 65 2))) (char-upcase (char-downcase #\-)) "~a-~a" (list (elt (remove-duplicates (remove-if-not #'oddp (remove 0 (remove-duplicates (delete-if-not #'plusp (vector 4 3 2 1))))) :from-end t) 2) (list (let ((s (make-random-state t))) (random-state-p s)) (random-state-p *random-state*) (< -1 (random 10) 10) (< (random 1.0) 1.0))))))

;;; 128
(answer 128 (nstring-upcase (copy-seq (format nil "~f|~,2f|~8,3f|~e|~,3e|~$|~g" 1.0 0.5 0.5 -0.25 -0.25 1.0 -0.25))))

;;; 129
(answer 129 (nstring-downcase (copy-seq "ABC") :end 2))

;;; 130
(answer 130 (nstring-capitalize (copy-seq (let ((*print-length* 2) (*print-level* 1)) (prin1-to-string '(1 (2 (3)) 4 5))))))

;;; 131
(answer 131 (string-trim "a Z" ""))

;;; 132
(answer 132 (string-left-trim '(#\a #\H) (format nil "~d|~5d|~5,'0d|~:d|~@d|~b|~o|~x|~3r" (integer-length 12) (mod 12 7) 5 (ash -100000000000000000000 5) -100000000000000000000 (+ 1000003 4611686018427387903) (integer-length (- (gcd) 1)) (numerator -100000000000000000000) 12)))

;;; 133
(answer 133 (string-right-trim "dcy" (format nil "~c|~:c|~@c|~?|~%~&~~|~|" #\Z (char-downcase #\a) (code-char (+ 65 3)) "~a-~a" (list (let ((h (make-hash-table)) (l nil)) (setf (gethash 1 h) 'a (gethash 2 h) 'b) (with-hash-table-iterator (next h) (loop (multiple-value-bind (more k v) (next) (if more (push (cons k v) l) (return))))) (reverse l)) (list (member (1- -7) nil) (member (rem 0 7) (revappend '(3 1 2) nil) :test #'=) (member-if #'evenp (butlast nil)) (member-if-not #'plusp '(3 1 2)))))))

;;; 134
(answer 134 (string 'foo))

;;; 135
(answer 135 (make-string 3 :initial-element (char-upcase #\5)))

;;; 136
(answer 136 (concatenate 'string (format nil "~w|~a ~:a ~:s" (let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) (11) . 12) ((13) . 14) 15 16))) (list (cdaaar x) (cdaadr x) (cdadar x) (cdaddr x) (cddaar x) (cddadr x) (cdddar x) (cddddr x))) nil nil nil) (format nil "~(~a~)|~:(~a~)|~@(~a~)|~:@(~a~)" (let ((*print-array* nil) (*print-gensym* nil)) (write-to-string (make-symbol "X"))) (format nil "~[zero~;one~:;many~]|~:[no~;yes~]|~@[x=~a~]" 0 (list (numberp (multiple-value-list (with-simple-restart (r "Leave.") (invoke-restart (find-restart 'r))))) (realp (let ((s (copy-symbol 'foo)) (u (gentemp))) (list (symbol-name s) (eq s 'foo) (symbolp u) (integerp *gensym-counter*)))) (rationalp (*)) (integerp (+)) (floatp (+)) (complexp (+))) 'foo) (string-capitalize "a-b c") (string-left-trim '(#\a #\H) (format nil "~a|~s|~10a|~10@a|~va" (string< "abc" "xabd" :start2 1) (list (eq (intern "FOO") 'foo) (multiple-value-list (find-symbol "CAR" "COMMON-LISP")) (packagep *package*) (package-name (find-package "KEYWORD")) (package-name (symbol-package 'car))) 'a ':key 5 'v))) (format nil "~10<~a~>|~10:<~a~>|~10@<~a~>|~12<~a~;~a~;~a~>" 'a ':key 'foo 'a 'b 'c)))

;;; 137
(answer 137 (reverse ""))

;;; 138
(answer 138 (subseq "abcdefgh" 2))

;;; 139
(answer 139 (remove (code-char (+ 65 0)) (nstring-downcase (copy-seq "ABC") :end 2)))

;;; 140
(answer 140 (substitute #\! #\- (format nil "~r|~:r|~@r" 3 1 2)))

;;; 141
(answer 141 (list (string= (write-to-string 12 :base 8) (format nil "~a|~s|~10a|~10@a|~va" (list least-positive-normalized-double-float least-negative-normalized-double-float) (list (< 1000 array-dimension-limit) (< 7 array-rank-limit) (< 1000 array-total-size-limit) (bit (make-array 4 :element-type 'bit :initial-element 1) 2) (sbit (make-array 4 :element-type 'bit :initial-element 0) 1)) 'a ':key 0 'v)) (string/= (format nil "~(~a~)|~:(~a~)|~@(~a~)|~:@(~a~)" (substitute #\! #\- "abc") "a-b c" (format nil "~a") (format nil "~a ~*~a|~2:*~a" 1 2 (list single-float-epsilon short-float-epsilon long-float-epsilon single-float-negative-epsilon short-float-negative-epsilon long-float-negative-epsilon) 4)) (nstring-upcase (copy-seq (format nil "~#[none~;one ~a~:;several~]" (let ((h (make-hash-table))) (list (integerp (hash-table-size h)) (realp (hash-table-rehash-size h)) (realp (hash-table-rehash-threshold h)) (= (sxhash "ab") (sxhash (copy-seq "ab"))))))))) (string< (format nil "~10<~a~>|~10:<~a~>|~10@<~a~>|~12<~a~;~a~;~a~>" 'a 'foo nil 'a 'b 'c) (format nil "~a")) (string> (format nil "~f|~,2f|~8,3f|~e|~,3e|~$|~g" -0.25 1.0 0.5 1.0 0.5 -0.25 0.5) (format nil "~{~a~^, ~}|~:{<~a ~a>~}|~@{~a~}" '(3 1 2) '((1 2) (3 4)) (stable-sort (list '(1 . a) '(0 . b) '(1 . c) '(0 . d)) #'< :key #'car) (list (streamp *standard-output*) (streamp *standard-input*) (streamp *error-output*) (streamp *trace-output*) (streamp *terminal-io*) (streamp *query-io*) (streamp *debug-io*) *print-base* *read-base* *read-default-float-format* (consp *features*)))) (string<= (prin1-to-string 0.1) "xyzzy") (string>= (subseq "abcdefgh" 5) (string-upcase "Hello World"))))

;;; 142
(answer 142 (list (string-equal (let ((*print-circle* nil) (*print-readably* nil) (*print-pretty* nil)) (write-to-string '(a (b . c) (d (e))))) "xyzzy") (string-not-equal (write-to-string (ecase (ldb (byte 1 5) -100000000000000000000) (1 'one) (12 'twelve)) :escape nil) (nstring-downcase (copy-seq "ABC") :end 2)) (string-lessp (let ((*print-case* :downcase) (*print-escape* nil)) (write-to-string '(Foo "x" |Bar|))) "xyzzy") (string-greaterp (format nil "~d item~:p|~d cit~:@p|~p" 2 0 3) "") (string-not-greaterp (format nil "~#[none~;one ~a~:;several~]" (let ((c (cons 1 2))) (rplaca c (load-time-value (list 1 2))) (rplacd c (case (gcd) ((0 1) 'low) (255 'byte) (otherwise (multiple-value-list (with-simple-restart (r "Leave.") (invoke-restart (find-restart 'r))))))) c)) "Hello World") (string-not-lessp "a-b c" (format nil "~{~a~^, ~}|~:{<~a ~a>~}|~@{~a~}" (last '(5 -5 5) 1) '((1 2) (3 4)) (list (char-equal #\Space #\Space) (char-not-equal (char-upcase #\-) (char-downcase #\Space)) (char-lessp #\Z #\Space) (char-greaterp #\5 (char-upcase #\5)) (char-not-greaterp #\Z (code-char (+ 65 2))) (char-not-lessp #\- #\a)) (list (make-sequence 'list 2 :initial-element (let ((s (gensym "Q"))) (list (symbolp s) (boundp s) (fboundp s) (char (symbol-name s) 0) (symbol-plist s)))) (make-sequence 'string 2 :initial-element #\Space) (make-sequence 'vector 1 :initial-element 0))))))

;;; 143
(answer 143 (list (stringp (loop for (a . b) in '((a . 1) nil (c . 3)) when a collect (list a b) else collect 'none)) (simple-string-p (format nil "~r|~:r|~@r" 2 3 3)) (length (nstring-capitalize (copy-seq (let ((*print-length* 2) (*print-level* 1)) (prin1-to-string '(1 (2 (3)) 4 5)))))) (position (code-char (+ 65 2)) (string-downcase (concatenate 'string (reverse (format nil "~a")) (make-string 1 :initial-element #\5) (format nil "~d item~:p|~d cit~:@p|~p" 3 5 0)) :start 1)) (search (let ((*print-base* 2) (*print-radix* t)) (prin1-to-string (signum -7))) (format nil "a~10tb~5@tc~%~2,4td" )) (mismatch (format nil "~d|~5d|~5,'0d|~:d|~@d|~b|~o|~x|~3r" 1000003 (ldb (byte 2 1) (lognot -7)) 0 (logcount 0) 4611686018427387903 (mod 255 1) (logior (isqrt (abs 255)) (logand 0 4611686018427387903)) 12 -7) (format nil "~w|~a ~:a ~:s" (list (multiple-value-list (truncate (expt -7/3 5) 7)) (multiple-value-list (round (- (*) (*)) 3))) nil nil nil))))

;;; 144
(answer 144 (let ((s (copy-seq "fresh"))) (list (char "abc" 1) (schar "abc" 2) (if (> (length s) 0) (setf (char s 0) #\Q)) s)))

;;; 145
(answer 145 (string< "abc" "xabd" :start2 1))

;;; 146
(answer 146 (list (symbolp (let ((a (make-array '(2 3) :initial-contents '((1 2 3) (4 5 6))))) (list (aref a 1 2) (array-rank a) (array-dimension a 1) (array-dimensions a) (array-total-size a) (row-major-aref a 4) (array-row-major-index a 1 1) (array-in-bounds-p a 2 0) (setf (aref a 0 0) (pairlis '(a b c) (list (funcall (lambda (&key a ((:other o) (list most-positive-double-float (< -1.0e-300 least-negative-double-float 0 least-positive-double-float 1.0e-300) most-negative-double-float double-float-epsilon double-float-negative-epsilon)) &allow-other-keys) (list a o)) :a 1 :b 2) (handler-bind ((warning #'muffle-warning)) (warn "w ~a" (multiple-value-list (with-simple-restart (cl:abort "Leave.") (cl:abort)))) 'warned) (list (string= "abc" (format nil "a~10tb~5@tc~%~2,4td" )) (string/= "" (nstring-downcase (copy-seq "ABC") :end 2)) (string< (format nil "~a") "abc") (string> "xyzzy" "a-b c") (string<= (let ((*print-case* :downcase) (*print-escape* nil)) (write-to-string '(Foo "x" |Bar|))) "Hello World") (string>= "abc" (let ((*print-array* nil) (*print-gensym* nil)) (write-to-string (make-symbol "X")))))))) a))) (keywordp 'a) (symbol-name ':key) (eq 'foo nil) (symbol-package ':k)))

;;; 147
(answer 147 (let ((s (gensym "Q"))) (list (symbolp s) (boundp s) (fboundp s) (char (symbol-name s) 0) (symbol-plist s))))

;;; 148
(answer 148 (let ((s (make-symbol "S"))) (set s (list (integerp (get-universal-time)) (integerp (get-internal-real-time)) (integerp (get-internal-run-time)) (integerp internal-time-units-per-second) (length (multiple-value-list (get-decoded-time))) (stringp (lisp-implementation-type)) (stringp (lisp-implementation-version)) (progn (sleep 0) 1))) (setf (get s 'p) (mapcar (let ((k (ash (gcd) (- 3)))) (lambda (x) (+ x k))) '(5 -5 5))) (setf (symbol-function s) (constantly (logxor 1 (1+ (gcd)) (lognot 4611686018427387903)))) (list (symbol-value s) (get s 'p) (get s 'q 'none) (funcall s (isqrt (abs (gcd (gcd 0 1000003) (denominator 22/7))))) (if (remprop s 'p) t) (get s 'p) (if (fboundp s) t) (progn (makunbound s) (boundp s)) (progn (fmakunbound s) (fboundp s)))))

;;; 149
(answer 149 (let ((s (copy-symbol 'foo)) (u (gentemp))) (list (symbol-name s) (eq s 'foo) (symbolp u) (integerp *gensym-counter*))))

;;; 150
(answer 150 (list (eq (intern "FOO") 'foo) (multiple-value-list (find-symbol "CAR" "COMMON-LISP")) (packagep *package*) (package-name (find-package "KEYWORD")) (package-name (symbol-package 'car))))

;;; 151
(answer 151 (list (constantp (list (multiple-value-list (floor (ash (1- 255) 5) 255)) (multiple-value-list (truncate 1 (logcount (abs -7)))))) (constantp 'x) (constantp ''x) (special-operator-p 'if) (special-operator-p 'car) (compiled-function-p #'car) (functionp #'car) (functionp 'car)))

;;; 152
(answer 152 (cons (dpb 1 (byte 7 3) (logxor (lcm -100000000000000000000 255) (denominator 1/2) -7)) nil))

;;; 153
(answer 153 (list (ash (signum (- 1000003 0)) (- 5)) (numerator (* (+ 22/7 22/7 1/2) 1)) -100000000000000000000))

;;; 154
(answer 154 (list* (+ -100000000000000000000 12) '(3 1 2)))

;;; 155
(answer 155 (append '(5 -5 5) '(1 2 3 4 5)))

;;; 156
(answer 156 (reverse '(1 2 3 4 5)))

;;; 157
(answer 157 (nreverse (copy-list (nreconc (list 1 2 2 1) (copy-list '(3 1 2))))))

;;; 158
(answer 158 (copy-list (nthcdr 0 (nthcdr 2 (cons 255 nil)))))

;;; 159
(answer 159 (rest (last (make-list 1 :initial-element (1- -7)) 3)))

;;; 160
(answer 160 (nthcdr 5 nil))

;;; 161
(answer 161 (last '(5 -5 5) 0))

;;; 162
(answer 162 (butlast (list* -100000000000000000000 (nbutlast (list 3 1 2) 0))))

;;; 163
(answer 163 (nbutlast (copy-list '(5 -5 5)) 1))

;;; 164
(answer 164 (nconc (copy-list (append (ldiff '(3 1 2) nil) (nbutlast (list 1 2 2 1) 2))) (list 1 2 2 1)))

;;; 165
(answer 165 (revappend (list* (gcd) '(1 2 3 4 5)) (cons (ldb (byte 2 0) (integer-length 1)) (append '(1 2 3 4 5) '(1 2 3 4 5)))))

;;; 166
(answer 166 (nreconc (list 3 1 2) (copy-list (nreverse (copy-list '(3 1 2))))))

;;; 167
(answer 167 (make-list 2 :initial-element (isqrt (abs (gcd)))))

;;; 168
(answer 168 (ldiff (nreconc (copy-list (reverse '(1 2 3 4 5))) (copy-list (ldiff '(3 1 2) nil))) nil))

;;; 169
(answer 169 (car nil))

;;; 170
(answer 170 (cdr '(a (b . c) (d (e)))))

;;; 171
(answer 171 (list (first '(5 -5 5)) (second '(1 2 3 4 5)) (third nil) (fourth (butlast (make-list 3 :initial-element (logcount 4611686018427387903)))) (fifth '(5 -5 5))))

;;; 172
(answer 172 (let ((l '(1 2 3 4 5 6 7 8 9 10 11))) (list (sixth l) (seventh l) (eighth l) (ninth l) (tenth l))))

;;; 173
(answer 173 (let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) 11 . 12) (13 . 14) 15 16))) (list (caar x) (cadr x) (cdar x) (cddr x) (caaar x) (caadr x) (cadar x) (caddr x) (cdaar x) (cdadr x) (cddar x) (cdddr x))))

;;; 174
(answer 174 (let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) (11) . 12) ((13) . 14) 15 16))) (list (caaaar x) (caaadr x) (caadar x) (caaddr x) (cadaar x) (cadadr x) (caddar x) (cadddr x))))

;;; 175
(answer 175 (let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) (11) . 12) ((13) . 14) 15 16))) (list (cdaaar x) (cdaadr x) (cdadar x) (cdaddr x) (cddaar x) (cddadr x) (cdddar x) (cddddr x))))

;;; 176
(answer 176 (list (consp (unless (< call-arguments-limit 50) (list (< 20 lambda-parameters-limit) (< 19 multiple-values-limit) (if (member '&rest lambda-list-keywords) t)))) (atom (and (list (read-from-string "#xFF") (multiple-value-list (read-from-string "a b" t nil :start 1))) (let ((x 'a)) (handler-bind ((error (lambda (c) (declare (ignore c)) (invoke-restart 'store-value 7)))) (ctypecase x (integer (list 'integer x))))) (let ((h (make-hash-table))) (list (integerp (hash-table-size h)) (realp (hash-table-rehash-size h)) (realp (hash-table-rehash-threshold h)) (= (sxhash "ab") (sxhash (copy-seq "ab"))))))) (listp (multiple-value-bind (a b c) (values (list (svref #(1 2 3 4 5 6) 5) (aref #(3 1 2 1) 1)) (funcall (lambda (&key a ((:other o) (list (concatenate 'list (copy-seq (substitute-if-not 1000003 (lambda (x) (> x 2)) (delete-duplicates (list 1 2 2 1) :key (complement #'zerop)) :count 1)) (delete-if-not #'oddp (vector 4 3 2 1))) (concatenate 'vector (fill (vector 4 3 2 1) 4611686018427387903) #(1 2 3)))) &allow-other-keys) (list a o)) :a 1 :b 2)) (list a b c))) (null (reduce #'- (reverse #()) :from-end t :initial-value (ash 1000003 0) :start 0)) (endp (copy-list (rest (nreverse (list 3 1 2))))) (not (list (< (abs (- pi 3.141592653589793)) 1.0e-15)))))

;;; 177
(answer 177 (list (nth 2 (nconc (list 1 2 2 1) (list 3 1 2))) (list-length (reverse (revappend (copy-list nil) (nconc (list 1 2 2 1) (list 3 1 2))))) (length (remove-duplicates (remove-duplicates (copy-seq (substitute-if 0 (lambda (x) (> x 2)) (sort (list 1 2 2 1) #'<)))) :from-end t)) (elt '(1 2 3 4 5 6) 5)))

;;; 178
(answer 178 (let ((c (cons 1 2))) (rplaca c 12) (rplacd c (let ((h (make-hash-table))) (setf (gethash (logand (logior -100000000000000000000 1) (rem 255 3)) h) (list (stringp (let ((*trace-output* (make-string-output-stream))) (time (loop for x across #(3 1 2) sum x into s count (oddp x) into c maximize x into m finally (return (list s c m)))))) (simple-string-p (format nil (formatter "~a+~a") (let ((h (make-hash-table)) (l nil)) (setf (gethash 1 h) 'a (gethash 2 h) 'b) (with-hash-table-iterator (next h) (loop (multiple-value-bind (more k v) (next) (if more (push (cons k v) l) (return))))) (reverse l)) (with-open-stream (s (make-string-input-stream "1 2")) (list (read s) (read s) (read s nil :eof))))) (length "xyzzy") (position (char-upcase #\a) (format nil "~10<~a~>|~10:<~a~>|~10@<~a~>|~12<~a~;~a~;~a~>" 'a ':key nil 'a 'b 'c)) (search (princ-to-string (unless (< call-arguments-limit 50) (list (< 20 lambda-parameters-limit) (< 19 multiple-values-limit) (if (member '&rest lambda-list-keywords) t)))) (string-capitalize (nstring-downcase (copy-seq "ABC") :end 2))) (mismatch (format nil "a~10tb~5@tc~%~2,4td" ) (reverse (let ((*print-array* nil) (*print-gensym* nil)) (write-to-string (make-symbol "X")))))) (gethash 'k h) 5) (incf (gethash 'n h 10)) (list (gethash 'k h) (multiple-value-list (gethash 'zz h (let ((v (vector 1 2 3)) (i 0)) (incf (aref v (incf i)) 1000003) (decf (aref v i)) (list v i)))) (hash-table-count h) (remhash 'k h) (remhash 'k h) (hash-table-count h)))) c))

;;; 179
(answer 179 (list (copy-tree '((1 . 2) 3)) (copy-alist '((a . 1) nil (c . 3))) (tree-equal '((1 . 2) 3) '(a (b . c) (d (e)))) (tree-equal '((1 . 2) 3) '(a (b . c) (d (e))) :test #'equal)))

;;; 180
(answer 180 (list (subst (and (list (identity (loop for (a . b) in '((a . 1) (b . 2)) when a collect (list a b) else collect 'none)) (funcall (constantly (= least-positive-single-float least-positive-short-float least-positive-long-float (- least-negative-single-float) (- least-negative-short-float) (- least-negative-long-float))) 1 2) (funcall (complement #'evenp) 4611686018427387903)) (subseq (stable-sort (list 3 1 2) #'> :key (complement #'zerop)) 2) (list (eval '(+ 1 0)) (eval (* -7 (gcd))) (eval ''a) (funcall (compile nil '(lambda (x) (* x 2))) (gcd 12 0)))) 'b '(a (b . c) (d (e)))) (subst-if 0 #'symbolp '((1 . 2) 3)) (subst-if-not 0 #'consp '(a (b . c) (d (e))))))

;;; 181
(answer 181 (list (nsubst 'x 'c (copy-tree '(a (b . c) (d (e))))) (nsubst-if 'x #'numberp (copy-tree '((1 . 2) 3))) (nsubst-if-not 'x #'listp (copy-tree '(a (b . c) (d (e)))))))

;;; 182
(answer 182 (list (sublis '((a . 1) nil (c . 3)) '((1 . 2) 3)) (nsublis '((a . z)) (copy-tree '((1 . 2) 3)))))

;;; 183
(answer 183 (list (member (mod (lognot (1+ 12)) 1) (nconc (list 1 2 2 1) (copy-list (last '(1 2 3 4 5) 1)))) (member 1 (nthcdr 5 (cons (gcd) nil)) :test #'eql) (member-if #'evenp '(3 1 2)) (member-if-not (lambda (x) (> x 2)) (nreverse (copy-list '(5 -5 5))))))

;;; 184
(answer 184 (list (assoc 'foo '((a . 1) (b . 2))) (assoc 'b '((a . 1) (b . 2)) :test #'eq) (assoc-if #'symbolp '((a . 1) nil (c . 3))) (assoc-if-not #'symbolp '((a . 1) (2 . 3)))))

;;; 185
(answer 185 (list (rassoc (gcd) '((a . 1) nil (c . 3))) (rassoc-if #'evenp '((a . 1) (b . 4))) (rassoc-if-not #'plusp '((a . 1) (b . 4)))))

;;; 186
(answer 186 (list (acons 'a (loop for x across #(3 1 2) sum x into s count (oddp x) into c maximize x into m finally (return (list s c m))) '((a . 1) (b . 2))) (pairlis '(c a) '(1 2) '((a . 1) nil (c . 3)))))

;;; 187
(answer 187 (pairlis '(a b c) (list (list least-positive-normalized-single-float least-positive-normalized-short-float least-positive-normalized-long-float least-negative-normalized-single-float least-negative-normalized-short-float least-negative-normalized-long-float) (do* ((i 0 (+ i 2)) (j i (+ i 1))) ((> i 5) (list i j)) (when (= i 4) (return 'early))) (list (< most-positive-fixnum (expt 2 62)) (> most-negative-fixnum (- (expt 2 63)))))))

;;; 188
(answer 188 (list (getf '(:a 1 :b 2) :a) (getf nil :z (reduce #'- (delete-duplicates (list 3 1 2) :key #'1+) :from-end t :initial-value (abs (isqrt (abs 1000003))) :start 0)) (multiple-value-list (get-properties '(:a 1 :b 2) '(:b :c)))))

;;; 189
(answer 189 (let ((p (list :a 1 :b 2))) (list (remf p :b) p (setf (getf p :n) (signum 4611686018427387903)) (incf (getf p :m 10)) p)))

;;; 190
(answer 190 (list (adjoin 0 (butlast (rest nil))) (adjoin (ldb (byte 2 3) 1000003) '(5 -5 5) :key (constantly 1)) (tailp nil '(3 1 2))))

;;; 191
(answer 191 (list (let ((a (copy-list '(5 -5 5))) (b (butlast (list (logand -100000000000000000000 -100000000000000000000) 12 (+ 4611686018427387903 -7))))) (sort (union a b) #'<)) (intersection (nbutlast (list 1 2 2 1) 2) (rest (list 12 -7 255))) (set-difference nil (nthcdr 3 '(3 1 2))) (let ((a (nreverse (copy-list (revappend '(5 -5 5) '(3 1 2))))) (b (nreconc (copy-list (make-list 1 :initial-element 1)) (copy-list (list* 255 '(1 2 3 4 5)))))) (sort (set-exclusive-or a b) #'<)) (subsetp '(1 2 3 4 5) '(5 -5 5))))

;;; 192
(answer 192 (list (sort (nunion (copy-list (last (nreconc (list 3 1 2) (list 1 2 2 1)) 0)) (copy-list (nbutlast (copy-list '(5 -5 5)) 5))) #'<) (nintersection (copy-list (reverse nil)) (copy-list '(1 2 3 4 5))) (nset-difference (copy-list (ldiff '(3 1 2) nil)) (copy-list '(3 1 2))) (sort (nset-exclusive-or (list 3 1 2) (list 1 2 2 1)) #'<)))

;;; 193
(answer 193 (let ((a (nconc (copy-list '(1 2 3 4 5)) (copy-list (ldiff '(3 1 2) nil)))) (b (make-list 2 :initial-element (dpb (logior 1 -100000000000000000000) (byte 7 3) 12)))) (sort (union a b :test #'equal) #'<)))

;;; 194
(answer 194 (let ((l (cons (mod (integer-length 255) 3) nil)) (m nil)) (push (lcm (gcd) -7) l) (pushnew 12 l) (pushnew 3 l :test #'=) (setq m (pop l)) (list l m)))

;;; 195
(answer 195 (list (mapcar #'- (list* (- (numerator -7/3) (abs (gcd))) '(3 1 2))) (mapcar #'+ nil (revappend (append (revappend nil '(1 2 3 4 5)) '(5 -5 5)) nil)) (maplist #'length (rest (list* 0 (list 1000003 1000003 -7))))))

;;; 196
(answer 196 (let ((sum nil)) (list (mapc (lambda (x) (push x sum)) (nbutlast (copy-list (cons 0 '(1 2 3 4 5))) 1)) (mapl (lambda (x) (push (length x) sum)) (append (make-list 0 :initial-element 4611686018427387903) (last (nbutlast (list 3 1 2) 2) 1))) sum)))

;;; 197
(answer 197 (list (mapcan #'list '(5 -5 5) (copy-list '(3 1 2))) (mapcon #'list (rest (ldiff (nreconc (list 1 2 2 1) (list 3 1 2)) nil)))))

;;; 198
(answer 198 (list (every (lambda (x) (> x 2)) (remove 1000003 (substitute-if (denominator 22/7) #'oddp (nsubstitute-if-not 4611686018427387903 (lambda (x) (> x 2)) (list 3 1 2))))) (some #'evenp (delete-if #'oddp (copy-seq #(3 1 2 1)))) (notevery #'oddp (remove-if-not #'plusp (nsubstitute-if 0 #'plusp (list 1 2 2 1)))) (notany #'plusp (delete-if #'oddp (copy-seq #(1 2 3))))))

;;; 199
(answer 199 (list (every #'< (nconc (list 1 2 2 1) (list 3 1 2)) #()) (some (lambda (x y) (and (> x y) (list x y))) #(3 1 2 1) '(3 1 2))))

;;; 200
(answer 200 (list (map 'list #'1+ '(1 2 3 4 5)) (map 'vector #'+ (delete (lcm (mod (gcd) 3) 4611686018427387903) (copy-seq #(3 1 2 1))) (nsubstitute-if-not (- 12 (logxor 255 1 -7)) #'oddp (list 1 2 2 1))) (map nil #'identity (substitute (gcd -100000000000000000000 (ldb (byte 7 3) 1000003)) (signum (gcd)) (stable-sort (vector 4 3 2 1) #'< :key (constantly 12)))) (map 'string #'char-upcase (format nil "~a ~*~a|~2:*~a" 1 2 (symbol-value 'unbound-thing200) 4))))

;;; 201
(answer 201 (list (map-into (vector 4 3 2 1) (constantly 0) (fill (copy-seq #(3 1 2 1)) (logand (abs -7) (* 4611686018427387903 255)))) (map-into (list 3 1 2) #'+ (substitute (numerator (* -7/3 -7/3)) (1+ (abs 255)) (delete (logcount 1) (list 3 1 2))) (reverse (nsubstitute (logcount -100000000000000000000) 1 (vector 4 3 2 1))))))

;;; 202
(answer 202 (list (reduce #'+ (sort (list 3 1 2) #'>)) (reduce #'list (remove-if #'plusp (remove-duplicates (reverse (nsubstitute-if -100000000000000000000 (lambda (x) (> x 2)) (list 3 1 2))))) :initial-value (list (reduce #'+ (remove-if #'evenp (fill (list 1 2 2 1) 1000003))) (reduce #'list (nsubstitute (logior 1 -100000000000000000000) 1 (vector 4 3 2 1)) :initial-value (list most-positive-single-float most-positive-short-float most-positive-long-float most-negative-single-float most-negative-short-float most-negative-long-float)) (reduce #'list '(5 -5 5) :from-end t) (reduce #'+ (remove-if-not #'oddp (delete-if-not #'evenp (list 1 2 2 1))) :key (constantly (integer-length 12))))) (reduce #'list '(5 -5 5) :from-end t) (reduce #'+ (delete-duplicates (copy-seq #(1 2 3)) :key #'-) :key (constantly (1- (1- 1))))))

;;; 203
(answer 203 (reduce #'- #() :from-end t :initial-value 12 :start 0))

;;; 204
(answer 204 (list (find 0 '(3 1 2)) (find (dpb (logxor 1000003 (lognot -100000000000000000000) (isqrt (abs 4611686018427387903))) (byte 3 0) (lognot -7)) (nsubstitute-if (1+ (denominator 1/2)) #'plusp (list 3 1 2)) :test #'eql) (find (gcd (gcd) (ash (ash -7 3) 1)) (nsubstitute 4611686018427387903 1 (copy-seq #())) :key (constantly 255) :from-end t)))

;;; 205
(answer 205 (list (find-if (lambda (x) (> x 2)) (copy-seq (substitute (ash 12 (- 0)) (* (gcd) -100000000000000000000) (stable-sort (vector 4 3 2 1) #'> :key #'abs)))) (find-if-not #'oddp (delete (+ (ash 255 (- 5)) (rem -7 1)) (copy-seq #()))) (find-if (lambda (x) (> x 2)) (remove 4611686018427387903 (remove-if #'plusp (nsubstitute-if-not 0 #'evenp (vector 4 3 2 1)))) :from-end t)))

;;; 206
(answer 206 (list (position (denominator 1/2) (delete-if (lambda (x) (> x 2)) (list 3 1 2))) (position-if #'evenp (sort (copy-list '(1 2 3 4 5)) #'>)) (position-if-not #'evenp (remove-duplicates (substitute-if 255 #'plusp (substitute-if-not 255 (lambda (x) (> x 2)) (remove 0 (nsubstitute 4611686018427387903 1 (list 1 2 2 1))) :count 1)) :from-end t)) (position 1 '(1 2 1 3) :from-end t :end 3)))

;;; 207
(answer 207 (list (count (isqrt (abs -7)) (substitute-if-not (lognot 12) #'plusp (remove-duplicates (remove 1 (fill (vector 4 3 2 1) (gcd))) :from-end t) :count 1)) (count-if #'oddp (revappend (reverse '(5 -5 5)) nil)) (count-if-not #'evenp (sort (vector 4 3 2 1) #'<)) (count 1 '(1 2 1 3 1) :start 2)))

;;; 208
(answer 208 (remove (logand 0 (+ (ldb (byte 2 1) -100000000000000000000) 1)) (substitute (abs (gcd)) (signum (mod 1000003 1)) (remove-if (lambda (x) (> x 2)) (delete-if-not #'oddp (list 1 2 2 1))))))

;;; 209
(answer 209 (remove-if #'plusp (remove-duplicates (nsubstitute-if 1000003 (lambda (x) (> x 2)) (vector 4 3 2 1)) :from-end t)))

;;; 210
(answer 210 (remove-if-not #'plusp (nsubstitute-if (gcd (logxor (gcd) -7 12) (logior -7 -100000000000000000000)) #'evenp (copy-seq #(3 1 2 1)))))

;;; 211
(answer 211 (remove (ash (- (1- 0) 1) (- 3)) (remove-duplicates (nsubstitute (1+ (gcd)) 1 (list 1 2 2 1))) :count 1 :from-end t))

;;; 212
(answer 212 (remove-if #'evenp '(1 2 3 4 5 6) :start 1 :end 5 :count 5))

;;; 213
(answer 213 (delete (integer-length (dpb (logcount 1) (byte 1 1) (ash -100000000000000000000 5))) (copy-seq #(3 1 2 1))))

;;; 214
(answer 214 (delete-if (lambda (x) (> x 2)) (copy-list (nreverse (list 3 1 2)))))

;;; 215
(answer 215 (delete-if-not #'oddp (copy-seq #(1 2 3))))

;;; 216
(answer 216 (remove-duplicates (reverse (reverse (delete 1000003 (list 1 2 2 1))))))

;;; 217
(answer 217 (remove-duplicates (substitute (rem (integer-length 0) 2) (ash (1- 4611686018427387903) 0) (remove-if-not (lambda (x) (> x 2)) (sort (list 3 1 2) #'>))) :from-end t))

;;; 218
(answer 218 (delete-duplicates (list 3 1 2) :key (constantly (ldb (byte 7 1) 255))))

;;; 219
(answer 219 (substitute (gcd) 4611686018427387903 (fill (copy-list '(5 -5 5)) 4611686018427387903)))

;;; 220
(answer 220 (substitute-if 1000003 #'plusp (nsubstitute-if-not (lognot (lcm 0 1)) #'evenp (copy-seq #(1 2 3)))))

;;; 221
(answer 221 (substitute-if-not -7 #'oddp (substitute-if (logand -100000000000000000000 (abs 1000003)) #'plusp #(1 2 3)) :count 1))

;;; 222
(answer 222 (nsubstitute (denominator 22/7) 1 (copy-list (copy-list '(3 1 2)))))

;;; 223
(answer 223 (nsubstitute-if 12 (lambda (x) (> x 2)) (vector 4 3 2 1)))

;;; 224
(answer 224 (nsubstitute-if-not 255 #'evenp (copy-seq #())))

;;; 225
(answer 225 (reverse (delete-duplicates (copy-list nil) :key (lambda (x) (* x x)))))

;;; 226
(answer 226 (copy-seq (copy-seq #(3 1 2 1))))

;;; 227
(answer 227 (sort (list 1 2 2 1) #'<))

;;; 228
(answer 228 (stable-sort (copy-seq #()) #'< :key #'identity))

;;; 229
(answer 229 (stable-sort (list '(1 . a) '(0 . b) '(1 . c) '(0 . d)) #'< :key #'car))

;;; 230
(answer 230 (list (merge 'list (list 1 3 5) (list 2 3 4) #'<) (merge 'vector (vector 1 4) (list 2 3) #'<)))

;;; 231
(answer 231 (fill (list 3 1 2) (rem (isqrt (abs 1)) 7)))

;;; 232
(answer 232 (fill (list 1 2 3 4 5 6) (let ((s (make-string-output-stream))) (format s "~a" (list (equal nil (list* 1000003 '(1 2 3 4 5))) (equalp (let ((*print-circle* nil) (*print-readably* nil) (*print-pretty* nil)) (write-to-string '(a (b . c) (d (e))))) (string-upcase (remove #\Space (let ((*print-array* nil) (*print-gensym* nil)) (write-to-string (make-symbol "X")))))) (equalp 1 1.0) (equalp #() (copy-seq #(1 2 3))))) (finish-output s) (force-output s) (clear-output s) (list (get-output-stream-string s) (get-output-stream-string s))) :start 1 :end 1))

;;; 233
(answer 233 (replace (list 1 2 3 4) #(3 1 2 1) :start1 1))

;;; 234
(answer 234 (list (search '(1 2) (copy-seq (delete-duplicates (vector 4 3 2 1) :key #'abs))) (search (delete (logxor -7 (signum 12) (rem 4611686018427387903 7)) (copy-seq #())) '(3 1 2)) (mismatch (remove-duplicates (delete-if #'oddp (list 3 1 2))) (remove-if #'evenp (delete-if #'oddp (vector 4 3 2 1)))) (mismatch '(5 -5 5) #(1 2 3) :test #'=)))

;;; 235
(answer 235 (list (concatenate 'list (substitute-if (logcount (* 12 -100000000000000000000)) #'evenp (nsubstitute-if-not (dpb 255 (byte 3 5) 1) #'plusp (list 1 2 2 1))) (make-list 0 :initial-element (numerator -7/3))) (concatenate 'vector (remove-if-not #'plusp (delete-if-not #'oddp (list 1 2 2 1))) #(3 1 2 1))))

;;; 236
(answer 236 (list (coerce '(1 2 3 4 5) 'list) (coerce (substitute-if-not 12 (lambda (x) (> x 2)) (stable-sort (vector 4 3 2 1) #'> :key #'abs) :count 1) 'vector) (coerce '(#\a #\b) 'string) (coerce "c" 'character) (coerce 3.0e-5 'double-float)))

;;; 237
(answer 237 (list (make-sequence 'list 2 :initial-element (let ((x (let ((h (make-hash-table))) (setf (gethash (mod (gcd) 1) h) (list (char-code #\Z) (char-int #\5) (char-name #\Newline) (name-char "space") (digit-char 3) (digit-char 11 16) (digit-char-p #\Z) (digit-char-p #\f 16)) (gethash 'k h) 5) (incf (gethash 'n h 10)) (list (gethash 'k h) (multiple-value-list (gethash 'zz h (symbol-value 'unbound-thing237))) (hash-table-count h) (remhash 'k h) (remhash 'k h) (hash-table-count h)))) (y (handler-case (cl:assert (= 1 (ash 1000003 (- 2)))) (error () 'assertion)))) (let* ((x y) (z x)) (list x y z)))) (make-sequence 'string 2 :initial-element #\-) (make-sequence 'vector 1 :initial-element 0)))

;;; 238
(answer 238 (subseq #(3 1 2 1) 2))

;;; 239
(answer 239 (elt (remove-if-not #'evenp (substitute (gcd) 255 (delete-if #'plusp (vector 4 3 2 1)))) 0))

;;; 240
(answer 240 (let ((s (list 1 2 3 4))) (setf (subseq s 1 3) (substitute-if-not (lcm (lcm -7 255) (- -100000000000000000000 4611686018427387903)) #'oddp (nsubstitute (* 0 1000003) 1 (list 1 2 2 1)) :count 1)) s))

;;; 241
(answer 241 (length (read-char (make-string-input-stream ""))))

;;; 242
(answer 242 (let ((a (make-array '(2 3) :initial-contents '((1 2 3) (4 5 6))))) (list (aref a 1 2) (array-rank a) (array-dimension a 1) (array-dimensions a) (array-total-size a) (row-major-aref a 4) (array-row-major-index a 1 1) (array-in-bounds-p a 2 0) (setf (aref a 0 0) (prog1 (with-input-from-string (s "one two (3 4) x") (list (read s) (read-char s) (peek-char nil s) (unread-char (read-char s) s) (read-line s) (read-line s nil 'eof) (read s nil 'end))) (let ((l nil)) (dotimes (i 0 (list i l)) (push i l))))) a)))

;;; 243
(answer 243 (let ((v (make-array 2 :initial-element (parse-integer "1x2") :adjustable t :fill-pointer 0))) (list (vector-push (multiple-value-list (parse-integer "123456789012345678901234567890")) v) (vector-push-extend (length (multiple-value-list (get-setf-expansion '(car x)))) v) (vector-push-extend 4611686018427387903 v) (fill-pointer v) (vector-pop v) v (array-has-fill-pointer-p v) (adjustable-array-p v))))

;;; 244
(answer 244 (let ((v (make-array 5 :initial-contents '(1 2 3 4 5) :fill-pointer 3))) (setf (fill-pointer v) 3) (list v (length v) (array-total-size v) (aref v 4) (reverse v))))

;;; 245
(answer 245 (let ((a (make-array 3 :initial-element 0 :adjustable t))) (list (adjust-array a 5 :initial-element (signum 12)) (array-element-type (vector 1)) (upgraded-array-element-type t))))

;;; 246
(answer 246 (list (svref #(1 2 3 4 5 6) 1) (aref #(3 1 2 1) 5)))

;;; 247
(answer 247 (let ((v (vector 4 3 2 1))) (setf (svref (vector 1 2) 0) 5) (if (> (length v) 0) (setf (aref v 0) (let ((n (isqrt (abs (lognot (gcd)))))) (setf (ldb (byte 3 2) n) 255) (setf (mask-field (byte 2 0) n) 0) n))) (list v (arrayp (list (nth-value 1 (floor (abs (gcd 255 (gcd))) 1)) (multiple-value-list (values-list nil)))) (vectorp #(1 2 3)) (simple-vector-p (list (boole boole-andc1 (* 0 0) (logand -100000000000000000000 (ash 12 3))) (boole boole-andc2 4611686018427387903 (logxor (logior -7 1000003) (numerator 22/7) (dpb 1 (byte 2 5) 1))) (boole boole-orc1 (gcd 12 4611686018427387903) 255) (boole boole-orc2 (- (logcount -100000000000000000000) (1+ 1000003)) (1+ (gcd))) (boole boole-c1 0 (logior (rem 1 2) (ash -7 (- 2)))) (boole boole-c2 (integer-length (1- 255)) (denominator 1/2)) (boole boole-clr (ldb (byte 3 0) (numerator 22/7)) (mod (+ 4611686018427387903 -7) 7)) (boole boole-set (integer-length 1) (1+ (dpb -100000000000000000000 (byte 2 1) -7))))))))

;;; 248
(answer 248 (multiple-value-list (array-displacement (make-array 1 :initial-element (progn (list (integerp (get-universal-time)) (integerp (get-internal-real-time)) (integerp (get-internal-run-time)) (integerp internal-time-units-per-second) (length (multiple-value-list (get-decoded-time))) (stringp (lisp-implementation-type)) (stringp (lisp-implementation-version)) (progn (sleep 0) 1)) (multiple-value-bind (v c) (ignore-errors (error 'simple-error :format-control "x ~a" :format-arguments '(1))) (list v (simple-condition-format-control c) (simple-condition-format-arguments c))))))))

;;; 249
(answer 249 (list (< 1000 array-dimension-limit) (< 7 array-rank-limit) (< 1000 array-total-size-limit) (bit (make-array 4 :element-type 'bit :initial-element 1) 2) (sbit (make-array 4 :element-type 'bit :initial-element 0) 1)))

;;; 250
(answer 250 (let ((h (make-hash-table))) (setf (gethash (logior (denominator 1/2) -7) h) (do* ((i 0 (+ i 2)) (j i (+ i 1))) ((> i 5) (list i j)) (when (= i 4) (return 'early))) (gethash 'k h) 5) (incf (gethash 'n h 10)) (list (gethash 'k h) (multiple-value-list (gethash 'zz h (list (char= (char-downcase (char-upcase #\-)) (code-char (+ 65 5))) (char/= #\a (char-downcase #\5)) (char< (char-upcase (char-downcase #\-)) #\Z (char-upcase (code-char (+ 65 3)))) (char> (char-downcase (char-upcase #\Space)) (char-downcase #\a)) (char<= (code-char (+ 65 2)) (char-downcase #\-)) (char>= #\Z #\Space)))) (hash-table-count h) (remhash 'k h) (remhash 'k h) (hash-table-count h))))

;;; 251
(answer 251 (let ((h (make-hash-table :test 'eql)) (l nil)) (setf (gethash "a" h) 1 (gethash (macrolet ((m (&whole w x) (list 'quote (list w x)))) (m 0)) h) 2 (gethash "A" h) 3) (maphash (lambda (k v) (push (list k v) l)) h) (list (reverse l) (hash-table-test h) (hash-table-p h) (hash-table-p (progn (handler-case (read-from-string "(1 2") (end-of-file (c) (streamp (stream-error-stream c)))) (read-char (make-string-input-stream "")))))))

;;; 252
(answer 252 (let ((h (make-hash-table))) (dolist (x (last (butlast '(3 1 2)) 5)) (incf (gethash x h 0))) (list (loop for k being the hash-keys of h collect k) (loop for v being the hash-values of h using (hash-key k) collect (cons k v)) (progn (clrhash h) (hash-table-count h)))))

;;; 253
(answer 253 (let ((h (make-hash-table)) (l nil)) (setf (gethash 1 h) 'a (gethash 2 h) 'b) (with-hash-table-iterator (next h) (loop (multiple-value-bind (more k v) (next) (if more (push (cons k v) l) (return))))) (reverse l)))

;;; 254
(answer 254 (let ((h (make-hash-table))) (list (integerp (hash-table-size h)) (realp (hash-table-rehash-size h)) (realp (hash-table-rehash-threshold h)) (= (sxhash "ab") (sxhash (copy-seq "ab"))))))

;;; 255
(answer 255 (list (eq 'foo ':key) (eql (let ((s (make-string-input-stream "ab cd"))) (list (read-preserving-whitespace s) (read-char-no-hang s) (peek-char t s) (listen s) (input-stream-p s) (output-stream-p s) (streamp s) (open-stream-p s) (close s))) (let ((x 5)) (handler-bind ((error (lambda (c) (declare (ignore c)) (invoke-restart 'store-value 12)))) (ccase x (1 'one) (12 'twelve) (255 'byte) ((0 -7 3) 'other))))) (equal (remove-if #'oddp '(1 2 3 4 5 6) :start 1 :end 5 :count 3) (destructuring-bind (a (b &optional (c (let ((l nil)) (tagbody (go two) one (push 1 l) (go end) two (push 2 l) (go one) end) l))) &rest d &key k) '(1 (2) :k 3) (list a b c d k))) (equalp (block b255 (list 1 (return-from b255 (let ((a (butlast '(3 1 2))) (b (nreverse (list 3 1 2)))) (sort (union a b :test #'equal) #'<))))) (with-open-stream (s (make-string-input-stream "1 2")) (list (read s) (read s) (read s nil :eof))))))

;;; 256
(answer 256 (list (equal (list (ash (numerator -7/3) 1) 0 (logcount (logand 1000003 255))) (nconc (list 1 2 2 1) (copy-list (nreconc (list 3 1 2) (list 3 1 2))))) (equalp (string nil) (string-upcase (let ((*print-length* 2) (*print-level* 1)) (prin1-to-string '(1 (2 (3)) 4 5))))) (equalp 1 1.0) (equalp #() (copy-seq #(3 1 2 1)))))

;;; 257
(answer 257 (list (typep (multiple-value-list (values (let ((s (make-string-input-stream "ab cd"))) (list (read-preserving-whitespace s) (read-char-no-hang s) (peek-char t s) (listen s) (input-stream-p s) (output-stream-p s) (streamp s) (open-stream-p s) (close s))) (let* ((a (make-random-state t)) (b (make-random-state a))) (equal (list (random 1000 a) (random 1000 a)) (list (random 1000 b) (random 1000 b)))))) 'integer) (typep (list (streamp *standard-output*) (streamp *standard-input*) (streamp *error-output*) (streamp *trace-output*) (streamp *terminal-io*) (streamp *query-io*) (streamp *debug-io*) *print-base* *read-base* *read-default-float-format* (consp *features*)) '(or symbol string)) (typep (ash (lcm (gcd) 1) (- 0)) '(integer 0 255)) (typep (let ((x 5)) (handler-bind ((error (lambda (c) (declare (ignore c)) (invoke-restart 'store-value 12)))) (ccase x (1 'one) (12 'twelve) (255 'byte) ((0 -7 3) 'other)))) '(member a foo 1)) (typep (let (a b) (setf (values a b) (values (fill (list 1 2 3 4 5 6) (loop initially (princ 'start) for c across "" do (when (char= c #\b) (loop-finish)) (princ c) finally (princ 'end)) :start 1 :end 7) (handler-case (symbol-value 'nothing257) (unbound-variable (c) (cell-error-name c))))) (list a b)) '(and atom (not null))) (typep (handler-case (read-from-string "(1 2") (end-of-file (c) (streamp (stream-error-stream c)))) 'sequence) (typep (* (gcd (abs (gcd)) 12) (+ (lognot 4611686018427387903) 1000003)) '(satisfies evenp))))

;;; 258
(answer 258 (typecase (let ((x (list (find (gcd -100000000000000000000 12) (copy-seq (delete-duplicates (list 1 2 2 1) :key #'-))) (find (integer-length -100000000000000000000) (substitute-if-not 4611686018427387903 (lambda (x) (> x 2)) (remove 255 (delete 0 (vector 4 3 2 1))) :count 1) :test #'<) (find (isqrt (abs (gcd))) (delete-if-not #'evenp (vector 4 3 2 1)) :key (constantly 1000003) :from-end t)))) (declare (ignorable x) (type t x)) (symbol-macrolet ((y (list x))) y)) (integer 'integer) (symbol 'symbol) (string 'string) (list 'list) (float 'float) (t 'other)))

;;; 259
(answer 259 (etypecase (list (merge 'list (list 1 3 5) (list 2 3 4) #'<) (merge 'vector (vector 1 4) (list 2 3) #'<)) (number 'number) (symbol 'symbol)))

;;; 260
(deftype small260 (&optional (n 10)) (list 'integer 0 n))
(answer 260 (list (typep -100000000000000000000 'small260) (typep (logxor (mod -7 3) (ldb (byte 2 2) (logior -100000000000000000000 1)) 4611686018427387903) '(small260 300))))

;;; 261
(answer 261 (let ((x (list (coerce (fill (vector 4 3 2 1) 12) 'list) (coerce (nsubstitute-if-not (logxor -100000000000000000000 (gcd) 255) #'oddp (list 3 1 2)) 'vector) (coerce '(#\a #\b) 'string) (coerce "c" 'character) (coerce -2.25 'double-float)))) (check-type x integer) x))

;;; 262
(answer 262 (list (multiple-value-list (subtypep 'fixnum 'rational)) (multiple-value-list (subtypep '(integer 0 0) '(integer 0 2)))))

;;; 263
(answer 263 (the integer (1- (dpb (logcount 4611686018427387903) (byte 3 1) (logand 1000003 -7)))))

;;; 264
(answer 264 (if nil (list (lognor 1 (- (* 12 1000003) (1+ (gcd)))) (logorc1 (signum (abs 1)) 255) (logorc2 12 -7)) (let ((n (numerator (* 1/2 1/2)))) (list (incf n) (decf n (ash 0 3)) (incf n (- (- 22/7 -7/3) 1/2)) n))))

;;; 265
(answer 265 (and (handler-bind ((error (lambda (c) (declare (ignore c)) (store-value (let ((s 0)) (dolist (x (ldiff nil nil) (list s x)) (incf s x))))))) (restart-case (error "x") (store-value (v) (list 'stored v)))) (with-input-from-string (s "one two (3 4) x") (list (read s) (read-char s) (peek-char nil s) (unread-char (read-char s) s) (read-line s) (read-line s nil 'eof) (read s nil 'end))) (with-output-to-string (s) (write-string (string-left-trim '(#\a #\H) (let ((*print-length* 2) (*print-level* 1)) (prin1-to-string '(1 (2 (3)) 4 5)))) s) (write-char #\a s) (terpri s) (prin1 (list (cl:signal 'condition) (typep (make-condition 'simple-warning) 'warning) (handler-case (cl:signal 'simple-condition) (condition () 'got))) s) (princ (list (sort (nunion (list 1 2 2 1) (copy-list '(1 2 3 4 5))) #'<) (nintersection (list 3 1 2) (list 3 1 2)) (nset-difference (copy-list nil) (copy-list '(3 1 2))) (sort (nset-exclusive-or (list 1 2 2 1) (list 3 1 2)) #'<)) s) (print (locally (declare (optimize speed)) (let ((x 1) (y 2)) (psetq x y y x) (psetf x (+ x y) y x) (list x y))) s) (fresh-line s) (write-line "a-b c" s) (write (funcall (lambda (a b) (list a b)) (flet ((f (x) (list 'f x)) (g (&rest r) r)) (f (g (let ((x 1) (y 2)) (psetq x y y x) (psetf x (+ x y) y x) (list x y)) (let ((x 'a)) (handler-bind ((error (lambda (c) (declare (ignore c)) (invoke-restart 'store-value 7)))) (ctypecase x (integer (list 'integer x))))))))) :stream s))))

;;; 266
(answer 266 (or nil (loop for i from 1 to 2 append (list i i))))

;;; 267
(answer 267 (cond ((list (= (mod (*) -3) (max (rationalize 0.0) (/ 4611686018427387903 3) (mod (+) -3))) (/= (*) (+) (+)) (< (/ (rationalize 3.0e-5)) (rational 0.1)) (> (+ (rem (*) -3) 22/7) (*)) (<= (- (+)) (lognot 0) (+)) (>= -2.25 (*))) (length (multiple-value-list (get-setf-expansion '(car x))))) ((list (getf nil :a) (getf nil :z (list (bit-orc2 #*0101 #*0101) (bit #*0011 2) (count 1 #*0011) (position 0 #*0101))) (multiple-value-list (get-properties nil '(:b :c))))) (t (let ((l nil)) (tagbody (go two) one (push 1 l) (go end) two (push 2 l) (go one) end) l))))

;;; 268
(answer 268 (when (list (evenp (+ (signum 12) (+ 0 0))) (oddp 1000003) (zerop (+)) (plusp (expt 1.5 1)) (minusp (max (+) (min (+) (*)) (+)))) (let ((b (make-array 4 :element-type '(unsigned-byte 8) :initial-element 7))) (setf (aref b 2) 255) (list b (reverse b) (find 255 b) (subseq b 1 3)))))

;;; 269
(answer 269 (unless (= (expt 1 (- 5)) (max (list (float 255) (float (sqrt 2.0)) (float -7 1.0)) (- (*) (+)) (- (*))) (rationalize 0.0)) (list (cl:signal 'condition) (typep (make-condition 'simple-warning) 'warning) (handler-case (cl:signal 'simple-condition) (condition () 'got))) (list (parse-integer "ff" :radix 16) (parse-integer " 12 x" :junk-allowed t) (parse-integer "a12b" :start 1 :end 3))))

;;; 270
(answer 270 (case (ldb (byte 1 2) (gcd)) ((0 1) 'low) (255 'byte) (otherwise (list (constantp (the integer (denominator -7/3))) (constantp 'x) (constantp ''x) (special-operator-p 'if) (special-operator-p 'car) (compiled-function-p #'car) (functionp #'car) (functionp 'car)))))

;;; 271
(answer 271 (case nil (a 1) ((foo nil) 2) (t 3)))

;;; 272
(answer 272 (ecase (gcd) (1 'one) (12 'twelve)))

;;; 273
(answer 273 (let ((x (let ((b (make-array 4 :element-type '(unsigned-byte 8) :initial-element 7))) (setf (aref b 2) 255) (list b (reverse b) (find 255 b) (subseq b 1 3)))) (y (consp (quote (let ((n 0)) (let ((inc (lambda () (incf n))) (get (lambda () n))) (funcall inc) (funcall inc) (funcall get))))))) (let* ((x y) (z x)) (list x y z))))

;;; 274
(answer 274 (let ((x 1) (y 2)) (psetq x y y x) (psetf x (+ x y) y x) (list x y)))

;;; 275
(answer 275 (let ((x (list 1 2 3)) (y (let ((n (lcm (ash 255 (- 5)) 4611686018427387903))) (list (incf n) (decf n (1- (- 1000003 -100000000000000000000))) (incf n (* 22/7 1/2)) n)))) (rotatef (first x) (third x) y) (shiftf (second x) y (list (boole boole-1 (mod -7 3) (rem (logcount 1) 7)) (boole boole-2 (lognot (lcm 255 -100000000000000000000)) (ash 1 (- 3))) (boole boole-and (gcd) 1) (boole boole-ior (ash 0 5) (logand 1000003 12)) (boole boole-xor (logior (1+ 4611686018427387903) (rem 4611686018427387903 2)) (- (abs 255) (* 0 (gcd)))) (boole boole-eqv (numerator (+ -7/3 22/7 -7/3)) (gcd (isqrt (abs 1000003)) -7)) (boole boole-nand (logand (ash 12 0) (numerator -7/3)) -100000000000000000000) (boole boole-nor (+ -7 (isqrt (abs 1))) 1000003))) (list x y)))

;;; 276
(answer 276 (let ((n (signum (denominator (- 1/2 22/7))))) (list (incf n) (decf n (gcd)) (incf n (* (- 255 1) (+ (* -7/3 1/2) 12 (+ 1/2 22/7 22/7)))) n)))

;;; 277
(answer 277 (let ((v (vector 1 2 3)) (i 0)) (incf (aref v (incf i)) (isqrt (abs (abs (dpb -7 (byte 7 3) 0))))) (decf (aref v i)) (list v i)))

;;; 278
(answer 278 (prog1 (or (list (= (/ (+) (*)) (list (float -100000000000000000000) (float 1.0e10) (float (gcd) 1.0))) (/= (+) (*) (expt 2 (- 2))) (< (*) (* (+) (+))) (> (*) (* (*) (*))) (<= (*) (expt -7/3 5) (+ (+) (*))) (>= (expt 3 (- 2)) (list (float 12) (float 0.0) (float 4611686018427387903 1.0)))) (multiple-value-list (values (car '(5 -5 5)) (etypecase (multiple-value-list (with-simple-restart (cl:abort "Leave.") (cl:abort))) (number 'number) (symbol 'symbol))))) (list (search '(1 2) (substitute-if 255 #'plusp '(5 -5 5))) (search (reverse (remove-duplicates (stable-sort (list 1 2 2 1) #'> :key #'1+))) '(3 1 2)) (mismatch (substitute 0 (integer-length 4611686018427387903) (remove-duplicates (nsubstitute 1 1 (vector 4 3 2 1)) :from-end t)) (remove 12 (fill (vector 4 3 2 1) -100000000000000000000))) (mismatch (append (reverse '(1 2 3 4 5)) (cons (gcd) '(5 -5 5))) #() :test #'=))))

;;; 279
(answer 279 (prog2 (list (every #'< (append '(3 1 2) (nthcdr 3 '(1 2 3 4 5))) #(1 2 3)) (some (lambda (x y) (and (> x y) (list x y))) #() (nconc (list 3 1 2) (copy-list '(1 2 3 4 5))))) (list (map-into (copy-seq #(1 2 3)) (constantly 255) (substitute-if-not (+ -100000000000000000000 1000003) (lambda (x) (> x 2)) (nsubstitute-if-not -100000000000000000000 #'evenp (vector 4 3 2 1)) :count 1)) (map-into (list 1 2 2 1) #'+ (ldiff nil nil) (delete-if (lambda (x) (> x 2)) (list 1 2 2 1)))) (let ((h (make-hash-table))) (dolist (x nil) (incf (gethash x h 0))) (list (loop for k being the hash-keys of h collect k) (loop for v being the hash-values of h using (hash-key k) collect (cons k v)) (progn (clrhash h) (hash-table-count h))))))

;;; 280
(answer 280 (progn (handler-case (destructuring-bind (a b) (last '(5 -5 5) 1) (list a b)) (error () 'mismatch)) (multiple-value-call #'list (load-time-value (list 1 2)) (values (handler-bind ((error #'continue)) (cerror "Go on." "bad ~a" 1) 'continued) 1.5) (values))))

;;; 281
(answer 281 (block b281 (list 1 (return-from b281 (let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) (11) . 12) ((13) . 14) 15 16))) (list (caaaar x) (caaadr x) (caadar x) (caaddr x) (cadaar x) (cadadr x) (caddar x) (cadddr x)))))))

;;; 282
(answer 282 (let ((l nil)) (tagbody (go two) one (push 1 l) (go end) two (push 2 l) (go one) end) l))

;;; 283
(answer 283 (catch 'k (list (throw 'k (let ((s (copy-symbol 'foo)) (u (gentemp))) (list (symbol-name s) (eq s 'foo) (symbolp u) (integerp *gensym-counter*)))) (progn (pprint (copy-list (nthcdr 2 '(1 2 3 4 5)))) 'pretty))))

;;; 284
(answer 284 (let ((l nil)) (list (catch 'k (unwind-protect (throw 'k 1000003) (push (loop with a = -7 and b = (handler-case (read-from-string "(1 2") (end-of-file (c) (streamp (stream-error-stream c)))) repeat 0 collect a collect b) l))) l)))

;;; 285
(answer 285 (prog ((x (1+ 0))) (setq x (list x x)) (return x)))

;;; 286
(answer 286 (prog* ((x (ash (mod 0 1) (- 1))) (y (list x))) (return (list x y))))

;;; 287
(answer 287 (do ((i 0 (1+ i)) (l nil (cons i l))) ((= i 2) l)))

;;; 288
(answer 288 (do* ((i 0 (+ i 2)) (j i (+ i 1))) ((> i 5) (list i j)) (when (= i 4) (return 'early))))

;;; 289
(answer 289 (let ((l nil)) (dotimes (i 1 (list i l)) (push i l))))

;;; 290
(answer 290 (let ((s 0)) (dolist (x nil (list s x)) (incf s x))))

;;; 291
(answer 291 (multiple-value-list (values (list (loop for x in (nthcdr 3 (nbutlast (list 3 1 2) 5)) always (numberp x)) (loop for x in '(1 2 3 4 5) never (eql x 2)) (loop for x in '(3 1 2) thereis (and (> x 2) x))) (let ((v (make-array 5 :initial-contents '(1 2 3 4 5) :fill-pointer 3))) (setf (fill-pointer v) 0) (list v (length v) (array-total-size v) (aref v 4) (reverse v))))))

;;; 292
(answer 292 (multiple-value-bind (a b c) (values (funcall (constantly (logior 255 12)) (lognot (* 1 1))) (prog* ((x -100000000000000000000) (y (list x))) (return (list x y)))) (list a b c)))

;;; 293
(answer 293 (multiple-value-call #'list (list (copy-tree '((1 . 2) 3)) (copy-alist '((a . 1) (b . 2))) (tree-equal '((1 . 2) 3) '(a (b . c) (d (e)))) (tree-equal '(a (b . c) (d (e))) '((1 . 2) 3) :test #'equal)) (values (let* ((a (vector 1 2 3 4 5 6)) (d (make-array 3 :displaced-to a :displaced-index-offset 2))) (setf (aref d 1) (gcd)) (list a d (nreverse d) a)) (loop with a = 1000003 and b = (with-input-from-string (s "one two (3 4) x") (list (read s) (read-char s) (peek-char nil s) (unread-char (read-char s) s) (read-line s) (read-line s nil 'eof) (read s nil 'end))) repeat 2 collect a collect b)) (values)))

;;; 294
(answer 294 (multiple-value-list (multiple-value-prog1 (values (list (consp (list (sqrt 16) (sqrt 2) (exp -0.25) (log 10.0) (log 8 2) (exp 0))) (atom '(3 1 2)) (listp (multiple-value-list (with-simple-restart (cl:abort "Leave.") (cl:abort)))) (null (typecase (handler-case (cl:assert (= 1 12)) (error () 'assertion)) (integer 'integer) (symbol 'symbol) (string 'string) (list 'list) (float 'float) (t 'other))) (endp (last (cons 4611686018427387903 nil) 3)) (not (let* ((a (vector 1 2 3 4 5 6)) (d (make-array 3 :displaced-to a :displaced-index-offset 2))) (setf (aref d 1) (integer-length 4611686018427387903)) (list a d (nreverse d) a)))) 2) (list (every #'plusp (remove-if (lambda (x) (> x 2)) (reverse (remove-if #'evenp (delete-if-not #'oddp (vector 4 3 2 1)))))) (some #'plusp (remove-duplicates (stable-sort (list 1 2 2 1) #'< :key (complement #'zerop)) :from-end t)) (notevery #'evenp (remove-duplicates (delete -7 (list 1 2 2 1)))) (notany (lambda (x) (> x 2)) (stable-sort (list 3 1 2) #'> :key (lambda (x) (* x x))))))))

;;; 295
(answer 295 (let (a b) (multiple-value-setq (a b) (floor (denominator (- (- 22/7 -7/3) (+ 1/2 1/2 22/7))) 1)) (list a b)))

;;; 296
(answer 296 (list (nth-value 1 (floor (gcd) 7)) (multiple-value-list (values-list (nthcdr 5 (revappend '(5 -5 5) (copy-list '(5 -5 5))))))))

;;; 297
(answer 297 (let (a b) (setf (values a b) (values (do ((i 0 (1+ i)) (l nil (cons i l))) ((= i 0) l)) (let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) 11 . 12) (13 . 14) 15 16))) (list (caar x) (cadr x) (cdar x) (cddr x) (caaar x) (caadr x) (cadar x) (caddr x) (cdaar x) (cdadr x) (cddar x) (cdddr x))))) (list a b)))

;;; 298
(answer 298 (destructuring-bind (a (b &optional (c (apply #'+ (dpb (mod 0 3) (byte 2 3) (1- 12)) nil))) &rest d &key k) '(1 (2) :k 3) (list a b c d k)))

;;; 299
(answer 299 (handler-case (destructuring-bind (a b) (cons (logxor -100000000000000000000 (gcd 255 1) (logxor 1000003 -7 (gcd))) (nbutlast (list 3 1 2) 1)) (list a b)) (error () 'mismatch)))

;;; 300
(answer 300 (progv '(*p300*) (list (loop for x across #(3 1 2) sum x into s count (oddp x) into c maximize x into m finally (return (list s c m)))) (symbol-value '*p300*)))

;;; 301
(answer 301 (locally (declare (optimize speed)) (let ((x 'a)) (handler-bind ((error (lambda (c) (declare (ignore c)) (invoke-restart 'store-value 7)))) (ctypecase x (integer (list 'integer x)))))))

;;; 302
(answer 302 (consp (quote (mapcar (let ((k (rem 1000003 1))) (lambda (x) (+ x k))) '(5 -5 5)))))

;;; 303
(answer 303 (eval-when (:execute :load-toplevel :compile-toplevel) (handler-bind ((warning #'muffle-warning)) (warn "w ~a" (loop for x on (rest '(3 1 2)) by #'cddr nconc (list (length x)))) 'warned)))

;;; 304
(answer 304 (load-time-value (list 1 2)))

;;; 305
(answer 305 (let ((x (list (< (abs (- pi 3.141592653589793)) 1.0e-15)))) (declare (ignorable x) (type t x)) (symbol-macrolet ((y (list x))) y)))

;;; 306
(answer 306 (funcall (constantly 0) (- 4611686018427387903 (ldb (byte 3 5) (abs 1)))))

;;; 307
(answer 307 (apply #'+ (isqrt (abs (logcount 255))) (reverse '(1 2 3 4 5))))

;;; 308
(answer 308 (apply #'list (list (< 1000 array-dimension-limit) (< 7 array-rank-limit) (< 1000 array-total-size-limit) (bit (make-array 4 :element-type 'bit :initial-element 1) 2) (sbit (make-array 4 :element-type 'bit :initial-element 0) 1)) '(3 1 2)))

;;; 309
(answer 309 (flet ((f (x) (list 'f x)) (g (&rest r) r)) (f (g (error (let ((spec (byte 7 1))) (list (byte-size spec) (byte-position spec) (ldb-test spec -7) (mask-field spec (gcd 1000003 0)) (deposit-field (logand -7 4611686018427387903) spec (ash -7 (- 0)))))) (let ((s (gensym "Q"))) (list (symbolp s) (boundp s) (fboundp s) (char (symbol-name s) 0) (symbol-plist s)))))))

;;; 310
(answer 310 (labels ((f (n) (if (< n 1) nil (cons n (f (- n 1)))))) (f 2)))

;;; 311
(answer 311 ((lambda (a &optional (b (macrolet ((m (&whole w x) (list 'quote (list w x)))) (m (ldb (byte 1 3) (lcm 12 12)))) b-p) &rest r &key (k (symbol-value 'unbound-thing311)) &aux (z (list a b))) (list b-p r k z)) 1 2 :k 3))

;;; 312
(answer 312 (funcall (lambda (&key a ((:other o) (unless (< call-arguments-limit 50) (list (< 20 lambda-parameters-limit) (< 19 multiple-values-limit) (if (member '&rest lambda-list-keywords) t)))) &allow-other-keys) (list a o)) :a 1 :b 2))

;;; 313
(answer 313 (funcall (lambda (a b) (list a b)) (list (cl:signal 'condition) (typep (make-condition 'simple-warning) 'warning) (handler-case (cl:signal 'simple-condition) (condition () 'got)))))

;;; 314
(answer 314 (let ((n 0)) (let ((inc (lambda () (incf n))) (get (lambda () n))) (funcall inc) (funcall inc) (funcall get))))

;;; 315
(answer 315 (mapcar (let ((k (1- -100000000000000000000))) (lambda (x) (+ x k))) (rest '(1 2 3 4 5))))

;;; 316
(answer 316 (list (identity (list (eval '(+ 1 (ash (logior 1 4611686018427387903) 0))) (eval (1- (dpb 4611686018427387903 (byte 7 1) -7))) (eval ''a) (funcall (compile nil '(lambda (x) (* x 2))) (integer-length 0)))) (funcall (constantly (handler-case (car (let ((x 5)) (handler-bind ((error (lambda (c) (declare (ignore c)) (invoke-restart 'store-value 12)))) (ccase x (1 'one) (12 'twelve) (255 'byte) ((0 -7 3) 'other))))) (type-error () 'type-error) (:no-error (x) (list x)))) 1 2) (funcall (complement #'plusp) (rem 12 7))))

;;; 317
(defun f317 (x &optional (y (+ (- (lognot 1) (lcm (gcd) -100000000000000000000)) (mod (gcd) 7)))) "Doc." (list x y))
(answer 317 (list (f317 (handler-case (/ (1+ (denominator 1/2)) 0) (arithmetic-error (c) (list (arithmetic-error-operation c) (second (arithmetic-error-operands c)))))) (if (fboundp 'f317) t) (funcall 'f317 1 2) (funcall (fdefinition 'f317) 3) (documentation 'f317 'function)))

;;; 318
(defmacro m318 (a &body b) `(list ,a ,@b))
(answer 318 (list (m318 (* (logxor (rem 255 2) (logcount 0) (signum (gcd))) (numerator -7/3)) (list (alpha-char-p #\Z) (alphanumericp (char-downcase (char-upcase #\-))) (graphic-char-p (code-char (+ 65 0))) (upper-case-p (char-downcase #\a)) (lower-case-p (code-char (+ 65 3))) (both-case-p (code-char (+ 65 2))) (characterp (concatenate 'bit-vector (bit-ior #*0011 #*0101) #*0101)) (standard-char-p (char-downcase (code-char (+ 65 2))))) (list (eq (intern "FOO") 'foo) (multiple-value-list (find-symbol "CAR" "COMMON-LISP")) (packagep *package*) (package-name (find-package "KEYWORD")) (package-name (symbol-package 'car)))) (macroexpand-1 '(m318 1 2)) (macroexpand '(m318 3)) (functionp (macro-function 'm318))))

;;; 319
(answer 319 (macrolet ((m (&whole w x) (list 'quote (list w x)))) (m (gcd -100000000000000000000 (1+ 1)))))

;;; 320
(defmacro w320 (&whole w x &environment e) (declare (ignore e x)) `',w)
(answer 320 (w320 (ldb (byte 3 1) (- (mod 4611686018427387903 1) (dpb -7 (byte 7 5) 1000003)))))

;;; 321
(defvar *v321* (ldb (byte 1 5) (numerator 22/7)) "A variable.")
(defparameter *w321* (lcm (rem 12 3) 1000003))
(defconstant c321 5)
(answer 321 (let ((*v321* 1)) (list *v321* *w321* c321 (documentation '*v321* 'variable) (boundp '*v321*))))

;;; 322
(define-modify-macro add322 (&rest r) + "Adds.")
(answer 322 (let ((x (logxor -100000000000000000000 255 (integer-length -7)))) (add322 x 1 2) x))

;;; 323
(defun second323 (l) (nth 1 l))
(defsetf second323 (l) (new) `(setf (nth 1 ,l) ,new))
(answer 323 (let ((l (list 1 2 3))) (setf (second323 l) (list (parse-integer "ff" :radix 16) (parse-integer " 12 x" :junk-allowed t) (parse-integer "a12b" :start 1 :end 3))) l))

;;; 324
(defun put324 (l v) (setf (car l) v))
(defun get324 (l) (car l))
(defsetf get324 put324)
(answer 324 (let ((l (list 1 2))) (setf (get324 l) (list least-positive-normalized-single-float least-positive-normalized-short-float least-positive-normalized-long-float least-negative-normalized-single-float least-negative-normalized-short-float least-negative-normalized-long-float)) (list l (get324 l))))

;;; 325
(defun (setf top325) (v l) (setf (car l) v))
(answer 325 (let ((l (list 1 2))) (setf (top325 l) (loop for i downfrom 5 to 5 by 2 collect i)) (push 5 (cdr l)) l))

;;; 326
(define-setf-expander tail326 (l) (let ((v (gensym)) (s (gensym))) (values (list v) (list l) (list s) `(progn (setf (cdr ,v) ,s) ,s) `(cdr ,v))))
(defun tail326 (l) (cdr l))
(answer 326 (let ((l (list 1 2))) (setf (tail326 l) (nconc (copy-list (reverse '(5 -5 5))) (copy-list (list 0 1 4611686018427387903)))) l))

;;; 327
(answer 327 (length (multiple-value-list (get-setf-expansion '(car x)))))

;;; 328
(declaim (special *d328*))
(proclaim '(special *e328*))
(answer 328 (list (setq *d328* (let ((s (make-string-input-stream "ab cd"))) (list (read-preserving-whitespace s) (read-char-no-hang s) (peek-char t s) (listen s) (input-stream-p s) (output-stream-p s) (streamp s) (open-stream-p s) (close s)))) *d328* (eval '(let ((*e328* 2)) (symbol-value '*e328*)))))

;;; 329
(define-symbol-macro s329 (list 1 (labels ((f (n) (if (< n 1) nil (cons n (f (- n 1)))))) (f 2))))
(answer 329 s329)

;;; 330
(answer 330 (list (eval '(+ 1 (gcd))) (eval (lognot (signum 1000003))) (eval ''a) (funcall (compile nil '(lambda (x) (* x 2))) (- (* 255 12) (gcd (+ 255 1) (logcount 12))))))

;;; 331
(answer 331 (unless (< call-arguments-limit 50) (list (< 20 lambda-parameters-limit) (< 19 multiple-values-limit) (if (member '&rest lambda-list-keywords) t))))

;;; 332
(defgeneric g332 (x))
(defmethod g332 (x) (list 'any x))
(defmethod g332 ((x number)) (list 'number (call-next-method)))
(defmethod g332 ((x (eql 1))) (list 'one (next-method-p)))
(answer 332 (list (g332 (list (let ((s (make-random-state t))) (random-state-p s)) (random-state-p *random-state*) (< -1 (random 10) 10) (< (random 1.0) 1.0))) (g332 1) (g332 -2.25)))

;;; 333
(defstruct s333 (a -100000000000000000000) (b nil))
(answer 333 (let ((s (make-s333 :b (string< "abc" "xabd" :start2 1)))) (setf (s333-a s) (let ((x (list single-float-epsilon short-float-epsilon long-float-epsilon single-float-negative-epsilon short-float-negative-epsilon long-float-negative-epsilon))) (check-type x integer) x)) (list s (s333-p s) (s333-p 5) (s333-b s) (equalp s (copy-s333 s)) (typep s 's333) (copy-structure s))))

;;; 334
(defstruct (p334 (:constructor new334 (x &optional (y 12)))) x y)
(defstruct (q334 (:include p334 (x 5)) (:conc-name qq-)) z)
(answer 334 (let ((q (make-q334 :z (parse-integer "1x2")))) (list (new334 (let ((p (list :a 1 :b 2))) (list (remf p :z) p (setf (getf p :n) (logxor (logcount -100000000000000000000) (logand (gcd) (gcd)) (rem 4611686018427387903 3))) (incf (getf p :m 10)) p))) q (qq-x q) (p334-x q) (p334-p q))))

;;; 335
(defstruct (l335 (:type list) :named) a b)
(answer 335 (list (make-l335 :a 1 :b (list (nsubst 'x 'c (copy-tree '((1 . 2) 3))) (nsubst-if 'x #'numberp (copy-tree '((1 . 2) 3))) (nsubst-if-not 'x #'listp (copy-tree '(a (b . c) (d (e))))))) (l335-a (make-l335 :a (let ((h (make-hash-table :test 'eql)) (l nil)) (setf (gethash "a" h) 1 (gethash (list (sublis '((a . 1) nil (c . 3)) '(a (b . c) (d (e)))) (nsublis '((a . z)) (copy-tree '((1 . 2) 3)))) h) 2 (gethash "A" h) 3) (maphash (lambda (k v) (push (list k v) l)) h) (list (reverse l) (hash-table-test h) (hash-table-p h) (hash-table-p (handler-case (/ 1 0) (arithmetic-error (c) (list (arithmetic-error-operation c) (second (arithmetic-error-operands c)))))))))) (l335-p '(1))))

;;; 336
(defstruct r336 (a 1 :read-only t) (b 2 :type integer))
(answer 336 (r336-a (list (read-from-string "#3r102") (multiple-value-list (read-from-string "a b" t nil :start 1)))))

;;; 337
(defstruct (pp337 (:print-function (lambda (o s d) (declare (ignore d)) (format s "<~a>" (pp337-a o))))) a)
(answer 337 (prin1-to-string (make-pp337 :a (multiple-value-list (with-simple-restart (r "Leave.") (invoke-restart (find-restart 'r)))))))

;;; 338
(defstruct po338 a)
(defmethod print-object ((o po338) s) (print-unreadable-object (o s) (format s "po ~a" (po338-a o))))
(answer 338 (format nil "~a" (make-po338 :a (list most-positive-double-float (< -1.0e-300 least-negative-double-float 0 least-positive-double-float 1.0e-300) most-negative-double-float double-float-epsilon double-float-negative-epsilon))))

;;; 339
(answer 339 (handler-case (error "text ~a" (list (streamp *standard-output*) (streamp *standard-input*) (streamp *error-output*) (streamp *trace-output*) (streamp *terminal-io*) (streamp *query-io*) (streamp *debug-io*) *print-base* *read-base* *read-default-float-format* (consp *features*))) (error (c) (let ((text (princ-to-string c))) (if (eql 0 (search "text " text)) text 'other)))))

;;; 340
(answer 340 (handler-case (error 'type-error :datum (list least-positive-normalized-double-float least-negative-normalized-double-float) :expected-type 'list) (type-error (c) (list (type-error-datum c) (typep (type-error-datum c) (type-error-expected-type c))))))

;;; 341
(answer 341 (handler-case (car (list (string-equal (let ((*print-base* 2) (*print-radix* t)) (prin1-to-string 255)) "abc") (string-not-equal (format nil "~f|~,2f|~8,3f|~e|~,3e|~$|~g" 0.5 -0.25 0.5 1.0 0.5 1.0 1.0) (format nil "~d item~:p|~d cit~:@p|~p" 0 1 5)) (string-lessp (format nil "~a|~s|~10a|~10@a|~va" (let ((v (make-array 2 :initial-element (multiple-value-bind (v c) (ignore-errors (error 'simple-error :format-control "x ~a" :format-arguments '(1))) (list v (simple-condition-format-control c) (simple-condition-format-arguments c))) :adjustable t :fill-pointer 0))) (list (vector-push (let* ((a (make-random-state t)) (b (make-random-state a))) (equal (list (random 1000 a) (random 1000 a)) (list (random 1000 b) (random 1000 b)))) v) (vector-push-extend (read-char (make-string-input-stream "")) v) (vector-push-extend 4611686018427387903 v) (fill-pointer v) (vector-pop v) v (array-has-fill-pointer-p v) (adjustable-array-p v))) (let ((x (list 1 2 3)) (y (let ((n 0)) (let ((inc (lambda () (incf n))) (get (lambda () n))) (funcall inc) (funcall inc) (funcall get))))) (rotatef (first x) (third x) y) (shiftf (second x) y (let ((l '(1 2 3 4 5 6 7 8 9 10 11))) (list (sixth l) (seventh l) (eighth l) (ninth l) (tenth l)))) (list x y)) ':key ':key 0 'v) (format nil "~a")) (string-greaterp "Hello World" (substitute #\! (char-upcase #\a) (format nil "~a ~*~a|~2:*~a" 1 2 (let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) (11) . 12) ((13) . 14) 15 16))) (list (cdaaar x) (cdaadr x) (cdadar x) (cdaddr x) (cddaar x) (cddadr x) (cdddar x) (cddddr x))) 4))) (string-not-greaterp (format nil "~#[none~;one ~a~:;several~]" (cond (t (let ((b (make-array 4 :element-type '(unsigned-byte 8) :initial-element 7))) (setf (aref b 2) 255) (list b (reverse b) (find 255 b) (subseq b 1 3)))) ((= least-positive-single-float least-positive-short-float least-positive-long-float (- least-negative-single-float) (- least-negative-short-float) (- least-negative-long-float))) (t (list (integerp (get-universal-time)) (integerp (get-internal-real-time)) (integerp (get-internal-run-time)) (integerp internal-time-units-per-second) (length (multiple-value-list (get-decoded-time))) (stringp (lisp-implementation-type)) (stringp (lisp-implementation-version)) (progn (sleep 0) 1))))) (nstring-capitalize (copy-seq (format nil "a~10tb~5@tc~%~2,4td" )))) (string-not-lessp (format nil "~(~a~)|~:(~a~)|~@(~a~)|~:@(~a~)" (string-trim "a Z" "a-b c") (nstring-upcase (copy-seq "fresh")) (write-to-string (+) :base 8) (write-to-string (handler-bind ((error #'continue)) (cerror "Go on." "bad ~a" 1) 'continued) :escape nil)) (prin1-to-string (- (+)))))) (type-error () 'type-error) (:no-error (x) (list x))))

;;; 342
(answer 342 (handler-case (/ (signum 1000003) 0) (arithmetic-error (c) (list (arithmetic-error-operation c) (second (arithmetic-error-operands c))))))

;;; 343
(answer 343 (multiple-value-bind (v c) (ignore-errors (error 'simple-error :format-control "x ~a" :format-arguments '(1))) (list v (simple-condition-format-control c) (simple-condition-format-arguments c))))

;;; 344
(answer 344 (let ((l nil)) (handler-case (handler-bind ((error (lambda (c) (declare (ignore c)) (push 'bound l)))) (error "x")) (error () (push (list #*0011 (bit (bit-and #*0011 (bit-not #*0101)) 2) (count 1 (bit-orc2 #*0101 #*0011)) (position 0 (bit-xor (reverse #*0011) (bit-xor #*0011 #*0101)))) l))) l))

;;; 345
(answer 345 (restart-case (invoke-restart 'r (if (= (rational 0.0) (*) (rem (*) -3)) (multiple-value-list (decode-float 0.1)) (list (typep (list single-float-epsilon short-float-epsilon long-float-epsilon single-float-negative-epsilon short-float-negative-epsilon long-float-negative-epsilon) 'integer) (typep nil '(or symbol string)) (typep (logior 1000003 -7) '(integer 0 255)) (typep (list (find-if #'oddp (copy-seq (remove-if-not #'oddp (sort (vector 4 3 2 1) #'<)))) (find-if-not #'plusp (delete-duplicates (list 1 2 2 1) :key #'identity)) (find-if (lambda (x) (> x 2)) #() :from-end t)) '(member a foo 1)) (typep (eval-when (:execute :load-toplevel :compile-toplevel) (with-open-stream (s (make-string-input-stream "1 2")) (list (read s) (read s) (read s nil :eof)))) '(and atom (not null))) (typep (list (sin 1.0) (cos 0.5) (tan -0.25) (asin 1.0) (acos -0.25) (atan 1.0e10) (atan 1 -1)) 'sequence) (typep 255 '(satisfies evenp))))) (r (x) (list 'r x))))

;;; 346
(answer 346 (handler-bind ((error (lambda (c) (declare (ignore c)) (use-value (list most-positive-double-float (< -1.0e-300 least-negative-double-float 0 least-positive-double-float 1.0e-300) most-negative-double-float double-float-epsilon double-float-negative-epsilon))))) (restart-case (error "x") (use-value (v) (list 'used v)) (store-value (v) v))))

;;; 347
(answer 347 (handler-bind ((error (lambda (c) (declare (ignore c)) (store-value (multiple-value-list (integer-decode-float (sqrt 2.0))))))) (restart-case (error "x") (store-value (v) (list 'stored v)))))

;;; 348
(answer 348 (handler-bind ((error #'continue)) (cerror "Go on." "bad ~a" 1) 'continued))

;;; 349
(answer 349 (multiple-value-list (with-simple-restart (r "Leave.") (invoke-restart (find-restart 'r)))))

;;; 350
(answer 350 (multiple-value-list (with-simple-restart (cl:abort "Leave.") (cl:abort))))

;;; 351
(answer 351 (handler-bind ((warning #'muffle-warning)) (warn "w ~a" (with-input-from-string (s "one two (3 4) x") (list (read s) (read-char s) (peek-char nil s) (unread-char (read-char s) s) (read-line s) (read-line s nil 'eof) (read s nil 'end)))) 'warned))

;;; 352
(answer 352 (restart-bind ((r (lambda (x) (list 'bound x)))) (list (restart-name (first (compute-restarts))) (invoke-restart 'r (loop for i downfrom 5 to 2 by 2 collect i)))))

;;; 353
(define-condition c353 (error) ((a :initarg :a :initform 5 :reader c353-a)) (:report (lambda (c s) (format s "c ~a" (c353-a c)))))
(answer 353 (handler-case (error 'c353 :a ((lambda (a &optional (b (replace (list 1 2 3 4) (sort (vector 4 3 2 1) #'<) :start1 1) b-p) &rest r &key (k (list least-positive-normalized-single-float least-positive-normalized-short-float least-positive-normalized-long-float least-negative-normalized-single-float least-negative-normalized-short-float least-negative-normalized-long-float)) &aux (z (list a b))) (list b-p r k z)) 1 2 :k 3)) (c353 (c) (list (c353-a c) (princ-to-string c)))))

;;; 354
(answer 354 (list (cl:signal 'condition) (typep (make-condition 'simple-warning) 'warning) (handler-case (cl:signal 'simple-condition) (condition () 'got))))

;;; 355
(answer 355 (handler-case (cl:assert (= 1 -7)) (error () 'assertion)))

;;; 356
(answer 356 (let ((x 5)) (handler-bind ((error (lambda (c) (declare (ignore c)) (invoke-restart 'store-value 12)))) (ccase x (1 'one) (12 'twelve) (255 'byte) ((0 -7 3) 'other)))))

;;; 357
(answer 357 (let ((x 'a)) (handler-bind ((error (lambda (c) (declare (ignore c)) (invoke-restart 'store-value 7)))) (ctypecase x (integer (list 'integer x))))))

;;; 358
(answer 358 (handler-case (unbound-function358 (unless (list (numberp (let ((l '(1 2 3 4 5 6 7 8 9 10 11))) (list (sixth l) (seventh l) (eighth l) (ninth l) (tenth l)))) (realp "abc") (rationalp (+)) (integerp (rationalize 1.0e10)) (floatp (+)) (complexp (mod (+) -3))) (prog2 (multiple-value-list (array-displacement (make-array 2 :initial-element (length (multiple-value-list (get-setf-expansion '(car x))))))) (list (realpart #C(1 2)) (imagpart #C(-1/2 3)) (expt #C(-1/2 3) 3) (/ #C(1 2) #C(3 4))) (list most-positive-single-float most-positive-short-float most-positive-long-float most-negative-single-float most-negative-short-float most-negative-long-float)) (list (map 'list (constantly 0) (substitute-if -7 #'evenp (nsubstitute-if -100000000000000000000 #'plusp (vector 4 3 2 1)))) (map 'vector #'+ (remove 255 (remove-if-not #'evenp (substitute-if 4611686018427387903 #'oddp (stable-sort (vector 4 3 2 1) #'< :key (lambda (x) (* x x)))))) (delete-if #'oddp (list 1 2 2 1))) (map nil #'identity (delete-duplicates (list 1 2 2 1) :key (lambda (x) (* x x)))) (map 'string #'char-upcase (concatenate 'string "Hello World" "" (nstring-downcase (copy-seq "ABC") :end 2)))))) (undefined-function (c) (cell-error-name c))))

;;; 359
(answer 359 (handler-case (read-from-string "(1 2") (end-of-file (c) (streamp (stream-error-stream c)))))

;;; 360
(answer 360 (error (let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) (11) . 12) ((13) . 14) 15 16))) (list (cdaaar x) (cdaadr x) (cdadar x) (cdaddr x) (cddaar x) (cddadr x) (cdddar x) (cddddr x)))))

;;; 361
(answer 361 (loop for x in '(5 -5 5) for i from 0 collect (list i x)))

;;; 362
(answer 362 (loop for x across #(3 1 2) sum x into s count (oddp x) into c maximize x into m finally (return (list s c m))))

;;; 363
(answer 363 (loop for i from 1 to 0 append (list i i)))

;;; 364
(answer 364 (loop for i downfrom 5 to 1 by 2 collect i))

;;; 365
(answer 365 (loop for (a . b) in '((a . 1) (b . 2)) when a collect (list a b) else collect 'none))

;;; 366
(answer 366 (loop for x on (make-list 3 :initial-element 0) by #'cddr nconc (list (length x))))

;;; 367
(answer 367 (loop with a = -7 and b = (string< "abc" "xabd" :start2 1) repeat 3 collect a collect b))

;;; 368
(answer 368 (loop for x = 1 then (* x 2) while (< x 50) until (> x 5) collect x))

;;; 369
(answer 369 (list (loop for x in (nreconc (copy-list nil) (list 3 1 2)) always (numberp x)) (loop for x in nil never (eql x 2)) (loop for x in '(3 1 2) thereis (and (> x 2) x))))

;;; 370
(answer 370 (loop named outer for i from 0 do (loop for j to 3 do (when (> (+ i j) 1) (return-from outer (list i j))))))

;;; 371
(answer 371 (loop for x in (cons 1 '(3 1 2)) if (evenp x) sum x into e and collect x into l else minimize x into m end finally (return (list e l m))))

;;; 372
(answer 372 (loop initially (princ 'start) for c across (format nil "~c|~:c|~@c|~?|~%~&~~|~|" (code-char (+ 65 5)) (char-upcase #\Space) #\5 "~a-~a" (list (code-char (+ 65 1)) (list (realpart (complex -7/3 5)) (imagpart (complex -7/3 5)) (expt (+ #C(-1/2 3) 1/2) 3) (/ (conjugate #C(1 2)) #C(3 4))))) do (when (char= c #\b) (loop-finish)) (princ c) finally (princ 'end)))

;;; 373
(answer 373 (let ((n 0)) (loop (when (> (incf n) 3) (return n)))))

;;; 374
(answer 374 (with-output-to-string (s) (write-string (string-right-trim "dcy" (make-string 2 :initial-element (char-downcase #\5))) s) (write-char (char-downcase (char-upcase (char-upcase #\Z))) s) (terpri s) (prin1 (when (list (evenp (signum (gcd))) (oddp (lognot 4611686018427387903)) (zerop (min (*) (*))) (plusp (max (+) (*) (*))) (minusp (/ (+)))) (handler-case (unbound-function374 (list (multiple-value-list (ffloor -2.25 2.0)) (multiple-value-list (fceiling 1.5)) (multiple-value-list (ftruncate 0.0)) (multiple-value-list (fround (sqrt 2.0))))) (undefined-function (c) (cell-error-name c)))) s) (princ (prog ((x 255)) (setq x (list x x)) (return x)) s) (print (stable-sort (list '(1 . a) '(0 . b) '(1 . c) '(0 . d)) #'< :key #'car) s) (fresh-line s) (write-line (string-upcase (format nil "~{~a~^, ~}|~:{<~a ~a>~}|~@{~a~}" (list (gcd) 1 0) '((1 2) (3 4)) (let ((s (list 1 2 3 4))) (setf (subseq s 1 3) (sort (list 3 1 2) #'<)) s) (length (let ((s (copy-symbol 'foo)) (u (gentemp))) (list (symbol-name s) (eq s 'foo) (symbolp u) (integerp *gensym-counter*)))))) s) (write (remove (lcm (denominator 1/2) 1000003) (reverse (nsubstitute-if-not 0 (lambda (x) (> x 2)) (vector 4 3 2 1))) :count 1 :from-end t) :stream s)))

;;; 375
(answer 375 (with-input-from-string (s "one two (3 4) x") (list (read s) (read-char s) (peek-char nil s) (unread-char (read-char s) s) (read-line s) (read-line s nil 'eof) (read s nil 'end))))

;;; 376
(answer 376 (let ((s (make-string-input-stream "ab cd"))) (list (read-preserving-whitespace s) (read-char-no-hang s) (peek-char t s) (listen s) (input-stream-p s) (output-stream-p s) (streamp s) (open-stream-p s) (close s))))

;;; 377
(answer 377 (let ((s (make-string-output-stream))) (format s "~a" (read-char (make-string-input-stream ""))) (finish-output s) (force-output s) (clear-output s) (list (get-output-stream-string s) (get-output-stream-string s))))

;;; 378
(answer 378 (list (read-from-string "(a . b)") (multiple-value-list (read-from-string "a b" t nil :start 1))))

;;; 379
(answer 379 (progn (print (list (acons 'foo (list (multiple-value-list (floor (* 1/2 -7/3))) (multiple-value-list (round -100000000000000000000)) (multiple-value-list (ceiling (* 22/7 22/7))) (multiple-value-list (truncate 1000003))) '((a . 1) (b . 2))) (pairlis '(c a) '(1 2) '((a . 1) (b . 2))))) (prin1 (symbol-value 'unbound-thing379)) (princ (list (parse-integer "ff" :radix 16) (parse-integer " 12 x" :junk-allowed t) (parse-integer "a12b" :start 1 :end 3))) (terpri) (write-line "x") (fresh-line) (format t "~a~%" (loop named outer for i from 0 do (loop for j to 3 do (when (> (+ i j) 0) (return-from outer (list i j)))))) 'printed))

;;; 380
(answer 380 (with-open-stream (s (make-string-input-stream "1 2")) (list (read s) (read s) (read s nil :eof))))

;;; 381
(answer 381 (read-char (make-string-input-stream "")))

;;; 382
(answer 382 (list (streamp *standard-output*) (streamp *standard-input*) (streamp *error-output*) (streamp *trace-output*) (streamp *terminal-io*) (streamp *query-io*) (streamp *debug-io*) *print-base* *read-base* *read-default-float-format* (consp *features*)))

;;; 383
(answer 383 (format nil "~a|~s|~10a|~10@a|~va" (list (< 1000 array-dimension-limit) (< 7 array-rank-limit) (< 1000 array-total-size-limit) (bit (make-array 4 :element-type 'bit :initial-element 1) 2) (sbit (make-array 4 :element-type 'bit :initial-element 0) 1)) (list least-positive-normalized-double-float least-negative-normalized-double-float) 'a 'a 3 'v))

;;; 384
(answer 384 (format nil "~d|~5d|~5,'0d|~:d|~@d|~b|~o|~x|~3r" (mod (1+ (isqrt (abs -100000000000000000000))) 2) (ash (integer-length (* 1 12)) (- 2)) 2 (1- (isqrt (abs -100000000000000000000))) (ldb (byte 3 0) (1- (logior 1 0))) 4611686018427387903 (ash (logand (abs 255) -7) 1) (signum (denominator 22/7)) (gcd 12 (ash 255 5))))

;;; 385
(answer 385 (format nil "~f|~,2f|~8,3f|~e|~,3e|~$|~g" -0.25 1.0 0.5 1.0 0.5 0.5 -0.25))

;;; 386
(answer 386 (format nil "~r|~:r|~@r" 1 5 2))

;;; 387
(answer 387 (format nil "~{~a~^, ~}|~:{<~a ~a>~}|~@{~a~}" (revappend (append (append '(1 2 3 4 5) '(1 2 3 4 5)) '(5 -5 5)) (ldiff (list* 4611686018427387903 '(1 2 3 4 5)) nil)) '((1 2) (3 4)) (list (scale-float (sqrt 2.0) 0) (float-radix 0.1) (float-sign 3.0e-5) (float-sign (sqrt 2.0) 2.0) (float-digits 1.0e10) (float-precision 1.5)) (loop for x in nil for i from 0 collect (list i x))))

;;; 388
(answer 388 (format nil "~[zero~;one~:;many~]|~:[no~;yes~]|~@[x=~a~]" 2 (list (logbitp 0 (numerator (- -7/3 22/7))) (logtest 12 (1- (+ -7 1)))) 'foo))

;;; 389
(answer 389 (format nil "~(~a~)|~:(~a~)|~@(~a~)|~:@(~a~)" (format nil (formatter "~a+~a") (loop for x = 1 then (* x 2) while (< x 50) until (> x 3) collect x) (let ((h (make-hash-table)) (l nil)) (setf (gethash 1 h) 'a (gethash 2 h) 'b) (with-hash-table-iterator (next h) (loop (multiple-value-bind (more k v) (next) (if more (push (cons k v) l) (return))))) (reverse l))) (let ((*print-base* 2) (*print-radix* t)) (prin1-to-string (integer-length (numerator 1/2)))) (format nil "~r|~:r|~@r" 2 5 3) (string-capitalize (string-downcase (nstring-upcase (copy-seq "fresh")) :start 1))))

;;; 390
(answer 390 (format nil "~a ~*~a|~2:*~a" 1 2 (list (integerp (get-universal-time)) (integerp (get-internal-real-time)) (integerp (get-internal-run-time)) (integerp internal-time-units-per-second) (length (multiple-value-list (get-decoded-time))) (stringp (lisp-implementation-type)) (stringp (lisp-implementation-version)) (progn (sleep 0) 1)) 4))

;;; 391
(answer 391 (format nil "~d item~:p|~d cit~:@p|~p" 3 1 5))

;;; 392
(answer 392 (format nil "~c|~:c|~@c|~?|~%~&~~|~|" #\a (code-char (+ 65 3)) (char-downcase (char-upcase #\Space)) "~a-~a" (list (list (first (nreverse (copy-list nil))) (second (nreconc (copy-list '(1 2 3 4 5)) (copy-list '(3 1 2)))) (third (butlast (list* 12 '(3 1 2)))) (fourth (cons (ash 0 (- 0)) '(1 2 3 4 5))) (fifth (rest (ldiff '(5 -5 5) nil)))) (apply #'list (do* ((i 0 (+ i 2)) (j i (+ i 1))) ((> i 5) (list i j)) (when (= i 4) (return 'early))) (append '(3 1 2) '(3 1 2))))))

;;; 393
(answer 393 (format nil "a~10tb~5@tc~%~2,4td" ))

;;; 394
(answer 394 (format nil "~10<~a~>|~10:<~a~>|~10@<~a~>|~12<~a~;~a~;~a~>" ':key nil nil 'a 'b 'c))

;;; 395
(answer 395 (format nil "~w|~a ~:a ~:s" (loop for x in (cons 1 (nreverse (list 3 1 2))) if (evenp x) sum x into e and collect x into l else minimize x into m end finally (return (list e l m))) nil nil nil))

;;; 396
(answer 396 (format nil (formatter "~a+~a") (let ((h (make-hash-table))) (list (integerp (hash-table-size h)) (realp (hash-table-rehash-size h)) (realp (hash-table-rehash-threshold h)) (= (sxhash "ab") (sxhash (copy-seq "ab"))))) (handler-case (error 'type-error :datum (let (a b) (multiple-value-setq (a b) (floor (isqrt (abs (gcd))) 1)) (list a b)) :expected-type 'list) (type-error (c) (list (type-error-datum c) (typep (type-error-datum c) (type-error-expected-type c)))))))

;;; 397
(answer 397 (format nil "~#[none~;one ~a~:;several~]" (list (symbolp (let ((b (make-array 4 :element-type '(unsigned-byte 8) :initial-element 7))) (setf (aref b 2) 255) (list b (reverse b) (find 255 b) (subseq b 1 3)))) (keywordp nil) (symbol-name ':key) (eq 'foo 'a) (symbol-package ':k))))

;;; 398
(answer 398 (format nil "~a"))

;;; 399
(answer 399 (list (multiple-value-list (decode-universal-time 3600000000 0)) (encode-universal-time 5 4 3 2 1 2001 0)))

;;; 400
(answer 400 (list (integerp (get-universal-time)) (integerp (get-internal-real-time)) (integerp (get-internal-run-time)) (integerp internal-time-units-per-second) (length (multiple-value-list (get-decoded-time))) (stringp (lisp-implementation-type)) (stringp (lisp-implementation-version)) (progn (sleep 0) 1)))

;;; 401
(answer 401 (let ((*trace-output* (make-string-output-stream))) (time (let ((l nil)) (tagbody (go two) one (push 1 l) (go end) two (push 2 l) (go one) end) l))))

;;; 402
(answer 402 (bit-not #*0011))

;;; 403
(answer 403 (bit-and (bit-andc1 #*0101 (bit-ior #*0101 #*0101)) (bit-andc1 (bit-not (bit-xor #*0011 #*0101)) (reverse (bit-and #*0011 #*0011)))))

;;; 404
(answer 404 (bit-ior (bit-ior (reverse (bit-xor #*0101 #*0101)) #*0011) (bit-orc2 (bit-andc1 (bit-ior #*0011 #*0011) (bit-and #*0011 #*0101)) (bit-andc1 #*0101 (bit-and #*0011 #*0011)))))

;;; 405
(answer 405 (bit-xor (bit-not (bit-not (reverse #*0101))) #*0101))

;;; 406
(answer 406 (bit-andc1 #*0101 (reverse (bit-orc2 (bit-orc2 #*0011 #*0101) (bit-andc1 #*0101 #*0011)))))

;;; 407
(answer 407 (bit-orc2 (bit-not (bit-orc2 (bit-xor #*0011 #*0011) #*0101)) #*0011))

;;; 408
(answer 408 (reverse (bit-ior (bit-not (bit-xor #*0011 #*0101)) (reverse (bit-ior #*0101 #*0101)))))

;;; 409
(answer 409 (list #*0101 (bit (bit-and #*0011 #*0011) 2) (count 1 #*0011) (position 0 (bit-not (bit-ior (bit-and #*0101 #*0101) (bit-andc1 #*0101 #*0011))))))

;;; 410
(answer 410 (concatenate 'bit-vector (bit-andc1 #*0101 (bit-and (reverse #*0011) #*0101)) #*0011))

;;; 411
(answer 411 (let ((b (copy-seq #*0011))) (setf (sbit b 1) 1) (list b (equal b (bit-not (reverse (bit-and #*0101 #*0101)))) (coerce b 'list))))

;;; 412
(answer 412 (complex (+ (+ (* -7/3 22/7) (+ -7/3 -7/3 1/2) (- 22/7 1/2)) (- -100000000000000000000 (+ 1/2 22/7 -7/3)) 22/7) 5))

;;; 413
(answer 413 (+ #C(-1/2 3) 1000003))

;;; 414
(answer 414 (conjugate #C(1 2)))

;;; 415
(answer 415 (list (+ #C(-1/2 3) #C(-1/2 3)) (- (complex -7/3 5) #C(1 2)) (* (conjugate (conjugate (+ #C(1 2) 1/2))) (conjugate (complex (- -7/3 1/2) 5))) (= (+ (conjugate (+ #C(1 2) 1/2)) 22/7) (conjugate (+ (complex 22/7 5) 1/2)))))

;;; 416
(answer 416 (list (realpart #C(1 2)) (imagpart #C(-1/2 3)) (expt (complex -7/3 5) 3) (/ (complex (+ (* 1/2 -7/3) (- 1/2 -7/3) -7) 5) #C(3 4))))

;;; 417
(answer 417 (let* ((a (vector 1 2 3 4 5 6)) (d (make-array 3 :displaced-to a :displaced-index-offset 2))) (setf (aref d 1) (ash (ash 255 (- 5)) 3)) (list a d (nreverse d) a)))

;;; 418
(answer 418 (let ((b (make-array 4 :element-type '(unsigned-byte 8) :initial-element 7))) (setf (aref b 2) 255) (list b (reverse b) (find 255 b) (subseq b 1 3))))

;;; 419
(answer 419 (let* ((a (make-string-output-stream)) (b (make-string-output-stream)) (s (make-broadcast-stream a b))) (prin1 (* (gcd) (+ -100000000000000000000 (gcd))) s) (write-string "xyzzy" s) (list (get-output-stream-string a) (get-output-stream-string b))))

;;; 420
(answer 420 (let ((s (make-concatenated-stream (make-string-input-stream "(a ") (make-string-input-stream "b) c")))) (list (read s) (read s) (read s nil 12))))
