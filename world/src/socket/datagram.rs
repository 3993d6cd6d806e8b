//! Datagrams, over UDP.

use std::collections::VecDeque;
use std::io::ErrorKind;
use std::pin::pin;
use std::sync::{Arc, Mutex};

use esl_bytecode::Bytes;
use esl_host::{HostFailure, HostHandle, IntoDatum, Payload};
use tokio::net::UdpSocket;

use super::{READ, Socket, SocketKind, bind_failure, lock, socket_failure, unless_closed};

/// A datagram, and the address of its sender.
pub(crate) type Datagram = (Bytes, String);

/// The datagrams that the program has not taken.
pub(crate) type Datagrams = Arc<Mutex<VecDeque<Datagram>>>;

/// Opens a socket for datagrams.
pub(super) async fn open(socket: HostHandle<Socket>, address: String) -> Result<(), HostFailure> {
    let udp = UdpSocket::bind(address).await.map_err(|error| bind_failure(&error))?;
    let port = udp.local_addr().map_or(0, |address| address.port().into());
    socket.set((SocketKind::Udp(Arc::new(udp), Arc::default()), port, String::new()))
}

/// Sends a datagram.
pub(super) async fn send(
    socket: HostHandle<Socket>,
    address: String,
    Payload(bytes): Payload,
) -> Result<(), HostFailure> {
    let (udp, _) = socket.datagrams()?;
    udp.send_to(&bytes, address).await.map(drop).map_err(|error| bind_failure(&error))
}

/// Takes a datagram.
pub(super) fn take(
    socket: HostHandle<Socket>,
) -> Result<Option<Vec<esl_bytecode::datum::Datum>>, HostFailure> {
    let (_, datagrams) = socket.datagrams()?;
    let next = lock(&datagrams).pop_front();
    Ok(next.map(|(bytes, sender)| vec![bytes.into_datum(), sender.into_datum()]))
}

/// Waits until there is a datagram to be taken.
pub(super) async fn wait(socket: HostHandle<Socket>) -> Result<(), HostFailure> {
    let (udp, datagrams) = socket.datagrams()?;
    if !lock(&datagrams).is_empty() {
        return Ok(());
    }
    let receive = async {
        loop {
            udp.readable().await.map_err(|error| socket_failure(&error))?;
            // Waiting operations have no buffer of their own.
            let received = READ.with_borrow_mut(|room| {
                udp.try_recv_from(room)
                    .map(|(count, address)| (Bytes::copy_from_slice(&room[..count]), address.to_string()))
            });
            match received {
                Err(error) if error.kind() == ErrorKind::WouldBlock => {}
                received => return received.map_err(|error| socket_failure(&error)),
            }
        }
    };
    let datagram = unless_closed(socket.closing.subscribe(), pin!(receive)).await?;
    lock(&datagrams).push_back(datagram);
    Ok(())
}
