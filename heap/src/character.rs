//! Characters: their case, classes and names. A character is a code point below 0x11_0000; surrogates are
//! included.
//!
//! Case is that of Common Lisp: a letter has case only if it and one other letter are each other's
//! counterparts. So `ß`, whose upper case is two letters, and `µ`, whose upper case belongs to another
//! letter, have none.

/// Returns the upper case of a letter that has one, and any other character itself.
#[inline]
pub fn upcase(code: u32) -> u32 {
    if code < 0x80 {
        return if code.wrapping_sub('a' as u32) < 26 { code - 32 } else { code };
    }
    partner(code, upper)
}

/// Returns the lower case of a letter that has one, and any other character itself.
#[inline]
pub fn downcase(code: u32) -> u32 {
    if code < 0x80 {
        return if code.wrapping_sub('A' as u32) < 26 { code + 32 } else { code };
    }
    partner(code, lower)
}

/// Returns a character that letters differing only in case share.
#[inline]
pub fn fold(code: u32) -> u32 {
    downcase(code)
}

fn partner(code: u32, map: fn(char) -> Option<char>) -> u32 {
    let Some(c) = char::from_u32(code) else { return code };
    match map(c) {
        Some(other) if upper(other) == Some(c) || lower(other) == Some(c) => other as u32,
        _ => code,
    }
}

/// The upper case, if it is one other character.
fn upper(c: char) -> Option<char> {
    let mut mapped = c.to_uppercase();
    if mapped.len() == 1 { mapped.next().filter(|&other| other != c) } else { None }
}

/// The lower case, if it is one other character.
fn lower(c: char) -> Option<char> {
    let mut mapped = c.to_lowercase();
    if mapped.len() == 1 { mapped.next().filter(|&other| other != c) } else { None }
}

/// Returns whether `code` is a letter in upper case.
pub fn is_upper(code: u32) -> bool {
    downcase(code) != code
}

/// Returns whether `code` is a letter in lower case.
pub fn is_lower(code: u32) -> bool {
    upcase(code) != code
}

/// Returns whether `code` is a letter.
pub fn is_alphabetic(code: u32) -> bool {
    // The standard library's alphabetic characters include marks that go above letters.
    char::from_u32(code).is_some_and(char::is_alphabetic) && !(0x300..0x370).contains(&code)
}

/// Returns whether `code` is a letter or a digit.
pub fn is_alphanumeric(code: u32) -> bool {
    is_alphabetic(code) || char::from_u32(code).is_some_and(char::is_numeric) && !is_small_number(code)
}

/// Returns whether `code` is a superscript, a fraction, or a number in a circle. These count as numbers but
/// are not digits.
fn is_small_number(code: u32) -> bool {
    matches!(code, 0xB2 | 0xB3 | 0xB9 | 0xBC..=0xBE | 0x2070..=0x209F | 0x2150..=0x218F | 0x2460..=0x24FF | 0x2776..=0x2793)
}

/// Returns whether `code` is not a control character.
pub fn is_graphic(code: u32) -> bool {
    (0x20..0x7F).contains(&code) || code >= 0xA0
}

/// Returns whether one can see the printed character and tell it from others.
fn is_visible(code: u32) -> bool {
    match char::from_u32(code) {
        Some(c) => !(c.is_control() || c.is_whitespace() || is_invisible(c)),
        None => false,
    }
}

/// Returns whether `c` shows nothing: soft hyphen, joiners, directions, byte order mark, noncharacters,
/// private use.
fn is_invisible(c: char) -> bool {
    matches!(c as u32,
        0xAD | 0x200B..=0x200F | 0x202A..=0x202E | 0x2060..=0x206F | 0xFEFF | 0xFFF9..=0xFFFB
        | 0xE000..=0xF8FF | 0xFDD0..=0xFDEF | 0xFFFE | 0xFFFF | 0xE0000..=0xE0FFF | 0xF_0000..=0x10_FFFF)
}

/// Returns the weight of a digit in `radix`. Digits of other scripts do not count.
///
/// # Panics
/// If `radix` is not between 2 and 36.
pub fn digit_weight(code: u32, radix: u32) -> Option<u32> {
    char::from_u32(code)?.to_digit(radix)
}

/// Names of characters that do not print as themselves. The first one for a code is the one that is printed.
const NAMES: [(u32, &str); 42] = [
    (0, "Nul"),
    (1, "Soh"),
    (2, "Stx"),
    (3, "Etx"),
    (4, "Eot"),
    (5, "Enq"),
    (6, "Ack"),
    (7, "Bel"),
    (8, "Backspace"),
    (9, "Tab"),
    (10, "Newline"),
    (11, "Vt"),
    (12, "Page"),
    (13, "Return"),
    (14, "So"),
    (15, "Si"),
    (16, "Dle"),
    (17, "Dc1"),
    (18, "Dc2"),
    (19, "Dc3"),
    (20, "Dc4"),
    (21, "Nak"),
    (22, "Syn"),
    (23, "Etb"),
    (24, "Can"),
    (25, "Em"),
    (26, "Sub"),
    (27, "Esc"),
    (28, "Fs"),
    (29, "Gs"),
    (30, "Rs"),
    (31, "Us"),
    (32, "Space"),
    (127, "Rubout"),
    (0xA0, "No-break_space"),
    (0, "Null"),
    (7, "Bell"),
    (10, "Linefeed"),
    (12, "Form"),
    (27, "Escape"),
    (32, "Sp"),
    (127, "Del"),
];

/// Returns the name of a character that does not print as itself: a word if the table above has one, else `U`
/// and its code in hexadecimal.
pub fn name(code: u32) -> Option<String> {
    if let Some((_, name)) = NAMES.iter().find(|&&(named, _)| named == code) {
        return Some((*name).into());
    }
    if is_visible(code) { None } else { Some(format!("U{code:X}")) }
}

/// Returns the character with this name, in any case.
pub fn named(name: &str) -> Option<u32> {
    if let Some(&(code, _)) = NAMES.iter().find(|(_, known)| known.eq_ignore_ascii_case(name)) {
        return Some(code);
    }
    let digits = name.strip_prefix(['U', 'u'])?;
    let digits = digits.strip_prefix('+').unwrap_or(digits);
    if digits.is_empty() || !digits.bytes().all(|digit| digit.is_ascii_hexdigit()) {
        return None;
    }
    u32::from_str_radix(digits, 16).ok().filter(|&code| code < crate::value::Value::CHARACTER_LIMIT)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_pairs_of_letters_have_case() {
        for (lower, upper) in [('a', 'A'), ('z', 'Z'), ('é', 'É'), ('λ', 'Λ'), ('я', 'Я')] {
            let (lower, upper) = (lower as u32, upper as u32);
            assert_eq!((upcase(lower), downcase(upper)), (upper, lower));
            assert!(is_lower(lower) && is_upper(upper) && !is_upper(lower) && !is_lower(upper));
        }
        for c in ['1', ' ', '@', '[', '`', '{', 'ß', 'µ', '中'] {
            let code = c as u32;
            assert_eq!((upcase(code), downcase(code)), (code, code), "{c}");
        }
        assert_eq!(upcase(0xD800), 0xD800);
    }

    #[test]
    fn names_read_back() {
        for code in (0..33).chain([127, 0xA0, 0xAD, 0xD800, 0xE000]) {
            let name = name(code).unwrap();
            assert_eq!(named(&name.to_uppercase()), Some(code), "{name}");
        }
        assert_eq!(name('a' as u32), None);
        assert_eq!(named("linefeed"), Some(10));
        assert_eq!((named("foo"), named("U"), named("u110000"), named("U+41")), (None, None, None, Some(65)));
    }
}
