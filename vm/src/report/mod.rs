//! What is said of tasks and values: to observers, in traces, in reports, and in messages.

mod describe;
mod figures;
mod observe;
mod tasks;
mod trace;

pub(crate) use trace::Happening;
