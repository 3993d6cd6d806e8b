//! Queries: from what is asked to the answers, in steps.
//!
//! A query sees the facts and rules that there were when it began. It is asked for the next step until it has found all
//! answers, between which it may ask for the outcome of a test; the answers are then taken in portions.
//!
//! Guarantees: answers come in the order in which nested loops over the patterns of the query, in the order of the text, would
//! find them, each over its facts in the order in which they were asserted; what follows from rules, in the order in which
//! it was derived. That does not depend on the order in which the patterns are looked up: where that is another one, answers
//! are put into order at the end. No answer comes twice.

use std::cmp::Ordering;
use std::collections::{BTreeMap, BinaryHeap, VecDeque};
use std::sync::Arc;

use smallvec::SmallVec;

use super::Database;
use super::formula::{Formula, FormulaError, FormulaParser, Pattern, TestForm};
use super::plan::{Goal, GoalId, Planner};
use super::rule::{Rule, Rules};
use super::solver::{Choice, MatchOperation, SolverState};
use super::term::{Term, TermError};
use super::tuple::Tuples;
use crate::heap::Heap;
use crate::value::Value;

/// Where answers go.
#[derive(Clone, Debug)]
pub(super) enum Sink {
    /// To the program.
    Query,
    /// The facts that a table has besides what follows from rules.
    Facts(u32),
    /// What follows from a rule.
    Rule(u32, Arc<Rule>),
}

/// The answers to a call of a predicate with rules: its arguments, with variables numbered as they come.
#[derive(Debug)]
pub(super) struct Answers {
    pub(super) predicate: usize,
    pub(super) call: Vec<Term>,
    pub(super) stratum: usize,
    pub(super) width: usize,
    /// Values of the variables.
    pub(super) tuples: Tuples,
    /// Who goes on with each answer.
    pub(super) consumers: Vec<u32>,
}

/// A computation that goes on with each answer of a table, those that are yet to be found included.
#[derive(Clone, Debug)]
pub(super) struct Consumer {
    pub(super) table: u32,
    /// The next answer.
    pub(super) at: usize,
    /// Whether it has had all answers that there are.
    pub(super) is_idle: bool,
    /// Its variables that stand for those of the table.
    pub(super) variables: SmallVec<[u32; 4]>,
    pub(super) continuation: Continuation,
    pub(super) rank: usize,
}

/// Where a computation goes on.
#[derive(Clone, Debug)]
pub(super) struct Continuation {
    pub(super) goal: GoalId,
    pub(super) sink: u32,
    pub(super) bindings: Box<[Term]>,
    pub(super) keys: Box<[u64]>,
}

/// What is yet to be done.
#[derive(Debug)]
pub(super) enum AgendaItem {
    /// Finds the answers of a table: its facts, then from each rule.
    Expand { table: u32, rule: usize },
    /// Gives answers to a consumer.
    Feed(u32),
    /// Goes on.
    Resume(Continuation),
}

/// An answer with its place among the others.
#[derive(Debug)]
pub(super) struct RankedAnswer {
    pub(super) keys: Box<[u64]>,
    pub(super) number: usize,
    pub(super) values: Box<[Term]>,
}

impl PartialEq for RankedAnswer {
    fn eq(&self, other: &RankedAnswer) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for RankedAnswer {}

impl PartialOrd for RankedAnswer {
    fn partial_cmp(&self, other: &RankedAnswer) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// The greatest is the one that comes first.
impl Ord for RankedAnswer {
    fn cmp(&self, other: &RankedAnswer) -> Ordering {
        (&other.keys, other.number).cmp(&(&self.keys, self.number))
    }
}

/// What a step has come to.
#[derive(Debug, PartialEq)]
pub(crate) enum Progress {
    /// There is more to do.
    More,
    /// The outcome of a test is wanted: its function, and the variables with their values.
    Test(Term, Vec<(Term, Term)>),
    /// All answers have been found.
    Done,
}

/// Why a query cannot be answered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum QueryError {
    /// A rule with this functor negates what follows from it.
    Circular(Term),
    /// A rule with this functor leaves a variable of its head without a value.
    Unbound(Term),
    /// It builds too large a term.
    TooLarge,
}

impl From<TermError> for QueryError {
    fn from(_: TermError) -> QueryError {
        QueryError::TooLarge
    }
}

/// A query that is being answered.
#[derive(Debug)]
pub(crate) struct Query {
    /// The change after which it began.
    pub(super) time: u64,
    pub(super) rules: Arc<Rules>,
    pub(super) names: Vec<Term>,
    pub(super) goals: Vec<Goal>,
    /// Entry goals of rules, by table-independent key: predicate, rule, and which arguments are given.
    pub(super) rule_goals: BTreeMap<(usize, usize, u64), GoalId>,

    // ---- rules
    pub(super) tables: Vec<Answers>,
    /// Bytes of their answers, about.
    pub(super) table_bytes: usize,
    /// Tables by the hash of their call.
    pub(super) by_call: super::bucket::Buckets,
    pub(super) consumers: Vec<Consumer>,
    pub(super) sinks: Vec<Sink>,
    /// What is yet to be done, by stratum.
    pub(super) agenda: Vec<VecDeque<AgendaItem>>,

    // ---- what is being computed
    pub(super) state: SolverState,
    pub(super) sink: u32,
    pub(super) stratum: usize,
    pub(super) bindings: Vec<Term>,
    pub(super) trail: Vec<u32>,
    pub(super) choices: Vec<Choice>,
    pub(super) operations: Vec<MatchOperation>,
    /// The places of facts among those of their patterns, by rank; for the order of answers.
    pub(super) keys: Vec<u64>,
    /// Terms that it holds.
    pub(super) held: Vec<Term>,

    // ---- answers
    /// Those variables whose values are asked for.
    pub(super) asked: Vec<u32>,
    pub(super) is_reordered: bool,
    /// Whether one answer may be found twice.
    pub(super) may_repeat: bool,
    pub(super) placed: BinaryHeap<RankedAnswer>,
    pub(super) found: usize,
    pub(super) tuples: Tuples,
    /// The facts themselves, where these are asked for.
    pub(super) rows: Option<Vec<(u32, u32)>>,
    /// How many answers were taken.
    pub(super) taken: usize,
}

impl Query {
    /// Begins a query. With `wants_facts`, it has to be one pattern, the answers are the facts that match it, and rules
    /// do not count.
    pub(super) fn begin(
        database: &mut Database,
        heap: &mut Heap,
        query: Value,
        inherited: Value,
        wants_facts: bool,
        work: &mut usize,
    ) -> Result<Query, FormulaError> {
        let mut parser = FormulaParser::new(&mut database.terms, heap, query);
        let parsed = parser.inherit(inherited).and_then(|()| match wants_facts {
            true => parser.pattern(query).map(Formula::Pattern),
            false => parser.formula(query, 0),
        });
        *work += parser.work();
        let FormulaParser { held, names, ranks, .. } = parser;
        let formula = match parsed {
            Ok(formula) => formula,
            Err(error) => {
                held.into_iter().for_each(|term| database.terms.release(term));
                return Err(error);
            }
        };
        let rules = if wants_facts { Arc::default() } else { database.rules.clone() };
        let mut goals = Vec::with_capacity(4);
        goals.push(Goal::Solved);
        let mut planner =
            Planner { database, rules: &rules, goals: &mut goals, is_reordered: false, work: 0 };
        let start = planner.plan(&formula, &mut vec![false; names.len()], 0);
        *work += planner.work;
        let is_reordered = planner.is_reordered;
        let asked: Vec<u32> =
            (0..names.len() as u32).filter(|&variable| !names[variable as usize].is_unbound()).collect();
        let strata = rules.strata;
        Ok(Query {
            time: database.time,
            may_repeat: asked.len() < names.len() || may_repeat(&formula),
            rules,
            goals,
            rule_goals: BTreeMap::new(),
            tables: Vec::new(),
            table_bytes: 0,
            by_call: Default::default(),
            consumers: Vec::new(),
            sinks: vec![Sink::Query],
            agenda: (0..strata).map(|_| VecDeque::new()).collect(),
            state: SolverState::Goal(start),
            sink: 0,
            stratum: strata,
            bindings: vec![Term::UNBOUND; names.len()],
            trail: Vec::new(),
            choices: Vec::new(),
            operations: Vec::new(),
            keys: vec![0; ranks],
            held,
            tuples: Tuples::new(asked.len()),
            asked,
            names,
            is_reordered,
            placed: BinaryHeap::new(),
            found: 0,
            rows: wants_facts.then(Vec::new),
            taken: 0,
        })
    }

    /// Notes an answer for the program.
    pub(super) fn answer(&mut self) {
        if self.rows.is_some() {
            return;
        }
        let Query { bindings, asked, tuples, .. } = self;
        let values = asked.iter().map(|&variable| bindings[variable as usize]);
        if self.is_reordered {
            let keys = self.keys.clone().into();
            self.placed.push(RankedAnswer { keys, number: self.found, values: values.collect() });
            self.found += 1;
        } else if self.may_repeat {
            tuples.insert(values);
        } else {
            tuples.push(values);
        }
    }

    /// Puts answers into order; whether all are.
    pub(super) fn put_into_order(&mut self, work: &mut usize) -> bool {
        while let Some(placed) = self.placed.pop() {
            let values = placed.values.iter().copied();
            if self.may_repeat {
                self.tuples.insert(values);
            } else {
                self.tuples.push(values);
            }
            match work.checked_sub(1 + self.placed.len().checked_ilog2().unwrap_or(0) as usize) {
                Some(left) => *work = left,
                None => return false,
            }
        }
        true
    }

    /// The next answer: the variables that have a value.
    pub(super) fn next_answer(&self, ahead: usize) -> Option<impl Iterator<Item = (Term, Term)>> {
        let at = self.taken + ahead;
        if at >= self.tuples.len() {
            return None;
        }
        let values = self.asked.iter().zip(self.tuples.get(at));
        let named = values.map(|(&variable, &value)| (self.names[variable as usize], value));
        Some(named.filter(|(_, value)| !value.is_unbound()))
    }

    /// Bytes in use, about.
    pub(super) fn bytes(&self) -> usize {
        let consumers = self.consumers.len() * (size_of::<Consumer>() + 64);
        let placed = self.placed.len() * 96;
        self.table_bytes + consumers + placed + self.tuples.bytes() + 8 * self.held.len()
    }
}

/// Whether a formula may have an answer twice, in which all variables are asked for.
fn may_repeat(formula: &Formula) -> bool {
    match formula {
        // Facts are a set, and so is what follows from rules.
        Formula::Pattern(pattern) => !is_plain(pattern),
        Formula::And(parts) => parts.iter().any(may_repeat),
        Formula::Or(..) => true,
        // What is inside leaves no bindings.
        Formula::Not(_) | Formula::Test(_) => false,
    }
}

fn is_plain(pattern: &Pattern) -> bool {
    pattern.functor.as_variable().is_none() && pattern.tail == Term::NIL
}

/// The variables of a test that have values.
pub(super) fn test_bindings(test: &TestForm, names: &[Term], bindings: &[Term]) -> Vec<(Term, Term)> {
    let all = test.variables.iter().map(|&variable| (names[variable as usize], bindings[variable as usize]));
    all.filter(|(_, value)| !value.is_unbound()).collect()
}
