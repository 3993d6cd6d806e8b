//! Heaps and symbols for the unit tests of crates that work on a heap and have no machine.
//!
//! A machine makes its heap and the code of its functions itself, and keeps the promises of the heap's unsafe
//! functions. A crate that forbids unsafe code has its tests take both from here.
#![allow(unsafe_code)]

use esl_heap::heap::CodeParts;
use esl_heap::heap::layout::CodeObject;
use esl_heap::{AllocError, Heap, HeapConfig, Value};

/// Creates a heap for one test, which uses the values of the heap with no other, and not after it.
pub fn heap() -> Heap {
    // SAFETY: a test has one heap, and drops its values with the heap.
    unsafe { Heap::new(HeapConfig::default()) }
}

/// Creates a symbol with a home package, as the machine's are. Its function cannot be called.
///
/// # Errors
/// As for every allocation.
pub fn symbol(heap: &mut Heap, name: &str) -> Result<Value, AllocError> {
    let name = heap.alloc_str(name)?;
    let parts = CodeParts {
        name: Value::NIL,
        debug: Value::NIL,
        owner: Value::NIL,
        arity: CodeObject::ANY_ARITY,
        nregs: 0,
        spare: [0; 2],
        constants: &[],
        words: &[0],
    };
    // SAFETY: without an interpreter no code runs, and this one has neither constants nor registers.
    let code = unsafe { heap.alloc_code(parts)? };
    // SAFETY: the code never runs, so it reads no captures.
    let function = unsafe { heap.alloc_function(code, &[])? };
    heap.alloc_symbol(0, name, Value::T, function)
}
