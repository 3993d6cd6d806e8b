//! Symbols: names, values, functions, properties.

use esl_bytecode::symbol::setf_cell;

use crate::builtins::expect::optional;
use crate::builtins::lookup;
use crate::environment;
use crate::equality::characters_of;
use crate::heap::Kind;
use crate::heap::layout::Symbol;
use crate::raise::{Exit, Outcome, Raised};
use crate::value::Value;
use crate::vm::Vm;

use super::expect::exactly;

impl Vm {
    /// A copy of the fixed part of a symbol's object.
    fn cell(&mut self, v: Value) -> Result<Symbol, Exit> {
        let object = self.symbol_object(v)?;
        match self.heap.symbol(object) {
            Some(cell) => Ok(*cell),
            None => self.exchange.type_error(v, "SYMBOL"),
        }
    }

    /// The text of a string, symbol or character: what names a symbol or package.
    ///
    /// # Errors
    /// `type-error` for anything else.
    pub(crate) fn designated_text(&mut self, v: Value) -> Result<String, Exit> {
        if let Some(text) = self.text_of(v) {
            return Ok(text);
        }
        if let Some(code) = v.as_character() {
            return Ok(char::from_u32(code).unwrap_or(char::REPLACEMENT_CHARACTER).into());
        }
        match self.world.object_of(&self.heap, v).and_then(|object| self.heap.symbol(object)) {
            Some(cell) => Ok(self.heap.string_text(cell.name).unwrap_or_default()),
            None => self.specifier_error(v, "(OR STRING SYMBOL CHARACTER)"),
        }
    }

    /// The text of a string, also of one with a fill pointer.
    pub(crate) fn text_of(&self, v: Value) -> Option<String> {
        let text = |&code: &u32| char::from_u32(code).unwrap_or(char::REPLACEMENT_CHARACTER);
        Some(characters_of(&self.heap, v)?.iter().map(text).collect())
    }

    /// The symbol that keeps the function called `name`: itself, or for `(setf symbol)` one beside that.
    ///
    /// # Errors
    /// `type-error` for what is no name of a function.
    pub(crate) fn function_cell(&mut self, name: Value) -> Result<Value, Exit> {
        if self.world.is_symbol(&self.heap, name) {
            return Ok(name);
        }
        match self.heap.as_cons(name) {
            Some(pair) if pair.car == self.world.known.setf => {
                let rest = self.heap.as_cons(pair.cdr);
                match rest.and_then(|rest| self.world.name_of(&self.heap, rest.car)) {
                    Some(symbol) => Ok(self.world.intern(&mut self.heap, &setf_cell(&symbol))?),
                    None => self.exchange.type_error(name, "SYMBOL"),
                }
            }
            _ => self.exchange.type_error(name, "SYMBOL"),
        }
    }
}

pub(super) fn symbol_name(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    Ok(vm.cell(arguments[0])?.name)
}

pub(super) fn symbol_package(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    Ok(vm.cell(arguments[0])?.package)
}

pub(super) fn symbol_plist(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    Ok(vm.cell(arguments[0])?.plist)
}

pub(super) fn set_symbol_plist(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [symbol, plist] = exactly(arguments);
    if !plist.is_list() {
        return vm.exchange.type_error(plist, "LIST");
    }
    let object = vm.symbol_object(symbol)?;
    vm.heap.symbol_set_plist(object, plist);
    Ok(plist)
}

pub(super) fn get(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let plist = vm.cell(arguments[0])?.plist;
    lookup::getf(vm, &[plist, arguments[1], optional(arguments, 2)])
}

pub(super) fn put(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [symbol, indicator, value] = exactly(arguments);
    let object = vm.symbol_object(symbol)?;
    let plist = vm.cell(symbol)?.plist;
    let plist = lookup::putf(vm, &[plist, indicator, value])?;
    vm.heap.symbol_set_plist(object, plist);
    Ok(value)
}

pub(super) fn remprop(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [symbol, indicator] = exactly(arguments);
    let object = vm.symbol_object(symbol)?;
    let plist = vm.cell(symbol)?.plist;
    let (plist, was_there) = lookup::without_property(vm, plist, indicator)?;
    vm.heap.symbol_set_plist(object, plist);
    Ok(Value::boolean(was_there))
}

pub(super) fn symbol_value(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let object = vm.symbol_object(arguments[0])?;
    match vm.symbol_value(object) {
        Some(value) => Ok(value),
        None => vm.exchange.raise(Raised::UnboundVariable(arguments[0])),
    }
}

pub(super) fn set(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [symbol, value] = exactly(arguments);
    let object = vm.symbol_object(symbol)?;
    vm.set_symbol_value(object, value)?;
    Ok(value)
}

pub(super) fn boundp(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let object = vm.symbol_object(arguments[0])?;
    Ok(Value::boolean(vm.symbol_value(object).is_some()))
}

pub(super) fn makunbound(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let object = vm.symbol_object(arguments[0])?;
    vm.set_symbol_value(object, Value::UNBOUND)?;
    Ok(arguments[0])
}

pub(super) fn fboundp(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let symbol = vm.function_cell(arguments[0])?;
    let is_bound = vm.world.function_of(&vm.heap, symbol).is_some()
        || vm.world.macro_function_of(&vm.heap, symbol).is_some();
    Ok(Value::boolean(is_bound))
}

pub(super) fn fdefinition(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let symbol = vm.function_cell(arguments[0])?;
    match vm.world.function_of(&vm.heap, symbol).or(vm.world.macro_function_of(&vm.heap, symbol)) {
        Some(function) => Ok(function),
        None => vm.exchange.raise(Raised::UndefinedFunction(arguments[0])),
    }
}

pub(super) fn fmakunbound(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let symbol = vm.function_cell(arguments[0])?;
    let object = vm.definable(symbol, "function")?;
    vm.world.remove_function(&mut vm.heap, symbol)?;
    vm.heap.symbol_set_macro_function(object, Value::NIL);
    Ok(arguments[0])
}

pub(super) fn function_cell(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.function_cell(arguments[0])
}

pub(super) fn macro_function(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let symbol = arguments[0];
    let object = vm.symbol_object(symbol)?;
    // The environment is a list of (name . expander), a local function's expander being NIL.
    for local in vm.list_items(optional(arguments, 1), crate::builtins::LIMIT)? {
        if let Some(pair) = vm.heap.as_cons(local)
            && pair.car == symbol
        {
            return Ok(pair.cdr);
        }
    }
    Ok(vm.world.macro_function_of(&vm.heap, object).unwrap_or(Value::NIL))
}

pub(super) fn special_p(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let flags = vm.cell(arguments[0])?.header.flags;
    Ok(Value::boolean(flags & Symbol::SPECIAL != 0))
}

pub(super) fn constant_p(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let flags = vm.cell(arguments[0])?.header.flags;
    Ok(Value::boolean(flags & Symbol::CONSTANT != 0))
}

pub(super) fn locked_p(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.symbol_object(arguments[0])?;
    Ok(Value::boolean(vm.world.is_locked(&vm.heap, arguments[0])))
}

pub(super) fn make_symbol(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(text) = vm.text_of(arguments[0]) else { return vm.exchange.type_error(arguments[0], "STRING") };
    vm.exchange.charge(text.len());
    let name = vm.heap.alloc_str(&text)?;
    Ok(vm.world.make_symbol(&mut vm.heap, name, Value::NIL, 0)?)
}

/// An integer in place of the prefix is the number to use.
pub(super) fn gensym(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let given = optional(arguments, 0);
    let counter = vm.world.known.gensym_counter;
    if given.as_index().is_some() {
        return named_symbol(vm, "G", given);
    }
    let prefix = match given {
        Value::NIL => "G".to_owned(),
        _ => match vm.text_of(given) {
            Some(text) => text,
            None => return vm.specifier_error(given, "(OR STRING UNSIGNED-BYTE)"),
        },
    };
    let number = match vm.symbol_value(counter) {
        None => Value::small(1),
        Some(value) if value.as_index().is_some() => value,
        Some(other) => return vm.exchange.type_error(other, "UNSIGNED-BYTE"),
    };
    let symbol = named_symbol(vm, &prefix, number)?;
    let next = number.as_fixnum().and_then(|n| Value::fixnum(n + 1)).unwrap_or(Value::small(0));
    vm.set_symbol_value(counter, next)?;
    Ok(symbol)
}

fn named_symbol(vm: &mut Vm, prefix: &str, number: Value) -> Outcome {
    let number = number.as_fixnum().unwrap_or(0);
    let name = vm.heap.alloc_str(&format!("{prefix}{number}"))?;
    Ok(vm.world.make_symbol(&mut vm.heap, name, Value::NIL, 0)?)
}

pub(super) fn function_name(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let code = vm.code_of_function(arguments[0])?;
    Ok(vm.heap.code(code).map_or(Value::NIL, |code| code.name))
}

pub(super) fn function_lambda_list(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    Ok(texts(vm, arguments[0])?.0)
}

pub(super) fn function_documentation(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    Ok(texts(vm, arguments[0])?.1)
}

/// The lambda list and the documentation of a function.
fn texts(vm: &mut Vm, function: Value) -> Result<(Value, Value), Exit> {
    let texts = vm.world.texts_of_function(&mut vm.heap, function);
    match vm.exchange.loaded(texts)? {
        Some(texts) => Ok(texts),
        None => vm.exchange.type_error(function, "FUNCTION"),
    }
}

pub(super) fn function_arity(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.code_of_function(arguments[0])?;
    match environment::arity(vm, arguments[0]) {
        Some(arity) => {
            let max = arity.max.map_or(Value::NIL, |max| Value::index(max as usize));
            vm.give_values(&[Value::index(arity.min as usize), max])
        }
        None => vm.give_values(&[Value::NIL, Value::NIL]),
    }
}

impl Vm {
    /// The code of a function, loaded if it was a stub.
    fn code_of_function(&mut self, v: Value) -> Result<Value, Exit> {
        if !self.heap.is(v, Kind::Function) {
            return self.exchange.type_error(v, "FUNCTION");
        }
        self.make_ready(v)?;
        Ok(self.heap.function_code(v).unwrap_or(Value::NIL))
    }
}
