//! A task: a thread of control of the program, with its own stack.
//!
//! While a task runs, its record is taken out of the table into [`crate::vm::Vm::running`] and `pc` and `base` are kept by
//! the interpreter; at a safepoint they are put back, and the record is all there is: no Rust frame holds any state.

use slotmap::new_key_type;

use crate::control::{Control, End};
use crate::stack::Stack;
use crate::value::Value;

new_key_type! {
    /// Names a task for as long as the machine lives.
    pub struct TaskId;
}

/// Whether a task can run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TaskState {
    /// It can, and is in the run queue or running.
    Runnable,
    /// It waits for input from outside.
    Parked,
    /// It has ended.
    Ended(End),
}

/// A task.
pub(crate) struct Task {
    /// Its registers.
    pub stack: Stack,
    /// The next instruction, while it does not run.
    pub pc: *const u32,
    /// Offset of the running frame's base, while it does not run.
    pub base: usize,
    /// Its control stack and bindings.
    pub control: Control,
    /// Whether it can run.
    pub state: TaskState,
    /// Whether it is to be aborted as soon as it may be.
    pub pending_abort: bool,
    /// Ticks that it has used.
    pub ticks: u64,
    /// Whether the stack's reserve is open, because a failure for lack of stack is being handled.
    pub uses_reserve: bool,
    /// The collector's cycle in which the stack was last scanned.
    pub scanned: u64,
    /// What it returned.
    pub values: Vec<Value>,
    /// What is to be said of the failure that ended it.
    pub report: Option<String>,
}

// SAFETY: `pc` points into a Code in the heap of the machine that owns the task, or into a static table.
#[allow(unsafe_code, reason = "the one raw pointer of a task moves with its machine")]
unsafe impl Send for Task {}

/// What became of a task, for the embedder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum TaskResult {
    /// It has not ended.
    Running,
    /// It returned these values.
    Succeeded(Vec<Value>),
    /// It ended by a failure: the condition.
    Failed(Value),
    /// It was aborted.
    Aborted,
}

impl Task {
    /// A task that has yet to be given a frame.
    pub(crate) fn new() -> Task {
        Task {
            stack: Stack::new(),
            pc: std::ptr::null(),
            base: 0,
            control: Control::default(),
            state: TaskState::Runnable,
            pending_abort: false,
            ticks: 0,
            uses_reserve: false,
            scanned: 0,
            values: Vec::new(),
            report: None,
        }
    }

    /// What became of it.
    pub(crate) fn result(&self) -> TaskResult {
        match self.state {
            TaskState::Ended(End::Succeeded) => TaskResult::Succeeded(self.values.clone()),
            TaskState::Ended(End::Failed(condition)) => TaskResult::Failed(condition),
            TaskState::Ended(End::Aborted) => TaskResult::Aborted,
            _ => TaskResult::Running,
        }
    }
}
