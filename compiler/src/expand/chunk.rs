//! Chunks: pieces of the program that are lowered and loaded by themselves.

use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;

use crate::core::Core;

/// Purpose of a chunk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Purpose {
    /// Whether it belongs to the module that is being compiled.
    pub emit: bool,
    /// Whether it is to be loaded now.
    pub load: bool,
    /// Whether its value, a function, is wanted.
    pub keep: bool,
}

/// A finished piece of the program.
#[derive(Debug)]
pub struct Chunk {
    /// Code of the chunk.
    pub core: Core,
    /// Purpose of the chunk.
    pub purpose: Purpose,
}

/// A chunk under construction.
#[derive(Debug)]
pub(super) struct OpenChunk {
    pub(super) core: Core,
    /// Number of errors when it was begun.
    pub(super) errors: usize,
    pub(super) span: Span,
    pub(super) purpose: Purpose,
    /// Macros that it defines.
    pub(super) macros: Vec<Symbol>,
}
