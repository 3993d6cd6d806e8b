//! Files as they are named, found, watched and loaded.
#![cfg(unix)]

use esl_conformance::folder::Folder;
use esl_conformance::process;

use crate::eslvm;

/// Runs a program in a folder, and returns the lines that it prints, in which `~` stands for the folder.
fn lines(folder: &Folder, file: &str, arguments: &[&str]) -> Vec<String> {
    let mut command = eslvm(&[&["run"], arguments, &[file]].concat());
    let output = process::run(command.current_dir(folder.path()), "").quiet_output();
    let path = folder.path().canonicalize().expect("it is there");
    let output = output.expect("nothing is wrong").replace(&*path.to_string_lossy(), "~");
    output.lines().map(|line| line.trim().to_owned()).filter(|line| !line.is_empty()).collect()
}

/// As in SBCL.
#[test]
fn true_names_are_whole_and_follow_links() {
    let text = "(ensure-directories-exist \"folder/\")
(with-open-file (s \"folder/a.txt\" :direction :output) (write-line \"a\" s))
(print (truename \"folder/\"))
(print (truename \"folder\"))
(print (probe-file \"folder/\"))
(print (probe-file \"folder/a.txt\"))
(print (probe-file \"folder/../folder/./a.txt\"))
(print (truename \"folder/a.txt/\"))
(print (truename #P\"link\"))
(print (probe-file \"link.txt\"))
(print (probe-file \"\"))
(print (list (probe-file \"none\") (probe-file \"none/\") (probe-file \"folder/a.txt/b\")))
(print (handler-case (truename \"none/\") (file-error (e) (file-error-pathname e))))
(print (handler-case (truename \"dangling\") (file-error () 'none)))
(print (handler-case (probe-file \"/etc/\") (failure (f) (failure-arguments f))))
(with-open-file (s \"folder/a.txt\") (print (truename s)))
(print (let ((*default-pathname-defaults* #P\"folder/\")) (probe-file \"a.txt\")))";
    let folder = Folder::with("true-names", &[("main.esl", text)]);
    let link = |to: &str, name: &str| {
        std::os::unix::fs::symlink(to, folder.path().join(name)).expect("a link can be made");
    };
    link("folder", "link");
    link("folder/a.txt", "link.txt");
    link("nothing", "dangling");
    let expected = [
        "#P\"~/folder/\"",
        "#P\"~/folder/\"",
        "#P\"~/folder/\"",
        "#P\"~/folder/a.txt\"",
        "#P\"~/folder/a.txt\"",
        "#P\"~/folder/a.txt\"",
        "#P\"~/folder/\"",
        "#P\"~/folder/a.txt\"",
        "#P\"~/\"",
        "(NIL NIL NIL)",
        "\"none/\"",
        "NONE",
        "(:READ \"/etc/\" \"--allow-read=/etc/\")",
        "#P\"~/folder/a.txt\"",
        "#P\"~/folder/a.txt\"",
    ];
    assert_eq!(lines(&folder, "main.esl", &[]), expected);
    // Under the virtual clock files are asked at once.
    assert_eq!(lines(&folder, "main.esl", &["--clock", "virtual"]), expected);
}

#[test]
fn a_program_knows_its_file_and_those_that_it_loads() {
    let main = "(print (list *load-pathname* *load-truename*))
(load \"folder/loaded.esl\")
(load \"link.esl\")
(print *load-truename*)
(spawn (print *load-truename*))";
    let loaded = "(print (list *load-pathname* *load-truename*))";
    let folder = Folder::with("load-truename", &[("main.esl", main)]);
    std::fs::create_dir(folder.path().join("folder")).expect("a folder can be made");
    folder.file("folder/loaded.esl", loaded);
    std::os::unix::fs::symlink("folder/loaded.esl", folder.path().join("link.esl"))
        .expect("a link can be made");
    let expected = [
        "(#P\"./main.esl\" #P\"~/main.esl\")",
        "(#P\"folder/loaded.esl\" #P\"~/folder/loaded.esl\")",
        "(#P\"link.esl\" #P\"~/folder/loaded.esl\")",
        "#P\"~/main.esl\"",
        "#P\"~/main.esl\"",
    ];
    let expected = expected.map(|line| line.replace("./main", "main"));
    assert_eq!(lines(&folder, "main.esl", &[]), expected);
    // A recording knows it too, wherever it is replayed.
    assert_eq!(lines(&folder, "main.esl", &["--record", "run.eslj"]), expected);
    let mut replay = eslvm(&["replay", "run.eslj"]);
    let replayed = process::run(replay.current_dir(folder.path()), "").output;
    assert!(replayed.contains("/main.esl\")"), "{replayed}");
}

/// A path is watched, not the file that it has at the beginning.
#[test]
fn a_path_is_watched_whatever_becomes_of_its_file() {
    let text = "(defun change (path mode)
  (with-open-file (s path :direction :output :if-exists mode) (write-string \"x\" s)))
(defun await (input kind)
  (loop until (eq (wait-for-event input) kind))
  (print kind))
(ensure-directories-exist \"d/\")
(change \"d/f.txt\" :supersede)
(with-watched-path (input \"d/f.txt\" :capacity 1000)
  (change \"d/f.txt\" :append) (await input :modified)
  (dotimes (i 3)
    (change \"d/f.new\" :supersede) (rename-file \"d/f.new\" \"f.txt\") (await input :created)
    (change \"d/f.txt\" :append) (await input :modified))
  (delete-file \"d/f.txt\") (await input :deleted)
  (change \"d/f.txt\" :supersede) (await input :created)
  (change \"d/f.txt\" :append) (await input :modified)
  (rename-file \"d/f.txt\" \"old.txt\") (await input :renamed)
  (change \"d/f.txt\" :supersede) (await input :created)
  ;; Its folder is replaced.
  (rename-file \"d/\" \"e/\") (await input :deleted)
  (ensure-directories-exist \"d/\") (change \"d/f.txt\" :supersede) (await input :created)
  (change \"d/f.txt\" :append) (await input :modified))
(with-watched-path (input \"e/\" :capacity 1000)
  (rename-file \"e/\" \"g/\") (await input :renamed)
  (ensure-directories-exist \"e/\") (await input :created)
  (change \"e/h.txt\" :supersede)
  (loop until (search \"e/h.txt\" (nth-value 1 (wait-for-event input))))
  (print 'entry))";
    let folder = Folder::with("watch-renamed", &[("main.esl", text)]);
    let changes = "MODIFIED CREATED MODIFIED CREATED MODIFIED CREATED MODIFIED DELETED CREATED MODIFIED RENAMED CREATED \
                   DELETED CREATED MODIFIED RENAMED CREATED";
    let mut expected: Vec<String> = changes.split(' ').map(|kind| format!(":{kind}")).collect();
    expected.push("ENTRY".into());
    assert_eq!(lines(&folder, "main.esl", &[]), expected);
}

/// The whole file is compiled before any of it runs.
#[test]
fn a_package_that_a_loaded_file_makes_is_explained() {
    let files = [
        ("package.lisp", "(defpackage :p (:use :cl))"),
        ("main.lisp", "(load \"package.lisp\")\n(in-package :p)\n(print 1)"),
        ("quick.lisp", "(ql:quickload :alexandria)"),
        ("package.esl", "(defpackage :p (:use :cl))"),
        ("good.lisp", "(require \"package\")\n(in-package :p)\n(print (package-name *package*))"),
    ];
    let folder = Folder::with("load-package", &files);
    for (file, said) in [("main.lisp", "(require \"NAME\")"), ("quick.lisp", "neither Quicklisp nor ASDF")] {
        let run = process::run(eslvm(&["run", file]).current_dir(folder.path()), "");
        assert_eq!(run.status, Some(3), "{}", run.errors);
        let errors = run.errors.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(errors.contains(said), "{errors}");
    }
    // A name of a package is what PACKAGE-NAME returns at run time, in the package where the program began.
    assert_eq!(lines(&folder, "good.lisp", &[]).len(), 1);
}

/// Values that are not bytes are refused by every operation that sends.
#[test]
fn only_bytes_are_sent_as_bytes() {
    let text = "(require :sockets)
(defmacro fault (form)
  `(print (handler-case (progn ,form :sent)
            (type-error (e) (list (type-error-datum e) (type-error-expected-type e))))))
(let ((s (sockets:udp-open \"127.0.0.1\")) (r (sockets:udp-open \"127.0.0.1\")))
  (flet ((send (data) (sockets:udp-send s \"127.0.0.1\" (sockets:local-port r) data)))
    (dolist (data (list #(1 300) #(-1) #(1 #\\a) (vector nil) #(1.0) (vector (expt 10 30)) '(1 2)))
      (fault (send data)))
    (dolist (data (list #*101 (make-array 5 :fill-pointer 2 :initial-element 255) \"ñ\" #()))
      (fault (send data))
      (print (sockets:udp-receive r)))))
(let* ((l (sockets:listen \"127.0.0.1\" 0)) (c (sockets:connect \"127.0.0.1\" (sockets:local-port l))))
  (fault (write-byte 300 c))
  (fault (write-sequence #(1 300) c))
  (fault (write-sequence '(1 -3) c))
  (fault (write-sequence #(1 #\\a) c)))
(with-open-file (s \"bytes\" :direction :output :element-type '(unsigned-byte 8))
  (fault (write-byte 256 s))
  (fault (write-sequence #(1 300) s)))";
    let folder = Folder::with("only-bytes", &[("main.esl", text)]);
    let refused = |datum: &str| format!("({datum} (UNSIGNED-BYTE 8))");
    let mut expected: Vec<String> =
        ["300", "-1", "#\\a", "NIL", "1.0", "1000000000000000000000000000000"].map(refused).to_vec();
    expected.push("((1 2) VECTOR)".into());
    for bytes in ["#(1 0 1)", "#(255 255)", "#(195 177)", "#()"] {
        expected.extend([":SENT".into(), bytes.into()]);
    }
    expected.extend(["300", "300", "-3", "#\\a", "256", "300"].map(refused));
    assert_eq!(lines(&folder, "main.esl", &["--allow-net=127.0.0.1"]), expected);
}
