//! The table of codes and the page made from it.

use std::collections::HashSet;
use std::fs;
use std::path::{Path, PathBuf};

use esl_bytecode::span::SourceId;
use esl_compiler::diagnostic::{Stage, code, document};
use esl_compiler::reader::{BareEnvironment, Reader};

#[test]
fn codes_are_words_joined_by_hyphens_and_differ() {
    let mut seen = HashSet::new();
    for code in code::ALL {
        assert!(seen.insert(code.name), "{} is there twice", code.name);
        assert!(
            code.name.bytes().all(|b| b == b'-' || b.is_ascii_lowercase() || b.is_ascii_digit()),
            "{}",
            code.name
        );
        assert!(code.summary.ends_with('.'), "{}: {}", code.name, code.summary);
        assert_eq!(code.failing.is_empty(), code.repaired.is_empty(), "{}", code.name);
        assert_eq!(code::find(code.name), Some(*code));
    }
    assert_eq!(code::find("no-such-code"), None);
}

/// The codes that reading `program` reports.
fn reported(program: &str) -> Vec<&'static str> {
    let mut environment = BareEnvironment::new();
    let mut reader = Reader::new(SourceId::default(), program);
    let read = std::iter::from_fn(|| reader.next(&mut environment));
    read.filter_map(|read| read.err().map(|error| error.code)).collect()
}

#[test]
fn the_programs_of_the_reader_s_codes_have_them_and_the_repaired_ones_do_not() {
    for code in code::ALL {
        let expected =
            if code.stage == Stage::Reader && !code.failing.is_empty() { vec![code.name] } else { vec![] };
        assert_eq!(reported(code.failing), expected, "{}", code.failing);
        assert_eq!(reported(code.repaired), [""; 0], "{}", code.repaired);
    }
}

/// The files below `folder`, with their texts.
fn rust_files(folder: &Path, files: &mut Vec<(PathBuf, String)>) {
    for entry in fs::read_dir(folder).expect("the folder is there") {
        let path = entry.expect("the folder can be read").path();
        if path.is_dir() {
            rust_files(&path, files);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let text = fs::read_to_string(&path).expect("the file is text");
            files.push((path, text));
        }
    }
}

#[test]
fn only_the_table_makes_diagnostics() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = Vec::new();
    rust_files(&root.join("src"), &mut files);
    rust_files(&root.join("../src"), &mut files);
    let makers = files.iter().filter(|(_, text)| text.contains("Diagnostic::new("));
    let makers: Vec<_> = makers.map(|(path, _)| path.strip_prefix(root).unwrap_or(path)).collect();
    assert_eq!(makers, [Path::new("src/diagnostic/code.rs")]);
}

#[test]
fn the_page_of_the_manual_is_up_to_date() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/diagnostics.md");
    let page = document::markdown();
    if std::env::var_os("ESL_BLESS").is_some() {
        fs::write(&path, &page).expect("docs/ can be written");
    }
    let found = fs::read_to_string(&path).unwrap_or_default().replace("\r\n", "\n");
    assert!(
        found == page,
        "docs/diagnostics.md is out of date; run ESL_BLESS=1 cargo test -p esl-compiler --test diagnostics"
    );
}
