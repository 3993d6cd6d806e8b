//! Warnings about calls that cannot succeed.

use esl_bytecode::diagnostic::{Diagnostic, Severity};
use esl_bytecode::kind::ValueType;
use esl_bytecode::span::Span;
use esl_compiler::core::{NodeId, NodeKind};

use super::calls::ArgumentNeed;
use super::set::TypeSet;
use super::walk::TypeWalk;

/// Name of a refusal by a slot, in place of that of a function.
pub(super) const REFUSED: &str = "a slot";

impl TypeWalk<'_> {
    /// Warns of an argument that its function cannot take.
    pub(super) fn warn(
        &mut self,
        node: NodeId,
        name: &str,
        argument: NodeId,
        given: TypeSet,
        need: &ArgumentNeed,
    ) {
        if self.guards > 0 || self.found.is_none() {
            return;
        }
        let form = self.core_form();
        let kind = form.kind(argument);
        // The compiler warns of constant arguments of builtins.
        if need.kind.is_some() && matches!(kind, NodeKind::Constant(_)) {
            return;
        }
        let needed = need.kind.map_or_else(|| self.noun(need.types), |kind| kind.noun().into());
        let passed = self.noun(given);
        let name = name.to_lowercase();
        let message = match &need.parameter {
            Some((parameter, _)) => {
                let parameter = parameter.name().to_lowercase();
                format!("`{name}` needs {needed} as `{parameter}`, and gets {passed}")
            }
            None if name == REFUSED => format!("this slot takes {needed}, and gets {passed}"),
            None if name.starts_with("a slot") => format!("{name} belongs to {needed}, and not to {passed}"),
            None => format!("`{name}` needs {needed}, and gets {passed}"),
        };
        let span = form.core.nodes[argument.index()].span;
        let call = form.core.nodes[node.index()].span;
        let at = if span == Span::default() { call } else { span };
        let mut found = Diagnostic::new("wrong-type", Severity::Warning, message, at);
        let is_slot = matches!(kind, NodeKind::Local(_)) && name == REFUSED;
        found =
            found.label(if is_slot { "the slot is set here".into() } else { format!("this is {passed}") });
        if let NodeKind::Local(variable) = kind {
            let bound = form.core.variables[variable.index()].span;
            if bound != Span::default() && bound != at {
                found = found.also(bound, format!("the variable is bound here, to {passed}"));
            }
        }
        if let Some((_, fact)) = &need.parameter
            && let Some(place) = fact.needed_at
        {
            found = found.also(place, format!("{needed} is needed here"));
        }
        if let Some(all) = &mut self.found {
            all.push(found);
        }
    }

    /// Returns a type as messages name it.
    pub(super) fn noun(&self, types: TypeSet) -> String {
        let names = self.definitions.names(types.classes);
        if names.is_empty() || !types.values.contains(ValueType::INSTANCE) {
            return types.values.noun();
        }
        let instance = format!("an instance of {}", names.join(" or "));
        let others = types.values.without(ValueType::INSTANCE);
        if others.is_empty() { instance } else { format!("{} or {instance}", others.noun()) }
    }
}
