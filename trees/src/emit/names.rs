//! Names of a program for those of a tree.

use std::collections::{HashMap, HashSet};

/// Returns a name as Lisp programmers write it: `ComputePathToPose` is `compute-path-to-pose`.
pub(crate) fn kebab(name: &str) -> String {
    let characters: Vec<char> = name.chars().collect();
    let mut text = String::new();
    for (at, &c) in characters.iter().enumerate() {
        let previous = at.checked_sub(1).map(|before| characters[before]);
        let is_lower = |c: Option<&char>| c.is_some_and(|c| c.is_lowercase());
        let begins_word = c.is_uppercase()
            && previous.is_some_and(|previous| {
                previous.is_lowercase()
                    || previous.is_ascii_digit()
                    || previous.is_uppercase() && is_lower(characters.get(at + 1))
            });
        if begins_word && !text.ends_with('-') {
            text.push('-');
        }
        if c.is_alphanumeric() {
            text.extend(c.to_lowercase());
        } else if !text.is_empty() && !text.ends_with('-') {
            text.push('-');
        }
    }
    let text = text.trim_end_matches('-');
    // A name must not look like a number.
    if text.is_empty() || !text.starts_with(char::is_alphabetic) {
        format!("n-{text}").trim_end_matches('-').into()
    } else {
        text.into()
    }
}

/// The names in use, those of functions and those of variables apart.
pub(crate) struct ProgramNames<'a> {
    is_reserved: &'a dyn Fn(&str) -> bool,
    functions: HashSet<String>,
    variables: HashSet<String>,
    /// Numbers that the next copies of a name get.
    next: HashMap<String, usize>,
}

impl<'a> ProgramNames<'a> {
    pub(crate) fn new(is_reserved: &'a dyn Fn(&str) -> bool) -> ProgramNames<'a> {
        ProgramNames {
            is_reserved,
            functions: HashSet::new(),
            variables: HashSet::new(),
            next: HashMap::new(),
        }
    }

    /// Returns a new name of a function that is like the wanted one; with `prefix`, if that is a name of the
    /// language.
    pub(crate) fn function(&mut self, wanted: &str, prefix: &str) -> String {
        let wanted =
            if (self.is_reserved)(wanted) { format!("{prefix}-{wanted}") } else { wanted.to_owned() };
        let is_taken =
            |name: &str, names: &ProgramNames| names.functions.contains(name) || (names.is_reserved)(name);
        let name = self.free(&wanted, is_taken);
        self.functions.insert(name.clone());
        name
    }

    /// Returns a new name of a variable that is the first free one of the wanted ones, or like the last.
    pub(crate) fn variable(&mut self, wanted: &[String]) -> String {
        let is_taken = |name: &str, names: &ProgramNames| {
            names.variables.contains(name) || ["t", "nil", "pi"].contains(&name)
        };
        let free = wanted.iter().find(|name| !is_taken(name, self)).cloned();
        let name = free.unwrap_or_else(|| {
            let last = wanted.last().map_or("entry", |name| &**name).to_owned();
            self.free(&last, is_taken)
        });
        self.variables.insert(name.clone());
        name
    }

    fn free(&mut self, wanted: &str, is_taken: impl Fn(&str, &ProgramNames) -> bool) -> String {
        if !is_taken(wanted, self) {
            return wanted.to_owned();
        }
        let mut number = self.next.get(wanted).copied().unwrap_or(2);
        while is_taken(&format!("{wanted}-{number}"), self) {
            number += 1;
        }
        self.next.insert(wanted.to_owned(), number + 1);
        format!("{wanted}-{number}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_divided_by_hyphens() {
        for (name, expected) in [
            ("ComputePathToPose", "compute-path-to-pose"),
            ("isBatteryOK", "is-battery-ok"),
            ("NavToGPSPose2D", "nav-to-gps-pose2-d"),
            ("target_pose", "target-pose"),
            ("Clear  Costmap (local)", "clear-costmap-local"),
            ("@goal", "goal"),
            ("2 doors", "n-2-doors"),
            ("", "n"),
        ] {
            assert_eq!(kebab(name), expected);
        }
    }

    #[test]
    fn names_are_new() {
        let is_reserved = |name: &str| name == "log";
        let mut names = ProgramNames::new(&is_reserved);
        assert_eq!(names.function("log", "perform"), "perform-log");
        assert_eq!(
            (names.function("open", "perform"), names.function("open", "perform")),
            ("open".into(), "open-2".into())
        );
        let wanted = ["goal".to_owned(), "move-goal".to_owned()];
        assert_eq!(
            [names.variable(&wanted), names.variable(&wanted), names.variable(&wanted)],
            ["goal", "move-goal", "move-goal-2"]
        );
    }
}
