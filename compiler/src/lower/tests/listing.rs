//! Listings of lowered forms: one snapshot for each family of forms and each improvement, the source first.
//!
//! `INSTA_UPDATE=always cargo test -p esl-compiler lower` writes them again.

use super::code;

/// Compares the listings of some sources with the snapshot `name`.
fn check(name: &str, sources: &[&str]) {
    let listings: Vec<String> =
        sources.iter().map(|source| format!("{source}\n\n{}", functions(source))).collect();
    insta::with_settings!({ prepend_module_to_snapshot => false, omit_expression => true }, {
        insta::assert_snapshot!(name, listings.join("\n"));
    });
}

/// The listing; for a definition, without the code that defines.
fn functions(source: &str) -> String {
    let text = code(source);
    if !source.starts_with("(defun") {
        return text;
    }
    text.split_once("\n\n").map_or(text.clone(), |(_, functions)| functions.to_string())
}

#[test]
fn calls_begin_where_their_value_is_wanted() {
    check("calls", &["(defun fib (n) (if (< n 2) n (+ (fib (- n 1)) (fib (- n 2)))))", "(f (g 1 (h)) 2)"]);
}

#[test]
fn tests_do_not_make_booleans() {
    check(
        "tests",
        &[
            "(defun f (a b) (if (and (not (< a b)) (or (eq a 'x) (null b))) a b))",
            "(defun f (a) (if (let ((x (consp a))) x) 1 2))",
            "(defun f (a) (list (< a 5) (if (integerp a) t nil)))",
            "(defun f (a) (if (and t a) 1 2))",
        ],
    );
}

#[test]
fn values_of_and_and_or() {
    check("and-or", &["(defun f (a b) (or (g a) b 5))", "(defun f (a b) (list (and a (g b))))"]);
}

#[test]
fn arithmetic_takes_literals() {
    check(
        "arithmetic",
        &["(defun f (a b) (+ 1 a (* b 2) (- a) -3))", "(defun f (a b) (list (floor a) (floor a b)))"],
    );
}

#[test]
fn loops_turn_with_one_jump() {
    check(
        "loops",
        &[
            "(defun while (l) (let ((l l)) (tagbody top (if (null l) (go end)) (f (car l)) (setq l (cdr l)) (go top) end)))",
            "(defun until (l) (let ((l l)) (tagbody (go test) top (f l) (setq l (cdr l)) test (if (consp l) (go top)))))",
            "(defun count-up (n) (let ((i 0)) (tagbody top (if (< i n) nil (go end)) (f i) (setq i (+ i 1)) (go top) end)))",
            "(defun count-to (n) (let ((i 1)) (tagbody top (if (> i n) (go end)) (f i) (setq i (+ i 1)) (go top) end)))",
            "(defun down (n) (let ((i n)) (tagbody top (if (< i 0) (go end)) (f i) (setq i (- i 1)) (go top) end)))",
            "(tagbody top (go top))",
        ],
    );
}

#[test]
fn loops_keep_literals_in_registers() {
    check(
        "literals",
        &[
            "(defun clear (v j n) (tagbody top (if (> j n) (go end)) (%set-aref v j nil) (setq j (+ j 1)) (g 1 (* 2.5 j)) (go top) end))",
        ],
    );
}

#[test]
fn functions_called_from_one_place_become_loops() {
    check(
        "inlined",
        &[
            "(defun sum (n) (labels ((next (i sum) (if (= i 0) sum (next (- i 1) (+ sum i))))) (next n 0)))",
            "(labels ((even (n) (if (= n 0) t (odd (- n 1)))) (odd (n) (if (= n 0) nil (even (- n 1))))) (list (even 10)))",
            "(labels ((next (i) (note (lambda () i)) (next (+ i 1)))) (next 0))",
            "((lambda (x y) (f y x)) (g) 2)",
        ],
    );
}

#[test]
fn a_self_call_in_tail_position_is_a_jump() {
    check(
        "self-calls",
        &[
            "(defun gcd (a b) (if (= b 0) a (gcd b (mod a b))))",
            "(defun f (n) (g (lambda () (setq n (+ n 1)))) (f n))",
            "(labels ((walk (x) (if (consp x) (+ (walk (car x)) (walk (cdr x))) x))) (list (walk 1) (walk 2)))",
        ],
    );
}

#[test]
fn assignments_in_parallel_save_temporaries() {
    check(
        "parallel",
        &[
            "(defun f (a b) (let ((x (+ a b)) (y a)) (setq a x) (setq b y) nil) (list a b))",
            "(defun f (a b) (let* ((x (cdr a))) (setq b (+ b 1)) (setq a x) nil) (list a b))",
        ],
    );
}

#[test]
fn closures_take_values_and_boxes() {
    check(
        "closures",
        &[
            "(defun adder (n) (lambda (x) (+ x n)))",
            "(defun counter (n) (lambda () (setq n (+ n 1))))",
            "(defun f (n) (labels ((a () (list n (function b))) (b () (list (a) (function b)))) (list (a) (b))))",
            "(flet ((constant () 1)) (list (function constant) (constant)))",
        ],
    );
}

#[test]
fn parameters_with_defaults() {
    check(
        "parameters",
        &[
            "(defun f (a &optional (b (g a) given) c &rest r) (list a b given c r))",
            "(defun f (&key (a 1) (special *b*)) (g a))",
        ],
    );
}

#[test]
fn several_values() {
    check(
        "values",
        &[
            "(multiple-value-bind (a b) (floor 7 2) (list b a))",
            "(multiple-value-bind (a b) (if (f) (values 1 2) (g)) (values b a))",
            "(multiple-value-call (function list) (f))",
            "(multiple-value-call (function g) 1 (f) 2)",
            "(multiple-value-prog1 (f) (g))",
            "(values-list (f))",
            "(list (values) (values 1 (g)))",
        ],
    );
}

#[test]
fn blocks_jump_or_catch() {
    check(
        "blocks",
        &[
            "(list (block b (f (return-from b 1)) 2))",
            "(block b (let ((*x* 1)) (if (f) (return-from b (values 1 2))) (g)))",
            "(block b (map-it (lambda (x) (return-from b x))))",
            "(list (block b (unwind-protect (return-from b 1) (f))))",
        ],
    );
}

#[test]
fn tags_that_closures_go_to() {
    check("tags", &["(tagbody (map-it (lambda (x) (go out))) (f) out (g))"]);
}

#[test]
fn catch_and_throw() {
    check("catch", &["(list (catch 'a (f)))", "(catch (f) (g))", "(throw 'a (values 1 2))"]);
}

#[test]
fn cleanups() {
    check(
        "cleanups",
        &["(unwind-protect (f) (g))", "(list (unwind-protect (f) (g)))", "(unwind-protect (throw 'a 1) (f))"],
    );
}

#[test]
fn handlers_masks_and_scopes() {
    check(
        "handlers",
        &[
            "(handler-case (f) (error (c) (g c)) (warning () 2))",
            "(handlers (list 1) (f))",
            "(mask 1 (list (f)))",
            "(progv '(*a*) (list 1) (f))",
        ],
    );
}

#[test]
fn special_variables() {
    check(
        "specials",
        &["(let ((*a* *b*) (x 1) (*b* 2)) (setq *a* (f x)))", "(let* ((*a* 1) (*b* *a*)) (list (f)))"],
    );
}

#[test]
fn structures() {
    check(
        "structures",
        &["(set-slot point 0 p (slot point 1 p))", "(if (is-a point (f)) 1 2)", "(slot point 300 p)"],
    );
}

#[test]
fn places() {
    check(
        "places",
        &[
            "(let ((v (f))) (%set-svref v 0 (+ (svref v 0) 1)))",
            "(%set-aref (f) 1 (g))",
            "(progn (rplaca (f) 1) (rplacd (f) (%set-cdr (f) 2)))",
        ],
    );
}

#[test]
fn long_argument_lists() {
    let items: Vec<String> = (0..130).map(|i| i.to_string()).collect();
    let items = items.join(" ");
    for source in [
        format!("(list {items})"),
        format!("(vector {items})"),
        format!("(f {items})"),
        format!("(+ {items})"),
    ] {
        // Too long for a snapshot: it fits, and it verifies.
        super::module(&source);
    }
}

/// Checks that a form fits, and that all its code verifies.
fn fits(source: &str) {
    super::module(source);
}

#[test]
fn large_functions_are_divided() {
    let forms = |count: usize, form: &dyn Fn(usize) -> String| (0..count).map(form).collect::<String>();
    // Many forms, many variables, and all of them used at the end.
    fits(&format!("(defun f (x) {})", forms(10_000, &|i| format!("(g x {i})"))));
    fits(&format!(
        "(let* ({}) (list {}))",
        forms(300, &|i| format!("(v{i} (f))")),
        forms(300, &|i| format!("v{i} "))
    ));
    let variables = forms(600, &|i| format!("(v{i} (f))"));
    fits(&format!(
        "(let* ({variables}) (setq v500 v400) (g (lambda () v300)) (+ {}))",
        forms(600, &|i| format!("v{i} "))
    ));
    fits(&format!("(tagbody {} a (go a))", forms(10_000, &|i| format!("(if (g {i}) (go a))"))));
    // Deep on the right, where everything on the left waits in a register.
    fits(&format!("{} 1 {}", "(list (f) ".repeat(1000), ")".repeat(1000)));
    fits(&format!("{} 1 {}", "(unwind-protect (f) ".repeat(1000), ")".repeat(1000)));
    fits(&format!("{} 1 {}", "(catch 'a ".repeat(1000), ")".repeat(1000)));
}

#[test]
fn a_function_captures_any_number_of_variables() {
    let names = |text: &str| (0..300).map(|i| text.replace('#', &i.to_string())).collect::<String>();
    let lines = crate::lower::SourceLines::new();
    let one = format!("(let* ({}) (lambda () (list {})))", names("(v# (f))"), names("v# "));
    assert!(crate::lower::lower(&super::notation::core(&one), &lines).is_ok());
    let (open, close) = (names("(let ((v# (f)))"), ")".repeat(300));
    let nested = format!("{open} (lambda () (list {})) {close}", names("v# "));
    assert!(crate::lower::lower(&super::notation::core_in_big_stack(&nested), &lines).is_ok());
}

#[test]
fn deep_forms_need_little_native_stack() {
    let deep = |open: &str, close: &str| format!("{} 1 {}", open.repeat(5000), close.repeat(5000));
    let sources = [
        deep("(+ 1 ", ")"),
        deep("(car ", ")"),
        deep("(if (f) 2 ", ")"),
        deep("(progn (f) ", ")"),
        deep("(block b ", ")"),
        deep("(let ((x 1)) ", ")"),
        deep("(list ", ")"),
        deep("(lambda () ", ")"),
    ];
    let small = std::thread::Builder::new().stack_size(256 * 1024);
    let run = move || {
        for source in sources {
            let core = super::notation::core_in_big_stack(&source);
            let _ = crate::lower::lower(&core, &crate::lower::SourceLines::new());
        }
    };
    small.spawn(run).expect("a thread").join().expect("no overflow");
}

#[test]
fn literals_keep_their_sharing() {
    let constants = super::module("(list 'a 'a 1 1 \"s\" '(1 2) '(1 2))").constants;
    // A, 1, "s", and two lists of two pairs each, with NIL and 2.
    assert_eq!(constants.len(), 3 + 2 + 4);
}
