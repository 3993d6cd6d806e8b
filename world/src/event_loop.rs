//! The event loop: one thread that does what all machines of the process ask of the system.

use std::future::Future;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::task::{Context, Poll, Wake, Waker};

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
/// takes no way through another thread, and what waits takes none before it can go on: until then it is no
/// task of the event loop, which would be larger, and would have to be told. The future must not wait but for
/// others to wake it. If it panics, it is dropped.
///
/// # Errors
/// As [`spawn`].
pub(crate) fn begin<F>(mut future: F) -> Result<(), String>
where
    F: Future<Output = ()> + Send + Unpin + 'static,
{
    let handle = LOOP.get_or_init(start).as_ref().map_err(String::clone)?;
    let parked = Arc::new(ParkedFuture(Mutex::new(Parked::Begins)));
    let waker = Waker::from(parked.clone());
    let first = {
        let _inside = handle.enter();
        let poll = || Pin::new(&mut future).poll(&mut Context::from_waker(&waker));
        catch_unwind(AssertUnwindSafe(poll))
    };
    let mut state = parked.lock();
    let was_woken = matches!(*state, Parked::Woken);
    *state = match first {
        Ok(Poll::Pending) if was_woken => {
            handle.spawn(future);
            Parked::Gone
        }
        Ok(Poll::Pending) => Parked::Waits(future),
        Ok(Poll::Ready(())) | Err(_) => Parked::Gone,
    };
    Ok(())
}

/// A future that was begun by another thread and waits to be woken for the first time.
struct ParkedFuture<F>(Mutex<Parked<F>>);

/// What has become of such a future.
enum Parked<F> {
    /// It is polled for the first time.
    Begins,
    /// It was woken meanwhile.
    Woken,
    /// It waits.
    Waits(F),
    /// It is over, or runs on the event loop.
    Gone,
}

impl<F> ParkedFuture<F> {
    fn lock(&self) -> MutexGuard<'_, Parked<F>> {
        // Nothing runs under the lock that could leave the state half changed.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<F: Future<Output = ()> + Send + 'static> Wake for ParkedFuture<F> {
    fn wake(self: Arc<Self>) {
        let mut state = self.lock();
        let before = match &*state {
            Parked::Begins | Parked::Woken => std::mem::replace(&mut *state, Parked::Woken),
            Parked::Waits(_) | Parked::Gone => std::mem::replace(&mut *state, Parked::Gone),
        };
        drop(state);
        if let Parked::Waits(future) = before {
            // There is an event loop, since the future was begun. Without one it would be dropped.
            drop(spawn(future));
        }
    }
}

fn start() -> Result<Handle, String> {
    let runtime = Builder::new_current_thread().enable_all().build().map_err(|error| error.to_string())?;
    let handle = runtime.handle().clone();
    let run = move || runtime.block_on(std::future::pending::<()>());
    std::thread::Builder::new().name("world".into()).spawn(run).map_err(|error| error.to_string())?;
    Ok(handle)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::future::poll_fn;
    use std::sync::mpsc::{Receiver, Sender, channel};
    use std::time::Duration;

    /// Says that it is dropped.
    struct Said(Sender<String>);

    impl Drop for Said {
        fn drop(&mut self) {
            // Nobody listens after a failure.
            drop(self.0.send("dropped".into()));
        }
    }

    /// Begins a future that calls `wait` when it is polled first, and is over when it is polled again. Hears
    /// in which thread that is, and when it is dropped.
    fn begun(mut wait: impl FnMut(&Waker) + Send + Unpin + 'static) -> Receiver<String> {
        let (say, said) = channel();
        let said_at_end = Said(say);
        let mut polls = 0;
        let future = poll_fn(move |context| {
            polls += 1;
            if polls == 1 {
                wait(context.waker());
                return Poll::Pending;
            }
            let name = std::thread::current().name().unwrap_or_default().to_owned();
            said_at_end.0.send(name).expect("the test listens");
            Poll::Ready(())
        });
        begin(future).expect("there is an event loop");
        said
    }

    fn heard(said: &Receiver<String>) -> Option<String> {
        said.recv_timeout(Duration::from_secs(60)).ok()
    }

    #[test]
    fn what_was_begun_here_goes_on_elsewhere_when_it_is_woken() {
        let (keep, kept) = channel();
        let said = begun(move |waker| keep.send(waker.clone()).expect("the test listens"));
        assert!(said.try_recv().is_err(), "it waits");
        let waker = kept.recv().expect("it was polled");
        waker.wake_by_ref();
        // Later ones have no effect.
        waker.wake();
        assert_eq!((heard(&said).as_deref(), heard(&said).as_deref()), (Some("world"), Some("dropped")));
        let said = begun(Waker::wake_by_ref);
        assert_eq!((heard(&said).as_deref(), heard(&said).as_deref()), (Some("world"), Some("dropped")));
    }

    #[test]
    fn what_nobody_can_wake_and_what_panics_is_dropped() {
        for wait in [|_: &Waker| {}, |_: &Waker| panic!("it is wrong")] {
            assert_eq!(heard(&begun(wait)).as_deref(), Some("dropped"));
        }
    }
}
