//! The operations under way, as the machine knows them.

use esl_heap::list_state;
use esl_heap::stored;
use esl_host::machine::Canceller;
use std::collections::{BTreeMap, BTreeSet};

use crate::task::TaskNumber;
use crate::value::Value;

/// An operation under way.
#[derive(Clone, Debug)]
pub(crate) struct OpenOperation {
    /// Its handle, which is an event.
    pub(crate) handle: Value,
    /// Cancels it.
    pub(crate) canceller: Canceller,
    /// Whether the program has cancelled it.
    pub(crate) is_cancelled: bool,
    /// Whether a call that is left does not wait until it has stopped.
    pub(crate) is_detached: bool,
    /// The task that has begun it.
    pub(crate) begun_by: TaskNumber,
}

/// The operations under way, by number.
#[derive(Clone, Default)]
pub(crate) struct Operations {
    pub(crate) open: BTreeMap<u64, OpenOperation>,
    /// Number of operations begun so far.
    pub(crate) begun: u64,
    /// Those under way, each behind the task that has begun it.
    pub(crate) by_task: BTreeSet<(TaskNumber, u64)>,
}

list_state! { OpenOperation {
    handle: Run,
    canceller: Process,
    is_cancelled: Run,
    is_detached: Run,
    begun_by: Run,
} }

impl Operations {
    /// Returns whether none is under way.
    pub(crate) fn is_empty(&self) -> bool {
        self.open.is_empty()
    }

    /// Returns the handles of those under way, that of the newest first.
    pub(crate) fn handles(&self) -> impl Iterator<Item = Value> {
        self.open.values().rev().map(|open| open.handle)
    }

    /// Returns the number of the operation that begins next.
    pub(crate) fn next_number(&self) -> u64 {
        self.begun + 1
    }

    /// Counts an operation that a task performs in place of the outside, and returns its number.
    pub(crate) fn count(&mut self) -> u64 {
        self.begun += 1;
        self.begun
    }

    /// Adds the next operation.
    pub(crate) fn begin(
        &mut self,
        handle: Value,
        canceller: Canceller,
        is_detached: bool,
        begun_by: TaskNumber,
    ) {
        self.begun += 1;
        self.by_task.insert((begun_by, self.begun));
        let open = OpenOperation { handle, canceller, is_cancelled: false, is_detached, begun_by };
        self.open.insert(self.begun, open);
    }

    /// Removes one that is over.
    pub(crate) fn remove(&mut self, number: u64) {
        if let Some(open) = self.open.remove(&number) {
            self.by_task.remove(&(open.begun_by, number));
        }
    }

    /// Tells the outside that a task, whose operations these are, stands still or goes on. Returns how many
    /// there are.
    pub(crate) fn suspend(&self, task: TaskNumber, is_suspended: bool) -> usize {
        let of_task = self.by_task.range((task, 0)..=(task, u64::MAX));
        let open = of_task.filter_map(|(_, number)| self.open.get(number));
        open.inspect(|open| open.canceller.suspend(is_suspended)).count()
    }

    /// Returns whether a task has begun one that is under way.
    pub(crate) fn has_begun_one(&self, task: TaskNumber) -> bool {
        !self.open.is_empty() && self.by_task.range((task, 0)..=(task, u64::MAX)).next().is_some()
    }

    /// Cancels an operation, once. The outside says when it has stopped.
    pub(crate) fn cancel(&mut self, number: u64) {
        if let Some(open) = self.open.get_mut(&number)
            && !std::mem::replace(&mut open.is_cancelled, true)
        {
            open.canceller.cancel();
        }
    }

    /// Cancels all that are under way.
    pub(crate) fn cancel_all(&mut self) {
        let numbers: Vec<u64> = self.open.keys().copied().collect();
        numbers.into_iter().for_each(|number| self.cancel(number));
    }

    /// Returns whether one is under way that is waited for.
    pub(crate) fn are_awaited(&self) -> bool {
        self.open.values().any(|open| !open.is_detached)
    }

    /// Calls `visit` with the handles of all that are under way.
    pub(crate) fn visit(&self, visit: &mut dyn FnMut(Value)) {
        self.open.values().for_each(|open| visit(open.handle));
    }
}

stored! { OpenOperation { handle, is_cancelled, is_detached, begun_by } with { canceller: Canceller::default() } }
stored! { Operations { open, begun, by_task } }
