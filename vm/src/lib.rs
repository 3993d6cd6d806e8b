//! The ESL virtual machine: values, heap, interpreter, tasks.

#![deny(unsafe_code)]

pub use esl_heap::{heap, value};

pub(crate) use esl_heap::{character, stack};

pub mod builtins;
pub mod embed;
pub mod explore;
pub mod figures;
pub mod host;
pub mod load;
pub mod observe;
pub mod raise;
pub mod run;
pub mod schedule;
pub mod task;
pub mod vm;

mod binding;
mod clock;
mod control;
mod database;
mod datum;
mod describe;
mod environment;
mod equality;
mod finish;
mod interp;
mod limit;
mod number;
mod report;
mod shape;
mod spawn;
mod table;
mod timer;
mod trace;
mod wait;
mod world;
