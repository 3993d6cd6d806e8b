//! The ESL virtual machine: the interpreter, tasks and their scheduler, and builtins.

#![deny(unsafe_code)]

pub use esl_heap::{allocator, heap, realtime, value};

pub(crate) use esl_heap::{character, equality, saved_pc, stack, table};

pub mod builtins;
pub mod embed;
pub mod explore;
pub mod observe;
pub mod raise;
pub mod run;
pub mod schedule;
pub mod task;
pub mod vm;

pub use names::{load, records};
pub use report::KeptData;
pub use snapshot::Snapshot;

/// Number of the machine's behaviour, as far as a run can tell: what work costs how many ticks, when slices
/// end, when the collector runs, in which order tasks have their turns. A change of any of that is a new
/// epoch, since records of runs do not replay across it; `conformance/golden/canaries.txt` shows that one is
/// due.
pub const EXECUTION_EPOCH: u32 = 9;

mod compiler;
mod config;
mod cpu;
mod datum;
mod describe;
mod embedder;
mod environment;
mod exchange;
mod fused;
mod interp;
mod lookup;
mod names;
mod number;
mod outside;
mod overhead;
mod report;
mod shape;
mod snapshot;
mod state;
pub mod stored;
mod tier;
mod trust;
mod types;
mod wait;

/// The example of the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
