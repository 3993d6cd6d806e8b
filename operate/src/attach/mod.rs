//! Sessions of operators attached to a run: the server.
//!
//! The wire protocol is that of SLIME's server, SWANK: packets of forms, each request with a number, each
//! answer with that of its request. A request says what it needs by its role; one that only observes is
//! answered by a survey, all others come through the inbox of the machine as calls, aborts and signals.
//!
//! Guarantees: a connection over TCP says its secret before anything else is parsed, and soon, and until
//! then it takes the place of no session; a packet is bounded before it is read, and comes in a bounded
//! time; a session has a bounded number of requests under way, which end with it, and a bounded number of
//! bytes on their way to its peer.

pub(super) mod datum;
mod form;
#[cfg(any(test, fuzzing))]
pub(super) mod noise;
mod outbox;
mod packet;
mod request;
mod session;

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, SystemTime};

use esl::program::{TELL_OPERATOR, WRITE_OPERATOR};
use esl_bytecode::datum::{Datum, DatumKind};
use esl_host::{CallEffect, HostOperation};
use esl_vm::embed::HostFunction;
use esl_vm::vm::Vm;
use esl_world::{NoEventLoop, TlsIdentity};
use tokio::io::{AsyncRead, AsyncWrite, AsyncWriteExt};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, oneshot};

pub(super) use datum::codes_of;
pub use form::WireForm;
pub use packet::{read, write};

use super::lobby::{Lobby, notice_absence};
use super::refusal::OperatorRefusal;
use super::scope::RunScope;
use super::secrets::{OperatorRole, Secrets};
use outbox::{Outbox, Outboxes};
use packet::LARGEST;
use session::OperatorSession;

/// The name of `eslvm attach` in its greeting, by which it asks to be told how the run ends.
pub const CLIENT: &str = "eslvm attach";

/// Most sessions of one role at a time, so that sessions of one role cannot keep out those of another.
const SESSIONS: usize = 16;
/// Most requests of a session under way.
const UNDER_WAY: usize = 16;
/// Most bytes of the packet with a secret.
const SECRET: usize = 1000;
/// Time that a peer has to say its secret, and to begin TLS before that.
const INTRODUCTION: Duration = Duration::from_secs(5);
/// Time that a peer has for a packet once it has begun to send it, and to take one.
const PATIENCE: Duration = Duration::from_secs(60);
/// Time that a peer has to take what it is told last.
const FAREWELL: Duration = Duration::from_secs(5);

/// Where operators connect.
pub(super) enum Entrance {
    /// At a port, with a secret, and over TLS if there is an identity.
    Tcp(std::net::TcpListener, Secrets, Option<TlsIdentity>),
    /// At a path that only the owner of the process can open.
    #[cfg(unix)]
    Unix(std::os::unix::net::UnixListener),
}

/// Lets operators connect to the run of a machine.
///
/// # Errors
/// The reason, if there is no event loop.
pub(super) fn serve(
    machine: &mut Vm,
    entrance: Entrance,
    scope: RunScope,
) -> Result<SessionsHandle, NoEventLoop> {
    let outboxes = Outboxes::default();
    let known = outboxes.clone();
    let tell = move |arguments: &[Datum]| {
        if let Some((outbox, form)) = told(&known, arguments) {
            outbox.send_at_once(&form);
        }
        Ok(Datum::nil(Default::default()))
    };
    let (tell, local) = (HostFunction::AtOnce(Box::new(tell)), CallEffect::Local);
    machine.add_function_with(TELL_OPERATOR, tell, &[], local);
    let known = outboxes.clone();
    let write = move |operation: HostOperation| begin_writing(&known, operation);
    machine.add_function_with(WRITE_OPERATOR, HostFunction::Operation(Box::new(write)), &[], local);
    let places = OperatorRole::ALL.map(|_| Arc::new(Semaphore::new(SESSIONS)));
    let handle = SessionsHandle(outboxes.clone());
    let sessions = AtomicU64::new(first_session());
    let attendance = Attendance { scope, outboxes, sessions, places };
    esl_world::spawn(accept(entrance, Arc::new(attendance)))?;
    Ok(handle)
}

/// Returns a number below those of the sessions of this process. A run that goes on in it may have tasks that
/// speak to sessions of an earlier one.
fn first_session() -> u64 {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    since.map_or(0, |time| u64::try_from(time.as_micros()).unwrap_or(0))
}

/// The sessions of a run, for the thread that runs the machine.
pub(super) struct SessionsHandle(Outboxes);

impl SessionsHandle {
    /// Tells the peers that have asked for it how the run has ended.
    pub(super) fn end(&self, said: &str) {
        let packet = WireForm::list([WireForm::symbol(":run-ended"), WireForm::text(said)]);
        self.0.tell_end(&packet);
    }

    /// Returns whether all requests have been answered.
    pub(super) fn is_answered(&self) -> bool {
        self.0.are_answered()
    }

    /// Returns whether all packets have been taken.
    pub(super) fn is_told(&self) -> bool {
        self.0.are_empty()
    }
}

/// Returns the arguments of either function: the outbox of a session that still exists, and a packet.
fn told(outboxes: &Outboxes, arguments: &[Datum]) -> Option<(Outbox, WireForm)> {
    let [number, said] = arguments else { return None };
    let DatumKind::Integer(number) = number.kind() else { return None };
    let outbox = outboxes.of(u64::try_from(number).ok()?)?;
    let form = match said.kind() {
        DatumKind::String(text) => written(text),
        _ => datum::form_of(said),
    };
    Some((outbox, form))
}

/// Begins to send a packet; the operation ends when there was room for the packet, or when it is cancelled.
fn begin_writing(outboxes: &Outboxes, operation: HostOperation) {
    let Some((outbox, form)) = told(outboxes, operation.arguments()) else {
        return operation.complete(Vec::new());
    };
    let (cancel, cancelled) = oneshot::channel();
    operation.on_cancel(move || _ = cancel.send(()));
    let send = async move {
        tokio::select! {
            _ = outbox.send(&form) => {}
            // An error says that it cannot be cancelled any more, since the machine has ended.
            _ = cancelled => {}
        }
        operation.complete(Vec::new());
    };
    // Without the event loop the operation is dropped, which is how the program hears of it.
    _ = esl_world::spawn(send);
}

/// Returns the form that tells what was written.
fn written(text: &str) -> WireForm {
    // A form has a quotation mark or a backslash for each of its characters at worst.
    let end = text.char_indices().map(|(at, _)| at).find(|&at| at > LARGEST / 2 - 1000);
    let text = match end {
        Some(end) => format!("{}…\n", &text[..end]),
        None => text.to_string(),
    };
    WireForm::list([WireForm::symbol(":write-string"), WireForm::Text(text)])
}

/// Returns what is said in place of a form that no packet has room for.
fn too_large(form: &WireForm) -> WireForm {
    match form.items() {
        Some([kind, _, number]) if kind.name().as_deref() == Some(":return") => {
            answer(Err(OperatorRefusal::AnswerTooLarge), number.clone())
        }
        _ => written("; the output is too large to be sent\n"),
    }
}

/// The shared state of all sessions of a run.
struct Attendance {
    scope: RunScope,
    outboxes: Outboxes,
    /// Number of the last session.
    sessions: AtomicU64,
    /// Places for sessions, by the index of the role.
    places: [Arc<Semaphore>; OperatorRole::ALL.len()],
}

impl Attendance {
    /// Returns a place for a session of a role, if there is one.
    fn place(&self, role: OperatorRole) -> Option<OwnedSemaphorePermit> {
        self.places[role as usize].clone().try_acquire_owned().ok()
    }
}

async fn accept(entrance: Entrance, attendance: Arc<Attendance>) {
    // They have been made for this, so the event loop takes them.
    match entrance {
        Entrance::Tcp(listener, secrets, identity) => {
            let lobby = Lobby::default();
            let Ok(listener) = tokio::net::TcpListener::from_std(listener) else { return };
            loop {
                match listener.accept().await {
                    Ok((stream, address)) => {
                        drop(stream.set_nodelay(true));
                        notice_absence(&stream);
                        let visit = lobby.enter(address.ip());
                        let (attendance, secrets) = (attendance.clone(), secrets.clone());
                        let identity = identity.clone();
                        tokio::spawn(async move {
                            let introduce = async {
                                let (reader, writer): (PeerReader, PeerWriter) = match identity {
                                    None => {
                                        let (reader, writer) = stream.into_split();
                                        (Box::new(reader), Box::new(writer))
                                    }
                                    Some(identity) => {
                                        let (reader, writer) =
                                            tokio::io::split(identity.accept(stream).await?);
                                        (Box::new(reader), Box::new(writer))
                                    }
                                };
                                introduced(reader, writer, &secrets).await
                            };
                            let introduced = tokio::select! {
                                introduced = tokio::time::timeout(INTRODUCTION, introduce) => introduced,
                                // Others come, and it has said nothing.
                                () = visit.ended() => return,
                            };
                            visit.settle();
                            if let Ok(Ok((reader, writer, role))) = introduced {
                                drop(attend(reader, writer, role, &attendance).await);
                            }
                        });
                    }
                    Err(_) => tokio::time::sleep(Duration::from_millis(100)).await,
                }
            }
        }
        #[cfg(unix)]
        Entrance::Unix(listener) => {
            let Ok(listener) = tokio::net::UnixListener::from_std(listener) else { return };
            loop {
                match listener.accept().await {
                    Ok((stream, _)) => {
                        let attendance = attendance.clone();
                        let (reader, writer) = stream.into_split();
                        tokio::spawn(async move {
                            drop(attend(reader, writer, OperatorRole::Patch, &attendance).await);
                        });
                    }
                    Err(_) => tokio::time::sleep(Duration::from_millis(100)).await,
                }
            }
        }
    }
}

/// The two directions of a connection.
type PeerReader = Box<dyn AsyncRead + Unpin + Send>;
type PeerWriter = Box<dyn AsyncWrite + Unpin + Send>;

/// Returns a connection with the role that its peer has by the secret that it says.
///
/// # Errors
/// The reason why the connection ends.
async fn introduced(
    mut reader: PeerReader,
    writer: PeerWriter,
    secrets: &Secrets,
) -> io::Result<(PeerReader, PeerWriter, OperatorRole)> {
    let said = packet::read_async(&mut reader, SECRET).await?;
    // SLIME sends it as it is, others as a string.
    let form = WireForm::parse(&said).ok();
    let text = form.as_ref().and_then(WireForm::as_text).unwrap_or(said.trim_end());
    let role = secrets.role_of(text.as_bytes()).ok_or(io::ErrorKind::PermissionDenied)?;
    Ok((reader, writer, role))
}

/// Serves one connection, whose peer has a role, to its end.
///
/// # Errors
/// The reason why the connection ends.
async fn attend(
    mut reader: impl AsyncRead + Unpin,
    mut writer: impl AsyncWrite + Unpin + Send + 'static,
    role: OperatorRole,
    attendance: &Attendance,
) -> io::Result<()> {
    let Some(_place) = attendance.place(role) else {
        let reason = OperatorRefusal::TooManySessions { role, most: SESSIONS };
        let refusal = [WireForm::symbol(":refused"), WireForm::text(reason.to_string())];
        let packet = packet::packet(&WireForm::list(refusal)).unwrap_or_default();
        return tokio::time::timeout(FAREWELL, async {
            writer.write_all(&packet).await?;
            writer.shutdown().await
        })
        .await?;
    };
    let (outbox, mut taken) = Outbox::new();
    let number = attendance.sessions.fetch_add(1, Ordering::Relaxed) + 1;
    attendance.outboxes.enter(number, outbox.clone());
    let write = tokio::spawn(async move {
        while let Some(packet) = taken.recv().await {
            // A peer that does not read is disconnected.
            match tokio::time::timeout(PATIENCE, writer.write_all(&packet.bytes)).await {
                Ok(Ok(())) => {}
                _ => break,
            }
        }
        drop(taken);
        drop(tokio::time::timeout(FAREWELL, writer.shutdown()).await);
    });
    let session = Arc::new(OperatorSession::new(number, role, attendance.scope.clone()));
    let ended = take_requests(&mut reader, &session, &outbox).await;
    attendance.outboxes.remove(number);
    session.end();
    drop(outbox);
    // Requests under way end with the session, and then there is nothing more to write.
    let stop = write.abort_handle();
    if tokio::time::timeout(FAREWELL, write).await.is_err() {
        stop.abort();
    }
    ended
}

/// Takes requests until the connection ends.
///
/// # Errors
/// The reason why it ends.
async fn take_requests(
    reader: &mut (impl AsyncRead + Unpin),
    session: &Arc<OperatorSession>,
    outbox: &Outbox,
) -> io::Result<()> {
    loop {
        let text = tokio::select! {
            text = packet::read_in_time(reader, LARGEST, PATIENCE) => text?,
            // The peer reads no answers any more.
            () = outbox.closed() => return Ok(()),
        };
        let request = match WireForm::parse(&text) {
            Ok(request) => request,
            Err(reason) => {
                let reason = WireForm::list([WireForm::symbol(":invalid"), WireForm::text(reason)]);
                _ = outbox.send(&reason).await;
                continue;
            }
        };
        let items = request.items().unwrap_or_default();
        match items.first().and_then(WireForm::name).as_deref() {
            Some(":emacs-rex") if items.len() >= 5 => {
                let [form, package, thread, number] = [1, 2, 3, 4].map(|index| items[index].clone());
                if form.items().is_some_and(|items| items.last().and_then(WireForm::as_text) == Some(CLIENT))
                {
                    outbox.note_hears_end();
                }
                let Some(permit) = outbox.begin_request() else {
                    let refusal = answer(Err(OperatorRefusal::TooManyRequests), number);
                    _ = outbox.send(&refusal).await;
                    continue;
                };
                let (session, outbox) = (session.clone(), outbox.clone());
                tokio::spawn(async move {
                    let result = session.perform(&form, &package, &thread).await;
                    // The report of the run's end replaces this answer for a peer that gets one.
                    if !(matches!(result, Err(OperatorRefusal::Ended)) && outbox.hears_end()) {
                        _ = outbox.send(&answer(result, number)).await;
                    }
                    drop(permit);
                });
            }
            Some(":emacs-interrupt") => session.interrupt(),
            Some(":emacs-return" | ":emacs-return-string") => {
                if let [_, thread, _, WireForm::Text(text)] = items {
                    session.typed(thread, text);
                }
            }
            // Nothing here waits for these.
            Some(":emacs-pong" | ":emacs-channel-send") => {}
            Some(":ping") => {
                let pong = items.iter().skip(1).cloned();
                let pong = WireForm::list([WireForm::symbol(":emacs-pong")].into_iter().chain(pong));
                _ = outbox.send(&pong).await;
            }
            _ => {
                let reason =
                    WireForm::list([WireForm::symbol(":invalid"), WireForm::text("it is not a request")]);
                _ = outbox.send(&reason).await;
            }
        }
    }
}

/// Returns the answer to the request with this number.
fn answer(result: Result<WireForm, OperatorRefusal>, number: WireForm) -> WireForm {
    let result = match result {
        Ok(value) => WireForm::list([WireForm::symbol(":ok"), value]),
        Err(reason) => WireForm::list([WireForm::symbol(":abort"), WireForm::Text(reason.to_string())]),
    };
    WireForm::list([WireForm::symbol(":return"), result, number])
}
