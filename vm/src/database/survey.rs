//! Surveys of the database: relations, and facts as texts.

use esl_host::RelationRow;

use super::{Database, Term};
use crate::describe::describe;
use crate::heap::Heap;

/// Most characters of the text of a fact.
const CHARACTERS: usize = 500;
/// Most relations that are told of.
const RELATIONS: usize = 2000;

impl Database {
    /// Returns the number of facts.
    pub(crate) fn fact_count(&self) -> usize {
        self.facts()
    }

    /// Returns the relations that have facts, and the properties, by name.
    pub(crate) fn relation_rows(&self, heap: &Heap) -> Vec<RelationRow> {
        let relations = self.relations.iter().filter(|one| one.count() > 0 || one.is_property());
        let mut rows: Vec<RelationRow> = relations
            .take(RELATIONS)
            .map(|relation| RelationRow {
                name: self.name(heap, relation.functor),
                width: relation.width,
                facts: relation.count(),
                is_property: relation.is_property(),
            })
            .collect();
        rows.sort_by(|a, b| (&a.name, a.width).cmp(&(&b.name, b.width)));
        rows
    }

    /// Returns the texts of facts, those of relations with this name, or of all if it is empty: at most so
    /// many, after the first `from`.
    pub(crate) fn fact_texts(&self, heap: &Heap, name: &str, from: usize, most: usize) -> Vec<String> {
        let mut left = from;
        let mut texts = Vec::new();
        for relation in &self.relations {
            if relation.count() == 0 || !name.is_empty() && self.name(heap, relation.functor) != name {
                continue;
            }
            if left >= relation.count() {
                left -= relation.count();
                continue;
            }
            for row in relation.live_rows().skip(std::mem::take(&mut left)) {
                if texts.len() == most {
                    return texts;
                }
                let mut text = format!("({}", self.name(heap, relation.functor));
                for &term in relation.row(row) {
                    text.push(' ');
                    self.terms.write(heap, term, CHARACTERS, &mut text);
                }
                text.push(')');
                texts.push(text);
            }
        }
        texts
    }

    fn name(&self, heap: &Heap, functor: Term) -> String {
        functor.as_atom().map_or("?".into(), |value| describe(heap, value))
    }
}
