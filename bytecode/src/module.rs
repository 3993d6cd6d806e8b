//! A compiled unit, as the compiler makes it and the virtual machine loads it.
//!
//! Constants form a pool of the module in which entries refer to earlier entries only; each function has its
//! own list of pool indexes, so that linking two modules renumbers those lists and leaves code alone.

use std::sync::Arc;

use num_bigint::BigInt;

use crate::datum::ObjectId;
use crate::symbol::Symbol;

/// Index of a constant in a module's pool.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct PoolIdx(pub u32);

/// Index of a function in a module.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct FunctionNumber(pub u32);

/// A constant.
#[derive(Clone, Debug, PartialEq)]
pub enum Constant {
    /// `NIL`.
    Nil,
    /// `T`.
    True,
    /// A symbol other than these two.
    Symbol(Symbol),
    /// An integer of any size.
    Integer(BigInt),
    /// Numerator and denominator, in lowest terms, the denominator above 1.
    Ratio(BigInt, BigInt),
    /// A double float.
    Float(f64),
    /// A character.
    Character(char),
    /// A literal string.
    String(Arc<str>),
    /// A pair of earlier constants.
    Cons(PoolIdx, PoolIdx),
    /// A simple vector of earlier constants.
    Vector(Vec<PoolIdx>),
    /// An array of a rank other than 1: dimensions, and elements in row-major order.
    Array(Vec<u32>, Vec<PoolIdx>),
    /// A function of this module.
    Function(FunctionNumber),
    /// The structure class of this name, as it is when the constant is first needed.
    Class(Symbol),
    /// An object of the running program; only in modules that stay in memory.
    Object(ObjectId),
}

/// Where a closure takes one of its captures from, at the time it is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CaptureSource {
    /// A register of the frame that makes the closure.
    Register(u8),
    /// A capture of the function that makes the closure.
    Capture(u8),
    /// Nowhere yet: it is `NIL` until `patch-capture` fills it in. For closures that capture each other.
    Later,
}

/// One capture of a function.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Capture {
    /// Where it comes from.
    pub source: CaptureSource,
    /// Whether it is a box, to be used by `capture-box-ref` and `capture-box-set`. Never so for one that
    /// comes later.
    pub boxed: bool,
}

impl Capture {
    /// Returns a capture of a value.
    pub fn value(source: CaptureSource) -> Capture {
        Capture { source, boxed: false }
    }

    /// Returns a capture of a box.
    pub fn boxed(source: CaptureSource) -> Capture {
        Capture { source, boxed: true }
    }
}

/// Parameters of a function. Arguments arrive in registers: first the required ones, then the optional ones,
/// then the list of the rest, then one register for each key. A parameter without an argument holds the
/// *unsupplied* marker, which `jump-if-supplied` tests for.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Parameters {
    /// Number of required parameters.
    pub required: u8,
    /// Number of optional parameters.
    pub optional: u8,
    /// Whether a register receives the list of the remaining arguments.
    pub rest: bool,
    /// `&key`: the names that select the arguments, as pool indexes of symbols. `None` without `&key`.
    pub keys: Option<Vec<PoolIdx>>,
    /// Whether keys other than these are allowed.
    pub allow_other_keys: bool,
}

impl Parameters {
    /// Exactly `required` parameters.
    pub fn exactly(required: u8) -> Parameters {
        Parameters { required, ..Parameters::default() }
    }

    /// Returns whether the function takes just the required arguments.
    pub fn is_exact(&self) -> bool {
        self.optional == 0 && !self.rest && self.keys.is_none()
    }

    /// Number of registers that hold parameters on entry.
    pub fn registers(&self) -> usize {
        let keys = self.keys.as_ref().map_or(0, Vec::len);
        usize::from(self.required) + usize::from(self.optional) + usize::from(self.rest) + keys
    }
}

/// From which place in the source the code from `pc` on comes, up to the next entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LineEntry {
    /// Word of the function's code.
    pub pc: u32,
    /// Index into the module's sources.
    pub source: u32,
    /// Line, from 1.
    pub line: u32,
    /// Column in characters, from 1.
    pub column: u32,
}

/// Where the value of a variable is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum VariablePlace {
    /// In a register of the frame, or in the box there.
    Register(u8),
    /// In a capture of the function, or in the box there.
    Capture(u8),
}

/// The words of a function's code at which a variable has its value in one place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct VariableRange {
    /// Name as it is written, without a package.
    pub name: Arc<str>,
    /// Where the value is.
    pub place: VariablePlace,
    /// The first word.
    pub from: u32,
    /// The word behind the last one.
    pub to: u32,
}

/// A function.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ModuleFunction {
    /// Name: a symbol, or a list such as `(SETF X)` or `(FLET X)`. `None` for an anonymous function.
    pub name: Option<PoolIdx>,
    /// The lambda list as written.
    pub lambda_list: Option<PoolIdx>,
    /// The documentation string.
    pub documentation: Option<PoolIdx>,
    /// Parameters.
    pub parameters: Parameters,
    /// Number of registers of its frame: at least those of its parameters, at most 250.
    pub registers: u8,
    /// Captures, and where they come from.
    pub captures: Vec<Capture>,
    /// Constants: `K[n]` is `constants[n]` of the module's pool.
    pub constants: Vec<PoolIdx>,
    /// Instructions.
    pub code: Vec<u32>,
    /// Source places, by ascending `pc`.
    pub lines: Vec<LineEntry>,
    /// Variables, by ascending `from`: each at the places at which its value can be looked at. One that the
    /// compiler has removed has none.
    pub variables: Vec<VariableRange>,
}

/// The largest number of registers of a frame.
pub const MAX_REGISTERS: u8 = 250;
/// The largest number of words of a function's code.
pub const MAX_CODE: usize = 32_000;
/// The largest number of captures of a function: their operands are bytes.
pub const MAX_CAPTURES: usize = 256;
/// The largest number of entries that a frame has on the control stack at a time.
pub const MAX_CONTROL: usize = 250;

/// A compiled unit.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Module {
    /// Names of the sources that it was compiled from.
    pub sources: Vec<String>,
    /// The constants.
    pub constants: Vec<Constant>,
    /// The functions.
    pub functions: Vec<ModuleFunction>,
    /// Names of the modules that it requires and that are not part of it.
    pub requires: Vec<String>,
    /// The functions of no parameters that run the top-level forms, in this order.
    pub toplevel: Vec<FunctionNumber>,
}

impl Module {
    /// Returns about how many bytes it takes.
    pub fn bytes(&self) -> usize {
        let functions = self.functions.iter().map(|function| {
            size_of::<ModuleFunction>()
                + size_of_val(&*function.code)
                + size_of_val(&*function.lines)
                + size_of_val(&*function.variables)
                + size_of_val(&*function.constants)
        });
        size_of::<Module>() + size_of_val(&*self.constants) + functions.sum::<usize>()
    }
}
