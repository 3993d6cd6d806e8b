//! Layers: within each folder of the compiler, the files can be put in an order in which each uses only files before it.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// The files and folders that each file or folder in `folder` names by `super::`.
fn uses(folder: &Path) -> BTreeMap<String, BTreeSet<String>> {
    let mut texts = BTreeMap::new();
    for entry in fs::read_dir(folder).expect("the folder is there") {
        let path = entry.expect("the folder can be read").path();
        let name = path.file_stem().expect("a file has a name").to_string_lossy().into_owned();
        let is_source = path.extension().is_some_and(|extension| extension == "rs") || path.is_dir();
        if is_source && name != "mod" && name != "tests" {
            let file = if path.is_dir() { path.join("mod.rs") } else { path };
            texts.insert(name, fs::read_to_string(file).expect("the file is text"));
        }
    }
    // `use super::a::{b, c};` names `a`, and `use super::{a, b};` names both.
    let named = |text: &str| {
        let paths = text.split("use super::").skip(1).map(|rest| rest.split(';').next().unwrap_or_default());
        let heads = paths.flat_map(|path| match path.strip_prefix('{') {
            Some(list) => list.split([',', '}']).collect(),
            None => vec![path],
        });
        let heads = heads.map(|head| head.split("::").next().unwrap_or_default().trim().to_string());
        heads.filter(|head| texts.contains_key(head)).collect()
    };
    texts.iter().map(|(name, text)| (name.clone(), named(text))).collect()
}

#[test]
fn files_use_only_files_before_them() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    for folder in ["diagnostic", "expand", "lower", "reader", "resolve", "session"] {
        let mut left = uses(&root.join(folder));
        assert!(!left.is_empty(), "{folder} has files");
        // Take away files that use none of those left, until no file is left.
        while let Some(lowest) = left.iter().find(|(_, uses)| uses.is_empty()).map(|(name, _)| name.clone()) {
            left.remove(&lowest);
            left.values_mut().for_each(|uses| {
                uses.remove(&lowest);
            });
        }
        assert!(left.is_empty(), "{folder} has a circle of uses among {left:#?}");
    }
}
