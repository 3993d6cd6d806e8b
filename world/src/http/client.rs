//! Requests of the program's, each over a connection of its own.
//!
//! A request is begun by `%HTTP-SEND`, which connects. The parts of a body that is a stream follow, then the
//! head of the answer is waited for, and then its body is read, piece by piece, no faster than the program
//! takes it.

use std::collections::HashMap;
use std::future::Future;
use std::io::{Error, ErrorKind};
use std::pin::Pin;
use std::sync::{Arc, Mutex};

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use bytes::Bytes;
use esl_bytecode::datum::Datum;
use esl_host::{HostFailure, Right};
use esl_vm::embed::{HostFunction, Need};
use esl_vm::vm::Vm;
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
use super::{HEAD, HEADERS, headers_as_data, headers_of, http_failure, target};
use crate::arrived::Arrived;
use crate::data::{CallArguments, Numbered, boolean, failure, integer, nil};
use crate::operation::{Completion, OperationFuture, define, define_ready};
use crate::socket::{lock, socket_failure};

/// Most bytes that are handed to the program at a time.
const MOST_AT_ONCE: usize = 1 << 16;

/// The body of a request: all of it, or what the program sends later.
type RequestBody = Either<Full<Bytes>, Channel<Bytes>>;

type AwaitedAnswer = Pin<Box<dyn Future<Output = hyper::Result<Response<Incoming>>> + Send>>;

/// Reading and writing a connection, which ends with this.
struct ConnectionDriver(JoinHandle<hyper::Result<()>>);

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

/// The requests of a machine, by number.
#[derive(Clone, Default)]
struct HttpExchanges(Arc<Mutex<Numbered<Arc<HttpExchange>>>>);

impl HttpExchanges {
    fn get(&self, number: i64) -> Result<Arc<HttpExchange>, HostFailure> {
        let exchange = lock(&self.0).1.get(&number).cloned().flatten();
        exchange.ok_or_else(|| http_failure("the request is over"))
    }

    /// Says what a request is, which may have been left meanwhile.
    fn set(&self, number: i64, exchange: HttpExchange) -> Completion {
        let mut exchanges = lock(&self.0);
        let known = exchanges.1.get_mut(&number).ok_or_else(|| http_failure("the request is over"))?;
        *known = Some(Arc::new(exchange));
        Ok(Vec::new())
    }
}

/// Gives a machine the operations of clients.
pub(super) fn install(machine: &mut Vm) {
    let exchanges = HttpExchanges(Arc::new(Mutex::new((0, HashMap::new()))));
    let known = exchanges.clone();
    let add = move |_: &[Datum]| {
        let mut exchanges = lock(&known.0);
        exchanges.0 += 1;
        let number = exchanges.0;
        exchanges.1.insert(number, None);
        Ok(integer(number))
    };
    machine.add_host_function("%HTTP-NEW-REQUEST", HostFunction::AtOnce(Box::new(add)));
    let known = exchanges.clone();
    let close = move |arguments: &[Datum]| {
        let number = CallArguments(arguments.to_vec()).integer(0)?;
        let exchange = lock(&known.0).1.remove(&number);
        drop(exchange);
        Ok(nil())
    };
    machine.add_host_function("%HTTP-CLOSE-REQUEST", HostFunction::AtOnce(Box::new(close)));
    let known = exchanges.clone();
    let needs = [Need { right: Right::Net, argument: 1 }, Need { right: Right::Read, argument: 7 }];
    define(machine, "%HTTP-SEND", &needs, move |arguments| send(arguments, known.clone()));
    let mut operation = |name: &str, function: ExchangeFunction| {
        let known = exchanges.clone();
        define_ready(machine, name, &[], move |arguments| {
            let exchange = arguments.integer(0).and_then(|number| known.get(number));
            Box::pin(async move { function(arguments, exchange?).await })
        });
    };
    operation("%HTTP-SEND-PART", |arguments, exchange| Box::pin(send_part(arguments, exchange)));
    operation("%HTTP-AWAIT-ANSWER", |_, exchange| Box::pin(answer(exchange)));
    operation("%HTTP-READ", |arguments, exchange| Box::pin(read(arguments, exchange)));
}

type ExchangeFunction = fn(CallArguments, Arc<HttpExchange>) -> OperationFuture;

/// `%HTTP-SEND`: number, address, method, URL, headers, body, whether it has bytes, file of certificates. The
/// body is a string, `NIL`, or `T` if it comes in parts.
async fn send(arguments: CallArguments, exchanges: HttpExchanges) -> Completion {
    let (number, address) = (arguments.integer(0)?, arguments.text(1)?);
    let url = target::parse(&arguments.text(3)?, None)?;
    let (body, parts) = body_of(&arguments)?;
    let given = headers_of(arguments.pairs(4)?)?;
    let takes_any_coding = given.contains_key(header::ACCEPT_ENCODING);
    let request = request(&arguments.text(2)?, &url, given, body)?;
    let stream = connect(&address).await?;
    // Requests are small, and are not to wait for more; without it they only take longer.
    drop(stream.set_nodelay(true));
    let (mut sender, driver) = match url.scheme() {
        "https" => begin_secured(stream, &url, arguments.text_if_any(7)?).await?,
        _ => begin(stream).await?,
    };
    let waiting = sender.send_request(request);
    let answer = tokio::sync::Mutex::new(AnswerProgress::Awaited(Box::pin(waiting), sender));
    let exchange =
        HttpExchange { _driver: driver, parts: tokio::sync::Mutex::new(parts), answer, takes_any_coding };
    exchanges.set(number, exchange)
}

/// Returns the body of a request, and the channel for its parts if it is a stream.
fn body_of(arguments: &CallArguments) -> Result<(RequestBody, Option<Sender<Bytes>>), HostFailure> {
    if arguments.is_true(5) && arguments.text(5).is_err() {
        let (sender, channel) = Channel::new(1);
        return Ok((Either::Right(channel), Some(sender)));
    }
    let bytes = if arguments.is_true(5) { arguments.bytes_or_text(5, 6)? } else { Vec::new() };
    Ok((Either::Left(Full::new(bytes.into())), None))
}

/// Returns a request. What it says about its connection and its body is said here, unless the program says
/// it.
fn request(
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
async fn connect(address: &str) -> Result<TcpStream, HostFailure> {
    let addresses =
        tokio::net::lookup_host(address).await.map_err(|error| failure("HOST-NOT-FOUND", error))?;
    let mut last = failure("HOST-NOT-FOUND", format!("`{address}` has no address"));
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
    Ok((sender, ConnectionDriver(tokio::spawn(connection))))
}

#[cfg(feature = "tls")]
async fn begin_secured(
    stream: TcpStream,
    url: &Url,
    ca_file: Option<String>,
) -> Result<(SendRequest<RequestBody>, ConnectionDriver), HostFailure> {
    begin(crate::tls::begin(stream, url.host_str().unwrap_or_default(), ca_file).await?).await
}

#[cfg(not(feature = "tls"))]
async fn begin_secured(
    _stream: TcpStream,
    _url: &Url,
    _ca_file: Option<String>,
) -> Result<(SendRequest<RequestBody>, ConnectionDriver), HostFailure> {
    Err(failure("TLS-ERROR", "this program was built without TLS"))
}

/// `%HTTP-SEND-PART`: number, part, whether it has bytes; `NIL` for the end. Returns `NIL` if the server
/// takes no more.
async fn send_part(arguments: CallArguments, exchange: Arc<HttpExchange>) -> Completion {
    let mut parts = exchange.parts.lock().await;
    let is_taken = if arguments.is_true(1) {
        let bytes = arguments.bytes_or_text(1, 2)?;
        match parts.as_mut() {
            Some(sender) => sender.send(Frame::data(bytes.into())).await.is_ok(),
            None => false,
        }
    } else {
        parts.take().is_some()
    };
    Ok(vec![boolean(is_taken)])
}

/// `%HTTP-AWAIT-ANSWER`: number. Returns the status and the headers.
async fn answer(exchange: Arc<HttpExchange>) -> Completion {
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
    let values = vec![integer(head.status.as_u16()), headers_as_data(&head.headers)];
    let (coded, arrived) = (Bytes::new(), Arrived::default());
    *answer =
        AnswerProgress::Body(Box::new(AnswerBody { incoming, coding, coded, arrived, _sender: sender }));
    Ok(values)
}

/// `%HTTP-READ`: number, whether bytes are wanted. Returns the next piece of the body; `NIL` at its end.
async fn read(arguments: CallArguments, exchange: Arc<HttpExchange>) -> Completion {
    let mut answer = exchange.answer.lock().await;
    let AnswerProgress::Body(body) = &mut *answer else {
        return Err(http_failure("the answer has yet to come"));
    };
    loop {
        let piece = if arguments.is_true(1) {
            body.arrived.take_bytes(MOST_AT_ONCE)
        } else {
            body.arrived.take_text(false)
        };
        if crate::data::text_of(&piece) != Some("") {
            return Ok(vec![piece]);
        }
        body.receive().await?;
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
fn fault(error: &hyper::Error) -> HostFailure {
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
