//! Sockets: connections over TCP and Unix sockets, listeners, and UDP.
//!
//! What has arrived is kept here until the program takes it, which it does at once, without waiting: an
//! operation only waits until something is there. So nothing is lost when a call is left at the moment at
//! which its data come.
//!
//! A connection reads ahead at most [`CHUNK`] bytes; a peer that sends more waits.

use std::cell::RefCell;
use std::collections::{BTreeMap, HashMap, VecDeque};
use std::future::ready as ready_future;
use std::io::{Error, ErrorKind};
use std::pin::{Pin, pin};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, Wake, Waker, ready};
use std::time::Duration;

use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_vm::embed::{HostFunction, Need};
use esl_vm::host::{HostFailure, Right};
use esl_vm::vm::Vm;
use tokio::io::{AsyncRead, AsyncWrite, AsyncWriteExt, ReadBuf};
use tokio::net::{TcpListener, TcpSocket, TcpStream, UdpSocket};
use tokio::sync::watch;

use crate::arrived::{Arrived, whole_characters};
use crate::data::{CallArguments, bytes_of, failure, handle, integer, nil, text, text_of_bytes};
use crate::event_loop;
#[cfg(feature = "serial")]
use crate::operation::define;
use crate::operation::{Completion, OperationFuture, define_ready};

/// Most bytes that are read at a time.
const CHUNK: usize = 1 << 16;
/// Time that a peer has to prove who it is, and to be shown who we are.
#[cfg(feature = "tls")]
const GREETING: Duration = Duration::from_secs(10);
/// Most peers that are greeted at a time; more wait in the system's queue.
#[cfg(feature = "tls")]
const MOST_GREETED: usize = 256;
/// Most connections that wait in the system until the program accepts them; the system may allow fewer. More
/// than that at one moment are told to come again, which takes them seconds.
const BACKLOG: u32 = 4096;
/// Time that a peer has to take the end of a connection.
const GOODBYE: Duration = Duration::from_secs(1);

type SocketReader = Box<dyn AsyncRead + Send + Unpin>;
type SocketWriter = Box<dyn AsyncWrite + Send + Unpin>;

/// A connection.
pub(crate) struct Connection {
    reader: Mutex<SocketReader>,
    waiting: Arc<Waiting>,
    is_closed: AtomicBool,
    writer: tokio::sync::Mutex<SocketWriter>,
    arrived: Mutex<Arrived>,
    /// Whether the peer is to be told that nothing more comes, beside by the end of the connection.
    says_goodbye: bool,
}

/// A socket that waits for connections.
pub(crate) enum Listener {
    Tcp(TcpListener),
    #[cfg(feature = "tls")]
    Secured(TcpListener, tokio_rustls::TlsAcceptor, Greetings),
    #[cfg(unix)]
    Unix(tokio::net::UnixListener, std::path::PathBuf),
}

#[cfg(unix)]
impl Drop for Listener {
    fn drop(&mut self) {
        if let Listener::Unix(_, path) = self {
            // The file may be gone.
            drop(std::fs::remove_file(path));
        }
    }
}

/// Connections over which TLS is being begun.
#[cfg(feature = "tls")]
pub(crate) type Greetings = tokio::sync::Mutex<tokio::task::JoinSet<Option<NewConnection>>>;

/// A connection, its port here, and the address there.
type NewConnection = (SocketKind, i64, String);

/// A datagram, and the address of its sender.
pub(crate) type Datagram = (Vec<u8>, String);

/// The datagrams that the program has not taken.
pub(crate) type Datagrams = Arc<Mutex<VecDeque<Datagram>>>;

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

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // What it guards is whole at every moment, so a panic elsewhere does not corrupt it.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn closed() -> HostFailure {
    failure("SOCKET-CLOSED", "the socket is closed")
}

/// Returns the failure for an error of the system.
fn socket_failure(error: &Error) -> HostFailure {
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
            if let SocketKind::Listener(_, accepted) = &socket.kind {
                self.close_untaken(accepted);
            }
            if let SocketKind::Connection(connection) = &socket.kind {
                connection.is_closed.store(true, Ordering::SeqCst);
                connection.waiting.wake_all();
            }
            if let SocketKind::Connection(connection) = &socket.kind
                && connection.says_goodbye
            {
                let connection = connection.clone();
                let mut end = Box::pin(async move { connection.end().await });
                // Mostly it is said at once, which is as well if the process ends now.
                if end.as_mut().poll(&mut Context::from_waker(Waker::noop())).is_pending() {
                    // Without the event loop there is nobody to be told.
                    _ = event_loop::spawn(async move { drop(tokio::time::timeout(GOODBYE, end).await) });
                }
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

thread_local! {
    /// Where what is read is put first, so that a connection that waits has no such room of its own.
    static READ: RefCell<Vec<u8>> = RefCell::new(vec![0; CHUNK]);
}

/// Those who wait for a connection, in the order in which they came, and the greatest of their numbers.
#[derive(Default)]
struct Waiting(Mutex<(u64, BTreeMap<u64, Waker>)>);

impl Waiting {
    /// Notes who waits, and returns the number, which is the one given if there is one.
    fn note(&self, number: Option<u64>, waker: &Waker) -> u64 {
        let mut waiting = lock(&self.0);
        let number = number.unwrap_or(waiting.0 + 1);
        waiting.0 = waiting.0.max(number);
        let before = waiting.1.insert(number, waker.clone());
        // With a waker its task may end, which has waited here: no lock may be held then.
        drop(waiting);
        drop(before);
        number
    }

    fn forget(&self, number: u64) {
        let before = lock(&self.0).1.remove(&number);
        drop(before);
    }

    fn wake_all(&self) {
        let all = std::mem::take(&mut lock(&self.0).1);
        all.into_values().for_each(Waker::wake);
    }
}

impl Wake for Waiting {
    fn wake(self: Arc<Waiting>) {
        self.wake_all();
    }
}

/// Waits until something has arrived at a connection, or it has ended. Of all operations most are of this
/// kind, so it is small, and needs no more than a place in a table.
struct Arrival {
    connection: Arc<Connection>,
    number: Option<u64>,
}

impl Future for Arrival {
    type Output = Completion;

    fn poll(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Completion> {
        let connection = self.connection.clone();
        // Before anything is asked, so that nothing is missed. One who begins is polled again, with a waker.
        if !context.waker().will_wake(Waker::noop()) {
            self.number = Some(connection.waiting.note(self.number, context.waker()));
        }
        if connection.is_closed.load(Ordering::SeqCst) {
            return Poll::Ready(Err(closed()));
        }
        if lock(&connection.arrived).is_something() {
            return Poll::Ready(Ok(Vec::new()));
        }
        // The system tells one only, who tells the others.
        let waker = Waker::from(connection.waiting.clone());
        let arrival = ready!(connection.poll_arrival(&mut Context::from_waker(&waker)));
        connection.waiting.wake_all();
        Poll::Ready(arrival.map(|()| Vec::new()).map_err(|error| socket_failure(&error)))
    }
}

impl Drop for Arrival {
    fn drop(&mut self) {
        if let Some(number) = self.number {
            self.connection.waiting.forget(number);
        }
    }
}

impl Connection {
    /// Returns a connection that is read from one side and written to the other.
    pub(crate) fn over(
        reader: impl AsyncRead + Send + Unpin + 'static,
        writer: impl AsyncWrite + Send + Unpin + 'static,
    ) -> SocketKind {
        SocketKind::Connection(Arc::new(Connection {
            reader: Mutex::new(Box::new(reader)),
            waiting: Arc::default(),
            is_closed: AtomicBool::new(false),
            writer: tokio::sync::Mutex::new(Box::new(writer)),
            arrived: Mutex::default(),
            says_goodbye: false,
        }))
    }

    /// Returns a connection whose protocol has an end of its own.
    #[cfg(feature = "tls")]
    fn secured(stream: impl AsyncRead + AsyncWrite + Send + 'static) -> SocketKind {
        let (reader, writer) = tokio::io::split(stream);
        SocketKind::Connection(Arc::new(Connection {
            reader: Mutex::new(Box::new(reader)),
            waiting: Arc::default(),
            is_closed: AtomicBool::new(false),
            writer: tokio::sync::Mutex::new(Box::new(writer)),
            arrived: Mutex::default(),
            says_goodbye: true,
        }))
    }

    fn of_tcp(stream: TcpStream) -> (SocketKind, i64, String) {
        let (port, peer) = Connection::ends_of(&stream);
        let (reader, writer) = stream.into_split();
        (Connection::over(reader, writer), port, peer)
    }

    /// Returns the port of a connection here, and the address there.
    fn ends_of(stream: &TcpStream) -> (i64, String) {
        // Requests and answers are small, and are not to wait for more; without it they only take longer.
        drop(stream.set_nodelay(true));
        let port = stream.local_addr().map_or(0, |address| address.port().into());
        (port, stream.peer_addr().map_or(String::new(), |address| address.to_string()))
    }

    /// Reads what has arrived, or notes that the connection has ended. Of those who wait all are woken.
    fn poll_arrival(&self, context: &mut Context<'_>) -> Poll<Result<(), Error>> {
        READ.with_borrow_mut(|bytes| {
            let mut bytes = ReadBuf::new(bytes);
            ready!(Pin::new(&mut **lock(&self.reader)).poll_read(context, &mut bytes))?;
            lock(&self.arrived).add(bytes.filled());
            Poll::Ready(Ok(()))
        })
    }

    /// Tells the peer that nothing more comes.
    async fn end(&self) {
        // It may be gone.
        drop(self.writer.lock().await.shutdown().await);
    }

    /// Takes what has arrived. `NIL` at the end.
    fn take<T>(&self, take: impl FnOnce(&mut Arrived) -> T) -> T {
        take(&mut lock(&self.arrived))
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
    operation("%SOCKET-CONNECT", &connect_needs, |arguments, sockets| Box::pin(connect(arguments, sockets)));
    let listen_needs =
        [net[0], Need { right: Right::Read, argument: 2 }, Need { right: Right::Read, argument: 3 }];
    operation("%SOCKET-LISTEN", &listen_needs, |arguments, sockets| Box::pin(listen(arguments, sockets)));
    #[cfg(unix)]
    {
        operation("%SOCKET-CONNECT-UNIX", &path, |arguments, sockets| {
            Box::pin(connect_unix(arguments, sockets))
        });
        operation("%SOCKET-LISTEN-UNIX", &path, |arguments, sockets| {
            Box::pin(listen_unix(arguments, sockets))
        });
    }
    operation("%SOCKET-ACCEPT", &[], |arguments, sockets| Box::pin(accept(arguments, sockets)));
    operation("%SOCKET-AWAIT", &[], |arguments, sockets| wait(&arguments, &sockets));
    operation("%SOCKET-WRITE", &[], |arguments, sockets| Box::pin(write(arguments, sockets)));
    operation("%UDP-OPEN", &net, |arguments, sockets| Box::pin(open_udp(arguments, sockets)));
    operation("%UDP-SEND", &net, |arguments, sockets| Box::pin(send(arguments, sockets)));
    operation("%UDP-AWAIT", &[], |arguments, sockets| Box::pin(wait_for_datagram(arguments, sockets)));
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
    define("%SOCKET-TAKE", |arguments, sockets| {
        let connection = sockets.get(arguments.number(0)?)?.connection()?;
        // Lines are taken one by one, so that bytes may follow a line of text.
        Ok(connection.take(|arrived| {
            if arguments.is_true(1) { arrived.take_text(true) } else { arrived.take_bytes(CHUNK) }
        }))
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
        let bytes = bytes_of(&arguments.text(0)?);
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

/// `%SOCKET-CONNECT`: number, address, milliseconds, and for TLS the name of the server and a file of
/// certificates.
async fn connect(arguments: CallArguments, sockets: Sockets) -> Completion {
    let (number, address) = (arguments.number(0)?, arguments.text(1)?);
    let server_name = arguments.text_if_any(3)?;
    let ca_file = arguments.text_if_any(4)?;
    let connect = async {
        let addresses =
            tokio::net::lookup_host(&address).await.map_err(|error| failure("HOST-NOT-FOUND", error))?;
        let mut last = failure("HOST-NOT-FOUND", format!("`{address}` has no address"));
        for address in addresses {
            match TcpStream::connect(address).await {
                Ok(stream) => return secured(stream, server_name, ca_file).await,
                Err(error) => last = socket_failure(&error),
            }
        }
        Err(last)
    };
    let (kind, port, peer) = if arguments.is_true(2) {
        let time = Duration::from_millis(u64::try_from(arguments.integer(2)?).unwrap_or(0));
        let late = |_| Err(failure("TIMEOUT", format!("`{address}` does not answer")));
        tokio::time::timeout(time, connect).await.unwrap_or_else(late)?
    } else {
        connect.await?
    };
    sockets.set(number, kind, port, peer)
}

/// Returns a connection over TCP, secured by TLS if the server has a name.
#[cfg(feature = "tls")]
async fn secured(
    stream: TcpStream,
    server_name: Option<String>,
    ca_file: Option<String>,
) -> Result<(SocketKind, i64, String), HostFailure> {
    let Some(name) = server_name else { return Ok(Connection::of_tcp(stream)) };
    let (port, peer) = Connection::ends_of(&stream);
    Ok((Connection::secured(crate::tls::begin(stream, &name, ca_file).await?), port, peer))
}

/// Returns a connection over TCP.
#[cfg(not(feature = "tls"))]
async fn secured(
    stream: TcpStream,
    server_name: Option<String>,
    _ca_file: Option<String>,
) -> Result<(SocketKind, i64, String), HostFailure> {
    match server_name {
        None => Ok(Connection::of_tcp(stream)),
        Some(_) => Err(failure("TLS-ERROR", "this program was built without TLS")),
    }
}

/// `%SOCKET-LISTEN`: number, address, files of certificate and key if it is secured.
async fn listen(arguments: CallArguments, sockets: Sockets) -> Completion {
    let secured = match (arguments.text_if_any(2)?, arguments.text_if_any(3)?) {
        (Some(certificate), Some(key)) => Some((certificate, key)),
        _ => None,
    };
    let listener = bind(&arguments.text(1)?).await.map_err(|error| bind_failure(&error))?;
    let port = listener.local_addr().map_or(0, |address| address.port().into());
    let listener = match secured {
        None => Listener::Tcp(listener),
        #[cfg(feature = "tls")]
        Some((certificate, key)) => {
            Listener::Secured(listener, crate::tls::acceptor(certificate, key).await?, Greetings::default())
        }
        #[cfg(not(feature = "tls"))]
        Some(_) => return Err(failure("TLS-ERROR", "this program was built without TLS")),
    };
    sockets.set(
        arguments.number(0)?,
        SocketKind::Listener(Arc::new(listener), Arc::default()),
        port,
        String::new(),
    )
}

/// Returns a listener on the first of an address' meanings that can be had.
async fn bind(address: &str) -> std::io::Result<TcpListener> {
    let mut last = None;
    for address in tokio::net::lookup_host(address).await? {
        match bind_to(address) {
            Ok(listener) => return Ok(listener),
            Err(error) => last = Some(error),
        }
    }
    Err(last.unwrap_or_else(|| Error::new(ErrorKind::InvalidInput, "the name has no address")))
}

fn bind_to(address: std::net::SocketAddr) -> std::io::Result<TcpListener> {
    let socket = if address.is_ipv4() { TcpSocket::new_v4() } else { TcpSocket::new_v6() }?;
    // A program that is started again has its port, though connections of before linger. Elsewhere this would
    // take the port from another program.
    #[cfg(unix)]
    socket.set_reuseaddr(true)?;
    socket.bind(address)?;
    socket.listen(BACKLOG)
}

/// Returns the next connection over which TLS has begun. A peer with which it does not is dropped, and one
/// that takes its time delays no other.
#[cfg(feature = "tls")]
async fn accept_secured(
    listener: &TcpListener,
    acceptor: &tokio_rustls::TlsAcceptor,
    greetings: &Greetings,
) -> Result<NewConnection, HostFailure> {
    let mut greetings = greetings.lock().await;
    loop {
        let has_room = greetings.len() < MOST_GREETED;
        tokio::select! {
            Some(greeted) = greetings.join_next() => {
                if let Ok(Some(connection)) = greeted {
                    return Ok(connection);
                }
            }
            accepted = listener.accept(), if has_room => {
                let (stream, _) = accepted.map_err(|error| socket_failure(&error))?;
                let acceptor = acceptor.clone();
                greetings.spawn(async move {
                    let (port, peer) = Connection::ends_of(&stream);
                    let stream = tokio::time::timeout(GREETING, acceptor.accept(stream)).await.ok()?.ok()?;
                    Some((Connection::secured(stream), port, peer))
                });
            }
        }
    }
}

/// Returns the failure for an address that cannot be used here.
fn bind_failure(error: &Error) -> HostFailure {
    // What the resolver says is no error of the system.
    if error.raw_os_error().is_none() { failure("HOST-NOT-FOUND", error) } else { socket_failure(error) }
}

#[cfg(unix)]
async fn connect_unix(arguments: CallArguments, sockets: Sockets) -> Completion {
    let (number, path) = (arguments.number(0)?, arguments.text(1)?);
    let stream = tokio::net::UnixStream::connect(&path).await.map_err(|error| socket_failure(&error))?;
    let (reader, writer) = stream.into_split();
    sockets.set(number, Connection::over(reader, writer), 0, path)
}

#[cfg(unix)]
async fn listen_unix(arguments: CallArguments, sockets: Sockets) -> Completion {
    let (number, path) = (arguments.number(0)?, arguments.text(1)?);
    let bind = || {
        let socket = tokio::net::UnixSocket::new_stream()?;
        socket.bind(&path)?;
        socket.listen(BACKLOG)
    };
    let listener = bind().map_err(|error| socket_failure(&error))?;
    let kind = SocketKind::Listener(Arc::new(Listener::Unix(listener, path.into())), Arc::default());
    sockets.set(number, kind, 0, String::new())
}

/// `%SOCKET-ACCEPT`: waits until a connection is there to be taken.
async fn accept(arguments: CallArguments, sockets: Sockets) -> Completion {
    let socket = sockets.get(arguments.number(0)?)?;
    let SocketKind::Listener(listener, accepted) = &socket.kind else {
        return Err(failure("SOCKET-ERROR", "it is no listener"));
    };
    if !lock(accepted).is_empty() {
        return Ok(Vec::new());
    }
    let mut next = pin!(async {
        match &**listener {
            Listener::Tcp(listener) => {
                let (stream, _) = listener.accept().await.map_err(|error| socket_failure(&error))?;
                Ok(Connection::of_tcp(stream))
            }
            #[cfg(feature = "tls")]
            Listener::Secured(listener, acceptor, greetings) => {
                accept_secured(listener, acceptor, greetings).await
            }
            #[cfg(unix)]
            Listener::Unix(listener, _) => {
                let (stream, _) = listener.accept().await.map_err(|error| socket_failure(&error))?;
                let (reader, writer) = stream.into_split();
                Ok((Connection::over(reader, writer), 0, String::new()))
            }
        }
    });
    let (kind, port, peer) = unless_closed(socket.closing.subscribe(), next.as_mut()).await?;
    let number = sockets.add(kind, port, peer);
    lock(accepted).push_back(number);
    if *socket.closing.borrow() {
        // The listener was closed at this moment, and may not have seen it.
        sockets.close_untaken(accepted);
    }
    Ok(Vec::new())
}

/// `%SOCKET-AWAIT`: waits until there is something to be taken.
fn wait(arguments: &CallArguments, sockets: &Sockets) -> OperationFuture {
    let socket = arguments.number(0).and_then(|number| sockets.get(number));
    match socket.and_then(|socket| socket.connection()) {
        Ok(connection) => Box::pin(Arrival { connection, number: None }),
        Err(failure) => Box::pin(ready_future(Err(failure))),
    }
}

/// `%SOCKET-WRITE`: number, text, whether its characters are bytes.
async fn write(arguments: CallArguments, sockets: Sockets) -> Completion {
    let socket = sockets.get(arguments.number(0)?)?;
    let connection = socket.connection()?;
    let text = arguments.text(1)?;
    let bytes = if arguments.is_true(2) { bytes_of(&text) } else { text.into_bytes() };
    let mut write = pin!(async {
        let mut writer = connection.writer.lock().await;
        let written = async {
            writer.write_all(&bytes).await?;
            writer.flush().await
        };
        written.await.map_err(|error| socket_failure(&error))
    });
    unless_closed(socket.closing.subscribe(), write.as_mut()).await?;
    Ok(Vec::new())
}

/// `%UDP-OPEN`: number, address.
async fn open_udp(arguments: CallArguments, sockets: Sockets) -> Completion {
    let socket = UdpSocket::bind(arguments.text(1)?).await.map_err(|error| bind_failure(&error))?;
    let port = socket.local_addr().map_or(0, |address| address.port().into());
    sockets.set(arguments.number(0)?, SocketKind::Udp(Arc::new(socket), Arc::default()), port, String::new())
}

/// `%UDP-SEND`: number, address, text, whether its characters are bytes.
async fn send(arguments: CallArguments, sockets: Sockets) -> Completion {
    let (socket, _) = sockets.get(arguments.number(0)?)?.datagrams()?;
    let (address, text) = (arguments.text(1)?, arguments.text(2)?);
    let bytes = if arguments.is_true(3) { bytes_of(&text) } else { text.into_bytes() };
    socket.send_to(&bytes, address).await.map_err(|error| bind_failure(&error))?;
    Ok(Vec::new())
}

/// `%UDP-AWAIT`: waits until there is a datagram to be taken.
async fn wait_for_datagram(arguments: CallArguments, sockets: Sockets) -> Completion {
    let socket = sockets.get(arguments.number(0)?)?;
    let (udp, datagrams) = socket.datagrams()?;
    if !lock(&datagrams).is_empty() {
        return Ok(Vec::new());
    }
    let mut bytes = vec![0; CHUNK];
    let receive = async { udp.recv_from(&mut bytes).await.map_err(|error| socket_failure(&error)) };
    let (count, address) = unless_closed(socket.closing.subscribe(), pin!(receive)).await?;
    bytes.truncate(count);
    lock(&datagrams).push_back((bytes, address.to_string()));
    Ok(Vec::new())
}
