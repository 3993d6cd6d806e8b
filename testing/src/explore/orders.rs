//! Coverage of random schedules: pairs of places of the program that came in both orders.
//!
//! Two places make a pair if different tasks were there one after the other, so that the order could matter:
//! at uses of one variable or part of an object, of which one is a change; or at steps that others can see,
//! such as signals, waits and changes of facts. A pair is covered if each of its places has come before the
//! other one.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use esl_vm::explore::{ScheduleEvent, ScheduleStep};

/// The pairs of places that have come one after the other, each with the orders that were seen.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SeenOrders(BTreeMap<(String, String), u8>);

/// The first place of a pair, in the order of texts, has come before the second one.
const FORWARD: u8 = 1;
/// The second one has come before the first one.
const BACKWARD: u8 = 2;

impl SeenOrders {
    /// Returns the number of pairs, and of those that were seen in both orders.
    pub fn counts(&self) -> (usize, usize) {
        (self.0.len(), self.0.values().filter(|&&orders| orders == FORWARD | BACKWARD).count())
    }

    /// Returns the pairs that were seen in one order only, in that order.
    pub fn one_way(&self) -> impl Iterator<Item = (&str, &str)> {
        self.0.iter().filter_map(|((one, other), &orders)| match orders {
            FORWARD => Some((&**one, &**other)),
            BACKWARD => Some((&**other, &**one)),
            _ => None,
        })
    }

    /// Returns all pairs, each in the orders that were seen.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &str)> {
        self.0.iter().flat_map(|((one, other), &orders)| {
            let forward = (orders & FORWARD != 0).then_some((&**one, &**other));
            let backward = (orders & BACKWARD != 0).then_some((&**other, &**one));
            forward.into_iter().chain(backward)
        })
    }

    /// Notes that one place has come before another.
    pub fn add(&mut self, first: &str, second: &str) {
        let (key, order) = match first.cmp(second) {
            std::cmp::Ordering::Less => ((first, second), FORWARD),
            std::cmp::Ordering::Greater => ((second, first), BACKWARD),
            // Two tasks at one place are in both orders at once.
            std::cmp::Ordering::Equal => return,
        };
        *self.0.entry((key.0.to_owned(), key.1.to_owned())).or_default() |= order;
    }

    /// Notes the orders of a run.
    pub(super) fn add_run(&mut self, run: &RunOrders) {
        run.orders.iter().for_each(|(first, second)| self.add(first, second));
    }
}

/// The orders of one run, as its steps are told.
#[derive(Debug, Default)]
pub(super) struct RunOrders {
    /// The last place of each task, by what it used there; empty for other steps.
    last: HashMap<String, Vec<LastUse>>,
    orders: BTreeSet<(String, String)>,
}

#[derive(Debug)]
struct LastUse {
    task: String,
    place: String,
    is_change: bool,
}

impl RunOrders {
    /// Takes in a step of the run.
    pub(super) fn see(&mut self, step: ScheduleStep) {
        match step.event {
            ScheduleEvent::Use { task, target, is_set, place: Some(place), .. } => {
                self.come(target, task, place, is_set);
            }
            ScheduleEvent::Step(standing) => {
                if let Some(place) = standing.place {
                    self.come(String::new(), standing.label, place, true);
                }
            }
            _ => {}
        }
    }

    fn come(&mut self, target: String, task: String, place: String, is_change: bool) {
        let uses = self.last.entry(target).or_default();
        for other in uses.iter().filter(|other| other.task != task) {
            if is_change || other.is_change {
                self.orders.insert((other.place.clone(), place.clone()));
            }
        }
        match uses.iter_mut().find(|other| other.task == task) {
            Some(last) => (last.place, last.is_change) = (place, is_change),
            None => uses.push(LastUse { task, place, is_change }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the orders of a run, in which tasks use a variable at places, as in `A:1?` for a read at place
    /// 1 and `A:2=` for a change at place 2.
    fn orders(uses: &[&str]) -> SeenOrders {
        let mut run = RunOrders::default();
        for text in uses {
            let (task, rest) = text.split_once(':').expect("a task comes first");
            let place = rest.trim_end_matches(['?', '=']);
            run.come("n".into(), task.into(), place.into(), rest.ends_with('='));
        }
        let mut seen = SeenOrders::default();
        seen.add_run(&run);
        seen
    }

    #[test]
    fn pairs_are_of_two_tasks_of_which_one_changes() {
        assert_eq!(orders(&["A:1?", "B:2?", "A:1?", "A:3="]).iter().collect::<Vec<_>>(), [("2", "3")]);
        assert_eq!(orders(&["A:1=", "A:2="]).counts(), (0, 0));
        assert_eq!(orders(&["A:1=", "B:1="]).counts(), (0, 0), "one place is in both orders at once");
    }

    #[test]
    fn a_pair_is_covered_in_both_orders() {
        let mut seen = orders(&["A:1?", "B:2="]);
        assert_eq!((seen.counts(), seen.one_way().collect::<Vec<_>>()), ((1, 0), vec![("1", "2")]));
        let other = orders(&["B:2=", "A:1?"]);
        assert_eq!(other.one_way().collect::<Vec<_>>(), [("2", "1")]);
        other.iter().for_each(|(first, second)| seen.add(first, second));
        assert_eq!((seen.counts(), seen.iter().count()), ((1, 1), 2));
    }
}
