//! The dynamic bindings of a task.
//!
//! Deep binding: a variable's value is that of the newest binding of its symbol, and a switch of tasks costs
//! nothing. The newest [`NEAR`] bindings are searched one by one. Older ones are also found by a table, which
//! follows with hysteresis, so that few and short-lived bindings never meet it: reading a variable costs the
//! same below a million bindings of others as below a hundred.
//!
//! Invariant: `table.newest` has, for each symbol bound among the first `table.previous.len()` bindings, the
//! index of the newest of these; `table.previous[i]` is what it had before binding `i`, plus one, or 0.

use super::copy_with_room;
use crate::names::GivenMap;
use crate::value::Value;
use esl_heap::stored;

/// Number of bindings searched one by one; at most twice as many.
const NEAR: usize = 32;

/// Bytes of an entry of the table's map.
const TABLE_ENTRY: usize = size_of::<(u64, u32)>() + 1;

/// A dynamic binding.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Binding {
    /// Symbol of the variable.
    pub symbol: Value,
    /// Value of the variable in this task.
    pub value: Value,
    /// Offset in the stack of the base of the frame that made it.
    pub base: u32,
}

/// The dynamic bindings of a task, newest last.
#[derive(Default)]
pub(crate) struct Bindings {
    all: Vec<Binding>,
    table: Option<Box<BindingTable>>,
}

/// Table of the older bindings.
#[derive(Clone, Default)]
struct BindingTable {
    newest: GivenMap<u64, u32>,
    previous: Vec<u32>,
}

impl Clone for Bindings {
    fn clone(&self) -> Bindings {
        Bindings { all: copy_with_room(&self.all), table: self.table.clone() }
    }
}

impl BindingTable {
    /// Returns the index of the newest binding of `symbol` in the table.
    #[cold]
    fn find(&self, symbol: Value) -> Option<usize> {
        self.newest.get(&symbol.bits()).map(|&index| index as usize)
    }
}

impl Bindings {
    /// Returns the number of bindings.
    #[inline]
    pub(crate) fn len(&self) -> usize {
        self.all.len()
    }

    /// Bytes that a binding takes, with its part of the table.
    pub(crate) const BYTES: usize = size_of::<Binding>() + 2 * TABLE_ENTRY;

    /// Returns whether there is no room for another binding.
    #[inline]
    pub(crate) fn is_full(&self) -> bool {
        self.all.len() == self.all.capacity()
    }

    /// Returns the number of bindings for which there is room.
    pub(crate) fn capacity(&self) -> usize {
        self.all.capacity()
    }

    /// Makes room for so many more bindings.
    pub(crate) fn reserve(&mut self, more: usize) {
        self.all.reserve_exact(more);
    }

    /// Gives back most of the room of more than `many` bindings if hardly any of it is used. Returns whether
    /// it has.
    pub(crate) fn trim(&mut self, many: usize) -> bool {
        let is_large = self.all.capacity() > many && self.all.len() < self.all.capacity() / 4;
        if is_large {
            self.all.shrink_to(2 * self.all.len());
            if let Some(table) = &mut self.table {
                table.newest.shrink_to(2 * table.newest.len());
                table.previous.shrink_to(2 * table.previous.len());
            }
        }
        is_large
    }

    /// Gives back the room of more than `few` bindings if less than half of it is used. Returns whether it
    /// has.
    pub(crate) fn give_back(&mut self, few: usize) -> bool {
        let is_large = self.all.capacity() > few.max(2 * self.all.len());
        if is_large {
            self.all.shrink_to(few);
            if let Some(table) = &mut self.table {
                table.newest.shrink_to(few);
                table.previous.shrink_to(few);
            }
        }
        is_large
    }

    /// Returns the bytes that they take.
    pub(crate) fn bytes(&self) -> usize {
        let table = self.table.as_ref().map_or(0, |table| {
            table.newest.capacity() * TABLE_ENTRY + table.previous.capacity() * size_of::<u32>()
        });
        self.all.capacity() * size_of::<Binding>() + table
    }

    /// Returns all bindings, oldest first.
    pub(crate) fn all(&self) -> &[Binding] {
        &self.all
    }

    /// Returns a copy for another task: the newest binding of each symbol but those of `without`.
    pub(crate) fn copy(&self, without: &[Value]) -> Bindings {
        let mut seen = GivenMap::default();
        seen.extend(without.iter().map(|symbol| (symbol.bits(), ())));
        let is_new = |binding: &&Binding| seen.insert(binding.symbol.bits(), ()).is_none();
        let mut all: Vec<Binding> = self.all.iter().rev().filter(is_new).copied().collect();
        all.reverse();
        all.iter_mut().for_each(|binding| binding.base = 0);
        let mut copy = Bindings { all: Vec::with_capacity(all.len()), table: None };
        all.into_iter().for_each(|binding| copy.push(binding));
        copy
    }

    /// Adds a binding.
    #[inline]
    pub(crate) fn push(&mut self, binding: Binding) {
        self.all.push(binding);
        if self.all.len() - self.covered() > 2 * NEAR {
            self.cover();
        }
    }

    /// Undoes all bindings but the oldest `length`.
    #[inline]
    pub(crate) fn truncate(&mut self, length: usize) {
        if length < self.covered() {
            self.uncover(length);
        }
        self.all.truncate(length);
    }

    /// Undoes the bindings of the frame with this base and of frames inside it.
    pub(crate) fn truncate_from(&mut self, base: u32) {
        let length = self.all.iter().rposition(|binding| binding.base < base).map_or(0, |last| last + 1);
        self.truncate(length);
    }

    /// Returns the value of the newest binding of `symbol`.
    #[inline]
    pub(crate) fn get(&self, symbol: Value) -> Option<Value> {
        if let Some(newest) = self.all.last()
            && newest.symbol == symbol
        {
            return Some(newest.value);
        }
        let near = self.all.get(self.covered()..).unwrap_or_default();
        match near.iter().rev().find(|binding| binding.symbol == symbol) {
            Some(binding) => Some(binding.value),
            None => self.table.as_ref().and_then(|table| Some(self.all[table.find(symbol)?].value)),
        }
    }

    /// Returns the value of the newest binding of `symbol`, to be set.
    #[inline]
    pub(crate) fn get_mut(&mut self, symbol: Value) -> Option<&mut Value> {
        self.find(symbol).map(|index| &mut self.all[index].value)
    }

    #[inline]
    fn find(&self, symbol: Value) -> Option<usize> {
        let covered = self.covered();
        let near = self.all[covered..].iter().rposition(|binding| binding.symbol == symbol);
        match (near, &self.table) {
            (Some(index), _) => Some(covered + index),
            (None, Some(table)) => table.find(symbol),
            (None, None) => None,
        }
    }

    /// Returns the number of the oldest bindings that are in the table.
    #[inline]
    fn covered(&self) -> usize {
        self.table.as_ref().map_or(0, |table| table.previous.len())
    }

    #[cold]
    fn cover(&mut self) {
        let table = self.table.get_or_insert_default();
        let from = table.previous.len();
        for (index, binding) in self.all.iter().enumerate().take(from + NEAR).skip(from) {
            let before = table.newest.insert(binding.symbol.bits(), index as u32);
            table.previous.push(before.map_or(0, |before| before + 1));
        }
    }

    #[cold]
    fn uncover(&mut self, length: usize) {
        let Some(table) = &mut self.table else { return };
        if length == 0 {
            self.table = None;
            return;
        }
        while table.previous.len() > length {
            let before = table.previous.pop().unwrap_or(0);
            let symbol = self.all[table.previous.len()].symbol.bits();
            match before {
                0 => table.newest.remove(&symbol),
                before => table.newest.insert(symbol, before - 1),
            };
        }
    }
}

stored! { Binding { symbol, value, base } }
stored! { BindingTable { newest, previous } }
stored! { Bindings { all, table } }

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_newest_binding_is_found(steps in prop::collection::vec((0..6_u8, 0..12_i32), 1..600)) {
            let mut bindings = Bindings::default();
            let mut model: Vec<(Value, Value)> = Vec::new();
            for (number, (kind, name)) in steps.into_iter().enumerate() {
                let symbol = Value::small(name);
                match kind {
                    0 => {
                        let length = model.len() * name as usize / 12;
                        bindings.truncate(length);
                        model.truncate(length);
                    }
                    1 => {
                        let value = Value::small(-1 - number as i32);
                        if let Some(place) = bindings.get_mut(symbol) {
                            *place = value;
                        }
                        if let Some(pair) = model.iter_mut().rev().find(|pair| pair.0 == symbol) {
                            pair.1 = value;
                        }
                    }
                    _ => for repeat in 0..20 {
                        let (symbol, value) = (Value::small(name + repeat / 7), Value::small(number as i32));
                        bindings.push(Binding { symbol, value, base: 0 });
                        model.push((symbol, value));
                    }
                }
                prop_assert_eq!(bindings.len(), model.len());
                for name in 0..16 {
                    let symbol = Value::small(name);
                    let expected = model.iter().rev().find(|pair| pair.0 == symbol).map(|pair| pair.1);
                    prop_assert_eq!(bindings.get(symbol), expected);
                }
            }
        }
    }
}
