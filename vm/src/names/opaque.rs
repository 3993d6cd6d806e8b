//! Things of the embedder's that the program holds: for each there is one object of class `HOST-OBJECT`, as
//! long as the program can reach it.
//!
//! Guarantees: a thing that comes in again is the same object. When the collector has found that the program
//! cannot reach an object any more, the machine lets go of the thing; this happens between two instructions,
//! at a tick that is the same in every run.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use esl_bytecode::datum::{Datum, DatumKind, OpaqueDatum};
use esl_bytecode::span::Span;
use esl_heap::store::{Stored, StoredBytes};
use esl_host::{GoneObject, has_gone_object};

use crate::heap::{AllocError, Heap};
use crate::names::{GivenMap, Names};
use crate::value::Value;

/// The things that the program holds.
#[derive(Clone, Default)]
pub(crate) struct Opaques {
    /// Objects, which this does not keep alive, and the data of their things, by the number in the object.
    held: GivenMap<u64, (Value, Datum)>,
    /// Their numbers, by the identities of the things.
    numbers: GivenMap<u64, u64>,
    /// Number of those made so far.
    pub(crate) made: u64,
    /// The embedder's things to be released, in the order of their numbers.
    unreachable: Vec<Datum>,
}

/// Slots of an object; the library knows them too (`operations.esl`).
const SLOTS: [&str; 3] = ["NUMBER", "KIND", "TEXT"];

impl Names {
    /// Returns the object of a thing of the embedder's.
    ///
    /// # Errors
    /// As for every allocation.
    pub(crate) fn opaque_object(
        &mut self,
        heap: &mut Heap,
        thing: &OpaqueDatum,
    ) -> Result<Value, AllocError> {
        if let Some(number) = self.opaques.numbers.get(&(thing.identity() as u64))
            && let Some(&(object, _)) = self.opaques.held.get(number)
        {
            // The object is in use from here on, perhaps by a task that the cycle under way has scanned
            // already.
            heap.mark(object);
            return Ok(object);
        }
        let class = match self.intern_esl(heap, "HOST-OBJECT").map(|name| (name, self.find_class(name)))? {
            (_, Some(class)) => class,
            (name, None) => {
                let mut slots = [Value::NIL; SLOTS.len()];
                for (slot, text) in slots.iter_mut().zip(SLOTS) {
                    *slot = self.intern_esl(heap, text)?;
                }
                self.define_class(heap, name, &[], &slots, Value::NIL)?
            }
        };
        let (kind, text) = (heap.alloc_str(thing.kind())?, heap.alloc_str(thing.text())?);
        let number = self.opaques.made + 1;
        let object = heap.alloc_structure(class, &[Value::index(number as usize), kind, text])?;
        self.opaques.made = number;
        self.opaques.numbers.insert(thing.identity() as u64, number);
        let datum = Datum::new(DatumKind::Opaque(thing.clone()), Span::default());
        self.opaques.held.insert(number, (object, datum));
        Ok(object)
    }

    /// Returns the datum of the thing that an object stands for.
    pub(crate) fn opaque_of(&self, heap: &Heap, object: Value) -> Option<&Datum> {
        let number = heap.structure_slots(object)?.first()?.as_index()? as u64;
        let (held, datum) = self.opaques.held.get(&number)?;
        (*held == object).then_some(datum)
    }
}

/// An object that is stored: its number, the object, and the kind and the text of its thing.
type StoredOpaque = (u64, (Value, (String, String)));

impl Opaques {
    /// Returns the number of the object that stands for a thing with this identity.
    pub(crate) fn number_of(&self, identity: usize) -> Option<u64> {
        self.numbers.get(&(identity as u64)).copied()
    }

    /// Returns the datum of the thing with this number.
    pub(crate) fn numbered(&self, number: u64) -> Option<&Datum> {
        self.held.get(&number).map(|(_, datum)| datum)
    }

    /// Returns the number of things held.
    pub(crate) fn len(&self) -> usize {
        self.held.len()
    }

    /// Returns whether the program holds a thing of this process.
    pub(crate) fn holds_things(&self) -> bool {
        self.held.values().any(|(_, datum)| !has_gone_object(std::slice::from_ref(datum)))
    }

    /// Notes which objects the marking that is about to end has not reached.
    pub(crate) fn note_unreachable(&mut self, heap: &Heap) {
        let gone = self.held.iter().filter(|(_, (object, _))| !heap.is_marked(*object));
        let mut gone: Vec<u64> = gone.map(|(&number, _)| number).collect();
        gone.sort_unstable();
        for number in gone {
            let Some((_, datum)) = self.held.remove(&number) else { continue };
            if let DatumKind::Opaque(thing) = datum.kind() {
                self.numbers.remove(&(thing.identity() as u64));
            }
            self.unreachable.push(datum);
        }
    }

    /// Adds the objects that the program holds to `out`, without their things.
    pub(super) fn store(&self, out: &mut Vec<u8>) {
        let mut held: Vec<StoredOpaque> = Vec::new();
        for (&number, (object, datum)) in &self.held {
            if let DatumKind::Opaque(thing) = datum.kind() {
                held.push((number, (*object, (thing.kind().to_owned(), thing.text().to_owned()))));
            }
        }
        held.sort_unstable_by_key(|&(number, _)| number);
        self.made.store(out);
        held.store(out);
    }

    /// Reads objects, for each of which stands a thing that is gone; `None` if the bytes end before.
    pub(super) fn load(from: &mut StoredBytes<'_>) -> Option<Opaques> {
        let mut opaques = Opaques::default();
        opaques.made = Stored::load(from)?;
        let held: Vec<StoredOpaque> = Stored::load(from)?;
        for (number, (object, (kind, text))) in held {
            let thing = OpaqueDatum::new(&kind, &text, Arc::new(GoneObject));
            opaques.numbers.insert(thing.identity() as u64, number);
            opaques.held.insert(number, (object, Datum::new(DatumKind::Opaque(thing), Span::default())));
        }
        Some(opaques)
    }

    /// Lets go of what the program cannot reach. A panic of the embedder's code goes no further.
    pub(crate) fn let_go(&mut self) {
        for thing in std::mem::take(&mut self.unreachable) {
            drop(catch_unwind(AssertUnwindSafe(|| drop(thing))));
        }
    }
}

impl Drop for Opaques {
    fn drop(&mut self) {
        let mut held: Vec<(u64, (Value, Datum))> = std::mem::take(&mut self.held).into_iter().collect();
        held.sort_unstable_by_key(|&(number, _)| number);
        self.unreachable.extend(held.into_iter().map(|(_, (_, datum))| datum));
        self.let_go();
    }
}
