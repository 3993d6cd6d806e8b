//! HTTP 1.1 by hyper: requests of the program's, and a server that hands requests to the program.
//!
//! The modules have a part each: `target` what a URL says, `client` and `coding` a request and the body of
//! its answer, `server` and `peer` the connections of others. Which function answers a request, and which
//! redirections are followed, is decided in `modules/http.esl`.
//!
//! Guarantees: what a peer sends is bounded in size, and in time where the program cannot bound it; nothing
//! that the program gives for a header or a URL can end a line; a connection ends when its call is left.

mod client;
mod coding;
mod peer;
mod server;
mod target;

use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_host::HostFailure;
use esl_vm::vm::Vm;
use hyper::HeaderMap;
use hyper::header::{HeaderName, HeaderValue};

use crate::data::{failure, text};

/// Most bytes of the head of a request or an answer.
const HEAD: usize = 64 << 10;
/// Most headers of a request or an answer.
const HEADERS: usize = 256;

/// Gives a machine the operations of `:http`.
pub(crate) fn install(machine: &mut Vm) {
    client::install(machine);
    server::install(machine);
}

/// Gives a machine the functions of `:http` that reach nothing outside.
pub(crate) fn install_conversions(machine: &mut Vm) {
    target::install(machine);
}

fn http_failure(reason: impl ToString) -> HostFailure {
    failure("HTTP-ERROR", reason)
}

/// Returns the data of a list.
fn list(items: impl IntoIterator<Item = Datum, IntoIter: DoubleEndedIterator>) -> Datum {
    Datum::list(items, Span::default())
}

/// Returns an association list of texts.
fn pairs(items: impl IntoIterator<Item = (String, String), IntoIter: DoubleEndedIterator>) -> Datum {
    let cons = |(name, value): (String, String)| Datum::cons(text(&name), text(&value), Span::default());
    Datum::list(items.into_iter().map(cons).collect::<Vec<_>>(), Span::default())
}

/// Returns headers as an association list. A value that is not UTF-8 is taken for Latin 1.
fn headers_as_data(headers: &HeaderMap) -> Datum {
    let value_of = |value: &HeaderValue| match std::str::from_utf8(value.as_bytes()) {
        Ok(value) => value.to_owned(),
        Err(_) => value.as_bytes().iter().map(|&byte| char::from(byte)).collect(),
    };
    pairs(headers.iter().map(|(name, value)| (name.to_string(), value_of(value))).collect::<Vec<_>>())
}

/// Returns the headers that the program gives.
fn headers_of(given: Vec<(String, String)>) -> Result<HeaderMap, HostFailure> {
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

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(name: &str, value: &str) -> Option<String> {
        let failure = headers_of(vec![(name.into(), value.into())]).err()?;
        failure.arguments.first().and_then(crate::data::text_of).map(str::to_owned)
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
