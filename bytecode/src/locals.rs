//! Local definitions around a macro call, for the environment that the macro is given.

use std::sync::Arc;

use crate::datum::{Datum, ObjectId};
use crate::symbol::Symbol;

/// Meaning of a local definition, as macros may ask for it.
#[derive(Clone, Debug)]
pub enum LocalMeaning {
    /// A function, which hides a macro of its name.
    Function,
    /// A macro, with its function.
    Macro(ObjectId),
    /// A variable, which hides a symbol macro of its name.
    Variable,
    /// A symbol macro, with the form that the name stands for.
    SymbolMacro(Datum),
}

/// The local definitions around a form. Those of a form inside share them.
#[derive(Clone, Debug, Default)]
pub struct Locals(Option<Arc<LocalDefinition>>);

/// A local definition, and those around it.
#[derive(Debug)]
pub struct LocalDefinition {
    /// The name.
    pub name: Symbol,
    /// The meaning of the name.
    pub meaning: LocalMeaning,
    /// The definitions around it.
    pub outer: Locals,
    /// Number of definitions, with those around it.
    pub depth: usize,
}

impl Locals {
    /// Returns the definitions with one more inside of them.
    #[must_use]
    pub fn with(&self, name: Symbol, meaning: LocalMeaning) -> Locals {
        let depth = self.0.as_ref().map_or(0, |inner| inner.depth) + 1;
        Locals(Some(Arc::new(LocalDefinition { name, meaning, outer: self.clone(), depth })))
    }

    /// Returns the innermost definition.
    pub fn innermost(&self) -> Option<&LocalDefinition> {
        self.0.as_deref()
    }

    /// Whether these are the same definitions, not only equal ones.
    pub fn is_same(&self, other: &Locals) -> bool {
        match (&self.0, &other.0) {
            (Some(one), Some(other)) => Arc::ptr_eq(one, other),
            (one, other) => one.is_none() && other.is_none(),
        }
    }
}

impl Drop for Locals {
    /// Frees the definitions one after another: there may be more than the native stack has room for.
    fn drop(&mut self) {
        let mut next = self.0.take();
        while let Some(definition) = next.and_then(Arc::into_inner) {
            next = definition.into_outer();
        }
    }
}

impl LocalDefinition {
    fn into_outer(mut self) -> Option<Arc<LocalDefinition>> {
        self.outer.0.take()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn very_many_definitions_are_freed() {
        let outer = Locals::default().with(Symbol::cl("F"), LocalMeaning::Function);
        let mut locals = outer.clone();
        for _ in 0..1_000_000 {
            locals = locals.with(Symbol::cl("X"), LocalMeaning::Variable);
        }
        assert_eq!(locals.innermost().map(|inner| inner.depth), Some(1_000_001));
        drop(locals);
        let innermost = outer.innermost().map(|inner| &inner.meaning);
        assert!(matches!(innermost, Some(LocalMeaning::Function)));
        assert!(outer.is_same(&outer.clone()) && !outer.is_same(&Locals::default()));
    }
}
