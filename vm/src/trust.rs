//! The promises on which interpreter and heap rely, made where safe code can see what it promises.
//!
//! The loader, the names and the machine make heaps, code and stubs with these functions. Each names the fact
//! that makes its unsafe step sound; the rest of the machine needs no unsafe code for any of it.
//!
//! Not here: the verifier (`esl_bytecode::verify`), whose theorem V1 to V14 is what [`Verified`] stands for.

#![allow(unsafe_code)]

use std::fmt;

use esl_bytecode::builtin::Builtin;
use esl_bytecode::compile::Work;
use esl_bytecode::module::{FunctionNumber, Module};
use esl_bytecode::verify::{VerifyError, verify_function, verify_outline};

use esl_heap::store::StoredBytes;

use crate::heap::layout::CodeObject;
use crate::heap::{AllocError, CodeParts, Heap, HeapConfig, HeapImage};
use crate::shape::{CodeKind, Shape};
use crate::value::Value;

/// The code of a symbol without a function; the symbol is capture 0 of the function. As the next two, it
/// never runs: the interpreter goes by the shape.
pub(crate) const UNDEFINED_WORD: u32 = 0xC1;
/// The code of a function that has not been called yet: the loader puts its real code in place of this.
pub(crate) const LAZY_WORD: u32 = 0xC2;

/// Returns the code of a builtin, its number above the operation.
pub(crate) const fn native_word(builtin: Builtin) -> u32 {
    0xC0 | (builtin as u32) << 16
}

/// Creates the heap of a machine.
pub(crate) fn new_heap(config: HeapConfig) -> Heap {
    // SAFETY: a machine uses the values of its heap with no other, and drops both together. The documentation
    // of `Vm` requires the same of an embedder that gets hold of values.
    unsafe { Heap::new(config) }
}

/// Makes the contents of a machine's heap those of an image of it again, since when the machine's values are
/// restored with it. Returns whether it is one of this heap.
#[must_use]
pub(crate) fn restore_heap(heap: &mut Heap, image: &HeapImage) -> bool {
    // SAFETY: `snapshot` takes the image together with all values that the machine holds, and puts these back
    // together with it. The documentation of `Vm` requires the same of other holders of values.
    unsafe { heap.restore(image) }
}

/// The state of a machine between two turns, as bytes.
#[derive(Clone)]
pub struct MachineState {
    /// The bytes, from `start` on.
    bytes: Vec<u8>,
    start: usize,
}

impl MachineState {
    /// Takes bytes that [`Vm::store_state`](crate::vm::Vm::store_state) has made in a machine of this build.
    /// They are as trusted as this program: they contain code that no verifier sees.
    pub fn from_trusted_bytes(bytes: Vec<u8>) -> MachineState {
        MachineState { bytes, start: 0 }
    }

    /// As [`MachineState::from_trusted_bytes`], of bytes that follow others.
    pub fn from_trusted_end(bytes: Vec<u8>, start: usize) -> MachineState {
        MachineState { start: start.min(bytes.len()), bytes }
    }

    /// Returns the bytes.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes[self.start..]
    }
}

impl PartialEq for MachineState {
    fn eq(&self, other: &MachineState) -> bool {
        self.bytes() == other.bytes()
    }
}

impl Eq for MachineState {}

impl fmt::Debug for MachineState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "MachineState({} bytes)", self.bytes().len())
    }
}

/// Reads the state of a machine of this build, which was written with its heap in the same range of
/// addresses.
pub(crate) fn stored_bytes(state: &MachineState) -> StoredBytes<'_> {
    // SAFETY: `MachineState` holds what a machine has stored; an embedder that makes one of bytes promises
    // that they are those. `stored` reads the types that it writes, together with the contents of the heap.
    unsafe { StoredBytes::new(state.bytes()) }
}

/// Makes the contents of a machine's heap those that were stored, with which the machine's values are
/// replaced. `None` if they do not fit; then the machine is of no use.
pub(crate) fn load_heap(
    heap: &mut Heap,
    from: &mut StoredBytes<'_>,
    memory: &mut StoredBytes<'_>,
) -> Option<()> {
    // SAFETY: `MachineState` holds bytes of a heap in the same range, as `stored_bytes` says; the caller
    // replaces all values of the machine by those behind.
    unsafe { heap.load_contents(from, memory) }
}

/// Creates a vector of nothing yet for the loader of images, which does not pass it on and changes it by
/// [`Heap::own_vector_set`].
///
/// # Errors
/// As for every allocation.
pub(crate) fn alloc_image_table(heap: &mut Heap, len: usize) -> Result<Value, AllocError> {
    let table = heap.alloc_vector_filled(len, Value::UNSUPPLIED)?;
    // SAFETY: the loader does as said above; no program gets hold of its tables.
    unsafe { heap.own_vector(table) };
    Ok(table)
}

/// Creates a heap for a unit test that needs no machine.
#[cfg(test)]
pub(crate) fn heap_for_tests() -> Heap {
    new_heap(HeapConfig::default())
}

/// Evidence that a module has passed the verifier, or belongs to the image of the library, whose build has
/// verified it.
pub(crate) struct Verified(());

/// The verification of a module in parts. Each must be given the same module, unchanged: the loader keeps it
/// together with this.
#[derive(Default)]
pub(crate) struct Verification {
    /// Whether the parts that belong to no function are in order.
    has_begun: bool,
    /// Number of functions that are in order.
    passed: usize,
}

impl Verification {
    /// Goes on. Returns the evidence when all is verified; `None` if the work that is allowed is done before.
    ///
    /// # Errors
    /// The first rule that the module breaks.
    pub(crate) fn run(&mut self, module: &Module, work: &mut Work) -> Result<Option<Verified>, VerifyError> {
        if !self.has_begun {
            verify_outline(module)?;
            work.add((module.constants.len() / CONSTANTS_PER_UNIT) as u64);
            self.has_begun = true;
        }
        while let Some(function) = module.functions.get(self.passed) {
            if work.is_done() {
                return Ok(None);
            }
            work.add(1 + (function.code.len() / WORDS_PER_UNIT) as u64);
            verify_function(module, FunctionNumber(self.passed as u32))?;
            self.passed += 1;
        }
        Ok(Some(Verified(())))
    }
}

/// Constants that count as a unit of work where they are verified.
const CONSTANTS_PER_UNIT: usize = 32;
/// Words of code that count as a unit of work where they are verified.
const WORDS_PER_UNIT: usize = 3;

impl Verified {
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
    // SAFETY: the loader takes all parts from one function of the module that `_verified` stands for. That it
    // has fused instructions changes nothing that V1 to V14 say of them: see `fused`.
    unsafe { heap.alloc_code(parts) }
}

/// Creates code of one word of the machine's own, such as what stands in for a function that is not there
/// yet.
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
    assert_ne!(shape.kind, CodeKind::Bytecode, "a stub is not bytecode");
    let parts = CodeParts {
        name,
        debug: Value::NIL,
        owner,
        arity: CodeObject::ANY_ARITY,
        nregs: 0,
        spare: [shape.pack(), captures as u64],
        constants: &[],
        words: &[word],
    };
    // SAFETY: a call of code with `ANY_ARITY` goes by the shape, which is not that of bytecode: the word
    // never runs, and there are neither constants nor registers to look at.
    unsafe { heap.alloc_code(parts) }
}

/// Whether code reads captures of its function: only bytecode does, and `spare[1]` says how many.
fn reads_captures(code: &CodeObject) -> bool {
    Shape::unpack(code.spare[0]).kind == CodeKind::Bytecode && code.spare[1] != 0
}

/// Whether the code of a function is bytecode and no stub; `None` if `function` is none.
fn is_bytecode(heap: &Heap, function: Value) -> Option<bool> {
    let code = heap.code(heap.function_code(function)?)?;
    Some(Shape::unpack(code.spare[0]).kind == CodeKind::Bytecode)
}

/// Creates a function of code that reads no captures. The code that replaces a stub reads its captures.
///
/// # Errors
/// As for every allocation.
///
/// # Panics
/// If `code` is not a Code, or reads captures: then only `make-closure` makes functions of it.
pub(crate) fn alloc_function(heap: &mut Heap, code: Value, captures: &[Value]) -> Result<Value, AllocError> {
    assert!(!heap.code(code).is_none_or(reads_captures), "a function is made of code without captures");
    // SAFETY: the assertion: the code reads no captures, so any will do.
    unsafe { heap.alloc_function(code, captures) }
}

/// Sets a capture of a stub's function; `None` if its code is not a stub, or has no such capture.
pub(crate) fn set_stub_capture(heap: &mut Heap, function: Value, index: usize, value: Value) -> Option<()> {
    if is_bytecode(heap, function)? {
        return None;
    }
    // SAFETY: a stub is never executed, so nothing reads its captures but what replaces it.
    unsafe { heap.function_set_capture(function, index, value) }
}

/// Puts the real code of a function in place of its stub; `None` if the function has no stub, or the code
/// reads captures.
pub(crate) fn replace_stub(heap: &mut Heap, function: Value, code: Value) -> Option<()> {
    if is_bytecode(heap, function)? || reads_captures(heap.code(code)?) {
        return None;
    }
    // SAFETY: a stub is never executed, and the new code reads no captures.
    unsafe { heap.function_set_code(function, code) }
}

/// Fills in a constant of code that is being loaded and has not run: the code of an inner function.
pub(crate) fn set_constant(heap: &mut Heap, code: Value, index: usize, inner: Value) -> Option<()> {
    // SAFETY: the loader calls this for constants that the module declares as functions with captures, whose
    // code is what `make-closure` expects, and before it hands out the code.
    unsafe { heap.code_set_constant(code, index, inner) }
}
