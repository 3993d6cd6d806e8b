//! The module `:http`: its client and its server, with each other.

use esl_conformance::folder::Folder;
use esl_conformance::process;

use crate::eslvm;

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
(defun without-date (body status headers) (list body status (remove \"date\" headers :key #'car :test #'equal)))
(print (multiple-value-call #'without-date (http:get (url \"/hello/w%C3%B6rld?greeting=hi+there\"))))
(multiple-value-bind (body status headers) (http:post (url \"/echo\") :body (make-string 50000 :initial-element #\\é))
  (print (list (length body) (char body 49999) status (http:header \"X-Kind\" headers))))
(print (http:get (url \"/bytes\") :bytes t))
(print (nth-value 1 (http:get (url \"/none\"))))
(print (nth-value 1 (http:put (url \"/echo\") :body \"x\")))
(print (multiple-value-call #'without-date (http:get (url \"/fail\") :headers '((\"Accept\" . \"*/*\")))))
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
                  (\"connection\" . \"close\") (\"content-length\" . \"23\")))";
    let expected = [
        "(\"hi there wörld\" 200 ((\"content-type\" . \"text/plain; charset=utf-8\") \
         (\"connection\" . \"close\") (\"content-length\" . \"15\")))",
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
