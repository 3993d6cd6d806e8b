//! Input buffered for the program.

use esl_bytecode::datum::Datum;

use esl_bytecode::Bytes;
use esl_host::IntoDatum;

/// Input that the program has not taken yet.
#[derive(Default)]
pub(crate) struct Arrived {
    bytes: Vec<u8>,
    /// How many of the bytes were taken.
    taken: usize,
    /// Whether something was added since the program took what there was: it may have left a part of a
    /// character.
    is_new: bool,
    is_ended: bool,
    /// Where the first byte that was not taken is in what is read.
    position: u64,
}

impl Arrived {
    /// Returns that nothing was read yet, where reading begins at a position.
    pub(crate) fn from(position: u64) -> Arrived {
        Arrived { position, ..Arrived::default() }
    }

    /// Returns where the first byte is that was not taken.
    pub(crate) fn position(&self) -> u64 {
        self.position
    }

    /// Returns whether there is something to be taken, or nothing will come.
    pub(crate) fn is_something(&self) -> bool {
        self.is_ended || self.is_new
    }

    /// Adds what was read; nothing stands for the end.
    pub(crate) fn add(&mut self, bytes: &[u8]) {
        self.is_ended |= bytes.is_empty();
        self.is_new = true;
        self.bytes.drain(..self.taken);
        self.taken = 0;
        self.bytes.extend_from_slice(bytes);
    }

    fn rest(&self) -> &[u8] {
        &self.bytes[self.taken..]
    }

    /// Returns what there is if nothing can be taken: `NIL` at the end, otherwise no text or no bytes.
    fn nothing(&self, none: impl IntoDatum) -> Datum {
        if self.is_ended { ().into_datum() } else { none.into_datum() }
    }

    /// Takes so many bytes, of which `make` makes data.
    fn take(&mut self, count: usize, make: fn(&[u8]) -> Datum) -> Datum {
        let taken = make(&self.rest()[..count]);
        self.taken += count;
        self.position += count as u64;
        if self.taken == self.bytes.len() {
            self.bytes.clear();
            self.taken = 0;
        }
        taken
    }

    /// Takes whole characters, up to the first line end if `by_line` says so. `NIL` at the end.
    pub(crate) fn take_text(&mut self, by_line: bool) -> Datum {
        let rest = self.rest();
        if rest.is_empty() {
            self.is_new = false;
            return self.nothing("");
        }
        let line = if by_line { rest.iter().position(|&byte| byte == b'\n') } else { None };
        let whole = if self.is_ended { rest.len() } else { whole_characters(rest) };
        let count = line.map_or(whole, |line| line + 1);
        self.is_new = line.is_some() && count < rest.len();
        self.take(count, text)
    }

    /// Takes whole lines of ASCII text if there are some, otherwise whole characters up to the first line
    /// end. `NIL` at the end. Of ASCII text each character is a byte, whatever the program takes it for.
    pub(crate) fn take_lines(&mut self) -> Datum {
        let rest = self.rest();
        let is_text = |&&byte: &&u8| matches!(byte, b'\t' | b'\n' | b'\r' | b' '..=b'~');
        let plain = &rest[..rest.iter().take_while(is_text).count()];
        match plain.iter().rposition(|&byte| byte == b'\n') {
            Some(end) => {
                self.is_new = end + 1 < rest.len();
                self.take(end + 1, text)
            }
            None => self.take_text(true),
        }
    }

    /// Takes at most so many bytes. `NIL` at the end.
    pub(crate) fn take_bytes(&mut self, limit: usize) -> Datum {
        let rest = self.rest();
        if rest.is_empty() {
            self.is_new = false;
            return self.nothing(Bytes::new());
        }
        let count = rest.len().min(limit);
        self.is_new = count < rest.len();
        self.take(count, |bytes| Bytes::copy_from_slice(bytes).into_datum())
    }
}

/// Returns the text of bytes in UTF-8.
fn text(bytes: &[u8]) -> Datum {
    String::from_utf8_lossy(bytes).as_ref().into_datum()
}

/// Returns the length of a text without the character at its end of which a part is missing.
fn whole_characters(bytes: &[u8]) -> usize {
    for back in 1..=bytes.len().min(3) {
        let byte = bytes[bytes.len() - back];
        if byte & 0xC0 != 0x80 {
            let length = match byte {
                0xC0..=0xDF => 2,
                0xE0..=0xEF => 3,
                0xF0..=0xF7 => 4,
                _ => 1,
            };
            return if length > back { bytes.len() - back } else { bytes.len() };
        }
    }
    bytes.len()
}

#[cfg(test)]
mod tests {
    use super::*;
    use esl_bytecode::datum::DatumKind;

    fn text_of(datum: &Datum) -> Option<&str> {
        match datum.kind() {
            DatumKind::String(text) => Some(text),
            _ => None,
        }
    }

    #[test]
    fn lines_of_ascii_are_taken_together_and_others_one_by_one() {
        let mut arrived = Arrived::default();
        arrived.add("one\ttwo\r\nthree\nfour ä\nfive\n\0\nsix".as_bytes());
        let mut taken = Vec::new();
        while arrived.is_something() {
            taken.push(text_of(&arrived.take_lines()).map(str::to_owned));
        }
        let expected = ["one\ttwo\r\nthree\n", "four ä\n", "five\n", "\0\n", "six"];
        assert_eq!(taken, expected.map(|text| Some(text.to_owned())));
        assert_eq!(arrived.position(), 33);
    }

    #[test]
    fn a_character_that_is_cut_waits_for_its_rest() {
        let bytes = "aä€😀".as_bytes();
        let expected = [0, 1, 1, 3, 3, 3, 6, 6, 6, 6, 10];
        let found: Vec<usize> = (0..=bytes.len()).map(|end| whole_characters(&bytes[..end])).collect();
        assert_eq!(found, expected);
        assert_eq!(whole_characters(&[0x80; 5]), 5, "what is no text does not wait");
    }

    #[test]
    fn lines_and_bytes_are_taken_in_turn() {
        let taken = |datum: Datum| text_of(&datum).map(str::to_owned);
        let mut arrived = Arrived::default();
        assert!(!arrived.is_something());
        assert_eq!(taken(arrived.take_text(true)).as_deref(), Some(""));
        arrived.add("one\ntwo\n\u{20AC}".as_bytes());
        assert_eq!(taken(arrived.take_text(true)).as_deref(), Some("one\n"));
        assert_eq!(arrived.take_bytes(2).to_string(), "#(116 119)");
        assert_eq!(taken(arrived.take_text(false)).as_deref(), Some("o\n\u{20AC}"));
        assert!(!arrived.is_something());
        arrived.add(&"\u{20AC}".as_bytes()[..1]);
        assert_eq!(taken(arrived.take_text(true)).as_deref(), Some(""));
        assert!(!arrived.is_something(), "a part of a character waits for the rest");
        arrived.add(&"\u{20AC}".as_bytes()[1..]);
        assert_eq!(taken(arrived.take_text(true)).as_deref(), Some("\u{20AC}"));
        arrived.add(&[]);
        assert!(arrived.is_something());
        assert_eq!(taken(arrived.take_bytes(5)), None);
    }
}
