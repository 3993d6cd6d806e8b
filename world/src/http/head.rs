//! The head of a request, which is checked for the faults that the parser lets pass.

use hyper::header::{self, HeaderValue};
use hyper::http::request::Parts;
use hyper::http::uri::Authority;
use hyper::{Method, StatusCode, Version};

/// Checks a head for the faults that the parser lets pass.
pub(super) fn check(head: &Parts) -> Result<(), (StatusCode, &'static str)> {
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
