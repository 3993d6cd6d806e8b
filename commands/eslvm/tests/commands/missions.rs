//! The plans of `examples/missions` break no rule of their worlds, in virtual time and under fifty seeds.

use std::path::PathBuf;

use esl_conformance::folder::Folder;
use esl_conformance::process;

use crate::{eslc, eslvm};

fn mission(name: &str) -> PathBuf {
    esl_conformance::root().join("examples/missions").join(name)
}

/// Runs a mission with fifty seeds. The faults that `sign` stands for come with some of them.
fn fly(name: &str, sign: &str) {
    let folder = Folder::new(&format!("missions-{name}"));
    let program = folder.join("mission.eslb");
    let source = mission(&format!("{name}.esl"));
    let compiled = process::run(eslc(&["compile", "-o", &program]).arg(source), "");
    assert_eq!(compiled.status, Some(0), "{}", compiled.errors);
    let mut signs = 0;
    for seed in 1..=50 {
        let seed = seed.to_string();
        // A plan that hangs does not end by itself, since the world goes on.
        let options = ["run", "--clock", "virtual", "--seed", &seed, "--budget", "20000000", &program];
        let run = process::run(&mut eslvm(&options), "");
        assert_eq!(run.status, Some(0), "seed {seed}: {}{}", run.output, run.errors);
        assert!(run.output.ends_with("no rule broken\n"), "seed {seed}: {}", run.output);
        signs += usize::from(run.output.contains(sign));
    }
    assert!(signs > 5, "`{sign}` with {signs} seeds");
}

#[test]
fn a_rover_stops_when_a_wheel_is_stuck() {
    fly("safe-drive", "a wheel is stuck\n");
}

#[test]
fn a_rover_takes_one_picture_and_keeps_warm() {
    fly("drive-to-target", "picture by the pancam\n");
}

#[test]
fn a_robot_lays_the_table() {
    fly("pick-and-place", "lost the ");
}

#[test]
fn robots_share_chargers_and_are_paused() {
    fly("warehouse", "300 orders delivered\n");
}

/// The tests of the door itself, with fifty seeds and with all that can be chosen.
#[test]
fn a_robot_passes_the_door() {
    let run = process::run(eslvm(&["test"]).arg(mission("cross-door.esl")), "");
    assert_eq!(run.status, Some(0), "{}{}", run.output, run.errors);
    assert!(run.output.ends_with("2 passed, 0 failed\n"), "{}", run.output);
}

/// A call that fails, never answers, or ends with its task leaves nothing on, and nothing waits for ever.
#[test]
fn faults_leave_no_mission_in_a_bad_state() {
    for name in ["cross-door", "drive-to-target", "pick-and-place", "safe-drive"] {
        let run = process::run(eslvm(&["test", "--inject"]).arg(mission(&format!("{name}.esl"))), "");
        assert_eq!(run.status, Some(0), "{name}: {}{}", run.output, run.errors);
    }
}
