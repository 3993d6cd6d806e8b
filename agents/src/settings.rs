//! Settings of a host, and the part of it that its embedder provides.

use std::time::Duration;

use esl_durable::DurableOptions;
use esl_host::Rights;
use esl_vm::vm::Vm;

/// Settings of a host.
#[derive(Clone, Debug)]
pub struct HostSettings {
    /// Those of the runs.
    pub durable: DurableOptions,
    /// Rights of all agents.
    pub rights: Rights,
    /// Time that an agent waits before it is put to sleep.
    pub sleep_after: Duration,
    /// Agents that are awake at most, beside those that cannot sleep.
    pub awake: usize,
}

impl Default for HostSettings {
    /// No rights; sleep after ten seconds; 500 agents awake.
    fn default() -> HostSettings {
        HostSettings {
            durable: DurableOptions::default(),
            rights: Rights::none(),
            sleep_after: Duration::from_secs(10),
            awake: 500,
        }
    }
}

/// Receives something of an agent, with its name.
pub type AgentListener<T> = Box<dyn Fn(&str, &T) + Send + Sync>;

/// The part of a host that its embedder provides.
pub struct HostSurroundings {
    /// Gives the machine of an agent the functions of the outside.
    pub prepare: Box<dyn Fn(&mut Vm) + Send + Sync>,
    /// Receives the output of an agent, by its name.
    pub print: AgentListener<[u8]>,
    /// Receives reports about an agent, by its name.
    pub report: AgentListener<str>,
}
