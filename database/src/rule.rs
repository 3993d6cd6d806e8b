//! Rules, which derive facts from others, and their stratification.
//!
//! A rule's head is in a stratum above the predicates that the rule negates. Where no such order exists,
//! because a predicate depends on its own negation, the predicate has no stratum, and queries for it fail.
//! Strata are found by the first query after a change of the rules.

use esl_heap::stored;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::formula::{Formula, Pattern};
use super::term::Term;

/// Stratum of a predicate that depends on its own negation.
pub(super) const NO_STRATUM: usize = usize::MAX;

/// A rule: facts that match its head follow from its body.
#[derive(Debug)]
pub(super) struct Rule {
    pub(super) head: Pattern,
    pub(super) body: Formula,
    /// Names of the variables; unbound for those without a name.
    pub(super) names: Vec<Term>,
    /// Source of the rule; a rule with the same source replaces this one.
    pub(super) source: Term,
    /// Terms that the rule holds.
    pub(super) held: Vec<Term>,
}

/// Bytes of a rule outside of itself: its place among the rules, and that of its predicate if it is the
/// first.
const BYTES_BESIDE: usize = size_of::<Arc<Rule>>() + 2 * size_of::<usize>() + size_of::<Predicate>() + 64;

impl Rule {
    /// Returns the bytes that the rule takes, approximately.
    pub(super) fn bytes(&self) -> usize {
        let terms = (self.names.capacity() + self.held.capacity()) * size_of::<Term>();
        size_of::<Rule>() + BYTES_BESIDE + terms + self.head.bytes_beside() + self.body.bytes_beside()
    }
}

/// A functor and a number of arguments for which there are rules.
#[derive(Clone, Debug)]
pub(super) struct Predicate {
    pub(super) functor: Term,
    pub(super) width: usize,
    pub(super) rules: Vec<Arc<Rule>>,
    pub(super) stratum: usize,
}

/// All rules. A query keeps those of the time when it began.
#[derive(Clone, Debug, Default)]
pub(super) struct Rules {
    pub(super) predicates: Vec<Predicate>,
    by_name: BTreeMap<(u64, usize), usize>,
    /// Predicates by their number of arguments.
    by_width: BTreeMap<usize, Vec<usize>>,
    /// The highest stratum, plus one.
    pub(super) strata: usize,
    /// Whether the strata are those of these rules: they are found when a query needs them.
    is_stratified: bool,
}

impl Rules {
    /// Returns whether there are rules for facts with this functor and number of arguments.
    pub(super) fn has(&self, functor: Term, width: usize) -> bool {
        self.by_name.contains_key(&(functor.bits(), width))
    }

    /// Adds a rule. Returns the rule that it replaces. Adds the rules looked at to `work`.
    pub(super) fn add(&mut self, rule: Rule, work: &mut usize) -> Option<Arc<Rule>> {
        let (functor, width) = (rule.head.functor, rule.head.arguments.len());
        let Rules { predicates, by_width, .. } = self;
        let number = *self.by_name.entry((functor.bits(), width)).or_insert_with(|| {
            predicates.push(Predicate { functor, width, rules: Vec::new(), stratum: 0 });
            by_width.entry(width).or_default().push(predicates.len() - 1);
            predicates.len() - 1
        });
        self.is_stratified = false;
        let rules = &mut self.predicates[number].rules;
        *work += rules.len() / 16;
        match rules.iter_mut().find(|other| other.source == rule.source) {
            Some(other) => Some(std::mem::replace(other, Arc::new(rule))),
            None => {
                rules.push(Arc::new(rule));
                None
            }
        }
    }

    /// Removes the rule made from this source, and returns it. Adds the rules looked at to `work`.
    pub(super) fn remove(&mut self, source: Term, work: &mut usize) -> Option<Arc<Rule>> {
        let is_it = |rule: &Arc<Rule>| rule.source == source;
        *work += self.predicates.iter().map(|predicate| 1 + predicate.rules.len() / 16).sum::<usize>();
        let (number, place) = self
            .predicates
            .iter()
            .enumerate()
            .find_map(|(number, predicate)| Some((number, predicate.rules.iter().position(is_it)?)))?;
        let rules = &mut self.predicates[number].rules;
        let removed = rules.remove(place);
        if rules.is_empty() {
            self.predicates.remove(number);
            self.by_name.clear();
            self.by_width.clear();
            for (at, predicate) in self.predicates.iter().enumerate() {
                self.by_name.insert((predicate.functor.bits(), predicate.width), at);
                self.by_width.entry(predicate.width).or_default().push(at);
            }
        }
        self.is_stratified = false;
        Some(removed)
    }

    /// Returns whether each predicate has its stratum.
    pub(super) fn is_stratified(&self) -> bool {
        self.is_stratified
    }

    /// Gives each predicate the least stratum above those of the predicates that it negates. Adds the
    /// predicates and their uses to `work`.
    pub(super) fn stratify(&mut self, work: &mut usize) {
        let count = self.predicates.len();
        let uses: Vec<Vec<Use>> = (0..count).map(|number| self.uses(number)).collect();
        *work += count + uses.iter().map(Vec::len).sum::<usize>();
        // Each group comes after all those that it depends on.
        let mut highest = 0;
        for group in groups(&uses) {
            let members: BTreeSet<usize> = group.iter().copied().collect();
            let mut stratum = 0;
            for one in group.iter().flat_map(|&number| &uses[number]) {
                let below = match members.contains(&one.predicate) {
                    // A predicate of the group depends on its own negation.
                    true if one.is_negated => NO_STRATUM,
                    true => continue,
                    false => self.predicates[one.predicate].stratum,
                };
                stratum = stratum.max(below.saturating_add(usize::from(one.is_negated)));
            }
            for &number in &group {
                self.predicates[number].stratum = stratum;
            }
            if stratum != NO_STRATUM {
                highest = highest.max(stratum);
            }
        }
        self.strata = highest + 1;
        self.is_stratified = true;
    }

    /// Returns the predicates that the rules of a predicate use.
    fn uses(&self, number: usize) -> Vec<Use> {
        let mut uses = Vec::new();
        for rule in &self.predicates[number].rules {
            self.add_uses(&rule.body, false, &mut uses);
        }
        uses.sort_unstable();
        uses.dedup();
        uses
    }

    fn add_uses(&self, formula: &Formula, is_negated: bool, uses: &mut Vec<Use>) {
        match formula {
            Formula::Pattern(pattern) => {
                uses.extend(self.matching(pattern).map(|predicate| Use { predicate, is_negated }));
            }
            Formula::And(parts) | Formula::Or(parts, ..) => {
                parts.iter().for_each(|part| self.add_uses(part, is_negated, uses));
            }
            Formula::Not(inside) => self.add_uses(inside, true, uses),
            Formula::Test(_) => {}
        }
    }

    /// Returns the predicates that a pattern may match. A pattern whose tail is a variable matches facts
    /// only.
    pub(super) fn matching(&self, pattern: &Pattern) -> impl Iterator<Item = usize> {
        let (width, functor) = (pattern.arguments.len(), pattern.functor);
        let is_closed = pattern.tail == Term::NIL;
        let (one, several) = match functor.as_variable() {
            _ if !is_closed => (None, None),
            Some(_) => (None, self.by_width.get(&width)),
            None => (self.by_name.get(&(functor.bits(), width)), None),
        };
        one.into_iter().chain(several.into_iter().flatten()).copied()
    }
}

/// The use of a predicate in rules of another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Use {
    predicate: usize,
    is_negated: bool,
}

/// Returns the predicates in groups that depend on each other, each group after those that it uses.
///
/// Source: Tarjan 1972, with an explicit stack.
fn groups(uses: &[Vec<Use>]) -> Vec<Vec<usize>> {
    const UNSEEN: usize = usize::MAX;
    let mut index = vec![UNSEEN; uses.len()];
    let mut low = vec![UNSEEN; uses.len()];
    let mut is_open = vec![false; uses.len()];
    let (mut stack, mut found, mut next) = (Vec::new(), Vec::new(), 0);
    for root in 0..uses.len() {
        if index[root] != UNSEEN {
            continue;
        }
        // Predicates on the way from the root, each with the number of its uses that were followed.
        let mut path = vec![(root, 0)];
        while let Some((number, followed)) = path.last_mut() {
            let number = *number;
            if *followed == 0 && index[number] == UNSEEN {
                index[number] = next;
                low[number] = next;
                next += 1;
                stack.push(number);
                is_open[number] = true;
            }
            if let Some(used) = uses[number].get(*followed) {
                *followed += 1;
                let used = used.predicate;
                if index[used] == UNSEEN {
                    path.push((used, 0));
                } else if is_open[used] {
                    low[number] = low[number].min(index[used]);
                }
                continue;
            }
            path.pop();
            if let Some(&(user, _)) = path.last() {
                low[user] = low[user].min(low[number]);
            }
            if low[number] == index[number] {
                let start = stack.iter().rposition(|&other| other == number).unwrap_or(0);
                let group = stack.split_off(start);
                group.iter().for_each(|&member| is_open[member] = false);
                found.push(group);
            }
        }
    }
    found
}

stored! { Rule { head, body, names, source, held } }
stored! { Predicate { functor, width, rules, stratum } }
stored! { Rules { predicates, by_name, by_width, strata, is_stratified } }
