//! Requests of the program's, each over a connection of its own.
//!
//! A request is begun by `%HTTP-SEND`, which connects. The parts of a body that is a stream follow, then the
//! head of the answer is waited for, and then its body is read, piece by piece, no faster than the program
//! takes it.

use std::future::Future;
use std::io::{Error, ErrorKind};
use std::pin::Pin;
use std::sync::Arc;

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use bytes::Bytes;
use esl_bytecode::datum::{Datum, DatumKind};
use esl_host::{
    ActionId, CallAction, FromArgument, HostFailure, HostHandle, HostObject, HostRows, Payload, Right,
};
use http_body_util::channel::{Channel, Sender};
use http_body_util::{BodyExt, Either, Full};
use hyper::body::{Frame, Incoming};
use hyper::client::conn::http1::{self, SendRequest};
use hyper::header::{self, HeaderMap, HeaderValue};
use hyper::{Method, Request, Response, StatusCode};
use hyper_util::rt::TokioIo;
use tokio::net::TcpStream;
use tokio::task::JoinHandle;
use url::Url;

use super::coding::{ACCEPTED, Coding, PIECE};
use super::{HEAD, HEADERS, headers_as_pairs, headers_of, http_failure, target};
use crate::arrived::Arrived;
use crate::operation::{ready_soon, spawned};
use crate::slot::OpenSlot;
use crate::socket::socket_failure;
use crate::tls_files::ClientFiles;

/// Most bytes that are handed to the program at a time.
const MOST_AT_ONCE: usize = 1 << 16;

/// The body of a request: all of it, or what the program sends later.
pub(crate) type RequestBody = Either<Full<Bytes>, Channel<Bytes>>;

type AwaitedAnswer = Pin<Box<dyn Future<Output = hyper::Result<Response<Incoming>>> + Send>>;

/// Reading and writing a connection, which ends with this.
pub(crate) struct ConnectionDriver(JoinHandle<hyper::Result<()>>);

impl Drop for ConnectionDriver {
    fn drop(&mut self) {
        self.0.abort();
    }
}

/// A request that was begun.
struct HttpExchange {
    _driver: ConnectionDriver,
    /// Takes the parts of its body, if that is a stream.
    parts: tokio::sync::Mutex<Option<Sender<Bytes>>>,
    answer: tokio::sync::Mutex<AnswerProgress>,
    /// Whether the program has asked for codings of its own choice, and so takes bodies as they come.
    takes_any_coding: bool,
}

/// Progress of an answer.
enum AnswerProgress {
    /// Its head has yet to come. The sender keeps the connection open.
    Awaited(AwaitedAnswer, SendRequest<RequestBody>),
    Body(Box<AnswerBody>),
    /// It has failed.
    Over,
}

/// The body of an answer.
struct AnswerBody {
    incoming: Incoming,
    coding: Coding,
    /// Bytes that were received and not decoded.
    coded: Bytes,
    arrived: Arrived,
    _sender: SendRequest<RequestBody>,
}

/// A request of the program's.
#[derive(Default)]
struct RequestSlot(OpenSlot<HttpExchange>);

impl HostObject for RequestSlot {
    const KIND: &'static str = "HTTP-REQUEST";
}

impl RequestSlot {
    fn get(&self) -> Result<Arc<HttpExchange>, HostFailure> {
        self.0.get().ok_or_else(is_over)
    }
}

fn is_over() -> HostFailure {
    http_failure("the request is over")
}

/// Body of a request, as the program gives it: a text or bytes, `NIL` for none, or `T` if it comes in parts.
enum GivenBody {
    Whole(Bytes),
    InParts,
}

impl FromArgument for GivenBody {
    const TYPE: &'static str = "VECTOR";

    fn from_argument(datum: &Datum) -> Result<GivenBody, HostFailure> {
        match datum.kind() {
            DatumKind::Nil => Ok(GivenBody::Whole(Bytes::new())),
            DatumKind::Symbol(symbol) if symbol.is_cl("T") => Ok(GivenBody::InParts),
            _ => Payload::from_argument(datum).map(|Payload(bytes)| GivenBody::Whole(bytes)),
        }
    }
}

/// Adds the functions of clients.
pub(super) fn add(rows: &mut HostRows) {
    rows.constructor::<RequestSlot>("%HTTP-NEW-REQUEST", "Returns a request that is not begun.");
    rows.at_once("%HTTP-CLOSE-REQUEST", ["request"], "Ends REQUEST.", |request: HostHandle<RequestSlot>| {
        drop(request.0.close());
        Ok(())
    })
    .closes();
    rows.operation(
        spawned,
        "%HTTP-SEND",
        ["request", "address", "method", "url", "headers", "body", "ca-file", "certificate", "key"],
        "Connects to ADDRESS and begins REQUEST. BODY is a text or bytes, NIL, or T if it comes in parts.",
        |CallAction(action): CallAction,
         slot: HostHandle<RequestSlot>,
         address: String,
         method: String,
         url: String,
         headers: Vec<(String, String)>,
         body: GivenBody,
         files: ClientFiles| async move {
            let url = target::parse(&url, None)?;
            let (body, parts) = body_of(body);
            let mut given = headers_of(headers)?;
            name_action(&mut given, &method, action);
            let takes_any_coding = given.contains_key(header::ACCEPT_ENCODING);
            let request = request(&method, &url, given, body)?;
            let (answer, driver) = send(&address, &url, files, request).await?;
            let (parts, answer) = (tokio::sync::Mutex::new(parts), tokio::sync::Mutex::new(answer));
            let exchange = HttpExchange { _driver: driver, parts, answer, takes_any_coding };
            if slot.0.open(exchange) { Ok(()) } else { Err(is_over()) }
        },
    )
    .needs(Right::Net, "address")
    .needs(Right::Read, "ca-file")
    .needs(Right::Read, "certificate")
    .needs(Right::Read, "key");
    rows.operation(
        ready_soon,
        "%HTTP-SEND-PART",
        ["request", "part"],
        "Sends a part of the body, a text or bytes; NIL for the end. Returns NIL if the server takes no more.",
        |request: HostHandle<RequestSlot>, part: Option<Payload>| async move {
            send_part(request.get()?, part).await
        },
    );
    rows.operation(
        ready_soon,
        "%HTTP-AWAIT-ANSWER",
        ["request"],
        "Waits for the head of the answer. Returns its status and its headers.",
        |request: HostHandle<RequestSlot>| async move { answer(request.get()?).await },
    );
    rows.operation(
        ready_soon,
        "%HTTP-READ",
        ["request", "as-bytes"],
        "Waits for a piece of the body of the answer, a text or bytes; NIL at its end.",
        |request: HostHandle<RequestSlot>, as_bytes: bool| async move { read(request.get()?, as_bytes).await },
    );
}

/// Has a request that may not be made twice carry the identity of its call, by which a server tells a second
/// one from the first.
fn name_action(headers: &mut HeaderMap, method: &str, action: Option<ActionId>) {
    let name = header::HeaderName::from_static("idempotency-key");
    if matches!(method, "POST" | "PATCH")
        && !headers.contains_key(&name)
        && let Some(action) = action
        && let Ok(value) = HeaderValue::from_str(&format!("\"{action}\""))
    {
        headers.insert(name, value);
    }
}

/// Sends a request over a connection of its own.
async fn send(
    address: &str,
    url: &Url,
    files: ClientFiles,
    request: Request<RequestBody>,
) -> Result<(AnswerProgress, ConnectionDriver), HostFailure> {
    let (mut sender, driver) = connect(address, url, files).await?;
    let waiting = sender.send_request(request);
    Ok((AnswerProgress::Awaited(Box::pin(waiting), sender), driver))
}

/// Connects to the server of a URL and begins HTTP.
pub(crate) async fn connect(
    address: &str,
    url: &Url,
    files: ClientFiles,
) -> Result<(SendRequest<RequestBody>, ConnectionDriver), HostFailure> {
    let stream = connect_to(address).await?;
    // Requests are small, and are not to wait for more; without it they only take longer.
    drop(stream.set_nodelay(true));
    match url.scheme() {
        "https" => begin_secured(stream, url, files).await,
        _ => begin(stream).await,
    }
}

/// Returns the body of a request, and the channel for its parts if it is a stream.
fn body_of(given: GivenBody) -> (RequestBody, Option<Sender<Bytes>>) {
    match given {
        GivenBody::Whole(bytes) => (Either::Left(Full::new(bytes)), None),
        GivenBody::InParts => {
            let (sender, channel) = Channel::new(1);
            (Either::Right(channel), Some(sender))
        }
    }
}

/// Returns a request. Its headers about the connection and the body are set here, unless the program sets
/// them.
pub(crate) fn request(
    method: &str,
    url: &Url,
    mut headers: HeaderMap,
    body: RequestBody,
) -> Result<Request<RequestBody>, HostFailure> {
    let method = Method::from_bytes(method.as_bytes())
        .map_err(|_| http_failure(format!("`{}` is not a method", method.escape_debug())))?;
    check_length(&headers, &body)?;
    headers.remove(header::CONTENT_LENGTH);
    let host = match url.port() {
        Some(port) => format!("{}:{port}", url.host_str().unwrap_or_default()),
        None => url.host_str().unwrap_or_default().to_owned(),
    };
    let mut all = HeaderMap::new();
    let mut unless_given = |name: header::HeaderName, value: &str| {
        if let (false, Ok(value)) = (headers.contains_key(&name), HeaderValue::from_str(value)) {
            all.insert(name, value);
        }
    };
    unless_given(header::HOST, &host);
    unless_given(header::ACCEPT_ENCODING, ACCEPTED);
    unless_given(header::CONNECTION, "close");
    if let Some(credentials) = target::credentials(url) {
        unless_given(header::AUTHORIZATION, &format!("Basic {}", BASE64_STANDARD.encode(credentials)));
    }
    let expects_body = matches!(method, Method::POST | Method::PUT | Method::PATCH);
    if expects_body && hyper::body::Body::size_hint(&body).exact() == Some(0) {
        all.insert(header::CONTENT_LENGTH, HeaderValue::from_static("0"));
    }
    all.extend(headers);
    let target = &url[url::Position::BeforePath..url::Position::AfterQuery];
    let mut request = Request::builder().method(method).uri(target).body(body).map_err(http_failure)?;
    *request.headers_mut() = all;
    Ok(request)
}

/// Checks that the program does not say another length of the body than it has, by which one request could
/// hide another.
fn check_length(headers: &HeaderMap, body: &RequestBody) -> Result<(), HostFailure> {
    let length = hyper::body::Body::size_hint(body).exact();
    let says_length = |value: &HeaderValue| {
        value
            .to_str()
            .ok()
            .and_then(|value| value.trim().parse().ok())
            .is_some_and(|said| Some(said) == length)
    };
    if headers.contains_key(header::TRANSFER_ENCODING)
        || !headers.get_all(header::CONTENT_LENGTH).iter().all(says_length)
    {
        return Err(http_failure(
            "the headers contradict the body; leave out Content-Length and Transfer-Encoding",
        ));
    }
    Ok(())
}

/// Connects to an address, by the first of its meanings that answers.
async fn connect_to(address: &str) -> Result<TcpStream, HostFailure> {
    let addresses =
        tokio::net::lookup_host(address).await.map_err(|error| HostFailure::new("HOST-NOT-FOUND", error))?;
    let mut last = HostFailure::new("HOST-NOT-FOUND", format!("`{address}` has no address"));
    for address in addresses {
        match TcpStream::connect(address).await {
            Ok(stream) => return Ok(stream),
            Err(error) => last = socket_failure(&error),
        }
    }
    Err(last)
}

/// Begins HTTP over a connection.
async fn begin(
    stream: impl tokio::io::AsyncRead + tokio::io::AsyncWrite + Send + Unpin + 'static,
) -> Result<(SendRequest<RequestBody>, ConnectionDriver), HostFailure> {
    let mut builder = http1::Builder::new();
    builder.max_buf_size(2 * HEAD).max_header_size(HEAD).max_headers(HEADERS).title_case_headers(true);
    builder.allow_obsolete_multiline_headers_in_responses(true);
    let (sender, connection) =
        builder.handshake(TokioIo::new(stream)).await.map_err(|error| fault(&error))?;
    Ok((sender, ConnectionDriver(tokio::spawn(connection.with_upgrades()))))
}

#[cfg(feature = "tls")]
async fn begin_secured(
    stream: TcpStream,
    url: &Url,
    files: ClientFiles,
) -> Result<(SendRequest<RequestBody>, ConnectionDriver), HostFailure> {
    begin(crate::tls::begin_as(stream, url.host_str().unwrap_or_default(), files).await?).await
}

#[cfg(not(feature = "tls"))]
async fn begin_secured(
    _stream: TcpStream,
    _url: &Url,
    _files: ClientFiles,
) -> Result<(SendRequest<RequestBody>, ConnectionDriver), HostFailure> {
    Err(HostFailure::new("TLS-ERROR", "this program was built without TLS"))
}

/// Sends a part of a body, or its end. Returns false if the server takes no more.
async fn send_part(exchange: Arc<HttpExchange>, part: Option<Payload>) -> Result<bool, HostFailure> {
    let mut parts = exchange.parts.lock().await;
    Ok(match (part, parts.as_mut()) {
        (Some(Payload(bytes)), Some(sender)) => sender.send(Frame::data(bytes)).await.is_ok(),
        (Some(_), None) => false,
        (None, _) => parts.take().is_some(),
    })
}

/// Waits for the head of an answer. Returns the status and the headers.
async fn answer(exchange: Arc<HttpExchange>) -> Result<(u16, Vec<(String, String)>), HostFailure> {
    let mut answer = exchange.answer.lock().await;
    let AnswerProgress::Awaited(waiting, _) = &mut *answer else {
        return Err(http_failure("the answer was taken"));
    };
    let response = waiting.await.map_err(|error| fault(&error))?;
    let AnswerProgress::Awaited(_, sender) = std::mem::replace(&mut *answer, AnswerProgress::Over) else {
        return Err(http_failure("the answer was taken"));
    };
    let (mut head, incoming) = response.into_parts();
    if head.status == StatusCode::SWITCHING_PROTOCOLS {
        return Err(http_failure("the server switches to another protocol"));
    }
    let mut coding = Coding::Identity;
    if !exchange.takes_any_coding
        && !hyper::body::Body::is_end_stream(&incoming)
        && let Some(name) = head.headers.get(header::CONTENT_ENCODING)
    {
        let name = String::from_utf8_lossy(name.as_bytes()).into_owned();
        let count = head.headers.get_all(header::CONTENT_ENCODING).iter().count();
        coding = Coding::named(&name).filter(|_| count == 1).ok_or_else(|| {
            http_failure(format!(
                "the body has the content coding `{}`, which is unknown",
                name.escape_debug()
            ))
        })?;
    }
    if !coding.is_identity() {
        // They describe the body before it was decoded.
        head.headers.remove(header::CONTENT_ENCODING);
        head.headers.remove(header::CONTENT_LENGTH);
    }
    let values = (head.status.as_u16(), headers_as_pairs(&head.headers));
    let (coded, arrived) = (Bytes::new(), Arrived::default());
    *answer =
        AnswerProgress::Body(Box::new(AnswerBody { incoming, coding, coded, arrived, _sender: sender }));
    Ok(values)
}

/// Waits for the next piece of a body; `NIL` at its end.
async fn read(exchange: Arc<HttpExchange>, as_bytes: bool) -> Result<Datum, HostFailure> {
    let mut answer = exchange.answer.lock().await;
    let AnswerProgress::Body(body) = &mut *answer else {
        return Err(http_failure("the answer has not arrived yet"));
    };
    loop {
        let piece =
            if as_bytes { body.arrived.take_bytes(MOST_AT_ONCE) } else { body.arrived.take_text(false) };
        if !is_nothing(&piece) {
            return Ok(piece);
        }
        body.receive().await?;
    }
}

/// Returns whether a piece has no characters or bytes.
fn is_nothing(piece: &Datum) -> bool {
    match piece.kind() {
        DatumKind::String(text) => text.is_empty(),
        DatumKind::Packed(bytes) => bytes.is_empty(),
        _ => false,
    }
}

impl AnswerBody {
    /// Receives or decodes the next bytes.
    async fn receive(&mut self) -> Result<(), HostFailure> {
        let undecodable = |error| http_failure(format!("the body cannot be decoded: {error}"));
        if self.coded.is_empty() {
            match self.incoming.frame().await {
                // Trailers are not for the program.
                Some(frame) => {
                    self.coded = frame.map_err(|error| fault(&error))?.into_data().unwrap_or_default()
                }
                None => {
                    let last = self.coding.finish().map_err(undecodable)?;
                    if !last.is_empty() {
                        self.arrived.add(&last);
                    }
                    self.arrived.add(&[]);
                    return Ok(());
                }
            }
        }
        let size = if self.coding.is_identity() { MOST_AT_ONCE } else { PIECE };
        let piece = self.coded.split_to(self.coded.len().min(size));
        let decoded = self.coding.decode(&piece).map_err(undecodable)?;
        if !decoded.is_empty() {
            self.arrived.add(&decoded);
        }
        Ok(())
    }
}

/// Returns the failure for a fault of a server, or of the connection to it.
pub(crate) fn fault(error: &hyper::Error) -> HostFailure {
    let mut reason: &dyn std::error::Error = error;
    while let Some(source) = reason.source() {
        reason = source;
        if let Some(error) = reason.downcast_ref::<Error>() {
            let is_of_system = error.raw_os_error().is_some()
                || matches!(error.kind(), ErrorKind::ConnectionReset | ErrorKind::BrokenPipe);
            if is_of_system {
                return socket_failure(error);
            }
        }
    }
    if error.is_parse_too_large() {
        http_failure(format!("the head of the answer has more than {HEAD} bytes or {HEADERS} headers"))
    } else if error.is_parse() {
        http_failure(format!("the answer is not HTTP: {reason}"))
    } else if error.is_incomplete_message() || error.is_closed() || error.is_canceled() {
        http_failure("the connection has ended before the answer")
    } else if !error.is_body_write_aborted() && std::error::Error::source(error).is_none() {
        // Such as an answer that comes before its request.
        http_failure(format!("the answer is invalid: {error}"))
    } else {
        let is_cut =
            reason.downcast_ref::<Error>().is_some_and(|error| error.kind() == ErrorKind::UnexpectedEof);
        let within = if is_cut { "the connection has ended within the body" } else { "the body is invalid" };
        http_failure(format!("{within}: {reason}"))
    }
}
