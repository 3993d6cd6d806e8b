//! The ESL virtual machine: values, heap, interpreter, tasks.
