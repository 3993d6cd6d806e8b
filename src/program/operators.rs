//! The part of the library that serves operators.

use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_host::CallEffect;
use esl_vm::embed::HostFunction;
use esl_vm::vm::Vm;

use crate::error::Error;

/// Name of the function by which the library tells operators something at once.
pub const TELL_OPERATOR: &str = "%TELL-OPERATOR";
/// Name of the operation by which the library tells operators something when there is room for it.
pub const WRITE_OPERATOR: &str = "%WRITE-OPERATOR";

/// Loads the functions of the library that serve operators into a machine, unless it has them. Before the
/// program begins, since a replay loads them there. Operators hear of nothing until a server
/// replaces [`TELL_OPERATOR`] and [`WRITE_OPERATOR`].
///
/// # Errors
/// [`Error::NoMemory`].
pub fn load_operators(machine: &mut Vm) -> Result<(), Error> {
    if has_operators(machine) {
        return Ok(());
    }
    let failed = |_| Error::NoMemory("the part of the library for operators");
    esl_stdlib::load_operators(machine).map_err(failed)?;
    let tell = HostFunction::AtOnce(Box::new(|_| Ok(Datum::nil(Span::default()))));
    machine.add_function_with(TELL_OPERATOR, tell, &[], CallEffect::Local);
    let write = HostFunction::Operation(Box::new(|operation| operation.complete(Vec::new())));
    machine.add_function_with(WRITE_OPERATOR, write, &[], CallEffect::Local);
    Ok(())
}

/// Returns whether a machine has the functions of the library that serve operators.
pub fn has_operators(machine: &Vm) -> bool {
    esl_stdlib::has_operators(machine)
}
