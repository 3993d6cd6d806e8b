//! The promises on which interpreter and heap rely, made where safe code can see what it promises.
//!
//! The loader, the world and the machine make heaps, code and stubs with these functions. Each names the fact that makes
//! its unsafe step sound; the rest of the machine needs no unsafe code for any of it.
//!
//! Not here: the verifier (`esl_bytecode::verify`), whose theorem V1 to V13 is what [`Verified`] stands for.

use esl_bytecode::module::Module;
use esl_bytecode::verify::{VerifyError, verify};

use crate::heap::layout::Code;
use crate::heap::{AllocError, CodeParts, Heap, HeapConfig};
use crate::shape::{Shape, Sort};
use crate::value::Value;

/// Creates the heap of a machine.
pub(crate) fn new_heap(config: HeapConfig) -> Heap {
    // SAFETY: a machine uses the values of its heap with no other, and drops both together. The documentation of `Vm` asks
    // the same of an embedder who gets hold of values.
    unsafe { Heap::new(config) }
}

/// Creates a heap for a unit test that needs no machine.
#[cfg(test)]
pub(crate) fn heap_for_tests() -> Heap {
    new_heap(HeapConfig::default())
}

/// Evidence that a module has passed the verifier, or belongs to the image of the library, whose build has verified it.
pub(crate) struct Verified(());

impl Verified {
    /// Verifies a module.
    ///
    /// # Errors
    /// The first rule that the module breaks.
    pub(crate) fn module(module: &Module) -> Result<Verified, VerifyError> {
        verify(module).map(|()| Verified(()))
    }

    /// Vouches for an image, which is part of this program.
    pub(crate) fn image() -> Verified {
        Verified(())
    }
}

/// Creates the code of a verified function, laid out as [`crate::shape`] says.
///
/// # Errors
/// As for every allocation.
pub(crate) fn alloc_code(
    heap: &mut Heap,
    parts: CodeParts<'_>,
    _verified: &Verified,
) -> Result<Value, AllocError> {
    // SAFETY: the loader takes all parts from one function of the module that `_verified` stands for.
    unsafe { heap.alloc_code(parts) }
}

/// Creates code of one word of the machine's own, such as what stands in for a function that is not there yet.
///
/// # Errors
/// As for every allocation.
///
/// # Panics
/// If `shape` is that of bytecode.
pub(crate) fn alloc_stub(
    heap: &mut Heap,
    name: Value,
    owner: Value,
    shape: Shape,
    captures: usize,
    word: u32,
) -> Result<Value, AllocError> {
    assert_ne!(shape.sort, Sort::Bytecode, "a stub is no bytecode");
    let parts = CodeParts {
        name,
        debug: Value::NIL,
        owner,
        arity: Code::ANY_ARITY,
        nregs: 0,
        spare: [shape.pack(), captures as u64],
        constants: &[],
        words: &[word],
    };
    // SAFETY: a call of code with `ANY_ARITY` goes by the shape, which is not that of bytecode: the word never runs, and
    // there are neither constants nor registers to look at.
    unsafe { heap.alloc_code(parts) }
}

/// Puts the real code of a function in place of its stub; `None` if the function has another sort of code, or fewer
/// captures than the new code reads.
pub(crate) fn replace_stub(heap: &mut Heap, function: Value, code: Value) -> Option<()> {
    let captures = heap.code(code)?.spare[1] as usize;
    let old = heap.code(heap.function_code(function)?)?;
    if Shape::unpack(old.spare[0]).sort == Sort::Bytecode
        || captures > heap.function_captures(function)?.len()
    {
        return None;
    }
    // SAFETY: a stub is never executed, and `spare[1]` is the number of captures that the code reads.
    unsafe { heap.function_set_code(function, code) }
}

/// Fills in a constant of code that is being loaded and has not run: the code of an inner function.
pub(crate) fn set_constant(heap: &mut Heap, code: Value, index: usize, inner: Value) -> Option<()> {
    // SAFETY: the loader calls this for the constants that the module declares as functions, before it hands out the code.
    unsafe { heap.code_set_constant(code, index, inner) }
}
