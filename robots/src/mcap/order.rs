//! The messages of files in the order of their times.
//!
//! Guarantees: messages come in the order of their log times; those of one time in the order of the files and
//! of writing. Only the sections are in memory whose times overlap.
//! Source: the merge of chunks by their first times, as the readers of MCAP's own libraries do it.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashSet};
use std::io::{Read, Seek};
use std::sync::Arc;

use esl_bytecode::Bytes;

use super::file::{McapFault, McapFile, MessagePlace, SectionContents};
use super::index::{FileSection, McapChannel};

/// Most bytes of sections that are in memory at the same time.
const MOST_BYTES: u64 = 1 << 29;

/// The messages that are wanted.
#[derive(Clone, Debug, Default)]
pub struct McapSelection {
    /// Their topics; `None` for all.
    pub topics: Option<HashSet<String>>,
    /// Earliest time, in nanoseconds since 1970.
    pub start: u64,
    /// Latest time; `None` for no limit.
    pub end: Option<u64>,
}

impl McapSelection {
    fn has_time(&self, time: u64) -> bool {
        time >= self.start && self.end.is_none_or(|end| time <= end)
    }

    fn has_topic(&self, topic: &str) -> bool {
        self.topics.as_ref().is_none_or(|topics| topics.contains(topic))
    }
}

/// A message of a file.
#[derive(Clone, Debug)]
pub struct McapMessage {
    /// Index of the file.
    pub file: usize,
    /// Its channel.
    pub channel: Arc<McapChannel>,
    /// Its number, as the writer has given it.
    pub sequence: u32,
    /// Nanoseconds since 1970 at which it was recorded.
    pub log_time: u64,
    /// Nanoseconds since 1970 at which it was published.
    pub publish_time: u64,
    /// Its payload.
    pub data: Bytes,
}

/// A section whose messages are being read.
struct OpenSection {
    file: usize,
    contents: SectionContents,
    /// The selected messages, latest first.
    left: Vec<u32>,
}

/// Time of the next message of an open section, with what orders sections of the same time, and its index.
type NextOfSection = Reverse<(u64, usize, u64, usize)>;

/// A reader of the messages of files, in the order of their times.
pub(super) struct OrderedMessages {
    selection: McapSelection,
    /// Sections that are not open yet, latest first, with their files.
    closed: Vec<(usize, FileSection)>,
    open: Vec<Option<OpenSection>>,
    next: BinaryHeap<NextOfSection>,
    bytes: u64,
}

impl OrderedMessages {
    pub(super) fn new<R: Read + Seek>(files: &[McapFile<R>], selection: McapSelection) -> OrderedMessages {
        let mut closed = Vec::new();
        for (number, file) in files.iter().enumerate() {
            let is_wanted =
                |id: &u16| file.channel(*id).is_none_or(|known| selection.has_topic(&known.topic));
            let has_wanted = |section: &&FileSection| {
                let (first, last) = section.times;
                last >= selection.start
                    && selection.end.is_none_or(|end| first <= end)
                    && (section.channels.is_empty() || section.channels.iter().any(is_wanted))
            };
            closed.extend(file.index.sections.iter().filter(has_wanted).map(|s| (number, s.clone())));
        }
        closed.sort_by_key(|(file, section)| Reverse((section.times.0, *file, section.place)));
        OrderedMessages { selection, closed, open: Vec::new(), next: BinaryHeap::new(), bytes: 0 }
    }

    /// Returns the next message; `None` at the end.
    pub(super) fn next<R: Read + Seek>(
        &mut self,
        files: &mut [McapFile<R>],
    ) -> Result<Option<McapMessage>, McapFault> {
        while let Some((_, section)) = self.closed.last() {
            let is_later = self.next.peek().is_some_and(|Reverse((time, ..))| section.times.0 > *time);
            if is_later {
                break;
            }
            if let Some((file, section)) = self.closed.pop() {
                self.open_section(files, file, &section)?;
            }
        }
        let Some(Reverse((_, _, place, at))) = self.next.pop() else { return Ok(None) };
        let Some(section) = self.open[at].as_mut() else { return Ok(None) };
        let Some(message) = section.left.pop() else { return Ok(None) };
        let MessagePlace { header, start, end } = section.contents.messages[message as usize];
        let file = section.file;
        let data = section.contents.bytes.slice(start..end);
        if let Some(&after) = section.left.last() {
            let time = section.contents.messages[after as usize].header.log_time;
            self.next.push(Reverse((time, file, place, at)));
        } else {
            self.bytes -= section.contents.bytes.len() as u64;
            self.open[at] = None;
        }
        // Messages of unknown channels were not selected.
        let Some(channel) = files[file].channel(header.channel_id).cloned() else { return Ok(None) };
        Ok(Some(McapMessage {
            file,
            channel,
            sequence: header.sequence,
            log_time: header.log_time,
            publish_time: header.publish_time,
            data,
        }))
    }

    fn open_section<R: Read + Seek>(
        &mut self,
        files: &mut [McapFile<R>],
        number: usize,
        section: &FileSection,
    ) -> Result<(), McapFault> {
        let file = &mut files[number];
        let contents = file.contents(section)?;
        let selects = |message: &MessagePlace| {
            self.selection.has_time(message.header.log_time)
                && file
                    .channel(message.header.channel_id)
                    .is_some_and(|channel| self.selection.has_topic(&channel.topic))
        };
        let indexed = (0_u32..).zip(&contents.messages);
        let mut left: Vec<u32> = indexed.filter(|(_, m)| selects(m)).map(|(at, _)| at).collect();
        let Some(&first) = left.first() else { return Ok(()) };
        let time = |at: &u32| contents.messages[*at as usize].header.log_time;
        // Equal times stay in the order of writing, which is turned round with the rest.
        if left.is_sorted_by_key(time) {
            left.reverse();
        } else {
            left.sort_by_key(|at| Reverse((time(at), *at)));
        }
        let earliest = left.last().map_or_else(|| time(&first), time);
        self.bytes += contents.bytes.len() as u64;
        if self.bytes > MOST_BYTES {
            return Err(McapFault::Disorder(MOST_BYTES));
        }
        let free = self.open.iter().position(Option::is_none).unwrap_or(self.open.len());
        if free == self.open.len() {
            self.open.push(None);
        }
        self.open[free] = Some(OpenSection { file: number, contents, left });
        self.next.push(Reverse((earliest, number, section.place, free)));
        Ok(())
    }
}
