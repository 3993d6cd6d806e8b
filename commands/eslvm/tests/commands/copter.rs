//! The executive of a copter surveys its field: with a copter of scripts in virtual time, and with the
//! simulator in Python.
#![cfg(unix)]

use std::path::PathBuf;
use std::process::Command;

use esl_conformance::process;

use crate::examples::{example, free_port};
use crate::{ESLVM, eslvm};

/// Lines that every survey has.
const LINES: [&str; 6] = [
    "the camera is busy",
    "the link is lost",
    "the link is there again, the copter is in mode",
    "picture 6 of 6",
    "the copter has landed, 0.",
    // A lost acknowledgement that is not repeated in time counts as a loss of the link.
    "6 of 6 pictures, the link was lost ",
];

#[test]
fn a_copter_of_scripts_is_flown_under_all_schedules() {
    for (seed, slice) in [("0", "2000"), ("1", "1"), ("2", "7"), ("3", "100")] {
        let options = ["run", "--clock", "virtual", "--seed", seed, "--slice", slice];
        let run = process::run(eslvm(&options).arg(example("copter/scripted.esl")), "");
        assert_eq!(run.status, Some(0), "seed {seed}: {}{}", run.output, run.errors);
        for line in LINES {
            assert!(run.output.contains(line), "{line}, seed {seed}: {}", run.output);
        }
    }
}

#[test]
fn a_simulated_copter_surveys_its_field_and_returns() {
    let venv = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("copter-venv");
    let script = example("copter/run.sh");
    let mut install = Command::new(&script);
    install.arg("--install").env("COPTER_VENV", &venv);
    if !install.output().is_ok_and(|done| done.status.success()) {
        crate::say_left_out("it needs `python3`, its `venv`, and its registry");
        return;
    }
    // The simulator is eight times as fast as the clock: the link is cut for nine seconds, in which the
    // copter returns and lands by itself.
    let mut command = Command::new(&script);
    command.args(["--speed", "8", "--cut", "15", "87"]).env("COPTER_VENV", &venv).env("ESLVM", ESLVM);
    let run = process::run(command.env("COPTER_PORT", free_port().to_string()), "");
    assert_eq!(run.status, Some(0), "{}{}", run.output, run.errors);
    for line in LINES.into_iter().chain(["copter: nothing is heard of the ground station", "copter: landed"])
    {
        assert!(run.output.contains(line), "{line}: {}{}", run.output, run.errors);
    }
}
