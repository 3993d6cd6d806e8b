//! Sizes in bytes, as they are written on a command line.
//!
//! ```
//! use esl::size::{SizeError, parse_size, parse_stack};
//!
//! assert_eq!(parse_size("64M"), Ok(64 << 20));
//! assert_eq!(parse_stack("128k"), Ok(128 << 10));
//! assert_eq!(parse_size("1M"), Err(SizeError::TooSmall));
//! ```

use std::fmt;

/// Reason why a text is not the size of a machine's memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SizeError {
    /// The text is not a number with an optional unit.
    NotANumber,
    /// The library alone needs more.
    TooSmall,
    /// The library needs more stack.
    StackTooSmall,
    /// The size is beyond the range of addresses.
    TooLarge,
}

impl fmt::Display for SizeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            SizeError::NotANumber => "expected a number, optionally followed by K, M or G",
            SizeError::TooSmall => "the library alone takes more; give at least 4M",
            SizeError::StackTooSmall => "the library needs more stack; give at least 64K",
            SizeError::TooLarge => "that is more than there can be",
        })
    }
}

impl std::error::Error for SizeError {}

/// Parses the size of a machine's memory, in bytes; K, M or G multiply it by a power of 1024.
///
/// # Errors
/// [`SizeError`].
pub fn parse_size(text: &str) -> Result<usize, SizeError> {
    match parse_bytes(text)? {
        size if size < 4 << 20 => Err(SizeError::TooSmall),
        size => Ok(size),
    }
}

/// Parses the limit of a task's stack, in bytes; K, M or G multiply it by a power of 1024.
///
/// # Errors
/// [`SizeError`].
pub fn parse_stack(text: &str) -> Result<usize, SizeError> {
    match parse_bytes(text)? {
        size if size < 64 << 10 => Err(SizeError::StackTooSmall),
        size if size > 8 << 30 => Err(SizeError::TooLarge),
        size => Ok(size),
    }
}

fn parse_bytes(text: &str) -> Result<usize, SizeError> {
    let (digits, unit) = match text.char_indices().last() {
        Some((last, 'K' | 'k')) => (&text[..last], 1 << 10),
        Some((last, 'M' | 'm')) => (&text[..last], 1 << 20),
        Some((last, 'G' | 'g')) => (&text[..last], 1 << 30),
        _ => (text, 1),
    };
    let number: usize = digits.parse().map_err(|_| SizeError::NotANumber)?;
    number.checked_mul(unit).ok_or(SizeError::TooLarge)
}
