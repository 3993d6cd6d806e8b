//! Serial lines and connections that are secured.
#![cfg(unix)]

use std::fs::File;
use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Command, Stdio};

use esl_conformance::folder::Folder;
use esl_conformance::process::{self, finish, start};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{ControlModes, InputModes};

use crate::eslvm;

#[test]
fn a_serial_line_is_a_stream() {
    // A terminal whose other end this test holds.
    let other_end = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).expect("there are terminals");
    grantpt(&other_end).and_then(|()| unlockpt(&other_end)).expect("it is ours");
    let name = ptsname(&other_end, Vec::new()).expect("it has a name").into_string().expect("it is text");
    let text = "(require :serial)
(defmacro cause (form) `(print (handler-case ,form (failure (f) (list (failure-cause f) (failure-arguments f))))))
(defvar *path* (first (command-line-arguments)))
(spawn (:name 'other :daemon t) (loop (sleep 0.001)))
(serial:with-serial-port (port *path* :baud 115200 :stop-bits 2 :flow-control :software)
  (format port \"ping~%\")
  (print (list (read-line port) (read-byte port) (read-char port)))
  (write-sequence (coerce '(255 0 10) '(vector (unsigned-byte 8))) port)
  (print (handler-case (with-timeout 0.01 (read-char port)) (failure (f) (failure-cause f)))))
(print (catch 'out (serial:with-serial-port (port *path*) (format port \"pong~%\") (finish-output port) (throw 'out 'thrown))))
(print (read-line))
(cause (serial:open-serial-port \"/dev/esl-no-such-line\"))
(cause (car (list (handler-case (serial:open-serial-port \"esl-no-such-line\") (failure (f) (failure-cause f))))))";
    let folder = Folder::with("serial", &[("main.esl", text)]);
    let link = std::fs::canonicalize(&name).expect("it is there").display().to_string();
    let missing = folder.join("esl-no-such-line");
    let mut command = eslvm(&["run", &format!("--allow-serial={link},{missing}"), "main.esl", &name]);
    let mut child = start(command.current_dir(folder.path()));
    let mut other_end = BufReader::new(File::from(other_end));
    let mut line = String::new();
    other_end.read_line(&mut line).expect("it is written");
    assert_eq!(line, "ping\n");
    // A terminal keeps these settings, and has no others.
    let settings = rustix::termios::tcgetattr(other_end.get_ref()).expect("it is a terminal");
    assert_eq!((settings.input_speed(), settings.output_speed()), (115_200, 115_200));
    assert!(settings.control_modes.contains(ControlModes::CSTOPB));
    assert!(settings.input_modes.contains(InputModes::IXON | InputModes::IXOFF));
    other_end.get_mut().write_all("pöng\n\u{7}x".as_bytes()).expect("it is read");
    let mut bytes = [0; 3];
    other_end.read_exact(&mut bytes).expect("it is written");
    assert_eq!(bytes, [255, 0, 10]);
    // Of a port that is closed, by a throw too, the other end is told.
    let mut rest = Vec::new();
    while !rest.ends_with(b"pong\n") {
        assert!(child.try_wait().is_ok_and(|end| end.is_none()), "it has ended after {rest:?}");
        let mut part = [0; 9];
        match other_end.read(&mut part) {
            Ok(count) => rest.extend(&part[..count]),
            // Between the first time and the second the line is closed.
            Err(_) => std::thread::sleep(std::time::Duration::from_millis(1)),
        }
    }
    let mut events = [PollFd::new(other_end.get_ref(), PollFlags::HUP)];
    let patience = Timespec { tv_sec: 60, tv_nsec: 0 };
    assert_eq!(poll(&mut events, Some(&patience)), Ok(1), "the port is not closed");
    child.stdin.as_mut().expect("it is a pipe").write_all(b"go on\n").expect("it is read");
    let output = finish(child).quiet_output().expect("nothing is wrong");
    let lines: Vec<&str> = output.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    let refused =
        "(:PERMISSION-DENIED (:SERIAL \"/dev/esl-no-such-line\" \"--allow-serial=/dev/esl-no-such-line\"))";
    assert_eq!(lines, ["(\"pöng\" 7 #\\x)", ":TIMEOUT", "THROWN", "\"go on\"", refused, ":SERIAL-ERROR"]);
}

const SERVER: &str = "
import socket, ssl
context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
context.load_cert_chain('server.pem', 'server.key')
listener = socket.create_server(('127.0.0.1', 0))
print(listener.getsockname()[1], flush=True)
while True:
    connection, _ = listener.accept()
    try:
        with context.wrap_socket(connection, server_side=True) as secured:
            lines = secured.makefile('rwb')
            line = lines.readline()
            if line.startswith(b'GET'):
                while lines.readline().strip():
                    pass
                lines.write(b'HTTP/1.1 200 OK\\r\\nContent-Length: 5\\r\\n\\r\\nhello')
            else:
                lines.write(line.upper())
            lines.flush()
            print('end' if lines.read() == b'' else 'more', flush=True)
    except OSError:
        print('refused', flush=True)
";

/// Makes an authority and the certificate of a server. Returns false if there is nothing to make them with.
pub(crate) fn make_certificates(folder: &Folder) -> bool {
    folder.file("names", "subjectAltName = DNS:localhost, IP:127.0.0.1\n");
    let key = ["-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes"];
    let authority =
        ["req", "-x509", "-days", "3", "-subj", "/CN=authority", "-keyout", "ca.key", "-out", "ca.pem"];
    let request = ["req", "-subj", "/CN=localhost", "-keyout", "server.key", "-out", "server.csr"];
    let sign = ["x509", "-req", "-in", "server.csr", "-CA", "ca.pem", "-CAkey", "ca.key", "-set_serial", "2"];
    let signed = ["-days", "3", "-extfile", "names", "-out", "server.pem"];
    let run = |arguments: &[&[&str]]| {
        let mut command = Command::new("openssl");
        command.args(arguments.concat()).current_dir(folder.path()).stdin(Stdio::null());
        command.output().is_ok_and(|output| output.status.success())
    };
    run(&[&authority, &key]) && run(&[&request, &key]) && run(&[&sign, &signed])
}

#[test]
fn a_secured_connection_needs_a_server_that_proves_who_it_is() {
    let folder = Folder::with("tls", &[("server.py", SERVER), ("main.esl", "")]);
    let mut python = Command::new("python3");
    python.arg("server.py").current_dir(folder.path()).stdin(Stdio::null()).stdout(Stdio::piped());
    let has_ssl = Command::new("python3").args(["-c", "import ssl"]).output();
    if !make_certificates(&folder) || !has_ssl.is_ok_and(|output| output.status.success()) {
        crate::say_left_out("it needs `openssl`, and `python3` with its `ssl`");
        return;
    }
    let mut server = python.stderr(Stdio::null()).spawn().expect("Python is there");
    let mut said = BufReader::new(server.stdout.take().expect("its output is a pipe"));
    let mut port = String::new();
    said.read_line(&mut port).expect("it says its port");
    let port = port.trim();
    let text = "(require :http)
(defmacro cause (form) `(print (handler-case ,form (failure (f) (failure-cause f)))))
(defvar *port* (parse-integer (first (command-line-arguments))))
(defun talk (&rest options)
  (sockets:with-socket (c (apply #'sockets:connect \"127.0.0.1\" *port* options))
    (format c \"hello~%\")
    (read-line c)))
(cause (talk :tls t :ca-file \"ca.pem\"))
(cause (talk :tls \"localhost\" :ca-file \"ca.pem\" :timeout 60))
(cause (talk :tls \"elsewhere.example\" :ca-file \"ca.pem\"))
(cause (talk :tls t))
(cause (talk :tls t :ca-file \"main.esl\"))
(cause (talk :tls t :ca-file \"/none.pem\"))
(cause (multiple-value-bind (body status) (http:get (format nil \"https://127.0.0.1:~d/x\" *port*) :ca-file \"ca.pem\")
         (list body status)))
(cause (http:get (format nil \"https://127.0.0.1:~d/x\" *port*)))
(sockets:with-socket (listener (sockets:listen \"127.0.0.1\" 0))
  (spawn (:name 'plain) (sockets:with-socket (c (sockets:accept listener)) (format c \"no TLS~%\")))
  (cause (sockets:connect \"127.0.0.1\" (sockets:local-port listener) :tls t :ca-file \"ca.pem\")))";
    folder.file("main.esl", text);
    let mut command = eslvm(&["run", "--allow-net=127.0.0.1", "main.esl", port]);
    let output = process::run(command.current_dir(folder.path()), "").quiet_output();
    // The server waits for the next connection; what it has said is all there.
    server.kill().and_then(|()| server.wait()).expect("it is our child");
    let output = output.expect("nothing is wrong");
    let lines: Vec<&str> = output.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    let (refused, denied) = (":TLS-ERROR", ":PERMISSION-DENIED");
    let first = ["\"HELLO\"", "\"HELLO\"", refused, refused, refused, denied];
    assert_eq!(lines, [&first[..], &["(\"hello\" 200)", refused, refused]].concat());
    let said: Vec<String> = said.lines().map_while(Result::ok).collect();
    assert_eq!(said[..4], ["end", "end", "refused", "refused"], "a connection that is closed has an end");
}

#[test]
fn a_listener_proves_who_it_is_and_drops_whom_it_cannot_talk_to() {
    let folder = Folder::with("tls-server", &[]);
    if !make_certificates(&folder) {
        crate::say_left_out("it needs `openssl`");
        return;
    }
    let server = "(require :sockets)
(defmacro cause (form) `(print (handler-case ,form (failure (f) (failure-cause f)) (error () 'wrong))))
(cause (sockets:listen \"127.0.0.1\" 0 :certificate \"server.pem\"))
(cause (sockets:listen \"127.0.0.1\" 0 :certificate \"server.key\" :key \"server.key\"))
(cause (sockets:listen \"127.0.0.1\" 0 :certificate \"server.pem\" :key \"ca.key\"))
(cause (sockets:listen \"127.0.0.1\" 0 :certificate \"none.pem\" :key \"server.key\"))
(cause (sockets:listen \"127.0.0.1\" 0 :certificate \"/etc/x.pem\" :key \"server.key\"))
(sockets:with-socket (listener (sockets:listen \"127.0.0.1\" 0 :certificate \"server.pem\" :key \"server.key\"))
  (format t \"~&port ~d~%\" (sockets:local-port listener))
  (finish-output)
  (dotimes (i 2)
    (sockets:with-socket (c (sockets:accept listener))
      (format t \"~&heard ~a~%\" (read-line c))
      (finish-output)
      (format c \"good day~%\"))))";
    let client = "(require :sockets)
(defmacro cause (form) `(print (handler-case ,form (failure (f) (failure-cause f)))))
(defvar *port* (parse-integer (first (command-line-arguments))))
(defun talk (&rest options)
  (sockets:with-socket (c (apply #'sockets:connect \"127.0.0.1\" *port* options))
    (format c \"hello~%\")
    (list (read-line c) (read-line c nil 'end))))
(sockets:with-socket (silent (sockets:connect \"127.0.0.1\" *port*))
  (cause (talk :tls t :ca-file \"ca.pem\"))
  (cause (talk :tls t))
  (sockets:with-socket (c (sockets:connect \"127.0.0.1\" *port*))
    (format c \"no TLS~%\")
    (cause (progn (loop while (read-char c nil nil)) 'dropped)))
  (cause (talk :tls \"localhost\" :ca-file \"ca.pem\")))";
    folder.file("server.esl", server);
    folder.file("client.esl", client);
    let mut command = eslvm(&["run", "--allow-net=127.0.0.1", "server.esl"]);
    command.current_dir(folder.path()).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::inherit());
    let mut server = command.spawn().expect("the command is there");
    let mut said = BufReader::new(server.stdout.take().expect("its output is a pipe"));
    let mut next = || {
        let mut line = String::new();
        while line.trim().is_empty() && said.read_line(&mut line).expect("it is text") > 0 {}
        line.trim().to_owned()
    };
    let (refused, denied) = (":TLS-ERROR", ":PERMISSION-DENIED");
    assert_eq!([next(), next(), next(), next(), next()], ["WRONG", refused, refused, refused, denied]);
    let port = next();
    let port = port.strip_prefix("port ").expect("it says its port");
    let mut command = eslvm(&["run", "--allow-net=127.0.0.1", "client.esl", port]);
    let output = process::run(command.current_dir(folder.path()), "").quiet_output();
    let heard = [next(), next()];
    server.kill().and_then(|()| server.wait()).expect("it is our child");
    let output = output.expect("nothing is wrong");
    let lines: Vec<&str> = output.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    let talk = "(\"good day\" END)";
    // Plain text is answered by a TLS alert, or by the end of the connection.
    assert!(matches!(lines[2], "DROPPED" | ":CONNECTION-LOST"), "{lines:?}");
    assert_eq!((lines[0], lines[1], lines[3]), (talk, refused, talk));
    assert_eq!(heard, ["heard hello", "heard hello"]);
}
