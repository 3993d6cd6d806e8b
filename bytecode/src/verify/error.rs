//! Faults that the verifier finds, and their places.

use std::fmt;

use super::state::VerifiedEntry;
use crate::module::{FunctionNumber, MAX_CAPTURES, MAX_CODE, MAX_CONTROL, MAX_REGISTERS, PoolIdx};

/// Why a module is refused.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct VerifyError {
    /// Where in the module.
    pub place: FaultPlace,
    /// Fault at that place.
    pub fault: Fault,
}

/// A place in a module.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultPlace {
    /// A constant.
    Constant(PoolIdx),
    /// A function as a whole.
    Function(FunctionNumber),
    /// The instruction of a function that begins at this word.
    Instruction(FunctionNumber, u32),
    /// An entry of the list of top-level functions.
    Toplevel(usize),
}

/// A broken rule. The comment of each variant names the rule of the verifier.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// V1: no opcode has this number.
    UnknownOpcode(u8),
    /// V1: the code ends before the aux word.
    MissingAux,
    /// V1: bits that no operand uses are not zero.
    SpareBits,
    /// V1: there is no code, or more than [`MAX_CODE`] words.
    CodeLength(usize),
    /// V1: control runs past the last instruction.
    FallsOff,
    /// V2: no instruction begins at the word that the jump goes to.
    JumpTarget(i64),
    /// V2: the jump goes back, or a loop goes forward.
    JumpDirection(i32),
    /// V3: a register is not below the number of registers.
    Register {
        /// The end of the range that is used: a register, or one more than the last of several.
        end: u32,
        /// Registers of the frame.
        registers: u8,
    },
    /// V3: more registers than [`MAX_REGISTERS`].
    Registers(u8),
    /// V4: an operand is not below the number of constants of the function.
    Constant {
        /// The operand.
        found: u32,
        /// Number of constants.
        count: usize,
    },
    /// V4: a constant is of another kind than the operand says.
    ConstantKind {
        /// The operand.
        found: u32,
        /// The kind that it must have.
        expected: &'static str,
    },
    /// V4, V12, V13: the pool has no such entry, or none before the one that refers to it.
    PoolIndex(PoolIdx),
    /// V4, V12, V13: the module has no such function.
    FunctionNumber(FunctionNumber),
    /// V5: no type code has this number.
    TypeCode(u8),
    /// V5: no builtin has this number.
    Builtin(u32),
    /// V5: the builtin or the function itself does not take so many arguments.
    Arguments(u8),
    /// V5: not a number of values that can be wanted.
    Want(u8),
    /// V5: not a kind of throw.
    ThrowKind(u8),
    /// V6: nothing is known to have been written to the register, or what was is gone.
    Unassigned(u8),
    /// V6: the parameter may have got no argument, which was not tested for.
    MaybeUnsupplied(u8),
    /// V6: the register does not hold an optional or key parameter of which nothing is known yet.
    NotParameter(u8),
    /// V7: the register does not hold a box.
    NotBox(u8),
    /// V7: the register holds a box, but the instruction is not one for boxes.
    Box(u8),
    /// V7: the capture is declared as a box and used as a value, or the other way round.
    CaptureKind(u8),
    /// V8: there is no such capture.
    Capture(u8),
    /// V8: more captures than [`MAX_CAPTURES`].
    CaptureCount(usize),
    /// V8: a capture that comes later is declared as a box.
    LaterBox(u8),
    /// V8: the register does not hold a closure, made by this frame, of a function whose capture comes later.
    Patch(u8),
    /// V9: more than [`MAX_CONTROL`] entries.
    ControlDepth,
    /// V9: fewer entries stand than are popped.
    PopCount(u8),
    /// V9: the innermost entry is another one.
    Entry {
        /// Expected kind.
        expected: &'static str,
        /// Kind found.
        found: Option<VerifiedEntry>,
    },
    /// V9: fewer bindings were made since the innermost entry.
    UnbindCount(u8),
    /// V9: entries still stand.
    StandingEntry(VerifiedEntry),
    /// V9: bindings are still in force.
    StandingBindings(u32),
    /// V9: paths that come together have different entries or numbers of bindings.
    PathsDisagree,
    /// V10: the window lies below that of an entry.
    WindowBelowEntry {
        /// The window.
        window: u8,
        /// The entry's window.
        entry: u8,
    },
    /// V11: the value list was not set, or something has happened since.
    ValueList,
    /// V12: the parameters need more registers than the frame has.
    Parameters(usize),
    /// V12: a key is not named by a symbol.
    KeyName(PoolIdx),
    /// V12: a top-level function takes arguments.
    ToplevelParameters,
    /// V12: a top-level function has captures.
    ToplevelCaptures,
    /// V13: `NIL` or `T` as a symbol like others.
    StandardSymbol,
    /// V13: a ratio that is not in lowest terms, or whose denominator is not above 1, or that is too large to
    /// tell.
    Ratio,
    /// V13: an array of rank 1, or with another number of elements than its dimensions say.
    Array,
    /// V4, V13: a class, or a function with captures, in place of data.
    NotData,
    /// A source place is out of order, or of no source.
    Lines,
    /// V14: the range of a variable is empty, out of order or outside of the code, or its place is not there.
    Variables,
    /// V14: the register that is said to hold a variable may hold something else.
    Variable(u8),
    /// The function has so many joining paths that checking it would take too long.
    TooComplex,
}

impl fmt::Display for VerifyError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.place {
            FaultPlace::Constant(PoolIdx(index)) => write!(f, "constant {index}: ")?,
            FaultPlace::Function(FunctionNumber(number)) => write!(f, "function {number}: ")?,
            FaultPlace::Instruction(FunctionNumber(number), pc) => {
                write!(f, "function {number}, word {pc}: ")?
            }
            FaultPlace::Toplevel(index) => write!(f, "top-level form {index}: ")?,
        }
        self.fault.fmt(f)
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Fault::UnknownOpcode(number) => write!(f, "no opcode has the number {number:#04x}"),
            Fault::MissingAux => f.write_str("the code ends before the aux word"),
            Fault::SpareBits => f.write_str("bits that no operand uses must be zero"),
            Fault::CodeLength(length) => write!(f, "expected 1 to {MAX_CODE} words of code, found {length}"),
            Fault::FallsOff => f.write_str("control runs past the end of the code"),
            Fault::JumpTarget(word) => write!(f, "no instruction begins at the target, word {word}"),
            Fault::JumpDirection(distance) => write!(f, "only loops jump back, found a jump by {distance}"),
            Fault::Register { end, registers } => {
                write!(f, "uses registers up to {end}, but the frame has {registers}")
            }
            Fault::Registers(found) => write!(f, "expected at most {MAX_REGISTERS} registers, found {found}"),
            Fault::Constant { found, count } => {
                write!(f, "expected one of {count} constants, found k{found}")
            }
            Fault::ConstantKind { found, expected } => write!(f, "expected k{found} to be {expected}"),
            Fault::PoolIndex(PoolIdx(index)) => {
                write!(f, "refers to constant {index}, which is not there yet")
            }
            Fault::FunctionNumber(FunctionNumber(number)) => {
                write!(f, "refers to function {number}, which is not there")
            }
            Fault::TypeCode(code) => write!(f, "no type code has the number {code}"),
            Fault::Builtin(number) => write!(f, "no builtin has the number {number}"),
            Fault::Arguments(count) => write!(f, "the called function does not take {count} arguments"),
            Fault::Want(want) => write!(f, "invalid number of wanted values {want}"),
            Fault::ThrowKind(kind) => write!(f, "unknown kind of throw {kind}"),
            Fault::Unassigned(register) => write!(f, "reads r{register}, which holds nothing on some path"),
            Fault::MaybeUnsupplied(register) => {
                write!(f, "reads the parameter r{register} without a test whether it was supplied")
            }
            Fault::NotParameter(register) => {
                write!(f, "r{register} is not an optional parameter, so it cannot be tested")
            }
            Fault::NotBox(register) => write!(f, "expected a box in r{register}"),
            Fault::Box(register) => write!(f, "expected an object in r{register}, found a box"),
            Fault::CaptureKind(index) => {
                write!(f, "capture #{index} is a box here and a value there")
            }
            Fault::Capture(index) => write!(f, "capture #{index} does not exist"),
            Fault::CaptureCount(found) => {
                write!(f, "expected at most {MAX_CAPTURES} captures, found {found}")
            }
            Fault::LaterBox(index) => write!(f, "capture #{index} comes later and cannot be a box"),
            Fault::Patch(register) => {
                write!(
                    f,
                    "expected r{register} to be a closure of this frame with that capture to come later"
                )
            }
            Fault::ControlDepth => write!(f, "more than {MAX_CONTROL} control entries"),
            Fault::PopCount(count) => write!(f, "pops {count} control entries, but not so many stand"),
            Fault::Entry { expected, found: Some(found) } => {
                write!(f, "expected {expected} as the innermost control entry, found {found}")
            }
            Fault::Entry { expected, found: None } => {
                write!(f, "expected {expected} as the innermost control entry, found none")
            }
            Fault::UnbindCount(count) => write!(f, "undoes {count} bindings, but not so many were made"),
            Fault::StandingEntry(kind) => write!(f, "leaves the function while {kind} stands"),
            Fault::StandingBindings(count) => {
                write!(f, "leaves the function, or its cleanup, while {count} bindings are in force")
            }
            Fault::PathsDisagree => {
                f.write_str("paths come together with different control entries or numbers of bindings")
            }
            Fault::WindowBelowEntry { window, entry } => {
                write!(
                    f,
                    "the window r{window} lies below r{entry}, the window of a control entry that stands"
                )
            }
            Fault::ValueList => f.write_str("reads the value list, which was not set just before"),
            Fault::Parameters(found) => {
                write!(f, "the parameters take {found} registers, which the frame lacks")
            }
            Fault::KeyName(PoolIdx(index)) => write!(f, "constant {index} names a key and is not a symbol"),
            Fault::ToplevelParameters => f.write_str("the function takes arguments"),
            Fault::ToplevelCaptures => f.write_str("the function has captures"),
            Fault::StandardSymbol => f.write_str("`NIL` and `T` are constants of their own"),
            Fault::Ratio => f.write_str("a ratio must be in lowest terms with a denominator above 1"),
            Fault::Array => f.write_str("the array's elements do not go with its dimensions"),
            Fault::NotData => f.write_str("expected data, found a class or a function with captures"),
            Fault::Lines => f.write_str("source places must be in order and of a source of the module"),
            Fault::Variables => f.write_str("ranges of variables must be in order and within the function"),
            Fault::Variable(register) => {
                write!(f, "expected the value of a variable in r{register}, which holds nothing on some path")
            }
            Fault::TooComplex => f.write_str("the function is too complex to be checked: divide it"),
        }
    }
}

impl fmt::Display for VerifiedEntry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            VerifiedEntry::Catch => "a catch",
            VerifiedEntry::Cleanup => "a cleanup",
            VerifiedEntry::RunningCleanup => "a running cleanup",
            VerifiedEntry::Recovery => "recovery procedures",
            VerifiedEntry::FailureCleanup => "a cleanup for failures",
            VerifiedEntry::HandlerCase => "a handler-case",
            VerifiedEntry::Handlers => "handlers",
            VerifiedEntry::Mask => "a mask",
            VerifiedEntry::Scope => "a scope",
        })
    }
}

impl std::error::Error for VerifyError {}
