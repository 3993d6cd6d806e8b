//! Sockets and serial lines of links, on the event loop.
//!
//! Guarantees: nothing here waits for the program; a connection that was lost is made again, after pauses
//! that get longer.

use std::future::Future;
use std::io::Error;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use esl_host::HostFailure;
use esl_world::socket_failure;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream, UdpSocket};
use tokio::sync::mpsc;
use tokio_serial::SerialPortBuilderExt;

use super::link::{LinkCore, LinkPeer, Packet};

/// Most packets that wait for the system to take them.
const MOST_WAITING: usize = 256;
/// Most connections that one link accepts.
const MOST_CONNECTIONS: usize = 8;
/// Most bytes that are read at a time.
const CHUNK: usize = 1 << 16;
/// Shortest and longest pause before a connection is made again.
const PAUSES: (Duration, Duration) = (Duration::from_millis(100), Duration::from_secs(10));

/// Runs a task until it is over or the link is closed.
fn run(link: &LinkCore, task: impl Future<Output = ()> + Send + 'static) -> Result<(), HostFailure> {
    let mut closing = link.closing();
    let until_closed = async move {
        tokio::select! {
            () = task => {}
            // The link is gone, or is closed.
            _ = closing.wait_for(|is_closed| *is_closed) => {}
        }
    };
    esl_world::spawn(until_closed).map_err(|error| HostFailure::new("SOCKET-ERROR", error))
}

/// Opens a link by the network; returns the local port.
pub(super) async fn open(link: &Arc<LinkCore>, kind: &str, address: &str) -> Result<u16, HostFailure> {
    match kind {
        "udpin" => datagrams(link, address, None).await,
        "udpout" => {
            let mut found = tokio::net::lookup_host(address).await.map_err(|error| socket_failure(&error))?;
            let unknown =
                || HostFailure::new("SOCKET-ERROR", format!("the host of `{address}` has no address"));
            let remote = found.next().ok_or_else(unknown)?;
            let any = if remote.is_ipv4() { "0.0.0.0:0" } else { "[::]:0" };
            datagrams(link, any, Some(remote)).await
        }
        "tcpin" => {
            let listener = TcpListener::bind(address).await.map_err(|error| socket_failure(&error))?;
            let port = listener.local_addr().map_or(0, |address| address.port());
            run(link, accept(link.clone(), listener))?;
            Ok(port)
        }
        _ => {
            let address = address.to_owned();
            let connect = {
                let address = address.clone();
                move || TcpStream::connect(address.clone())
            };
            let stream = connect().await.map_err(|error| socket_failure(&error))?;
            let port = stream.local_addr().map_or(0, |address| address.port());
            run(link, reconnect(link.clone(), format!("tcp {address}"), stream, connect))?;
            Ok(port)
        }
    }
}

/// Opens a link by a serial line.
pub(super) async fn open_serial(link: &Arc<LinkCore>, path: String, baud: u32) -> Result<(), HostFailure> {
    let open = {
        let path = path.clone();
        move || {
            let port = tokio_serial::new(&path, baud).open_native_async();
            async move { port.map_err(Error::from) }
        }
    };
    let port = open()
        .await
        .map_err(|error| HostFailure::new("SERIAL-ERROR", format!("`{path}` cannot be opened: {error}")))?;
    run(link, reconnect(link.clone(), path, port, open))
}

async fn datagrams(
    link: &Arc<LinkCore>,
    address: &str,
    remote: Option<SocketAddr>,
) -> Result<u16, HostFailure> {
    let socket = Arc::new(UdpSocket::bind(address).await.map_err(|error| socket_failure(&error))?);
    let port = socket.local_addr().map_or(0, |address| address.port());
    let (packets, waiting) = mpsc::channel(MOST_WAITING);
    link.add_port(Some(remote), packets);
    run(link, send_datagrams(socket.clone(), waiting))?;
    run(link, receive_datagrams(link.clone(), socket, remote))?;
    Ok(port)
}

async fn send_datagrams(socket: Arc<UdpSocket>, mut waiting: mpsc::Receiver<Packet>) {
    while let Some((bytes, address)) = waiting.recv().await {
        if let Some(address) = address {
            // A datagram that cannot be sent is lost, as any may be.
            _ = socket.send_to(&bytes, address).await;
        }
    }
}

async fn receive_datagrams(link: Arc<LinkCore>, socket: Arc<UdpSocket>, remote: Option<SocketAddr>) {
    let mut bytes = vec![0; CHUNK];
    loop {
        let Ok((length, from)) = socket.recv_from(&mut bytes).await else {
            // An earlier datagram was refused.
            tokio::time::sleep(PAUSES.0).await;
            continue;
        };
        if remote.is_none_or(|remote| remote.ip() == from.ip()) {
            link.receive(LinkPeer::Datagrams(from), &|| format!("udp {from}"), &bytes[..length]);
        }
    }
}

async fn accept(link: Arc<LinkCore>, listener: TcpListener) {
    loop {
        let Ok((stream, address)) = listener.accept().await else {
            tokio::time::sleep(PAUSES.0).await;
            continue;
        };
        if link.ports() < MOST_CONNECTIONS {
            let task = serve(link.clone(), format!("tcp {address}"), stream);
            if run(&link, task).is_err() {
                return;
            }
        }
    }
}

/// Keeps a connection that this end makes.
async fn reconnect<S, F>(link: Arc<LinkCore>, label: String, stream: S, connect: impl Fn() -> F + Send)
where
    S: AsyncRead + AsyncWrite + Send + Unpin,
    F: Future<Output = Result<S, Error>> + Send,
{
    let mut stream = Some(stream);
    let mut pause = PAUSES.0;
    loop {
        if let Some(stream) = stream.take() {
            pause = PAUSES.0;
            serve(link.clone(), label.clone(), stream).await;
        }
        tokio::time::sleep(pause).await;
        pause = (pause * 2).min(PAUSES.1);
        stream = connect().await.ok();
    }
}

/// Reads and writes until the stream ends.
async fn serve<S: AsyncRead + AsyncWrite + Send + Unpin>(link: Arc<LinkCore>, label: String, stream: S) {
    let (packets, mut waiting) = mpsc::channel::<Packet>(MOST_WAITING);
    let number = link.add_port(None, packets);
    let (mut reader, mut writer) = tokio::io::split(stream);
    let read = async {
        let mut bytes: Vec<u8> = Vec::with_capacity(2 * CHUNK);
        loop {
            let mut room = (&mut reader).take(CHUNK as u64);
            if !matches!(room.read_buf(&mut bytes).await, Ok(1..)) {
                return;
            }
            let done = link.receive(LinkPeer::Stream(number), &|| label.clone(), &bytes);
            bytes.drain(..done);
        }
    };
    let write = async {
        while let Some((bytes, _)) = waiting.recv().await {
            if writer.write_all(&bytes).await.is_err() || writer.flush().await.is_err() {
                return;
            }
        }
    };
    tokio::select! {
        () = read => {}
        () = write => {}
    }
    link.remove_port(number);
}
