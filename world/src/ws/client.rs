//! The handshake of a client: a request by HTTP that the server answers by switching to frames.

use std::collections::HashSet;

use bytes::Bytes;
use esl_host::{HostFailure, IntoDatum};
use http_body_util::{Either, Full};
use hyper::header::{self, HeaderMap, HeaderName, HeaderValue};
use hyper::{Request, Response, StatusCode};
use tokio_tungstenite::tungstenite::handshake::client::generate_key;
use tokio_tungstenite::tungstenite::handshake::derive_accept_key;
use tokio_tungstenite::tungstenite::protocol::Role;
use url::Url;

use super::connection::{WsConnection, ends};
use super::driver::FrameDriver;
use super::{SocketLimits, ws_failure};
use crate::event_loop;
use crate::http::{self, RequestBody};
use crate::tls_files::ClientFiles;

/// Headers that are the handshake's own.
const OF_THE_HANDSHAKE: [HeaderName; 6] = [
    header::CONNECTION,
    header::UPGRADE,
    header::SEC_WEBSOCKET_EXTENSIONS,
    header::SEC_WEBSOCKET_KEY,
    header::SEC_WEBSOCKET_PROTOCOL,
    header::SEC_WEBSOCKET_VERSION,
];

/// Returns the URL of the request for a connection, and the address of the server.
pub(super) fn http_url(url: &str) -> Result<Vec<String>, HostFailure> {
    let rest = match url.split_once(':') {
        Some((scheme, rest)) if scheme.eq_ignore_ascii_case("ws") => format!("http:{rest}"),
        Some((scheme, rest)) if scheme.eq_ignore_ascii_case("wss") => format!("https:{rest}"),
        _ => {
            let url = url.escape_debug();
            return Err(ws_failure(format!("the URL `{url}` begins neither with ws:// nor with wss://")));
        }
    };
    let url = http::parse_url(&rest, None).map_err(of_program)?;
    if url.fragment().is_some() {
        return Err(ws_failure("the URL of a connection cannot have a part behind `#`"));
    }
    Ok(vec![url.to_string(), http::address(&url)])
}

/// Returns the failure for something that the program has given.
fn of_program(failure: HostFailure) -> HostFailure {
    HostFailure { cause: "WS-ERROR".into(), ..failure }
}

/// Returns the failure for an answer that is not one.
fn of_peer(failure: HostFailure) -> HostFailure {
    if failure.cause == "HTTP-ERROR" {
        HostFailure { cause: "PROTOCOL-ERROR".into(), ..failure }
    } else {
        failure
    }
}

fn protocol_error(reason: impl ToString) -> HostFailure {
    HostFailure::new("PROTOCOL-ERROR", reason)
}

/// A handshake that was not begun.
pub(super) struct ClientHandshake {
    url: Url,
    request: Request<RequestBody>,
    key: String,
    /// The protocols that are offered.
    protocols: Vec<String>,
}

impl ClientHandshake {
    pub(super) fn new(
        url: &str,
        headers: Vec<(String, String)>,
        protocols: Vec<String>,
    ) -> Result<ClientHandshake, HostFailure> {
        let url = http::parse_url(url, None).map_err(of_program)?;
        let mut headers = http::headers_of(headers).map_err(of_program)?;
        if let Some(name) = OF_THE_HANDSHAKE.iter().find(|&name| headers.contains_key(name)) {
            return Err(ws_failure(format!("the header `{name}` is the handshake's own; leave it out")));
        }
        check_protocols(&protocols)?;
        let key = generate_key();
        headers.insert(header::CONNECTION, HeaderValue::from_static("Upgrade"));
        headers.insert(header::UPGRADE, HeaderValue::from_static("websocket"));
        headers.insert(header::SEC_WEBSOCKET_VERSION, HeaderValue::from_static("13"));
        headers.insert(header::SEC_WEBSOCKET_KEY, HeaderValue::try_from(&key).map_err(ws_failure)?);
        if !protocols.is_empty() {
            let offered = HeaderValue::try_from(protocols.join(", ")).map_err(ws_failure)?;
            headers.insert(header::SEC_WEBSOCKET_PROTOCOL, offered);
        }
        let body = Either::Left(Full::new(Bytes::new()));
        let mut request = http::request("GET", &url, headers, body).map_err(of_program)?;
        // The answer has no body.
        request.headers_mut().remove(header::ACCEPT_ENCODING);
        Ok(ClientHandshake { url, request, key, protocols })
    }

    /// Connects to a server and opens a connection. Returns the protocol that the server has chosen.
    pub(super) async fn open(
        self,
        connection: &WsConnection,
        address: &str,
        files: ClientFiles,
        limits: SocketLimits,
    ) -> Result<Option<String>, HostFailure> {
        let (mut sender, driver) = http::connect(address, &self.url, files).await.map_err(of_peer)?;
        let answer = sender.send_request(self.request).await;
        let answer = answer.map_err(|error| of_peer(http::fault(&error)))?;
        let protocol = check(&answer, &self.key, &self.protocols)?;
        let upgraded = hyper::upgrade::on(answer).await.map_err(|error| of_peer(http::fault(&error)))?;
        // Its part is done.
        drop(driver);
        let (open, end) = ends(limits);
        let driver = FrameDriver::new(upgraded, Role::Client, limits, end).await;
        event_loop::spawn(driver.run()).map_err(ws_failure)?;
        connection.open(open)?;
        Ok(protocol)
    }
}

/// Checks the names of protocols.
fn check_protocols(protocols: &[String]) -> Result<(), HostFailure> {
    // They are tokens of HTTP, as the names of headers are.
    for name in protocols {
        if HeaderName::from_bytes(name.as_bytes()).is_err() {
            return Err(ws_failure(format!("`{}` is not a name of a protocol", name.escape_debug())));
        }
    }
    let different: HashSet<&String> = protocols.iter().collect();
    if different.len() < protocols.len() { Err(ws_failure("a protocol is given twice")) } else { Ok(()) }
}

/// Returns whether a header has a word, among others, in any case.
pub(super) fn has_word(headers: &HeaderMap, name: &HeaderName, word: &str) -> bool {
    let values = headers.get_all(name).iter().filter_map(|value| value.to_str().ok());
    values.flat_map(|value| value.split(',')).any(|part| part.trim().eq_ignore_ascii_case(word))
}

/// Checks that an answer begins a connection. Returns the protocol that the server has chosen.
fn check<Body>(
    answer: &Response<Body>,
    key: &str,
    protocols: &[String],
) -> Result<Option<String>, HostFailure> {
    let (status, headers) = (answer.status(), answer.headers());
    if status != StatusCode::SWITCHING_PROTOCOLS {
        let reason = format!("the server answers with the status {}", status.as_u16());
        return Err(HostFailure {
            cause: "HANDSHAKE-REFUSED".into(),
            arguments: vec![status.as_u16().into_datum(), reason.into_datum()],
        });
    }
    if !has_word(headers, &header::UPGRADE, "websocket") || !has_word(headers, &header::CONNECTION, "upgrade")
    {
        return Err(protocol_error("the server switches to another protocol"));
    }
    let accepted = headers.get(header::SEC_WEBSOCKET_ACCEPT);
    if accepted.is_none_or(|accepted| accepted.as_bytes() != derive_accept_key(key.as_bytes()).as_bytes()) {
        return Err(protocol_error(
            "the server does not answer the handshake: `Sec-WebSocket-Accept` is wrong",
        ));
    }
    let text = |value: &HeaderValue| String::from_utf8_lossy(value.as_bytes()).escape_debug().to_string();
    if let Some(extension) = headers.get(header::SEC_WEBSOCKET_EXTENSIONS) {
        let extension = text(extension);
        return Err(protocol_error(format!(
            "the server uses the extension `{extension}`, which it was not offered"
        )));
    }
    let mut chosen = headers.get_all(header::SEC_WEBSOCKET_PROTOCOL).iter();
    match (chosen.next(), chosen.next()) {
        (None, _) => Ok(None),
        (Some(chosen), None) if protocols.iter().any(|offered| offered.as_bytes() == chosen.as_bytes()) => {
            Ok(Some(text(chosen)))
        }
        (Some(chosen), _) => {
            let chosen = text(chosen);
            Err(protocol_error(format!(
                "the server chooses the protocol `{chosen}`, which it was not offered"
            )))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn urls_are_those_of_http_with_another_scheme() {
        let cases = [
            ("ws://h", Some(("http://h/", "h:80"))),
            ("WSS://H/a?b", Some(("https://h/a?b", "h:443"))),
            ("ws://[::1]:9090/", Some(("http://[::1]:9090/", "[::1]:9090"))),
            ("http://h/", None),
            ("ws:", None),
            ("h", None),
            ("ws://h/#part", None),
            ("ws://h/\r\nX: y", None),
        ];
        for (url, expected) in cases {
            let expected = expected.map(|(url, address)| vec![url.to_owned(), address.to_owned()]);
            assert_eq!(http_url(url).ok(), expected, "{url}");
        }
    }

    fn answer(status: u16, headers: &[(&str, &str)]) -> Response<()> {
        let mut answer = Response::builder().status(status);
        for (name, value) in headers {
            answer = answer.header(*name, *value);
        }
        answer.body(()).expect("the headers are right")
    }

    #[test]
    fn an_answer_has_to_fit_the_handshake() {
        const KEY: &str = "dGhlIHNhbXBsZSBub25jZQ==";
        const RIGHT: [(&str, &str); 3] = [
            ("upgrade", "WebSocket"),
            ("connection", "keep-alive, Upgrade"),
            ("sec-websocket-accept", "s3pPLMBiTxaQ9kYGzzhZRbK+xOo="),
        ];
        let offered = ["one".to_owned(), "two".to_owned()];
        let cause = |status, headers: &[(&str, &str)]| {
            check(&answer(status, headers), KEY, &offered).map_err(|failure| failure.cause)
        };
        let with = |more| cause(101, &[&RIGHT[..], &[more]].concat());
        assert_eq!(cause(101, &RIGHT), Ok(None));
        assert_eq!(with(("sec-websocket-protocol", "two")), Ok(Some("two".into())));
        let broken = || Err("PROTOCOL-ERROR".to_owned());
        assert_eq!(with(("sec-websocket-protocol", "three")), broken());
        assert_eq!(with(("sec-websocket-extensions", "permessage-deflate")), broken());
        for missing in 0..RIGHT.len() {
            let mut headers = RIGHT.to_vec();
            headers.remove(missing);
            assert_eq!(cause(101, &headers), broken(), "{missing}");
        }
        assert_eq!(cause(403, &[]), Err("HANDSHAKE-REFUSED".into()));
    }

    #[test]
    fn headers_of_the_handshake_and_protocols_are_checked() {
        let new = |header: &str, protocols: &[&str]| {
            let headers = vec![(header.to_owned(), "x".to_owned())];
            let protocols = protocols.iter().map(|&name| name.to_owned()).collect();
            ClientHandshake::new("http://h/", headers, protocols).is_ok()
        };
        assert!(new("Origin", &[]) && new("X", &["v1.json", "v2"]));
        assert!(!new("upgrade", &[]) && !new("Sec-WebSocket-Key", &[]));
        for protocols in [&["a b"][..], &["a,b"], &[""], &["a", "a"]] {
            assert!(!new("X", protocols), "{protocols:?}");
        }
    }
}
