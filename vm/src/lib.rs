//! The ESL virtual machine: values, heap, interpreter, tasks.

#![deny(unsafe_code)]

pub mod heap;
pub mod value;
