//! The arguments of builtins, counted.

use crate::value::Value;

/// Returns an optional argument; `NIL` if it was left out.
pub(crate) fn optional(arguments: &[Value], at: usize) -> Value {
    arguments.get(at).copied().unwrap_or(Value::NIL)
}

/// Returns the arguments of a builtin that takes exactly `N`, as its row of the table says.
#[inline(always)]
pub(super) fn exactly<const N: usize>(arguments: &[Value]) -> [Value; N] {
    arguments.try_into().unwrap_or_else(|_| unreachable!("the row of this builtin says {N} arguments"))
}
