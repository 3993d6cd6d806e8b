//! Programs of several files: modules found in folders, compiled together and apart, by the commands.

use std::path::Path;

use esl_conformance::folder::Folder;
use esl_conformance::process;

use crate::{ESLVM, eslc_path};

/// A folder in which the commands run.
trait CommandFolder {
    fn path(&self) -> &Path;

    fn remove(&self, name: &str) {
        std::fs::remove_file(self.path().join(name)).expect("the file is there");
    }

    fn copy(&self, from: &str, to: &str) {
        std::fs::copy(self.path().join(from), self.path().join(to)).expect("a file can be copied");
    }

    /// Runs a command with `library` as `ESL_LIBRARY`. Returns its status, the lines of its output that are
    /// not empty, and its errors.
    fn run(&self, program: &str, arguments: &[&str], library: &str) -> (i32, String, String) {
        let mut command = process::command(program, arguments);
        let run = process::run(command.current_dir(self.path()).env("ESL_LIBRARY", library), "");
        let lines: Vec<&str> =
            run.output.lines().map(str::trim_end).filter(|line| !line.is_empty()).collect();
        (run.status.unwrap_or(-1), lines.join("\n"), run.errors)
    }

    /// Checks what a program prints when all goes well.
    #[track_caller]
    fn check_run(&self, arguments: &[&str], expected: &str) {
        let (status, output, errors) = self.run(ESLVM, &[&["run"], arguments].concat(), "");
        assert_eq!((status, &*output, &*errors), (0, expected, ""), "{arguments:?}");
    }

    #[track_caller]
    fn compile(&self, arguments: &[&str]) {
        let (status, output, errors) = self.run(&eslc_path(), &[&["compile"], arguments].concat(), "");
        assert_eq!((status, &*output, &*errors), (0, "", ""), "{arguments:?}");
    }
}

impl CommandFolder for Folder {
    fn path(&self) -> &Path {
        self.path()
    }
}

const SHAPES: &str = "
(defpackage :shapes (:use :cl :esl) (:export :area :twice :side :make-side :side-length :*made*))
(in-package :shapes)
(require :names)
(defvar *made* (list (names:name) (intern \"LOCAL\")))
(defstruct side (length 1))
(defun helper (a b) (* a b))
(defun area (side) (helper (side-length side) (side-length side)))
(defmacro twice (form) (let ((g (gensym))) `(let ((,g ,form)) (list ,g ,g))))
(print 'shapes-run)
";
const NAMES: &str = "
(defpackage :names (:use :cl) (:export :name))
(in-package :names)
(defun name () 'the-name)
(defun helper () 'of-names)
(print 'names-run)
";
const MAIN: &str = "
(print 'before)
(require \"shapes\")
(require \"names\")
(defun helper () 'of-main)
(print (list (helper) (shapes::helper 2 3) (names::helper)))
(print (shapes:twice (shapes:area (shapes:make-side :length 3))))
(print shapes:*made*)
(setf (shapes:side-length (shapes:make-side)) 3)
(print (list *package* *modules* (intern \"LOCAL\")))
";
const OUTPUT: &str = "BEFORE
SHAPES-RUN
NAMES-RUN
(OF-MAIN 6 NAMES::OF-NAMES)
(9 9)
(NAMES::THE-NAME SHAPES::LOCAL)
(#<PACKAGE \"ESL-USER\"> (\"shapes\" \"names\") LOCAL)";
/// A module runs where it is required: the other one before anything of its own.
fn output() -> String {
    OUTPUT.replace("SHAPES-RUN\nNAMES-RUN", "NAMES-RUN\nSHAPES-RUN")
}

fn program(test: &str) -> Folder {
    Folder::with(
        &format!("modules-{test}"),
        &[("main.esl", MAIN), ("lib/shapes.esl", SHAPES), ("lib/names.esl", NAMES)],
    )
}

#[test]
fn a_source_is_run_with_its_modules() {
    let folder = program("source");
    folder.check_run(&["--library", "lib", "main.esl"], &output());
    let (status, output, _) = folder.run(ESLVM, &["run", "main.esl"], "nowhere:lib");
    assert_eq!((status, output), (0, self::output()));
    folder.copy("lib/names.esl", "names.esl");
    folder.copy("lib/shapes.esl", "shapes.esl");
    folder.check_run(&["main.esl"], &self::output());
}

#[test]
fn a_file_of_common_lisp_begins_in_its_package() {
    let text = "(defun f (x) (assert (> x 0)) (list x *package*))\n(print (f 1))";
    let expected = "(1 #<PACKAGE \"COMMON-LISP-USER\">)";
    let main = "(print *package*) (load \"a.lisp\") (print *package*) (require \"a\" \"a.lisp\")";
    let folder = Folder::with("modules-lisp", &[("a.lisp", text), ("main.esl", main)]);
    folder.check_run(&["a.lisp"], expected);
    folder.compile(&["a.lisp"]);
    folder.check_run(&["a.eslb"], expected);
    let user = "#<PACKAGE \"ESL-USER\">";
    folder.check_run(&["main.esl"], &format!("{user}\n{expected}\n{user}\n{expected}"));
}

#[test]
fn a_whole_program_is_one_file() {
    let folder = program("whole");
    folder.compile(&["main.esl", "--library", "lib", "-o", "out.eslb"]);
    for file in ["main.esl", "lib/shapes.esl", "lib/names.esl"] {
        folder.remove(file);
    }
    folder.check_run(&["out.eslb"], &output());
}

#[test]
fn files_are_compiled_apart() {
    let folder = program("apart");
    folder.compile(&["main.esl", "--library", "lib"]);
    // The modules are found as sources,
    folder.check_run(&["--library", "lib", "main.eslb"], &output());
    // or compiled,
    folder.compile(&["lib/shapes.esl", "lib/names.esl"]);
    folder.remove("lib/shapes.esl");
    folder.remove("lib/names.esl");
    folder.check_run(&["--library", "lib", "main.eslb"], &output());
    // and the program is compiled against compiled modules, together or apart.
    folder.compile(&["main.esl", "--library", "lib"]);
    folder.check_run(&["--library", "lib", "main.eslb"], &output());
    folder.compile(&["main.esl", "--library", "lib", "-o", "out.eslb"]);
    folder.check_run(&["--library", "lib", "out.eslb"], &output());
}

#[test]
fn a_module_that_is_not_found_is_reported() {
    let folder = program("missing");
    let (status, _, errors) = folder.run(&eslc_path(), &["check", "main.esl"], "");
    assert_eq!(status, 3);
    assert!(errors.contains("error[unknown-module]"), "{errors}");
    assert!(errors.contains("main.esl:3:1"), "{errors}");
    folder.compile(&["main.esl", "--library", "lib"]);
    let (status, output, errors) = folder.run(ESLVM, &["run", "main.eslb"], "");
    assert_eq!((status, &*output), (1, "BEFORE"));
    assert!(
        errors.starts_with("The module shapes is missing: found neither shapes.esl nor shapes.eslb in ."),
        "{errors}"
    );
    assert!(errors.contains("main.esl:3:1"), "{errors}");
}

#[test]
fn modules_in_a_circle_are_reported() {
    let files = [
        ("main.esl", "(require \"a\")"),
        ("a.esl", "(require \"b\")"),
        ("b.esl", "(print 1)\n(require :a)"),
        ("late.esl", "(defun late (x) (require x))\n(late \"a\")"),
    ];
    let folder = Folder::with("modules-circle", &files);
    let (status, _, errors) = folder.run(&eslc_path(), &["check", "main.esl"], "");
    assert_eq!(status, 3);
    assert!(errors.contains("the module `a` requires itself, by way of `b`"), "{errors}");
    assert!(errors.contains("b.esl:2:1"), "{errors}");
    let (status, _, errors) = folder.run(ESLVM, &["run", "late.esl"], "");
    assert_eq!(status, 1);
    assert!(errors.contains("requires itself"), "{errors}");
}

#[test]
fn two_tasks_that_require_a_module_run_it_once() {
    let files = [
        (
            "main.esl",
            "(defun have (name)
               (with-recovery-procedures ((:general-failure (abort :failed)))
                 (require name)))
             (print (multiple-value-list (task-net (a (have \"slow\")) (b (have \"slow\")) (c (have \"slow\")))))
             (print (multiple-value-list (task-net (a (have \"bad\")) (b (have \"bad\")))))
             (let ((first (spawn (have \"slower\"))) (second (spawn (have \"slower\"))))
               (sleep 1/100)
               (abort-task first)
               (print (nth-value 1 (wait-for-task second))))
             (print *modules*)",
        ),
        ("slow.esl", "(princ 'begun) (sleep 1/100) (print 'done)"),
        ("bad.esl", "(print 'bad) (sleep 1/100) (fail :spoilt)"),
        ("slower.esl", "(print 'slower) (sleep 1/10)"),
    ];
    let folder = Folder::with("modules-at-once", &files);
    // A task that waits for a module whose loading fails or is aborted tries to load it itself.
    let expected =
        "BEGUN\nDONE\n(T NIL NIL)\nBAD\nBAD\n(:FAILED :FAILED)\nSLOWER\nSLOWER\nT\n(\"slower\" \"slow\")";
    folder.check_run(&["--clock", "virtual", "main.esl"], expected);
}

#[test]
fn what_is_wrong_in_a_module_is_reported_there() {
    let files = [("main.esl", "(require \"a\")\n(undefined-one)"), ("a.esl", "(print 1)\n(let 5)")];
    let folder = Folder::with("modules-wrong", &files);
    let (status, _, errors) = folder.run(&eslc_path(), &["check", "main.esl"], "");
    assert_eq!(status, 3);
    assert!(errors.contains("a.esl:2:6"), "{errors}");
    assert!(errors.contains("main.esl:2:2"), "{errors}");
}

#[test]
fn a_damaged_module_is_refused() {
    let folder =
        Folder::with("damaged-modules", &[("main.esl", "(defun late (x) (require x))\n(late \"a\")")]);
    folder.file("a.eslb", b"no bytecode");
    let (status, _, errors) = folder.run(ESLVM, &["run", "main.esl"], "");
    assert_eq!(status, 1);
    assert!(errors.contains("it is not a valid program"), "{errors}");
    folder.file("main.esl", "(require \"a\")");
    let (status, _, errors) = folder.run(ESLVM, &["run", "main.esl"], "");
    assert_eq!(status, 3);
    assert!(errors.contains("`./a.eslb` is not a valid program"), "{errors}");
}

#[test]
fn files_that_are_compiled_together_share_their_modules() {
    let files = [
        ("one.esl", "(require \"a\")\n(print (a:next))"),
        ("two.esl", "(require \"a\")\n(print (a:next))"),
        (
            "a.esl",
            "(defpackage :a (:use :cl) (:export :next))(in-package :a)\n(let ((n 0)) (defun next () (incf n)))",
        ),
    ];
    let folder = Folder::with("modules-together", &files);
    folder.compile(&["one.esl", "two.esl", "-o", "out.eslb"]);
    folder.check_run(&["out.eslb"], "1\n2");
}

/// The files of the next test, and the diagnostics about them: positions in the file, not in the form.
const MISTAKES: [(&str, &str, &str); 3] = [
    (
        "warned.esl",
        "(defvar *x* 1) (defun f (x)\n  (frob *x*))\n\n(defun é () (list 'é (car 1 2)))\n",
        "\
warning[unused-variable]: the variable `x` is never used
 --> warned.esl:1:26
  |
1 | (defvar *x* 1) (defun f (x)
  |                          ^
  |
  = help: if that is meant, write `(declare (ignore x))`

warning[undefined-function]: no function is called `frob`
 --> warned.esl:2:4
  |
2 |   (frob *x*))
  |    ^^^^

warning[wrong-argument-count]: `car` takes 1 argument, but is given 2
 --> warned.esl:4:22
  |
4 | (defun é () (list 'é (car 1 2)))
  |                      ^^^^^^^^^
  |
  = help: it is called as `(car list)`

",
    ),
    (
        "wrong.esl",
        "(print 1)\n(defmacro m () '(if)) (list\n  (m) (if))\n",
        "\
error[missing-part]: `if` takes a test, a form for true, and at most one for false, but has no parts
 --> wrong.esl:3:3
  |
3 |   (m) (if))
  |   ^^^ in the expansion of `m`

error[missing-part]: `if` takes a test, a form for true, and at most one for false, but has no parts
 --> wrong.esl:3:8
  |
3 |   (m) (if))
  |        ^^
",
    ),
    (
        "unclosed.esl",
        "(print 1)\n(print (list 1\n 2)\n",
        "\
error[unclosed-list]: expected `)`, found the end of the text
 --> unclosed.esl:2:1
  |
2 | (print (list 1
  | ^ this list is not closed
",
    ),
];

#[test]
fn what_is_wrong_in_a_file_that_is_loaded_is_reported_there() {
    let files = MISTAKES.map(|(name, text, _)| (name, text));
    let folder = Folder::with("modules-mistakes", &files);
    for (name, _, said) in MISTAKES {
        let is_warned = name == "warned.esl";
        folder.file("main.esl", format!("(load \"{name}\")"));
        let (status, _, errors) = folder.run(ESLVM, &["run", "main.esl"], "");
        assert_eq!(status, i32::from(!is_warned), "{errors}");
        assert!(errors.starts_with(said), "{name}:\n{errors}");
        // A module is compiled as a whole, and when it is required as the program runs, by what the machine
        // brings along.
        let module = name.trim_end_matches(".esl");
        let text = format!("(let ((name \"{module}\")) (require name))");
        folder.file("main.esl", text);
        let (status, _, errors) = folder.run(ESLVM, &["run", "main.esl"], "");
        assert_eq!(status, i32::from(!is_warned), "{errors}");
        let said = said.replace("--> ", "--> ./");
        assert!(errors.starts_with(&said), "{name}, required:\n{errors}");
    }
}
