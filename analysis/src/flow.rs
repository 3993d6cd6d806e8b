//! The flow of values: which functions, names, tasks and conditions may arrive where.
//!
//! Inclusion constraints in the manner of Andersen, solved while the program is discovered: a function is
//! looked at when a call of it is found. A function that calls its own arguments is looked at anew for each
//! place that calls it, so that the function of one caller does not leak into another (call strings of at
//! most [`DEPTH`] calls). Sources: Shivers 1991; Andersen 1994.

use std::collections::VecDeque;
use std::rc::Rc;

use esl_bytecode::symbol::Symbol;
use esl_compiler::core::NodeId;
use rustc_hash::{FxHashMap, FxHashSet};

use crate::cells::{Cells, Sending};
use crate::effect::NodeEffect;
use crate::forms::CoreForms;
use crate::many::ManyCalls;
use crate::objects::JoinedObjects;
use crate::value::{
    CellId, CellKey, Code, ContextId, FlowValue, NO_CONTEXT, NameId, Numbering, PointId, Spot, TaskKind,
    TaskWork, ThingId, ThingKey, WorkId, WorkKey,
};

/// Most calls in a context.
pub(crate) const DEPTH: usize = 3;
/// Most pieces of code, contexts told apart, until contexts are no longer told apart.
const MOST_CODE: usize = 20_000;
/// Most work until the analysis is given up, which takes thousands of functions that all call each other as
/// values: [`ManyCalls`] has the work grow with their number, but not their sets.
const MOST_ARRIVALS: usize = 20_000_000;

/// A place that looks at the values that arrive in a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum FlowWatcher {
    /// The contents of objects flow on.
    Contents(CellId),
    /// The first elements of objects flow on.
    First(CellId),
    /// Objects are lists of which only a part may arrive: any element may be the first.
    Parts,
    /// The contents of objects, and of the objects in there, flow on.
    AllContents(CellId),
    /// The values of this cell flow into objects.
    Store(CellId),
    /// Functions are called.
    Call(PointId),
    /// Functions are called at each place with too many functions.
    CallAmongMany,
    /// Conditions and causes fail at this spot.
    Fail(Spot),
    /// Tasks' failures are failures at this spot.
    FailAs(Spot),
    /// Failures of all tasks together are one failure at this spot.
    FailAll(Spot),
    /// Handles are waited for: their values flow on.
    ValuesOf(CellId),
    /// The cause of conditions flows on.
    Causes(CellId),
    /// The cause with which tasks have ended flows on.
    Ends(CellId),
    /// The methods of generic functions flow on.
    Methods(CellId),
    /// Names of properties are achieved at this spot, for a lock.
    Lock(Spot),
}

/// Way in which failures of a called function count.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Passing {
    /// They leave the call.
    Through,
    /// They leave the call, and begin within other code that it calls.
    Interrupting,
    /// They end there; the form fails otherwise, or goes on.
    Absorbed,
    /// They end a task.
    Task(WorkId),
}

/// Arguments of a call.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub(crate) struct CallArguments {
    /// Each with the keyword that it is, if that is known.
    pub(crate) given: Vec<(CellId, Option<Symbol>)>,
    /// Lists of further ones.
    pub(crate) lists: Vec<CellId>,
    /// Values that may arrive in any parameter.
    pub(crate) any: Vec<CellId>,
}

/// A call of values.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct CallPoint {
    pub(crate) spot: Spot,
    pub(crate) arguments: CallArguments,
    pub(crate) result: Option<CellId>,
    pub(crate) passing: Passing,
    /// Whether symbols are called, too.
    pub(crate) symbols: bool,
}

/// A piece of code that may run.
#[derive(Debug)]
pub(crate) struct RunningCode {
    pub(crate) code: Code,
    /// Effects of nodes, in the order in which they were found.
    pub(crate) effects: Vec<(NodeId, NodeEffect)>,
}

/// The analysis under way.
#[derive(Debug)]
pub(crate) struct ValueFlow<'a> {
    pub(crate) forms: &'a CoreForms,
    /// Most calls in a context of this analysis.
    depth: usize,
    pub(crate) cell_keys: Numbering<CellKey>,
    pub(crate) cells: Cells<FlowWatcher>,
    pub(crate) values: Numbering<FlowValue>,
    pub(crate) points: Numbering<Rc<CallPoint>>,
    pub(crate) names: Numbering<Symbol>,
    pub(crate) things: Numbering<ThingKey>,
    work_keys: Numbering<WorkKey>,
    pub(crate) works: Vec<TaskWork>,
    contexts: Numbering<(Spot, ContextId)>,
    running_numbers: FxHashMap<Code, usize>,
    pub(crate) running: Vec<RunningCode>,
    seen: FxHashSet<(Spot, NodeEffect)>,
    unread: VecDeque<usize>,
    /// Objects whose first elements are told apart from the others.
    pub(crate) exact: FxHashSet<ThingId>,
    /// Objects that are not told apart any more.
    pub(crate) objects: JoinedObjects,
    /// Calls at places with too many functions.
    pub(crate) many: ManyCalls,
    /// Spots that fail with a computed cause.
    pub(crate) computed: Vec<Spot>,
    /// Positions of parameters that a function calls, for functions that have such.
    pub(crate) calls_arguments: FxHashSet<(u32, u32)>,
    /// Names of symbols that matter as values.
    pub(crate) interesting: FxHashSet<Symbol>,
}

impl<'a> ValueFlow<'a> {
    /// Creates an analysis that has not seen any code, with at most `depth` calls in a context.
    pub(crate) fn new(forms: &'a CoreForms, depth: usize) -> ValueFlow<'a> {
        let spot = Spot { form: u32::MAX, node: NodeId(0), context: NO_CONTEXT };
        let mut contexts = Numbering::default();
        contexts.number(&(spot, NO_CONTEXT));
        ValueFlow {
            forms,
            depth,
            cell_keys: Numbering::default(),
            cells: Cells::new(),
            values: Numbering::default(),
            points: Numbering::default(),
            names: Numbering::default(),
            things: Numbering::default(),
            work_keys: Numbering::default(),
            works: Vec::new(),
            contexts,
            running_numbers: FxHashMap::default(),
            running: Vec::new(),
            seen: FxHashSet::default(),
            unread: VecDeque::new(),
            exact: FxHashSet::default(),
            objects: JoinedObjects::default(),
            many: ManyCalls::default(),
            computed: Vec::new(),
            calls_arguments: crate::hot::calling_their_arguments(forms),
            interesting: forms
                .defined
                .keys()
                .chain(&forms.noted)
                .chain(forms.parents.keys())
                .cloned()
                .collect(),
        }
    }

    /// Returns the cell of a key.
    pub(crate) fn cell(&mut self, key: CellKey) -> CellId {
        let (number, is_new) = self.cell_keys.number(&key);
        if is_new {
            self.cells.create();
        }
        CellId(number)
    }

    /// Returns the cell of the value of a node.
    pub(crate) fn at(&mut self, spot: Spot) -> CellId {
        self.cell(CellKey::Node(spot))
    }

    /// Returns the number of a symbol.
    pub(crate) fn name(&mut self, symbol: &Symbol) -> NameId {
        NameId(self.names.number(symbol).0)
    }

    /// Returns the symbol with a number.
    pub(crate) fn symbol(&self, name: NameId) -> &Symbol {
        &self.names.keys[name.index()]
    }

    /// Returns an object.
    pub(crate) fn thing(&mut self, key: ThingKey) -> ThingId {
        ThingId(self.things.number(&key).0)
    }

    /// Returns the cell of the contents of an object that `spot` makes, and puts the object at `to`.
    pub(crate) fn make(&mut self, spot: Spot, part: u8, to: CellId) -> CellId {
        let thing = self.thing(ThingKey::Made(spot, part));
        self.add(to, FlowValue::Thing(thing));
        self.cell(CellKey::Contents(thing))
    }

    /// Returns the cells of the first element and of the contents of a list that `spot` makes, and puts the
    /// list at `to`.
    pub(crate) fn make_exact(&mut self, spot: Spot, part: u8, to: CellId) -> (CellId, CellId) {
        let thing = self.thing(ThingKey::Made(spot, part));
        self.exact.insert(thing);
        self.add(to, FlowValue::Thing(thing));
        let (first, contents) = (self.cell(CellKey::First(thing)), self.cell(CellKey::Contents(thing)));
        self.copy(first, contents);
        (first, contents)
    }

    /// Returns a cell beside that of the value of a spot.
    pub(crate) fn beside(&mut self, spot: Spot) -> CellId {
        let thing = self.thing(ThingKey::Made(spot, u8::MAX - 2));
        self.cell(CellKey::Contents(thing))
    }

    /// Returns a task or an operation.
    pub(crate) fn work(&mut self, key: WorkKey, kind: TaskKind) -> WorkId {
        let (number, is_new) = self.work_keys.number(&key);
        if is_new {
            self.works.push(TaskWork { key, kind, is_awaited: false });
        }
        WorkId(number)
    }

    /// Adds a value to a cell.
    pub(crate) fn add(&mut self, cell: CellId, value: FlowValue) {
        let number = self.values.number(&self.objects.standing_for(value)).0;
        self.cells.add(cell, number);
    }

    /// Has the values of a cell flow to another one.
    pub(crate) fn copy(&mut self, from: CellId, to: CellId) {
        self.cells.copy(from, to);
    }

    /// Has the values of a cell, and those that come, looked at.
    pub(crate) fn watch(&mut self, cell: CellId, watcher: FlowWatcher) {
        self.cells.watch(cell, watcher);
    }

    /// Has the functions in a cell be called.
    pub(crate) fn call_at(&mut self, function: CellId, point: CallPoint) {
        let point = PointId(self.points.number(&Rc::new(point)).0);
        self.watch(function, FlowWatcher::Call(point));
    }

    /// Notes an effect of a node.
    pub(crate) fn note(&mut self, spot: Spot, effect: NodeEffect) {
        if self.seen.insert((spot, effect)) {
            let form = &self.forms.forms[spot.form as usize];
            let owner = form.owners[spot.node.index()];
            let running = self.run(Code { form: spot.form, lambda: owner, context: spot.context });
            self.running[running].effects.push((spot.node, effect));
            self.replace(spot, effect);
        }
    }

    /// Has the values of clauses flow to a call that fails.
    fn replace(&mut self, spot: Spot, effect: NodeEffect) {
        let key = match effect {
            NodeEffect::Mistake(_) => CellKey::ReplacementsOfMistakes,
            NodeEffect::Fail(_)
            | NodeEffect::FailAs(_)
            | NodeEffect::FailAllWith(_)
            | NodeEffect::Again(_)
            | NodeEffect::AgainByCause(_)
            | NodeEffect::FailByCauseOf(_) => CellKey::Replacements,
            _ => return,
        };
        let (replacements, value) = (self.cell(key), self.at(spot));
        self.copy(replacements, value);
    }

    /// Returns the number of a piece of code, which is looked at if it is new.
    pub(crate) fn run(&mut self, code: Code) -> usize {
        if let Some(number) = self.running_numbers.get(&code) {
            return *number;
        }
        let number = self.running.len();
        self.running_numbers.insert(code, number);
        self.running.push(RunningCode { code, effects: Vec::new() });
        self.unread.push_back(number);
        number
    }

    /// Returns the number of a piece of code that has been found.
    pub(crate) fn number_of(&self, code: Code) -> Option<usize> {
        self.running_numbers.get(&code).copied()
    }

    /// Returns the context in which a function runs that `spot` calls.
    pub(crate) fn context_for(&mut self, code: Code, spot: Spot) -> ContextId {
        if !self.calls_arguments.contains(&(code.form, code.lambda.0)) {
            return code.context;
        }
        if self.depth == 0 || self.running.len() > MOST_CODE {
            return NO_CONTEXT;
        }
        let bare = Spot { context: NO_CONTEXT, ..spot };
        // A call that is in the context already is a recursion.
        let mut row = Vec::new();
        let mut context = spot.context;
        while context != NO_CONTEXT {
            let (called, outer) = self.contexts.keys[context.0 as usize];
            if called == bare {
                return context;
            }
            row.push(called);
            context = outer;
        }
        row.insert(0, bare);
        row.truncate(self.depth);
        let mut result = NO_CONTEXT;
        for called in row.into_iter().rev() {
            result = ContextId(self.contexts.number(&(called, result)).0);
        }
        result
    }

    /// Returns whether the analysis was given up because too many values flow: what it has found is a part.
    pub(crate) fn was_given_up(&self) -> bool {
        self.cells.sent > MOST_ARRIVALS
    }

    /// Looks at all code and all values until there are no new ones, or too many.
    pub(crate) fn solve(&mut self) {
        while !self.was_given_up() {
            if let Some(number) = self.unread.pop_front() {
                let code = self.running[number].code;
                self.read(code);
                continue;
            }
            let Some(Sending { cell, values, watchers }) = self.cells.next() else { return };
            if std::mem::take(&mut self.cells.has_merged) {
                self.join_equal_objects();
            }
            self.join_objects(cell, &watchers);
            self.crowd(cell, &watchers);
            let values = self.values_in(&values);
            self.cells.sent += values.len() * watchers.len();
            for watcher in watchers {
                for value in &values {
                    self.arrive(watcher, *value);
                }
            }
        }
    }

    /// Does as a watcher says with a value.
    fn arrive(&mut self, watcher: FlowWatcher, value: FlowValue) {
        match watcher {
            FlowWatcher::Contents(to) => {
                if let FlowValue::Thing(thing) = value {
                    let contents = self.cell(CellKey::Contents(thing));
                    self.copy(contents, to);
                }
            }
            FlowWatcher::First(to) => {
                if let FlowValue::Thing(thing) = value {
                    let first = self.cell(CellKey::First(thing));
                    self.copy(first, to);
                    if !self.exact.contains(&thing) {
                        let contents = self.cell(CellKey::Contents(thing));
                        self.copy(contents, first);
                    }
                }
            }
            FlowWatcher::Parts => {
                if let FlowValue::Thing(thing) = value {
                    let (first, contents) =
                        (self.cell(CellKey::First(thing)), self.cell(CellKey::Contents(thing)));
                    self.copy(contents, first);
                }
            }
            FlowWatcher::AllContents(to) => {
                if let FlowValue::Thing(thing) = value {
                    let contents = self.cell(CellKey::Contents(thing));
                    self.copy(contents, to);
                    self.watch(contents, FlowWatcher::AllContents(to));
                }
            }
            FlowWatcher::Store(from) => {
                if let FlowValue::Thing(thing) = value {
                    let (first, contents) =
                        (self.cell(CellKey::First(thing)), self.cell(CellKey::Contents(thing)));
                    self.copy(from, contents);
                    self.copy(from, first);
                }
            }
            // Most values are objects, which cannot be called.
            FlowWatcher::Call(_) if matches!(value, FlowValue::Thing(_)) => {}
            FlowWatcher::Call(id) => {
                let point = self.points.keys[id.index()].clone();
                self.call_value(id, &point, value);
            }
            FlowWatcher::CallAmongMany => {
                if let FlowValue::Closure(code) = value {
                    self.add_to_many(code);
                }
            }
            FlowWatcher::Fail(spot) => self.fail_with(spot, value),
            FlowWatcher::FailAs(spot) => {
                if let FlowValue::Work(work) = value {
                    self.works[work.index()].is_awaited = true;
                    self.note(spot, NodeEffect::FailAs(work));
                }
            }
            FlowWatcher::FailAll(spot) => {
                if let FlowValue::Work(work) = value {
                    self.works[work.index()].is_awaited = true;
                    self.note(spot, NodeEffect::FailAll(work));
                }
            }
            FlowWatcher::ValuesOf(to) => {
                if let FlowValue::Work(work) = value {
                    let body = self.cell(CellKey::Body(work));
                    self.watch(body, FlowWatcher::ValuesOf(to));
                } else if let FlowValue::Closure(code) = value {
                    let result = self.cell(CellKey::Return(code));
                    self.copy(result, to);
                }
            }
            FlowWatcher::Causes(to) => match value {
                FlowValue::Caught(spot) => self.add(to, FlowValue::CauseOfCaught(spot)),
                FlowValue::Condition(name) => self.add(to, FlowValue::CauseOf(name)),
                FlowValue::EndOf(_) | FlowValue::AnySymbol => self.add(to, value),
                _ => {}
            },
            FlowWatcher::Ends(to) => {
                if let FlowValue::Work(work) = value {
                    self.works[work.index()].is_awaited = true;
                    self.add(to, FlowValue::EndOf(work));
                    let body = self.cell(CellKey::Body(work));
                    self.watch(body, FlowWatcher::ValuesOf(to));
                }
            }
            FlowWatcher::Methods(to) => {
                if let FlowValue::Generic(name) = value {
                    let methods = self.cell(CellKey::Methods(self.symbol(name).clone()));
                    self.copy(methods, to);
                }
            }
            FlowWatcher::Lock(spot) => self.lock(spot, value),
        }
    }
}

impl ValueFlow<'_> {
    /// Returns whether a failure is known to begin at a spot.
    pub(crate) fn fails_at(&self, spot: Spot) -> bool {
        let form = &self.forms.forms[spot.form as usize];
        let code = Code { form: spot.form, lambda: form.owners[spot.node.index()], context: spot.context };
        let Some(number) = self.number_of(code) else { return true };
        self.running[number].effects.iter().any(|(node, effect)| {
            *node == spot.node
                && matches!(
                    effect,
                    NodeEffect::Fail(_)
                        | NodeEffect::FailAs(_)
                        | NodeEffect::Again(_)
                        | NodeEffect::AgainByCause(_)
                )
        })
    }
}
