//! The library of ESL programs over the operating system.
//!
//! Work that the system may delay is an operation, done on one event loop in its own thread: only the task
//! that has asked for it waits. The operations are the small part of a module that is in Rust; the rest is in
//! ESL, in `modules/`.
//!
//! Guarantees: each operation names the right that it needs, which is asked for before it begins. An error of
//! a peer, a child or the system is a failure at the call.
//!
//! ```
//! use esl_host::RealHost;
//! use esl_vm::vm::{Config, Vm};
//!
//! let mut machine = Vm::new(Config::default(), Box::new(RealHost::new(Vec::new())))?;
//! esl_world::install_modules(&mut machine);
//! esl_world::install_operations(&mut machine);
//! assert!(esl_world::module("json").is_some_and(|text| text.contains("(defpackage :json")));
//! # Ok::<(), esl_vm::heap::AllocError>(())
//! ```
#![forbid(unsafe_code)]

mod arrived;
mod event_loop;
mod file;
#[cfg(feature = "http")]
mod http;
mod modules;
#[cfg(feature = "mqtt")]
mod mqtt;
mod operation;
mod os;
mod process;
#[cfg(feature = "serial")]
mod serial;
mod slot;
mod socket;
#[cfg(feature = "tls")]
mod tls;
#[cfg(feature = "http")]
mod tls_files;
#[cfg(feature = "watch")]
mod watch;
#[cfg(feature = "http")]
mod ws;

use esl_vm::vm::Vm;

pub use event_loop::{NoEventLoop, spawn};
pub use modules::{add_modules, feature_of_module, feature_with_module, module, module_names};
pub use operation::{Cancelled, ready_soon, spawned, to_its_end};
pub use socket::socket_failure;
#[cfg(feature = "tls")]
pub use tls::{PemFault, TlsError, TlsIdentity, begin_tls};

/// Gives a machine the modules, for `require`, and what they need of the process itself.
pub fn install_modules(machine: &mut Vm) {
    modules::install(machine);
}

/// Gives a machine the operations of the modules, which reach the real world. Without them calls fail with
/// `:NOT-IN-THIS-WORLD`.
pub fn install_operations(machine: &mut Vm) {
    modules::install_operations(machine);
}
