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

    /// Reads on until behind a text. The text behind it is left, however much comes at once.
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

    /// Types a text.
    fn types(&mut self, text: &str) {
        self.person.write_all(text.as_bytes()).expect("it is read");
    }

    /// Waits until the session shows texts, one after the other.
    fn shows(&mut self, texts: &[&str]) {
        texts.iter().for_each(|text| self.output.await_text(text));
    }

    /// Types a text when the prompt is there.
    fn answers(&mut self, text: &str) {
        self.shows(&["? "]);
        self.types(text);
    }

    /// Waits until the session has ended, and returns its exit status.
    fn status(&mut self) -> Option<i32> {
        let mut ended = None;
        until("the end of the session", || {
            ended = self.child.try_wait().expect("it can be asked");
            ended.is_some()
        });
        ended.and_then(|status| status.code())
    }
}

/// It does so while the next line is edited, and leaves the terminal as it was.
#[test]
fn a_task_ends_the_session_at_once() {
    let mut session = Session::begin();
    session.answers(
        "(progn (spawn (sleep 0.2) (unwind-protect (exit 7) (print (list 'cleaned 'up)))) (list 'go))\r",
    );
    session.shows(&["(GO)"]);
    assert_eq!(session.status(), Some(7));
    session.shows(&["(CLEANED UP)"]);
    let (before, after) = (&session.before, tcgetattr(&session.terminal).expect("it is still a terminal"));
    assert_eq!((after.local_modes, after.input_modes), (before.local_modes, before.input_modes));
}

/// It is all evaluated, although the terminal delivers it in large pieces.
#[test]
fn what_is_typed_ahead_is_kept() {
    let mut session = Session::begin();
    session.answers(&(0..200).map(|n| format!("(list 'form {n})\r")).collect::<String>());
    for n in 0..200 {
        session.shows(&[&format!("(FORM {n})")]);
    }
    session.types("(exit 3)\r");
    assert_eq!(session.status(), Some(3));
}

/// TAB lists the names that a word can become, with what there is to say about them, and completes it when
/// there is one only.
#[test]
fn a_word_is_completed() {
    let mut session = Session::begin();
    session.shows(&["; :help lists the commands, TAB completes, Ctrl-D ends"]);
    session.answers("(list 'wait-for-\t");
    session.shows(&["wait-for-event", "Waits until one of", "wait-for-task"]);
    session.types("tas\t)\r");
    session.shows(&["(WAIT-FOR-TASK)"]);
    session.types("(defun my-own-function () \"Does what is mine.\" 1)\r");
    session.shows(&["MY-OWN-FUNCTION"]);
    session.types("(my-o\t)\r");
    session.shows(&["1"]);
    session.types(":tas\t\r");
    session.shows(&["No tasks."]);
    session.types("help\r");
    session.shows(&[":load FILE"]);
    session.types(":exit\r");
    assert_eq!(session.status(), Some(0));
}

/// The prompt has the number of forms that wait for the choice of a restart.
#[test]
fn forms_that_wait_are_counted_in_the_prompt() {
    let mut session = Session::begin();
    session.answers("(list (cerror \"Go on.\" \"stuck\") 'after)\r");
    session.shows(&["stuck", "0: (CONTINUE) Go on.", "1? "]);
    session.types("(list (cerror \"Go on.\" \"stuck\") 'again)\r");
    session.shows(&["0: (CONTINUE) Go on.", "2? "]);
    session.types(":restart continue\r");
    session.shows(&["(NIL AGAIN)", "1? "]);
    session.types(":restart 0\r");
    session.shows(&["(NIL AFTER)"]);
    session.answers("\x04");
    assert_eq!(session.status(), Some(0));
}

#[test]
fn sessions_elsewhere_are_edited_too() {
    let folder = Folder::new("terminal_attach");
    let (socket, recording) = (folder.join("s"), folder.join("run.eslj"));
    let program = "(defun drive-home () 7) (read-line *standard-input* nil)";
    let mut run = Operated::start(&folder, program, &["--listen", &socket, "--record", &recording]);
    run.said("; operators attach with eslvm attach ");
    let mut session = Session::of(&["attach", &socket]);
    session.shows(&["; :help lists the commands"]);
    session.answers("(list (drive-h\t))\r");
    session.shows(&["(7)"]);
    session.types(":undo\t\r");
    session.shows(&["; no patch can be undone"]);
    // Before the next line is asked for, the terminal itself takes Ctrl-D for the end of an empty input.
    session.answers("\x04");
    assert_eq!(session.status(), Some(0));
    assert_eq!(run.end(), Some(0));
    let mut session = Session::of(&["replay", "--until", "tick:0", &recording]);
    session.shows(&["(replay) "]);
    session.types("whe\t\r");
    session.shows(&[": between two turns"]);
    session.types("stpe\r");
    session.shows(&["Unknown command `stpe`; did you mean `step`?", "(replay) "]);
    session.types("\x04");
    assert_eq!(session.status(), Some(0));
}
