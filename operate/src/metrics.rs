//! Figures of a run in the text format of Prometheus.

use std::fmt::{Display, Write};
use std::net::TcpListener;

use esl_host::{Survey, SurveyRequest, TaskStanding};
use esl_world::{NoEventLoop, TlsIdentity};
use hyper::{Method, StatusCode};

use super::http::{self, plain, with};
use super::lobby::Lobby;
use super::scope::RunScope;

/// Serves the figures at `/metrics`.
///
/// # Errors
/// The reason, if there is no event loop.
pub(super) fn serve(
    listener: TcpListener,
    identity: Option<TlsIdentity>,
    scope: RunScope,
) -> Result<(), NoEventLoop> {
    http::serve(listener, identity, Lobby::default(), move |request, _| {
        let scope = scope.clone();
        async move {
            if request.uri().path() != "/metrics" {
                return plain(StatusCode::NOT_FOUND, "the figures are at /metrics\n");
            }
            if !matches!(*request.method(), Method::GET | Method::HEAD) {
                return plain(StatusCode::METHOD_NOT_ALLOWED, "figures are only read\n");
            }
            match scope.survey(SurveyRequest { data: true, ..SurveyRequest::default() }).await {
                Some(survey) => {
                    with(StatusCode::OK, "text/plain; version=0.0.4; charset=utf-8", text_of(&survey))
                }
                None => plain(StatusCode::SERVICE_UNAVAILABLE, "the machine does not answer\n"),
            }
        }
    })
}

/// A text in the format of Prometheus.
#[derive(Default)]
struct Exposition(String);

impl Exposition {
    /// Begins the samples of a metric.
    fn begin(&mut self, name: &str, kind: &str, help: &str) {
        // Writing to a string does not fail.
        _ = write!(self.0, "# HELP {name} {help}\n# TYPE {name} {kind}\n");
    }

    fn sample(&mut self, name: &str, label: Option<(&str, &str)>, value: impl Display) {
        _ = match label {
            None => writeln!(self.0, "{name} {value}"),
            Some((label, text)) => writeln!(self.0, "{name}{{{label}=\"{}\"}} {value}", escaped(text)),
        };
    }

    fn single(&mut self, name: &str, kind: &str, help: &str, value: impl Display) {
        self.begin(name, kind, help);
        self.sample(name, None, value);
    }
}

/// Returns the value of a label as the format has it.
fn escaped(text: &str) -> String {
    text.replace('\\', "\\\\").replace('"', "\\\"").replace('\n', "\\n")
}

fn seconds(nanoseconds: u64) -> f64 {
    nanoseconds as f64 / 1e9
}

/// A figure of an input.
type InputFigure = fn(&esl_host::InputRow) -> u64;

/// Returns the figures as a text.
fn text_of(survey: &Survey) -> String {
    let figures = &survey.figures;
    let mut text = Exposition::default();
    text.begin("esl_tasks", "gauge", "Tasks of the program that have not ended, by state.");
    for (standing, count) in TaskStanding::ALL.into_iter().zip(figures.tasks) {
        text.sample("esl_tasks", Some(("state", standing.name())), count);
    }
    let counters = [
        ("esl_tasks_made_total", "Tasks made, those of the library included.", figures.made),
        ("esl_ticks_total", "Ticks of all tasks.", figures.ticks),
        ("esl_turns_total", "Turns of tasks.", figures.turns),
        ("esl_recoveries_total", "Recovery procedures that have begun.", figures.recoveries),
        ("esl_restarts_total", "Restarts of children by supervisors.", figures.restarts),
        ("esl_collections_total", "Collections that are complete.", figures.collections),
        ("esl_allocated_bytes_total", "Bytes of objects made.", figures.allocated),
    ];
    for (name, help, value) in counters {
        text.single(name, "counter", help, value);
    }
    text.begin(
        "esl_failures_total",
        "counter",
        "Failures by cause, those included that were recovered from.",
    );
    for (cause, count) in &figures.failures {
        text.sample("esl_failures_total", Some(("cause", cause)), count);
    }
    let gauges = [
        ("esl_memory_live_bytes", "Bytes of objects that the last collection has left.", figures.live),
        ("esl_memory_committed_bytes", "Bytes taken from the system for objects.", figures.committed),
        ("esl_memory_limit_bytes", "Most bytes that objects may take.", figures.limit),
        ("esl_facts", "Facts in the database.", figures.facts),
        ("esl_paused", "1 while the run is paused from outside.", figures.is_paused.into()),
    ];
    for (name, help, value) in gauges {
        text.single(name, "gauge", help, value);
    }
    let [count, total, longest] = figures.pauses;
    text.begin("esl_pause_seconds", "summary", "Pauses for the collector.");
    text.sample("esl_pause_seconds_count", None, count);
    text.sample("esl_pause_seconds_sum", None, seconds(total));
    text.single("esl_pause_longest_seconds", "gauge", "The longest pause.", seconds(longest));
    let late = figures.lateness;
    text.begin("esl_timer_lateness_seconds", "summary", "How late sleeps and timeouts of waits ended.");
    text.sample("esl_timer_lateness_seconds_count", None, late.count);
    text.sample("esl_timer_lateness_seconds_sum", None, seconds(late.total));
    text.single("esl_timer_lateness_longest_seconds", "gauge", "The latest timer.", seconds(late.longest));
    text.single(
        "esl_idle_seconds_total",
        "counter",
        "Seconds of the program's clock in which all tasks waited.",
        seconds(figures.idled),
    );
    let kept = |row: &esl_host::InputRow| row.kept as u64;
    let inputs: [(&str, &str, &str, InputFigure); 3] = [
        ("esl_input_signals_total", "counter", "Signals of an input.", |row| row.signals),
        ("esl_input_dropped_total", "counter", "Signals of an input that were dropped.", |row| row.dropped),
        ("esl_input_waiting", "gauge", "Signals of an input that are not taken yet.", kept),
    ];
    for (name, kind, help, value) in inputs {
        text.begin(name, kind, help);
        for row in &survey.inputs {
            text.sample(name, Some(("input", &row.name)), value(row));
        }
    }
    text.0
}

#[cfg(test)]
mod tests {
    use esl_host::RunFigures;

    use super::*;

    /// Reads a text as strictly as the description of the format, and the advice for names, are. Returns the
    /// names of the metrics with samples, and their series.
    ///
    /// Source: "Exposition formats" and "Metric and label naming" of Prometheus.
    fn strictly(text: &str) -> Result<Vec<String>, String> {
        assert!(text.ends_with('\n') && !text.contains('\r'));
        let is_name = |name: &str| {
            name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
                && name.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_')
        };
        let (mut metric, mut kind) = (String::new(), String::new());
        let (mut metrics, mut series) = (Vec::new(), Vec::new());
        let mut helped = None;
        for line in text.lines() {
            let wrong = |reason: &str| Err(format!("{reason}: {line}"));
            if let Some(rest) = line.strip_prefix("# HELP ") {
                let Some((name, help)) = rest.split_once(' ') else { return wrong("no help") };
                if helped.is_some() || help.replace("\\\\", "").replace("\\n", "").contains('\\') {
                    return wrong("a help without a type, or a wrong escape");
                }
                helped = Some(name.to_string());
            } else if let Some(rest) = line.strip_prefix("# TYPE ") {
                let Some((name, found)) = rest.split_once(' ') else { return wrong("no type") };
                if helped.take().as_deref() != Some(name) || metrics.contains(&name.to_string()) {
                    return wrong("a type without a help, or twice");
                }
                let is_total = name.ends_with("_total");
                let ends_well = match found {
                    "counter" => is_total,
                    "gauge" | "summary" => !is_total && !name.ends_with("_count"),
                    _ => false,
                };
                if !is_name(name) || !ends_well || !name.starts_with("esl_") {
                    return wrong("a name that is not one of its kind");
                }
                metrics.push(name.to_string());
                (metric, kind) = (name.into(), found.into());
            } else {
                let Some((named, value)) = line.rsplit_once(' ') else { return wrong("no value") };
                let (name, labels) = match named.split_once('{') {
                    None => (named, ""),
                    Some((name, rest)) => match rest.strip_suffix('}') {
                        Some(labels) => (name, labels),
                        None => return wrong("labels without an end"),
                    },
                };
                let of_summary = ["_sum", "_count"].iter().any(|end| format!("{metric}{end}") == name);
                if helped.is_some() || !(if kind == "summary" { of_summary } else { name == metric }) {
                    return wrong("a sample of another metric");
                }
                if !value.parse::<f64>().is_ok_and(|value| value.is_finite() && value >= 0.0) {
                    return wrong("no number");
                }
                if !labels.is_empty() {
                    let Some((label, quoted)) = labels.split_once('=') else { return wrong("no label") };
                    let inside = quoted.strip_prefix('"').and_then(|rest| rest.strip_suffix('"'));
                    let rest =
                        inside.map(|text| text.replace("\\\\", "").replace("\\\"", "").replace("\\n", ""));
                    if !is_name(label) || rest.is_none_or(|rest| rest.contains(['\\', '"'])) {
                        return wrong("a label that is not written well");
                    }
                }
                if series.contains(&named.to_string()) {
                    return wrong("twice");
                }
                series.push(named.to_string());
            }
        }
        if helped.is_some() { Err("a help at the end".into()) } else { Ok(series) }
    }

    #[test]
    fn the_text_is_in_the_format_to_the_letter() {
        let input = |name: &str| esl_host::InputRow {
            name: name.into(),
            kept: 1,
            capacity: 2,
            signals: u64::MAX,
            dropped: 3,
        };
        let figures = RunFigures {
            failures: vec![(":A \"B\\\nC} 1".into(), 3), (":ü".into(), u64::MAX)],
            pauses: [2, u64::MAX, 1],
            ..RunFigures::default()
        };
        let inputs = vec![input("a\\"), input("b{c=\"d\"} 7"), input("")];
        let survey = Survey { figures, inputs, ..Survey::default() };
        let series = strictly(&text_of(&survey)).expect("it is in the format");
        assert!(series.len() > 30, "{series:?}");
        strictly(&text_of(&Survey::default())).expect("it is in the format");
        for wrong in
            ["a 1\n", "# TYPE esl_a gauge\nesl_a 1\n", "# HELP esl_a x\n# TYPE esl_a counter\nesl_a 1\n"]
        {
            assert!(strictly(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn figures_become_samples() {
        let figures = RunFigures {
            tasks: [1, 2, 0, 0],
            failures: vec![(":A \"B\\".into(), 3)],
            pauses: [2, 1_500_000_000, 1_000_000_000],
            ..RunFigures::default()
        };
        let text = text_of(&Survey { figures, ..Survey::default() });
        for line in [
            "esl_tasks{state=\"waits\"} 2",
            "esl_failures_total{cause=\":A \\\"B\\\\\"} 3",
            "esl_pause_seconds_sum 1.5",
            "# TYPE esl_ticks_total counter",
        ] {
            assert!(text.lines().any(|found| found == line), "{line}\n{text}");
        }
    }
}
