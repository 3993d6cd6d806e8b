//! Forms of the protocol of sessions: symbols, integers, strings and lists, as texts.
//!
//! They are not data of the program: their symbols are text here, so what a stranger sends makes none there.
//! Length and depth are bounded while a text is parsed, so parsing takes a time and a room in proportion to
//! the bytes that have come.

use std::fmt;

/// Most lists within each other.
const DEPTH: usize = 100;

/// A form.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum WireForm {
    /// A symbol, as it was written.
    Symbol(String),
    /// An integer.
    Integer(i64),
    /// A string.
    Text(String),
    /// A list; the empty one is `nil`.
    List(Vec<WireForm>),
}

impl WireForm {
    /// Returns a symbol.
    pub fn symbol(name: &str) -> WireForm {
        WireForm::Symbol(name.into())
    }

    /// Returns a string.
    pub fn text(text: impl Into<String>) -> WireForm {
        WireForm::Text(text.into())
    }

    /// Returns a list.
    pub fn list(items: impl IntoIterator<Item = WireForm>) -> WireForm {
        WireForm::List(items.into_iter().collect())
    }

    /// Returns the empty list.
    pub fn nil() -> WireForm {
        WireForm::List(Vec::new())
    }

    /// Returns the text of a string.
    pub fn as_text(&self) -> Option<&str> {
        match self {
            WireForm::Text(text) => Some(text),
            _ => None,
        }
    }

    /// Returns the integer.
    pub fn as_integer(&self) -> Option<i64> {
        match self {
            WireForm::Integer(n) => Some(*n),
            _ => None,
        }
    }

    /// Returns the name of a symbol in lower case.
    pub fn name(&self) -> Option<String> {
        match self {
            WireForm::Symbol(name) => Some(name.to_lowercase()),
            _ => None,
        }
    }

    /// Returns the items of a list.
    pub fn items(&self) -> Option<&[WireForm]> {
        match self {
            WireForm::List(items) => Some(items),
            _ => None,
        }
    }

    /// Parses the one form of a text.
    ///
    /// # Errors
    /// The reason, if it is not one form, or too deep.
    pub fn parse(text: &str) -> Result<WireForm, &'static str> {
        let mut parser = WireFormParser { rest: text, open: Vec::new() };
        let form = parser.form()?;
        parser.skip_space();
        if parser.rest.is_empty() { Ok(form) } else { Err("expected the end of the text after the form") }
    }
}

/// A list that is not complete, or a quote whose form is awaited.
enum OpenWireForm {
    List(Vec<WireForm>),
    Quote,
}

struct WireFormParser<'a> {
    rest: &'a str,
    open: Vec<OpenWireForm>,
}

impl WireFormParser<'_> {
    fn skip_space(&mut self) {
        self.rest = self.rest.trim_start();
    }

    fn begin(&mut self, form: OpenWireForm) -> Result<(), &'static str> {
        if self.open.len() == DEPTH {
            return Err("it is too deep");
        }
        self.open.push(form);
        Ok(())
    }

    fn form(&mut self) -> Result<WireForm, &'static str> {
        loop {
            self.skip_space();
            let Some(first) = self.rest.chars().next() else { return Err("it is incomplete") };
            let after = &self.rest[first.len_utf8()..];
            let mut done = match first {
                '(' => {
                    self.rest = after;
                    self.begin(OpenWireForm::List(Vec::new()))?;
                    continue;
                }
                '\'' => {
                    self.rest = after;
                    self.begin(OpenWireForm::Quote)?;
                    continue;
                }
                ')' => {
                    self.rest = after;
                    match self.open.pop() {
                        Some(OpenWireForm::List(items)) => WireForm::List(items),
                        _ => return Err("unmatched `)`"),
                    }
                }
                '"' => {
                    self.rest = after;
                    self.string()?
                }
                _ => self.atom(),
            };
            loop {
                match self.open.last_mut() {
                    None => return Ok(done),
                    Some(OpenWireForm::List(items)) => {
                        items.push(done);
                        break;
                    }
                    Some(OpenWireForm::Quote) => {
                        self.open.pop();
                        done = WireForm::List(vec![WireForm::symbol("quote"), done]);
                    }
                }
            }
        }
    }

    /// Parses a string behind its first quotation mark.
    fn string(&mut self) -> Result<WireForm, &'static str> {
        let mut text = String::new();
        let mut characters = self.rest.char_indices();
        while let Some((at, c)) = characters.next() {
            match c {
                '"' => {
                    self.rest = &self.rest[at + 1..];
                    return Ok(WireForm::Text(text));
                }
                '\\' => match characters.next() {
                    Some((_, escaped)) => text.push(escaped),
                    None => break,
                },
                c => text.push(c),
            }
        }
        Err("a string is incomplete")
    }

    fn atom(&mut self) -> WireForm {
        let ends = |c: char| c.is_whitespace() || matches!(c, '(' | ')' | '"' | '\'');
        let end = self.rest.find(ends).unwrap_or(self.rest.len());
        let (word, rest) = self.rest.split_at(end);
        self.rest = rest;
        match word.parse() {
            Ok(n) => WireForm::Integer(n),
            Err(_) if word.eq_ignore_ascii_case("nil") => WireForm::nil(),
            Err(_) => WireForm::Symbol(word.into()),
        }
    }
}

impl fmt::Display for WireForm {
    // A form is made here or was parsed, so its depth is bounded.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            WireForm::Symbol(name) => f.write_str(name),
            WireForm::Integer(n) => n.fmt(f),
            WireForm::Text(text) => {
                write!(f, "\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
            }
            WireForm::List(items) if items.is_empty() => f.write_str("nil"),
            WireForm::List(items) => {
                for (index, item) in items.iter().enumerate() {
                    f.write_str(if index == 0 { "(" } else { " " })?;
                    item.fmt(f)?;
                }
                f.write_str(")")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn forms_are_parsed_and_written() {
        for (text, same) in [
            ("(:emacs-rex (swank:connection-info) \"CL-USER\" t 1)\n", None),
            ("(a (b nil) -12 \"x\\\"y\\\\z\")", None),
            (" ( quote  'x )", Some("(quote (quote x))")),
            ("''nil", Some("(quote (quote nil))")),
            ("()", Some("nil")),
        ] {
            let form = WireForm::parse(text).expect(text);
            assert_eq!(form.to_string(), same.unwrap_or(text.trim()));
            assert_eq!(WireForm::parse(&form.to_string()), Ok(form));
        }
    }

    #[test]
    fn what_is_no_form_is_refused() {
        for text in ["", "(", ")", "(a))", "\"x", "\"\\", "'", "('", "a b", "(')"] {
            assert!(WireForm::parse(text).is_err(), "{text:?}");
        }
        let nested = |depth: usize| "(".repeat(depth) + &")".repeat(depth);
        assert!(WireForm::parse(&nested(DEPTH)).is_ok());
        assert_eq!(WireForm::parse(&nested(DEPTH + 1)), Err("it is too deep"));
        assert_eq!(WireForm::parse(&"'".repeat(1_000_000)), Err("it is too deep"));
    }
}
