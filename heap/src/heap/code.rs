//! Functions and code: creating them, and what is in them.
//!
//! The interpreter runs words and reads captures without a check, so whatever could make them other ones than
//! the verifier has seen is unsafe to call.

use std::slice;

use super::layout::{CodeObject, FunctionObject, Kind, MAX_LENGTH};
use super::{AllocError, Heap};
use crate::value::Value;

/// Parts of a Code object.
#[derive(Copy, Clone, Debug)]
pub struct CodeParts<'a> {
    /// Name in a backtrace.
    pub name: Value,
    /// Debug information, or `nil`.
    pub debug: Value,
    /// Owner, or `nil`.
    pub owner: Value,
    /// Exact number of arguments, or [`CodeObject::ANY_ARITY`].
    pub arity: u32,
    /// Number of registers of a frame.
    pub nregs: u32,
    /// Two words of the caller's own, such as the number of captures.
    pub spare: [u64; 2],
    /// Constants.
    pub constants: &'a [Value],
    /// Instruction words. `entry` will be the first of them.
    pub words: &'a [u32],
}

impl Heap {
    /// Creates a function: code with captured variables.
    ///
    /// # Safety
    /// The captures are what the code reads: as many, and boxes where it declares them as boxed.
    ///
    /// # Panics
    /// If `code` is not a Code.
    pub unsafe fn alloc_function(&mut self, code: Value, captures: &[Value]) -> Result<Value, AllocError> {
        assert_eq!(self.kind(code), Some(Kind::Code), "the code of a function is a Code");
        self.record_from(Kind::Function, 0, 0, &[code], captures)
    }

    /// Creates a function for the interpreter, which fills in the captures: they start out `nil`.
    ///
    /// # Safety
    /// `code` is a Code.
    pub unsafe fn alloc_closure(
        &mut self,
        code: Value,
        ncaptures: usize,
    ) -> Result<*mut FunctionObject, AllocError> {
        debug_assert_eq!(self.kind(code), Some(Kind::Code));
        let function = self.begin_object(Kind::Function, 0, 0, 1 + ncaptures)?.cast::<FunctionObject>();
        // SAFETY: `begin_object` gave room for the code and the captures; all are written before the address
        // is given out.
        unsafe {
            (&raw mut (*function).code).write(code);
            let captures = (&raw mut (*function).captures).cast::<Value>();
            for i in 0..ncaptures {
                captures.add(i).write(Value::NIL);
            }
        }
        function.expose_provenance();
        Ok(function)
    }

    /// Sets where code made from now on begins to run; `None` for its first word.
    ///
    /// # Safety
    /// The code at `entry` may run in place of any code, with that code's frame.
    pub unsafe fn set_code_entry(&mut self, entry: Option<&'static u32>) {
        self.code_entry = entry;
    }

    /// Creates code.
    ///
    /// # Safety
    /// Words, constants, registers and arity have passed the verifier together, or were made by the VM to the
    /// same rules: the interpreter runs them without a check.
    pub unsafe fn alloc_code(&mut self, parts: CodeParts<'_>) -> Result<Value, AllocError> {
        let (nconsts, nwords) = (parts.constants.len(), parts.words.len());
        let len = CodeObject::len(nconsts, nwords);
        if nconsts > MAX_LENGTH || nwords > MAX_LENGTH {
            return Err(AllocError::TooLarge { requested: len.saturating_mul(8) });
        }
        let object = self.begin_object(Kind::Code, 0, 0, len)?;
        let code = object.cast::<CodeObject>();
        // SAFETY: `begin_object` gave room for `len` units of 8 bytes, which `CodeObject::len` computed for
        // exactly these constants and words; everything is written before the value is made. Provenance is
        // exposed because the interpreter walks from `entry` through the whole object.
        unsafe {
            let constants = (&raw mut (*code).constants).cast::<Value>();
            let words = constants.add(nconsts).cast::<u32>();
            code.write(CodeObject {
                header: *object,
                name: parts.name,
                debug: parts.debug,
                owner: parts.owner,
                entry: self.code_entry.map_or(words.cast_const(), std::ptr::from_ref),
                arity: parts.arity,
                nregs: parts.nregs,
                nconsts: nconsts as u32,
                nwords: nwords as u32,
                spare: parts.spare,
                constants: [],
            });
            std::ptr::copy_nonoverlapping(parts.constants.as_ptr(), constants, nconsts);
            std::ptr::copy_nonoverlapping(parts.words.as_ptr(), words, nwords);
            Ok(Value::from_object(object))
        }
    }

    /// Returns the code of a function.
    #[inline(always)]
    pub fn function_code(&self, v: Value) -> Option<Value> {
        let object = self.object_of(v, Kind::Function)?;
        // SAFETY: H3: the kind says that this is a Function.
        Some(unsafe { (*object.cast::<FunctionObject>()).code })
    }

    /// Replaces the code of a function; `None` if `v` is not a function or `code` not a Code.
    ///
    /// # Safety
    /// The old code of the function is not being executed, and the new code reads no capture that the
    /// function lacks.
    pub unsafe fn function_set_code(&mut self, v: Value, code: Value) -> Option<()> {
        if !self.is(code, Kind::Code) {
            return None;
        }
        self.set_slot(v, Kind::Function, 0, code)
    }

    /// Sets a constant of code; `None` if `v` is not a Code or has no such constant.
    ///
    /// # Safety
    /// The code's words may run with the new constant: it is of the sort that they take for granted.
    pub unsafe fn code_set_constant(&mut self, v: Value, index: usize, new: Value) -> Option<()> {
        let object = self.object_of(v, Kind::Code)?;
        // SAFETY: H3: a Code has `nconsts` values at a fixed offset, and `index` is below that.
        unsafe {
            if index >= (*object.cast::<CodeObject>()).nconsts as usize {
                return None;
            }
            self.store(object.byte_add(CodeObject::CONSTANTS_OFFSET).cast::<Value>().add(index), new);
        }
        Some(())
    }

    /// Returns the captures of a function.
    pub fn function_captures(&self, v: Value) -> Option<&[Value]> {
        self.record(v, Kind::Function).map(|slots| &slots[1..])
    }

    /// Sets a capture of a function; `None` if `v` is not a function or has no such capture.
    ///
    /// # Safety
    /// The function's code may read the new value in place of the old one: a box where the capture is
    /// declared as boxed.
    pub unsafe fn function_set_capture(&mut self, v: Value, index: usize, new: Value) -> Option<()> {
        self.set_slot(v, Kind::Function, index.checked_add(1)?, new)
    }

    /// Returns the fixed part of code.
    #[inline(always)]
    pub fn code(&self, v: Value) -> Option<&CodeObject> {
        let object = self.object_of(v, Kind::Code)?;
        // SAFETY: H3: the kind says that this is a Code; H5: it is borrowed with the heap.
        Some(unsafe { &*object.cast() })
    }

    /// Returns the constants of code.
    pub fn code_constants(&self, v: Value) -> Option<&[Value]> {
        let object = self.object_of(v, Kind::Code)?;
        // SAFETY: H3: a Code has `nconsts` values at a fixed offset; H5: they are borrowed with the heap.
        unsafe {
            let n = (*object.cast::<CodeObject>()).nconsts as usize;
            Some(slice::from_raw_parts(object.byte_add(CodeObject::CONSTANTS_OFFSET).cast(), n))
        }
    }

    /// Returns the instruction words of code.
    pub fn code_words(&self, v: Value) -> Option<&[u32]> {
        let object = self.object_of(v, Kind::Code)?;
        // SAFETY: H3: a Code has `nwords` words after its constants; H5: they are borrowed with the heap.
        unsafe {
            let code = &*object.cast::<CodeObject>();
            Some(slice::from_raw_parts(object.byte_add(code.words_offset()).cast(), code.nwords as usize))
        }
    }
}
