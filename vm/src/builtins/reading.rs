//! Reading data: from a string, from a stream, and from the text of a program.
//!
//! A datum is looked for in a part of the text first, and in twice as much whenever it may go on after that.

use esl_bytecode::datum::Datum;
use esl_bytecode::diagnostic::Diagnostic;

use crate::builtins::expect::optional;
use crate::builtins::stream::{Then, more_input, skip_source, source};
use crate::builtins::symbol::text_between;
use crate::datum::Unit;
use crate::environment::{self, WrongFeature};
use crate::equality::characters_of;
use crate::raise::{Exit, Expected, Outcome, Raised};
use crate::value::Value;
use crate::vm::Vm;

/// Number of characters in which the next datum of a text is looked for at first; twice as many whenever it
/// may go on after them. So reading all data of a text takes time in proportion to its length.
const FIRST_PART: usize = 256;

/// Returns whether a diagnostic with this code says that a text ends in the middle of a datum.
fn is_unfinished(code: &str) -> bool {
    code.starts_with("unclosed-") || code.starts_with("unfinished-")
}

/// Reads a datum of `text`, which may have a name, from byte `start` on.
pub(super) fn read_datum(
    vm: &mut Vm,
    text: &str,
    start: usize,
    name: Option<&str>,
) -> Result<ReadOutcome, Exit> {
    super::package::current(vm)?;
    let variable = vm.names.known.read_base;
    if let Some(base) = vm.symbol_value(variable)
        && !matches!(base.as_index(), Some(2..=36))
    {
        return vm.exchange.raise(Raised::Variable(variable, base, Expected::Written("(INTEGER 2 36)")));
    }
    vm.names.check_room(&mut vm.heap)?;
    let read = environment::with_compiler(vm, |vm, compiler| {
        let read = compiler.read(vm, text, start);
        read.map_err(|diagnostic| ReadFault {
            text: match name {
                Some(_) => compiler.render(&diagnostic, name, text),
                None => diagnostic.sentence(),
            },
            diagnostic,
        })
    })?;
    let end = read.as_ref().map_or(text.len(), |&(_, end)| end);
    vm.exchange.charge(end.saturating_sub(start));
    match read {
        Ok((Some(datum), end)) => {
            if text.get(start..end).is_some_and(asks_for_features) {
                check_features(vm)?;
            }
            Ok(ReadOutcome::Datum(datum, end))
        }
        Ok((None, _)) => Ok(ReadOutcome::End),
        Err(fault) => Ok(ReadOutcome::Fault(fault)),
    }
}

/// Returns whether a text may ask for a feature.
fn asks_for_features(text: &str) -> bool {
    text.contains("#+") || text.contains("#-")
}

/// Fails if the value of `*features*` is not a list of symbols.
fn check_features(vm: &mut Vm) -> Result<(), Exit> {
    match vm.wrong_feature() {
        None => Ok(()),
        Some(WrongFeature::List(value)) => {
            let variable = vm.names.known.features;
            vm.exchange.raise(Raised::Variable(variable, value, Expected::Type("LIST")))
        }
        Some(WrongFeature::Item(item)) => vm.exchange.type_error(item, "SYMBOL"),
    }
}

/// Reads the first datum of `text`; `None` if what comes after the text may belong to it.
fn read_first(vm: &mut Vm, text: &str, then: Then) -> Result<Option<FirstRead>, Exit> {
    let count = |end: usize| text[..end].chars().count();
    let read = |values: [Value; 3], end: usize| FirstRead { values: Ok(values), characters: count(end) };
    Ok(Some(match read_datum(vm, text, 0, None)? {
        ReadOutcome::Datum(_, end)
            if then != Then::End && end == text.len() && !text.ends_with([')', '"']) =>
        {
            return Ok(None);
        }
        ReadOutcome::Datum(datum, end) => {
            let (object, calls) = read_object(vm, &datum)?;
            read([Value::T, object, calls], end)
        }
        // A fault at the place where the text is cut may be the beginning of a correct datum.
        ReadOutcome::Fault(fault) if then != Then::Rest && !fault.is_unfinished() => {
            // The next call reads on after the fault.
            let end = text.ceil_char_boundary((fault.diagnostic.primary.span.end as usize).max(1));
            FirstRead { values: Err(fault), characters: count(end) }
        }
        ReadOutcome::End | ReadOutcome::Fault(_) if then != Then::End => return Ok(None),
        ReadOutcome::End => read([Value::NIL; 3], text.len()),
        ReadOutcome::Fault(_) => read([vm.names.known.unfinished, Value::NIL, Value::NIL], text.len()),
    }))
}

/// The first datum or fault of a text.
struct FirstRead {
    /// Whether there is a datum, the object, and the calls in it; or the fault.
    values: Result<[Value; 3], ReadFault>,
    /// Number of characters up to its end.
    characters: usize,
}

/// Returns a datum that was read as an object, and the list of the calls in it.
pub(super) fn read_object(vm: &mut Vm, datum: &Datum) -> Result<(Value, Value), Exit> {
    let mut unit = Unit::default();
    let value = unit.value_of(&mut vm.heap, &mut vm.names, datum);
    vm.exchange.charge(unit.take_work() as usize);
    let calls = vm.heap.list(&unit.take_calls())?;
    Ok((value?, calls))
}

/// Result of reading.
pub(super) enum ReadOutcome {
    /// A datum, and the offset of the byte after it.
    Datum(Datum, usize),
    /// Nothing but white space.
    End,
    /// No datum.
    Fault(ReadFault),
}

/// Fault in a text that is read.
pub(super) struct ReadFault {
    pub(super) diagnostic: Box<Diagnostic>,
    /// The diagnostic, drawn for people; as a sentence if the text has no name.
    pub(super) text: String,
}

impl ReadFault {
    /// Returns whether the text ends in the middle of a datum.
    pub(super) fn is_unfinished(&self) -> bool {
        is_unfinished(self.diagnostic.code)
    }
}

/// The first value is `NIL` at the end of the string, and `:unfinished` if the datum goes on behind it.
pub(super) fn read_from_string(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let string = arguments[0];
    let Some(length) = characters_of(&vm.heap, string).map(<[u32]>::len) else {
        return vm.exchange.type_error(string, "STRING");
    };
    let (start, end) = vm.exchange.bounds(optional(arguments, 1), optional(arguments, 2), length)?;
    let mut part = FIRST_PART;
    loop {
        let limit = end.min(start.saturating_add(part));
        let text = text_between(&vm.heap, string, start, limit);
        let then = if limit < end { Then::Rest } else { Then::End };
        if let Some(FirstRead { values, characters }) = read_first(vm, &text, then)? {
            return match values {
                Ok([status, object, calls]) => {
                    vm.give_values(&[status, object, Value::index(start + characters), calls])
                }
                Err(fault) if optional(arguments, 3).is_true() => {
                    vm.exchange.raise(Raised::Reader(fault.text))
                }
                Err(fault) => {
                    let bytes = fault.diagnostic.primary.span.start as usize;
                    let read = text.get(..bytes).unwrap_or(&text).chars().count();
                    let before = text_between(&vm.heap, string, 0, start + read);
                    let (line, column) = line_and_column_at_end(&before);
                    let text = format!("line {line}, column {column}: {}", fault.text);
                    vm.exchange.raise(Raised::Reader(text))
                }
            };
        }
        part = part.saturating_mul(2);
    }
}

/// Returns the line and the column, from 1, of what comes after `text`.
fn line_and_column_at_end(text: &str) -> (usize, usize) {
    let line = text.rsplit('\n').next().unwrap_or_default();
    (1 + text.matches('\n').count(), 1 + line.chars().count())
}

/// Reads a datum, and takes its characters from the stream.
pub(super) fn read(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let stream = optional(arguments, 0);
    let mut part = FIRST_PART;
    loop {
        let source = source(vm, stream, part)?;
        if let Some(FirstRead { values, characters }) = read_first(vm, &source.text, source.then)? {
            skip_source(vm, stream, &source, characters);
            return match values {
                Ok(values) => vm.give_values(&values),
                Err(fault) => vm.exchange.raise(Raised::Reader(fault.text)),
            };
        }
        match source.then {
            Then::Input if source.is_console => more_input(vm)?,
            // A channel is supplied by the twin.
            Then::Input => return Err(Exit::Slowly),
            Then::Rest | Then::End => part = part.saturating_mul(2),
        }
    }
}
