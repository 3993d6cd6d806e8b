//! The first frame of a task, and what is left on its stacks when it has ended.

use esl_bytecode::module::Parameters;
use esl_bytecode::opcode::Instr;
use esl_bytecode::operand::{Base, Count, Pad};

use super::{code_of, stubs};
use crate::heap::layout::Code;
use crate::heap::{AllocError, CodeParts, Heap};
use crate::saved_pc::SavedPc;
use crate::shape::{Shape, Sort};
use crate::task::LazyControl;
use crate::task::Task;
use crate::value::Value;

/// Words of the stack of a task that begins with `function` and the list of `arguments`.
pub(crate) fn first_words(heap: &Heap, function: Value, arguments: Value) -> usize {
    4 + direct_code(heap, function, arguments).map_or(3, |code| code.nregs as usize)
}

/// The code of `function`, if it can be entered without arguments just as it is.
fn direct_code(heap: &Heap, function: Value, arguments: Value) -> Option<&Code> {
    let code = heap.code(heap.function_code(function)?)?;
    (arguments.is_nil() && code.arity == 0 && Shape::unpack(code.spare[0]).sort == Sort::Bytecode)
        .then_some(code)
}

/// Gives a new task its first frame: that of `function`, or a starter that calls it with the list of
/// arguments in its place.
pub(crate) fn first_frame(heap: &Heap, task: &mut Task, starter: Value, function: Value, arguments: Value) {
    let stub = stubs::task_exit();
    if let Some(code) = direct_code(heap, function, arguments) {
        // SAFETY: the task was made with `first_words`: room for two links and the registers of this code.
        // The stub's address has the low bits of a fixnum.
        unsafe {
            let start = task.stack.start();
            *start = starter;
            *start.add(1) = first_code(heap, function);
            *start.add(2) = function;
            *start.add(3) = Value::from_bits(stub.expose_provenance() as u64);
        }
        task.pc = SavedPc::new(code.entry);
        task.base = 4;
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
        task.pc = SavedPc::new((*code_of(starter)).entry);
    }
    task.base = 4;
}

/// What the second word of a task's stack holds: the code with which the task began, for those who want to
/// know where that was written when a tail call has taken the place of its frame. Not the function, which
/// would keep what it has captured.
fn first_code(heap: &Heap, function: Value) -> Value {
    heap.function_code(function).unwrap_or(Value::NIL)
}

/// The code with which a task began.
pub(crate) fn first_code_of(task: &Task) -> Value {
    task.stack.words(2).get(1).copied().unwrap_or(Value::NIL)
}

/// Lets go of everything that a task that has ended holds on its stacks.
pub(crate) fn drop_frames(task: &mut Task) {
    task.control = LazyControl::default();
    task.base = 2;
    task.stack.wipe(2);
}

/// Makes the function with which every task begins: `(apply R0 R2)` as a tail call.
pub(crate) fn make_starter(heap: &mut Heap) -> Result<Value, AllocError> {
    let instruction = Instr::TailApply { window: Base(0), count: Count(1), pad: Pad(0) };
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
