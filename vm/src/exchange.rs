//! What passes between the interpreter and builtins beside arguments and results.
//!
//! A builtin gets the machine and its arguments and returns an [`Outcome`](crate::raise::Outcome). Whatever else it has to say
//! (the failure behind an [`Exit::Raise`], the values behind an [`Exit::Values`], the call behind an [`Exit::Call`], and what
//! its work has cost) waits here until the interpreter takes it.

use smallvec::SmallVec;

use crate::raise::{Exit, Expected, Raised};
use crate::saved_pc::SavedPc;
use crate::value::Value;

/// Charged by whoever wants the slice to end at the next tick; the task goes on with the next slice.
pub(crate) const END_OF_SLICE: u64 = 1 << 40;

/// Arguments of a call.
pub(crate) type Arguments = SmallVec<[Value; 16]>;

/// Side channel between the interpreter and builtins.
pub(crate) struct Exchange {
    /// The value list: all values of the form that was evaluated last, where they are wanted.
    pub(crate) values: Vec<Value>,
    /// Failure noted by a builtin, until the interpreter takes it.
    pub(crate) raised: Option<Raised>,
    /// Call requested by a builtin: the function, then its arguments.
    pub(crate) requested_call: Vec<Value>,
    /// Key found last in a hash table, and the number of its entry there.
    pub(crate) last_lookup: (Value, usize),
    /// Ticks charged by builtins beside those of their calls, until the interpreter takes them.
    pub(crate) charged: u64,
    /// Place and time of the last collection for want of room; a second one there would not help.
    pub(crate) collected_at: Option<(SavedPc, u64, i32)>,
}

impl Exchange {
    /// Creates an exchange with nothing in it.
    pub(crate) fn new() -> Exchange {
        Exchange {
            values: Vec::new(),
            raised: None,
            requested_call: Vec::new(),
            last_lookup: (Value::UNBOUND, 0),
            charged: 0,
            collected_at: None,
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

    /// Notes that `datum` is not an index below `limit`.
    ///
    /// # Errors
    /// Always [`Exit::Raise`].
    #[cold]
    pub(crate) fn index_error<T>(&mut self, datum: Value, limit: usize) -> Result<T, Exit> {
        self.raise(Raised::Type(datum, Expected::Index(limit)))
    }

    /// Notes a wrong call or form.
    ///
    /// # Errors
    /// Always [`Exit::Raise`].
    #[cold]
    pub(crate) fn program_error<T>(&mut self, text: impl Into<String>) -> Result<T, Exit> {
        self.raise(Raised::Program(text.into()))
    }

    /// Charges the running task units of work, 64 to a tick. A unit takes about as long as a step of arithmetic on limbs.
    #[inline]
    pub(crate) fn charge(&mut self, units: usize) {
        self.charged += units as u64 / 64;
    }

    /// Charges the running task for list cells, elements or characters that were walked over, compared, copied or filled:
    /// a tick for each 16. Each takes a few nanoseconds, as they come from memory.
    #[inline]
    pub(crate) fn charge_elements(&mut self, count: usize) {
        self.charged += count as u64 / 16;
    }

    /// Takes the ticks charged since the last instruction that saw to it.
    pub(crate) fn take_charged(&mut self) -> u64 {
        std::mem::take(&mut self.charged) % END_OF_SLICE
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
