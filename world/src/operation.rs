//! Operations as futures on the event loop.

use std::future::Future;
use std::pin::Pin;
use std::task::{Context, Poll, ready};

use esl_bytecode::datum::Datum;
use esl_host::{HostFailure, HostOperation};
use esl_vm::embed::{HostFunction, Need};
use esl_vm::vm::Vm;
use tokio::sync::oneshot;

use crate::data::{CallArguments, failure};
use crate::event_loop::{self, NoEventLoop, Stoppable};

/// What an operation comes to.
pub(crate) type Completion = Result<Vec<Datum>, HostFailure>;

/// Told when the program has cancelled an operation.
pub(crate) struct Cancelled(oneshot::Receiver<()>);

impl Cancelled {
    /// Waits until the operation is cancelled: for ever, if that does not happen.
    pub(crate) async fn wait(&mut self) {
        if (&mut self.0).await.is_err() {
            // Nobody can cancel it any more.
            std::future::pending::<()>().await;
        }
    }
}

/// A future of an operation.
pub(crate) type OperationFuture = Pin<Box<dyn Future<Output = Completion> + Send>>;

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
        // What the future holds is let go before the program hears that it is over.
        self.future = None;
        match (self.operation.take(), answer) {
            (Some(operation), Ok(values)) => operation.complete(values),
            (Some(operation), Err(failure)) => operation.fail(failure),
            (None, _) => {}
        }
    }

    fn cancel(&mut self) {
        self.end(Err(failure("CANCELLED", "")));
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
    /// Told when the operation is cancelled, unless the future sees to that itself.
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
            // Nobody can cancel it any more.
            Some(Poll::Ready(Err(_))) => self.cancelled = None,
            _ => {}
        }
        Pin::new(&mut self.begun).poll(context)
    }
}

/// Gives a machine an operation. A call that is left drops the future, and is over then.
pub(crate) fn define<F, R>(machine: &mut Vm, name: &str, needs: &[Need], mut function: F)
where
    F: FnMut(CallArguments) -> R + Send + 'static,
    R: Future<Output = Completion> + Send + 'static,
{
    add(machine, name, needs, move |mut operation| {
        let cancelled = Some(listen(&operation));
        let future = Box::pin(function(CallArguments(operation.take_arguments())));
        event_loop::spawn(UnderWay { begun: BegunOperation::new(future, operation), cancelled })
    });
}

/// As [`define`], of an operation that is often over at once, and no part of which the system may delay. It
/// is begun by the thread of the machine, and goes on in the one that has what it waits for, so that neither
/// takes a way through another thread.
pub(crate) fn define_ready<F>(machine: &mut Vm, name: &str, needs: &[Need], mut function: F)
where
    F: FnMut(CallArguments) -> OperationFuture + Send + 'static,
{
    add(machine, name, needs, move |mut operation| {
        let future = function(CallArguments(operation.take_arguments()));
        event_loop::begin(BegunOperation::new(future, operation))
    });
}

/// Gives a machine an operation that itself sees to its end when it is cancelled.
pub(crate) fn define_with_end<F, R>(machine: &mut Vm, name: &str, needs: &[Need], mut function: F)
where
    F: FnMut(CallArguments, Cancelled) -> R + Send + 'static,
    R: Future<Output = Completion> + Send + 'static,
{
    add(machine, name, needs, move |mut operation| {
        let cancelled = Cancelled(listen(&operation));
        let future = Box::pin(function(CallArguments(operation.take_arguments()), cancelled));
        event_loop::spawn(BegunOperation::new(future, operation))
    });
}

/// Returns what is told when the operation is cancelled.
fn listen(operation: &HostOperation) -> oneshot::Receiver<()> {
    let (cancel, cancelled) = oneshot::channel();
    operation.on_cancel(move || _ = cancel.send(()));
    cancelled
}

fn add<F>(machine: &mut Vm, name: &str, needs: &[Need], mut begin: F)
where
    F: FnMut(HostOperation) -> Result<(), NoEventLoop> + Send + 'static,
{
    // Without the event loop the operation is dropped, which is how the program hears of it.
    let begin = move |operation: HostOperation| _ = begin(operation);
    machine.add_guarded_function(name, HostFunction::Operation(Box::new(begin)), needs);
}
