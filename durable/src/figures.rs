//! Figures of the journal of a run.

/// Figures of a journal that is being written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LogFigures {
    /// Bytes of the file.
    pub bytes: u64,
    /// Writes to it by this process.
    pub writes: u64,
    /// Syncs of it by this process.
    pub syncs: u64,
    /// Effects of this process.
    pub effects: u64,
}
