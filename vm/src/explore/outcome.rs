//! The outcome of a search, and its progress.

/// An outcome of runs.
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
    /// A schedule that goes on for ever though it is fair to all tasks, beside those that lead to a state of
    /// `endless`, if there is one.
    pub livelock: Option<Livelock>,
    /// The conditions of `eventually` and `leads-to` that never become true on a schedule that goes on for
    /// ever. Schedules that end without them have an ending of their own.
    pub unmet: Vec<UnmetCondition>,
    /// Whether a schedule returns to a state: then it can go on for ever, if only by treating tasks unfairly.
    pub has_cycle: bool,
    /// The limit that kept the search from trying everything, if one did.
    pub limit: Option<SearchLimit>,
}

/// A schedule that returns to a state. If it has to be fair, each task that could go on all along has gone
/// on, and time has passed if it could.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Livelock {
    /// Choices that lead to the state, and from there back to it.
    pub choices: Vec<u32>,
    /// Number of the first choice on the path back.
    pub lap: usize,
}

/// A condition that is to become true, and a schedule that goes on for ever without it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnmetCondition {
    /// Its number, from which [`crate::vm::Vm::name_of_condition`] returns its name at the end of the
    /// schedule.
    pub condition: u32,
    /// The schedule. The condition is false in all states of the cycle.
    pub schedule: Livelock,
}

/// A limit that keeps a search from trying everything.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SearchLimit {
    /// [`super::Settings::states`].
    States,
    /// [`super::Settings::memory`].
    Memory,
    /// [`super::Settings::switches`].
    Switches,
    /// [`super::Settings::faults`].
    Faults,
    /// A request of the caller to stop.
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
