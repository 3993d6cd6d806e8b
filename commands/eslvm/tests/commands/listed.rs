//! Tests of which each runs what a file of the documentation or of the transcripts contains.

use std::path::Path;

/// Defines a test for each file of a folder, which calls a function with the file's path below the root and
/// its text, and a test that fails unless all files with this ending are listed.
macro_rules! test_files {
    ($check:path, $folder:literal, $ending:literal: $($name:ident = $file:literal,)*) => {
        $(
            #[test]
            fn $name() {
                $crate::listed::run(concat!($folder, "/", $file), $check);
            }
        )*

        #[test]
        fn all_files_are_listed() {
            $crate::listed::compare($folder, $ending, &[$($file),*]);
        }
    };
}

/// Checks a file, whose path below the root is given.
pub(crate) fn run(path: &str, check: impl FnOnce(&str, &str) -> Result<(), String>) {
    let text = std::fs::read_to_string(esl_conformance::root().join(path)).expect("it can be read");
    if let Err(fault) = check(path, &text) {
        panic!("{path}: {fault}");
    }
}

/// Fails unless the files of a folder that have an ending are these.
pub(crate) fn compare(folder: &str, ending: &str, listed: &[&str]) {
    let entries = std::fs::read_dir(esl_conformance::root().join(folder)).expect("the folder is there");
    let names = entries.map(|entry| entry.expect("the folder can be read").file_name());
    let names = names.filter(|name| Path::new(name).extension().is_some_and(|found| found == ending));
    let mut names: Vec<String> = names.map(|name| name.to_string_lossy().into_owned()).collect();
    names.sort();
    let mut listed = listed.to_vec();
    listed.sort_unstable();
    assert_eq!(listed, names, "list the files of {folder} in `test_files!`");
}
