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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::Ending;

    #[test]
    fn symbols_and_objects_survive_the_way_or_say_that_they_do_not() {
        let mut engine = Engine::new().expect("there is memory");
        let setup = "(progn (defpackage \"FLEET\" (:use \"COMMON-LISP\")) (defun is-it (a b) (eq a b)))";
        engine.eval(setup).expect("it evaluates");
        for (text, name) in [
            ("'valve", "VALVE"),
            ("'car", "CAR"),
            ("'assert", "ASSERT"),
            ("'fleet::drive", "FLEET::DRIVE"),
            ("'fleet::cdr", "CDR"),
        ] {
            let symbol = engine.eval(text).expect("it evaluates");
            assert_eq!(symbol, Data::Symbol(name.into()));
            let test = engine.function(&format!("(lambda (symbol) (eq symbol {text}))")).expect("a function");
            assert_eq!(engine.call(&test, [symbol]), Ok(true), "{text}");
        }
        let objects = engine.eval("(list (make-hash-table :test 'equalp) #'car)").expect("it evaluates");
        let objects = objects.as_list().expect("it is a list");
        let is_of_program = |data: &Data| matches!(data, Data::Opaque(opaque) if opaque.is_of_program());
        assert!(objects.iter().all(is_of_program), "{objects:?}");
        assert!(objects[1].to_string().contains("CAR"), "{objects:?}");
        assert_ne!(objects[0], objects[0].to_string().as_str().into(), "it is not a text");
    }

    #[test]
    fn an_exit_ends_the_run_and_not_the_engine() {
        let mut engine = Engine::new().expect("there is memory");
        engine.eval("(defun leave () (spawn (exit 4)) (sleep 5))").expect("it evaluates");
        assert_eq!(engine.call::<Data>("leave", []), Err(Error::Exited(4)));
        assert_eq!(engine.eval("(+ 1 2)"), Ok(Data::Integer(3)));
        assert_eq!(engine.run(), Ending::Done, "the status belongs to the run before");
        let (left, beside) = (engine.begin("(exit 5)"), engine.begin("(sleep 5)"));
        assert_eq!(engine.run(), Ending::Exited(5));
        assert_eq!((left.wait(), beside.wait()), (Err(Error::Exited(5)), Err(Error::Exited(5))));
        assert_eq!(engine.eval("(abort-task (current-task))"), Err(Error::Aborted));
    }
}
