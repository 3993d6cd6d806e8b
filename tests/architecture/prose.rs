//! Prose names things and actors: comments, docstrings, messages and documents say "the output", not "what
//! was written", and "users who attach", not "whoever attaches". A negation is "is not"; the acting thing
//! comes first, so nothing "is told" or "is to be" done.

use std::fs;

use super::{files_below, path_in_tree, root};

/// Words that stand for a thing or an actor without naming it.
const UNNAMED: [&str; 12] = [
    "what",
    "whatever",
    "who",
    "whom",
    "whoever",
    "whomever",
    "somebody",
    "someone",
    "nobody",
    "anybody",
    "everybody",
    "everyone",
];

/// Actors that a relative clause may follow.
const ACTORS: [&str; 8] =
    ["user", "users", "operator", "operators", "reader", "readers", "newcomer", "newcomers"];

/// Documents with the history, whose lines stay as they were written.
const HISTORY: &str = "CHANGELOG.md";

/// A text of a source, with the line at which it begins.
struct Prose {
    line: usize,
    is_comment: bool,
    text: String,
}

/// The rules that apply to a kind of text.
#[derive(Clone, Copy, PartialEq)]
enum Rules {
    /// No clause begins with an unnamed thing or actor, not even within a sentence.
    All,
    /// No sentence begins with one, and a negated noun is "not a" thing.
    Beginnings,
}

/// Returns the words of a text without its inline code and the targets of its links, each with whether the
/// sentence is a question. Words in capitals are parameters.
fn words(text: &str) -> Vec<(String, bool)> {
    let code_free: String = text.split('`').step_by(2).collect::<Vec<_>>().join(" ");
    let links_free = code_free.split("](").enumerate().map(|(index, part)| {
        if index == 0 { part } else { part.split_once(')').map_or("", |(_, rest)| rest) }
    });
    let prose = links_free.collect::<Vec<_>>().join(" ");
    let mut found = Vec::new();
    for sentence in sentences(&prose) {
        let is_question = sentence.trim_end().ends_with('?');
        let parts = sentence.split(|c: char| !c.is_alphanumeric() && c != '{' && c != '\'');
        found.extend(parts.filter(|word| !word.is_empty()).map(|word| (word.to_string(), is_question)));
    }
    found
}

/// Returns the sentences of a text, each with its end.
fn sentences(text: &str) -> Vec<&str> {
    let (mut found, mut start) = (Vec::new(), 0);
    for (at, c) in text.char_indices() {
        let rest = &text[at + c.len_utf8()..];
        if ".?!".contains(c) && rest.chars().next().is_none_or(char::is_whitespace) {
            found.push(&text[start..text.len() - rest.len()]);
            start = text.len() - rest.len();
        }
    }
    found.push(&text[start..]);
    found
}

/// Returns the phrases of a text that break the rules.
fn faults(text: &str, rules: Rules) -> Vec<String> {
    let words = words(text);
    let lower: Vec<String> = words.iter().map(|(word, _)| word.to_lowercase()).collect();
    let at = |index: usize| lower.get(index).map_or("", String::as_str);
    let mut found = Vec::new();
    for (index, (word, is_question)) in words.iter().enumerate() {
        let is_parameter = word.len() > 1 && word.chars().all(char::is_uppercase);
        if *is_question || is_parameter {
            continue;
        }
        let before = if index == 0 { "" } else { at(index - 1) };
        let phrase = format!("{} {} {}", at(index), at(index + 1), at(index + 2));
        let is_capital = word.starts_with(char::is_uppercase);
        let is_unnamed = UNNAMED.contains(&at(index)) && !ACTORS.contains(&before);
        let is_form_of_be = ["is", "are", "was", "were"].contains(&at(index));
        let is_negated_noun = at(index + 1) == "no"
            && before != "there"
            && !["longer", "more", "less", "later", "larger"].contains(&at(index + 2));
        let is_passive =
            ["told", "met"].contains(&at(index + 1)) || (at(index + 1) == "to" && at(index + 2) == "be");
        let is_fault = match rules {
            Rules::All => is_unnamed || is_form_of_be && (is_negated_noun || is_passive),
            Rules::Beginnings => is_unnamed && is_capital || is_form_of_be && is_negated_noun,
        };
        if is_fault {
            found.push(phrase);
        }
    }
    found
}

/// Adds a line of a comment to the block that it continues, or begins another one.
fn add_comment(found: &mut Vec<Prose>, line: usize, last: &mut usize, text: &str) {
    match found.last_mut() {
        Some(block) if block.is_comment && *last + 1 == line && !text.is_empty() => {
            block.text.push(' ');
            block.text.push_str(text);
        }
        _ => found.push(Prose { line, is_comment: true, text: text.to_string() }),
    }
    *last = line;
}

/// Returns the comments and strings of a source whose comments begin with `mark`: `;` for ESL, `//` for Rust.
fn prose_of_source(source: &str, mark: &str) -> Vec<Prose> {
    let (mut found, mut rest, mut last) = (Vec::new(), source, 0);
    let line_at = |rest: &str| source[..source.len() - rest.len()].matches('\n').count() + 1;
    while let Some(c) = rest.chars().next() {
        if rest.starts_with(mark) {
            let end = rest.find('\n').unwrap_or(rest.len());
            let text = rest[..end].trim_start_matches(['/', '!', ';']).trim();
            add_comment(&mut found, line_at(rest), &mut last, text);
            rest = &rest[end..];
        } else if c == '"' {
            let (text, behind) = string(&rest[1..]);
            found.push(Prose { line: line_at(rest), is_comment: false, text: text.to_string() });
            rest = behind;
        } else if let Some(raw) = rest.strip_prefix("r#\"") {
            rest = raw.split_once("\"#").map_or("", |(_, behind)| behind);
        } else if let Some(literal) = rest.strip_prefix("#\\").filter(|_| mark == ";") {
            rest = literal.chars().next().map_or("", |c| &literal[c.len_utf8()..]);
        } else if let Some(literal) = rest.strip_prefix('\'').filter(|_| mark == "//") {
            rest = behind_character(literal);
        } else {
            rest = &rest[c.len_utf8()..];
        }
    }
    found
}

/// Returns the content of a string that has begun, and the text behind it.
fn string(text: &str) -> (&str, &str) {
    let mut is_escaped = false;
    for (at, c) in text.char_indices() {
        match c {
            _ if is_escaped => is_escaped = false,
            '\\' => is_escaped = true,
            '"' => return (&text[..at], &text[at + 1..]),
            _ => {}
        }
    }
    (text, "")
}

/// Returns the text behind a character of Rust whose quote was read, or `text` itself after the quote of a
/// lifetime.
fn behind_character(text: &str) -> &str {
    let mut chars = text.char_indices();
    match (chars.next(), chars.next(), chars.next()) {
        (Some((_, '\\')), Some((at, c)), _) => &text[at + c.len_utf8()..],
        (Some(_), Some((at, '\'')), _) => &text[at + 1..],
        _ => text,
    }
}

/// Returns the paragraphs of a document, without its blocks of code.
fn paragraphs(text: &str) -> Vec<Prose> {
    let (mut found, mut is_code): (Vec<Prose>, bool) = (Vec::new(), false);
    let mut is_open = false;
    for (line, number) in text.lines().zip(1..) {
        let is_fence = line.trim_start().starts_with("```");
        is_code ^= is_fence;
        if is_code || is_fence || line.trim().is_empty() {
            is_open = false;
            continue;
        }
        match found.last_mut() {
            Some(block) if is_open && !line.starts_with('|') => {
                block.text.push(' ');
                block.text.push_str(line);
            }
            _ => found.push(Prose { line: number, is_comment: false, text: line.to_string() }),
        }
        is_open = true;
    }
    found
}

/// Returns whether a string is a message or a docstring, not data.
fn is_message(text: &str) -> bool {
    text.split_whitespace().count() > 2
}

#[test]
fn prose_names_things_and_actors() {
    let programs = ["stdlib", "world/modules", "robots/modules", "trees/modules", "plans/modules"]
        .map(|folder| root().join(folder));
    let mut found = Vec::new();
    for path in files_below(root().to_path_buf()) {
        let name = path_in_tree(&path);
        let is_test = name.split('/').any(|part| ["tests", "tests.rs", "conformance"].contains(&part));
        let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
        let is_library = programs.iter().any(|folder| path.starts_with(folder));
        if !["rs", "esl", "md"].contains(&extension) || name == HISTORY || path.is_symlink() {
            continue;
        }
        let text = fs::read_to_string(&path).expect("a source can be read");
        let product =
            text.find("#[cfg(test)]\nmod tests {").map_or(usize::MAX, |at| text[..at].lines().count());
        let (prose, comments, strings) = match extension {
            "rs" => (prose_of_source(&text, "//"), Rules::Beginnings, (!is_test).then_some(Rules::All)),
            "esl" if is_library => (prose_of_source(&text, ";"), Rules::All, Some(Rules::All)),
            "esl" => (prose_of_source(&text, ";"), Rules::Beginnings, None),
            _ => (paragraphs(&text), Rules::All, Some(Rules::All)),
        };
        for Prose { line, is_comment, text } in prose {
            let is_linted = line <= product && is_message(&text);
            let rules = if is_comment { Some(comments) } else { strings.filter(|_| is_linted) };
            let phrases = rules.map(|rules| faults(&text, rules)).unwrap_or_default();
            found.extend(phrases.into_iter().map(|phrase| format!("{name}:{line}: {phrase}")));
        }
    }
    found.sort();
    assert!(found.is_empty(), "name the thing or the actor:\n{}", found.join("\n"));
}

#[test]
fn docstrings_begin_with_a_verb_that_acts() {
    let mut found = Vec::new();
    for folder in ["stdlib", "world", "robots", "trees", "plans"] {
        for path in files_below(root().join(folder)) {
            let mark = match path.extension().and_then(|extension| extension.to_str()) {
                Some("esl") => ";",
                Some("rs") => "//",
                _ => continue,
            };
            let text = fs::read_to_string(&path).expect("a source can be read");
            let strings = prose_of_source(&text, mark).into_iter().filter(|prose| !prose.is_comment);
            let passive =
                strings.filter(|prose| prose.text.starts_with("Has ") && !prose.text.starts_with("Has no "));
            found.extend(passive.map(|prose| format!("{}:{}", path_in_tree(&path), prose.line)));
        }
    }
    assert!(found.is_empty(), "say what the function does, not what it has done: {found:#?}");
}

#[test]
fn the_rules_of_prose_find_their_phrases() {
    let all = |text| faults(text, Rules::All);
    assert_eq!(all("Writes what was read."), ["what was read"]);
    assert_eq!(all("Users who attach; there is no file. WHAT is `what`. What is it?"), [""; 0]);
    assert_eq!(all("It is no file, and is to be told."), ["is no file", "is to be"]);
    assert_eq!(all("[a](what) whoever comes"), ["whoever comes "]);
    assert_eq!(faults("It says what. Who says it.", Rules::Beginnings), ["who says it"]);
    let source = "(a \"b c\" #\\\" ; d\n; e\n\"f\")";
    let texts: Vec<String> = prose_of_source(source, ";").into_iter().map(|prose| prose.text).collect();
    assert_eq!(texts, ["b c", "d e", "f"]);
    let source = "'\"' 'a \"b\" // c\n// d\n";
    let texts: Vec<String> = prose_of_source(source, "//").into_iter().map(|prose| prose.text).collect();
    assert_eq!(texts, ["b", "c d"]);
}
