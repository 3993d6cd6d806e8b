//! Variables that find no room in the registers of a frame: they live in a vector on the heap.
//!
//! This happens only in forms that do not fit otherwise. The frame makes a vector when it is entered, and
//! variables that are bound while many registers are in use get places in it. Variables in boxes keep their
//! registers, since boxes must not get into other objects; closures take copies, as of all variables that are
//! never assigned.

use esl_bytecode::builtin::Builtin;
use esl_bytecode::opcode::Instr;
use esl_bytecode::operand::*;
use rustc_hash::FxHashMap;

use super::builder::{FunctionBuilder, Spill};
use crate::core::VarId;

impl FunctionBuilder<'_, '_> {
    /// Lowers the creation of the vector, at the beginning of the function.
    pub(super) fn make_spill(&mut self) {
        let window = self.registers.top();
        self.registers.take(4);
        self.emit(Instr::LoadInt { dst: window.offset(2).into(), value: Int16(0) });
        self.emit(Instr::LoadNil { first: window.offset(3).into(), count: Count(1) });
        let builtin = BuiltinIdx(Builtin::MakeVector.number());
        self.emit(Instr::CallBuiltin { window: window.into(), count: Count(2), want: Want::ONE, builtin });
        self.registers.release(window);
        let register = self.registers.take(1);
        self.spill = Some(Spill { register, places: FxHashMap::default(), next: 0, size: 0 });
        // Tail calls of the function itself keep the vector.
        let entry = self.graph.label();
        self.graph.bind(entry);
        self.entry = entry;
    }

    /// Sets the size of the vector, or leaves the vector out if no variable needs it.
    pub(super) fn finish_spill(&mut self) {
        let Some(spill) = &self.spill else { return };
        let first = self.graph.order[0].index();
        let ops = &mut self.graph.segments[first].ops;
        match ops.first_mut() {
            Some(op) if spill.size > 0 => {
                if let Instr::LoadInt { value, .. } = &mut op.instr {
                    *value = Int16(spill.size);
                }
            }
            _ => ops.clear(),
        }
    }

    /// Moves a variable whose value is in the first free register into the vector, if it belongs there.
    /// Returns whether it did.
    pub(super) fn spill_variable(&mut self, variable: VarId) -> bool {
        let is_boxed = self.module.resolution.is_boxed(variable);
        let value = self.registers.top();
        let is_late = self.module.spills_from.is_some_and(|from| value.0 >= from);
        let Some(spill) = self.spill.as_mut().filter(|spill| is_late && !is_boxed && spill.next < i16::MAX)
        else {
            return false;
        };
        let place = Int16(spill.next);
        spill.next += 1;
        spill.size = spill.size.max(spill.next);
        spill.places.insert(variable, place);
        self.registers.take(1);
        self.store_spilled(place, value);
        self.registers.release(value);
        true
    }

    /// Returns the place of a variable in the vector, if it has one.
    pub(super) fn spilled(&self, variable: VarId) -> Option<Int16> {
        self.spill.as_ref()?.places.get(&variable).copied()
    }

    /// Stores the value of a register at a place of the vector.
    pub(super) fn store_spilled(&mut self, place: Int16, value: Reg) {
        let Some(spill) = &self.spill else { return };
        let vector = spill.register;
        if let Ok(index) = u8::try_from(place.0) {
            return self.emit(Instr::VectorSetInt { vector, index: Index(index), value });
        }
        let index = self.registers.take(1);
        self.emit(Instr::LoadInt { dst: index.into(), value: place });
        self.emit(Instr::VectorSet { vector, index, value });
        self.registers.release(index);
    }

    /// Loads the value at a place of the vector.
    pub(super) fn load_spilled(&mut self, place: Int16, register: Reg) {
        let Some(spill) = &self.spill else { return };
        let vector = spill.register;
        if let Ok(index) = u8::try_from(place.0) {
            return self.emit(Instr::VectorRefInt { dst: register.into(), vector, index: Index(index) });
        }
        self.emit(Instr::LoadInt { dst: register.into(), value: place });
        self.emit(Instr::VectorRef { dst: register.into(), vector, index: register });
    }

    /// Returns the number of places in use, for [`FunctionBuilder::release_spilled`] when variables go out of
    /// scope.
    pub(super) fn spill_height(&self) -> i16 {
        self.spill.as_ref().map_or(0, |spill| spill.next)
    }

    /// Frees the places from `height` on.
    pub(super) fn release_spilled(&mut self, height: i16) {
        if let Some(spill) = &mut self.spill {
            spill.next = height;
        }
    }
}
