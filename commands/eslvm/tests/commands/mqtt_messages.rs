//! Which messages a client of MQTT sends, and which it hands out.
#![cfg(unix)]

use std::io::Write;
use std::net::TcpListener;

use esl_conformance::folder::Folder;
use esl_conformance::process;

use crate::eslvm;
use crate::mqtt::{printed_by, read_packet, with_broker};

/// Topics that begin with `$` are for filters that say so. Messages that the protocol does not allow are not
/// sent.
#[test]
fn wildcards_leave_out_the_topics_of_the_broker() {
    let Some((folder, _broker, port)) = with_broker("mqtt-topics", "") else { return };
    let text = "(require :mqtt)
(defmacro fault (form)
  `(print (handler-case (progn ,form :sent)
            (type-error (e) (list (type-error-datum e) (type-error-expected-type e)))
            (failure (f) (cons (failure-cause f) (failure-arguments f))))))
(defvar *port* (parse-integer (first (command-line-arguments))))
(defun next (input) (subseq (multiple-value-list (wait-for-event input)) 0 2))
(mqtt:with-client (c \"127.0.0.1\" *port*)
  (let ((all (mqtt:subscribe c \"#\")) (second (mqtt:subscribe c \"+/broker/#\"))
        (system (mqtt:subscribe c \"$SYS/broker/version\")) (any (mqtt:subscribe c \"$SYS/+/version\"))
        (shared (mqtt:subscribe c \"$share/group/shared/+\" :qos 1)))
    (print (list (first (next system)) (first (next any))))
    (mqtt:publish c \"a/broker/x\" \"1\" :qos 1)
    (mqtt:publish c \"/\" \"2\" :qos 1)
    (print (list (next all) (next all) (next second)))
    (mqtt:publish c \"shared/a\" \"3\" :qos 1)
    (print (next shared))
    (let ((longest (make-string 32767 :initial-element #\\ä)))
      (fault (mqtt:publish c (format nil \"~aa\" longest) \"longest\" :qos 1))
      (fault (mqtt:publish c (format nil \"~aä\" longest) \"x\"))
      (fault (mqtt:subscribe c (format nil \"~aä\" longest))))
    (fault (mqtt:publish c \"\" \"x\"))
    (fault (mqtt:publish c (format nil \"a~cb\" (code-char 0)) \"x\" :qos 1))
    (fault (mqtt:publish c \"a/#\" \"x\"))
    (fault (mqtt:subscribe c \"\"))
    (fault (mqtt:subscribe c \"a/b#\"))
    (fault (mqtt:subscribe c \"$share/a\"))
    (fault (mqtt:publish c \"a\" (make-string 16777216 :initial-element #\\a)))
    (dolist (bytes (list (vector 1 256) (vector -1) (vector 1.5) (vector #\\a) (vector nil) '(1 2)))
      (fault (mqtt:publish c \"a\" bytes)))
    ;; None of them has ended the connection.
    (let ((bytes (mqtt:subscribe c \"b\" :bytes t)))
      (mqtt:publish c \"b\" #(0 255) :qos 1)
      (print (next bytes)))
    (print (mqtt:problem c))))
(defmacro try (&rest options) `(fault (mqtt:with-client (c \"127.0.0.1\" *port* ,@options) c)))
(try :will '(\"a/+\" \"x\"))
(try :will '(\"\" \"x\"))
(try :will (list \"a\" (make-string 65536 :initial-element #\\a)))
(try :will (list \"a\" (vector 1 300)))
(try :id (string (code-char 0)))
(try :user (make-string 65536 :initial-element #\\a))
(try :user \"a\" :password (make-string 65536 :initial-element #\\a))";
    let lines = printed_by(&folder, text, port);
    let expected = [
        "(\"$SYS/broker/version\" \"$SYS/broker/version\")",
        "((\"a/broker/x\" \"1\") (\"/\" \"2\") (\"a/broker/x\" \"1\"))",
        "(\"shared/a\" \"3\")",
        ":SENT",
        "(:MQTT-ERROR \"the topic has 65536 bytes: at most 65535 fit in a packet\")",
        "(:MQTT-ERROR \"the topic filter has 65536 bytes: at most 65535 fit in a packet\")",
        "(:MQTT-ERROR \"the topic is empty\")",
        "(:MQTT-ERROR \"the topic holds the character U+0000\")",
        "(:MQTT-ERROR \"`a/#` is not a topic: `#` is allowed in filters only\")",
        "(:MQTT-ERROR \"the topic filter is empty\")",
        "(:MQTT-ERROR \"`a/b#` is not a valid topic filter: `+` and `#` stand for whole levels\")",
        "(:MQTT-ERROR \"`$share/a` is not a valid topic filter: expected `$share/GROUP/FILTER`\")",
        "(:MQTT-ERROR \"the payload has 16777216 bytes: at most 16777206 are sent\")",
        "(256 (UNSIGNED-BYTE 8))",
        "(-1 (UNSIGNED-BYTE 8))",
        "(1.5 (UNSIGNED-BYTE 8))",
        "(#\\a (UNSIGNED-BYTE 8))",
        "(NIL (UNSIGNED-BYTE 8))",
        "((1 2) VECTOR)",
        "(\"b\" #(0 255))",
        "NIL",
        "(:MQTT-ERROR \"`a/+` is not a topic: `+` is allowed in filters only\")",
        "(:MQTT-ERROR \"the topic is empty\")",
        "(:MQTT-ERROR \"the payload of the last will has 65536 bytes: at most 65535 fit in a packet\")",
        "(300 (UNSIGNED-BYTE 8))",
        "(:MQTT-ERROR \"the name of the client holds the character U+0000\")",
        "(:MQTT-ERROR \"the user has 65536 bytes: at most 65535 fit in a packet\")",
        "(:MQTT-ERROR \"the password has 65536 bytes: at most 65535 fit in a packet\")",
    ];
    assert_eq!(lines, expected);
}

/// A broker may send a message of level 2 again before it releases it. One that has the same number after
/// that is another message.
#[test]
fn a_message_of_level_2_that_is_repeated_is_delivered_once() {
    let listener = TcpListener::bind("127.0.0.1:0").expect("there is a port");
    let port = listener.local_addr().expect("it has an address").port().to_string();
    let broker = std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().expect("a client comes");
        let (mut packets, mut is_released) = (Vec::new(), false);
        while let Some((first, rest)) = read_packet(&mut stream) {
            let answer: Vec<u8> = match first {
                0x10 => b"\x20\x02\0\0".to_vec(),
                // The message 7, again, another one, the first once more, then its release.
                0x82 => [
                    &b"\x90\x03"[..],
                    &rest[..2],
                    b"\x02\x34\x06\0\x01a\0\x07A\x3c\x06\0\x01a\0\x07A",
                    b"\x34\x06\0\x01a\0\x08B\x3c\x06\0\x01a\0\x07A\x62\x02\0\x07",
                ]
                .concat(),
                // After the release comes another message 7, and one of level 0.
                0x70 if !is_released => {
                    is_released = true;
                    b"\x34\x06\0\x01a\0\x07C\x30\x04\0\x01aD".to_vec()
                }
                _ => Vec::new(),
            };
            // The client may have gone.
            drop(stream.write_all(&answer));
            packets.push((first, rest));
        }
        packets
    });
    let text = "(require :mqtt)
(mqtt:with-client (c \"127.0.0.1\" (parse-integer (first (command-line-arguments))) :id \"x\")
  (let ((input (mqtt:subscribe c \"a\" :qos 2 :capacity 10)))
    (print (loop for payload = (second (multiple-value-list (wait-for-event input)))
                 collect payload until (equal payload \"D\")))))";
    let folder = Folder::with("mqtt-repeated", &[("main.esl", text)]);
    let mut command = eslvm(&["run", "--allow-net=127.0.0.1", "main.esl", &port]);
    let output = process::run(command.current_dir(folder.path()), "").quiet_output();
    assert_eq!(output.expect("nothing is wrong").trim(), "(\"A\" \"B\" \"C\" \"D\")");
    let packets = broker.join().expect("it does not panic");
    // Each is received, and the release is answered.
    let answers: Vec<(u8, u8)> =
        packets[2..].iter().filter_map(|(first, rest)| Some((*first, *rest.get(1)?))).collect();
    assert_eq!(answers, [(0x50, 7), (0x50, 7), (0x50, 8), (0x50, 7), (0x70, 7), (0x50, 7)]);
}

/// A client that does not read on, since its program takes nothing, still says that it is there; and the
/// program can publish, though what acknowledges that comes behind the messages that it has not taken.
#[test]
fn messages_that_nobody_takes_hold_up_neither_the_connection_nor_publishing() {
    let Some((folder, _broker, port)) = with_broker("mqtt-full", "max_queued_messages 0\n") else { return };
    let text = "(require :mqtt)
(defvar *port* (parse-integer (first (command-line-arguments))))
(mqtt:with-client (c \"127.0.0.1\" *port* :keep-alive 1 :will '(\"lost\" \"c\"))
  (mqtt:with-client (d \"127.0.0.1\" *port*)
    (let ((in (mqtt:subscribe c \"in\" :capacity 1 :when-full :wait))
          (out (mqtt:subscribe d \"out\" :capacity 5000)) (lost (mqtt:subscribe d \"lost\")))
      (dotimes (i 3000) (mqtt:publish d \"in\" (princ-to-string i)))
      (mqtt:publish d \"other\" \"\" :qos 1)
      ;; More than the broker waits for a sign of life.
      (print (handler-case (with-timeout 4 (wait-for-event lost)) (failure (f) (failure-cause f))))
      (print (mqtt:problem c))
      (dotimes (i 3000)
        (mqtt:publish c \"out\" (nth-value 1 (wait-for-event in)) :qos (mod i 3)))
      (print (loop for i below 3000
                   always (equal (nth-value 1 (wait-for-event out)) (princ-to-string i)))))))";
    folder.file("main.esl", text);
    let port = port.to_string();
    let mut command = eslvm(&["run", "--allow-net=127.0.0.1", "main.esl", &port]);
    let output = process::run(command.current_dir(folder.path()), "").quiet_output();
    assert_eq!(
        output.expect("nothing is wrong").split_whitespace().collect::<Vec<_>>(),
        [":TIMEOUT", "NIL", "T"]
    );
}
