//! Transcripts of sessions with the REPL: the typed text and the expected answers, verbatim.
//!
//! ```text
//! ; a comment, up to the first prompt
//! ? (list 1
//!         2)
//! (1 2)
//! ? (print 'x)
//!
//! X
//! X
//! ```
//!
//! A line that begins with `? `, or a number before that, is typed, and so are the lines after it until its
//! parentheses are closed. The text up to the next such line is the answer. Trailing blanks and empty lines
//! at the very end are ignored.

use std::fmt;

/// The first place where an output differs from the expected one, with the lines around it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OutputDifference {
    /// The line, from 1.
    pub line: usize,
    /// Lines that were expected.
    pub expected: String,
    /// Lines in their place.
    pub found: String,
}

impl fmt::Display for OutputDifference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let OutputDifference { line, expected, found } = self;
        write!(f, "line {line}: expected\n{expected}\nfound\n{found}")
    }
}

impl std::error::Error for OutputDifference {}

/// A transcript.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Transcript {
    /// All typed text.
    pub input: String,
    /// All expected answers.
    pub output: String,
}

impl Transcript {
    /// Parses a transcript.
    pub fn parse(text: &str) -> Transcript {
        let mut transcript = Transcript::default();
        let mut is_typed = false;
        let mut form = String::new();
        let mut has_begun = false;
        for line in text.lines() {
            // While forms wait for the choice of a restart, their number is in the prompt.
            let prompt = line.trim_start_matches(|c: char| c.is_ascii_digit());
            let prompted = prompt.strip_prefix("? ").or((prompt == "?").then_some(""));
            if !is_typed && let Some(typed) = prompted {
                has_begun = true;
                form.clear();
                form.push_str(typed);
                is_typed = true;
            } else if is_typed {
                form.push('\n');
                form.push_str(line);
            } else if has_begun {
                transcript.output.push_str(line.trim_end());
                transcript.output.push('\n');
            }
            if is_typed && is_whole(&form) {
                is_typed = false;
                transcript.input.push_str(&form);
                transcript.input.push('\n');
            }
        }
        transcript
    }

    /// Compares the expected output with the REPL's output.
    ///
    /// # Errors
    /// The first difference.
    pub fn compare(&self, found: &str) -> Result<(), OutputDifference> {
        compare(&self.output, found)
    }
}

/// Compares outputs line by line.
///
/// # Errors
/// The first difference.
pub fn compare(expected: &str, found: &str) -> Result<(), OutputDifference> {
    let lines = |text: &str| -> Vec<String> {
        text.trim_end().lines().map(|line| line.trim_end().to_string()).collect()
    };
    let (expected, found) = (lines(expected), lines(found));
    if expected == found {
        return Ok(());
    }
    let first =
        expected.iter().zip(&found).position(|(a, b)| a != b).unwrap_or(expected.len().min(found.len()));
    let part = |lines: &[String]| {
        let end = lines.len().min(first + 5);
        lines[first.saturating_sub(3).min(end)..end].join("\n")
    };
    Err(OutputDifference { line: first + 1, expected: part(&expected), found: part(&found) })
}

/// Returns whether the parentheses and strings of a text are closed.
fn is_whole(text: &str) -> bool {
    let (mut depth, mut in_string) = (0, false);
    let mut characters = text.chars();
    while let Some(character) = characters.next() {
        match character {
            '\\' => drop(characters.next()),
            '"' => in_string = !in_string,
            _ if in_string => {}
            ';' => drop(characters.by_ref().find(|&c| c == '\n')),
            '(' => depth += 1,
            ')' => depth -= 1,
            _ => {}
        }
    }
    depth <= 0 && !in_string
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn typed_lines_are_distinguished_from_answers() {
        let transcript = Transcript::parse("; comment\n? (list 1 ; (\n   \"(\" #\\()\n(1)\n? 5\n5\n?\n");
        assert_eq!(transcript.input, "(list 1 ; (\n   \"(\" #\\()\n5\n\n");
        assert_eq!(transcript.output, "(1)\n5\n");
        assert!(transcript.compare("(1) \n5\n\n").is_ok());
        assert!(transcript.compare("(1)\n6\n").is_err());
    }
}
