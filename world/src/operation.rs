//! Operations as futures on the event loop.

use std::future::Future;

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

/// Gives a machine an operation. A call that is left drops the future, and is over then.
pub(crate) fn define<F, R>(machine: &mut Vm, name: &str, needs: &[Need], function: F)
where
    F: FnMut(CallArguments) -> R + Send + 'static,
    R: Future<Output = Completion> + Send + 'static,
{
    define_cancellable(machine, name, needs, false, function);
}

/// As [`define`], of an operation that is often over at once, and no part of which the system may delay. It
/// is begun by the thread of the machine, so that what is there takes no way through another thread.
pub(crate) fn define_ready<F, R>(machine: &mut Vm, name: &str, needs: &[Need], function: F)
where
    F: FnMut(CallArguments) -> R + Send + 'static,
    R: Future<Output = Completion> + Send + 'static,
{
    define_cancellable(machine, name, needs, true, function);
}

fn define_cancellable<F, R>(machine: &mut Vm, name: &str, needs: &[Need], begins_here: bool, mut function: F)
where
    F: FnMut(CallArguments) -> R + Send + 'static,
    R: Future<Output = Completion> + Send + 'static,
{
    add(machine, name, needs, begins_here, move |arguments, mut cancelled| {
        let future = function(arguments);
        async move {
            tokio::select! {
                biased;
                () = cancelled.wait() => Err(failure("CANCELLED", "")),
                answer = future => answer,
            }
        }
    });
}

/// Gives a machine an operation that itself sees to its end when it is cancelled.
pub(crate) fn define_with_end<F, R>(machine: &mut Vm, name: &str, needs: &[Need], function: F)
where
    F: FnMut(CallArguments, Cancelled) -> R + Send + 'static,
    R: Future<Output = Completion> + Send + 'static,
{
    add(machine, name, needs, false, function);
}

fn add<F, R>(machine: &mut Vm, name: &str, needs: &[Need], begins_here: bool, mut function: F)
where
    F: FnMut(CallArguments, Cancelled) -> R + Send + 'static,
    R: Future<Output = Completion> + Send + 'static,
{
    let begin = move |operation: HostOperation| {
        let (cancel, cancelled) = oneshot::channel();
        operation.on_cancel(move || _ = cancel.send(()));
        let future = function(CallArguments(operation.arguments().to_vec()), Cancelled(cancelled));
        let run = async move {
            match future.await {
                Ok(values) => operation.complete(values),
                Err(failure) => operation.fail(failure),
            }
        };
        // Without the event loop the operation is dropped, which is how the program hears of it.
        drop(if begins_here { event_loop::begin(run) } else { event_loop::spawn(run) });
    };
    machine.add_guarded_function(name, HostFunction::Operation(Box::new(begin)), needs);
}
