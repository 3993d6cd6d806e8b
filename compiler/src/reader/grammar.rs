//! The parser that `build.rs` generates from `grammar.lalrpop`.
#![allow(missing_docs, unreachable_pub, clippy::all)]

lalrpop_util::lalrpop_mod!(generated, "/grammar.rs");

pub(super) use generated::DatumParser;
