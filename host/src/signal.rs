//! Signals of the operating system to the process.

use esl_heap::state::{StateSink, Stated};

/// A signal of the process, which a program may handle, or which asks the process to end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProcessSignal {
    /// The terminal is gone: `SIGHUP`.
    HangUp,
    /// A person wants it, by Ctrl-C: `SIGINT`.
    Interrupt,
    /// `SIGUSR1`, whose meaning is the program's.
    User1,
    /// `SIGUSR2`, likewise.
    User2,
    /// Another process wants it: `SIGTERM`.
    Terminate,
    /// The terminal has another size: `SIGWINCH`.
    Window,
    /// Another one by which the system ends a process that does not handle it, by its number.
    Other(u8),
}

impl Stated for ProcessSignal {
    fn tell(&self, sink: &mut dyn StateSink) {
        sink.word(u64::from(self.number()));
    }
}

impl ProcessSignal {
    /// The signals that a program can handle.
    pub const HANDLED: [ProcessSignal; 6] = [
        ProcessSignal::HangUp,
        ProcessSignal::Interrupt,
        ProcessSignal::User1,
        ProcessSignal::User2,
        ProcessSignal::Terminate,
        ProcessSignal::Window,
    ];

    /// Returns the signal of this number.
    pub fn from_number(number: usize) -> Option<ProcessSignal> {
        let known = ProcessSignal::HANDLED.into_iter().find(|signal| usize::from(signal.number()) == number);
        known.or_else(|| u8::try_from(number).ok().filter(|&other| other > 0).map(ProcessSignal::Other))
    }

    /// Returns whether a program can handle the signal.
    pub fn can_be_handled(self) -> bool {
        !matches!(self, ProcessSignal::Other(_))
    }

    /// Returns whether the signal ends a run that does not handle it.
    pub fn ends_a_run(self) -> bool {
        self != ProcessSignal::Window
    }

    /// Returns the number of the signal, as Linux has it.
    pub const fn number(self) -> u8 {
        match self {
            ProcessSignal::HangUp => 1,
            ProcessSignal::Interrupt => 2,
            ProcessSignal::User1 => 10,
            ProcessSignal::User2 => 12,
            ProcessSignal::Terminate => 15,
            ProcessSignal::Window => 28,
            ProcessSignal::Other(number) => number,
        }
    }
}

esl_heap::stored_enum! { ProcessSignal {
    HangUp = 0, Interrupt = 1, User1 = 2, User2 = 3, Terminate = 4, Window = 5, Other(number) = 6,
} }

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_signal_is_found_by_its_number() {
        for signal in ProcessSignal::HANDLED {
            assert_eq!(ProcessSignal::from_number(signal.number().into()), Some(signal));
            assert!(signal.can_be_handled());
        }
        assert_eq!(ProcessSignal::from_number(14), Some(ProcessSignal::Other(14)));
        assert_eq!((ProcessSignal::from_number(0), ProcessSignal::from_number(300)), (None, None));
    }
}
