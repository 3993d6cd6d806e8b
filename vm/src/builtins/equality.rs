//! `eq`, `eql`, `equal`, `equalp` and `sxhash`, as far as they go without a call.

use crate::equality::{self, KeyTest};
use crate::number;
use crate::raise::{Exit, Outcome};
use crate::value::Value;
use crate::vm::Vm;

use super::expect::exactly;

use super::LIMIT;

fn compare(vm: &mut Vm, test: KeyTest, arguments: &[Value]) -> Outcome {
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

pub(super) fn eq(_vm: &mut Vm, arguments: &[Value]) -> Outcome {
    Ok(Value::boolean(arguments[0] == arguments[1]))
}

pub(super) fn eql(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [left, right] = exactly(arguments);
    Ok(Value::boolean(number::eql(&vm.heap, left, right)))
}

pub(super) fn equal(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    compare(vm, KeyTest::Equal, arguments)
}

pub(super) fn equalp(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    compare(vm, KeyTest::Equalp, arguments)
}

pub(super) fn sxhash(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let (hash, work) = equality::sxhash(&vm.heap, arguments[0]);
    vm.exchange.charge_elements(work);
    Ok(Value::index(hash as usize))
}
