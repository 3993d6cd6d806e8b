//! HTTP 1.1 by hyper: requests of the program's, and a server that hands requests to the program.
//!
//! The modules have a part each: `target` what a URL says, `client` and `coding` a request and the body of
//! its answer, `server`, `head`, `body`, `peer`, `greeting` and `address` the connections of others. Which
//! function answers a request, and which redirections are followed, is decided in `modules/http.esl`.
//!
//! Guarantees: what a peer sends is bounded in size, and in time where the program cannot bound it; nothing
//! that the program gives for a header or a URL can end a line; a connection ends when its call is left.

mod address;
mod body;
mod client;
mod coding;
mod greeting;
mod head;
mod peer;
mod server;
mod target;

use esl_host::{HostFailure, HostRows, Inbox};
use hyper::HeaderMap;
use hyper::header::{HeaderName, HeaderValue};

pub(crate) use client::{RequestBody, connect, fault, request};
pub(crate) use server::ServerSlot;
pub(crate) use target::{address, parse as parse_url};

/// Most bytes of the head of a request or an answer.
const HEAD: usize = 64 << 10;
/// Most headers of a request or an answer.
const HEADERS: usize = 256;

/// Returns the functions of `:http`.
pub(crate) fn rows(inbox: &Inbox) -> HostRows {
    let mut rows = HostRows::new(inbox);
    client::add(&mut rows);
    server::add(&mut rows);
    target::add(&mut rows);
    rows
}

fn http_failure(reason: impl ToString) -> HostFailure {
    HostFailure::new("HTTP-ERROR", reason)
}

/// Returns headers as names and values. A value that is not UTF-8 is taken for Latin 1.
fn headers_as_pairs(headers: &HeaderMap) -> Vec<(String, String)> {
    let value_of = |value: &HeaderValue| match std::str::from_utf8(value.as_bytes()) {
        Ok(value) => value.to_owned(),
        Err(_) => value.as_bytes().iter().map(|&byte| char::from(byte)).collect(),
    };
    headers.iter().map(|(name, value)| (name.to_string(), value_of(value))).collect()
}

/// Returns the headers that the program gives.
pub(crate) fn headers_of(given: Vec<(String, String)>) -> Result<HeaderMap, HostFailure> {
    let mut headers = HeaderMap::with_capacity(given.len());
    for (name, value) in given {
        let known = HeaderName::from_bytes(name.as_bytes())
            .map_err(|_| http_failure(format!("`{}` is not a name of a header", name.escape_debug())))?;
        let value = HeaderValue::from_bytes(value.as_bytes()).map_err(|_| {
            let fault = if value.contains(['\r', '\n']) { "a line end" } else { "a control character" };
            http_failure(format!("the value of the header `{name}` contains {fault}"))
        })?;
        headers.append(known, value);
    }
    Ok(headers)
}

/// Returns the text of a failure.
#[cfg(test)]
fn reason_of(failure: &HostFailure) -> String {
    match failure.arguments.first().map(esl_bytecode::datum::Datum::kind) {
        Some(esl_bytecode::datum::DatumKind::String(reason)) => reason.to_string(),
        _ => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(name: &str, value: &str) -> Option<String> {
        headers_of(vec![(name.into(), value.into())]).err().as_ref().map(reason_of)
    }

    #[test]
    fn no_header_ends_a_line() {
        assert_eq!(refusal("X-Kind", "käse\t1"), None);
        let line_end = "the value of the header `X` contains a line end";
        assert_eq!(refusal("X", "a\r\nY: b").as_deref(), Some(line_end));
        assert_eq!(refusal("X", "a\nb").as_deref(), Some(line_end));
        assert_eq!(
            refusal("X", "a\0").as_deref(),
            Some("the value of the header `X` contains a control character")
        );
        for name in ["", "X Y", "X\r\nY", "X:", "ä"] {
            assert!(
                refusal(name, "a").is_some_and(|reason| reason.ends_with("is not a name of a header")),
                "{name:?}"
            );
        }
    }
}
