//! The linear pass over a function: what can be seen of each instruction on its own (V1 to V5, and captures of V8).

use super::error::{Fault, Place, VerifyError};
use super::pool;
use crate::builtin::Builtin;
use crate::module::{
    Constant, Function, FunctionNumber, MAX_CAPTURES, MAX_CODE, MAX_REGISTERS, Module, Parameters, PoolIdx,
};
use crate::opcode::{Instr, Opcode, TypeCode};
use crate::operand::{Base, Count, Pad, Role, Want};

/// Where instructions begin, and to which of them control may come from elsewhere than the one before.
#[derive(Clone, Debug)]
pub(super) struct Shape {
    /// For each word of the code.
    words: Vec<Word>,
    /// How many instructions there are.
    pub(super) instructions: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Word {
    Aux,
    Start,
    Target,
}

impl Shape {
    /// Whether a jump goes to this word, or an unwinding can land there.
    pub(super) fn is_target(&self, pc: usize) -> bool {
        self.words.get(pc) == Some(&Word::Target)
    }
}

/// Checks the function as a whole, and each instruction on its own.
pub(super) fn verify(module: &Module, number: FunctionNumber) -> Result<Shape, VerifyError> {
    let place = Place::Function(number);
    let function = pool::function(module, number).map_err(|fault| VerifyError { place, fault })?;
    verify_header(module, function).map_err(|fault| VerifyError { place, fault })?;
    let code = &function.code;
    let mut shape = Shape { words: vec![Word::Aux; code.len()], instructions: 0 };
    let mut jumps: Vec<(usize, i64)> = Vec::new();
    let mut pc = 0;
    while pc < code.len() {
        let check = Check { module, function, next: 0 };
        let here = |fault| VerifyError { place: Place::Instruction(number, pc as u32), fault };
        let number = code[pc] as u8;
        let opcode = Opcode::from_number(number).ok_or_else(|| here(Fault::UnknownOpcode(number)))?;
        let instr = Instr::decode(code, pc).ok_or_else(|| here(Fault::MissingAux))?;
        if instr.encode().0 != code[pc] {
            return Err(here(Fault::SpareBits));
        }
        let next = pc + opcode.words();
        let target = Check { next, ..check }.instruction(instr).map_err(here)?;
        jumps.extend(target.map(|target| (pc, target)));
        shape.words[pc] = Word::Start;
        shape.instructions += 1;
        pc = next;
    }
    for (pc, target) in jumps {
        match usize::try_from(target).ok().and_then(|target| shape.words.get_mut(target)) {
            Some(word @ (Word::Start | Word::Target)) => *word = Word::Target,
            _ => {
                let place = Place::Instruction(number, pc as u32);
                return Err(VerifyError { place, fault: Fault::JumpTarget(target) });
            }
        }
    }
    Ok(shape)
}

fn verify_header(module: &Module, function: &Function) -> Result<(), Fault> {
    if function.code.is_empty() || function.code.len() > MAX_CODE {
        return Err(Fault::CodeLength(function.code.len()));
    }
    if function.registers > MAX_REGISTERS {
        return Err(Fault::Registers(function.registers));
    }
    let parameters = function.parameters.registers();
    if parameters > usize::from(function.registers) {
        return Err(Fault::Parameters(parameters));
    }
    for &key in function.parameters.keys.iter().flatten() {
        match pool::constant(module, key)? {
            Constant::Symbol(_) | Constant::Nil | Constant::True => {}
            _ => return Err(Fault::KeyName(key)),
        }
    }
    for index in [function.name, function.lambda_list, function.documentation].into_iter().flatten() {
        pool::verify_data(module, index)?;
    }
    if let Some(&index) = function.constants.iter().find(|index| index.0 as usize >= module.constants.len()) {
        return Err(Fault::PoolIndex(index));
    }
    verify_captures(function)?;
    verify_lines(module, function)
}

fn verify_captures(function: &Function) -> Result<(), Fault> {
    use crate::module::CaptureSource::Later;
    if function.captures.len() > MAX_CAPTURES {
        return Err(Fault::CaptureCount(function.captures.len()));
    }
    match function.captures.iter().position(|capture| capture.source == Later && capture.boxed) {
        Some(index) => Err(Fault::LaterBox(index as u8)),
        None => Ok(()),
    }
}

fn verify_lines(module: &Module, function: &Function) -> Result<(), Fault> {
    let ascending = function.lines.windows(2).all(|pair| pair[0].pc < pair[1].pc);
    let known = function.lines.iter().all(|line| {
        (line.source as usize) < module.sources.len() && (line.pc as usize) < function.code.len()
    });
    if ascending && known { Ok(()) } else { Err(Fault::Lines) }
}

/// The check of one instruction.
#[derive(Clone, Copy)]
struct Check<'a> {
    module: &'a Module,
    function: &'a Function,
    /// The word after the instruction.
    next: usize,
}

impl Check<'_> {
    /// Checks `instr`, and gives the word that it jumps to or has control land at.
    fn instruction(self, instr: Instr) -> Result<Option<i64>, Fault> {
        let mut target = None;
        let mut fault = None;
        instr.visit_operands(|role| {
            if fault.is_none() {
                fault = self.operand(role, &mut target).err();
            }
        });
        match fault {
            Some(fault) => Err(fault),
            None => self.own_rules(instr).map(|()| target),
        }
    }

    fn operand(self, role: Role, target: &mut Option<i64>) -> Result<(), Fault> {
        match role {
            Role::Read(register) | Role::Write(register) => self.range(u32::from(register), 1),
            // The rule of the opcode says how far it goes.
            Role::Base(_) | Role::Number(_) => Ok(()),
            Role::Constant(index) => pool::verify_data(self.module, self.pool_index(index)?),
            Role::SymbolConstant(index) => {
                self.kind(index, "a symbol", |constant| matches!(constant, Constant::Symbol(_)))
            }
            Role::FunctionConstant(index) => {
                self.kind(index, "a function", |constant| matches!(constant, Constant::Function(_)))
            }
            Role::ClassConstant(index) => {
                self.kind(index, "a class", |constant| matches!(constant, Constant::Class(_)))
            }
            Role::VectorConstant(index) => self.type_specifiers(index),
            Role::Forward(distance) | Role::Backward(distance) => {
                if (distance < 0) != matches!(role, Role::Backward(_)) {
                    return Err(Fault::JumpDirection(distance));
                }
                *target = Some(self.next as i64 + i64::from(distance));
                Ok(())
            }
            Role::Builtin(number) => match Builtin::from_number(number) {
                Some(_) => Ok(()),
                None => Err(Fault::Builtin(number)),
            },
            Role::TypeCode(code) => match TypeCode::from_number(code) {
                Some(_) => Ok(()),
                None => Err(Fault::TypeCode(code)),
            },
        }
    }

    /// `count` registers from `first` on.
    fn range(self, first: u32, count: u32) -> Result<(), Fault> {
        let end = first + count;
        let registers = self.function.registers;
        if end > u32::from(registers) { Err(Fault::Register { end, registers }) } else { Ok(()) }
    }

    fn pool_index(self, index: u32) -> Result<PoolIdx, Fault> {
        let constants = &self.function.constants;
        constants.get(index as usize).copied().ok_or(Fault::Constant { found: index, count: constants.len() })
    }

    fn kind(self, index: u32, expected: &'static str, is: fn(&Constant) -> bool) -> Result<(), Fault> {
        let constant = pool::constant(self.module, self.pool_index(index)?)?;
        if is(constant) { Ok(()) } else { Err(Fault::ConstantKind { found: index, expected }) }
    }

    fn type_specifiers(self, index: u32) -> Result<(), Fault> {
        let is_type = |item: &PoolIdx| {
            use Constant::{Cons, Nil, Symbol, True};
            matches!(pool::constant(self.module, *item), Ok(Symbol(_) | Nil | True | Cons(..)))
        };
        match pool::constant(self.module, self.pool_index(index)?)? {
            Constant::Vector(items) if items.iter().all(is_type) => Ok(()),
            _ => Err(Fault::ConstantKind { found: index, expected: "a vector of types" }),
        }
    }

    /// What the roles of operands do not tell.
    fn own_rules(self, instr: Instr) -> Result<(), Fault> {
        match instr {
            Instr::Call { pad: Pad(1..), .. }
            | Instr::CallSelf { pad: Pad(1..), .. }
            | Instr::Apply { pad: Pad(1..), .. }
            | Instr::TailCall { pad: Pad(1..), .. }
            | Instr::TailApply { pad: Pad(1..), .. } => Err(Fault::SpareBits),
            Instr::LoadNil { first, count }
            | Instr::List { first, count, .. }
            | Instr::ReturnValues { first, count }
            | Instr::SetValues { first, count }
            | Instr::GetValues { first, count } => self.range(first.0.into(), count.0.into()),
            Instr::Call { window, count, want, .. } | Instr::CallGlobal { window, count, want, .. } => {
                self.window(window, count, want)
            }
            Instr::CallSelf { window, count, want, .. } => {
                let Parameters { required, .. } = self.function.parameters;
                if !self.function.parameters.is_exact() || required != count.0 {
                    return Err(Fault::Arguments(count.0));
                }
                self.window(window, count, want)
            }
            Instr::CallBuiltin { window, count, want, builtin } => {
                self.builtin_arity(builtin.0, count)?;
                self.window(window, count, want)
            }
            Instr::TailCallBuiltin { window, count, builtin } => {
                self.builtin_arity(builtin.0, count)?;
                self.window(window, count, Want::ONE)
            }
            Instr::Apply { window, count, want, .. } => {
                self.list_argument(count)?;
                self.window(window, count, want)
            }
            Instr::TailApply { window, count, .. } => {
                self.list_argument(count)?;
                self.window(window, count, Want::ONE)
            }
            Instr::TailCall { window, count, .. } | Instr::TailCallGlobal { window, count, .. } => {
                self.window(window, count, Want::ONE)
            }
            Instr::PushCatch { window, want, .. } => {
                self.want(want)?;
                self.range(window.0.into(), want.registers().into())
            }
            Instr::PushHandlerCase { window, .. } | Instr::PushRecovery { window, .. } => {
                self.range(window.0.into(), 2)
            }
            Instr::PushCleanup { window, .. }
            | Instr::PushFailureCleanup { window, .. }
            | Instr::PushHandlers { window, .. }
            | Instr::PushMask { window, .. }
            | Instr::PushScope { window } => self.range(window.0.into(), 0),
            Instr::Throw { kind, .. } if kind.0 > 2 => Err(Fault::ThrowKind(kind.0)),
            Instr::CaptureRef { index, .. } => self.capture(index.0).map(|_| ()),
            Instr::CaptureBoxRef { index, .. } | Instr::CaptureBoxSet { index, .. } => {
                if self.capture(index.0)? { Ok(()) } else { Err(Fault::CaptureKind(index.0)) }
            }
            _ => Ok(()),
        }
    }

    /// Room for a callee, a link word and arguments, and for the results.
    fn window(self, window: Base, count: Count, want: Want) -> Result<(), Fault> {
        self.want(want)?;
        self.range(window.0.into(), 2 + u32::from(count.0))?;
        self.range(window.0.into(), want.registers().into())
    }

    fn want(self, want: Want) -> Result<(), Fault> {
        match want {
            Want::ONE | Want::ALL | Want(2..=Want::MAX) => Ok(()),
            Want(number) => Err(Fault::Want(number)),
        }
    }

    fn builtin_arity(self, number: u32, count: Count) -> Result<(), Fault> {
        let arity = Builtin::from_number(number).ok_or(Fault::Builtin(number))?.info().arity;
        let given = u32::from(count.0);
        if given >= arity.min && arity.max.is_none_or(|max| given <= max) {
            Ok(())
        } else {
            Err(Fault::Arguments(count.0))
        }
    }

    fn list_argument(self, count: Count) -> Result<(), Fault> {
        if count.0 == 0 { Err(Fault::Arguments(0)) } else { Ok(()) }
    }

    /// Whether the capture, which must be there, is a box.
    fn capture(self, index: u8) -> Result<bool, Fault> {
        let capture = self.function.captures.get(usize::from(index)).ok_or(Fault::Capture(index))?;
        Ok(capture.boxed)
    }
}
