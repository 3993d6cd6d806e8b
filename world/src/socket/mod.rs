//! Sockets: connections over TCP and Unix sockets, listeners, and UDP.
//!
//! A program knows a socket by its number. Here is the table of them, and what each function of `:sockets`
//! is; the kinds have a module each.

mod connection;
mod datagram;
mod listener;

use std::cell::RefCell;
use std::collections::{HashMap, VecDeque};
use std::io::{Error, ErrorKind};
use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_host::{HostFailure, Right};
use esl_vm::embed::{HostFunction, Need};
use esl_vm::vm::Vm;
use tokio::net::UdpSocket;
use tokio::sync::watch;

pub(crate) use connection::Connection;
use datagram::Datagrams;
use listener::Listener;
pub(crate) use listener::bind_failure;
#[cfg(feature = "http")]
pub(crate) use listener::{bind, next as next_connection};

use crate::arrived::{Arrived, whole_characters};
use crate::data::{CallArguments, failure, handle, integer, nil, text, text_of_bytes};
#[cfg(feature = "serial")]
use crate::operation::define;
use crate::operation::{Completion, OperationFuture, define_ready};

/// Most bytes that are read at a time.
const CHUNK: usize = 1 << 16;

thread_local! {
    /// Where what is read is put first, so that a socket that waits has no such room of its own.
    static READ: RefCell<Vec<u8>> = RefCell::new(vec![0; CHUNK]);
}

/// A connection, its port here, and the address there.
type NewConnection = (SocketKind, i64, String);

/// What a socket is.
#[derive(Clone)]
pub(crate) enum SocketKind {
    /// Not connected yet.
    New,
    Connection(Arc<Connection>),
    /// With the numbers of connections that the program has not taken.
    Listener(Arc<Listener>, Arc<Mutex<VecDeque<i64>>>),
    Udp(Arc<UdpSocket>, Datagrams),
}

struct Socket {
    kind: SocketKind,
    port: i64,
    peer: String,
    /// Becomes true when the socket is closed.
    closing: Arc<watch::Sender<bool>>,
}

/// The greatest number so far, and the sockets by number.
type SocketTable = (i64, HashMap<i64, Arc<Socket>>);

/// The sockets of a machine, by number.
#[derive(Clone, Default)]
pub(crate) struct Sockets(Arc<Mutex<SocketTable>>);

pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // What it guards is whole at every moment, so a panic elsewhere does not corrupt it.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn closed() -> HostFailure {
    failure("SOCKET-CLOSED", "the socket is closed")
}

/// Returns the failure for an error of the system.
pub(crate) fn socket_failure(error: &Error) -> HostFailure {
    let cause = match error.kind() {
        ErrorKind::ConnectionRefused => "CONNECTION-REFUSED",
        ErrorKind::ConnectionReset | ErrorKind::ConnectionAborted | ErrorKind::BrokenPipe => {
            "CONNECTION-LOST"
        }
        ErrorKind::AddrInUse => "ADDRESS-IN-USE",
        ErrorKind::TimedOut => "TIMEOUT",
        _ => "SOCKET-ERROR",
    };
    failure(cause, error)
}

impl Sockets {
    fn add(&self, kind: SocketKind, port: i64, peer: String) -> i64 {
        let closing = Arc::new(watch::Sender::new(false));
        let mut sockets = lock(&self.0);
        sockets.0 += 1;
        let number = sockets.0;
        sockets.1.insert(number, Arc::new(Socket { kind, port, peer, closing }));
        number
    }

    /// Returns what the program holds of a socket: if it is lost, the socket is closed.
    fn handle(&self, number: i64) -> Datum {
        let known = self.clone();
        handle("SOCKET", number, move |number| known.close(number))
    }

    fn get(&self, number: i64) -> Result<Arc<Socket>, HostFailure> {
        lock(&self.0).1.get(&number).cloned().ok_or_else(closed)
    }

    /// Says what a new socket is. It may have been closed meanwhile.
    pub(crate) fn set(&self, number: i64, kind: SocketKind, port: i64, peer: String) -> Completion {
        let mut sockets = lock(&self.0);
        let socket = sockets.1.get_mut(&number).ok_or_else(closed)?;
        *socket = Arc::new(Socket { kind, port, peer, closing: socket.closing.clone() });
        Ok(vec![integer(number)])
    }

    fn close(&self, number: i64) {
        let socket = lock(&self.0).1.remove(&number);
        if let Some(socket) = socket {
            // Nobody may wait for it.
            socket.closing.send_replace(true);
            match &socket.kind {
                SocketKind::Listener(_, accepted) => self.close_untaken(accepted),
                SocketKind::Connection(connection) => connection.close(),
                SocketKind::New | SocketKind::Udp(..) => {}
            }
        }
    }

    /// Closes the connections of a listener that is closed, which nobody can take any more.
    fn close_untaken(&self, accepted: &Mutex<VecDeque<i64>>) {
        let untaken = std::mem::take(&mut *lock(accepted));
        untaken.into_iter().for_each(|number| self.close(number));
    }
}

impl Socket {
    fn connection(&self) -> Result<Arc<Connection>, HostFailure> {
        match &self.kind {
            SocketKind::Connection(connection) => Ok(connection.clone()),
            _ => Err(failure("SOCKET-ERROR", "it is not connected")),
        }
    }

    fn datagrams(&self) -> Result<(Arc<UdpSocket>, Datagrams), HostFailure> {
        match &self.kind {
            SocketKind::Udp(socket, datagrams) => Ok((socket.clone(), datagrams.clone())),
            _ => Err(failure("SOCKET-ERROR", "it is not a UDP socket")),
        }
    }
}

/// Returns what a future comes to, unless the socket is closed before. It is not moved here, which would
/// double the size of whoever waits.
async fn unless_closed<T>(
    mut closing: watch::Receiver<bool>,
    future: Pin<&mut impl Future<Output = Result<T, HostFailure>>>,
) -> Result<T, HostFailure> {
    tokio::select! {
        biased;
        _ = closing.wait_for(|&is_closed| is_closed) => Err(closed()),
        result = future => result,
    }
}

/// Gives a machine the operations of `:sockets`.
pub(crate) fn install(machine: &mut Vm, sockets: &Sockets) {
    define_immediate(machine, sockets);
    let net = [Need { right: Right::Net, argument: 1 }];
    let path = [Need { right: Right::Read, argument: 1 }, Need { right: Right::Write, argument: 1 }];
    #[cfg(feature = "serial")]
    {
        let serial = [Need { right: Right::Serial, argument: 1 }];
        let sockets = sockets.clone();
        // A port may take its time.
        define(machine, "%SERIAL-OPEN", &serial, move |arguments| {
            crate::serial::open(arguments, sockets.clone())
        });
    }
    let mut operation = {
        let sockets = sockets.clone();
        move |name: &str, needs: &[Need], function: SocketFunction| {
            let sockets = sockets.clone();
            define_ready(machine, name, needs, move |arguments| function(arguments, sockets.clone()));
        }
    };
    let connect_needs = [net[0], Need { right: Right::Read, argument: 4 }];
    operation("%SOCKET-CONNECT", &connect_needs, |arguments, sockets| {
        Box::pin(connection::connect(arguments, sockets))
    });
    let listen_needs =
        [net[0], Need { right: Right::Read, argument: 2 }, Need { right: Right::Read, argument: 3 }];
    operation("%SOCKET-LISTEN", &listen_needs, |arguments, sockets| {
        Box::pin(listener::listen(arguments, sockets))
    });
    #[cfg(unix)]
    {
        operation("%SOCKET-CONNECT-UNIX", &path, |arguments, sockets| {
            Box::pin(connection::connect_unix(arguments, sockets))
        });
        operation("%SOCKET-LISTEN-UNIX", &path, |arguments, sockets| {
            Box::pin(listener::listen_unix(arguments, sockets))
        });
    }
    operation("%SOCKET-ACCEPT", &[], |arguments, sockets| Box::pin(listener::accept(arguments, sockets)));
    operation("%SOCKET-AWAIT", &[], |arguments, sockets| connection::wait(&arguments, &sockets));
    operation("%SOCKET-WRITE", &[], |arguments, sockets| Box::pin(connection::write(arguments, sockets)));
    operation("%UDP-OPEN", &net, |arguments, sockets| Box::pin(datagram::open(arguments, sockets)));
    operation("%UDP-SEND", &net, |arguments, sockets| Box::pin(datagram::send(arguments, sockets)));
    operation("%UDP-AWAIT", &[], |arguments, sockets| Box::pin(datagram::wait(arguments, sockets)));
}

type SocketFunction = fn(CallArguments, Sockets) -> OperationFuture;

/// Gives a machine the functions that do not wait.
fn define_immediate(machine: &mut Vm, sockets: &Sockets) {
    let mut define = |name: &str, function: fn(CallArguments, &Sockets) -> Result<Datum, HostFailure>| {
        let sockets = sockets.clone();
        let function = move |arguments: &[Datum]| function(CallArguments(arguments.to_vec()), &sockets);
        machine.add_host_function(name, HostFunction::AtOnce(Box::new(function)));
    };
    define("%SOCKET-NEW", |_, sockets| Ok(sockets.handle(sockets.add(SocketKind::New, 0, String::new()))));
    define("%SOCKET-CLOSE", |arguments, sockets| {
        sockets.close(arguments.number(0)?);
        Ok(nil())
    });
    define("%SOCKET-PORT", |arguments, sockets| Ok(integer(sockets.get(arguments.number(0)?)?.port)));
    define("%SOCKET-PEER", |arguments, sockets| Ok(text(&sockets.get(arguments.number(0)?)?.peer)));
    define("%SOCKET-SEND", connection::send);
    define("%SOCKET-TAKE-LINES", |arguments, sockets| {
        // Not all text is taken, so that bytes may follow a line.
        Ok(sockets.get(arguments.number(0)?)?.connection()?.take(Arrived::take_lines))
    });
    define("%SOCKET-TAKE-BYTES", |arguments, sockets| {
        let connection = sockets.get(arguments.number(0)?)?.connection()?;
        let limit = usize::try_from(arguments.integer(1)?).unwrap_or(0);
        Ok(connection.take(|arrived| arrived.take_bytes(limit)))
    });
    define("%SOCKET-ACCEPTED", |arguments, sockets| match &sockets.get(arguments.number(0)?)?.kind {
        SocketKind::Listener(_, accepted) => {
            Ok(lock(accepted).pop_front().map_or_else(nil, |number| sockets.handle(number)))
        }
        _ => Err(failure("SOCKET-ERROR", "it is no listener")),
    });
    define("%BYTES-OF-TEXT", |arguments, _| Ok(text_of_bytes(arguments.text(0)?.as_bytes())));
    define("%TEXT-OF-BYTES", |arguments, _| {
        let bytes = arguments.bytes(0)?;
        let used = if arguments.is_true(1) { bytes.len() } else { whole_characters(&bytes) };
        let decoded = text(&String::from_utf8_lossy(&bytes[..used]));
        Ok(Datum::list([decoded, integer(used as i64)], Span::default()))
    });
    define("%UDP-TAKE", |arguments, sockets| {
        let (_, datagrams) = sockets.get(arguments.number(0)?)?.datagrams()?;
        let next = lock(&datagrams).pop_front();
        Ok(next.map_or_else(nil, |(bytes, address)| {
            Datum::list([text_of_bytes(&bytes), text(&address)], Span::default())
        }))
    });
}
