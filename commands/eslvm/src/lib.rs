//! `eslvm`, the virtual machine of ESL as a command: what each subcommand does, and prints.
//!
//! The module `command` takes the arguments. Libraries hold the rest: the machine ([`esl`]),
//! tests and explorations ([`esl_testing`]), recordings ([`esl_replay`]), timelines ([`esl_timeline`]),
//! servers of a run ([`esl_operate`]).
#![forbid(unsafe_code)]

mod command;
pub mod explore;
pub mod fleet;
pub mod mcap;
pub mod operate;
pub mod profile;
pub mod repl;
pub mod replay;
pub mod rights;
pub mod signal;
pub mod testing;

pub use command::main;
