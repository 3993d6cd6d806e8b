//! Surveys of the database: relations, and facts as texts.

use esl_heap::{Heap, Value};

use super::{Database, Term};

/// Most characters of the text of a fact.
const CHARACTERS: usize = 500;
/// Most relations that are told of.
const RELATIONS: usize = 2000;

/// A function that returns the text of an object, which terms are shown with.
pub type Describe = fn(&Heap, Value) -> String;

/// The contents of a term, as far as data stand for them.
#[derive(Clone, Copy, Debug)]
pub enum TermContents<'a> {
    /// A value of one word: a small number, a character or a symbol.
    Word(Value),
    /// A pair.
    Pair(Term, Term),
    /// A string.
    Text(&'a [u32]),
    /// A large integer: whether it is negative, and its limbs, the lowest first.
    Big(bool, &'a [u64]),
    /// A ratio.
    Ratio(Term, Term),
    /// A double float.
    Float(f64),
    /// Another object of the heap.
    Object(Value),
    /// One that no data stand for, such as one that is compared by its slots.
    Other,
}

/// A relation, as it is seen from outside.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RelationFigures {
    /// Name of the relation.
    pub name: String,
    /// Number of the arguments of its facts.
    pub width: usize,
    /// Number of its facts.
    pub facts: usize,
    /// Whether it is a property, with one value for the other arguments.
    pub is_property: bool,
}

impl Database {
    /// Returns the number of facts.
    #[inline]
    pub fn fact_count(&self) -> usize {
        self.facts()
    }

    /// Returns the relations that have facts, and the properties, by name.
    pub fn relation_figures(&self, heap: &Heap, describe: Describe) -> Vec<RelationFigures> {
        let relations = self.relations.iter().filter(|one| one.count() > 0 || one.is_property());
        let mut rows: Vec<RelationFigures> = relations
            .take(RELATIONS)
            .map(|relation| RelationFigures {
                name: name_of(heap, describe, relation.functor),
                width: relation.width,
                facts: relation.count(),
                is_property: relation.is_property(),
            })
            .collect();
        rows.sort_by(|a, b| (&a.name, a.width).cmp(&(&b.name, b.width)));
        rows
    }

    /// Calls `visit` with the name and the arguments of each fact.
    pub fn each_fact(&self, visit: &mut dyn FnMut(Term, &[Term])) {
        for relation in &self.relations {
            relation.live_rows().for_each(|row| visit(relation.functor, relation.row(row)));
        }
    }

    /// Returns the contents of a term.
    pub fn contents(&self, term: Term) -> TermContents<'_> {
        self.terms.contents(term)
    }

    /// Returns the texts of facts, those of relations with this name, or of all if it is empty: at most so
    /// many, after the first `from`.
    pub fn fact_texts(
        &self,
        heap: &Heap,
        describe: Describe,
        name: &str,
        from: usize,
        most: usize,
    ) -> Vec<String> {
        let mut left = from;
        let mut texts = Vec::new();
        for relation in &self.relations {
            if relation.count() == 0 || !name.is_empty() && name_of(heap, describe, relation.functor) != name
            {
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
                let mut text = format!("({}", name_of(heap, describe, relation.functor));
                for &term in relation.row(row) {
                    text.push(' ');
                    self.terms.write(heap, describe, term, CHARACTERS, &mut text);
                }
                text.push(')');
                texts.push(text);
            }
        }
        texts
    }
}

fn name_of(heap: &Heap, describe: Describe, functor: Term) -> String {
    functor.as_atom().map_or("?".into(), |value| describe(heap, value))
}
