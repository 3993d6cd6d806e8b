//! The monitor: one page, which shows a run as it goes on.
//!
//! The page asks for nothing but itself and what this server sends. The state of the run comes as server-sent
//! events; commands go the other way as posts. The token is in the fragment of the address of the page, which
//! no browser sends; the page puts it into its requests.
//!
//! Without viewers the run is not surveyed. Each survey covers a bounded number of tasks. A viewer that does
//! not read its events is disconnected.

mod model;
mod pictures;
mod request;

use std::collections::{BTreeMap, BTreeSet};
use std::net::TcpListener;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use bytes::Bytes;
use esl_bytecode::datum::Datum;
use esl_host::{Answer, FrameVariable, FunctionRef, Incoming, Question, Sender, Survey, SurveyRequest};
use esl_world::{NoEventLoop, TlsIdentity};
use http_body_util::{BodyExt, Channel, Limited};
use hyper::header::{CONTENT_SECURITY_POLICY, HeaderValue, REFERRER_POLICY};
use hyper::{Request, Response, StatusCode};
use serde_json::{Value, json};
use tokio::sync::{Notify, OnceCell, watch};

use super::attach::datum::{boolean, integer, string};
use super::http::{self, HttpBody, plain, with};
use super::lobby::{Lobby, LobbyVisit};
use super::refusal::OperatorRefusal;
use super::scope::RunScope;
use super::secrets::{OperatorRole, Secrets};
use super::{MissionPicture, RunEnd};
use model::{MissionView, RunModel, ViewerView};
use pictures::PictureBook;
use request::{Admitted, MonitorCommand, MonitorRequest, admit, parse};

/// The page; `NONCE` stands for what its script and its style are marked with.
const PAGE: &str = include_str!("page.html");
/// Time between two surveys of the run.
const PERIOD: Duration = Duration::from_millis(250);
/// Tasks that one survey reports, beside those that viewers see.
const PAGE_OF_TASKS: usize = 2000;
/// Most viewers of one role.
const VIEWERS: usize = 8;
/// Time that a viewer has to take what is sent.
const PATIENCE: Duration = Duration::from_secs(2);
/// Most bytes of a post.
const POST: usize = 64 << 10;

/// The shared state of all viewers.
struct MonitorState {
    scope: RunScope,
    secrets: Secrets,
    /// The beginning of the origin of its own page.
    scheme: &'static str,
    model: Mutex<RunModel>,
    views: Mutex<BTreeMap<String, ViewerView>>,
    pictures: PictureBook,
    /// The picture of the program, and what draws it.
    mission: (Option<MissionPicture>, OnceCell<Option<String>>),
    /// Notified when a viewer comes.
    coming: Notify,
    /// Changes with each survey.
    updates: watch::Sender<u64>,
    /// Name of the program.
    program: String,
    /// How the run has ended, once it has.
    end: Mutex<Option<RunEnd>>,
    /// The connections.
    lobby: Lobby,
}

/// The monitor of a run, for the thread that runs the machine.
pub(super) struct MonitorHandle(Arc<MonitorState>);

impl MonitorHandle {
    /// Has viewers told how the run has ended, and what a last survey has shown.
    pub(super) fn end(&self, end: RunEnd, last: Survey) {
        lock(&self.0.model).take_last(last);
        *lock(&self.0.end) = Some(end);
        self.0.updates.send_modify(|count| *count += 1);
    }

    /// Returns whether all viewers have been told, so that their connections have ended.
    pub(super) fn is_told(&self) -> bool {
        self.0.lobby.settled() == 0
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // The guarded data are consistent at every moment, so a panic elsewhere does not corrupt them.
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
    program: String,
    mission: Option<MissionPicture>,
) -> Result<MonitorHandle, NoEventLoop> {
    let is_secured = identity.is_some();
    let monitor = Arc::new(MonitorState {
        scope,
        secrets,
        scheme: if is_secured { "https://" } else { "http://" },
        model: Mutex::default(),
        views: Mutex::default(),
        pictures: PictureBook::default(),
        mission: (mission, OnceCell::new()),
        coming: Notify::new(),
        updates: watch::Sender::new(0),
        program,
        end: Mutex::default(),
        lobby: Lobby::default(),
    });
    esl_world::spawn(survey_for_viewers(monitor.clone()))?;
    let handle = MonitorHandle(monitor.clone());
    let lobby = monitor.lobby.clone();
    http::serve(listener, identity, lobby, move |request, visit| answer(monitor.clone(), request, visit))?;
    Ok(handle)
}

/// Surveys the run periodically while there are viewers.
async fn survey_for_viewers(monitor: Arc<MonitorState>) {
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
        monitor.updates.send_modify(|count| *count += 1);
        tokio::time::sleep(PERIOD).await;
    }
}

/// Returns the picture of the program, which is drawn at the first request.
async fn drawn(monitor: &MonitorState) -> Option<&String> {
    let (picture, known) = &monitor.mission;
    let draw = async || {
        let picture = picture.clone()?;
        tokio::task::spawn_blocking(move || (picture.0)()).await.ok().flatten()
    };
    known.get_or_init(draw).await.as_ref()
}

async fn answer(
    monitor: Arc<MonitorState>,
    request: Request<hyper::body::Incoming>,
    visit: LobbyVisit,
) -> Response<HttpBody> {
    let (head, body) = request.into_parts();
    let (role, is_view) = match admit(&monitor.secrets, monitor.scheme, &head) {
        Err((status, text)) => return plain(status, text),
        Ok(Admitted::Page) => return page(),
        Ok(Admitted::Viewer(role, viewer)) => return events(monitor, role, &viewer, &visit),
        Ok(Admitted::Post { role, is_view }) => (role, is_view),
    };
    let body = tokio::time::timeout(PATIENCE, Limited::new(body, POST).collect()).await;
    let Ok(Ok(body)) = body else {
        return plain(StatusCode::PAYLOAD_TOO_LARGE, "the request is too large, or comes too slowly\n");
    };
    match parse(role, is_view, &body.to_bytes()) {
        Err((status, text)) => plain(status, text),
        Ok(MonitorRequest::View { viewer, view }) => set_view(&monitor, &viewer, view),
        Ok(MonitorRequest::Command(command)) => {
            let done = match command {
                Ok(command) => act(&monitor, command).await,
                Err(reason) => Err(reason),
            };
            let (status, text) = match done {
                Ok(()) => (StatusCode::OK, json!({ "ok": true })),
                Err(reason) => (StatusCode::CONFLICT, json!({ "ok": false, "reason": reason.to_string() })),
            };
            with(status, "application/json", text.to_string())
        }
    }
}

/// Takes bytes as those of a connection, and parses its requests; performs none. Returns the number of
/// requests that were understood.
#[cfg(any(test, fuzzing))]
pub(super) fn understand(secrets: &Secrets, bytes: &[u8]) -> usize {
    crate::noise::http::understand(bytes, |head, body| match admit(secrets, "http://", head) {
        Ok(Admitted::Post { role, is_view }) => parse(role, is_view, body).is_ok(),
        admitted => admitted.is_ok(),
    })
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

/// Sends a viewer what is seen, until it goes.
fn events(
    monitor: Arc<MonitorState>,
    role: OperatorRole,
    viewer: &str,
    visit: &LobbyVisit,
) -> Response<HttpBody> {
    let coming = {
        let mut views = lock(&monitor.views);
        let of_role = views.iter().filter(|(name, view)| view.role == Some(role) && *name != viewer).count();
        if of_role >= VIEWERS {
            return plain(StatusCode::SERVICE_UNAVAILABLE, "there are too many viewers\n");
        }
        // A viewer that connects again gets everything anew, and its last connection ends.
        let coming = views.get(viewer).map_or(0, |view| view.coming) + 1;
        views.insert(
            viewer.into(),
            ViewerView { count: model::ROWS, coming, role: Some(role), ..ViewerView::default() },
        );
        coming
    };
    // Viewers are counted by themselves.
    visit.settle();
    monitor.coming.notify_one();
    let (mut sender, body) = Channel::<Bytes, std::convert::Infallible>::new(1);
    let watching = Watching { monitor: monitor.clone(), viewer: viewer.into(), coming };
    let visit = visit.clone();
    tokio::spawn(async move {
        let _watching = &watching;
        // A viewer that may signal keeps a waiting run from ending as deadlocked.
        let _sender = (role >= OperatorRole::Command).then(|| monitor.scope.sender());
        let mut updates = monitor.updates.subscribe();
        loop {
            let end = lock(&monitor.end).clone();
            let Some(mut message) = message(&watching, role, end.is_none()).await else { return };
            if let Some(end) = &end {
                message["ended"] = json!({ "status": end.status, "said": end.said, "report": end.report });
            }
            let event = Bytes::from(format!("data: {message}\n\n"));
            match tokio::time::timeout(PATIENCE, sender.send_data(event)).await {
                Ok(Ok(())) => {}
                _ => return visit.hang_up(),
            }
            if end.is_some() {
                return;
            }
            if updates.changed().await.is_err() {
                return;
            }
        }
    });
    let mut response = Response::new(body.boxed());
    let headers = response.headers_mut();
    headers.insert(hyper::header::CONTENT_TYPE, HeaderValue::from_static("text/event-stream"));
    headers.insert(hyper::header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    // There is nothing else to ask for over it.
    headers.insert(hyper::header::CONNECTION, HeaderValue::from_static("close"));
    response
}

/// A connected viewer; dropped when it disconnects.
struct Watching {
    monitor: Arc<MonitorState>,
    viewer: String,
    /// How often a viewer of this name had come then.
    coming: u64,
}

impl Drop for Watching {
    fn drop(&mut self) {
        let mut views = lock(&self.monitor.views);
        if views.get(&self.viewer).is_some_and(|view| view.coming == self.coming) {
            views.remove(&self.viewer);
        }
    }
}

/// Returns what a viewer is told now, with what only the machine can say if `asks_more`; `None` if the viewer
/// has gone.
async fn message(watching: &Watching, role: OperatorRole, asks_more: bool) -> Option<Value> {
    let Watching { monitor, viewer, coming } = watching;
    let view = lock(&monitor.views).get(viewer).filter(|view| view.coming == *coming)?.clone();
    let request = SurveyRequest {
        named: view.task.into_iter().collect(),
        frames_of: view.task,
        facts: (!view.relation.is_empty()).then(|| (view.relation.clone(), view.facts_from)),
        ..SurveyRequest::default()
    };
    let needs_more = asks_more && (view.task.is_some() || !view.relation.is_empty());
    let more = if needs_more { monitor.scope.survey(request).await } else { None };
    let (mut message, latest, is_paused) = {
        let model = lock(&monitor.model);
        (model.message(&view), model.latest_failure(), model.is_paused())
    };
    if view.mission != MissionView::None {
        let picture = drawn(monitor).await;
        let is_wanted = view.mission == MissionView::All;
        message["mission"] = json!({
            "tasks": lock(&monitor.model).activity(),
            "svg": picture.filter(|_| is_wanted),
            "drawn": picture.is_some(),
        });
    }
    if asks_more && view.has_pictures && !is_paused {
        message["pictures"] = monitor.pictures.latest(&monitor.scope.sender()).await;
    }
    if let Some(view) = lock(&monitor.views).get_mut(viewer).filter(|view| view.coming == *coming) {
        view.failure = latest;
    }
    message["role"] = role.name().into();
    message["program"] = monitor.program.as_str().into();
    if let Some(more) = more {
        message["task"] = match (view.task, more.tasks.first()) {
            (Some(_), Some(row)) => json!({
                "n": row.number, "name": row.name, "waits": row.waits_for, "ticks": row.ticks, "maker": row.maker, "ends": row.ends_at.map(|time| time as f64 / 1e9),
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
fn set_view(monitor: &MonitorState, viewer: &str, wanted: ViewerView) -> Response<HttpBody> {
    match lock(&monitor.views).get_mut(viewer) {
        // The failures that it has been shown, and its identity, are not the viewer's choice.
        Some(view) => {
            *view = ViewerView { failure: view.failure, coming: view.coming, role: view.role, ..wanted }
        }
        None => return plain(StatusCode::CONFLICT, "this viewer does not watch\n"),
    }
    monitor.updates.send_modify(|count| *count += 1);
    with(StatusCode::OK, "application/json", "{}")
}

/// Carries out a command of a viewer whose role permits it.
///
/// # Errors
/// Why it was not done.
async fn act(monitor: &MonitorState, command: MonitorCommand) -> Result<(), OperatorRefusal> {
    let sender = monitor.scope.sender();
    match command {
        MonitorCommand::Abort(task) => sender.inbox().put(Incoming::Abort(task)),
        MonitorCommand::Pause(pauses) => sender.inbox().put(Incoming::Pause(pauses)),
        MonitorCommand::Suspend(task, suspends) => {
            let number = i64::try_from(task).unwrap_or(i64::MAX);
            call(&sender, "%SESSION-SUSPEND", vec![integer(number), boolean(suspends)]).await?;
        }
        MonitorCommand::Signal(name, data) => {
            call(&sender, "%SESSION-SIGNAL", vec![string(&name), data]).await?;
        }
    }
    Ok(())
}

/// Calls a function of the library.
///
/// # Errors
/// Its failure, or that it was not done.
async fn call(sender: &Sender, function: &str, arguments: Vec<Datum>) -> Result<(), OperatorRefusal> {
    let function = FunctionRef::Named(format!("ESL::{function}"));
    let pending = sender.ask(Question::Call { function, arguments, goes_first: true });
    match tokio::time::timeout(5 * PATIENCE, pending).await {
        Ok(Answer::Values(_)) => Ok(()),
        Ok(Answer::Failed { message, .. }) => Err(OperatorRefusal::Failed(message)),
        Ok(_) => Err(OperatorRefusal::NotDone),
        Err(_) => Err(OperatorRefusal::Late),
    }
}
