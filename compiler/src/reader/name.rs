//! Names: the package and name that the text of a token denotes, with case folded and escapes resolved.

/// Bytes of a name, at most.
pub const MAX_NAME: usize = 1 << 16;

/// Package in which a name is looked up.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Prefix {
    /// The current package.
    None,
    /// `:name`
    Keyword,
    /// `package:name`, or `package::name` if internal.
    Package { package: String, internal: bool },
}

/// A name taken apart.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct NameParts {
    pub(super) prefix: Prefix,
    pub(super) name: String,
}

/// A fault in the text of a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NameError {
    /// There is a second package prefix.
    SecondPrefix,
    /// There is no name behind the prefix.
    Missing,
}

impl NameError {
    /// Returns the message about this fault of `text`.
    pub(super) fn message(self, text: &str) -> String {
        let shown = shorten(text);
        match self {
            NameError::SecondPrefix => {
                format!("expected at most one package prefix, found another `:` in `{shown}`")
            }
            NameError::Missing => format!("expected a name after `{shown}`, found none"),
        }
    }
}

/// Returns the upper case of a letter, if that is one character, and any other character itself. So `ß` is
/// unchanged, since its upper case has two characters.
pub fn fold(c: char) -> char {
    if c.is_ascii() {
        return c.to_ascii_uppercase();
    }
    let mut upper = c.to_uppercase();
    match (upper.next(), upper.next()) {
        (Some(folded), None) => folded,
        _ => c,
    }
}

/// Takes the text of a name apart.
///
/// # Errors
/// [`NameError`], if colons are misplaced.
pub(super) fn parse(text: &str) -> Result<NameParts, NameError> {
    let mut prefix = Prefix::None;
    let mut name = String::with_capacity(text.len());
    let mut chars = text.chars();
    // Whether the current part of the name was given, perhaps as the empty name `||`.
    let mut is_given = false;
    let mut in_bars = false;
    while let Some(c) = chars.next() {
        match c {
            '\\' => {
                name.extend(chars.next());
                is_given = true;
            }
            '|' => {
                in_bars = !in_bars;
                is_given = true;
            }
            ':' if !in_bars => {
                if prefix != Prefix::None {
                    return Err(NameError::SecondPrefix);
                }
                let mut rest = chars.clone();
                let internal = rest.next() == Some(':');
                if internal {
                    chars = rest;
                }
                let package = std::mem::take(&mut name);
                prefix = if is_given { Prefix::Package { package, internal } } else { Prefix::Keyword };
                is_given = false;
            }
            c => {
                name.push(if in_bars { c } else { fold(c) });
                is_given = true;
            }
        }
    }
    if !is_given {
        return Err(NameError::Missing);
    }
    Ok(NameParts { prefix, name })
}

/// Returns the value of a row of decimal digits, if it is small enough.
pub(super) fn digits(text: &str) -> Option<u32> {
    text.parse().ok()
}

/// Returns the beginning of a text, for messages.
pub(super) fn shorten(text: &str) -> String {
    const LENGTH: usize = 40;
    match text.char_indices().nth(LENGTH) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(text: &str, expected: &str) {
        let shown = match parse(text) {
            Ok(NameParts { prefix: Prefix::None, name }) => name,
            Ok(NameParts { prefix: Prefix::Keyword, name }) => format!("keyword {name}"),
            Ok(NameParts { prefix: Prefix::Package { package, internal }, name }) => {
                format!("{name} {} {package}", if internal { "in" } else { "of" })
            }
            Err(error) => error.message(text),
        };
        assert_eq!(shown, expected, "{text}");
    }

    #[test]
    fn names_are_folded_and_unescaped() {
        check("foo", "FOO");
        check("foo|bar|baz", "FOObarBAZ");
        check(r"a\b", "Ab");
        check(r"|a\|b|", "a|b");
        check("||", "");
        check("été", "ÉTÉ");
        check("straße", "STRAßE");
        check(r"\:a", ":A");
    }

    #[test]
    fn a_colon_divides_package_and_name() {
        check("cl:car", "CAR of CL");
        check("cl::car", "CAR in CL");
        check(":key", "keyword KEY");
        check("::key", "keyword KEY");
        check(":|low|", "keyword low");
        check("|a:b|:c", "C of a:b");
        check("cl:||", " of CL");
        check("||:a", "A of ");
    }

    #[test]
    fn too_many_colons_and_missing_names_are_reported() {
        check(":", "expected a name after `:`, found none");
        check("cl:", "expected a name after `cl:`, found none");
        check("a:b:c", "expected at most one package prefix, found another `:` in `a:b:c`");
        check("a:::b", "expected at most one package prefix, found another `:` in `a:::b`");
        check(":a:b", "expected at most one package prefix, found another `:` in `:a:b`");
    }
}
