//! Properties at the end of a run, and those that were left as no undisturbed run leaves them.

use std::collections::{BTreeMap, BTreeSet};

use esl_host::SurveyRequest;
use esl_vm::vm::Vm;

/// Values of properties, by the properties with their parameters.
pub(super) type PropertyValues = BTreeMap<String, String>;

/// Returns the values of all properties of a machine whose values are symbols, and the facts of those whose
/// values are numbers: these are measurements, which differ between any two runs.
pub(super) fn properties(machine: &Vm) -> (PropertyValues, BTreeSet<String>) {
    let request = SurveyRequest { data: true, ..SurveyRequest::default() };
    let relations = machine.survey(&request).relations;
    let (mut values, mut measured) = (PropertyValues::new(), BTreeSet::new());
    for relation in relations.iter().filter(|relation| relation.is_property && relation.facts > 0) {
        let request = SurveyRequest { facts: Some((relation.name.clone(), 0)), ..SurveyRequest::default() };
        for fact in machine.survey(&request).facts {
            match split(&fact) {
                Some((key, value)) if is_symbol(value) => {
                    values.insert(key.to_string(), value.to_string());
                }
                Some((_, value)) if is_number(value) => {
                    measured.insert(fact);
                }
                _ => {}
            }
        }
    }
    (values, measured)
}

/// Splits the text of a fact before its last part.
fn split(fact: &str) -> Option<(&str, &str)> {
    let inner = fact.strip_prefix('(')?.strip_suffix(')')?;
    // A list or a string as the last part is not a symbol, wherever it is split.
    let at = inner.rfind(' ')?;
    Some((&inner[..at], &inner[at + 1..]))
}

fn is_number(text: &str) -> bool {
    text.parse::<f64>().is_ok() || text.split('/').all(|part| part.parse::<i64>().is_ok())
}

fn is_symbol(text: &str) -> bool {
    !is_number(text) && !text.ends_with([')', '"']) && !text.starts_with('#')
}

/// Returns texts about the properties that a run has left with a value that they have neither at the
/// beginning nor at the end of the undisturbed run.
pub(super) fn left(now: &PropertyValues, first: &PropertyValues, last: &PropertyValues) -> Vec<String> {
    let is_left = |(key, value): &(&String, &String)| {
        last.get(*key).is_some_and(|rest| rest != *value) && first.get(*key).is_none_or(|rest| rest != *value)
    };
    let row = |(key, value): (&String, &String)| {
        let rest = last.get(key).map_or("", String::as_str);
        format!("({key}) is {value}, not {rest}").to_lowercase()
    };
    now.iter().filter(is_left).map(row).collect()
}

/// Returns texts about the properties that are `:off` after the undisturbed run, and not so now.
pub(super) fn still_on(now: &PropertyValues, last: &PropertyValues) -> Vec<String> {
    let is_off = |key: &String| last.get(key).is_some_and(|rest| rest == ":OFF");
    let row = |(key, value): (&String, &String)| format!("({key}) is {value}, not :off").to_lowercase();
    now.iter().filter(|(key, value)| is_off(key) && *value != ":OFF").map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn symbols_are_told_from_measurements() {
        assert_eq!(split("(POWER CAMERA :OFF)"), Some(("POWER CAMERA", ":OFF")));
        assert!(is_symbol(":OFF") && is_symbol("LAB") && is_symbol("NIL"));
        for text in ["12", "1.5", "3/4", "12)", "b\"", "#<task>"] {
            assert!(!is_symbol(text), "{text}");
        }
    }
}
