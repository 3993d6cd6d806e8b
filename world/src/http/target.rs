//! Targets of requests: what a URL says, by the rules of browsers, and the parts of a target that has come.

use esl_host::{HostFailure, HostRows};
use url::{ParseError, Url};

use super::http_failure;

/// Returns the URL that a text says: relative to another one, if there is one.
pub(crate) fn parse(url: &str, base: Option<&Url>) -> Result<Url, HostFailure> {
    // The rules of browsers have line ends and tabs dropped.
    if url.contains(|character: char| character.is_control()) {
        return Err(http_failure(format!("the URL `{}` contains a control character", url.escape_debug())));
    }
    let parsed = Url::options().base_url(base).parse(url).map_err(|error| match error {
        ParseError::RelativeUrlWithoutBase => not_http(url),
        ParseError::IdnaError if !url.is_ascii() => http_failure(format!(
            "the URL `{url}` names a host that is not ASCII; write its form that begins with `xn--`"
        )),
        error => http_failure(format!("the URL `{url}` is invalid: {error}")),
    })?;
    if matches!(parsed.scheme(), "http" | "https") { Ok(parsed) } else { Err(not_http(url)) }
}

fn not_http(url: &str) -> HostFailure {
    http_failure(format!("the URL `{url}` begins neither with http:// nor with https://"))
}

/// Returns the host and the port of a URL.
pub(crate) fn address(url: &Url) -> String {
    let port = url.port_or_known_default().unwrap_or(80);
    format!("{}:{port}", url.host_str().unwrap_or_default())
}

/// Adds the function that reads URLs.
pub(super) fn add(rows: &mut HostRows) {
    let function = |url: String, base: Option<String>| {
        let base = base.map(|base| parse(&base, None)).transpose()?;
        let mut url = parse(&url, base.as_ref())?;
        url.set_fragment(None);
        Ok(vec![url.to_string(), address(&url), url.origin().ascii_serialization()])
    };
    rows.at_once(
        "%HTTP-URL",
        ["url", "base"],
        "Returns the whole URL that URL is, relative to BASE if there is one, the address to connect to, and the \
         origin.",
        function,
    )
    .everywhere();
}

/// Returns the text of a part of a target whose escapes are replaced.
fn decoded(part: &str) -> String {
    percent_encoding::percent_decode_str(part).decode_utf8_lossy().into_owned()
}

/// Returns the parts of a path between its slashes, without their escapes.
pub(super) fn parts(path: &str) -> Vec<String> {
    path.split('/').map(decoded).collect()
}

/// Returns names and values of a query.
pub(super) fn query(query: &str) -> Vec<(String, String)> {
    url::form_urlencoded::parse(query.as_bytes()).into_owned().collect()
}

/// Returns the name and the password of a URL, without their escapes; `None` if it has neither.
pub(super) fn credentials(url: &Url) -> Option<String> {
    let password = url.password();
    (!url.username().is_empty() || password.is_some())
        .then(|| format!("{}:{}", decoded(url.username()), decoded(password.unwrap_or_default())))
}

#[cfg(test)]
mod tests {
    use super::super::reason_of;
    use super::*;

    fn said(url: &str, base: Option<&str>) -> String {
        let base = base.map(|base| parse(base, None).expect("the base is right"));
        match parse(url, base.as_ref()) {
            Ok(url) => url.to_string(),
            Err(failure) => reason_of(&failure),
        }
    }

    #[test]
    fn urls_are_those_of_browsers() {
        let cases = [
            ("http://example.com", "http://example.com/"),
            ("HTTP://Example.COM:80/A?b=c d#e", "http://example.com/A?b=c%20d#e"),
            ("http://h/ü?ü=€", "http://h/%C3%BC?%C3%BC=%E2%82%AC"),
            ("http://h/a/../b/./c", "http://h/b/c"),
            ("http://h/%41%zz|", "http://h/%41%zz|"),
            ("http://[::1]:8080/", "http://[::1]:8080/"),
            ("ftp://h/", "the URL `ftp://h/` begins neither with http:// nor with https://"),
            ("h/a", "the URL `h/a` begins neither with http:// nor with https://"),
            ("http://", "the URL `http://` is invalid: empty host"),
            ("http://h:65536/", "the URL `http://h:65536/` is invalid: invalid port number"),
            ("http://h/a\r\nX: y", "the URL `http://h/a\\r\\nX: y` contains a control character"),
            (
                "http://mü.de/",
                "the URL `http://mü.de/` names a host that is not ASCII; write its form that begins with `xn--`",
            ),
        ];
        for (url, expected) in cases {
            assert_eq!(said(url, None), expected, "{url}");
        }
    }

    #[test]
    fn redirections_are_resolved() {
        let base = Some("http://me:pw@h:8080/a/b?c#d");
        let cases = [
            ("/x", "http://me:pw@h:8080/x"),
            ("x?y", "http://me:pw@h:8080/a/x?y"),
            ("../x", "http://me:pw@h:8080/x"),
            ("?y", "http://me:pw@h:8080/a/b?y"),
            ("//other/x", "http://other/x"),
            ("https://other", "https://other/"),
            ("mailto:me", "the URL `mailto:me` begins neither with http:// nor with https://"),
        ];
        for (url, expected) in cases {
            assert_eq!(said(url, base), expected, "{url}");
        }
    }

    #[test]
    fn the_parts_of_a_target_lose_their_escapes() {
        assert_eq!(parts("/a+b/c%2Fd/%C3%BC%FF"), ["", "a+b", "c/d", "ü\u{FFFD}"]);
        let pair = |name: &str, value: &str| (name.to_owned(), value.to_owned());
        assert_eq!(
            query("a=b+c&d&=e&%C3%BC=1%3D"),
            [pair("a", "b c"), pair("d", ""), pair("", "e"), pair("ü", "1=")]
        );
        let of = |url: &str| parse(url, None).ok().as_ref().and_then(credentials);
        assert_eq!(of("http://me:p%40w@h/").as_deref(), Some("me:p@w"));
        assert_eq!(of("http://me@h/").as_deref(), Some("me:"));
        assert_eq!(of("http://h/"), None);
    }
}
