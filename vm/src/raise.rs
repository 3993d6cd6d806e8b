//! What a builtin or an instruction says when it cannot do its work.
//!
//! A failure leaves Rust as data: a [`Raised`] waits in the [`Vm`] while the builtin returns
//! [`Exit::Raise`]. The interpreter then calls the library function `%raise` at the point of failure, in a frame above
//! the failed instruction; nothing has been unwound. What `%raise` returns takes the place of the operation's result.

use smallvec::{SmallVec, smallvec};

use crate::heap::AllocError;
use crate::value::Value;
use crate::vm::Vm;

/// What was expected in place of a datum: a type specifier.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Expected {
    /// The type of this name in `COMMON-LISP`.
    Type(&'static str),
    /// An integer from 0 to below this limit: an index.
    Index(usize),
    /// A type specifier made by the program.
    Specifier(Value),
}

/// A failure of an operation, before it is made into a condition.
#[derive(Clone, Debug)]
pub enum Raised {
    /// `type-error`: the datum is not of the expected type.
    Type(Value, Expected),
    /// `type-error`: the value of this special variable is not of the expected type.
    Variable(Value, Value, Expected),
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
    /// A failure of the given cause without arguments.
    Failure(&'static str),
    /// The task's stack has reached its limit.
    StackExhausted,
    /// The heap has reached its limit, or an object would be larger than it.
    HeapExhausted,
}

/// Why a builtin gives no value. As wide as a value, so that an [`Outcome`] comes back in two registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u64)]
pub enum Exit {
    /// It failed; `Vm::raised` says how.
    Raise,
    /// It gives other than one value: they are in the value list.
    Values,
    /// The work is above its limit: the ESL function in its row of the table takes over with the same arguments. It
    /// has had no effect.
    Slowly,
    /// It asks for a call in its place: `Vm::requested_call` holds the function and the arguments.
    Call,
    /// It needs room: collect, then do it again. It has had no effect.
    Collect,
    /// The task waits; what wakes it delivers the value.
    Park,
    /// It cannot be done yet: it is done again in the task's next turn. It has had no effect.
    Again,
    /// An unwinding of the task has begun.
    Unwind,
}

/// What a builtin gives: one value, or the reason why not.
pub type Outcome = Result<Value, Exit>;

impl From<AllocError> for Exit {
    fn from(error: AllocError) -> Exit {
        match error {
            // What is too large will still be so after a collection; then the heap counts as exhausted.
            AllocError::NeedCollection | AllocError::TooLarge { .. } => Exit::Collect,
        }
    }
}

impl Vm {
    /// The arguments of `%raise` for the failure that is noted: a keyword, and what goes with it.
    ///
    /// # Errors
    /// [`Exit::Collect`] if there is no room for a text.
    pub(crate) fn raised_arguments(&mut self) -> Result<SmallVec<[Value; 16]>, Exit> {
        // It stays noted until it has been put into words, since that may have to be done again.
        let raised = self.exchange.raised.clone().unwrap_or(Raised::Simple("an operation failed".into()));
        let arguments: SmallVec<[Value; 16]> = match raised {
            Raised::Type(datum, expected) => {
                let expected = self.specifier(expected)?;
                smallvec![self.keyword("TYPE-ERROR")?, datum, expected]
            }
            Raised::Variable(symbol, datum, expected) => {
                let expected = self.specifier(expected)?;
                smallvec![self.keyword("VARIABLE-TYPE-ERROR")?, symbol, datum, expected]
            }
            Raised::DivisionByZero(operation, operands) => {
                let operation = self.world.intern_cl(&mut self.heap, operation)?;
                let operands = self.heap.list(&operands)?;
                smallvec![self.keyword("DIVISION-BY-ZERO")?, operation, operands]
            }
            Raised::Arithmetic(operation, text) => {
                let operation = self.world.intern_cl(&mut self.heap, operation)?;
                let text = self.heap.alloc_str(&text)?;
                smallvec![self.keyword("ARITHMETIC-ERROR")?, operation, text]
            }
            Raised::FloatOverflow(operation) => {
                let operation = self.world.intern_cl(&mut self.heap, operation)?;
                smallvec![self.keyword("FLOATING-POINT-OVERFLOW")?, operation]
            }
            Raised::UnboundVariable(symbol) => smallvec![self.keyword("UNBOUND-VARIABLE")?, symbol],
            Raised::UndefinedFunction(symbol) => smallvec![self.keyword("UNDEFINED-FUNCTION")?, symbol],
            Raised::Program(text) => self.raised_text("PROGRAM-ERROR", &text)?,
            Raised::Control(text) => self.raised_text("CONTROL-ERROR", &text)?,
            Raised::Parse(text) => self.raised_text("PARSE-ERROR", &text)?,
            Raised::Reader(text) => self.raised_text("READER-ERROR", &text)?,
            Raised::Simple(text) => self.raised_text("SIMPLE-ERROR", &text)?,
            Raised::EndOfFile(stream) => smallvec![self.keyword("END-OF-FILE")?, stream],
            Raised::Stream(stream, text) => {
                let text = self.heap.alloc_str(&text)?;
                smallvec![self.keyword("STREAM-ERROR")?, stream, text]
            }
            Raised::File(name, text) => self.raised_about("FILE-ERROR", &name, &text)?,
            Raised::Package(name, text) => self.raised_about("PACKAGE-ERROR", &name, &text)?,
            Raised::Cause(cause, argument) => {
                let cause = self.keyword(cause)?;
                smallvec![self.keyword("CAUSE")?, cause, argument]
            }
            Raised::Failure(cause) => smallvec![self.keyword(cause)?],
            Raised::StackExhausted => smallvec![self.keyword("STACK-EXHAUSTED")?],
            Raised::HeapExhausted => smallvec![self.keyword("HEAP-EXHAUSTED")?],
        };
        self.exchange.raised = None;
        Ok(arguments)
    }

    /// The type specifier of what was expected.
    fn specifier(&mut self, expected: Expected) -> Outcome {
        Ok(match expected {
            Expected::Type(name) => self.world.intern_cl(&mut self.heap, name)?,
            Expected::Index(limit) => {
                // (INTEGER 0 (limit))
                let limit = self.heap.list(&[Value::index(limit)])?;
                let integer = self.world.intern_cl(&mut self.heap, "INTEGER")?;
                self.heap.list(&[integer, Value::small(0), limit])?
            }
            Expected::Specifier(specifier) => specifier,
        })
    }

    fn raised_text(&mut self, kind: &str, text: &str) -> Result<SmallVec<[Value; 16]>, Exit> {
        let text = self.heap.alloc_str(text)?;
        Ok(smallvec![self.keyword(kind)?, text])
    }

    fn raised_about(&mut self, kind: &str, name: &str, text: &str) -> Result<SmallVec<[Value; 16]>, Exit> {
        let name = self.heap.alloc_str(name)?;
        let text = self.heap.alloc_str(text)?;
        Ok(smallvec![self.keyword(kind)?, name, text])
    }

    /// The keyword of this name.
    fn keyword(&mut self, name: &str) -> Result<Value, Exit> {
        Ok(self.world.keyword(&mut self.heap, name)?)
    }

    /// The arguments of `%raise` as a text, for when there is no library that could say it better.
    pub(crate) fn describe_failure(&self, arguments: &[Value]) -> String {
        let words: Vec<String> = arguments.iter().map(|&argument| self.describe(argument)).collect();
        words.join(" ")
    }
}
