//! Findings as tables: the tasks side by side, a line for each step that matters.
//!
//! A step matters if another order of it and a step of another task could make a difference: uses of places
//! that several tasks use and one changes, signals, waits and changes of facts, and where a task had to stop.
//! Uses of a place by one task alone, and of places that nobody changes, are left out.

use std::collections::HashMap;

use esl_testing::explore::{ScheduleEvent, ScheduleStep, Settings, SourceForms, StandingTask, Switch};
use serde_json::{Value as Json, json};

use super::Finding;

/// Lines of a table; of more, the first and the last ones are shown.
const TOLD_ROWS: usize = 40;

/// Characters of a cell, and of the last column.
pub(super) const CELL: usize = 44;

/// A line of the table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct StepRow {
    pub(super) time: u64,
    /// The task; empty for the passing of time.
    pub(super) task: String,
    pub(super) text: String,
    pub(super) place: Option<String>,
    pub(super) kind: StepRowKind,
}

impl StepRow {
    /// Returns the last column: the place, with its form unless the text is the form.
    pub(super) fn place(&self, forms: &mut SourceForms) -> String {
        match (&self.place, &self.kind) {
            (Some(place), StepRowKind::Step) => place.clone(),
            (Some(place), _) => forms.describe(place),
            (None, _) => String::new(),
        }
    }
}

/// A kind of line, with what only JSON says of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum StepRowKind {
    Use { target: String, value: String, is_set: bool },
    Step,
    Switch(Switch),
    LeftOut(usize),
}

/// Returns the name of a task in the head of a column.
pub(super) fn column_name(label: &str) -> String {
    let name = label.strip_prefix("task ").or_else(|| label.strip_prefix("the "));
    name.unwrap_or(label).to_owned()
}

/// Returns the tasks of lines, in the order in which they come.
pub(super) fn tasks(rows: &[StepRow]) -> Vec<&str> {
    let mut tasks: Vec<&str> = Vec::new();
    for row in rows.iter().filter(|row| !row.task.is_empty()) {
        if !tasks.contains(&row.task.as_str()) {
            tasks.push(&row.task);
        }
    }
    tasks
}

/// Returns the lines of a schedule.
pub(super) fn rows(steps: &[ScheduleStep], forms: &mut SourceForms) -> Vec<StepRow> {
    let matters = uses_that_matter(steps);
    let mut rows: Vec<StepRow> = Vec::new();
    for (step, matters) in steps.iter().zip(matters) {
        let row = match &step.event {
            ScheduleEvent::Use { task, target, value, is_set, place } => {
                let text = match (is_set, value.is_empty()) {
                    (true, false) => format!("sets {target} to {value}"),
                    (true, true) => format!("changes {target}"),
                    (false, false) => format!("reads {target} = {value}"),
                    (false, true) => format!("reads {target}"),
                };
                let kind = StepRowKind::Use { target: target.clone(), value: value.clone(), is_set: *is_set };
                StepRow { time: step.time, task: task.clone(), text, place: place.clone(), kind }
            }
            ScheduleEvent::Step(StandingTask { label, place }) => {
                let form = place.as_ref().and_then(|place| forms.text(place));
                let text = form.unwrap_or_else(|| "goes on".into());
                StepRow {
                    time: step.time,
                    task: label.clone(),
                    text,
                    place: place.clone(),
                    kind: StepRowKind::Step,
                }
            }
            ScheduleEvent::End(_) => continue,
            ScheduleEvent::Switch(switch) => match switch_row(step.time, switch) {
                // A task that stops before it has done anything only comes later.
                Some(row) if matches!(switch, Switch::Preemption { .. }) && !rows.iter().any(is_by(&row)) => {
                    continue;
                }
                Some(row) => row,
                None => continue,
            },
        };
        // A task that does a step in parts stands at it several times.
        let is_repeated =
            rows.iter().rev().take_while(|other| other.task == row.task).any(|other| {
                row.kind == StepRowKind::Step && other.kind == row.kind && other.place == row.place
            });
        if matters && !is_repeated && rows.last() != Some(&row) {
            rows.push(row);
        }
    }
    shortened(rows)
}

/// Returns whether a line is of the same task as another.
fn is_by(row: &StepRow) -> impl Fn(&StepRow) -> bool + '_ {
    |other| other.task == row.task
}

/// Returns the lines without those before other tasks come into play, and not too many.
fn shortened(mut rows: Vec<StepRow>) -> Vec<StepRow> {
    let first = rows.first().map(|row| row.task.clone()).unwrap_or_default();
    let alone = rows.iter().take_while(|row| row.task == first).count();
    if alone < rows.len() {
        // Nor what a task does that begins when the others have come to their ends.
        let last = rows.last().map(|row| row.task.clone()).unwrap_or_default();
        let until = rows.iter().rposition(|row| row.task != last).map_or(0, |at| at + 1);
        let is_dropped = |at: usize, row: &StepRow| at < alone && row.kind == StepRowKind::Step;
        let mut before = rows[..until].iter().enumerate();
        let is_late = before.all(|(at, row)| row.task != last || is_dropped(at, row));
        let mut at = 0;
        rows.retain(|row| {
            at += 1;
            row.kind != StepRowKind::Step || at > alone && !(is_late && at > until)
        });
    }
    if rows.len() > TOLD_ROWS {
        let last = rows.split_off(rows.len() - TOLD_ROWS / 2);
        let left = rows.split_off(TOLD_ROWS / 2).len();
        let text = format!("… {left} more …");
        let kind = StepRowKind::LeftOut(left);
        rows.push(StepRow { time: last[0].time, task: String::new(), text, place: None, kind });
        rows.extend(last);
    }
    rows
}

/// Returns the line of a choice; `None` if the order of the lines shows it.
fn switch_row(time: u64, switch: &Switch) -> Option<StepRow> {
    let (task, text) = match switch {
        Switch::Preemption { stopped, .. } => (stopped, "has to stop before".to_owned()),
        Switch::Order { .. } => return None,
        Switch::Abort { task } => (task, "is asked to end by an operator".to_owned()),
        Switch::Restart { task, is_behind } => (task, interruption(*is_behind).to_owned()),
        Switch::Timer { passed, .. } => {
            let text = format!("{} s pass, and timers end", seconds(*passed));
            let kind = StepRowKind::Switch(switch.clone());
            return Some(StepRow { time, task: String::new(), text, place: None, kind });
        }
        Switch::Choice { task, form } => (task, format!("chooses form {}", form + 1)),
    };
    let (label, place) = (task.label.clone(), task.place.clone());
    Some(StepRow { time, task: label, text, place, kind: StepRowKind::Switch(switch.clone()) })
}

/// Returns of each step whether it matters; of uses, those of a place that several tasks use, of which one
/// sets it, and not before the last value that its first user gives it alone.
fn uses_that_matter(steps: &[ScheduleStep]) -> Vec<bool> {
    let mut by_target: HashMap<&str, Vec<(usize, &str, bool)>> = HashMap::new();
    let mut matters = vec![true; steps.len()];
    for (at, step) in steps.iter().enumerate() {
        if let ScheduleEvent::Use { task, target, is_set, .. } = &step.event {
            by_target.entry(target).or_default().push((at, task, *is_set));
            matters[at] = false;
        }
    }
    for uses in by_target.values() {
        let first = uses[0].1;
        let alone = uses.iter().take_while(|(_, task, _)| *task == first).count();
        let begin = uses[..alone].iter().rposition(|(.., is_set)| *is_set).map_or(0, |last| last + 1);
        let rest = &uses[begin..];
        let is_shared = rest.iter().any(|(_, task, _)| *task != rest[0].1);
        if is_shared && rest.iter().any(|(.., is_set)| *is_set) {
            rest.iter().for_each(|&(at, ..)| matters[at] = true);
        }
    }
    matters
}

/// Returns a text with at most so many characters.
pub(super) fn cut(text: &str, most: usize) -> String {
    match text.char_indices().nth(most) {
        Some((end, _)) => format!("{}…", text[..end].trim_end()),
        None => text.to_owned(),
    }
}

/// Returns the line that says which switches at the end of a schedule can be repeated for ever.
pub(crate) fn last_again(repeated: usize) -> Option<String> {
    match repeated {
        0 => None,
        1 => Some("then the last switch again, and so on".to_owned()),
        repeated => Some(format!("then the last {repeated} switches again, and so on")),
    }
}

/// Returns a schedule as the lines of a table.
pub(crate) fn lines(steps: &[ScheduleStep], forms: &mut SourceForms) -> Vec<String> {
    let rows = rows(steps, forms);
    let tasks = tasks(&rows);
    let length = |text: &str| text.chars().count();
    let width = |task: &&str| {
        let cells = rows.iter().filter(|row| row.task == *task).map(|row| length(&cut(&row.text, CELL)));
        cells.max().unwrap_or(0).max(length(&column_name(task)))
    };
    let widths: Vec<usize> = tasks.iter().map(width).collect();
    let pad = |text: &str, width: usize| format!("{text}{}", " ".repeat(width.saturating_sub(length(text))));
    let line = |time: &str, cells: &[String], place: &str| {
        let cells: Vec<String> = cells.iter().zip(&widths).map(|(cell, width)| pad(cell, *width)).collect();
        format!("{time:>6}  {}  {place}", cells.join("  ")).trim_end().to_owned()
    };
    if tasks.is_empty() {
        return rows.iter().map(|row| format!("{:>6}  {}", seconds(row.time), row.text)).collect();
    }
    let heads: Vec<String> = tasks.iter().map(|task| column_name(task)).collect();
    let mut lines = vec![line("time", &heads, "place")];
    for row in &rows {
        let time = seconds(row.time).to_string();
        if row.task.is_empty() {
            lines.push(format!("{time:>6}  {}", row.text));
            continue;
        }
        let cell = |task: &&str| if row.task == *task { cut(&row.text, CELL) } else { String::new() };
        let cells: Vec<String> = tasks.iter().map(cell).collect();
        lines.push(line(&time, &cells, &row.place(forms)));
    }
    lines
}

/// Returns a schedule as JSON: an array of the lines of its table.
pub(crate) fn json(steps: &[ScheduleStep], forms: &mut SourceForms) -> Vec<Json> {
    let rows = rows(steps, forms);
    let item = |row: &StepRow| {
        let form = row.place.as_ref().and_then(|place| forms.text(place));
        let (time, task, place) = (seconds(row.time), &row.task, &row.place);
        let mut item = match &row.kind {
            StepRowKind::Use { target, value, is_set } => json!({
                "kind": if *is_set { "set" } else { "read" }, "time": time, "task": task, "variable": target,
                "value": value, "place": place, "form": form,
            }),
            StepRowKind::Step => {
                json!({ "kind": "step", "time": time, "task": task, "place": place, "form": form })
            }
            StepRowKind::Switch(switch) => switch_json(time, switch, forms),
            StepRowKind::LeftOut(count) => json!({ "kind": "left-out", "count": count }),
        };
        item["text"] = row.text.clone().into();
        item
    };
    rows.iter().map(item).collect()
}

/// Returns a restart in words.
fn interruption(is_behind: bool) -> &'static str {
    if is_behind {
        "a restart interrupts it behind its effect"
    } else {
        "a restart interrupts it before its effect"
    }
}

pub(super) fn seconds(time: u64) -> f64 {
    time as f64 / 1e9
}

/// Returns a finding under a title as JSON. `schedule` is the file that repeats it.
pub(super) fn finding(
    finding: &Finding,
    title: &str,
    settings: &Settings,
    steps: &[ScheduleStep],
    schedule: &str,
    forms: &mut SourceForms,
) -> Json {
    let switches = steps.iter().filter_map(|step| match &step.event {
        ScheduleEvent::Switch(switch) => Some(text(switch, forms)),
        _ => None,
    });
    let switches: Vec<String> = switches.collect();
    let (what, errors, repeated) = (&finding.what, &finding.errors, finding.repeated);
    let told = json(steps, forms);
    let kind = title.split(' ').next().unwrap_or("finding");
    json!({
        kind: what, "grain": settings.grain.name(), "timers": settings.timers.name(),
        "switches": switches, "steps": told, "repeated": repeated, "report": errors,
        "schedule": schedule,
    })
}

fn switch_json(time: f64, switch: &Switch, forms: &mut SourceForms) -> Json {
    let mut task = |task: &StandingTask| {
        let form = task.place.as_ref().and_then(|place| forms.text(place));
        json!({ "task": task.label, "place": task.place, "form": form })
    };
    match switch {
        Switch::Preemption { stopped, next } => {
            json!({ "kind": "preemption", "time": time, "stops": task(stopped), "goes-on": task(next) })
        }
        Switch::Order { oldest, next } => {
            json!({ "kind": "order", "time": time, "goes-on": task(next), "before": task(oldest) })
        }
        Switch::Abort { task: aborted } => {
            json!({ "kind": "abort", "time": time, "ends": task(aborted) })
        }
        Switch::Timer { task: waiting, passed } => {
            json!({ "kind": "timer", "time": time, "passed": seconds(*passed), "before": task(waiting) })
        }
        Switch::Restart { task: performing, is_behind } => {
            json!({ "kind": "restart", "time": time, "interrupts": task(performing), "has-effect": is_behind })
        }
        Switch::Choice { task: asking, form } => {
            json!({ "kind": "choice", "time": time, "chooses": task(asking), "number": form + 1 })
        }
    }
}

/// Returns a choice in words, in one line or two.
pub(super) fn text(switch: &Switch, forms: &mut SourceForms) -> String {
    let mut place = |task: &StandingTask, word: &str| {
        task.place.as_ref().map_or(String::new(), |place| format!(" {word} {}", forms.describe(place)))
    };
    match switch {
        Switch::Preemption { stopped, next } => format!(
            "{} stops{}\n{} goes on{}",
            stopped.label,
            place(stopped, "before"),
            next.label,
            place(next, "at")
        ),
        Switch::Order { oldest, next } => {
            format!("{} goes on{}\nbefore {} does", next.label, place(next, "at"), oldest.label)
        }
        Switch::Abort { task } => {
            format!("an operator asks {} to end{}", task.label, place(task, "at"))
        }
        Switch::Restart { task, is_behind } => {
            format!("{}: {}{}", task.label, interruption(*is_behind), place(task, "at"))
        }
        Switch::Timer { task, passed } => format!(
            "{} s pass, and timers end,\nbefore {} goes on{}",
            seconds(*passed),
            task.label,
            place(task, "at")
        ),
        Switch::Choice { task, form } => {
            format!("{} chooses form {}{}", task.label, form + 1, place(task, "at"))
        }
    }
}

/// Returns the two places between which a task had to stop in a schedule: where it last used a place that
/// another task used meanwhile, and before which use it stopped; with the name of the place. The task is the
/// last one that stopped so.
pub(super) fn fragile_places(steps: &[ScheduleStep]) -> Option<FragilePlaces> {
    let stops = steps.iter().enumerate().rev().filter_map(|(at, step)| match &step.event {
        ScheduleEvent::Switch(Switch::Preemption { stopped, .. }) => Some((at, stopped)),
        _ => None,
    });
    stops.into_iter().find_map(|(at, stopped)| {
        let before = steps[..at].iter().rev().find_map(|step| match &step.event {
            ScheduleEvent::Use { task, target, place: Some(place), .. } if *task == stopped.label => {
                Some((target, place))
            }
            _ => None,
        });
        let (target, first) = before?;
        let is_used = |event: &ScheduleEvent| match event {
            ScheduleEvent::Use { task, target: other, .. } => *task != stopped.label && target == other,
            _ => false,
        };
        if !steps[at..].iter().any(|step| is_used(&step.event)) {
            return None;
        }
        let after = steps[at..].iter().find_map(|step| match &step.event {
            ScheduleEvent::Use { task, place: Some(place), .. } if *task == stopped.label => Some(place),
            _ => None,
        });
        let second = after.or(stopped.place.as_ref())?.clone();
        Some(FragilePlaces { target: target.clone(), first: first.clone(), second })
    })
}

/// Two places of the program that belong together, and the place that is used there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct FragilePlaces {
    pub(super) target: String,
    pub(super) first: String,
    pub(super) second: String,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the table of a schedule in which tasks use variables, in the form `A:x=1` or `A:x?1`, without
    /// spaces at the beginning of lines.
    fn table(uses: &[&str]) -> Vec<String> {
        let step = |text: &&str| {
            let (task, rest) = text.split_once(':').expect("a task comes first");
            let is_set = rest.contains('=');
            let (target, value) = rest.split_once(['=', '?']).expect("a value comes last");
            let (task, target, value) = (task.into(), target.into(), value.into());
            let event = ScheduleEvent::Use { task, target, value, is_set, place: None };
            ScheduleStep { time: 0, event }
        };
        let steps: Vec<ScheduleStep> = uses.iter().map(step).collect();
        let mut lines = lines(&steps, &mut SourceForms::default());
        lines.iter_mut().for_each(|line| *line = line.trim().to_string());
        lines
    }

    #[test]
    fn tasks_stand_side_by_side() {
        assert_eq!(
            table(&["M:n=0", "A:n?0", "B:n?0", "B:n=1", "A:n=1"]),
            [
                "time  A            B            place",
                "0  reads n = 0",
                "0               reads n = 0",
                "0               sets n to 1",
                "0  sets n to 1",
            ]
        );
    }

    #[test]
    fn uses_are_told_that_others_can_see() {
        // Variables that are set once and only read from then on, and those that one task uses alone, are
        // left out.
        assert!(table(&["M:n=0", "A:n?0", "B:n?0", "A:m=1", "A:m?1"]).is_empty());
        // A read before the others set.
        let lines = table(&["A:n?0", "A:n?0", "B:n=1"]);
        assert_eq!(lines[1..], ["0  reads n = 0", "0               sets n to 1"]);
        let many: Vec<String> =
            (0..90).map(|n| format!("{}:n={n}", if n % 2 == 0 { "A" } else { "B" })).collect();
        let many: Vec<&str> = many.iter().map(String::as_str).collect();
        let told = table(&many);
        assert_eq!((told.len(), &*told[21]), (42, "0  … 49 more …"));
    }
}
