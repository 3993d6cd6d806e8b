//! The handshake of a server: a request that its client makes for a connection, and the answer.

use bytes::Bytes;
use esl_host::{HostFailure, HostHandle};
use http_body_util::Full;
use hyper::header::{self, HeaderValue};
use hyper::http::request::Parts;
use hyper::upgrade::OnUpgrade;
use hyper::{Method, Response, StatusCode, Version};
use tokio_tungstenite::tungstenite::handshake::derive_accept_key;
use tokio_tungstenite::tungstenite::protocol::Role;

use super::client::has_word;
use super::connection::{DriverEnd, WsConnection, ends};
use super::driver::FrameDriver;
use super::{SocketLimits, ws_failure};
use crate::http::ServerSlot;

/// The handshake that a request begins.
pub(crate) struct Handshake {
    /// The answer to its key.
    accept: String,
    /// The protocols that the client offers.
    offered: Vec<String>,
}

impl Handshake {
    /// Returns the handshake that a request begins, if it is one, or the answer to a malformed one.
    pub(crate) fn read(head: &Parts) -> Result<Option<Handshake>, (StatusCode, &'static str)> {
        let headers = &head.headers;
        let is_one = head.method == Method::GET
            && head.version == Version::HTTP_11
            && has_word(headers, &header::UPGRADE, "websocket")
            && has_word(headers, &header::CONNECTION, "upgrade");
        if !is_one {
            return Ok(None);
        }
        let only = |name| {
            let mut values = headers.get_all(name).iter();
            values.next().filter(|_| values.next().is_none()).map(HeaderValue::as_bytes)
        };
        if only(header::SEC_WEBSOCKET_VERSION) != Some(b"13") {
            return Err((StatusCode::UPGRADE_REQUIRED, "this server speaks version 13 of WebSocket"));
        }
        // Sixteen bytes, in base 64.
        let is_key = |key: &&[u8]| key.len() == 24 && key.ends_with(b"==");
        let Some(key) = only(header::SEC_WEBSOCKET_KEY).filter(is_key) else {
            return Err((StatusCode::BAD_REQUEST, "the handshake needs one header Sec-WebSocket-Key"));
        };
        let offered = headers.get_all(header::SEC_WEBSOCKET_PROTOCOL).iter();
        let offered = offered.filter_map(|value| value.to_str().ok()).flat_map(|value| value.split(','));
        Ok(Some(Handshake {
            accept: derive_accept_key(key),
            offered: offered.map(|name| name.trim().to_owned()).collect(),
        }))
    }

    /// Returns the answer by which the connection begins.
    fn answer(&self, protocol: Option<&str>) -> Result<Response<Full<Bytes>>, HostFailure> {
        let mut answer = Response::new(Full::new(Bytes::new()));
        *answer.status_mut() = StatusCode::SWITCHING_PROTOCOLS;
        let headers = answer.headers_mut();
        headers.insert(header::UPGRADE, HeaderValue::from_static("websocket"));
        headers.insert(header::CONNECTION, HeaderValue::from_static("Upgrade"));
        headers
            .insert(header::SEC_WEBSOCKET_ACCEPT, HeaderValue::try_from(&self.accept).map_err(ws_failure)?);
        if let Some(protocol) = protocol {
            headers
                .insert(header::SEC_WEBSOCKET_PROTOCOL, HeaderValue::try_from(protocol).map_err(ws_failure)?);
        }
        Ok(answer)
    }
}

/// A connection that a server has accepted, before its client has switched to frames.
pub(crate) struct Accepted {
    end: DriverEnd,
    limits: SocketLimits,
}

impl Accepted {
    /// Drives the connection until it has ended.
    pub(crate) async fn run(self, upgrade: OnUpgrade) {
        // Without it the client has gone.
        if let Ok(upgraded) = upgrade.await {
            FrameDriver::new(upgraded, Role::Server, self.limits, self.end).await.run().await;
        }
    }
}

/// Opens a connection by answering the handshake of a request. Returns the first of the protocols that its
/// client offers.
pub(super) fn accept(
    connection: &HostHandle<WsConnection>,
    server: &HostHandle<ServerSlot>,
    request: i64,
    protocols: &[String],
    limits: SocketLimits,
) -> Result<Option<String>, HostFailure> {
    let (open, end) = ends(limits);
    let mut chosen = None;
    server.switch(request, |handshake| {
        chosen = protocols.iter().find(|&name| handshake.offered.contains(name)).cloned();
        Ok((handshake.answer(chosen.as_deref())?, Accepted { end, limits }))
    })?;
    connection.open(open)?;
    Ok(chosen)
}

#[cfg(test)]
mod tests {
    use super::*;
    use hyper::Request;

    fn read(method: &str, headers: &[(&str, &str)]) -> Result<Option<Vec<String>>, u16> {
        let mut request = Request::builder().method(method).uri("/");
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        let (head, ()) = request.body(()).expect("the request is right").into_parts();
        Handshake::read(&head).map(|one| one.map(|one| one.offered)).map_err(|(status, _)| status.as_u16())
    }

    #[test]
    fn a_handshake_is_a_request_with_four_headers() {
        const RIGHT: [(&str, &str); 4] = [
            ("connection", "keep-alive, Upgrade"),
            ("upgrade", "websocket"),
            ("sec-websocket-key", "dGhlIHNhbXBsZSBub25jZQ=="),
            ("sec-websocket-version", "13"),
        ];
        let with = |more| [&RIGHT[..], &[more]].concat();
        assert_eq!(read("GET", &RIGHT), Ok(Some(Vec::new())));
        assert_eq!(read("POST", &RIGHT), Ok(None));
        assert_eq!(read("GET", &RIGHT[1..]), Ok(None));
        assert_eq!(read("GET", &RIGHT[..3]), Err(426));
        assert_eq!(read("GET", &with(("sec-websocket-version", "8"))), Err(426));
        assert_eq!(read("GET", &[&RIGHT[..2], &RIGHT[3..]].concat()), Err(400));
        assert_eq!(read("GET", &with(("sec-websocket-key", "dGhlIHNhbXBsZSBub25jZQ=="))), Err(400));
        let offered = read("GET", &with(("sec-websocket-protocol", "a, b")));
        assert_eq!(offered, Ok(Some(vec!["a".into(), "b".into()])));
    }

    #[test]
    fn an_answer_has_the_key_of_the_rfc() {
        let handshake =
            Handshake { accept: derive_accept_key(b"dGhlIHNhbXBsZSBub25jZQ=="), offered: Vec::new() };
        let answer = handshake.answer(Some("v1")).expect("it is one");
        let header = |name| answer.headers().get(name).and_then(|value: &HeaderValue| value.to_str().ok());
        assert_eq!(header("sec-websocket-accept"), Some("s3pPLMBiTxaQ9kYGzzhZRbK+xOo="));
        assert_eq!((header("upgrade"), header("sec-websocket-protocol")), (Some("websocket"), Some("v1")));
        assert!(header("sec-websocket-extensions").is_none());
    }
}
