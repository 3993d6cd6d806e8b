//! The collector's list of tasks: which of them it has yet to scan in the cycle under way.
//!
//! Guarantees: a step costs the same however many tasks there are; every task that is in the list when a cycle begins and
//! still exists is met once in it. Tasks that begin later are born scanned.
//!
//! The list is gone through from its end to its start, so that a task which is no more can be replaced by the last one:
//! that one was met already, or is new.

use crate::run::Tasks;
use crate::task::TaskId;

/// Tasks, each once, and some that are no more.
#[derive(Default)]
pub(crate) struct Roster {
    ids: Vec<TaskId>,
    /// Those before this position are still to be met.
    unmet: usize,
    /// Where the search for tasks that are no more goes on.
    stale: usize,
}

impl Roster {
    /// Adds a new task. On the way it drops tasks that are no more, so that these stay a part of the list.
    pub(crate) fn add(&mut self, id: TaskId, tasks: &Tasks) {
        for _ in 0..2 {
            if self.unmet > 0 || self.ids.is_empty() {
                break;
            }
            self.stale = if self.stale == 0 { self.ids.len() } else { self.stale.min(self.ids.len()) } - 1;
            if !tasks.contains_key(self.ids[self.stale]) {
                self.ids.swap_remove(self.stale);
            }
        }
        self.ids.push(id);
    }

    /// Begins a cycle: all tasks are to be met.
    pub(crate) fn begin(&mut self) {
        self.unmet = self.ids.len();
    }

    /// The next task to meet.
    pub(crate) fn next(&mut self, tasks: &Tasks) -> Option<TaskId> {
        while self.unmet > 0 {
            self.unmet -= 1;
            let id = self.ids[self.unmet];
            if tasks.contains_key(id) {
                return Some(id);
            }
            self.ids.swap_remove(self.unmet);
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_task_is_met_once_whatever_comes_and_goes() {
        let mut tasks = Tasks::with_key();
        let mut roster = Roster::default();
        let add = |tasks: &mut Tasks, roster: &mut Roster| {
            let id = tasks.insert(None);
            roster.add(id, tasks);
            id
        };
        let first: Vec<TaskId> = (0..100).map(|_| add(&mut tasks, &mut roster)).collect();
        roster.begin();
        let mut met = Vec::new();
        for step in 0..50 {
            met.extend(roster.next(&tasks));
            tasks.remove(first[(step * 7) % 100]);
            add(&mut tasks, &mut roster);
        }
        while let Some(id) = roster.next(&tasks) {
            met.push(id);
        }
        for &id in &first {
            let times = met.iter().filter(|&&other| other == id).count();
            assert!(times == 1 || times == 0 && !tasks.contains_key(id));
        }
    }

    #[test]
    fn tasks_that_are_no_more_do_not_pile_up() {
        let mut tasks = Tasks::with_key();
        let mut roster = Roster::default();
        for _ in 0..10_000 {
            let id = tasks.insert(None);
            roster.add(id, &tasks);
            tasks.remove(id);
        }
        assert!(roster.ids.len() < 10);
    }
}
