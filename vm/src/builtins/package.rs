//! Packages.

use esl_bytecode::package::{PackageError, PackageId, Packages, Qualifier, Status};
use esl_bytecode::symbol::Symbol;
use std::collections::BTreeSet;

use crate::builtins::LIMIT;
use crate::builtins::expect::optional;
use crate::builtins::list::list_items;
use crate::builtins::symbol::{designated_text, text_of};
use crate::exchange::Exchange;
use crate::heap::{Heap, Kind};
use crate::names::Names;
use crate::raise::{Exit, Expected, Outcome, Raised};
use crate::value::Value;
use crate::vm::Vm;

use super::expect::exactly;

/// Returns the package that `v` designates: a package, or its name.
///
/// # Errors
/// A failure if there is none.
fn designated_package(vm: &mut Vm, v: Value) -> Result<PackageId, Exit> {
    if let Some(package) = vm.names.package_of(&vm.heap, v) {
        return Ok(package);
    }
    let name = designated_text(vm, v)?;
    match vm.names.packages().named(&name) {
        Some(package) => Ok(package),
        None => {
            let text = format!("the package {name} does not exist");
            vm.exchange.raise(Raised::Package(name, text))
        }
    }
}

/// Returns the current package.
///
/// # Errors
/// A failure if the value of `*package*` is not a package.
pub(super) fn current(vm: &mut Vm) -> Result<PackageId, Exit> {
    let variable = vm.names.known.package;
    match vm.symbol_value(variable) {
        Some(value) if vm.names.package_of(&vm.heap, value).is_none() => {
            vm.exchange.raise(Raised::Variable(variable, value, Expected::Type("PACKAGE")))
        }
        _ => Ok(vm.current_package()),
    }
}

/// Returns the package of an optional argument: the current one if it was left out.
fn package_or_current(vm: &mut Vm, v: Value) -> Result<PackageId, Exit> {
    if v.is_nil() { current(vm) } else { designated_package(vm, v) }
}

/// Returns the packages of a designator or a list of designators.
fn designated_packages(vm: &mut Vm, v: Value) -> Result<Vec<PackageId>, Exit> {
    let items = if v.is_list() { list_items(vm, v, LIMIT)? } else { vec![v] };
    items.into_iter().map(|item| designated_package(vm, item)).collect()
}

/// Returns the names of symbols in a designator or a list of designators: of symbols, strings or characters.
fn designated_names(vm: &mut Vm, v: Value) -> Result<Vec<String>, Exit> {
    let items = if v.is_list() { list_items(vm, v, LIMIT)? } else { vec![v] };
    items.into_iter().map(|item| designated_text(vm, item)).collect()
}

/// Returns the symbols of a symbol or a list of symbols, with a package.
fn named_symbols(vm: &mut Vm, v: Value) -> Result<Vec<Symbol>, Exit> {
    let items = if v.is_list() { list_items(vm, v, LIMIT)? } else { vec![v] };
    let mut symbols = Vec::with_capacity(items.len());
    for item in items {
        match vm.names.name_of(&vm.heap, item) {
            Some(symbol) => symbols.push(symbol),
            None if vm.names.is_symbol(&vm.heap, item) => {
                let name = vm.describe(item);
                return vm.exchange.program_error(format!("the symbol {name} does not belong to a package"));
            }
            None => return vm.exchange.type_error(item, "SYMBOL"),
        }
    }
    Ok(symbols)
}

fn checked<T>(exchange: &mut Exchange, result: Result<T, PackageError>) -> Result<T, Exit> {
    match result {
        Ok(value) => Ok(value),
        Err(error) => exchange.program_error(error.to_string()),
    }
}

fn package_list(vm: &mut Vm, packages: &[PackageId]) -> Outcome {
    let mut objects = Vec::with_capacity(packages.len());
    for &package in packages {
        objects.push(vm.names.package_object(&mut vm.heap, package)?);
    }
    Ok(vm.heap.list(&objects)?)
}

fn string_list(heap: &mut Heap, texts: &[String]) -> Outcome {
    let mut strings = Vec::with_capacity(texts.len());
    for text in texts {
        strings.push(heap.alloc_str(text)?);
    }
    Ok(heap.list(&strings)?)
}

fn status_symbol(names: &Names, status: Option<Status>) -> Value {
    match status {
        None => Value::NIL,
        Some(Status::Internal) => names.known.internal,
        Some(Status::External) => names.known.external,
        Some(Status::Inherited) => names.known.inherited,
    }
}

/// Returns the qualifier before the name of a symbol: nothing, `:`, `#:`, or a package with one or two
/// colons. `None` for anything but a symbol.
pub(crate) fn qualifier(vm: &Vm, symbol: Value) -> Option<Qualifier> {
    match vm.names.name_of(&vm.heap, symbol) {
        Some(name) => Some(vm.names.packages().qualifier(&name, vm.current_package())),
        None if vm.names.is_symbol(&vm.heap, symbol) => Some(Qualifier::Uninterned),
        None => None,
    }
}

pub(super) fn find_package(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    if vm.heap.is(arguments[0], Kind::Package) {
        return Ok(arguments[0]);
    }
    let name = designated_text(vm, arguments[0])?;
    match vm.names.packages().named(&name) {
        Some(package) => Ok(vm.names.package_object(&mut vm.heap, package)?),
        None => Ok(Value::NIL),
    }
}

pub(super) fn packagep(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    Ok(Value::boolean(vm.heap.is(arguments[0], Kind::Package)))
}

pub(super) fn package_name(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let package = designated_package(vm, arguments[0])?;
    let object = vm.names.package_object(&mut vm.heap, package)?;
    Ok(vm.heap.record(object, Kind::Package).map_or(Value::NIL, |record| record[0]))
}

pub(super) fn package_nicknames(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let package = designated_package(vm, arguments[0])?;
    let names: Vec<String> =
        vm.names.packages().nicknames(package).iter().map(|name| name.to_string()).collect();
    string_list(&mut vm.heap, &names)
}

pub(super) fn package_use_list(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let package = designated_package(vm, arguments[0])?;
    let uses = vm.names.packages().uses(package).to_vec();
    package_list(vm, &uses)
}

pub(super) fn list_all_packages(vm: &mut Vm, _arguments: &[Value]) -> Outcome {
    let all: Vec<PackageId> = vm.names.packages().all().collect();
    package_list(vm, &all)
}

pub(super) fn make_package(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.names.check_room(&mut vm.heap)?;
    let [name, nicknames, uses] = exactly(arguments);
    let name = designated_text(vm, name)?;
    let nicknames = designated_names(vm, nicknames)?;
    let uses = designated_packages(vm, uses)?;
    let nicknames: Vec<&str> = nicknames.iter().map(String::as_str).collect();
    let package = match vm.names.packages().named(&name) {
        // Reading a compiled program makes the packages of its symbols, without more.
        Some(package) => {
            let changed = vm.names.packages_mut().add_nicknames(package, &nicknames);
            checked(&mut vm.exchange, changed)?;
            package
        }
        None => {
            let made = vm.names.packages_mut().make_package(&name, &nicknames, &[]);
            checked(&mut vm.exchange, made)?
        }
    };
    for used in uses {
        let changed = vm.names.packages_mut().use_package(package, used);
        checked(&mut vm.exchange, changed)?;
    }
    Ok(vm.names.package_object(&mut vm.heap, package)?)
}

pub(super) fn forget_package(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let package = designated_package(vm, arguments[0])?;
    vm.names.packages_mut().forget(package);
    Ok(Value::T)
}

pub(super) fn use_package(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.names.check_room(&mut vm.heap)?;
    let uses = designated_packages(vm, arguments[0])?;
    let package = package_or_current(vm, optional(arguments, 1))?;
    for used in uses {
        let changed = vm.names.packages_mut().use_package(package, used);
        checked(&mut vm.exchange, changed)?;
    }
    Ok(Value::T)
}

pub(super) fn export(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    change_by_each(vm, arguments, named_symbols, Packages::export)
}

pub(super) fn import(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    change_by_each(vm, arguments, named_symbols, Packages::import)
}

pub(super) fn shadowing_import(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    change_by_each(vm, arguments, named_symbols, Packages::shadowing_import)
}

pub(super) fn shadow(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    change_by_each(vm, arguments, designated_names, |packages, package, name| packages.shadow(package, name))
}

/// Changes a package, the second argument, by each of the symbols or names that the first one designates.
fn change_by_each<T>(
    vm: &mut Vm,
    arguments: &[Value],
    designated: fn(&mut Vm, Value) -> Result<Vec<T>, Exit>,
    change: fn(&mut Packages, PackageId, &T) -> Result<(), PackageError>,
) -> Outcome {
    vm.names.check_room(&mut vm.heap)?;
    let items = designated(vm, arguments[0])?;
    let package = package_or_current(vm, optional(arguments, 1))?;
    vm.exchange.charge(items.len() * 16);
    for item in items {
        let changed = change(vm.names.packages_mut(), package, &item);
        checked(&mut vm.exchange, changed)?;
    }
    Ok(Value::T)
}

pub(super) fn intern(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(name) = text_of(&vm.heap, arguments[0]) else {
        return vm.exchange.type_error(arguments[0], "STRING");
    };
    let package = package_or_current(vm, optional(arguments, 1))?;
    vm.exchange.charge(name.len());
    let (symbol, status) = vm.names.packages_mut().intern(package, &name);
    let value = vm.names.intern(&mut vm.heap, &symbol)?;
    let status = status_symbol(&vm.names, status);
    vm.give_values(&[value, status])
}

pub(super) fn find_symbol(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(name) = text_of(&vm.heap, arguments[0]) else {
        return vm.exchange.type_error(arguments[0], "STRING");
    };
    let package = package_or_current(vm, optional(arguments, 1))?;
    vm.exchange.charge(name.len());
    match vm.names.packages().find(package, &name) {
        Some((symbol, status)) => {
            let value = vm.names.intern(&mut vm.heap, &symbol)?;
            let status = status_symbol(&vm.names, Some(status));
            vm.give_values(&[value, status])
        }
        None => vm.give_values(&[Value::NIL, Value::NIL]),
    }
}

pub(super) fn external_symbols(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let package = designated_package(vm, arguments[0])?;
    let names = vm.names.packages().external_names(package);
    let symbols = symbols_named(vm, package, &names);
    list_of_symbols(vm, &symbols)
}

pub(super) fn accessible_symbols(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let package = designated_package(vm, arguments[0])?;
    let names = vm.names.packages().accessible_names(package);
    let symbols = symbols_named(vm, package, &names);
    list_of_symbols(vm, &symbols)
}

/// Returns the symbols that `names` denote in `package`.
fn symbols_named(vm: &Vm, package: PackageId, names: &BTreeSet<&str>) -> Vec<Symbol> {
    let packages = vm.names.packages();
    names.iter().filter_map(|name| packages.find(package, name)).map(|(symbol, _)| symbol).collect()
}

/// Makes a list of symbols, and charges for it.
fn list_of_symbols(vm: &mut Vm, symbols: &[Symbol]) -> Outcome {
    vm.exchange.charge(symbols.len() * 16);
    let mut values = Vec::with_capacity(symbols.len());
    for symbol in symbols {
        values.push(vm.names.intern(&mut vm.heap, symbol)?);
    }
    Ok(vm.heap.list(&values)?)
}

pub(super) fn symbol_qualifier(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    current(vm)?;
    match qualifier(vm, arguments[0]) {
        None => vm.exchange.type_error(arguments[0], "SYMBOL"),
        Some(Qualifier::None) => Ok(Value::NIL),
        Some(qualifier) => Ok(vm.heap.alloc_str(&qualifier.to_string())?),
    }
}
