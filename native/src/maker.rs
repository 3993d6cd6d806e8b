//! Making, keeping and giving back machine code.

use std::sync::Arc;
use std::time::{Duration, Instant};

use cranelift_codegen::CodegenError;
use cranelift_codegen::ir::{AbiParam, Signature, types};
use cranelift_codegen::isa::{OwnedTargetIsa, TargetIsa};
use cranelift_codegen::settings::{self, Configurable};
use cranelift_frontend::{FunctionBuilder, FunctionBuilderContext};
use cranelift_jit::{JITBuilder, JITModule};
use cranelift_module::{Linkage, Module, ModuleError, default_libcall_names};
use esl_heap::Value;

use crate::abi::NativeEntry;
use crate::flow::NativeFlow;
use crate::kinds::{Known, NativeKinds};
use crate::translate::Translator;

/// Most words of a function that is translated; longer ones are left to the interpreter.
pub const MAX_WORDS: usize = 4000;

/// Most words of a short function, with those that are inlined in it.
const MAX_SHORT: usize = 100;

/// The code of a function: see N1.
#[derive(Clone, Debug)]
pub struct FunctionSource {
    /// The instructions, none of them fused.
    pub words: Vec<u32>,
    /// Address of the first of them, where the interpreter runs them.
    pub words_at: u64,
    /// Address of the first constant.
    pub constants_at: u64,
    /// The constants, as they are now.
    pub constants: Vec<Value>,
    /// Number of registers.
    pub registers: usize,
}

/// A global function that may be inlined: see N8.
#[derive(Clone, Debug)]
pub struct InlinedSource {
    /// The symbol that names it.
    pub symbol: Value,
    /// The function of the symbol.
    pub callee: Value,
    /// Number of its required parameters.
    pub required: u8,
    /// Number of its optional parameters. It has no others.
    pub optional: u8,
    /// Its code, for which [`may_be_inlined`](crate::may_be_inlined) holds.
    pub function: FunctionSource,
}

/// The input of a translation.
#[derive(Clone, Debug)]
pub struct NativeSource {
    /// The function.
    pub function: FunctionSource,
    /// Functions that it calls, or that these call.
    pub inlined: Vec<InlinedSource>,
    /// The kinds of the registers when this was taken, which are the guess for later runs. May be shorter
    /// than the registers, and may be wrong: then the machine code is left with
    /// [`GUESSED_WRONG`](crate::abi::GUESSED_WRONG).
    pub guesses: Vec<Known>,
    /// The first word of an [`EntryStub`](crate::abi::EntryStub).
    pub entry_word: u32,
}

/// Why no machine code was made.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NotMade {
    /// The function is too long, or its code is not one that the verifier takes.
    Unfit,
    /// This processor or system is not known to the code generator, or memory may not be executed.
    Unsupported(String),
}

/// Makes machine code.
pub struct MachineCodeMaker {
    /// Generates code without optimizing it, which for most functions gains less than it takes.
    isa: OwnedTargetIsa,
    /// Optimizes, which is worth it where doubles are computed, and cheap for short functions.
    optimizing: OwnedTargetIsa,
    builders: FunctionBuilderContext,
}

impl MachineCodeMaker {
    /// Prepares the code generator for this processor.
    ///
    /// # Errors
    /// [`NotMade::Unsupported`].
    pub fn new() -> Result<MachineCodeMaker, NotMade> {
        if cfg!(not(all(unix, any(target_arch = "x86_64", target_arch = "aarch64")))) {
            return Err(NotMade::Unsupported("this system has another calling convention".into()));
        }
        Ok(MachineCodeMaker {
            isa: generator("none")?,
            optimizing: generator("speed")?,
            builders: FunctionBuilderContext::new(),
        })
    }

    /// Translates a function, and returns how long that took.
    pub fn make(&mut self, source: &NativeSource) -> (Result<MachineCode, NotMade>, Duration) {
        let started = Instant::now();
        let result = self.translate(source);
        (result, started.elapsed())
    }

    fn translate(&mut self, source: &NativeSource) -> Result<MachineCode, NotMade> {
        if source.function.words.len() > MAX_WORDS {
            return Err(NotMade::Unfit);
        }
        let flow = NativeFlow::of(source).ok_or(NotMade::Unfit)?;
        let unsupported = |error: ModuleError| NotMade::Unsupported(error.to_string());
        let kinds = NativeKinds::of(&flow, source);
        let is_optimized = kinds.keeps_back() || flow.steps.len() <= MAX_SHORT;
        let isa: Arc<dyn TargetIsa> = if is_optimized { self.optimizing.clone() } else { self.isa.clone() };
        let mut module = JITModule::new(JITBuilder::with_isa(isa, default_libcall_names()));
        let mut context = module.make_context();
        context.func.signature = entry_signature(&module);
        let id = module
            .declare_function("function", Linkage::Local, &context.func.signature)
            .map_err(unsupported)?;
        let itself = module.declare_func_in_func(id, &mut context.func);
        let builder = FunctionBuilder::new(&mut context.func, &mut self.builders);
        let config = module.isa().frontend_config();
        Translator::new(builder, source, (&flow, &kinds), itself, module.isa().pointer_type())
            .translate(config);
        let mut defined = module.define_function(id, &mut context);
        let bytes = context.compiled_code().map_or(0, |code| code.code_buffer().len());
        if defined.is_ok() {
            defined = module.finalize_definitions();
        }
        if let Err(error) = defined {
            // SAFETY: no address of it exists elsewhere. Dropped, it would keep its memory.
            unsafe { module.free_memory() };
            return Err(match error {
                ModuleError::Compilation(CodegenError::Verifier(faults)) => {
                    debug_assert!(false, "a faulty translation: {faults}");
                    NotMade::Unfit
                }
                // Of this function only.
                ModuleError::Compilation(_) => NotMade::Unfit,
                error => unsupported(error),
            });
        }
        let address = module.get_finalized_function(id);
        // SAFETY: the function was declared with the signature of an entry, and is finished.
        let entry = unsafe { std::mem::transmute::<*const u8, NativeEntry>(address) };
        let said = if cfg!(debug_assertions) { SaidFrame::of(&flow, kinds) } else { Vec::new() };
        Ok(MachineCode { module: Some(module), entry, bytes, loops: flow.loops, said })
    }
}

/// Returns the code generator for this processor, with an `opt_level` of Cranelift.
fn generator(opt_level: &str) -> Result<OwnedTargetIsa, NotMade> {
    let unsupported = |error: &dyn std::fmt::Display| NotMade::Unsupported(error.to_string());
    let mut flags = settings::builder();
    let verifies = if cfg!(debug_assertions) { "true" } else { "false" };
    for (name, value) in [
        ("opt_level", opt_level),
        ("use_colocated_libcalls", "false"),
        ("is_pic", "false"),
        ("enable_verifier", verifies),
    ] {
        flags.set(name, value).map_err(|error| unsupported(&error))?;
    }
    let builder = cranelift_native::builder().map_err(|error| unsupported(&error))?;
    builder.finish(settings::Flags::new(flags)).map_err(|error| unsupported(&error))
}

/// The signature of [`NativeEntry`].
fn entry_signature(module: &JITModule) -> Signature {
    let mut signature = module.make_signature();
    signature.params.extend([AbiParam::new(types::I64); 3]);
    signature.returns.extend([AbiParam::new(types::I64); 2]);
    signature
}

/// The machine code of a function. Dropping it gives its memory back.
pub struct MachineCode {
    module: Option<JITModule>,
    entry: NativeEntry,
    bytes: usize,
    loops: Vec<usize>,
    /// The function and what is inlined in it; in debug builds only.
    said: Vec<SaidFrame>,
}

/// The known kinds of registers in the frame of a function, or of an inlined one.
struct SaidFrame {
    /// Address of its first instruction.
    words_at: u64,
    /// Registers of the frames below.
    base: usize,
    /// The known kinds of the registers before each of its instructions.
    said: Vec<Option<Box<[Known]>>>,
}

impl SaidFrame {
    fn of(flow: &NativeFlow<'_>, kinds: NativeKinds) -> Vec<SaidFrame> {
        let mut said = kinds.into_said().into_iter();
        let frames = flow.frames.iter().map(|frame| SaidFrame {
            words_at: frame.source.words_at,
            base: usize::from(frame.base),
            said: said.by_ref().take(frame.source.words.len()).collect(),
        });
        frames.collect()
    }

    /// Returns whether machine code may have been left at an instruction with these registers.
    fn allows(&self, pc: u64, base: usize, registers: &[Value]) -> bool {
        let at = pc.checked_sub(self.words_at).map(|bytes| bytes as usize / size_of::<u32>());
        let Some(Some(said)) = at.and_then(|at| self.said.get(at)) else { return false };
        let is_other = |&(&known, &value): &(&Known, &Value)| match known {
            Known::Fixnum | Known::Double => Known::of(value) != known,
            Known::Nothing | Known::Spent => false,
        };
        base == self.base && said.iter().zip(registers).filter(is_other).count() <= 1
    }
}

impl MachineCode {
    /// Returns the entry.
    pub fn entry(&self) -> NativeEntry {
        self.entry
    }

    /// Returns its length in bytes.
    pub fn bytes(&self) -> usize {
        self.bytes
    }

    /// Returns whether machine code may have been left at the instruction at the address `pc`, in a frame
    /// `base` registers above that of the function, with these registers from there on: as far as that is
    /// known, it is an instruction that can be reached, and the registers hold what they are known to hold
    /// there. One may be something else, which is why it was left. Always in release builds.
    pub fn may_be_left(&self, pc: u64, base: usize, registers: &[Value]) -> bool {
        self.said.is_empty() || self.said.iter().any(|frame| frame.allows(pc, base, registers))
    }

    /// Returns the words of the loop instructions at which it may be entered, the first at place 1.
    pub fn loops(&self) -> &[usize] {
        &self.loops
    }
}

impl Drop for MachineCode {
    fn drop(&mut self) {
        if let Some(module) = self.module.take() {
            // SAFETY: the owner of machine code drops it only when no task is in it and no entry leads to it
            // any more.
            unsafe { module.free_memory() };
        }
    }
}

// SAFETY: the memory belongs to this value alone, and what is in it does not depend on a thread.
unsafe impl Send for MachineCode {}

impl std::fmt::Debug for MachineCode {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("MachineCode")
            .field("bytes", &self.bytes)
            .field("loops", &self.loops)
            .finish_non_exhaustive()
    }
}
