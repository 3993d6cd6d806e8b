//! Signals that are being handed out.

use crate::task::AccountId;
use crate::value::Value;

/// A signal that is being handed out.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Delivery {
    /// What was signalled.
    pub(crate) event: Value,
    /// With what: a list.
    pub(crate) arguments: Value,
    /// The next wait that gets it: a link in the list of the event, or `NIL`.
    pub(crate) next: Value,
    /// Who pays for the work.
    pub(crate) account: AccountId,
    /// The number of the task that signals, or 0.
    pub(crate) by: u64,
}

impl Delivery {
    /// Calls `visit` with its values.
    pub(crate) fn visit(&self, visit: &mut dyn FnMut(Value)) {
        [self.event, self.arguments, self.next].into_iter().for_each(visit);
    }
}
