//! Functions of a program that Rust code holds and calls.

use std::fmt;

use esl_host::{FunctionRef, Inbox, Kept};
use esl_vm::value::Value;

use super::{Engine, handle};
use crate::data::{Data, FromData};
use crate::error::Error;

/// A function of a program, such as a closure, that Rust code holds. It stays alive as long as a clone of it.
///
/// ```
/// use esl::Engine;
///
/// let mut engine = Engine::new()?;
/// let count = engine.function("(let ((n 10)) (lambda (by) (incf n by)))")?;
/// let first: i64 = engine.call(&count, [1.into()])?;
/// let second: i64 = engine.call(&count, [5.into()])?;
/// assert_eq!((first, second), (11, 16));
/// assert!(engine.function("(list 1)").is_err());
/// # Ok::<(), esl::Error>(())
/// ```
#[derive(Clone)]
pub struct Function(Kept);

impl fmt::Debug for Function {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Function")
    }
}

/// A reference to a function of a program: its name, in any case, or a [`Function`].
pub trait Callable {
    /// Returns the function, as the machine with this inbox knows it.
    fn callee(&self, inbox: &Inbox) -> FunctionRef;
}

impl Callable for &str {
    fn callee(&self, _inbox: &Inbox) -> FunctionRef {
        FunctionRef::Named(self.to_uppercase())
    }
}

impl Callable for &Function {
    fn callee(&self, inbox: &Inbox) -> FunctionRef {
        self.0.callee(inbox)
    }
}

impl Engine {
    /// Evaluates a text whose value is a function, and keeps that for Rust code.
    ///
    /// # Errors
    /// As [`Engine::eval`]; [`Error::NotOfType`] if the value is not a function.
    pub fn function(&mut self, text: &str) -> Result<Function, Error> {
        let value = self.value_of(text, None)?;
        if self.machine.is_function(value) {
            Ok(Function(self.machine.keep(value)))
        } else {
            Err(Error::NotOfType { value: self.machine.describe(value), expected: "FUNCTION" })
        }
    }

    /// Calls a function of the program, by its name or as a [`Function`]. Returns its first value, converted.
    ///
    /// # Errors
    /// As [`Engine::eval`]; [`Error::NotOfType`] if the value is of another type, or the function belongs to
    /// another engine.
    pub fn call<T: FromData>(
        &mut self,
        function: impl Callable,
        arguments: impl IntoIterator<Item = Data>,
    ) -> Result<T, Error> {
        let callee = function.callee(&self.machine.inbox());
        let Some(function) = self.machine.callee(&callee) else {
            return Err(Error::NotOfType {
                value: "a function of another engine".into(),
                expected: "FUNCTION",
            });
        };
        let mut values: Vec<Value> = vec![function];
        self.machine.pin(function);
        for datum in handle::data(arguments) {
            let Ok(value) = self.machine.import(&datum) else { break };
            self.machine.pin(value);
            values.push(value);
        }
        let result = self.machine.call(values[0], &values[1..], self.ticks);
        values.into_iter().for_each(|value| self.machine.unpin(value));
        let value = self.first_value(result)?;
        let value = Data::whole(&self.machine.export(value)?)?;
        T::from_data(&value).ok_or_else(|| Error::NotOfType { value: value.to_string(), expected: T::TYPE })
    }
}
