//! A host of many durable runs in one process.
//!
//! Each *agent* is a durable run (`esl_durable`) in a folder of its own. One that has something to do is
//! *awake*: it has a machine and a thread. One that waits long *sleeps*: it is its folder, and some bytes in
//! the table of the host. A message wakes it, or its next timer. The one event loop of the process serves the
//! operations of all agents; the syncs of their journals are made side by side, so that the file system can
//! make several at once.
//!
//! ```
//! use std::time::Duration;
//!
//! use esl::program::{Source, compile};
//! use esl_agents::{AgentsHost, HostClient, HostRequest, HostSettings, HostSurroundings};
//! use esl_agents::{NewAgent, begin_agent};
//! use esl_replay::RunSetup;
//!
//! let text = "(define-input order) (princ (wait-for-event order)) (exit 3)";
//! let program = compile(&[Source::new("one.esl", text)]).program.expect("it compiles");
//! let folder = std::env::temp_dir().join(format!("esl-agents-{}", std::process::id()));
//! let setup = RunSetup::default();
//! let agent = NewAgent { program: &program, arguments: &[], setup: &setup, origin: None };
//! begin_agent(&folder, "one", agent, |_machine| ())?;
//!
//! let surroundings = HostSurroundings {
//!     prepare: Box::new(|_machine| ()),
//!     print: Box::new(|name, bytes| assert_eq!((name, bytes), ("one", &b"LEFT"[..]))),
//!     report: Box::new(|name, text| panic!("{name}: {text}")),
//! };
//! let settings = HostSettings { sleep_after: Duration::ZERO, ..HostSettings::default() };
//! let host = AgentsHost::open(&folder, settings, surroundings)?;
//! let control = host.control();
//! let serving = std::thread::spawn(move || host.serve());
//!
//! let mut client = HostClient::connect(&folder)?;
//! let order = HostRequest::Send { agent: "one".into(), input: "order".into(), data: "left".into() };
//! client.ask(&order)?;
//! let list = HostRequest::List(Some("one".into()));
//! while client.ask(&list)?["agents"][0]["status"] != 3 {
//!     std::thread::yield_now();
//! }
//! control.end();
//! serving.join().expect("it does not panic");
//! # std::fs::remove_dir_all(folder)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]
#![cfg(unix)]

mod agent;
mod error;
mod folder;
mod host;
mod mailbox;
mod origin;
mod outside;
mod request;
mod server;
mod settings;

use std::path::Path;
use std::sync::Arc;

pub use agent::{NewAgent, begin_agent};
pub use error::AgentError;
pub use host::AgentStanding;
pub use origin::AgentOrigin;
pub use request::{HostClient, HostRequest};
pub use settings::{AgentListener, HostSettings, HostSurroundings};

use host::HostTable;
use server::AgentsEntrance;

/// A host of the agents in a folder.
pub struct AgentsHost {
    shared: Arc<HostTable>,
    _entrance: AgentsEntrance,
}

impl AgentsHost {
    /// Takes the folder, which is made if there is none, looks which agents are there, and listens for
    /// requests.
    ///
    /// # Errors
    /// [`AgentError`]. Agents that are damaged are none: they are reported when they are woken.
    pub fn open(
        folder: &Path,
        settings: HostSettings,
        surroundings: HostSurroundings,
    ) -> Result<AgentsHost, AgentError> {
        let shared = HostTable::open(folder.into(), settings, surroundings)?;
        let entrance = server::listen(&shared)?;
        Ok(AgentsHost { shared, _entrance: entrance })
    }

    /// Returns the control, for other threads.
    pub fn control(&self) -> HostControl {
        HostControl(self.shared.clone())
    }

    /// Serves the agents until the host is to end, and all of them have left their machines.
    pub fn serve(self) {
        self.shared.serve();
    }
}

/// Ends a host, from any thread.
#[derive(Clone)]
pub struct HostControl(Arc<HostTable>);

impl HostControl {
    /// Has all agents leave their machines, to go on in another process, and the host end.
    pub fn end(&self) {
        self.0.end();
    }

    /// Returns all agents, and how they stand.
    pub fn agents(&self) -> Vec<(Arc<str>, AgentStanding)> {
        self.0.list(None)
    }
}
