//! Tests of lowering, on core trees in a notation of their own.

mod listing;
mod notation;

use super::{SourceLines, lower};
use listing::listing;

/// The listing of what a form is lowered to.
fn code(text: &str) -> String {
    let core = notation::core(text);
    let module = lower(&core, &SourceLines::new()).expect("a form that fits");
    listing(&module)
}

#[test]
fn smoke() {
    for text in [
        "(defun fib (n) (if (< n 2) n (+ (fib (- n 1)) (fib (- n 2)))))",
        "(defun tak (x y z) (if (< y x) (tak (tak (- x 1) y z) (tak (- y 1) z x) (tak (- z 1) x y)) z))",
        "(defun sum (n) (let ((i 0) (s 0)) (tagbody top (if (< i n) nil (go end)) (setq s (+ s i)) (setq i (+ i 1)) (go top) end) s))",
        "(defun adder (n) (lambda (x) (+ x n)))",
        "(defun counter (n) (lambda () (setq n (+ n 1))))",
        "(defun run (n) (labels ((lp (i acc) (if (= i 0) acc (lp (- i 1) (+ acc i))))) (lp n 0)))",
        "(defun evenly (n) (labels ((ev (n) (if (= n 0) t (od (- n 1)))) (od (n) (if (= n 0) nil (ev (- n 1))))) (ev n)))",
        "(defun f (&optional (a 1 ap) &key (b (+ a 1)) c) (list a ap b c))",
        "(unwind-protect (foo) (bar))",
        "(list (unwind-protect (foo) (bar)))",
        "(block b (map-it (lambda (x) (return-from b x))))",
        "(handler-case (foo) (error (c) (bar c)) (warning () 2))",
        "(let ((*x* 1)) (foo))",
        "(multiple-value-bind (a b) (floor 7 2) (list b a))",
        "(tagbody (map-it (lambda (x) (go out))) (foo) out (bar))",
        "(defun sorted (l) (let ((l l)) (tagbody top (if (null l) (go end)) (foo (car l)) (setq l (cdr l)) (go top) end)))",
    ] {
        println!("{text}\n{}", code(text));
    }
}
