//! The contract between the ESL compiler and virtual machine: opcodes, builtins, modules, verifier.
