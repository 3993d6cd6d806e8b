//! Datagrams, over UDP.

use std::collections::VecDeque;
use std::io::ErrorKind;
use std::pin::pin;
use std::sync::{Arc, Mutex};

use tokio::net::UdpSocket;

use super::{READ, SocketKind, Sockets, bind_failure, lock, socket_failure, unless_closed};
use crate::data::CallArguments;
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

/// `%UDP-SEND`: number, address, bytes.
pub(super) async fn send(arguments: CallArguments, sockets: Sockets) -> Completion {
    let (socket, _) = sockets.get(arguments.number(0)?)?.datagrams()?;
    let (address, bytes) = (arguments.text(1)?, arguments.bytes(2)?);
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
    let receive = async {
        loop {
            udp.readable().await.map_err(|error| socket_failure(&error))?;
            // Who waits has no room of its own.
            let received = READ.with_borrow_mut(|room| {
                udp.try_recv_from(room).map(|(count, address)| (room[..count].to_vec(), address.to_string()))
            });
            match received {
                Err(error) if error.kind() == ErrorKind::WouldBlock => {}
                received => return received.map_err(|error| socket_failure(&error)),
            }
        }
    };
    let datagram = unless_closed(socket.closing.subscribe(), pin!(receive)).await?;
    lock(&datagrams).push_back(datagram);
    Ok(Vec::new())
}
