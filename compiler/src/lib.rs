//! The ESL compiler: source text to bytecode modules.
