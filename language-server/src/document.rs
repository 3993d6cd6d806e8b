//! Texts: what an editor shows, and positions in them as the protocol counts them.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use esl_syntax::{LineStarts, SyntaxTree};
use lsp_types::{Location, Position, Range as LspRange, TextDocumentContentChangeEvent, Uri};

/// How clients count the columns of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ColumnUnit {
    /// Bytes in UTF-8.
    Bytes,
    /// Units of UTF-16, which is what the protocol takes unless something else is agreed on.
    Utf16,
}

/// A text with its tree: one that is open in the editor, or one that it refers to.
#[derive(Clone, Debug)]
pub(super) struct OpenText {
    pub(super) uri: Uri,
    pub(super) version: i32,
    pub(super) tree: SyntaxTree,
    pub(super) lines: LineStarts,
    /// For each character of several bytes its offset, and how many more bytes the text has up to it, itself
    /// included, than units of UTF-16.
    wide: Vec<(u32, u32)>,
    unit: ColumnUnit,
}

impl OpenText {
    pub(super) fn new(uri: Uri, version: i32, text: String, unit: ColumnUnit) -> OpenText {
        let (lines, wide) = (LineStarts::new(&text), wide_characters(&text));
        OpenText { uri, version, tree: SyntaxTree::new(text), lines, wide, unit }
    }

    /// Takes changes of the text, each of which is based on the one before.
    pub(super) fn change(&mut self, version: i32, changes: Vec<TextDocumentContentChangeEvent>) {
        let mut text = self.tree.source().to_owned();
        for change in changes {
            match change.range {
                Some(range) => {
                    self.lines = LineStarts::new(&text);
                    let start = self.offset_in(&text, range.start);
                    let end = self.offset_in(&text, range.end).max(start);
                    text.replace_range(start..end, &change.text);
                }
                None => text = change.text,
            }
        }
        self.version = version;
        self.lines = LineStarts::new(&text);
        self.wide = wide_characters(&text);
        self.tree = SyntaxTree::new(text);
    }

    /// Returns the path of the file.
    pub(super) fn path(&self) -> PathBuf {
        path_of(&self.uri)
    }

    /// Returns the characters that end the first line, with which new lines end, too.
    pub(super) fn line_end(&self) -> &'static str {
        let source = self.tree.source();
        let is_crlf = source.find('\n').is_some_and(|at| source[..at].ends_with('\r'));
        if is_crlf { "\r\n" } else { "\n" }
    }

    /// Returns the byte at a position; the end of a line or of the text for one that is beyond it.
    pub(super) fn offset(&self, position: Position) -> usize {
        self.offset_in(self.tree.source(), position)
    }

    fn offset_in(&self, text: &str, position: Position) -> usize {
        let place = self.lines.range(position.line as usize);
        let line = text[place.clone()].trim_end_matches(['\n', '\r']);
        let mut left = position.character as usize;
        for (at, c) in line.char_indices() {
            let length = match self.unit {
                ColumnUnit::Bytes => c.len_utf8(),
                ColumnUnit::Utf16 => c.len_utf16(),
            };
            if left < length {
                return place.start + at;
            }
            left -= length;
        }
        place.start + line.len()
    }

    /// Returns the position of a byte.
    pub(super) fn position(&self, offset: usize) -> Position {
        let offset = self.tree.source().floor_char_boundary(offset);
        let line = self.lines.line_of(offset);
        let start = self.lines.range(line).start;
        let column = match self.unit {
            ColumnUnit::Bytes => offset - start,
            ColumnUnit::Utf16 => offset - start - (self.surplus(offset) - self.surplus(start)),
        };
        Position::new(line as u32, column as u32)
    }

    /// Returns how many more bytes than units of UTF-16 the text has up to an offset.
    fn surplus(&self, offset: usize) -> usize {
        let before = self.wide.partition_point(|&(at, _)| (at as usize) < offset);
        before.checked_sub(1).map_or(0, |last| self.wide[last].1 as usize)
    }

    /// Returns the number of columns of a part of a line.
    pub(super) fn width(&self, text: &str) -> u32 {
        match self.unit {
            ColumnUnit::Bytes => text.len() as u32,
            ColumnUnit::Utf16 => text.encode_utf16().count() as u32,
        }
    }

    /// Returns a range of bytes as the protocol writes it.
    pub(super) fn range(&self, range: Range<usize>) -> LspRange {
        LspRange::new(self.position(range.start), self.position(range.end))
    }

    /// Returns a place in this text.
    pub(super) fn location(&self, range: Range<usize>) -> Location {
        Location::new(self.uri.clone(), self.range(range))
    }
}

fn wide_characters(text: &str) -> Vec<(u32, u32)> {
    let wide = text.char_indices().filter(|(_, c)| !c.is_ascii());
    let counted = wide.scan(0, |surplus, (at, c)| {
        *surplus += (c.len_utf8() - c.len_utf16()) as u32;
        Some((at as u32, *surplus))
    });
    counted.collect()
}

/// Returns the path that a `file` URI names; for another one its text, which no file has.
pub(super) fn path_of(uri: &Uri) -> PathBuf {
    let text = uri.as_str();
    let Some(rest) = text.strip_prefix("file://") else { return PathBuf::from(text) };
    // A host before the path is this one.
    let path = rest.find('/').map_or("", |at| &rest[at..]);
    let mut bytes = Vec::with_capacity(path.len());
    let mut left = path.as_bytes();
    while let Some((&first, rest)) = left.split_first() {
        let code = left.get(1..3).and_then(|code| std::str::from_utf8(code).ok());
        match code.and_then(|code| u8::from_str_radix(code, 16).ok()).filter(|_| first == b'%') {
            Some(byte) => {
                bytes.push(byte);
                left = &left[3..];
            }
            None => {
                bytes.push(first);
                left = rest;
            }
        }
    }
    PathBuf::from(String::from_utf8_lossy(&bytes).into_owned())
}

/// Returns the `file` URI of a path.
pub(super) fn uri_of(path: &Path) -> Option<Uri> {
    let path = std::path::absolute(path).ok()?;
    let mut text = String::from("file://");
    for &byte in path.to_string_lossy().as_bytes() {
        if byte.is_ascii_alphanumeric() || b"/-_.~".contains(&byte) {
            text.push(byte.into());
        } else {
            text.push_str(&format!("%{byte:02X}"));
        }
    }
    Uri::from_str(&text).ok()
}
