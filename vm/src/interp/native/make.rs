//! Making machine code of a function, here or on another thread, and installing it.

use esl_native::abi::EntryStub;
use esl_native::maker::MAX_WORDS;
use esl_native::{Known, MachineCode, MachineCodeHelper, MachineCodeMaker, NativeSource, NotMade};

use super::super::{code_of, constants_of, first_instruction, stubs};
use super::rouse_loops;
use crate::fused::{quicken_loop, unfused};
use crate::heap::layout::CodeObject;
use crate::tier::{CompiledFunctions, InstalledCode, LoopUse, Tier};
use crate::value::Value;
use crate::vm::Vm;

/// Most bytes of machine code of one machine.
const MOST_BYTES: usize = 32 << 20;

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
    let compiled = &mut vm.compiled;
    if compiled.report.refused.is_some() || compiled.report.bytes > MOST_BYTES {
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
        if compiled.asked.values().any(|&asked| asked == (word, has_guesses)) {
            return;
        }
        let source = source_of(code, guesses);
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
            install(compiled, code, has_guesses, result);
            return;
        }
        let helper = match &mut compiled.helper {
            Some(helper) => Ok(helper),
            none => MachineCodeHelper::start().map(|helper| none.insert(helper)),
        };
        match helper {
            Ok(helper) => {
                compiled.orders += 1;
                compiled.asked.insert(compiled.orders, (word, has_guesses));
                helper.ask(compiled.orders, source);
            }
            Err(reason) => install(compiled, code, has_guesses, Err(reason)),
        }
    }
}

/// Installs what was made on the other thread.
pub(super) fn install_made(compiled: &mut CompiledFunctions) {
    while let Some(made) = compiled.helper.as_ref().and_then(MachineCodeHelper::take) {
        compiled.report.nanoseconds += made.duration.as_nanos() as u64;
        // The code may be gone.
        let Some((code, has_guesses)) = compiled.asked.remove(&made.order) else { continue };
        // SAFETY: the word was made of the address of a Code, which is there: else the order was forgotten
        // when all that is reached had been marked.
        unsafe { install(compiled, Value::from_bits(code).object_ptr().cast(), has_guesses, made.result) };
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
unsafe fn source_of(code: *mut CodeObject, guesses: Vec<Known>) -> NativeSource {
    // SAFETY: by the contract this is a live Code.
    unsafe {
        NativeSource {
            words: unfused(instructions(code)),
            words_at: first_instruction(code).expose_provenance() as u64,
            constants_at: constants_of(code).expose_provenance() as u64,
            constants: std::slice::from_raw_parts(constants_of(code), (*code).nconsts as usize).to_vec(),
            registers: (*code).nregs as usize,
            guesses,
            entry_word: u32::from(stubs::NATIVE_ENTRY),
        }
    }
}

/// Makes calls and loops of a code lead to machine code, or notes why there is none.
///
/// # Safety
/// `code` points to a Code of bytecode, and the machine code is made of it.
pub(super) unsafe fn install(
    compiled: &mut CompiledFunctions,
    code: *mut CodeObject,
    has_guesses: bool,
    result: Result<MachineCode, NotMade>,
) {
    let made = match result {
        Ok(made) => made,
        Err(NotMade::Unfit) => return,
        Err(NotMade::Unsupported(reason)) => {
            compiled.report.refused = Some(reason);
            return;
        }
    };
    // SAFETY: by the contract this is a live Code, and nobody holds a reference to its words.
    unsafe {
        let words = instructions(code).len();
        let words = std::slice::from_raw_parts_mut(first_instruction(code).cast_mut(), words);
        if *(*code).entry == u32::from(stubs::NATIVE_ENTRY) {
            // Its guesses were wrong.
            let number = (*(*code).entry.cast::<EntryStub>()).number as usize;
            let old = compiled.installed.get_mut(number).and_then(Option::as_mut);
            if let Some(old) = old.filter(|old| old.has_guesses && !has_guesses) {
                for &at in made.loops() {
                    quicken_loop(words, at);
                }
                old.loops = unused(&made);
                old.stub.address = made.entry() as usize as u64;
                compiled.report.bytes += made.bytes().next_multiple_of(4096);
                compiled.report.bytes -= old.made.bytes().next_multiple_of(4096);
                old.made = made;
                old.has_guesses = false;
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
        let code = Value::from_object(code.cast()).bits();
        compiled.installed[number as usize] =
            Some(InstalledCode { stub, loops: unused(&made), made, code, has_guesses, wrong: 0 });
        rouse_loops(compiled);
    }
}

/// Returns the use of the loop instructions of machine code that was never entered at one.
fn unused(made: &MachineCode) -> Box<[LoopUse]> {
    vec![LoopUse::default(); made.loops().len()].into()
}
