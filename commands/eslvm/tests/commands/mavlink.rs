//! Programs over MAVLink: in worlds of scripts, and with peers in Python, by pymavlink.
//!
//! The peers need a package of the Python registry, which the tests install below `target/`. Where that is
//! not possible, these tests are left out, and say so.
#![cfg(unix)]

use std::io::{BufRead, BufReader};
use std::net::UdpSocket;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use esl_conformance::folder::Folder;
use esl_conformance::process;

use crate::examples::free_port;
use crate::{eslvm, venv};

const PACKAGE: &str = "pymavlink==2.4.50";

/// Longest time that anything here takes.
const LONGEST: Duration = Duration::from_secs(120);

fn path_of(name: &str) -> PathBuf {
    esl_conformance::root().join("robots/tests").join(name)
}

/// Returns the Python that has the packages; nothing if they cannot be installed.
fn python() -> Option<PathBuf> {
    venv::python("mavlink", &[PACKAGE], "import pymavlink")
}

/// A process that ends with this, and its lines.
struct Running {
    child: Child,
    lines: Receiver<String>,
}

impl Drop for Running {
    fn drop(&mut self) {
        drop(self.child.kill());
        drop(self.child.wait());
    }
}

impl Running {
    fn start(command: &mut Command) -> Running {
        let mut child = command.stdout(Stdio::piped()).spawn().expect("the process can be started");
        let output = BufReader::new(child.stdout.take().expect("it is a pipe"));
        let (send, lines) = channel();
        std::thread::spawn(move || {
            for line in output.lines().map_while(Result::ok) {
                if !line.trim().is_empty() && send.send(line.trim().to_owned()).is_err() {
                    return;
                }
            }
        });
        Running { child, lines }
    }

    /// Returns the next line that it prints.
    #[track_caller]
    fn line(&self) -> String {
        self.lines.recv_timeout(LONGEST).expect("it prints a line")
    }

    /// Returns the lines that it has printed.
    fn rest(&self) -> Vec<String> {
        self.lines.try_iter().collect()
    }
}

fn start_peer(python: &Path, name: &str, arguments: &[&str]) -> Running {
    let mut command = Command::new(python);
    let peer = Running::start(command.arg("-B").arg(path_of("peers").join(name)).args(arguments));
    assert_eq!(peer.line(), "ready");
    peer
}

/// Runs a program, which is given a free port, beside a vehicle. Returns the lines of both.
fn beside_vehicle(
    folder: &Folder,
    text: &str,
    options: &[&str],
) -> Option<(Vec<String>, Vec<String>, String)> {
    let python = python()?;
    folder.file("main.esl", text);
    let port = free_port().to_string();
    let vehicle = start_peer(&python, "mavlink_vehicle.py", &[&[port.as_str()], options].concat());
    let run = ["run", "--allow-net=127.0.0.1", "--record", "run.eslj", "main.esl", &port];
    let done = process::run(eslvm(&run).current_dir(folder.path()), "");
    let lines = done.output.lines().map(str::trim).filter(|line| !line.is_empty());
    Some((lines.map(str::to_owned).collect(), vehicle.rest(), done.errors))
}

/// The head of programs: `tried` prints the value of a form, or its failure.
const HEAD: &str = "(require :mavlink)
(defmacro tried (form)
  `(format t \"~s~%\" (handler-case ,form (failure (f) (cons (failure-cause f) (failure-arguments f))))))
(defun points (count)
  (loop for i below count
        collect (mavlink:item :nav-waypoint :latitude (+ 47 (/ i 1000)) :longitude 8 :altitude 20)))
";

#[test]
fn worlds_of_scripts_have_vehicles() {
    let path = path_of("programs").join("mavlink_test.esl");
    let done = process::run(&mut eslvm(&["test", path.to_str().expect("the path is text")]), "");
    assert_eq!(done.status, Some(0), "{}\n{}", done.output, done.errors);
}

#[test]
fn a_vehicle_of_pymavlink_is_commanded_and_the_run_replayed() {
    let text = format!(
        "{HEAD}(mavlink:with-link (v (format nil \"udpin:127.0.0.1:~a\" (first (command-line-arguments)))
                     :retry-after 0.3)
  (tried (mavlink:wait-for-vehicle v :timeout 20))
  (tried (mavlink:set-mode v :guided))
  (tried (mavlink:arm v))
  (tried (mavlink:command v :nav-takeoff :altitude 10 :yaw nil))
  (tried (mavlink:command v :do-reposition :frame :global-relative-alt
                          :latitude 47.1234567 :longitude -8.1 :altitude 20))
  (tried (mavlink:command v :do-set-servo :instance 1 :pwm 1500))
  (tried (mavlink:command v :user-1))
  (tried (mavlink:command v :user-2 :attempts 2))
  (tried (mavlink:command v :do-jump))
  (tried (with-timeout 0.5 (mavlink:command v :preflight-calibration)))
  (tried (getf (mavlink:request-message v :autopilot-version) :board-version))
  (tried (mavlink:parameter v \"RTL_ALT\"))
  (tried (mavlink:set-parameter v \"RTL_ALT\" 1800))
  (tried (mavlink:set-parameter v \"WPNAV_SPEED\" 700.5))
  (tried (hash-table-count (mavlink:parameters v)))
  (tried (mavlink:upload-mission v (points 10)))
  (tried (length (mavlink:download-mission v)))
  (tried (mavlink:clear-mission v))
  (tried (mavlink:download-mission v)))"
    );
    let folder = Folder::new("mavlink-vehicle");
    let Some((lines, seen, errors)) = beside_vehicle(&folder, &text, &[]) else { return };
    let expected = [
        "(1 1)",
        ":GUIDED",
        "T",
        ":ACCEPTED",
        ":ACCEPTED",
        "(:COMMAND-DENIED :DO-SET-SERVO :DENIED)",
        ":ACCEPTED",
        "(:NO-ACKNOWLEDGEMENT :USER-2 2)",
        "(:UNSUPPORTED :DO-JUMP :UNSUPPORTED)",
        "(:TIMEOUT)",
        "4",
        "1500",
        "1800",
        "700.5",
        "41",
        "10",
        "10",
        "NIL",
        "NIL",
    ];
    assert_eq!(lines, expected, "{errors}");
    let expected = [
        "takeoff 10.0 nan 0",
        "reposition COMMAND_INT 471234567 -81000000 20.0 3",
        "user-1 0",
        "user-1 1",
        "user-1 2",
        "cancel",
        "mission 11",
    ];
    assert_eq!(seen, expected);
    let again = process::run(eslvm(&["replay", "run.eslj"]).current_dir(folder.path()), "");
    let replayed: Vec<&str> = again.output.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    assert_eq!(replayed, lines, "{}", again.errors);
}

#[test]
fn the_protocols_survive_a_lossy_way_to_pymavlink() {
    let text = format!(
        "{HEAD}(mavlink:with-link (v (format nil \"udpin:127.0.0.1:~a\" (first (command-line-arguments)))
                     :retry-after 0.1 :attempts 15)
  (tried (mavlink:wait-for-vehicle v :timeout 20))
  (tried (mavlink:set-mode v :guided))
  (tried (mavlink:arm v))
  (tried (mavlink:set-parameter v \"RTL_ALT\" 1800))
  (tried (hash-table-count (mavlink:parameters v)))
  (tried (mavlink:upload-mission v (points 5)))
  (tried (length (mavlink:download-mission v))))"
    );
    let folder = Folder::new("mavlink-lossy");
    let Some((lines, _, errors)) = beside_vehicle(&folder, &text, &["0.2", "7"]) else { return };
    assert_eq!(lines, ["(1 1)", ":GUIDED", "T", "1800", "41", "5", "5"], "{errors}");
}

#[test]
fn a_station_of_pymavlink_flies_a_vehicle_in_esl() {
    let Some(python) = python() else { return };
    let text = "(require :mavlink)
(mavlink:with-link (link (format nil \"udpin:127.0.0.1:~a\" (first (command-line-arguments)))
                         :system 1 :component 1 :heartbeat nil)
  (format t \"open~%\")
  (finish-output)
  (mavlink:serve-vehicle link :climb 5))";
    let folder = Folder::with("mavlink-station", &[("main.esl", text)]);
    let port = free_port().to_string();
    let mut run = eslvm(&["run", "--allow-net=127.0.0.1", "main.esl", &port]);
    let vehicle = Running::start(run.current_dir(folder.path()));
    assert_eq!(vehicle.line(), "open");
    let station = start_peer(&python, "mavlink_station.py", &[&port]);
    for expected in [
        "heartbeat 1 0 2 3",
        "armed",
        "takeoff 0",
        "height",
        "set True",
        "parameters FS_GCS_ENABLE RTL_ALT WPNAV_SPEED",
        "mission 0",
        "item 4 2 470020000 20.0",
        "landed",
    ] {
        assert_eq!(station.line(), expected);
    }
}

#[test]
fn a_vehicle_at_a_serial_line_is_commanded_also_after_the_line_was_pulled_out() {
    let Some(python) =
        venv::python("mavlink-serial", &[PACKAGE, "pyserial==3.5"], "import pymavlink, serial")
    else {
        return;
    };
    let text = format!(
        "{HEAD}(mavlink:with-link (v (format nil \"serial:~a:57600\" (first (command-line-arguments)))
                    :lost-after 1 :retry-after 0.5)
  (print (mavlink:wait-for-vehicle v :timeout 20))
  (mavlink:arm v)
  (print (mavlink:armed v))
  (tried (mavlink:command v :nav-takeoff :altitude 12))
  (mavlink:upload-mission v (points 25))
  (print (length (mavlink:download-mission v)))
  (print (hash-table-count (mavlink:parameters v)))
  (tried (mavlink:set-parameter v \"RTL_ALT\" 1700))
  (mavlink:command v :user-4)
  (wait-until (not (mavlink:connected v)) :timeout 20)
  (print :lost)
  (wait-until (mavlink:connected v) :timeout 20)
  (tried (mavlink:parameter v \"RTL_ALT\")))"
    );
    let folder = Folder::with("mavlink-serial", &[("main.esl", &text)]);
    let line = folder.join("line");
    let vehicle = start_peer(&python, "mavlink_vehicle.py", &[&line]);
    let run = ["run", &format!("--allow-serial={line}"), "main.esl", &line];
    let done = process::run(eslvm(&run).current_dir(folder.path()), "");
    let lines: Vec<&str> = done.output.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    assert_eq!(lines, ["(1 1)", "T :ACCEPTED", "25", "41 1700", ":LOST 1700"], "{}", done.errors);
    // The home of the vehicle is an item there.
    assert_eq!(vehicle.rest()[..2], ["takeoff 12.0 0.0 0", "mission 26"]);
}

/// Returns a frame of a heartbeat of MAVLink 2 by this system.
pub(crate) fn heartbeat(system: u8, sequence: u8) -> Vec<u8> {
    let mut frame = vec![0xfd, 9, 0, 0, sequence, system, 1, 0, 0, 0, 4, 0, 0, 0, 2, 3, 0x81, 4, 3];
    let mut crc = 0xffff_u16;
    // The last one is the seed of heartbeats.
    for byte in frame[1..].iter().copied().chain([50]) {
        let mut rest = byte ^ crc.to_le_bytes()[0];
        rest ^= rest << 4;
        let wide = u16::from(rest);
        crc = (crc >> 8) ^ (wide << 8) ^ (wide << 3) ^ (wide >> 4);
    }
    frame.extend(crc.to_le_bytes());
    frame
}

#[test]
fn bad_input_is_dropped_counted_and_reported_once() {
    let text = "(require :mavlink)
(mavlink:with-link (v (format nil \"udpin:127.0.0.1:~a\" (first (command-line-arguments))))
  (format t \"open~%\")
  (finish-output)
  (mavlink:wait-for-vehicle v :timeout 20)
  (format t \"~s~%\" (mavlink:vehicle v))
  (finish-output)
  ;; The statistics are no fluent.
  (loop until (plusp (getf (mavlink:statistics v) :spoofed)) do (sleep 0.05))
  (sleep 0.3)
  (destructuring-bind (&key received malformed garbage unknown spoofed &allow-other-keys) (mavlink:statistics v)
    (format t \"~s~%\" (list (> received 1000) (> malformed 100) (> garbage 10000) (plusp unknown) spoofed))
    (format t \"~s ~s~%\" (mavlink:vehicle v) (mavlink:connected v))))";
    let folder = Folder::with("mavlink-bad", &[("main.esl", text)]);
    let port = free_port();
    let mut run = eslvm(&["run", "--allow-net=127.0.0.1", "main.esl", &port.to_string()]);
    let mut running = Running::start(run.current_dir(folder.path()).stderr(Stdio::piped()));
    assert_eq!(running.line(), "open");
    let socket = || UdpSocket::bind("127.0.0.1:0").expect("there is a port");
    let (vehicle, other) = (socket(), socket());
    let send = |socket: &UdpSocket, bytes: &[u8]| {
        socket.send_to(bytes, ("127.0.0.1", port)).expect("it is sent");
    };
    send(&vehicle, &heartbeat(1, 0));
    assert_eq!(running.line(), "(1 1)");
    // Frames of other systems, broken ones, an unknown message, and bytes that are none.
    for n in 0..2_000_u32 {
        let mut broken = heartbeat(1, 0);
        broken[12] ^= 1;
        send(&other, &broken);
        send(&other, &[b"$GPGGA,,,".as_slice(), &heartbeat(7, n as u8)].concat());
        send(&other, &[0xfd, 1, 0, 0, 0, 1, 1, 0xff, 0xff, 0xff, 0, 0, 0]);
        send(&other, &[0; 100]);
        if n.is_multiple_of(10) {
            std::thread::sleep(Duration::from_millis(1));
        }
    }
    // Another one claims to be the vehicle.
    send(&vehicle, &heartbeat(1, 1));
    std::thread::sleep(Duration::from_millis(200));
    send(&other, &heartbeat(1, 2));
    assert_eq!(running.line(), "(T T T T 1)");
    assert_eq!(running.line(), "(1 1) T");
    drop(running.child.wait());
    let errors = BufReader::new(running.child.stderr.take().expect("it is a pipe")).lines();
    let errors: Vec<String> = errors.map_while(Result::ok).collect();
    for text in ["wrong checksum", "unknown numbers", "is heard elsewhere"] {
        let count = errors.iter().filter(|line| line.contains(text)).count();
        assert_eq!(count, 1, "{text}: {errors:?}");
    }
}

#[test]
fn a_link_needs_its_right_and_signed_links_know_each_other() {
    let text = "(require :mavlink)
(defmacro refused (form) `(print (handler-case ,form (serious-condition (c) (princ-to-string c)))))
(refused (mavlink:with-link (v \"udpin:127.0.0.1:1\") v))
(refused (mavlink:with-link (v \"tcpout:127.0.0.1:2\") v))
(refused (mavlink:with-link (v \"serial:/dev/ttyACM0:57600\") v))
(refused (mavlink:with-link (v \"udp:127.0.0.1:1\") v))";
    let folder = Folder::with("mavlink-rights", &[("main.esl", text)]);
    let done = process::run(eslvm(&["run", "main.esl"]).current_dir(folder.path()), "");
    for text in [
        "--allow-net=127.0.0.1:1",
        "--allow-net=127.0.0.1:2",
        "--allow-serial=/dev/ttyACM0",
        "is not the address of a link",
    ] {
        assert!(done.output.contains(text), "{text}: {}\n{}", done.output, done.errors);
    }
    let text = "(require :mavlink)
(defun hears (key &rest options)
  (mavlink:with-link (a \"tcpin:127.0.0.1:0\" :signing \"a phrase\" :heartbeat nil)
    (apply #'mavlink::call-with-link
           (lambda (b)
             (declare (ignore b))
             (handler-case (progn (mavlink:wait-for-vehicle a :timeout 1.5) :heard)
               (failure (f) (list (failure-cause f) (plusp (getf (mavlink:statistics a) :unsigned))))))
           (format nil \"tcpout:127.0.0.1:~d\" (mavlink:local-port a))
           :system 1 :component 1 :type :quadrotor :autopilot :px4 :heartbeat 0.1 :signing key options)))
(print (hears \"a phrase\"))
(print (hears \"another one\"))
(print (hears nil))
(print (hears nil :version 1))";
    let folder = Folder::with("mavlink-signing", &[("main.esl", text)]);
    let done =
        process::run(eslvm(&["run", "--allow-net=127.0.0.1", "main.esl"]).current_dir(folder.path()), "");
    let lines: Vec<&str> = done.output.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    let refused = "(:NO-VEHICLE T)";
    assert_eq!(lines, [":HEARD", refused, refused, refused], "{}", done.errors);
}

#[test]
fn a_connection_is_made_again() {
    let text = "(require :mavlink)
(defun main (port)
  (let ((address (format nil \"127.0.0.1:~d\" port)))
    (flet ((vehicle (function)
             (mavlink::call-with-link function (format nil \"tcpin:~a\" address)
                                      :system 1 :component 1 :type :quadrotor :autopilot :px4 :heartbeat 0.1)))
      (let ((station (make-event 'station)) (copter nil))
        (spawn (:daemon t)
          (vehicle (lambda (link)
                     (declare (ignore link))
                     (signal station)
                     (wait-until (and copter (mavlink:connected copter)) :on station))))
        (wait-for-event station)
        (mavlink:with-link (link (format nil \"tcpout:~a\" address) :lost-after 0.5)
          (setq copter link)
          (mavlink:wait-for-vehicle link :timeout 10)
          (signal station)
          (wait-until (not (mavlink:connected link)) :timeout 10)
          (print :lost)
          (spawn (:daemon t)
            (vehicle (lambda (other) (declare (ignore other)) (sleep 60))))
          (wait-until (mavlink:connected link) :timeout 20)
          (print :back))))))
(main (parse-integer (first (command-line-arguments))))";
    let folder = Folder::with("mavlink-again", &[("main.esl", text)]);
    let port = free_port().to_string();
    let mut run = eslvm(&["run", "--allow-net=127.0.0.1", "main.esl", &port]);
    let done = process::run(run.current_dir(folder.path()), "");
    let lines: Vec<&str> = done.output.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    assert_eq!(lines, [":LOST", ":BACK"], "{}", done.errors);
}
