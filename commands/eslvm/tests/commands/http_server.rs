//! The server of the module `:http`, and what clients may send it.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::process::Child;
use std::time::{Duration, Instant};

use esl_conformance::folder::Folder;
use esl_conformance::process::{self, Finished};

use crate::eslvm;

/// A program that serves until it reads a line, in a folder of its own.
pub(crate) struct Served {
    pub(crate) folder: Folder,
    child: Child,
    pub(crate) port: u16,
    said: BufReader<std::process::ChildStdout>,
}

impl Served {
    /// Begins a program with these definitions and routes, for this test.
    pub(crate) fn begin(test: &str, definitions: &str, routes: &str) -> Served {
        Served::begin_with(test, "", definitions, routes)
    }

    /// Begins one with these options.
    fn begin_with(test: &str, options: &str, definitions: &str, routes: &str) -> Served {
        let folder = Folder::new(test);
        let text = format!(
            "(require :http)
{definitions}
(spawn (:name 'server :daemon t)
  (http:with-server (0 :started (lambda (port) (format t \"~d~%\" port) (finish-output)) {options})
{routes}))
(read-line)"
        );
        folder.file("main.esl", text);
        let mut child =
            process::start(eslvm(&["run", "--allow-net=127.0.0.1", "main.esl"]).current_dir(folder.path()));
        let mut said = BufReader::new(child.stdout.take().expect("it is a pipe"));
        let mut port = String::new();
        said.read_line(&mut port).expect("the port is printed");
        Served { folder, child, port: port.trim().parse().expect("it is a port"), said }
    }

    pub(crate) fn connect(&self) -> TcpStream {
        TcpStream::connect(("127.0.0.1", self.port)).expect("it listens")
    }

    /// Sends bytes, and the end of what is sent. Returns all that comes back.
    fn ask(&self, request: &[u8]) -> Vec<u8> {
        let mut stream = self.connect();
        // The server may have refused it before all of it was sent.
        drop(stream.write_all(request).and_then(|()| stream.shutdown(Shutdown::Write)));
        let mut answer = Vec::new();
        stream.set_read_timeout(Some(Duration::from_secs(60))).expect("it can be set");
        stream.read_to_end(&mut answer).expect("it answers");
        answer
    }

    /// Returns the next line that the program prints.
    fn next_line(&mut self) -> String {
        let mut line = String::new();
        self.said.read_line(&mut line).expect("it is text");
        line.trim().to_owned()
    }

    /// Ends the program, which has to go on until then.
    pub(crate) fn end(mut self) -> Finished {
        self.child.stdin.as_mut().expect("it is a pipe").write_all(b"\n").expect("it reads");
        process::finish(self.child)
    }
}

/// Returns the answers among bytes, each as its status, with what it allows, the length that it announces
/// without having it, its version if that is 1.0, and the body, of which that of a refusal is left out.
fn answers(bytes: &[u8]) -> Vec<String> {
    let mut rest = bytes;
    let mut answers = Vec::new();
    while !rest.is_empty() {
        let Some(end) = rest.windows(4).position(|bytes| bytes == b"\r\n\r\n") else {
            answers.push(format!("cut: {:?}", String::from_utf8_lossy(rest)));
            break;
        };
        let head = String::from_utf8_lossy(&rest[..end]).into_owned();
        rest = &rest[end + 4..];
        let header = |name: &str| {
            head.lines().find_map(|line| {
                let (known, value) = line.split_once(": ")?;
                known.eq_ignore_ascii_case(name).then_some(value)
            })
        };
        let status = head.get(9..12).unwrap_or("no status");
        let mut answer = status.to_owned();
        if head.starts_with("HTTP/1.0") {
            answer += " in 1.0";
        }
        if let Some(allowed) = header("allow") {
            answer += &format!(" allows {allowed}");
        }
        if let Some(length) = header("content-length").and_then(|length| length.parse::<usize>().ok()) {
            // The next answer follows if the body is missing.
            if length > 0 && (rest.is_empty() || rest.starts_with(b"HTTP/1.")) {
                answer += &format!(" of {length}");
            } else {
                let body = String::from_utf8_lossy(&rest[..length.min(rest.len())]).into_owned();
                rest = &rest[length.min(rest.len())..];
                if length > 0 && status < "400" {
                    answer += &format!(" {body}");
                }
            }
        }
        answers.push(answer);
    }
    answers
}

const ROUTES: &str = r#"
    (:get "/hello/:name" (name greeting) (format nil "~a ~a" (or greeting "hello") name))
    (:post "/echo" () (http:request-body http:*request*))
    (:get "/header/:name" (name) (or (http:header name (http:request-headers http:*request*)) "none"))
    (:get "/path/:part" (part) (format nil "~a ~a" (http:request-path http:*request*) part))
    (:get "/none" () (values "not sent" 204 '(("Content-Length" . "8"))))
    (:get "/same" () (values "not sent" 304))
    (:get "/empty" () nil)
    (:get "/status" (of) (values "it" (parse-integer of)))
    (:put "/thing" () "put")
    (:delete "/thing" () "deleted")
    (:head "/headed" () (values "four" 200 '(("X-Own" . "yes"))))
    (:get "/headed" () "more than four")
    (:options "*" () (values "" 204 '(("Allow" . "GET, POST"))))
    (:get "/fail" () (fail :broken))
    (:get "/wrong" () (car 5))
    (:get "/no-body" () 5)
    (:get "/no-byte" () #(1 300))
    (:get "/split" () (values "x" 200 (list (cons "X" (format nil "a~c~cY: b" #\Return #\Newline)))))
    (:get "/end" () "end")"#;

/// A request after which the connection ends, by which is seen that it was open until then.
const END: &str = "GET /end HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n";

/// The section of RFC 9112, or of RFC 9110 where it begins with `S`; bytes that are sent, with `END` for a
/// last request; the answers.
#[rustfmt::skip]
const REQUESTS: &[(&str, &str, &[&str])] = &[
    // ---- the line of the request
    ("2.2", "\r\n\r\nGET /hello/a HTTP/1.1\r\nHost: x\r\n\r\nEND", &["200 hello a", "200 end"]),
    ("2.2", "GET /hello/a HTTP/1.1\nHost: x\n\nEND", &["200 hello a", "200 end"]),
    ("2.2", "GET /hello/a HTTP/1.1\r\n Host: x\r\n\r\nEND", &["400"]),
    ("2.2", "GET /hello/a HTTP/1.1\r\nHost: x\r\nX: a\rb\r\n\r\nEND", &["400"]),
    ("2.3", "GET /hello/a HTTP/9.9\r\nHost: x\r\n\r\nEND", &["505"]),
    ("2.3", "\r\nGET /hello/a HTTP/0.9\nHost: x\n\nEND", &["505"]),
    ("2.3", "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n", &["505"]),
    ("2.3", "GET /hello/a HTTP/1.2\r\nHost: x\r\n\r\nEND", &["200 hello a", "200 end"]),
    ("2.3", "GET /hello/a HTTP/1.x\r\nHost: x\r\n\r\nEND", &["400"]),
    ("2.3", "GET /hello/a http/1.1\r\nHost: x\r\n\r\nEND", &["400"]),
    ("3", "GET /hello/a\r\n\r\nEND", &["400"]),
    ("3", "GET  /hello/a HTTP/1.1\r\nHost: x\r\n\r\nEND", &["400"]),
    ("3", "GET /hello/a b HTTP/1.1\r\nHost: x\r\n\r\nEND", &["400"]),
    ("3", "GET\t/hello/a HTTP/1.1\r\nHost: x\r\n\r\nEND", &["400"]),
    ("3.1", "G@T /hello/a HTTP/1.1\r\nHost: x\r\n\r\nEND", &["400"]),
    ("3.1", "get /hello/a HTTP/1.1\r\nHost: x\r\n\r\nEND", &["405 allows GET, HEAD", "200 end"]),
    ("3.2", "GET hello/a HTTP/1.1\r\nHost: x\r\n\r\nEND", &["400"]),
    ("3.2", "GET /hello/a\0b HTTP/1.1\r\nHost: x\r\n\r\nEND", &["400"]),
    ("3.2.1", "GET /path/a%2Fb%20%C3%BC+? HTTP/1.1\r\nHost: x\r\n\r\nEND", &["200 /path/a%2Fb%20%C3%BC+ a/b ü+", "200 end"]),
    ("3.2.1", "GET /path/%zz%4 HTTP/1.1\r\nHost: x\r\n\r\nEND", &["200 /path/%zz%4 %zz%4", "200 end"]),
    ("3.2.1", "GET /hello/a?greeting=g%C3%BC+ten%26&x HTTP/1.1\r\nHost: x\r\n\r\nEND", &["200 gü ten& a", "200 end"]),
    ("3.2.2", "GET http://other/hello/a HTTP/1.1\r\nHost: x\r\n\r\nEND", &["200 hello a", "200 end"]),
    ("3.2.2", "GET http://other HTTP/1.1\r\nHost: x\r\n\r\nEND", &["404", "200 end"]),
    ("3.2.3", "CONNECT other:443 HTTP/1.1\r\nHost: other:443\r\n\r\nEND", &["501"]),
    ("3.2.4", "OPTIONS * HTTP/1.1\r\nHost: x\r\n\r\nEND", &["204 allows GET, POST", "200 end"]),
    ("3.2.4", "GET * HTTP/1.1\r\nHost: x\r\n\r\nEND", &["400"]),
    // ---- the host
    ("3.2", "GET /hello/a HTTP/1.1\r\n\r\nEND", &["400"]),
    ("3.2", "GET /hello/a HTTP/1.1\r\nHost: x\r\nHost: y\r\n\r\nEND", &["400"]),
    ("3.2", "GET /hello/a HTTP/1.1\r\nHost: x\r\nHost: x\r\n\r\nEND", &["400"]),
    ("3.2", "GET /hello/a HTTP/1.1\r\nHost: a b\r\n\r\nEND", &["400"]),
    ("3.2", "GET /hello/a HTTP/1.1\r\nHost: me@x\r\n\r\nEND", &["400"]),
    ("3.2", "GET /hello/a HTTP/1.1\r\nHost: x/y\r\n\r\nEND", &["400"]),
    ("3.2", "GET /hello/a HTTP/1.1\r\nHost:\r\n\r\nEND", &["200 hello a", "200 end"]),
    ("3.2", "GET /hello/a HTTP/1.1\r\nHost: [::1]:80\r\n\r\nEND", &["200 hello a", "200 end"]),
    ("3.2", "GET /hello/a HTTP/1.0\r\n\r\nEND", &["200 in 1.0 hello a"]),
    // ---- headers
    ("5", "GET /header/x HTTP/1.1\r\nHost: x\r\nx:\t a\u{e9} b \t\r\n\r\nEND", &["200 aé b", "200 end"]),
    ("5.1", "GET /hello/a HTTP/1.1\r\nHost : x\r\n\r\nEND", &["400"]),
    ("5.1", "GET /hello/a HTTP/1.1\r\nHost: x\r\nX Y: z\r\n\r\nEND", &["400"]),
    ("5.1", "GET /hello/a HTTP/1.1\r\nHost: x\r\nno colon\r\n\r\nEND", &["400"]),
    ("5.1", "GET /hello/a HTTP/1.1\r\nHost: x\r\n: nameless\r\n\r\nEND", &["400"]),
    ("5.1", "POST /echo HTTP/1.1\r\nHost: x\r\nContent-Length : 2\r\n\r\nabEND", &["400"]),
    ("5.2", "GET /header/x HTTP/1.1\r\nHost: x\r\nx: a\r\n b\r\n\r\nEND", &["400"]),
    ("S5.5", "GET /hello/a HTTP/1.1\r\nHost: x\r\nX: a\0b\r\n\r\nEND", &["400"]),
    // ---- bodies
    ("6.3", "POST /echo HTTP/1.1\r\nHost: x\r\nContent-Length: 2\r\n\r\nabEND", &["200 ab", "200 end"]),
    ("6.3", "POST /echo HTTP/1.1\r\nHost: x\r\n\r\nEND", &["200", "200 end"]),
    ("6.3", "POST /echo HTTP/1.1\r\nHost: x\r\nContent-Length: 9\r\n\r\nshort", &["400"]),
    ("6.3", "POST /echo HTTP/1.1\r\nHost: x\r\nContent-Length: 2\r\nContent-Length: 3\r\n\r\nabcEND", &["400"]),
    ("6.3", "POST /echo HTTP/1.1\r\nHost: x\r\nContent-Length: 2, 3\r\n\r\nabcEND", &["400"]),
    ("6.3", "POST /echo HTTP/1.1\r\nHost: x\r\nContent-Length: 2\r\nContent-Length: 2\r\n\r\nabEND", &["200 ab", "200 end"]),
    ("S8.6", "POST /echo HTTP/1.1\r\nHost: x\r\nContent-Length: -2\r\n\r\nabEND", &["400"]),
    ("S8.6", "POST /echo HTTP/1.1\r\nHost: x\r\nContent-Length: +2\r\n\r\nabEND", &["400"]),
    ("S8.6", "POST /echo HTTP/1.1\r\nHost: x\r\nContent-Length: 0x2\r\n\r\nabEND", &["400"]),
    ("S8.6", "POST /echo HTTP/1.1\r\nHost: x\r\nContent-Length:\r\n\r\nabEND", &["400"]),
    ("S8.6", "POST /echo HTTP/1.1\r\nHost: x\r\nContent-Length: 99999999999999999999999\r\n\r\nabEND", &["400"]),
    ("S15.5.14", "POST /echo HTTP/1.1\r\nHost: x\r\nContent-Length: 99999999\r\n\r\nabEND", &["413"]),
    ("6.1", "POST /echo HTTP/1.1\r\nHost: x\r\nContent-Length: 1\r\nTransfer-Encoding: chunked\r\n\r\n2\r\nab\r\n0\r\n\r\nEND", &["200 ab"]),
    ("6.1", "POST /echo HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: gzip\r\n\r\nEND", &["400"]),
    ("6.1", "POST /echo HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked, gzip\r\n\r\nEND", &["400"]),
    ("6.1", "POST /echo HTTP/1.0\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\nEND", &["400"]),
    // ---- chunks
    ("7.1", "POST /echo HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n2\r\nab\r\nA\r\n0123456789\r\n0\r\n\r\nEND", &["200 ab0123456789", "200 end"]),
    ("7.1.1", "POST /echo HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n2;a=b;c=\"d\"\r\nab\r\n0\r\n\r\nEND", &["200 ab", "200 end"]),
    ("7.1.2", "POST /echo HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n2\r\nab\r\n0\r\nX: y\r\n\r\nEND", &["200 ab", "200 end"]),
    ("7.1", "POST /echo HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\nxy\r\nab\r\n0\r\n\r\nEND", &["400"]),
    ("7.1", "POST /echo HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n-2\r\nab\r\n0\r\n\r\nEND", &["400"]),
    ("7.1", "POST /echo HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n2\r\nabcd\r\n0\r\n\r\nEND", &["400"]),
    ("7.1", "POST /echo HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\nFFFFFFFFFFFFFFFFF\r\nab\r\n0\r\n\r\nEND", &["400"]),
    ("7.1", "POST /echo HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n5\r\nab", &["400"]),
    ("7.1", "POST /echo HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n2\r\nab\r\n", &["400"]),
    // ---- connections
    ("9.3", "GET /hello/a HTTP/1.1\r\nHost: x\r\n\r\nEND", &["200 hello a", "200 end"]),
    ("9.3", "GET /hello/a HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\nEND", &["200 hello a"]),
    ("9.3", "GET /hello/a HTTP/1.0\r\nHost: x\r\n\r\nEND", &["200 in 1.0 hello a"]),
    ("9.3", "GET /hello/a HTTP/1.0\r\nHost: x\r\nConnection: keep-alive\r\n\r\nEND", &["200 in 1.0 hello a", "200 end"]),
    ("9.3.2", "POST /echo HTTP/1.1\r\nHost: x\r\nContent-Length: 1\r\n\r\naGET /fail HTTP/1.1\r\nHost: x\r\n\r\nGET /hello/b HTTP/1.1\r\nHost: x\r\n\r\nEND", &["200 a", "500", "200 hello b", "200 end"]),
    ("9.8", "", &[]),
    ("9.8", "GET /hello", &[]),
    // ---- methods and statuses
    ("S9.3.2", "HEAD /hello/a HTTP/1.1\r\nHost: x\r\n\r\nEND", &["200 of 7", "200 end"]),
    ("S9.3.2", "HEAD /headed HTTP/1.1\r\nHost: x\r\n\r\nEND", &["200 of 4", "200 end"]),
    ("S9.3.2", "HEAD /nothing HTTP/1.1\r\nHost: x\r\n\r\nEND", &["404 of 9", "200 end"]),
    ("S15.5.5", "GET /nothing HTTP/1.1\r\nHost: x\r\n\r\nEND", &["404", "200 end"]),
    ("S15.5.6", "POST /hello/a HTTP/1.1\r\nHost: x\r\nContent-Length: 0\r\n\r\nEND", &["405 allows GET, HEAD", "200 end"]),
    ("S15.5.6", "PATCH /thing HTTP/1.1\r\nHost: x\r\n\r\nEND", &["405 allows PUT, DELETE", "200 end"]),
    ("S15.3.5", "GET /none HTTP/1.1\r\nHost: x\r\n\r\nEND", &["204", "200 end"]),
    ("S15.4.5", "GET /same HTTP/1.1\r\nHost: x\r\n\r\nEND", &["304", "200 end"]),
    ("S15.3.6", "GET /status?of=205 HTTP/1.1\r\nHost: x\r\n\r\nEND", &["205", "200 end"]),
    ("S15", "GET /status?of=299 HTTP/1.1\r\nHost: x\r\n\r\nEND", &["299 it", "200 end"]),
    ("S15", "GET /status?of=100 HTTP/1.1\r\nHost: x\r\n\r\nEND", &["500", "200 end"]),
    ("S15", "GET /status?of=70000 HTTP/1.1\r\nHost: x\r\n\r\nEND", &["500", "200 end"]),
    ("S15.6.1", "GET /fail HTTP/1.1\r\nHost: x\r\n\r\nGET /wrong HTTP/1.1\r\nHost: x\r\n\r\nGET /no-body HTTP/1.1\r\nHost: x\r\n\r\nGET /no-byte HTTP/1.1\r\nHost: x\r\n\r\nGET /split HTTP/1.1\r\nHost: x\r\n\r\nEND", &["500", "500", "500", "500", "500", "200 end"]),
    ("S8.6", "GET /empty HTTP/1.1\r\nHost: x\r\n\r\nEND", &["200", "200 end"]),
    ("S10.1.1", "POST /echo HTTP/1.1\r\nHost: x\r\nExpect: 100-continue\r\nContent-Length: 2\r\n\r\nabEND", &["100", "200 ab", "200 end"]),
    ("S10.1.1", "POST /echo HTTP/1.1\r\nHost: x\r\nExpect: 100-Continue\r\nContent-Length: 99999999\r\n\r\n", &["413"]),
    ("S10.1.1", "POST /echo HTTP/1.1\r\nHost: x\r\nExpect: wonders\r\nContent-Length: 2\r\n\r\nabEND", &["417"]),
    ("S7.8", "GET /hello/a HTTP/1.1\r\nHost: x\r\nConnection: Upgrade\r\nUpgrade: h2c\r\n\r\nEND", &["200 hello a", "200 end"]),
];

#[test]
fn requests_are_answered_as_the_standard_says() {
    let served = Served::begin("http-requests", "", ROUTES);
    let mut wrong = Vec::new();
    for (section, request, expected) in REQUESTS {
        let found = answers(&served.ask(request.replace("END", END).as_bytes()));
        if found != *expected {
            wrong.push(format!("{section}: {request:?}\n  expected {expected:?}\n  found    {found:?}"));
        }
    }
    let done = served.end();
    assert!(wrong.is_empty(), "{}\n{}", wrong.join("\n"), done.errors);
    assert_eq!(done.status, Some(0), "{}", done.errors);
    for failed in ["GET /fail: A failure of cause :BROKEN.", "GET /split: ", "GET /status: "] {
        assert!(done.errors.contains(failed), "{failed}: {}", done.errors);
    }
}

#[test]
fn heads_and_bodies_have_limits() {
    let served = Served::begin("http-limits", "", ROUTES);
    let ask = |request: String| answers(&served.ask(request.as_bytes()));
    let head = |more: &str| format!("GET /hello/a HTTP/1.1\r\nHost: x\r\n{more}\r\n");
    let long = |size: usize| "x".repeat(size);
    assert_eq!(ask(head(&format!("X: {}\r\nConnection: close\r\n", long(60_000)))), ["200 hello a"]);
    assert_eq!(ask(head(&format!("X: {}\r\n", long(70_000)))), ["431"]);
    assert_eq!(ask(head(&format!("X: {}\r\n", long(5_000_000)))), ["431"]);
    assert_eq!(ask(format!("GET /{} HTTP/1.1\r\nHost: x\r\n\r\n", long(70_000))), ["431"]);
    assert_eq!(ask(long(200_000)), ["431"]);
    assert_eq!(ask(head(&"X: y\r\n".repeat(250))), ["200 hello a"]);
    assert_eq!(ask(head(&"X: y\r\n".repeat(300))), ["431"]);
    // Its chunks do not say how long it is.
    let chunk = format!("100000\r\n{}\r\n", long(0x10_0000));
    let begin = "POST /echo HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n";
    assert_eq!(ask(format!("{begin}{}0\r\n\r\n", chunk.repeat(66))), ["413"]);
    assert_eq!(ask(END.into()), ["200 end"], "it goes on");
    assert_eq!(served.end().status, Some(0));
}

/// A body is there as bytes, whatever they are, and as a text.
#[test]
fn bodies_are_bytes_and_texts() {
    let routes = r#"
    (:post "/bytes" () (http:request-bytes http:*request*))
    (:post "/text" () (let ((text (http:request-body http:*request*))) (format nil "~d ~a" (length text) text)))"#;
    let served = Served::begin("http-bodies", "", routes);
    let post = |path: &str, body: &[u8]| {
        let head = format!(
            "POST {path} HTTP/1.1\r\nHost: x\r\nConnection: close\r\nContent-Length: {}\r\n\r\n",
            body.len()
        );
        let answer = served.ask(&[head.as_bytes(), body].concat());
        let end = answer.windows(4).position(|bytes| bytes == b"\r\n\r\n").expect("it has a head");
        answer[end + 4..].to_vec()
    };
    let all: Vec<u8> = (0..=255).collect();
    // Characters of each length lie across the ends of pieces.
    let long = format!("x{}", "é€😀".repeat(20_000));
    let cut = [long.as_bytes(), b"\xff", long.as_bytes()].concat();
    for body in [&b""[..], b"text", &all, long.as_bytes(), &cut, &[0x80; 40_000]] {
        assert!(post("/bytes", body) == body, "{} bytes", body.len());
        let text = String::from_utf8_lossy(body);
        let expected = format!("{} {text}", text.chars().count());
        assert!(post("/text", body) == expected.as_bytes(), "{} bytes", body.len());
    }
    assert_eq!(served.end().status, Some(0));
}

/// The connections of one address leave room for those of others.
#[cfg(target_os = "linux")]
#[test]
fn an_address_has_a_limit_of_connections() {
    let served = Served::begin_with("http-addresses", ":per-address 3", "", ROUTES);
    let ask = |from: [u8; 4]| {
        let socket = socket2::Socket::new(socket2::Domain::IPV4, socket2::Type::STREAM, None);
        let socket = socket.expect("there are sockets");
        socket.bind(&std::net::SocketAddr::from((from, 0)).into()).expect("all of 127/8 is here");
        socket
            .connect(&std::net::SocketAddr::from(([127, 0, 0, 1], served.port)).into())
            .expect("it listens");
        let mut stream = TcpStream::from(socket);
        stream.set_read_timeout(Some(Duration::from_secs(60))).expect("it can be set");
        let sent = stream.write_all(b"GET /end HTTP/1.1\r\nHost: x\r\n\r\n");
        let mut answer = [0; 12];
        let status = sent.and_then(|()| stream.read_exact(&mut answer));
        (status.is_ok_and(|()| answer.ends_with(b"200")), stream)
    };
    let mut open: Vec<(bool, TcpStream)> = (0..3).map(|_| ask([127, 0, 0, 1])).collect();
    assert!(open.iter().all(|(is_answered, _)| *is_answered), "there is room for three");
    assert!(!ask([127, 0, 0, 1]).0, "the fourth is closed");
    let other = ask([127, 0, 0, 2]);
    assert!(other.0, "another address has room of its own");
    // The place is free again when the server has noticed that the client has gone.
    drop(open.pop());
    crate::operate::until("a place", || ask([127, 0, 0, 1]).0);
    drop((open, other));
    assert_eq!(served.end().status, Some(0));
}

/// The task of a request whose client has gone is aborted; a client that has said all may wait for its
/// answer.
#[test]
fn a_request_ends_with_its_client() {
    let routes = r#"
    (:get "/wait" () (unwind-protect (progn (say "begun") (sleep 600) "late") (say "ended")))
    (:get "/soon" () (sleep 0.5) "soon")
    (:get "/end" () "end")"#;
    let mut served =
        Served::begin("http-gone", "(defun say (text) (format t \"~a~%\" text) (finish-output))", routes);
    let request = b"GET /wait HTTP/1.1\r\nHost: x\r\n\r\n";
    let mut client = served.connect();
    client.write_all(request).expect("it can be sent");
    assert_eq!(served.next_line(), "begun");
    let begun = Instant::now();
    drop(client);
    assert_eq!(served.next_line(), "ended");
    assert!(begun.elapsed() < Duration::from_secs(60), "{:?}", begun.elapsed());
    let soon = answers(&served.ask(b"GET /soon HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n"));
    assert_eq!(soon, ["200 soon"]);
    // Half a body, and no more.
    let mut client = served.connect();
    client
        .write_all(b"POST /end HTTP/1.1\r\nHost: x\r\nContent-Length: 9\r\n\r\nhalf")
        .expect("it can be sent");
    drop(client);
    assert_eq!(answers(&served.ask(END.as_bytes())), ["200 end"]);
    // The end of the server is that of the requests under way.
    let mut client = served.connect();
    client.write_all(request).expect("it can be sent");
    assert_eq!(served.next_line(), "begun");
    let silent = served.connect();
    let done = served.end();
    assert_eq!(done.status, Some(0), "{}", done.errors);
    let mut rest = String::new();
    client.read_to_string(&mut rest).expect("it is closed");
    assert!(rest.is_empty() || rest.starts_with("HTTP/1.1 503 "), "{rest}");
    drop(silent);
}

/// An answer that was given is sent, though the server ends at once.
#[test]
fn the_last_answer_is_sent() {
    let folder = Folder::new("http-last");
    let text = "(require :http)
(defvar *answer* nil)
(handler-case
    (with-timeout 2
      (http:with-server (0 :started (lambda (port)
                                      (spawn (:name 'client)
                                        (setq *answer* (http:get (format nil \"http://127.0.0.1:~d/\" port))))))
        (:get \"/\" () \"under a limit\")))
  (failure (f) (print (list (failure-cause f) *answer*))))
;; Its port is free again, and another may have it.
(defvar *port* nil)
(dotimes (round 2)
  (handler-case
      (with-timeout 0.5
        (http:with-server ((or *port* 0) :started (lambda (port) (setq *port* port)))
          (:get \"/\" () \"x\")))
    (failure (f) (print (failure-cause f)))))
(print (handler-case (http:get (format nil \"http://127.0.0.1:~d/\" *port*)) (failure (f) (failure-cause f))))
(http:with-server (0 :started (lambda (port)
                                (spawn (:name 'client)
                                  (print (http:post (format nil \"http://127.0.0.1:~d/\" port)))
                                  (finish-output))))
  (:post \"/\" () (spawn (:name 'ender) (sleep 0.2) (exit 3)) \"dying\"))";
    folder.file("main.esl", text);
    let done =
        process::run(eslvm(&["run", "--allow-net=127.0.0.1", "main.esl"]).current_dir(folder.path()), "");
    let lines: Vec<&str> = done.output.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    let expected =
        ["(:TIMEOUT \"under a limit\")", ":TIMEOUT", ":TIMEOUT", ":CONNECTION-REFUSED", "\"dying\""];
    assert_eq!(lines, expected, "{}", done.errors);
    assert_eq!(done.status, Some(3));
}

/// Many clients that say nothing take no place from others, and are let go after a while.
#[test]
fn silent_clients_delay_nobody() {
    let served = Served::begin("http-silent", "", ROUTES);
    let mut silent: Vec<TcpStream> = (0..200).map(|_| served.connect()).collect();
    for (index, stream) in silent.iter_mut().enumerate() {
        stream.write_all(&b"GET /hello/a HT"[..index % 16]).expect("it can be sent");
    }
    for _ in 0..20 {
        assert_eq!(answers(&served.ask(END.as_bytes())), ["200 end"]);
    }
    for stream in &mut silent {
        stream.set_read_timeout(Some(Duration::from_secs(60))).expect("it can be set");
        assert_eq!(stream.read(&mut [0; 9]).ok(), Some(0), "it is closed without an answer");
    }
    assert_eq!(answers(&served.ask(END.as_bytes())), ["200 end"]);
    assert_eq!(served.end().status, Some(0));
}
