//! Information about functions beside their code: lambda list, documentation, and places in the source.
//!
//! The `debug` slot of a Code is a Record of four slots: lambda list, documentation, names of the sources (a
//! simple vector, shared by the functions of a module), and the places: words, four for each entry.

use esl_bytecode::compile::SourcePlace;
use esl_bytecode::module::{LineEntry, ModuleFunction, PoolIdx};

use crate::heap::{AllocError, Heap, Kind};
use crate::value::Value;

const LAMBDA_LIST: usize = 0;
const DOCUMENTATION: usize = 1;
const SOURCES: usize = 2;
const PLACES: usize = 3;

/// Value of `aux` that distinguishes this record from the machine's other records.
pub(crate) const DEBUG_RECORD: u16 = 1;

/// Makes a simple vector of the names of sources.
pub(super) fn sources(heap: &mut Heap, sources: &[String]) -> Result<Value, AllocError> {
    let mut names = Vec::with_capacity(sources.len());
    for source in sources {
        names.push(heap.alloc_str(source)?);
    }
    heap.alloc_vector(&names)
}

/// Makes the record of a function of a module with this pool.
pub(super) fn describe(
    heap: &mut Heap,
    function: &ModuleFunction,
    pool: &[Value],
    sources: Value,
) -> Result<Value, AllocError> {
    let constant = |index: Option<PoolIdx>| index.map_or(Value::NIL, |PoolIdx(index)| pool[index as usize]);
    let places = heap.alloc_words(function.lines.len() * 4, 0)?;
    if let Some(words) = heap.words_mut(places) {
        for (words, entry) in words.chunks_exact_mut(4).zip(&function.lines) {
            words.copy_from_slice(&[entry.pc, entry.source, entry.line, entry.column]);
        }
    }
    let mut slots = [Value::NIL; 4];
    slots[LAMBDA_LIST] = constant(function.lambda_list);
    slots[DOCUMENTATION] = constant(function.documentation);
    slots[SOURCES] = sources;
    slots[PLACES] = places;
    heap.alloc_record(Kind::Record, 0, DEBUG_RECORD, &slots)
}

/// Returns the source place of word `pc` of a code, from its debug record.
pub(super) fn place_of(heap: &Heap, debug: Value, pc: u32) -> Option<SourcePlace> {
    let record = heap.record(debug, Kind::Record)?;
    let words = heap.words(record[PLACES])?;
    let entries = words.chunks_exact(4).map(|words| LineEntry {
        pc: words[0],
        source: words[1],
        line: words[2],
        column: words[3],
    });
    let entry = entry_at(entries, pc)?;
    let name = *heap.vector(record[SOURCES])?.get(entry.source as usize)?;
    Some(SourcePlace { source: heap.string_text(name)?, line: entry.line, column: entry.column })
}

/// Returns the last entry that begins at or before `pc`.
pub(super) fn entry_at(entries: impl Iterator<Item = LineEntry>, pc: u32) -> Option<LineEntry> {
    entries.take_while(|entry| entry.pc <= pc).last()
}

/// Returns lambda list and documentation, from a debug record.
pub(super) fn texts(heap: &Heap, debug: Value) -> Option<(Value, Value)> {
    let record = heap.record(debug, Kind::Record)?;
    Some((record[LAMBDA_LIST], record[DOCUMENTATION]))
}
