//! The connection of a session to a run that is under way elsewhere: a socket, over TLS if that is asked for.

use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::path::Path;
use std::sync::mpsc::channel;
use std::time::Duration;

/// How the connection to a port of a run is secured.
#[derive(Clone, Copy, Debug)]
pub enum AttachSecurity<'a> {
    /// Not at all.
    Plain,
    /// By TLS; the run proves by a certificate that the system trusts, or by one of a file, that it is that.
    Tls(Option<&'a Path>),
}

/// A connection to a run.
pub(super) enum Wire {
    Tcp(TcpStream),
    #[cfg(unix)]
    Unix(std::os::unix::net::UnixStream),
    /// The near end of a connection over TLS.
    #[cfg(unix)]
    Secured(std::os::unix::net::UnixStream),
}

/// Time that TLS may take to begin.
const PATIENCE: Duration = Duration::from_secs(10);

/// Begins TLS over a connection to an address, and returns its near end, between which and the other one the
/// event loop passes on all that is said.
#[cfg(unix)]
fn secured(
    stream: TcpStream,
    address: &str,
    ca_file: Option<&Path>,
) -> io::Result<std::os::unix::net::UnixStream> {
    use std::os::unix::net::UnixStream;
    let (near, far) = UnixStream::pair()?;
    for end in [&far, &near] {
        end.set_nonblocking(std::ptr::eq(end, &far))?;
    }
    stream.set_nonblocking(true)?;
    let name = address.rsplit_once(':').map_or(address, |(name, _)| name).to_string();
    let ca_file = ca_file.map(Path::to_path_buf);
    let (tell, told) = channel();
    let pass_on = async move {
        let begin = async {
            let stream = tokio::net::TcpStream::from_std(stream)?;
            let far = tokio::net::UnixStream::from_std(far)?;
            let secured = esl_world::begin_tls(stream, &name, ca_file.as_deref()).await;
            Ok::<_, io::Error>((secured.map_err(io::Error::other)?, far))
        };
        match tokio::time::timeout(PATIENCE, begin).await {
            Ok(Ok((mut stream, mut far))) => {
                _ = tell.send(Ok(()));
                // When either side is at its end, so is the session.
                drop(tokio::io::copy_bidirectional(&mut stream, &mut far).await);
            }
            Ok(Err(reason)) => _ = tell.send(Err(reason)),
            Err(_) => _ = tell.send(Err(io::Error::other("the run does not speak TLS"))),
        }
    };
    esl_world::spawn(pass_on).map_err(io::Error::other)?;
    told.recv().map_err(io::Error::other)??;
    Ok(near)
}

impl Wire {
    pub(super) fn connect(address: &str, security: AttachSecurity<'_>) -> io::Result<Wire> {
        let port = address.parse::<u16>().map(|port| format!("127.0.0.1:{port}"));
        let is_path = port.is_err() && (address.contains('/') || !address.contains(':'));
        if is_path && matches!(security, AttachSecurity::Tls(_)) {
            return Err(io::Error::other("a path needs no TLS: leave out --tls and --ca-file"));
        }
        #[cfg(unix)]
        if is_path {
            return std::os::unix::net::UnixStream::connect(address).map(Wire::Unix);
        }
        _ = is_path;
        let address = port.unwrap_or_else(|_| address.into());
        let stream = TcpStream::connect(&address)?;
        stream.set_nodelay(true)?;
        match security {
            AttachSecurity::Plain => Ok(Wire::Tcp(stream)),
            #[cfg(unix)]
            AttachSecurity::Tls(ca_file) => secured(stream, &address, ca_file).map(Wire::Secured),
            #[cfg(not(unix))]
            AttachSecurity::Tls(_) => Err(io::Error::other("TLS is not available here: use ssh -L")),
        }
    }

    pub(super) fn needs_secret(&self) -> bool {
        #[cfg(unix)]
        if let Wire::Unix(_) = self {
            return false;
        }
        true
    }

    pub(super) fn try_clone(&self) -> io::Result<Wire> {
        match self {
            Wire::Tcp(stream) => stream.try_clone().map(Wire::Tcp),
            #[cfg(unix)]
            Wire::Unix(stream) => stream.try_clone().map(Wire::Unix),
            #[cfg(unix)]
            Wire::Secured(stream) => stream.try_clone().map(Wire::Secured),
        }
    }

    pub(super) fn close(&self) {
        // It may be closed already.
        _ = match self {
            Wire::Tcp(stream) => stream.shutdown(Shutdown::Both),
            #[cfg(unix)]
            Wire::Unix(stream) | Wire::Secured(stream) => stream.shutdown(Shutdown::Both),
        };
    }
}

impl Read for Wire {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self {
            Wire::Tcp(stream) => stream.read(buffer),
            #[cfg(unix)]
            Wire::Unix(stream) | Wire::Secured(stream) => stream.read(buffer),
        }
    }
}

impl Write for Wire {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Wire::Tcp(stream) => stream.write(bytes),
            #[cfg(unix)]
            Wire::Unix(stream) | Wire::Secured(stream) => stream.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
