//! Layers: the folders of the compiler, and the files within each folder, can be put in an order in which
//! each uses only those before it.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// For each file or folder, by name: the names of those that it uses.
type Uses = BTreeMap<String, BTreeSet<String>>;

/// The text of a file, or of all files in a folder.
fn text_of(path: &Path) -> String {
    if !path.is_dir() {
        return fs::read_to_string(path).expect("the file is text");
    }
    let entries = fs::read_dir(path).expect("the folder can be read");
    entries.map(|entry| text_of(&entry.expect("the folder can be read").path())).collect()
}

/// The uses among the files and folders in `folder`, which name each other by paths that begin with `prefix`.
fn uses(folder: &Path, prefix: &str) -> Uses {
    let mut texts = BTreeMap::new();
    for entry in fs::read_dir(folder).expect("the folder is there") {
        let path = entry.expect("the folder can be read").path();
        let name = path.file_stem().expect("a file has a name").to_string_lossy().into_owned();
        if !["lib", "mod", "tests"].contains(&name.as_str()) {
            texts.insert(name, text_of(&path));
        }
    }
    // `use super::a::{b, c};` names `a`, and `use super::{a, b};` names both.
    let named = |own: &str, text: &str| {
        let paths = text.split(prefix).skip(1).map(|rest| rest.split(';').next().unwrap_or_default());
        let heads = paths.flat_map(|path| match path.strip_prefix('{') {
            Some(list) => list.split([',', '}']).collect(),
            None => vec![path],
        });
        let heads = heads.map(|head| head.split("::").next().unwrap_or_default().trim().to_string());
        heads.filter(|head| head != own && texts.contains_key(head)).collect()
    };
    texts.iter().map(|(name, text)| (name.clone(), named(name, text))).collect()
}

/// Returns the circles: the files left over when files that use none of the others are removed, one after
/// another.
fn circles(mut left: Uses) -> Uses {
    while let Some(lowest) = left.iter().find(|(_, uses)| uses.is_empty()).map(|(name, _)| name.clone()) {
        left.remove(&lowest);
        left.values_mut().for_each(|uses| {
            uses.remove(&lowest);
        });
    }
    left
}

#[test]
fn folders_use_only_folders_before_them() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    assert_eq!(circles(uses(&root, "use crate::")), Uses::new());
}

#[test]
fn files_use_only_files_before_them() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    for folder in ["diagnostic", "expand", "lower", "reader", "resolve", "session"] {
        assert_eq!(circles(uses(&root.join(folder), "use super::")), Uses::new(), "{folder}");
    }
}
