//! The module `:ws` with peers in Python that nobody here has written, and with peers that break the
//! protocol, fall silent, flood, or are killed.
//!
//! The first need packages of the Python registry, which the tests install below `target/`. Where that is not
//! possible, these tests are left out, and say so.

use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use esl_conformance::folder::Folder;

use crate::lines::make_certificates;
use crate::venv;
use crate::ws::{run, start_server};

/// Packages that the peers need.
const PACKAGES: [&str; 2] = ["websockets==17.4", "roslibpy==2.1.0"];

/// Longest time that anything here takes.
const LONGEST: Duration = Duration::from_secs(120);

/// A process that ends with this.
pub(crate) struct Peer {
    child: Child,
    lines: Receiver<String>,
}

impl Drop for Peer {
    fn drop(&mut self) {
        self.kill();
    }
}

impl Peer {
    pub(crate) fn start(command: &mut Command) -> Peer {
        let command = command.stdin(Stdio::null()).stdout(Stdio::piped());
        let mut child = command.spawn().expect("the process can be started");
        let output = BufReader::new(child.stdout.take().expect("it is a pipe"));
        let (send, lines) = channel();
        std::thread::spawn(move || {
            for line in output.lines().map_while(Result::ok) {
                if send.send(line.trim().to_owned()).is_err() {
                    return;
                }
            }
        });
        Peer { child, lines }
    }

    /// Returns the next line that it prints.
    #[track_caller]
    pub(crate) fn line(&self) -> String {
        self.lines.recv_timeout(LONGEST).expect("it prints a line")
    }

    /// Returns the lines that it prints until it ends.
    fn rest(&self) -> Vec<String> {
        std::iter::from_fn(|| self.lines.recv_timeout(LONGEST).ok()).collect()
    }

    pub(crate) fn is_running(&mut self) -> bool {
        self.child.try_wait().is_ok_and(|end| end.is_none())
    }

    /// Ends it by SIGKILL.
    fn kill(&mut self) {
        drop(self.child.kill());
        drop(self.child.wait());
    }

    /// Returns the memory that it occupies, in bytes.
    fn memory(&self) -> usize {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.child.id()));
        let status = status.expect("it runs");
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).expect("it has memory");
        line.trim().trim_end_matches(" kB").parse::<usize>().expect("it is a number") << 10
    }
}

fn script(name: &str) -> PathBuf {
    esl_conformance::root().join("commands/eslvm/tests/peers").join(name)
}

/// Returns the Python that has the packages; nothing if they cannot be installed.
pub(crate) fn python() -> Option<PathBuf> {
    venv::python("websocket", &PACKAGES, "import websockets, roslibpy")
}

/// Starts a server of `websockets`; returns its port.
fn start_websockets() -> Option<(Peer, String)> {
    let server = Peer::start(Command::new(python()?).arg(script("websocket.py")).arg("serve"));
    let port = server.line();
    Some((server, port))
}

/// Starts a server of handshakes and wrong frames; returns its port. Nothing, after saying so, if this
/// machine has no Python.
fn start_raw() -> Option<(Peer, String)> {
    if Command::new("python3").arg("--version").output().is_err() {
        crate::say_left_out("it needs `python3`");
        return None;
    }
    let server = Peer::start(Command::new("python3").arg(script("websocket_raw.py")));
    let port = server.line();
    Some((server, port))
}

/// Runs a program that finds a port of this machine in `*port*`.
fn run_with_port(test: &str, text: &str, port: &str, options: &[&str]) -> (Vec<String>, String) {
    let text = format!(
        "(defvar *port* {port})
(defun to (path) (format nil \"ws://127.0.0.1:~d~a\" *port* path))
{text}"
    );
    run(test, &text, options)
}

#[test]
fn a_client_talks_to_websockets() {
    let Some((server, port)) = start_websockets() else { return };
    let text = r#"
(ws:with-connection (c (to "/echo"))
  (dolist (m (list "grüß dich" "" (vector 0 255) (make-string 300000 :initial-element #\ü)))
    (ws:send c m)
    (print (equalp (ws:receive c) m)))
  (spawn (dotimes (i 3000) (ws:send c (princ-to-string i))))
  (print (loop for i below 3000 always (equal (ws:receive c) (princ-to-string i)))))
(ws:with-connection (c (to "/parts"))
  (print (ws:receive c))
  (print (ws:receive c))
  (print (length (ws:receive c))))
(ws:with-connection (c (to "/ping")) (print (ws:receive c)))
(ws:with-connection (c (to "/headers") :headers '(("X-Robot" . "rover")) :protocols '("v1" "v2"))
  (print (list (ws:protocol c) (ws:receive c))))
(cause (ws:with-connection (c (to "/close")) (ws:receive c)))
(cause (ws:with-connection (c (to "/fails")) (ws:receive c)))
(cause (ws:with-connection (c (to "/parts") :largest 999999) (loop (ws:receive c))))
(ws:with-connection (c (to "/code")) (ws:close c 3007 "später"))
(ws:with-connection (c (to "/slow"))
  (dotimes (i 20) (ws:send c (make-string 200000 :initial-element #\x)))
  (print (ws:receive c)))"#;
    let (lines, errors) = run_with_port("ws-to-python", text, &port, &[]);
    let expected = [
        "T",
        "T",
        "T",
        "T",
        "T",
        "\"eins, zwei\"",
        "#(1 2 3)",
        "1000000",
        "\"True\"",
        "(\"v1\" \"rover None v1\")",
        "(:CONNECTION-CLOSED 4321 \"genug\")",
        "(:CONNECTION-CLOSED 1011 \"\")",
        "(:MESSAGE-TOO-LONG \"Message too long: 1000000 > 999999\")",
        "\"4000000\"",
    ];
    assert_eq!(lines, expected, "{errors}");
    assert_eq!(server.line(), "closed 3007 später");
}

#[test]
fn a_server_talks_to_websockets() {
    let Some(python) = python() else { return };
    let folder = Folder::new("ws-from-python");
    let routes = r#"(:ws "/echo" (c :protocols '("v1" "v2"))
    (ws:do-messages (m c) (ws:send c m)))
  (:ws "/closes" (c) (ws:close c 4567 "schluß"))
  (:ws "/fails" (c) (error "broken"))
  (:ws "/ends" (c) (ws:receive c nil))"#;
    let (server, port) = start_server(&folder, routes, &[]);
    let url = format!("ws://127.0.0.1:{port}");
    let client = Peer::start(Command::new(python).arg(script("websocket.py")).arg("talk").arg(url));
    let expected = [
        "protocol v1 extensions []",
        "True",
        "True",
        "True",
        "True",
        "True",
        "in drei Teilen",
        "True",
        "True",
        "closed 3999 fertig",
        "/closes 4567 schluß",
        "/fails 1011",
        "/ends 1001 bye",
        "refused 404",
    ];
    assert_eq!(client.rest(), expected);
    drop(server);
}

#[test]
fn connections_over_tls_need_a_server_that_proves_who_it_is() {
    let Some(python) = python() else { return };
    let folder = Folder::new("wss");
    if !make_certificates(&folder) {
        crate::say_left_out("it needs `openssl`");
        return;
    }
    let [certificate, key, authority] = ["server.pem", "server.key", "ca.pem"].map(|name| folder.join(name));
    let mut serve = Command::new(&python);
    let server = Peer::start(serve.arg(script("websocket.py")).args(["serve", &certificate, &key]));
    let port = server.line();
    let text = format!(
        "(defun talk (host &rest options)
  (flet ((call (c)
           (dolist (m (list \"grüß dich\" (vector 0 255) (make-string 300000 :initial-element #\\x)))
             (ws:send c m)
             (unless (equalp (ws:receive c) m)
               (return-from talk :changed)))
           :same))
    (apply #'ws::call-with-connection #'call (format nil \"wss://~a:{port}/echo\" host) options)))
(print (talk \"localhost\" :ca-file \"{authority}\"))
(print (talk \"127.0.0.1\" :ca-file \"{authority}\"))
(cause (talk \"localhost\"))
(cause (ws:with-connection (c \"wss://localhost:{port}/echo\" :ca-file \"{key}\") c))
(cause (ws:with-connection (c \"ws://localhost:{port}/echo\") c))"
    );
    let (lines, errors) = run(
        "wss-client",
        &text,
        &["--allow-net=localhost", &format!("--allow-read={}", folder.path().display())],
    );
    let causes: Vec<&str> = lines.iter().map(|line| line.split(' ').next().unwrap_or_default()).collect();
    let expected = [":SAME", ":SAME", "(:TLS-ERROR", "(:TLS-ERROR", "(:PROTOCOL-ERROR"];
    assert_eq!(causes, expected, "{lines:#?} {errors}");

    let started = "(lambda (port) (format t \"~d~%\" port) (finish-output))";
    let routes = "(:ws \"/echo\" (c) (ws:do-messages (m c) (ws:send c m)))";
    let text = format!(
        "(require :ws) (require :http)
(http:with-server (0 :started {started} :certificate \"server.pem\" :key \"server.key\") {routes})"
    );
    folder.file("server.esl", text);
    let mut command = crate::eslvm(&["run", "--allow-net=127.0.0.1", "--allow-read=.", "server.esl"]);
    let server = Peer::start(command.current_dir(folder.path()));
    let url = format!("wss://localhost:{}", server.line());
    let mut talk = Command::new(python);
    let client = Peer::start(talk.arg(script("websocket.py")).args(["secured", &url, &authority]));
    assert_eq!(client.rest(), ["True", "True", "CERTIFICATE_VERIFY_FAILED"]);
}

/// Each frame that a client cannot take is a failure at the call, with its reason.
#[test]
fn servers_that_break_the_protocol_are_failures_at_the_call() {
    let Some((server, port)) = start_raw() else { return };
    let text = r#"
(define-cause :none ())
(dolist (path '("/masked" "/reserved" "/kind" "/text" "/cut-text" "/part" "/long" "/long-control" "/garbage" "/close"
                "/no-code" "/cut"))
  (cause (ws:with-connection (c (to path)) (ws:receive c))))
(ws:with-connection (c (to "/reset")) (print (ws:receive c)) (cause (ws:receive c nil)))
(ws:with-connection (c (to "/parts")) (print (ws:receive c)))
(print (multiple-value-list (ws:with-connection (c (to "/kind")) (ws:wait-closed c))))
(dolist (path '("/key" "/no-upgrade" "/extension" "/protocol" "/forbidden" "/page" "/not-http"))
  (cause (ws:with-connection (c (to path)) c)))
(print (handler-case (ws:with-connection (c (to "/silent") :keep-alive 0.1)
                       (print (ws:receive c))
                       (ws:receive c))
         (failure (f) (cons (failure-cause f) (failure-arguments f)))))"#;
    let (lines, errors) = run_with_port("ws-faulty-servers", text, &port, &[]);
    let expected = [
        "(:PROTOCOL-ERROR \"Received a masked frame from server\")",
        "(:PROTOCOL-ERROR \"Reserved bits are non-zero\")",
        "(:PROTOCOL-ERROR \"Encountered invalid opcode: 3\")",
        "(:PROTOCOL-ERROR \"a text is not UTF-8\")",
        "(:PROTOCOL-ERROR \"a text is not UTF-8\")",
        "(:PROTOCOL-ERROR \"Continue frame but nothing to continue\")",
        "(:MESSAGE-TOO-LONG \"Message too long: 1099511627776 > 16777216\")",
        "(:PROTOCOL-ERROR \"Control frame too big (payload must be 125 bytes or less)\")",
        "(:PROTOCOL-ERROR \"Reserved bits are non-zero\")",
        "(:CONNECTION-CLOSED 1012 \"später\")",
        "(:CONNECTION-CLOSED 1005 \"\")",
        "(:CONNECTION-LOST \"the peer has ended the connection without closing it\")",
        "\"last\"",
        "(:CONNECTION-LOST \"the peer has ended the connection without closing it\")",
        "\"ü\"",
        "(1002 \"Encountered invalid opcode: 3\")",
        "(:PROTOCOL-ERROR \"the server does not answer the handshake: `Sec-WebSocket-Accept` is wrong\")",
        "(:PROTOCOL-ERROR \"the server switches to another protocol\")",
        "(:PROTOCOL-ERROR \"the server uses the extension `permessage-deflate`, which it was not offered\")",
        "(:PROTOCOL-ERROR \"the server chooses the protocol `other`, which it was not offered\")",
        "(:HANDSHAKE-REFUSED 403 \"the server answers with the status 403\")",
        "(:HANDSHAKE-REFUSED 200 \"the server answers with the status 200\")",
        "(:PROTOCOL-ERROR \"the answer is not HTTP: invalid HTTP version parsed\")",
        "\"hi\"",
        "(:CONNECTION-LOST \"the peer has been silent for 0.2 s\")",
    ];
    assert_eq!(lines, expected, "{errors}");
    drop(server);
}

/// Returns the program of a recipe of the cookbook.
fn recipe(title: &str) -> String {
    let book = std::fs::read_to_string(esl_conformance::root().join("docs/cookbook/robots.md"));
    let book = book.expect("it can be read");
    let part = book.split_once(&format!("\n## {title}\n")).expect("there is such a recipe").1;
    let program = part.split_once("```text\n").and_then(|(_, program)| program.split_once("```"));
    program.expect("it has a program").0.to_owned()
}

#[test]
fn the_recipe_for_rosbridge_commands_a_robot() {
    let Some(python) = python() else { return };
    let server = Peer::start(Command::new(python).arg(script("rosbridge.py")).arg("serve"));
    let port = server.line();
    let program =
        recipe("Command a robot by rosbridge").replace("ws://robot:9090", &format!("ws://127.0.0.1:{port}"));
    let program = format!(
        "{program}\n(ws:with-connection (bridge \"ws://127.0.0.1:{port}\")
  (pursue (link (hand-out bridge nil))
          (mission (cause (call-service bridge \"/fly\")))))"
    );
    let (lines, errors) = run("ws-rosbridge", &program, &[]);
    let docked = "\"{\\\"station\\\":2,\\\"docked\\\":true}\"";
    assert_eq!(lines, [docked, "(:SERVICE-FAILED \"/fly\" \"no such service\")"], "{errors}");
    let heard: Vec<String> = (0..5).map(|_| server.line()).collect();
    let expected = [
        "subscribe /battery sensor_msgs/BatteryState",
        "advertise /cmd_vel geometry_msgs/Twist",
        "publish /cmd_vel {\"linear\": {\"x\": 0.2}}",
        "call /dock {\"station\": 2}",
        "call /fly {}",
    ];
    assert_eq!(heard, expected);
}

#[test]
fn the_recipe_for_roslibpy_serves_it() {
    let Some(python) = python() else { return };
    let port = crate::examples::free_port();
    let program =
        recipe("Let web pages and roslibpy command the executive").replace("(9090)", &format!("({port})"));
    let folder = Folder::with("ws-roslibpy", &[("main.esl", &program)]);
    let mut command = crate::eslvm(&["run", "--allow-net=127.0.0.1", "main.esl"]);
    let server = Peer::start(command.current_dir(folder.path()));
    while std::net::TcpStream::connect(("127.0.0.1", port)).is_err() {
        std::thread::sleep(Duration::from_millis(20));
    }
    let client =
        Peer::start(Command::new(python).arg(script("rosbridge.py")).args(["ask", &port.to_string()]));
    let lines = client.rest();
    let failed = "failed A failure of cause :TOO-FAR with 1000.";
    assert_eq!(lines, ["heard ready", "result 3", failed, "heard halted"]);
    assert_eq!(server.line(), "/orders: halt");
}

/// A peer that is killed is a failure at the call, or at the next one.
#[test]
fn a_peer_that_is_killed_is_a_failure_at_the_call() {
    let Some((mut server, port)) = start_websockets() else { return };
    let folder = Folder::new("ws-kill");
    let text = format!(
        "{}(ws:with-connection (c \"ws://127.0.0.1:{port}/echo\")
  (ws:send c \"x\")
  (format t \"~a~%\" (ws:receive c))
  (finish-output)
  (cause (ws:receive c))
  (cause (ws:send c \"y\"))
  (print (multiple-value-list (ws:wait-closed c))))
(cause (ws:with-connection (c \"ws://127.0.0.1:{port}/echo\") c))",
        crate::ws::BEFORE
    );
    folder.file("main.esl", text);
    let mut command = crate::eslvm(&["run", "--allow-net=127.0.0.1", "main.esl"]);
    let client = Peer::start(command.current_dir(folder.path()));
    assert_eq!(client.line(), "x");
    server.kill();
    let lines: Vec<String> = client.rest().into_iter().filter(|line| !line.is_empty()).collect();
    for line in &lines[..2] {
        assert!(line.starts_with("(:CONNECTION-LOST "), "{lines:?}");
    }
    assert!(lines[2].starts_with("(1006 "), "{lines:?}");
    // The port may close a moment after the connection.
    assert!(lines[3].starts_with("(:CONNECTION-"), "{lines:?}");
}

/// A peer that floods takes no memory without bound: neither by messages that the program does not take, nor
/// by pings whose answers it does not read.
#[cfg(target_os = "linux")]
#[test]
fn a_peer_that_floods_takes_no_memory() {
    const MEGABYTE: usize = 1 << 20;
    let Some((raw, port)) = start_raw() else { return };
    let folder = Folder::new("ws-flood");
    let text = format!(
        "{}(ws:with-connection (c \"ws://127.0.0.1:{port}/floods\" :largest 1000000)
  (format t \"open~%\")
  (finish-output)
  (sleep 60))",
        crate::ws::BEFORE
    );
    folder.file("main.esl", text);
    let mut command = crate::eslvm(&["run", "--allow-net=127.0.0.1", "--memory=50M", "main.esl"]);
    let client = Peer::start(command.current_dir(folder.path()));
    assert_eq!(client.line(), "open");
    std::thread::sleep(Duration::from_millis(500));
    let before = client.memory();
    std::thread::sleep(Duration::from_secs(1));
    assert!(client.memory() < before + 8 * MEGABYTE, "{before} {}", client.memory());
    drop((client, raw));
    // Messages that the program does not take.
    let routes = "(:ws \"/echo\" (c :largest 1000000) (sleep 60))";
    let (server, port) = start_server(&folder, routes, &["--memory=50M"]);
    let before = server.memory();
    let mut stream = std::net::TcpStream::connect(("127.0.0.1", port)).expect("it listens");
    let handshake = crate::ws::HANDSHAKE.as_bytes();
    std::io::Write::write_all(&mut stream, handshake).expect("it reads");
    stream.set_write_timeout(Some(Duration::from_secs(1))).expect("it is a time");
    let message = crate::ws::frame(0x82, &vec![0; 100_000]);
    let mut sent = 0;
    while sent < 200 * MEGABYTE && std::io::Write::write_all(&mut stream, &message).is_ok() {
        sent += message.len();
    }
    assert!(sent < 20 * MEGABYTE, "it reads no further: {sent}");
    assert!(server.memory() < before + 8 * MEGABYTE, "{before} {}", server.memory());
}
