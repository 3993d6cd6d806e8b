//! The ESL virtual machine: values, heap, interpreter, tasks.

#![deny(unsafe_code)]

pub mod heap;
pub mod host;
pub mod value;

mod load;
mod shape;
mod stub;
mod world;
