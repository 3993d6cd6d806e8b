//! Sockets: connections over TCP and Unix sockets, listeners, and UDP.
//!
//! A program holds a socket by a handle, and with the last one the socket is closed. Here is what each
//! function of `:sockets` is; the kinds have a module each.

mod connection;
mod datagram;
mod listener;

use std::cell::RefCell;
use std::collections::VecDeque;
use std::io::{Error, ErrorKind};
use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use esl_host::{HostFailure, HostHandle, HostObject, HostRows, Inbox, Right};
use tokio::net::UdpSocket;
use tokio::sync::watch;

pub(crate) use connection::Connection;
use datagram::Datagrams;
use listener::Listener;
pub(crate) use listener::bind_failure;
#[cfg(feature = "http")]
pub(crate) use listener::{bind, next as next_connection};

use crate::arrived::Arrived;
use crate::operation::ready_soon;

/// Most bytes that are read at a time.
const CHUNK: usize = 1 << 16;

thread_local! {
    /// Where what is read is put first, so that a socket that waits has no such room of its own.
    static READ: RefCell<Vec<u8>> = RefCell::new(vec![0; CHUNK]);
}

/// A connection, its port here, and the address there.
type NewConnection = (SocketKind, i64, String);

/// The kind of a socket.
#[derive(Clone)]
pub(crate) enum SocketKind {
    /// Not connected yet.
    New,
    Connection(Arc<Connection>),
    /// With the connections that the program has not taken.
    Listener(Arc<Listener>, Arc<Mutex<VecDeque<NewConnection>>>),
    Udp(Arc<UdpSocket>, Datagrams),
    Closed,
}

/// A socket of the program's.
pub(crate) struct Socket {
    /// Its kind, its port here, and the address there.
    state: Mutex<NewConnection>,
    /// Becomes true when the socket is closed.
    closing: watch::Sender<bool>,
}

impl HostObject for Socket {
    const KIND: &'static str = "SOCKET";
}

pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // The guarded data are consistent at every moment, so a panic elsewhere does not corrupt them.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Reason why a socket is not what a call needs.
#[derive(Clone, Copy, Debug)]
enum SocketFault {
    Closed,
    NotConnected,
    NotUdp,
    NotListening,
}

impl From<SocketFault> for HostFailure {
    fn from(fault: SocketFault) -> HostFailure {
        match fault {
            SocketFault::Closed => HostFailure::new("SOCKET-CLOSED", "the socket is closed"),
            SocketFault::NotConnected => HostFailure::new("SOCKET-ERROR", "it is not connected"),
            SocketFault::NotUdp => HostFailure::new("SOCKET-ERROR", "it is not a UDP socket"),
            SocketFault::NotListening => HostFailure::new("SOCKET-ERROR", "it is not a listener"),
        }
    }
}

/// Returns the failure of a socket for an error of the system.
pub fn socket_failure(error: &Error) -> HostFailure {
    let cause = match error.kind() {
        ErrorKind::ConnectionRefused => "CONNECTION-REFUSED",
        ErrorKind::ConnectionReset | ErrorKind::ConnectionAborted | ErrorKind::BrokenPipe => {
            "CONNECTION-LOST"
        }
        ErrorKind::AddrInUse => "ADDRESS-IN-USE",
        ErrorKind::TimedOut => "TIMEOUT",
        _ => "SOCKET-ERROR",
    };
    HostFailure::new(cause, error)
}

impl Socket {
    fn new(state: NewConnection) -> Socket {
        Socket { state: Mutex::new(state), closing: watch::Sender::new(false) }
    }

    /// Returns what it is.
    fn kind(&self) -> Result<SocketKind, SocketFault> {
        self.check().map(|state| state.0.clone())
    }

    fn check(&self) -> Result<MutexGuard<'_, NewConnection>, SocketFault> {
        let state = lock(&self.state);
        if matches!(state.0, SocketKind::Closed) { Err(SocketFault::Closed) } else { Ok(state) }
    }

    /// Says what a new socket is. It may have been closed meanwhile.
    pub(crate) fn set(&self, connection: NewConnection) -> Result<(), HostFailure> {
        *self.check()? = connection;
        Ok(())
    }

    fn close(&self) {
        let kind = std::mem::replace(&mut lock(&self.state).0, SocketKind::Closed);
        // No operation may wait for it.
        self.closing.send_replace(true);
        close_kind(&kind);
    }

    fn connection(&self) -> Result<Arc<Connection>, SocketFault> {
        match self.kind()? {
            SocketKind::Connection(connection) => Ok(connection),
            _ => Err(SocketFault::NotConnected),
        }
    }

    fn datagrams(&self) -> Result<(Arc<UdpSocket>, Datagrams), SocketFault> {
        match self.kind()? {
            SocketKind::Udp(socket, datagrams) => Ok((socket, datagrams)),
            _ => Err(SocketFault::NotUdp),
        }
    }
}

impl Drop for Socket {
    fn drop(&mut self) {
        self.close();
    }
}

fn close_kind(kind: &SocketKind) {
    match kind {
        SocketKind::Listener(_, accepted) => close_untaken(accepted),
        SocketKind::Connection(connection) => connection.close(),
        SocketKind::New | SocketKind::Udp(..) | SocketKind::Closed => {}
    }
}

/// Closes the accepted connections of a closed listener, which cannot be taken any more.
fn close_untaken(accepted: &Mutex<VecDeque<NewConnection>>) {
    let untaken = std::mem::take(&mut *lock(accepted));
    untaken.iter().for_each(|(kind, ..)| close_kind(kind));
}

/// Returns what a future comes to, unless the socket is closed before. It is not moved here, which would
/// double the size of the waiting future.
async fn unless_closed<T>(
    mut closing: watch::Receiver<bool>,
    future: Pin<&mut impl Future<Output = Result<T, HostFailure>>>,
) -> Result<T, HostFailure> {
    tokio::select! {
        biased;
        _ = closing.wait_for(|&is_closed| is_closed) => Err(SocketFault::Closed.into()),
        result = future => result,
    }
}

/// Returns the functions of `:sockets`.
pub(crate) fn rows(inbox: &Inbox) -> HostRows {
    let mut rows = HostRows::new(inbox);
    add_connections(&mut rows);
    add_listeners(&mut rows);
    rows.operation(
        ready_soon,
        "%UDP-OPEN",
        ["socket", "address"],
        "Opens SOCKET for datagrams at ADDRESS.",
        datagram::open,
    )
    .needs(Right::Net, "address");
    rows.operation(
        ready_soon,
        "%UDP-SEND",
        ["socket", "address", "contents"],
        "Sends a datagram to ADDRESS.",
        datagram::send,
    )
    .needs(Right::Net, "address");
    rows.operation(ready_soon, "%UDP-AWAIT", ["socket"], "Waits for a datagram.", datagram::wait);
    rows.at_once("%UDP-TAKE", ["socket"], "Takes a datagram: its bytes and its sender.", datagram::take)
        .local();
    rows
}

/// Adds the functions of sockets in general, and of connections.
fn add_connections(rows: &mut HostRows) {
    let mut count = 0;
    let made = Arc::new(Mutex::new(move || {
        count += 1;
        count
    }));
    let next = made.clone();
    rows.at_once("%SOCKET-NEW", [], "Returns a socket that is not connected.", move || {
        let number = lock(&next)();
        Ok(HostHandle::new(number, Socket::new((SocketKind::New, 0, String::new()))))
    })
    .local();
    rows.at_once("%SOCKET-ACCEPTED", ["listener"], "Takes a connection, or NIL.", {
        move |listener: HostHandle<Socket>| match listener.kind()? {
            SocketKind::Listener(_, accepted) => {
                let connection = lock(&accepted).pop_front();
                Ok(connection.map(|connection| HostHandle::new(lock(&made)(), Socket::new(connection))))
            }
            _ => Err(SocketFault::NotListening.into()),
        }
    })
    .local();
    rows.at_once("%SOCKET-CLOSE", ["socket"], "Closes SOCKET.", |socket: HostHandle<Socket>| {
        socket.close();
        Ok(())
    })
    .closes();
    rows.at_once("%SOCKET-PORT", ["socket"], "Returns the port here.", |socket: HostHandle<Socket>| {
        Ok(socket.check()?.1)
    })
    .local();
    rows.at_once("%SOCKET-PEER", ["socket"], "Returns the address there.", |socket: HostHandle<Socket>| {
        Ok(socket.check()?.2.clone())
    })
    .local();
    rows.operation(
        ready_soon,
        "%SOCKET-CONNECT",
        ["socket", "address", "milliseconds", "server-name", "ca-file"],
        "Connects SOCKET to ADDRESS, within so many milliseconds; by TLS, if there is a SERVER-NAME.",
        connection::connect,
    )
    .needs(Right::Net, "address")
    .needs(Right::Read, "ca-file");
    #[cfg(unix)]
    rows.operation(
        ready_soon,
        "%SOCKET-CONNECT-UNIX",
        ["socket", "path"],
        "Connects SOCKET to the Unix socket PATH.",
        connection::connect_unix,
    )
    .needs(Right::Read, "path")
    .needs(Right::Write, "path");
    rows.operation(ready_soon, "%SOCKET-AWAIT", ["socket"], "Waits for data.", connection::wait);
    rows.at_once(
        "%SOCKET-TAKE-LINES",
        ["socket"],
        "Takes whole lines, or characters, so that bytes may follow; NIL at the end.",
        |socket: HostHandle<Socket>| Ok(socket.connection()?.take(Arrived::take_lines)),
    )
    .local();
    rows.at_once(
        "%SOCKET-TAKE-BYTES",
        ["socket", "limit"],
        "Takes at most LIMIT bytes; NIL at the end.",
        |socket: HostHandle<Socket>, limit: usize| {
            Ok(socket.connection()?.take(|arrived| arrived.take_bytes(limit)))
        },
    )
    .local();
    rows.at_once(
        "%SOCKET-SEND",
        ["socket", "contents"],
        "Writes CONTENTS, a text or bytes, as far as the system takes them without delay. Returns NIL if that was \
         all; otherwise T if the rest is kept, and 0 if another task writes.",
        connection::send,
    );
    rows.operation(
        ready_soon,
        "%SOCKET-WRITE",
        ["socket", "contents"],
        "Writes the unsent bytes, and CONTENTS, a text or bytes.",
        connection::write,
    );
}

/// Adds the functions of listeners.
fn add_listeners(rows: &mut HostRows) {
    rows.operation(
        ready_soon,
        "%SOCKET-LISTEN",
        ["socket", "address", "certificate", "key"],
        "Makes SOCKET listen at ADDRESS; by TLS, if there are files of CERTIFICATE and KEY.",
        listener::listen,
    )
    .needs(Right::Net, "address")
    .needs(Right::Read, "certificate")
    .needs(Right::Read, "key");
    #[cfg(unix)]
    rows.operation(
        ready_soon,
        "%SOCKET-LISTEN-UNIX",
        ["socket", "path"],
        "Makes SOCKET listen at the Unix socket PATH.",
        listener::listen_unix,
    )
    .needs(Right::Read, "path")
    .needs(Right::Write, "path");
    rows.operation(ready_soon, "%SOCKET-ACCEPT", ["listener"], "Waits for a connection.", listener::accept);
}
