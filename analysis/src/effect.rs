//! Effects of code: the failures that begin at a node, the calls that it makes, the tasks that it begins.

use crate::value::{Code, NameId, Spot, WorkId};

/// Kind of a failure where it begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) enum FailureKind {
    /// `fail` with this cause.
    Cause(NameId),
    /// This cause, or one below it, as a declaration says.
    Below(NameId),
    /// A condition of this type.
    Condition(NameId),
    /// `fail` with the cause of a condition of this type: a failure of that name, which is not of the type.
    CauseOf(NameId),
    /// A cause that is computed, or code that is: any.
    Any(Reason),
    /// An operation or a function of the host without a declaration.
    Unknown(NameId),
}

/// Reason for which a cause is not known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) enum Reason {
    /// It is computed.
    Computed,
    /// It is that of code which runs only when the program does, as of `eval`.
    Code,
}

/// Sets of kinds of programming errors, as bits.
pub(crate) mod mistake {
    /// A value of a wrong type, or an index out of range.
    pub(crate) const TYPE: u8 = 1;
    /// A division by zero, or another failure of arithmetic.
    pub(crate) const ARITHMETIC: u8 = 2;
    /// A name without a meaning: a variable, a function, a slot.
    pub(crate) const NAME: u8 = 4;
    /// A call with wrong arguments, or another misuse of a form.
    pub(crate) const PROGRAM: u8 = 8;
    /// Another error of a function of the library.
    pub(crate) const OTHER: u8 = 16;
    /// A critical section that waits or takes too long.
    pub(crate) const CRITICAL: u8 = 32;
    /// A failure that is possible only after a programming error.
    pub(crate) const CONSEQUENCE: u8 = 64;
    /// A failure with the cause of a programming error, which is not the error itself.
    pub(crate) const CAUSE: u8 = 128;
    /// All of them.
    pub(crate) const ALL: u8 = 255;
    /// Those of a call of any function of the library.
    pub(crate) const OF_CALLS: u8 = TYPE | NAME | PROGRAM | OTHER;
}

/// An effect of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum NodeEffect {
    /// It calls this code, whose failures leave the call.
    Call(Code),
    /// It calls each function of [`ManyCalls`](crate::many::ManyCalls).
    CallMany,
    /// It calls this code, whose failures end there.
    Absorb(Code),
    /// It begins a task or an operation.
    Start(WorkId),
    /// The task runs this code. Noted at the node that begins the task.
    Body(WorkId, Code),
    /// A failure begins.
    Fail(FailureKind),
    /// A failure begins if all tasks at this node that [`NodeEffect::FailAll`] names can fail.
    FailAllWith(NameId),
    /// It fails as a task or an operation has failed.
    FailAs(WorkId),
    /// It fails if all of several tasks have failed, of which this is one.
    FailAll(WorkId),
    /// It fails with a condition that the handling form at this place has caught.
    Again(Spot),
    /// It fails with the cause of such a condition.
    AgainByCause(Spot),
    /// It fails with the cause with which a task or an operation has failed.
    FailByCauseOf(WorkId),
    /// The limit of a task ends it with this cause.
    Limit(WorkId, NameId),
    /// The failure with this cause, which begins here, interrupts the code that the node calls.
    Interrupts(NameId),
    /// The failures of this code, which the node calls, begin within the other code that it calls.
    InterruptsBy(Code),
    /// Control may leave for a place around the failure that a clause or a handler runs for: a `throw`, a
    /// restart, the next bindings of a query.
    Jump,
    /// It may wait.
    Wait,
    /// It may be a programming error of these kinds.
    Mistake(u8),
}
