//! Findings in words: which tasks take turns where, and what they read and set between.

use std::collections::HashMap;

use esl_testing::explore::{ScheduleEvent, ScheduleStep, SourceForms, StandingTask, Switch};
use serde_json::{Value as Json, json};

/// Uses of variables between two switches that are told; of more, the first and the last ones.
const TOLD_USES: usize = 8;

/// A use of a variable that matters: others use the variable too, and it is set.
#[derive(Clone, Debug, PartialEq, Eq)]
struct ToldUse<'a> {
    time: u64,
    task: &'a str,
    variable: &'a str,
    value: &'a str,
    is_set: bool,
}

/// A part of the account of a schedule: uses of variables, and switches in between.
enum Told<'a> {
    Switch(u64, &'a Switch),
    Uses(Vec<ToldUse<'a>>),
    /// So many uses are left out.
    Left(usize),
}

/// Returns the parts of a schedule that its account contains.
fn told(steps: &[ScheduleStep]) -> Vec<Told<'_>> {
    let matters = uses_that_matter(steps);
    let mut told = Vec::new();
    let mut uses: Vec<ToldUse<'_>> = Vec::new();
    for (step, matters) in steps.iter().zip(matters) {
        match &step.event {
            ScheduleEvent::Use { task, variable, value, is_set } => {
                let used = ToldUse { time: step.time, task, variable, value, is_set: *is_set };
                if matters && uses.last() != Some(&used) {
                    uses.push(used);
                }
            }
            ScheduleEvent::Switch(switch) => {
                put_uses(&mut told, std::mem::take(&mut uses));
                told.push(Told::Switch(step.time, switch));
            }
        }
    }
    put_uses(&mut told, uses);
    told
}

fn put_uses<'a>(told: &mut Vec<Told<'a>>, mut uses: Vec<ToldUse<'a>>) {
    if uses.len() > TOLD_USES {
        let last = uses.split_off(uses.len() - TOLD_USES / 2);
        let left = uses.split_off(TOLD_USES / 2).len();
        told.extend([Told::Uses(uses), Told::Left(left), Told::Uses(last)]);
    } else if !uses.is_empty() {
        told.push(Told::Uses(uses));
    }
}

/// Returns of each step whether it is a use that matters: of a variable that several tasks use, of which one
/// sets it, and not before the last value that its first user gives it alone.
fn uses_that_matter(steps: &[ScheduleStep]) -> Vec<bool> {
    let mut by_variable: HashMap<&str, Vec<(usize, &str, bool)>> = HashMap::new();
    for (at, step) in steps.iter().enumerate() {
        if let ScheduleEvent::Use { task, variable, is_set, .. } = &step.event {
            by_variable.entry(variable).or_default().push((at, task, *is_set));
        }
    }
    let mut matters = vec![false; steps.len()];
    for uses in by_variable.values() {
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

/// Returns a schedule as lines: the numbered switches, and what tasks read and set between them.
pub(super) fn lines(steps: &[ScheduleStep], forms: &mut SourceForms) -> Vec<String> {
    let mut lines = Vec::new();
    let mut number = 0;
    for told in told(steps) {
        match told {
            Told::Switch(time, switch) => {
                number += 1;
                let time = if time == 0 { String::new() } else { format!("at {} s, ", seconds(time)) };
                lines.push(format!("{number}. {time}{}", text(switch, forms).replace('\n', "\n   ")));
            }
            Told::Uses(uses) => {
                lines.extend(uses.iter().map(|used| {
                    let verb = if used.is_set { "sets" } else { "reads" };
                    let sign = if used.is_set { "to" } else { "=" };
                    format!("   {} {verb} {} {sign} {}", used.task, used.variable, used.value)
                }));
            }
            Told::Left(count) => lines.push(format!("   … {count} more …")),
        }
    }
    lines
}

/// Returns a schedule as JSON: an array of switches and uses of variables.
pub(super) fn json(steps: &[ScheduleStep], forms: &mut SourceForms) -> Vec<Json> {
    let mut items = Vec::new();
    for told in told(steps) {
        match told {
            Told::Switch(time, switch) => items.push(switch_json(seconds(time), switch, forms)),
            Told::Uses(uses) => items.extend(uses.iter().map(|used| {
                let kind = if used.is_set { "set" } else { "read" };
                let ToldUse { task, variable, value, .. } = used;
                json!({ "kind": kind, "time": seconds(used.time), "task": task, "variable": variable, "value": value })
            })),
            Told::Left(count) => items.push(json!({ "kind": "left-out", "count": count })),
        }
    }
    items
}

fn seconds(time: u64) -> f64 {
    time as f64 / 1e9
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
        Switch::Timer { task: waiting, passed } => {
            json!({ "kind": "timer", "time": time, "passed": seconds(*passed), "before": task(waiting) })
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the uses that are told of a schedule in which tasks use variables, in the form `A:x=1` or
    /// `A:x?1`.
    fn told_uses(uses: &[&str]) -> Vec<String> {
        let step = |text: &&str| {
            let (task, rest) = text.split_once(':').expect("a task comes first");
            let is_set = rest.contains('=');
            let (variable, value) = rest.split_once(['=', '?']).expect("a value comes last");
            let (task, variable, value) = (task.into(), variable.into(), value.into());
            ScheduleStep { time: 0, event: ScheduleEvent::Use { task, variable, value, is_set } }
        };
        let steps: Vec<ScheduleStep> = uses.iter().map(step).collect();
        let mut lines = lines(&steps, &mut SourceForms::default());
        lines.iter_mut().for_each(|line| *line = line.trim().to_string());
        lines
    }

    #[test]
    fn uses_are_told_that_others_can_see() {
        assert_eq!(
            told_uses(&["M:n=0", "A:n?0", "B:n?0", "B:n=1", "A:n=1"]),
            ["A reads n = 0", "B reads n = 0", "B sets n to 1", "A sets n to 1"]
        );
        // Variables that are set once and only read from then on, and those that one task uses alone, are
        // left out.
        assert!(told_uses(&["M:n=0", "A:n?0", "B:n?0", "A:m=1", "A:m?1"]).is_empty());
        // A read before the others set.
        assert_eq!(told_uses(&["A:n?0", "A:n?0", "B:n=1"]), ["A reads n = 0", "B sets n to 1"]);
        let many: Vec<String> =
            (0..20).map(|n| format!("{}:n={n}", if n % 2 == 0 { "A" } else { "B" })).collect();
        let many: Vec<&str> = many.iter().map(String::as_str).collect();
        let told = told_uses(&many);
        assert_eq!((told.len(), &*told[4]), (9, "… 11 more …"));
    }
}
