//! The disk as a journal sees it: one file, which grows at its end.
//!
//! It is a trait, for tests with disks that fail, lose unsynced data, and stop at any call.

use std::fs::{File, OpenOptions};
use std::io::{self, Read, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::thread::JoinHandle;

use esl_replay::{add_to_sum, seal_snapshot};
use esl_vm::heap::HeapMemory;
use esl_vm::stored::{Fork, ForkContents};

use super::generations::{journal_file, snapshot_file};
use super::kill_place;

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

    /// Begins the journal of this generation with these contents, as a whole. Later bytes are appended
    /// there. After an error the journal before is the one that is written.
    ///
    /// # Errors
    /// If it cannot be made, or the disk has one journal only.
    fn begin_generation(&mut self, number: u64, contents: &[u8]) -> io::Result<()> {
        let _ = (number, contents);
        Err(io::ErrorKind::Unsupported.into())
    }

    /// Begins to write the snapshot of a generation, as a whole: after a crash the file has all of it, or
    /// does not exist. `head` are the bytes before the memory. When it is on the disk, the files of the
    /// generations are removed that are `obsolete` then.
    ///
    /// # Errors
    /// If that cannot be begun.
    fn write_snapshot(
        &mut self,
        number: u64,
        head: Vec<u8>,
        memory: &HeapMemory<'_>,
        obsolete: Range<u64>,
    ) -> io::Result<SnapshotWriting> {
        let _ = (number, head, memory, obsolete);
        Err(io::ErrorKind::Unsupported.into())
    }

    /// Removes the files of a generation.
    ///
    /// # Errors
    /// If one that is there cannot be removed.
    fn remove_generation(&mut self, number: u64) -> io::Result<()> {
        let _ = number;
        Err(io::ErrorKind::Unsupported.into())
    }
}

/// A snapshot that is being written on another thread.
#[derive(Debug)]
pub struct SnapshotWriting(JoinHandle<io::Result<()>>);

impl SnapshotWriting {
    /// Writes a file by a function on a thread of its own.
    ///
    /// # Errors
    /// If the system has no thread.
    pub fn spawn(write: impl FnOnce() -> io::Result<()> + Send + 'static) -> io::Result<SnapshotWriting> {
        std::thread::Builder::new().name("esl-snapshot".into()).spawn(write).map(SnapshotWriting)
    }

    /// Returns whether it was written, or cannot be.
    pub fn is_over(&self) -> bool {
        self.0.is_finished()
    }

    /// Waits until it was written and synced.
    ///
    /// # Errors
    /// If it was not.
    pub fn wait(self) -> io::Result<()> {
        self.0.join().unwrap_or_else(|_| Err(io::Error::other("its thread has failed")))
    }
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

    /// Returns the folder.
    fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new("."))
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
        let file = write_new(&new, contents)?;
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

    fn begin_generation(&mut self, number: u64, contents: &[u8]) -> io::Result<()> {
        let mut next = RealDisk::new(journal_file(self.folder(), number));
        // A file of this name would be another run's, such as that of a copy that was not completed.
        match std::fs::remove_file(snapshot_file(self.folder(), number)) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
        next.create(contents)?;
        *self = next;
        Ok(())
    }

    fn write_snapshot(
        &mut self,
        number: u64,
        head: Vec<u8>,
        memory: &HeapMemory<'_>,
        obsolete: Range<u64>,
    ) -> io::Result<SnapshotWriting> {
        let new = NewSnapshot::make(self.folder(), number, obsolete)?;
        match fork(&new.file, ForkContents { head: &head, memory, add_to_sum: add_piece }) {
            Ok(fork) => SnapshotWriting::spawn(move || fork.wait().and_then(|()| new.keep())),
            // The system has no room for a fork, or makes none.
            Err(_) => new.write_copy(head, memory),
        }
    }

    fn remove_generation(&mut self, number: u64) -> io::Result<()> {
        remove_files(self.folder(), number)
    }
}

/// Adds a piece that a fork writes to the checksum.
fn add_piece(sum: u32, bytes: &[u8]) -> u32 {
    kill_place::pass();
    add_to_sum(sum, bytes)
}

/// Writes to a file by a fork.
#[cfg(unix)]
fn fork(file: &File, contents: ForkContents<'_>) -> io::Result<Fork> {
    Fork::write(std::os::fd::AsRawFd::as_raw_fd(file), contents)
}

#[cfg(not(unix))]
fn fork(_file: &File, _contents: ForkContents<'_>) -> io::Result<Fork> {
    Err(io::ErrorKind::Unsupported.into())
}

/// Removes the files of a generation, those that are there.
fn remove_files(folder: &Path, number: u64) -> io::Result<()> {
    let snapshot = snapshot_file(folder, number);
    // The journal goes last: a generation without one is not there.
    for file in [snapshot.with_extension("new"), snapshot, journal_file(folder, number)] {
        kill_place::pass();
        match std::fs::remove_file(file) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
    }
    kill_place::pass();
    Ok(())
}

/// A snapshot that is being written, under another name.
struct NewSnapshot {
    file: File,
    name: PathBuf,
    last_name: PathBuf,
    /// Generations that are removed then.
    obsolete: Range<u64>,
}

impl NewSnapshot {
    fn make(folder: &Path, number: u64, obsolete: Range<u64>) -> io::Result<NewSnapshot> {
        let last_name = snapshot_file(folder, number);
        let name = last_name.with_extension("new");
        Ok(NewSnapshot { file: make_new(&name)?, name, last_name, obsolete })
    }

    /// Copies the memory, and writes the copy on another thread.
    fn write_copy(mut self, head: Vec<u8>, memory: &HeapMemory<'_>) -> io::Result<SnapshotWriting> {
        let mut bytes = head;
        bytes.reserve(memory.bytes());
        memory.append_to(&mut bytes);
        SnapshotWriting::spawn(move || {
            seal_snapshot(&mut bytes);
            self.file.write_all(&bytes)?;
            self.keep()
        })
    }

    /// Gives the file its name, once all of it is on the disk, and removes the obsolete generations.
    fn keep(mut self) -> io::Result<()> {
        kill_place::pass();
        self.file.sync_all()?;
        kill_place::pass();
        std::fs::rename(&self.name, &self.last_name)?;
        kill_place::pass();
        sync_folder(&self.last_name)?;
        let folder = self.last_name.parent().unwrap_or(Path::new("."));
        self.obsolete.try_for_each(|number| remove_files(folder, number))
    }
}

/// Makes a new file, in place of one that a process has left.
fn make_new(path: &Path) -> io::Result<File> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
        _ => {}
    }
    RealDisk::options().create_new(true).open(path)
}

/// Writes and syncs a new file, in place of one that a process has left.
fn write_new(path: &Path, contents: &[u8]) -> io::Result<File> {
    let mut file = make_new(path)?;
    file.write_all(contents)?;
    file.sync_all()?;
    Ok(file)
}

/// A disk whose process is killed before or behind a call, for tests of the remaining file.
#[cfg(all(unix, debug_assertions))]
pub(crate) struct DeadlyDisk<D>(pub(crate) D);

#[cfg(all(unix, debug_assertions))]
impl<D: Disk> DeadlyDisk<D> {
    fn around<T>(&mut self, call: impl FnOnce(&mut D) -> io::Result<T>) -> io::Result<T> {
        kill_place::pass();
        let result = call(&mut self.0);
        kill_place::pass();
        result
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

    fn begin_generation(&mut self, number: u64, contents: &[u8]) -> io::Result<()> {
        self.around(|disk| disk.begin_generation(number, contents))
    }

    fn write_snapshot(
        &mut self,
        number: u64,
        head: Vec<u8>,
        memory: &HeapMemory<'_>,
        obsolete: Range<u64>,
    ) -> io::Result<SnapshotWriting> {
        self.around(|disk| disk.write_snapshot(number, head, memory, obsolete))
    }

    fn remove_generation(&mut self, number: u64) -> io::Result<()> {
        self.around(|disk| disk.remove_generation(number))
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use esl_host::VirtualHost;
    use esl_replay::{RunSnapshot, snapshot_head};
    use esl_vm::heap::range_start;
    use esl_vm::vm::{Config, Vm};

    use super::*;

    #[test]
    fn a_snapshot_is_the_same_by_a_fork_and_by_a_copy() {
        let folder = std::env::temp_dir().join(format!("esl-snapshot-{}", std::process::id()));
        std::fs::create_dir(&folder).expect("it is new");
        let range = range_start(777).expect("the system has 64 bits");
        let config = Config { range: Some(range), memory: 16 << 20, ..Config::DEFAULT };
        let mut machine = Vm::new(config, Box::new(VirtualHost::new())).expect("there is room");
        let state = machine.store_state().expect("nothing is under way");
        for number in 0..4 {
            std::fs::write(journal_file(&folder, number), "").expect("there is room");
        }
        let written = machine.with_state(|state| {
            let head = snapshot_head(3, range, state);
            let mut disk = RealDisk::new(journal_file(&folder, 2));
            let fork = disk.write_snapshot(3, head.clone(), state.memory(), 0..2);
            let copy =
                NewSnapshot::make(&folder, 4, 2..3).and_then(|new| new.write_copy(head, state.memory()));
            fork.and_then(SnapshotWriting::wait).and(copy.and_then(SnapshotWriting::wait))
        });
        written.expect("nothing is under way").expect("there is room on the disk");
        let read = |number| std::fs::read(snapshot_file(&folder, number)).expect("it was written");
        assert!(read(3) == read(4));
        let snapshot = RunSnapshot::read(read(3)).expect("it is whole");
        assert_eq!((snapshot.number, snapshot.range, &*snapshot.state), (3, range, &state));
        // The last journal, and both snapshots.
        assert_eq!(std::fs::read_dir(&folder).expect("it is there").count(), 3);
        std::fs::remove_dir_all(&folder).expect("it can be removed");
    }
}
