//! States of operations: bytes of the host's own that outlive the process of a durable run.
//!
//! Guarantees: [`OperationState::save`] returns true only if the bytes are as safe as the run demands, so an
//! effect may depend on them. Bytes of an operation that is over are gone.

use std::fmt;

use super::Inbox;

/// Keeps the states of the operations of a run.
pub trait StateKeeper: Send + Sync {
    /// Keeps bytes of the operation with this number, in place of those before. Returns whether they are
    /// safe.
    fn save(&self, operation: u64, state: &[u8]) -> bool;

    /// Returns the bytes of the operation with this number that were kept last.
    fn restore(&self, operation: u64) -> Option<Vec<u8>>;
}

/// The state of one operation, kept with the state of a durable run: bytes by which the host's code goes on
/// with it in another process.
///
/// An operation that has saved bytes is begun again by the next process, whatever the effect of its call is,
/// and restores them there. Before that it is known only by its arguments.
#[derive(Clone)]
pub struct OperationState {
    number: u64,
    inbox: Inbox,
}

impl fmt::Debug for OperationState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "OperationState({})", self.number)
    }
}

impl OperationState {
    /// Returns the state of the operation with this number in the machine with this inbox.
    pub(crate) fn new(number: u64, inbox: &Inbox) -> OperationState {
        OperationState { number, inbox: inbox.clone() }
    }

    /// Keeps bytes, in place of those before, and returns when they are as safe as the run demands. Returns
    /// false if that is not possible: then the operation does not go on. In a run that is not durable it has
    /// no effect, and returns true.
    #[must_use = "bytes that are not safe may be missing in the next process"]
    pub fn save(&self, state: &[u8]) -> bool {
        self.inbox.state_keeper().is_none_or(|keeper| keeper.save(self.number, state))
    }

    /// Returns the bytes that were saved last, by this process or an earlier one.
    pub fn restore(&self) -> Option<Vec<u8>> {
        self.inbox.state_keeper()?.restore(self.number)
    }
}
