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
(answer 37 (list (numberp (let ((c (cons 1 2))) (rplaca c ((lambda (a &optional (b (list (< (abs (- pi 3.141592653589793)) 1.0e-15)) b-p) &rest r &key (k (list (nth 2 nil) (list-length '(3 1 2)) (length (remove-duplicates (nsubstitute-if-not (gcd) #'oddp (list 3 1 2)))) (elt '(1 2 3 4 5 6) 5))) &aux (z (list a b))) (list b-p r k z)) 1 2 :k 3)) (rplacd c (let ((x (list 1 2 3)) (y (list (streamp *standard-output*) (streamp *standard-input*) (streamp *error-output*) (streamp *trace-output*) (streamp *terminal-io*) (streamp *query-io*) (streamp *debug-io*) *print-base* *read-base* *read-default-float-format* (consp *features*)))) (rotatef (first x) (third x) y) (shiftf (second x) y (list least-positive-normalized-double-float least-negative-normalized-double-float)) (list x y))) c)) (realp (loop for x = 1 then (* x 2) while (< x 50) until (> x 0) collect x)) (rationalp (* (rationalize 1.5) (/ (rational 0.1)))) (integerp (expt 2 (- 1))) (floatp (- (/ (+ (+) (*)) (- (+) (+))) (* (min (*) (+)) (expt 2 (- 0))))) (complexp (*))))

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
(answer 109 (princ-to-string (let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) (11) . 12) ((13) . 14) 15 16))) (list (cdaaar x) (cdaadr x) (cdadar x) (cdaddr x) (cddaar x) (cddadr x) (cdddar x) (cddddr x)))))

;;; 110
(answer 110 (write-to-string 1.0e10 :base 8))

;;; 111
(answer 111 (write-to-string (format nil "~w|~a ~:a ~:s" (let ((l nil)) (tagbody (go two) one (push 1 l) (go end) two (push 2 l) (go one) end) l) nil nil nil) :escape nil))

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
(answer 139 (remove (char-downcase (char-downcase (code-char (+ 65 5)))) (format nil (formatter "~a+~a") (list (< most-positive-fixnum (expt 2 62)) (> most-negative-fixnum (- (expt 2 63)))) (reduce #'- (remove-if-not #'evenp (substitute 4611686018427387903 12 (delete -7 (list 3 1 2)))) :from-end t :initial-value (signum 0) :start 0))))

;;; 140
(answer 140 (substitute #\! #\- (let ((*print-circle* nil) (*print-readably* nil) (*print-pretty* nil)) (write-to-string '(a (b . c) (d (e)))))))

;;; 141
(answer 141 (list (string= (format nil "~a|~s|~10a|~10@a|~va" (list (adjoin 1 (nconc (list 1 2 2 1) (list 3 1 2))) (adjoin 1000003 nil :key #'-) (tailp nil (nconc (list 1 2 2 1) (list 3 1 2)))) (list (lognor (logxor (gcd) 255 (gcd)) (isqrt (abs 1))) (logorc1 (ash -100000000000000000000 5) -100000000000000000000) (logorc2 (denominator 1/2) (+ -7 0))) ':key 'a 0 'v) (format nil "~d|~5d|~5,'0d|~:d|~@d|~b|~o|~x|~3r" (logcount (lognot 12)) -100000000000000000000 3 (- (ldb (byte 2 1) 1) (1+ (gcd))) 255 (gcd (gcd) (denominator -7/3)) (1- (+ 4611686018427387903 0)) 1000003 (1- (logxor 1000003 -7 4611686018427387903)))) (string/= "a-b c" "Hello World") (string< (subseq "abcdefgh" 0) (string-capitalize "xyzzy")) (string> (let ((*print-base* 2) (*print-radix* t)) (prin1-to-string 12)) (let ((*print-case* :downcase) (*print-escape* nil)) (write-to-string '(Foo "x" |Bar|)))) (string<= (prin1-to-string (expt 3 (- 2))) "xyzzy") (string>= "abc" (format nil "~a ~*~a|~2:*~a" 1 2 (loop for x in (cons 1 '(5 -5 5)) if (evenp x) sum x into e and collect x into l else minimize x into m end finally (return (list e l m))) 4))))

;;; 142
(answer 142 (list (string-equal "a-b c" (let ((*print-array* nil) (*print-gensym* nil)) (write-to-string (make-symbol "X")))) (string-not-equal "" (write-to-string (let ((x 1) (y 2)) (psetq x y y x) (psetf x (+ x y) y x) (list x y)) :escape nil)) (string-lessp (substitute #\! #\5 (format nil "~a")) (format nil "~d|~5d|~5,'0d|~:d|~@d|~b|~o|~x|~3r" (1+ (gcd)) (rem 4611686018427387903 2) 3 (lognot (mod 1 7)) 1000003 (dpb 255 (byte 2 1) (logior -100000000000000000000 12)) 0 -100000000000000000000 -7)) (string-greaterp (nstring-upcase (copy-seq (string-downcase (format nil "a~10tb~5@tc~%~2,4td" ) :start 1))) (format nil "~f|~,2f|~8,3f|~e|~,3e|~$|~g" 0.5 1.0 0.5 1.0 -0.25 1.0 -0.25)) (string-not-greaterp (write-to-string (rational 3.0e-5) :base 8) (format nil (formatter "~a+~a") (loop for x = 1 then (* x 2) while (< x 50) until (> x 3) collect x) (let ((h (make-hash-table))) (dolist (x (nthcdr 3 '(1 2 3 4 5))) (incf (gethash x h 0))) (list (loop for k being the hash-keys of h collect k) (loop for v being the hash-values of h using (hash-key k) collect (cons k v)) (progn (clrhash h) (hash-table-count h)))))) (string-not-lessp (let ((*print-length* 2) (*print-level* 1)) (prin1-to-string '(1 (2 (3)) 4 5))) (reverse (format nil "~r|~:r|~@r" 0 2 3)))))

;;; 143
(answer 143 (list (stringp (let ((x (list (integerp (get-universal-time)) (integerp (get-internal-real-time)) (integerp (get-internal-run-time)) (integerp internal-time-units-per-second) (length (multiple-value-list (get-decoded-time))) (stringp (lisp-implementation-type)) (stringp (lisp-implementation-version)) (progn (sleep 0) 1)))) (declare (ignorable x) (type t x)) (symbol-macrolet ((y (list x))) y))) (simple-string-p "abc") (length (format nil "~(~a~)|~:(~a~)|~@(~a~)|~:@(~a~)" (concatenate 'string (format nil "~10<~a~>|~10:<~a~>|~10@<~a~>|~12<~a~;~a~;~a~>" nil nil ':key 'a 'b 'c) "Hello World" (string 'foo)) (princ-to-string (list (boole boole-1 1000003 12) (boole boole-2 0 255) (boole boole-and 1000003 0) (boole boole-ior 255 1) (boole boole-xor -100000000000000000000 (gcd)) (boole boole-eqv -7 -7) (boole boole-nand 1 12) (boole boole-nor 4611686018427387903 -100000000000000000000))) (format nil "~w|~a ~:a ~:s" (list (getf '(:a 1 :b 2) :a) (getf nil :z (parse-integer "1x2")) (multiple-value-list (get-properties '(:a 1 :b 2) '(:b :c)))) nil nil nil) (format nil "~{~a~^, ~}|~:{<~a ~a>~}|~@{~a~}" '(3 1 2) '((1 2) (3 4)) (cond (t (list (eq (intern "FOO") 'foo) (multiple-value-list (find-symbol "CAR" "COMMON-LISP")) (packagep *package*) (package-name (find-package "KEYWORD")) (package-name (symbol-package 'car)))) ((let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) (11) . 12) ((13) . 14) 15 16))) (list (cdaaar x) (cdaadr x) (cdadar x) (cdaddr x) (cddaar x) (cddadr x) (cdddar x) (cddddr x)))) (t (list single-float-epsilon short-float-epsilon long-float-epsilon single-float-negative-epsilon short-float-negative-epsilon long-float-negative-epsilon))) (do* ((i 0 (+ i 2)) (j i (+ i 1))) ((> i 5) (list i j)) (when (= i 4) (return 'early)))))) (position #\a (format nil "~a ~*~a|~2:*~a" 1 2 (funcall (lambda (&key a ((:other o) (list (member 255 '(5 -5 5)) (member 4611686018427387903 '(1 2 3 4 5) :test #'eql) (member-if #'plusp '(5 -5 5)) (member-if-not #'plusp nil))) &allow-other-keys) (list a o)) :a 1 :b 2) 4)) (search (format nil "~c|~:c|~@c|~?|~%~&~~|~|" (char-upcase (code-char (+ 65 5))) #\5 (char-downcase (char-upcase #\a)) "~a-~a" (list (list (multiple-value-list (subtypep 'fixnum 'rational)) (multiple-value-list (subtypep '(integer 0 3) '(integer 0 2)))) (reduce #'- (nsubstitute-if 4611686018427387903 #'oddp (vector 4 3 2 1)) :from-end t :initial-value 1000003 :start 0))) (string-left-trim '(#\a #\H) (format nil "~d item~:p|~d cit~:@p|~p" 5 3 5))) (mismatch (format nil "~#[none~;one ~a~:;several~]" (handler-bind ((error (lambda (c) (declare (ignore c)) (use-value (list (let ((s (make-random-state t))) (random-state-p s)) (random-state-p *random-state*) (< -1 (random 10) 10) (< (random 1.0) 1.0)))))) (restart-case (error "x") (use-value (v) (list 'used v)) (store-value (v) v)))) (make-string 2 :initial-element #\-))))

;;; 144
(answer 144 (let ((s (copy-seq (format nil "~c|~:c|~@c|~?|~%~&~~|~|" (char-downcase #\Space) (char-upcase #\Z) (char-downcase #\a) "~a-~a" (list (list (nsubst 'x 'c (copy-tree '((1 . 2) 3))) (nsubst-if 'x #'numberp (copy-tree '((1 . 2) 3))) (nsubst-if-not 'x #'listp (copy-tree '((1 . 2) 3)))) (let (a b) (setf (values a b) (values (list (< 1000 array-dimension-limit) (< 7 array-rank-limit) (< 1000 array-total-size-limit) (bit (make-array 4 :element-type 'bit :initial-element 1) 2) (sbit (make-array 4 :element-type 'bit :initial-element 0) 1)) (unless (< call-arguments-limit 50) (list (< 20 lambda-parameters-limit) (< 19 multiple-values-limit) (if (member '&rest lambda-list-keywords) t))))) (list a b))))))) (list (char "abc" 1) (schar "abc" 2) (if (> (length s) 0) (setf (char s 0) #\Q)) s)))

;;; 145
(answer 145 (string< "abc" "xabd" :start2 1))

;;; 146
(answer 146 (list (symbolp (list most-positive-double-float (< -1.0e-300 least-negative-double-float 0 least-positive-double-float 1.0e-300) most-negative-double-float double-float-epsilon double-float-negative-epsilon)) (keywordp 'foo) (symbol-name 'a) (eq ':key 'a) (symbol-package ':k)))

;;; 147
(answer 147 (let ((s (gensym "Q"))) (list (symbolp s) (boundp s) (fboundp s) (char (symbol-name s) 0) (symbol-plist s))))

;;; 148
(answer 148 (let ((s (make-symbol "S"))) (set s (list (char= (code-char (+ 65 1)) (code-char (+ 65 2))) (char/= (char-upcase #\5) #\Space) (char< #\Space (char-upcase (char-downcase #\-)) (char-upcase (char-upcase #\Z))) (char> (char-downcase (code-char (+ 65 1))) (code-char (+ 65 0))) (char<= (char-downcase #\-) (code-char (+ 65 2))) (char>= (char-upcase (char-upcase #\-)) #\Z))) (setf (get s 'p) (= least-positive-single-float least-positive-short-float least-positive-long-float (- least-negative-single-float) (- least-negative-short-float) (- least-negative-long-float))) (setf (symbol-function s) (lambda (x) (* x x))) (list (symbol-value s) (get s 'p) (get s 'q 'none) (funcall s (ldb (byte 3 5) (ash (lcm 0 -7) (- 5)))) (if (remprop s 'p) t) (get s 'p) (if (fboundp s) t) (progn (makunbound s) (boundp s)) (progn (fmakunbound s) (fboundp s)))))

;;; 149
(answer 149 (let ((s (copy-symbol 'foo)) (u (gentemp))) (list (symbol-name s) (eq s 'foo) (symbolp u) (integerp *gensym-counter*))))

;;; 150
(answer 150 (list (eq (intern "FOO") 'foo) (multiple-value-list (find-symbol "CAR" "COMMON-LISP")) (packagep *package*) (package-name (find-package "KEYWORD")) (package-name (symbol-package 'car))))

;;; 151
(answer 151 (list (constantp (unless (< call-arguments-limit 50) (list (< 20 lambda-parameters-limit) (< 19 multiple-values-limit) (if (member '&rest lambda-list-keywords) t)))) (constantp 'x) (constantp ''x) (special-operator-p 'if) (special-operator-p 'car) (compiled-function-p #'car) (functionp #'car) (functionp 'car)))

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
(answer 176 (list (consp (multiple-value-list (with-simple-restart (cl:abort "Leave.") (cl:abort)))) (atom (let ((l '(1 2 3 4 5 6 7 8 9 10 11))) (list (sixth l) (seventh l) (eighth l) (ninth l) (tenth l)))) (listp (let ((x (list (merge 'list (list 1 3 5) (list 2 3 4) #'<) (merge 'vector (vector 1 4) (list 2 3) #'<)))) (declare (ignorable x) (type t x)) (symbol-macrolet ((y (list x))) y))) (null (list (string= "" (format nil "~{~a~^, ~}|~:{<~a ~a>~}|~@{~a~}" (nreconc (list 1 2 2 1) (list 3 1 2)) '((1 2) (3 4)) (let ((l '(1 2 3 4 5)) (m nil)) (push 1 l) (pushnew (gcd) l) (pushnew 3 l :test #'=) (setq m (pop l)) (list l m)) (list (streamp *standard-output*) (streamp *standard-input*) (streamp *error-output*) (streamp *trace-output*) (streamp *terminal-io*) (streamp *query-io*) (streamp *debug-io*) *print-base* *read-base* *read-default-float-format* (consp *features*)))) (string/= (format nil "~f|~,2f|~8,3f|~e|~,3e|~$|~g" 1.0 -0.25 0.5 -0.25 0.5 0.5 -0.25) (format nil "~d item~:p|~d cit~:@p|~p" 3 1 0)) (string< (format nil "~[zero~;one~:;many~]|~:[no~;yes~]|~@[x=~a~]" 1 nil ':key) (let ((*print-array* nil) (*print-gensym* nil)) (write-to-string (make-symbol "X")))) (string> (write-to-string (load-time-value (list 1 2)) :escape nil) "Hello World") (string<= (string-upcase (format nil "~d item~:p|~d cit~:@p|~p" 5 0 0)) (remove (code-char (+ 65 3)) (subseq "abcdefgh" 0))) (string>= (string-trim "a Z" (nstring-downcase (copy-seq "ABC") :end 2)) (string-downcase (format nil "a~10tb~5@tc~%~2,4td" ) :start 1)))) (endp (nbutlast (copy-list '(3 1 2)) 3)) (not (progn (print (loop for x in (cons 1 '(3 1 2)) if (evenp x) sum x into e and collect x into l else minimize x into m end finally (return (list e l m)))) (prin1 (list (find-if (lambda (x) (> x 2)) (sort (list 1 2 2 1) #'<)) (find-if-not #'oddp (remove 4611686018427387903 (remove-duplicates (stable-sort (vector 4 3 2 1) #'< :key #'abs) :from-end t))) (find-if (lambda (x) (> x 2)) (substitute-if 255 #'evenp (delete -100000000000000000000 (list 3 1 2))) :from-end t))) (princ (handler-bind ((warning #'muffle-warning)) (warn "w ~a" (loop for i downfrom 5 to 2 by 2 collect i)) 'warned)) (terpri) (write-line "x") (fresh-line) (format t "~a~%" (list (concatenate 'list (fill (vector 4 3 2 1) 12) (nsubstitute-if-not 1000003 #'evenp (list 1 2 2 1))) (concatenate 'vector (delete-duplicates (vector 4 3 2 1) :key #'1+) #(3 1 2 1)))) 'printed))))

;;; 177
(answer 177 (list (nth 2 (append (butlast '(3 1 2)) (list (ash -100000000000000000000 1) -7 (abs -7)))) (list-length (append (rest (ldiff '(5 -5 5) nil)) nil)) (length (remove-if-not #'oddp (delete-if-not (lambda (x) (> x 2)) (vector 4 3 2 1)))) (elt '(1 2 3 4 5 6) 5)))

;;; 178
(answer 178 (let ((c (cons 1 2))) (rplaca c (handler-case (cl:assert (= 1 (1+ (gcd 0 12)))) (error () 'assertion))) (rplacd c (handler-bind ((warning #'muffle-warning)) (warn "w ~a" (with-open-stream (s (make-string-input-stream "1 2")) (list (read s) (read s) (read s nil :eof)))) 'warned)) c))

;;; 179
(answer 179 (list (copy-tree '(a (b . c) (d (e)))) (copy-alist '((a . 1) nil (c . 3))) (tree-equal '((1 . 2) 3) '(a (b . c) (d (e)))) (tree-equal '((1 . 2) 3) '(a (b . c) (d (e))) :test #'equal)))

;;; 180
(answer 180 (list (subst (stable-sort (list '(1 . a) '(0 . b) '(1 . c) '(0 . d)) #'< :key #'car) 'b '(a (b . c) (d (e)))) (subst-if 0 #'symbolp '(a (b . c) (d (e)))) (subst-if-not 0 #'consp '((1 . 2) 3))))

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
(answer 186 (list (acons 'a (let ((h (make-hash-table)) (l nil)) (setf (gethash 1 h) 'a (gethash 2 h) 'b) (with-hash-table-iterator (next h) (loop (multiple-value-bind (more k v) (next) (if more (push (cons k v) l) (return))))) (reverse l)) '((a . 1) (b . 2))) (pairlis '(c a) '(1 2) '((a . 1) nil (c . 3)))))

;;; 187
(answer 187 (pairlis '(a b c) (list ((lambda (a &optional (b (let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) (11) . 12) ((13) . 14) 15 16))) (list (caaaar x) (caaadr x) (caadar x) (caaddr x) (cadaar x) (cadadr x) (caddar x) (cadddr x))) b-p) &rest r &key (k (list (string-equal (format nil "~a") (make-string 2 :initial-element #\Space)) (string-not-equal (format nil "~10<~a~>|~10:<~a~>|~10@<~a~>|~12<~a~;~a~;~a~>" nil 'foo 'foo 'a 'b 'c) (let ((*print-case* :downcase) (*print-escape* nil)) (write-to-string '(Foo "x" |Bar|)))) (string-lessp (concatenate 'string "a-b c" "Hello World" (nstring-downcase (copy-seq "ABC") :end 2)) (write-to-string (*) :base 8)) (string-greaterp (format nil "~a|~s|~10a|~10@a|~va" (with-input-from-string (s "one two (3 4) x") (list (read s) (read-char s) (peek-char nil s) (unread-char (read-char s) s) (read-line s) (read-line s nil 'eof) (read s nil 'end))) (string< "abc" "xabd" :start2 1) ':key 'a 5 'v) "xyzzy") (string-not-greaterp "xyzzy" (format nil "~a ~*~a|~2:*~a" 1 2 (list (< 1000 array-dimension-limit) (< 7 array-rank-limit) (< 1000 array-total-size-limit) (bit (make-array 4 :element-type 'bit :initial-element 1) 2) (sbit (make-array 4 :element-type 'bit :initial-element 0) 1)) 4)) (string-not-lessp (let ((*print-length* 2) (*print-level* 1)) (prin1-to-string '(1 (2 (3)) 4 5))) (format nil "~f|~,2f|~8,3f|~e|~,3e|~$|~g" 1.0 1.0 1.0 1.0 0.5 -0.25 0.5)))) &aux (z (list a b))) (list b-p r k z)) 1 2 :k 3) (let ((l nil)) (list (catch 'k (unwind-protect (throw 'k (abs (lcm -7 -100000000000000000000))) (push #(1 2 3) l))) l)) (let ((s (make-symbol "S"))) (set s (let ((x 1) (y 2)) (psetq x y y x) (psetf x (+ x y) y x) (list x y))) (setf (get s 'p) (let ((x (let ((h (make-hash-table)) (l nil)) (setf (gethash 1 h) 'a (gethash 2 h) 'b) (with-hash-table-iterator (next h) (loop (multiple-value-bind (more k v) (next) (if more (push (cons k v) l) (return))))) (reverse l))) (y (load-time-value (list 1 2)))) (let* ((x y) (z x)) (list x y z)))) (setf (symbol-function s) #'-) (list (symbol-value s) (get s 'p) (get s 'q 'none) (funcall s (integer-length 1)) (if (remprop s 'p) t) (get s 'p) (if (fboundp s) t) (progn (makunbound s) (boundp s)) (progn (fmakunbound s) (fboundp s)))))))

;;; 188
(answer 188 (list (getf nil :a) (getf '(:a 1 :b 2) :z (let ((h (make-hash-table))) (list (integerp (hash-table-size h)) (realp (hash-table-rehash-size h)) (realp (hash-table-rehash-threshold h)) (= (sxhash "ab") (sxhash (copy-seq "ab")))))) (multiple-value-list (get-properties nil '(:b :c)))))

;;; 189
(answer 189 (let ((p (list :a 1 :b 2))) (list (remf p :z) p (setf (getf p :n) (mod (logcount (* 0 255)) 2)) (incf (getf p :m 10)) p)))

;;; 190
(answer 190 (list (adjoin (lcm (isqrt (abs (+ 4611686018427387903 -100000000000000000000))) (gcd)) nil) (adjoin (ash (isqrt (abs -7)) (- 3)) '(3 1 2) :key (lambda (x) (* x x))) (tailp nil (make-list 2 :initial-element -100000000000000000000))))

;;; 191
(answer 191 (list (let ((a (copy-list (rest (nreconc (list 3 1 2) (list 3 1 2))))) (b '(5 -5 5))) (sort (union a b) #'<)) (intersection (reverse (last '(5 -5 5) 5)) (nconc (copy-list '(3 1 2)) (list 1 2 2 1))) (set-difference nil (cons 1 '(5 -5 5))) (let ((a (nreverse (list 3 1 2))) (b (rest '(1 2 3 4 5)))) (sort (set-exclusive-or a b) #'<)) (subsetp '(5 -5 5) nil)))

;;; 192
(answer 192 (list (sort (nunion (copy-list '(1 2 3 4 5)) (copy-list (nthcdr 5 (butlast '(3 1 2))))) #'<) (nintersection (copy-list (last (last nil 2) 3)) (copy-list '(3 1 2))) (nset-difference (list 1 2 2 1) (copy-list (make-list 1 :initial-element 1000003))) (sort (nset-exclusive-or (copy-list '(5 -5 5)) (copy-list (nbutlast (list 1 2 2 1) 0))) #'<)))

;;; 193
(answer 193 (let ((a (nconc (list 3 1 2) (list 3 1 2))) (b '(1 2 3 4 5))) (sort (union a b :test #'equal) #'<)))

;;; 194
(answer 194 (let ((l (nthcdr 3 nil)) (m nil)) (push (logior (logxor (logxor 255 12 4611686018427387903) (ash 255 (- 1)) (- 12 0)) 0) l) (pushnew (+ (dpb -7 (byte 7 3) 1) (gcd)) l) (pushnew 3 l :test #'=) (setq m (pop l)) (list l m)))

;;; 195
(answer 195 (list (mapcar #'abs (append (reverse (rest '(5 -5 5))) '(3 1 2))) (mapcar #'+ (ldiff '(1 2 3 4 5) nil) (list (rem (logand 4611686018427387903 -7) 1) 12 1000003)) (maplist #'length '(1 2 3 4 5))))

;;; 196
(answer 196 (let ((sum nil)) (list (mapc (lambda (x) (push x sum)) '(3 1 2)) (mapl (lambda (x) (push (length x) sum)) (revappend '(5 -5 5) '(1 2 3 4 5))) sum)))

;;; 197
(answer 197 (list (mapcan #'list (revappend (nreverse (copy-list nil)) (nbutlast (list 1 2 2 1) 2)) (list* (gcd (gcd 4611686018427387903 12) (lognot -100000000000000000000)) (list* (mod 0 3) nil))) (mapcon #'list nil)))

;;; 198
(answer 198 (list (every (lambda (x) (> x 2)) (substitute (dpb (denominator 1/2) (byte 1 0) (denominator -7/3)) (numerator -7/3) (substitute-if-not -100000000000000000000 (lambda (x) (> x 2)) (delete-duplicates (list 3 1 2) :key (complement #'zerop)) :count 1))) (some #'evenp (nsubstitute (gcd) 1 (copy-list '(3 1 2)))) (notevery #'evenp (substitute-if (numerator 0) #'plusp (delete-if #'plusp (vector 4 3 2 1)))) (notany #'oddp (stable-sort (vector 4 3 2 1) #'> :key (constantly (lognot 1))))))

;;; 199
(answer 199 (list (every #'< '(3 1 2) #()) (some (lambda (x y) (and (> x y) (list x y))) #(3 1 2 1) (copy-list (ldiff (butlast '(5 -5 5)) nil)))))

;;; 200
(answer 200 (list (map 'list (constantly 255) (nsubstitute -100000000000000000000 1 (copy-list '(5 -5 5)))) (map 'vector #'+ (reverse (remove-duplicates (delete-if #'plusp (vector 4 3 2 1)) :from-end t)) (substitute-if-not (ldb (byte 1 5) (ash 0 2)) #'evenp (remove (gcd) (remove-duplicates (nsubstitute-if 1 #'oddp (list 1 2 2 1)))) :count 1)) (map nil #'identity (fill (vector 4 3 2 1) -7)) (map 'string #'char-upcase (let ((*print-circle* nil) (*print-readably* nil) (*print-pretty* nil)) (write-to-string '(a (b . c) (d (e))))))))

;;; 201
(answer 201 (list (map-into (copy-seq #(3 1 2 1)) (constantly (abs 1000003)) (copy-seq (remove-if (lambda (x) (> x 2)) (sort (list 3 1 2) #'<)))) (map-into (list 1 2 2 1) #'+ (delete-if-not #'oddp (vector 4 3 2 1)) (remove-duplicates (remove-duplicates (remove-if-not #'oddp (delete-if #'plusp (list 3 1 2)))) :from-end t))))

;;; 202
(answer 202 (list (reduce #'+ (substitute-if 255 (lambda (x) (> x 2)) (remove (1+ 12) (stable-sort (list 1 2 2 1) #'> :key (complement #'zerop))))) (reduce #'list (nsubstitute-if-not (denominator (* 1/2 22/7)) #'plusp (copy-seq #(1 2 3))) :initial-value (let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) 11 . 12) (13 . 14) 15 16))) (list (caar x) (cadr x) (cdar x) (cddr x) (caaar x) (caadr x) (cadar x) (caddr x) (cdaar x) (cdadr x) (cddar x) (cdddr x)))) (reduce #'list (butlast '(1 2 3 4 5)) :from-end t) (reduce #'+ (copy-seq #(1 2 3)) :key #'identity)))

;;; 203
(answer 203 (reduce #'- (reverse (fill (list 3 1 2) (dpb 0 (byte 7 1) 4611686018427387903))) :from-end t :initial-value (mod (+ (ash (gcd) (- 0)) (- -100000000000000000000 1)) 2) :start 0))

;;; 204
(answer 204 (list (find (isqrt (abs 12)) (substitute-if-not (- (logcount 1000003) (lcm 255 1)) #'oddp (substitute -100000000000000000000 (gcd 1000003 4611686018427387903) (sort (vector 4 3 2 1) #'<)) :count 1)) (find 1000003 (nsubstitute (numerator 1/2) 1 (copy-list '(5 -5 5))) :test #'eql) (find (1- (logxor 255 (gcd) (logior 255 -7))) #() :key (constantly -100000000000000000000) :from-end t)))

;;; 205
(answer 205 (list (find-if (lambda (x) (> x 2)) (copy-seq (nsubstitute-if (gcd) #'evenp (vector 4 3 2 1)))) (find-if-not #'plusp (reverse (delete-duplicates (vector 4 3 2 1) :key (constantly 4611686018427387903)))) (find-if #'oddp (delete (* 4611686018427387903 (integer-length 1000003)) (list 1 2 2 1)) :from-end t)))

;;; 206
(answer 206 (list (position (rem 12 7) (delete-if-not #'evenp (vector 4 3 2 1))) (position-if #'evenp (remove-if #'evenp (nreconc (list 1 2 2 1) (list 1 2 2 1)))) (position-if-not #'plusp (copy-seq (substitute-if-not (signum -7) #'oddp (reverse (remove-duplicates (nsubstitute-if-not 255 (lambda (x) (> x 2)) (vector 4 3 2 1)))) :count 1))) (position 1 '(1 2 1 3) :from-end t :end 2)))

;;; 207
(answer 207 (list (count (logand (isqrt (abs -7)) (* (mod 1 7) 12)) (remove 0 (substitute (logior 1 -7) (denominator 22/7) (nsubstitute-if 12 (lambda (x) (> x 2)) (vector 4 3 2 1))))) (count-if #'evenp (remove-duplicates (delete-duplicates (list 1 2 2 1) :key (constantly 255)) :from-end t)) (count-if-not #'plusp (nsubstitute (gcd) 1 (copy-seq #(3 1 2 1)))) (count 1 '(1 2 1 3 1) :start 2)))

;;; 208
(answer 208 (remove (1+ (ldb (byte 3 0) 4611686018427387903)) (sort (copy-list nil) #'>)))

;;; 209
(answer 209 (remove-if (lambda (x) (> x 2)) (substitute-if (ash (numerator 1/2) (- 5)) #'evenp (delete-if-not #'oddp (list 3 1 2)))))

;;; 210
(answer 210 (remove-if-not (lambda (x) (> x 2)) (delete-if #'evenp (copy-list '(3 1 2)))))

;;; 211
(answer 211 (remove (logxor (1- 1000003) (lognot -100000000000000000000) (+ 0 (ash (gcd) 0))) (remove-if #'oddp (cons 4611686018427387903 '(1 2 3 4 5))) :count 1 :from-end t))

;;; 212
(answer 212 (remove-if #'oddp '(1 2 3 4 5 6) :start 1 :end 5 :count 5))

;;; 213
(answer 213 (delete (gcd 1 1000003) (copy-list (nbutlast (list 1 2 2 1) 3))))

;;; 214
(answer 214 (delete-if (lambda (x) (> x 2)) (vector 4 3 2 1)))

;;; 215
(answer 215 (delete-if-not #'plusp (list 3 1 2)))

;;; 216
(answer 216 (remove-duplicates (nsubstitute 255 1 (copy-seq #(1 2 3)))))

;;; 217
(answer 217 (remove-duplicates (nsubstitute-if (logand (logcount 0) (- 1000003 12)) #'evenp (copy-seq #())) :from-end t))

;;; 218
(answer 218 (delete-duplicates (copy-seq #(3 1 2 1)) :key (constantly 4611686018427387903)))

;;; 219
(answer 219 (substitute (dpb (abs (gcd)) (byte 2 1) (integer-length 255)) (lcm (logand (rem -100000000000000000000 2) 12) (lcm (lognot 0) (logand 1 -7))) (copy-seq (nsubstitute-if-not (ldb (byte 3 1) 1000003) #'oddp (list 1 2 2 1)))))

;;; 220
(answer 220 (substitute-if (integer-length (abs 0)) #'plusp (remove-if #'oddp (nthcdr 5 '(3 1 2)))))

;;; 221
(answer 221 (substitute-if-not (+ -7 (isqrt (abs (* -7 12)))) #'evenp (stable-sort (copy-seq #(3 1 2 1)) #'> :key #'abs) :count 1))

;;; 222
(answer 222 (nsubstitute (gcd) 1 (copy-seq #(3 1 2 1))))

;;; 223
(answer 223 (nsubstitute-if 0 #'plusp (copy-list (append '(1 2 3 4 5) '(3 1 2)))))

;;; 224
(answer 224 (nsubstitute-if-not (signum (logior 1 (logxor 255 -100000000000000000000 1))) (lambda (x) (> x 2)) (copy-seq #(1 2 3))))

;;; 225
(answer 225 (reverse (ldiff '(5 -5 5) nil)))

;;; 226
(answer 226 (copy-seq (fill (list 3 1 2) 4611686018427387903)))

;;; 227
(answer 227 (sort (copy-seq #()) #'<))

;;; 228
(answer 228 (stable-sort (list 3 1 2) #'> :key (constantly (1- (ash (gcd) (- 2))))))

;;; 229
(answer 229 (stable-sort (list '(1 . a) '(0 . b) '(1 . c) '(0 . d)) #'< :key #'car))

;;; 230
(answer 230 (list (merge 'list (list 1 3 5) (list 2 3 4) #'<) (merge 'vector (vector 1 4) (list 2 3) #'<)))

;;; 231
(answer 231 (fill (vector 4 3 2 1) 255))

;;; 232
(answer 232 (fill (list 1 2 3 4 5 6) (multiple-value-list (with-simple-restart (cl:abort "Leave.") (cl:abort))) :start 1 :end 1))

;;; 233
(answer 233 (replace (list 1 2 3 4) (delete (rem (logand -7 0) 2) (copy-list '(1 2 3 4 5))) :start1 1))

;;; 234
(answer 234 (list (search '(1 2) #(3 1 2 1)) (search (reverse (delete-if #'oddp (list 3 1 2))) '(3 1 2)) (mismatch (remove-if-not #'evenp (substitute-if 1000003 #'plusp (stable-sort (list 1 2 2 1) #'< :key #'-))) (delete-if-not #'plusp (copy-seq #(1 2 3)))) (mismatch (list* (signum -100000000000000000000) '(5 -5 5)) #() :test #'=)))

;;; 235
(answer 235 (list (concatenate 'list (remove (gcd) (delete (isqrt (abs -100000000000000000000)) (vector 4 3 2 1))) (delete-duplicates (list 1 2 2 1) :key #'1+)) (concatenate 'vector (remove-duplicates #(1 2 3) :from-end t) #())))

;;; 236
(answer 236 (list (coerce (reverse (fill (list 3 1 2) 12)) 'list) (coerce (nsubstitute (+ -7 (lcm 255 1)) 1 (copy-seq #(3 1 2 1))) 'vector) (coerce '(#\a #\b) 'string) (coerce "c" 'character) (coerce 0.1 'double-float)))

;;; 237
(answer 237 (list (make-sequence 'list 2 :initial-element (labels ((f (n) (if (< n 1) nil (cons n (f (- n 1)))))) (f 3))) (make-sequence 'string 2 :initial-element (code-char (+ 65 2))) (make-sequence 'vector 5 :initial-element 0)))

;;; 238
(answer 238 (subseq (copy-seq (remove-duplicates (remove-duplicates (substitute-if-not 12 (lambda (x) (> x 2)) (fill (list 1 2 2 1) 0) :count 1)))) 1))

;;; 239
(answer 239 (elt (remove-duplicates (sort (vector 4 3 2 1) #'<) :from-end t) 0))

;;; 240
(answer 240 (let ((s (list 1 2 3 4))) (setf (subseq s 1 3) (last (nreverse (list 1 2 2 1)) 3)) s))

;;; 241
(answer 241 (length (let ((s (make-string-input-stream "ab cd"))) (list (read-preserving-whitespace s) (read-char-no-hang s) (peek-char t s) (listen s) (input-stream-p s) (output-stream-p s) (streamp s) (open-stream-p s) (close s)))))

;;; 242
(answer 242 (let ((a (make-array '(2 3) :initial-contents '((1 2 3) (4 5 6))))) (list (aref a 1 2) (array-rank a) (array-dimension a 1) (array-dimensions a) (array-total-size a) (row-major-aref a 4) (array-row-major-index a 1 1) (array-in-bounds-p a 2 0) (setf (aref a 0 0) (multiple-value-bind (a b c) (values (let ((l nil)) (tagbody (go two) one (push 1 l) (go end) two (push 2 l) (go one) end) l) (prog* ((x (abs -100000000000000000000)) (y (list x))) (return (list x y)))) (list a b c))) a)))

;;; 243
(answer 243 (let ((v (make-array 7 :initial-element (multiple-value-bind (v c) (ignore-errors (error 'simple-error :format-control "x ~a" :format-arguments '(1))) (list v (simple-condition-format-control c) (simple-condition-format-arguments c))) :adjustable t :fill-pointer 0))) (list (vector-push (error (restart-case (invoke-restart 'r (let ((x 5)) (handler-bind ((error (lambda (c) (declare (ignore c)) (invoke-restart 'store-value 12)))) (ccase x (1 'one) (12 'twelve) (255 'byte) ((0 -7 3) 'other))))) (r (x) (list 'r x)))) v) (vector-push-extend (read-char (make-string-input-stream "")) v) (vector-push-extend (integer-length 4611686018427387903) v) (fill-pointer v) (vector-pop v) v (array-has-fill-pointer-p v) (adjustable-array-p v))))

;;; 244
(answer 244 (let ((v (make-array 5 :initial-contents '(1 2 3 4 5) :fill-pointer 3))) (setf (fill-pointer v) 0) (list v (length v) (array-total-size v) (aref v 4) (reverse v))))

;;; 245
(answer 245 (let ((a (make-array 3 :initial-element 0 :adjustable t))) (list (adjust-array a 5 :initial-element (lognot (numerator (- 22/7 22/7)))) (array-element-type (vector 1)) (upgraded-array-element-type t))))

;;; 246
(answer 246 (list (svref #(1 2 3 4 5 6) 0) (aref #() 3)))

;;; 247
(answer 247 (let ((v (copy-seq #(3 1 2 1)))) (setf (svref (vector 1 2) 0) 5) (if (> (length v) 0) (setf (aref v 0) (symbol-value 'unbound-thing247))) (list v (arrayp (symbol-value 'unbound-thing247)) (vectorp (handler-case (symbol-value 'nothing247) (unbound-variable (c) (cell-error-name c)))) (simple-vector-p (block b247 (list 1 (return-from b247 (list (assoc 'a '((a . 1) (b . 2))) (assoc 'b '((a . 1) nil (c . 3)) :test #'eq) (assoc-if #'symbolp '((a . 1) (b . 2))) (assoc-if-not #'symbolp '((a . 1) (2 . 3)))))))))))

;;; 248
(answer 248 (multiple-value-list (array-displacement (make-array 3 :initial-element (list (alpha-char-p (char-upcase #\Z)) (alphanumericp #\5) (graphic-char-p #\a) (upper-case-p (char-downcase (code-char (+ 65 2)))) (lower-case-p (char-upcase (char-downcase #\Space))) (both-case-p (code-char (+ 65 5))) (characterp (list (make-sequence 'list 2 :initial-element (list (char-equal #\5 #\Z) (char-not-equal #\- #\a) (char-lessp #\Z #\5) (char-greaterp #\a #\5) (char-not-greaterp #\Space #\Z) (char-not-lessp #\- #\a))) (make-sequence 'string 2 :initial-element #\Z) (make-sequence 'vector 1 :initial-element 0))) (standard-char-p #\-))))))

;;; 249
(answer 249 (list (< 1000 array-dimension-limit) (< 7 array-rank-limit) (< 1000 array-total-size-limit) (bit (make-array 4 :element-type 'bit :initial-element 1) 2) (sbit (make-array 4 :element-type 'bit :initial-element 0) 1)))

;;; 250
(answer 250 (let ((h (make-hash-table))) (setf (gethash 0 h) (typecase (multiple-value-call #'list (with-open-stream (s (make-string-input-stream "1 2")) (list (read s) (read s) (read s nil :eof))) (values (progn (pprint '(1 2 3 4 5)) 'pretty) (let ((x 5)) (handler-bind ((error (lambda (c) (declare (ignore c)) (invoke-restart 'store-value 12)))) (ccase x (1 'one) (12 'twelve) (255 'byte) ((0 -7 3) 'other))))) (values)) (integer 'integer) (symbol 'symbol) (string 'string) (list 'list) (float 'float) (t 'other)) (gethash 'k h) 5) (incf (gethash 'n h 10)) (list (gethash 'k h) (multiple-value-list (gethash 'zz h (ecase (1- (* -7 -100000000000000000000)) (1 'one) (12 'twelve)))) (hash-table-count h) (remhash 'k h) (remhash 'k h) (hash-table-count h))))

;;; 251
(answer 251 (let ((h (make-hash-table :test 'equal)) (l nil)) (setf (gethash "a" h) 1 (gethash (multiple-value-list (values (let ((n 0)) (let ((inc (lambda () (incf n))) (get (lambda () n))) (funcall inc) (funcall inc) (funcall get))) (loop with a = (ash 4611686018427387903 (- 2)) and b = (do ((i 0 (1+ i)) (l nil (cons i l))) ((= i 1) l)) repeat 3 collect a collect b))) h) 2 (gethash "A" h) 3) (maphash (lambda (k v) (push (list k v) l)) h) (list (reverse l) (hash-table-test h) (hash-table-p h) (hash-table-p (multiple-value-bind (v c) (ignore-errors (error 'simple-error :format-control "x ~a" :format-arguments '(1))) (list v (simple-condition-format-control c) (simple-condition-format-arguments c)))))))

;;; 252
(answer 252 (let ((h (make-hash-table))) (dolist (x (butlast (list (ldb (byte 1 2) 4611686018427387903) 1000003 (dpb 1 (byte 2 0) 255)))) (incf (gethash x h 0))) (list (loop for k being the hash-keys of h collect k) (loop for v being the hash-values of h using (hash-key k) collect (cons k v)) (progn (clrhash h) (hash-table-count h)))))

;;; 253
(answer 253 (let ((h (make-hash-table)) (l nil)) (setf (gethash 1 h) 'a (gethash 2 h) 'b) (with-hash-table-iterator (next h) (loop (multiple-value-bind (more k v) (next) (if more (push (cons k v) l) (return))))) (reverse l)))

;;; 254
(answer 254 (let ((h (make-hash-table))) (list (integerp (hash-table-size h)) (realp (hash-table-rehash-size h)) (realp (hash-table-rehash-threshold h)) (= (sxhash "ab") (sxhash (copy-seq "ab"))))))

;;; 255
(answer 255 (list (eq nil nil) (eql (let ((p (list :a 1 :b 2))) (list (remf p :b) p (setf (getf p :n) (rem (ash -100000000000000000000 5) 7)) (incf (getf p :m 10)) p)) (let ((l nil)) (list (catch 'k (unwind-protect (throw 'k (logcount 12)) (push 1 l))) l))) (equal (do* ((i 0 (+ i 2)) (j i (+ i 1))) ((> i 5) (list i j)) (when (= i 4) (return 'early))) (let ((x 'a)) (handler-bind ((error (lambda (c) (declare (ignore c)) (invoke-restart 'store-value 7)))) (ctypecase x (integer (list 'integer x)))))) (equalp (list (read-from-string "#'car") (multiple-value-list (read-from-string "a b" t nil :start 1))) (multiple-value-list (with-simple-restart (r "Leave.") (invoke-restart (find-restart 'r)))))))

;;; 256
(answer 256 (list (equal nil '(3 1 2)) (equalp "a-b c" (string-upcase (format nil "~r|~:r|~@r" 0 1 1))) (equalp 1 1.0) (equalp #(1 2 3) (copy-seq #()))))

;;; 257
(answer 257 (list (typep (error (list (read-from-string "#o17") (multiple-value-list (read-from-string "a b" t nil :start 1)))) 'integer) (typep (handler-bind ((error #'continue)) (cerror "Go on." "bad ~a" 1) 'continued) '(or symbol string)) (typep (numerator 0) '(integer 0 255)) (typep (prog2 (subseq #(3 1 2 1) 1) (list (parse-integer "ff" :radix 16) (parse-integer " 12 x" :junk-allowed t) (parse-integer "a12b" :start 1 :end 3)) (multiple-value-list (with-simple-restart (r "Leave.") (invoke-restart (find-restart 'r))))) '(member a foo 1)) (typep (handler-case (symbol-value 'nothing257) (unbound-variable (c) (cell-error-name c))) '(and atom (not null))) (typep (loop for x in '(1 2 3 4 5) for i from 0 collect (list i x)) 'sequence) (typep (- (dpb (ash 1000003 3) (byte 1 1) (gcd (gcd) (gcd))) 255) '(satisfies evenp))))

;;; 258
(answer 258 (typecase (consp (quote (list (copy-tree '(a (b . c) (d (e)))) (copy-alist '((a . 1) nil (c . 3))) (tree-equal '((1 . 2) 3) '((1 . 2) 3)) (tree-equal '((1 . 2) 3) '(a (b . c) (d (e))) :test #'equal)))) (integer 'integer) (symbol 'symbol) (string 'string) (list 'list) (float 'float) (t 'other)))

;;; 259
(answer 259 (etypecase (the integer 0) (number 'number) (symbol 'symbol)))

;;; 260
(deftype small260 (&optional (n 10)) (list 'integer 0 n))
(answer 260 (list (typep (denominator (* -7/3 1/2)) 'small260) (typep (gcd (rem (gcd) 1) (logcount (- 1000003 12))) '(small260 300))))

;;; 261
(answer 261 (let ((x (unless (list (evenp -7) (oddp (mod 4611686018427387903 7)) (zerop (- (*))) (plusp (rationalize 1.5)) (minusp (+))) (let ((*trace-output* (make-string-output-stream))) (time nil)) (nreconc (list 3 1 2) (list 3 1 2))))) (check-type x integer) x))

;;; 262
(answer 262 (list (multiple-value-list (subtypep 'fixnum 'rational)) (multiple-value-list (subtypep '(integer 0 3) '(integer 0 2)))))

;;; 263
(answer 263 (the integer -7))

;;; 264
(answer 264 (if t (let ((a (make-array 3 :initial-element 0 :adjustable t))) (list (adjust-array a 5 :initial-element (signum (mod 255 2))) (array-element-type (vector 1)) (upgraded-array-element-type t))) (let ((sum nil)) (list (mapc (lambda (x) (push x sum)) (make-list 2 :initial-element (logxor 0 (gcd) 255))) (mapl (lambda (x) (push (length x) sum)) (cons (denominator -7/3) nil)) sum))))

;;; 265
(answer 265 (and (loop named outer for i from 0 do (loop for j to 3 do (when (> (+ i j) 3) (return-from outer (list i j))))) (loop initially (princ 'start) for c across "xyzzy" do (when (char= c #\b) (loop-finish)) (princ c) finally (princ 'end)) (list (multiple-value-list (decode-universal-time 3600000000 0)) (encode-universal-time 5 4 3 2 1 2001 0))))

;;; 266
(answer 266 (or (list (evenp 12) (oddp (logior (1+ 1) (ash -100000000000000000000 (- 0)))) (zerop (rem (+) -3)) (plusp (+)) (minusp (expt -2.25 5))) (multiple-value-list (integer-decode-float 0.0))))

;;; 267
(answer 267 (cond (t (with-input-from-string (s "one two (3 4) x") (list (read s) (read-char s) (peek-char nil s) (unread-char (read-char s) s) (read-line s) (read-line s nil 'eof) (read s nil 'end)))) ((let ((x (list (integerp (get-universal-time)) (integerp (get-internal-real-time)) (integerp (get-internal-run-time)) (integerp internal-time-units-per-second) (length (multiple-value-list (get-decoded-time))) (stringp (lisp-implementation-type)) (stringp (lisp-implementation-version)) (progn (sleep 0) 1))) (y (let ((s (gensym "Q"))) (list (symbolp s) (boundp s) (fboundp s) (char (symbol-name s) 0) (symbol-plist s))))) (let* ((x y) (z x)) (list x y z)))) (t (handler-bind ((error #'continue)) (cerror "Go on." "bad ~a" 1) 'continued))))

;;; 268
(answer 268 (when nil (list (character 'x) (character "y") (character #\Space) (< 1000 char-code-limit))))

;;; 269
(answer 269 (unless t (list (coerce (delete-if #'evenp (vector 4 3 2 1)) 'list) (coerce (remove-if (lambda (x) (> x 2)) (nsubstitute-if 4611686018427387903 (lambda (x) (> x 2)) (vector 4 3 2 1))) 'vector) (coerce '(#\a #\b) 'string) (coerce "c" 'character) (coerce (sqrt 2.0) 'double-float)) (read-char (make-string-input-stream ""))))

;;; 270
(answer 270 (case (abs (ldb (byte 3 2) (lognot -7))) ((0 1) 'low) (255 'byte) (otherwise (let ((s (make-string-input-stream "ab cd"))) (list (read-preserving-whitespace s) (read-char-no-hang s) (peek-char t s) (listen s) (input-stream-p s) (output-stream-p s) (streamp s) (open-stream-p s) (close s))))))

;;; 271
(answer 271 (case 'foo (a 1) ((foo nil) 2) (t 3)))

;;; 272
(answer 272 (ecase (integer-length (- 1 (dpb 1000003 (byte 3 3) 4611686018427387903))) (1 'one) (12 'twelve)))

;;; 273
(answer 273 (let ((x (let ((h (make-hash-table))) (setf (gethash (* (logxor -100000000000000000000 0 255) (gcd 4611686018427387903 12)) h) (handler-case (error 'type-error :datum (restart-case (invoke-restart 'r (handler-case (read-from-string "(1 2") (end-of-file (c) (streamp (stream-error-stream c))))) (r (x) (list 'r x))) :expected-type 'list) (type-error (c) (list (type-error-datum c) (typep (type-error-datum c) (type-error-expected-type c))))) (gethash 'k h) 5) (incf (gethash 'n h 10)) (list (gethash 'k h) (multiple-value-list (gethash 'zz h (apply #'list (let ((x 'a)) (handler-bind ((error (lambda (c) (declare (ignore c)) (invoke-restart 'store-value 7)))) (ctypecase x (integer (list 'integer x))))) '(5 -5 5)))) (hash-table-count h) (remhash 'k h) (remhash 'k h) (hash-table-count h)))) (y (list (identity (destructuring-bind (a (b &optional (c (prog ((x 12)) (setq x (list x x)) (return x)))) &rest d &key k) '(1 (2) :k 3) (list a b c d k))) (funcall (constantly (handler-case (read-from-string "(1 2") (end-of-file (c) (streamp (stream-error-stream c))))) 1 2) (funcall (complement #'oddp) (lcm (logand -100000000000000000000 (gcd)) -7))))) (let* ((x y) (z x)) (list x y z))))

;;; 274
(answer 274 (let ((x 1) (y 2)) (psetq x y y x) (psetf x (+ x y) y x) (list x y)))

;;; 275
(answer 275 (let ((x (list 1 2 3)) (y (let ((a (make-array '(2 3) :initial-contents '((1 2 3) (4 5 6))))) (list (aref a 1 2) (array-rank a) (array-dimension a 1) (array-dimensions a) (array-total-size a) (row-major-aref a 4) (array-row-major-index a 1 1) (array-in-bounds-p a 2 0) (setf (aref a 0 0) (let ((s (copy-seq "fresh"))) (list (char "abc" 1) (schar "abc" 2) (if (> (length s) 0) (setf (char s 0) #\Q)) s))) a)))) (rotatef (first x) (third x) y) (shiftf (second x) y (handler-case (error "text ~a" (handler-case (error "text ~a" (multiple-value-call #'list (list most-positive-single-float most-positive-short-float most-positive-long-float most-negative-single-float most-negative-short-float most-negative-long-float) (values (let ((s (copy-symbol 'foo)) (u (gentemp))) (list (symbol-name s) (eq s 'foo) (symbolp u) (integerp *gensym-counter*))) (let* ((a (make-random-state t)) (b (make-random-state a))) (equal (list (random 1000 a) (random 1000 a)) (list (random 1000 b) (random 1000 b))))) (values))) (error (c) (let ((text (princ-to-string c))) (if (eql 0 (search "text " text)) text 'other))))) (error (c) (let ((text (princ-to-string c))) (if (eql 0 (search "text " text)) text 'other))))) (list x y)))

;;; 276
(answer 276 (let ((n 1)) (list (incf n) (decf n 1000003) (incf n (- (mod 1 3) (* (* 22/7 1/2) -7/3))) n)))

;;; 277
(answer 277 (let ((v (vector 1 2 3)) (i 0)) (incf (aref v (incf i)) (gcd)) (decf (aref v i)) (list v i)))

;;; 278
(answer 278 (prog1 (macrolet ((m (&whole w x) (list 'quote (list w x)))) (m (ash 0 1))) (loop for x across #(3 1 2) sum x into s count (oddp x) into c maximize x into m finally (return (list s c m)))))

;;; 279
(answer 279 (prog2 (etypecase (list (loop for x in (revappend '(5 -5 5) '(1 2 3 4 5)) always (numberp x)) (loop for x in (nthcdr 5 nil) never (eql x 2)) (loop for x in (last '(3 1 2) 2) thereis (and (> x 2) x))) (number 'number) (symbol 'symbol)) (list (symbolp (loop for x across #(3 1 2) sum x into s count (oddp x) into c maximize x into m finally (return (list s c m)))) (keywordp ':key) (symbol-name 'a) (eq 'a nil) (symbol-package ':k)) (length (multiple-value-list (get-setf-expansion '(car x))))))

;;; 280
(answer 280 (progn (let ((*trace-output* (make-string-output-stream))) (time (multiple-value-bind (a b c) (values (let ((n 0)) (let ((inc (lambda () (incf n))) (get (lambda () n))) (funcall inc) (funcall inc) (funcall get))) (list (multiple-value-list (decode-universal-time 3600000000 0)) (encode-universal-time 5 4 3 2 1 2001 0))) (list a b c)))) (length (multiple-value-list (get-setf-expansion '(car x))))))

;;; 281
(answer 281 (block b281 (list 1 (return-from b281 (progn (list (cl:signal 'condition) (typep (make-condition 'simple-warning) 'warning) (handler-case (cl:signal 'simple-condition) (condition () 'got))) (loop for x on (nreverse (list 3 1 2)) by #'cddr nconc (list (length x))))))))

;;; 282
(answer 282 (let ((l nil)) (tagbody (go two) one (push 1 l) (go end) two (push 2 l) (go one) end) l))

;;; 283
(answer 283 (catch 'k (list (throw 'k (handler-case (cl:assert (= 1 (+ (numerator 22/7) (denominator 22/7)))) (error () 'assertion))) (loop for i downfrom 5 to 5 by 2 collect i))))

;;; 284
(answer 284 (let ((l nil)) (list (catch 'k (unwind-protect (throw 'k (isqrt (abs (1- (logcount 12))))) (push (let ((x 5)) (handler-bind ((error (lambda (c) (declare (ignore c)) (invoke-restart 'store-value 12)))) (ccase x (1 'one) (12 'twelve) (255 'byte) ((0 -7 3) 'other)))) l))) l)))

;;; 285
(answer 285 (prog ((x 1000003)) (setq x (list x x)) (return x)))

;;; 286
(answer 286 (prog* ((x (signum (1+ 255))) (y (list x))) (return (list x y))))

;;; 287
(answer 287 (do ((i 0 (1+ i)) (l nil (cons i l))) ((= i 5) l)))

;;; 288
(answer 288 (do* ((i 0 (+ i 2)) (j i (+ i 1))) ((> i 5) (list i j)) (when (= i 4) (return 'early))))

;;; 289
(answer 289 (let ((l nil)) (dotimes (i 1 (list i l)) (push i l))))

;;; 290
(answer 290 (let ((s 0)) (dolist (x (revappend nil nil) (list s x)) (incf s x))))

;;; 291
(answer 291 (multiple-value-list (values (list (stringp (apply #'list (handler-case (symbol-value 'nothing291) (unbound-variable (c) (cell-error-name c))) (reverse nil))) (simple-string-p (nstring-downcase (copy-seq "ABC") :end 2)) (length (format nil "~a")) (position (char-downcase #\5) "") (search (string 'a) (nstring-capitalize (copy-seq "Hello World"))) (mismatch (princ-to-string (list (multiple-value-list (truncate (+) 2)) (multiple-value-list (round (*) 1)))) (format nil "~#[none~;one ~a~:;several~]" (unless (< call-arguments-limit 50) (list (< 20 lambda-parameters-limit) (< 19 multiple-values-limit) (if (member '&rest lambda-list-keywords) t)))))) (multiple-value-list (array-displacement (make-array 2 :initial-element (fill (list 1 2 3 4 5 6) (elt (remove-if #'evenp (delete-if-not #'plusp (list 3 1 2))) 0) :start 1 :end 3)))))))

;;; 292
(answer 292 (multiple-value-bind (a b c) (values (list (multiple-value-list (ffloor 1.0e10 2.0)) (multiple-value-list (fceiling 0.1)) (multiple-value-list (ftruncate 3.0e-5)) (multiple-value-list (fround 1.5))) (mapcar (let ((k 1000003)) (lambda (x) (+ x k))) (copy-list (nconc (list 1 2 2 1) (list 1 2 2 1))))) (list a b c)))

;;; 293
(answer 293 (multiple-value-call #'list (list (streamp *standard-output*) (streamp *standard-input*) (streamp *error-output*) (streamp *trace-output*) (streamp *terminal-io*) (streamp *query-io*) (streamp *debug-io*) *print-base* *read-base* *read-default-float-format* (consp *features*)) (values (let ((x 'a)) (handler-bind ((error (lambda (c) (declare (ignore c)) (invoke-restart 'store-value 7)))) (ctypecase x (integer (list 'integer x))))) (catch 'k (list (throw 'k (handler-bind ((error (lambda (c) (declare (ignore c)) (store-value (let ((v (make-array 5 :initial-contents '(1 2 3 4 5) :fill-pointer 3))) (setf (fill-pointer v) 0) (list v (length v) (array-total-size v) (aref v 4) (reverse v))))))) (restart-case (error "x") (store-value (v) (list 'stored v))))) (let ((s (list 1 2 3 4))) (setf (subseq s 1 3) (stable-sort (vector 4 3 2 1) #'> :key #'1+)) s)))) (values)))

;;; 294
(answer 294 (multiple-value-list (multiple-value-prog1 (values (multiple-value-list (with-simple-restart (r "Leave.") (invoke-restart (find-restart 'r)))) 2) (list (merge 'list (list 1 3 5) (list 2 3 4) #'<) (merge 'vector (vector 1 4) (list 2 3) #'<)))))

;;; 295
(answer 295 (let (a b) (multiple-value-setq (a b) (floor (ash (gcd) (- 3)) 1)) (list a b)))

;;; 296
(answer 296 (list (nth-value 1 (floor 12 7)) (multiple-value-list (values-list (make-list 2 :initial-element (abs (lognot -100000000000000000000)))))))

;;; 297
(answer 297 (let (a b) (setf (values a b) (values (handler-case (unbound-function297 (list (svref #(1 2 3 4 5 6) 3) (aref #(1 2 3) 2))) (undefined-function (c) (cell-error-name c))) (progn (print (let ((n 0)) (loop (when (> (incf n) 1) (return n))))) (prin1 (remove-if #'plusp '(1 2 3 4 5 6) :start 1 :end 5 :count 5)) (princ (list (char-code #\-) (char-int (char-upcase #\Space)) (char-name #\Newline) (name-char "space") (digit-char 1) (digit-char 11 16) (digit-char-p (char-upcase #\a)) (digit-char-p #\f 16))) (terpri) (write-line "x") (fresh-line) (format t "~a~%" (list (loop for x in '(5 -5 5) always (numberp x)) (loop for x in (rest '(5 -5 5)) never (eql x 2)) (loop for x in (append '(1 2 3 4 5) '(1 2 3 4 5)) thereis (and (> x 2) x)))) 'printed))) (list a b)))

;;; 298
(answer 298 (destructuring-bind (a (b &optional (c (loop for x across #(3 1 2) sum x into s count (oddp x) into c maximize x into m finally (return (list s c m))))) &rest d &key k) '(1 (2) :k 3) (list a b c d k)))

;;; 299
(answer 299 (handler-case (destructuring-bind (a b) (butlast (reverse (nbutlast (list 1 2 2 1) 5))) (list a b)) (error () 'mismatch)))

;;; 300
(answer 300 (progv '(*p300*) (list (read-char (make-string-input-stream ""))) (symbol-value '*p300*)))

;;; 301
(answer 301 (locally (declare (optimize speed)) (list (count (signum 4611686018427387903) (nreconc (list 3 1 2) (list 1 2 2 1))) (count-if #'evenp (sort (list 1 2 2 1) #'<)) (count-if-not #'oddp #(3 1 2 1)) (count 1 '(1 2 1 3 1) :start 3))))

;;; 302
(answer 302 (consp (quote (list (consp (list (search '(1 2) (remove-if-not #'plusp (delete-duplicates (list 3 1 2) :key (complement #'zerop)))) (search (nsubstitute-if-not 255 (lambda (x) (> x 2)) (vector 4 3 2 1)) '(3 1 2)) (mismatch (substitute-if-not 4611686018427387903 #'oddp (delete -100000000000000000000 (vector 4 3 2 1)) :count 1) (substitute 1000003 -7 (substitute-if-not 0 #'oddp (remove-duplicates (substitute-if -7 (lambda (x) (> x 2)) (substitute-if 12 #'plusp (remove-duplicates (nsubstitute-if-not -100000000000000000000 #'evenp (list 1 2 2 1)) :from-end t)))) :count 1))) (mismatch (nconc (list 3 1 2) (list 1 2 2 1)) #() :test #'=))) (atom (= least-positive-single-float least-positive-short-float least-positive-long-float (- least-negative-single-float) (- least-negative-short-float) (- least-negative-long-float))) (listp (list (sublis '((a . 1) (b . 2)) '(a (b . c) (d (e)))) (nsublis '((a . z)) (copy-tree '((1 . 2) 3))))) (null (loop for x in (ldiff '(3 1 2) nil) for i from 0 collect (list i x))) (endp '(5 -5 5)) (not (let ((s (make-string-input-stream "ab cd"))) (list (read-preserving-whitespace s) (read-char-no-hang s) (peek-char t s) (listen s) (input-stream-p s) (output-stream-p s) (streamp s) (open-stream-p s) (close s))))))))

;;; 303
(answer 303 (eval-when (:execute :load-toplevel :compile-toplevel) (let ((s (make-string-output-stream))) (format s "~a" (handler-case (read-from-string "(1 2") (end-of-file (c) (streamp (stream-error-stream c))))) (finish-output s) (force-output s) (clear-output s) (list (get-output-stream-string s) (get-output-stream-string s)))))

;;; 304
(answer 304 (load-time-value (list 1 2)))

;;; 305
(answer 305 (let ((x (let ((v (make-array 3 :initial-element (apply #'+ (isqrt (abs -7)) '(1 2 3 4 5)) :adjustable t :fill-pointer 0))) (list (vector-push (list (map 'list (lambda (x) (* x x)) (copy-seq (delete-if-not #'evenp (vector 4 3 2 1)))) (map 'vector #'+ (remove-if #'plusp nil) (remove 1000003 (fill (list 3 1 2) (gcd)))) (map nil #'identity (remove 0 (sort (vector 4 3 2 1) #'>))) (map 'string #'char-upcase (let ((*print-array* nil) (*print-gensym* nil)) (write-to-string (make-symbol "X"))))) v) (vector-push-extend (multiple-value-list (decode-float -2.25)) v) (vector-push-extend 4611686018427387903 v) (fill-pointer v) (vector-pop v) v (array-has-fill-pointer-p v) (adjustable-array-p v))))) (declare (ignorable x) (type t x)) (symbol-macrolet ((y (list x))) y)))

;;; 306
(answer 306 (funcall #'identity (ash 1 0)))

;;; 307
(answer 307 (apply #'+ (1+ 0) (cons 1 '(3 1 2))))

;;; 308
(answer 308 (apply #'list (loop for x on nil by #'cddr nconc (list (length x))) (butlast (make-list 5 :initial-element (- 1 -7)))))

;;; 309
(answer 309 (flet ((f (x) (list 'f x)) (g (&rest r) r)) (f (g (parse-integer "1x2") (multiple-value-bind (v c) (ignore-errors (error 'simple-error :format-control "x ~a" :format-arguments '(1))) (list v (simple-condition-format-control c) (simple-condition-format-arguments c)))))))

;;; 310
(answer 310 (labels ((f (n) (if (< n 1) nil (cons n (f (- n 1)))))) (f 3)))

;;; 311
(answer 311 ((lambda (a &optional (b (or (= (gcd) (/ (*)) (list (float 12) (float 1.0e10) (float 1000003 1.0))) (let ((n (logand 255 (gcd)))) (setf (ldb (byte 3 2) n) (1+ 1000003)) (setf (mask-field (byte 2 0) n) (ldb (byte 1 2) 12)) n)) b-p) &rest r &key (k (flet ((f (x) (list 'f x)) (g (&rest r) r)) (f (g (list (map-into (copy-seq #(1 2 3)) #'identity (remove-if-not (lambda (x) (> x 2)) (nsubstitute 255 1 (list 3 1 2)))) (map-into (copy-list '(1 2 3 4 5)) #'+ (stable-sort (list 1 2 2 1) #'> :key #'-) (nsubstitute-if 0 #'evenp (vector 4 3 2 1)))) (list (every #'< (copy-list '(3 1 2)) #(3 1 2 1)) (some (lambda (x y) (and (> x y) (list x y))) #(1 2 3) nil)))))) &aux (z (list a b))) (list b-p r k z)) 1 2 :k 3))

;;; 312
(answer 312 (funcall (lambda (&key a ((:other o) (handler-case (destructuring-bind (a b) (append (nconc (list 1 2 2 1) (list 3 1 2)) (list* -7 '(3 1 2))) (list a b)) (error () 'mismatch))) &allow-other-keys) (list a o)) :a 1 :b 2))

;;; 313
(answer 313 (funcall (lambda (a b) (list a b)) (locally (declare (optimize speed)) (list single-float-epsilon short-float-epsilon long-float-epsilon single-float-negative-epsilon short-float-negative-epsilon long-float-negative-epsilon))))

;;; 314
(answer 314 (let ((n 0)) (let ((inc (lambda () (incf n))) (get (lambda () n))) (funcall inc) (funcall inc) (funcall get))))

;;; 315
(answer 315 (mapcar (let ((k (logior (dpb 255 (byte 2 1) -100000000000000000000) (lcm (rem -100000000000000000000 7) 1)))) (lambda (x) (+ x k))) '(5 -5 5)))

;;; 316
(answer 316 (list (identity (list (nth-value 1 (floor (signum 4611686018427387903) 7)) (multiple-value-list (values-list (ldiff nil nil))))) (funcall (constantly (list (logandc1 1 1000003) (logandc2 (isqrt (abs (logxor -100000000000000000000 12 -7))) (integer-length (+ 4611686018427387903 12))) (logeqv (ash (gcd) 0) (ldb (byte 7 1) (gcd))) (lognand (logior (numerator 1/2) 1) (numerator (- -7/3 22/7))))) 1 2) (funcall (complement (lambda (x) (> x 2))) (1- (integer-length 0)))))

;;; 317
(defun f317 (x &optional (y 0)) "Doc." (list x y))
(answer 317 (list (f317 (remove (* -100000000000000000000 (ash 1000003 (- 0))) (delete-if #'oddp (vector 4 3 2 1)) :count 1 :from-end t)) (if (fboundp 'f317) t) (funcall 'f317 1 2) (funcall (fdefinition 'f317) 3) (documentation 'f317 'function)))

;;; 318
(defmacro m318 (a &body b) `(list ,a ,@b))
(answer 318 (list (m318 4611686018427387903 (list (every #'plusp (delete-duplicates (list 1 2 2 1) :key (constantly 4611686018427387903))) (some #'plusp #()) (notevery #'evenp (delete (dpb -7 (byte 1 2) 255) (vector 4 3 2 1))) (notany (lambda (x) (> x 2)) (reverse (remove-if-not #'oddp (substitute 4611686018427387903 -7 (nsubstitute 0 1 (list 3 1 2))))))) (pairlis '(a b c) (list (if nil (macrolet ((m (&whole w x) (list 'quote (list w x)))) (m (gcd))) (with-input-from-string (s "one two (3 4) x") (list (read s) (read-char s) (peek-char nil s) (unread-char (read-char s) s) (read-line s) (read-line s nil 'eof) (read s nil 'end)))) (list (multiple-value-list (floor (* (*) (+)) 3)) (multiple-value-list (ceiling (+) 7))) (list (position (gcd 255 -7) (delete-if (lambda (x) (> x 2)) (list 1 2 2 1))) (position-if #'evenp (substitute (gcd) 1 (remove-if #'plusp (delete-if (lambda (x) (> x 2)) (list 3 1 2))))) (position-if-not #'oddp (nsubstitute-if-not 1 #'evenp (list 1 2 2 1))) (position 1 '(1 2 1 3) :from-end t :end 3))))) (macroexpand-1 '(m318 1 2)) (macroexpand '(m318 3)) (functionp (macro-function 'm318))))

;;; 319
(answer 319 (macrolet ((m (&whole w x) (list 'quote (list w x)))) (m (mod -100000000000000000000 2))))

;;; 320
(defmacro w320 (&whole w x &environment e) (declare (ignore e x)) `',w)
(answer 320 (w320 (logand 4611686018427387903 (mod (gcd 255 -100000000000000000000) 3))))

;;; 321
(defvar *v321* (logxor 0 (logcount (rem 12 1)) (- (rem 12 2) (1- 1000003))) "A variable.")
(defparameter *w321* 255)
(defconstant c321 5)
(answer 321 (let ((*v321* 1)) (list *v321* *w321* c321 (documentation '*v321* 'variable) (boundp '*v321*))))

;;; 322
(define-modify-macro add322 (&rest r) + "Adds.")
(answer 322 (let ((x 12)) (add322 x 1 2) x))

;;; 323
(defun second323 (l) (nth 1 l))
(defsetf second323 (l) (new) `(setf (nth 1 ,l) ,new))
(answer 323 (let ((l (list 1 2 3))) (setf (second323 l) (loop for i from 1 to 0 append (list i i))) l))

;;; 324
(defun put324 (l v) (setf (car l) v))
(defun get324 (l) (car l))
(defsetf get324 put324)
(answer 324 (let ((l (list 1 2))) (setf (get324 l) (list (find 255 (delete-duplicates (vector 4 3 2 1) :key #'identity)) (find -100000000000000000000 (remove-duplicates (remove-if (lambda (x) (> x 2)) (fill (list 3 1 2) 1))) :test #'=) (find (* 4611686018427387903 (+ (gcd) 1000003)) (remove-duplicates (delete 12 (vector 4 3 2 1)) :from-end t) :key #'1+ :from-end t))) (list l (get324 l))))

;;; 325
(defun (setf top325) (v l) (setf (car l) v))
(answer 325 (let ((l (list 1 2))) (setf (top325 l) (funcall (constantly (abs 255)) (lognot (logior 1 0)))) (push 5 (cdr l)) l))

;;; 326
(define-setf-expander tail326 (l) (let ((v (gensym)) (s (gensym))) (values (list v) (list l) (list s) `(progn (setf (cdr ,v) ,s) ,s) `(cdr ,v))))
(defun tail326 (l) (cdr l))
(answer 326 (let ((l (list 1 2))) (setf (tail326 l) '(1 2 3 4 5)) l))

;;; 327
(answer 327 (length (multiple-value-list (get-setf-expansion '(car x)))))

;;; 328
(declaim (special *d328*))
(proclaim '(special *e328*))
(answer 328 (list (setq *d328* (list (multiple-value-list (floor -7/3)) (multiple-value-list (round (- (+ -7/3 22/7 -7/3) (+ 1/2 -7/3 22/7)))) (multiple-value-list (ceiling (+ 1/2 1/2 (+ 1/2 22/7 22/7)))) (multiple-value-list (truncate 1/2)))) *d328* (eval '(let ((*e328* 2)) (symbol-value '*e328*)))))

;;; 329
(define-symbol-macro s329 (list 1 (loop initially (princ 'start) for c across (string-capitalize (substitute #\! #\Space (let ((*print-length* 2) (*print-level* 1)) (prin1-to-string '(1 (2 (3)) 4 5))))) do (when (char= c #\b) (loop-finish)) (princ c) finally (princ 'end))))
(answer 329 s329)

;;; 330
(answer 330 (list (eval '(+ 1 -7)) (eval (gcd)) (eval ''a) (funcall (compile nil '(lambda (x) (* x 2))) 4611686018427387903)))

;;; 331
(answer 331 (unless (< call-arguments-limit 50) (list (< 20 lambda-parameters-limit) (< 19 multiple-values-limit) (if (member '&rest lambda-list-keywords) t))))

;;; 332
(defgeneric g332 (x))
(defmethod g332 (x) (list 'any x))
(defmethod g332 ((x number)) (list 'number (call-next-method)))
(defmethod g332 ((x (eql 1))) (list 'one (next-method-p)))
(answer 332 (list (g332 (loop named outer for i from 0 do (loop for j to 3 do (when (> (+ i j) 0) (return-from outer (list i j)))))) (g332 1) (g332 0.0)))

;;; 333
(defstruct s333 (a (lcm -7 (logcount (1+ -100000000000000000000)))) (b nil))
(answer 333 (let ((s (make-s333 :b (restart-bind ((r (lambda (x) (list 'bound x)))) (list (restart-name (first (compute-restarts))) (invoke-restart 'r (list (let ((a '(5 -5 5)) (b '(1 2 3 4 5))) (sort (union a b) #'<)) (intersection '(3 1 2) (list* 0 '(1 2 3 4 5))) (set-difference '(3 1 2) (nthcdr 1 '(5 -5 5))) (let ((a '(1 2 3 4 5)) (b nil)) (sort (set-exclusive-or a b) #'<)) (subsetp (nbutlast (list 1 2 2 1) 5) (revappend nil '(3 1 2)))))))))) (setf (s333-a s) (list (first '(3 1 2)) (second (nreconc (list 3 1 2) (list 3 1 2))) (third '(5 -5 5)) (fourth (last (reverse '(5 -5 5)) 5)) (fifth (rest (rest nil))))) (list s (s333-p s) (s333-p 5) (s333-b s) (equalp s (copy-s333 s)) (typep s 's333) (copy-structure s))))

;;; 334
(defstruct (p334 (:constructor new334 (x &optional (y (denominator (* -7/3 1/2)))))) x y)
(defstruct (q334 (:include p334 (x 5)) (:conc-name qq-)) z)
(answer 334 (let ((q (make-q334 :z (case ':key (a 1) ((foo nil) 2) (t 3))))) (list (new334 (let ((n (lcm (rem 1000003 3) (mod 0 1)))) (list (incf n) (decf n (ash -100000000000000000000 3)) (incf n -7/3) n))) q (qq-x q) (p334-x q) (p334-p q))))

;;; 335
(defstruct (l335 (:type list) :named) a b)
(answer 335 (list (make-l335 :a 1 :b (stable-sort (list '(1 . a) '(0 . b) '(1 . c) '(0 . d)) #'< :key #'car)) (l335-a (make-l335 :a (handler-case (car (list (reduce #'+ nil) (reduce #'list '(1 2 3 4 5) :initial-value (let* ((a (make-random-state t)) (b (make-random-state a))) (equal (list (random 1000 a) (random 1000 a)) (list (random 1000 b) (random 1000 b))))) (reduce #'list (list (gcd) 255 1000003) :from-end t) (reduce #'+ (delete-if-not #'plusp (list 1 2 2 1)) :key (constantly 1)))) (type-error () 'type-error) (:no-error (x) (list x))))) (l335-p '(1))))

;;; 336
(defstruct r336 (a 1 :read-only t) (b 2 :type integer))
(answer 336 (r336-a (handler-case (car (list (multiple-value-list (floor (ldb (byte 1 2) 1) (- (gcd) 0))) (multiple-value-list (truncate -100000000000000000000 (numerator 22/7))))) (type-error () 'type-error) (:no-error (x) (list x)))))

;;; 337
(defstruct (pp337 (:print-function (lambda (o s d) (declare (ignore d)) (format s "<~a>" (pp337-a o))))) a)
(answer 337 (prin1-to-string (make-pp337 :a (list (rassoc -7 '((a . 1) (b . 2))) (rassoc-if #'oddp '((a . 1) (b . 4))) (rassoc-if-not #'oddp '((a . 1) (b . 4)))))))

;;; 338
(defstruct po338 a)
(defmethod print-object ((o po338) s) (print-unreadable-object (o s) (format s "po ~a" (po338-a o))))
(answer 338 (format nil "~a" (make-po338 :a (let ((v (vector 1 2 3)) (i 0)) (incf (aref v (incf i)) 12) (decf (aref v i)) (list v i)))))

;;; 339
(answer 339 (handler-case (error "text ~a" (list (mapcan #'list '(5 -5 5) (copy-list '(5 -5 5))) (mapcon #'list (cons (1+ 1000003) '(1 2 3 4 5))))) (error (c) (let ((text (princ-to-string c))) (if (eql 0 (search "text " text)) text 'other)))))

;;; 340
(answer 340 (handler-case (error 'type-error :datum (list (eval '(+ 1 (ash (gcd 1000003 12) (- 1)))) (eval -7) (eval ''a) (funcall (compile nil '(lambda (x) (* x 2))) (logior (logcount 255) 4611686018427387903))) :expected-type 'list) (type-error (c) (list (type-error-datum c) (typep (type-error-datum c) (type-error-expected-type c))))))

;;; 341
(answer 341 (handler-case (car 0.1) (type-error () 'type-error) (:no-error (x) (list x))))

;;; 342
(answer 342 (handler-case (/ (lognot (denominator (- -7/3 -7/3))) 0) (arithmetic-error (c) (list (arithmetic-error-operation c) (second (arithmetic-error-operands c))))))

;;; 343
(answer 343 (multiple-value-bind (v c) (ignore-errors (error 'simple-error :format-control "x ~a" :format-arguments '(1))) (list v (simple-condition-format-control c) (simple-condition-format-arguments c))))

;;; 344
(answer 344 (let ((l nil)) (handler-case (handler-bind ((error (lambda (c) (declare (ignore c)) (push 'bound l)))) (error "x")) (error () (push (list (integerp (get-universal-time)) (integerp (get-internal-real-time)) (integerp (get-internal-run-time)) (integerp internal-time-units-per-second) (length (multiple-value-list (get-decoded-time))) (stringp (lisp-implementation-type)) (stringp (lisp-implementation-version)) (progn (sleep 0) 1)) l))) l))

;;; 345
(answer 345 (restart-case (invoke-restart 'r (with-open-stream (s (make-string-input-stream "1 2")) (list (read s) (read s) (read s nil :eof)))) (r (x) (list 'r x))))

;;; 346
(answer 346 (handler-bind ((error (lambda (c) (declare (ignore c)) (use-value (let ((h (make-hash-table :test 'equalp)) (l nil)) (setf (gethash "a" h) 1 (gethash (list least-positive-normalized-double-float least-negative-normalized-double-float) h) 2 (gethash "A" h) 3) (maphash (lambda (k v) (push (list k v) l)) h) (list (reverse l) (hash-table-test h) (hash-table-p h) (hash-table-p (when (list (numberp (let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) 11 . 12) (13 . 14) 15 16))) (list (caar x) (cadr x) (cdar x) (cddr x) (caaar x) (caadr x) (cadar x) (caddr x) (cdaar x) (cdadr x) (cddar x) (cdddr x)))) (realp (let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) (11) . 12) ((13) . 14) 15 16))) (list (caaaar x) (caaadr x) (caadar x) (caaddr x) (cadaar x) (cadadr x) (caddar x) (cadddr x)))) (rationalp (+)) (integerp (*)) (floatp (+)) (complexp (*))) (car '(3 1 2)))))))))) (restart-case (error "x") (use-value (v) (list 'used v)) (store-value (v) v))))

;;; 347
(answer 347 (handler-bind ((error (lambda (c) (declare (ignore c)) (store-value (length (eval-when (:execute :load-toplevel :compile-toplevel) (cdr '((1 . 2) 3)))))))) (restart-case (error "x") (store-value (v) (list 'stored v)))))

;;; 348
(answer 348 (handler-bind ((error #'continue)) (cerror "Go on." "bad ~a" 1) 'continued))

;;; 349
(answer 349 (multiple-value-list (with-simple-restart (r "Leave.") (invoke-restart (find-restart 'r)))))

;;; 350
(answer 350 (multiple-value-list (with-simple-restart (cl:abort "Leave.") (cl:abort))))

;;; 351
(answer 351 (handler-bind ((warning #'muffle-warning)) (warn "w ~a" (list (constantp (list (typep #\Z 'integer) (typep (restart-bind ((r (lambda (x) (list 'bound x)))) (list (restart-name (first (compute-restarts))) (invoke-restart 'r (list (cl:signal 'condition) (typep (make-condition 'simple-warning) 'warning) (handler-case (cl:signal 'simple-condition) (condition () 'got)))))) '(or symbol string)) (typep (1- 1000003) '(integer 0 255)) (typep (list (equal '(5 -5 5) '(3 1 2)) (equalp (let ((*print-length* 2) (*print-level* 1)) (prin1-to-string '(1 (2 (3)) 4 5))) (string-upcase (format nil "a~10tb~5@tc~%~2,4td" ))) (equalp 1 1.0) (equalp #(1 2 3) (vector 4 3 2 1))) '(member a foo 1)) (typep (loop for (a . b) in '((a . 1) (b . 2)) when a collect (list a b) else collect 'none) '(and atom (not null))) (typep (list (parse-integer "ff" :radix 16) (parse-integer " 12 x" :junk-allowed t) (parse-integer "a12b" :start 1 :end 3)) 'sequence) (typep (logcount -100000000000000000000) '(satisfies evenp)))) (constantp 'x) (constantp ''x) (special-operator-p 'if) (special-operator-p 'car) (compiled-function-p #'car) (functionp #'car) (functionp 'car))) 'warned))

;;; 352
(answer 352 (restart-bind ((r (lambda (x) (list 'bound x)))) (list (restart-name (first (compute-restarts))) (invoke-restart 'r (list (scale-float 1.5 5) (float-radix (sqrt 2.0)) (float-sign -2.25) (float-sign 1.0e10 2.0) (float-digits 0.0) (float-precision -2.25))))))

;;; 353
(define-condition c353 (error) ((a :initarg :a :initform 5 :reader c353-a)) (:report (lambda (c s) (format s "c ~a" (c353-a c)))))
(answer 353 (handler-case (error 'c353 :a (handler-case (/ 12 0) (arithmetic-error (c) (list (arithmetic-error-operation c) (second (arithmetic-error-operands c)))))) (c353 (c) (list (c353-a c) (princ-to-string c)))))

;;; 354
(answer 354 (list (cl:signal 'condition) (typep (make-condition 'simple-warning) 'warning) (handler-case (cl:signal 'simple-condition) (condition () 'got))))

;;; 355
(answer 355 (handler-case (cl:assert (= 1 (gcd))) (error () 'assertion)))

;;; 356
(answer 356 (let ((x 5)) (handler-bind ((error (lambda (c) (declare (ignore c)) (invoke-restart 'store-value 12)))) (ccase x (1 'one) (12 'twelve) (255 'byte) ((0 -7 3) 'other)))))

;;; 357
(answer 357 (let ((x 'a)) (handler-bind ((error (lambda (c) (declare (ignore c)) (invoke-restart 'store-value 7)))) (ctypecase x (integer (list 'integer x))))))

;;; 358
(answer 358 (handler-case (unbound-function358 (list least-positive-normalized-single-float least-positive-normalized-short-float least-positive-normalized-long-float least-negative-normalized-single-float least-negative-normalized-short-float least-negative-normalized-long-float)) (undefined-function (c) (cell-error-name c))))

;;; 359
(answer 359 (handler-case (read-from-string "(1 2") (end-of-file (c) (streamp (stream-error-stream c)))))

;;; 360
(answer 360 (error (let ((s (make-string-output-stream))) (format s "~a" (let ((h (make-hash-table)) (l nil)) (setf (gethash 1 h) 'a (gethash 2 h) 'b) (with-hash-table-iterator (next h) (loop (multiple-value-bind (more k v) (next) (if more (push (cons k v) l) (return))))) (reverse l))) (finish-output s) (force-output s) (clear-output s) (list (get-output-stream-string s) (get-output-stream-string s)))))

;;; 361
(answer 361 (loop for x in (last (nbutlast (list 3 1 2) 2) 3) for i from 0 collect (list i x)))

;;; 362
(answer 362 (loop for x across #(3 1 2) sum x into s count (oddp x) into c maximize x into m finally (return (list s c m))))

;;; 363
(answer 363 (loop for i from 1 to 1 append (list i i)))

;;; 364
(answer 364 (loop for i downfrom 5 to 2 by 2 collect i))

;;; 365
(answer 365 (loop for (a . b) in '((a . 1) (b . 2)) when a collect (list a b) else collect 'none))

;;; 366
(answer 366 (loop for x on (list (denominator 22/7) (dpb (numerator 1/2) (byte 7 0) (signum 255)) -7) by #'cddr nconc (list (length x))))

;;; 367
(answer 367 (loop with a = 4611686018427387903 and b = (let ((s 0)) (dolist (x (append '(5 -5 5) (list 1 -7 0)) (list s x)) (incf s x))) repeat 3 collect a collect b))

;;; 368
(answer 368 (loop for x = 1 then (* x 2) while (< x 50) until (> x 2) collect x))

;;; 369
(answer 369 (list (loop for x in (copy-list nil) always (numberp x)) (loop for x in (reverse (nreverse (list 1 2 2 1))) never (eql x 2)) (loop for x in (nthcdr 1 (cons (signum -100000000000000000000) (nreverse (list 1 2 2 1)))) thereis (and (> x 2) x))))

;;; 370
(answer 370 (loop named outer for i from 0 do (loop for j to 3 do (when (> (+ i j) 5) (return-from outer (list i j))))))

;;; 371
(answer 371 (loop for x in (cons 1 '(3 1 2)) if (evenp x) sum x into e and collect x into l else minimize x into m end finally (return (list e l m))))

;;; 372
(answer 372 (loop initially (princ 'start) for c across "abc" do (when (char= c #\b) (loop-finish)) (princ c) finally (princ 'end)))

;;; 373
(answer 373 (let ((n 0)) (loop (when (> (incf n) 5) (return n)))))

;;; 374
(answer 374 (with-output-to-string (s) (write-string (format nil "~w|~a ~:a ~:s" (list (position (rem 1 7) (stable-sort (vector 4 3 2 1) #'> :key #'-)) (position-if #'oddp (substitute 0 4611686018427387903 (delete 4611686018427387903 (list 3 1 2)))) (position-if-not #'oddp (nsubstitute-if 12 #'evenp (vector 4 3 2 1))) (position 1 '(1 2 1 3) :from-end t :end 2)) nil nil nil) s) (write-char (char-downcase (char-upcase #\5)) s) (terpri s) (prin1 (list (multiple-value-list (decode-universal-time 3600000000 0)) (encode-universal-time 5 4 3 2 1 2001 0)) s) (princ (list (sinh 1.0) (cosh 0.5) (tanh -0.25) (asinh -0.25) (acosh 1.5) (atanh 0.25)) s) (print (list (sinh 1.0) (cosh -0.25) (tanh 1.0) (asinh -0.25) (acosh 1.5) (atanh 0.25)) s) (fresh-line s) (write-line "abc" s) (write (let* ((a (make-random-state t)) (b (make-random-state a))) (equal (list (random 1000 a) (random 1000 a)) (list (random 1000 b) (random 1000 b)))) :stream s)))

;;; 375
(answer 375 (with-input-from-string (s "one two (3 4) x") (list (read s) (read-char s) (peek-char nil s) (unread-char (read-char s) s) (read-line s) (read-line s nil 'eof) (read s nil 'end))))

;;; 376
(answer 376 (let ((s (make-string-input-stream "ab cd"))) (list (read-preserving-whitespace s) (read-char-no-hang s) (peek-char t s) (listen s) (input-stream-p s) (output-stream-p s) (streamp s) (open-stream-p s) (close s))))

;;; 377
(answer 377 (let ((s (make-string-output-stream))) (format s "~a" (multiple-value-list (parse-integer "-17"))) (finish-output s) (force-output s) (clear-output s) (list (get-output-stream-string s) (get-output-stream-string s))))

;;; 378
(answer 378 (list (read-from-string "#(1 2 #\\a)") (multiple-value-list (read-from-string "a b" t nil :start 1))))

;;; 379
(answer 379 (progn (print (list (svref #(1 2 3 4 5 6) 3) (aref #(3 1 2 1) 0))) (prin1 (let ((h (make-hash-table))) (list (integerp (hash-table-size h)) (realp (hash-table-rehash-size h)) (realp (hash-table-rehash-threshold h)) (= (sxhash "ab") (sxhash (copy-seq "ab")))))) (princ nil) (terpri) (write-line "x") (fresh-line) (format t "~a~%" (funcall (constantly (gcd)) 0)) 'printed))

;;; 380
(answer 380 (with-open-stream (s (make-string-input-stream "1 2")) (list (read s) (read s) (read s nil :eof))))

;;; 381
(answer 381 (read-char (make-string-input-stream "")))

;;; 382
(answer 382 (list (streamp *standard-output*) (streamp *standard-input*) (streamp *error-output*) (streamp *trace-output*) (streamp *terminal-io*) (streamp *query-io*) (streamp *debug-io*) *print-base* *read-base* *read-default-float-format* (consp *features*)))

;;; 383
(answer 383 (format nil "~a|~s|~10a|~10@a|~va" (string< "abc" "xabd" :start2 1) (let ((l '(1 2 3 4 5 6 7 8 9 10 11))) (list (sixth l) (seventh l) (eighth l) (ninth l) (tenth l))) 'foo nil 1 'v))

;;; 384
(answer 384 (format nil "~d|~5d|~5,'0d|~:d|~@d|~b|~o|~x|~3r" (logior (integer-length (* 1000003 -7)) (gcd)) (- (isqrt (abs (logand 1000003 4611686018427387903))) 12) 5 (isqrt (abs 1)) -100000000000000000000 (integer-length 255) (mod (gcd (* 1000003 -100000000000000000000) (logxor 1 -7 (gcd))) 2) (+ (lcm (ldb (byte 1 0) 12) 255) (ash (1- 1) (- 0))) (abs (gcd (- 12 -7) (numerator 1/2)))))

;;; 385
(answer 385 (format nil "~f|~,2f|~8,3f|~e|~,3e|~$|~g" 0.5 1.0 -0.25 0.5 0.5 0.5 0.5))

;;; 386
(answer 386 (format nil "~r|~:r|~@r" 2 3 3))

;;; 387
(answer 387 (format nil "~{~a~^, ~}|~:{<~a ~a>~}|~@{~a~}" '(3 1 2) '((1 2) (3 4)) (loop for i from 1 to 1 append (list i i)) (list (map-into (copy-seq #()) #'1+ (remove-if-not #'plusp (remove 1000003 (sort (vector 4 3 2 1) #'>)))) (map-into (copy-list (list* 4611686018427387903 '(1 2 3 4 5))) #'+ (remove-duplicates (remove 255 (delete-if-not #'plusp (list 1 2 2 1))) :from-end t) (stable-sort (list 3 1 2) #'< :key #'abs)))))

;;; 388
(answer 388 (format nil "~[zero~;one~:;many~]|~:[no~;yes~]|~@[x=~a~]" 3 nil ':key))

;;; 389
(answer 389 (format nil "~(~a~)|~:(~a~)|~@(~a~)|~:@(~a~)" (string-trim "a Z" (let ((*print-array* nil) (*print-gensym* nil)) (write-to-string (make-symbol "X")))) (let ((*print-length* 2) (*print-level* 1)) (prin1-to-string '(1 (2 (3)) 4 5))) (nstring-downcase (copy-seq "ABC") :end 2) (let ((*print-case* :downcase) (*print-escape* nil)) (write-to-string '(Foo "x" |Bar|)))))

;;; 390
(answer 390 (format nil "~a ~*~a|~2:*~a" 1 2 (nstring-downcase (copy-seq "ABC") :end 2) 4))

;;; 391
(answer 391 (format nil "~d item~:p|~d cit~:@p|~p" 2 0 3))

;;; 392
(answer 392 (format nil "~c|~:c|~@c|~?|~%~&~~|~|" (char-downcase (char-downcase #\a)) (code-char (+ 65 2)) (char-downcase #\-) "~a-~a" (list (multiple-value-list (parse-integer "12")) (list (typep (let ((s (copy-symbol 'foo)) (u (gentemp))) (list (symbol-name s) (eq s 'foo) (symbolp u) (integerp *gensym-counter*))) 'integer) (typep (or t (parse-integer "1x2")) '(or symbol string)) (typep 0 '(integer 0 255)) (typep (multiple-value-list (decode-float 0.0)) '(member a foo 1)) (typep (case 255 ((0 1) 'low) (255 'byte) (otherwise (list (consp (list (< most-positive-fixnum (expt 2 62)) (> most-negative-fixnum (- (expt 2 63))))) (atom (let ((x '((((1 . 2) 3 . 4) (5 . 6) 7 . 8) ((9 . 10) (11) . 12) ((13) . 14) 15 16))) (list (caaaar x) (caaadr x) (caadar x) (caaddr x) (cadaar x) (cadadr x) (caddar x) (cadddr x)))) (listp (list most-positive-double-float (< -1.0e-300 least-negative-double-float 0 least-positive-double-float 1.0e-300) most-negative-double-float double-float-epsilon double-float-negative-epsilon)) (null (list least-positive-normalized-double-float least-negative-normalized-double-float)) (endp '(1 2 3 4 5)) (not (let ((l '(1 2 3 4 5 6 7 8 9 10 11))) (list (sixth l) (seventh l) (eighth l) (ninth l) (tenth l))))))) '(and atom (not null))) (typep (let ((s (list 1 2 3 4))) (setf (subseq s 1 3) (sort (vector 4 3 2 1) #'<)) s) 'sequence) (typep (ash 1000003 (- 1)) '(satisfies evenp))))))

;;; 393
(answer 393 (format nil "a~10tb~5@tc~%~2,4td" ))

;;; 394
(answer 394 (format nil "~10<~a~>|~10:<~a~>|~10@<~a~>|~12<~a~;~a~;~a~>" 'a ':key 'foo 'a 'b 'c))

;;; 395
(answer 395 (format nil "~w|~a ~:a ~:s" (handler-bind ((error (lambda (c) (declare (ignore c)) (store-value (fill (list 1 2 3 4 5 6) (prog* ((x 4611686018427387903) (y (list x))) (return (list x y))) :start 1 :end 3))))) (restart-case (error "x") (store-value (v) (list 'stored v)))) nil nil nil))

;;; 396
(answer 396 (format nil (formatter "~a+~a") (let ((c (cons 1 2))) (rplaca c (do ((i 0 (1+ i)) (l nil (cons i l))) ((= i 5) l))) (rplacd c (loop for (a . b) in '((a . 1) nil (c . 3)) when a collect (list a b) else collect 'none)) c) (list (subst (subseq (remove-if-not (lambda (x) (> x 2)) (nsubstitute-if 255 (lambda (x) (> x 2)) (vector 4 3 2 1))) 3) 'b '(a (b . c) (d (e)))) (subst-if 0 #'symbolp '(a (b . c) (d (e)))) (subst-if-not 0 #'consp '(a (b . c) (d (e)))))))

;;; 397
(answer 397 (format nil "~#[none~;one ~a~:;several~]" (let ((s (copy-symbol 'foo)) (u (gentemp))) (list (symbol-name s) (eq s 'foo) (symbolp u) (integerp *gensym-counter*)))))

;;; 398
(answer 398 (format nil "~a"))

;;; 399
(answer 399 (list (multiple-value-list (decode-universal-time 3600000000 0)) (encode-universal-time 5 4 3 2 1 2001 0)))

;;; 400
(answer 400 (list (integerp (get-universal-time)) (integerp (get-internal-real-time)) (integerp (get-internal-run-time)) (integerp internal-time-units-per-second) (length (multiple-value-list (get-decoded-time))) (stringp (lisp-implementation-type)) (stringp (lisp-implementation-version)) (progn (sleep 0) 1)))

;;; 401
(answer 401 (let ((*trace-output* (make-string-output-stream))) (time (let ((a (make-array '(2 3) :initial-contents '((1 2 3) (4 5 6))))) (list (aref a 1 2) (array-rank a) (array-dimension a 1) (array-dimensions a) (array-total-size a) (row-major-aref a 4) (array-row-major-index a 1 1) (array-in-bounds-p a 2 0) (setf (aref a 0 0) (ecase -100000000000000000000 (1 'one) (12 'twelve))) a)))))
