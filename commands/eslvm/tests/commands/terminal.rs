//! A session at a terminal, which is a pair of files.

use std::fs::File;
use std::io::{Read, Write};
use std::process::{Child, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use esl_conformance::folder::Folder;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{Termios, tcgetattr};

use crate::eslvm;
use crate::operate::{Operated, until};

/// Output of a session, as it comes.
struct Output {
    pieces: Receiver<String>,
    /// Output received and not awaited yet.
    unread: String,
}

impl Output {
    /// Begins to read.
    fn of(mut side: File) -> Output {
        let (sender, pieces) = channel();
        std::thread::spawn(move || {
            let mut bytes = [0; 4096];
            while let Ok(count @ 1..) = side.read(&mut bytes) {
                if sender.send(String::from_utf8_lossy(&bytes[..count]).into_owned()).is_err() {
                    return;
                }
            }
        });
        Output { pieces, unread: String::new() }
    }

    /// Reads on until behind a text. What follows it is left, however much comes at once.
    fn await_text(&mut self, text: &str) {
        loop {
            if let Some(at) = self.unread.find(text) {
                self.unread.drain(..at + text.len());
                return;
            }
            match self.pieces.recv_timeout(Duration::from_secs(20)) {
                Ok(more) => self.unread.push_str(&more),
                Err(error) => panic!("{error}; no {text} in {:?}", self.unread),
            }
        }
    }
}

/// A session with an editor.
struct Session {
    person: File,
    terminal: File,
    /// Settings of the terminal before the session.
    before: Termios,
    child: Child,
    output: Output,
}

impl Session {
    fn begin() -> Session {
        Session::of(&["repl"])
    }

    fn of(arguments: &[&str]) -> Session {
        let person = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).expect("there are terminals");
        grantpt(&person).and_then(|()| unlockpt(&person)).expect("it is ours");
        let name = ptsname(&person, Vec::new()).expect("it has a name").into_string().expect("text");
        let terminal = File::options().read(true).write(true).open(name).expect("it can be opened");
        let before = tcgetattr(&terminal).expect("it is a terminal");
        let stdio = || Stdio::from(terminal.try_clone().expect("it can be shared"));
        let child = eslvm(arguments)
            .env("TERM", "xterm")
            .env("HOME", env!("CARGO_TARGET_TMPDIR"))
            .stdin(stdio())
            .stdout(stdio())
            .stderr(stdio())
            .spawn()
            .expect("the command can be run");
        let person = File::from(person);
        let output = Output::of(person.try_clone().expect("it can be shared"));
        Session { person, terminal, before, child, output }
    }
}

/// Waits until a session has ended, and returns its exit status.
fn status(child: &mut Child) -> Option<i32> {
    let mut ended = None;
    until("the end of the session", || {
        ended = child.try_wait().expect("it can be asked");
        ended.is_some()
    });
    ended.and_then(|status| status.code())
}

/// It does so while the next line is edited, and leaves the terminal as it was.
#[test]
fn a_task_ends_the_session_at_once() {
    let Session { mut person, terminal, before, mut child, mut output } = Session::begin();
    output.await_text("? ");
    let form =
        "(progn (spawn (sleep 0.2) (unwind-protect (exit 7) (print (list 'cleaned 'up)))) (list 'go))\r";
    person.write_all(form.as_bytes()).expect("it is read");
    output.await_text("(GO)");
    assert_eq!(status(&mut child), Some(7));
    output.await_text("(CLEANED UP)");
    let after = tcgetattr(&terminal).expect("it is still a terminal");
    assert_eq!((after.local_modes, after.input_modes), (before.local_modes, before.input_modes));
}

/// It is all evaluated, although the terminal delivers it in large pieces.
#[test]
fn what_is_typed_ahead_is_kept() {
    let Session { mut person, mut child, mut output, .. } = Session::begin();
    output.await_text("? ");
    let forms: String = (0..200).map(|n| format!("(list 'form {n})\r")).collect();
    person.write_all(forms.as_bytes()).expect("it is read");
    for n in 0..200 {
        output.await_text(&format!("(FORM {n})"));
    }
    person.write_all(b"(exit 3)\r").expect("it is read");
    assert_eq!(status(&mut child), Some(3));
}

/// TAB lists the names that a word can become, with what there is to say about them, and completes it when
/// there is one only.
#[test]
fn a_word_is_completed() {
    let Session { mut person, mut child, mut output, .. } = Session::begin();
    output.await_text("; :help lists the commands, TAB completes, Ctrl-D ends");
    output.await_text("? ");
    let mut write = |text: &str| person.write_all(text.as_bytes()).expect("it is read");
    write("(list 'wait-for-\t");
    output.await_text("wait-for-event");
    output.await_text("Waits until one of");
    output.await_text("wait-for-task");
    write("tas\t)\r");
    output.await_text("(WAIT-FOR-TASK)");
    write("(defun my-own-function () \"Does what is mine.\" 1)\r");
    output.await_text("MY-OWN-FUNCTION");
    write("(my-o\t)\r");
    output.await_text("1");
    write(":tas\t\r");
    output.await_text("No tasks.");
    write("help\r");
    output.await_text(":load FILE");
    write("exit\r");
    assert_eq!(status(&mut child), Some(0));
}

#[test]
fn sessions_elsewhere_are_edited_too() {
    let folder = Folder::new("terminal_attach");
    let (socket, recording) = (folder.join("s"), folder.join("run.eslj"));
    let program = "(defun drive-home () 7) (read-line *standard-input* nil)";
    let mut run = Operated::start(&folder, program, &["--listen", &socket, "--record", &recording]);
    run.said("; operators attach with eslvm attach ");
    let Session { mut person, mut child, mut output, .. } = Session::of(&["attach", &socket]);
    output.await_text("; :help lists the commands");
    output.await_text("? ");
    person.write_all(b"(list (drive-h\t))\r").expect("it is read");
    output.await_text("(7)");
    person.write_all(b":undo\t\r").expect("it is read");
    output.await_text("; no patch can be undone");
    // Before the next line is asked for, the terminal itself takes Ctrl-D for the end of an empty input.
    output.await_text("? ");
    person.write_all(b"\x04").expect("it is read");
    assert_eq!(status(&mut child), Some(0));
    assert_eq!(run.end(), Some(0));
    let Session { mut person, mut child, mut output, .. } =
        Session::of(&["replay", "--until", "tick:0", &recording]);
    output.await_text("(replay) ");
    person.write_all(b"whe\t\r").expect("it is read");
    output.await_text(": between two turns");
    person.write_all(b"stpe\r").expect("it is read");
    output.await_text("Unknown command `stpe`; did you mean `step`?");
    output.await_text("(replay) ");
    person.write_all(b"\x04").expect("it is read");
    assert_eq!(status(&mut child), Some(0));
}
