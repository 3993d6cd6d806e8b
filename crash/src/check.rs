//! Counts of all runs, and the comparison of a killed run with one that was not.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::time::Duration;

use super::subject::KillMode;

/// A run that has ended.
#[derive(Clone, Debug)]
pub(crate) struct EndedRun {
    pub(crate) status: Option<i32>,
    pub(crate) kills: u64,
    pub(crate) output: String,
    pub(crate) errors: String,
    /// The report of the device.
    pub(crate) report: String,
}

/// Counts of all runs.
#[derive(Debug, Default)]
pub(crate) struct Counts {
    pub(crate) programs: u64,
    pub(crate) runs: u64,
    pub(crate) kills: u64,
    kills_at_places: u64,
    actions: u64,
    reads: u64,
    reads_repeated: u64,
    unknown: u64,
    unknown_performed: u64,
    resumed: u64,
    lines_repeated: u64,
    // The counts from here on must be 0.
    performed_twice: u64,
    calls_twice: u64,
    lost: u64,
    unreported: u64,
    lines_missing: u64,
    lines_foreign: u64,
    facts_other: u64,
    statuses_other: u64,
}

impl Counts {
    pub(crate) fn note_kill(&mut self, mode: KillMode) {
        self.kills += 1;
        self.kills_at_places += u64::from(matches!(mode, KillMode::AtPlace(_)));
    }

    /// Returns the number of violations.
    pub(crate) fn bad(&self) -> u64 {
        self.performed_twice
            + self.calls_twice
            + self.lost
            + self.unreported
            + self.lines_missing
            + self.lines_foreign
            + self.facts_other
            + self.statuses_other
    }

    /// Returns a report.
    pub(crate) fn report(&self, time: Duration) -> String {
        let mut text = String::new();
        let mut line = |what: &str, count: u64| {
            // A write to a text cannot fail.
            _ = writeln!(text, "{count:>8}  {what}");
        };
        line("programs", self.programs);
        line("runs that were killed and went on to their end", self.runs);
        line("kills", self.kills);
        line("of them before or behind a call of the journal", self.kills_at_places);
        line("resumptions that the programs have heard of", self.resumed);
        line("actions of the device", self.actions);
        line("calls reported as unknown", self.unknown);
        line("of them performed", self.unknown_performed);
        line("readings, which may be repeated", self.reads);
        line("of them repeated", self.reads_repeated);
        line("lines that were printed again", self.lines_repeated);
        line("BAD: actions performed twice", self.performed_twice);
        line("BAD: calls of one identity performed twice", self.calls_twice);
        line("BAD: actions reported as done and not performed", self.lost);
        line("BAD: actions performed and neither done nor reported as unknown", self.unreported);
        line("BAD: lines missing", self.lines_missing);
        line("BAD: lines that no run without a kill prints", self.lines_foreign);
        line("BAD: facts other than those of a run without a kill", self.facts_other);
        line("BAD: statuses other than 0", self.statuses_other);
        _ = write!(text, "{:>8.1}  seconds", time.as_secs_f64());
        text
    }
}

/// Returns the counts of one kind in the report of the device.
fn counts_of(report: &str, kind: &str) -> BTreeMap<String, u64> {
    let rows = report.lines().filter_map(|line| {
        let mut words = line.split(' ');
        let (of, name, count) = (words.next()?, words.next()?, words.next()?);
        (of == kind).then(|| Some((name.to_owned(), count.parse().ok()?)))?
    });
    rows.collect()
}

/// Returns the lines of a program that begin with a word, without that.
fn lines_of<'a>(output: &'a str, word: &str) -> Vec<&'a str> {
    output.lines().filter_map(|line| line.strip_prefix(word)).collect()
}

/// Compares a run that was killed with one that was not. Returns the violations, in words.
pub(crate) fn compare(alone: &EndedRun, killed: &EndedRun, counts: &mut Counts) -> Vec<String> {
    let mut problems = Vec::new();
    let mut bad = |count: &mut u64, problem: String| {
        *count += 1;
        problems.push(problem);
    };
    if killed.status != Some(0) || alone.status != Some(0) {
        let said = format!("{}{}", alone.errors, killed.errors);
        let last: Vec<&str> = said.lines().rev().take(3).collect();
        bad(
            &mut counts.statuses_other,
            format!("status {:?} alone, {:?} killed: {last:?}", alone.status, killed.status),
        );
    }
    let performed = counts_of(&killed.report, "performed");
    let read = counts_of(&killed.report, "read");
    counts.actions += performed.values().sum::<u64>();
    counts.reads += read.values().sum::<u64>();
    counts.reads_repeated += read.values().map(|count| count - 1).sum::<u64>();
    for (name, count) in performed.iter().filter(|(_, count)| **count > 1) {
        bad(&mut counts.performed_twice, format!("action {name} was performed {count} times"));
    }
    for (call, count) in counts_of(&killed.report, "call").iter().filter(|(_, count)| **count > 1) {
        bad(&mut counts.calls_twice, format!("call {call} was performed {count} times"));
    }
    let facts: BTreeSet<&str> = lines_of(&killed.output, "fact ").into_iter().collect();
    let unknown: BTreeSet<&str> = lines_of(&killed.output, "unknown ").into_iter().collect();
    counts.unknown += unknown.len() as u64;
    counts.unknown_performed += unknown.iter().filter(|name| performed.contains_key(**name)).count() as u64;
    for fact in lines_of(&alone.output, "fact ") {
        // Of some actions a program may note that it is unknown whether they were performed.
        let as_unknown = fact.replace("DONE", "UNKNOWN");
        let is_known = facts.contains(fact) || (fact.contains("DONE") && facts.contains(as_unknown.as_str()));
        if !is_known {
            bad(&mut counts.facts_other, format!("a fact is missing: {fact}"));
        }
    }
    for name in counts_of(&alone.report, "performed").keys() {
        let is_unknown =
            facts.iter().any(|fact| fact.contains(&format!(" {name})")) && fact.contains("UNKNOWN"));
        match (performed.contains_key(name), is_unknown) {
            (false, false) => bad(&mut counts.lost, format!("action {name} is done, and was not performed")),
            (true, true) if !unknown.contains(name.as_str()) => {
                bad(&mut counts.unreported, format!("action {name} was not reported as unknown"));
            }
            _ => {}
        }
    }
    let is_extra = |line: &str| line.starts_with("unknown ") || line.starts_with("resumed ");
    counts.resumed += lines_of(&killed.output, "resumed ").iter().collect::<BTreeSet<_>>().len() as u64;
    let expected: BTreeSet<&str> = alone.output.lines().collect();
    let found: BTreeSet<&str> = killed.output.lines().collect();
    counts.lines_repeated += (killed.output.lines().count() - found.len()) as u64;
    for line in expected.iter().filter(|line| !line.starts_with("fact ") && !found.contains(*line)) {
        bad(&mut counts.lines_missing, format!("a line is missing: {line}"));
    }
    let foreign = |line: &&&str| !expected.contains(**line) && !is_extra(line) && !line.contains("UNKNOWN");
    for line in found.iter().filter(foreign) {
        bad(&mut counts.lines_foreign, format!("a line is from nowhere: {line}"));
    }
    problems
}
