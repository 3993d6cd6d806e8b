//! The options of `eslvm run` for an agent of a fleet, the defaults of `fleet:join`.
//!
//! They belong to the feature `robots`; without it they are refused with what to type.

use clap::Args;
use esl_command::{USAGE, complain};

/// Options of a program that is an agent of a fleet.
#[derive(Args, Clone, Debug, Default)]
pub struct AgentOptions {
    /// Name of the agent that the program is, unless its `fleet:join` names it. Needs a build with the cargo
    /// feature `robots`
    #[arg(long, value_name = "NAME")]
    pub agent: Option<String>,
    /// Endpoint to which the agent connects, such as tcp/HOST:PORT, or a file of Zenoh's configuration, in
    /// JSON5; the program needs --allow-fleet to use it. Needs a build with the cargo feature `robots`
    #[arg(long, value_name = "CONFIG")]
    pub zenoh: Option<String>,
}

impl AgentOptions {
    /// Makes the options the defaults of the program.
    ///
    /// # Errors
    /// The exit status, after a message.
    #[cfg(feature = "robots")]
    pub fn install(&self) -> Result<(), u8> {
        let defaults = esl_robots::AgentDefaults::new(self.agent.as_deref(), self.zenoh.as_deref());
        defaults.map(esl_robots::AgentDefaults::install).map_err(|refused| {
            complain(refused);
            USAGE
        })
    }

    /// Refuses the options.
    ///
    /// # Errors
    /// The exit status, after a message.
    #[cfg(not(feature = "robots"))]
    pub fn install(&self) -> Result<(), u8> {
        let option = match (&self.agent, &self.zenoh) {
            (None, None) => return Ok(()),
            (Some(_), _) => "--agent",
            (None, Some(_)) => "--zenoh",
        };
        complain(format_args!(
            "`{option}` belongs to the feature robots, which this program is built without: type cargo install \
             --path commands/eslvm --features robots"
        ));
        Err(USAGE)
    }
}
