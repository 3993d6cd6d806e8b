//! Races: the variables that several tasks use, at least one of which sets them. Only uses of these need
//! points.
//!
//! A search begins with no variable in a race, and notes the uses of variables while other tasks exist. When
//! its runs have shown a race that it did not know, it begins again, with points after the uses of that
//! variable, too. It ends when its runs show no further race. Then every schedule of the machine behaves like
//! one of its runs: a first use by which another schedule came to a further race would be a use in one of
//! these runs, too.
//!
//! In the same way it learns whether requests reach tasks that could run: to end, to leave a form, or
//! interrupts. Then the place at which such a task stands makes a difference, and inside of cleanups and
//! limits each tick of it is a point.
//!
//! Not here: the choices of a schedule, which count the points that were left out, too ([`super::search`]).
//!
//! Source: points learned from the races of runs as in dynamic partial-order reduction (Flanagan and
//! Godefroid 2005). We differ in learning places instead of branches, which agrees with a set of states.

use std::collections::{HashMap, HashSet};

use esl_bytecode::symbol::Symbol;

use crate::schedule::VariableUse;
use crate::task::TaskNumber;
use crate::vm::Vm;

/// The races for which a search has points.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Races {
    variables: HashSet<Symbol>,
    /// Whether requests reach tasks that could run.
    pub(super) has_hits: bool,
}

/// The tasks that have used a variable in a way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Users {
    #[default]
    None,
    One(TaskNumber),
    Several,
}

impl Users {
    fn with(self, other: Users) -> Users {
        match (self, other) {
            (Users::None, users) | (users, Users::None) => users,
            (Users::One(one), Users::One(another)) if one == another => self,
            _ => Users::Several,
        }
    }
}

/// The users of a variable.
#[derive(Clone, Copy, Debug, Default)]
struct VariableUsers {
    all: Users,
    setting: Users,
}

impl VariableUsers {
    fn are_in_race(self) -> bool {
        self.all == Users::Several && self.setting != Users::None
    }
}

/// The uses of variables that runs have shown.
#[derive(Clone, Debug, Default)]
pub(super) struct RaceNotes {
    variables: HashMap<Symbol, VariableUsers>,
    has_hits: bool,
}

impl RaceNotes {
    /// Adds the notes of another run.
    pub(super) fn add(&mut self, other: &RaceNotes) {
        self.has_hits |= other.has_hits;
        for (symbol, users) in &other.variables {
            let known = self.variables.entry(symbol.clone()).or_default();
            known.all = known.all.with(users.all);
            known.setting = known.setting.with(users.setting);
        }
    }

    /// Returns the races that a search has to know, if there are more than these.
    pub(super) fn beyond(&self, known: &Races) -> Option<Races> {
        let mut races = known.clone();
        races.has_hits |= self.has_hits;
        let in_race = self.variables.iter().filter(|(_, users)| users.are_in_race());
        races.variables.extend(in_race.map(|(symbol, _)| symbol.clone()));
        (races != *known).then_some(races)
    }
}

/// The races that a run knows, and its notes.
pub(super) struct RaceWatch<'a> {
    pub(super) known: &'a Races,
    pub(super) notes: RaceNotes,
}

impl<'a> RaceWatch<'a> {
    pub(super) fn new(known: &'a Races) -> RaceWatch<'a> {
        RaceWatch { known, notes: RaceNotes::default() }
    }

    /// Notes that a request has reached a task that could run.
    pub(super) fn note_hit(&mut self) {
        self.notes.has_hits = true;
    }

    /// Returns whether others may see a use of a variable, and notes it if there are others.
    pub(super) fn see(&mut self, vm: &Vm, used: VariableUse, has_others: bool) -> bool {
        let name = vm.names.name_of(&vm.heap, used.symbol);
        // One without a name is told apart from no other.
        let Some(symbol) = name.filter(|symbol| symbol.package().is_some()) else { return true };
        let is_known = self.known.variables.contains(&symbol);
        if has_others && !is_known {
            let users = self.notes.variables.entry(symbol).or_default();
            let user = Users::One(used.task);
            users.all = users.all.with(user);
            if used.is_set {
                users.setting = users.setting.with(user);
            }
        }
        is_known
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn notes(uses: &[(&str, u64, bool)]) -> RaceNotes {
        let mut notes = RaceNotes::default();
        for &(name, task, is_set) in uses {
            let user = Users::One(TaskNumber(task));
            let setting = if is_set { user } else { Users::None };
            let variables = HashMap::from([(
                Symbol::new(&"ESL-USER".into(), name),
                VariableUsers { all: user, setting },
            )]);
            notes.add(&RaceNotes { variables, has_hits: false });
        }
        notes
    }

    #[test]
    fn a_race_is_between_two_tasks_one_of_which_sets_the_variable() {
        let known = Races::default();
        for quiet in [&[("A", 1, true), ("A", 1, false)][..], &[("A", 1, false), ("A", 2, false)], &[]] {
            assert_eq!(notes(quiet).beyond(&known), None, "{quiet:?}");
        }
        for race in [
            [("A", 1, true), ("A", 2, false)],
            [("A", 1, true), ("A", 2, true)],
            [("A", 1, false), ("A", 2, true)],
        ] {
            let found = notes(&race).beyond(&known).expect("there is a race");
            assert_eq!((found.variables.len(), found.has_hits), (1, false), "{race:?}");
            assert_eq!(notes(&race).beyond(&found), None, "it is known then");
        }
        let hit = RaceNotes { has_hits: true, ..RaceNotes::default() };
        assert!(hit.beyond(&known).is_some_and(|races| races.has_hits));
    }
}
