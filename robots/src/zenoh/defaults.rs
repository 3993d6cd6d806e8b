//! The name of an agent and its connections, as the command gives them: its options `--agent` and `--zenoh`.
//!
//! They belong to the process, since a command runs one program. The configuration stays here: a program with
//! the right [`esl_host::Right::Fleet`] opens a session with it, and cannot read it.

use std::fmt::{self, Display, Formatter};
use std::path::Path;
use std::sync::OnceLock;

use esl_bytecode::datum::{Datum, DatumKind};
use esl_host::{HostFailure, IntoDatum};

use super::config::{SessionConfig, is_endpoint};
use super::zenoh_failure;

/// Most characters of a name.
const LONGEST_NAME: usize = 64;

static DEFAULTS: OnceLock<AgentDefaults> = OnceLock::new();

/// The name of an agent, and its configuration of Zenoh.
#[derive(Clone, Debug, Default)]
pub struct AgentDefaults {
    name: Option<String>,
    session: Option<SessionConfig>,
}

/// Reason why an option of the command is refused.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum AgentDefaultsError {
    /// This is not the name of an agent.
    Name(String),
    /// This is not an endpoint, and a file of this name cannot be read, for this reason.
    Unreadable(String, String),
    /// This is not a valid configuration, for this reason.
    Invalid(String, String),
}

impl Display for AgentDefaultsError {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            AgentDefaultsError::Name(name) => write!(
                f,
                "--agent: `{name}` is not the name of an agent: expected letters, digits, - and _, at most \
                 {LONGEST_NAME}"
            ),
            AgentDefaultsError::Unreadable(text, reason) => write!(
                f,
                "--zenoh: {text} cannot be read: {reason}; expected a file, or an endpoint such as \
                 tcp/HOST:PORT"
            ),
            AgentDefaultsError::Invalid(text, reason) => write!(f, "--zenoh: {text}: {reason}"),
        }
    }
}

impl std::error::Error for AgentDefaultsError {}

impl AgentDefaults {
    /// Returns the defaults with this name, and with the configuration that `zenoh` says: an endpoint to
    /// connect to, or a file in JSON5, which is read.
    ///
    /// # Errors
    /// If the name is not one, the file cannot be read, or the configuration is invalid.
    pub fn new(name: Option<&str>, zenoh: Option<&str>) -> Result<AgentDefaults, AgentDefaultsError> {
        if let Some(name) = name.filter(|name| !is_name(name)) {
            return Err(AgentDefaultsError::Name(name.into()));
        }
        let session = zenoh.map(session_of).transpose()?;
        Ok(AgentDefaults { name: name.map(str::to_owned), session })
    }

    /// Makes these the defaults of the process, if it has none yet.
    pub fn install(self) {
        // Those that were set first stay.
        _ = DEFAULTS.set(self);
    }
}

/// Returns whether a text is the name of an agent, by the rule of the module `fleet`.
fn is_name(name: &str) -> bool {
    let is_part = |character: char| character.is_ascii_alphanumeric() || matches!(character, '-' | '_');
    (1..=LONGEST_NAME).contains(&name.len()) && name.chars().all(is_part)
}

fn session_of(text: &str) -> Result<SessionConfig, AgentDefaultsError> {
    let invalid = |failure: HostFailure| AgentDefaultsError::Invalid(text.into(), reason_of(&failure));
    if is_endpoint(text) && !Path::new(text).exists() {
        return SessionConfig::of_operator(text, true).map_err(invalid);
    }
    let read = std::fs::read_to_string(text);
    let read = read.map_err(|error| AgentDefaultsError::Unreadable(text.into(), error.to_string()))?;
    SessionConfig::of_operator(&read, false).map_err(invalid)
}

/// Returns the reason in a failure.
pub(super) fn reason_of(failure: &HostFailure) -> String {
    match failure.arguments.first().map(Datum::kind) {
        Some(DatumKind::String(reason)) => reason.to_string(),
        _ => failure.cause.to_lowercase(),
    }
}

/// Returns the name, or `NIL`, and whether there is a configuration.
pub(super) fn as_data() -> Vec<Datum> {
    let defaults = DEFAULTS.get();
    let name = defaults.and_then(|defaults| defaults.name.clone());
    vec![name.into_datum(), defaults.is_some_and(|defaults| defaults.session.is_some()).into_datum()]
}

/// Returns the configuration.
///
/// # Errors
/// `:zenoh-error`, if the command has none.
pub(super) fn session() -> Result<SessionConfig, HostFailure> {
    let session = DEFAULTS.get().and_then(|defaults| defaults.session.clone());
    session.ok_or_else(|| zenoh_failure("there is no configuration: run with --zenoh CONFIG"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_has_letters_digits_and_two_signs() {
        let long = "a".repeat(LONGEST_NAME);
        for name in ["rover-1", "A_b", &long] {
            assert!(AgentDefaults::new(Some(name), None).is_ok(), "{name}");
        }
        for name in ["", "a/b", "a b", "ä", "*", &format!("{long}a")] {
            let refused = AgentDefaults::new(Some(name), None).expect_err(name);
            assert_eq!(refused, AgentDefaultsError::Name(name.into()));
        }
    }

    #[test]
    fn a_configuration_is_an_endpoint_or_a_file() {
        assert!(AgentDefaults::new(None, Some("tcp/127.0.0.1:7447")).is_ok());
        let refusal = |text: &str| match AgentDefaults::new(None, Some(text)) {
            Err(refused) => refused.to_string(),
            Ok(_) => "accepted".into(),
        };
        assert!(refusal("quic/a:1").contains("unknown protocol `quic`"), "{}", refusal("quic/a:1"));
        assert!(refusal("none.json5").contains("or an endpoint such as tcp/HOST:PORT"));
        assert!(refusal("tcp/").contains("is not an endpoint"), "{}", refusal("tcp/"));
    }
}
