//! The standard streams of a program, buffered between it and the host.
//!
//! Standard output is written in blocks: when the buffer is full, before the program waits or reads standard
//! input, and at its end. Standard error is written at once, after the contents of standard output's buffer,
//! so that both appear in the order of the program. Input is decoded as UTF-8; invalid bytes become U+FFFD.
//!
//! Output of a program is written as far as there is room. The rest stays in the buffer, and tasks that print
//! more wait meanwhile; only the end of a run, and its reports, wait for the reader.
//!
//! Guarantees: once the reader of standard output has closed it, everything written to it is dropped, and
//! [`Console::is_broken`] holds: the run ends quietly.

use esl_heap::list_state;
use esl_heap::state::StateSink;
use std::collections::VecDeque;

use super::{Host, HostError, Input, Output};

/// Size of a block of standard output, in bytes.
const BLOCK: usize = 1 << 14;

/// The standard streams.
#[derive(Clone, Default)]
pub struct Console {
    output: Vec<u8>,
    /// Text for which standard error had no room. While there is any, nothing is written to standard output,
    /// whose buffer was empty then.
    errors: Vec<u8>,
    /// Characters since the last line end, by stream.
    columns: [usize; 2],
    /// A hash of everything written to standard output, if requested.
    noted: Option<u64>,
    broken: bool,
    /// Error of the latest write to standard output, until it is taken.
    failure: Option<HostError>,
    /// Decoded input, in order.
    input: VecDeque<u32>,
    /// Bytes of a character of which the rest has not arrived.
    partial: Vec<u8>,
    at_end: bool,
}

/// The outcome of taking something from standard input.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Taken<T> {
    /// It was there.
    Next(T),
    /// It has not arrived yet.
    WouldBlock,
    /// The input has ended.
    End,
    /// Reading failed.
    Failed(HostError),
}

esl_heap::stored! { Console { output, errors, columns, noted, broken, failure, input, partial, at_end } }

list_state! { Console {
    output: Run,
    errors: Run,
    columns: Run,
    noted: Visited,
    broken: Run,
    failure: Run by |failure: &Option<HostError>, sink: &mut dyn StateSink| sink.word(u64::from(failure.is_some())),
    input: Run,
    partial: Run,
    at_end: Run,
} }

impl Console {
    /// Writes characters.
    pub fn write(&mut self, host: &mut dyn Host, output: Output, characters: &[u32]) {
        let column = &mut self.columns[output as usize];
        *column = column_after(*column, characters);
        match output {
            Output::Standard => {
                if let Some(noted) = &mut self.noted {
                    for &c in characters {
                        *noted = (noted.rotate_left(5) ^ u64::from(c)).wrapping_mul(0x9E37_79B9_7F4A_7C15);
                    }
                }
                encode(characters, &mut self.output);
                if self.output.len() >= BLOCK {
                    self.pass_on(host);
                }
            }
            Output::Error => {
                self.pass_on(host);
                if !self.output.is_empty() {
                    self.flush(host);
                }
                encode(characters, &mut self.errors);
                self.pass_on(host);
            }
        }
    }

    /// Returns whether a task may write to a stream now, and need not wait.
    #[inline]
    pub fn has_room(&mut self, host: &mut dyn Host, output: Output) -> bool {
        let limit = if output == Output::Standard { BLOCK } else { 1 };
        if self.errors.is_empty() && self.output.len() < limit {
            return true;
        }
        self.pass_on(host);
        self.errors.is_empty() && self.output.len() < limit
    }

    /// Returns whether something waits until there is room for it.
    #[inline]
    pub fn is_behind(&self) -> bool {
        !self.errors.is_empty() || !self.output.is_empty()
    }

    /// Writes the buffers, as far as there is room.
    pub fn pass_on(&mut self, host: &mut dyn Host) {
        if !self.errors.is_empty() {
            // If standard error is gone, there is no other stream for the error.
            let count = host.write_ready(Output::Error, &self.errors).unwrap_or(self.errors.len());
            self.errors.drain(..count.min(self.errors.len()));
        }
        if !self.errors.is_empty() || self.output.is_empty() {
            return;
        }
        let count = match self.broken {
            true => Ok(self.output.len()),
            false => host.write_ready(Output::Standard, &self.output),
        };
        let count = self.count_written(count);
        self.output.drain(..count.min(self.output.len()));
    }

    /// Notes what has come of a write to standard output, and returns how much of the buffer is done with.
    fn count_written(&mut self, written: Result<usize, HostError>) -> usize {
        match written {
            Ok(count) => return count,
            Err(HostError::BrokenPipe) => self.broken = true,
            Err(error) => self.failure = Some(error),
        }
        self.output.len()
    }

    /// Turns the hash of everything written to standard output on, from zero, or off.
    pub fn note_all(&mut self, on: bool) {
        self.noted = on.then_some(0);
    }

    /// Returns the hash of everything written to standard output.
    #[inline]
    pub fn noted(&self) -> u64 {
        self.noted.unwrap_or(0)
    }

    /// Writes the buffers, and waits until there is room for that.
    pub fn flush(&mut self, host: &mut dyn Host) {
        if !self.errors.is_empty() {
            // As above.
            let _ = host.write(Output::Error, &self.errors);
            self.errors.clear();
        }
        if self.output.is_empty() {
            return;
        }
        if !self.broken {
            let written = host.write(Output::Standard, &self.output).map(|()| self.output.len());
            self.count_written(written);
        }
        self.output.clear();
    }

    /// Returns the number of characters since the last line end of a stream.
    #[inline]
    pub fn column(&self, output: Output) -> usize {
        self.columns[output as usize]
    }

    /// Returns whether the reader of standard output has closed it.
    #[inline]
    pub fn is_broken(&self) -> bool {
        self.broken
    }

    /// Returns the error of a write to standard output, if there was one since the last call.
    pub fn take_failure(&mut self) -> Option<HostError> {
        self.failure.take()
    }

    /// Takes the next character of standard input.
    pub fn read(&mut self, host: &mut dyn Host) -> Taken<u32> {
        loop {
            if let Some(character) = self.input.pop_front() {
                return Taken::Next(character);
            }
            match self.fill(host) {
                Taken::Next(()) => {}
                Taken::WouldBlock => return Taken::WouldBlock,
                Taken::End => return Taken::End,
                Taken::Failed(error) => return Taken::Failed(error),
            }
        }
    }

    /// Waits for the end of a line of at most `limit` characters, or of the input. Returns whether it has
    /// arrived; otherwise more characters have.
    pub fn await_line(&mut self, host: &mut dyn Host, limit: usize) -> Taken<bool> {
        let mut searched = 0;
        loop {
            if self.input.iter().take(limit + 1).skip(searched).any(|&c| c == u32::from('\n')) {
                return Taken::Next(true);
            }
            searched = self.input.len();
            if searched > limit {
                return Taken::Next(false);
            }
            match self.fill(host) {
                Taken::Next(()) => {}
                Taken::WouldBlock => return Taken::WouldBlock,
                Taken::End if self.input.is_empty() => return Taken::End,
                Taken::End => return Taken::Next(true),
                Taken::Failed(error) => return Taken::Failed(error),
            }
        }
    }

    /// Takes the characters that have arrived up to the end of a line, at most `limit`, and returns whether
    /// the line has ended with them.
    pub fn take_line(&mut self, limit: usize) -> (Vec<u32>, bool) {
        let end = self.input.iter().take(limit + 1).position(|&c| c == u32::from('\n'));
        let line = self.input.drain(..end.unwrap_or_else(|| limit.min(self.input.len()))).collect();
        if end.is_some() {
            self.input.pop_front();
        }
        (line, end.is_some())
    }

    /// Returns whether the input has ended.
    #[inline]
    pub fn is_at_end(&self) -> bool {
        self.at_end
    }

    /// Returns the number of characters of the input that have arrived and were not read.
    #[inline]
    pub fn pending(&self) -> usize {
        self.input.len()
    }

    /// Returns the first of these characters, at most `limit`.
    pub fn first_pending(&self, limit: usize) -> String {
        let text = |&code: &u32| char::from_u32(code).unwrap_or(char::REPLACEMENT_CHARACTER);
        self.input.iter().take(limit).map(text).collect()
    }

    /// Drops this number of characters of the input.
    pub fn skip(&mut self, characters: usize) {
        self.input.drain(..characters.min(self.input.len()));
    }

    /// Puts a character back in front of the input.
    pub fn unread(&mut self, character: u32) {
        self.input.push_front(character);
    }

    /// Puts back what [`Console::take_line`] has returned.
    pub fn unread_line(&mut self, line: &[u32], has_ended: bool) {
        if has_ended {
            self.unread(u32::from('\n'));
        }
        line.iter().rev().for_each(|&character| self.unread(character));
    }

    /// Reads more input, in addition to what was not read yet.
    pub fn fill(&mut self, host: &mut dyn Host) -> Taken<()> {
        if self.at_end {
            return Taken::End;
        }
        self.pass_on(host);
        match host.read_input() {
            Input::Data(bytes) => {
                self.take_in(&bytes);
                Taken::Next(())
            }
            Input::WouldBlock => Taken::WouldBlock,
            Input::Failed(error) => Taken::Failed(error),
            Input::End => {
                self.at_end = true;
                if std::mem::take(&mut self.partial).is_empty() {
                    return Taken::End;
                }
                self.input.push_back(u32::from(char::REPLACEMENT_CHARACTER));
                Taken::Next(())
            }
        }
    }

    fn take_in(&mut self, bytes: &[u8]) {
        self.partial.extend_from_slice(bytes);
        let bytes = std::mem::take(&mut self.partial);
        let mut rest = &bytes[..];
        loop {
            match std::str::from_utf8(rest) {
                Ok(text) => {
                    self.input.extend(text.chars().map(u32::from));
                    return;
                }
                Err(error) => {
                    let (valid, after) = rest.split_at(error.valid_up_to());
                    self.input.extend(String::from_utf8_lossy(valid).chars().map(u32::from));
                    let Some(length) = error.error_len() else {
                        self.partial = after.to_vec();
                        return;
                    };
                    self.input.push_back(u32::from(char::REPLACEMENT_CHARACTER));
                    rest = &after[length..];
                }
            }
        }
    }
}

/// Returns the column after writing `characters` from `column` on.
pub fn column_after(column: usize, characters: &[u32]) -> usize {
    match characters.iter().rposition(|&c| c == u32::from('\n')) {
        Some(last) => characters.len() - last - 1,
        None => column + characters.len(),
    }
}

/// Appends characters as UTF-8; a code that is not a Unicode scalar value becomes U+FFFD.
pub fn encode(characters: &[u32], bytes: &mut Vec<u8>) {
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
    use crate::VirtualHost;

    fn codes(text: &str) -> Vec<u32> {
        text.chars().map(u32::from).collect()
    }

    fn read_all(host: &mut VirtualHost) -> String {
        let mut console = Console::default();
        let mut text = String::new();
        loop {
            match console.read(host) {
                Taken::Next(c) => text.push(char::from_u32(c).unwrap()),
                Taken::End => return text,
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
    fn lines_are_taken_whole() {
        let mut host = VirtualHost::new().with_input("one\ntw").with_input("o\n\nend");
        let mut console = Console::default();
        let mut lines = Vec::new();
        while let Taken::Next(true) = console.await_line(&mut host, 3) {
            let (line, has_ended) = console.take_line(3);
            lines.push((String::from_iter(line.iter().map(|&c| char::from_u32(c).unwrap())), has_ended));
        }
        let expected = [("one", true), ("two", true), ("", true), ("end", false)];
        assert_eq!(lines, expected.map(|(line, has_ended)| (line.to_owned(), has_ended)));
    }

    #[test]
    fn a_long_line_is_taken_in_pieces() {
        let mut host = VirtualHost::new().with_input("abc").with_input("de\nf\n");
        let mut console = Console::default();
        assert_eq!(console.await_line(&mut host, 4), Taken::Next(false));
        assert_eq!(console.take_line(4), (codes("abcd"), false));
        console.unread_line(&codes("abcd"), false);
        assert_eq!(console.take_line(4), (codes("abcd"), false));
        assert_eq!(console.take_line(4), (codes("e"), true));
        console.unread_line(&codes("e"), true);
        assert_eq!(console.await_line(&mut host, 4), Taken::Next(true));
        assert_eq!(console.take_line(4), (codes("e"), true));
        assert_eq!(console.take_line(4), (codes("f"), true));
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
