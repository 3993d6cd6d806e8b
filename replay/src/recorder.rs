//! Writing a recording while the run goes on.

use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use esl_host::{NotedRecord, Recorder};
use esl_vm::vm::Vm;

use super::file::{Beginning, RecordedEnd, beginning_bytes, end_bytes};
use super::journal::JournalWriter;

/// Bytes that wait at most, before they are written.
const BUFFER: usize = 64 << 10;

/// The state of a file that is being written.
struct Writing {
    file: File,
    pending: JournalWriter,
    has_begun: bool,
    /// The first error; nothing is written after it.
    error: Option<io::Error>,
}

/// A file that the records of a run are written to. Clones write to the same file.
///
/// Records are written when the machine is about to wait, and at checks, so that a run that is killed loses
/// little of its record.
#[derive(Clone)]
pub struct FileRecorder(Arc<Mutex<Writing>>);

impl FileRecorder {
    /// Creates the file, in place of one that is there; only its owner may read it, since all that the
    /// program is given is in it.
    ///
    /// # Errors
    /// If it cannot be made.
    pub fn create(path: &Path) -> io::Result<FileRecorder> {
        let mut options = OpenOptions::new();
        options.write(true).create(true).truncate(true);
        #[cfg(unix)]
        std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
        let file = options.open(path)?;
        #[cfg(unix)]
        if file.metadata()?.is_file() {
            file.set_permissions(std::os::unix::fs::PermissionsExt::from_mode(0o600))?;
        }
        let (pending, has_begun, error) = (JournalWriter::default(), false, None);
        Ok(FileRecorder(Arc::new(Mutex::new(Writing { file, pending, has_begun, error }))))
    }

    fn writing(&self) -> MutexGuard<'_, Writing> {
        // Each record is added whole, so a panic elsewhere does not corrupt the file.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Writes what the run begins with. To be called when the machine is ready for its program; records that
    /// were made before follow.
    pub fn begin(&self, beginning: &Beginning) {
        let mut writing = self.writing();
        writing.write(&beginning_bytes(beginning));
        writing.has_begun = true;
        writing.flush();
    }

    /// Writes how the run of this machine has ended.
    ///
    /// # Errors
    /// The first error of all writes to the file.
    pub fn end(&self, machine: &Vm, status: u8) -> io::Result<()> {
        let mut writing = self.writing();
        writing.flush();
        writing.write(&end_bytes(&RecordedEnd { status, check: machine.check() }));
        writing.error.take().map_or(Ok(()), Err)
    }
}

impl Writing {
    fn write(&mut self, bytes: &[u8]) {
        if self.error.is_none() {
            self.error = self.file.write_all(bytes).err();
        }
    }

    fn flush(&mut self) {
        if self.has_begun {
            let bytes = self.pending.take_unmarked();
            self.write(&bytes);
        }
    }
}

impl Recorder for FileRecorder {
    fn note(&self, noted: NotedRecord) {
        let mut writing = self.writing();
        if writing.error.is_none() && writing.pending.add(&noted) > BUFFER {
            writing.flush();
        }
    }

    fn flush(&self) {
        self.writing().flush();
    }

    fn break_off(&self) {
        let mut writing = self.writing();
        writing.flush();
        let why = "the system has refused memory, which a replay cannot repeat; the recording ends there";
        writing.error.get_or_insert_with(|| io::Error::new(io::ErrorKind::OutOfMemory, why));
    }
}
