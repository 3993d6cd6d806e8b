//! Sessions with the REPL, typed into the command through a pipe: `conformance/transcripts/*.txt`.

use std::process::Command;

use esl_conformance::process;
use esl_conformance::transcript::Transcript;
use libtest_mimic::{Arguments, Trial};

fn main() {
    let arguments = Arguments::from_args();
    let root = esl_conformance::root();
    let folder = root.join("conformance/transcripts");
    let mut trials = Vec::new();
    for entry in std::fs::read_dir(folder).expect("the folder of transcripts is there") {
        let path = entry.expect("the folder of transcripts can be read").path();
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        trials.push(Trial::test(name, move || {
            let transcript = Transcript::parse(&std::fs::read_to_string(&path)?);
            let mut repl = Command::new(env!("CARGO_BIN_EXE_eslvm"));
            let found = process::run(repl.arg("repl").current_dir(root), &transcript.input).quiet_output()?;
            Ok(transcript.compare(&found)?)
        }));
    }
    libtest_mimic::run(&arguments, trials).exit();
}
