//! The monitor's model of a run, gathered from surveys.
//!
//! A survey tells of some tasks at a time, in the order of their numbers; one round of surveys tells of all.
//! A task that a round has passed over has ended.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::time::Instant;

use esl_host::{FailureRow, InputRow, LockRow, RelationRow, RunFigures, Survey, SurveyedTask, TaskStanding};
use serde_json::{Value, json};

use crate::secrets::OperatorRole;

/// Failures that are kept.
const FAILURES: usize = 200;
/// Most rows that a viewer is shown at a time.
pub(super) const ROWS: usize = 120;

/// Most tasks whose activity the picture of the program shows.
const ACTIVE: usize = 500;

/// The parts of the picture of the program that a viewer wants.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum MissionView {
    /// None.
    #[default]
    None,
    /// Names and places of tasks, for a picture that it has.
    Live,
    /// The picture, too.
    All,
}

/// The view that a viewer has chosen.
#[derive(Clone, Debug, Default)]
pub(super) struct ViewerView {
    /// Whether tasks that follow each other and are alike have one row.
    pub(super) is_grouped: bool,
    /// Text that is to be in a task's name, place, state or reason, in lower case.
    pub(super) text: String,
    /// First row, and number of rows.
    pub(super) from: usize,
    pub(super) count: usize,
    /// The task whose frames are shown.
    pub(super) task: Option<u64>,
    /// Relation whose facts are shown, in upper case, and how many of them are passed over.
    pub(super) relation: String,
    pub(super) facts_from: usize,
    /// Whether pictures are shown.
    pub(super) has_pictures: bool,
    /// Wanted parts of the picture of the program.
    pub(super) mission: MissionView,
    /// Number of the latest failure that was shown.
    pub(super) failure: u64,
    /// How often a viewer of this name has come.
    pub(super) coming: u64,
    /// Role of the viewer, once it has come.
    pub(super) role: Option<OperatorRole>,
}

/// The model of a run.
#[derive(Default)]
pub(super) struct RunModel {
    tasks: BTreeMap<u64, SurveyedTask>,
    /// Number after which the next survey begins.
    pub(super) cursor: u64,
    /// Tasks in the order of the tree, with their depths.
    order: Vec<(u64, usize)>,
    /// Tasks that wait for each other.
    cycle: BTreeSet<u64>,
    figures: RunFigures,
    relations: Vec<RelationRow>,
    locks: Vec<LockRow>,
    inputs: Vec<InputRow>,
    failures: VecDeque<FailureRow>,
    /// Time and ticks of the last survey, and signals of inputs then.
    last: Option<(Instant, u64, BTreeMap<String, u64>)>,
    ticks_per_second: f64,
    input_rates: BTreeMap<String, f64>,
}

impl RunModel {
    /// Returns the number of the latest failure.
    pub(super) fn latest_failure(&self) -> u64 {
        self.failures.back().map_or(0, |row| row.number)
    }

    /// Takes in a survey of the tasks after the cursor, and of those that were named.
    pub(super) fn take(&mut self, survey: Survey, page: usize, now: Instant) {
        let beyond: Vec<&SurveyedTask> = survey.tasks.iter().filter(|row| row.number > self.cursor).collect();
        let last =
            if survey.has_more_tasks { beyond.get(page.max(1) - 1).map(|row| row.number) } else { None };
        let end = last.unwrap_or(u64::MAX);
        let told: BTreeSet<u64> = survey.tasks.iter().map(|row| row.number).collect();
        let cursor = self.cursor;
        self.tasks.retain(|number, _| *number <= cursor || *number > end || told.contains(number));
        self.tasks.extend(survey.tasks.into_iter().map(|row| (row.number, row)));
        self.cursor = last.unwrap_or(0);
        for row in survey.failures {
            self.note_failure(row);
        }
        self.note_rates(&survey.figures, &survey.inputs, now);
        (self.figures, self.relations, self.locks, self.inputs) =
            (survey.figures, survey.relations, survey.locks, survey.inputs);
        // The tree of many tasks changes slowly, and takes long to make. Of the first round, which may take
        // long as well, one sees what there is so far.
        if self.cursor == 0 || self.tasks.len() >= 2 * self.order.len() {
            self.arrange();
        }
    }

    /// Takes in what is to be seen after the end of the run: all but the tasks, which stay as they were.
    pub(super) fn take_last(&mut self, survey: Survey) {
        for row in survey.failures {
            self.note_failure(row);
        }
        let tasks = self.figures.tasks;
        self.figures = RunFigures { tasks, ..survey.figures };
        (self.relations, self.locks, self.inputs) = (survey.relations, survey.locks, survey.inputs);
        self.ticks_per_second = 0.0;
    }

    /// Notes a failure, in place of what was known of it.
    fn note_failure(&mut self, row: FailureRow) {
        let is_same =
            |other: &FailureRow| (other.task, other.time, &other.cause) == (row.task, row.time, &row.cause);
        if self.failures.iter().any(|other| other.number == row.number) {
            return;
        }
        // The report of a failure comes with another number, in place of the latest note of it.
        if row.report.is_some()
            && let Some(at) = self.failures.iter().rposition(|other| other.report.is_none() && is_same(other))
        {
            self.failures.remove(at);
        }
        self.failures.push_back(row);
        if self.failures.len() > FAILURES {
            self.failures.pop_front();
        }
    }

    /// Forgets tasks that were named and are not there any more.
    pub(super) fn drop_missing(&mut self, named: &[u64], told: &BTreeSet<u64>) {
        for number in named.iter().filter(|number| !told.contains(number)) {
            self.tasks.remove(number);
        }
    }

    fn note_rates(&mut self, figures: &RunFigures, inputs: &[InputRow], now: Instant) {
        let signals: BTreeMap<String, u64> =
            inputs.iter().map(|row| (row.name.clone(), row.signals)).collect();
        if let Some((then, ticks, before)) = &self.last {
            let seconds = now.duration_since(*then).as_secs_f64().max(1e-3);
            let rate = figures.ticks.saturating_sub(*ticks) as f64 / seconds;
            self.ticks_per_second += (rate - self.ticks_per_second) * 0.5;
            for (name, &count) in &signals {
                let rate = count.saturating_sub(before.get(name).copied().unwrap_or(count)) as f64 / seconds;
                let smooth = self.input_rates.entry(name.clone()).or_default();
                *smooth += (rate - *smooth) * 0.3;
            }
        }
        self.last = Some((now, figures.ticks, signals));
    }

    /// Puts the tasks into the order of the tree, and finds those that wait for each other.
    fn arrange(&mut self) {
        let survey = Survey { tasks: self.tasks.values().cloned().collect(), ..Survey::default() };
        self.order = survey.tree().into_iter().map(|(at, depth)| (survey.tasks[at].number, depth)).collect();
        self.cycle = cycles(&self.tasks);
    }

    /// Returns whether the run is paused from outside.
    pub(super) fn is_paused(&self) -> bool {
        self.figures.is_paused
    }

    /// Returns the numbers of the tasks that a viewer sees.
    pub(super) fn visible(&self, view: &ViewerView) -> Vec<u64> {
        let rows = self.rows(view);
        let shown = rows.iter().skip(view.from).take(view.count.min(ROWS));
        shown.map(|row| row.task.number).collect()
    }

    /// Returns the rows that a viewer could be shown.
    fn rows<'a>(&'a self, view: &'a ViewerView) -> Vec<ShownTask<'a>> {
        let mut rows: Vec<ShownTask<'a>> = Vec::new();
        for (task, depth) in self.matching(view) {
            match rows.last_mut() {
                Some(last) if view.is_grouped && last.depth == depth && are_alike(last.task, task) => {
                    last.count += 1;
                }
                _ => rows.push(ShownTask { task, depth, count: 1 }),
            }
        }
        rows
    }

    fn matching<'a>(&'a self, view: &'a ViewerView) -> impl Iterator<Item = (&'a SurveyedTask, usize)> {
        let rows = self.order.iter().filter_map(|(number, depth)| Some((self.tasks.get(number)?, *depth)));
        rows.filter(|(row, _)| view.text.is_empty() || self.has(row, &view.text))
    }

    /// Returns whether a task is one that a text is looked for in.
    fn has(&self, row: &SurveyedTask, text: &str) -> bool {
        let in_text = |field: &str| field.to_lowercase().contains(text);
        in_text(&row.name)
            || row.waits_for.as_deref().is_some_and(in_text)
            || row.place.as_deref().is_some_and(in_text)
            || row.standing.name() == text
            || text == "cycle" && self.cycle.contains(&row.number)
            || row.number.to_string() == text
    }

    /// Returns the names, states and places of the tasks.
    pub(super) fn activity(&self) -> Vec<Value> {
        let rows = self.tasks.values().take(ACTIVE);
        rows.map(|row| json!([row.name, row.standing.name(), row.place])).collect()
    }

    /// Returns what a viewer is told.
    pub(super) fn message(&self, view: &ViewerView) -> Value {
        let figures = &self.figures;
        let matching = self.rows(view);
        let rows: Vec<Value> =
            matching.iter().skip(view.from).take(view.count.min(ROWS)).map(|row| self.task(row)).collect();
        let standings: BTreeMap<&str, u64> =
            TaskStanding::ALL.into_iter().map(TaskStanding::name).zip(figures.tasks).collect();
        let failures: Vec<Value> =
            self.failures.iter().filter(|row| row.number > view.failure).map(failure).collect();
        json!({
            "time": figures.time as f64 / 1e9,
            "round": figures.rounds,
            "paused": figures.is_paused,
            "virtual": figures.is_virtual,
            "standings": standings,
            "made": figures.made,
            "ticks": figures.ticks,
            "rate": self.ticks_per_second,
            "idled": figures.idled as f64 / 1e9,
            "memory": {
                "live": figures.live, "committed": figures.committed, "limit": figures.limit,
                "collections": figures.collections, "longest": figures.pauses[2] as f64 / 1e6,
            },
            "failed": figures.failed,
            "ended_by_failure": figures.ended_by_failure,
            "recoveries": figures.recoveries,
            "restarts": figures.restarts,
            "facts": figures.facts,
            "late": figures.lateness.longest as f64 / 1e6,
            "cycle": self.cycle.len(),
            "total": self.order.len(),
            "matching": matching.len(),
            "from": view.from,
            "rows": rows,
            "failures": failures,
            "relations": self.relations.iter().map(|row| json!({
                "name": row.name, "width": row.width, "facts": row.facts, "property": row.is_property,
            })).collect::<Vec<_>>(),
            "locks": self.locks.iter().map(|row| json!({
                "property": row.property, "state": row.state, "tasks": row.subscribers,
            })).collect::<Vec<_>>(),
            "inputs": self.inputs.iter().map(|row| json!({
                "name": row.name, "kept": row.kept, "capacity": row.capacity, "signals": row.signals,
                "dropped": row.dropped, "rate": self.input_rates.get(&row.name).copied().unwrap_or(0.0),
            })).collect::<Vec<_>>(),
        })
    }

    fn task(&self, row: &ShownTask<'_>) -> Value {
        let ShownTask { task: row, depth, count } = *row;
        let holders: Vec<Value> = row
            .held_by
            .iter()
            .map(|number| json!([number, self.tasks.get(number).map(|row| &row.name)]))
            .collect();
        json!({
            "n": row.number, "maker": row.maker, "name": row.name, "depth": depth.min(40),
            "state": row.standing.name(), "waits": row.waits_for, "holders": holders,
            "place": row.place, "ends": row.ends_at.map(|time| time as f64 / 1e9), "ticks": row.ticks, "daemon": row.is_daemon, "cleanup": row.runs_cleanup,
            "cycle": self.cycle.contains(&row.number), "count": count,
        })
    }
}

/// A row of the table: a task, and others that are like it.
struct ShownTask<'a> {
    task: &'a SurveyedTask,
    /// Depth in the tree.
    depth: usize,
    /// Number of tasks that it stands for.
    count: usize,
}

/// Returns whether two tasks look alike, but for their numbers, their ticks and the ends of their waits.
fn are_alike(one: &SurveyedTask, other: &SurveyedTask) -> bool {
    let is_unnamed = |task: &SurveyedTask| task.name.strip_prefix("task ") == Some(&task.number.to_string());
    (one.name == other.name || is_unnamed(one) && is_unnamed(other))
        && (one.maker, one.standing, one.is_daemon, one.runs_cleanup)
            == (other.maker, other.standing, other.is_daemon, other.runs_cleanup)
        && (&one.waits_for, &one.held_by, &one.place) == (&other.waits_for, &other.held_by, &other.place)
}

fn failure(row: &FailureRow) -> Value {
    json!({
        "n": row.number, "time": row.time as f64 / 1e9, "task": row.task, "name": row.name,
        "cause": row.cause, "arguments": row.arguments, "place": row.place, "report": row.report,
        "full": row.full_report,
    })
}

/// Returns the tasks that wait for each other, in circles: what is left when those have been taken away,
/// again and again, that wait for none of the others, and those for which none of the others waits.
fn cycles(tasks: &BTreeMap<u64, SurveyedTask>) -> BTreeSet<u64> {
    let mut waits: BTreeMap<u64, BTreeSet<u64>> = BTreeMap::new();
    let mut awaited: BTreeMap<u64, BTreeSet<u64>> = BTreeMap::new();
    for row in tasks.values() {
        for &holder in row.held_by.iter().filter(|holder| tasks.contains_key(holder)) {
            waits.entry(row.number).or_default().insert(holder);
            awaited.entry(holder).or_default().insert(row.number);
        }
    }
    for _ in 0..2 {
        let mut ends: Vec<u64> = awaited.keys().copied().filter(|task| !waits.contains_key(task)).collect();
        while let Some(end) = ends.pop() {
            for waiter in awaited.remove(&end).unwrap_or_default() {
                if let Some(holders) = waits.get_mut(&waiter) {
                    holders.remove(&end);
                    if holders.is_empty() {
                        waits.remove(&waiter);
                        ends.push(waiter);
                    }
                }
            }
        }
        // The same from the other side.
        std::mem::swap(&mut waits, &mut awaited);
    }
    waits.into_keys().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(number: u64, held_by: &[u64]) -> SurveyedTask {
        SurveyedTask {
            number,
            maker: 0,
            name: format!("task {number}"),
            standing: TaskStanding::Waits,
            waits_for: Some("something".into()),
            held_by: held_by.to_vec(),
            place: None,
            ends_at: None,
            ticks: 0,
            is_daemon: false,
            runs_cleanup: false,
        }
    }

    #[test]
    fn tasks_that_wait_for_each_other_are_found() {
        let tasks = [row(1, &[2]), row(2, &[3]), row(3, &[2, 9]), row(4, &[1]), row(5, &[6]), row(6, &[])];
        let tasks = tasks.into_iter().map(|row| (row.number, row)).collect();
        assert_eq!(cycles(&tasks), BTreeSet::from([2, 3]));
        assert!(
            cycles(&[row(1, &[2]), row(2, &[])].into_iter().map(|row| (row.number, row)).collect())
                .is_empty()
        );
    }

    #[test]
    fn tasks_come_and_go_by_pages() {
        let mut model = RunModel::default();
        let page = |numbers: &[u64], has_more_tasks| Survey {
            tasks: numbers.iter().map(|&number| row(number, &[])).collect(),
            has_more_tasks,
            ..Survey::default()
        };
        let now = Instant::now();
        model.take(page(&[1, 2], true), 2, now);
        assert_eq!(model.cursor, 2);
        // Tasks of an unfinished first round are visible at once.
        assert_eq!(model.visible(&ViewerView { count: 10, ..ViewerView::default() }), [1, 2]);
        model.take(page(&[3, 4], true), 2, now);
        // Task 2 was named, as a viewer sees it.
        model.take(page(&[2, 7], false), 2, now);
        let view = ViewerView { count: 10, ..ViewerView::default() };
        assert_eq!((model.cursor, model.visible(&view)), (0, vec![1, 2, 3, 4, 7]));
        model.take(page(&[2, 7], false), 5, now);
        assert_eq!(model.visible(&view), [2, 7]);
        assert_eq!(model.visible(&ViewerView { text: "task 7".into(), ..view }), [7]);
    }
}
