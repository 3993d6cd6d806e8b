//! The arguments of a call: the list of an application spread, and arguments put in the order of the
//! parameters.

use super::constants_of;
use crate::describe;
use crate::heap::layout::CodeObject;
use crate::raise::Arguments;
use crate::raise::Exit;
use crate::shape::Shape;
use crate::value::Value;
use crate::vm::Vm;

/// The largest number of arguments that `apply` spreads: they are copied in one piece.
pub(crate) const MAX_SPREAD: usize = 1 << 20;

/// Replaces the last argument, a list, by its items.
pub(super) fn spread(vm: &mut Vm, arguments: &mut Arguments) -> Result<(), Exit> {
    let Some(mut rest) = arguments.pop() else { return Ok(()) };
    while let Some(pair) = vm.heap.as_cons(rest) {
        if arguments.len() == MAX_SPREAD {
            return vm.exchange.program_error(format!("more than {MAX_SPREAD} arguments"));
        }
        arguments.push(pair.car);
        rest = pair.cdr;
    }
    vm.exchange.charge(arguments.len());
    if rest.is_true() { vm.exchange.type_error(rest, "LIST") } else { Ok(()) }
}

/// Puts arguments in the order of the parameter registers into `arranged`, which is empty: missing ones
/// unsupplied, the rest as a list, keys by name.
///
/// # Safety
/// `code` is the Code of `function`, of the given shape, with bytecode.
pub(super) unsafe fn arrange(
    vm: &mut Vm,
    function: Value,
    code: *mut CodeObject,
    shape: Shape,
    arguments: &[Value],
    arranged: &mut Arguments,
) -> Result<(), Exit> {
    let required = usize::from(shape.required);
    let positional = required + usize::from(shape.optional);
    let count = arguments.len();
    let takes_more = shape.rest || shape.takes_keys;
    if count < required || (count > positional && !takes_more) {
        let name = describe::function_name(&vm.heap, function);
        let max = if takes_more { None } else { Some(positional as u32) };
        let given = count_of_arguments(count);
        return vm.exchange.program_error(format!(
            "{name} was called with {given}; it takes {}",
            describe_arity(required, max)
        ));
    }
    arranged.extend_from_slice(&arguments[..count.min(positional)]);
    arranged.resize(positional, Value::UNSUPPLIED);
    let rest = &arguments[count.min(positional)..];
    if shape.rest {
        vm.exchange.charge(rest.len());
        arranged.push(vm.heap.list(rest)?);
    }
    if shape.takes_keys {
        let keys = usize::from(shape.number);
        let first = arranged.len();
        arranged.resize(first + keys, Value::UNSUPPLIED);
        // SAFETY: by the contract the last constants of the code are the names of its keys (`shape`). They
        // stay where they are, since code does not move, and alive, since nothing collects before the call is
        // made.
        let names = unsafe {
            let names = constants_of(code).add((*code).nconsts as usize - keys);
            std::slice::from_raw_parts(names, keys)
        };
        take_keys(vm, function, shape, names, rest, &mut arranged[first..])?;
    }
    Ok(())
}

/// Sorts key arguments into the registers of their parameters; of a repeated key the first counts.
fn take_keys(
    vm: &mut Vm,
    function: Value,
    shape: Shape,
    names: &[Value],
    rest: &[Value],
    registers: &mut [Value],
) -> Result<(), Exit> {
    if !rest.len().is_multiple_of(2) {
        let name = describe::function_name(&vm.heap, function);
        return vm.exchange.program_error(format!("{name} was called with an odd number of key arguments"));
    }
    vm.exchange.charge(rest.len() * (1 + names.len() / 8));
    let allow_other_keys = vm.names.known.allow_other_keys;
    let mut unknown = None;
    let mut allows = None;
    for pair in rest.chunks_exact(2) {
        let (key, value) = (pair[0], pair[1]);
        if key == allow_other_keys && allows.is_none() {
            allows = Some(value.is_true());
        }
        match names.iter().position(|&name| name == key) {
            Some(index) if registers[index] == Value::UNSUPPLIED => registers[index] = value,
            Some(_) => {}
            None if key == allow_other_keys => {}
            None => unknown = unknown.or(Some(key)),
        }
    }
    match unknown {
        Some(key) if !shape.allow_other_keys && allows != Some(true) => {
            let name = describe::function_name(&vm.heap, function);
            let key = vm.describe(key);
            let known: Vec<String> = names.iter().map(|&name| vm.describe(name)).collect();
            vm.exchange.program_error(format!("{name} has no key {key}; its keys are {}", known.join(" ")))
        }
        _ => Ok(()),
    }
}

pub(super) fn count_of_arguments(count: usize) -> String {
    if count == 1 { "1 argument".into() } else { format!("{count} arguments") }
}

pub(super) fn describe_arity(min: usize, max: Option<u32>) -> String {
    match max {
        Some(max) if max as usize == min => min.to_string(),
        Some(max) => format!("{min} to {max}"),
        None => format!("at least {min}"),
    }
}
