//! The file descriptor that becomes readable when an engine has something to do.

use std::io;
use std::os::fd::{AsRawFd, OwnedFd, RawFd};
use std::sync::Arc;
use std::task::{Wake, Waker};

use rustix::event::{EventfdFlags, eventfd};

/// A counter of the system, which a waker raises.
pub(crate) struct Wakeup {
    counter: Arc<Counter>,
    waker: Waker,
}

struct Counter(OwnedFd);

impl Wake for Counter {
    fn wake(self: Arc<Counter>) {
        self.wake_by_ref();
    }

    fn wake_by_ref(self: &Arc<Counter>) {
        // A counter that is full is readable already.
        _ = rustix::io::write(&self.0, &1_u64.to_ne_bytes());
    }
}

impl Wakeup {
    pub(crate) fn new() -> io::Result<Wakeup> {
        let counter = Arc::new(Counter(eventfd(0, EventfdFlags::NONBLOCK | EventfdFlags::CLOEXEC)?));
        Ok(Wakeup { waker: Waker::from(counter.clone()), counter })
    }

    pub(crate) fn waker(&self) -> &Waker {
        &self.waker
    }

    pub(crate) fn descriptor(&self) -> RawFd {
        self.counter.0.as_raw_fd()
    }

    /// Makes the descriptor unreadable.
    pub(crate) fn clear(&self) {
        // One that is at zero is not readable.
        _ = rustix::io::read(&self.counter.0, &mut [0; 8]);
    }
}
