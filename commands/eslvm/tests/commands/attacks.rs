//! Peers that take connections and memory of a run: others are served, and the agent goes on.

use std::io::{BufReader, Read, Write};
use std::net::TcpStream;
use std::os::unix::net::UnixStream;
use std::time::Duration;

use esl_conformance::folder::Folder;
use esl_conformance::process::PATIENCE;

use crate::attach::{ask, packet, session, start_with_secrets};
use crate::operate::{Operated, request, until};

/// More connections than there is room for, of which nothing is heard.
fn silent(address: &str) -> Vec<TcpStream> {
    (0..100).map(|_| TcpStream::connect(address).expect("the run listens")).collect()
}

#[test]
fn silent_connections_keep_nobody_out() {
    let folder = Folder::new("attacks_silent");
    let (run, address) = start_with_secrets(&folder);
    let silent = silent(&address);
    // Some send the beginning of a secret.
    for mut stream in &silent[60..] {
        drop(stream.write_all(b"00001"));
    }
    for secret in ["observe-0123456789", "patch-0123456789"] {
        let facts = "(:emacs-rex (esl:facts \"mode\") nil t 1)".to_string();
        // The run listens before its program begins.
        until("an answer", || {
            ask(&address, secret, std::slice::from_ref(&facts)) == ["(:return (:ok \"(MODE CALM)\n\") 1)"]
        });
    }
    drop(silent);
    assert_eq!(run.finish().output, "(3 CALM NIL)\n");
}

#[test]
fn a_role_takes_no_places_of_others() {
    let folder = Folder::new("attacks_places");
    let (run, address) = start_with_secrets(&folder);
    let mut observers = Vec::new();
    for _ in 0..16 {
        let mut stream = TcpStream::connect(&address).expect("the run listens");
        stream.set_read_timeout(Some(PATIENCE)).expect("it can be set");
        stream.write_all(&packet("\"observe-0123456789\"")).expect("it is taken");
        stream.write_all(&packet("(:emacs-rex (swank:default-directory) nil t 1)")).expect("it is taken");
        stream.read_exact(&mut [0; 6]).expect("it is in");
        observers.push(stream);
    }
    let tasks = || vec!["(:emacs-rex (esl:data) nil t 1)".to_string()];
    let refused = ask(&address, "observe-0123456789", &tasks());
    assert_eq!(
        refused,
        ["(:refused \"16 sessions of the role observe are open, the most that may be: end one of them\")"]
    );
    assert!(ask(&address, "patch-0123456789", &tasks())[0].starts_with("(:return (:ok "));
    drop(observers);
    until("a free place", || ask(&address, "observe-0123456789", &tasks())[0].starts_with("(:return (:ok "));
    assert_eq!(run.finish().output, "(3 CALM NIL)\n");
}

#[test]
fn silent_browsers_keep_nobody_out() {
    let folder = Folder::new("attacks_http");
    let mut run =
        Operated::start(&folder, "(read-line *standard-input* nil)", &["--metrics", "0", "--monitor"]);
    let metrics = run.said("; metrics at http://");
    let monitor = run.said("; monitor, to observe: http://");
    for address in [metrics.trim_end_matches("/metrics"), monitor.split('/').next().unwrap_or_default()] {
        let silent = silent(address);
        for mut stream in &silent[70..] {
            drop(stream.write_all(b"GET /metrics HTT"));
        }
        let path = if address == monitor.split('/').next().unwrap_or_default() { "/" } else { "/metrics" };
        let answer = request(address, "GET", path, "", "");
        assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
    }
    assert_eq!(run.end(), Some(0));
}

/// Reads packets of a session up to the answer; returns what was written before it.
fn written_until_answer(stream: UnixStream) -> String {
    let mut from = BufReader::new(stream);
    let mut written = String::new();
    loop {
        let mut head = [0; 6];
        from.read_exact(&mut head).expect("the answer comes");
        let length = usize::from_str_radix(&String::from_utf8_lossy(&head), 16).expect("it is a packet");
        let mut body = vec![0; length];
        from.read_exact(&mut body).expect("the packet is complete");
        let body = String::from_utf8(body).expect("it is text");
        if body.starts_with("(:return ") {
            return written;
        }
        written += body.trim_start_matches("(:write-string \"").trim_end().trim_end_matches("\")");
    }
}

#[test]
fn an_evaluation_waits_for_who_does_not_read_it() {
    let folder = Folder::new("attacks_reader");
    let program = "(defvar *at* 0) (defvar *beats* 0)
        (spawn (:daemon t) (loop (sleep 0.01) (incf *beats*)))
        (read-line *standard-input* nil)";
    let (run, socket) = Operated::listening(&folder, program, &[]);
    let mut stream = UnixStream::connect(&socket).expect("the run listens");
    stream.set_read_timeout(Some(PATIENCE)).expect("it can be set");
    let form = "(dotimes (i 200000) (setq *at* i) (write-line (princ-to-string i)))";
    let asked = format!("(:emacs-rex (esl:evaluate \"{form}\") nil t 1)");
    stream.write_all(&packet(&asked)).expect("it is taken");
    let look = || -> (u64, u64) {
        let (said, _) = session(&socket, "(format t \"~d ~d\" *at* *beats*)\n");
        let mut numbers = said.split_whitespace().filter_map(|word| word.parse().ok());
        (numbers.next().unwrap_or(0), numbers.next().unwrap_or(0))
    };
    let mut last = (0, 0);
    until("an evaluation that waits", || {
        std::thread::sleep(Duration::from_millis(200));
        let now = look();
        let stands = now.0 == last.0 && now.0 > 0;
        last = now;
        stands
    });
    assert!(last.0 < 199_999, "{last:?}");
    std::thread::sleep(Duration::from_millis(200));
    let now = look();
    assert!(now.0 == last.0 && now.1 > last.1, "the agent goes on: {last:?} {now:?}");
    // When it is read, it is all there.
    let written = written_until_answer(stream);
    let numbers: Vec<usize> = written.lines().filter_map(|line| line.parse().ok()).collect();
    assert!(
        numbers.len() == 200_000 && numbers.iter().enumerate().all(|(at, &n)| at == n),
        "{}",
        numbers.len()
    );
    assert_eq!(run.end(), Some(0));
}

#[test]
fn an_evaluation_has_a_part_of_the_memory() {
    let folder = Folder::new("attacks_memory");
    let program = "(defvar *kept* nil) (read-line *standard-input* nil) (princ (length (make-list 100000)))";
    let (run, socket) = Operated::listening(&folder, program, &["--memory", "64M"]);
    let (said, _) = session(
        &socket,
        "(loop (push (make-string 1000) *kept*))\n(dotimes (i 2000) (spawn (sleep 100)))\n(+ 1 2)\n",
    );
    let expected = "Failure :QUOTA-EXHAUSTED, no recovery available.\nAborted\n";
    assert_eq!(said, format!("{expected}{expected}3\n"));
    assert_eq!(run.finish().output, "100000");
}

#[test]
fn an_operator_hears_how_the_run_ends() {
    let folder = Folder::new("attacks_end");
    let program = "(define-input news) (wait-for-event news) (fail :wheel-stuck 3)";
    let (mut run, socket) = Operated::listening(&folder, program, &[]);
    // It waits for the operator, and says so.
    run.said("; all tasks wait, and only an operator can signal NEWS");
    let (said, status) = session(&socket, ":signal news\n(sleep 100)\n");
    assert_eq!(
        said,
        "; NEWS is signalled\neslvm: the run has ended with status 1: a failure or an abort has ended the main task\n"
    );
    assert_eq!((status, run.end()), (Some(1), Some(1)));
}
