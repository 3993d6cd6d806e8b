//! The contract between the ESL compiler and the ESL virtual machine.
//!
//! Here is what both must agree on and neither may own: the opcode table, the builtin table, modules with
//! their file format, verifier and disassembler, literal data, packages, and the traits by which each calls
//! on the other.
#![forbid(unsafe_code)]

pub mod assembler;
pub mod builtin;
pub mod compile;
pub mod datum;
pub mod diagnostic;
pub mod disasm;
pub mod file;
pub mod integer;
pub mod kind;
pub mod link;
pub mod locals;
pub mod module;
pub mod opcode;
pub mod operand;
pub mod package;
pub mod packed;
pub mod properties;
pub mod sharing;
pub mod signature;
pub mod span;
pub mod symbol;
pub mod verify;
pub mod word;

pub use bytes::Bytes;
pub use integer::Integer;
pub use num_bigint::BigInt;

/// The example of the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
