//! Sums and products, comparisons and type tests.

use esl_bytecode::builtin::Builtin;
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::opcode::{Instr, TypeCode};
use esl_bytecode::operand::*;

use super::builder::FunctionBuilder;
use super::dest::Dest;
use super::graph::Cond;
use crate::core::*;

/// An instruction on two registers.
pub(super) type Binary = fn(Dst, Reg, Reg) -> Instr;

/// A comparison of numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Comparison {
    Equal,
    Less,
    LessEqual,
    Greater,
    GreaterEqual,
}

impl Comparison {
    /// Whether there are jumps that compare with a literal in this way.
    pub(super) fn has_literal_form(self) -> bool {
        !matches!(self, Comparison::LessEqual | Comparison::GreaterEqual)
    }

    /// Returns the comparison with its arguments exchanged.
    fn mirrored(self) -> Comparison {
        match self {
            Comparison::Equal => Comparison::Equal,
            Comparison::Less => Comparison::Greater,
            Comparison::LessEqual => Comparison::GreaterEqual,
            Comparison::Greater => Comparison::Less,
            Comparison::GreaterEqual => Comparison::LessEqual,
        }
    }
}

impl FunctionBuilder<'_, '_> {
    /// Returns the datum of a constant.
    pub(super) fn literal(&self, node: NodeId) -> Option<&Datum> {
        literal(self.core, node)
    }

    /// Lowers a call that joins two numbers or more from left to right.
    pub(super) fn fold(&mut self, builtin: Builtin, instr: Binary, numbers: &[NodeId], dest: Dest) {
        let top = self.registers.top();
        let mut numbers = numbers.to_vec();
        if addend(self.core, builtin, numbers[0]).is_some() && builtin == Builtin::Add {
            // A literal has no effects, so it may come second.
            numbers.swap(0, 1);
        }
        let mut sum = self.operand(numbers[0], &numbers[1..]);
        for index in 1..numbers.len() {
            let addend = addend(self.core, builtin, numbers[index]);
            let step: Box<dyn FnOnce(Dst) -> Instr> = match addend {
                Some(value) => {
                    let left = sum;
                    Box::new(move |dst| Instr::AddInt { dst, left, value })
                }
                None => {
                    let (left, right) = (sum, self.operand(numbers[index], &numbers[index + 1..]));
                    Box::new(move |dst| instr(dst, left, right))
                }
            };
            self.registers.release(top);
            if index + 1 == numbers.len() {
                return self.compute(dest, step);
            }
            sum = self.registers.take(1);
            self.emit(step(sum.into()));
        }
    }

    /// Lowers a comparison of two numbers.
    pub(super) fn compare(&mut self, comparison: Comparison, left: NodeId, right: NodeId, dest: Dest) {
        if let Dest::Test { .. } = dest {
            if let Some(value) = literal_int(self.core, right)
                && comparison.has_literal_form()
            {
                return self.compare_int(comparison, left, value, dest);
            }
            let mirrored = comparison.mirrored();
            if let Some(value) = literal_int(self.core, left)
                && mirrored.has_literal_form()
            {
                return self.compare_int(mirrored, right, value, dest);
            }
        }
        let top = self.registers.top();
        let (left, right) = self.operands(left, right);
        self.registers.release(top);
        self.compare_registers(comparison, left, right, dest);
    }

    /// Lowers a comparison of a form's value with a literal.
    pub(super) fn compare_int(&mut self, comparison: Comparison, number: NodeId, value: Int16, dest: Dest) {
        let top = self.registers.top();
        let left = self.operand(number, &[]);
        if let Dest::Test { holds, fails } = dest {
            let cond = match comparison {
                Comparison::Equal => Some(Cond::NumEqInt(left, value)),
                Comparison::Less => Some(Cond::LessInt(left, value)),
                Comparison::Greater => Some(Cond::GreaterInt(left, value)),
                Comparison::LessEqual | Comparison::GreaterEqual => None,
            };
            if let Some(cond) = cond {
                self.registers.release(top);
                return self.branch(cond, holds, fails);
            }
        }
        let right = self.registers.take(1);
        self.emit(Instr::LoadInt { dst: right.into(), value });
        self.registers.release(top);
        self.compare_registers(comparison, left, right, dest);
    }

    fn compare_registers(&mut self, comparison: Comparison, left: Reg, right: Reg, dest: Dest) {
        // The operands have been evaluated in order, so the instruction may name them in either order.
        let (left, right) = match comparison {
            Comparison::Greater | Comparison::GreaterEqual => (right, left),
            _ => (left, right),
        };
        if let Dest::Test { holds, fails } = dest {
            let cond = match comparison {
                Comparison::Equal => Cond::NumEq(left, right),
                Comparison::Less | Comparison::Greater => Cond::Less(left, right),
                Comparison::LessEqual | Comparison::GreaterEqual => Cond::LessEq(left, right),
            };
            return self.branch(cond, holds, fails);
        }
        self.compute(dest, |dst| match comparison {
            Comparison::Equal => Instr::NumEq { dst, left, right },
            Comparison::Less | Comparison::Greater => Instr::Less { dst, left, right },
            Comparison::LessEqual | Comparison::GreaterEqual => Instr::LessEq { dst, left, right },
        });
    }

    /// Lowers `(not object)`.
    pub(super) fn not(&mut self, object: NodeId, dest: Dest) {
        match dest {
            Dest::Test { holds, fails } => self.form(object, Dest::Test { holds: fails, fails: holds }),
            Dest::Effect => self.form(object, Dest::Effect),
            _ => {
                let top = self.registers.top();
                let src = self.operand(object, &[]);
                self.registers.release(top);
                self.compute(dest, |dst| Instr::Not { dst, src });
            }
        }
    }

    /// Lowers a type test.
    pub(super) fn is_type(&mut self, code: TypeCode, object: NodeId, dest: Dest) {
        let top = self.registers.top();
        let src = self.operand(object, &[]);
        self.registers.release(top);
        match (dest, code) {
            (Dest::Effect, _) => {}
            (Dest::Test { holds, fails }, TypeCode::Cons) => self.branch(Cond::Cons(src), holds, fails),
            (Dest::Test { holds, fails }, TypeCode::Atom) => self.branch(Cond::Cons(src), fails, holds),
            (Dest::Test { holds, fails }, _) => {
                self.branch(Cond::Type(src, TypeIdx(code as u8)), holds, fails);
            }
            _ => self.compute(dest, |dst| Instr::IsType { dst, src, code: TypeIdx(code as u8) }),
        }
    }

    /// Lowers `eq`, or `eql` if `by_value`.
    pub(super) fn identical(&mut self, by_value: bool, left: NodeId, right: NodeId, dest: Dest) {
        let top = self.registers.top();
        for (object, other) in [(left, right), (right, left)] {
            let Some(literal) = self.literal(other).cloned() else { continue };
            if literal.is_nil() {
                return self.not(object, dest);
            }
            if let (Dest::Test { holds, fails }, true) = (dest, by_value || is_word(&literal)) {
                let object = self.operand(object, &[]);
                self.registers.release(top);
                let entry = self.module.pool.datum(&literal);
                let constant = ConstIdx(self.constant_index(entry));
                return self.branch(Cond::EqlConst(object, constant), holds, fails);
            }
        }
        let (left, right) = self.operands(left, right);
        self.registers.release(top);
        match (dest, by_value) {
            (Dest::Effect, _) => {}
            (Dest::Test { holds, fails }, true) => self.branch(Cond::Eql(left, right), holds, fails),
            (Dest::Test { holds, fails }, false) => self.branch(Cond::Eq(left, right), holds, fails),
            (_, true) => self.compute(dest, |dst| Instr::Eql { dst, left, right }),
            (_, false) => self.compute(dest, |dst| Instr::Eq { dst, left, right }),
        }
    }
}

/// Returns the datum of a constant.
fn literal(core: &Core, node: NodeId) -> Option<&Datum> {
    match &core.nodes[node.index()].kind {
        NodeKind::Constant(datum) => Some(datum),
        _ => None,
    }
}

/// Returns the value of a constant that fits an instruction.
pub(super) fn literal_int(core: &Core, node: NodeId) -> Option<Int16> {
    literal(core, node).and_then(small_integer)
}

/// Returns the number that `add-int` adds in place of `builtin` with `node` as its second argument.
pub(super) fn addend(core: &Core, builtin: Builtin, node: NodeId) -> Option<Int8> {
    let Int16(value) = literal_int(core, node)?;
    let addend = match builtin {
        Builtin::Add => value,
        // Subtracting zero differs from adding zero: it keeps a negative zero.
        Builtin::Subtract if value != 0 => value.checked_neg()?,
        _ => return None,
    };
    i8::try_from(addend).ok().map(Int8)
}

/// Returns the value of an integer that fits an instruction.
pub(super) fn small_integer(datum: &Datum) -> Option<Int16> {
    match datum.kind() {
        DatumKind::Integer(value) => i16::try_from(value).ok().map(Int16),
        _ => None,
    }
}

/// Whether objects that are `eql` to this one are identical to it, since it fits a word.
fn is_word(datum: &Datum) -> bool {
    match datum.kind() {
        DatumKind::Nil | DatumKind::Symbol(_) | DatumKind::Character(_) => true,
        DatumKind::Integer(_) => small_integer(datum).is_some(),
        _ => false,
    }
}
