//! The first line of a connection, by which it is seen whether its client speaks a version of HTTP that the
//! server speaks. hyper refuses other versions with the status 400, and takes HTTP 1.2 for one of them.

use std::io::Error;
use std::pin::Pin;
use std::task::{Context, Poll};

use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, ReadBuf};

use super::HEAD;

/// A connection of which some bytes were read ahead.
pub(super) struct Greeted<S> {
    ahead: Vec<u8>,
    /// Number of the bytes that were read again.
    taken: usize,
    stream: S,
}

/// A version of HTTP that the server does not speak.
pub(super) struct UnknownVersion<S>(pub(super) S);

impl<S: AsyncRead + AsyncWrite + Unpin> Greeted<S> {
    /// Reads ahead up to the end of the first line, or as far as there is one.
    pub(super) async fn read(mut stream: S) -> Result<Result<Greeted<S>, UnknownVersion<S>>, Error> {
        let mut ahead = Vec::with_capacity(1024);
        loop {
            let before = ahead.len();
            if let Some(line) = first_line(&ahead) {
                if !is_known(&mut ahead[line]) {
                    return Ok(Err(UnknownVersion(stream)));
                }
                break;
            }
            // A line that is longer than a head, or ends with the connection, is refused with that.
            if before > HEAD || stream.read_buf(&mut ahead).await? == 0 {
                break;
            }
        }
        Ok(Ok(Greeted { ahead, taken: 0, stream }))
    }
}

/// Returns the place of the first line that is not empty, without its end.
fn first_line(bytes: &[u8]) -> Option<std::ops::Range<usize>> {
    let start = bytes.iter().position(|byte| !b"\r\n".contains(byte))?;
    let length = bytes[start..].iter().position(|&byte| byte == b'\n')?;
    let end = start + length;
    Some(start..if bytes[end - 1] == b'\r' { end - 1 } else { end })
}

/// Returns false for a line of another version of HTTP. A later version of HTTP 1 is replaced by 1.1, which
/// it includes.
fn is_known(line: &mut [u8]) -> bool {
    let Some(at) = line.iter().rposition(|&byte| byte == b' ') else { return true };
    match &mut line[at + 1..] {
        [b'H', b'T', b'T', b'P', b'/', b'1', b'.', minor @ b'0'..=b'9'] => {
            *minor = (*minor).min(b'1');
            true
        }
        [b'H', b'T', b'T', b'P', b'/', version @ ..] => {
            // Anything else is not a version at all.
            !matches!(version, [b'0' | b'2'..=b'9'] | [b'0'..=b'9', b'.', b'0'..=b'9'])
        }
        _ => true,
    }
}

impl<S: AsyncRead + Unpin> AsyncRead for Greeted<S> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        to: &mut ReadBuf<'_>,
    ) -> Poll<Result<(), Error>> {
        let rest = &self.ahead[self.taken..];
        if rest.is_empty() {
            return Pin::new(&mut self.stream).poll_read(context, to);
        }
        let count = rest.len().min(to.remaining());
        to.put_slice(&rest[..count]);
        self.taken += count;
        if self.taken == self.ahead.len() {
            (self.ahead, self.taken) = (Vec::new(), 0);
        }
        Poll::Ready(Ok(()))
    }
}

impl<S: AsyncWrite + Unpin> AsyncWrite for Greeted<S> {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<Result<usize, Error>> {
        Pin::new(&mut self.stream).poll_write(context, bytes)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        parts: &[std::io::IoSlice<'_>],
    ) -> Poll<Result<usize, Error>> {
        Pin::new(&mut self.stream).poll_write_vectored(context, parts)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Result<(), Error>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Result<(), Error>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns what is read of a connection on which `sent` comes; `None` if its version is unknown.
    fn read(sent: &[u8]) -> Option<String> {
        let runtime = tokio::runtime::Builder::new_current_thread().build().expect("there is room");
        runtime.block_on(async {
            let (near, mut far) = tokio::io::duplex(1 << 20);
            tokio::io::AsyncWriteExt::write_all(&mut far, sent).await.expect("there is room");
            drop(far);
            let mut greeted = Greeted::read(near).await.expect("it can be read").ok()?;
            let mut text = String::new();
            greeted.read_to_string(&mut text).await.expect("it is text");
            Some(text)
        })
    }

    #[test]
    fn all_that_was_sent_is_read_unless_the_version_is_unknown() {
        for sent in
            ["", "\r\n\r\n", "GET", "GET /\n\nGET / HTTP/2.0\n\n", "GET / HTTP/1.0\r\n\r\n", "a HTTP/1\n"]
        {
            assert_eq!(read(sent.as_bytes()).as_deref(), Some(sent));
        }
        let long = "x".repeat(3 * HEAD);
        assert_eq!(read(long.as_bytes()), Some(long));
        let later = read(b"\r\nGET / HTTP/1.7\r\nHost: x\r\n\r\n");
        assert_eq!(later.as_deref(), Some("\r\nGET / HTTP/1.1\r\nHost: x\r\n\r\n"));
        for version in ["2.0", "0.9", "9.9", "3", "2"] {
            assert_eq!(read(format!("GET / HTTP/{version}\r\n\r\n").as_bytes()), None, "{version}");
        }
        for faulty in ["x", "1.11", "", "-1.0", "2.x"] {
            let sent = format!("GET / HTTP/{faulty}\r\n\r\n");
            assert_eq!(read(sent.as_bytes()), Some(sent), "{faulty} is refused as malformed");
        }
    }
}
