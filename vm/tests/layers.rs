//! The layers of the machine: each module of `vm/src` uses only modules that come before it in the list.
//!
//! A use is a path that begins with `crate::`, or a call of a method that a module adds to `Vm`. Unit
//! tests may use everything. The modules that `lib.rs` takes from other crates are below all others and
//! need no mention.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// The modules, lowest first.
const LAYERS: &[&str] = &[
    // Below everything: settings, promises on which unsafe code relies.
    "config",
    "fused",
    "shape",
    "tier",
    "trust",
    // Names and code, data from and to the compiler, words for values, failures.
    "names",
    "datum",
    "describe",
    "raise",
    // The parts of the machine: data with their own operations.
    "task",
    "wait",
    "outside",
    "lookup",
    "overhead",
    "exchange",
    "schedule",
    "observe",
    "compiler",
    "cpu",
    "embedder",
    "vm",
    "state",
    "snapshot",
    // Operations on the machine as a whole.
    "number",
    "types",
    "interp",
    "stored",
    "report",
    "run",
    "environment",
    "builtins",
    "explore",
    "embed",
];

/// A source file without its unit tests and comments.
struct Source {
    /// Its path below `src`.
    path: String,
    /// The top-level module that it belongs to.
    module: String,
    text: String,
}

/// Returns all sources of the crate but `lib.rs` and files of unit tests.
fn sources() -> Vec<Source> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut found = Vec::new();
    let mut open: Vec<PathBuf> = vec![root.clone()];
    while let Some(folder) = open.pop() {
        for entry in fs::read_dir(&folder).expect("the sources can be read") {
            let path = entry.expect("the sources can be read").path();
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            if path.is_dir() {
                if name != "tests" {
                    open.push(path);
                }
                continue;
            }
            if name == "lib.rs" || name == "tests.rs" || !name.ends_with(".rs") {
                continue;
            }
            let below =
                path.strip_prefix(&root).expect("it is below the root").to_string_lossy().into_owned();
            let module = below.split('/').next().unwrap_or_default().trim_end_matches(".rs").to_string();
            let text = fs::read_to_string(&path).expect("the sources can be read");
            found.push(Source { path: below, module, text: without_tests_and_comments(&text) });
        }
    }
    found
}

fn without_tests_and_comments(text: &str) -> String {
    let code = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
    code.lines().map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n")
}

/// Returns the identifiers that follow `prefix` in a text.
fn identifiers_after<'a>(text: &'a str, prefix: &'a str) -> impl Iterator<Item = &'a str> {
    text.split(prefix).skip(1).map(|rest| {
        let end = rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len());
        &rest[..end]
    })
}

/// Returns the names of the methods that are called on what ends with `receiver`.
fn calls_after<'a>(text: &'a str, receiver: &'a str) -> impl Iterator<Item = &'a str> {
    text.split(receiver).skip(1).filter_map(|rest| {
        let end = rest.find(|c: char| !c.is_alphanumeric() && c != '_')?;
        rest[end..].starts_with('(').then_some(&rest[..end])
    })
}

/// Returns the blocks in which a source adds methods to `Vm`.
fn vm_blocks(text: &str) -> impl Iterator<Item = &str> {
    text.split("\nimpl Vm {").skip(1).map(|rest| rest.split("\n}").next().unwrap_or_default())
}

/// Returns the names of the methods that each module adds to `Vm`.
fn methods_of_vm(sources: &[Source]) -> BTreeMap<String, String> {
    let mut methods = BTreeMap::new();
    for source in sources {
        for block in vm_blocks(&source.text) {
            for line in block.lines().filter(|line| line.starts_with("    ") && !line.starts_with("     ")) {
                methods
                    .extend(identifiers_after(line, "fn ").map(|name| (name.into(), source.module.clone())));
            }
        }
    }
    methods
}

#[test]
fn each_module_uses_only_those_before_it() {
    let sources = sources();
    let rank = |module: &str| LAYERS.iter().position(|&layer| layer == module);
    let methods = methods_of_vm(&sources);
    let mut violations = BTreeSet::new();
    for source in &sources {
        let own = rank(&source.module);
        assert!(own.is_some(), "{} is missing from the list of layers", source.module);
        let used = identifiers_after(&source.text, "crate::").map(|module| (module, module));
        let in_blocks = vm_blocks(&source.text).flat_map(|block| calls_after(block, "self."));
        let called = calls_after(&source.text, "vm.")
            .chain(in_blocks)
            .filter_map(|name| Some((name, methods.get(name)?.as_str())));
        for (name, module) in used.chain(called) {
            if module != source.module && rank(module) >= own {
                violations.insert(format!("{}: {name} of {module}", source.path));
            }
        }
    }
    assert!(violations.is_empty(), "these use a module of a higher layer:\n{violations:#?}");
}

#[test]
fn every_layer_exists() {
    let modules: BTreeSet<String> = sources().into_iter().map(|source| source.module).collect();
    for layer in LAYERS {
        assert!(modules.contains(*layer), "there is no module {layer}");
    }
}
