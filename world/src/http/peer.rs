//! A connection to a client, which is served and watched at the same time.

use std::io::{Error, ErrorKind, IoSlice};
use std::net::Shutdown;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use socket2::SockRef;
use tokio::io::{AsyncRead, AsyncWrite, Interest, ReadBuf};
use tokio::net::TcpStream;
use tokio::time::Sleep;

/// Time for which a client waits for its answer that has closed its direction of the connection, before it
/// counts as gone: the system does not say whether it still reads.
const PATIENCE: Duration = Duration::from_secs(10);
/// Time between two checks of a connection with bytes that are not read yet.
const PAUSE: Duration = Duration::from_millis(250);
/// Time in which what a client still sends is taken after the last answer. A connection that is closed before
/// is reset, and the client may not get the answer.
const LINGERING: Duration = Duration::from_secs(1);
/// Time in which a client has to take something of an answer.
const STALL: Duration = Duration::from_secs(30);

/// A connection to a client.
pub(super) struct Peer {
    stream: Arc<TcpStream>,
    /// Ends when the client has taken nothing for too long, if it takes nothing.
    stalled: Option<Pin<Box<Sleep>>>,
}

impl Clone for Peer {
    fn clone(&self) -> Peer {
        Peer { stream: self.stream.clone(), stalled: None }
    }
}

impl Peer {
    pub(super) fn new(stream: TcpStream) -> Peer {
        // Answers are small, and are not to wait for more; without it they only take longer.
        drop(stream.set_nodelay(true));
        Peer { stream: Arc::new(stream), stalled: None }
    }

    /// Waits until the client has gone.
    pub(super) async fn gone(&self) {
        loop {
            match self.stream.ready(Interest::READABLE).await {
                Ok(ready) if ready.is_read_closed() => {
                    let is_broken = async {
                        loop {
                            match self.stream.ready(Interest::WRITABLE).await {
                                Ok(ready) if !ready.is_write_closed() => tokio::time::sleep(PAUSE).await,
                                _ => return,
                            }
                        }
                    };
                    _ = tokio::time::timeout(PATIENCE, is_broken).await;
                    return;
                }
                Ok(_) => tokio::time::sleep(PAUSE).await,
                Err(_) => return,
            }
        }
    }

    /// Ends the connection: says that nothing more comes, and takes what the client still sends for a while.
    pub(super) async fn end(self) {
        if SockRef::from(&*self.stream).shutdown(Shutdown::Write).is_err() {
            return;
        }
        let mut room = vec![0; 16 << 10];
        let drain = async {
            loop {
                match self.stream.try_read(&mut room) {
                    // Others have their turn, however fast it sends.
                    Ok(1..) => tokio::task::yield_now().await,
                    Err(error) if error.kind() == ErrorKind::WouldBlock => {
                        if self.stream.readable().await.is_err() {
                            return;
                        }
                    }
                    _ => return,
                }
            }
        };
        _ = tokio::time::timeout(LINGERING, drain).await;
    }

    fn poll_write_with(
        &mut self,
        context: &mut Context<'_>,
        write: impl Fn(&TcpStream) -> Result<usize, Error>,
    ) -> Poll<Result<usize, Error>> {
        while self.stream.poll_write_ready(context)?.is_ready() {
            match write(&self.stream) {
                Err(error) if error.kind() == ErrorKind::WouldBlock => {}
                written => {
                    self.stalled = None;
                    return Poll::Ready(written);
                }
            }
        }
        // The client does not read. Unsent data take memory meanwhile.
        let stalled = self.stalled.get_or_insert_with(|| Box::pin(tokio::time::sleep(STALL)));
        stalled.as_mut().poll(context).map(|()| Err(ErrorKind::TimedOut.into()))
    }
}

impl AsyncRead for Peer {
    fn poll_read(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
        to: &mut ReadBuf<'_>,
    ) -> Poll<Result<(), Error>> {
        loop {
            ready!(self.stream.poll_read_ready(context))?;
            match self.stream.try_read(to.initialize_unfilled()) {
                Ok(count) => {
                    to.advance(count);
                    return Poll::Ready(Ok(()));
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => {}
                Err(error) => return Poll::Ready(Err(error)),
            }
        }
    }
}

impl AsyncWrite for Peer {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<Result<usize, Error>> {
        self.poll_write_with(context, |stream| stream.try_write(bytes))
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        parts: &[IoSlice<'_>],
    ) -> Poll<Result<usize, Error>> {
        self.poll_write_with(context, |stream| stream.try_write_vectored(parts))
    }

    fn is_write_vectored(&self) -> bool {
        true
    }

    fn poll_flush(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<Result<(), Error>> {
        Poll::Ready(Ok(()))
    }

    fn poll_shutdown(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<Result<(), Error>> {
        // The client may be gone.
        drop(SockRef::from(&*self.stream).shutdown(Shutdown::Write));
        Poll::Ready(Ok(()))
    }
}
