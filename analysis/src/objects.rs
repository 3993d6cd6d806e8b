//! Objects that are not told apart any more: too many of them come to one place that looks inside.
//!
//! Their contents become one cell. Source: Steensgaard 1996, for those places only.

use std::collections::hash_map::Entry;

use rustc_hash::FxHashMap;

use crate::cells::ValueSet;
use crate::flow::{FlowWatcher, ValueFlow};
use crate::value::{CellId, CellKey, FlowValue, ThingId};

/// Most objects that are told apart at one place.
const MOST_OBJECTS: usize = 200;

/// Objects that stand for others.
#[derive(Debug, Default)]
pub(crate) struct JoinedObjects {
    /// For each object the one that it has been joined with; those behind the end stand for themselves.
    joined: Vec<Option<ThingId>>,
    /// Number of values of cells, and of the objects among them, when these were last counted.
    counted: FxHashMap<CellId, (usize, usize)>,
    /// Whether an object stands for others that differ.
    pub(crate) are_mixed: bool,
}

/// Objects, as bits.
#[derive(Default)]
struct ObjectSet(Vec<u64>);

impl ObjectSet {
    /// Adds an object. Returns whether it is new.
    fn insert(&mut self, thing: ThingId) -> bool {
        let (block, bit) = (thing.index() / 64, 1 << (thing.index() % 64));
        if block >= self.0.len() {
            self.0.resize(block + 1, 0);
        }
        let is_new = self.0[block] & bit == 0;
        self.0[block] |= bit;
        is_new
    }
}

impl JoinedObjects {
    /// Returns the object that an object has been joined with.
    fn other(&self, thing: ThingId) -> Option<ThingId> {
        self.joined.get(thing.index()).copied().flatten()
    }

    fn join(&mut self, one: ThingId, other: ThingId) {
        if other.index() >= self.joined.len() {
            self.joined.resize(other.index() + 1, None);
        }
        self.joined[other.index()] = Some(one);
    }

    /// Returns the object that stands for an object.
    pub(crate) fn find(&self, thing: ThingId) -> ThingId {
        let mut thing = thing;
        while let Some(other) = self.other(thing) {
            thing = other;
        }
        thing
    }

    /// Returns a value, or the object that stands for it.
    pub(crate) fn standing_for(&self, value: FlowValue) -> FlowValue {
        match value {
            FlowValue::Thing(thing) => FlowValue::Thing(self.find(thing)),
            value => value,
        }
    }
}

impl ValueFlow<'_> {
    /// Returns the values with these numbers, of which one object may stand for others.
    pub(crate) fn values_in(&self, numbers: &ValueSet) -> Vec<FlowValue> {
        let values = numbers.iter().map(|number| self.values.keys[number as usize]);
        if self.objects.joined.is_empty() {
            return values.collect();
        }
        let mut seen = ObjectSet::default();
        let is_new = |value: &FlowValue| !matches!(value, FlowValue::Thing(thing) if !seen.insert(*thing));
        values.map(|value| self.objects.standing_for(value)).filter(is_new).collect()
    }

    /// Joins the objects that have become equal: their contents are one cell, as their first elements are.
    pub(crate) fn join_equal_objects(&mut self) {
        let mut by_cells: FxHashMap<(CellId, CellId), ThingId> = FxHashMap::default();
        for number in 0..self.things.keys.len() as u32 {
            let thing = ThingId(number);
            if self.objects.other(thing).is_some() {
                continue;
            }
            let contents = CellKey::Contents(thing);
            let Some(contents) = self.cell_keys.find(&contents).map(|cell| self.cells.find(CellId(cell)))
            else {
                continue;
            };
            let first = match self.exact.contains(&thing) {
                // If elements are not told apart, each may be the first.
                false => contents,
                true => {
                    let first = self.cell(CellKey::First(thing));
                    self.cells.find(first)
                }
            };
            match by_cells.entry((contents, first)) {
                Entry::Vacant(place) => _ = place.insert(thing),
                Entry::Occupied(place) => self.join_object(*place.get(), thing),
            }
        }
    }

    /// Has an object stand for another one.
    fn join_object(&mut self, one: ThingId, other: ThingId) {
        self.objects.join(one, other);
        for key in [CellKey::First, CellKey::Contents] {
            let cells = (self.cell(key(one)), self.cell(key(other)));
            self.cells.merge(cells.0, cells.1);
        }
        let is_exact = self.exact.contains(&one) && self.exact.contains(&other);
        if !is_exact && self.exact.remove(&one) | self.exact.contains(&other) {
            let (first, contents) = (self.cell(CellKey::First(one)), self.cell(CellKey::Contents(one)));
            self.copy(contents, first);
        }
    }

    /// Joins the objects in a cell if they are too many for watchers that look inside.
    pub(crate) fn join_objects(&mut self, cell: CellId, watchers: &[FlowWatcher]) {
        let looks_inside = |watcher: &FlowWatcher| {
            matches!(
                watcher,
                FlowWatcher::Contents(_)
                    | FlowWatcher::First(_)
                    | FlowWatcher::Parts
                    | FlowWatcher::AllContents(_)
                    | FlowWatcher::Store(_)
            )
        };
        if self.cells.values(cell).len() <= MOST_OBJECTS || !watchers.iter().any(looks_inside) {
            return;
        }
        let count = self.cells.values(cell).len();
        // Since the objects were counted, each new value may be one more.
        if let Some((before, objects)) = self.objects.counted.get(&cell)
            && objects + count.saturating_sub(*before) <= MOST_OBJECTS
        {
            return;
        }
        let values = self.values_in(self.cells.values(cell));
        let things = values.iter().filter_map(|value| match value {
            FlowValue::Thing(thing) => Some(*thing),
            _ => None,
        });
        let mut things: Vec<ThingId> = things.collect();
        self.objects.counted.insert(cell, (count, things.len()));
        if things.len() <= MOST_OBJECTS {
            return;
        }
        things.sort_unstable();
        let one = things[0];
        self.objects.are_mixed = true;
        for other in things.drain(1..) {
            self.join_object(one, other);
        }
    }
}
