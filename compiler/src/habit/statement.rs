//! Lines at top level that are statements of another language: `def main():`, `x = 5`, `print("hello")`,
//! `# text`.
//!
//! A statement reaches to the end of its line, and over the lines after it that belong to it: indented lines,
//! closing braces, and parts such as `else:`. Each kind is reported once for a text, so that a text in
//! Python has a few messages that teach, and not one for each line.
//!
//! Guarantees: a line that begins with `(`, or with anything that ESL itself gives a meaning there, is not a
//! statement. Finding the end of a statement takes time in proportion to its length.

use super::operator;
use super::word;

/// Kind of a foreign statement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum StatementKind {
    /// A comment that begins with `#`, `//` or `/*`.
    Comment,
    /// A line for a preprocessor, such as `#include`.
    Directive,
    /// The definition of a function.
    Function,
    /// The definition of a variable, or an assignment.
    Assignment,
    /// A call, with the name before the parentheses.
    Call,
    /// Another statement, which begins with a word.
    Word,
    /// A brace on a line of its own.
    Brace,
    /// The `'` at the end of a text.
    Text,
}

/// A foreign statement.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Statement {
    /// Its kind.
    pub kind: StatementKind,
    /// The byte at which it begins.
    pub start: usize,
    /// The byte after its first line, where the report ends.
    pub line_end: usize,
    /// The byte after its last line, at which reading continues.
    pub end: usize,
    /// The report.
    pub message: String,
    /// Advice.
    pub help: String,
}

/// Words that begin the definition of a function.
const FUNCTIONS: &[&str] = &["def", "function", "func", "fn", "void"];
/// Words that begin the definition of a variable.
const VARIABLES: &[&str] =
    &["let", "var", "const", "val", "int", "float", "double", "char", "bool", "auto", "static", "local"];
/// Words that continue the statement before them.
const CONTINUING: &[&str] = &["else", "elif", "except", "finally", "catch", "end"];
/// Directives of the preprocessor of C.
const DIRECTIVES: &[&str] = &["include", "define", "pragma", "ifdef", "ifndef", "endif", "undef"];

/// Returns the foreign statement that begins at byte `at` of `text`, the first byte of a top-level datum.
pub fn statement(text: &str, at: usize) -> Option<Statement> {
    let rest = &text[at..];
    let line = rest.lines().next().unwrap_or_default().trim_end();
    let first = line.chars().next()?;
    match first {
        '\'' if text[..at].ends_with(char::is_alphanumeric) => Some(Statement {
            kind: StatementKind::Text,
            start: at,
            line_end: at + 1,
            end: at + 1,
            message: TEXT_MESSAGE.into(),
            help: "write `\"text\"`".into(),
        }),
        '#' => comment_or_directive(text, at, line),
        '/' if line.starts_with("//") || line.starts_with("/*") => Some(comment(text, at, line, &line[..2])),
        '{' | '}' if line.trim_end_matches([';', ',', ')']).len() == 1 => Some(Statement {
            kind: StatementKind::Brace,
            start: at,
            line_end: at + line.len(),
            end: end_of_line(text, at),
            message: format!("expected a form in parentheses, found `{first}`"),
            help: "write the forms that belong together within the parentheses of one form".into(),
        }),
        _ if first.is_alphabetic() || first == '_' => words(text, at, line),
        _ => None,
    }
}

fn comment_or_directive(text: &str, at: usize, line: &str) -> Option<Statement> {
    let after = &line[1..];
    let name: String = after.chars().take_while(char::is_ascii_alphabetic).collect();
    if DIRECTIVES.contains(&&*name) {
        return Some(Statement {
            kind: StatementKind::Directive,
            start: at,
            line_end: at + line.len(),
            end: end_of_line(text, at),
            message: format!("`#{name}` is a line for a preprocessor, which ESL does not have"),
            help:
                "write `(require \"module\")` for a module, and `(defconstant +name+ value)` for a constant"
                    .into(),
        });
    }
    let is_comment =
        after.is_empty() || after.starts_with([' ', '\t', '#', '!', '-', '=']) && !is_conditional(after);
    // `#P"…"` and the like have one letter.
    let is_word =
        name.len() > 1 && !after.starts_with(['x', 'X', 'b', 'B', 'o', 'O']) && !after.contains('(');
    (is_comment || is_word).then(|| comment(text, at, line, "#"))
}

/// Whether the text after a `#` makes the next datum conditional: `#-feature`.
fn is_conditional(after: &str) -> bool {
    after.starts_with('-') && !after.starts_with("--")
}

fn comment(text: &str, at: usize, line: &str, mark: &str) -> Statement {
    let end = match mark {
        "/*" => text[at..].find("*/").map_or(text.len(), |length| at + length + 2),
        _ => end_of_line(text, at),
    };
    Statement {
        kind: StatementKind::Comment,
        start: at,
        line_end: at + line.len(),
        end,
        message: comment_message(mark),
        help: COMMENT_HELP.into(),
    }
}

/// Advice on comments.
pub const COMMENT_HELP: &str = "write `; comment`, or `#| comment |#` for several lines";

/// The message about a text between single quotes.
pub const TEXT_MESSAGE: &str = "a text stands between `\"` in ESL, not between `'`";

/// Returns the message about a comment that begins with `mark`.
pub fn comment_message(mark: &str) -> String {
    format!("a comment begins with `;` in ESL, not with `{mark}`")
}

/// Returns the statement that begins with a word.
fn words(text: &str, at: usize, line: &str) -> Option<Statement> {
    let is_part = |c: char| c.is_alphanumeric() || matches!(c, '_' | '.' | '$');
    let name = &line[..line.find(|c| !is_part(c)).unwrap_or(line.len())];
    let glued = &line[name.len()..];
    let after = glued.trim_start();
    let statement = |kind, message: String, help: String| {
        let (line_end, end) = (at + line.len(), end_of_block(text, at));
        Some(Statement { kind, start: at, line_end, end, message, help })
    };
    if FUNCTIONS.contains(&name) && !after.is_empty() {
        let (function, parameters) = header(after);
        let help = format!("write `(defun {function} ({parameters}) …)`");
        let languages = word::statement(name).map_or("other languages", |word| word.languages);
        let message = format!("`{name} {function}` defines a function in {languages}, not in ESL");
        return statement(StatementKind::Function, message, help);
    }
    if VARIABLES.contains(&name) && !after.is_empty() && !glued.starts_with('(') {
        // `int main() {` defines a function.
        let variable: String = after.chars().take_while(|&c| is_part(c)).collect();
        let behind = after[variable.len()..].trim_start();
        if behind.starts_with('(') && !variable.is_empty() {
            let (function, parameters) = header(after);
            let message = format!("`{name} {function}(…)` defines a function in C, not in ESL");
            let help = format!("write `(defun {function} ({parameters}) …)`");
            return statement(StatementKind::Function, message, help);
        }
        return assignment(&variable, behind, |message, help| {
            statement(StatementKind::Assignment, message, help)
        });
    }
    if glued.starts_with('(') {
        let close = line.rfind(')').unwrap_or(line.len());
        let inside = &line[(name.len() + 1).min(close)..close];
        let ends = line.get(close + 1..).unwrap_or_default().trim_end_matches(';').trim();
        let call = operator::call(name, if ends.is_empty() { inside } else { "…" });
        if let Some(word) = word::statement(name) {
            return statement(StatementKind::Word, word.message(), word.help());
        }
        let message = format!("a call begins with its parenthesis, not with `{name}(`");
        return statement(StatementKind::Call, message, format!("write `{call}`"));
    }
    if after.starts_with('=') && !after.starts_with("==") || after.starts_with(":=") {
        return assignment(name, after, |message, help| statement(StatementKind::Assignment, message, help));
    }
    // A bare name that is a word of ESL too, such as `t`, is a form.
    let word = word::statement(name).filter(|_| !after.is_empty() || line.len() > name.len())?;
    statement(StatementKind::Word, word.message(), word.help())
}

/// Returns the report about an assignment to `variable`; `after` begins with the mark before the value.
fn assignment<T>(variable: &str, after: &str, report: impl Fn(String, String) -> T) -> T {
    let value = after.trim_start_matches([':', '=']).trim();
    let value = operator::plain(value).unwrap_or_else(|| "value".to_string());
    let message = "an assignment is a form in parentheses in ESL".to_string();
    let help = format!(
        "write `(defvar {variable} {value})` for a new variable, `(setf {variable} {value})` for an old one"
    );
    report(message, help)
}

/// Returns the name and the parameters of `name(a, b) …`.
fn header(text: &str) -> (String, String) {
    let name: String = text.chars().take_while(|&c| c.is_alphanumeric() || c == '_').collect();
    let inside = text.split_once('(').map(|(_, rest)| rest.split(')').next().unwrap_or_default());
    let parameters = inside.unwrap_or_default().split(',').filter_map(|parameter| {
        // A type stands before the name in C, and after a colon elsewhere.
        let parameter = parameter.split([':', '=']).next().unwrap_or_default();
        let name = parameter.split_whitespace().last().unwrap_or_default().trim_start_matches(['*', '&']);
        (!name.is_empty() && name != "void").then(|| name.to_string())
    });
    (name, parameters.collect::<Vec<_>>().join(" "))
}

/// Returns the byte after the line of byte `at`.
fn end_of_line(text: &str, at: usize) -> usize {
    text[at..].find('\n').map_or(text.len(), |length| at + length + 1)
}

/// Returns the byte after the lines that belong to the statement at byte `at`.
fn end_of_block(text: &str, at: usize) -> usize {
    let mut end = end_of_line(text, at);
    // Blank lines belong to it if an indented line follows.
    let mut next = end;
    while next < text.len() {
        let line_end = end_of_line(text, next);
        let line = &text[next..line_end];
        let first: String = line.chars().take_while(char::is_ascii_alphabetic).collect();
        let belongs = line.starts_with([' ', '\t', '}', ')', ']']) || CONTINUING.contains(&&*first);
        if line.trim().is_empty() {
            next = line_end;
            continue;
        }
        if !belongs {
            break;
        }
        (end, next) = (line_end, line_end);
    }
    end
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(text: &str, kind: StatementKind, help: &str) {
        let found = statement(text, 0).unwrap_or_else(|| panic!("{text:?} is not a statement"));
        assert_eq!((found.kind, &*found.help), (kind, help), "{text}");
    }

    #[test]
    fn statements_of_other_languages_are_recognized() {
        check("def main():\n    print(1)\n(print 2)", StatementKind::Function, "write `(defun main () …)`");
        check("function add(a, b) {", StatementKind::Function, "write `(defun add (a b) …)`");
        check("int add(int a, int *b) {", StatementKind::Function, "write `(defun add (a b) …)`");
        check("print('hello');", StatementKind::Call, "write `(print \"hello\")`");
        check("main()", StatementKind::Call, "write `(main)`");
        check("# text", StatementKind::Comment, COMMENT_HELP);
        check("#comment", StatementKind::Comment, COMMENT_HELP);
        check("// text", StatementKind::Comment, COMMENT_HELP);
        check("while (x < 3) {", StatementKind::Word, "write `(loop while test do …)`");
        check("import os", StatementKind::Word, "write `(require \"module\")`");
        let x = "write `(defvar x 5)` for a new variable, `(setf x 5)` for an old one";
        check("x = 5", StatementKind::Assignment, x);
        check("let x = 5;", StatementKind::Assignment, x);
    }

    #[test]
    fn forms_of_esl_are_not_statements() {
        let forms =
            ["(print 1)", "x", "t", "*x*", "#+sbcl (a)", "#-sbcl (a)", "#.(a)", "#'car", "#P\"x\"", "#xFF"];
        for form in
            forms.into_iter().chain(["#\\a", "'a", "\"text\"", "#(1 2)", "#S(point :x 1)", "#*01", ":a"])
        {
            assert_eq!(statement(form, 0), None, "{form}");
        }
    }

    #[test]
    fn a_statement_ends_before_the_next_line_that_is_not_its_own() {
        let ends = |text: &str| statement(text, 0).map(|found| text[found.end..].to_string());
        assert_eq!(ends("def f():\n    a\n\n    b\n(print 1)").as_deref(), Some("(print 1)"));
        assert_eq!(ends("if (x) {\n  y();\n} else {\n  z();\n}\n\n(f)").as_deref(), Some("\n(f)"));
        assert_eq!(ends("/* a\n b */ (f)").as_deref(), Some(" (f)"));
    }
}
