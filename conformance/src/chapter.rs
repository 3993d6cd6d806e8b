//! The examples of a chapter of the manual.
//!
//! The `lisp` blocks of a chapter form one program, in order. A block without a language, directly after a
//! `lisp` block, shows the output of that block. A `repl` block is a session (see [`crate::transcript`]) that
//! has loaded the `lisp` blocks before it. Blocks in other languages are ignored.

use crate::fault::{LineFault, WrongLine};

/// An example of a chapter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Example {
    /// A `lisp` block.
    Program {
        /// Text of the block.
        text: String,
        /// Expected output; `None` if the manual does not show any.
        output: Option<String>,
    },
    /// The text of a `repl` block.
    Session(String),
}

/// Returns the examples of a chapter, each with the line on which it begins.
///
/// # Errors
/// [`WrongLine`], if a block is not closed or an output block does not follow a program.
pub fn examples(markdown: &str) -> Result<Vec<(usize, Example)>, WrongLine> {
    let mut found: Vec<(usize, Example)> = Vec::new();
    let mut lines = markdown.lines().enumerate();
    while let Some((index, line)) = lines.next() {
        let Some(language) = line.strip_prefix("```") else { continue };
        let mut text = String::new();
        loop {
            match lines.next() {
                Some((_, "```")) => break,
                Some((_, line)) => {
                    text.push_str(line);
                    text.push('\n');
                }
                None => return Err(LineFault::UnclosedBlock.on(index + 1)),
            }
        }
        match language.trim() {
            "lisp" => found.push((index + 1, Example::Program { text, output: None })),
            "repl" => found.push((index + 1, Example::Session(text))),
            "" => match found.last_mut() {
                Some((_, Example::Program { output: output @ None, .. })) => *output = Some(text),
                _ => return Err(LineFault::OutputWithoutProgram.on(index + 1)),
            },
            _ => {}
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_programs_outputs_and_sessions() {
        let text = "A\n```lisp\n(print 1)\n```\nprints\n```\n1\n```\n```repl\n? 5\n5\n```\n```sh\nls\n```\n";
        let found = examples(text).unwrap();
        let program = Example::Program { text: "(print 1)\n".into(), output: Some("1\n".into()) };
        assert_eq!(found, [(2, program), (9, Example::Session("? 5\n5\n".into()))]);
        assert!(examples("```lisp\n(print 1)").is_err());
        assert!(examples("```\n1\n```\n").is_err());
    }
}
