//! `point`: stops a task before it uses a place that others may reach, in a strict exploration; and notes the
//! uses, for reports of schedules.

use esl_bytecode::builtin::{Builtin, Shares};
use esl_bytecode::compile::MODULE_SOURCES;
use esl_bytecode::module::VariablePlace;
use esl_bytecode::opcode::Instr;
use esl_bytecode::operand::Reg;

use super::{Signal, aux_at, word_at};
use crate::describe::describe;
use crate::heap::Kind;
use crate::names::class;
use crate::schedule::{SharedUse, UsedPlace};
use crate::task::TaskNumber;
use crate::value::Value;
use crate::vm::Vm;

/// `point`.
#[inline(never)]
pub(super) unsafe fn point(vm: &mut Vm, pc: *const u32, base: *mut Value) -> Signal {
    if vm.scheduler.points.grain.is_none() {
        return Signal::Next;
    }
    if let Err(exit) = vm.scheduler.point_of_use() {
        return Signal::Exit(exit);
    }
    if vm.scheduler.points.uses.is_some() {
        // SAFETY: by the contract the frame at `base` stands at the instruction at `pc`; V1: control does not
        // run past the end, so another instruction follows.
        unsafe { note_use(vm, pc.add(1), base) };
    }
    Signal::Next
}

/// A part of an object that an instruction uses.
struct UsedPart {
    object: Value,
    /// Name of the part.
    part: String,
    /// The value that is read or set, as far as it is known before.
    value: Option<Value>,
}

/// Notes that the running task uses a place by the instruction at `pc`.
///
/// # Safety
/// There is an instruction at `pc`, of the function of the frame at `base`, whose registers have values.
unsafe fn note_use(vm: &mut Vm, pc: *const u32, base: *mut Value) {
    // SAFETY: an instruction is at `pc`, as the contract says; F2: below the base is the frame's function.
    let (instr, function) = unsafe {
        let word = word_at(pc);
        let Some(opcode) = word.opcode() else { return };
        let aux = if opcode.words() == 2 { aux_at(pc) } else { 0 };
        (Instr::from_words(opcode, word.0, aux), *base.sub(2))
    };
    let Some(code) = vm.heap.function_code(function) else { return };
    let start = vm.heap.code_words(code).map_or(std::ptr::null(), <[u32]>::as_ptr);
    let at = ((pc.addr() - start.addr()) / size_of::<u32>()) as u32;
    let place =
        vm.names.source_place(&vm.heap, code, at).filter(|place| !place.source.starts_with(MODULE_SOURCES));
    let place = place.map(|place| format!("{}:{}:{}", place.source, place.line, place.column));
    let Some(sharing) = instr.sharing() else { return };
    if sharing.place == Shares::Variables {
        // The instruction itself notes the use, unless the task has bound the variable.
        vm.scheduler.points.place = place;
        return;
    }
    // SAFETY: V3: registers that the instruction reads are in the frame, and so are the arguments in its
    // window.
    let get = |Reg(register): Reg| unsafe { *base.add(usize::from(register)) };
    let captures = vm.heap.function_captures(function).unwrap_or(&[]);
    let variable = |place: VariablePlace| {
        let variables = vm.names.variables_at(&vm.heap, code, at);
        let name = variables.into_iter().rev().find(|(_, other)| *other == place);
        name.map_or("a variable".into(), |(name, _)| name.to_uppercase())
    };
    let part =
        |object: Value, part: &str, value: Option<Value>| UsedPart { object, part: part.into(), value };
    let element = |object: Value, index: Value, value: Option<Value>| UsedPart {
        object,
        part: format!("element {}", describe(&vm.heap, index)),
        value,
    };
    let elements =
        |vector: Value, index: usize| vm.heap.vector(vector).and_then(|items| items.get(index).copied());
    let slot = |instance: Value, index: usize, value: Option<Value>| {
        let value = value.or_else(|| vm.heap.structure_slots(instance)?.get(index).copied());
        UsedPart { object: instance, part: slot_name(vm, instance, index), value }
    };
    let used = match instr {
        Instr::Car { list, .. } => part(get(list), "car", vm.heap.car(get(list))),
        Instr::Cdr { list, .. } => part(get(list), "cdr", vm.heap.cdr(get(list))),
        Instr::Cadr { list, .. } => {
            let rest = vm.heap.cdr(get(list)).unwrap_or(Value::NIL);
            part(rest, "car", vm.heap.car(rest))
        }
        Instr::Cddr { list, .. } => {
            let rest = vm.heap.cdr(get(list)).unwrap_or(Value::NIL);
            part(rest, "cdr", vm.heap.cdr(rest))
        }
        Instr::SetCar { pair, value } => part(get(pair), "car", Some(get(value))),
        Instr::SetCdr { pair, value } => part(get(pair), "cdr", Some(get(value))),
        Instr::VectorRef { vector, index, .. } | Instr::ArrayRef { array: vector, index, .. } => {
            let value = get(index).as_index().and_then(|at| elements(get(vector), at));
            element(get(vector), get(index), value)
        }
        Instr::VectorRefInt { vector, index, .. } => {
            let index = usize::from(index.0);
            element(get(vector), Value::small(index as i32), elements(get(vector), index))
        }
        Instr::CharRef { string, index, .. } => element(get(string), get(index), None),
        Instr::VectorSet { vector, index, value } | Instr::ArraySet { array: vector, index, value } => {
            element(get(vector), get(index), Some(get(value)))
        }
        Instr::VectorSetInt { vector, index, value } => {
            element(get(vector), Value::small(i32::from(index.0)), Some(get(value)))
        }
        Instr::Slot { instance, slot: index, .. } => slot(get(instance), usize::from(index.0), None),
        Instr::SetSlot { instance, slot: index, value, .. } => {
            slot(get(instance), usize::from(index.0), Some(get(value)))
        }
        Instr::BoxRef { cell, .. } => {
            let name = variable(VariablePlace::Register(cell.0));
            part(get(cell), &name, vm.heap.slot(get(cell), 0))
        }
        Instr::BoxSet { cell, src } => {
            part(get(cell), &variable(VariablePlace::Register(cell.0)), Some(get(src)))
        }
        Instr::CaptureBoxRef { index, .. } | Instr::CaptureBoxSet { index, .. } => {
            let Some(&cell) = captures.get(usize::from(index.0)) else { return };
            let value = match instr {
                Instr::CaptureBoxSet { src, .. } => Some(get(src)),
                _ => vm.heap.slot(cell, 0),
            };
            part(cell, &variable(VariablePlace::Capture(index.0)), value)
        }
        Instr::CallBuiltin { window, count, builtin, .. }
        | Instr::TailCallBuiltin { window, count, builtin, .. } => {
            let first = window.0.saturating_add(2);
            let arguments: Vec<Value> =
                (first..first.saturating_add(count.0)).map(|at| get(Reg(at))).collect();
            let Some(builtin) = Builtin::from_number(builtin.0) else { return };
            let Some(used) = part_used_by(vm, builtin, &arguments) else { return };
            used
        }
        _ => return,
    };
    if !used.object.is_object() && !used.object.is_cons() {
        return;
    }
    let value = used.value.map_or(String::new(), |value| describe(&vm.heap, value));
    let task = vm.scheduler.running.as_ref().map_or(TaskNumber::NONE, |task| task.number);
    let target = UsedPlace::Part { object: used.object, part: used.part };
    let noted = SharedUse { task, target, value, is_set: sharing.is_change, place };
    if let Some(uses) = &mut vm.scheduler.points.uses {
        uses.push(noted);
    }
}

/// Returns the name of a slot of an instance.
fn slot_name(vm: &Vm, instance: Value, index: usize) -> String {
    let of_class = vm.heap.structure_class(instance).unwrap_or(Value::NIL);
    let mut names = class::class_slot(&vm.heap, of_class, class::slot::SLOTS);
    (0..index).for_each(|_| names = vm.heap.cdr(names).unwrap_or(Value::NIL));
    vm.heap.car(names).map_or("a slot".into(), |name| describe(&vm.heap, name))
}

/// Returns the part of an object that a builtin uses.
fn part_used_by(vm: &Vm, builtin: Builtin, arguments: &[Value]) -> Option<UsedPart> {
    let sharing = builtin.sharing()?;
    let heap = &vm.heap;
    let is_used = |object: &&Value| match sharing.place {
        Shares::Tables => heap.is(**object, Kind::HashTable),
        Shares::Pairs => object.is_cons(),
        Shares::Slots => heap.is(**object, Kind::Structure),
        Shares::Properties => heap.is(**object, Kind::Symbol),
        _ => object.is_object(),
    };
    let object = arguments.iter().find(is_used).copied()?;
    let text = |at: usize| arguments.get(at).map_or(String::new(), |&value| describe(heap, value));
    let last = arguments.last().copied();
    let index = |at: usize| arguments.get(at).and_then(|index| index.as_index()).unwrap_or(0);
    let (part, value) = match builtin {
        Builtin::SetCar | Builtin::Rplaca => ("car".into(), last),
        Builtin::SetCdr | Builtin::Rplacd => ("cdr".into(), last),
        Builtin::SlotOf => (slot_name(vm, object, index(1)), None),
        Builtin::SetSlotOf => (slot_name(vm, object, index(1)), last),
        Builtin::SetStructureRef => (slot_name(vm, object, index(1)), last),
        Builtin::Gethash | Builtin::Remhash => (format!("entry {}", text(0)), None),
        Builtin::Puthash => (format!("entry {}", text(0)), last),
        Builtin::AddToValue => (format!("entry {}", text(0)), None),
        Builtin::Get | Builtin::Remprop => (format!("property {}", text(1)), None),
        Builtin::Put => (format!("property {}", text(1)), last),
        Builtin::CachedSlotValue => (text(1), None),
        Builtin::SetCachedSlotValue => (text(1), last),
        Builtin::Aref | Builtin::Svref | Builtin::Elt | Builtin::Char => {
            (format!("element {}", text(1)), None)
        }
        Builtin::SetAref | Builtin::SetSvref | Builtin::SetElt => (format!("element {}", text(1)), last),
        _ => ("contents".into(), None),
    };
    Some(UsedPart { object, part, value })
}
