//! Exploration: running a program under every schedule, to find those that end badly or to show that there is
//! none.
//!
//! ```text
//! point         where a task may have to let others go first, and running from point to point
//! check         conditions that hold in each state
//! fingerprint   telling states apart           content  visiting the fields that belong to a state
//! digest        hashes of states               numbers  objects in the order in which they are met
//! live          which registers of a frame belong to a state
//! search        the tree of choices, and the states found     set       the states, by fingerprint
//! trace         one run of the search, and taking in what it has come by
//! worker        this thread, or several, among which the runs are divided
//! keep          returning to places of that tree                       outcome  the results of a search
//! left_out      points that make no difference, and what shows that they do
//! livelock      ways round that are fair to all
//! symmetry      tasks that can be exchanged
//! random        runs by random priorities
//! ```
//!
//! **Points.** A task is assumed to run undisturbed from one *point* to the next. It stands at a point just
//! before it does something that other tasks can see: before it begins a wait, signals, passes a checkpoint,
//! changes the database, enters a critical section, asks for an abort, and before its end; with
//! [`Grain::Reads`] also before it looks at what others do: before it counts signals, asks what became of a
//! task, or queries the database; with [`Grain::Variables`] also at a tick after it has used a special
//! variable, and at each tick inside of a cleanup form or a limit, where an abort or the end of the limit
//! depends on the place; with [`Grain::Ticks`] at every tick. Nothing between two points is visible to other
//! tasks by these means, so every schedule of the machine behaves like one of those explored. Places that
//! tasks share otherwise (slots, elements, pairs, tables, variables that closures share) are seen only with
//! [`Grain::Ticks`], unless all uses of them are in critical sections, which are one step each. A caller that
//! calls a search complete has to know that the program has none. Where a program itself chooses, by
//! `choose`, each way is tried. A task that reaches no point is stopped after [`Settings::turn`] ticks.
//!
//! **Points that are left out.** A search at grain `variables` begins without points that rarely matter, and
//! begins again with those that a run has shown to be needed (see `left_out`). The choices of its findings
//! have those at the points that were left out, too, so [`Vm::follow`] need not know them.
//!
//! **Choices.** At each point any runnable task may continue, whatever its priority (every task has a turn at
//! some time). The task that has just run comes first, then the others from the oldest to the newest; a
//! choice is an index into that order, and a list of choices determines a schedule: [`Vm::follow`] runs it
//! again. Time is virtual, and moves when all tasks wait; with [`TimerGrain::Any`], letting it move to the
//! first timer is the last choice at each point. With [`Settings::aborts`], an operator may ask a task to
//! end: a choice for each task, at each point, also while all tasks wait.
//!
//! **Search.** The machine goes back to a point where another choice was possible, takes that one, and
//! continues until it ends or reaches a known state. Going back means restoring a snapshot of that point;
//! where memory had no room for it, or there could be none, of one before it, or of the beginning, from where
//! the machine follows the choices. The search proceeds by the number of preemptions (points at which a task
//! had to give way although it could have continued), so the first schedule that leads to an ending is one
//! with the fewest preemptions. Runs are made in batches, each with the states that were known before it, and
//! taken in in order: what is found does not depend on how many threads take part.
//!
//! **States** are told apart by fingerprints of 128 bits (see `fingerprint`). We accept the risk of a
//! fingerprint collision; exploring a state twice only costs time.
//!
//! Not here: the outside (contents of files, input that was read); making machines and judging how their runs
//! ended, which are up to the caller.
//!
//! Source: Musuvathi and Qadeer 2007 for the order by preemptions; state hashes are as old as SPIN (Holzmann
//! 1988).

mod check;
mod content;
mod digest;
mod fingerprint;
mod follow;
mod keep;
mod left_out;
mod live;
mod livelock;
mod numbers;
mod outcome;
mod point;
mod random;
mod search;
mod set;
mod step;
mod symmetry;
mod tasks;
#[cfg(test)]
mod tests;
mod trace;
mod worker;

use std::sync::atomic::AtomicBool;
use std::sync::{PoisonError, RwLock};

use crate::run::RunOutcome;
pub use crate::schedule::Grain;
use crate::vm::Vm;
pub use follow::FollowedRun;
use left_out::{Searches, ShownPoints};
pub use outcome::{Exploration, ExploredEnding, Livelock, SearchLimit, SearchProgress, UnmetCondition};
pub use random::{RandomRun, RandomSchedule};
use search::Search;
pub use step::{ScheduleEvent, ScheduleStep, StandingTask, Switch, TellStep};
use trace::{MergePlace, Merged, Merging, TraceEnd};
use worker::{RunPlace, SingleWorker, WorkerPool, Workers};

/// When timers fire in an exploration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TimerGrain {
    /// When all tasks wait: what tasks do takes no time.
    #[default]
    Idle,
    /// At any point: what tasks do may take as long as the first timer takes.
    Any,
}

impl TimerGrain {
    /// Both.
    pub const ALL: [TimerGrain; 2] = [TimerGrain::Idle, TimerGrain::Any];

    /// Returns the name, as commands, tests and schedules write it.
    pub const fn name(self) -> &'static str {
        match self {
            TimerGrain::Idle => "idle",
            TimerGrain::Any => "any",
        }
    }

    /// Returns the one of this name.
    pub fn from_name(name: &str) -> Option<TimerGrain> {
        TimerGrain::ALL.into_iter().find(|timers| timers.name() == name)
    }
}

/// The schedules without an end that count as findings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Fairness {
    /// Those that are fair: each task that could go on all along goes on at some time, time passes if it
    /// could all along, and each alternative of a `choose` is taken. The machine's own scheduler is fair.
    #[default]
    Weak,
    /// All.
    None,
}

/// Settings of an exploration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Where points are.
    pub grain: Grain,
    /// When timers fire.
    pub timers: TimerGrain,
    /// Ticks after which a task that reaches no point is stopped.
    pub turn: u32,
    /// Number of states at which the search gives up.
    pub states: usize,
    /// Bytes that the search may take, beside one machine: for snapshots as long as there is room for them
    /// beside the states. When these alone have no room, the search gives up.
    pub memory: usize,
    /// Whether snapshots of machines are taken. Without them, a new machine begins each run.
    pub snapshots: bool,
    /// Most preemptions of a schedule; more are not tried.
    pub switches: Option<usize>,
    /// Most choices of a schedule, by `choose`, that are not the first form; more are not tried.
    pub faults: Option<usize>,
    /// Whether states also differ by what was written to standard output. Without this, an ending stands for
    /// all runs that passed through the same states, whatever they had written before.
    pub output: bool,
    /// Whether tasks also stop before each use of a place that others may reach, in a program that was
    /// compiled with points.
    pub strict: bool,
    /// Whether points are left out, at grain `variables`, until a run has shown that they are needed. The
    /// findings are the same without, in more states.
    pub reduce: bool,
    /// Whether states also differ by the time, because the program reads the clock. Without this, times are
    /// relative to the time of the state. At grain `ticks`, states always differ by it.
    pub clock: bool,
    /// Whether states also differ by how often each event was signalled, because the program counts signals.
    pub counts: bool,
    /// Whether states also differ by the columns of the outputs, because the program looks at one.
    pub columns: bool,
    /// Whether states also differ by the numbers of tasks. A search begins again with this when the program
    /// has looked at one.
    pub numbers: bool,
    /// Whether states that differ only by which of several like tasks is which are one state. A search begins
    /// again without this when the program has looked at the order of tasks, and to judge of schedules that
    /// go on for ever.
    pub symmetry: bool,
    /// The schedules without an end that count.
    pub fairness: Fairness,
    /// Most aborts of a schedule by an operator, who may ask any task of the program to end, at any point.
    pub aborts: u32,
    /// Most restarts of a schedule, which the library has interrupt calls of mocks and scripts.
    pub crashes: u32,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings {
            grain: Grain::Variables,
            timers: TimerGrain::Idle,
            turn: 100_000,
            states: 1_000_000,
            memory: 1 << 29,
            snapshots: true,
            switches: None,
            faults: None,
            output: true,
            strict: false,
            reduce: true,
            clock: false,
            counts: false,
            columns: false,
            numbers: false,
            symmetry: false,
            fairness: Fairness::Weak,
            aborts: 0,
            crashes: 0,
        }
    }
}

impl Settings {
    /// Returns the settings of a search that leaves no points out. At a tick a task may hold a time that the
    /// library has read, as the deadline of a sleep; so where ticks are points, states differ by the time.
    fn with_all_points(&self) -> Settings {
        let clock = self.clock || self.grain == Grain::Variables;
        Settings { reduce: false, clock, ..*self }
    }
}

/// A program as a search runs it: how a machine is begun, and what is said of the end of its run.
trait Subject {
    type Ending;
    type Error;

    /// Makes a machine that is about to run the program.
    fn begin(&mut self) -> Result<Vm, Self::Error>;

    /// Describes how a run has ended.
    fn judge(&mut self, machine: &mut Vm, outcome: RunOutcome) -> Self::Ending;
}

impl<S: Subject> Subject for &mut S {
    type Ending = S::Ending;
    type Error = S::Error;

    fn begin(&mut self) -> Result<Vm, S::Error> {
        (**self).begin()
    }

    fn judge(&mut self, machine: &mut Vm, outcome: RunOutcome) -> S::Ending {
        (**self).judge(machine, outcome)
    }
}

/// A subject of two functions, and what the first tells the second of the machine.
struct TwoFunctions<C, B, J> {
    present: Option<C>,
    begin: B,
    judge: J,
}

impl<C, T, E, B, J> Subject for TwoFunctions<C, B, J>
where
    B: FnMut() -> Result<(Vm, C), E>,
    J: FnMut(&mut Vm, &C, RunOutcome) -> T,
{
    type Ending = T;
    type Error = E;

    fn begin(&mut self) -> Result<Vm, E> {
        let (machine, present) = (self.begin)()?;
        self.present = Some(present);
        Ok(machine)
    }

    fn judge(&mut self, machine: &mut Vm, outcome: RunOutcome) -> T {
        let present = self.present.as_ref().expect("a machine that has run was begun");
        (self.judge)(machine, present, outcome)
    }
}

/// Runs a program under all schedules. Each machine made by `begin` is about to run it: its main task exists.
/// `judge` describes how a run has ended.
///
/// The machines must be alike: the same program, settings and outside. The clocks of their hosts are virtual.
///
/// # Errors
/// Those of `begin`.
pub fn explore<T: PartialEq + Clone, E>(
    settings: &Settings,
    mut begin: impl FnMut() -> Result<Vm, E>,
    mut judge: impl FnMut(&mut Vm, RunOutcome) -> T,
) -> Result<Exploration<T>, E> {
    let begin = || Ok((begin()?, ()));
    explore_while(settings, begin, |machine, (), outcome| judge(machine, outcome), |_| true)
}

/// As [`explore`], for as long as `goes_on`, which is asked before each run and in each new state. `begin`
/// also returns what `judge` has to know of the machine.
///
/// # Errors
/// Those of `begin`.
pub fn explore_while<C, T: PartialEq + Clone, E>(
    settings: &Settings,
    begin: impl FnMut() -> Result<(Vm, C), E>,
    judge: impl FnMut(&mut Vm, &C, RunOutcome) -> T,
    goes_on: impl FnMut(&SearchProgress) -> bool,
) -> Result<Exploration<T>, E> {
    let mut subject = TwoFunctions { present: None, begin, judge };
    let mut goes_on = goes_on;
    let mut searches = Searches::new(settings);
    loop {
        let (settings, needed) = searches.next();
        let search = RwLock::new(Search::default());
        let mut alone = SingleWorker::new((&settings, &needed), &search, &mut subject);
        match search_by(&settings, &search, &mut alone, &mut goes_on)? {
            Ok(found) if searches.is_last(&found) => return Ok(found),
            Ok(_) => {}
            Err(shown) => searches.learn(shown),
        }
    }
}

/// Calls functions in threads of their own and the last one in this thread, and waits for all of them.
pub type SideBySide<'f> = dyn Fn(Vec<Box<dyn FnOnce() + Send + '_>>, &mut dyn FnMut()) + 'f;

/// As [`explore_while`], in so many threads, which are made by `side_by_side`. The findings and their order
/// are the same for any number. `goes_on` is asked now and then.
///
/// # Errors
/// Those of `begin`.
pub fn explore_together<C, T: PartialEq + Clone + Send, E: Send>(
    settings: &Settings,
    (jobs, side_by_side): (usize, &SideBySide<'_>),
    begin: impl Fn() -> Result<(Vm, C), E> + Sync,
    judge: impl Fn(&mut Vm, &C, RunOutcome) -> T + Sync,
    mut goes_on: impl FnMut(&SearchProgress) -> bool,
) -> Result<Exploration<T>, E> {
    if jobs <= 1 {
        return explore_while(settings, begin, judge, goes_on);
    }
    let subject = || TwoFunctions { present: None, begin: &begin, judge: &judge };
    let mut searches = Searches::new(settings);
    loop {
        let (settings, needed) = searches.next();
        let (search, stop) = (RwLock::new(Search::default()), AtomicBool::new(false));
        let (pool, works) = WorkerPool::new(jobs, (&settings, &needed), (&search, &stop), &subject);
        let (mut pool, mut found) = (Some(pool), None);
        side_by_side(works, &mut || {
            // The threads end when the pool is dropped.
            if let Some(mut pool) = pool.take() {
                found = Some(search_by(&settings, &search, &mut pool, &mut goes_on));
            }
        });
        match found.expect("the last function was called")? {
            Ok(found) if searches.is_last(&found) => return Ok(found),
            Ok(_) => {}
            Err(shown) => searches.learn(shown),
        }
    }
}

/// Runs of a batch: few enough that the shortest schedules come first, and enough for all threads.
const BATCH: usize = 64;

/// Searches with the help of workers; `Err` if points that are left out have shown to be needed.
fn search_by<T: PartialEq + Clone, E>(
    settings: &Settings,
    search: &RwLock<Search>,
    workers: &mut dyn Workers<T, E>,
    goes_on: &mut dyn FnMut(&SearchProgress) -> bool,
) -> Result<Result<Exploration<T>, ShownPoints>, E> {
    let write = || search.write().unwrap_or_else(PoisonError::into_inner);
    write().begin();
    let mut endings: Vec<ExploredEnding<T>> = Vec::new();
    let (mut runs, mut limit) = (0, None);
    while !matches!(limit, Some(SearchLimit::States | SearchLimit::Memory | SearchLimit::Asked)) {
        let Some((switches, batch)) = write().next(BATCH) else { break };
        let progress = write().progress(runs, switches, endings.len());
        if !goes_on(&progress) {
            limit = Some(SearchLimit::Asked);
            break;
        }
        let places: Vec<RunPlace> =
            batch.into_iter().zip(runs as u64..).map(|(node, serial)| RunPlace { node, serial }).collect();
        let mut traces = workers.run(places.clone(), &mut |more| {
            goes_on(&SearchProgress { states: progress.states + more, ..progress })
        })?;
        let mut shown = ShownPoints::default();
        traces.iter_mut().for_each(|trace| shown.add(std::mem::take(&mut trace.shown)));
        if !shown.is_nothing() {
            return Ok(Err(shown));
        }
        let search = &mut *write();
        search.settled();
        for (number, &RunPlace { node, .. }) in places.iter().enumerate() {
            let mut merging = Merging { settings, limit: &mut limit, switches };
            let mut place = MergePlace::of(search, node);
            runs += 1;
            let (mut run, mut first) = (number, 0);
            let merged = loop {
                let steps = (places[run].serial, &*traces[run].steps, first);
                let merged = merging.take_in(search, &mut place, steps);
                match traces[run].end {
                    // This run would have gone on exactly like the other one.
                    TraceEnd::Joined(step) if merged == Merged::New => (run, first) = (step.0, step.1 + 1),
                    _ => break merged,
                }
            };
            search.close(node);
            match (merged, &mut traces[run].end) {
                (Merged::Over, _) => break,
                (Merged::Known, _) | (Merged::New, TraceEnd::Known | TraceEnd::Joined(_)) => {}
                (Merged::New, TraceEnd::Full) => limit = Some(SearchLimit::Memory),
                (Merged::New, TraceEnd::Stopped) => limit = Some(SearchLimit::Asked),
                (Merged::New, TraceEnd::Ended(what)) => {
                    search.last.extend(place.before);
                    match endings.iter_mut().find(|ending| ending.what == *what) {
                        Some(ending) => ending.runs += 1,
                        None => {
                            let choices = search.choices(place.node);
                            endings.push(ExploredEnding { what: what.clone(), choices, runs: 1 });
                        }
                    }
                }
            }
            if limit == Some(SearchLimit::Asked) {
                break;
            }
        }
    }
    let search = write();
    let ends = if limit.is_none() { search.ending() } else { vec![true; search.places.len()] };
    let stuck = ends.iter().position(|ends| !ends);
    let endless = stuck.map(|state| search.choices_to_state(state as u32));
    let (states, has_cycle) = (search.states.len(), search.has_cycle());
    // If tasks were exchanged, a way back to a state need not be one for each of them.
    let is_judged = has_cycle && !settings.symmetry;
    let livelock = if is_judged { search.livelock(settings, &ends) } else { None };
    let unmet = if is_judged { search.unmet(settings) } else { Vec::new() };
    Ok(Ok(Exploration { states, runs, endings, endless, livelock, unmet, has_cycle, limit }))
}
