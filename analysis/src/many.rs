//! Places that call too many functions to look at each pair of a place and a function by itself.
//!
//! All such places count as one: each may call each function that is called at any of them, with all their
//! arguments, and returns all their results. So the work grows with the sum of places and functions, not with
//! the product, and the rest of the program is as exact as before.

use std::collections::BTreeSet;

use esl_compiler::core::NodeId;
use rustc_hash::{FxHashMap, FxHashSet};

use crate::effect::{NodeEffect, mistake};
use crate::flow::{CallArguments, CallPoint, FlowWatcher, Passing, ValueFlow};
use crate::value::{CellId, CellKey, Code, FlowValue, PointId};

/// Most functions that are told apart at one place.
const MOST_FUNCTIONS: usize = 100;

/// The calls at places with too many functions.
#[derive(Debug, Default)]
pub(crate) struct ManyCalls {
    /// Functions that each of the places may call.
    pub(crate) codes: Vec<Code>,
    /// Forms and nodes of the places.
    pub(crate) places: BTreeSet<(u32, NodeId)>,
    known: FxHashSet<Code>,
    points: FxHashSet<PointId>,
    /// Number of values of cells, and of the functions among them, when these were last counted.
    counted: FxHashMap<CellId, (usize, usize)>,
}

impl ValueFlow<'_> {
    /// Returns the code that an effect calls.
    pub(crate) fn called_by<'e>(&'e self, effect: &'e NodeEffect) -> &'e [Code] {
        match effect {
            NodeEffect::Call(code) | NodeEffect::Absorb(code) => std::slice::from_ref(code),
            NodeEffect::CallMany => &self.many.codes,
            _ => &[],
        }
    }

    /// Whether a value is a function of the program that a call at this point may call.
    fn is_called(&self, point: &CallPoint, value: FlowValue) -> bool {
        point.passing == Passing::Through && self.is_function(value, point.symbols)
    }

    /// Whether a value is a function of the program, or with `symbols` the name of one.
    fn is_function(&self, value: FlowValue, symbols: bool) -> bool {
        let is_defined = |name| self.forms.defined.contains_key(self.symbol(name));
        match value {
            FlowValue::Closure(_) => true,
            FlowValue::Function(name) => is_defined(name),
            FlowValue::Symbol(name) => symbols && is_defined(name),
            _ => false,
        }
    }

    /// Has calls of the values of a cell be among the places if too many functions are in it.
    pub(crate) fn crowd(&mut self, cell: CellId, watchers: &[FlowWatcher]) {
        let count = self.cells.values(cell).len();
        if count <= MOST_FUNCTIONS {
            return;
        }
        let is_apart = |watcher: &FlowWatcher| match watcher {
            FlowWatcher::Call(id) => !self.many.points.contains(id),
            _ => false,
        };
        if !watchers.iter().any(is_apart) {
            return;
        }
        // Since the functions were counted, each new value may be one more.
        if let Some((before, functions)) = self.many.counted.get(&cell)
            && functions + count.saturating_sub(*before) <= MOST_FUNCTIONS
        {
            return;
        }
        let mut by_symbols = 0;
        let mut functions = 0;
        for number in self.cells.values(cell).iter() {
            let value = self.values.keys[number as usize];
            functions += usize::from(self.is_function(value, false));
            by_symbols += usize::from(self.is_function(value, true));
        }
        self.many.counted.insert(cell, (count, by_symbols));
        for watcher in watchers {
            let FlowWatcher::Call(id) = watcher else { continue };
            let point = self.points.keys[id.index()].clone();
            let called = if point.symbols { by_symbols } else { functions };
            if point.passing == Passing::Through && called > MOST_FUNCTIONS && self.many.points.insert(*id) {
                self.call_many(&point);
            }
        }
    }

    /// Calls a function together with those of other places, if too many come to this call. Returns whether
    /// it does.
    pub(crate) fn calls_among_many(&mut self, id: PointId, point: &CallPoint, value: FlowValue) -> bool {
        if !self.many.points.contains(&id) || !self.is_called(point, value) {
            return false;
        }
        match value {
            FlowValue::Closure(code) => self.add_to_many(code),
            FlowValue::Function(name) | FlowValue::Symbol(name) => {
                let function = self.cell(CellKey::Function(self.symbol(name).clone()));
                self.watch(function, FlowWatcher::CallAmongMany);
            }
            _ => {}
        }
        true
    }

    /// Has a call be one of the places.
    fn call_many(&mut self, point: &CallPoint) {
        let (arguments, results) = (self.cell(CellKey::ManyArguments), self.cell(CellKey::ManyResults));
        for (given, _) in &point.arguments.given {
            self.copy(*given, arguments);
        }
        for list in &point.arguments.lists {
            self.watch(*list, FlowWatcher::Contents(arguments));
        }
        for any in &point.arguments.any {
            self.copy(*any, arguments);
        }
        if let Some(result) = point.result {
            self.copy(results, result);
        }
        self.note(point.spot, NodeEffect::CallMany);
        self.note(point.spot, NodeEffect::Mistake(mistake::PROGRAM));
        self.many.places.insert((point.spot.form, point.spot.node));
    }

    /// Has a function be called at all of the places.
    pub(crate) fn add_to_many(&mut self, code: Code) {
        if !self.many.known.insert(code) {
            return;
        }
        self.many.codes.push(code);
        self.run(code);
        let (arguments, results) = (self.cell(CellKey::ManyArguments), self.cell(CellKey::ManyResults));
        let forms = self.forms;
        let lambda = &forms.forms[code.form as usize].core.lambdas[code.lambda.index()];
        self.bind(code, lambda, &CallArguments { any: vec![arguments], ..CallArguments::default() });
        let value = self.cell(CellKey::Return(code));
        self.copy(value, results);
    }
}
