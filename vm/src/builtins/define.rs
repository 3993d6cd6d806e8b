//! Definitions: what a symbol stands for as a function, macro, special variable or constant.

use crate::environment::property;
use crate::heap::Kind;
use crate::heap::layout::SymbolObject;
use crate::raise::{Exit, Outcome};
use crate::value::Value;
use crate::vm::Vm;

use super::expect::exactly;

pub(crate) fn set_function(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [name, function] = exactly(arguments);
    let symbol = definable(vm, name, "function")?;
    if !vm.heap.is(function, Kind::Function) {
        return vm.exchange.type_error(function, "FUNCTION");
    }
    vm.heap.symbol_set_function(symbol, function);
    vm.heap.symbol_set_macro_function(symbol, Value::NIL);
    let accessor = vm.names.known.accessor;
    if property(&vm.heap, symbol, accessor).is_some() {
        // It reads a slot no more; `%define-accessor` comes after the definition.
        super::symbol::remprop(vm, &[name, accessor])?;
    }
    Ok(name)
}

pub(crate) fn set_macro(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [name, function] = exactly(arguments);
    let symbol = definable(vm, name, "macro")?;
    if !vm.heap.is(function, Kind::Function) {
        return vm.exchange.type_error(function, "FUNCTION");
    }
    vm.names.remove_function(&mut vm.heap, name)?;
    vm.heap.symbol_set_macro_function(symbol, function);
    Ok(name)
}

pub(crate) fn proclaim_special(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let name = arguments[0];
    let symbol = symbol_object(vm, name)?;
    let flags = vm.heap.flags(symbol, Kind::Symbol).unwrap_or(0);
    if flags & SymbolObject::CONSTANT != 0 {
        let name = vm.describe(name);
        return vm.exchange.program_error(format!("{name} is a constant and cannot be made a variable"));
    }
    vm.heap.set_flags(symbol, Kind::Symbol, flags | SymbolObject::SPECIAL);
    Ok(name)
}

pub(crate) fn forget_variable(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let name = arguments[0];
    let symbol = definable(vm, name, "variable")?;
    let flags = vm.heap.flags(symbol, Kind::Symbol).unwrap_or(0);
    vm.heap.set_flags(symbol, Kind::Symbol, flags & !(SymbolObject::SPECIAL | SymbolObject::CONSTANT));
    Ok(name)
}

pub(crate) fn define_constant(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [name, value] = exactly(arguments);
    let symbol = symbol_object(vm, name)?;
    let flags = vm.heap.flags(symbol, Kind::Symbol).unwrap_or(0);
    let old = vm.heap.symbol(symbol).map_or(Value::UNBOUND, |symbol| symbol.value);
    if flags & SymbolObject::CONSTANT != 0 {
        if crate::number::eql(&vm.heap, old, value) {
            return Ok(name);
        }
        let (name, old) = (vm.describe(name), vm.describe(old));
        return vm.exchange.program_error(format!("{name} is a constant already, with the value {old}"));
    }
    if vm.names.is_locked(&vm.heap, name) || flags & SymbolObject::SPECIAL != 0 {
        let name = vm.describe(name);
        return vm.exchange.program_error(format!("{name} is a variable and cannot be made a constant"));
    }
    vm.heap.symbol_set_value(symbol, value);
    vm.heap.set_flags(symbol, Kind::Symbol, flags | SymbolObject::CONSTANT);
    Ok(name)
}

/// Returns the object of a symbol.
///
/// # Errors
/// `type-error` if `v` is not a symbol.
pub(crate) fn symbol_object(vm: &mut Vm, v: Value) -> Result<Value, Exit> {
    match vm.names.object_of(&vm.heap, v) {
        Some(object) => Ok(object),
        None => vm.exchange.type_error(v, "SYMBOL"),
    }
}

/// Returns the object of a symbol that may be given a definition as a `what`.
///
/// # Errors
/// `type-error` if `v` is not a symbol, `program-error` if it belongs to the language.
pub(crate) fn definable(vm: &mut Vm, v: Value, what: &str) -> Result<Value, Exit> {
    let object = symbol_object(vm, v)?;
    if vm.names.is_locked(&vm.heap, v) {
        let name = vm.describe(v);
        return vm
            .exchange
            .program_error(format!("{name} belongs to the language and cannot be redefined as a {what}"));
    }
    Ok(object)
}
