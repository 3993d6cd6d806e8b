//! Parts of objects: halves of pairs, elements, slots of structures, captures.

use std::mem::offset_of;

use cranelift_codegen::ir::condcodes::IntCC;
use cranelift_codegen::ir::{Block, InstBuilder, Value as Ssa, types};
use esl_heap::Value;
use esl_heap::heap::Kind;
use esl_heap::heap::layout::{FunctionObject, Header, Str};

use crate::abi::{AGAIN, GUESSED_WRONG, NativeContext};
use crate::emit::{ELEMENTS, WORD, in_cons, in_object, memory};
use crate::kinds::Known;
use crate::translate::Translator;

/// Where an instruction has the index of an element.
#[derive(Clone, Copy)]
pub(crate) enum ElementIndex {
    /// In a register.
    Register(u8),
    /// In itself.
    Number(u8),
}

impl Translator<'_, '_> {
    /// Returns the address of the element of a simple vector that a fixnum names, less [`ELEMENTS`] and the
    /// tag; goes to `otherwise` if there is none.
    pub(crate) fn element(&mut self, vector: Ssa, index: (Ssa, Known), otherwise: Block) -> Ssa {
        self.require_kind(vector, Kind::SimpleVector, otherwise);
        let at = self.index(vector, index, otherwise);
        let offset = self.b.ins().ishl_imm_s(at, 3);
        self.b.ins().iadd(vector, offset)
    }

    /// Returns the number that a fixnum is, if it is below the length of an object.
    pub(crate) fn index(&mut self, object: Ssa, index: (Ssa, Known), otherwise: Block) -> Ssa {
        let length = self.length(object);
        self.index_below(length, index, otherwise)
    }

    /// Returns the number that a fixnum is, if it is below a length.
    pub(crate) fn index_below(&mut self, length: Ssa, index: (Ssa, Known), otherwise: Block) -> Ssa {
        if index.1 != Known::Fixnum {
            let tag = self.b.ins().band_imm_s(index.0, 3);
            self.refuse(tag, otherwise);
        }
        let at = self.b.ins().ushr_imm_s(index.0, 2);
        let is_below = self.b.ins().icmp(IntCC::UnsignedLessThan, at, length);
        self.require(is_below, otherwise);
        at
    }

    /// Follows halves of pairs.
    pub(crate) fn follow(&mut self, dst: u8, list: u8, halves: &[usize]) {
        let (mut value, slow) = (self.get(list), self.cold_block());
        for &half in halves {
            let is_cons = self.is_cons(value);
            self.require(is_cons, slow);
            value = self.load(value, in_cons(half));
        }
        self.finish_with(slow, value, dst);
    }

    pub(crate) fn set_half(&mut self, pair: u8, value: u8, half: usize) {
        let (pair, value, slow) = (self.get(pair), self.get(value), self.cold_block());
        let is_cons = self.is_cons(pair);
        self.require(is_cons, slow);
        self.store_slot(value, pair, in_cons(half));
        self.finish_effect(slow);
    }

    /// An element of a simple vector. The interpreter handles other arrays and invalid indexes. One that is
    /// guessed to be a double stays unspilled, and joins the batch.
    pub(crate) fn simple_element_ref(&mut self, dst: u8, vector: u8, index: ElementIndex) {
        if self.guess == Some(dst) {
            let (vector, index) = (self.get(vector), self.index_operand(index));
            let exit = self.exit_of_batch(AGAIN);
            let element = self.simple_element(vector, index, exit);
            let value = self.load(element, in_object(ELEMENTS as usize));
            let wrong = self.exit_of_batch(GUESSED_WRONG);
            let double = self.double_of(value, wrong);
            return self.set_double_of(dst, double, value);
        }
        self.close_batch();
        let (vector, index, exit) = (self.get(vector), self.index_operand(index), self.exit());
        let element = self.simple_element(vector, index, exit);
        let value = self.load(element, in_object(ELEMENTS as usize));
        self.set(dst, value, Known::Nothing);
    }

    fn index_operand(&mut self, index: ElementIndex) -> (Ssa, Known) {
        match index {
            ElementIndex::Register(register) => self.operand(register),
            ElementIndex::Number(number) => self.fixnum(i32::from(number)),
        }
    }

    /// As [`Translator::element`], on the path that control always takes. Neither kind nor length of a vector
    /// changes, so they are looked at once.
    fn simple_element(&mut self, vector: Ssa, index: (Ssa, Known), exit: Block) -> Ssa {
        let length = match self.lengths.get(&vector) {
            Some(&length) => length,
            None => {
                self.require_kind(vector, Kind::SimpleVector, exit);
                let length = self.length(vector);
                self.lengths.insert(vector, length);
                length
            }
        };
        let at = self.index_below(length, index, exit);
        let offset = self.b.ins().ishl_imm_s(at, 3);
        self.b.ins().iadd(vector, offset)
    }

    /// As [`Translator::simple_element_ref`], for an assignment.
    pub(crate) fn simple_element_set(&mut self, vector: u8, index: ElementIndex, value: u8) {
        self.make_word(usize::from(value));
        let (vector, index, exit) = (self.get(vector), self.index_operand(index), self.exit());
        let (value, known) = self.operand(value);
        let element = self.simple_element(vector, index, exit);
        if known == Known::Double {
            return self.store_double_in_slot(value, element, in_object(ELEMENTS as usize));
        }
        self.store_slot(value, element, in_object(ELEMENTS as usize));
    }

    pub(crate) fn element_ref(&mut self, dst: u8, vector: u8, index: u8) {
        let (vector, index, slow) = (self.get(vector), self.operand(index), self.cold_block());
        let element = self.element(vector, index, slow);
        let value = self.load(element, in_object(ELEMENTS as usize));
        self.finish_with(slow, value, dst);
    }

    pub(crate) fn element_set(&mut self, vector: u8, index: u8, value: u8) {
        self.make_word(usize::from(value));
        let (vector, index, slow) = (self.get(vector), self.operand(index), self.cold_block());
        let value = self.get(value);
        let element = self.element(vector, index, slow);
        self.store_slot(value, element, in_object(ELEMENTS as usize));
        self.finish_effect(slow);
    }

    pub(crate) fn char_ref(&mut self, dst: u8, string: u8, index: u8) {
        let (string, index, slow) = (self.get(string), self.operand(index), self.cold_block());
        self.require_kind(string, Kind::String, slow);
        let at = self.index(string, index, slow);
        let offset = self.b.ins().ishl_imm_s(at, 2);
        let place = self.b.ins().iadd(string, offset);
        let code = self.load_u32(place, in_object(offset_of!(Str, characters)));
        let is_code =
            self.b.ins().icmp_imm_s(IntCC::UnsignedLessThan, code, i64::from(Value::CHARACTER_LIMIT));
        self.require(is_code, slow);
        let shifted = self.b.ins().ishl_imm_s(code, 8);
        let mark = Value::character(0).map_or(0, Value::bits);
        let value = self.b.ins().bor_imm_s(shifted, mark as i64);
        self.finish_with(slow, value, dst);
    }

    /// Returns where a slot of an instance of just this class is, from the value on.
    pub(crate) fn slot(&mut self, instance: Ssa, slot: u8, class: u32, slow: Block) -> i32 {
        self.require_class(instance, class as usize, slow);
        // The class comes before the slots.
        let place = i64::from(slot) + 1;
        let length = self.length(instance);
        let is_there = self.b.ins().icmp_imm_s(IntCC::UnsignedGreaterThan, length, place);
        self.require(is_there, slow);
        in_object(ELEMENTS as usize) + place as i32 * WORD
    }

    pub(crate) fn capture(&mut self, index: u8) -> Ssa {
        let function = self.running();
        self.load(function, capture(index))
    }

    /// Returns those of the flags that a symbol has.
    pub(crate) fn flags(&mut self, symbol: Ssa, flags: u8) -> Ssa {
        let found = self.b.ins().uload8(types::I64, memory(), symbol, in_object(offset_of!(Header, flags)));
        self.b.ins().band_imm_s(found, i64::from(flags))
    }

    /// Makes a pair: by a function of the machine that reads no frame, or by the machine if that takes a
    /// look at the heap.
    pub(crate) fn cons(&mut self, dst: u8, car: u8, cdr: u8) {
        self.make_word(usize::from(car));
        self.make_word(usize::from(cdr));
        let (car, cdr, slow) = (self.get(car), self.get(cdr), self.cold_block());
        let (context, helper) = (self.context, self.load_context(offset_of!(NativeContext, cons)));
        let call = self.b.ins().call_indirect(self.helper_signature, helper, &[context, car, cdr]);
        let pair = self.b.inst_results(call)[0];
        self.require(pair, slow);
        self.finish_with(slow, pair, dst);
    }
}

/// Where a capture of a function is, from its value on.
pub(crate) fn capture(index: u8) -> i32 {
    in_object(offset_of!(FunctionObject, captures)) + i32::from(index) * WORD
}
