//! How a terminal was before lines were edited, to be so again when a session ends while one is.

/// The settings of the terminal at standard input.
#[cfg(unix)]
pub(super) struct Terminal(rustix::termios::Termios);

#[cfg(unix)]
impl Terminal {
    /// Its settings now, if it is one.
    pub(super) fn now() -> Option<Terminal> {
        rustix::termios::tcgetattr(std::io::stdin()).ok().map(Terminal)
    }

    /// Gives it these settings again, and begins a line; whether that is done.
    pub(super) fn restore(&self) -> bool {
        use std::io::Write;
        let is_restored =
            rustix::termios::tcsetattr(std::io::stdin(), rustix::termios::OptionalActions::Now, &self.0);
        // The editor has asked for pasted text to be marked.
        let mut out = std::io::stdout().lock();
        is_restored.is_ok() && out.write_all(b"\x1b[?2004l\r\n").and_then(|()| out.flush()).is_ok()
    }
}

/// Elsewhere a session ends with the line that is being edited.
#[cfg(not(unix))]
pub(super) struct Terminal;

#[cfg(not(unix))]
impl Terminal {
    pub(super) fn now() -> Option<Terminal> {
        None
    }

    pub(super) fn restore(&self) -> bool {
        false
    }
}
