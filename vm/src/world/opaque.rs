//! Things of the embedder's that the program holds: for each there is one object of class `HOST-OBJECT`, as
//! long as the program can reach it.
//!
//! Guarantees: a thing that comes in again is the same object. When the collector has found that the program
//! cannot reach an object any more, the machine lets go of the thing; this happens between two instructions,
//! at a tick that is the same in every run.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};

use esl_bytecode::datum::OpaqueDatum;

use crate::heap::{AllocError, Heap};
use crate::value::Value;
use crate::world::World;

/// The things that the program holds.
#[derive(Clone, Default)]
pub(crate) struct Opaques {
    /// Objects, which this does not keep alive, and their things, by the number in the object.
    held: BTreeMap<u64, (Value, OpaqueDatum)>,
    /// Their numbers, by the identities of the things.
    numbers: BTreeMap<usize, u64>,
    /// Number of those made so far.
    pub(crate) made: u64,
    /// What is to be let go.
    unreachable: Vec<OpaqueDatum>,
}

/// Slots of an object; the library knows them too (`operations.esl`).
const SLOTS: [&str; 3] = ["NUMBER", "KIND", "TEXT"];

impl World {
    /// Returns the object of a thing of the embedder's.
    ///
    /// # Errors
    /// As for every allocation.
    pub(crate) fn opaque_object(
        &mut self,
        heap: &mut Heap,
        thing: &OpaqueDatum,
    ) -> Result<Value, AllocError> {
        if let Some(number) = self.opaques.numbers.get(&thing.identity())
            && let Some(&(object, _)) = self.opaques.held.get(number)
        {
            // From here on somebody uses it, who may have been seen already by the cycle under way.
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
        self.opaques.numbers.insert(thing.identity(), number);
        self.opaques.held.insert(number, (object, thing.clone()));
        Ok(object)
    }

    /// Returns the thing that an object stands for.
    pub(crate) fn opaque_of(&self, heap: &Heap, object: Value) -> Option<&OpaqueDatum> {
        let number = heap.structure_slots(object)?.first()?.as_index()? as u64;
        let (held, thing) = self.opaques.held.get(&number)?;
        (*held == object).then_some(thing)
    }
}

impl Opaques {
    /// Returns the number of things held.
    pub(crate) fn len(&self) -> usize {
        self.held.len()
    }

    /// Notes which objects the marking that is about to end has not reached.
    pub(crate) fn note_unreachable(&mut self, heap: &Heap) {
        let Opaques { held, numbers, unreachable, .. } = self;
        held.retain(|_, (object, thing)| {
            let is_reached = heap.is_marked(*object);
            if !is_reached {
                numbers.remove(&thing.identity());
                unreachable.push(thing.clone());
            }
            is_reached
        });
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
        for (_, (_, thing)) in std::mem::take(&mut self.held) {
            drop(catch_unwind(AssertUnwindSafe(|| drop(thing))));
        }
        self.let_go();
    }
}
