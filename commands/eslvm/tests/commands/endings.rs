//! The ends of a run that the outside wants: cleanups run, and the status says which signal it was.

use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, Command, Stdio};

use esl_conformance::folder::Folder;
use esl_conformance::process;

use crate::{eslc, eslvm};

/// A program that is started and has printed its first line.
struct Running {
    child: Child,
    output: BufReader<std::process::ChildStdout>,
    _folder: Folder,
}

/// The end of a program.
struct Ended {
    status: Option<i32>,
    output: String,
    errors: String,
}

impl Running {
    fn start(name: &str, text: &str) -> Running {
        let folder = Folder::new(name);
        let path = folder.file("program.esl", text);
        let mut command = eslvm(&["run", &path]);
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().expect("the command is there");
        let mut output = BufReader::new(child.stdout.take().expect("the output is a pipe"));
        output.read_line(&mut String::new()).expect("the program begins");
        Running { child, output, _folder: folder }
    }

    fn send(&self, signal: &str) {
        let sent = Command::new("kill").args([signal, &self.child.id().to_string()]).status();
        assert!(sent.expect("there is a kill").success());
    }

    /// Waits for a line of output.
    fn line(&mut self) -> String {
        let mut line = String::new();
        self.output.read_line(&mut line).expect("output is text");
        line.trim().to_owned()
    }

    fn end(mut self) -> Ended {
        let mut output = String::new();
        self.output.read_to_string(&mut output).expect("output is text");
        let done = self.child.wait_with_output().expect("a child can be waited for");
        let errors = String::from_utf8_lossy(&done.stderr).into_owned();
        Ended { status: done.status.code(), output, errors }
    }
}

/// Tasks that switch a motor off at their ends, in the order in which they were made.
const MOTORS: &str = "(defun run-motor (name)
  (unwind-protect (loop (sleep 0.001))
    (format t \"~a is off~%\" name)
    (finish-output)))
(spawn (:name 'left) (run-motor 'left))
(spawn (:name 'right) (run-motor 'right))
(sleep 0.01)
(format t \"begun~%\")
(finish-output)
(run-motor 'main)";

#[test]
fn every_signal_ends_a_run_with_its_cleanups_newest_first() {
    for (signal, status, said) in
        [("-TERM", 143, "terminated"), ("-HUP", 129, "hung up"), ("-INT", 130, "interrupted")]
    {
        let running = Running::start(&format!("signal{signal}"), MOTORS);
        running.send(signal);
        let ended = running.end();
        assert_eq!(
            (ended.status, &*ended.output),
            (Some(status), "RIGHT is off\nLEFT is off\nMAIN is off\n")
        );
        assert!(ended.errors.contains(said), "{}", ended.errors);
    }
}

#[test]
fn every_other_ending_runs_the_cleanups_too() {
    let ways = [
        ("(sleep 1)", &[][..]),
        ("(exit 9)", &[]),
        ("(fail :lost)", &[]),
        ("(wait-for-event (make-event))", &[]),
        ("(loop)", &["--budget", "200000"]),
        ("(let ((all nil)) (loop (push (make-array 1000) all)))", &["--memory", "16M"]),
        ("(labels ((deep (n) (+ 1 (deep n)))) (deep 0))", &["--memory", "16M"]),
        ("(without-interrupts (loop))", &[]),
        ("(progn (spawn (fail :lost)) (sleep 1) (abort-task (current-task)))", &[]),
    ];
    let folder = Folder::new("ways");
    for (way, options) in ways {
        // When every task waits for an event that cannot come, the motors do not keep the run going.
        let motor =
            "(unwind-protect (wait-for-event (make-event)) (sleep 0.01) (format t \"~a is off~%\" name))";
        let program = format!(
            "(defun run-motor (name) {motor})
             (spawn (:name 'left :daemon t) (run-motor 'left))
             (spawn (:name 'right :daemon t) (run-motor 'right))
             (sleep 0.01)
             (unwind-protect {way} (format t \"the main task leaves~%\"))"
        );
        let path = folder.file("program.esl", program);
        let arguments = [&["run", "--clock", "virtual"], options, &[&*path]].concat();
        let run = process::run(&mut eslvm(&arguments), "");
        let off = ["LEFT is off", "RIGHT is off", "the main task leaves"];
        let said = |line: &&str| run.output.lines().filter(|said| said == line).count() == 1;
        assert!(off.iter().all(said), "{way}: {} {}", run.output, run.errors);
    }
}

#[test]
fn a_second_interrupt_cuts_the_end_short_and_names_what_is_left() {
    let text = "(spawn (:name 'arm)
                  (unwind-protect (loop (sleep 1))
                    (format t \"stowing~%\")
                    (finish-output)
                    (sleep 100)))
                (sleep 0.01)
                (format t \"begun~%\")
                (finish-output)
                (loop (sleep 1))";
    let mut running = Running::start("cut", text);
    running.send("-TERM");
    assert_eq!(running.line(), "stowing");
    running.send("-INT");
    let ended = running.end();
    assert_eq!(ended.status, Some(143), "{}", ended.errors);
    assert!(ended.errors.contains("Unfinished tasks:\n"), "{}", ended.errors);
    assert!(ended.errors.contains("  task ARM, in a cleanup, "), "{}", ended.errors);
}

#[test]
fn a_second_signal_that_is_no_interrupt_leaves_the_cleanups_their_time() {
    let text = "(format t \"begun~%\")
                (finish-output)
                (unwind-protect (loop (sleep 1))
                  (format t \"stowing~%\")
                  (finish-output)
                  (sleep 0.3)
                  (format t \"stowed~%\"))";
    let mut running = Running::start("not-cut", text);
    running.send("-TERM");
    assert_eq!(running.line(), "stowing");
    running.send("-TERM");
    running.send("-HUP");
    let ended = running.end();
    assert_eq!((ended.status, &*ended.output), (Some(143), "stowed\n"), "{}", ended.errors);
}

#[test]
fn the_end_of_a_run_has_the_time_that_is_given() {
    let text = "(spawn (:name 'arm) (unwind-protect (loop (sleep 1)) (sleep 100) (princ 'never)))
                (wait-for-event (make-event))";
    let folder = Folder::new("cleanup-time");
    let path = folder.file("program.esl", text);
    let arguments = ["run", "--clock", "virtual", "--cleanup-time", "5", "--budget", "100000", &path];
    let run = process::run(&mut eslvm(&arguments), "");
    assert_eq!((run.status, &*run.output), (Some(5), ""), "{}", run.errors);
    assert!(run.errors.contains("A cleanup of task ARM takes too long and is cut off."), "{}", run.errors);
}

#[test]
fn a_signal_that_the_program_handles_does_not_end_it() {
    let program = "(define-input seen :capacity 9)
(on-signal :hup (signal seen 'hup))
(on-signal :term (signal seen 'term))
(on-signal :int (signal seen 'int))
(format t \"begun~%\")
(finish-output)
(loop repeat 5 do (format t \"~a~%\" (wait-for-event seen)) (finish-output))";
    let mut running = Running::start("handled", program);
    for (signal, name) in
        [("-HUP", "HUP"), ("-INT", "INT"), ("-INT", "INT"), ("-INT", "INT"), ("-TERM", "TERM")]
    {
        running.send(signal);
        assert_eq!(running.line(), name);
    }
    let ended = running.end();
    assert_eq!((ended.status, &*ended.errors), (Some(0), ""));
}

/// Each signal by which the system ends a process ends the run with its cleanups, but for those that report
/// a fault of the process itself.
#[cfg(target_os = "linux")]
#[test]
fn whatever_signal_ends_a_run_the_motors_are_switched_off() {
    for number in [1, 2, 3, 6, 10, 12, 14, 15, 16, 24, 26, 27, 29, 30, 31, 34, 64] {
        let text = "(format t \"begun~%\")
                    (finish-output)
                    (unwind-protect (loop (sleep 0.01)) (format t \"off~%\"))";
        let running = Running::start(&format!("signal-{number}"), text);
        running.send(&format!("-{number}"));
        let ended = running.end();
        let expected = (Some(128 + number), "off\n");
        assert_eq!((ended.status, &*ended.output), expected, "{number}: {}", ended.errors);
    }
}

#[test]
fn a_program_handles_signals_whose_meaning_is_its_own() {
    let text = "(define-input seen :capacity 9)
(on-signal :usr1 (signal seen 'usr1))
(on-signal :winch (signal seen 'winch))
(on-signal :hup (signal seen 'hup))
(format t \"begun~%\")
(finish-output)
(loop repeat 4 do (format t \"~a~%\" (wait-for-event seen)) (finish-output))
(on-signal :usr2 (exit 3))
(format t \"more~%\")
(finish-output)
(wait-for-event (make-event))";
    let mut running = Running::start("users-signals", text);
    for (signal, name) in [("-USR1", "USR1"), ("-WINCH", "WINCH"), ("-HUP", "HUP"), ("-USR1", "USR1")] {
        running.send(signal);
        assert_eq!(running.line(), name);
    }
    assert_eq!(running.line(), "more");
    running.send("-USR2");
    let ended = running.end();
    assert_eq!((ended.status, &*ended.errors), (Some(3), ""));
}

/// Another size of the terminal, a pipe without a reader, and a stop end nothing.
#[test]
fn signals_that_are_not_for_the_program_change_nothing() {
    let text =
        "(format t \"begun~%\") (finish-output) (read-line *standard-input* nil) (sleep 0.3) (print 'end)";
    let running = Running::start("no-signals", text);
    for signal in ["-WINCH", "-URG", "-CHLD", "-PIPE", "-STOP", "-CONT"] {
        running.send(signal);
    }
    let ended = running.end();
    assert_eq!((ended.status, ended.output.trim(), &*ended.errors), (Some(0), "END", ""));
}

/// Beyond the limit of the size of files a write fails, and the program goes on.
#[cfg(target_os = "linux")]
#[test]
fn a_limit_of_the_size_of_files_fails_the_write() {
    let text = "(defun write-much () (with-open-file (s \"large\" :direction :output)
                    (dotimes (i 100000) (write-string \"0123456789\" s))))
(unwind-protect
     (print (handler-case (write-much) (error (e) (type-of e))))
  (print 'off))";
    let folder = Folder::with("size-limit", &[("program.esl", text)]);
    let program = crate::ESLVM;
    let mut command = Command::new("sh");
    command.args(["-c", "ulimit -f 100; exec \"$0\" run program.esl", program]).current_dir(folder.path());
    let run = process::run(&mut command, "");
    assert_eq!(run.status, Some(0), "{}", run.errors);
    assert_eq!(run.output.split_whitespace().collect::<Vec<_>>(), ["STREAM-ERROR", "OFF"], "{}", run.errors);
}

/// A program whose output is not read any more ends with its cleanups, and with a status other than success.
#[test]
fn an_output_that_nobody_reads_ends_the_run_as_sigpipe_does() {
    let text = "(unwind-protect (loop (format t \"line~%\"))
  (with-open-file (s \"off\" :direction :output) (write-line \"off\" s)))";
    let folder = Folder::with("no-reader", &[("program.esl", text)]);
    let mut command = eslvm(&["run", "program.esl"]);
    command.current_dir(folder.path()).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("the command is there");
    let mut output = BufReader::new(child.stdout.take().expect("the output is a pipe"));
    output.read_line(&mut String::new()).expect("the program begins");
    drop(output);
    let done = child.wait_with_output().expect("a child can be waited for");
    let errors = String::from_utf8_lossy(&done.stderr);
    assert_eq!((done.status.code(), &*errors), (Some(141), ""));
    assert!(folder.path().join("off").exists());
}

/// Messages of commands are lost where they cannot be written; the status is as ever.
#[test]
#[cfg(target_os = "linux")]
fn outputs_that_cannot_be_written_stop_no_command() {
    let program =
        "(unwind-protect (sleep 0.01) (with-open-file (s \"off\" :direction :output) (write-line \"\" s)))";
    let tests = "(deftest one (is (= 1 1)))\n(deftest two (is (= 1 2)))";
    let files = [("program.esl", program), ("one_test.esl", tests), ("wide.esl", "(setq  x 1)")];
    let folder = Folder::with("full-output", &files);
    let recorded = process::run(
        eslvm(&["run", "program.esl", "--record", "program.eslj"]).current_dir(folder.path()),
        "",
    );
    assert_eq!(recorded.status, Some(0), "{}", recorded.errors);
    let full = || std::fs::File::options().write(true).open("/dev/full").expect("Linux has it");
    let cases: &[(&[&str], &str, i32)] = &[
        (&["run", "--stats", "program.esl"], "", 0),
        (&["test", "one_test.esl"], "", 1),
        (&["test", "one_test.esl", "--filter", "one"], "", 0),
        (&["test", "--coverage", "all.info", "one_test.esl", "--filter", "one"], "", 0),
        (&["explore", "program.esl"], "", 0),
        (&["replay", "program.eslj"], "", 0),
        (&["replay", "program.eslj", "--until", "tick:100"], "tasks\nbt\n", 0),
        (&["repl"], "(+ 1 2)\n(car 1)\n:bt\n", 0),
    ];
    for (arguments, input, status) in cases {
        let mut command = eslvm(arguments);
        command.current_dir(folder.path()).stdin(Stdio::piped()).stdout(full()).stderr(full());
        let mut child = command.spawn().expect("the command is there");
        let mut stdin = child.stdin.take().expect("the input is a pipe");
        drop(stdin.write_all(input.as_bytes()));
        drop(stdin);
        assert_eq!(child.wait().expect("it ends").code(), Some(*status), "{arguments:?}");
    }
    assert!(folder.path().join("off").exists());
    let mut format = eslc(&["format", "--check", "wide.esl"]);
    format.current_dir(folder.path()).stdout(full()).stderr(full());
    assert_eq!(format.status().expect("the command is there").code(), Some(1));
}

#[test]
fn a_signal_ends_a_session_of_the_repl_with_its_cleanups() {
    for (signal, status) in [("-TERM", 143), ("-HUP", 129)] {
        let mut command = eslvm(&["repl"]);
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().expect("the command is there");
        let mut input = child.stdin.take().expect("the input is a pipe");
        let forms = "(progn (spawn (unwind-protect (loop (sleep 0.01)) (format t \"off~%\")))
                            (sleep 0.01)
                            (princ \"begun\")
                            (terpri)
                            1)\n";
        input.write_all(forms.as_bytes()).expect("it reads");
        let mut output = BufReader::new(child.stdout.take().expect("the output is a pipe"));
        let mut line = String::new();
        while !line.contains("begun") {
            line.clear();
            output.read_line(&mut line).expect("output is text");
        }
        let sent = Command::new("kill").args([signal, &child.id().to_string()]).status();
        assert!(sent.expect("there is a kill").success());
        let mut rest = String::new();
        output.read_to_string(&mut rest).expect("output is text");
        assert_eq!(child.wait().expect("it ends").code(), Some(status), "{rest}");
        assert!(rest.contains("off"), "{rest}");
    }
}

#[test]
fn a_signal_ends_a_compilation_with_the_cleanups_of_what_runs() {
    let text = "(eval-when (:compile-toplevel)
                  (unwind-protect (progn (format t \"begun~%\") (finish-output) (loop (sleep 0.001)))
                    (format t \"off~%\")))";
    for (signal, status, said) in [("-TERM", 143, "terminated"), ("-INT", 130, "interrupted")] {
        let running = Running::start(&format!("compiling{signal}"), text);
        running.send(signal);
        let ended = running.end();
        assert_eq!((ended.status, &*ended.output), (Some(status), "off\n"), "{}", ended.errors);
        assert!(ended.errors.contains(said), "{}", ended.errors);
    }
}

#[test]
fn the_limits_of_a_run_hold_for_its_compilation() {
    let folder = Folder::new("compiling-limits");
    let endless = "(defmacro m (n) `(progn (f ,n) (m ,(1+ n)))) (defun f (x) x) (defun g () (m 0))";
    let hoarding = "(defmacro m () (let ((hoard nil)) (loop (push (make-array 1000) hoard))))\n(m)";
    let looping = "(eval-when (:compile-toplevel) (loop))";
    for (name, text, option, value, status, said) in [
        ("loop.esl", looping, "--budget", "30000000", 5, "exceeds the budget"),
        ("hoard.esl", hoarding, "--memory", "48M", 3, "memory"),
        ("endless.esl", endless, "--budget", "1000000000", 3, "nested-too-deeply"),
    ] {
        let path = folder.file(name, text);
        let run = process::run(&mut eslvm(&["run", option, value, &path]), "");
        assert_eq!(run.status, Some(status), "{name}: {}", run.errors);
        assert!(run.errors.to_lowercase().contains(said), "{name}: {}", run.errors);
    }
}

#[test]
fn expansions_without_end_are_reported_with_the_macro() {
    let folder = Folder::new("expansions");
    for (name, text, said) in [
        (
            "growing",
            "(defmacro grow (x) `(grow (cons ,x ,x)))\n(grow 1)",
            "the expansion of `grow` is too large",
        ),
        (
            "twice",
            "(defmacro twice () '(progn (twice) (twice)))\n(twice)",
            "the expansion of `twice` does not end",
        ),
        (
            "doubling",
            "(defmacro m (n) (if (> n 0) `(list (m ,(- n 1)) (m ,(- n 1))) 1))\n(defun f () (m 40))",
            "the expansion of `m` is too large",
        ),
    ] {
        let path = folder.file(&format!("{name}.esl"), text);
        let run = process::run(&mut crate::eslc(&["check", &path]), "");
        assert_eq!(run.status, Some(3), "{name}: {}", run.errors);
        assert!(run.errors.contains(said), "{name}: {}", run.errors);
        assert!(run.errors.contains("1 error\n"), "{name}: {}", run.errors);
    }
}
