//! Diagnostics: how they are drawn, and the table of codes.
//!
//! `INSTA_UPDATE=always cargo test -p esl-compiler --test diagnostics` regenerates the snapshots,
//! `ESL_BLESS=1` in front of the same command `docs/diagnostics.md`; look at the difference.

mod render;
mod table;
