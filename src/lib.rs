//! ESL.
