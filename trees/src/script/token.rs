//! Tokens of a script.

use super::ScriptFault;

/// A token.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum ScriptToken {
    /// A number, as it is written in ESL.
    Number(String),
    Text(String),
    Boolean(bool),
    Name(String),
    /// An operator, a parenthesis or a semicolon.
    Operator(&'static str),
}

/// Operators, the longer ones first.
const OPERATORS: [&str; 29] = [
    "..", "&&", "||", "==", "!=", "<=", ">=", ":=", "+=", "-=", "*=", "/=", "+", "-", "*", "/", "&", "|",
    "^", "~", "!", "<", ">", "=", "?", ":", "(", ")", ";",
];

/// Returns the tokens of a script; or what cannot be read.
pub(crate) fn tokens(text: &str) -> Result<Vec<ScriptToken>, ScriptFault> {
    let mut tokens = Vec::new();
    let mut rest = text.trim_start();
    while let Some(first) = rest.chars().next() {
        let length = if first == '\'' {
            let Some(end) = rest[1..].find('\'') else {
                return Err(format!("the text {rest} has no end: expected a second `'`").into());
            };
            tokens.push(ScriptToken::Text(rest[1..=end].to_owned()));
            end + 2
        } else if first.is_ascii_digit() {
            let length = number_length(rest);
            tokens.push(ScriptToken::Number(number(&rest[..length])?));
            length
        } else if first.is_ascii_alphabetic() || first == '_' || first == '@' {
            let is_part = |c: char| c.is_ascii_alphanumeric() || c == '_';
            let length = 1 + rest[1..].find(|c| !is_part(c)).unwrap_or(rest.len() - 1);
            let word = &rest[..length];
            tokens.push(match word {
                "true" | "false" => ScriptToken::Boolean(word == "true"),
                _ => ScriptToken::Name(word.to_owned()),
            });
            length
        } else if let Some(operator) = OPERATORS.iter().find(|operator| rest.starts_with(**operator)) {
            tokens.push(ScriptToken::Operator(operator));
            operator.len()
        } else {
            return Err(format!("`{first}` is not part of the language of scripts").into());
        };
        rest = rest[length..].trim_start();
    }
    Ok(tokens)
}

/// Returns the length of what begins as a number: up to the next character that cannot be part of one.
fn number_length(text: &str) -> usize {
    let mut previous = ' ';
    for (at, c) in text.char_indices() {
        let is_sign = matches!(c, '+' | '-') && matches!(previous, 'e' | 'E') && !text.starts_with("0x");
        let is_dot = c == '.' && !text[at..].starts_with("..") && previous != '.';
        if !(c.is_ascii_alphanumeric() || c == '_' || is_sign || is_dot) {
            return at;
        }
        previous = c;
    }
    text.len()
}

/// Returns a number as it is written in ESL.
fn number(text: &str) -> Result<String, ScriptFault> {
    let wrong = || {
        ScriptFault(format!("`{text}` is not a number: expected one such as `12`, `0x1F`, `0.5` or `1e3`"))
    };
    let hexadecimal = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X"));
    if let Some(digits) = hexadecimal {
        return i64::from_str_radix(digits, 16).map(|value| value.to_string()).map_err(|_| wrong());
    }
    if text.bytes().all(|byte| byte.is_ascii_digit()) {
        let digits = text.trim_start_matches('0');
        return Ok(if digits.is_empty() { "0".into() } else { digits.into() });
    }
    if text.ends_with('.') {
        return Err(wrong());
    }
    crate::number::real(text).ok_or_else(wrong)
}
