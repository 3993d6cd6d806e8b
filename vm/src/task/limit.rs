//! The limits that are open in a task, and what cleanups may use.

use crate::value::Value;

/// Names an account.
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
    /// Its number.
    pub(crate) number: u64,
    /// Its account, if it limits ticks.
    pub(crate) account: AccountId,
    /// Why it has expired: the cause, a keyword.
    pub(crate) expired: Option<Value>,
}

/// What a running cleanup may still use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Allowance {
    /// Up to how many ticks of the task.
    pub ticks: u64,
    /// Until when, in nanoseconds.
    pub time: u64,
}
