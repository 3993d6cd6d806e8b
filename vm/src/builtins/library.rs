//! What only the library needs, to build on other builtins.

use crate::raise::Outcome;
use crate::value::Value;
use crate::vm::Vm;

/// `(%make-ratio numerator denominator)`: the caller has divided both by what they had in common.
pub(super) fn make_ratio(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let &[numerator, denominator] = arguments else { unreachable!("the table says two") };
    vm.integer(numerator)?;
    let below = vm.integer(denominator)?;
    if below.is_negative() || below.is_zero() || denominator == Value::small(1) {
        return vm.specifier_error(denominator, "(INTEGER 2)");
    }
    Ok(vm.heap.alloc_ratio(numerator, denominator)?)
}
