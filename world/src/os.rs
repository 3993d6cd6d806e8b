//! The process itself, and the time of day.

use std::time::{SystemTime, UNIX_EPOCH};

use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::span::Span;
use esl_host::{HostFailure, Right};
use esl_vm::embed::{HostFunction, Need};
use esl_vm::vm::Vm;

use crate::data::{CallArguments, integer, nil, text};

/// Gives a machine functions about the process.
pub(crate) fn install(machine: &mut Vm) {
    let mut define =
        |name: &str, function: fn(CallArguments) -> Result<Datum, HostFailure>, needs: &[Need]| {
            let function = move |arguments: &[Datum]| function(CallArguments(arguments.to_vec()));
            machine.add_guarded_function(name, HostFunction::AtOnce(Box::new(function)), needs);
        };
    define("%OS-GETENV", getenv, &[Need { right: Right::Env, argument: 0 }]);
    define("%OS-HOSTNAME", |_| Ok(text(&host_name())), &[]);
    define("%OS-PROCESS-ID", |_| Ok(integer(std::process::id())), &[]);
}

/// Gives a machine the real time of day.
pub(crate) fn install_clock(machine: &mut Vm) {
    let now = |_: &[Datum]| {
        let since = SystemTime::now().duration_since(UNIX_EPOCH);
        let seconds =
            since.map_or_else(|before| -before.duration().as_secs_f64(), |after| after.as_secs_f64());
        Ok(Datum::new(DatumKind::Float(seconds), Span::default()))
    };
    machine.add_host_function("%TIME-NOW", HostFunction::AtOnce(Box::new(now)));
}

fn getenv(arguments: CallArguments) -> Result<Datum, HostFailure> {
    let name = arguments.text(0)?;
    // The system has no variables of other names.
    if name.is_empty() || name.contains(['=', '\0']) {
        return Ok(nil());
    }
    Ok(std::env::var_os(name).map_or_else(nil, |value| text(&value.to_string_lossy())))
}

#[cfg(unix)]
fn host_name() -> String {
    rustix::system::uname().nodename().to_string_lossy().into_owned()
}

#[cfg(not(unix))]
fn host_name() -> String {
    std::env::var("COMPUTERNAME").unwrap_or_default()
}
