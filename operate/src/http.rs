//! HTTP for the servers of a run: connections, and answers.
//!
//! Guarantees: connections are those of a [`Lobby`], until a handler settles them; heads are bounded, in
//! size and in the time that they take; a request must name the server by an address or as `localhost`, or
//! come over TLS, so that no page of another site reaches it by a name of its own.

use std::convert::Infallible;
use std::net::{IpAddr, TcpListener};
use std::time::Duration;

use bytes::Bytes;
use esl_world::{NoEventLoop, TlsIdentity};
use http_body_util::combinators::BoxBody;
use http_body_util::{BodyExt, Full};
use hyper::body::Incoming;
use hyper::header::{CACHE_CONTROL, CONTENT_TYPE, HOST, HeaderValue, X_CONTENT_TYPE_OPTIONS};
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper::{Request, Response, StatusCode};
use hyper_util::rt::{TokioIo, TokioTimer};
use tokio::io::{AsyncRead, AsyncWrite};

use super::lobby::{Lobby, LobbyVisit, notice_absence};

/// Most bytes of the head of a request.
pub(super) const HEAD: usize = 16 << 10;
/// Time that a peer has for the head of a request.
const HEAD_TIME: Duration = Duration::from_secs(10);

/// Body of an answer.
pub(super) type HttpBody = BoxBody<Bytes, Infallible>;

/// Serves requests at a listener, over TLS if it has an identity, on the event loop. Connections come into
/// the lobby.
///
/// # Errors
/// The reason, if there is no event loop.
pub(super) fn serve<F, R>(
    listener: TcpListener,
    identity: Option<TlsIdentity>,
    lobby: Lobby,
    handler: F,
) -> Result<(), NoEventLoop>
where
    F: Fn(Request<Incoming>, LobbyVisit) -> R + Clone + Send + Sync + 'static,
    R: Future<Output = Response<HttpBody>> + Send + 'static,
{
    esl_world::spawn(async move {
        // It has been made for this, so the event loop takes it.
        let Ok(listener) = tokio::net::TcpListener::from_std(listener) else { return };
        loop {
            let Ok((stream, address)) = listener.accept().await else {
                // The system lacks something, such as descriptors; others may give it back.
                tokio::time::sleep(Duration::from_millis(100)).await;
                continue;
            };
            notice_absence(&stream);
            let visit = lobby.enter(address.ip());
            let (handler, identity) = (handler.clone(), identity.clone());
            tokio::spawn(async move {
                let own = visit.clone();
                let serve = async move {
                    match identity {
                        None => converse(stream, false, visit, handler).await,
                        Some(identity) => {
                            // A peer that does not speak TLS is disconnected.
                            let secured = tokio::time::timeout(HEAD_TIME, identity.accept(stream)).await;
                            if let Ok(Ok(stream)) = secured {
                                converse(stream, true, visit, handler).await;
                            }
                        }
                    }
                };
                tokio::select! {
                    () = serve => {}
                    () = own.ended() => {}
                }
            });
        }
    })
}

/// Answers the requests of a connection, until it ends.
async fn converse<F, R>(
    stream: impl AsyncRead + AsyncWrite + Unpin,
    is_secured: bool,
    visit: LobbyVisit,
    handler: F,
) where
    F: Fn(Request<Incoming>, LobbyVisit) -> R + Clone,
    R: Future<Output = Response<HttpBody>>,
{
    let service = service_fn(move |request| {
        let answer = answer(request, is_secured, visit.clone(), handler.clone());
        async move { Ok::<_, Infallible>(answer.await) }
    });
    let connection = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(HEAD_TIME)
        .max_buf_size(HEAD)
        .serve_connection(TokioIo::new(stream), service);
    // A fault of the peer ends its connection.
    drop(connection.await);
}

async fn answer<F, R>(
    request: Request<Incoming>,
    is_secured: bool,
    visit: LobbyVisit,
    handler: F,
) -> Response<HttpBody>
where
    F: Fn(Request<Incoming>, LobbyVisit) -> R,
    R: Future<Output = Response<HttpBody>>,
{
    // Another site that has its name lead here lacks the certificate for that.
    if !is_secured && !request.headers().get(HOST).is_some_and(is_own_name) {
        return plain(StatusCode::MISDIRECTED_REQUEST, "this server is reached by its address only\n");
    }
    handler(request, visit).await
}

/// Returns whether a `Host` header names a server by its address, or as `localhost`.
pub(super) fn is_own_name(host: &HeaderValue) -> bool {
    let Ok(host) = host.to_str() else { return false };
    let name = match host.rsplit_once(':') {
        Some((name, port)) if port.bytes().all(|byte| byte.is_ascii_digit()) => name,
        _ => host,
    };
    let name = name.strip_prefix('[').and_then(|name| name.strip_suffix(']')).unwrap_or(name);
    name == "localhost" || name.parse::<IpAddr>().is_ok()
}

/// Returns an answer with a text.
pub(super) fn plain(status: StatusCode, text: &'static str) -> Response<HttpBody> {
    with(status, "text/plain; charset=utf-8", text)
}

/// Returns an answer with contents of some type, which caches must not store.
pub(super) fn with(
    status: StatusCode,
    content_type: &'static str,
    contents: impl Into<Bytes>,
) -> Response<HttpBody> {
    let mut response = Response::new(Full::new(contents.into()).boxed());
    *response.status_mut() = status;
    let headers = response.headers_mut();
    headers.insert(CONTENT_TYPE, HeaderValue::from_static(content_type));
    headers.insert(CACHE_CONTROL, HeaderValue::from_static("no-store"));
    headers.insert(X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    response
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_other_sites_are_not_ones_own() {
        let is_own = |host: &str| HeaderValue::from_str(host).is_ok_and(|host| is_own_name(&host));
        for host in ["127.0.0.1:8080", "localhost", "localhost:1", "[::1]:80", "10.0.0.7"] {
            assert!(is_own(host), "{host}");
        }
        for host in ["evil.example", "evil.example:8080", "127.0.0.1.evil.example", "", "localhost.evil:1"] {
            assert!(!is_own(host), "{host}");
        }
    }
}
