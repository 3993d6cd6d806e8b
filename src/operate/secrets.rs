//! Roles of those who connect to a run, and the secrets by which they are known.

use std::fmt;
use std::path::Path;

use subtle::{Choice, ConstantTimeEq};

/// What somebody may do with a run. Each role may do what those before it may.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum OperatorRole {
    /// Look.
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
    pub(super) fn random() -> Result<Secrets, String> {
        let make = |role| {
            let mut bytes = [0; 16];
            getrandom::fill(&mut bytes).map_err(|error| error.to_string())?;
            Ok((role, bytes.iter().map(|byte| format!("{byte:02x}")).collect()))
        };
        Ok(Secrets(OperatorRole::ALL.into_iter().map(make).collect::<Result<_, String>>()?))
    }

    /// Reads secrets from a file: lines of the name of a role and its secret. A role without a line has none,
    /// so nobody has it.
    ///
    /// # Errors
    /// The reason, if the file cannot be read, is not one of secrets, or can be read by others.
    pub(super) fn read(path: &Path) -> Result<Secrets, String> {
        let text = std::fs::read_to_string(path).map_err(|error| error.to_string())?;
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            let mode = std::fs::metadata(path).map_err(|error| error.to_string())?.permissions().mode();
            if mode & 0o077 != 0 {
                return Err("others may read or write it: use chmod 600".into());
            }
        }
        Secrets::parse(&text)
    }

    pub(super) fn parse(text: &str) -> Result<Secrets, String> {
        let mut secrets = Vec::new();
        let lines = text.lines().enumerate().map(|(index, line)| (index + 1, line.trim()));
        for (number, line) in lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#')) {
            let role_of = |name: &str| OperatorRole::ALL.into_iter().find(|role| role.name() == name);
            let parts = line.split_once(char::is_whitespace);
            let Some((role, secret)) = parts.and_then(|(name, rest)| Some((role_of(name)?, rest.trim())))
            else {
                return Err(format!(
                    "line {number} has no role: expected `observe`, `command` or `patch`, and a secret"
                ));
            };
            if !(SHORTEST..=LONGEST).contains(&secret.len()) || !secret.bytes().all(|b| b.is_ascii_graphic())
            {
                return Err(format!(
                    "the secret in line {number} is not good: expected {SHORTEST} to {LONGEST} letters, digits and signs"
                ));
            }
            if secrets.iter().any(|(_, other)| other == secret) {
                return Err(format!("the secret in line {number} is that of another role"));
            }
            secrets.push((role, secret.to_string()));
        }
        if secrets.is_empty() { Err("it has no secrets".into()) } else { Ok(Secrets(secrets)) }
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
            ("\nobserve short", "line 2 is not good"),
            ("observe 0123456789abcdef\npatch 0123456789abcdef", "another role"),
        ] {
            let found = Secrets::parse(text).err().unwrap_or_default();
            assert!(found.contains(reason), "{text:?}: {found}");
        }
    }
}
