//! The alternatives at a point, and the events of a schedule, as reports show them.

use esl_bytecode::opcode::Opcode;
use esl_bytecode::symbol::{CL_PACKAGE, ESL_PACKAGE, KEYWORD_PACKAGE, Symbol};
use esl_bytecode::word::Word;

use crate::describe::describe;
use crate::heap::Kind;
use crate::interp::frames::Frames;
use crate::names::class;
use crate::report::{program_place, task_label};
use crate::schedule::{AskedFor, SharedUse, UsedPlace};
use crate::task::{Task, TaskId, TaskIndex};
use crate::value::Value;
use crate::vm::Vm;

/// The alternatives at a point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Runnable<'a> {
    /// The tasks that can run; with ways, the one that asks comes first.
    pub(super) tasks: &'a [TaskIndex],
    /// Number of alternatives of the first task, if it is the one that asks, by `choose`.
    pub(super) ways: Option<u32>,
    /// Whether the first of the tasks is the one that ran last.
    pub(super) has_last: bool,
    /// Whether, as the next choice, time may pass up to the first timer.
    pub(super) has_timer: bool,
    /// The tasks that may be asked to end, by the choices after these.
    pub(super) aborts: &'a [TaskId],
    /// The choices beside the first that a search has to try; `None` for all.
    pub(super) tried: Option<&'a [u32]>,
}

impl Runnable<'_> {
    /// Returns the number of choices.
    pub(super) fn count(&self) -> u32 {
        let others = u32::from(self.has_timer) + self.aborts.len() as u32;
        self.ways.unwrap_or(self.tasks.len() as u32 + others)
    }

    /// Returns the task that this choice asks to end.
    pub(super) fn abort(&self, choice: u32) -> Option<TaskId> {
        let before = self.tasks.len() + usize::from(self.has_timer);
        self.aborts.get((choice as usize).checked_sub(before)?).copied()
    }
}

/// A choice of a schedule other than the first one that was possible.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Switch {
    /// A task that could have gone on had to stop, and another one went on.
    Preemption {
        /// The task that stopped, and the place of the program before which it stood.
        stopped: StandingTask,
        /// The task that went on, and from where.
        next: StandingTask,
    },
    /// No task was running, and another one than the oldest went on.
    Order {
        /// The oldest task that could have gone on.
        oldest: StandingTask,
        /// The task that went on.
        next: StandingTask,
    },
    /// An operator has asked a task to end.
    Abort {
        /// The task.
        task: StandingTask,
    },
    /// Time has passed, up to the first timer, before a task went on.
    Timer {
        /// The task that could have gone on.
        task: StandingTask,
        /// Nanoseconds that have passed.
        passed: u64,
    },
    /// A restart of the durable run has interrupted a call of an operation.
    Restart {
        /// The task that performs the call.
        task: StandingTask,
        /// Whether the call has had its effect.
        is_behind: bool,
    },
    /// `choose` has taken another form than its first.
    Choice {
        /// The task that has asked.
        task: StandingTask,
        /// Number of the form, from 0 on.
        form: u32,
    },
}

/// An event of a schedule, as reports show it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ScheduleStep {
    /// Time of the machine's clock, in nanoseconds.
    pub time: u64,
    /// The event.
    pub event: ScheduleEvent,
}

/// A choice of a schedule, or what a task does between two of them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ScheduleEvent {
    /// A choice other than the first one that was possible.
    Switch(Switch),
    /// A task goes on at a point before an action that others can see: a signal, a wait, a change of facts.
    Step(StandingTask),
    /// A task goes on to its end.
    End(StandingTask),
    /// A task has read or set a place that others may reach: a special variable of the program that it has
    /// not bound, or a part of an object.
    Use {
        /// Name of the task in reports.
        task: String,
        /// Name of the place: of a variable, or a part of an object.
        target: String,
        /// The value, as a short text; empty if it is not known.
        value: String,
        /// Whether the place was set.
        is_set: bool,
        /// Place in the program, as `file:line:column`, if it was compiled with points.
        place: Option<String>,
    },
}

/// Is told what happens in a schedule.
pub type TellStep<'a> = dyn FnMut(ScheduleStep) + 'a;

/// A task at a place of the program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StandingTask {
    /// Name of the task in reports.
    pub label: String,
    /// Where it stands, as `file:line:column`, if it has begun.
    pub place: Option<String>,
}

impl StandingTask {
    fn of(vm: &Vm, index: TaskIndex) -> StandingTask {
        let Some(task) = vm.scheduler.tasks.at(index) else {
            return StandingTask { label: "a task".into(), place: None };
        };
        StandingTask { label: task_label(vm, task.object), place: program_place(vm, task) }
    }
}

/// Tells of the point at which a task stands that goes on.
pub(super) fn tell_step(vm: &Vm, index: TaskIndex, told: &mut TellStep<'_>) {
    let Some(task) = vm.scheduler.tasks.at(index).filter(|task| task.flags.at_point()) else { return };
    let standing = StandingTask::of(vm, index);
    let event = if task.control.is_unwinding() {
        ScheduleEvent::End(standing)
    } else if standing.place.is_none() || stands_before_use(vm, task) {
        return;
    } else {
        ScheduleEvent::Step(standing)
    };
    told(ScheduleStep { time: vm.scheduler.clock.now, event });
}

/// Returns whether a task stands at an instruction `point`, which says nothing by itself.
fn stands_before_use(vm: &Vm, task: &Task) -> bool {
    let word = Frames::of_task(task).next().and_then(|frame| {
        let words = vm.heap.code_words(vm.heap.function_code(frame.function)?)?;
        words.get(frame.word).copied()
    });
    word.is_some_and(|word| Word(word).opcode() == Some(Opcode::Point))
}

/// Returns the name of a place that is a part of an object.
fn part_name(vm: &mut Vm, object: Value, part: &str) -> String {
    let known = |name: &str, vm: &Vm| vm.scheduler.points.objects.iter().any(|(_, other)| other == name);
    let is_box = vm.heap.is(object, Kind::Box);
    let named = vm.scheduler.points.objects.iter().find(|(other, _)| *other == object);
    let name = match named {
        Some((_, name)) => name.clone(),
        None => {
            let noun = match vm.heap.kind(object) {
                None => "pair".into(),
                Some(Kind::Symbol) => describe(&vm.heap, object),
                Some(Kind::Box) => part.to_owned(),
                Some(Kind::String) => "string".into(),
                Some(Kind::SimpleVector) => "vector".into(),
                Some(Kind::HashTable) => "table".into(),
                Some(Kind::Structure) => {
                    let class = vm.heap.structure_class(object).unwrap_or(Value::NIL);
                    describe(&vm.heap, class::name_of(&vm.heap, class))
                }
                Some(_) => "array".into(),
            };
            let is_whole = is_box || vm.heap.is(object, Kind::Symbol);
            let mut name = if is_whole { noun.clone() } else { format!("{noun} 1") };
            let mut number = 1;
            while known(&name, vm) {
                number += 1;
                name = format!("{noun} {number}");
            }
            vm.scheduler.points.objects.push((object, name.clone()));
            name
        }
    };
    if is_box { name } else { format!("{part} of {name}") }
}

/// Tells of the uses of places since the last point.
pub(super) fn tell_uses(vm: &mut Vm, told: &mut TellStep<'_>) {
    vm.scheduler.points.place = None;
    let uses = vm.scheduler.points.uses.as_mut().map(std::mem::take).unwrap_or_default();
    if uses.is_empty() {
        return;
    }
    let mut is_of_program = vec![false; uses.len()];
    vm.names.each_symbol(&mut |symbol, object| {
        for (used, is_of_program) in uses.iter().zip(&mut is_of_program) {
            // Names that begin with `%` are those of the library's machinery, such as the object of a fluent.
            *is_of_program |= used.target == UsedPlace::Variable(object)
                && !is_of_library(symbol)
                && !symbol.name().starts_with('%');
        }
    });
    for (SharedUse { task, target, value, is_set, place }, is_of_program) in
        uses.into_iter().zip(is_of_program)
    {
        let target = match target {
            UsedPlace::Variable(symbol) if is_of_program => describe(&vm.heap, symbol),
            UsedPlace::Variable(_) => continue,
            UsedPlace::Part { object, part } => part_name(vm, object, &part),
        };
        let object = vm.scheduler.tasks.iter().find(|other| other.number == task);
        let object = object.map_or(Value::NIL, |task| task.object);
        let event = ScheduleEvent::Use { task: task_label(vm, object), target, value, is_set, place };
        told(ScheduleStep { time: vm.scheduler.clock.now, event });
    }
}

/// Returns whether a symbol belongs to the library.
pub(super) fn is_of_library(symbol: &Symbol) -> bool {
    [CL_PACKAGE, ESL_PACKAGE, KEYWORD_PACKAGE].iter().any(|name| symbol.is_in(name))
}

/// Describes a choice that is not the first.
pub(super) fn switch(vm: &mut Vm, runnable: Runnable<'_>, choice: u32) -> Switch {
    if let Some(id) = runnable.abort(choice) {
        return Switch::Abort { task: StandingTask::of(vm, id.index) };
    }
    let first = StandingTask::of(vm, runnable.tasks.first().copied().unwrap_or(TaskIndex::NONE));
    if runnable.ways.is_some() {
        return match vm.scheduler.points.asked_for {
            AskedFor::Form => Switch::Choice { task: first, form: choice },
            AskedFor::RestartBefore => Switch::Restart { task: first, is_behind: false },
            AskedFor::RestartBehind => Switch::Restart { task: first, is_behind: true },
        };
    }
    if choice as usize == runnable.tasks.len() && runnable.has_timer {
        let now = vm.scheduler.clock.now;
        let passed = vm.scheduler.first_timer().map_or(0, |time| time.saturating_sub(now));
        return Switch::Timer { task: first, passed };
    }
    let next = StandingTask::of(vm, runnable.tasks[choice as usize % runnable.tasks.len()]);
    match runnable.has_last {
        true => Switch::Preemption { stopped: first, next },
        false => Switch::Order { oldest: first, next },
    }
}
