//! The tutorial, `docs/tutorial/*.md`, done as a reader does it, from the first line to the last in one new
//! folder.
//!
//! A `lisp` block whose first line is a comment with the name of a file becomes that file. In a `console`
//! block, lines that begin with `$ ` are run by a shell, those that begin with `? ` are typed at the prompt
//! of the REPL, and the rest is what is to be seen.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use esl_conformance::process;
use esl_conformance::transcript::{Transcript, compare};

/// A block of a page: its language and its text, and the line on which it begins.
struct Block<'a> {
    language: &'a str,
    text: String,
    line: usize,
}

/// Returns the blocks of a page.
fn blocks(markdown: &str) -> Vec<Block<'_>> {
    let mut found = Vec::new();
    let mut lines = markdown.lines().zip(1..);
    while let Some((text, line)) = lines.next() {
        if let Some(language) = text.strip_prefix("```") {
            let inside = lines.by_ref().map(|(text, _)| text).take_while(|text| *text != "```");
            let text = inside.flat_map(|text| [text, "\n"]).collect();
            found.push(Block { language, text, line });
        }
    }
    found
}

/// Returns the path of the folder of the commands under test in front of the search path.
fn search_path() -> std::ffi::OsString {
    let commands = Path::new(crate::ESLVM).parent().expect("the command is in a folder");
    let others = std::env::var_os("PATH").unwrap_or_default();
    let folders = std::iter::once(commands.to_path_buf()).chain(std::env::split_paths(&others));
    std::env::join_paths(folders).expect("the folders have plain names")
}

/// Lines of the library move with every change of it: their numbers are not compared.
fn without_lines_of_library(text: &str) -> String {
    let mut pieces = text.split("stdlib/");
    let mut result = pieces.next().unwrap_or_default().to_string();
    for piece in pieces {
        let (file, rest) = piece.split_once(".esl:").unwrap_or((piece, ""));
        result.push_str("stdlib/");
        result.push_str(file);
        result.push_str(rest.trim_start_matches(|c: char| c.is_ascii_digit() || c == ':'));
    }
    result
}

/// Runs the commands of a `console` block, and compares what they show.
fn run(block: &Block<'_>, folder: &Path) -> Result<(), String> {
    let Some(text) = block.text.strip_prefix("$ ") else {
        return Err("a console block begins with a command".into());
    };
    for step in text.split("\n$ ") {
        let (command, shown) = step.split_once('\n').unwrap_or((step, ""));
        let session = Transcript::parse(shown);
        let expected = if session.input.is_empty() { shown } else { session.output.as_str() };
        let mut shell = Command::new("sh");
        shell.arg("-c").arg(format!("exec 2>&1; {command}")).current_dir(folder).env("PATH", search_path());
        shell.env_remove("ESL_LIBRARY");
        let found = process::run(&mut shell, &session.input).output;
        compare(&without_lines_of_library(expected), &without_lines_of_library(&found))
            .map_err(|fault| format!("{command}: {fault}"))?;
    }
    Ok(())
}

/// Returns the pages in the order of reading.
fn pages() -> Vec<PathBuf> {
    let folder = esl_conformance::root().join("docs/tutorial");
    let entries = fs::read_dir(folder).expect("the tutorial is there");
    let paths = entries.map(|entry| entry.expect("the tutorial can be listed").path());
    let is_step = |path: &PathBuf| {
        path.extension().is_some_and(|extension| extension == "md")
            && path.file_name().is_some_and(|name| name.as_encoded_bytes()[0].is_ascii_digit())
    };
    let mut pages: Vec<PathBuf> = paths.filter(is_step).collect();
    pages.sort();
    pages
}

#[test]
fn the_tutorial_shows_what_a_reader_sees() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("tutorial");
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).expect("the folder can be made");
    let pages = pages();
    assert_eq!(pages.len(), 9);
    let mut faults = Vec::new();
    for page in &pages {
        let markdown = fs::read_to_string(page).expect("the page can be read");
        for block in blocks(&markdown) {
            let first = block.text.lines().next().unwrap_or_default();
            match (block.language, first.strip_prefix("; ").filter(|name| name.ends_with(".esl"))) {
                ("lisp", Some(name)) => fs::write(folder.join(name), &block.text).expect("it can be written"),
                ("console", _) => {
                    if let Err(fault) = run(&block, &folder) {
                        faults.push(format!("{}:{}: {fault}", page.display(), block.line));
                    }
                }
                _ => {}
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    // The picture of the page is that of the run.
    let drawn = fs::read_to_string(folder.join("mission.svg")).expect("the timeline is drawn");
    let shown = fs::read_to_string(pages[0].with_file_name("mission.svg")).expect("the picture is there");
    assert!(
        drawn == shown,
        "docs/tutorial/mission.svg is not that of the run: copy it from {}",
        folder.display()
    );
}
