//! The disk as a journal sees it: one file, which grows at its end.
//!
//! It is a trait, for tests with disks that fail, lose unsynced data, and stop at any call.

use std::fs::{File, OpenOptions};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

/// The file of a journal. Each function is one place at which a process or a system may stop.
pub trait Disk: Send {
    /// Returns the contents; `None` if there is no file.
    ///
    /// # Errors
    /// If it cannot be read.
    fn read(&mut self) -> io::Result<Option<Vec<u8>>>;

    /// Creates the file with these contents, as a whole: after a crash it has them, or does not exist.
    ///
    /// # Errors
    /// If it cannot be made.
    fn create(&mut self, contents: &[u8]) -> io::Result<()>;

    /// Cuts the file to this length, and syncs it.
    ///
    /// # Errors
    /// If it cannot be cut.
    fn truncate(&mut self, length: u64) -> io::Result<()>;

    /// Writes at the end of the file.
    ///
    /// # Errors
    /// If not all was written.
    fn append(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Returns when all written data are on the disk.
    ///
    /// # Errors
    /// If the system reports an error. A second call does not help: the system may have dropped the data.
    fn sync(&mut self) -> io::Result<()>;
}

/// A disk that keeps nothing, for a run that is only tried.
#[derive(Debug)]
pub(crate) struct NowhereDisk;

impl Disk for NowhereDisk {
    fn read(&mut self) -> io::Result<Option<Vec<u8>>> {
        Ok(None)
    }

    fn create(&mut self, _contents: &[u8]) -> io::Result<()> {
        Ok(())
    }

    fn truncate(&mut self, _length: u64) -> io::Result<()> {
        Ok(())
    }

    fn append(&mut self, _bytes: &[u8]) -> io::Result<()> {
        Ok(())
    }

    fn sync(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// A file of the system.
#[derive(Debug)]
pub struct RealDisk {
    path: PathBuf,
    file: Option<File>,
}

impl RealDisk {
    /// Returns the disk with the file of this name.
    pub fn new(path: PathBuf) -> RealDisk {
        RealDisk { path, file: None }
    }

    fn options() -> OpenOptions {
        let mut options = OpenOptions::new();
        options.read(true).append(true);
        #[cfg(unix)]
        std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
        options
    }

    fn file(&mut self) -> io::Result<&mut File> {
        if self.file.is_none() {
            self.file = Some(RealDisk::options().open(&self.path)?);
        }
        self.file.as_mut().ok_or_else(|| io::ErrorKind::NotFound.into())
    }
}

/// Syncs the names in the folder of a file.
fn sync_folder(of: &Path) -> io::Result<()> {
    match of.parent() {
        #[cfg(unix)]
        Some(folder) => File::open(folder)?.sync_all(),
        _ => Ok(()),
    }
}

impl Disk for RealDisk {
    fn read(&mut self) -> io::Result<Option<Vec<u8>>> {
        let mut bytes = Vec::new();
        match self.file() {
            Ok(file) => file.read_to_end(&mut bytes).map(|_| Some(bytes)),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(error),
        }
    }

    fn create(&mut self, contents: &[u8]) -> io::Result<()> {
        let new = self.path.with_extension("new");
        match std::fs::remove_file(&new) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
        let mut file = RealDisk::options().create_new(true).open(&new)?;
        file.write_all(contents)?;
        file.sync_all()?;
        std::fs::rename(&new, &self.path)?;
        sync_folder(&self.path)?;
        self.file = Some(file);
        Ok(())
    }

    fn truncate(&mut self, length: u64) -> io::Result<()> {
        let file = self.file()?;
        file.set_len(length)?;
        file.sync_all()
    }

    fn append(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.file()?.write_all(bytes)
    }

    fn sync(&mut self) -> io::Result<()> {
        self.file()?.sync_data()
    }
}

/// A disk whose process is killed before or behind a call, for tests of the remaining file.
#[cfg(all(unix, debug_assertions))]
pub(crate) struct DeadlyDisk<D> {
    disk: D,
    /// Places that are left: two for each call.
    left: u64,
    kill: Box<dyn FnMut() + Send>,
}

#[cfg(all(unix, debug_assertions))]
impl<D: Disk> DeadlyDisk<D> {
    /// Calls `kill` at the `place`-th place from here, from 1 on.
    pub(crate) fn new(disk: D, place: u64, kill: impl FnMut() + Send + 'static) -> DeadlyDisk<D> {
        DeadlyDisk { disk, left: place, kill: Box::new(kill) }
    }

    fn around<T>(&mut self, call: impl FnOnce(&mut D) -> io::Result<T>) -> io::Result<T> {
        self.pass();
        let result = call(&mut self.disk);
        self.pass();
        result
    }

    fn pass(&mut self) {
        self.left = self.left.saturating_sub(1);
        if self.left == 0 {
            (self.kill)();
        }
    }
}

#[cfg(all(unix, debug_assertions))]
impl<D: Disk> Disk for DeadlyDisk<D> {
    fn read(&mut self) -> io::Result<Option<Vec<u8>>> {
        self.around(D::read)
    }

    fn create(&mut self, contents: &[u8]) -> io::Result<()> {
        self.around(|disk| disk.create(contents))
    }

    fn truncate(&mut self, length: u64) -> io::Result<()> {
        self.around(|disk| disk.truncate(length))
    }

    fn append(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.around(|disk| disk.append(bytes))
    }

    fn sync(&mut self) -> io::Result<()> {
        self.around(D::sync)
    }
}
