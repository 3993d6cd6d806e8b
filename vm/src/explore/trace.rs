//! One run of a search: from a place of the tree to the end, or to a state that is known already.

use smallvec::SmallVec;

use super::Subject;
use super::keep::Keeper;
use super::left_out::{LeftOut, NeededPoints, ShownPoints};
use super::livelock::{NO_TASK, StateStep, StateTasks, StepCause, TIME};
use super::point::{PointRun, living_tasks};
use super::search::{MadeChoice, ROOT, Search};
use super::step::Runnable;
use super::worker::{ClaimedStep, Claims, RunPlace};
use super::{SearchLimit, Settings};
use crate::task::TaskNumber;
use crate::vm::Vm;

/// Bytes that a step of a run takes until the search has taken it in, about.
const STEP_BYTES: usize = 80;

/// A state that a run has come to.
#[derive(Clone, Copy, Debug)]
pub(super) struct TraceStep {
    /// Its fingerprint.
    pub(super) state: u128,
    /// Number of choices there.
    pub(super) count: u32,
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
}

impl TasksAtPoint {
    fn of(vm: &mut Vm, run: PointRun, runnable: Runnable<'_>) -> (TasksAtPoint, StateTasks) {
        let (numbers, mut able) = living_tasks(vm);
        if vm.scheduler.first_timer().is_some() {
            able |= 1 << TIME;
        }
        let last = rank(&numbers, run.last());
        let ways = runnable.ways.map_or(0, |ways| u16::try_from(ways).unwrap_or(u16::MAX));
        let has_ways = runnable.ways.is_some();
        let tasks = StateTasks { able, ways, last, skipped: run.skipped() };
        (TasksAtPoint { numbers, has_ways, passes_time: false, choice: 0 }, tasks)
    }

    /// Notes the choice that is made here.
    fn choose(&mut self, runnable: Runnable<'_>, choice: u32) {
        let is_last = choice as usize == runnable.tasks.len();
        (self.passes_time, self.choice) = (!self.has_ways && runnable.has_timer && is_last, choice);
    }

    /// Returns what has led from here to another point, at which these tasks are, after this one has run.
    fn cause(&self, numbers: &[TaskNumber], ran: TaskNumber) -> StepCause {
        StepCause {
            ran: if self.passes_time { TIME } else { rank(&self.numbers, ran) },
            way: if self.has_ways { u16::try_from(self.choice).unwrap_or(u16::MAX) } else { 0 },
            keeps_tasks: self.numbers[..] == *numbers && numbers.len() <= usize::from(TIME),
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
        let mut left_out = settings.reduce.then(|| LeftOut::new(needed));
        let outcome = run.go_on(&mut machine, u64::MAX, left_out.as_mut(), &mut |vm, run, runnable| {
            if given.len() == 1 && runnable.count() > 1 {
                keeper.keep_on_the_way(vm, run, search, parent);
            }
            if runnable.count() > 1
                && let Some(choice) = given.next()
            {
                if given.len() == 0 {
                    let (mut here, _) = TasksAtPoint::of(vm, run, runnable);
                    here.choose(runnable, choice);
                    before = Some(here);
                }
                return Some(choice);
            }
            if given.len() > 0 {
                return Some(0);
            }
            let state = keeper.fingerprints.of(vm) ^ u128::from(run.has_open_action(vm));
            let (count, has_last) = (runnable.count(), runnable.has_last);
            let (here, tasks) = TasksAtPoint::of(vm, run, runnable);
            let unknown = StepCause { ran: NO_TASK, way: 0, keeps_tasks: false };
            let cause = before.as_ref().map_or(unknown, |before| before.cause(&here.numbers, run.last()));
            before = Some(here);
            let (has_ways, pending) = (runnable.ways.is_some(), run.pending(vm));
            steps.push(TraceStep { state, count, has_last, has_ways, tasks, pending, cause });
            end = if search.states.contains(state) {
                TraceEnd::Known
            } else if let Some(step) = claims.claim((state, run.last()), (number, steps.len() - 1)) {
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
        keeper.take_back(machine);
        let shown = left_out.map_or_else(ShownPoints::default, |left_out| left_out.shown);
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
#[derive(Clone, Copy, Debug)]
pub(super) struct MergePlace {
    pub(super) node: u32,
    pub(super) before: Option<u32>,
    /// Number of points that were left out since the last choice.
    pub(super) skipped: u32,
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
            let skipped = step.tasks.skipped;
            place.skipped += skipped;
            let tasks = StateTasks { skipped: place.skipped, ..step.tasks };
            let (state, is_new) = search.state(step.state, place.node, tasks);
            if let Some(from) = place.before {
                search.steps.push(StateStep { from, to: state, cause: step.cause, skipped });
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
                self.open(search, *step, place, (serial, at));
            }
        }
        Merged::New
    }

    /// Opens the other choices of a state.
    fn open(&mut self, search: &mut Search, step: TraceStep, place: &mut MergePlace, at: (u64, usize)) {
        // A preemption is a switch at which the task that has just run could have continued.
        let switches = self.switches + usize::from(step.has_last);
        let before = search.nodes[place.node as usize].faults;
        let faults = before + u32::from(step.has_ways);
        let state = place.before.unwrap_or_default();
        if self.settings.switches.is_some_and(|most| switches > most) {
            *self.limit = self.limit.or(Some(SearchLimit::Switches));
        } else if self.settings.faults.is_some_and(|most| faults as usize > most) {
            *self.limit = self.limit.or(Some(SearchLimit::Faults));
        } else {
            for choice in (1..step.count).rev() {
                let choice = MadeChoice { choice, state, skipped: place.skipped };
                search.open(switches, (place.node, choice, faults));
            }
        }
        search.placed.insert(at, place.node);
        let choice = MadeChoice { choice: 0, state, skipped: place.skipped };
        place.node = search.node((place.node, choice, before));
        place.skipped = 0;
    }
}

impl MergePlace {
    /// Returns where a run from a node is taken in.
    pub(super) fn of(search: &Search, node: u32) -> MergePlace {
        let before = (node != ROOT).then(|| search.nodes[node as usize].made.state);
        MergePlace { node, before, skipped: 0 }
    }
}
