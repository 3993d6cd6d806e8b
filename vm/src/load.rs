//! From compiled modules to functions in the heap.

/// Says that a module has passed the verifier, or is part of this program.
pub(crate) struct Verified(());
