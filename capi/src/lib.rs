//! The C API of ESL: what `include/esl.h` declares.
//!
//! | module | content |
//! | --- | --- |
//! | `border` | pointers from C, objects for C, panics |
//! | `status`, `failure` | the outcome of a call, and its reason |
//! | `value`, `listed`, `json`, `object` | values of programs; lists of them from C; their texts in JSON; objects of C among them |
//! | `config`, `engine` | engines: limits, rights, evaluation, the loop |
//! | `durable`, `durable_settings` | runs that go on after the end of their process; their settings |
//! | `program` | definitions of a program, patches, watched facts |
//! | `function`, `operation` | functions and operations that C implements |
//! | `handle`, `reply` | other threads, and answers to come |
//! | `observer`, `recording` | watching a run; recording and replaying it |
//! | `wakeup`, `fork` | the file descriptor that a loop waits for; children of the process |
//!
//! Guarantees: no panic leaves a function. Every pointer may be null. Nothing here is known to a program that
//! embeds the language in Rust: everything goes through the crate `esl`.
//!
//! Unsafe code is at the border only: what a function asks of its caller stands under "Safety", and each
//! block relies on that.

#![allow(unsafe_code)]
#![expect(non_camel_case_types, reason = "the names are those of C")]
#![expect(missing_debug_implementations, reason = "C knows the objects as pointers")]

mod border;
pub mod config;
pub mod durable;
pub mod durable_settings;
pub mod engine;
pub mod failure;
mod fork;
pub mod function;
pub mod handle;
pub mod json;
mod listed;
pub mod object;
pub mod observer;
pub mod operation;
pub mod program;
pub mod recording;
pub mod reply;
pub mod status;
pub mod value;
mod wakeup;
