//! Command lines, and what to type instead of those that other tools have taught.

use std::ffi::OsString;
use std::path::Path;

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{CommandFactory, Parser};

use super::{USAGE, complain};

/// Words in place of a subcommand, and the command that does the same.
pub type Habits = &'static [(&'static str, &'static str)];

/// Returns the arguments of the running command, its name first. A build of `eslvm` that contains `eslc` runs
/// it where its own first argument says so: `eslvm eslc check FILE`.
pub fn arguments() -> Vec<OsString> {
    let mut arguments: Vec<OsString> = std::env::args_os().collect();
    if arguments.get(1).is_some_and(|first| first == "eslc") {
        arguments.remove(0);
    }
    arguments
}

/// Returns the name of the running command.
pub fn command_name() -> String {
    let arguments = arguments();
    let path = arguments.first().map(Path::new);
    path.and_then(Path::file_stem).map_or("esl".into(), |name| name.to_string_lossy().into_owned())
}

/// Parses the command line. One that is wrong ends the process, after a message that says what to type, also
/// if it begins with a word of `habits`, or with a file where `file_command` takes one.
pub fn parse<C: Parser + CommandFactory>(file_command: &str, habits: Habits) -> C {
    let arguments = arguments();
    let error = match C::try_parse_from(&arguments) {
        Ok(parsed) => return parsed,
        Err(error) => error,
    };
    if error.kind() == ErrorKind::InvalidSubcommand
        && let Some(ContextValue::String(word)) = error.get(ContextKind::InvalidSubcommand)
        && let Some(command) = meant(word, file_command, habits)
    {
        let rest = arguments.iter().skip_while(|argument| argument.to_string_lossy() != *word).skip(1);
        let rest: String = rest.map(|argument| format!(" {}", argument.to_string_lossy())).collect();
        complain(format_args!("unknown subcommand `{word}`: type `{command}{rest}`"));
        std::process::exit(i32::from(USAGE));
    }
    error.exit()
}

/// Returns the command that is meant by a word in place of a subcommand.
fn meant(word: &str, file_command: &str, habits: Habits) -> Option<String> {
    if let Some((_, command)) = habits.iter().find(|(habit, _)| *habit == word) {
        return Some((*command).into());
    }
    let path = Path::new(word);
    let is_source =
        path.extension().is_some_and(|extension| ["esl", "eslb", "lisp"].iter().any(|end| extension == *end));
    (is_source || path.is_file()).then(|| format!("{file_command} {word}"))
}

#[cfg(test)]
mod tests {
    use super::meant;

    #[test]
    fn files_and_words_of_other_tools_are_known() {
        let habits = &[("fmt", "eslc format")];
        assert_eq!(meant("fmt", "eslc check", habits).as_deref(), Some("eslc format"));
        assert_eq!(meant("hello.esl", "eslvm run", habits).as_deref(), Some("eslvm run hello.esl"));
        assert_eq!(meant("frobnicate", "eslvm run", habits), None);
    }
}
