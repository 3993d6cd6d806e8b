//! Signals of the operating system to the process.

/// A signal that asks the process to end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProcessSignal {
    /// The terminal is gone: `SIGHUP`.
    HangUp = 1,
    /// A person wants it, by Ctrl-C: `SIGINT`.
    Interrupt = 2,
    /// Another process wants it: `SIGTERM`.
    Terminate = 15,
}

impl ProcessSignal {
    /// Returns the number of the signal.
    pub const fn number(self) -> u8 {
        self as u8
    }
}
