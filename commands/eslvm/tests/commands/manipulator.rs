//! The executive of an arm clears its table: of scripts in virtual time, and against the simulator in Python.
#![cfg(unix)]

use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use esl_conformance::folder::Folder;
use esl_conformance::process;

use crate::examples::{PATIENCE, example, free_port};
use crate::{ESLVM, eslvm};

#[test]
fn an_arm_of_scripts_is_driven_under_all_schedules() {
    for (seed, slice) in [("0", "2000"), ("1", "1"), ("2", "7"), ("3", "100")] {
        let options = ["run", "--clock", "virtual", "--seed", seed, "--slice", slice];
        let run = process::run(eslvm(&options).arg(example("manipulator/scripted.esl")), "");
        assert_eq!(run.status, Some(0), "seed {seed}: {}{}", run.output, run.errors);
        for line in [
            "the arm stopped",
            "the camera hangs, resetting it",
            "lost the blue block",
            "grasping the blue block across",
            "percent, charging",
            "the motors are stopped",
            "4 of 4 blocks are in the tray",
        ] {
            assert!(run.output.contains(line), "{line}, seed {seed}: {}", run.output);
        }
        assert!(!run.output.contains("RULE BROKEN"), "{}", run.output);
    }
}

/// Returns the script that starts simulator and executive; nothing if the simulator cannot be installed.
fn script() -> Option<Command> {
    let venv = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("manipulator-venv");
    let script = example("manipulator/run.sh");
    let mut command = Command::new(&script);
    command.env("MANIPULATOR_VENV", &venv).env("ESLVM", ESLVM);
    let mut install = Command::new(&script);
    install.arg("--install").env("MANIPULATOR_VENV", &venv);
    if install.output().is_ok_and(|done| done.status.success()) {
        return Some(command);
    }
    crate::say_left_out("it needs `python3`, its `venv`, and its registry");
    None
}

/// The script, and the lines of both programs.
struct Run {
    child: Child,
    lines: Receiver<String>,
    seen: Vec<String>,
}

impl Run {
    fn start(mut command: Command, speed: &str) -> Run {
        let port = free_port().to_string();
        command.args(["--speed", speed]).env("MANIPULATOR_PORT", port).stdout(Stdio::piped());
        let mut child = command.spawn().expect("the script can be started");
        let output = BufReader::new(child.stdout.take().expect("it is a pipe"));
        let (send, lines) = channel();
        std::thread::spawn(move || {
            for line in output.lines().map_while(Result::ok) {
                if send.send(line).is_err() {
                    break;
                }
            }
        });
        Run { child, lines, seen: Vec::new() }
    }

    /// Waits until a line has the text.
    fn wait_for(&mut self, text: &str) {
        let began = Instant::now();
        loop {
            match self.lines.recv_timeout(PATIENCE.saturating_sub(began.elapsed())) {
                Ok(line) => self.seen.push(line),
                Err(RecvTimeoutError::Timeout) => panic!("no `{text}` in time: {:#?}", self.seen),
                Err(RecvTimeoutError::Disconnected) => panic!("no `{text}`: {:#?}", self.seen),
            }
            if self.seen.last().is_some_and(|line| line.contains(text)) {
                return;
            }
        }
    }

    fn has_seen(&self, text: &str) -> bool {
        self.seen.iter().any(|line| line.contains(text))
    }
}

impl Drop for Run {
    /// The script ends what it has started.
    fn drop(&mut self) {
        drop(Command::new("kill").arg(self.child.id().to_string()).status());
        drop(self.child.wait());
    }
}

#[test]
fn a_simulated_arm_in_another_process_clears_its_table() {
    let Some(mut script) = script() else { return };
    let folder = Folder::new("manipulator-recorded");
    let [recording, file] = ["run.eslj", "run.mcap"].map(|name| folder.join(name));
    script.env("EXECUTIVE_OPTIONS", format!("--record {recording} --mcap {file}"));
    let mut run = Run::start(script, "2");
    run.wait_for("blocks are in the tray, the battery was charged");
    assert!(run.has_seen("4 of 4 blocks are in the tray"), "{:#?}", run.seen);
    // Whether the wall stops the arm, too, depends on where a first try has pushed the block; and the battery
    // lasts without the tries after that. All of it happens in the world of scripts.
    for text in ["camera is reset", "lost the green block", "motors are stopped"] {
        assert!(run.has_seen(text), "{text}: {:#?}", run.seen);
    }
    assert!(run.child.wait().is_ok_and(|status| status.success()));
    let replay = process::run(&mut eslvm(&["replay", &recording]), "");
    assert_eq!(replay.status, Some(0), "{}", replay.errors);
    let said = replay.output.lines().filter(|line| !run.has_seen(line)).collect::<Vec<_>>();
    assert_eq!(said, Vec::<&str>::new(), "the replay says what the run did not say");
    assert!(replay.output.contains("4 of 4 blocks are in the tray"), "{}", replay.output);
    topics_of_a_run_are_a_world(&folder);
}

/// The file of the run is a world, in which each message of its topics comes again.
fn topics_of_a_run_are_a_world(folder: &Folder) {
    let text = r#"(require :ros)
(require :mcap)
(defvar *counts* (make-hash-table :test 'equal))
(defun count-messages (node topic type)
  (let ((messages (ros:subscribe node topic type :qos '(:depth 1000))))
    (spawn (:daemon t)
      (loop
        (wait-for-event messages)
        (incf (gethash topic *counts* 0))))))
(with-world ((:bag "run.mcap" :topics ("/joint_states" "/battery")))
  (ros:with-node (node "reader")
    (count-messages node "/joint_states" "sensor_msgs/msg/JointState")
    (count-messages node "/battery" "sensor_msgs/msg/BatteryState")
    (sleep 1000)))
(mcap:with-file (file "run.mcap")
  (dolist (channel (mcap:channels file))
    (let ((count (gethash (getf channel :topic) *counts*)))
      (when count
        (print (list (getf channel :topic) (> count 20) (- count (getf channel :count))))))))"#;
    folder.file("bag.esl", text);
    let mut command = eslvm(&["run", "--clock", "virtual", "--allow-read=.", "bag.esl"]);
    let done = process::run(command.current_dir(folder.path()), "");
    let mut lines: Vec<&str> = done.output.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    lines.sort_unstable();
    assert_eq!(lines, [r#"("/battery" T 0)"#, r#"("/joint_states" T 0)"#], "{}", done.errors);
}

#[test]
fn a_signal_stops_the_motors() {
    let Some(script) = script() else { return };
    let mut run = Run::start(script, "1");
    run.wait_for("arm: gripper closes, holds a block");
    // The block is lifted now, so that a goal of the controller is under way.
    std::thread::sleep(Duration::from_millis(700));
    let began = Instant::now();
    assert!(Command::new("kill").arg(run.child.id().to_string()).status().is_ok_and(|done| done.success()));
    run.wait_for("arm: motors are stopped");
    assert!(began.elapsed() < Duration::from_secs(8), "the motors ran for {:?}", began.elapsed());
    run.wait_for("s  the motors are stopped");
    assert_eq!(run.child.wait().ok().and_then(|status| status.code()), Some(143));
}
