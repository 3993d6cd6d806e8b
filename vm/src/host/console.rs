//! The standard streams of a program, buffered between it and the host.
//!
//! Standard output is written in blocks: when the buffer is full, before the program waits or reads standard input, and
//! at its end. Standard error is written at once, after what is in standard output's buffer, so that the two come out in
//! the order of the program. Input is decoded as UTF-8; what is none comes out as U+FFFD.
//!
//! Guarantees: once nobody reads standard output any more, everything written to it is dropped, and
//! [`Console::is_broken`] says so: the run ends quietly.

use super::{Host, HostError, Input, Output};

/// Bytes that standard output gathers.
const BLOCK: usize = 1 << 14;

/// The standard streams.
#[derive(Default)]
pub(crate) struct Console {
    output: Vec<u8>,
    /// Characters since the last line end, by stream.
    columns: [usize; 2],
    broken: bool,
    /// Why standard output could not be written, until somebody asks.
    failure: Option<HostError>,
    /// Decoded input, the next character last.
    input: Vec<u32>,
    /// The bytes of a character that has not come in whole.
    partial: Vec<u8>,
    at_end: bool,
}

/// What standard input has to say.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Character {
    /// A character.
    Next(u32),
    /// Nothing yet.
    WouldBlock,
    /// There is no more.
    End,
    /// Reading failed.
    Failed(HostError),
}

impl Console {
    /// Writes characters.
    pub(crate) fn write(&mut self, host: &mut dyn Host, output: Output, characters: &[u32]) {
        let column = &mut self.columns[output as usize];
        *column = column_after(*column, characters);
        match output {
            Output::Standard => {
                encode(characters, &mut self.output);
                if self.output.len() >= BLOCK {
                    self.flush(host);
                }
            }
            Output::Error => {
                self.flush(host);
                let mut bytes = Vec::new();
                encode(characters, &mut bytes);
                // There is nobody to tell that standard error is gone.
                let _ = host.write(Output::Error, &bytes);
            }
        }
    }

    /// Writes what standard output has gathered.
    pub(crate) fn flush(&mut self, host: &mut dyn Host) {
        if self.output.is_empty() {
            return;
        }
        if !self.broken {
            match host.write(Output::Standard, &self.output) {
                Ok(()) => {}
                Err(HostError::BrokenPipe) => self.broken = true,
                Err(error) => self.failure = Some(error),
            }
        }
        self.output.clear();
    }

    /// Characters since the last line end of a stream.
    pub(crate) fn column(&self, output: Output) -> usize {
        self.columns[output as usize]
    }

    /// Whether nobody reads standard output any more.
    pub(crate) fn is_broken(&self) -> bool {
        self.broken
    }

    /// Why standard output could not be written, if that happened since this was last asked.
    pub(crate) fn take_failure(&mut self) -> Option<HostError> {
        self.failure.take()
    }

    /// Takes the next character of standard input.
    pub(crate) fn read(&mut self, host: &mut dyn Host) -> Character {
        loop {
            if let Some(character) = self.input.pop() {
                return Character::Next(character);
            }
            if self.at_end {
                return Character::End;
            }
            self.flush(host);
            match host.read_input() {
                Input::Data(bytes) => self.take_in(&bytes),
                Input::WouldBlock => return Character::WouldBlock,
                Input::Failed(error) => return Character::Failed(error),
                Input::End => {
                    self.at_end = true;
                    if !std::mem::take(&mut self.partial).is_empty() {
                        self.input.push(u32::from(char::REPLACEMENT_CHARACTER));
                    }
                }
            }
        }
    }

    /// Gives a character back to standard input.
    pub(crate) fn unread(&mut self, character: u32) {
        self.input.push(character);
    }

    /// Drops what has come in and was not read.
    pub(crate) fn clear_input(&mut self) {
        self.input.clear();
    }

    fn take_in(&mut self, bytes: &[u8]) {
        self.partial.extend_from_slice(bytes);
        let bytes = std::mem::take(&mut self.partial);
        let mut characters = Vec::new();
        let mut rest = &bytes[..];
        loop {
            match std::str::from_utf8(rest) {
                Ok(text) => {
                    characters.extend(text.chars().map(u32::from));
                    break;
                }
                Err(error) => {
                    let (valid, after) = rest.split_at(error.valid_up_to());
                    characters.extend(String::from_utf8_lossy(valid).chars().map(u32::from));
                    let Some(length) = error.error_len() else {
                        self.partial = after.to_vec();
                        break;
                    };
                    characters.push(u32::from(char::REPLACEMENT_CHARACTER));
                    rest = &after[length..];
                }
            }
        }
        characters.reverse();
        self.input = characters;
    }
}

/// The column after writing `characters` from `column` on.
pub(crate) fn column_after(column: usize, characters: &[u32]) -> usize {
    match characters.iter().rposition(|&c| c == u32::from('\n')) {
        Some(last) => characters.len() - last - 1,
        None => column + characters.len(),
    }
}

/// Appends characters as UTF-8; what is no Unicode scalar value becomes U+FFFD.
pub(crate) fn encode(characters: &[u32], bytes: &mut Vec<u8>) {
    for &code in characters {
        match u8::try_from(code) {
            Ok(byte) if byte < 0x80 => bytes.push(byte),
            _ => {
                let c = char::from_u32(code).unwrap_or(char::REPLACEMENT_CHARACTER);
                bytes.extend_from_slice(c.encode_utf8(&mut [0; 4]).as_bytes());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::host::VirtualHost;

    fn codes(text: &str) -> Vec<u32> {
        text.chars().map(u32::from).collect()
    }

    fn read_all(host: &mut VirtualHost) -> String {
        let mut console = Console::default();
        let mut text = String::new();
        loop {
            match console.read(host) {
                Character::Next(c) => text.push(char::from_u32(c).unwrap()),
                Character::End => return text,
                other => panic!("{other:?}"),
            }
        }
    }

    #[test]
    fn output_comes_in_blocks_and_in_the_order_of_the_program() {
        let mut host = VirtualHost::new();
        let captured = host.captured();
        let mut console = Console::default();
        console.write(&mut host, Output::Standard, &codes("one\nä"));
        assert_eq!((captured.output().as_str(), console.column(Output::Standard)), ("", 1));
        console.write(&mut host, Output::Error, &codes("!"));
        assert_eq!((captured.output(), captured.error()), ("one\nä".into(), "!".into()));
    }

    #[test]
    fn a_broken_pipe_ends_output_quietly() {
        let mut host = VirtualHost::new().with_output_limit(1);
        let mut console = Console::default();
        console.write(&mut host, Output::Standard, &codes("ab"));
        console.flush(&mut host);
        assert!(console.is_broken() && console.take_failure().is_none());
    }

    #[test]
    fn characters_may_be_cut_between_chunks() {
        let euro = "€".as_bytes();
        let mut host = VirtualHost::new().with_input([b"a", &euro[..1]].concat()).with_input(&euro[1..]);
        assert_eq!(read_all(&mut host), "a€");
        let mut host = VirtualHost::new().with_input(b"x\xFFy".to_vec()).with_input(&euro[..2]);
        assert_eq!(read_all(&mut host), "x\u{FFFD}y\u{FFFD}");
    }
}
