//! The folder of a durable run: its owner, and its lock, which one process holds at a time.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
#[cfg(unix)]
use std::time::Duration;

use super::DurableError;

/// Name of the file that is locked.
const LOCK: &str = "lock";

/// Time in which a process that was killed lets go of the lock, its fork included.
#[cfg(unix)]
const PATIENCE: Duration = Duration::from_secs(2);
/// Time for which a lock is waited for whose holder seems to run. It may have been killed just now.
#[cfg(unix)]
const DOUBT: Duration = Duration::from_millis(300);

/// The folder of a durable run, or of several, which this process has until this is dropped.
#[derive(Debug)]
pub struct RunFolder {
    path: PathBuf,
    /// Whether it was made here, and is removed again unless it gets contents.
    is_new: AtomicBool,
    /// Locked until it is closed, which the system does when the process ends.
    _lock: File,
}

impl Drop for RunFolder {
    fn drop(&mut self) {
        if *self.is_new.get_mut() {
            // A process that waits for the lock notices that its file is not that of the folder any more.
            drop(fs::remove_file(self.path.join(LOCK)));
            drop(fs::remove_dir(&self.path));
        }
    }
}

impl RunFolder {
    /// Makes the folder if there is none, and takes it for this process.
    ///
    /// # Errors
    /// [`DurableError`].
    pub fn open(path: &Path) -> Result<RunFolder, DurableError> {
        let folder_error = |error| DurableError::Folder(path.into(), error);
        if path.as_os_str().is_empty() {
            return Err(folder_error(io::ErrorKind::InvalidInput.into()));
        }
        let mut builder = fs::DirBuilder::new();
        #[cfg(unix)]
        std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
        if let Some(parent) = path.parent() {
            builder.recursive(true).create(parent).map_err(folder_error)?;
        }
        let is_new = match builder.recursive(false).create(path) {
            Ok(()) => true,
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists && path.is_dir() => false,
            Err(error) => return Err(folder_error(error)),
        };
        let taken = RunFolder::take(path);
        match &taken {
            Ok(folder) => folder.is_new.store(is_new, Ordering::Relaxed),
            // Such as a full disk. Another error says that another process has it by now.
            Err(DurableError::Folder(..)) if is_new => {
                drop(fs::remove_file(path.join(LOCK)));
                drop(fs::remove_dir(path));
            }
            Err(_) => {}
        }
        taken
    }

    /// Keeps a folder that was made here.
    pub fn keep(&self) {
        self.is_new.store(false, Ordering::Relaxed);
    }

    /// Takes a folder that is there for this process.
    ///
    /// # Errors
    /// [`DurableError`].
    pub(crate) fn take(path: &Path) -> Result<RunFolder, DurableError> {
        check_private(path)?;
        let lock_path = path.join(LOCK);
        let mut options = OpenOptions::new();
        options.read(true).write(true).create(true).truncate(false);
        #[cfg(unix)]
        std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
        let lock = loop {
            let lock = options.open(&lock_path);
            let lock = lock.map_err(|error| DurableError::Folder(lock_path.clone(), error))?;
            #[cfg(unix)]
            take_lock(&lock, path)?;
            if is_at(&lock, &lock_path) {
                break lock;
            }
        };
        Ok(RunFolder { path: path.into(), is_new: AtomicBool::new(false), _lock: lock })
    }

    /// Returns the path of the folder.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

/// Returns whether a file is still the one at a place: the folder may have been removed meanwhile.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let identity = |metadata: std::io::Result<fs::Metadata>| metadata.map(|one| (one.dev(), one.ino())).ok();
    identity(file.metadata()) == identity(fs::metadata(path))
}

#[cfg(not(unix))]
fn is_at(_file: &File, _path: &Path) -> bool {
    true
}

/// Locks the folder, and notes the number of this process in the file. A fork of a process that was killed
/// just now may have the lock for a moment still.
#[cfg(unix)]
fn take_lock(lock: &File, path: &Path) -> Result<(), DurableError> {
    use std::os::unix::fs::FileExt;

    use rustix::fs::{FlockOperation, flock};
    use rustix::io::Errno;

    let folder_error = |error: std::io::Error| DurableError::Folder(path.join(LOCK), error);
    let begun = std::time::Instant::now();
    loop {
        match flock(lock, FlockOperation::NonBlockingLockExclusive) {
            Ok(()) => break,
            Err(Errno::WOULDBLOCK)
                if begun.elapsed() < DOUBT || begun.elapsed() < PATIENCE && !is_holder_alive(lock) =>
            {
                std::thread::sleep(Duration::from_millis(5));
            }
            Err(Errno::WOULDBLOCK) if is_holder_alive(lock) => return Err(DurableError::InUse(path.into())),
            Err(Errno::WOULDBLOCK) => return Err(DurableError::Inherited(path.into())),
            Err(error) => return Err(folder_error(error.into())),
        }
    }
    let number = std::process::id().to_string();
    lock.write_all_at(number.as_bytes(), 0).map_err(folder_error)?;
    lock.set_len(number.len() as u64).map_err(folder_error)
}

/// Returns whether the process is there that has noted its number in the file.
#[cfg(unix)]
fn is_holder_alive(lock: &File) -> bool {
    use std::os::unix::fs::FileExt;

    let mut text = [0; 16];
    let length = lock.read_at(&mut text, 0).unwrap_or(0);
    let number = std::str::from_utf8(&text[..length]).ok().and_then(|text| text.parse().ok());
    let process = number.and_then(rustix::process::Pid::from_raw);
    process.is_some_and(|process| rustix::process::test_kill_process(process).is_ok())
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
