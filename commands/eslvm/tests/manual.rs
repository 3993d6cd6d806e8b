//! The examples of the manual, of the cookbook, of the pages for users of other languages, and of
//! `README.md`, run by the commands; `conformance/src/chapter.rs` describes their form.

use std::path::Path;
use std::process::Command;

use esl_conformance::chapter::{Example, examples};
use esl_conformance::process;
use esl_conformance::transcript::{Transcript, compare};
use libtest_mimic::{Arguments, Failed, Trial};

/// Printed before each piece of a program, with its number.
const MARK: &str = "@@ piece ";

fn main() {
    let arguments = Arguments::from_args();
    let root = esl_conformance::root();
    let mut paths = vec![root.join("README.md")];
    for folder in ["docs/manual", "docs/cookbook", "docs/coming-from"] {
        for entry in std::fs::read_dir(root.join(folder)).expect("the documentation is there") {
            paths.push(entry.expect("the folder can be read").path());
        }
    }
    let mut trials = Vec::new();
    for path in paths {
        if path.extension().is_some_and(|extension| extension == "md") {
            let name = path.strip_prefix(root).unwrap_or(&path).with_extension("").display().to_string();
            let chapter = name.clone();
            trials.push(Trial::test(name, move || check(&chapter, &std::fs::read_to_string(&path)?)));
        }
    }
    libtest_mimic::run(&arguments, trials).exit();
}

fn check(name: &str, markdown: &str) -> Result<(), Failed> {
    let mut program = String::new();
    let mut outputs: Vec<(usize, Option<String>)> = Vec::new();
    for (line, example) in examples(markdown)? {
        match example {
            Example::Program { text, output } => {
                let number = outputs.len();
                program.push_str(&format!("(format t \"~&{MARK}{number}~%\")\n{text}"));
                outputs.push((line, output));
            }
            Example::Session(text) => {
                let session = Transcript::parse(&text);
                // The pieces so far, then a mark behind which the session's own output begins.
                let number = outputs.len();
                let begin = format!("(progn (format t \"~&{MARK}{number}~%\") (values))\n");
                let found = eslvm(&["repl"], &format!("{program}{begin}{}", session.input))?;
                let found = found.split(&format!("{MARK}{number}\n")).last().unwrap_or_default();
                session.compare(found).map_err(|text| format!("the session on line {line}: {text}"))?;
            }
        }
    }
    if outputs.is_empty() {
        return Ok(());
    }
    let found = eslvm(&["run", "--clock", "virtual", "-"], &program)?;
    for (number, (line, expected)) in outputs.iter().enumerate() {
        let Some(expected) = expected else { continue };
        let begin = format!("{MARK}{number}\n");
        let found = found.split_once(&begin).map_or("", |(_, rest)| rest);
        let found = found.split(MARK).next().unwrap_or_default();
        // `print` begins with an empty line, which the manual does not show.
        let plain: String =
            found.lines().filter(|line| !line.is_empty()).flat_map(|line| [line, "\n"]).collect();
        compare(expected, &plain).map_err(|text| format!("the program on line {line}: {text}"))?;
    }
    if program.contains("(deftest ") {
        let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{}.esl", name.replace('/', "-")));
        std::fs::write(&file, &program)?;
        let told = eslvm(&["test", &file.to_string_lossy()], "")?;
        if !told.trim_end().ends_with(" 0 failed") {
            return Err(told.into());
        }
    }
    Ok(())
}

/// Returns what a command writes when `input` is typed.
fn eslvm(arguments: &[&str], input: &str) -> Result<String, Failed> {
    let mut command = Command::new(env!("CARGO_BIN_EXE_eslvm"));
    command.args(arguments).current_dir(esl_conformance::root()).env("ESL_LIBRARY", "examples/library");
    Ok(process::run(&mut command, input).quiet_output().map_err(|text| format!("{arguments:?}: {text}"))?)
}
