//! The documents hang together: each link among them leads to a file and a heading that exist, and the
//! contents of the site, `docs/SUMMARY.md`, have every page. Names in the documents of the code exist in its
//! sources.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Component, Path, PathBuf};

/// Folders of documents; `docs` and `examples` with all that is below them.
const FOLDERS: [&str; 26] = [
    "",
    "benches",
    "bytecode",
    "commands/eslc",
    "commands/eslvm",
    "commands/shared",
    "compiler",
    "conformance",
    "docs",
    "examples",
    "format",
    "fuzz",
    "heap",
    "language-server",
    "operate",
    "packaging",
    "plans",
    "replay",
    "robots",
    "stdlib",
    "syntax",
    "testing",
    "timeline",
    "trees",
    "vm",
    "world",
];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Adds the documents of a folder, with their texts, by their paths from the root.
fn collect(folder: &Path, is_deep: bool, found: &mut BTreeMap<PathBuf, String>) {
    for entry in fs::read_dir(root().join(folder)).expect("the folder can be listed") {
        let name = entry.expect("the folder can be listed").file_name();
        let path = folder.join(name);
        if root().join(&path).is_dir() {
            if is_deep {
                collect(&path, true, found);
            }
        } else if path.extension().is_some_and(|extension| extension == "md")
            && !root().join(&path).is_symlink()
        {
            let text = fs::read_to_string(root().join(&path)).expect("the document can be read");
            found.insert(path, text);
        }
    }
}

fn documents() -> BTreeMap<PathBuf, String> {
    let mut found = BTreeMap::new();
    for folder in FOLDERS {
        collect(Path::new(folder), folder == "docs" || folder == "examples", &mut found);
    }
    found
}

/// Returns the lines of a document that are not part of a block of code.
fn prose(text: &str) -> impl Iterator<Item = &str> {
    let mut is_code = false;
    text.lines().filter(move |line| {
        let is_fence = line.starts_with("```");
        is_code ^= is_fence;
        !is_code && !is_fence
    })
}

/// Returns the anchors of the headings of a document, as GitHub and mdBook make them.
fn anchors(text: &str) -> BTreeSet<String> {
    let headings = prose(text).filter(|line| line.starts_with('#'));
    let words = headings.map(|line| line.trim_start_matches('#').trim().to_lowercase());
    let kept = words.map(|words| {
        let kept = words.chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
        kept.map(|c| if c == ' ' { '-' } else { c }).collect()
    });
    kept.collect()
}

/// Returns the targets of the links of a document.
fn links(text: &str) -> Vec<&str> {
    let mut found = Vec::new();
    for line in prose(text) {
        // Text in backticks is not a link.
        for part in line.split('`').step_by(2) {
            found.extend(
                part.split("](").skip(1).filter_map(|rest| rest.split_once(')')).map(|(link, _)| link),
            );
        }
    }
    found.retain(|link| !link.contains("://"));
    found
}

/// Returns the path that a link of a document leads to, from the root.
fn target(document: &Path, link: &str) -> PathBuf {
    let mut path = document.parent().unwrap_or(Path::new("")).to_path_buf();
    for component in Path::new(link).components() {
        match component {
            Component::ParentDir => drop(path.pop()),
            Component::Normal(name) => path.push(name),
            _ => {}
        }
    }
    path
}

#[test]
fn every_link_leads_somewhere() {
    let documents = documents();
    let mut dead = Vec::new();
    for (document, text) in &documents {
        for link in links(text) {
            let (file, anchor) = link.split_once('#').unwrap_or((link, ""));
            let path = if file.is_empty() { document.clone() } else { target(document, file) };
            let is_there = root().join(&path).exists()
                && (anchor.is_empty()
                    || documents.get(&path).is_some_and(|text| anchors(text).contains(anchor)));
            if !is_there {
                dead.push(format!("{}: {link}", document.display()));
            }
        }
    }
    assert!(documents.len() > 50 && dead.is_empty(), "{}", dead.join("\n"));
}

#[test]
fn the_contents_of_the_site_have_every_page() {
    let documents = documents();
    let contents = Path::new("docs/SUMMARY.md");
    let listed: BTreeSet<PathBuf> =
        links(&documents[contents]).into_iter().map(|link| target(contents, link)).collect();
    let pages: BTreeSet<PathBuf> = documents
        .into_keys()
        .filter(|path| path.starts_with("docs") || path.starts_with("examples"))
        .filter(|path| path != contents)
        .collect();
    let missing: Vec<_> = pages.difference(&listed).collect();
    assert!(missing.is_empty(), "docs/SUMMARY.md leaves out {missing:?}");
}

/// Documents of the code, as opposed to those of the language.
const OF_THE_CODE: [&str; 15] = [
    "ARCHITECTURE.md",
    "CONTRIBUTING.md",
    "docs/glossary.md",
    "docs/manual/embedding.md",
    "docs/mechanisms.md",
    "bytecode/README.md",
    "compiler/README.md",
    "database/README.md",
    "heap/README.md",
    "host/README.md",
    "number/README.md",
    "native/README.md",
    "stdlib/README.md",
    "vm/README.md",
    "world/README.md",
];

/// Returns the names in the sources of the workspace: of opcodes, functions, types, features, files.
fn names_in_sources() -> BTreeSet<String> {
    let is_name = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    let (mut folders, mut names) = (vec![root().to_path_buf()], BTreeSet::new());
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).expect("the folder can be listed") {
            let path = entry.expect("the folder can be listed").path();
            let file = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
            if path.is_dir() {
                if file != "target" && !file.starts_with('.') {
                    folders.push(path);
                }
            } else if matches!(extension, "rs" | "esl" | "toml") {
                names.extend(file.strip_suffix(&format!(".{extension}")).map(String::from));
                let text = fs::read_to_string(&path).expect("a source can be read");
                names.extend(text.split(|c| !is_name(c)).filter(|word| word.len() > 1).map(String::from));
            } else {
                names.insert(file);
            }
        }
    }
    names
}

/// Returns the names in inline code that consist of several words: of opcodes and functions of the language
/// (`load-const`), of functions of Rust (`take_in`) and of variants (`TurnEnd::Held`).
fn names_in_code(text: &str) -> BTreeSet<&str> {
    let characters = |c: char| c.is_ascii_alphanumeric() || "_-:".contains(c);
    let is_name = |code: &&str| {
        code.starts_with(|c: char| c.is_ascii_alphabetic())
            && code.chars().all(characters)
            && (code.contains(['_', '-']) || code.contains("::"))
    };
    let names = text.split("\n```").step_by(2).flat_map(|part| part.split('`').skip(1).step_by(2));
    names.filter(is_name).flat_map(|name| name.split("::")).collect()
}

#[test]
fn the_documents_of_the_code_name_what_the_sources_have() {
    let sources = names_in_sources();
    let mut named = 0;
    for document in OF_THE_CODE {
        let text = fs::read_to_string(root().join(document)).expect("the document can be read");
        let names = names_in_code(&text);
        named += names.len();
        let missing: Vec<&&str> = names.iter().filter(|name| !sources.contains(**name)).collect();
        assert!(missing.is_empty(), "{document} names {missing:?}");
    }
    assert!(named > 50, "only {named} names");
    let text = "`load-const` and `A::b_c`, not `--all`, `a b-c` or\n```\n`x-y`\n```\n`z_z`";
    assert_eq!(names_in_code(text), ["A", "b_c", "load-const", "z_z"].into());
}
