//! The ESL compiler: source text to bytecode modules.
#![forbid(unsafe_code)]

pub mod core;
