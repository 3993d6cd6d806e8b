//! Nodes of ESL beside the usual ones of a robot, in Python: the clock of a simulator, transforms, a manager
//! of lifecycles, and watches of the log and of diagnostics.
#![cfg(unix)]

use std::sync::mpsc::RecvTimeoutError;
use std::time::Duration;

use esl_conformance::folder::Folder;
use esl_conformance::process;

use crate::eslvm;
use crate::examples::free_port;
use crate::robots::{Running, python, start_peer, start_program};

/// Definitions of the programs: a whole line at once, for a test that reads it.
const SAY: &str = "(require :ros)
(defun say (value) (format t \"~s~%\" value) (finish-output))
(defun address () (format nil \"tcp/127.0.0.1:~a\" (first (command-line-arguments))))
";

/// A program whose time is that of the peer.
const TIMED: &str = "(defun seconds () (list (round (now)) (round (time:unix))))
(ros:with-node (node \"executive\" :listen (address) :mode :router)
  (spawn (:daemon t)
    (loop (say (list :event (wait-for-event (ros:node-events node))))))
  (say (list :parameter (ros:parameter node \"use_sim_time\") (seconds)))
  (sleep 2)
  ;; The time of the timeout begins before the line that the test waits for.
  (handler-case (with-timeout 5
                  (say (list :slept (seconds)))
                  (wait-for-event (make-event 'never)))
    (failure (failure) (say (list (failure-cause failure) (seconds)))))
  (let ((turns 0))
    (do-every 1
      (say (list :turn (seconds)))
      (when (= (incf turns) 3) (return))))
  ;; A second node, which ends, and the first one goes on.
  (ros:with-node (other \"other\" :connect (address))
    (sleep 1)
    (say (list :both (seconds))))
  (sleep 1)
  (unwind-protect (progn (say (list :waits (seconds))) (sleep 1000))
    (sleep 1)
    (say :cleaned)))";

#[test]
fn time_is_that_of_a_simulator() {
    let Some(python) = python() else { return };
    let folder = Folder::new("ros-clock");
    let port = free_port();
    let mut program = start_program(&folder, &format!("{SAY}{TIMED}"), port, &["--clock", "ros"]);
    let mut peer = start_peer(&python, "robot.py", port);
    // Without a message, time stands still, and the program says so.
    assert_eq!(program.line(), "(:PARAMETER T (0 0))");
    assert_eq!(program.line(), "(:EVENT :NO-CLOCK)");
    let silent = |program: &Running| {
        let found = program.lines.recv_timeout(Duration::from_millis(700));
        assert_eq!(found, Err(RecvTimeoutError::Timeout), "time stands still");
    };
    peer.tell("clock 100 0");
    peer.tell("clock 101 999999999");
    silent(&program);
    peer.tell("clock 102 0");
    assert_eq!(program.line(), "(:SLEPT (2 102))");
    peer.tell("clock 104 0");
    // The timeout keeps the rest of its time when time goes back.
    peer.tell("clock 50 0");
    assert_eq!(program.line(), "(:EVENT :CLOCK-JUMP)");
    peer.tell("clock 52 900000000");
    silent(&program);
    peer.tell("clock 53 0");
    assert_eq!(program.line(), "(:TIMEOUT (7 53))");
    assert_eq!(program.line(), "(:TURN (7 53))");
    peer.tell("clock 54 0");
    assert_eq!(program.line(), "(:TURN (8 54))");
    peer.tell("clock 55 0");
    assert_eq!(program.line(), "(:TURN (9 55))");
    // Until the program sleeps again.
    silent(&program);
    peer.tell("clock 56 0");
    assert_eq!(program.line(), "(:BOTH (10 56))");
    silent(&program);
    peer.tell("clock 57 0");
    assert_eq!(program.line(), "(:WAITS (11 57))");
    // At the end of the run, time passes although the simulator stands still.
    let end = std::process::Command::new("kill").arg(program.child.id().to_string()).status();
    assert!(end.is_ok_and(|status| status.success()));
    assert_eq!(program.line(), ":CLEANED");
    assert_eq!(program.child.wait().expect("it ends").code(), Some(143));
    let done = process::run(eslvm(&["replay", "run.eslj"]).current_dir(folder.path()), "");
    for line in ["(:SLEPT (2 102))", "(:EVENT :CLOCK-JUMP)", "(:TIMEOUT (7 53))", "(:BOTH (10 56))"] {
        assert!(done.output.contains(line), "{line}: {}\n{}", done.output, done.errors);
    }
    assert_eq!(done.status, Some(143), "{}", done.errors);
}

#[test]
fn the_clock_of_ros_is_for_runs() {
    for (arguments, text) in [
        (&["repl", "--clock", "ros"][..], "`--clock ros` is for `eslvm run`"),
        (&["run", "--clock", "ros", "--speed", "2", "x.esl"], "`--speed` has no effect"),
    ] {
        let done = process::run(&mut eslvm(arguments), "");
        assert_eq!(done.status, Some(2), "{}", done.errors);
        assert!(done.errors.contains(text), "{}", done.errors);
    }
}

/// A program that asks where things are.
const SEEKER: &str = "(ros:with-node (node \"executive\" :listen (address) :mode :router)
  (ros:follow-transforms node)
  (ros:wait-for-publisher node \"/tf_static\" :timeout 60)
  (flet ((x (&rest options)
           (handler-case (ros:field (apply #'ros:lookup-transform node \"map\" \"gripper\" options)
                                    :transform :translation :x)
             (failure (failure) (failure-cause failure)))))
    (say (x :timeout 60))
    (say (x :at '(:sec 101 :nanosec 500000000) :timeout 60))
    (say (x :at 90))
    (ros:send-transform node \"gripper\" \"cup\" :x 0.5 :at 102 :static t)
    (say (ros:frames node))))";

#[test]
fn transforms_of_nodes_in_python_are_looked_up() {
    let Some(python) = python() else { return };
    let folder = Folder::new("ros-transforms");
    let port = free_port();
    let program = start_program(&folder, &format!("{SAY}{SEEKER}"), port, &[]);
    let mut peer = start_peer(&python, "robot.py", port);
    peer.tell("static base gripper 10");
    peer.tell("transform map base 100 0 1");
    assert_eq!(program.line(), "11.0");
    peer.tell("transform map base 101 0 2");
    peer.tell("transform map base 102 0 3");
    assert_eq!(program.line(), "12.5");
    assert_eq!(program.line(), ":EXTRAPOLATION");
    let frames = program.line();
    assert!(frames.starts_with("((\"base\" \"map\" NIL)"), "{frames}");
}

/// A managed node with diagnostics, a log and a property.
const MANAGED: &str = "(require :log)
(defvar *node* nil)
(defvar *ready* (make-event 'ready))
(spawn (:daemon t)
  (ros:with-node (node \"executive\" :managed t :listen (address) :mode :router)
    (setq *node* node)
    (ros:publish-diagnostics node :period 0.5)
    (ros:add-check node \"battery\" (lambda () (values :warn \"low\" '(:volts 11.5))))
    (signal *ready*)
    (ros:manage (node)
      (:on-configure (say :configure))
      (:on-activate (fail :transition-failed \"no camera\"))
      (:on-shutdown (say :shutdown)))
    (say :managed)))
(wait-until *node* :on *ready*)
(ros:define-property level *node* \"/level\" \"std_msgs/msg/Int32\" :field :data :initial 0)
(ros:wait-for-subscriber *node* \"/rosout\" :timeout 60)
(spawn (:daemon t)
  ;; A subscriber may be seen before messages reach it.
  (do-every 0.5 (log:warn \"battery low\" :volts 11.5)))
(wait-until (> level 5))
(say (list :level level))
(sleep 1000)";

#[test]
fn a_node_is_managed_watched_and_followed_by_tools_in_python() {
    let Some(python) = python() else { return };
    let folder = Folder::new("ros-managed");
    let port = free_port();
    let program = start_program(&folder, &format!("{SAY}{MANAGED}"), port, &[]);
    let mut peer = start_peer(&python, "robot.py", port);
    let ask = |peer: &mut Running, line: &str, answer: &str| {
        peer.tell(line);
        // Statuses come in between, each half second.
        while peer.until(|line| !line.starts_with("status ")) != answer {}
    };
    peer.tell("watch");
    peer.until(|line| line == "log 30 executive battery low volts=11.5");
    peer.until(|line| line == "status 1 executive: battery | low");
    peer.until(|line| line == "status 0 executive: lifecycle | unconfigured");
    ask(&mut peer, "state", "state 1 unconfigured");
    ask(&mut peer, "change 1", "changed True");
    assert_eq!(program.line(), ":CONFIGURE");
    ask(&mut peer, "change 1", "changed False");
    ask(&mut peer, "change 3", "changed False");
    ask(&mut peer, "state", "state 2 inactive");
    peer.tell("level 3");
    peer.tell("level 7");
    assert_eq!(program.line(), "(:LEVEL 7)");
    ask(&mut peer, "change 6", "changed True");
    assert_eq!(program.line(), ":SHUTDOWN");
    assert_eq!(program.line(), ":MANAGED");
}

/// A managed node that the lifecycle manager of Nav2 watches.
const BONDED: &str = "(ros:with-node (node \"executive\" :managed t :bond t :listen (address) :mode :router)
  (spawn (:daemon t)
    (loop (say (list :event (wait-for-event (ros:node-events node))))))
  (ros:manage (node)
    (:while-active (say :active) (sleep 1000))
    (:on-shutdown (say :shutdown))))";

#[test]
fn a_manager_in_python_knows_that_a_node_is_alive() {
    let Some(python) = python() else { return };
    let folder = Folder::new("ros-bond");
    let port = free_port();
    let program = start_program(&folder, &format!("{SAY}{BONDED}"), port, &[]);
    let mut peer = start_peer(&python, "robot.py", port);
    let tell = |peer: &mut Running, line: &str, answers: &[&str]| {
        peer.tell(line);
        // Messages and answers overtake each other.
        let mut awaited = answers.to_vec();
        while !awaited.is_empty() {
            let found = peer.line();
            awaited.retain(|answer| *answer != found);
        }
    };
    tell(&mut peer, "bond executive", &["bonding"]);
    tell(&mut peer, "change 1", &["changed True"]);
    tell(&mut peer, "change 3", &["bond formed", "changed True"]);
    assert_eq!(program.line(), ":ACTIVE");
    tell(&mut peer, "beats", &["beats come"]);
    // The end of a bond that the manager has asked for is not an event.
    tell(&mut peer, "change 4", &["bond ended", "changed True"]);
    tell(&mut peer, "change 3", &["bond formed", "changed True"]);
    assert_eq!(program.line(), ":ACTIVE");
    // The node has heard of the manager by then.
    tell(&mut peer, "beats", &["beats come"]);
    tell(&mut peer, "unbond", &["bond ended"]);
    assert_eq!(program.line(), "(:EVENT :BOND-BROKEN)");
    tell(&mut peer, "change 7", &["changed True"]);
    assert_eq!(program.line(), ":SHUTDOWN");
}
