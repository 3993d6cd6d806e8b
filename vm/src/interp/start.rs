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
use crate::shape::{CodeKind, Shape};
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

/// The first call of a task.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FirstCall {
    function: Value,
    arguments: Value,
    /// The code of the function; `NIL` if it has none.
    code: Value,
    /// Number of registers, if the function can be entered just as it is, without arguments.
    direct: Option<u32>,
}

impl FirstCall {
    /// Creates the call of `function` with a list of arguments.
    #[inline]
    pub(crate) fn new(heap: &Heap, function: Value, arguments: Value) -> FirstCall {
        let code = heap.function_code(function).unwrap_or(Value::NIL);
        let is_direct = |code: &CodeObject| {
            arguments.is_nil() && code.arity == 0 && Shape::unpack(code.spare[0]).kind == CodeKind::Bytecode
        };
        let direct = heap.code(code).filter(|code| is_direct(code)).map(|code| code.nregs);
        FirstCall { function, arguments, code, direct }
    }

    /// Returns the words of stack that a task needs to begin with it.
    #[inline]
    pub(crate) fn words(self) -> usize {
        4 + self.direct.map_or(3, |registers| registers as usize)
    }

    /// Makes the first frame of a new task: that of the function, or that of a starter, which calls the
    /// function with the list of arguments.
    #[inline]
    pub(crate) fn make_frame(self, task: &mut Task, starter: Value) {
        let first = if self.direct.is_some() { self.function } else { starter };
        let stub = stubs::task_exit();
        // SAFETY: the task has as many words as `words` says: room for two links and the registers of the
        // function, or the three of the starter, a Function of bytecode. The stub's address has the low bits
        // of a fixnum.
        unsafe {
            let start = task.stack.start();
            // A link for the frame that the stub at the end of the task runs in. Its second word is the code
            // with which the task began: reports show its place in the source when a tail call has replaced
            // its frame. The function itself would keep its captures alive.
            *start = starter;
            *start.add(1) = self.code;
            *start.add(2) = first;
            *start.add(3) = Value::from_bits(stub.expose_provenance() as u64);
            if self.direct.is_none() {
                *start.add(4) = self.function;
                *start.add(6) = self.arguments;
            }
            task.pc = SavedPc::new(first_instruction(code_of(first)));
        }
        task.base = FIRST_BASE;
    }
}

/// Restarts the running task, which has left all its frames, with a call of `function` with a list of
/// arguments.
pub(super) fn begin_again(vm: &mut Vm, function: Value, arguments: Value) {
    let call = FirstCall::new(&vm.heap, function, arguments);
    let words = call.words();
    let starter = vm.scheduler.starter;
    let task = vm.scheduler.task_mut();
    if task.stack.capacity() < words {
        task.stack.grow(words);
        task.recount(&mut vm.heap);
    }
    call.make_frame(task, starter);
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
        // Its record may be kept for another task, and be counted as it is now.
        let Vm { scheduler, heap, .. } = &mut *vm;
        scheduler.task_mut().recount(heap);
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
