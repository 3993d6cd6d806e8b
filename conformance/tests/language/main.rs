//! Tests of the language beyond single programs, as one test program: random programs, aborts at every place,
//! recordings, explorations, wrong programs with the messages that they deserve.

mod aborts;
mod anything;
mod codes;
mod constants;
mod coverage;
mod differential;
mod explore;
mod failure_model;
mod golden;
mod habits;
mod independence;
mod portions;
mod quiet;
mod recordings;
mod schedules;
