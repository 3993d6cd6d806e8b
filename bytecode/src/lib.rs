//! The contract between the ESL compiler and the ESL virtual machine.
//!
//! Here is what both must agree on and neither may own: the opcode table, the builtin table, the module format with its
//! verifier and disassembler, literal data, and the traits by which each calls on the other.
#![forbid(unsafe_code)]

pub mod assembler;
pub mod builtin;
pub mod compile;
pub mod datum;
pub mod diagnostic;
pub mod disasm;
pub mod file;
pub mod link;
pub mod module;
pub mod opcode;
pub mod operand;
pub mod package;
pub mod span;
pub mod symbol;
pub mod verify;

pub use num_bigint::BigInt;
