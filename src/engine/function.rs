//! Functions of a program that Rust code holds and calls.

use std::fmt;

use esl_bytecode::symbol::USER_PACKAGE;
use esl_host::{FunctionRef, Inbox, Kept};
use esl_vm::run::CallError;
use esl_vm::value::Value;
use esl_vm::vm::Vm;

use super::{Engine, Reply};
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

    /// Returns the name, in any case, if it is called by that.
    fn name(&self) -> Option<&str> {
        None
    }
}

impl Callable for &str {
    fn callee(&self, _inbox: &Inbox) -> FunctionRef {
        FunctionRef::Named(self.to_uppercase())
    }

    fn name(&self) -> Option<&str> {
        Some(self)
    }
}

impl Callable for &Function {
    fn callee(&self, inbox: &Inbox) -> FunctionRef {
        self.0.callee(inbox)
    }
}

/// A call after a portion of it.
#[derive(Debug)]
pub enum BegunCall<T> {
    /// It has ended, with this value.
    Ended(T),
    /// It goes on in the runs to come.
    UnderWay(Reply<T>),
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
        let ticks = self.ticks;
        let value = self.call_with(&function, arguments, |machine, callee, arguments| {
            machine.call_for_value(callee, arguments, ticks)
        });
        self.machine.flush();
        self.value_of_call(value?)
    }

    /// Begins a call of a function of the program, and runs tasks for a portion of ticks, until the call has
    /// ended or all tasks wait. A call that has not ended goes on in the runs to come, as one by
    /// [`Handle::call`](crate::engine::Handle::call); it does not count as a sender for which a program
    /// waits. Output of the program may be left in its buffer: [`Engine::flush`] writes it.
    ///
    /// ```
    /// use esl::Engine;
    /// use esl::engine::BegunCall;
    ///
    /// let mut engine = Engine::new()?;
    /// engine.eval("(defun pick (n) (sleep (* n 0.01)) n)")?;
    /// assert!(matches!(engine.begin_call("pick", [0.into()], 1000)?, BegunCall::Ended(0)));
    /// let BegunCall::UnderWay(reply) = engine.begin_call::<i64>("pick", [1.into()], 1000)? else {
    ///     panic!("it sleeps")
    /// };
    /// engine.run();
    /// assert_eq!(reply.wait(), Ok(1));
    /// # Ok::<(), esl::Error>(())
    /// ```
    ///
    /// # Errors
    /// As [`Engine::call`].
    pub fn begin_call<T: FromData>(
        &mut self,
        function: impl Callable,
        arguments: impl IntoIterator<Item = Data>,
        ticks: u64,
    ) -> Result<BegunCall<T>, Error> {
        let begun = self.call_with(&function, arguments, |machine, callee, arguments| {
            machine.begin_call_for_value(callee, arguments, ticks)
        })?;
        match begun {
            Ok(value) => self.value_of_call(value).map(BegunCall::Ended),
            Err(pending) => Ok(BegunCall::UnderWay(Reply::of_value(pending))),
        }
    }

    /// Returns the value of a call, converted.
    fn value_of_call<T: FromData>(&mut self, value: Value) -> Result<T, Error> {
        let data = match self.machine.export_atom(value) {
            Some(atom) => atom.into(),
            None => Data::whole(&self.machine.export(value)?)?,
        };
        T::from_own_data(data).map_err(|data| Error::NotOfType { value: data.to_string(), expected: T::TYPE })
    }

    /// Has `call` call a function of the program with arguments, which are pinned meanwhile.
    fn call_with<T>(
        &mut self,
        function: &impl Callable,
        arguments: impl IntoIterator<Item = Data>,
        call: impl FnOnce(&mut Vm, Value, &[Value]) -> Result<T, CallError>,
    ) -> Result<T, Error> {
        let callee = match function.name() {
            Some(name) => self.machine.callee_named(name).ok_or(Error::NoMemory("the name of a function"))?,
            None => {
                let callee = function.callee(&self.machine.inbox());
                self.machine.callee(&callee).ok_or_else(|| Error::NotOfType {
                    value: "a function of another engine".into(),
                    expected: "FUNCTION",
                })?
            }
        };
        // The list is kept for the next call.
        let mut values = std::mem::take(&mut self.arguments);
        self.machine.pin(callee);
        let result = self.import_all(arguments, &mut values).and_then(|()| {
            let result = call(&mut self.machine, callee, &values);
            result.map_err(|error| self.error(error))
        });
        values.drain(..).for_each(|value| self.machine.unpin(value));
        self.machine.unpin(callee);
        self.arguments = values;
        result
    }

    /// Adds arguments as values of the program, pinned, to a list.
    fn import_all(
        &mut self,
        arguments: impl IntoIterator<Item = Data>,
        values: &mut Vec<Value>,
    ) -> Result<(), Error> {
        for argument in arguments {
            let atom = argument.as_atom().and_then(|atom| self.machine.import_atom(atom).ok());
            // A collection may be needed, also for a float.
            let import = || self.machine.import_or_collect(&argument.to_datum(USER_PACKAGE));
            let value = atom.or_else(import).ok_or(Error::NoMemory("the arguments of a call"))?;
            self.machine.pin(value);
            values.push(value);
        }
        Ok(())
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
