//! A run as a live source of Foxglove, by its protocol over WebSocket, without TLS.
//!
//! The server is on the event loop of `world/`. It takes nothing from clients: they subscribe to channels,
//! and that is all. A client that reads too slowly misses the oldest messages.

use std::fmt;
use std::net::SocketAddr;
use std::sync::mpsc::channel;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use esl_bytecode::Bytes;
use foxglove::{ChannelBuilder, Context, PartialMetadata, RawChannel, Schema, WebSocketServer};

use super::RunSink;
use crate::mcap::OutputChannel;

/// Time that clients have at the end to take what is on its way.
const FAREWELL: Duration = Duration::from_millis(500);

/// Why a run is not a live source.
#[derive(Debug)]
pub enum LiveFault {
    /// Other machines reach the address, and would hear what is said there.
    Exposed(SocketAddr),
    /// Nothing can listen there, for this reason.
    Address(SocketAddr, String),
}

impl fmt::Display for LiveFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            LiveFault::Exposed(address) => write!(
                f,
                "others could read the traffic at {address}: use a port of 127.0.0.1, which others reach by \
                 ssh -L {}:127.0.0.1:{}",
                address.port(),
                address.port()
            ),
            LiveFault::Address(address, reason) => {
                write!(f, "cannot listen for Foxglove at {address}: {reason}")
            }
        }
    }
}

impl std::error::Error for LiveFault {}

/// A live source.
pub struct LiveServer {
    context: Arc<Context>,
    channels: Mutex<Vec<Arc<RawChannel>>>,
    handle: Mutex<Option<foxglove::WebSocketServerHandle>>,
    address: SocketAddr,
}

impl LiveServer {
    /// Listens at an address of this machine, for a program of this name.
    ///
    /// # Errors
    /// [`LiveFault`].
    pub fn begin(address: SocketAddr, program: &str) -> Result<LiveServer, LiveFault> {
        if !address.ip().is_loopback() {
            return Err(LiveFault::Exposed(address));
        }
        let context = Context::new();
        let host = match address {
            SocketAddr::V4(address) => address.ip().to_string(),
            SocketAddr::V6(address) => format!("[{}]", address.ip()),
        };
        let server = WebSocketServer::new().name(program).bind(host, address.port()).context(&context);
        let (send, started) = channel();
        let start = async move { _ = send.send(server.start().await) };
        let failed = |reason: String| LiveFault::Address(address, reason);
        esl_world::spawn(start).map_err(|error| failed(error.to_string()))?;
        let handle = started.recv().map_err(|error| failed(error.to_string()))?;
        let handle = handle.map_err(|error| failed(error.to_string()))?;
        let address = SocketAddr::new(address.ip(), handle.port());
        Ok(LiveServer { context, channels: Mutex::default(), handle: Mutex::new(Some(handle)), address })
    }

    /// Returns the address at which it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Ends it, when the clients have taken what is on its way.
    pub fn end(&self) {
        let handle = self.handle.lock().unwrap_or_else(PoisonError::into_inner).take();
        let Some(handle) = handle else { return };
        if handle.client_count() > 0 {
            std::thread::sleep(FAREWELL);
        }
        let (send, stopped) = channel();
        let stop = async move {
            handle.stop().wait().await;
            _ = send.send(());
        };
        if esl_world::spawn(stop).is_ok() {
            // Clients that do not answer are left.
            _ = stopped.recv_timeout(FAREWELL);
        }
    }
}

impl RunSink for LiveServer {
    fn channel(&self, channel: OutputChannel) -> Option<u16> {
        let OutputChannel { topic, encoding, schema, metadata } = channel;
        let schema = schema.map(|(name, form, text)| Schema::new(name, form, text.to_vec()));
        let builder = ChannelBuilder::new(topic)
            .message_encoding(encoding)
            .schema(schema)
            .metadata(metadata.into_iter().collect())
            .context(&self.context);
        let channel = builder.build_raw().ok()?;
        let mut channels = self.channels.lock().unwrap_or_else(PoisonError::into_inner);
        let number = u16::try_from(channels.len()).ok()?;
        channels.push(channel);
        Some(number)
    }

    fn message(&self, channel: u16, time: u64, payload: Bytes) {
        let channels = self.channels.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(channel) = channels.get(usize::from(channel)) {
            channel.log_with_meta(&payload, PartialMetadata::with_log_time(time));
        }
    }
}
