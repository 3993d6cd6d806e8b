//! Streams.

use crate::vm::Vm;

impl Vm {
    /// Writes what standard output has gathered.
    pub(crate) fn flush_output(&mut self) {
        self.console.flush(&mut *self.host);
    }
}
