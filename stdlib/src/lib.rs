//! The ESL library, written in ESL, as a compiled image.
