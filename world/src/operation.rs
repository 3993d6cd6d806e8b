//! Operations as futures on the event loop.

use std::future::Future;
use std::pin::Pin;
use std::task::{Context, Poll, ready};

use esl_host::{ArgumentReader, Completion, FromCall, HostFailure, HostOperation, OperationFuture};
use tokio::sync::oneshot;

use crate::event_loop::{self, Stoppable};

/// Tells a function that the program has cancelled its operation.
pub struct Cancelled(oneshot::Receiver<()>);

impl Cancelled {
    /// Waits until the operation is cancelled: for ever, if that does not happen.
    pub async fn wait(&mut self) {
        if (&mut self.0).await.is_err() {
            // It cannot be cancelled any more.
            std::future::pending::<()>().await;
        }
    }
}

/// For an operation that is begun by [`to_its_end`].
impl FromCall for Cancelled {
    const COUNT: usize = 0;

    fn from_call(call: &mut ArgumentReader<'_>) -> Result<Cancelled, HostFailure> {
        let (cancel, cancelled) = oneshot::channel();
        if let Some(operation) = call.operation() {
            operation.on_cancel(move || _ = cancel.send(()));
        }
        Ok(Cancelled(cancelled))
    }
}

/// Begins an operation as a task of the event loop. A call that is left drops the future, and is over then.
pub fn spawned(operation: HostOperation, future: OperationFuture) {
    let (cancel, cancelled) = oneshot::channel();
    operation.on_cancel(move || _ = cancel.send(()));
    let begun = BegunOperation::new(future, operation);
    // Without the event loop the operation is dropped, which is how the program hears of it.
    _ = event_loop::spawn(UnderWay { begun, cancelled: Some(cancelled) });
}

/// As [`spawned`], of an operation that is often over at once, and no part of which the system may delay. It
/// is begun by the thread of the machine, and goes on in the one that has what it waits for, so that neither
/// takes a way through another thread.
pub fn ready_soon(operation: HostOperation, future: OperationFuture) {
    // As above.
    _ = event_loop::begin(BegunOperation::new(future, operation));
}

/// Begins an operation that itself sees to its end when it is cancelled: its code takes [`Cancelled`].
pub fn to_its_end(operation: HostOperation, future: OperationFuture) {
    // As above.
    _ = event_loop::spawn(BegunOperation::new(future, operation));
}

/// An operation that was begun. There may be very many, so it is no larger than it has to be.
struct BegunOperation {
    /// Dropped when it is over, and when the operation is cancelled.
    future: Option<OperationFuture>,
    operation: Option<HostOperation>,
}

impl BegunOperation {
    fn new(future: OperationFuture, operation: HostOperation) -> BegunOperation {
        BegunOperation { future: Some(future), operation: Some(operation) }
    }

    fn end(&mut self, answer: Completion) {
        // The future is dropped before the program learns that it is over.
        self.future = None;
        match (self.operation.take(), answer) {
            (Some(operation), Ok(values)) => operation.complete(values),
            (Some(operation), Err(failure)) => operation.fail(failure),
            (None, _) => {}
        }
    }

    fn cancel(&mut self) {
        self.end(Err(HostFailure::new("CANCELLED", "")));
    }
}

impl Future for BegunOperation {
    type Output = ();

    fn poll(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<()> {
        if let Some(future) = &mut self.future {
            let answer = ready!(future.as_mut().poll(context));
            self.end(answer);
        }
        Poll::Ready(())
    }
}

impl Stoppable for BegunOperation {
    fn listen(&self, stop: impl FnOnce() + Send + 'static) {
        if let Some(operation) = &self.operation {
            operation.on_cancel(stop);
        }
    }

    fn stop(mut self) {
        self.cancel();
    }
}

/// An operation that is a task of the event loop.
struct UnderWay {
    begun: BegunOperation,
    /// Told when the operation is cancelled.
    cancelled: Option<oneshot::Receiver<()>>,
}

impl Future for UnderWay {
    type Output = ();

    fn poll(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<()> {
        match self.cancelled.as_mut().map(|cancelled| Pin::new(cancelled).poll(context)) {
            Some(Poll::Ready(Ok(()))) => {
                self.begun.cancel();
                return Poll::Ready(());
            }
            // It cannot be cancelled any more.
            Some(Poll::Ready(Err(_))) => self.cancelled = None,
            _ => {}
        }
        Pin::new(&mut self.begun).poll(context)
    }
}
