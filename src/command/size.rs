//! Sizes in bytes, as they are written on a command line.

use std::fmt;

/// Reason why a text is not the size of a machine's memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SizeError {
    /// The text is not a number with an optional unit.
    NotANumber,
    /// The library alone needs more.
    TooSmall,
    /// The size is beyond the range of addresses.
    TooLarge,
}

impl fmt::Display for SizeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            SizeError::NotANumber => "expected a number, optionally followed by K, M or G",
            SizeError::TooSmall => "the library alone takes more; give at least 4M",
            SizeError::TooLarge => "that is more than there can be",
        })
    }
}

impl std::error::Error for SizeError {}

/// Parses a size in bytes; K, M or G multiply it by a power of 1024.
///
/// # Errors
/// [`SizeError`].
pub fn parse_size(text: &str) -> Result<usize, SizeError> {
    let (digits, unit) = match text.char_indices().last() {
        Some((last, 'K' | 'k')) => (&text[..last], 1 << 10),
        Some((last, 'M' | 'm')) => (&text[..last], 1 << 20),
        Some((last, 'G' | 'g')) => (&text[..last], 1 << 30),
        _ => (text, 1),
    };
    let number: usize = digits.parse().map_err(|_| SizeError::NotANumber)?;
    match number.checked_mul(unit) {
        Some(size) if size >= 4 << 20 => Ok(size),
        Some(_) => Err(SizeError::TooSmall),
        None => Err(SizeError::TooLarge),
    }
}
