//! The facts and variables with which a run begins that goes on with those of another version of the machine.

use esl::Error;
use esl::program;
use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_vm::vm::Vm;

/// Has a machine begin its program with the facts and variables of an earlier run. `kept` has a line with the
/// milliseconds since they were written, and then lists and comments.
///
/// # Errors
/// As a call of the library: the text may not be readable.
pub fn set_kept(machine: &mut Vm, kept: &str) -> Result<(), Error> {
    let (milliseconds, text) = kept.split_once('\n').unwrap_or(("0", kept));
    let milliseconds: i64 = milliseconds.parse().unwrap_or(0);
    let forms = forms(text).into_iter().map(|form| Datum::string(form, Span::default()));
    program::set_kept(machine, std::iter::once(Datum::integer(milliseconds, Span::default())).chain(forms))
}

/// Returns the lists of a text, without the comments between them.
fn forms(text: &str) -> Vec<&str> {
    let mut forms = Vec::new();
    let (mut depth, mut begin) = (0_usize, 0);
    let mut characters = text.char_indices();
    while let Some((at, c)) = characters.next() {
        match c {
            ';' if depth == 0 => while characters.next().is_some_and(|(_, c)| c != '\n') {},
            '"' | '|' => {
                while let Some((_, inner)) = characters.next() {
                    match inner {
                        '\\' => drop(characters.next()),
                        _ if inner == c => break,
                        _ => {}
                    }
                }
            }
            // The character that follows is never one of these.
            '#' if text[at..].starts_with("#\\") => drop((characters.next(), characters.next())),
            '(' => {
                begin = if depth == 0 { at } else { begin };
                depth += 1;
            }
            ')' => {
                depth = depth.saturating_sub(1);
                if depth == 0 {
                    forms.push(&text[begin..=at]);
                }
            }
            _ => {}
        }
    }
    forms
}

#[cfg(test)]
mod tests {
    use super::forms;

    #[test]
    fn lists_are_told_apart() {
        let text = ";;; (no)\n(:a \"x)\\\")\n(\" #\\( |b)\\||)\n;;; end\n(:c (1 . 2))\n";
        assert_eq!(forms(text), ["(:a \"x)\\\")\n(\" #\\( |b)\\||)", "(:c (1 . 2))"]);
        assert!(forms("(:a (").is_empty());
    }
}
