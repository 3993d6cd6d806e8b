//! Exploration: running a program under every schedule, to find those that end badly or to show that there is
//! none.
//!
//! ```text
//! point         where a task may have to let others go first, and running from point to point
//! fingerprint   telling states apart           content  visiting the fields that belong to a state
//! live          which registers of a frame belong to a state
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
//! again. Time is virtual, and moves when all tasks wait.
//!
//! **Search.** Going back means starting again: a new machine follows the choices up to a point where another
//! one was possible, takes that one, and continues until it ends or reaches a known state. So nothing has to
//! be copied or undone, and every reported schedule has been run from its beginning. The search proceeds by
//! the number of preemptions (points at which a task had to give way although it could have continued), so
//! the first schedule that leads to an ending is one with the fewest preemptions.
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
mod live;
mod point;
#[cfg(test)]
mod tests;

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use crate::run::RunOutcome;
pub use crate::schedule::Grain;
use crate::vm::Vm;
use fingerprint::Fingerprints;
pub use point::{StandingTask, Switch};
use point::{explore_by, run_by_points};

/// Settings of an exploration.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Where points are.
    pub grain: Grain,
    /// Ticks after which a task that reaches no point is stopped.
    pub turn: u32,
    /// Number of states at which the search gives up.
    pub states: usize,
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
            turn: 100_000,
            states: 1_000_000,
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

/// A node in the tree of choices: its last choice, after those of its parent.
#[derive(Clone, Copy, Debug)]
struct ChoiceNode {
    parent: u32,
    choice: u32,
    /// State in which the choice was made.
    state: u32,
    /// Number of choices so far, by `choose`, that were not the first form.
    faults: u32,
}

const ROOT: u32 = 0;

/// The state of a search.
#[derive(Default)]
struct Search {
    nodes: Vec<ChoiceNode>,
    /// Nodes to continue from, by number of preemptions; the latest is last.
    open: Vec<Vec<u32>>,
    /// Numbers of states, by fingerprint.
    states: HashMap<u128, u32>,
    /// Node from which each state was reached first.
    places: Vec<u32>,
    /// Steps, as pairs of the states before and after.
    steps: Vec<(u32, u32)>,
    /// States from which a step leads to the end.
    last: Vec<u32>,
}

impl Search {
    fn node(&mut self, node: ChoiceNode) -> u32 {
        self.nodes.push(node);
        (self.nodes.len() - 1) as u32
    }

    fn open(&mut self, switches: usize, node: u32) {
        if self.open.len() <= switches {
            self.open.resize(switches + 1, Vec::new());
        }
        self.open[switches].push(node);
    }

    /// Returns the next node to continue from, one with the fewest preemptions, and that number.
    fn next(&mut self) -> Option<(usize, u32)> {
        self.open.iter_mut().enumerate().find_map(|(switches, nodes)| Some((switches, nodes.pop()?)))
    }

    /// Returns how far the search has come.
    fn progress(&self, runs: usize, switches: usize, endings: usize) -> SearchProgress {
        let open = self.open.iter().map(Vec::len).sum::<usize>() + 1;
        SearchProgress { states: self.states.len(), runs, open, switches, endings }
    }

    /// Returns the choices that lead to a node.
    fn choices(&self, node: u32) -> Vec<u32> {
        let mut choices = Vec::new();
        let mut at = node;
        while at != ROOT {
            choices.push(self.nodes[at as usize].choice);
            at = self.nodes[at as usize].parent;
        }
        choices.reverse();
        choices
    }

    /// Returns choices that lead to a state from which the end cannot be reached.
    fn endless(&self) -> Option<Vec<u32>> {
        let mut before = vec![Vec::new(); self.places.len()];
        for &(from, to) in &self.steps {
            before[to as usize].push(from);
        }
        let mut ends = vec![false; self.places.len()];
        let mut found = self.last.clone();
        while let Some(state) = found.pop() {
            if !std::mem::replace(&mut ends[state as usize], true) {
                found.extend(&before[state as usize]);
            }
        }
        let stuck = ends.iter().position(|ends| !ends)?;
        Some(self.choices(self.places[stuck]))
    }

    /// Returns whether steps lead from a state back to it: whether states remain when those without a step to
    /// them are removed repeatedly.
    fn has_cycle(&self) -> bool {
        let mut after = vec![Vec::new(); self.places.len()];
        let mut steps_to = vec![0_u32; self.places.len()];
        for &(from, to) in &self.steps {
            after[from as usize].push(to);
            steps_to[to as usize] += 1;
        }
        let mut free: Vec<u32> =
            (0..self.places.len() as u32).filter(|&state| steps_to[state as usize] == 0).collect();
        let mut taken = 0;
        while let Some(state) = free.pop() {
            taken += 1;
            for &next in &after[state as usize] {
                steps_to[next as usize] -= 1;
                if steps_to[next as usize] == 0 {
                    free.push(next);
                }
            }
        }
        taken < self.places.len()
    }
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
    let root = search.node(ChoiceNode { parent: ROOT, choice: 0, state: 0, faults: 0 });
    search.open(0, root);
    let mut fingerprints = Fingerprints::default();
    let mut endings: Vec<ExploredEnding<T>> = Vec::new();
    let (mut runs, mut limit) = (0, None);
    while let Some((switches, place)) = search.next() {
        if limit == Some(SearchLimit::States) {
            break;
        }
        if !goes_on(&search.progress(runs, switches, endings.len())) {
            limit = Some(SearchLimit::Asked);
        }
        if limit == Some(SearchLimit::Asked) {
            break;
        }
        let mut machine = begin()?;
        explore_by(&mut machine, settings);
        fingerprints.begin_machine();
        runs += 1;
        let choices = search.choices(place);
        let mut given = choices.iter().copied();
        // Position of the run: the choices so far, and the state in which the last step began.
        let mut node = place;
        let mut before = (place != ROOT).then(|| search.nodes[place as usize].state);
        let outcome = run_by_points(&mut machine, &mut |vm, runnable| {
            if runnable.count() > 1
                && let Some(choice) = given.next()
            {
                return Some(choice);
            }
            if given.len() > 0 {
                return Some(0);
            }
            let next = search.places.len() as u32;
            let (state, is_new) = match search.states.entry(fingerprints.of(vm)) {
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
                        let other = search.node(ChoiceNode { parent: node, choice, state, faults });
                        search.open(switches, other);
                    }
                }
                node = search.node(ChoiceNode { parent: node, choice: 0, state, faults: before });
            }
            Some(0)
        });
        let Some(outcome) = outcome else { continue };
        search.last.extend(before);
        let what = judge(&mut machine, outcome);
        match endings.iter_mut().find(|ending| ending.what == what) {
            Some(ending) => ending.runs += 1,
            None => endings.push(ExploredEnding { what, choices: search.choices(node), runs: 1 }),
        }
    }
    let endless = if limit.is_none() { search.endless() } else { None };
    let (states, has_cycle) = (search.states.len(), search.has_cycle());
    Ok(Exploration { states, runs, endings, endless, has_cycle, limit })
}
