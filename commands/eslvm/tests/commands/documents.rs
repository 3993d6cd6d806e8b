//! The documents write commands as they are: each subcommand and each option that they name exists.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use esl_conformance::process;

use crate::{eslc, eslvm};

/// Returns the documents below a folder, without those of builds, and without the changelog, which also names
/// options of the past.
fn documents(folder: &Path) -> Vec<PathBuf> {
    let (mut folders, mut found) = (vec![folder.to_path_buf()], Vec::new());
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("the folder can be listed") {
            let path = entry.expect("the folder can be listed").path();
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            if path.is_dir() {
                if name != "target" && !name.starts_with('.') {
                    folders.push(path);
                }
            } else if name.ends_with(".md") && name != "CHANGELOG.md" {
                found.push(path);
            }
        }
    }
    found
}

/// Returns the lines of blocks of code and the pieces of inline code that begin with one of the commands.
fn commands(markdown: &str) -> Vec<String> {
    let mut found = Vec::new();
    for (number, part) in markdown.split("\n```").enumerate() {
        if number % 2 == 0 {
            found.extend(part.split('`').skip(1).step_by(2).map(String::from));
        } else {
            found.extend(part.lines().skip(1).map(|line| line.trim_start_matches("$ ").to_string()));
        }
    }
    found.retain(|code| code.starts_with("eslc ") || code.starts_with("eslvm "));
    found
}

/// Returns the subcommand of a command, and the options before the program that it runs.
fn parts(command: &str) -> Option<(&str, Vec<&str>)> {
    let mut words = command.split_whitespace().skip(1);
    let subcommand = words.next().filter(|word| word.chars().all(|c| c.is_ascii_lowercase()))?;
    let own = words.take_while(|word| !word.ends_with(".esl") && !matches!(*word, "--" | "|" | "#" | "&&"));
    let options = own.filter(|word| word.starts_with("--"));
    let names = options.filter_map(|word| word.split(['=', '[', ',', '…']).next());
    Some((subcommand, names.collect()))
}

#[test]
fn the_documents_name_subcommands_and_options_that_exist() {
    let mut helps: BTreeMap<(bool, String), Option<BTreeSet<String>>> = BTreeMap::new();
    let (mut count, mut faults) = (0, Vec::new());
    for path in documents(esl_conformance::root()) {
        let text = std::fs::read_to_string(&path).expect("the document can be read");
        for command in commands(&text) {
            let Some((subcommand, options)) = parts(&command) else { continue };
            count += 1;
            let compiles = command.starts_with("eslc ");
            let known = helps.entry((compiles, subcommand.to_string())).or_insert_with(|| {
                let arguments = [subcommand, "--help"];
                let help = process::run(&mut if compiles { eslc(&arguments) } else { eslvm(&arguments) }, "");
                let words = help.output.split(|c: char| !c.is_ascii_alphanumeric() && c != '-');
                (help.status == Some(0)).then(|| words.map(String::from).collect())
            });
            if !known.as_ref().is_some_and(|known| options.iter().all(|option| known.contains(*option))) {
                faults.push(format!("{}: {command}", path.display()));
            }
        }
    }
    assert!(count > 80, "only {count} commands");
    assert!(faults.is_empty(), "no such subcommand or option:\n{}", faults.join("\n"));
}

#[test]
fn commands_are_found_in_blocks_and_in_inline_code() {
    let text = "`eslvm run --clock\nvirtual a.esl --mine` and `eslvm`\n```sh\n$ eslc check --deny=x b.esl\nls\n```\n";
    let found = commands(text);
    assert_eq!(found, ["eslvm run --clock\nvirtual a.esl --mine", "eslc check --deny=x b.esl"]);
    let found: Vec<_> = found.iter().filter_map(|command| parts(command)).collect();
    assert_eq!(found, [("run", vec!["--clock"]), ("check", vec!["--deny"])]);
    assert_eq!(parts("eslvm hello.esl"), None);
}
