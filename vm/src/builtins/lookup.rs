//! Searching lists: `member`, `assoc`, property lists, with the tests that need no call.
//!
//! The functions with keyword arguments are written in ESL over these.

use crate::builtins::list::list_items;
use crate::equality::{self, KeyTest};
use crate::raise::{Exit, Outcome};
use crate::value::Value;
use crate::vm::Vm;

use super::LIMIT;
use super::expect::{exactly, optional};

/// Walks a list up to the first pair that `wanted` is true of; `NIL` if there is none.
fn find_pair(
    vm: &mut Vm,
    list: Value,
    mut wanted: impl FnMut(&mut Vm, Value) -> Result<bool, Exit>,
) -> Outcome {
    let mut rest = list;
    for visited in 0..LIMIT {
        let Some(pair) = vm.heap.as_cons(rest) else {
            vm.exchange.charge_elements(visited);
            return if rest.is_nil() { Ok(rest) } else { vm.exchange.type_error(rest, "LIST") };
        };
        if wanted(vm, pair.car)? {
            vm.exchange.charge_elements(visited);
            return Ok(rest);
        }
        rest = pair.cdr;
    }
    Err(Exit::Slowly)
}

/// Returns whether two objects are the same by `test`, within what is left of `work`.
fn same(vm: &Vm, test: KeyTest, a: Value, b: Value, work: &mut usize) -> Result<bool, Exit> {
    equality::same(&vm.heap, test, a, b, work).ok_or(Exit::Slowly)
}

fn member(vm: &mut Vm, test: KeyTest, arguments: &[Value]) -> Outcome {
    let item = arguments[0];
    let mut work = LIMIT;
    let found = find_pair(vm, arguments[1], |vm, candidate| same(vm, test, item, candidate, &mut work))?;
    vm.exchange.charge_elements(LIMIT - work);
    Ok(found)
}

/// Returns the first pair of an alist whose key, or value, is the same as `item`.
fn assoc(vm: &mut Vm, test: KeyTest, arguments: &[Value], by_value: bool) -> Outcome {
    let item = arguments[0];
    let mut work = LIMIT;
    let found = find_pair(vm, arguments[1], |vm, entry| match vm.heap.as_cons(entry) {
        Some(pair) => same(vm, test, item, if by_value { pair.cdr } else { pair.car }, &mut work),
        None if entry.is_nil() => Ok(false),
        None => vm.exchange.type_error(entry, "LIST"),
    })?;
    vm.exchange.charge_elements(LIMIT - work);
    Ok(vm.heap.car(found).unwrap_or(Value::NIL))
}

/// Defines the searches by test.
macro_rules! searches {
    ($( $test:ident: $member:ident $assoc:ident $rassoc:ident; )*) => {
        $(
            #[doc = concat!("`(%member-", stringify!($test), " item list)`")]
            pub(super) fn $member(vm: &mut Vm, arguments: &[Value]) -> Outcome {
                member(vm, KeyTest::$test, arguments)
            }

            #[doc = concat!("`(%assoc-", stringify!($test), " item alist)`")]
            pub(super) fn $assoc(vm: &mut Vm, arguments: &[Value]) -> Outcome {
                assoc(vm, KeyTest::$test, arguments, false)
            }

            #[doc = concat!("`(%rassoc-", stringify!($test), " item alist)`")]
            pub(super) fn $rassoc(vm: &mut Vm, arguments: &[Value]) -> Outcome {
                assoc(vm, KeyTest::$test, arguments, true)
            }
        )*
    };
}

searches! {
    Eq: member_eq assoc_eq rassoc_eq;
    Eql: member_eql assoc_eql rassoc_eql;
    Equal: member_equal assoc_equal rassoc_equal;
}

pub(super) fn adjoin_eql(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let found = member_eql(vm, arguments)?;
    if found.is_true() { Ok(arguments[1]) } else { Ok(vm.heap.cons(arguments[0], arguments[1])?) }
}

/// Returns the pair with an indicator in a property list and the pair with its value, `NIL` and `NIL` if it
/// is not there, and the pair in front of them.
fn find_property(vm: &mut Vm, plist: Value, indicator: Value) -> Result<Option<[Value; 3]>, Exit> {
    let (mut before, mut rest) = (Value::NIL, plist);
    for visited in 0..LIMIT {
        let Some(pair) = vm.heap.as_cons(rest) else {
            vm.exchange.charge_elements(visited);
            return if rest.is_nil() { Ok(None) } else { vm.exchange.type_error(rest, "LIST") };
        };
        let Some(value) = vm.heap.as_cons(pair.cdr) else { return vm.exchange.type_error(pair.cdr, "CONS") };
        if pair.car == indicator {
            vm.exchange.charge_elements(visited);
            return Ok(Some([before, rest, pair.cdr]));
        }
        (before, rest) = (pair.cdr, value.cdr);
    }
    Err(Exit::Slowly)
}

pub(super) fn getf(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    Ok(match find_property(vm, arguments[0], arguments[1])? {
        Some([_, _, value]) => vm.heap.car(value).unwrap_or(Value::NIL),
        None => optional(arguments, 2),
    })
}

pub(super) fn putf(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [plist, indicator, value] = exactly(arguments);
    match find_property(vm, plist, indicator)? {
        Some([_, _, pair]) => {
            vm.heap.set_car(pair, value);
            Ok(plist)
        }
        None => Ok(vm.heap.list_with_tail(&[indicator, value], plist)?),
    }
}

pub(super) fn remf(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [plist, indicator] = exactly(arguments);
    let (rest, was_there) = without_property(vm, plist, indicator)?;
    vm.give_values(&[rest, Value::boolean(was_there)])
}

/// Returns a property list without a property, and whether it had it.
pub(super) fn without_property(vm: &mut Vm, plist: Value, indicator: Value) -> Result<(Value, bool), Exit> {
    Ok(match find_property(vm, plist, indicator)? {
        Some([before, _, pair]) => {
            let rest = vm.heap.cdr(pair).unwrap_or(Value::NIL);
            if before.is_nil() {
                (rest, true)
            } else {
                vm.heap.set_cdr(before, rest);
                (plist, true)
            }
        }
        None => (plist, false),
    })
}

pub(super) fn get_properties(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [plist, indicators] = exactly(arguments);
    let indicators = list_items(vm, indicators, LIMIT)?;
    let mut rest = plist;
    let mut work = 0;
    while let Some(pair) = vm.heap.as_cons(rest) {
        work += 1 + indicators.len();
        if work > LIMIT {
            return Err(Exit::Slowly);
        }
        let Some(value) = vm.heap.as_cons(pair.cdr) else { return vm.exchange.type_error(pair.cdr, "CONS") };
        if indicators.contains(&pair.car) {
            return vm.give_values(&[pair.car, value.car, rest]);
        }
        rest = value.cdr;
    }
    if !rest.is_nil() {
        return vm.exchange.type_error(rest, "LIST");
    }
    vm.exchange.charge_elements(work);
    vm.give_values(&[Value::NIL; 3])
}
