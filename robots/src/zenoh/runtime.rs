//! The threads on which Zenoh is called: its own code must not run on the event loop, whose kind it refuses,
//! nor on the thread of a machine, which it could delay.

use std::future::Future;
use std::io;
use std::pin::Pin;
use std::sync::OnceLock;
use std::task::{Context, Poll};

use esl_host::HostFailure;
use tokio::runtime::{Builder, Runtime};
use tokio::task::JoinHandle;

use super::zenoh_failure;

/// The runtime of futures of Zenoh, or the reason why there is none.
static RUNTIME: OnceLock<io::Result<Runtime>> = OnceLock::new();

fn runtime() -> Result<&'static Runtime, HostFailure> {
    let start = || Builder::new_multi_thread().worker_threads(1).thread_name("zenoh").enable_all().build();
    RUNTIME.get_or_init(start).as_ref().map_err(zenoh_failure)
}

/// Runs a future of Zenoh. If the returned future is dropped, it is dropped too.
///
/// # Errors
/// `:zenoh-error`, if the system gives no thread for it, and if it panics.
pub(crate) async fn on_zenoh<T: Send + 'static>(
    future: impl Future<Output = T> + Send + 'static,
) -> Result<T, HostFailure> {
    ZenohFuture(runtime()?.spawn(future)).await
}

/// Runs a future of Zenoh that no operation waits for.
pub(crate) fn in_background(future: impl Future<Output = ()> + Send + 'static) {
    if let Ok(runtime) = runtime() {
        runtime.spawn(future);
    }
}

/// A future under way.
struct ZenohFuture<T>(JoinHandle<T>);

impl<T> Future for ZenohFuture<T> {
    type Output = Result<T, HostFailure>;

    fn poll(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Self::Output> {
        Pin::new(&mut self.0).poll(context).map_err(zenoh_failure)
    }
}

impl<T> Drop for ZenohFuture<T> {
    fn drop(&mut self) {
        self.0.abort();
    }
}
