//! Ctrl-C: the first one asks the machine to stop, the second one ends the process.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use esl_vm::host::Waker;

use super::{INTERRUPTED, complain};

/// Has Ctrl-C set the flag and wake the machine's host. A second one, before the machine has cleared the
/// flag, ends the process.
pub fn interrupt_on_signal(flag: Arc<AtomicBool>, waker: Waker) {
    on_signal(move || {
        if flag.swap(true, Ordering::Relaxed) {
            std::process::exit(INTERRUPTED.into());
        }
        waker.wake();
    });
}

/// Has the first Ctrl-C set the flag and wake the machine's host, and the second one end the process.
pub fn end_on_signal(flag: Arc<AtomicBool>, waker: Waker) {
    let was_asked = AtomicBool::new(false);
    on_signal(move || {
        if was_asked.swap(true, Ordering::Relaxed) {
            complain("interrupted");
            std::process::exit(INTERRUPTED.into());
        }
        flag.store(true, Ordering::Relaxed);
        waker.wake();
    });
}

fn on_signal(handler: impl FnMut() + Send + 'static) {
    // Without a handler Ctrl-C ends the process at once, which is the next best thing.
    drop(ctrlc::set_handler(handler));
}
