//! The first frame of a task, and what is left on its stacks when it has ended.

use esl_bytecode::module::Parameters;
use esl_bytecode::opcode::Instr;
use esl_bytecode::operand::{Count, Pad, Window};

use super::collect::LARGE_STACK;
use super::reserve::stack_end;
use super::{code_of, first_instruction, stubs};
use crate::heap::layout::CodeObject;
use crate::heap::{AllocError, CodeParts, Heap};
use crate::saved_pc::SavedPc;
use crate::shape::{Shape, Sort};
use crate::stack::Stack;
use crate::task::LazyControl;
use crate::task::Task;
use crate::value::Value;
use crate::vm::Vm;

/// Offset in a task's stack of the base of the frame in which the stub at the end of the task runs.
const EXIT_BASE: u32 = 2;

/// Words of a stack with nothing but that frame: its link and the registers of the starter.
const EXIT_WORDS: usize = 5;

/// Offset in a task's stack of the base of its first frame.
pub(super) const FIRST_BASE: u32 = 4;

/// Words of the stack of a task that begins with `function` and the list of `arguments`.
pub(crate) fn first_words(heap: &Heap, function: Value, arguments: Value) -> usize {
    4 + direct_code(heap, function, arguments).map_or(3, |code| code.nregs as usize)
}

/// Returns the code of `function`, if it can be entered without arguments just as it is.
fn direct_code(heap: &Heap, function: Value, arguments: Value) -> Option<&CodeObject> {
    let code = heap.code(heap.function_code(function)?)?;
    (arguments.is_nil() && code.arity == 0 && Shape::unpack(code.spare[0]).sort == Sort::Bytecode)
        .then_some(code)
}

/// Makes the first frame of a new task: that of `function`, or that of a starter, which calls the function
/// with the list of arguments.
pub(crate) fn first_frame(heap: &Heap, task: &mut Task, starter: Value, function: Value, arguments: Value) {
    let stub = stubs::task_exit();
    if direct_code(heap, function, arguments).is_some() {
        // SAFETY: the task was made with `first_words`: room for two links and the registers of this code.
        // The stub's address has the low bits of a fixnum.
        unsafe {
            let start = task.stack.start();
            *start = starter;
            *start.add(1) = first_code(heap, function);
            *start.add(2) = function;
            *start.add(3) = Value::from_bits(stub.expose_provenance() as u64);
        }
        // SAFETY: `direct_code` has found the Code of this Function.
        let first = unsafe { first_instruction(code_of(function)) };
        task.pc = SavedPc::new(first);
        task.base = FIRST_BASE;
        return;
    }
    // SAFETY: the task was made with `first_words`: room for two links and the three registers of the
    // starter, a Function of bytecode. The stub's address has the low bits of a fixnum.
    unsafe {
        let start = task.stack.start();
        // A link for the frame that the stub at the end of the task runs in.
        *start = starter;
        *start.add(1) = first_code(heap, function);
        *start.add(2) = starter;
        *start.add(3) = Value::from_bits(stub.expose_provenance() as u64);
        *start.add(4) = function;
        *start.add(6) = arguments;
        task.pc = SavedPc::new(first_instruction(code_of(starter)));
    }
    task.base = FIRST_BASE;
}

/// Restarts the running task, which has left all its frames, with a call of `function` with a list of
/// arguments.
pub(super) fn begin_again(vm: &mut Vm, function: Value, arguments: Value) {
    let words = first_words(&vm.heap, function, arguments);
    let starter = vm.scheduler.starter;
    let task = vm.scheduler.task_mut();
    if task.stack.capacity() < words {
        task.stack.grow(words);
        task.recount(&mut vm.heap);
    }
    first_frame(&vm.heap, task, starter, function, arguments);
    let (pc, stack_end) = (task.pc.get(), stack_end(&vm.config, vm.scheduler.task()));
    let task = vm.scheduler.task();
    // SAFETY: F1: the task stands at the first instruction of its first frame, whose base lies in its stack,
    // which ends at `stack_end`.
    unsafe {
        vm.cpu.set_pc(pc);
        vm.cpu.set_base(task.stack.start().add(task.base as usize));
        vm.cpu.set_stack_end(stack_end);
    }
}

/// Returns the second word of a task's stack: the code with which the task began. Reports show its place in
/// the source when a tail call has replaced its frame. The function itself would keep its captures alive.
fn first_code(heap: &Heap, function: Value) -> Value {
    heap.function_code(function).unwrap_or(Value::NIL)
}

/// Returns the code with which a task began.
pub(crate) fn first_code_of(task: &Task) -> Value {
    task.stack.words(2).get(1).copied().unwrap_or(Value::NIL)
}

/// Lets go of everything that the running task, which has ended, holds on its stacks. The frame of the stub
/// at its end is left.
pub(crate) fn drop_frames(vm: &mut Vm) {
    let task = vm.scheduler.task_mut();
    task.control = LazyControl::default();
    task.base = EXIT_BASE;
    if task.stack.capacity() > LARGE_STACK {
        let stack = Stack::new(EXIT_WORDS);
        // SAFETY: both stacks have more words than this link.
        unsafe { task.stack.start().copy_to_nonoverlapping(stack.start(), EXIT_BASE as usize) };
        let large = std::mem::replace(&mut task.stack, stack);
        vm.scheduler.tasks.discard(large);
        let stack_end = stack_end(&vm.config, vm.scheduler.task());
        // SAFETY: F1: it is that of the stack that the running task has now.
        unsafe { vm.cpu.set_stack_end(stack_end) };
    } else {
        task.stack.wipe(EXIT_BASE as usize);
    }
    let start = vm.scheduler.task().stack.start();
    // A collection may still come in this turn, and takes the running frame from the registers.
    // SAFETY: F1: every stack begins with the link of the frame whose base this is.
    unsafe { vm.cpu.set_base(start.add(EXIT_BASE as usize)) };
}

/// Makes the function with which every task begins: `(apply R0 R2)` as a tail call.
pub(crate) fn make_starter(heap: &mut Heap) -> Result<Value, AllocError> {
    let instruction = Instr::TailApply { window: Window(0), count: Count(1), pad: Pad(0) };
    let (word, aux) = instruction.encode();
    let parts = CodeParts {
        name: Value::NIL,
        debug: Value::NIL,
        owner: Value::NIL,
        arity: 0,
        nregs: 3,
        spare: [Shape::bytecode(&Parameters::default()).pack(), 0],
        constants: &[],
        words: &[word, aux.unwrap_or(0)],
    };
    // SAFETY: the one instruction keeps to its three registers, leaves the frame, and reads no captures.
    unsafe {
        let code = heap.alloc_code(parts)?;
        heap.alloc_function(code, &[])
    }
}
