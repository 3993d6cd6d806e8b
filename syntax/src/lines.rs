//! Lines of a text: from byte offsets to lines and back, where the text changes often.

use std::ops::Range;

/// The offsets at which the lines of a text begin.
#[derive(Clone, Debug)]
pub struct LineStarts {
    starts: Vec<u32>,
    length: usize,
}

impl LineStarts {
    /// Finds the lines of a text.
    pub fn new(text: &str) -> LineStarts {
        let ends = text.bytes().enumerate().filter(|&(_, byte)| byte == b'\n');
        let starts = std::iter::once(0).chain(ends.map(|(at, _)| at as u32 + 1)).collect();
        LineStarts { starts, length: text.len() }
    }

    /// Returns the number of lines: one more than there are newlines.
    pub fn count(&self) -> usize {
        self.starts.len()
    }

    /// Returns the number of the line, counted from 0, that contains byte `offset`.
    pub fn line_of(&self, offset: usize) -> usize {
        self.starts.partition_point(|&start| start as usize <= offset) - 1
    }

    /// Returns the place of a line, with its newline; an empty
    /// place behind the text for one that is not there.
    pub fn range(&self, line: usize) -> Range<usize> {
        let start = |line: usize| self.starts.get(line).map_or(self.length, |&start| start as usize);
        start(line)..start(line + 1)
    }
}
