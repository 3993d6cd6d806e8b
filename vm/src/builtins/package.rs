//! Packages.

use esl_bytecode::package::{PackageError, PackageId, Qualifier, Status};
use esl_bytecode::symbol::Symbol;

use crate::builtins::LIMIT;
use crate::builtins::expect::optional;
use crate::heap::Kind;
use crate::raise::{Exit, Outcome, Raised};
use crate::value::Value;
use crate::vm::Vm;

use super::expect::exactly;

impl Vm {
    /// The package that `v` designates: a package, or its name.
    ///
    /// # Errors
    /// A failure if there is none.
    fn package(&mut self, v: Value) -> Result<PackageId, Exit> {
        if let Some(package) = self.world.package_of(&self.heap, v) {
            return Ok(package);
        }
        let name = self.designated_text(v)?;
        match self.world.packages().named(&name) {
            Some(package) => Ok(package),
            None => {
                let text = format!("there is no package {name}");
                self.exchange.raise(Raised::Package(name, text))
            }
        }
    }

    /// The package of an optional argument: the current one if it was left out.
    fn package_or_current(&mut self, v: Value) -> Result<PackageId, Exit> {
        if v.is_nil() { Ok(self.current_package()) } else { self.package(v) }
    }

    /// The packages of a designator or a list of designators.
    fn packages(&mut self, v: Value) -> Result<Vec<PackageId>, Exit> {
        let items = if v.is_list() { self.list_items(v, LIMIT)? } else { vec![v] };
        items.into_iter().map(|item| self.package(item)).collect()
    }

    /// The names of symbols in a designator or a list of designators: of symbols, strings or characters.
    fn designated_names(&mut self, v: Value) -> Result<Vec<String>, Exit> {
        let items = if v.is_list() { self.list_items(v, LIMIT)? } else { vec![v] };
        items.into_iter().map(|item| self.designated_text(item)).collect()
    }

    /// The symbols of a symbol or a list of symbols, with a package.
    fn named_symbols(&mut self, v: Value) -> Result<Vec<Symbol>, Exit> {
        let items = if v.is_list() { self.list_items(v, LIMIT)? } else { vec![v] };
        let mut symbols = Vec::with_capacity(items.len());
        for item in items {
            match self.world.name_of(&self.heap, item) {
                Some(symbol) => symbols.push(symbol),
                None if self.world.is_symbol(&self.heap, item) => {
                    let name = self.describe(item);
                    return self.exchange.program_error(format!("the symbol {name} belongs to no package"));
                }
                None => return self.exchange.type_error(item, "SYMBOL"),
            }
        }
        Ok(symbols)
    }

    fn changed<T>(&mut self, result: Result<T, PackageError>) -> Result<T, Exit> {
        match result {
            Ok(value) => Ok(value),
            Err(error) => self.exchange.program_error(error.to_string()),
        }
    }

    fn package_list(&mut self, packages: &[PackageId]) -> Outcome {
        let mut objects = Vec::with_capacity(packages.len());
        for &package in packages {
            objects.push(self.world.package_object(&mut self.heap, package)?);
        }
        Ok(self.heap.list(&objects)?)
    }

    fn string_list(&mut self, texts: &[String]) -> Outcome {
        let mut strings = Vec::with_capacity(texts.len());
        for text in texts {
            strings.push(self.heap.alloc_str(text)?);
        }
        Ok(self.heap.list(&strings)?)
    }

    fn status(&self, status: Option<Status>) -> Value {
        match status {
            None => Value::NIL,
            Some(Status::Internal) => self.world.known.internal,
            Some(Status::External) => self.world.known.external,
            Some(Status::Inherited) => self.world.known.inherited,
        }
    }

    /// What is written before the name of a symbol: nothing, `:`, `#:`, or a package with one or two colons.
    /// `None` for what is no symbol.
    pub(crate) fn qualifier(&self, symbol: Value) -> Option<Qualifier> {
        match self.world.name_of(&self.heap, symbol) {
            Some(name) => Some(self.world.packages().qualifier(&name, self.current_package())),
            None if self.world.is_symbol(&self.heap, symbol) => Some(Qualifier::Uninterned),
            None => None,
        }
    }
}

pub(super) fn find_package(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    if vm.heap.is(arguments[0], Kind::Package) {
        return Ok(arguments[0]);
    }
    let name = vm.designated_text(arguments[0])?;
    match vm.world.packages().named(&name) {
        Some(package) => Ok(vm.world.package_object(&mut vm.heap, package)?),
        None => Ok(Value::NIL),
    }
}

pub(super) fn packagep(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    Ok(Value::boolean(vm.heap.is(arguments[0], Kind::Package)))
}

pub(super) fn package_name(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let package = vm.package(arguments[0])?;
    let object = vm.world.package_object(&mut vm.heap, package)?;
    Ok(vm.heap.record(object, Kind::Package).map_or(Value::NIL, |record| record[0]))
}

pub(super) fn package_nicknames(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let package = vm.package(arguments[0])?;
    let names: Vec<String> =
        vm.world.packages().nicknames(package).iter().map(|name| name.to_string()).collect();
    vm.string_list(&names)
}

pub(super) fn package_use_list(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let package = vm.package(arguments[0])?;
    let uses = vm.world.packages().uses(package).to_vec();
    vm.package_list(&uses)
}

pub(super) fn list_all_packages(vm: &mut Vm, _arguments: &[Value]) -> Outcome {
    let all: Vec<PackageId> = vm.world.packages().all().collect();
    vm.package_list(&all)
}

pub(super) fn make_package(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [name, nicknames, uses] = exactly(arguments);
    let name = vm.designated_text(name)?;
    let nicknames = vm.designated_names(nicknames)?;
    let uses = vm.packages(uses)?;
    let nicknames: Vec<&str> = nicknames.iter().map(String::as_str).collect();
    let package = match vm.world.packages().named(&name) {
        // Reading a compiled program makes the packages of its symbols, without more.
        Some(package) => {
            let changed = vm.world.packages_mut().add_nicknames(package, &nicknames);
            vm.changed(changed)?;
            package
        }
        None => {
            let made = vm.world.packages_mut().make_package(&name, &nicknames, &[]);
            vm.changed(made)?
        }
    };
    for used in uses {
        let changed = vm.world.packages_mut().use_package(package, used);
        vm.changed(changed)?;
    }
    Ok(vm.world.package_object(&mut vm.heap, package)?)
}

pub(super) fn use_package(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let uses = vm.packages(arguments[0])?;
    let package = vm.package_or_current(optional(arguments, 1))?;
    for used in uses {
        let changed = vm.world.packages_mut().use_package(package, used);
        vm.changed(changed)?;
    }
    Ok(Value::T)
}

pub(super) fn export(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let symbols = vm.named_symbols(arguments[0])?;
    let package = vm.package_or_current(optional(arguments, 1))?;
    vm.exchange.charge(symbols.len() * 16);
    for symbol in symbols {
        let changed = vm.world.packages_mut().export(package, &symbol);
        vm.changed(changed)?;
    }
    Ok(Value::T)
}

pub(super) fn import(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let symbols = vm.named_symbols(arguments[0])?;
    let package = vm.package_or_current(optional(arguments, 1))?;
    vm.exchange.charge(symbols.len() * 16);
    for symbol in symbols {
        let changed = vm.world.packages_mut().import(package, &symbol);
        vm.changed(changed)?;
    }
    Ok(Value::T)
}

pub(super) fn shadow(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let names = vm.designated_names(arguments[0])?;
    let package = vm.package_or_current(optional(arguments, 1))?;
    vm.exchange.charge(names.len() * 16);
    for name in names {
        let changed = vm.world.packages_mut().shadow(package, &name);
        vm.changed(changed)?;
    }
    Ok(Value::T)
}

pub(super) fn intern(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(name) = vm.text_of(arguments[0]) else { return vm.exchange.type_error(arguments[0], "STRING") };
    let package = vm.package_or_current(optional(arguments, 1))?;
    vm.exchange.charge(name.len());
    let (symbol, status) = vm.world.packages_mut().intern(package, &name);
    let value = vm.world.intern(&mut vm.heap, &symbol)?;
    let status = vm.status(status);
    vm.give_values(&[value, status])
}

pub(super) fn find_symbol(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(name) = vm.text_of(arguments[0]) else { return vm.exchange.type_error(arguments[0], "STRING") };
    let package = vm.package_or_current(optional(arguments, 1))?;
    vm.exchange.charge(name.len());
    match vm.world.packages().find(package, &name) {
        Some((symbol, status)) => {
            let value = vm.world.intern(&mut vm.heap, &symbol)?;
            let status = vm.status(Some(status));
            vm.give_values(&[value, status])
        }
        None => vm.give_values(&[Value::NIL, Value::NIL]),
    }
}

pub(super) fn external_symbols(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let package = vm.package(arguments[0])?;
    let packages = vm.world.packages();
    let names = packages.external_names(package);
    let symbols: Vec<Symbol> =
        names.iter().filter_map(|name| packages.find(package, name)).map(|(symbol, _)| symbol).collect();
    vm.exchange.charge(symbols.len() * 16);
    let mut values = Vec::with_capacity(symbols.len());
    for symbol in &symbols {
        values.push(vm.world.intern(&mut vm.heap, symbol)?);
    }
    Ok(vm.heap.list(&values)?)
}

pub(super) fn symbol_qualifier(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    match vm.qualifier(arguments[0]) {
        None => vm.exchange.type_error(arguments[0], "SYMBOL"),
        Some(Qualifier::None) => Ok(Value::NIL),
        Some(qualifier) => Ok(vm.heap.alloc_str(&qualifier.to_string())?),
    }
}
