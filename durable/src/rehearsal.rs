//! Rehearsals: the last stretch of a run, taken once more by another version of its program.
//!
//! A copy of the run as it was is upgraded, and goes on from there in a world of scripts: messages, signals
//! and requests come when they came, and a call gets the answer that the run had for the same call. Another
//! call fails with `:not-in-this-world`, since its answer is unknown, and the rehearsal names it. Nothing is
//! written, and nothing leaves.

use std::collections::{HashMap, VecDeque};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use esl::program::{self, Program};
use esl_bytecode::datum::Datum;
use esl_compiler::diagnostic::Sources;
use esl_host::{
    ActionId, Awaited, Captured, FileAnswer, FileRequest, Host, HostCall, HostError, HostFailure, Inbox,
    Incoming, Input, News, NotedRecord, Output, Permit, QuestionHash, Record, Right, Rights, VirtualHost,
    Wake, WriteMode,
};
use esl_replay::begin_recorded;
use esl_vm::run::RunOutcome;
use esl_vm::task::TaskId;
use esl_vm::vm::Vm;

use super::changes::ProgramChanges;
use super::fork::fork;
use super::generations;
use super::resume::{Resumption, wall_clock};
use super::upgrade::{PATIENCE, STRETCH, UpgradeReport};
use super::{Downtime, DurableError, DurableRun};

/// Calls that are named.
const NAMED: usize = 5;

/// The course that another version of a program has taken with the last stretch of a run.
#[derive(Clone, Debug, Default)]
pub struct Rehearsal {
    /// The changes of the program.
    pub changes: ProgramChanges,
    /// The upgrade at its beginning; `None` if the stretch is the whole run, which begins with the other
    /// program then.
    pub upgrade: Option<UpgradeReport>,
    /// Its time, by the clock of the run.
    pub stretch: Duration,
    /// Number of messages, signals and requests that have come.
    pub arrivals: usize,
    /// Number of calls of the host that the run has made too.
    pub alike: usize,
    /// Number of calls that it has not made.
    pub others: usize,
    /// The first of these, with the seconds from the beginning.
    pub named: Vec<(f64, String)>,
    /// Number of calls of the run that were not made.
    pub left_out: usize,
    /// Everything that was written to the error output: failures, warnings.
    pub errors: String,
    /// The status with which the program has ended, if it has before the stretch was over.
    pub ended: Option<u8>,
}

/// The answers of the run, and the calls that were made.
#[derive(Default)]
struct PastScript {
    /// Outcomes of operations, and the time that they have taken, by the calls.
    outcomes: HashMap<u32, VecDeque<(u64, News)>>,
    /// Answers of functions and files, by the questions.
    answers: HashMap<u32, VecDeque<Record>>,
    begun: u64,
    alike: usize,
    others: usize,
    named: Vec<(f64, String)>,
}

impl PastScript {
    fn answer(&mut self, question: QuestionHash) -> Option<Record> {
        self.answers.get_mut(&question.0)?.pop_front()
    }

    /// Notes a call that the run has not made.
    fn note_other(&mut self, now: u64, call: HostCall<'_>) {
        self.others += 1;
        if self.named.len() < NAMED {
            let words: Vec<String> = call.arguments.iter().map(Datum::to_string).collect();
            let text = format!("({} {})", call.name, words.join(" "));
            let seconds = now.saturating_sub(self.begun) as f64 / 1e9;
            self.named.push((seconds, text.replace(" )", ")")));
        }
    }

    fn left(&self) -> usize {
        let calls = self.answers.values().flatten().filter(|record| matches!(record, Record::Called(_)));
        calls.count() + self.outcomes.values().map(VecDeque::len).sum::<usize>()
    }
}

/// Events that one look into the inbox has found, and the time of it.
struct PastBatch {
    time: u64,
    contents: Vec<Incoming>,
}

/// The outside of a rehearsal.
struct ScriptedHost {
    inner: VirtualHost,
    script: Arc<Mutex<PastScript>>,
    /// Batches that have not come yet.
    batches: VecDeque<PastBatch>,
    /// The time of the batch that comes next, if `inner` has it.
    next: Option<u64>,
}

impl ScriptedHost {
    /// Lets the next batch come. Only one comes at a time: batches that have the same time in the records
    /// were found one after the other, and a signal is lost on a task that does not wait yet.
    fn let_come(&mut self) {
        let now = self.inner.monotonic();
        if self.inner.inbox().is_rung() || self.next.is_some_and(|time| time > now) {
            return;
        }
        self.next = self.batches.pop_front().map(|batch| {
            for incoming in batch.contents {
                self.arrive(batch.time, incoming);
            }
            batch.time
        });
    }

    fn arrive(&mut self, time: u64, incoming: Incoming) {
        let inner = std::mem::take(&mut self.inner);
        self.inner = inner.with_arrival(time, incoming);
    }
}

fn lock(script: &Mutex<PastScript>) -> MutexGuard<'_, PastScript> {
    // Each change is made whole, so a panic elsewhere does not corrupt it.
    script.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A world that acts as it did in a stretch of a run.
struct World {
    script: Arc<Mutex<PastScript>>,
    captured: Captured,
    arrivals: usize,
    stretch: Duration,
}

impl World {
    /// Creates the world of these records, from `begun` until `end`, and the outside that it is.
    fn of(records: &[NotedRecord], begun: u64, end: u64) -> (World, ScriptedHost) {
        let mut script = PastScript { begun, ..PastScript::default() };
        let mut inner = VirtualHost::new();
        inner.advance(begun);
        let (mut now, mut arrivals) = (begun, 0);
        let mut calls: HashMap<u64, (u32, u64)> = HashMap::new();
        let mut batches = VecDeque::new();
        for noted in records {
            match &noted.record {
                Record::Monotonic(time) | Record::Due((_, time)) => now = now.max(*time),
                Record::Arguments(arguments) => inner = inner.with_arguments(arguments.clone()),
                Record::Seed(seed) => inner = inner.with_seed(*seed),
                Record::Intended(intent) => {
                    if let Some(number) = intent.operation {
                        calls.insert(number, (noted.question.0, now));
                    }
                }
                Record::Called(_) | Record::FileRead(_) | Record::Exists(_) => {
                    script.answers.entry(noted.question.0).or_default().push_back(noted.record.clone());
                }
                Record::Received((_, contents)) => {
                    let mut batch = PastBatch { time: now, contents: Vec::new() };
                    for incoming in contents {
                        match incoming {
                            // It has the machine wait for what comes later.
                            Incoming::SenderCame | Incoming::Hosted => {
                                inner = inner.with_arrival(now, incoming.clone());
                                continue;
                            }
                            Incoming::Operation { news: News::Progress(_), .. }
                            | Incoming::Stop
                            | Incoming::Interlude
                            | Incoming::Watch
                            | Incoming::Pause(_) => continue,
                            Incoming::Operation { number, news } => {
                                if let Some((call, since)) = calls.remove(number) {
                                    let outcome = (now.saturating_sub(since), news.clone());
                                    script.outcomes.entry(call).or_default().push_back(outcome);
                                    continue;
                                }
                                // It was under way at the beginning.
                            }
                            Incoming::Message { .. } | Incoming::Signal(_) | Incoming::Question { .. } => {
                                arrivals += 1;
                            }
                            _ => {}
                        }
                        batch.contents.push(incoming.clone());
                    }
                    if !batch.contents.is_empty() {
                        batches.push_back(batch);
                    }
                }
                _ => {}
            }
        }
        batches.push_back(PastBatch { time: end.max(now), contents: vec![Incoming::Stop] });
        let (captured, stretch) = (inner.captured(), Duration::from_nanos(end.saturating_sub(begun)));
        let script = Arc::new(Mutex::new(script));
        let host = ScriptedHost { inner, script: script.clone(), batches, next: None };
        (World { script, captured, arrivals, stretch }, host)
    }

    /// Returns the course that a program has taken in it.
    fn rehearsal(
        &self,
        changes: ProgramChanges,
        upgrade: Option<UpgradeReport>,
        ended: Option<u8>,
    ) -> Rehearsal {
        let script = lock(&self.script);
        Rehearsal {
            changes,
            upgrade,
            stretch: self.stretch,
            arrivals: self.arrivals,
            alike: script.alike,
            others: script.others,
            named: script.named.clone(),
            left_out: script.left(),
            errors: self.captured.error().trim_end().to_owned(),
            ended,
        }
    }
}

impl Host for ScriptedHost {
    fn monotonic(&mut self) -> u64 {
        self.inner.monotonic()
    }

    fn wall_clock(&mut self) -> i64 {
        self.inner.wall_clock()
    }

    fn wait(&mut self, deadline: Option<u64>, awaited: Awaited) -> Wake {
        self.let_come();
        // Everything that comes is in the script.
        self.inner.wait(deadline, Awaited { input: false, ..awaited })
    }

    fn advance(&mut self, nanoseconds: u64) {
        self.inner.advance(nanoseconds);
    }

    fn seed(&mut self) -> u64 {
        self.inner.seed()
    }

    fn arguments(&mut self) -> Vec<String> {
        self.inner.arguments()
    }

    fn write(&mut self, output: Output, bytes: &[u8]) -> Result<(), HostError> {
        self.inner.write(output, bytes)
    }

    fn read_input(&mut self) -> Input {
        self.inner.read_input()
    }

    fn permit(&mut self, right: Right, object: &str, narrowed: &[Rights]) -> Permit {
        self.inner.permit(right, object, narrowed)
    }

    fn read_file(&mut self, path: &str) -> Result<Vec<u8>, HostError> {
        match lock(&self.script).answer(QuestionHash::of_path(path)) {
            Some(Record::FileRead(answer)) => answer,
            _ => self.inner.read_file(path),
        }
    }

    fn write_file(&mut self, path: &str, bytes: &[u8], mode: WriteMode) -> Result<(), HostError> {
        self.inner.write_file(path, bytes, mode)
    }

    fn file_exists(&mut self, path: &str) -> bool {
        match lock(&self.script).answer(QuestionHash::of_path(path)) {
            Some(Record::Exists(answer)) => answer,
            _ => self.inner.file_exists(path),
        }
    }

    fn delete_file(&mut self, path: &str) -> Result<(), HostError> {
        self.inner.delete_file(path)
    }

    fn request_of_files(&mut self, request: FileRequest<'_>) -> Result<FileAnswer, HostError> {
        self.inner.request_of_files(request)
    }

    fn call(
        &mut self,
        call: HostCall<'_>,
        _function: &mut dyn FnMut(&[Datum]) -> Result<Datum, HostFailure>,
    ) -> Result<Datum, HostFailure> {
        let mut script = lock(&self.script);
        match script.answer(QuestionHash::of_call(call.name, call.arguments)) {
            Some(Record::Called(answer)) => {
                script.alike += 1;
                answer
            }
            _ => {
                let now = self.inner.monotonic();
                script.note_other(now, call);
                Err(HostFailure::new("NOT-IN-THIS-WORLD", call.name))
            }
        }
    }

    fn begin(&mut self, call: HostCall<'_>, _function: &mut dyn FnMut(&[Datum], Option<ActionId>)) {
        let now = self.inner.monotonic();
        let number = call.operation.unwrap_or(0);
        let question = QuestionHash::of_call(call.name, call.arguments);
        let mut script = lock(&self.script);
        let outcome = script.outcomes.get_mut(&question.0).and_then(VecDeque::pop_front);
        let (time, news) = match outcome {
            Some(outcome) => {
                script.alike += 1;
                outcome
            }
            None => {
                script.note_other(now, call);
                (0, News::Failed(HostFailure::new("NOT-IN-THIS-WORLD", call.name)))
            }
        };
        drop(script);
        self.arrive(now.saturating_add(time), Incoming::Operation { number, news });
    }

    fn inbox(&self) -> Inbox {
        self.inner.inbox()
    }
}

/// A folder that is removed in the end.
struct PassingFolder(PathBuf);

impl Drop for PassingFolder {
    fn drop(&mut self) {
        // It is only a copy.
        drop(std::fs::remove_dir_all(&self.0));
    }
}

/// Tries another version of the program of a run on the last stretch of it: so much of its time, or as much
/// as its generations are kept. `None` if the run has this program.
///
/// # Errors
/// [`DurableError::NotUpgraded`], and the reasons for which a run does not go on.
pub fn rehearse(
    path: &Path,
    program: &Program,
    sources: &Sources,
    back: Duration,
) -> Result<Option<Rehearsal>, DurableError> {
    let run = DurableRun::open_to_look(path)?;
    let last = generations::last(path)?;
    let from_beginning = match generations::joined(path, 0, last) {
        // Its oldest journals are gone.
        Err(DurableError::NoRun(_)) => None,
        journal => Some(journal?).filter(|journal| u128::from(journal.time) <= back.as_nanos()),
    };
    let Some(whole) = from_beginning else {
        drop(run);
        return rehearse_end(path, program, sources, back);
    };
    let Some(changes) = run.changes_to(program, sources)? else { return Ok(None) };
    let mut beginning = whole.recorded.beginning.clone();
    beginning.program = run.upgrade_to(program, &changes)?.program;
    let (world, host) = World::of(&whole.recorded.records, 0, whole.time);
    let begun = begin_recorded(&beginning, program, Box::new(host));
    let (mut machine, main) = begun.map_err(DurableError::Machine)?;
    let ended = run_script(&mut machine, main, None)?;
    Ok(Some(world.rehearsal(changes, None, ended)))
}

/// Tries another version of the program of a run on the last stretch of it, by an upgrade of a copy.
fn rehearse_end(
    path: &Path,
    program: &Program,
    sources: &Sources,
    back: Duration,
) -> Result<Option<Rehearsal>, DurableError> {
    let name = format!("esl-rehearsal-{}-{:x}", std::process::id(), super::resume::chance());
    let copy = PassingFolder(std::env::temp_dir().join(name));
    match fork(path, &copy.0, back) {
        Err(DurableError::TooFarBack(kept)) => fork(path, &copy.0, kept)?,
        made => made?,
    };
    let rest = rest_of(path, &copy.0)?;
    let mut run = DurableRun::open_to_look(&copy.0)?;
    let Some(changes) = run.changes_to(program, sources)? else { return Ok(None) };
    let upgrade = run.upgrade_to(program, &changes)?;
    let Some(found) = run.found.take() else { return Ok(None) };
    let (world, host) = World::of(&rest.records, rest.begun, rest.end);
    let resumption = Resumption::new(&rest.life, rest.begun, wall_clock(), Downtime::Stops, None).untold();
    let tried = DurableRun::copy_of(&found.recorded, resumption, Some(upgrade));
    tried.control.set_rehearsal();
    let mut machine = tried.copied_machine_on(host)?;
    let report = tried.run_upgrade(&mut machine)?;
    let main = machine.main_task().ok_or(DurableError::NoBeginning)?;
    let ended = run_script(&mut machine, main, Some(&tried))?;
    Ok(Some(world.rehearsal(changes, Some(report), ended)))
}

/// The part of a run behind a copy of it.
struct RestOfRun {
    records: Vec<NotedRecord>,
    life: esl_replay::JournalLife,
    /// The clock at the end of the copy, and at that of the run.
    begun: u64,
    end: u64,
}

/// Returns the part of a run that its copy does not have.
fn rest_of(path: &Path, copy: &Path) -> Result<RestOfRun, DurableError> {
    let no_run = || DurableError::NoRun(path.into());
    let copied = generations::find(copy)?.ok_or_else(no_run)?;
    let whole = generations::joined(path, copied.base, generations::last(path)?)?;
    let known = copied.journal.recorded.records.len();
    let life = copied.journal.lives.last().copied().unwrap_or_default();
    let (begun, end) = (copied.journal.time.max(life.time), whole.time);
    Ok(RestOfRun { records: whole.recorded.records.iter().skip(known).cloned().collect(), life, begun, end })
}

/// Runs a machine in the world of its script. Returns the status with which it has ended, if it has before
/// that.
fn run_script(machine: &mut Vm, main: TaskId, run: Option<&DurableRun>) -> Result<Option<u8>, DurableError> {
    let mut left = PATIENCE;
    loop {
        let outcome = machine.run(STRETCH);
        run.map_or(Ok(()), DurableRun::check)?;
        left = left.saturating_sub(STRETCH);
        match outcome {
            RunOutcome::TicksUsed if left > 0 => {}
            RunOutcome::TicksUsed => {
                let reason = "the program computes without end on the past of the run";
                return Err(DurableError::NotUpgraded(reason.into()));
            }
            outcome => {
                machine.flush();
                if outcome == RunOutcome::Stopped {
                    return Ok(None);
                }
                let summary = program::finish(machine, main, outcome);
                return Ok(Some(summary.ended.exit_status()));
            }
        }
    }
}
