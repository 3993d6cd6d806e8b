//! Conversion between the compiler's data and the program's objects, both ways, with identity.
//!
//! A [`Unit`] records, for one compilation, which object was made from which datum and the other way round,
//! so that
//! * parts of a form that a macro passes through return as the same data, with their spans;
//! * shared structure stays shared, and an uninterned symbol stays the same symbol, in both directions;
//! * an object that no datum can describe is represented by a number, and returns as itself.
//!
//! A macro may have changed its form in place. So an object becomes the datum from which it was made only if
//! its parts are still those of the datum; otherwise it becomes a new datum at the old place.
//!
//! Guarantees: walks use no native stack in proportion to depth. Circular and oversized structure is refused
//! with a text.

mod border;
mod environment;
mod packed;
mod parts;
mod properties;
mod table;
mod walk;

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use esl_bytecode::datum::{Datum, DatumKind, DatumRemains, ObjectId, OpaqueDatum};
use esl_bytecode::properties::PropertyList;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::{Home, Symbol, symbol_of_setf_cell};

use crate::heap::{AllocError, Heap};
use crate::names::load::{SharedObjects, array, character, integer_value, ratio};
use crate::names::{GivenMap, GivenSet, Names, RootMap};
use crate::value::Value;

pub use border::Atom;
use border::work_of;
pub(crate) use border::{
    WORK_OF_ATOM, atom_of, export, export_structures, import, import_all, number_of, value_of_atom,
};
use environment::Environments;
use parts::{are_parts, datum_with};
pub(crate) use walk::DatumWalk;
use walk::{parts_of, plain_kind};

/// Greatest number of nodes of an object that becomes a datum.
const MAX_NODES: usize = 4_000_000;

/// Bytes of a node of a datum, and of what a unit and a walk remember about it.
const NODE_BYTES: usize = 250;

/// Greatest number of objects whose data a unit remembers.
const MAX_REMEMBERED: usize = 1 << 19;

/// Why an object does not become a datum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DatumError {
    /// It contains itself.
    Circular,
    /// It is too large.
    TooLarge,
    /// There is no room for so many bytes.
    NoRoom(usize),
}

impl fmt::Display for DatumError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            DatumError::Circular => f.write_str("the form contains itself, so it cannot be compiled"),
            DatumError::TooLarge => write!(f, "the form has more than {MAX_NODES} parts"),
            DatumError::NoRoom(_) => f.write_str("not enough memory to compile the form"),
        }
    }
}

impl std::error::Error for DatumError {}

/// Objects and data of one compilation.
#[derive(Default)]
pub(crate) struct Unit {
    /// Objects that no datum can describe, by number.
    objects: Vec<Value>,
    object_ids: GivenMap<u64, u32>,
    /// Uninterned symbols, by number.
    uninterned: BTreeMap<u32, Value>,
    uninterned_ids: GivenMap<u64, u32>,
    /// Objects and their data, by the address of the object.
    data: RootMap<(Value, Datum)>,
    /// Data and their objects, by the address of the datum.
    values: RootMap<(Datum, Value)>,
    /// Addresses of objects whose data were made from them, not the other way round: their place is that of
    /// the macro call that they came from last.
    made: GivenSet<u64>,
    /// Objects of the calls ([`DatumKind::Call`]) in the data that became objects, the innermost first.
    calls: Vec<Value>,
    /// Environments of macro calls.
    environments: Environments,
    /// Nodes visited since the last call of [`Unit::take_work`].
    work: u64,
    /// Describes objects that no datum stands for, if the data are for the embedder, which gets its own
    /// objects back.
    describe: Option<fn(&Heap, Value) -> String>,
    /// Whether structures are lists of their slots, as a text for another version of the machine has them.
    keeps_structures: bool,
    /// Whether the data come from the host, and no object has to be led back to its datum: then only nodes
    /// that may occur twice are remembered, and a symbol denotes the one that its name has in its package,
    /// which may be inherited.
    is_from_host: bool,
}

/// The remains of a unit that is given up, which are freed in parts.
pub(crate) struct UnitRemains {
    data: indexmap::map::IntoValues<u64, (Value, Datum)>,
    values: indexmap::map::IntoValues<u64, (Datum, Value)>,
    datums: DatumRemains,
}

impl UnitRemains {
    /// Gives up a unit.
    pub(crate) fn new(unit: Unit) -> UnitRemains {
        UnitRemains {
            data: unit.data.into_values(),
            values: unit.values.into_values(),
            datums: DatumRemains::default(),
        }
    }

    /// Returns about how many bytes are left.
    pub(crate) fn bytes(&self) -> usize {
        (self.data.len() + self.values.len()) / 2 * NODE_BYTES
    }

    /// Frees at most `allowed` nodes, and returns how many it could have freed beyond those that there were.
    pub(crate) fn free(&mut self, allowed: usize) -> usize {
        let mut left = self.datums.free(allowed);
        while left > 0 {
            let (data, values) = (&mut self.data, &mut self.values);
            let next = values.next().map(|(datum, _)| datum).or_else(|| data.next().map(|(_, datum)| datum));
            let Some(datum) = next else { break };
            self.datums.add(datum);
            left = self.datums.free(left);
        }
        left
    }
}

impl SharedObjects for Unit {
    fn uninterned(&self, id: u32) -> Option<Value> {
        self.uninterned.get(&id).copied()
    }

    fn note_uninterned(&mut self, id: u32, object: Value) {
        self.uninterned.insert(id, object);
        self.uninterned_ids.insert(object.bits(), id);
    }

    fn object(&self, id: u32) -> Option<Value> {
        self.objects.get(id as usize).copied()
    }
}

/// The next step of a walk from datum to object.
enum ToValue<'a> {
    Visit(&'a Datum),
    Build(&'a Datum),
    BuildProperties(&'a Datum, &'a PropertyList),
}

impl Unit {
    /// Calls `visit` with every object that the unit keeps alive.
    pub(crate) fn roots(&self, visit: &mut dyn FnMut(Value)) {
        self.objects.iter().copied().for_each(&mut *visit);
        self.uninterned.values().copied().for_each(&mut *visit);
        self.data.values().for_each(|&(value, _)| visit(value));
        self.values.values().for_each(|&(_, value)| visit(value));
        self.environments.roots(visit);
        self.calls.iter().copied().for_each(visit);
    }

    /// Takes the lists that are calls in the data that became objects.
    pub(crate) fn take_calls(&mut self) -> Vec<Value> {
        std::mem::take(&mut self.calls)
    }

    /// Returns about how many bytes the unit takes with its data.
    pub(crate) fn bytes(&self) -> usize {
        let objects = self.objects.len() * 4 * size_of::<Value>();
        self.data.len() * NODE_BYTES + objects + self.environments.bytes()
    }

    /// Returns the number of nodes visited since the last call.
    pub(crate) fn take_work(&mut self) -> u64 {
        std::mem::take(&mut self.work)
    }

    /// Returns the number by which data refer to an object.
    pub(crate) fn pin(&mut self, object: Value) -> ObjectId {
        let next = self.objects.len() as u32;
        let id = *self.object_ids.entry(object.bits()).or_insert(next);
        if id == next {
            self.objects.push(object);
        }
        ObjectId(id)
    }

    /// Returns an object by its number.
    pub(crate) fn pinned(&self, ObjectId(id): ObjectId) -> Option<Value> {
        self.object(id)
    }

    fn remember(&mut self, datum: &Datum, value: Value) {
        self.data.insert(value.bits(), (value, datum.clone()));
        self.values.insert(datum.identity() as u64, (datum.clone(), value));
    }

    /// Returns the object for a datum.
    ///
    /// # Errors
    /// As for every allocation. Objects made so far are remembered, so a second attempt resumes.
    pub(crate) fn value_of(
        &mut self,
        heap: &mut Heap,
        names: &mut Names,
        datum: &Datum,
    ) -> Result<Value, AllocError> {
        if self.data.len() > MAX_REMEMBERED {
            // These forms are so old that no macro passes a part of them through.
            self.data.clear();
            self.values.clear();
            self.made.clear();
        }
        let mut steps = vec![ToValue::Visit(datum)];
        let mut made: Vec<Value> = Vec::new();
        let mut remembers_all = !self.is_from_host;
        while let Some(step) = steps.pop() {
            match step {
                ToValue::Visit(datum) => {
                    self.work += 1;
                    if (remembers_all || datum.is_shared())
                        && let Some(&(_, value)) = self.values.get(&(datum.identity() as u64))
                    {
                        made.push(value);
                        continue;
                    }
                    if let Some(properties) = datum.as_properties() {
                        self.work += properties::work_of(properties) as u64 - 1;
                        steps.push(ToValue::BuildProperties(datum, properties));
                        steps.extend(properties.data().rev().map(ToValue::Visit));
                        continue;
                    }
                    match datum.kind() {
                        DatumKind::Cons(car, cdr) => {
                            steps.extend([ToValue::Build(datum), ToValue::Visit(cdr), ToValue::Visit(car)]);
                        }
                        DatumKind::Vector(items) | DatumKind::Array(_, items) | DatumKind::Table(items) => {
                            // Its elements may be those of another vector too.
                            remembers_all |= Arc::strong_count(items) > 1;
                            steps.push(ToValue::Build(datum));
                            steps.extend(items.iter().rev().map(ToValue::Visit));
                        }
                        DatumKind::Call(call) => {
                            steps.extend([ToValue::Build(datum), ToValue::Visit(call)]);
                        }
                        _ => {
                            self.work += work_of(datum) as u64 - 1;
                            let is_remembered = remembers_all || datum.is_shared();
                            made.push(self.atom_value(heap, names, datum, is_remembered)?);
                        }
                    }
                }
                ToValue::Build(datum) => {
                    let count = match datum.kind() {
                        DatumKind::Vector(items) | DatumKind::Array(_, items) | DatumKind::Table(items) => {
                            items.len()
                        }
                        DatumKind::Call(_) => 1,
                        _ => 2,
                    };
                    let first = made.len() - count;
                    let parts = &made[first..];
                    let value = match datum.kind() {
                        DatumKind::Vector(_) => heap.alloc_vector(parts)?,
                        DatumKind::Array(dimensions, _) => array(heap, dimensions, parts)?,
                        DatumKind::Table(_) => table::value_of(heap, parts)?,
                        DatumKind::Call(_) => {
                            self.calls.push(parts[0]);
                            parts[0]
                        }
                        _ => heap.cons(parts[0], parts[1])?,
                    };
                    made.truncate(first);
                    if remembers_all || datum.is_shared() {
                        self.remember(datum, value);
                    }
                    made.push(value);
                }
                ToValue::BuildProperties(datum, properties) => {
                    let first = made.len() - properties.data().count();
                    let value = properties::value_of(heap, names, properties, &made[first..])?;
                    made.truncate(first);
                    if remembers_all || datum.is_shared() {
                        self.remember(datum, value);
                    }
                    made.push(value);
                }
            }
        }
        Ok(made.pop().unwrap_or(Value::NIL))
    }

    /// Returns the object of a datum that is not compound. One that `is_remembered` is the same object again.
    fn atom_value(
        &mut self,
        heap: &mut Heap,
        names: &mut Names,
        datum: &Datum,
        is_remembered: bool,
    ) -> Result<Value, AllocError> {
        Ok(match datum.kind() {
            DatumKind::Symbol(symbol) => self.symbol_object(heap, names, symbol)?,
            DatumKind::Integer(value) => integer_value(heap, value)?,
            DatumKind::Ratio(numerator, denominator) => ratio(heap, numerator, denominator)?,
            DatumKind::Float(value) => heap.float(*value)?,
            DatumKind::Character(c) => character(*c),
            DatumKind::String(text) => {
                let value = heap.alloc_str(text)?;
                if is_remembered {
                    self.remember(datum, value);
                }
                value
            }
            DatumKind::Object(id) => self.pinned(*id).unwrap_or(Value::NIL),
            DatumKind::Opaque(opaque) => names.opaque_object(heap, opaque)?,
            DatumKind::Packed(vector) => packed::value_of(heap, vector)?,
            DatumKind::Nil
            | DatumKind::Cons(..)
            | DatumKind::Vector(_)
            | DatumKind::Array(..)
            | DatumKind::Table(_)
            | DatumKind::Call(_) => Value::NIL,
        })
    }

    /// Returns the object of a symbol.
    ///
    /// # Errors
    /// As for every allocation.
    pub(crate) fn symbol_object(
        &mut self,
        heap: &mut Heap,
        names: &mut Names,
        symbol: &Symbol,
    ) -> Result<Value, AllocError> {
        let Home::Uninterned(id) = *symbol.home() else {
            let inherited = if self.is_from_host { names.inherited(symbol) } else { None };
            return names.intern(heap, inherited.as_ref().unwrap_or(symbol));
        };
        if let Some(object) = self.uninterned(id) {
            return Ok(object);
        }
        let object = match symbol_of_setf_cell(symbol) {
            Some(named) => {
                let named = self.symbol_object(heap, names, &named)?;
                names.setf_cell_object(heap, named)?
            }
            None => names.intern(heap, symbol)?,
        };
        self.note_uninterned(id, object);
        Ok(object)
    }

    /// Returns the datum for an object. Parts without a remembered datum get the place `span`.
    ///
    /// # Errors
    /// [`DatumError`] if the object is circular or too large, or there is no room for the datum.
    pub(crate) fn datum_of(
        &mut self,
        heap: &Heap,
        names: &Names,
        object: Value,
        span: Span,
    ) -> Result<Datum, DatumError> {
        let mut walk = DatumWalk::new(object, span);
        let mut left = usize::MAX;
        loop {
            if let Some(datum) = walk.run(self, heap, names, &mut left)? {
                return Ok(datum);
            }
        }
    }

    /// Returns the datum of an object with these parts: the one from which it was made, unless its parts have
    /// changed.
    fn compound(&mut self, heap: &Heap, object: Value, parts: Vec<Datum>, span: Span) -> Datum {
        if self.describe.is_some() {
            // The walk knows the objects that it has met, and no object was made from a datum.
            return datum_with(heap, object, parts, span);
        }
        let known = self.data.get(&object.bits()).map(|(_, datum)| datum.clone());
        // A literal returned by a macro repeatedly is at another place each time.
        let is_made = self.made.contains(&object.bits());
        if let Some(known) = &known
            && are_parts(known, &parts)
            && (!is_made || known.span() == span)
        {
            return known.clone();
        }
        if known.is_none() {
            self.made.insert(object.bits());
        }
        let span = known.filter(|_| !is_made).map_or(span, |known| known.span());
        let datum = datum_with(heap, object, parts, span);
        self.remember(&datum, object);
        datum
    }

    /// Returns the datum that an object was made from. Of an atom that has none, returns a datum without a
    /// place.
    pub(crate) fn origin_of(&mut self, heap: &Heap, names: &Names, object: Value) -> Option<Datum> {
        let known = self.data.get(&object.bits()).map(|(_, datum)| datum.clone());
        known.or_else(|| match parts_of(heap, object) {
            Some(_) => None,
            None => self.atom_kind(heap, names, object).map(|kind| Datum::new(kind, Span::default())),
        })
    }

    fn atom_datum(&mut self, heap: &Heap, names: &Names, object: Value, span: Span) -> Datum {
        if let Some((_, datum)) = self.data.get(&object.bits())
            && let DatumKind::String(text) = datum.kind()
            && heap
                .string(object)
                .is_some_and(|characters| text.chars().map(u32::from).eq(characters.iter().copied()))
        {
            return datum.clone();
        }
        let kind = self.atom_kind(heap, names, object);
        let datum = match kind {
            Some(kind) => Datum::of_kind(kind, span),
            None => Datum::new(self.object_kind(heap, object), span),
        };
        if matches!(datum.kind(), DatumKind::String(_)) {
            self.remember(&datum, object);
        }
        datum
    }

    /// Returns the kind of an object that no datum describes.
    fn object_kind(&mut self, heap: &Heap, object: Value) -> DatumKind {
        match self.describe {
            Some(describe) => DatumKind::Opaque(OpaqueDatum::of_program(&describe(heap, object))),
            None => DatumKind::Object(self.pin(object)),
        }
    }

    /// Returns the datum that describes an atom, if there is one.
    fn atom_kind(&mut self, heap: &Heap, names: &Names, object: Value) -> Option<DatumKind> {
        if names.is_symbol(heap, object) && !object.is_nil() {
            return Some(DatumKind::Symbol(self.symbol_name(heap, names, object)?));
        }
        let opaque = || names.opaque_of(heap, object).filter(|_| self.describe.is_some());
        plain_kind(heap, object).or_else(|| Some(opaque()?.kind().clone()))
    }

    /// As [`Unit::datum_of`]; an object that no datum can describe is represented as a whole.
    pub(crate) fn datum_or_object(&mut self, heap: &Heap, names: &Names, object: Value, span: Span) -> Datum {
        self.datum_of(heap, names, object, span)
            .unwrap_or_else(|_| Datum::new(DatumKind::Object(self.pin(object)), span))
    }

    /// Returns the object of an uninterned symbol, if it was met.
    pub(crate) fn find_uninterned(&self, symbol: &Symbol) -> Option<Value> {
        match symbol.home() {
            Home::Uninterned(id) => self.uninterned(*id),
            Home::Package(_) => None,
        }
    }

    /// Returns the compiler's name for a symbol.
    pub(crate) fn symbol_name(&mut self, heap: &Heap, names: &Names, object: Value) -> Option<Symbol> {
        if let Some(symbol) = names.name_of(heap, object) {
            return Some(symbol);
        }
        let name = heap.string_text(heap.symbol(object)?.name)?;
        if let Some(&id) = self.uninterned_ids.get(&object.bits()) {
            return Some(Symbol::uninterned(id, &name));
        }
        let id = names.fresh();
        self.note_uninterned(id, object);
        Some(Symbol::uninterned(id, &name))
    }
}

#[cfg(test)]
mod tests;
