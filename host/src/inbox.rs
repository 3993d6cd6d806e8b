//! The inbox of a machine: everything that reaches a run from outside without having been asked for.
//!
//! Other threads put things in; the machine looks between two turns, which costs one relaxed load, and takes
//! out everything at once, in the order of arrival. So a run is a function of its program, its seed, the
//! answers of its host, and the contents of its inbox by the rounds in which they were taken.
//!
//! Guarantees: nothing is lost, and nothing is taken twice. An inbox may outlive its machine; what is put in
//! then has no effect.

use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError};
use std::task::Waker;
use std::time::{Duration, Instant};

use esl_bytecode::datum::Datum;

use super::external_clock::{ClockStep, ExternalClock};
use super::question::{Asking, Question};
use super::sender::Admission;
use super::survey::Inspections;
use super::{News, ProcessSignal, StateKeeper, Wake};

/// Something that reaches a run from outside.
#[derive(Clone, Debug)]
pub enum Incoming {
    /// The run is to end: every task is aborted, newest first; without a main task, only the one named by
    /// `Vm::set_interruptible`. An interrupt during the end of a run cuts that short.
    Signal(ProcessSignal),
    /// The run under way, or the next one, is to come back to the embedder.
    Stop,
    /// Standard input has data, or has ended: tasks that wait for it try again.
    Input,
    /// A standard stream has room for output again: tasks that wait for that try again.
    Output,
    /// The run is to come back to the embedder before this round, which begins anew when it goes on. Nothing
    /// else arrives with it.
    Interlude,
    /// News of an operation.
    Operation {
        /// Number of the operation.
        number: u64,
        /// The news of it.
        news: News,
    },
    /// A signal of an input of the program.
    Message {
        /// Name of the input, in upper case.
        input: Arc<str>,
        /// Arguments of the signal.
        arguments: Vec<Datum>,
    },
    /// A question, whose answer goes to the caller that waits for its number.
    Question {
        /// Number of the question.
        number: u64,
        /// The question.
        question: Question,
    },
    /// The task with this number is to end.
    Abort(u64),
    /// The task of the call that the question with this number asked for is to end.
    AbortCall(u64),
    /// No task is to run, or tasks are to run again.
    Pause(bool),
    /// The outside has let go of the value that is kept for it under this number.
    Release(u64),
    /// Observers have arrived, which are to be registered.
    Watch,
    /// One more sender exists.
    SenderCame,
    /// A sender is gone.
    SenderLeft,
    /// Operators that send messages may attach at any time.
    Attended,
    /// No operator can attach any more, since the process is gone that let them.
    Unattended,
    /// The run is an agent of a host, which may pass messages to it at any time.
    Hosted,
}

#[derive(Default)]
struct InboxState {
    /// Whether something was put in, or the bell rung, since the contents were taken last.
    is_rung: AtomicBool,
    contents: Mutex<Vec<Incoming>>,
    /// Notified, under the lock of `contents`, when `is_rung` is set and a thread waits.
    bell: Condvar,
    /// Number of threads that wait for the bell; read and written under the lock of `contents`. A
    /// notification without waiters takes a call of the system too, and most messages come while the machine
    /// runs.
    waiting: AtomicU32,
    /// Inspections, which come beside the contents.
    inspections: Mutex<Inspections>,
    admission: Admission,
    asking: Asking,
    clock: ExternalClock,
    /// A bit for each signal of the process that the program handles, by number.
    handled: AtomicU32,
    /// The task to wake when the inbox is rung.
    waker: Mutex<Option<Waker>>,
    /// The keeper of the states of operations, if the run is durable.
    keeper: OnceLock<Box<dyn StateKeeper>>,
}

/// The inbox of one machine, shared by its senders and the host that takes the contents out.
#[derive(Clone, Default)]
pub struct Inbox(Arc<InboxState>);

impl Inbox {
    /// Creates an empty inbox.
    pub fn new() -> Inbox {
        Inbox::default()
    }

    fn contents(&self) -> MutexGuard<'_, Vec<Incoming>> {
        // The contents are whole at every moment, so a panic elsewhere does not corrupt them.
        self.0.contents.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn inspections(&self) -> MutexGuard<'_, Inspections> {
        // The list is whole at every moment, so a panic elsewhere does not corrupt it.
        self.0.inspections.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn admission(&self) -> &Admission {
        &self.0.admission
    }

    pub(super) fn asking(&self) -> &Asking {
        &self.0.asking
    }

    /// Puts something in, from any thread, and ends the host's wait.
    pub fn put(&self, incoming: Incoming) {
        let mut contents = self.contents();
        contents.push(incoming);
        self.ring_under(&contents);
    }

    /// Ends the host's wait, or the next one, and has the machine look.
    pub fn ring(&self) {
        self.ring_under(&self.contents());
    }

    /// As [`Inbox::ring`], under the lock of the contents.
    fn ring_under(&self, _contents: &MutexGuard<'_, Vec<Incoming>>) {
        if self.0.is_rung.swap(true, Ordering::Relaxed) {
            // Waiting threads have been notified, and a waker that is set later is woken when it is set.
            return;
        }
        if self.0.waiting.load(Ordering::Relaxed) > 0 {
            self.0.bell.notify_all();
        }
        if let Some(waker) = self.waker().take() {
            waker.wake();
        }
    }

    fn waker(&self) -> MutexGuard<'_, Option<Waker>> {
        self.0.waker.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Has `waker` woken when the machine should look, at once if it should already.
    pub fn wake_when_rung(&self, waker: &Waker) {
        *self.waker() = Some(waker.clone());
        if self.is_rung() {
            waker.wake_by_ref();
        }
    }

    /// Notes that the program handles a signal of the process.
    #[doc(hidden)]
    pub fn note_handled(&self, signal: ProcessSignal) {
        self.0.handled.fetch_or(1 << signal.number(), Ordering::Relaxed);
    }

    /// Notes that no signal of the process is handled any more.
    #[doc(hidden)]
    pub fn note_none_handled(&self) {
        self.0.handled.store(0, Ordering::Relaxed);
    }

    /// Returns whether both are the inbox of one machine.
    pub fn is_same(&self, other: &Inbox) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }

    /// Returns whether the program handles a signal of the process, so that it does not end the run.
    pub fn is_handled(&self, signal: ProcessSignal) -> bool {
        signal.can_be_handled() && self.0.handled.load(Ordering::Relaxed) >> signal.number() & 1 != 0
    }

    /// Names the keeper of the states of operations, once.
    #[doc(hidden)]
    pub fn set_state_keeper(&self, keeper: impl StateKeeper + 'static) {
        // A second host of the same inbox is one of the same run.
        drop(self.0.keeper.set(Box::new(keeper)));
    }

    pub(super) fn state_keeper(&self) -> Option<&dyn StateKeeper> {
        self.0.keeper.get().map(|keeper| &**keeper)
    }

    /// Returns whether the machine should look.
    #[inline]
    pub fn is_rung(&self) -> bool {
        self.0.is_rung.load(Ordering::Relaxed)
    }

    /// Returns why the inbox is rung, for a host whose wait that ends.
    pub fn why_rung(&self) -> Wake {
        let contents = self.contents();
        if contents.is_empty() && !self.inspections().list.is_empty() {
            Wake::Inspection
        } else {
            Wake::Arrival
        }
    }

    /// Tells the time of day, in nanoseconds since 1970, to a host that goes by an external clock.
    pub fn set_time(&self, time: i64) -> ClockStep {
        self.0.clock.set(time, || self.ring())
    }

    /// Returns whether the host goes by an external clock, whose time [`Inbox::set_time`] tells.
    pub fn has_external_clock(&self) -> bool {
        self.0.clock.is_used()
    }

    /// Returns the time of day that was told last, in nanoseconds since 1970, if the host goes by an external
    /// clock; 0 before the first.
    pub fn told_time(&self) -> Option<i64> {
        self.has_external_clock().then(|| self.0.clock.time())
    }

    pub(super) fn external_clock(&self) -> &ExternalClock {
        &self.0.clock
    }

    /// Ends the ringing if nothing is there, inspections included. Returns whether that is so.
    pub(super) fn quieten_if_empty(&self) -> bool {
        let contents = self.contents();
        let is_empty = contents.is_empty() && self.inspections().list.is_empty();
        if is_empty {
            self.0.is_rung.store(false, Ordering::Relaxed);
        }
        is_empty
    }

    /// Ends the ringing if nothing is there but inspections, which are about to be taken.
    #[doc(hidden)]
    pub fn quieten(&self) {
        let contents = self.contents();
        if contents.is_empty() {
            self.0.is_rung.store(false, Ordering::Relaxed);
        }
    }

    /// Takes everything out.
    pub fn take(&self) -> Vec<Incoming> {
        let mut contents = self.contents();
        self.0.is_rung.store(false, Ordering::Relaxed);
        std::mem::take(&mut *contents)
    }

    /// Waits until the machine should look, or until `time` is over. Returns whether it should.
    pub fn wait(&self, time: Option<Duration>) -> bool {
        let deadline = time.and_then(|time| Instant::now().checked_add(time));
        let mut contents = self.contents();
        self.0.waiting.fetch_add(1, Ordering::Relaxed);
        while !self.is_rung() {
            contents = match deadline {
                None => self.0.bell.wait(contents).unwrap_or_else(PoisonError::into_inner),
                Some(deadline) => {
                    let left = deadline.saturating_duration_since(Instant::now());
                    if left.is_zero() {
                        self.0.waiting.fetch_sub(1, Ordering::Relaxed);
                        return false;
                    }
                    let waited = self.0.bell.wait_timeout(contents, left);
                    waited.unwrap_or_else(PoisonError::into_inner).0
                }
            };
        }
        self.0.waiting.fetch_sub(1, Ordering::Relaxed);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_lost_or_taken_twice_between_threads() {
        let inbox = Inbox::new();
        let threads: Vec<_> = (0..4)
            .map(|_| {
                let inbox = inbox.clone();
                std::thread::spawn(move || (0..1000).for_each(|_| inbox.put(Incoming::Input)))
            })
            .collect();
        let mut taken = 0;
        while taken < 4000 {
            assert!(inbox.wait(None));
            taken += inbox.take().len();
        }
        threads.into_iter().for_each(|thread| thread.join().expect("it does not panic"));
        assert!(inbox.take().is_empty() && !inbox.is_rung());
    }

    #[test]
    fn contents_are_taken_in_order() {
        let inbox = Inbox::new();
        let all =
            [Incoming::Signal(ProcessSignal::Interrupt), Incoming::Input, Incoming::Stop, Incoming::Input];
        all.iter().for_each(|incoming| inbox.put(incoming.clone()));
        assert_eq!(format!("{:?}", inbox.take()), format!("{all:?}"));
    }

    #[test]
    fn a_wait_ends_with_a_ring_or_with_its_time() {
        let inbox = Inbox::new();
        assert!(!inbox.wait(Some(Duration::from_millis(1))));
        let other = inbox.clone();
        let thread = std::thread::spawn(move || other.ring());
        assert!(inbox.wait(None) && inbox.take().is_empty());
        assert!(!inbox.is_rung());
        assert!(thread.join().is_ok());
    }
}
