//! A little machine for modules, to compare with [`super::model`]. It does what the opcode table says, and nothing fast:
//! frames do not overlap, and a register that a callee's frame would have covered holds nothing afterwards.

use std::cell::RefCell;
use std::rc::Rc;

use esl_bytecode::builtin::Builtin;
use esl_bytecode::module::{Capture, CaptureSource, Constant, Module, PoolIdx};
use esl_bytecode::opcode::{Instr, TypeCode};
use esl_bytecode::operand::*;
use esl_bytecode::symbol::Symbol;
use rustc_hash::FxHashMap;

use super::value::Value as AnyValue;

pub(super) enum Function {
    Closure(usize, RefCell<Vec<Cell>>),
    Builtin(Builtin),
    Global(Symbol),
}

type Value = AnyValue<Function>;

/// What a register or a capture holds.
#[derive(Clone)]
pub(super) enum Cell {
    Nothing,
    Unsupplied,
    Value(Value),
    Box(Rc<RefCell<Value>>),
}

struct Frame {
    function: usize,
    itself: Option<Rc<Function>>,
    registers: Vec<Cell>,
    pc: usize,
    /// Where the caller wants the results.
    window: u8,
    want: Want,
}

enum Kind {
    Catch(Value, Want),
    Cleanup,
    /// Runs; then goes on unwinding, or with the value list as it was.
    Running(Option<Unwinding>, Vec<Value>),
    HandlerCase(Vec<Symbol>),
    Scope,
}

struct Entry {
    kind: Kind,
    frame: usize,
    window: u8,
    to: usize,
    bindings: usize,
}

/// To which entry, counted from the bottom, and with what.
#[derive(Clone)]
enum Unwinding {
    Values(usize, Vec<Value>),
    Condition(usize, i64, Symbol),
}

impl Unwinding {
    fn target(&self) -> usize {
        match self {
            Unwinding::Values(target, _) | Unwinding::Condition(target, ..) => *target,
        }
    }
}

/// The condition that an instruction fails with.
struct Failed(&'static str);

pub(super) struct Machine<'a> {
    module: &'a Module,
    log: Vec<String>,
    globals: FxHashMap<Symbol, Value>,
    frames: Vec<Frame>,
    control: Vec<Entry>,
    bindings: Vec<(Symbol, Option<Value>)>,
    values: Vec<Value>,
    constants: FxHashMap<u32, Value>,
    functions: FxHashMap<usize, Rc<Function>>,
    next: u64,
}

/// What a run has done, as [`super::model::run`] says it.
pub(super) fn run(module: &Module, steps: u32) -> Option<(Vec<String>, String)> {
    let mut machine = Machine {
        module,
        log: Vec::new(),
        globals: FxHashMap::default(),
        frames: Vec::new(),
        control: Vec::new(),
        bindings: Vec::new(),
        values: Vec::new(),
        constants: FxHashMap::default(),
        functions: FxHashMap::default(),
        next: 0,
    };
    machine.enter(module.toplevel[0].0 as usize, None, Vec::new(), 0, Want::ALL).ok()?;
    for _ in 0..steps {
        match machine.step() {
            Ok(true) => {}
            Ok(false) => {
                assert!(machine.control.is_empty() && machine.bindings.is_empty(), "all extents are left");
                let end = machine.values.iter().map(|value| format!("{value};")).collect();
                return Some((machine.log, end));
            }
            Err(Failed(condition)) => {
                if !machine.fail(Symbol::cl(condition)) {
                    return Some((machine.log, format!("failed with {condition}")));
                }
            }
        }
    }
    None
}

impl Machine<'_> {
    fn frame(&mut self) -> &mut Frame {
        self.frames.last_mut().expect("a frame")
    }

    fn cell(&mut self, register: u8) -> &mut Cell {
        &mut self.frame().registers[usize::from(register)]
    }

    fn get(&mut self, register: u8) -> Value {
        match self.cell(register) {
            Cell::Value(value) => value.clone(),
            _ => panic!("r{register} holds no value"),
        }
    }

    fn range(&mut self, first: u8, count: u8) -> Vec<Value> {
        (first..first + count).map(|register| self.get(register)).collect()
    }

    fn set(&mut self, register: u8, value: Value) {
        *self.cell(register) = Cell::Value(value);
    }

    fn constant(&mut self, index: u32) -> Value {
        let function = &self.module.functions[self.frames.last().expect("a frame").function];
        let pool = function.constants[index as usize];
        self.pool_value(pool)
    }

    fn symbol(&mut self, index: u32) -> Symbol {
        match self.constant(index) {
            Value::Symbol(symbol) => symbol,
            _ => panic!("a symbol"),
        }
    }

    fn pool_value(&mut self, index: PoolIdx) -> Value {
        if let Some(value) = self.constants.get(&index.0) {
            return value.clone();
        }
        let value = match self.module.constants[index.0 as usize].clone() {
            Constant::Nil => Value::Nil,
            Constant::True => Value::True,
            Constant::Symbol(symbol) => Value::Symbol(symbol),
            Constant::Integer(value) => Value::Int(i64::try_from(value).expect("a small integer")),
            Constant::Cons(car, cdr) => Value::cons(self.pool_value(car), self.pool_value(cdr)),
            Constant::Vector(items) => {
                Value::list(items.into_iter().map(|item| self.pool_value(item)).collect())
            }
            Constant::Function(number) => Value::Function(self.closure(number.0 as usize, Vec::new())),
            other => panic!("no such constants here: {other:?}"),
        };
        self.constants.insert(index.0, value.clone());
        value
    }

    fn closure(&mut self, function: usize, captures: Vec<Cell>) -> Rc<Function> {
        let closure = || Rc::new(Function::Closure(function, RefCell::new(captures.clone())));
        if self.module.functions[function].captures.is_empty() {
            return self.functions.entry(function).or_insert_with(closure).clone();
        }
        closure()
    }

    fn enter(
        &mut self,
        function: usize,
        itself: Option<Rc<Function>>,
        arguments: Vec<Value>,
        window: u8,
        want: Want,
    ) -> Result<(), Failed> {
        let text = &self.module.functions[function];
        let parameters = &text.parameters;
        let (required, optional) = (usize::from(parameters.required), usize::from(parameters.optional));
        let most = required + optional;
        if arguments.len() < required || (arguments.len() > most && !parameters.rest) {
            return Err(Failed("PROGRAM-ERROR"));
        }
        let mut registers = vec![Cell::Nothing; usize::from(text.registers)];
        for (index, register) in registers.iter_mut().enumerate().take(most) {
            *register = arguments.get(index).cloned().map_or(Cell::Unsupplied, Cell::Value);
        }
        if parameters.rest {
            registers[most] = Cell::Value(Value::list(arguments[most.min(arguments.len())..].to_vec()));
        }
        self.frames.push(Frame { function, itself, registers, pc: 0, window, want });
        Ok(())
    }

    /// Returns from the innermost frame; says whether there is another one.
    fn give(&mut self, values: Vec<Value>) -> bool {
        let frame = self.frames.pop().expect("a frame");
        if self.frames.is_empty() {
            self.values = values;
            return false;
        }
        self.deliver(frame.window, frame.want, values);
        true
    }

    fn deliver(&mut self, window: u8, want: Want, values: Vec<Value>) {
        for register in usize::from(window)..self.frame().registers.len() {
            self.frame().registers[register] = Cell::Nothing;
        }
        let mut given = values.iter();
        for offset in 0..want.registers() {
            self.set(window + offset, given.next().cloned().unwrap_or(Value::Nil));
        }
        if want == Want::ALL {
            self.values = values;
        } else {
            // Whoever relied on the list would be wrong.
            self.values = vec![Value::Symbol(Symbol::cl("STALE"))];
        }
    }

    fn call(
        &mut self,
        function: &Value,
        arguments: Vec<Value>,
        window: u8,
        want: Want,
    ) -> Result<bool, Failed> {
        let function = match function {
            Value::Function(function) => function.clone(),
            _ => return Err(Failed("TYPE-ERROR")),
        };
        let values = match &*function {
            Function::Closure(number, _) => {
                self.enter(*number, Some(function.clone()), arguments, window, want)?;
                return Ok(true);
            }
            Function::Builtin(builtin) => self.builtin(*builtin, arguments)?,
            Function::Global(symbol) => self.global(symbol, arguments)?,
        };
        self.deliver(window, want, values);
        Ok(true)
    }

    fn tail_call(&mut self, function: &Value, arguments: Vec<Value>) -> Result<bool, Failed> {
        let frame = self.frames.last().expect("a frame");
        let (window, want) = (frame.window, frame.want);
        match function {
            Value::Function(target) => match &**target {
                Function::Closure(number, _) => {
                    // A failure to enter belongs to the running frame.
                    self.enter(*number, Some(target.clone()), arguments, window, want)?;
                    let called = self.frames.pop().expect("the callee");
                    self.frames.pop();
                    self.frames.push(called);
                    Ok(true)
                }
                Function::Builtin(builtin) => {
                    let values = self.builtin(*builtin, arguments)?;
                    Ok(self.give(values))
                }
                Function::Global(symbol) => {
                    let values = self.global(symbol, arguments)?;
                    Ok(self.give(values))
                }
            },
            _ => Err(Failed("TYPE-ERROR")),
        }
    }

    fn global(&mut self, symbol: &Symbol, arguments: Vec<Value>) -> Result<Vec<Value>, Failed> {
        let text: String = arguments.iter().map(|argument| format!(" {argument}")).collect();
        self.log.push(format!("{symbol}{text}"));
        match symbol.name() {
            "FAIL" => Err(Failed("FAILURE")),
            "TWO" => Ok(vec![Value::Int(arguments.len() as i64), Value::True]),
            _ => Ok(vec![arguments.into_iter().next().unwrap_or(Value::Nil)]),
        }
    }

    fn builtin(&mut self, builtin: Builtin, arguments: Vec<Value>) -> Result<Vec<Value>, Failed> {
        match builtin {
            Builtin::ValuesList => arguments[0].items().ok_or(Failed("TYPE-ERROR")),
            Builtin::Floor => {
                let [Value::Int(number), Value::Int(divisor)] = arguments[..] else {
                    return Err(Failed("TYPE-ERROR"));
                };
                let (quotient, remainder) = divide(number, divisor)?;
                Ok(vec![Value::Int(quotient), Value::Int(remainder)])
            }
            _ => simple(builtin, arguments).map(|value| vec![value]),
        }
    }

    fn two(&mut self, dst: Dst, builtin: Builtin, left: Reg, right: Reg) -> Result<bool, Failed> {
        let arguments = vec![self.get(left.0), self.get(right.0)];
        let value = simple(builtin, arguments)?;
        self.set(dst.0, value);
        Ok(true)
    }

    fn one(&mut self, dst: Dst, builtin: Builtin, object: Reg) -> Result<bool, Failed> {
        let arguments = vec![self.get(object.0)];
        let value = simple(builtin, arguments)?;
        self.set(dst.0, value);
        Ok(true)
    }

    fn jump_if(&mut self, truth: bool, distance: i32) -> Result<bool, Failed> {
        if truth {
            let pc = &mut self.frame().pc;
            *pc = pc.checked_add_signed(distance as isize).expect("a jump inside");
        }
        Ok(true)
    }

    fn has_type(&mut self, register: Reg, TypeIdx(code): TypeIdx) -> bool {
        let value = self.get(register.0);
        match TypeCode::from_number(code).expect("a type code") {
            TypeCode::Integer => matches!(value, Value::Int(_)),
            TypeCode::Cons => matches!(value, Value::Cons(_)),
            TypeCode::Atom => !matches!(value, Value::Cons(_)),
            other => panic!("not in random programs: {other:?}"),
        }
    }

    fn capture(&mut self, Index(index): Index) -> Cell {
        let itself = self.frame().itself.clone();
        let Some(Function::Closure(_, captures)) = itself.as_deref() else { panic!("a closure") };
        captures.borrow()[usize::from(index)].clone()
    }

    fn push(&mut self, kind: Kind, window: Base, distance: i32) -> Result<bool, Failed> {
        let to = self.frame().pc.checked_add_signed(distance as isize).expect("a landing inside");
        let (frame, bindings) = (self.frames.len(), self.bindings.len());
        self.control.push(Entry { kind, frame, window: window.0, to, bindings });
        Ok(true)
    }

    fn undo(&mut self, height: usize) {
        while self.bindings.len() > height {
            let (symbol, old) = self.bindings.pop().expect("a binding");
            match old {
                Some(old) => self.globals.insert(symbol, old),
                None => self.globals.remove(&symbol),
            };
        }
    }

    fn bind(&mut self, symbol: Symbol, value: Value) {
        let old = self.globals.insert(symbol.clone(), value);
        self.bindings.push((symbol, old));
    }

    fn fail(&mut self, condition: Symbol) -> bool {
        let mut found = None;
        for (index, entry) in self.control.iter().enumerate().rev() {
            if let Kind::HandlerCase(types) = &entry.kind
                && let Some(case) = types.iter().position(|of| of.is_cl("ERROR") || *of == condition)
            {
                found = Some((index, case));
                break;
            }
        }
        // Random programs have a handler around them all.
        let Some((index, case)) = found else { return false };
        self.unwind(Unwinding::Condition(index, case as i64, condition));
        true
    }

    /// Unwinds to the target, or to a cleanup on the way.
    fn unwind(&mut self, unwinding: Unwinding) {
        while self.control.len() > unwinding.target() {
            let entry = self.control.pop().expect("an entry");
            self.undo(entry.bindings);
            self.frames.truncate(entry.frame);
            let at_target = self.control.len() == unwinding.target();
            for register in usize::from(entry.window)..self.frame().registers.len() {
                self.frame().registers[register] = Cell::Nothing;
            }
            match entry.kind {
                Kind::Cleanup => {
                    self.frame().pc = entry.to;
                    let kind = Kind::Running(Some(unwinding), Vec::new());
                    self.control.push(Entry { kind, ..entry });
                    return;
                }
                Kind::Catch(_, want) if at_target => {
                    let Unwinding::Values(_, values) = &unwinding else { panic!("values for a catch") };
                    let values = values.clone();
                    self.frame().pc = entry.to;
                    self.deliver(entry.window, want, values);
                }
                Kind::HandlerCase(_) if at_target => {
                    let Unwinding::Condition(_, case, condition) = &unwinding else { panic!("a condition") };
                    let (case, condition) = (*case, condition.clone());
                    self.frame().pc = entry.to;
                    self.set(entry.window, Value::Int(case));
                    self.set(entry.window + 1, Value::Symbol(condition));
                }
                _ => {}
            }
        }
    }

    fn step(&mut self) -> Result<bool, Failed> {
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
            Instr::JumpAlways { to } => return self.jump_if(true, to.0),
            Instr::Loop { to } => return self.jump_if(true, to.0),
            Instr::JumpIfNil { test, to } => {
                let truth = !self.get(test.0).is_true();
                return self.jump_if(truth, to.0.into());
            }
            Instr::LoopIfNil { test, to } => {
                let truth = !self.get(test.0).is_true();
                return self.jump_if(truth, to.0.into());
            }
            Instr::JumpIfNotNil { test, to } => {
                let truth = self.get(test.0).is_true();
                return self.jump_if(truth, to.0.into());
            }
            Instr::LoopIfNotNil { test, to } => {
                let truth = self.get(test.0).is_true();
                return self.jump_if(truth, to.0.into());
            }
            Instr::JumpIfCons { test, to } => {
                let truth = matches!(self.get(test.0), Value::Cons(_));
                return self.jump_if(truth, to.0.into());
            }
            Instr::JumpIfNotCons { test, to } => {
                let truth = !matches!(self.get(test.0), Value::Cons(_));
                return self.jump_if(truth, to.0.into());
            }
            Instr::LoopIfCons { test, to } => {
                let truth = matches!(self.get(test.0), Value::Cons(_));
                return self.jump_if(truth, to.0.into());
            }
            Instr::JumpIfSupplied { test, to } => {
                let truth = matches!(self.cell(test.0), Cell::Value(_));
                return self.jump_if(truth, to.0.into());
            }
            Instr::JumpEq { left, right, to } => {
                let truth = self.get(left.0).is(&self.get(right.0));
                return self.jump_if(truth, to.0);
            }
            Instr::JumpNotEq { left, right, to } => {
                let truth = !self.get(left.0).is(&self.get(right.0));
                return self.jump_if(truth, to.0);
            }
            Instr::JumpEql { left, right, to } => {
                let truth = self.get(left.0).is(&self.get(right.0));
                return self.jump_if(truth, to.0);
            }
            Instr::JumpNotEql { left, right, to } => {
                let truth = !self.get(left.0).is(&self.get(right.0));
                return self.jump_if(truth, to.0);
            }
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
            Instr::JumpLess { left, right, to } => return self.compare(B::Less, left, right, true, to.0),
            Instr::LoopLess { left, right, to } => return self.compare(B::Less, left, right, true, to.0),
            Instr::JumpNotLess { left, right, to } => return self.compare(B::Less, left, right, false, to.0),
            Instr::LoopNotLess { left, right, to } => return self.compare(B::Less, left, right, false, to.0),
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
                let Function::Closure(_, captures) = &*closure else { panic!("a closure") };
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
                let function =
                    builtin.map_or(Function::Global(symbol), |info| Function::Builtin(info.builtin));
                self.set(dst.0, Value::Function(Rc::new(function)));
            }
            Instr::Call { window, count, want, .. } => {
                let (function, arguments) = (self.get(window.0), self.range(window.0 + 2, count.0));
                return self.call(&function, arguments, window.0, want);
            }
            Instr::CallGlobal { window, count, want, symbol } => {
                let (symbol, arguments) = (self.symbol(symbol.0), self.range(window.0 + 2, count.0));
                let function = Value::Function(Rc::new(Function::Global(symbol)));
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
                return self.push(Kind::Catch(tag, want), window, to.0);
            }
            Instr::PushCleanup { window, to } => return self.push(Kind::Cleanup, window, to.0),
            Instr::PushHandlerCase { window, types, to } => {
                let types = self.constant(types.0.into()).items().expect("a vector");
                let types = types.into_iter().map(|of| match of {
                    Value::Symbol(symbol) => symbol,
                    _ => panic!("a symbol"),
                });
                return self.push(Kind::HandlerCase(types.collect()), window, to.0);
            }
            Instr::PushScope { window } => return self.push(Kind::Scope, window, 0),
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
                entry.kind = Kind::Running(None, kept);
            }
            Instr::EndCleanup {} => {
                let entry = self.control.pop().expect("an entry");
                let Kind::Running(unwinding, kept) = entry.kind else { panic!("a running cleanup") };
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
                    .rposition(|entry| matches!(&entry.kind, Kind::Catch(known, _) if known.is(&tag)))
                    .ok_or(Failed("CONTROL-ERROR"))?;
                let values = std::mem::take(&mut self.values);
                self.unwind(Unwinding::Values(target, values));
            }
            other => panic!("not in random programs: {other}"),
        }
        Ok(true)
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

fn divide(number: i64, divisor: i64) -> Result<(i64, i64), Failed> {
    match divisor {
        ..=0 => Err(Failed("DIVISION-BY-ZERO")),
        _ => Ok((number.div_euclid(divisor), number.rem_euclid(divisor))),
    }
}

fn simple(builtin: Builtin, arguments: Vec<Value>) -> Result<Value, Failed> {
    match Value::apply_builtin(builtin, &arguments) {
        Some(result) => result.map_err(Failed),
        None => panic!("not in random programs: {builtin:?}"),
    }
}

fn holds(builtin: Builtin, left: Value, right: Value) -> Result<bool, Failed> {
    Ok(simple(builtin, vec![left, right])?.is_true())
}
