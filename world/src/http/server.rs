//! Servers: requests of others, with which an input of the program is signalled, and answers.
//!
//! A server has a task on the event loop for each connection, which reads requests, whole, signals the input
//! with each, and waits for the program's answer. When the client of one has gone, the input is signalled
//! with its number alone.

use std::collections::HashMap;
use std::future::Future;
use std::io::Error;
use std::pin::pin;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use bytes::Bytes;
use esl_bytecode::datum::Datum;
use esl_host::{HostFailure, HostHandle, HostInput, HostObject, HostRows, IntoDatum, Payload, Right, Sender};
use http_body_util::Full;
use hyper::body::Incoming;
use hyper::header::{self, HeaderValue};
use hyper::http::request::Parts;
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper::upgrade::OnUpgrade;
use hyper::{Request, Response, StatusCode};
use hyper_util::rt::{TokioIo, TokioTimer};
use tokio::io::{AsyncRead, AsyncWrite, AsyncWriteExt};
use tokio::net::TcpListener;
use tokio::sync::{Semaphore, oneshot, watch};

use super::address::AddressCounts;
use super::body::receive;
use super::greeting::{Greeted, UnknownVersion};
use super::head::check;
use super::peer::Peer;
use super::{HEAD, HEADERS, headers_as_pairs, headers_of, http_failure, target};
use crate::event_loop;
use crate::operation::spawned;
use crate::socket::{bind, bind_failure, lock, next_connection};
use crate::ws::{Accepted, Handshake};

/// Most connections at a time; more wait in the system's queue.
const CONNECTIONS: usize = 1024;
/// Time that a client has for the head of a request, and between two requests.
const HEAD_TIME: Duration = Duration::from_secs(10);
/// Most bytes of bodies, in units of 1024, of requests that are not answered.
const BODIES: usize = 256 << 10;
/// Time in which the last answers have to be sent when a server is closed.
const GOODBYE: Duration = Duration::from_secs(1);

/// The answer to a request in a version of HTTP that the server does not speak.
const UNKNOWN_VERSION: &[u8] = b"HTTP/1.1 505 HTTP Version Not Supported\r\n\
    Content-Type: text/plain; charset=utf-8\r\nContent-Length: 28\r\nConnection: close\r\n\r\n\
    this server speaks HTTP 1.1\n";

type HttpAnswer = Response<Full<Bytes>>;

/// The answer of the program: one of HTTP, and the connection that begins with it, if there is one.
struct ProgramAnswer {
    answer: HttpAnswer,
    accepted: Option<Accepted>,
}

/// A request that the program has yet to answer.
struct AskedRequest {
    answer: oneshot::Sender<ProgramAnswer>,
    /// If it begins a connection of WebSocket.
    handshake: Option<Handshake>,
}

/// A connection that switches from HTTP to WebSocket.
type Switching = Arc<Mutex<Option<(OnUpgrade, Accepted)>>>;

/// The state that the connections of a server share with the operations.
struct ServerState {
    input: HostInput,
    /// The requests that have no answer yet, by their numbers; the greatest number so far.
    asked: Mutex<(i64, HashMap<i64, AskedRequest>)>,
    connections: Arc<Semaphore>,
    addresses: Arc<AddressCounts>,
    bodies: Arc<Semaphore>,
}

/// A server that listens.
struct Server {
    shared: Arc<ServerState>,
    /// Becomes true, or is dropped when the program has lost it, when the server is to end.
    closing: watch::Sender<bool>,
}

/// A server of the program's; nothing before it listens, and after it is closed.
#[derive(Default)]
pub(crate) struct ServerSlot(Mutex<Option<Server>>);

impl HostObject for ServerSlot {
    const KIND: &'static str = "HTTP-SERVER";
}

impl ServerSlot {
    fn get(&self) -> Result<Arc<ServerState>, HostFailure> {
        let server = lock(&self.0);
        server
            .as_ref()
            .map(|server| server.shared.clone())
            .ok_or_else(|| http_failure("the server is closed"))
    }

    /// Answers a request that begins a connection of WebSocket by the answer that `accept` makes.
    pub(crate) fn switch(
        &self,
        request: i64,
        accept: impl FnOnce(&Handshake) -> Result<(HttpAnswer, Accepted), HostFailure>,
    ) -> Result<(), HostFailure> {
        let gone = || HostFailure::new("CONNECTION-LOST", "the client has gone");
        let asked = lock(&self.get()?.asked).1.remove(&request).ok_or_else(gone)?;
        let handshake = asked.handshake.ok_or_else(|| http_failure("the request is not a handshake"))?;
        let (answer, accepted) = accept(&handshake)?;
        let accepted = Some(accepted);
        asked.answer.send(ProgramAnswer { answer, accepted }).map_err(|_| gone())
    }
}

/// Adds the functions of servers.
pub(super) fn add(rows: &mut HostRows) {
    rows.constructor::<ServerSlot>("%HTTP-NEW-SERVER", "Returns a server that does not listen.").lasts();
    rows.operation(
        spawned,
        "%HTTP-LISTEN",
        ["server", "input", "address", "most", "certificate", "key", "clients"],
        "Makes SERVER listen at ADDRESS, for at MOST so many connections from one address; by TLS, if there are files of \
         CERTIFICATE and KEY, and only for clients that a certificate of the file CLIENTS proves, if there is one. \
         Returns the port. The input with the name INPUT is signalled with each request: its \
         number, method, path, the parts of that, query, headers, body, a text if it is UTF-8, and bytes otherwise, \
         and whether it begins a connection of WebSocket; and with the number alone when the client of one has gone.",
        |sender: Sender,
         server: HostHandle<ServerSlot>,
         input: HostInput,
         address: String,
         most: usize,
         certificate: Option<String>,
         key: Option<String>,
         clients: Option<String>| async move {
            let secured = Secured::read(certificate, key, clients).await?;
            listen(sender, server, input, address, most, secured).await
        },
    )
    .needs(Right::Net, "address")
    .needs(Right::Read, "certificate")
    .needs(Right::Read, "key")
    .needs(Right::Read, "clients")
    .lasts();
    rows.at_once(
        "%HTTP-ANSWER",
        ["server", "request", "status", "headers", "body"],
        "Answers the request with the number REQUEST. BODY is a text or bytes. Returns whether the client is there.",
        answer,
    );
    rows.at_once(
        "%HTTP-DROP",
        ["server", "request"],
        "Gives up the request with the number REQUEST, unless it is answered.",
        |server: HostHandle<ServerSlot>, request: i64| {
            // The server may be closed.
            if let Ok(shared) = server.get() {
                let asked = lock(&shared.asked).1.remove(&request);
                drop(asked);
            }
            Ok(())
        },
    )
    .releases();
    rows.operation(
        spawned,
        "%HTTP-CLOSE-SERVER",
        ["server"],
        "Ends SERVER. Requests that are not answered get the status 503.",
        |server: HostHandle<ServerSlot>| async move {
            let listening = lock(&server.0).take();
            if let Some(Server { shared, closing }) = listening {
                // Answers given before are sent.
                lock(&shared.asked).1.clear();
                _ = closing.send(true);
                _ = tokio::time::timeout(2 * GOODBYE, closing.closed()).await;
            }
            Ok(())
        },
    )
    .closes();
}

/// Has a server listen. Returns the port.
async fn listen(
    sender: Sender,
    server: HostHandle<ServerSlot>,
    input: HostInput,
    address: String,
    most: usize,
    secured: Secured,
) -> Result<u16, HostFailure> {
    let listener = bind(&address).await.map_err(|error| bind_failure(&error))?;
    let port = listener.local_addr().map_or(0, |address| address.port());
    let shared = Arc::new(ServerState {
        input,
        asked: Mutex::default(),
        connections: Arc::new(Semaphore::new(CONNECTIONS)),
        addresses: AddressCounts::new(most),
        bodies: Arc::new(Semaphore::new(BODIES)),
    });
    let (closing, closes) = watch::channel(false);
    *lock(&server.0) = Some(Server { shared: shared.clone(), closing });
    // This runs on the event loop, so there is one.
    _ = event_loop::spawn(async move {
        accept(listener, secured, shared, closes).await;
        drop(sender);
    });
    Ok(port)
}

/// The identity by which connections are secured, if they are.
#[derive(Clone)]
struct Secured(#[cfg(feature = "tls")] Option<tokio_rustls::TlsAcceptor>);

impl Secured {
    #[cfg(feature = "tls")]
    async fn read(
        certificate: Option<String>,
        key: Option<String>,
        clients: Option<String>,
    ) -> Result<Secured, HostFailure> {
        match (certificate, key) {
            (Some(certificate), Some(key)) => {
                Ok(Secured(Some(crate::tls::acceptor(certificate, key, clients).await?)))
            }
            _ => Ok(Secured(None)),
        }
    }

    #[cfg(not(feature = "tls"))]
    async fn read(
        certificate: Option<String>,
        _key: Option<String>,
        _clients: Option<String>,
    ) -> Result<Secured, HostFailure> {
        match certificate {
            None => Ok(Secured()),
            Some(_) => Err(HostFailure::new("TLS-ERROR", "this program was built without TLS")),
        }
    }

    /// Answers the requests of a connection, until it or the server ends.
    async fn converse(self, peer: Peer, shared: Arc<ServerState>, closes: watch::Receiver<bool>) {
        #[cfg(feature = "tls")]
        if let Some(acceptor) = self.0 {
            // A peer that does not speak TLS is dropped.
            let greeted = tokio::time::timeout(HEAD_TIME, acceptor.accept(peer.clone()));
            if let Some(Ok(Ok(stream))) = unless_closing(closes.clone(), greeted).await {
                converse(stream, peer, shared, closes).await;
            }
            return;
        }
        converse(peer.clone(), peer, shared, closes).await;
    }
}

/// Returns what a future comes to; `None` if the server is closed before.
async fn unless_closing<T>(mut closes: watch::Receiver<bool>, future: impl Future<Output = T>) -> Option<T> {
    tokio::select! {
        biased;
        _ = closes.wait_for(|&is_closed| is_closed) => None,
        result = future => Some(result),
    }
}

/// Accepts connections until the server is closed.
async fn accept(
    listener: TcpListener,
    secured: Secured,
    shared: Arc<ServerState>,
    closes: watch::Receiver<bool>,
) {
    loop {
        let connection = async {
            let permit = shared.connections.clone().acquire_owned().await.ok()?;
            let (stream, address) = next_connection(|| listener.accept()).await.ok()?;
            Some((permit, stream, address))
        };
        let Some(Some((permit, stream, address))) = unless_closing(closes.clone(), connection).await else {
            return;
        };
        // One too many is closed without an answer, which would take a place.
        let Some(counted) = shared.addresses.enter(address.ip()) else { continue };
        let peer = Peer::new(stream);
        let (secured, shared, closes) = (secured.clone(), shared.clone(), closes.clone());
        tokio::spawn(async move {
            secured.converse(peer, shared, closes).await;
            drop((counted, permit));
        });
    }
}

async fn converse(
    stream: impl AsyncRead + AsyncWrite + Unpin + Send + 'static,
    peer: Peer,
    shared: Arc<ServerState>,
    closes: watch::Receiver<bool>,
) {
    let greeted = tokio::time::timeout(HEAD_TIME, Greeted::read(stream));
    let stream = match unless_closing(closes.clone(), greeted).await {
        Some(Ok(Ok(Ok(stream)))) => stream,
        Some(Ok(Ok(Err(UnknownVersion(mut stream))))) => {
            // The client may have gone.
            _ = stream.write_all(UNKNOWN_VERSION).await;
            _ = stream.flush().await;
            drop((closes, stream));
            return peer.end().await;
        }
        _ => return,
    };
    let switching = Switching::default();
    let service = service_fn(|request| respond(request, peer.clone(), shared.clone(), switching.clone()));
    let mut builder = http1::Builder::new();
    builder.timer(TokioTimer::new()).header_read_timeout(HEAD_TIME).half_close(true);
    builder.max_buf_size(2 * HEAD).max_header_size(HEAD).max_headers(HEADERS).title_case_headers(true);
    let mut connection = pin!(builder.serve_connection(TokioIo::new(stream), service).with_upgrades());
    if unless_closing(closes.clone(), connection.as_mut()).await.is_none() {
        connection.as_mut().graceful_shutdown();
        _ = tokio::time::timeout(GOODBYE, connection).await;
        return;
    }
    let switched = lock(&switching).take();
    if let Some((upgrade, accepted)) = switched {
        // The server's end waits for it, for a while: the program closes the connection then.
        accepted.run(upgrade).await;
        drop(closes);
    } else {
        // All answers are sent, so the end of the server does not wait for this connection.
        drop(closes);
    }
    peer.end().await;
}

/// Returns the answer to a request, which the program gives unless the request is malformed.
async fn respond(
    mut request: Request<Incoming>,
    peer: Peer,
    shared: Arc<ServerState>,
    switching: Switching,
) -> Result<HttpAnswer, Error> {
    let upgrade = hyper::upgrade::on(&mut request);
    let (head, body) = request.into_parts();
    let handshake = match check(&head).and_then(|()| Handshake::read(&head)) {
        Ok(handshake) => handshake,
        Err((status, reason)) => return Ok(refusal(status, reason)),
    };
    let (body, room) = match receive(body, &shared.bodies).await {
        Ok(received) => received,
        Err((status, reason)) => return Ok(refusal(status, &reason)),
    };
    let is_handshake = handshake.is_some();
    let (mut asked, answered) = PendingRequest::new(shared.clone(), handshake);
    let mut arguments = as_data(asked.id, &head, &body);
    arguments.push(is_handshake.into_datum());
    drop(body);
    let answer = async {
        // While there is no room in the input, the client waits.
        if shared.input.signal(arguments).await.is_ok() {
            asked.is_signalled = true;
        }
        answered.await
    };
    let answer = tokio::select! {
        answer = answer => answer,
        () = peer.gone() => return Err(Error::other("the client has gone")),
    };
    drop((asked, room));
    let Ok(ProgramAnswer { answer, accepted }) = answer else {
        return Ok(refusal(StatusCode::SERVICE_UNAVAILABLE, "this request was given up"));
    };
    if let Some(accepted) = accepted {
        *lock(&switching) = Some((upgrade, accepted));
    }
    Ok(answer)
}

/// A request that the program has been asked to answer.
struct PendingRequest {
    shared: Arc<ServerState>,
    id: i64,
    /// Whether the input was signalled with it.
    is_signalled: bool,
}

impl PendingRequest {
    fn new(
        shared: Arc<ServerState>,
        handshake: Option<Handshake>,
    ) -> (PendingRequest, oneshot::Receiver<ProgramAnswer>) {
        let (answer, answered) = oneshot::channel();
        let id = {
            let mut asked = lock(&shared.asked);
            asked.0 += 1;
            let id = asked.0;
            asked.1.insert(id, AskedRequest { answer, handshake });
            id
        };
        (PendingRequest { shared, id, is_signalled: false }, answered)
    }
}

impl Drop for PendingRequest {
    fn drop(&mut self) {
        if lock(&self.shared.asked).1.remove(&self.id).is_some() && self.is_signalled {
            // It was not answered, and the program works on it, or will.
            let (input, id) = (self.shared.input.clone(), self.id);
            // The program may have closed the input.
            _ = event_loop::spawn(async move { drop(input.signal(vec![id.into_datum()]).await) });
        }
    }
}

/// Returns an answer that ends the connection.
fn refusal(status: StatusCode, reason: &str) -> HttpAnswer {
    let mut response = Response::new(Full::new(Bytes::copy_from_slice(reason.as_bytes())));
    *response.status_mut() = status;
    let headers = response.headers_mut();
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static("text/plain; charset=utf-8"));
    headers.insert(header::CONNECTION, HeaderValue::from_static("close"));
    if status == StatusCode::UPGRADE_REQUIRED {
        headers.insert(header::UPGRADE, HeaderValue::from_static("websocket"));
        headers.insert(header::SEC_WEBSOCKET_VERSION, HeaderValue::from_static("13"));
    }
    response
}

/// Returns a request as data: its number, method, path, the parts of that, query, headers, and body.
fn as_data(id: i64, head: &Parts, body: &[u8]) -> Vec<Datum> {
    vec![
        id.into_datum(),
        head.method.as_str().into_datum(),
        head.uri.path().into_datum(),
        target::parts(head.uri.path()).into_datum(),
        target::query(head.uri.query().unwrap_or_default()).into_datum(),
        headers_as_pairs(&head.headers).into_datum(),
        match str::from_utf8(body) {
            Ok(text) => text.into_datum(),
            Err(_) => Bytes::copy_from_slice(body).into_datum(),
        },
    ]
}

/// Answers a request. Returns whether the client is there.
fn answer(
    server: HostHandle<ServerSlot>,
    request: i64,
    status: i64,
    headers: Vec<(String, String)>,
    Payload(body): Payload,
) -> Result<bool, HostFailure> {
    let status = u16::try_from(status).ok().and_then(|status| StatusCode::from_u16(status).ok());
    let status = status.filter(|status| !status.is_informational());
    let status = status.ok_or_else(|| http_failure("the status of an answer is a number from 200 to 999"))?;
    let mut headers = headers_of(headers)?;
    // hyper writes them, from the body.
    headers.remove(header::CONTENT_LENGTH);
    headers.remove(header::TRANSFER_ENCODING);
    let is_empty =
        matches!(status, StatusCode::NO_CONTENT | StatusCode::RESET_CONTENT | StatusCode::NOT_MODIFIED);
    let mut response = Response::new(Full::new(if is_empty { Bytes::new() } else { body }));
    *response.status_mut() = status;
    *response.headers_mut() = headers;
    let shared = server.get()?;
    let asked = lock(&shared.asked).1.remove(&request);
    let answer = ProgramAnswer { answer: response, accepted: None };
    Ok(asked.is_some_and(|asked| asked.answer.send(answer).is_ok()))
}
