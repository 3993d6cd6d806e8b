//! Calls that do not take the fast way: other callees than functions with exactly the given arguments, natives called
//! as functions, applications, and calls for which the stack has to grow.
//!
//! A call is made ready before it has any effect, so that one that fails, or lacks room, leaves the frame as it was.

use esl_bytecode::module::Parameters;
use esl_bytecode::opcode::Instr;
use esl_bytecode::operand::{Base, Count, Pad};
use smallvec::SmallVec;

use super::{Operation, Signal, code_of, constants_of};
use crate::builtins::NATIVES;
use crate::heap::layout::{Code, Kind, Symbol};
use crate::heap::{AllocError, CodeParts, Heap};
use crate::raise::{Exit, Raised};
use crate::shape::{Shape, Sort};
use crate::task::Task;
use crate::value::Value;
use crate::vm::Vm;

/// The largest number of arguments that `apply` spreads.
pub(crate) const MAX_SPREAD: usize = 4096;

/// Words beyond the limit of the stack for the handling of its exhaustion.
const RESERVE: usize = 8192;

/// Arguments of a call.
pub(crate) type Arguments = SmallVec<[Value; 16]>;

/// Delivers the value list to a call window.
///
/// # Safety
/// The window is in the running frame, with as many registers as `want` says (V3).
pub(super) unsafe fn deliver(vm: &mut Vm, window: *mut Value, want: usize) {
    let count = if want == 0 || want == 255 { 1 } else { want };
    for i in 0..count {
        // SAFETY: by the contract.
        unsafe { *window.add(i) = vm.values.get(i).copied().unwrap_or(Value::NIL) };
    }
}

/// Returns the value list from the running frame.
///
/// # Safety
/// As [`super::settle`].
pub(super) unsafe fn return_all(vm: &mut Vm) -> Signal {
    // SAFETY: the link of a frame is its function and the address after a call, or of a stub; the call's window is where
    // the link begins.
    unsafe {
        let base = vm.cpu.base;
        let return_to: *const u32 = std::ptr::with_exposed_provenance((*base.sub(1)).bits() as usize);
        let call = *return_to.sub(2);
        let window = base.sub(2);
        vm.cpu.base = window.sub((call >> 8 & 0xff) as usize);
        vm.cpu.pc = return_to;
        // A return to a wanted number of values may be to fewer registers than there are values.
        deliver(vm, window, (call >> 24) as usize);
    }
    Signal::Reload
}

/// The call at `vm.cpu.pc`, whose tick has been taken.
///
/// # Safety
/// As [`super::settle`], at a call instruction.
pub(super) unsafe fn slow_call(vm: &mut Vm) -> Signal {
    // SAFETY: V1, V3 and V4: the instruction has its aux word, window and arguments are registers of the frame.
    unsafe {
        let (pc, base) = (vm.cpu.pc, vm.cpu.base);
        let word = *pc;
        let operation: Operation = std::mem::transmute(word as u8);
        let window = base.add((word >> 8 & 0xff) as usize);
        let count = (word >> 16 & 0xff) as usize;
        let given = std::slice::from_raw_parts(window.add(2), count);
        let callee = match operation {
            Operation::CallGlobal | Operation::TailCallGlobal => {
                *constants_of(code_of(*base.sub(2))).add(*pc.add(1) as usize)
            }
            Operation::CallSelf => *base.sub(2),
            _ => *window,
        };
        let is_tail =
            matches!(operation, Operation::TailCall | Operation::TailCallGlobal | Operation::TailApply);
        let place = if is_tail { Place::Tail } else { Place::Window };
        if matches!(operation, Operation::Apply | Operation::TailApply) {
            let mut arguments = Arguments::from_slice(given);
            if let Err(exit) = spread(vm, &mut arguments) {
                return Signal::Exit(exit);
            }
            return call(vm, callee, &arguments, place);
        }
        call(vm, callee, given, place)
    }
}

/// Replaces the last argument, a list, by its items.
fn spread(vm: &mut Vm, arguments: &mut Arguments) -> Result<(), Exit> {
    let Some(list) = arguments.pop() else { return Ok(()) };
    let mut rest = list;
    while let Some(pair) = vm.heap.as_cons(rest) {
        if arguments.len() == MAX_SPREAD {
            return vm.program_error(format!("more than {MAX_SPREAD} arguments"));
        }
        arguments.push(pair.car);
        rest = pair.cdr;
    }
    vm.charge(arguments.len());
    if rest.is_true() { vm.type_error(list, "LIST") } else { Ok(()) }
}

/// Where a call puts its frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Place {
    /// In the window that the instruction at `vm.cpu.pc` names; it returns behind the instruction.
    Window,
    /// In place of the running frame.
    Tail,
    /// Above the running frame; its values take the place of those of the instruction at `vm.cpu.pc`.
    Above,
    /// Above the running frame; the instruction at `vm.cpu.pc` comes after it.
    Interrupt,
}

/// Calls `callee` with `arguments`, which may lie in the running frame: they are copied before the stack moves.
///
/// # Safety
/// As [`super::settle`]; for [`Place::Window`] at an instruction that has a window.
pub(super) unsafe fn call(vm: &mut Vm, callee: Value, arguments: &[Value], place: Place) -> Signal {
    let function = match vm.callable(callee) {
        Ok(function) => function,
        Err(exit) => return Signal::Exit(exit),
    };
    // SAFETY: `callable` gives a Function that is ready to run.
    let (code, shape) = unsafe {
        let code = code_of(function);
        (code, Shape::unpack((*code).spare[0]))
    };
    if shape.sort == Sort::Native {
        // SAFETY: as this function.
        return unsafe { call_native(vm, shape.number, arguments, place) };
    }
    let mut arranged = Arguments::new();
    // SAFETY: the code is that of the function, and bytecode.
    if let Err(exit) = unsafe { arrange(vm, function, code, shape, arguments, &mut arranged) } {
        return Signal::Exit(exit);
    }
    // SAFETY: the frame's place is computed from the running frame, after room was made for it.
    unsafe {
        let nregs = (*code).nregs as usize;
        let frame = match place {
            Place::Tail => 0,
            Place::Window => (*vm.cpu.pc >> 8 & 0xff) as usize + 2,
            Place::Above | Place::Interrupt => (*code_of(*vm.cpu.base.sub(2))).nregs as usize + 3,
        };
        // The link and the saved pc of `Place::Above` are counted in `frame`, the arguments in `nregs`.
        let offset = vm.offset_of(vm.cpu.base) + frame;
        if let Err(exit) = vm.reserve_stack(offset + nregs) {
            return Signal::Exit(exit);
        }
        let base = vm.cpu.base;
        let registers = base.add(frame);
        match place {
            Place::Tail => {}
            Place::Window => {
                let words = super::stubs::length(*vm.cpu.pc);
                *registers.sub(1) = Value::from_bits(vm.cpu.pc.add(words).expose_provenance() as u64);
            }
            Place::Above | Place::Interrupt => {
                *registers.sub(3) = Value::from_bits(vm.cpu.pc.expose_provenance() as u64);
                let window = (frame - 2) as u8;
                let stub = if place == Place::Above {
                    super::stubs::error_return(window)
                } else {
                    super::stubs::interrupt_return(window)
                };
                *registers.sub(1) = Value::from_bits(stub.expose_provenance() as u64);
            }
        }
        *registers.sub(2) = function;
        for (i, &argument) in arranged.iter().enumerate() {
            *registers.add(i) = argument;
        }
        vm.cpu.base = registers;
        vm.cpu.pc = (*code).entry;
    }
    Signal::Reload
}

/// Calls a builtin as a function.
///
/// # Safety
/// As [`call`].
unsafe fn call_native(vm: &mut Vm, number: u16, arguments: &[Value], place: Place) -> Signal {
    vm.cpu.wants_one = false;
    let info = &esl_bytecode::builtin::BUILTINS[usize::from(number)];
    let count = arguments.len() as u32;
    if count < info.arity.min || info.arity.max.is_some_and(|max| count > max) {
        let text = format!("{} was called with {}", info.name, count_of_arguments(arguments.len()));
        let text = format!("{text}; it takes {}", describe_arity(info.arity.min as usize, info.arity.max));
        return Signal::Exit(vm.program_error::<()>(text).unwrap_err());
    }
    match NATIVES[usize::from(number)](vm, arguments) {
        Ok(value) => {
            vm.values.clear();
            vm.values.push(value);
        }
        Err(Exit::Values) => {}
        Err(Exit::Slowly) => {
            let Some(function) = vm.slow_twin(number) else {
                let text = format!("{} has too much to do at once", info.name);
                return Signal::Exit(vm.program_error::<()>(text).unwrap_err());
            };
            // SAFETY: as this function; a twin is no builtin, so this goes one level deep.
            return unsafe { call(vm, function, arguments, place) };
        }
        Err(Exit::Call) => {
            let (function, arguments) = vm.take_requested_call();
            // SAFETY: as this function. A builtin that asks for itself would go on for ever, and none does.
            return unsafe { call(vm, function, &arguments, place) };
        }
        Err(exit) => return Signal::Exit(exit),
    }
    vm.cpu.ticks = vm.attend(vm.cpu.ticks);
    match place {
        // SAFETY: as this function; V3 for the window.
        Place::Tail => unsafe { return_all(vm) },
        // SAFETY: as this function; V3 for the window.
        Place::Window => unsafe {
            let word = *vm.cpu.pc;
            deliver(vm, vm.cpu.base.add((word >> 8 & 0xff) as usize), (word >> 24) as usize);
            Signal::Next
        },
        // SAFETY: as this function.
        Place::Above => unsafe { super::raise::substitute(vm) },
        // What is called in an interrupted task is written in ESL; were it not, the task would just go on.
        Place::Interrupt => {
            if let Some(entry) = vm.task_mut().control.entries.pop() {
                vm.task_mut().wait = entry.data;
            }
            Signal::Reload
        }
    }
}

/// Puts arguments in the order of the parameter registers into `arranged`, which is empty: missing ones unsupplied, the rest as a list, keys by name.
///
/// # Safety
/// `code` is the Code of `function`, of the given shape, with bytecode.
unsafe fn arrange(
    vm: &mut Vm,
    function: Value,
    code: *mut Code,
    shape: Shape,
    arguments: &[Value],
    arranged: &mut Arguments,
) -> Result<(), Exit> {
    let required = usize::from(shape.required);
    let positional = required + usize::from(shape.optional);
    let count = arguments.len();
    let takes_more = shape.rest || shape.takes_keys;
    if count < required || (count > positional && !takes_more) {
        let name = vm.name_of_function(function);
        let max = if takes_more { None } else { Some(positional as u32) };
        let given = count_of_arguments(count);
        return vm.program_error(format!(
            "{name} was called with {given}; it takes {}",
            describe_arity(required, max)
        ));
    }
    arranged.extend_from_slice(&arguments[..count.min(positional)]);
    arranged.resize(positional, Value::UNSUPPLIED);
    let rest = &arguments[count.min(positional)..];
    if shape.rest {
        vm.charge(rest.len());
        arranged.push(vm.heap.list(rest)?);
    }
    if shape.takes_keys {
        let keys = usize::from(shape.number);
        let first = arranged.len();
        arranged.resize(first + keys, Value::UNSUPPLIED);
        // SAFETY: by the contract, the names of the keys are the last constants (`shape`).
        // Code does not move, and the frame or its caller's holds on to it.
        let names = unsafe {
            let names = constants_of(code).add((*code).nconsts as usize - keys);
            std::slice::from_raw_parts(names, keys)
        };
        take_keys(vm, function, shape, names, rest, &mut arranged[first..])?;
    }
    Ok(())
}

/// Sorts key arguments into the registers of their parameters; of a repeated key the first counts.
fn take_keys(
    vm: &mut Vm,
    function: Value,
    shape: Shape,
    names: &[Value],
    rest: &[Value],
    registers: &mut [Value],
) -> Result<(), Exit> {
    if !rest.len().is_multiple_of(2) {
        let name = vm.name_of_function(function);
        return vm.program_error(format!("{name} was called with an odd number of key arguments"));
    }
    vm.charge(rest.len() * (1 + names.len() / 8));
    let allow_other_keys = vm.world.known.allow_other_keys;
    let mut unknown = None;
    let mut allows = None;
    for pair in rest.chunks_exact(2) {
        let (key, value) = (pair[0], pair[1]);
        if key == allow_other_keys && allows.is_none() {
            allows = Some(value.is_true());
        }
        match names.iter().position(|&name| name == key) {
            Some(index) if registers[index] == Value::UNSUPPLIED => registers[index] = value,
            Some(_) => {}
            None if key == allow_other_keys => {}
            None => unknown = unknown.or(Some(key)),
        }
    }
    match unknown {
        Some(key) if !shape.allow_other_keys && allows != Some(true) => {
            let name = vm.name_of_function(function);
            let key = vm.describe(key);
            let known: Vec<String> = names.iter().map(|&name| vm.describe(name)).collect();
            vm.program_error(format!("{name} has no key {key}; its keys are {}", known.join(" ")))
        }
        _ => Ok(()),
    }
}

fn count_of_arguments(count: usize) -> String {
    if count == 1 { "1 argument".into() } else { format!("{count} arguments") }
}

fn describe_arity(min: usize, max: Option<u32>) -> String {
    match max {
        Some(max) if max as usize == min => min.to_string(),
        Some(max) => format!("{min} to {max}"),
        None => format!("at least {min}"),
    }
}

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

/// Gives a new task its first frame: that of `function`, or a starter that calls it with the list of arguments in its place.
pub(crate) fn first_frame(heap: &Heap, task: &mut Task, starter: Value, function: Value, arguments: Value) {
    let stub = super::stubs::task_exit();
    if let Some(code) = direct_code(heap, function, arguments) {
        // SAFETY: `first_words` has made room for two links and the registers of this code, which takes no arguments.
        unsafe {
            let start = task.stack.start();
            *start = starter;
            *start.add(1) = first_code(heap, function);
            *start.add(2) = function;
            *start.add(3) = Value::from_bits(stub.expose_provenance() as u64);
        }
        task.pc = code.entry;
        task.base = 4;
        return;
    }
    // SAFETY: a new stack has room for two links and the three registers of the starter, which is bytecode.
    unsafe {
        let start = task.stack.start();
        // A link for the frame that the stub at the end of the task runs in.
        *start = starter;
        *start.add(1) = first_code(heap, function);
        *start.add(2) = starter;
        *start.add(3) = Value::from_bits(stub.expose_provenance() as u64);
        *start.add(4) = function;
        *start.add(6) = arguments;
        task.pc = (*code_of(starter)).entry;
    }
    task.base = 4;
}

/// What the second word of a task's stack holds: the code with which the task began, for those who want to know where that was
/// written when a tail call has taken the place of its frame. Not the function, which would keep what it has captured.
fn first_code(heap: &Heap, function: Value) -> Value {
    heap.function_code(function).unwrap_or(Value::NIL)
}

/// The code with which a task began.
pub(crate) fn first_code_of(task: &Task) -> Value {
    task.stack.words(2).get(1).copied().unwrap_or(Value::NIL)
}

/// Lets go of everything that a task that has ended holds on its stacks.
pub(crate) fn drop_frames(task: &mut Task) {
    task.control = crate::control::LazyControl::default();
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
    // SAFETY: the one instruction keeps to its three registers and leaves the frame.
    let code = unsafe { heap.alloc_code(parts)? };
    heap.alloc_function(code, &[])
}

impl Vm {
    /// The function to run when `callee` is called: itself, or that of a symbol, loaded.
    ///
    /// # Errors
    /// `undefined-function`, or `type-error` for what is neither function nor symbol.
    pub(crate) fn callable(&mut self, callee: Value) -> Result<Value, Exit> {
        let function = match self.heap.kind(callee) {
            Some(Kind::Function) => callee,
            Some(Kind::Symbol) => self.heap.symbol(callee).map_or(Value::NIL, |cell: &Symbol| cell.function),
            _ if callee == Value::NIL || callee == Value::T => {
                return self.raise(Raised::UndefinedFunction(callee));
            }
            _ => return self.type_error(callee, "FUNCTION"),
        };
        // SAFETY: a Function, by its kind or because the function of a symbol is one.
        let sort = unsafe { Shape::unpack((*code_of(function)).spare[0]).sort };
        match sort {
            Sort::Undefined => self.raise(Raised::UndefinedFunction(callee)),
            Sort::Lazy => {
                self.make_ready(function)?;
                Ok(function)
            }
            _ => Ok(function),
        }
    }

    /// Offset of an address in the running task's stack.
    pub(crate) fn offset_of(&self, base: *mut Value) -> usize {
        (base.addr() - self.task().stack.start().addr()) / size_of::<Value>()
    }

    /// Words that the running task's stack may have now.
    fn stack_limit(&self) -> usize {
        self.config.stack + if self.task().flags.uses_reserve() { RESERVE } else { 0 }
    }

    /// Address up to which the running task's stack may be used: its end, or its limit if that comes first.
    pub(super) fn stack_end(&self) -> *mut Value {
        let stack = &self.task().stack;
        // SAFETY: not behind the end of the segment.
        unsafe { stack.start().add(stack.capacity().min(self.stack_limit())) }
    }

    /// Makes room in the running task's stack for `words` words in all.
    ///
    /// # Errors
    /// `:stack-exhausted` at the limit. Handling that has a reserve; see [`Vm::leave_reserve`].
    fn reserve_stack(&mut self, words: usize) -> Result<(), Exit> {
        if words > self.stack_limit() {
            if self.task().flags.uses_reserve() {
                self.leave_reserve(self.world.known.stack_exhausted);
                return Err(Exit::Unwind);
            }
            self.task_mut().flags.set_uses_reserve(true);
            self.cpu.stack_end = self.stack_end();
            return self.raise(Raised::StackExhausted);
        }
        if words <= self.task().stack.capacity() {
            return Ok(());
        }
        let offset = self.offset_of(self.cpu.base);
        self.task_mut().stack.grow(words);
        // SAFETY: the offset was inside the old stack, and the new one is larger.
        self.cpu.base = unsafe { self.task().stack.start().add(offset) };
        self.cpu.stack_end = self.stack_end();
        Ok(())
    }

    /// Closes the reserves of stack and heap once the handling of their exhaustion is over: an unwinding has landed.
    pub(super) fn close_reserves(&mut self) {
        self.heap.close_reserve();
        if self.task().flags.uses_reserve() && self.offset_of(self.cpu.base) < self.config.stack / 2 {
            self.task_mut().flags.set_uses_reserve(false);
            self.cpu.stack_end = self.stack_end();
        }
    }
}
