//! Information about functions beside their code: lambda list, documentation, and places in the source.
//!
//! The `debug` slot of a Code is a Record of four slots: lambda list, documentation, the names of a module (a
//! pair of two simple vectors that its functions share: names of sources, names of variables), and words: the
//! number of places, four words for each place, two for each variable.

use std::collections::HashMap;
use std::sync::Arc;

use esl_bytecode::compile::{SourcePlace, Work};
use esl_bytecode::module::{LineEntry, Module, ModuleFunction, PoolIdx, VariablePlace};

use crate::heap::{AllocError, Heap, Kind};
use crate::value::Value;

const LAMBDA_LIST: usize = 0;
const DOCUMENTATION: usize = 1;
const NAMES: usize = 2;
const WORDS: usize = 3;

/// Value of `aux` that distinguishes this record from the machine's other records.
pub(crate) const DEBUG_RECORD: u16 = 1;

/// Bits of a word of a variable for its place: a register or capture, and which of the two. The rest is the
/// number of its name.
const PLACE_BITS: u32 = 9;
/// Names of variables that a module may have; others are left out.
const MAX_NAMES: usize = 1 << (32 - PLACE_BITS);

/// The names of a module, and the numbers of those of its variables.
#[derive(Default)]
pub(super) struct ModuleNames {
    sources: Vec<Value>,
    variables: Vec<Value>,
    numbers: HashMap<Arc<str>, u32>,
    /// Number of functions whose variables have numbers.
    passed: usize,
    /// The pair of both, when all are known.
    pair: Option<Value>,
}

/// Names that count as a unit of work.
const NAMES_PER_UNIT: usize = 8;

impl ModuleNames {
    /// Calls `visit` with every object that it keeps alive.
    pub(super) fn roots(&self, visit: &mut dyn FnMut(Value)) {
        let lists = [&self.sources, &self.variables];
        lists.into_iter().flatten().chain(&self.pair).for_each(|&value| visit(value));
    }

    /// Goes on making the names of a module. Returns whether all are made; otherwise the work that is allowed
    /// is done.
    pub(super) fn run(
        &mut self,
        heap: &mut Heap,
        module: &Module,
        work: &mut Work,
    ) -> Result<bool, AllocError> {
        if self.pair.is_some() {
            return Ok(true);
        }
        while let Some(source) = module.sources.get(self.sources.len()) {
            let name = heap.alloc_str(source)?;
            self.sources.push(name);
        }
        while let Some(function) = module.functions.get(self.passed) {
            if work.is_done() {
                return Ok(false);
            }
            for variable in &function.variables {
                if !self.numbers.contains_key(&variable.name) && self.variables.len() < MAX_NAMES {
                    let name = heap.alloc_str(&variable.name)?;
                    self.numbers.insert(variable.name.clone(), self.variables.len() as u32);
                    self.variables.push(name);
                }
            }
            work.add((1 + function.variables.len() / NAMES_PER_UNIT) as u64);
            self.passed += 1;
        }
        let sources = heap.alloc_vector(&self.sources)?;
        let variables = heap.alloc_vector(&self.variables)?;
        self.pair = Some(heap.cons(sources, variables)?);
        Ok(true)
    }
}

/// Makes the record of a function of a module with this pool and these names.
pub(super) fn describe(
    heap: &mut Heap,
    function: &ModuleFunction,
    pool: &[Value],
    names: &ModuleNames,
) -> Result<Value, AllocError> {
    let constant = |index: Option<PoolIdx>| index.map_or(Value::NIL, |PoolIdx(index)| pool[index as usize]);
    let mut words = Vec::with_capacity(1 + function.lines.len() * 4 + function.variables.len() * 2);
    words.push(function.lines.len() as u32);
    for LineEntry { pc, source, line, column } in &function.lines {
        words.extend([pc, source, line, column]);
    }
    for variable in &function.variables {
        let Some(name) = names.numbers.get(&variable.name) else { continue };
        let place = match variable.place {
            VariablePlace::Register(register) => u32::from(register) << 1,
            VariablePlace::Capture(capture) => u32::from(capture) << 1 | 1,
        };
        // Code has fewer words than 16 bits can count.
        words.extend([variable.from | variable.to << 16, place | name << PLACE_BITS]);
    }
    let object = heap.alloc_words(words.len(), 0)?;
    if let Some(room) = heap.words_mut(object) {
        room.copy_from_slice(&words);
    }
    let mut slots = [Value::NIL; 4];
    slots[LAMBDA_LIST] = constant(function.lambda_list);
    slots[DOCUMENTATION] = constant(function.documentation);
    slots[NAMES] = names.pair.unwrap_or(Value::NIL);
    slots[WORDS] = object;
    heap.alloc_record(Kind::Record, 0, DEBUG_RECORD, &slots)
}

/// The tables of a debug record.
struct DebugTables<'a> {
    /// Four words for each source place.
    places: &'a [u32],
    /// Two words for each variable.
    variables: &'a [u32],
    /// Names of sources.
    sources: &'a [Value],
    /// Names of variables.
    names: &'a [Value],
}

/// Returns the tables of a debug record.
fn tables_of(heap: &Heap, debug: Value) -> Option<DebugTables<'_>> {
    let record = heap.record(debug, Kind::Record)?;
    let (count, words) = heap.words(record[WORDS])?.split_first()?;
    let (places, variables) = words.split_at_checked(*count as usize * 4)?;
    let names = heap.as_cons(record[NAMES])?;
    let (sources, names) = (heap.vector(names.car)?, heap.vector(names.cdr)?);
    Some(DebugTables { places, variables, sources, names })
}

/// Returns the source place of word `pc` of a code, from its debug record.
pub(super) fn place_of(heap: &Heap, debug: Value, pc: u32) -> Option<SourcePlace> {
    let DebugTables { places, sources, .. } = tables_of(heap, debug)?;
    let entries = places.chunks_exact(4).map(|words| LineEntry {
        pc: words[0],
        source: words[1],
        line: words[2],
        column: words[3],
    });
    let entry = entry_at(entries, pc)?;
    let name = *sources.get(entry.source as usize)?;
    Some(SourcePlace { source: heap.string_text(name)?, line: entry.line, column: entry.column })
}

/// Returns the variables that can be looked at at word `pc` of a code, from its debug record.
pub(super) fn variables_at(heap: &Heap, debug: Value, pc: u32) -> Vec<(String, VariablePlace)> {
    let Some(DebugTables { variables, names, .. }) = tables_of(heap, debug) else { return Vec::new() };
    let here = variables.chunks_exact(2).filter(|words| (words[0] & 0xFFFF..words[0] >> 16).contains(&pc));
    let row = |words: &[u32]| {
        let name = heap.string_text(*names.get((words[1] >> PLACE_BITS) as usize)?)?;
        let number = (words[1] >> 1) as u8;
        let is_capture = words[1] & 1 != 0;
        let place = if is_capture { VariablePlace::Capture(number) } else { VariablePlace::Register(number) };
        Some((name, place))
    };
    here.filter_map(row).collect()
}

/// Returns the last entry that begins at or before `pc`.
pub(super) fn entry_at(entries: impl Iterator<Item = LineEntry>, pc: u32) -> Option<LineEntry> {
    entries.take_while(|entry| entry.pc <= pc).last()
}

/// Returns lambda list and documentation, from a debug record.
pub(crate) fn texts(heap: &Heap, debug: Value) -> Option<(Value, Value)> {
    let record = heap.record(debug, Kind::Record)?;
    Some((record[LAMBDA_LIST], record[DOCUMENTATION]))
}
