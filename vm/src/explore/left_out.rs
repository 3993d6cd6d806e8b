//! Points that a search at grain `variables` leaves out, and what shows that they are needed.
//!
//! A task has to give way between any two of its actions that others can see. Before most of them it stops:
//! then others may go before, which is as good as after the last one, since they see nothing of what lies
//! between. So the tick after an action is a point only if an action follows that has no point before it, a
//! *sudden* one: the use of a variable, a new task. And a variable matters only if it is in a race: if some
//! task sets it beside others. A constant is read by many, and a variable of the main task is set before
//! there are others.
//!
//! Neither is known at the beginning. A search begins with no such points and variables. A run that comes to
//! a sudden action, without a point since the last action, shows that the tick after that one is needed; one
//! that sets a variable beside other tasks shows that it is in a race. Then the search begins again, with
//! what was shown. The last one has shown nothing, so it has left out only what makes no difference.
//!
//! A task that has begun or was woken goes on first, alone, up to its first point: others see nothing of
//! that. If its way begins with a sudden action, the place where it stood is a point.
//!
//! A request to end or to leave a form, and an interrupt, depend on the place where they find a task, inside
//! of cleanup forms and limits, and where there are guards. A search notes the kinds of tasks that requests
//! reach, and the places at which tasks stop before they make them. Then a task of such a kind stops at each
//! of these ticks, but only those go on there that stand at such a place; all others might as well have gone
//! before the task began its way. So such a task has to have stopped after its last action, and does not go
//! first, alone. The place where an account of several tasks ends them depends on all their ticks: then the
//! next search leaves out nothing.
//!
//! Source: Lipton 1975 for actions that commute; Musuvathi and Qadeer 2007 for looking for races in the runs
//! of a search that relies on their absence.

use std::collections::{HashMap, HashSet};

use esl_bytecode::symbol::Symbol;

use super::digest::Digest;
use super::{Exploration, Settings};
use crate::fused::unfused;
use crate::interp::frames::Frames;
use crate::interp::start::first_code_of;
use crate::names::load::image_origin;
use crate::task::{AccountId, TaskIndex, TaskNumber};
use crate::value::Value;
use crate::vm::Vm;
use crate::wait::event;

/// A place of the program at which a tick lies: a word of a code. Functions with the same code share their
/// places, which costs states.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct TickPlace(u64);

impl TickPlace {
    /// Returns the place at which a task stands.
    pub(super) fn of(vm: &Vm, index: TaskIndex, codes: &mut CodeDigests) -> TickPlace {
        let frame = vm.scheduler.tasks.at(index).and_then(|task| Frames::of_task(task).next());
        let Some(frame) = frame else { return TickPlace(0) };
        let mut digest = Digest::default();
        digest.add(frame.word as u64);
        digest.add(codes.of(vm, frame.function));
        TickPlace(digest.0)
    }
}

/// A kind of tasks: those that have begun with the same code, and have the same name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct KindOfTask(u64);

impl KindOfTask {
    /// Returns the kind of a task.
    fn of(vm: &Vm, index: TaskIndex, codes: &mut CodeDigests) -> KindOfTask {
        let Some(task) = vm.scheduler.tasks.at(index) else { return KindOfTask(0) };
        let mut digest = Digest::default();
        digest.add(codes.of_code(vm, first_code_of(task)));
        let name = vm.heap.slot_or_nil(task.object, event::NAME);
        if let Some(symbol) = vm.names.name_of(&vm.heap, name) {
            let Digest(one, other) = Digest::of_symbol(&symbol);
            digest.add(one ^ other);
        }
        KindOfTask(digest.0)
    }
}

/// Digests of the codes of the program's functions, by their addresses in the course of a run: the next run
/// may have other codes there. Those of the library have numbers.
#[derive(Debug, Default)]
pub(super) struct CodeDigests {
    known: HashMap<u64, u64>,
    /// The collector's cycle in which the addresses are good.
    cycle: u64,
}

impl CodeDigests {
    fn of(&mut self, vm: &Vm, function: Value) -> u64 {
        if let Some((image, number)) = image_origin(&vm.heap, function) {
            let mut digest = Digest::default();
            digest.add_all([image as u64, u64::from(number)].into_iter());
            return digest.0;
        }
        vm.heap.function_code(function).map_or(0, |code| self.of_code(vm, code))
    }

    fn of_code(&mut self, vm: &Vm, code: Value) -> u64 {
        if self.cycle != vm.heap.cycle_id() {
            self.cycle = vm.heap.cycle_id();
            self.known.clear();
        }
        *self.known.entry(code.bits()).or_insert_with(|| {
            let mut digest = Digest::default();
            let words = unfused(vm.heap.code_words(code).unwrap_or_default());
            digest.add_all(words.into_iter().map(u64::from));
            digest.0
        })
    }
}

/// The points that the searches so far have shown to be needed.
#[derive(Clone, Debug, Default)]
pub(super) struct NeededPoints {
    /// Ticks after actions, and places at which tasks begin or are woken.
    pub(super) places: HashSet<TickPlace>,
    /// Variables in a race.
    pub(super) variables: HashSet<Symbol>,
    /// Places at which tasks stop before they make requests.
    requests: HashSet<TickPlace>,
    /// Kinds of tasks that requests reach.
    reached: HashSet<KindOfTask>,
    /// Kinds of tasks that requests reach while they could run.
    targets: HashSet<KindOfTask>,
    /// Whether timers that fire while tasks could run make requests.
    timers: bool,
}

impl NeededPoints {
    /// Returns whether requests reach tasks.
    pub(super) fn has_targets(&self) -> bool {
        !self.targets.is_empty()
    }
}

/// The points that runs have shown to be needed beyond these.
#[derive(Debug, Default)]
pub(super) struct ShownPoints {
    /// Whether all are needed: an account of several tasks was spent while one of them could run, or a
    /// variable in a race has no name.
    pub(super) needs_all: bool,
    pub(super) places: Vec<TickPlace>,
    pub(super) variables: Vec<Symbol>,
    /// Whether the program sees the numbers of tasks, and states do not differ by them.
    pub(super) numbers: bool,
    /// Whether the program sees the order of tasks, and like ones are exchanged.
    pub(super) order: bool,
    requests: Vec<TickPlace>,
    reached: Vec<KindOfTask>,
    targets: Vec<KindOfTask>,
    timers: bool,
}

impl ShownPoints {
    /// Adds what another run has shown.
    pub(super) fn add(&mut self, other: ShownPoints) {
        self.needs_all |= other.needs_all;
        self.numbers |= other.numbers;
        self.order |= other.order;
        self.places.extend(other.places);
        self.variables.extend(other.variables);
        self.requests.extend(other.requests);
        self.reached.extend(other.reached);
        self.targets.extend(other.targets);
        self.timers |= other.timers;
    }

    /// Returns whether nothing was shown.
    pub(super) fn is_nothing(&self) -> bool {
        let has_requests = !(self.requests.is_empty() && self.reached.is_empty() && self.targets.is_empty());
        let is_empty = self.places.is_empty() && !has_requests;
        let has_bits = self.needs_all || self.timers || self.numbers || self.order;
        is_empty && self.variables.is_empty() && !has_bits
    }
}

/// Points that a run leaves out, and what it shows.
#[derive(Debug)]
pub(super) struct LeftOut<'a> {
    pub(super) needed: &'a NeededPoints,
    pub(super) shown: ShownPoints,
    pub(super) codes: CodeDigests,
}

impl<'a> LeftOut<'a> {
    /// Creates the notes of a run, in a search that knows what is needed.
    pub(super) fn new(needed: &'a NeededPoints) -> LeftOut<'a> {
        LeftOut { needed, shown: ShownPoints::default(), codes: CodeDigests::default() }
    }

    /// Returns the place at which a task stands.
    pub(super) fn place(&mut self, vm: &Vm, index: TaskIndex) -> TickPlace {
        TickPlace::of(vm, index, &mut self.codes)
    }

    /// Returns whether requests reach tasks of the kind of this one.
    pub(super) fn is_reached(&mut self, vm: &Vm, index: TaskIndex) -> bool {
        !self.needed.reached.is_empty()
            && self.needed.reached.contains(&KindOfTask::of(vm, index, &mut self.codes))
    }

    /// Returns whether requests reach tasks of the kind of this one while they could run.
    pub(super) fn is_target(&mut self, vm: &Vm, index: TaskIndex) -> bool {
        self.needed.has_targets() && self.needed.targets.contains(&KindOfTask::of(vm, index, &mut self.codes))
    }

    /// Returns whether a task stands where tasks stop before they make requests.
    pub(super) fn may_request(&mut self, vm: &Vm, index: TaskIndex) -> bool {
        !self.needed.requests.is_empty() && self.needed.requests.contains(&self.place(vm, index))
    }

    /// Returns whether timers make requests that fire while tasks could run.
    pub(super) fn has_timer_requests(&self) -> bool {
        self.needed.timers
    }

    /// Takes from the machine which tasks were reached by requests of a task that has stopped at this place
    /// before; `None` for those of timers.
    pub(super) fn take_requests(&mut self, vm: &mut Vm, place: Option<TickPlace>) {
        for (index, could_run) in std::mem::take(&mut vm.scheduler.points.requested) {
            let kind = KindOfTask::of(vm, index, &mut self.codes);
            if !self.needed.reached.contains(&kind) {
                self.shown.reached.push(kind);
            }
            if !could_run {
                continue;
            }
            if !self.needed.targets.contains(&kind) {
                self.shown.targets.push(kind);
            }
            match place {
                Some(place) if self.needed.requests.contains(&place) => {}
                Some(place) => self.shown.requests.push(place),
                None => self.shown.timers |= !self.needed.timers,
            }
        }
    }

    /// Takes from the machine which variables it has found to be in a race.
    pub(super) fn take_variables(&mut self, vm: &mut Vm) {
        for object in std::mem::take(&mut vm.scheduler.points.found_raced) {
            match vm.names.name_of(&vm.heap, object) {
                Some(symbol) => self.shown.variables.push(symbol),
                // It has no name by which another machine knows it.
                None => self.shown.needs_all = true,
            }
        }
    }

    /// Returns the objects of the variables that are known to be in a race.
    pub(super) fn raced(&self, vm: &Vm) -> HashSet<u64> {
        let objects = self.needed.variables.iter().filter_map(|symbol| vm.names.symbols.get(symbol));
        objects.copied().map(Value::bits).collect()
    }
}

/// Most searches that begin again with more points, before one leaves out nothing.
const SEARCHES: u32 = 200;

/// The searches of an exploration, one after the other until one has shown nothing.
pub(super) struct Searches {
    settings: Settings,
    needed: NeededPoints,
    count: u32,
}

impl Searches {
    /// Creates the first search by these settings.
    pub(super) fn new(settings: &Settings) -> Searches {
        let settings = if settings.reduce { *settings } else { settings.with_all_points() };
        Searches { settings, needed: NeededPoints::default(), count: 0 }
    }

    /// Returns the settings of the next search, and what it has to know.
    pub(super) fn next(&self) -> (Settings, NeededPoints) {
        (self.settings, self.needed.clone())
    }

    /// Returns whether a search that was not interrupted is the last. One that exchanges tasks does not judge
    /// of schedules that go on for ever; if there are such, another search follows.
    pub(super) fn is_last<T>(&mut self, found: &Exploration<T>) -> bool {
        let is_last = !self.settings.symmetry || !found.has_cycle || found.limit.is_some();
        self.settings.symmetry &= is_last;
        is_last
    }

    /// Takes in what the last search has shown.
    pub(super) fn learn(&mut self, shown: ShownPoints) {
        self.count += 1;
        if shown.needs_all || self.count > SEARCHES {
            self.settings = self.settings.with_all_points();
        }
        self.settings.numbers |= shown.numbers;
        self.settings.symmetry &= !(shown.numbers || shown.order);
        self.needed.places.extend(shown.places);
        self.needed.variables.extend(shown.variables);
        self.needed.requests.extend(shown.requests);
        self.needed.reached.extend(shown.reached);
        self.needed.targets.extend(shown.targets);
        self.needed.timers |= shown.timers;
    }
}

/// Returns the position of a task that goes first, alone: it has begun or was woken, and others see nothing
/// of its way to its first point.
pub(super) fn first_alone(
    vm: &Vm,
    runnable: &[(bool, TaskNumber, TaskIndex)],
    left_out: &mut LeftOut<'_>,
) -> Option<usize> {
    runnable.iter().position(|&(_, _, index)| {
        let is_new = vm.scheduler.tasks.at(index).is_some_and(|task| {
            let flags = task.flags;
            let is_undisturbed = !flags.attention() && task.critical == 0 && task.account == AccountId::NONE;
            is_undisturbed && !flags.at_point() && !flags.at_tick()
        });
        is_new
            && !left_out.needed.places.contains(&left_out.place(vm, index))
            && !left_out.is_reached(vm, index)
    })
}
