//! The rules, one by one; then that formatting changes nothing but blanks, over all programs of the project
//! and random edits of them.

use std::path::{Path, PathBuf};

use esl_bytecode::package::Qualifier;
use esl_compiler::reader::{BareEnvironment, Reader, print, structure_faults};

use super::*;

fn formatted(text: &str) -> String {
    let tree = SyntaxTree::new(text);
    let mut styles = Styles::standard();
    styles.add_macros(&tree, true);
    format(&tree, &styles, None)
}

/// Checks that a text is formatted already, and that it comes back when its indentation is taken away.
#[track_caller]
fn check(text: &str) {
    assert_eq!(formatted(text), text);
    let flat: String = text.lines().flat_map(|line| [line.trim_start(), "\n"]).collect();
    assert_eq!(formatted(&flat), text);
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
    let formatted = |text: &str| format(&SyntaxTree::new(text), &Styles::standard(), None);
    let text = "(list 1\n; format: off\n 1   0\n 0   1\n ; format: on\n 2)\n";
    let kept = "(list 1\n      ; format: off\n 1   0\n 0   1\n      ; format: on\n      2)\n";
    assert_eq!(formatted(text), kept);
    assert_eq!(formatted("(when a\n;;; format: off\n b   c\n"), "(when a\n  ;;; format: off\n b   c\n");
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
    assert_eq!(formatted("(f #\\ \n   a)  \n\n\n"), "(f #\\ \n   a)\n\n\n");
    assert_eq!(
        formatted("(f 1)      ; one\n           ; two\n   ; three"),
        "(f 1)      ; one\n           ; two\n   ; three\n"
    );
    assert_eq!(formatted("(f\r\n      1)\r\n"), "(f\r\n 1)\r\n");
}

#[test]
fn only_the_wanted_lines_change() {
    let tree = SyntaxTree::new("(when a\nb\nc\nd)\n");
    assert_eq!(format(&tree, &Styles::standard(), Some(2..=2)), "(when a\nb\n  c\nd)\n");
}

#[test]
fn a_list_without_an_end_does_not_swallow_the_next_form() {
    assert_eq!(formatted("(defun f (\n(g)\n  (defun h ()\n1)"), "(defun f (\n(g)\n(defun h ()\n  1)\n");
}

/// All programs of the project.
fn programs() -> Vec<PathBuf> {
    let mut folders = vec![PathBuf::from(env!("CARGO_MANIFEST_DIR"))];
    let mut programs = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("the folder can be read").flatten() {
            let path = entry.path();
            let name = entry.file_name().to_string_lossy().into_owned();
            if path.is_dir() && !name.starts_with('.') && name != "target" {
                folders.push(path);
            } else if name.ends_with(".esl") {
                programs.push(path);
            }
        }
    }
    programs.sort();
    assert!(programs.len() > 500, "these are not all programs: {}", programs.len());
    programs
}

/// What may not change: the kinds of nodes, what contains them, and the texts of tokens and comments.
fn essence(tree: &SyntaxTree) -> Vec<(SyntaxKind, Option<u32>, &str)> {
    let text = |node| match tree.kind(node) {
        SyntaxKind::List | SyntaxKind::Mark(_) => "",
        _ => tree.text(node),
    };
    tree.nodes().map(|node| (tree.kind(node), tree.parent(node), text(node))).collect()
}

/// The data that the reader reads, and the codes of what it refuses.
fn data(text: &str) -> Vec<String> {
    let mut reader = Reader::new(Default::default(), text);
    let mut environment = BareEnvironment::new();
    let next = || reader.next(&mut environment);
    std::iter::from_fn(next)
        .map(|read| read.map_or_else(|error| error.code.into(), |datum| print(&datum, &|_| Qualifier::None)))
        .collect()
}

#[track_caller]
fn check_unchanged(text: &str, styles: &Styles, path: &Path) {
    let tree = SyntaxTree::new(text);
    let once = format(&tree, styles, None);
    let again = SyntaxTree::new(&*once);
    // A form that has no end is told from the next one by its column.
    if structure_faults(Default::default(), text).is_empty() {
        assert_eq!(essence(&tree), essence(&again), "{}: {text}", path.display());
    }
    assert_eq!(format(&again, styles, None), once, "{}", path.display());
}

#[test]
fn the_programs_of_the_project_keep_their_data_and_comments() {
    let styles = Styles::standard();
    for path in programs() {
        let Ok(text) = std::fs::read_to_string(&path) else { continue };
        check_unchanged(&text, &styles, &path);
        let once = format(&SyntaxTree::new(&*text), &styles, None);
        if structure_faults(Default::default(), &text).is_empty() {
            assert_eq!(data(&text), data(&once), "{}", path.display());
        }
    }
}

#[test]
fn random_edits_of_programs_keep_their_data_and_comments() {
    let pieces = [
        "(",
        ")",
        "\"",
        "\n",
        "\n\n",
        "  ",
        "\t",
        ";",
        " ; c\n",
        "#|",
        "|#",
        "'",
        "`",
        ",@",
        "#+esl ",
        "#(",
        "#\\",
        "\\",
        "|",
        "#.",
        " . ",
        "#1=",
        "\r\n",
        "\u{a0}",
        "loop for x ",
        "cond ",
        "é",
        "(let ((",
        "#2A",
    ];
    let styles = Styles::standard();
    // A linear congruential generator: the same edits each time.
    let mut state = 1_u64;
    let mut random = |below: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    for path in programs() {
        let Ok(mut text) = std::fs::read_to_string(&path) else { continue };
        text.truncate((0..=text.len().min(6000)).rev().find(|&at| text.is_char_boundary(at)).unwrap_or(0));
        for _ in 0..3 {
            let at = text.floor_char_boundary(random(text.len() + 1));
            if random(3) == 0 {
                let end = text.ceil_char_boundary((at + random(12)).min(text.len()));
                text.replace_range(at..end, "");
            } else {
                text.insert_str(at, pieces[random(pieces.len())]);
            }
            check_unchanged(&text, &styles, &path);
        }
    }
}
