//! Types, and facts about variables.

use esl_bytecode::kind::ValueType;
use esl_bytecode::span::Span;
use esl_compiler::core::VarId;

/// Most facts about variables that are kept at once.
const MOST_FACTS: usize = 64;

/// A type: classes of values, and for instances the structures that they may be of, one a bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct TypeSet {
    pub(super) values: ValueType,
    /// The last bit stands for all classes that have no bit of their own.
    pub(super) classes: u64,
}

impl TypeSet {
    pub(super) const NONE: TypeSet = TypeSet { values: ValueType::NONE, classes: 0 };
    pub(super) const ANY: TypeSet = TypeSet { values: ValueType::ANY, classes: u64::MAX };

    /// Returns the type of these values, instances of any class included.
    pub(super) fn of(values: ValueType) -> TypeSet {
        let has_instances = values.contains(ValueType::INSTANCE) && !values.is_empty();
        TypeSet { values, classes: if has_instances { u64::MAX } else { 0 } }
    }

    /// Returns the type of the instances of these classes.
    pub(super) fn instances(classes: u64) -> TypeSet {
        TypeSet { values: ValueType::INSTANCE, classes }.whole()
    }

    /// Leaves instances out if they are of no class.
    fn whole(self) -> TypeSet {
        if self.classes == 0 || !self.values.contains(ValueType::INSTANCE) {
            TypeSet { values: self.values.without(ValueType::INSTANCE), classes: 0 }
        } else {
            self
        }
    }

    pub(super) fn or(self, other: TypeSet) -> TypeSet {
        TypeSet { values: self.values.or(other.values), classes: self.classes | other.classes }
    }

    pub(super) fn and(self, other: TypeSet) -> TypeSet {
        TypeSet { values: self.values.and(other.values), classes: self.classes & other.classes }.whole()
    }

    /// Returns the values that are surely not in `other`, with all instances.
    pub(super) fn without(self, other: ValueType) -> TypeSet {
        TypeSet { values: self.values.without(other), classes: self.classes }.whole()
    }

    pub(super) fn is_empty(self) -> bool {
        self.values.is_empty()
    }

    /// Whether `NIL` is among the values.
    pub(super) fn may_be_nil(self) -> bool {
        self.values.contains(ValueType::NIL)
    }

    /// Whether any other value than `NIL` is.
    pub(super) fn may_be_true(self) -> bool {
        !self.values.without(ValueType::NIL).is_empty()
    }
}

/// A fact about a variable at a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct VariableFact {
    pub(super) types: TypeSet,
    /// The call that needs this type of it.
    pub(super) needed_at: Option<Span>,
}

/// The facts that are known at a place of the program.
#[derive(Clone, Debug)]
pub(super) struct KnownFacts {
    /// Whether control may reach it.
    pub(super) is_reached: bool,
    facts: Vec<(VarId, VariableFact)>,
}

impl KnownFacts {
    pub(super) fn new() -> KnownFacts {
        KnownFacts { is_reached: true, facts: Vec::new() }
    }

    pub(super) fn fact(&self, variable: VarId) -> Option<VariableFact> {
        self.facts.iter().rev().find(|(known, _)| *known == variable).map(|(_, fact)| *fact)
    }

    pub(super) fn note(&mut self, variable: VarId, fact: VariableFact) {
        match self.facts.iter_mut().find(|(known, _)| *known == variable) {
            Some((_, old)) => *old = fact,
            None => {
                if self.facts.len() >= MOST_FACTS {
                    self.facts.remove(0);
                }
                self.facts.push((variable, fact));
            }
        }
    }

    pub(super) fn forget(&mut self, variable: VarId) {
        self.facts.retain(|(known, _)| *known != variable);
    }

    /// Nothing is reached from here.
    pub(super) fn leave(&mut self) {
        self.is_reached = false;
        self.facts.clear();
    }

    /// Keeps the facts that are known on both of two ways that meet.
    pub(super) fn join(&mut self, other: KnownFacts) {
        if !other.is_reached {
            return;
        }
        if !self.is_reached {
            *self = other;
            return;
        }
        self.facts.retain_mut(|(variable, fact)| {
            let Some(there) = other.fact(*variable) else { return false };
            fact.types = fact.types.or(there.types);
            fact.needed_at = fact.needed_at.or(there.needed_at);
            true
        });
    }
}
