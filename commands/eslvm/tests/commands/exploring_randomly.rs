//! `eslvm explore --random`: the guarantee, seeds, progress in a file, coverage of orders.

use esl_conformance::folder::Folder;

use crate::exploring::{LOST_SIGNAL, run};

/// Random schedules state their guarantee, and are repeated and resumed by their seeds.
#[test]
fn random_schedules_find_what_they_promise() {
    let folder = Folder::new("exploring-random");
    folder.file("lost.esl", LOST_SIGNAL);
    let (status, output, errors) = run(&folder, &["explore", "--random", "100", "lost.esl"]);
    assert_eq!((status, errors.as_str()), (Some(1), ""), "{output}");
    assert!(output.starts_with("finding 1: no task can ever run again\n  time  "), "{output}");
    assert!(
        output.contains("\nviolation: findings: 1 (grain variables, timers idle; 100 random schedules)\n"),
        "{output}"
    );
    assert!(output.contains("of at least 1/(3 tasks * ") && output.contains(" steps^2) = "), "{output}");
    assert!(output.ends_with("\nto go on: --seed 101\n"), "{output}");
    assert_eq!(run(&folder, &["run", "--schedule", "lost-1.schedule", "lost.esl"]).0, Some(4));
    folder.file("right.esl", "(task-net (one (print 1)) (two (print 2)))");
    let few = ["explore", "--random", "10", "--seed", "31", "--depth", "2", "--json", "right.esl"];
    let (status, output, errors) = run(&folder, &few);
    assert_eq!((status, errors.as_str()), (Some(7), ""), "{output}");
    let figures: serde_json::Value = serde_json::from_str(&output).expect("it is JSON");
    assert_eq!((&figures["random"], &figures["next-seed"]), (&10.into(), &41.into()));
    assert_eq!(run(&folder, &["explore", "--seed", "1", "right.esl"]).0, Some(2));
}

/// Random schedules that are stopped go on from a file, with their findings; the orders of places are told.
#[test]
fn random_schedules_go_on_from_their_progress() {
    let folder = Folder::new("exploring-progress");
    folder.file("lost.esl", LOST_SIGNAL);
    folder.file("other.esl", "(task-net (one (print 1)) (two (print 2)))");
    let explore = |more: &[&str]| run(&folder, &[&["explore", "--progress", "lost.progress"], more].concat());
    let (status, output, errors) = explore(&["--random", "40", "lost.esl"]);
    assert_eq!((status, errors.as_str()), (Some(1), ""), "{output}");
    assert!(output.contains("; 40 random schedules)\n"), "{output}");
    assert!(output.contains("\npairs of places of two tasks: "), "{output}");
    assert!(output.contains("earlier runs have tried 0; "), "{output}");
    assert_eq!(run(&folder, &["run", "--schedule", "lost-1.schedule", "lost.esl"]).0, Some(4));
    let (status, again, _) = explore(&["--random", "100", "--json", "lost.esl"]);
    let figures: serde_json::Value =
        serde_json::from_str(again.lines().last().unwrap_or_default()).expect("JSON");
    assert_eq!(
        (status, &figures["random"], &figures["before"]),
        (Some(1), &100.into(), &40.into()),
        "{again}"
    );
    assert!(figures["pairs"].as_u64() >= figures["covered"].as_u64(), "{again}");
    assert!(figures["covered"].as_u64() > Some(0), "{again}");
    // Nothing is left to be tried; the findings of before are there.
    let (status, output, _) = explore(&["--random", "100", "lost.esl"]);
    assert_eq!(status, Some(1), "{output}");
    assert!(output.starts_with("finding 1: no task can ever run again\n"), "{output}");
    assert!(output.contains("earlier runs have tried 100; "), "{output}");
    // One series of the same schedules finds the same.
    let (_, alone, _) = run(&folder, &["explore", "--random", "100", "--json", "lost.esl"]);
    let alone: serde_json::Value =
        serde_json::from_str(alone.lines().last().unwrap_or_default()).expect("JSON");
    for name in ["tasks", "steps", "findings", "probability", "next-seed"] {
        assert_eq!(alone[name], figures[name], "{name}");
    }
    // Without a number, the time is the limit.
    let (_, output, _) = explore(&["--random", "--time", "100ms", "lost.esl"]);
    assert!(output.contains("earlier runs have tried 100; "), "{output}");
    let (status, _, errors) = explore(&["--random", "10", "other.esl"]);
    assert_eq!(status, Some(2));
    assert!(errors.contains("is the progress of another program"), "{errors}");
    folder.file("lost.progress", "{}");
    assert_eq!(explore(&["--random", "10", "lost.esl"]).0, Some(2));
}
