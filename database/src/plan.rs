//! The goals of a query, and their order.
//!
//! The next pattern of a conjunction is the one with the fewest expected facts, given the variables bound so
//! far, unless the order of the text is about as good. A test comes as soon as its variables are bound and
//! the patterns before it in the text are done; a negation, as soon as the variables that it shares with
//! patterns are bound. Neither the answers nor their order (see `query`) depend on the order of the goals.
//!
//! A goal names its successor, so that nested formulas become one graph.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::formula::{Formula, Pattern, TestForm};
use super::relation::INDEXED_POSITIONS;
use super::term::{Term, Terms};
use super::{Database, rule::Rules};

/// Number of a goal.
pub(super) type GoalId = u32;

/// A step of a query.
#[derive(Clone, Debug)]
pub(super) enum Goal {
    /// Finds facts.
    Match { pattern: Arc<Pattern>, relation: Option<u32>, next: GoalId },
    /// Finds facts of a predicate with rules.
    Call { pattern: Arc<Pattern>, predicate: usize, next: GoalId },
    /// Tries one alternative after the other. The ranks are those of the alternatives.
    Branch { alternatives: Vec<GoalId>, rank: usize, ranks_end: usize },
    /// Continues if there is no answer inside.
    Not { inside: GoalId, next: GoalId },
    /// An answer inside a negation.
    Proved,
    /// Continues if the program's condition holds.
    Test { test: TestForm, next: GoalId },
    /// An answer of the query or rule.
    Solved,
}

/// Greatest number of patterns in a conjunction that are ordered by cost; longer conjunctions keep the order
/// of the text.
const MOST_ORDERED: usize = 64;
/// Factor by which another order must be better than that of the text.
const WORTHWHILE: f64 = 4.0;
/// Assumed number of facts of a predicate with rules: without any known argument, and with some.
const MANY: f64 = 1e6;
const SOME: f64 = 1e3;

/// Whether each variable is bound, by number.
type Bound = Vec<bool>;

/// A formula with its parts in the order of evaluation.
enum Arranged<'f> {
    Pattern(&'f Pattern),
    And(Vec<Arranged<'f>>),
    Or(Vec<Arranged<'f>>, usize, usize),
    Not(Box<Arranged<'f>>),
    Test(&'f TestForm),
}

/// The generators of a conjunction that have no place in the order yet.
struct Generators {
    /// Variables that each of them binds, by its position in the conjunction.
    binds: BTreeMap<usize, Vec<usize>>,
    /// Number of those that bind a variable, by its number.
    binders: Vec<u32>,
}

impl Generators {
    fn of(planner: &Planner<'_>, parts: &[Formula], generators: &[usize], variables: usize) -> Generators {
        let mut binders = vec![0; variables];
        let mut binds = BTreeMap::new();
        for &at in generators {
            let mut bound = Vec::new();
            planner.each_bound(&parts[at], &mut |variable| bound.push(variable));
            bound.iter().for_each(|&variable: &usize| binders[variable] += 1);
            binds.insert(at, bound);
        }
        Generators { binds, binders }
    }

    fn remove(&mut self, at: usize) {
        for variable in self.binds.remove(&at).unwrap_or_default() {
            self.binders[variable] -= 1;
        }
    }

    /// Returns whether a test or negation can come now: its variables are bound, or none of these binds them;
    /// and if it is a guard, none of these stands before it.
    fn allow(&self, at: usize, guards: bool, used: &[usize], now: &Bound) -> bool {
        let is_ready = used.iter().all(|&variable| now[variable] || self.binders[variable] == 0);
        is_ready && (!guards || self.binds.first_key_value().is_none_or(|(&first, _)| first > at))
    }
}

/// The planner: makes goals of formulas.
pub(super) struct Planner<'a> {
    pub(super) database: &'a Database,
    pub(super) rules: &'a Rules,
    pub(super) goals: &'a mut Vec<Goal>,
    /// Whether generators are in an order other than that of the text.
    pub(super) is_reordered: bool,
    /// Steps taken.
    pub(super) work: usize,
}

fn variables_of(terms: &Terms, pattern: &Pattern, visit: &mut dyn FnMut(usize)) {
    for &part in [&pattern.functor, &pattern.tail].into_iter().chain(&pattern.arguments) {
        terms.variables(part, visit);
    }
}

impl Planner<'_> {
    /// Makes the goals of a formula that is followed by `next`. `bound` says which variables are bound before
    /// it.
    pub(super) fn plan(&mut self, formula: &Formula, bound: &mut Bound, next: GoalId) -> GoalId {
        if let Formula::Pattern(pattern) = formula {
            // There is nothing to order, and the caller does not use what is bound afterwards.
            self.work += 1;
            return self.emit_pattern(pattern, next);
        }
        let arranged = self.arrange(formula, bound);
        self.emit(&arranged, next)
    }

    fn add(&mut self, goal: Goal) -> GoalId {
        self.goals.push(goal);
        self.goals.len() as GoalId - 1
    }

    fn emit(&mut self, arranged: &Arranged<'_>, next: GoalId) -> GoalId {
        match arranged {
            Arranged::Pattern(pattern) => self.emit_pattern(pattern, next),
            Arranged::And(parts) => parts.iter().rev().fold(next, |next, part| self.emit(part, next)),
            Arranged::Or(parts, rank, ranks_end) => {
                let alternatives = parts.iter().map(|part| self.emit(part, next)).collect();
                self.add(Goal::Branch { alternatives, rank: *rank, ranks_end: *ranks_end })
            }
            Arranged::Not(inside) => {
                let proved = self.add(Goal::Proved);
                let inside = self.emit(inside, proved);
                self.add(Goal::Not { inside, next })
            }
            Arranged::Test(test) => self.add(Goal::Test { test: (*test).clone(), next }),
        }
    }

    /// Makes the goals of a pattern: the facts, and an alternative for each predicate with rules that it may
    /// match.
    fn emit_pattern(&mut self, pattern: &Pattern, next: GoalId) -> GoalId {
        self.work += pattern.arguments.len() / 8;
        let is_plain = pattern.functor.as_variable().is_none() && pattern.tail == Term::NIL;
        let relation = match is_plain {
            true => self.database.find_relation(pattern.functor, pattern.arguments.len()),
            false => None,
        };
        let shared = Arc::new(pattern.clone());
        let predicates: Vec<usize> = self.rules.matching(pattern).collect();
        self.work += predicates.len();
        if let (true, [predicate]) = (is_plain, predicates.as_slice()) {
            return self.add(Goal::Call { pattern: shared.clone(), predicate: *predicate, next });
        }
        let facts = self.add(Goal::Match { pattern: shared.clone(), relation, next });
        if predicates.is_empty() {
            return facts;
        }
        let mut alternatives = vec![facts];
        for predicate in predicates {
            alternatives.push(self.add(Goal::Call { pattern: shared.clone(), predicate, next }));
        }
        self.add(Goal::Branch { alternatives, rank: pattern.rank, ranks_end: pattern.rank + 1 })
    }

    fn arrange<'f>(&mut self, formula: &'f Formula, bound: &mut Bound) -> Arranged<'f> {
        // Alternatives and negations have copies of what is bound.
        self.work += 1 + bound.len() / 64;
        match formula {
            Formula::Pattern(pattern) => {
                self.bind(formula, bound);
                Arranged::Pattern(pattern)
            }
            Formula::And(parts) => self.arrange_and(parts, bound),
            Formula::Or(parts, rank, ranks_end) => {
                let arranged = parts.iter().map(|part| self.arrange(part, &mut bound.clone())).collect();
                // A negation further on may not run before all alternatives have bound its variables.
                self.bind_surely(formula, bound);
                Arranged::Or(arranged, *rank, *ranks_end)
            }
            Formula::Not(inside) => Arranged::Not(Box::new(self.arrange(inside, &mut bound.clone()))),
            Formula::Test(test) => Arranged::Test(test),
        }
    }

    fn arrange_and<'f>(&mut self, parts: &'f [Formula], bound: &mut Bound) -> Arranged<'f> {
        let order = self.order(parts, bound);
        Arranged::And(order.into_iter().map(|at| self.arrange(&parts[at], bound)).collect())
    }

    /// Returns the order in which the parts of a conjunction are evaluated.
    fn order(&mut self, parts: &[Formula], bound: &Bound) -> Vec<usize> {
        let is_generator = |at: &usize| !matches!(parts[*at], Formula::Not(_) | Formula::Test(_));
        let generators: Vec<usize> = (0..parts.len()).filter(is_generator).collect();
        let mut chosen = generators.clone();
        if (2..=MOST_ORDERED).contains(&generators.len()) {
            let (best, cost) = self.cheapest(parts, &generators, bound);
            if cost * WORTHWHILE < self.cost(parts, &generators, bound) {
                chosen = best;
                self.is_reordered = true;
            }
        }
        // Tests and negations, each placed as early as possible.
        let mut waiting: Vec<usize> = (0..parts.len()).filter(|at| !is_generator(at)).collect();
        let mut order = Vec::with_capacity(parts.len());
        if waiting.is_empty() {
            return chosen;
        }
        let mut now = bound.clone();
        let mut to_come = Generators::of(self, parts, &generators, bound.len());
        let used: Vec<Vec<usize>> = parts.iter().map(|part| self.variables_used(part)).collect();
        let mut left = chosen.iter().copied();
        loop {
            waiting.retain(|&at| {
                self.work += 1 + used[at].len() / 8;
                let guards = matches!(parts[at], Formula::Test(_));
                let comes = to_come.allow(at, guards, &used[at], &now);
                if comes {
                    order.push(at);
                }
                !comes
            });
            let Some(at) = left.next() else { break };
            self.bind_surely(&parts[at], &mut now);
            to_come.remove(at);
            order.push(at);
        }
        order.extend(waiting);
        order
    }

    /// Returns the variables that stand in a formula.
    fn variables_used(&self, formula: &Formula) -> Vec<usize> {
        let mut used = Vec::new();
        self.each_variable(formula, &mut |variable| used.push(variable));
        used.sort_unstable();
        used.dedup();
        used
    }

    fn each_variable(&self, formula: &Formula, visit: &mut dyn FnMut(usize)) {
        match formula {
            Formula::Pattern(pattern) => variables_of(&self.database.terms, pattern, visit),
            Formula::And(parts) | Formula::Or(parts, ..) => {
                parts.iter().for_each(|part| self.each_variable(part, visit));
            }
            Formula::Not(inside) => self.each_variable(inside, visit),
            Formula::Test(test) => test.variables.iter().for_each(|&variable| visit(variable as usize)),
        }
    }

    /// Calls `visit` with the variables that some answer to a formula binds.
    fn each_bound(&self, formula: &Formula, visit: &mut dyn FnMut(usize)) {
        match formula {
            Formula::Pattern(pattern) => variables_of(&self.database.terms, pattern, visit),
            Formula::And(parts) | Formula::Or(parts, ..) => {
                parts.iter().for_each(|part| self.each_bound(part, visit));
            }
            Formula::Not(_) | Formula::Test(_) => {}
        }
    }

    /// Marks the variables that every answer to a formula binds.
    fn bind_surely(&self, formula: &Formula, bound: &mut Bound) {
        match formula {
            Formula::Pattern(_) => self.bind(formula, bound),
            Formula::And(parts) => parts.iter().for_each(|part| self.bind_surely(part, bound)),
            Formula::Or(parts, ..) => {
                let after = parts.iter().map(|part| {
                    let mut after = bound.clone();
                    self.bind_surely(part, &mut after);
                    after
                });
                let both = |a: Bound, b: Bound| a.iter().zip(b).map(|(&a, b)| a && b).collect();
                if let Some(after) = after.reduce(both) {
                    *bound = after;
                }
            }
            Formula::Not(_) | Formula::Test(_) => {}
        }
    }

    /// Marks the variables that some answer to a formula binds.
    fn bind(&self, formula: &Formula, bound: &mut Bound) {
        self.each_bound(formula, &mut |variable| bound[variable] = true);
    }

    fn cost(&mut self, parts: &[Formula], order: &[usize], bound: &Bound) -> f64 {
        let mut now = bound.clone();
        let (mut rows, mut cost) = (1.0, 0.0);
        for &at in order {
            rows *= self.estimate(&parts[at], &now);
            cost += rows;
            self.bind(&parts[at], &mut now);
        }
        cost
    }

    fn cheapest(&mut self, parts: &[Formula], generators: &[usize], bound: &Bound) -> (Vec<usize>, f64) {
        let mut now = bound.clone();
        let mut left = generators.to_vec();
        let mut order = Vec::with_capacity(left.len());
        let (mut rows, mut cost) = (1.0, 0.0);
        while !left.is_empty() {
            let mut best = (0, f64::INFINITY);
            for (place, &at) in left.iter().enumerate() {
                let estimate = self.estimate(&parts[at], &now);
                if estimate < best.1 {
                    best = (place, estimate);
                }
            }
            let at = left.remove(best.0);
            rows *= best.1;
            cost += rows;
            self.bind(&parts[at], &mut now);
            order.push(at);
        }
        (order, cost)
    }

    /// Estimates the number of answers to a formula, given which variables are bound.
    fn estimate(&mut self, formula: &Formula, bound: &Bound) -> f64 {
        self.work += 1;
        match formula {
            Formula::Pattern(pattern) => {
                self.work += pattern.arguments.len() / 8;
                self.estimate_pattern(pattern, bound)
            }
            Formula::And(parts) => {
                let mut now = bound.clone();
                parts.iter().fold(1.0, |rows, part| {
                    let rows = rows * self.estimate(part, &now);
                    self.bind(part, &mut now);
                    rows
                })
            }
            Formula::Or(parts, ..) => parts.iter().map(|part| self.estimate(part, bound)).sum(),
            Formula::Not(_) | Formula::Test(_) => 1.0,
        }
    }

    fn estimate_pattern(&self, pattern: &Pattern, bound: &Bound) -> f64 {
        let terms = &self.database.terms;
        let mut mask = 0_u64;
        let (mut known, mut constant) = (0, 0);
        for (position, &argument) in pattern.arguments.iter().enumerate() {
            let mut is_known = true;
            terms.variables(argument, &mut |variable| is_known &= bound[variable]);
            if is_known {
                known += 1;
                if position < INDEXED_POSITIONS {
                    mask |= 1 << position;
                }
            }
            constant += usize::from(terms.is_ground(argument));
        }
        if self.rules.matching(pattern).next().is_some() {
            return if known > 0 { SOME / known as f64 } else { MANY };
        }
        if pattern.functor.as_variable().is_some() || pattern.tail != Term::NIL {
            return (self.database.facts() as f64).powf(1.0 / (1.0 + known as f64));
        }
        let Some(relation) = self.database.find_relation(pattern.functor, pattern.arguments.len()) else {
            return 0.0;
        };
        let is_all = known == pattern.arguments.len();
        let key = if known == constant { Some(pattern.arguments.as_slice()) } else { None };
        self.database.relations[relation as usize].estimate(mask, is_all, key)
    }
}
