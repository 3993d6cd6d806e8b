//! Special variables and global functions: the slow parts of their instructions.
//!
//! Every instruction here has the contract of [`super::settle`]: `pc` is at an instruction of the row it
//! serves, `base` is the running frame's, and what the verifier proved holds (V1 to V14).

use super::{Signal, code_of, constant, failure, word_at};
use crate::describe::describe;
use std::collections::HashSet;

use crate::heap::Heap;
use crate::heap::layout::{Kind, SymbolObject};
use crate::raise::{Exit, Raised};
use crate::schedule::{Scheduler, SharedUse, UsedPlace};
use crate::shape::{CodeKind, Shape};
use crate::task::{Binding, TaskNumber};
use crate::value::Value;
use crate::vm::Vm;

/// Returns the value of a special variable that some task has bound, or that is watched: that of the running
/// task's newest binding, or else the global one.
///
/// # Safety
/// `symbol` is a Symbol.
#[inline(never)]
pub(super) unsafe fn bound_value(vm: &mut Vm, symbol: Value) -> Value {
    let bindings = vm.scheduler.running.as_ref().map(|task| &task.control.bindings);
    // SAFETY: by the contract this is a live Symbol.
    let global = unsafe { (*symbol.object_ptr().cast::<SymbolObject>()).value };
    let bound = bindings.and_then(|bindings| bindings.get(symbol));
    if vm.scheduler.points.grain.is_some() {
        vm.note_variable_read(symbol, bound.is_some(), global);
    }
    if bound.is_none() && vm.scheduler.points.uses.is_some() {
        vm.tell_use(symbol, global, false);
    }
    bound.unwrap_or(global)
}

/// `symbol-value` of a symbol that has no value.
#[cold]
#[inline(never)]
pub(super) unsafe fn symbol_value(vm: &mut Vm, pc: *const u32, base: *mut Value) -> Signal {
    // SAFETY: V3: the operand is a register of the frame at `base`; V4: the constant is there.
    unsafe {
        let word = word_at(pc);
        let symbol = constant(base, word.d());
        vm.scheduler.points.note_shown();
        match vm.symbol_value(symbol) {
            Some(value) => {
                *base.add(word.a()) = value;
                Signal::Next
            }
            None => failure(vm, Raised::UnboundVariable(symbol)),
        }
    }
}

/// `set-symbol-value`.
#[inline(never)]
pub(super) unsafe fn set_symbol_value(vm: &mut Vm, pc: *const u32, base: *mut Value) -> Signal {
    // SAFETY: V3: the operand is a register of the frame at `base`; V4: the constant is there.
    unsafe {
        let word = word_at(pc);
        let symbol = constant(base, word.d());
        let value = *base.add(word.a());
        match vm.set_symbol_value(symbol, value) {
            Ok(()) => Signal::Next,
            Err(exit) => Signal::Exit(exit),
        }
    }
}

/// `bind`.
#[inline(never)]
pub(super) unsafe fn bind(vm: &mut Vm, pc: *const u32, base: *mut Value) -> Signal {
    // SAFETY: V3: the operand is a register of the frame at `base`; V4: the constant is a symbol.
    unsafe {
        let word = word_at(pc);
        let symbol = constant(base, word.d());
        let value = *base.add(word.a());
        let offset = vm.offset_of(base) as u32;
        let flags = (*symbol.object_ptr()).flags & (SymbolObject::EVER_BOUND | SymbolObject::CONSTANT);
        let bindings = &mut vm.scheduler.task_mut().control.bindings;
        if flags == SymbolObject::EVER_BOUND && !bindings.is_full() {
            bindings.push(Binding { symbol, value, base: offset });
            return Signal::Next;
        }
        match vm.bind(symbol, value, offset) {
            Ok(()) => Signal::Next,
            Err(exit) => Signal::Exit(exit),
        }
    }
}

/// `unbind`.
#[inline(never)]
pub(super) unsafe fn unbind(vm: &mut Vm, pc: *const u32, _base: *mut Value) -> Signal {
    // SAFETY: V1: `pc` is at an instruction.
    let count = unsafe { word_at(pc) }.a();
    let bindings = &mut vm.scheduler.task_mut().control.bindings;
    bindings.truncate(bindings.len().saturating_sub(count));
    Signal::Next
}

/// `function-ref`.
#[inline(never)]
pub(super) unsafe fn function_ref(vm: &mut Vm, pc: *const u32, base: *mut Value) -> Signal {
    // SAFETY: V3: the operand is a register of the frame at `base`; V4: the constant is a symbol, whose
    // function is a Function with a Code.
    unsafe {
        let word = word_at(pc);
        let symbol = constant(base, word.d());
        let function = (*symbol.object_ptr().cast::<SymbolObject>()).function;
        if Shape::unpack((*code_of(function)).spare[0]).kind == CodeKind::Undefined {
            return failure(vm, Raised::UndefinedFunction(symbol));
        }
        *base.add(word.a()) = function;
        Signal::Next
    }
}

impl Vm {
    /// Returns the value of a special variable in the running task; `None` if it has none.
    pub(crate) fn symbol_value(&self, symbol: Value) -> Option<Value> {
        let cell = self.heap.symbol(symbol)?;
        let value = if cell.header.flags & SymbolObject::EVER_BOUND == 0 {
            cell.value
        } else {
            self.scheduler
                .running
                .as_ref()
                .map_or(cell.value, |task| task.control.bindings.get(symbol).unwrap_or(cell.value))
        };
        (value != Value::UNBOUND).then_some(value)
    }

    /// Fails because `symbol`, a constant or not a symbol, cannot be `done`: set, or bound.
    #[cold]
    fn refuse_constant<T>(&mut self, symbol: Value, done: &str) -> Result<T, Exit> {
        // NIL and T are not objects.
        if self.heap.symbol(symbol).is_none() && symbol != Value::NIL && symbol != Value::T {
            return self.exchange.type_error(symbol, "SYMBOL");
        }
        let name = self.describe(symbol);
        self.exchange.program_error(format!("{name} is a constant and cannot be {done}"))
    }

    /// Sets a special variable in the running task: its binding, or else the global value.
    ///
    /// # Errors
    /// A failure if it is a constant.
    pub(crate) fn set_symbol_value(&mut self, symbol: Value, value: Value) -> Result<(), Exit> {
        let Some(cell) = self.heap.symbol(symbol) else { return self.refuse_constant(symbol, "set") };
        let flags = cell.header.flags;
        if flags & SymbolObject::CONSTANT != 0 {
            return self.refuse_constant(symbol, "set");
        }
        if flags & SymbolObject::EVER_BOUND != 0 {
            let task = self.scheduler.running.as_mut();
            let bound = task.and_then(|task| task.control.bindings.get_mut(symbol));
            let is_bound = bound.is_some();
            if let Some(place) = bound {
                *place = value;
            }
            if self.scheduler.points.grain.is_some() {
                self.note_variable_set(symbol, is_bound);
            }
            if is_bound {
                return Ok(());
            }
            if self.scheduler.points.uses.is_some() {
                self.tell_use(symbol, value, true);
            }
        }
        self.heap.symbol_set_value(symbol, value);
        Ok(())
    }

    /// Notes for the report of a schedule that the running task uses a special variable.
    #[cold]
    pub(crate) fn tell_use(&mut self, symbol: Value, value: Value, is_set: bool) {
        let task = self.scheduler.running.as_ref().map_or(TaskNumber::NONE, |task| task.number);
        let value = if value == Value::UNBOUND { "unbound".into() } else { describe(&self.heap, value) };
        let place = self.scheduler.points.place.take();
        if let Some(uses) = &mut self.scheduler.points.uses {
            uses.push(SharedUse { task, target: UsedPlace::Variable(symbol), value, is_set, place });
        }
    }

    /// Binds a special variable in the running task.
    ///
    /// # Errors
    /// A failure if it is a constant, or if there are too many bindings.
    pub(crate) fn bind(&mut self, symbol: Value, value: Value, base: u32) -> Result<(), Exit> {
        let Some(cell) = self.heap.symbol(symbol) else { return self.refuse_constant(symbol, "bound") };
        let flags = cell.header.flags;
        if flags & SymbolObject::CONSTANT != 0 {
            return self.refuse_constant(symbol, "bound");
        }
        if flags & SymbolObject::EVER_BOUND == 0 {
            self.heap.set_flags(symbol, Kind::Symbol, flags | SymbolObject::EVER_BOUND);
        }
        let mut bindings = &mut self.scheduler.task_mut().control.bindings;
        if bindings.is_full() {
            self.reserve_bindings(base)?;
            bindings = &mut self.scheduler.task_mut().control.bindings;
        }
        bindings.push(Binding { symbol, value, base });
        Ok(())
    }
}

impl Vm {
    /// Notes that the running task has read a special variable, which it may have bound, and which has this
    /// global value. A variable that no task sets beside others looks the same to all, unless its value is an
    /// object with parts: that may stand for them.
    #[cold]
    pub(crate) fn note_variable_read(&mut self, symbol: Value, is_bound: bool, value: Value) {
        let Vm { scheduler, heap, .. } = self;
        if scheduler.points.grain.is_none() {
            return;
        }
        let is_alone = scheduler.counts.alive <= 1;
        let is_constant = |raced: &HashSet<u64>| {
            is_bound || is_alone || !raced.contains(&symbol.bits()) && is_simple(heap, value)
        };
        let is_unseen = scheduler.points.raced.as_deref().is_some_and(is_constant);
        scheduler.points.note_variable(!is_unseen);
    }

    /// Notes that the running task has set a special variable, which it may have bound.
    #[cold]
    pub(crate) fn note_variable_set(&mut self, symbol: Value, is_bound: bool) {
        let Scheduler { points, counts, .. } = &mut self.scheduler;
        if points.grain.is_none() {
            return;
        }
        let is_unseen = points.raced.is_some() && (is_bound || counts.alive <= 1);
        if !is_unseen && points.raced.as_ref().is_some_and(|raced| !raced.contains(&symbol.bits())) {
            points.found_raced.push(symbol);
        }
        points.note_variable(!is_unseen);
    }
}

/// Returns whether a value has no parts that can change.
fn is_simple(heap: &Heap, value: Value) -> bool {
    let is_atom =
        |kind| matches!(kind, Kind::Symbol | Kind::Ratio | Kind::Complex | Kind::Float | Kind::Bignum);
    !value.is_address() || !value.is_cons() && heap.kind(value).is_some_and(is_atom)
}
