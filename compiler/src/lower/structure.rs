//! Slots of structures and tests for their classes.

use esl_bytecode::Integer;
use esl_bytecode::builtin::Builtin;
use esl_bytecode::opcode::Instr;
use esl_bytecode::operand::*;
use esl_bytecode::symbol::Symbol;

use super::builder::FunctionBuilder;
use super::dest::Dest;
use super::graph::Cond;
use crate::core::NodeId;

impl FunctionBuilder<'_, '_> {
    fn class_index(&mut self, class: &Symbol) -> u16 {
        let entry = self.module.pool.class(class);
        self.constant_index(entry)
    }

    /// Reads a slot.
    pub(super) fn slot(&mut self, class: &Symbol, slot: u16, instance: NodeId, dest: Dest) {
        let top = self.registers.top();
        let Ok(narrow) = u8::try_from(slot) else {
            return self.distant_slot(Builtin::SlotOf, class, slot, &[instance], dest);
        };
        let instance = self.operand(instance, &[]);
        self.registers.release(top);
        let class = WideClassIdx(u32::from(self.class_index(class)));
        self.compute(dest, |dst| Instr::Slot { dst, instance, slot: Index(narrow), class });
    }

    /// Sets a slot.
    pub(super) fn set_slot(
        &mut self,
        class: &Symbol,
        slot: u16,
        instance: NodeId,
        value: NodeId,
        dest: Dest,
    ) {
        let top = self.registers.top();
        // Where the value of the form is used, what a recovery procedure gives takes its place, as for any
        // call; the instruction has no result that it could replace.
        let (Ok(narrow), Dest::Effect) = (u8::try_from(slot), dest) else {
            return self.distant_slot(Builtin::SetSlotOf, class, slot, &[instance, value], dest);
        };
        let instance = self.operand(instance, &[value]);
        let value = self.operand(value, &[]);
        let class = WideClassIdx(u32::from(self.class_index(class)));
        self.emit(Instr::SetSlot { instance, slot: Index(narrow), value, class });
        self.registers.release(top);
    }

    /// Lowers access to a slot by a builtin: its number does not fit the instruction, or the value is used.
    fn distant_slot(&mut self, builtin: Builtin, class: &Symbol, slot: u16, forms: &[NodeId], dest: Dest) {
        let window = self.registers.top();
        self.registers.take(2);
        for entry in [self.module.pool.symbol(class), self.module.pool.integer(&Integer::from(slot))] {
            let constant = ConstIdx(self.constant_index(entry));
            let register = self.registers.take(1);
            self.emit(Instr::LoadConst { dst: register.into(), constant });
        }
        self.arguments(forms);
        let count = Count(2 + forms.len() as u8);
        let builtin = BuiltinIdx(builtin.number());
        self.emit(Instr::CallBuiltin { window: window.into(), count, want: Want::ONE, builtin });
        self.registers.release(window);
        self.deliver(window, dest);
    }

    /// Tests for an instance of a class.
    pub(super) fn is_instance(&mut self, class: &Symbol, object: NodeId, dest: Dest) {
        let top = self.registers.top();
        let object = self.operand(object, &[]);
        self.registers.release(top);
        if let Dest::Effect = dest {
            return;
        }
        let class = ClassIdx(self.class_index(class));
        self.deliver_test(dest, |frame, holds, fails| {
            frame.branch(Cond::Instance(object, class), holds, fails);
        });
    }
}
