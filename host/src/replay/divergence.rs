//! The place at which a replay is no longer the recorded run.

use std::fmt;

use crate::RunCheck;

/// The place and the kind of a difference between a replay and the recorded run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Divergence {
    /// Number of the record, from 1 on.
    pub record: usize,
    /// The question of the program.
    pub asked: String,
    /// The recorded question.
    pub recorded: String,
    /// The last check in which both were equal.
    pub equal: Option<RunCheck>,
}

impl fmt::Display for Divergence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Divergence { record, asked, recorded, equal } = self;
        write!(
            f,
            "the replay has diverged at record {record}: the program asks {asked}; recorded is {recorded}"
        )?;
        match equal {
            Some(check) => write!(f, "; the last equal check is at tick {}", check.ticks),
            None => write!(f, "; no equal check precedes it"),
        }
    }
}
