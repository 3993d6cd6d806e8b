//! Failures of builtins and instructions, and other reasons why they give no value.
//!
//! A failure leaves Rust as data: a [`Raised`] waits in the exchange while the builtin returns
//! [`Exit::Raise`]. The interpreter then calls the library function `%raise` at the point of failure, in a
//! frame above the failed instruction; nothing has been unwound. The values of `%raise` take the place of the
//! operation's result.

use esl_bytecode::builtin::{BuiltinInfo, Visibility};
use esl_bytecode::symbol::Symbol;
use esl_host::Right;
use esl_number::Int;
use smallvec::{SmallVec, smallvec};

use crate::heap::{AllocError, Heap};
use crate::names::Names;
use crate::names::load::LoadError;
use crate::value::Value;

/// A limit of indexes that no object reaches.
const INDEX_LIMIT: usize = Value::FIXNUM_MAX as usize;

/// Arguments of a call.
pub(crate) type Arguments = SmallVec<[Value; 16]>;

/// Type that was expected of a datum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Expected {
    /// The type of this name in `COMMON-LISP`.
    Type(&'static str),
    /// An integer from 0 to below this limit: an index.
    Index(usize),
    /// A type specifier made by the program.
    Specifier(Value),
    /// The type specifier written here with parentheses, names of `COMMON-LISP` and integers.
    Written(&'static str),
}

/// An operation of arithmetic that failed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ArithmeticCall {
    /// Name in `COMMON-LISP`.
    name: &'static str,
    /// Operands, if they are known.
    operands: Vec<Value>,
    /// Whether these are the name and the arguments of the program's call, not those of a step of it.
    is_call: bool,
}

impl ArithmeticCall {
    /// Most operands that a condition lists. Of a call with more of them, the step that failed is named.
    const MOST_OPERANDS: usize = 64;

    /// A step of an operation: its name, and the operands that are known.
    pub(crate) fn step(name: &'static str, operands: &[Value]) -> ArithmeticCall {
        ArithmeticCall { name, operands: operands.to_vec(), is_call: false }
    }
}

macro_rules! define_raised {
    (($heap:ident, $names:ident) $( $(#[doc = $doc:literal])* $name:ident $( ( $( $part:ident : $ty:ty ),* ) )?
        => $home:ident $class:literal { $( $slot:literal : $value:expr ),* } ; )*) => {
        /// Failure of an operation, before it becomes a condition.
        #[derive(Clone, Debug)]
        pub enum Raised {
            $( $(#[doc = $doc])* $name $( ( $( $ty ),* ) )?, )*
        }

        /// The conditions that failures become: the classes, and their slots in their order. The build of the
        /// library compares them with its definitions.
        pub const CONDITIONS: &[(&str, &[&str])] = &[$( ($class, &[$( $slot ),*]) ),*];

        impl Raised {
            /// Returns the arguments of `%raise` for this failure: the name of the class of its condition,
            /// and the values of the slots.
            ///
            /// # Errors
            /// As for every allocation.
            pub(crate) fn arguments(
                &self,
                $heap: &mut Heap,
                $names: &mut Names,
            ) -> Result<Arguments, AllocError> {
                match self {
                    $( Raised::$name $( ( $( $part ),* ) )? => {
                        let class = $names.intern($heap, &Symbol::$home($class))?;
                        Ok(smallvec![class, $( $value ),*])
                    } )*
                }
            }

            /// Calls `visit` with every value of the failure.
            pub(crate) fn visit(&self, visit: &mut dyn FnMut(Value)) {
                match self {
                    $( Raised::$name $( ( $( $part ),* ) )? => { $( $( $part.visit(visit); )* )? } )*
                }
            }
        }
    };
}

// Each row has the parts of a failure, and the condition that it becomes.
define_raised! {
    (heap, names)
    /// The datum is not of the expected type.
    Type(datum: Value, expected: Expected)
        => cl "TYPE-ERROR" {
            "DATUM": *datum, "EXPECTED-TYPE": expected.without(heap, *datum).specifier(heap, names)?
        };
    /// The value of this special variable is not of the expected type.
    Variable(symbol: Value, datum: Value, expected: Expected)
        => esl "DETAILED-TYPE-ERROR" {
            "FORMAT-CONTROL": heap.alloc_str("The value of ~s, ~s, is not of type ~s.")?,
            "FORMAT-ARGUMENTS": {
                let expected = expected.specifier(heap, names)?;
                heap.list(&[*symbol, *datum, expected])?
            },
            "DATUM": *datum,
            "EXPECTED-TYPE": expected.specifier(heap, names)?
        };
    /// Start and end do not bound a part of a sequence of so many elements.
    Bounds(start: Value, end: Value, length: usize)
        => cl "TYPE-ERROR" {
            "DATUM": heap.cons(*start, *end)?,
            "EXPECTED-TYPE": {
                let least = start.as_index().unwrap_or(0);
                let text = format!("(CONS (INTEGER 0 {length}) (INTEGER {least} {length}))");
                read_specifier(heap, names, &text)?
            }
        };
    /// The operation divides by zero.
    DivisionByZero(operation: ArithmeticCall)
        => cl "DIVISION-BY-ZERO" {
            "OPERATION": names.intern_cl(heap, operation.name)?,
            "OPERANDS": heap.list(&operation.operands)?,
            "TEXT": Value::NIL
        };
    /// The result of the operation does not exist or is too large, as a text says.
    Arithmetic(operation: ArithmeticCall, text: String)
        => cl "ARITHMETIC-ERROR" {
            "OPERATION": names.intern_cl(heap, operation.name)?,
            "OPERANDS": heap.list(&operation.operands)?,
            "TEXT": heap.alloc_str(text)?
        };
    /// The result of the operation is too large for a float.
    FloatOverflow(operation: ArithmeticCall)
        => cl "FLOATING-POINT-OVERFLOW" {
            "OPERATION": names.intern_cl(heap, operation.name)?,
            "OPERANDS": heap.list(&operation.operands)?,
            "TEXT": Value::NIL
        };
    /// The variable with this name has no value.
    UnboundVariable(symbol: Value) => cl "UNBOUND-VARIABLE" { "NAME": *symbol };
    /// The function with this name is not defined. The library finds the name if the symbol holds a function
    /// `(setf name)`.
    UndefinedFunction(symbol: Value) => cl "UNDEFINED-FUNCTION" { "NAME": *symbol };
    /// A call has the wrong number of arguments, an unknown key and the like, as a text says.
    Program(text: String) => cl "PROGRAM-ERROR" { "TEXT": heap.alloc_str(text)? };
    /// A transfer of control fails, as a text says.
    Control(text: String) => cl "CONTROL-ERROR" { "TEXT": heap.alloc_str(text)? };
    /// A text cannot be parsed, as another says.
    Parse(text: String) => cl "PARSE-ERROR" { "TEXT": heap.alloc_str(text)? };
    /// A text cannot be read, as another says: where, what was expected, what to do. The library adds the
    /// stream.
    Reader(text: String) => cl "READER-ERROR" { "TEXT": heap.alloc_str(text)?, "STREAM": Value::NIL };
    /// The stream has ended.
    EndOfFile(stream: Value) => cl "END-OF-FILE" { "STREAM": *stream, "TEXT": Value::NIL };
    /// An operation on the stream fails, as a text says.
    Stream(stream: Value, text: String)
        => cl "STREAM-ERROR" { "STREAM": *stream, "TEXT": heap.alloc_str(text)? };
    /// An operation on the file with this name fails, as a text says.
    File(name: String, text: String)
        => cl "FILE-ERROR" { "PATHNAME": heap.alloc_str(name)?, "TEXT": heap.alloc_str(text)? };
    /// An operation on the package with this name fails, as a text says.
    Package(name: String, text: String)
        => cl "PACKAGE-ERROR" { "PACKAGE": heap.alloc_str(name)?, "TEXT": heap.alloc_str(text)? };
    /// An operation fails, as a text says.
    Simple(text: String)
        => cl "SIMPLE-ERROR" {
            "FORMAT-CONTROL": heap.alloc_str("~a")?,
            "FORMAT-ARGUMENTS": { let text = heap.alloc_str(&sentence(text))?; heap.list(&[text])? }
        };
    /// A failure of the given cause, the name of a keyword, and one argument.
    Cause(cause: &'static str, argument: Value)
        => esl "FAILURE" { "CAUSE": names.keyword(heap, cause)?, "ARGUMENTS": heap.list(&[*argument])? };
    /// A failure of the given cause without arguments.
    Failure(cause: &'static str)
        => esl "FAILURE" { "CAUSE": names.keyword(heap, cause)?, "ARGUMENTS": Value::NIL };
    /// The right to the object is missing. The text is the flag that would grant it, if one would.
    Denied(right: Right, object: String, flag: Option<String>)
        => esl "FAILURE" {
            "CAUSE": names.keyword(heap, "PERMISSION-DENIED")?,
            "ARGUMENTS": {
                let right = names.keyword(heap, &right.name().to_uppercase())?;
                let object = heap.alloc_str(object)?;
                let flag = flag.as_ref().map_or(Ok(Value::NIL), |flag| heap.alloc_str(flag))?;
                heap.list(&[right, object, flag])?
            }
        };
    /// The task's stack has reached its limit.
    StackExhausted => esl "STACK-EXHAUSTED" {};
    /// The heap has reached its limit, or an object would be larger than it.
    HeapExhausted => esl "HEAP-EXHAUSTED" {};
}

impl Raised {
    /// Notes which call of a builtin has failed, unless that is known. A failure of arithmetic then names it
    /// and its arguments in the place of a step of its work.
    pub(crate) fn note_call(&mut self, builtin: &BuiltinInfo, arguments: &[Value]) {
        let (Raised::DivisionByZero(operation)
        | Raised::Arithmetic(operation, _)
        | Raised::FloatOverflow(operation)) = self
        else {
            return;
        };
        let is_named =
            builtin.visibility == Visibility::Cl && arguments.len() <= ArithmeticCall::MOST_OPERANDS;
        if is_named && !operation.is_call {
            *operation = ArithmeticCall { name: builtin.name, operands: arguments.to_vec(), is_call: true };
        }
    }
}

/// Returns a message of one line as a sentence, with a capital and a full stop.
fn sentence(text: &str) -> String {
    let mut rest = text.chars();
    let first = rest.next().map(char::to_uppercase).into_iter().flatten();
    first.chain(rest).chain(['.']).collect()
}

/// A part of a failure, as the collector sees it.
trait RaisedPart {
    /// Calls `visit` with every value in it.
    fn visit(&self, _visit: &mut dyn FnMut(Value)) {}
}

impl RaisedPart for Value {
    fn visit(&self, visit: &mut dyn FnMut(Value)) {
        visit(*self);
    }
}

impl RaisedPart for ArithmeticCall {
    fn visit(&self, visit: &mut dyn FnMut(Value)) {
        self.operands.iter().copied().for_each(visit);
    }
}

impl RaisedPart for Expected {
    fn visit(&self, visit: &mut dyn FnMut(Value)) {
        if let Expected::Specifier(specifier) = self {
            visit(*specifier);
        }
    }
}

impl RaisedPart for &'static str {}
impl RaisedPart for String {}
impl RaisedPart for Option<String> {}
impl RaisedPart for usize {}
impl RaisedPart for Right {}

/// Reason why a builtin returns no value. As wide as a value, so that an [`Outcome`] comes back in two
/// registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u64)]
pub enum Exit {
    /// It failed; the exchange holds the [`Raised`].
    Raise,
    /// It returns other than one value: they are in the value list.
    Values,
    /// The work is above its limit: the ESL function in its row of the table takes over with the same
    /// arguments. It has had no effect.
    Slowly,
    /// It asks for a call in its place: the exchange holds the function and the arguments.
    Call,
    /// It needs room: collect, then do it again. It has had no effect.
    Collect,
    /// The task waits; the builtin is done again when it goes on.
    Park,
    /// It cannot be done yet: it is done again in the task's next turn. It has had no effect.
    Again,
    /// An unwinding of the task has begun.
    Unwind,
}

/// Result of a builtin: one value, or the reason why there is none.
pub type Outcome = Result<Value, Exit>;

impl From<AllocError> for Exit {
    fn from(error: AllocError) -> Exit {
        match error {
            // An object that is too large will still be so after a collection; then the heap counts as
            // exhausted.
            AllocError::NeedCollection | AllocError::TooLarge { .. } => Exit::Collect,
        }
    }
}

impl Expected {
    /// Returns the type that was expected where `datum` is not of it: an integer that is not negative but too
    /// large for a fixnum was expected to be one.
    fn without(self, heap: &Heap, datum: Value) -> Expected {
        let is_large = || !datum.is_fixnum() && Int::of(heap, datum).is_some_and(|n| !n.is_negative());
        match self {
            Expected::Type("UNSIGNED-BYTE") if is_large() => Expected::Index(INDEX_LIMIT),
            _ => self,
        }
    }

    /// Returns the type specifier.
    fn specifier(self, heap: &mut Heap, names: &mut Names) -> Result<Value, AllocError> {
        match self {
            Expected::Type(name) => names.intern_cl(heap, name),
            Expected::Index(limit) => {
                // (INTEGER 0 (limit))
                let limit = heap.list(&[Value::index(limit)])?;
                let integer = names.intern_cl(heap, "INTEGER")?;
                heap.list(&[integer, Value::small(0), limit])
            }
            Expected::Specifier(specifier) => Ok(specifier),
            Expected::Written(text) => read_specifier(heap, names, text),
        }
    }
}

/// Returns the type specifier that `text` writes with parentheses, names of `COMMON-LISP` and integers.
fn read_specifier(heap: &mut Heap, names: &mut Names, text: &str) -> Result<Value, AllocError> {
    let spaced = text.replace('(', " ( ").replace(')', " ) ");
    let mut lists: Vec<Vec<Value>> = vec![Vec::new()];
    for word in spaced.split_whitespace() {
        let item = match word {
            "(" => {
                lists.push(Vec::new());
                continue;
            }
            ")" => {
                let items = lists.pop().unwrap_or_default();
                heap.list(&items)?
            }
            word => match word.parse().ok().and_then(Value::fixnum) {
                Some(n) => n,
                None => names.intern_cl(heap, word)?,
            },
        };
        match lists.last_mut() {
            Some(list) => list.push(item),
            None => lists.push(vec![item]),
        }
    }
    Ok(lists.pop().and_then(|items| items.first().copied()).unwrap_or(Value::T))
}

impl From<LoadError> for Raised {
    fn from(error: LoadError) -> Raised {
        Raised::Program(error.to_string())
    }
}
