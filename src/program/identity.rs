//! The identity of an execution environment: a run repeats exactly if the machine's behaviour, its tables and
//! the library are the same.

use std::fmt;

use esl_bytecode::file::{BUILTIN_TABLE, OPCODE_TABLE};

pub use esl_vm::EXECUTION_EPOCH;

/// Identity of all that decides a run beside the program, its seed and what comes from outside. A record of a
/// run is of use only to an executable of the same identity.
///
/// ```
/// use esl::program::ExecutionIdentity;
///
/// let identity = ExecutionIdentity::current();
/// assert!(identity.to_string().starts_with(&format!("{}-", identity.epoch)));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ExecutionIdentity {
    /// Epoch of the machine's behaviour: what its tables do not say, such as the ticks that builtins charge.
    pub epoch: u32,
    /// Fingerprint of the opcode table.
    pub opcodes: u64,
    /// Fingerprint of the builtin table.
    pub builtins: u64,
    /// Checksum of the compiled library.
    pub library: u32,
}

impl ExecutionIdentity {
    /// Returns the identity of this executable.
    pub fn current() -> ExecutionIdentity {
        ExecutionIdentity {
            epoch: EXECUTION_EPOCH,
            opcodes: OPCODE_TABLE,
            builtins: BUILTIN_TABLE,
            library: esl_stdlib::checksum(),
        }
    }
}

impl fmt::Display for ExecutionIdentity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}-{:016x}-{:016x}-{:08x}", self.epoch, self.opcodes, self.builtins, self.library)
    }
}
