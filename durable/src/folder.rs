//! The folder of a durable run: its owner, and its lock, which one process holds at a time.

use std::fs::{self, File, OpenOptions};
use std::path::{Path, PathBuf};

use super::DurableError;

/// Name of the journal.
const JOURNAL: &str = "journal.eslj";
/// Name of the file that is locked.
const LOCK: &str = "lock";

/// The folder of a durable run, which this process has.
#[derive(Debug)]
pub(crate) struct RunFolder {
    path: PathBuf,
    /// Locked until it is closed, which the system does when the process ends.
    _lock: File,
}

impl RunFolder {
    /// Makes the folder if there is none, and takes it for this process.
    ///
    /// # Errors
    /// [`DurableError`].
    pub(crate) fn open(path: &Path) -> Result<RunFolder, DurableError> {
        let mut builder = fs::DirBuilder::new();
        builder.recursive(true);
        #[cfg(unix)]
        std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
        builder.create(path).map_err(|error| DurableError::Folder(path.into(), error))?;
        RunFolder::take(path)
    }

    /// Takes a folder that is there for this process.
    ///
    /// # Errors
    /// [`DurableError`].
    pub(crate) fn take(path: &Path) -> Result<RunFolder, DurableError> {
        check_private(path)?;
        let lock_path = path.join(LOCK);
        let mut options = OpenOptions::new();
        options.write(true).create(true).truncate(false);
        #[cfg(unix)]
        std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
        let lock =
            options.open(&lock_path).map_err(|error| DurableError::Folder(lock_path.clone(), error))?;
        #[cfg(unix)]
        match rustix::fs::flock(&lock, rustix::fs::FlockOperation::NonBlockingLockExclusive) {
            Ok(()) => {}
            Err(rustix::io::Errno::WOULDBLOCK) => return Err(DurableError::InUse(path.into())),
            Err(error) => return Err(DurableError::Folder(lock_path, error.into())),
        }
        let folder = RunFolder { path: path.into(), _lock: lock };
        if folder.journal().exists() {
            check_private(&folder.journal())?;
        }
        Ok(folder)
    }

    /// Returns the file of the journal.
    pub(crate) fn journal(&self) -> PathBuf {
        self.path.join(JOURNAL)
    }
}

/// Refuses files of other users, and files that other users may read or write.
#[cfg(unix)]
fn check_private(path: &Path) -> Result<(), DurableError> {
    use std::os::unix::fs::MetadataExt;
    let metadata = fs::metadata(path).map_err(|error| match error.kind() {
        std::io::ErrorKind::NotFound => DurableError::NoRun(path.into()),
        _ => DurableError::Folder(path.into(), error),
    })?;
    let is_own = metadata.uid() == rustix::process::geteuid().as_raw();
    if is_own && metadata.mode() & 0o077 == 0 { Ok(()) } else { Err(DurableError::NotPrivate(path.into())) }
}

#[cfg(not(unix))]
fn check_private(path: &Path) -> Result<(), DurableError> {
    fs::metadata(path).map(drop).map_err(|error| DurableError::Folder(path.into(), error))
}
