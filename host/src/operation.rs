//! Operations as the outside sees them: what it does for a task, and what becomes of it.
//!
//! Guarantees: an operation has one end, however the host's code behaves: it cannot be completed twice, and
//! one that is dropped without an end has failed. News of an operation after the end of its machine have no
//! effect.

use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use esl_bytecode::datum::Datum;

use super::{ActionId, Inbox, Incoming, OperationState};

/// A failure as it crosses the border between a program and its host, in either direction.
#[derive(Clone, Debug)]
pub struct HostFailure {
    /// Name of the cause, a keyword: `VALVE-STUCK`. The name of a condition type stands for that type.
    pub cause: String,
    /// Arguments of the failure.
    pub arguments: Vec<Datum>,
}

/// News of an operation.
#[derive(Clone, Debug)]
pub enum News {
    /// It goes on, and this is how far it is.
    Progress(Vec<Datum>),
    /// It has come to its end, with these values.
    Completed(Vec<Datum>),
    /// It has failed, or stopped because it was cancelled.
    Failed(HostFailure),
}

/// The reaction to the program's cancelling an operation.
#[derive(Default)]
enum OnCancel {
    /// Not set yet.
    #[default]
    Unknown,
    /// This function is called.
    Call(Box<dyn FnOnce() + Send>),
    /// It has happened.
    Done,
}

/// Suspension of the task that has begun an operation, as the outside sees it.
#[derive(Default)]
struct Suspension {
    /// Whether the task stands still.
    is_suspended: bool,
    /// Function that is called with this whenever it changes.
    on_change: Option<Box<dyn FnMut(bool) + Send>>,
}

/// The state shared by the two parts of an operation.
#[derive(Default)]
struct Shared {
    on_cancel: Mutex<OnCancel>,
    suspension: Mutex<Suspension>,
}

/// The part of an operation that the machine keeps: it can cancel the operation, and say that its task stands
/// still.
#[derive(Clone, Default)]
pub struct Canceller(Arc<Shared>);

impl fmt::Debug for Canceller {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Canceller")
    }
}

impl Canceller {
    fn lock(&self) -> MutexGuard<'_, OnCancel> {
        // The state is whole at every moment, so a panic elsewhere does not corrupt it.
        self.0.on_cancel.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn lock_suspension(&self) -> MutexGuard<'_, Suspension> {
        // As above.
        self.0.suspension.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Tells the outside to stop the operation.
    pub fn cancel(&self) {
        let before = std::mem::replace(&mut *self.lock(), OnCancel::Done);
        if let OnCancel::Call(function) = before {
            function();
        }
    }

    /// Tells the outside that the task which has begun the operation stands still, or goes on.
    pub fn suspend(&self, is_suspended: bool) {
        let mut suspension = self.lock_suspension();
        if std::mem::replace(&mut suspension.is_suspended, is_suspended) != is_suspended
            && let Some(function) = &mut suspension.on_change
        {
            // Under the lock, so that the last thing said is what is so.
            function(is_suspended);
        }
    }
}

/// Something that the outside does for a task, until it completes or fails.
///
/// The task waits until then. Dropping the operation is a failure of the cause `:OPERATION-DROPPED`, or of
/// the cause `:HOST-PANIC` if a panic has dropped it.
pub struct HostOperation {
    number: u64,
    arguments: Vec<Datum>,
    inbox: Inbox,
    canceller: Canceller,
    action: Option<ActionId>,
    is_over: bool,
}

impl HostOperation {
    /// Begins the operation with this number, of which the inbox will hear.
    #[doc(hidden)]
    pub fn new(number: u64, arguments: Vec<Datum>, inbox: Inbox, canceller: Canceller) -> HostOperation {
        HostOperation { number, arguments, inbox, canceller, action: None, is_over: false }
    }

    /// Gives it the identity of its call.
    #[doc(hidden)]
    #[must_use]
    pub fn with_action(mut self, action: Option<ActionId>) -> HostOperation {
        self.action = action;
        self
    }

    /// Returns the identity of the call, in a durable run: the same if the run makes the call again in
    /// another process because it does not know whether it was made. A service that knows such keys performs
    /// the call once.
    pub fn action(&self) -> Option<ActionId> {
        self.action
    }

    /// Returns its state, which outlives the process of a durable run.
    pub fn state(&self) -> OperationState {
        OperationState::new(self.number, &self.inbox)
    }

    /// Keeps bytes with the state of a durable run: [`OperationState::save`].
    #[must_use = "bytes that are not safe may be missing in the next process"]
    pub fn save(&self, state: &[u8]) -> bool {
        self.state().save(state)
    }

    /// Returns the bytes that were saved last, by this process or an earlier one.
    pub fn restore(&self) -> Option<Vec<u8>> {
        self.state().restore()
    }

    /// Returns its number, unique in the machine.
    pub fn number(&self) -> u64 {
        self.number
    }

    /// Returns the arguments of the call.
    pub fn arguments(&self) -> &[Datum] {
        &self.arguments
    }

    /// Takes the arguments of the call. There are none afterwards.
    pub fn take_arguments(&mut self) -> Vec<Datum> {
        std::mem::take(&mut self.arguments)
    }

    fn tell(&self, news: News) {
        self.inbox.put(Incoming::Operation { number: self.number, news });
    }

    /// Ends the operation: these are the values of the call.
    pub fn complete(mut self, values: Vec<Datum>) {
        self.is_over = true;
        self.tell(News::Completed(values));
    }

    /// Ends the operation: the call fails.
    pub fn fail(mut self, failure: HostFailure) {
        self.is_over = true;
        self.tell(News::Failed(failure));
    }

    /// Reports how far the operation is.
    pub fn report_progress(&self, values: Vec<Datum>) {
        self.tell(News::Progress(values));
    }

    /// Has `function` called when the program cancels the operation; at once if it has done so already. The
    /// machine waits for the function, so it should only pass the message on. The operation is over when it
    /// is completed, fails or is dropped.
    pub fn on_cancel(&self, function: impl FnOnce() + Send + 'static) {
        let mut state = self.canceller.lock();
        if matches!(*state, OnCancel::Done) {
            drop(state);
            return function();
        }
        *state = OnCancel::Call(Box::new(function));
    }

    /// Has `function` called with true when the task that has begun the operation is suspended, and with
    /// false when it goes on; at once if it is suspended already. The machine waits for the function, so it
    /// should only pass the message on; it may not ask this operation whether it is suspended.
    pub fn on_suspension(&self, mut function: impl FnMut(bool) + Send + 'static) {
        let mut suspension = self.canceller.lock_suspension();
        if suspension.is_suspended {
            function(true);
        }
        suspension.on_change = Some(Box::new(function));
    }

    /// Returns whether the task that has begun the operation is suspended.
    pub fn is_suspended(&self) -> bool {
        self.canceller.lock_suspension().is_suspended
    }

    /// Returns whether the program has cancelled the operation.
    pub fn is_cancelled(&self) -> bool {
        matches!(*self.canceller.lock(), OnCancel::Done)
    }
}

impl Drop for HostOperation {
    fn drop(&mut self) {
        if !self.is_over {
            let cause = if std::thread::panicking() { "HOST-PANIC" } else { "OPERATION-DROPPED" };
            self.tell(News::Failed(HostFailure { cause: cause.into(), arguments: Vec::new() }));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn begun() -> (HostOperation, Inbox, Canceller) {
        let (inbox, canceller) = (Inbox::new(), Canceller::default());
        (HostOperation::new(7, Vec::new(), inbox.clone(), canceller.clone()), inbox, canceller)
    }

    fn heard(inbox: &Inbox) -> String {
        format!("{:?}", inbox.take())
    }

    #[test]
    fn an_operation_has_one_end() {
        let (operation, inbox, _) = begun();
        operation.report_progress(Vec::new());
        operation.complete(Vec::new());
        let expected =
            "[Operation { number: 7, news: Progress([]) }, Operation { number: 7, news: Completed([]) }]";
        assert_eq!(heard(&inbox), expected);
        let (operation, inbox, _) = begun();
        drop(operation);
        assert!(heard(&inbox).contains("OPERATION-DROPPED"));
    }

    #[test]
    fn a_panic_is_told_from_a_drop() {
        let (operation, inbox, _) = begun();
        let thread = std::thread::spawn(move || {
            let _operation = operation;
            panic!("the host's code is wrong");
        });
        assert!(thread.join().is_err());
        assert!(heard(&inbox).contains("HOST-PANIC"));
    }

    #[test]
    fn suspensions_are_told_in_order_and_once() {
        let (operation, _, canceller) = begun();
        let told = Arc::new(Mutex::new(Vec::new()));
        let listen = |told: &Arc<Mutex<Vec<bool>>>| {
            let told = told.clone();
            move |is_suspended| told.lock().expect("nobody panics").push(is_suspended)
        };
        operation.on_suspension(listen(&told));
        for is_suspended in [false, true, true, false, true] {
            canceller.suspend(is_suspended);
        }
        assert_eq!(*told.lock().expect("nobody panics"), [true, false, true]);
        // A listener that registers later learns of it at once.
        let later = Arc::new(Mutex::new(Vec::new()));
        operation.on_suspension(listen(&later));
        canceller.suspend(false);
        assert_eq!(*later.lock().expect("nobody panics"), [true, false]);
        assert!(!operation.is_suspended());
    }

    #[test]
    fn cancelling_calls_once_before_or_after() {
        let (operation, inbox, canceller) = begun();
        let other = operation.inbox.clone();
        operation.on_cancel(move || other.ring());
        assert!(!operation.is_cancelled());
        canceller.cancel();
        canceller.cancel();
        assert!(operation.is_cancelled() && inbox.is_rung());
        inbox.take();
        let other = operation.inbox.clone();
        operation.on_cancel(move || other.ring());
        assert!(inbox.is_rung());
    }
}
