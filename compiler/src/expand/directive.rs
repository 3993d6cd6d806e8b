//! Directives of `format`: how many arguments a constant control string takes.
//!
//! The answer is a range. It has no upper end where a directive goes back or takes all arguments, and no
//! answer is given for a string that `format` itself would refuse: then the failure says more than a count.

use std::iter::Peekable;
use std::str::Chars;

/// Numbers of arguments that a control string takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct DirectiveArguments {
    /// At least so many.
    pub(super) min: usize,
    /// At most so many; `None` without a limit.
    pub(super) max: Option<usize>,
}

/// A directive.
struct Directive {
    /// Its character, in lower case.
    kind: char,
    has_at: bool,
    has_colon: bool,
    /// Arguments that its parameters `v` take.
    taken: usize,
}

/// Returns the numbers of arguments that `control` takes.
pub(super) fn arguments_of(control: &str) -> Option<DirectiveArguments> {
    let mut characters = control.chars().peekable();
    let mut sum = DirectiveArguments { min: 0, max: Some(0) };
    while let Some(character) = characters.next() {
        if character != '~' {
            continue;
        }
        let directive = next_directive(&mut characters)?;
        let mut take = |count: usize| {
            // After a `~^`, the arguments need not be there.
            sum.min += count;
            sum.max = sum.max.map(|max| max + count);
        };
        take(directive.taken);
        match directive.kind {
            '%' | '&' | '|' | '~' | 't' | 'i' | '_' | '\n' | '(' | ')' => {}
            'a' | 's' | 'w' | 'd' | 'b' | 'o' | 'x' | 'r' | 'c' | 'f' | 'e' | 'g' | '$' | '/' => take(1),
            'p' if directive.has_colon => {}
            'p' => take(1),
            '{' => {
                // `~{~}` takes its control string from the arguments.
                let is_empty = characters.clone().take(2).eq(['~', '}']);
                skip_to('}', &mut characters).filter(|()| !is_empty)?;
                if directive.has_at {
                    sum.max = None;
                } else {
                    sum.min += 1;
                    sum.max = sum.max.map(|max| max + 1);
                }
            }
            '?' if !directive.has_at => take(2),
            // Conditionals, jumps, justification and escapes depend on the arguments.
            _ => return None,
        }
    }
    Some(sum)
}

/// Characters of the directives that there are.
const KNOWN: &str = "abcdefgioprstwx$%&|~*?^[]{}();<>_/\n";

/// Returns the first directive that there is not, as it is written.
pub(super) fn unknown_directive(control: &str) -> Option<String> {
    let mut characters = control.chars().peekable();
    while let Some(character) = characters.next() {
        if character == '~' {
            let kind = next_directive(&mut characters)?.kind;
            if !KNOWN.contains(kind) {
                return Some(format!("~{kind}"));
            }
        }
    }
    None
}

/// Takes the rest of a directive, behind its `~`.
fn next_directive(characters: &mut Peekable<Chars<'_>>) -> Option<Directive> {
    let mut directive = Directive { kind: ' ', has_at: false, has_colon: false, taken: 0 };
    loop {
        match characters.next()? {
            '@' => directive.has_at = true,
            ':' => directive.has_colon = true,
            'v' | 'V' => directive.taken += 1,
            '\'' => _ = characters.next()?,
            '#' | ',' | '+' | '-' | '0'..='9' => {}
            '/' => {
                // `~/name/` ends with another `/`.
                characters.by_ref().find(|&character| character == '/')?;
                directive.kind = '/';
                return Some(directive);
            }
            kind => {
                directive.kind = kind.to_ascii_lowercase();
                return Some(directive);
            }
        }
    }
}

/// Takes everything up to the directive that closes the one that was taken last.
fn skip_to(close: char, characters: &mut Peekable<Chars<'_>>) -> Option<()> {
    let mut open = 1;
    while let Some(character) = characters.next() {
        if character != '~' {
            continue;
        }
        match next_directive(characters)?.kind {
            '{' => open += 1,
            kind if kind == close => open -= 1,
            _ => {}
        }
        if open == 0 {
            return Some(());
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A control string, and the least and the largest number of its arguments.
    type Row = (&'static str, Option<(usize, Option<usize>)>);

    #[test]
    fn directives_that_there_are_not_are_found() {
        let table = [("~a ~q", Some("~q")), ("~2,'0q", Some("~q")), ("~Z", Some("~z")), ("~ a", Some("~ "))];
        let known = ["", "~", "~'", "a q", "~~q", "~,2f~10@<~a~>~:[no~;yes~]~^~*", "~\n  x", "~/q/"];
        for (control, expected) in table.into_iter().chain(known.map(|control| (control, None))) {
            assert_eq!(unknown_directive(control).as_deref(), expected, "{control}");
        }
    }

    #[test]
    fn directives_take_arguments() {
        let table: &[Row] = &[
            ("plain", Some((0, Some(0)))),
            ("~a and ~s~%", Some((2, Some(2)))),
            ("~,2f ~10d ~vd", Some((4, Some(4)))),
            ("~'*12d~~~&", Some((1, Some(1)))),
            ("~{~a~^, ~}~%", Some((1, Some(1)))),
            ("~@{~a ~}", Some((0, None))),
            ("~d file~:p", Some((1, Some(1)))),
            ("~(~a~)", Some((1, Some(1)))),
            ("~[zero~;one~]", None),
            ("~a~*~a", None),
            ("~/name/", Some((1, Some(1)))),
            ("~{~a", None),
            ("~{~}", None),
            ("~", None),
        ];
        for &(control, expected) in table {
            let expected = expected.map(|(min, max)| DirectiveArguments { min, max });
            assert_eq!(arguments_of(control), expected, "{control}");
        }
    }
}
