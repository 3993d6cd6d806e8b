//! Making machine code of a function, here or on another thread, and installing it.

use esl_bytecode::opcode::Instr;
use esl_bytecode::operand::Want;
use esl_native::abi::EntryStub;
use esl_native::maker::MAX_WORDS;
use esl_native::{
    FunctionSource, InlinedSource, Known, MAX_DEPTH, MAX_INLINED, MachineCode, MachineCodeHelper,
    MachineCodeMaker, NativeSource, NotMade, may_be_inlined,
};

use super::super::{code_of, constants_of, first_instruction, stubs};
use super::{MAKE_AT_ENTRY, calm_loop, rouse_loops};
use crate::fused::{quicken_loop, unfused};
use crate::heap::layout::{CodeObject, Kind, SymbolObject};
use crate::shape::Shape;
use crate::tier::{CodeOrder, CompiledFunctions, InstalledCode, LoopUse, Tier};
use crate::value::Value;
use crate::vm::Vm;

/// Most bytes of machine code of one machine.
const MOST_BYTES: usize = 32 << 20;

/// Largest fraction of the heap's memory that machine code may take: one in so many.
const PART_OF_HEAP: usize = 8;

/// Most orders that are given and not answered.
const MOST_ORDERS: usize = 64;

/// Most functions that are offered to be inlined in one.
const MAX_CALLEES: usize = 32;

/// Makes machine code of the running function at its first call; puts back the way to its first instruction
/// if none is made.
///
/// # Safety
/// The frame at `base` is the running one, at the beginning of a function of bytecode.
#[cold]
#[inline(never)]
pub(in crate::interp) unsafe fn make_at_entry(vm: &mut Vm, base: *mut Value) {
    // SAFETY: by the contract; the entry of a Code may lead to its first instruction or to its machine code.
    unsafe {
        let code = code_of(*base.sub(2));
        (*code).entry = first_instruction(code);
        let registers = std::slice::from_raw_parts(base, (*code).nregs as usize);
        let guesses = registers.iter().map(|&value| Known::of(value)).collect();
        make(vm, code, guesses);
    }
}

/// Makes machine code of a code and installs it, or has it made; unless there is some, or that is being made,
/// or there is too much altogether.
///
/// # Safety
/// `code` points to a Code of bytecode.
pub(super) unsafe fn make(vm: &mut Vm, code: *mut CodeObject, guesses: Vec<Known>) {
    let most = MOST_BYTES.min(vm.config.memory / PART_OF_HEAP);
    let compiled = &mut vm.compiled;
    if compiled.report.refused.is_some() || compiled.report.bytes > most {
        return;
    }
    // SAFETY: the contract says that this is a live Code, whose entry leads to an operation of the loop.
    unsafe {
        let is_made = *(*code).entry == u32::from(stubs::NATIVE_ENTRY);
        if (is_made && !guesses.is_empty()) || instructions(code).len() > MAX_WORDS {
            return;
        }
        let has_guesses = !guesses.is_empty();
        let word = Value::from_object(code.cast()).bits();
        if compiled.asked.values().any(|order| (order.code, order.has_guesses) == (word, has_guesses)) {
            return;
        }
        if compiled.asked.len() == MOST_ORDERS {
            // It is asked for when it has been met as often again.
            return compiled.heat.forget(word);
        }
        let source = source_of(compiled, code, guesses);
        let inlined = source.inlined.iter().map(|inlined| inlined.callee.bits()).collect();
        let order = CodeOrder { code: word, has_guesses, inlined };
        if compiled.tier == Tier::Native {
            let maker = match &mut compiled.maker {
                Some(maker) => Ok(maker),
                none => MachineCodeMaker::new().map(|maker| none.insert(maker)),
            };
            let (result, duration) = match maker {
                Ok(maker) => maker.make(&source),
                Err(reason) => (Err(reason), Default::default()),
            };
            compiled.report.nanoseconds += duration.as_nanos() as u64;
            install(compiled, order, result);
            return;
        }
        let helper = match &mut compiled.helper {
            Some(helper) => Ok(helper),
            none => MachineCodeHelper::start().map(|helper| none.insert(helper)),
        };
        match helper {
            Ok(helper) => {
                compiled.orders += 1;
                compiled.asked.insert(compiled.orders, order);
                helper.ask(compiled.orders, source);
            }
            Err(reason) => install(compiled, order, Err(reason)),
        }
    }
}

/// Installs what was made on the other thread.
pub(super) fn install_made(compiled: &mut CompiledFunctions) {
    while let Some(made) = compiled.helper.as_ref().and_then(MachineCodeHelper::take) {
        compiled.report.nanoseconds += made.duration.as_nanos() as u64;
        // The code may be gone.
        let Some(order) = compiled.asked.remove(&made.order) else { continue };
        // SAFETY: the word was made of the address of a Code, which is there: else the order was forgotten
        // when all that is reached had been marked.
        unsafe { install(compiled, order, made.result) };
    }
}

/// Returns the instructions of a code, which may be fused.
///
/// # Safety
/// `code` points to a Code of bytecode.
pub(super) unsafe fn instructions<'a>(code: *mut CodeObject) -> &'a [u32] {
    // SAFETY: the contract says that this is a live Code. Its words end with one for each capture (`shape`).
    unsafe {
        let captures = (*code).spare[1] as usize;
        std::slice::from_raw_parts(first_instruction(code), (*code).nwords as usize - captures)
    }
}

/// Returns what is translated of a code.
///
/// # Safety
/// `code` points to a Code of bytecode.
unsafe fn source_of(
    compiled: &CompiledFunctions,
    code: *mut CodeObject,
    guesses: Vec<Known>,
) -> NativeSource {
    // SAFETY: by the contract this is a live Code; `inlined_by` returns functions of live ones.
    unsafe {
        let function = function_source(code);
        let mut inlined = Vec::new();
        let mut callers = vec![function.clone()];
        for _ in 0..MAX_DEPTH {
            let mut callees = Vec::new();
            for caller in &callers {
                inlined_by(compiled, caller, &mut inlined, &mut callees);
            }
            callers = callees;
        }
        NativeSource { function, inlined, guesses, entry_word: u32::from(stubs::NATIVE_ENTRY) }
    }
}

/// Returns the code of a function as it is translated.
///
/// # Safety
/// `code` points to a Code of bytecode.
unsafe fn function_source(code: *mut CodeObject) -> FunctionSource {
    // SAFETY: by the contract this is a live Code.
    unsafe {
        FunctionSource {
            words: unfused(instructions(code)),
            words_at: first_instruction(code).expose_provenance() as u64,
            constants_at: constants_of(code).expose_provenance() as u64,
            constants: std::slice::from_raw_parts(constants_of(code), (*code).nconsts as usize).to_vec(),
            registers: (*code).nregs as usize,
        }
    }
}

/// Finds the functions that may be inlined where a function calls them.
///
/// # Safety
/// The function is that of a live Code.
unsafe fn inlined_by(
    compiled: &CompiledFunctions,
    caller: &FunctionSource,
    inlined: &mut Vec<InlinedSource>,
    callees: &mut Vec<FunctionSource>,
) {
    let mut at = 0;
    while let Some(instr) = Instr::decode(&caller.words, at) {
        at += instr.opcode().words();
        let Instr::CallGlobal { want: Want::ONE, symbol, .. } = instr else { continue };
        let Some(&symbol) = caller.constants.get(symbol.0 as usize) else { continue };
        if inlined.len() == MAX_CALLEES
            || compiled.redefined.contains(&symbol.bits())
            || inlined.iter().any(|known| known.symbol == symbol)
        {
            continue;
        }
        // SAFETY: V4: the constant is a symbol; its function is a Function if it is an object of that kind.
        unsafe {
            let callee = (*symbol.object_ptr().cast::<SymbolObject>()).function;
            if !callee.is_object() || (*callee.object_ptr()).kind != Kind::Function {
                continue;
            }
            let code = code_of(callee);
            if !Shape::is_bytecode((*code).spare[0]) {
                continue;
            }
            let Shape { required, optional, rest, takes_keys, .. } = Shape::unpack((*code).spare[0]);
            if rest || takes_keys {
                continue;
            }
            if instructions(code).len() > MAX_INLINED {
                continue;
            }
            let function = function_source(code);
            if function.words_at != caller.words_at && may_be_inlined(&function.words) {
                callees.push(function.clone());
                inlined.push(InlinedSource { symbol, callee, required, optional, function });
            }
        }
    }
}

/// Makes calls and loops of a code lead to machine code, or notes why there is none.
///
/// # Safety
/// The code of the order is a live Code of bytecode, its functions are there, and the machine code is made of
/// them.
unsafe fn install(compiled: &mut CompiledFunctions, order: CodeOrder, result: Result<MachineCode, NotMade>) {
    let made = match result {
        Ok(made) => made,
        Err(NotMade::Unfit) => return,
        Err(NotMade::Unsupported(reason)) => {
            compiled.report.refused = Some(reason);
            return;
        }
    };
    // SAFETY: by the contract this is a live Code, and no reference to its words exists.
    unsafe {
        let code = Value::from_bits(order.code).object_ptr().cast::<CodeObject>();
        let words = instructions(code).len();
        let words = std::slice::from_raw_parts_mut(first_instruction(code).cast_mut(), words);
        if *(*code).entry == u32::from(stubs::NATIVE_ENTRY) {
            // Its guesses were wrong.
            let number = (*(*code).entry.cast::<EntryStub>()).number as usize;
            let old = compiled.installed.get_mut(number).and_then(Option::as_mut);
            if let Some(old) = old.filter(|old| old.order.has_guesses && !order.has_guesses) {
                for &at in made.loops() {
                    quicken_loop(words, at);
                }
                old.loops = unused(&made);
                old.stub.address = made.entry() as usize as u64;
                compiled.report.bytes += made.bytes().next_multiple_of(4096);
                compiled.report.bytes -= old.made.bytes().next_multiple_of(4096);
                old.made = made;
                old.order = order;
            }
            return;
        }
        let number = compiled.free.pop().unwrap_or_else(|| {
            compiled.installed.push(None);
            compiled.installed.len() as u32 - 1
        });
        let address = made.entry() as usize as u64;
        let stub = Box::new(EntryStub { word: u32::from(stubs::NATIVE_ENTRY), number, address });
        compiled.report.functions += 1;
        // Memory is taken in pages.
        compiled.report.bytes += made.bytes().next_multiple_of(4096);
        for &at in made.loops() {
            quicken_loop(words, at);
        }
        (*code).entry = (&raw const *stub).cast();
        compiled.installed[number as usize] =
            Some(InstalledCode { stub, loops: unused(&made), made, order, wrong: 0 });
        rouse_loops(compiled);
    }
}

/// Lets calls and loops of a code lead to the interpreter again, and gives its machine code back.
///
/// # Safety
/// `code` is a live Code, and no machine code runs.
pub(super) unsafe fn uninstall(compiled: &mut CompiledFunctions, code: *mut CodeObject) {
    // SAFETY: by the contract; no reference to the words of a code exists.
    unsafe {
        if *(*code).entry != u32::from(stubs::NATIVE_ENTRY) {
            return;
        }
        let number = (*(*code).entry.cast::<EntryStub>()).number;
        let Some(installed) = compiled.installed.get_mut(number as usize).and_then(Option::take) else {
            return;
        };
        (*code).entry =
            if compiled.tier == Tier::Native { &raw const MAKE_AT_ENTRY } else { first_instruction(code) };
        for &at in installed.made.loops() {
            calm_loop(first_instruction(code).add(at));
        }
        compiled.report.bytes -= installed.made.bytes().next_multiple_of(4096);
        compiled.free.push(number);
        compiled.heat.forget(Value::from_object(code.cast()).bits());
    }
}

/// Returns the use of the loop instructions of machine code that was never entered at one.
fn unused(made: &MachineCode) -> Box<[LoopUse]> {
    vec![LoopUse::default(); made.loops().len()].into()
}

impl CompiledFunctions {
    /// Lets calls of all installed code lead to its first instruction, or to the machine code again: entries
    /// mean nothing in another process. Between the two, nothing runs.
    pub(crate) fn lead_to_interpreter(&mut self, leads: bool) {
        for installed in self.installed.iter().flatten() {
            // SAFETY: code that has machine code installed is alive: else its machine code is given back when
            // the collector has found that.
            unsafe {
                let code = Value::from_bits(installed.order.code).object_ptr().cast::<CodeObject>();
                (*code).entry =
                    if leads { first_instruction(code) } else { (&raw const *installed.stub).cast() };
            }
        }
    }
}
