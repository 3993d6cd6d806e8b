//! The slow halves of instructions, which the rows of the opcode table name.
//!
//! Most decode their operands again, do their work, and write their own result, so that the loop passes three
//! registers and expects nothing back but a [`Signal`]. Those that are the whole of a short arm take the
//! instruction word, the frame and the constants from the loop, and return what the loop makes of them.
//!
//! Every function here has the contract of [`super::settle`]: `pc` is at an instruction of the row it serves,
//! `base` is the running frame's, `k` are the constants of its function, and what the verifier proved holds
//! (V1 to V14).

use esl_bytecode::builtin::Builtin;
use esl_bytecode::module::CaptureSource;
use esl_bytecode::opcode::{Instr, Opcode, TypeCode};
use esl_bytecode::operand::Role;
use esl_bytecode::word::Word;

use super::arguments::MAX_SPREAD;
use super::{Signal, aux_at, code_of, constant, constants_of, failure, is_instance_of_exactly, word_at};
use crate::heap::layout::{CodeObject, FunctionObject, Kind};
use crate::names::class;
use crate::number;
use crate::raise::{Exit, Expected, Outcome, Raised};
use crate::shape::capture_source;
use crate::types;
use crate::value::Value;
use crate::vm::Vm;

/// Puts an outcome into register `dst`.
///
/// # Safety
/// The frame at `base` has such a register.
unsafe fn finish(base: *mut Value, dst: usize, outcome: Outcome) -> Signal {
    match outcome {
        Ok(value) => {
            // SAFETY: by the contract, the register lies in the frame.
            unsafe { *base.add(dst) = value };
            Signal::Next
        }
        Err(exit) => Signal::Exit(exit),
    }
}

/// Returns the opcode with this number.
const fn opcode(number: u8) -> Opcode {
    match Opcode::from_number(number) {
        Some(opcode) => opcode,
        None => panic!("no opcode has this number"),
    }
}

/// Returns the builtin that the row of an opcode names.
const fn builtin(opcode: Opcode) -> Builtin {
    match opcode.builtin() {
        Some(builtin) => builtin,
        None => panic!("the row of this instruction names no builtin"),
    }
}

/// The largest number of arguments that an instruction gives its builtin.
const MAX_ARGUMENTS: usize = 3;

/// Calls the builtin that the row of an instruction names. Returns the outcome, and the register for it.
///
/// # Safety
/// See the module's header; `pc` is at an instruction with this opcode.
#[inline(always)]
unsafe fn apply_builtin<const OPCODE: u8>(
    vm: &mut Vm,
    pc: *const u32,
    base: *mut Value,
) -> (Outcome, Option<u8>) {
    let builtin = const { builtin(opcode(OPCODE)) };
    let mut arguments = [Value::NIL; MAX_ARGUMENTS];
    let (mut count, mut dst) = (0, None);
    // SAFETY: by the contract; V1 for the aux word, V3 for the registers.
    unsafe {
        let aux = if const { opcode(OPCODE).words() } == 2 { aux_at(pc) } else { 0 };
        Instr::from_words(const { opcode(OPCODE) }, *pc, aux).visit_operands(|role| {
            let argument = match role {
                Role::Read(register) => *base.add(usize::from(register)),
                Role::Number(number) => Value::small(number),
                Role::Write(register) => return dst = Some(register),
                _ => return,
            };
            arguments[count] = argument;
            count += 1;
        });
    }
    let arguments = &arguments[..count];
    let outcome = match (builtin, arguments) {
        (Builtin::Add, &[x, y]) => number::add(vm, x, y),
        (Builtin::Subtract, &[x, y]) => number::subtract(vm, x, y),
        (Builtin::Multiply, &[x, y]) => number::multiply(vm, x, y),
        (Builtin::Divide, &[x, y]) => number::divide(vm, x, y),
        (Builtin::NumEqual, &[x, y]) => number::num_equal(vm, x, y).map(Value::boolean),
        (Builtin::Less, &[x, y]) => number::less(vm, x, y).map(Value::boolean),
        (Builtin::LessEqual, &[x, y]) => number::less_or_equal(vm, x, y).map(Value::boolean),
        (Builtin::Greater, &[x, y]) => number::less(vm, y, x).map(Value::boolean),
        _ => vm.natives[builtin as usize](vm, arguments),
    };
    let outcome = match outcome {
        // Of quotient and remainder the instruction wants the first.
        Err(Exit::Values) => Ok(vm.exchange.values.first().copied().unwrap_or(Value::NIL)),
        Err(Exit::Slowly) => ask_twin(vm, builtin, arguments),
        outcome => outcome,
    };
    (outcome, dst)
}

/// Requests a call of a builtin's ESL twin in place of an instruction that is too much work.
#[cold]
fn ask_twin(vm: &mut Vm, builtin: Builtin, arguments: &[Value]) -> Outcome {
    let function = vm.twin_of(builtin.info())?;
    vm.exchange.request_call(function, arguments);
    Err(Exit::Call)
}

/// An instruction with a result, or for effect, that is a builtin.
///
/// # Safety
/// See the module's header; `pc` is at an instruction with this opcode.
#[cold]
#[inline(never)]
pub(super) unsafe fn compute<const OPCODE: u8>(vm: &mut Vm, pc: *const u32, base: *mut Value) -> Signal {
    // SAFETY: by the contract; V3: the result goes to a register of the frame.
    unsafe {
        match apply_builtin::<OPCODE>(vm, pc, base) {
            (Ok(value), dst) => {
                if let Some(register) = dst {
                    *base.add(usize::from(register)) = value;
                }
                Signal::Next
            }
            (Err(exit), _) => Signal::Exit(exit),
        }
    }
}

/// A test that is a builtin: whether it holds.
///
/// # Safety
/// See the module's header; `pc` is at an instruction with this opcode.
#[cold]
#[inline(never)]
pub(super) unsafe fn test<const OPCODE: u8>(
    vm: &mut Vm,
    pc: *const u32,
    base: *mut Value,
) -> Result<bool, Signal> {
    // SAFETY: `pc` is at an instruction with this opcode, and `base` at its frame, as the caller promises.
    let (outcome, _) = unsafe { apply_builtin::<OPCODE>(vm, pc, base) };
    outcome.map(Value::is_true).map_err(Signal::Exit)
}

/// `loop-count`: whether it jumps. Nothing is stored before the comparison has come out well.
///
/// # Safety
/// See the module's header.
#[cold]
#[inline(never)]
pub(super) unsafe fn loop_count(vm: &mut Vm, pc: *const u32, base: *mut Value) -> Result<bool, Signal> {
    // SAFETY: V1, V3: the operands of the instruction at `pc` are registers of the frame at `base`.
    unsafe {
        let word = word_at(pc);
        let (counter, limit) = (base.add(word.a()), *base.add(word.b()));
        let sum = number::add(vm, *counter, Value::small(word.signed_c())).map_err(Signal::Exit)?;
        let holds = number::less(vm, sum, limit).map_err(Signal::Exit)?;
        *counter = sum;
        Ok(holds)
    }
}

/// `eql`.
///
/// # Safety
/// See the module's header.
#[inline(always)]
pub(super) unsafe fn eql(vm: &Vm, word: Word, base: *mut Value, _k: *const Value) -> Value {
    // SAFETY: V3: the operands are registers of the frame.
    unsafe { Value::boolean(are_eql(vm, *base.add(word.b()), *base.add(word.c()))) }
}

/// `jump-eql` and `jump-not-eql`: whether the values are `eql`.
///
/// # Safety
/// See the module's header.
#[inline(always)]
pub(super) unsafe fn jump_eql(vm: &Vm, word: Word, base: *mut Value, _k: *const Value) -> bool {
    // SAFETY: V3: the operands are registers of the frame.
    unsafe { are_eql(vm, *base.add(word.a()), *base.add(word.b())) }
}

/// `jump-eql-const` and `jump-not-eql-const`: whether the value is `eql` to the constant.
///
/// # Safety
/// See the module's header.
#[inline(always)]
pub(super) unsafe fn jump_eql_const(vm: &Vm, word: Word, base: *mut Value, k: *const Value) -> bool {
    // SAFETY: V3: the operand is a register of the frame; V4: the constant is there.
    unsafe { are_eql(vm, *base.add(word.a()), *k.add(word.d())) }
}

/// Returns whether two values are `eql`.
#[inline(always)]
fn are_eql(vm: &Vm, a: Value, b: Value) -> bool {
    let is_number = |object| vm.heap.kind(object).is_some_and(Kind::is_boxed_number);
    a == b || (a.is_object() && b.is_object() && is_number(b) && eql_numbers(vm, a, b))
}

#[cold]
#[inline(never)]
fn eql_numbers(vm: &Vm, a: Value, b: Value) -> bool {
    number::eql(&vm.heap, a, b)
}

/// `is-type`.
///
/// # Safety
/// See the module's header.
#[inline(always)]
pub(super) unsafe fn is_type(vm: &Vm, word: Word, base: *mut Value, _k: *const Value) -> Value {
    // SAFETY: V3: the operand is a register of the frame.
    unsafe { Value::boolean(is_of_type(vm, *base.add(word.b()), word.c() as u8)) }
}

/// `jump-if-type` and `jump-if-not-type`: whether the value is of the type.
///
/// # Safety
/// See the module's header.
#[inline(always)]
pub(super) unsafe fn jump_if_type(vm: &Vm, word: Word, base: *mut Value, _k: *const Value) -> bool {
    // SAFETY: V3: the operand is a register of the frame.
    unsafe { is_of_type(vm, *base.add(word.a()), word.b() as u8) }
}

/// Returns whether `value` is of the type with this code.
#[inline(always)]
fn is_of_type(vm: &Vm, value: Value, code: u8) -> bool {
    // The commonest tests of immediate values need no look at the heap.
    match TypeCode::from_number(code) {
        Some(TypeCode::Cons) => value.is_cons(),
        Some(TypeCode::Atom) => !value.is_cons(),
        Some(TypeCode::List) => value.is_list(),
        Some(TypeCode::Null) => value.is_nil(),
        Some(TypeCode::Fixnum) => value.is_fixnum(),
        Some(TypeCode::Character) => value.is_character(),
        Some(code) => types::has_type_code(&vm.heap, value, code),
        None => false,
    }
}

/// `list`.
#[inline(never)]
pub(super) unsafe fn list(vm: &mut Vm, pc: *const u32, base: *mut Value) -> Signal {
    // SAFETY: V3: `dst` and all items are registers of the frame at `base`.
    unsafe {
        let word = word_at(pc);
        let (dst, first, count) = (word.a(), word.b(), word.c());
        let mut rest = Value::NIL;
        for i in (0..count).rev() {
            rest = match vm.heap.cons(*base.add(first + i), rest) {
                Ok(cons) => cons,
                Err(error) => return Signal::Exit(error.into()),
            };
        }
        *base.add(dst) = rest;
        Signal::Next
    }
}

/// `slot` of an instance of a subclass or of another object, and the first `slot` at a place.
#[cold]
#[inline(never)]
pub(super) unsafe fn slot(vm: &mut Vm, pc: *const u32, base: *mut Value) -> Signal {
    // SAFETY: V1, V3: there is an aux word, and the operands are registers of the frame; V4: the aux word
    // is a constant for a class.
    unsafe {
        let word = word_at(pc);
        let (instance, slot) = (*base.add(word.b()), word.c());
        let class = class_constant(vm, base, aux_at(pc) as usize);
        if let Err(signal) = expect_slot(vm, instance, slot, class) {
            return signal;
        }
        *base.add(word.a()) = vm.heap.structure_slots(instance).map_or(Value::NIL, |slots| slots[slot]);
        Signal::Next
    }
}

/// `set-slot`, as [`slot`].
#[cold]
#[inline(never)]
pub(super) unsafe fn set_slot(vm: &mut Vm, pc: *const u32, base: *mut Value) -> Signal {
    // SAFETY: V1 and V3: an instruction with its aux word, its registers in the frame; V4: a class constant.
    unsafe {
        let word = word_at(pc);
        let (instance, slot) = (*base.add(word.a()), word.b());
        let class = class_constant(vm, base, aux_at(pc) as usize);
        if let Err(signal) = expect_slot(vm, instance, slot, class) {
            return signal;
        }
        vm.heap.structure_set(instance, slot, *base.add(word.c()));
        Signal::Next
    }
}

/// Fails unless `instance` is one of the class, or of a subclass, and has that slot.
fn expect_slot(vm: &mut Vm, instance: Value, slot: usize, class: Value) -> Result<(), Signal> {
    let has_slot = vm.heap.structure_slots(instance).is_some_and(|slots| slot < slots.len());
    if has_slot && vm.names.is_instance(&vm.heap, instance, class) {
        return Ok(());
    }
    let expected = Expected::Specifier(class::name_of(&vm.heap, class));
    Err(failure(vm, Raised::Type(instance, expected)))
}

/// `jump-if-not-instance`: whether the value is an instance of the class, or of a subclass.
///
/// # Safety
/// See the module's header.
#[inline(always)]
pub(super) unsafe fn jump_if_instance(vm: &mut Vm, word: Word, base: *mut Value, k: *const Value) -> bool {
    // SAFETY: V3: the operand is a register of the frame; V4: the constant is for a class.
    unsafe {
        let value = *base.add(word.a());
        is_instance_of_exactly(value, *k.add(word.d()))
            || (value.is_object() && is_instance(vm, base, value, word.d()))
    }
}

/// Returns whether `value` is an instance of the class that is constant `index`, or of a subclass.
///
/// # Safety
/// The frame at `base` is the running one, and constant `index` of its function is for a class.
#[cold]
#[inline(never)]
unsafe fn is_instance(vm: &mut Vm, base: *mut Value, value: Value, index: usize) -> bool {
    // SAFETY: by the contract the frame at `base` runs, and the constant is for a class.
    let class = unsafe { class_constant(vm, base, index) };
    vm.names.is_instance(&vm.heap, value, class)
}

/// Returns the class that is a constant of the running function. As loaded the constant is the name of the
/// class; the class, as it is now, is put in its place, also when the class of that name has become another
/// one.
///
/// # Safety
/// The frame at `base` is the running one, and constant `index` of its function is for a class.
unsafe fn class_constant(vm: &mut Vm, base: *mut Value, index: usize) -> Value {
    // SAFETY: F2: the running function is below the registers; by the contract its code has such a constant,
    // and nothing else refers to it meanwhile.
    unsafe {
        let constant = constants_of(code_of(*base.sub(2))).add(index).cast_mut();
        let name =
            if vm.heap.is(*constant, Kind::Class) { class::name_of(&vm.heap, *constant) } else { *constant };
        if let Some(class) = vm.names.find_class(name)
            && class != *constant
        {
            vm.heap.store(constant, class);
        }
        *constant
    }
}

/// `make-box`.
#[inline(never)]
pub(super) unsafe fn make_box(vm: &mut Vm, pc: *const u32, base: *mut Value) -> Signal {
    // SAFETY: V1, V3: the operands of the instruction at `pc` are registers of the frame at `base`.
    unsafe {
        let word = word_at(pc);
        let (dst, src) = (word.a(), word.b());
        let outcome = vm.heap.alloc_box(*base.add(src)).map_err(Exit::from);
        finish(base, dst, outcome)
    }
}

/// `make-closure` of a function with captures.
#[inline(never)]
pub(super) unsafe fn make_closure(vm: &mut Vm, pc: *const u32, base: *mut Value) -> Signal {
    // SAFETY: V3: `dst` is a register of the frame; V4, V8: the constant is the code of a function with
    // captures, and the frame has what they are taken from.
    unsafe {
        let word = word_at(pc);
        let dst = word.a();
        let code = constant(base, word.d());
        match closure(vm, code, base) {
            Ok(closure) => {
                *base.add(dst) = closure;
                Signal::Next
            }
            Err(exit) => Signal::Exit(exit),
        }
    }
}

/// Returns the closure of `code` made in the frame at `base`.
///
/// # Safety
/// `make-closure` may stand where that frame is: V8.
pub(super) unsafe fn closure(vm: &mut Vm, code: Value, base: *mut Value) -> Result<Value, Exit> {
    // SAFETY: by the contract `code` is the Code of a function with captures, which ends with a word for each
    // (`shape`); V8: the registers and captures that these words name are there. All captures are written
    // before the value is made.
    unsafe {
        let running = *base.sub(2);
        let layout = code.object_ptr().cast::<CodeObject>();
        let count = (*layout).spare[1] as usize;
        let closure = vm.heap.alloc_closure(code, count)?;
        let sources = layout.byte_add((*layout).words_offset()).cast::<u32>();
        let sources = sources.add((*layout).nwords as usize - count);
        let captures = (&raw mut (*closure).captures).cast::<Value>();
        let own = (&raw const (*running.object_ptr().cast::<FunctionObject>()).captures).cast::<Value>();
        for i in 0..count {
            let value = match capture_source(*sources.add(i)) {
                CaptureSource::Register(register) => *base.add(usize::from(register)),
                CaptureSource::Capture(index) => *own.add(usize::from(index)),
                CaptureSource::Later => Value::NIL,
            };
            // An initialising store needs no barrier.
            *captures.add(i) = value;
        }
        Ok(Value::from_object(closure.cast()))
    }
}

/// `set-values` and the values of `return-values`.
#[inline(never)]
pub(super) unsafe fn set_values(vm: &mut Vm, pc: *const u32, base: *mut Value) -> Signal {
    // SAFETY: V3: the values are registers of the frame at `base`, whose words are initialised (F4).
    unsafe {
        let word = word_at(pc);
        let (first, count) = (word.a(), word.b());
        vm.exchange.values.clear();
        vm.exchange.values.extend_from_slice(std::slice::from_raw_parts(base.add(first), count));
    }
    Signal::Next
}

/// `get-values`.
#[inline(never)]
pub(super) unsafe fn get_values(vm: &mut Vm, pc: *const u32, base: *mut Value) -> Signal {
    // SAFETY: V3: the registers that receive the values are of the frame at `base`.
    unsafe {
        let word = word_at(pc);
        let (first, count) = (word.a(), word.b());
        for i in 0..count {
            *base.add(first + i) = vm.exchange.values.get(i).copied().unwrap_or(Value::NIL);
        }
    }
    Signal::Next
}

/// `pass`.
#[inline(never)]
pub(super) unsafe fn pass(vm: &mut Vm, pc: *const u32, _base: *mut Value) -> Signal {
    // SAFETY: by the contract there is an instruction at `pc`.
    let place = unsafe { word_at(pc) }.signed_e();
    vm.watch.note_passage(usize::try_from(place & PLACES).unwrap_or_default());
    Signal::Next
}

/// The bits of the operand of `pass`.
const PLACES: i32 = 0xFF_FFFF;

/// `values-to-list`.
#[inline(never)]
pub(super) unsafe fn values_to_list(vm: &mut Vm, pc: *const u32, base: *mut Value) -> Signal {
    vm.exchange.charge(vm.exchange.values.len());
    let outcome = vm.heap.list(&vm.exchange.values).map_err(Exit::from);
    // SAFETY: V3: `dst` is a register of the frame at `base`.
    unsafe { finish(base, word_at(pc).a(), outcome) }
}

/// `list-to-values`.
#[inline(never)]
pub(super) unsafe fn list_to_values(vm: &mut Vm, pc: *const u32, base: *mut Value) -> Signal {
    // SAFETY: V3: the operand is a register of the frame at `base`.
    let list = unsafe { *base.add(word_at(pc).a()) };
    vm.exchange.values.clear();
    let mut rest = list;
    while rest.is_cons() {
        if vm.exchange.values.len() == MAX_SPREAD {
            let text = format!("more than {} values", MAX_SPREAD);
            return failure(vm, Raised::Program(text));
        }
        vm.exchange.values.push(vm.heap.car(rest).unwrap_or(Value::NIL));
        rest = vm.heap.cdr(rest).unwrap_or(Value::NIL);
    }
    vm.exchange.charge(vm.exchange.values.len());
    if rest.is_true() {
        return failure(vm, Raised::Type(rest, Expected::Type("LIST")));
    }
    Signal::Next
}
