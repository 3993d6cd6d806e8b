//! Commands of a session: lines that begin with a colon, or in a replay with a word.
//!
//! In a session in which forms are typed, a line that begins with a colon is a command, and never a form:
//! a misspelt command would be a keyword, whose value says nothing. A keyword is evaluated behind a quote:
//! `':ready`.

use std::fmt::Write;

use super::lines::WordCompletion;

/// A command.
pub(crate) struct SessionCommand {
    /// Its names, with the colon; the first is shown.
    pub(crate) names: &'static [&'static str],
    /// Its arguments, as they are shown.
    pub(crate) arguments: &'static str,
    /// Its effect.
    pub(crate) does: &'static str,
}

/// The meaning of a line.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum LineMeaning<'a> {
    /// A form, or a part of one.
    Form,
    /// A command, by its first name, with the text of its arguments.
    Command(&'static str, &'a str),
    /// Something that looks like a command. Holds what is said about it.
    NoCommand(String),
}

/// Returns what a line means in a session with these commands.
pub(crate) fn meaning_of<'a>(line: &'a str, commands: &[SessionCommand]) -> LineMeaning<'a> {
    let line = line.trim();
    if !line.starts_with(':') {
        return LineMeaning::Form;
    }
    let (word, arguments) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
    let named = |command: &&SessionCommand| command.names.iter().any(|name| name.eq_ignore_ascii_case(word));
    match commands.iter().find(named) {
        Some(command) => LineMeaning::Command(command.names[0], arguments.trim()),
        None => LineMeaning::NoCommand(unknown(word, commands)),
    }
}

/// Returns what is said about a word that names no command.
fn unknown(word: &str, commands: &[SessionCommand]) -> String {
    match nearest(word, commands) {
        Some(name) => format!("no command `{word}`; did you mean `{name}`?"),
        None => format!("no command `{word}`; `:help` lists them, and `'{word}` evaluates the keyword"),
    }
}

/// Returns the likely command for a mistyped one: the only one that begins so, or one with a similar
/// spelling.
pub(crate) fn nearest(word: &str, commands: &[SessionCommand]) -> Option<&'static str> {
    let lower = word.to_lowercase();
    let names = || commands.iter().flat_map(|command| command.names.iter().copied());
    let begun: Vec<&str> = names().filter(|name| word.len() > 1 && name.starts_with(&lower)).collect();
    let distance = |name: &&str| strsim::osa_distance(name, &lower);
    let near = names().filter(|name| name.len() > 2).min_by_key(distance);
    let near = near.filter(|name| distance(name) <= (name.len() - 1) / 3 + 1);
    if begun.len() == 1 { Some(begun[0]) } else { near }
}

/// Returns the commands that begin with a word.
pub(crate) fn completions_of(word: &str, commands: &[SessionCommand]) -> Vec<WordCompletion> {
    let word = word.to_lowercase();
    let names = commands.iter().flat_map(|command| command.names.iter().map(move |name| (command, *name)));
    let begun = names.filter(|(_, name)| name.starts_with(&word));
    let completion = |(command, name): (&SessionCommand, &str)| WordCompletion {
        text: name.into(),
        about: command.does.into(),
    };
    begun.map(completion).collect()
}

/// Returns the list of commands, one a line.
pub(crate) fn help(commands: &[SessionCommand]) -> String {
    let usage = |command: &SessionCommand| format!("{} {}", command.names[0], command.arguments);
    let width = commands.iter().map(|command| usage(command).trim_end().len()).max().unwrap_or(0);
    commands.iter().fold(String::new(), |mut text, command| {
        // Writing to a string does not fail.
        _ = writeln!(text, "{:width$}  {}", usage(command).trim_end(), command.does);
        text
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const COMMANDS: &[SessionCommand] = &[
        SessionCommand { names: &[":abort"], arguments: "N", does: "aborts" },
        SessionCommand { names: &[":undo-patch"], arguments: "", does: "undoes" },
        SessionCommand { names: &[":quit", ":exit"], arguments: "", does: "ends" },
    ];

    #[test]
    fn a_line_with_a_colon_is_a_command() {
        assert_eq!(meaning_of("(list :abort)", COMMANDS), LineMeaning::Form);
        assert_eq!(meaning_of("':foo", COMMANDS), LineMeaning::Form);
        assert_eq!(meaning_of("  :abort  13 ", COMMANDS), LineMeaning::Command(":abort", "13"));
        assert_eq!(meaning_of(":EXIT", COMMANDS), LineMeaning::Command(":quit", ""));
        for (line, said) in [
            (":abrot 3", "no command `:abrot`; did you mean `:abort`?"),
            (":ABROT 3", "no command `:ABROT`; did you mean `:abort`?"),
            (":undo", "no command `:undo`; did you mean `:undo-patch`?"),
            (":qiut", "no command `:qiut`; did you mean `:quit`?"),
            (":foo", "no command `:foo`; `:help` lists them, and `':foo` evaluates the keyword"),
            (":", "no command `:`; `:help` lists them, and `':` evaluates the keyword"),
        ] {
            assert_eq!(meaning_of(line, COMMANDS), LineMeaning::NoCommand(said.into()), "{line}");
        }
    }

    #[test]
    fn commands_are_completed() {
        let texts = |word: &str| completions_of(word, COMMANDS).into_iter().map(|found| found.text);
        assert_eq!(texts(":U").collect::<Vec<_>>(), [":undo-patch"]);
        assert_eq!(texts(":").collect::<Vec<_>>(), [":abort", ":undo-patch", ":quit", ":exit"]);
    }

    #[test]
    fn help_shows_each_command() {
        assert_eq!(help(COMMANDS), ":abort N     aborts\n:undo-patch  undoes\n:quit        ends\n");
    }
}
