//! The event loop: one thread that does what all machines of the process ask of the system.

use std::cell::Cell;
use std::fmt;
use std::future::Future;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::task::{Context, Poll, Wake, Waker};

use tokio::runtime::{Builder, Handle};

/// Its handle, or the reason why there is none.
static LOOP: OnceLock<io::Result<Handle>> = OnceLock::new();

/// The system gave no thread or no descriptors for the event loop, which is started once in a process.
#[derive(Clone, Copy, Debug)]
pub struct NoEventLoop(&'static io::Error);

impl fmt::Display for NoEventLoop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl std::error::Error for NoEventLoop {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        Some(self.0)
    }
}

/// Returns the handle of the event loop, which is started by the first call.
fn handle() -> Result<&'static Handle, NoEventLoop> {
    LOOP.get_or_init(start).as_ref().map_err(NoEventLoop)
}

/// Runs a future on the event loop, which is started with the first.
///
/// # Errors
/// The reason, if the system gives no thread or no descriptors for it.
pub fn spawn(future: impl Future<Output = ()> + Send + 'static) -> Result<(), NoEventLoop> {
    handle()?.spawn(future);
    Ok(())
}

/// A future that waits only for others to wake it, and that can be stopped before its end.
pub(crate) trait Stoppable: Future<Output = ()> + Send + Unpin + 'static {
    /// Has `stop` called when it is to be stopped.
    fn listen(&self, stop: impl FnOnce() + Send + 'static);

    /// Ends it before its time.
    fn stop(self);
}

/// Begins a future here, if there is an event loop. Later it goes on in the thread that wakes it, mostly
/// that of the event loop: it is not a task of that, which would be larger, and would have to be told each
/// time. It is dropped if it panics.
///
/// # Errors
/// As [`spawn`].
pub(crate) fn begin<F: Stoppable>(future: F) -> Result<(), NoEventLoop> {
    let handle = handle()?;
    let begun = Arc::new(BegunFuture(Mutex::new(FutureStage::RUNS)));
    begun.run(handle, future, true);
    Ok(())
}

/// Polls in a row of a future that wakes itself, before others have their turn.
const POLLS: usize = 8;

thread_local! {
    /// Whether this thread polls such a future. Another one that is woken meanwhile goes on later, so that
    /// there is no poll within a poll.
    static POLLS_NOW: Cell<bool> = const { Cell::new(false) };
}

/// A future that was begun.
struct BegunFuture<F>(Mutex<FutureStage<F>>);

/// The stage of such a future.
enum FutureStage<F> {
    /// It is being polled. Meanwhile it was woken, and it was told to stop, or not.
    Runs { is_woken: bool, is_stopped: bool },
    /// It waits to be woken.
    Waits(F),
    /// It is over.
    Gone,
}

impl<F> FutureStage<F> {
    const RUNS: FutureStage<F> = FutureStage::Runs { is_woken: false, is_stopped: false };
}

impl<F> BegunFuture<F> {
    fn lock(&self) -> MutexGuard<'_, FutureStage<F>> {
        // Nothing runs under the lock that could leave the stage half changed.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<F: Stoppable> BegunFuture<F> {
    /// Polls the future, whose stage is that it runs, until it waits or is over.
    fn run(self: &Arc<Self>, handle: &Handle, mut future: F, mut is_new: bool) {
        let waker = Waker::from(self.clone());
        let mut polls = 0;
        loop {
            polls += 1;
            let polled = {
                let _inside = handle.enter();
                let before = POLLS_NOW.replace(true);
                let poll = || Pin::new(&mut future).poll(&mut Context::from_waker(&waker));
                let polled = catch_unwind(AssertUnwindSafe(poll));
                POLLS_NOW.set(before);
                polled
            };
            if !matches!(polled, Ok(Poll::Pending)) {
                *self.lock() = FutureStage::Gone;
                return;
            }
            if std::mem::take(&mut is_new) {
                let begun = Arc::downgrade(self);
                future.listen(move || _ = begun.upgrade().map(|begun| begun.stop()));
            }
            let mut stage = self.lock();
            match &*stage {
                FutureStage::Runs { is_stopped: true, .. } => {
                    *stage = FutureStage::Gone;
                    drop(stage);
                    return future.stop();
                }
                FutureStage::Runs { is_woken: true, .. } if polls < POLLS => *stage = FutureStage::RUNS,
                FutureStage::Runs { is_woken: true, .. } => {
                    *stage = FutureStage::Waits(future);
                    drop(stage);
                    return self.wake_later(handle);
                }
                _ => {
                    *stage = FutureStage::Waits(future);
                    return;
                }
            }
        }
    }

    /// Has it woken again, by the event loop.
    fn wake_later(self: &Arc<Self>, handle: &Handle) {
        let begun = self.clone();
        handle.spawn(async move { begun.wake() });
    }

    /// Stops the future, unless it is over.
    fn stop(&self) {
        let mut stage = self.lock();
        match &mut *stage {
            FutureStage::Runs { is_stopped, .. } => *is_stopped = true,
            FutureStage::Waits(_) => {
                let before = std::mem::replace(&mut *stage, FutureStage::Gone);
                drop(stage);
                if let FutureStage::Waits(future) = before {
                    future.stop();
                }
            }
            FutureStage::Gone => {}
        }
    }
}

impl<F: Stoppable> Wake for BegunFuture<F> {
    fn wake(self: Arc<Self>) {
        // There is an event loop, since the future was begun.
        let Some(Ok(handle)) = LOOP.get() else { return };
        let mut stage = self.lock();
        match &mut *stage {
            FutureStage::Runs { is_woken, .. } => *is_woken = true,
            FutureStage::Waits(_) if POLLS_NOW.get() => {
                drop(stage);
                self.wake_later(handle);
            }
            FutureStage::Waits(_) => {
                let before = std::mem::replace(&mut *stage, FutureStage::RUNS);
                drop(stage);
                if let FutureStage::Waits(future) = before {
                    self.run(handle, future, false);
                }
            }
            FutureStage::Gone => {}
        }
    }
}

fn start() -> io::Result<Handle> {
    let runtime = Builder::new_current_thread().enable_all().build()?;
    let handle = runtime.handle().clone();
    let run = move || {
        esl_vm::realtime::join();
        runtime.block_on(std::future::pending::<()>());
    };
    std::thread::Builder::new().name("world".into()).spawn(run)?;
    Ok(handle)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc::{Receiver, Sender, channel};
    use std::time::Duration;

    /// Stops a future.
    type Stop = Box<dyn FnOnce() + Send>;

    /// Says that it is dropped.
    struct Said(Sender<String>);

    impl Drop for Said {
        fn drop(&mut self) {
            // The receiver is gone after a failure.
            drop(self.0.send("dropped".into()));
        }
    }

    /// A future that calls `wait` at each poll, until that returns true. Says in which thread it is over,
    /// when it is stopped, and when it is dropped.
    struct Waiting<W> {
        wait: W,
        said: Said,
        keep_stop: Sender<Stop>,
    }

    impl<W: FnMut(&Waker) -> bool + Unpin> Future for Waiting<W> {
        type Output = ();

        fn poll(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<()> {
            if !(self.wait)(context.waker()) {
                return Poll::Pending;
            }
            let name = std::thread::current().name().unwrap_or_default().to_owned();
            self.said.0.send(name).expect("the test listens");
            Poll::Ready(())
        }
    }

    impl<W: FnMut(&Waker) -> bool + Send + Unpin + 'static> Stoppable for Waiting<W> {
        fn listen(&self, stop: impl FnOnce() + Send + 'static) {
            // Some tests have no use for it.
            drop(self.keep_stop.send(Box::new(stop)));
        }

        fn stop(self) {
            self.said.0.send("stopped".into()).expect("the test listens");
        }
    }

    /// Begins such a future. Returns what it says, and what stops it.
    fn begun_with(
        wait: impl FnMut(&Waker) -> bool + Send + Unpin + 'static,
    ) -> (Receiver<String>, Receiver<Stop>) {
        let ((say, said), (keep_stop, stop)) = (channel(), channel());
        begin(Waiting { wait, said: Said(say), keep_stop }).expect("there is an event loop");
        (said, stop)
    }

    /// Begins one that is over at its second poll.
    fn begun(mut wait: impl FnMut(&Waker) + Send + Unpin + 'static) -> Receiver<String> {
        let mut polls = 0;
        let wait = move |waker: &Waker| {
            polls += 1;
            if polls == 1 {
                wait(waker);
            }
            polls > 1
        };
        begun_with(wait).0
    }

    fn heard(said: &Receiver<String>) -> Option<String> {
        said.recv_timeout(Duration::from_secs(60)).ok()
    }

    #[test]
    fn what_was_begun_goes_on_where_it_is_woken() {
        let (keep, kept) = channel();
        let said = begun(move |waker| keep.send(waker.clone()).expect("the test listens"));
        assert!(said.try_recv().is_err(), "it waits");
        let waker = kept.recv().expect("it was polled");
        let woken = waker.clone();
        let other = std::thread::Builder::new().name("other".into());
        let other = other.spawn(move || woken.wake()).expect("there is a thread");
        other.join().expect("it does not panic");
        // Later ones have no effect.
        waker.wake();
        assert_eq!((heard(&said).as_deref(), heard(&said).as_deref()), (Some("other"), Some("dropped")));
        // A future that wakes itself goes on at once, unless it does so for ever.
        let here = std::thread::current().name().unwrap_or_default().to_owned();
        let said = begun(Waker::wake_by_ref);
        assert_eq!((heard(&said), heard(&said).as_deref()), (Some(here), Some("dropped")));
        let mut polls = 0;
        let (said, _) = begun_with(move |waker| {
            polls += 1;
            waker.wake_by_ref();
            polls > 3 * POLLS
        });
        assert_eq!((heard(&said).as_deref(), heard(&said).as_deref()), (Some("world"), Some("dropped")));
    }

    #[test]
    fn what_is_woken_within_a_poll_goes_on_later() {
        let (keep, kept) = channel();
        let inner = begun(move |waker| keep.send(waker.clone()).expect("the test listens"));
        let waker = kept.recv().expect("it was polled");
        let (look, looked) = channel();
        let outer = begun_with(move |_| {
            waker.wake_by_ref();
            look.send(()).expect("the test listens");
            true
        });
        looked.recv().expect("it was polled");
        assert_eq!(heard(&outer.0).as_deref(), std::thread::current().name());
        assert_eq!(heard(&inner).as_deref(), Some("world"));
    }

    #[test]
    fn what_is_stopped_ends_once_whether_it_waits_or_runs() {
        let (keep, kept) = channel();
        let (said, stop) = begun_with(move |waker| {
            keep.send(waker.clone()).expect("the test listens");
            false
        });
        let waker = kept.recv().expect("it was polled");
        stop.recv().expect("it is given")();
        assert_eq!((heard(&said).as_deref(), heard(&said).as_deref()), (Some("stopped"), Some("dropped")));
        waker.wake();
        assert!(said.recv_timeout(Duration::from_millis(1)).is_err(), "nobody is there to say it");
        // Told while it runs, it stops instead of waiting.
        let ((give, given), mut polls) = (channel::<Stop>(), 0);
        let (keep, kept) = channel();
        let (said, stop) = begun_with(move |waker| {
            polls += 1;
            match polls {
                1 => keep.send(waker.clone()).expect("the test listens"),
                _ => given.recv().expect("the test gives it")(),
            }
            false
        });
        give.send(stop.recv().expect("it is given")).expect("it is taken");
        kept.recv().expect("it was polled").wake();
        assert_eq!((heard(&said).as_deref(), heard(&said).as_deref()), (Some("stopped"), Some("dropped")));
    }

    #[test]
    fn what_nobody_can_wake_and_what_panics_is_dropped() {
        for wait in [|_: &Waker| {}, |_: &Waker| panic!("it is wrong")] {
            assert_eq!(heard(&begun(wait)).as_deref(), Some("dropped"));
        }
    }
}
