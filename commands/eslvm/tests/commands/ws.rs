//! The module `:ws`: its client and the server of `:http` with each other, and with peers of the test's own
//! that break the protocol.

use std::io::{Read, Write};
use std::net::{Shutdown, TcpStream};
use std::time::Duration;

use esl_conformance::folder::Folder;
use esl_conformance::process;

use crate::eslvm;
use crate::ws_peers::Peer;

/// Forms before a program: a macro for causes, and one for a server with these routes in a task of its own.
pub(crate) const BEFORE: &str = "(require :ws)
(require :http)
(defmacro cause (form)
  `(print (handler-case ,form (failure (f) (cons (failure-cause f) (failure-arguments f))))))
(define-fluent *served* nil)
(defmacro serving (&body routes)
  `(progn (spawn (:name 'server :daemon t)
            (http:with-server (0 :started (lambda (port) (setq *served* port))) ,@routes))
          (wait-until *served*)))
(defun url (path) (format nil \"ws://127.0.0.1:~d~a\" *served* path))
";

/// Runs a program that may talk to this machine. Returns its lines and its error output.
pub(crate) fn run(test: &str, text: &str, options: &[&str]) -> (Vec<String>, String) {
    let folder = Folder::with(test, &[("main.esl", &format!("{BEFORE}{text}"))]);
    let mut command = eslvm(&["run", "--allow-net=127.0.0.1"]);
    command.args(options).arg("main.esl");
    let done = process::run(command.current_dir(folder.path()), "");
    let lines = done.output.lines().map(str::trim).filter(|line| !line.is_empty());
    (lines.map(str::to_owned).collect(), done.errors)
}

#[track_caller]
fn check(test: &str, text: &str, expected: &[&str]) {
    let (lines, errors) = run(test, text, &[]);
    assert_eq!(lines, expected, "{errors}");
    assert_eq!(errors, "");
}

#[test]
fn messages_go_both_ways() {
    let text = r#"(serving
  (:ws "/echo/:name" (c name greeting :protocols '("v2" "v1"))
    (ws:send c (format nil "~a ~a ~a" (or greeting "hello") name (ws:protocol c)))
    (ws:do-messages (m c) (ws:send c m)))
  (:get "/echo/:name" (name) (format nil "page of ~a" name))
  (:ws "/only" (c) (ws:close c 4001 "go away")))
(ws:with-connection (c (url "/echo/w%C3%B6rld?greeting=hi"))
  (print (list (ws:protocol c) (ws:receive c)))
  (ws:send c "grüß dich")
  (print (ws:receive c))
  (ws:send c (vector 0 255))
  (print (ws:receive c))
  (dotimes (i 1000) (ws:send c (princ-to-string i)))
  (print (loop for i below 1000 always (equal (ws:receive c) (princ-to-string i))))
  (ws:send c (make-string 1000000 :initial-element #\ü))
  (print (length (ws:receive c)))
  (ws:send c "")
  (print (ws:receive c)))
(ws:with-connection (c (url "/echo/x") :protocols '("v1" "v3") :headers '(("Origin" . "http://here")))
  (print (list (ws:protocol c) (ws:receive c))))
(ws:with-connection (c (url "/only"))
  (cause (ws:receive c))
  (cause (ws:receive c nil))
  (print (multiple-value-list (ws:wait-closed c)))
  (cause (ws:send c "late")))
(print (http:get (format nil "http://127.0.0.1:~d/echo/y" *served*)))
(multiple-value-bind (body status headers) (http:get (format nil "http://127.0.0.1:~d/only" *served*))
  (print (list body status (http:header "upgrade" headers))))
(cause (ws:with-connection (c (url "/none")) c))"#;
    let expected = [
        "(NIL \"hi wörld NIL\")",
        "\"grüß dich\"",
        "#(0 255)",
        "T",
        "1000000",
        "\"\"",
        "(\"v1\" \"hello x v1\")",
        "(:CONNECTION-CLOSED 4001 \"go away\")",
        "(:CONNECTION-CLOSED 4001 \"go away\")",
        "(4001 \"go away\")",
        "(:CONNECTION-CLOSED 4001 \"go away\")",
        "\"page of y\"",
        "(\"this path speaks WebSocket\" 426 \"websocket\")",
        "(:HANDSHAKE-REFUSED 404 \"the server answers with the status 404\")",
    ];
    check("ws-both", text, &expected);
}

/// The ends of both sides: by their bodies, by failures, by aborts.
#[test]
fn a_connection_is_closed_however_its_body_ends() {
    let text = r#"(define-fluent *ends* nil)
(define-cause :broken ())
(serving
  (:ws "/ends" (c) (push (multiple-value-list (ws:wait-closed c)) *ends*))
  (:ws "/returns" (c) (ws:receive c))
  (:ws "/fails" (c) (ws:receive c) (fail :broken))
  (:ws "/waits" (c) (unwind-protect (ws:receive c) (push 'left *ends*))))
(defmacro end-of (path &body body)
  `(progn (setq *ends* nil)
          (handler-case (ws:with-connection (c (url ,path)) ,@body) (failure () nil))
          (wait-until *ends*)
          (print (first *ends*))))
(define-fluent *c* nil)
(ws:with-connection (c (url "/ends")) (setq *c* c))
(wait-until *ends*)
(print (pop *ends*))
(cause (ws:send *c* "late"))
(cause (ws:receive *c*))
(handler-case (ws:with-connection (c (url "/ends")) (fail :broken)) (failure (f) (print (failure-cause f))))
(wait-until *ends*)
(print (pop *ends*))
(ws:with-connection (c (url "/ends")) (ws:close c 3000 "enough") (ws:close c 3001))
(wait-until *ends*)
(print (pop *ends*))
(let ((task (spawn (ws:with-connection (c (url "/ends")) (setq *c* 'open) (ws:receive c)))))
  (wait-until (eq *c* 'open))
  (abort-task task)
  (wait-until *ends*)
  (print (pop *ends*)))
(cause (ws:with-connection (c (url "/returns")) (ws:send c "x") (ws:receive c)))
(cause (ws:with-connection (c (url "/fails")) (ws:send c "x") (ws:receive c)))
(ws:with-connection (c (url "/waits")) c)
(wait-until *ends*)
(print (pop *ends*))
(cause (ws:with-connection (c (url "/ends")) (ws:close c 1005)))
(cause (ws:with-connection (c (url "/ends")) (ws:close c 1000 (make-string 124 :initial-element #\x))))
(cause (ws:with-connection (c (url "/ends")) (with-timeout 0.01 (ws:receive c))))"#;
    let (lines, errors) = run("ws-ends", text, &[]);
    let expected = [
        "(1000 \"\")",
        "(:CONNECTION-CLOSED 1000 \"\")",
        "(:CONNECTION-CLOSED 1000 \"\")",
        ":BROKEN",
        "(1001 \"\")",
        "(3000 \"enough\")",
        "(1001 \"\")",
        "(:CONNECTION-CLOSED 1000 \"\")",
        "(:CONNECTION-CLOSED 1011 \"\")",
        "LEFT",
        "(:WS-ERROR \"a connection cannot be closed with the code 1005; take 1000, or one from 3000 to 4999\")",
        "(:WS-ERROR \"the reason has 124 bytes: at most 123 are sent with a code\")",
        "(:TIMEOUT)",
    ];
    assert_eq!(lines, expected, "{errors}");
    assert_eq!(errors.trim(), "GET /fails: A failure of cause :BROKEN.");
}

/// Messages as signals of an input, beside other events.
#[test]
fn messages_signal_an_input() {
    let text = r#"(serving
  (:ws "/count" (c) (dotimes (i 300) (ws:send c (princ-to-string i))) (ws:close c 4000 "done"))
  (:ws "/first" (c) (dotimes (i 10) (ws:send c (princ-to-string i))) (ws:receive c nil)))
(ws:with-connection (c (url "/count"))
  (let ((input (ws:messages c)))
    (print (eq input (ws:messages c)))
    (print (loop for i below 300 always (equal (wait-for-event input) (princ-to-string i))))
    (print (multiple-value-list (wait-for-event input)))))
(ws:with-connection (c (url "/first"))
  (let ((input (ws:messages c :capacity 1 :when-full :drop-newest)))
    (wait-until (plusp (input-dropped input)))
    (print (wait-for-event input))))"#;
    check("ws-input", text, &["T", "T", "(NIL 4000 \"done\")", "\"0\""]);
}

/// Clients need a right, and wrong arguments are refused before anything is sent.
#[test]
fn rights_and_arguments_are_checked() {
    let text = r#"(cause (ws:with-connection (c "ws://localhost:1/") c))
(cause (ws:with-connection (c "wss://localhost/") c))
(cause (ws:with-connection (c "http://127.0.0.1:1/") c))
(cause (ws:with-connection (c "ws://127.0.0.1:1/#x") c))
(cause (ws:with-connection (c "ws://127.0.0.1:1/" :headers '(("Upgrade" . "x"))) c))
(cause (ws:with-connection (c "ws://127.0.0.1:1/" :protocols '("a b")) c))
(cause (first (handler-case (ws:with-connection (c "ws://127.0.0.1:1/") c)
                (failure (f) (list (failure-cause f))))))
(cause (with-rights () (ws:with-connection (c "ws://127.0.0.1:1/") c)))
(print (handler-case (eval '(http:with-server (0) (:ws "/" (c) 5 . 6))) (error () 'refused)))"#;
    let expected = [
        "(:PERMISSION-DENIED :NET \"localhost:1\" \"--allow-net=localhost:1\")",
        "(:PERMISSION-DENIED :NET \"localhost:443\" \"--allow-net=localhost:443\")",
        "(:WS-ERROR \"the URL `http://127.0.0.1:1/` begins neither with ws:// nor with wss://\")",
        "(:WS-ERROR \"the URL of a connection cannot have a part behind `#`\")",
        "(:WS-ERROR \"the header `upgrade` is the handshake's own; leave it out\")",
        "(:WS-ERROR \"`a b` is not a name of a protocol\")",
        ":CONNECTION-REFUSED",
        "(:PERMISSION-DENIED :NET \"127.0.0.1:1\" NIL)",
        "REFUSED",
    ];
    check("ws-rights", text, &expected);
}

/// A recorded run is replayed without its server.
#[test]
fn a_recorded_conversation_is_replayed() {
    let routes = r#"(:ws "/" (c) (dotimes (i 3) (ws:send c (format nil "message ~d" i)) (ws:receive c))
               (ws:send c (vector 1 2)) (ws:close c 3500 "over"))"#;
    let client = format!(
        "{BEFORE}(ws:with-connection (c (format nil \"ws://127.0.0.1:~a/\" (first (command-line-arguments))))
  (dotimes (i 2) (print (ws:receive c)) (ws:send c \"next\"))
  (let ((input (ws:messages c)))
    (print (wait-for-event input))
    (ws:send c \"next\")
    (print (wait-for-event input))
    (print (multiple-value-list (wait-for-event input)))))"
    );
    let folder = Folder::with("ws-record", &[("main.esl", &client)]);
    let (server, port) = start_server(&folder, routes, &[]);
    let port = port.to_string();
    let mut command = eslvm(&["run", "--allow-net=127.0.0.1", "--record", "run.eslj", "main.esl", &port]);
    let recorded = process::run(command.current_dir(folder.path()), "");
    drop(server);
    let expected = "\"message 0\" \"message 1\" \"message 2\" #(1 2) (NIL 3500 \"over\")".split_whitespace();
    assert!(recorded.output.split_whitespace().eq(expected), "{}{}", recorded.output, recorded.errors);
    let mut command = eslvm(&["replay", "run.eslj"]);
    let replayed = process::run(command.current_dir(folder.path()), "");
    assert_eq!(replayed.output, recorded.output, "{}", replayed.errors);
}

/// Starts a program that serves these routes, and returns its port.
pub(crate) fn start_server(folder: &Folder, routes: &str, options: &[&str]) -> (Peer, u16) {
    let started = "(lambda (port) (format t \"~d~%\" port) (finish-output))";
    folder.file("server.esl", format!("{BEFORE}(http:with-server (0 :started {started})\n  {routes})"));
    let mut command = eslvm(&["run", "--allow-net=127.0.0.1"]);
    command.args(options).arg("server.esl");
    let server = Peer::start(command.current_dir(folder.path()));
    let port = server.line().parse().expect("it is a port");
    (server, port)
}

pub(crate) const HANDSHAKE: &str = "GET /echo HTTP/1.1\r\nHost: x\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n\
    Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\
    Sec-WebSocket-Extensions: permessage-deflate; client_max_window_bits\r\n\r\n";

/// Returns all that a peer sends to a connection on which these bytes come.
fn answer_to(port: u16, bytes: &[u8]) -> Vec<u8> {
    let mut stream = TcpStream::connect(("127.0.0.1", port)).expect("it listens");
    stream.set_read_timeout(Some(Duration::from_secs(20))).expect("it is a time");
    let mut answer = Vec::new();
    // It may close before it has read all.
    drop(stream.write_all(bytes));
    drop(stream.read_to_end(&mut answer));
    answer
}

/// Returns the frames behind the head of an answer.
fn frames(answer: &[u8]) -> &[u8] {
    let end = answer.windows(4).position(|four| four == b"\r\n\r\n").expect("there is a head");
    &answer[end + 4..]
}

/// Returns a frame of a client, whose mask is 0.
pub(crate) fn frame(first: u8, payload: &[u8]) -> Vec<u8> {
    let length = payload.len();
    let mut bytes = vec![first];
    match length {
        0..126 => bytes.push(0x80 | length as u8),
        126..65536 => {
            bytes.push(0x80 | 126);
            bytes.extend((length as u16).to_be_bytes());
        }
        _ => {
            bytes.push(0x80 | 127);
            bytes.extend((length as u64).to_be_bytes());
        }
    }
    bytes.extend([0; 4]);
    bytes.extend(payload);
    bytes
}

/// A server survives what clients may send, tells them the fault by a code, and answers the next one.
#[test]
fn clients_that_break_the_protocol_are_told_so() {
    let folder = Folder::new("ws-faults");
    let routes = "(:ws \"/echo\" (c :largest 1000) (ws:do-messages (m c) (ws:send c m)))";
    let (mut server, port) = start_server(&folder, routes, &[]);
    let parts = [frame(0x01, &[0xc3]), frame(0x89, b"p"), frame(0x80, &[0xbc])].concat();
    for (bytes, expected) in
        [(frame(0x81, b"hi"), &[0x81, 2, b'h', b'i'][..]), (parts, &[0x8a, 1, b'p', 0x81, 2, 0xc3, 0xbc])]
    {
        let mut stream = TcpStream::connect(("127.0.0.1", port)).expect("it listens");
        stream.write_all(&[HANDSHAKE.as_bytes(), &bytes].concat()).expect("it is sent");
        let mut answer = Vec::new();
        while !answer.ends_with(expected) {
            let mut byte = [0];
            stream.read_exact(&mut byte).unwrap_or_else(|_| panic!("expected {expected:?} in {answer:?}"));
            answer.extend(byte);
        }
    }
    let cases: &[(&str, Vec<u8>, &[u8])] = &[
        ("a close", frame(0x88, &[0x03, 0xe8]), &[0x88, 2, 3, 0xe8]),
        ("a close without a code", frame(0x88, b""), &[0x88, 0]),
        ("a code that may not be sent", frame(0x88, &[0x03, 0xed]), &[3, 0xea]),
        ("a close of one byte", frame(0x88, &[3]), &[3, 0xea]),
        ("a frame without a mask", vec![0x81, 2, b'h', b'i'], &[3, 0xea]),
        ("reserved bits, as of a compressed frame", frame(0xc1, b"hi"), &[3, 0xea]),
        ("an unknown kind of data", frame(0x83, b"hi"), &[3, 0xea]),
        ("an unknown kind of control", frame(0x8b, b"hi"), &[3, 0xea]),
        ("a control frame in parts", frame(0x09, b"hi"), &[3, 0xea]),
        ("a long control frame", frame(0x89, &[0; 126]), &[3, 0xea]),
        ("a part of nothing", frame(0x80, b"hi"), &[3, 0xea]),
        ("a message within another", [frame(0x01, b"hi"), frame(0x81, b"hi")].concat(), &[3, 0xea]),
        ("a text that is not UTF-8", frame(0x81, &[0xff]), &[3, 0xef]),
        ("a text that ends within a character", frame(0x81, &[0xc3]), &[3, 0xef]),
        (
            "a text in parts that is not UTF-8",
            [frame(0x01, b"hi"), frame(0x80, &[0xff])].concat(),
            &[3, 0xef],
        ),
        ("a reason that is not UTF-8", frame(0x88, &[0x03, 0xe8, 0xff]), &[3, 0xef]),
        ("a long message", frame(0x82, &[0; 1001]), &[3, 0xf1]),
        (
            "a message that is long in parts",
            [frame(0x02, &[0; 600]), frame(0x80, &[0; 600])].concat(),
            &[3, 0xf1],
        ),
        ("a length of 2^63", [&[0x82, 0xff, 0x80][..], &[0; 7], &[0; 4]].concat(), &[3, 0xf1]),
        ("garbage", b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03".to_vec(), &[3, 0xea]),
        ("an end within a frame", vec![0x81, 0xfe], &[]),
    ];
    for (name, bytes, expected) in cases {
        let answer = if *name == "an end within a frame" {
            let mut stream = TcpStream::connect(("127.0.0.1", port)).expect("it listens");
            stream
                .write_all(HANDSHAKE.as_bytes())
                .and_then(|()| stream.write_all(bytes))
                .expect("it is sent");
            stream.shutdown(Shutdown::Write).expect("it is open");
            let mut answer = Vec::new();
            drop(stream.read_to_end(&mut answer));
            answer
        } else {
            answer_to(port, &[HANDSHAKE.as_bytes(), bytes].concat())
        };
        let head = String::from_utf8_lossy(&answer);
        assert!(head.starts_with("HTTP/1.1 101 "), "{name}: {head}");
        assert!(head.contains("s3pPLMBiTxaQ9kYGzzhZRbK+xOo="), "{name}: {head}");
        // The extension is not taken.
        assert!(!head.to_lowercase().contains("sec-websocket-extensions"), "{name}: {head}");
        let frames = frames(&answer);
        if expected.len() == 2 && expected[0] == 3 {
            // A close frame, whose reason is a text.
            assert_eq!((frames[0], &frames[2..4]), (0x88, *expected), "{name}: {frames:?}");
        } else {
            assert_eq!(frames, *expected, "{name}");
        }
    }
    for (name, bad, status) in [
        ("another version", HANDSHAKE.replace(": 13", ": 8"), "426"),
        ("a wrong key", HANDSHAKE.replace("bm9uY2U=", "x"), "400"),
        ("without a key", HANDSHAKE.replace("-Key", "-Kez"), "400"),
        ("another method", HANDSHAKE.replacen("GET", "POST", 1), "426"),
        ("another path", HANDSHAKE.replacen("/echo", "/other", 1), "404"),
        ("another protocol", HANDSHAKE.replace(": websocket", ": h2c"), "426"),
    ] {
        let bad = bad.replace(
            "dGhlIHNhbXBsZSBub25jZQ==",
            if name == "a wrong key" { "abc" } else { "dGhlIHNhbXBsZSBub25jZQ==" },
        );
        let closing = bad.replace("Host: x", "Host: x\r\nX-End: 1");
        let answer = answer_to(port, format!("{closing}GET / HTTP/9.9\r\n\r\n").as_bytes());
        let head = String::from_utf8_lossy(&answer);
        assert!(head.starts_with(&format!("HTTP/1.1 {status} ")), "{name}: {head}");
    }
    assert!(server.is_running());
}

/// Frames of all kinds, of which bytes are changed, left out or cut off, end their connection at most.
/// `ESL_NOISE` sets another number of frames, for longer runs by hand.
#[test]
fn noise_ends_its_connection_and_nothing_else() {
    let folder = Folder::new("ws-noise");
    let routes = "(:ws \"/echo\" (c :largest 5000) (ws:do-messages (m c) (ws:send c m)))";
    let (mut server, port) = start_server(&folder, routes, &[]);
    let mut state = 0x2545_f491_4f6c_dd1d_u64;
    let mut random = |below: usize| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state % below as u64) as usize
    };
    let count = std::env::var("ESL_NOISE").ok().and_then(|count| count.parse().ok()).unwrap_or(20_000);
    let mut frames = 0;
    while frames < count {
        let mut bytes = Vec::new();
        let number = 1 + random(60);
        for _ in 0..number {
            let first = [0x81, 0x82, 0x01, 0x02, 0x00, 0x80, 0x89, 0x8a, 0x81, 0x82, 0x88, 0xc1][random(12)];
            // Most close frames end the others' connection.
            let first = if first == 0x88 && random(8) > 0 { 0x89 } else { first };
            let payload: Vec<u8> = (0..random(40)).map(|_| b"abc{}\xc3\xbc\xff"[random(8)]).collect();
            bytes.extend(frame(first, &payload));
        }
        for _ in 0..random(5) {
            let place = random(bytes.len());
            bytes[place] = random(256) as u8;
        }
        bytes.truncate(bytes.len() - random(2) * random(bytes.len() / 2));
        frames += number;
        let mut stream = TcpStream::connect(("127.0.0.1", port)).expect("it listens");
        drop(stream.write_all(&[HANDSHAKE.as_bytes(), &bytes].concat()));
        if random(4) == 0 {
            drop(stream.shutdown(Shutdown::Write));
            stream.set_read_timeout(Some(Duration::from_secs(20))).expect("it is a time");
            drop(stream.read_to_end(&mut Vec::new()));
        }
    }
    let mut stream = TcpStream::connect(("127.0.0.1", port)).expect("it listens");
    stream.set_read_timeout(Some(Duration::from_secs(20))).expect("it is a time");
    stream.write_all(&[HANDSHAKE.as_bytes(), &frame(0x81, b"hi")].concat()).expect("it is sent");
    let mut answer = Vec::new();
    while !answer.ends_with(&[0x81, 2, b'h', b'i']) {
        let mut byte = [0];
        stream.read_exact(&mut byte).expect("the message comes back");
        answer.extend(byte);
    }
    assert!(server.is_running());
}
