//! Forms that handle failures: calls inside of them that are meant to fail are not warned of.

use esl_compiler::core::{BoundVariable, NodeId, NodeKind};

use super::set::{KnownFacts, TypeSet};
use super::walk::TypeWalk;
use crate::cause::may_be_mistake;
use crate::forms::ScopeKind;

impl TypeWalk<'_> {
    /// Walks a form that handles failures.
    #[inline(never)]
    pub(super) fn handling(&mut self, kind: &NodeKind, known: &mut KnownFacts) -> TypeSet {
        let before = known.clone();
        match kind {
            NodeKind::HandlerCase(body, clauses) => {
                let guards = clauses.iter().any(|clause| {
                    clause.condition_type.as_symbol().is_none_or(|name| takes_type_errors(name.name()))
                });
                let takes_messages = clauses.iter().any(|clause| {
                    clause.condition_type.as_symbol().is_none_or(|name| name.name() == "FAILURE")
                });
                self.message_guards += u32::from(takes_messages);
                let mut types = self.guarded(guards, *body, known);
                self.message_guards -= u32::from(takes_messages);
                for clause in clauses {
                    let mut inside = before.clone();
                    self.bind(&BoundVariable::Lexical(clause.variable), TypeSet::ANY, &mut inside);
                    types = types.or(self.node(clause.body, &mut inside));
                    known.join(inside);
                }
                types
            }
            NodeKind::Recovery { table, procedures, body } => {
                self.node(*table, &mut known.clone());
                self.node(*procedures, &mut known.clone());
                let form = self.core_form();
                let scope = form.scope_of[body.index()].map(|scope| &form.scopes[scope].kind);
                let guards = match scope {
                    Some(ScopeKind::Recovery { clauses, .. }) => {
                        clauses.iter().any(|clause| may_be_mistake(self.forms, &clause.cause))
                    }
                    _ => true,
                };
                let takes_messages = matches!(scope, Some(ScopeKind::Recovery { clauses, .. })
                    if clauses.iter().any(|clause| clause.cause.name() == "INVALID-MESSAGE"));
                self.message_guards += u32::from(takes_messages);
                self.guarded(guards, *body, known);
                self.message_guards -= u32::from(takes_messages);
                *known = before;
                TypeSet::ANY
            }
            NodeKind::Handlers(list, body) => {
                self.node(*list, known);
                self.guarded(true, *body, known)
            }
            NodeKind::Mask(height, body) => {
                self.node(*height, known);
                self.node(*body, known)
            }
            _ => TypeSet::ANY,
        }
    }

    /// Walks a body, whose programming errors the form around it takes if `guards`.
    fn guarded(&mut self, guards: bool, body: NodeId, known: &mut KnownFacts) -> TypeSet {
        self.guards += u32::from(guards);
        let types = self.node(body, known);
        self.guards -= u32::from(guards);
        types
    }
}

/// Whether handlers for conditions of a type run for a value of a wrong type.
fn takes_type_errors(name: &str) -> bool {
    matches!(name, "T" | "CONDITION" | "SERIOUS-CONDITION" | "ERROR" | "TYPE-ERROR" | "SIMPLE-TYPE-ERROR")
}
