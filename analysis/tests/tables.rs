//! The tables of the examples. They are compared with files of this folder, which a person has read beside
//! the programs; `ESL_BLESS=1` writes them anew.

use std::path::{Path, PathBuf};

use esl::module_path::ModulePath;
use esl::program::{Source, compile_with_core};
use esl_analysis::render::{TableFormat, render, render_graph};
use esl_analysis::{AnalysisOptions, FailureTable, analyze};

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
