//! Places that instructions read and change, and that other tasks may reach, for explorations of schedules.
//!
//! Each opcode has its place in the table: [`Opcode::sharing`] does not compile without a new one. An
//! instruction that is a builtin changes the kind of place that the row of the builtin names.
//!
//! Not here: calls, whose callees have tables of their own; registers, which belong to one task.

use crate::builtin::{Builtin, Shares};
use crate::opcode::{Instr, OPCODES, Opcode};

/// The use that an instruction makes of a place that other tasks may reach.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sharing {
    /// The kind of place.
    pub place: Shares,
    /// Whether the instruction changes the place, or reads it only.
    pub is_change: bool,
}

impl Opcode {
    /// Returns the use that the instruction makes of a place that other tasks may reach.
    pub const fn sharing(self) -> Option<Sharing> {
        let (place, is_change) = match self {
            Opcode::Car | Opcode::Cdr | Opcode::Cadr | Opcode::Cddr => (Shares::Pairs, false),
            Opcode::SetCar | Opcode::SetCdr => (Shares::Pairs, true),
            Opcode::VectorRef | Opcode::VectorRefInt | Opcode::ArrayRef | Opcode::CharRef => {
                (Shares::Elements, false)
            }
            Opcode::VectorSet | Opcode::VectorSetInt | Opcode::ArraySet => (Shares::Elements, true),
            Opcode::Slot => (Shares::Slots, false),
            Opcode::SetSlot => (Shares::Slots, true),
            Opcode::BoxRef | Opcode::CaptureBoxRef => (Shares::Captured, false),
            Opcode::BoxSet | Opcode::CaptureBoxSet => (Shares::Captured, true),
            Opcode::SymbolValue => (Shares::Variables, false),
            Opcode::SetSymbolValue => (Shares::Variables, true),
            // Registers, constants and numbers; a capture is filled in before its closure is handed on.
            Opcode::Move
            | Opcode::LoadInt
            | Opcode::LoadConst
            | Opcode::LoadNil
            | Opcode::LoadTrue
            | Opcode::Add
            | Opcode::Sub
            | Opcode::Mul
            | Opcode::Div
            | Opcode::AddInt
            | Opcode::Floor
            | Opcode::Truncate
            | Opcode::Mod
            | Opcode::Rem
            | Opcode::LogAnd
            | Opcode::LogIor
            | Opcode::LogXor
            | Opcode::Ash
            | Opcode::Not
            | Opcode::Eq
            | Opcode::Eql
            | Opcode::NumEq
            | Opcode::Less
            | Opcode::LessEq
            | Opcode::CharEq
            | Opcode::IsType
            | Opcode::MakeBox
            | Opcode::MakeClosure
            | Opcode::PatchCapture
            | Opcode::CaptureRef
            | Opcode::FunctionRef
            | Opcode::Cons
            | Opcode::List => return None,
            // Jumps, by registers.
            Opcode::JumpAlways
            | Opcode::JumpIfNil
            | Opcode::JumpIfNotNil
            | Opcode::JumpIfCons
            | Opcode::JumpIfNotCons
            | Opcode::JumpIfSupplied
            | Opcode::JumpEq
            | Opcode::JumpNotEq
            | Opcode::JumpEql
            | Opcode::JumpNotEql
            | Opcode::JumpEqlConst
            | Opcode::JumpNotEqlConst
            | Opcode::JumpIfType
            | Opcode::JumpIfNotType
            | Opcode::JumpIfNotInstance
            | Opcode::JumpNumEq
            | Opcode::JumpNotNumEq
            | Opcode::JumpLess
            | Opcode::JumpNotLess
            | Opcode::JumpLessEq
            | Opcode::JumpNotLessEq
            | Opcode::JumpNumEqInt
            | Opcode::JumpNotNumEqInt
            | Opcode::JumpLessInt
            | Opcode::JumpNotLessInt
            | Opcode::JumpGreaterInt
            | Opcode::JumpNotGreaterInt
            | Opcode::Loop
            | Opcode::LoopIfNil
            | Opcode::LoopIfNotNil
            | Opcode::LoopIfCons
            | Opcode::LoopLess
            | Opcode::LoopNotLess
            | Opcode::LoopCount => return None,
            // Bindings, values and control of the running task.
            Opcode::Bind
            | Opcode::Unbind
            | Opcode::BindList
            | Opcode::Return
            | Opcode::ReturnValues
            | Opcode::ReturnAll
            | Opcode::SetValues
            | Opcode::GetValues
            | Opcode::ValuesToList
            | Opcode::ListToValues
            | Opcode::NewTag
            | Opcode::PushCatch
            | Opcode::PushCleanup
            | Opcode::PushHandlerCase
            | Opcode::PushRecovery
            | Opcode::PushFailureCleanup
            | Opcode::PushHandlers
            | Opcode::PushMask
            | Opcode::PushScope
            | Opcode::PopControl
            | Opcode::EnterCleanup
            | Opcode::EndCleanup
            | Opcode::Throw
            | Opcode::Pass
            | Opcode::Point => return None,
            // A callee has a row, or code, of its own.
            Opcode::Call
            | Opcode::CallGlobal
            | Opcode::CallSelf
            | Opcode::CallBuiltin
            | Opcode::Apply
            | Opcode::TailApply
            | Opcode::TailCall
            | Opcode::TailCallGlobal
            | Opcode::TailCallBuiltin => return None,
        };
        Some(Sharing { place, is_change })
    }
}

impl Builtin {
    /// Returns the use that a call makes of a place that other tasks may reach, in one step: a change, by the
    /// builtin's row, or the read that belongs to such a change.
    pub const fn sharing(self) -> Option<Sharing> {
        let is_change = matches!(
            self.info().shares,
            Shares::Pairs
                | Shares::Elements
                | Shares::Slots
                | Shares::Tables
                | Shares::Properties
                | Shares::Variables
                | Shares::Captured
        );
        let place = match self {
            _ if is_change => self.info().shares,
            Builtin::Nth => Shares::Pairs,
            Builtin::Elt | Builtin::Aref | Builtin::Svref | Builtin::RowMajorAref | Builtin::Char => {
                Shares::Elements
            }
            Builtin::SlotOf | Builtin::CachedSlotValue => Shares::Slots,
            Builtin::Gethash => Shares::Tables,
            Builtin::Get | Builtin::SymbolPlist => Shares::Properties,
            Builtin::SymbolValue => Shares::Variables,
            _ => return None,
        };
        Some(Sharing { place, is_change })
    }
}

impl Instr {
    /// Returns the use that the instruction, or the builtin that it calls, makes of a place that other tasks
    /// may reach.
    pub fn sharing(&self) -> Option<Sharing> {
        match self {
            Instr::CallBuiltin { builtin, .. } | Instr::TailCallBuiltin { builtin, .. } => {
                Builtin::from_number(builtin.0)?.sharing()
            }
            instr => instr.opcode().sharing(),
        }
    }
}

// An instruction that is a builtin changes what the builtin changes.
const _: () = {
    let mut row = 0;
    while row < OPCODES.len() {
        if let Some(builtin) = OPCODES[row].builtin {
            let of_builtin = crate::builtin::BUILTINS[builtin as usize].shares;
            let is_same = match OPCODES[row].opcode.sharing() {
                Some(Sharing { place, is_change: true }) => place as u8 == of_builtin as u8,
                _ => matches!(of_builtin, Shares::Nothing),
            };
            assert!(is_same, "an opcode and its builtin change different kinds of places");
        }
        row += 1;
    }
};
