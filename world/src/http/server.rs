//! Servers: requests of others, which the program is handed one by one, and answers.
//!
//! A server has a task on the event loop for each connection, which reads requests, whole, and waits for the
//! program's answers. The program takes what happens in its order: a request, or that the client of one has
//! gone.

use std::collections::{HashMap, VecDeque};
use std::future::Future;
use std::io::Error;
use std::pin::pin;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use bytes::Bytes;
use esl_bytecode::datum::Datum;
use esl_host::{HostFailure, Right};
use esl_vm::embed::{HostFunction, Need};
use esl_vm::vm::Vm;
use http_body_util::{BodyExt, Full};
use hyper::body::{Body, Incoming};
use hyper::header::{self, HeaderValue};
use hyper::http::request::Parts;
use hyper::http::uri::Authority;
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper::{Method, Request, Response, StatusCode, Version};
use hyper_util::rt::{TokioIo, TokioTimer};
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpListener;
use tokio::sync::{Notify, OwnedSemaphorePermit, Semaphore, oneshot, watch};

use super::peer::Peer;
use super::{HEAD, HEADERS, headers_as_data, headers_of, http_failure, list, pairs, target};
use crate::data::{CallArguments, Numbered, boolean, integer, nil, text, text_of_bytes};
use crate::event_loop;
use crate::operation::{Completion, define, define_ready};
use crate::socket::{bind, bind_failure, lock, next_connection};

/// Most connections at a time; more wait in the system's queue.
const CONNECTIONS: usize = 1024;
/// Time that a client has for the head of a request, and between two requests.
const HEAD_TIME: Duration = Duration::from_secs(10);
/// Time in which more of a body has to come.
const BODY_TIME: Duration = Duration::from_secs(30);
/// Most bytes of the body of a request.
const BODY: u64 = 64 << 20;
/// Most bytes of bodies, in units of 1024, that the program has not taken.
const BODIES: usize = 256 << 10;
/// Time in which the last answers have to be sent when a server is closed.
const GOODBYE: Duration = Duration::from_secs(1);

/// What has happened at a server, which the program takes.
enum ServerEvent {
    Request {
        id: i64,
        head: Box<Parts>,
        body: Vec<u8>,
        _room: Vec<OwnedSemaphorePermit>,
    },
    /// The client of a request that the program has taken is gone.
    Gone(i64),
}

type HttpAnswer = Response<Full<Bytes>>;

/// What the connections of a server share with the operations.
struct ServerState {
    events: Mutex<VecDeque<ServerEvent>>,
    /// Notified when something has happened.
    came: Notify,
    /// Where the answers go, by the numbers of their requests; the greatest number so far.
    asked: Mutex<(i64, HashMap<i64, oneshot::Sender<HttpAnswer>>)>,
    connections: Arc<Semaphore>,
    bodies: Arc<Semaphore>,
}

/// A server of the program's.
struct Server {
    shared: Arc<ServerState>,
    /// Becomes true, or is dropped with the machine, when the server is to end.
    closing: watch::Sender<bool>,
}

/// The servers of a machine, by number.
#[derive(Clone, Default)]
struct Servers(Arc<Mutex<Numbered<Server>>>);

impl Servers {
    fn get(&self, number: i64) -> Result<Arc<ServerState>, HostFailure> {
        let servers = lock(&self.0);
        let server = servers.1.get(&number).and_then(Option::as_ref);
        server.map(|server| server.shared.clone()).ok_or_else(|| http_failure("the server is closed"))
    }
}

/// Gives a machine the operations of servers.
pub(super) fn install(machine: &mut Vm) {
    let servers = Servers(Arc::new(Mutex::new((0, HashMap::new()))));
    let mut at_once = |name: &str, function: fn(CallArguments, &Servers) -> Result<Datum, HostFailure>| {
        let servers = servers.clone();
        let function = move |arguments: &[Datum]| function(CallArguments(arguments.to_vec()), &servers);
        machine.add_host_function(name, HostFunction::AtOnce(Box::new(function)));
    };
    at_once("%HTTP-NEW-SERVER", |_, servers| {
        let mut servers = lock(&servers.0);
        servers.0 += 1;
        let number = servers.0;
        servers.1.insert(number, None);
        Ok(integer(number))
    });
    at_once("%HTTP-TAKE", |arguments, servers| {
        let event = lock(&servers.get(arguments.integer(0)?)?.events).pop_front();
        Ok(event.map_or_else(nil, |event| as_data(&event)))
    });
    at_once("%HTTP-ANSWER", answer);
    at_once("%HTTP-DROP", |arguments, servers| {
        // The server may be closed, and the request answered.
        if let Ok(shared) = servers.get(arguments.integer(0)?) {
            let asked = lock(&shared.asked).1.remove(&arguments.integer(1)?);
            drop(asked);
        }
        Ok(nil())
    });
    let needs = [1, 2, 3]
        .map(|argument| Need { right: if argument == 1 { Right::Net } else { Right::Read }, argument });
    let known = servers.clone();
    define(machine, "%HTTP-LISTEN", &needs, move |arguments| listen(arguments, known.clone()));
    let known = servers.clone();
    define_ready(machine, "%HTTP-AWAIT", &[], move |arguments| {
        let shared = arguments.integer(0).and_then(|number| known.get(number));
        Box::pin(async move {
            let shared = shared?;
            while lock(&shared.events).is_empty() {
                shared.came.notified().await;
            }
            Ok(Vec::new())
        })
    });
    define(machine, "%HTTP-CLOSE-SERVER", &[], move |arguments| {
        let server = arguments.integer(0).map(|number| lock(&servers.0).1.remove(&number).flatten());
        async move {
            if let Some(Server { shared, closing }) = server? {
                // Unanswered requests get the status 503; answers given before are sent.
                lock(&shared.asked).1.clear();
                _ = closing.send(true);
                _ = tokio::time::timeout(2 * GOODBYE, closing.closed()).await;
            }
            Ok(Vec::new())
        }
    });
}

/// `%HTTP-LISTEN`: number, address, files of certificate and key if it is secured. Returns the port.
async fn listen(arguments: CallArguments, servers: Servers) -> Completion {
    let secured = Secured::read(arguments.text_if_any(2)?, arguments.text_if_any(3)?).await?;
    let listener = bind(&arguments.text(1)?).await.map_err(|error| bind_failure(&error))?;
    let port = listener.local_addr().map_or(0, |address| i64::from(address.port()));
    let shared = Arc::new(ServerState {
        events: Mutex::default(),
        came: Notify::new(),
        asked: Mutex::default(),
        connections: Arc::new(Semaphore::new(CONNECTIONS)),
        bodies: Arc::new(Semaphore::new(BODIES)),
    });
    let (closing, closes) = watch::channel(false);
    let mut servers = lock(&servers.0);
    let known =
        servers.1.get_mut(&arguments.integer(0)?).ok_or_else(|| http_failure("the server is closed"))?;
    *known = Some(Server { shared: shared.clone(), closing });
    // This runs on the event loop, so there is one.
    _ = event_loop::spawn(accept(listener, secured, shared, closes));
    Ok(vec![integer(port)])
}

/// What connections are secured with, if they are.
#[derive(Clone)]
struct Secured(#[cfg(feature = "tls")] Option<tokio_rustls::TlsAcceptor>);

impl Secured {
    #[cfg(feature = "tls")]
    async fn read(certificate: Option<String>, key: Option<String>) -> Result<Secured, HostFailure> {
        match (certificate, key) {
            (Some(certificate), Some(key)) => {
                Ok(Secured(Some(crate::tls::acceptor(certificate, key).await?)))
            }
            _ => Ok(Secured(None)),
        }
    }

    #[cfg(not(feature = "tls"))]
    async fn read(certificate: Option<String>, _key: Option<String>) -> Result<Secured, HostFailure> {
        match certificate {
            None => Ok(Secured()),
            Some(_) => Err(crate::data::failure("TLS-ERROR", "this program was built without TLS")),
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
            let (stream, _) = next_connection(|| listener.accept()).await.ok()?;
            Some((permit, Peer::new(stream)))
        };
        let Some(Some((permit, peer))) = unless_closing(closes.clone(), connection).await else { return };
        let (secured, shared, closes) = (secured.clone(), shared.clone(), closes.clone());
        tokio::spawn(async move {
            secured.converse(peer, shared, closes).await;
            drop(permit);
        });
    }
}

async fn converse(
    stream: impl AsyncRead + AsyncWrite + Unpin,
    peer: Peer,
    shared: Arc<ServerState>,
    closes: watch::Receiver<bool>,
) {
    let service = service_fn(|request| respond(request, peer.clone(), shared.clone()));
    let mut builder = http1::Builder::new();
    builder.timer(TokioTimer::new()).header_read_timeout(HEAD_TIME).half_close(true);
    builder.max_buf_size(2 * HEAD).max_header_size(HEAD).max_headers(HEADERS).title_case_headers(true);
    let mut connection = pin!(builder.serve_connection(TokioIo::new(stream), service));
    if unless_closing(closes.clone(), connection.as_mut()).await.is_none() {
        connection.as_mut().graceful_shutdown();
        _ = tokio::time::timeout(GOODBYE, connection).await;
    } else {
        // All answers are sent, so the end of the server does not wait for this connection.
        drop(closes);
        peer.end().await;
    }
}

/// Returns the answer to a request, which the program gives unless the request is malformed.
async fn respond(
    request: Request<Incoming>,
    peer: Peer,
    shared: Arc<ServerState>,
) -> Result<HttpAnswer, Error> {
    let (head, body) = request.into_parts();
    if let Err((status, reason)) = check(&head) {
        return Ok(refusal(status, reason));
    }
    let (body, room) = match receive(body, &shared.bodies).await {
        Ok(received) => received,
        Err((status, reason)) => return Ok(refusal(status, &reason)),
    };
    let (asked, mut answered) = PendingRequest::new(shared, head, body, room);
    let answer = tokio::select! {
        answer = &mut answered => answer,
        () = peer.gone() => return Err(Error::other("the client has gone")),
    };
    drop(asked);
    Ok(answer.unwrap_or_else(|_| refusal(StatusCode::SERVICE_UNAVAILABLE, "this request was given up")))
}

/// A request that the program has been asked to answer.
struct PendingRequest {
    shared: Arc<ServerState>,
    id: i64,
}

impl PendingRequest {
    fn new(
        shared: Arc<ServerState>,
        head: Parts,
        body: Vec<u8>,
        room: Vec<OwnedSemaphorePermit>,
    ) -> (PendingRequest, oneshot::Receiver<HttpAnswer>) {
        let (answer, answered) = oneshot::channel();
        let id = {
            let mut asked = lock(&shared.asked);
            asked.0 += 1;
            let id = asked.0;
            asked.1.insert(id, answer);
            id
        };
        lock(&shared.events).push_back(ServerEvent::Request { id, head: Box::new(head), body, _room: room });
        shared.came.notify_one();
        (PendingRequest { shared, id }, answered)
    }
}

impl Drop for PendingRequest {
    fn drop(&mut self) {
        if lock(&self.shared.asked).1.remove(&self.id).is_none() {
            return;
        }
        // It was not answered. The program either has yet to take it, or works on it.
        let mut events = lock(&self.shared.events);
        let before = events.len();
        events.retain(|event| !matches!(event, ServerEvent::Request { id, .. } if *id == self.id));
        if events.len() == before {
            events.push_back(ServerEvent::Gone(self.id));
            drop(events);
            self.shared.came.notify_one();
        }
    }
}

/// Checks a head for the faults that the parser lets pass.
fn check(head: &Parts) -> Result<(), (StatusCode, &'static str)> {
    if head.method == Method::CONNECT {
        return Err((StatusCode::NOT_IMPLEMENTED, "this server is not a proxy"));
    }
    let path = head.uri.path();
    let is_of_server = path == "*" && head.method == Method::OPTIONS;
    if !path.starts_with('/') && !is_of_server {
        return Err((StatusCode::BAD_REQUEST, "the target of the request is not a path"));
    }
    let mut hosts = head.headers.get_all(header::HOST).iter();
    match (hosts.next(), hosts.next()) {
        (Some(host), None) if is_host(host) => {}
        (None, None) if head.version == Version::HTTP_10 => {}
        _ => {
            return Err((
                StatusCode::BAD_REQUEST,
                "the request needs one header Host, a host with or without a port",
            ));
        }
    }
    let expectation = head.headers.get(header::EXPECT);
    if expectation.is_some_and(|expected| !expected.as_bytes().eq_ignore_ascii_case(b"100-continue")) {
        return Err((StatusCode::EXPECTATION_FAILED, "the expectation is unknown"));
    }
    Ok(())
}

/// Returns whether a header names a host, with or without a port. It is empty for a URL without one.
fn is_host(value: &HeaderValue) -> bool {
    let bytes = value.as_bytes();
    let has_host = |host: Authority| !host.host().is_empty() && !host.as_str().contains('@');
    bytes.is_empty() || Authority::try_from(bytes).is_ok_and(has_host)
}

type Received = (Vec<u8>, Vec<OwnedSemaphorePermit>);

/// Receives the body of a request, and the room that it takes.
async fn receive(mut body: Incoming, room: &Arc<Semaphore>) -> Result<Received, (StatusCode, String)> {
    let too_long = || (StatusCode::PAYLOAD_TOO_LARGE, format!("a body has at most {BODY} bytes"));
    // The header `Content-Length` is the lower bound.
    if body.size_hint().lower() > BODY {
        return Err(too_long());
    }
    let (mut bytes, mut taken) = (Vec::new(), Vec::new());
    loop {
        let frame = match tokio::time::timeout(BODY_TIME, body.frame()).await {
            Ok(None) => return Ok((bytes, taken)),
            Ok(Some(Ok(frame))) => frame,
            Ok(Some(Err(error))) => {
                return Err((StatusCode::BAD_REQUEST, format!("the body is invalid: {}", innermost(&error))));
            }
            Err(_) => return Err((StatusCode::REQUEST_TIMEOUT, "the body does not come".into())),
        };
        // Trailers are not for the program.
        let Ok(data) = frame.into_data() else { continue };
        if (bytes.len() + data.len()) as u64 > BODY {
            return Err(too_long());
        }
        bytes.extend_from_slice(&data);
        let wanted = bytes
            .len()
            .div_ceil(1024)
            .saturating_sub(taken.iter().map(OwnedSemaphorePermit::num_permits).sum());
        if wanted > 0 {
            let permit = room.clone().try_acquire_many_owned(u32::try_from(wanted).unwrap_or(u32::MAX));
            taken.push(permit.map_err(|_| {
                (StatusCode::SERVICE_UNAVAILABLE, "there is no room for the body at this time".to_owned())
            })?);
        }
    }
}

/// Returns the text of the innermost cause of an error.
fn innermost(error: &hyper::Error) -> String {
    let mut reason: &dyn std::error::Error = error;
    while let Some(source) = reason.source() {
        reason = source;
    }
    reason.to_string()
}

/// Returns an answer that ends the connection.
fn refusal(status: StatusCode, reason: &str) -> HttpAnswer {
    let mut response = Response::new(Full::new(Bytes::copy_from_slice(reason.as_bytes())));
    *response.status_mut() = status;
    let headers = response.headers_mut();
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static("text/plain; charset=utf-8"));
    headers.insert(header::CONNECTION, HeaderValue::from_static("close"));
    response
}

/// Returns what has happened as data: a list of the number of a request alone if its client has gone;
/// otherwise also method, path, the parts of that, query, headers, and bytes of the body.
fn as_data(event: &ServerEvent) -> Datum {
    match event {
        ServerEvent::Gone(id) => list([integer(*id)]),
        ServerEvent::Request { id, head, body, .. } => list([
            integer(*id),
            text(head.method.as_str()),
            text(head.uri.path()),
            list(target::parts(head.uri.path())),
            pairs(target::query(head.uri.query().unwrap_or_default())),
            headers_as_data(&head.headers),
            text_of_bytes(body),
        ]),
    }
}

/// `%HTTP-ANSWER`: server, request, status, headers, body, whether it has bytes. Returns whether the client
/// is there.
fn answer(arguments: CallArguments, servers: &Servers) -> Result<Datum, HostFailure> {
    let status =
        u16::try_from(arguments.integer(2)?).ok().and_then(|status| StatusCode::from_u16(status).ok());
    let status = status.filter(|status| !status.is_informational());
    let status = status.ok_or_else(|| http_failure("the status of an answer is a number from 200 to 999"))?;
    let mut headers = headers_of(arguments.pairs(3)?)?;
    // hyper writes them, from the body.
    headers.remove(header::CONTENT_LENGTH);
    headers.remove(header::TRANSFER_ENCODING);
    let is_empty =
        matches!(status, StatusCode::NO_CONTENT | StatusCode::RESET_CONTENT | StatusCode::NOT_MODIFIED);
    let body = if is_empty { Vec::new() } else { arguments.bytes_or_text(4, 5)? };
    let mut response = Response::new(Full::new(body.into()));
    *response.status_mut() = status;
    *response.headers_mut() = headers;
    let shared = servers.get(arguments.integer(0)?)?;
    let asked = lock(&shared.asked).1.remove(&arguments.integer(1)?);
    Ok(boolean(asked.is_some_and(|asked| asked.send(response).is_ok())))
}
