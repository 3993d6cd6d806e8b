//! Rights of programs: the flags of `eslvm`, files of them, and what is refused without.

use esl_conformance::folder::Folder;
use esl_conformance::process::{self, Finished};

use crate::eslvm;
use crate::operate::Operated;

/// A program that reads and writes in and beside its folder, and reports each refusal.
const PROGRAM: &str = "
(defmacro try (form)
  `(print (with-recovery-procedures (((:permission-denied right object flag) (abort (list right object flag))))
            ,form)))
(defun text (path) (with-open-file (stream path) (read-line stream)))
(defun put (path) (with-open-file (stream path :direction :output) (write-string \"new\" stream)))
(try (text \"own\"))
(try (put \"made\"))
(try (text \"../other/secret\"))
(try (text \"link/secret\"))
(try (put \"link/made\"))
(try (put \"dangling\"))
(try (probe-file \"../other/none\"))
(try (load \"../other/secret\"))
(try (delete-file \"../other/secret\"))
";

/// A folder with a program in `work`, and something beside it.
fn folder(name: &str) -> Folder {
    let folder =
        Folder::with(name, &[("work/main.esl", PROGRAM), ("work/own", "mine"), ("other/secret", "5")]);
    #[cfg(unix)]
    for (link, target) in [("link", "../other"), ("dangling", "../other/new")] {
        std::os::unix::fs::symlink(target, folder.path().join("work").join(link))
            .expect("a link can be made");
    }
    folder
}

fn run(folder: &Folder, arguments: &[&str]) -> Finished {
    let mut command = eslvm(&[&["run"], arguments, &["main.esl"]].concat());
    process::run(command.current_dir(folder.path().join("work")), "")
}

/// Returns the lines that a run prints.
#[track_caller]
fn lines(folder: &Folder, arguments: &[&str]) -> Vec<String> {
    let output = run(folder, arguments).quiet_output().expect("nothing is wrong");
    output.lines().map(|line| line.trim().to_owned()).filter(|line| !line.is_empty()).collect()
}

#[cfg(unix)]
#[test]
fn only_the_current_folder_is_granted_unless_said() {
    let folder = folder("rights-default");
    let expected = [
        "\"mine\"",
        "\"new\"",
        "(:READ \"../other/secret\" \"--allow-read=../other/secret\")",
        "(:READ \"link/secret\" \"--allow-read=link/secret\")",
        "(:WRITE \"link/made\" \"--allow-write=link/made\")",
        "(:WRITE \"dangling\" \"--allow-write=dangling\")",
        "(:READ \"../other/none\" \"--allow-read=../other/none\")",
        "(:READ \"../other/secret\" \"--allow-read=../other/secret\")",
        "(:WRITE \"../other/secret\" \"--allow-write=../other/secret\")",
    ];
    assert_eq!(lines(&folder, &[]), expected);
    assert!(folder.path().join("other/secret").exists() && !folder.path().join("other/made").exists());
}

#[cfg(unix)]
#[test]
fn flags_grant_more() {
    let folder = folder("rights-flags");
    let read = lines(&folder, &["--allow-read=../other"]);
    assert_eq!(read[2..4], ["\"5\"", "\"5\""]);
    assert_eq!(read[4], "(:WRITE \"link/made\" \"--allow-write=link/made\")");
    assert_eq!(read[6], "NIL");
    assert_eq!(read[7..], ["T", "(:WRITE \"../other/secret\" \"--allow-write=../other/secret\")"]);
    // As the failure says it.
    assert_eq!(lines(&folder, &["--allow-read=../other/secret"])[2..4], ["\"5\"", "\"5\""]);
    assert_eq!(lines(&folder, &["--allow-read", "--allow-write=nowhere,../other"])[8], "T");
    folder.file("other/secret", "6");
    folder.file("work/grants", "# all of it\n--allow-read\n--allow-write=../other\n");
    assert_eq!(lines(&folder, &["--rights", "grants"])[8], "T");
    folder.file("other/secret", "6");
    assert_eq!(lines(&folder, &["--allow-all"])[8], "T");
}

#[test]
fn a_file_of_rights_that_does_not_parse_starts_nothing() {
    let folder = folder("rights-file");
    folder.file("work/grants", "--allow-read\nwrite everything\n");
    let done = run(&folder, &["--rights", "grants"]);
    assert_eq!((done.status, &*done.output), (Some(2), ""));
    assert!(done.errors.contains("grants:2: `write everything`: expected a flag"), "{}", done.errors);
    assert_eq!(run(&folder, &["--rights", "none"]).status, Some(2));
    assert_eq!(run(&folder, &["--allow-run="]).status, Some(2));
}

#[test]
fn the_repl_has_the_same_flags() {
    let folder = folder("rights-repl");
    let ask = |arguments: &[&str]| {
        let mut command = eslvm(&[&["repl"], arguments].concat());
        let input = "(with-open-file (stream \"../other/secret\") (read-line stream))\n";
        process::run(command.current_dir(folder.path().join("work")), input).output
    };
    let refused = ask(&[]);
    let report =
        "Read access to \"../other/secret\" is not permitted; run with --allow-read=../other/secret.";
    assert!(refused.contains(report), "{refused}");
    assert!(ask(&["--allow-read=../other"]).contains("\"5\""));
}

#[cfg(unix)]
#[test]
fn a_session_of_an_operator_has_the_same_flags() {
    let folder = folder("rights-attach");
    let socket = folder.join("s");
    let (place, secret) = (folder.path().join("work"), "../other/secret");
    let granted = ["--listen", &socket, "--allow-read=../other", "--allow-env=HOME"];
    let mut run = Operated::start_in(&place, &folder, "(read-line *standard-input* nil)", &granted);
    run.said("; operators attach with eslvm attach ");
    let ask = |flags: &[&str], form: &str| {
        let arguments = [&["attach"], flags, &[&socket]].concat();
        let finished = process::run(&mut eslvm(&arguments), format!("{form}\n"));
        finished.output + &finished.errors
    };
    let look = format!(
        "(with-recovery-procedures (((:permission-denied right object flag) (abort (list right object flag))))
           (values (with-open-file (stream {secret:?}) (read-line stream))))"
    );
    let refused = format!("(:READ {secret:?} \"--allow-read={secret}\")\n");
    assert_eq!(ask(&[], &look), refused);
    assert_eq!(ask(&["--allow-write", "--allow-env"], &look), refused);
    assert_eq!(ask(&["--allow-read=../other"], &look), "\"5\"\n");
    assert_eq!(ask(&["--allow-all"], &look), "\"5\"\n");
    folder.file("grants", "--allow-read\n");
    assert_eq!(ask(&["--rights", &folder.join("grants")], &look), "\"5\"\n");
    // Tasks that a session makes have no more, nor has what it watches; a form around takes away for good.
    let spawned = format!("(nth-value 1 (wait-for-task (spawn {look})))");
    assert_eq!(ask(&[], &spawned), refused);
    let narrowed = format!("(with-rights () {look})");
    assert_eq!(ask(&["--allow-read=../other"], &narrowed), format!("(:READ {secret:?} NIL)\n"));
    // A session has no right that the run lacks.
    assert!(
        ask(&["--allow-all"], "(probe-file \"/etc/passwd\")")
            .contains("is not permitted; run with --allow-read=/etc/passwd.")
    );
    // Files below the folder of the run need no flag, and the session starts only with flags that parse.
    assert_eq!(ask(&[], "(and (probe-file \"own\") t)"), "T\n");
    folder.file("wrong", "read everything\n");
    assert!(ask(&["--rights", &folder.join("wrong")], "1").contains("wrong:1:"));
    assert_eq!(run.end(), Some(0));
}

/// Each access to the outside asks for its right; the refusal has the right, the object, and the whole flag.
#[cfg(unix)]
#[test]
fn every_access_to_the_outside_needs_its_right() {
    let rows = [
        (r#"(os:getenv "HOME")"#, ":ENV", "HOME"),
        (r#"(process:run-program '("ls" "-l"))"#, ":RUN", "ls"),
        (r#"(process:launch-program '("/bin/ls"))"#, ":RUN", "/bin/ls"),
        (r#"(sockets:connect "127.0.0.1" 80)"#, ":NET", "127.0.0.1:80"),
        (r#"(sockets:connect "::1" 80 :tls t)"#, ":NET", "[::1]:80"),
        (r#"(sockets:listen "0.0.0.0" 0)"#, ":NET", "0.0.0.0:0"),
        ("(sockets:udp-open)", ":NET", "0.0.0.0:0"),
        (r#"(sockets:udp-open "127.0.0.1" 9)"#, ":NET", "127.0.0.1:9"),
        (r#"(sockets:with-server ((c "127.0.0.1" 80)) c)"#, ":NET", "127.0.0.1:80"),
        (r#"(sockets:connect-unix "/tmp/x")"#, ":READ", "/tmp/x"),
        (r#"(sockets:listen-unix "/tmp/x")"#, ":READ", "/tmp/x"),
        (r#"(http:get "http://example.com/x")"#, ":NET", "example.com:80"),
        (r#"(http:post "https://example.com/x" :body "y")"#, ":NET", "example.com:443"),
        (r#"(http:with-server (8080) (:get "/" () "x"))"#, ":NET", "127.0.0.1:8080"),
        (r#"(ws:with-connection (c "ws://h/x") c)"#, ":NET", "h:80"),
        (r#"(ws:with-connection (c "wss://h:9/x" :ca-file "/tmp/x") c)"#, ":NET", "h:9"),
        (r#"(mqtt:with-client (c "h" 1883) c)"#, ":NET", "h:1883"),
        (r#"(serial:with-serial-port (s "/dev/ttyS0") s)"#, ":SERIAL", "/dev/ttyS0"),
        (r#"(log:to-file "/tmp/log")"#, ":WRITE", "/tmp/log"),
        (r#"(watch-path "/tmp")"#, ":READ", "/tmp"),
        (r#"(load "/tmp/x.esl")"#, ":READ", "/tmp/x.esl"),
        (r#"(open "/tmp/x")"#, ":READ", "/tmp/x"),
        (r#"(open "/tmp/x" :direction :output)"#, ":WRITE", "/tmp/x"),
        (r#"(probe-file "/tmp/x")"#, ":READ", "/tmp/x"),
        (r#"(file-write-date "/tmp/x")"#, ":READ", "/tmp/x"),
        (r#"(directory "/tmp/*")"#, ":READ", "/tmp/"),
        (r#"(delete-file "/tmp/x")"#, ":WRITE", "/tmp/x"),
        (r#"(rename-file "own" "/tmp/x")"#, ":WRITE", "/tmp/x"),
        (r#"(rename-file "/tmp/x" "new")"#, ":WRITE", "/tmp/x"),
        (r#"(ensure-directories-exist "/tmp/a/b/")"#, ":WRITE", "/tmp/a/b/"),
    ];
    let folder = folder("rights-of-all");
    let mut program = String::from(
        "(require :sockets) (require :process) (require :http) (require :mqtt) (require :serial) (require :log)
         (require :os) (require :ws)
         (defmacro refusal (form)
           `(with-recovery-procedures (((:permission-denied right object flag) (abort (list right object flag))))
              ,form))\n",
    );
    let mut expected = Vec::new();
    for (form, right, object) in rows {
        program += &format!("(format t \"~s~%\" (refusal {form}))\n");
        let name = right.trim_start_matches(':').to_lowercase();
        expected.push(format!("({right} {object:?} \"--allow-{name}={object}\")"));
    }
    folder.file("work/all.esl", program);
    let mut command = eslvm(&["run", "all.esl"]);
    let run = process::run(command.current_dir(folder.path().join("work")), "");
    assert_eq!(run.output.lines().collect::<Vec<_>>(), expected, "{}", run.errors);
}

/// A Unix socket is a path that is read and written: one right does not stand for the other.
#[cfg(unix)]
#[test]
fn a_unix_socket_needs_both_rights() {
    let text = "(require :sockets)
(defmacro refusal (form)
  `(print (with-recovery-procedures (((:permission-denied right object) (abort (list right object)))) ,form)))
(with-rights (:read) (refusal (sockets:listen-unix \"talk\")))
(with-rights (:write) (refusal (sockets:listen-unix \"talk\")))
(sockets:with-socket (l (sockets:listen-unix \"talk\"))
  (with-rights (:read) (refusal (sockets:connect-unix \"talk\")))
  (with-rights (:write) (refusal (sockets:connect-unix \"talk\")))
  (with-rights (:read :write) (close (sockets:connect-unix \"talk\"))))";
    let folder = folder("rights-unix");
    folder.file("work/main.esl", text);
    let (read, write) = ("(:READ \"talk\")", "(:WRITE \"talk\")");
    assert_eq!(lines(&folder, &[]), [write, read, write, read]);
}

/// A call that a script or a mock answers reaches nothing outside; any other call needs its right.
#[test]
fn what_a_script_or_a_mock_answers_needs_no_right() {
    let text = "(require :process) (require :sockets)
(defmacro refusal (form)
  `(print (with-recovery-procedures (((:permission-denied right object) (abort (list right object)))) ,form)))
(with-world ((:answer (process:run-program * . *) :with 'scripted :times 1)
             (:answer (sockets:connect \"127.0.0.1\" *) :failing (:connection-refused)))
  (refusal (process:run-program '(\"ls\")))
  (refusal (handler-case (sockets:connect \"127.0.0.1\" 80) (failure (f) (failure-cause f))))
  (refusal (process:run-program '(\"ls\")))
  (refusal (sockets:connect \"127.0.0.2\" 80)))
(define-mock process::%process-run (&rest all) (values \"mocked\" nil (length all)))
(refusal (process:run-program '(\"ls\") :output :string))";
    let folder = folder("rights-mocks");
    folder.file("work/main.esl", text);
    let expected =
        ["SCRIPTED", ":CONNECTION-REFUSED", "(:RUN \"ls\")", "(:NET \"127.0.0.2:80\")", "\"mocked\""];
    assert_eq!(lines(&folder, &[]), expected);
}

/// Tests have the rights of the command, and no others.
#[test]
fn tests_have_the_same_flags() {
    let folder = folder("rights-test");
    folder.file(
        "work/tests.esl",
        "(defun text (path) (with-open-file (stream path) (read-line stream)))
         (deftest own (is (equal (text \"own\") \"mine\")))
         (deftest other (is (equal (text \"../other/secret\") \"5\")))",
    );
    let test = |arguments: &[&str]| {
        let mut command = eslvm(&[&["test"], arguments, &["tests.esl"]].concat());
        let done = process::run(command.current_dir(folder.path().join("work")), "");
        (done.status, done.output)
    };
    let (status, output) = test(&[]);
    assert_eq!(status, Some(1), "{output}");
    assert!(output.contains("passed  OWN") && output.contains("FAILED  OTHER"), "{output}");
    assert!(output.contains("--allow-read=../other/secret"), "{output}");
    assert_eq!(test(&["--allow-read=../other"]).0, Some(0));
}

#[test]
fn modules_are_read_in_their_folders_and_macros_read_nothing_else() {
    let files = [
        ("work/main.esl", "(require :table)\n(print (table:size))\n(print (table:early))"),
        (
            "lib/table.esl",
            "(defpackage :table (:use :esl) (:export :size :early))
             (in-package :table)
             (defun text () (with-open-file (stream \"../lib/data\") (read-line stream)))
             (defun size ()
               (with-recovery-procedures (((:permission-denied right object) (abort (list right object))))
                 (length (text))))
             (defmacro early ()
               (with-recovery-procedures (((:permission-denied right object) (abort `'(,right ,object))))
                 (with-open-file (stream \"../lib/data\") (read-line stream))))",
        ),
        ("lib/data", "12345"),
    ];
    let folder = Folder::with("rights-modules", &files);
    let library = ["--library", "../lib"];
    let read = lines(&folder, &[&library[..], &["--allow-read=../lib"]].concat());
    assert_eq!(read, ["5", "(:READ \"../lib/data\")"]);
    assert_eq!(lines(&folder, &library)[0], "(:READ \"../lib/data\")");
    // Found when the program runs, as a source.
    folder.file(
        "work/main.esl",
        "(let ((name \"table\")) (require name)) (print (funcall (find-symbol \"SIZE\" :table)))",
    );
    assert_eq!(lines(&folder, &library), ["(:READ \"../lib/data\")"]);
}
