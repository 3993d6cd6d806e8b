//! Inputs of a program that the host itself signals: a driver pushes arrivals, and waits while there is no
//! room.

use std::fmt;
use std::future::poll_fn;
use std::sync::Arc;

use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::span::Span;

use super::argument::{ArgumentReader, FromCall};
use super::sender::AdmissionRequest;
use super::{HostFailure, Inbox, Incoming, SendError};

/// Most signals of one input that are on their way to the machine, whatever its rule is: a driver that is
/// faster than the machine waits.
const MOST_SENT: usize = 1000;
/// Most bytes of them, as far as they are like the one that follows.
const MOST_SENT_BYTES: usize = 16 << 20;

/// Returns the number of signals with so many bytes that may be on their way.
fn most_sent(bytes: usize) -> usize {
    (MOST_SENT_BYTES / bytes.max(1)).clamp(1, MOST_SENT)
}

/// An input of a program, which the program has named in a call. Unlike a [`Sender`](super::Sender) it does
/// not keep a program that waits from being deadlocked.
#[derive(Clone)]
pub struct HostInput {
    inbox: Inbox,
    name: Arc<str>,
}

impl fmt::Debug for HostInput {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("HostInput").field(&self.name).finish()
    }
}

impl HostInput {
    /// Returns the input with this name, as it is spelt in the program.
    pub fn new(inbox: &Inbox, name: &str) -> HostInput {
        HostInput { inbox: inbox.clone(), name: name.into() }
    }

    /// Returns the name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Signals the input. Waits while there is no room for the signal: if the rule of the input is that
    /// senders wait, or if too many signals are on their way.
    ///
    /// # Errors
    /// [`SendError::NoSuchInput`], if the program has removed it, and [`SendError::Ended`].
    pub async fn signal(&self, arguments: Vec<Datum>) -> Result<(), SendError> {
        self.signal_sized(0, arguments).await
    }

    /// As [`HostInput::signal`], with arguments of so many bytes: of large ones, fewer are on their way.
    ///
    /// # Errors
    /// As above.
    pub async fn signal_sized(&self, bytes: usize, arguments: Vec<Datum>) -> Result<(), SendError> {
        poll_fn(|context| {
            let limit = Some(most_sent(bytes));
            let request = AdmissionRequest { limit, waker: Some(context.waker()) };
            self.inbox.admission().poll_admit(&self.name, request)
        })
        .await?;
        self.put(arguments);
        Ok(())
    }

    /// Signals the input, as [`HostInput::signal`], without waiting.
    ///
    /// # Errors
    /// [`SendError`].
    pub fn try_signal(&self, arguments: Vec<Datum>) -> Result<(), SendError> {
        self.try_signal_by(0, || arguments)
    }

    /// Signals the input, as [`HostInput::try_signal`], with the arguments of so many bytes that `make`
    /// makes: only if there is room.
    ///
    /// # Errors
    /// [`SendError`].
    pub fn try_signal_by(&self, bytes: usize, make: impl FnOnce() -> Vec<Datum>) -> Result<(), SendError> {
        let request = AdmissionRequest { limit: Some(most_sent(bytes)), waker: None };
        match self.inbox.admission().poll_admit(&self.name, request) {
            std::task::Poll::Ready(admitted) => admitted?,
            std::task::Poll::Pending => return Err(SendError::Full(self.name.to_string())),
        }
        self.put(make());
        Ok(())
    }

    fn put(&self, arguments: Vec<Datum>) {
        self.inbox.put(Incoming::Message { input: self.name.clone(), arguments });
    }
}

/// An argument that is the name of an input, a string.
impl FromCall for HostInput {
    const COUNT: usize = 1;

    fn from_call(call: &mut ArgumentReader<'_>) -> Result<HostInput, HostFailure> {
        match call.next_datum().map(Datum::kind) {
            Some(DatumKind::String(name)) => Ok(HostInput::new(call.inbox(), name)),
            Some(other) => Err(HostFailure::of_type(&Datum::new(other.clone(), Span::default()), "STRING")),
            None => Err(HostFailure::of_type(&Datum::nil(Span::default()), "STRING")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::pin::pin;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::task::{Context, Poll, Wake, Waker};

    #[derive(Default)]
    struct Count(AtomicUsize);

    impl Wake for Count {
        fn wake(self: Arc<Count>) {
            self.0.fetch_add(1, Ordering::Relaxed);
        }
    }

    #[test]
    fn a_driver_waits_for_room_and_is_woken() {
        let inbox = Inbox::new();
        let input = HostInput::new(&inbox, "scan 1");
        assert_eq!(input.try_signal(Vec::new()), Err(SendError::NoSuchInput("scan 1".into())));
        inbox.open_input("scan 1", Some(1));
        assert_eq!(input.try_signal(Vec::new()), Ok(()));
        assert_eq!(input.try_signal(Vec::new()), Err(SendError::Full("scan 1".into())));
        let woken = Arc::new(Count::default());
        let waker = Waker::from(woken.clone());
        let mut context = Context::from_waker(&waker);
        let mut signal = pin!(input.signal(Vec::new()));
        assert_eq!(signal.as_mut().poll(&mut context), Poll::Pending);
        inbox.note_arrival("scan 1");
        assert_eq!(woken.0.load(Ordering::Relaxed), 1);
        assert_eq!(signal.as_mut().poll(&mut context), Poll::Ready(Ok(())));
        assert_eq!(inbox.take().len(), 2);
        let mut signal = pin!(input.signal(Vec::new()));
        assert_eq!(signal.as_mut().poll(&mut context), Poll::Pending);
        inbox.remove_input("scan 1");
        assert!(matches!(signal.as_mut().poll(&mut context), Poll::Ready(Err(SendError::NoSuchInput(_)))));
    }

    #[test]
    fn signals_on_their_way_are_bounded_whatever_the_rule() {
        let inbox = Inbox::new();
        inbox.open_input("A", None);
        let input = HostInput::new(&inbox, "A");
        let sent = std::iter::repeat_with(|| input.try_signal(Vec::new())).take_while(Result::is_ok).count();
        assert_eq!(sent, MOST_SENT);
        inbox.open_input("B", None);
        let input = HostInput::new(&inbox, "B");
        let large = || input.try_signal_by(MOST_SENT_BYTES / 3, Vec::new);
        assert_eq!(std::iter::repeat_with(large).take_while(Result::is_ok).count(), 3);
        // One goes whatever it has; small ones go beside it.
        inbox.open_input("C", None);
        let input = HostInput::new(&inbox, "C");
        assert_eq!(input.try_signal_by(10 * MOST_SENT_BYTES, Vec::new), Ok(()));
        assert!(input.try_signal_by(10 * MOST_SENT_BYTES, Vec::new).is_err());
        assert_eq!(input.try_signal_by(1, Vec::new), Ok(()));
    }
}
