//! The examples of the manual, of the cookbook, of the pages for users of other languages, and of
//! `README.md`, run by the commands; `conformance/src/chapter.rs` describes their form.

use std::path::Path;

use esl_conformance::chapter::{Example, examples};
use esl_conformance::process;
use esl_conformance::transcript::{Transcript, compare};

use crate::listed;

/// Printed before each piece of a program, with its number.
const MARK: &str = "@@ piece ";

mod chapters {
    test_files! { super::check, "docs/manual", "md":
        readme = "README.md",
        base_language = "base-language.md",
        behaviour_trees_import = "behaviour-trees-import.md",
        c = "c.md",
        coordination = "coordination.md",
        database = "database.md",
        durable = "durable.md",
        embedding = "embedding.md",
        failure = "failure.md",
        faults = "faults.md",
        fleets = "fleets.md",
        goals = "goals.md",
        mavlink = "mavlink.md",
        mcap = "mcap.md",
        modules = "modules.md",
        operate = "operate.md",
        plans = "plans.md",
        possible_failures = "possible-failures.md",
        property_locks = "property-locks.md",
        python = "python.md",
        realtime = "realtime.md",
        reference = "reference.md",
        repl = "repl.md",
        replay = "replay.md",
        robots = "robots.md",
        tasks = "tasks.md",
        testing = "testing.md",
        tools = "tools.md",
        world = "world.md",
    }
}

mod cookbook {
    test_files! { super::check, "docs/cookbook", "md":
        readme = "README.md",
        coordination = "coordination.md",
        data = "data.md",
        failures = "failures.md",
        knowledge = "knowledge.md",
        robots = "robots.md",
        tasks = "tasks.md",
        tests = "tests.md",
        upgrades = "upgrades.md",
    }
}

mod coming_from {
    test_files! { super::check, "docs/coming-from", "md":
        readme = "README.md",
        behaviour_trees = "behaviour-trees.md",
        common_lisp = "common-lisp.md",
        erlang = "erlang.md",
        plansys2 = "plansys2.md",
        plexil = "plexil.md",
        python = "python.md",
        rclpy = "rclpy.md",
        remote_agent = "remote-agent.md",
    }
}

#[test]
fn readme() {
    listed::run("README.md", check);
}

fn check(path: &str, markdown: &str) -> Result<(), String> {
    let mut program = String::new();
    let mut outputs: Vec<(usize, Option<String>)> = Vec::new();
    for (line, example) in examples(markdown).map_err(|fault| fault.to_string())? {
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
        let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{}.esl", path.replace('/', "-")));
        std::fs::write(&file, &program).map_err(|error| error.to_string())?;
        // The programs of a chapter are one file here: the exploration of a test would find what another
        // program is to show, as that two valves are open.
        let told = eslvm(&["test", "--no-explore", &file.to_string_lossy()], "")?;
        if !told.trim_end().ends_with(" 0 failed") {
            return Err(told);
        }
    }
    Ok(())
}

/// Returns what a command writes when `input` is typed.
fn eslvm(arguments: &[&str], input: &str) -> Result<String, String> {
    let mut command = crate::eslvm(arguments);
    command.current_dir(esl_conformance::root()).env("ESL_LIBRARY", "examples/library");
    process::run(&mut command, input).quiet_output().map_err(|text| format!("{arguments:?}: {text}"))
}
