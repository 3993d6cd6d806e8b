//! The environment argument of macros, an association list.
//!
//! A name as a function has the entry `(name . function)`, with the function of a macro, or `NIL` for a
//! local function. A name as a variable has the entry `((name . form) . T)` for a symbol macro, and
//! `((name) . NIL)` for a variable that hides one.

use esl_bytecode::locals::{LocalDefinition, LocalMeaning, Locals};

use super::Unit;
use crate::heap::{AllocError, Heap};
use crate::names::Names;
use crate::value::Value;

/// The environments of the last macro call and of the forms around it, the outermost first: what two calls
/// have in common is made once.
#[derive(Default)]
pub(super) struct Environments(Vec<(Locals, Value)>);

impl Environments {
    /// Calls `visit` with the environments.
    pub(super) fn roots(&self, visit: &mut dyn FnMut(Value)) {
        self.0.iter().for_each(|&(_, environment)| visit(environment));
    }

    /// Returns about how many bytes they take.
    pub(super) fn bytes(&self) -> usize {
        self.0.capacity() * size_of::<(Locals, Value)>()
    }
}

impl Unit {
    /// Returns the environment that tells of these definitions.
    ///
    /// # Errors
    /// [`AllocError`]. Objects made so far are kept.
    pub(crate) fn environment(
        &mut self,
        heap: &mut Heap,
        names: &mut Names,
        locals: &Locals,
    ) -> Result<Value, AllocError> {
        let depth = locals.innermost().map_or(0, |innermost| innermost.depth);
        self.environments.0.truncate(depth);
        let mut missing = Vec::new();
        let mut next = locals;
        while let Some(definition) = next.innermost() {
            let known = self.environments.0.get(definition.depth - 1);
            if known.is_some_and(|(known, _)| known.is_same(next)) {
                break;
            }
            missing.push(next);
            next = &definition.outer;
        }
        self.environments.0.truncate(depth - missing.len());
        let mut environment = self.environments.0.last().map_or(Value::NIL, |&(_, environment)| environment);
        for locals in missing.into_iter().rev() {
            let Some(definition) = locals.innermost() else { continue };
            let entry = self.entry(heap, names, definition)?;
            environment = heap.cons(entry, environment)?;
            self.environments.0.push((locals.clone(), environment));
            self.work += 1;
        }
        Ok(environment)
    }

    fn entry(
        &mut self,
        heap: &mut Heap,
        names: &mut Names,
        definition: &LocalDefinition,
    ) -> Result<Value, AllocError> {
        let name = self.symbol_object(heap, names, &definition.name)?;
        let (key, value) = match &definition.meaning {
            LocalMeaning::Function => (name, Value::NIL),
            LocalMeaning::Macro(function) => (name, self.pinned(*function).unwrap_or(Value::NIL)),
            LocalMeaning::Variable => (heap.cons(name, Value::NIL)?, Value::NIL),
            LocalMeaning::SymbolMacro(form) => {
                let form = self.value_of(heap, names, form)?;
                (heap.cons(name, form)?, Value::T)
            }
        };
        heap.cons(key, value)
    }
}
