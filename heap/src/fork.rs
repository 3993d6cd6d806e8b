//! A fork of the process that writes a part of its memory to a file, while the process goes on.
//!
//! The system copies the tables of pages only; a page is copied when the process changes it before the fork
//! has ended. So the process stands still for a moment, however much there is to write.
//!
//! The fork has none of the other threads of the process, which may have held any lock. So between its
//! beginning and its end it makes system calls only: it allocates nothing, and takes no lock. It lets go of
//! all other files, so that a lock on one of them ends with the process, and ends itself with the thread that
//! has made it.
//!
//! Not here: systems other than Linux, and the name of the file.

#![allow(unsafe_code)]

use crate::heap::HeapMemory;

/// The contents of the file that a fork writes.
#[derive(Clone, Copy)]
pub struct ForkContents<'a> {
    /// The first bytes.
    pub head: &'a [u8],
    /// The memory that follows.
    pub memory: &'a HeapMemory<'a>,
    /// Adds bytes to a checksum, which begins with 0 and is written at the end. It allocates nothing, and
    /// takes no lock.
    pub add_to_sum: fn(u32, &[u8]) -> u32,
}

/// A fork that writes, or is over. It is waited for when this is dropped.
#[derive(Debug)]
pub struct Fork {
    #[cfg(all(target_os = "linux", not(miri)))]
    child: libc::pid_t,
    /// The end of a pipe from which its report is read.
    #[cfg(all(target_os = "linux", not(miri)))]
    report: libc::c_int,
}

#[cfg(all(target_os = "linux", not(miri)))]
mod system {
    use std::io;
    use std::mem::MaybeUninit;

    use super::{Fork, ForkContents};

    /// Bytes that are written at a time, if they come in small pieces.
    const BUFFER: usize = 256 << 10;

    impl Fork {
        /// Writes to the file with this number by a fork of the process.
        ///
        /// # Errors
        /// If the system makes none.
        pub fn write(file: i32, contents: ForkContents<'_>) -> io::Result<Fork> {
            let mut ends = [0; 2];
            // SAFETY: the call writes two numbers.
            if unsafe { libc::pipe2(ends.as_mut_ptr(), libc::O_CLOEXEC) } < 0 {
                return Err(io::Error::last_os_error());
            }
            let [report, teller] = ends;
            let mut writing = ForkWriting { file, contents, buffer: vec![0; BUFFER].into(), used: 0, sum: 0 };
            let (all, mut before) = (all_signals(), MaybeUninit::uninit());
            // SAFETY: the sets of signals are initialised before they are read. No signal reaches the fork,
            // whose handlers would speak for the process. The fork keeps the promises in the head of this
            // module, and never returns.
            let (child, error) = unsafe {
                let parent = libc::getpid();
                libc::pthread_sigmask(libc::SIG_SETMASK, &raw const all, before.as_mut_ptr());
                let child = libc::fork();
                if child == 0 {
                    run(parent, teller, &mut writing);
                }
                let error = io::Error::last_os_error();
                libc::pthread_sigmask(libc::SIG_SETMASK, before.as_ptr(), std::ptr::null_mut());
                libc::close(teller);
                if child < 0 {
                    libc::close(report);
                }
                (child, error)
            };
            if child > 0 { Ok(Fork { child, report }) } else { Err(error) }
        }

        /// Waits until all is written, which is not yet on the disk.
        ///
        /// # Errors
        /// If it was not.
        pub fn wait(self) -> io::Result<()> {
            let mut told = [0; 4];
            // SAFETY: the call writes four bytes at most. A pipe gives as many at once as were written at
            // once.
            let mut read = || unsafe { libc::read(self.report, told.as_mut_ptr().cast(), told.len()) };
            loop {
                match read() {
                    4 => break,
                    -1 if io::Error::last_os_error().kind() == io::ErrorKind::Interrupted => {}
                    _ => return Err(io::Error::other("the fork has ended early")),
                }
            }
            match i32::from_le_bytes(told) {
                0 => Ok(()),
                error => Err(io::Error::from_raw_os_error(error)),
            }
        }
    }

    impl Drop for Fork {
        fn drop(&mut self) {
            // SAFETY: the fork has this end of the pipe to itself.
            unsafe { libc::close(self.report) };
            // SAFETY: the status is not asked for. An embedder that ignores its children has it ended by the
            // system, which the call reports.
            while unsafe { libc::waitpid(self.child, std::ptr::null_mut(), 0) } < 0
                && io::Error::last_os_error().kind() == io::ErrorKind::Interrupted
            {}
        }
    }

    fn all_signals() -> libc::sigset_t {
        let mut all = MaybeUninit::uninit();
        // SAFETY: `sigfillset` initialises the set.
        unsafe {
            libc::sigfillset(all.as_mut_ptr());
            all.assume_init()
        }
    }

    /// The work of the fork.
    struct ForkWriting<'a> {
        file: i32,
        contents: ForkContents<'a>,
        /// Bytes that wait, in `buffer[..used]`.
        buffer: Box<[u8]>,
        used: usize,
        /// Checksum of the bytes so far.
        sum: u32,
    }

    /// Does the work of the fork, tells the process how it went, and ends.
    ///
    /// # Safety
    /// This is the fork of the process `parent`.
    unsafe fn run(parent: libc::pid_t, teller: i32, writing: &mut ForkWriting<'_>) -> ! {
        // SAFETY: these calls may be made in a fork. The files that are closed belong to its copies of
        // objects that it never uses.
        unsafe {
            libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGKILL);
            if libc::getppid() != parent {
                libc::_exit(1);
            }
            let (first, second) = (teller.min(writing.file), teller.max(writing.file));
            close_between(-1, first);
            close_between(first, second);
            close_between(second, i32::MAX);
            let told = if writing.put_all() { 0 } else { (*libc::__errno_location()).max(1) };
            write_all(teller, &told.to_le_bytes());
            libc::_exit(0)
        }
    }

    /// Closes the files between two others. A system that cannot do so closes them when the fork ends.
    ///
    /// # Safety
    /// None of them is used any more.
    unsafe fn close_between(before: i32, behind: i32) {
        if behind - 1 > before {
            // SAFETY: the contract says that no code uses these files any more.
            unsafe { libc::syscall(libc::SYS_close_range, before + 1, behind - 1, 0) };
        }
    }

    /// Writes all bytes to a file. Returns whether it has.
    fn write_all(file: i32, mut bytes: &[u8]) -> bool {
        while !bytes.is_empty() {
            // SAFETY: the call reads so many bytes.
            let written = unsafe { libc::write(file, bytes.as_ptr().cast(), bytes.len()) };
            match usize::try_from(written) {
                Ok(0) => return false,
                Ok(written) => bytes = bytes.get(written..).unwrap_or_default(),
                // SAFETY: it is the address of a number of this thread.
                Err(_) if unsafe { *libc::__errno_location() } == libc::EINTR => {}
                Err(_) => return false,
            }
        }
        true
    }

    impl ForkWriting<'_> {
        fn put_all(&mut self) -> bool {
            let ForkContents { head, memory, .. } = self.contents;
            self.put(head) && memory.write_to(&mut |bytes| self.put(bytes)) && {
                let sum = self.sum.to_le_bytes();
                self.put(&sum) && self.flush()
            }
        }

        fn put(&mut self, bytes: &[u8]) -> bool {
            self.sum = (self.contents.add_to_sum)(self.sum, bytes);
            if bytes.len() > self.buffer.len() - self.used && !self.flush() {
                return false;
            }
            match self.buffer.get_mut(self.used..self.used + bytes.len()) {
                Some(place) => {
                    place.copy_from_slice(bytes);
                    self.used += bytes.len();
                    true
                }
                None => write_all(self.file, bytes),
            }
        }

        fn flush(&mut self) -> bool {
            let used = std::mem::take(&mut self.used);
            write_all(self.file, self.buffer.get(..used).unwrap_or_default())
        }
    }
}

#[cfg(not(all(target_os = "linux", not(miri))))]
impl Fork {
    /// Writes to the file with this number by a fork of the process.
    ///
    /// # Errors
    /// Always: this system makes none.
    pub fn write(_file: i32, _contents: ForkContents<'_>) -> std::io::Result<Fork> {
        Err(std::io::ErrorKind::Unsupported.into())
    }

    /// Waits until all is written, which is not yet on the disk.
    ///
    /// # Errors
    /// Never, as there is no fork.
    pub fn wait(self) -> std::io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    #[test]
    #[cfg(all(target_os = "linux", target_pointer_width = "64", not(miri)))]
    fn a_fork_writes_the_memory_as_it_was_when_it_began() {
        use std::fs::File;
        use std::io::{ErrorKind, Read, Seek};
        use std::os::fd::AsRawFd;

        use super::*;
        use crate::heap::{Heap, HeapConfig};
        use crate::value::Value;

        fn add(sum: u32, bytes: &[u8]) -> u32 {
            bytes.iter().fold(sum, |sum, &byte| sum.rotate_left(5) ^ u32::from(byte))
        }

        let config = HeapConfig { range: Some(0x0f30_0000_0000), ..HeapConfig::default() };
        // SAFETY: H1: a test uses the values of one heap, while it has it.
        let mut heap = unsafe { Heap::new(config) };
        let mut list = Value::NIL;
        for number in 0..100_000 {
            list = heap.cons(Value::index(number), list).expect("there is room");
        }
        heap.alloc_vector_filled(300_000, list).expect("there is room");
        let mut head = Vec::new();
        let memory = heap.store_contents(&mut head).expect("it has a range");
        let mut expected = head.clone();
        memory.append_to(&mut expected);
        expected.extend_from_slice(&add(0, &expected).to_le_bytes());
        let path = std::env::temp_dir().join(format!("esl-fork-{}", std::process::id()));
        let mut file =
            File::options().read(true).write(true).create_new(true).open(&path).expect("it is new");
        std::fs::remove_file(&path).expect("it is there");
        let fork =
            Fork::write(file.as_raw_fd(), ForkContents { head: &head, memory: &memory, add_to_sum: add });
        let fork = fork.expect("the system makes one");
        for number in 0..100_000 {
            heap.cons(Value::index(number), list).expect("there is room");
        }
        fork.wait().expect("there is room on the disk");
        let mut written = Vec::new();
        file.rewind().and_then(|()| file.read_to_end(&mut written)).expect("it can be read");
        assert!(written == expected);
        // A disk without room.
        let full = File::options().write(true).open("/dev/full").expect("Linux has it");
        let memory = heap.store_contents(&mut head).expect("it has a range");
        let fork =
            Fork::write(full.as_raw_fd(), ForkContents { head: &head, memory: &memory, add_to_sum: add });
        let error = fork.and_then(Fork::wait).expect_err("there is no room");
        assert_eq!(error.kind(), ErrorKind::StorageFull);
    }
}
