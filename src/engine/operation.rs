//! Operations as the embedder's code holds them.

use std::sync::Arc;

use esl_bytecode::symbol::USER_PACKAGE;
use esl_host as host;

use super::call::{Call, Failure};
use crate::data::Data;

/// Something that the embedder's code does for a task of the program, which waits until it completes or
/// fails.
///
/// It can be sent to another thread, and may be completed at any time, also when its engine is gone, which
/// has no effect. One that is dropped has failed with the cause `:OPERATION-DROPPED`.
///
/// ```
/// use esl::Engine;
///
/// let mut engine = Engine::new()?;
/// engine.define_operation("ADD", "(a b)", "Adds elsewhere.", |operation| {
///     std::thread::spawn(move || {
///         let (a, b) = (operation.call().get::<i64>("a"), operation.call().get::<i64>("b"));
///         match (a, b) {
///             (Ok(a), Ok(b)) => operation.complete(a + b),
///             (Err(failure), _) | (_, Err(failure)) => operation.fail(failure),
///         }
///     });
/// })?;
/// let sums = "(task-net (one (add 1 2)) (two (add 3 4)))";
/// assert_eq!(engine.eval(&format!("(multiple-value-list {sums})"))?.to_string(), "(3 7)");
/// # Ok::<(), esl::Error>(())
/// ```
pub struct Operation {
    host: host::HostOperation,
    call: Call,
}

impl Operation {
    /// Returns the operation of a call; nothing, after failing it, if its arguments are nested too deeply.
    pub(super) fn new(host: host::HostOperation, names: Arc<[String]>) -> Option<Operation> {
        match Failure::of_arguments(host.arguments()) {
            Ok(arguments) => Some(Operation { host, call: Call { names, arguments } }),
            Err(failure) => {
                host.fail(failure.to_host());
                None
            }
        }
    }

    /// Returns the call that the operation is for.
    pub fn call(&self) -> &Call {
        &self.call
    }

    /// Returns the identity of the call in a durable run, the same in each process that performs it.
    pub fn action(&self) -> Option<host::ActionId> {
        self.host.action()
    }

    /// Returns its state, which outlives the process of a durable run.
    pub fn state(&self) -> host::OperationState {
        self.host.state()
    }

    /// Keeps bytes with the state of a durable run, in place of those before, and returns when they are as
    /// safe as the run demands. The next process begins an operation that has saved bytes again, whatever
    /// its effect is, and restores them there. Returns false if they cannot be kept: then the operation does
    /// not go on. Without a durable run it has no effect, and returns true.
    #[must_use = "bytes that are not safe may be missing in the next process"]
    pub fn save(&self, state: &[u8]) -> bool {
        self.host.save(state)
    }

    /// Returns the bytes that the operation has saved last, in this process or an earlier one.
    pub fn restore(&self) -> Option<Vec<u8>> {
        self.host.restore()
    }

    /// Ends the operation: this is the value of the call.
    pub fn complete<V: Into<Data>>(self, value: V) {
        self.complete_with(&[value.into()]);
    }

    /// Ends the operation: these are the values of the call.
    pub fn complete_with(self, values: &[Data]) {
        self.host.complete(values.iter().map(|value| value.to_datum(USER_PACKAGE)).collect());
    }

    /// Ends the operation: the call fails.
    pub fn fail(self, failure: impl Into<Failure>) {
        self.host.fail(failure.into().to_host());
    }

    /// Reports how far the operation is, for `operation-progress`.
    pub fn report_progress(&self, value: impl Into<Data>) {
        self.host.report_progress(vec![value.into().to_datum(USER_PACKAGE)]);
    }

    /// Has `function` called when the program leaves the call, or cancels the operation; at once if it has
    /// done so already. The program waits until the operation is completed, fails or is dropped, so that what
    /// is still moving is not commanded again; whatever end it has then counts as cancelled.
    ///
    /// The engine waits for the function, which should only pass the message on.
    pub fn on_cancel(&self, function: impl FnOnce() + Send + 'static) {
        self.host.on_cancel(function);
    }

    /// Has `function` called with true when the task that has begun the operation is suspended, and with
    /// false when it goes on; at once if it is suspended already. An operation that knows no pause need not
    /// listen: if it ends meanwhile, the task learns of it when it goes on. A task that is aborted while it
    /// stands still does not go on; its operations are cancelled.
    ///
    /// The engine waits for the function, which should only pass the message on.
    pub fn on_suspension(&self, function: impl FnMut(bool) + Send + 'static) {
        self.host.on_suspension(function);
    }

    /// Returns whether the task that has begun the operation is suspended.
    pub fn is_suspended(&self) -> bool {
        self.host.is_suspended()
    }

    /// Returns whether the program has left the call, or cancelled the operation.
    pub fn is_cancelled(&self) -> bool {
        self.host.is_cancelled()
    }
}
