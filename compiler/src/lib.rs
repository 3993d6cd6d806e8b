//! The ESL compiler: source text to bytecode modules.
#![forbid(unsafe_code)]

pub mod core;
pub mod diagnostic;
pub mod lower;
pub mod reader;
mod resolve;
