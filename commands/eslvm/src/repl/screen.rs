//! Printing while a line is being edited.

use std::io::{self, Write};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rustyline::ExternalPrinter;

/// Prints above the line that the person edits, or directly while there is no editor.
#[derive(Clone, Default)]
pub(crate) struct PromptScreen(Arc<Mutex<Option<Box<dyn ExternalPrinter + Send>>>>);

impl PromptScreen {
    fn lock(&self) -> MutexGuard<'_, Option<Box<dyn ExternalPrinter + Send>>> {
        // A panic elsewhere leaves the printer as it was.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Prints through an editor's printer from now on.
    pub(crate) fn print_through(&self, printer: Box<dyn ExternalPrinter + Send>) {
        *self.lock() = Some(printer);
    }

    /// Prints directly from now on.
    pub(crate) fn leave_editor(&self) {
        *self.lock() = None;
    }

    /// Prints bytes that the program writes.
    ///
    /// # Errors
    /// If standard output cannot be written.
    pub(crate) fn print(&self, bytes: &[u8]) -> std::io::Result<()> {
        if let Some(printer) = &mut *self.lock() {
            return printer.print(String::from_utf8_lossy(bytes).into_owned()).map_err(std::io::Error::other);
        }
        let mut out = std::io::stdout().lock();
        out.write_all(bytes).and_then(|()| out.flush())
    }
}

/// Prints the output of a run elsewhere.
#[derive(Clone)]
pub(super) struct SessionPrinter {
    pub(super) screen: PromptScreen,
    pub(super) is_interactive: bool,
}

impl SessionPrinter {
    pub(super) fn print(&self, text: &str) {
        // A closed output is ignored.
        _ = if self.is_interactive {
            self.screen.print(text.as_bytes())
        } else {
            let mut out = io::stdout().lock();
            out.write_all(text.as_bytes()).and_then(|()| out.flush())
        };
    }
}
