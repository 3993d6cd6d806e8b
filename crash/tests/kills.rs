//! Some kills of durable runs, as many as a gate has time for.

use std::path::Path;
use std::process::Command;

/// Seconds for each kind of kills.
const SECONDS: &str = "8";

#[test]
fn killed_runs_do_everything_once() {
    let own = env!("CARGO_BIN_EXE_esl-crash");
    let eslvm = Path::new(own).with_file_name("eslvm");
    assert!(eslvm.exists(), "{} is not there: type `cargo build --bin eslvm` first", eslvm.display());
    for options in [&["--kills", "100"][..], &["--kills", "40", "--places"]] {
        let mut command = Command::new(own);
        command.args(options).args(["--seconds", SECONDS, "--seed", "7", "--eslvm"]).arg(&eslvm);
        let done = command.output().expect("the command is there");
        let report = String::from_utf8_lossy(&done.stdout);
        let bad: Vec<&str> = report.lines().filter(|line| line.contains("BAD: ")).collect();
        assert_eq!(bad.len(), 8, "{report}{}", String::from_utf8_lossy(&done.stderr));
        assert!(bad.iter().all(|line| line.trim_start().starts_with("0 ")), "{report}");
    }
}
