//! Wrong command lines and damaged, endless or huge input: each ends with a message and the right status,
//! without a crash or a wait without end.

use std::io::{Read, Write};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use esl_conformance::folder::Folder;
use esl_conformance::process::{self, Finished, PATIENCE, finish, run, start};

use crate::{ESLVM, eslc, eslc_path, eslvm};

/// Checks that a command ends with `status`, and with `message` among what it writes to standard error.
#[track_caller]
fn check(done: &Finished, status: i32, message: &str) {
    assert_eq!(done.status, Some(status), "{done:?}");
    assert!(done.errors.contains(message), "expected `{message}` in {}", done.errors);
    assert!(!done.errors.contains("panicked"), "{}", done.errors);
    assert!(done.errors.len() < 30_000, "the message has {} bytes", done.errors.len());
}

#[track_caller]
fn check_source(test: &str, text: impl AsRef<[u8]>, message: &str) {
    let folder = Folder::new(test);
    let path = folder.file("program.esl", text);
    check(&run(&mut eslvm(&["run", &path]), b""), 3, message);
    check(&run(&mut eslc(&["check", &path]), b""), 3, message);
}

#[test]
fn unbalanced_sources() {
    check_source("unclosed", "(print 1\n(print 2)\n", "error[unclosed-list]");
    check_source("unopened", "(print 1))\n", "error[unexpected-close]");
    check_source("string", "(print \"abc)\n", "error[unclosed-string]");
    check_source("comment", "(print 1) #| #| |#\n", "error[unclosed-comment]");
    check_source("many", ")\n".repeat(100_000), "error[unexpected-close]");
}

#[test]
fn wrong_uses_of_macros_show_the_right_one() {
    check_source(
        "told-usage",
        "(dolist x (print x))",
        "= help: it is written `(dolist (variable list [result]) . body)`",
    );
    check_source("parameters", "(when)", "= help: it is written `(when test &body body)`");
}

#[test]
fn tokens_of_a_megabyte() {
    let size = 1 << 20;
    check_source("name", format!("(print '{})", "a".repeat(size)), "error[token-too-long]");
    check_source("number", format!("(print {})", "9".repeat(size)), "error[token-too-long]");
    let folder = Folder::new("long-string");
    let path = folder.file("program.esl", format!("(princ (length \"{}\"))", "x".repeat(size)));
    let done = run(&mut eslvm(&["run", &path]), b"");
    assert_eq!((done.status, done.output.trim()), (Some(0), "1048576"));
}

#[test]
fn nesting_a_million_deep() {
    let deep = 1_000_000;
    for (name, open, close) in
        [("lists", "(", ")"), ("quotes", "'", ""), ("vectors", "#(", ")"), ("backquotes", "`", "")]
    {
        let text = format!("(print '{}x{})", open.repeat(deep), close.repeat(deep));
        check_source(name, text, "error[nested-too-deeply]");
    }
    check_source("open-lists", "(f\n".repeat(deep), "error[nested-too-deeply]");
    check_source("comments", "#|".repeat(deep), "error[unclosed-comment]");
}

#[test]
fn bytes_that_are_no_text() {
    check_source("latin-1", b"(print \"\xe4\")", "error[invalid-utf-8]");
    check_source("zeros", "(print 1)\0\0", "error[invalid-character]");
}

#[test]
fn a_source_without_end() {
    let mut child = start(&mut eslvm(&["run", "-"]));
    let mut pipe = child.stdin.take().expect("the input is a pipe");
    let piece = "(".repeat(1 << 16);
    let writer = std::thread::spawn(move || while pipe.write_all(piece.as_bytes()).is_ok() {});
    check(&finish(child), 2, "<stdin> is too long: at most 64 MiB are read");
    writer.join().expect("writing does not fail");
}

#[test]
fn files_that_cannot_be_read() {
    let folder = Folder::new("unreadable");
    let missing = folder.join("missing.esl");
    let directory = folder.path().display().to_string();
    let source = folder.file("program.esl", "(print 1)");
    let compiler = eslc_path();
    for (program, action) in [
        (ESLVM, "run"),
        (&*compiler, "check"),
        (&*compiler, "compile"),
        (&*compiler, "expand"),
        (&*compiler, "disasm"),
    ] {
        check(
            &run(&mut process::command(program, &[action, &missing]), b""),
            2,
            "cannot be read: the file does not exist",
        );
        // A folder is checked with all that is in it.
        if action != "check" {
            check(&run(&mut process::command(program, &[action, &directory]), b""), 2, "it is a directory");
            check(&run(&mut process::command(program, &[action]), b""), 2, "<FILE>");
        }
    }
    let output = folder.join("no-folder/x.eslb");
    check(&run(&mut eslc(&["compile", &source, "-o", &output]), b""), 2, "cannot be written");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        std::fs::set_permissions(&source, std::fs::Permissions::from_mode(0o000)).expect("it is our file");
        // A superuser may read it nevertheless.
        if std::fs::read(&source).is_err() {
            check(&run(&mut eslvm(&["run", &source]), b""), 2, "permission denied");
        }
        std::fs::set_permissions(&source, std::fs::Permissions::from_mode(0o600)).expect("it is our file");
    }
}

#[test]
fn files_that_a_program_cannot_make() {
    let folder = Folder::new("cannot_make");
    let text = "(handler-case (open \"no-such-folder/x\" :direction :output)
                  (file-error (condition) (print (file-error-pathname condition)) (error condition)))";
    let done = run(&mut eslvm(&["run", &folder.file("main.esl", text)]), b"");
    assert!(done.output.contains("\"no-such-folder/x\""), "{done:?}");
    check(&done, 1, "The file \"no-such-folder/x\": it cannot be written");
}

#[test]
fn wrong_command_lines() {
    for (arguments, message) in [
        (&["frob"][..], "unrecognized subcommand"),
        (&["run", "--frob", "x.esl"], "unexpected argument"),
        (&["run", "--slice", "0", "x.esl"], "invalid value"),
        (&["run", "--budget", "many", "x.esl"], "invalid value"),
        (&["run", "--memory", "1", "x.esl"], "at least 4M"),
        (&["run", "--memory", "99999999999999G", "x.esl"], "more than there can be"),
        (&["attach", "--library", "lib", "4005"], "unexpected argument '--library'"),
        (&["replay", "-q", "x.eslj"], "unexpected argument '-q'"),
    ] {
        check(&run(&mut eslvm(arguments), b""), 2, message);
    }
    check(&run(&mut eslc(&["compile", "-"]), b"(print 1)"), 2, "name the output with -o");
    let done = run(&mut eslc(&["format", "--messages", "json", "x.esl"]), b"");
    check(&done, 2, "unexpected argument '--messages'");
    assert_eq!(run(&mut eslvm(&["--help"]), b"").status, Some(0));
    assert_eq!(run(&mut eslc(&["--version"]), b"").status, Some(0));
}

#[test]
fn damaged_bytecode() {
    let folder = Folder::new("bytecode");
    let source = folder.file("program.esl", "(defun f (x) (list x \"a\" 1.5)) (princ (f 'b))");
    let compiled = folder.join("program.eslb");
    assert_eq!(run(&mut eslc(&["compile", &source, "-o", &compiled]), b"").status, Some(0));
    let bytes = std::fs::read(&compiled).expect("it was written");
    let done = run(&mut eslvm(&["run", "-"]), &bytes);
    assert_eq!((done.status, done.output.trim()), (Some(0), "(B a 1.5)"));
    check(&run(&mut eslc(&["compile", &compiled]), b""), 2, "is compiled already");
    for length in [0, 4, 8, 31, 100, bytes.len() / 2, bytes.len() - 1] {
        let path = folder.file("short.eslb", &bytes[..length]);
        check(&run(&mut eslvm(&["run", &path]), b""), 3, "short.eslb is not a valid program");
    }
    for position in (0..bytes.len()).step_by(bytes.len() / 40) {
        let mut changed = bytes.clone();
        changed[position] ^= 1 << (position % 8);
        let path = folder.file("changed.eslb", changed);
        check(&run(&mut eslvm(&["run", &path]), b""), 3, "changed.eslb is not a valid program");
    }
    let path = folder.file("source.eslb", "(print 1)");
    check(&run(&mut eslvm(&["run", &path]), b""), 3, "not a compiled ESL file");
}

#[test]
fn a_reader_that_goes_away_ends_the_program_quietly() {
    let text =
        b"(unwind-protect (dotimes (i 10000000) (format t \"~d~%\" i)) (format *error-output* \"cleaned\"))";
    let folder = Folder::new("pipe");
    let path = folder.file("program.esl", text);
    let mut child = start(&mut eslvm(&["run", &path]));
    let mut first = [0; 2];
    let mut pipe = child.stdout.take().expect("the output is a pipe");
    pipe.read_exact(&mut first).expect("there is output");
    drop(pipe);
    let done = finish(child);
    assert_eq!(&first, b"0\n");
    // As a shell shows for programs that SIGPIPE has ended.
    check(&done, 141, "cleaned");
    assert_eq!(done.errors.trim(), "cleaned");
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_is_a_failure() {
    let folder = Folder::new("full");
    let path = folder.file("program.esl", "(dotimes (i 100000) (print i)) (finish-output)");
    let full = std::fs::File::options().write(true).open("/dev/full").expect("Linux has it");
    let child = Command::new(ESLVM)
        .args(["run", &path])
        .stdin(Stdio::null())
        .stdout(full)
        .stderr(Stdio::piped())
        .spawn()
        .expect("the command is there");
    check(&finish(child), 1, "Failure :STREAM-ERROR, no recovery available.");
}

#[cfg(unix)]
fn interrupt(child: &Child) {
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(sent.expect("there is a kill").success());
}

/// Starts a program and waits until it has printed something.
#[cfg(unix)]
fn started(test: &str, text: &str) -> Child {
    let folder = Folder::new(test);
    let path = folder.file("program.esl", text);
    let mut child = start(&mut eslvm(&["run", &path]));
    let mut pipe = child.stdout.take().expect("the output is a pipe");
    pipe.read_exact(&mut [0; 1]).expect("the program begins");
    child.stdout = Some(pipe);
    child
}

#[test]
#[cfg(unix)]
fn an_interrupt_aborts_an_endless_loop_and_runs_its_cleanups() {
    let text = "(princ 1) (finish-output) (unwind-protect (loop) (princ 'cleaned))";
    let child = started("interrupt", text);
    interrupt(&child);
    let done = finish(child);
    check(&done, 130, "interrupted");
    assert_eq!(done.output, "CLEANED");
}

#[test]
#[cfg(unix)]
fn a_second_interrupt_ends_what_does_not_give_way() {
    let child = started("interrupts", "(princ 1) (finish-output) (unwind-protect (loop) (loop))");
    let end = Instant::now() + PATIENCE;
    let mut child = child;
    while child.try_wait().expect("a child can be waited for").is_none() && Instant::now() < end {
        interrupt(&child);
        std::thread::sleep(Duration::from_millis(50));
    }
    assert_eq!(finish(child).status, Some(130));
}

#[test]
#[cfg(unix)]
fn an_interrupt_ends_a_wait_for_input() {
    let mut child = started("reading", "(princ 1) (finish-output) (print (read-line))");
    let input = child.stdin.take();
    std::thread::sleep(Duration::from_millis(50));
    interrupt(&child);
    let done = finish(child);
    drop(input);
    check(&done, 130, "interrupted");
}

#[test]
#[cfg(unix)]
fn a_read_that_was_left_does_not_put_off_the_report_of_a_deadlock() {
    let text = "(princ 1) (finish-output)
(print (handler-case (with-timeout 0.01 (read-line)) (failure () 'time-is-up)))
(wait-for-event (make-event 'never))";
    let mut child = started("left-read", text);
    let input = child.stdin.take();
    let done = finish(child);
    drop(input);
    check(&done, 4, "waits for event NEVER");
}

#[test]
fn no_command_writes_over_what_it_reads() {
    let text = "(require \"part\")\n(print (part))\n";
    let folder = Folder::with("overwrite", &[("program.esl", text), ("part.esl", "(defun part () 1)")]);
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (program, part) = (path("program.esl"), path("part.esl"));
    let message = "is read and cannot be written";
    let indirect = path("../overwrite/program.esl");
    check(&run(&mut eslc(&["compile", &program, "-o", &program]), b""), 2, message);
    check(&run(&mut eslc(&["compile", &program, "-o", &part]), b""), 2, "has the name of a source");
    if std::fs::exists(&indirect).expect("the folder can be read") {
        check(&run(&mut eslc(&["compile", &program, "-o", &indirect]), b""), 2, message);
    }
    let link = path("link.txt");
    std::fs::hard_link(&program, &link).expect("the folder takes links");
    check(&run(&mut eslc(&["compile", &program, "-o", &link]), b""), 2, message);
    // Other sources are not lost either.
    let (other, message) = (path("other.lisp"), "other.lisp exists and has the name of a source");
    std::fs::write(&other, text).expect("the folder can be written");
    check(&run(&mut eslc(&["compile", &program, "-o", &other]), b""), 2, message);
    check(&run(&mut eslvm(&["test", "--junit", &other, &program]), b""), 2, message);
    for option in ["--timeline", "--coverage", "--profile", "--record"] {
        check(&run(&mut eslvm(&["run", option, &program, &program]), b""), 2, "is read and cannot be");
        check(&run(&mut eslvm(&["run", option, &other, &program]), b""), 2, message);
    }
    for source in [program, other] {
        assert_eq!(std::fs::read_to_string(source).expect("it is there"), text);
    }
}

#[test]
fn a_budget_of_nothing_is_spent_at_once() {
    let folder = Folder::new("no-budget");
    let path = folder.file("program.esl", "(print 1)");
    check(&run(&mut eslvm(&["run", "--budget", "0", &path]), b""), 5, "the budget of 0 ticks is spent");
}

#[test]
fn messages_for_tools_have_one_object_a_line() {
    let folder = Folder::new("json-lines");
    let path = folder.file("program.esl", "(car)\n(undefined x)\n(let ((y 1)) (print 1))\n");
    let done = run(&mut eslc(&["check", "--messages", "json", &path]), b"");
    assert!(done.errors.lines().count() >= 3, "{}", done.errors);
    assert!(done.errors.lines().all(|line| line.starts_with('{') && line.ends_with('}')), "{}", done.errors);
}

#[test]
fn of_many_warnings_people_are_shown_the_first() {
    // All stand on one line, whose length each excerpt takes time for.
    let folder = Folder::new("many-warnings");
    let variables: String = (0..300).map(|number| format!("(v{number} 1)")).collect();
    let path = folder.file("program.esl", format!("(print (let ({variables}) 1))"));
    let done = run(&mut eslc(&["check", &path]), b"");
    assert_eq!(done.errors.matches("warning[unused-variable]").count(), 100, "{}", done.errors);
    assert!(
        done.errors.ends_with("eslc: 300 warnings, of which the first 100 are shown\n"),
        "{}",
        done.errors
    );
    let done = run(&mut eslc(&["check", "--messages", "json", &path]), b"");
    assert_eq!(done.errors.lines().count(), 300);
}
