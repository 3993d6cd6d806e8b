//! Delivery: how a value gets to its destination.

use esl_bytecode::opcode::Instr;
use esl_bytecode::operand::{Count, Dst, Reg};

use super::builder::FunctionBuilder;
use super::dest::Dest;
use super::graph::{Cond, SegmentExit, SegmentLabel};

impl FunctionBuilder<'_, '_> {
    /// Returns the register in which a single value for `dest` is best computed. It is free, unless `dest`
    /// names it.
    pub(super) fn target(&mut self, dest: Dest) -> Reg {
        let register = match dest {
            Dest::Fresh(register) | Dest::Keep(register) | Dest::Values(register, _) => register,
            Dest::Effect | Dest::All | Dest::Tail | Dest::Test { .. } => self.registers.top(),
        };
        self.registers.reserve(register, 1);
        register
    }

    /// Delivers the value in `register`.
    pub(super) fn deliver(&mut self, register: Reg, dest: Dest) {
        match dest {
            Dest::Effect => {}
            Dest::Fresh(target) | Dest::Keep(target) => self.move_to(target, register),
            Dest::Values(first, count) => {
                self.move_to(first, register);
                self.registers.reserve(first, usize::from(count));
                self.emit(Instr::LoadNil { first: first.offset(1).into(), count: Count(count - 1) });
            }
            Dest::All => self.emit(Instr::SetValues { first: register.into(), count: Count(1) }),
            Dest::Tail => self.end(Instr::Return { src: register }),
            Dest::Test { holds, fails } => self.branch(Cond::Nil(register), fails, holds),
        }
    }

    /// Delivers the value list.
    pub(super) fn deliver_values(&mut self, dest: Dest) {
        match dest {
            Dest::Effect | Dest::All => {}
            Dest::Tail => self.end(Instr::ReturnAll {}),
            Dest::Values(first, count) => {
                self.registers.reserve(first, usize::from(count));
                self.emit(Instr::GetValues { first: first.into(), count: Count(count) });
            }
            _ => self.deliver_first(dest),
        }
    }

    /// Delivers the first value of the value list.
    pub(super) fn deliver_first(&mut self, dest: Dest) {
        if !matches!(dest, Dest::Effect) {
            let target = self.target(dest);
            self.emit(Instr::GetValues { first: target.into(), count: Count(1) });
            self.deliver(target, dest);
        }
    }

    /// Delivers `NIL`.
    pub(super) fn deliver_nil(&mut self, dest: Dest) {
        match dest {
            Dest::Effect => {}
            Dest::Test { fails, .. } => self.jump(fails),
            Dest::Values(first, count) => {
                self.registers.reserve(first, usize::from(count));
                self.emit(Instr::LoadNil { first: first.into(), count: Count(count) });
            }
            _ => {
                let target = self.target(dest);
                self.emit(Instr::LoadNil { first: target.into(), count: Count(1) });
                self.deliver(target, dest);
            }
        }
    }

    /// Delivers `T`.
    pub(super) fn deliver_true(&mut self, dest: Dest) {
        match dest {
            Dest::Effect => {}
            Dest::Test { holds, .. } => self.jump(holds),
            _ => {
                let target = self.target(dest);
                self.emit(Instr::LoadTrue { dst: target.into() });
                self.deliver(target, dest);
            }
        }
    }

    /// Computes one value with one instruction. `instr` is given the register that it writes.
    pub(super) fn compute(&mut self, dest: Dest, instr: impl FnOnce(Dst) -> Instr) {
        let target = self.target(dest);
        self.emit(instr(target.into()));
        self.deliver(target, dest);
    }

    /// Delivers `T` or `NIL`, depending on the segment to which `test` jumps.
    pub(super) fn deliver_test(
        &mut self,
        dest: Dest,
        test: impl FnOnce(&mut Self, SegmentLabel, SegmentLabel),
    ) {
        if let Dest::Test { holds, fails } = dest {
            return test(self, holds, fails);
        }
        let (holds, fails, end) = (self.graph.label(), self.graph.label(), self.graph.label());
        test(self, holds, fails);
        self.graph.bind(holds);
        self.deliver_true(dest);
        self.join(end, dest);
        self.graph.bind(fails);
        self.deliver_nil(dest);
        if dest.goes_on() {
            self.graph.bind(end);
        }
    }

    /// Returns the destination for a form inside a dynamic extent whose own destination is `dest`. It can be
    /// reached before the extent is left, and no register in use lies behind it.
    pub(super) fn inner(&mut self, dest: Dest, is_single: bool) -> Dest {
        let top = self.registers.top();
        match dest {
            Dest::Effect | Dest::All => dest,
            Dest::Tail if !is_single => Dest::All,
            Dest::Values(_, count) => Dest::Values(top, count),
            _ => Dest::Fresh(top),
        }
    }

    /// Delivers from `inner`, the destination of a form inside an extent, to `dest`.
    pub(super) fn finish(&mut self, inner: Dest, dest: Dest) {
        match (inner, dest) {
            (Dest::Fresh(register), _) => self.deliver(register, dest),
            (Dest::Values(from, count), Dest::Values(to, _)) => self.move_range(to, from, count),
            (Dest::All, Dest::Tail) => self.end(Instr::ReturnAll {}),
            _ => {}
        }
    }

    /// Copies `count` registers; `to` does not lie above `from`.
    pub(super) fn move_range(&mut self, to: Reg, from: Reg, count: u8) {
        for offset in 0..count {
            self.move_to(to.offset(offset), from.offset(offset));
        }
    }

    /// Copies a register.
    pub(super) fn move_to(&mut self, to: Reg, from: Reg) {
        if to != from {
            self.registers.reserve(to, 1);
            self.emit(Instr::Move { dst: to.into(), src: from });
        }
    }

    /// Jumps to `end` after a form with the destination `dest`, unless control has gone elsewhere.
    pub(super) fn join(&mut self, end: SegmentLabel, dest: Dest) {
        if dest.goes_on() {
            self.jump(end);
        }
    }

    /// Jumps to a segment.
    pub(super) fn jump(&mut self, to: SegmentLabel) {
        self.graph.leave(SegmentExit::Jump(to), self.span);
    }

    /// Jumps to one of two segments.
    pub(super) fn branch(&mut self, cond: Cond, holds: SegmentLabel, fails: SegmentLabel) {
        self.graph.leave(SegmentExit::Branch { cond, holds, fails }, self.span);
    }
}
