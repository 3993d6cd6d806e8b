//! One run of a search: from a place of the tree to the end, or to a state that is known already.

use smallvec::SmallVec;

use super::Subject;
use super::keep::Keeper;
use super::left_out::{LeftOut, NeededPoints, ShownPoints};
use super::livelock::{NO_TASK, StateStep, StateTasks, StepCause, TIME};
use super::point::{PassedPoints, PointRun};
use super::search::{MadeChoice, ROOT, Search};
use super::step::Runnable;
use super::tasks::{living_tasks, time_at_ticks};
use super::worker::{ClaimedStep, Claims, RunPlace};
use super::{Grain, SearchLimit, Settings};
use crate::task::TaskNumber;
use crate::vm::Vm;

/// An odd number that spreads a time over a fingerprint.
const TIME_FACTOR: u128 = 0x9E37_79B9_7F4A_7C15_D6E8_FEB8_6659_FD93;

/// Another one, for the number of aborts.
const ABORTS_FACTOR: u128 = 0xC2B2_AE3D_27D4_EB4F_1656_67B1_9E37_79F9;

/// Bytes that a step of a run takes until the search has taken it in, about.
const STEP_BYTES: usize = 176;

/// A state that a run has come to.
#[derive(Clone, Debug)]
pub(super) struct TraceStep {
    /// Its fingerprint.
    pub(super) state: u128,
    /// Number of choices there.
    pub(super) count: u32,
    /// The choices beside the first that are to be tried; `None` for all.
    pub(super) tried: Option<SmallVec<[u32; 4]>>,
    /// Choices at points that were left out on the way.
    pub(super) left: Vec<u32>,
    /// Whether the first of them lets the task go on that ran last.
    pub(super) has_last: bool,
    /// Whether the program itself chooses.
    pub(super) has_ways: bool,
    /// The tasks there.
    pub(super) tasks: StateTasks,
    /// The bits of the conditions that are still to become true.
    pub(super) pending: u64,
    /// The cause of the step to it.
    pub(super) cause: StepCause,
}

/// The tasks at a point, and the choice there.
struct TasksAtPoint {
    /// The tasks that are there, oldest first.
    numbers: SmallVec<[TaskNumber; 16]>,
    /// Whether the program itself chooses.
    has_ways: bool,
    /// Whether the choice was to let time pass.
    passes_time: bool,
    choice: u32,
    /// The task that was chosen.
    chosen: TaskNumber,
    /// Whether a task was asked to end.
    is_abort: bool,
}

impl TasksAtPoint {
    fn of(vm: &mut Vm, run: &PointRun, runnable: Runnable<'_>) -> (TasksAtPoint, StateTasks) {
        let (numbers, mut able) = living_tasks(vm);
        if vm.scheduler.first_timer().is_some() {
            able |= 1 << TIME;
        }
        let last = rank(&numbers, run.last());
        let ways = runnable.ways.map_or(0, |ways| u16::try_from(ways).unwrap_or(u16::MAX));
        let has_ways = runnable.ways.is_some();
        let has_aborts = !runnable.aborts.is_empty();
        let tasks = StateTasks { able, ways, has_aborts, last, left: 0 };
        let mut here = TasksAtPoint {
            numbers,
            has_ways,
            passes_time: false,
            choice: 0,
            chosen: run.last(),
            is_abort: false,
        };
        here.choose(vm, runnable, 0);
        (here, tasks)
    }

    /// Notes the choice that is made here.
    fn choose(&mut self, vm: &Vm, runnable: Runnable<'_>, choice: u32) {
        let is_timer = choice as usize == runnable.tasks.len();
        (self.passes_time, self.choice) = (!self.has_ways && runnable.has_timer && is_timer, choice);
        let chosen = if self.has_ways { runnable.tasks.first() } else { runnable.tasks.get(choice as usize) };
        let task = chosen.and_then(|&index| vm.scheduler.tasks.at(index));
        self.chosen = task.map_or(TaskNumber::NONE, |task| task.number);
        self.is_abort = !self.has_ways && runnable.abort(choice).is_some();
    }

    /// Returns what has led from here to another point, at which these tasks are: this one has run last, and
    /// points were left out.
    fn cause(&self, numbers: &[TaskNumber], last: TaskNumber, passed: &PassedPoints) -> StepCause {
        let rank_of = |task| rank(&self.numbers, task);
        let chosen = if self.passes_time { TIME } else { rank_of(self.chosen) };
        let bit = |rank: u8| if rank <= TIME { 1_u64 << rank } else { 0 };
        let others = passed.tasks.iter().fold(0, |all, &task| all | bit(rank_of(task)));
        StepCause {
            chosen,
            last: rank_of(last),
            ran: bit(chosen) | others,
            way: if self.has_ways { u16::try_from(self.choice).unwrap_or(u16::MAX) } else { 0 },
            // There are only so many aborts, so none is on a cycle.
            keeps_tasks: !self.is_abort && self.numbers[..] == *numbers && numbers.len() <= usize::from(TIME),
        }
    }
}

/// Returns the rank of a task among others.
fn rank(numbers: &[TaskNumber], task: TaskNumber) -> u8 {
    let rank = numbers.binary_search(&task).ok().and_then(|rank| u8::try_from(rank).ok());
    rank.filter(|&rank| rank < TIME).unwrap_or(NO_TASK)
}

/// How a run of the search has ended.
#[derive(Debug)]
pub(super) enum TraceEnd<T> {
    /// As the program ends.
    Ended(T),
    /// In a state that was known before.
    Known,
    /// In the state to which another run of the batch has come by this step, and in the same way: what that
    /// run goes on with belongs to this one, too.
    Joined(ClaimedStep),
    /// For want of room.
    Full,
    /// When it was asked to.
    Stopped,
}

/// The course of a run.
#[derive(Debug)]
pub(super) struct RunTrace<T> {
    pub(super) steps: Vec<TraceStep>,
    pub(super) end: TraceEnd<T>,
    /// The points that it has shown to be needed.
    pub(super) shown: ShownPoints,
}

/// A machine of a search with its places, and the subject that began it.
pub(super) struct Tracer<'a, S> {
    settings: &'a Settings,
    needed: &'a NeededPoints,
    keeper: Keeper<'a>,
    subject: S,
}

impl<'a, S: Subject> Tracer<'a, S> {
    /// Creates a tracer that may take so many bytes for snapshots.
    pub(super) fn new(
        (settings, needed): (&'a Settings, &'a NeededPoints),
        memory: usize,
        subject: S,
    ) -> Tracer<'a, S> {
        Tracer { settings, needed, keeper: Keeper::new(settings, memory), subject }
    }

    /// Takes note of what the search has made of the last batch.
    pub(super) fn settle(&mut self, search: &Search) {
        self.keeper.settle(search);
    }

    /// Whether the machine returns to this place by a snapshot of it.
    pub(super) fn is_near(&self, search: &Search, place: RunPlace) -> bool {
        self.keeper.has(search.nodes[place.node as usize].parent)
    }

    /// Runs on from a place: as this run of the batch, which have claimed states.
    ///
    /// # Errors
    /// Those of the subject.
    pub(super) fn run(
        &mut self,
        search: &Search,
        place: RunPlace,
        (number, claims): (usize, &Claims),
        goes_on: &mut dyn FnMut() -> bool,
    ) -> Result<RunTrace<S::Ending>, S::Error> {
        let Tracer { settings, needed, keeper, subject } = self;
        let (mut machine, mut run, choices) = keeper.go_to(search, place.node, || subject.begin())?;
        let parent = search.nodes[place.node as usize].parent;
        let mut given = choices.into_iter();
        let mut steps: Vec<TraceStep> = Vec::new();
        let mut end = TraceEnd::Known;
        let mut before: Option<TasksAtPoint> = None;
        let most = settings.states.min(settings.memory / STEP_BYTES);
        let leaves_out = settings.reduce && settings.grain == Grain::Variables;
        let mut left_out = leaves_out.then(|| LeftOut::new(needed));
        let outcome = run.go_on(&mut machine, u64::MAX, left_out.as_mut(), &mut |vm, run, runnable| {
            if given.len() == 1 && runnable.count() > 1 {
                keeper.keep_on_the_way(vm, run.clone(), search, parent);
            }
            if runnable.count() > 1
                && let Some(choice) = given.next()
            {
                if given.len() == 0 {
                    let (mut here, _) = TasksAtPoint::of(vm, &run, runnable);
                    here.choose(vm, runnable, choice);
                    before = Some(here);
                }
                return Some(choice);
            }
            if given.len() > 0 {
                return Some(0);
            }
            let mut state = keeper.fingerprints.of(vm) ^ u128::from(run.has_open_action(vm));
            let order = keeper.fingerprints.order;
            if settings.aborts > 0 {
                state ^= u128::from(run.aborts()).wrapping_mul(ABORTS_FACTOR);
            }
            if needed.has_targets() || settings.aborts > 0 {
                state ^= u128::from(time_at_ticks(vm)).wrapping_mul(TIME_FACTOR);
            }
            // A task that went first has done nothing yet: others that go before it do not stop it.
            let has_last = runnable.has_last && !run.passed().tasks.contains(&run.last());
            let count = runnable.count();
            let (here, tasks) = TasksAtPoint::of(vm, &run, runnable);
            let unknown = StepCause { chosen: NO_TASK, last: NO_TASK, ran: 0, way: 0, keeps_tasks: false };
            let cause = before
                .as_ref()
                .map_or(unknown, |before| before.cause(&here.numbers, run.last(), run.passed()));
            before = Some(here);
            let (has_ways, pending) = (runnable.ways.is_some(), run.pending(vm));
            let (tried, left) = (runnable.tried.map(SmallVec::from_slice), run.passed().choices.clone());
            steps.push(TraceStep { state, count, tried, left, has_last, has_ways, tasks, pending, cause });
            end = if search.states.contains(state) {
                TraceEnd::Known
            } else if let Some(step) = claims.claim((state, run.last(), order), (number, steps.len() - 1)) {
                TraceEnd::Joined(step)
            } else if !goes_on() {
                TraceEnd::Stopped
            } else if steps.len() >= most {
                TraceEnd::Full
            } else {
                if count > 1 {
                    keeper.keep(vm, run, (place.serial, steps.len() - 1));
                }
                return Some(0);
            };
            None
        });
        if let Some(outcome) = outcome {
            end = TraceEnd::Ended(subject.judge(&mut machine, outcome));
        }
        let mut shown = left_out.map_or_else(ShownPoints::default, |left_out| left_out.shown);
        shown.numbers = machine.scheduler.points.sees_numbers && !settings.numbers;
        shown.order = machine.scheduler.points.sees_order && settings.symmetry;
        keeper.take_back(machine);
        Ok(RunTrace { steps, end, shown })
    }
}

/// Merges the runs of a batch into the search.
pub(super) struct Merging<'a> {
    pub(super) settings: &'a Settings,
    /// The limit that has kept the search from trying everything.
    pub(super) limit: &'a mut Option<SearchLimit>,
    /// Preemptions of the schedules that are tried.
    pub(super) switches: usize,
}

/// Where a run is taken in: the choices so far, and the state in which the last step began.
#[derive(Clone, Debug)]
pub(super) struct MergePlace {
    pub(super) node: u32,
    pub(super) before: Option<u32>,
    /// Choices at points that were left out since the last choice.
    pub(super) left: Vec<u32>,
}

/// The outcome of merging the steps of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Merged {
    /// They lead to a state that is known.
    Known,
    /// All are new: the run counts as it has ended.
    New,
    /// The search gives up.
    Over,
}

impl Merging<'_> {
    /// Takes in the steps of a run, from the one with number `first` on.
    pub(super) fn take_in(
        &mut self,
        search: &mut Search,
        place: &mut MergePlace,
        (serial, steps, first): (u64, &[TraceStep], usize),
    ) -> Merged {
        for (step, at) in steps.iter().zip(0..).skip(first) {
            let left = search.left.number(&step.left);
            place.left.extend_from_slice(&step.left);
            let tasks = StateTasks { left: search.left.number(&place.left), ..step.tasks };
            let (state, is_new) = search.state(step.state, place.node, tasks);
            if let Some(from) = place.before {
                search.steps.push(StateStep { from, to: state, cause: step.cause, left });
            }
            if !is_new {
                return Merged::Known;
            }
            search.note_pending(state, step.pending);
            place.before = Some(state);
            if search.places.len() >= self.settings.states {
                *self.limit = Some(SearchLimit::States);
                return Merged::Over;
            }
            if search.places.len().is_multiple_of(64) && search.bytes() > self.settings.memory {
                *self.limit = Some(SearchLimit::Memory);
                return Merged::Over;
            }
            if step.count > 1 {
                self.open(search, step, place, (serial, at));
            }
        }
        Merged::New
    }

    /// Opens the other choices of a state.
    fn open(&mut self, search: &mut Search, step: &TraceStep, place: &mut MergePlace, at: (u64, usize)) {
        // A preemption is a switch at which the task that has just run could have continued.
        let switches = self.switches + usize::from(step.has_last);
        let before = search.nodes[place.node as usize].faults;
        let faults = before + u32::from(step.has_ways);
        let (state, left) = (place.before.unwrap_or_default(), search.left.number(&place.left));
        if self.settings.switches.is_some_and(|most| switches > most) {
            *self.limit = self.limit.or(Some(SearchLimit::Switches));
        } else if self.settings.faults.is_some_and(|most| faults as usize > most) {
            *self.limit = self.limit.or(Some(SearchLimit::Faults));
        } else {
            for choice in (1..step.count).rev() {
                if step.tried.as_ref().is_none_or(|tried| tried.contains(&choice)) {
                    search.open(switches, (place.node, MadeChoice { choice, state, left }, faults));
                }
            }
        }
        search.placed.insert(at, place.node);
        place.node = search.node((place.node, MadeChoice { choice: 0, state, left }, before));
        place.left.clear();
    }
}

impl MergePlace {
    /// Returns where a run from a node is taken in.
    pub(super) fn of(search: &Search, node: u32) -> MergePlace {
        let before = (node != ROOT).then(|| search.nodes[node as usize].made.state);
        MergePlace { node, before, left: Vec::new() }
    }
}
