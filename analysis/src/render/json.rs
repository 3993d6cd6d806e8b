//! The table as JSON.

use serde_json::{Value, json};

use super::text::end_of;
use crate::row::{CauseRow, CodePlace, FailureTable};

fn place(place: &CodePlace) -> Value {
    if place.source.is_empty() {
        return Value::Null;
    }
    json!({ "source": place.source, "line": place.line, "column": place.column })
}

fn causes(rows: &[CauseRow]) -> Value {
    let row = |row: &CauseRow| {
        let origin = |origin: &crate::row::FailureOrigin| json!({ "function": origin.function, "place": place(&origin.place) });
        json!({
            "cause": row.cause,
            "origins": row.origins.iter().map(origin).collect::<Vec<_>>(),
            "goes-on": !row.spent.is_empty(),
            "programming-error": row.is_mistake,
        })
    };
    rows.iter().map(row).collect()
}

/// Returns the text of one object.
pub(super) fn render(table: &FailureTable) -> String {
    let tasks = table.tasks.iter().map(|task| {
        json!({
            "name": task.name,
            "place": place(&task.place),
            "causes": causes(&task.causes),
            "end": end_of(task),
            "clauses": task.clauses,
        })
    });
    let functions = table.functions.iter().map(|function| {
        json!({
            "name": function.name,
            "place": place(&function.place),
            "causes": causes(&function.causes),
            "fails-as-arguments": function.fails_as_arguments,
        })
    });
    let clauses = table.clauses.iter().map(|clause| {
        json!({
            "wanted": clause.wanted,
            "place": place(&clause.place),
            "function": clause.function,
            "answer": clause.answer,
            "causes": causes(&clause.causes),
            "fails": causes(&clause.fails),
        })
    });
    let goals = table.goals.iter().map(|goal| {
        let method = |method: &crate::GoalMethod| json!({ "test": method.test, "calls": method.calls });
        json!({
            "goal": goal.title,
            "place": place(&goal.place),
            "methods": goal.methods.iter().map(method).collect::<Vec<_>>(),
            "pursued-in": goal.pursued_in,
        })
    });
    let all = json!({
        "tasks": tasks.collect::<Vec<_>>(),
        "functions": functions.collect::<Vec<_>>(),
        "clauses": clauses.collect::<Vec<_>>(),
        "goals": goals.collect::<Vec<_>>(),
        "too-many-functions": table.crowded.iter().map(place).collect::<Vec<_>>(),
    });
    format!("{all:#}\n")
}

/// Returns lines of cells as a list of objects, whose keys are the headings.
pub(super) fn lines(lines: &super::flat::CellLines) -> String {
    let Some((headings, rows)) = lines.split_first() else { return "[]\n".into() };
    let object = |row: &Vec<String>| {
        let pairs =
            headings.iter().zip(row).map(|(heading, cell)| (heading.clone(), Value::from(cell.as_str())));
        Value::Object(pairs.collect())
    };
    let all: Vec<Value> = rows.iter().map(object).collect();
    format!("{:#}\n", Value::from(all))
}
