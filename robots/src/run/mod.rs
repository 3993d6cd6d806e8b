//! A run as channels of messages, which Foxglove shows: its tasks, failures, facts, inputs, operations, and
//! what it prints; topics of ROS 2 with their own types.
//!
//! Guarantees: recording changes nothing in the run. Without a recorder, a message of ROS 2 costs one look at
//! a flag, and nothing else costs anything.
//! Not here: writing the file (`mcap`); what observers are told (the machine).

mod host;
mod json;
mod live;
mod log;
mod recorder;
mod tap;
mod topics;

pub use host::ObservedHost;
pub use live::{LiveFault, LiveServer};
pub use recorder::RunRecorder;
pub(crate) use tap::{is_on, note_topic};

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

/// A sink that takes nothing.
pub struct NoSink;

impl RunSink for NoSink {
    fn channel(&self, _channel: crate::mcap::OutputChannel) -> Option<u16> {
        None
    }

    fn message(&self, _channel: u16, _time: u64, _payload: esl_bytecode::Bytes) {}
}

/// Sinks that take the same messages.
pub struct RunSinks {
    sinks: Vec<std::sync::Arc<dyn RunSink>>,
    /// Numbers of each channel in the sinks.
    channels: std::sync::RwLock<Vec<Vec<Option<u16>>>>,
}

impl RunSinks {
    /// Returns these sinks as one.
    pub fn new(sinks: Vec<std::sync::Arc<dyn RunSink>>) -> RunSinks {
        RunSinks { sinks, channels: std::sync::RwLock::default() }
    }
}

impl RunSink for RunSinks {
    fn channel(&self, channel: crate::mcap::OutputChannel) -> Option<u16> {
        let numbers = self.sinks.iter().map(|sink| sink.channel(channel.clone())).collect();
        // The list is whole at every moment, so a panic elsewhere does not corrupt it.
        let mut channels = self.channels.write().unwrap_or_else(std::sync::PoisonError::into_inner);
        let number = u16::try_from(channels.len()).ok()?;
        channels.push(numbers);
        Some(number)
    }

    fn message(&self, channel: u16, time: u64, payload: esl_bytecode::Bytes) {
        let channels = self.channels.read().unwrap_or_else(std::sync::PoisonError::into_inner);
        let Some(numbers) = channels.get(usize::from(channel)) else { return };
        for (sink, number) in self.sinks.iter().zip(numbers) {
            if let Some(number) = number {
                sink.message(*number, time, payload.clone());
            }
        }
    }
}
