//! Servers that ask for certificates of their clients, and clients that have one.
#![cfg(unix)]

use std::process::Command;

use esl_conformance::folder::Folder;

use crate::lines::make_certificates;
use crate::operate::Operated;

const PROGRAM: &str = "(require :ws)
(require :http)
;; A whole line at once, for a test that reads it.
(defun say (value) (format *error-output* \"; ~s~%\" value))
(defmacro outcome (form)
  `(say (handler-case (values ,form)
          (failure (f) (if (eq (failure-cause f) :permission-denied) :denied :failed))
          (error () :wrong))))
(defvar *own* '(:certificate \"server.pem\" :key \"server.key\"))
(defun ask (port &rest options)
  (outcome (apply #'http:get (format nil \"https://localhost:~d/x\" port) :ca-file \"ca.pem\" options)))
(defun listen-to (port &rest options)
  (outcome (apply #'ws::call-with-connection #'ws:receive (format nil \"wss://localhost:~d/ws\" port)
                  :ca-file \"ca.pem\" options)))
(defun try (port)
  (apply #'ask port *own*)
  (ask port)
  (apply #'listen-to port *own*)
  (listen-to port)
  ;; The authority did not sign this one.
  (listen-to port :certificate \"other.pem\" :key \"other.key\")
  ;; The key does not belong to the certificate.
  (listen-to port :certificate \"ca.pem\" :key \"server.key\")
  (listen-to port :certificate \"server.pem\")
  (listen-to port :certificate \"/etc/none.pem\" :key \"server.key\")
  (outcome (http:with-server (0 :client-ca-file \"ca.pem\")))
  (outcome (http:with-server (0 :certificate \"server.pem\" :key \"server.key\" :client-ca-file \"server.key\")))
  (say port))
(http:with-server (0 :certificate \"server.pem\" :key \"server.key\" :client-ca-file \"ca.pem\"
                     :started (lambda (port) (spawn (:daemon t) (try port))))
  (:get \"/x\" () \"hello\")
  (:ws \"/ws\" (c) (ws:send c \"greetings\")))";

/// A client in Python, with a certificate or without.
const CLIENT: &str = "import http.client, ssl, sys
context = ssl.create_default_context(cafile='ca.pem')
if len(sys.argv) > 2:
    context.load_cert_chain(sys.argv[2] + '.pem', sys.argv[2] + '.key')
connection = http.client.HTTPSConnection('localhost', int(sys.argv[1]), context=context)
try:
    connection.request('GET', '/x')
    print(connection.getresponse().read().decode())
except OSError as error:
    print('refused')
";

#[test]
fn clients_and_servers_prove_to_each_other_who_they_are() {
    let folder = Folder::with("mutual-tls", &[("client.py", CLIENT)]);
    let other =
        ["req", "-x509", "-days", "3", "-subj", "/CN=other", "-keyout", "other.key", "-out", "other.pem"];
    let key = ["-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes"];
    let made = Command::new("openssl").args(other).args(key).current_dir(folder.path()).output();
    if !make_certificates(&folder) || !made.is_ok_and(|made| made.status.success()) {
        crate::say_left_out("it needs `openssl`");
        return;
    }
    let mut run = Operated::start_in(folder.path(), &folder, PROGRAM, &["--allow-net=localhost,127.0.0.1"]);
    let expected = [
        "\"hello\"",
        ":FAILED",
        "\"greetings\"",
        ":FAILED",
        ":FAILED",
        ":FAILED",
        ":WRONG",
        ":DENIED",
        ":WRONG",
        ":FAILED",
    ];
    let found = expected.map(|_| run.said("; "));
    assert_eq!(found, expected);
    let port = run.said("; ");
    for (arguments, expected) in [(&["server"][..], "hello"), (&[], "refused"), (&["other"], "refused")] {
        let client = Command::new("python3")
            .args(["client.py", &port])
            .args(arguments)
            .current_dir(folder.path())
            .output()
            .expect("Python is there");
        let output = String::from_utf8_lossy(&client.stdout);
        assert_eq!(output.trim(), expected, "{arguments:?}: {}", String::from_utf8_lossy(&client.stderr));
    }
    run.child.kill().and_then(|()| run.child.wait()).expect("it is our child");
}
