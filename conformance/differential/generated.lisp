;;;; Made from `grammar.txt` with the seed 1997: change that, not this.

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
(answer 37 (list (numberp (locally (declare (optimize speed)) (eval-when (:execute :load-toplevel :compile-toplevel) (let ((s (gensym "Q"))) (list (symbolp s) (boundp s) (fboundp s) (char (symbol-name s) 0) (symbol-plist s)))))) (realp (list (logandc1 12 (gcd)) (logandc2 (lcm (rem 0 3) (abs -7)) (lcm (denominator -7/3) (logand 255 12))) (logeqv (logior (ash -100000000000000000000 (- 2)) (ldb (byte 2 5) 1000003)) 1) (lognand (lognot (ldb (byte 1 1) 4611686018427387903)) (+ (logxor 255 -100000000000000000000 12) (+ -7 -100000000000000000000))))) (rationalp (+)) (integerp (expt 2 (- 1))) (floatp (+)) (complexp (expt (+ (- 1/2 1/2) (gcd) -100000000000000000000) 0))))

;;; 38
(answer 38 (list (evenp (logand (gcd -7 (1+ 1)) (logcount (abs 12)))) (oddp (mod (ash 4611686018427387903 0) 3)) (zerop (max (*) (+ (rationalize 0.1) (* (*) (*))) (/ (- (*))))) (plusp (+ (/ 255 2) (rem (rem (+) -3) -3))) (minusp (* (*) (- (/ (+)) (+))))))

;;; 39
(answer 39 (sqrt 2.0))

;;; 40
(answer 40 (list (sqrt 16) (sqrt 2) (exp 0.5) (log 10.0) (log 8 2) (exp 0)))

;;; 41
(answer 41 (list (sin 0.5) (cos -0.25) (tan -0.25) (asin 1.0) (acos 1.0) (atan 0.0) (atan 1 -1)))

;;; 42
(answer 42 (list (sinh 0.5) (cosh -0.25) (tanh -0.25) (asinh 0.5) (acosh 1.5) (atanh 0.25)))

;;; 43
(answer 43 (list (< (abs (- pi 3.141592653589793)) 1.0e-15)))

;;; 44
(answer 44 (+ (*) (rational 1.0e10)))

;;; 45
(answer 45 (- 0 (*)))

;;; 46
(answer 46 (* (expt 3 (- 5)) (- (+))))

;;; 47
(answer 47 (+))

;;; 48
(answer 48 (*))

;;; 49
(answer 49 (- (min (mod (expt -7/3 5) -3) (*))))

;;; 50
(answer 50 (/ 0 1))

;;; 51
(answer 51 (/ (/ (+) (mod 22/7 -3)) (*)))

;;; 52
(answer 52 (/ (min (+) (*))))

;;; 53
(answer 53 (+ (+ 1/2 (* (gcd) 1000003) (- -7/3 1/2)) -7/3 -7/3))

;;; 54
(answer 54 (* (- (lcm 12 1) 22/7) (+ (- (+ 22/7 -7/3 1/2) (* 22/7 1/2)) 1/2 (* (gcd) -7/3))))

;;; 55
(answer 55 (- (* (- 4611686018427387903 (+ -7/3 22/7 1/2)) 22/7) (* (- (+ -7/3 1/2 22/7) (- 22/7 22/7)) (+ -7/3 -7/3 1/2))))

;;; 56
(answer 56 (+ (logior (rem 1000003 7) 0) -7))

;;; 57
(answer 57 (* -7 (denominator 1/2)))

;;; 58
(answer 58 (- (gcd) (1- (logand (ldb (byte 1 0) 0) (ash (gcd) (- 1))))))

;;; 59
(answer 59 (max (+) 1.0e10 (expt 1.5 0)))

;;; 60
(answer 60 (min (*) (rational 3.0e-5)))

;;; 61
(answer 61 (expt 22/7 2))

;;; 62
(answer 62 (expt 2 (- 3)))

;;; 63
(answer 63 (expt 3.0e-5 0))

;;; 64
(answer 64 (gcd 4611686018427387903 (lognot (logxor (mod -100000000000000000000 3) -100000000000000000000 1000003))))

;;; 65
(answer 65 (lcm (denominator (+ (* 22/7 -7/3) 1/2 1/2)) (signum (lognot (ldb (byte 7 3) 1)))))

;;; 66
(answer 66 (gcd))

;;; 67
(answer 67 (list (multiple-value-list (floor (+) 7)) (multiple-value-list (ceiling -7/3 7))))

;;; 68
(answer 68 (list (multiple-value-list (truncate (+) 2)) (multiple-value-list (round (/ (+) (- (max (*) (*) (*)) (/ 1000003 3))) 3))))

;;; 69
(answer 69 (list (multiple-value-list (floor -7/3)) (multiple-value-list (round 255)) (multiple-value-list (ceiling (- (* -7 (- -7/3 1/2)) 22/7))) (multiple-value-list (truncate (* (+ 1/2 22/7 22/7) 22/7)))))

;;; 70
(answer 70 (list (multiple-value-list (floor -100000000000000000000 (ash (isqrt (abs (signum 0))) 2))) (multiple-value-list (truncate 12 (logand 1 4611686018427387903)))))

;;; 71
(answer 71 (list (multiple-value-list (ffloor 1.5 2.0)) (multiple-value-list (fceiling 3.0e-5)) (multiple-value-list (ftruncate 1.0e10)) (multiple-value-list (fround (sqrt 2.0)))))

;;; 72
(answer 72 (mod (logxor (abs (numerator -7/3)) (rem (dpb 1000003 (byte 2 5) 255) 7) 255) 1))

;;; 73
(answer 73 (rem (isqrt (abs (- (1+ 12) (logcount 12)))) 7))

;;; 74
(answer 74 (mod (expt (sqrt 2.0) 1) -3))

;;; 75
(answer 75 (rem (+) -3))

;;; 76
(answer 76 (list (= (list (float (dpb 1000003 (byte 1 3) (* -7 255))) (float 1.5) (float (gcd 4611686018427387903 12) 1.0)) (*)) (/= (min (/ 1 2) (+)) (ash -7 (- 5)) 1) (< (expt (sqrt 2.0) 0) (expt (- 1/2 (* 1/2 22/7)) 2)) (> (expt 2 (- 1)) (* (+) (list (float (1+ 255)) (float 0.0) (float -100000000000000000000 1.0)))) (<= (+) (*) (- (*) (/ (max (*) (+) (+)) (/ (+))))) (>= (rationalize 0.1) (mod (- 1000003) -3))))

;;; 77
(answer 77 (= (rational 1.0e10) (+) (+ (*) (*))))

;;; 78
(answer 78 (ash (lcm 0 (gcd)) 0))

;;; 79
(answer 79 (ash 12 (- 2)))

;;; 80
(answer 80 (logand (isqrt (abs (gcd (numerator -7/3) (* (gcd) 1)))) 255))

;;; 81
(answer 81 (logior (ldb (byte 1 5) 1000003) -7))

;;; 82
(answer 82 (logxor (logxor (dpb (1- 4611686018427387903) (byte 3 1) 4611686018427387903) 0 (lognot (logcount 0))) (ash -100000000000000000000 (- 3)) (denominator -7/3)))

;;; 83
(answer 83 (list (logandc1 255 (signum (integer-length 12))) (logandc2 -100000000000000000000 1000003) (logeqv 4611686018427387903 (gcd (abs (logior -7 -100000000000000000000)) (- (integer-length 0) (1- 1)))) (lognand (gcd) -7)))

;;; 84
(answer 84 (list (lognor 1 (+ 4611686018427387903 (denominator (+ 22/7 22/7 1/2)))) (logorc1 (rem (lognot (gcd 0 1000003)) 1) -100000000000000000000) (logorc2 (isqrt (abs 255)) (logxor (ldb (byte 2 5) (integer-length (gcd))) (lcm (+ 12 255) (lognot 1)) (rem (gcd) 7)))))

;;; 85
(answer 85 (list (logbitp 3 (denominator (+ -7 0 -7))) (logtest (- (ash (+ 12 1) 3) 4611686018427387903) (abs (gcd)))))

;;; 86
(answer 86 (ldb (byte 7 1) (gcd -100000000000000000000 4611686018427387903)))

;;; 87
(answer 87 (dpb (logior (integer-length (dpb 0 (byte 1 0) 255)) (logand (logior (gcd) -100000000000000000000) 12)) (byte 3 2) (* (1- (logxor 1000003 (gcd) 1000003)) (mod (logcount (gcd)) 7))))

;;; 88
(answer 88 (let ((spec (byte 3 3))) (list (byte-size spec) (byte-position spec) (ldb-test spec (logcount -100000000000000000000)) (mask-field spec 12) (deposit-field (signum (logand (+ 4611686018427387903 255) 12)) spec (signum (mod 1000003 2))))))

;;; 89
(answer 89 (let ((n 1000003)) (setf (ldb (byte 3 2) n) (abs (isqrt (abs (- 1 1))))) (setf (mask-field (byte 2 0) n) (numerator (* 4611686018427387903 (+ -7/3 -7/3 22/7)))) n))

;;; 90
(answer 90 (list (boole boole-1 (1+ (lcm (1+ -7) 255)) (1- (ash (* 0 -100000000000000000000) 2))) (boole boole-2 (numerator -7/3) (ash (gcd (* 4611686018427387903 1) (ldb (byte 3 5) 0)) (- 1))) (boole boole-and (denominator 1/2) (1- 12)) (boole boole-ior -100000000000000000000 -7) (boole boole-xor (integer-length (abs (lcm 12 (gcd)))) (- (logcount (ash 0 3)) 1)) (boole boole-eqv (rem (+ 255 4611686018427387903) 1) (mod 255 3)) (boole boole-nand (1+ (lognot (ash -100000000000000000000 (- 5)))) (gcd)) (boole boole-nor 1000003 (lcm 0 (dpb -7 (byte 7 2) (+ 12 -100000000000000000000))))))

;;; 91
(answer 91 (list (boole boole-andc1 (ash (1- (logand (gcd) 4611686018427387903)) (- 2)) (logxor (numerator (- 22/7 -7/3)) (rem (* 0 1) 2) (denominator 1/2))) (boole boole-andc2 -7 (abs -7)) (boole boole-orc1 (mod (ash (dpb 255 (byte 3 1) 1000003) (- 0)) 2) (1+ (isqrt (abs (signum 4611686018427387903))))) (boole boole-orc2 (gcd (integer-length (logxor 0 -100000000000000000000 (gcd))) (numerator 22/7)) 1) (boole boole-c1 1000003 (ash (logior (ldb (byte 1 3) 1) (- 1000003 1000003)) 5)) (boole boole-c2 12 (gcd (numerator -7/3) (gcd))) (boole boole-clr (abs -100000000000000000000) (lcm (ash (+ 4611686018427387903 255) (- 0)) 0)) (boole boole-set (- 255 (1- 12)) -7)))

;;; 92
(answer 92 (multiple-value-list (decode-float 0.1)))

;;; 93
(answer 93 (multiple-value-list (integer-decode-float 0.0)))

;;; 94
(answer 94 (list (scale-float -2.25 1) (float-radix 1.0e10) (float-sign 1.5) (float-sign -2.25 2.0) (float-digits 0.1) (float-precision 0.0)))

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
(answer 100 (progn (pprint '(3 1 2)) 'pretty))

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
(answer 108 (prin1-to-string (sqrt 2.0)))

;;; 109
(answer 109 (princ-to-string (remove (lognot (logand 1 -7)) (substitute-if (logxor 0 -100000000000000000000 -7) #'oddp #(3 1 2 1)) :count 1 :from-end t)))

;;; 110
(answer 110 (write-to-string (min (/ (- (+))) (*)) :base 8))

;;; 111
(answer 111 (write-to-string '(5 -5 5) :escape nil))

;;; 112
(answer 112 (let ((*print-base* 2) (*print-radix* t)) (prin1-to-string (mod (lognot 12) 2))))

;;; 113
(answer 113 (let ((*print-length* 2) (*print-level* 1)) (prin1-to-string '(1 (2 (3)) 4 5))))

;;; 114
(answer 114 (let ((*print-case* :downcase) (*print-escape* nil)) (write-to-string '(Foo "x" |Bar|))))

;;; 115
(answer 115 (let ((*print-array* nil) (*print-gensym* nil)) (write-to-string (make-symbol "X"))))

;;; 116
(answer 116 (let ((*print-circle* nil) (*print-readably* nil) (*print-pretty* nil)) (write-to-string '(a (b . c) (d (e))))))

;;; 117
(answer 117 (char-upcase (code-char (+ 65 3))))

;;; 118
(answer 118 (char-downcase (char-upcase (code-char (+ 65 1)))))

;;; 119
(answer 119 (code-char (+ 65 5)))

;;; 120
(answer 120 (list (char-code (char-upcase (char-downcase (code-char (+ 65 1))))) (char-int (char-upcase (char-downcase (char-downcase #\a)))) (char-name #\Newline) (name-char "space") (digit-char 2) (digit-char 11 16) (digit-char-p (code-char (+ 65 0))) (digit-char-p #\f 16)))

;;; 121
(answer 121 (list (alpha-char-p (code-char (+ 65 5))) (alphanumericp (char-upcase (char-upcase #\Space))) (graphic-char-p #\Z) (upper-case-p (char-downcase (char-downcase #\Space))) (lower-case-p (code-char (+ 65 1))) (both-case-p #\-) (characterp (do ((i 0 (1+ i)) (l nil (cons i l))) ((= i 3) l))) (standard-char-p #\-)))

;;; 122
(answer 122 (list (char= (code-char (+ 65 2)) (char-upcase #\5)) (char/= #\Z #\a) (char< (char-downcase (char-upcase #\Space)) (char-downcase #\-) (code-char (+ 65 2))) (char> #\5 (char-upcase (char-downcase (code-char (+ 65 0))))) (char<= #\Z (char-upcase (char-upcase #\Space))) (char>= (code-char (+ 65 3)) (char-downcase (code-char (+ 65 2))))))

;;; 123
(answer 123 (list (char-equal #\5 (char-downcase (code-char (+ 65 1)))) (char-not-equal (char-downcase (char-upcase #\a)) #\-) (char-lessp (code-char (+ 65 0)) #\5) (char-greaterp (char-downcase (char-downcase (char-upcase #\a))) #\Z) (char-not-greaterp #\a (char-downcase (char-upcase (char-downcase #\5)))) (char-not-lessp #\5 (char-upcase (code-char (+ 65 0))))))

;;; 124
(answer 124 (list (character 'x) (character "y") (character (char-upcase (code-char (+ 65 3)))) (< 1000 char-code-limit)))

;;; 125
(answer 125 (string-upcase (let ((*print-base* 2) (*print-radix* t)) (prin1-to-string (integer-length (signum 0))))))

;;; 126
(answer 126 (string-downcase (format nil "~a") :start 1))

;;; 127
(answer 127 (string-capitalize (format nil "~a")))

;;; 128
(answer 128 (nstring-upcase (copy-seq "fresh")))

;;; 129
(answer 129 (nstring-downcase (copy-seq "ABC") :end 2))

;;; 130
(answer 130 (nstring-capitalize (copy-seq (let ((*print-length* 2) (*print-level* 1)) (prin1-to-string '(1 (2 (3)) 4 5))))))

;;; 131
(answer 131 (string-trim "a Z" (let ((*print-array* nil) (*print-gensym* nil)) (write-to-string (make-symbol "X")))))

;;; 132
(answer 132 (string-left-trim '(#\a #\H) (subseq "abcdefgh" 1)))

;;; 133
(answer 133 (string-right-trim "dcy" "abc"))

;;; 134
(answer 134 (string 'foo))

;;; 135
(answer 135 (make-string 2 :initial-element (char-upcase (char-downcase #\Z))))

;;; 136
(answer 136 (concatenate 'string (format nil "~(~a~)|~:(~a~)|~@(~a~)|~:@(~a~)" (write-to-string (destructuring-bind (a (b &optional (c (list most-positive-single-float most-positive-short-float most-positive-long-float most-negative-single-float most-negative-short-float most-negative-long-float))) &rest d &key k) '(1 (2) :k 3) (list a b c d k)) :escape nil) (reverse "") (format nil "~(~a~)|~:(~a~)|~@(~a~)|~:@(~a~)" (format nil "~r|~:r|~@r" 0 5 3) (format nil "~10<~a~>|~10:<~a~>|~10@<~a~>|~12<~a~;~a~;~a~>" 'a nil ':key 'a 'b 'c) (format nil "~#[none~;one ~a~:;several~]" (let ((s (make-string-input-stream "ab cd"))) (list (read-preserving-whitespace s) (read-char-no-hang s) (peek-char t s) (listen s) (input-stream-p s) (output-stream-p s) (streamp s) (open-stream-p s) (close s)))) (write-to-string (+) :base 8)) (string-upcase (format nil "~d item~:p|~d cit~:@p|~p" 5 3 0))) "abc" (nstring-capitalize (copy-seq "Hello World"))))

;;; 137
(answer 137 (reverse ""))

;;; 138
(answer 138 (subseq "abcdefgh" 2))

;;; 139
(answer 139 (remove #\- (format nil "~#[none~;one ~a~:;several~]" (let ((v (make-array 5 :initial-contents '(1 2 3 4 5) :fill-pointer 3))) (setf (fill-pointer v) 1) (list v (length v) (array-total-size v) (aref v 4) (reverse v))))))

;;; 140
(answer 140 (substitute #\! (char-downcase (code-char (+ 65 5))) (format nil "~d item~:p|~d cit~:@p|~p" 5 0 2)))

;;; 141
(answer 141 (list (string= (string-left-trim '(#\a #\H) (format nil "~c|~:c|~@c|~?|~%~&~~|~|" #\- (char-upcase #\Space) (char-downcase #\a) "~a-~a" (list (let ((x 5)) (handler-bind ((error (lambda (c) (declare (ignore c)) (invoke-restart 'store-value 12)))) (ccase x (1 'one) (12 'twelve) (255 'byte) ((0 -7 3) 'other)))) (list (scale-float 3.0e-5 5) (float-radix 0.0) (float-sign 3.0e-5) (float-sign 0.1 2.0) (float-digits 1.0e10) (float-precision -2.25))))) (format nil "~[zero~;one~:;many~]|~:[no~;yes~]|~@[x=~a~]" 3 (list (evenp (ash -100000000000000000000 0)) (oddp (1+ 12)) (zerop (gcd)) (plusp (rem (*) -3)) (minusp (*))) 'foo)) (string/= "xyzzy" "Hello World") (string< (string-capitalize (let ((*print-case* :downcase) (*print-escape* nil)) (write-to-string '(Foo "x" |Bar|)))) (string-downcase (format nil "~d|~5d|~5,'0d|~:d|~@d|~b|~o|~x|~3r" (dpb 1 (byte 7 1) -7) (gcd) 0 (rem 255 7) (* 1000003 4611686018427387903) (ldb (byte 1 2) -7) (signum 4611686018427387903) -100000000000000000000 (isqrt (abs 0))) :start 1)) (string> (format nil "~c|~:c|~@c|~?|~%~&~~|~|" #\5 (code-char (+ 65 3)) (code-char (+ 65 3)) "~a-~a" (list (progv '(*p141*) (list (remove-if #'plusp '(1 2 3 4 5 6) :start 1 :end 5 :count 1)) (symbol-value '*p141*)) (let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) 11 . 12) (13 . 14) 15 16))) (list (caar x) (cadr x) (cdar x) (cddr x) (caaar x) (caadr x) (cadar x) (caddr x) (cdaar x) (cdadr x) (cddar x) (cdddr x))))) "a-b c") (string<= (nstring-downcase (copy-seq "ABC") :end 2) (princ-to-string (list (multiple-value-list (floor (+) 1)) (multiple-value-list (ceiling (+ (+) (*)) 7))))) (string>= (let ((*print-array* nil) (*print-gensym* nil)) (write-to-string (make-symbol "X"))) (format nil "~d|~5d|~5,'0d|~:d|~@d|~b|~o|~x|~3r" (logcount 1) (logcount (isqrt (abs (gcd)))) 2 255 255 4611686018427387903 12 (logior 1000003 (1+ 12)) (1- -7)))))

;;; 142
(answer 142 (list (string-equal (let ((*print-circle* nil) (*print-readably* nil) (*print-pretty* nil)) (write-to-string '((1 . 2) 3))) (make-string 3 :initial-element (char-upcase (char-upcase #\-)))) (string-not-equal (string 'a) (let ((*print-length* 2) (*print-level* 1)) (prin1-to-string '(1 (2 (3)) 4 5)))) (string-lessp (format nil "a~10tb~5@tc~%~2,4td" ) (string-right-trim "dcy" "")) (string-greaterp (format nil "~a") (format nil "~{~a~^, ~}|~:{<~a ~a>~}|~@{~a~}" (make-list 5 :initial-element 1000003) '((1 2) (3 4)) (list (multiple-value-list (decode-universal-time 3600000000 0)) (encode-universal-time 5 4 3 2 1 2001 0)) (do* ((i 0 (+ i 2)) (j i (+ i 1))) ((> i 5) (list i j)) (when (= i 4) (return 'early))))) (string-not-greaterp (concatenate 'string (format nil "~[zero~;one~:;many~]|~:[no~;yes~]|~@[x=~a~]" 2 (list (= (*) (*)) (/= (+) (+) (*)) (< (*) (+)) (> (*) (+)) (<= (+) (+) (*)) (>= (*) (*))) 'foo) (format nil "~{~a~^, ~}|~:{<~a ~a>~}|~@{~a~}" '(5 -5 5) '((1 2) (3 4)) (list (apply #'union (list '(3 1 2) nil)) (intersection '(1 2 3 4 5) nil) (set-difference nil nil) (set-exclusive-or '(3 1 2) '(5 -5 5)) (subsetp '(1 2 3 4 5) nil)) #()) (prin1-to-string (list (float 1000003) (float -2.25) (float 255 1.0)))) "xyzzy") (string-not-lessp (nstring-downcase (copy-seq "ABC") :end 2) "Hello World")))

;;; 143
(answer 143 (list (stringp (list (loop for x in (copy-list (nconc (list 3 1 2) (list 3 1 2))) always (numberp x)) (loop for x in '(5 -5 5) never (eql x 2)) (loop for x in (ldiff '(1 2 3 4 5) nil) thereis (and (> x 2) x)))) (simple-string-p (format nil "~f|~,2f|~8,3f|~e|~,3e|~$|~g" 1.0 -0.25 1.0 0.5 1.0 0.5 0.5)) (length (string-trim "a Z" (format nil "~10<~a~>|~10:<~a~>|~10@<~a~>|~12<~a~;~a~;~a~>" ':key 'foo nil 'a 'b 'c))) (position (char-downcase (char-downcase #\Z)) "xyzzy") (search "a-b c" (format nil "~w|~a ~:a ~:s" (list (first (cons 4611686018427387903 '(3 1 2))) (second (list* -7 nil)) (third '(5 -5 5)) (fourth (nconc (list 1 2 2 1) (list 1 2 2 1))) (fifth (append '(1 2 3 4 5) '(5 -5 5)))) nil nil nil)) (mismatch (format nil "~r|~:r|~@r" 5 0 3) (format nil "a~10tb~5@tc~%~2,4td" ))))

;;; 144
(answer 144 (let ((s (copy-seq "fresh"))) (list (char "abc" 1) (schar "abc" 2) (if (> (length s) 0) (setf (char s 0) #\Q)) s)))

;;; 145
(answer 145 (string< "abc" "xabd" :start2 1))

;;; 146
(answer 146 (list (symbolp (multiple-value-list (multiple-value-prog1 (values (let ((v (copy-seq #(1 2 3)))) (setf (svref (vector 1 2) 0) 5) (if (> (length v) 0) (setf (aref v 0) (list (character 'x) (character "y") (character #\Space) (< 1000 char-code-limit)))) (list v (arrayp (funcall (lambda (a b) (list a b)) (multiple-value-bind (v c) (ignore-errors (error 'simple-error :format-control "x ~a" :format-arguments '(1))) (list v (simple-condition-format-control c) (simple-condition-format-arguments c))))) (vectorp (destructuring-bind (a (b &optional (c (with-input-from-string (s "one two (3 4) x") (list (read s) (read-char s) (peek-char nil s) (unread-char (read-char s) s) (read-line s) (read-line s nil 'eof) (read s nil 'end))))) &rest d &key k) '(1 (2) :k 3) (list a b c d k))) (simple-vector-p (loop for x across #(3 1 2) sum x into s count (oddp x) into c maximize x into m finally (return (list s c m)))))) 2) (let ((x (let ((l nil)) (dotimes (i 1 (list i l)) (push i l)))) (y (with-output-to-string (s) (write-string "a-b c" s) (write-char #\- s) (terpri s) (prin1 (= least-positive-single-float least-positive-short-float least-positive-long-float (- least-negative-single-float) (- least-negative-short-float) (- least-negative-long-float)) s) (princ (list (merge 'list (list 1 3 5) (list 2 3 4) #'<) (merge 'vector (vector 1 4) (list 2 3) #'<)) s) (print (let ((s (gensym "Q"))) (list (symbolp s) (boundp s) (fboundp s) (char (symbol-name s) 0) (symbol-plist s))) s) (fresh-line s) (write-line (let ((*print-length* 2) (*print-level* 1)) (prin1-to-string '(1 (2 (3)) 4 5))) s) (write (list most-positive-double-float (< -1.0e-300 least-negative-double-float 0 least-positive-double-float 1.0e-300) most-negative-double-float double-float-epsilon double-float-negative-epsilon) :stream s)))) (let* ((x y) (z x)) (list x y z)))))) (keywordp 'a) (symbol-name 'a) (eq ':key nil) (symbol-package ':k)))

;;; 147
(answer 147 (let ((s (gensym "Q"))) (list (symbolp s) (boundp s) (fboundp s) (char (symbol-name s) 0) (symbol-plist s))))

;;; 148
(answer 148 (let ((s (make-symbol "S"))) (set s (remove (rem (denominator 1/2) 3) (remove-if #'oddp (remove-if-not #'plusp (sort (vector 4 3 2 1) #'<))) :count 1 :from-end t)) (setf (get s 'p) (multiple-value-list (with-simple-restart (r "Leave.") (invoke-restart (find-restart 'r))))) (setf (symbol-function s) #'identity) (list (symbol-value s) (get s 'p) (get s 'q 'none) (funcall s (isqrt (abs (- 12 (denominator -7/3))))) (if (remprop s 'p) t) (get s 'p) (if (fboundp s) t) (progn (makunbound s) (boundp s)) (progn (fmakunbound s) (fboundp s)))))

;;; 149
(answer 149 (let ((s (copy-symbol 'foo)) (u (gentemp))) (list (symbol-name s) (eq s 'foo) (symbolp u) (integerp *gensym-counter*))))

;;; 150
(answer 150 (list (eq (intern "FOO") 'foo) (multiple-value-list (find-symbol "CAR" "COMMON-LISP")) (packagep *package*) (package-name (find-package "KEYWORD")) (package-name (symbol-package 'car))))

;;; 151
(answer 151 (list (constantp (list (parse-integer "ff" :radix 16) (parse-integer " 12 x" :junk-allowed t) (parse-integer "a12b" :start 1 :end 3))) (constantp 'x) (constantp ''x) (special-operator-p 'if) (special-operator-p 'car) (compiled-function-p #'car) (functionp #'car) (functionp 'car)))

;;; 152
(answer 152 (cons (ash (logior (abs 255) (* -100000000000000000000 0)) (- 3)) '(3 1 2)))

;;; 153
(answer 153 (list (gcd (lognot (numerator 1/2)) (logxor (integer-length 0) (logand 1 1000003) (integer-length 1))) (logand -100000000000000000000 (abs (lcm 4611686018427387903 (gcd)))) (logxor 12 (ash (lognot 1) 1) (signum 0))))

;;; 154
(answer 154 (list* (* (ash (numerator 1/2) 1) (gcd (dpb 4611686018427387903 (byte 1 2) 255) (1+ (gcd)))) (nthcdr 5 (butlast '(5 -5 5)))))

;;; 155
(answer 155 (append '(3 1 2) '(1 2 3 4 5)))

;;; 156
(answer 156 (reverse (nbutlast (copy-list '(3 1 2)) 1)))

;;; 157
(answer 157 (nreverse (list 3 1 2)))

;;; 158
(answer 158 (copy-list (ldiff (nbutlast (list 1 2 2 1) 0) nil)))

;;; 159
(answer 159 (rest (nreverse (copy-list (make-list 3 :initial-element (gcd))))))

;;; 160
(answer 160 (nthcdr 2 '(3 1 2)))

;;; 161
(answer 161 (last '(5 -5 5) 5))

;;; 162
(answer 162 (butlast (last (nreconc (list 1 2 2 1) (list 3 1 2)) 2)))

;;; 163
(answer 163 (nbutlast (list 3 1 2) 1))

;;; 164
(answer 164 (nconc (copy-list nil) (list 1 2 2 1)))

;;; 165
(answer 165 (revappend '(3 1 2) (ldiff (revappend (append '(1 2 3 4 5) '(1 2 3 4 5)) nil) nil)))

;;; 166
(answer 166 (nreconc (copy-list nil) (copy-list nil)))

;;; 167
(answer 167 (make-list 5 :initial-element (ash (signum 12) (- 3))))

;;; 168
(answer 168 (ldiff '(3 1 2) nil))

;;; 169
(answer 169 (car '(5 -5 5)))

;;; 170
(answer 170 (cdr '((1 . 2) 3)))

;;; 171
(answer 171 (list (first (make-list 0 :initial-element (rem 1 7))) (second '(5 -5 5)) (third '(5 -5 5)) (fourth (rest (rest (revappend '(3 1 2) nil)))) (fifth '(1 2 3 4 5))))

;;; 172
(answer 172 (let ((l '(1 2 3 4 5 6 7 8 9 10 11))) (list (sixth l) (seventh l) (eighth l) (ninth l) (tenth l))))

;;; 173
(answer 173 (let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) 11 . 12) (13 . 14) 15 16))) (list (caar x) (cadr x) (cdar x) (cddr x) (caaar x) (caadr x) (cadar x) (caddr x) (cdaar x) (cdadr x) (cddar x) (cdddr x))))

;;; 174
(answer 174 (let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) (11) . 12) ((13) . 14) 15 16))) (list (caaaar x) (caaadr x) (caadar x) (caaddr x) (cadaar x) (cadadr x) (caddar x) (cadddr x))))

;;; 175
(answer 175 (let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) (11) . 12) ((13) . 14) 15 16))) (list (cdaaar x) (cdaadr x) (cdadar x) (cdaddr x) (cddaar x) (cddadr x) (cdddar x) (cddddr x))))

;;; 176
(answer 176 (list (consp (list (make-sequence 'list 2 :initial-element (multiple-value-list (values (let ((*trace-output* (make-string-output-stream))) (time (let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) (11) . 12) ((13) . 14) 15 16))) (list (cdaaar x) (cdaadr x) (cdadar x) (cdaddr x) (cddaar x) (cddadr x) (cdddar x) (cddddr x))))) (list (eq 'a nil) (eql (let ((x 'a)) (handler-bind ((error (lambda (c) (declare (ignore c)) (invoke-restart 'store-value 7)))) (ctypecase x (integer (list 'integer x))))) (list least-positive-normalized-double-float least-negative-normalized-double-float)) (equal (multiple-value-list (with-simple-restart (cl:abort "Leave.") (cl:abort))) (string< "abc" "xabd" :start2 1)) (equalp (with-input-from-string (s "one two (3 4) x") (list (read s) (read-char s) (peek-char nil s) (unread-char (read-char s) s) (read-line s) (read-line s nil 'eof) (read s nil 'end))) (length (multiple-value-list (get-setf-expansion '(car x))))))))) (make-sequence 'string 2 :initial-element (char-upcase (code-char (+ 65 1)))) (make-sequence 'vector 2 :initial-element 0))) (atom (let* ((a (make-random-state t)) (b (make-random-state a))) (equal (list (random 1000 a) (random 1000 a)) (list (random 1000 b) (random 1000 b))))) (listp (let ((v (make-array 2 :initial-element (length (multiple-value-list (get-setf-expansion '(car x)))) :adjustable t :fill-pointer 0))) (list (vector-push (let ((x (let ((s (make-symbol "S"))) (set s (let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) (11) . 12) ((13) . 14) 15 16))) (list (caaaar x) (caaadr x) (caadar x) (caaddr x) (cadaar x) (cadadr x) (caddar x) (cadddr x)))) (setf (get s 'p) (let ((l nil)) (tagbody (go two) one (push 1 l) (go end) two (push 2 l) (go one) end) l)) (setf (symbol-function s) #'-) (list (symbol-value s) (get s 'p) (get s 'q 'none) (funcall s 255) (if (remprop s 'p) t) (get s 'p) (if (fboundp s) t) (progn (makunbound s) (boundp s)) (progn (fmakunbound s) (fboundp s)))))) (declare (ignorable x) (type t x)) (symbol-macrolet ((y (list x))) y)) v) (vector-push-extend (let ((n 0)) (let ((inc (lambda () (incf n))) (get (lambda () n))) (funcall inc) (funcall inc) (funcall get))) v) (vector-push-extend (logcount (mod (gcd) 2)) v) (fill-pointer v) (vector-pop v) v (array-has-fill-pointer-p v) (adjustable-array-p v)))) (null (labels ((f (n) (if (< n 1) nil (cons n (f (- n 1)))))) (f 0))) (endp nil) (not (list (let ((s (make-random-state t))) (random-state-p s)) (random-state-p *random-state*) (< -1 (random 10) 10) (< (random 1.0) 1.0)))))

;;; 177
(answer 177 (list (nth 3 (cons (dpb (denominator -7/3) (byte 2 0) (+ -100000000000000000000 1000003)) (reverse (reverse '(5 -5 5))))) (list-length (revappend '(1 2 3 4 5) (nreconc (list 3 1 2) (copy-list '(1 2 3 4 5))))) (length (sort (copy-list '(5 -5 5)) #'>)) (elt '(1 2 3 4 5 6) 0)))

;;; 178
(answer 178 (let ((c (cons 1 2))) (rplaca c (let ((n 0)) (let ((inc (lambda () (incf n))) (get (lambda () n))) (funcall inc) (funcall inc) (funcall get)))) (rplacd c (multiple-value-list (multiple-value-prog1 (values (cdr '(a (b . c) (d (e)))) 2) (list (consp (list single-float-epsilon short-float-epsilon long-float-epsilon single-float-negative-epsilon short-float-negative-epsilon long-float-negative-epsilon)) (atom (loop for x across #(3 1 2) sum x into s count (oddp x) into c maximize x into m finally (return (list s c m)))) (listp (list (map 'list (lambda (x) (* x x)) (substitute -7 -7 (remove 0 (nsubstitute-if (gcd) (lambda (x) (> x 2)) (vector 4 3 2 1))))) (map 'vector #'+ (copy-seq (delete-if #'evenp (list 1 2 2 1))) (delete-if-not #'evenp (vector 4 3 2 1))) (map nil #'identity (copy-seq (remove 1000003 (fill (vector 4 3 2 1) 1000003)))) (map 'string #'char-upcase (let ((*print-array* nil) (*print-gensym* nil)) (write-to-string (make-symbol "X")))))) (null (multiple-value-bind (v c) (ignore-errors (error 'simple-error :format-control "x ~a" :format-arguments '(1))) (list v (simple-condition-format-control c) (simple-condition-format-arguments c)))) (endp (copy-list nil)) (not (let ((h (make-hash-table :test 'eq)) (l nil)) (setf (gethash "a" h) 1 (gethash (list (multiple-value-list (decode-universal-time 3600000000 0)) (encode-universal-time 5 4 3 2 1 2001 0)) h) 2 (gethash "A" h) 3) (maphash (lambda (k v) (push (list k v) l)) h) (list (reverse l) (hash-table-test h) (hash-table-p h) (hash-table-p (let ((x 5)) (handler-bind ((error (lambda (c) (declare (ignore c)) (invoke-restart 'store-value 12)))) (ccase x (1 'one) (12 'twelve) (255 'byte) ((0 -7 3) 'other)))))))))))) c))

;;; 179
(answer 179 (list (copy-tree '((1 . 2) 3)) (copy-alist '((a . 1) nil (c . 3))) (tree-equal '(a (b . c) (d (e))) '(a (b . c) (d (e)))) (tree-equal '(a (b . c) (d (e))) '((1 . 2) 3) :test #'equal)))

;;; 180
(answer 180 (list (subst (let ((a (make-array 6 :initial-contents '(1 2 3 4 5 6)))) (make-array '(2 2) :displaced-to a :displaced-index-offset 1)) 'b '(a (b . c) (d (e)))) (subst-if 0 #'symbolp '((1 . 2) 3)) (subst-if-not 0 #'consp '(a (b . c) (d (e))))))

;;; 181
(answer 181 (list (nsubst 'x 'c (copy-tree '((1 . 2) 3))) (nsubst-if 'x #'numberp (copy-tree '((1 . 2) 3))) (nsubst-if-not 'x #'listp (copy-tree '((1 . 2) 3)))))

;;; 182
(answer 182 (list (sublis '((a . 1) nil (c . 3)) '(a (b . c) (d (e)))) (nsublis '((a . z)) (copy-tree '(a (b . c) (d (e)))))))

;;; 183
(answer 183 (list (member 12 (cons (mod -7 7) '(1 2 3 4 5))) (member (logand 4611686018427387903 (+ (isqrt (abs 4611686018427387903)) 255)) (append (list -100000000000000000000 (- -7 12) 1000003) '(3 1 2)) :test #'<) (member-if (lambda (x) (> x 2)) (nthcdr 3 '(1 2 3 4 5))) (member-if-not (lambda (x) (> x 2)) (butlast '(3 1 2)))))

;;; 184
(answer 184 (list (assoc ':key '((a . 1) (b . 2))) (assoc 'b '((a . 1) (b . 2)) :test #'eq) (assoc-if #'symbolp '((a . 1) nil (c . 3))) (assoc-if-not #'symbolp '((a . 1) (2 . 3)))))

;;; 185
(answer 185 (list (rassoc (ldb (byte 1 5) (lcm 255 1)) '((a . 1) (b . 2))) (rassoc-if #'oddp '((a . 1) (b . 4))) (rassoc-if-not #'evenp '((a . 1) (b . 4)))))

;;; 186
(answer 186 (list (acons 'a (let ((s (list 1 2 3 4))) (setf (subseq s 1 3) (fill (list 1 2 2 1) (1- (gcd)))) s) '((a . 1) (b . 2))) (pairlis '(c a) '(1 2 3) '((a . 1) nil (c . 3)))))

;;; 187
(answer 187 (pairlis '(a b c) (list (quote (let ((h (make-hash-table))) (list (integerp (hash-table-size h)) (realp (hash-table-rehash-size h)) (realp (hash-table-rehash-threshold h)) (= (sxhash "ab") (sxhash (copy-seq "ab")))))) (list (sublis '((a . 1) (b . 2)) '((1 . 2) 3)) (nsublis '((a . z)) (copy-tree '((1 . 2) 3)))) (let ((l '(1 2 3 4 5 6 7 8 9 10 11))) (list (sixth l) (seventh l) (eighth l) (ninth l) (tenth l))))))

;;; 188
(answer 188 (list (getf nil :a) (getf '(:a 1 :b 2) :z (do* ((i 0 (+ i 2)) (j i (+ i 1))) ((> i 5) (list i j)) (when (= i 4) (return 'early)))) (multiple-value-list (get-properties '(:a 1 :b 2) '(:b :c)))))

;;; 189
(answer 189 (let ((p (list :a 1 :b 2))) (list (remf p :a) p (setf (getf p :n) (ldb (byte 3 3) (logior (* 4611686018427387903 1) 0))) (incf (getf p :m 10)) p)))

;;; 190
(answer 190 (list (adjoin (numerator 1/2) '(1 2 3 4 5)) (adjoin (gcd -100000000000000000000 (abs (logior (gcd) 0))) nil :key (lambda (x) (* x x))) (tailp nil (list* (ldb (byte 2 1) (rem 1 1)) (nbutlast (list 1 2 2 1) 0)))))

;;; 191
(answer 191 (list (apply #'union (list nil '(3 1 2))) (intersection (list* (dpb 0 (byte 1 2) (ash 255 (- 5))) (nthcdr 5 (nreverse (list 3 1 2)))) (nreconc (copy-list '(5 -5 5)) (copy-list (last '(5 -5 5) 1)))) (set-difference '(1 2 3 4 5) (nreconc (copy-list '(3 1 2)) (copy-list '(5 -5 5)))) (set-exclusive-or (rest '(5 -5 5)) (ldiff (nreverse (copy-list '(3 1 2))) nil)) (subsetp (nconc (copy-list (butlast nil)) (copy-list nil)) (reverse '(3 1 2)))))

;;; 192
(answer 192 (list (sort (nunion (list 3 1 2) (list 1 2 2 1)) #'<) (nintersection (copy-list (last '(1 2 3 4 5) 5)) (copy-list (list (1+ 12) (isqrt (abs 1000003)) (lcm 4611686018427387903 -7)))) (nset-difference (copy-list (nthcdr 0 '(3 1 2))) (copy-list '(5 -5 5))) (sort (nset-exclusive-or (list 1 2 2 1) (list 3 1 2)) #'<)))

;;; 193
(answer 193 (apply #'union (list (make-list 2 :initial-element -100000000000000000000) nil :test #'=)))

;;; 194
(answer 194 (let ((l (last (nreconc (copy-list '(1 2 3 4 5)) (copy-list '(1 2 3 4 5))) 2)) (m nil)) (push 255 l) (pushnew (logand (signum (mod (gcd) 3)) 12) l) (pushnew 3 l :test #'=) (setq m (pop l)) (list l m)))

;;; 195
(answer 195 (list (mapcar #'- (rest (list* 0 (append '(1 2 3 4 5) '(3 1 2))))) (mapcar #'+ '(5 -5 5) (make-list 2 :initial-element -7)) (maplist #'length (reverse (nreverse (copy-list '(5 -5 5)))))))

;;; 196
(answer 196 (let ((sum nil)) (list (mapc (lambda (x) (push x sum)) (nbutlast (list 1 2 2 1) 5)) (mapl (lambda (x) (push (length x) sum)) (butlast nil)) sum)))

;;; 197
(answer 197 (list (mapcan #'list (nreverse (list 3 1 2)) (last '(3 1 2) 0)) (mapcon #'list (list (ash (1- 4611686018427387903) 1) 1 (logior 1000003 -100000000000000000000)))))

;;; 198
(answer 198 (list (every #'evenp (nsubstitute-if 4611686018427387903 #'plusp (list 3 1 2))) (some #'plusp (revappend '(3 1 2) (revappend '(5 -5 5) nil))) (notevery #'oddp (delete-if #'oddp (copy-list nil))) (notany #'plusp (delete-if-not #'evenp (copy-seq #(3 1 2 1))))))

;;; 199
(answer 199 (list (every #'< (copy-list (copy-list nil)) #(1 2 3)) (some (lambda (x y) (and (> x y) (list x y))) #() (nthcdr 1 '(3 1 2)))))

;;; 200
(answer 200 (list (map 'list #'1+ (stable-sort (copy-list '(1 2 3 4 5)) #'> :key #'identity)) (map 'vector #'+ (delete (logcount (ash -100000000000000000000 3)) (vector 4 3 2 1)) (delete-duplicates (copy-seq #(3 1 2 1)) :key #'abs)) (map nil #'identity (delete-duplicates (copy-seq #(3 1 2 1)) :key (complement #'zerop))) (map 'string #'char-upcase (format nil "~f|~,2f|~8,3f|~e|~,3e|~$|~g" -0.25 1.0 0.5 1.0 -0.25 -0.25 1.0))))

;;; 201
(answer 201 (list (map-into (copy-seq #(1 2 3)) (complement #'zerop) (nsubstitute-if-not 4611686018427387903 (lambda (x) (> x 2)) (list 1 2 2 1))) (map-into (copy-list (nconc (copy-list nil) (copy-list '(3 1 2)))) #'+ (remove-if #'oddp (nsubstitute-if-not (lcm 12 -100000000000000000000) #'plusp (list 1 2 2 1))) (remove-duplicates (reverse (substitute-if-not -7 #'evenp (reverse (substitute-if 12 (lambda (x) (> x 2)) (substitute -7 (gcd) (stable-sort (list 3 1 2) #'> :key (lambda (x) (* x x)))))) :count 1)) :from-end t))))

;;; 202
(answer 202 (list (reduce #'+ (remove-duplicates (delete (logior -100000000000000000000 255) (list 3 1 2)) :from-end t)) (reduce #'list (remove-if-not (lambda (x) (> x 2)) (nsubstitute (ldb (byte 7 1) 1000003) 1 (vector 4 3 2 1))) :initial-value (let ((a (make-array '(2 3) :initial-contents '((1 2 3) (4 5 6))))) (list (aref a 1 2) (array-rank a) (array-dimension a 1) (array-dimensions a) (array-total-size a) (row-major-aref a 4) (array-row-major-index a 1 1) (array-in-bounds-p a 2 0) (setf (aref a 0 0) (list (member (gcd) (cons 255 '(5 -5 5))) (member (numerator 22/7) '(1 2 3 4 5) :test #'<) (member-if #'evenp '(1 2 3 4 5)) (member-if-not #'plusp '(3 1 2)))) a))) (reduce #'list (nthcdr 0 (nconc (list 1 2 2 1) (copy-list nil))) :from-end t) (reduce #'+ (substitute-if-not 0 #'evenp (nsubstitute (+ 1 (gcd)) 1 (list 1 2 2 1)) :count 1) :key (constantly -7))))

;;; 203
(answer 203 (reduce #'- (remove-duplicates (remove-duplicates (substitute-if-not 4611686018427387903 (lambda (x) (> x 2)) (nsubstitute-if 1 #'oddp (vector 4 3 2 1)) :count 1) :from-end t)) :from-end t :initial-value (isqrt (abs (lognot (dpb 12 (byte 3 5) 1)))) :start 0))

;;; 204
(answer 204 (list (find (denominator (1- 0)) #(1 2 3)) (find (rem 1000003 7) (substitute-if (ash (abs (gcd)) (- 2)) (lambda (x) (> x 2)) (copy-seq '(1 2 3 4 5))) :test #'=) (find (- (- (denominator 1/2) (1+ 12)) -7) (delete (logcount -100000000000000000000) (copy-seq #())) :key #'- :from-end t)))

;;; 205
(answer 205 (list (find-if (lambda (x) (> x 2)) (fill (copy-seq #()) (lognot (logcount -100000000000000000000)))) (find-if-not #'plusp (remove-duplicates (nsubstitute 1000003 1 (list 3 1 2)))) (find-if #'evenp (stable-sort (copy-seq #(3 1 2 1)) #'< :key (constantly (integer-length 1))) :from-end t)))

;;; 206
(answer 206 (list (position 0 (remove-duplicates (remove 1000003 (remove-duplicates (remove-if #'oddp (substitute-if-not 4611686018427387903 #'evenp (substitute-if 0 #'oddp (delete 255 (vector 4 3 2 1))) :count 1)))))) (position-if #'oddp (stable-sort (copy-list '(5 -5 5)) #'< :key (constantly (logand -7 0)))) (position-if-not #'plusp (substitute (signum (* 1 4611686018427387903)) 255 (substitute (+ 1 (gcd)) (mod 1000003 2) (sort (list 3 1 2) #'<)))) (position 1 '(1 2 1 3) :from-end t :end 2)))

;;; 207
(answer 207 (list (count (logxor (numerator 22/7) (logior (abs 255) (ash (gcd) 3)) 255) (reverse (nsubstitute 12 1 (vector 4 3 2 1)))) (count-if (lambda (x) (> x 2)) (nsubstitute-if 4611686018427387903 (lambda (x) (> x 2)) (copy-seq #(1 2 3)))) (count-if-not #'plusp (remove-duplicates (remove-if-not (lambda (x) (> x 2)) (nsubstitute-if-not -7 #'evenp (list 3 1 2))) :from-end t)) (count 1 '(1 2 1 3 1) :start 5)))

;;; 208
(answer 208 (remove (integer-length 1000003) (delete-if-not #'evenp (vector 4 3 2 1))))

;;; 209
(answer 209 (remove-if #'oddp (delete-if #'oddp (list 1 2 2 1))))

;;; 210
(answer 210 (remove-if-not #'plusp (delete-if (lambda (x) (> x 2)) (copy-list '(1 2 3 4 5)))))

;;; 211
(answer 211 (remove (ash (1+ (lognot 0)) (- 0)) (delete-duplicates (copy-seq #(3 1 2 1)) :key (constantly (dpb -100000000000000000000 (byte 1 2) 255))) :count 1 :from-end t))

;;; 212
(answer 212 (remove-if #'oddp '(1 2 3 4 5 6) :start 1 :end 5 :count 3))

;;; 213
(answer 213 (delete (- (isqrt (abs (logcount 1000003))) (gcd (logxor -7 (gcd) 1) (integer-length 12))) (vector 4 3 2 1)))

;;; 214
(answer 214 (delete-if #'evenp (copy-list nil)))

;;; 215
(answer 215 (delete-if-not #'plusp (copy-seq #())))

;;; 216
(answer 216 (remove-duplicates (substitute (lognot (ldb (byte 7 3) 4611686018427387903)) (logand (integer-length 12) -100000000000000000000) #(1 2 3))))

;;; 217
(answer 217 (remove-duplicates (nsubstitute (numerator (+ 22/7 1/2 -7/3)) 1 (copy-list '(3 1 2))) :from-end t))

;;; 218
(answer 218 (delete-duplicates (copy-list (list* 1000003 '(5 -5 5))) :key #'1+))

;;; 219
(answer 219 (substitute (gcd) (signum -100000000000000000000) (remove-if #'plusp #())))

;;; 220
(answer 220 (substitute-if -100000000000000000000 #'oddp (copy-seq (stable-sort (list 1 2 2 1) #'< :key #'identity))))

;;; 221
(answer 221 (substitute-if-not (dpb 12 (byte 3 2) (1+ (logand 1 4611686018427387903))) (lambda (x) (> x 2)) (reverse (delete-if-not #'evenp (vector 4 3 2 1))) :count 1))

;;; 222
(answer 222 (nsubstitute 255 1 (copy-list (make-list 0 :initial-element 0))))

;;; 223
(answer 223 (nsubstitute-if (signum (* (rem 1 2) (rem 4611686018427387903 1))) #'plusp (copy-list (append nil '(5 -5 5)))))

;;; 224
(answer 224 (nsubstitute-if-not (isqrt (abs -100000000000000000000)) #'plusp (vector 4 3 2 1)))

;;; 225
(answer 225 (reverse (remove-if-not #'oddp (fill (vector 4 3 2 1) (gcd)))))

;;; 226
(answer 226 (copy-seq (copy-list (nreverse (list 3 1 2)))))

;;; 227
(answer 227 (sort (copy-list (reverse '(1 2 3 4 5))) #'>))

;;; 228
(answer 228 (stable-sort (copy-list (append '(1 2 3 4 5) nil)) #'< :key (constantly 12)))

;;; 229
(answer 229 (stable-sort (list '(1 . a) '(0 . b) '(1 . c) '(0 . d)) #'< :key #'car))

;;; 230
(answer 230 (list (merge 'list (list 1 3 5) (list 2 3 4) #'<) (merge 'vector (vector 1 4) (list 2 3) #'<)))

;;; 231
(answer 231 (fill (copy-seq #(3 1 2 1)) (logxor (ash (+ 1000003 -7) 3) (ash (logior -7 0) (- 1)) (logcount (denominator 1/2)))))

;;; 232
(answer 232 (fill (list 1 2 3 4 5 6) (list (boole boole-andc1 (1- (gcd 1 255)) (* (lcm (gcd) 255) -7)) (boole boole-andc2 0 (- (mod -100000000000000000000 1) (logior 1 12))) (boole boole-orc1 -100000000000000000000 (logxor (ash 255 0) (signum 1000003) (numerator -7/3))) (boole boole-orc2 (isqrt (abs (gcd))) (logcount (- 0 4611686018427387903))) (boole boole-c1 (ldb (byte 1 1) (mod (gcd) 2)) (* (1+ 1000003) 255)) (boole boole-c2 (abs (ash 1000003 (- 2))) (logand -100000000000000000000 (lognot -7))) (boole boole-clr 0 1) (boole boole-set (1- 12) -7)) :start 1 :end 7))

;;; 233
(answer 233 (replace (list 1 2 3 4) (remove-duplicates (sort (list 3 1 2) #'>) :from-end t) :start1 1))

;;; 234
(answer 234 (list (search '(1 2) (reverse (delete-if-not (lambda (x) (> x 2)) (vector 4 3 2 1)))) (search (copy-seq (substitute-if-not (denominator -7/3) #'oddp (delete-if #'plusp (vector 4 3 2 1)) :count 1)) '(3 1 2)) (mismatch (nsubstitute-if (abs (lcm 12 0)) (lambda (x) (> x 2)) (list 1 2 2 1)) (remove-if #'evenp (remove (logxor 4611686018427387903 255 12) (nsubstitute-if-not -7 #'oddp (list 3 1 2))))) (mismatch (butlast (nreconc (copy-list '(5 -5 5)) (copy-list '(5 -5 5)))) #(3 1 2 1) :test #'=)))

;;; 235
(answer 235 (list (concatenate 'list (delete (ldb (byte 7 1) (+ -100000000000000000000 4611686018427387903)) (copy-seq #(3 1 2 1))) #(3 1 2 1)) (concatenate 'vector (sort (copy-seq #(1 2 3)) #'<) #())))

;;; 236
(answer 236 (list (coerce (fill (copy-list '(3 1 2)) (+ (denominator 22/7) (integer-length 255))) 'list) (coerce '(3 1 2) 'vector) (coerce '(#\a #\b) 'string) (coerce "c" 'character) (coerce (sqrt 2.0) 'double-float)))

;;; 237
(answer 237 (list (make-sequence 'list 2 :initial-element (labels ((f (n) (if (< n 1) nil (cons n (f (- n 1)))))) (f 3))) (make-sequence 'string 2 :initial-element (code-char (+ 65 5))) (make-sequence 'vector 3 :initial-element 0)))

;;; 238
(answer 238 (subseq (nsubstitute-if-not (gcd (+ -7 1000003) (lcm 4611686018427387903 0)) (lambda (x) (> x 2)) (vector 4 3 2 1)) 2))

;;; 239
(answer 239 (elt (remove 4611686018427387903 (remove-duplicates (remove-if-not #'plusp (substitute-if 12 #'evenp '(5 -5 5))))) 0))

;;; 240
(answer 240 (let ((s (list 1 2 3 4))) (setf (subseq s 1 3) (delete-duplicates (copy-seq #(1 2 3)) :key #'1+)) s))

;;; 241
(answer 241 (length (let ((h (make-hash-table)) (l nil)) (setf (gethash 1 h) 'a (gethash 2 h) 'b) (with-hash-table-iterator (next h) (loop (multiple-value-bind (more k v) (next) (if more (push (cons k v) l) (return))))) (reverse l))))

;;; 242
(answer 242 (let ((a (make-array '(2 3) :initial-contents '((1 2 3) (4 5 6))))) (list (aref a 1 2) (array-rank a) (array-dimension a 1) (array-dimensions a) (array-total-size a) (row-major-aref a 4) (array-row-major-index a 1 1) (array-in-bounds-p a 2 0) (setf (aref a 0 0) (list (multiple-value-list (truncate (max (rem (+) -3) (+) (+)) 3)) (multiple-value-list (round (expt 1 (- 5)) 7)))) a)))

;;; 243
(answer 243 (let ((v (make-array 2 :initial-element (list (nth 0 '(5 -5 5)) (list-length (list 0 (integer-length 1) (logcount 1000003))) (length (nsubstitute-if-not (dpb (gcd) (byte 3 5) 12) #'plusp (vector 4 3 2 1))) (elt '(1 2 3 4 5 6) 5)) :adjustable t :fill-pointer 0))) (list (vector-push (list (equal (last (nconc (list 3 1 2) (list 1 2 2 1)) 1) (cons 0 '(1 2 3 4 5))) (equalp (format nil "~a ~*~a|~2:*~a" 1 2 (apply #'list (list (streamp *standard-output*) (streamp *standard-input*) (streamp *error-output*) (streamp *trace-output*) (streamp *terminal-io*) (streamp *query-io*) (streamp *debug-io*) *print-base* *read-base* *read-default-float-format* (consp *features*)) nil) 4) (string-upcase (nstring-downcase (copy-seq "ABC") :end 2))) (equalp 1 1.0) (equalp #(3 1 2 1) (copy-seq #()))) v) (vector-push-extend (loop named outer for i from 0 do (loop for j to 3 do (when (> (+ i j) 3) (return-from outer (list i j))))) v) (vector-push-extend (isqrt (abs (rem (signum -100000000000000000000) 3))) v) (fill-pointer v) (vector-pop v) v (array-has-fill-pointer-p v) (adjustable-array-p v))))

;;; 244
(answer 244 (let ((v (make-array 5 :initial-contents '(1 2 3 4 5) :fill-pointer 3))) (setf (fill-pointer v) 1) (list v (length v) (array-total-size v) (aref v 4) (reverse v))))

;;; 245
(answer 245 (let ((a (make-array 3 :initial-element 0 :adjustable t))) (list (adjust-array a 5 :initial-element (lcm -7 (1- (gcd)))) (array-element-type (vector 1)) (upgraded-array-element-type t))))

;;; 246
(answer 246 (list (svref #(1 2 3 4 5 6) 3) (aref #(3 1 2 1) 0)))

;;; 247
(answer 247 (let ((v (copy-seq #(1 2 3)))) (setf (svref (vector 1 2) 0) 5) (if (> (length v) 0) (setf (aref v 0) (case nil (a 1) ((foo nil) 2) (t 3)))) (list v (arrayp (list (svref #(1 2 3 4 5 6) 1) (aref #() 2))) (vectorp (the integer 1000003)) (simple-vector-p (unless (< call-arguments-limit 50) (list (< 20 lambda-parameters-limit) (< 19 multiple-values-limit) (if (member '&rest lambda-list-keywords) t)))))))

;;; 248
(answer 248 (multiple-value-list (array-displacement (make-array 7 :initial-element (list (symbolp (or t (and (let ((x 1) (y 2)) (psetq x y y x) (psetf x (+ x y) y x) (list x y)) (list (< 1000 array-dimension-limit) (< 7 array-rank-limit) (< 1000 array-total-size-limit) (bit (make-array 4 :element-type 'bit :initial-element 1) 2) (sbit (make-array 4 :element-type 'bit :initial-element 0) 1)) (list (< (abs (- pi 3.141592653589793)) 1.0e-15))))) (keywordp 'foo) (symbol-name 'foo) (eq ':key 'a) (symbol-package ':k))))))

;;; 249
(answer 249 (let ((a (make-array 6 :initial-contents '(1 2 3 4 5 6)))) (make-array '(2 2) :displaced-to a :displaced-index-offset 1)))

;;; 250
(answer 250 (list (< 1000 array-dimension-limit) (< 7 array-rank-limit) (< 1000 array-total-size-limit) (bit (make-array 4 :element-type 'bit :initial-element 1) 2) (sbit (make-array 4 :element-type 'bit :initial-element 0) 1)))

;;; 251
(answer 251 (let ((h (make-hash-table))) (setf (gethash 255 h) (list (identity (fill (list 1 2 3 4 5 6) (list (< most-positive-fixnum (expt 2 62)) (> most-negative-fixnum (- (expt 2 63)))) :start 1 :end 3)) (funcall (constantly (let ((x 'a)) (handler-bind ((error (lambda (c) (declare (ignore c)) (invoke-restart 'store-value 7)))) (ctypecase x (integer (list 'integer x)))))) 1 2) (funcall (complement #'oddp) (numerator (- -7/3 22/7)))) (gethash 'k h) 5) (incf (gethash 'n h 10)) (list (gethash 'k h) (multiple-value-list (gethash 'zz h (list (reduce #'+ (remove-if (lambda (x) (> x 2)) (nsubstitute-if 1 #'evenp (list 3 1 2)))) (reduce #'list (nsubstitute (logior -7 0) 1 (list 1 2 2 1)) :initial-value (with-output-to-string (s) (write-string "a-b c" s) (write-char (char-upcase #\Space) s) (terpri s) (prin1 (list (sinh 0.5) (cosh 1.0) (tanh 1.0) (asinh -0.25) (acosh 1.5) (atanh 0.25)) s) (princ (list (sort (nunion (list 3 1 2) (list 1 2 2 1)) #'<) (nintersection (list 1 2 2 1) (list 3 1 2)) (nset-difference (list 3 1 2) (list 1 2 2 1)) (sort (nset-exclusive-or (list 1 2 2 1) (list 1 2 2 1)) #'<)) s) (print (loop for i downfrom 5 to 1 by 2 collect i) s) (fresh-line s) (write-line "abc" s) (write (let ((x 1) (y 2)) (psetq x y y x) (psetf x (+ x y) y x) (list x y)) :stream s))) (reduce #'list (butlast (ldiff '(3 1 2) nil)) :from-end t) (reduce #'+ (delete-if-not (lambda (x) (> x 2)) (vector 4 3 2 1)) :key (constantly (logand 1 1000003)))))) (hash-table-count h) (remhash 'k h) (remhash 'k h) (hash-table-count h))))

;;; 252
(answer 252 (let ((h (make-hash-table :test 'eq)) (l nil)) (setf (gethash "a" h) 1 (gethash (multiple-value-list (decode-float -2.25)) h) 2 (gethash "A" h) 3) (maphash (lambda (k v) (push (list k v) l)) h) (list (reverse l) (hash-table-test h) (hash-table-p h) (hash-table-p (block b252 (list 1 (return-from b252 (* 1 (gcd)))))))))

;;; 253
(answer 253 (let ((h (make-hash-table))) (dolist (x '(3 1 2)) (incf (gethash x h 0))) (list (loop for k being the hash-keys of h collect k) (loop for v being the hash-values of h using (hash-key k) collect (cons k v)) (progn (clrhash h) (hash-table-count h)))))

;;; 254
(answer 254 (let ((h (make-hash-table)) (l nil)) (setf (gethash 1 h) 'a (gethash 2 h) 'b) (with-hash-table-iterator (next h) (loop (multiple-value-bind (more k v) (next) (if more (push (cons k v) l) (return))))) (reverse l)))

;;; 255
(answer 255 (let ((h (make-hash-table))) (list (integerp (hash-table-size h)) (realp (hash-table-rehash-size h)) (realp (hash-table-rehash-threshold h)) (= (sxhash "ab") (sxhash (copy-seq "ab"))))))

;;; 256
(answer 256 (list (eq 'foo ':key) (eql (handler-case (read-from-string "(1 2") (end-of-file (c) (streamp (stream-error-stream c)))) (loop for i downfrom 5 to 5 by 2 collect i)) (equal (parse-integer "1x2") (list (equal '(1 2 3 4 5) '(5 -5 5)) (equalp (format nil "~a ~*~a|~2:*~a" 1 2 (list (stringp (let ((l nil)) (tagbody (go two) one (push 1 l) (go end) two (push 2 l) (go one) end) l)) (simple-string-p "abc") (length "") (position #\Space "Hello World") (search (format nil "~a") (let ((*print-case* :downcase) (*print-escape* nil)) (write-to-string '(Foo "x" |Bar|)))) (mismatch "a-b c" (let ((*print-length* 2) (*print-level* 1)) (prin1-to-string '(1 (2 (3)) 4 5))))) 4) (string-upcase (let ((*print-case* :downcase) (*print-escape* nil)) (write-to-string '(Foo "x" |Bar|))))) (equalp 1 1.0) (equalp #(1 2 3) (vector 4 3 2 1)))) (equalp (list (identity (typecase (let ((s (make-string-input-stream "ab cd"))) (list (read-preserving-whitespace s) (read-char-no-hang s) (peek-char t s) (listen s) (input-stream-p s) (output-stream-p s) (streamp s) (open-stream-p s) (close s))) (integer 'integer) (symbol 'symbol) (string 'string) (list 'list) (float 'float) (t 'other))) (funcall (constantly ((lambda (a &optional (b (and (handler-case (read-from-string "(1 2") (end-of-file (c) (streamp (stream-error-stream c)))) (list (cl:signal 'condition) (typep (make-condition 'simple-warning) 'warning) (handler-case (cl:signal 'simple-condition) (condition () 'got))) (multiple-value-list (with-simple-restart (cl:abort "Leave.") (cl:abort)))) b-p) &rest r &key (k (stable-sort (list '(1 . a) '(0 . b) '(1 . c) '(0 . d)) #'< :key #'car)) &aux (z (list a b))) (list b-p r k z)) 1 2 :k 3)) 1 2) (funcall (complement #'plusp) 12)) (apply #'+ -100000000000000000000 '(3 1 2)))))

;;; 257
(answer 257 (list (equal '(1 2 3 4 5) nil) (equalp (nstring-upcase (copy-seq "fresh")) (string-upcase (let ((*print-case* :downcase) (*print-escape* nil)) (write-to-string '(Foo "x" |Bar|))))) (equalp 1 1.0) (equalp #() (vector 4 3 2 1))))

;;; 258
(answer 258 (list (typep (macrolet ((m (&whole w x) (list 'quote (list w x)))) (m (symbol-value 'unbound-thing258))) 'integer) (typep (macrolet ((m (&whole w x) (list 'quote (list w x)))) (m (list (copy-tree '((1 . 2) 3)) (copy-alist '((a . 1) nil (c . 3))) (tree-equal '(a (b . c) (d (e))) '(a (b . c) (d (e)))) (tree-equal '(a (b . c) (d (e))) '(a (b . c) (d (e))) :test #'equal)))) '(or symbol string)) (typep (lognot (1- (1+ 4611686018427387903))) '(integer 0 255)) (typep (let ((n (- (ldb (byte 3 5) 0) 12))) (list (incf n) (decf n (ash 4611686018427387903 (- 3))) (incf n (* (+ -7/3 22/7 22/7) (+ 1/2 22/7 1/2))) n)) '(member a foo 1)) (typep (multiple-value-list (with-simple-restart (r "Leave.") (invoke-restart (find-restart 'r)))) '(and atom (not null))) (typep (loop for i from 1 to 2 append (list i i)) 'sequence) (typep (mod 4611686018427387903 1) '(satisfies evenp))))

;;; 259
(answer 259 (typecase (with-open-stream (s (make-string-input-stream "1 2")) (list (read s) (read s) (read s nil :eof))) (integer 'integer) (symbol 'symbol) (string 'string) (list 'list) (float 'float) (t 'other)))

;;; 260
(answer 260 (etypecase (unless nil (reduce #'- (stable-sort (vector 4 3 2 1) #'> :key (complement #'zerop)) :from-end t :initial-value 255 :start 0) (list (mapcan #'list (ldiff '(3 1 2) nil) (revappend nil '(3 1 2))) (mapcon #'list (list* 1000003 '(1 2 3 4 5))))) (number 'number) (symbol 'symbol)))

;;; 261
(deftype small261 (&optional (n 10)) (list 'integer 0 n))
(answer 261 (list (typep -100000000000000000000 'small261) (typep (abs (rem (denominator 22/7) 7)) '(small261 300))))

;;; 262
(answer 262 (let ((x (list least-positive-normalized-single-float least-positive-normalized-short-float least-positive-normalized-long-float least-negative-normalized-single-float least-negative-normalized-short-float least-negative-normalized-long-float))) (check-type x integer) x))

;;; 263
(answer 263 (the integer (gcd)))

;;; 264
(answer 264 (if t (list (cl:signal 'condition) (typep (make-condition 'simple-warning) 'warning) (handler-case (cl:signal 'simple-condition) (condition () 'got))) (multiple-value-call #'list (symbol-value 'unbound-thing264) (values (loop for i from 1 to 2 append (list i i)) (list (streamp *standard-output*) (streamp *standard-input*) (streamp *error-output*) (streamp *trace-output*) (streamp *terminal-io*) (streamp *query-io*) (streamp *debug-io*) *print-base* *read-base* *read-default-float-format* (consp *features*))) (values))))

;;; 265
(answer 265 (and (multiple-value-list (values (loop for x on (nbutlast (list 3 1 2) 0) by #'cddr nconc (list (length x))) (handler-case (unbound-function265 (list (assoc ':key '((a . 1) (b . 2))) (assoc 'b '((a . 1) (b . 2)) :test #'eq) (assoc-if #'symbolp '((a . 1) nil (c . 3))) (assoc-if-not #'symbolp '((a . 1) (2 . 3))))) (undefined-function (c) (cell-error-name c))))) (loop for x in (ldiff (nreverse (list 1 2 2 1)) nil) for i from 0 collect (list i x)) (list (multiple-value-list (floor (- 1/2 1/2))) (multiple-value-list (round (* -7/3 -7/3))) (multiple-value-list (ceiling -7/3)) (multiple-value-list (truncate (+ (- -7/3 1/2) 1/2 (- 22/7 -7/3)))))))

;;; 266
(answer 266 (or (list (= (expt (* 22/7 22/7) 2) (+)) (/= (expt 1.0e10 2) (/ 1.5 (*)) (/ 1 1)) (< 22/7 (*)) (> (list (float (dpb 0 (byte 2 1) -7)) (float 0.0) (float (ash -7 5) 1.0)) (rationalize 0.1)) (<= (list (float 12) (float 1.5) (float 1 1.0)) (sqrt 2.0) (*)) (>= 3.0e-5 (max -7/3 (+) (*)))) (handler-case (error 'type-error :datum (handler-case (car (list (integerp (get-universal-time)) (integerp (get-internal-real-time)) (integerp (get-internal-run-time)) (integerp internal-time-units-per-second) (length (multiple-value-list (get-decoded-time))) (stringp (lisp-implementation-type)) (stringp (lisp-implementation-version)) (progn (sleep 0) 1))) (type-error () 'type-error) (:no-error (x) (list x))) :expected-type 'list) (type-error (c) (list (type-error-datum c) (type-error-expected-type c))))))

;;; 267
(answer 267 (cond (nil (handler-bind ((error #'continue)) (cerror "Go on." "bad ~a" 1) 'continued)) ((let ((l nil)) (list (catch 'k (unwind-protect (throw 'k (mod (gcd 1000003 255) 7)) (push (mapcar (let ((k (numerator 1/2))) (lambda (x) (+ x k))) nil) l))) l))) (t (let ((s (copy-symbol 'foo)) (u (gentemp))) (list (symbol-name s) (eq s 'foo) (symbolp u) (integerp *gensym-counter*))))))

;;; 268
(answer 268 (when (list (numberp (let ((s 0)) (dolist (x (cons 255 '(1 2 3 4 5)) (list s x)) (incf s x)))) (realp (handler-case (error 'type-error :datum (let ((h (make-hash-table))) (dolist (x '(5 -5 5)) (incf (gethash x h 0))) (list (loop for k being the hash-keys of h collect k) (loop for v being the hash-values of h using (hash-key k) collect (cons k v)) (progn (clrhash h) (hash-table-count h)))) :expected-type 'list) (type-error (c) (list (type-error-datum c) (type-error-expected-type c))))) (rationalp (rem (*) -3)) (integerp (+)) (floatp (*)) (complexp (/ (+) (* (+) (+))))) (list (acons ':key (handler-bind ((error #'continue)) (cerror "Go on." "bad ~a" 1) 'continued) '((a . 1) nil (c . 3))) (pairlis '(c a) '(1 2 3) '((a . 1) nil (c . 3))))))

;;; 269
(answer 269 (unless (= (+) (*) (mod (mod (*) -3) -3)) (unless (< call-arguments-limit 50) (list (< 20 lambda-parameters-limit) (< 19 multiple-values-limit) (if (member '&rest lambda-list-keywords) t))) (let ((s (make-string-output-stream))) (format s "~a" (if t (let ((a (make-array 3 :initial-element 0 :adjustable t))) (list (adjust-array a 5 :initial-element (gcd)) (array-element-type (vector 1)) (upgraded-array-element-type t))) (list (rassoc 4611686018427387903 '((a . 1) (b . 2))) (rassoc-if #'oddp '((a . 1) (b . 4))) (rassoc-if-not #'evenp '((a . 1) (b . 4)))))) (finish-output s) (force-output s) (clear-output s) (list (get-output-stream-string s) (get-output-stream-string s)))))

;;; 270
(answer 270 (case -100000000000000000000 ((0 1) 'low) (255 'byte) (otherwise (let ((spec (byte 1 3))) (list (byte-size spec) (byte-position spec) (ldb-test spec (logxor (logcount -100000000000000000000) 12 (* (gcd) 0))) (mask-field spec 1) (deposit-field (lcm (rem 4611686018427387903 3) (- 255 -7)) spec (lognot (isqrt (abs 1000003)))))))))

;;; 271
(answer 271 (case 'foo (a 1) ((foo nil) 2) (t 3)))

;;; 272
(answer 272 (ecase (abs 1000003) (1 'one) (12 'twelve)))

;;; 273
(answer 273 (let ((x (locally (declare (optimize speed)) (list (multiple-value-list (floor (logxor 4611686018427387903 -7 255) 1)) (multiple-value-list (truncate (+ -100000000000000000000 -100000000000000000000) (logior 12 0)))))) (y (let ((n (gcd (gcd) (gcd 1 0)))) (setf (ldb (byte 3 2) n) 255) (setf (mask-field (byte 2 0) n) (signum (dpb 1000003 (byte 2 0) 12))) n))) (let* ((x y) (z x)) (list x y z))))

;;; 274
(answer 274 (let ((x 1) (y 2)) (psetq x y y x) (psetf x (+ x y) y x) (list x y)))

;;; 275
(answer 275 (let ((x (list 1 2 3)) (y (list (integerp (get-universal-time)) (integerp (get-internal-real-time)) (integerp (get-internal-run-time)) (integerp internal-time-units-per-second) (length (multiple-value-list (get-decoded-time))) (stringp (lisp-implementation-type)) (stringp (lisp-implementation-version)) (progn (sleep 0) 1)))) (rotatef (first x) (third x) y) (shiftf (second x) y (loop with a = (abs (mod -7 3)) and b = (load-time-value (list 1 2)) repeat 5 collect a collect b)) (list x y)))

;;; 276
(answer 276 (let ((n (logand (lcm (+ -100000000000000000000 4611686018427387903) (gcd)) (signum (logcount (gcd)))))) (list (incf n) (decf n (gcd)) (incf n -7/3) n)))

;;; 277
(answer 277 (let ((v (vector 1 2 3)) (i 0)) (incf (aref v (incf i)) (ash (logand (logior -7 (gcd)) (ldb (byte 7 2) 0)) (- 0))) (decf (aref v i)) (list v i)))

;;; 278
(answer 278 (prog1 (list (read-from-string "1.5d0") (multiple-value-list (read-from-string "a b" t nil :start 1))) (list (position (- (numerator 22/7) (integer-length -7)) (remove-if-not #'plusp (fill (list 1 2 2 1) 4611686018427387903))) (position-if #'evenp (remove-duplicates (remove-duplicates (substitute 1000003 1 (delete-if #'plusp (list 3 1 2))) :from-end t))) (position-if-not #'evenp (substitute-if (ash 1 5) (lambda (x) (> x 2)) (copy-seq (delete-duplicates (vector 4 3 2 1) :key #'abs)))) (position 1 '(1 2 1 3) :from-end t :end 1))))

;;; 279
(answer 279 (prog2 (let ((h (make-hash-table))) (setf (gethash (dpb 255 (byte 2 3) 1000003) h) (list (eq (intern "FOO") 'foo) (multiple-value-list (find-symbol "CAR" "COMMON-LISP")) (packagep *package*) (package-name (find-package "KEYWORD")) (package-name (symbol-package 'car))) (gethash 'k h) 5) (incf (gethash 'n h 10)) (list (gethash 'k h) (multiple-value-list (gethash 'zz h (let ((l nil)) (handler-case (handler-bind ((error (lambda (c) (declare (ignore c)) (push 'bound l)))) (error "x")) (error () (push (load-time-value (list 1 2)) l))) l))) (hash-table-count h) (remhash 'k h) (remhash 'k h) (hash-table-count h))) (let ((l (butlast nil)) (m nil)) (push (ldb (byte 3 0) (ash 0 3)) l) (pushnew (mod (* 12 -100000000000000000000) 2) l) (pushnew 3 l :test #'=) (setq m (pop l)) (list l m)) (read-char (make-string-input-stream ""))))

;;; 280
(answer 280 (progn (list (find (gcd) (nsubstitute-if (rem -7 7) (lambda (x) (> x 2)) (vector 4 3 2 1))) (find (lognot (logxor 4611686018427387903 1 -100000000000000000000)) (sort (list 1 2 2 1) #'<) :test #'eql) (find (denominator 1/2) (stable-sort (list 3 1 2) #'> :key #'-) :key (constantly (integer-length 1000003)) :from-end t)) (handler-case (symbol-value 'nothing280) (unbound-variable (c) (cell-error-name c)))))

;;; 281
(answer 281 (block b281 (list 1 (return-from b281 (list (< 1000 array-dimension-limit) (< 7 array-rank-limit) (< 1000 array-total-size-limit) (bit (make-array 4 :element-type 'bit :initial-element 1) 2) (sbit (make-array 4 :element-type 'bit :initial-element 0) 1))))))

;;; 282
(answer 282 (let ((l nil)) (tagbody (go two) one (push 1 l) (go end) two (push 2 l) (go one) end) l))

;;; 283
(answer 283 (catch 'k (list (throw 'k (list (concatenate 'list (remove-duplicates (nsubstitute 0 1 (vector 4 3 2 1)) :from-end t) (delete-if #'evenp (list 3 1 2))) (concatenate 'vector (remove-if #'oddp (delete 255 (vector 4 3 2 1))) #(3 1 2 1)))) (apply #'union (list (last '(1 2 3 4 5) 1) (nconc (copy-list '(5 -5 5)) (list 1 2 2 1)) :test #'eql)))))

;;; 284
(answer 284 (let ((l nil)) (list (catch 'k (unwind-protect (throw 'k (1- (denominator -100000000000000000000))) (push (multiple-value-list (with-simple-restart (r "Leave.") (invoke-restart (find-restart 'r)))) l))) l)))

;;; 285
(answer 285 (prog ((x (ash 12 (- 3)))) (setq x (list x x)) (return x)))

;;; 286
(answer 286 (prog* ((x (isqrt (abs 0))) (y (list x))) (return (list x y))))

;;; 287
(answer 287 (do ((i 0 (1+ i)) (l nil (cons i l))) ((= i 0) l)))

;;; 288
(answer 288 (do* ((i 0 (+ i 2)) (j i (+ i 1))) ((> i 5) (list i j)) (when (= i 4) (return 'early))))

;;; 289
(answer 289 (let ((l nil)) (dotimes (i 5 (list i l)) (push i l))))

;;; 290
(answer 290 (let ((s 0)) (dolist (x nil (list s x)) (incf s x))))

;;; 291
(answer 291 (multiple-value-list (values (list (typep (let* ((a (make-random-state t)) (b (make-random-state a))) (equal (list (random 1000 a) (random 1000 a)) (list (random 1000 b) (random 1000 b)))) 'integer) (typep (let (a b) (setf (values a b) (values (multiple-value-list (array-displacement (make-array 2 :initial-element (let ((h (make-hash-table)) (l nil)) (setf (gethash 1 h) 'a (gethash 2 h) 'b) (with-hash-table-iterator (next h) (loop (multiple-value-bind (more k v) (next) (if more (push (cons k v) l) (return))))) (reverse l))))) (loop with a = 1 and b = (length (multiple-value-list (get-setf-expansion '(car x)))) repeat 1 collect a collect b))) (list a b)) '(or symbol string)) (typep (1+ (integer-length 12)) '(integer 0 255)) (typep (pairlis '(a b c) (list (car '(5 -5 5)) (list (map-into (vector 4 3 2 1) (lambda (x) (* x x)) (remove-if-not #'oddp (remove 12 (substitute-if-not -100000000000000000000 #'evenp (nsubstitute-if-not 4611686018427387903 (lambda (x) (> x 2)) (vector 4 3 2 1)) :count 1)))) (map-into (list 1 2 2 1) #'+ (sort (list 3 1 2) #'>) (delete-duplicates (vector 4 3 2 1) :key #'1+))) (handler-case (symbol-value 'nothing291) (unbound-variable (c) (cell-error-name c))))) '(member a foo 1)) (typep (let (a b) (setf (values a b) (values (multiple-value-call #'list (let ((n 0)) (let ((inc (lambda () (incf n))) (get (lambda () n))) (funcall inc) (funcall inc) (funcall get))) (values (handler-bind ((error #'continue)) (cerror "Go on." "bad ~a" 1) 'continued) (list (merge 'list (list 1 3 5) (list 2 3 4) #'<) (merge 'vector (vector 1 4) (list 2 3) #'<))) (values)) (loop for x in nil for i from 0 collect (list i x)))) (list a b)) '(and atom (not null))) (typep (parse-integer "1x2") 'sequence) (typep (1- (logxor -7 1000003 (gcd))) '(satisfies evenp))) (loop for x in (cons 1 (nthcdr 0 (nreconc (list 3 1 2) (list 3 1 2)))) if (evenp x) sum x into e and collect x into l else minimize x into m end finally (return (list e l m))))))

;;; 292
(answer 292 (multiple-value-bind (a b c) (values (loop for (a . b) in '((a . 1) (b . 2)) when a collect (list a b) else collect 'none) (flet ((f (x) (list 'f x)) (g (&rest r) r)) (f (g (multiple-value-list (parse-integer "42")) (cond ((= (+) (+) (*)) (list (sqrt 16) (sqrt 7) (exp 1.0) (log 10.0) (log 8 2) (exp 0))) ((multiple-value-bind (v c) (ignore-errors (error 'simple-error :format-control "x ~a" :format-arguments '(1))) (list v (simple-condition-format-control c) (simple-condition-format-arguments c)))) (t (handler-case (read-from-string "(1 2") (end-of-file (c) (streamp (stream-error-stream c)))))))))) (list a b c)))

;;; 293
(answer 293 (multiple-value-call #'list (list (eval '(+ 1 255)) (eval -100000000000000000000) (eval ''a) (funcall (compile nil '(lambda (x) (* x 2))) (* (logior 12 -7) (+ 1 4611686018427387903)))) (values (list most-positive-double-float (< -1.0e-300 least-negative-double-float 0 least-positive-double-float 1.0e-300) most-negative-double-float double-float-epsilon double-float-negative-epsilon) (list single-float-epsilon short-float-epsilon long-float-epsilon single-float-negative-epsilon short-float-negative-epsilon long-float-negative-epsilon)) (values)))

;;; 294
(answer 294 (multiple-value-list (multiple-value-prog1 (values (list (streamp *standard-output*) (streamp *standard-input*) (streamp *error-output*) (streamp *trace-output*) (streamp *terminal-io*) (streamp *query-io*) (streamp *debug-io*) *print-base* *read-base* *read-default-float-format* (consp *features*)) 2) (loop named outer for i from 0 do (loop for j to 3 do (when (> (+ i j) 3) (return-from outer (list i j))))))))

;;; 295
(answer 295 (let (a b) (multiple-value-setq (a b) (floor 0 1)) (list a b)))

;;; 296
(answer 296 (list (nth-value 1 (floor (ash (isqrt (abs (gcd))) 1) 7)) (multiple-value-list (values-list (list (- (denominator 22/7) (abs 255)) (mod 12 3) (gcd))))))

;;; 297
(answer 297 (let (a b) (setf (values a b) (values (list least-positive-normalized-single-float least-positive-normalized-short-float least-positive-normalized-long-float least-negative-normalized-single-float least-negative-normalized-short-float least-negative-normalized-long-float) (list (lognor (gcd (numerator 1/2) (ash -7 (- 2))) (rem 1 3)) (logorc1 (gcd (lcm 0 -100000000000000000000) (logand 1000003 1000003)) 255) (logorc2 255 (1+ (1- 4611686018427387903)))))) (list a b)))

;;; 298
(answer 298 (destructuring-bind (a (b &optional (c (replace (list 1 2 3 4) (fill (list 3 1 2) (1+ (gcd))) :start1 1))) &rest d &key k) '(1 (2) :k 3) (list a b c d k)))

;;; 299
(answer 299 (handler-case (destructuring-bind (a b) (reverse '(5 -5 5)) (list a b)) (error () 'mismatch)))

;;; 300
(answer 300 (progv '(*p300*) (list (list (mapcar (complement #'zerop) '(1 2 3 4 5)) (mapcar #'+ (append (revappend '(3 1 2) '(1 2 3 4 5)) '(3 1 2)) '(1 2 3 4 5)) (maplist #'length (copy-list (rest '(5 -5 5)))))) (symbol-value '*p300*)))

;;; 301
(answer 301 (locally (declare (optimize speed)) 'a))

;;; 302
(answer 302 (quote (list (search '(1 2) (substitute-if-not (dpb -100000000000000000000 (byte 2 2) 255) #'plusp #(3 1 2 1) :count 1)) (search (delete (logand -7 0) (list 1 2 2 1)) '(3 1 2)) (mismatch (remove (integer-length 12) (substitute 1000003 4611686018427387903 (copy-seq (remove-duplicates (delete-duplicates (list 3 1 2) :key #'abs))))) (reverse (delete-if-not #'plusp (list 1 2 2 1)))) (mismatch (rest (make-list 0 :initial-element (gcd))) #() :test #'=))))

;;; 303
(answer 303 (eval-when (:execute :load-toplevel :compile-toplevel) (let ((a (make-array 6 :initial-contents '(1 2 3 4 5 6)))) (make-array '(2 2) :displaced-to a :displaced-index-offset 1))))

;;; 304
(answer 304 (load-time-value (list 1 2)))

;;; 305
(answer 305 (let ((x (handler-case (error "text ~a" (handler-case (cl:assert (= 1 4611686018427387903)) (error () 'assertion))) (error (c) (princ-to-string c))))) (declare (ignorable x) (type t x)) (symbol-macrolet ((y (list x))) y)))

;;; 306
(answer 306 (funcall (constantly (mod (lcm 1 0) 1)) -100000000000000000000))

;;; 307
(answer 307 (apply #'+ (gcd (isqrt (abs 4611686018427387903)) (signum (1- 0))) (nbutlast (copy-list (nconc (list 3 1 2) (list 1 2 2 1))) 2)))

;;; 308
(answer 308 (apply #'list (progn (print (let ((v (vector 1 2 3)) (i 0)) (incf (aref v (incf i)) (dpb 12 (byte 7 1) 4611686018427387903)) (decf (aref v i)) (list v i))) (prin1 (list (sin -0.25) (cos -0.25) (tan 0.5) (asin -0.25) (acos 1.0) (atan (sqrt 2.0)) (atan 1 -1))) (princ (handler-case (/ (denominator 1/2) 0) (arithmetic-error (c) (list (arithmetic-error-operation c) (arithmetic-error-operands c))))) (terpri) (write-line "x") (fresh-line) (format t "~a~%" (progn (list (< (abs (- pi 3.141592653589793)) 1.0e-15)) (let ((x (list 1 2 3)) (y (let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) (11) . 12) ((13) . 14) 15 16))) (list (cdaaar x) (cdaadr x) (cdadar x) (cdaddr x) (cddaar x) (cddadr x) (cdddar x) (cddddr x))))) (rotatef (first x) (third x) y) (shiftf (second x) y (unless (< call-arguments-limit 50) (list (< 20 lambda-parameters-limit) (< 19 multiple-values-limit) (if (member '&rest lambda-list-keywords) t)))) (list x y)))) 'printed) '(5 -5 5)))

;;; 309
(answer 309 (flet ((f (x) (list 'f x)) (g (&rest r) r)) (f (g (funcall (lambda (a b) (list a b)) ((lambda (a &optional (b (handler-case (unbound-function309 (multiple-value-list (with-simple-restart (cl:abort "Leave.") (cl:abort)))) (undefined-function (c) (cell-error-name c))) b-p) &rest r &key (k (elt '(3 1 2) 3)) &aux (z (list a b))) (list b-p r k z)) 1 2 :k 3)) (list (multiple-value-list (decode-universal-time 3600000000 0)) (encode-universal-time 5 4 3 2 1 2001 0))))))

;;; 310
(answer 310 (labels ((f (n) (if (< n 1) nil (cons n (f (- n 1)))))) (f 1)))

;;; 311
(answer 311 ((lambda (a &optional (b (list (adjoin (rem (logcount 12) 3) (last nil 5)) (adjoin (- (gcd) (+ 1 -100000000000000000000)) (copy-list '(5 -5 5)) :key (constantly 1000003)) (tailp nil (ldiff (nbutlast (list 3 1 2) 3) nil))) b-p) &rest r &key (k (= least-positive-single-float least-positive-short-float least-positive-long-float (- least-negative-single-float) (- least-negative-short-float) (- least-negative-long-float))) &aux (z (list a b))) (list b-p r k z)) 1 2 :k 3))

;;; 312
(answer 312 (funcall (lambda (&key a ((:other o) (let ((x 5)) (handler-bind ((error (lambda (c) (declare (ignore c)) (invoke-restart 'store-value 12)))) (ccase x (1 'one) (12 'twelve) (255 'byte) ((0 -7 3) 'other))))) &allow-other-keys) (list a o)) :a 1 :b 2))

;;; 313
(answer 313 (funcall (lambda (a b) (list a b)) (restart-bind ((r (lambda (x) (list 'bound x)))) (list (restart-name (first (compute-restarts))) (invoke-restart 'r (loop for (a . b) in '((a . 1) (b . 2)) when a collect (list a b) else collect 'none))))))

;;; 314
(answer 314 (let ((n 0)) (let ((inc (lambda () (incf n))) (get (lambda () n))) (funcall inc) (funcall inc) (funcall get))))

;;; 315
(answer 315 (mapcar (let ((k 255)) (lambda (x) (+ x k))) (append nil (cons 1 (nreverse (list 1 2 2 1))))))

;;; 316
(answer 316 (list (identity (let ((sum nil)) (list (mapc (lambda (x) (push x sum)) (revappend '(1 2 3 4 5) nil)) (mapl (lambda (x) (push (length x) sum)) '(3 1 2)) sum))) (funcall (constantly (etypecase (let ((n 0)) (loop (when (> (incf n) 0) (return n)))) (number 'number) (symbol 'symbol))) 1 2) (funcall (complement #'oddp) 1000003)))

;;; 317
(defun f317 (x &optional (y (ash (ldb (byte 2 5) (numerator 22/7)) 2))) "Doc." (list x y))
(answer 317 (list (f317 (loop for x across #(3 1 2) sum x into s count (oddp x) into c maximize x into m finally (return (list s c m)))) (if (fboundp 'f317) t) (funcall 'f317 1 2) (funcall (fdefinition 'f317) 3) (documentation 'f317 'function)))

;;; 318
(defmacro m318 (a &body b) `(list ,a ,@b))
(answer 318 (list (m318 (logcount 255) (let ((s (make-string-input-stream "ab cd"))) (list (read-preserving-whitespace s) (read-char-no-hang s) (peek-char t s) (listen s) (input-stream-p s) (output-stream-p s) (streamp s) (open-stream-p s) (close s))) (restart-bind ((r (lambda (x) (list 'bound x)))) (list (restart-name (first (compute-restarts))) (invoke-restart 'r (symbol-value 'unbound-thing318))))) (macroexpand-1 '(m318 1 2)) (macroexpand '(m318 3)) (functionp (macro-function 'm318))))

;;; 319
(answer 319 (macrolet ((m (&whole w x) (list 'quote (list w x)))) (m (with-open-stream (s (make-string-input-stream "1 2")) (list (read s) (read s) (read s nil :eof))))))

;;; 320
(defmacro w320 (&whole w x &environment e) (declare (ignore e x)) `',w)
(answer 320 (w320 (let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) 11 . 12) (13 . 14) 15 16))) (list (caar x) (cadr x) (cdar x) (cddr x) (caaar x) (caadr x) (cadar x) (caddr x) (cdaar x) (cdadr x) (cddar x) (cdddr x)))))

;;; 321
(defvar *v321* (logior (ash (1+ -7) (- 2)) -100000000000000000000) "A variable.")
(defparameter *w321* (logxor (abs (gcd)) (lognot (+ 4611686018427387903 1)) (numerator -7/3)))
(defconstant c321 5)
(answer 321 (let ((*v321* 1)) (list *v321* *w321* c321 (documentation '*v321* 'variable) (boundp '*v321*))))

;;; 322
(define-modify-macro add322 (&rest r) + "Adds.")
(answer 322 (let ((x (ldb (byte 1 0) 255))) (add322 x 1 2) x))

;;; 323
(defun second323 (l) (nth 1 l))
(defsetf second323 (l) (new) `(setf (nth 1 ,l) ,new))
(answer 323 (let ((l (list 1 2 3))) (setf (second323 l) (multiple-value-list (integer-decode-float 1.0e10))) l))

;;; 324
(defun put324 (l v) (setf (car l) v))
(defun get324 (l) (car l))
(defsetf get324 put324)
(answer 324 (let ((l (list 1 2))) (setf (get324 l) (let ((h (make-hash-table))) (list (integerp (hash-table-size h)) (realp (hash-table-rehash-size h)) (realp (hash-table-rehash-threshold h)) (= (sxhash "ab") (sxhash (copy-seq "ab")))))) (list l (get324 l))))

;;; 325
(defun (setf top325) (v l) (setf (car l) v))
(answer 325 (let ((l (list 1 2))) (setf (top325 l) (list (integerp (get-universal-time)) (integerp (get-internal-real-time)) (integerp (get-internal-run-time)) (integerp internal-time-units-per-second) (length (multiple-value-list (get-decoded-time))) (stringp (lisp-implementation-type)) (stringp (lisp-implementation-version)) (progn (sleep 0) 1))) (push 5 (cdr l)) l))

;;; 326
(define-setf-expander tail326 (l) (let ((v (gensym)) (s (gensym))) (values (list v) (list l) (list s) `(progn (setf (cdr ,v) ,s) ,s) `(cdr ,v))))
(defun tail326 (l) (cdr l))
(answer 326 (let ((l (list 1 2))) (setf (tail326 l) (list (- (lognot -7) (gcd)) (ash 1000003 (- 5)) 1000003)) l))

;;; 327
(answer 327 (length (multiple-value-list (get-setf-expansion '(car x)))))

;;; 328
(declaim (special *d328*))
(proclaim '(special *e328*))
(setq *d328* (handler-case (cl:assert (= 1 4611686018427387903)) (error () 'assertion)))
(answer 328 (list *d328* (eval '(let ((*e328* 2)) (symbol-value '*e328*)))))

;;; 329
(define-symbol-macro s329 (list 1 (string< "abc" "xabd" :start2 1)))
(answer 329 s329)

;;; 330
(answer 330 (list (eval '(+ 1 (logxor (rem 255 2) (lognot -100000000000000000000) (denominator (- -7/3 1/2))))) (eval (logior (logand (1- 1) (* 12 -7)) (mod -7 7))) (eval ''a) (funcall (compile nil '(lambda (x) (* x 2))) (gcd (ldb (byte 2 5) (* 0 12)) 12))))

;;; 331
(answer 331 (unless (< call-arguments-limit 50) (list (< 20 lambda-parameters-limit) (< 19 multiple-values-limit) (if (member '&rest lambda-list-keywords) t))))

;;; 332
(defgeneric g332 (x))
(defmethod g332 (x) (list 'any x))
(defmethod g332 ((x number)) (list 'number (call-next-method)))
(defmethod g332 ((x (eql 1))) (list 'one (next-method-p)))
(answer 332 (list (g332 (error (list (find-if #'evenp (remove-duplicates (remove 0 (delete-duplicates (vector 4 3 2 1) :key #'-)) :from-end t)) (find-if-not #'oddp (remove-if #'plusp (fill (vector 4 3 2 1) -100000000000000000000))) (find-if #'evenp (nsubstitute-if -7 #'oddp (vector 4 3 2 1)) :from-end t)))) (g332 1) (g332 1.5)))

;;; 333
(defstruct s333 (a -100000000000000000000) (b nil))
(answer 333 (let ((s (make-s333 :b (error (let (a b) (multiple-value-setq (a b) (floor (1+ 4611686018427387903) 3)) (list a b)))))) (setf (s333-a s) (loop for x on (nbutlast (copy-list '(5 -5 5)) 1) by #'cddr nconc (list (length x)))) (list s (s333-p s) (s333-p 5) (s333-b s) (equalp s (copy-s333 s)) (typep s 's333) (copy-structure s))))

;;; 334
(defstruct (p334 (:constructor new334 (x &optional (y (isqrt (abs (lcm 12 (signum 0)))))))) x y)
(defstruct (q334 (:include p334 (x 5)) (:conc-name qq-)) z)
(answer 334 (let ((q (make-q334 :z (with-open-stream (s (make-string-input-stream "1 2")) (list (read s) (read s) (read s nil :eof)))))) (list (new334 (handler-case (error "text ~a" (list (every (lambda (x) (> x 2)) #(1 2 3)) (some #'evenp (reverse (stable-sort (vector 4 3 2 1) #'> :key (lambda (x) (* x x))))) (notevery #'oddp (nsubstitute-if-not 4611686018427387903 #'plusp (list 1 2 2 1))) (notany (lambda (x) (> x 2)) (remove-duplicates (delete-if #'oddp (vector 4 3 2 1)))))) (error (c) (princ-to-string c)))) q (qq-x q) (p334-x q) (p334-p q))))

;;; 335
(defstruct (l335 (:type list) :named) a b)
(answer 335 (list (make-l335 :a 1 :b (let ((l nil)) (handler-case (handler-bind ((error (lambda (c) (declare (ignore c)) (push 'bound l)))) (error "x")) (error () (push (with-input-from-string (s "one two (3 4) x") (list (read s) (read-char s) (peek-char nil s) (unread-char (read-char s) s) (read-line s) (read-line s nil 'eof) (read s nil 'end))) l))) l)) (l335-a (make-l335 :a (prog2 (let ((l '(1 2 3 4 5 6 7 8 9 10 11))) (list (sixth l) (seventh l) (eighth l) (ninth l) (tenth l))) (handler-case (destructuring-bind (a b) '(3 1 2) (list a b)) (error () 'mismatch)) (list (getf nil :a) (getf '(:a 1 :b 2) :z (loop for x = 1 then (* x 2) while (< x 50) until (> x 3) collect x)) (multiple-value-list (get-properties nil '(:b :c))))))) (l335-p '(1))))

;;; 336
(defstruct r336 (a 1 :read-only t) (b 2 :type integer))
(answer 336 (r336-a (case (gcd 1000003 -7) ((0 1) 'low) (255 'byte) (otherwise (loop for x in (cons 1 '(1 2 3 4 5)) if (evenp x) sum x into e and collect x into l else minimize x into m end finally (return (list e l m)))))))

;;; 337
(defstruct (pp337 (:print-function (lambda (o s d) (declare (ignore d)) (format s "<~a>" (pp337-a o))))) a)
(answer 337 (prin1-to-string (make-pp337 :a (list most-positive-single-float most-positive-short-float most-positive-long-float most-negative-single-float most-negative-short-float most-negative-long-float))))

;;; 338
(defstruct po338 a)
(defmethod print-object ((o po338) s) (print-unreadable-object (o s) (format s "po ~a" (po338-a o))))
(answer 338 (format nil "~a" (make-po338 :a (stable-sort (list '(1 . a) '(0 . b) '(1 . c) '(0 . d)) #'< :key #'car))))

;;; 339
(answer 339 (handler-case (error "text ~a" (handler-bind ((error (lambda (c) (declare (ignore c)) (store-value (list (let ((s (make-random-state t))) (random-state-p s)) (random-state-p *random-state*) (< -1 (random 10) 10) (< (random 1.0) 1.0)))))) (restart-case (error "x") (store-value (v) (list 'stored v))))) (error (c) (princ-to-string c))))

;;; 340
(answer 340 (handler-case (error 'type-error :datum (let ((*trace-output* (make-string-output-stream))) (time (list (char-equal #\Z (char-downcase #\Space)) (char-not-equal (code-char (+ 65 1)) (char-upcase #\a)) (char-lessp (char-downcase #\5) (char-downcase #\-)) (char-greaterp (char-upcase #\5) (code-char (+ 65 5))) (char-not-greaterp (code-char (+ 65 2)) #\Z) (char-not-lessp (char-downcase #\5) (char-upcase #\a))))) :expected-type 'list) (type-error (c) (list (type-error-datum c) (type-error-expected-type c)))))

;;; 341
(answer 341 (handler-case (car (list (nsubst 'x 'c (copy-tree '((1 . 2) 3))) (nsubst-if 'x #'numberp (copy-tree '((1 . 2) 3))) (nsubst-if-not 'x #'listp (copy-tree '((1 . 2) 3))))) (type-error () 'type-error) (:no-error (x) (list x))))

;;; 342
(answer 342 (handler-case (/ (abs (signum (lognot 255))) 0) (arithmetic-error (c) (list (arithmetic-error-operation c) (arithmetic-error-operands c)))))

;;; 343
(answer 343 (multiple-value-bind (v c) (ignore-errors (error 'simple-error :format-control "x ~a" :format-arguments '(1))) (list v (simple-condition-format-control c) (simple-condition-format-arguments c))))

;;; 344
(answer 344 (let ((l nil)) (handler-case (handler-bind ((error (lambda (c) (declare (ignore c)) (push 'bound l)))) (error "x")) (error () (push (list (boole boole-1 255 (ldb (byte 1 1) (abs 0))) (boole boole-2 (gcd) 1000003) (boole boole-and (1- (integer-length (gcd))) (rem 1 3)) (boole boole-ior (numerator 255) (ash (logxor 12 1 1000003) 0)) (boole boole-xor (signum (dpb 255 (byte 7 2) -100000000000000000000)) (denominator 0)) (boole boole-eqv (logcount (- 0 1000003)) (mod (+ 12 -7) 2)) (boole boole-nand (logxor (ash -100000000000000000000 5) (denominator 22/7) (logand 4611686018427387903 -7)) (ldb (byte 1 1) (dpb (gcd) (byte 2 3) 1))) (boole boole-nor 12 (gcd (ash -7 (- 2)) (abs 0)))) l))) l))

;;; 345
(answer 345 (restart-case (invoke-restart 'r (loop for x = 1 then (* x 2) while (< x 50) until (> x 3) collect x)) (r (x) (list 'r x))))

;;; 346
(answer 346 (handler-bind ((error (lambda (c) (declare (ignore c)) (use-value (let ((p (list :a 1 :b 2))) (list (remf p :b) p (setf (getf p :n) -100000000000000000000) (incf (getf p :m 10)) p)))))) (restart-case (error "x") (use-value (v) (list 'used v)) (store-value (v) v))))

;;; 347
(answer 347 (handler-bind ((error (lambda (c) (declare (ignore c)) (store-value (list (alpha-char-p #\Space) (alphanumericp (char-upcase (char-downcase #\Space))) (graphic-char-p #\-) (upper-case-p #\a) (lower-case-p (code-char (+ 65 3))) (both-case-p (char-upcase (char-downcase #\a))) (characterp (multiple-value-bind (a b c) (values (list (multiple-value-list (ffloor -2.25 2.0)) (multiple-value-list (fceiling 0.0)) (multiple-value-list (ftruncate 3.0e-5)) (multiple-value-list (fround 1.5))) (list (< most-positive-fixnum (expt 2 62)) (> most-negative-fixnum (- (expt 2 63))))) (list a b c))) (standard-char-p (code-char (+ 65 0)))))))) (restart-case (error "x") (store-value (v) (list 'stored v)))))

;;; 348
(answer 348 (handler-bind ((error #'continue)) (cerror "Go on." "bad ~a" 1) 'continued))

;;; 349
(answer 349 (multiple-value-list (with-simple-restart (r "Leave.") (invoke-restart (find-restart 'r)))))

;;; 350
(answer 350 (multiple-value-list (with-simple-restart (cl:abort "Leave.") (cl:abort))))

;;; 351
(answer 351 (handler-bind ((warning #'muffle-warning)) (warn "w ~a" (list (char= (char-downcase #\5) (char-upcase #\-)) (char/= (code-char (+ 65 3)) (code-char (+ 65 1))) (char< (char-downcase (code-char (+ 65 1))) (code-char (+ 65 2)) (char-downcase #\Z)) (char> (char-upcase (code-char (+ 65 0))) (char-downcase (char-upcase #\a))) (char<= (char-upcase (char-upcase #\Z)) (char-upcase (code-char (+ 65 5)))) (char>= (code-char (+ 65 1)) (char-downcase (char-upcase #\5))))) 'warned))

;;; 352
(answer 352 (restart-bind ((r (lambda (x) (list 'bound x)))) (list (restart-name (first (compute-restarts))) (invoke-restart 'r (list (subst (length (list (constantp (handler-case (symbol-value 'nothing352) (unbound-variable (c) (cell-error-name c)))) (constantp 'x) (constantp ''x) (special-operator-p 'if) (special-operator-p 'car) (compiled-function-p #'car) (functionp #'car) (functionp 'car))) 'b '((1 . 2) 3)) (subst-if 0 #'symbolp '(a (b . c) (d (e)))) (subst-if-not 0 #'consp '((1 . 2) 3)))))))

;;; 353
(define-condition c353 (error) ((a :initarg :a :initform 5 :reader c353-a)) (:report (lambda (c s) (format s "c ~a" (c353-a c)))))
(answer 353 (handler-case (error 'c353 :a (ecase (* (logior 255 1) (rem 1000003 3)) (1 'one) (12 'twelve))) (c353 (c) (list (c353-a c) (princ-to-string c)))))

;;; 354
(answer 354 (list (cl:signal 'condition) (typep (make-condition 'simple-warning) 'warning) (handler-case (cl:signal 'simple-condition) (condition () 'got))))

;;; 355
(answer 355 (handler-case (cl:assert (= 1 (logior (* (isqrt (abs 1)) 4611686018427387903) (lcm (- (gcd) 1000003) -100000000000000000000)))) (error () 'assertion)))

;;; 356
(answer 356 (let ((x 5)) (handler-bind ((error (lambda (c) (declare (ignore c)) (invoke-restart 'store-value 12)))) (ccase x (1 'one) (12 'twelve) (255 'byte) ((0 -7 3) 'other)))))

;;; 357
(answer 357 (let ((x 'a)) (handler-bind ((error (lambda (c) (declare (ignore c)) (invoke-restart 'store-value 7)))) (ctypecase x (integer (list 'integer x))))))

;;; 358
(answer 358 (handler-case (unbound-function358 (read-char (make-string-input-stream ""))) (undefined-function (c) (cell-error-name c))))

;;; 359
(answer 359 (handler-case (read-from-string "(1 2") (end-of-file (c) (streamp (stream-error-stream c)))))

;;; 360
(answer 360 (error (prog1 (when (list (evenp 12) (oddp (gcd)) (zerop (+)) (plusp (*)) (minusp (*))) (prog ((x 4611686018427387903)) (setq x (list x x)) (return x))) (list (cl:signal 'condition) (typep (make-condition 'simple-warning) 'warning) (handler-case (cl:signal 'simple-condition) (condition () 'got))))))

;;; 361
(answer 361 (loop for x in (make-list 2 :initial-element -100000000000000000000) for i from 0 collect (list i x)))

;;; 362
(answer 362 (loop for x across #(3 1 2) sum x into s count (oddp x) into c maximize x into m finally (return (list s c m))))

;;; 363
(answer 363 (loop for i from 1 to 3 append (list i i)))

;;; 364
(answer 364 (loop for i downfrom 5 to 0 by 2 collect i))

;;; 365
(answer 365 (loop for (a . b) in '((a . 1) nil (c . 3)) when a collect (list a b) else collect 'none))

;;; 366
(answer 366 (loop for x on nil by #'cddr nconc (list (length x))))

;;; 367
(answer 367 (loop with a = (+ -7 1000003) and b = (list (let ((s (make-random-state t))) (random-state-p s)) (random-state-p *random-state*) (< -1 (random 10) 10) (< (random 1.0) 1.0)) repeat 5 collect a collect b))

;;; 368
(answer 368 (loop for x = 1 then (* x 2) while (< x 50) until (> x 2) collect x))

;;; 369
(answer 369 (list (loop for x in '(1 2 3 4 5) always (numberp x)) (loop for x in (nreconc (copy-list (list* (gcd) nil)) (copy-list '(3 1 2))) never (eql x 2)) (loop for x in (rest '(3 1 2)) thereis (and (> x 2) x))))

;;; 370
(answer 370 (loop named outer for i from 0 do (loop for j to 3 do (when (> (+ i j) 3) (return-from outer (list i j))))))

;;; 371
(answer 371 (loop for x in (cons 1 nil) if (evenp x) sum x into e and collect x into l else minimize x into m end finally (return (list e l m))))

;;; 372
(answer 372 (loop initially (princ 'start) for c across (format nil "~a|~s|~10a|~10@a|~va" (list least-positive-normalized-single-float least-positive-normalized-short-float least-positive-normalized-long-float least-negative-normalized-single-float least-negative-normalized-short-float least-negative-normalized-long-float) #(3 1 2 1) nil ':key 1 'v) do (when (char= c #\b) (loop-finish)) (princ c) finally (princ 'end)))

;;; 373
(answer 373 (let ((n 0)) (loop (when (> (incf n) 5) (return n)))))

;;; 374
(answer 374 (with-output-to-string (s) (write-string (format nil "~a|~s|~10a|~10@a|~va" (list (count (1- 1) (remove-if-not (lambda (x) (> x 2)) (reverse (delete (gcd) (list 1 2 2 1))))) (count-if #'plusp (substitute-if -7 #'evenp (substitute-if-not 12 #'oddp (copy-seq (sort (list 1 2 2 1) #'>)) :count 1))) (count-if-not (lambda (x) (> x 2)) (substitute-if 1 #'plusp '(5 -5 5))) (count 1 '(1 2 1 3 1) :start 5)) (list (member 0 (cons 255 '(3 1 2))) (member (lcm 4611686018427387903 -7) (nreverse (list 3 1 2)) :test #'<) (member-if #'evenp (nreconc (list 1 2 2 1) (list 3 1 2))) (member-if-not (lambda (x) (> x 2)) (copy-list nil))) 'foo nil 0 'v) s) (write-char #\- s) (terpri s) (prin1 (list (coerce (nsubstitute-if (integer-length 1) #'plusp (list 1 2 2 1)) 'list) (coerce (remove-duplicates (stable-sort (list 3 1 2) #'< :key (complement #'zerop))) 'vector) (coerce '(#\a #\b) 'string) (coerce "c" 'character) (coerce 0.1 'double-float)) s) (princ (if (list (numberp (list (< most-positive-fixnum (expt 2 62)) (> most-negative-fixnum (- (expt 2 63))))) (realp (car '(5 -5 5))) (rationalp (/ -100000000000000000000 7)) (integerp (+ (+) (+))) (floatp (expt 1/2 0)) (complexp (/ (*)))) (with-open-stream (s (make-string-input-stream "1 2")) (list (read s) (read s) (read s nil :eof))) (let ((h (make-hash-table)) (l nil)) (setf (gethash 1 h) 'a (gethash 2 h) 'b) (with-hash-table-iterator (next h) (loop (multiple-value-bind (more k v) (next) (if more (push (cons k v) l) (return))))) (reverse l))) s) (print (multiple-value-list (parse-integer "12")) s) (fresh-line s) (write-line (substitute #\! (code-char (+ 65 2)) (format nil "~w|~a ~:a ~:s" (catch 'k (list (throw 'k (read-char (make-string-input-stream ""))) (list (merge 'list (list 1 3 5) (list 2 3 4) #'<) (merge 'vector (vector 1 4) (list 2 3) #'<)))) nil nil nil)) s) (write (list (map-into (copy-seq #(1 2 3)) (constantly 4611686018427387903) (make-list 5 :initial-element 4611686018427387903)) (map-into (list 3 1 2) #'+ (delete-duplicates (vector 4 3 2 1) :key (constantly 12)) (substitute-if (1+ 1000003) #'evenp (delete-if #'plusp (vector 4 3 2 1))))) :stream s)))

;;; 375
(answer 375 (with-input-from-string (s "one two (3 4) x") (list (read s) (read-char s) (peek-char nil s) (unread-char (read-char s) s) (read-line s) (read-line s nil 'eof) (read s nil 'end))))

;;; 376
(answer 376 (let ((s (make-string-input-stream "ab cd"))) (list (read-preserving-whitespace s) (read-char-no-hang s) (peek-char t s) (listen s) (input-stream-p s) (output-stream-p s) (streamp s) (open-stream-p s) (close s))))

;;; 377
(answer 377 (let ((s (make-string-output-stream))) (format s "~a" (list (map 'list (constantly (logcount (gcd))) (fill (list 3 1 2) (dpb 0 (byte 1 3) 255))) (map 'vector #'+ (delete (mod -7 1) (list 3 1 2)) (remove-if-not #'oddp (substitute-if-not (gcd) #'oddp (substitute 0 1 (reverse (remove-duplicates (sort (vector 4 3 2 1) #'<) :from-end t))) :count 1))) (map nil #'identity (copy-seq '(5 -5 5))) (map 'string #'char-upcase "abc"))) (finish-output s) (force-output s) (clear-output s) (list (get-output-stream-string s) (get-output-stream-string s))))

;;; 378
(answer 378 (list (read-from-string "'x") (multiple-value-list (read-from-string "a b" t nil :start 1))))

;;; 379
(answer 379 (progn (print (list (char-code (char-downcase (code-char (+ 65 2)))) (char-int #\Z) (char-name #\Newline) (name-char "space") (digit-char 3) (digit-char 11 16) (digit-char-p (char-downcase #\-)) (digit-char-p #\f 16))) (prin1 (list (every #'< '(1 2 3 4 5) #()) (some (lambda (x y) (and (> x y) (list x y))) #(3 1 2 1) (revappend (butlast nil) (list* 4611686018427387903 '(5 -5 5)))))) (princ (let ((l nil)) (tagbody (go two) one (push 1 l) (go end) two (push 2 l) (go one) end) l)) (terpri) (write-line "x") (fresh-line) (format t "~a~%" (list (parse-integer "ff" :radix 16) (parse-integer " 12 x" :junk-allowed t) (parse-integer "a12b" :start 1 :end 3))) 'printed))

;;; 380
(answer 380 (with-open-stream (s (make-string-input-stream "1 2")) (list (read s) (read s) (read s nil :eof))))

;;; 381
(answer 381 (read-char (make-string-input-stream "")))

;;; 382
(answer 382 (list (streamp *standard-output*) (streamp *standard-input*) (streamp *error-output*) (streamp *trace-output*) (streamp *terminal-io*) (streamp *query-io*) (streamp *debug-io*) *print-base* *read-base* *read-default-float-format* (consp *features*)))

;;; 383
(answer 383 (format nil "~a|~s|~10a|~10@a|~va" (let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) (11) . 12) ((13) . 14) 15 16))) (list (caaaar x) (caaadr x) (caadar x) (caaddr x) (cadaar x) (cadadr x) (caddar x) (cadddr x))) (let ((p (list :a 1 :b 2))) (list (remf p :z) p (setf (getf p :n) -100000000000000000000) (incf (getf p :m 10)) p)) nil ':key 1 'v))

;;; 384
(answer 384 (format nil "~d|~5d|~5,'0d|~:d|~@d|~b|~o|~x|~3r" (+ 1000003 (logxor (* 0 12) 255 (1+ 1000003))) (dpb (numerator (* 1/2 -7/3)) (byte 2 5) (logcount (gcd (gcd) -100000000000000000000))) 1 1 -7 12 (logand 255 (denominator (+ -7/3 22/7 22/7))) (rem (logior (logcount 1000003) (ash 1 0)) 2) 12))

;;; 385
(answer 385 (format nil "~f|~,2f|~8,3f|~e|~,3e|~$|~g" 0.5 0.5 0.5 -0.25 1.0 1.0 1.0))

;;; 386
(answer 386 (format nil "~r|~:r|~@r" 5 1 7))

;;; 387
(answer 387 (format nil "~{~a~^, ~}|~:{<~a ~a>~}|~@{~a~}" (append (rest (cons 0 '(1 2 3 4 5))) '(1 2 3 4 5)) '((1 2) (3 4)) (list (< (abs (- pi 3.141592653589793)) 1.0e-15)) (list single-float-epsilon short-float-epsilon long-float-epsilon single-float-negative-epsilon short-float-negative-epsilon long-float-negative-epsilon)))

;;; 388
(answer 388 (format nil "~[zero~;one~:;many~]|~:[no~;yes~]|~@[x=~a~]" 2 (list (logbitp 3 (mod (1- 4611686018427387903) 3)) (logtest (gcd) (ash (abs 4611686018427387903) 0))) nil))

;;; 389
(answer 389 (format nil "~(~a~)|~:(~a~)|~@(~a~)|~:@(~a~)" (format nil (formatter "~a+~a") (cond (nil (let ((x (list 1 2 3)) (y (do* ((i 0 (+ i 2)) (j i (+ i 1))) ((> i 5) (list i j)) (when (= i 4) (return 'early))))) (rotatef (first x) (third x) y) (shiftf (second x) y (let ((x 'a)) (handler-bind ((error (lambda (c) (declare (ignore c)) (invoke-restart 'store-value 7)))) (ctypecase x (integer (list 'integer x)))))) (list x y))) ((let ((l '(1 2 3 4 5 6 7 8 9 10 11))) (list (sixth l) (seventh l) (eighth l) (ninth l) (tenth l)))) (t (list (logandc1 -100000000000000000000 -7) (logandc2 0 255) (logeqv -100000000000000000000 12) (lognand 4611686018427387903 255)))) (let ((x (multiple-value-list (array-displacement (make-array 1 :initial-element (list least-positive-normalized-double-float least-negative-normalized-double-float))))) (y (handler-case (symbol-value 'nothing389) (unbound-variable (c) (cell-error-name c))))) (let* ((x y) (z x)) (list x y z)))) (format nil "~c|~:c|~@c|~?|~%~&~~|~|" #\a (code-char (+ 65 5)) (char-downcase (char-upcase #\5)) "~a-~a" (list (list (nth 0 (list* 255 '(3 1 2))) (list-length (reverse '(3 1 2))) (length (delete-if-not #'evenp (list 1 2 2 1))) (elt '(1 2 3 4 5 6) 3)) (let ((v (vector 1 2 3)) (i 0)) (incf (aref v (incf i)) (logand (gcd) 12)) (decf (aref v i)) (list v i)))) (nstring-downcase (copy-seq "ABC") :end 2) "xyzzy"))

;;; 390
(answer 390 (format nil "~a ~*~a|~2:*~a" 1 2 (stable-sort (list '(1 . a) '(0 . b) '(1 . c) '(0 . d)) #'< :key #'car) 4))

;;; 391
(answer 391 (format nil "~d item~:p|~d cit~:@p|~p" 1 1 5))

;;; 392
(answer 392 (format nil "~c|~:c|~@c|~?|~%~&~~|~|" (char-upcase (code-char (+ 65 0))) (char-upcase #\Z) (char-downcase (char-downcase #\Space)) "~a-~a" (list (list (eval '(+ 1 (numerator (* 1/2 1/2)))) (eval (lognot 1000003)) (eval ''a) (funcall (compile nil '(lambda (x) (* x 2))) (gcd))) (let ((s (copy-symbol 'foo)) (u (gentemp))) (list (symbol-name s) (eq s 'foo) (symbolp u) (integerp *gensym-counter*))))))

;;; 393
(answer 393 (format nil "a~10tb~5@tc~%~2,4td" ))

;;; 394
(answer 394 (format nil "~10<~a~>|~10:<~a~>|~10@<~a~>|~12<~a~;~a~;~a~>" 'a ':key 'foo 'a 'b 'c))

;;; 395
(answer 395 (format nil "~w|~a ~:a ~:s" (list (< 1000 array-dimension-limit) (< 7 array-rank-limit) (< 1000 array-total-size-limit) (bit (make-array 4 :element-type 'bit :initial-element 1) 2) (sbit (make-array 4 :element-type 'bit :initial-element 0) 1)) nil nil nil))

;;; 396
(answer 396 (format nil (formatter "~a+~a") (let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) 11 . 12) (13 . 14) 15 16))) (list (caar x) (cadr x) (cdar x) (cddr x) (caaar x) (caadr x) (cadar x) (caddr x) (cdaar x) (cdadr x) (cddar x) (cdddr x))) (multiple-value-bind (a b c) (values (let ((a (make-array 3 :initial-element 0 :adjustable t))) (list (adjust-array a 5 :initial-element 1000003) (array-element-type (vector 1)) (upgraded-array-element-type t))) (list (alpha-char-p #\Z) (alphanumericp (code-char (+ 65 0))) (graphic-char-p (char-downcase #\a)) (upper-case-p #\5) (lower-case-p #\-) (both-case-p (char-upcase #\Space)) (characterp (let ((v (make-array 1 :initial-element (let ((h (make-hash-table))) (list (integerp (hash-table-size h)) (realp (hash-table-rehash-size h)) (realp (hash-table-rehash-threshold h)) (= (sxhash "ab") (sxhash (copy-seq "ab"))))) :adjustable t :fill-pointer 0))) (list (vector-push (list (multiple-value-list (decode-universal-time 3600000000 0)) (encode-universal-time 5 4 3 2 1 2001 0)) v) (vector-push-extend (list (parse-integer "ff" :radix 16) (parse-integer " 12 x" :junk-allowed t) (parse-integer "a12b" :start 1 :end 3)) v) (vector-push-extend -100000000000000000000 v) (fill-pointer v) (vector-pop v) v (array-has-fill-pointer-p v) (adjustable-array-p v)))) (standard-char-p (code-char (+ 65 2))))) (list a b c))))

;;; 397
(answer 397 (format nil "~#[none~;one ~a~:;several~]" (list most-positive-double-float (< -1.0e-300 least-negative-double-float 0 least-positive-double-float 1.0e-300) most-negative-double-float double-float-epsilon double-float-negative-epsilon)))

;;; 398
(answer 398 (format nil "~a"))

;;; 399
(answer 399 (list (multiple-value-list (decode-universal-time 3600000000 0)) (encode-universal-time 5 4 3 2 1 2001 0)))

;;; 400
(answer 400 (list (integerp (get-universal-time)) (integerp (get-internal-real-time)) (integerp (get-internal-run-time)) (integerp internal-time-units-per-second) (length (multiple-value-list (get-decoded-time))) (stringp (lisp-implementation-type)) (stringp (lisp-implementation-version)) (progn (sleep 0) 1)))

;;; 401
(answer 401 (let ((*trace-output* (make-string-output-stream))) (time (= least-positive-single-float least-positive-short-float least-positive-long-float (- least-negative-single-float) (- least-negative-short-float) (- least-negative-long-float)))))
