//! The module `:http` with real peers: curl for its server, Python's `http.server` for its client.

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

use esl_conformance::folder::Folder;
use esl_conformance::process;

use crate::eslvm;
use crate::http_server::Served;

#[test]
fn curl_is_answered() {
    let has_curl = Command::new("curl").arg("--version").output();
    if !has_curl.is_ok_and(|output| output.status.success()) {
        crate::say_left_out("it needs `curl`");
        return;
    }
    let routes = r#"
    (:get "/hello/:name" (name) (format nil "hello ~a" name))
    (:post "/echo" () (http:request-body http:*request*))
    (:get "/none" () (values nil 204))
    (:get "/long" () (make-string 1000000 :initial-element #\x))
    (:get "/away" () (values "" 302 '(("Location" . "/hello/again"))))
    (:put "/length" () (format nil "~d" (length (http:request-body http:*request*))))"#;
    let served = Served::begin("http-curl", "", routes);
    served.folder.file("body", "y".repeat(3_000_000));
    let url = |path: &str| format!("http://127.0.0.1:{}{path}", served.port);
    let curl = |arguments: &[&str]| {
        let mut command = Command::new("curl");
        command.args(["--silent", "--show-error", "--noproxy", "*", "--max-time", "60"]).args(arguments);
        let output =
            command.current_dir(served.folder.path()).stdin(Stdio::null()).output().expect("curl runs");
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(output.status.success(), "{arguments:?}: {text}{}", String::from_utf8_lossy(&output.stderr));
        text
    };
    let said = ["--write-out", " %{http_code} %{http_version} %{num_connects}\n"];
    let with = |more: &[&str]| curl(&[&said[..], more].concat());
    assert_eq!(with(&[&url("/hello/w%C3%B6rld")]), "hello wörld 200 1.1 1\n");
    assert_eq!(with(&["--data", "a=b&c=ä", &url("/echo")]), "a=b&c=ä 200 1.1 1\n");
    assert_eq!(with(&["--http1.0", &url("/hello/old")]), "hello old 200 1 1\n");
    assert_eq!(with(&["--location", &url("/away")]), "hello again 200 1.1 1\n");
    assert_eq!(with(&[&url("/none")]), " 204 1.1 1\n");
    // One connection for three requests.
    let three = with(&[&url("/hello/a"), &url("/hello/b"), &url("/none")]);
    assert_eq!(three, "hello a 200 1.1 1\nhello b 200 1.1 0\n 204 1.1 0\n");
    let head = curl(&["--head", &url("/hello/a")]);
    assert!(head.starts_with("HTTP/1.1 200 OK\r\n") && head.contains("Content-Length: 7\r\n"), "{head}");
    let chunked = ["--header", "Transfer-Encoding: chunked", "--data-binary", "@body", "--request", "PUT"];
    assert_eq!(with(&[&chunked[..], &[&url("/length")]].concat()), "3000000 200 1.1 1\n");
    // It asks whether it may send so much.
    let asks = ["--header", "Expect: 100-continue", "--upload-file", "body"];
    assert_eq!(with(&[&asks[..], &[&url("/length")]].concat()), "3000000 200 1.1 1\n");
    assert_eq!(curl(&[&url("/long")]).len(), 1_000_000);
    let done = served.end();
    assert_eq!((done.status, done.errors.as_str()), (Some(0), ""));
}

/// A server that serves files, and one method of its own.
const SERVER: &str = "
import http.server
class Handler(http.server.SimpleHTTPRequestHandler):
    protocol_version = 'HTTP/1.1'
    def do_POST(self):
        body = self.rfile.read(int(self.headers['Content-Length']))
        self.send_response(201)
        self.send_header('Content-Length', str(len(body)))
        self.send_header('X-Kind', self.headers['X-Kind'])
        self.end_headers()
        self.wfile.write(body[::-1])
    def log_message(self, *_):
        pass
server = http.server.ThreadingHTTPServer(('127.0.0.1', 0), Handler)
print(server.server_address[1], flush=True)
server.serve_forever()
";

#[test]
fn the_server_of_python_is_understood() {
    let text = r#"(require :http)
(defvar *port* (parse-integer (first (command-line-arguments))))
(defun url (path) (format nil "http://127.0.0.1:~d~a" *port* path))
(print (multiple-value-bind (body status headers) (http:get (url "/folder/ä b.txt"))
         (list body status (http:header "content-type" headers))))
(print (multiple-value-list (http:request :head (url "/folder/ä b.txt") :max-redirects 0 :bytes t
                                          :headers '(("X" . "y")) :timeout 60)))
;; Python redirects to the folder.
(print (multiple-value-bind (body status) (http:get (url "/folder")) (list (if (search "b.txt" body) t body) status)))
(print (nth-value 1 (http:get (url "/none"))))
(print (nth-value 1 (http:request :wonder (url "/none"))))
(print (multiple-value-bind (body status headers) (http:post (url "/") :body #(0 1 255) :bytes t :headers '(("X-Kind" . "ä")))
         (list body status (http:header "x-kind" headers))))
(let ((length 0) (parts 0))
  (http:get (url "/long") :bytes t :each (lambda (part) (incf length (length part)) (incf parts)))
  (print (list length (> parts 1))))"#;
    let folder = Folder::with("http-python", &[("server.py", SERVER), ("main.esl", text)]);
    std::fs::create_dir_all(folder.path().join("folder")).expect("there is room");
    folder.file("folder/ä b.txt", "contents, ä");
    folder.file("long", vec![7; 1_000_000]);
    let mut python = Command::new("python3");
    python.arg("server.py").current_dir(folder.path()).stdin(Stdio::null()).stdout(Stdio::piped());
    let Ok(mut server) = python.stderr(Stdio::null()).spawn() else {
        crate::say_left_out("it needs `python3`");
        return;
    };
    let mut port = String::new();
    BufReader::new(server.stdout.take().expect("it is a pipe"))
        .read_line(&mut port)
        .expect("it says its port");
    let mut command = eslvm(&["run", "--allow-net=127.0.0.1", "main.esl", port.trim()]);
    let done = process::run(command.current_dir(folder.path()), "");
    server.kill().and_then(|()| server.wait()).expect("it is our child");
    let lines: Vec<&str> = done.output.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    assert_eq!(lines[0], "(\"contents, ä\" 200 \"text/plain\")", "{}", done.errors);
    assert!(lines[1].starts_with("(#() 200 "), "{lines:?}");
    let rest = lines.iter().position(|line| line.starts_with("(T ")).expect("the folder is listed");
    let expected = ["(T 200)", "404", "501", "(#(255 1 0) 201 \"ä\")", "(1000000 T)"];
    assert_eq!(lines[rest..], expected, "{}", done.errors);
}

/// A server with a certificate is reached over TLS, and not otherwise.
#[cfg(unix)]
#[test]
fn a_secured_server_proves_who_it_is() {
    let text = r#"(require :http)
(defvar *served* nil)
(defmacro cause (form) `(print (handler-case ,form (failure (f) (failure-cause f)) (error () 'wrong))))
(cause (http:with-server (0 :certificate "server.pem") (:get "/" () "x")))
(cause (http:with-server (0 :certificate "server.pem" :key "ca.key") (:get "/" () "x")))
(spawn (:name 'server :daemon t)
  (http:with-server (0 :certificate "server.pem" :key "server.key" :started (lambda (port) (setq *served* port)))
    (:post "/echo" () (http:request-body http:*request*))))
(wait-until *served*)
(defun url (scheme) (format nil "~a://localhost:~d/echo" scheme *served*))
(cause (http:post (url "https") :body (make-string 100000 :initial-element #\x) :ca-file "ca.pem"
                  :each (lambda (part) (unless (every (lambda (c) (eql c #\x)) part) (print 'wrong)))))
(cause (http:post (url "https") :body "secured" :ca-file "ca.pem"))
(cause (http:post (url "https") :body "secured"))
(cause (http:post (url "http") :body "secured"))"#;
    let folder = Folder::with("http-secured", &[("main.esl", text)]);
    if !crate::lines::make_certificates(&folder) {
        crate::say_left_out("it needs `openssl`");
        return;
    }
    let mut command = eslvm(&["run", "--allow-net=127.0.0.1,localhost", "main.esl"]);
    let done = process::run(command.current_dir(folder.path()), "");
    let lines: Vec<&str> = done.output.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    let expected = ["WRONG", ":TLS-ERROR", "NIL", "\"secured\"", ":TLS-ERROR", ":HTTP-ERROR"];
    assert_eq!(lines, expected, "{}", done.errors);
}
