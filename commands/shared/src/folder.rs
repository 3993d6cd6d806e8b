//! The sources in a folder, and those of them that hold tests.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use super::{USAGE, complain};

/// Deepest nesting of folders that are searched for files.
const MAX_DEPTH: usize = 64;

/// Returns the sources (`*.esl`) in a folder and in those below it, in the order of their names. Hidden
/// folders, those of builds (`target`) and links to folders are left aside.
///
/// # Errors
/// The exit status, after a message, if a folder cannot be read.
pub fn sources_in(folder: &Path) -> Result<Vec<PathBuf>, u8> {
    let mut files = Vec::new();
    add_folder(folder, 0, &mut files)?;
    Ok(files)
}

fn add_folder(folder: &Path, depth: usize, files: &mut Vec<PathBuf>) -> Result<(), u8> {
    let entries = std::fs::read_dir(folder).and_then(Iterator::collect::<Result<Vec<_>, _>>);
    let entries = entries.map_err(|error| {
        complain(format_args!("{} cannot be read: {error}", folder.display()));
        USAGE
    })?;
    let mut entries: Vec<PathBuf> = entries.into_iter().map(|entry| entry.path()).collect();
    entries.sort();
    for path in entries {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        // `./a` is shown as `a`.
        let path = path.strip_prefix(".").map_or(path.clone(), Path::to_path_buf);
        if path.is_dir() && !path.is_symlink() {
            let is_left_out = name.starts_with('.') || name == "target" || depth == MAX_DEPTH;
            if !is_left_out {
                add_folder(&path, depth + 1, files)?;
            }
        } else if name.ends_with(".esl") && path.is_file() {
            files.push(path);
        }
    }
    Ok(())
}

/// Returns whether a source in a folder holds tests, by its name or that of a folder around it: `test.esl`,
/// `tests.esl`, `*_test.esl`, `*-test.esl`, and all in a folder `tests`.
pub fn is_test_file(folder: &Path, file: &Path) -> bool {
    let stem = file.file_stem().unwrap_or_default().to_string_lossy();
    let is_named_so = ["test", "tests"].contains(&&*stem)
        || ["_test", "-test", "_tests", "-tests"].iter().any(|end| stem.ends_with(end));
    let is_tests = |name: &OsStr| name == "tests";
    let below = file.strip_prefix(folder).unwrap_or(file).parent();
    is_named_so
        || below.is_some_and(|below| below.components().any(|part| is_tests(part.as_os_str())))
        || folder.canonicalize().is_ok_and(|folder| folder.file_name().is_some_and(is_tests))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tests_are_known_by_their_names() {
        let tests = [
            "test.esl",
            "a/tests.esl",
            "drive_test.esl",
            "b/drive-test.esl",
            "tests/drive.esl",
            "tests/a/b.esl",
        ];
        let others = ["contest.esl", "latest/drive.esl", "main.esl", "test/drive.esl"];
        let is_test = |file: &&str| is_test_file(Path::new("."), Path::new(file));
        assert!(tests.iter().all(is_test));
        assert!(!others.iter().any(is_test));
        // A folder around the one that is searched does not count.
        assert!(!is_test_file(Path::new("tests/plan"), Path::new("tests/plan/drive.esl")));
    }
}
