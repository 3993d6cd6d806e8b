//! Faults of the files of a tree: the place, the fault, what was expected and what to do.

use std::fmt;
use std::sync::Arc;

/// A place in a file, both numbers counted from 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct FilePlace {
    /// Line.
    pub line: u32,
    /// Column, in characters.
    pub column: u32,
}

/// A fault in the file of a tree.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TreeFault {
    /// Name of the file.
    pub file: Arc<str>,
    /// Place of the fault.
    pub place: FilePlace,
    /// Sentence: the fault, what was expected, what to do.
    pub message: String,
}

impl fmt::Display for TreeFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let FilePlace { line, column } = self.place;
        write!(f, "{}:{line}:{column}: {}", self.file, self.message)
    }
}

impl std::error::Error for TreeFault {}
