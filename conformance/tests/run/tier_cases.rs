//! Programs that are bad for a tier of machine code: functions that change while they run as such, code that
//! piles up, code that is too long, recursion that is too deep, numbers that leave their kind in a loop.

use std::process::Command;

use esl::Config;
use esl::host::VirtualHost;
use esl::program::{self, Program, Source};
use esl_vm::vm::Tier;
use libtest_mimic::{Failed, Trial};

use super::tiers::{compare, run_anyhow};

/// The test that runs in a process of its own, since what it asks of the system lasts as long as the process.
const NO_EXECUTABLE_MEMORY: &str = "tiers bad case: a host that forbids executable memory";

/// Variable of the environment of that process.
const IS_FORBIDDEN: &str = "ESL_EXECUTABLE_MEMORY_IS_FORBIDDEN";

/// Has the system refuse to make memory executable (`PR_SET_MDWE`), which holds for what is executed too.
/// Exit status 77 if the system does not know that.
const FORBID: &str = "
import ctypes, os, sys
if ctypes.CDLL(None).prctl(65, 1, 0, 0, 0) != 0:
    sys.exit(77)
os.execv(sys.argv[1], sys.argv[1:])
";

/// Name and text of each.
const CASES: [(&str, &str); 17] = [
    (
        "functions redefined while they run",
        "(defun step-of (x) (+ x 1))
         (defun walk (n)
           (let ((sum 0))
             (dotimes (i n)
               (setq sum (+ sum (step-of i)))
               (when (= i 300) (setf (symbol-function 'step-of) (lambda (x) (+ x 2.5))))
               (when (= i 600) (setf (symbol-function 'step-of) (lambda (x &optional y) (list x y) 3)))
               (when (= i 700) (setf (symbol-function 'walk) (lambda (n) (list :other n)))))
             sum))
         (print (walk 100)) (print (walk 1000)) (print (walk 5))
         (defun again (n)
           (when (= n 40) (setf (symbol-function 'again) (lambda (n) (list :new n))))
           (if (= n 0) :old (again (- n 1))))
         (print (again 100)) (print (again 3))",
    ),
    (
        "small functions within each other",
        "(defun id (x) x)
         (defun both (x) (values x (list x)))
         (defun none () (values))
         (defun tail (x y) (list y x))
         (defun third-of (x) (floor x 3))
         (defun in-place (x) (third-of (+ x 1)))
         (defun given (f x) (funcall f x))
         (defun two (x y) (+ (id x) (id y)))
         (defun four (x y) (* (two x 0.5) (two (id y) x)))
         (defun eight (x y) (- (four x y) (four y x)))
         (defun looked-up (table x) (gethash x table :none))
         (defun closed (f) (funcall f))
         (defun failing (x) (if (= x 77) (error \"no ~a\" x) (- x 0.5)))
         (let ((count 0)) (defun counted (x) (incf count x) count))
         (defvar *level* 0.5)
         (defun bound (x) (let ((*level* (+ *level* x))) (two *level* x)))
         (defun even-p (n) (if (= n 0) t (odd-p (- n 1))))
         (defun odd-p (n) (if (= n 0) nil (even-p (- n 1))))
         (defun run (n)
           (let ((sum 0.0) (seen nil) (table (make-hash-table)))
             (setf (gethash 3 table) 0.25)
             (dotimes (i n)
               (setq sum (+ (* sum 0.5) (eight sum i) (in-place i) (bound 0.25)))
               (setq seen (tail (both (none)) (given #'id (looked-up table i))))
               (setq sum (+ (handler-case (failing i) (error () (* sum 0.25))) (id (counted 1)) (* sum 0.001)))
               (when (even-p (mod i 9)) (setq seen (cons (closed (lambda () sum)) (id seen))))
               (when (< 1.0e200 sum) (setq sum 1.0)))
             (list sum seen)))
         (print (run 3)) (print (run 200)) (print (multiple-value-list (both 1)))",
    ),
    (
        "calls with arguments that are put in order",
        "(defun opt (a &optional (b 0.5) c) (list a b c))
         (defun rest-of (a &rest others) (if others (list a others) a))
         (defun keys (a &key (b (* a 0.5)) ((:d c) 7 c-p) &allow-other-keys) (list a b c c-p))
         (defun strict (&key x) x)
         (defun tail-opt (a) (opt a))
         (defun tail-rest (a b c) (rest-of a b c))
         (defun tail-keys (a b) (keys (* a 1.5) :d b :d 9))
         (defun given (f x) (funcall f x x))
         (defun deep (n &optional (x 0.5)) (if (= n 0) x (+ 0.25 (deep (- n 1) (* x 1.0)))))
         (defun run (n)
           (let ((sum 0.0) (seen nil))
             (dotimes (i n)
               (setq sum (+ (* sum 0.5) (second (opt i)) (rest-of (* sum 0.25))))
               (setq seen (list (opt i sum) (opt i sum nil) (rest-of i sum seen) (keys sum) (keys i :b sum)
                                (keys i :e 3 :d sum) (tail-opt sum) (tail-rest i sum i) (tail-keys sum i)
                                (given #'opt sum) (given #'rest-of i) (strict) (strict :x sum)))
               (setq seen (list i (equal seen (copy-tree seen)) (nth (mod i 13) seen)))
               (when (= 0 (mod i 40))
                 (setq seen (list (handler-case (opt) (error (e) (type-of e)))
                                  (handler-case (opt 1 2 3 4) (error (e) (type-of e)))
                                  (handler-case (strict :y sum) (error (e) (type-of e)))
                                  (handler-case (strict :x) (error (e) (type-of e)))
                                  (apply #'rest-of (make-list 30 :initial-element sum))))))
             (list sum seen)))
         (dotimes (i 45) (print (run i))) (print (run 300)) (print (deep 3000))
         (defun many (&rest all) (length all))
         (defun long (n) (let ((sum 0)) (dotimes (i n) (incf sum (many i i i i i i i i i i i i i i i i i i i i)))
                              sum))
         (print (long 100))",
    ),
    (
        "calls that want other numbers of values than one",
        "(defun one (x) (* x 0.5))
         (defun none () (values))
         (defun three (x) (values x (* x 2.0) (list x)))
         (defun floored (x) (floor x 0.75))
         (defun pass-on (x) (three (one x)))
         (defun through (n x) (if (= n 0) (three x) (through (- n 1) (* x 1.0))))
         (defun protected (f x) (unwind-protect (funcall f x) (one x)))
         (defvar *level* 0)
         (defun bound (x) (let ((*level* (+ *level* 1))) (three x)))
         (defun self (n) (if (= n 0) (values 1 2) (multiple-value-bind (a b) (self (- n 1)) (values b (+ a n)))))
         (defun run (n)
           (let ((sum 0.0) (seen nil))
             (dotimes (i n)
               (multiple-value-bind (a b c d) (three sum)
                 (multiple-value-bind (q r) (floored (+ a i))
                   (setq sum (+ (* sum 0.25) b (car c) q r) seen d)))
               (setq seen (list (multiple-value-list (one sum)) (multiple-value-list (none))
                                (multiple-value-list (pass-on i)) (multiple-value-list (through 5 sum))
                                (multiple-value-list (protected #'three sum))
                                (multiple-value-list (protected #'one i)) (multiple-value-list (bound sum))
                                (multiple-value-list (self (mod i 7))) (multiple-value-list (protected #'floor i))
                                (multiple-value-call #'list (one sum) (three i) (none) (one 2))
                                (multiple-value-bind (a b) (none) (list a b))
                                (multiple-value-bind (a b c) (one sum) (list a b c))
                                (multiple-value-prog1 (one sum) (three sum)) *level*))
               (when (> sum 1.0e100) (setq sum 0.5)))
             (list sum seen)))
         (dotimes (i 40) (print (run i))) (print (run 400))",
    ),
    (
        "small functions of which one fails, sleeps, or is collected",
        "(defun nap (x) (sleep 1) x)
         (defun inner (x) (+ x 0.5 (nap 0.25)))
         (defun middle (x) (* 2.0 (inner (* x 0.5))))
         (defun outer (n) (let ((sum 0.0)) (dotimes (i n) (setq sum (+ sum (middle i)))) sum))
         (print (outer 40))
         (print (mapcar #'wait-for-task (list (spawn (outer 7)) (spawn (outer 9)))))
         (defun vector-of (x) (vector x (* x 2.0)))
         (defun first-of (v) (svref v 0))
         (defun kept (n)
           (let ((last nil) (sum 0.0))
             (dotimes (i n)
               (let ((v (vector-of (+ sum 0.5)))) (setq sum (first-of v) last v)))
             (list sum last)))
         (print (kept 2000))
         (defun small (x) (+ x 1))
         (defun caller (n) (let ((sum 0)) (dotimes (i n) (setq sum (small sum))) sum))
         (print (caller 50))
         (dotimes (i 30)
           (eval `(defun small (x) (+ x ,i)))
           (make-array 30000)
           (print (caller 50)))
         (print (handler-case (progn (fmakunbound 'small) (caller 3)) (error (e) (type-of e))))",
    ),
    (
        "recursion deeper than the frames of one entry",
        "(defun deep (n x) (if (= n 0) x (+ 0.5 (deep (- n 1) (* x 1.0)))))
         (print (deep 20000 1.0)) (print (deep 20000 2))
         (defun endless (x) (+ 1.5 (endless (+ x 1.5))))
         (print (handler-case (endless 0.0) (error (e) (type-of e))))",
    ),
    (
        "doubles that become something else in a loop",
        "(defun run (x y n)
           (let ((a x) (b y) (c 0.0))
             (dotimes (i n)
               (let ((d (* a b)) (e (- a b)))
                 (setq c (+ c d) a (+ (* a 1.5) e) b (- d e))))
             (list a b c)))
         (defun try (x y n) (print (handler-case (run x y n) (error (e) (type-of e)))))
         (try 1.0 2.0 5) (try 1.0 2.0 40) (try 0.0 -0.0 9) (try 1.0e-200 1.0e-100 9) (try 1/3 2.5 9)
         (try 1.0e150 1.0e150 9) (try 3 4 9) (try 2.0 nil 9) (try 1.0 2.0 5) (try -1.0e-300 1.0e300 60)",
    ),
    (
        "registers that hold doubles and other values by turns",
        "(defun turns (n)
           (let ((x 1.0) (seen nil) (sum 0.0))
             (dotimes (i n)
               (let ((y (* x 2.0)))
                 (cond ((= 0 (mod i 7)) (setq seen (cons y seen) x 1.0))
                       ((= 3 (mod i 7)) (let ((z (list x y))) (setq sum (+ sum (car z) (cadr z)))))
                       (t (let ((z (- y x))) (setq x (+ z 0.25))))))
               (when (< sum 0.0) (return :never)))
             (list x sum (length seen) (car seen))))
         (print (turns 10)) (print (turns 500)) (print (turns 501))
         (defun kept (n)
           (let ((x 0.5) (last nil))
             (dotimes (i n)
               (setq last (catch 'out
                            (setq x (* x 1.01))
                            (when (= 0 (mod i 3)) (throw 'out (list x)))
                            (setq x (+ x 0.125))
                            i)))
             (list x last)))
         (print (kept 4)) (print (kept 200))",
    ),
    (
        "roots of numbers of all kinds",
        "(defun roots (x n)
           (let ((sum 0.0) (y x))
             (dotimes (i n) (setq y (+ y 0.0) sum (+ sum (sqrt (* y 1.0)))) (setq y (- y 0.75)))
             sum))
         (print (roots 1000.0 100)) (print (roots 0.0 1)) (print (roots 3.0 20)) (print (roots 1.0e-290 3))
         (print (roots 1000 100)) (print (handler-case (roots nil 2) (error (e) (type-of e))))",
    ),
    (
        "vectors of doubles and of other values",
        "(defun scale (v by)
           (dotimes (i (length v)) (setf (svref v i) (* (svref v i) by)))
           (let ((sum 0.0)) (dotimes (i (length v)) (incf sum (svref v i))) sum))
         (defun of (&rest items) (coerce items 'simple-vector))
         (let ((v (of 1.0 2.0 3.5 -0.0)))
           (dotimes (i 50) (print (scale v 1.25))) (print (scale v 0.0)) (print (scale v -1.0)) (print v))
         (print (scale (of 1 2 3) 2.0)) (print (scale (of 1/2 1.0 3) 3))
         (print (handler-case (scale (of 1.0 :x 2.0) 2.0) (error (e) (type-of e))))
         (print (handler-case (scale (list 1.0) 2.0) (error (e) (type-of e))))",
    ),
    (
        "loads among operations on doubles",
        "(defun of (&rest items) (coerce items 'simple-vector))
         (defun mix (v w n)
           (let ((sum 0.0) (x 1.0) (y 0.5))
             (dotimes (i n)
               (let* ((a (svref v i)) (dx (- x a)) (b (svref w i)) (dy (* b dx)) (k 3) (other k)
                      (c (svref v 0)) (d (- (* c dy) y)) (same c) (e (* same 0.25)))
                 (setf (svref w i) d)
                 (setf (svref v i) (+ (svref v i) (* dx 0.5)))
                 (setq k (if (> d 100.0) d k))
                 (setq x (+ (* dx 0.5) e) y (- d (svref w 0)))
                 (setf (svref v (- n 1)) x (svref w (- n 1)) y)
                 (incf sum (+ (* d 0.125) (svref v i) y k other))))
             (list x y sum)))
         (defun try (v w n)
           (print (handler-case (mix v w n) (error (e) (type-of e)))) (print (list v w)))
         (defun doubles () (of 1.0 -2.5 0.0 4.0 0.125))
         (dotimes (i 40) (try (doubles) (of 0.5 1.5 -0.0 2.0 (* i 0.25)) (+ 1 (mod i 5))))
         (try (doubles) (doubles) 7) (try (of 1.0 2 3.0) (of 1.0 2.0 3) 3) (try (of 1/2 2.0) (of 2.0 1/3) 2)
         (try (of 1.0e150 1.0e-150 3.0) (of 1.0e150 1.0e-140 1.0e200) 3)
         (try (of 1.0e300 1.0) (of 1.0e300 1.0) 2)
         (try (of 1.0 nil 2.0) (doubles) 3) (try (doubles) (of 1.0 2.0 :x) 3) (try (list 1.0) (doubles) 1)
         (try (doubles) nil 1) (dotimes (i 70) (try (of 1 2 3) (of 1.0 2.0 3.0) 3))
         (try (doubles) (doubles) 5)",
    ),
    (
        "calls whose windows held doubles",
        "(defun half (x) (* x 0.5))
         (defun pick (x i) (cond ((= 0 (mod i 11)) i) ((= 0 (mod i 17)) (list x)) (t (half x))))
         (defun calls (n)
           (let ((sum 0.0) (others nil))
             (dotimes (i n)
               (let ((a (* sum 0.5)) (b (pick (+ sum 1.0) i)))
                 (if (numberp b) (setq sum (+ (half (* a 1.5)) b (pick (- a b) (+ 1 (* 2 i))) ))
                     (setq others (list a (car b)) sum (half (+ a 1.0))))
                 (when (consp sum) (return (list :consp sum)))))
             (list sum others)))
         (defun try (n) (print (handler-case (calls n) (error (e) (type-of e)))))
         (dotimes (i 30) (try i)) (try 500)
         (defun safe (n)
           (let ((sum 0.0))
             (dotimes (i n)
               (setq sum (+ (* sum 0.5) (half (+ sum (half i)))))
               (when (= i 90) (setf (symbol-function 'half) (lambda (x) (* x 0.25)))))
             sum))
         (print (safe 20)) (print (safe 300))
         (setf (symbol-function 'half) (lambda (x &optional (by 0.75)) (* x by))) (print (safe 50))",
    ),
    (
        "special variables while doubles are kept back",
        "(defvar *x* 1.5) (defvar *y* 2) (defvar *z* 0.25) (defvar *free*)
         (defconstant +c+ 3.5)
         (defun turn (n)
           (let ((a 1.0) (b 0.5))
             (dotimes (i n)
               (setq a (* (+ a *x*) 0.5) b (- a *z*))
               (setq *z* (+ b 0.125))
               (when (= 0 (mod i 5))
                 (let ((*x* (+ *x* 0.5)) (*y* i))
                   (setq *x* (* *x* a) b (+ b *x*))
                   (when (= 0 (mod i 3)) (let ((*x* :other)) (setq *y* (list *y* *x*))))
                   (setq a (if (consp *y*) (- b a) (+ b *y*)))))
               (setq *y* (+ *y* 1)))
             (list a b *x* *y* *z*)))
         (print (turn 3)) (print (turn 100)) (let ((*z* -1.0)) (print (turn 100))) (print (turn 7))
         (defun read-free (n x)
           (let ((sum x)) (dotimes (i n) (setq sum (+ sum 1.5)) (incf sum *free*)) sum))
         (defun try (n) (print (handler-case (read-free n 0.5) (error (e) (type-of e)))))
         (try 3) (let ((*free* 2.5)) (try 100) (setq *free* 'a) (try 2)) (try 50) (setq *free* 1) (try 50)
         (defun set-constant (x) (setq x (* x 2.0)) (set '+c+ x) x)
         (dotimes (i 5) (print (handler-case (set-constant 1.0) (error (e) (type-of e)))))
         (defun deep (n) (if (= n 0) (list *x* *y*) (let ((*x* (+ *x* 1.0)) (*y* n)) (deep (- n 1)))))
         (print (deep 100)) (print (deep 2000)) (print (list *x* *y* *z*))",
    ),
    (
        "functions that call themselves",
        "(defun fib (n) (if (< n 2) n (+ (fib (- n 1)) (fib (- n 2)))))
         (print (list (fib 15) (fib 15.5) (fib 16)))
         (defun halves (x n) (if (= n 0) x (let ((y (* x 0.5))) (+ y (halves (+ y 0.25) (- n 1)) y))))
         (print (list (halves 1.0 10) (halves 3 10) (halves 1.0e300 40) (halves 1/3 5)))
         (defun deep (n) (if (= n 0) 0 (+ 1 (deep (- n 1)))))
         (print (list (deep 10) (deep 3000) (deep 100000)))
         (print (handler-case (deep -1) (serious-condition (e) (type-of e))))
         (defun lost (n) (if (= n 0) (car 5) (+ 1 (lost (- n 1)))))
         (dotimes (i 40) (handler-case (lost i) (type-error (e) (print (type-error-datum e)))))
         (defun sums (n) (if (< n 1) (values 0 0) (multiple-value-bind (a b) (sums (- n 1)) (values (+ a n) b))))
         (print (multiple-value-list (sums 200)))
         (defun new-self (n)
           (when (= n 30) (setf (symbol-function 'new-self) (lambda (n) (list :new n))))
           (if (< n 1) (list n) (cons n (new-self (- n 1)))))
         (print (new-self 60)) (print (new-self 3))
         (defun counter (step)
           (labels ((count-down (n sum) (if (<= n 0) sum (+ step (count-down (- n step) (+ sum 0.5))))))
             #'count-down))
         (print (list (funcall (counter 2) 300 1) (funcall (counter 0.5) 100 1) (handler-case (funcall (counter 3) 30 'a) (error (e) (type-of e)))))",
    ),
    (
        "builtins called as functions",
        "(defun one (f x) (+ 0.5 (funcall f x 3)))
         (defun several (f x) (multiple-value-bind (a b c) (funcall f x 3) (list a b c)))
         (defun all (f x) (multiple-value-call #'list (funcall f x 3) (funcall f 3 x)))
         (defun tail (f x) (funcall f x 3))
         (defun call-through (f x) (let ((y (* x 1.5))) (list (tail f x) y)))
         (defun second-of (f x) (nth-value 1 (tail f x)))
         (defun calls (g f n)
           (let ((sum 0) (last nil))
             (dotimes (i n)
               (setq last (funcall g f i))
               (when (numberp last) (setq sum (+ sum last))))
             (list sum last)))
         (dolist (f (list #'+ #'floor #'list #'values #'cons #'funcall #'gethash #'1+ #'equal #'max
                          (lambda (x y) (values y x))))
           (dolist (g (list #'one #'several #'all #'tail #'call-through #'second-of))
             (print (handler-case (calls g f 200) (error (e) (type-of e))))))
         (defun on-long (f x y n) (let ((last nil)) (dotimes (i n) (setq last (funcall f x y))) last))
         (defun on-long-in-place (f x y) (funcall f x y))
         (let ((x (make-list 30000 :initial-element 1)) (y (make-list 30000 :initial-element 1)))
           (print (on-long #'equal x y 40))
           (dotimes (i 40) (on-long-in-place #'equal x y))
           (print (on-long-in-place #'equal x y))
           (print (let ((*print-length* 3)) (prin1-to-string (on-long #'append x y 5)))))
         (defun last-of (f n) (let ((list nil)) (dotimes (i n (car list)) (setq list (funcall f i list)))))
         (print (last-of #'cons 20000))
         (defun ends (f n) (dotimes (i n) (funcall f i)) :end)
         (print (ends #'identity 3000))
         (print (handler-case (ends #'car 3000) (type-error (e) (type-error-datum e))))
         (print (handler-case (ends #'error 300) (error (e) (type-of e))))",
    ),
    (
        "pairs of doubles and of other values",
        "(defun pairs (n)
           (let ((list nil) (x 1.0) (y 0.0))
             (dotimes (i n)
               (setq x (* x 1.01) y (+ y x))
               (setq list (cons (cons x i) (if (= 0 (mod i 50)) nil (cons y list))))
               (setq x (- x 0.001)))
             (list x y (length list) (car list) (cadr list))))
         (print (pairs 10)) (print (pairs 1000)) (print (pairs 30000))",
    ),
    (
        "doubles of frames that are left for good",
        "(defun inner (x n)
           (let ((a (* x 1.5)) (b (+ x 2.0)))
             (when (= n 0) (error \"enough\"))
             (+ (* a b) (inner (- a b) (- n 1)))))
         (defun outer (n)
           (let ((x 1.0) (failures 0))
             (dotimes (i n)
               (setq x (+ x 0.5))
               (handler-case (inner x (mod i 5)) (error () (setq x (* x 1.25)) (incf failures))))
             (list x failures)))
         (print (outer 3)) (print (outer 60))",
    ),
];

/// Returns the tests.
pub(super) fn trials() -> Vec<Trial> {
    let cases = CASES.iter().map(|&(name, text)| {
        Trial::test(format!("tiers bad case: {name}"), move || {
            let program = compile(text)?;
            for slice in [2000, 50, 1] {
                compare(&program, &Config { slice, memory: 64 << 20, ..Config::default() })?;
            }
            Ok(())
        })
    });
    cases
        .chain([
            Trial::test(
                "tiers bad case: a function that is too long",
                a_long_function_is_left_to_the_interpreter,
            ),
            Trial::test("tiers bad case: eval in a loop", machine_code_does_not_pile_up),
            Trial::test(
                "tiers bad case: an inlined function is collected",
                machine_code_goes_with_what_is_inlined,
            ),
            Trial::test(NO_EXECUTABLE_MEMORY, a_host_may_forbid_executable_memory),
        ])
        .collect()
}

fn compile(text: &str) -> Result<Program, Failed> {
    let compiled = program::compile(&[Source::new("case.esl", text.to_string())]);
    compiled.program.ok_or_else(|| format!("{:#?}\n{text}", compiled.diagnostics).into())
}

fn a_long_function_is_left_to_the_interpreter() -> Result<(), Failed> {
    let mut text = String::from("(defun long (x)\n");
    for number in 0..6000 {
        text += &format!("  (setq x (logand (+ x {}) 65535))\n", number % 100);
    }
    text += "  x)\n(dotimes (i 5) (print (long i)))\n";
    let program = compile(&text)?;
    compare(&program, &Config::default())
}

/// A machine that keeps the machine code of all that was ever evaluated would have a page for each.
fn machine_code_does_not_pile_up() -> Result<(), Failed> {
    const PAGE: usize = 4096;
    let text = "(defvar *sum* 0.0)
         (dotimes (i 250)
           (let ((f (eval `(lambda (x) (+ x ,(* i 0.5))))))
             (dotimes (k 3) (setq *sum* (+ (funcall f 1.0) *sum*))))
           (make-array 20000))
         (print *sum*)";
    let program = compile(text)?;
    let config = Config { memory: 48 << 20, ..Config::default() };
    compare(&program, &config)?;
    let mut machine = program::machine(config, Box::new(VirtualHost::new()))?;
    machine.set_tier(Tier::Native);
    program::run_in(&mut machine, &program)?;
    let report = &machine.tier().1;
    if report.bytes > (report.functions - 100) * PAGE {
        return Err(format!("nothing was given back: {report:?}").into());
    }
    Ok(())
}

/// Machine code in which a function is inlined that is no more would take another one at its address for it.
fn machine_code_goes_with_what_is_inlined() -> Result<(), Failed> {
    let bytes_if_kept = |keep: &str| -> Result<usize, Failed> {
        let text = format!(
            "(defvar *kept* nil)
             (setf (symbol-function 'small) (eval '(lambda (x) (+ x 1))))
             (defun caller (n) (let ((sum 0)) (dotimes (i n) (setq sum (small sum))) sum))
             (print (list (caller 5) (caller 5)))
             (setq *kept* {keep})
             (setf (symbol-function 'small) (lambda (x) (+ x 2)))
             (dotimes (i 250) (make-array 20000))"
        );
        let config = Config { memory: 48 << 20, ..Config::default() };
        let mut machine = program::machine(config, Box::new(VirtualHost::new()))?;
        machine.set_tier(Tier::Native);
        program::run_in(&mut machine, &compile(&text)?)?;
        Ok(machine.tier().1.bytes)
    };
    let (kept, collected) = (bytes_if_kept("#'small")?, bytes_if_kept("nil")?);
    if collected >= kept {
        return Err(format!("{collected} bytes of machine code, {kept} if the function is kept").into());
    }
    Ok(())
}

fn a_host_may_forbid_executable_memory() -> Result<(), Failed> {
    if std::env::var_os(IS_FORBIDDEN).is_some() {
        return all_is_left_to_the_interpreter();
    }
    let mut command = Command::new("python3");
    command.args(["-c", FORBID]).arg(std::env::current_exe()?).args(["--exact", NO_EXECUTABLE_MEMORY]);
    let Ok(output) = command.env(IS_FORBIDDEN, "1").output() else { return Ok(()) };
    let text = String::from_utf8_lossy(&output.stdout);
    match output.status.code() {
        Some(77) => Ok(()),
        Some(0) if text.contains("1 passed") => Ok(()),
        _ => Err(format!("{text}{}", String::from_utf8_lossy(&output.stderr)).into()),
    }
}

/// Each function is asked for and refused, or only the first; the program does not see it.
fn all_is_left_to_the_interpreter() -> Result<(), Failed> {
    let program = compile(
        "(defun add (x y) (+ x y))
         (defun sums (n) (let ((sum 0.0)) (dotimes (i n) (setq sum (add sum 0.5))) sum))
         (dotimes (i 20) (print (sums (* i 1000))))",
    )?;
    let config = Config::default();
    let (interpreted, _) = run_anyhow(&program, &config, Tier::Interpreter)?;
    for tier in [Tier::Native, Tier::Auto] {
        let (outcome, refused) = run_anyhow(&program, &config, tier)?;
        if outcome != interpreted {
            return Err(format!("interpreted {interpreted:#?}\n{tier:?} {outcome:#?}").into());
        }
        // With `auto` the answer of the other thread may come too late.
        if tier == Tier::Native && refused.is_none() {
            return Err("machine code was made where the system forbids it".into());
        }
    }
    Ok(())
}
