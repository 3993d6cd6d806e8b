//! The module `:http`: its client and its server, with each other and with others.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};

use esl_conformance::process;

use crate::eslvm;
use crate::folder::Folder;

fn lines(text: &str) -> Vec<&str> {
    text.lines().map(str::trim).filter(|line| !line.is_empty()).collect()
}

/// A server, in a task of the program.
const SERVER: &str = "(require :http)
(defvar *served* nil)
(spawn (:name 'server :daemon t)
  (http:with-server (0 :started (lambda (port) (setq *served* port)))
    (:get \"/hello/:name\" (name greeting) (format nil \"~a ~a\" (or greeting \"hello\") name))
    (:post \"/echo\" () (values (http:request-body http:*request*) 201 '((\"X-Kind\" . \"echo\"))))
    (:get \"/bytes\" () #(0 255 10))
    (:get \"/fail\" () (fail :broken))
    (:get \"/wrong\" () (car http:*port*))))
(wait-until *served*)
(defun url (path) (format nil \"http://127.0.0.1:~a~a\" *served* path))
";

#[test]
fn client_and_server_talk() {
    let text = format!(
        "{SERVER}
(print (multiple-value-list (http:get (url \"/hello/w%C3%B6rld?greeting=hi+there\"))))
(multiple-value-bind (body status headers) (http:post (url \"/echo\") :body (make-string 50000 :initial-element #\\é))
  (print (list (length body) (char body 49999) status (http:header \"X-Kind\" headers))))
(print (http:get (url \"/bytes\") :bytes t))
(print (nth-value 1 (http:get (url \"/none\"))))
(print (nth-value 1 (http:put (url \"/echo\") :body \"x\")))
(print (multiple-value-list (http:get (url \"/fail\") :headers '((\"Accept\" . \"*/*\")))))
(print (nth-value 1 (http:get (url \"/wrong\"))))
(print (http:get (url \"/hello/again?name=other\") :timeout 60))
(sockets:with-socket (silent (sockets:listen \"127.0.0.1\" 0))
  (let ((url (format nil \"http://127.0.0.1:~d/\" (sockets:local-port silent))))
    (let ((begun (now)))
      (print (handler-case (with-timeout 20 (http:get url :timeout 0.05))
               (failure (f) (list (failure-cause f) (< (- (now) begun) 15))))))))
(dolist (url '(\"ftp://x\" \"http://\" \"http://:80/\" \"http://127.0.0.1:65536/\"))
  (print (handler-case (http:get url) (failure (f) (failure-cause f)))))"
    );
    let folder = Folder::with("http-both", &[("main.esl", &text)]);
    let mut command = eslvm(&["run", "--allow-net=127.0.0.1", "main.esl"]);
    let done = process::run(command.current_dir(folder.path()), "");
    let failed = "(\"this request has failed\" 500 ((\"content-type\" . \"text/plain; charset=utf-8\") \
                  (\"content-length\" . \"23\") (\"connection\" . \"close\")))";
    let expected = [
        "(\"hi there wörld\" 200 ((\"content-type\" . \"text/plain; charset=utf-8\") \
         (\"content-length\" . \"15\") (\"connection\" . \"close\")))",
        "(50000 #\\é 201 \"echo\")",
        "#(0 255 10)",
        "404",
        "405",
        failed,
        "500",
        "\"hello again\"",
        "(:TIMEOUT T)",
        ":HTTP-ERROR",
        ":HTTP-ERROR",
        ":HTTP-ERROR",
        ":HTTP-ERROR",
    ];
    // A long list is printed over several lines.
    let joined = |lines: &[&str]| lines.join(" ").replace("( ", "(");
    assert_eq!(joined(&lines(&done.output)), joined(&expected), "{}", done.errors);
    assert!(done.errors.contains("GET /fail: A failure of cause :BROKEN."), "{}", done.errors);
}

/// Bodies in parts: what is sent from a stream, and what is handed over as it comes.
#[test]
fn bodies_come_and_go_in_parts() {
    let text = "(require :http)
(defvar *served* nil)
(spawn (:name 'server :daemon t)
  (http:with-server (0 :started (lambda (port) (setq *served* port)))
    (:delete \"/a/:x\" (x) (format nil \"deleted ~a ~a\" x (= http:*port* *served*)))
    (:patch \"/a\" () \"patched\")
    (:post \"/echo\" () (http:request-body http:*request*))
    (:get \"/long\" () (make-string 200000 :initial-element #\\ä))))
(wait-until *served*)
(defun url (path) (format nil \"http://127.0.0.1:~a~a\" *served* path))
(print (http:delete (url \"/a/7\")))
(print (http:request :patch (url \"/a\")))
(print (http:post (url \"/echo\") :body (make-string-input-stream \"häl\")))
(print (length (http:post (url \"/echo\") :body (make-string-input-stream (make-string 100000 :initial-element #\\ü)))))
(with-open-file (s \"data\" :direction :output :element-type '(unsigned-byte 8)) (write-sequence #(104 195 164) s))
(with-open-file (s \"data\" :element-type '(unsigned-byte 8)) (print (http:post (url \"/echo\") :body s)))
(let ((length 0) (parts 0) (others 0))
  (flet ((take (part)
           (incf parts)
           (incf length (length part))
           (incf others (count #\\ä part :test-not #'eql))))
    (print (subseq (multiple-value-list (http:get (url \"/long\") :each #'take)) 0 2))
    (print (list length others (> parts 1)))))
(let ((length 0))
  (http:get (url \"/long\") :bytes t :each (lambda (part) (incf length (length part))))
  (print length))
(define-cause :enough ())
(print (handler-case (http:get (url \"/long\") :each (lambda (part) (fail :enough part)))
         (failure (f) (failure-cause f))))
(print (block nil (http:get (url \"/long\") :each (lambda (part) (return (char part 0))))))";
    let folder = Folder::with("http-parts", &[("main.esl", text)]);
    let mut command = eslvm(&["run", "--allow-net=127.0.0.1", "main.esl"]);
    let output =
        process::run(command.current_dir(folder.path()), "").quiet_output().expect("nothing is wrong");
    let expected = [
        "\"deleted 7 T\"",
        "\"patched\"",
        "\"häl\"",
        "100000",
        "\"hä\"",
        "(NIL 200)",
        "(200000 0 T)",
        "400000",
        ":ENOUGH",
        "#\\ä",
    ];
    assert_eq!(lines(&output), expected);
}

/// Answers one request with a text, and returns the request.
fn answer_once(answer: &'static [u8]) -> (u16, std::thread::JoinHandle<String>) {
    let listener = TcpListener::bind("127.0.0.1:0").expect("there is a port");
    let port = listener.local_addr().expect("it has an address").port();
    let server = std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().expect("somebody connects");
        let mut request = Vec::new();
        let mut byte = [0];
        while !request.ends_with(b"\r\n\r\n") {
            stream.read_exact(&mut byte).expect("it is sent");
            request.push(byte[0]);
        }
        stream.write_all(answer).expect("it can be sent");
        String::from_utf8_lossy(&request).into_owned()
    });
    (port, server)
}

#[test]
fn answers_of_others_are_understood_or_refused() {
    let answers: [(&[u8], &str); 8] = [
        (b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n4;x=1\r\nab\xc3\xa4\r\n1\r\n!\r\n0\r\nA: b\r\n\r\n", "(\"abä!\" 200)"),
        (b"HTTP/1.0 404 Not Found\n\nuntil the end", "(\"until the end\" 404)"),
        (b"HTTP/1.1 100 Continue\r\n\r\nHTTP/1.1 204 Nothing\r\nContent-Length: 5\r\n\r\n", "(\"\" 204)"),
        (b"HTTP/1.1 200 OK\r\nContent-Length: 50\r\n\r\nshort", ":HTTP-ERROR"),
        (b"HTTP/1.1 200 OK\r\nContent-Length: 99999999999\r\n\r\n", ":HTTP-ERROR"),
        (b"SSH-2.0\r\n", ":HTTP-ERROR"),
        // Lengths that contradict each other; one that the chunks overrule.
        (b"HTTP/1.1 200 OK\r\nContent-Length: 3\r\nContent-Length: 5\r\n\r\nabcde", ":HTTP-ERROR"),
        (b"HTTP/1.1 200 OK\r\nContent-Length: 9\r\nTransfer-Encoding: chunked\r\n\r\n1\r\na\r\n0\r\n\r\n", "(\"a\" 200)"),
    ];
    let folder = Folder::new("http-answers");
    for (answer, expected) in answers {
        let (port, server) = answer_once(answer);
        let text = format!(
            "(require :http)
(print (handler-case (subseq (multiple-value-list (http:get \"http://127.0.0.1:{port}/a?b=c#d\")) 0 2)
         (failure (f) (failure-cause f))))"
        );
        let path = folder.file("main.esl", text);
        let done = process::run(&mut eslvm(&["run", "--allow-net", &path]), "");
        assert_eq!(lines(&done.output), [expected], "{}", done.errors);
        let request = server.join().expect("the server does not fail");
        assert!(request.starts_with("GET /a?b=c HTTP/1.1\r\nHost: 127.0.0.1:"), "{request}");
    }
}

#[test]
fn a_server_goes_on_whatever_it_is_sent() {
    let folder = Folder::new("http-server");
    let text = format!("{SERVER}(format t \"~a~%\" *served*) (finish-output) (read-line)");
    let path = folder.file("main.esl", text);
    let mut child = process::start(&mut eslvm(&["run", "--allow-net", &path]));
    let mut port = String::new();
    let output = child.stdout.as_mut().expect("it is a pipe");
    let mut byte = [0];
    while !port.ends_with('\n') {
        output.read_exact(&mut byte).expect("the port is printed");
        port.push(char::from(byte[0]));
    }
    let port: u16 = port.trim().parse().expect("it is a number");
    let ask = |request: &[u8]| {
        let mut stream = TcpStream::connect(("127.0.0.1", port)).expect("it listens");
        stream.write_all(request).expect("it can be sent");
        stream.shutdown(std::net::Shutdown::Write).expect("the end can be sent");
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).expect("it answers");
        String::from_utf8_lossy(&answer).into_owned()
    };
    assert!(ask(b"\xff\xfe\r\n\r\n").starts_with("HTTP/1.1 400 "));
    assert!(ask(b"GET / HTTP/1.1\r\nno header\r\n\r\n").starts_with("HTTP/1.1 400 "));
    assert!(ask(b"POST /echo HTTP/1.1\r\nContent-Length: 9\r\n\r\nshort").starts_with("HTTP/1.1 400 "));
    assert!(ask(&[b'x'; 70_000]).starts_with("HTTP/1.1 400 "));
    assert_eq!(ask(b""), "");
    // A request within the body of another, for whoever believes the other length.
    let two_lengths = b"POST /echo HTTP/1.1\r\nContent-Length: 3\r\nContent-Length: 4\r\n\r\nabcd";
    assert!(ask(two_lengths).starts_with("HTTP/1.1 400 "));
    let both = b"POST /echo HTTP/1.1\r\nContent-Length: 1\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n";
    assert!(ask(both).starts_with("HTTP/1.1 400 "));
    // The answer to HEAD has no body, which the next answer would begin with.
    let two = ask(b"HEAD /hello/a HTTP/1.1\r\n\r\nGET /hello/b HTTP/1.1\r\nConnection: close\r\n\r\n");
    assert!(two.starts_with("HTTP/1.1 405 ") && two.contains("\r\n\r\nHTTP/1.1 200 OK"), "{two}");
    // Two requests over one connection.
    let two = ask(b"GET /hello/a HTTP/1.1\r\n\r\nGET /hello/b HTTP/1.1\r\nConnection: close\r\n\r\n");
    assert_eq!(two.matches("HTTP/1.1 200 OK").count(), 2, "{two}");
    assert!(two.contains("\r\n\r\nhello aHTTP/1.1 200") && two.ends_with("hello b"), "{two}");
    child.stdin.as_mut().expect("it is a pipe").write_all(b"\n").expect("it reads");
    assert_eq!(process::finish(child).status, Some(0));
}
