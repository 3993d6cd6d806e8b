//! The translation of one instruction: each has the fast paths that the interpreter's arm has, under the same
//! conditions; what they do not take goes to the machine, which does the instruction's slow half. An
//! instruction without a translation is left to the machine as a whole.

use std::mem::offset_of;

use cranelift_codegen::ir::InstBuilder;
use cranelift_codegen::ir::condcodes::IntCC;
use esl_bytecode::opcode::{Instr, RegisterAccess};
use esl_bytecode::operand::Want;
use esl_heap::Value;
use esl_heap::heap::Kind;
use esl_heap::heap::layout::{Boxed, Cons};

use crate::abi::NativeContext;
use crate::arithmetic::{Arithmetic, NumberOrder};
use crate::characters::values_of;
use crate::emit::in_object;
use crate::flow::{FlowStep, FrameChange};
use crate::kinds::{Known, is_root};
use crate::lookups::TableOperation;
use crate::matrices::ElementOperation;
use crate::objects::{ElementIndex, capture};
use crate::translate::Translator;

impl Translator<'_, '_> {
    #[allow(clippy::too_many_lines, reason = "one arm for each kind of instruction with a fast path")]
    pub(crate) fn instruction(&mut self, step: &FlowStep) {
        use Arithmetic::{Add, Divide, Multiply, Subtract};
        use NumberOrder::{Equal, Greater, Less, LessEqual};
        let may_join_batch = matches!(
            step.instr,
            Instr::Move { .. }
                | Instr::LoadConst { .. }
                | Instr::LoadInt { .. }
                | Instr::VectorRef { .. }
                | Instr::VectorRefInt { .. }
                | Instr::Add { .. }
                | Instr::Sub { .. }
                | Instr::Mul { .. }
                | Instr::Div { .. }
                | Instr::AddInt { .. }
        );
        if !may_join_batch {
            self.close_batch_for(match step.instr {
                Instr::VectorSet { value, .. }
                | Instr::VectorSetInt { value, .. }
                | Instr::ArraySet { value, .. } => Some(value.0),
                Instr::Return { src } if step.change == FrameChange::None => Some(src.0),
                _ => None,
            });
        }
        match step.change {
            FrameChange::None => {}
            FrameChange::Enter { window, count } => return self.enter_inlined(window, count, step),
            FrameChange::Return { to } => return self.leave_inlined(to, step),
            FrameChange::Call { to, .. } => return self.call_whole(to, step),
        }
        match step.instr {
            Instr::Move { dst, src } => {
                if self.known[usize::from(src.0)] == Known::Double {
                    let double = self.get_double(src.0);
                    self.set_double(dst.0, double);
                } else {
                    let (value, known) = self.operand(src.0);
                    self.set_with_batch(dst.0, value, known);
                }
            }
            Instr::LoadInt { dst, value } => {
                let (value, known) = self.fixnum(i32::from(value.0));
                self.set_with_batch(dst.0, value, known);
            }
            Instr::LoadConst { dst, constant } => {
                self.load_constant(dst.0, usize::from(constant.0));
            }
            Instr::LoadNil { first, count } => {
                let nil = self.constant_value(Value::NIL);
                for i in 0..count.0 {
                    self.set(first.0 + i, nil, Known::Nothing);
                }
            }
            Instr::LoadTrue { dst } => {
                let t = self.constant_value(Value::T);
                self.set(dst.0, t, Known::Nothing);
            }

            Instr::Add { dst, left, right } => self.registers(Add, dst.0, left.0, right.0),
            Instr::Sub { dst, left, right } => self.registers(Subtract, dst.0, left.0, right.0),
            Instr::Mul { dst, left, right } => self.registers(Multiply, dst.0, left.0, right.0),
            Instr::Div { dst, left, right } => self.registers(Divide, dst.0, left.0, right.0),
            Instr::AddInt { dst, left, value } => {
                self.add_int(dst.0, left.0, i32::from(value.0));
            }
            Instr::Floor { dst, left, right } => self.divide(&step.instr, dst.0, left.0, right.0),
            Instr::Truncate { dst, left, right } => self.divide(&step.instr, dst.0, left.0, right.0),
            Instr::Mod { dst, left, right } => self.divide(&step.instr, dst.0, left.0, right.0),
            Instr::Rem { dst, left, right } => self.divide(&step.instr, dst.0, left.0, right.0),
            Instr::LogAnd { dst, left, right } => self.bitwise(&step.instr, dst.0, left.0, right.0),
            Instr::LogIor { dst, left, right } => self.bitwise(&step.instr, dst.0, left.0, right.0),
            Instr::LogXor { dst, left, right } => self.bitwise(&step.instr, dst.0, left.0, right.0),
            Instr::Ash { dst, left, right } => self.shift(dst.0, left.0, right.0),

            Instr::Not { dst, src } => {
                let value = self.get(src.0);
                let is_nil = self.equals(value, Value::NIL.bits());
                self.set_boolean(dst.0, is_nil);
            }
            Instr::Eq { dst, left, right } => {
                let (x, y) = (self.get(left.0), self.get(right.0));
                let is_eq = self.b.ins().icmp(IntCC::Equal, x, y);
                self.set_boolean(dst.0, is_eq);
            }
            Instr::NumEq { dst, left, right } => self.compare(Equal, dst.0, left.0, right.0),
            Instr::Less { dst, left, right } => self.compare(Less, dst.0, left.0, right.0),
            Instr::LessEq { dst, left, right } => self.compare(LessEqual, dst.0, left.0, right.0),
            Instr::CharEq { dst, left, right } => {
                let (x, y, slow) = (self.get(left.0), self.get(right.0), self.cold_block());
                for value in [x, y] {
                    let is_character = self.is_character(value);
                    self.require(is_character, slow);
                }
                let is_same = self.b.ins().icmp(IntCC::Equal, x, y);
                let value = self.boolean(is_same);
                self.finish_with(slow, value, dst.0);
            }
            Instr::IsType { dst, src, code } => match self.type_test(src.0, code.0) {
                Some(test) => self.set_boolean(dst.0, test),
                None => self.leave_to_machine(step),
            },

            Instr::JumpAlways { .. } => {
                let target = self.target(step);
                self.jump(target);
                self.ended();
            }
            Instr::JumpIfNil { test, .. } => self.jump_if_is(test.0, Value::NIL, step),
            Instr::JumpIfNotNil { test, .. } => self.jump_if_is_not(test.0, Value::NIL, step),
            Instr::JumpIfSupplied { test, .. } => self.jump_if_is_not(test.0, Value::UNSUPPLIED, step),
            Instr::JumpIfCons { test, .. } => {
                let value = self.get(test.0);
                let is_cons = self.is_cons(value);
                self.jump_if(is_cons, step);
            }
            Instr::JumpIfNotCons { test, .. } => {
                let value = self.get(test.0);
                let is_cons = self.is_cons(value);
                self.jump_unless(is_cons, step);
            }
            Instr::JumpEq { left, right, .. } | Instr::JumpNotEq { left, right, .. } => {
                let (x, y) = (self.get(left.0), self.get(right.0));
                let is_eq = self.b.ins().icmp(IntCC::Equal, x, y);
                match step.instr {
                    Instr::JumpEq { .. } => self.jump_if(is_eq, step),
                    _ => self.jump_unless(is_eq, step),
                }
            }
            Instr::JumpEql { left, right, .. } => {
                let (x, y) = (self.get(left.0), self.get(right.0));
                self.jump_eql(x, y, true, step);
            }
            Instr::JumpNotEql { left, right, .. } => {
                let (x, y) = (self.get(left.0), self.get(right.0));
                self.jump_eql(x, y, false, step);
            }
            Instr::JumpEqlConst { left, constant, .. } => {
                let (x, y) = (self.get(left.0), self.constant(usize::from(constant.0)));
                self.jump_eql(x, y, true, step);
            }
            Instr::JumpNotEqlConst { left, constant, .. } => {
                let (x, y) = (self.get(left.0), self.constant(usize::from(constant.0)));
                self.jump_eql(x, y, false, step);
            }
            Instr::JumpIfType { test, code, .. } => match self.type_test(test.0, code.0) {
                Some(test) => self.jump_if(test, step),
                None => self.leave_to_machine(step),
            },
            Instr::JumpIfNotType { test, code, .. } => match self.type_test(test.0, code.0) {
                Some(test) => self.jump_unless(test, step),
                None => self.leave_to_machine(step),
            },
            Instr::JumpNumEq { left, right, .. } => self.jump_order(Equal, left.0, right.0, step),
            Instr::JumpNotNumEq { left, right, .. } => self.jump_order(Equal, left.0, right.0, step),
            Instr::JumpLess { left, right, .. } => self.jump_order(Less, left.0, right.0, step),
            Instr::JumpNotLess { left, right, .. } => self.jump_order(Less, left.0, right.0, step),
            Instr::JumpLessEq { left, right, .. } => self.jump_order(LessEqual, left.0, right.0, step),
            Instr::JumpNotLessEq { left, right, .. } => self.jump_order(LessEqual, left.0, right.0, step),
            Instr::JumpNumEqInt { left, value, .. } => self.jump_order_int(Equal, left.0, value.0, step),
            Instr::JumpNotNumEqInt { left, value, .. } => self.jump_order_int(Equal, left.0, value.0, step),
            Instr::JumpLessInt { left, value, .. } => self.jump_order_int(Less, left.0, value.0, step),
            Instr::JumpNotLessInt { left, value, .. } => self.jump_order_int(Less, left.0, value.0, step),
            Instr::JumpGreaterInt { left, value, .. } => self.jump_order_int(Greater, left.0, value.0, step),
            Instr::JumpNotGreaterInt { left, value, .. } => {
                self.jump_order_int(Greater, left.0, value.0, step);
            }

            Instr::Loop { .. } => {
                self.tick();
                let target = self.target(step);
                self.jump(target);
                self.ended();
            }
            Instr::LoopIfNil { test, .. } => {
                let value = self.get(test.0);
                let is_nil = self.equals(value, Value::NIL.bits());
                self.loop_if(is_nil, step);
            }
            Instr::LoopIfNotNil { test, .. } => {
                let value = self.get(test.0);
                let is_true = self.b.ins().icmp_imm_s(IntCC::NotEqual, value, Value::NIL.bits() as i64);
                self.loop_if(is_true, step);
            }
            Instr::LoopIfCons { test, .. } => {
                let value = self.get(test.0);
                let is_cons = self.is_cons(value);
                self.loop_if(is_cons, step);
            }
            Instr::LoopLess { left, right, .. } => self.jump_order(Less, left.0, right.0, step),
            Instr::LoopNotLess { left, right, .. } => self.jump_order(Less, left.0, right.0, step),
            Instr::LoopCount { counter, limit, step: by, .. } => {
                self.loop_count(counter.0, limit.0, i32::from(by.0), step);
            }

            Instr::Car { dst, list } => self.follow(dst.0, list.0, &[offset_of!(Cons, car)]),
            Instr::Cdr { dst, list } => self.follow(dst.0, list.0, &[offset_of!(Cons, cdr)]),
            Instr::Cadr { dst, list } => {
                self.follow(dst.0, list.0, &[offset_of!(Cons, cdr), offset_of!(Cons, car)]);
            }
            Instr::Cddr { dst, list } => self.follow(dst.0, list.0, &[offset_of!(Cons, cdr); 2]),
            Instr::SetCar { pair, value } => self.set_half(pair.0, value.0, offset_of!(Cons, car)),
            Instr::SetCdr { pair, value } => self.set_half(pair.0, value.0, offset_of!(Cons, cdr)),

            Instr::VectorRef { dst, vector, index } => {
                self.simple_element_ref(dst.0, vector.0, ElementIndex::Register(index.0));
            }
            Instr::VectorRefInt { dst, vector, index } => {
                self.simple_element_ref(dst.0, vector.0, ElementIndex::Number(index.0));
            }
            Instr::ArrayRef { dst, array, index } => self.element_ref(dst.0, array.0, index.0),
            Instr::VectorSet { vector, index, value } => {
                self.simple_element_set(vector.0, ElementIndex::Register(index.0), value.0);
            }
            Instr::VectorSetInt { vector, index, value } => {
                self.simple_element_set(vector.0, ElementIndex::Number(index.0), value.0);
            }
            Instr::ArraySet { array, index, value } => self.element_set(array.0, index.0, value.0),
            Instr::CharRef { dst, string, index } => self.char_ref(dst.0, string.0, index.0),
            Instr::Slot { dst, instance, slot, class } => {
                let (instance, slow) = (self.get(instance.0), self.cold_block());
                let offset = self.slot(instance, slot.0, class.0, slow);
                let value = self.load(instance, offset);
                self.finish_with(slow, value, dst.0);
            }
            Instr::SetSlot { instance, slot, value, class } => {
                let (instance, value, slow) = (self.get(instance.0), self.get(value.0), self.cold_block());
                let offset = self.slot(instance, slot.0, class.0, slow);
                self.store_slot(value, instance, offset);
                self.finish_effect(slow);
            }
            Instr::JumpIfNotInstance { test, class, .. } => {
                let (value, slow, next) = (self.get(test.0), self.cold_block(), self.block());
                self.require_class(value, usize::from(class.0), slow);
                self.jump(next);
                let target = self.target(step);
                self.go_to(slow);
                self.step_test(target, next);
                self.go_to(next);
            }

            Instr::BoxRef { dst, cell } => {
                let cell = self.get(cell.0);
                let value = self.load(cell, in_object(offset_of!(Boxed, value)));
                self.set(dst.0, value, Known::Nothing);
            }
            Instr::BoxSet { cell, src } => {
                let (cell, value) = (self.get(cell.0), self.get(src.0));
                self.store_slot(value, cell, in_object(offset_of!(Boxed, value)));
            }
            Instr::PatchCapture { closure, index, src } => {
                let (closure, value) = (self.get(closure.0), self.get(src.0));
                self.store_slot(value, closure, capture(index.0));
            }
            Instr::CaptureRef { dst, index } => {
                let value = self.capture(index.0);
                self.set(dst.0, value, Known::Nothing);
            }
            Instr::CaptureBoxRef { dst, index } => {
                let cell = self.capture(index.0);
                let value = self.load(cell, in_object(offset_of!(Boxed, value)));
                self.set(dst.0, value, Known::Nothing);
            }
            Instr::CaptureBoxSet { src, index } => {
                let (cell, value) = (self.capture(index.0), self.get(src.0));
                self.store_slot(value, cell, in_object(offset_of!(Boxed, value)));
            }
            Instr::MakeClosure { dst, function } => {
                let (value, slow) = (self.constant(usize::from(function.0)), self.block());
                self.require_kind(value, Kind::Function, slow);
                self.finish_with(slow, value, dst.0);
            }
            Instr::SymbolValue { dst, symbol } => self.symbol_value(dst.0, symbol.0),
            Instr::SetSymbolValue { src, symbol } => self.set_symbol_value(src.0, symbol.0),
            Instr::Bind { .. } => self.bind(offset_of!(NativeContext, bind)),
            Instr::Unbind { .. } => self.bind(offset_of!(NativeContext, unbind)),

            Instr::Call { window, count, want, .. } => self.call_given(window.0, count.0, want, step.next),
            Instr::CallGlobal { window, count, want, symbol } => {
                self.call_global(window.0, count.0, want, symbol.0, step.next);
            }
            Instr::CallSelf { window, want, .. } => self.call_self(window.0, want, step.next),
            Instr::CallBuiltin { window, .. } if is_root(&step.instr, &self.known) => self.root(window.0),
            Instr::CallBuiltin { window, count, want: Want::ONE, builtin } => {
                if let Some(operation) = TableOperation::of(builtin.0, count.0) {
                    self.lookup(window.0, count.0, operation);
                } else if let Some(operation) = ElementOperation::of(builtin.0, count.0) {
                    self.matrix_element(window.0, operation);
                } else if let Some(values) = values_of(builtin.0, count.0) {
                    self.of_character(window.0, values);
                } else {
                    self.call_builtin(window.0, Want::ONE);
                }
            }
            Instr::CallBuiltin { window, want, .. } => self.call_builtin(window.0, want),
            Instr::TailCall { window, count, .. } => self.tail_call_given(window.0, count.0),
            Instr::TailCallGlobal { window, count, symbol } => {
                self.tail_call_global(window.0, count.0, symbol.0);
            }
            Instr::TailCallBuiltin { .. } => self.tail_call_builtin(),
            Instr::Return { src } => self.return_value(src.0),
            Instr::ReturnValues { first, count } if count.0 == 1 => self.return_value(first.0),
            Instr::ReturnValues { .. } => {
                self.step();
                self.return_values();
            }
            Instr::ReturnAll {} => self.return_values(),
            Instr::Cons { dst, car, cdr } => self.cons(dst.0, car.0, cdr.0),
            _ => self.leave_to_machine(step),
        }
    }

    /// A number stays the one that it is.
    fn load_constant(&mut self, dst: u8, index: usize) {
        let value = self.frame.source.constants.get(index).copied();
        match (self.kinds.of_constant(value.as_ref()), value) {
            (Known::Double, Some(value)) => {
                let double = self.b.ins().f64const(value.as_double().unwrap_or_default());
                self.set_double(dst, double);
            }
            (known @ Known::Fixnum, Some(value)) => {
                self.close_batch();
                let value = self.constant_value(value);
                self.set(dst, value, known);
            }
            _ => {
                self.close_batch();
                let value = self.constant(index);
                self.set(dst, value, Known::Nothing);
            }
        }
    }

    /// Has the machine do the whole instruction: by the function of its slow half, if that does all of it; or
    /// else by the loop.
    fn leave_to_machine(&mut self, step: &FlowStep) {
        if !step.instr.opcode().is_done_by_slow_half() {
            return self.leave();
        }
        if step.target.is_some() {
            let (target, next) = (self.target(step), self.block());
            self.step_test(target, next);
            return self.go_to(next);
        }
        self.spill();
        self.step();
        step.instr.visit_registers(|access| {
            if let RegisterAccess::Write { first, count } = access {
                self.reload(first, count);
            }
        });
    }
}
