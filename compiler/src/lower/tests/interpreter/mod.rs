//! A little interpreter for modules, to compare with [`super::model`]. It does what the opcode table says,
//! and nothing fast: frames do not overlap, and a register that a callee's frame would have covered holds
//! nothing afterwards.

mod step;

use std::cell::RefCell;
use std::rc::Rc;

use esl_bytecode::builtin::Builtin;
use esl_bytecode::module::{Constant, Module, PoolIdx};
use esl_bytecode::opcode::TypeCode;
use esl_bytecode::operand::*;
use esl_bytecode::symbol::Symbol;
use rustc_hash::FxHashMap;

use super::value::Value as AnyValue;

pub(super) enum LoadedFunction {
    Closure(usize, RefCell<Vec<Cell>>),
    Builtin(Builtin),
    Global(Symbol),
}

type Value = AnyValue<LoadedFunction>;

/// The contents of a register or a capture.
#[derive(Clone)]
pub(super) enum Cell {
    Nothing,
    Unsupplied,
    Value(Value),
    Box(Rc<RefCell<Value>>),
}

struct Activation {
    function: usize,
    itself: Option<Rc<LoadedFunction>>,
    registers: Vec<Cell>,
    pc: usize,
    /// Where the caller wants the results.
    window: u8,
    want: Want,
}

enum ExtentKind {
    Catch(Value, Want),
    Cleanup,
    /// Runs; then goes on unwinding, or with the value list as it was.
    Running(Option<Unwinding>, Vec<Value>),
    HandlerCase(Vec<Symbol>),
    Scope,
}

struct Extent {
    kind: ExtentKind,
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

pub(super) struct Interpreter<'a> {
    module: &'a Module,
    log: Vec<String>,
    globals: FxHashMap<Symbol, Value>,
    frames: Vec<Activation>,
    control: Vec<Extent>,
    bindings: Vec<(Symbol, Option<Value>)>,
    values: Vec<Value>,
    constants: FxHashMap<u32, Value>,
    functions: FxHashMap<usize, Rc<LoadedFunction>>,
    next: u64,
}

/// Runs `module`, and returns its log and its end like [`super::model::run`].
pub(super) fn run(module: &Module, steps: u32) -> Option<(Vec<String>, String)> {
    let mut interpreter = Interpreter {
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
    interpreter.enter(module.toplevel[0].0 as usize, None, Vec::new(), 0, Want::ALL).ok()?;
    for _ in 0..steps {
        match interpreter.step() {
            Ok(true) => {}
            Ok(false) => {
                assert!(
                    interpreter.control.is_empty() && interpreter.bindings.is_empty(),
                    "all extents are left"
                );
                let end = interpreter.values.iter().map(|value| format!("{value};")).collect();
                return Some((interpreter.log, end));
            }
            Err(Failed(condition)) => {
                if !interpreter.fail(Symbol::cl(condition)) {
                    return Some((interpreter.log, format!("failed with {condition}")));
                }
            }
        }
    }
    None
}

impl Interpreter<'_> {
    fn frame(&mut self) -> &mut Activation {
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

    fn closure(&mut self, function: usize, captures: Vec<Cell>) -> Rc<LoadedFunction> {
        let closure = || Rc::new(LoadedFunction::Closure(function, RefCell::new(captures.clone())));
        if self.module.functions[function].captures.is_empty() {
            return self.functions.entry(function).or_insert_with(closure).clone();
        }
        closure()
    }

    fn enter(
        &mut self,
        function: usize,
        itself: Option<Rc<LoadedFunction>>,
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
        self.frames.push(Activation { function, itself, registers, pc: 0, window, want });
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
            // Only `Want::ALL` fills the list. Code that reads it after any other call gets this wrong value.
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
            LoadedFunction::Closure(number, _) => {
                self.enter(*number, Some(function.clone()), arguments, window, want)?;
                return Ok(true);
            }
            LoadedFunction::Builtin(builtin) => self.builtin(*builtin, arguments)?,
            LoadedFunction::Global(symbol) => self.global(symbol, arguments)?,
        };
        self.deliver(window, want, values);
        Ok(true)
    }

    fn tail_call(&mut self, function: &Value, arguments: Vec<Value>) -> Result<bool, Failed> {
        let frame = self.frames.last().expect("a frame");
        let (window, want) = (frame.window, frame.want);
        match function {
            Value::Function(target) => match &**target {
                LoadedFunction::Closure(number, _) => {
                    // A failure to enter belongs to the running frame.
                    self.enter(*number, Some(target.clone()), arguments, window, want)?;
                    let called = self.frames.pop().expect("the callee");
                    self.frames.pop();
                    self.frames.push(called);
                    Ok(true)
                }
                LoadedFunction::Builtin(builtin) => {
                    let values = self.builtin(*builtin, arguments)?;
                    Ok(self.give(values))
                }
                LoadedFunction::Global(symbol) => {
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
        let Some(LoadedFunction::Closure(_, captures)) = itself.as_deref() else { panic!("a closure") };
        captures.borrow()[usize::from(index)].clone()
    }

    fn push(&mut self, kind: ExtentKind, window: Window, distance: i32) -> Result<bool, Failed> {
        let to = self.frame().pc.checked_add_signed(distance as isize).expect("a landing inside");
        let (frame, bindings) = (self.frames.len(), self.bindings.len());
        self.control.push(Extent { kind, frame, window: window.0, to, bindings });
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
            if let ExtentKind::HandlerCase(types) = &entry.kind
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
                ExtentKind::Cleanup => {
                    self.frame().pc = entry.to;
                    let kind = ExtentKind::Running(Some(unwinding), Vec::new());
                    self.control.push(Extent { kind, ..entry });
                    return;
                }
                ExtentKind::Catch(_, want) if at_target => {
                    let Unwinding::Values(_, values) = &unwinding else { panic!("values for a catch") };
                    let values = values.clone();
                    self.frame().pc = entry.to;
                    self.deliver(entry.window, want, values);
                }
                ExtentKind::HandlerCase(_) if at_target => {
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
