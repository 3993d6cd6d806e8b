//! The table as text.

use std::fmt::Write;

use crate::row::{CauseRow, CodePlace, FailingTask, FailureTable};
use crate::value::TaskKind;

/// Most places with too many functions that are listed.
const MOST_PLACES: usize = 10;
/// Most origins that one row shows.
const MOST_ORIGINS: usize = 4;

fn short(place: &CodePlace) -> String {
    if place.source.is_empty() { String::new() } else { format!("{}:{}", place.source, place.line) }
}

/// Returns the origins of a row in words.
pub(super) fn origins(row: &CauseRow) -> String {
    let mut parts: Vec<String> = Vec::new();
    for origin in &row.origins {
        let part = format!("{} ({})", origin.function, short(&origin.place));
        // Several failures may begin in one line.
        if parts.last() != Some(&part) {
            parts.push(part);
        }
    }
    if parts.len() > MOST_ORIGINS {
        let rest = parts.len() - MOST_ORIGINS;
        parts.truncate(MOST_ORIGINS);
        parts.push(format!("{rest} more"));
    }
    if row.is_mistake { "a programming error".into() } else { parts.join(", ") }
}

/// Returns the meaning of the end of a task by a failure.
pub(super) fn end_of(task: &FailingTask) -> &'static str {
    match task.kind {
        TaskKind::Main => "ends the run",
        TaskKind::Guard => "has the guardian interrupt its body",
        TaskKind::Mock | TaskKind::Host => "is the failure of the operation",
        TaskKind::Test => "fails the test",
        TaskKind::Child => "ends the child, which is restarted",
        TaskKind::Part => "ends the task; its form takes that",
        TaskKind::Spawned | TaskKind::World if task.is_awaited => {
            "ends the task, for whose end another waits"
        }
        TaskKind::Spawned | TaskKind::World => "ends the task, and is reported",
    }
}

fn causes(text: &mut String, rows: &[CauseRow], indent: usize) {
    let width = rows.iter().map(|row| row.cause.len()).max().unwrap_or_default();
    for row in rows {
        // Writing to a text does not fail.
        _ = writeln!(text, "{:indent$}{:<width$}  from {}", "", row.cause, origins(row));
    }
}

/// Returns the text.
pub(super) fn render(table: &FailureTable) -> String {
    let mut text = String::new();
    for task in &table.tasks {
        let place = short(&task.place);
        let at = if place.is_empty() { String::new() } else { format!(" ({place})") };
        if task.causes.is_empty() {
            _ = writeln!(text, "task {}{at}: no failure ends it", task.name);
        } else {
            _ = writeln!(text, "task {}{at}: a failure {}", task.name, end_of(task));
            _ = writeln!(text, "  ends by");
            causes(&mut text, &task.causes, 4);
        }
        let handled: Vec<_> = task.clauses.iter().map(|index| &table.clauses[*index]).collect();
        let handled: Vec<_> = handled.into_iter().filter(|clause| !clause.causes.is_empty()).collect();
        if !handled.is_empty() {
            _ = writeln!(text, "  takes");
        }
        for clause in handled {
            _ = writeln!(text, "    in {} ({}): {}", clause.function, short(&clause.place), clause.answer);
            causes(&mut text, &clause.causes, 6);
        }
        text.push('\n');
    }
    let shown =
        |function: &&crate::row::FunctionRow| !function.causes.is_empty() || function.fails_as_arguments;
    for function in table.functions.iter().filter(shown) {
        _ = writeln!(text, "function {} ({})", function.name, short(&function.place));
        causes(&mut text, &function.causes, 2);
        if function.fails_as_arguments {
            _ = writeln!(text, "  and as the functions fail that it is given");
        }
    }
    let others: Vec<&str> = table
        .functions
        .iter()
        .filter(|function| !shown(function))
        .map(|function| function.name.as_str())
        .collect();
    if !others.is_empty() {
        _ = writeln!(text, "no failure leaves: {}", others.join(", "));
    }
    if !table.crowded.is_empty() {
        _ = writeln!(
            text,
            "too many functions may be called here; at each place count the failures of all of them"
        );
        for place in table.crowded.iter().take(MOST_PLACES) {
            _ = writeln!(text, "  {}", short(place));
        }
        if table.crowded.len() > MOST_PLACES {
            _ = writeln!(text, "  and {} more", table.crowded.len() - MOST_PLACES);
        }
    }
    text
}
