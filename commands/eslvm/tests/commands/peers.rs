//! Peers that are silent, slow, gone or many, and the times and ends that programs give them.

use std::io::Read;
use std::net::TcpListener;
#[cfg(target_os = "linux")]
use std::{
    io::{BufRead, BufReader, Write},
    net::TcpStream,
};

use esl_conformance::process;

use crate::eslvm;
use crate::examples::free_port;
use esl_conformance::folder::Folder;

/// Checks the lines that a program prints, which may talk to this machine.
#[track_caller]
fn check(test: &str, text: &str, expected: &[&str]) {
    let folder = Folder::with(test, &[("main.esl", text)]);
    let mut command = eslvm(&["run", "--allow-net=127.0.0.1", "main.esl"]);
    let done = process::run(command.current_dir(folder.path()), "");
    let lines: Vec<&str> = done.output.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    assert_eq!(lines, expected, "{}", done.errors);
}

/// A peer that takes connections and says nothing ends no wait; the time that is given does.
#[test]
fn the_time_for_a_peer_is_a_failure_of_its_own() {
    let listener = TcpListener::bind("127.0.0.1:0").expect("there is a port");
    let port = listener.local_addr().expect("it has an address").port();
    std::thread::spawn(move || {
        for mut stream in listener.incoming().flatten() {
            // Until the program closes it.
            std::thread::spawn(move || stream.read_to_end(&mut Vec::new()));
        }
    });
    let text = format!(
        "(require :http)
(defmacro cause (form) `(print (handler-case ,form (failure (f) (failure-cause f)))))
(cause (sockets:connect \"127.0.0.1\" {port} :tls t :timeout 0.05))
(cause (http:get \"http://127.0.0.1:{port}/\" :timeout 0.05))
(cause (close (sockets:connect \"127.0.0.1\" {port} :timeout 1e300)))
(cause (sockets:with-socket (c (sockets:connect \"127.0.0.1\" {port} :timeout 60))
         (with-timeout 0.05 (read-line c))))"
    );
    check("peers-silent", &text, &[":TIMEOUT", ":TIMEOUT", "T", ":TIMEOUT"]);
}

/// `with-server` evaluates its body for each connection and closes it at the end of that, be it a failure.
#[test]
fn a_connection_of_a_server_ends_with_its_body() {
    let port = free_port();
    let text = format!(
        "(require :sockets)
(define-cause :broken ())
(defvar *server*
  (spawn (:name 'server :daemon t)
    (sockets:with-server ((c \"127.0.0.1\" {port}) :limit 1)
      (let ((line (read-line c)))
        (when (equal line \"break\") (fail :broken))
        (format c \"~a!~%\" line)))))
(defun ask (line)
  (sockets:with-socket (c (loop (handler-case (return (sockets:connect \"127.0.0.1\" {port}))
                                  (failure () (sleep 0.01)))))
    (when line (write-line line c))
    (if line (list (read-line c nil :end) (read-line c nil :end)) nil)))
(print (ask \"one\"))
(print (ask \"break\"))
;; One that goes without a word.
(print (ask nil))
(print (ask \"two\"))
(abort-task *server*)
(wait-for-task *server*)
(print (handler-case (sockets:connect \"127.0.0.1\" {port}) (failure (f) (failure-cause f))))"
    );
    let expected = ["(\"one!\" :END)", "(:END :END)", "NIL", "(\"two!\" :END)", ":CONNECTION-REFUSED"];
    check("peers-server", &text, &expected);
}

/// The end of the main task is that of a server that is a daemon, and of its connections.
#[test]
fn connections_of_a_daemon_keep_no_run_from_ending() {
    let text = "(require :sockets)
(defvar *port* nil)
(defun server ()
  (let ((listener (sockets:listen \"127.0.0.1\" 0)))
    (setq *port* (sockets:local-port listener))
    (sockets::serve listener nil
                    (lambda (c) (write-line \"hello\" c) (finish-output c)
                      (unwind-protect (read-line c) (print 'ended))))))
(spawn (:name 'server :daemon t) (server))
(wait-until *port*)
(print (read-line (sockets:connect \"127.0.0.1\" *port*)))";
    check("peers-daemon", text, &["\"hello\"", "ENDED"]);
}

/// More peers than the system gives descriptors for wait, and end nothing.
#[cfg(target_os = "linux")]
#[test]
fn a_server_outlives_more_peers_than_it_has_descriptors_for() {
    const DESCRIPTORS: usize = 48;
    let text = "(require :sockets)
(let ((listener (sockets:listen \"127.0.0.1\" 0)))
  (format t \"~d~%\" (sockets:local-port listener))
  (finish-output)
  (sockets::serve listener nil
    (lambda (c) (loop for line = (read-line c nil nil) while line do (write-line line c) (finish-output c)))))";
    let folder = Folder::with("peers-many", &[("main.esl", text)]);
    let mut limited = std::process::Command::new("sh");
    let script = format!("ulimit -n {DESCRIPTORS} && exec \"$0\" run --allow-net main.esl");
    let mut child = process::start(limited.args(["-c", &script, crate::ESLVM]).current_dir(folder.path()));
    let mut port = String::new();
    let output = child.stdout.take().expect("it is a pipe");
    BufReader::new(output).read_line(&mut port).expect("the port is printed");
    let port: u16 = port.trim().parse().expect("it is a port");
    let connect = || TcpStream::connect(("127.0.0.1", port)).expect("it listens");
    let many: Vec<TcpStream> = (0..2 * DESCRIPTORS).map(|_| connect()).collect();
    let open = format!("/proc/{}/fd", child.id());
    let begun = std::time::Instant::now();
    while std::fs::read_dir(&open).map_or(0, Iterator::count) < DESCRIPTORS {
        assert!(begun.elapsed() < std::time::Duration::from_secs(60), "it takes as many as it can");
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    drop(many);
    let mut late = connect();
    late.write_all(b"late\n").expect("it can be sent");
    let mut answer = String::new();
    BufReader::new(late).read_line(&mut answer).expect("it answers");
    assert_eq!(answer, "late\n");
    child.kill().and_then(|()| child.wait()).expect("it runs");
}
