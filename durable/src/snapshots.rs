//! Taking snapshots of a run while it goes on.
//!
//! Between two rounds the next journal begins, and the process is forked; then the run goes on, while the
//! fork writes its memory. When that is on the disk, the generation before the last is removed.
//!
//! Guarantees: at each moment the files in the folder are enough to go on. A snapshot that cannot be taken or
//! written is left out: the journals cover it.

use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use esl_replay::{StoredCall, snapshot_head};
use esl_vm::stored::StateParts;
use esl_vm::vm::Vm;

use super::control::DurableControl;
use super::disk::SnapshotWriting;
use super::facts;
use super::lasting::LastingCalls;
use super::log::JournalLog;

/// When snapshots are taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SnapshotEvery {
    /// After a minute in which much has happened: to repeat it would take noticeable time.
    #[default]
    NeededMinute,
    /// After so much time, if there were records since.
    Time(Duration),
    /// After so many bytes of the journal.
    Bytes(u64),
    /// Never.
    Never,
}

/// Reads a time with its unit, such as `60s`, a size of the journal, such as `64M`, or `never`.
impl FromStr for SnapshotEvery {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<SnapshotEvery, &'static str> {
        if text == "never" {
            return Ok(SnapshotEvery::Never);
        }
        if let Ok(time) = humantime::parse_duration(text) {
            return Ok(SnapshotEvery::Time(time));
        }
        match esl::size::parse_size(text) {
            Ok(bytes) => Ok(SnapshotEvery::Bytes(bytes as u64)),
            Err(_) => Err("expected a time such as `60s`, a size of the journal such as `64M`, or `never`"),
        }
    }
}

/// The snapshots that this process has taken of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SnapshotFigures {
    /// Their number.
    pub taken: u64,
    /// Longest time for which the run has stood still for one.
    pub longest: Duration,
}

/// Ticks that take noticeable time to repeat.
const MANY_TICKS: u64 = 1_000_000;
/// Bytes of a journal that take noticeable time to repeat.
const MANY_BYTES: u64 = 256 << 10;
/// Rounds between two looks at the clock.
const ROUNDS: u32 = 8;
/// Rounds in which a pause waits for a state that can be stored.
const PATIENCE: u32 = 10_000;
/// Time after which a snapshot is tried again that could not be taken.
const SOON: Duration = Duration::from_millis(1);
/// Time after a snapshot that could not be begun, before the next is tried.
const RETRY: Duration = Duration::from_secs(10);

/// Takes the snapshots of a run. Clones are the same.
#[derive(Clone)]
pub(crate) struct SnapshotTaker(Arc<Mutex<Taking>>);

struct Taking {
    every: SnapshotEvery,
    log: JournalLog,
    control: DurableControl,
    lasting: LastingCalls,
    /// When the last snapshot was taken, or the run began here, and the ticks then.
    last: (Instant, u64),
    /// Time before which none is tried.
    not_before: Option<Instant>,
    rounds: u32,
    /// Rounds that a pause has waited.
    waited: u32,
    writing: Option<(u64, SnapshotWriting)>,
    figures: SnapshotFigures,
    /// The folder in which the facts are kept as a text.
    folder: Option<PathBuf>,
}

impl SnapshotTaker {
    pub(crate) fn new(
        every: SnapshotEvery,
        log: JournalLog,
        control: DurableControl,
        lasting: LastingCalls,
    ) -> SnapshotTaker {
        SnapshotTaker(Arc::new(Mutex::new(Taking {
            every,
            log,
            control,
            lasting,
            last: (Instant::now(), 0),
            not_before: None,
            rounds: 0,
            waited: 0,
            writing: None,
            figures: SnapshotFigures::default(),
            folder: None,
        })))
    }

    fn lock(&self) -> MutexGuard<'_, Taking> {
        // A snapshot is begun as a whole, so a panic elsewhere does not corrupt this.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Has the facts of the run written in this folder with each snapshot.
    pub(crate) fn keep_facts_in(&self, folder: &Path) {
        self.lock().folder = Some(folder.into());
    }

    /// Has a machine that is about to run take them.
    pub(crate) fn install(&self, machine: &mut Vm) {
        {
            let mut taking = self.lock();
            if taking.every == SnapshotEvery::Never || machine.heap_range().is_none() {
                return;
            }
            taking.last = (Instant::now(), machine.ticks());
            taking.control.expect_snapshots();
        }
        let taker = self.clone();
        machine.on_round(move |machine| taker.lock().look(machine));
    }

    /// Waits until the snapshot that is being written is on the disk.
    pub(crate) fn finish(&self) {
        self.lock().finish(true);
    }

    /// Returns figures.
    pub(crate) fn figures(&self) -> SnapshotFigures {
        self.lock().figures
    }
}

impl Taking {
    /// Takes a snapshot between two rounds, if it is time.
    fn look(&mut self, machine: &mut Vm) {
        if self.control.takes_pause() {
            return self.pause(machine);
        }
        self.rounds += 1;
        if self.rounds < ROUNDS && self.every == SnapshotEvery::NeededMinute {
            return;
        }
        self.rounds = 0;
        if self.writing.is_some() {
            return self.finish(false);
        }
        let now = Instant::now();
        if self.not_before.is_none_or(|time| now >= time)
            && self.is_time(now, machine)
            && self.control.is_settled()
        {
            self.take(machine);
        }
    }

    fn is_time(&self, now: Instant, machine: &Vm) -> bool {
        let (last, ticks) = self.last;
        match self.every {
            SnapshotEvery::Never => false,
            SnapshotEvery::Time(time) => now.duration_since(last) >= time && self.log.has_records(),
            SnapshotEvery::Bytes(bytes) => self.log.bytes() >= bytes,
            SnapshotEvery::NeededMinute => {
                now.duration_since(last) >= Duration::from_secs(60)
                    && (machine.ticks() - ticks >= MANY_TICKS || self.log.bytes() >= MANY_BYTES)
            }
        }
    }

    /// Takes a snapshot before the run pauses, in a round in which it is possible.
    fn pause(&mut self, machine: &mut Vm) {
        let is_wanted = match self.every {
            SnapshotEvery::NeededMinute => {
                machine.ticks() - self.last.1 >= MANY_TICKS || self.log.bytes() >= MANY_BYTES
            }
            _ => self.log.has_records(),
        };
        self.finish(true);
        self.waited += 1;
        let is_over =
            !is_wanted || (self.control.is_settled() && self.take(machine)) || self.waited > PATIENCE;
        if is_over || self.log.has_failed() {
            self.control.allow_pause();
        }
    }

    /// Takes a snapshot. Returns false if there is something under way that cannot be stored.
    fn take(&mut self, machine: &mut Vm) -> bool {
        let Some(range) = machine.heap_range().filter(|_| self.log.life().is_some()) else { return false };
        let begun = Instant::now();
        if machine.main_task().is_none() {
            return false;
        }
        let open = machine.open_operations();
        let lasting = self.lasting.stored(machine);
        let taken = machine.with_state(|state| self.begin(range, &open, lasting, state));
        let Some(()) = taken else {
            self.not_before = Some(Instant::now() + SOON);
            return false;
        };
        if let Some(Err(error)) =
            self.folder.as_ref().map(|folder| facts::keep(folder, machine, false, false))
        {
            self.control.warn(&format!("the facts cannot be written as a text: {error}"));
        }
        self.last = (Instant::now(), machine.ticks());
        self.figures.taken += 1;
        self.figures.longest = self.figures.longest.max(begun.elapsed());
        true
    }

    /// Begins the next generation of the journal, and to write its snapshot.
    fn begin(&mut self, range: usize, open: &[u64], lasting: Vec<StoredCall>, state: &StateParts<'_>) {
        match self.log.begin_generation(open, lasting, self.control.not_due()) {
            Ok(number) => {
                let head = snapshot_head(number, range, state);
                match self.log.write_snapshot(number, head, state.memory()) {
                    Ok(writing) => self.writing = Some((number, writing)),
                    Err(error) => self.control.warn(&format!("a snapshot cannot be written: {error}")),
                }
            }
            Err(error) => {
                self.not_before = Some(Instant::now() + RETRY);
                self.control.warn(&format!("a snapshot cannot be begun: {error}"));
            }
        }
    }

    /// Deals with the end of a snapshot's writing.
    fn finish(&mut self, waits: bool) {
        let Some((number, writing)) = self.writing.take_if(|(_, writing)| waits || writing.is_over()) else {
            return;
        };
        match writing.wait() {
            Ok(()) => self.log.keep_snapshot(number),
            Err(error) => self.control.warn(&format!("a snapshot cannot be written: {error}")),
        }
    }
}
