//! Conformance programs of ESL and their runner.
