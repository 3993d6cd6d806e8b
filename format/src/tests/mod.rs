//! The rules, one by one.

mod promises;

use super::*;

fn styles(tree: &SyntaxTree) -> Styles {
    let mut styles = Styles::standard();
    styles.add_macros(tree, true);
    styles
}

#[track_caller]
fn formatted(text: &str) -> String {
    let tree = SyntaxTree::new(text);
    format(&tree, &styles(&tree), None).unwrap_or_else(|error| panic!("{error}: {text}"))
}

fn indented(text: &str) -> String {
    let tree = SyntaxTree::new(text);
    Edit::apply(text, &indent_edits(&tree, &styles(&tree), None))
}

/// Checks that a text is formatted already, and that it comes back when its indentation is taken away.
#[track_caller]
fn check(text: &str) {
    assert_eq!(formatted(text), text);
    let flat: String = text.lines().flat_map(|line| [line.trim_start(), "\n"]).collect();
    assert_eq!(formatted(&flat), text);
    assert_eq!(indented(&flat), text);
}

/// Checks what a text becomes, and that it stays so.
#[track_caller]
fn becomes(text: &str, expected: &str) {
    assert_eq!(formatted(text), expected);
    assert_eq!(formatted(expected), expected);
}

#[test]
fn calls_stand_under_their_first_argument() {
    check("(move-arm left\n          (+ 1\n             2)\n          right)\n");
    check("(move-arm\n left\n right)\n");
    check("(a:move-arm left ; quickly\n            right)\n");
}

#[test]
fn bodies_are_two_columns_in_and_distinguished_arguments_four() {
    check("(when (ready-p)\n  (go-on)\n  (stop))\n");
    check("(multiple-value-bind\n    (a b)\n    (floor 7 2)\n  (list a\n        b))\n");
    check("(defun f (a &key\n          b)\n  \"Text.\"\n  (list a b))\n");
    check("(unwind-protect\n     (work)\n  (clean-up))\n");
    check("(if (ready-p)\n    (go-on)\n    (stop))\n");
}

#[test]
fn clauses_are_indented_by_their_operators() {
    check("(cond ((ready-p)\n       (go-on))\n      (t\n       (stop)))\n");
    check("(cond ((ready-p) (go-on)\n       (rest))\n      (t (stop)\n         (rest)))\n");
    check("(spawn (:name 'a)\n  (work)\n  (rest))\n");
    check("(defmacro define-rows (&rest rows))\n(define-rows\n  (a (b)\n    c))\n");
    check("(f a :b c\n     ;; D\n     :d e)\n");
    check("(f '(:a (b)\n     :c d))\n(f (:a (b)\n    :c d))\n");
    check("(case key\n  ((a b)\n   (list a\n         b))\n  (t\n   nil))\n");
    check("(handler-case (work)\n  (error (problem)\n    (report problem)))\n");
    check("(let ((a 1)\n      (b\n        2))\n  (+ a b))\n");
    check("(flet ((twice (x)\n         (* 2 x)))\n  (twice 3))\n");
    check(
        "(with-recovery-procedures\n    (((:stuck name) :retries 3\n       (hit name)\n       (retry)))\n  (work))\n",
    );
    check("(or-parallel\n  (first-way\n    (work))\n  (other-way (rest)))\n");
}

#[test]
fn clauses_of_loops_stand_under_each_other() {
    check(
        "(loop for x in list\n      when (oddp x)\n        do (print x)\n           (print 'odd)\n      collect x)\n",
    );
    check("(loop\n  (work)\n  (rest))\n");
}

#[test]
fn templates_are_indented_as_what_they_make() {
    check("`(tagbody\n  ,top\n    (work)\n    (go ,top)\n  ,end)\n");
    check("`(,let ,bindings\n   ,@body)\n");
    check("`(,function ,x\n            ,@more)\n");
}

#[test]
fn macros_are_indented_by_their_lambda_lists_and_declarations() {
    check(
        "(defmacro with-arm ((arm &key\n                     speed) &body body)\n  `(list ,arm\n         ,@body))\n",
    );
    check("(defmacro near (place &body body)\n  `(list ,place ,@body))\n\n(near 'home\n  (work))\n");
    let declared =
        "(defmacro each (place &rest forms)\n  (declare (indent 1))\n  `(list ,place ,@forms))\n\n";
    check(&format!("{declared}(each 'home\n  (work))\n"));
    check("(macrolet ((near (place &body body)\n             `(list ,place ,@body)))\n  (near 1\n    2))\n");
}

#[test]
fn a_region_stays_as_it_was_laid_out() {
    let text = "(list 1\n; format: off\n 1   0\n 0   1\n ; format: on\n 2)\n";
    let kept = "(list 1\n      ; format: off\n 1   0\n 0   1\n      ; format: on\n      2)\n";
    becomes(text, kept);
    becomes("(when a\n;;; format: off\n b   c)\n", "(when a\n  ;;; format: off\n b   c)\n");
    becomes("(f   1)\n; format: off\n(g   1\n )\n\n\n\n", "(f 1)\n; format: off\n(g   1\n )\n\n\n\n");
    assert_eq!(formatted("(list \"\n; format: off\n\"\nb)\n"), "(list \"\n; format: off\n\"\n      b)\n");
}

#[test]
fn data_are_not_taken_for_code() {
    check("'(when a\n  b\n  (let ((c)\n        d)))\n");
    check("#(when a\n  b)\n");
    check("(list #+esl\n      (a)\n      #-esl (b\n             c))\n");
}

#[test]
fn strings_comments_and_characters_stay() {
    let text = "(list \"a\n   b\" #\\( ; (\n      #| c\n   d |# #\\\" 'e)\n";
    assert_eq!(formatted(text), text);
    assert_eq!(indented("(f #\\ \n   a)  \n\n\n"), "(f #\\ \n   a)\n\n\n");
    becomes("(f #\\ \n   a)  \n\n\n", "(f #\\ \n   a)\n");
    assert_eq!(
        formatted("(f 1)      ; one\n           ; two\n   ; three"),
        "(f 1)      ; one\n           ; two\n   ; three\n"
    );
    assert_eq!(formatted("(f\r\n      1)\r\n"), "(f\r\n 1)\r\n");
}

#[test]
fn only_the_wanted_lines_change() {
    let tree = SyntaxTree::new("(when a\nb\nc   1\nd   1)\n");
    let expected = "(when a\nb\n  c 1\nd   1)\n";
    assert_eq!(format(&tree, &Styles::standard(), Some(2..=2)).as_deref(), Ok(expected));
}

#[test]
fn a_list_without_an_end_does_not_swallow_the_next_form() {
    assert_eq!(indented("(defun f (\n(g)\n  (defun h ()\n1)"), "(defun f (\n(g)\n(defun h ()\n  1)\n");
}

#[test]
fn one_blank_divides_data_and_none_stands_beside_a_parenthesis() {
    becomes("( list   1\t2 ( car x )\"a\"\"b\"'c )", "(list 1 2 (car x) \"a\" \"b\" 'c)\n");
    becomes("' x ` (a , b ,@ c) #' car # (1)", "'x `(a ,b ,@c) #'car # (1)\n");
    becomes("`(, @x , .y)", "`(, @x , .y)\n");
    becomes("#+ esl  (a)   #- (or x y) b", "#+esl (a) #-(or x y) b\n");
    becomes(
        "#s( point :x 1) #c (1 2) #2a ((1) (2)) #1= (a . #1#)",
        "#s(point :x 1) #c(1 2) #2a((1) (2)) #1=(a . #1#)\n",
    );
    becomes("(#|a|# b#|c|#\n  #|d|#)", "(#|a|# b#|c|#\n #|d|#)\n");
}

#[test]
fn lone_parentheses_join_the_line_before() {
    becomes("(when a\n  (b)\n)\n", "(when a\n  (b))\n");
    becomes("(\n  when a\n  '\n  (b\n  )\n\n)\n", "(when a\n  '(b))\n");
    becomes("(when a\n  (b) ; c\n)\n", "(when a\n  (b) ; c\n  )\n");
    becomes("(let (\n    (a 1)\n    (b 2)\n  )\n  a)\n", "(let ((a 1)\n      (b 2))\n  a)\n");
}

#[test]
fn blank_lines_do_not_pile_up() {
    becomes("\n\n(a)\n\n\n\n\n(b)\n\n\n", "(a)\n\n\n(b)\n");
    becomes("(progn\n\n\n\n  (a)\n\n\n  (b)\n\n)", "(progn\n\n  (a)\n\n  (b))\n");
    becomes("  \n\t\n", "");
    becomes("", "");
    assert_eq!(formatted("(a)\u{c}\n(b)"), "(a)\u{c}\n(b)\n", "a page break stays");
}

#[test]
fn long_lines_are_broken_where_a_lisp_programmer_breaks_them() {
    let long = "a-name-that-is-somewhat-long";
    // The outermost list first; the forms of a body and the clauses each on a line.
    becomes(
        &format!("(defun f (x) (when ({long} x) (print x) (go-on {long} 2 3 x)))"),
        &format!("(defun f (x)\n  (when ({long} x) (print x) (go-on {long} 2 3 x)))\n"),
    );
    becomes(
        &format!("(cond (({long} 1) ({long} 2)) (({long} 3) ({long} 4)) (t 5))"),
        &format!("(cond (({long} 1) ({long} 2))\n      (({long} 3) ({long} 4))\n      (t 5))\n"),
    );
    becomes(
        &format!("(handler-case ({long} ({long})) (type-error (c) ({long} c)))"),
        &format!("(handler-case ({long} ({long}))\n  (type-error (c) ({long} c)))\n"),
    );
    becomes(
        &format!("(let ((a ({long})) (b ({long} 1 2 3 4))) ({long} a b {long}))"),
        &format!("(let ((a ({long})) (b ({long} 1 2 3 4)))\n  ({long} a b {long}))\n"),
    );
    // Arguments fill lines, keywords stay beside their values.
    becomes(
        &format!("(list {long} {long} {long} {long} 5 6)"),
        &format!("(list {long} {long} {long}\n      {long} 5 6)\n"),
    );
    becomes(
        &format!("(go-to {long} :by {long} :at {long} :with {long})"),
        &format!("(go-to {long}\n       :by {long}\n       :at {long}\n       :with {long})\n"),
    );
    becomes(
        &format!("(setf (first {long}) (list {long} {long}) (second {long}) 2)"),
        &format!("(setf (first {long})\n      (list {long} {long})\n      (second {long}) 2)\n"),
    );
    becomes(
        &format!("(loop for x in {long} when ({long} x) collect (list x {long}))"),
        &format!("(loop for x in {long}\n      when ({long} x)\n        collect (list x {long}))\n"),
    );
    becomes(
        &format!("(defvar *a* ({long} {long}) \"{}\")", "text ".repeat(7)),
        &format!("(defvar *a* ({long} {long})\n  \"{}\")\n", "text ".repeat(7)),
    );
    becomes(
        &format!("(defun f (first second &key ({long} 1) ({long}-too 2) another) nil)"),
        &format!(
            "(defun f (first second &key ({long} 1) ({long}-too 2)\n{}another)\n  nil)\n",
            " ".repeat(28)
        ),
    );
    // A datum after a list of several lines does not stand beside its end.
    becomes(
        &format!("(some-form (and ({long} 1) ({long} 2) ({long} 3) 4) (or 5 6))"),
        &format!(
            "(some-form (and ({long} 1) ({long} 2)\n                ({long} 3) 4)\n           (or 5 6))\n"
        ),
    );
    // Nothing can be broken.
    let text = format!("(print \"{}\")\n", "x".repeat(120));
    becomes(&text, &text);
}

#[test]
fn lines_that_the_author_has_broken_stay_so() {
    let text = "(list 1\n      2)\n(when a (b)\n  (c))\n(f :a 1 :b\n   2)\n";
    becomes(text, text);
    // Plain data are filled anew from the line on that is too long.
    let names = "one-name another-name ".repeat(5);
    becomes(
        &format!("'({names}\n  x y\n  z)"),
        &format!("'({}\n  another-name x y z)\n", names.trim_end().trim_end_matches(" another-name")),
    );
}

#[test]
fn comments_behind_code_stay_under_each_other() {
    becomes("(f  1)     ; a\n(long   2) ; b\n", "(f 1)    ; a\n(long 2) ; b\n");
    becomes("(f   1)   ; a\n          ; b\n", "(f 1)   ; a\n        ; b\n");
    becomes("(f 1);a\n(g 2)      ; b\n", "(f 1) ;a\n(g 2)      ; b\n");
}

#[test]
fn texts_that_cannot_be_read_are_refused() {
    for text in ["(a", "a)", "\"a", "#|a", "|a"] {
        assert_eq!(format(&SyntaxTree::new(text), &Styles::standard(), None), Err(FormatError::Unreadable));
    }
}
