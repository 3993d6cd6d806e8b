//! Reading by a program: a file, and readers of its messages in batches.
//!
//! A batch has a number, and asking for it again returns it again. So a call that is left loses nothing, and
//! an exploration that goes back to an earlier state reads what it has read.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::packed::PackedVector;
use esl_bytecode::span::Span;
use esl_host::{HostFailure, HostObject, IntoDatum, Keyword};

use super::bag::McapBag;
use super::decode::{DecodedPayload, MessageForm};
use super::file::McapFault;
use super::info::FileInfo;
use super::order::{McapMessage, McapSelection, OrderedMessages};

/// Most messages of a batch.
const MESSAGES: usize = 256;

/// Bytes of payloads after which a batch ends.
const BYTES: usize = 1 << 18;

/// Bytes of the payloads of batches that a reader keeps, beside the last one.
const KEPT: usize = 1 << 24;

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // The guarded data are whole at every moment, so a panic elsewhere does not corrupt it.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Returns the failure of a file.
pub(super) fn failure(reason: impl ToString) -> HostFailure {
    HostFailure::new("MCAP-ERROR", reason)
}

impl From<McapFault> for HostFailure {
    fn from(fault: McapFault) -> HostFailure {
        failure(fault)
    }
}

/// A file, or the folder of a bag, that a program reads.
pub(super) struct McapInput(Mutex<Option<Arc<Mutex<McapBag>>>>);

impl HostObject for McapInput {
    const KIND: &'static str = "MCAP-INPUT";
}

impl McapInput {
    pub(super) fn open(path: &str) -> Result<McapInput, HostFailure> {
        let path = Path::new(path);
        let bag = McapBag::open(path).map_err(|fault| match fault {
            McapFault::Other(text) => failure(text),
            fault => failure(format!("{}: {fault}", path.display())),
        })?;
        Ok(McapInput(Mutex::new(Some(Arc::new(Mutex::new(bag))))))
    }

    pub(super) fn close(&self) {
        lock(&self.0).take();
    }

    fn bag(&self) -> Result<Arc<Mutex<McapBag>>, HostFailure> {
        lock(&self.0).clone().ok_or_else(|| failure("the file is closed"))
    }

    /// Returns the damage that was found so far, as texts.
    pub(super) fn damage(&self) -> Result<Vec<String>, HostFailure> {
        let bag = self.bag()?;
        let bag = lock(&bag);
        let name = |file: usize| match bag.paths() {
            [_] => String::new(),
            paths => format!("{}: ", paths[file].file_name().unwrap_or_default().display()),
        };
        Ok(bag.damage().into_iter().map(|(file, damage)| format!("{}{damage}", name(file))).collect())
    }

    /// Returns the channels: of each its topic, encoding, the name, encoding and text of its schema, its
    /// metadata, the number of its messages, and the hash of its type.
    pub(super) fn channels(&self) -> Result<Vec<Vec<Datum>>, HostFailure> {
        let bag = self.bag()?;
        let bag = lock(&bag);
        let mut channels = Vec::new();
        for (channel, count) in bag.info().into_iter().flat_map(FileInfo::channels) {
            let metadata: Vec<(String, String)> =
                channel.metadata.iter().map(|(name, value)| (name.clone(), value.clone())).collect();
            let schema = channel.schema.as_deref();
            let hash = MessageForm::of(channel).hash(channel);
            let text = schema.map(|schema| match std::str::from_utf8(&schema.data) {
                Ok(text) => text.into_datum(),
                Err(_) => schema.data.clone().into_datum(),
            });
            channels.push(vec![
                channel.topic.as_str().into_datum(),
                channel.encoding.as_str().into_datum(),
                schema.map(|schema| schema.name.as_str()).into_datum(),
                schema.map(|schema| schema.encoding.as_str()).into_datum(),
                text.into_datum(),
                metadata.into_datum(),
                i64::try_from(count).unwrap_or(i64::MAX).into_datum(),
                hash.into_datum(),
            ]);
        }
        Ok(channels)
    }

    /// Returns profile, library, number of messages, earliest and latest time.
    pub(super) fn figures(&self) -> Result<Vec<Datum>, HostFailure> {
        let bag = self.bag()?;
        let bag = lock(&bag);
        let info = bag.info();
        let messages = info.iter().map(|info| info.messages()).fold(0_u64, u64::saturating_add);
        let names: Vec<&str> =
            info.iter().flat_map(|info| info.compressions()).map(|(name, _)| name).collect();
        Ok(vec![
            info.first().map(|info| info.profile()).into_datum(),
            info.first().map(|info| info.library()).into_datum(),
            time(messages),
            bag.times().map(|(first, _)| time(first)).into_datum(),
            bag.times().map(|(_, last)| time(last)).into_datum(),
            names.into_datum(),
        ])
    }

    /// Returns the records of metadata: of each its name, and its names and values.
    pub(super) fn metadata(&self) -> Result<Vec<Datum>, HostFailure> {
        let bag = self.bag()?;
        let mut bag = lock(&bag);
        let mut records = Vec::new();
        for file in &mut bag.files {
            for record in file.index.metadata.clone() {
                records.push((record.name, file.metadata(record.place)?).into_datum());
            }
        }
        Ok(records)
    }

    /// Returns the attachments: of each its name, media type, time and size.
    pub(super) fn attachments(&self) -> Result<Vec<Datum>, HostFailure> {
        let bag = self.bag()?;
        let bag = lock(&bag);
        let described = |info: FileInfo<'_>| {
            let record = |record: &super::index::NamedRecord| {
                let (name, media_type) = (record.name.as_str(), record.media_type.as_str());
                let parts =
                    [name.into_datum(), media_type.into_datum(), time(record.time), time(record.size)];
                parts.to_vec().into_datum()
            };
            info.attachments().iter().map(record).collect::<Vec<Datum>>()
        };
        Ok(bag.info().into_iter().flat_map(described).collect())
    }

    /// Returns the data of an attachment, by its number.
    pub(super) fn attachment(&self, number: usize) -> Result<Datum, HostFailure> {
        let bag = self.bag()?;
        let mut bag = lock(&bag);
        let mut before = 0;
        for file in &mut bag.files {
            let record = number.checked_sub(before).and_then(|number| file.index.attachments.get(number));
            if let Some(place) = record.map(|record| record.place) {
                return Ok(file.attachment(place)?.into_datum());
            }
            before += file.index.attachments.len();
        }
        Err(failure("the file has no such attachment"))
    }

    /// Returns a reader of the messages of these topics, or of all, from `start` to `end`, in nanoseconds
    /// from the first message on.
    pub(super) fn read(
        &self,
        topics: Option<Vec<String>>,
        start: Option<u64>,
        end: Option<u64>,
    ) -> Result<McapReader, HostFailure> {
        let bag = self.bag()?;
        let first = lock(&bag).times().map_or(0, |(first, _)| first);
        let selection = McapSelection {
            topics: topics.map(|topics| topics.into_iter().collect::<HashSet<String>>()),
            start: start.map_or(0, |start| first.saturating_add(start)),
            end: end.map(|end| first.saturating_add(end)),
        };
        let state =
            ReaderState { ordered: None, next: 0, kept: BTreeMap::new(), bytes: 0, channels: HashMap::new() };
        Ok(McapReader { bag, selection, state: Mutex::new(state) })
    }
}

/// Returns an unsigned number as data.
fn time(nanoseconds: u64) -> Datum {
    Datum::integer(nanoseconds, Span::default())
}

/// A reader of messages in batches.
pub(super) struct McapReader {
    bag: Arc<Mutex<McapBag>>,
    selection: McapSelection,
    state: Mutex<ReaderState>,
}

impl HostObject for McapReader {
    const KIND: &'static str = "MCAP-READER";
}

struct ReaderState {
    ordered: Option<OrderedMessages>,
    /// Number of the batch that comes next.
    next: u64,
    /// Batches, each with the bytes of its payloads.
    kept: BTreeMap<u64, (Datum, usize)>,
    bytes: usize,
    /// Channels, by file and number.
    channels: HashMap<(usize, u16), ReadChannel>,
}

/// A channel whose messages are read.
struct ReadChannel {
    topic: Datum,
    form: MessageForm,
}

/// The messages of a batch, by their parts.
#[derive(Default)]
struct MessageColumns {
    topics: Vec<Datum>,
    times: Vec<u64>,
    publish_times: Vec<u64>,
    sequences: Vec<u64>,
    forms: Vec<Datum>,
    payloads: Vec<Datum>,
}

impl MessageColumns {
    /// Returns the columns as a list of vectors; the empty list without messages.
    fn into_datum(self) -> Datum {
        if self.topics.is_empty() {
            return Datum::nil(Span::default());
        }
        let columns = [
            vector(self.topics),
            numbers(&self.times),
            numbers(&self.publish_times),
            numbers(&self.sequences),
            vector(self.forms),
            vector(self.payloads),
        ];
        Datum::list(columns, Span::default())
    }
}

fn vector(items: Vec<Datum>) -> Datum {
    Datum::new(DatumKind::Vector(items.into()), Span::default())
}

/// Returns unsigned numbers as a vector.
fn numbers(numbers: &[u64]) -> Datum {
    match numbers.iter().map(|&number| i64::try_from(number)).collect::<Result<Arc<[i64]>, _>>() {
        Ok(integers) => Datum::new(DatumKind::Packed(PackedVector::Integers(integers)), Span::default()),
        Err(_) => vector(numbers.iter().map(|&number| time(number)).collect()),
    }
}

impl McapReader {
    /// Returns a batch: a list of vectors of the topics of messages, their times, times of publication,
    /// sequence numbers, forms and payloads. An empty one is the end. With `is_raw`, payloads are bytes.
    pub(super) fn batch(&self, number: u64, is_raw: bool) -> Result<Datum, HostFailure> {
        let mut state = lock(&self.state);
        if let Some((batch, _)) = state.kept.get(&number) {
            return Ok(batch.clone());
        }
        let mut bag = lock(&self.bag);
        if number < state.next || state.ordered.is_none() {
            (state.ordered, state.next) = (Some(bag.ordered(self.selection.clone())), 0);
        }
        loop {
            let (batch, bytes) = state.make(&mut bag, is_raw)?;
            let made = state.next;
            state.next += 1;
            state.keep(made, batch.clone(), bytes);
            if made >= number || batch.is_nil() {
                return Ok(batch);
            }
        }
    }
}

impl ReaderState {
    /// Keeps a batch, and drops the oldest ones.
    fn keep(&mut self, number: u64, batch: Datum, bytes: usize) {
        self.bytes += bytes;
        if let Some((_, old)) = self.kept.insert(number, (batch, bytes)) {
            self.bytes -= old;
        }
        while self.bytes > KEPT && self.kept.len() > 1 {
            let Some((_, (_, bytes))) = self.kept.pop_first() else { break };
            self.bytes -= bytes;
        }
    }

    fn make(&mut self, bag: &mut McapBag, is_raw: bool) -> Result<(Datum, usize), HostFailure> {
        let mut columns = MessageColumns::default();
        let mut bytes = 0;
        while columns.topics.len() < MESSAGES && bytes < BYTES {
            let Some(ordered) = &mut self.ordered else { break };
            let Some(message) = ordered.next(&mut bag.files)? else { break };
            bytes += message.data.len();
            self.add(&mut columns, &message, is_raw);
        }
        // The data take some hundred bytes for each message, too.
        bytes += columns.topics.len() * 256;
        Ok((columns.into_datum(), bytes))
    }

    fn add(&mut self, columns: &mut MessageColumns, message: &McapMessage, is_raw: bool) {
        let channel = &message.channel;
        let read = self.channels.entry((message.file, channel.id)).or_insert_with(|| ReadChannel {
            topic: channel.topic.as_str().into_datum(),
            form: if is_raw { MessageForm::Bytes } else { MessageForm::of(channel) },
        });
        let DecodedPayload { form, data } = read.form.decode(&channel.topic, &message.data);
        columns.topics.push(read.topic.clone());
        columns.times.push(message.log_time);
        columns.publish_times.push(message.publish_time);
        columns.sequences.push(message.sequence.into());
        columns.forms.push(Keyword(form).into_datum());
        columns.payloads.push(data);
    }
}
