//! Data that pass between the interpreter and builtins beside arguments and results.
//!
//! A builtin gets the machine and its arguments and returns an [`Outcome`](crate::raise::Outcome). Further
//! results (the failure behind an [`Exit::Raise`], the values behind an [`Exit::Values`], the call behind an
//! [`Exit::Call`], and the cost of its work) wait here until the interpreter takes them.

use crate::heap::Heap;
use crate::lookup::{Lookup, Lookups, STEPS_FOR_NOTHING};
use crate::names::load::LoadError;
use crate::overhead::CollectionOverhead;
use crate::raise::{Arguments, Exit, Expected, Raised};
use crate::saved_pc::SavedPc;
use crate::table::Table;
use crate::value::Value;

/// Elements, or steps of a search, that are charged as one tick.
const ELEMENTS: usize = 16;
const _: () = assert!(STEPS_FOR_NOTHING <= ELEMENTS);

/// Charges of builtins: ticks beside those of their calls, and whether the slice is to end.
///
/// One word, so that the interpreter finds out by one test after each builtin whether there is anything to
/// see to.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Charges(u64);

impl Charges {
    /// The bit that ends the slice; the others are ticks.
    const END: u64 = 1 << 63;

    /// Returns whether there is nothing to see to.
    #[inline(always)]
    pub(crate) fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Adds ticks.
    #[inline]
    pub(crate) fn add(&mut self, ticks: u64) {
        self.0 += ticks;
    }

    /// Has the slice of the running task end at the next tick, because what the slice may take has changed.
    /// The task goes on with another slice, unless its turn is to end otherwise.
    #[inline]
    pub(crate) fn end_slice(&mut self) {
        self.0 |= Charges::END;
    }

    /// Returns the ticks.
    pub(crate) fn ticks(self) -> u64 {
        self.0 & !Charges::END
    }

    /// Returns whether the slice is to end.
    pub(crate) fn ends_slice(self) -> bool {
        self.0 & Charges::END != 0
    }

    /// Takes everything.
    pub(crate) fn take(&mut self) -> Charges {
        std::mem::take(self)
    }
}

/// Side channel between the interpreter and builtins.
pub(crate) struct Exchange {
    /// The value list: all values of the form that was evaluated last, where they are wanted.
    pub(crate) values: Vec<Value>,
    /// Failure noted by a builtin, until the interpreter takes it.
    pub(crate) raised: Option<Raised>,
    /// Call requested by a builtin: the function, then its arguments.
    pub(crate) requested_call: Vec<Value>,
    /// The latest results of searches in hash tables.
    pub(crate) lookups: Lookups,
    /// Charges of builtins, until the interpreter takes them.
    pub(crate) charges: Charges,
    /// Place and time of the last collection for want of room; a second one there would not help.
    pub(crate) collected_at: Option<(SavedPc, u64)>,
    /// The overhead of collections for want of room.
    pub(crate) overhead: CollectionOverhead,
    /// The class whose instances the next full collection finds.
    pub(crate) sought: Option<Value>,
    /// A class and its instances, found by a full collection, until the call that has sought them is made
    /// again.
    pub(crate) found: Option<(Value, Vec<Value>)>,
}

impl Exchange {
    /// Creates an exchange with nothing in it.
    pub(crate) fn new() -> Exchange {
        Exchange {
            values: Vec::new(),
            raised: None,
            requested_call: Vec::new(),
            lookups: Lookups::default(),
            charges: Charges::default(),
            collected_at: None,
            overhead: CollectionOverhead::default(),
            sought: None,
            found: None,
        }
    }

    /// Notes a failure; the result is for the builtin to return.
    ///
    /// # Errors
    /// Always [`Exit::Raise`].
    #[cold]
    pub(crate) fn raise<T>(&mut self, raised: Raised) -> Result<T, Exit> {
        self.raised = Some(raised);
        Err(Exit::Raise)
    }

    /// Notes that `datum` is not of the type with this name in `COMMON-LISP`.
    ///
    /// # Errors
    /// Always [`Exit::Raise`].
    #[cold]
    pub(crate) fn type_error<T>(&mut self, datum: Value, expected: &'static str) -> Result<T, Exit> {
        self.raise(Raised::Type(datum, Expected::Type(expected)))
    }

    /// Notes that `datum` is not of the type that `specifier`, a value, names.
    ///
    /// # Errors
    /// Always [`Exit::Raise`].
    #[cold]
    pub(crate) fn not_a<T>(&mut self, datum: Value, specifier: Value) -> Result<T, Exit> {
        self.raise(Raised::Type(datum, Expected::Specifier(specifier)))
    }

    /// Notes that `datum` is not an index below `limit`.
    ///
    /// # Errors
    /// Always [`Exit::Raise`].
    #[cold]
    pub(crate) fn index_error<T>(&mut self, datum: Value, limit: usize) -> Result<T, Exit> {
        self.raise(Raised::Type(datum, Expected::Index(limit)))
    }

    /// Notes that `datum` is not of the type that `specifier` writes, as [`Expected::Written`].
    ///
    /// # Errors
    /// Always [`Exit::Raise`].
    #[cold]
    pub(crate) fn not_written<T>(&mut self, datum: Value, specifier: &'static str) -> Result<T, Exit> {
        self.raise(Raised::Type(datum, Expected::Written(specifier)))
    }

    /// Notes that `start` and `end` do not bound a part of a sequence of `length` elements.
    ///
    /// # Errors
    /// Always [`Exit::Raise`].
    #[cold]
    pub(crate) fn bounds_error<T>(&mut self, start: Value, end: Value, length: usize) -> Result<T, Exit> {
        self.raise(Raised::Bounds(start, end, length))
    }

    /// Returns the part of a sequence of `length` elements from `start` to before `end`. `NIL` stands for the
    /// beginning or the end.
    ///
    /// # Errors
    /// As [`Exchange::bounds_error`].
    pub(crate) fn bounds(&mut self, start: Value, end: Value, length: usize) -> Result<(usize, usize), Exit> {
        let from = if start.is_nil() { Some(0) } else { start.as_index() };
        let to = if end.is_nil() { Some(length) } else { end.as_index() };
        match (from, to) {
            (Some(from), Some(to)) if from <= to && to <= length => Ok((from, to)),
            _ => self.bounds_error(if start.is_nil() { Value::small(0) } else { start }, end, length),
        }
    }

    /// Returns `v` as an index below `length`.
    ///
    /// # Errors
    /// As [`Exchange::index_error`].
    pub(crate) fn index_below(&mut self, v: Value, length: usize) -> Result<usize, Exit> {
        match v.as_index() {
            Some(index) if index < length => Ok(index),
            _ => self.index_error(v, length),
        }
    }

    /// Returns `v` as a number of things.
    ///
    /// # Errors
    /// As [`Exchange::type_error`].
    pub(crate) fn count(&mut self, v: Value) -> Result<usize, Exit> {
        match v.as_index() {
            Some(count) => Ok(count),
            None => self.type_error(v, "UNSIGNED-BYTE"),
        }
    }

    /// Notes a wrong call or form.
    ///
    /// # Errors
    /// Always [`Exit::Raise`].
    #[cold]
    pub(crate) fn program_error<T>(&mut self, text: impl Into<String>) -> Result<T, Exit> {
        self.raise(Raised::Program(text.into()))
    }

    /// Passes on what became of a load: for want of room, the builtin is done again after a collection.
    ///
    /// # Errors
    /// [`Exit::Collect`] without room; [`Exit::Raise`] if the module was refused.
    pub(crate) fn loaded<T>(&mut self, result: Result<T, LoadError>) -> Result<T, Exit> {
        result.map_err(|error| match error {
            LoadError::Alloc(error) => error.into(),
            error => {
                self.raised = Some(error.into());
                Exit::Raise
            }
        })
    }

    /// Charges the running task units of work, 64 to a tick. A unit takes about as long as a step of
    /// arithmetic on limbs.
    #[inline]
    pub(crate) fn charge(&mut self, units: usize) {
        self.charges.add(units as u64 / 64);
    }

    /// Charges the running task for list cells, elements or characters that were walked over, compared,
    /// copied or filled: a tick for each 16. Each takes a few nanoseconds, as they come from memory.
    #[inline]
    pub(crate) fn charge_elements(&mut self, count: usize) {
        self.charges.add(count as u64 / ELEMENTS as u64);
    }

    /// Notes a search in a hash table, and charges for it.
    #[inline(always)]
    pub(crate) fn note_lookup(&mut self, heap: &Heap, table: Table, key: Value, found: &Lookup) {
        if found.steps != 0 {
            self.charge_elements(found.steps);
        }
        self.lookups.note(heap, table, key, found);
    }

    /// Requests a call in the place of the builtin, which returns [`Exit::Call`].
    pub(crate) fn request_call(&mut self, function: Value, arguments: &[Value]) {
        self.requested_call.clear();
        self.requested_call.push(function);
        self.requested_call.extend_from_slice(arguments);
    }

    /// Takes the function and the arguments of the requested call.
    pub(crate) fn take_requested_call(&mut self) -> (Value, Arguments) {
        let mut call = self.requested_call.drain(..);
        let function = call.next().unwrap_or(Value::NIL);
        (function, call.collect())
    }
}
