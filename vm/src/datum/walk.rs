//! The walk from an object to its datum, in parts.

use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;
use esl_heap::array::{ArrayElements, vector_elements};

use super::{DatumError, MAX_NODES, NODE_BYTES, Unit, packed, table, work_of};
use crate::heap::layout::Array;
use crate::heap::{Heap, Kind};
use crate::names::class;
use crate::names::load::integer_of;
use crate::names::{GivenSet, Names, RootMap};
use crate::value::Value;

/// Name of the list that stands for a structure in a text for another version of the machine.
const KEPT_STRUCTURE: &str = "%KEPT-STRUCTURE";
/// Circular literals in one form, at most.
const MAX_CIRCULAR: usize = 64;

/// Why a walk from object to datum has ended.
enum WalkError {
    /// This quoted object contains itself.
    Quoted(Value),
    Datum(DatumError),
}

/// The next step of a walk from object to datum.
enum ToDatum {
    Visit(Value),
    /// With the number of its parts.
    Build(Value, usize),
}

/// A walk from an object to its datum, which goes on in parts. The program may change the object between two
/// of them; then the datum is that of some of its states.
pub(crate) struct DatumWalk {
    object: Value,
    span: Span,
    /// Whether large quoted objects are represented as wholes.
    keeps_literals: bool,
    /// Objects that are represented as wholes: quoted ones that contain themselves, or are large.
    wholes: GivenSet<u64>,
    /// Number of those that contain themselves.
    circular: usize,
    steps: Vec<ToDatum>,
    made: Vec<Datum>,
    /// Compound objects met by this walk; without a datum while it is inside.
    met: RootMap<(Value, Option<Datum>)>,
    nodes: usize,
}

impl DatumWalk {
    /// Begins a walk. Parts without a remembered datum get the place `span`.
    pub(crate) fn new(object: Value, span: Span) -> DatumWalk {
        DatumWalk {
            object,
            span,
            keeps_literals: false,
            wholes: GivenSet::default(),
            circular: 0,
            steps: vec![ToDatum::Visit(object)],
            made: Vec::new(),
            met: RootMap::default(),
            nodes: 0,
        }
    }

    /// Has the walk represent large quoted objects as wholes: their contents are not inspected.
    #[must_use]
    pub(crate) fn keeping_literals(self) -> DatumWalk {
        DatumWalk { keeps_literals: true, ..self }
    }

    /// Calls `visit` with every object that the walk keeps alive.
    pub(crate) fn roots(&self, visit: &mut dyn FnMut(Value)) {
        visit(self.object);
        self.met.values().for_each(|&(object, _)| visit(object));
        for step in &self.steps {
            let (ToDatum::Visit(object) | ToDatum::Build(object, _)) = step;
            visit(*object);
        }
    }

    /// Returns about how many bytes the walk takes.
    pub(crate) fn bytes(&self) -> usize {
        self.steps.capacity() * size_of::<ToDatum>() + (self.made.len() + self.met.len()) * NODE_BYTES
    }

    /// Goes on with the walk. Returns the datum, or `None` after the steps that are `left`, which it counts
    /// down: each compound node takes two.
    ///
    /// # Errors
    /// [`DatumError`]; for want of room, the walk can go on when there is some.
    pub(crate) fn run(
        &mut self,
        unit: &mut Unit,
        heap: &Heap,
        names: &Names,
        left: &mut usize,
    ) -> Result<Option<Datum>, DatumError> {
        let start = self.nodes;
        let outcome = self.go_on(unit, heap, names, left);
        unit.work += (self.nodes - start) as u64;
        match outcome {
            Ok(datum) => Ok(datum),
            Err(WalkError::Quoted(part)) if self.circular < MAX_CIRCULAR => {
                self.wholes.insert(part.bits());
                self.circular += 1;
                self.steps = vec![ToDatum::Visit(self.object)];
                self.made.clear();
                self.met.clear();
                Ok(None)
            }
            Err(WalkError::Quoted(_)) => Err(DatumError::Circular),
            Err(WalkError::Datum(error)) => Err(error),
        }
    }

    fn go_on(
        &mut self,
        unit: &mut Unit,
        heap: &Heap,
        names: &Names,
        left: &mut usize,
    ) -> Result<Option<Datum>, WalkError> {
        let span = self.span;
        // Data made already are counted when a part of the walk is over.
        let room = heap.room() / NODE_BYTES;
        let before = self.made.len() + self.met.len();
        while !self.steps.is_empty() {
            if *left == 0 {
                return Ok(None);
            }
            *left -= 1;
            if self.made.len() + self.met.len() > room.saturating_add(before) {
                return Err(WalkError::Datum(DatumError::NoRoom((room + 1) * NODE_BYTES)));
            }
            match self.steps.pop() {
                None => break,
                Some(ToDatum::Visit(object)) => {
                    self.nodes += 1;
                    if self.nodes > MAX_NODES {
                        return Err(WalkError::Datum(DatumError::TooLarge));
                    }
                    if self.wholes.contains(&object.bits()) {
                        self.made.push(Datum::new(DatumKind::Object(unit.pin(object)), span));
                        continue;
                    }
                    if unit.describe.is_some()
                        && let Some(kind) = packed::whole_of(heap, object).map_err(WalkError::Datum)?
                    {
                        let datum = Datum::new(kind, span);
                        unit.work += work_of(&datum) as u64 - 1;
                        self.made.push(datum);
                        continue;
                    }
                    let parts = parts_of(heap, object);
                    let parts = parts.or_else(|| {
                        unit.describe?;
                        vector_parts(heap, object)
                            .or_else(|| table::entries_of(heap, object).map(ObjectParts::Entries))
                            .or_else(|| unit.keeps_structures.then(|| structure_parts(heap, object))?)
                    });
                    let Some(parts) = parts else {
                        self.made.push(unit.atom_datum(heap, names, object, span));
                        continue;
                    };
                    match self.met.get(&object.bits()) {
                        Some((_, Some(datum))) => self.made.push(datum.clone()),
                        Some((_, None)) => return Err(circle(heap, names, &self.steps)),
                        None => {
                            self.met.insert(object.bits(), (object, None));
                            let count = match &parts {
                                ObjectParts::Pair(..) => 2,
                                ObjectParts::Items(_, items) => items.len(),
                                ObjectParts::Entries(entries) => entries.len(),
                            };
                            if self.keeps_literals
                                && let Some(quoted) = quoted_in(heap, names, object)
                                && is_large(heap, quoted)
                            {
                                self.wholes.insert(quoted.bits());
                            }
                            self.steps.push(ToDatum::Build(object, count));
                            visit_parts(parts, &mut self.steps);
                        }
                    }
                }
                Some(ToDatum::Build(object, count)) => {
                    let datum = if unit.describe.is_some() && heap.as_cons(object).is_some() {
                        let cdr = self.made.pop().unwrap_or_else(|| Datum::nil(span));
                        let car = self.made.pop().unwrap_or_else(|| Datum::nil(span));
                        Datum::cons(car, cdr, span)
                    } else if heap.kind(object) == Some(Kind::Structure) {
                        let parts = self.made.split_off(self.made.len() - count);
                        structure_datum(unit, heap, names, object, parts, span)
                    } else {
                        let parts = self.made.split_off(self.made.len() - count);
                        unit.compound(heap, object, parts, span)
                    };
                    self.met.insert(object.bits(), (object, Some(datum.clone())));
                    self.made.push(datum);
                }
            }
        }
        Ok(Some(self.made.pop().unwrap_or_else(|| Datum::nil(span))))
    }
}

/// Nodes above which a quoted object counts as large.
const LARGE: usize = 2000;

/// Returns whether an object has more than [`LARGE`] nodes.
fn is_large(heap: &Heap, object: Value) -> bool {
    let mut pending = vec![object];
    let mut nodes = 0;
    while let Some(object) = pending.pop() {
        nodes += 1;
        match parts_of(heap, object) {
            Some(ObjectParts::Pair(car, cdr)) => pending.extend([car, cdr]),
            Some(ObjectParts::Items(_, items)) => {
                nodes += items.len();
                pending.extend(items.iter().take(LARGE));
            }
            Some(ObjectParts::Entries(_)) | None => {}
        }
        if nodes > LARGE {
            return true;
        }
    }
    false
}

/// Returns the object in a form `(quote object)`.
fn quoted_in(heap: &Heap, names: &Names, form: Value) -> Option<Value> {
    let pair = heap.as_cons(form).filter(|pair| pair.car == names.known.quote)?;
    let rest = heap.as_cons(pair.cdr).filter(|rest| rest.cdr.is_nil())?;
    Some(rest.car)
}

/// Returns the error for an object that the steps of a walk have met within itself.
fn circle(heap: &Heap, names: &Names, steps: &[ToDatum]) -> WalkError {
    let quoted = steps.iter().rev().find_map(|step| match step {
        ToDatum::Build(form, _) => quoted_in(heap, names, *form),
        ToDatum::Visit(_) => None,
    });
    quoted.map_or(WalkError::Datum(DatumError::Circular), WalkError::Quoted)
}

/// The parts of an object other than an atom.
pub(super) enum ObjectParts<'a> {
    Pair(Value, Value),
    /// Dimensions (unless it is a simple vector) and elements.
    Items(Option<&'a [Value]>, &'a [Value]),
    /// The keys of a hash table, each followed by its value.
    Entries(Vec<Value>),
}

pub(super) fn parts_of(heap: &Heap, object: Value) -> Option<ObjectParts<'_>> {
    if let Some(pair) = heap.as_cons(object) {
        return Some(ObjectParts::Pair(pair.car, pair.cdr));
    }
    match heap.kind(object)? {
        Kind::SimpleVector => Some(ObjectParts::Items(None, heap.vector(object)?)),
        Kind::Array => {
            let dimensions = heap.array_dimensions(object)?;
            let array = heap.array(object)?;
            // Data cannot express fill pointers, adjustability, displacement, and elements that are not
            // values.
            let is_plain = array.header.flags & (Array::HAS_FILL_POINTER | Array::ADJUSTABLE) == 0
                && array.offset.is_nil();
            let items = heap.vector(array.data).filter(|_| is_plain && dimensions.len() != 1)?;
            Some(ObjectParts::Items(Some(dimensions), items))
        }
        _ => None,
    }
}

/// The elements of a vector of another kind, such as one with a fill pointer: to the embedder it is as good
/// as a simple one.
fn vector_parts(heap: &Heap, object: Value) -> Option<ObjectParts<'_>> {
    match vector_elements(heap, object)? {
        ArrayElements::Values(items) => Some(ObjectParts::Items(None, items)),
        _ => None,
    }
}

/// The slots of a structure of a program; `None` for an instance, and for the library's own.
fn structure_parts(heap: &Heap, object: Value) -> Option<ObjectParts<'_>> {
    let data = class::class_slot(heap, class_of(heap, object)?, class::slot::DATA);
    let tag = heap.symbol(*heap.vector(data)?.first()?)?;
    let is_of_program = heap.string_text(tag.name).as_deref() == Some("STRUCTURE");
    heap.structure_slots(object).filter(|_| is_of_program).map(|slots| ObjectParts::Items(None, slots))
}

/// Returns the class by which the slots of a structure are named.
fn class_of(heap: &Heap, object: Value) -> Option<Value> {
    if heap.is_instance(object) { None } else { heap.structure_class(heap.structure_whole(object)) }
}

/// Returns the list that stands for a structure with these slots.
fn structure_datum(
    unit: &mut Unit,
    heap: &Heap,
    names: &Names,
    object: Value,
    parts: Vec<Datum>,
    span: Span,
) -> Datum {
    let class = class_of(heap, object).unwrap_or(Value::NIL);
    let mut items = vec![Datum::symbol(Symbol::esl(KEPT_STRUCTURE), span)];
    items.push(unit.atom_datum(heap, names, class::name_of(heap, class), span));
    let mut rest = class::class_slot(heap, class, class::slot::SLOTS);
    for part in parts {
        let Some(pair) = heap.as_cons(rest) else { break };
        rest = pair.cdr;
        items.extend([unit.atom_datum(heap, names, pair.car, span), part]);
    }
    Datum::list(items, span)
}

/// Pushes visits onto `steps`, the first part on top.
fn visit_parts(parts: ObjectParts<'_>, steps: &mut Vec<ToDatum>) {
    match parts {
        ObjectParts::Pair(car, cdr) => steps.extend([ToDatum::Visit(cdr), ToDatum::Visit(car)]),
        ObjectParts::Items(_, items) => steps.extend(items.iter().rev().copied().map(ToDatum::Visit)),
        ObjectParts::Entries(entries) => steps.extend(entries.into_iter().rev().map(ToDatum::Visit)),
    }
}

/// Returns the datum that describes an atom which neither is a symbol nor the embedder's, if there is one.
pub(super) fn plain_kind(heap: &Heap, object: Value) -> Option<DatumKind> {
    if object.is_nil() {
        return Some(DatumKind::Nil);
    }
    if let Some(n) = integer_of(heap, object) {
        return Some(DatumKind::Integer(n));
    }
    if let Some((numerator, denominator)) = heap.ratio(object) {
        let part = |value| Some(integer_of(heap, value)?.to_big());
        return Some(DatumKind::Ratio(part(numerator)?, part(denominator)?));
    }
    if let Some(x) = heap.as_double(object) {
        return Some(DatumKind::Float(x));
    }
    if let Some(code) = object.as_character() {
        return Some(DatumKind::Character(char::from_u32(code)?));
    }
    let characters = heap.string(object)?;
    let is_text = characters.iter().all(|&code| code < 0x80 || char::from_u32(code).is_some());
    let text = heap.string_text(object).filter(|_| is_text)?;
    Some(DatumKind::String(text.into()))
}
