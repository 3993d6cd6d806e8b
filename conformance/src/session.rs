//! Sessions with the REPL as text: what is typed, and what has to be answered, to the letter.
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
//! A line that begins with `? ` is typed, and so are the lines after it until its parentheses are closed. What follows, up
//! to the next such line, is the answer; blanks at the end of a line do not count, nor do empty lines at the very end.

/// A session.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Session {
    /// All that is typed.
    pub input: String,
    /// All that is answered.
    pub output: String,
}

impl Session {
    /// Reads a session.
    pub fn parse(text: &str) -> Session {
        let mut session = Session::default();
        let mut is_typed = false;
        let mut form = String::new();
        let mut has_begun = false;
        for line in text.lines() {
            let prompted = line.strip_prefix("? ").or((line == "?").then_some(""));
            if !is_typed && let Some(typed) = prompted {
                has_begun = true;
                form.clear();
                form.push_str(typed);
                is_typed = true;
            } else if is_typed {
                form.push('\n');
                form.push_str(line);
            } else if has_begun {
                session.output.push_str(line.trim_end());
                session.output.push('\n');
            }
            if is_typed && is_whole(&form) {
                is_typed = false;
                session.input.push_str(&form);
                session.input.push('\n');
            }
        }
        session
    }

    /// Compares the output with what the REPL has written.
    ///
    /// # Errors
    /// The first difference.
    pub fn compare(&self, found: &str) -> Result<(), String> {
        compare(&self.output, found)
    }
}

/// Compares outputs line by line.
///
/// # Errors
/// The first difference, with what comes before and after it.
pub fn compare(expected: &str, found: &str) -> Result<(), String> {
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
    Err(format!("line {}: expected\n{}\nfound\n{}", first + 1, part(&expected), part(&found)))
}

/// Whether the parentheses and strings of a text are closed.
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
    fn typed_lines_and_answers_are_told_apart() {
        let session = Session::parse("; comment\n? (list 1 ; (\n   \"(\" #\\()\n(1)\n? 5\n5\n?\n");
        assert_eq!(session.input, "(list 1 ; (\n   \"(\" #\\()\n5\n\n");
        assert_eq!(session.output, "(1)\n5\n");
        assert!(session.compare("(1) \n5\n\n").is_ok());
        assert!(session.compare("(1)\n6\n").is_err());
    }
}
