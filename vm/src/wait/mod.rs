//! Events, and the waits of tasks for them.
//!
//! ```text
//! event | name | count | first | last |          task | as an event | state | result | checkpoints |
//!                          |       +-----------------------------+
//! handle | as an event | state | result | progress | number | performer |
//! input | as an event | first kept | last kept | size | capacity | rule | dropped | room |
//! link  | owner | event | previous | next | more | queue | deadline |
//! node  | number, or NIL | node of the maker |
//! ```
//!
//! Guarantees: to look at a count and to begin to wait is one step; a wait that has ended is in no list. A
//! wait is either for one signal, and over with it, or keeps signals: they are queued until it is closed, and
//! none is lost. Not here: handing out signals (`run::signal`), and what ends a wait from outside
//! (`run::pending`).

mod delivery;
pub(crate) mod event;
pub(crate) mod handle;
pub(crate) mod input;
pub(crate) mod lineage;
pub(crate) mod link;

pub(crate) use delivery::{Deliveries, Delivery};
pub(crate) use link::WaitOptions;
