//! The monitor: one page, which shows a run as it goes on.
//!
//! The page asks for nothing but itself and what this server sends. What it shows comes as server-sent
//! events; what is done goes the other way as posts. The token is in the fragment of the address of the page,
//! which no browser sends; the page puts it into its requests.
//!
//! Nothing is looked at while nobody watches. Each step looks at a bounded number of tasks; a viewer who does
//! not take what is sent is let go.

mod model;

use std::collections::{BTreeMap, BTreeSet};
use std::net::TcpListener;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use bytes::Bytes;
use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;
use esl_vm::host::{Answer, FrameVariable, FunctionRef, Incoming, Question, Sender, SurveyRequest};
use esl_world::TlsIdentity;
use http_body_util::{BodyExt, Channel, Limited};
use hyper::header::{AUTHORIZATION, CONTENT_SECURITY_POLICY, HOST, HeaderValue, ORIGIN, REFERRER_POLICY};
use hyper::{Method, Request, Response, StatusCode};
use serde_json::{Value, json};
use tokio::sync::{Notify, watch};

use super::attach::codes_of;
use super::http::{self, Hangup, HttpBody, plain, with};
use super::scope::RunScope;
use super::secrets::{OperatorRole, Secrets};
use model::{RunModel, ViewerView};

/// The page; `NONCE` stands for what its script and its style are marked with.
const PAGE: &str = include_str!("page.html");
/// Time between two looks at the run.
const PERIOD: Duration = Duration::from_millis(250);
/// Tasks that one look tells of, beside those that are seen.
const PAGE_OF_TASKS: usize = 2000;
/// Most viewers.
const VIEWERS: usize = 8;
/// Time that a viewer has to take what is sent.
const PATIENCE: Duration = Duration::from_secs(2);
/// Most bytes of a post.
const POST: usize = 64 << 10;

/// What all viewers share.
struct MonitorState {
    scope: RunScope,
    secrets: Secrets,
    /// What the origin of its own page begins with.
    scheme: &'static str,
    model: Mutex<RunModel>,
    views: Mutex<BTreeMap<String, ViewerView>>,
    /// Notified when a viewer comes.
    coming: Notify,
    /// Changes with each look.
    looks: watch::Sender<u64>,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // What it guards is whole at every moment, so a panic elsewhere does not corrupt it.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Serves the page and what it asks for.
///
/// # Errors
/// The reason, if there is no event loop.
pub(super) fn serve(
    listener: TcpListener,
    identity: Option<TlsIdentity>,
    scope: RunScope,
    secrets: Secrets,
) -> Result<(), String> {
    let is_secured = identity.is_some();
    let monitor = Arc::new(MonitorState {
        scope,
        secrets,
        scheme: if is_secured { "https://" } else { "http://" },
        model: Mutex::default(),
        views: Mutex::default(),
        coming: Notify::new(),
        looks: watch::Sender::new(0),
    });
    esl_world::spawn(look_on(monitor.clone()))?;
    http::serve(listener, identity, move |request, hangup| answer(monitor.clone(), request, hangup))
}

/// Looks at the run again and again while there are viewers.
async fn look_on(monitor: Arc<MonitorState>) {
    loop {
        if lock(&monitor.views).is_empty() {
            monitor.coming.notified().await;
            continue;
        }
        let (named, cursor, failure) = {
            let model = lock(&monitor.model);
            let views = lock(&monitor.views);
            let named: BTreeSet<u64> = views.values().flat_map(|view| model.visible(view)).collect();
            (named.into_iter().collect::<Vec<u64>>(), model.cursor, model.latest_failure())
        };
        let request = SurveyRequest {
            tasks: PAGE_OF_TASKS,
            after: cursor,
            named: named.clone(),
            data: true,
            failures_after: Some(failure),
            ..SurveyRequest::default()
        };
        if let Some(survey) = monitor.scope.survey(request).await {
            let told: BTreeSet<u64> = survey.tasks.iter().map(|row| row.number).collect();
            let mut model = lock(&monitor.model);
            model.take(survey, PAGE_OF_TASKS, Instant::now());
            model.drop_missing(&named, &told);
        }
        monitor.looks.send_modify(|look| *look += 1);
        tokio::time::sleep(PERIOD).await;
    }
}

async fn answer(
    monitor: Arc<MonitorState>,
    request: Request<hyper::body::Incoming>,
    hangup: Hangup,
) -> Response<HttpBody> {
    match (request.method(), request.uri().path()) {
        (&Method::GET, "/") => page(),
        (&Method::GET, "/events") => {
            if !is_from_here(&request, monitor.scheme, false) {
                return plain(StatusCode::FORBIDDEN, "the request comes from another site\n");
            }
            let parameters = parameters(request.uri().query().unwrap_or_default());
            let get = |name: &str| parameters.get(name).map_or("", String::as_str);
            match monitor.secrets.role_of(get("token").as_bytes()) {
                Some(role) => events(monitor, role, get("viewer"), hangup),
                None => plain(StatusCode::UNAUTHORIZED, "the token is not one of this run\n"),
            }
        }
        (&Method::POST, "/view" | "/do") => {
            if !is_from_here(&request, monitor.scheme, true) {
                return plain(StatusCode::FORBIDDEN, "the request comes from another site\n");
            }
            let token = request.headers().get(AUTHORIZATION).and_then(|value| value.to_str().ok());
            let token = token.and_then(|value| value.strip_prefix("Bearer ")).unwrap_or_default();
            let Some(role) = monitor.secrets.role_of(token.as_bytes()) else {
                return plain(StatusCode::UNAUTHORIZED, "the token is not one of this run\n");
            };
            let is_view = request.uri().path() == "/view";
            let body =
                tokio::time::timeout(PATIENCE, Limited::new(request.into_body(), POST).collect()).await;
            let Ok(Ok(body)) = body else {
                return plain(
                    StatusCode::PAYLOAD_TOO_LARGE,
                    "the request is too large, or comes too slowly\n",
                );
            };
            let Ok(value) = serde_json::from_slice::<Value>(&body.to_bytes()) else {
                return plain(StatusCode::BAD_REQUEST, "the request is no JSON\n");
            };
            if is_view {
                return set_view(&monitor, &value);
            }
            if role < OperatorRole::Command {
                return plain(StatusCode::FORBIDDEN, "this token is for looking only\n");
            }
            let (status, text) = match act(&monitor, &value).await {
                Ok(()) => (StatusCode::OK, json!({ "ok": true })),
                Err(reason) => (StatusCode::CONFLICT, json!({ "ok": false, "reason": reason })),
            };
            with(status, "application/json", text.to_string())
        }
        (_, "/" | "/events" | "/view" | "/do") => plain(StatusCode::METHOD_NOT_ALLOWED, "not in this way\n"),
        _ => plain(StatusCode::NOT_FOUND, "the monitor is at /\n"),
    }
}

/// Returns the page.
fn page() -> Response<HttpBody> {
    let mut bytes = [0; 16];
    if getrandom::fill(&mut bytes).is_err() {
        return plain(StatusCode::INTERNAL_SERVER_ERROR, "the system gives no random numbers\n");
    }
    let nonce: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
    let mut response = with(StatusCode::OK, "text/html; charset=utf-8", PAGE.replace("NONCE", &nonce));
    let policy = format!(
        "default-src 'none'; script-src 'nonce-{nonce}'; style-src 'nonce-{nonce}'; connect-src 'self'; img-src data:; \
         base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    );
    let headers = response.headers_mut();
    if let Ok(policy) = HeaderValue::from_str(&policy) {
        headers.insert(CONTENT_SECURITY_POLICY, policy);
    }
    headers.insert(REFERRER_POLICY, HeaderValue::from_static("no-referrer"));
    response
}

/// Returns whether a request comes from a page of this server. Browsers leave the origin out where a page
/// only reads from its own server.
fn is_from_here(request: &Request<hyper::body::Incoming>, scheme: &str, must_say: bool) -> bool {
    let header = |name| request.headers().get(name).and_then(|value: &HeaderValue| value.to_str().ok());
    match (header(ORIGIN), header(HOST)) {
        (Some(origin), Some(host)) => origin.strip_prefix(scheme) == Some(host),
        _ => !must_say,
    }
}

/// Returns the parameters of a query that need no decoding.
fn parameters(query: &str) -> BTreeMap<&str, String> {
    query
        .split('&')
        .filter_map(|part| part.split_once('='))
        .map(|(name, value)| (name, value.into()))
        .collect()
}

/// Sends a viewer what is seen, until it goes.
fn events(
    monitor: Arc<MonitorState>,
    role: OperatorRole,
    viewer: &str,
    hangup: Hangup,
) -> Response<HttpBody> {
    let is_name = (1..=64).contains(&viewer.len()) && viewer.bytes().all(|byte| byte.is_ascii_alphanumeric());
    if !is_name {
        return plain(StatusCode::BAD_REQUEST, "a viewer has a name of letters and digits\n");
    }
    {
        let mut views = lock(&monitor.views);
        if views.len() >= VIEWERS && !views.contains_key(viewer) {
            return plain(StatusCode::SERVICE_UNAVAILABLE, "there are too many viewers\n");
        }
        views.insert(viewer.into(), ViewerView { count: model::ROWS, ..ViewerView::default() });
    }
    monitor.coming.notify_one();
    let (mut sender, body) = Channel::<Bytes, std::convert::Infallible>::new(1);
    let watching = Watching { monitor: monitor.clone(), viewer: viewer.into() };
    tokio::spawn(async move {
        let _watching = &watching;
        // Who may signal something keeps a run that waits from being over.
        let _sender = (role >= OperatorRole::Command).then(|| monitor.scope.sender());
        let mut looks = monitor.looks.subscribe();
        loop {
            let Some(message) = message(&monitor, &watching.viewer, role).await else { return };
            let event = Bytes::from(format!("data: {message}\n\n"));
            match tokio::time::timeout(PATIENCE, sender.send_data(event)).await {
                Ok(Ok(())) => {}
                _ => return hangup.hang_up(),
            }
            if looks.changed().await.is_err() {
                return;
            }
        }
    });
    let mut response = Response::new(body.boxed());
    let headers = response.headers_mut();
    headers.insert(hyper::header::CONTENT_TYPE, HeaderValue::from_static("text/event-stream"));
    headers.insert(hyper::header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    response
}

/// A viewer who watches; dropped when it goes.
struct Watching {
    monitor: Arc<MonitorState>,
    viewer: String,
}

impl Drop for Watching {
    fn drop(&mut self) {
        lock(&self.monitor.views).remove(&self.viewer);
    }
}

/// Returns what a viewer is told now; `None` if it has gone.
async fn message(monitor: &MonitorState, viewer: &str, role: OperatorRole) -> Option<Value> {
    let view = lock(&monitor.views).get(viewer)?.clone();
    let request = SurveyRequest {
        named: view.task.into_iter().collect(),
        frames_of: view.task,
        facts: (!view.relation.is_empty()).then(|| (view.relation.clone(), view.facts_from)),
        ..SurveyRequest::default()
    };
    let needs_more = view.task.is_some() || !view.relation.is_empty();
    let more = if needs_more { monitor.scope.survey(request).await } else { None };
    let (mut message, latest) = {
        let model = lock(&monitor.model);
        (model.message(&view), model.latest_failure())
    };
    if let Some(view) = lock(&monitor.views).get_mut(viewer) {
        view.failure = latest;
    }
    message["role"] = role.name().into();
    if let Some(more) = more {
        message["task"] = match (view.task, more.tasks.first()) {
            (Some(_), Some(row)) => json!({
                "n": row.number, "name": row.name, "waits": row.waits_for, "ticks": row.ticks, "maker": row.maker,
                "frames": more.frames.iter().map(|frame| json!([frame.function, frame.place, FrameVariable::lines(&frame.variables)])).collect::<Vec<_>>(),
            }),
            (Some(number), None) => json!({ "n": number, "ended": true }),
            _ => Value::Null,
        };
        message["facts_shown"] =
            json!({ "name": view.relation, "from": view.facts_from, "facts": more.facts });
    }
    Some(message)
}

/// Sets what a viewer sees.
fn set_view(monitor: &MonitorState, value: &Value) -> Response<HttpBody> {
    let text = |name: &str| value[name].as_str().unwrap_or_default().chars().take(200).collect::<String>();
    let number = |name: &str| value[name].as_u64().unwrap_or(0) as usize;
    match lock(&monitor.views).get_mut(&text("viewer")) {
        Some(view) => {
            view.text = text("text").to_lowercase();
            view.from = number("from");
            view.count = number("count").min(model::ROWS);
            view.task = value["task"].as_u64().filter(|&task| task > 0);
            view.relation = text("relation");
            view.facts_from = number("facts_from");
        }
        None => return plain(StatusCode::CONFLICT, "this viewer does not watch\n"),
    }
    monitor.looks.send_modify(|look| *look += 1);
    with(StatusCode::OK, "application/json", "{}")
}

/// Does what somebody of the role for it asks for.
///
/// # Errors
/// Why it was not done.
async fn act(monitor: &MonitorState, value: &Value) -> Result<(), String> {
    let sender = monitor.scope.sender();
    let task = || value["task"].as_u64().filter(|&n| n > 0).ok_or("it needs the number of a task");
    match value["action"].as_str().unwrap_or_default() {
        "abort" => sender.inbox().put(Incoming::Abort(task()?)),
        "pause" => sender.inbox().put(Incoming::Pause(true)),
        "continue" => sender.inbox().put(Incoming::Pause(false)),
        action @ ("suspend" | "resume") => {
            let number = Datum::integer(i64::try_from(task()?).unwrap_or(i64::MAX), Span::default());
            let suspends = if action == "suspend" { "T" } else { "NIL" };
            let suspends = match suspends {
                "T" => Datum::symbol(Symbol::cl("T"), Span::default()),
                _ => Datum::nil(Span::default()),
            };
            call(&sender, "%SESSION-SUSPEND", vec![number, suspends]).await?;
        }
        "signal" => {
            let name = value["input"].as_str().unwrap_or_default().to_uppercase();
            let data = codes_of(value["data"].as_str().unwrap_or_default())?;
            call(&sender, "%SESSION-SIGNAL", vec![Datum::string(&name, Span::default()), data]).await?;
        }
        _ => return Err("there is no such action".into()),
    }
    Ok(())
}

/// Calls a function of the library.
///
/// # Errors
/// The text of its failure.
async fn call(sender: &Sender, function: &str, arguments: Vec<Datum>) -> Result<(), String> {
    let function = FunctionRef::Named(format!("ESL::{function}"));
    let pending = sender.ask(Question::Call { function, arguments, is_urgent: true });
    match tokio::time::timeout(5 * PATIENCE, pending).await {
        Ok(Answer::Values(_)) => Ok(()),
        Ok(Answer::Failed { message, .. }) => Err(message),
        Ok(_) => Err("it was not done".into()),
        Err(_) => Err("the run has not done it yet".into()),
    }
}
