//! Points: places at which a task lets others go first, while schedules are explored.
//!
//! A builtin that stands at a point gives up ([`Exit::Again`]) before it has had any effect, its task leaves
//! the processor, and when the task goes on the builtin is done again and let through. Unless schedules are
//! explored that costs a test.

use std::collections::HashSet;
use std::sync::Arc;

use super::{Scheduler, TurnEnd};
use crate::raise::Exit;
use crate::task::{TaskEnd, TaskIndex, TaskNumber, UnwindTarget, Unwinding};
use crate::value::Value;

/// Kinds of operations before which a task stands at a point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Grain {
    /// Builtins that change what others can see, or begin to wait.
    Changes,
    /// Also those that look at what others have changed.
    Reads,
    /// Also ticks after something that other tasks can see, among which are reading and setting a special
    /// variable, and ticks inside of forms with a cleanup or a limit.
    #[default]
    Variables,
    /// Also all ticks, which is wherever the machine can preempt a task.
    Ticks,
}

impl Grain {
    /// All grains, the coarsest first.
    pub const ALL: [Grain; 4] = [Grain::Changes, Grain::Reads, Grain::Variables, Grain::Ticks];

    /// Returns the name, as commands, tests and schedules write it.
    pub const fn name(self) -> &'static str {
        match self {
            Grain::Changes => "changes",
            Grain::Reads => "reads",
            Grain::Variables => "variables",
            Grain::Ticks => "ticks",
        }
    }

    /// Returns the grain of this name.
    pub fn from_name(name: &str) -> Option<Grain> {
        Grain::ALL.into_iter().find(|grain| grain.name() == name)
    }
}

/// A choice that a task asks for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum AskedFor {
    /// One of the forms of `choose`.
    #[default]
    Form,
    /// Whether a restart interrupts a call before its effect.
    RestartBefore,
    /// Whether a restart interrupts a call behind its effect.
    RestartBehind,
}

impl AskedFor {
    /// Returns the choice that a builtin asks for by this number.
    pub(crate) fn of_way(way: Option<usize>) -> AskedFor {
        match way {
            Some(1) => AskedFor::RestartBefore,
            Some(2) => AskedFor::RestartBehind,
            _ => AskedFor::Form,
        }
    }
}

/// A place that tasks may share.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum UsedPlace {
    /// A special variable that the task has not bound.
    Variable(Value),
    /// A part of an object, by name. The object may be gone by now.
    Part { object: Value, part: String },
}

/// A use of a place by a task.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct SharedUse {
    /// The task.
    pub(crate) task: TaskNumber,
    /// The used place.
    pub(crate) target: UsedPlace,
    /// The value that was read or set, as a short text; empty if it is not known.
    pub(crate) value: String,
    /// Whether the place was changed.
    pub(crate) is_set: bool,
    /// Place in the program, as `file:line:column`.
    pub(crate) place: Option<String>,
}

/// Where tasks stop while schedules are explored.
#[derive(Clone, Default)]
pub(crate) struct Points {
    /// Operations before which they stop; `None` unless schedules are explored.
    pub(crate) grain: Option<Grain>,
    /// Whether states differ by the time.
    pub(crate) has_clock: bool,
    /// Whether states differ by how often events were signalled.
    pub(crate) has_counts: bool,
    /// Whether states differ by the columns of the outputs.
    pub(crate) has_columns: bool,
    /// Whether states differ by the numbers of tasks.
    pub(crate) has_numbers: bool,
    /// Whether states that differ only by which of several like tasks is which are one state.
    pub(crate) has_symmetry: bool,
    /// Whether the program has looked at the number of a task.
    pub(crate) sees_numbers: bool,
    /// Whether the program has looked at the order of tasks.
    pub(crate) sees_order: bool,
    /// Whether the running task may pass the point at which it stands.
    pub(crate) is_open: bool,
    /// Whether the running task has passed a point, or has done something else that other tasks can see,
    /// since the last tick.
    pub(crate) has_shown: bool,
    /// Whether others can indeed see it: of variables, only those in a race count.
    pub(crate) is_seen: bool,
    /// Whether it was more than to pass a point, so that others had no choice to go first.
    pub(crate) is_sudden: bool,
    /// The variables in a race, as far as they are known: those that a task has set while there were others.
    /// `None` if all variables count as such.
    pub(crate) raced: Option<Arc<HashSet<u64>>>,
    /// Other variables that were set while there were other tasks.
    pub(crate) found_raced: Vec<Value>,
    /// Whether time may pass while tasks can run.
    pub(crate) is_timed: bool,
    /// Whether an account that tasks share was spent by one while another could run.
    pub(crate) was_hit: bool,
    /// Other tasks than the running one that were reached by a request to end or to leave a form, or by an
    /// interrupt, and whether they could run.
    pub(crate) requested: Vec<(TaskIndex, bool)>,
    /// Whether there are guards, which may interrupt tasks anywhere.
    pub(crate) has_guards: bool,
    /// Number of ways among which the task that ran last wants one to be chosen.
    pub(crate) asked: Option<usize>,
    /// The purpose of these ways.
    pub(crate) asked_for: AskedFor,
    /// The alternative that was chosen for it.
    pub(crate) chosen: Option<usize>,
    /// Whether tasks stop before uses of places that others may reach.
    pub(crate) is_strict: bool,
    /// The uses of places, oldest first; `None` unless a schedule is told.
    pub(crate) uses: Option<Vec<SharedUse>>,
    /// Place in the program of the next use of a special variable.
    pub(crate) place: Option<String>,
    /// The objects of the uses so far, with their names. They may be gone by now.
    pub(crate) objects: Vec<(Value, String)>,
}

impl Points {
    /// Notes that the running task has done something that other tasks can see, or has looked at it, without
    /// having stopped before.
    #[inline]
    pub(crate) fn note_shown(&mut self) {
        if self.grain.is_some() {
            (self.has_shown, self.is_seen, self.is_sudden) = (true, true, true);
        }
    }

    /// Notes that the running task has passed a point.
    fn note_passed(&mut self) {
        if self.grain.is_some() {
            (self.has_shown, self.is_seen) = (true, true);
        }
    }

    /// Notes that a request has reached a task that does not run.
    #[cold]
    pub(crate) fn note_request(&mut self, task: TaskIndex, could_run: bool) {
        if self.grain.is_some() && !self.requested.contains(&(task, could_run)) {
            self.requested.push((task, could_run));
        }
    }

    /// Notes that the running task reads the clock.
    pub(crate) fn note_clock_read(&mut self) {
        self.is_sudden |= self.is_timed;
    }

    /// Notes that the running task uses a variable that others may use. Unless `matters`, nobody can see it.
    pub(crate) fn note_variable(&mut self, matters: bool) {
        self.has_shown = true;
        (self.is_seen, self.is_sudden) = (self.is_seen | matters, self.is_sudden | matters);
    }
}

impl Scheduler {
    /// Stops the running task at a point before something that other tasks can see. For builtins, once each
    /// time that they are done.
    ///
    /// # Errors
    /// [`Exit::Again`] if others are to be given the choice to go first; the builtin will be done again.
    #[inline]
    pub(crate) fn point(&mut self) -> Result<(), Exit> {
        if self.points.grain.is_some() && self.stops_here() { Err(Exit::Again) } else { Ok(()) }
    }

    /// Stops the running task, in a strict exploration, before it uses a place that others may reach.
    ///
    /// # Errors
    /// As [`Scheduler::point`].
    pub(crate) fn point_of_use(&mut self) -> Result<(), Exit> {
        if self.points.is_strict && self.stops_here() { Err(Exit::Again) } else { Ok(()) }
    }

    /// Stops the running task at a point before it looks at what other tasks have done.
    ///
    /// # Errors
    /// As [`Scheduler::point`].
    #[inline]
    pub(crate) fn point_of_read(&mut self) -> Result<(), Exit> {
        let is_fine = matches!(self.points.grain, Some(Grain::Reads | Grain::Variables | Grain::Ticks));
        if is_fine && self.stops_here() { Err(Exit::Again) } else { Ok(()) }
    }

    /// Returns whether the running task stops at the point that it has come to.
    #[cold]
    fn stops_here(&mut self) -> bool {
        if self.task().critical > 0 || std::mem::take(&mut self.points.is_open) {
            self.points.note_passed();
            return false;
        }
        self.task_mut().flags.set_at_point(true);
        self.turn.end_with(TurnEnd::Passed);
        true
    }

    /// Chooses a number below `count`: by the seed of the run, or by the explorer. In a critical section,
    /// which is one step for the explorer, it is 0 then.
    ///
    /// # Errors
    /// [`Exit::Again`] if the explorer is to choose; the builtin will be done again.
    pub(crate) fn choose(&mut self, count: usize, asked_for: AskedFor) -> Result<usize, Exit> {
        if self.points.grain.is_none() {
            return Ok(self.choices.choose(count));
        }
        if let Some(chosen) = self.points.chosen.take() {
            return Ok(chosen % count);
        }
        if self.task().critical > 0 || count == 1 {
            return Ok(0);
        }
        (self.points.asked, self.points.asked_for) = (Some(count), asked_for);
        self.task_mut().flags.set_at_point(true);
        self.turn.end_with(TurnEnd::Passed);
        Err(Exit::Again)
    }

    /// Stops the running task, which has come to its end with these values, before the last step of the
    /// unwinding that ends it. Returns whether it stops.
    pub(crate) fn stops_before_end(&mut self, values: &mut Vec<Value>) -> bool {
        if self.points.grain.is_none() || !self.stops_here() {
            return false;
        }
        let target = UnwindTarget::Root(self.turn.ending.take().unwrap_or(TaskEnd::Succeeded));
        let values = std::mem::take(values);
        self.task_mut().control.unwinding = Some(Unwinding { target, values });
        true
    }
}
