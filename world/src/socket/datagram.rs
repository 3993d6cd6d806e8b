//! Datagrams, over UDP.

use std::collections::VecDeque;
use std::pin::pin;
use std::sync::{Arc, Mutex};

use tokio::net::UdpSocket;

use super::{CHUNK, SocketKind, Sockets, bind_failure, lock, socket_failure, unless_closed};
use crate::data::{CallArguments, bytes_of};
use crate::operation::Completion;

/// A datagram, and the address of its sender.
pub(crate) type Datagram = (Vec<u8>, String);

/// The datagrams that the program has not taken.
pub(crate) type Datagrams = Arc<Mutex<VecDeque<Datagram>>>;

/// `%UDP-OPEN`: number, address.
pub(super) async fn open(arguments: CallArguments, sockets: Sockets) -> Completion {
    let socket = UdpSocket::bind(arguments.text(1)?).await.map_err(|error| bind_failure(&error))?;
    let port = socket.local_addr().map_or(0, |address| address.port().into());
    sockets.set(arguments.number(0)?, SocketKind::Udp(Arc::new(socket), Arc::default()), port, String::new())
}

/// `%UDP-SEND`: number, address, text, whether its characters are bytes.
pub(super) async fn send(arguments: CallArguments, sockets: Sockets) -> Completion {
    let (socket, _) = sockets.get(arguments.number(0)?)?.datagrams()?;
    let (address, text) = (arguments.text(1)?, arguments.text(2)?);
    let bytes = if arguments.is_true(3) { bytes_of(&text) } else { text.into_bytes() };
    socket.send_to(&bytes, address).await.map_err(|error| bind_failure(&error))?;
    Ok(Vec::new())
}

/// `%UDP-AWAIT`: waits until there is a datagram to be taken.
pub(super) async fn wait(arguments: CallArguments, sockets: Sockets) -> Completion {
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
