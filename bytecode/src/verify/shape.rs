//! The linear pass over a function: what can be seen of each instruction on its own (V1 to V5, and captures
//! of V8).

use super::error::{Fault, FaultPlace, VerifyError};
use super::pool;
use crate::builtin::Builtin;
use crate::module::{
    Constant, FunctionNumber, MAX_CAPTURES, MAX_CODE, MAX_REGISTERS, Module, ModuleFunction, PoolIdx,
    VariablePlace,
};
use crate::opcode::{CallOperands, CallTarget, Instr, Opcode, RegisterAccess, TypeCode};
use crate::operand::{Count, Role, Want};

/// Where instructions begin, and to which of them control may come from elsewhere than the one before.
#[derive(Clone, Debug)]
pub(super) struct CodeShape {
    /// For each word of the code.
    words: Vec<WordUse>,
    /// How many instructions there are.
    pub(super) instructions: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum WordUse {
    Aux,
    Start,
    Target,
}

impl CodeShape {
    /// Returns whether a jump goes to this word, or an unwinding can land there.
    pub(super) fn is_target(&self, pc: usize) -> bool {
        self.words.get(pc) == Some(&WordUse::Target)
    }
}

/// Checks the function as a whole, and each instruction on its own.
pub(super) fn verify(module: &Module, number: FunctionNumber) -> Result<CodeShape, VerifyError> {
    let place = FaultPlace::Function(number);
    let function = pool::function(module, number).map_err(|fault| VerifyError { place, fault })?;
    verify_header(module, function).map_err(|fault| VerifyError { place, fault })?;
    let code = &function.code;
    let mut shape = CodeShape { words: vec![WordUse::Aux; code.len()], instructions: 0 };
    let mut jumps: Vec<(usize, i64)> = Vec::new();
    let mut pc = 0;
    while pc < code.len() {
        let check = Check { module, function, next: 0 };
        let here = |fault| VerifyError { place: FaultPlace::Instruction(number, pc as u32), fault };
        let number = code[pc] as u8;
        let opcode = Opcode::from_number(number).ok_or_else(|| here(Fault::UnknownOpcode(number)))?;
        let instr = Instr::decode(code, pc).ok_or_else(|| here(Fault::MissingAux))?;
        if instr.encode().0 != code[pc] {
            return Err(here(Fault::SpareBits));
        }
        let next = pc + opcode.words();
        let target = Check { next, ..check }.instruction(instr).map_err(here)?;
        jumps.extend(target.map(|target| (pc, target)));
        shape.words[pc] = WordUse::Start;
        shape.instructions += 1;
        pc = next;
    }
    for (pc, target) in jumps {
        match usize::try_from(target).ok().and_then(|target| shape.words.get_mut(target)) {
            Some(word @ (WordUse::Start | WordUse::Target)) => *word = WordUse::Target,
            _ => {
                let place = FaultPlace::Instruction(number, pc as u32);
                return Err(VerifyError { place, fault: Fault::JumpTarget(target) });
            }
        }
    }
    Ok(shape)
}

fn verify_header(module: &Module, function: &ModuleFunction) -> Result<(), Fault> {
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
    verify_lines(module, function)?;
    verify_variables(function)
}

fn verify_captures(function: &ModuleFunction) -> Result<(), Fault> {
    use crate::module::CaptureSource::Later;
    if function.captures.len() > MAX_CAPTURES {
        return Err(Fault::CaptureCount(function.captures.len()));
    }
    match function.captures.iter().position(|capture| capture.source == Later && capture.boxed) {
        Some(index) => Err(Fault::LaterBox(index as u8)),
        None => Ok(()),
    }
}

fn verify_lines(module: &Module, function: &ModuleFunction) -> Result<(), Fault> {
    let ascending = function.lines.windows(2).all(|pair| pair[0].pc < pair[1].pc);
    let known = function.lines.iter().all(|line| {
        (line.source as usize) < module.sources.len() && (line.pc as usize) < function.code.len()
    });
    if ascending && known { Ok(()) } else { Err(Fault::Lines) }
}

fn verify_variables(function: &ModuleFunction) -> Result<(), Fault> {
    let ascending = function.variables.windows(2).all(|pair| pair[0].from <= pair[1].from);
    let within = function.variables.iter().all(|variable| {
        let is_there = match variable.place {
            VariablePlace::Register(register) => register < function.registers,
            VariablePlace::Capture(capture) => usize::from(capture) < function.captures.len(),
        };
        is_there && variable.from < variable.to && variable.to as usize <= function.code.len()
    });
    if ascending && within { Ok(()) } else { Err(Fault::Variables) }
}

/// The check of one instruction.
#[derive(Clone, Copy)]
struct Check<'a> {
    module: &'a Module,
    function: &'a ModuleFunction,
    /// The word after the instruction.
    next: usize,
}

impl Check<'_> {
    /// Checks `instr`. Returns the word that it jumps to, or at which its entry lands.
    fn instruction(self, instr: Instr) -> Result<Option<i64>, Fault> {
        let mut target = None;
        let mut fault = None;
        instr.visit_operands(|role| {
            if fault.is_none() {
                fault = self.operand(role, &mut target).err();
            }
        });
        instr.visit_registers(|access| {
            let (RegisterAccess::Read { first, count } | RegisterAccess::Write { first, count }) = access;
            if fault.is_none() {
                fault = self.range(first.into(), count.into()).err();
            }
        });
        match fault {
            Some(fault) => Err(fault),
            None => self.own_rules(instr).map(|()| target),
        }
    }

    fn operand(self, role: Role, target: &mut Option<i64>) -> Result<(), Fault> {
        match role {
            // These are looked at together, and a window by the rule of the opcode.
            Role::Read(_) | Role::Write(_) | Role::ReadRange(_) | Role::WriteRange(_) => Ok(()),
            Role::Window(_) | Role::Count(_) | Role::Number(_) => Ok(()),
            Role::Pad(0) => Ok(()),
            Role::Pad(_) => Err(Fault::SpareBits),
            Role::Want(Want::ONE | Want::ALL | Want(2..=Want::MAX)) => Ok(()),
            Role::Want(Want(number)) => Err(Fault::Want(number)),
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
            Role::Forward(distance) | Role::Backward(distance) | Role::Landing(distance) => {
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

    /// Checks the rules that the roles of operands do not tell.
    fn own_rules(self, instr: Instr) -> Result<(), Fault> {
        if let Some(call) = instr.call() {
            return self.call(instr, call);
        }
        match instr {
            Instr::PushCatch { window, want, .. } => self.range(window.0.into(), want.registers().into()),
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

    /// A call needs arguments that its callee takes, as far as that is known, and room for a callee, a link
    /// word, the arguments and the results.
    fn call(
        self,
        instr: Instr,
        CallOperands { callee, window, count, want }: CallOperands,
    ) -> Result<(), Fault> {
        let takes_them = match callee {
            CallTarget::Given | CallTarget::Global => true,
            CallTarget::Running => {
                let parameters = &self.function.parameters;
                parameters.is_exact() && parameters.required == count.0
            }
            CallTarget::Builtin => takes(instr, count),
            CallTarget::Applied => count.0 > 0,
        };
        if !takes_them {
            return Err(Fault::Arguments(count.0));
        }
        self.range(window.0.into(), 2 + u32::from(count.0))?;
        self.range(window.0.into(), want.map_or(0, Want::registers).into())
    }

    /// Returns whether the capture, which must be there, is a box.
    fn capture(self, index: u8) -> Result<bool, Fault> {
        let capture = self.function.captures.get(usize::from(index)).ok_or(Fault::Capture(index))?;
        Ok(capture.boxed)
    }
}

/// Returns whether the builtin that is an operand of `instr` takes so many arguments.
fn takes(instr: Instr, count: Count) -> bool {
    let mut builtin = None;
    instr.visit_operands(|role| {
        if let Role::Builtin(number) = role {
            builtin = Builtin::from_number(number);
        }
    });
    let given = u32::from(count.0);
    builtin.is_some_and(|builtin| {
        let arity = builtin.info().arity;
        given >= arity.min && arity.max.is_none_or(|max| given <= max)
    })
}
