//! Connections, over TCP and Unix sockets and whatever else has two ends.
//!
//! Arrived data stay here until the program takes them, which it does at once, without waiting: an operation
//! only waits until data are there. So nothing is lost when a call is left at the moment at which its data
//! come.
//!
//! A connection reads ahead at most [`super::CHUNK`] bytes; a peer that sends more waits.

use std::collections::BTreeMap;
use std::io::{Error, ErrorKind};
use std::pin::{Pin, pin};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::task::{Context, Poll, Wake, Waker, ready};
use std::time::Duration;

use esl_bytecode::datum::Datum;
use esl_host::{HostFailure, HostHandle, IntoDatum, Payload};
use tokio::io::{AsyncRead, AsyncWrite, AsyncWriteExt, ReadBuf};
use tokio::net::TcpStream;

use super::{NewConnection, READ, Socket, SocketFault, SocketKind, lock, socket_failure, unless_closed};
use crate::arrived::Arrived;
use crate::event_loop;

/// Time that a peer has to take the end of a connection.
const GOODBYE: Duration = Duration::from_secs(1);

type SocketReader = Box<dyn AsyncRead + Send + Unpin>;

type SocketWriter = Box<dyn AsyncWrite + Send + Unpin>;

/// A connection.
pub(crate) struct Connection {
    reader: Mutex<SocketReader>,
    waiting: Arc<Waiting>,
    is_closed: AtomicBool,
    writer: tokio::sync::Mutex<Writer>,
    arrived: Mutex<Arrived>,
    /// Whether the peer is to be told that nothing more comes, beside by the end of the connection.
    says_goodbye: bool,
}

/// The side of a connection that is written to.
struct Writer {
    stream: SocketWriter,
    /// Bytes of a text of which the system has taken a part. They come before all others.
    unsent: Vec<u8>,
}

impl Writer {
    /// Writes bytes as far as the system takes them without delay, after those that are unsent. Returns
    /// whether all that was given until now is written. If some of them cannot be, all are kept as unsent.
    fn write_at_once(&mut self, bytes: &[u8]) -> Result<bool, Error> {
        let mut context = Context::from_waker(Waker::noop());
        self.unsent.extend_from_slice(bytes);
        let mut sent = 0;
        while sent < self.unsent.len() {
            match Pin::new(&mut *self.stream).poll_write(&mut context, &self.unsent[sent..]) {
                Poll::Ready(Ok(0)) => return Err(ErrorKind::WriteZero.into()),
                Poll::Ready(written) => sent += written?,
                Poll::Pending => break,
            }
        }
        self.unsent.drain(..sent);
        Ok(self.unsent.is_empty() && Pin::new(&mut *self.stream).poll_flush(&mut context)?.is_ready())
    }

    /// Writes the unsent bytes, and then these. Unsent bytes stay so if this is left.
    async fn write(&mut self, bytes: &[u8]) -> Result<(), Error> {
        while !self.unsent.is_empty() {
            match self.stream.write(&self.unsent).await? {
                0 => return Err(ErrorKind::WriteZero.into()),
                sent => drop(self.unsent.drain(..sent)),
            }
        }
        self.stream.write_all(bytes).await?;
        self.stream.flush().await
    }
}

/// The operations that wait for a connection, in the order in which they came, and the greatest of their
/// numbers.
#[derive(Default)]
struct Waiting(Mutex<(u64, BTreeMap<u64, Waker>)>);

impl Waiting {
    /// Notes a waiting operation, and returns its number, which is the given one if there is one.
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
pub(super) struct Arrival {
    connection: Result<Arc<Connection>, SocketFault>,
    number: Option<u64>,
}

impl Future for Arrival {
    type Output = Result<(), HostFailure>;

    fn poll(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Result<(), HostFailure>> {
        let connection = self.connection.clone()?;
        let has_data = || lock(&connection.arrived).is_something();
        if self.number.is_none() && has_data() && !connection.is_closed.load(Ordering::SeqCst) {
            // An operation that need not wait is not noted.
            return Poll::Ready(Ok(()));
        }
        // Before anything is asked, so that nothing is missed.
        self.number = Some(connection.waiting.note(self.number, context.waker()));
        if connection.is_closed.load(Ordering::SeqCst) {
            return Poll::Ready(Err(SocketFault::Closed.into()));
        }
        if has_data() {
            return Poll::Ready(Ok(()));
        }
        // The system wakes one waker only, which wakes the others.
        let waker = Waker::from(connection.waiting.clone());
        let arrival = ready!(connection.poll_arrival(&mut Context::from_waker(&waker)));
        connection.waiting.wake_all();
        Poll::Ready(arrival.map_err(|error| socket_failure(&error)))
    }
}

impl Drop for Arrival {
    fn drop(&mut self) {
        if let (Some(number), Ok(connection)) = (self.number, &self.connection) {
            connection.waiting.forget(number);
        }
    }
}

impl Connection {
    /// Returns a connection that is read from one side and written to the other.
    pub(crate) fn over(
        reader: impl AsyncRead + Send + Unpin + 'static,
        writer: impl AsyncWrite + Send + Unpin + 'static,
    ) -> SocketKind {
        Connection::with(reader, writer, false)
    }

    fn with(
        reader: impl AsyncRead + Send + Unpin + 'static,
        writer: impl AsyncWrite + Send + Unpin + 'static,
        says_goodbye: bool,
    ) -> SocketKind {
        SocketKind::Connection(Arc::new(Connection {
            reader: Mutex::new(Box::new(reader)),
            waiting: Arc::default(),
            is_closed: AtomicBool::new(false),
            writer: tokio::sync::Mutex::new(Writer { stream: Box::new(writer), unsent: Vec::new() }),
            arrived: Mutex::default(),
            says_goodbye,
        }))
    }

    /// Returns a connection whose protocol has an end of its own.
    #[cfg(feature = "tls")]
    pub(super) fn secured(stream: impl AsyncRead + AsyncWrite + Send + 'static) -> SocketKind {
        let (reader, writer) = tokio::io::split(stream);
        Connection::with(reader, writer, true)
    }

    pub(super) fn of_tcp(stream: TcpStream) -> NewConnection {
        let (port, peer) = Connection::ends_of(&stream);
        let (reader, writer) = stream.into_split();
        (Connection::over(reader, writer), port, peer)
    }

    /// Returns the port of a connection here, and the address there.
    pub(super) fn ends_of(stream: &TcpStream) -> (i64, String) {
        // Requests and answers are small, and are not to wait for more; without it they only take longer.
        drop(stream.set_nodelay(true));
        let port = stream.local_addr().map_or(0, |address| address.port().into());
        (port, stream.peer_addr().map_or(String::new(), |address| address.to_string()))
    }

    /// Reads arrived data, or notes that the connection has ended. All waiting operations are woken.
    fn poll_arrival(&self, context: &mut Context<'_>) -> Poll<Result<(), Error>> {
        READ.with_borrow_mut(|bytes| {
            let mut bytes = ReadBuf::new(bytes);
            ready!(Pin::new(&mut **lock(&self.reader)).poll_read(context, &mut bytes))?;
            lock(&self.arrived).add(bytes.filled());
            Poll::Ready(Ok(()))
        })
    }

    /// Ends the connection, of which the peer is told if it is of that kind.
    pub(super) fn close(self: &Arc<Connection>) {
        self.is_closed.store(true, Ordering::SeqCst);
        self.waiting.wake_all();
        if self.says_goodbye {
            let connection = self.clone();
            let mut end = Box::pin(async move { connection.end().await });
            // Mostly it is said at once, which is as well if the process ends now.
            if end.as_mut().poll(&mut Context::from_waker(Waker::noop())).is_pending() {
                // Without the event loop the end of the data cannot be sent.
                _ = event_loop::spawn(async move { drop(tokio::time::timeout(GOODBYE, end).await) });
            }
        }
    }

    /// Tells the peer that nothing more comes.
    async fn end(&self) {
        // It may be gone.
        drop(self.writer.lock().await.stream.shutdown().await);
    }

    /// Takes what has arrived. `NIL` at the end.
    pub(super) fn take<T>(&self, take: impl FnOnce(&mut Arrived) -> T) -> T {
        take(&mut lock(&self.arrived))
    }
}

/// Connects a socket, by the first meaning of the address that answers.
pub(super) async fn connect(
    socket: HostHandle<Socket>,
    address: String,
    milliseconds: Option<u64>,
    server_name: Option<String>,
    ca_file: Option<String>,
) -> Result<(), HostFailure> {
    let connect = async {
        let addresses = tokio::net::lookup_host(&address)
            .await
            .map_err(|error| HostFailure::new("HOST-NOT-FOUND", error))?;
        let mut last = HostFailure::new("HOST-NOT-FOUND", format!("`{address}` has no address"));
        for address in addresses {
            match TcpStream::connect(address).await {
                Ok(stream) => return secured(stream, server_name, ca_file).await,
                Err(error) => last = socket_failure(&error),
            }
        }
        Err(last)
    };
    let connection = match milliseconds {
        Some(milliseconds) => {
            let late = |_| Err(HostFailure::new("TIMEOUT", format!("`{address}` does not answer")));
            let time = Duration::from_millis(milliseconds);
            tokio::time::timeout(time, connect).await.unwrap_or_else(late)?
        }
        None => connect.await?,
    };
    socket.set(connection)
}

/// Returns a connection over TCP, secured by TLS if the server has a name.
#[cfg(feature = "tls")]
async fn secured(
    stream: TcpStream,
    server_name: Option<String>,
    ca_file: Option<String>,
) -> Result<NewConnection, HostFailure> {
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
) -> Result<NewConnection, HostFailure> {
    match server_name {
        None => Ok(Connection::of_tcp(stream)),
        Some(_) => Err(HostFailure::new("TLS-ERROR", "this program was built without TLS")),
    }
}

#[cfg(unix)]
pub(super) async fn connect_unix(socket: HostHandle<Socket>, path: String) -> Result<(), HostFailure> {
    let stream = tokio::net::UnixStream::connect(&path).await.map_err(|error| socket_failure(&error))?;
    let (reader, writer) = stream.into_split();
    socket.set((Connection::over(reader, writer), 0, path))
}

/// Waits until there is something to be taken.
pub(super) fn wait(socket: HostHandle<Socket>) -> Arrival {
    Arrival { connection: socket.connection(), number: None }
}

/// Writes contents as far as the system takes them without delay. Returns `NIL` if that was all; otherwise
/// `T` if the rest is kept, and 0 if another task writes.
pub(super) fn send(socket: HostHandle<Socket>, Payload(bytes): Payload) -> Result<Datum, HostFailure> {
    let connection = socket.connection()?;
    let Ok(mut writer) = connection.writer.try_lock() else { return Ok(0_i64.into_datum()) };
    let is_written = writer.write_at_once(&bytes).map_err(|error| socket_failure(&error))?;
    Ok((!is_written).into_datum())
}

/// Writes what is kept, then contents.
pub(super) async fn write(socket: HostHandle<Socket>, Payload(bytes): Payload) -> Result<(), HostFailure> {
    let connection = socket.connection()?;
    let mut write = pin!(async {
        let written = connection.writer.lock().await.write(&bytes).await;
        written.map_err(|error| socket_failure(&error))
    });
    unless_closed(socket.closing.subscribe(), write.as_mut()).await
}
