//! Writing by a program: files, and the channels that it has opened in them.

use std::collections::BTreeMap;
use std::fs::OpenOptions;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use esl_bytecode::Bytes;
use esl_bytecode::datum::Datum;
use esl_host::{FromArgument, HostFailure, HostObject, Payload};
use mcap::Compression;

use super::batch;
use super::output::{McapOutput, OutputChannel, OutputOptions};
use super::reading::failure;
use crate::message::{MessageType, Types, encode};

/// A file that a program writes.
pub(super) struct McapWriter {
    pub(super) output: McapOutput,
    /// The types of the channels of ROS 2, by their numbers.
    types: Mutex<BTreeMap<u16, Arc<MessageType>>>,
}

impl HostObject for McapWriter {
    const KIND: &'static str = "MCAP-OUTPUT";
}

/// Returns the settings of these names.
pub(super) fn options(
    compression: Option<&str>,
    chunk_size: Option<u64>,
    profile: String,
) -> Result<OutputOptions, HostFailure> {
    let compression = match compression {
        None => None,
        Some("ZSTD") => Some(Compression::Zstd),
        Some("LZ4") => Some(Compression::Lz4),
        Some(other) => {
            let known = "expected :zstd, :lz4 or nil";
            return Err(failure(format!("unknown compression `:{}`: {known}", other.to_lowercase())));
        }
    };
    Ok(OutputOptions { compression, chunk_size, profile })
}

impl McapWriter {
    /// Creates the file at a path, in place of another one.
    pub(super) fn create(path: &str, options: &OutputOptions) -> Result<McapWriter, HostFailure> {
        let begin = || {
            let file = OpenOptions::new().write(true).create(true).truncate(true).open(path)?;
            McapOutput::begin(file, options)
        };
        let output = begin().map_err(|error: std::io::Error| failure(format!("{path}: {error}")))?;
        Ok(McapWriter { output, types: Mutex::default() })
    }

    /// Begins a file whose bytes the program takes.
    pub(super) fn in_memory(options: &OutputOptions) -> Result<McapWriter, HostFailure> {
        let output = McapOutput::in_memory(options).map_err(failure)?;
        Ok(McapWriter { output, types: Mutex::default() })
    }

    fn types(&self) -> MutexGuard<'_, BTreeMap<u16, Arc<MessageType>>> {
        // The map is whole at every moment, so a panic elsewhere does not corrupt it.
        self.types.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Opens a channel of messages of ROS 2, whose type `text` defines, or else one that comes with ESL.
    pub(super) fn ros_channel(
        &self,
        topic: String,
        name: &str,
        text: Option<String>,
        metadata: Vec<(String, String)>,
    ) -> Result<u16, HostFailure> {
        let types = Types::bundled();
        if let Some(text) = &text {
            types.define(name, text)?;
        }
        let of_type = types.message(name)?;
        let channel = ros_channel(topic, &types, &of_type, metadata);
        let number = self.output.channel(channel).map_err(failure)?;
        self.types().insert(number, of_type);
        Ok(number)
    }

    /// Opens a channel of other messages.
    pub(super) fn channel(&self, channel: OutputChannel) -> Result<u16, HostFailure> {
        self.output.channel(channel).map_err(failure)
    }

    /// Writes a message. Returns whether there is room for more.
    pub(super) fn write(
        &self,
        channel: u16,
        times: (u64, u64),
        sequence: Option<u32>,
        message: &Datum,
    ) -> Result<bool, HostFailure> {
        let of_type = self.type_of(channel)?;
        Ok(self.output.write(channel, times, sequence, payload(of_type.as_deref(), message)?))
    }

    /// Writes a list or a vector of messages, whose times are as many seconds: all, or none if one of them is
    /// refused. Returns whether there is room for more.
    pub(super) fn write_all(
        &self,
        channel: u16,
        seconds: &Datum,
        messages: &Datum,
    ) -> Result<bool, HostFailure> {
        let of_type = self.type_of(channel)?;
        let (times, messages) = (batch::times(seconds)?, batch::items(messages)?);
        if times.len() != messages.len() {
            let counts = format!("found {} and {}", times.len(), messages.len());
            return Err(failure(format!("expected as many times as messages, {counts}")));
        }
        let mut parts = Vec::with_capacity(times.len());
        for (time, message) in times.into_iter().zip(&messages) {
            parts.push((time, payload(of_type.as_deref(), message)?));
        }
        Ok(self.output.write_all(channel, parts))
    }

    /// Returns the type of the messages of a channel of ROS 2.
    fn type_of(&self, channel: u16) -> Result<Option<Arc<MessageType>>, HostFailure> {
        match self.output.fault() {
            Some(reason) => Err(failure(reason)),
            None => Ok(self.types().get(&channel).cloned()),
        }
    }
}

/// Returns the payload of a message: of this type, or else bytes or a string.
fn payload(of_type: Option<&MessageType>, message: &Datum) -> Result<Bytes, HostFailure> {
    match of_type {
        Some(of_type) => Ok(encode(of_type, message)?),
        None => Ok(Payload::from_argument(message)?.0),
    }
}

/// Returns a channel of messages of ROS 2, as rosbag2 describes them.
pub(super) fn ros_channel(
    topic: String,
    types: &Types,
    of_type: &MessageType,
    mut metadata: Vec<(String, String)>,
) -> OutputChannel {
    // Parts of actions and services have no text of their own.
    let text = types.joined_text(of_type.name()).unwrap_or_else(|_| of_type.text_of_fields());
    metadata.push(("topic_type_hash".into(), of_type.hash().to_owned()));
    let schema = Some((of_type.name().to_owned(), "ros2msg".into(), Bytes::from(text)));
    OutputChannel { topic, encoding: "cdr".into(), schema, metadata }
}
