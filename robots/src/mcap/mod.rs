//! Files of MCAP, in which robots record their messages: reading, also what is damaged, and writing.
//!
//! The crate `mcap` parses records and writes files. Its readers end at the first damage, and keep whole
//! files in memory; the readers here do neither.
//!
//! Guarantees: no file makes this module panic, nor takes more memory than a chunk of limited size and what
//! of others overlaps with it in time; damage is told by its place, its reason and what is lost.
//! Not here: what a run is recorded as (`run`), and the clause `(:bag …)` of worlds of scripts, which is ESL.

mod bag;
mod batch;
mod damage;
mod decode;
mod file;
mod index;
mod info;
#[doc(hidden)]
pub mod noise;
mod order;
mod output;
mod reading;
mod record;
mod rows;
mod scan;
mod sink;
#[cfg(test)]
mod tests;
mod writing;

pub use bag::{BagMessages, McapBag};
pub use damage::{Damage, DamageKind};
pub use decode::MessageForm;
pub use file::McapFault;
pub use index::{ChunkSizes, McapChannel, McapSchema, NamedRecord};
pub use info::FileInfo;
pub use order::{McapMessage, McapSelection};
pub use output::{McapOutput, OutputChannel, OutputFault, OutputOptions};
pub(crate) use rows::rows;
