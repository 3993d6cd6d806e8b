//! Programs over Zenoh and ROS 2: with each other, and with peers in Python that nobody here has written.
//!
//! The peers need packages of the Python registry, which the tests install below `target/`. Where that is not
//! possible, these tests are left out, and say so.
#![cfg(unix)]

use std::io::{BufRead, BufReader, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use esl_conformance::folder::Folder;
use esl_conformance::process;

use crate::examples::free_port;
use crate::{eslvm, venv};

/// Packages that the peers need.
const PACKAGES: [&str; 2] = ["eclipse-zenoh==1.10.2", "zenoh-ros2-sdk==0.1.8"];

/// Longest time that anything here takes.
const LONGEST: Duration = Duration::from_secs(120);

fn path_of(name: &str) -> PathBuf {
    esl_conformance::root().join("robots/tests").join(name)
}

/// Returns the Python that has the packages; nothing if they cannot be installed.
pub(crate) fn python() -> Option<PathBuf> {
    venv::python("robots", &PACKAGES, "import zenoh, zenoh_ros2_sdk")
}

/// A process that ends with this.
pub(crate) struct Running {
    pub(crate) child: Child,
    input: Option<ChildStdin>,
    pub(crate) lines: Receiver<String>,
}

impl Drop for Running {
    fn drop(&mut self) {
        drop(self.child.kill());
        drop(self.child.wait());
    }
}

impl Running {
    pub(crate) fn start(command: &mut Command) -> Running {
        let command = command.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command.spawn().expect("the process can be started");
        let output = BufReader::new(child.stdout.take().expect("it is a pipe"));
        let (send, lines) = channel();
        std::thread::spawn(move || {
            for line in output.lines().map_while(Result::ok) {
                if !line.trim().is_empty() && send.send(line.trim().to_owned()).is_err() {
                    return;
                }
            }
        });
        let input = child.stdin.take();
        Running { child, input, lines }
    }

    /// Returns the next line that it prints.
    #[track_caller]
    pub(crate) fn line(&self) -> String {
        self.lines.recv_timeout(LONGEST).expect("it prints a line")
    }

    /// Returns the next line that it prints for which `is_meant` holds.
    #[track_caller]
    pub(crate) fn until(&self, is_meant: impl Fn(&str) -> bool) -> String {
        loop {
            let line = self.line();
            if is_meant(&line) {
                return line;
            }
        }
    }

    pub(crate) fn tell(&mut self, line: &str) {
        let input = self.input.as_mut().expect("its input is open");
        writeln!(input, "{line}").and_then(|()| input.flush()).expect("it reads");
    }
}

/// Starts a program, which may use a port of the loopback and is given it. The run is recorded.
pub(crate) fn start_program(folder: &Folder, text: &str, port: u16, options: &[&str]) -> Running {
    let mut all = vec!["--record", "run.eslj"];
    all.extend(options);
    start(folder, text, port, &all, &[])
}

/// Starts a program likewise with `options` and further `arguments`, and does not record the run.
pub(crate) fn start(folder: &Folder, text: &str, port: u16, options: &[&str], arguments: &[&str]) -> Running {
    folder.file("main.esl", text);
    let port = port.to_string();
    let mut all = vec!["run", "--allow-net=127.0.0.1"];
    all.extend(options);
    all.extend(["main.esl", &port]);
    all.extend(arguments);
    Running::start(eslvm(&all).current_dir(folder.path()))
}

fn wait_for_port(port: u16) {
    let begun = Instant::now();
    while TcpStream::connect(("127.0.0.1", port)).is_err() {
        assert!(begun.elapsed() < LONGEST, "nobody listens at {port}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Starts a peer that connects to a port.
pub(crate) fn start_peer(python: &Path, name: &str, port: u16) -> Running {
    wait_for_port(port);
    let mut command = Command::new(python);
    let peer = Running::start(command.arg(path_of("peers").join(name)).arg(port.to_string()));
    assert_eq!(peer.line(), "ready");
    peer
}

/// Runs a program of `robots/tests/programs` with a free port; returns the lines that it prints.
fn printed(name: &str) -> (Vec<String>, String) {
    let path = path_of("programs").join(name);
    let port = free_port().to_string();
    let path = path.to_str().expect("the path is text");
    let done = process::run(&mut eslvm(&["run", "--allow-net=127.0.0.1", path, &port]), "");
    let lines = done.output.lines().map(|line| line.trim().to_owned());
    (lines.filter(|line| !line.is_empty()).collect(), done.errors)
}

#[test]
fn sessions_publish_ask_and_watch() {
    let (lines, errors) = printed("sessions.esl");
    let expected = [
        "(:NOBODY :CONNECTION-REFUSED)",
        "(:CONNECTED T)",
        "(\"room/1/light\" \"on\" (110 111 116 101) \"zenoh/string\" :PUT)",
        "(\"room/2/light\" (1 2 255) (UNSIGNED-BYTE 8))",
        "(\"room/3/light\" (:LEVEL 7) NIL)",
        "(\"[1,true]\" \"application/json\" #(1 T))",
        "(\"room/1/light\" :DELETE)",
        "(:LOST :ZENOH-ERROR)",
        "(:INVALID :ZENOH-ERROR :ZENOH-ERROR)",
        "\"a!\"",
        "((\"sum/2\" \"nothing\"))",
        "\"A failure of cause :BROKEN\"",
        "(:NOBODY NIL)",
        "(:LIMITED NIL)",
        "(:LEFT :TIMEOUT)",
        ":GONE",
        "(:ALONE NIL NIL)",
        ":END",
    ];
    assert_eq!(lines, expected, "{errors}");
}

#[test]
fn a_session_reaches_nothing_without_the_right() {
    let text = "(require :zenoh)
(require :ros)
(defmacro refused (form) `(print (handler-case ,form (serious-condition (c) (princ-to-string c)))))
(refused (zenoh:with-session (s :connect \"tcp/127.0.0.1:1\") s))
(refused (zenoh:with-session (s :listen \"tcp/0.0.0.0:0\") s))
(refused (zenoh:with-session (s :scouting t) s))
(refused (zenoh:with-session (s :listen \"unixsock-stream//here.sock\") s))
(refused (ros:with-node (n \"a\") n))
(with-open-file (f \"z.json5\" :direction :output)
  (write-string \"{ connect: { endpoints: [\\\"tcp/127.0.0.2:7447\\\"] } }\" f))
(refused (zenoh:with-session (s :config \"z.json5\") s))";
    let folder = Folder::with("zenoh-rights", &[("main.esl", text)]);
    let done = process::run(eslvm(&["run", "main.esl"]).current_dir(folder.path()), "");
    for flag in [
        "--allow-net=127.0.0.1:1.",
        "--allow-net=0.0.0.0:0.",
        "--allow-net=224.0.0.224:7446.",
        "--allow-read=/here.sock.",
        "--allow-net=localhost:7447.",
        "--allow-net=127.0.0.2:7447.",
    ] {
        assert!(done.output.contains(flag), "{flag}: {}\n{}", done.output, done.errors);
    }
}

#[test]
fn worlds_of_scripts_have_a_graph() {
    for name in ["worlds_test.esl", "transforms_test.esl", "lifecycle_test.esl"] {
        let path = path_of("programs").join(name);
        let done = process::run(&mut eslvm(&["test", path.to_str().expect("the path is text")]), "");
        assert_eq!(done.status, Some(0), "{}\n{}", done.output, done.errors);
    }
}

/// A program that is a router and a node, for `peers/node.py`.
const TALKER: &str = "(require :ros)
;; A whole line at once, for a test that reads it.
(defun say (value) (format t \"~s~%\" value) (finish-output))
(defmacro cause (form) `(handler-case ,form (failure (f) (cons (failure-cause f) (failure-arguments f)))))
(ros:with-node (node \"executive\" :listen (format nil \"tcp/127.0.0.1:~a\" (first (command-line-arguments)))
                               :mode :router)
  (let ((chatter (ros:advertise node \"/chatter\" \"std_msgs/msg/String\"))
        (echo (ros:subscribe node \"/echo\" \"std_msgs/msg/String\")))
    (spawn (:daemon t)
      (ros:with-service (node \"/multiply\" \"example_interfaces/srv/AddTwoInts\") (request)
        (list :sum (* (getf request :a) (getf request :b)))))
    (ros:wait-for-subscriber node \"/chatter\" :timeout 60)
    (ros:wait-for-publisher node \"/echo\" :timeout 60)
    ;; The peer declares its subscription before its server.
    (ros:wait-for-server node \"/add_two_ints\" :timeout 60)
    (sleep 0.5)
    (ros:publish chatter :data \"hello\")
    (say (ros:field (wait-for-event echo :timeout 60) :data))
    (flet ((add (a b)
             (cause (ros:call-service node \"/add_two_ints\" \"example_interfaces/srv/AddTwoInts\" :a a :b b))))
      (say (add 3 4))
      (say (add 666 1))
      (say (cause (ros:call-service node \"/nobody\" \"std_srvs/srv/Trigger\")))
      (say :serve)
      ;; Garbage is told once, and the message behind it comes.
      (say (ros:field (wait-for-event echo :timeout 60) :data))
      (let ((latched (progn (ros:wait-for-publisher node \"/latched\" :timeout 60)
                            (ros:nodes node))))
        (say (and (find \"/peer\" latched :test #'string=) (find \"/executive\" latched :test #'string=))))
      (say :kill)
      (wait-until (zerop (ros:servers node \"/add_two_ints\")) :timeout 60)
      (say (first (add 1 2))))))
(say :end)";

#[test]
fn a_node_talks_to_a_node_in_python_both_ways() {
    let Some(python) = python() else { return };
    let folder = Folder::new("ros-talker");
    let port = free_port();
    let mut program = start_program(&folder, TALKER, port, &[]);
    let mut peer = start_peer(&python, "node.py", port);
    assert_eq!(program.line(), "\"echo: hello\"");
    assert_eq!(program.line(), "(:SUM 7)");
    let refused = program.line();
    assert!(
        refused.starts_with("(:SERVICE-FAILED \"/add_two_ints\"") && refused.contains("refused"),
        "{refused}"
    );
    assert_eq!(program.line(), "(:NO-SERVER \"/nobody\")");
    assert_eq!(program.line(), ":SERVE");
    peer.tell("call /multiply 6 7");
    assert_eq!(peer.line(), "sum 42");
    peer.tell("garbage");
    assert_eq!(peer.line(), "sent");
    assert_eq!(program.line(), "\"after garbage\"");
    peer.tell("latched");
    assert_eq!(peer.line(), "published");
    assert_eq!(program.line(), "\"/executive\"");
    assert_eq!(program.line(), ":KILL");
    // `kill` sends SIGKILL.
    drop(peer);
    assert_eq!(program.line(), ":NO-SERVER");
    assert_eq!(program.line(), ":END");
    // The run is repeated without a network, and without the peer.
    drop(program.child.wait());
    let done = process::run(eslvm(&["replay", "run.eslj"]).current_dir(folder.path()), "");
    for line in ["\"echo: hello\"", "(:SUM 7)", "(:NO-SERVER \"/nobody\")", "\"after garbage\"", ":END"] {
        assert!(done.output.contains(line), "{line}: {}\n{}", done.output, done.errors);
    }
    assert_eq!(done.status, Some(0), "{}", done.errors);
}

/// A program that sends goals to `peers/action_server.py`: of each it prints what becomes of it, and the
/// seconds.
const GOALS: &str = "(require :ros)
;; A whole line at once, for a test that reads it.
(defun say (value) (format t \"~s~%\" value) (finish-output))
(defun try (node order &optional limit)
  (let ((begun (now)) (seen nil))
    (flet ((pursue-it ()
             (ros:do-action node \"/fibonacci\" \"example_interfaces/action/Fibonacci\"
                            :goal (list :order order) :cancel-timeout 20
                            :feedback (lambda (f) (push (length (getf f :sequence)) seen)))))
      (let ((outcome (handler-case (if limit (with-timeout limit (pursue-it)) (pursue-it))
                       (failure (f) (cons (failure-cause f) (failure-arguments f))))))
        (say (list order outcome (reverse seen) (round (- (now) begun))))))))
(ros:with-node (node \"executive\" :listen (format nil \"tcp/127.0.0.1:~a\" (first (command-line-arguments)))
                               :mode :router)
  (ros:wait-for-action-server node \"/fibonacci\" :timeout 60)
  (try node 1)
  (try node 2)
  (try node 3)
  (try node 4 0.5)
  (try node 5 0.5)
  (try node 6 0.3)
  ;; The ends of the goals before do not arrive at this one.
  (try node 2)
  (try node 7))
(say :end)";

#[test]
fn a_goal_is_pursued_by_a_server_in_python_and_cancelled_when_it_is_left() {
    let Some(python) = python() else { return };
    let folder = Folder::new("ros-goals");
    let port = free_port();
    let program = start_program(&folder, GOALS, port, &[]);
    let peer = start_peer(&python, "action_server.py", port);
    let result = "(:SEQUENCE #(0 1 1))";
    assert_eq!(program.line(), "(1 (:GOAL-REJECTED \"/fibonacci\") NIL 0)");
    assert_eq!(program.line(), format!("(2 {result} (2 3) 0)"));
    assert_eq!(peer.line(), "goal 2 succeeded");
    assert_eq!(program.line(), format!("(3 (:GOAL-ABORTED {result}) NIL 0)"));
    assert_eq!(peer.line(), "goal 3 aborted");
    // Left while it is pursued: over when it has ended.
    assert_eq!(program.line(), "(4 (:TIMEOUT) NIL 1)");
    assert_eq!((peer.line(), peer.line()), ("cancel 4 0".into(), "goal 4 cancelled".into()));
    // The server refuses to cancel it: over when it has ended all the same.
    assert_eq!(program.line(), "(5 (:TIMEOUT) NIL 2)");
    assert_eq!((peer.line(), peer.line()), ("cancel 5 1".into(), "goal 5 succeeded".into()));
    // Left before it is accepted: cancelled when it is.
    assert_eq!(program.line(), "(6 (:TIMEOUT) NIL 1)");
    assert_eq!((peer.line(), peer.line()), ("cancel 6 0".into(), "goal 6 cancelled".into()));
    assert_eq!(program.line(), format!("(2 {result} (2 3) 0)"));
    assert_eq!(peer.line(), "goal 2 succeeded");
    let lost = program.line();
    assert!(lost.starts_with("(7 (:SERVER-LOST") || lost.starts_with("(7 (:NO-SERVER"), "{lost}");
    assert_eq!(program.line(), ":END");
}

/// A program that pursues goals for `peers/action_client.py`.
const PURSUER: &str = "(require :ros)
;; A whole line at once, for a test that reads it.
(defun say (value) (format t \"~s~%\" value) (finish-output))
(ros:with-node (node \"executive\" :listen (format nil \"tcp/127.0.0.1:~a\" (first (command-line-arguments)))
                               :mode :router)
  (ros:with-action-server (node \"/fibonacci\" \"example_interfaces/action/Fibonacci\") (goal)
    (let ((order (getf goal :order)))
      (unwind-protect
           (progn
             (ros:feedback :sequence (list 0 order))
             (when (= order 9)
               (sleep 1000))
             (when (= order 3)
               (fail :goal-aborted '(:sequence (3))))
             (list :sequence (list order)))
        (say (list :cleanup order))))))";

#[test]
fn goals_of_a_client_in_python_are_pursued_cancelled_and_aborted() {
    let Some(python) = python() else { return };
    let folder = Folder::new("ros-pursuer");
    let port = free_port();
    let program = start_program(&folder, PURSUER, port, &[]);
    let mut peer = start_peer(&python, "action_client.py", port);
    let ask = |peer: &mut Running, line: &str, answers: &[&str]| {
        peer.tell(line);
        let heard: Vec<String> = answers.iter().map(|_| peer.line()).collect();
        // Feedback may overtake an answer.
        let sorted = |mut lines: Vec<String>| {
            lines.sort();
            lines
        };
        let answers = answers.iter().map(|&line| line.to_owned()).collect();
        assert_eq!(sorted(heard), sorted(answers), "{line}");
    };
    ask(&mut peer, "garbage 0", &["garbage error"; 3]);
    ask(&mut peer, "goal 1 2", &["accepted", "feedback 0 2"]);
    ask(&mut peer, "result 1", &["status 4 result 2"]);
    ask(&mut peer, "goal 2 3", &["accepted", "feedback 0 3"]);
    ask(&mut peer, "result 2", &["status 6 result 3"]);
    ask(&mut peer, "goal 3 9", &["accepted", "feedback 0 9"]);
    ask(&mut peer, "goal 4 2", &["rejected"]);
    ask(&mut peer, "cancel 4", &["cancel 2"]);
    ask(&mut peer, "cancel 3", &["cancel 0"]);
    ask(&mut peer, "result 3", &["status 5 result"]);
    ask(&mut peer, "cancel 3", &["cancel 3"]);
    // The same name again is refused; the next one is pursued.
    ask(&mut peer, "goal 3 2", &["rejected"]);
    ask(&mut peer, "goal 5 2", &["accepted", "feedback 0 2"]);
    let cleanups = [program.line(), program.line(), program.line(), program.line()];
    assert_eq!(cleanups.map(|line| line.replace("(:CLEANUP ", "")), ["2)", "3)", "9)", "2)"]);
}

/// A program for `peers/bridge.py`, which has the keys and payloads of `zenoh-bridge-ros2dds`.
const BRIDGED: &str = "(require :ros)
;; A whole line at once, for a test that reads it.
(defun say (value) (format t \"~s~%\" value) (finish-output))
(ros:with-node (node \"executive\" :listen (format nil \"tcp/127.0.0.1:~a\" (first (command-line-arguments)))
                               :mode :router :bridge t)
  (let ((chatter (ros:advertise node \"/chatter\" \"std_msgs/msg/String\"))
        (echo (ros:subscribe node \"/echo\" \"std_msgs/msg/String\"))
        (seen nil))
    (spawn (:daemon t)
      (ros:with-service (node \"/multiply\" \"example_interfaces/srv/AddTwoInts\") (request)
        (list :sum (* (getf request :a) (getf request :b)))))
    ;; There is no graph that says when the robot has come.
    (with-recovery-procedures ((:no-server :retries :infinite (sleep 0.1) (retry)))
      (say (ros:call-service node \"/add_two_ints\" \"example_interfaces/srv/AddTwoInts\" :a 3 :b 4)))
    (ros:publish chatter :data \"hello\")
    (say (ros:field (wait-for-event echo :timeout 60) :data))
    (say (ros:do-action node \"/fibonacci\" \"example_interfaces/action/Fibonacci\"
                        :goal '(:order 5) :feedback (lambda (f) (push (getf f :sequence) seen))))
    (say seen)
    (sleep 60)))";

/// The bridge declares no service as complete, and takes an attachment for one of its own.
#[test]
fn a_node_reaches_a_robot_behind_a_bridge() {
    let Some(python) = python() else { return };
    let folder = Folder::new("ros-bridged");
    let port = free_port();
    let program = start_program(&folder, BRIDGED, port, &[]);
    let mut peer = start_peer(&python, "bridge.py", port);
    assert_eq!(peer.line(), "asked add_two_ints 3 4 attachment False");
    assert_eq!(program.line(), "(:SUM 7)");
    assert_eq!(peer.line(), "heard chatter hello attachment False");
    assert_eq!(program.line(), "\"echo: hello\"");
    assert_eq!(peer.line(), "goal 5");
    assert_eq!(program.line(), "(:SEQUENCE #(0 1 5))");
    assert_eq!(program.line(), "(#(0 1))");
    peer.tell("call");
    assert_eq!(peer.line(), "product 42");
}

/// `robots/tests/kill.py` checks that calls under way fail, and that all goes on with the next robot. By hand
/// it kills a hundred of them.
#[test]
fn a_node_goes_on_when_its_robot_is_killed_and_comes_back() {
    let Some(python) = python() else { return };
    for mode in ["peer", "client"] {
        let mut command = Command::new(&python);
        let kill = command.arg(path_of("kill.py")).arg(&python).args([crate::ESLVM, "2", mode]);
        let done = process::run(kill, "");
        assert_eq!(done.status, Some(0), "{}\n{}", done.output, done.errors);
    }
}
