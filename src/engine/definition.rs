//! Functions of the embedder's for programs, before they are given to a machine.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_host::{CallEffect, HostFunction, VirtualHost};
use esl_vm::vm::{Config, Vm};

use super::{Call, Engine, Failure, Operation};
use crate::data::Data;
use crate::error::Error;

/// Makes the code of a function, for the variables of its lambda list.
type FunctionMaker = Box<dyn FnOnce(Arc<[String]>) -> HostFunction + Send>;

/// A function of the embedder's for programs: [`Engine::define`] and [`Engine::define_operation`] make one
/// and give it to their machine. An engine whose run is durable takes all of its functions at once.
///
/// ```
/// use esl::Engine;
/// use esl::engine::HostDefinition;
///
/// let double = HostDefinition::at_once("DOUBLE", "(n)", "Doubles.", |call| Ok(2 * call.get::<i64>("n")?));
/// let mut engine = Engine::new()?;
/// engine.add_definition(double.idempotent())?;
/// assert_eq!(engine.eval("(double 21)")?.as_integer(), Some(42));
/// # Ok::<(), esl::Error>(())
/// ```
pub struct HostDefinition {
    name: String,
    lambda_list: String,
    documentation: String,
    effect: CallEffect,
    waits: bool,
    make: FunctionMaker,
}

/// Returns the form that defines a function of the host.
pub(super) fn form(name: &str, lambda_list: &str, documentation: &str, waits: bool) -> String {
    let waits = if waits { "T" } else { "NIL" };
    let documentation = documentation.replace('\\', "\\\\").replace('"', "\\\"");
    format!("(esl::%define-host-function {name} {lambda_list} \"{documentation}\" {waits})")
}

impl HostDefinition {
    /// Creates a function that returns at once; the arguments are those of [`Engine::define`].
    pub fn at_once<F, V>(
        name: &str,
        lambda_list: &str,
        documentation: &str,
        mut function: F,
    ) -> HostDefinition
    where
        F: FnMut(Call) -> Result<V, Failure> + Send + 'static,
        V: Into<Data>,
    {
        let make = |names: Arc<[String]>| {
            let mut last = Datum::nil(Span::default());
            HostFunction::AtOnce(Box::new(move |arguments| {
                let result = Failure::of_arguments(arguments).and_then(|arguments| {
                    let call = Call { names: names.clone(), arguments };
                    let result = catch_unwind(AssertUnwindSafe(|| function(call)));
                    result.unwrap_or_else(|panic| Err(Failure::of_panic(&*panic)))
                });
                match result {
                    Ok(value) => Ok(value.into().to_datum_again(&mut last)),
                    Err(failure) => Err(failure.to_host()),
                }
            }))
        };
        HostDefinition::new(name, lambda_list, documentation, false, Box::new(make))
    }

    /// Creates a function whose calls are operations; the arguments are those of
    /// [`Engine::define_operation`].
    pub fn operation<F>(name: &str, lambda_list: &str, documentation: &str, mut begin: F) -> HostDefinition
    where
        F: FnMut(Operation) + Send + 'static,
    {
        let make = |names: Arc<[String]>| {
            HostFunction::Operation(Box::new(move |operation| {
                let Some(operation) = Operation::new(operation, names.clone()) else { return };
                // A panic drops the operation, which is how the program hears of it.
                drop(catch_unwind(AssertUnwindSafe(|| begin(operation))));
            }))
        };
        HostDefinition::new(name, lambda_list, documentation, true, Box::new(make))
    }

    fn new(
        name: &str,
        lambda_list: &str,
        documentation: &str,
        waits: bool,
        make: FunctionMaker,
    ) -> HostDefinition {
        let effect = CallEffect::default();
        let (name, lambda_list) = (name.to_owned(), lambda_list.to_owned());
        HostDefinition { name, lambda_list, documentation: documentation.to_owned(), effect, waits, make }
    }

    /// Notes that a call may be made twice: it only reads, or the second time changes nothing. A durable run
    /// makes a call again that the end of its process has interrupted.
    #[must_use]
    pub fn idempotent(self) -> HostDefinition {
        HostDefinition { effect: CallEffect::Idempotent, ..self }
    }

    /// Returns the name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the form that defines the function in a program.
    pub fn form(&self) -> String {
        form(&self.name, &self.lambda_list, &self.documentation, self.waits)
    }

    /// Returns the variables of the lambda lists, in lower case.
    ///
    /// # Errors
    /// As [`Engine::define`], for the first definition that is wrong.
    pub fn variables(definitions: &[HostDefinition]) -> Result<Vec<Arc<[String]>>, Error> {
        if definitions.is_empty() {
            return Ok(Vec::new());
        }
        let mut engine = Engine::with(Config::default(), Box::new(VirtualHost::new()))?;
        definitions.iter().map(|each| engine.define_form(&each.name, &each.form())).collect()
    }

    /// Gives the code to a machine. `variables` are those of the lambda list.
    pub fn give_to(self, machine: &mut Vm, variables: Arc<[String]>) {
        let function = (self.make)(variables);
        machine.add_function_with(&self.name.to_uppercase(), function, &[], self.effect);
    }
}
