//! Sessions of Zenoh, and the thread of each that hands things over to the network.
//!
//! A thread of its own does in order all that a program asks of an open session, since Zenoh has a sender
//! wait while the network takes nothing. [`MOST_REQUESTS`] wait for that thread; the next operation waits for
//! room.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use esl_host::{HostFailure, HostInput, HostObject, IntoDatum, Keyword, Sender};
use tokio::sync::{mpsc, oneshot};
use zenoh::Wait;
use zenoh::sample::SampleKind;

use super::config::SessionConfig;
use super::delivery::InputDelivery;
use super::runtime::{in_background, on_zenoh};
use super::zenoh_failure;

/// Most requests that wait for the thread of a session.
const MOST_REQUESTS: usize = 1000;

/// A request of the program's.
type SessionRequest = Box<dyn FnOnce() + Send>;

/// Hands requests to the thread of a session.
#[derive(Clone)]
pub(crate) struct Requests(mpsc::Sender<Option<SessionRequest>>);

fn closed() -> HostFailure {
    HostFailure::new("SESSION-CLOSED", "the session is closed")
}

impl Requests {
    /// Begins the thread.
    fn begin() -> Result<Requests, HostFailure> {
        let (requests, mut next) = mpsc::channel::<Option<SessionRequest>>(MOST_REQUESTS);
        let work = move || {
            while let Some(Some(request)) = next.blocking_recv() {
                request();
            }
        };
        std::thread::Builder::new().name("zenoh-out".into()).spawn(work).map_err(zenoh_failure)?;
        Ok(Requests(requests))
    }

    /// Has `request` done. Waits until there is room for it, not until it is done.
    ///
    /// # Errors
    /// `:session-closed`.
    pub(crate) async fn put(&self, request: impl FnOnce() + Send + 'static) -> Result<(), HostFailure> {
        self.0.send(Some(Box::new(request))).await.map_err(|_| closed())
    }

    /// Has `request` done, if there is room for it.
    pub(crate) fn try_put(&self, request: impl FnOnce() + Send + 'static) {
        // Without room the peer misses what it would miss by a lost connection.
        _ = self.0.try_send(Some(Box::new(request)));
    }

    /// Has `request` done, and waits for its result.
    ///
    /// # Errors
    /// `:session-closed`.
    pub(crate) async fn call<T: Send + 'static>(
        &self,
        request: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, HostFailure> {
        let (answer, result) = oneshot::channel();
        // The call may have been left.
        self.put(move || _ = answer.send(request())).await?;
        result.await.map_err(|_| closed())
    }

    async fn end(&self) {
        // The thread may have ended.
        _ = self.0.send(None).await;
    }
}

/// An open session.
pub(crate) struct OpenSession {
    session: zenoh::Session,
    requests: Requests,
    /// Keeps a program that waits for an input from being deadlocked.
    _sender: Sender,
    events: Arc<InputDelivery>,
}

impl OpenSession {
    pub(crate) fn zenoh(&self) -> zenoh::Session {
        self.session.clone()
    }

    pub(crate) fn requests(&self) -> &Requests {
        &self.requests
    }

    /// Has `request` done with the session, and waits for its result.
    pub(crate) async fn call<T: Send + 'static>(
        &self,
        request: impl FnOnce(&zenoh::Session) -> zenoh::Result<T> + Send + 'static,
    ) -> Result<T, HostFailure> {
        let session = self.session.clone();
        self.requests.call(move || request(&session)).await?.map_err(zenoh_failure)
    }
}

impl Drop for OpenSession {
    fn drop(&mut self) {
        self.events.end();
        let (session, requests) = (self.session.clone(), self.requests.clone());
        in_background(async move {
            requests.end().await;
            // It may be closed already.
            _ = session.close().await;
        });
    }
}

enum SessionState {
    New(Box<SessionConfig>),
    Open(Arc<OpenSession>),
    Closed,
}

/// A session of the program's.
pub(crate) struct ZenohSession(Mutex<SessionState>);

impl HostObject for ZenohSession {
    const KIND: &'static str = "ZENOH-SESSION";
}

impl Default for ZenohSession {
    fn default() -> ZenohSession {
        ZenohSession(Mutex::new(SessionState::New(Box::default())))
    }
}

impl ZenohSession {
    fn lock(&self) -> MutexGuard<'_, SessionState> {
        // It is whole at every moment, so a panic elsewhere does not corrupt it.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the open session.
    ///
    /// # Errors
    /// `:session-closed`.
    pub(crate) fn get(&self) -> Result<Arc<OpenSession>, HostFailure> {
        match &*self.lock() {
            SessionState::Open(session) => Ok(session.clone()),
            _ => Err(closed()),
        }
    }

    /// Changes the configuration of a session that is not open.
    ///
    /// # Errors
    /// `:zenoh-error`, if it is.
    pub(crate) fn configure<T>(
        &self,
        change: impl FnOnce(&mut SessionConfig) -> Result<T, HostFailure>,
    ) -> Result<T, HostFailure> {
        match &mut *self.lock() {
            SessionState::New(config) => change(config),
            _ => Err(zenoh_failure("the session is open already")),
        }
    }

    /// Opens the session. `input` is signalled when a connection is made or lost.
    ///
    /// # Errors
    /// `:connection-refused`, if a client reaches no session; `:address-in-use`; `:zenoh-error`.
    pub(crate) async fn open(
        &self,
        mode: Option<String>,
        milliseconds: u64,
        input: HostInput,
        sender: Sender,
    ) -> Result<(), HostFailure> {
        let config = self.configure(|config| {
            config.set_mode(mode.as_deref())?;
            Ok(config.clone())
        })?;
        let peers = config.peers();
        let config = config.finish(milliseconds)?;
        let session = on_zenoh(async move { zenoh::open(config).await }).await?;
        let session = session.map_err(|error| opening_failure(&error.to_string(), &peers))?;
        let open = Arc::new(OpenSession {
            session,
            requests: Requests::begin()?,
            _sender: sender,
            events: InputDelivery::begin(input)?,
        });
        let events = open.events.clone();
        let listen = move |session: &zenoh::Session| {
            let info = session.info();
            let listener = info.transport_events_listener().history(true);
            let connections = Mutex::new(BTreeMap::<String, usize>::new());
            listener
                .callback(move |event| {
                    let peer = event.transport().zid().to_string();
                    let mut connections = connections.lock().unwrap_or_else(PoisonError::into_inner);
                    let count = connections.entry(peer.clone()).or_default();
                    // There may be two to one peer.
                    let kind = match (event.kind(), *count) {
                        (SampleKind::Put, before) => {
                            *count += 1;
                            if before > 0 {
                                return;
                            }
                            "CONNECTED"
                        }
                        (SampleKind::Delete, 2..) => {
                            *count -= 1;
                            return;
                        }
                        (SampleKind::Delete, _) => {
                            connections.remove(&peer);
                            "LOST"
                        }
                    };
                    let role = event.transport().whatami().to_string();
                    let arguments = || vec![Keyword(kind).into_datum(), peer.into_datum(), role.into_datum()];
                    events.put(0, arguments);
                })
                .background()
                .wait()
        };
        open.call(listen).await?;
        *self.lock() = SessionState::Open(open);
        Ok(())
    }

    /// Closes the session, when what was asked for before is handed over.
    pub(crate) async fn close(&self) -> Result<(), HostFailure> {
        let state = std::mem::replace(&mut *self.lock(), SessionState::Closed);
        if let SessionState::Open(open) = state {
            open.requests.end().await;
            let session = open.session.clone();
            drop(open);
            on_zenoh(async move { session.close().await }).await?.map_err(zenoh_failure)?;
        }
        Ok(())
    }
}

/// Returns the failure for a session that cannot be opened, and is to connect to these `peers`.
fn opening_failure(reason: &str, peers: &str) -> HostFailure {
    if reason.contains("nable to connect") {
        let text = format!(
            "no session of Zenoh answers at {peers}: start one there, such as the router of rmw_zenoh, or wait \
             for it by :timeout{}",
            if peers.contains("tls/") {
                "; by TLS, each side has to accept the certificate of the other"
            } else {
                ""
            }
        );
        return HostFailure::new("CONNECTION-REFUSED", text);
    }
    let is_in_use = reason.contains("ddress already in use");
    HostFailure::new(if is_in_use { "ADDRESS-IN-USE" } else { "ZENOH-ERROR" }, short(reason))
}

/// Returns a message of Zenoh's without the places in its sources.
pub(super) fn short(reason: &str) -> String {
    let reason = reason.lines().next().unwrap_or_default();
    reason.split(" at /").next().unwrap_or(reason).trim_end_matches('.').to_owned()
}
