//! The table as an FMEA: failure modes and effects (IEC 60812, ECSS-Q-ST-30-02), one line for each place
//! where failures of a cause begin. Severity and notes are a person's: they are carried over from an earlier
//! table.

use std::collections::BTreeMap;

use super::flat::CellLines;
use super::injected::{InjectedOutcomes, end_effect, exercised};
use super::notes::{EarlierNotes, NoteCells};
use super::text::end_of;
use crate::row::{CauseRow, FailingTask, FailureOrigin, FailureTable, FunctionRow};
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

fn has(rows: &[CauseRow], cause: &str, origin: &FailureOrigin) -> bool {
    rows.iter().any(|row| row.cause == cause && row.origins.contains(origin))
}

/// The effects of a failure mode.
struct ModeEffects {
    local: String,
    end: String,
}

impl ModeEffects {
    /// Returns the effects of the failures that `is_in` finds among rows, which begin in `item`.
    fn new(
        table: &FailureTable,
        item: &str,
        is_in: &dyn Fn(&[CauseRow]) -> bool,
        is_taken: bool,
    ) -> ModeEffects {
        let ended: Vec<&FailingTask> = table.tasks.iter().filter(|task| is_in(&task.causes)).collect();
        let leaves = |function: &FunctionRow| function.name == item && is_in(&function.causes);
        let local = if table.functions.iter().any(leaves) {
            format!("leaves {item}")
        } else if !ended.is_empty() {
            // It begins in the body of a task: nothing is left but that.
            let mut ends: Vec<&str> = Vec::new();
            for task in &ended {
                let end = match task.kind {
                    TaskKind::Main | TaskKind::Test | TaskKind::Mock | TaskKind::Host => end_of(task),
                    _ => "ends the task",
                };
                if !ends.contains(&end) {
                    ends.push(end);
                }
            }
            ends.join("; ")
        } else if is_taken {
            "is taken inside".into()
        } else {
            "none".into()
        };
        let (tests, others): (Vec<&FailingTask>, Vec<&FailingTask>) =
            ended.into_iter().partition(|task| task.kind == TaskKind::Test);
        let shown = |task: &&FailingTask| match task.kind {
            TaskKind::Main => end_of(task).to_string(),
            _ => format!("{}: {}", task.name, end_of(task)),
        };
        let end = match (others.is_empty(), tests.first()) {
            (false, _) => others.iter().map(shown).collect::<Vec<_>>().join("; "),
            (true, Some(test)) => end_of(test).into(),
            (true, None) => "the mission goes on".into(),
        };
        ModeEffects { local, end }
    }
}

/// Returns the lines, with severities and notes of an earlier table, and with the outcomes of injected runs.
pub(super) fn lines(table: &FailureTable, mut kept: EarlierNotes, mut seen: InjectedOutcomes) -> CellLines {
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
        let NoteCells { severity, notes } = kept.take(&item, &mode);
        let places: Vec<String> =
            origins.iter().map(|origin| format!("{}:{}", origin.place.source, origin.place.line)).collect();
        let is_in = |rows: &[CauseRow]| origins.iter().any(|origin| has(rows, &mode, origin));
        let takers: Vec<_> = table.clauses.iter().filter(|clause| is_in(&clause.causes)).collect();
        let detection: Vec<String> =
            takers.iter().map(|clause| format!("{} in {}", clause.wanted, clause.function)).collect();
        let compensation: Vec<String> = takers.iter().map(|clause| clause.answer.clone()).collect();
        let effects = ModeEffects::new(table, &item, &|rows| is_in(rows), !takers.is_empty());
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
        let end = if runs.is_empty() { effects.end } else { end_effect(&runs) };
        let tests: Vec<String> = tests.into_iter().map(String::from).chain(exercised(&runs)).collect();
        let or_none =
            |parts: Vec<String>| if parts.is_empty() { "none".to_string() } else { parts.join("; ") };
        lines.push(vec![
            item,
            mode,
            places.join(", "),
            effects.local,
            or_none(detection),
            or_none(compensation),
            end,
            tests.join(", "),
            severity,
            notes,
        ]);
    }
    for (item, mode, runs) in seen.rest() {
        let NoteCells { severity, notes } = kept.take(&item, &mode);
        let none = || "none".to_string();
        let (end, tests) = (end_effect(&runs), exercised(&runs).join(", "));
        lines.push(vec![item, mode, "injected".into(), none(), none(), none(), end, tests, severity, notes]);
    }
    for (item, mode, NoteCells { severity, notes }) in kept.stale() {
        let mut line = vec![String::new(); HEADINGS.len()];
        (line[0], line[1], line[8], line[9]) = (item, mode, severity, notes);
        lines.push(line);
    }
    lines
}
