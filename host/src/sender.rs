//! Senders of signals from outside, and their admission: a signal is refused, or waits, while its input is
//! full.
//!
//! The machine reports its inputs and the number of signals that they keep; it never reads the admission, so
//! a run does not depend on it.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError};
use std::task::{Poll, Waker};

use esl_bytecode::datum::Datum;

use super::{Inbox, Incoming};

/// Why a signal from outside was not sent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SendError {
    /// The program has no input of this name.
    NoSuchInput(String),
    /// The input has no room, and its rule is that senders wait.
    Full(String),
    /// The machine is gone.
    Ended,
}

impl fmt::Display for SendError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SendError::NoSuchInput(name) => {
                write!(f, "the program has no input `{name}`: define it with `(define-input {name})`")
            }
            SendError::Full(name) => write!(f, "the input `{name}` is full: send again later"),
            SendError::Ended => f.write_str("the engine is gone"),
        }
    }
}

impl std::error::Error for SendError {}

/// The state of one input, as senders see it. Changed under the lock of the table, except by senders that
/// know the input, which only add to `sent`.
#[derive(Debug)]
struct InputAdmission {
    /// Number of signals for which there is room; `usize::MAX` if senders do not wait.
    capacity: AtomicUsize,
    /// Signals that the input keeps.
    kept: AtomicUsize,
    /// Signals on their way to it.
    sent: AtomicUsize,
    /// Whether the program has removed the input, or the machine is gone.
    is_gone: AtomicBool,
}

impl InputAdmission {
    fn new(capacity: Option<usize>) -> InputAdmission {
        InputAdmission {
            capacity: AtomicUsize::new(capacity.unwrap_or(usize::MAX)),
            kept: AtomicUsize::new(0),
            sent: AtomicUsize::new(0),
            is_gone: AtomicBool::new(false),
        }
    }

    /// Counts a signal that may be sent to the input. Returns whether there is room for it.
    fn admit(&self, limit: usize) -> bool {
        // The numbers guard no other memory: the signal itself comes by the inbox.
        let (capacity, kept) = (self.capacity.load(Ordering::Relaxed), self.kept.load(Ordering::Relaxed));
        let most = capacity.saturating_sub(kept).min(limit);
        let count = |sent: usize| (sent < most).then_some(sent + 1);
        self.sent.fetch_update(Ordering::Relaxed, Ordering::Relaxed, count).is_ok()
    }

    /// Notes that a signal that was sent has come.
    fn note_arrival(&self) {
        let less = |sent: usize| Some(sent.saturating_sub(1));
        _ = self.sent.fetch_update(Ordering::Relaxed, Ordering::Relaxed, less);
    }
}

#[derive(Default)]
struct AdmissionTable {
    inputs: BTreeMap<String, Arc<InputAdmission>>,
    /// Drivers that wait for room.
    wakers: Vec<Waker>,
    /// Number of threads that wait for room. A notification without waiters is a call of the system too.
    waiting: usize,
    is_closed: bool,
}

/// The request of a driver to send a signal.
pub(super) struct AdmissionRequest<'a> {
    /// Most signals that are on their way.
    pub(super) limit: Option<usize>,
    /// Woken when there may be room.
    pub(super) waker: Option<&'a Waker>,
}

impl AdmissionTable {
    /// Counts a signal that may be sent to the input.
    fn admit(&mut self, name: &str, limit: Option<usize>) -> Result<(), SendError> {
        if self.is_closed {
            return Err(SendError::Ended);
        }
        let Some(input) = self.inputs.get(name) else { return Err(SendError::NoSuchInput(name.into())) };
        if input.admit(limit.unwrap_or(usize::MAX)) { Ok(()) } else { Err(SendError::Full(name.into())) }
    }

    /// Has senders that know an input look for it anew.
    fn forget(&mut self, name: &str) {
        if let Some(input) = self.inputs.remove(name) {
            input.is_gone.store(true, Ordering::Relaxed);
        }
    }
}

/// The admission of signals to one machine.
#[derive(Default)]
pub(super) struct Admission {
    state: Mutex<AdmissionTable>,
    /// Notified when there may be room, or the machine is gone.
    room: Condvar,
}

impl Admission {
    fn state(&self) -> MutexGuard<'_, AdmissionTable> {
        // The state is whole at every moment, so a panic elsewhere does not corrupt it.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn change(&self, name: &str, change: impl FnOnce(&InputAdmission)) {
        self.change_table(|table| {
            if let Some(input) = table.inputs.get(name) {
                change(input);
            }
        });
    }

    /// Changes the table, and wakes all senders that wait for room.
    fn change_table(&self, change: impl FnOnce(&mut AdmissionTable)) {
        let (wakers, waiting) = {
            let mut table = self.state();
            change(&mut table);
            (std::mem::take(&mut table.wakers), table.waiting)
        };
        if waiting > 0 {
            self.room.notify_all();
        }
        wakers.into_iter().for_each(Waker::wake);
    }

    /// Waits until a signal may be sent to the input, if `waits`, and counts it.
    fn admit(&self, name: &str, waits: bool) -> Result<(), SendError> {
        let mut table = self.state();
        loop {
            match table.admit(name, None) {
                Err(SendError::Full(_)) if waits => {
                    table.waiting += 1;
                    table = self.room.wait(table).unwrap_or_else(PoisonError::into_inner);
                    table.waiting -= 1;
                }
                admitted => return admitted,
            }
        }
    }

    /// As [`Admission::admit`], for a driver, which is woken when there may be room.
    pub(super) fn poll_admit(
        &self,
        name: &str,
        request: AdmissionRequest<'_>,
    ) -> Poll<Result<(), SendError>> {
        let mut table = self.state();
        match table.admit(name, request.limit) {
            Err(SendError::Full(_)) => {
                if let Some(waker) = request.waker
                    && !table.wakers.iter().any(|known| known.will_wake(waker))
                {
                    table.wakers.push(waker.clone());
                }
                Poll::Pending
            }
            admitted => Poll::Ready(admitted),
        }
    }
}

impl Inbox {
    /// Signals an input of the machine, by its name in any case, without waiting. Unlike the signals of a
    /// [`Sender`], this one says nothing about others to come.
    ///
    /// # Errors
    /// [`SendError`].
    pub fn try_signal(&self, input: &str, arguments: Vec<Datum>) -> Result<(), SendError> {
        self.signal(input, arguments, false)
    }

    fn signal(&self, input: &str, arguments: Vec<Datum>, waits: bool) -> Result<(), SendError> {
        let input = input.to_uppercase();
        self.admission().admit(&input, waits)?;
        self.put(Incoming::Message { input: input.into(), arguments });
        Ok(())
    }

    /// Says that there is an input of this name; with a capacity, if senders wait when it is full.
    #[doc(hidden)]
    pub fn open_input(&self, name: &str, capacity: Option<usize>) {
        self.admission().change_table(|table| match table.inputs.get(name) {
            Some(input) => input.capacity.store(capacity.unwrap_or(usize::MAX), Ordering::Relaxed),
            None => _ = table.inputs.insert(name.into(), Arc::new(InputAdmission::new(capacity))),
        });
    }

    /// Says that the input is no more.
    #[doc(hidden)]
    pub fn remove_input(&self, name: &str) {
        self.admission().change_table(|table| table.forget(name));
    }

    /// Says that a signal that was sent to the input has come.
    #[doc(hidden)]
    pub fn note_arrival(&self, name: &str) {
        self.admission().change(name, InputAdmission::note_arrival);
    }

    /// Says how many signals the input keeps.
    #[doc(hidden)]
    pub fn note_kept(&self, name: &str, kept: usize) {
        self.admission().change(name, |input| input.kept.store(kept, Ordering::Relaxed));
    }

    /// Says that the machine is gone.
    #[doc(hidden)]
    pub fn close_inputs(&self) {
        self.admission().change_table(|table| {
            table.is_closed = true;
            table.inputs.values().for_each(|input| input.is_gone.store(true, Ordering::Relaxed));
        });
    }
}

/// The membership of a sender, which counts until its last clone is dropped.
struct Membership(Inbox);

impl Drop for Membership {
    fn drop(&mut self) {
        self.0.put(Incoming::SenderLeft);
    }
}

/// A handle outside that may signal the inputs of a machine. While one exists, a waiting program is not
/// deadlocked.
///
/// Clones are the same sender. Signals come into the inbox in the order of sending.
#[derive(Clone)]
pub struct Sender(Arc<Membership>);

impl fmt::Debug for Sender {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Sender")
    }
}

impl Sender {
    /// Creates a sender to the machine with this inbox.
    pub fn new(inbox: &Inbox) -> Sender {
        inbox.put(Incoming::SenderCame);
        Sender(Arc::new(Membership(inbox.clone())))
    }

    /// Returns the inbox of the machine.
    pub fn inbox(&self) -> &Inbox {
        &self.0.0
    }

    /// Signals an input, by its name in any case. Waits while the input is full, if that is its rule: so not
    /// on the thread that runs the machine.
    ///
    /// # Errors
    /// [`SendError::NoSuchInput`] and [`SendError::Ended`].
    pub fn signal(&self, input: &str, arguments: Vec<Datum>) -> Result<(), SendError> {
        self.inbox().signal(input, arguments, true)
    }

    /// Signals an input, as [`Sender::signal`], without waiting.
    ///
    /// # Errors
    /// [`SendError`].
    pub fn try_signal(&self, input: &str, arguments: Vec<Datum>) -> Result<(), SendError> {
        self.inbox().signal(input, arguments, false)
    }

    /// Returns an input, by its name in any case, for many signals.
    pub fn input(&self, name: &str) -> SenderInput {
        SenderInput { sender: self.clone(), name: name.to_uppercase().into(), known: OnceLock::new() }
    }
}

/// An input of a program as a sender has it: its signals need no look-up of the name, and no lock of the
/// table of inputs while there is room.
#[derive(Clone)]
pub struct SenderInput {
    sender: Sender,
    name: Arc<str>,
    /// The state of the input, as it was found first: the program may have removed it since.
    known: OnceLock<Arc<InputAdmission>>,
}

impl fmt::Debug for SenderInput {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("SenderInput").field(&self.name).finish()
    }
}

impl SenderInput {
    /// Returns the name, in upper case.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Signals the input, as [`Sender::signal`].
    ///
    /// # Errors
    /// As that.
    pub fn signal(&self, arguments: Vec<Datum>) -> Result<(), SendError> {
        self.send(arguments, true)
    }

    /// Signals the input, as [`Sender::try_signal`].
    ///
    /// # Errors
    /// [`SendError`].
    pub fn try_signal(&self, arguments: Vec<Datum>) -> Result<(), SendError> {
        self.send(arguments, false)
    }

    /// Counts a signal without waiting, if there is room for it. Returns whether there is: then
    /// [`SenderInput::signal_admitted`] sends the signal.
    pub fn admit(&self) -> bool {
        let known = self.known.get().filter(|known| !known.is_gone.load(Ordering::Relaxed));
        if let Some(known) = known {
            return known.admit(usize::MAX);
        }
        let admission = self.sender.inbox().admission();
        if self.known.get().is_none()
            && let Some(found) = admission.state().inputs.get(&*self.name)
        {
            _ = self.known.set(found.clone());
        }
        admission.admit(&self.name, false).is_ok()
    }

    /// Sends a signal that [`SenderInput::admit`] has counted.
    pub fn signal_admitted(&self, arguments: Vec<Datum>) {
        self.sender.inbox().put(Incoming::Message { input: self.name.clone(), arguments });
    }

    fn send(&self, arguments: Vec<Datum>, waits: bool) -> Result<(), SendError> {
        if !self.admit() {
            self.sender.inbox().admission().admit(&self.name, waits)?;
        }
        self.signal_admitted(arguments);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn senders_are_refused_by_what_the_machine_says() {
        let inbox = Inbox::new();
        let sender = Sender::new(&inbox);
        let outcome = |name: &str| sender.try_signal(name, Vec::new());
        assert_eq!(outcome("go"), Err(SendError::NoSuchInput("GO".into())));
        inbox.open_input("GO", Some(1));
        assert_eq!((outcome("go"), outcome("go")), (Ok(()), Err(SendError::Full("GO".into()))));
        inbox.note_arrival("GO");
        inbox.note_kept("GO", 1);
        assert_eq!(outcome("go"), Err(SendError::Full("GO".into())));
        inbox.open_input("GO", None);
        assert_eq!(outcome("go"), Ok(()));
        inbox.close_inputs();
        assert_eq!(outcome("go"), Err(SendError::Ended));
    }

    #[test]
    fn an_input_that_is_known_is_refused_like_any() {
        let inbox = Inbox::new();
        let input = Sender::new(&inbox).input("go");
        assert_eq!(input.try_signal(Vec::new()), Err(SendError::NoSuchInput("GO".into())));
        inbox.open_input("GO", Some(1));
        assert_eq!(input.try_signal(Vec::new()), Ok(()));
        assert_eq!(input.try_signal(Vec::new()), Err(SendError::Full("GO".into())));
        inbox.open_input("GO", Some(2));
        assert_eq!(input.try_signal(Vec::new()), Ok(()));
        inbox.remove_input("GO");
        assert_eq!(input.try_signal(Vec::new()), Err(SendError::NoSuchInput("GO".into())));
        // Another one of the name.
        inbox.open_input("GO", Some(1));
        let again = [input.try_signal(Vec::new()), input.try_signal(Vec::new())];
        assert_eq!(again, [Ok(()), Err(SendError::Full("GO".into()))]);
        inbox.close_inputs();
        assert_eq!(input.try_signal(Vec::new()), Err(SendError::Ended));
    }

    #[test]
    fn a_sender_waits_for_room() {
        let inbox = Inbox::new();
        inbox.open_input("GO", Some(1));
        let sender = Sender::new(&inbox);
        assert_eq!(sender.signal("go", Vec::new()), Ok(()));
        let other = sender.clone();
        let thread = std::thread::spawn(move || other.signal("go", Vec::new()));
        inbox.note_arrival("GO");
        assert_eq!(thread.join().ok(), Some(Ok(())));
    }

    #[test]
    fn clones_are_one_sender() {
        let inbox = Inbox::new();
        let sender = Sender::new(&inbox);
        let other = sender.clone();
        drop(sender);
        assert!(matches!(inbox.take()[..], [Incoming::SenderCame]));
        drop(other);
        assert!(matches!(inbox.take()[..], [Incoming::SenderLeft]));
    }
}
