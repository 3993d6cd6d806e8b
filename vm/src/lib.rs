//! The ESL virtual machine: values, heap, interpreter, tasks.

#![deny(unsafe_code)]

pub use esl_heap::{heap, value};

pub(crate) use esl_heap::{character, equality, saved_pc, stack, table};

pub mod builtins;
pub mod embed;
pub mod explore;
pub mod host;
pub mod observe;
pub mod raise;
pub mod run;
pub mod schedule;
pub mod task;
pub mod vm;

pub use world::load;

mod canary;
mod compiler;
mod config;
mod cpu;
mod database;
mod datum;
mod describe;
mod embedder;
mod environment;
mod exchange;
mod interp;
mod number;
mod outside;
mod report;
mod shape;
mod state;
mod trust;
mod types;
mod wait;
mod world;

/// The example of the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
