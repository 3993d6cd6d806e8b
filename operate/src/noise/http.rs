//! Bytes as a connection over which requests of HTTP come.

use std::convert::Infallible;
use std::pin::Pin;
use std::task::{Context, Poll, Waker};

use http_body_util::{BodyExt, Limited};
use hyper::body::Incoming;
use hyper::header::HOST;
use hyper::http::request::Parts;
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper::{Request, StatusCode};

use crate::http::{HEAD, is_own_name, plain};

/// Takes bytes as those that come over a connection, and calls `judge` with the head and the body of each
/// request, which says whether it understands them. Returns how many it has understood.
pub(crate) fn understand(bytes: &[u8], judge: impl Fn(&Parts, &[u8]) -> bool) -> usize {
    let understood = std::cell::Cell::new(0);
    let service = service_fn(|request: Request<Incoming>| async {
        let (head, body) = request.into_parts();
        let is_own = head.headers.get(HOST).is_some_and(is_own_name);
        // A body without an end does not count.
        let body = Limited::new(body, 1 << 20).collect().await.map(|body| body.to_bytes());
        if body.is_ok_and(|body| judge(&head, &body)) && is_own {
            understood.set(understood.get() + 1);
        }
        Ok::<_, Infallible>(plain(StatusCode::OK, ""))
    });
    let connection = http1::Builder::new().max_buf_size(HEAD).serve_connection(Overheard(bytes), service);
    // All bytes are there, so it waits for nothing; it may request another poll all the same.
    let mut connection = std::pin::pin!(connection);
    for _ in 0..64 {
        if connection.as_mut().poll(&mut Context::from_waker(Waker::noop())).is_ready() {
            break;
        }
    }
    understood.get()
}

/// Bytes as a connection over which they come, and then no others; what is answered goes nowhere.
struct Overheard<'a>(&'a [u8]);

impl hyper::rt::Read for Overheard<'_> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        _: &mut Context<'_>,
        mut to: hyper::rt::ReadBufCursor<'_>,
    ) -> Poll<std::io::Result<()>> {
        if self.0.is_empty() {
            return Poll::Pending;
        }
        let (now, rest) = self.0.split_at(self.0.len().min(to.remaining()));
        to.put_slice(now);
        self.0 = rest;
        Poll::Ready(Ok(()))
    }
}

impl hyper::rt::Write for Overheard<'_> {
    fn poll_write(self: Pin<&mut Self>, _: &mut Context<'_>, bytes: &[u8]) -> Poll<std::io::Result<usize>> {
        Poll::Ready(Ok(bytes.len()))
    }

    fn poll_flush(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<std::io::Result<()>> {
        Poll::Ready(Ok(()))
    }

    fn poll_shutdown(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<std::io::Result<()>> {
        Poll::Ready(Ok(()))
    }
}
