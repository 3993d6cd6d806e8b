//! The journal while it is written.
//!
//! Guarantees: [`JournalLog::commit`] returns true only if all earlier records are as safe as the run
//! demands. After an error nothing is written any more, and every effect is refused: a system that has
//! dropped data does not write them at a second try.

use std::collections::HashSet;
use std::io;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

use esl_host::{ActionId, Inbox, NotedRecord, Record, Recorder, RunCheck, StateKeeper};
use esl_replay::{
    Beginning, JournalGeneration, JournalLife, JournalWriter, OpenCall, RecordedEnd, StoredCall,
    journal_beginning, journal_end, journal_life, journal_saved,
};
use esl_vm::heap::HeapMemory;

use super::disk::{Disk, SnapshotWriting};
use super::lasting::REPEATED;
use super::standing::Standing;
use super::{Durability, DurableError, LogFigures};

/// Bytes of records that wait at most.
const BUFFER: usize = 64 << 10;
/// Bytes that an operation can save at most.
const MOST_SAVED: usize = 64 << 20;
/// Bytes of states of operations after which the machine is rung, so that it can take a snapshot.
const UNSEEN: u64 = 64 << 10;

/// The state of a journal that is being written.
struct LogWriting {
    disk: Box<dyn Disk>,
    writer: JournalWriter,
    durability: Durability,
    /// Length of the file.
    written: u64,
    /// Length of the part of it that is on the disk.
    synced: u64,
    /// Whether the records that are not yet safe have an answer that another process might not get again.
    is_dear: bool,
    /// The process that writes; `None` before it has begun to.
    life: Option<JournalLife>,
    standing: Standing,
    /// The program of an upgrade, bytes of an `.eslb` file, whose call is among the records that wait or come
    /// next.
    upgrade: Option<Vec<u8>>,
    /// Number of effects of this process.
    effects: u64,
    /// Number of records of the run before this generation.
    begun_at: u64,
    error: Option<DurableError>,
    /// Rung when there is an error, so that the machine comes back.
    inbox: Option<Inbox>,
    /// Bytes of states of operations since the machine was rung because of them.
    unseen: u64,
    figures: LogFigures,
}

/// A journal that is being written. Clones write the same one.
#[derive(Clone)]
pub(crate) struct JournalLog(Arc<Mutex<LogWriting>>);

impl JournalLog {
    /// Creates the log of a journal that has `length` good bytes, which the disk has.
    pub(crate) fn new(
        disk: Box<dyn Disk>,
        writer: JournalWriter,
        length: u64,
        durability: Durability,
        standing: Standing,
    ) -> JournalLog {
        JournalLog(Arc::new(Mutex::new(LogWriting {
            disk,
            writer,
            durability,
            written: length,
            synced: length,
            is_dear: false,
            life: None,
            standing,
            upgrade: None,
            effects: 0,
            begun_at: 0,
            error: None,
            inbox: None,
            unseen: 0,
            figures: LogFigures::default(),
        })))
    }

    fn lock(&self) -> MutexGuard<'_, LogWriting> {
        // Each frame is written whole or not at all, so a panic elsewhere does not corrupt the journal.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Names the inbox of the machine.
    pub(crate) fn set_inbox(&self, inbox: Inbox) {
        self.lock().inbox = Some(inbox);
    }

    /// Makes the file of a new run. Records that were made before follow.
    pub(crate) fn create(&self, beginning: &Beginning, life: JournalLife) {
        let mut writing = self.lock();
        let mut bytes = journal_beginning(beginning);
        let mark = bytes.len() as u64;
        bytes.extend(journal_life(&life, mark));
        let created = writing.disk.create(&bytes);
        writing.hear(created);
        (writing.written, writing.synced) = (bytes.len() as u64, bytes.len() as u64);
        writing.life = Some(life);
        writing.standing.beginning = Some(beginning.clone());
    }

    /// Notes that a call is under way.
    pub(crate) fn note_open(&self, call: OpenCall) {
        self.lock().standing.open.insert(call.number, call);
    }

    /// Forgets the calls under way that have ended.
    pub(crate) fn forget_ended(&self, ended: &HashSet<u64>) {
        self.lock().standing.open.retain(|number, _| !ended.contains(number));
    }

    /// Returns the bytes of the journal of this generation, with the records that wait.
    pub(crate) fn bytes(&self) -> u64 {
        self.lock().written
    }

    /// Returns whether this generation has records of the run.
    pub(crate) fn has_records(&self) -> bool {
        let writing = self.lock();
        writing.standing.records > writing.begun_at
    }

    /// Begins the journal of the next generation at this place. The calls with these numbers are under way,
    /// and these calls last.
    /// Returns its number. After an error the run goes on in the same journal.
    ///
    /// # Errors
    /// If it cannot be made.
    pub(crate) fn begin_generation(
        &self,
        open: &[u64],
        lasting: Vec<StoredCall>,
        not_due: u64,
    ) -> io::Result<u64> {
        let mut writing = self.lock();
        writing.write();
        writing.sync();
        let LogWriting { standing, writer, life, error, .. } = &mut *writing;
        let (Some(beginning), Some(life), None) = (&standing.beginning, *life, error) else {
            return Err(io::Error::other("the journal before it cannot be written"));
        };
        standing.open.retain(|number, _| open.contains(number));
        standing.saved.retain(|number, _| open.contains(number));
        let mut generation = JournalGeneration::default();
        generation.number = standing.number + 1;
        generation.life = life;
        generation.records = standing.records;
        generation.effects = standing.effects;
        generation.upgrades = standing.upgrades;
        generation.senders = standing.senders;
        generation.asked = standing.asked;
        generation.not_due = not_due;
        generation.arguments.clone_from(&standing.arguments);
        generation.open = standing.open.values().cloned().collect();
        generation.saved = standing.saved.iter().map(|(&number, state)| (number, state.clone())).collect();
        generation.lasting = lasting;
        let (number, records) = (generation.number, generation.records);
        let contents = writer.begin_generation(beginning, generation);
        if let Err(error) = writing.disk.begin_generation(number, &contents) {
            // The next process must not find a part of it.
            if let Err(error) = writing.disk.remove_generation(number)
                && error.kind() != io::ErrorKind::Unsupported
            {
                writing.fail(DurableError::NotWritten(error));
            }
            return Err(error);
        }
        writing.standing.number = number;
        writing.begun_at = records;
        (writing.written, writing.synced) = (contents.len() as u64, contents.len() as u64);
        Ok(number)
    }

    /// Begins to write a snapshot.
    ///
    /// # Errors
    /// If that cannot be begun.
    pub(crate) fn write_snapshot(
        &self,
        number: u64,
        head: Vec<u8>,
        memory: &HeapMemory<'_>,
    ) -> io::Result<SnapshotWriting> {
        let mut writing = self.lock();
        let obsolete = writing.standing.oldest..writing.standing.base;
        writing.disk.write_snapshot(number, head, memory, obsolete)
    }

    /// Lets the run go on from a snapshot that was written, which has made all obsolete but the last two
    /// generations from which it can go on.
    pub(crate) fn keep_snapshot(&self, number: u64) {
        let standing = &mut self.lock().standing;
        standing.oldest = standing.oldest.max(standing.base);
        standing.base = number;
    }

    /// Notes that this process goes on with the run, or pauses it.
    pub(crate) fn note_life(&self, life: JournalLife) {
        let mut writing = self.lock();
        writing.write();
        let mark = writing.mark();
        writing.append(&journal_life(&life, mark));
        writing.life = Some(life);
    }

    /// Cuts off the torn tail of the file, behind `length` good bytes.
    pub(crate) fn truncate(&self, length: u64) {
        let mut writing = self.lock();
        let truncated = writing.disk.truncate(length);
        writing.hear(truncated);
    }

    /// Syncs the file if the run survives loss of power: another process may have left parts to the system.
    pub(crate) fn sync_found(&self) {
        let mut writing = self.lock();
        if writing.durability == Durability::Power {
            let synced = writing.disk.sync();
            writing.hear(synced);
        }
    }

    /// Notes that the records from here on are those of another program, given as in an `.eslb` file. The
    /// next ones are written in one frame with it.
    pub(crate) fn begin_upgrade(&self, program: Vec<u8>) {
        let mut writing = self.lock();
        writing.write();
        writing.standing.upgrades += 1;
        if let Some(beginning) = &mut writing.standing.beginning {
            beginning.program.clone_from(&program);
        }
        writing.upgrade = Some(program);
    }

    /// Notes that the run has this program after all, since an upgrade has failed.
    pub(crate) fn return_to(&self, program: Vec<u8>) {
        self.begin_upgrade(program);
        self.write();
    }

    /// Stops the run with this error.
    pub(crate) fn fail(&self, error: DurableError) {
        self.lock().fail(error);
    }

    /// Returns the process that writes, once it has begun to.
    pub(crate) fn life(&self) -> Option<JournalLife> {
        self.lock().life
    }

    /// Notes the end of the run, and syncs the file.
    pub(crate) fn end(&self, check: RunCheck, status: u8) {
        let mut writing = self.lock();
        writing.write();
        writing.sync();
        writing.append(&journal_end(&RecordedEnd { status, check }));
        writing.sync();
    }

    /// Returns whether an operation has saved a state.
    pub(crate) fn has_saved(&self, operation: u64) -> bool {
        self.lock().standing.saved.contains_key(&operation)
    }

    /// Returns the keeper of the states of operations. It does not keep the journal open.
    pub(crate) fn state_keeper(&self) -> impl StateKeeper + use<> {
        LogKeeper(Arc::downgrade(&self.0))
    }

    /// Returns whether calls of the outside are under way.
    pub(crate) fn has_open_calls(&self) -> bool {
        !self.lock().standing.open.is_empty()
    }

    /// Returns whether the run survives loss of power.
    pub(crate) fn survives_loss_of_power(&self) -> bool {
        self.lock().durability == Durability::Power
    }

    /// Returns the number of the generation that is written, and the length of its journal.
    pub(crate) fn place(&self) -> (u64, u64) {
        let writing = self.lock();
        (writing.standing.number, writing.written)
    }

    /// Writes the waiting records, and makes all as safe as the run demands.
    pub(crate) fn leave(&self) {
        self.commit();
    }

    /// Writes the waiting records, and syncs the file.
    pub(crate) fn finish(&self) {
        let mut writing = self.lock();
        writing.write();
        writing.sync();
    }

    /// Writes the waiting records.
    pub(crate) fn write(&self) {
        self.lock().write();
    }

    /// Makes everything that was noted safe. Returns whether it is.
    pub(crate) fn commit(&self) -> bool {
        let mut writing = self.lock();
        writing.write();
        if writing.durability == Durability::Power && writing.synced < writing.written {
            writing.sync();
        }
        writing.is_safe()
    }

    /// As [`JournalLog::commit`], for output, which is printed again if the journal does not have its answer.
    /// Only the answers on which the output may depend have to be safe.
    pub(crate) fn commit_for_output(&self) -> bool {
        if self.lock().is_dear {
            return self.commit();
        }
        self.lock().is_safe()
    }

    /// Returns an identity for the next effect.
    pub(crate) fn next_action(&self) -> ActionId {
        let mut writing = self.lock();
        writing.effects += 1;
        let chance = writing.life.map_or(0, |life| life.chance);
        ActionId(u128::from(chance) << 64 | u128::from(writing.effects))
    }

    /// Returns whether a write has failed.
    pub(crate) fn has_failed(&self) -> bool {
        self.lock().error.is_some()
    }

    /// Takes the error of a write.
    pub(crate) fn take_error(&self) -> Option<DurableError> {
        self.lock().error.take()
    }

    /// Returns figures.
    pub(crate) fn figures(&self) -> LogFigures {
        let writing = self.lock();
        LogFigures { bytes: writing.written, effects: writing.effects, ..writing.figures }
    }
}

/// Keeps the states of operations in the journal: not among the records, since the program does not see
/// them, and so a replay need not.
struct LogKeeper(Weak<Mutex<LogWriting>>);

impl LogKeeper {
    fn log(&self) -> Option<JournalLog> {
        self.0.upgrade().map(JournalLog)
    }
}

impl StateKeeper for LogKeeper {
    fn save(&self, operation: u64, state: &[u8]) -> bool {
        // A call that lasts is made again as a whole.
        operation > REPEATED || self.log().is_some_and(|log| log.lock().save(operation, state))
    }

    fn restore(&self, operation: u64) -> Option<Vec<u8>> {
        self.log()?.lock().standing.saved.get(&operation).cloned()
    }
}

impl LogWriting {
    /// Keeps the state of an operation under way. Records that wait stay, since the state does not depend on
    /// them: the intent of the operation was written before.
    fn save(&mut self, operation: u64, state: &[u8]) -> bool {
        if !self.standing.open.contains_key(&operation) || state.len() > MOST_SAVED {
            return false;
        }
        let bytes = journal_saved(operation, state, self.mark());
        self.append(&bytes);
        // A machine that waits for the operation alone would take no snapshot, and the journal would grow.
        self.unseen += bytes.len() as u64;
        if self.unseen > UNSEEN {
            self.unseen = 0;
            self.ring();
        }
        if self.durability == Durability::Power {
            self.sync();
        }
        if self.error.is_none() {
            self.standing.saved.insert(operation, state.to_vec());
        }
        self.error.is_none()
    }

    fn is_safe(&self) -> bool {
        self.error.is_none() && self.life.is_some()
    }

    fn fail(&mut self, error: DurableError) {
        self.error.get_or_insert(error);
        self.ring();
    }

    fn ring(&self) {
        if let Some(inbox) = &self.inbox {
            inbox.ring();
        }
    }

    fn hear(&mut self, result: io::Result<()>) {
        if let Err(error) = result {
            self.fail(DurableError::NotWritten(error));
        }
    }

    /// Returns the length of the part of the file that is safe.
    fn mark(&self) -> u64 {
        match self.durability {
            Durability::Process => self.written,
            Durability::Power => self.synced,
        }
    }

    fn append(&mut self, bytes: &[u8]) {
        if self.error.is_none() {
            let appended = self.disk.append(bytes);
            self.hear(appended);
            self.written += bytes.len() as u64;
            self.figures.writes += 1;
        }
    }

    /// Writes the waiting records.
    fn write(&mut self) {
        if self.life.is_none() {
            return;
        }
        if let Some(program) = self.upgrade.take() {
            let mark = self.mark();
            let bytes = self.writer.take_upgrade(mark, &program);
            self.append(&bytes);
        } else if !self.writer.is_empty() {
            let mark = self.mark();
            let bytes = self.writer.take(mark);
            self.append(&bytes);
        }
        // The kernel has the records, which is enough unless the run survives loss of power.
        self.is_dear &= self.durability == Durability::Power;
    }

    fn sync(&mut self) {
        if self.error.is_none() {
            let synced = self.disk.sync();
            self.hear(synced);
            self.synced = self.written;
            self.is_dear = false;
            self.figures.syncs += 1;
        }
    }
}

/// Returns whether another process might get another answer than this one.
fn is_dear(record: &Record) -> bool {
    !matches!(record, Record::Written(Ok(())) | Record::PassedOn(Ok(_)) | Record::Checked(_))
}

impl Recorder for JournalLog {
    fn note(&self, noted: NotedRecord) {
        let mut writing = self.lock();
        if writing.error.is_none() {
            writing.is_dear |= is_dear(&noted.record);
            writing.standing.hear(&noted.record);
            if writing.writer.add(&noted) > BUFFER {
                writing.write();
            }
        }
    }

    fn flush(&self) {
        self.write();
    }

    fn break_off(&self) {
        self.lock().fail(DurableError::MemoryRefused);
    }
}
