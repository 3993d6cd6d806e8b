//! Diagnostics: the compiler's findings about a source text.
//!
//! [`code`] is the only list of findings, and makes the diagnostics; [`render`] is the only place that draws
//! them. The type [`Diagnostic`] itself is in `esl_bytecode`, since the virtual machine passes diagnostics
//! on.

pub mod code;
pub mod document;
mod excerpt;
mod json;
pub mod render;
pub mod source;

pub use code::{DiagnosticCode, Stage};
pub use esl_bytecode::diagnostic::{Diagnostic, Label, Severity};
pub use render::{Format, Renderer};
pub use source::Sources;
