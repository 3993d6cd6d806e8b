//! Calls that the end of a process has interrupted, and other remains of it in the records.

use std::collections::HashSet;

use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;
use esl_host::{
    ActionId, HostCall, HostError, HostFailure, Incoming, News, NotedRecord, Record, has_gone_object,
};
use esl_replay::{JournalLife, OpenCall};

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

/// Returns the message by which the program is told that it goes on in another process.
pub(crate) fn resumed_message(life: &JournalLife, downtime: f64) -> Incoming {
    let number = i64::try_from(life.number).unwrap_or(i64::MAX);
    let arguments = vec![
        Datum::new(DatumKind::Float(downtime), Span::default()),
        Datum::integer(number, Span::default()),
    ];
    Incoming::Message { input: "*RESUMED*".into(), arguments }
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

/// Returns the greatest number of a question in these records and before them.
pub(crate) fn last_question(records: &[NotedRecord], before: u64) -> u64 {
    let arrivals = records.iter().filter_map(|noted| match &noted.record {
        Record::Received((_, contents)) => Some(contents),
        _ => None,
    });
    let numbers = arrivals.flatten().filter_map(|incoming| match incoming {
        Incoming::Question { number, .. } => Some(*number),
        _ => None,
    });
    numbers.max().unwrap_or(0).max(before)
}

/// Returns how many senders of the inbox there are after these records, if there were `before`.
pub(crate) fn senders(records: &[NotedRecord], before: usize) -> usize {
    let arrivals = records.iter().filter_map(|noted| match &noted.record {
        Record::Received((_, contents)) => Some(contents),
        _ => None,
    });
    arrivals.flatten().fold(before, |count: usize, incoming| match incoming {
        Incoming::SenderCame => count + 1,
        Incoming::SenderLeft => count.saturating_sub(1),
        _ => count,
    })
}

/// Returns the news of a call that was interrupted, or that has an object of an earlier process.
pub(crate) fn after_restart(call: HostCall<'_>, action: Option<ActionId>) -> News {
    if call.effect.is_done_by_restart() {
        return News::Completed(vec![Datum::nil(Span::default())]);
    }
    News::Failed(interrupted(call, action))
}

/// Returns a call that is under way.
pub(crate) fn open_call(call: HostCall<'_>, number: u64, action: ActionId) -> OpenCall {
    let HostCall { name, arguments, effect, operation: _ } = call;
    OpenCall { number, name: name.into(), arguments: arguments.to_vec(), effect, action }
}

/// Returns the news of a call that the end of its process has interrupted; `None` if it is begun again. It
/// may have saved a state.
pub(crate) fn news_of(open: &OpenCall, has_saved: bool) -> Option<News> {
    if is_repeated(open, has_saved) {
        return None;
    }
    let OpenCall { number, name, arguments, effect, action } = open;
    let call = HostCall { name, arguments, effect: *effect, operation: Some(*number) };
    Some(after_restart(call, Some(*action)))
}

/// Returns whether a call that the end of its process has interrupted is begun again: by its effect, or by
/// the state that it has saved.
pub(crate) fn is_repeated(open: &OpenCall, has_saved: bool) -> bool {
    (has_saved || open.effect.may_be_repeated()) && !has_gone_object(&open.arguments)
}
