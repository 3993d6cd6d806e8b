//! Rights: asking for them, and narrowing them.
//!
//! Narrowed rights are a binding of a symbol that no program can name ([`Names::rights`]), so that
//! nothing can set it back, and tasks inherit it as they do all bindings. Its value is a list of strings, the
//! innermost form's first, each of which writes [`Rights`] as a text that is made here and reaches no
//! program. Rights that flags of a command have set say so, since another flag would widen them.
//!
//! [`Names::rights`]: crate::names::Names

use esl_host::{Host, Permit, Right, Rights};

use crate::builtins::LIMIT;
use crate::builtins::expect::{exactly, optional};
use crate::builtins::list::list_items;
use crate::builtins::symbol::{designated_text, text_of};
use crate::heap::Kind;
use crate::heap::layout::SymbolObject;
use crate::raise::{Exit, Outcome, Raised};
use crate::task::{Binding, EntryKind};
use crate::value::Value;
use crate::vm::Vm;

/// Ends each part of a text that writes rights.
const END: char = '\0';
/// Begins a text of rights that a flag would widen. It is the name of no right.
const BY_FLAG: &str = "by-flag\0\0";

/// Makes sure that the program has a right to an object. Returns what to use in its place: for a path, the
/// one to which its links lead. This is the only place at which rights are asked for.
///
/// # Errors
/// A failure `:PERMISSION-DENIED` if it does not have it.
pub(crate) fn demand(vm: &mut Vm, right: Right, object: &str) -> Result<String, Exit> {
    let (narrowed, by_forms) = narrowed(vm);
    match vm.outside.host.permit(right, object, &narrowed) {
        Permit::Granted(whole) => Ok(whole),
        Permit::NotGranted => {
            vm.exchange.raise(Raised::Denied(right, object.into(), Some(right.flag(object))))
        }
        Permit::Narrowed => {
            let would_do = by_forms.len() < narrowed.len()
                && matches!(vm.outside.host.permit(right, object, &by_forms), Permit::Granted(_));
            let flag = would_do.then(|| right.flag(object));
            vm.exchange.raise(Raised::Denied(right, object.into(), flag))
        }
    }
}

/// Returns the rights to which those are narrowed at the present point, innermost first; and of these the
/// ones that no flag would widen.
fn narrowed(vm: &mut Vm) -> (Vec<Rights>, Vec<Rights>) {
    let (mut found, mut by_forms) = (Vec::new(), Vec::new());
    let mut list = in_force(vm);
    while let Some(pair) = vm.heap.as_cons(list) {
        let text = vm.heap.string_text(pair.car).unwrap_or_default();
        vm.exchange.charge_elements(text.len());
        let rights = decode(text.strip_prefix(BY_FLAG).unwrap_or(&text));
        if !text.starts_with(BY_FLAG) {
            by_forms.push(rights.clone());
        }
        found.push(rights);
        list = pair.cdr;
    }
    (found, by_forms)
}

/// Returns the list of what is narrowed in the running task.
pub(super) fn in_force(vm: &Vm) -> Value {
    let control = vm.scheduler.running.as_ref().and_then(|task| task.control.get());
    control.and_then(|control| control.bindings.get(vm.names.rights)).unwrap_or(Value::NIL)
}

fn decode(text: &str) -> Rights {
    let mut rights = Rights::none();
    let mut parts = text.split(END);
    while let (Some(name), Some(object)) = (parts.next(), parts.next()) {
        let Some(right) = Right::of_name(name) else { continue };
        rights = if object.is_empty() { rights.with_all(right) } else { rights.with(right, object) };
    }
    rights
}

/// Returns the right of which `v` is the name, a keyword.
fn expect_right(vm: &mut Vm, v: Value) -> Result<Right, Exit> {
    let is_keyword = vm.heap.flags(v, Kind::Symbol).is_some_and(|flags| flags & SymbolObject::KEYWORD != 0);
    let right = if is_keyword { Right::of_name(&designated_text(vm, v)?) } else { None };
    match right {
        Some(right) => Ok(right),
        None => vm.exchange.not_written(v, "(MEMBER :READ :WRITE :NET :RUN :ENV :SERIAL :FLEET)"),
    }
}

/// Returns the text of an object of a right.
fn expect_object(vm: &mut Vm, v: Value) -> Result<String, Exit> {
    match text_of(&vm.heap, v) {
        Some(text) if !text.is_empty() && !text.contains(END) => Ok(text),
        _ => vm.exchange.type_error(v, "STRING"),
    }
}

/// `(%narrow-rights rights &optional by-flag)`
pub(super) fn narrow_rights(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let mut text = String::new();
    if !optional(arguments, 1).is_nil() {
        text.push_str(BY_FLAG);
    }
    for right in list_items(vm, optional(arguments, 0), LIMIT)? {
        let parts = list_items(vm, right, LIMIT)?;
        let Some((&name, objects)) = parts.split_first() else {
            return vm.exchange.type_error(right, "CONS");
        };
        let right = expect_right(vm, name)?;
        let mut add =
            |object: &str| text.extend([right.name(), object].into_iter().flat_map(|part| [part, "\0"]));
        if objects.is_empty() {
            add("");
        }
        for &object in objects {
            add(&expect_object(vm, object)?);
        }
    }
    let control = vm.scheduler.running.as_ref().and_then(|task| task.control.get());
    let scope = control.and_then(|control| control.entries.last());
    let Some(base) = scope.filter(|entry| entry.kind == EntryKind::Scope).map(|entry| entry.base) else {
        return vm.exchange.program_error("rights are narrowed in a scope only");
    };
    let text = vm.heap.alloc_str(&text)?;
    let value = vm.heap.cons(text, in_force(vm))?;
    let symbol = vm.names.rights;
    if vm.scheduler.task().control.bindings.is_full() {
        vm.reserve_bindings(base)?;
    }
    vm.scheduler.task_mut().control.bindings.push(Binding { symbol, value, base });
    Ok(Value::NIL)
}

/// `(%lend-rights index data)`
///
/// Nothing but the library calls procedures of forms, in a mask that is its own; and it calls those that the
/// form has.
pub(super) fn lend_rights(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [index, data] = exactly(arguments);
    let symbol = vm.names.rights;
    let known = vm.heap.vector(data).and_then(|items| items.first().copied()).unwrap_or(Value::NIL);
    if vm.scheduler.task().control.bindings.get(symbol).is_none() {
        // There is nothing to lend.
        return Ok(known);
    }
    let index = index.as_index().unwrap_or(usize::MAX);
    let base = vm.offset_of(vm.cpu.base()) as u32;
    let is_of_library = vm.frames().next().is_some_and(|frame| frame.is_of_library());
    let control = &vm.scheduler.task().control;
    let is_in_mask =
        control.entries.last().is_some_and(|mask| mask.kind == EntryKind::Mask && mask.base == base);
    let entry = control.entries.get(index).copied().filter(|entry| entry.data == data);
    let (Some(entry), true) = (entry, is_in_mask && is_of_library) else {
        return vm.exchange.program_error("rights are lent to the procedures of a form only");
    };
    let (below, above) = control.bindings.all().split_at(entry.bindings as usize);
    let is_it = |binding: &&Binding| binding.symbol == symbol;
    let is_narrowed = above.iter().rev().any(|binding| binding.symbol == symbol);
    let value = below.iter().rev().find(is_it).map_or(Value::NIL, |binding| binding.value);
    vm.exchange.charge((below.len() + above.len()) / 16);
    if !is_narrowed {
        return Ok(known);
    }
    // A function that the program may have put in its place does not get the rights.
    let function = if entry.kind == EntryKind::Recovery { vm.recovery_function(index)? } else { None };
    if vm.scheduler.task().control.bindings.is_full() {
        vm.reserve_bindings(base)?;
    }
    vm.scheduler.task_mut().control.bindings.push(Binding { symbol, value, base });
    Ok(function.unwrap_or(known))
}

/// `(%demand-right right object)`
pub(super) fn demand_right(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [right, object] = exactly(arguments);
    let right = expect_right(vm, right)?;
    let object = expect_object(vm, object)?;
    let whole = demand(vm, right, &object)?;
    Ok(vm.heap.alloc_str(&whole)?)
}
