//! The examples come to their end, in virtual time and under several schedules.

use std::path::Path;

use esl_conformance::process;

use crate::folder::Folder;
use crate::{eslc, eslvm};

#[test]
fn examples_come_to_their_end() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples");
    let mut count = 0;
    for entry in std::fs::read_dir(folder).expect("the folder is there") {
        let path = entry.expect("it can be read").path();
        if path.extension().is_none_or(|extension| extension != "esl") {
            continue;
        }
        count += 1;
        for (seed, slice) in [("0", "2000"), ("1", "1"), ("2", "7"), ("3", "100")] {
            let options = ["run", "--clock", "virtual", "--seed", seed, "--slice", slice];
            let run = process::run(eslvm(&options).arg(&path), "");
            assert_eq!(run.status, Some(0), "{path:?}, seed {seed}, slice {slice}: {}", run.errors);
        }
    }
    assert!(count >= 3, "only {count} examples");
}

/// Under fifty seeds of faults the executive breaks no rule (its wheels are commanded by one activity at a
/// time, its battery is never empty) and the spacecraft points at the sun in the end.
#[test]
fn the_spacecraft_survives_its_faults() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/spacecraft/scripted.esl");
    let folder = Folder::new("spacecraft");
    let program = folder.join("scripted.eslb");
    let compiled = process::run(eslc(&["compile", "-o", &program]).arg(source), "");
    assert_eq!(compiled.status, Some(0), "{}", compiled.errors);
    let (mut safe_modes, mut violations) = (0, 0);
    for seed in 1..=50 {
        let seed = seed.to_string();
        let options = ["run", "--clock", "virtual", "--seed", &seed, "--trace", "failures", &program];
        let run = process::run(&mut eslvm(&options), "");
        assert_eq!(run.status, Some(0), "seed {seed}: {}{}", run.output, run.errors);
        assert!(run.output.ends_with("pointing at SUN, no rule broken\n"), "seed {seed}: {}", run.output);
        safe_modes += usize::from(run.output.contains("SAFE MODE"));
        violations += usize::from(run.errors.contains(":MAINTAINED-PROPERTY-VIOLATION"));
    }
    assert!(safe_modes > 5 && violations > 5, "{safe_modes} safe modes, {violations} violations");
}
