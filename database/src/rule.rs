//! Rules, which derive facts from others, and their stratification.
//!
//! A rule's head is in a stratum above the predicates that the rule negates. Where no such order exists,
//! because a predicate depends on its own negation, the predicate has no stratum, and queries for it fail.

use std::collections::BTreeMap;
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
    /// The highest stratum, plus one.
    pub(super) strata: usize,
}

impl Rules {
    /// Returns whether there are rules for facts with this functor and number of arguments.
    pub(super) fn has(&self, functor: Term, width: usize) -> bool {
        self.by_name.contains_key(&(functor.bits(), width))
    }

    /// Adds a rule. Returns the rule that it replaces.
    pub(super) fn add(&mut self, rule: Rule) -> Option<Arc<Rule>> {
        let (functor, width) = (rule.head.functor, rule.head.arguments.len());
        let predicates = &mut self.predicates;
        let number = *self.by_name.entry((functor.bits(), width)).or_insert_with(|| {
            predicates.push(Predicate { functor, width, rules: Vec::new(), stratum: 0 });
            predicates.len() - 1
        });
        let rules = &mut self.predicates[number].rules;
        let replaced = match rules.iter_mut().find(|other| other.source == rule.source) {
            Some(other) => Some(std::mem::replace(other, Arc::new(rule))),
            None => {
                rules.push(Arc::new(rule));
                None
            }
        };
        self.stratify();
        replaced
    }

    /// Removes the rule made from this source, and returns it.
    pub(super) fn remove(&mut self, source: Term) -> Option<Arc<Rule>> {
        let is_it = |rule: &Arc<Rule>| rule.source == source;
        let (number, place) = self
            .predicates
            .iter()
            .enumerate()
            .find_map(|(number, predicate)| Some((number, predicate.rules.iter().position(is_it)?)))?;
        let rules = &mut self.predicates[number].rules;
        let removed = rules.remove(place);
        if rules.is_empty() {
            self.predicates.remove(number);
            let names = self.predicates.iter().enumerate();
            self.by_name = names.map(|(at, one)| ((one.functor.bits(), one.width), at)).collect();
        }
        self.stratify();
        Some(removed)
    }

    /// Gives each predicate the least stratum above those of the predicates that it negates.
    fn stratify(&mut self) {
        for predicate in &mut self.predicates {
            predicate.stratum = 0;
        }
        let most = self.predicates.len();
        let mut changes = true;
        while changes {
            changes = false;
            for number in 0..most {
                let rules = self.predicates[number].rules.clone();
                let least = rules.iter().map(|rule| self.least_stratum(&rule.body, 0)).max().unwrap_or(0);
                // More strata than predicates means a cycle.
                let stratum = if least > most { NO_STRATUM } else { least };
                if stratum > self.predicates[number].stratum {
                    self.predicates[number].stratum = stratum;
                    changes = true;
                }
            }
        }
        let known = self.predicates.iter().map(|predicate| predicate.stratum).filter(|&s| s != NO_STRATUM);
        self.strata = known.max().unwrap_or(0) + 1;
    }

    fn least_stratum(&self, formula: &Formula, above: usize) -> usize {
        match formula {
            Formula::Pattern(pattern) => {
                let strata = self.matching(pattern).map(|number| self.predicates[number].stratum);
                strata.map(|stratum| stratum.saturating_add(above)).max().unwrap_or(0)
            }
            Formula::And(parts) | Formula::Or(parts, ..) => {
                parts.iter().map(|part| self.least_stratum(part, above)).max().unwrap_or(0)
            }
            Formula::Not(inside) => self.least_stratum(inside, 1),
            Formula::Test(_) => 0,
        }
    }

    /// Returns the predicates that a pattern may match. A pattern whose tail is a variable matches facts
    /// only.
    pub(super) fn matching(&self, pattern: &Pattern) -> impl Iterator<Item = usize> {
        let (width, is_closed) = (pattern.arguments.len(), pattern.tail == Term::NIL);
        let functor = pattern.functor;
        let fits = move |(_, predicate): &(usize, &Predicate)| {
            is_closed
                && predicate.width == width
                && (functor.as_variable().is_some() || predicate.functor == functor)
        };
        self.predicates.iter().enumerate().filter(fits).map(|(number, _)| number)
    }
}
