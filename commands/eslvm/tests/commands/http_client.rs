//! The client of the module `:http`, and what servers may answer.

use std::collections::HashMap;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::{Arc, Mutex};

use esl_conformance::folder::Folder;
use esl_conformance::process;

use crate::eslvm;

/// The action of a server after an answer.
#[derive(Clone, Copy, PartialEq)]
enum Then {
    /// It closes the connection.
    Close,
    /// It waits for the client to do that.
    Stay,
}
use Then::{Close, Stay};

/// The requests that a server was sent, each with its body, by their targets.
type Requests = Arc<Mutex<HashMap<String, String>>>;

/// Begins a server that gives `answer` of a target, until the process ends. Returns its port, and the
/// requests.
fn begin(answer: impl Fn(&str) -> (Vec<u8>, Then) + Send + 'static) -> (u16, Requests) {
    let listener = TcpListener::bind("127.0.0.1:0").expect("there is a port");
    let port = listener.local_addr().expect("it has an address").port();
    let requests = Requests::default();
    let seen = requests.clone();
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            // A client may leave at any time.
            let Ok(stream) = stream else { return };
            let Some((target, request)) = read_request(&stream, true) else { continue };
            seen.lock().expect("no test has failed").insert(target.clone(), request);
            let (answer, then) = answer(&target);
            let mut stream = stream;
            drop(stream.write_all(&answer));
            if then == Close {
                drop(stream.shutdown(Shutdown::Write));
            }
            drop(stream.read_to_end(&mut Vec::new()));
        }
    });
    (port, requests)
}

/// Returns the target of a request, and all of the request, or its head.
fn read_request(stream: &TcpStream, is_whole: bool) -> Option<(String, String)> {
    let mut reader = BufReader::new(stream);
    let mut request = String::new();
    while !request.ends_with("\r\n\r\n") {
        if reader.read_line(&mut request).ok()? == 0 {
            return None;
        }
    }
    let lower = request.to_lowercase();
    if !is_whole {
        return Some((String::new(), request));
    }
    if let Some((_, length)) = lower.split_once("content-length: ") {
        let mut body = vec![0; length.lines().next()?.parse().ok()?];
        reader.read_exact(&mut body).ok()?;
        request += &String::from_utf8_lossy(&body);
    } else if lower.contains("transfer-encoding: chunked") {
        while !request.ends_with("\r\n0\r\n\r\n") {
            reader.read_line(&mut request).ok()?;
        }
    }
    Some((request.split(' ').nth(1)?.to_owned(), request))
}

/// Runs a program, with the port of a server for its argument. Returns the lines that it prints.
fn run(name: &str, port: u16, text: &str) -> Vec<String> {
    let folder = Folder::with(name, &[("main.esl", &format!("{DEFINITIONS}{text}"))]);
    let mut command = eslvm(&["run", "--allow-net=127.0.0.1,localhost", "main.esl", &port.to_string()]);
    let done = process::run(command.current_dir(folder.path()), "");
    assert!(done.errors.is_empty(), "{}\n{}", done.output, done.errors);
    done.output.lines().map(str::to_owned).collect()
}

const DEFINITIONS: &str = r#"(require :http)
(defvar *port* (parse-integer (first (command-line-arguments))))
(defun url (path) (format nil "http://127.0.0.1:~d~a" *port* path))
;; Prints what FUNCTION comes to on a line.
(defun say (function)
  (format t "~a~%"
          (handler-case (multiple-value-bind (body status) (funcall function)
                          (format nil "~d ~a" status (substitute #\/ #\Newline (princ-to-string body))))
            (failure (f) (format nil "~a ~a" (failure-cause f) (car (failure-arguments f))))
            (error (e) (substitute #\Space #\Newline (format nil "~a: ~a" (type-of e) e))))))
(defmacro try (form) `(say (lambda () ,form)))
"#;

/// The section of RFC 9112, or of RFC 9110 where it begins with `S`; an answer, and what happens after it;
/// the body and the status, or the failure.
#[rustfmt::skip]
const ANSWERS: &[(&str, &str, Then, &str)] = &[
    // ---- the line of the status
    ("4", "HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\nab", Stay, "200 ab"),
    ("4", "HTTP/1.1 200 \r\nContent-Length: 2\r\n\r\nab", Stay, "200 ab"),
    ("4", "HTTP/1.1 200\r\nContent-Length: 2\r\n\r\nab", Stay, "200 ab"),
    ("4", "HTTP/1.1 299 Own Words\r\nContent-Length: 2\r\n\r\nab", Stay, "299 ab"),
    ("4", "HTTP/1.1 20 OK\r\n\r\n", Close, "HTTP-ERROR the answer is not HTTP: "),
    ("4", "HTTP/1.1 2x0 OK\r\n\r\n", Close, "HTTP-ERROR the answer is not HTTP: "),
    ("4", "HTTP/2.0 200 OK\r\n\r\n", Close, "HTTP-ERROR the answer is not HTTP: "),
    ("4", "SSH-2.0-OpenSSH\r\n\r\n", Close, "HTTP-ERROR the answer is not HTTP: "),
    ("4", "<html>no head</html>", Close, "HTTP-ERROR the answer is not HTTP: "),
    ("4", "", Close, "HTTP-ERROR the connection has ended before the answer"),
    ("4", "HTTP/1.1 20", Close, "HTTP-ERROR the connection has ended before the answer"),
    ("2.2", "HTTP/1.0 404 Not Found\n\nto the end", Close, "404 to the end"),
    ("2.3", "HTTP/1.0 200 OK\r\n\r\nto the end", Close, "200 to the end"),
    ("S15.2", "HTTP/1.1 100 Continue\r\n\r\nHTTP/1.1 103 Early Hints\r\nLink: a\r\n\r\nHTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\nab", Stay, "200 ab"),
    ("S15.2.2", "HTTP/1.1 101 Switching Protocols\r\nUpgrade: x\r\nConnection: upgrade\r\n\r\n", Close, "HTTP-ERROR the server switches to another protocol"),
    // ---- headers
    ("5.1", "HTTP/1.1 200 OK\r\nContent-Length : 2\r\n\r\nab", Close, "HTTP-ERROR the answer is not HTTP: "),
    ("5.1", "HTTP/1.1 200 OK\r\nno colon\r\n\r\nab", Close, "HTTP-ERROR the answer is not HTTP: "),
    ("5.2", "HTTP/1.1 200 OK\r\nX: a\r\n  b\r\nContent-Length: 2\r\n\r\nab", Stay, "200 ab"),
    ("5", "HTTP/1.1 200 OK\r\nX: a\0b\r\n\r\nab", Close, "HTTP-ERROR the answer is not HTTP: "),
    ("5", "HTTP/1.1 200 OK\r\nX: endless ENDLESS", Close, "HTTP-ERROR the head of the answer has more than 65536 bytes or 256 headers"),
    // ---- the length of the body
    ("6.3", "HTTP/1.1 204 No Content\r\nContent-Length: 5\r\n\r\n", Stay, "204 "),
    ("6.3", "HTTP/1.1 304 Not Modified\r\nContent-Length: 5\r\n\r\n", Stay, "304 "),
    ("6.3", "HTTP/1.1 200 OK\r\n\r\nto the end", Close, "200 to the end"),
    ("6.3", "HTTP/1.1 200 OK\r\nContent-Length: 50\r\n\r\nshort", Close, "HTTP-ERROR the connection has ended within the body: "),
    ("6.3", "HTTP/1.1 200 OK\r\nContent-Length: 3\r\nContent-Length: 5\r\n\r\nabcde", Close, "HTTP-ERROR the answer is not HTTP: "),
    ("6.3", "HTTP/1.1 200 OK\r\nContent-Length: 3, 5\r\n\r\nabcde", Close, "HTTP-ERROR the answer is not HTTP: "),
    ("6.3", "HTTP/1.1 200 OK\r\nContent-Length: 3\r\nContent-Length: 3\r\n\r\nabc", Stay, "200 abc"),
    ("S8.6", "HTTP/1.1 200 OK\r\nContent-Length: -3\r\n\r\nabc", Close, "HTTP-ERROR the answer is not HTTP: "),
    ("S8.6", "HTTP/1.1 200 OK\r\nContent-Length: three\r\n\r\nabc", Close, "HTTP-ERROR the answer is not HTTP: "),
    ("S8.6", "HTTP/1.1 200 OK\r\nContent-Length: 99999999999999999999\r\n\r\nabc", Close, "HTTP-ERROR the answer is not HTTP: "),
    ("6.3", "HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\nab, and more", Stay, "200 ab"),
    ("6.1", "HTTP/1.1 200 OK\r\nContent-Length: 9\r\nTransfer-Encoding: chunked\r\n\r\n1\r\na\r\n0\r\n\r\n", Stay, "200 a"),
    ("6.1", "HTTP/1.0 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n1\r\na\r\n0\r\n\r\n", Close, "HTTP-ERROR the answer is not HTTP: "),
    // ---- chunks
    ("7.1", "HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n4;x=1\r\nabä\r\n1\r\n!\r\n0\r\nA: b\r\n\r\n", Stay, "200 abä!"),
    ("7.1", "HTTP/1.1 200 OK\r\nTransfer-Encoding: CHUNKED\r\n\r\n1\r\na\r\n0\r\n\r\n", Stay, "200 a"),
    ("7.1", "HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\nx\r\na\r\n0\r\n\r\n", Close, "HTTP-ERROR the body is invalid: "),
    ("7.1", "HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n1\r\nabc\r\n0\r\n\r\n", Close, "HTTP-ERROR the body is invalid: "),
    ("7.1", "HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\nFFFFFFFFFFFFFFFFFF\r\na\r\n0\r\n\r\n", Close, "HTTP-ERROR the body is invalid: "),
    ("7.1", "HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n5\r\nab", Close, "HTTP-ERROR the connection has ended within the body: "),
    ("7.1", "HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n2\r\nab\r\n", Close, "HTTP-ERROR the connection has ended within the body: "),
    ("7.1.1", "HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n1;ENDLESS", Close, "HTTP-ERROR the body is invalid: "),
    // ---- content codings
    ("S8.4", "HTTP/1.1 200 OK\r\nContent-Encoding: identity\r\nContent-Length: 2\r\n\r\nab", Stay, "200 ab"),
    ("S8.4", "HTTP/1.1 200 OK\r\nContent-Encoding: br\r\nContent-Length: 2\r\n\r\nab", Stay, "HTTP-ERROR the body has the content coding `br`, which is unknown"),
    ("S8.4", "HTTP/1.1 200 OK\r\nContent-Encoding: gzip, gzip\r\nContent-Length: 2\r\n\r\nab", Stay, "HTTP-ERROR the body has the content coding `gzip, gzip`, which is unknown"),
    ("S8.4.1", "HTTP/1.1 200 OK\r\nContent-Encoding: gzip\r\nContent-Length: 12\r\n\r\nnothing gzip", Stay, "HTTP-ERROR the body cannot be decoded: "),
    ("S8.4", "HTTP/1.1 200 OK\r\nContent-Encoding: gzip\r\nContent-Length: 0\r\n\r\n", Stay, "200 "),
];

#[test]
fn answers_are_understood_or_refused() {
    let (port, _) = begin(|target| {
        let index: usize = target[1..].parse().expect("it is a number");
        let (_, answer, then, _) = ANSWERS[index];
        (answer.replace("ENDLESS", &"x".repeat(200_000)).into_bytes(), then)
    });
    let text = format!(
        "(dotimes (row {}) (try (http:get (url (format nil \"/~d\" row)) :timeout 60)))",
        ANSWERS.len()
    );
    let found = run("http-answers", port, &text);
    let mut wrong = Vec::new();
    for ((section, answer, _, expected), found) in ANSWERS.iter().zip(&found) {
        let is_right = if expected.ends_with(": ") { found.starts_with(expected) } else { found == expected };
        if !is_right {
            wrong.push(format!("{section}: {answer:?}\n  expected {expected}\n  found    {found}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert_eq!(found.len(), ANSWERS.len());
}

/// Bodies that the server compresses, made by Python's `gzip` and `zlib` of 20 times `hällo `.
#[test]
fn compressed_bodies_are_decoded() {
    use std::fmt::Write;
    let text = "hällo ".repeat(20);
    // A stored block of deflate: no compression, but its form.
    let length = u16::try_from(text.len()).expect("it is short");
    let mut stored = vec![1];
    stored.extend(length.to_le_bytes());
    stored.extend((!length).to_le_bytes());
    stored.extend(text.as_bytes());
    let (mut a, mut b) = (1_u32, 0_u32);
    for byte in text.bytes() {
        a = (a + u32::from(byte)) % 65521;
        b = (b + a) % 65521;
    }
    let zlib = [&[0x78, 0x01][..], &stored, &(b << 16 | a).to_be_bytes()].concat();
    let mut check = !0_u32;
    for byte in text.bytes() {
        check ^= u32::from(byte);
        for _ in 0..8 {
            check = if check & 1 == 1 { check >> 1 ^ 0xEDB8_8320 } else { check >> 1 };
        }
    }
    let gzip = [
        &[0x1F, 0x8B, 8, 0, 0, 0, 0, 0, 0, 0xFF][..],
        &stored,
        &(!check).to_le_bytes(),
        &u32::from(length).to_le_bytes(),
    ]
    .concat();
    let (port, requests) = begin(move |target| {
        let (name, body) = match target {
            "/gzip" | "/raw" => ("gzip", &gzip[..]),
            "/zlib" => ("deflate", &zlib[..]),
            "/bare" => ("deflate", &stored[..]),
            "/cut" => ("gzip", &gzip[..gzip.len() - 1]),
            _ => ("deflate", &zlib[..zlib.len() - 9]),
        };
        let mut head = String::new();
        write!(head, "HTTP/1.1 200 OK\r\nContent-Encoding: {name}\r\nContent-Length: {}\r\n\r\n", body.len())
            .expect("there is room");
        ([head.as_bytes(), body].concat(), Stay)
    });
    let found = run(
        "http-coded",
        port,
        r#"(dolist (path '("/gzip" "/zlib" "/bare"))
  (try (let ((headers nil) (body nil) (status nil))
         (multiple-value-setq (body status headers) (http:get (url path)))
         (values (list (length body) (subseq body 0 5) (http:header "content-encoding" headers)
                       (http:header "content-length" headers))
                 status))))
(try (http:get (url "/cut")))
(try (http:get (url "/cut-zlib")))
(try (multiple-value-bind (body status headers)
         (http:get (url "/raw") :bytes t :headers '(("Accept-Encoding" . "gzip")))
       (values (list (aref body 0) (aref body 1) (http:header "content-encoding" headers)) status)))
(try (let ((count 0)) (http:get (url "/gzip") :bytes t :each (lambda (part) (incf count (length part)))) (values count 200)))"#,
    );
    let cut = "HTTP-ERROR the body cannot be decoded: ";
    assert_eq!(found[..3], ["200 (120 hällo NIL NIL)"; 3]);
    assert!(found[3].starts_with(cut) && found[4].starts_with(cut), "{found:?}");
    assert_eq!(found[5..], ["200 (31 139 gzip)", "200 140"]);
    let requests = requests.lock().expect("no test has failed");
    assert!(requests["/zlib"].contains("\r\nAccept-Encoding: gzip, deflate\r\n"), "{requests:?}");
    assert!(requests["/raw"].contains("\r\nAccept-Encoding: gzip\r\n"), "{requests:?}");
}

/// A form of the program, and the request that is sent for it, up to the headers that all requests have.
#[rustfmt::skip]
const SENT: &[(&str, &str, &str)] = &[
    (r#"(http:get (url "/a?b=c#d"))"#, "/a?b=c", "GET /a?b=c HTTP/1.1\r\nHost: 127.0.0.1:PORT\r\nAccept-Encoding: gzip, deflate\r\nConnection: close\r\n\r\n"),
    (r#"(http:get (url ""))"#, "/", "GET / HTTP/1.1\r\nHost: 127.0.0.1:PORT\r\n"),
    (r#"(http:get (url "/ü x?ü=€"))"#, "/%C3%BC%20x?%C3%BC=%E2%82%AC", "GET /%C3%BC%20x?%C3%BC=%E2%82%AC HTTP/1.1\r\n"),
    (r#"(http:get (url "/a/../b/%41%2f"))"#, "/b/%41%2f", "GET /b/%41%2f HTTP/1.1\r\n"),
    (r#"(http:get (format nil "http://me:p%40w@127.0.0.1:~d/basic" *port*))"#, "/basic", "GET /basic HTTP/1.1\r\nHost: 127.0.0.1:PORT\r\nAccept-Encoding: gzip, deflate\r\nConnection: close\r\nAuthorization: Basic bWU6cEB3\r\n\r\n"),
    (r#"(http:get (url "/own") :headers '(("Host" . "other") ("X-A" . "1") ("X-A" . "ä") ("Connection" . "keep-alive")))"#, "/own", "GET /own HTTP/1.1\r\nAccept-Encoding: gzip, deflate\r\nHost: other\r\nX-A: 1\r\nX-A: ä\r\nConnection: keep-alive\r\n\r\n"),
    (r#"(http:post (url "/post") :body "hä")"#, "/post", "POST /post HTTP/1.1\r\nHost: 127.0.0.1:PORT\r\nAccept-Encoding: gzip, deflate\r\nConnection: close\r\nContent-Length: 3\r\n\r\nhä"),
    (r#"(http:post (url "/none"))"#, "/none", "POST /none HTTP/1.1\r\nHost: 127.0.0.1:PORT\r\nAccept-Encoding: gzip, deflate\r\nConnection: close\r\nContent-Length: 0\r\n\r\n"),
    (r#"(http:put (url "/bytes") :body #(104 105) :headers '(("Content-Length" . "2")))"#, "/bytes", "PUT /bytes HTTP/1.1\r\nHost: 127.0.0.1:PORT\r\nAccept-Encoding: gzip, deflate\r\nConnection: close\r\nContent-Length: 2\r\n\r\nhi"),
    (r#"(http:post (url "/parts") :body (make-string-input-stream "hello"))"#, "/parts", "POST /parts HTTP/1.1\r\nHost: 127.0.0.1:PORT\r\nAccept-Encoding: gzip, deflate\r\nConnection: close\r\nTransfer-Encoding: chunked\r\n\r\n5\r\nhello\r\n0\r\n\r\n"),
    (r#"(http:request :propfind (url "/method") :headers '(("X" . 5)))"#, "/method", "PROPFIND /method HTTP/1.1\r\nHost: 127.0.0.1:PORT\r\nAccept-Encoding: gzip, deflate\r\nConnection: close\r\nX: 5\r\n\r\n"),
];

/// A form of the program, and its failure before anything is sent.
#[rustfmt::skip]
const REFUSED: &[(&str, &str)] = &[
    (r#"(http:get (url (format nil "/a~c~cX: y" #\Return #\Newline)))"#, "HTTP-ERROR the URL `http://127.0.0.1:PORT/a\\r\\nX: y` contains a control character"),
    (r#"(http:get (url "/") :headers (list (cons "X" (format nil "a~cY: b" #\Newline))))"#, "HTTP-ERROR the value of the header `X` contains a line end"),
    (r#"(http:get (url "/") :headers (list (cons (format nil "X~cY" #\Newline) "a")))"#, "HTTP-ERROR `X\\nY` is not a name of a header"),
    (r#"(http:get (url "/") :headers '(("X Y" . "a")))"#, "HTTP-ERROR `X Y` is not a name of a header"),
    (r#"(http:request '|G T| (url "/"))"#, "HTTP-ERROR `G T` is not a method"),
    (r#"(http:post (url "/") :body "abc" :headers '(("content-length" . "2")))"#, "HTTP-ERROR the headers contradict the body; leave out Content-Length and Transfer-Encoding"),
    (r#"(http:post (url "/") :body "abc" :headers '(("Transfer-Encoding" . "chunked")))"#, "HTTP-ERROR the headers contradict the body; leave out Content-Length and Transfer-Encoding"),
    (r#"(http:get "http://me@/")"#, "HTTP-ERROR the URL `http://me@/` is invalid: empty host"),
    (r#"(http:get "127.0.0.1/")"#, "HTTP-ERROR the URL `127.0.0.1/` begins neither with http:// nor with https://"),
    (r#"(http:get "file:///etc/passwd")"#, "HTTP-ERROR the URL `file:///etc/passwd` begins neither with http:// nor with https://"),
    (r#"(http:get "http://other.example/")"#, "PERMISSION-DENIED NET"),
    (r#"(http:post (url "/") :body #(1 300))"#, "TYPE-ERROR: "),
    (r#"(http:post (url "/") :body #(-1))"#, "TYPE-ERROR: "),
    (r#"(http:post (url "/") :body #("a"))"#, "TYPE-ERROR: "),
    (r#"(http:post (url "/") :body 5)"#, "TYPE-ERROR: "),
];

#[test]
fn requests_are_sent_as_asked_or_not_at_all() {
    let (port, requests) = begin(|_| (b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\nok".to_vec(), Stay));
    let here = |text: &str| text.replace("PORT", &port.to_string());
    let asked = SENT.iter().map(|row| row.0).chain(REFUSED.iter().map(|row| row.0));
    let text: String = asked.map(|form| format!("(try {form})\n")).collect();
    let found = run("http-sent", port, &text);
    assert_eq!(found.len(), SENT.len() + REFUSED.len(), "{found:?}");
    let requests = requests.lock().expect("no test has failed");
    let mut wrong = Vec::new();
    for ((form, target, expected), found) in SENT.iter().zip(&found) {
        let sent = requests.get(*target).map(String::as_str).unwrap_or_default();
        if found != "200 ok" || !sent.starts_with(&here(expected)) {
            wrong.push(format!("{form}\n  expected {:?}\n  found    {sent:?}, {found}", here(expected)));
        }
    }
    for ((form, expected), found) in REFUSED.iter().zip(&found[SENT.len()..]) {
        if !found.starts_with(&here(expected)) {
            wrong.push(format!("{form}\n  expected {}\n  found    {found}", here(expected)));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert_eq!(requests.len(), SENT.len(), "of the refused ones nothing is sent: {requests:?}");
}

/// A form of the program; the status and the body, or the failure. A target `/STATUS/WHERE` is redirected by
/// that status; the others send the request back.
#[rustfmt::skip]
const REDIRECTED: &[(&str, &str)] = &[
    (r#"(http:get (url "/301/a"))"#, "200 GET /a"),
    (r#"(http:post (url "/301/b") :body "x" :headers '(("Content-Type" . "text/x") ("X-Own" . "1")))"#, "200 GET /b X-Own: 1"),
    (r#"(http:post (url "/302/c") :body "x")"#, "200 GET /c"),
    (r#"(http:put (url "/303/d") :body "x")"#, "200 GET /d"),
    (r#"(http:request :head (url "/303/e"))"#, "200 "),
    (r#"(http:post (url "/307/f") :body "x" :headers '(("Content-Type" . "text/x")))"#, "200 POST /f Content-Type: text/x x"),
    (r#"(http:put (url "/308/g") :body #(120 121))"#, "200 PUT /g xy"),
    (r#"(http:post (url "/303/h") :body (make-string-input-stream "x"))"#, "200 GET /h"),
    (r#"(http:post (url "/307/i") :body (make-string-input-stream "x"))"#, "HTTP-ERROR the redirection to http://127.0.0.1:PORT/i needs the body again, which was a stream"),
    (r#"(http:get (url "/301/302/303/j"))"#, "200 GET /j"),
    (r#"(http:get (url "/301/302/303/k") :max-redirects 2)"#, "HTTP-ERROR more than 2 redirections, the last one to /k"),
    (r#"(http:get (url "/301/l") :max-redirects 0)"#, "301 to /l"),
    (r#"(http:get (url "/loop"))"#, "HTTP-ERROR more than 5 redirections, the last one to /loop"),
    (r#"(http:get (url "/nowhere"))"#, "302 nowhere"),
    (r#"(http:get (url "/304/m"))"#, "304 "),
    (r#"(http:get (url "/300/n"))"#, "300 to /n"),
    (r#"(http:get (url "/to-file"))"#, "HTTP-ERROR the URL `file:///etc/passwd` begins neither with http:// nor with https://"),
    (r#"(http:get (url "/to-elsewhere"))"#, "PERMISSION-DENIED NET"),
    (r#"(http:get (url "/302/o") :headers '(("Authorization" . "Bearer x") ("Cookie" . "y")))"#, "200 GET /o Authorization: Bearer x Cookie: y"),
    (r#"(http:get (url "/to-localhost") :headers '(("Authorization" . "Bearer x") ("Cookie" . "y") ("X-Own" . "1")))"#, "200 GET /there X-Own: 1"),
    (r#"(http:get (format nil "http://me:pw@127.0.0.1:~d/to-localhost" *port*))"#, "200 GET /there"),
    (r#"(http:get (url "/relative/x/y"))"#, "200 GET /relative/x/z?q=%C3%BC"),
    (r#"(let ((parts nil)) (http:get (url "/301/p") :each (lambda (part) (push part parts))) (values parts 200))"#, "200 (GET /p)"),
    (r#"(let ((status (nth-value 1 (with-rights ((:net "localhost")) (http:get (url "/to-localhost")))))) (values "" status))"#, "PERMISSION-DENIED NET"),
];

#[test]
fn redirections_are_followed_as_far_as_they_may_be() {
    let own_port = Arc::new(Mutex::new(0));
    let known = own_port.clone();
    let requests_seen: Arc<Mutex<Option<Requests>>> = Arc::default();
    let seen = requests_seen.clone();
    let (port, requests) = begin(move |target| {
        let to = |status: &str, place: &str, body: &str| {
            let length =
                if status == "304" { String::new() } else { format!("Content-Length: {}\r\n", body.len()) };
            let body = if status == "304" { "" } else { body };
            format!("HTTP/1.1 {status} Elsewhere\r\nLocation: {place}\r\n{length}\r\n{body}").into_bytes()
        };
        let port = *known.lock().expect("no test has failed");
        let answer = match target {
            "/loop" => to("302", "/loop", ""),
            "/nowhere" => b"HTTP/1.1 302 Elsewhere\r\nContent-Length: 7\r\n\r\nnowhere".to_vec(),
            "/to-file" => to("302", "file:///etc/passwd", ""),
            "/to-elsewhere" => to("302", "http://other.example/", ""),
            "/to-localhost" => to("302", &format!("http://localhost:{port}/there"), ""),
            "/relative/x/y" => to("302", "z?q=ü#there", ""),
            _ => match target[1..].split_once('/').filter(|(status, _)| status.parse::<u16>().is_ok()) {
                Some((status, place)) => to(status, &format!("/{place}"), &format!("to /{place}")),
                None => {
                    let requests = seen.lock().expect("no test has failed");
                    let requests =
                        requests.as_ref().expect("it was given").lock().expect("no test has failed");
                    let (head, body) = requests[target].split_once("\r\n\r\n").expect("it has a head");
                    let common = ["host", "accept-encoding", "connection", "content-length"];
                    let mut said = head.split(" HTTP").next().unwrap_or_default().to_owned();
                    for line in head.lines().skip(1) {
                        let name = line.split(':').next().unwrap_or_default().to_lowercase();
                        if !common.contains(&name.as_str()) {
                            said += &format!(" {line}");
                        }
                    }
                    if !body.is_empty() {
                        said += &format!(" {body}");
                    }
                    let body = if head.starts_with("HEAD") { "" } else { &said };
                    format!("HTTP/1.1 200 OK\r\nContent-Length: {}\r\n\r\n{body}", said.len()).into_bytes()
                }
            },
        };
        (answer, Stay)
    });
    *own_port.lock().expect("no test has failed") = port;
    *requests_seen.lock().expect("no test has failed") = Some(requests);
    let text: String = REDIRECTED.iter().map(|row| format!("(try {})\n", row.0)).collect();
    let found = run("http-redirected", port, &text);
    let mut wrong = Vec::new();
    for ((form, expected), found) in REDIRECTED.iter().zip(&found) {
        let expected = expected.replace("PORT", &port.to_string());
        if found != &expected {
            wrong.push(format!("{form}\n  expected {expected}\n  found    {found}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert_eq!(found.len(), REDIRECTED.len());
}

/// A call that is left closes its connection, wherever the server has got to.
#[test]
fn a_call_that_is_left_closes_its_connection() {
    let listener = TcpListener::bind("127.0.0.1:0").expect("there is a port");
    let port = listener.local_addr().expect("it has an address").port();
    let server = std::thread::spawn(move || {
        let said: [&[u8]; 4] =
            [b"", b"HTTP/1.1 200 OK\r\n", b"HTTP/1.1 200 OK\r\nContent-Length: 9\r\n\r\nhalf", b""];
        said.map(|said| {
            let (mut stream, _) = listener.accept().expect("somebody connects");
            let (_, request) = read_request(&stream, false).expect("it is sent");
            stream.write_all(said).expect("it can be sent");
            // It ends when the client closes it; a client that leaves bytes unread resets it.
            drop(stream.read_to_end(&mut Vec::new()));
            request.lines().next().unwrap_or_default().to_owned()
        })
    });
    let found = run(
        "http-left",
        port,
        r#"(try (http:get (url "/a") :timeout 0.3))
(try (with-timeout 0.3 (http:get (url "/b"))))
(let ((task (spawn (:name 'asks) (http:get (url "/c"))))) (sleep 0.3) (abort-task task) (wait-for-task task))
;; A body that does not come.
(sockets:with-socket (silent (sockets:listen "127.0.0.1" 0))
  (sockets:with-socket (endless (sockets:connect "127.0.0.1" (sockets:local-port silent)))
    (try (http:post (url "/d") :body endless :timeout 0.3))))
(print 'over)"#,
    );
    let timeout = "TIMEOUT NIL";
    assert_eq!(found[..3], [timeout, timeout, timeout]);
    let requests = server.join().expect("the server does not fail");
    assert_eq!(requests, ["GET /a HTTP/1.1", "GET /b HTTP/1.1", "GET /c HTTP/1.1", "POST /d HTTP/1.1"]);
}

/// In a world of scripts nothing is connected to.
#[test]
fn scripts_answer_for_servers() {
    let text = r#"(require :http)
(deftest answered
  (with-world ((:answer (http:get "http://robot/battery" . *) :with (values "80" 200 nil) :times 1)
               (:answer (http:get "http://robot/battery" . *) :failing (:http-error "lost")))
    (is (equal (multiple-value-list (http:get "http://robot/battery" :timeout 5)) '("80" 200 nil)))
    (fails :http-error (http:get "http://robot/battery" :timeout 5))
    (is (equal (length (world-calls 'http:get)) 2))))
(deftest not-answered
  (fails :not-in-this-world (http:get "http://robot/battery"))
  (fails :not-in-this-world (http:with-server (0) (:get "/" () "x")))
  (fails :http-error (http:get "robot/battery")))"#;
    let folder = Folder::with("http-world", &[("world.esl", text)]);
    let done = process::run(eslvm(&["test", "world.esl"]).current_dir(folder.path()), "");
    assert_eq!(done.status, Some(0), "{}\n{}", done.output, done.errors);
    assert!(done.output.contains("2 passed"), "{}", done.output);
}

/// A run that served itself over HTTP is replayed to the tick, without a connection.
#[test]
fn a_recorded_exchange_is_replayed() {
    let text = r#"(require :http)
(defvar *served* nil)
(spawn (:name 'server :daemon t)
  (http:with-server (0 :started (lambda (port) (setq *served* port)))
    (:post "/echo" () (values (http:request-body http:*request*) 201))
    (:get "/fail" () (fail :broken))))
(wait-until *served*)
(defun url (path) (format nil "http://127.0.0.1:~d~a" *served* path))
(print (multiple-value-bind (body status) (http:post (url "/echo") :body "hä") (list body status)))
(print (nth-value 1 (http:get (url "/fail"))))
(print (nth-value 1 (http:post (url "/echo") :body (make-string-input-stream "parts"))))"#;
    let folder = Folder::with("http-recorded", &[("main.esl", text)]);
    let run = |arguments: &[&str]| process::run(eslvm(arguments).current_dir(folder.path()), "");
    let recorded = run(&["run", "--allow-net=127.0.0.1", "--record", "run.rec", "main.esl"]);
    assert_eq!(recorded.status, Some(0), "{}", recorded.errors);
    assert!(recorded.output.contains("(\"hä\" 201)"), "{}", recorded.output);
    let replayed =
        process::run(eslvm(&["replay", "run.rec"]).current_dir(folder.path()), ":continue\n:quit\n");
    assert!(replayed.output.contains("(\"hä\" 201)"), "{}\n{}", replayed.output, replayed.errors);
}
