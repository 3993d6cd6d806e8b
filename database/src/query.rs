//! Queries: from the question to the answers, in steps.
//!
//! A query sees the facts and rules as they were when it began. The caller runs it step by step until all
//! answers are found; between steps the query may request the outcome of a test. The answers are then taken
//! in portions.
//!
//! Guarantees: answers come in the order in which nested loops over the patterns of the query, in the order
//! of the text, would find them, each loop over its facts in the order of assertion; derived facts, in the
//! order of derivation. Evaluation may use another order; then the answers are sorted at the end. No answer
//! comes twice.

use std::cmp::Ordering;
use std::collections::{BTreeMap, BinaryHeap, VecDeque};
use std::sync::Arc;

use esl_heap::Value;
use esl_heap::heap::Heap;
use smallvec::SmallVec;

use super::Database;
use super::effort::{Effort, ITEM};
use super::formula::{Formula, FormulaError, FormulaParser, Pattern, TestForm};
use super::plan::{Goal, GoalId, Planner};
use super::rule::{Rule, Rules};
use super::solver::{Choice, MatchOperation, SolverState};
use super::term::{Term, TermError};
use super::tuple::Tuples;

/// Destination of answers.
#[derive(Clone, Debug)]
pub(super) enum Sink {
    /// The program.
    Query,
    /// A table: the answers that are facts.
    Facts(u32),
    /// A table: the answers that a rule derives.
    Rule(u32, Arc<Rule>),
}

/// A table: the answers to a call of a predicate with rules. The call has the arguments, with variables
/// numbered in the order of their occurrence.
#[derive(Debug)]
pub(super) struct Answers {
    pub(super) predicate: usize,
    pub(super) call: Vec<Term>,
    pub(super) stratum: usize,
    pub(super) width: usize,
    /// Values of the variables.
    pub(super) tuples: Tuples,
    /// Computations that continue with each answer and have had all that were found so far. The others are in
    /// the agenda, or at work.
    pub(super) idle: Vec<u32>,
}

/// A computation that continues with each answer of a table, including those yet to be found.
#[derive(Clone, Debug)]
pub(super) struct Consumer {
    pub(super) table: u32,
    /// Index of the next answer.
    pub(super) at: usize,
    /// Its variables for those of the table.
    pub(super) variables: SmallVec<[u32; 4]>,
    pub(super) continuation: Continuation,
    pub(super) rank: usize,
}

/// The rest of a computation.
#[derive(Clone, Debug)]
pub(super) struct Continuation {
    pub(super) goal: GoalId,
    pub(super) sink: u32,
    pub(super) bindings: Box<[Term]>,
    pub(super) keys: Box<[u64]>,
}

impl Continuation {
    /// Returns the bytes that it takes, approximately.
    pub(super) fn bytes(&self) -> usize {
        size_of::<Continuation>() + 32 + 8 * (self.bindings.len() + self.keys.len())
    }
}

/// A piece of work to be done.
#[derive(Debug)]
pub(super) enum AgendaItem {
    /// Find the answers of a table: from its facts, then from each rule.
    Expand { table: u32, rule: usize },
    /// Give answers to a consumer.
    Feed(u32),
    /// Resume a computation.
    Resume(Continuation),
}

/// An answer with its sort key.
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

/// The greatest is the one that comes first, as the heap pops the greatest.
impl Ord for RankedAnswer {
    fn cmp(&self, other: &RankedAnswer) -> Ordering {
        (&other.keys, other.number).cmp(&(&self.keys, self.number))
    }
}

/// The outcome of a step.
#[derive(Debug, PartialEq)]
pub enum Progress {
    /// There is more to do.
    More,
    /// The query requests the outcome of a test: its function, and the variables with their values.
    Test(Term, Vec<(Term, Term)>),
    /// All answers have been found.
    Done,
}

/// Why a query failed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum QueryError {
    /// A rule with this functor depends on its own negation.
    Circular(Term),
    /// A rule with this functor leaves a variable of its head without a value.
    Unbound(Term),
    /// A term has too many pairs.
    TooLarge,
}

impl From<TermError> for QueryError {
    fn from(_: TermError) -> QueryError {
        QueryError::TooLarge
    }
}

/// An open query.
#[derive(Debug)]
pub(crate) struct Query {
    /// Number of the latest change when it began.
    pub(super) time: u64,
    pub(super) rules: Arc<Rules>,
    pub(super) names: Vec<Term>,
    pub(super) goals: Vec<Goal>,
    /// First goals of rules, by predicate, rule, and mask of given arguments; independent of tables.
    pub(super) rule_goals: BTreeMap<(usize, usize, u64), GoalId>,

    // ---- rules
    pub(super) tables: Vec<Answers>,
    /// Bytes of them and their answers, approximately.
    pub(super) table_bytes: usize,
    /// Bytes of suspended computations, approximately.
    pub(super) waiting_bytes: usize,
    /// Tables by the hash of their call.
    pub(super) by_call: super::bucket::Buckets,
    pub(super) consumers: Vec<Consumer>,
    pub(super) sinks: Vec<Sink>,
    /// Work to be done, by stratum.
    pub(super) agenda: Vec<VecDeque<AgendaItem>>,

    // ---- the current computation
    pub(super) state: SolverState,
    pub(super) sink: u32,
    pub(super) stratum: usize,
    pub(super) bindings: Vec<Term>,
    pub(super) trail: Vec<u32>,
    pub(super) choices: Vec<Choice>,
    pub(super) operations: Vec<MatchOperation>,
    /// Position of each fact among those of its pattern, by rank; the sort key of an answer.
    pub(super) keys: Vec<u64>,
    /// Terms that the query holds.
    pub(super) held: Vec<Term>,

    // ---- answers
    /// Numbers of the variables whose values are asked for.
    pub(super) asked: Vec<u32>,
    pub(super) is_reordered: bool,
    /// Whether an answer may be found more than once.
    pub(super) may_repeat: bool,
    pub(super) placed: BinaryHeap<RankedAnswer>,
    /// Bytes of those, approximately.
    pub(super) placed_bytes: usize,
    pub(super) found: usize,
    pub(super) tuples: Tuples,
    /// The facts found, as relation and row, if the caller asked for facts.
    pub(super) rows: Option<Vec<(u32, u32)>>,
    /// Number of answers taken.
    pub(super) taken: usize,
}

/// The lists of a query that is closed, empty: the next one takes their memory.
#[derive(Debug, Default)]
pub(super) struct QueryRoom {
    names: Vec<Term>,
    goals: Vec<Goal>,
    sinks: Vec<Sink>,
    bindings: Vec<Term>,
    trail: Vec<u32>,
    choices: Vec<Choice>,
    operations: Vec<MatchOperation>,
    keys: Vec<u64>,
    asked: Vec<u32>,
}

impl QueryRoom {
    /// Most items of a list for which there is room: no list takes more than a few kilobytes.
    const MOST: usize = 64;

    /// Takes the lists of a query.
    pub(super) fn of(query: Query) -> QueryRoom {
        fn emptied<T>(mut list: Vec<T>) -> Vec<T> {
            list.clear();
            if list.capacity() <= QueryRoom::MOST { list } else { Vec::new() }
        }
        QueryRoom {
            names: emptied(query.names),
            goals: emptied(query.goals),
            sinks: emptied(query.sinks),
            bindings: emptied(query.bindings),
            trail: emptied(query.trail),
            choices: emptied(query.choices),
            operations: emptied(query.operations),
            keys: emptied(query.keys),
            asked: emptied(query.asked),
        }
    }
}

impl Query {
    /// Begins a query. With `wants_facts` the question must be a single pattern; the answers are the facts
    /// that match it, and rules do not count.
    pub(super) fn begin(
        database: &mut Database,
        heap: &mut Heap,
        query: Value,
        inherited: Value,
        wants_facts: bool,
        work: &mut usize,
    ) -> Result<Query, FormulaError> {
        let room = std::mem::take(&mut database.room);
        let mut parser = FormulaParser::new(&mut database.terms, heap, query);
        parser.names = room.names;
        let parsed = parser.inherit(inherited).and_then(|()| match wants_facts {
            true => parser.pattern(query).map(Formula::Pattern),
            false => parser.formula(query, 0),
        });
        *work += parser.work();
        let FormulaParser { held, names, ranks, .. } = parser;
        *work += database.terms.take_work();
        let formula = match parsed {
            Ok(formula) => formula,
            Err(error) => {
                held.into_iter().for_each(|term| database.terms.release(term));
                return Err(error);
            }
        };
        if !wants_facts && !database.rules.is_stratified() {
            *work += database.rules_to_copy();
            Arc::make_mut(&mut database.rules).stratify(work);
        }
        let rules = if wants_facts { Arc::default() } else { database.rules.clone() };
        let QueryRoom { mut goals, mut sinks, mut bindings, mut keys, mut asked, .. } = room;
        goals.push(Goal::Solved);
        sinks.push(Sink::Query);
        bindings.resize(names.len(), Term::UNBOUND);
        keys.resize(ranks, 0);
        let is_asked = |&variable: &u32| !names[variable as usize].is_unbound();
        asked.extend((0..names.len() as u32).filter(is_asked));
        let mut planner =
            Planner { database, rules: &rules, goals: &mut goals, is_reordered: false, work: 0 };
        // A pattern is not asked what is bound.
        let count = if let Formula::Pattern(_) = formula { 0 } else { names.len() };
        let start = planner.plan(&formula, &mut vec![false; count], 0);
        *work += planner.work;
        let is_reordered = planner.is_reordered;
        let strata = rules.strata;
        Ok(Query {
            time: database.time,
            may_repeat: asked.len() < names.len() || may_repeat(&formula),
            rules,
            goals,
            rule_goals: BTreeMap::new(),
            tables: Vec::new(),
            table_bytes: 0,
            waiting_bytes: 0,
            placed_bytes: 0,
            by_call: Default::default(),
            consumers: Vec::new(),
            sinks,
            agenda: (0..strata).map(|_| VecDeque::new()).collect(),
            state: SolverState::Goal(start),
            sink: 0,
            stratum: strata,
            bindings,
            trail: room.trail,
            choices: room.choices,
            operations: room.operations,
            keys,
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

    /// Records an answer for the program.
    pub(super) fn answer(&mut self, effort: &mut Effort) {
        if self.rows.is_some() {
            return;
        }
        effort.spend_cells(self.asked.len());
        let ranked = ranked_bytes(&self.keys, &self.asked);
        let Query { bindings, asked, tuples, .. } = self;
        let values = asked.iter().map(|&variable| bindings[variable as usize]);
        if self.is_reordered {
            effort.spend_cells(self.keys.len());
            self.placed_bytes += ranked;
            let keys = self.keys.clone().into();
            self.placed.push(RankedAnswer { keys, number: self.found, values: values.collect() });
            self.found += 1;
        } else if self.may_repeat {
            tuples.insert(values);
        } else {
            tuples.push(values);
        }
    }

    /// Sorts the answers. Returns false if the effort is used up before the end.
    pub(super) fn put_into_order(&mut self, effort: &mut Effort) -> bool {
        while let Some(placed) = self.placed.pop() {
            self.placed_bytes -= ranked_bytes(&self.keys, &self.asked);
            effort.spend_cells(placed.values.len());
            let values = placed.values.iter().copied();
            if self.may_repeat {
                self.tuples.insert(values);
            } else {
                self.tuples.push(values);
            }
            let comparisons = self.placed.len().checked_ilog2().unwrap_or(0) as usize;
            effort.spend(comparisons * ITEM);
            effort.spend_cells(comparisons * placed.keys.len() / 4);
            if !effort.take_item() {
                return false;
            }
        }
        true
    }

    /// Returns the variables with values of the next answer, or of one further `ahead`.
    pub(super) fn next_answer(&self, ahead: usize) -> Option<impl Iterator<Item = (Term, Term)>> {
        let at = self.taken + ahead;
        if at >= self.tuples.len() {
            return None;
        }
        let values = self.asked.iter().zip(self.tuples.get(at));
        let named = values.map(|(&variable, &value)| (self.names[variable as usize], value));
        Some(named.filter(|(_, value)| !value.is_unbound()))
    }

    /// Returns the bytes in use, approximately.
    pub(super) fn bytes(&self) -> usize {
        let goals = self.goals.len() * size_of::<Goal>();
        let queued = goals + self.table_bytes + self.waiting_bytes + self.placed_bytes;
        queued + self.tuples.bytes() + 8 * self.held.len()
    }
}

/// Returns the bytes that an answer with its sort key takes, approximately.
fn ranked_bytes(keys: &[u64], asked: &[u32]) -> usize {
    size_of::<RankedAnswer>() + 32 + 8 * (keys.len() + asked.len())
}

/// Returns whether a formula may have the same answer twice, if the values of all variables are asked for.
fn may_repeat(formula: &Formula) -> bool {
    match formula {
        // Facts are a set, and so are derived facts.
        Formula::Pattern(pattern) => !is_plain(pattern),
        Formula::And(parts) => parts.iter().any(may_repeat),
        Formula::Or(..) => true,
        // Bindings made inside do not survive.
        Formula::Not(_) | Formula::Test(_) => false,
    }
}

fn is_plain(pattern: &Pattern) -> bool {
    pattern.functor.as_variable().is_none() && pattern.tail == Term::NIL
}

/// Returns the variables of a test that have values.
pub(super) fn test_bindings(test: &TestForm, names: &[Term], bindings: &[Term]) -> Vec<(Term, Term)> {
    let all = test.variables.iter().map(|&variable| (names[variable as usize], bindings[variable as usize]));
    all.filter(|(_, value)| !value.is_unbound()).collect()
}
