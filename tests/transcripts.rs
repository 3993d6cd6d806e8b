//! Sessions with the REPL, typed into the command through a pipe: `conformance/transcripts/*.txt`.

use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use esl_conformance::session::Session;
use libtest_mimic::{Arguments, Failed, Trial};

fn main() {
    let arguments = Arguments::from_args();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("conformance/transcripts");
    let mut trials = Vec::new();
    for entry in std::fs::read_dir(folder).expect("the folder of transcripts is there") {
        let path = entry.expect("the folder of transcripts can be read").path();
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        trials.push(Trial::test(name, move || {
            let session = Session::parse(&std::fs::read_to_string(&path)?);
            let found = repl(&session.input)?;
            Ok(session.compare(&found)?)
        }));
    }
    libtest_mimic::run(&arguments, trials).exit();
}

/// What the REPL answers to what is typed.
fn repl(input: &str) -> Result<String, Failed> {
    let mut child = Command::new(env!("CARGO_BIN_EXE_eslvm"))
        .arg("repl")
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()?;
    let mut stdin = child.stdin.take().ok_or("no standard input")?;
    let input = input.to_string();
    let writer = std::thread::spawn(move || stdin.write_all(input.as_bytes()));
    let output = child.wait_with_output()?;
    // A session that ends itself need not read all.
    _ = writer.join();
    let errors = String::from_utf8(output.stderr)?;
    if !errors.is_empty() {
        return Err(format!("the session wrote to standard error: {errors}").into());
    }
    Ok(String::from_utf8(output.stdout)?)
}
