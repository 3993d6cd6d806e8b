//! Values of the ESL virtual machine, and the garbage-collected heap where they live.
//!
//! | module | content |
//! | --- | --- |
//! | [`value`] | [`Value`]: one word that is any datum |
//! | [`heap`] | [`Heap`]: allocation, checked access, incremental collection |
//! | [`stack`] | the register stack of one task |
//! | [`saved_pc`] | the address at which a task goes on |
//! | [`mod@array`] | the elements of arrays, wherever they are kept |
//! | [`number`] | which values are numbers, and which numbers are equal |
//! | [`equality`] | `eq`, `eql`, `equal`, `equalp`, and hashes that agree with them |
//! | [`table`] | hash tables that keep the order of insertion |
//! | [`state`] | the list of all state, and the macro that makes it |
//! | [`store`] | the state of a machine as bytes |
//! | [`fork`] | a fork of the process that writes memory to a file |
//! | [`allocator`] | a setting of the C library's allocator, for commands |
//! | [`realtime`] | settings of the process and its threads for runs that react in time, for commands |
//! | [`character`] | case, classes and names of characters |
//!
//! Guarantees: safe code cannot break memory safety through this crate, however odd the caller, once the two
//! promises of [`Heap::new`] and [`Heap::end_marking`] are kept. Every function with a contract is an `unsafe
//! fn` that states it.
//!
//! Not here: roots, the time at which to collect, and everything that a program does with its data.

pub mod allocator;
pub mod array;
pub mod character;
pub mod equality;
pub mod fork;
pub mod heap;
pub mod number;
pub mod realtime;
pub mod saved_pc;
pub mod stack;
pub mod state;
pub mod store;
pub mod table;
pub mod value;

pub use heap::{AllocError, Heap, HeapConfig, Kind};
pub use value::Value;

/// The example of the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
