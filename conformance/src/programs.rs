//! The files of the conformance programs.

use std::path::{Path, PathBuf};

/// Returns the folder of the programs.
pub fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("programs")
}

/// Returns the paths of all programs below a subfolder, `""` for all folders, in order.
///
/// # Panics
/// If the folder cannot be read.
pub fn paths(subfolder: &str) -> Vec<PathBuf> {
    let mut paths = Vec::new();
    let mut folders = vec![folder().join(subfolder)];
    while let Some(folder) = folders.pop() {
        for entry in folder.read_dir().expect("the folder of programs can be read") {
            let path = entry.expect("the folder of programs can be read").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "esl") {
                paths.push(path);
            }
        }
    }
    paths.sort();
    paths
}
