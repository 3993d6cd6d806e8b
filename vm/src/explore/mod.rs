//! Exploration: running a program under every schedule, to find those that end badly or to show that there is
//! none.
//!
//! ```text
//! point         where a task may have to let others go first, and running from point to point
//! fingerprint   telling states apart           content  visiting the fields that belong to a state
//! live          which registers of a frame belong to a state
//! search        the tree of choices, and the states found
//! keep          returning to places of that tree
//! ```
//!
//! **Points.** A task is assumed to run undisturbed from one *point* to the next. It stands at a point just
//! before it does something that other tasks can see: before it begins a wait, signals, passes a checkpoint,
//! changes the database, enters a critical section, asks for an abort, and before its end; with
//! [`Grain::Reads`] also before it looks at what others do: before it counts signals, asks what became of a
//! task, or queries the database. Nothing between two points is visible to other tasks by these means, so
//! every schedule of the machine behaves like one of those explored. State shared in other ways (variables,
//! tables, structures) is not considered: programs protect it by critical sections, which are one step each.
//! Where a program itself chooses, by `choose`, each way is tried.
//! A task that reaches no point is stopped after [`Settings::turn`] ticks.
//!
//! **Choices.** At each point any runnable task may continue, whatever its priority (every task has a turn at
//! some time). The task that has just run comes first, then the others from the oldest to the newest; a
//! choice is an index into that order, and a list of choices determines a schedule: [`Vm::follow`] runs it
//! again. Time is virtual, and moves when all tasks wait; with [`TimerGrain::Any`], letting it move to the
//! first timer is the last choice at each point.
//!
//! **Search.** The machine goes back to a point where another choice was possible, takes that one, and
//! continues until it ends or reaches a known state. Going back means restoring a snapshot of that point;
//! where memory had no room for it, or there could be none, of one before it, or of the beginning, from where
//! the machine follows the choices. The search proceeds by the number of preemptions (points at which a task
//! had to give way although it could have continued), so the first schedule that leads to an ending is one
//! with the fewest preemptions.
//!
//! **States** are told apart by fingerprints of 128 bits (see `fingerprint`). We accept the risk of a
//! fingerprint collision; exploring a state twice only costs time.
//!
//! Not here: the outside (contents of files, input that was read); making machines and judging how their runs
//! ended, which are up to the caller.
//!
//! Source: Musuvathi and Qadeer 2007 for the order by preemptions; state hashes are as old as SPIN (Holzmann
//! 1988).

mod content;
mod fingerprint;
mod keep;
mod live;
mod point;
mod search;
#[cfg(test)]
mod tests;

use std::collections::hash_map::Entry;

use crate::run::RunOutcome;
pub use crate::schedule::Grain;
use crate::vm::Vm;
use keep::Keeper;
pub use point::{StandingTask, Switch};
use search::{ChoiceNode, ROOT, Search};

/// When timers fire in an exploration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TimerGrain {
    /// When all tasks wait: what tasks do takes no time.
    #[default]
    Idle,
    /// At any point: what tasks do may take as long as the first timer takes.
    Any,
}

/// Settings of an exploration.
#[derive(Clone, Copy, Debug)]
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
}

impl Default for Settings {
    fn default() -> Settings {
        Settings {
            grain: Grain::Changes,
            timers: TimerGrain::Idle,
            turn: 100_000,
            states: 1_000_000,
            memory: 1 << 29,
            snapshots: true,
            switches: None,
            faults: None,
            output: true,
        }
    }
}

/// A way in which runs end.
#[derive(Clone, Debug)]
pub struct ExploredEnding<T> {
    /// The caller's description.
    pub what: T,
    /// Choices of the first schedule that ends so.
    pub choices: Vec<u32>,
    /// Number of runs that ended so.
    pub runs: usize,
}

/// The result of an exploration.
#[derive(Clone, Debug)]
pub struct Exploration<T> {
    /// Number of different states at points.
    pub states: usize,
    /// Number of runs: one for each choice that led to a state from which something remained to be explored,
    /// and for each ending.
    pub runs: usize,
    /// The ways of ending, the one with the fewest preemptions first.
    pub endings: Vec<ExploredEnding<T>>,
    /// Choices that lead to a state from which no schedule leads to an end, if there is one.
    pub endless: Option<Vec<u32>>,
    /// Whether a schedule returns to a state: then it can go on for ever, if only by treating tasks unfairly.
    pub has_cycle: bool,
    /// What kept the search from trying everything, if anything did.
    pub limit: Option<SearchLimit>,
}

/// What keeps a search from trying everything.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SearchLimit {
    /// [`Settings::states`].
    States,
    /// [`Settings::memory`].
    Memory,
    /// [`Settings::switches`].
    Switches,
    /// [`Settings::faults`].
    Faults,
    /// The caller, who has had enough.
    Asked,
}

/// How far a search has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SearchProgress {
    /// Number of different states so far.
    pub states: usize,
    /// Number of runs so far.
    pub runs: usize,
    /// Number of choices that are still to be tried.
    pub open: usize,
    /// Number of preemptions of the schedules that are tried now.
    pub switches: usize,
    /// Number of different endings so far.
    pub endings: usize,
}

/// Runs a program under all schedules. Each machine made by `begin` is about to run it: its main task exists.
/// `judge` describes how a run has ended.
///
/// The machines must be alike: the same program, settings and outside. The clocks of their hosts are virtual.
///
/// # Errors
/// Those of `begin`.
pub fn explore<T: PartialEq, E>(
    settings: &Settings,
    begin: impl FnMut() -> Result<Vm, E>,
    judge: impl FnMut(&mut Vm, RunOutcome) -> T,
) -> Result<Exploration<T>, E> {
    explore_while(settings, begin, judge, |_| true)
}

/// As [`explore`], for as long as `goes_on`, which is asked before each run and in each new state.
///
/// # Errors
/// Those of `begin`.
pub fn explore_while<T: PartialEq, E>(
    settings: &Settings,
    mut begin: impl FnMut() -> Result<Vm, E>,
    mut judge: impl FnMut(&mut Vm, RunOutcome) -> T,
    mut goes_on: impl FnMut(&SearchProgress) -> bool,
) -> Result<Exploration<T>, E> {
    let mut search = Search::default();
    let root = search.node(ChoiceNode::new(ROOT, 0, 0, 0));
    search.open(0, root);
    let mut keeper = Keeper::new(settings);
    let mut endings: Vec<ExploredEnding<T>> = Vec::new();
    let (mut runs, mut limit) = (0, None);
    while let Some((switches, place)) = search.next() {
        if matches!(limit, Some(SearchLimit::States | SearchLimit::Memory)) {
            break;
        }
        if !goes_on(&search.progress(runs, switches, endings.len())) {
            limit = Some(SearchLimit::Asked);
        }
        if limit == Some(SearchLimit::Asked) {
            break;
        }
        let (mut machine, run, choices) = keeper.go_to(&search, place, &mut begin)?;
        runs += 1;
        let mut given = choices.into_iter();
        // Position of the run: the choices so far, and the state in which the last step began.
        let mut node = place;
        let mut before = (place != ROOT).then(|| search.nodes[place as usize].state);
        let outcome = run.go_on(&mut machine, &mut |vm, run, runnable| {
            if given.len() == 1 && runnable.count() > 1 {
                keeper.keep_on_the_way(vm, run, &search, search.nodes[place as usize].parent);
            }
            if runnable.count() > 1
                && let Some(choice) = given.next()
            {
                return Some(choice);
            }
            if given.len() > 0 {
                return Some(0);
            }
            let next = search.places.len() as u32;
            let (state, is_new) = match search.states.entry(keeper.fingerprints.of(vm)) {
                Entry::Occupied(known) => (*known.get(), false),
                Entry::Vacant(free) => (*free.insert(next), true),
            };
            if let Some(before) = before {
                search.steps.push((before, state));
            }
            if !is_new {
                return None;
            }
            search.places.push(node);
            if search.places.len() >= settings.states {
                limit = Some(SearchLimit::States);
                return None;
            }
            if search.places.len().is_multiple_of(64) && !keeper.has_room(search.bytes()) {
                limit = Some(SearchLimit::Memory);
                return None;
            }
            // A run may come to new states for ever.
            if !goes_on(&search.progress(runs, switches, endings.len())) {
                limit = Some(SearchLimit::Asked);
                return None;
            }
            before = Some(state);
            if runnable.count() > 1 {
                // A preemption is a switch at which the task that has just run could have continued.
                let switches = switches + usize::from(runnable.has_last);
                let before = search.nodes[node as usize].faults;
                let faults = before + u32::from(runnable.ways.is_some());
                if settings.switches.is_some_and(|most| switches > most) {
                    limit = limit.or(Some(SearchLimit::Switches));
                } else if settings.faults.is_some_and(|most| faults as usize > most) {
                    limit = limit.or(Some(SearchLimit::Faults));
                } else {
                    for choice in (1..runnable.count()).rev() {
                        let other = search.node(ChoiceNode::new(node, choice, state, faults));
                        search.open(switches, other);
                    }
                    keeper.keep(vm, run, node);
                }
                node = search.node(ChoiceNode::new(node, 0, state, before));
            }
            Some(0)
        });
        let Some(outcome) = outcome else {
            keeper.take_back(machine);
            continue;
        };
        search.last.extend(before);
        let what = judge(&mut machine, outcome);
        keeper.take_back(machine);
        match endings.iter_mut().find(|ending| ending.what == what) {
            Some(ending) => ending.runs += 1,
            None => endings.push(ExploredEnding { what, choices: search.choices(node), runs: 1 }),
        }
    }
    let endless = if limit.is_none() { search.endless() } else { None };
    let (states, has_cycle) = (search.states.len(), search.has_cycle());
    Ok(Exploration { states, runs, endings, endless, has_cycle, limit })
}
