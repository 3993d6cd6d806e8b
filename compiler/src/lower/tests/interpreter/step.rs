//! One arm for each instruction that random programs are lowered to.

use std::cell::RefCell;
use std::rc::Rc;

use esl_bytecode::builtin::Builtin;
use esl_bytecode::module::{Capture, CaptureSource, Constant};
use esl_bytecode::opcode::Instr;
use esl_bytecode::operand::*;

use super::super::value::Pair;
use super::{Cell, ExtentKind, Failed, Interpreter, LoadedFunction, Unwinding, Value, divide, holds, simple};

impl Interpreter<'_> {
    /// Does one instruction; says whether the program goes on.
    pub(super) fn step(&mut self) -> Result<bool, Failed> {
        use Builtin as B;
        let frame = self.frames.last_mut().expect("a frame");
        let code = &self.module.functions[frame.function].code;
        let at = frame.pc;
        let instr = Instr::decode(code, at).expect("an instruction");
        frame.pc += instr.opcode().words();
        match instr {
            Instr::Move { dst, src } => {
                let cell = self.cell(src.0).clone();
                assert!(matches!(cell, Cell::Value(_) | Cell::Box(_)), "a move of something");
                *self.cell(dst.0) = cell;
            }
            Instr::LoadInt { dst, value } => self.set(dst.0, Value::Int(i64::from(value.0))),
            Instr::LoadConst { dst, constant } => {
                let value = self.constant(u32::from(constant.0));
                self.set(dst.0, value);
            }
            Instr::LoadNil { first, count } => {
                (first.0..first.0 + count.0).for_each(|r| self.set(r, Value::Nil))
            }
            Instr::LoadTrue { dst } => self.set(dst.0, Value::True),
            Instr::Add { dst, left, right } => return self.two(dst, B::Add, left, right),
            Instr::Sub { dst, left, right } => return self.two(dst, B::Subtract, left, right),
            Instr::Mul { dst, left, right } => return self.two(dst, B::Multiply, left, right),
            Instr::Mod { dst, left, right } => return self.two(dst, B::Mod, left, right),
            Instr::AddInt { dst, left, value } => {
                let sum = simple(B::Add, vec![self.get(left.0), Value::Int(i64::from(value.0))])?;
                self.set(dst.0, sum);
            }
            Instr::Floor { dst, left, right } => {
                let (Value::Int(left), Value::Int(right)) = (self.get(left.0), self.get(right.0)) else {
                    return Err(Failed("TYPE-ERROR"));
                };
                self.set(dst.0, Value::Int(divide(left, right)?.0));
            }
            Instr::Not { dst, src } => return self.one(dst, B::Not, src),
            Instr::Eq { dst, left, right } => return self.two(dst, B::Eq, left, right),
            Instr::Eql { dst, left, right } => return self.two(dst, B::Eql, left, right),
            Instr::NumEq { dst, left, right } => return self.two(dst, B::NumEqual, left, right),
            Instr::Less { dst, left, right } => return self.two(dst, B::Less, left, right),
            Instr::LessEq { dst, left, right } => return self.two(dst, B::LessEqual, left, right),
            Instr::IsType { dst, src, code } => {
                let truth = self.has_type(src, code);
                self.set(dst.0, Value::of_bool(truth));
            }
            Instr::JumpAlways { to: Jump24(to) } | Instr::Loop { to: Back24(to) } => {
                return self.jump_if(true, to);
            }
            Instr::JumpIfNil { test, to: Jump16(to) } | Instr::LoopIfNil { test, to: Back16(to) } => {
                let truth = !self.get(test.0).is_true();
                return self.jump_if(truth, to.into());
            }
            Instr::JumpIfNotNil { test, to: Jump16(to) } | Instr::LoopIfNotNil { test, to: Back16(to) } => {
                let truth = self.get(test.0).is_true();
                return self.jump_if(truth, to.into());
            }
            Instr::JumpIfCons { test, to: Jump16(to) } | Instr::LoopIfCons { test, to: Back16(to) } => {
                let truth = matches!(self.get(test.0), Value::Cons(_));
                return self.jump_if(truth, to.into());
            }
            Instr::JumpIfNotCons { test, to } => {
                let truth = !matches!(self.get(test.0), Value::Cons(_));
                return self.jump_if(truth, to.0.into());
            }
            Instr::JumpIfSupplied { test, to } => {
                let truth = matches!(self.cell(test.0), Cell::Value(_));
                return self.jump_if(truth, to.0.into());
            }
            Instr::JumpEq { left, right, to } => return self.compare(B::Eq, left, right, true, to.0),
            Instr::JumpNotEq { left, right, to } => return self.compare(B::Eq, left, right, false, to.0),
            Instr::JumpEql { left, right, to } => return self.compare(B::Eql, left, right, true, to.0),
            Instr::JumpNotEql { left, right, to } => return self.compare(B::Eql, left, right, false, to.0),
            Instr::JumpEqlConst { left, constant, to } => {
                let truth = self.get(left.0).is(&self.constant(u32::from(constant.0)));
                return self.jump_if(truth, to.0);
            }
            Instr::JumpNotEqlConst { left, constant, to } => {
                let truth = !self.get(left.0).is(&self.constant(u32::from(constant.0)));
                return self.jump_if(truth, to.0);
            }
            Instr::JumpIfType { test, code, to } => {
                let truth = self.has_type(test, code);
                return self.jump_if(truth, to.0);
            }
            Instr::JumpIfNotType { test, code, to } => {
                let truth = !self.has_type(test, code);
                return self.jump_if(truth, to.0);
            }
            Instr::JumpNumEq { left, right, to } => {
                return self.compare(B::NumEqual, left, right, true, to.0);
            }
            Instr::JumpNotNumEq { left, right, to } => {
                return self.compare(B::NumEqual, left, right, false, to.0);
            }
            Instr::JumpLess { left, right, to: Jump(to) } | Instr::LoopLess { left, right, to: Back(to) } => {
                return self.compare(B::Less, left, right, true, to);
            }
            Instr::JumpNotLess { left, right, to: Jump(to) }
            | Instr::LoopNotLess { left, right, to: Back(to) } => {
                return self.compare(B::Less, left, right, false, to);
            }
            Instr::JumpLessEq { left, right, to } => {
                return self.compare(B::LessEqual, left, right, true, to.0);
            }
            Instr::JumpNotLessEq { left, right, to } => {
                return self.compare(B::LessEqual, left, right, false, to.0);
            }
            Instr::JumpNumEqInt { left, value, to } => {
                return self.compare_int(B::NumEqual, left, value, true, to);
            }
            Instr::JumpNotNumEqInt { left, value, to } => {
                return self.compare_int(B::NumEqual, left, value, false, to);
            }
            Instr::JumpLessInt { left, value, to } => {
                return self.compare_int(B::Less, left, value, true, to);
            }
            Instr::JumpNotLessInt { left, value, to } => {
                return self.compare_int(B::Less, left, value, false, to);
            }
            Instr::JumpGreaterInt { left, value, to } => {
                return self.compare_int(B::Greater, left, value, true, to);
            }
            Instr::JumpNotGreaterInt { left, value, to } => {
                return self.compare_int(B::Greater, left, value, false, to);
            }
            Instr::LoopCount { counter, limit, step, to } => {
                let sum = simple(B::Add, vec![self.get(counter.0), Value::Int(i64::from(step.0))])?;
                let limit = self.get(limit.0);
                let truth = holds(B::Less, sum.clone(), limit)?;
                self.set(counter.0, sum);
                return self.jump_if(truth, to.0);
            }
            Instr::Cons { dst, car, cdr } => return self.two(dst, B::Cons, car, cdr),
            Instr::Car { dst, list } => return self.one(dst, B::Car, list),
            Instr::Cdr { dst, list } => return self.one(dst, B::Cdr, list),
            Instr::SetCar { pair, value } => {
                simple(B::Rplaca, vec![self.get(pair.0), self.get(value.0)])?;
            }
            Instr::SetCdr { pair, value } => {
                simple(B::SetCdr, vec![self.get(pair.0), self.get(value.0)])?;
            }
            Instr::List { dst, first, count } => {
                let items = self.range(first.0, count.0);
                self.set(dst.0, Value::list(items));
            }
            Instr::VectorRef { dst, vector, index } => {
                let value = self.element(vector, index).0.borrow().clone();
                self.set(dst.0, value);
            }
            Instr::VectorRefInt { dst, vector, index } => {
                let value = self.element_at(vector, usize::from(index.0)).0.borrow().clone();
                self.set(dst.0, value);
            }
            Instr::VectorSetInt { vector, index, value } => {
                let value = self.get(value.0);
                *self.element_at(vector, usize::from(index.0)).0.borrow_mut() = value;
            }
            Instr::CharRef { dst, string, index } => {
                let value = simple(B::Char, vec![self.get(string.0), self.get(index.0)])?;
                self.set(dst.0, value);
            }
            Instr::CharEq { dst, left, right } => {
                let value = simple(B::CharEqualExactly, vec![self.get(left.0), self.get(right.0)])?;
                self.set(dst.0, value);
            }
            Instr::VectorSet { vector, index, value } => {
                let value = self.get(value.0);
                *self.element(vector, index).0.borrow_mut() = value;
            }
            Instr::MakeBox { dst, src } => {
                let value = self.get(src.0);
                *self.cell(dst.0) = Cell::Box(Rc::new(RefCell::new(value)));
            }
            Instr::BoxRef { dst, cell } => {
                let Cell::Box(cell) = self.cell(cell.0).clone() else { panic!("a box") };
                self.set(dst.0, cell.borrow().clone());
            }
            Instr::BoxSet { cell, src } => {
                let Cell::Box(cell) = self.cell(cell.0).clone() else { panic!("a box") };
                *cell.borrow_mut() = self.get(src.0);
            }
            Instr::MakeClosure { dst, function } => {
                let index = self.frame().function;
                let pool = self.module.functions[index].constants[usize::from(function.0)];
                let Constant::Function(number) = self.module.constants[pool.0 as usize] else {
                    panic!("a function")
                };
                let sources = self.module.functions[number.0 as usize].captures.clone();
                let captures = sources.iter().map(|capture| self.captured(capture)).collect();
                let closure = self.closure(number.0 as usize, captures);
                self.set(dst.0, Value::Function(closure));
            }
            Instr::PatchCapture { closure, index, src } => {
                let (Value::Function(closure), value) = (self.get(closure.0), self.get(src.0)) else {
                    panic!("a function")
                };
                let LoadedFunction::Closure(_, captures) = &*closure else { panic!("a closure") };
                captures.borrow_mut()[usize::from(index.0)] = Cell::Value(value);
            }
            Instr::CaptureRef { dst, index } => {
                let cell = self.capture(index);
                *self.cell(dst.0) = cell;
            }
            Instr::CaptureBoxRef { dst, index } => {
                let Cell::Box(cell) = self.capture(index) else { panic!("a box") };
                self.set(dst.0, cell.borrow().clone());
            }
            Instr::CaptureBoxSet { src, index } => {
                let Cell::Box(cell) = self.capture(index) else { panic!("a box") };
                *cell.borrow_mut() = self.get(src.0);
            }
            Instr::SymbolValue { dst, symbol } => {
                let symbol = self.symbol(symbol.0.into());
                let value = self.globals.get(&symbol).cloned().ok_or(Failed("UNBOUND-VARIABLE"))?;
                self.set(dst.0, value);
            }
            Instr::SetSymbolValue { src, symbol } => {
                let (symbol, value) = (self.symbol(symbol.0.into()), self.get(src.0));
                self.globals.insert(symbol, value);
            }
            Instr::Bind { src, symbol } => {
                let (symbol, value) = (self.symbol(symbol.0.into()), self.get(src.0));
                self.bind(symbol, value);
            }
            Instr::Unbind { count } => self.undo(self.bindings.len() - usize::from(count.0)),
            Instr::BindList { symbols, values } => {
                let (Some(symbols), Some(values)) = (self.get(symbols.0).items(), self.get(values.0).items())
                else {
                    return Err(Failed("TYPE-ERROR"));
                };
                for (symbol, value) in symbols.into_iter().zip(values) {
                    let Value::Symbol(symbol) = symbol else { return Err(Failed("TYPE-ERROR")) };
                    self.bind(symbol, value);
                }
            }
            Instr::FunctionRef { dst, symbol } => {
                let symbol = self.symbol(symbol.0.into());
                let builtin = esl_bytecode::builtin::BUILTINS.iter().find(|info| info.name == symbol.name());
                let function = builtin
                    .map_or(LoadedFunction::Global(symbol), |info| LoadedFunction::Builtin(info.builtin));
                self.set(dst.0, Value::Function(Rc::new(function)));
            }
            Instr::Call { window, count, want, .. } => {
                let (function, arguments) = (self.get(window.0), self.range(window.0 + 2, count.0));
                return self.call(&function, arguments, window.0, want);
            }
            Instr::CallGlobal { window, count, want, symbol } => {
                let (symbol, arguments) = (self.symbol(symbol.0), self.range(window.0 + 2, count.0));
                let function = Value::Function(Rc::new(LoadedFunction::Global(symbol)));
                return self.call(&function, arguments, window.0, want);
            }
            Instr::CallSelf { window, count, want, .. } => {
                let function = Value::Function(self.frame().itself.clone().expect("a closure"));
                let arguments = self.range(window.0 + 2, count.0);
                return self.call(&function, arguments, window.0, want);
            }
            Instr::CallBuiltin { window, count, want, builtin } => {
                let arguments = self.range(window.0 + 2, count.0);
                let values = self.builtin(Builtin::from_number(builtin.0).expect("a builtin"), arguments)?;
                self.deliver(window.0, want, values);
            }
            Instr::Apply { window, count, want, .. } => {
                let (function, mut arguments) = (self.get(window.0), self.range(window.0 + 2, count.0));
                let last = arguments.pop().expect("a list");
                arguments.extend(last.items().ok_or(Failed("TYPE-ERROR"))?);
                return self.call(&function, arguments, window.0, want);
            }
            Instr::TailCall { window, count, .. } => {
                let (function, arguments) = (self.get(window.0), self.range(window.0 + 2, count.0));
                return self.tail_call(&function, arguments);
            }
            Instr::TailCallGlobal { window, count, symbol } => {
                let (symbol, arguments) = (self.symbol(symbol.0), self.range(window.0 + 2, count.0));
                let values = self.global(&symbol, arguments)?;
                return Ok(self.give(values));
            }
            Instr::TailCallBuiltin { window, count, builtin } => {
                let arguments = self.range(window.0 + 2, count.0);
                let values = self.builtin(Builtin::from_number(builtin.0).expect("a builtin"), arguments)?;
                return Ok(self.give(values));
            }
            Instr::TailApply { window, count, .. } => {
                let (function, mut arguments) = (self.get(window.0), self.range(window.0 + 2, count.0));
                let last = arguments.pop().expect("a list");
                arguments.extend(last.items().ok_or(Failed("TYPE-ERROR"))?);
                return self.tail_call(&function, arguments);
            }
            Instr::Return { src } => {
                let value = self.get(src.0);
                return Ok(self.give(vec![value]));
            }
            Instr::ReturnValues { first, count } => {
                let values = self.range(first.0, count.0);
                return Ok(self.give(values));
            }
            Instr::ReturnAll {} => {
                let values = self.values.clone();
                return Ok(self.give(values));
            }
            Instr::SetValues { first, count } => self.values = self.range(first.0, count.0),
            Instr::GetValues { first, count } => {
                for offset in 0..count.0 {
                    let value = self.values.get(usize::from(offset)).cloned().unwrap_or(Value::Nil);
                    self.set(first.0 + offset, value);
                }
            }
            Instr::ValuesToList { dst } => {
                let list = Value::list(self.values.clone());
                self.set(dst.0, list);
            }
            Instr::ListToValues { src } => {
                self.values = self.get(src.0).items().ok_or(Failed("TYPE-ERROR"))?
            }
            Instr::NewTag { dst } => {
                self.next += 1;
                let tag = Value::Unique(self.next);
                self.set(dst.0, tag);
            }
            Instr::PushCatch { window, tag, want, to } => {
                let tag = self.get(tag.0);
                return self.push(ExtentKind::Catch(tag, want), window, to.0);
            }
            Instr::PushCleanup { window, to } => return self.push(ExtentKind::Cleanup, window, to.0),
            Instr::PushHandlerCase { window, types, to } => {
                let types = self.constant(types.0.into()).items().expect("a vector");
                let types = types.into_iter().map(|of| match of {
                    Value::Symbol(symbol) => symbol,
                    _ => panic!("a symbol"),
                });
                return self.push(ExtentKind::HandlerCase(types.collect()), window, to.0);
            }
            Instr::PushScope { window } => return self.push(ExtentKind::Scope, window, 0),
            Instr::PopControl { count } => {
                for _ in 0..count.0 {
                    let entry = self.control.pop().expect("an entry");
                    assert_eq!(entry.frame, self.frames.len(), "an entry of this frame");
                    self.undo(entry.bindings);
                }
            }
            Instr::EnterCleanup {} => {
                let kept = std::mem::take(&mut self.values);
                let entry = self.control.last_mut().expect("an entry");
                entry.kind = ExtentKind::Running(None, kept);
            }
            Instr::EndCleanup {} => {
                let entry = self.control.pop().expect("an entry");
                let ExtentKind::Running(unwinding, kept) = entry.kind else { panic!("a running cleanup") };
                match unwinding {
                    Some(unwinding) => self.unwind(unwinding),
                    None => self.values = kept,
                }
            }
            Instr::Throw { tag, .. } => {
                let tag = self.get(tag.0);
                let target = self
                    .control
                    .iter()
                    .rposition(|entry| matches!(&entry.kind, ExtentKind::Catch(known, _) if known.is(&tag)))
                    .ok_or(Failed("CONTROL-ERROR"))?;
                let values = std::mem::take(&mut self.values);
                self.unwind(Unwinding::Values(target, values));
            }
            other => panic!("not in random programs: {other}"),
        }
        Ok(true)
    }

    /// The pair of a vector's element: vectors are lists here, since only the compiler makes them.
    fn element(&mut self, vector: Reg, index: Reg) -> Pair<LoadedFunction> {
        let Value::Int(index) = self.get(index.0) else { panic!("an index") };
        self.element_at(vector, usize::try_from(index).expect("an index"))
    }

    fn element_at(&mut self, vector: Reg, index: usize) -> Pair<LoadedFunction> {
        let mut rest = self.get(vector.0);
        for _ in 0..index {
            let Value::Cons(pair) = &rest else { panic!("an index inside") };
            let next = pair.1.borrow().clone();
            rest = next;
        }
        let Value::Cons(pair) = rest else { panic!("an index inside") };
        pair
    }

    fn captured(&mut self, capture: &Capture) -> Cell {
        match capture.source {
            CaptureSource::Register(register) => self.cell(register).clone(),
            CaptureSource::Capture(index) => self.capture(Index(index)),
            CaptureSource::Later => Cell::Value(Value::Nil),
        }
    }

    fn compare(
        &mut self,
        builtin: Builtin,
        left: Reg,
        right: Reg,
        sense: bool,
        to: i32,
    ) -> Result<bool, Failed> {
        let (left, right) = (self.get(left.0), self.get(right.0));
        let truth = holds(builtin, left, right)? == sense;
        self.jump_if(truth, to)
    }

    fn compare_int(
        &mut self,
        builtin: Builtin,
        left: Reg,
        value: Int16,
        sense: bool,
        to: Jump,
    ) -> Result<bool, Failed> {
        let left = self.get(left.0);
        let truth = holds(builtin, left, Value::Int(i64::from(value.0)))? == sense;
        self.jump_if(truth, to.0)
    }
}
