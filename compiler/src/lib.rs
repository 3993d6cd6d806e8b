//! The ESL compiler: source text to bytecode modules.
#![forbid(unsafe_code)]

pub mod core;
pub mod cover;
pub mod diagnostic;
pub mod expand;
pub mod habit;
pub mod lower;
pub mod reader;
mod resolve;
pub mod session;
pub mod similar;

pub use resolve::{children, lambda_nodes};

/// The example of the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
