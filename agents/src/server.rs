//! The socket of a host, at which only its owner can make requests.

use std::fs;
use std::io::{self, BufReader, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::sync::Arc;
use std::time::Duration;

use serde_json::{Value, json};

use super::error::AgentError;
use super::folder::{reachable, socket_path};
use super::host::{AgentStanding, HostTable};
use super::mailbox::{Letter, LetterContents};
use super::request::{HostRequest, read_data, read_line};

/// The place at which a host listens, until it is dropped.
pub(crate) struct AgentsEntrance {
    shared: Arc<HostTable>,
}

impl Drop for AgentsEntrance {
    fn drop(&mut self) {
        let path = socket_path(&self.shared.folder);
        // The thread that accepts looks up.
        drop(reachable(&path).and_then(|(path, _folder)| UnixStream::connect(path)));
        drop(fs::remove_file(&path));
    }
}

/// Begins to listen in the folder of a host.
///
/// # Errors
/// [`AgentError::Folder`].
pub(crate) fn listen(shared: &Arc<HostTable>) -> Result<AgentsEntrance, AgentError> {
    let path = socket_path(&shared.folder);
    let refused = |error| AgentError::Folder(path.clone(), error);
    // This host has the folder, so no other one listens there.
    match fs::remove_file(&path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(refused(error)),
        _ => {}
    }
    // The folder is closed to other users.
    let listener = reachable(&path).and_then(|(path, _folder)| UnixListener::bind(path)).map_err(refused)?;
    let accepting = shared.clone();
    let thread =
        std::thread::Builder::new().name("agents".into()).spawn(move || accept(&listener, &accepting));
    thread.map_err(refused)?;
    Ok(AgentsEntrance { shared: shared.clone() })
}

fn accept(listener: &UnixListener, shared: &Arc<HostTable>) {
    loop {
        let accepted = listener.accept();
        if shared.is_ending() {
            return;
        }
        let own = shared.clone();
        let served = accepted.and_then(|(stream, _)| {
            let serve = move || drop(serve(stream, &own));
            std::thread::Builder::new().name("request".into()).spawn(serve)
        });
        if served.is_err() {
            std::thread::sleep(Duration::from_millis(100));
        }
    }
}

/// Answers the requests of a connection, one after the other.
fn serve(stream: UnixStream, shared: &Arc<HostTable>) -> io::Result<()> {
    let mut writer = stream.try_clone()?;
    let mut reader = BufReader::new(stream);
    while let Some(line) = read_line(&mut reader)? {
        let answer = HostRequest::read(&line).and_then(|request| perform(request, shared));
        let answer = answer.unwrap_or_else(|error| json!({ "error": error.to_string() }));
        writer.write_all(format!("{answer}\n").as_bytes())?;
    }
    Ok(())
}

fn perform(request: HostRequest, shared: &Arc<HostTable>) -> Result<Value, AgentError> {
    match request {
        HostRequest::Send { agent, input, data } => {
            post(shared, &agent, LetterContents::Message { input, arguments: read_data(&data)? })?;
        }
        HostRequest::End(agent) => post(shared, &agent, LetterContents::End)?,
        HostRequest::Start(agent) => shared.start(&agent)?,
        HostRequest::Stop(agent) => shared.stop(&agent)?,
        HostRequest::List(agent) => {
            let mut all = shared.list(agent.as_deref());
            if let (Some(name), true) = (agent, all.is_empty()) {
                return Err(AgentError::NoAgent(name));
            }
            all.sort_by(|one, other| one.0.cmp(&other.0));
            let agents: Vec<Value> =
                all.iter().map(|(name, standing)| standing_json(name, standing)).collect();
            return Ok(json!({ "ok": true, "agents": agents }));
        }
    }
    Ok(json!({ "ok": true }))
}

/// Posts a letter, and waits for its answer.
fn post(shared: &Arc<HostTable>, agent: &str, contents: LetterContents) -> Result<(), AgentError> {
    let (letter, answer) = Letter::new(contents);
    shared.post(agent, letter);
    answer.recv().unwrap_or(Err(AgentError::Leaving))
}

fn standing_json(name: &str, standing: &AgentStanding) -> Value {
    match standing {
        AgentStanding::Asleep(until) => json!({ "name": name, "standing": "asleep", "until": until }),
        AgentStanding::Waiting => json!({ "name": name, "standing": "waiting" }),
        AgentStanding::Awake => json!({ "name": name, "standing": "awake" }),
        AgentStanding::Ended(status) => json!({ "name": name, "standing": "ended", "status": status }),
        AgentStanding::Stopped => json!({ "name": name, "standing": "stopped" }),
        AgentStanding::Failed(reason, until) => {
            json!({ "name": name, "standing": "failed", "reason": reason, "until": until })
        }
    }
}
