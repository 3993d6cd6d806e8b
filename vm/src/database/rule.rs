//! Rules: facts that follow from others, and in which order what they negate has to be known.
//!
//! The rules are stratified: what a rule negates is in a stratum below that of its head. Where no such order exists, because
//! something follows from its own negation, its predicate has no stratum, and asking for it fails.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::formula::{Formula, Pattern};
use super::term::Term;

/// The stratum of a predicate that depends on its own negation.
pub(super) const NO_STRATUM: usize = usize::MAX;

/// A rule: what matches its head follows from its body.
#[derive(Debug)]
pub(super) struct Rule {
    pub(super) head: Pattern,
    pub(super) body: Formula,
    /// Names of the variables; unbound for those without a name.
    pub(super) names: Vec<Term>,
    /// What it was made from; the same rule again replaces this one.
    pub(super) source: Term,
    /// Terms that it holds.
    pub(super) held: Vec<Term>,
}

/// What has rules: a functor and a number of arguments.
#[derive(Clone, Debug)]
pub(super) struct Predicate {
    pub(super) functor: Term,
    pub(super) width: usize,
    pub(super) rules: Vec<Arc<Rule>>,
    pub(super) stratum: usize,
}

/// All rules. Queries keep those that there were when they began.
#[derive(Clone, Debug, Default)]
pub(super) struct Rules {
    pub(super) predicates: Vec<Predicate>,
    by_name: BTreeMap<(u64, usize), usize>,
    /// One more than the highest stratum.
    pub(super) strata: usize,
}

impl Rules {
    /// Whether there are rules for facts with this functor and number of arguments.
    pub(super) fn has(&self, functor: Term, width: usize) -> bool {
        self.by_name.contains_key(&(functor.bits(), width))
    }

    /// Adds a rule; gives back the one that it replaces.
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

    /// Gives each predicate the least stratum that is above those of what it negates.
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
                // More strata than predicates means that there is a circle.
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

    /// The predicates that a pattern may be about. One whose tail is a variable is about facts alone.
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
