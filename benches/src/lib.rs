//! Benchmarks of ESL. The library is empty; the benches are in `benches/`, the programs in `programs/`.
#![forbid(unsafe_code)]
