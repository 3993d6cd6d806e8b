//! Programs as users of other languages write them, each with the one message that it deserves.
//!
//! A file of `habits/` has a program for each line that begins with `===`, then, behind a line `---`, all
//! that the compiler says about it. `ESL_BLESS=1` writes the messages anew; read the difference aloud.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use esl::program::{self, Compiled, Source};
use esl_bytecode::diagnostic::Severity;
use esl_bytecode::span::Span;
use esl_compiler::habit::word::{WORDS, WordRole};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("habits")
}

/// A program of a file.
struct Habit {
    title: String,
    program: String,
    messages: String,
}

fn habits(text: &str) -> Vec<Habit> {
    let text = format!("\n{text}");
    let parts = text.split("\n=== ").skip(1);
    let habit = |part: &str| {
        let (title, rest) = part.split_once('\n').expect("a program follows the title");
        let (program, messages) = rest.split_once("\n---\n").unwrap_or((rest, ""));
        let program = program.trim_end().to_string() + "\n";
        Habit { title: title.into(), program, messages: messages.trim_end().into() }
    };
    parts.map(habit).collect()
}

/// Returns what the compiler says, without pictures.
fn messages(compiled: &Compiled) -> String {
    let mut text = String::new();
    let place = |span: Span| {
        let place = compiled.sources.place(span);
        place.map_or("?".to_string(), |place| format!("{}:{}", place.line, place.column))
    };
    for found in &compiled.diagnostics {
        let severity = if found.severity == Severity::Error { "error" } else { "warning" };
        let primary = place(found.primary.span);
        writeln!(text, "{primary} {severity}[{}]: {}", found.code, found.message).expect("a string takes it");
        if !found.primary.text.is_empty() {
            writeln!(text, "    here: {}", found.primary.text).expect("a string takes it");
        }
        for label in &found.secondary {
            writeln!(text, "    {}: {}", place(label.span), label.text).expect("a string takes it");
        }
        if let Some(help) = &found.help {
            writeln!(text, "    help: {help}").expect("a string takes it");
        }
    }
    text.trim_end().to_string()
}

#[test]
fn each_habit_has_one_message() {
    let mut faults = String::new();
    let mut count = 0;
    for entry in std::fs::read_dir(folder()).expect("the folder is there") {
        let path = entry.expect("the folder can be read").path();
        let text = std::fs::read_to_string(&path).expect("the file is text");
        let mut blessed = String::new();
        for Habit { title, program, messages: expected } in habits(&text) {
            count += 1;
            let compiled = program::compile(&[Source::new("program.esl", program.clone())]);
            let found = messages(&compiled);
            if compiled.diagnostics.len() != 1 {
                let count = compiled.diagnostics.len();
                writeln!(faults, "{title}: {count} messages\n{program}{found}\n").expect("a string takes it");
            } else if found != expected {
                writeln!(faults, "{title}: expected\n{expected}\nfound\n{found}\n")
                    .expect("a string takes it");
            }
            let _ = write!(blessed, "=== {title}\n{}\n---\n{found}\n\n", program.trim_end());
        }
        if std::env::var_os("ESL_BLESS").is_some() {
            std::fs::write(&path, blessed.trim_end().to_string() + "\n").expect("the file can be written");
        }
    }
    assert!(count >= 60, "{count} programs");
    assert!(faults.is_empty(), "{faults}\nESL_BLESS=1 writes the messages anew");
}

/// Compiles one line for each word; returns the words whose lines do not have just the warning about it.
fn words_without_a_warning(role: WordRole, form: impl Fn(&str) -> String) -> Vec<&'static str> {
    // The reader refuses `#t` and `#f`.
    let has_role = WORDS.iter().filter(|word| word.role == role && !word.word.starts_with('#'));
    let words: Vec<&str> = has_role.map(|word| word.word).collect();
    let text: String = words.iter().map(|word| form(word) + "\n").collect();
    let compiled = program::compile(&[Source::new("words.esl", text)]);
    let is_warned = |line: usize| {
        let at = |span| compiled.sources.place(span).map(|place| place.line as usize);
        let on_line = compiled.diagnostics.iter().filter(|found| at(found.primary.span) == Some(line));
        on_line.map(|found| found.code).collect::<Vec<_>>() == ["foreign-word"]
    };
    words.into_iter().enumerate().filter(|(index, _)| !is_warned(index + 1)).map(|(_, word)| word).collect()
}

#[test]
fn no_foreign_word_is_a_name_of_esl() {
    assert_eq!(words_without_a_warning(WordRole::Call, |word| format!("({word} 1)")), [""; 0]);
    assert_eq!(words_without_a_warning(WordRole::Value, |word| format!("(print {word})")), [""; 0]);
}

#[test]
fn a_word_that_the_program_defines_is_not_foreign() {
    let text =
        "(defun begin (x) (while x))\n(defun while (x) (print (list x else)))\n(defvar else 1)\n(begin 1)\n";
    let compiled = program::compile(&[Source::new("own.esl", text)]);
    assert_eq!(messages(&compiled), "");
}
