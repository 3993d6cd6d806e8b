//! The folder of a durable run: its owner, and its lock, which one process holds at a time.

use std::fs::{self, File, OpenOptions};
use std::path::{Path, PathBuf};

use super::DurableError;

/// Name of the file that is locked.
const LOCK: &str = "lock";

/// Time in which a process that was killed lets go of the lock, its fork included.
#[cfg(unix)]
const PATIENCE: std::time::Duration = std::time::Duration::from_secs(2);

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
        wait_for_lock(&lock, path)?;
        Ok(RunFolder { path: path.into(), _lock: lock })
    }

    /// Returns the path of the folder.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }
}

/// Locks the folder. A fork of a process that was killed just now may have it for a moment still.
#[cfg(unix)]
fn wait_for_lock(lock: &File, path: &Path) -> Result<(), DurableError> {
    use rustix::fs::{FlockOperation, flock};
    use rustix::io::Errno;

    let begun = std::time::Instant::now();
    loop {
        match flock(lock, FlockOperation::NonBlockingLockExclusive) {
            Ok(()) => return Ok(()),
            Err(Errno::WOULDBLOCK) if begun.elapsed() < PATIENCE => {
                std::thread::sleep(std::time::Duration::from_millis(5));
            }
            Err(Errno::WOULDBLOCK) => return Err(DurableError::InUse(path.into())),
            Err(error) => return Err(DurableError::Folder(path.join(LOCK), error.into())),
        }
    }
}

/// Refuses files of other users, and files that other users may read or write.
#[cfg(unix)]
pub(crate) fn check_private(path: &Path) -> Result<(), DurableError> {
    use std::os::unix::fs::MetadataExt;
    let metadata = fs::metadata(path).map_err(|error| match error.kind() {
        std::io::ErrorKind::NotFound => DurableError::NoRun(path.into()),
        _ => DurableError::Folder(path.into(), error),
    })?;
    let is_own = metadata.uid() == rustix::process::geteuid().as_raw();
    if is_own && metadata.mode() & 0o077 == 0 { Ok(()) } else { Err(DurableError::NotPrivate(path.into())) }
}

#[cfg(not(unix))]
pub(crate) fn check_private(path: &Path) -> Result<(), DurableError> {
    fs::metadata(path).map(drop).map_err(|error| DurableError::Folder(path.into(), error))
}
