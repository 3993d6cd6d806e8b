//! Patterns of facts, as texts: `(door ?name open)`.

use std::fmt;

/// A text in parentheses, taken apart.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Item {
    Word(String),
    List(Vec<Item>),
}

/// A text that is not a pattern.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NotAPattern(String);

impl fmt::Display for NotAPattern {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "expected a fact in parentheses, such as (door ?name open), found `{}`", self.0)
    }
}

/// Most lists inside each other.
const DEPTH: usize = 100;

/// A pattern: a word that begins with `?` stands for anything. The case of letters does not count.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FactPattern {
    text: String,
    item: Item,
}

impl FactPattern {
    /// Reads a pattern.
    ///
    /// # Errors
    /// [`NotAPattern`].
    pub fn parse(text: &str) -> Result<FactPattern, NotAPattern> {
        match read(text) {
            Some(item @ Item::List(_)) => Ok(FactPattern { text: text.trim().into(), item }),
            _ => Err(NotAPattern(text.into())),
        }
    }

    /// Returns whether a fact in this form matches.
    pub fn matches(&self, fact: &str) -> bool {
        read(fact).is_some_and(|fact| matches(&self.item, &fact))
    }
}

impl fmt::Display for FactPattern {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

// The depth of both is bounded by `DEPTH`, so recursion is fine here.
fn matches(pattern: &Item, item: &Item) -> bool {
    match (pattern, item) {
        (Item::Word(word), _) if word.starts_with('?') => true,
        (Item::Word(word), Item::Word(other)) => {
            if word.starts_with('"') {
                word == other
            } else {
                word.eq_ignore_ascii_case(other)
            }
        }
        (Item::List(items), Item::List(others)) => {
            items.len() == others.len() && items.iter().zip(others).all(|(item, other)| matches(item, other))
        }
        _ => false,
    }
}

/// Reads one item; `None` if the text is not that.
fn read(text: &str) -> Option<Item> {
    let mut open: Vec<Vec<Item>> = vec![Vec::new()];
    let mut rest = text.trim();
    while let Some(first) = rest.chars().next() {
        let length = match first {
            '(' => {
                open.push(Vec::new());
                1
            }
            ')' => {
                let items = open.pop()?;
                open.last_mut()?.push(Item::List(items));
                1
            }
            '"' => string_length(rest)?,
            c if c.is_whitespace() => c.len_utf8(),
            _ => rest.find(|c: char| c.is_whitespace() || "()\"".contains(c)).unwrap_or(rest.len()),
        };
        if open.len() > DEPTH {
            return None;
        }
        if !"()".contains(first) && !first.is_whitespace() {
            open.last_mut()?.push(Item::Word(rest[..length].into()));
        }
        rest = &rest[length..];
    }
    let mut items = open.pop().filter(|_| open.is_empty())?;
    if items.len() == 1 { items.pop() } else { None }
}

/// Returns the length of the string at the beginning of a text.
fn string_length(text: &str) -> Option<usize> {
    let mut is_escaped = false;
    for (at, c) in text.char_indices().skip(1) {
        match c {
            _ if is_escaped => is_escaped = false,
            '\\' => is_escaped = true,
            '"' => return Some(at + 1),
            _ => {}
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variables_stand_for_anything() {
        let matches =
            |pattern: &str, fact: &str| FactPattern::parse(pattern).expect("it is one").matches(fact);
        assert!(matches("(door ?name open)", "(DOOR NORTH OPEN)"));
        assert!(matches("(at ?x)", "(AT (1 2))") && matches("(at (1 ?))", "(AT (1 2))"));
        assert!(!matches("(door ?name open)", "(DOOR NORTH SHUT)"));
        assert!(!matches("(door ?name)", "(DOOR NORTH OPEN)"));
        assert!(matches("(say \"a (b\")", "(SAY \"a (b\")") && !matches("(say \"A\")", "(SAY \"a\")"));
        for wrong in ["", "door", "(a", "a)", "(a) (b)", "(\"a)"] {
            assert!(FactPattern::parse(wrong).is_err(), "{wrong}");
        }
        assert!(FactPattern::parse(&"(".repeat(100_000)).is_err());
    }
}
