//! Requests to the monitor, parsed and authorized before anything is done.

use esl_bytecode::datum::Datum;
use hyper::header::{AUTHORIZATION, HOST, HeaderValue, ORIGIN};
use hyper::http::request::Parts;
use hyper::{Method, StatusCode};
use serde_json::Value;

use super::model::{MissionView, ROWS, ViewerView};
use crate::attach::codes_of;
use crate::refusal::OperatorRefusal;
use crate::secrets::{OperatorRole, Secrets};

/// An authorized request, as far as its head tells.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Admitted {
    /// The page.
    Page,
    /// To be told what is seen, under this name.
    Viewer(OperatorRole, String),
    /// The body holds a change of the view, or a command.
    Post { role: OperatorRole, is_view: bool },
}

/// A request that is turned away: the status, and the reason.
pub(super) type Refusal = (StatusCode, &'static str);

/// Something that is to be done in the run.
pub(super) enum MonitorCommand {
    /// A task is to be aborted.
    Abort(u64),
    /// The run is to be paused, or to go on.
    Pause(bool),
    /// A task is to stand still, or to go on.
    Suspend(u64, bool),
    /// An input is to be signalled with data.
    Signal(String, Datum),
}

/// The request in a body.
pub(super) enum MonitorRequest {
    /// That this viewer sees something else.
    View { viewer: String, view: ViewerView },
    /// That something is done; why it cannot be.
    Command(Result<MonitorCommand, OperatorRefusal>),
}

/// Parses and authorizes the head of a request.
///
/// # Errors
/// Why it is turned away.
pub(super) fn admit(secrets: &Secrets, scheme: &str, head: &Parts) -> Result<Admitted, Refusal> {
    const STRANGE: Refusal = (StatusCode::FORBIDDEN, "the request comes from another site\n");
    const UNKNOWN: Refusal = (StatusCode::UNAUTHORIZED, "the token is not one of this run\n");
    match (&head.method, head.uri.path()) {
        (&Method::GET, "/") => Ok(Admitted::Page),
        (&Method::GET, "/events") => {
            if !is_from_here(head, scheme, false) {
                return Err(STRANGE);
            }
            let query = head.uri.query().unwrap_or_default();
            let role = secrets.role_of(parameter(query, "token").as_bytes()).ok_or(UNKNOWN)?;
            let viewer = parameter(query, "viewer");
            let is_name =
                (1..=64).contains(&viewer.len()) && viewer.bytes().all(|byte| byte.is_ascii_alphanumeric());
            if !is_name {
                return Err((StatusCode::BAD_REQUEST, "a viewer has a name of letters and digits\n"));
            }
            Ok(Admitted::Viewer(role, viewer.into()))
        }
        (&Method::POST, path @ ("/view" | "/do")) => {
            if !is_from_here(head, scheme, true) {
                return Err(STRANGE);
            }
            let token = head.headers.get(AUTHORIZATION).and_then(|value| value.to_str().ok());
            let token = token.and_then(|value| value.strip_prefix("Bearer ")).unwrap_or_default();
            let role = secrets.role_of(token.as_bytes()).ok_or(UNKNOWN)?;
            Ok(Admitted::Post { role, is_view: path == "/view" })
        }
        (_, "/" | "/events" | "/view" | "/do") => {
            Err((StatusCode::METHOD_NOT_ALLOWED, "this method is not allowed\n"))
        }
        _ => Err((StatusCode::NOT_FOUND, "the monitor is at /\n")),
    }
}

/// Returns whether a request comes from a page of this server. Browsers leave the origin out where a page
/// only reads from its own server.
fn is_from_here(head: &Parts, scheme: &str, must_say: bool) -> bool {
    let header = |name| head.headers.get(name).and_then(|value: &HeaderValue| value.to_str().ok());
    match (header(ORIGIN), header(HOST)) {
        (Some(origin), Some(host)) => origin.strip_prefix(scheme) == Some(host),
        _ => !must_say,
    }
}

/// Returns a parameter of a query, which needs no decoding; the last of its name.
fn parameter<'a>(query: &'a str, name: &str) -> &'a str {
    let mut parts = query.split('&').rev().filter_map(|part| part.split_once('='));
    parts.find(|(other, _)| *other == name).map_or("", |(_, value)| value)
}

/// Parses and authorizes the body of a request.
///
/// # Errors
/// Why it is turned away.
pub(super) fn parse(role: OperatorRole, is_view: bool, body: &[u8]) -> Result<MonitorRequest, Refusal> {
    let value: Value =
        serde_json::from_slice(body).map_err(|_| (StatusCode::BAD_REQUEST, "the request is not JSON\n"))?;
    if is_view {
        let text =
            |name: &str| value[name].as_str().unwrap_or_default().chars().take(200).collect::<String>();
        let number = |name: &str| value[name].as_u64().unwrap_or(0) as usize;
        let view = ViewerView {
            is_grouped: value["grouped"] == true,
            text: text("text").to_lowercase(),
            from: number("from"),
            count: number("count").min(ROWS),
            task: value["task"].as_u64().filter(|&task| task > 0),
            relation: text("relation"),
            facts_from: number("facts_from"),
            has_pictures: value["pictures"] == true,
            mission: match value["mission"].as_str() {
                Some("all") => MissionView::All,
                Some("live") => MissionView::Live,
                _ => MissionView::None,
            },
            ..ViewerView::default()
        };
        return Ok(MonitorRequest::View { viewer: text("viewer"), view });
    }
    if role < OperatorRole::Command {
        return Err((StatusCode::FORBIDDEN, "this token permits surveys only\n"));
    }
    Ok(MonitorRequest::Command(command(&value)))
}

/// Returns what is to be done.
///
/// # Errors
/// Why it cannot be.
fn command(value: &Value) -> Result<MonitorCommand, OperatorRefusal> {
    let task = || value["task"].as_u64().filter(|&n| n > 0).ok_or(OperatorRefusal::NoNumber);
    Ok(match value["action"].as_str().unwrap_or_default() {
        "abort" => MonitorCommand::Abort(task()?),
        "pause" => MonitorCommand::Pause(true),
        "continue" => MonitorCommand::Pause(false),
        "suspend" => MonitorCommand::Suspend(task()?, true),
        "resume" => MonitorCommand::Suspend(task()?, false),
        "signal" => {
            let name = value["input"].as_str().unwrap_or_default().to_uppercase();
            MonitorCommand::Signal(name, codes_of(value["data"].as_str().unwrap_or_default())?)
        }
        _ => return Err(OperatorRefusal::UnknownAction),
    })
}

#[cfg(test)]
mod tests {
    use hyper::Request;

    use super::*;

    const SECRETS: &str = "observe observe-0123456789\ncommand command-0123456789\npatch patch-0123456789\n";

    /// Each request with each role, with the wrong token, from elsewhere, and in another way.
    #[test]
    fn each_role_may_what_it_may() {
        let secrets = Secrets::parse(SECRETS).expect("they are good");
        let tokens =
            ["", "observe-012345678", "observe-0123456789", "command-0123456789", "patch-0123456789"];
        let origins = ["", "http://127.0.0.1:80", "http://evil.example", "https://127.0.0.1:80", "null"];
        let body = br#"{"action":"abort","task":1,"viewer":"v"}"#;
        let mut table = String::new();
        for (method, path) in [
            ("GET", "/"),
            ("GET", "/events"),
            ("POST", "/view"),
            ("POST", "/do"),
            ("GET", "/do"),
            ("POST", "/events"),
            ("GET", "/x"),
        ] {
            for origin in origins {
                table += &format!("{method} {path} {origin}:");
                for token in tokens {
                    let mut request = Request::builder()
                        .method(method)
                        .uri(format!("{path}?viewer=v&token={token}"))
                        .header("host", "127.0.0.1:80")
                        .header("authorization", format!("Bearer {token}"));
                    if !origin.is_empty() {
                        request = request.header("origin", origin);
                    }
                    let (head, ()) = request.body(()).expect("it is a request").into_parts();
                    let status = match admit(&secrets, "http://", &head) {
                        Ok(Admitted::Post { role, is_view }) => match parse(role, is_view, body) {
                            Ok(MonitorRequest::Command(command)) => {
                                if command.is_ok() { "done" } else { "not" }.to_string()
                            }
                            Ok(MonitorRequest::View { .. }) => "seen".into(),
                            Err((status, _)) => status.as_u16().to_string(),
                        },
                        Ok(_) => "seen".into(),
                        Err((status, _)) => status.as_u16().to_string(),
                    };
                    table += &format!(" {status}");
                }
                table.push('\n');
            }
        }
        let rows = |name: &str, own: &str, without: &str, foreign: &str| {
            let row = |origin: &str, cells: &str| format!("{name} {origin}: {cells}\n");
            origins
                .map(|origin| match origin {
                    "" => row(origin, without),
                    "http://127.0.0.1:80" => row(origin, own),
                    _ => row(origin, foreign),
                })
                .concat()
        };
        let all = |status: &str| [status; 5].join(" ");
        let (forbidden, watched) = (all("403"), "401 401 seen seen seen");
        let expected = [
            rows("GET /", &all("seen"), &all("seen"), &all("seen")),
            rows("GET /events", watched, watched, &forbidden),
            rows("POST /view", watched, &forbidden, &forbidden),
            rows("POST /do", "401 401 403 done done", &forbidden, &forbidden),
            rows("GET /do", &all("405"), &all("405"), &all("405")),
            rows("POST /events", &all("405"), &all("405"), &all("405")),
            rows("GET /x", &all("404"), &all("404"), &all("404")),
        ];
        assert_eq!(table, expected.concat());
    }
}
