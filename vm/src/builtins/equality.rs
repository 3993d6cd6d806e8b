//! `equal`, `equalp` and `sxhash`, as far as they go without a call.

use crate::equality::{self, Test};
use crate::raise::{Exit, Outcome};
use crate::value::Value;
use crate::vm::Vm;

use super::LIMIT;

fn compare(vm: &mut Vm, test: Test, arguments: &[Value]) -> Outcome {
    let mut work = LIMIT;
    let result = equality::same(&vm.heap, test, arguments[0], arguments[1], &mut work);
    match result {
        Some(result) => {
            vm.exchange.charge_elements(LIMIT - work);
            Ok(result.into())
        }
        None => Err(Exit::Slowly),
    }
}

/// `(equal left right)`
pub(super) fn equal(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    compare(vm, Test::Equal, arguments)
}

/// `(equalp left right)`
pub(super) fn equalp(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    compare(vm, Test::Equalp, arguments)
}

/// `(sxhash object)`
pub(super) fn sxhash(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    Ok(Value::index(equality::sxhash(&vm.heap, arguments[0]) as usize))
}
