//! The outside of a machine: its host, the standard streams, and the embedder's functions.

use esl_bytecode::datum::Datum;

use crate::host::{Console, Host, Output};

/// A function that the embedder gives to programs. It takes and returns data, and cannot call back.
pub type HostFunction = Box<dyn FnMut(&[Datum]) -> Result<Datum, String> + Send>;

/// Everything through which a machine reaches the outside.
pub(crate) struct Outside {
    /// Clocks, files and streams.
    pub(crate) host: Box<dyn Host + Send>,
    /// The standard streams, buffered.
    pub(crate) console: Console,
    /// The embedder's functions, by number.
    pub(crate) functions: Vec<HostFunction>,
    /// Answer of one of them, while there is no room for it in the heap.
    pub(crate) answer: Option<Result<Datum, String>>,
    /// Stream that reports are written to.
    pub(crate) complaints: Output,
    /// Status that the program has asked to end with.
    pub(crate) exit_status: Option<u8>,
}

impl Outside {
    /// Creates the outside that `host` stands for.
    pub(crate) fn new(host: Box<dyn Host + Send>) -> Outside {
        Outside {
            host,
            console: Console::default(),
            functions: Vec::new(),
            answer: None,
            complaints: Output::Error,
            exit_status: None,
        }
    }

    /// Writes what programs have printed and is still in a buffer.
    pub(crate) fn flush(&mut self) {
        self.console.flush(&mut *self.host);
    }

    /// Writes a report, on lines of its own.
    pub(crate) fn complain(&mut self, text: &str) {
        let mut characters: Vec<u32> = text.chars().map(u32::from).collect();
        if self.console.column(self.complaints) > 0 {
            characters.insert(0, u32::from('\n'));
        }
        self.flush();
        self.console.write(&mut *self.host, self.complaints, &characters);
        self.flush();
    }
}
