//! The consumption of tasks in their turns, in ticks and in time, for profiles.
//!
//! Guarantee: the figures are exact for each task. The clock is read where a turn, or a part of one, begins
//! and ends: so waiting costs nothing, and no read falls into the work between.

use crate::task::{TaskIndex, TaskNumber};

/// An amount of work.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct UsedResources {
    /// Ticks.
    pub ticks: u64,
    /// Nanoseconds of real time during turns; the collector's turns in them count, too.
    pub nanoseconds: u64,
}

impl UsedResources {
    /// Adds what was used further.
    pub fn add(&mut self, more: UsedResources) {
        self.ticks += more.ticks;
        self.nanoseconds += more.nanoseconds;
    }
}

/// The consumption of a task since the last query.
#[derive(Clone, Copy)]
struct MeteredTask {
    number: TaskNumber,
    used: UsedResources,
}

/// The consumption of all tasks since the last query.
#[derive(Default)]
pub(crate) struct Meter {
    /// Whether it is wanted.
    pub(crate) is_on: bool,
    /// Time, by the host's stopwatch, and ticks of the run when the turn under way began.
    began: UsedResources,
    /// The tasks, by index.
    tasks: Vec<Option<MeteredTask>>,
    /// Tasks that have ended: what reports called them, and what they had used.
    ended: Vec<(String, UsedResources)>,
}

impl Meter {
    /// Notes that a turn, or a part of one, begins: now, when so much of the run is over.
    pub(crate) fn begin_turn(&mut self, now: UsedResources) {
        self.began = now;
    }

    /// Notes that a turn of a task, or a part of one, ends now.
    pub(crate) fn end_turn(&mut self, now: UsedResources, (index, number): (TaskIndex, TaskNumber)) {
        let used = UsedResources {
            ticks: now.ticks.saturating_sub(self.began.ticks),
            nanoseconds: now.nanoseconds.saturating_sub(self.began.nanoseconds),
        };
        let index = index.0 as usize;
        if index >= self.tasks.len() {
            self.tasks.resize(index + 1, None);
        }
        match &mut self.tasks[index] {
            Some(task) if task.number == number => task.used.add(used),
            place => {
                if let Some(task) = place.replace(MeteredTask { number, used }) {
                    self.ended.push((format!("task {}", task.number), task.used));
                }
            }
        }
    }

    /// Takes what the task with this index and number has used.
    pub(crate) fn take(&mut self, index: TaskIndex, number: TaskNumber) -> UsedResources {
        let place = self
            .tasks
            .get_mut(index.0 as usize)
            .filter(|place| place.is_some_and(|task| task.number == number));
        place.and_then(Option::take).map_or(UsedResources::default(), |task| task.used)
    }

    /// Notes what reports call a task that has ended, which has used this.
    pub(crate) fn note_end(&mut self, label: String, used: UsedResources) {
        self.ended.push((label, used));
    }

    /// Takes what tasks that have ended had used.
    pub(crate) fn take_ended(&mut self) -> Vec<(String, UsedResources)> {
        std::mem::take(&mut self.ended)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn used(ticks: u64, nanoseconds: u64) -> UsedResources {
        UsedResources { ticks, nanoseconds }
    }

    #[test]
    fn each_task_has_what_its_turns_have_used() {
        let mut meter = Meter::default();
        let (first, second) = ((TaskIndex(3), TaskNumber(7)), (TaskIndex(0), TaskNumber(8)));
        for (from, to, task) in [(10, 15, first), (15, 16, second), (900, 907, first)] {
            meter.begin_turn(used(from, 100 * from));
            meter.end_turn(used(to, 100 * to), task);
        }
        assert_eq!(meter.take(second.0, first.1), used(0, 0), "another task had that place");
        assert_eq!(meter.take(first.0, first.1), used(12, 1200));
        assert_eq!(meter.take(first.0, first.1), used(0, 0), "it was taken");
        // Another task has the place of the second, whose end was not noted.
        meter.begin_turn(used(1000, 0));
        meter.end_turn(used(1002, 1), (second.0, TaskNumber(9)));
        assert_eq!(meter.take_ended(), [("task 8".to_string(), used(1, 100))]);
        assert_eq!(meter.take(second.0, TaskNumber(9)), used(2, 1));
    }
}
