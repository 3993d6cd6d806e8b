//! The slow parts of instructions: each decodes its operands again, does its work, and writes its own result, so that
//! the loop passes three registers and expects nothing back but a [`Signal`].
//!
//! Every function here has the contract of [`super::settle`]: `pc` is at an instruction of the row it serves, `base` is
//! the running frame's, and what the verifier proved holds (V1 to V13).

use esl_bytecode::builtin::Builtin;
use esl_bytecode::module::CaptureSource;
use esl_bytecode::opcode::TypeCode;

use super::arguments::MAX_SPREAD;
use super::{Operation, Signal, aux_at, code_of, constant, constants_of, failure, operation, word_at};
use crate::heap::layout::{Code, Function, Kind};
use crate::number;
use crate::raise::{Exit, Expected, Outcome, Raised};
use crate::shape::capture_source;
use crate::types;
use crate::value::Value;
use crate::vm::{Native, Vm};
use crate::world::class;

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

/// The builtin that does what an instruction does.
fn builtin(operation: Operation) -> Builtin {
    match operation {
        Operation::Add | Operation::AddInt => Builtin::Add,
        Operation::Sub => Builtin::Subtract,
        Operation::Mul => Builtin::Multiply,
        Operation::Div => Builtin::Divide,
        Operation::Floor => Builtin::Floor,
        Operation::Truncate => Builtin::Truncate,
        Operation::Mod => Builtin::Mod,
        Operation::Rem => Builtin::Rem,
        Operation::LogAnd => Builtin::LogAnd,
        Operation::LogIor => Builtin::LogIor,
        Operation::LogXor => Builtin::LogXor,
        Operation::Ash => Builtin::Ash,
        Operation::CharEq => Builtin::CharEqualExactly,
        Operation::CharRef => Builtin::Char,
        Operation::VectorRef => Builtin::Svref,
        Operation::VectorSet => Builtin::SetSvref,
        Operation::ArrayRef => Builtin::Aref,
        Operation::ArraySet => Builtin::SetAref,
        _ => unreachable!("these instructions have no builtin"),
    }
}

/// The implementation of the builtin that does what an instruction does.
fn native(vm: &Vm, operation: Operation) -> Native {
    vm.natives[builtin(operation) as usize]
}

/// Has the ESL twin of a builtin do what is too much work for one instruction: its call takes the instruction's place.
#[cold]
fn ask_twin(vm: &mut Vm, builtin: Builtin, arguments: &[Value]) -> Outcome {
    let function = vm.twin_of(builtin.info())?;
    vm.exchange.request_call(function, arguments);
    Err(Exit::Call)
}

/// Arithmetic, comparisons that give a value, and characters.
#[cold]
#[inline(never)]
pub(super) unsafe fn arithmetic(vm: &mut Vm, pc: *const u32, base: *mut Value) -> Signal {
    // SAFETY: V1, V3: the operands of the instruction at `pc` are registers of the frame at `base`.
    unsafe {
        let word = word_at(pc);
        let (dst, b, c) = (word.a(), word.b(), word.c());
        let left = *base.add(b);
        if operation(word) == Operation::AddInt {
            let outcome = number::add(vm, left, Value::small(word.signed_c()));
            return finish(base, dst, outcome);
        }
        let right = *base.add(c);
        let outcome = match operation(word) {
            Operation::Add => number::add(vm, left, right),
            Operation::Sub => number::subtract(vm, left, right),
            Operation::Mul => number::multiply(vm, left, right),
            Operation::Div => number::divide(vm, left, right),
            Operation::NumEq => number::num_equal(vm, left, right).map(Value::boolean),
            Operation::Less => number::less(vm, left, right).map(Value::boolean),
            Operation::LessEq => number::less_or_equal(vm, left, right).map(Value::boolean),
            operation => native(vm, operation)(vm, &[left, right]),
        };
        let outcome = match outcome {
            // Of quotient and remainder the instruction wants the first.
            Err(Exit::Values) => Ok(vm.exchange.values.first().copied().unwrap_or(Value::NIL)),
            Err(Exit::Slowly) => ask_twin(vm, builtin(operation(word)), &[left, right]),
            outcome => outcome,
        };
        finish(base, dst, outcome)
    }
}

/// Comparisons that jump, and the counting loop: whether they hold.
#[cold]
#[inline(never)]
pub(super) unsafe fn compare(vm: &mut Vm, pc: *const u32, base: *mut Value) -> Result<bool, Signal> {
    // SAFETY: V1, V3: the operands of the instruction at `pc` are registers of the frame at `base`.
    unsafe {
        let word = word_at(pc);
        let (a, b) = (word.a(), word.b());
        let left = *base.add(a);
        let int = Value::small(word.signed_d());
        let result = match operation(word) {
            Operation::JumpNumEq | Operation::JumpNotNumEq => number::num_equal(vm, left, *base.add(b)),
            Operation::JumpLess | Operation::JumpNotLess | Operation::LoopLess | Operation::LoopNotLess => {
                number::less(vm, left, *base.add(b))
            }
            Operation::JumpLessEq | Operation::JumpNotLessEq => number::less_or_equal(vm, left, *base.add(b)),
            Operation::JumpNumEqInt | Operation::JumpNotNumEqInt => number::num_equal(vm, left, int),
            Operation::JumpLessInt | Operation::JumpNotLessInt => number::less(vm, left, int),
            Operation::JumpGreaterInt | Operation::JumpNotGreaterInt => number::less(vm, int, left),
            _ => {
                // The counting loop: nothing is stored before the comparison has come out well.
                let step = Value::small(word.signed_c());
                let limit = *base.add(b);
                number::add(vm, left, step).and_then(|sum| {
                    let holds = number::less(vm, sum, limit)?;
                    *base.add(a) = sum;
                    Ok(holds)
                })
            }
        };
        result.map_err(Signal::Exit)
    }
}

/// Whether two values are `eql`.
#[inline(always)]
pub(super) fn eql(vm: &Vm, a: Value, b: Value) -> bool {
    a == b || (a.is_object() && b.is_object() && eql_objects(vm, a, b))
}

#[cold]
#[inline(never)]
fn eql_objects(vm: &Vm, a: Value, b: Value) -> bool {
    number::eql(&vm.heap, a, b)
}

/// Whether `value` is of the type with this code.
#[inline(always)]
pub(super) fn is_type(vm: &Vm, value: Value, code: u8) -> bool {
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

/// `cons` when the hole is full.
#[cold]
#[inline(never)]
pub(super) unsafe fn cons(vm: &mut Vm, pc: *const u32, base: *mut Value) -> Signal {
    // SAFETY: V1, V3: the operands of the instruction at `pc` are registers of the frame at `base`.
    unsafe {
        let word = word_at(pc);
        let (dst, b, c) = (word.a(), word.b(), word.c());
        let outcome = vm.heap.cons(*base.add(b), *base.add(c)).map_err(Exit::from);
        finish(base, dst, outcome)
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

/// The parts of lists, of what is no pair.
#[cold]
#[inline(never)]
pub(super) unsafe fn list_part(vm: &mut Vm, pc: *const u32, base: *mut Value) -> Signal {
    // SAFETY: V1, V3: the operands of the instruction at `pc` are registers of the frame at `base`.
    unsafe {
        let word = word_at(pc);
        let (a, b) = (word.a(), word.b());
        let part = match operation(word) {
            Operation::SetCar | Operation::SetCdr => {
                return failure(vm, Raised::Type(*base.add(a), Expected::Type("CONS")));
            }
            Operation::Cadr | Operation::Cddr => {
                let list = *base.add(b);
                let rest = if list.is_nil() { Some(list) } else { vm.heap.cdr(list) };
                match rest {
                    Some(rest) if rest.is_nil() => Ok(rest),
                    Some(rest) => vm.exchange.type_error(rest, "LIST"),
                    None => vm.exchange.type_error(list, "LIST"),
                }
            }
            _ if (*base.add(b)).is_nil() => Ok(Value::NIL),
            _ => vm.exchange.type_error(*base.add(b), "LIST"),
        };
        finish(base, a, part)
    }
}

/// References to arrays that are no simple vectors, or with a wrong index.
#[cold]
#[inline(never)]
pub(super) unsafe fn array(vm: &mut Vm, pc: *const u32, base: *mut Value) -> Signal {
    // SAFETY: V1, V3: the operands of the instruction at `pc` are registers of the frame at `base`.
    unsafe {
        let word = word_at(pc);
        let (a, b, c) = (word.a(), word.b(), word.c());
        let (x, y, z) = (*base.add(a), *base.add(b), *base.add(c));
        match operation(word) {
            operation @ (Operation::VectorRef | Operation::ArrayRef) => {
                let outcome = native(vm, operation)(vm, &[y, z]);
                finish(base, a, outcome)
            }
            operation => match native(vm, operation)(vm, &[x, y, z]) {
                Ok(_) => Signal::Next,
                Err(exit) => Signal::Exit(exit),
            },
        }
    }
}

/// Slots: the first time at a place, of instances of subclasses, and of what is no instance.
#[cold]
#[inline(never)]
pub(super) unsafe fn slot(vm: &mut Vm, pc: *const u32, base: *mut Value) -> Signal {
    // SAFETY: V1, V3: there is an aux word, and the operands are registers of the frame; V4: the aux word
    // is a constant for a class.
    unsafe {
        let word = word_at(pc);
        let (a, b, c) = (word.a(), word.b(), word.c());
        let class = class_constant(vm, base, aux_at(pc) as usize);
        let reads = operation(word) == Operation::Slot;
        let (instance, slot) = if reads { (*base.add(b), c) } else { (*base.add(a), b) };
        let has_slot = vm.heap.structure_slots(instance).is_some_and(|slots| slot < slots.len());
        if !has_slot || !vm.world.is_instance(&vm.heap, instance, class) {
            let raised = Raised::Type(instance, Expected::Specifier(class::name_of(&vm.heap, class)));
            return failure(vm, raised);
        }
        if reads {
            let value = vm.heap.structure_slots(instance).map_or(Value::NIL, |slots| slots[slot]);
            *base.add(a) = value;
        } else {
            vm.heap.structure_set(instance, slot, *base.add(c));
        }
        Signal::Next
    }
}

/// Whether `value` is an instance of the class that is constant `index`, or of a subclass.
///
/// # Safety
/// The frame at `base` is the running one, and constant `index` of its function is for a class.
#[cold]
#[inline(never)]
pub(super) unsafe fn is_instance(vm: &mut Vm, base: *mut Value, value: Value, index: usize) -> bool {
    // SAFETY: the contract is that of `class_constant`.
    let class = unsafe { class_constant(vm, base, index) };
    vm.world.is_instance(&vm.heap, value, class)
}

/// The class that is a constant of the running function. As loaded the constant is the name of the class; the class, as
/// it is now, is put in its place, also when the class of that name has become another one.
///
/// # Safety
/// The frame at `base` is the running one, and constant `index` of its function is for a class.
unsafe fn class_constant(vm: &mut Vm, base: *mut Value, index: usize) -> Value {
    // SAFETY: F2: the running function is below the registers; by the contract its code has such a constant,
    // and nobody else looks at it meanwhile.
    unsafe {
        let constant = constants_of(code_of(*base.sub(2))).add(index).cast_mut();
        let name =
            if vm.heap.is(*constant, Kind::Class) { class::name_of(&vm.heap, *constant) } else { *constant };
        if let Some(class) = vm.world.find_class(name)
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

/// The closure of `code` made in the frame at `base`.
///
/// # Safety
/// `make-closure` may stand where that frame is: V8.
pub(super) unsafe fn closure(vm: &mut Vm, code: Value, base: *mut Value) -> Result<Value, Exit> {
    // SAFETY: by the contract `code` is the Code of a function with captures, which ends with a word for each
    // (`shape`); V8: the registers and captures that these words name are there. All captures are written
    // before the value is made.
    unsafe {
        let running = *base.sub(2);
        let layout = code.object_ptr().cast::<Code>();
        let count = (*layout).spare[1] as usize;
        let closure = vm.heap.alloc_closure(code, count)?;
        let sources = layout.byte_add((*layout).words_offset()).cast::<u32>();
        let sources = sources.add((*layout).nwords as usize - count);
        let captures = (&raw mut (*closure).captures).cast::<Value>();
        let own = (&raw const (*running.object_ptr().cast::<Function>()).captures).cast::<Value>();
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
        return failure(vm, Raised::Type(list, Expected::Type("LIST")));
    }
    Signal::Next
}
