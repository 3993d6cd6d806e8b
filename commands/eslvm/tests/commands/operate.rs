//! Runs that are operated from outside.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, ChildStderr};
use std::time::Duration;

use esl_conformance::folder::Folder;
use esl_conformance::process::{Finished, PATIENCE, finish, start};

use crate::eslvm;

/// A run, and where it can be reached.
pub(crate) struct Operated {
    pub(crate) child: Child,
    errors: BufReader<ChildStderr>,
}

impl Operated {
    /// Starts a program with these options.
    pub(crate) fn start(folder: &Folder, text: &str, options: &[&str]) -> Operated {
        Operated::start_in(Path::new("."), folder, text, options)
    }

    /// Starts a program with these options, to which operators attach at the returned path.
    pub(crate) fn listening(folder: &Folder, text: &str, options: &[&str]) -> (Operated, String) {
        let socket = folder.join("s");
        let mut run = Operated::start(folder, text, &[&["--listen", &socket], options].concat());
        run.said("; operators attach with eslvm attach ");
        (run, socket)
    }

    /// Starts a program in a folder other than that of the tests.
    pub(crate) fn start_in(place: &Path, folder: &Folder, text: &str, options: &[&str]) -> Operated {
        let program = folder.file("program.esl", text);
        let mut arguments = vec!["run"];
        arguments.extend(options);
        arguments.push(&program);
        let mut child = start(eslvm(&arguments).current_dir(place));
        let errors = BufReader::new(child.stderr.take().expect("it is a pipe"));
        Operated { child, errors }
    }

    /// Returns the rest of the first line on the standard error that begins so.
    pub(crate) fn said(&mut self, beginning: &str) -> String {
        loop {
            let mut line = String::new();
            let read = self.errors.read_line(&mut line).expect("it can be read");
            assert!(read > 0, "it says nothing that begins with {beginning:?}");
            if let Some(rest) = line.trim_end().strip_prefix(beginning) {
                return rest.to_string();
            }
        }
    }

    /// Ends the standard input, which ends the programs here, and returns the exit status.
    pub(crate) fn end(self) -> Option<i32> {
        self.finish().status
    }

    /// Ends the standard input, which ends the programs here, and returns what they came to.
    pub(crate) fn finish(mut self) -> Finished {
        drop(self.child.stdin.take());
        // Its errors are read on, so that it never waits for a full pipe.
        let mut errors = self.errors;
        let reader = std::thread::spawn(move || {
            let mut text = String::new();
            drop(errors.read_to_string(&mut text));
            text
        });
        let finished = finish(self.child);
        Finished { errors: reader.join().expect("reading does not fail"), ..finished }
    }
}

/// Sends bytes to an address, and returns all that comes back.
pub(crate) fn exchange(address: &str, bytes: impl AsRef<[u8]>) -> String {
    let mut stream = TcpStream::connect(address).expect("somebody listens");
    stream.set_read_timeout(Some(PATIENCE)).expect("it can be set");
    stream.set_write_timeout(Some(PATIENCE)).expect("it can be set");
    // A run that refuses the beginning need not read the rest.
    drop(stream.write_all(bytes.as_ref()));
    let mut answer = Vec::new();
    drop(stream.read_to_end(&mut answer));
    String::from_utf8_lossy(&answer).into_owned()
}

/// Sends a request over HTTP, and returns the answer with its head.
pub(crate) fn request(address: &str, method: &str, path: &str, headers: &str, body: &str) -> String {
    let host = if headers.contains("Host:") { String::new() } else { format!("Host: {address}\r\n") };
    let length = body.len();
    exchange(
        address,
        format!(
            "{method} {path} HTTP/1.1\r\n{host}Connection: close\r\nContent-Length: {length}\r\n{headers}\r\n{body}"
        ),
    )
}

/// Tries until a condition is true.
pub(crate) fn until(what: &str, mut holds: impl FnMut() -> bool) {
    let deadline = std::time::Instant::now() + PATIENCE;
    while !holds() {
        assert!(std::time::Instant::now() < deadline, "{what} does not come about");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// A program that fails once, recovers, and waits for the end of its input.
const RECOVERS: &str = "
    (define-input news :capacity 1 :when-full :drop-newest)
    (dotimes (i 3) (signal news i))
    (catch 'over (with-recovery-procedures ((:slip (throw 'over nil))) (fail :slip)))
    (let ((n 0))
      (supervise () (child :restart :transient :backoff (0.001 1 0.001) (when (< (incf n) 3) (fail :weak)))))
    (dotimes (i 9) (make-array 1000000))
    (spawn (:name 'waiter :daemon t) (wait-for-event (make-event)))
    (read-line *standard-input* nil)";

#[test]
fn figures_are_served_to_prometheus() {
    let folder = Folder::new("operate_metrics");
    let mut run = Operated::start(&folder, RECOVERS, &["--metrics", "0"]);
    let address = run.said("; metrics at http://");
    let address = address.strip_suffix("/metrics").expect("it names the path").to_string();
    let mut answer = String::new();
    until("a run that waits", || {
        answer = request(&address, "GET", "/metrics", "", "");
        answer.contains("esl_tasks{state=\"stream\"} 1") && answer.contains("esl_tasks{state=\"waits\"} 1")
    });
    for line in [
        "esl_failures_total{cause=\":SLIP\"} 1",
        "esl_recoveries_total 1",
        "esl_input_dropped_total{input=\"NEWS\"} 2",
        "esl_input_waiting{input=\"NEWS\"} 1",
        "esl_failures_total{cause=\":WEAK\"} 2",
        "esl_restarts_total 2",
        "esl_paused 0",
        "# TYPE esl_ticks_total counter",
    ] {
        assert!(answer.lines().any(|found| found == line), "{line}\n{answer}");
    }
    for name in [
        "esl_timer_lateness_seconds_count",
        "esl_timer_lateness_longest_seconds",
        "esl_pause_seconds_count",
        "esl_pause_longest_seconds",
        "esl_collections_total",
        "esl_memory_committed_bytes",
        "esl_ticks_total",
    ] {
        let value = answer.lines().find_map(|line| line.strip_prefix(name)?.trim().parse::<f64>().ok());
        assert!(value.is_some_and(|value| value > 0.0), "{name}\n{answer}");
    }
    let status = |answer: String| answer.split(' ').nth(1).unwrap_or_default().to_string();
    assert_eq!(status(request(&address, "GET", "/", "", "")), "404");
    assert_eq!(status(request(&address, "POST", "/metrics", "", "")), "405");
    assert_eq!(status(request(&address, "GET", "/metrics", "Host: evil.example\r\n", "")), "421");
    assert_eq!(run.end(), Some(0));
}

#[test]
fn an_address_that_cannot_be_had_is_refused() {
    let folder = Folder::new("operate_address");
    let taken = std::net::TcpListener::bind("127.0.0.1:0").expect("there is a port");
    let address = taken.local_addr().expect("it has one").to_string();
    let mut run = Operated::start(&folder, "(print 1)", &["--metrics", &address]);
    run.said(&format!("eslvm: cannot listen at {address}: "));
    assert_eq!(run.end(), Some(2));
}

/// The part of the library for operators is loaded only into a machine whose run is served to them.
#[test]
fn only_a_run_that_is_served_has_the_part_for_operators() {
    let folder = Folder::new("operate_part");
    let program = folder.file("program.esl", "(print (fboundp 'esl::%session-evaluate))");
    for (options, expected) in
        [(&[][..], "NIL"), (&["--metrics", "0"], "NIL"), (&["--monitor"], "T"), (&["--listen", "0"], "T")]
    {
        let run = esl_conformance::process::run(&mut eslvm(&[&["run"], options, &[&*program]].concat()), "");
        assert_eq!((run.status, run.output.trim()), (Some(0), expected), "{options:?}: {}", run.errors);
    }
}
