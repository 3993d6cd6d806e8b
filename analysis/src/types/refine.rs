//! Branches: the facts about variables that the test of a condition tells.

use esl_bytecode::builtin::Builtin;
use esl_bytecode::kind::{ParameterKinds, ValueType};
use esl_compiler::core::{Callee, NodeId, NodeKind, VarId};

use super::set::{KnownFacts, TypeSet, VariableFact};
use super::walk::TypeWalk;

impl TypeWalk<'_> {
    /// Walks an `if`.
    #[inline(never)]
    pub(super) fn condition(
        &mut self,
        test: NodeId,
        yes: NodeId,
        no: NodeId,
        known: &mut KnownFacts,
    ) -> TypeSet {
        let tested = self.node(test, known);
        let mut otherwise = known.clone();
        self.assume(test, true, tested, known);
        self.assume(test, false, tested, &mut otherwise);
        self.check_refusal(known, no, &otherwise);
        let first = self.node(yes, known);
        let second = self.node(no, &mut otherwise);
        known.join(otherwise);
        first.or(second)
    }

    #[inline(never)]
    pub(super) fn conjunction(&mut self, nodes: &[NodeId], known: &mut KnownFacts) -> TypeSet {
        let mut types = TypeSet::of(ValueType::SYMBOL);
        let mut out: Option<KnownFacts> = None;
        for (index, node) in nodes.iter().enumerate() {
            types = self.node(*node, known);
            if index + 1 < nodes.len() {
                let mut otherwise = known.clone();
                self.assume(*node, false, types, &mut otherwise);
                join(&mut out, otherwise);
                self.assume(*node, true, types, known);
            }
        }
        if let Some(out) = out.filter(|out| out.is_reached) {
            types = types.or(TypeSet::of(ValueType::NIL));
            known.join(out);
        }
        types
    }

    #[inline(never)]
    pub(super) fn disjunction(&mut self, nodes: &[NodeId], known: &mut KnownFacts) -> TypeSet {
        let mut all = TypeSet::NONE;
        let mut out: Option<KnownFacts> = None;
        for (index, node) in nodes.iter().enumerate() {
            let types = self.node(*node, known);
            if index + 1 < nodes.len() {
                let mut found = known.clone();
                self.assume(*node, true, types, &mut found);
                join(&mut out, found);
                self.assume(*node, false, types, known);
                all = all.or(types.without(ValueType::NIL));
            } else {
                all = all.or(types);
            }
        }
        if let Some(out) = out {
            known.join(out);
        }
        if nodes.is_empty() { TypeSet::of(ValueType::NIL) } else { all }
    }

    /// Notes the facts that follow if the value of a node, whose type is `tested`, is true, or is `NIL`.
    fn assume(&mut self, node: NodeId, holds: bool, tested: TypeSet, known: &mut KnownFacts) {
        if !known.is_reached {
            return;
        }
        if (holds && !tested.may_be_true()) || (!holds && !tested.may_be_nil()) {
            known.leave();
            return;
        }
        let form = self.core_form();
        match form.kind(node) {
            NodeKind::Local(variable) => {
                self.limit(*variable, TypeSet::of(ValueType::NIL), !holds, known);
            }
            NodeKind::And(nodes) if holds => nodes.iter().for_each(|node| self.suppose(*node, true, known)),
            NodeKind::Or(nodes) if !holds => nodes.iter().for_each(|node| self.suppose(*node, false, known)),
            NodeKind::IsInstance(class, value) => {
                if let NodeKind::Local(variable) = form.kind(*value) {
                    // An instance of a class without a bit of its own may be of this class, or may not.
                    let below = self.definitions.classes_below(class);
                    if holds {
                        self.limit(*variable, TypeSet::instances(below), true, known);
                    } else {
                        self.unknown(*variable, known);
                    }
                }
            }
            NodeKind::Call(Callee::Builtin(builtin), arguments) => {
                self.assume_call(*builtin, arguments, holds, known);
            }
            NodeKind::Call(_, arguments) => {
                // It may tell more than is understood here.
                let variables: Vec<VarId> =
                    arguments.iter().filter_map(|node| self.local_of(*node)).collect();
                variables.into_iter().for_each(|variable| self.unknown(variable, known));
            }
            _ => {}
        }
    }

    /// As [`TypeWalk::assume`], for a node whose type is not known.
    fn suppose(&mut self, node: NodeId, holds: bool, known: &mut KnownFacts) {
        let types = match self.core_form().kind(node) {
            NodeKind::Local(variable) => self.variable(*variable, known).types,
            _ => TypeSet::ANY,
        };
        self.assume(node, holds, types, known);
    }

    fn local_of(&self, node: NodeId) -> Option<VarId> {
        match self.core_form().kind(node) {
            NodeKind::Local(variable) => Some(*variable),
            _ => None,
        }
    }

    fn assume_call(&mut self, builtin: Builtin, arguments: &[NodeId], holds: bool, known: &mut KnownFacts) {
        let form = self.core_form();
        if matches!(builtin, Builtin::Not | Builtin::Null) && arguments.len() == 1 {
            return self.suppose(arguments[0], !holds, known);
        }
        match (builtin.info().tests, arguments) {
            (Some(tests), [argument]) => {
                if let NodeKind::Local(variable) = form.kind(*argument) {
                    self.limit(*variable, TypeSet::of(tests), holds, known);
                }
            }
            _ if matches!(builtin, Builtin::Eq | Builtin::Eql) => {
                for (one, other) in [(0, 1), (1, 0)] {
                    let (Some(one), Some(other)) = (arguments.get(one), arguments.get(other)) else { return };
                    if let (NodeKind::Local(variable), NodeKind::Constant(datum)) =
                        (form.kind(*one), form.kind(*other))
                    {
                        let types = TypeSet::of(ValueType::of_datum(datum.kind()));
                        let is_only = datum.is_nil();
                        if holds || is_only {
                            self.limit(*variable, types, holds, known);
                        }
                    }
                }
            }
            _ => {
                for argument in arguments {
                    if let NodeKind::Local(variable) = form.kind(*argument)
                        && is_predicate(builtin)
                    {
                        self.unknown(*variable, known);
                    }
                }
            }
        }
    }

    /// Notes that a variable is, or is not, of a type.
    fn limit(&mut self, variable: VarId, types: TypeSet, is: bool, known: &mut KnownFacts) {
        if !self.is_fixed(variable) {
            return;
        }
        let old = self.variable(variable, known);
        let limited = if is { old.types.and(types) } else { old.types.without(types.values) };
        if limited.is_empty() {
            known.leave();
        } else if limited != old.types {
            known.note(variable, VariableFact { types: limited, needed_at: old.needed_at });
        }
    }

    /// Forgets the fact about a variable, since a test that is not understood may have told more.
    fn unknown(&mut self, variable: VarId, known: &mut KnownFacts) {
        known.note(variable, VariableFact { types: TypeSet::ANY, needed_at: None });
    }
}

/// Whether a builtin tests its arguments without needing a type of them.
fn is_predicate(builtin: Builtin) -> bool {
    let info = builtin.info();
    info.gives.is_none_or(|gives| gives == ValueType::SYMBOL) && ParameterKinds::of(builtin).are_unknown()
}

fn join(all: &mut Option<KnownFacts>, known: KnownFacts) {
    match all {
        Some(all) => all.join(known),
        None => *all = Some(known),
    }
}
