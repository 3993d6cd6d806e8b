//! WebSocket (RFC 6455): connections of the program's to servers, and those that clients begin with a server
//! of `:http`.
//!
//! The frames are tungstenite's, the requests and the answers that come before them hyper's. The modules have
//! a part each: `client` and `server` the handshake, `connection` the state that the program and the event
//! loop share, `driver` the task on the event loop that reads and writes, `stream` when the peer was heard.
//!
//! Guarantees: a message is delivered whole, once, in its order. The memory of a connection is bounded: one
//! message that arrives, those that wait for the program, one that is being sent. A peer that breaks the
//! protocol, falls silent or goes away is a failure at the call.

mod client;
mod connection;
mod driver;
mod server;
mod stream;

use std::time::Duration;

use esl_bytecode::datum::{Datum, DatumKind};
use esl_host::{FromArgument, HostFailure, HostHandle, HostRows, Inbox, Payload, Right};
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::protocol::CloseFrame;
use tokio_tungstenite::tungstenite::protocol::frame::coding::CloseCode;

use crate::operation::{ready_soon, spawned};
use crate::tls_files::ClientFiles;
use client::ClientHandshake;
use connection::WsConnection;
pub(crate) use server::{Accepted, Handshake};

/// Most messages that wait for the program.
const MOST_WAITING: usize = 1000;
/// Most bytes of a message, whatever the program says.
const MOST_BYTES: usize = 64 << 20;
/// Most bytes of a control frame.
const CONTROL: usize = 125;
/// Time that a peer has for its part of the closing handshake.
const GOODBYE: Duration = Duration::from_secs(2);
/// Time in which the bytes that a peer still sends are taken after the last frame. A connection that is
/// closed before is reset, and the peer may not get that frame.
const LINGERING: Duration = Duration::from_secs(1);

fn ws_failure(reason: impl ToString) -> HostFailure {
    HostFailure::new("WS-ERROR", reason)
}

/// Limits of a connection.
#[derive(Clone, Copy)]
pub(crate) struct SocketLimits {
    /// Most bytes of a message that arrives.
    largest: usize,
    /// Time without a byte of the peer after which it is asked for a sign of life, and time that it has for
    /// that.
    keep_alive: Option<Duration>,
}

impl SocketLimits {
    fn new(largest: usize, keep_alive: Option<f64>) -> Result<SocketLimits, HostFailure> {
        let keep_alive = keep_alive.map(Duration::try_from_secs_f64).transpose().map_err(ws_failure)?;
        Ok(SocketLimits { largest: largest.clamp(1, MOST_BYTES), keep_alive })
    }
}

/// A message that the program sends: a string is a text, a vector of bytes is binary.
struct SentMessage(Message);

impl FromArgument for SentMessage {
    const TYPE: &'static str = "VECTOR";

    fn from_argument(datum: &Datum) -> Result<SentMessage, HostFailure> {
        if let DatumKind::String(text) = datum.kind() {
            return Ok(SentMessage(Message::text(text.to_string())));
        }
        Payload::from_argument(datum).map(|Payload(bytes)| SentMessage(Message::Binary(bytes)))
    }
}

/// Returns the frame that closes a connection.
fn close_frame(code: u16, reason: String) -> Result<CloseFrame, HostFailure> {
    let code = CloseCode::from(code);
    if !code.is_allowed() {
        return Err(ws_failure(format!(
            "a connection cannot be closed with the code {code}; take 1000, or one from 3000 to 4999"
        )));
    }
    // The code has two bytes of the frame.
    let most = CONTROL - 2;
    if reason.len() > most {
        return Err(ws_failure(format!(
            "the reason has {} bytes: at most {most} are sent with a code",
            reason.len()
        )));
    }
    Ok(CloseFrame { code, reason: reason.into() })
}

/// Returns the functions of `:ws`.
pub(crate) fn rows(inbox: &Inbox) -> HostRows {
    let mut rows = HostRows::new(inbox);
    rows.constructor::<WsConnection>("%WS-NEW", "Returns a connection that is not open.");
    rows.at_once(
        "%WS-URL",
        ["url"],
        "Returns the URL of the request that begins a connection to URL, and the address to connect to.",
        |url: String| client::http_url(&url),
    )
    .everywhere();
    rows.operation(
        spawned,
        "%WS-OPEN",
        [
            "connection", "address", "url", "headers", "protocols", "largest", "keep-alive", "ca-file", "certificate",
            "key",
        ],
        "Opens CONNECTION to the server at ADDRESS. Returns the protocol of PROTOCOLS that it chooses, or NIL.",
        |connection: HostHandle<WsConnection>,
         address: String,
         url: String,
         headers: Vec<(String, String)>,
         protocols: Vec<String>,
         largest: usize,
         keep_alive: Option<f64>,
         files: ClientFiles| async move {
            let limits = SocketLimits::new(largest, keep_alive)?;
            let handshake = ClientHandshake::new(&url, headers, protocols)?;
            handshake.open(&connection, &address, files, limits).await
        },
    )
    .needs(Right::Net, "address")
    .needs(Right::Read, "ca-file")
    .needs(Right::Read, "certificate")
    .needs(Right::Read, "key");
    rows.operation(
        spawned,
        "%WS-ACCEPT",
        ["connection", "server", "request", "protocols", "largest", "keep-alive"],
        "Opens CONNECTION by answering the request with the number REQUEST of SERVER. Returns the first of PROTOCOLS \
         that its client offers, or NIL.",
        |connection, server, request: i64, protocols: Vec<String>, largest: usize, keep_alive: Option<f64>| {
            let opened = SocketLimits::new(largest, keep_alive)
                .and_then(|limits| server::accept(&connection, &server, request, &protocols, limits));
            std::future::ready(opened)
        },
    );
    rows.operation(
        ready_soon,
        "%WS-SEND",
        ["connection", "message"],
        "Sends MESSAGE, a text or bytes; waits until the system has taken it.",
        |connection: HostHandle<WsConnection>, SentMessage(message): SentMessage| async move {
            connection.get()?.send(message).await
        },
    );
    rows.at_once(
        "%WS-TAKE",
        ["connection", "lenient"],
        "Returns the next message that has arrived; NIL if there is none yet. At the end of the connection it fails; if \
         it is LENIENT and the end is an ordinary one, it returns T.",
        |connection: HostHandle<WsConnection>, is_lenient: bool| connection.get()?.take(is_lenient),
    ).local();
    rows.operation(
        ready_soon,
        "%WS-AWAIT",
        ["connection"],
        "Waits until %WS-TAKE does not return NIL.",
        |connection: HostHandle<WsConnection>| async move {
            connection.get()?.arrival().await;
            Ok(())
        },
    );
    rows.operation(
        ready_soon,
        "%WS-AWAIT-END",
        ["connection"],
        "Waits until the connection has ended. Returns code and reason.",
        |connection: HostHandle<WsConnection>| async move { Ok(connection.get()?.end().await) },
    );
    rows.operation(
        spawned,
        "%WS-CLOSE",
        ["connection", "code", "reason"],
        "Closes the connection, unless it has ended, and waits until it has.",
        |connection: HostHandle<WsConnection>, code: u16, reason: String| async move {
            let frame = close_frame(code, reason)?;
            connection.close(frame).await;
            Ok(())
        },
    )
    .closes();
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_close_frame_has_a_code_that_may_be_sent_and_a_short_reason() {
        for code in [1000, 1001, 1011, 3000, 4999] {
            assert!(close_frame(code, "x".repeat(CONTROL - 2)).is_ok(), "{code}");
        }
        for code in [0, 999, 1005, 1006, 1015, 2000, 5000] {
            assert!(close_frame(code, String::new()).is_err(), "{code}");
        }
        assert!(close_frame(1000, "x".repeat(CONTROL - 1)).is_err());
    }

    #[test]
    fn limits_are_bounded() {
        let limits = SocketLimits::new(usize::MAX, Some(0.5)).expect("it is a time");
        assert_eq!((limits.largest, limits.keep_alive), (MOST_BYTES, Some(Duration::from_millis(500))));
        for keep_alive in [-1.0, f64::NAN, f64::INFINITY] {
            assert!(SocketLimits::new(1, Some(keep_alive)).is_err(), "{keep_alive}");
        }
    }
}
