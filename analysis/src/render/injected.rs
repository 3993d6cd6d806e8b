//! Outcomes of runs with injected faults, as `eslvm test --inject --format json` writes them, for the table
//! of failure modes and effects.

use std::collections::BTreeMap;
use std::fmt;

use serde_json::Value;

/// Outcomes of runs with one fault each, by operations and faults.
///
/// ```
/// use esl_analysis::render::InjectedOutcomes;
///
/// let text = r#"{"subjects": [{"test": "FLIES", "rows": [{"name": "slew#1:never", "outcome": "hangs",
///     "bad": true, "faults": [{"operation": "slew", "fault": "never"}]}]}]}"#;
/// assert_eq!(InjectedOutcomes::read([text])?.len(), 1);
/// assert!(InjectedOutcomes::read(["{}"]).is_err());
/// # Ok::<(), esl_analysis::render::InjectedError>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct InjectedOutcomes(BTreeMap<(String, String), Vec<SeenRun>>);

/// A run with a fault.
#[derive(Clone, Debug)]
pub(super) struct SeenRun {
    /// Name of the test, in lower case; empty for a program.
    test: String,
    name: String,
    outcome: String,
    is_bad: bool,
}

/// A text that is not a table of runs with injected faults.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InjectedError;

impl fmt::Display for InjectedError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("it is not a table of `eslvm test --inject --format json`")
    }
}

impl std::error::Error for InjectedError {}

/// Most names of bad runs that a cell shows.
const MOST_NAMES: usize = 3;

impl InjectedOutcomes {
    /// Reads tables.
    ///
    /// # Errors
    /// [`InjectedError`].
    pub fn read<'a>(texts: impl IntoIterator<Item = &'a str>) -> Result<InjectedOutcomes, InjectedError> {
        let mut all = InjectedOutcomes::default();
        for text in texts {
            let value: Value = serde_json::from_str(text).map_err(|_| InjectedError)?;
            all.add(&value).ok_or(InjectedError)?;
        }
        Ok(all)
    }

    /// Returns the number of pairs of an operation and a fault.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Returns whether there is no run.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    fn add(&mut self, value: &Value) -> Option<()> {
        for subject in value.get("subjects")?.as_array()? {
            let test = subject.get("test").and_then(Value::as_str).unwrap_or_default();
            for row in subject.get("rows")?.as_array()? {
                let [fault] = &row.get("faults")?.as_array()?[..] else { continue };
                let text = |value: &Value, key: &str| Some(value.get(key)?.as_str()?.to_string());
                let run = SeenRun {
                    test: test.to_lowercase(),
                    name: text(row, "name")?,
                    outcome: text(row, "outcome")?,
                    is_bad: row.get("bad")?.as_bool()?,
                };
                self.0.entry((text(fault, "operation")?, text(fault, "fault")?)).or_default().push(run);
            }
        }
        Some(())
    }

    /// Takes the runs with a fault of an operation.
    pub(super) fn take(&mut self, operation: &str, fault: &str) -> Option<Vec<SeenRun>> {
        self.0.remove(&(operation.to_string(), fault.to_string()))
    }

    /// Returns the runs that were not taken, with the operation and the failure mode in words.
    pub(super) fn rest(self) -> impl Iterator<Item = (String, String, Vec<SeenRun>)> {
        self.0.into_iter().map(|((operation, fault), runs)| {
            let mode = match fault.as_str() {
                "never" => "never answers".into(),
                "late" => "answers late".into(),
                "aborted" => "caller is aborted".into(),
                _ => fault,
            };
            (operation, mode, runs)
        })
    }
}

/// Returns the end effect that runs have shown.
pub(super) fn end_effect(runs: &[SeenRun]) -> String {
    let mut outcomes: Vec<(&str, Vec<&SeenRun>)> = Vec::new();
    for run in runs {
        match outcomes.iter_mut().find(|(outcome, _)| *outcome == run.outcome) {
            Some((_, runs)) => runs.push(run),
            None => outcomes.push((&run.outcome, vec![run])),
        }
    }
    let part = |(outcome, runs): (&str, Vec<&SeenRun>)| {
        let bad: Vec<&str> = runs.iter().filter(|run| run.is_bad).map(|run| run.name.as_str()).collect();
        let more = if bad.len() > MOST_NAMES { ", …" } else { "" };
        let names = match bad.is_empty() {
            true => String::new(),
            false => format!(" ({}{more})", bad[..bad.len().min(MOST_NAMES)].join(", ")),
        };
        format!("{outcome} {}×{names}", runs.len())
    };
    format!("seen: {}", outcomes.into_iter().map(part).collect::<Vec<_>>().join("; "))
}

/// Returns the tests, or the program, in which faults were injected.
pub(super) fn exercised(runs: &[SeenRun]) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for run in runs {
        let name = if run.test.is_empty() { "the program" } else { run.test.as_str() };
        let name = format!("{name} (injected)");
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names
}
