//! Creating objects: one function for each kind.
//!
//! Guarantees: no function here collects, so values in the caller's hands stay good. Every object is
//! initialised completely before its address becomes a [`Value`]. After an error nothing has changed that a
//! program could see. Initialising stores need no barrier, since they overwrite nothing.
//!
//! The functions assert the contents that the interpreter relies on (H4 in [`super`]).

use super::layout::{Boxed, Cons, Float, Header, Kind, MAX_LENGTH, SymbolObject, Vector};
use super::{AllocError, Heap};
use crate::value::Value;

impl Heap {
    /// Creates a cons, if there is room in the current hole: the part of [`Heap::cons`] to inline into a hot
    /// loop.
    #[inline(always)]
    pub fn cons_in_hole(&mut self, car: Value, cdr: Value) -> Option<Value> {
        let cons = self.bump(size_of::<Cons>())?.as_ptr().cast::<Cons>();
        // SAFETY: `bump` gave us 16 aligned bytes of our own, and both fields are written before the value is
        // made.
        unsafe {
            cons.write(Cons { car, cdr });
            Some(Value::from_cons(cons))
        }
    }

    /// Creates a cons.
    ///
    /// # Errors
    /// As for every allocation, see [`AllocError`].
    #[inline]
    pub fn cons(&mut self, car: Value, cdr: Value) -> Result<Value, AllocError> {
        match self.cons_in_hole(car, cdr) {
            Some(v) => Ok(v),
            None => self.cons_slow(car, cdr),
        }
    }

    #[cold]
    #[inline(never)]
    fn cons_slow(&mut self, car: Value, cdr: Value) -> Result<Value, AllocError> {
        let cons = self.allocate(size_of::<Cons>())?.as_ptr().cast::<Cons>();
        // SAFETY: `allocate` gave us 16 aligned bytes of our own, written before the value is made.
        unsafe {
            cons.write(Cons { car, cdr });
            Ok(Value::from_cons(cons))
        }
    }

    /// Creates a list of `items`.
    pub fn list(&mut self, items: &[Value]) -> Result<Value, AllocError> {
        self.list_with_tail(items, Value::NIL)
    }

    /// Creates a list of `items` that ends in `tail` (`list*`).
    pub fn list_with_tail(&mut self, items: &[Value], tail: Value) -> Result<Value, AllocError> {
        items.iter().rev().try_fold(tail, |rest, &item| self.cons(item, rest))
    }

    /// Creates a box.
    #[inline]
    pub fn alloc_box(&mut self, value: Value) -> Result<Value, AllocError> {
        let boxed = self.allocate(size_of::<Boxed>())?.as_ptr().cast::<Boxed>();
        let header = Header { kind: Kind::Box, flags: 0, aux: 0, len: 1 };
        // SAFETY: `allocate` gave us 16 aligned bytes of our own, written before the value is made.
        unsafe {
            boxed.write(Boxed { header, value });
            Ok(Value::from_object(boxed.cast()))
        }
    }

    /// Returns the double `x`, boxed if necessary.
    #[inline]
    pub fn float(&mut self, x: f64) -> Result<Value, AllocError> {
        match Value::double(x) {
            Some(v) => Ok(v),
            None => self.alloc_float(x),
        }
    }

    #[cold]
    fn alloc_float(&mut self, x: f64) -> Result<Value, AllocError> {
        let float = self.allocate(size_of::<Float>())?.as_ptr().cast::<Float>();
        let header = Header { kind: Kind::Float, flags: 0, aux: 0, len: 1 };
        // SAFETY: `allocate` gave us 16 aligned bytes of our own, written before the value is made.
        unsafe {
            float.write(Float { header, value: x });
            Ok(Value::from_object(float.cast()))
        }
    }

    /// Creates a record of values.
    ///
    /// # Panics
    /// If `kind` is not a record, or is one whose contents the heap guarantees (symbol, function, array,
    /// structure, hash table): these have functions of their own.
    #[inline(always)]
    pub fn alloc_record(
        &mut self,
        kind: Kind,
        flags: u8,
        aux: u16,
        slots: &[Value],
    ) -> Result<Value, AllocError> {
        assert!(kind.is_record() && !is_vouched_for(kind), "{kind:?} is made by a function of its own");
        self.record_from(kind, flags, aux, &[], slots)
    }

    /// Creates a record of `len` slots, all `fill`, of a kind that [`Heap::alloc_record`] takes.
    ///
    /// # Panics
    /// As [`Heap::alloc_record`].
    pub fn alloc_record_filled(
        &mut self,
        kind: Kind,
        aux: u16,
        len: usize,
        fill: Value,
    ) -> Result<Value, AllocError> {
        assert!(kind.is_record() && !is_vouched_for(kind), "{kind:?} is made by a function of its own");
        let vector = self.begin_object(kind, 0, aux, len)?;
        // SAFETY: `begin_object` gave room for `len` elements; all are written before the value is made.
        unsafe {
            let elements = &raw mut (*vector.cast::<Vector>()).elements;
            let elements = elements.cast::<Value>();
            for i in 0..len {
                elements.add(i).write(fill);
            }
            Ok(Value::from_object(vector))
        }
    }

    /// Creates a simple vector of `elements`.
    pub fn alloc_vector(&mut self, elements: &[Value]) -> Result<Value, AllocError> {
        self.record_from(Kind::SimpleVector, 0, 0, &[], elements)
    }

    /// Creates a simple vector of `len` elements, all `fill`.
    pub fn alloc_vector_filled(&mut self, len: usize, fill: Value) -> Result<Value, AllocError> {
        self.alloc_record_filled(Kind::SimpleVector, 0, len, fill)
    }

    /// Creates a vector or string of `len` elements for [`Heap::fill_more`] to fill piece by piece, since the
    /// system takes its time for memory that is touched for the first time. One that is not large is filled
    /// at once, with 0 or the character of code 0. One that is to be filled with that is not touched at all.
    pub fn begin_vector(&mut self, len: usize, is_string: bool) -> Result<Value, AllocError> {
        let kind = if is_string { Kind::UnfinishedString } else { Kind::UnfinishedVector };
        if len <= MAX_LENGTH && !super::large::is_large(kind.size(len)) {
            return if is_string {
                self.alloc_string_filled(len, 0)
            } else {
                self.alloc_vector_filled(len, Value::small(0))
            };
        }
        let bytes = object_bytes(kind, len)?;
        let object = self.allocate_large(bytes, true)?.as_ptr().cast::<Header>();
        // SAFETY: `allocate_large` gave us at least 16 aligned bytes of our own.
        unsafe { object.write(Header { kind, flags: 0, aux: 0, len: len as u32 }) };
        // SAFETY: the elements of an unfinished object are not read: the collector does not scan them, and
        // `access` has nothing for these kinds. They are zero, which is an element of either kind.
        Ok(unsafe { Value::from_object(object) })
    }

    /// Fills at most `count` more elements of an object from [`Heap::begin_vector`]. Returns whether these
    /// were the last ones: then it is a vector or string now. In place of a value with an address, 0 is
    /// filled in. `None` if `v` is not unfinished.
    pub fn fill_more(&mut self, v: Value, fill: Value, count: usize) -> Option<bool> {
        let object = v.as_object_ptr()?;
        // SAFETY: H1, H2: an object value is the address of a live object. If it is unfinished it is large,
        // so that it has a large header, and its elements from `filled` to `len` are ours to write, and still
        // zero. When all are written it is what its new kind says.
        unsafe {
            let finished = match (*object).kind {
                Kind::UnfinishedVector => Kind::SimpleVector,
                Kind::UnfinishedString => Kind::String,
                _ => return None,
            };
            let large = super::large::header_of(object);
            let (from, len) = ((*large).filled as usize, (*object).len as usize);
            let to = len.min(from.saturating_add(count));
            if finished == Kind::String {
                let code = fill.as_character().unwrap_or(0);
                let characters = object.add(1).cast::<u32>();
                if code != 0 {
                    (from..to).for_each(|i| characters.add(i).write(code));
                }
            } else {
                // The collector does not look inside, so it would not find an address.
                let fill = if fill.is_address() { Value::small(0) } else { fill };
                let values = object.add(1).cast::<Value>();
                if fill.bits() != 0 {
                    (from..to).for_each(|i| values.add(i).write(fill));
                }
            }
            (*large).filled = to as u32;
            if to == len {
                (*object).kind = finished;
            }
            Some(to == len)
        }
    }

    /// Returns the number of filled elements of an unfinished object, and the number of all; `None` if `v` is
    /// not unfinished.
    pub fn filled(&self, v: Value) -> Option<(usize, usize)> {
        let object = v.as_object_ptr()?;
        // SAFETY: H1, H2: an object value is the address of a live object; an unfinished one is large, so
        // that it has a large header.
        unsafe {
            matches!((*object).kind, Kind::UnfinishedVector | Kind::UnfinishedString)
                .then(|| ((*super::large::header_of(object)).filled as usize, (*object).len as usize))
        }
    }

    /// Creates a ratio. The caller sees to it that it is in lowest terms with a denominator above one.
    pub fn alloc_ratio(&mut self, numerator: Value, denominator: Value) -> Result<Value, AllocError> {
        self.record_from(Kind::Ratio, 0, 0, &[], &[numerator, denominator])
    }

    /// Creates a complex number. Both parts are rationals, the second not 0, or both are floats.
    pub fn alloc_complex(&mut self, real: Value, imaginary: Value) -> Result<Value, AllocError> {
        self.record_from(Kind::Complex, 0, 0, &[], &[real, imaginary])
    }

    /// Creates an identity that carries `value`.
    pub fn alloc_tag(&mut self, value: Value) -> Result<Value, AllocError> {
        self.record_from(Kind::Tag, 0, 0, &[], &[value])
    }

    /// Creates an instance of `class` with these slots.
    ///
    /// # Panics
    /// If `class` is not a Class.
    pub fn alloc_structure(&mut self, class: Value, slots: &[Value]) -> Result<Value, AllocError> {
        assert_eq!(self.kind(class), Some(Kind::Class), "the class of a structure is a Class");
        self.record_from(Kind::Structure, 0, 0, &[class], slots)
    }

    /// Creates an array that is not simple. `aux` becomes the number of dimensions.
    ///
    /// # Panics
    /// If `data` is none of SimpleVector, String, Bytes, or there are more than 65 535 dimensions.
    pub fn alloc_array(
        &mut self,
        flags: u8,
        data: Value,
        fill: Value,
        dimensions: &[Value],
    ) -> Result<Value, AllocError> {
        self.alloc_displaced_array(flags, data, fill, Value::NIL, dimensions)
    }

    /// As [`Heap::alloc_array`]. With an `offset` other than `nil`, the array is displaced to `data`, which
    /// may be any array.
    ///
    /// # Panics
    /// As [`Heap::alloc_array`].
    pub fn alloc_displaced_array(
        &mut self,
        flags: u8,
        data: Value,
        fill: Value,
        offset: Value,
        dimensions: &[Value],
    ) -> Result<Value, AllocError> {
        assert!(self.is_array_data(data), "the data of an array is a vector or string");
        let rank = u16::try_from(dimensions.len()).expect("an array has less than 65536 dimensions");
        self.record_from(Kind::Array, flags, rank, &[data, fill, offset], dimensions)
    }

    /// Creates a symbol without value, macro function and properties.
    ///
    /// # Panics
    /// If `name` is not a String or `function` not a Function.
    pub fn alloc_symbol(
        &mut self,
        flags: u8,
        name: Value,
        package: Value,
        function: Value,
    ) -> Result<Value, AllocError> {
        assert_eq!(self.kind(name), Some(Kind::String), "the name of a symbol is a string");
        assert_eq!(self.kind(function), Some(Kind::Function), "the function of a symbol is a function");
        let slots: [Value; SymbolObject::LEN] =
            [name, package, Value::UNBOUND, function, Value::NIL, Value::NIL];
        self.record_from(Kind::Symbol, flags, 0, &[], &slots)
    }

    /// Allocates an object. Its header is written, its `len` elements are not.
    #[inline(always)]
    pub(super) fn begin_object(
        &mut self,
        kind: Kind,
        flags: u8,
        aux: u16,
        len: usize,
    ) -> Result<*mut Header, AllocError> {
        let object = self.allocate(object_bytes(kind, len)?)?.as_ptr().cast::<Header>();
        // SAFETY: `allocate` gave us at least 16 aligned bytes of our own.
        unsafe { object.write(Header { kind, flags, aux, len: len as u32 }) };
        Ok(object)
    }

    /// Creates a record of a kind whose contents the heap guarantees; the caller sees to it that they are
    /// right.
    pub(crate) fn vouched_record(
        &mut self,
        kind: Kind,
        aux: u16,
        slots: &[Value],
    ) -> Result<Value, AllocError> {
        self.record_from(kind, 0, aux, &[], slots)
    }

    /// Creates a record of the values of `first` and then those of `rest`.
    #[inline(always)]
    pub(super) fn record_from(
        &mut self,
        kind: Kind,
        flags: u8,
        aux: u16,
        first: &[Value],
        rest: &[Value],
    ) -> Result<Value, AllocError> {
        debug_assert!(kind.is_record());
        let object = self.begin_object(kind, flags, aux, first.len() + rest.len())?;
        // SAFETY: `begin_object` gave room for all elements; they are written before the value is made.
        unsafe {
            let elements = object.add(1).cast::<Value>();
            std::ptr::copy_nonoverlapping(first.as_ptr(), elements, first.len());
            std::ptr::copy_nonoverlapping(rest.as_ptr(), elements.add(first.len()), rest.len());
            Ok(Value::from_object(object))
        }
    }
}

/// Returns whether the heap guarantees the contents of objects of this kind.
pub(super) const fn is_vouched_for(kind: Kind) -> bool {
    matches!(kind, Kind::Symbol | Kind::Function | Kind::Array | Kind::Structure | Kind::HashTable)
}

/// Returns the bytes of an object of this kind with so many elements.
///
/// # Errors
/// [`AllocError::TooLarge`] if no object can be as long.
fn object_bytes(kind: Kind, len: usize) -> Result<usize, AllocError> {
    match len {
        0..=MAX_LENGTH => Ok(kind.size(len)),
        _ => Err(AllocError::TooLarge { requested: len.saturating_mul(1 << kind.element_shift()) }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Number of elements of a large vector, small enough for Miri.
    const LONG: usize = crate::heap::arena::LARGE;

    #[test]
    fn long_vectors_are_filled_in_pieces() {
        let mut heap = Heap::for_tests();
        let v = heap.begin_vector(LONG, false).unwrap();
        assert_eq!((heap.kind(v), heap.vector(v)), (Some(Kind::UnfinishedVector), None));
        assert_eq!(heap.fill_more(v, Value::T, LONG - 1), Some(false));
        assert_eq!(heap.filled(v), Some((LONG - 1, LONG)));
        assert_eq!(heap.vector(v), None);
        assert_eq!(heap.fill_more(v, Value::NIL, 10), Some(true));
        let elements = heap.vector(v).unwrap();
        assert_eq!((elements.len(), elements[LONG - 2], elements[LONG - 1]), (LONG, Value::T, Value::NIL));
        assert_eq!((heap.fill_more(v, Value::T, 1), heap.filled(v)), (None, None), "it is finished");
    }

    #[test]
    fn long_vectors_are_filled_with_zero() {
        let mut heap = Heap::for_tests();
        let v = heap.begin_vector(LONG, false).unwrap();
        assert_eq!(heap.fill_more(v, Value::small(0), LONG / 2), Some(false));
        assert_eq!(heap.fill_more(v, Value::small(0), LONG), Some(true));
        assert!(heap.vector(v).unwrap().iter().all(|&element| element == Value::small(0)));
        heap.check().unwrap();
    }

    #[test]
    fn long_strings_are_filled_in_pieces() {
        let mut heap = Heap::for_tests();
        let v = heap.begin_vector(LONG, true).unwrap();
        let a = Value::character('a' as u32).unwrap();
        assert_eq!((heap.fill_more(v, a, LONG / 2), heap.string(v)), (Some(false), None));
        assert_eq!(heap.fill_more(v, Value::T, usize::MAX), Some(true));
        let characters = heap.string(v).unwrap();
        assert_eq!((characters[0], characters[LONG - 1]), ('a' as u32, 0));
    }

    #[test]
    fn short_ones_are_finished_at_once() {
        let mut heap = Heap::for_tests();
        let v = heap.begin_vector(3, false).unwrap();
        assert_eq!(heap.vector(v), Some(&[Value::small(0); 3][..]));
        let v = heap.begin_vector(2, true).unwrap();
        assert_eq!(heap.string(v), Some(&[0, 0][..]));
        assert_eq!(heap.fill_more(v, Value::NIL, 1), None);
    }

    /// An unfinished object must not hold the only reference to a value: it is not scanned until it is
    /// finished.
    #[test]
    fn nothing_with_an_address_is_filled_in() {
        let mut heap = Heap::for_tests();
        let v = heap.begin_vector(LONG, false).unwrap();
        let cell = heap.cons(Value::T, Value::NIL).unwrap();
        assert_eq!(heap.fill_more(v, cell, LONG), Some(true));
        assert!(heap.vector(v).unwrap().iter().all(|&element| element == Value::small(0)));
    }

    #[test]
    fn an_unfinished_vector_lives_through_a_collection() {
        let mut heap = Heap::for_tests();
        let v = heap.begin_vector(LONG, false).unwrap();
        let dead = heap.begin_vector(LONG, false).unwrap();
        heap.fill_more(v, Value::T, LONG / 2);
        heap.fill_more(dead, Value::T, LONG / 2);
        // SAFETY: nothing but `v` is used below.
        unsafe { heap.collect_fully(|heap| heap.mark(v)) };
        assert_eq!(heap.fill_more(v, Value::T, LONG), Some(true));
        assert!(heap.vector(v).unwrap().iter().all(|&element| element == Value::T));
        heap.check().unwrap();
    }

    /// The collector gets the values that a copy overwrites, as if they had been stored over.
    #[test]
    fn copying_over_elements_keeps_the_snapshot() {
        let mut heap = Heap::for_tests();
        let cell = heap.cons(Value::T, Value::NIL).unwrap();
        let v = heap.alloc_vector(&[Value::T, cell, cell, Value::NIL]).unwrap();
        heap.begin_cycle();
        assert_eq!(heap.vector_copy(v, 0, v, 1, 1), Some(()));
        assert!(heap.is_marked(cell));
        assert_eq!(heap.vector(v).unwrap(), &[Value::T, Value::T, cell, Value::NIL]);
        assert_eq!(heap.vector_copy(v, 1, v, 0, 3), Some(()), "overlapping");
        assert_eq!(heap.vector(v).unwrap(), &[Value::T, cell, Value::NIL, Value::NIL]);
        assert_eq!(heap.vector_fill(v, 1, 3, Value::T), Some(()));
        assert_eq!(heap.vector(v).unwrap(), &[Value::T, Value::T, Value::T, Value::NIL]);
        assert_eq!((heap.vector_copy(v, 2, v, 0, 3), heap.vector_fill(v, 2, 5, Value::T)), (None, None));
    }

    #[test]
    fn large_objects_are_given_back_in_pieces() {
        let mut heap = Heap::for_tests();
        let size = 40 * LONG;
        let before = heap.stats().committed;
        heap.alloc_bytes_filled(size, 1).unwrap();
        heap.begin_cycle();
        while let crate::heap::SliceOutcome::More = heap.slice(100) {}
        // SAFETY: nothing is used below.
        unsafe { heap.end_marking() };
        let mut committed = vec![heap.stats().committed];
        while heap.phase() == crate::heap::Phase::Sweeping {
            _ = heap.slice(1);
            heap.check().unwrap();
            committed.push(heap.stats().committed);
        }
        assert_eq!(heap.stats().committed, before);
        assert!(committed.is_sorted_by(|a, b| a >= b), "{committed:?}");
        assert!(cfg!(miri) || committed.iter().filter(|&&c| c > before && c < committed[0]).count() > 3);
    }
}
