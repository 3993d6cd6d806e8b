//! The examples come to their end, in virtual time and under several schedules.

use std::path::Path;

use esl_conformance::process;

use crate::eslvm;

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
