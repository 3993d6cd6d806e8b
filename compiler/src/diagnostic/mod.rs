//! What the compiler says about a source text.
//!
//! [`code`] is the one list of everything that it can say, and makes the diagnostics; [`render`] is the one place that
//! draws them. The type itself, [`Diagnostic`], is in `esl_bytecode`, since the virtual machine passes it on.

pub mod code;
pub mod document;
mod excerpt;
mod json;
pub mod render;
pub mod source;

pub use code::{Code, Stage};
pub use esl_bytecode::diagnostic::{Diagnostic, Label, Severity};
pub use render::{Format, Renderer};
pub use source::Sources;
