//! The options that grant rights to a program, and files of grants.

use std::path::{Path, PathBuf};

use clap::Args;
use esl_command::{USAGE, complain};
use esl_host::{Right, Rights};

/// Stands for a value that was left out. No argument of a process can be it.
const ALL: &str = "\0";

/// Rights of a program beside reading and writing below the current folder.
///
/// A value is a list with commas; without one, everything of the kind is granted.
#[derive(Args, Clone, Debug, Default)]
pub struct RightsOptions {
    /// Permit reading these files and folders, or all; reading below the current folder is always permitted
    #[arg(long, value_name = "PATH,…", num_args = 0..=1, require_equals = true, default_missing_value = ALL, help_heading = "Rights")]
    allow_read: Vec<String>,
    /// Permit writing these files and folders, or all; writing below the current folder is always permitted
    #[arg(long, value_name = "PATH,…", num_args = 0..=1, require_equals = true, default_missing_value = ALL, help_heading = "Rights")]
    allow_write: Vec<String>,
    /// Permit network access to these hosts, or all
    #[arg(long, value_name = "HOST:PORT,…", num_args = 0..=1, require_equals = true, default_missing_value = ALL, help_heading = "Rights")]
    allow_net: Vec<String>,
    /// Permit running these programs, or all
    #[arg(long, value_name = "COMMAND,…", num_args = 0..=1, require_equals = true, default_missing_value = ALL, help_heading = "Rights")]
    allow_run: Vec<String>,
    /// Permit reading these environment variables, or all
    #[arg(long, value_name = "NAME,…", num_args = 0..=1, require_equals = true, default_missing_value = ALL, help_heading = "Rights")]
    allow_env: Vec<String>,
    /// Permit access to these serial lines, or all
    #[arg(long, value_name = "PATH,…", num_args = 0..=1, require_equals = true, default_missing_value = ALL, help_heading = "Rights")]
    allow_serial: Vec<String>,
    /// Permit being an agent of these fleets, by the connections of --zenoh, or of all
    #[arg(long, value_name = "FLEET,…", num_args = 0..=1, require_equals = true, default_missing_value = ALL, help_heading = "Rights")]
    allow_fleet: Vec<String>,
    /// Permit everything that the system permits its user
    #[arg(long, help_heading = "Rights")]
    allow_all: bool,
    /// Read more of these flags from a file, one a line
    #[arg(long = "rights", value_name = "FILE", help_heading = "Rights")]
    files: Vec<PathBuf>,
}

impl RightsOptions {
    /// Returns the rights that the options grant.
    ///
    /// # Errors
    /// The exit status, after a message, if a file of rights cannot be used, or a value is empty.
    pub fn rights(&self) -> Result<Rights, u8> {
        let mut rights = Rights::none().with(Right::Read, ".").with(Right::Write, ".");
        let options = [
            (Right::Read, &self.allow_read),
            (Right::Write, &self.allow_write),
            (Right::Net, &self.allow_net),
            (Right::Run, &self.allow_run),
            (Right::Env, &self.allow_env),
            (Right::Serial, &self.allow_serial),
            (Right::Fleet, &self.allow_fleet),
        ];
        for (right, values) in options {
            for value in values {
                let value = Some(&**value).filter(|&value| value != ALL);
                rights = grant(rights, right, value).map_err(|reason| {
                    complain(format_args!("{}: {reason}", right.flag(value.unwrap_or_default())));
                    USAGE
                })?;
            }
        }
        if self.allow_all {
            rights = rights.and(Rights::all());
        }
        for file in &self.files {
            rights = rights.and(read(file)?);
        }
        Ok(rights)
    }
}

/// Adds a right to the objects of a list with commas, or to all.
fn grant(rights: Rights, right: Right, objects: Option<&str>) -> Result<Rights, &'static str> {
    let Some(objects) = objects else { return Ok(rights.with_all(right)) };
    objects.split(',').try_fold(rights, |rights, object| match object.trim() {
        "" => Err("empty value between commas: a flag without values grants everything"),
        object => Ok(rights.with(right, object)),
    })
}

fn read(file: &Path) -> Result<Rights, u8> {
    let text = std::fs::read_to_string(file).map_err(|error| {
        complain(format_args!("{} cannot be read: {error}", file.display()));
        USAGE
    })?;
    parse(&text).map_err(|(line, reason)| {
        complain(format_args!("{}:{line}: {reason}", file.display()));
        USAGE
    })
}

/// Returns the rights of a file: a flag a line, as on the command line; `#` begins a comment.
///
/// # Errors
/// The number of the first line that is not a flag, and the reason.
fn parse(text: &str) -> Result<Rights, (usize, String)> {
    let mut rights = Rights::none();
    for (index, line) in text.lines().enumerate() {
        let flag = line.trim();
        if flag.is_empty() || flag.starts_with('#') {
            continue;
        }
        let wrong = |reason: &str| (index + 1, format!("`{flag}`: {reason}"));
        let Some(grants) = flag.strip_prefix("--allow-") else {
            return Err(wrong("expected a flag such as `--allow-read=PATH`"));
        };
        if grants == "all" {
            rights = rights.and(Rights::all());
            continue;
        }
        let (name, objects) = match grants.split_once('=') {
            Some((name, objects)) => (name, Some(objects)),
            None => (grants, None),
        };
        let Some(right) = Right::of_name(name) else {
            return Err(wrong("expected read, write, net, run, env, serial, fleet or all after `--allow-`"));
        };
        rights = grant(rights, right, objects).map_err(wrong)?;
    }
    Ok(rights)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_has_a_flag_a_line() {
        let text = "# of the plant\n--allow-read=/a, /b\n\n  --allow-net\n--allow-env=HOME\n";
        let expected = Rights::none().with(Right::Read, "/a").with(Right::Read, "/b");
        let expected = expected.with_all(Right::Net).with(Right::Env, "HOME");
        assert_eq!(parse(text), Ok(expected));
        assert_eq!(parse("--allow-all"), Ok(Rights::all()));
    }

    #[test]
    fn what_is_no_flag_grants_nothing() {
        for (text, line) in [
            ("allow-read", 1),
            ("\n--allow-all=x", 2),
            ("--allow-reed", 1),
            ("--allow-run=", 1),
            ("--allow-env=a,,b", 1),
        ] {
            assert_eq!(parse(text).map_err(|(line, _)| line), Err(line), "{text}");
        }
    }
}
