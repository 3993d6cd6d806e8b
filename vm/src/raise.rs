//! Failures of builtins and instructions, and other reasons why they give no value.
//!
//! A failure leaves Rust as data: a [`Raised`] waits in the exchange while the builtin returns
//! [`Exit::Raise`]. The interpreter then calls the library function `%raise` at the point of failure, in a
//! frame above the failed instruction; nothing has been unwound. What `%raise` returns takes the place of the
//! operation's result.

use esl_host::Right;
use smallvec::{SmallVec, smallvec};

use crate::heap::{AllocError, Heap};
use crate::names::Names;
use crate::names::load::LoadError;
use crate::value::Value;

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

/// Failure of an operation, before it becomes a condition.
#[derive(Clone, Debug)]
pub enum Raised {
    /// `type-error`: the datum is not of the expected type.
    Type(Value, Expected),
    /// `type-error`: the value of this special variable is not of the expected type.
    Variable(Value, Value, Expected),
    /// `type-error`: start and end that do not bound a part of a sequence of so many elements.
    Bounds(Value, Value, usize),
    /// `division-by-zero`: name of the operation in `COMMON-LISP`, operands.
    DivisionByZero(&'static str, [Value; 2]),
    /// `arithmetic-error` with a text: the result does not exist or is too large.
    Arithmetic(&'static str, String),
    /// `floating-point-overflow`: name of the operation.
    FloatOverflow(&'static str),
    /// `unbound-variable`: the symbol.
    UnboundVariable(Value),
    /// `undefined-function`: the symbol.
    UndefinedFunction(Value),
    /// `program-error` with a text: wrong number of arguments, unknown key and the like.
    Program(String),
    /// `control-error` with a text.
    Control(String),
    /// `parse-error` with a text.
    Parse(String),
    /// `reader-error` with a text: where, what was expected, what to do.
    Reader(String),
    /// `end-of-file` on a stream.
    EndOfFile(Value),
    /// `stream-error` on a stream, with a text.
    Stream(Value, String),
    /// `file-error`: the name of the file, a text.
    File(String, String),
    /// `package-error`: the name of the package, a text.
    Package(String, String),
    /// `simple-error` with a text.
    Simple(String),
    /// A failure of the given cause (a keyword's name) and one argument.
    Cause(&'static str, Value),
    /// `:permission-denied`: the right, its object, and the flag that would grant it, if one would.
    Denied(Right, String, Option<String>),
    /// A failure of the given cause without arguments.
    Failure(&'static str),
    /// The task's stack has reached its limit.
    StackExhausted,
    /// The heap has reached its limit, or an object would be larger than it.
    HeapExhausted,
}

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

impl Raised {
    /// Returns the arguments of `%raise` for this failure: a keyword, and what goes with it.
    ///
    /// # Errors
    /// As for every allocation.
    pub(crate) fn arguments(&self, heap: &mut Heap, names: &mut Names) -> Result<Arguments, AllocError> {
        let (keyword, rest): (&str, Arguments) = match self {
            Raised::Type(datum, expected) => {
                ("TYPE-ERROR", smallvec![*datum, expected.specifier(heap, names)?])
            }
            Raised::Variable(symbol, datum, expected) => {
                ("VARIABLE-TYPE-ERROR", smallvec![*symbol, *datum, expected.specifier(heap, names)?])
            }
            Raised::Bounds(start, end, length) => {
                let least = start.as_index().unwrap_or(0);
                let specifier = format!("(CONS (INTEGER 0 {length}) (INTEGER {least} {length}))");
                let bounds = heap.cons(*start, *end)?;
                ("TYPE-ERROR", smallvec![bounds, read_specifier(heap, names, &specifier)?])
            }
            Raised::DivisionByZero(operation, operands) => {
                let operation = names.intern_cl(heap, operation)?;
                ("DIVISION-BY-ZERO", smallvec![operation, heap.list(operands)?])
            }
            Raised::Arithmetic(operation, text) => {
                let operation = names.intern_cl(heap, operation)?;
                ("ARITHMETIC-ERROR", smallvec![operation, heap.alloc_str(text)?])
            }
            Raised::FloatOverflow(operation) => {
                ("FLOATING-POINT-OVERFLOW", smallvec![names.intern_cl(heap, operation)?])
            }
            Raised::UnboundVariable(symbol) => ("UNBOUND-VARIABLE", smallvec![*symbol]),
            Raised::UndefinedFunction(symbol) => ("UNDEFINED-FUNCTION", smallvec![*symbol]),
            Raised::Program(text) => ("PROGRAM-ERROR", smallvec![heap.alloc_str(text)?]),
            Raised::Control(text) => ("CONTROL-ERROR", smallvec![heap.alloc_str(text)?]),
            Raised::Parse(text) => ("PARSE-ERROR", smallvec![heap.alloc_str(text)?]),
            Raised::Reader(text) => ("READER-ERROR", smallvec![heap.alloc_str(text)?]),
            Raised::Simple(text) => ("SIMPLE-ERROR", smallvec![heap.alloc_str(text)?]),
            Raised::EndOfFile(stream) => ("END-OF-FILE", smallvec![*stream]),
            Raised::Stream(stream, text) => ("STREAM-ERROR", smallvec![*stream, heap.alloc_str(text)?]),
            Raised::File(name, text) => {
                ("FILE-ERROR", smallvec![heap.alloc_str(name)?, heap.alloc_str(text)?])
            }
            Raised::Package(name, text) => {
                ("PACKAGE-ERROR", smallvec![heap.alloc_str(name)?, heap.alloc_str(text)?])
            }
            Raised::Cause(cause, argument) => ("CAUSE", smallvec![names.keyword(heap, cause)?, *argument]),
            Raised::Denied(right, object, flag) => {
                let right = names.keyword(heap, &right.name().to_uppercase())?;
                let object = heap.alloc_str(object)?;
                let flag = match flag {
                    Some(flag) => heap.alloc_str(flag)?,
                    None => Value::NIL,
                };
                ("PERMISSION-DENIED", smallvec![right, object, flag])
            }
            Raised::Failure(cause) => (cause, smallvec![]),
            Raised::StackExhausted => ("STACK-EXHAUSTED", smallvec![]),
            Raised::HeapExhausted => ("HEAP-EXHAUSTED", smallvec![]),
        };
        let mut arguments: Arguments = smallvec![names.keyword(heap, keyword)?];
        arguments.extend(rest);
        Ok(arguments)
    }

    /// Calls `visit` with every value of the failure.
    pub(crate) fn visit(&self, visit: &mut dyn FnMut(Value)) {
        match self {
            Raised::Type(datum, expected) | Raised::Variable(_, datum, expected) => {
                // The variable is known to the machine.
                visit(*datum);
                if let Expected::Specifier(specifier) = expected {
                    visit(*specifier);
                }
            }
            Raised::Bounds(start, end, _) => [*start, *end].into_iter().for_each(visit),
            Raised::DivisionByZero(_, operands) => operands.iter().copied().for_each(visit),
            Raised::UnboundVariable(value)
            | Raised::UndefinedFunction(value)
            | Raised::EndOfFile(value)
            | Raised::Stream(value, _)
            | Raised::Cause(_, value) => visit(*value),
            _ => {}
        }
    }
}

impl From<LoadError> for Raised {
    fn from(error: LoadError) -> Raised {
        Raised::Program(error.to_string())
    }
}
