//! The state that the operations of a program share with the task of its connection.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

use esl_bytecode::datum::Datum;
use esl_host::{HostFailure, HostObject, IntoDatum};
use tokio::sync::{Notify, mpsc, oneshot, watch};
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::protocol::CloseFrame;

use super::{MOST_BYTES, MOST_WAITING, SocketLimits, ws_failure};
use crate::slot::OpenSlot;
use crate::socket::lock;

/// How a connection has ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum ConnectionEnd {
    /// One side has closed it, with this code and reason.
    Closed(u16, String),
    /// It was lost.
    Lost(String),
    /// The peer has broken the protocol; the code that it was told.
    Broken(u16, String),
    /// The peer has sent a message that is too long.
    TooLong(String),
}

impl ConnectionEnd {
    /// Returns whether the peer has said all that it wanted to say.
    fn is_ordinary(&self) -> bool {
        matches!(self, ConnectionEnd::Closed(1000 | 1001 | 1005, _))
    }

    fn code_and_reason(&self) -> (u16, String) {
        match self {
            ConnectionEnd::Closed(code, reason) | ConnectionEnd::Broken(code, reason) => {
                (*code, reason.clone())
            }
            ConnectionEnd::Lost(reason) => (1006, reason.clone()),
            ConnectionEnd::TooLong(reason) => (1009, reason.clone()),
        }
    }

    fn failure(&self) -> HostFailure {
        match self {
            ConnectionEnd::Closed(code, reason) => HostFailure {
                cause: "CONNECTION-CLOSED".into(),
                arguments: vec![code.into_datum(), reason.as_str().into_datum()],
            },
            ConnectionEnd::Lost(reason) => HostFailure::new("CONNECTION-LOST", reason),
            ConnectionEnd::Broken(_, reason) => HostFailure::new("PROTOCOL-ERROR", reason),
            ConnectionEnd::TooLong(reason) => HostFailure::new("MESSAGE-TOO-LONG", reason),
        }
    }
}

/// Messages that wait for the program.
#[derive(Default)]
struct WaitingMessages {
    messages: VecDeque<(Datum, usize)>,
    /// Their bytes.
    bytes: usize,
}

/// The messages that have arrived, and the end.
pub(super) struct Arrivals {
    waiting: Mutex<WaitingMessages>,
    largest: usize,
    end: watch::Sender<Option<ConnectionEnd>>,
    /// Notified when a message has arrived, and at the end.
    came: Notify,
    /// Notified when the program has taken a message.
    pub(super) taken: Notify,
    /// Held by the operation that waits, so that each of several is woken.
    turn: tokio::sync::Mutex<()>,
}

impl Arrivals {
    fn new(largest: usize) -> Arrivals {
        Arrivals {
            waiting: Mutex::default(),
            largest,
            end: watch::Sender::new(None),
            came: Notify::new(),
            taken: Notify::new(),
            turn: tokio::sync::Mutex::default(),
        }
    }

    /// Returns whether one more message may be read.
    pub(super) fn has_room(&self) -> bool {
        let waiting = lock(&self.waiting);
        waiting.messages.len() < MOST_WAITING && waiting.bytes < self.largest
    }

    /// Adds a message of so many bytes.
    pub(super) fn add(&self, message: Datum, size: usize) {
        {
            let mut waiting = lock(&self.waiting);
            waiting.messages.push_back((message, size));
            waiting.bytes += size;
        }
        // The operation that waits goes on in here, and looks for the message.
        self.came.notify_one();
    }

    /// Notes how the connection has ended, unless it is known.
    pub(super) fn note_end(&self, end: ConnectionEnd) {
        self.end.send_if_modified(|known| {
            let is_new = known.is_none();
            known.get_or_insert(end);
            is_new
        });
        self.came.notify_one();
    }

    fn is_something(&self) -> bool {
        !lock(&self.waiting).messages.is_empty() || self.end.borrow().is_some()
    }

    fn known_end(&self) -> Option<ConnectionEnd> {
        self.end.borrow().clone()
    }
}

/// A message that the program sends, and where it is told that the system has taken it.
pub(super) struct SendRequest {
    pub(super) message: Message,
    pub(super) done: oneshot::Sender<()>,
}

/// The part of a connection that its task has.
pub(super) struct DriverEnd {
    pub(super) arrivals: Arc<Arrivals>,
    pub(super) requests: mpsc::Receiver<SendRequest>,
    /// Gets the frame by which the program closes the connection; its sender is dropped when the program has
    /// lost it.
    pub(super) closing: watch::Receiver<Option<CloseFrame>>,
    /// Dropped when the task has ended.
    _finished: watch::Sender<()>,
}

impl Drop for DriverEnd {
    fn drop(&mut self) {
        // If the task ends in another way than by its own: the connection was never begun.
        self.arrivals.note_end(ConnectionEnd::Lost("the connection was lost before it was begun".into()));
    }
}

/// An open connection, as the operations use it.
pub(super) struct OpenConnection {
    arrivals: Arc<Arrivals>,
    requests: mpsc::Sender<SendRequest>,
    closing: watch::Sender<Option<CloseFrame>>,
    finished: watch::Receiver<()>,
}

/// Returns both parts of a connection.
pub(super) fn ends(limits: SocketLimits) -> (OpenConnection, DriverEnd) {
    let arrivals = Arc::new(Arrivals::new(limits.largest));
    let (request, requests) = mpsc::channel(1);
    let (close, closing) = watch::channel(None);
    let (finish, finished) = watch::channel(());
    let driver = DriverEnd { arrivals: arrivals.clone(), requests, closing, _finished: finish };
    (OpenConnection { arrivals, requests: request, closing: close, finished }, driver)
}

impl OpenConnection {
    /// Sends a message, and waits until the system has taken it. If the call is left before its turn, nothing
    /// is sent.
    pub(super) async fn send(&self, message: Message) -> Result<(), HostFailure> {
        if message.len() > MOST_BYTES {
            let length = message.len();
            return Err(ws_failure(format!("the message has {length} bytes: at most {MOST_BYTES} are sent")));
        }
        let (done, is_done) = oneshot::channel();
        let is_closing = self.closing.borrow().is_some();
        if !is_closing
            && self.requests.send(SendRequest { message, done }).await.is_ok()
            && is_done.await.is_ok()
        {
            return Ok(());
        }
        Err(self.known_end().await.failure())
    }

    /// Takes the next message: `NIL` if there is none, `T` at an ordinary end if `is_lenient`.
    pub(super) fn take(&self, is_lenient: bool) -> Result<Datum, HostFailure> {
        // Before the messages: all that came before the end are there.
        let end = self.arrivals.known_end();
        let taken = {
            let mut waiting = lock(&self.arrivals.waiting);
            let taken = waiting.messages.pop_front();
            waiting.bytes -= taken.as_ref().map_or(0, |(_, size)| *size);
            taken
        };
        match (taken, end) {
            (Some((message, _)), _) => {
                self.arrivals.taken.notify_one();
                Ok(message)
            }
            (None, None) => Ok(().into_datum()),
            (None, Some(end)) if is_lenient && end.is_ordinary() => Ok(true.into_datum()),
            (None, Some(end)) => Err(end.failure()),
        }
    }

    /// Waits until there is a message, or the connection has ended.
    pub(super) async fn arrival(&self) {
        let _turn = self.arrivals.turn.lock().await;
        while !self.arrivals.is_something() {
            self.arrivals.came.notified().await;
        }
    }

    /// Waits until the connection has ended. Returns code and reason.
    pub(super) async fn end(&self) -> (u16, String) {
        self.known_end().await.code_and_reason()
    }

    async fn known_end(&self) -> ConnectionEnd {
        let mut end = self.arrivals.end.subscribe();
        // Its sender is part of this connection.
        let known = end.wait_for(Option::is_some).await.ok().and_then(|end| end.clone());
        known.unwrap_or_else(|| ConnectionEnd::Lost(String::new()))
    }
}

/// A connection of the program's; nothing before it is open.
#[derive(Default)]
pub(super) struct WsConnection(OpenSlot<OpenConnection>);

impl HostObject for WsConnection {
    const KIND: &'static str = "WS-CONNECTION";
}

impl WsConnection {
    pub(super) fn get(&self) -> Result<Arc<OpenConnection>, HostFailure> {
        self.0.get().ok_or_else(|| ws_failure("the connection is not open"))
    }

    /// Puts an open connection into its place. Fails if the program has closed it meanwhile.
    pub(super) fn open(&self, connection: OpenConnection) -> Result<(), HostFailure> {
        if self.0.open(connection) { Ok(()) } else { Err(ws_failure("the connection was closed")) }
    }

    /// Closes the connection, or the place of one that is not open, and waits until its task has ended.
    pub(super) async fn close(&self, frame: CloseFrame) {
        let Some(connection) = self.0.get() else {
            drop(self.0.close());
            return;
        };
        connection.closing.send_if_modified(|known| {
            let is_new = known.is_none();
            known.get_or_insert(frame);
            is_new
        });
        // Nothing is ever sent: it ends when the task does.
        let mut finished = connection.finished.clone();
        while finished.changed().await.is_ok() {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    fn limits(largest: usize) -> SocketLimits {
        SocketLimits::new(largest, None).expect("there is no time")
    }

    #[test]
    fn messages_are_bounded_by_their_bytes_and_their_number() {
        let (_connection, driver) = ends(limits(100));
        driver.arrivals.add("x".into_datum(), 99);
        assert!(driver.arrivals.has_room());
        driver.arrivals.add("x".into_datum(), 99);
        assert!(!driver.arrivals.has_room());
        let (connection, driver) = ends(limits(100));
        (0..MOST_WAITING).for_each(|_| driver.arrivals.add("".into_datum(), 0));
        assert!(!driver.arrivals.has_room());
        assert!(connection.take(false).is_ok_and(|message| !message.is_nil()));
        assert!(driver.arrivals.has_room());
    }

    #[test]
    fn the_end_comes_behind_the_messages() {
        let (connection, driver) = ends(limits(100));
        assert!(connection.take(true).is_ok_and(|nothing| nothing.is_nil()));
        driver.arrivals.add("last".into_datum(), 4);
        driver.arrivals.note_end(ConnectionEnd::Closed(1000, "done".into()));
        drop(driver);
        assert!(connection.take(true).is_ok_and(|last| last.to_string() == "\"last\""));
        assert!(connection.take(true).is_ok_and(|end| !end.is_nil()));
        let failure = connection.take(false).expect_err("it has ended");
        assert_eq!((failure.cause.as_str(), failure.arguments.len()), ("CONNECTION-CLOSED", 2));
    }

    #[test]
    fn only_an_ordinary_end_is_no_failure() {
        for (end, is_ordinary) in [
            (ConnectionEnd::Closed(1001, String::new()), true),
            (ConnectionEnd::Closed(1005, String::new()), true),
            (ConnectionEnd::Closed(4000, String::new()), false),
            (ConnectionEnd::Lost(String::new()), false),
            (ConnectionEnd::Broken(1002, String::new()), false),
            (ConnectionEnd::TooLong(String::new()), false),
        ] {
            assert_eq!(end.is_ordinary(), is_ordinary, "{end:?}");
        }
    }

    #[test]
    fn a_connection_that_is_never_begun_is_lost_and_every_waiting_call_learns_it() {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build();
        runtime.expect("there is room").block_on(async {
            let (connection, driver) = ends(limits(100));
            let give_up = async {
                tokio::time::sleep(Duration::from_millis(1)).await;
                drop(driver);
            };
            let waits =
                async { tokio::join!(connection.arrival(), connection.arrival(), connection.end()).2 };
            let ((code, _), ()) = tokio::join!(waits, give_up);
            assert_eq!(code, 1006);
            assert!(
                connection.send(Message::text("x")).await.is_err_and(|lost| lost.cause == "CONNECTION-LOST")
            );
        });
    }
}
