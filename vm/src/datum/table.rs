//! Hash tables, which cross the border to the host as their entries.

use crate::equality::{self, KeyTest};
use crate::heap::{AllocError, Heap};
use crate::table::{KeyComparison, Table};
use crate::value::Value;

/// Returns a table of `entries`: keys, each followed by its value. Of equal keys, the last one counts.
///
/// # Errors
/// As for every allocation.
pub(super) fn value_of(heap: &mut Heap, entries: &[Value]) -> Result<Value, AllocError> {
    let test = KeyTest::Equal;
    let object = Table::make(heap, KeyComparison::Native(test), entries.len() / 2, [Value::NIL; 2])?;
    let Some(table) = Table::of(heap, object) else { return Ok(object) };
    for entry in entries.as_chunks().0 {
        let &[key, value] = entry;
        let (hash, mut work) = (equality::hash(heap, test, key), usize::MAX);
        match table.find(heap, test, key, hash, &mut work) {
            Ok(Some((known, _))) => table.set_value(heap, known, value),
            // Keys too deep to be compared here count as different.
            Ok(None) | Err(_) => table.add(heap, hash, key, value)?,
        }
    }
    Ok(object)
}

/// Returns the entries of a table that compares its keys by `eq`, `eql` or `equal`: keys, each followed by
/// its value, in the order in which they came. Other tables are not data, since no table that the host makes
/// compares keys so.
pub(super) fn entries_of(heap: &Heap, object: Value) -> Option<Vec<Value>> {
    let table = Table::of(heap, object)?;
    let KeyComparison::Native(KeyTest::Eq | KeyTest::Eql | KeyTest::Equal) = table.comparison(heap) else {
        return None;
    };
    let entries = (0..table.used(heap)).filter_map(|entry| table.entry(heap, entry));
    Some(entries.flat_map(|(key, value)| [key, value]).collect())
}
