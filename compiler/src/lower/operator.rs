//! Builtins that have instructions of their own.
//!
//! An opened builtin behaves as the function does, also when it fails: the operands are evaluated in order,
//! and one instruction does the work, so that a value put in its place stands for the whole call. Exceptions
//! are sums and products of more than two numbers, and builtins that set a place: these return the value that
//! was to be stored.

use esl_bytecode::builtin::Builtin;
use esl_bytecode::opcode::{Instr, TypeCode};
use esl_bytecode::operand::*;

use super::arithmetic::{Binary, Comparison, addend, literal_int};
use super::builder::FunctionBuilder;
use super::call::{CallRoute, MAX_DIRECT};
use super::dest::Dest;
use crate::core::*;

type Unary = fn(Dst, Reg) -> Instr;

/// How a builtin is opened up, for a suitable number of arguments.
#[derive(Clone, Copy)]
enum OperatorShape {
    /// One argument, one instruction.
    Unary(Unary),
    /// Two arguments, one instruction.
    Binary(Binary),
    /// Two arguments or more, joined from left to right.
    Fold(Binary),
    /// One number, to which a literal is added.
    AddInt(i8),
    /// One number, multiplied by -1.
    Negate,
    /// One number, by which 1 is divided.
    Reciprocal,
    /// Two numbers compared.
    Compare(Comparison),
    /// One number compared with a literal.
    CompareInt(Comparison, Int16),
    /// The quotient, if the remainder is unused.
    Quotient(Binary),
    IsType(TypeCode),
    Not,
    Eq,
    Eql,
    /// An instruction for effect on two arguments, if the value of the call is unused. Where it is used, a
    /// value that a recovery procedure gives takes its place, as for any call.
    Change(fn(Reg, Reg) -> Instr),
    /// As `Change`, with three arguments.
    ChangeAt(fn(Reg, Reg, Reg) -> Instr),
    /// An element of a simple vector.
    Element,
    /// An assignment to one, as `Change`.
    SetElement,
    List,
    ListStar,
    Identity,
    Values,
    ValuesList,
    Funcall,
    Apply,
}

/// Returns how a call with `count` arguments is opened up, if at all.
fn shape(builtin: Builtin, count: usize) -> Option<OperatorShape> {
    use Builtin as B;
    use OperatorShape::*;
    Some(match (builtin, count) {
        (B::Add, 2..) => Fold(|dst, left, right| Instr::Add { dst, left, right }),
        (B::Subtract, 2..) => Fold(|dst, left, right| Instr::Sub { dst, left, right }),
        (B::Multiply, 2..) => Fold(|dst, left, right| Instr::Mul { dst, left, right }),
        (B::Divide, 2..) => Fold(|dst, left, right| Instr::Div { dst, left, right }),
        (B::LogAnd, 2..) => Fold(|dst, left, right| Instr::LogAnd { dst, left, right }),
        (B::LogIor, 2..) => Fold(|dst, left, right| Instr::LogIor { dst, left, right }),
        (B::LogXor, 2..) => Fold(|dst, left, right| Instr::LogXor { dst, left, right }),
        (B::Subtract, 1) => Negate,
        (B::Divide, 1) => Reciprocal,
        (B::Increment, 1) => AddInt(1),
        (B::Decrement, 1) => AddInt(-1),
        (B::Floor, 1 | 2) => Quotient(|dst, left, right| Instr::Floor { dst, left, right }),
        (B::Truncate, 1 | 2) => Quotient(|dst, left, right| Instr::Truncate { dst, left, right }),
        (B::Mod, 2) => Binary(|dst, left, right| Instr::Mod { dst, left, right }),
        (B::Rem, 2) => Binary(|dst, left, right| Instr::Rem { dst, left, right }),
        (B::Ash, 2) => Binary(|dst, left, right| Instr::Ash { dst, left, right }),
        (B::NumEqual, 2) => Compare(Comparison::Equal),
        (B::Less, 2) => Compare(Comparison::Less),
        (B::LessEqual, 2) => Compare(Comparison::LessEqual),
        (B::Greater, 2) => Compare(Comparison::Greater),
        (B::GreaterEqual, 2) => Compare(Comparison::GreaterEqual),
        (B::Zerop, 1) => CompareInt(Comparison::Equal, Int16(0)),
        (B::Plusp, 1) => CompareInt(Comparison::Greater, Int16(0)),
        (B::Minusp, 1) => CompareInt(Comparison::Less, Int16(0)),
        (B::Not | B::Null, 1) => Not,
        (B::Eq, 2) => Eq,
        (B::Eql, 2) => Eql,
        (B::Consp, 1) => IsType(TypeCode::Cons),
        (B::Atom, 1) => IsType(TypeCode::Atom),
        (B::Listp, 1) => IsType(TypeCode::List),
        (B::Symbolp, 1) => IsType(TypeCode::Symbol),
        (B::Keywordp, 1) => IsType(TypeCode::Keyword),
        (B::Numberp, 1) => IsType(TypeCode::Number),
        (B::Realp, 1) => IsType(TypeCode::Real),
        (B::Rationalp, 1) => IsType(TypeCode::Rational),
        (B::Integerp, 1) => IsType(TypeCode::Integer),
        (B::Floatp, 1) => IsType(TypeCode::Float),
        (B::Characterp, 1) => IsType(TypeCode::Character),
        (B::Stringp, 1) => IsType(TypeCode::String),
        (B::Vectorp, 1) => IsType(TypeCode::Vector),
        (B::SimpleVectorp, 1) => IsType(TypeCode::SimpleVector),
        (B::Arrayp, 1) => IsType(TypeCode::Array),
        (B::Functionp, 1) => IsType(TypeCode::Function),
        (B::HashTablep, 1) => IsType(TypeCode::HashTable),
        (B::Car | B::First, 1) => Unary(|dst, list| Instr::Car { dst, list }),
        (B::Cdr | B::Rest, 1) => Unary(|dst, list| Instr::Cdr { dst, list }),
        (B::Cadr | B::Second, 1) => Unary(|dst, list| Instr::Cadr { dst, list }),
        (B::Cddr, 1) => Unary(|dst, list| Instr::Cddr { dst, list }),
        (B::Cons, 2) => Binary(|dst, car, cdr| Instr::Cons { dst, car, cdr }),
        (B::Svref, 2) => Element,
        (B::Char | B::Schar, 2) => Binary(|dst, string, index| Instr::CharRef { dst, string, index }),
        (B::CharEqualExactly, 2) => Binary(|dst, left, right| Instr::CharEq { dst, left, right }),
        (B::Aref, 2) => Binary(|dst, array, index| Instr::ArrayRef { dst, array, index }),
        (B::Rplaca, 2) => Change(|pair, value| Instr::SetCar { pair, value }),
        (B::Rplacd, 2) => Change(|pair, value| Instr::SetCdr { pair, value }),
        (B::SetCar, 2) => Change(|pair, value| Instr::SetCar { pair, value }),
        (B::SetCdr, 2) => Change(|pair, value| Instr::SetCdr { pair, value }),
        (B::SetSvref, 3) => SetElement,
        (B::SetAref, 3) => ChangeAt(|array, index, value| Instr::ArraySet { array, index, value }),
        (B::List, _) => List,
        (B::ListStar, 1..=MAX_DIRECT) => ListStar,
        (B::Identity, 1) => Identity,
        (B::Values, _) => Values,
        (B::ValuesList, 1) => ValuesList,
        (B::Funcall, 1..) => Funcall,
        (B::Apply, 2..) => Apply,
        _ => return None,
    })
}

/// Whether a call takes its argument `index`, if it is a literal, from a register that may be anywhere.
pub(super) fn takes_literals(core: &Core, builtin: Builtin, arguments: &[NodeId], index: usize) -> bool {
    match shape(builtin, arguments.len()) {
        Some(OperatorShape::Fold(_)) => addend(core, builtin, arguments[index]).is_none(),
        Some(OperatorShape::Compare(comparison)) => {
            !comparison.has_literal_form() || literal_int(core, arguments[index]).is_none()
        }
        Some(
            OperatorShape::Binary(_)
            | OperatorShape::Quotient(_)
            | OperatorShape::Change(_)
            | OperatorShape::ChangeAt(_)
            | OperatorShape::Element
            | OperatorShape::SetElement,
        ) => true,
        _ => false,
    }
}

impl<'a> FunctionBuilder<'_, 'a> {
    /// Lowers a call of a builtin.
    pub(super) fn builtin(&mut self, builtin: Builtin, arguments: &'a [NodeId], dest: Dest) {
        let top = self.registers.top();
        let Some(shape) = shape(builtin, arguments.len()) else {
            return self.emit_call(CallRoute::Builtin(builtin), arguments, dest);
        };
        match (shape, arguments) {
            (OperatorShape::Unary(instr), [object]) => {
                let src = self.operand(*object, &[]);
                self.registers.release(top);
                self.compute(dest, |dst| instr(dst, src));
            }
            (OperatorShape::Binary(instr), [left, right]) => {
                let (left, right) = self.operands(*left, *right);
                self.registers.release(top);
                self.compute(dest, |dst| instr(dst, left, right));
            }
            (OperatorShape::Negate, [number]) => {
                self.with_literal(|dst, x, one| Instr::Mul { dst, left: x, right: one }, *number, -1, dest)
            }
            (OperatorShape::Reciprocal, [number]) => {
                self.with_literal(|dst, x, one| Instr::Div { dst, left: one, right: x }, *number, 1, dest);
            }
            (OperatorShape::Fold(instr), _) => self.fold(builtin, instr, arguments, dest),
            (OperatorShape::AddInt(value), [number]) => {
                let left = self.operand(*number, &[]);
                self.registers.release(top);
                self.compute(dest, |dst| Instr::AddInt { dst, left, value: Int8(value) });
            }
            (OperatorShape::Compare(comparison), [left, right]) => {
                self.compare(comparison, *left, *right, dest)
            }
            (OperatorShape::CompareInt(comparison, value), [number]) => {
                self.compare_int(comparison, *number, value, dest)
            }
            (OperatorShape::Quotient(instr), [_, ..]) if dest.is_single() => match arguments {
                [number, divisor] => {
                    let (left, right) = self.operands(*number, *divisor);
                    self.registers.release(top);
                    self.compute(dest, |dst| instr(dst, left, right));
                }
                _ => self.with_literal(instr, arguments[0], 1, dest),
            },
            (OperatorShape::IsType(code), [object]) => self.is_type(code, *object, dest),
            (OperatorShape::Not, [object]) => self.not(*object, dest),
            (OperatorShape::Eq, [left, right]) => self.identical(false, *left, *right, dest),
            (OperatorShape::Eql, [left, right]) => self.identical(true, *left, *right, dest),
            (OperatorShape::Change(instr), [object, value]) if matches!(dest, Dest::Effect) => {
                let (object, value) = self.operands(*object, *value);
                self.emit(instr(object, value));
                self.registers.release(top);
            }
            (OperatorShape::ChangeAt(instr), [object, index, value]) if matches!(dest, Dest::Effect) => {
                let object = self.operand(*object, &[*index, *value]);
                let (index, value) = self.operands(*index, *value);
                self.emit(instr(object, index, value));
                self.registers.release(top);
            }
            (OperatorShape::Element, [vector, index]) => self.element(*vector, *index, dest),
            (OperatorShape::SetElement, [vector, index, value]) if matches!(dest, Dest::Effect) => {
                self.set_element(*vector, *index, *value);
            }
            (OperatorShape::List, _) => self.list(arguments, dest),
            (OperatorShape::ListStar, _) => self.list_star(arguments, dest),
            (OperatorShape::Identity, [form]) => self.single(*form, dest),
            (OperatorShape::Values, _) => self.values(arguments, dest),
            (OperatorShape::ValuesList, [list]) => self.values_list(*list, dest),
            (OperatorShape::Funcall, [function, arguments @ ..]) => {
                self.call_value(*function, arguments, dest)
            }
            (OperatorShape::Apply, [function, arguments @ ..]) => {
                self.apply_form(|frame, dest| frame.form(*function, dest), arguments, dest);
            }
            _ => self.emit_call(CallRoute::Builtin(builtin), arguments, dest),
        }
    }

    /// Lowers a read of an element of a simple vector.
    fn element(&mut self, vector: NodeId, index: NodeId, dest: Dest) {
        let top = self.registers.top();
        if let Some(index) = self.element_index(index) {
            let vector = self.operand(vector, &[]);
            self.registers.release(top);
            return self.compute(dest, |dst| Instr::VectorRefInt { dst, vector, index });
        }
        let (vector, index) = self.operands(vector, index);
        self.registers.release(top);
        self.compute(dest, |dst| Instr::VectorRef { dst, vector, index });
    }

    /// Lowers an assignment to an element of a simple vector.
    fn set_element(&mut self, vector: NodeId, index: NodeId, value: NodeId) {
        let top = self.registers.top();
        if let Some(index) = self.element_index(index) {
            let (vector, value) = self.operands(vector, value);
            self.emit(Instr::VectorSetInt { vector, index, value });
        } else {
            let vector = self.operand(vector, &[index, value]);
            let (index, value) = self.operands(index, value);
            self.emit(Instr::VectorSet { vector, index, value });
        }
        self.registers.release(top);
    }

    /// Returns the index of an element, if it is a literal that fits into an instruction. Where a loop keeps
    /// it in a register, the fused instructions of the machine want it from there.
    fn element_index(&mut self, index: NodeId) -> Option<Index> {
        if self.loaded_literal(index).is_some() {
            return None;
        }
        literal_int(self.core, index).and_then(|index| u8::try_from(index.0).ok()).map(Index)
    }

    /// Returns two operands, evaluated in order.
    pub(super) fn operands(&mut self, left: NodeId, right: NodeId) -> (Reg, Reg) {
        if self.literal(left).is_some() {
            // A literal has no effects. Loaded late, it takes no register while the other operand is
            // computed.
            let second = self.operand(right, &[]);
            return (self.operand(left, &[]), second);
        }
        let first = self.operand(left, &[right]);
        (first, self.operand(right, &[]))
    }

    /// Lowers one instruction on a form's value and a literal.
    fn with_literal(&mut self, instr: Binary, form: NodeId, literal: i16, dest: Dest) {
        let top = self.registers.top();
        let operand = self.operand(form, &[]);
        let register = self.registers.take(1);
        self.emit(Instr::LoadInt { dst: register.into(), value: Int16(literal) });
        self.registers.release(top);
        self.compute(dest, |dst| instr(dst, operand, register));
    }

    fn list_star(&mut self, forms: &[NodeId], dest: Dest) {
        if let [form] = forms {
            return self.single(*form, dest);
        }
        let top = self.registers.top();
        self.arguments(forms);
        self.registers.release(top);
        let mut rest = top.offset(forms.len() as u8 - 1);
        for offset in (1..forms.len() as u8 - 1).rev() {
            let register = top.offset(offset);
            self.emit(Instr::Cons { dst: register.into(), car: register, cdr: rest });
            rest = register;
        }
        self.compute(dest, |dst| Instr::Cons { dst, car: top, cdr: rest });
    }
}
