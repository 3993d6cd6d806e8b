//! Benchmarks of ESL.
