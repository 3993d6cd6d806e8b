//! Variables that find no room in the registers of a frame: they live in a vector on the heap.
//!
//! This happens only in forms that have not fit otherwise. A frame then makes a vector when it is entered, and variables
//! that are bound while many registers are in use get places in it. Variables in boxes keep their registers,
//! since boxes must not get into other objects; closures take copies, as of all variables that are not assigned.

use esl_bytecode::builtin::Builtin;
use esl_bytecode::opcode::Instr;
use esl_bytecode::operand::*;
use rustc_hash::FxHashMap;

use super::frame::Frame;
use crate::core::VarId;

/// The vector of a frame.
#[derive(Debug)]
pub(super) struct Spill {
    /// The register that holds it.
    register: u8,
    /// The places of variables.
    places: FxHashMap<VarId, Int16>,
    next: i16,
    size: i16,
}

impl Frame<'_, '_> {
    /// Lowers the making of the vector, at the beginning of the function.
    pub(super) fn make_spill(&mut self) {
        let window = self.registers.top();
        self.registers.take(4);
        self.emit(Instr::LoadInt { dst: Dst(window.saturating_add(2)), value: Int16(0) });
        self.emit(Instr::LoadNil { first: Base(window.saturating_add(3)), count: Count(1) });
        let builtin = BuiltinIdx(Builtin::MakeVector.number());
        self.emit(Instr::CallBuiltin { window: Base(window), count: Count(2), want: Want::ONE, builtin });
        self.registers.release(window);
        let register = self.registers.take(1);
        self.spill = Some(Spill { register, places: FxHashMap::default(), next: 0, size: 0 });
        // Tail calls of the function itself go on with the vector that there is.
        let entry = self.graph.label();
        self.graph.bind(entry);
        self.entry = entry;
    }

    /// Sets the size of the vector, or makes none if nothing needs it.
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

    /// Moves a variable that has just got its value, in the first free register, into the vector, if that is its place.
    pub(super) fn spill_variable(&mut self, variable: VarId) -> bool {
        let is_boxed = self.builder.resolution.is_boxed(variable);
        let value = self.registers.top();
        let is_late = self.builder.spills_from.is_some_and(|from| value >= from);
        let Some(spill) = self.spill.as_mut().filter(|spill| is_late && !is_boxed && spill.next < i16::MAX)
        else {
            return false;
        };
        let place = Int16(spill.next);
        spill.next += 1;
        spill.size = spill.size.max(spill.next);
        spill.places.insert(variable, place);
        self.registers.take(1);
        self.store_spilled(place, Reg(value));
        self.registers.release(value);
        true
    }

    /// The place of a variable in the vector, if it has one.
    pub(super) fn spilled(&self, variable: VarId) -> Option<Int16> {
        self.spill.as_ref()?.places.get(&variable).copied()
    }

    /// Stores the value of a register at a place of the vector.
    pub(super) fn store_spilled(&mut self, place: Int16, value: Reg) {
        let Some(spill) = &self.spill else { return };
        let vector = Reg(spill.register);
        let index = self.registers.take(1);
        self.emit(Instr::LoadInt { dst: Dst(index), value: place });
        self.emit(Instr::VectorSet { vector, index: Reg(index), value });
        self.registers.release(index);
    }

    /// Loads what is at a place of the vector.
    pub(super) fn load_spilled(&mut self, place: Int16, register: u8) {
        let Some(spill) = &self.spill else { return };
        let vector = Reg(spill.register);
        self.emit(Instr::LoadInt { dst: Dst(register), value: place });
        self.emit(Instr::VectorRef { dst: Dst(register), vector, index: Reg(register) });
    }

    /// How many places are taken, to be given to [`Frame::release_spilled`] when variables go out of scope.
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
