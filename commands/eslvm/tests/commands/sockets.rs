//! The module `sockets` in the real world: connections, listeners, datagrams.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream, UdpSocket};
#[cfg(unix)]
use std::process::Command;

use esl_conformance::process;

use crate::eslvm;
use crate::world::check;
use esl_conformance::folder::Folder;

#[test]
fn two_tasks_talk_over_a_connection() {
    let text = "(require :sockets)
(define-fluent *port* nil)
(sockets:with-socket (listener (sockets:listen \"127.0.0.1\" 0))
  (spawn (:name 'echo)
    (sockets:with-socket (c (sockets:accept listener))
      (print (equal (sockets:peer c) (format nil \"127.0.0.1:~d\" (wait-until *port*))))
      (loop for line = (read-line c nil nil)
            while line do (format c \"~a!~%\" line))))
  (sockets:with-socket (c (sockets:connect \"127.0.0.1\" (sockets:local-port listener)))
    (setf *port* (sockets:local-port c))
    (print (equal (sockets:peer c) (format nil \"127.0.0.1:~d\" (sockets:local-port listener))))
    (format c \"one~%twö~%\")
    (print (list (read-line c) (read-char c) (peek-char nil c) (read-line c)))
    (write-string (make-string 100000 :initial-element #\\x) c)
    (terpri c)
    (print (length (read-line c)))
    (print (list (input-stream-p c) (output-stream-p c) (open-stream-p c)))
    (close c)
    (print (open-stream-p c))))
(defmacro cause (form) `(print (handler-case ,form (failure (f) (failure-cause f)))))
(let ((port (sockets:with-socket (l (sockets:listen \"127.0.0.1\" 0)) (sockets:local-port l))))
  (cause (sockets:connect \"127.0.0.1\" port)))
(sockets:with-socket (l (sockets:listen \"127.0.0.1\" 0))
  (cause (sockets:listen \"127.0.0.1\" (sockets:local-port l)))
  (cause (with-timeout 0.05 (sockets:accept l)))
  (let ((waiting (spawn (cause (sockets:accept l)))))
    (sleep 0.01)
    (close l)
    (wait-for-task waiting)))
(cause (sockets:connect \"localhost\" 1))";
    let expected = [
        "T",
        "T",
        "(\"one!\" #\\t #\\w \"wö!\")",
        "100001",
        "(T T T)",
        "NIL",
        ":CONNECTION-REFUSED",
        ":ADDRESS-IN-USE",
        ":TIMEOUT",
        ":SOCKET-CLOSED",
        ":PERMISSION-DENIED",
    ];
    check("sockets-talk", text, &["--allow-net=127.0.0.1"], &expected);
}

#[test]
fn a_server_serves_many_at_once_and_peers_may_do_what_they_like() {
    let folder = Folder::new("sockets-server");
    let path = folder.file(
        "main.esl",
        "(require :sockets)
(let ((listener (sockets:listen \"127.0.0.1\" 0)))
  (format t \"~a~%\" (sockets:local-port listener))
  (finish-output)
  (let ((count 0))
    (sockets::serve listener nil
      (lambda (c)
        (loop for line = (read-line c nil nil)
              while line do (format c \"~a ~a~%\" (incf count) (length line)) (finish-output c))))))",
    );
    let mut command = eslvm(&["run", "--allow-net", &path]);
    let mut child = process::start(&mut command);
    let mut output = BufReader::new(child.stdout.take().expect("it is a pipe"));
    let mut line = String::new();
    output.read_line(&mut line).expect("the port is printed");
    let port: u16 = line.trim().parse().expect("the port is printed");
    let connect = || TcpStream::connect(("127.0.0.1", port)).expect("it listens");
    // One sends half a line and goes, one sends no text, one nothing.
    drop(connect().write_all(b"half"));
    let mut garbage = connect();
    garbage.write_all(b"\xff\xfe\n").expect("it can be sent");
    let silent = connect();
    let clients: Vec<TcpStream> = (0..100).map(|_| connect()).collect();
    for client in &clients {
        let mut client = client;
        client.write_all(b"hello\n").expect("it can be sent");
    }
    for client in clients {
        let mut answer = String::new();
        BufReader::new(client).read_line(&mut answer).expect("it answers");
        assert!(answer.ends_with(" 5\n"), "{answer}");
    }
    let mut answer = String::new();
    BufReader::new(garbage).read_line(&mut answer).expect("it answers");
    assert!(answer.ends_with(" 2\n"), "{answer}");
    drop(silent);
    child.kill().expect("it runs");
    child.wait().expect("it ends");
}

#[test]
fn a_peer_elsewhere_is_read_until_it_closes() {
    let listener = TcpListener::bind("127.0.0.1:0").expect("there is a port");
    let port = listener.local_addr().expect("it has an address").port();
    let peer = std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().expect("somebody connects");
        // A character comes in two parts.
        stream.write_all(b"a\xc3").expect("it can be sent");
        let mut request = [0; 3];
        stream.write_all(b"\xa4\nrest without an end").expect("it can be sent");
        stream.read_exact(&mut request).expect("it is sent");
        request
    });
    let text = format!(
        "(require :sockets)
(sockets:with-socket (c (sockets:connect \"127.0.0.1\" {port} :timeout 60))
  (print (read-line c))
  (princ \"yes\" c)
  (print (multiple-value-list (read-line c)))
  (print (list (read-line c nil 'end) (read-char c nil 'end) (listen c))))"
    );
    let address = format!("--allow-net=127.0.0.1:{port}");
    check("sockets-peer", &text, &[&address], &["\"aä\"", "(\"rest without an end\" T)", "(END END NIL)"]);
    assert_eq!(&peer.join().expect("the peer does not fail"), b"yes");
}

#[cfg(unix)]
#[test]
fn unix_sockets_are_paths() {
    let text = "(require :sockets)
(sockets:with-socket (l (sockets:listen-unix \"talk\"))
  (spawn (sockets:with-socket (c (sockets:accept l)) (format c \"hello ~a~%\" (read-line c))))
  (sockets:with-socket (c (sockets:connect-unix \"talk\"))
    (write-line \"you\" c)
    (print (read-line c))))
(print (probe-file \"talk\"))
(print (handler-case (sockets:listen-unix \"../talk\") (failure (f) (failure-arguments f))))";
    let expected = ["\"hello you\"", "NIL", "(:READ \"../talk\" \"--allow-read=../talk\")"];
    check("sockets-unix", text, &[], &expected);
}

#[test]
fn datagrams_come_whole() {
    let peer = UdpSocket::bind("127.0.0.1:0").expect("there is a port");
    let port = peer.local_addr().expect("it has an address").port();
    let answer = std::thread::spawn(move || {
        let mut bytes = [0; 100];
        let (count, address) = peer.recv_from(&mut bytes).expect("something comes");
        peer.send_to(&[0, 255, count as u8], address).expect("it can be sent");
    });
    let text = format!(
        "(require :sockets)
(sockets:with-socket (s (sockets:udp-open \"127.0.0.1\"))
  (sockets:udp-send s \"127.0.0.1\" {port} \"häl\")
  (print (equalp (multiple-value-list (sockets:udp-receive s)) '(#(0 255 4) \"127.0.0.1\" {port})))
  (sockets:udp-send s \"127.0.0.1\" (sockets:local-port s) #(1 2))
  (print (sockets:udp-receive s))
  (print (handler-case (with-timeout 0.05 (sockets:udp-receive s)) (failure (f) (failure-cause f)))))"
    );
    check("sockets-udp", &text, &["--allow-net"], &["T", "#(1 2)", ":TIMEOUT"]);
    answer.join().expect("the peer does not fail");
}

#[cfg(unix)]
#[test]
fn two_programs_talk_by_datagrams_and_over_a_unix_socket() {
    let server = "(require :sockets)
(sockets:with-socket (s (sockets:udp-open \"127.0.0.1\"))
  (sockets:with-socket (l (sockets:listen-unix \"talk\"))
    (format t \"~d~%\" (sockets:local-port s))
    (finish-output)
    (multiple-value-bind (bytes host port) (sockets:udp-receive s)
      (sockets:udp-send s host port (reverse bytes)))
    (sockets:with-socket (c (sockets:accept l))
      (loop for line = (read-line c nil nil)
            while line do (format c \"~a!~%\" line)))))";
    let client = "(require :sockets)
(defvar *port* (parse-integer (first (command-line-arguments))))
(sockets:with-socket (s (sockets:udp-open \"127.0.0.1\"))
  (sockets:udp-send s \"127.0.0.1\" *port* #(1 2 255))
  (print (sockets:udp-receive s)))
(sockets:with-socket (c (sockets:connect-unix \"talk\"))
  (dotimes (i 3) (format c \"zeile ~d ü~%\" i) (print (read-line c))))";
    let folder = Folder::with("sockets-two", &[("server.esl", server), ("client.esl", client)]);
    let mut server =
        process::start(eslvm(&["run", "--allow-net=127.0.0.1", "server.esl"]).current_dir(folder.path()));
    let mut port = String::new();
    let output = server.stdout.take().expect("it is a pipe");
    BufReader::new(output).read_line(&mut port).expect("the port is printed");
    let mut client = eslvm(&["run", "--allow-net=127.0.0.1", "client.esl", port.trim()]);
    let done = process::run(client.current_dir(folder.path()), "");
    let ended = process::finish(server);
    let lines: Vec<&str> = done.output.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    let expected = ["#(255 2 1)", "\"zeile 0 ü!\"", "\"zeile 1 ü!\"", "\"zeile 2 ü!\""];
    assert_eq!((lines, &*done.errors), (expected.to_vec(), ""));
    assert_eq!((ended.status, &*ended.errors), (Some(0), ""));
}

#[test]
fn a_server_serves_no_more_at_a_time_than_it_is_told_to() {
    let text = "(require :sockets)
(define-fluent *served* 0)
(define-fluent *goes-on* nil)
(let ((listener (sockets:listen \"127.0.0.1\" 0)) (answers 0))
  (spawn (:daemon t)
    (sockets::serve listener 2 (lambda (c)
                                 (incf *served*)
                                 (wait-until *goes-on*)
                                 (write-line (read-line c) c))))
  (let ((asking (loop repeat 5
                      collect (spawn (sockets:with-socket (c (sockets:connect \"127.0.0.1\" (sockets:local-port listener)))
                                       (write-line \"hello\" c)
                                       (when (equal (read-line c) \"hello\") (incf answers)))))))
    (wait-until (= *served* 2))
    ;; Time for those that should not be served.
    (sleep 0.05)
    (print *served*)
    (setq *goes-on* t)
    (mapc #'wait-for-task asking)
    (print (list *served* answers))))";
    check("sockets-limit", text, &["--allow-net"], &["2", "(5 5)"]);
}

#[test]
fn a_server_has_a_limit_and_its_port_is_free_when_it_is_left() {
    let text = "(require :sockets)
(define-fluent *served* 0)
(define-fluent *goes-on* nil)
(defmacro cause (form) `(handler-case ,form (failure (f) (failure-cause f))))
(let* ((port (sockets:with-socket (l (sockets:listen \"127.0.0.1\" 0)) (sockets:local-port l)))
       (server (spawn (:daemon t)
                 (sockets:with-server ((c \"127.0.0.1\" port) :limit 1)
                   (incf *served*)
                   (wait-until *goes-on*)
                   (write-line \"done\" c)))))
  (flet ((connect ()
           (loop for c = (cause (sockets:connect \"127.0.0.1\" port))
                 until (streamp c) do (sleep 0.01)
                 finally (return c))))
    (let ((one (connect)) (other (connect)))
      (wait-until (= *served* 1))
      ;; Time for the one that should not be served.
      (sleep 0.05)
      (print *served*)
      (setq *goes-on* t)
      (print (list (read-line one) (read-line one nil :closed) (read-line other)))))
  (abort-task server)
  (wait-for-task server)
  (print (cause (sockets:connect \"127.0.0.1\" port))))";
    let expected = ["1", "(\"done\" :CLOSED \"done\")", ":CONNECTION-REFUSED"];
    check("sockets-with-server", text, &["--allow-net=127.0.0.1"], &expected);
}

#[cfg(target_os = "linux")]
#[test]
fn a_connection_that_nobody_answers_ends_in_time() {
    // A listener whose queue is full lets others wait.
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port is free");
    let address = listener.local_addr().expect("it is bound");
    let patience = std::time::Duration::from_millis(200);
    let queue: Vec<TcpStream> =
        std::iter::from_fn(|| TcpStream::connect_timeout(&address, patience).ok()).take(10_000).collect();
    assert!(queue.len() < 10_000, "the queue is never full");
    let text = format!(
        "(require :sockets)
(print (handler-case (sockets:connect \"127.0.0.1\" {} :timeout 0.1)
         (failure (f) (failure-cause f))))",
        address.port()
    );
    check("sockets-no-answer", &text, &["--allow-net"], &[":TIMEOUT"]);
}

#[cfg(unix)]
#[test]
fn a_thousand_connections_are_served_by_one_program() {
    // They come at one moment, and all are open before the first is answered.
    let server = "(require :sockets)
(let ((listener (sockets:listen \"127.0.0.1\" 0)) (served 0) (all (make-event 'all)))
  (format t \"~a~%\" (sockets:local-port listener))
  (finish-output)
  (sockets::serve listener nil
    (lambda (c)
      (format c \"hello~%\")
      (let ((line (read-line c)))
        (incf served)
        (signal all)
        (wait-until (>= served 1000) :on all)
        (format c \"~a~%\" line)))))";
    let folder = Folder::with("sockets-thousand", &[("server.esl", server)]);
    // The limit that many systems begin with is not a limit for it.
    let mut limited = Command::new("sh");
    limited.args(["-c", "ulimit -Sn 256 && exec \"$0\" run --allow-net server.esl", crate::ESLVM]);
    let mut server = process::start(limited.current_dir(folder.path()));
    let mut port = String::new();
    let output = server.stdout.take().expect("it is a pipe");
    BufReader::new(output).read_line(&mut port).expect("the port is printed");
    let client = format!(
        "(require :sockets)
(defun ask (number)
  (sockets:with-socket (c (sockets:connect \"127.0.0.1\" {}))
    (read-line c)
    (format c \"~a~%\" number)
    (if (equal (read-line c) (format nil \"~a\" number)) 1 0)))
(print (let ((tasks (loop for i below 1000 collect (let ((i i)) (spawn (ask i))))))
         (loop for task in tasks sum (nth-value 1 (wait-for-task task)))))",
        port.trim()
    );
    let path = folder.file("client.esl", client);
    let mut client = process::start(&mut eslvm(&["run", "--allow-net", &path]));
    drop(client.stdin.take());
    let done = process::finish_within(client, std::time::Duration::from_secs(600));
    server.kill().expect("it runs");
    server.wait().expect("it ends");
    assert_eq!((done.output.trim(), &*done.errors), ("1000", ""));
}

/// Has a peer do something with a connection, and returns its port.
fn peer<T: Send + 'static>(
    what: impl FnOnce(TcpStream) -> T + Send + 'static,
) -> (u16, std::thread::JoinHandle<T>) {
    let listener = TcpListener::bind("127.0.0.1:0").expect("there is a port");
    let port = listener.local_addr().expect("it has an address").port();
    (port, std::thread::spawn(move || what(listener.accept().expect("somebody connects").0)))
}

#[test]
fn a_peer_that_closes_half_way_can_be_answered() {
    let (port, peer) = peer(|mut stream| {
        stream.write_all(b"question\nhal").expect("it can be sent");
        stream.shutdown(std::net::Shutdown::Write).expect("the end can be sent");
        let mut answer = String::new();
        stream.read_to_string(&mut answer).expect("it answers");
        assert_eq!(answer, "answer\n");
    });
    let text = format!(
        "(require :sockets)
(sockets:with-socket (c (sockets:connect \"127.0.0.1\" {port}))
  (print (list (read-line c) (multiple-value-list (read-line c)) (read-line c nil 'end)))
  (format c \"answer~%\"))"
    );
    check("sockets-half", &text, &["--allow-net"], &["(\"question\" (\"hal\" T) END)"]);
    peer.join().expect("the peer has its answer");
}

#[test]
fn of_many_who_wait_for_a_connection_none_is_forgotten() {
    // Some are left, the others are told when something comes, and when the connection is closed.
    let text = "(require :sockets)
(defvar *told* 0)
(defvar *closed* 0)
(let ((listener (sockets:listen \"127.0.0.1\" 0)))
  (sockets:with-socket (connection (sockets:connect \"127.0.0.1\" (sockets:local-port listener)))
    (let ((peer (sockets:accept listener)) (number (sockets::handle-of connection)))
      (flet ((wait-many ()
               (let ((waiting (loop repeat 200 collect (start (sockets::%socket-await number)))))
                 (sleep 0.01)
                 (loop for handle in waiting for i from 0 when (evenp i) do (cancel handle))
                 waiting)))
        (let ((waiting (wait-many)))
          (write-line \"one\" peer)
          (finish-output peer)
          (loop for handle in (rest waiting) by #'cddr do (operation-result handle) (incf *told*)))
        (print (list *told* (read-line connection)))
        (let ((waiting (wait-many)))
          (close connection)
          (loop for handle in (rest waiting) by #'cddr
                do (handler-case (operation-result handle)
                     (failure (f) (when (eq (failure-cause f) :socket-closed) (incf *closed*)))))))
      (print *closed*))))";
    check("sockets-many-wait", text, &["--allow-net"], &["(100 \"one\")", "100"]);
}

#[test]
fn connections_that_nobody_takes_end_with_their_listener() {
    let text = "(require :sockets)
(let ((listener (sockets:listen \"127.0.0.1\" 0)))
  (format t \"~a~%\" (sockets:local-port listener))
  (finish-output)
  (let ((first (sockets:accept listener)))
    (read-line first)
    ;; As by a call that is left at the moment at which the second one comes.
    (sockets::%socket-accept (sockets::handle-of listener))
    (close listener)
    (write-line \"closed\" first)
    (finish-output first)
    (read-line first nil nil)))";
    let folder = Folder::with("sockets-untaken", &[("main.esl", text)]);
    let mut child = process::start(eslvm(&["run", "--allow-net", "main.esl"]).current_dir(folder.path()));
    let mut port = String::new();
    let output = child.stdout.take().expect("it is a pipe");
    BufReader::new(output).read_line(&mut port).expect("the port is printed");
    let port: u16 = port.trim().parse().expect("it is a port");
    let mut first = TcpStream::connect(("127.0.0.1", port)).expect("it listens");
    let mut second = TcpStream::connect(("127.0.0.1", port)).expect("it listens");
    let (sender, receiver) = std::sync::mpsc::channel();
    std::thread::spawn(move || sender.send(second.read(&mut [0; 8]).unwrap_or(0)));
    first.write_all(b"go\n").expect("it is read");
    let mut line = String::new();
    BufReader::new(&first).read_line(&mut line).expect("it answers");
    let left = receiver.recv_timeout(std::time::Duration::from_secs(60));
    assert_eq!((&*line, left), ("closed\n", Ok(0)), "the second one is closed while the program goes on");
    drop(first);
    let done = process::finish_within(child, std::time::Duration::from_secs(60));
    assert_eq!((done.status, &*done.errors), (Some(0), ""));
}

#[test]
fn a_line_without_an_end_fails() {
    // Also where the line ends in time, much as it is.
    let (port, peer) = peer(|mut stream| {
        let piece = [b'x'; 1 << 16];
        for _ in 0..3 {
            stream.write_all(&piece).expect("it can be sent");
        }
        stream.write_all(b"\n").expect("it can be sent");
        while stream.write_all(&piece).is_ok() {}
    });
    let text = format!(
        "(require :sockets)
(sockets:with-socket (c (sockets:connect \"127.0.0.1\" {port}))
  (print (length (read-line c)))
  (print (handler-case (read-line c) (failure (f) (failure-cause f)))))"
    );
    check("sockets-endless", &text, &["--allow-net", "--memory", "400M"], &["196608", ":LINE-TOO-LONG"]);
    peer.join().expect("the connection is closed");
}

#[test]
fn bytes_and_text_take_turns_on_a_connection() {
    let text = "(require :sockets)
(defun bytes (&rest list) (make-array (length list) :element-type '(unsigned-byte 8) :initial-contents list))
(sockets:with-socket (listener (sockets:listen \"127.0.0.1\" 0))
  (spawn (:name 'other)
    (sockets:with-socket (c (sockets:accept listener))
      (format c \"sïze 300~%\")
      (write-sequence (apply #'bytes (loop for i below 300 collect (mod i 256))) c)
      (write-byte 254 c)
      (format c \"ënd~%\")
      (finish-output c)
      (write-sequence (vector 1 195 2) c)
      (format c \"plain~%lines~%\")
      (write-sequence (vector 65 66 10 200 7) c)
      (read-line c nil nil)))
  (sockets:with-socket (c (sockets:connect \"127.0.0.1\" (sockets:local-port listener)))
    (let ((data (make-array 300 :element-type '(unsigned-byte 8))))
      (print (list (read-line c) (read-sequence data c)))
      (print (loop for i below 300 always (= (aref data i) (mod i 256))))
      (print (list (read-byte c) (read-line c) (read-byte c) (read-byte c) (read-byte c)))
      ;; Lines that were read ahead are bytes again.
      (let ((data (make-array 11)))
        (print (list (read-line c) (read-sequence data c) data)))
      (terpri c)
      (finish-output c)
      (print (list (read-byte c nil :end) (read-sequence data c :start 2))))
    (print (handler-case (write-byte 256 c) (type-error () 'refused)))))";
    let expected = [
        "(\"sïze 300\" 300)",
        "T",
        "(254 \"ënd\" 1 195 2)",
        "(\"plain\" 11 #(108 105 110 101 115 10 65 66 10 200 7))",
        "(:END 2)",
        "REFUSED",
    ];
    check("sockets-bytes", text, &["--allow-net=127.0.0.1"], &expected);
}

#[test]
fn texts_of_several_tasks_are_not_mixed_when_the_peer_is_slow() {
    let (port, peer) = peer(|stream| {
        // The system has room for a part of what is sent only.
        std::thread::sleep(std::time::Duration::from_millis(200));
        let mut counts = [0; 8];
        for line in BufReader::new(stream).lines() {
            let line = line.expect("it is text");
            let digit = line.as_bytes()[0];
            assert!(line.bytes().all(|byte| byte == digit), "a line has parts of several");
            assert_eq!(line.len(), 50_000);
            counts[usize::from(digit - b'0')] += 1;
        }
        counts
    });
    let text = format!(
        "(require :sockets)
(sockets:with-socket (c (sockets:connect \"127.0.0.1\" {port}))
  (let ((number (sockets::handle-of c)))
    (mapc #'wait-for-task
          (loop for i below 8
                collect (let ((line (format nil \"~a~%\" (make-string 50000 :initial-element (digit-char i)))))
                          (spawn (dotimes (i 40) (sockets::send number line))))))
    (print 'sent)))"
    );
    check("sockets-mixed", &text, &["--allow-net", "--slice", "1"], &["SENT"]);
    assert_eq!(peer.join().expect("no line is mixed"), [40; 8]);
}
