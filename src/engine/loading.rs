//! Loading files into an engine.

use std::path::Path;

use esl_bytecode::datum::Datum;
use esl_bytecode::span::{SourceId, Span};
use esl_compiler::reader::decode;
use esl_vm::value::Value;

use super::{Engine, Reply, TaskHandle};
use crate::data::Data;
use crate::error::Error;
use crate::module_path::ModulePath;
use crate::program::{self, Program};

fn read(path: &Path) -> Result<Vec<u8>, Error> {
    std::fs::read(path)
        .map_err(|error| Error::Unreadable { file: path.display().to_string(), reason: error.to_string() })
}

fn source_text(bytes: Vec<u8>) -> Result<String, Error> {
    decode(SourceId::default(), bytes).map_err(|fault| Error::DoesNotCompile(vec![*fault]))
}

impl Engine {
    /// Evaluates the forms of a source file one after another, or runs a compiled file (`.eslb`). Returns the
    /// first value of the last form. `require` finds modules beside the file, and in the folders of
    /// [`VARIABLE`](crate::module_path::VARIABLE).
    ///
    /// The embedder reads the file, so the program needs no right for it, and gets the right to nothing: a
    /// module in a folder is read with the right `:read` of the host
    /// ([`ModulePath::with_rights`](crate::module_path::ModulePath::with_rights)).
    ///
    /// ```
    /// use esl::{Engine, Error};
    ///
    /// let mut engine = Engine::new()?;
    /// let file = std::env::temp_dir().join(format!("esl-load-{}.esl", std::process::id()));
    /// std::fs::write(&file, "(defun double (n) (* 2 n))\n(double 21)")?;
    /// assert_eq!(engine.load(&file)?.as_integer(), Some(42));
    /// std::fs::remove_file(&file)?;
    /// assert!(matches!(engine.load(&file), Err(Error::Unreadable { .. })));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Unreadable`]; [`Error::Refused`] for a compiled file; otherwise as [`Engine::eval`].
    pub fn load(&mut self, path: impl AsRef<Path>) -> Result<Data, Error> {
        let path = path.as_ref();
        let bytes = read(path)?;
        program::set_module_path(&mut self.machine, &ModulePath::new([path], &[]))?;
        if path.extension().is_some_and(|extension| extension == "eslb") {
            return self.load_program(&Program::from_bytes(&bytes)?);
        }
        let text = source_text(bytes)?;
        self.eval_as(&text, Some(&path.display().to_string()))
    }

    /// Has a source file evaluated as a task of the runs to come, as [`Engine::begin`] has a text.
    ///
    /// # Errors
    /// [`Error::Unreadable`]; [`Error::DoesNotCompile`] if the file is not text.
    pub fn begin_load(&mut self, path: impl AsRef<Path>) -> Result<Reply<Data>, Error> {
        self.spawn_load(path).map(TaskHandle::into_reply)
    }

    /// Has a source file evaluated as a task of the runs to come, which can be aborted.
    ///
    /// # Errors
    /// As [`Engine::begin_load`].
    pub fn spawn_load(&mut self, path: impl AsRef<Path>) -> Result<TaskHandle, Error> {
        let path = path.as_ref();
        let text = source_text(read(path)?)?;
        program::set_module_path(&mut self.machine, &ModulePath::new([path], &[]))?;
        Ok(self.spawn_as(&text, Some(&path.display().to_string())))
    }

    /// Runs a compiled program: its top-level forms, one after another. Returns the first value of the last.
    ///
    /// ```
    /// use esl::Engine;
    /// use esl::program::{Source, compile};
    ///
    /// let compiled = compile(&[Source::new("double.esl", "(defun double (n) (* 2 n)) (double 4)")]);
    /// let program = compiled.program.expect("it has no errors");
    /// let mut engine = Engine::new()?;
    /// assert_eq!(engine.load_program(&program)?.as_integer(), Some(8));
    /// assert_eq!(engine.eval("(double 21)")?.as_integer(), Some(42));
    /// # Ok::<(), esl::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Refused`]; otherwise as [`Engine::eval`].
    pub fn load_program(&mut self, program: &Program) -> Result<Data, Error> {
        let function = self.machine.library_function("%CALL-IN-ORDER")?;
        let functions = program::load(&mut self.machine, program)?;
        self.machine.pin(functions);
        let result = self.machine.call(function, &[functions], self.ticks);
        self.machine.unpin(functions);
        let value = self.first_value(result)?;
        Data::whole(&self.machine.export(value)?)
    }

    /// Evaluates the forms of a text, which positions in it are reported under a name for, if it has one.
    pub(super) fn eval_as(&mut self, text: &str, name: Option<&str>) -> Result<Data, Error> {
        let value = self.value_of(text, name)?;
        Data::whole(&self.machine.export(value)?)
    }

    /// Evaluates the forms of a text and returns the first value of the last form.
    pub(super) fn value_of(&mut self, text: &str, name: Option<&str>) -> Result<Value, Error> {
        let function = self.machine.library_function("%EVAL-TEXT")?;
        let mut arguments = Vec::new();
        for text in std::iter::once(text).chain(name) {
            let datum = Datum::string(text, Span::default());
            let value = self.machine.import(&datum).map_err(|_| Error::NoMemory("the text"))?;
            self.machine.pin(value);
            arguments.push(value);
        }
        let result = self.machine.call(function, &arguments, self.ticks);
        arguments.into_iter().for_each(|value| self.machine.unpin(value));
        self.first_value(result)
    }
}
