//! Faults: which call of which operation is disturbed, and how.

use std::fmt;

use esl_analysis::shown_cause;
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;

use super::run::{InjectedRun, NotedCall};
use super::{InjectSettings, KnownFailures};

/// Way in which a call is disturbed.
#[derive(Clone, Debug)]
pub enum FaultWay {
    /// It fails with a cause and arguments.
    Fails {
        /// Cause.
        cause: Symbol,
        /// Arguments.
        arguments: Vec<Datum>,
    },
    /// It never answers: it ends only by cancellation.
    Never,
    /// It answers so many seconds later.
    Late(f64),
    /// The calling task is aborted as soon as the operation has begun.
    Aborted,
}

impl FaultWay {
    /// Returns the cause as a program has it, or a word.
    pub fn name(&self) -> String {
        match self {
            FaultWay::Fails { cause, .. } => shown_cause(cause),
            FaultWay::Never => "never".into(),
            FaultWay::Late(_) => "late".into(),
            FaultWay::Aborted => "aborted".into(),
        }
    }

    /// Returns the end of a row's name. A cause with the name of a word has two colons.
    fn ending(&self) -> String {
        let name = self.name();
        let plain = name.strip_prefix(':').unwrap_or(&name);
        let is_cause = matches!(self, FaultWay::Fails { .. });
        let colons = if is_cause && ["never", "late", "aborted"].contains(&plain) { "::" } else { ":" };
        on_one_line(&format!("{colons}{plain}"))
    }
}

/// A fault that is injected into a run.
#[derive(Clone, Debug)]
pub struct InjectedFault {
    /// Name of the operation.
    pub operation: Symbol,
    /// Number of the call among those of this operation, from 1.
    pub call: u64,
    /// Whether all later calls of the operation are disturbed, too.
    pub lasts: bool,
    /// Way.
    pub way: FaultWay,
}

/// Returns the name of an operation as a program has it.
pub(super) fn shown_operation(operation: &Symbol) -> String {
    on_one_line(&shown_cause(operation))
}

/// Returns the name of an operation in lower case, as tables of failures have it.
pub(super) fn operation_name(operation: &Symbol) -> String {
    operation.name().to_lowercase()
}

/// Returns a text with blanks in the place of other white space and of control characters.
pub(super) fn on_one_line(text: &str) -> String {
    text.replace(|c: char| c.is_control() || c.is_whitespace(), " ")
}

impl fmt::Display for InjectedFault {
    /// Writes the name by which the fault can be injected again, such as `slew#3:wheel-stuck`;
    /// `slew#3+:never` if it lasts.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let lasts = if self.lasts { "+" } else { "" };
        write!(f, "{}#{}{lasts}{}", shown_operation(&self.operation), self.call, self.way.ending())
    }
}

/// Returns the first that is called `name`, or, if there is none, so in any case.
fn find_named<T>(items: &[T], name: &str, shown: impl Fn(&T) -> String) -> Option<usize> {
    let is_like = |item: &T| shown(item).to_lowercase() == name.to_lowercase();
    items.iter().position(|item| shown(item) == name).or_else(|| items.iter().position(is_like))
}

impl InjectedFault {
    /// Returns the fault of this name: one of `all`, or one like them of a call that only a disturbed run
    /// makes.
    pub(super) fn named(name: &str, all: &[InjectedFault], ways: &FailureWays) -> Option<InjectedFault> {
        let name = on_one_line(name);
        // Names of operations and causes may have these signs, too.
        name.match_indices('#').find_map(|(place, _)| {
            let (operation, rest) = (&name[..place], &name[place + 1..]);
            let digits = rest.find(|c: char| !c.is_ascii_digit())?;
            let call = rest[..digits].parse().ok()?;
            let (lasts, way) = match rest[digits..].strip_prefix('+') {
                Some(way) => (true, way),
                None => (false, &rest[digits..]),
            };
            let operation = ways.symbol_of(operation, all)?;
            let delay = all.iter().find(|fault| {
                fault.operation == operation && fault.call == call && matches!(fault.way, FaultWay::Late(_))
            });
            let late = delay.map_or(FaultWay::Late(LEAST_DELAY), |fault| fault.way.clone());
            let mut known: Vec<FaultWay> = ways.failing(&operation).collect();
            known.extend([FaultWay::Never, late, FaultWay::Aborted]);
            let place = find_named(&known, way, FaultWay::ending)?;
            Some(InjectedFault { operation, call, lasts, way: known.swap_remove(place) })
        })
    }

    /// Returns the fault as the library takes it.
    pub(super) fn datum(&self) -> Datum {
        let span = Span::default();
        let (way, what) = match &self.way {
            FaultWay::Fails { cause, arguments } => {
                let cause = Datum::symbol(cause.clone(), span);
                let items: Vec<Datum> = [cause].into_iter().chain(arguments.iter().cloned()).collect();
                ("FAILS", Datum::list(items, span))
            }
            FaultWay::Never => ("NEVER", Datum::nil(span)),
            FaultWay::Late(seconds) => ("LATE", Datum::of_kind(DatumKind::Float(*seconds), span)),
            FaultWay::Aborted => ("ABORTED", Datum::nil(span)),
        };
        let lasts = if self.lasts { Datum::symbol(Symbol::cl("T"), span) } else { Datum::nil(span) };
        let way = Datum::symbol(Symbol::keyword(way), span);
        let call = Datum::integer(self.call, span);
        let operation = Datum::symbol(self.operation.clone(), span);
        Datum::list(vec![operation, call, lasts, way, what], span)
    }
}

/// Returns whether a value can be given to another machine.
fn is_plain(datum: &Datum) -> bool {
    match datum.kind() {
        DatumKind::Nil
        | DatumKind::Integer(_)
        | DatumKind::Ratio(..)
        | DatumKind::Float(_)
        | DatumKind::Character(_)
        | DatumKind::String(_) => true,
        DatumKind::Symbol(symbol) => symbol.package().is_some(),
        DatumKind::Cons(..) => datum.as_list().is_some_and(|items| items.into_iter().all(is_plain)),
        _ => false,
    }
}

/// Shortest delay of a late answer, in seconds.
const LEAST_DELAY: f64 = 60.0;
/// Delay of a late answer, in times that the call has taken undisturbed.
const TIMES_LATE: f64 = 10.0;

/// A cause, and arguments of failures.
type KnownFailure = (Symbol, Vec<Datum>);

/// The failures of each operation, with their arguments as far as a run has shown them.
#[derive(Default)]
pub(super) struct FailureWays {
    seen: Vec<(Symbol, Vec<KnownFailure>)>,
    known: KnownFailures,
    /// Operations that runs have called.
    called: Vec<Symbol>,
}

impl FailureWays {
    /// Adds the failures that a run shows, and those of the scripts of its worlds.
    pub(super) fn add_run(&mut self, run: &InjectedRun) {
        for (operation, failure) in &run.scripted {
            self.add(operation, failure);
        }
        self.note_operations(run);
        for call in &run.calls {
            if let Some(failure) = &call.failure {
                self.add(&call.operation, failure);
            }
        }
    }

    /// Notes the operations that a run calls.
    pub(super) fn note_operations(&mut self, run: &InjectedRun) {
        for call in &run.calls {
            if !self.called.contains(&call.operation) {
                self.called.push(call.operation.clone());
            }
        }
    }

    fn add(&mut self, operation: &Symbol, failure: &[Datum]) {
        let Some((cause, arguments)) = failure.split_first() else { return };
        let Some(cause) = cause.as_symbol() else { return };
        // A call outside of any world fails so; it is not a fault of the outside.
        if cause.name() == "NOT-IN-THIS-WORLD" {
            return;
        }
        let place = match self.seen.iter().position(|(known, _)| known == operation) {
            Some(place) => place,
            None => {
                self.seen.push((operation.clone(), Vec::new()));
                self.seen.len() - 1
            }
        };
        let ways = &mut self.seen[place].1;
        if !ways.iter().any(|(known, _)| known == cause) {
            let arguments = if arguments.iter().all(is_plain) { arguments.to_vec() } else { Vec::new() };
            ways.push((cause.clone(), arguments));
        }
    }

    /// Adds the failures that are known without a run.
    pub(super) fn add_known(&mut self, known: &KnownFailures) {
        for (operation, causes) in known {
            self.known.entry(operation.clone()).or_default().extend(causes.iter().cloned());
        }
    }

    /// Returns the operation of this name.
    fn symbol_of(&self, name: &str, all: &[InjectedFault]) -> Option<Symbol> {
        let operations: Vec<&Symbol> = all.iter().map(|fault| &fault.operation).chain(&self.called).collect();
        let place = find_named(&operations, name, |operation| shown_operation(operation))?;
        Some(operations[place].clone())
    }

    /// Returns the ways in which an operation fails.
    fn failing(&self, operation: &Symbol) -> impl Iterator<Item = FaultWay> {
        let seen = self.seen.iter().find(|(known, _)| known == operation);
        let mut failures: Vec<KnownFailure> = seen.map(|(_, ways)| ways.clone()).unwrap_or_default();
        for cause in self.known.get(&operation_name(operation)).into_iter().flatten() {
            if !failures.iter().any(|(other, _)| other == cause) {
                failures.push((cause.clone(), Vec::new()));
            }
        }
        failures.into_iter().map(|(cause, arguments)| FaultWay::Fails { cause, arguments })
    }
}

/// Returns the faults for the calls of an undisturbed run, and the number of calls that they disturb.
pub(super) fn faults(
    calls: &[NotedCall],
    ways: &FailureWays,
    settings: &InjectSettings,
) -> (Vec<InjectedFault>, usize) {
    let mut operations: Vec<(&Symbol, Vec<&NotedCall>)> = Vec::new();
    for call in calls {
        match operations.iter_mut().find(|(known, _)| **known == call.operation) {
            Some((_, calls)) => calls.push(call),
            None => operations.push((&call.operation, vec![call])),
        }
    }
    let mut faults = Vec::new();
    let mut tried = 0;
    for (operation, calls) in &operations {
        for (place, call) in spread(calls, settings.calls).into_iter().enumerate() {
            tried += 1;
            let fault = |way, lasts| InjectedFault {
                operation: call.operation.clone(),
                call: call.number,
                lasts,
                way,
            };
            for way in ways.failing(operation) {
                faults.push(fault(way.clone(), false));
                if place == 0 {
                    faults.push(fault(way, true));
                }
            }
            faults.push(fault(FaultWay::Never, false));
            if place == 0 {
                faults.push(fault(FaultWay::Never, true));
            }
            let time = call.ended.map_or(0.0, |ended| ended - call.begun);
            faults.push(fault(FaultWay::Late(LEAST_DELAY.max(time * TIMES_LATE)), false));
            faults.push(fault(FaultWay::Aborted, false));
        }
    }
    (faults, tried)
}

/// Returns at most so many items: the first, the last, and others evenly between.
fn spread<T: Copy>(items: &[T], most: usize) -> Vec<T> {
    let most = most.max(1);
    if items.len() <= most {
        return items.to_vec();
    }
    (0..most).map(|place| items[place * (items.len() - 1) / (most - 1).max(1)]).collect()
}

/// Returns pairs of faults that are injected together, at most so many, and the number of all. First come
/// those in which a remedy is disturbed: the first call of each operation that a run with one fault makes
/// beyond those of the undisturbed run, which fails or never answers. Then come those of faults that do not
/// last, in the first disturbed call of each operation, that fail or never answer.
pub(super) fn pairs(
    faults: &[InjectedFault],
    remedies: &[(InjectedFault, NotedCall)],
    ways: &FailureWays,
    most: usize,
) -> (Vec<Vec<InjectedFault>>, usize) {
    let mut of_remedies = Vec::new();
    for (fault, call) in remedies {
        for way in ways.failing(&call.operation).chain([FaultWay::Never]) {
            let second =
                InjectedFault { operation: call.operation.clone(), call: call.number, lasts: false, way };
            of_remedies.push(vec![fault.clone(), second]);
        }
    }
    let is_first = |fault: &InjectedFault| {
        let first = faults.iter().find(|other| other.operation == fault.operation);
        first.is_some_and(|first| first.call == fault.call)
    };
    let is_wanted = |fault: &&InjectedFault| {
        !fault.lasts && matches!(fault.way, FaultWay::Fails { .. } | FaultWay::Never) && is_first(fault)
    };
    let chosen: Vec<&InjectedFault> = faults.iter().filter(is_wanted).collect();
    let mut others = Vec::new();
    for (place, one) in chosen.iter().enumerate() {
        for other in &chosen[place + 1..] {
            // Two faults of one call cannot both come: the second is that of the next call.
            let is_same = one.operation == other.operation;
            let call = if is_same { other.call + 1 } else { other.call };
            others.push(vec![(*one).clone(), InjectedFault { call, ..(*other).clone() }]);
        }
    }
    let count = of_remedies.len() + others.len();
    of_remedies.truncate(most);
    let left = most - of_remedies.len();
    if left > 0 {
        of_remedies.extend(spread(&others.iter().collect::<Vec<_>>(), left).into_iter().cloned());
    }
    (of_remedies, count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_and_the_last_are_among_a_few() {
        let items: Vec<u32> = (1..=10).collect();
        assert_eq!(spread(&items, 3), [1, 5, 10]);
        assert_eq!(spread(&items, 1), [1]);
        assert_eq!(spread(&items, 10), items);
        assert!(spread(&items[..0], 3).is_empty());
    }

    #[test]
    fn a_fault_is_shown_by_its_name() {
        let operation = Symbol::new(&"ESL-USER".into(), "SLEW");
        let fault = |lasts, way| InjectedFault { operation: operation.clone(), call: 3, lasts, way };
        assert_eq!(fault(false, FaultWay::Late(9.0)).to_string(), "slew#3:late");
        let cause = Symbol::keyword("WHEEL-STUCK");
        let fails = FaultWay::Fails { cause, arguments: Vec::new() };
        assert_eq!(fault(true, fails).to_string(), "slew#3+:wheel-stuck");
        let fails = |name: &str| FaultWay::Fails { cause: Symbol::keyword(name), arguments: Vec::new() };
        assert_eq!(fault(false, fails("NEVER")).to_string(), "slew#3::never");
        assert_eq!(fault(false, fails("a\nb")).to_string(), "slew#3:|a b|");
    }
}
