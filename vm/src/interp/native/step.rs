//! What machine code asks of the machine: the rest of an instruction whose fast way does not apply, and calls
//! of builtins.
//!
//! All of it has the contract of a helper: machine code calls it at an instruction of the running frame, with
//! the context of [`super::run`]. It does what the arm of the loop does behind the fast ways that machine
//! code has, and asks for a safepoint where the arm does.

use esl_bytecode::opcode::Opcode;
use esl_native::NativeContext;
use esl_native::abi::{STEP_JUMP, STEP_NEXT, STEP_SIGNAL, STEP_VALUES};

use super::super::{Signal, aux_at, cold, constant, double, is_instance_of_exactly, substitute, unwind};
use super::super::{variable, word_at};
use super::{Caller, make_words};
use crate::heap::Phase;
use crate::heap::layout::{Kind, SymbolObject};
use crate::raise::Exit;
use crate::value::Value;
use crate::vm::Vm;

/// What an instruction has come to that the machine has done for machine code.
enum Done {
    /// The next one follows. What a fast way of the loop does asks for no safepoint.
    Fast,
    /// The next one follows.
    Slow,
    /// It is a test: whether it jumps.
    Jump(bool),
    /// It is left.
    Signal(Signal),
}

impl From<Signal> for Done {
    fn from(signal: Signal) -> Done {
        if signal == Signal::Next { Done::Slow } else { Done::Signal(signal) }
    }
}

/// Takes the parts of a helper's arguments.
///
/// # Safety
/// Machine code has called the helper: the context is that of [`run`].
pub(super) unsafe fn parts<'a>(context: *mut NativeContext) -> (&'a mut Vm, *mut Caller) {
    // SAFETY: by the contract; machine code does not use the machine while a helper does.
    unsafe {
        let caller = (*context).machine.cast::<Caller>();
        (&mut *(*caller).vm, caller)
    }
}

/// Leaves machine code with a signal.
///
/// # Safety
/// That of a helper.
pub(super) unsafe fn leave(
    context: *mut NativeContext,
    signal: Signal,
    pc: *const u32,
    base: *mut Value,
) -> u64 {
    // SAFETY: by the contract the context is that of `run`.
    unsafe {
        (*(*context).machine.cast::<Caller>()).signal = signal;
        (*context).pc = pc.expose_provenance() as u64;
        (*context).base = base.expose_provenance() as u64;
    }
    STEP_SIGNAL
}

/// Handles the charges of a builtin and the requests of an allocation, as the loop does.
///
/// # Safety
/// That of a helper.
pub(super) unsafe fn attend(context: *mut NativeContext, vm: &mut Vm) {
    // SAFETY: by the contract the context is that of `run`.
    unsafe {
        if vm.wants_safepoint() {
            (*context).ticks = vm.prepare_safepoint((*context).ticks);
        }
        (*context).is_marking = u32::from(vm.heap.phase() == Phase::Marking);
    }
}

/// Does the instruction at `pc`: what its arm does behind the fast ways that machine code has.
pub(super) unsafe extern "C" fn step(context: *mut NativeContext, pc: *const u32, base: *mut u64) -> u64 {
    // SAFETY: machine code calls this at an instruction of the frame at `base`.
    unsafe {
        let base = base.cast::<Value>();
        make_words(&mut *context);
        let (vm, _) = parts(context);
        match instruction(vm, pc, base) {
            Done::Fast => STEP_NEXT,
            Done::Slow => {
                attend(context, vm);
                STEP_NEXT
            }
            Done::Jump(jumps) => u64::from(jumps) * STEP_JUMP,
            Done::Signal(signal) => leave(context, signal, pc, base),
        }
    }
}

/// Calls the builtin of a `call-builtin`, whose tick has been taken.
pub(super) unsafe extern "C" fn call_builtin(
    context: *mut NativeContext,
    pc: *const u32,
    base: *mut u64,
) -> u64 {
    // SAFETY: machine code calls this at such an instruction of the frame at `base`; V3, V5 as in the loop.
    unsafe {
        let (vm, _) = parts(context);
        let base = base.cast::<Value>();
        let word = word_at(pc);
        let window = base.add(word.a());
        match call_native(vm, pc, base, word.c() == 0) {
            Ok(value) if word.c() == 0 => {
                *window = value;
                attend(context, vm);
            }
            Ok(value) => {
                vm.exchange.values.clear();
                vm.exchange.values.push(value);
                substitute::deliver(vm, window, word.c());
            }
            Err(Exit::Values) => {
                substitute::deliver(vm, window, word.c());
                attend(context, vm);
            }
            Err(exit) => return leave(context, Signal::Exit(exit), pc, base),
        }
        STEP_NEXT
    }
}

/// Calls the builtin of a `tail-call-builtin`, whose tick has been taken.
pub(super) unsafe extern "C" fn tail_builtin(
    context: *mut NativeContext,
    pc: *const u32,
    base: *mut u64,
) -> u64 {
    // SAFETY: machine code calls this at such an instruction of the frame at `base`; V3, V5 hold for it.
    unsafe {
        let (vm, _) = parts(context);
        let base = base.cast::<Value>();
        match call_native(vm, pc, base, false) {
            Ok(value) => {
                attend(context, vm);
                (*context).value = value.bits();
                STEP_NEXT
            }
            Err(Exit::Values) => {
                attend(context, vm);
                STEP_VALUES
            }
            Err(exit) => leave(context, Signal::Exit(exit), pc, base),
        }
    }
}

/// Delivers the value list as what the function in the frame that was left returns.
pub(super) unsafe extern "C" fn all_values(
    context: *mut NativeContext,
    _pc: *const u32,
    _base: *mut u64,
) -> u64 {
    // SAFETY: N3: the frame is that of a function that was called from machine code, so its link is in order.
    unsafe {
        let (vm, _) = parts(context);
        vm.cpu.set_base(std::ptr::with_exposed_provenance_mut((*context).base as usize));
        substitute::return_all(vm);
    }
    STEP_NEXT
}

/// Delivers a value as the only one that the function in the frame that was left returns.
pub(super) unsafe extern "C" fn only_value(
    context: *mut NativeContext,
    pc: *const u32,
    base: *mut u64,
) -> u64 {
    // SAFETY: N3: the value is one of the program; the frame is as for `all_values`.
    unsafe {
        let (vm, _) = parts(context);
        vm.exchange.values.clear();
        vm.exchange.values.push(Value::from_bits((*context).value));
        all_values(context, pc, base)
    }
}

/// Overwrites a slot.
pub(super) unsafe extern "C" fn store(context: *mut NativeContext, slot: *mut u64, value: u64) {
    // SAFETY: N6: machine code has found the slot by the tests of the loop; the value is one of the program.
    unsafe {
        let (vm, _) = parts(context);
        vm.heap.store(slot.cast(), Value::from_bits(value));
    }
}

/// Returns the value of a symbol that was bound.
pub(super) unsafe extern "C" fn value_of(context: *mut NativeContext, symbol: u64) -> u64 {
    // SAFETY: V4: machine code has found the flag in a symbol that is a constant of its function.
    unsafe {
        let (vm, _) = parts(context);
        variable::bound_value(vm, Value::from_bits(symbol)).bits()
    }
}

/// Sets a symbol that was bound and is no constant.
pub(super) unsafe extern "C" fn set_value_of(context: *mut NativeContext, symbol: u64, value: u64) {
    // SAFETY: V4: machine code has found the flags in a symbol that is a constant of its function; the value
    // is one of the program.
    unsafe {
        let (vm, _) = parts(context);
        let is_set = vm.set_symbol_value(Value::from_bits(symbol), Value::from_bits(value));
        debug_assert!(is_set.is_ok(), "a symbol that is no constant");
        attend(context, vm);
    }
}

/// Makes a pair in the hole of the heap that is filled; 0 if it has no room.
pub(super) unsafe extern "C" fn cons(context: *mut NativeContext, car: u64, cdr: u64) -> u64 {
    // SAFETY: both are values of the program.
    unsafe {
        let (vm, _) = parts(context);
        vm.heap.cons_in_hole(Value::from_bits(car), Value::from_bits(cdr)).map_or(0, Value::bits)
    }
}

/// Does a `bind`.
pub(super) unsafe extern "C" fn bind(context: *mut NativeContext, pc: *const u32, base: *mut u64) -> u64 {
    // SAFETY: machine code calls this at such an instruction of the frame at `base`, all of it in its place.
    unsafe {
        let (vm, _) = parts(context);
        let signal = variable::bind(vm, pc, base.cast());
        end_binding(context, signal, pc, base)
    }
}

/// Does an `unbind`.
pub(super) unsafe extern "C" fn unbind(context: *mut NativeContext, pc: *const u32, base: *mut u64) -> u64 {
    // SAFETY: machine code calls this at such an instruction of the frame at `base`.
    unsafe {
        let (vm, _) = parts(context);
        let signal = variable::unbind(vm, pc, base.cast());
        end_binding(context, signal, pc, base)
    }
}

/// Goes on behind an instruction that binds, or leaves there.
///
/// # Safety
/// That of a helper.
unsafe fn end_binding(context: *mut NativeContext, signal: Signal, pc: *const u32, base: *mut u64) -> u64 {
    // SAFETY: N4: the contract says that the context is that of `run`, and the frame the running one.
    unsafe {
        if signal != Signal::Next {
            return leave(context, signal, pc, base.cast());
        }
        let (vm, _) = parts(context);
        attend(context, vm);
        STEP_NEXT
    }
}

/// Calls the builtin of the instruction with the arguments in its window.
///
/// # Safety
/// `pc` is at a call of a builtin in the frame at `base`.
unsafe fn call_native(vm: &mut Vm, pc: *const u32, base: *mut Value, wants_one: bool) -> Result<Value, Exit> {
    // SAFETY: V3, V5: the window holds the arguments, and the number is in the table. No builtin writes to
    // the stack or moves it.
    unsafe {
        let word = word_at(pc);
        let arguments = std::slice::from_raw_parts(base.add(word.a() + 2), word.b());
        let native = vm.natives[aux_at(pc) as usize];
        vm.cpu.set_pc(pc);
        vm.cpu.set_base(base);
        vm.cpu.wants_one = wants_one;
        native(vm, arguments)
    }
}

/// Does the instruction at `pc` in the frame at `base`.
///
/// # Safety
/// It is one of verified code, and that frame is one of the code's function.
#[allow(clippy::too_many_lines, reason = "one arm for each sort of instruction")]
unsafe fn instruction(vm: &mut Vm, pc: *const u32, base: *mut Value) -> Done {
    macro_rules! compute {
        ($operation:ident) => {
            cold::compute::<{ Opcode::$operation as u8 }>(vm, pc, base).into()
        };
    }
    macro_rules! test {
        ($operation:ident) => {
            match cold::test::<{ Opcode::$operation as u8 }>(vm, pc, base) {
                Ok(holds) => Done::Jump(holds == const { Opcode::$operation.jumps_when() }),
                Err(signal) => Done::Signal(signal),
            }
        };
    }
    // SAFETY: by the contract; what depends on data is tested, as in the arms of the loop.
    unsafe {
        let word = word_at(pc);
        let get = |register: usize| *base.add(register);
        let set = |register: usize, value: Value| {
            *base.add(register) = value;
            Done::Fast
        };
        macro_rules! mixed {
            ($operation:ident, $mixed:path) => {{
                let v = $mixed(get(word.b()), get(word.c()));
                if v != Value::UNBOUND { set(word.a(), v) } else { compute!($operation) }
            }};
        }
        let Some(opcode) = word.opcode() else { return Done::Signal(Signal::Reload) };
        match opcode {
            Opcode::Add => mixed!(Add, double::mixed_add),
            Opcode::Sub => mixed!(Sub, double::mixed_subtract),
            Opcode::Mul => mixed!(Mul, double::mixed_multiply),
            Opcode::Div => mixed!(Div, double::mixed_divide),
            Opcode::AddInt => compute!(AddInt),
            Opcode::Floor => compute!(Floor),
            Opcode::Truncate => compute!(Truncate),
            Opcode::Mod => compute!(Mod),
            Opcode::Rem => compute!(Rem),
            Opcode::LogAnd => compute!(LogAnd),
            Opcode::LogIor => compute!(LogIor),
            Opcode::LogXor => compute!(LogXor),
            Opcode::Ash => compute!(Ash),
            Opcode::NumEq => compute!(NumEq),
            Opcode::Less => compute!(Less),
            Opcode::LessEq => compute!(LessEq),
            Opcode::CharEq => compute!(CharEq),
            Opcode::Eql => set(word.a(), Value::boolean(cold::eql(vm, get(word.b()), get(word.c())))),
            Opcode::IsType => set(word.a(), Value::boolean(cold::is_type(vm, get(word.b()), word.c() as u8))),

            Opcode::JumpEql => Done::Jump(cold::eql(vm, get(word.a()), get(word.b()))),
            Opcode::JumpNotEql => Done::Jump(!cold::eql(vm, get(word.a()), get(word.b()))),
            Opcode::JumpEqlConst => Done::Jump(cold::eql(vm, get(word.a()), constant(base, word.d()))),
            Opcode::JumpNotEqlConst => Done::Jump(!cold::eql(vm, get(word.a()), constant(base, word.d()))),
            Opcode::JumpIfType => Done::Jump(cold::is_type(vm, get(word.a()), word.b() as u8)),
            Opcode::JumpIfNotType => Done::Jump(!cold::is_type(vm, get(word.a()), word.b() as u8)),
            Opcode::JumpNumEq => test!(JumpNumEq),
            Opcode::JumpNotNumEq => test!(JumpNotNumEq),
            Opcode::JumpLess => test!(JumpLess),
            Opcode::JumpNotLess => test!(JumpNotLess),
            Opcode::JumpLessEq => test!(JumpLessEq),
            Opcode::JumpNotLessEq => test!(JumpNotLessEq),
            Opcode::JumpNumEqInt => test!(JumpNumEqInt),
            Opcode::JumpNotNumEqInt => test!(JumpNotNumEqInt),
            Opcode::JumpLessInt => test!(JumpLessInt),
            Opcode::JumpNotLessInt => test!(JumpNotLessInt),
            Opcode::JumpGreaterInt => test!(JumpGreaterInt),
            Opcode::JumpNotGreaterInt => test!(JumpNotGreaterInt),
            Opcode::LoopLess => test!(LoopLess),
            Opcode::LoopNotLess => test!(LoopNotLess),
            Opcode::LoopCount => match cold::loop_count(vm, pc, base) {
                Ok(holds) => Done::Jump(holds == const { Opcode::LoopCount.jumps_when() }),
                Err(signal) => Done::Signal(signal),
            },

            Opcode::Cons => match vm.heap.cons_in_hole(get(word.b()), get(word.c())) {
                Some(v) => set(word.a(), v),
                None => compute!(Cons),
            },
            Opcode::Car => compute!(Car),
            Opcode::Cdr => compute!(Cdr),
            Opcode::Cadr => compute!(Cadr),
            Opcode::Cddr => compute!(Cddr),
            Opcode::SetCar => compute!(SetCar),
            Opcode::SetCdr => compute!(SetCdr),
            Opcode::List => cold::list(vm, pc, base).into(),

            Opcode::VectorRef => compute!(VectorRef),
            Opcode::ArrayRef => compute!(ArrayRef),
            Opcode::VectorSet => compute!(VectorSet),
            Opcode::ArraySet => compute!(ArraySet),
            Opcode::VectorRefInt => compute!(VectorRefInt),
            Opcode::VectorSetInt => compute!(VectorSetInt),
            Opcode::CharRef => compute!(CharRef),
            Opcode::Slot => cold::slot(vm, pc, base).into(),
            Opcode::SetSlot => cold::set_slot(vm, pc, base).into(),
            Opcode::JumpIfNotInstance => {
                let value = get(word.a());
                let holds = is_instance_of_exactly(value, constant(base, word.d()))
                    || (value.is_object() && cold::is_instance(vm, base, value, word.d()));
                Done::Jump(!holds)
            }

            Opcode::MakeBox => cold::make_box(vm, pc, base).into(),
            Opcode::MakeClosure => {
                let function = constant(base, word.d());
                if (*function.object_ptr()).kind == Kind::Function {
                    return set(word.a(), function);
                }
                cold::make_closure(vm, pc, base).into()
            }
            Opcode::SymbolValue => {
                let symbol = constant(base, word.d());
                let cell = symbol.object_ptr().cast::<SymbolObject>();
                let value = if (*cell).header.flags & SymbolObject::EVER_BOUND == 0 {
                    (*cell).value
                } else {
                    variable::bound_value(vm, symbol)
                };
                if value != Value::UNBOUND {
                    return set(word.a(), value);
                }
                variable::symbol_value(vm, pc, base).into()
            }
            Opcode::SetSymbolValue => variable::set_symbol_value(vm, pc, base).into(),
            Opcode::Bind => variable::bind(vm, pc, base).into(),
            Opcode::Unbind => variable::unbind(vm, pc, base).into(),
            Opcode::BindList => unwind::bind_list(vm, pc, base).into(),
            Opcode::FunctionRef => variable::function_ref(vm, pc, base).into(),

            // The values of a return are set without a look at what was charged.
            Opcode::ReturnValues => {
                cold::set_values(vm, pc, base);
                Done::Fast
            }
            Opcode::SetValues => cold::set_values(vm, pc, base).into(),
            Opcode::GetValues => cold::get_values(vm, pc, base).into(),
            Opcode::ValuesToList => cold::values_to_list(vm, pc, base).into(),
            Opcode::ListToValues => cold::list_to_values(vm, pc, base).into(),

            Opcode::NewTag => unwind::new_tag(vm, pc, base).into(),
            Opcode::PushCatch => unwind::push_catch(vm, pc, base).into(),
            Opcode::PushCleanup => unwind::push_cleanup(vm, pc, base).into(),
            Opcode::PushHandlerCase => unwind::push_handler_case(vm, pc, base).into(),
            Opcode::PushRecovery => unwind::push_recovery(vm, pc, base).into(),
            Opcode::PushFailureCleanup => unwind::push_failure_cleanup(vm, pc, base).into(),
            Opcode::PushHandlers => unwind::push_handlers(vm, pc, base).into(),
            Opcode::PushMask => unwind::push_mask(vm, pc, base).into(),
            Opcode::PushScope => unwind::push_scope(vm, pc, base).into(),
            Opcode::PopControl => unwind::pop(vm, pc, base).into(),
            Opcode::EnterCleanup => unwind::enter_cleanup(vm, pc, base).into(),
            Opcode::EndCleanup => unwind::end_cleanup(vm, pc, base).into(),

            Opcode::Pass => {
                cold::pass(vm, pc);
                Done::Fast
            }

            // Machine code does these itself, or leaves at them.
            Opcode::Move
            | Opcode::LoadInt
            | Opcode::LoadConst
            | Opcode::LoadNil
            | Opcode::LoadTrue
            | Opcode::Not
            | Opcode::Eq
            | Opcode::JumpAlways
            | Opcode::JumpIfNil
            | Opcode::JumpIfNotNil
            | Opcode::JumpIfCons
            | Opcode::JumpIfNotCons
            | Opcode::JumpIfSupplied
            | Opcode::JumpEq
            | Opcode::JumpNotEq
            | Opcode::Loop
            | Opcode::LoopIfNil
            | Opcode::LoopIfNotNil
            | Opcode::LoopIfCons
            | Opcode::BoxRef
            | Opcode::BoxSet
            | Opcode::PatchCapture
            | Opcode::CaptureRef
            | Opcode::CaptureBoxRef
            | Opcode::CaptureBoxSet
            | Opcode::Call
            | Opcode::CallGlobal
            | Opcode::CallSelf
            | Opcode::CallBuiltin
            | Opcode::Apply
            | Opcode::TailApply
            | Opcode::TailCall
            | Opcode::TailCallGlobal
            | Opcode::TailCallBuiltin
            | Opcode::Return
            | Opcode::ReturnAll
            | Opcode::Throw => Done::Signal(Signal::Reload),
        }
    }
}
