//! Requests of an embedder to the program in an engine: listing its definitions, and changing them.

use std::fmt;

use esl_bytecode::datum::Datum;
use esl_vm::value::Value;

use super::Engine;
use crate::data::Data;
use crate::error::Error;
use crate::program;

/// Kind of a definition.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ProgramDefinitionKind {
    /// A function that is not of another kind here.
    Function,
    /// A function whose calls are operations.
    Operation,
    /// A macro.
    Macro,
    /// A property: facts with one value for given arguments.
    Property,
    /// An input.
    Input,
    /// A variable.
    Variable,
    /// A constant.
    Constant,
}

impl ProgramDefinitionKind {
    const ALL: [ProgramDefinitionKind; 7] = [
        ProgramDefinitionKind::Function,
        ProgramDefinitionKind::Operation,
        ProgramDefinitionKind::Macro,
        ProgramDefinitionKind::Property,
        ProgramDefinitionKind::Input,
        ProgramDefinitionKind::Variable,
        ProgramDefinitionKind::Constant,
    ];

    /// Returns the name of the kind, in lower case.
    pub fn name(self) -> &'static str {
        match self {
            ProgramDefinitionKind::Function => "function",
            ProgramDefinitionKind::Operation => "operation",
            ProgramDefinitionKind::Macro => "macro",
            ProgramDefinitionKind::Property => "property",
            ProgramDefinitionKind::Input => "input",
            ProgramDefinitionKind::Variable => "variable",
            ProgramDefinitionKind::Constant => "constant",
        }
    }
}

impl fmt::Display for ProgramDefinitionKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A definition of a program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ProgramDefinition {
    /// Kind of the thing that it defines.
    pub kind: ProgramDefinitionKind,
    /// The name, in upper case.
    pub name: String,
    /// Parameters of a function, macro or property as they are written, in lower case: `metres &key (speed
    /// 0.1)`.
    pub parameters: String,
    /// Documentation; empty without one.
    pub documentation: String,
}

impl ProgramDefinition {
    /// Returns the definition that a row of the library stands for.
    fn of_row(row: &Data) -> Option<ProgramDefinition> {
        let [Data::Keyword(kind), Data::String(name), Data::String(parameters), documentation] =
            row.as_list()?
        else {
            return None;
        };
        Some(ProgramDefinition {
            kind: ProgramDefinitionKind::ALL
                .into_iter()
                .find(|known| known.name().eq_ignore_ascii_case(kind))?,
            name: name.clone(),
            parameters: parameters.clone(),
            documentation: documentation.as_str().unwrap_or_default().to_owned(),
        })
    }
}

impl Engine {
    /// Returns the definitions of the program, sorted by name: of its functions, macros, properties, inputs
    /// and variables, those of the embedder's functions included. Names that begin with `%` are left out.
    ///
    /// ```
    /// use esl::Engine;
    /// use esl::engine::ProgramDefinitionKind;
    ///
    /// let mut engine = Engine::new()?;
    /// engine.eval("(define-input scan)")?;
    /// engine.eval("(defun drive (metres &key (speed 0.1)) \"Drives.\" (/ metres speed))")?;
    /// let definitions = engine.definitions("ESL-USER")?;
    /// assert_eq!(definitions[0].name, "DRIVE");
    /// assert_eq!(definitions[0].parameters, "metres &key (speed 0.1)");
    /// assert_eq!(definitions[0].documentation, "Drives.");
    /// assert_eq!((definitions[1].kind, &*definitions[1].name), (ProgramDefinitionKind::Input, "SCAN"));
    /// # Ok::<(), esl::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Failed`] without a package of this name; [`Error::NoMemory`].
    pub fn definitions(&mut self, package: &str) -> Result<Vec<ProgramDefinition>, Error> {
        let package = Datum::string(&package.to_uppercase(), Default::default());
        let rows = self.call_embedding("%EMBEDDER-DEFINITIONS", &[package])?;
        Ok(rows.as_list().unwrap_or_default().iter().filter_map(ProgramDefinition::of_row).collect())
    }

    /// Makes the definitions of a text, called `name` in messages, in the running program: all at once, or
    /// none of them if any fails. Frames that run keep the code that they have. Returns their number.
    ///
    /// ```
    /// use esl::Engine;
    ///
    /// let mut engine = Engine::new()?;
    /// engine.eval("(defun pace () 1)")?;
    /// assert_eq!(engine.patch("faster", "(defun pace () 2) (defun fresh () 3)")?, 2);
    /// assert_eq!(engine.eval("(list (pace) (fresh))")?.to_string(), "(2 3)");
    /// assert_eq!(engine.undo_patch()?, Some(2));
    /// assert_eq!(engine.eval("(list (pace) (fboundp 'fresh))")?.to_string(), "(1 NIL)");
    /// assert!(engine.patch("wrong", "(print 1)").is_err());
    /// # Ok::<(), esl::Error>(())
    /// ```
    ///
    /// # Errors
    /// As [`Engine::eval`]; [`Error::Failed`] also for a form that is not a definition.
    pub fn patch(&mut self, name: &str, text: &str) -> Result<usize, Error> {
        let arguments = [name, text].map(|text| Datum::string(text, Default::default()));
        let count = self.call_embedding("%EMBEDDER-PATCH", &arguments)?;
        Ok(count.as_integer().and_then(|count| count.try_into().ok()).unwrap_or(0))
    }

    /// Takes the newest patch back: its names mean what they meant before. Returns the number of its
    /// definitions; `None` if there is no patch.
    ///
    /// # Errors
    /// [`Error::NoMemory`].
    pub fn undo_patch(&mut self) -> Result<Option<usize>, Error> {
        let count = self.call_embedding("%SESSION-UNDO", &[])?;
        Ok(count.as_integer().and_then(|count| count.try_into().ok()))
    }

    /// Loads the part of the library for these requests, unless it is there.
    pub(super) fn load_embedding(&mut self) -> Result<(), Error> {
        program::load_operators(&mut self.machine)
    }

    /// Calls a function of the library for embedders. Returns its first value.
    pub(super) fn call_embedding(&mut self, function: &str, arguments: &[Datum]) -> Result<Data, Error> {
        self.load_embedding()?;
        let function = self.machine.library_function(function)?;
        let mut values: Vec<Value> = Vec::new();
        for argument in arguments {
            let value = self.machine.import(argument).map_err(|_| Error::NoMemory("the text"))?;
            self.machine.pin(value);
            values.push(value);
        }
        let result = self.machine.call(function, &values, self.ticks);
        values.into_iter().for_each(|value| self.machine.unpin(value));
        let value = self.first_value(result)?;
        Data::whole(&self.machine.export(value)?)
    }
}
