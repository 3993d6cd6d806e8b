//! MQTT against a broker, if there is one on this machine.
#![cfg(unix)]

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use esl_conformance::folder::Folder;
use esl_conformance::process;

use crate::eslvm;

/// A broker, which ends with this.
pub(crate) struct Broker(Child);

impl Drop for Broker {
    fn drop(&mut self) {
        drop(self.0.kill());
        drop(self.0.wait());
    }
}

fn broker_program() -> Option<&'static str> {
    let is_there = |name: &&str| Command::new(name).arg("-h").output().is_ok();
    ["mosquitto", "/usr/sbin/mosquitto"].into_iter().find(is_there)
}

/// Begins a test with a broker of its own, with more settings: its folder, the broker, and its port. `None`,
/// after saying so, if this machine has no broker.
pub(crate) fn with_broker(test: &str, more: &str) -> Option<(Folder, Broker, u16)> {
    let Some(program) = broker_program() else {
        crate::say_left_out("it needs `mosquitto`");
        return None;
    };
    let folder = Folder::new(test);
    let (broker, port) = start_broker(program, &folder, more);
    Some((folder, broker, port))
}

/// Starts a broker on a free port of the loopback, and waits until it listens.
fn start_broker(program: &str, folder: &Folder, more: &str) -> (Broker, u16) {
    for _ in 0..20 {
        // The port is free until another process takes it, in which case the broker ends.
        let port = TcpListener::bind("127.0.0.1:0").and_then(|listener| listener.local_addr());
        let port = port.expect("there is a free port").port();
        if let Some(broker) = start_at(program, folder, more, port) {
            return (broker, port);
        }
    }
    panic!("no broker could be started");
}

/// Starts a broker again where another one has listened.
pub(crate) fn start_broker_at(folder: &Folder, port: u16) -> Broker {
    let program = broker_program().expect("there was one");
    start_at(program, folder, "", port).expect("the port is free again")
}

/// Starts a broker on a port of the loopback, and waits until it listens; `None` if it ends before.
fn start_at(program: &str, folder: &Folder, more: &str, port: u16) -> Option<Broker> {
    let settings = format!("listener {port} 127.0.0.1\nallow_anonymous true\npersistence false\n{more}");
    let settings = folder.file("broker.conf", settings);
    let child = Command::new(program)
        .args(["-c", &settings])
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
    let mut broker = Broker(child.expect("the broker can be started"));
    let begun = Instant::now();
    while begun.elapsed() < Duration::from_secs(60) && broker.0.try_wait().is_ok_and(|end| end.is_none()) {
        if TcpStream::connect(("127.0.0.1", port)).is_ok() {
            return Some(broker);
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    None
}

/// Returns the lines that a program prints, which may reach a broker and is given its port.
pub(crate) fn printed_by(folder: &Folder, program: &str, port: u16) -> Vec<String> {
    folder.file("main.esl", program);
    let port = port.to_string();
    let mut command = eslvm(&["run", "--allow-net=127.0.0.1", "main.esl", &port]);
    let run = process::run(command.current_dir(folder.path()), "");
    let output = run.quiet_output().expect("nothing is wrong");
    output.lines().map(str::trim).filter(|line| !line.is_empty()).map(str::to_owned).collect()
}

#[test]
fn messages_go_through_a_broker() {
    let Some((folder, _broker, port)) = with_broker("mqtt", "") else { return };
    let text = "(require :mqtt)
(defmacro cause (form) `(print (handler-case ,form (failure (f) (failure-cause f)))))
(defvar *port* (parse-integer (first (command-line-arguments))))
(defun next (input) (multiple-value-list (wait-for-event input)))
(mqtt:with-client (a \"127.0.0.1\" *port* :will '(\"left/a\" \"gone\"))
  (let ((all (mqtt:subscribe a \"robot/+/state\" :qos 1 :capacity 1000 :when-full :wait))
        (raw (mqtt:subscribe a \"robot/#\" :bytes t))
        (wills (mqtt:subscribe a \"left/+\")))
    (mqtt:with-client (b \"127.0.0.1\" *port* :id \"b\")
      (mqtt:publish b \"robot/1/state\" \"fährt\" :qos 1)
      (print (next all))
      (print (next raw))
      (mqtt:publish b \"robot/1/other\" (vector 0 255) :qos 2)
      (print (next raw))
      (mqtt:publish b \"robot/2/state\" \"kept\" :retain t)
      (print (next all))
      (print (mqtt:problem b)))
    (print (next raw))
    (mqtt:with-client (c \"127.0.0.1\" *port*)
      (print (next (mqtt:subscribe c \"robot/2/#\"))))
    (print (handler-case (with-timeout 0.01 (next wills)) (failure (f) (failure-cause f))))
    (dotimes (i 500) (mqtt:publish a \"robot/3/state\" (princ-to-string i)))
    (print (loop for i below 500 always (equal (second (next all)) (princ-to-string i))))
    (cause (mqtt:publish a \"robot/+\" \"x\"))))
(cause (mqtt:with-client (c \"127.0.0.1\" 1) c))
(cause (mqtt:with-client (c \"localhost\" 1883) c))";
    let lines = printed_by(&folder, text, port);
    let expected = [
        "(\"robot/1/state\" \"fährt\" NIL)",
        "(\"robot/1/state\" #(102 195 164 104 114 116) NIL)",
        "(\"robot/1/other\" #(0 255) NIL)",
        "(\"robot/2/state\" \"kept\" NIL)",
        "NIL",
        "(\"robot/2/state\" #(107 101 112 116) NIL)",
        "(\"robot/2/state\" \"kept\" T)",
        ":TIMEOUT",
        "T",
        ":MQTT-ERROR",
        ":CONNECTION-REFUSED",
        ":PERMISSION-DENIED",
    ];
    assert_eq!(lines, expected);
}

/// Starts a peer that takes connections, and answers the first packet of each with `answer` and the second
/// one with `next`; then it closes the connection, or says no more if it `stays`.
fn start_peer(answer: &'static [u8], next: &'static [u8], stays: bool) -> u16 {
    let listener = TcpListener::bind("127.0.0.1:0").expect("there is a port");
    let port = listener.local_addr().expect("it has an address").port();
    std::thread::spawn(move || {
        for mut stream in listener.incoming().flatten() {
            std::thread::spawn(move || {
                let mut bytes = [0; 1000];
                for text in [answer, next] {
                    if text.is_empty() && !stays {
                        return;
                    }
                    // It may have gone.
                    drop(stream.read(&mut bytes));
                    drop(stream.write_all(text));
                }
                while stays && stream.read(&mut bytes).is_ok_and(|count| count > 0) {}
            });
        }
    });
    port
}

/// A peer's first and second answer, whether it stays, the seconds that opening a client and subscribing may
/// take, and the expected output.
type PeerCase = (&'static [u8], &'static [u8], bool, (&'static str, &'static str), &'static str);

/// Reads a packet: its first byte, and what follows its length. Returns nothing at the end.
pub(crate) fn read_packet(stream: &mut TcpStream) -> Option<(u8, Vec<u8>)> {
    let mut byte = [0];
    stream.read_exact(&mut byte).ok()?;
    let first = byte[0];
    let mut length = 0;
    for shift in (0..28).step_by(7) {
        stream.read_exact(&mut byte).ok()?;
        length |= usize::from(byte[0] & 127) << shift;
        if byte[0] < 128 {
            break;
        }
    }
    let mut rest = vec![0; length];
    stream.read_exact(&mut rest).ok()?;
    Some((first, rest))
}

/// Each option reaches the broker as the protocol has it, and each answer the program.
#[test]
fn a_client_says_what_its_options_say() {
    let listener = TcpListener::bind("127.0.0.1:0").expect("there is a port");
    let port = listener.local_addr().expect("it has an address").port().to_string();
    // For each packet that comes in: what follows its number, the answer before the number, and what is sent
    // after the number.
    let broker = std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().expect("a client comes");
        let mut packets = Vec::new();
        while let Some((first, rest)) = read_packet(&mut stream) {
            let number = |at: usize| rest.get(at..at + 2).unwrap_or_default().to_vec();
            let answer: Vec<u8> = match (first, packets.len()) {
                (0x10, _) => b"\x20\x02\x00\x00".to_vec(),
                // The first subscription is refused, the others granted.
                (0x82, 1) => [&b"\x90\x03"[..], &number(0), b"\x80"].concat(),
                (0x82, _) => [&b"\x90\x03"[..], &number(0), b"\x01"].concat(),
                // Before the acknowledgement come four messages of which two have room, and one of another
                // topic.
                (0x33, _) => {
                    let texts = ["1", "2", "3", "4"]
                        .map(|text| [&b"\x30\x04\x00\x01a"[..], text.as_bytes()].concat());
                    [&texts.concat()[..], b"\x30\x04\x00\x01bz\x40\x02", &number(3)].concat()
                }
                (0x34, _) => [&b"\x50\x02"[..], &number(3)].concat(),
                (0x62, _) => [&b"\x70\x02"[..], &number(0)].concat(),
                _ => Vec::new(),
            };
            // The client may have gone.
            drop(stream.write_all(&answer));
            packets.push((first, rest));
        }
        packets
    });
    let text = "(require :mqtt)
(handler-case
    (mqtt:with-client (c \"127.0.0.1\" (parse-integer (first (command-line-arguments)))
                         :id \"rover\" :keep-alive 77 :user \"me\" :password \"word\"
                         :will (list \"w\" (vector 0 200) :qos 2 :retain t))
      (print (handler-case (mqtt:subscribe c \"x\") (failure (f) (failure-cause f))))
      (let ((a (mqtt:subscribe c \"a\" :qos 1 :capacity 2 :when-full :drop-newest))
            (b (mqtt:subscribe c \"b\" :qos 2)))
        (mqtt:publish c \"t\" (vector 1 255) :qos 1 :retain t)
        (mqtt:publish c \"t\" \"é\" :qos 2)
        (mqtt:publish c \"t\" \"\")
        (print (multiple-value-list (wait-for-event b)))
        (dotimes (i 2) (print (multiple-value-list (wait-for-event a))))
        (fail :general-failure)))
  (failure (f) (print (failure-cause f))))";
    let folder = Folder::with("mqtt-options", &[("main.esl", text)]);
    let mut command = eslvm(&["run", "--allow-net=127.0.0.1", "main.esl", &port]);
    let output = process::run(command.current_dir(folder.path()), "").quiet_output();
    let output = output.expect("nothing is wrong");
    let lines: Vec<&str> = output.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    let expected =
        [":MQTT-ERROR", "(\"b\" \"z\" NIL)", "(\"a\" \"1\" NIL)", "(\"a\" \"2\" NIL)", ":GENERAL-FAILURE"];
    assert_eq!(lines, expected);
    let packets = broker.join().expect("it does not panic");
    // User, password, a will that is kept at level 2, and no session from before.
    let connect = b"\0\x04MQTT\x04\xf6\0\x4d\0\x05rover\0\x01w\0\x02\0\xc8\0\x02me\0\x04word";
    let expected: [(u8, &[u8]); 9] = [
        (0x10, connect),
        (0x82, b"\0\x01\0\x01x\0"),
        (0x82, b"\0\x02\0\x01a\x01"),
        (0x82, b"\0\x03\0\x01b\x02"),
        (0x33, b"\0\x01t\0\x04\x01\xff"),
        (0x34, "\0\x01t\0\x05é".as_bytes()),
        (0x62, b"\0\x05"),
        (0x30, b"\0\x01t"),
        (0xe0, b""),
    ];
    let expected = expected.map(|(first, rest)| (first, rest.to_vec()));
    assert_eq!(packets, expected);
}

/// Peers that are not brokers, or stop being one, lead to failures with causes; nothing hangs.
#[test]
fn a_broker_may_send_anything_or_nothing() {
    const WELCOME: &[u8] = b"\x20\x02\x00\x00";
    // Only where nothing is ever answered is the time short.
    let peers: [PeerCase; 10] = [
        (b"", b"", false, ("60", "60"), "(:OPEN :MQTT-ERROR)"),
        (b"\x20\x02", b"", false, ("60", "60"), "(:OPEN :MQTT-ERROR)"),
        (b"\xff\xfe\x80\x80\x80\x80\x80", b"", true, ("60", "60"), "(:OPEN :MQTT-ERROR)"),
        (b"HTTP/1.1 400 Bad Request\r\n\r\n", b"", false, ("60", "60"), "(:OPEN :MQTT-ERROR)"),
        (b"\x20\x02\x00\x05", b"", true, ("60", "60"), "(:OPEN :MQTT-ERROR)"),
        (b"", b"", true, ("1/5", "60"), "(:OPEN :TIMEOUT)"),
        // Half a message, one that is too long, one whose topic is not text.
        (WELCOME, b"\x30\x64\x00\x03a/b", false, ("60", "60"), "(:SUBSCRIBE :CONNECTION-LOST)"),
        (WELCOME, b"\x30\xff\xff\xff\x7f\x00\x01a", true, ("60", "60"), "(:SUBSCRIBE :CONNECTION-LOST)"),
        (WELCOME, b"\x30\x05\x00\x02\xff\xfex", true, ("60", "60"), "(:SUBSCRIBE :CONNECTION-LOST)"),
        // The answer to another question.
        (WELCOME, b"\x90\x03\x77\x77\x00", true, ("60", "1/5"), "(:SUBSCRIBE :TIMEOUT)"),
    ];
    let text = "(require :mqtt)
(defvar *opened* nil)
(defun try (port to-open to-subscribe)
  (setq *opened* nil)
  (handler-case
      (with-timeout to-open
        (mqtt:with-client (c \"127.0.0.1\" port)
          (setq *opened* t)
          (with-timeout to-subscribe (mqtt:subscribe c \"a\"))
          (print 'subscribed)))
    (failure (f) (print (list (if *opened* :subscribe :open) (failure-cause f))))))
(loop for (port to-open to-subscribe) on (command-line-arguments) by #'cdddr
      do (try (parse-integer port) (read-from-string to-open) (read-from-string to-subscribe)))";
    let folder = Folder::with("mqtt-peers", &[("main.esl", text)]);
    let mut arguments = vec!["run".to_string(), "--allow-net=127.0.0.1".into(), "main.esl".into()];
    for (answer, next, stays, (to_open, to_subscribe), _) in peers {
        let port = start_peer(answer, next, stays);
        arguments.extend([port.to_string(), to_open.into(), to_subscribe.into()]);
    }
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let run = process::run(eslvm(&arguments).current_dir(folder.path()), "");
    let output = run.quiet_output().expect("nothing is wrong");
    let lines: Vec<&str> = output.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    let expected: Vec<&str> = peers.iter().map(|&(.., expected)| expected).collect();
    assert_eq!(lines, expected);
}

/// The last will of a client is published when the client is killed, and not when it ends.
#[test]
fn the_last_will_of_a_client_that_is_killed_is_published() {
    let Some((folder, _broker, port)) = with_broker("mqtt-will", "") else { return };
    let number = port.to_string();
    let text = "(require :mqtt)
(mqtt:with-client (c \"127.0.0.1\" (parse-integer (first (command-line-arguments)))
                     :id (second (command-line-arguments))
                     :will (list \"left/robot\" (second (command-line-arguments)) :qos 1 :retain t))
  (format t \"open~%\")
  (finish-output)
  (when (third (command-line-arguments)) (sleep 1000)))";
    folder.file("robot.esl", text);
    let start = |arguments: &[&str]| {
        let all = [&["run", "--allow-net=127.0.0.1", "robot.esl", &number], arguments].concat();
        process::start(eslvm(&all).current_dir(folder.path()))
    };
    let mut killed = start(&["killed", "stays"]);
    let mut line = String::new();
    let output = killed.stdout.take().expect("it is a pipe");
    std::io::BufRead::read_line(&mut std::io::BufReader::new(output), &mut line).expect("it opens");
    killed.kill().and_then(|()| killed.wait()).expect("it is our child");
    let ended = process::finish(start(&["ended"])).quiet_output();
    assert_eq!((&*line, ended), ("open\n", Ok("open\n".into())));
    let text = "(require :mqtt)
(mqtt:with-client (c \"127.0.0.1\" (parse-integer (first (command-line-arguments))))
  (print (multiple-value-list (wait-for-event (mqtt:subscribe c \"left/+\" :qos 1)))))";
    folder.file("heir.esl", text);
    let mut heir = eslvm(&["run", "--allow-net=127.0.0.1", "heir.esl", &number]);
    let output = process::run(heir.current_dir(folder.path()), "").quiet_output();
    let output = output.expect("nothing is wrong");
    assert!(output.trim().starts_with("(\"left/robot\" \"killed\""), "{output}");
}

#[test]
fn a_connection_that_is_lost_is_made_again() {
    let Some((folder, mut broker, port)) = with_broker("mqtt-lost", "") else { return };
    let text = "(require :mqtt)
(defun mark (name) (with-open-file (s name :direction :output) (write-line name s)))
(mqtt:with-client (c \"127.0.0.1\" (parse-integer (first (command-line-arguments))))
  (let ((input (mqtt:subscribe c \"a\")))
    (mark \"begun\")
    (loop until (mqtt:problem c) do (sleep 0.01))
    (print (handler-case (mqtt:publish c \"a\" \"x\") (failure (f) (failure-cause f))))
    (mark \"lost\")
    (loop
      (handler-case (progn (mqtt:publish c \"a\" \"again\") (with-timeout 1 (wait-for-event input)) (return nil))
        (failure () (sleep 0.01))))
    (print 'again)))";
    folder.file("main.esl", text);
    let number = port.to_string();
    let mut command = eslvm(&["run", "--allow-net=127.0.0.1", "main.esl", &number]);
    let child = process::start(command.current_dir(folder.path()));
    let await_file = |name: &str| {
        let begun = Instant::now();
        while !folder.path().join(name).exists() {
            assert!(begun.elapsed() < Duration::from_secs(120), "there is no `{name}`");
            std::thread::sleep(Duration::from_millis(10));
        }
    };
    await_file("begun");
    broker.0.kill().and_then(|()| broker.0.wait()).expect("it is our child");
    await_file("lost");
    let settings = folder.path().join("broker.conf");
    let again = Command::new(broker_program().expect("it was there"))
        .arg("-c")
        .arg(settings)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
    broker.0 = again.expect("the broker can be started");
    let output = process::finish(child).quiet_output().expect("nothing is wrong");
    assert_eq!(output.split_whitespace().collect::<Vec<_>>(), [":CONNECTION-LOST", "AGAIN"]);
}

#[test]
fn a_secured_broker_acknowledges_what_is_published() {
    let folder = Folder::new("mqtt-tls");
    let (Some(program), true) = (broker_program(), crate::lines::make_certificates(&folder)) else {
        crate::say_left_out("it needs `mosquitto` and `openssl`");
        return;
    };
    let path = |name: &str| folder.path().join(name).display().to_string();
    let more = format!("certfile {}\nkeyfile {}\n", path("server.pem"), path("server.key"));
    // The broker may give up the rights of root, and has to read its key still.
    let more = if rustix::process::getuid().is_root() { format!("{more}user root\n") } else { more };
    let (_broker, port) = start_broker(program, &folder, &more);
    let text = "(require :mqtt)
(defmacro cause (form) `(print (handler-case ,form (failure (f) (failure-cause f)))))
(defvar *port* (parse-integer (first (command-line-arguments))))
(mqtt:with-client (c \"127.0.0.1\" *port* :tls t :ca-file \"ca.pem\")
  (dotimes (i 150)
    (mqtt:publish c \"kept/x\" (princ-to-string i) :qos (+ 1 (mod i 2)) :retain t))
  ;; An acknowledged message is there for the next client.
  (mqtt:with-client (d \"127.0.0.1\" *port* :tls t :ca-file \"ca.pem\")
    (print (multiple-value-list (wait-for-event (mqtt:subscribe d \"kept/#\"))))))
(cause (mqtt:with-client (c \"127.0.0.1\" *port* :tls t) c))
(cause (mqtt:with-client (c \"127.0.0.1\" *port* :tls t :ca-file \"/none.pem\") c))";
    let lines = printed_by(&folder, text, port);
    assert_eq!(lines, ["(\"kept/x\" \"149\" T)", ":TLS-ERROR", ":PERMISSION-DENIED"]);
}
