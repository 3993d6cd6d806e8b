//! Classes of structures and conditions.
//!
//! A Class is a record; [`slot`] names its slots. Every class has a *line*: the chain of first superclasses,
//! from the root down to the class itself, as a simple vector. `A` is on the line of `B` exactly when the
//! element of that vector at `A`'s depth is `A`, so the common test for a subclass is a few loads. Conditions
//! may have several superclasses; ancestors that are not on the line are in a list.
//!
//! Guarantees: a class with instances never changes its slots. Defining a name again with the same
//! superclasses and slots keeps the class; otherwise the name gets a new class, and old instances remain
//! unchanged. A class of `defclass` gets other superclasses in place ([`update`]): its instances have no
//! slots that depend on them.

use crate::heap::{AllocError, Heap, Kind};
use crate::names::Names;
use crate::value::Value;

/// Slots of a Class.
pub(crate) mod slot {
    /// Name, a symbol.
    pub(crate) const NAME: usize = 0;
    /// List of the direct superclasses.
    pub(crate) const SUPERS: usize = 1;
    /// Simple vector of the classes on the line, this class last.
    pub(crate) const LINE: usize = 2;
    /// Index of this class in that vector.
    pub(crate) const DEPTH: usize = 3;
    /// List of the superclasses that are not on the line, direct or not.
    pub(crate) const OTHERS: usize = 4;
    /// List of the names of the slots, inherited ones first.
    pub(crate) const SLOTS: usize = 5;
    /// Number of slots of an instance.
    pub(crate) const COUNT: usize = 6;
    /// Data of the library.
    pub(crate) const DATA: usize = 7;
    /// Number of slots of a Class.
    pub(crate) const LEN: usize = 8;
}

/// Greatest length of a line. Longer ones are certainly a mistake of the program, and each class copies its
/// line.
pub(crate) const MAX_DEPTH: usize = 200;

impl Names {
    /// Returns the class of this name, a symbol.
    pub(crate) fn find_class(&self, name: Value) -> Option<Value> {
        self.classes.get(&name.bits()).copied()
    }

    /// Makes `class` the class of this name, a symbol; none if there is no `class`. Instances keep their
    /// class.
    pub(crate) fn set_class(&mut self, heap: &mut Heap, name: Value, class: Option<Value>) {
        let old = match class {
            Some(class) => self.classes.insert(name.bits(), class),
            None => self.classes.swap_remove(&name.bits()),
        };
        if let Some(old) = old {
            heap.log_if_marking(old);
        }
    }

    /// Defines a class by its name (a symbol), superclasses (Classes), names of slots (symbols), and data of
    /// the library.
    ///
    /// # Errors
    /// As for every allocation; nothing is defined then.
    pub(crate) fn define_class(
        &mut self,
        heap: &mut Heap,
        name: Value,
        supers: &[Value],
        slots: &[Value],
        data: Value,
    ) -> Result<Value, AllocError> {
        if let Some(class) = self.find_class(name)
            && is_same_layout(heap, class, supers, slots)
        {
            heap.record_set(class, Kind::Class, slot::DATA, data);
            return Ok(class);
        }
        let (mut line, others) = lineage(heap, supers);
        let depth = line.len();
        line.push(Value::NIL);
        let line = heap.alloc_vector(&line)?;
        let mut record = [Value::NIL; slot::LEN];
        record[slot::NAME] = name;
        record[slot::SUPERS] = heap.list(supers)?;
        record[slot::LINE] = line;
        record[slot::DEPTH] = Value::index(depth);
        record[slot::OTHERS] = heap.list(&others)?;
        record[slot::SLOTS] = heap.list(slots)?;
        record[slot::COUNT] = Value::index(slots.len());
        record[slot::DATA] = data;
        let class = heap.alloc_record(Kind::Class, 0, 0, &record)?;
        heap.vector_set(line, depth, class);
        if let Some(old) = self.classes.insert(name.bits(), class) {
            heap.log_if_marking(old);
        }
        Ok(class)
    }

    /// Returns whether `class` is `ancestor` or inherits from it. False unless both are classes.
    #[inline]
    pub(crate) fn is_subclass(&self, heap: &Heap, class: Value, ancestor: Value) -> bool {
        if class == ancestor {
            return heap.is(class, Kind::Class);
        }
        let Some(record) = heap.record(ancestor, Kind::Class) else { return false };
        let depth = record[slot::DEPTH].as_index().unwrap_or(usize::MAX);
        line_of(heap, class).get(depth) == Some(&ancestor)
            || list(heap, class_slot(heap, class, slot::OTHERS)).any(|other| other == ancestor)
    }

    /// Returns whether `value` is an instance of `class`, or of a class that inherits from it.
    #[inline]
    pub(crate) fn is_instance(&self, heap: &Heap, value: Value, class: Value) -> bool {
        heap.structure_class(value).is_some_and(|own| self.is_subclass(heap, own, class))
    }
}

/// Returns the name of a class; `NIL` for any other value.
pub(crate) fn name_of(heap: &Heap, class: Value) -> Value {
    class_slot(heap, class, slot::NAME)
}

/// Returns a slot of a Class; `NIL` for any other value.
pub(crate) fn class_slot(heap: &Heap, class: Value, index: usize) -> Value {
    heap.record(class, Kind::Class).map_or(Value::NIL, |record| record[index])
}

fn line_of(heap: &Heap, class: Value) -> &[Value] {
    heap.vector(class_slot(heap, class, slot::LINE)).unwrap_or(&[])
}

/// Returns a class and all its ancestors.
fn ancestors(heap: &Heap, class: Value) -> impl Iterator<Item = Value> {
    let line = line_of(heap, class).iter().rev().copied();
    line.chain(list(heap, class_slot(heap, class, slot::OTHERS)))
}

/// Returns the items of one of the machine's own lists, which are proper.
pub(crate) fn list(heap: &Heap, list: Value) -> impl Iterator<Item = Value> {
    let mut rest = list;
    std::iter::from_fn(move || {
        let pair = heap.as_cons(rest)?;
        rest = pair.cdr;
        Some(pair.car)
    })
}

/// The line of the first of `supers`, and all that the others inherit from beside it.
fn lineage(heap: &Heap, supers: &[Value]) -> (Vec<Value>, Vec<Value>) {
    let line = supers.first().map_or(Vec::new(), |&first| line_of(heap, first).to_vec());
    let mut others: Vec<Value> = Vec::new();
    for &class in supers {
        for ancestor in ancestors(heap, class) {
            if !line.contains(&ancestor) && !others.contains(&ancestor) {
                others.push(ancestor);
            }
        }
    }
    (line, others)
}

/// Gives `class`, which stays the object that it is, other direct superclasses. Its subclasses are up to the
/// caller.
///
/// # Errors
/// As for every allocation; nothing has changed then.
pub(crate) fn update(heap: &mut Heap, class: Value, supers: &[Value]) -> Result<(), AllocError> {
    let (mut line, others) = lineage(heap, supers);
    let depth = line.len();
    line.push(class);
    let line = heap.alloc_vector(&line)?;
    let others = heap.list(&others)?;
    let supers = heap.list(supers)?;
    for (index, value) in [
        (slot::LINE, line),
        (slot::DEPTH, Value::index(depth)),
        (slot::OTHERS, others),
        (slot::SUPERS, supers),
    ] {
        heap.record_set(class, Kind::Class, index, value);
    }
    Ok(())
}

fn is_same_layout(heap: &Heap, class: Value, supers: &[Value], slots: &[Value]) -> bool {
    list(heap, class_slot(heap, class, slot::SUPERS)).eq(supers.iter().copied())
        && list(heap, class_slot(heap, class, slot::SLOTS)).eq(slots.iter().copied())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names() -> (Heap, Names) {
        let mut heap = crate::trust::heap_for_tests();
        let names = Names::new(&mut heap).unwrap();
        (heap, names)
    }

    fn define(heap: &mut Heap, names: &mut Names, name: &str, supers: &[Value], slots: &[&str]) -> Value {
        let name = names.intern_esl(heap, name).unwrap();
        let slots: Vec<Value> = slots.iter().map(|slot| names.intern_esl(heap, slot).unwrap()).collect();
        names.define_class(heap, name, supers, &slots, Value::NIL).unwrap()
    }

    #[test]
    fn a_subclass_is_told_by_its_line_or_its_other_ancestors() {
        let (mut heap, mut names) = names();
        let root = define(&mut heap, &mut names, "ROOT", &[], &[]);
        let left = define(&mut heap, &mut names, "LEFT", &[root], &[]);
        let right = define(&mut heap, &mut names, "RIGHT", &[root], &[]);
        let both = define(&mut heap, &mut names, "BOTH", &[left, right], &[]);
        let below = define(&mut heap, &mut names, "BELOW", &[both], &[]);
        let all = [root, left, right, both, below];
        let expected = ["*....", "**...", "*.*..", "****.", "*****"];
        for (class, row) in all.iter().zip(expected) {
            let found: String = all
                .iter()
                .map(|&ancestor| if names.is_subclass(&heap, *class, ancestor) { '*' } else { '.' })
                .collect();
            assert_eq!(found, row);
        }
        assert!(!names.is_subclass(&heap, Value::NIL, Value::NIL));
    }

    #[test]
    fn a_class_is_kept_when_it_is_defined_again_with_the_same_slots() {
        let (mut heap, mut names) = names();
        let point = define(&mut heap, &mut names, "POINT", &[], &["X", "Y"]);
        assert_eq!(define(&mut heap, &mut names, "POINT", &[], &["X", "Y"]), point);
        let other = define(&mut heap, &mut names, "POINT", &[], &["X", "Y", "Z"]);
        assert_ne!(other, point);
        let name = class_slot(&heap, point, slot::NAME);
        assert_eq!(names.find_class(name), Some(other));
    }
}
