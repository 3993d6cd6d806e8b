//! Run queues: whose turn it is.
//!
//! There are eight priorities, the highest first, round-robin within one; of 64 turns each priority that has
//! a runnable task gets at least one. Beside them there is a queue of urgent tasks: those that are being
//! ended, and those that wait for that. It is served in turn with the others, so an abort is delivered within
//! two slices however many tasks there are.
//!
//! A schedule is legal if it keeps to this. The order of runnable tasks of the same priority is open, and so
//! is the length of a slice: both are chosen by [`Choices`].
//!
//! A place in a queue is good while the task has the serial number that it had when it was put there, so a
//! task changes queues without a search.

use esl_heap::list_state;
use esl_heap::stored;
use std::collections::VecDeque;

use super::Choices;
use crate::task::{PRIORITIES, Serial, TaskIndex, TaskState, Tasks};

/// Maximal number of runnable tasks among which a choice is made.
const CHOICE: usize = 8;

/// Places that are not worth a sweep.
const SWEPT: usize = 64;

/// Place in a queue.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Queued {
    index: TaskIndex,
    serial: Serial,
}

/// The runnable tasks.
#[derive(Clone, Default)]
pub(crate) struct RunQueues {
    /// Queues by priority.
    pub(crate) queues: [VecDeque<Queued>; PRIORITIES],
    /// A bit for each queue, by priority; may be set for one that is empty.
    pub(crate) occupied: u8,
    /// Queue of the urgent tasks.
    pub(crate) urgent: VecDeque<Queued>,
    /// Number of turns so far.
    pub(crate) turns: u64,
}

list_state! { Queued { index: Run, serial: Run } }

impl RunQueues {
    /// Adds a task.
    #[inline]
    pub(crate) fn push(&mut self, index: TaskIndex, serial: Serial, priority: u8, urgent: bool) {
        let queued = Queued { index, serial };
        if urgent {
            self.urgent.push_back(queued);
        } else {
            self.queues[usize::from(priority)].push_back(queued);
            self.occupied |= 1 << priority;
        }
    }

    /// Returns whether no task has a place.
    pub(crate) fn are_empty(&self) -> bool {
        self.urgent.is_empty() && self.queues.iter().all(VecDeque::is_empty)
    }

    /// Drops places that are no longer good, if they are most of the places. An exploration takes none: it
    /// chooses tasks by other means.
    pub(crate) fn sweep(&mut self, tasks: &Tasks) {
        let places = self.queues.iter().map(VecDeque::len).sum::<usize>() + self.urgent.len();
        if places > SWEPT && places > 2 * tasks.iter().count() {
            let queues = self.queues.iter_mut().chain([&mut self.urgent]);
            queues.for_each(|queue| queue.retain(|&queued| is_valid(queued, tasks)));
        }
    }

    /// Returns the bytes that the queues take.
    pub(crate) fn bytes(&self) -> usize {
        let places = self.queues.iter().chain([&self.urgent]).map(VecDeque::len).sum::<usize>();
        places * size_of::<Queued>()
    }

    /// Takes the first urgent task.
    pub(crate) fn next_urgent(&mut self, tasks: &Tasks) -> Option<TaskIndex> {
        pop(&mut self.urgent, tasks, &mut Choices::first())
    }

    /// Takes the task whose turn it is.
    pub(crate) fn next(&mut self, tasks: &Tasks, choices: &mut Choices) -> Option<TaskIndex> {
        self.turns += 1;
        if self.turns & 1 == 0
            && !self.urgent.is_empty()
            && let Some(index) = pop(&mut self.urgent, tasks, &mut Choices::first())
        {
            return Some(index);
        }
        // Each priority has one turn in 64 of its own.
        if self.turns & 7 == 0 {
            let priority = (self.turns >> 3) as usize % PRIORITIES;
            if let Some(index) = pop(&mut self.queues[priority], tasks, choices) {
                return Some(index);
            }
        }
        while self.occupied != 0 {
            let priority = self.occupied.ilog2();
            let queue = &mut self.queues[priority as usize];
            if choices.is_first()
                && let Some(index) = pop_first(queue, tasks)
            {
                return Some(index);
            }
            if let Some(index) = pop(queue, tasks, choices) {
                return Some(index);
            }
            self.occupied &= !(1 << priority);
        }
        pop(&mut self.urgent, tasks, &mut Choices::first())
    }
}

#[inline]
fn is_valid(queued: Queued, tasks: &Tasks) -> bool {
    tasks
        .at(queued.index)
        .is_some_and(|task| task.serial == queued.serial && task.state == TaskState::Runnable)
}

/// Takes the first task from a queue, if its place is good, which it mostly is.
#[inline(always)]
fn pop_first(queue: &mut VecDeque<Queued>, tasks: &Tasks) -> Option<TaskIndex> {
    let index = queue.front().copied().filter(|&first| is_valid(first, tasks))?.index;
    queue.pop_front();
    Some(index)
}

/// Takes a task from a queue, and drops places that are no longer good.
fn pop(queue: &mut VecDeque<Queued>, tasks: &Tasks, choices: &mut Choices) -> Option<TaskIndex> {
    while let Some(&first) = queue.front() {
        if !is_valid(first, tasks) {
            queue.pop_front();
            continue;
        }
        if choices.is_first() {
            queue.pop_front();
            return Some(first.index);
        }
        let chosen = choices.choose(queue.len().min(CHOICE));
        let queued = queue.remove(chosen)?;
        if is_valid(queued, tasks) {
            return Some(queued.index);
        }
    }
    None
}

stored! { Queued { index, serial } }
stored! { RunQueues { queues, occupied, urgent, turns } }

#[cfg(test)]
mod tests {
    use super::*;
    use crate::task::Task;
    use crate::value::Value;

    fn tasks(count: u32) -> Tasks {
        let mut tasks = Tasks::default();
        for serial in 0..count {
            let mut task = Box::new(Task::new(Value::NIL, 1));
            task.serial = Serial(u64::from(serial));
            tasks.insert(task);
        }
        tasks
    }

    #[test]
    fn every_priority_has_its_turn_in_sixty_four() {
        let tasks = tasks(8);
        let mut queues = RunQueues::default();
        for index in 0..8 {
            queues.push(TaskIndex(index), Serial(u64::from(index)), index as u8, false);
        }
        let mut turns = [0; 8];
        for _ in 0..64 {
            let index = queues.next(&tasks, &mut Choices::first()).unwrap();
            turns[index.as_usize()] += 1;
            queues.push(index, Serial(u64::from(index.0)), index.0 as u8, false);
        }
        assert!(turns.iter().all(|&turns| turns >= 1) && turns[7] > 50, "{turns:?}");
    }

    #[test]
    fn an_urgent_task_has_its_turn_within_two() {
        let tasks = tasks(10);
        let mut queues = RunQueues::default();
        for index in 0..9 {
            queues.push(TaskIndex(index), Serial(u64::from(index)), 7, false);
        }
        queues.push(TaskIndex(9), Serial(9), 0, true);
        let turns: Vec<TaskIndex> =
            (0..2).filter_map(|_| queues.next(&tasks, &mut Choices::first())).collect();
        assert!(turns.contains(&TaskIndex(9)), "{turns:?}");
    }

    #[test]
    fn an_old_place_is_not_good() {
        let tasks = tasks(2);
        let mut queues = RunQueues::default();
        queues.push(TaskIndex(0), Serial(77), 4, false);
        queues.push(TaskIndex(1), Serial(1), 4, false);
        assert_eq!(queues.next(&tasks, &mut Choices::first()), Some(TaskIndex(1)));
        assert_eq!(queues.next(&tasks, &mut Choices::first()), None);
    }
}
