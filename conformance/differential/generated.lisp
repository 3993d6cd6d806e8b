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
(answer 37 (list (numberp (let ((c (cons 1 2))) (rplaca c ((lambda (a &optional (b (let ((s (gensym "Q"))) (list (symbolp s) (boundp s) (fboundp s) (char (symbol-name s) 0) (symbol-plist s))) b-p) &rest r &key (k (list (nth 2 nil) (list-length '(3 1 2)) (length (remove-duplicates (nsubstitute-if-not (gcd) #'oddp (list 3 1 2)))) (elt '(1 2 3 4 5 6) 5))) &aux (z (list a b))) (list b-p r k z)) 1 2 :k 3)) (rplacd c (let ((x (list 1 2 3)) (y (list (parse-integer "ff" :radix 16) (parse-integer " 12 x" :junk-allowed t) (parse-integer "a12b" :start 1 :end 3)))) (rotatef (first x) (third x) y) (shiftf (second x) y (handler-case (symbol-value 'nothing37) (unbound-variable (c) (cell-error-name c)))) (list x y))) c)) (realp (loop for x = 1 then (* x 2) while (< x 50) until (> x 0) collect x)) (rationalp (* (rationalize 1.5) (/ (rational 0.1)))) (integerp (expt 2 (- 1))) (floatp (- (/ (+ (+) (*)) (- (+) (+))) (* (min (*) (+)) (expt 2 (- 0))))) (complexp (*))))

;;; 38
(answer 38 (list (evenp -100000000000000000000) (oddp (ash (ash (lognot 0) (- 5)) (- 1))) (zerop (- (+))) (plusp (*)) (minusp -7/3)))

;;; 39
(answer 39 (sqrt 2.0))

;;; 40
(answer 40 (list (sqrt 16) (sqrt 1) (exp 0.5) (log 10.0) (log 8 2) (exp 0)))

;;; 41
(answer 41 (list (sin -0.25) (cos 0.5) (tan 1.0) (asin 1.0) (acos 0.5) (atan 3.0e-5) (atan 1 -1)))

;;; 42
(answer 42 (list (sinh -0.25) (cosh 1.0) (tanh 0.5) (asinh -0.25) (acosh 1.5) (atanh 0.25)))

;;; 43
(answer 43 (list (< (abs (- pi 3.141592653589793)) 1.0e-15)))

;;; 44
(answer 44 (+ (expt (+ (+ -7/3 -7/3 1/2) (- 1/2 -7/3) -100000000000000000000) 2) (/ (rem (+ 12 (gcd)) 7) 3)))

;;; 45
(answer 45 (- (expt 1.0e10 0) (+)))

;;; 46
(answer 46 (* 1.5 (*)))

;;; 47
(answer 47 (+))

;;; 48
(answer 48 (*))

;;; 49
(answer 49 (- (+)))

;;; 50
(answer 50 (/ 1000003 7))

;;; 51
(answer 51 (/ (expt 1/2 5) (/ (rem (*) -3))))

;;; 52
(answer 52 (/ (*)))

;;; 53
(answer 53 (+ (- (* -100000000000000000000 22/7) (+ (* 1/2 -7/3) 12 (- 22/7 22/7))) -7/3 (logior (denominator 1/2) (lcm 0 255))))

;;; 54
(answer 54 (* 22/7 (gcd (abs 1) (gcd 1000003 4611686018427387903))))

;;; 55
(answer 55 (- 22/7 (+ 1/2 (* 12 -7) (- -7/3 1/2))))

;;; 56
(answer 56 (+ (gcd) -100000000000000000000))

;;; 57
(answer 57 (* (ldb (byte 2 3) 1) -7))

;;; 58
(answer 58 (- (lcm (ldb (byte 1 0) 0) (logxor 1000003 4611686018427387903 (logxor -7 (gcd) 12))) (logand (+ (ash 255 2) (ash 1000003 (- 1))) 1)))

;;; 59
(answer 59 (max (+) (max (list (float (logand 4611686018427387903 (gcd))) (float 3.0e-5) (float (integer-length 0) 1.0)) (min (rem (+) -3) (*)) (mod (- (*)) -3)) (*)))

;;; 60
(answer 60 (min (*) (+)))

;;; 61
(answer 61 (expt (+ (* (+ 1/2 22/7 22/7) (* -7/3 22/7)) (+ -7 (- 1/2 -7/3) 22/7) (* 255 (- -7/3 1/2))) 5))

;;; 62
(answer 62 (expt 3 (- 2)))

;;; 63
(answer 63 (expt 0.0 0))

;;; 64
(answer 64 (gcd (abs 255) (signum (isqrt (abs 0)))))

;;; 65
(answer 65 (lcm (- (logxor (gcd (gcd) -7) (signum 255) 4611686018427387903) (1- (dpb 1 (byte 2 1) 12))) 12))

;;; 66
(answer 66 (gcd))

;;; 67
(answer 67 (list (multiple-value-list (floor (+) 3)) (multiple-value-list (ceiling (mod (/ (mod (+) -3) (+)) -3) 7))))

;;; 68
(answer 68 (list (multiple-value-list (truncate 0.1 7)) (multiple-value-list (round (*) 3))))

;;; 69
(answer 69 (list (multiple-value-list (floor (- 22/7 (* -100000000000000000000 1)))) (multiple-value-list (round 1/2)) (multiple-value-list (ceiling (- (+ (+ -7/3 -7/3 -7/3) -7/3 (- 22/7 22/7)) (* (+ 1/2 -7/3 1/2) -7/3)))) (multiple-value-list (truncate (+ (* 22/7 22/7) 1/2 22/7)))))

;;; 70
(answer 70 (list (multiple-value-list (floor -100000000000000000000 (ash (numerator 0) (- 3)))) (multiple-value-list (truncate -100000000000000000000 (logior -7 4611686018427387903)))))

;;; 71
(answer 71 (list (multiple-value-list (ffloor -2.25 2.0)) (multiple-value-list (fceiling 1.0e10)) (multiple-value-list (ftruncate 1.0e10)) (multiple-value-list (fround (sqrt 2.0)))))

;;; 72
(answer 72 (mod (1+ (logcount (mod 255 3))) 2))

;;; 73
(answer 73 (rem (ash (1- 1000003) 5) 2))

;;; 74
(answer 74 (mod (expt 3.0e-5 0) -3))

;;; 75
(answer 75 (rem (/ (rem 1 1) 7) -3))

;;; 76
(answer 76 (list (= (*) (+)) (/= (*) (rationalize 0.0) (list (float -100000000000000000000) (float (sqrt 2.0)) (float (logior (denominator -7/3) (isqrt (abs 0))) 1.0))) (< (rational -2.25) (max (+ 1/2 -7/3 22/7) (+) (+ 255 (rationalize 0.1)))) (> (+ (+) (expt 3 (- 1))) (min (/ 1000003 2) (*))) (<= (+) (max 1/2 (rem (*) -3) (expt (* -7/3 1/2) 1)) (*)) (>= (gcd) (*))))

;;; 77
(answer 77 (= (- (rational (sqrt 2.0)) (+)) (- (*) (+ 0.0 (/ (+)))) (expt (- -7/3 1/2) 2)))

;;; 78
(answer 78 (ash 12 3))

;;; 79
(answer 79 (ash (abs 0) (- 3)))

;;; 80
(answer 80 (logand (1+ (gcd)) 1000003))

;;; 81
(answer 81 (logior (logxor (logand (ldb (byte 1 0) -7) 1) 12 (lcm -7 (+ 255 -100000000000000000000))) 4611686018427387903))

;;; 82
(answer 82 (logxor (denominator (lognot 1)) (denominator 22/7) 4611686018427387903))

;;; 83
(answer 83 (list (logandc1 -7 (1- (logand 12 (- 12 255)))) (logandc2 (rem (mod (logcount 4611686018427387903) 3) 1) (gcd)) (logeqv 1000003 4611686018427387903) (lognand -100000000000000000000 (logcount (gcd (lognot 0) 12)))))

;;; 84
(answer 84 (list (lognor (isqrt (abs (abs (1+ -100000000000000000000)))) 1) (logorc1 255 -7) (logorc2 (lognot 0) (integer-length (signum (dpb 1000003 (byte 2 2) (gcd)))))))

;;; 85
(answer 85 (list (logbitp 2 (numerator 1/2)) (logtest 12 255)))

;;; 86
(answer 86 (ldb (byte 2 0) 1000003))

;;; 87
(answer 87 (dpb (- (+ (ash -7 (- 5)) (* 4611686018427387903 12)) (gcd)) (byte 3 5) (numerator -7/3)))

;;; 88
(answer 88 (let ((spec (byte 7 1))) (list (byte-size spec) (byte-position spec) (ldb-test spec -7) (mask-field spec 255) (deposit-field (abs (logior 1 (isqrt (abs 1000003)))) spec (ash (mod (lcm 1 0) 7) 3)))))

;;; 89
(answer 89 (let ((n (* (1+ (denominator 1/2)) (ldb (byte 1 2) (logxor 1000003 (gcd) 4611686018427387903))))) (setf (ldb (byte 3 2) n) (ash (1+ 0) (- 5))) (setf (mask-field (byte 2 0) n) (logcount (lognot (denominator 22/7)))) n))

;;; 90
(answer 90 (list (boole boole-1 (ash (1- (logcount -100000000000000000000)) 0) (logand (gcd (abs (gcd)) (logand 12 -7)) 255)) (boole boole-2 (lognot 4611686018427387903) -100000000000000000000) (boole boole-and (signum (rem (mod 255 1) 7)) (lcm (ldb (byte 1 3) 1000003) (logxor (rem 1000003 1) (1- (gcd)) (isqrt (abs 0))))) (boole boole-ior (dpb 1 (byte 7 3) (* (lcm 4611686018427387903 0) 12)) (- (dpb (signum -7) (byte 2 1) (+ -100000000000000000000 1000003)) (gcd (ldb (byte 2 2) 0) (integer-length (gcd))))) (boole boole-xor (isqrt (abs 255)) (1+ 1)) (boole boole-eqv 4611686018427387903 (ldb (byte 3 1) -7)) (boole boole-nand (ash (lognot (signum 1)) (- 5)) (+ (logxor 12 -100000000000000000000 (numerator 22/7)) (logand -100000000000000000000 (integer-length 1000003)))) (boole boole-nor (mod -7 3) (1- (logcount (lcm 255 4611686018427387903))))))

;;; 91
(answer 91 (list (boole boole-andc1 (gcd) -7) (boole boole-andc2 (numerator 1/2) (- 0 (ash (gcd) 0))) (boole boole-orc1 1 (logior (signum (mod 4611686018427387903 7)) (ash (logxor 12 1000003 12) (- 3)))) (boole boole-orc2 0 (rem (* (rem -100000000000000000000 7) (* 255 0)) 2)) (boole boole-c1 (lognot -7) 1) (boole boole-c2 (gcd) (logand (- (+ 255 1) (denominator 22/7)) (integer-length (logcount -100000000000000000000)))) (boole boole-clr (ldb (byte 3 0) (1- (denominator 22/7))) 1000003) (boole boole-set 0 (gcd))))

;;; 92
(answer 92 (multiple-value-list (decode-float 1.0e10)))

;;; 93
(answer 93 (multiple-value-list (integer-decode-float (sqrt 2.0))))

;;; 94
(answer 94 (list (scale-float 3.0e-5 2) (float-radix 1.5) (float-sign 0.1) (float-sign 1.5 2.0) (float-digits (sqrt 2.0)) (float-precision 3.0e-5)))

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
(answer 100 (progn (pprint (copy-list (reverse '(3 1 2)))) 'pretty))

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
(answer 108 (prin1-to-string (min (/ (list (float -7) (float -2.25) (float 255 1.0)) (max (*) (+) (+))) (*))))

;;; 109
(answer 109 (princ-to-string (handler-case (symbol-value 'nothing109) (unbound-variable (c) (cell-error-name c)))))

;;; 110
(answer 110 (write-to-string 1.0e10 :base 8))

;;; 111
(answer 111 (write-to-string (format nil "~w|~a ~:a ~:s" (= least-positive-single-float least-positive-short-float least-positive-long-float (- least-negative-single-float) (- least-negative-short-float) (- least-negative-long-float)) nil nil nil) :escape nil))

;;; 112
(answer 112 (let ((*print-base* 2) (*print-radix* t)) (prin1-to-string -100000000000000000000)))

;;; 113
(answer 113 (let ((*print-length* 2) (*print-level* 1)) (prin1-to-string '(1 (2 (3)) 4 5))))

;;; 114
(answer 114 (let ((*print-case* :downcase) (*print-escape* nil)) (write-to-string '(Foo "x" |Bar|))))

;;; 115
(answer 115 (let ((*print-array* nil) (*print-gensym* nil)) (write-to-string (make-symbol "X"))))

;;; 116
(answer 116 (let ((*print-circle* nil) (*print-readably* nil) (*print-pretty* nil)) (write-to-string '(a (b . c) (d (e))))))

;;; 117
(answer 117 (char-upcase (char-downcase (char-upcase (char-downcase #\Z)))))

;;; 118
(answer 118 (char-downcase (code-char (+ 65 3))))

;;; 119
(answer 119 (code-char (+ 65 5)))

;;; 120
(answer 120 (list (char-code (code-char (+ 65 1))) (char-int (code-char (+ 65 5))) (char-name #\Newline) (name-char "space") (digit-char 2) (digit-char 11 16) (digit-char-p (char-downcase (char-upcase (char-upcase #\Space)))) (digit-char-p #\f 16)))

;;; 121
(answer 121 (list (alpha-char-p (char-upcase #\a)) (alphanumericp #\Space) (graphic-char-p (char-downcase (code-char (+ 65 3)))) (upper-case-p (code-char (+ 65 0))) (lower-case-p #\-) (both-case-p (char-upcase #\-)) (characterp (list (boole boole-andc1 (dpb 1000003 (byte 3 1) (logior -100000000000000000000 4611686018427387903)) (numerator (+ -7/3 22/7 -7/3))) (boole boole-andc2 (1+ (logior 1 12)) (+ (dpb 4611686018427387903 (byte 1 5) 255) 1000003)) (boole boole-orc1 -100000000000000000000 (ash (lcm -7 1) 1)) (boole boole-orc2 4611686018427387903 0) (boole boole-c1 (isqrt (abs (integer-length 12))) (abs 1)) (boole boole-c2 (abs -7) 0) (boole boole-clr (gcd 1000003 255) (dpb (integer-length 12) (byte 7 2) (numerator 1/2))) (boole boole-set (logior (abs 4611686018427387903) (rem -100000000000000000000 1)) (* (ash (gcd) (- 1)) 255)))) (standard-char-p #\5)))

;;; 122
(answer 122 (list (char= (code-char (+ 65 2)) #\Z) (char/= (char-downcase (char-upcase #\Space)) (char-upcase #\-)) (char< (code-char (+ 65 3)) (char-downcase #\a) (char-upcase (code-char (+ 65 1)))) (char> (char-downcase (code-char (+ 65 0))) #\5) (char<= (char-downcase #\Z) #\Space) (char>= (char-downcase (char-downcase (code-char (+ 65 0)))) #\5)))

;;; 123
(answer 123 (list (char-equal #\a (char-upcase (code-char (+ 65 1)))) (char-not-equal (char-upcase #\Z) #\Space) (char-lessp (code-char (+ 65 2)) #\5) (char-greaterp (char-upcase #\5) (char-downcase (code-char (+ 65 0)))) (char-not-greaterp #\- #\-) (char-not-lessp #\5 (char-upcase #\Space))))

;;; 124
(answer 124 (list (character 'x) (character "y") (character #\Z) (< 1000 char-code-limit)))

;;; 125
(answer 125 (string-upcase (nstring-capitalize (copy-seq (format nil "~a")))))

;;; 126
(answer 126 (string-downcase (format nil "~a|~s|~10a|~10@a|~va" (let ((l nil)) (dotimes (i 3 (list i l)) (push i l))) (list (sqrt 16) (sqrt 1) (exp -0.25) (log 10.0) (log 8 2) (exp 0)) 'foo ':key 5 'v) :start 1))

;;; 127
(answer 127 (string-capitalize "abc"))

;;; 128
(answer 128 (nstring-upcase (copy-seq "fresh")))

;;; 129
(answer 129 (nstring-downcase (copy-seq "ABC") :end 2))

;;; 130
(answer 130 (nstring-capitalize (copy-seq "")))

;;; 131
(answer 131 (string-trim "a Z" (let ((*print-case* :downcase) (*print-escape* nil)) (write-to-string '(Foo "x" |Bar|)))))

;;; 132
(answer 132 (string-left-trim '(#\a #\H) (string-trim "a Z" (nstring-downcase (copy-seq "ABC") :end 2))))

;;; 133
(answer 133 (string-right-trim "dcy" (string-right-trim "dcy" (let ((*print-array* nil) (*print-gensym* nil)) (write-to-string (make-symbol "X"))))))

;;; 134
(answer 134 (string ':key))

;;; 135
(answer 135 (make-string 2 :initial-element (char-downcase #\a)))

;;; 136
(answer 136 (concatenate 'string "" "a-b c" (string-upcase (format nil "~10<~a~>|~10:<~a~>|~10@<~a~>|~12<~a~;~a~;~a~>" 'a 'foo nil 'a 'b 'c))))

;;; 137
(answer 137 (reverse (format nil "~a")))

;;; 138
(answer 138 (subseq "abcdefgh" 1))

;;; 139
(answer 139 (remove (char-downcase (char-downcase (code-char (+ 65 5)))) (format nil (formatter "~a+~a") (list least-positive-normalized-double-float least-negative-normalized-double-float) (reduce #'- (remove-if-not #'evenp (substitute 4611686018427387903 12 (delete -7 (list 3 1 2)))) :from-end t :initial-value (signum 0) :start 0))))

;;; 140
(answer 140 (substitute #\! #\- (let ((*print-circle* nil) (*print-readably* nil) (*print-pretty* nil)) (write-to-string '(a (b . c) (d (e)))))))

;;; 141
(answer 141 (list (string= (format nil "~a|~s|~10a|~10@a|~va" (list (adjoin 1 (nconc (list 1 2 2 1) (list 3 1 2))) (adjoin 1000003 nil :key #'-) (tailp nil (nconc (list 1 2 2 1) (list 3 1 2)))) (list (lognor (logxor (gcd) 255 (gcd)) (isqrt (abs 1))) (logorc1 (ash -100000000000000000000 5) -100000000000000000000) (logorc2 (denominator 1/2) (+ -7 0))) ':key 'a 0 'v) (format nil "~d|~5d|~5,'0d|~:d|~@d|~b|~o|~x|~3r" (logcount (lognot 12)) -100000000000000000000 3 (- (ldb (byte 2 1) 1) (1+ (gcd))) 255 (gcd (gcd) (denominator -7/3)) (1- (+ 4611686018427387903 0)) 1000003 (1- (logxor 1000003 -7 4611686018427387903)))) (string/= "a-b c" "Hello World") (string< (subseq "abcdefgh" 0) (string-capitalize "xyzzy")) (string> (let ((*print-base* 2) (*print-radix* t)) (prin1-to-string 12)) (let ((*print-case* :downcase) (*print-escape* nil)) (write-to-string '(Foo "x" |Bar|)))) (string<= (prin1-to-string (expt 3 (- 2))) "xyzzy") (string>= "abc" (format nil "~a ~*~a|~2:*~a" 1 2 (loop for x in (cons 1 '(5 -5 5)) if (evenp x) sum x into e and collect x into l else minimize x into m end finally (return (list e l m))) 4))))

;;; 142
(answer 142 (list (string-equal "a-b c" (let ((*print-array* nil) (*print-gensym* nil)) (write-to-string (make-symbol "X")))) (string-not-equal "" (write-to-string (let ((h (make-hash-table))) (list (integerp (hash-table-size h)) (realp (hash-table-rehash-size h)) (realp (hash-table-rehash-threshold h)) (= (sxhash "ab") (sxhash (copy-seq "ab"))))) :escape nil)) (string-lessp (substitute #\! #\5 (format nil "~a")) (format nil "~d|~5d|~5,'0d|~:d|~@d|~b|~o|~x|~3r" (1+ (gcd)) (rem 4611686018427387903 2) 3 (lognot (mod 1 7)) 1000003 (dpb 255 (byte 2 1) (logior -100000000000000000000 12)) 0 -100000000000000000000 -7)) (string-greaterp (nstring-upcase (copy-seq (string-downcase (format nil "a~10tb~5@tc~%~2,4td" ) :start 1))) (format nil "~f|~,2f|~8,3f|~e|~,3e|~$|~g" 0.5 1.0 0.5 1.0 -0.25 1.0 -0.25)) (string-not-greaterp (write-to-string (rational 3.0e-5) :base 8) (format nil (formatter "~a+~a") (loop for x = 1 then (* x 2) while (< x 50) until (> x 3) collect x) (let ((h (make-hash-table))) (dolist (x (nthcdr 3 '(1 2 3 4 5))) (incf (gethash x h 0))) (list (loop for k being the hash-keys of h collect k) (loop for v being the hash-values of h using (hash-key k) collect (cons k v)) (progn (clrhash h) (hash-table-count h)))))) (string-not-lessp (let ((*print-length* 2) (*print-level* 1)) (prin1-to-string '(1 (2 (3)) 4 5))) (reverse (format nil "~r|~:r|~@r" 0 2 3)))))

;;; 143
(answer 143 (list (stringp (let ((x (list (integerp (get-universal-time)) (integerp (get-internal-real-time)) (integerp (get-internal-run-time)) (integerp internal-time-units-per-second) (length (multiple-value-list (get-decoded-time))) (stringp (lisp-implementation-type)) (stringp (lisp-implementation-version)) (progn (sleep 0) 1)))) (declare (ignorable x) (type t x)) (symbol-macrolet ((y (list x))) y))) (simple-string-p "abc") (length (format nil "~(~a~)|~:(~a~)|~@(~a~)|~:@(~a~)" (concatenate 'string (format nil "~10<~a~>|~10:<~a~>|~10@<~a~>|~12<~a~;~a~;~a~>" nil nil ':key 'a 'b 'c) "Hello World" (string 'foo)) (princ-to-string (list (boole boole-1 1000003 12) (boole boole-2 0 255) (boole boole-and 1000003 0) (boole boole-ior 255 1) (boole boole-xor -100000000000000000000 (gcd)) (boole boole-eqv -7 -7) (boole boole-nand 1 12) (boole boole-nor 4611686018427387903 -100000000000000000000))) (format nil "~w|~a ~:a ~:s" (list (getf '(:a 1 :b 2) :a) (getf nil :z (parse-integer "1x2")) (multiple-value-list (get-properties '(:a 1 :b 2) '(:b :c)))) nil nil nil) (format nil "~{~a~^, ~}|~:{<~a ~a>~}|~@{~a~}" '(3 1 2) '((1 2) (3 4)) (cond (t (list (eq (intern "FOO") 'foo) (multiple-value-list (find-symbol "CAR" "COMMON-LISP")) (packagep *package*) (package-name (find-package "KEYWORD")) (package-name (symbol-package 'car)))) ((let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) (11) . 12) ((13) . 14) 15 16))) (list (cdaaar x) (cdaadr x) (cdadar x) (cdaddr x) (cddaar x) (cddadr x) (cdddar x) (cddddr x)))) (t (read-char (make-string-input-stream "")))) (multiple-value-bind (v c) (ignore-errors (error 'simple-error :format-control "x ~a" :format-arguments '(1))) (list v (simple-condition-format-control c) (simple-condition-format-arguments c)))))) (position #\a (format nil "~a ~*~a|~2:*~a" 1 2 (funcall (lambda (&key a ((:other o) (list (member 255 '(5 -5 5)) (member 4611686018427387903 '(1 2 3 4 5) :test #'eql) (member-if #'plusp '(5 -5 5)) (member-if-not #'plusp nil))) &allow-other-keys) (list a o)) :a 1 :b 2) 4)) (search (format nil "~c|~:c|~@c|~?|~%~&~~|~|" (char-upcase (code-char (+ 65 5))) #\5 (char-downcase (char-upcase #\a)) "~a-~a" (list (list (multiple-value-list (subtypep 'fixnum 'rational)) (multiple-value-list (subtypep '(integer 0 3) '(integer 0 2)))) (reduce #'- (nsubstitute-if 4611686018427387903 #'oddp (vector 4 3 2 1)) :from-end t :initial-value 1000003 :start 0))) (string-left-trim '(#\a #\H) (format nil "~d item~:p|~d cit~:@p|~p" 5 3 5))) (mismatch (format nil "~#[none~;one ~a~:;several~]" (handler-bind ((error (lambda (c) (declare (ignore c)) (use-value (let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) 11 . 12) (13 . 14) 15 16))) (list (caar x) (cadr x) (cdar x) (cddr x) (caaar x) (caadr x) (cadar x) (caddr x) (cdaar x) (cdadr x) (cddar x) (cdddr x))))))) (restart-case (error "x") (use-value (v) (list 'used v)) (store-value (v) v)))) (make-string 2 :initial-element #\-))))

;;; 144
(answer 144 (let ((s (copy-seq (format nil "~c|~:c|~@c|~?|~%~&~~|~|" (char-downcase #\Space) (char-upcase #\Z) (char-downcase #\a) "~a-~a" (list (list (nsubst 'x 'c (copy-tree '((1 . 2) 3))) (nsubst-if 'x #'numberp (copy-tree '((1 . 2) 3))) (nsubst-if-not 'x #'listp (copy-tree '((1 . 2) 3)))) (let (a b) (setf (values a b) (values (let ((s (make-string-input-stream "ab cd"))) (list (read-preserving-whitespace s) (read-char-no-hang s) (peek-char t s) (listen s) (input-stream-p s) (output-stream-p s) (streamp s) (open-stream-p s) (close s))) (with-open-stream (s (make-string-input-stream "1 2")) (list (read s) (read s) (read s nil :eof))))) (list a b))))))) (list (char "abc" 1) (schar "abc" 2) (if (> (length s) 0) (setf (char s 0) #\Q)) s)))

;;; 145
(answer 145 (string< "abc" "xabd" :start2 1))

;;; 146
(answer 146 (list (symbolp (handler-case (read-from-string "(1 2") (end-of-file (c) (streamp (stream-error-stream c))))) (keywordp 'foo) (symbol-name 'a) (eq ':key 'a) (symbol-package ':k)))

;;; 147
(answer 147 (let ((s (gensym "Q"))) (list (symbolp s) (boundp s) (fboundp s) (char (symbol-name s) 0) (symbol-plist s))))

;;; 148
(answer 148 (let ((s (make-symbol "S"))) (set s (list (char= (code-char (+ 65 1)) (code-char (+ 65 2))) (char/= (char-upcase #\5) #\Space) (char< #\Space (char-upcase (char-downcase #\-)) (char-upcase (char-upcase #\Z))) (char> (char-downcase (code-char (+ 65 1))) (code-char (+ 65 0))) (char<= (char-downcase #\-) (code-char (+ 65 2))) (char>= (char-upcase (char-upcase #\-)) #\Z))) (setf (get s 'p) (loop for x across #(3 1 2) sum x into s count (oddp x) into c maximize x into m finally (return (list s c m)))) (setf (symbol-function s) (lambda (x) (* x x))) (list (symbol-value s) (get s 'p) (get s 'q 'none) (funcall s (ldb (byte 3 5) (ash (lcm 0 -7) (- 5)))) (if (remprop s 'p) t) (get s 'p) (if (fboundp s) t) (progn (makunbound s) (boundp s)) (progn (fmakunbound s) (fboundp s)))))

;;; 149
(answer 149 (let ((s (copy-symbol 'foo)) (u (gentemp))) (list (symbol-name s) (eq s 'foo) (symbolp u) (integerp *gensym-counter*))))

;;; 150
(answer 150 (list (eq (intern "FOO") 'foo) (multiple-value-list (find-symbol "CAR" "COMMON-LISP")) (packagep *package*) (package-name (find-package "KEYWORD")) (package-name (symbol-package 'car))))

;;; 151
(answer 151 (list (constantp (let ((s (make-string-input-stream "ab cd"))) (list (read-preserving-whitespace s) (read-char-no-hang s) (peek-char t s) (listen s) (input-stream-p s) (output-stream-p s) (streamp s) (open-stream-p s) (close s)))) (constantp 'x) (constantp ''x) (special-operator-p 'if) (special-operator-p 'car) (compiled-function-p #'car) (functionp #'car) (functionp 'car)))

;;; 152
(answer 152 (cons (isqrt (abs (ash (gcd) 3))) (list* (numerator (gcd)) '(3 1 2))))

;;; 153
(answer 153 (list (* 12 (signum (gcd))) 0 255))

;;; 154
(answer 154 (list* (logcount (lcm 4611686018427387903 (abs 1000003))) (cons (logand (integer-length 12) (mod -7 1)) (ldiff '(5 -5 5) nil))))

;;; 155
(answer 155 (append (ldiff '(5 -5 5) nil) nil))

;;; 156
(answer 156 (reverse (append (last '(5 -5 5) 0) (nthcdr 3 '(3 1 2)))))

;;; 157
(answer 157 (nreverse (copy-list (last nil 2))))

;;; 158
(answer 158 (copy-list nil))

;;; 159
(answer 159 (rest (nreverse (list 1 2 2 1))))

;;; 160
(answer 160 (nthcdr 1 '(3 1 2)))

;;; 161
(answer 161 (last (revappend (revappend (make-list 5 :initial-element 12) (butlast '(1 2 3 4 5))) '(1 2 3 4 5)) 1))

;;; 162
(answer 162 (butlast '(1 2 3 4 5)))

;;; 163
(answer 163 (nbutlast (list 1 2 2 1) 0))

;;; 164
(answer 164 (nconc (copy-list (make-list 5 :initial-element -100000000000000000000)) (copy-list '(5 -5 5))))

;;; 165
(answer 165 (revappend '(5 -5 5) (nreconc (copy-list (nbutlast (list 3 1 2) 1)) (list 3 1 2))))

;;; 166
(answer 166 (nreconc (copy-list (cons (logand 1 1) (list* (gcd) '(3 1 2)))) (copy-list nil)))

;;; 167
(answer 167 (make-list 3 :initial-element (- (gcd (integer-length 12) (1- 255)) (* 1000003 (signum 4611686018427387903)))))

;;; 168
(answer 168 (ldiff (nthcdr 2 (reverse (make-list 0 :initial-element 1))) nil))

;;; 169
(answer 169 (car (nbutlast (list 1 2 2 1) 2)))

;;; 170
(answer 170 (cdr '((1 . 2) 3)))

;;; 171
(answer 171 (list (first '(1 2 3 4 5)) (second (nconc (list 1 2 2 1) (list 3 1 2))) (third (copy-list (nreverse (copy-list nil)))) (fourth (nreverse (list 3 1 2))) (fifth '(5 -5 5))))

;;; 172
(answer 172 (let ((l '(1 2 3 4 5 6 7 8 9 10 11))) (list (sixth l) (seventh l) (eighth l) (ninth l) (tenth l))))

;;; 173
(answer 173 (let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) 11 . 12) (13 . 14) 15 16))) (list (caar x) (cadr x) (cdar x) (cddr x) (caaar x) (caadr x) (cadar x) (caddr x) (cdaar x) (cdadr x) (cddar x) (cdddr x))))

;;; 174
(answer 174 (let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) (11) . 12) ((13) . 14) 15 16))) (list (caaaar x) (caaadr x) (caadar x) (caaddr x) (cadaar x) (cadadr x) (caddar x) (cadddr x))))

;;; 175
(answer 175 (let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) (11) . 12) ((13) . 14) 15 16))) (list (cdaaar x) (cdaadr x) (cdadar x) (cdaddr x) (cddaar x) (cddadr x) (cdddar x) (cddddr x))))

;;; 176
(answer 176 (list (consp (handler-case (read-from-string "(1 2") (end-of-file (c) (streamp (stream-error-stream c))))) (atom (list (multiple-value-list (decode-universal-time 3600000000 0)) (encode-universal-time 5 4 3 2 1 2001 0))) (listp (let ((x (unless (< call-arguments-limit 50) (list (< 20 lambda-parameters-limit) (< 19 multiple-values-limit) (if (member '&rest lambda-list-keywords) t))))) (declare (ignorable x) (type t x)) (symbol-macrolet ((y (list x))) y))) (null (list (string= "" (format nil "~{~a~^, ~}|~:{<~a ~a>~}|~@{~a~}" (nreconc (list 1 2 2 1) (list 3 1 2)) '((1 2) (3 4)) (let ((l '(1 2 3 4 5)) (m nil)) (push 1 l) (pushnew (gcd) l) (pushnew 3 l :test #'=) (setq m (pop l)) (list l m)) (list most-positive-double-float (< -1.0e-300 least-negative-double-float 0 least-positive-double-float 1.0e-300) most-negative-double-float double-float-epsilon double-float-negative-epsilon))) (string/= (format nil "~f|~,2f|~8,3f|~e|~,3e|~$|~g" 1.0 -0.25 0.5 -0.25 0.5 0.5 -0.25) (format nil "~d item~:p|~d cit~:@p|~p" 3 1 0)) (string< (format nil "~[zero~;one~:;many~]|~:[no~;yes~]|~@[x=~a~]" 1 nil ':key) (let ((*print-array* nil) (*print-gensym* nil)) (write-to-string (make-symbol "X")))) (string> (write-to-string (load-time-value (list 1 2)) :escape nil) "Hello World") (string<= (string-upcase (format nil "~d item~:p|~d cit~:@p|~p" 5 0 0)) (remove (code-char (+ 65 3)) (subseq "abcdefgh" 0))) (string>= (string-trim "a Z" (nstring-downcase (copy-seq "ABC") :end 2)) (string-downcase (format nil "a~10tb~5@tc~%~2,4td" ) :start 1)))) (endp (nbutlast (copy-list '(3 1 2)) 3)) (not (progn (print (loop for x in (cons 1 '(3 1 2)) if (evenp x) sum x into e and collect x into l else minimize x into m end finally (return (list e l m)))) (prin1 (list (find-if (lambda (x) (> x 2)) (sort (list 1 2 2 1) #'<)) (find-if-not #'oddp (remove 4611686018427387903 (remove-duplicates (stable-sort (vector 4 3 2 1) #'< :key #'abs) :from-end t))) (find-if (lambda (x) (> x 2)) (substitute-if 255 #'evenp (delete -100000000000000000000 (list 3 1 2))) :from-end t))) (princ (handler-bind ((warning #'muffle-warning)) (warn "w ~a" (loop for i downfrom 5 to 2 by 2 collect i)) 'warned)) (terpri) (write-line "x") (fresh-line) (format t "~a~%" (list (concatenate 'list (fill (vector 4 3 2 1) 12) (nsubstitute-if-not 1000003 #'evenp (list 1 2 2 1))) (concatenate 'vector (delete-duplicates (vector 4 3 2 1) :key #'1+) #(3 1 2 1)))) 'printed))))

;;; 177
(answer 177 (list (nth 2 (append (butlast '(3 1 2)) (list (ash -100000000000000000000 1) -7 (abs -7)))) (list-length (append (rest (ldiff '(5 -5 5) nil)) nil)) (length (remove-if-not #'oddp (delete-if-not (lambda (x) (> x 2)) (vector 4 3 2 1)))) (elt '(1 2 3 4 5 6) 5)))

;;; 178
(answer 178 (let ((c (cons 1 2))) (rplaca c (handler-case (cl:assert (= 1 (1+ (gcd 0 12)))) (error () 'assertion))) (rplacd c (handler-bind ((warning #'muffle-warning)) (warn "w ~a" (handler-bind ((error #'continue)) (cerror "Go on." "bad ~a" 1) 'continued)) 'warned)) c))

;;; 179
(answer 179 (list (copy-tree '(a (b . c) (d (e)))) (copy-alist '((a . 1) nil (c . 3))) (tree-equal '((1 . 2) 3) '(a (b . c) (d (e)))) (tree-equal '((1 . 2) 3) '(a (b . c) (d (e))) :test #'equal)))

;;; 180
(answer 180 (list (subst (handler-bind ((error #'continue)) (cerror "Go on." "bad ~a" 1) 'continued) 'b '(a (b . c) (d (e)))) (subst-if 0 #'symbolp '(a (b . c) (d (e)))) (subst-if-not 0 #'consp '((1 . 2) 3))))

;;; 181
(answer 181 (list (nsubst 'x 'c (copy-tree '(a (b . c) (d (e))))) (nsubst-if 'x #'numberp (copy-tree '((1 . 2) 3))) (nsubst-if-not 'x #'listp (copy-tree '((1 . 2) 3)))))

;;; 182
(answer 182 (list (sublis '((a . 1) nil (c . 3)) '(a (b . c) (d (e)))) (nsublis '((a . z)) (copy-tree '((1 . 2) 3)))))

;;; 183
(answer 183 (list (member (signum (lognot (ldb (byte 3 1) 4611686018427387903))) '(1 2 3 4 5)) (member (1+ 1000003) (nreconc (copy-list (revappend '(3 1 2) nil)) (list 1 2 2 1)) :test #'=) (member-if #'evenp (append '(1 2 3 4 5) (list* (1- (gcd)) (list 1 0 1000003)))) (member-if-not #'plusp nil)))

;;; 184
(answer 184 (list (assoc 'foo '((a . 1) (b . 2))) (assoc 'b '((a . 1) nil (c . 3)) :test #'eq) (assoc-if #'symbolp '((a . 1) (b . 2))) (assoc-if-not #'symbolp '((a . 1) (2 . 3)))))

;;; 185
(answer 185 (list (rassoc (ldb (byte 7 0) (logior (ash -7 5) (logcount (gcd)))) '((a . 1) nil (c . 3))) (rassoc-if (lambda (x) (> x 2)) '((a . 1) (b . 4))) (rassoc-if-not #'plusp '((a . 1) (b . 4)))))

;;; 186
(answer 186 (list (acons 'a (let* ((a (make-random-state t)) (b (make-random-state a))) (equal (list (random 1000 a) (random 1000 a)) (list (random 1000 b) (random 1000 b)))) '((a . 1) (b . 2))) (pairlis '(c a) '(1 2 3) '((a . 1) (b . 2)))))

;;; 187
(answer 187 (pairlis '(a b c) (list (let ((l '(1 2 3 4 5 6 7 8 9 10 11))) (list (sixth l) (seventh l) (eighth l) (ninth l) (tenth l))) (progn (let ((s (copy-symbol 'foo)) (u (gentemp))) (list (symbol-name s) (eq s 'foo) (symbolp u) (integerp *gensym-counter*))) (cond (nil (list (subst (list (let ((s (make-random-state t))) (random-state-p s)) (random-state-p *random-state*) (< -1 (random 10) 10) (< (random 1.0) 1.0)) 'b '((1 . 2) 3)) (subst-if 0 #'symbolp '(a (b . c) (d (e)))) (subst-if-not 0 #'consp '((1 . 2) 3)))) ((symbol-value 'unbound-thing187)) (t (let ((l nil)) (list (catch 'k (unwind-protect (throw 'k 1) (push (let ((l nil)) (tagbody (go two) one (push 1 l) (go end) two (push 2 l) (go one) end) l) l))) l))))) (apply #'+ (rem 0 2) '(3 1 2)))))

;;; 188
(answer 188 (list (getf '(:a 1 :b 2) :a) (getf nil :z (list (loop for x in (nreverse (list 1 2 2 1)) always (numberp x)) (loop for x in (rest (butlast '(5 -5 5))) never (eql x 2)) (loop for x in (nconc (list 3 1 2) (copy-list '(1 2 3 4 5))) thereis (and (> x 2) x)))) (multiple-value-list (get-properties '(:a 1 :b 2) '(:b :c)))))

;;; 189
(answer 189 (let ((p (list :a 1 :b 2))) (list (remf p :b) p (setf (getf p :n) (lognot (isqrt (abs (numerator 1/2))))) (incf (getf p :m 10)) p)))

;;; 190
(answer 190 (list (adjoin (ash (+ (rem 4611686018427387903 1) (dpb 0 (byte 2 5) 12)) (- 0)) nil) (adjoin (ash 255 (- 2)) (revappend (reverse (cons -100000000000000000000 nil)) (copy-list (make-list 2 :initial-element 255))) :key #'-) (tailp nil '(3 1 2))))

;;; 191
(answer 191 (list (apply #'union (list (nbutlast (copy-list (nreconc (list 1 2 2 1) (list 1 2 2 1))) 3) '(5 -5 5))) (intersection '(1 2 3 4 5) (nthcdr 0 (cons 1 '(1 2 3 4 5)))) (set-difference (list* (+ (abs (gcd)) (lcm -7 255)) '(3 1 2)) nil) (set-exclusive-or (ldiff (butlast '(5 -5 5)) nil) '(5 -5 5)) (subsetp nil (rest '(1 2 3 4 5)))))

;;; 192
(answer 192 (list (sort (nunion (list 3 1 2) (copy-list '(3 1 2))) #'<) (nintersection (copy-list '(3 1 2)) (list 1 2 2 1)) (nset-difference (list 3 1 2) (copy-list nil)) (sort (nset-exclusive-or (copy-list (last '(1 2 3 4 5) 3)) (copy-list (rest '(5 -5 5)))) #'<)))

;;; 193
(answer 193 (apply #'union (list (make-list 2 :initial-element (logcount (gcd 0 -7))) (nconc (copy-list nil) (copy-list (nthcdr 1 '(3 1 2)))) :test #'<)))

;;; 194
(answer 194 (let ((l '(5 -5 5)) (m nil)) (push (logand (gcd -100000000000000000000 (integer-length (gcd))) 0) l) (pushnew 12 l) (pushnew 3 l :test #'=) (setq m (pop l)) (list l m)))

;;; 195
(answer 195 (list (mapcar (constantly -100000000000000000000) nil) (mapcar #'+ (revappend (nreconc (copy-list '(3 1 2)) (copy-list '(5 -5 5))) (nbutlast (copy-list '(1 2 3 4 5)) 3)) nil) (maplist #'length (append (ldiff '(5 -5 5) nil) '(5 -5 5)))))

;;; 196
(answer 196 (let ((sum nil)) (list (mapc (lambda (x) (push x sum)) '(1 2 3 4 5)) (mapl (lambda (x) (push (length x) sum)) '(3 1 2)) sum)))

;;; 197
(answer 197 (list (mapcan #'list '(3 1 2) '(1 2 3 4 5)) (mapcon #'list (reverse (nreverse (copy-list '(5 -5 5)))))))

;;; 198
(answer 198 (list (every #'plusp (nsubstitute-if 1000003 (lambda (x) (> x 2)) (copy-list '(5 -5 5)))) (some #'plusp (remove-duplicates #(1 2 3))) (notevery #'evenp (copy-seq (substitute (logxor -100000000000000000000 1000003 -7) (logxor 255 12 1) (stable-sort (vector 4 3 2 1) #'> :key #'identity)))) (notany #'oddp (copy-seq (delete-duplicates (list 3 1 2) :key (lambda (x) (* x x)))))))

;;; 199
(answer 199 (list (every #'< (list (isqrt (abs 4611686018427387903)) 4611686018427387903 255) #()) (some (lambda (x y) (and (> x y) (list x y))) #(3 1 2 1) (cons (numerator -7/3) '(3 1 2)))))

;;; 200
(answer 200 (list (map 'list #'1+ (substitute-if-not (mod 4611686018427387903 3) #'evenp (delete-if #'plusp (list 1 2 2 1)) :count 1)) (map 'vector #'+ (delete-if #'oddp (copy-seq #())) (remove-if #'evenp (remove (denominator 22/7) (nsubstitute -100000000000000000000 1 (vector 4 3 2 1))))) (map nil #'identity (remove-duplicates '(1 2 3 4 5) :from-end t)) (map 'string #'char-upcase "xyzzy")))

;;; 201
(answer 201 (list (map-into (copy-seq #(3 1 2 1)) #'abs (substitute-if (- (lognot 12) -100000000000000000000) (lambda (x) (> x 2)) (substitute-if-not (integer-length 12) #'evenp (delete-if-not (lambda (x) (> x 2)) (vector 4 3 2 1)) :count 1))) (map-into (list 3 1 2) #'+ (remove-if #'oddp (fill (vector 4 3 2 1) (lcm 0 1))) (reverse (remove-if #'plusp (delete-if #'evenp (list 1 2 2 1)))))))

;;; 202
(answer 202 (list (reduce #'+ (nsubstitute-if (logior (gcd 1000003 4611686018427387903) (mod 0 1)) #'plusp (copy-list nil))) (reduce #'list (nsubstitute-if-not (logxor 1000003 (isqrt (abs (gcd))) 1) (lambda (x) (> x 2)) (copy-list nil)) :initial-value (loop initially (princ 'start) for c across (format nil "~w|~a ~:a ~:s" (case 'a (a 1) ((foo nil) 2) (t 3)) nil nil nil) do (when (char= c #\b) (loop-finish)) (princ c) finally (princ 'end))) (reduce #'list (butlast (list* 255 (last '(5 -5 5) 5))) :from-end t) (reduce #'+ (substitute (dpb (+ (gcd) -7) (byte 7 1) (logior 1 4611686018427387903)) (signum (1+ (gcd))) nil) :key (constantly (logand 1000003 (lcm -7 4611686018427387903))))))

;;; 203
(answer 203 (reduce #'- (copy-seq (stable-sort (list 3 1 2) #'> :key (complement #'zerop))) :from-end t :initial-value 0 :start 0))

;;; 204
(answer 204 (list (find (- -7 (- -100000000000000000000 1)) (remove (denominator -7/3) (delete (denominator 1/2) (vector 4 3 2 1)))) (find (rem -100000000000000000000 7) (remove-duplicates (fill (vector 4 3 2 1) (dpb 12 (byte 3 3) 12)) :from-end t) :test #'=) (find -7 (substitute-if-not (ash (ash 1000003 (- 2)) 5) #'oddp (reverse (nsubstitute 255 1 (vector 4 3 2 1))) :count 1) :key (constantly 12) :from-end t)))

;;; 205
(answer 205 (list (find-if #'evenp #()) (find-if-not #'plusp (sort (copy-seq #(3 1 2 1)) #'<)) (find-if (lambda (x) (> x 2)) (stable-sort (list 3 1 2) #'< :key (constantly (gcd))) :from-end t)))

;;; 206
(answer 206 (list (position (logcount (numerator 255)) (remove (gcd) #(3 1 2 1))) (position-if #'oddp (nsubstitute-if-not 1000003 (lambda (x) (> x 2)) (vector 4 3 2 1))) (position-if-not #'evenp (delete-if-not #'plusp (list 3 1 2))) (position 1 '(1 2 1 3) :from-end t :end 1)))

;;; 207
(answer 207 (list (count (ldb (byte 7 3) 255) (remove-if (lambda (x) (> x 2)) (copy-seq (nsubstitute-if 1 #'oddp (vector 4 3 2 1))))) (count-if #'oddp (remove-duplicates (remove-if-not #'evenp (substitute-if 4611686018427387903 #'oddp (delete-if (lambda (x) (> x 2)) (list 1 2 2 1)))) :from-end t)) (count-if-not #'evenp (delete (logand (1- -7) (abs 0)) (list 1 2 2 1))) (count 1 '(1 2 1 3 1) :start 1)))

;;; 208
(answer 208 (remove (mod 1000003 1) (delete-if-not (lambda (x) (> x 2)) (copy-list '(1 2 3 4 5)))))

;;; 209
(answer 209 (remove-if #'plusp (remove-duplicates (substitute-if-not (* 0 1) #'evenp (substitute-if 0 #'plusp (fill (vector 4 3 2 1) (gcd))) :count 1))))

;;; 210
(answer 210 (remove-if-not #'plusp (nsubstitute (gcd (- -100000000000000000000 0) (logcount 12)) 1 (list 3 1 2))))

;;; 211
(answer 211 (remove (lcm (1+ 1000003) (integer-length (logand 4611686018427387903 -100000000000000000000))) (substitute 4611686018427387903 12 (nsubstitute (gcd) 1 (list 3 1 2))) :count 1 :from-end t))

;;; 212
(answer 212 (remove-if (lambda (x) (> x 2)) '(1 2 3 4 5 6) :start 1 :end 5 :count 5))

;;; 213
(answer 213 (delete 1 (copy-seq #(1 2 3))))

;;; 214
(answer 214 (delete-if #'oddp (copy-list (nbutlast (list 1 2 2 1) 5))))

;;; 215
(answer 215 (delete-if-not (lambda (x) (> x 2)) (copy-seq #(3 1 2 1))))

;;; 216
(answer 216 (remove-duplicates (reverse (sort (list 1 2 2 1) #'>))))

;;; 217
(answer 217 (remove-duplicates '(1 2 3 4 5) :from-end t))

;;; 218
(answer 218 (delete-duplicates (copy-seq #()) :key (constantly (mod -100000000000000000000 2))))

;;; 219
(answer 219 (substitute 255 -7 #(1 2 3)))

;;; 220
(answer 220 (substitute-if 12 #'evenp (ldiff nil nil)))

;;; 221
(answer 221 (substitute-if-not (lognot (isqrt (abs (rem 4611686018427387903 2)))) #'plusp (delete-duplicates (copy-seq #(3 1 2 1)) :key (lambda (x) (* x x))) :count 1))

;;; 222
(answer 222 (nsubstitute (ash (dpb -7 (byte 1 2) (gcd)) (- 1)) 1 (vector 4 3 2 1)))

;;; 223
(answer 223 (nsubstitute-if (logior (* (integer-length 255) (- -7 1000003)) (logand -7 (isqrt (abs 255)))) #'oddp (copy-seq #(1 2 3))))

;;; 224
(answer 224 (nsubstitute-if-not (denominator (- (* 22/7 -7/3) (+ -7/3 1/2 1/2))) #'plusp (list 3 1 2)))

;;; 225
(answer 225 (reverse (sort (copy-list '(1 2 3 4 5)) #'>)))

;;; 226
(answer 226 (copy-seq (stable-sort (list 1 2 2 1) #'> :key (constantly (ash 1 0)))))

;;; 227
(answer 227 (sort (copy-list '(5 -5 5)) #'>))

;;; 228
(answer 228 (stable-sort (vector 4 3 2 1) #'< :key #'identity))

;;; 229
(answer 229 (stable-sort (list '(1 . a) '(0 . b) '(1 . c) '(0 . d)) #'< :key #'car))

;;; 230
(answer 230 (list (merge 'list (list 1 3 5) (list 2 3 4) #'<) (merge 'vector (vector 1 4) (list 2 3) #'<)))

;;; 231
(answer 231 (fill (copy-list '(3 1 2)) (lognot (numerator 22/7))))

;;; 232
(answer 232 (fill (list 1 2 3 4 5 6) (list (consp (let ((p (list :a 1 :b 2))) (list (remf p :a) p (setf (getf p :n) (logxor -100000000000000000000 255 12)) (incf (getf p :m 10)) p))) (atom (let ((x (multiple-value-list (with-simple-restart (cl:abort "Leave.") (cl:abort)))) (y (list (multiple-value-list (decode-universal-time 3600000000 0)) (encode-universal-time 5 4 3 2 1 2001 0)))) (let* ((x y) (z x)) (list x y z)))) (listp (handler-case (destructuring-bind (a b) (butlast '(5 -5 5)) (list a b)) (error () 'mismatch))) (null (let ((x (loop for x across #(3 1 2) sum x into s count (oddp x) into c maximize x into m finally (return (list s c m)))) (y (multiple-value-list (multiple-value-prog1 (values (list (< most-positive-fixnum (expt 2 62)) (> most-negative-fixnum (- (expt 2 63)))) 2) (let ((n 0)) (let ((inc (lambda () (incf n))) (get (lambda () n))) (funcall inc) (funcall inc) (funcall get))))))) (let* ((x y) (z x)) (list x y z)))) (endp '(3 1 2)) (not (list (cl:signal 'condition) (typep (make-condition 'simple-warning) 'warning) (handler-case (cl:signal 'simple-condition) (condition () 'got))))) :start 1 :end 1))

;;; 233
(answer 233 (replace (list 1 2 3 4) (sort (copy-seq #()) #'<) :start1 1))

;;; 234
(answer 234 (list (search '(1 2) (nsubstitute-if 1000003 #'evenp (copy-list '(1 2 3 4 5)))) (search (delete-duplicates (vector 4 3 2 1) :key (constantly (1+ 0))) '(3 1 2)) (mismatch (copy-list (last '(1 2 3 4 5) 0)) (remove (denominator (* -7/3 22/7)) (fill (list 1 2 2 1) -100000000000000000000))) (mismatch (cons (gcd) (reverse (make-list 5 :initial-element 1))) #(1 2 3) :test #'=)))

;;; 235
(answer 235 (list (concatenate 'list (remove-duplicates (remove-duplicates (delete-duplicates (vector 4 3 2 1) :key #'abs))) (reverse (delete (mod 1 7) (list 3 1 2)))) (concatenate 'vector (remove-if-not (lambda (x) (> x 2)) (remove-if #'oddp (remove-if #'plusp (nsubstitute 12 1 (vector 4 3 2 1))))) #(1 2 3))))

;;; 236
(answer 236 (list (coerce (delete -7 (copy-list nil)) 'list) (coerce (stable-sort (copy-seq #(3 1 2 1)) #'> :key (complement #'zerop)) 'vector) (coerce '(#\a #\b) 'string) (coerce "c" 'character) (coerce 0.0 'double-float)))

;;; 237
(answer 237 (list (make-sequence 'list 2 :initial-element (let ((h (make-hash-table :test 'equalp)) (l nil)) (setf (gethash "a" h) 1 (gethash (list (svref #(1 2 3 4 5 6) 3) (aref #(3 1 2 1) 1)) h) 2 (gethash "A" h) 3) (maphash (lambda (k v) (push (list k v) l)) h) (list (reverse l) (hash-table-test h) (hash-table-p h) (hash-table-p (read-char (make-string-input-stream "")))))) (make-sequence 'string 2 :initial-element (char-downcase (char-downcase #\Z))) (make-sequence 'vector 1 :initial-element 0)))

;;; 238
(answer 238 (subseq (nsubstitute-if-not (ash (+ 4611686018427387903 -100000000000000000000) 2) #'oddp (copy-seq #(1 2 3))) 5))

;;; 239
(answer 239 (elt (delete-if #'oddp (copy-seq #())) 3))

;;; 240
(answer 240 (let ((s (list 1 2 3 4))) (setf (subseq s 1 3) (nsubstitute-if-not 1000003 (lambda (x) (> x 2)) (list 1 2 2 1))) s))

;;; 241
(answer 241 (length (list (< (abs (- pi 3.141592653589793)) 1.0e-15))))

;;; 242
(answer 242 (let ((a (make-array '(2 3) :initial-contents '((1 2 3) (4 5 6))))) (list (aref a 1 2) (array-rank a) (array-dimension a 1) (array-dimensions a) (array-total-size a) (row-major-aref a 4) (array-row-major-index a 1 1) (array-in-bounds-p a 2 0) (setf (aref a 0 0) (do* ((i 0 (+ i 2)) (j i (+ i 1))) ((> i 5) (list i j)) (when (= i 4) (return 'early)))) a)))

;;; 243
(answer 243 (let ((v (make-array 7 :initial-element (do ((i 0 (1+ i)) (l nil (cons i l))) ((= i 2) l)) :adjustable t :fill-pointer 0))) (list (vector-push (progn (case nil (a 1) ((foo nil) 2) (t 3)) (string< "abc" "xabd" :start2 1)) v) (vector-push-extend (let (a b) (setf (values a b) (values (let ((a (make-array '(2 3) :initial-contents '((1 2 3) (4 5 6))))) (list (aref a 1 2) (array-rank a) (array-dimension a 1) (array-dimensions a) (array-total-size a) (row-major-aref a 4) (array-row-major-index a 1 1) (array-in-bounds-p a 2 0) (setf (aref a 0 0) (with-input-from-string (s "one two (3 4) x") (list (read s) (read-char s) (peek-char nil s) (unread-char (read-char s) s) (read-line s) (read-line s nil 'eof) (read s nil 'end)))) a)) (let ((s 0)) (dolist (x (copy-list nil) (list s x)) (incf s x))))) (list a b)) v) (vector-push-extend 0 v) (fill-pointer v) (vector-pop v) v (array-has-fill-pointer-p v) (adjustable-array-p v))))

;;; 244
(answer 244 (let ((v (make-array 5 :initial-contents '(1 2 3 4 5) :fill-pointer 3))) (setf (fill-pointer v) 0) (list v (length v) (array-total-size v) (aref v 4) (reverse v))))

;;; 245
(answer 245 (let ((a (make-array 3 :initial-element 0 :adjustable t))) (list (adjust-array a 5 :initial-element (abs (gcd))) (array-element-type (vector 1)) (upgraded-array-element-type t))))

;;; 246
(answer 246 (list (svref #(1 2 3 4 5 6) 5) (aref #(3 1 2 1) 1)))

;;; 247
(answer 247 (let ((v (copy-seq #(1 2 3)))) (setf (svref (vector 1 2) 0) 5) (if (> (length v) 0) (setf (aref v 0) (typecase (list (every #'< '(3 1 2) #()) (some (lambda (x y) (and (> x y) (list x y))) #(1 2 3) (nreconc (list 3 1 2) (list 1 2 2 1)))) (integer 'integer) (symbol 'symbol) (string 'string) (list 'list) (float 'float) (t 'other)))) (list v (arrayp (multiple-value-bind (v c) (ignore-errors (error 'simple-error :format-control "x ~a" :format-arguments '(1))) (list v (simple-condition-format-control c) (simple-condition-format-arguments c)))) (vectorp (list (char-equal (code-char (+ 65 2)) #\a) (char-not-equal (char-upcase (code-char (+ 65 3))) (char-downcase #\-)) (char-lessp #\5 #\Z) (char-greaterp (char-downcase (code-char (+ 65 0))) #\5) (char-not-greaterp (char-upcase (code-char (+ 65 2))) (char-downcase (char-upcase #\a))) (char-not-lessp (char-upcase (char-upcase #\Space)) #\Z))) (simple-vector-p (sqrt 2.0)))))

;;; 248
(answer 248 (multiple-value-list (array-displacement (make-array 3 :initial-element (list (multiple-value-list (floor -7 (dpb 1000003 (byte 3 3) (rem 12 2)))) (multiple-value-list (truncate (gcd) 255)))))))

;;; 249
(answer 249 (let ((a (make-array 6 :initial-contents '(1 2 3 4 5 6)))) (make-array '(2 2) :displaced-to a :displaced-index-offset 1)))

;;; 250
(answer 250 (list (< 1000 array-dimension-limit) (< 7 array-rank-limit) (< 1000 array-total-size-limit) (bit (make-array 4 :element-type 'bit :initial-element 1) 2) (sbit (make-array 4 :element-type 'bit :initial-element 0) 1)))

;;; 251
(answer 251 (let ((h (make-hash-table))) (setf (gethash 1 h) (loop initially (princ 'start) for c across "abc" do (when (char= c #\b) (loop-finish)) (princ c) finally (princ 'end)) (gethash 'k h) 5) (incf (gethash 'n h 10)) (list (gethash 'k h) (multiple-value-list (gethash 'zz h (unless nil (let ((h (make-hash-table)) (l nil)) (setf (gethash 1 h) 'a (gethash 2 h) 'b) (with-hash-table-iterator (next h) (loop (multiple-value-bind (more k v) (next) (if more (push (cons k v) l) (return))))) (reverse l)) (loop for i from 1 to 0 append (list i i))))) (hash-table-count h) (remhash 'k h) (remhash 'k h) (hash-table-count h))))

;;; 252
(answer 252 (let ((h (make-hash-table :test 'eq)) (l nil)) (setf (gethash "a" h) 1 (gethash (let (a b) (multiple-value-setq (a b) (floor 0 1)) (list a b)) h) 2 (gethash "A" h) 3) (maphash (lambda (k v) (push (list k v) l)) h) (list (reverse l) (hash-table-test h) (hash-table-p h) (hash-table-p (list least-positive-normalized-single-float least-positive-normalized-short-float least-positive-normalized-long-float least-negative-normalized-single-float least-negative-normalized-short-float least-negative-normalized-long-float)))))

;;; 253
(answer 253 (let ((h (make-hash-table))) (dolist (x '(5 -5 5)) (incf (gethash x h 0))) (list (loop for k being the hash-keys of h collect k) (loop for v being the hash-values of h using (hash-key k) collect (cons k v)) (progn (clrhash h) (hash-table-count h)))))

;;; 254
(answer 254 (let ((h (make-hash-table)) (l nil)) (setf (gethash 1 h) 'a (gethash 2 h) 'b) (with-hash-table-iterator (next h) (loop (multiple-value-bind (more k v) (next) (if more (push (cons k v) l) (return))))) (reverse l)))

;;; 255
(answer 255 (let ((h (make-hash-table))) (list (integerp (hash-table-size h)) (realp (hash-table-rehash-size h)) (realp (hash-table-rehash-threshold h)) (= (sxhash "ab") (sxhash (copy-seq "ab"))))))

;;; 256
(answer 256 (list (eq 'foo ':key) (eql (load-time-value (list 1 2)) (list (multiple-value-list (floor -7/3)) (multiple-value-list (round (* 4611686018427387903 (- 22/7 22/7)))) (multiple-value-list (ceiling 1/2)) (multiple-value-list (truncate 22/7)))) (equal (macrolet ((m (&whole w x) (list 'quote (list w x)))) (m (list (nth-value 1 (floor 1 3)) (multiple-value-list (values-list '(3 1 2)))))) (funcall (lambda (&key a ((:other o) (or t (list (reduce #'+ '(5 -5 5)) (reduce #'list (remove-duplicates (remove-if-not (lambda (x) (> x 2)) (remove-if-not #'plusp (remove-duplicates (reverse (delete-if #'oddp (vector 4 3 2 1)))))) :from-end t) :initial-value (list (streamp *standard-output*) (streamp *standard-input*) (streamp *error-output*) (streamp *trace-output*) (streamp *terminal-io*) (streamp *query-io*) (streamp *debug-io*) *print-base* *read-base* *read-default-float-format* (consp *features*))) (reduce #'list '(1 2 3 4 5) :from-end t) (reduce #'+ (fill (list 3 1 2) 0) :key #'-)))) &allow-other-keys) (list a o)) :a 1 :b 2)) (equalp (eval-when (:execute :load-toplevel :compile-toplevel) (length (multiple-value-list (get-setf-expansion '(car x))))) (list most-positive-single-float most-positive-short-float most-positive-long-float most-negative-single-float most-negative-short-float most-negative-long-float))))

;;; 257
(answer 257 (list (equal '(5 -5 5) (revappend (nbutlast (list 1 2 2 1) 5) nil)) (equalp (format nil "~a") (string-upcase (format nil "~d|~5d|~5,'0d|~:d|~@d|~b|~o|~x|~3r" (1- (ash (gcd) (- 3))) (logior (logcount 1000003) (+ 12 -7)) 2 -100000000000000000000 4611686018427387903 255 (lcm 255 (gcd 1000003 1)) (abs -7) -100000000000000000000))) (equalp 1 1.0) (equalp #(3 1 2 1) (vector 4 3 2 1))))

;;; 258
(answer 258 (list (typep (let (a b) (multiple-value-setq (a b) (floor 0 2)) (list a b)) 'integer) (typep (let ((sum nil)) (list (mapc (lambda (x) (push x sum)) (butlast '(1 2 3 4 5))) (mapl (lambda (x) (push (length x) sum)) (cons (gcd) (reverse nil))) sum)) '(or symbol string)) (typep (1- (logxor (ldb (byte 7 0) 255) 12 (numerator 1/2))) '(integer 0 255)) (typep (let ((n 0)) (let ((inc (lambda () (incf n))) (get (lambda () n))) (funcall inc) (funcall inc) (funcall get))) '(member a foo 1)) (typep (list (scale-float 1.5 0) (float-radix -2.25) (float-sign -2.25) (float-sign 0.0 2.0) (float-digits 1.5) (float-precision 1.0e10)) '(and atom (not null))) (typep (unless (< call-arguments-limit 50) (list (< 20 lambda-parameters-limit) (< 19 multiple-values-limit) (if (member '&rest lambda-list-keywords) t))) 'sequence) (typep 0 '(satisfies evenp))))

;;; 259
(answer 259 (typecase (mapcar (let ((k 4611686018427387903)) (lambda (x) (+ x k))) (list (signum -100000000000000000000) (* 4611686018427387903 0) 0)) (integer 'integer) (symbol 'symbol) (string 'string) (list 'list) (float 'float) (t 'other)))

;;; 260
(answer 260 (etypecase (progn (pprint (list* (ash -7 5) '(3 1 2))) 'pretty) (number 'number) (symbol 'symbol)))

;;; 261
(deftype small261 (&optional (n 10)) (list 'integer 0 n))
(answer 261 (list (typep 4611686018427387903 'small261) (typep (isqrt (abs (abs (1- 12)))) '(small261 300))))

;;; 262
(answer 262 (let ((x 12)) (check-type x integer) x))

;;; 263
(answer 263 (list (multiple-value-list (subtypep 'fixnum 'rational)) (multiple-value-list (subtypep '(integer 0 1) '(integer 0 2)))))

;;; 264
(answer 264 (the integer 4611686018427387903))

;;; 265
(answer 265 (if t (list (multiple-value-list (ffloor 1.0e10 2.0)) (multiple-value-list (fceiling 0.1)) (multiple-value-list (ftruncate -2.25)) (multiple-value-list (fround 0.1))) (list (string-equal (let ((*print-length* 2) (*print-level* 1)) (prin1-to-string '(1 (2 (3)) 4 5))) (format nil "~[zero~;one~:;many~]|~:[no~;yes~]|~@[x=~a~]" 2 (list (evenp 1) (oddp -7) (zerop (+)) (plusp (+)) (minusp (*))) 'foo)) (string-not-equal "xyzzy" (let ((*print-circle* nil) (*print-readably* nil) (*print-pretty* nil)) (write-to-string '(a (b . c) (d (e)))))) (string-lessp (format nil "~a|~s|~10a|~10@a|~va" (multiple-value-list (with-simple-restart (cl:abort "Leave.") (cl:abort))) (list (cl:signal 'condition) (typep (make-condition 'simple-warning) 'warning) (handler-case (cl:signal 'simple-condition) (condition () 'got))) nil nil 0 'v) (format nil "~(~a~)|~:(~a~)|~@(~a~)|~:@(~a~)" (format nil "~c|~:c|~@c|~?|~%~&~~|~|" #\- #\Space #\a "~a-~a" (list (let ((x 5)) (handler-bind ((error (lambda (c) (declare (ignore c)) (invoke-restart 'store-value 12)))) (ccase x (1 'one) (12 'twelve) (255 'byte) ((0 -7 3) 'other)))) (do* ((i 0 (+ i 2)) (j i (+ i 1))) ((> i 5) (list i j)) (when (= i 4) (return 'early))))) "abc" "Hello World" (string-left-trim '(#\a #\H) "Hello World"))) (string-greaterp (format nil "~r|~:r|~@r" 1 3 1) (prin1-to-string (*))) (string-not-greaterp (let ((*print-length* 2) (*print-level* 1)) (prin1-to-string '(1 (2 (3)) 4 5))) "xyzzy") (string-not-lessp (let ((*print-length* 2) (*print-level* 1)) (prin1-to-string '(1 (2 (3)) 4 5))) (format nil "~10<~a~>|~10:<~a~>|~10@<~a~>|~12<~a~;~a~;~a~>" ':key 'foo 'a 'a 'b 'c)))))

;;; 266
(answer 266 (and (apply #'+ (* 1 (denominator 1/2)) (ldiff (nconc (list 1 2 2 1) (list 3 1 2)) nil)) nil (list (merge 'list (list 1 3 5) (list 2 3 4) #'<) (merge 'vector (vector 1 4) (list 2 3) #'<))))

;;; 267
(answer 267 (or (list (numberp (list (rassoc (ldb (byte 3 2) (gcd)) '((a . 1) nil (c . 3))) (rassoc-if #'evenp '((a . 1) (b . 4))) (rassoc-if-not #'oddp '((a . 1) (b . 4))))) (realp (let ((v (make-array 5 :initial-contents '(1 2 3 4 5) :fill-pointer 3))) (setf (fill-pointer v) 3) (list v (length v) (array-total-size v) (aref v 4) (reverse v)))) (rationalp (+)) (integerp (rem (+) -3)) (floatp (/ (rationalize (sqrt 2.0)) (*))) (complexp (/ (*)))) (list (sublis '((a . 1) (b . 2)) '(a (b . c) (d (e)))) (nsublis '((a . z)) (copy-tree '((1 . 2) 3))))))

;;; 268
(answer 268 (cond (t (list (mapcar #'1+ (last '(3 1 2) 1)) (mapcar #'+ (nconc (list 1 2 2 1) (list 3 1 2)) (copy-list (rest '(3 1 2)))) (maplist #'length '(1 2 3 4 5)))) ((list (alpha-char-p #\Z) (alphanumericp (char-upcase (code-char (+ 65 5)))) (graphic-char-p (char-downcase (char-upcase #\-))) (upper-case-p #\a) (lower-case-p #\a) (both-case-p #\5) (characterp (progv '(*p268*) (list (if nil (with-input-from-string (s "one two (3 4) x") (list (read s) (read-char s) (peek-char nil s) (unread-char (read-char s) s) (read-line s) (read-line s nil 'eof) (read s nil 'end))) (symbol-value 'unbound-thing268))) (symbol-value '*p268*))) (standard-char-p #\5))) (t (pairlis '(a b c) (list (progv '(*p268*) (list (list single-float-epsilon short-float-epsilon long-float-epsilon single-float-negative-epsilon short-float-negative-epsilon long-float-negative-epsilon)) (symbol-value '*p268*)) (let ((l nil)) (tagbody (go two) one (push 1 l) (go end) two (push 2 l) (go one) end) l) (multiple-value-list (multiple-value-prog1 (values (catch 'k (list (throw 'k (let ((x 5)) (handler-bind ((error (lambda (c) (declare (ignore c)) (invoke-restart 'store-value 12)))) (ccase x (1 'one) (12 'twelve) (255 'byte) ((0 -7 3) 'other))))) (multiple-value-list (with-simple-restart (r "Leave.") (invoke-restart (find-restart 'r)))))) 2) (car '(3 1 2)))))))))

;;; 269
(answer 269 (when t (elt (substitute-if (mod (gcd) 2) (lambda (x) (> x 2)) (copy-seq (substitute-if-not -100000000000000000000 #'evenp (sort (vector 4 3 2 1) #'<) :count 1))) 0)))

;;; 270
(answer 270 (unless (list (evenp (gcd 255 (integer-length 1000003))) (oddp (rem (numerator 1/2) 2)) (zerop (- 22/7 -7/3)) (plusp (mod (+) -3)) (minusp (/ (logcount 4611686018427387903) 7))) (mapcar (let ((k (logxor (ash 0 (- 0)) (gcd) 12))) (lambda (x) (+ x k))) (make-list 2 :initial-element 1000003)) (let ((x 'a)) (handler-bind ((error (lambda (c) (declare (ignore c)) (invoke-restart 'store-value 7)))) (ctypecase x (integer (list 'integer x)))))))

;;; 271
(answer 271 (case (dpb (1+ 255) (byte 7 3) (- -7 1000003)) ((0 1) 'low) (255 'byte) (otherwise (destructuring-bind (a (b &optional (c nil)) &rest d &key k) '(1 (2) :k 3) (list a b c d k)))))

;;; 272
(answer 272 (case ':key (a 1) ((foo nil) 2) (t 3)))

;;; 273
(answer 273 (ecase (signum 1) (1 'one) (12 'twelve)))

;;; 274
(answer 274 (let ((x (stable-sort (list '(1 . a) '(0 . b) '(1 . c) '(0 . d)) #'< :key #'car)) (y (let ((n 0)) (loop (when (> (incf n) 1) (return n)))))) (let* ((x y) (z x)) (list x y z))))

;;; 275
(answer 275 (let ((x 1) (y 2)) (psetq x y y x) (psetf x (+ x y) y x) (list x y)))

;;; 276
(answer 276 (let ((x (list 1 2 3)) (y (list (first (append (revappend '(5 -5 5) '(5 -5 5)) (nthcdr 1 nil))) (second (nthcdr 5 '(3 1 2))) (third (rest '(5 -5 5))) (fourth (nreverse (copy-list nil))) (fifth '(1 2 3 4 5))))) (rotatef (first x) (third x) y) (shiftf (second x) y (length (handler-case (read-from-string "(1 2") (end-of-file (c) (streamp (stream-error-stream c)))))) (list x y)))

;;; 277
(answer 277 (let ((n (logand (lcm (lognot 255) (gcd -100000000000000000000 -7)) (isqrt (abs 12))))) (list (incf n) (decf n (mod (logxor (logand 1000003 1) (1+ 4611686018427387903) 0) 7)) (incf n (* (* (- 1/2 -7/3) -7/3) (+ -100000000000000000000 -7/3 22/7))) n)))

;;; 278
(answer 278 (let ((v (vector 1 2 3)) (i 0)) (incf (aref v (incf i)) (numerator 22/7)) (decf (aref v i)) (list v i)))

;;; 279
(answer 279 (prog1 (let ((l nil)) (list (catch 'k (unwind-protect (throw 'k (logcount (gcd))) (push (let ((n 0)) (let ((inc (lambda () (incf n))) (get (lambda () n))) (funcall inc) (funcall inc) (funcall get))) l))) l)) (macrolet ((m (&whole w x) (list 'quote (list w x)))) (m (let ((s (list 1 2 3 4))) (setf (subseq s 1 3) (nsubstitute -7 1 (vector 4 3 2 1))) s)))))

;;; 280
(answer 280 (prog2 (loop for i from 1 to 5 append (list i i)) (list (every (lambda (x) (> x 2)) (remove (ash 0 (- 5)) (nsubstitute-if (gcd) #'oddp (list 3 1 2)))) (some #'plusp (delete-if-not #'plusp (vector 4 3 2 1))) (notevery #'evenp (delete-duplicates (list 3 1 2) :key #'abs)) (notany #'plusp (delete-if-not #'evenp (vector 4 3 2 1)))) (list (mapcan #'list (rest (ldiff '(5 -5 5) nil)) (revappend '(1 2 3 4 5) nil)) (mapcon #'list (last (nreconc (list 1 2 2 1) (list 3 1 2)) 5)))))

;;; 281
(answer 281 (progn (handler-bind ((error (lambda (c) (declare (ignore c)) (use-value (do* ((i 0 (+ i 2)) (j i (+ i 1))) ((> i 5) (list i j)) (when (= i 4) (return 'early))))))) (restart-case (error "x") (use-value (v) (list 'used v)) (store-value (v) v))) (read-char (make-string-input-stream ""))))

;;; 282
(answer 282 (block b282 (list 1 (return-from b282 (loop named outer for i from 0 do (loop for j to 3 do (when (> (+ i j) 0) (return-from outer (list i j)))))))))

;;; 283
(answer 283 (let ((l nil)) (tagbody (go two) one (push 1 l) (go end) two (push 2 l) (go one) end) l))

;;; 284
(answer 284 (catch 'k (list (throw 'k (cdr '((1 . 2) 3))) (list (< (abs (- pi 3.141592653589793)) 1.0e-15)))))

;;; 285
(answer 285 (let ((l nil)) (list (catch 'k (unwind-protect (throw 'k (integer-length (* (signum 4611686018427387903) 1))) (push (list (apply #'union (list (last (reverse nil) 1) '(3 1 2))) (intersection (make-list 0 :initial-element 255) (list -100000000000000000000 (lognot 0) (abs (gcd)))) (set-difference (list* (lcm -7 -100000000000000000000) '(1 2 3 4 5)) (append (list* 255 nil) (cons 1000003 '(3 1 2)))) (set-exclusive-or '(1 2 3 4 5) (nreverse (list 3 1 2))) (subsetp (list* 12 (last '(1 2 3 4 5) 1)) '(3 1 2))) l))) l)))

;;; 286
(answer 286 (prog ((x -100000000000000000000)) (setq x (list x x)) (return x)))

;;; 287
(answer 287 (prog* ((x (dpb 4611686018427387903 (byte 2 2) (- (ash 0 2) (denominator 22/7)))) (y (list x))) (return (list x y))))

;;; 288
(answer 288 (do ((i 0 (1+ i)) (l nil (cons i l))) ((= i 3) l)))

;;; 289
(answer 289 (do* ((i 0 (+ i 2)) (j i (+ i 1))) ((> i 5) (list i j)) (when (= i 4) (return 'early))))

;;; 290
(answer 290 (let ((l nil)) (dotimes (i 5 (list i l)) (push i l))))

;;; 291
(answer 291 (let ((s 0)) (dolist (x (nconc (copy-list '(5 -5 5)) (copy-list (list 1 (gcd) -7))) (list s x)) (incf s x))))

;;; 292
(answer 292 (multiple-value-list (values (list (eq (intern "FOO") 'foo) (multiple-value-list (find-symbol "CAR" "COMMON-LISP")) (packagep *package*) (package-name (find-package "KEYWORD")) (package-name (symbol-package 'car))) (with-output-to-string (s) (write-string (nstring-upcase (copy-seq "")) s) (write-char #\Space s) (terpri s) (prin1 (prog ((x (* 12 1))) (setq x (list x x)) (return x)) s) (princ (let ((v (vector 4 3 2 1))) (setf (svref (vector 1 2) 0) 5) (if (> (length v) 0) (setf (aref v 0) (list (let ((s (make-random-state t))) (random-state-p s)) (random-state-p *random-state*) (< -1 (random 10) 10) (< (random 1.0) 1.0)))) (list v (arrayp (list single-float-epsilon short-float-epsilon long-float-epsilon single-float-negative-epsilon short-float-negative-epsilon long-float-negative-epsilon)) (vectorp (with-open-stream (s (make-string-input-stream "1 2")) (list (read s) (read s) (read s nil :eof)))) (simple-vector-p (let* ((a (make-random-state t)) (b (make-random-state a))) (equal (list (random 1000 a) (random 1000 a)) (list (random 1000 b) (random 1000 b))))))) s) (print (parse-integer "1x2") s) (fresh-line s) (write-line (format nil "~{~a~^, ~}|~:{<~a ~a>~}|~@{~a~}" (cons 1000003 '(3 1 2)) '((1 2) (3 4)) (prog1 (with-input-from-string (s "one two (3 4) x") (list (read s) (read-char s) (peek-char nil s) (unread-char (read-char s) s) (read-line s) (read-line s nil 'eof) (read s nil 'end))) (= least-positive-single-float least-positive-short-float least-positive-long-float (- least-negative-single-float) (- least-negative-short-float) (- least-negative-long-float))) (list (char-code #\Z) (char-int #\5) (char-name #\Newline) (name-char "space") (digit-char 2) (digit-char 11 16) (digit-char-p #\-) (digit-char-p #\f 16))) s) (write (list (typep (multiple-value-list (parse-integer "42")) 'integer) (typep (length (multiple-value-list (get-setf-expansion '(car x)))) '(or symbol string)) (typep (rem 12 3) '(integer 0 255)) (typep (locally (declare (optimize speed)) (let ((s (make-string-input-stream "ab cd"))) (list (read-preserving-whitespace s) (read-char-no-hang s) (peek-char t s) (listen s) (input-stream-p s) (output-stream-p s) (streamp s) (open-stream-p s) (close s)))) '(member a foo 1)) (typep (let ((n 0)) (loop (when (> (incf n) 1) (return n)))) '(and atom (not null))) (typep (list (symbolp (let ((s (gensym "Q"))) (list (symbolp s) (boundp s) (fboundp s) (char (symbol-name s) 0) (symbol-plist s)))) (keywordp nil) (symbol-name 'foo) (eq 'a 'foo) (symbol-package ':k)) 'sequence) (typep (1- 255) '(satisfies evenp))) :stream s)))))

;;; 293
(answer 293 (multiple-value-bind (a b c) (values (list (cl:signal 'condition) (typep (make-condition 'simple-warning) 'warning) (handler-case (cl:signal 'simple-condition) (condition () 'got))) (list (logandc1 1 (+ 255 (signum -7))) (logandc2 (ldb (byte 2 0) (ldb (byte 3 3) 0)) 4611686018427387903) (logeqv (+ (logior 4611686018427387903 -100000000000000000000) (ash 1000003 2)) (dpb 4611686018427387903 (byte 1 3) (logxor -100000000000000000000 -100000000000000000000 12))) (lognand (- (gcd) (logcount 1)) 1000003))) (list a b c)))

;;; 294
(answer 294 (multiple-value-call #'list (let ((h (make-hash-table))) (setf (gethash (rem (denominator -7/3) 7) h) (let ((h (make-hash-table)) (l nil)) (setf (gethash 1 h) 'a (gethash 2 h) 'b) (with-hash-table-iterator (next h) (loop (multiple-value-bind (more k v) (next) (if more (push (cons k v) l) (return))))) (reverse l)) (gethash 'k h) 5) (incf (gethash 'n h 10)) (list (gethash 'k h) (multiple-value-list (gethash 'zz h (multiple-value-call #'list (etypecase (list least-positive-normalized-double-float least-negative-normalized-double-float) (number 'number) (symbol 'symbol)) (values (with-output-to-string (s) (write-string (let ((*print-array* nil) (*print-gensym* nil)) (write-to-string (make-symbol "X"))) s) (write-char #\a s) (terpri s) (prin1 (list (parse-integer "ff" :radix 16) (parse-integer " 12 x" :junk-allowed t) (parse-integer "a12b" :start 1 :end 3)) s) (princ (let ((x 5)) (handler-bind ((error (lambda (c) (declare (ignore c)) (invoke-restart 'store-value 12)))) (ccase x (1 'one) (12 'twelve) (255 'byte) ((0 -7 3) 'other)))) s) (print (let ((h (make-hash-table))) (list (integerp (hash-table-size h)) (realp (hash-table-rehash-size h)) (realp (hash-table-rehash-threshold h)) (= (sxhash "ab") (sxhash (copy-seq "ab"))))) s) (fresh-line s) (write-line (format nil "~a") s) (write (loop for x across #(3 1 2) sum x into s count (oddp x) into c maximize x into m finally (return (list s c m))) :stream s)) (loop for x in nil for i from 0 collect (list i x))) (values)))) (hash-table-count h) (remhash 'k h) (remhash 'k h) (hash-table-count h))) (values (let ((s (copy-symbol 'foo)) (u (gentemp))) (list (symbol-name s) (eq s 'foo) (symbolp u) (integerp *gensym-counter*))) (symbol-value 'unbound-thing294)) (values)))

;;; 295
(answer 295 (multiple-value-list (multiple-value-prog1 (values (progn (print (the integer 0)) (prin1 (case (numerator 1/2) ((0 1) 'low) (255 'byte) (otherwise (handler-bind ((error #'continue)) (cerror "Go on." "bad ~a" 1) 'continued)))) (princ (multiple-value-list (array-displacement (make-array 2 :initial-element (list (multiple-value-list (decode-universal-time 3600000000 0)) (encode-universal-time 5 4 3 2 1 2001 0)))))) (terpri) (write-line "x") (fresh-line) (format t "~a~%" (let ((a (make-array 3 :initial-element 0 :adjustable t))) (list (adjust-array a 5 :initial-element (+ -7 12)) (array-element-type (vector 1)) (upgraded-array-element-type t)))) 'printed) 2) (multiple-value-bind (a b c) (values (let ((x 'a)) (handler-bind ((error (lambda (c) (declare (ignore c)) (invoke-restart 'store-value 7)))) (ctypecase x (integer (list 'integer x))))) (loop with a = (gcd) and b = (remove-if (lambda (x) (> x 2)) '(1 2 3 4 5 6) :start 1 :end 5 :count 1) repeat 5 collect a collect b)) (list a b c)))))

;;; 296
(answer 296 (let (a b) (multiple-value-setq (a b) (floor (ash 255 (- 1)) 1)) (list a b)))

;;; 297
(answer 297 (list (nth-value 1 (floor 4611686018427387903 3)) (multiple-value-list (values-list nil))))

;;; 298
(answer 298 (let (a b) (setf (values a b) (values (restart-bind ((r (lambda (x) (list 'bound x)))) (list (restart-name (first (compute-restarts))) (invoke-restart 'r (list (equal (revappend '(1 2 3 4 5) '(5 -5 5)) (nreverse (list 1 2 2 1))) (equalp (princ-to-string (list (merge 'list (list 1 3 5) (list 2 3 4) #'<) (merge 'vector (vector 1 4) (list 2 3) #'<))) (string-upcase (nstring-downcase (copy-seq "ABC") :end 2))) (equalp 1 1.0) (equalp #() (copy-seq #(1 2 3))))))) (list (position (gcd (logand -100000000000000000000 255) 1) (copy-seq (substitute -7 0 #(3 1 2 1)))) (position-if #'oddp (remove-duplicates (delete 1000003 (list 3 1 2)))) (position-if-not #'plusp (remove-duplicates (delete-if-not #'evenp (list 1 2 2 1)) :from-end t)) (position 1 '(1 2 1 3) :from-end t :end 2)))) (list a b)))

;;; 299
(answer 299 (destructuring-bind (a (b &optional (c (string< "abc" "xabd" :start2 1))) &rest d &key k) '(1 (2) :k 3) (list a b c d k)))

;;; 300
(answer 300 (handler-case (destructuring-bind (a b) (rest '(1 2 3 4 5)) (list a b)) (error () 'mismatch)))

;;; 301
(answer 301 (progv '(*p301*) (list (fill (list 1 2 3 4 5 6) (let ((spec (byte 1 0))) (list (byte-size spec) (byte-position spec) (ldb-test spec 4611686018427387903) (mask-field spec (isqrt (abs 12))) (deposit-field (* (gcd) -7) spec (logior 12 0)))) :start 1 :end 3)) (symbol-value '*p301*)))

;;; 302
(answer 302 (locally (declare (optimize speed)) (list (multiple-value-list (truncate (* (gcd) (+)) 3)) (multiple-value-list (round (*) 7)))))

;;; 303
(answer 303 (quote (multiple-value-list (values (loop with a = (logior -100000000000000000000 1) and b = (error (let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) (11) . 12) ((13) . 14) 15 16))) (list (caaaar x) (caaadr x) (caadar x) (caaddr x) (cadaar x) (cadadr x) (caddar x) (cadddr x)))) repeat 0 collect a collect b) (handler-case (error "text ~a" (list (count 1000003 (remove-duplicates (substitute-if 1000003 #'evenp (substitute-if 255 (lambda (x) (> x 2)) (fill (vector 4 3 2 1) 12))) :from-end t)) (count-if #'plusp (remove-if #'oddp (remove 1 (stable-sort (vector 4 3 2 1) #'> :key #'1+)))) (count-if-not #'oddp (substitute -7 (gcd) (delete-duplicates (list 3 1 2) :key #'identity))) (count 1 '(1 2 1 3 1) :start 3))) (error (c) (princ-to-string c)))))))

;;; 304
(answer 304 (eval-when (:execute :load-toplevel :compile-toplevel) (multiple-value-bind (v c) (ignore-errors (error 'simple-error :format-control "x ~a" :format-arguments '(1))) (list v (simple-condition-format-control c) (simple-condition-format-arguments c)))))

;;; 305
(answer 305 (load-time-value (list 1 2)))

;;; 306
(answer 306 (let ((x (code-char (+ 65 2)))) (declare (ignorable x) (type t x)) (symbol-macrolet ((y (list x))) y)))

;;; 307
(answer 307 (funcall (constantly (signum 4611686018427387903)) (+ 255 (isqrt (abs (* -100000000000000000000 255))))))

;;; 308
(answer 308 (apply #'+ 12 (make-list 0 :initial-element (abs 255))))

;;; 309
(answer 309 (apply #'list (list (acons ':key (list (sinh 1.0) (cosh 1.0) (tanh -0.25) (asinh 1.0) (acosh 1.5) (atanh 0.25)) '((a . 1) (b . 2))) (pairlis '(c a) '(1 2 3) '((a . 1) (b . 2)))) (nthcdr 5 (append '(5 -5 5) '(5 -5 5)))))

;;; 310
(answer 310 (flet ((f (x) (list 'f x)) (g (&rest r) r)) (f (g (list (sort (nunion (list 1 2 2 1) (copy-list '(5 -5 5))) #'<) (nintersection (copy-list (list 1 (gcd) -100000000000000000000)) (copy-list (nreconc (list 3 1 2) (list 1 2 2 1)))) (nset-difference (copy-list (nreconc (list 1 2 2 1) (list 3 1 2))) (copy-list (nconc (list 3 1 2) (list 1 2 2 1)))) (sort (nset-exclusive-or (copy-list '(1 2 3 4 5)) (copy-list (ldiff '(3 1 2) nil))) #'<)) (list most-positive-double-float (< -1.0e-300 least-negative-double-float 0 least-positive-double-float 1.0e-300) most-negative-double-float double-float-epsilon double-float-negative-epsilon)))))

;;; 311
(answer 311 (labels ((f (n) (if (< n 1) nil (cons n (f (- n 1)))))) (f 2)))

;;; 312
(answer 312 ((lambda (a &optional (b (with-open-stream (s (make-string-input-stream "1 2")) (list (read s) (read s) (read s nil :eof))) b-p) &rest r &key (k (let ((n 0)) (list (incf n) (decf n (lognot 0)) (incf n (+ (+ -7/3 1/2 22/7) 22/7 (* -7/3 1/2))) n))) &aux (z (list a b))) (list b-p r k z)) 1 2 :k 3))

;;; 313
(answer 313 (funcall (lambda (&key a ((:other o) (list (make-sequence 'list 2 :initial-element (multiple-value-list (integer-decode-float 0.1))) (make-sequence 'string 2 :initial-element (code-char (+ 65 1))) (make-sequence 'vector 5 :initial-element 0))) &allow-other-keys) (list a o)) :a 1 :b 2))

;;; 314
(answer 314 (funcall (lambda (a b) (list a b)) (list (sin 0.5) (cos 0.5) (tan 0.5) (asin -0.25) (acos -0.25) (atan 1.5) (atan 1 -1))))

;;; 315
(answer 315 (let ((n 0)) (let ((inc (lambda () (incf n))) (get (lambda () n))) (funcall inc) (funcall inc) (funcall get))))

;;; 316
(answer 316 (mapcar (let ((k 4611686018427387903)) (lambda (x) (+ x k))) (nreverse (copy-list (nthcdr 3 nil)))))

;;; 317
(answer 317 (list (identity (list (streamp *standard-output*) (streamp *standard-input*) (streamp *error-output*) (streamp *trace-output*) (streamp *terminal-io*) (streamp *query-io*) (streamp *debug-io*) *print-base* *read-base* *read-default-float-format* (consp *features*))) (funcall (constantly (list (coerce (copy-seq (sort (vector 4 3 2 1) #'<)) 'list) (coerce (nsubstitute-if -7 #'evenp (list 3 1 2)) 'vector) (coerce '(#\a #\b) 'string) (coerce "c" 'character) (coerce 1.0e10 'double-float))) 1 2) (funcall (complement (lambda (x) (> x 2))) 1000003)))

;;; 318
(defun f318 (x &optional (y (ash (lognot -7) 3))) "Doc." (list x y))
(answer 318 (list (f318 (handler-case (cl:assert (= 1 (dpb 4611686018427387903 (byte 7 1) (integer-length -100000000000000000000)))) (error () 'assertion))) (if (fboundp 'f318) t) (funcall 'f318 1 2) (funcall (fdefinition 'f318) 3) (documentation 'f318 'function)))

;;; 319
(defmacro m319 (a &body b) `(list ,a ,@b))
(answer 319 (list (m319 (logior 12 (logand 255 (abs 0))) (let ((x 1) (y 2)) (psetq x y y x) (psetf x (+ x y) y x) (list x y)) (let ((a (make-array 6 :initial-contents '(1 2 3 4 5 6)))) (make-array '(2 2) :displaced-to a :displaced-index-offset 1))) (macroexpand-1 '(m319 1 2)) (macroexpand '(m319 3)) (functionp (macro-function 'm319))))

;;; 320
(answer 320 (macrolet ((m (&whole w x) (list 'quote (list w x)))) (m (stable-sort (list '(1 . a) '(0 . b) '(1 . c) '(0 . d)) #'< :key #'car))))

;;; 321
(defmacro w321 (&whole w x &environment e) (declare (ignore e x)) `',w)
(answer 321 (w321 (let ((v (vector 1 2 3)) (i 0)) (incf (aref v (incf i)) (numerator (- -7/3 1/2))) (decf (aref v i)) (list v i))))

;;; 322
(defvar *v322* (signum (ldb (byte 1 2) 1000003)) "A variable.")
(defparameter *w322* -7)
(defconstant c322 5)
(answer 322 (let ((*v322* 1)) (list *v322* *w322* c322 (documentation '*v322* 'variable) (boundp '*v322*))))

;;; 323
(define-modify-macro add323 (&rest r) + "Adds.")
(answer 323 (let ((x 12)) (add323 x 1 2) x))

;;; 324
(defun second324 (l) (nth 1 l))
(defsetf second324 (l) (new) `(setf (nth 1 ,l) ,new))
(answer 324 (let ((l (list 1 2 3))) (setf (second324 l) (let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) (11) . 12) ((13) . 14) 15 16))) (list (caaaar x) (caaadr x) (caadar x) (caaddr x) (cadaar x) (cadadr x) (caddar x) (cadddr x)))) l))

;;; 325
(defun put325 (l v) (setf (car l) v))
(defun get325 (l) (car l))
(defsetf get325 put325)
(answer 325 (let ((l (list 1 2))) (setf (get325 l) (loop for (a . b) in '((a . 1) nil (c . 3)) when a collect (list a b) else collect 'none)) (list l (get325 l))))

;;; 326
(defun (setf top326) (v l) (setf (car l) v))
(answer 326 (let ((l (list 1 2))) (setf (top326 l) (list (eq 'a ':key) (eql (list (assoc 'foo '((a . 1) (b . 2))) (assoc 'b '((a . 1) nil (c . 3)) :test #'eq) (assoc-if #'symbolp '((a . 1) nil (c . 3))) (assoc-if-not #'symbolp '((a . 1) (2 . 3)))) '(3 1 2)) (equal (let ((x 'a)) (handler-bind ((error (lambda (c) (declare (ignore c)) (invoke-restart 'store-value 7)))) (ctypecase x (integer (list 'integer x))))) (list (search '(1 2) (nsubstitute-if-not -100000000000000000000 #'evenp (vector 4 3 2 1))) (search '(3 1 2) '(3 1 2)) (mismatch (nsubstitute 1 1 (list 1 2 2 1)) #()) (mismatch (butlast '(1 2 3 4 5)) #(3 1 2 1) :test #'=))) (equalp (let ((a (make-array 6 :initial-contents '(1 2 3 4 5 6)))) (make-array '(2 2) :displaced-to a :displaced-index-offset 1)) (list (copy-tree '(a (b . c) (d (e)))) (copy-alist '((a . 1) (b . 2))) (tree-equal '(a (b . c) (d (e))) '(a (b . c) (d (e)))) (tree-equal '(a (b . c) (d (e))) '((1 . 2) 3) :test #'equal))))) (push 5 (cdr l)) l))

;;; 327
(define-setf-expander tail327 (l) (let ((v (gensym)) (s (gensym))) (values (list v) (list l) (list s) `(progn (setf (cdr ,v) ,s) ,s) `(cdr ,v))))
(defun tail327 (l) (cdr l))
(answer 327 (let ((l (list 1 2))) (setf (tail327 l) nil) l))

;;; 328
(answer 328 (length (multiple-value-list (get-setf-expansion '(car x)))))

;;; 329
(declaim (special *d329*))
(proclaim '(special *e329*))
(setq *d329* (let ((*trace-output* (make-string-output-stream))) (time (apply #'union (list (append '(5 -5 5) nil) (butlast '(3 1 2)) :test #'eql)))))
(answer 329 (list *d329* (eval '(let ((*e329* 2)) (symbol-value '*e329*)))))

;;; 330
(define-symbol-macro s330 (list 1 (loop for (a . b) in '((a . 1) nil (c . 3)) when a collect (list a b) else collect 'none)))
(answer 330 s330)

;;; 331
(answer 331 (list (eval '(+ 1 (rem (gcd (lcm 4611686018427387903 0) (1+ 1000003)) 2))) (eval (ldb (byte 3 1) (denominator 22/7))) (eval ''a) (funcall (compile nil '(lambda (x) (* x 2))) (gcd))))

;;; 332
(answer 332 (unless (< call-arguments-limit 50) (list (< 20 lambda-parameters-limit) (< 19 multiple-values-limit) (if (member '&rest lambda-list-keywords) t))))

;;; 333
(defgeneric g333 (x))
(defmethod g333 (x) (list 'any x))
(defmethod g333 ((x number)) (list 'number (call-next-method)))
(defmethod g333 ((x (eql 1))) (list 'one (next-method-p)))
(answer 333 (list (g333 (loop for x in (copy-list (copy-list '(1 2 3 4 5))) for i from 0 collect (list i x))) (g333 1) (g333 0.0)))

;;; 334
(defstruct s334 (a (- (mod (ash -7 (- 0)) 7) 0)) (b nil))
(answer 334 (let ((s (make-s334 :b (list (find (1- -100000000000000000000) (remove-if-not #'evenp (substitute-if-not 1000003 #'plusp (substitute 1000003 255 (delete-if #'plusp (vector 4 3 2 1))) :count 1))) (find (denominator (- -7/3 1/2)) #() :test #'<) (find (isqrt (abs (ash (gcd) 3))) (substitute-if-not (gcd) (lambda (x) (> x 2)) (reverse (nsubstitute-if 1 (lambda (x) (> x 2)) (list 3 1 2))) :count 1) :key (constantly (mod 12 2)) :from-end t))))) (setf (s334-a s) (loop named outer for i from 0 do (loop for j to 3 do (when (> (+ i j) 5) (return-from outer (list i j)))))) (list s (s334-p s) (s334-p 5) (s334-b s) (equalp s (copy-s334 s)) (typep s 's334) (copy-structure s))))

;;; 335
(defstruct (p335 (:constructor new335 (x &optional (y 1)))) x y)
(defstruct (q335 (:include p335 (x 5)) (:conc-name qq-)) z)
(answer 335 (let ((q (make-q335 :z (let ((n -7)) (setf (ldb (byte 3 2) n) (ldb (byte 1 5) (lcm (gcd) 1000003))) (setf (mask-field (byte 2 0) n) 255) n)))) (list (new335 (list (identity #(1 2 3)) (funcall (constantly (list (eval '(+ 1 (abs 1))) (eval 255) (eval ''a) (funcall (compile nil '(lambda (x) (* x 2))) (dpb -100000000000000000000 (byte 3 1) 4611686018427387903)))) 1 2) (funcall (complement #'oddp) (lognot (gcd 255 1))))) q (qq-x q) (p335-x q) (p335-p q))))

;;; 336
(defstruct (l336 (:type list) :named) a b)
(answer 336 (list (make-l336 :a 1 :b (funcall (lambda (a b) (list a b)) (multiple-value-list (with-simple-restart (cl:abort "Leave.") (cl:abort))))) (l336-a (make-l336 :a (list (character 'x) (character "y") (character #\Space) (< 1000 char-code-limit)))) (l336-p '(1))))

;;; 337
(defstruct r337 (a 1 :read-only t) (b 2 :type integer))
(answer 337 (r337-a (list (streamp *standard-output*) (streamp *standard-input*) (streamp *error-output*) (streamp *trace-output*) (streamp *terminal-io*) (streamp *query-io*) (streamp *debug-io*) *print-base* *read-base* *read-default-float-format* (consp *features*))))

;;; 338
(defstruct (pp338 (:print-function (lambda (o s d) (declare (ignore d)) (format s "<~a>" (pp338-a o))))) a)
(answer 338 (prin1-to-string (make-pp338 :a (ecase (logcount (* (gcd) -100000000000000000000)) (1 'one) (12 'twelve)))))

;;; 339
(defstruct po339 a)
(defmethod print-object ((o po339) s) (print-unreadable-object (o s) (format s "po ~a" (po339-a o))))
(answer 339 (format nil "~a" (make-po339 :a (let ((l nil)) (handler-case (handler-bind ((error (lambda (c) (declare (ignore c)) (push 'bound l)))) (error "x")) (error () (push (apply #'list (handler-case (unbound-function339 (multiple-value-list (with-simple-restart (r "Leave.") (invoke-restart (find-restart 'r))))) (undefined-function (c) (cell-error-name c))) (reverse '(1 2 3 4 5))) l))) l))))

;;; 340
(answer 340 (handler-case (error "text ~a" (restart-bind ((r (lambda (x) (list 'bound x)))) (list (restart-name (first (compute-restarts))) (invoke-restart 'r (list least-positive-normalized-single-float least-positive-normalized-short-float least-positive-normalized-long-float least-negative-normalized-single-float least-negative-normalized-short-float least-negative-normalized-long-float))))) (error (c) (princ-to-string c))))

;;; 341
(answer 341 (handler-case (error 'type-error :datum (block b341 (list 1 (return-from b341 (list (stringp (list (integerp (get-universal-time)) (integerp (get-internal-real-time)) (integerp (get-internal-run-time)) (integerp internal-time-units-per-second) (length (multiple-value-list (get-decoded-time))) (stringp (lisp-implementation-type)) (stringp (lisp-implementation-version)) (progn (sleep 0) 1))) (simple-string-p (format nil "~(~a~)|~:(~a~)|~@(~a~)|~:@(~a~)" "a-b c" "a-b c" (format nil "a~10tb~5@tc~%~2,4td" ) (let ((*print-case* :downcase) (*print-escape* nil)) (write-to-string '(Foo "x" |Bar|))))) (length "xyzzy") (position (char-downcase #\Z) (format nil "~a")) (search (format nil "~a ~*~a|~2:*~a" 1 2 (let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) (11) . 12) ((13) . 14) 15 16))) (list (cdaaar x) (cdaadr x) (cdadar x) (cdaddr x) (cddaar x) (cddadr x) (cdddar x) (cddddr x))) 4) (concatenate 'string (let ((*print-case* :downcase) (*print-escape* nil)) (write-to-string '(Foo "x" |Bar|))) (format nil "a~10tb~5@tc~%~2,4td" ) "Hello World")) (mismatch (write-to-string (+) :base 8) (string-right-trim "dcy" (let ((*print-case* :downcase) (*print-escape* nil)) (write-to-string '(Foo "x" |Bar|))))))))) :expected-type 'list) (type-error (c) (list (type-error-datum c) (type-error-expected-type c)))))

;;; 342
(answer 342 (handler-case (car (flet ((f (x) (list 'f x)) (g (&rest r) r)) (f (g (list (map-into (copy-seq #()) (constantly 1000003) (remove-if (lambda (x) (> x 2)) #(1 2 3))) (map-into (copy-list nil) #'+ (substitute-if 12 #'plusp (fill (vector 4 3 2 1) 12)) (substitute 4611686018427387903 -7 (remove-duplicates (nsubstitute 4611686018427387903 1 (list 1 2 2 1)) :from-end t)))) (prog2 (list (integerp (get-universal-time)) (integerp (get-internal-real-time)) (integerp (get-internal-run-time)) (integerp internal-time-units-per-second) (length (multiple-value-list (get-decoded-time))) (stringp (lisp-implementation-type)) (stringp (lisp-implementation-version)) (progn (sleep 0) 1)) (multiple-value-list (with-simple-restart (r "Leave.") (invoke-restart (find-restart 'r)))) (let ((x 1) (y 2)) (psetq x y y x) (psetf x (+ x y) y x) (list x y))))))) (type-error () 'type-error) (:no-error (x) (list x))))

;;; 343
(answer 343 (handler-case (/ 0 0) (arithmetic-error (c) (list (arithmetic-error-operation c) (arithmetic-error-operands c)))))

;;; 344
(answer 344 (multiple-value-bind (v c) (ignore-errors (error 'simple-error :format-control "x ~a" :format-arguments '(1))) (list v (simple-condition-format-control c) (simple-condition-format-arguments c))))

;;; 345
(answer 345 (let ((l nil)) (handler-case (handler-bind ((error (lambda (c) (declare (ignore c)) (push 'bound l)))) (error "x")) (error () (push (remove -7 (remove (ash 0 (- 0)) (nsubstitute-if-not 12 #'oddp (vector 4 3 2 1))) :count 1 :from-end t) l))) l))

;;; 346
(answer 346 (restart-case (invoke-restart 'r (list (read-from-string "\\ab") (multiple-value-list (read-from-string "a b" t nil :start 1)))) (r (x) (list 'r x))))

;;; 347
(answer 347 (handler-bind ((error (lambda (c) (declare (ignore c)) (use-value (restart-case (invoke-restart 'r (handler-case (symbol-value 'nothing347) (unbound-variable (c) (cell-error-name c)))) (r (x) (list 'r x))))))) (restart-case (error "x") (use-value (v) (list 'used v)) (store-value (v) v))))

;;; 348
(answer 348 (handler-bind ((error (lambda (c) (declare (ignore c)) (store-value (list (< most-positive-fixnum (expt 2 62)) (> most-negative-fixnum (- (expt 2 63)))))))) (restart-case (error "x") (store-value (v) (list 'stored v)))))

;;; 349
(answer 349 (handler-bind ((error #'continue)) (cerror "Go on." "bad ~a" 1) 'continued))

;;; 350
(answer 350 (multiple-value-list (with-simple-restart (r "Leave.") (invoke-restart (find-restart 'r)))))

;;; 351
(answer 351 (multiple-value-list (with-simple-restart (cl:abort "Leave.") (cl:abort))))

;;; 352
(answer 352 (handler-bind ((warning #'muffle-warning)) (warn "w ~a" (handler-bind ((error (lambda (c) (declare (ignore c)) (store-value (funcall (lambda (x) (* x x)) -7))))) (restart-case (error "x") (store-value (v) (list 'stored v))))) 'warned))

;;; 353
(answer 353 (restart-bind ((r (lambda (x) (list 'bound x)))) (list (restart-name (first (compute-restarts))) (invoke-restart 'r (let ((v (make-array 7 :initial-element (list (loop for x in (nbutlast (list 3 1 2) 3) always (numberp x)) (loop for x in (copy-list nil) never (eql x 2)) (loop for x in (butlast '(5 -5 5)) thereis (and (> x 2) x))) :adjustable t :fill-pointer 0))) (list (vector-push (list (map 'list (complement #'zerop) (stable-sort (list 1 2 2 1) #'< :key (complement #'zerop))) (map 'vector #'+ (delete-duplicates (vector 4 3 2 1) :key (complement #'zerop)) (remove-if-not #'oddp (delete -100000000000000000000 (list 1 2 2 1)))) (map nil #'identity (remove-duplicates (copy-seq (sort (list 3 1 2) #'>)))) (map 'string #'char-upcase (format nil "~r|~:r|~@r" 0 2 1))) v) (vector-push-extend (let ((s (make-string-output-stream))) (format s "~a" (let ((l '(1 2 3 4 5 6 7 8 9 10 11))) (list (sixth l) (seventh l) (eighth l) (ninth l) (tenth l)))) (finish-output s) (force-output s) (clear-output s) (list (get-output-stream-string s) (get-output-stream-string s))) v) (vector-push-extend 255 v) (fill-pointer v) (vector-pop v) v (array-has-fill-pointer-p v) (adjustable-array-p v)))))))

;;; 354
(define-condition c354 (error) ((a :initarg :a :initform 5 :reader c354-a)) (:report (lambda (c s) (format s "c ~a" (c354-a c)))))
(answer 354 (handler-case (error 'c354 :a (replace (list 1 2 3 4) (reverse (substitute -100000000000000000000 (gcd) (copy-seq (remove-duplicates (delete-if #'plusp (list 3 1 2)) :from-end t)))) :start1 1)) (c354 (c) (list (c354-a c) (princ-to-string c)))))

;;; 355
(answer 355 (list (cl:signal 'condition) (typep (make-condition 'simple-warning) 'warning) (handler-case (cl:signal 'simple-condition) (condition () 'got))))

;;; 356
(answer 356 (handler-case (cl:assert (= 1 (lcm (gcd) (logxor (rem 4611686018427387903 3) 255 1000003)))) (error () 'assertion)))

;;; 357
(answer 357 (let ((x 5)) (handler-bind ((error (lambda (c) (declare (ignore c)) (invoke-restart 'store-value 12)))) (ccase x (1 'one) (12 'twelve) (255 'byte) ((0 -7 3) 'other)))))

;;; 358
(answer 358 (let ((x 'a)) (handler-bind ((error (lambda (c) (declare (ignore c)) (invoke-restart 'store-value 7)))) (ctypecase x (integer (list 'integer x))))))

;;; 359
(answer 359 (handler-case (unbound-function359 (let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) 11 . 12) (13 . 14) 15 16))) (list (caar x) (cadr x) (cdar x) (cddr x) (caaar x) (caadr x) (cadar x) (caddr x) (cdaar x) (cdadr x) (cddar x) (cdddr x)))) (undefined-function (c) (cell-error-name c))))

;;; 360
(answer 360 (handler-case (read-from-string "(1 2") (end-of-file (c) (streamp (stream-error-stream c)))))

;;; 361
(answer 361 (error (subseq (nsubstitute (logand 0 1000003) 1 (vector 4 3 2 1)) 0)))

;;; 362
(answer 362 (loop for x in (ldiff (last nil 1) nil) for i from 0 collect (list i x)))

;;; 363
(answer 363 (loop for x across #(3 1 2) sum x into s count (oddp x) into c maximize x into m finally (return (list s c m))))

;;; 364
(answer 364 (loop for i from 1 to 3 append (list i i)))

;;; 365
(answer 365 (loop for i downfrom 5 to 2 by 2 collect i))

;;; 366
(answer 366 (loop for (a . b) in '((a . 1) nil (c . 3)) when a collect (list a b) else collect 'none))

;;; 367
(answer 367 (loop for x on '(3 1 2) by #'cddr nconc (list (length x))))

;;; 368
(answer 368 (loop with a = 0 and b = (list (nth-value 1 (floor 4611686018427387903 7)) (multiple-value-list (values-list (list 1 12 -100000000000000000000)))) repeat 2 collect a collect b))

;;; 369
(answer 369 (loop for x = 1 then (* x 2) while (< x 50) until (> x 3) collect x))

;;; 370
(answer 370 (list (loop for x in '(5 -5 5) always (numberp x)) (loop for x in (revappend (reverse (nreverse (list 1 2 2 1))) (nreconc (copy-list nil) (copy-list '(3 1 2)))) never (eql x 2)) (loop for x in '(1 2 3 4 5) thereis (and (> x 2) x))))

;;; 371
(answer 371 (loop named outer for i from 0 do (loop for j to 3 do (when (> (+ i j) 5) (return-from outer (list i j))))))

;;; 372
(answer 372 (loop for x in (cons 1 '(1 2 3 4 5)) if (evenp x) sum x into e and collect x into l else minimize x into m end finally (return (list e l m))))

;;; 373
(answer 373 (loop initially (princ 'start) for c across (make-string 0 :initial-element #\5) do (when (char= c #\b) (loop-finish)) (princ c) finally (princ 'end)))

;;; 374
(answer 374 (let ((n 0)) (loop (when (> (incf n) 5) (return n)))))

;;; 375
(answer 375 (with-output-to-string (s) (write-string (format nil (formatter "~a+~a") (list most-positive-single-float most-positive-short-float most-positive-long-float most-negative-single-float most-negative-short-float most-negative-long-float) (list (sin 1.0) (cos 1.0) (tan -0.25) (asin 0.5) (acos 1.0) (atan 3.0e-5) (atan 1 -1))) s) (write-char (char-upcase (code-char (+ 65 5))) s) (terpri s) (prin1 (list (< 1000 array-dimension-limit) (< 7 array-rank-limit) (< 1000 array-total-size-limit) (bit (make-array 4 :element-type 'bit :initial-element 1) 2) (sbit (make-array 4 :element-type 'bit :initial-element 0) 1)) s) (princ (list (find (logior (+ 0 12) 1000003) (remove (mod 1 1) (stable-sort (list 1 2 2 1) #'> :key #'1+))) (find -100000000000000000000 (remove-duplicates (fill (vector 4 3 2 1) 12)) :test #'=) (find (logcount (1- 1)) (make-list 0 :initial-element (gcd)) :key (constantly (signum 1000003)) :from-end t)) s) (print (list (adjoin -7 (nbutlast (list 1 2 2 1) 1)) (adjoin (1- 255) (cons (1+ 255) (make-list 3 :initial-element 4611686018427387903)) :key #'identity) (tailp nil (butlast (rest '(5 -5 5))))) s) (fresh-line s) (write-line (nstring-downcase (copy-seq "ABC") :end 2) s) (write (read-char (make-string-input-stream "")) :stream s)))

;;; 376
(answer 376 (with-input-from-string (s "one two (3 4) x") (list (read s) (read-char s) (peek-char nil s) (unread-char (read-char s) s) (read-line s) (read-line s nil 'eof) (read s nil 'end))))

;;; 377
(answer 377 (let ((s (make-string-input-stream "ab cd"))) (list (read-preserving-whitespace s) (read-char-no-hang s) (peek-char t s) (listen s) (input-stream-p s) (output-stream-p s) (streamp s) (open-stream-p s) (close s))))

;;; 378
(answer 378 (let ((s (make-string-output-stream))) (format s "~a" (quote (char-downcase #\Space))) (finish-output s) (force-output s) (clear-output s) (list (get-output-stream-string s) (get-output-stream-string s))))

;;; 379
(answer 379 (list (read-from-string "1.5d0") (multiple-value-list (read-from-string "a b" t nil :start 1))))

;;; 380
(answer 380 (progn (print (list least-positive-normalized-double-float least-negative-normalized-double-float)) (prin1 (apply #'list (restart-case (invoke-restart 'r (let ((x 1) (y 2)) (psetq x y y x) (psetf x (+ x y) y x) (list x y))) (r (x) (list 'r x))) '(5 -5 5))) (princ (load-time-value (list 1 2))) (terpri) (write-line "x") (fresh-line) (format t "~a~%" (let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) (11) . 12) ((13) . 14) 15 16))) (list (caaaar x) (caaadr x) (caadar x) (caaddr x) (cadaar x) (cadadr x) (caddar x) (cadddr x)))) 'printed))

;;; 381
(answer 381 (with-open-stream (s (make-string-input-stream "1 2")) (list (read s) (read s) (read s nil :eof))))

;;; 382
(answer 382 (read-char (make-string-input-stream "")))

;;; 383
(answer 383 (list (streamp *standard-output*) (streamp *standard-input*) (streamp *error-output*) (streamp *trace-output*) (streamp *terminal-io*) (streamp *query-io*) (streamp *debug-io*) *print-base* *read-base* *read-default-float-format* (consp *features*)))

;;; 384
(answer 384 (format nil "~a|~s|~10a|~10@a|~va" (let ((p (list :a 1 :b 2))) (list (remf p :a) p (setf (getf p :n) (logxor (integer-length 4611686018427387903) (gcd 12 1000003) (+ 4611686018427387903 1))) (incf (getf p :m 10)) p)) (let ((s (copy-symbol 'foo)) (u (gentemp))) (list (symbol-name s) (eq s 'foo) (symbolp u) (integerp *gensym-counter*))) 'a nil 5 'v))

;;; 385
(answer 385 (format nil "~d|~5d|~5,'0d|~:d|~@d|~b|~o|~x|~3r" (isqrt (abs (logand (lognot -100000000000000000000) -7))) -7 3 (* (ash (abs 1) 1) (logior (ldb (byte 1 2) 0) (rem (gcd) 2))) (signum (numerator 22/7)) (- (dpb (- 255 0) (byte 3 2) (ash 255 (- 2))) -100000000000000000000) (integer-length (integer-length 1000003)) (logcount (1- 4611686018427387903)) 0))

;;; 386
(answer 386 (format nil "~f|~,2f|~8,3f|~e|~,3e|~$|~g" -0.25 1.0 1.0 0.5 0.5 -0.25 1.0))

;;; 387
(answer 387 (format nil "~r|~:r|~@r" 3 2 7))

;;; 388
(answer 388 (format nil "~{~a~^, ~}|~:{<~a ~a>~}|~@{~a~}" nil '((1 2) (3 4)) (let ((v (make-array 5 :initial-contents '(1 2 3 4 5) :fill-pointer 3))) (setf (fill-pointer v) 1) (list v (length v) (array-total-size v) (aref v 4) (reverse v))) (list (map 'list #'abs (nsubstitute-if-not (numerator -7/3) #'oddp (list 1 2 2 1))) (map 'vector #'+ (reverse (nsubstitute-if (gcd) #'evenp (list 3 1 2))) (delete-if #'evenp (vector 4 3 2 1))) (map nil #'identity (reverse '(1 2 3 4 5))) (map 'string #'char-upcase (nstring-capitalize (copy-seq "xyzzy"))))))

;;; 389
(answer 389 (format nil "~[zero~;one~:;many~]|~:[no~;yes~]|~@[x=~a~]" 0 (= (*) (*) (- (- (+)))) 'a))

;;; 390
(answer 390 (format nil "~(~a~)|~:(~a~)|~@(~a~)|~:@(~a~)" (format nil "~#[none~;one ~a~:;several~]" (stable-sort (list '(1 . a) '(0 . b) '(1 . c) '(0 . d)) #'< :key #'car)) (write-to-string (list (eq (intern "FOO") 'foo) (multiple-value-list (find-symbol "CAR" "COMMON-LISP")) (packagep *package*) (package-name (find-package "KEYWORD")) (package-name (symbol-package 'car))) :escape nil) (reverse (format nil "~w|~a ~:a ~:s" (destructuring-bind (a (b &optional (c (list single-float-epsilon short-float-epsilon long-float-epsilon single-float-negative-epsilon short-float-negative-epsilon long-float-negative-epsilon))) &rest d &key k) '(1 (2) :k 3) (list a b c d k)) nil nil nil)) (string-left-trim '(#\a #\H) (reverse (format nil "~c|~:c|~@c|~?|~%~&~~|~|" #\5 #\a #\Space "~a-~a" (list (handler-case (symbol-value 'nothing390) (unbound-variable (c) (cell-error-name c))) (length (multiple-value-list (get-setf-expansion '(car x))))))))))

;;; 391
(answer 391 (format nil "~a ~*~a|~2:*~a" 1 2 (fill (list 1 2 3 4 5 6) (list (identity #()) (funcall (constantly (list (multiple-value-list (truncate (+) 2)) (multiple-value-list (round (*) 3)))) 1 2) (funcall (complement (lambda (x) (> x 2))) (1+ 1000003))) :start 1 :end 1) 4))

;;; 392
(answer 392 (format nil "~d item~:p|~d cit~:@p|~p" 1 0 3))

;;; 393
(answer 393 (format nil "~c|~:c|~@c|~?|~%~&~~|~|" (char-upcase #\a) (code-char (+ 65 5)) #\- "~a-~a" (list (car (list (numerator 1/2) (gcd) (1+ 255))) (let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) (11) . 12) ((13) . 14) 15 16))) (list (cdaaar x) (cdaadr x) (cdadar x) (cdaddr x) (cddaar x) (cddadr x) (cdddar x) (cddddr x))))))

;;; 394
(answer 394 (format nil "a~10tb~5@tc~%~2,4td" ))

;;; 395
(answer 395 (format nil "~10<~a~>|~10:<~a~>|~10@<~a~>|~12<~a~;~a~;~a~>" 'foo ':key 'a 'a 'b 'c))

;;; 396
(answer 396 (format nil "~w|~a ~:a ~:s" (list (logandc1 (logcount (gcd -7 0)) (ash (integer-length -7) (- 5))) (logandc2 (signum (logand (gcd) 12)) (dpb (1+ 1) (byte 7 5) (ash 12 1))) (logeqv -100000000000000000000 (logior 1 (1- -100000000000000000000))) (lognand 0 12)) nil nil nil))

;;; 397
(answer 397 (format nil (formatter "~a+~a") (let ((s (gensym "Q"))) (list (symbolp s) (boundp s) (fboundp s) (char (symbol-name s) 0) (symbol-plist s))) (prog ((x 1000003)) (setq x (list x x)) (return x))))

;;; 398
(answer 398 (format nil "~#[none~;one ~a~:;several~]" (symbol-value 'unbound-thing398)))

;;; 399
(answer 399 (format nil "~a"))

;;; 400
(answer 400 (list (multiple-value-list (decode-universal-time 3600000000 0)) (encode-universal-time 5 4 3 2 1 2001 0)))

;;; 401
(answer 401 (list (integerp (get-universal-time)) (integerp (get-internal-real-time)) (integerp (get-internal-run-time)) (integerp internal-time-units-per-second) (length (multiple-value-list (get-decoded-time))) (stringp (lisp-implementation-type)) (stringp (lisp-implementation-version)) (progn (sleep 0) 1)))

;;; 402
(answer 402 (let ((*trace-output* (make-string-output-stream))) (time (or (list (= (list (float (gcd)) (float 3.0e-5) (float -7 1.0)) (* (+) (*))) (/= (*) (*) 4611686018427387903) (< (expt 3.0e-5 1) (+)) (> 4611686018427387903 (rem (+) -3)) (<= (/ (gcd) 2) (+) (*)) (>= (+) (*))) (let ((l '(1 2 3 4 5 6 7 8 9 10 11))) (list (sixth l) (seventh l) (eighth l) (ninth l) (tenth l)))))))
