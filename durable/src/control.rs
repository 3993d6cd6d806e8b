//! The control of a durable run by its embedder: pauses, and news of restarts.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use esl_host::{Inbox, Pending, ReplayHost};
use esl_replay::JournalLife;

use super::upgrade::{UpgradeOutcome, UpgradeReport, outcome_of, poll_call};

/// A run that goes on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resumed {
    /// The process.
    pub life: JournalLife,
    /// Seconds between the last record and this process.
    pub downtime: f64,
    /// Number of calls that fail because the end of their process has interrupted them.
    pub interrupted: usize,
    /// Number of connections and servers that signalled inputs and are gone.
    pub lost: usize,
    /// Number of calls that are made again to open them, as far as that is possible.
    pub again: usize,
}

/// Is called when a run is upgraded.
type UpgradeListener = Box<dyn FnOnce(&UpgradeReport) + Send>;

/// Is called with warnings about the run's files.
type WarningListener = Box<dyn FnMut(&str) + Send>;

/// Is called when a run goes on.
type ResumeListener = Box<dyn FnOnce(&Resumed) + Send>;

#[derive(Default)]
struct ControlNotes {
    inbox: Option<Inbox>,
    /// The host by which the run is done again.
    past: Option<ReplayHost>,
    resumed: Option<Resumed>,
    listener: Option<ResumeListener>,
    /// The program's clock at the pause.
    paused_at: Option<u64>,
    /// The call by which an upgrade is made.
    upgrading: Option<Pending>,
    upgraded: Option<UpgradeOutcome>,
    upgrade_listener: Option<UpgradeListener>,
    warning_listener: Option<WarningListener>,
}

#[derive(Default)]
struct ControlState {
    /// Whether a pause was requested.
    pauses: AtomicBool,
    /// Whether the machine is to come back, to go on then.
    interrupts: AtomicBool,
    /// Whether it is over, so that it cannot be paused.
    is_ending: AtomicBool,
    /// Whether the run is a copy, which comes back at the end of its journal, or when an upgrade was tried.
    is_copy: AtomicBool,
    /// Whether the copy goes on behind its journal, as if it had been the run.
    is_rehearsal: AtomicBool,
    /// Whether the copy answers calls behind its journal.
    is_asked: AtomicBool,
    /// Whether snapshots are taken, so that a pause waits for one.
    has_snapshots: AtomicBool,
    /// Whether the snapshot before a pause was taken, or is left out.
    may_pause: AtomicBool,
    /// Whether the run goes on with the outside, and the news of the restart have arrived.
    is_settled: AtomicBool,
    /// Number of questions whether a timer is due that were answered no.
    not_due: AtomicU64,
    told: Mutex<ControlNotes>,
}

/// Pauses a durable run, from any thread.
#[derive(Clone, Default)]
pub struct DurableControl(Arc<ControlState>);

impl DurableControl {
    fn told(&self) -> MutexGuard<'_, ControlNotes> {
        // Each field is set whole, so a panic elsewhere corrupts none.
        self.0.told.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Makes the machine come back, so that the run goes on in another process. Returns false if the run is
    /// about to end.
    pub fn pause(&self) -> bool {
        if self.0.is_ending.load(Ordering::Relaxed) {
            return false;
        }
        self.0.pauses.store(true, Ordering::Relaxed);
        if let Some(inbox) = &self.told().inbox {
            inbox.ring();
        }
        true
    }

    /// Makes the machine come back at its next look into the inbox, between two turns. The run goes on when
    /// the machine runs again: nothing of this is in the journal.
    pub fn interrupt(&self) {
        self.0.interrupts.store(true, Ordering::Relaxed);
        if let Some(inbox) = &self.told().inbox {
            inbox.ring();
        }
    }

    /// Returns whether the machine was to come back, once.
    pub(crate) fn takes_interruption(&self) -> bool {
        self.0.interrupts.swap(false, Ordering::Relaxed) && !self.0.is_ending.load(Ordering::Relaxed)
    }

    /// Notes that the run is over but for its cleanups. Returns whether a pause was requested before.
    pub fn begin_end(&self) -> bool {
        self.0.is_ending.store(true, Ordering::Relaxed);
        self.is_pausing()
    }

    /// Returns whether the run was asked to pause.
    pub fn is_pausing(&self) -> bool {
        self.0.pauses.load(Ordering::Relaxed)
    }

    pub(crate) fn set_copy(&self) {
        self.0.is_copy.store(true, Ordering::Relaxed);
    }

    /// Returns whether the run is a copy.
    pub(crate) fn is_copy(&self) -> bool {
        self.0.is_copy.load(Ordering::Relaxed)
    }

    /// Has a copy go on behind its journal as if it were the run.
    pub(crate) fn set_rehearsal(&self) {
        self.0.is_rehearsal.store(true, Ordering::Relaxed);
    }

    /// Returns whether the copy goes on behind its journal.
    pub(crate) fn is_rehearsal(&self) -> bool {
        self.0.is_rehearsal.load(Ordering::Relaxed)
    }

    /// Has a copy at the end of its journal answer calls, in place of coming back.
    pub(crate) fn set_asked(&self) {
        self.0.is_asked.store(true, Ordering::Relaxed);
    }

    /// Returns whether the copy comes back at the end of its journal.
    pub(crate) fn comes_back(&self) -> bool {
        self.is_copy() && !self.is_rehearsal() && !self.0.is_asked.load(Ordering::Relaxed)
    }

    /// Has pauses wait for a snapshot.
    pub(crate) fn expect_snapshots(&self) {
        self.0.has_snapshots.store(true, Ordering::Relaxed);
    }

    /// Lets the run pause.
    pub(crate) fn allow_pause(&self) {
        self.0.may_pause.store(true, Ordering::Relaxed);
    }

    /// Returns whether the run may pause.
    pub(crate) fn may_pause(&self) -> bool {
        !self.0.has_snapshots.load(Ordering::Relaxed) || self.0.may_pause.load(Ordering::Relaxed)
    }

    /// Notes whether the run goes on with the outside, and how many questions whether a timer is due were
    /// answered no.
    pub(crate) fn note_standing(&self, is_settled: bool, not_due: u64) {
        self.0.is_settled.store(is_settled, Ordering::Relaxed);
        self.0.not_due.store(not_due, Ordering::Relaxed);
    }

    /// Returns whether the run goes on with the outside, and the news of the restart have arrived.
    pub(crate) fn is_settled(&self) -> bool {
        self.0.is_settled.load(Ordering::Relaxed)
    }

    /// Returns how many questions whether a timer is due were answered no.
    pub(crate) fn not_due(&self) -> u64 {
        self.0.not_due.load(Ordering::Relaxed)
    }

    /// Sets a function that is called with warnings about the run's files.
    pub fn on_warning(&self, listener: impl FnMut(&str) + Send + 'static) {
        self.told().warning_listener = Some(Box::new(listener));
    }

    pub(crate) fn warn(&self, text: &str) {
        if let Some(listener) = &mut self.told().warning_listener {
            listener(text);
        }
    }

    /// Begins the journal in the middle of the run, where so many questions whether a timer is due were
    /// answered no, and the latest time was this.
    pub(crate) fn start_past(&self, not_due: u64, time: u64) {
        if let Some(past) = &self.told().past {
            past.start(not_due, time);
        }
    }

    /// Returns whether the machine is to come back now.
    pub(crate) fn takes_pause(&self) -> bool {
        self.is_pausing() && !self.0.is_ending.load(Ordering::Relaxed)
    }

    pub(crate) fn set_inbox(&self, inbox: Inbox) {
        if self.is_pausing() {
            inbox.ring();
        }
        self.told().inbox = Some(inbox);
    }

    pub(crate) fn set_past(&self, past: ReplayHost) {
        self.told().past = Some(past);
    }

    /// Returns the place at which the run has left the course of its journal.
    pub(crate) fn divergence(&self) -> Option<String> {
        let told = self.told();
        told.past.as_ref().and_then(ReplayHost::divergence).map(|divergence| divergence.to_string())
    }

    /// Returns whether the run has come to the end of the journal.
    pub(crate) fn is_at_end_of_past(&self) -> bool {
        self.told().past.as_ref().is_none_or(ReplayHost::is_at_end)
    }

    /// Sets a function that is called when the run goes on with the outside. The machine waits for it.
    pub fn on_resume(&self, listener: impl FnOnce(&Resumed) + Send + 'static) {
        self.told().listener = Some(Box::new(listener));
    }

    pub(crate) fn note_resumed(&self, resumed: Resumed) {
        let listener = {
            let mut told = self.told();
            told.resumed = Some(resumed);
            told.listener.take()
        };
        if let Some(listener) = listener {
            listener(&resumed);
        }
    }

    pub(crate) fn note_time(&self, time: u64) {
        self.told().paused_at = Some(time);
    }

    pub(crate) fn paused_at(&self) -> Option<u64> {
        self.told().paused_at
    }

    /// Sets a function that is called when the run has been upgraded. The machine waits for it.
    pub fn on_upgrade(&self, listener: impl FnOnce(&UpgradeReport) + Send + 'static) {
        self.told().upgrade_listener = Some(Box::new(listener));
    }

    /// Notes the call by which an upgrade is made.
    pub(crate) fn begin_upgrade(&self, call: Pending) {
        self.told().upgrading = Some(call);
    }

    /// Looks whether the upgrade is over. The machine is rung when it is. Returns its outcome once.
    pub(crate) fn hear_upgrade(&self, inbox: &Inbox) -> Option<UpgradeOutcome> {
        let (outcome, listener) = {
            let mut told = self.told();
            let answer = poll_call(told.upgrading.as_mut()?, inbox)?;
            told.upgrading = None;
            let outcome = outcome_of(answer);
            told.upgraded = Some(outcome.clone());
            (outcome, told.upgrade_listener.take())
        };
        if let (Ok(report), Some(listener)) = (&outcome, listener) {
            listener(report);
        }
        Some(outcome)
    }

    /// Returns the outcome of the upgrade, once it is over.
    pub(crate) fn upgraded(&self) -> Option<UpgradeOutcome> {
        self.told().upgraded.clone()
    }

    /// Returns the restart, once the run has gone on.
    pub fn resumed(&self) -> Option<Resumed> {
        self.told().resumed
    }
}
