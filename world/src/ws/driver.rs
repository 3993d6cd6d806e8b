//! The task of a connection on the event loop: it reads messages while there is room for them, writes those
//! of the program, answers pings, and asks a peer that is silent for a sign of life.

use std::future::poll_fn;
use std::io::ErrorKind;
use std::task::{Context, Poll};
use std::time::Duration;

use bytes::Bytes;
use esl_host::IntoDatum;
use futures_util::{SinkExt, StreamExt};
use hyper::upgrade::Upgraded;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::sync::oneshot;
use tokio::time::Instant;
use tokio_tungstenite::WebSocketStream;
use tokio_tungstenite::tungstenite::error::ProtocolError;
use tokio_tungstenite::tungstenite::protocol::frame::coding::CloseCode;
use tokio_tungstenite::tungstenite::protocol::{CloseFrame, Role, WebSocketConfig};
use tokio_tungstenite::tungstenite::{Error, Message};

use super::connection::{ConnectionEnd, DriverEnd, SendRequest};
use super::stream::TimedStream;
use super::{GOODBYE, LINGERING, MOST_BYTES, SocketLimits};

/// Bytes that are read and written at a time.
const BUFFER: usize = 16 << 10;
/// Most pongs that wait to be written. The peer is not read before it reads these.
const MOST_PONGS: usize = 256;
/// Bytes of the pongs beside a message, and of heads of frames, at most.
const BESIDE: usize = 64 << 10;

/// The task of a connection.
pub(super) struct FrameDriver {
    stream: WebSocketStream<TimedStream>,
    end: DriverEnd,
    keep_alive: Option<Duration>,
    /// Whether something is being written, and the operation that waits for it.
    writing: Option<Option<oneshot::Sender<()>>>,
    /// Number of the pings that were answered since the last time that nothing was left to be written.
    pongs: usize,
    /// Whether the program's messages have their turn before those of the peer.
    sends_next: bool,
    /// When reading began again after a time without room.
    resumed_at: Instant,
    /// When the peer was asked for a sign of life.
    asked_at: Option<Instant>,
}

/// One thing that happens to a connection.
enum DriverStep {
    Arrived(Message),
    Send(SendRequest),
    /// The program closes the connection, or has lost it.
    Close(CloseFrame),
    Failed(Error),
    /// The peer has ended the connection.
    Ended,
    /// There is room again.
    Room,
    /// The peer was silent.
    Silence,
}

/// How a conversation ends.
enum Farewell {
    /// The peer has closed; it is answered.
    Answer(ConnectionEnd),
    /// This side closes.
    Close(CloseFrame),
    /// The peer is told its fault.
    Reproach(ConnectionEnd, CloseCode),
    /// Nothing can be said.
    Gone(ConnectionEnd),
}

impl FrameDriver {
    /// Begins the frames of a connection whose handshake is done.
    pub(super) async fn new(
        stream: Upgraded,
        role: Role,
        limits: SocketLimits,
        end: DriverEnd,
    ) -> FrameDriver {
        let config = WebSocketConfig::default()
            .read_buffer_size(BUFFER)
            .write_buffer_size(BUFFER)
            .max_write_buffer_size(BUFFER + MOST_BYTES + BESIDE)
            .max_message_size(Some(limits.largest))
            .max_frame_size(Some(limits.largest));
        FrameDriver {
            stream: WebSocketStream::from_raw_socket(TimedStream::new(stream), role, Some(config)).await,
            end,
            keep_alive: limits.keep_alive,
            writing: None,
            pongs: 0,
            sends_next: false,
            resumed_at: Instant::now(),
            asked_at: None,
        }
    }

    /// Drives the connection until it has ended.
    pub(super) async fn run(mut self) {
        let arrivals = self.end.arrivals.clone();
        match self.converse().await {
            Farewell::Answer(end) => {
                arrivals.note_end(end);
                self.await_end().await;
            }
            Farewell::Close(frame) => {
                arrivals.note_end(ConnectionEnd::Closed(frame.code.into(), frame.reason.to_string()));
                if self.say(frame).await {
                    self.await_end().await;
                }
            }
            Farewell::Reproach(end, code) => {
                let reason = match &end {
                    ConnectionEnd::Broken(_, reason) | ConnectionEnd::TooLong(reason) => reason.as_str(),
                    ConnectionEnd::Closed(..) | ConnectionEnd::Lost(_) => "",
                };
                let frame = CloseFrame { code, reason: reason.into() };
                arrivals.note_end(end);
                if self.say(frame).await {
                    self.linger().await;
                }
            }
            Farewell::Gone(end) => arrivals.note_end(end),
        }
    }

    /// Reads and writes until there is a reason to end.
    async fn converse(&mut self) -> Farewell {
        loop {
            let result = match self.step().await {
                DriverStep::Arrived(message) => self.take_in(message),
                DriverStep::Send(SendRequest { message, done }) => self.begin_writing(message, Some(done)),
                DriverStep::Close(frame) => Err(Farewell::Close(frame)),
                DriverStep::Failed(error) => Err(farewell(&error)),
                DriverStep::Ended => Err(Farewell::Gone(without_goodbye())),
                DriverStep::Room => {
                    self.resume();
                    Ok(())
                }
                DriverStep::Silence => self.ask_for_life(),
            };
            if let Err(farewell) = result {
                return farewell;
            }
        }
    }

    async fn step(&mut self) -> DriverStep {
        let has_room = self.end.arrivals.has_room();
        let deadline = self.deadline();
        let arrivals = self.end.arrivals.clone();
        let mut closing = self.end.closing.clone();
        let silence = async move {
            match deadline {
                Some(deadline) => tokio::time::sleep_until(deadline).await,
                None => std::future::pending().await,
            }
        };
        tokio::select! {
            biased;
            frame = closing.wait_for(Option::is_some) => {
                let going_away = || CloseFrame { code: CloseCode::Away, reason: "".into() };
                DriverStep::Close(frame.ok().and_then(|frame| frame.clone()).unwrap_or_else(going_away))
            }
            step = poll_fn(|context| self.poll_step(context, has_room)) => step,
            () = arrivals.taken.notified(), if !has_room => DriverStep::Room,
            () = silence => DriverStep::Silence,
        }
    }

    fn poll_step(&mut self, context: &mut Context<'_>, has_room: bool) -> Poll<DriverStep> {
        if self.writing.is_some() {
            match self.stream.poll_flush_unpin(context) {
                Poll::Ready(Ok(())) => {
                    self.pongs = 0;
                    if let Some(Some(done)) = self.writing.take() {
                        // The call may have been left.
                        _ = done.send(());
                    }
                }
                Poll::Ready(Err(error)) => return Poll::Ready(DriverStep::Failed(error)),
                Poll::Pending => {}
            }
        }
        self.sends_next = !self.sends_next;
        for sends in [self.sends_next, !self.sends_next] {
            if sends && self.writing.is_none() {
                // At the end of the program's part, `closing` has ended too.
                while let Poll::Ready(Some(request)) = self.end.requests.poll_recv(context) {
                    // A call that was left has nothing sent.
                    if !request.done.is_closed() {
                        return Poll::Ready(DriverStep::Send(request));
                    }
                }
            } else if !sends && has_room && self.pongs < MOST_PONGS {
                match self.stream.poll_next_unpin(context) {
                    Poll::Ready(Some(Ok(message))) => return Poll::Ready(DriverStep::Arrived(message)),
                    Poll::Ready(Some(Err(error))) => return Poll::Ready(DriverStep::Failed(error)),
                    Poll::Ready(None) => return Poll::Ready(DriverStep::Ended),
                    Poll::Pending => {}
                }
            }
        }
        Poll::Pending
    }

    fn begin_writing(&mut self, message: Message, done: Option<oneshot::Sender<()>>) -> Result<(), Farewell> {
        self.stream.start_send_unpin(message).map_err(|error| farewell(&error))?;
        self.writing = Some(done);
        Ok(())
    }

    fn take_in(&mut self, message: Message) -> Result<(), Farewell> {
        match message {
            Message::Text(text) => self.end.arrivals.add(text.as_str().into_datum(), text.len()),
            // A part of what was read would keep all of that.
            Message::Binary(bytes) => {
                self.end.arrivals.add(Bytes::copy_from_slice(&bytes).into_datum(), bytes.len());
            }
            Message::Close(frame) => {
                let end = match frame {
                    Some(frame) => ConnectionEnd::Closed(frame.code.into(), frame.reason.to_string()),
                    None => ConnectionEnd::Closed(CloseCode::Status.into(), String::new()),
                };
                return Err(Farewell::Answer(end));
            }
            // tungstenite answers it, and the answer is flushed here.
            Message::Ping(_) => {
                self.pongs += 1;
                self.writing.get_or_insert(None);
            }
            Message::Pong(_) | Message::Frame(_) => {}
        }
        Ok(())
    }

    /// Begins to count the silence of the peer anew: it was not read.
    fn resume(&mut self) {
        self.resumed_at = Instant::now();
        self.asked_at = None;
    }

    /// Returns when the peer gave a sign of life last. While something is being written, its reading is one.
    fn alive_at(&self) -> Instant {
        let stream = self.stream.get_ref();
        let heard = stream.read_at.max(self.resumed_at);
        if self.writing.is_some() { heard.max(stream.written_at) } else { heard }
    }

    /// Returns when the peer was asked for a sign of life that it has not given.
    fn unanswered(&self) -> Option<Instant> {
        self.asked_at.filter(|&asked| self.alive_at() <= asked)
    }

    fn deadline(&self) -> Option<Instant> {
        let from = self.unanswered().unwrap_or_else(|| self.alive_at());
        self.keep_alive.and_then(|time| from.checked_add(time))
    }

    /// Asks a silent peer for a sign of life; if it was asked, the connection is lost.
    fn ask_for_life(&mut self) -> Result<(), Farewell> {
        let time = self.keep_alive.unwrap_or_default();
        if !self.end.arrivals.has_room() {
            self.resume();
            return Ok(());
        }
        if self.unanswered().is_some() {
            let reason = format!("the peer has been silent for {} s", (2 * time).as_secs_f64());
            return Err(Farewell::Gone(ConnectionEnd::Lost(reason)));
        }
        self.asked_at = Some(Instant::now());
        // A peer that does not read what is being written would not get it.
        if self.writing.is_none() { self.begin_writing(Message::Ping(Bytes::new()), None) } else { Ok(()) }
    }

    /// Sends a frame that closes the connection. Returns whether it was sent.
    async fn say(&mut self, frame: CloseFrame) -> bool {
        let say = self.stream.send(Message::Close(Some(frame)));
        tokio::time::timeout(GOODBYE, say).await.is_ok_and(|said| said.is_ok())
    }

    /// Waits for the end of the closing handshake.
    async fn await_end(&mut self) {
        let read = async { while let Some(Ok(_)) = self.stream.next().await {} };
        _ = tokio::time::timeout(GOODBYE, read).await;
    }

    /// Takes the bytes that the peer still sends.
    async fn linger(&mut self) {
        let stream = self.stream.get_mut();
        let drain = async {
            let mut bytes = [0; 4096];
            _ = stream.shutdown().await;
            while stream.read(&mut bytes).await.is_ok_and(|count| count > 0) {}
        };
        _ = tokio::time::timeout(LINGERING, drain).await;
    }
}

fn without_goodbye() -> ConnectionEnd {
    ConnectionEnd::Lost("the peer has ended the connection without closing it".into())
}

/// Returns how a connection ends after a fault.
fn farewell(error: &Error) -> Farewell {
    match error {
        Error::ConnectionClosed
        | Error::AlreadyClosed
        | Error::Protocol(ProtocolError::ResetWithoutClosingHandshake) => Farewell::Gone(without_goodbye()),
        Error::Io(error) if error.kind() == ErrorKind::TimedOut => {
            Farewell::Gone(ConnectionEnd::Lost("the peer does not read".into()))
        }
        Error::Io(error) => Farewell::Gone(ConnectionEnd::Lost(error.to_string())),
        Error::Capacity(error) => {
            Farewell::Reproach(ConnectionEnd::TooLong(error.to_string()), CloseCode::Size)
        }
        Error::Utf8(_) => {
            let code = CloseCode::Invalid;
            Farewell::Reproach(ConnectionEnd::Broken(code.into(), "a text is not UTF-8".into()), code)
        }
        error => {
            let code = CloseCode::Protocol;
            let reason = match error {
                Error::Protocol(error) => error.to_string(),
                error => error.to_string(),
            };
            Farewell::Reproach(ConnectionEnd::Broken(code.into(), reason), code)
        }
    }
}
