//! Statements of other languages at the prompt.

use esl_compiler::habit::statement::statement;

/// Returns the answer to a text that begins with a statement of another language: what it is, and what to
/// write instead.
pub(super) fn foreign(text: &str) -> Option<String> {
    let at = text.len() - text.trim_start().len();
    if at == text.len() {
        return None;
    }
    let found = statement(text, at)?;
    Some(format!("; {}\n; {}\n", found.message, found.help))
}

#[cfg(test)]
mod tests {
    use super::foreign;

    #[test]
    fn statements_are_answered_and_forms_are_not() {
        for text in
            ["x = 5\n", "print(\"hello\")\n", "  def go():\n", "# a comment\n", "let x = 1;\n", "exit()\n"]
        {
            let answer = foreign(text).unwrap_or_else(|| panic!("{text}"));
            assert!(
                answer.starts_with("; ") && answer.ends_with('\n') && answer.lines().count() >= 2,
                "{answer}"
            );
        }
        for text in [
            "",
            "  \n",
            "x\n",
            "*x*\n",
            "x y\n",
            "(+ 1 2)\n",
            "'x\n",
            "#'car\n",
            "5\n",
            "\"text\"\n",
            "; x = 5\n",
            "#| x |#\n",
            "exit\n",
            "help\n",
            ":key\n",
            "#(1 2)\n",
            "`(a ,@b)\n",
            "(print\n",
        ] {
            assert_eq!(foreign(text), None, "{text}");
        }
    }
}
