//! Writing a file: messages are gathered, and a thread compresses and writes them.
//!
//! Guarantees: the thread of the machine waits for neither compression nor disk. While messages are written,
//! a chunk ends at least once a second and is handed to the system, so a file of a killed process is readable
//! up to the second before.

use std::collections::HashMap;
use std::fmt;
use std::fs::File;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use esl_bytecode::Bytes;
use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, Compression, WriteOptions, Writer};
use tokio::sync::Notify;

use super::sink::ByteSink;

/// Longest time for which a message is not in a chunk that is written.
const PERIOD: Duration = Duration::from_secs(1);

/// Bytes of messages that wait to be written, from which on the program waits as well.
const MOST_BYTES: usize = 16 << 20;

/// Time for which parts are gathered before they are written.
const GATHERED: Duration = Duration::from_millis(5);

/// Bytes of a message beside its payload, in this count.
const OVERHEAD: usize = 64;

/// The name of the writing library, in the header of each file.
const LIBRARY: &str = concat!("esl ", env!("CARGO_PKG_VERSION"));

/// How a file is written.
#[derive(Clone, Debug)]
pub struct OutputOptions {
    /// Compression of chunks.
    pub compression: Option<Compression>,
    /// Bytes of a chunk's contents; `None` to write without chunks.
    pub chunk_size: Option<u64>,
    /// The conventions that the file follows, such as `ros2`.
    pub profile: String,
}

impl Default for OutputOptions {
    fn default() -> OutputOptions {
        let compression = Some(Compression::Zstd);
        OutputOptions {
            compression,
            chunk_size: Some(WriteOptions::DEFAULT_CHUNK_SIZE),
            profile: String::new(),
        }
    }
}

/// Why a file is not written any more.
#[derive(Clone, Debug)]
pub enum OutputFault {
    /// It has as many channels as a file can have.
    Channels,
    /// The crate or the system refuses.
    Refused(Arc<mcap::McapError>),
}

impl fmt::Display for OutputFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            OutputFault::Channels => f.write_str("a file of MCAP has at most 65536 channels"),
            OutputFault::Refused(error) => match &**error {
                mcap::McapError::Io(error) => error.fmt(f),
                error => error.fmt(f),
            },
        }
    }
}

impl std::error::Error for OutputFault {}

impl From<mcap::McapError> for OutputFault {
    fn from(error: mcap::McapError) -> OutputFault {
        OutputFault::Refused(Arc::new(error))
    }
}

/// A channel to be written.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct OutputChannel {
    /// Its topic.
    pub topic: String,
    /// The form of its messages.
    pub encoding: String,
    /// Name, form and text of its schema.
    pub schema: Option<(String, String, Bytes)>,
    /// Further names and values.
    pub metadata: Vec<(String, String)>,
}

/// A part of the file that is to be written.
enum FilePart {
    Channel(u16, OutputChannel),
    Message(MessageHeader, Bytes),
    Attachment(Attachment<'static>),
    Metadata(Metadata),
    Flush,
    Finish,
}

impl FilePart {
    fn size(&self) -> usize {
        OVERHEAD
            + match self {
                FilePart::Message(_, payload) => payload.len(),
                FilePart::Attachment(attachment) => attachment.data.len(),
                _ => 0,
            }
    }
}

#[derive(Default)]
struct QueueState {
    parts: Vec<FilePart>,
    bytes: usize,
    /// Number of parts that were put in, and of those that are written.
    put: u64,
    written: u64,
    /// Why no more is written.
    fault: Option<OutputFault>,
    is_finished: bool,
    /// Whether the parts are not to wait for more of them.
    is_hurried: bool,
}

/// Parts on their way to the thread that writes them.
#[derive(Default)]
struct Queue {
    state: Mutex<QueueState>,
    /// Notified when there is enough to be written.
    work: Condvar,
    /// Notified when parts are written.
    done: Notify,
}

impl Queue {
    fn state(&self) -> MutexGuard<'_, QueueState> {
        // The state is whole at every moment, so a panic elsewhere does not corrupt it.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits until there are parts, at most for this time if there is one, and takes them. They are gathered
    /// for a moment: to be woken for each takes longer than to write it.
    fn take(&self, patience: Option<Duration>) -> Vec<FilePart> {
        let is_empty = |state: &mut QueueState| state.parts.is_empty();
        let is_small = |state: &mut QueueState| !state.is_hurried && state.bytes < MOST_BYTES / 4;
        let mut state = match patience {
            Some(patience) => {
                let waited = self.work.wait_timeout_while(self.state(), patience, is_empty);
                waited.unwrap_or_else(PoisonError::into_inner).0
            }
            None => self.work.wait_while(self.state(), is_empty).unwrap_or_else(PoisonError::into_inner),
        };
        if !state.parts.is_empty() {
            let waited = self.work.wait_timeout_while(state, GATHERED, is_small);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        state.bytes = 0;
        state.is_hurried = false;
        std::mem::take(&mut state.parts)
    }
}

/// The channels of a file that is written.
#[derive(Default)]
struct Channels {
    numbers: HashMap<OutputChannel, u16>,
    sequences: Vec<u32>,
}

/// The writer of the parts.
enum PartTarget {
    /// A thread, by the queue.
    Thread,
    /// The caller.
    Caller(Box<Mutex<PartWriter>>),
}

/// A file that is written.
pub struct McapOutput {
    queue: Arc<Queue>,
    channels: Mutex<Channels>,
    target: PartTarget,
    sink: ByteSink,
}

impl McapOutput {
    /// Begins a file, which a thread writes.
    ///
    /// # Errors
    /// The system gives no thread, or does not write.
    pub fn begin(file: File, options: &OutputOptions) -> std::io::Result<McapOutput> {
        let sink = ByteSink::new(Some(file));
        let mut writer = PartWriter::new(sink.clone(), options).map_err(std::io::Error::other)?;
        let queue = Arc::<Queue>::default();
        let work = queue.clone();
        std::thread::Builder::new().name("mcap".into()).spawn(move || writer.run(&work))?;
        Ok(McapOutput { queue, channels: Mutex::default(), target: PartTarget::Thread, sink })
    }

    /// Begins a file whose bytes [`McapOutput::take`] returns.
    ///
    /// # Errors
    /// A setting that is refused.
    pub fn in_memory(options: &OutputOptions) -> std::io::Result<McapOutput> {
        let sink = ByteSink::new(None);
        let writer = PartWriter::new(sink.clone(), options).map_err(std::io::Error::other)?;
        let target = PartTarget::Caller(Box::new(Mutex::new(writer)));
        Ok(McapOutput { queue: Arc::default(), channels: Mutex::default(), target, sink })
    }

    fn channels(&self) -> MutexGuard<'_, Channels> {
        // It is whole at every moment, as above.
        self.channels.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the number of a channel, which is written before its first message.
    ///
    /// # Errors
    /// There are too many.
    pub fn channel(&self, channel: OutputChannel) -> Result<u16, OutputFault> {
        let mut channels = self.channels();
        if let Some(&number) = channels.numbers.get(&channel) {
            return Ok(number);
        }
        let number = u16::try_from(channels.sequences.len()).map_err(|_| OutputFault::Channels)?;
        channels.sequences.push(0);
        channels.numbers.insert(channel.clone(), number);
        self.put(FilePart::Channel(number, channel));
        Ok(number)
    }

    /// Writes a message. Without a sequence number, it has that after the one before in its channel. Returns
    /// whether there is room for more.
    pub fn write(&self, channel: u16, times: (u64, u64), sequence: Option<u32>, payload: Bytes) -> bool {
        let sequence = {
            let mut channels = self.channels();
            let Some(next) = channels.sequences.get_mut(usize::from(channel)) else { return true };
            let sequence = sequence.unwrap_or_else(|| next.wrapping_add(1));
            *next = sequence;
            sequence
        };
        let (log_time, publish_time) = times;
        self.put(FilePart::Message(
            MessageHeader { channel_id: channel, sequence, log_time, publish_time },
            payload,
        ))
    }

    /// Writes messages with their times, as [`McapOutput::write`] does, at once. Returns whether there is
    /// room for more.
    pub fn write_all(&self, channel: u16, messages: Vec<(u64, Bytes)>) -> bool {
        let first = {
            let mut channels = self.channels();
            let Some(last) = channels.sequences.get_mut(usize::from(channel)) else { return true };
            let first = last.wrapping_add(1);
            // The numbers go round.
            *last = last.wrapping_add(messages.len() as u32);
            first
        };
        self.put_all(messages.into_iter().zip(0_u32..).map(|((time, payload), place)| {
            let sequence = first.wrapping_add(place);
            let header = MessageHeader { channel_id: channel, sequence, log_time: time, publish_time: time };
            FilePart::Message(header, payload)
        }))
    }

    /// Writes an attachment. Returns whether there is room for more.
    pub fn attach(&self, name: String, media_type: String, time: u64, data: &Bytes) -> bool {
        let data = std::borrow::Cow::Owned(data.to_vec());
        self.put(FilePart::Attachment(Attachment {
            log_time: time,
            create_time: time,
            name,
            media_type,
            data,
        }))
    }

    /// Writes a record of metadata.
    pub fn write_metadata(&self, name: String, metadata: Vec<(String, String)>) -> bool {
        self.put(FilePart::Metadata(Metadata { name, metadata: metadata.into_iter().collect() }))
    }

    /// Ends the chunk, and hands it to the system.
    pub fn flush(&self) {
        self.put(FilePart::Flush);
    }

    /// Completes the file, once.
    pub fn finish(&self) {
        if !std::mem::replace(&mut self.queue.state().is_finished, true) {
            self.put(FilePart::Finish);
        }
    }

    fn put(&self, part: FilePart) -> bool {
        self.put_all([part])
    }

    fn put_all(&self, parts: impl IntoIterator<Item = FilePart>) -> bool {
        if let PartTarget::Caller(writer) = &self.target {
            let mut writer = writer.lock().unwrap_or_else(PoisonError::into_inner);
            let written = parts.into_iter().try_for_each(|part| writer.write(part));
            if let Err(reason) = written {
                self.queue.state().fault.get_or_insert(reason);
            }
            return true;
        }
        let mut state = self.queue.state();
        let was_empty = state.parts.is_empty();
        for part in parts {
            let is_last = matches!(part, FilePart::Finish);
            if state.fault.is_some() || state.is_finished && !is_last {
                return true;
            }
            state.is_hurried |= is_last || matches!(part, FilePart::Flush);
            state.bytes += part.size();
            state.parts.push(part);
            state.put += 1;
        }
        if was_empty || state.is_hurried || state.bytes >= MOST_BYTES / 4 {
            self.queue.work.notify_one();
        }
        state.bytes < MOST_BYTES
    }

    /// Returns why nothing is written any more.
    pub fn fault(&self) -> Option<OutputFault> {
        self.queue.state().fault.clone()
    }

    /// Returns the bytes of a file in memory that are there since the last call.
    pub fn take(&self) -> Bytes {
        Bytes::from(self.sink.take())
    }

    /// Returns whether all parts that were put in before this call are written, by their number.
    fn is_done(&self, until: u64) -> bool {
        let state = self.queue.state();
        state.written >= until || state.fault.is_some() || matches!(self.target, PartTarget::Caller(_))
    }

    /// Waits until all parts so far are written.
    ///
    /// # Errors
    /// Why they are not.
    pub async fn written(&self) -> Result<(), OutputFault> {
        let until = self.queue.state().put;
        loop {
            // The interest is there before the look.
            let done = self.queue.done.notified();
            if self.is_done(until) {
                return self.fault().map_or(Ok(()), Err);
            }
            done.await;
        }
    }

    /// As [`McapOutput::written`], for a caller outside of the event loop.
    ///
    /// # Errors
    /// As above.
    pub fn wait(&self) -> Result<(), OutputFault> {
        let until = self.queue.state().put;
        while !self.is_done(until) {
            std::thread::sleep(Duration::from_millis(1));
        }
        self.fault().map_or(Ok(()), Err)
    }
}

impl Drop for McapOutput {
    /// The thread completes the file, and ends.
    fn drop(&mut self) {
        self.finish();
    }
}

/// The writer of parts.
struct PartWriter {
    writer: Option<Writer<ByteSink>>,
    sink: ByteSink,
    /// Numbers of the schemas, from 1 on.
    schemas: HashMap<(String, String, Bytes), u16>,
}

impl PartWriter {
    fn new(sink: ByteSink, options: &OutputOptions) -> Result<PartWriter, mcap::McapError> {
        let settings = WriteOptions::new()
            .library(LIBRARY)
            .profile(options.profile.clone())
            // The chunk is in memory until it is whole: a file never has a part of one, save for its end.
            .disable_seeking(true)
            .compression_threads(0)
            .use_chunks(options.chunk_size.is_some())
            .chunk_size(options.chunk_size)
            .compression(options.compression);
        let writer = Some(settings.create(sink.clone())?);
        Ok(PartWriter { writer, sink, schemas: HashMap::new() })
    }

    /// Writes parts until the file is complete.
    fn run(&mut self, queue: &Queue) {
        let mut flushed = Instant::now();
        // Whether there is something in the chunk.
        let mut is_open = false;
        loop {
            let patience = is_open.then(|| PERIOD.saturating_sub(flushed.elapsed()));
            let parts = queue.take(patience);
            if !is_open {
                flushed = Instant::now();
            }
            let count = parts.len() as u64;
            let is_last = parts.iter().any(|part| matches!(part, FilePart::Finish));
            let mut result = Ok(());
            for part in parts {
                is_open |= !matches!(part, FilePart::Flush | FilePart::Finish);
                result = result.and_then(|()| self.write(part));
            }
            if is_open && flushed.elapsed() >= PERIOD {
                result = result.and_then(|()| self.write(FilePart::Flush));
                flushed = Instant::now();
                is_open = false;
            }
            result =
                result.and_then(|()| self.sink.pass_on().map_err(|error| mcap::McapError::Io(error).into()));
            let is_over = is_last || result.is_err();
            let mut state = queue.state();
            state.written += count;
            state.fault = result.err();
            drop(state);
            queue.done.notify_waiters();
            if is_over {
                return;
            }
        }
    }

    fn write(&mut self, part: FilePart) -> Result<(), OutputFault> {
        let Some(writer) = &mut self.writer else { return Ok(()) };
        let written = match part {
            FilePart::Channel(number, channel) => {
                return self.write_channel(number, channel).map_err(OutputFault::from);
            }
            FilePart::Message(header, payload) => writer.write_to_known_channel(&header, &payload),
            FilePart::Attachment(attachment) => writer.attach(&attachment),
            FilePart::Metadata(metadata) => writer.write_metadata(&metadata),
            FilePart::Flush => writer.flush(),
            FilePart::Finish => {
                let finished = writer.finish().map(|_| ());
                self.writer = None;
                finished
            }
        };
        written.map_err(OutputFault::from)
    }

    fn write_channel(&mut self, number: u16, channel: OutputChannel) -> Result<(), mcap::McapError> {
        let Some(writer) = &mut self.writer else { return Ok(()) };
        let OutputChannel { topic, encoding, schema, metadata } = channel;
        let schema = match schema {
            None => 0,
            Some(schema) => match self.schemas.get(&schema) {
                Some(&known) => known,
                None => {
                    let next = u16::try_from(self.schemas.len() + 1);
                    let next = next.map_err(|_| mcap::McapError::TooManySchemas)?;
                    let (name, form, text) = &schema;
                    let id = writer.add_schema_with_id(next, name, form, text)?;
                    self.schemas.insert(schema, id);
                    id
                }
            },
        };
        let metadata = metadata.into_iter().collect();
        writer.add_channel_with_id(number, schema, &topic, &encoding, &metadata)?;
        Ok(())
    }
}
