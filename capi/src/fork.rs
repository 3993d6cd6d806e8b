//! Forks of the process: a child has the memory of its parent, and none of its threads.
//!
//! An engine needs threads, such as that of its event loop, so in the child an engine of the parent would
//! wait for them for ever. Each object that waits notes the [`Process`] in which it was made, and is refused
//! in another one.

use std::sync::Once;
use std::sync::atomic::{AtomicU32, Ordering};

use crate::failure::Fault;
use crate::status::esl_status::ESL_ENDED;

/// Forks between the process in which the library was first used and this one.
static FORKS: AtomicU32 = AtomicU32::new(0);

/// The process in which something was made.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) struct Process(u32);

impl Process {
    /// Returns the process that calls.
    pub(crate) fn this() -> Process {
        static WATCHED: Once = Once::new();
        WATCHED.call_once(|| {
            unsafe extern "C" fn in_the_child() {
                FORKS.fetch_add(1, Ordering::Relaxed);
            }
            // SAFETY: the function that the child calls does nothing but add to a number. Without memory for
            // its registration, forks are not noticed.
            unsafe { libc::pthread_atfork(None, None, Some(in_the_child)) };
        });
        Process(FORKS.load(Ordering::Relaxed))
    }

    /// Refuses a process other than this one.
    ///
    /// # Errors
    /// A fault.
    pub(crate) fn check(self) -> Result<(), Fault> {
        if self.is_this() {
            return Ok(());
        }
        Err(Fault::new(
            ESL_ENDED,
            "the process was forked after the engine was made, and its threads are those of the parent: make \
             an engine after the fork",
        ))
    }

    /// Returns whether this process is the same.
    pub(crate) fn is_this(self) -> bool {
        self.0 == FORKS.load(Ordering::Relaxed)
    }
}
