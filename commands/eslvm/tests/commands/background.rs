//! The REPL runs tasks while it waits for a line, and ends when a task asks for it.

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, ChildStdout};

use esl_conformance::process::start;

use crate::eslvm;

/// Begins a session with these options; returns its input and its output, too.
fn begin(options: &[&str]) -> (Child, ChildStdin, BufReader<ChildStdout>) {
    let mut child = start(eslvm(&["repl"]).args(options));
    let input = child.stdin.take().expect("standard input is a pipe");
    let output = BufReader::new(child.stdout.take().expect("standard output is a pipe"));
    (child, input, output)
}

/// Returns the next line that is not empty; it has to come without anything being typed.
fn next_line(output: &mut impl BufRead) -> String {
    loop {
        let mut line = String::new();
        assert!(output.read_line(&mut line).expect("it can be read") > 0, "the session has ended");
        if !line.trim().is_empty() {
            return line.trim().to_string();
        }
    }
}

#[test]
fn tasks_run_while_a_line_is_awaited() {
    let (mut child, mut input, mut output) = begin(&[]);
    writeln!(input, "(progn (spawn (dotimes (i 3) (sleep 0.01) (format t \"~a~%\" (list 'turn i)))) 'made)")
        .expect("it reads");
    let lines: Vec<String> = (0..4).map(|_| next_line(&mut output)).collect();
    assert_eq!(lines, ["MADE", "(TURN 0)", "(TURN 1)", "(TURN 2)"]);
    // One that never waits does not keep the next line from being seen.
    writeln!(input, "(progn (spawn (unwind-protect (loop) (print 'cleaned-up))) 'made)\n(+ 1 2)")
        .expect("it reads");
    assert_eq!([next_line(&mut output), next_line(&mut output)], ["MADE", "3"]);
    drop(input);
    assert_eq!(next_line(&mut output), "CLEANED-UP");
    assert!(child.wait().expect("it ends").success());
}

#[test]
fn virtual_time_passes_only_while_a_form_is_evaluated() {
    let (mut child, mut input, mut output) = begin(&["--clock", "virtual"]);
    writeln!(
        input,
        "(progn (spawn (:daemon t) (do-every 1 (print (now)))) (print 'first) (sleep 1.5) (now))"
    )
    .expect("it reads");
    let lines: Vec<String> = (0..4).map(|_| next_line(&mut output)).collect();
    assert_eq!(lines, ["FIRST", "0.0", "1.0", "1.5"]);
    writeln!(input, "(now)\n:quit").expect("it reads");
    assert_eq!(next_line(&mut output), "1.5");
    assert!(child.wait().expect("it ends").success());
}

#[test]
fn a_task_can_end_the_session() {
    let (mut child, mut input, _output) = begin(&[]);
    writeln!(input, "(progn (spawn (sleep 0.01) (exit 7)) nil)").expect("it reads");
    assert_eq!(child.wait().expect("it ends").code(), Some(7));
}
