//! The outcome of a run with faults, compared with the undisturbed one.

use esl::program::Ended;

use super::RunBound;
use super::properties::{left, still_on};
use super::run::InjectedRun;
use crate::{ALL_HELD, NO_CHECK, ONE_DID_NOT_HOLD, WITHOUT_CHECK};

/// Outcome of a run with faults.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum FaultOutcome {
    /// It ends as the undisturbed run does, with the same facts; without facts, with the same output.
    SameResult,
    /// It comes to its end, with another result.
    OtherResult,
    /// It comes to its end, and a failure has ended a task for which no form waits.
    TaskFailed,
    /// A failure or an abort ends it, or it says by its status that it has failed; all cleanups have run.
    Failed,
    /// A condition of `always` was false.
    Violated,
    /// A failure has ended it, and a property has a value with which neither the undisturbed run ends nor
    /// begins; or it has come to its end, and a property is not `:off` that is so after the undisturbed run.
    LeftOn,
    /// A cleanup was cut off.
    CleanupCutOff,
    /// It takes more virtual time, or more ticks, than its bound.
    Hangs,
    /// No task can ever run again.
    Deadlocks,
    /// Its memory is exhausted.
    Exhausted,
    /// The run did not come to the call.
    NotReached,
}

impl FaultOutcome {
    /// All of them, the good ones first.
    pub const ALL: [FaultOutcome; 11] = [
        FaultOutcome::SameResult,
        FaultOutcome::OtherResult,
        FaultOutcome::TaskFailed,
        FaultOutcome::Failed,
        FaultOutcome::NotReached,
        FaultOutcome::Violated,
        FaultOutcome::LeftOn,
        FaultOutcome::CleanupCutOff,
        FaultOutcome::Hangs,
        FaultOutcome::Deadlocks,
        FaultOutcome::Exhausted,
    ];

    /// Returns the outcome in words.
    pub const fn text(self) -> &'static str {
        match self {
            FaultOutcome::SameResult => "recovered",
            FaultOutcome::OtherResult => "recovered otherwise",
            FaultOutcome::TaskFailed => "recovered, a task failed",
            FaultOutcome::Failed => "failed, cleanups run",
            FaultOutcome::Violated => "INVARIANT FALSE",
            FaultOutcome::LeftOn => "LEFT ON",
            FaultOutcome::CleanupCutOff => "CLEANUP CUT OFF",
            FaultOutcome::Hangs => "HANGS",
            FaultOutcome::Deadlocks => "DEADLOCK",
            FaultOutcome::Exhausted => "MEMORY EXHAUSTED",
            FaultOutcome::NotReached => "not reached",
        }
    }

    /// Returns whether the program is at fault.
    pub const fn is_bad(self) -> bool {
        use FaultOutcome::{CleanupCutOff, Deadlocks, Exhausted, Hangs, LeftOn, Violated};
        matches!(self, Violated | LeftOn | CleanupCutOff | Hangs | Deadlocks | Exhausted)
    }
}

/// Returns the outcome of a run, and details in a few words.
pub(super) fn judge(
    run: &InjectedRun,
    undisturbed: &InjectedRun,
    bound: RunBound,
    is_test: bool,
) -> (FaultOutcome, String) {
    if !run.violated.is_empty() {
        return (FaultOutcome::Violated, run.violated.join("; "));
    }
    if run.is_endless {
        let detail = if run.seconds > bound.seconds {
            format!("after {:.0} s; bound {:.0} s", run.seconds, bound.seconds)
        } else {
            format!("after {} ticks; bound {}", run.ticks, bound.ticks)
        };
        return (FaultOutcome::Hangs, detail);
    }
    match run.ended {
        Ended::Deadlocked => return (FaultOutcome::Deadlocks, waits(&run.errors)),
        Ended::BudgetSpent => return (FaultOutcome::Hangs, "its budget of ticks is spent".into()),
        Ended::HeapExhausted => return (FaultOutcome::Exhausted, String::new()),
        Ended::Normally(_) | Ended::Failed | Ended::Signalled(_) => {}
    }
    if let Some(report) = &run.cut_off {
        return (FaultOutcome::CleanupCutOff, report.clone());
    }
    let comes_to_its_end = run.ended == undisturbed.ended
        || is_test && matches!(run.ended, Ended::Normally(0 | ONE_DID_NOT_HOLD));
    let on = if comes_to_its_end { still_on(&run.properties, &undisturbed.properties) } else { Vec::new() };
    if !on.is_empty() {
        return (FaultOutcome::LeftOn, on.join("; "));
    }
    if run.ended == undisturbed.ended {
        let differences = differences(run, undisturbed);
        let failed = failed_tasks(run, undisturbed);
        let outcome = match (failed.is_empty(), differences.is_empty()) {
            (false, _) => FaultOutcome::TaskFailed,
            (true, false) => FaultOutcome::OtherResult,
            (true, true) => FaultOutcome::SameResult,
        };
        let parts: Vec<String> =
            failed.into_iter().chain([differences]).filter(|part| !part.is_empty()).collect();
        return (outcome, parts.join("; "));
    }
    if is_test && run.ended == Ended::Normally(ONE_DID_NOT_HOLD) {
        let line = run.errors.lines().find(|line| line.ends_with(" is false."));
        let line = line.map_or(String::new(), |line| format!(": {line}"));
        return (FaultOutcome::OtherResult, format!("a check did not hold{line}"));
    }
    if is_test && run.ended == Ended::Normally(0) {
        return (FaultOutcome::OtherResult, "the program exits before the end of the test".into());
    }
    let left = left(&run.properties, &undisturbed.first, &undisturbed.properties);
    if !left.is_empty() {
        return (FaultOutcome::LeftOn, left.join("; "));
    }
    let detail = match run.ended {
        Ended::Normally(status) => format!("status {status}"),
        _ => reason(&run.errors),
    };
    (FaultOutcome::Failed, detail)
}

/// Returns whether an undisturbed run is one to compare with; otherwise a text about it.
pub(super) fn problem(run: &InjectedRun, is_test: bool) -> Option<String> {
    let wanted = if is_test { ALL_HELD } else { 0 };
    if !run.violated.is_empty() {
        return Some(run.violated.join("; "));
    }
    if run.is_endless {
        return Some(format!(
            "it has not ended after {:.0} s and {} ticks; without its end there is nothing to compare",
            run.seconds, run.ticks
        ));
    }
    match run.ended {
        Ended::Normally(status) if status == wanted => None,
        Ended::Normally(ONE_DID_NOT_HOLD) if is_test => Some("a check did not hold".into()),
        Ended::Normally(NO_CHECK) if is_test => Some(WITHOUT_CHECK.into()),
        Ended::Normally(status) => Some(format!("it ends with the status {status}")),
        Ended::Deadlocked => Some(format!("deadlock: {}", waits(&run.errors))),
        Ended::BudgetSpent => Some("its budget of ticks is spent".into()),
        Ended::HeapExhausted => Some("its memory is exhausted".into()),
        Ended::Failed | Ended::Signalled(_) => Some(reason(&run.errors)),
    }
}

/// Returns the lines of a deadlock report, joined.
fn waits(errors: &str) -> String {
    let lines: Vec<&str> = errors
        .lines()
        .skip_while(|line| !line.starts_with("Deadlock:"))
        .skip(1)
        .take_while(|line| line.starts_with(' '))
        .map(str::trim)
        .collect();
    lines.join("; ")
}

/// Report of a failure that has ended a task.
struct EndedTaskReport {
    /// Name of the task in reports; `None` for the main task.
    task: Option<String>,
    /// Text of the failure, on one line.
    message: String,
    cause: String,
}

/// End of a report after the cause.
const UNHANDLED: &str = ", no recovery available.";

/// Returns the reports of failures in the text of a run's errors.
fn failure_reports(errors: &str) -> Vec<EndedTaskReport> {
    let mut reports = Vec::new();
    let (mut task, mut message, mut is_said, mut failing) = (None, Vec::new(), false, None);
    for line in errors.lines() {
        let begun = line.strip_prefix("In ").and_then(|rest| rest.split_once(", begun at "));
        if let (Some((name, _)), true) = (begun, line.ends_with(':')) {
            (task, message, is_said) = (Some(name.to_string()), Vec::new(), false);
        } else if failing.is_some() || line.starts_with("Failure ") {
            // A cause may have several lines.
            let cause = failing.take().map_or_else(|| line.to_string(), |cause| format!("{cause} {line}"));
            match cause.strip_prefix("Failure ").and_then(|cause| cause.strip_suffix(UNHANDLED)) {
                Some(cause) => {
                    let (message, cause) = (std::mem::take(&mut message).join(" "), cause.to_lowercase());
                    reports.push(EndedTaskReport { task: task.take(), message, cause });
                    is_said = false;
                }
                None => failing = Some(cause),
            }
        } else if line.starts_with("  in ") {
            is_said = true;
        } else if line.starts_with("A failure") || line == "Aborted" {
            message = if line == "Aborted" { Vec::new() } else { vec![line] };
        } else if !is_said {
            message.push(line);
        }
    }
    reports
}

/// Returns texts about the tasks that failures have ended, beyond those of the undisturbed run.
fn failed_tasks(run: &InjectedRun, undisturbed: &InjectedRun) -> Vec<String> {
    let texts = |run: &InjectedRun| -> Vec<String> {
        let reports = failure_reports(&run.errors).into_iter();
        reports.filter_map(|report| Some(format!("{} ended by {}", report.task?, report.cause))).collect()
    };
    let known = texts(undisturbed);
    let mut new: Vec<String> = Vec::new();
    for text in texts(run) {
        if !known.contains(&text) && !new.contains(&text) {
            new.push(text);
        }
    }
    new
}

/// Returns the text of the failure that has ended a run.
fn reason(errors: &str) -> String {
    let reports = failure_reports(errors);
    match reports.iter().find(|report| report.task.is_none()) {
        Some(report) if !report.message.is_empty() => report.message.clone(),
        _ => errors.lines().next().unwrap_or("aborted").to_string(),
    }
}

/// Most differences that are shown.
const MOST_DIFFERENCES: usize = 4;

/// Returns the differences of two results, in a few words. The output of a program with facts is a log, which
/// tells of the fault and its times.
fn differences(run: &InjectedRun, undisturbed: &InjectedRun) -> String {
    let lost = undisturbed.facts.difference(&run.facts).map(|fact| format!("not {}", fact.to_lowercase()));
    let new = run.facts.difference(&undisturbed.facts).map(|fact| fact.to_lowercase());
    let all: Vec<String> = new.chain(lost).collect();
    let mut shown: Vec<String> = all.iter().take(MOST_DIFFERENCES).cloned().collect();
    if all.len() > shown.len() {
        shown.push(format!("{} more facts", all.len() - shown.len()));
    }
    if undisturbed.facts.is_empty() && run.output != undisturbed.output {
        shown.push("other output".into());
    }
    shown.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reports_are_told_apart() {
        let errors = "In task \"W\", begun at a.esl:5:22:\nA failure of cause :STUCK.\n  in (SPAWN), a.esl:5:22\n\
                      Failure :STUCK, no recovery available.\nAborted\ntwo\nlines\n  in top level, a.esl:7:1\n\
                      Failure :|a\nb|, no recovery available.\nAborted\n";
        let reports = failure_reports(errors);
        let [first, second] = &reports[..] else { panic!("there are two") };
        assert_eq!((first.task.as_deref(), first.cause.as_str()), (Some("task \"W\""), ":stuck"));
        assert_eq!((second.task.as_deref(), second.message.as_str()), (None, "two lines"));
        assert_eq!(second.cause, ":|a b|");
        assert_eq!(reason(errors), "two lines");
    }
}
