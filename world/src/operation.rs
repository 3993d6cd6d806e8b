//! Operations as futures on the event loop.

use std::future::Future;
use std::pin::Pin;
use std::task::{Context, Poll, ready};

use esl_bytecode::datum::Datum;
use esl_vm::embed::{HostFunction, Need};
use esl_vm::host::{HostFailure, HostOperation};
use esl_vm::vm::Vm;
use tokio::sync::oneshot;

use crate::data::{CallArguments, failure};
use crate::event_loop;

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

/// An operation under way. There may be very many, so it is no larger than it has to be.
struct UnderWay {
    /// Dropped when it is over, and when the operation is cancelled.
    future: Option<OperationFuture>,
    operation: Option<HostOperation>,
    /// Told when the operation is cancelled, unless the future sees to that itself.
    cancelled: Option<oneshot::Receiver<()>>,
}

impl Future for UnderWay {
    type Output = ();

    fn poll(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<()> {
        let cancelled = self.cancelled.as_mut().map(|cancelled| Pin::new(cancelled).poll(context));
        let answer = match cancelled {
            Some(Poll::Ready(Ok(()))) => Err(failure("CANCELLED", "")),
            told => {
                if told.is_some_and(|told| told.is_ready()) {
                    // Nobody can cancel it any more.
                    self.cancelled = None;
                }
                let Some(future) = &mut self.future else { return Poll::Ready(()) };
                ready!(future.as_mut().poll(context))
            }
        };
        // What the future holds is let go before the program hears that it is over.
        self.future = None;
        match (self.operation.take(), answer) {
            (Some(operation), Ok(values)) => operation.complete(values),
            (Some(operation), Err(failure)) => operation.fail(failure),
            (None, _) => {}
        }
        Poll::Ready(())
    }
}

/// Gives a machine an operation. A call that is left drops the future, and is over then.
pub(crate) fn define<F, R>(machine: &mut Vm, name: &str, needs: &[Need], mut function: F)
where
    F: FnMut(CallArguments) -> R + Send + 'static,
    R: Future<Output = Completion> + Send + 'static,
{
    add(machine, name, needs, move |operation| {
        let (cancelled, arguments) = (listen(operation), arguments_of(operation));
        let future: OperationFuture = Box::pin(function(arguments));
        (future, Some(cancelled), event_loop::spawn)
    });
}

/// As [`define`], of an operation that is often over at once, and no part of which the system may delay. It
/// is begun by the thread of the machine, so that what is there takes no way through another thread.
pub(crate) fn define_ready<F>(machine: &mut Vm, name: &str, needs: &[Need], mut function: F)
where
    F: FnMut(CallArguments) -> OperationFuture + Send + 'static,
{
    add(machine, name, needs, move |operation| {
        (function(arguments_of(operation)), Some(listen(operation)), event_loop::begin)
    });
}

/// Gives a machine an operation that itself sees to its end when it is cancelled.
pub(crate) fn define_with_end<F, R>(machine: &mut Vm, name: &str, needs: &[Need], mut function: F)
where
    F: FnMut(CallArguments, Cancelled) -> R + Send + 'static,
    R: Future<Output = Completion> + Send + 'static,
{
    add(machine, name, needs, move |operation| {
        let (cancelled, arguments) = (listen(operation), arguments_of(operation));
        let future: OperationFuture = Box::pin(function(arguments, Cancelled(cancelled)));
        (future, None, event_loop::spawn)
    });
}

fn arguments_of(operation: &HostOperation) -> CallArguments {
    CallArguments(operation.arguments().to_vec())
}

/// Returns what is told when the operation is cancelled.
fn listen(operation: &HostOperation) -> oneshot::Receiver<()> {
    let (cancel, cancelled) = oneshot::channel();
    operation.on_cancel(move || _ = cancel.send(()));
    cancelled
}

/// How the future of an operation is run.
type OperationBody = fn(UnderWay) -> Result<(), String>;

fn add<F>(machine: &mut Vm, name: &str, needs: &[Need], mut function: F)
where
    F: FnMut(&HostOperation) -> (OperationFuture, Option<oneshot::Receiver<()>>, OperationBody)
        + Send
        + 'static,
{
    let begin = move |operation: HostOperation| {
        let (future, cancelled, run) = function(&operation);
        // Without the event loop the operation is dropped, which is how the program hears of it.
        drop(run(UnderWay { future: Some(future), operation: Some(operation), cancelled }));
    };
    machine.add_guarded_function(name, HostFunction::Operation(Box::new(begin)), needs);
}
