//! Programs that are bad for a tier of machine code: code that piles up, code that is too long, numbers that
//! leave their kind in a loop; those about calls are in `tier_calls`.

use std::process::Command;

use esl::Config;
use esl::host::VirtualHost;
use esl::program::{self, Program, Source};
use esl_vm::vm::Tier;
use libtest_mimic::{Failed, Trial};

use super::tier_calls::CALLS;
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
const CASES: [(&str, &str); 11] = [
    (
        "calls whose second words look like instructions, before the end of a loop",
        "(dotimes (i 3000) (finish-output)) (loop repeat 3000 do (finish-output *standard-output*))
         (print (let ((s (make-string-output-stream))) (dotimes (i 3000 (length (get-output-stream-string s)))
                  (princ i s) (finish-output s))))",
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
        "hash tables that are changed while objects are marked",
        "(defun fill-up (table n)
           (dotimes (i n) (setf (gethash i table) (list i (* i 0.5) (format nil \"~d\" i)))))
         (defun move (table n)
           (let ((kept nil))
             (dotimes (i n kept)
               (let ((key (- n i 1)))
                 (push (gethash key table) kept)
                 (setf (gethash key table) key)
                 (incf (gethash key table) 7)))))
         (defun check (table kept n)
           (let ((wrong 0))
             (dotimes (i n wrong)
               (let ((item (pop kept)))
                 (unless (and (eql (first item) i) (= (second item) (* i 0.5)) (eql (+ i 7) (gethash i table))
                              (string= (third item) (format nil \"~d\" i)))
                   (incf wrong))))))
         (dotimes (k 12)
           (let ((table (make-hash-table)) (n (+ 3000 (* 500 k))))
             (fill-up table n)
             (print (check table (move table n) n))))",
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
        "special variables while doubles are unspilled",
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
    let cases = CASES.iter().chain(&CALLS).map(|&(name, text)| {
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
                "tiers bad case: a hot function that collects all the time",
                a_collection_forgets_no_hot_function,
            ),
            Trial::test(
                "tiers bad case: a loop whose time is that of a builtin",
                what_a_builtin_takes_makes_no_function_hot,
            ),
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

/// Returns how many functions became machine code because they were hot.
fn hot_functions(text: &str) -> Result<usize, Failed> {
    let config = Config { memory: 8 << 20, ..Config::default() };
    let mut machine = program::machine(config, Box::new(VirtualHost::new()))?;
    machine.set_tier(Tier::Auto);
    program::run_in(&mut machine, &compile(text)?)?;
    Ok(machine.tier().1.functions)
}

/// Between two collections the function takes a part of the ticks that make it hot.
fn a_collection_forgets_no_hot_function() -> Result<(), Failed> {
    // The thread that makes machine code may not get to it at once.
    for iterations in [100_000, 400_000, 1_600_000] {
        let text = format!(
            "(defun churn (n) (let ((kept nil)) (dotimes (i n) (setq kept (make-array 100))) kept))
             (churn {iterations})"
        );
        if hot_functions(&text)? > 0 {
            return Ok(());
        }
    }
    Err("no machine code was made".into())
}

fn what_a_builtin_takes_makes_no_function_hot() -> Result<(), Failed> {
    let text = "(defvar *all* (make-array 100000))
         (dotimes (i 2000) (fill *all* i))";
    match hot_functions(text)? {
        0 => Ok(()),
        functions => Err(format!("machine code of {functions} functions").into()),
    }
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
