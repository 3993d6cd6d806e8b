//! Making, keeping and giving back machine code.

use std::sync::Arc;
use std::time::{Duration, Instant};

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

/// What is translated: see N1.
#[derive(Clone, Debug)]
pub struct NativeSource {
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
    /// What the registers held when this was taken, from which it is guessed what they will hold. May be
    /// shorter than the registers, and may be wrong: then the machine code is left with
    /// [`GUESSED_WRONG`](crate::abi::GUESSED_WRONG).
    pub guesses: Vec<Known>,
    /// The first word of an [`EntryStub`](crate::abi::EntryStub).
    pub entry_word: u32,
}

/// Why no machine code was made.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NotMade {
    /// The function is too long, or it is no code that the verifier takes.
    Unfit,
    /// This processor or system is not known to the code generator, or memory may not be executed.
    Unsupported(String),
}

/// Makes machine code.
pub struct MachineCodeMaker {
    isa: OwnedTargetIsa,
    builders: FunctionBuilderContext,
}

impl MachineCodeMaker {
    /// Prepares the code generator for this processor.
    ///
    /// # Errors
    /// [`NotMade::Unsupported`].
    pub fn new() -> Result<MachineCodeMaker, NotMade> {
        if cfg!(not(all(unix, any(target_arch = "x86_64", target_arch = "aarch64")))) {
            return Err(NotMade::Unsupported("this system has another way of calling".into()));
        }
        let unsupported = |error: &dyn std::fmt::Display| NotMade::Unsupported(error.to_string());
        let mut flags = settings::builder();
        let verifies = if cfg!(debug_assertions) { "true" } else { "false" };
        for (name, value) in [
            ("opt_level", "speed"),
            ("use_colocated_libcalls", "false"),
            ("is_pic", "false"),
            ("enable_verifier", verifies),
        ] {
            flags.set(name, value).map_err(|error| unsupported(&error))?;
        }
        let builder = cranelift_native::builder().map_err(|error| unsupported(&error))?;
        let isa = builder.finish(settings::Flags::new(flags)).map_err(|error| unsupported(&error))?;
        Ok(MachineCodeMaker { isa, builders: FunctionBuilderContext::new() })
    }

    /// Translates a function, and returns how long that took.
    pub fn make(&mut self, source: &NativeSource) -> (Result<MachineCode, NotMade>, Duration) {
        let started = Instant::now();
        let result = self.translate(source);
        (result, started.elapsed())
    }

    fn translate(&mut self, source: &NativeSource) -> Result<MachineCode, NotMade> {
        if source.words.len() > MAX_WORDS {
            return Err(NotMade::Unfit);
        }
        let flow = NativeFlow::of(&source.words).ok_or(NotMade::Unfit)?;
        let unsupported = |error: ModuleError| NotMade::Unsupported(error.to_string());
        let isa: Arc<dyn TargetIsa> = self.isa.clone();
        let mut module = JITModule::new(JITBuilder::with_isa(isa, default_libcall_names()));
        let mut context = module.make_context();
        context.func.signature = entry_signature(&module);
        let id = module
            .declare_function("function", Linkage::Local, &context.func.signature)
            .map_err(unsupported)?;
        let itself = module.declare_func_in_func(id, &mut context.func);
        let builder = FunctionBuilder::new(&mut context.func, &mut self.builders);
        let config = module.isa().frontend_config();
        let kinds = NativeKinds::of(&flow, source);
        Translator::new(builder, source, (&flow, &kinds), itself, module.isa().pointer_type())
            .translate(config);
        let mut defined = module.define_function(id, &mut context);
        let bytes = context.compiled_code().map_or(0, |code| code.code_buffer().len());
        if defined.is_ok() {
            defined = module.finalize_definitions();
        }
        if let Err(error) = defined {
            // SAFETY: nobody has an address of it. Dropped, it would keep its memory.
            unsafe { module.free_memory() };
            return Err(match error {
                // Of this function only.
                ModuleError::Compilation(_) => NotMade::Unfit,
                error => unsupported(error),
            });
        }
        let address = module.get_finalized_function(id);
        // SAFETY: the function was declared with the signature of an entry, and is finished.
        let entry = unsafe { std::mem::transmute::<*const u8, NativeEntry>(address) };
        let said = if cfg!(debug_assertions) { kinds.into_said() } else { Vec::new() };
        Ok(MachineCode { module: Some(module), entry, bytes, loops: flow.loops, said })
    }
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
    /// What is known of the registers before each instruction; in debug builds only.
    said: Vec<Option<Box<[Known]>>>,
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

    /// Returns whether machine code may have been left at the instruction at a word with these registers, as
    /// far as that is known: it is an instruction that can be reached, and the registers hold what they are
    /// known to hold there. One may be something else, which is why it was left. Always in release builds.
    pub fn may_be_left(&self, at: usize, registers: &[Value]) -> bool {
        if self.said.is_empty() {
            return true;
        }
        let Some(Some(said)) = self.said.get(at) else { return false };
        let is_other = |&(&known, &value): &(&Known, &Value)| match known {
            Known::Fixnum | Known::Double => Known::of(value) != known,
            Known::Nothing | Known::Spent => false,
        };
        said.len() == registers.len() && said.iter().zip(registers).filter(is_other).count() <= 1
    }

    /// Returns the words of the loop instructions at which it may be entered, the first at place 1.
    pub fn loops(&self) -> &[usize] {
        &self.loops
    }
}

impl Drop for MachineCode {
    fn drop(&mut self) {
        if let Some(module) = self.module.take() {
            // SAFETY: whoever drops machine code has seen to it that no task is in it, and that no entry
            // leads to it any more.
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
