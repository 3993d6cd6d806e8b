//! Restoring the terminal when a session ends while a line is being edited.

/// Settings of the terminal at standard input.
#[cfg(unix)]
pub(super) struct Terminal(rustix::termios::Termios);

#[cfg(unix)]
impl Terminal {
    /// Returns the present settings, if standard input is a terminal.
    pub(super) fn now() -> Option<Terminal> {
        rustix::termios::tcgetattr(std::io::stdin()).ok().map(Terminal)
    }

    /// Restores these settings, and begins a line. Returns whether that could be done.
    pub(super) fn restore(&self) -> bool {
        use std::io::Write;
        let is_restored =
            rustix::termios::tcsetattr(std::io::stdin(), rustix::termios::OptionalActions::Now, &self.0);
        // Ends the bracketed paste that the editor has asked for.
        let mut out = std::io::stdout().lock();
        is_restored.is_ok() && out.write_all(b"\x1b[?2004l\r\n").and_then(|()| out.flush()).is_ok()
    }
}

/// On other systems a session ends with the line that is being edited.
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
