//! The fence around unsafe code: where it may stand, and that each use names the fact it relies on.

use std::fs;
use std::path::{Path, PathBuf};

/// The only places with unsafe code: the heap, the loop, machine code, what all rely on, the name of a parser
/// in C, names of functions that JavaScript and the starter of the wheel call, and the border to C.
const ALLOWED: [&str; 9] = [
    "capi/src/",
    "heap/",
    "native/",
    "vm/src/interp/",
    "vm/src/cpu.rs",
    "vm/src/trust.rs",
    "editors/tree-sitter/",
    "playground/src/abi.rs",
    "python/src/command.rs",
];
/// Crates that do not forbid unsafe code, since they have such a place, or since macros of PyO3 write some.
const WITH_UNSAFE_CODE: [&str; 7] = ["capi", "python", "heap", "heap/testing", "native", "vm", "playground"];
/// Documents that say where unsafe code stands.
const DOCUMENTS: [&str; 2] = ["README.md", "ARCHITECTURE.md"];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Collects the Rust files below a directory, build products left out.
fn collect_sources(directory: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(directory).expect("the sources can be listed") {
        let path = entry.expect("the sources can be listed").path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if path.is_dir() && name != "target" && !name.starts_with('.') {
            collect_sources(&path, found);
        } else if name.ends_with(".rs") {
            found.push(path);
        }
    }
}

/// Every Rust file of the workspace: its path from the root, and its text.
fn sources() -> Vec<(String, String)> {
    let mut found = Vec::new();
    collect_sources(root(), &mut found);
    assert!(found.len() > 100, "the sources are where this test looks for them");
    let relative =
        |path: &Path| path.strip_prefix(root()).unwrap_or(path).to_string_lossy().replace('\\', "/");
    found.iter().map(|path| (relative(path), read(path))).collect()
}

/// Whether a line of code has the keyword `unsafe`.
fn is_unsafe(line: &str) -> bool {
    let code = line.split("//").next().unwrap_or_default();
    let mut words = code.split(|c: char| !c.is_alphanumeric() && c != '_');
    words.any(|word| word == "unsafe")
}

#[test]
fn unsafe_code_stands_inside_the_fence() {
    let mut outside = Vec::new();
    for (path, text) in sources() {
        // This file has the word in its strings.
        if ALLOWED.iter().any(|place| path.starts_with(place)) || path == "tests/unsafe_code.rs" {
            continue;
        }
        let lines = text.lines().enumerate().filter(|(_, line)| is_unsafe(line));
        outside.extend(lines.map(|(number, line)| format!("{path}:{}: {}", number + 1, line.trim())));
    }
    assert!(outside.is_empty(), "unsafe code outside of {ALLOWED:?}:\n{}", outside.join("\n"));
}

#[test]
fn every_other_crate_forbids_unsafe_code() {
    let manifest = read(&root().join("Cargo.toml"));
    let members = manifest.split("members = [").nth(1).and_then(|rest| rest.split(']').next());
    let members = members.expect("there are members").split('"').skip(1).step_by(2);
    let mut crates = vec![PathBuf::from("src/lib.rs")];
    for name in members.filter(|name| !WITH_UNSAFE_CODE.contains(name)) {
        let heads = ["src/lib.rs", "src/main.rs"].map(|head| Path::new(name).join(head));
        crates.extend(heads.into_iter().filter(|head| root().join(head).exists()));
    }
    assert!(crates.len() > 15, "the crates are where this test looks for them");
    for path in crates {
        let text = read(&root().join(&path));
        assert!(text.contains("#![forbid(unsafe_code)]"), "{} does not forbid unsafe code", path.display());
    }
}

#[test]
fn documents_name_the_places() {
    for document in DOCUMENTS {
        let text = read(&root().join(document));
        let mut paragraphs = text.split("\n\n").flat_map(|paragraph| paragraph.split("\n- "));
        let names_them =
            |paragraph: &str| ALLOWED.iter().all(|place| paragraph.contains(&format!("`{place}`")));
        assert!(paragraphs.any(names_them), "{document} says where unsafe code stands: {ALLOWED:?}");
    }
}

/// A note that only points elsewhere leaves its reader to guess what holds.
#[test]
fn safety_notes_name_a_fact() {
    const VAGUE: [&str; 7] = ["as ", "see ", "likewise", "same ", "safe", "ditto", "by the contract."];
    let mut vague = Vec::new();
    for (path, text) in sources() {
        if path == "tests/unsafe_code.rs" {
            continue;
        }
        for (number, line) in text.lines().enumerate() {
            let Some((_, note)) = line.split_once("// SAFETY: ") else { continue };
            // The name of an item alone, such as `V4.`, does not say what of it matters here.
            let is_short = note.split_whitespace().count() < 4;
            if is_short || VAGUE.iter().any(|start| note.to_lowercase().starts_with(start)) {
                vague.push(format!("{path}:{}: {}", number + 1, line.trim()));
            }
        }
    }
    assert!(vague.is_empty(), "these notes do not name the fact that they rely on:\n{}", vague.join("\n"));
}
