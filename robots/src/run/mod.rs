//! A run as channels of messages, which Foxglove shows: its tasks, failures, facts, inputs, operations, and
//! what it prints; topics of ROS 2 with their own types.
//!
//! Guarantees: recording changes nothing in the run. Without a recorder, a message of ROS 2 costs one look at
//! a flag, and nothing else costs anything.
//! Not here: writing the file (`mcap`); what observers are told (the machine).

mod host;
mod json;
mod log;
mod recorder;
mod tap;

pub use host::ObservedHost;
pub use recorder::RunRecorder;
pub(crate) use tap::note_topic;

/// Takes the messages of a run.
pub trait RunSink: Send + Sync {
    /// Opens a channel, and returns its number.
    fn channel(&self, channel: crate::mcap::OutputChannel) -> Option<u16>;

    /// Takes a message of a channel, with its time in nanoseconds since 1970.
    fn message(&self, channel: u16, time: u64, payload: esl_bytecode::Bytes);
}

impl RunSink for crate::mcap::McapOutput {
    fn channel(&self, channel: crate::mcap::OutputChannel) -> Option<u16> {
        // A run with more than 65536 channels is recorded without the rest.
        self.channel(channel).ok()
    }

    fn message(&self, channel: u16, time: u64, payload: esl_bytecode::Bytes) {
        self.write(channel, (time, time), None, payload);
    }
}
