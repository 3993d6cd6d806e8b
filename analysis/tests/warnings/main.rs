//! The warnings of `eslc check` that the analysis gives.

mod orders;
mod types;
