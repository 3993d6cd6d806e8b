//! Instructions on the control stack, and unwinding.
//!
//! Every instruction here has the contract of [`super::settle`]: `pc` is at an instruction of the row it
//! serves, `base` is the running frame's, and what the verifier proved holds (V1 to V14).

use esl_bytecode::opcode::Opcode;
use esl_bytecode::word::Word;

use super::substitute::deliver;
use super::{Signal, aux_at, cold, constant, failure, word_at};
use crate::heap::layout::Kind;
use crate::raise::{Exit, Raised};
use crate::saved_pc::SavedPc;
use crate::task::{Allowance, Entry, EntryKind, RunningCleanup, UnwindTarget, Unwinding};
use crate::value::Value;
use crate::vm::Vm;

/// `new-tag`.
#[inline(never)]
pub(super) unsafe fn new_tag(vm: &mut Vm, pc: *const u32, base: *mut Value) -> Signal {
    match vm.heap.alloc_tag(Value::NIL) {
        Ok(tag) => {
            // SAFETY: V3: the operand is a register of the frame at `base`.
            unsafe { *base.add(word_at(pc).a()) = tag };
            Signal::Next
        }
        Err(error) => Signal::Exit(error.into()),
    }
}

/// Returns the entry that the instruction with this word pushes, as far as all kinds have it in common.
fn entry(kind: EntryKind, word: Word) -> Entry {
    let window = word.a() as u8;
    Entry { data: Value::NIL, pc: SavedPc::NONE, base: 0, bindings: 0, window, want: 0, kind }
}

/// Where the entry lands that the instruction at `pc` pushes.
///
/// # Safety
/// `pc` is at an instruction with an aux word.
unsafe fn landing(pc: *const u32) -> SavedPc {
    // SAFETY: V1 and V2: the instruction jumps inside the function.
    SavedPc::new(unsafe { pc.add(2).offset(aux_at(pc) as i32 as isize) })
}

/// Pushes an entry of the frame at `base`.
fn push(vm: &mut Vm, base: *mut Value, entry: Entry) -> Signal {
    let base = vm.offset_of(base) as u32;
    let mut control = &mut *vm.scheduler.task_mut().control;
    if control.entries.len() == control.entries.capacity() {
        if let Err(exit) = vm.reserve_entries(base) {
            return Signal::Exit(exit);
        }
        control = &mut *vm.scheduler.task_mut().control;
    }
    let bindings = control.bindings.len() as u32;
    control.entries.push(Entry { base, bindings, ..entry });
    Signal::Next
}

/// `push-catch`.
#[inline(never)]
pub(super) unsafe fn push_catch(vm: &mut Vm, pc: *const u32, base: *mut Value) -> Signal {
    // SAFETY: V1, V3: the instruction at `pc` has an aux word, and its operand is a register of the frame
    // at `base`.
    unsafe {
        let word = word_at(pc);
        let (data, want) = (*base.add(word.b()), word.c() as u8);
        push(vm, base, Entry { data, want, pc: landing(pc), ..entry(EntryKind::Catch, word) })
    }
}

/// `push-cleanup`.
#[inline(never)]
pub(super) unsafe fn push_cleanup(vm: &mut Vm, pc: *const u32, base: *mut Value) -> Signal {
    // SAFETY: V1: the instruction at `pc` has an aux word.
    unsafe {
        let word = word_at(pc);
        push(vm, base, Entry { pc: landing(pc), ..entry(EntryKind::Cleanup, word) })
    }
}

/// `push-failure-cleanup`.
#[inline(never)]
pub(super) unsafe fn push_failure_cleanup(vm: &mut Vm, pc: *const u32, base: *mut Value) -> Signal {
    // SAFETY: V1: the instruction at `pc` has an aux word.
    unsafe {
        let word = word_at(pc);
        push(vm, base, Entry { pc: landing(pc), ..entry(EntryKind::FailureCleanup, word) })
    }
}

/// `push-handler-case`.
#[inline(never)]
pub(super) unsafe fn push_handler_case(vm: &mut Vm, pc: *const u32, base: *mut Value) -> Signal {
    // SAFETY: V1, V4: the instruction at `pc` has an aux word, and its constant is there.
    unsafe {
        let word = word_at(pc);
        let data = constant(base, word.d());
        push(vm, base, Entry { data, want: 2, pc: landing(pc), ..entry(EntryKind::HandlerCase, word) })
    }
}

/// `push-recovery`.
#[inline(never)]
pub(super) unsafe fn push_recovery(vm: &mut Vm, pc: *const u32, base: *mut Value) -> Signal {
    // SAFETY: V1, V3: the instruction at `pc` has an aux word, and its operand is a register of the frame
    // at `base`.
    unsafe {
        let word = word_at(pc);
        let data = *base.add(word.b());
        push(vm, base, Entry { data, want: 2, pc: landing(pc), ..entry(EntryKind::Recovery, word) })
    }
}

/// `push-handlers`.
#[inline(never)]
pub(super) unsafe fn push_handlers(vm: &mut Vm, pc: *const u32, base: *mut Value) -> Signal {
    // SAFETY: V3: the operand is a register of the frame at `base`.
    unsafe {
        let word = word_at(pc);
        push(vm, base, Entry { data: *base.add(word.b()), ..entry(EntryKind::Handlers, word) })
    }
}

/// `push-mask`.
#[inline(never)]
pub(super) unsafe fn push_mask(vm: &mut Vm, pc: *const u32, base: *mut Value) -> Signal {
    // SAFETY: V3: the operand is a register of the frame at `base`.
    unsafe {
        let word = word_at(pc);
        push(vm, base, Entry { data: *base.add(word.b()), ..entry(EntryKind::Mask, word) })
    }
}

/// `push-scope`.
#[inline(never)]
pub(super) unsafe fn push_scope(vm: &mut Vm, pc: *const u32, base: *mut Value) -> Signal {
    // SAFETY: V1: `pc` is at an instruction.
    unsafe {
        let word = word_at(pc);
        push(vm, base, entry(EntryKind::Scope, word))
    }
}

/// `pop-control`.
#[inline(never)]
pub(super) unsafe fn pop(vm: &mut Vm, pc: *const u32, _base: *mut Value) -> Signal {
    // SAFETY: V1: `pc` is at an instruction.
    let count = unsafe { word_at(pc) }.a();
    let control = &mut vm.scheduler.task_mut().control;
    let mut limits = 0;
    for _ in 0..count {
        if let Some(entry) = control.entries.pop() {
            control.bindings.truncate(entry.bindings as usize);
            limits += usize::from(entry.kind == EntryKind::Limit);
        }
    }
    for _ in 0..limits {
        vm.scheduler.close_limit();
    }
    Signal::Next
}

/// `bind-list`.
#[inline(never)]
pub(super) unsafe fn bind_list(vm: &mut Vm, pc: *const u32, base: *mut Value) -> Signal {
    // SAFETY: V3: both operands are registers of the frame at `base`.
    let (symbols, values) = unsafe {
        let word = word_at(pc);
        (*base.add(word.a()), *base.add(word.b()))
    };
    let height = vm.scheduler.task().control.bindings.len();
    let offset = vm.offset_of(base) as u32;
    match vm.bind_list(symbols, values, offset) {
        Ok(()) => Signal::Next,
        Err(exit) => {
            vm.scheduler.task_mut().control.bindings.truncate(height);
            Signal::Exit(exit)
        }
    }
}

/// `enter-cleanup`.
#[inline(never)]
pub(super) unsafe fn enter_cleanup(vm: &mut Vm, _pc: *const u32, _base: *mut Value) -> Signal {
    // The room of an empty list stays where it will be needed.
    let values = &mut vm.exchange.values;
    let values = if values.is_empty() { Vec::new() } else { std::mem::take(values) };
    vm.scheduler.task_mut().control.enter_cleanup(values);
    Signal::Next
}

/// `end-cleanup`.
#[inline(never)]
pub(super) unsafe fn end_cleanup(vm: &mut Vm, _pc: *const u32, _base: *mut Value) -> Signal {
    let task = vm.scheduler.task_mut();
    let control = &mut *task.control;
    control.entries.pop();
    let Some(RunningCleanup { pending, values, .. }) = control.running.pop() else { return Signal::Next };
    let unwinds = pending.is_some();
    if unwinds || control.unwinding.is_some() {
        control.unwinding = pending;
    }
    if values.is_empty() {
        vm.exchange.values.clear();
    } else {
        vm.exchange.values = values;
    }
    if task.flags.attention() {
        // Requests that waited for the end of the cleanup are delivered now.
        vm.exchange.charges.end_slice();
    }
    vm.close_cleanup_memory();
    if unwinds { Signal::Unwind } else { Signal::Next }
}

/// `throw`.
#[inline(never)]
pub(super) unsafe fn throw(vm: &mut Vm, pc: *const u32, base: *mut Value) -> Signal {
    // SAFETY: V3: the tag is in a register of the frame at `base`.
    let (tag, kind) = unsafe {
        let word = word_at(pc);
        (*base.add(word.a()), word.b())
    };
    let control = &vm.scheduler.task().control;
    let (found, height) = (control.find_catch(tag), control.entries.len());
    vm.exchange.charge(height - found.unwrap_or(0));
    match found {
        Some(index) => {
            let values = std::mem::take(&mut vm.exchange.values);
            vm.scheduler.task_mut().control.unwinding =
                Some(Unwinding { target: UnwindTarget::Entry(index), values });
            Signal::Unwind
        }
        None => {
            // Clauses of recovery procedures throw to their state.
            let is_state = vm.heap.vector(tag).and_then(|items| items.first());
            let text = match kind {
                0 if is_state.is_some_and(|&first| vm.heap.is(first, Kind::Function)) => {
                    "the form of this RETRY or ABORT has been left"
                }
                0 => "no CATCH has the tag of this THROW",
                1 => "the block of this RETURN-FROM has been left",
                _ => "the tagbody of this GO has been left",
            };
            failure(vm, Raised::Control(text.into()))
        }
    }
}

/// Works on the unwinding of the running task until it lands, meets a cleanup, or a tick is due.
///
/// # Safety
/// The contract of [`super::settle`].
pub(super) unsafe fn unwind(vm: &mut Vm) -> Signal {
    loop {
        let task = vm.scheduler.task_mut();
        let Some(unwinding) = task.control.unwinding.take() else { return Signal::Reload };
        let height = task.control.entries.len();
        match unwinding.target {
            UnwindTarget::Entry(index) | UnwindTarget::Limit(index) if index + 1 >= height => {
                // SAFETY: F1: by the contract `vm.cpu` describes the running task, and the target is its
                // topmost entry; F5: the frame of the entry is live.
                return unsafe { land(vm, unwinding.values) };
            }
            UnwindTarget::Return { entries, base } if height <= entries => {
                task.control.bindings.truncate_from(base);
                vm.exchange.values = unwinding.values;
                vm.drop_answers(base);
                // SAFETY: the base is that of a frame that the task has not left, so it lies in the stack.
                unsafe { vm.cpu.set_base(vm.scheduler.task().stack.start().add(base as usize)) };
                vm.close_reserves();
                return Signal::ReturnAll;
            }
            UnwindTarget::Root(end) if height == 0 => {
                task.control.bindings.truncate(0);
                vm.exchange.values = unwinding.values;
                vm.drop_answers(0);
                vm.scheduler.turn.ending = Some(end);
                return Signal::TaskExit;
            }
            _ => {}
        }
        // The tick comes before the step, so that a slice that ends here leaves the step to the next one.
        vm.cpu.ticks -= 1;
        if vm.cpu.ticks < 0 {
            task.control.unwinding = Some(unwinding);
            return Signal::Tick;
        }
        let Some(entry) = task.control.entries.pop() else { return Signal::Reload };
        vm.drop_answers(entry.base);
        let task = vm.scheduler.task_mut();
        match entry.kind {
            EntryKind::FailureCleanup if !unwinding.target.is_final() => {
                // The unwinding is not that of a failure.
                task.control.unwinding = Some(unwinding);
            }
            EntryKind::Cleanup | EntryKind::FailureCleanup => {
                // A task that ends by a failure, and is to be aborted besides, is waited for too.
                let is_forced = unwinding.target.is_forced()
                    || unwinding.target.is_final() && vm.scheduler.task().flags.abort_pending();
                let allowance = if is_forced { vm.allow_cleanup(unwinding.target, height - 1) } else { None };
                if is_forced && allowance.is_none() {
                    // The common allowance of these cleanups is spent.
                    vm.scheduler.task_mut().control.unwinding = Some(unwinding);
                } else {
                    let running =
                        RunningCleanup { pending: Some(unwinding), allowance, ..RunningCleanup::default() };
                    vm.scheduler.task_mut().control.run_cleanup(entry, running);
                    // SAFETY: F5: the entry's frame is live, and its pc is the cleanup's first instruction.
                    unsafe { vm.resume_at(&entry) };
                    return Signal::Reload;
                }
            }
            EntryKind::Running => {
                let interrupted = task.control.running.pop().and_then(|running| running.pending);
                let next = if unwinding.target == UnwindTarget::Cleanup(task.control.entries.len()) {
                    Some(vm.scheduler.task_mut().after_cut_off(interrupted))
                } else {
                    Some(unwinding.or_interrupted(interrupted))
                };
                vm.scheduler.task_mut().control.unwinding = next;
                vm.close_cleanup_memory();
            }
            EntryKind::Limit => {
                task.control.unwinding = Some(unwinding);
                vm.scheduler.close_limit();
            }
            EntryKind::Interrupt => {
                task.control.unwinding = Some(unwinding);
                if entry.data.is_true() {
                    vm.heap.log_if_marking(entry.data);
                    vm.scheduler.close_wait(&mut vm.heap, entry.data);
                }
            }
            _ => task.control.unwinding = Some(unwinding),
        }
    }
}

/// Ends an unwinding at the entry on top of the control stack.
///
/// # Safety
/// The contract of [`super::settle`].
unsafe fn land(vm: &mut Vm, values: Vec<Value>) -> Signal {
    let control = &mut vm.scheduler.task_mut().control;
    let Some(entry) = control.entries.pop() else { return Signal::Reload };
    control.bindings.truncate(entry.bindings as usize);
    vm.drop_answers(entry.base);
    let control = &mut vm.scheduler.task_mut().control;
    if entry.kind == EntryKind::FailureCleanup {
        // The failure waits for the end of the cleanup as the values of a protected form do.
        control.run_cleanup(entry, RunningCleanup { values, ..RunningCleanup::default() });
        vm.exchange.values.clear();
        // SAFETY: F5: the entry's frame is live, and its pc is the cleanup's first instruction.
        unsafe { vm.resume_at(&entry) };
        vm.close_reserves();
        return Signal::Reload;
    }
    if entry.kind == EntryKind::Limit {
        vm.scheduler.close_limit();
    }
    vm.exchange.values = values;
    // SAFETY: F5: the entry's frame is live; V10: the landing takes its results in registers of that frame,
    // and asks for no more than the registers below the window.
    unsafe {
        vm.resume_at(&entry);
        let window = vm.cpu.base().add(usize::from(entry.window));
        deliver(vm, window, usize::from(entry.want));
    }
    vm.close_reserves();
    Signal::Reload
}

impl Vm {
    /// Returns the function that runs the clauses of the recovery procedures of an entry, made as the first
    /// instruction at its landing says; `None` if there is no such entry or instruction.
    pub(crate) fn recovery_function(&mut self, index: usize) -> Result<Option<Value>, Exit> {
        let Some(entry) = self.scheduler.task().control.entries.get(index).copied() else { return Ok(None) };
        if entry.kind != EntryKind::Recovery {
            return Ok(None);
        }
        // SAFETY: F5: the entry's frame is live, and its pc that of an instruction of the frame's function;
        // V10: this may do what that instruction does as long as the entry stands. An object's value is the
        // address of a live header.
        unsafe {
            let base = self.scheduler.task().stack.start().add(entry.base as usize);
            let word = word_at(entry.pc.get());
            match word.opcode() {
                Some(Opcode::MakeClosure | Opcode::LoadConst) => {
                    let constant = constant(base, word.d());
                    if constant.is_object() && (*constant.object_ptr()).kind == Kind::Code {
                        return cold::closure(self, constant, base).map(Some);
                    }
                    Ok(Some(constant))
                }
                _ => Ok(None),
            }
        }
    }

    /// Returns the allowance of the cleanup at the control entry `index`, which a forced unwinding to
    /// `target` meets. `None` if it is not to be run.
    fn allow_cleanup(&mut self, target: UnwindTarget, index: usize) -> Option<Allowance> {
        let depth = match target {
            UnwindTarget::Cleanup(_) => None,
            target => Some(target.depth()),
        };
        let Vm { scheduler, outside, config, cpu, exchange, .. } = self;
        let allowance = scheduler.allow_cleanup(depth, index, cpu.used(), &mut outside.host, config)?;
        let left = allowance.ticks.saturating_sub(scheduler.task().ticks.saturating_add(cpu.used()));
        if cpu.left() > left as i64 {
            // The slice is longer than the cleanup may take.
            exchange.charges.end_slice();
        }
        Some(allowance)
    }

    /// Makes the frame and place of an entry the running ones.
    ///
    /// # Safety
    /// The entry belongs to the running task, and its frame is live.
    unsafe fn resume_at(&mut self, entry: &Entry) {
        // SAFETY: by the contract, the base of the entry lies in the stack, and the address in the code of
        // the frame there.
        unsafe {
            self.cpu.set_pc(entry.pc.get());
            self.cpu.set_base(self.scheduler.task().stack.start().add(entry.base as usize));
        }
    }

    /// Drops the answers of the embedder's functions to calls of the running task's frames from the one at
    /// `base` inward, which are left.
    pub(super) fn drop_answers(&mut self, base: u32) {
        if !self.outside.answers.is_empty() {
            self.outside.answers.drop_from(self.scheduler.task().number, base);
        }
    }

    /// Binds the symbols of a list to the items of another, for the frame with this base.
    fn bind_list(&mut self, symbols: Value, values: Value, base: u32) -> Result<(), Exit> {
        let (mut symbols, mut values) = (symbols, values);
        while let Some(pair) = self.heap.as_cons(symbols) {
            let value = match self.heap.as_cons(values) {
                Some(item) => {
                    values = item.cdr;
                    item.car
                }
                None => Value::UNBOUND,
            };
            self.exchange.charge(64);
            self.bind(pair.car, value, base)?;
            symbols = pair.cdr;
        }
        if symbols.is_true() { self.exchange.type_error(symbols, "LIST") } else { Ok(()) }
    }
}
