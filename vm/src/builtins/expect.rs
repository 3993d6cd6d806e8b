//! Type errors whose expected type is more than a name, and bounds of sequences.

use crate::heap::AllocError;
use crate::raise::{Exit, Expected, Raised};
use crate::value::Value;
use crate::vm::Vm;

impl Vm {
    /// Notes that `datum` is not of the type that `specifier` writes: parentheses, names of `COMMON-LISP`,
    /// integers.
    #[cold]
    pub(crate) fn specifier_error<T>(&mut self, datum: Value, specifier: &str) -> Result<T, Exit> {
        let specifier = self.read_specifier(specifier)?;
        self.exchange.raise(Raised::Type(datum, Expected::Specifier(specifier)))
    }

    fn read_specifier(&mut self, text: &str) -> Result<Value, AllocError> {
        let spaced = text.replace('(', " ( ").replace(')', " ) ");
        let mut lists: Vec<Vec<Value>> = vec![Vec::new()];
        for word in spaced.split_whitespace() {
            let item = match word {
                "(" => {
                    lists.push(Vec::new());
                    continue;
                }
                ")" => {
                    let items = lists.pop().unwrap_or_default();
                    self.heap.list(&items)?
                }
                word => match word.parse().ok().and_then(Value::fixnum) {
                    Some(n) => n,
                    None => self.world.intern_cl(&mut self.heap, word)?,
                },
            };
            match lists.last_mut() {
                Some(list) => list.push(item),
                None => lists.push(vec![item]),
            }
        }
        Ok(lists.pop().and_then(|items| items.first().copied()).unwrap_or(Value::T))
    }

    /// Notes that `start` and `end` do not bound a part of a sequence of `length` elements.
    #[cold]
    pub(crate) fn bounds_error<T>(&mut self, start: Value, end: Value, length: usize) -> Result<T, Exit> {
        let least = start.as_index().unwrap_or(0);
        let datum = self.heap.cons(start, end)?;
        self.specifier_error(datum, &format!("(CONS (INTEGER 0 {length}) (INTEGER {least} {length}))"))
    }

    /// The part of a sequence of `length` elements from `start` to before `end`; `NIL` is the beginning or
    /// the end.
    pub(crate) fn bounds(&mut self, start: Value, end: Value, length: usize) -> Result<(usize, usize), Exit> {
        let from = if start.is_nil() { Some(0) } else { start.as_index() };
        let to = if end.is_nil() { Some(length) } else { end.as_index() };
        match (from, to) {
            (Some(from), Some(to)) if from <= to && to <= length => Ok((from, to)),
            _ => self.bounds_error(if start.is_nil() { Value::small(0) } else { start }, end, length),
        }
    }

    /// The index that `v` is, below `length`.
    pub(crate) fn index_below(&mut self, v: Value, length: usize) -> Result<usize, Exit> {
        match v.as_index() {
            Some(index) if index < length => Ok(index),
            _ => self.exchange.index_error(v, length),
        }
    }

    /// The count that `v` is.
    pub(crate) fn count(&mut self, v: Value) -> Result<usize, Exit> {
        match v.as_index() {
            Some(count) => Ok(count),
            None => self.exchange.type_error(v, "UNSIGNED-BYTE"),
        }
    }
}

/// An optional argument; `NIL` if it was left out.
pub(crate) fn optional(arguments: &[Value], at: usize) -> Value {
    arguments.get(at).copied().unwrap_or(Value::NIL)
}

/// The arguments of a builtin that takes exactly `N`, as its row of the table says.
#[inline(always)]
pub(super) fn exactly<const N: usize>(arguments: &[Value]) -> [Value; N] {
    arguments.try_into().unwrap_or_else(|_| unreachable!("the row of this builtin says {N} arguments"))
}
