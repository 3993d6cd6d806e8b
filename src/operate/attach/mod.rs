//! Sessions of operators who are attached to a run: the server.
//!
//! The wire protocol is that of SLIME's server, SWANK: packets of forms, each request with a number, each
//! answer with that of its request. A request says what it needs by its role; one that only looks is answered
//! by a survey, all others come through the inbox of the machine as calls, aborts and signals.
//!
//! Guarantees: a connection over TCP says its secret before anything else is parsed; a packet is bounded
//! before it is read; a session has a bounded number of requests under way, and they end with it.

pub(super) mod datum;
mod form;
mod packet;
mod request;
mod session;

use std::collections::HashMap;
use std::io;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use esl_bytecode::datum::DatumKind;
use esl_vm::embed::HostFunction;
use esl_vm::vm::Vm;
use esl_world::{NoEventLoop, TlsIdentity};
use tokio::io::{AsyncRead, AsyncWrite, AsyncWriteExt};
use tokio::sync::{Semaphore, mpsc};

pub(super) use datum::codes_of;
pub(crate) use form::WireForm;
pub(crate) use packet::{read, write};

use super::refusal::OperatorRefusal;
use super::scope::RunScope;
use super::secrets::{OperatorRole, Secrets};
use packet::LARGEST;
use session::OperatorSession;

/// Most sessions at a time.
const SESSIONS: usize = 32;
/// Most requests of a session under way.
const UNDER_WAY: usize = 16;
/// Most bytes of the packet with a secret.
const SECRET: usize = 1000;
/// Time that a peer has to say its secret, and to take a packet.
const PATIENCE: Duration = Duration::from_secs(10);
/// Packets on their way to a peer.
const WAITING: usize = 256;

/// Where the output of sessions goes, by their numbers.
#[derive(Clone, Default)]
struct SessionOutputs(Arc<Mutex<HashMap<u64, mpsc::Sender<WireForm>>>>);

impl SessionOutputs {
    fn table(&self) -> MutexGuard<'_, HashMap<u64, mpsc::Sender<WireForm>>> {
        // The table is whole at every moment, so a panic elsewhere does not corrupt it.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

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
pub(super) fn serve(machine: &mut Vm, door: Entrance, scope: RunScope) -> Result<(), NoEventLoop> {
    let outputs = SessionOutputs::default();
    let told = outputs.clone();
    let tell = move |arguments: &[esl_bytecode::datum::Datum]| {
        if let [number, said] = arguments
            && let DatumKind::Integer(number) = number.kind()
            && let Ok(number) = u64::try_from(number.clone())
            && let Some(output) = told.table().get(&number)
        {
            let packet = match said.kind() {
                DatumKind::String(text) => written(text),
                _ => datum::form_of(said),
            };
            // Who does not read loses what is written.
            drop(output.try_send(packet));
        }
        Ok(esl_bytecode::datum::Datum::nil(Default::default()))
    };
    machine.add_host_function(TELL, HostFunction::AtOnce(Box::new(tell)));
    esl_world::spawn(accept(door, Arc::new(Attendance { scope, outputs, sessions: AtomicU64::new(0) })))
}

/// Name of the function by which the library tells operators what was written.
const TELL: &str = "%TELL-OPERATOR";

/// Gives a machine that nobody attends the function by which the library tells operators something.
pub(crate) fn install_nobody(machine: &mut Vm) {
    let ignore = |_: &[esl_bytecode::datum::Datum]| Ok(esl_bytecode::datum::Datum::nil(Default::default()));
    machine.add_host_function(TELL, HostFunction::AtOnce(Box::new(ignore)));
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
        _ => written("; what was to be told is too large\n"),
    }
}

/// What all sessions of a run share.
struct Attendance {
    scope: RunScope,
    outputs: SessionOutputs,
    /// Number of sessions so far.
    sessions: AtomicU64,
}

async fn accept(door: Entrance, attendance: Arc<Attendance>) {
    let room = Arc::new(Semaphore::new(SESSIONS));
    // They have been made for this, so the event loop takes them.
    match door {
        Entrance::Tcp(listener, secrets, identity) => {
            let Ok(listener) = tokio::net::TcpListener::from_std(listener) else { return };
            loop {
                let Ok(permit) = room.clone().acquire_owned().await else { return };
                match listener.accept().await {
                    Ok((stream, _)) => {
                        let (attendance, secrets) = (attendance.clone(), Some(secrets.clone()));
                        let identity = identity.clone();
                        drop(stream.set_nodelay(true));
                        tokio::spawn(async move {
                            if let Some(identity) = identity {
                                // Who does not speak TLS is let go.
                                let secured = tokio::time::timeout(PATIENCE, identity.accept(stream)).await;
                                if let Ok(Ok(stream)) = secured {
                                    let (reader, writer) = tokio::io::split(stream);
                                    drop(attend(reader, writer, secrets, &attendance).await);
                                }
                            } else {
                                let (reader, writer) = stream.into_split();
                                drop(attend(reader, writer, secrets, &attendance).await);
                            }
                            drop(permit);
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
                let Ok(permit) = room.clone().acquire_owned().await else { return };
                match listener.accept().await {
                    Ok((stream, _)) => {
                        let attendance = attendance.clone();
                        let (reader, writer) = stream.into_split();
                        tokio::spawn(async move {
                            drop(attend(reader, writer, None, &attendance).await);
                            drop(permit);
                        });
                    }
                    Err(_) => tokio::time::sleep(Duration::from_millis(100)).await,
                }
            }
        }
    }
}

/// Serves one connection to its end. With `secrets`, the peer says one of them first.
///
/// # Errors
/// What ends the connection.
async fn attend(
    mut reader: impl AsyncRead + Unpin,
    mut writer: impl AsyncWrite + Unpin + Send + 'static,
    secrets: Option<Secrets>,
    attendance: &Attendance,
) -> io::Result<()> {
    let role = match secrets {
        None => OperatorRole::Patch,
        Some(secrets) => {
            let said = tokio::time::timeout(PATIENCE, packet::read_async(&mut reader, SECRET)).await??;
            // SLIME sends it as it is, others as a string.
            let form = WireForm::parse(&said).ok();
            let text = form.as_ref().and_then(WireForm::as_text).unwrap_or(said.trim_end());
            let role = secrets.role_of(text.as_bytes());
            let Some(role) = role else { return Err(io::ErrorKind::PermissionDenied.into()) };
            role
        }
    };
    let (answers, mut waiting) = mpsc::channel::<WireForm>(WAITING);
    let number = attendance.sessions.fetch_add(1, Ordering::Relaxed) + 1;
    attendance.outputs.table().insert(number, answers.clone());
    let write = tokio::spawn(async move {
        while let Some(form) = waiting.recv().await {
            let packet = packet::packet(&form).or_else(|| packet::packet(&too_large(&form)));
            let packet = packet.unwrap_or_default();
            // Who takes nothing is let go.
            match tokio::time::timeout(PATIENCE, writer.write_all(&packet)).await {
                Ok(Ok(())) => {}
                _ => break,
            }
        }
        drop(writer.shutdown().await);
    });
    let session = Arc::new(OperatorSession::new(number, role, attendance.scope.clone()));
    let ended = take_requests(&mut reader, &session, &answers).await;
    attendance.outputs.table().remove(&number);
    session.end();
    drop(answers);
    // What is under way ends with the session, and then there is nothing more to write.
    drop(tokio::time::timeout(PATIENCE, write).await);
    ended
}

/// Takes bytes as those that come over a connection: a secret, and requests, of which none is done. Returns
/// the number of those that were understood.
pub(super) fn understand(secrets: &Secrets, bytes: &[u8]) -> usize {
    let mut rest = bytes;
    let Some(said) = packet::taken(&mut rest, SECRET) else { return 0 };
    let form = WireForm::parse(&said).ok();
    let text = form.as_ref().and_then(WireForm::as_text).unwrap_or(said.trim_end());
    let mut understood = usize::from(secrets.role_of(text.as_bytes()).is_some());
    while let Some(text) = packet::taken(&mut rest, LARGEST) {
        let Ok(request) = WireForm::parse(&text) else { continue };
        assert_eq!(WireForm::parse(&request.to_string()).as_ref(), Ok(&request), "what is written is read");
        let items = request.items().unwrap_or_default();
        let form = items.get(1).and_then(WireForm::items).unwrap_or_default();
        let name = form.first().and_then(WireForm::name).unwrap_or_default();
        let arguments = form.get(1..).unwrap_or_default();
        let is_known = OperatorSession::role_for(&name).is_some();
        understood +=
            usize::from(is_known && super::slime::step(&name, arguments).is_none_or(|step| step.1.is_ok()));
        for data in arguments.iter().filter_map(WireForm::as_text).filter_map(|text| codes_of(text).ok()) {
            drop(datum::form_of(&data));
        }
    }
    understood
}

/// Takes requests until the connection ends.
///
/// # Errors
/// What ends it.
async fn take_requests(
    reader: &mut (impl AsyncRead + Unpin),
    session: &Arc<OperatorSession>,
    answers: &mpsc::Sender<WireForm>,
) -> io::Result<()> {
    let room = Arc::new(Semaphore::new(UNDER_WAY));
    loop {
        let text = tokio::select! {
            text = packet::read_async(reader, LARGEST) => text?,
            // Nobody takes the answers any more.
            () = answers.closed() => return Ok(()),
        };
        let request = match WireForm::parse(&text) {
            Ok(request) => request,
            Err(reason) => {
                let reason = WireForm::list([WireForm::symbol(":invalid"), WireForm::text(reason)]);
                _ = answers.send(reason).await;
                continue;
            }
        };
        let items = request.items().unwrap_or_default();
        match items.first().and_then(WireForm::name).as_deref() {
            Some(":emacs-rex") if items.len() >= 5 => {
                let [form, package, thread, number] = [1, 2, 3, 4].map(|index| items[index].clone());
                let Ok(permit) = room.clone().try_acquire_owned() else {
                    let refusal = answer(Err(OperatorRefusal::TooManyRequests), number);
                    _ = answers.send(refusal).await;
                    continue;
                };
                let (session, answers) = (session.clone(), answers.clone());
                tokio::spawn(async move {
                    let result = session.perform(&form, &package, &thread).await;
                    _ = answers.send(answer(result, number)).await;
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
                _ = answers
                    .send(WireForm::list([WireForm::symbol(":emacs-pong")].into_iter().chain(pong)))
                    .await;
            }
            _ => {
                let reason =
                    WireForm::list([WireForm::symbol(":invalid"), WireForm::text("it is no request")]);
                _ = answers.send(reason).await;
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
