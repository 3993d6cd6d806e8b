//! The output of programs, for a function of Python.

use std::io;
use std::sync::Arc;

use pyo3::prelude::*;

use crate::process::stay_at_exit;

/// Calls a function with the output of a program, as texts.
pub(crate) struct Output {
    function: Arc<Py<PyAny>>,
    /// Bytes of a character whose other bytes are to come.
    rest: Vec<u8>,
}

impl Output {
    pub(crate) fn new(function: Arc<Py<PyAny>>) -> Output {
        Output { function, rest: Vec::new() }
    }

    /// Returns the text of all whole characters that have come. Bytes that are not text become U+FFFD.
    fn text(&mut self, bytes: &[u8]) -> String {
        self.rest.extend_from_slice(bytes);
        let whole = match std::str::from_utf8(&self.rest) {
            Err(error) if error.error_len().is_none() => error.valid_up_to(),
            _ => self.rest.len(),
        };
        let text = String::from_utf8_lossy(&self.rest[..whole]).into_owned();
        self.rest.drain(..whole);
        text
    }

    /// Hands output on. An exception of the function does not end the program: Python reports it as one that
    /// nothing catches.
    fn write(&mut self, bytes: &[u8]) {
        let text = self.text(bytes);
        if text.is_empty() {
            return;
        }
        stay_at_exit();
        Python::attach(|py| {
            if let Err(error) = self.function.call1(py, (text,)) {
                error.write_unraisable(py, Some(self.function.bind(py)));
            }
        });
    }
}

/// The screen of a host.
pub(crate) type Screen = Box<dyn FnMut(&[u8]) -> io::Result<()> + Send>;

/// Returns the screen of a host that writes to a function.
pub(crate) fn screen(mut output: Output) -> Screen {
    Box::new(move |bytes| {
        output.write(bytes);
        Ok(())
    })
}
