//! Waiting until a source changes, for `eslvm test --watch`.

use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use esl_command as command;

/// Time between two checks of the files.
const PERIOD: Duration = Duration::from_millis(250);

/// The sources in folders: names, times of their last changes, lengths.
pub(super) type SourceState = Vec<(PathBuf, Option<SystemTime>, u64)>;

/// Returns the folders in which the sources of tests and their modules are.
pub(super) fn folders(paths: &[PathBuf]) -> Vec<PathBuf> {
    let folder = |path: &PathBuf| match path.parent() {
        _ if path.is_dir() => path.clone(),
        Some(folder) if folder != Path::new("") => folder.to_path_buf(),
        _ => PathBuf::from("."),
    };
    let mut folders: Vec<PathBuf> = paths.iter().map(folder).collect();
    if folders.is_empty() {
        folders.push(PathBuf::from("."));
    }
    folders.sort();
    folders.dedup();
    folders
}

/// Returns how the sources in folders are now.
pub(super) fn state(folders: &[PathBuf]) -> SourceState {
    let files = folders.iter().flat_map(|folder| command::sources_in(folder).unwrap_or_default());
    let state = |file: PathBuf| {
        let known = std::fs::metadata(&file).ok();
        let (time, length) =
            (known.as_ref().and_then(|known| known.modified().ok()), known.map_or(0, |known| known.len()));
        (file, time, length)
    };
    files.map(state).collect()
}

/// Waits until the sources in folders are not as they were.
pub(super) fn wait(folders: &[PathBuf], before: &SourceState) {
    while state(folders) == *before {
        std::thread::sleep(PERIOD);
    }
}
