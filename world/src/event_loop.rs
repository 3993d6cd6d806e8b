//! The event loop: one thread that does what all machines of the process ask of the system.

use std::future::Future;
use std::sync::OnceLock;

use tokio::runtime::{Builder, Handle};

/// Its handle, or the reason why there is none.
static LOOP: OnceLock<Result<Handle, String>> = OnceLock::new();

/// Runs a future on the event loop, which is started with the first.
///
/// # Errors
/// The reason, if the system gives no thread or no descriptors for it.
pub(crate) fn spawn(future: impl Future<Output = ()> + Send + 'static) -> Result<(), String> {
    match LOOP.get_or_init(start) {
        Ok(handle) => {
            handle.spawn(future);
            Ok(())
        }
        Err(reason) => Err(reason.clone()),
    }
}

fn start() -> Result<Handle, String> {
    let runtime = Builder::new_current_thread().enable_all().build().map_err(|error| error.to_string())?;
    let handle = runtime.handle().clone();
    let run = move || runtime.block_on(std::future::pending::<()>());
    std::thread::Builder::new().name("world".into()).spawn(run).map_err(|error| error.to_string())?;
    Ok(handle)
}
