//! Elements of arrays of two dimensions, in line where the array keeps any values and is not displaced; all
//! others are the builtin's, which `AREF` and its assignment are.

use std::mem::offset_of;

use cranelift_codegen::ir::condcodes::IntCC;
use cranelift_codegen::ir::{Block, InstBuilder, Value as Ssa, types};
use esl_bytecode::builtin::Builtin;
use esl_heap::Value;
use esl_heap::heap::Kind;
use esl_heap::heap::layout::{Array, Header};

use crate::emit::{ELEMENTS, WORD, in_object, memory};
use crate::kinds::Known;
use crate::translate::Translator;

/// The operation of a builtin on an element.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum ElementOperation {
    Get,
    Set,
}

impl ElementOperation {
    /// Returns the operation of a builtin that is called with so many arguments, if it has one on elements of
    /// arrays of two dimensions.
    pub(crate) fn of(builtin: u32, count: u8) -> Option<ElementOperation> {
        match count {
            3 if builtin == Builtin::Aref.number() => Some(ElementOperation::Get),
            4 if builtin == Builtin::SetAref.number() => Some(ElementOperation::Set),
            _ => None,
        }
    }
}

impl Translator<'_, '_> {
    /// Does a builtin of the elements of arrays. Its ticks are those of the machine: one.
    pub(crate) fn matrix_element(&mut self, window: u8, operation: ElementOperation) {
        self.spill();
        self.tick();
        let (slow, (done, value)) = (self.cold_block(), self.block_with_value());
        self.require_nothing_due(slow);
        let element = self.place_in_matrix(window, slow);
        let at = in_object(ELEMENTS as usize);
        let found = match operation {
            ElementOperation::Get => self.load(element, at),
            ElementOperation::Set => {
                let given = self.get(window + 5);
                self.store_slot(given, element, at);
                given
            }
        };
        self.jump_with(done, found);

        self.go_to(slow);
        let found = self.value_of_builtin(window);
        self.jump_with(done, found);
        self.go_to(done);
        self.set(window, value, Known::Nothing);
    }

    /// Returns the address of an element, less that of elements.
    fn place_in_matrix(&mut self, window: u8, slow: Block) -> Ssa {
        let array = self.get(window + 2);
        self.require_kind(array, Kind::Array, slow);
        let rank = self.b.ins().uload16(types::I64, memory(), array, in_object(offset_of!(Header, aux)));
        let has_two = self.equals(rank, 2);
        self.require(has_two, slow);
        let offset = self.load(array, in_object(offset_of!(Array, offset)));
        let is_all_there = self.equals(offset, Value::NIL.bits());
        self.require(is_all_there, slow);
        let data = self.load(array, in_object(offset_of!(Array, data)));
        self.require_kind(data, Kind::SimpleVector, slow);
        let row = self.below_dimension((array, 0), window + 3, slow);
        let column = self.below_dimension((array, 1), window + 4, slow);
        let columns = self.dimension(array, 1);
        let before = self.b.ins().imul(row, columns);
        let at = self.b.ins().iadd(before, column);
        // The data may have lost elements that the dimensions promise.
        let length = self.length(data);
        let is_there = self.b.ins().icmp(IntCC::UnsignedLessThan, at, length);
        self.require(is_there, slow);
        let distance = self.b.ins().ishl_imm_s(at, 3);
        self.b.ins().iadd(data, distance)
    }

    /// Returns the number that a subscript is, if it is below a dimension of an array.
    fn below_dimension(&mut self, (array, axis): (Ssa, i32), subscript: u8, slow: Block) -> Ssa {
        let subscript = self.operand(subscript);
        let dimension = self.dimension(array, axis);
        self.index_below(dimension, subscript, slow)
    }

    /// Returns a dimension, a fixnum that is not negative, as a number.
    fn dimension(&mut self, array: Ssa, axis: i32) -> Ssa {
        let dimension = self.load(array, in_object(offset_of!(Array, dimensions)) + axis * WORD);
        self.b.ins().ushr_imm_s(dimension, 2)
    }
}
