//! Where the bytes of a file go: to the file in large parts, or to a program that writes them.

use std::fs::File;
use std::io::{Error, Result, Seek, SeekFrom, Write};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Bytes that are kept until they are written.
const KEPT: usize = 1 << 18;

#[derive(Default)]
struct SinkState {
    /// `None` if a program takes the bytes.
    file: Option<File>,
    kept: Vec<u8>,
    written: u64,
}

/// A sink of bytes. Clones are the same.
#[derive(Clone, Default)]
pub(super) struct ByteSink(Arc<Mutex<SinkState>>);

impl ByteSink {
    /// Returns a sink that writes to a file; without one, a sink that keeps all bytes until they are taken.
    pub(super) fn new(file: Option<File>) -> ByteSink {
        ByteSink(Arc::new(Mutex::new(SinkState { file, ..SinkState::default() })))
    }

    fn state(&self) -> MutexGuard<'_, SinkState> {
        // The state is whole at every moment, so a panic elsewhere does not corrupt it.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the bytes that were kept for the program.
    pub(super) fn take(&self) -> Vec<u8> {
        std::mem::take(&mut self.state().kept)
    }

    /// Hands all bytes to the system.
    pub(super) fn pass_on(&self) -> Result<()> {
        self.state().pass_on()
    }
}

impl SinkState {
    fn pass_on(&mut self) -> Result<()> {
        if let Some(file) = &mut self.file {
            let result = file.write_all(&self.kept);
            self.kept.clear();
            result?;
        }
        Ok(())
    }
}

impl Write for ByteSink {
    fn write(&mut self, bytes: &[u8]) -> Result<usize> {
        let mut state = self.state();
        state.kept.extend_from_slice(bytes);
        state.written += bytes.len() as u64;
        if state.file.is_some() && state.kept.len() >= KEPT {
            state.pass_on()?;
        }
        Ok(bytes.len())
    }

    /// Does nothing: [`ByteSink::pass_on`] is called where bytes have to be safe.
    fn flush(&mut self) -> Result<()> {
        Ok(())
    }
}

/// Tells the position only.
impl Seek for ByteSink {
    fn seek(&mut self, place: SeekFrom) -> Result<u64> {
        match place {
            SeekFrom::Current(0) | SeekFrom::End(0) => Ok(self.state().written),
            _ => Err(Error::other("the file is written from its beginning to its end")),
        }
    }
}
