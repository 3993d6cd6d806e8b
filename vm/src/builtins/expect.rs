//! The arguments of builtins, counted.

use crate::raise::Exit;
use crate::value::Value;
use crate::vm::Vm;

use super::COPY_LIMIT;

/// Returns an optional argument; `NIL` if it was left out.
pub(crate) fn optional(arguments: &[Value], at: usize) -> Value {
    arguments.get(at).copied().unwrap_or(Value::NIL)
}

/// Returns the arguments of a builtin that takes exactly `N`, as its row of the table says.
#[inline(always)]
pub(super) fn exactly<const N: usize>(arguments: &[Value]) -> [Value; N] {
    arguments.try_into().unwrap_or_else(|_| unreachable!("the row of this builtin says {N} arguments"))
}

/// Returns the part of a sequence of `length` elements from `start` to before `end`, as [`bounds`] does, and
/// charges for its elements.
///
/// # Errors
/// As [`bounds`]; [`Exit::Slowly`] if the part has more elements than one step copies.
///
/// [`bounds`]: crate::exchange::Exchange::bounds
#[inline]
pub(super) fn short_part(
    vm: &mut Vm,
    start: Value,
    end: Value,
    length: usize,
) -> Result<(usize, usize), Exit> {
    let (start, end) = vm.exchange.bounds(start, end, length)?;
    if end - start > COPY_LIMIT {
        return Err(Exit::Slowly);
    }
    vm.exchange.charge_elements(end - start);
    Ok((start, end))
}
