//! The possible failures of the open texts, as the analysis has found them: put here by the thread of
//! diagnostics, read by answers.
//!
//! An answer may come while the text has changed already. The places of the analysed text before the first
//! and behind the last changed byte are known then, those between are not.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use esl_analysis::FailureTable;

/// The findings about one text.
#[derive(Debug)]
pub(super) struct InferredText {
    /// Name of the text in the places of the table.
    source: String,
    /// The analysed text.
    text: String,
    pub(super) table: FailureTable,
}

impl InferredText {
    pub(super) fn new(source: String, text: String, table: FailureTable) -> InferredText {
        InferredText { source, text, table }
    }

    /// Whether a place of the table is in the text, not in a module.
    pub(super) fn is_here(&self, source: &str) -> bool {
        self.source == source
    }

    /// Returns the places of the analysed text in a later version.
    pub(super) fn moved_to(&self, now: &str) -> MovedPlaces {
        let (old, new) = (self.text.as_bytes(), now.as_bytes());
        let prefix = old.iter().zip(new).take_while(|(old, new)| old == new).count();
        let (old_rest, new_rest) = (&old[prefix..], &new[prefix..]);
        let suffix =
            old_rest.iter().rev().zip(new_rest.iter().rev()).take_while(|(old, new)| old == new).count();
        MovedPlaces { prefix, old_suffix: old.len() - suffix, new_suffix: new.len() - suffix }
    }
}

/// The places of a text after a change.
#[derive(Clone, Copy, Debug)]
pub(super) struct MovedPlaces {
    /// Bytes before the change.
    prefix: usize,
    /// Beginnings of the bytes behind the change, in the old text and in the new one.
    old_suffix: usize,
    new_suffix: usize,
}

impl MovedPlaces {
    /// Returns the place of a byte of the old text; `None` if the change is there.
    pub(super) fn place(self, offset: u32) -> Option<usize> {
        let offset = offset as usize;
        match offset {
            _ if offset < self.prefix || offset == self.prefix && self.prefix == self.old_suffix => {
                Some(offset)
            }
            _ if offset >= self.old_suffix => Some(offset - self.old_suffix + self.new_suffix),
            _ => None,
        }
    }
}

/// The findings about all open texts, by their URIs.
#[derive(Clone, Debug, Default)]
pub(super) struct InferredTexts(Arc<Mutex<HashMap<String, Arc<InferredText>>>>);

impl InferredTexts {
    fn locked(&self) -> MutexGuard<'_, HashMap<String, Arc<InferredText>>> {
        // Each entry is replaced as a whole, so a panic elsewhere does not corrupt the map.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn get(&self, uri: &str) -> Option<Arc<InferredText>> {
        self.locked().get(uri).cloned()
    }

    pub(super) fn put(&self, uri: &str, found: InferredText) {
        self.locked().insert(uri.to_owned(), Arc::new(found));
    }

    pub(super) fn forget(&self, uri: &str) {
        self.locked().remove(uri);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_around_a_change_are_known() {
        let found = InferredText::new("a".into(), "(one) (two) (three)".into(), FailureTable::default());
        let moved = found.moved_to("(one) (second) (three)");
        let places = [0, 6, 7, 9, 12].map(|offset| moved.place(offset));
        assert_eq!(places, [Some(0), Some(6), None, None, Some(15)]);
        let same = found.moved_to("(one) (two) (three)");
        assert_eq!([0, 6, 12].map(|offset| same.place(offset)), [Some(0), Some(6), Some(12)]);
        assert_eq!(found.moved_to("").place(0), None);
    }
}
