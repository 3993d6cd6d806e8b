//! The names by which the outside has called functions last, and the symbols that these denote.
//!
//! A call from outside names its function as text, mostly the same few again and again. The packages decide
//! which symbol a name denotes, so [`Names::packages_mut`](super::Names::packages_mut) forgets all of them.
//! Symbols with a package live as long as the machine.

use crate::value::Value;

/// Names that are kept.
const KEPT: usize = 4;

/// Bytes of the longest name that is kept.
const LONGEST: usize = 39;

/// A name as the outside has written it, and its symbol. An empty one is none.
#[derive(Clone, Copy)]
struct CalledName {
    text: [u8; LONGEST],
    length: u8,
    symbol: Value,
}

/// The names by which the outside has called functions last.
#[derive(Clone)]
pub(crate) struct CalledNames {
    kept: [CalledName; KEPT],
    /// The place of the next one.
    next: usize,
}

impl Default for CalledNames {
    fn default() -> CalledNames {
        let none = CalledName { text: [0; LONGEST], length: 0, symbol: Value::NIL };
        CalledNames { kept: [none; KEPT], next: 0 }
    }
}

impl CalledNames {
    /// Returns the symbol of a name, if that is kept.
    #[inline]
    pub(crate) fn find(&self, name: &str) -> Option<Value> {
        let is_it = |kept: &&CalledName| {
            usize::from(kept.length) == name.len() && kept.text.get(..name.len()) == Some(name.as_bytes())
        };
        self.kept.iter().find(is_it).filter(|_| !name.is_empty()).map(|kept| kept.symbol)
    }

    /// Forgets all names.
    #[inline]
    pub(crate) fn forget(&mut self) {
        self.kept.iter_mut().for_each(|kept| kept.length = 0);
    }

    /// Keeps the symbol of a name, in place of that of the name kept for the longest time.
    pub(crate) fn keep(&mut self, name: &str, symbol: Value) {
        let mut text = [0; LONGEST];
        if let Some(place) = text.get_mut(..name.len()) {
            place.copy_from_slice(name.as_bytes());
            self.kept[self.next] = CalledName { text, length: name.len() as u8, symbol };
            self.next = (self.next + 1) % KEPT;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_names_are_kept() {
        let mut names = CalledNames::default();
        let name = |number: usize| format!("name-{number}");
        (0..6).for_each(|number| names.keep(&name(number), Value::index(number)));
        let kept: Vec<Option<usize>> =
            (0..7).map(|number| names.find(&name(number)).and_then(Value::as_index)).collect();
        assert_eq!(kept, [None, None, Some(2), Some(3), Some(4), Some(5), None]);
        names.keep("", Value::T);
        names.keep(&"x".repeat(LONGEST + 1), Value::T);
        assert_eq!((names.find(""), names.find("name")), (None, None));
        let longest = "y".repeat(LONGEST);
        names.keep(&longest, Value::T);
        assert_eq!(names.find(&longest), Some(Value::T));
        names.forget();
        assert_eq!(names.find(&longest), None);
    }
}
