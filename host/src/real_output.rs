//! Standard output and standard error of the process: whether a reader can delay them, and whether there is
//! room.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Sender, channel};

use super::{Inbox, Incoming, Output};

/// Bytes that a pipe has room for when it has any.
pub(super) const PIECE: usize = 4096;

/// The state of an output stream.
#[derive(Default)]
pub(super) struct OutputState {
    /// Whether a reader can delay it; unknown before the first write.
    is_delayed: Option<bool>,
    /// Asks the thread that waits for room, which is started when there is none for the first time.
    watcher: Option<Sender<()>>,
    /// Whether it was asked, and has not put its note into the inbox yet.
    is_watched: Arc<AtomicBool>,
}

/// Calls `function` with the descriptor of an output stream.
pub(super) fn with_descriptor<T>(
    output: Output,
    function: impl FnOnce(rustix::fd::BorrowedFd<'_>) -> T,
) -> T {
    use rustix::fd::AsFd;
    match output {
        Output::Standard => function(std::io::stdout().as_fd()),
        Output::Error => function(std::io::stderr().as_fd()),
    }
}

/// Waits until a write to an output stream would not wait, or for no time at all. Returns whether it would
/// not.
pub(super) fn await_room(output: Output, waits: bool) -> bool {
    use rustix::event::{PollFd, PollFlags, Timespec, poll};
    let none = Timespec { tv_sec: 0, tv_nsec: 0 };
    with_descriptor(output, |descriptor| {
        let mut asked = [PollFd::from_borrowed_fd(descriptor, PollFlags::OUT)];
        // An error of the stream shows in the write.
        !matches!(
            poll(&mut asked, if waits { None } else { Some(&none) }),
            Ok(0) | Err(rustix::io::Errno::INTR)
        )
    })
}

impl OutputState {
    /// Returns whether a reader of the stream can delay it.
    pub(super) fn is_delayed(&mut self, output: Output) -> bool {
        use rustix::fs::FileType;
        *self.is_delayed.get_or_insert_with(|| {
            let file_type = with_descriptor(output, |descriptor| rustix::fs::fstat(descriptor))
                .map_or(FileType::Unknown, |stat| FileType::from_raw_mode(stat.st_mode));
            matches!(file_type, FileType::Fifo | FileType::Socket | FileType::CharacterDevice)
        })
    }

    /// Notifies `inbox` when the stream has room. Returns false if that is impossible.
    pub(super) fn watch(&mut self, output: Output, inbox: &Inbox) -> bool {
        if self.is_watched.swap(true, Ordering::Relaxed) {
            return true;
        }
        if self.watcher.is_none() {
            let (ask, asked) = channel();
            let (is_watched, inbox) = (self.is_watched.clone(), inbox.clone());
            let run = move || {
                while asked.recv().is_ok() {
                    while !await_room(output, true) {}
                    is_watched.store(false, Ordering::Relaxed);
                    inbox.put(Incoming::Output);
                }
            };
            let spawned = std::thread::Builder::new().name("standard-output".into()).spawn(run);
            self.watcher = spawned.is_ok().then_some(ask);
        }
        let is_asked = self.watcher.as_ref().is_some_and(|watcher| watcher.send(()).is_ok());
        if !is_asked {
            self.is_watched.store(false, Ordering::Relaxed);
        }
        is_asked
    }
}
