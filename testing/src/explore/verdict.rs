//! The scope of an exploration: the grain and the timers of its schedules, and its omissions.
//!
//! A search that has tried everything at its grain proves something about the program only if the grain sees
//! all that the tasks of the program share.

use std::fmt;

use esl::program::Program;
use esl_bytecode::module::Constant;

use super::unseen::{UnseenKind, unseen_changes};
use super::{Exploration, Grain, SearchLimit, Settings, TimerGrain, UnseenChange};

/// Returns the grains at which a program is explored, one after the other: the one that is asked for,
/// otherwise `variables`, and then `ticks` if the program changes what `variables` does not see.
pub fn grains(program: &Program, wanted: Option<Grain>) -> Vec<Grain> {
    match wanted {
        Some(grain) => vec![grain],
        None if unseen_changes(program, Grain::Variables).is_empty() => vec![Grain::Variables],
        None => vec![Grain::Variables, Grain::Ticks],
    }
}

/// The schedules that a search has tried, and its omissions.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExplorationScope {
    /// Where points were.
    pub grain: Grain,
    /// When timers fired.
    pub timers: TimerGrain,
    /// Most aborts of a schedule by an operator.
    pub aborts: u32,
    /// Most restarts of a schedule, which interrupt calls.
    pub crashes: u32,
    /// Whether states were one that differ by which of several like tasks is which.
    pub symmetry: bool,
    /// Whether the program deals with restarts, by name.
    pub has_restarts: bool,
    /// Changes of the program that the grain does not see.
    pub unseen: Vec<UnseenChange>,
    /// The limit that kept the search from trying everything at this grain.
    pub limit: Option<SearchLimit>,
    /// Number of different states at points.
    pub states: usize,
    /// Number of runs.
    pub runs: usize,
}

impl ExplorationScope {
    /// Returns the scope of an exploration of a program with these settings.
    pub fn new<T>(program: &Program, settings: &Settings, found: &Exploration<T>) -> ExplorationScope {
        ExplorationScope {
            grain: settings.grain,
            timers: settings.timers,
            aborts: settings.aborts,
            crashes: settings.crashes,
            symmetry: settings.symmetry,
            has_restarts: deals_with_restarts(program),
            unseen: unseen_changes(program, settings.grain),
            limit: found.limit,
            states: found.states,
            runs: found.runs,
        }
    }

    /// Returns whether every schedule of the program behaves as one of those that were tried.
    pub fn is_complete(&self) -> bool {
        self.unseen.is_empty() && self.limit.is_none()
    }

    /// Says why the exploration is not a proof; `None` if it is complete.
    pub fn why_not_complete(&self) -> Option<String> {
        let limit = match self.limit {
            Some(SearchLimit::States) => "the limit of states is reached",
            Some(SearchLimit::Memory) => "the limit of memory is reached",
            Some(SearchLimit::Switches) => "schedules with more switches were not tried",
            Some(SearchLimit::Faults) => "more choices that are not the first were not tried",
            Some(SearchLimit::Asked) => "the time is over",
            None if self.unseen.is_empty() => return None,
            None if let Some(change) =
                self.unseen.iter().find(|change| change.kind == UnseenKind::Definition) =>
            {
                return Some(format!("no grain sees {change}"));
            }
            None => {
                let unseen: Vec<String> = self.unseen.iter().map(ToString::to_string).collect();
                let is_coarse = |change: &UnseenChange| change.kind <= UnseenKind::Variable;
                let finer = if self.unseen.iter().all(is_coarse) { Grain::Variables } else { Grain::Ticks };
                let (grain, unseen) = (self.grain.name(), unseen.join(", "));
                return Some(format!("grain {grain} does not see {unseen}, grain {} does", finer.name()));
            }
        };
        Some(limit.into())
    }
}

/// Returns whether a program names the cause of an interrupted call, or the input of a restart.
fn deals_with_restarts(program: &Program) -> bool {
    let is_name = |constant: &Constant| match constant {
        Constant::Symbol(symbol) => matches!(symbol.name(), "INTERRUPTED-BY-RESTART" | "*RESUMED*"),
        _ => false,
    };
    program.module().constants.iter().any(is_name)
}

/// Grain, timers and figures.
impl fmt::Display for ExplorationScope {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let counted =
            |count: usize, what: &str| format!("{count} {what}{}", if count == 1 { "" } else { "s" });
        let (grain, timers) = (self.grain.name(), self.timers.name());
        let (states, runs) = (counted(self.states, "state"), counted(self.runs, "run"));
        write!(f, "grain {grain}, timers {timers}")?;
        if self.aborts > 0 {
            write!(f, ", aborts {}", self.aborts)?;
        }
        if self.crashes > 0 {
            write!(f, ", crashes {}", self.crashes)?;
        }
        if self.symmetry {
            f.write_str(", symmetry")?;
        }
        write!(f, "; {states}, {runs}")
    }
}
