//! Characters by name: `#\Space`, `#\U+00E9`.

/// Names of invisible characters; case does not matter. If a character has several names, the first is
/// printed.
pub const CHARACTER_NAMES: &[(&str, char)] = &[
    ("Nul", '\0'),
    ("Null", '\0'),
    ("Soh", '\x01'),
    ("Stx", '\x02'),
    ("Etx", '\x03'),
    ("Eot", '\x04'),
    ("Enq", '\x05'),
    ("Ack", '\x06'),
    ("Bel", '\x07'),
    ("Bell", '\x07'),
    ("Backspace", '\x08'),
    ("Tab", '\t'),
    ("Newline", '\n'),
    ("Linefeed", '\n'),
    ("Vt", '\x0b'),
    ("Page", '\x0c'),
    ("Return", '\r'),
    ("So", '\x0e'),
    ("Si", '\x0f'),
    ("Dle", '\x10'),
    ("Dc1", '\x11'),
    ("Dc2", '\x12'),
    ("Dc3", '\x13'),
    ("Dc4", '\x14'),
    ("Nak", '\x15'),
    ("Syn", '\x16'),
    ("Etb", '\x17'),
    ("Can", '\x18'),
    ("Em", '\x19'),
    ("Sub", '\x1a'),
    ("Esc", '\x1b'),
    ("Escape", '\x1b'),
    ("Fs", '\x1c'),
    ("Gs", '\x1d'),
    ("Rs", '\x1e'),
    ("Us", '\x1f'),
    ("Space", ' '),
    ("Rubout", '\x7f'),
    ("Delete", '\x7f'),
    ("Del", '\x7f'),
    ("No-break_space", '\u{a0}'),
];

/// Returns the character that `#\` and this text denote. The text is not empty.
pub(super) fn parse(text: &str) -> Option<char> {
    let mut chars = text.chars();
    let first = chars.next()?;
    if chars.as_str().is_empty() {
        return Some(first);
    }
    let named = CHARACTER_NAMES.iter().find(|(name, _)| name.eq_ignore_ascii_case(text));
    named.map(|&(_, c)| c).or_else(|| by_number(text))
}

/// Parses `U+00E9` or `U00E9`: hexadecimal digits.
fn by_number(text: &str) -> Option<char> {
    let digits = text.strip_prefix(['U', 'u'])?;
    let digits = digits.strip_prefix('+').unwrap_or(digits);
    let is_number = !digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_hexdigit());
    is_number.then(|| u32::from_str_radix(digits, 16).ok().and_then(char::from_u32)).flatten()
}

/// Returns the name that an unknown name probably stands for.
pub(super) fn similar(text: &str) -> Option<&'static str> {
    const MISTAKEN: &[(&str, &str)] = &[
        ("blank", "Space"),
        ("spc", "Space"),
        ("cr", "Return"),
        ("lf", "Newline"),
        ("nl", "Newline"),
        ("eol", "Newline"),
        ("bs", "Backspace"),
        ("ff", "Page"),
        ("formfeed", "Page"),
        ("alarm", "Bel"),
        ("nbsp", "No-break_space"),
    ];
    let mistaken = MISTAKEN.iter().find(|(name, _)| name.eq_ignore_ascii_case(text)).map(|&(_, meant)| meant);
    let begins = |name: &str| {
        text.len() > 1 && name.get(..text.len()).is_some_and(|head| head.eq_ignore_ascii_case(text))
    };
    mistaken.or_else(|| CHARACTER_NAMES.iter().map(|&(name, _)| name).find(|name| begins(name)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn characters_stand_for_themselves_or_have_names() {
        let check = |text, expected| assert_eq!(parse(text), expected, "{text}");
        check("a", Some('a'));
        check("(", Some('('));
        check("λ", Some('λ'));
        check("u", Some('u'));
        check("SPACE", Some(' '));
        check("linefeed", Some('\n'));
        check("U+00E9", Some('é'));
        check("u00e9", Some('é'));
        check("U+1F600", Some('😀'));
        check("U+D800", None);
        check("U+110000", None);
        check("U+", None);
        check("e\u{301}", None);
        check("NoSuchName", None);
    }
}
