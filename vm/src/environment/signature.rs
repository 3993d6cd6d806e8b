//! The parameters of functions and macros, for checks of calls.

use esl_bytecode::builtin::{BUILTINS, BuiltinInfo};
use esl_bytecode::compile::Signature;
use esl_bytecode::datum::Datum;
use esl_bytecode::module::ModuleFunction;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;

use super::object_for;
use crate::names::find_builtin;
use crate::names::load::{debug_texts, image_origin};
use crate::shape::{CodeKind, Shape};
use crate::value::Value;
use crate::vm::Vm;

/// Returns the parameters of the function or macro that `cell` keeps.
pub(super) fn signature(vm: &Vm, cell: &Symbol) -> Option<Signature> {
    let Some(object) = object_for(vm, cell) else {
        let definition = vm.names.images.definition(cell);
        let function = definition.and_then(|(image, definition)| {
            Some((image, definition.macro_function.or(definition.function)?))
        });
        return match function {
            Some((image, number)) => of_image(vm, image, number),
            None => Some(of_builtin(find_builtin(cell)?.info())),
        };
    };
    let macro_function = vm.names.macro_function_of(&vm.heap, object);
    of_function(vm, macro_function.or_else(|| vm.names.function_of(&vm.heap, object))?)
}

fn of_function(vm: &Vm, function: Value) -> Option<Signature> {
    if let Some((image, number)) = image_origin(&vm.heap, function) {
        return of_image(vm, image, number);
    }
    let code = vm.heap.code(vm.heap.function_code(function)?)?;
    let shape = Shape::unpack(code.spare[0]);
    match shape.kind {
        CodeKind::Native => BUILTINS.get(usize::from(shape.number)).map(of_builtin),
        CodeKind::Undefined | CodeKind::Lazy => None,
        CodeKind::Bytecode => {
            let (lambda_list, _) = debug_texts(&vm.heap, code.debug)?;
            let unit = &mut vm.compiler.unit.borrow_mut();
            let lambda_list = unit.datum_or_object(&vm.heap, &vm.names, lambda_list, Span::default());
            let keys = (shape.takes_keys && !shape.allow_other_keys).then(|| keys_in(&lambda_list));
            let positional = u32::from(shape.required) + u32::from(shape.optional);
            Some(Signature { lambda_list, positional, keys })
        }
    }
}

fn of_image(vm: &Vm, image: usize, number: u32) -> Option<Signature> {
    let ModuleFunction { parameters, lambda_list, .. } = vm.names.images.decode(image, number)?;
    let lambda_list = lambda_list.and_then(|index| vm.names.images.datum(image, index));
    let lambda_list = lambda_list.unwrap_or_else(|| Datum::nil(Span::default()));
    let keys = (parameters.keys.is_some() && !parameters.allow_other_keys).then(|| keys_in(&lambda_list));
    let positional = u32::from(parameters.required) + u32::from(parameters.optional);
    Some(Signature { lambda_list, positional, keys })
}

fn of_builtin(info: &BuiltinInfo) -> Signature {
    let words = info.lambda_list.split_whitespace();
    let words = words.map(|word| Datum::symbol(Symbol::esl(&word.to_uppercase()), Span::default()));
    let lambda_list = Datum::list(words.collect::<Vec<_>>(), Span::default());
    Signature { lambda_list, positional: info.arity.max.unwrap_or(info.arity.min), keys: None }
}

/// Returns the names that select keyword arguments in a lambda list.
fn keys_in(lambda_list: &Datum) -> Vec<Symbol> {
    let is_keyword = |item: &Datum, name: &str| item.as_symbol().is_some_and(|symbol| symbol.name() == name);
    let parameters = lambda_list.elements().skip_while(|item| !is_keyword(item, "&KEY")).skip(1);
    let parameters = parameters.take_while(|item| !is_keyword(item, "&AUX"));
    parameters.filter_map(key).collect()
}

/// Returns the name that selects the argument of `name`, `(name …)` or `((key name) …)`.
fn key(parameter: &Datum) -> Option<Symbol> {
    if let Some(symbol) = parameter.as_symbol() {
        return Some(Symbol::keyword(symbol.name()));
    }
    let (named, _) = parameter.as_cons()?;
    match named.as_symbol() {
        Some(symbol) => Some(Symbol::keyword(symbol.name())),
        None => named.as_cons()?.0.as_symbol().cloned(),
    }
}
