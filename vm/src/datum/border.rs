//! Data at the border to the embedder: values as data and data as values, with the work that this takes.

use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::span::Span;

use super::walk::plain_kind;
use super::{DatumError, Unit, packed};
use crate::heap::{AllocError, Heap};
use crate::names::Names;
use crate::names::load::{character, integer_value};
use crate::value::Value;

/// Bytes of a text that are moved in the time of one unit of work.
const BYTES_TOGETHER: usize = 4;

/// A value that crosses the border without memory of its own, as most arguments and results of calls do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Atom {
    /// `NIL`.
    Nil,
    /// `T`.
    True,
    /// An integer of 64 bits.
    Integer(i64),
    /// A double float.
    Float(f64),
    /// A character.
    Character(char),
}

/// Work of moving an atom.
pub(crate) const WORK_OF_ATOM: usize = 1;

/// Returns the atom that a value is, if it is one.
pub(crate) fn atom_of(heap: &Heap, value: Value) -> Option<Atom> {
    if let Some(integer) = value.as_fixnum() {
        return Some(Atom::Integer(integer));
    }
    match value {
        Value::NIL => Some(Atom::Nil),
        Value::T => Some(Atom::True),
        _ => match heap.as_double(value) {
            Some(float) => Some(Atom::Float(float)),
            None => value.as_character().and_then(char::from_u32).map(Atom::Character),
        },
    }
}

/// Returns the contents of the datum of a number that takes no memory beside that, if a value is one.
pub(crate) fn number_of(heap: &Heap, value: Value) -> Option<DatumKind> {
    if let Some(integer) = value.as_fixnum() {
        return Some(DatumKind::Integer(integer.into()));
    }
    heap.as_double(value).map(DatumKind::Float)
}

/// Returns the value that an atom is.
///
/// # Errors
/// As for every allocation.
pub(crate) fn value_of_atom(heap: &mut Heap, atom: Atom) -> Result<Value, AllocError> {
    match atom {
        Atom::Nil => Ok(Value::NIL),
        Atom::True => Ok(Value::T),
        Atom::Integer(integer) => integer_value(heap, &integer.into()),
        Atom::Float(float) => heap.float(float),
        Atom::Character(c) => Ok(character(c)),
    }
}

/// Returns a value as data, and the work that it took. An object that no data stands for is described.
///
/// # Errors
/// [`DatumError`].
pub(crate) fn export(
    heap: &Heap,
    names: &Names,
    value: Value,
    describe: fn(&Heap, Value) -> String,
) -> Result<(Datum, usize), DatumError> {
    export_by(heap, names, value, Unit { describe: Some(describe), ..Unit::default() })
}

/// As [`export`], where structures of programs are lists: the symbol `%KEPT-STRUCTURE`, the name of the
/// structure, and the name and the value of each slot.
///
/// # Errors
/// [`DatumError`].
pub(crate) fn export_structures(
    heap: &Heap,
    names: &Names,
    value: Value,
    describe: fn(&Heap, Value) -> String,
) -> Result<Datum, DatumError> {
    let unit = Unit { describe: Some(describe), keeps_structures: true, ..Unit::default() };
    export_by(heap, names, value, unit).map(|(datum, _)| datum)
}

fn export_by(heap: &Heap, names: &Names, value: Value, mut unit: Unit) -> Result<(Datum, usize), DatumError> {
    // Most values are integers, which nothing below has to be asked about.
    if let Some(integer) = value.as_fixnum() {
        return Ok((Datum::integer(integer, Span::default()), WORK_OF_ATOM));
    }
    // An atom shares nothing with other parts, so it needs neither walk nor memory.
    let plain = || Some(Datum::new(plain_kind(heap, value)?, Span::default()));
    if let Some(datum) = names.opaque_of(heap, value).cloned().or_else(plain) {
        let work = work_of(&datum);
        return Ok((datum, work));
    }
    if let Some(kind) = packed::whole_of(heap, value)? {
        let datum = Datum::new(kind, Span::default());
        let work = work_of(&datum);
        return Ok((datum, work));
    }
    if names.is_symbol(heap, value) {
        return Ok((unit.atom_datum(heap, names, value, Span::default()), 1));
    }
    Ok((unit.datum_of(heap, names, value, Span::default())?, unit.take_work() as usize))
}

/// Returns the work of moving a datum that is not compound.
pub(super) fn work_of(datum: &Datum) -> usize {
    match datum.kind() {
        DatumKind::String(text) => 1 + text.len() / BYTES_TOGETHER,
        DatumKind::Packed(vector) => vector.work(),
        _ => 1,
    }
}

/// Returns data as a value, and the work that it took. A symbol that is not at home in its package is the one
/// of that name that the package inherits: `CAR` of a program is that of the language.
///
/// # Errors
/// As for every allocation.
pub(crate) fn import(
    heap: &mut Heap,
    names: &mut Names,
    datum: &Datum,
) -> Result<(Value, usize), AllocError> {
    let atom = match datum.kind() {
        DatumKind::Nil => Some(Atom::Nil),
        DatumKind::Integer(integer) => integer.as_small().map(Atom::Integer),
        DatumKind::Float(float) => Some(Atom::Float(*float)),
        _ => None,
    };
    if let Some(atom) = atom {
        return Ok((value_of_atom(heap, atom)?, WORK_OF_ATOM));
    }
    let mut unit = Unit::of_host();
    let value = unit.border_value(heap, names, datum)?;
    let work = if datum.is_compound() { unit.take_work() as usize } else { work_of(datum) };
    Ok((value, work))
}

/// Returns data as a list of values. A part that several of them have is one object.
///
/// # Errors
/// As for every allocation.
pub(crate) fn import_all(heap: &mut Heap, names: &mut Names, data: &[Datum]) -> Result<Value, AllocError> {
    let mut unit = Unit::of_host();
    let mut values = Vec::with_capacity(data.len());
    for datum in data {
        values.push(unit.border_value(heap, names, datum)?);
    }
    heap.list(&values)
}

impl Unit {
    /// Returns a unit for data that come from the host.
    fn of_host() -> Unit {
        Unit { is_from_host: true, ..Unit::default() }
    }

    /// Returns a datum that comes from the host as a value.
    fn border_value(
        &mut self,
        heap: &mut Heap,
        names: &mut Names,
        datum: &Datum,
    ) -> Result<Value, AllocError> {
        if datum.is_compound() {
            return self.value_of(heap, names, datum);
        }
        match datum.kind() {
            // Another part may be the same text.
            DatumKind::String(_) if datum.is_shared() => self.value_of(heap, names, datum),
            _ => self.atom_value(heap, names, datum, false),
        }
    }
}
