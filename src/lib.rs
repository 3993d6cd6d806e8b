//! ESL, the Execution Support Language, for programs that decide what an agent does next while the world
//! changes.
//!
//! This crate puts the compiler, the virtual machine and the library together. [`Engine`] evaluates ESL for
//! programs in Rust; [`program`] compiles and runs whole programs, as the commands `eslc` and `eslvm` do (the
//! package `esl-commands`). The package is called `esl-lang`.
//!
//! ```
//! use esl::Engine;
//!
//! let mut engine = Engine::new()?;
//! engine.define("READ-SENSOR", "(number)", "The temperature at a sensor, in degrees.", |call| {
//!     let number: i64 = call.get("number")?;
//!     Ok(20.0 + 0.5 * number as f64)
//! })?;
//! engine.eval("(defun warm-p (sensor) (> (read-sensor sensor) 21))")?;
//! let warm = engine.eval("(loop for sensor from 0 to 5 when (warm-p sensor) collect sensor)")?;
//! assert_eq!(warm.to_string(), "(3 4 5)");
//! # Ok::<(), esl::Error>(())
//! ```
#![forbid(unsafe_code)]

/// The examples of the manual's chapter on embedding, compiled and run. One of them needs `serde`.
#[cfg(all(doctest, feature = "serde"))]
#[doc = include_str!("../docs/manual/embedding.md")]
struct Embedding;

pub mod data;
pub mod engine;
pub mod error;
pub mod module_path;
pub mod program;
pub mod size;

pub use data::Data;
pub use engine::Engine;
pub use error::Error;
pub use esl_host as host;
pub use esl_vm::vm::Config;
