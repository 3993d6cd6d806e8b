//! Functions that have left by a tail call, as far as code tells which they were.
//!
//! A tail call replaces the frame of its function, and notes nothing. But the call in the frame below names
//! the function that was called. If another one runs in its place, tail calls have led from the former to the
//! latter. Where the code of a function has a single tail call that may have led there, its place is known.
//!
//! The named function has been called, unless its name got another function since. Nothing is claimed of a
//! function that was called as a value, nor of what a tail call of a value or one of several has led to.

use std::collections::HashSet;

use esl_bytecode::opcode::{CallTarget, Instr, Opcode};
use esl_bytecode::word::Word;

use crate::fused::{original, unfused};
use crate::interp::frames::Frame;
use crate::names::load::is_of_library;
use crate::shape::{CodeKind, Shape};
use crate::value::Value;
use crate::vm::Vm;

/// Most functions that are found between two frames.
const MOST: usize = 8;
/// Words of code that are read for one note.
const WORDS: usize = 1 << 13;
/// Units of work that reading a word counts as.
pub(super) const UNITS_PER_WORD: usize = 8;
/// Words of the instruction of a call.
const CALL_WORDS: usize = 2;

/// A function that has left by a tail call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct TailCaller {
    /// Its code.
    pub(super) code: Value,
    /// Word of the tail call; `None` if there are several that may have led on.
    pub(super) word: Option<usize>,
}

/// A tail call in some code: its word, and the code of the function that it calls; `None` if that is any.
#[derive(Clone, Copy)]
struct TailCall {
    word: usize,
    callee: Option<Value>,
}

/// A search for functions that have left by tail calls.
pub(super) struct TailCallSearch<'a> {
    vm: &'a Vm,
    /// Number of words of code that it has read.
    pub(super) words: usize,
}

impl<'a> TailCallSearch<'a> {
    pub(super) fn new(vm: &'a Vm) -> TailCallSearch<'a> {
        TailCallSearch { vm, words: 0 }
    }

    /// Returns the functions that have left between a call of `called` and `running`, in whose frame the
    /// former stood, innermost first. Both are codes.
    pub(super) fn between(&mut self, called: Value, running: Value) -> Vec<TailCaller> {
        let mut chain: Vec<TailCaller> = Vec::new();
        let mut code = called;
        while code != running && chain.len() < MOST && self.is_of_program(code) {
            let calls = self.tail_calls(code);
            let passed: Vec<Value> = chain.iter().map(|caller| caller.code).chain([code]).collect();
            let leading: Vec<TailCall> =
                calls.into_iter().filter(|call| self.leads(*call, running, &passed)).collect();
            match leading[..] {
                // The name has got another function since.
                [] if !self.is_spent() => break,
                [TailCall { word, callee }] => {
                    chain.push(TailCaller { code, word: Some(word) });
                    let Some(callee) = callee else { break };
                    code = callee;
                }
                _ => {
                    chain.push(TailCaller { code, word: None });
                    break;
                }
            }
        }
        chain.reverse();
        chain
    }

    /// Returns the code of the function that the call at which `caller` stands names, if it names one.
    pub(super) fn named_by(&self, caller: &Frame<'_>) -> Option<Value> {
        // The machine itself has called what runs above an instruction.
        let word = if caller.is_exact { None } else { caller.word.checked_sub(CALL_WORDS) }?;
        let heap = &self.vm.heap;
        let code = heap.function_code(caller.function)?;
        let words = heap.code_words(code)?;
        let call = [original(Word(*words.get(word)?)).0, *words.get(word + 1)?];
        match Instr::decode(&call, 0)? {
            Instr::CallGlobal { symbol, .. } => self.code_of_global(code, symbol.0),
            call if call.opcode().callee() == Some(CallTarget::Running) => Some(code),
            _ => None,
        }
    }

    /// Returns the code of the function of the symbol that is constant `index` of some code.
    fn code_of_global(&self, code: Value, index: u32) -> Option<Value> {
        let heap = &self.vm.heap;
        let symbol = *heap.code_constants(code)?.get(index as usize)?;
        heap.function_code(heap.symbol(symbol)?.function)
    }

    fn is_of_program(&self, code: Value) -> bool {
        self.vm.heap.code(code).is_some_and(|code| !is_of_library(code))
    }

    /// Returns whether it may read no more.
    fn is_spent(&self) -> bool {
        self.words >= WORDS
    }

    /// Returns the tail calls in some code that call functions of bytecode. Others that were never called are
    /// not loaded yet, and builtins have no frame.
    fn tail_calls(&mut self, code: Value) -> Vec<TailCall> {
        let heap = &self.vm.heap;
        let is_bytecode = |code: Value| {
            heap.code(code).is_some_and(|code| Shape::unpack(code.spare[0]).kind == CodeKind::Bytecode)
        };
        if self.is_spent() || !is_bytecode(code) {
            return Vec::new();
        }
        let words = unfused(heap.code_words(code).unwrap_or_default());
        self.words += words.len();
        let (mut calls, mut word) = (Vec::new(), 0);
        while let Some(instruction) = Instr::decode(&words, word) {
            match instruction {
                Instr::TailCallGlobal { symbol, .. } => {
                    let callee = self.code_of_global(code, symbol.0).filter(|&callee| is_bytecode(callee));
                    calls.extend(callee.map(|callee| TailCall { word, callee: Some(callee) }));
                }
                Instr::TailCall { .. } | Instr::TailApply { .. } => {
                    calls.push(TailCall { word, callee: None });
                }
                _ => {}
            }
            word += Opcode::words(instruction.opcode());
        }
        calls
    }

    /// Returns whether a tail call may lead to the function of the code `running`, without those of `passed`.
    fn leads(&mut self, call: TailCall, running: Value, passed: &[Value]) -> bool {
        let Some(callee) = call.callee else { return true };
        let mut seen: HashSet<u64> = passed.iter().map(|code| code.bits()).collect();
        let mut open = vec![callee];
        while let Some(code) = open.pop() {
            if code == running || self.is_spent() {
                return true;
            }
            if !seen.insert(code.bits()) {
                continue;
            }
            for call in self.tail_calls(code) {
                match call.callee {
                    Some(callee) => open.push(callee),
                    None => return true,
                }
            }
        }
        false
    }
}
