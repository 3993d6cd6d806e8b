//! Symbols: names, values, functions, properties.

use esl_bytecode::symbol::setf_cell;

use crate::builtins::define::{definable, symbol_object};
use crate::builtins::expect::optional;
use crate::builtins::list::list_items;
use crate::builtins::lookup;
use crate::environment;
use crate::equality::characters_of;
use crate::heap::layout::SymbolObject;
use crate::heap::{Heap, Kind};
use crate::raise::{Exit, Expected, Outcome, Raised};
use crate::value::Value;
use crate::vm::Vm;

use super::expect::exactly;

/// Returns a copy of the fixed part of a symbol's object.
fn cell(vm: &mut Vm, v: Value) -> Result<SymbolObject, Exit> {
    let object = symbol_object(vm, v)?;
    match vm.heap.symbol(object) {
        Some(cell) => Ok(*cell),
        None => vm.exchange.type_error(v, "SYMBOL"),
    }
}

/// Returns the text of a string, symbol or character: what names a symbol or package.
///
/// # Errors
/// `type-error` for anything else.
pub(crate) fn designated_text(vm: &mut Vm, v: Value) -> Result<String, Exit> {
    if let Some(text) = text_of(&vm.heap, v) {
        vm.exchange.charge(text.len());
        return Ok(text);
    }
    if let Some(code) = v.as_character() {
        return Ok(char::from_u32(code).unwrap_or(char::REPLACEMENT_CHARACTER).into());
    }
    match vm.names.object_of(&vm.heap, v).and_then(|object| vm.heap.symbol(object)) {
        Some(cell) => Ok(vm.heap.string_text(cell.name).unwrap_or_default()),
        None => vm.exchange.not_written(v, "(OR STRING SYMBOL CHARACTER)"),
    }
}

/// Returns the text of a string, also of one with a fill pointer.
pub(crate) fn text_of(heap: &Heap, v: Value) -> Option<String> {
    let text = |&code: &u32| char::from_u32(code).unwrap_or(char::REPLACEMENT_CHARACTER);
    Some(characters_of(heap, v)?.iter().map(text).collect())
}

/// Returns the characters of a string from `start` to before `end`; none if it is shorter.
pub(crate) fn text_between(heap: &Heap, v: Value, start: usize, end: usize) -> String {
    let part = characters_of(heap, v).and_then(|all| all.get(start..end)).unwrap_or_default();
    part.iter().map(|&code| char::from_u32(code).unwrap_or(char::REPLACEMENT_CHARACTER)).collect()
}

/// Returns the symbol that keeps the function called `name`: itself, or for `(setf symbol)` one beside that.
///
/// # Errors
/// `type-error` if it is not the name of a function.
pub(crate) fn cell_of_function(vm: &mut Vm, name: Value) -> Result<Value, Exit> {
    if vm.names.is_symbol(&vm.heap, name) {
        return Ok(name);
    }
    match vm.heap.as_cons(name) {
        Some(pair) if pair.car == vm.names.known.setf => {
            let symbol = match vm.heap.as_cons(pair.cdr) {
                Some(rest) if rest.cdr == Value::NIL => rest.car,
                _ => {
                    return vm.exchange.not_written(name, "(OR SYMBOL (CONS (EQL SETF) (CONS SYMBOL NULL)))");
                }
            };
            if let Some(symbol) = vm.names.name_of(&vm.heap, symbol) {
                return Ok(vm.names.intern(&mut vm.heap, &setf_cell(&symbol))?);
            }
            let object = symbol_object(vm, symbol)?;
            Ok(vm.names.setf_cell_object(&mut vm.heap, object)?)
        }
        _ => vm.exchange.not_written(name, "(OR SYMBOL (CONS (EQL SETF) (CONS SYMBOL NULL)))"),
    }
}

pub(super) fn symbol_name(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    Ok(cell(vm, arguments[0])?.name)
}

pub(super) fn symbol_package(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    Ok(cell(vm, arguments[0])?.package)
}

pub(super) fn symbol_plist(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    Ok(cell(vm, arguments[0])?.plist)
}

pub(super) fn set_symbol_plist(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [symbol, plist] = exactly(arguments);
    if !plist.is_list() {
        return vm.exchange.type_error(plist, "LIST");
    }
    let object = symbol_object(vm, symbol)?;
    vm.heap.symbol_set_plist(object, plist);
    Ok(plist)
}

pub(super) fn get(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let plist = cell(vm, arguments[0])?.plist;
    lookup::getf(vm, &[plist, arguments[1], optional(arguments, 2)])
}

pub(super) fn put(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [symbol, indicator, value] = exactly(arguments);
    let object = symbol_object(vm, symbol)?;
    let plist = cell(vm, symbol)?.plist;
    let plist = lookup::putf(vm, &[plist, indicator, value])?;
    vm.heap.symbol_set_plist(object, plist);
    Ok(value)
}

pub(super) fn remprop(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [symbol, indicator] = exactly(arguments);
    let object = symbol_object(vm, symbol)?;
    let plist = cell(vm, symbol)?.plist;
    let (plist, was_there) = lookup::without_property(vm, plist, indicator)?;
    vm.heap.symbol_set_plist(object, plist);
    Ok(Value::boolean(was_there))
}

pub(super) fn symbol_value(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let object = symbol_object(vm, arguments[0])?;
    vm.scheduler.points.note_shown();
    match vm.symbol_value(object) {
        Some(value) => {
            if vm.scheduler.points.uses.is_some() {
                vm.tell_use(object, value, false);
            }
            Ok(value)
        }
        None => vm.exchange.raise(Raised::UnboundVariable(arguments[0])),
    }
}

pub(super) fn set(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [symbol, value] = exactly(arguments);
    let object = symbol_object(vm, symbol)?;
    vm.set_symbol_value(object, value)?;
    Ok(value)
}

pub(super) fn boundp(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let object = symbol_object(vm, arguments[0])?;
    vm.scheduler.points.note_shown();
    Ok(Value::boolean(vm.symbol_value(object).is_some()))
}

pub(super) fn makunbound(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let object = symbol_object(vm, arguments[0])?;
    if vm.names.is_locked(&vm.heap, arguments[0]) {
        let name = vm.describe(arguments[0]);
        return vm.exchange.program_error(format!("{name} belongs to the language and keeps a value"));
    }
    vm.set_symbol_value(object, Value::UNBOUND)?;
    Ok(arguments[0])
}

pub(super) fn fboundp(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let symbol = cell_of_function(vm, arguments[0])?;
    let is_bound = vm.names.function_of(&vm.heap, symbol).is_some()
        || vm.names.macro_function_of(&vm.heap, symbol).is_some();
    Ok(Value::boolean(is_bound))
}

pub(super) fn fdefinition(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let symbol = cell_of_function(vm, arguments[0])?;
    match vm.names.function_of(&vm.heap, symbol).or(vm.names.macro_function_of(&vm.heap, symbol)) {
        Some(function) => Ok(function),
        None => vm.exchange.raise(Raised::UndefinedFunction(arguments[0])),
    }
}

pub(super) fn fmakunbound(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let symbol = cell_of_function(vm, arguments[0])?;
    let object = definable(vm, symbol, "function")?;
    vm.names.remove_function(&mut vm.heap, symbol)?;
    vm.heap.symbol_set_macro_function(object, Value::NIL);
    Ok(arguments[0])
}

pub(super) fn function_cell(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    cell_of_function(vm, arguments[0])
}

pub(super) fn macro_function(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let symbol = arguments[0];
    let object = symbol_object(vm, symbol)?;
    // The environment is a list of (name . expander), a local function's expander being NIL.
    for local in list_items(vm, optional(arguments, 1), crate::builtins::LIMIT)? {
        if let Some(pair) = vm.heap.as_cons(local)
            && pair.car == symbol
        {
            return Ok(pair.cdr);
        }
    }
    Ok(vm.names.macro_function_of(&vm.heap, object).unwrap_or(Value::NIL))
}

pub(super) fn special_p(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let flags = cell(vm, arguments[0])?.header.flags;
    Ok(Value::boolean(flags & SymbolObject::SPECIAL != 0))
}

pub(super) fn constant_p(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let flags = cell(vm, arguments[0])?.header.flags;
    Ok(Value::boolean(flags & SymbolObject::CONSTANT != 0))
}

pub(super) fn locked_p(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    symbol_object(vm, arguments[0])?;
    Ok(Value::boolean(vm.names.is_locked(&vm.heap, arguments[0])))
}

pub(super) fn make_symbol(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(text) = text_of(&vm.heap, arguments[0]) else {
        return vm.exchange.type_error(arguments[0], "STRING");
    };
    vm.exchange.charge(text.len());
    let name = vm.heap.alloc_str(&text)?;
    Ok(vm.names.make_symbol(&mut vm.heap, name, Value::NIL, 0)?)
}

/// An integer in place of the prefix is the number to use.
pub(super) fn gensym(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let given = optional(arguments, 0);
    let counter = vm.names.known.gensym_counter;
    if given.as_index().is_some() {
        return named_symbol(vm, "G", given);
    }
    let prefix = match given {
        Value::NIL => "G".to_owned(),
        _ => match text_of(&vm.heap, given) {
            Some(text) => text,
            None => return vm.exchange.not_written(given, "(OR STRING UNSIGNED-BYTE)"),
        },
    };
    vm.scheduler.points.note_shown();
    let number = match vm.symbol_value(counter) {
        None => Value::small(1),
        Some(value) if value.as_index().is_some() => value,
        Some(other) => {
            let expected = Expected::Type("UNSIGNED-BYTE");
            return vm.exchange.raise(Raised::Variable(counter, other, expected));
        }
    };
    let symbol = named_symbol(vm, &prefix, number)?;
    let next = number.as_fixnum().and_then(|n| Value::fixnum(n + 1)).unwrap_or(Value::small(0));
    vm.set_symbol_value(counter, next)?;
    Ok(symbol)
}

fn named_symbol(vm: &mut Vm, prefix: &str, number: Value) -> Outcome {
    let number = number.as_fixnum().unwrap_or(0);
    vm.exchange.charge(2 * prefix.len());
    let name = vm.heap.alloc_str(&format!("{prefix}{number}"))?;
    Ok(vm.names.make_symbol(&mut vm.heap, name, Value::NIL, 0)?)
}

pub(super) fn function_name(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let code = code_of_function(vm, arguments[0])?;
    Ok(vm.heap.code(code).map_or(Value::NIL, |code| code.name))
}

pub(super) fn function_lambda_list(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    Ok(texts(vm, arguments[0])?.0)
}

pub(super) fn function_documentation(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    Ok(texts(vm, arguments[0])?.1)
}

/// Words of a function among which one is looked for that has a place.
const WORDS_TO_PLACE: u32 = 64;

pub(super) fn function_place(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(code) = vm.heap.function_code(arguments[0]) else {
        return vm.exchange.type_error(arguments[0], "FUNCTION");
    };
    // Instructions before the first call may have no place.
    let place = (0..WORDS_TO_PLACE).find_map(|pc| vm.names.source_place(&vm.heap, code, pc));
    let Some(place) = place else { return Ok(Value::NIL) };
    let source = vm.heap.alloc_str(&place.source)?;
    Ok(vm.heap.list(&[source, Value::index(place.line as usize), Value::index(place.column as usize)])?)
}

/// Returns the lambda list and the documentation of a function.
fn texts(vm: &mut Vm, function: Value) -> Result<(Value, Value), Exit> {
    let texts = vm.names.texts_of_function(&mut vm.heap, function);
    match vm.exchange.loaded(texts)? {
        Some(texts) => Ok(texts),
        None => vm.exchange.type_error(function, "FUNCTION"),
    }
}

pub(super) fn function_arity(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    code_of_function(vm, arguments[0])?;
    match environment::arity(vm, arguments[0]) {
        Some(arity) => {
            let max = arity.max.map_or(Value::NIL, |max| Value::index(max as usize));
            vm.give_values(&[Value::index(arity.min as usize), max])
        }
        None => vm.give_values(&[Value::NIL, Value::NIL]),
    }
}

/// Returns the code of a function, loaded if it was a stub.
fn code_of_function(vm: &mut Vm, v: Value) -> Result<Value, Exit> {
    if !vm.heap.is(v, Kind::Function) {
        return vm.exchange.type_error(v, "FUNCTION");
    }
    vm.make_ready(v)?;
    Ok(vm.heap.function_code(v).unwrap_or(Value::NIL))
}
