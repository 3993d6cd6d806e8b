//! Calls that the end of a process has interrupted, and other remains of it in the records.

use std::collections::HashSet;

use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;
use esl_host::{ActionId, CallEffect, HostCall, HostError, HostFailure, Incoming, News, NotedRecord, Record};

/// Returns the failure of a call that the end of its process has interrupted.
pub(crate) fn interrupted(call: HostCall<'_>, action: Option<ActionId>) -> HostFailure {
    let name = Datum::symbol(Symbol::keyword(call.name), Span::default());
    let arguments = Datum::list(call.arguments.iter().cloned(), Span::default());
    let action = match action {
        Some(action) => Datum::string(&action.to_string(), Span::default()),
        None => Datum::nil(Span::default()),
    };
    HostFailure { cause: "INTERRUPTED-BY-RESTART".into(), arguments: vec![name, arguments, action] }
}

/// Returns the error of an effect that does not leave, since the journal cannot be written.
pub(crate) fn refused() -> HostError {
    HostError::Other("the journal cannot be written".into())
}

/// Returns the failure of such a call.
pub(crate) fn refused_call() -> HostFailure {
    HostFailure { cause: "JOURNAL-NOT-WRITTEN".into(), arguments: Vec::new() }
}

/// Returns the numbers of the operations that have ended by these records.
pub(crate) fn ended_operations(records: &[NotedRecord]) -> HashSet<u64> {
    let arrivals = records.iter().flat_map(|noted| match &noted.record {
        Record::Received((_, contents)) => contents.as_slice(),
        _ => &[],
    });
    let ended = arrivals.filter_map(|incoming| match incoming {
        Incoming::Operation { news: News::Progress(_), .. } => None,
        Incoming::Operation { number, .. } => Some(*number),
        _ => None,
    });
    ended.collect()
}

/// Returns the greatest number of a question in these records, 0 without one.
pub(crate) fn last_question(records: &[NotedRecord]) -> u64 {
    let arrivals = records.iter().filter_map(|noted| match &noted.record {
        Record::Received((_, contents)) => Some(contents),
        _ => None,
    });
    let numbers = arrivals.flatten().filter_map(|incoming| match incoming {
        Incoming::Question { number, .. } => Some(*number),
        _ => None,
    });
    numbers.max().unwrap_or(0)
}

/// Returns how many senders of the inbox there are after these records.
pub(crate) fn senders(records: &[NotedRecord]) -> usize {
    let arrivals = records.iter().filter_map(|noted| match &noted.record {
        Record::Received((_, contents)) => Some(contents),
        _ => None,
    });
    arrivals.flatten().fold(0, |count: usize, incoming| match incoming {
        Incoming::SenderCame => count + 1,
        Incoming::SenderLeft => count.saturating_sub(1),
        _ => count,
    })
}

/// Returns the news of a call that was interrupted, or that has an object of an earlier process.
pub(crate) fn after_restart(call: HostCall<'_>, action: Option<ActionId>) -> News {
    match call.effect {
        CallEffect::Closes => News::Completed(vec![Datum::nil(Span::default())]),
        _ => News::Failed(interrupted(call, action)),
    }
}
