//! Doors: what senders outside know of the inputs of a machine, so that they can be refused or wait.
//!
//! The machine says here which inputs there are and how many signals they keep; it never reads what is here,
//! so a run does not depend on it.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
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

/// The state of one input, as senders see it.
#[derive(Debug, Default)]
struct Door {
    /// Number of signals for which there is room, if senders wait.
    capacity: Option<usize>,
    /// Signals that the input keeps.
    kept: usize,
    /// Signals on their way to it.
    sent: usize,
}

#[derive(Default)]
struct DoorTable {
    doors: BTreeMap<String, Door>,
    /// Drivers that wait for room.
    wakers: Vec<Waker>,
    is_closed: bool,
}

/// How a driver sends a signal.
pub(super) struct DoorEntry<'a> {
    /// Most signals that are on their way.
    pub(super) limit: Option<usize>,
    /// Woken when there may be room.
    pub(super) waker: Option<&'a Waker>,
}

impl DoorTable {
    /// Counts a signal that may be sent to the input.
    fn enter(&mut self, name: &str, limit: Option<usize>) -> Result<(), SendError> {
        if self.is_closed {
            return Err(SendError::Ended);
        }
        let Some(door) = self.doors.get_mut(name) else { return Err(SendError::NoSuchInput(name.into())) };
        let has_room = door.capacity.is_none_or(|capacity| door.kept + door.sent < capacity);
        if !has_room || limit.is_some_and(|limit| door.sent >= limit) {
            return Err(SendError::Full(name.into()));
        }
        door.sent += 1;
        Ok(())
    }
}

/// The doors of one machine.
#[derive(Default)]
pub(super) struct Doors {
    state: Mutex<DoorTable>,
    /// Notified when there may be room, or the doors are closed.
    room: Condvar,
}

impl Doors {
    fn state(&self) -> MutexGuard<'_, DoorTable> {
        // The state is whole at every moment, so a panic elsewhere does not corrupt it.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn change(&self, name: &str, change: impl FnOnce(&mut Door)) {
        self.change_table(|table| {
            if let Some(door) = table.doors.get_mut(name) {
                change(door);
            }
        });
    }

    /// Changes the table, and wakes all senders that wait for room.
    fn change_table(&self, change: impl FnOnce(&mut DoorTable)) {
        let wakers = {
            let mut table = self.state();
            change(&mut table);
            std::mem::take(&mut table.wakers)
        };
        self.room.notify_all();
        wakers.into_iter().for_each(Waker::wake);
    }

    /// Waits until a signal may be sent to the input, if `waits`, and counts it.
    fn enter(&self, name: &str, waits: bool) -> Result<(), SendError> {
        let mut table = self.state();
        loop {
            match table.enter(name, None) {
                Err(SendError::Full(_)) if waits => {
                    table = self.room.wait(table).unwrap_or_else(PoisonError::into_inner);
                }
                entered => return entered,
            }
        }
    }

    /// As [`Doors::enter`], for a driver, which is woken when there may be room.
    pub(super) fn poll_enter(&self, name: &str, entry: DoorEntry<'_>) -> Poll<Result<(), SendError>> {
        let mut table = self.state();
        match table.enter(name, entry.limit) {
            Err(SendError::Full(_)) => {
                if let Some(waker) = entry.waker
                    && !table.wakers.iter().any(|known| known.will_wake(waker))
                {
                    table.wakers.push(waker.clone());
                }
                Poll::Pending
            }
            entered => Poll::Ready(entered),
        }
    }
}

impl Inbox {
    /// Says that there is an input of this name; with a capacity, if senders wait when it is full.
    #[doc(hidden)]
    pub fn open_door(&self, name: &str, capacity: Option<usize>) {
        self.doors().state().doors.entry(name.into()).or_default().capacity = capacity;
        self.doors().change(name, |_| {});
    }

    /// Says that the input is no more.
    #[doc(hidden)]
    pub fn remove_door(&self, name: &str) {
        self.doors().change_table(|table| _ = table.doors.remove(name));
    }

    /// Says that a signal that was sent to the input has come.
    #[doc(hidden)]
    pub fn note_arrival(&self, name: &str) {
        self.doors().change(name, |door| door.sent = door.sent.saturating_sub(1));
    }

    /// Says how many signals the input keeps.
    #[doc(hidden)]
    pub fn note_kept(&self, name: &str, kept: usize) {
        self.doors().change(name, |door| door.kept = kept);
    }

    /// Says that the machine is gone.
    #[doc(hidden)]
    pub fn close_doors(&self) {
        self.doors().change_table(|table| table.is_closed = true);
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
/// Clones are the same sender. What is sent comes into the inbox in the order of sending.
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
        self.send(input, arguments, true)
    }

    /// Signals an input, as [`Sender::signal`], without waiting.
    ///
    /// # Errors
    /// [`SendError`].
    pub fn try_signal(&self, input: &str, arguments: Vec<Datum>) -> Result<(), SendError> {
        self.send(input, arguments, false)
    }

    fn send(&self, input: &str, arguments: Vec<Datum>, waits: bool) -> Result<(), SendError> {
        let input = input.to_uppercase();
        self.inbox().doors().enter(&input, waits)?;
        self.inbox().put(Incoming::Message { input, arguments });
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
        inbox.open_door("GO", Some(1));
        assert_eq!((outcome("go"), outcome("go")), (Ok(()), Err(SendError::Full("GO".into()))));
        inbox.note_arrival("GO");
        inbox.note_kept("GO", 1);
        assert_eq!(outcome("go"), Err(SendError::Full("GO".into())));
        inbox.open_door("GO", None);
        assert_eq!(outcome("go"), Ok(()));
        inbox.close_doors();
        assert_eq!(outcome("go"), Err(SendError::Ended));
    }

    #[test]
    fn a_sender_waits_for_room() {
        let inbox = Inbox::new();
        inbox.open_door("GO", Some(1));
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
