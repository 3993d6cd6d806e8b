//! A host without an outside: a clock that jumps, given input, captured output, files in memory.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::shared::CopyOnWrite;

use super::rights::{permit, resolve_as_text};
use super::{
    Awaited, FileAnswer, FileRequest, Host, HostError, HostState, Inbox, Incoming, Input, Output, Permit,
    Right, Rights, VIRTUAL_BEGINNING, Wake, WriteMode,
};

/// The output of a program and its files, shared between a [`VirtualHost`] and its observers.
#[derive(Clone, Default)]
pub struct Captured(Arc<Mutex<Contents>>);

#[derive(Clone, Default)]
struct Contents {
    output: CopyOnWrite<Vec<u8>>,
    error: CopyOnWrite<Vec<u8>>,
    /// Order of what was written to the two: to which, and how many bytes.
    order: CopyOnWrite<Vec<(Output, usize)>>,
    files: CopyOnWrite<BTreeMap<String, Vec<u8>>>,
}

/// State of a [`VirtualHost`], but for what never changes.
struct VirtualState {
    now: u64,
    input: VecDeque<Vec<u8>>,
    arrivals: VecDeque<(u64, Incoming)>,
    contents: Contents,
    output_limit: Option<usize>,
}

impl Captured {
    fn contents(&self) -> MutexGuard<'_, Contents> {
        // The contents are consistent at every moment, so a panic elsewhere does not corrupt them.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns everything written to standard output so far.
    pub fn output(&self) -> String {
        String::from_utf8_lossy(&self.contents().output).into_owned()
    }

    /// Returns everything written to standard error so far.
    pub fn error(&self) -> String {
        String::from_utf8_lossy(&self.contents().error).into_owned()
    }

    /// Returns what was written to both streams behind the first so many bytes, in the order of writing.
    pub fn pieces_after(&self, bytes: usize) -> Vec<(Output, Vec<u8>)> {
        let contents = self.contents();
        let (mut seen, mut standard, mut error) = (0, 0, 0);
        let mut pieces = Vec::new();
        for &(output, length) in contents.order.iter() {
            let (text, at) = match output {
                Output::Standard => (&contents.output, &mut standard),
                Output::Error => (&contents.error, &mut error),
            };
            let skipped = bytes.saturating_sub(seen).min(length);
            if skipped < length {
                pieces.push((output, text[*at + skipped..*at + length].to_vec()));
            }
            seen += length;
            *at += length;
        }
        pieces
    }

    pub(super) fn append(&self, output: Output, bytes: &[u8]) {
        let mut contents = self.contents();
        match contents.order.last().copied() {
            Some((last, _)) if last == output => {
                if let Some((_, length)) = contents.order.last_mut() {
                    *length += bytes.len();
                }
            }
            _ => contents.order.push((output, bytes.len())),
        }
        match output {
            Output::Standard => contents.output.extend_from_slice(bytes),
            Output::Error => contents.error.extend_from_slice(bytes),
        }
    }

    /// Returns the contents of a file.
    pub fn file(&self, path: &str) -> Option<Vec<u8>> {
        self.contents().files.get(path).cloned()
    }
}

/// A host in memory. Time passes only when the program waits or the host is told so. It grants all rights
/// unless it is told otherwise, since there is nothing real behind it.
pub struct VirtualHost {
    now: u64,
    /// Nanoseconds from the usual beginning of virtual time to this host's.
    wall_clock_offset: i64,
    seed: u64,
    arguments: Vec<String>,
    input: VecDeque<Vec<u8>>,
    inbox: Inbox,
    /// Future contents of the inbox, by the times of arrival, the earliest first.
    arrivals: VecDeque<(u64, Incoming)>,
    captured: Captured,
    /// Number of bytes that may still be written to standard output before it breaks.
    output_limit: Option<usize>,
    rights: Rights,
}

impl Default for VirtualHost {
    fn default() -> VirtualHost {
        VirtualHost {
            now: 0,
            wall_clock_offset: 0,
            seed: 0,
            arguments: Vec::new(),
            input: VecDeque::new(),
            inbox: Inbox::new(),
            arrivals: VecDeque::new(),
            captured: Captured::default(),
            output_limit: None,
            rights: Rights::all(),
        }
    }
}

impl VirtualHost {
    /// Creates a host without input and files, at time zero.
    pub fn new() -> VirtualHost {
        VirtualHost::default()
    }

    /// Returns the captured output and the files.
    pub fn captured(&self) -> Captured {
        self.captured.clone()
    }

    /// Adds text to standard input, as one chunk; the input ends after the last.
    #[must_use]
    pub fn with_input(mut self, text: impl Into<Vec<u8>>) -> VirtualHost {
        let text = text.into();
        if !text.is_empty() {
            self.input.push_back(text);
        }
        self
    }

    /// Gives the program its arguments.
    #[must_use]
    pub fn with_arguments(mut self, arguments: Vec<String>) -> VirtualHost {
        self.arguments = arguments;
        self
    }

    /// Sets the seed.
    #[must_use]
    pub fn with_seed(mut self, seed: u64) -> VirtualHost {
        self.seed = seed;
        self
    }

    /// Sets the wall clock at time zero, in nanoseconds since 1970.
    #[must_use]
    pub fn with_wall_clock(mut self, start: i64) -> VirtualHost {
        self.wall_clock_offset = start.saturating_sub(VIRTUAL_BEGINNING);
        self
    }

    /// Adds a file.
    #[must_use]
    pub fn with_file(self, path: &str, contents: impl Into<Vec<u8>>) -> VirtualHost {
        self.captured.contents().files.insert(path.to_owned(), contents.into());
        self
    }

    /// Has something come into the inbox at a time in nanoseconds.
    #[must_use]
    pub fn with_arrival(mut self, time: u64, incoming: Incoming) -> VirtualHost {
        let at = self.arrivals.partition_point(|&(other, _)| other <= time);
        self.arrivals.insert(at, (time, incoming));
        self.move_to(self.now);
        self
    }

    /// Moves the clock, and lets into the inbox what comes until then.
    fn move_to(&mut self, now: u64) {
        self.now = now;
        while self.arrivals.front().is_some_and(|&(time, _)| time <= now)
            && let Some((_, incoming)) = self.arrivals.pop_front()
        {
            self.inbox.put(incoming);
        }
    }

    /// Breaks standard output after this number of bytes.
    #[must_use]
    pub fn with_output_limit(mut self, bytes: usize) -> VirtualHost {
        self.output_limit = Some(bytes);
        self
    }

    /// Grants these rights only.
    #[must_use]
    pub fn with_rights(mut self, rights: Rights) -> VirtualHost {
        self.rights = rights;
        self
    }
}

impl Host for VirtualHost {
    fn monotonic(&mut self) -> u64 {
        self.now
    }

    fn wall_clock(&mut self) -> i64 {
        VIRTUAL_BEGINNING.saturating_add(self.wall_clock_offset).saturating_add_unsigned(self.now)
    }

    fn wait(&mut self, deadline: Option<u64>, awaited: Awaited) -> Wake {
        if awaited.input {
            // Input is available or has ended; there is nothing to wait for.
            return Wake::Arrival;
        }
        if self.inbox.is_rung() {
            return self.inbox.why_rung();
        }
        match (deadline, self.arrivals.front()) {
            (deadline, Some(&(arrival, _))) if deadline.is_none_or(|deadline| arrival <= deadline) => {
                self.move_to(self.now.max(arrival));
                Wake::Arrival
            }
            (Some(deadline), _) => {
                self.move_to(self.now.max(deadline));
                Wake::Time
            }
            // Operations take no virtual time: those that another thread performs are waited for.
            (None, _) if awaited.news && self.inbox.wait(None) => self.inbox.why_rung(),
            (None, _) => Wake::Never,
        }
    }

    fn is_virtual(&self) -> bool {
        true
    }

    fn advance(&mut self, nanoseconds: u64) {
        self.move_to(self.now.saturating_add(nanoseconds));
    }

    fn seed(&mut self) -> u64 {
        self.seed
    }

    fn arguments(&mut self) -> Vec<String> {
        self.arguments.clone()
    }

    fn write(&mut self, output: Output, bytes: &[u8]) -> Result<(), HostError> {
        let limit = match output {
            Output::Standard => self.output_limit.unwrap_or(usize::MAX),
            Output::Error => usize::MAX,
        };
        let taken = bytes.len().min(limit);
        self.captured.append(output, &bytes[..taken]);
        if output == Output::Standard {
            self.output_limit = self.output_limit.map(|limit| limit - taken);
        }
        if taken < bytes.len() { Err(HostError::BrokenPipe) } else { Ok(()) }
    }

    fn read_input(&mut self) -> Input {
        self.input.pop_front().map_or(Input::End, Input::Data)
    }

    fn permit(&mut self, right: Right, object: &str, narrowed: &[Rights]) -> Permit {
        permit(&self.rights, narrowed, right, object, &resolve_as_text)
    }

    fn read_file(&mut self, path: &str) -> Result<Vec<u8>, HostError> {
        self.captured.file(path).ok_or(HostError::NotFound)
    }

    fn write_file(&mut self, path: &str, bytes: &[u8], mode: WriteMode) -> Result<(), HostError> {
        let mut contents = self.captured.contents();
        if mode == WriteMode::Create && contents.files.contains_key(path) {
            return Err(HostError::Exists);
        }
        let file = contents.files.entry(path.to_owned()).or_default();
        if mode == WriteMode::Replace {
            file.clear();
        }
        file.extend_from_slice(bytes);
        Ok(())
    }

    fn file_exists(&mut self, path: &str) -> bool {
        self.captured.contents().files.contains_key(path)
    }

    fn delete_file(&mut self, path: &str) -> Result<(), HostError> {
        self.captured.contents().files.remove(path).map(|_| ()).ok_or(HostError::NotFound)
    }

    /// Folders are there as far as files are in them. Files have been written now.
    fn request_of_files(&mut self, request: FileRequest<'_>) -> Result<FileAnswer, HostError> {
        let now = self.wall_clock();
        let mut contents = self.captured.contents();
        match request {
            FileRequest::List(folder) => {
                let prefix = if folder.is_empty() { String::new() } else { format!("{folder}/") };
                let below = contents.files.keys().filter_map(|path| path.strip_prefix(&prefix));
                let mut names: Vec<String> = below
                    .map(|rest| match rest.split_once('/') {
                        Some((folder, _)) => format!("{folder}/"),
                        None => rest.to_owned(),
                    })
                    .collect();
                names.sort();
                names.dedup();
                Ok(FileAnswer::Names(names))
            }
            FileRequest::Rename(from, to) => {
                let file = contents.files.remove(from).ok_or(HostError::NotFound)?;
                contents.files.insert(to.to_owned(), file);
                Ok(FileAnswer::Done(true))
            }
            FileRequest::Date(path) if contents.files.contains_key(path) => {
                Ok(FileAnswer::Date(now.div_euclid(1_000_000_000)))
            }
            FileRequest::Date(_) => Err(HostError::NotFound),
            FileRequest::TrueName(path) if contents.files.contains_key(path) => {
                Ok(FileAnswer::Names(vec![path.to_owned()]))
            }
            FileRequest::TrueName(path) => {
                let folder = if path.is_empty() { String::new() } else { format!("{path}/") };
                let is_there = contents.files.keys().any(|name| name.starts_with(&folder));
                if is_there { Ok(FileAnswer::Names(vec![folder])) } else { Err(HostError::NotFound) }
            }
            FileRequest::MakeFolders(_) => Ok(FileAnswer::Done(false)),
        }
    }

    fn inbox(&self) -> Inbox {
        self.inbox.clone()
    }

    fn save(&self) -> Option<HostState> {
        Some(HostState(Box::new(VirtualState {
            now: self.now,
            input: self.input.clone(),
            arrivals: self.arrivals.clone(),
            contents: self.captured.contents().clone(),
            output_limit: self.output_limit,
        })))
    }

    fn restore(&mut self, HostState(state): &HostState) -> bool {
        let Some(state) = state.downcast_ref::<VirtualState>() else { return false };
        let VirtualState { now, input, arrivals, contents, output_limit } = state;
        self.now = *now;
        self.input.clone_from(input);
        self.arrivals.clone_from(arrivals);
        *self.captured.contents() = contents.clone();
        self.output_limit = *output_limit;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_jumps_to_what_happens_first() {
        let mut host = VirtualHost::new().with_wall_clock(1000).with_arrival(70, Incoming::Stop);
        assert_eq!(host.wait(Some(50), Awaited::default()), Wake::Time);
        assert_eq!((host.monotonic(), host.wall_clock()), (50, 1050));
        assert!(host.due(51).is_none() && !host.inbox().is_rung());
        assert_eq!(host.wait(Some(100), Awaited::default()), Wake::Arrival);
        assert_eq!((host.due(60), host.poll(1).len()), (Some(70), 1));
        assert_eq!(host.wait(None, Awaited::default()), Wake::Never);
        host.advance(5);
        assert_eq!(host.monotonic(), 75);
    }

    #[test]
    fn input_is_given_in_chunks_and_output_can_break() {
        let mut host = VirtualHost::new().with_input("a\n").with_input("b").with_output_limit(3);
        let captured = host.captured();
        assert_eq!(host.read_input(), Input::Data(b"a\n".to_vec()));
        assert_eq!(host.read_input(), Input::Data(b"b".to_vec()));
        assert_eq!(host.read_input(), Input::End);
        assert_eq!(host.write(Output::Standard, b"xy"), Ok(()));
        assert_eq!(host.write(Output::Standard, b"z!"), Err(HostError::BrokenPipe));
        assert_eq!(captured.output(), "xyz");
    }

    #[test]
    fn what_was_written_is_known_in_its_order() {
        let mut host = VirtualHost::new();
        let captured = host.captured();
        for (output, text) in [(Output::Standard, "ab"), (Output::Error, "!"), (Output::Standard, "c")] {
            host.write(output, text.as_bytes()).expect("there is room");
            host.write(output, b".").expect("there is room");
        }
        let after = |bytes| {
            let pieces = captured.pieces_after(bytes).into_iter();
            pieces.map(|(_, bytes)| String::from_utf8(bytes).expect("it is text")).collect::<Vec<_>>()
        };
        assert_eq!(after(0), ["ab.", "!.", "c."]);
        assert_eq!(after(4), [".", "c."]);
        assert!(after(7).is_empty());
    }

    #[test]
    fn files_are_those_that_were_given_or_written() {
        let mut host = VirtualHost::new().with_file("a", "1");
        assert_eq!(host.read_file("a"), Ok(b"1".to_vec()));
        assert_eq!(host.read_file("b"), Err(HostError::NotFound));
        assert_eq!(host.write_file("a", b"2", WriteMode::Create), Err(HostError::Exists));
        assert_eq!(host.write_file("a", b"2", WriteMode::Append), Ok(()));
        assert_eq!(host.captured().file("a"), Some(b"12".to_vec()));
        assert_eq!(host.write_file("a", b"3", WriteMode::Replace), Ok(()));
        assert_eq!(host.read_file("a"), Ok(b"3".to_vec()));
        assert_eq!(host.delete_file("a"), Ok(()));
        assert!(!host.file_exists("a"));
        assert_eq!(host.permit(Right::Read, "./b/../a", &[]), Permit::Granted("a".into()));
    }
}
