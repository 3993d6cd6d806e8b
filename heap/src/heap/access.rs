//! Checked access to objects: the heap as safe code sees it.
//!
//! Guarantees: nothing here can break memory safety, however odd the caller. Each function tests tag, kind
//! and index, and returns `None` if one of them does not fit. That the address itself is good, and what is
//! behind it, are the facts H1 to H5 of [`super`]. A slice of the heap borrows the heap, so nothing can be
//! stored, allocated or collected while it is in use.
//!
//! Every store of a value goes through [`Heap::store_contents`], the write barrier, or into slots that
//! [`Heap::slots_mut`] has logged; stores of raw data need none. Some parts of objects the interpreter trusts
//! without a test: the function of a symbol, the code of a function, the data of an array, the class of a
//! structure. These have setters of their own, or none.

use super::Heap;
use super::layout::{Array, Cons, Float, Header, Kind, StructureObject, SymbolObject};
use super::object::is_vouched_for;
use crate::value::Value;
use std::slice;

impl Heap {
    /// Returns the kind of an object; `None` for a cons and for a value without an address.
    #[inline(always)]
    pub fn kind(&self, v: Value) -> Option<Kind> {
        Some(self.header(v)?.kind)
    }

    /// Returns whether `v` is an object of this kind.
    #[inline(always)]
    pub fn is(&self, v: Value, kind: Kind) -> bool {
        self.kind(v) == Some(kind)
    }

    /// Returns the header of an object.
    #[inline(always)]
    pub fn header(&self, v: Value) -> Option<Header> {
        // SAFETY: H1, H2: an object value is the address of a live header.
        v.as_object_ptr().map(|object| unsafe { *object })
    }

    #[inline(always)]
    pub(crate) fn object_of(&self, v: Value, kind: Kind) -> Option<*mut Header> {
        let object = v.as_object_ptr()?;
        // SAFETY: H1, H2: an object value is the address of a live header.
        if unsafe { (*object).kind } == kind { Some(object) } else { None }
    }

    // Conses.

    /// Returns the cons, if `v` is one.
    #[inline(always)]
    pub fn as_cons(&self, v: Value) -> Option<Cons> {
        // SAFETY: H1, H2: a cons value is the address of a live cons.
        v.as_cons_ptr().map(|cons| unsafe { *cons })
    }

    /// Returns the car of a cons, `nil` for `nil`, `None` for anything else.
    #[inline(always)]
    pub fn car(&self, v: Value) -> Option<Value> {
        match self.as_cons(v) {
            Some(cons) => Some(cons.car),
            None if v.is_nil() => Some(v),
            None => None,
        }
    }

    /// Returns the cdr of a cons, `nil` for `nil`, `None` for anything else.
    #[inline(always)]
    pub fn cdr(&self, v: Value) -> Option<Value> {
        match self.as_cons(v) {
            Some(cons) => Some(cons.cdr),
            None if v.is_nil() => Some(v),
            None => None,
        }
    }

    /// Sets the car of a cons; `None` if `v` is not a cons.
    #[inline(always)]
    pub fn set_car(&mut self, v: Value, new: Value) -> Option<()> {
        let cons = v.as_cons_ptr()?;
        // SAFETY: H1, H2: a cons value is the address of a live cons.
        unsafe { self.store(&raw mut (*cons).car, new) };
        Some(())
    }

    /// Sets the cdr of a cons; `None` if `v` is not a cons.
    #[inline(always)]
    pub fn set_cdr(&mut self, v: Value, new: Value) -> Option<()> {
        let cons = v.as_cons_ptr()?;
        // SAFETY: H1, H2: a cons value is the address of a live cons.
        unsafe { self.store(&raw mut (*cons).cdr, new) };
        Some(())
    }

    // Records.

    /// Returns all slots of a record of this kind, in the order of its layout; `None` if `v` is not one, or
    /// is a hash table.
    #[inline]
    pub fn record(&self, v: Value, kind: Kind) -> Option<&[Value]> {
        if !kind.is_open_record() {
            return None;
        }
        let object = self.object_of(v, kind)?;
        // SAFETY: H3: a record has `len` values after its header; H5: they are borrowed with the heap.
        Some(unsafe { slice::from_raw_parts(object.add(1).cast(), (*object).len as usize) })
    }

    /// Returns slot `index` of a record of any kind; `None` if `v` has no such slot, or is a hash table.
    #[inline(always)]
    pub fn slot(&self, v: Value, index: usize) -> Option<Value> {
        let object = v.as_object_ptr()?;
        // SAFETY: H1, H2: an object value is the address of a live object; H3: a record has `len` values
        // after its header.
        unsafe {
            if !(*object).kind.is_open_record() || index >= (*object).len as usize {
                return None;
            }
            Some(*object.add(1).cast::<Value>().add(index))
        }
    }

    /// Returns slot `index` of a record of any kind; `NIL` if `v` has no such slot, or is a hash table.
    #[inline]
    pub fn slot_or_nil(&self, v: Value, index: usize) -> Value {
        self.slot(v, index).unwrap_or(Value::NIL)
    }

    /// Returns the first `N` slots of a record of this kind; `None` if `v` is not one, has fewer, or is a
    /// hash table.
    #[inline(always)]
    pub fn slots<const N: usize>(&self, v: Value, kind: Kind) -> Option<&[Value; N]> {
        self.record(v, kind)?.first_chunk()
    }

    /// Returns the first `N` slots of a record of this kind, to be set; `None` if `v` is not one, has fewer,
    /// or is of a kind whose slots [`Heap::record_set`] does not set.
    ///
    /// All of them count as overwritten, so this is for code that sets several.
    #[inline(always)]
    pub fn slots_mut<const N: usize>(&mut self, v: Value, kind: Kind) -> Option<&mut [Value; N]> {
        if !kind.is_record() || is_vouched_for(kind) {
            return None;
        }
        let object = self.object_of(v, kind)?;
        // SAFETY: H3: a record has `len` values after its header; H5: the first `N` of them are borrowed with
        // the heap, mutably, so nothing else refers to them.
        let slots = unsafe {
            if N > (*object).len as usize {
                return None;
            }
            &mut *object.add(1).cast::<[Value; N]>()
        };
        self.log_all_if_marking(slots);
        Some(slots)
    }

    /// Sets slot `index` of a record of any kind; see [`Heap::record_set`].
    #[inline]
    pub fn slot_set(&mut self, v: Value, index: usize, new: Value) -> Option<()> {
        self.record_set(v, self.kind(v)?, index, new)
    }

    /// Sets slot `index` of a record of this kind; `None` if `v` is not one or has no such slot.
    ///
    /// The slots of symbols, functions, arrays and hash tables, and the class (slot 0) of a structure, cannot
    /// be set in this way: the result is `None`.
    #[inline]
    pub fn record_set(&mut self, v: Value, kind: Kind, index: usize, new: Value) -> Option<()> {
        if !kind.is_record() || is_vouched_for(kind) && (kind != Kind::Structure || index == 0) {
            return None;
        }
        self.set_slot(v, kind, index, new)
    }

    #[inline(always)]
    pub(super) fn set_slot(&mut self, v: Value, kind: Kind, index: usize, new: Value) -> Option<()> {
        let object = self.object_of(v, kind)?;
        // SAFETY: H3: the kind is that of a record, which has `len` values after its header; `index` is below
        // that.
        unsafe {
            if index >= (*object).len as usize {
                return None;
            }
            self.store(object.add(1).cast::<Value>().add(index), new);
        }
        Some(())
    }

    /// Returns the elements of a simple vector.
    #[inline(always)]
    pub fn vector(&self, v: Value) -> Option<&[Value]> {
        self.record(v, Kind::SimpleVector)
    }

    /// Sets an element of a simple vector; `None` if `v` is not one or has no such element.
    #[inline(always)]
    pub fn vector_set(&mut self, v: Value, index: usize, new: Value) -> Option<()> {
        self.set_slot(v, Kind::SimpleVector, index, new)
    }

    /// Copies `count` elements of a simple vector to another one, or to the same: then as if by way of a
    /// third. `None` if one is not a simple vector or has too few elements.
    pub fn vector_copy(
        &mut self,
        from: Value,
        from_start: usize,
        to: Value,
        to_start: usize,
        count: usize,
    ) -> Option<()> {
        let source = self.vector(from)?.get(from_start..)?.get(..count)?.as_ptr();
        let old = self.vector(to)?.get(to_start..)?.get(..count)?.len();
        debug_assert_eq!(old, count);
        let to = self.object_of(to, Kind::SimpleVector)?;
        // SAFETY: H3: both ranges are inside of vectors; H5: all that is overwritten is marked first.
        unsafe {
            let target = to.add(1).cast::<Value>().add(to_start);
            if self.marking {
                (0..count).for_each(|i| self.mark(*target.add(i)));
            }
            target.copy_from(source, count);
        }
        Some(())
    }

    /// Sets the elements of a simple vector from `start` to before `end`; `None` if `v` is not one or has too
    /// few elements.
    pub fn vector_fill(&mut self, v: Value, start: usize, end: usize, value: Value) -> Option<()> {
        let count = self.vector(v)?.get(start..end)?.len();
        let object = self.object_of(v, Kind::SimpleVector)?;
        // SAFETY: H3: the range is inside of a vector; H5: all that is overwritten is marked first.
        unsafe {
            let target = object.add(1).cast::<Value>().add(start);
            if self.marking {
                (0..count).for_each(|i| self.mark(*target.add(i)));
            }
            (0..count).for_each(|i| *target.add(i) = value);
        }
        Some(())
    }

    /// Returns the slots of a structure, without its class.
    #[inline]
    pub fn structure_slots(&self, v: Value) -> Option<&[Value]> {
        self.record(self.structure_whole(v), Kind::Structure).map(|slots| &slots[1..])
    }

    /// Returns the structure that holds the slots of `v`: `v` itself, unless it has moved.
    #[inline]
    pub fn structure_whole(&self, v: Value) -> Value {
        let mut whole = v;
        // One that has moved does not become the whole of another one, so this ends.
        while self.flags(whole, Kind::Structure).is_some_and(|flags| flags & StructureObject::MOVED != 0) {
            whole = self.slot_or_nil(whole, 1);
        }
        whole
    }

    /// Moves the structure `v`: its slots are those of the structure `whole` from now on, and `class` is its
    /// class. It stays the object that it is. `None` if one of the two is not a structure, is an instance or
    /// has moved, if `v` has no slot, or if `class` is not a Class.
    pub fn structure_move(&mut self, v: Value, whole: Value, class: Value) -> Option<()> {
        let unfit = StructureObject::INSTANCE | StructureObject::MOVED;
        let (flags, other) = (self.flags(v, Kind::Structure)?, self.flags(whole, Kind::Structure)?);
        let count = self.record(v, Kind::Structure)?.len();
        if (flags | other) & unfit != 0 || v == whole || count < 2 || !self.is(class, Kind::Class) {
            return None;
        }
        self.set_slot(v, Kind::Structure, 0, class)?;
        self.set_slot(v, Kind::Structure, 1, whole)?;
        (2..count).try_for_each(|index| self.set_slot(v, Kind::Structure, index, Value::NIL))?;
        self.set_flags(v, Kind::Structure, flags | StructureObject::MOVED)
    }

    /// Returns the class of a structure.
    #[inline]
    pub fn structure_class(&self, v: Value) -> Option<Value> {
        self.record(v, Kind::Structure).map(|slots| slots[0])
    }

    /// Sets a slot of a structure, where the class does not count; `None` if `v` has no such slot.
    #[inline]
    pub fn structure_set(&mut self, v: Value, index: usize, new: Value) -> Option<()> {
        let v = self.structure_whole(v);
        self.set_slot(v, Kind::Structure, index.checked_add(1)?, new)
    }

    /// Whether `v` is a structure that may get another class: see [`StructureObject::INSTANCE`].
    #[inline]
    pub fn is_instance(&self, v: Value) -> bool {
        self.flags(v, Kind::Structure).is_some_and(|flags| flags & StructureObject::INSTANCE != 0)
    }

    /// Returns the slots of a structure that `equal` compares by them: see [`StructureObject::VALUE`].
    pub fn value_slots(&self, v: Value) -> Option<&[Value]> {
        let flags = self.flags(v, Kind::Structure)?;
        if flags & StructureObject::VALUE != 0 { self.structure_slots(v) } else { None }
    }

    /// Makes `v`, an instance, one of another class; `None` if it is none, or `class` is not a Class.
    pub fn instance_set_class(&mut self, v: Value, class: Value) -> Option<()> {
        if !self.is_instance(v) || !self.is(class, Kind::Class) {
            return None;
        }
        self.set_slot(v, Kind::Structure, 0, class)
    }

    // Symbols and functions.

    /// Returns the symbol object, if `v` is one. The values `nil` and `t` are not.
    #[inline(always)]
    pub fn symbol(&self, v: Value) -> Option<&SymbolObject> {
        let object = self.object_of(v, Kind::Symbol)?;
        // SAFETY: H3: the kind says that this is a Symbol; H5: it is borrowed with the heap.
        Some(unsafe { &*object.cast() })
    }

    /// Sets the global value of a symbol; `None` if `v` is not a symbol object.
    pub fn symbol_set_value(&mut self, v: Value, new: Value) -> Option<()> {
        self.set_slot(v, Kind::Symbol, 2, new)
    }

    /// Sets the function of a symbol; `None` if `v` is not a symbol object or `new` not a function.
    pub fn symbol_set_function(&mut self, v: Value, new: Value) -> Option<()> {
        if !self.is(new, Kind::Function) {
            return None;
        }
        self.set_slot(v, Kind::Symbol, 3, new)
    }

    /// Sets the macro function of a symbol; `None` if `v` is not a symbol object.
    pub fn symbol_set_macro_function(&mut self, v: Value, new: Value) -> Option<()> {
        self.set_slot(v, Kind::Symbol, 4, new)
    }

    /// Sets the property list of a symbol; `None` if `v` is not a symbol object.
    pub fn symbol_set_plist(&mut self, v: Value, new: Value) -> Option<()> {
        self.set_slot(v, Kind::Symbol, 5, new)
    }

    // Arrays.

    /// Returns whether `v` may be the data of an array, or the array to which another is displaced.
    pub fn is_array_data(&self, v: Value) -> bool {
        matches!(self.kind(v), Some(Kind::SimpleVector | Kind::String | Kind::Bytes | Kind::Array))
    }

    /// Returns the fixed part of an array that is not simple.
    pub fn array(&self, v: Value) -> Option<&Array> {
        let object = self.object_of(v, Kind::Array)?;
        // SAFETY: H3: the kind says that this is an Array; H5: it is borrowed with the heap.
        Some(unsafe { &*object.cast() })
    }

    /// Returns the dimensions of an array that is not simple.
    pub fn array_dimensions(&self, v: Value) -> Option<&[Value]> {
        self.record(v, Kind::Array).map(|slots| &slots[3..])
    }

    /// Sets the fill pointer of an array that is not simple; `None` if `v` is not one.
    pub fn array_set_fill(&mut self, v: Value, fill: Value) -> Option<()> {
        self.set_slot(v, Kind::Array, 1, fill)
    }

    /// Replaces the data of an array that is not simple; `None` if `v` is not one, or `data` is none of
    /// SimpleVector, String, Bytes, Array.
    pub fn array_set_data(&mut self, v: Value, data: Value) -> Option<()> {
        self.array_displace(v, data, Value::NIL)
    }

    /// As [`Heap::array_set_data`], with the index of the first element in the array `data`; `nil` if `v` is
    /// not displaced.
    pub fn array_displace(&mut self, v: Value, data: Value, offset: Value) -> Option<()> {
        if !self.is_array_data(data) {
            return None;
        }
        self.set_slot(v, Kind::Array, 0, data)?;
        self.set_slot(v, Kind::Array, 2, offset)
    }

    /// Sets a dimension of an array that is not simple; `None` if `v` is not one or has no such dimension.
    pub fn array_set_dimension(&mut self, v: Value, axis: usize, size: Value) -> Option<()> {
        self.set_slot(v, Kind::Array, axis.checked_add(3)?, size)
    }

    // Numbers.

    /// Returns the double, boxed or not.
    #[inline]
    pub fn as_double(&self, v: Value) -> Option<f64> {
        v.as_double().or_else(|| {
            let object = self.object_of(v, Kind::Float)?;
            // SAFETY: H3: the kind says that this is a Float.
            Some(unsafe { (*object.cast::<Float>()).value })
        })
    }

    /// Returns numerator and denominator of a ratio.
    pub fn ratio(&self, v: Value) -> Option<(Value, Value)> {
        self.record(v, Kind::Ratio).map(|slots| (slots[0], slots[1]))
    }

    /// Returns real and imaginary part of a complex number.
    pub fn complex(&self, v: Value) -> Option<(Value, Value)> {
        self.record(v, Kind::Complex).map(|slots| (slots[0], slots[1]))
    }

    // Flags.

    /// Returns the flags of an object of this kind.
    #[inline]
    pub fn flags(&self, v: Value, kind: Kind) -> Option<u8> {
        self.object_of(v, kind)?;
        Some(self.header(v)?.flags)
    }

    /// Sets the flags of an object of this kind; `None` if `v` is not one.
    #[inline]
    pub fn set_flags(&mut self, v: Value, kind: Kind, flags: u8) -> Option<()> {
        let object = self.object_of(v, kind)?;
        // SAFETY: `object_of` has found a live object; H3: neither size nor contents depend on the flags.
        unsafe { (*object).flags = flags };
        Some(())
    }

    /// Sets `aux` of an object of this kind; `None` if `v` is not one, or is an array, whose rank it is.
    pub fn set_aux(&mut self, v: Value, kind: Kind, aux: u16) -> Option<()> {
        if kind == Kind::Array {
            return None;
        }
        let object = self.object_of(v, kind)?;
        // SAFETY: `object_of` has found a live object; H3: neither size nor contents depend on `aux`, but for
        // the rank of an array.
        unsafe { (*object).aux = aux };
        Some(())
    }

    /// Stores a value behind the write barrier: the only way in which a value overwrites another one in the
    /// heap.
    ///
    /// # Safety
    /// `slot` is a value slot of a live object of this heap.
    #[inline(always)]
    pub unsafe fn store(&mut self, slot: *mut Value, new: Value) {
        // SAFETY: by the contract, `slot` is initialised and ours to write.
        unsafe {
            self.log_if_marking(*slot);
            *slot = new;
        }
    }
}
