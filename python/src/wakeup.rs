//! Waking the thread or the event loop that drives an engine, when something has come for it.

use std::io::{self, Read, Write};
use std::os::fd::AsRawFd;
use std::os::unix::net::UnixStream;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::task::{Wake, Waker};
use std::time::Duration;

/// A bell that wakes the thread that drives an engine.
#[derive(Default)]
pub(crate) struct Bell {
    is_rung: Mutex<bool>,
    rung: Condvar,
}

impl Bell {
    /// Waits until the bell rings, but not longer than for a time.
    pub(crate) fn wait(&self, time: Duration) {
        let is_rung = self.is_rung.lock().unwrap_or_else(PoisonError::into_inner);
        let waited = self.rung.wait_timeout_while(is_rung, time, |is_rung| !*is_rung);
        *waited.unwrap_or_else(PoisonError::into_inner).0 = false;
    }
}

impl Wake for Bell {
    fn wake(self: Arc<Bell>) {
        *self.is_rung.lock().unwrap_or_else(PoisonError::into_inner) = true;
        self.rung.notify_all();
    }
}

/// A pair of sockets of which one becomes readable when the engine has something to do, so that an event loop
/// of Python waits for it. A function of Python would have to wait for the interpreter, under a lock of the
/// machine.
pub(crate) struct Wakeup {
    reader: UnixStream,
    writer: Arc<WakeupWriter>,
}

struct WakeupWriter {
    stream: UnixStream,
    /// Whether something was written since the reader was emptied. Set after the write, so that what was
    /// written is found by the next look at the latest.
    is_written: AtomicBool,
}

impl Wake for WakeupWriter {
    fn wake(self: Arc<WakeupWriter>) {
        // A socket that is full is readable already.
        _ = (&self.stream).write(&[1]);
        self.is_written.store(true, Ordering::Release);
    }
}

impl Wakeup {
    pub(crate) fn new() -> io::Result<Wakeup> {
        let (reader, writer) = UnixStream::pair()?;
        reader.set_nonblocking(true)?;
        writer.set_nonblocking(true)?;
        let writer = Arc::new(WakeupWriter { stream: writer, is_written: AtomicBool::new(false) });
        Ok(Wakeup { reader, writer })
    }

    /// Returns the descriptor of the reader.
    pub(crate) fn descriptor(&self) -> i32 {
        self.reader.as_raw_fd()
    }

    /// Returns the waker that makes the reader readable.
    pub(crate) fn waker(&self) -> Waker {
        Waker::from(self.writer.clone())
    }

    /// Makes the reader unreadable, if it is readable.
    pub(crate) fn empty(&self) {
        if self.writer.is_written.swap(false, Ordering::Acquire) {
            let mut bytes = [0; 64];
            while matches!((&self.reader).read(&mut bytes), Ok(count) if count == bytes.len()) {}
        }
    }
}
