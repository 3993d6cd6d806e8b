//! The tables of the examples. They are compared with files of this folder, which a person has read beside
//! the programs; `ESL_BLESS=1` writes them anew.

use std::path::{Path, PathBuf};

use esl::module_path::ModulePath;
use esl::program::{Source, compile_with_core};
use esl_analysis::render::{TableFormat, render, render_graph};
use esl_analysis::{AnalysisOptions, FailureTable, analyze};
use esl_conformance::folder::Folder;

/// Returns the table of a program of this repository, and the explanation of a cause.
fn table_of(program: &str, options: &AnalysisOptions) -> (FailureTable, String) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the package is in the workspace");
    let path: PathBuf = root.join(program);
    let text = std::fs::read_to_string(&path).expect("the program can be read");
    let modules = ModulePath::new(std::iter::once(path.as_path()), &[]);
    let mut compiled = compile_with_core(&[Source::new(program, text)], &modules);
    assert!(!compiled.has_errors(), "{program} compiles: {:?}", compiled.diagnostics);
    analyze(std::mem::take(&mut compiled.core), &compiled.sources, options)
}

/// Compares a text with a file of `tables`.
fn compare(file: &str, text: &str) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the package is in the workspace");
    // Modules are found by their paths.
    let text = text.replace(&format!("{}/", root.display()), "");
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/tables").join(file);
    if std::env::var_os("ESL_BLESS").is_some() {
        std::fs::create_dir_all(path.parent().expect("it is in a folder")).expect("the folder can be made");
        std::fs::write(&path, &text).expect("the table can be written");
    }
    let known = std::fs::read_to_string(&path).unwrap_or_default();
    assert_eq!(known, text, "the table of {file} has changed; `ESL_BLESS=1` writes it anew");
}

#[test]
fn tables_of_the_spacecraft() {
    let (table, _) = table_of("examples/spacecraft/scripted.esl", &AnalysisOptions::default());
    compare("spacecraft.txt", &render(&table, TableFormat::Text));
}

#[test]
fn tables_of_the_missions_and_the_watchdog() {
    let missions = ["cross-door", "drive-to-target", "pick-and-place", "safe-drive", "warehouse"];
    let missions = missions.map(|name| ("missions", name));
    for (folder, name) in missions.into_iter().chain([("watchdog", "watchdog"), ("watchdog", "service")]) {
        let program = format!("examples/{folder}/{name}.esl");
        let (table, _) = table_of(&program, &AnalysisOptions::default());
        compare(&format!("{name}.txt"), &render(&table, TableFormat::Text));
    }
}

#[test]
fn the_picture_of_the_spacecraft() {
    let (table, _) = table_of("examples/spacecraft/scripted.esl", &AnalysisOptions::default());
    compare("../../../examples/spacecraft/failures.svg", &render_graph(&table, "scripted.esl"));
}

#[test]
fn the_ways_of_a_cause() {
    let options = AnalysisOptions { all: false, explained: Some(":wheel-stuck".into()) };
    let (_, explanation) = table_of("examples/spacecraft/scripted.esl", &options);
    compare("wheel-stuck.txt", &explanation);
}

#[test]
fn the_chapter_shows_true_tables() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the package is in the workspace");
    let path = root.join("docs/manual/possible-failures.md");
    let chapter = std::fs::read_to_string(&path).expect("the chapter can be read");
    let parts: Vec<&str> = chapter.split("\n```").collect();
    let is_block =
        |part: &&&str, language: &str| part.strip_prefix(language).is_some_and(|text| text.starts_with('\n'));
    let program = parts.iter().find(|part| is_block(part, "lisp")).expect("it has a program");
    let mut compiled = compile_with_core(
        &[Source::new("mission.esl", program.trim_start_matches("lisp\n"))],
        &ModulePath::none(),
    );
    let cores = std::mem::take(&mut compiled.core);
    let options = AnalysisOptions { all: false, explained: Some(":wheel-stuck".into()) };
    let (table, explanation) = analyze(cores, &compiled.sources, &options);
    let texts = [render(&table, TableFormat::Text), explanation];
    let mut expected = texts.iter();
    let changed: Vec<String> = parts
        .iter()
        .map(|part| match is_block(&part, "text").then(|| expected.next()).flatten() {
            Some(text) => format!("text\n{}", text.trim_end()),
            None => (*part).to_string(),
        })
        .collect();
    let changed = changed.join("\n```");
    if std::env::var_os("ESL_BLESS").is_some() {
        std::fs::write(&path, &changed).expect("the chapter can be written");
    }
    assert_eq!(chapter, changed, "`ESL_BLESS=1` writes the tables of the chapter anew");
}

/// Returns the lines of the table of a program of `folder`, without numbers of lines; in the file `changed`,
/// the text `old` is replaced.
fn lines_with(folder: &str, program: &str, changed: &str, old: &str, new: &str) -> Vec<String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the package is in the workspace");
    let copy = Folder::new(&format!("mutated-{program}-{}", old.len() + new.len()));
    for entry in root.join(folder).read_dir().expect("the folder can be listed") {
        let path = entry.expect("the folder can be listed").path();
        let name = path.file_name().expect("it has a name").to_string_lossy().to_string();
        if name.ends_with(".esl") {
            let text = std::fs::read_to_string(&path).expect("the program can be read");
            assert!(name != changed || text.matches(old).count() == 1, "{old} is in {changed}, once");
            copy.file(&name, if name == changed { text.replace(old, new) } else { text });
        }
    }
    let path = copy.path().join(program);
    let text = std::fs::read_to_string(&path).expect("the program can be read");
    let modules = ModulePath::new(std::iter::once(path.as_path()), &[]);
    let mut compiled = compile_with_core(&[Source::new(program, text)], &modules);
    assert!(!compiled.has_errors(), "{program} compiles: {:?}", compiled.diagnostics);
    let cores = std::mem::take(&mut compiled.core);
    let (table, _) = analyze(cores, &compiled.sources, &AnalysisOptions::default());
    let text = render(&table, TableFormat::Text).replace(&format!("{}/", copy.path().display()), "");
    let line = |line: &str| {
        // The numbers of lines follow colons.
        let mut parts = line.split(".esl:");
        let mut shown = parts.next().unwrap_or_default().to_string();
        for part in parts {
            shown.push_str(part.trim_start_matches(|c: char| c.is_ascii_digit()));
        }
        shown.split_whitespace().collect::<Vec<_>>().join(" ")
    };
    text.lines().map(line).collect()
}

/// Returns the lines that a change of a program takes from its table, and those that it adds.
fn change(folder: &str, (program, changed): (&str, &str), old: &str, new: &str) -> Vec<String> {
    let before = lines_with(folder, program, changed, old, old);
    let after = lines_with(folder, program, changed, old, new);
    let surplus = |all: &[String], other: &[String]| {
        let mut left = other.to_vec();
        let mut surplus = Vec::new();
        for line in all {
            match left.iter().position(|known| known == line) {
                Some(place) => _ = left.remove(place),
                None => surplus.push(line.clone()),
            }
        }
        surplus
    };
    let lost = surplus(&before, &after).into_iter().map(|line| format!("- {line}"));
    let added = surplus(&after, &before).into_iter().map(|line| format!("+ {line}"));
    lost.chain(added).collect()
}

#[test]
fn a_change_of_a_program_changes_its_table_by_just_that() {
    let craft = |old, new| change("examples/spacecraft", ("scripted.esl", "executive.esl"), old, new);
    let mission = |old, new| change("examples/missions", ("safe-drive.esl", "safe-drive.esl"), old, new);
    // Without a clause, nothing takes its failure there.
    let clause = craft("(:blurred :retries 2 (retry))", "");
    // Without a limit, the failure no longer goes outward.
    let limit = craft("(:blurred :retries 2", "(:blurred :retries :infinite");
    // A cleanup without failures has no row; one with a failure has.
    let cleanup = "(setf *takes-pictures* nil)))\n\n(defun downlink";
    let harmless = craft(cleanup, "nil))\n\n(defun downlink");
    let failing = mission("(setf motors nil))\n  (incf", "(fail :motor-on))\n  (incf");
    let limited = "- in take-picture (executive): begins again, at most 2 times; then outward";
    let blurred = "- :blurred from expose (scripted)";
    assert_eq!(clause, [limited, blurred]);
    assert_eq!(limit, [limited, blurred, blurred, "+ in take-picture (executive): begins again"]);
    assert_eq!(harmless, [""; 0]);
    let motor = "+ :motor-on from drive (safe-drive)";
    let expected = [
        "- task main: no failure ends it",
        "- task drive (safe-drive): no failure ends it",
        "- task mock drive (safe-drive): no failure ends it",
        "- no failure leaves: note, rule, verdict, safe-drive, drive, take-picture",
        "+ task main: a failure ends the run",
        "+ ends by",
        motor,
        "+ task drive (safe-drive): a failure ends the task; its form takes that",
        "+ ends by",
        motor,
        "+ task mock drive (safe-drive): a failure is the failure of the operation",
        "+ ends by",
        motor,
        "+ function safe-drive (safe-drive)",
        motor,
        "+ function drive (safe-drive)",
        motor,
        "+ no failure leaves: note, rule, verdict, take-picture",
    ];
    assert_eq!(failing, expected);
}
