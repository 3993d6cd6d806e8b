//! Futures of operations: running them on the embedder's executor, or on a thread of the engine's own.

use std::future::Future;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::pin::Pin;
use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll, Wake, Waker};

use super::call::Failure;
use super::operation::Operation;
use crate::data::Data;

/// The future of an operation, which an executor is to run to its end.
pub struct HostFuture(Pin<Box<dyn Future<Output = ()> + Send>>);

/// Runs futures to their ends, somewhere: on tokio, for one, by `move |job| drop(handle.spawn(job))`.
pub type Executor = Arc<dyn Fn(HostFuture) + Send + Sync>;

impl HostFuture {
    /// Polls the future where the caller is, and returns it unless it has ended. An executor that does so
    /// first hands on only what has to wait: an operation that is ready at once then costs no change of
    /// threads. Meanwhile the engine waits, and no task runs.
    ///
    /// ```
    /// use esl::Engine;
    ///
    /// let runtime = tokio::runtime::Builder::new_current_thread().build()?;
    /// let mut engine = Engine::new()?.with_executor(|job| {
    ///     if let Some(job) = job.poll_once() {
    ///         tokio::spawn(job);
    ///     }
    /// });
    /// engine.define_async("AREA", "(width height)", "Measures.", |call| async move {
    ///     Ok(call.get::<f64>("width")? * call.get::<f64>("height")?)
    /// })?;
    /// let area = engine.begin("(area 2 3)");
    /// runtime.block_on(engine.run_async());
    /// assert_eq!(area.wait()?.as_float(), Some(6.0));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use = "a future that is dropped has its operation fail"]
    pub fn poll_once(mut self) -> Option<HostFuture> {
        let polled = self.0.as_mut().poll(&mut Context::from_waker(Waker::noop()));
        polled.is_pending().then_some(self)
    }
}

impl Future for HostFuture {
    type Output = ();

    fn poll(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<()> {
        self.0.as_mut().poll(context)
    }
}

/// The future of an operation: ends with the future of its values, or when the operation is cancelled.
struct RunningFuture<F> {
    /// Dropped when it has ended, and when it is cancelled.
    future: Option<Pin<Box<F>>>,
    operation: Option<Operation>,
    /// Waker of the executor, for when the operation is cancelled.
    waker: Arc<Mutex<Option<Waker>>>,
}

impl<F, V> Future for RunningFuture<F>
where
    F: Future<Output = Result<V, Failure>>,
    V: Into<Data>,
{
    type Output = ();

    fn poll(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<()> {
        *self.waker.lock().unwrap_or_else(PoisonError::into_inner) = Some(context.waker().clone());
        if self.operation.as_ref().is_none_or(Operation::is_cancelled) {
            // The future is dropped before the program learns that it has stopped.
            self.future = None;
            self.operation = None;
            return Poll::Ready(());
        }
        let Some(future) = &mut self.future else { return Poll::Ready(()) };
        let polled = catch_unwind(AssertUnwindSafe(|| future.as_mut().poll(context)));
        let result = match polled {
            Ok(Poll::Pending) => return Poll::Pending,
            Ok(Poll::Ready(result)) => result.map(Into::into),
            Err(panic) => Err(Failure::of_panic(&*panic)),
        };
        self.future = None;
        if let Some(operation) = self.operation.take() {
            match result {
                Ok(value) => operation.complete::<Data>(value),
                Err(failure) => operation.fail(failure),
            }
        }
        Poll::Ready(())
    }
}

/// Returns the job that ends `operation` as `future` does, and drops the future when the operation is
/// cancelled.
pub(super) fn job<F, V>(operation: Operation, future: F) -> HostFuture
where
    F: Future<Output = Result<V, Failure>> + Send + 'static,
    V: Into<Data>,
{
    let waker: Arc<Mutex<Option<Waker>>> = Arc::default();
    let shared = waker.clone();
    operation.on_cancel(move || {
        if let Some(waker) = shared.lock().unwrap_or_else(PoisonError::into_inner).take() {
            waker.wake();
        }
    });
    HostFuture(Box::pin(RunningFuture { future: Some(Box::pin(future)), operation: Some(operation), waker }))
}

/// A job on the engine's own thread; waking it puts it into the queue of the thread again.
struct QueuedJob {
    job: Mutex<Option<HostFuture>>,
    queue: Sender<Arc<QueuedJob>>,
}

impl Wake for QueuedJob {
    fn wake(self: Arc<QueuedJob>) {
        let queue = self.queue.clone();
        // When the thread has ended, so has the job.
        drop(queue.send(self));
    }
}

/// Returns an executor that runs all its jobs on one thread, which is started with the first.
pub(super) fn thread() -> Executor {
    let running: Mutex<Option<Sender<Arc<QueuedJob>>>> = Mutex::default();
    Arc::new(move |job| {
        let mut running = running.lock().unwrap_or_else(PoisonError::into_inner);
        let queue = running.get_or_insert_with(start_thread).clone();
        let queued = Arc::new(QueuedJob { job: Mutex::new(Some(job)), queue: queue.clone() });
        // Without a thread the job is dropped, and its operation fails.
        drop(queue.send(queued));
    })
}

/// Starts the thread, and returns its queue.
fn start_thread() -> Sender<Arc<QueuedJob>> {
    let (queue, queued) = channel::<Arc<QueuedJob>>();
    let work = move || {
        while let Ok(next) = queued.recv() {
            let waker = Waker::from(next.clone());
            let mut place = next.job.lock().unwrap_or_else(PoisonError::into_inner);
            let Some(job) = place.as_mut() else { continue };
            if Pin::new(job).poll(&mut Context::from_waker(&waker)).is_ready() {
                *place = None;
            }
        }
    };
    drop(std::thread::Builder::new().name("esl-operations".into()).spawn(work));
    queue
}
