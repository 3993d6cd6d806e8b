//! Signals of the operating system to the process.

use esl_heap::state::{StateSink, Stated};

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

impl Stated for ProcessSignal {
    fn tell(&self, sink: &mut dyn StateSink) {
        sink.word(u64::from(self.number()));
    }
}

impl ProcessSignal {
    /// Returns the signal of this number.
    pub fn from_number(number: usize) -> Option<ProcessSignal> {
        let all = [ProcessSignal::HangUp, ProcessSignal::Interrupt, ProcessSignal::Terminate];
        all.into_iter().find(|signal| usize::from(signal.number()) == number)
    }

    /// Returns the number of the signal.
    pub const fn number(self) -> u8 {
        self as u8
    }
}
