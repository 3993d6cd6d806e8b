//! Calls that do not take the fast path: other callees than functions with exactly the given arguments,
//! natives called as functions, applications, and calls for which the stack has to grow.
//!
//! A call is made ready before it has any effect, so that one that fails, or lacks room, leaves the frame as
//! it was.

use esl_bytecode::builtin::{BUILTINS, BuiltinInfo};
use esl_bytecode::opcode::{CallTarget, Opcode, Substitute};
use esl_bytecode::word::Word;

use super::arguments::{arrange, count_of_arguments, describe_arity, spread};
use super::substitute::{deliver, return_all, substitute};
use super::{Signal, aux_at, code_of, constant, failure, first_instruction, pc_as_value, stubs, word_at};
use crate::heap::layout::{Kind, SymbolObject};
use crate::raise::Arguments;
use crate::raise::{Exit, Raised};
use crate::shape::{CodeKind, Shape};
use crate::value::Value;
use crate::vm::Vm;

/// Most calls that builtins request in the place of each other: each copies its arguments.
const MAX_REQUESTED: usize = 64;

/// Where a call puts its frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FramePlace {
    /// In the window that the instruction at `vm.cpu.pc()` names; it returns behind the instruction.
    Window,
    /// In place of the running frame.
    Tail,
    /// Above the running frame; its values take the place of those of the instruction at `vm.cpu.pc()`.
    Above,
    /// Above the running frame; the instruction at `vm.cpu.pc()` comes after it.
    Interrupt,
}

impl FramePlace {
    /// Returns the place of a call that does the work of an instruction.
    pub(super) fn for_instruction(word: Word) -> FramePlace {
        match word.opcode().map(Opcode::substitute) {
            Some(Substitute::Tail) => FramePlace::Tail,
            Some(Substitute::Call) => FramePlace::Window,
            _ => FramePlace::Above,
        }
    }
}

/// The call at `vm.cpu.pc()`, whose tick has been taken.
///
/// # Safety
/// The contract of [`super::settle`], at a call instruction.
pub(super) unsafe fn slow_call(vm: &mut Vm) -> Signal {
    // SAFETY: V1: the instruction has its aux word; V3: window and arguments are registers of the frame; V4:
    // the constant is there; F2: the running function is below the registers.
    unsafe {
        let (pc, base) = (vm.cpu.pc(), vm.cpu.base());
        let word = word_at(pc);
        let window = base.add(word.a());
        let given = std::ptr::slice_from_raw_parts(window.add(2), word.b());
        let sort = word.opcode().and_then(Opcode::callee);
        let callee = match sort {
            Some(CallTarget::Global) => constant(base, aux_at(pc) as usize),
            Some(CallTarget::Running) => *base.sub(2),
            Some(CallTarget::Given | CallTarget::Applied | CallTarget::Builtin) | None => *window,
        };
        let place = FramePlace::for_instruction(word);
        if sort == Some(CallTarget::Applied) {
            let mut arguments = Arguments::from_slice(&*given);
            if let Err(exit) = spread(vm, &mut arguments) {
                return Signal::Exit(exit);
            }
            return call(vm, callee, &*arguments, place);
        }
        call(vm, callee, given, place)
    }
}

/// Calls `callee` with `arguments`, which may lie in the running frame: they are copied before the stack
/// moves. They are passed as a pointer, since a reference would have to outlive the call.
///
/// # Safety
/// The contract of [`super::settle`]; for [`FramePlace::Window`] at an instruction that has a window.
/// `arguments` may be read as long as the stack stays in place.
pub(super) unsafe fn call(
    vm: &mut Vm,
    callee: Value,
    arguments: *const [Value],
    place: FramePlace,
) -> Signal {
    let function = match vm.callable(callee) {
        Ok(function) => function,
        Err(exit) => return Signal::Exit(exit),
    };
    // SAFETY: `callable` returns a Function that is ready to run.
    let (code, shape) = unsafe {
        let code = code_of(function);
        (code, Shape::unpack((*code).spare[0]))
    };
    if shape.kind == CodeKind::Native {
        // SAFETY: by the contract the arguments stay where they are until the call is made; a frame of this
        // place has room for them.
        return unsafe { call_native(vm, shape.number, arguments, place) };
    }
    let mut arranged = Arguments::new();
    // SAFETY: `code` and `shape` are those of the function, which is neither native nor a stub: `callable`
    // has loaded it. The stack is still in place.
    if let Err(exit) = unsafe { arrange(vm, function, code, shape, &*arguments, &mut arranged) } {
        return Signal::Exit(exit);
    }
    // SAFETY: F2: the new frame lies in the window of the running one (V3), behind its registers, or in its
    // place, and `reserve_stack` has made room up to its last register; its link and the saved pc lie between
    // the two.
    unsafe {
        let nregs = (*code).nregs as usize;
        let frame = match place {
            FramePlace::Tail => 0,
            FramePlace::Window => word_at(vm.cpu.pc()).a() + 2,
            FramePlace::Above | FramePlace::Interrupt => (*code_of(*vm.cpu.base().sub(2))).nregs as usize + 3,
        };
        // The link and the saved pc of `FramePlace::Above` are counted in `frame`, the arguments in `nregs`.
        let offset = vm.offset_of(vm.cpu.base()) + frame;
        if let Err(exit) = vm.reserve_stack(offset + nregs) {
            return Signal::Exit(exit);
        }
        let registers = vm.cpu.base().add(frame);
        // The window register, if the frame lies above the running one.
        let window = frame.wrapping_sub(2) as u8;
        let return_to = match place {
            FramePlace::Tail => None,
            FramePlace::Window => Some(vm.cpu.pc().add(stubs::length(word_at(vm.cpu.pc())))),
            FramePlace::Above => Some(stubs::error_return(window)),
            FramePlace::Interrupt => Some(stubs::interrupt_return(window)),
        };
        if matches!(place, FramePlace::Above | FramePlace::Interrupt) {
            *registers.sub(3) = pc_as_value(vm.cpu.pc());
        }
        if let Some(return_to) = return_to {
            *registers.sub(1) = pc_as_value(return_to);
        }
        *registers.sub(2) = function;
        for (i, &argument) in arranged.iter().enumerate() {
            *registers.add(i) = argument;
        }
        vm.cpu.set_base(registers);
        vm.cpu.set_pc(first_instruction(code));
    }
    Signal::Reload
}

/// Calls a builtin as a function.
///
/// # Safety
/// The contract of [`call`].
unsafe fn call_native(vm: &mut Vm, number: u16, arguments: *const [Value], place: FramePlace) -> Signal {
    // SAFETY: the contract is the same.
    unsafe {
        let result = apply_native(vm, number, arguments);
        end_native(vm, result, number, arguments, place)
    }
}

/// Delivers what a builtin has come to that was called as a function.
///
/// # Safety
/// The contract of [`call`], for the arguments of the builtin, which has left `vm.cpu` as it was.
unsafe fn end_native(
    vm: &mut Vm,
    result: Result<Value, Exit>,
    number: u16,
    arguments: *const [Value],
    place: FramePlace,
) -> Signal {
    match result {
        Ok(value) => {
            vm.exchange.values.clear();
            vm.exchange.values.push(value);
        }
        Err(Exit::Values) => {}
        // SAFETY: the contract is the same.
        Err(exit) => return unsafe { call_instead(vm, exit, number, arguments, place) },
    }
    if vm.wants_safepoint() {
        vm.cpu.ticks = vm.prepare_safepoint(vm.cpu.ticks);
    }
    // SAFETY: F1 holds by the contract; V3: the instruction of a `Window` has one in its frame.
    unsafe {
        match place {
            FramePlace::Tail => return_all(vm),
            FramePlace::Window => {
                let word = word_at(vm.cpu.pc());
                deliver(vm, vm.cpu.base().add(word.a()), word.c());
                Signal::Next
            }
            FramePlace::Above => substitute(vm),
            // Functions called in an interrupted task are written in ESL; after a builtin, the task would
            // just go on.
            FramePlace::Interrupt => {
                vm.restore_wait();
                Signal::Reload
            }
        }
    }
}

/// Applies a builtin to arguments, if it takes so many.
///
/// # Safety
/// `arguments` may be read as long as the stack stays in place.
pub(super) unsafe fn apply_native(
    vm: &mut Vm,
    number: u16,
    arguments: *const [Value],
) -> Result<Value, Exit> {
    vm.cpu.wants_one = false;
    let info = &BUILTINS[usize::from(number)];
    let count = arguments.len();
    let max = info.arity.max.map_or(usize::MAX, |max| max as usize);
    if count < info.arity.min as usize || count > max {
        let text = format!("{} was called with {}", info.name, count_of_arguments(count));
        let text = format!("{text}; it takes {}", describe_arity(info.arity.min as usize, info.arity.max));
        return vm.exchange.program_error(text);
    }
    // SAFETY: by the contract the arguments are live; no builtin writes to the stack or moves it.
    let arguments = unsafe { &*arguments };
    let result = vm.natives[usize::from(number)](vm, arguments);
    if let (Err(Exit::Raise), Some(raised)) = (result, &mut vm.exchange.raised) {
        raised.note_call(info, arguments);
    }
    result
}

/// Calls what a builtin asks for that has come to `exit`: the library's function that takes over from it, or
/// another one.
///
/// # Safety
/// The contract of [`call`], for the arguments of the builtin, which has left `vm.cpu` as it was.
pub(super) unsafe fn call_instead(
    vm: &mut Vm,
    exit: Exit,
    number: u16,
    arguments: *const [Value],
    place: FramePlace,
) -> Signal {
    match exit {
        Exit::Slowly => match vm.twin_of(&BUILTINS[usize::from(number)]) {
            // SAFETY: the contract still holds. A twin is not a builtin, so this goes one level deep.
            Ok(function) => unsafe { call(vm, function, arguments, place) },
            Err(exit) => Signal::Exit(exit),
        },
        // SAFETY: the contract still holds; what was requested owns its arguments.
        Exit::Call => unsafe { call_requested(vm, place) },
        exit => Signal::Exit(exit),
    }
}

/// Makes the call that a builtin has requested. A builtin that is called so may request one itself, which is
/// made here too, lest such calls take native stack.
///
/// # Safety
/// The contract of [`call`]; a call was requested.
pub(super) unsafe fn call_requested(vm: &mut Vm, place: FramePlace) -> Signal {
    for _ in 0..MAX_REQUESTED {
        let (callee, arguments) = vm.exchange.take_requested_call();
        let function = match vm.callable(callee) {
            Ok(function) => function,
            Err(exit) => return Signal::Exit(exit),
        };
        // SAFETY: `callable` returns a Function. The arguments are there until the call is made; the contract
        // of `call` holds.
        unsafe {
            let shape = Shape::unpack((*code_of(function)).spare[0]);
            if shape.kind != CodeKind::Native {
                return call(vm, function, &*arguments, place);
            }
            match apply_native(vm, shape.number, &*arguments) {
                Err(Exit::Call) => vm.exchange.charge(arguments.len()),
                result => return end_native(vm, result, shape.number, &*arguments, place),
            }
        }
    }
    vm.exchange.take_requested_call();
    let text = format!("FUNCALL and APPLY are called within each other more than {MAX_REQUESTED} times");
    failure(vm, Raised::Program(text))
}

impl Vm {
    /// Returns the function to run when `callee` is called: itself, or that of a symbol, loaded.
    ///
    /// # Errors
    /// `undefined-function`, or `type-error` for what is neither function nor symbol.
    pub(crate) fn callable(&mut self, callee: Value) -> Result<Value, Exit> {
        let function = match self.heap.kind(callee) {
            Some(Kind::Function) => callee,
            Some(Kind::Symbol) => {
                self.heap.symbol(callee).map_or(Value::NIL, |cell: &SymbolObject| cell.function)
            }
            _ if callee == Value::NIL || callee == Value::T => {
                return self.exchange.raise(Raised::UndefinedFunction(callee));
            }
            _ => return self.exchange.type_error(callee, "FUNCTION"),
        };
        // SAFETY: this is a Function, by its kind or because the heap guarantees it of the function of a
        // symbol.
        let kind = unsafe { Shape::unpack((*code_of(function)).spare[0]).kind };
        match kind {
            CodeKind::Undefined => self.exchange.raise(Raised::UndefinedFunction(callee)),
            CodeKind::Lazy => {
                self.make_ready(function)?;
                Ok(function)
            }
            _ => Ok(function),
        }
    }

    /// Makes a function ready to be called: at its first call it is loaded.
    ///
    /// # Errors
    /// [`Exit::Collect`] without room, or a failure if the image is damaged.
    pub(crate) fn make_ready(&mut self, function: Value) -> Result<(), Exit> {
        let words = self.names.make_ready(&mut self.heap, function);
        let words = self.exchange.loaded(words)?;
        self.exchange.charge(words);
        Ok(())
    }

    /// Returns the library's function that takes over from a builtin with too much to do at once.
    ///
    /// # Errors
    /// `program-error` if there is none, [`Exit::Collect`] without room for its name.
    pub(super) fn twin_of(&mut self, builtin: &BuiltinInfo) -> Result<Value, Exit> {
        if let Some(name) = builtin.slowly {
            let symbol = self.names.intern_esl(&mut self.heap, name)?;
            if self.names.is_defined(&self.heap, symbol) {
                return Ok(symbol);
            }
        }
        self.exchange.program_error(format!("{} exceeds the work of one call", builtin.name))
    }
}
