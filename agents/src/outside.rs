//! The outside of an agent: the system, with the letters that come for it, and its sleep.
//!
//! A [`DurableHost`](esl_durable::DurableHost) asks it only from the end of the journal on. A letter goes
//! into the inbox at the agent's next look; when that look is in the journal, the letter is answered. An
//! agent that has waited long enough is asked to come back, so that it can be put to sleep.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use esl_bytecode::datum::Datum;
use esl_durable::{DurableControl, DurableJournal};
use esl_host::{
    ActionId, Awaited, FileAnswer, FileRequest, Host, HostCall, HostError, HostFailure, Inbox, Incoming,
    Input, Output, Permit, ProcessSignal, RealHost, Right, Rights, RunCheck, SendError, Wake, WriteMode,
};

use super::error::AgentError;
use super::mailbox::{AgentMailbox, LetterContents, LettersUnderWay};

/// Time that an agent sleeps at least, where others wait for its place.
const SHORTEST: Duration = Duration::from_millis(50);

/// State of an agent that is awake, shared with its thread.
#[derive(Default)]
pub(crate) struct AwakeFlags {
    /// Whether it has waited long enough to be put to sleep.
    pub(crate) may_sleep: AtomicBool,
    /// Whether its run is over but for the cleanups.
    pub(crate) is_ending: AtomicBool,
    /// How often it could not be put to sleep, since it had ties to the process.
    pub(crate) refusals: AtomicU32,
    /// Whether another agent waits for its addresses.
    pub(crate) is_in_the_way: AtomicBool,
    under_way: Mutex<LettersUnderWay>,
}

impl AwakeFlags {
    /// Returns the letters that are under way.
    pub(crate) fn under_way(&self) -> MutexGuard<'_, LettersUnderWay> {
        // Each letter moves as a whole, so a panic elsewhere does not corrupt them.
        self.under_way.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// When agents are put to sleep: the same for all of a host.
pub(crate) struct SleepRule {
    /// Time that an agent waits before.
    pub(crate) after: Duration,
    /// Whether others wait for a place.
    pub(crate) is_crowded: AtomicBool,
}

/// The outside of an agent.
pub(crate) struct AgentOutside {
    host: RealHost,
    inbox: Inbox,
    mailbox: Arc<AgentMailbox>,
    journal: DurableJournal,
    control: DurableControl,
    rule: Arc<SleepRule>,
    flags: Arc<AwakeFlags>,
    /// Whether the program has waited, so that its inputs are defined.
    has_waited: bool,
}

impl AgentOutside {
    /// Creates the outside of a run.
    pub(crate) fn new(
        host: RealHost,
        mailbox: Arc<AgentMailbox>,
        run: &esl_durable::DurableRun,
        rule: Arc<SleepRule>,
        flags: Arc<AwakeFlags>,
    ) -> AgentOutside {
        let inbox = host.inbox();
        let (journal, control) = (run.journal(), run.control());
        AgentOutside { host, inbox, mailbox, journal, control, rule, flags, has_waited: false }
    }

    /// Answers the letters that are in the journal.
    fn answer(&mut self) {
        let mut under_way = self.flags.under_way();
        if !under_way.taken.is_empty() && self.journal.commit() {
            under_way.answer_taken();
        }
    }

    /// Puts the contents of letters into the inbox.
    fn deliver(&mut self) {
        let mut kept = VecDeque::new();
        for letter in self.mailbox.take() {
            let sent = match &letter.contents {
                LetterContents::End => {
                    self.inbox.put(Incoming::Signal(ProcessSignal::Terminate));
                    Ok(())
                }
                LetterContents::Message { input, arguments } => {
                    self.inbox.try_signal(input, arguments.clone())
                }
            };
            match sent {
                Ok(()) => self.flags.under_way().delivered.push_back(letter),
                // A program that has just begun has not defined it yet.
                Err(SendError::NoSuchInput(_)) if !self.has_waited => kept.push_back(letter),
                Err(error) => letter.answer(Err(AgentError::NotTaken(error))),
            }
        }
        self.mailbox.put_back(kept);
    }

    /// Returns how long the agent waits before it may sleep; `None` if it has to stay awake.
    fn patience(&mut self, deadline: Option<u64>, awaited: Awaited) -> Option<Duration> {
        let waits_for_ever = deadline.is_none() && awaited == Awaited::default();
        if waits_for_ever || self.flags.is_ending.load(Ordering::Relaxed) || self.journal.has_open_calls() {
            return None;
        }
        let refusals = self.flags.refusals.load(Ordering::Relaxed);
        let is_in_the_way = self.flags.is_in_the_way.load(Ordering::Relaxed);
        let (patience, shortest) = match is_in_the_way || self.rule.is_crowded.load(Ordering::Relaxed) {
            true if refusals == 0 => (Duration::ZERO, SHORTEST),
            _ => (self.rule.after.saturating_mul(1 << refusals.min(10)), self.rule.after),
        };
        let left = deadline.map(|deadline| deadline.saturating_sub(self.host.monotonic()));
        let is_long = left.is_none_or(|left| Duration::from_nanos(left) > patience.saturating_add(shortest));
        is_long.then_some(patience)
    }
}

impl Host for AgentOutside {
    fn wait(&mut self, deadline: Option<u64>, awaited: Awaited) -> Wake {
        self.has_waited = true;
        self.answer();
        self.deliver();
        if self.inbox.is_rung() {
            return self.inbox.why_rung();
        }
        let Some(patience) = self.patience(deadline, awaited) else {
            return self.host.wait(deadline, awaited);
        };
        if !self.inbox.wait(Some(patience)) {
            self.flags.may_sleep.store(true, Ordering::Relaxed);
            self.control.interrupt();
        }
        self.inbox.why_rung()
    }

    fn poll(&mut self, round: u64) -> Vec<Incoming> {
        self.answer();
        self.deliver();
        let contents = self.host.poll(round);
        let LettersUnderWay { delivered, taken } = &mut *self.flags.under_way();
        taken.append(delivered);
        if !taken.is_empty() {
            // The next round answers them, when these contents are in the journal.
            self.inbox.ring();
        }
        contents
    }

    /// Agents have no standard input.
    fn read_input(&mut self) -> Input {
        Input::End
    }

    fn is_interactive(&mut self) -> bool {
        false
    }

    fn monotonic(&mut self) -> u64 {
        self.host.monotonic()
    }

    fn wall_clock(&mut self) -> i64 {
        self.host.wall_clock()
    }

    fn processor_time(&mut self) -> u64 {
        self.host.processor_time()
    }

    fn due(&mut self, deadline: u64) -> Option<u64> {
        self.host.due(deadline)
    }

    fn stopwatch(&mut self) -> u64 {
        self.host.stopwatch()
    }

    fn seed(&mut self) -> u64 {
        self.host.seed()
    }

    fn arguments(&mut self) -> Vec<String> {
        self.host.arguments()
    }

    fn write(&mut self, output: Output, bytes: &[u8]) -> Result<(), HostError> {
        self.host.write(output, bytes)
    }

    fn permit(&mut self, right: Right, object: &str, narrowed: &[Rights]) -> Permit {
        self.host.permit(right, object, narrowed)
    }

    fn read_file(&mut self, path: &str) -> Result<Vec<u8>, HostError> {
        self.host.read_file(path)
    }

    fn write_file(&mut self, path: &str, bytes: &[u8], mode: WriteMode) -> Result<(), HostError> {
        self.host.write_file(path, bytes, mode)
    }

    fn file_exists(&mut self, path: &str) -> bool {
        self.host.file_exists(path)
    }

    fn delete_file(&mut self, path: &str) -> Result<(), HostError> {
        self.host.delete_file(path)
    }

    fn request_of_files(&mut self, request: FileRequest<'_>) -> Result<FileAnswer, HostError> {
        self.host.request_of_files(request)
    }

    fn call(
        &mut self,
        call: HostCall<'_>,
        function: &mut dyn FnMut(&[Datum]) -> Result<Datum, HostFailure>,
    ) -> Result<Datum, HostFailure> {
        self.host.call(call, function)
    }

    fn begin(&mut self, call: HostCall<'_>, function: &mut dyn FnMut(&[Datum], Option<ActionId>)) {
        self.host.begin(call, function);
    }

    fn inbox(&self) -> Inbox {
        self.inbox.clone()
    }

    fn check(&mut self, check: RunCheck) {
        self.host.check(check);
    }
}
