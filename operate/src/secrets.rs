//! Roles of peers that connect to a run, and the secrets that authenticate them.

use std::path::Path;
use std::{fmt, io};

use subtle::{Choice, ConstantTimeEq};

/// The permissions of an operator. Each role includes those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum OperatorRole {
    /// Survey the run.
    Observe,
    /// Abort, suspend and resume tasks, pause the run, signal inputs.
    Command,
    /// Evaluate forms, and change the program.
    Patch,
}

impl OperatorRole {
    /// All roles.
    pub(super) const ALL: [OperatorRole; 3] =
        [OperatorRole::Observe, OperatorRole::Command, OperatorRole::Patch];

    /// Returns its name.
    pub(super) fn name(self) -> &'static str {
        match self {
            OperatorRole::Observe => "observe",
            OperatorRole::Command => "command",
            OperatorRole::Patch => "patch",
        }
    }
}

impl fmt::Display for OperatorRole {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Reason why there are no secrets.
#[derive(Debug)]
pub enum SecretsError {
    /// The system gives no random numbers.
    NoRandom(getrandom::Error),
    /// The file cannot be read.
    Unreadable(io::Error),
    /// Others than the owner may read or write the file.
    #[cfg(unix)]
    Exposed,
    /// This line does not begin with a role, from 1.
    NoRole(usize),
    /// The secret in this line is too short, too long, or has other characters than it may.
    NotGood(usize),
    /// The secret in this line is that of another role.
    Repeated(usize),
    /// The file has none.
    Nothing,
}

impl fmt::Display for SecretsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SecretsError::NoRandom(error) => error.fmt(f),
            SecretsError::Unreadable(error) => error.fmt(f),
            #[cfg(unix)]
            SecretsError::Exposed => f.write_str("other users may read or write it: run chmod 600 on it"),
            SecretsError::NoRole(line) => {
                write!(f, "line {line} has no role: expected `observe`, `command` or `patch`, and a secret")
            }
            SecretsError::NotGood(line) => write!(
                f,
                "invalid secret in line {line}: expected {SHORTEST} to {LONGEST} letters, digits and signs"
            ),
            SecretsError::Repeated(line) => {
                write!(f, "the secret in line {line} is that of another role")
            }
            SecretsError::Nothing => f.write_str("it has no secrets"),
        }
    }
}

impl std::error::Error for SecretsError {}

/// Fewest characters of a secret in a file.
const SHORTEST: usize = 16;
/// Most characters.
const LONGEST: usize = 200;

/// The secrets of the roles.
#[derive(Clone)]
pub(super) struct Secrets(Vec<(OperatorRole, String)>);

impl Secrets {
    /// Makes a random secret for each role.
    ///
    /// # Errors
    /// The reason, if the system gives no random numbers.
    pub(super) fn random() -> Result<Secrets, SecretsError> {
        let make = |role| {
            let mut bytes = [0; 16];
            getrandom::fill(&mut bytes).map_err(SecretsError::NoRandom)?;
            Ok((role, bytes.iter().map(|byte| format!("{byte:02x}")).collect()))
        };
        Ok(Secrets(OperatorRole::ALL.into_iter().map(make).collect::<Result<_, SecretsError>>()?))
    }

    /// Reads secrets from a file: lines of the name of a role and its secret. A role without a line has none,
    /// so no peer can get it.
    ///
    /// # Errors
    /// The reason, if the file cannot be read, is not one of secrets, or can be read by others.
    pub(super) fn read(path: &Path) -> Result<Secrets, SecretsError> {
        let text = std::fs::read_to_string(path).map_err(SecretsError::Unreadable)?;
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            let mode = std::fs::metadata(path).map_err(SecretsError::Unreadable)?.permissions().mode();
            if mode & 0o077 != 0 {
                return Err(SecretsError::Exposed);
            }
        }
        Secrets::parse(&text)
    }

    pub(super) fn parse(text: &str) -> Result<Secrets, SecretsError> {
        let mut secrets = Vec::new();
        let lines = text.lines().enumerate().map(|(index, line)| (index + 1, line.trim()));
        for (number, line) in lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#')) {
            let role_of = |name: &str| OperatorRole::ALL.into_iter().find(|role| role.name() == name);
            let parts = line.split_once(char::is_whitespace);
            let Some((role, secret)) = parts.and_then(|(name, rest)| Some((role_of(name)?, rest.trim())))
            else {
                return Err(SecretsError::NoRole(number));
            };
            if !(SHORTEST..=LONGEST).contains(&secret.len()) || !secret.bytes().all(|b| b.is_ascii_graphic())
            {
                return Err(SecretsError::NotGood(number));
            }
            if secrets.iter().any(|(_, other)| other == secret) {
                return Err(SecretsError::Repeated(number));
            }
            secrets.push((role, secret.to_string()));
        }
        if secrets.is_empty() { Err(SecretsError::Nothing) } else { Ok(Secrets(secrets)) }
    }

    /// Returns the greatest role that a secret gives. How long that takes says nothing about the secrets but
    /// their lengths.
    pub(super) fn role_of(&self, secret: &[u8]) -> Option<OperatorRole> {
        let mut found = None;
        for (role, other) in &self.0 {
            let is_it: Choice = other.as_bytes().ct_eq(secret);
            if bool::from(is_it) {
                found = found.max(Some(*role));
            }
        }
        found
    }

    /// Returns whether any of them permits more than surveys.
    pub(super) fn may_signal(&self) -> bool {
        self.0.iter().any(|(role, _)| *role >= OperatorRole::Command)
    }

    /// Returns the first secret of a role, if it has one.
    pub(super) fn of(&self, role: OperatorRole) -> Option<&str> {
        self.0.iter().find(|(other, _)| *other == role).map(|(_, secret)| secret.as_str())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_secret_gives_its_role_only() {
        let text = "# who may what\nobserve 0123456789abcdef\n\npatch   fedcba9876543210\n";
        let secrets = Secrets::parse(text).expect("they are good");
        assert_eq!(secrets.role_of(b"0123456789abcdef"), Some(OperatorRole::Observe));
        assert_eq!(secrets.role_of(b"fedcba9876543210"), Some(OperatorRole::Patch));
        for wrong in ["", "0123456789abcde", "0123456789abcdef0", "command"] {
            assert_eq!(secrets.role_of(wrong.as_bytes()), None, "{wrong}");
        }
        assert!(secrets.of(OperatorRole::Command).is_none());
        let random = Secrets::random().expect("the system has random numbers");
        assert!(
            OperatorRole::ALL
                .into_iter()
                .all(|role| random.of(role).is_some_and(|secret| secret.len() == 32))
        );
    }

    #[test]
    fn bad_files_are_refused() {
        for (text, reason) in [
            ("", "no secrets"),
            ("root 0123456789abcdef", "line 1 has no role"),
            ("observe", "line 1 has no role"),
            ("\nobserve short", "invalid secret in line 2"),
            ("observe 0123456789abcdef\npatch 0123456789abcdef", "another role"),
        ] {
            let found = Secrets::parse(text).err().map(|error| error.to_string()).unwrap_or_default();
            assert!(found.contains(reason), "{text:?}: {found}");
        }
    }
}
