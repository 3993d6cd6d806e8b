//! Destinations: where the value of a form is wanted, and how a value gets there.

use esl_bytecode::opcode::Instr;
use esl_bytecode::operand::{Base, Count, Dst, Reg, Want};

use super::frame::Frame;
use super::graph::{Cond, Exit, Label};

/// Where a form puts its value or values.
#[derive(Clone, Copy, Debug)]
pub(super) enum Dest {
    /// Nowhere.
    Effect,
    /// One value, to a register. No register from this one on is needed afterwards, so a call may lay its window over
    /// them. Variables of the form itself may be among them, so only its last instruction writes there, unless the
    /// register is the first free one.
    Fresh(u8),
    /// One value, to the register of a variable: only the last instruction of the form writes there.
    Keep(u8),
    /// So many values, at least two, to consecutive registers, missing ones `NIL`. Otherwise as `Fresh`.
    Values(u8, u8),
    /// All values, to the value list.
    All,
    /// All values, to the caller of the function. No dynamic extent of this frame is open.
    Tail,
    /// To one of two segments, by whether the value is true.
    Test {
        /// If it is.
        holds: Label,
        /// If it is `NIL`.
        fails: Label,
    },
}

impl Dest {
    /// Whether control goes on after the form right behind its code.
    pub(super) fn goes_on(self) -> bool {
        !matches!(self, Dest::Tail | Dest::Test { .. })
    }

    /// The values that a catch, whose form has this destination, wants.
    pub(super) fn want(self) -> Want {
        match self {
            Dest::All => Want::ALL,
            Dest::Values(_, count) => Want::exactly(count),
            _ => Want::ONE,
        }
    }
}

impl Frame<'_, '_> {
    /// The register in which a single value for `dest` is best computed. Never one that is in use, unless `dest` says so.
    pub(super) fn target(&mut self, dest: Dest) -> u8 {
        let register = match dest {
            Dest::Fresh(register) | Dest::Keep(register) | Dest::Values(register, _) => register,
            Dest::Effect | Dest::All | Dest::Tail | Dest::Test { .. } => self.registers.top(),
        };
        self.registers.reserve(register, 1);
        register
    }

    /// Passes on the value in `register` to `dest`.
    pub(super) fn deliver(&mut self, register: u8, dest: Dest) {
        match dest {
            Dest::Effect => {}
            Dest::Fresh(target) | Dest::Keep(target) => self.move_to(target, register),
            Dest::Values(first, count) => {
                self.move_to(first, register);
                self.registers.reserve(first, usize::from(count));
                self.emit(Instr::LoadNil { first: Base(first.saturating_add(1)), count: Count(count - 1) });
            }
            Dest::All => self.emit(Instr::SetValues { first: Base(register), count: Count(1) }),
            Dest::Tail => self.end(Instr::Return { src: Reg(register) }),
            Dest::Test { holds, fails } => self.branch(Cond::Nil(Reg(register)), fails, holds),
        }
    }

    /// Passes on the value list.
    pub(super) fn deliver_values(&mut self, dest: Dest) {
        match dest {
            Dest::Effect | Dest::All => {}
            Dest::Tail => self.end(Instr::ReturnAll {}),
            Dest::Values(first, count) => {
                self.registers.reserve(first, usize::from(count));
                self.emit(Instr::GetValues { first: Base(first), count: Count(count) });
            }
            _ => self.deliver_first(dest),
        }
    }

    /// Passes on the first value of the value list.
    pub(super) fn deliver_first(&mut self, dest: Dest) {
        if !matches!(dest, Dest::Effect) {
            let target = self.target(dest);
            self.emit(Instr::GetValues { first: Base(target), count: Count(1) });
            self.deliver(target, dest);
        }
    }

    /// Passes on `NIL`.
    pub(super) fn deliver_nil(&mut self, dest: Dest) {
        match dest {
            Dest::Effect => {}
            Dest::Test { fails, .. } => self.jump(fails),
            Dest::Values(first, count) => {
                self.registers.reserve(first, usize::from(count));
                self.emit(Instr::LoadNil { first: Base(first), count: Count(count) });
            }
            _ => {
                let target = self.target(dest);
                self.emit(Instr::LoadNil { first: Base(target), count: Count(1) });
                self.deliver(target, dest);
            }
        }
    }

    /// Passes on `T`.
    pub(super) fn deliver_true(&mut self, dest: Dest) {
        match dest {
            Dest::Effect => {}
            Dest::Test { holds, .. } => self.jump(holds),
            _ => {
                let target = self.target(dest);
                self.emit(Instr::LoadTrue { dst: Dst(target) });
                self.deliver(target, dest);
            }
        }
    }

    /// Computes one value with one instruction, which is given the register to write.
    pub(super) fn compute(&mut self, dest: Dest, instr: impl FnOnce(Dst) -> Instr) {
        let target = self.target(dest);
        self.emit(instr(Dst(target)));
        self.deliver(target, dest);
    }

    /// Passes on `T` or `NIL` by the way that `test` goes.
    pub(super) fn deliver_test(&mut self, dest: Dest, test: impl FnOnce(&mut Self, Label, Label)) {
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

    /// The destination for a form inside a dynamic extent whose own destination is `dest`: it can be reached before the
    /// extent is left, and nothing in use lies behind it.
    pub(super) fn inner(&mut self, dest: Dest, is_single: bool) -> Dest {
        let top = self.registers.top();
        match dest {
            Dest::Effect | Dest::All => dest,
            Dest::Tail if !is_single => Dest::All,
            Dest::Values(_, count) => Dest::Values(top, count),
            _ => Dest::Fresh(top),
        }
    }

    /// Passes on from `inner`, where a form inside an extent has put its value, to `dest`.
    pub(super) fn finish(&mut self, inner: Dest, dest: Dest) {
        match (inner, dest) {
            (Dest::Fresh(register), _) => self.deliver(register, dest),
            (Dest::Values(from, count), Dest::Values(to, _)) => self.move_range(to, from, count),
            (Dest::All, Dest::Tail) => self.end(Instr::ReturnAll {}),
            _ => {}
        }
    }

    /// Copies registers; `to` does not lie above `from`.
    pub(super) fn move_range(&mut self, to: u8, from: u8, count: u8) {
        for offset in 0..count {
            self.move_to(to.saturating_add(offset), from.saturating_add(offset));
        }
    }

    pub(super) fn move_to(&mut self, to: u8, from: u8) {
        if to != from {
            self.registers.reserve(to, 1);
            self.emit(Instr::Move { dst: Dst(to), src: Reg(from) });
        }
    }

    /// Goes on at `end`, after a form with the destination `dest`, unless control has gone elsewhere.
    pub(super) fn join(&mut self, end: Label, dest: Dest) {
        if dest.goes_on() {
            self.jump(end);
        }
    }

    pub(super) fn jump(&mut self, to: Label) {
        self.graph.leave(Exit::Jump(to), self.span);
    }

    pub(super) fn branch(&mut self, cond: Cond, holds: Label, fails: Label) {
        self.graph.leave(Exit::Branch { cond, holds, fails }, self.span);
    }
}
