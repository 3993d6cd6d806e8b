//! The table as an FMEA: failure modes and effects (IEC 60812, ECSS-Q-ST-30-02), one line for each place
//! where failures of a cause begin. Severity and notes are a person's: they are carried over from an earlier
//! table.

use std::collections::BTreeMap;

use super::flat::CellLines;
use super::injected::{InjectedOutcomes, end_effect, exercised};
use super::text::end_of;
use crate::row::{CauseRow, FailureOrigin, FailureTable};
use crate::value::TaskKind;

const HEADINGS: [&str; 10] = [
    "item",
    "failure mode",
    "cause",
    "local effect",
    "detection",
    "compensation",
    "end effect",
    "exercised by",
    "severity",
    "notes",
];

/// Text in the column of notes of a line whose failure the program no longer has.
const STALE: &str = "stale: no longer in the program";

fn has(rows: &[CauseRow], cause: &str, origin: &FailureOrigin) -> bool {
    rows.iter().any(|row| row.cause == cause && row.origins.contains(origin))
}

/// Returns the lines, with severities and notes of `earlier`, a table in CSV that this has made, and with the
/// outcomes of injected runs.
pub(super) fn lines(table: &FailureTable, earlier: Option<&str>, mut seen: InjectedOutcomes) -> CellLines {
    let mut kept = notes_of(earlier.unwrap_or_default());
    let mut modes: BTreeMap<(String, String), Vec<FailureOrigin>> = BTreeMap::new();
    let all = table
        .tasks
        .iter()
        .flat_map(|task| &task.causes)
        .chain(table.clauses.iter().flat_map(|clause| &clause.causes))
        .chain(table.functions.iter().flat_map(|function| &function.causes));
    for row in all {
        for origin in &row.origins {
            let origins = modes.entry((origin.function.clone(), row.cause.clone())).or_default();
            if !origins.contains(origin) {
                origins.push(origin.clone());
            }
        }
    }
    let mut lines = vec![HEADINGS.map(String::from).to_vec()];
    for ((item, mode), mut origins) in modes {
        origins.sort();
        let (severity, notes) = kept.remove(&(item.clone(), mode.clone())).unwrap_or_default();
        let places: Vec<String> =
            origins.iter().map(|origin| format!("{}:{}", origin.place.source, origin.place.line)).collect();
        let is_in = |rows: &[CauseRow]| origins.iter().any(|origin| has(rows, &mode, origin));
        let takers: Vec<_> = table.clauses.iter().filter(|clause| is_in(&clause.causes)).collect();
        let detection: Vec<String> =
            takers.iter().map(|clause| format!("{} in {}", clause.wanted, clause.function)).collect();
        let compensation: Vec<String> = takers.iter().map(|clause| clause.answer.clone()).collect();
        let leaves: Vec<&str> = table
            .functions
            .iter()
            .filter(|function| function.name == item && is_in(&function.causes))
            .map(|function| function.name.as_str())
            .collect();
        let local = if leaves.is_empty() {
            "is taken inside".to_string()
        } else {
            format!("leaves {}", leaves.join(", "))
        };
        let ends: Vec<String> = table
            .tasks
            .iter()
            .filter(|task| task.kind != TaskKind::Test && is_in(&task.causes))
            .map(|task| {
                if task.kind == TaskKind::Main {
                    "ends the run".into()
                } else {
                    format!("{}: {}", task.name, end_of(task))
                }
            })
            .collect();
        let end = if ends.is_empty() { "the mission goes on".to_string() } else { ends.join("; ") };
        let tests: Vec<&str> = table
            .tasks
            .iter()
            .filter(|task| {
                let mut taken = task.clauses.iter().map(|index| &table.clauses[*index]);
                task.kind == TaskKind::Test
                    && (is_in(&task.causes) || taken.any(|clause| is_in(&clause.causes)))
            })
            .map(|task| task.name.as_str())
            .collect();
        let runs = seen.take(&item, &mode).unwrap_or_default();
        let end = if runs.is_empty() { end } else { end_effect(&runs) };
        let tests: Vec<String> = tests.into_iter().map(String::from).chain(exercised(&runs)).collect();
        let or_none =
            |parts: Vec<String>| if parts.is_empty() { "none".to_string() } else { parts.join("; ") };
        lines.push(vec![
            item,
            mode,
            places.join(", "),
            local,
            or_none(detection),
            or_none(compensation),
            end,
            tests.join(", "),
            severity,
            notes,
        ]);
    }
    for (item, mode, runs) in seen.rest() {
        let (severity, notes) = kept.remove(&(item.clone(), mode.clone())).unwrap_or_default();
        let none = || "none".to_string();
        let (end, tests) = (end_effect(&runs), exercised(&runs).join(", "));
        lines.push(vec![item, mode, "injected".into(), none(), none(), none(), end, tests, severity, notes]);
    }
    for ((item, mode), (severity, notes)) in kept {
        if severity.is_empty() && notes.is_empty() {
            continue;
        }
        let mut line = vec![String::new(); HEADINGS.len()];
        let notes = if notes.starts_with(STALE) { notes } else { format!("{STALE}; {notes}") };
        (line[0], line[1], line[8], line[9]) = (item, mode, severity, notes);
        lines.push(line);
    }
    lines
}

/// Returns severities and notes of a table in CSV, by item and failure mode.
fn notes_of(csv: &str) -> BTreeMap<(String, String), (String, String)> {
    let mut lines = cells(csv).into_iter();
    let Some(headings) = lines.next() else { return BTreeMap::new() };
    let column = |name: &str| headings.iter().position(|heading| heading == name);
    let (Some(item), Some(mode), Some(severity), Some(notes)) =
        (column("item"), column("failure mode"), column("severity"), column("notes"))
    else {
        return BTreeMap::new();
    };
    let cell = |line: &Vec<String>, index: usize| line.get(index).cloned().unwrap_or_default();
    lines
        .map(|line| ((cell(&line, item), cell(&line, mode)), (cell(&line, severity), cell(&line, notes))))
        .collect()
}

/// Reads CSV (RFC 4180).
fn cells(csv: &str) -> Vec<Vec<String>> {
    let mut lines = Vec::new();
    let (mut line, mut cell, mut is_quoted) = (Vec::new(), String::new(), false);
    let mut characters = csv.chars().peekable();
    while let Some(c) = characters.next() {
        match c {
            '"' if is_quoted && characters.peek() == Some(&'"') => {
                characters.next();
                cell.push('"');
            }
            '"' => is_quoted = !is_quoted,
            ',' if !is_quoted => line.push(std::mem::take(&mut cell)),
            '\r' if !is_quoted => {}
            '\n' if !is_quoted => {
                line.push(std::mem::take(&mut cell));
                lines.push(std::mem::take(&mut line));
            }
            other => cell.push(other),
        }
    }
    if !cell.is_empty() || !line.is_empty() {
        line.push(cell);
        lines.push(line);
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_read_as_they_are_written() {
        let lines: CellLines =
            vec![vec!["a".into(), "b, \"c\"".into()], vec![String::new(), "two\nlines".into()]];
        assert_eq!(cells(&super::super::flat::csv(&lines)), lines);
    }

    #[test]
    fn notes_survive_and_stale_ones_are_marked() {
        let csv = "item,failure mode,severity,notes\r\nslew,:stuck,2,oil it\r\n";
        let known = notes_of(csv);
        assert_eq!(known[&("slew".into(), ":stuck".into())], ("2".into(), "oil it".into()));
        let lines = lines(&FailureTable::default(), Some(csv), InjectedOutcomes::default());
        assert_eq!(lines[1][9], format!("{STALE}; oil it"));
    }
}
