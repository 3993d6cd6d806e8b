//! Sessions with the REPL, typed into the command through a pipe: `conformance/transcripts/*.txt`.

use esl_conformance::process;
use esl_conformance::transcript::Transcript;

test_files! { check, "conformance/transcripts", "txt":
    contingencies = "contingencies.txt",
    database = "database.txt",
    goals = "goals.txt",
    repl = "repl.txt",
    reports = "reports.txt",
    restarts = "restarts.txt",
    tasks = "tasks.txt",
}

fn check(_: &str, text: &str) -> Result<(), String> {
    let transcript = Transcript::parse(text);
    let mut repl = crate::eslvm(&["repl"]);
    let found = process::run(repl.current_dir(esl_conformance::root()), &transcript.input);
    let found = found.quiet_output().map_err(|fault| fault.to_string())?;
    transcript.compare(&found).map_err(|fault| fault.to_string())
}
