//! The examples come to their end, in virtual time and under several schedules.

use std::path::Path;
use std::process::{Command, Stdio};

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
            let output = Command::new(env!("CARGO_BIN_EXE_eslvm"))
                .args(["run", "--clock", "virtual", "--seed", seed, "--slice", slice])
                .arg(&path)
                .stdin(Stdio::null())
                .output()
                .expect("the command can be run");
            let errors = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.success(), "{}, seed {seed}, slice {slice}: {errors}", path.display());
        }
    }
    assert!(count >= 3, "only {count} examples");
}
