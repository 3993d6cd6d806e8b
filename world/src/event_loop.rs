//! The event loop: one thread that does what all machines of the process ask of the system.

use std::future::Future;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::pin::Pin;
use std::sync::OnceLock;
use std::task::{Context, Poll, Waker};

use tokio::runtime::{Builder, Handle};

/// Its handle, or the reason why there is none.
static LOOP: OnceLock<Result<Handle, String>> = OnceLock::new();

/// Runs a future on the event loop, which is started with the first.
///
/// # Errors
/// The reason, if the system gives no thread or no descriptors for it.
pub fn spawn(future: impl Future<Output = ()> + Send + 'static) -> Result<(), String> {
    match LOOP.get_or_init(start) {
        Ok(handle) => {
            handle.spawn(future);
            Ok(())
        }
        Err(reason) => Err(reason.clone()),
    }
}

/// Begins a future here, and runs the rest of it on the event loop, if there is any. So what is over at once
/// takes no way through another thread. The future must not wait but for others to wake it. If it panics, it
/// is dropped.
///
/// # Errors
/// As [`spawn`].
pub(crate) fn begin(mut future: impl Future<Output = ()> + Send + Unpin + 'static) -> Result<(), String> {
    let handle = LOOP.get_or_init(start).as_ref().map_err(String::clone)?;
    let first = {
        let _inside = handle.enter();
        // Whoever it waits for is told of the event loop when that polls it.
        let poll = || Pin::new(&mut future).poll(&mut Context::from_waker(Waker::noop()));
        catch_unwind(AssertUnwindSafe(poll))
    };
    if matches!(first, Ok(Poll::Pending)) {
        handle.spawn(future);
    }
    Ok(())
}

fn start() -> Result<Handle, String> {
    let runtime = Builder::new_current_thread().enable_all().build().map_err(|error| error.to_string())?;
    let handle = runtime.handle().clone();
    let run = move || runtime.block_on(std::future::pending::<()>());
    std::thread::Builder::new().name("world".into()).spawn(run).map_err(|error| error.to_string())?;
    Ok(handle)
}
