//! The limits that are open in a task, and what its cleanups may still use.

use super::LimitNumber;
use crate::value::Value;

/// Names an account of ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct AccountId(pub(crate) u32);

impl AccountId {
    /// No account: ticks are not limited.
    pub(crate) const NONE: AccountId = AccountId(u32::MAX);
}

/// An open limit of a task.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limit {
    /// Index of its entry in the control stack.
    pub(crate) entry: u32,
    /// Number that timers and accounts know it by.
    pub(crate) number: LimitNumber,
    /// Account, if it limits ticks.
    pub(crate) account: AccountId,
    /// Cause of its expiry, a keyword.
    pub(crate) expired: Option<Value>,
}

/// What a running cleanup may still use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Allowance {
    /// Ticks of the task at which it ends.
    pub ticks: u64,
    /// Time at which it ends, in nanoseconds.
    pub time: u64,
}
