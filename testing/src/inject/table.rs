//! Tables of runs with faults: as text, JSON, CSV and Markdown.

use std::fmt::Write;

use esl_analysis::render::markdown_cell;
use serde_json::{Value, json};

use super::fault::on_one_line;
use super::{FaultOutcome, InjectedRow, InjectionReport};

/// Form of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InjectFormat {
    /// Text for people.
    Text,
    /// One object.
    Json,
    /// Comma-separated values.
    Csv,
    /// A table of Markdown.
    Markdown,
}

/// Numbers of rows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct InjectionSummary {
    /// All.
    pub rows: usize,
    /// Those in which the program is at fault.
    pub bad: usize,
    /// Subjects whose undisturbed run cannot be compared with.
    pub problems: usize,
}

/// Counts the rows of reports.
pub fn summary<'a>(reports: impl IntoIterator<Item = &'a InjectionReport>) -> InjectionSummary {
    let mut all = InjectionSummary::default();
    for report in reports {
        all.rows += report.rows.len();
        all.bad += report.rows.iter().filter(|row| row.outcome.is_bad()).count();
        all.problems += usize::from(report.problem.is_some());
    }
    all
}

/// Returns the table of reports, each with the name of its file.
pub fn render(reports: &[(String, InjectionReport)], format: InjectFormat) -> String {
    match format {
        InjectFormat::Text => text(reports),
        InjectFormat::Json => json_object(reports),
        InjectFormat::Csv => csv(reports),
        InjectFormat::Markdown => markdown(reports),
    }
}

/// Returns the end of a row: its outcome and the details.
fn ending(row: &InjectedRow) -> String {
    match row.detail.as_str() {
        "" => row.outcome.text().into(),
        detail => format!("{}: {}", row.outcome.text(), on_one_line(detail)),
    }
}

fn text(reports: &[(String, InjectionReport)]) -> String {
    let mut text = String::new();
    for (file, report) in reports {
        // Writing to a text does not fail.
        let subject = report.test.as_deref().unwrap_or("the program");
        _ = writeln!(text, "{file}: {subject}, seed {}", report.seed);
        if let Some(problem) = &report.problem {
            _ = writeln!(text, "  its undisturbed run is not one to compare with: {problem}");
            continue;
        }
        if report.calls.is_empty() {
            _ = writeln!(text, "  undisturbed: {:.1} s; no operation is called", report.seconds);
            continue;
        }
        let calls: usize = report.calls.values().sum();
        let names: Vec<String> = report.calls.iter().map(|(name, count)| format!("{name} {count}")).collect();
        _ = writeln!(
            text,
            "  undisturbed: {:.1} s; calls: {calls} ({}), {} of them disturbed",
            report.seconds,
            names.join(", "),
            report.tried
        );
        let width = |cell: &dyn Fn(&InjectedRow) -> usize| report.rows.iter().map(cell).max().unwrap_or(0);
        let (names, tasks) = (width(&|row| row.name.len()), width(&|row| row.task.len()));
        for row in &report.rows {
            let at = format!("{:.1} s", row.at);
            _ = writeln!(text, "  {:names$}  {at:>9}  {:tasks$}  {}", row.name, row.task, ending(row));
            if let Some(output) = &row.text {
                output.lines().for_each(|line| _ = writeln!(text, "      {line}"));
            }
        }
        _ = writeln!(text, "  {}", counts(report));
    }
    text
}

/// Returns the numbers of rows by their outcomes.
fn counts(report: &InjectionReport) -> String {
    let parts = FaultOutcome::ALL.iter().filter_map(|outcome| {
        let count = report.rows.iter().filter(|row| row.outcome == *outcome).count();
        (count > 0).then(|| format!("{count} {}", outcome.text().to_lowercase()))
    });
    let parts: Vec<String> = parts.collect();
    let runs = if report.rows.len() == 1 { "run" } else { "runs" };
    let left = match report.pairs_left {
        0 => String::new(),
        left => format!("; {left} pairs were not tried"),
    };
    format!("{} {runs}: {}{left}", report.rows.len(), parts.join("; "))
}

const HEADINGS: [&str; 12] = [
    "file",
    "test",
    "seed",
    "name",
    "operation",
    "call",
    "fault",
    "time",
    "task",
    "outcome",
    "bad",
    "detail",
];

/// Returns the cells of each row.
fn cells(reports: &[(String, InjectionReport)]) -> Vec<[String; 12]> {
    let mut all = Vec::new();
    for (file, report) in reports {
        for row in &report.rows {
            let part = |text: &dyn Fn(&super::InjectedFault) -> String| {
                row.faults.iter().map(text).collect::<Vec<_>>().join("/")
            };
            all.push([
                file.clone(),
                report.test.clone().unwrap_or_default(),
                report.seed.to_string(),
                row.name.clone(),
                part(&|fault| super::fault::operation_name(&fault.operation)),
                part(&|fault| fault.call.to_string()),
                part(&|fault| fault.way.name()),
                format!("{:.3}", row.at),
                row.task.clone(),
                row.outcome.text().into(),
                if row.outcome.is_bad() { "bad" } else { "" }.into(),
                row.detail.clone(),
            ]);
        }
    }
    all
}

fn csv(reports: &[(String, InjectionReport)]) -> String {
    let cell = |text: &str| match text.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text.to_string(),
    };
    let mut text = HEADINGS.join(",") + "\r\n";
    for row in cells(reports) {
        text += &(row.iter().map(|text| cell(text)).collect::<Vec<_>>().join(",") + "\r\n");
    }
    text
}

fn markdown(reports: &[(String, InjectionReport)]) -> String {
    let mut text = format!("| {} |\n|{}\n", HEADINGS.join(" | "), " --- |".repeat(HEADINGS.len()));
    for row in cells(reports) {
        let row: Vec<String> = row.iter().map(|cell| markdown_cell(cell)).collect();
        _ = writeln!(text, "| {} |", row.join(" | "));
    }
    text
}

fn json_object(reports: &[(String, InjectionReport)]) -> String {
    let subjects = reports.iter().map(|(file, report)| {
        json!({
            "file": file,
            "test": report.test,
            "seed": report.seed,
            "problem": report.problem,
            "seconds": report.seconds,
            "calls": report.calls,
            "calls-disturbed": report.tried,
            "bound-seconds": report.bound.seconds,
            "bound-ticks": report.bound.ticks,
            "pairs-not-tried": report.pairs_left,
            "rows": report.rows.iter().map(json_row).collect::<Vec<_>>(),
        })
    });
    format!("{:#}\n", json!({ "subjects": subjects.collect::<Vec<_>>() }))
}

fn json_row(row: &InjectedRow) -> Value {
    let fault = |fault: &super::InjectedFault| {
        json!({
            "operation": super::fault::operation_name(&fault.operation),
            "call": fault.call,
            "lasts": fault.lasts,
            "fault": fault.way.name(),
        })
    };
    json!({
        "name": row.name,
        "faults": row.faults.iter().map(fault).collect::<Vec<_>>(),
        "time": row.at,
        "task": row.task,
        "outcome": row.outcome.text().to_lowercase(),
        "bad": row.outcome.is_bad(),
        "detail": row.detail,
    })
}
