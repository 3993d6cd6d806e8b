//! Listeners: connections that others begin.

use std::io::{Error, ErrorKind};
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;

use esl_host::{HostFailure, HostHandle};
use tokio::net::{TcpListener, TcpSocket};

use super::{
    Connection, NewConnection, Socket, SocketFault, SocketKind, close_untaken, lock, socket_failure,
    unless_closed,
};

/// Time that a TLS handshake with a peer may take.
#[cfg(feature = "tls")]
const GREETING: Duration = Duration::from_secs(10);
/// Most peers that are greeted at a time; more wait in the system's queue.
#[cfg(feature = "tls")]
const MOST_GREETED: usize = 256;
/// Most connections that wait in the system until the program accepts them; the system may allow fewer. More
/// than that at one moment are told to come again, which takes them seconds.
const BACKLOG: u32 = 4096;
/// Time after which a connection is asked for again, for which there was no descriptor.
const PAUSE: Duration = Duration::from_millis(50);

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

/// Has a socket listen. There are files of certificate and key if it is secured.
pub(super) async fn listen(
    socket: HostHandle<Socket>,
    address: String,
    certificate: Option<String>,
    key: Option<String>,
) -> Result<(), HostFailure> {
    let secured = certificate.zip(key);
    let listener = bind(&address).await.map_err(|error| bind_failure(&error))?;
    let port = listener.local_addr().map_or(0, |address| address.port().into());
    let listener = match secured {
        None => Listener::Tcp(listener),
        #[cfg(feature = "tls")]
        Some((certificate, key)) => Listener::Secured(
            listener,
            crate::tls::acceptor(certificate, key, None).await?,
            Greetings::default(),
        ),
        #[cfg(not(feature = "tls"))]
        Some(_) => return Err(HostFailure::new("TLS-ERROR", "this program was built without TLS")),
    };
    socket.set((SocketKind::Listener(Arc::new(listener), Arc::default()), port, String::new()))
}

/// Returns a listener on the first of an address' meanings that can be had.
pub(crate) async fn bind(address: &str) -> std::io::Result<TcpListener> {
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

/// Returns whether an error is not a fault of a listener: the peer has gone already, or there is no
/// descriptor or memory for one more, until some are released.
fn is_passing(error: &Error) -> bool {
    #[cfg(unix)]
    if let Some(error) = rustix::io::Errno::from_io_error(error) {
        use rustix::io::Errno;
        return [Errno::CONNABORTED, Errno::MFILE, Errno::NFILE, Errno::NOBUFS, Errno::NOMEM]
            .contains(&error);
    }
    error.kind() == ErrorKind::ConnectionAborted
}

/// Returns the next connection that `accept` gives. So many peers that there is no descriptor for one more
/// delay the next, and end nothing.
pub(crate) async fn next<C, F: Future<Output = std::io::Result<C>>>(
    accept: impl Fn() -> F,
) -> Result<C, HostFailure> {
    loop {
        match accept().await {
            Err(error) if is_passing(&error) => tokio::time::sleep(PAUSE).await,
            result => return result.map_err(|error| socket_failure(&error)),
        }
    }
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
            accepted = next(|| listener.accept()), if has_room => {
                let (stream, _) = accepted?;
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
pub(crate) fn bind_failure(error: &Error) -> HostFailure {
    // An error of the resolver has no number of the system.
    if error.raw_os_error().is_none() {
        HostFailure::new("HOST-NOT-FOUND", error)
    } else {
        socket_failure(error)
    }
}

#[cfg(unix)]
pub(super) async fn listen_unix(socket: HostHandle<Socket>, path: String) -> Result<(), HostFailure> {
    let bind = || {
        let listener = tokio::net::UnixSocket::new_stream()?;
        listener.bind(&path)?;
        listener.listen(BACKLOG)
    };
    let listener = bind().map_err(|error| socket_failure(&error))?;
    let kind = SocketKind::Listener(Arc::new(Listener::Unix(listener, path.into())), Arc::default());
    socket.set((kind, 0, String::new()))
}

/// Waits until a connection is there to be taken.
pub(super) async fn accept(socket: HostHandle<Socket>) -> Result<(), HostFailure> {
    let SocketKind::Listener(listener, accepted) = socket.kind()? else {
        return Err(SocketFault::NotListening.into());
    };
    if !lock(&accepted).is_empty() {
        return Ok(());
    }
    let mut coming = pin!(async {
        match &*listener {
            Listener::Tcp(listener) => {
                let (stream, _) = next(|| listener.accept()).await?;
                Ok(Connection::of_tcp(stream))
            }
            #[cfg(feature = "tls")]
            Listener::Secured(listener, acceptor, greetings) => {
                accept_secured(listener, acceptor, greetings).await
            }
            #[cfg(unix)]
            Listener::Unix(listener, _) => {
                let (stream, _) = next(|| listener.accept()).await?;
                let (reader, writer) = stream.into_split();
                Ok((Connection::over(reader, writer), 0, String::new()))
            }
        }
    });
    let connection = unless_closed(socket.closing.subscribe(), coming.as_mut()).await?;
    lock(&accepted).push_back(connection);
    if *socket.closing.borrow() {
        // The listener was closed at this moment, and may not have seen it.
        close_untaken(&accepted);
    }
    Ok(())
}
