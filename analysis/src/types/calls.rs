//! Calls: the needs of their functions, and the values that these return.

use esl_bytecode::builtin::Builtin;
use esl_bytecode::kind::{ArgumentKind, ParameterKinds, ValueType};
use esl_bytecode::symbol::Symbol;
use esl_compiler::core::{Callee, Lambda, NodeId, NodeKind};

use super::library;
use super::program::FunctionKey;
use super::set::{KnownFacts, TypeSet, VariableFact};
use super::slots;
use super::walk::TypeWalk;

/// Functions of the library that expect their function argument to fail.
const EXPECTING: &[&str] = &["%CHECK-FAILS", "%CHECK-SIGNALS"];

/// The need of a function for an argument.
pub(super) struct ArgumentNeed {
    pub(super) types: TypeSet,
    /// Kind of the parameter of a builtin.
    pub(super) kind: Option<ArgumentKind>,
    /// Name of the parameter, and the place where the function needs it.
    pub(super) parameter: Option<(Symbol, VariableFact)>,
}

impl ArgumentNeed {
    /// Returns the need for these values.
    pub(super) fn of_types(types: TypeSet) -> ArgumentNeed {
        ArgumentNeed { types, kind: None, parameter: None }
    }

    fn of_kind(kind: ArgumentKind) -> ArgumentNeed {
        ArgumentNeed { types: TypeSet::of(kind.values()), kind: Some(kind), parameter: None }
    }
}

impl TypeWalk<'_> {
    #[inline(never)]
    pub(super) fn call(
        &mut self,
        node: NodeId,
        callee: &Callee,
        arguments: &[NodeId],
        spreads: bool,
        known: &mut KnownFacts,
    ) -> TypeSet {
        let form = self.core_form();
        let callee = match callee {
            Callee::Value(function) => match form.kind(*function) {
                NodeKind::FunctionRef(symbol) => Callee::Global(symbol.clone()),
                NodeKind::BuiltinRef(builtin) => Callee::Builtin(*builtin),
                NodeKind::Lambda(_) => callee.clone(),
                NodeKind::Local(variable) if self.local[self.at].contains_key(variable) => {
                    Callee::Local(*variable)
                }
                _ => {
                    let types = self.node(*function, known);
                    self.check_function(node, *function, types, known);
                    callee.clone()
                }
            },
            other => other.clone(),
        };
        if let Callee::Value(function) = &callee
            && let NodeKind::Lambda(lambda) = form.kind(*function)
        {
            self.function(*lambda, known);
        }
        let is_check = matches!(&callee, Callee::Global(symbol) if EXPECTING.contains(&symbol.name()));
        self.guards += u32::from(is_check);
        let types: Vec<TypeSet> = arguments.iter().map(|argument| self.node(*argument, known)).collect();
        self.guards -= u32::from(is_check);
        if !known.is_reached {
            return TypeSet::NONE;
        }
        let given = if spreads { arguments.len().saturating_sub(1) } else { arguments.len() };
        let (arguments, types) = (&arguments[..given], &types[..given]);
        match &callee {
            Callee::Builtin(builtin) => self.call_builtin(node, *builtin, arguments, types, known),
            Callee::Global(symbol) => {
                if !spreads {
                    self.check_message(symbol, arguments, types, known);
                }
                if slots::is_refusal(symbol) {
                    known.leave();
                    return TypeSet::NONE;
                }
                match self.definitions.functions.get(symbol) {
                    Some(key) => self.call_function(node, symbol, *key, (arguments, types), spreads, known),
                    None => self.call_library(node, symbol, arguments, types, known),
                }
            }
            Callee::Local(variable) => match self.local[self.at].get(variable) {
                Some(lambda) => {
                    let name = form.core.variables[variable.index()].name.clone();
                    let key = (self.at as u32, *lambda);
                    self.call_function(node, &name, key, (arguments, types), spreads, known)
                }
                None => TypeSet::ANY,
            },
            Callee::Value(_) => TypeSet::ANY,
        }
    }

    fn check_function(&mut self, node: NodeId, function: NodeId, types: TypeSet, known: &mut KnownFacts) {
        let need = ArgumentNeed::of_kind(ArgumentKind::Function);
        self.check_argument(node, "funcall", function, types, &need, known);
    }

    fn call_builtin(
        &mut self,
        node: NodeId,
        builtin: Builtin,
        arguments: &[NodeId],
        types: &[TypeSet],
        known: &mut KnownFacts,
    ) -> TypeSet {
        let kinds = ParameterKinds::of(builtin);
        let name = builtin.info().name;
        let mut succeeds = true;
        for (index, (argument, given)) in arguments.iter().zip(types).enumerate() {
            if let Some(kind) = kinds.at(index) {
                let need = ArgumentNeed::of_kind(kind);
                succeeds &= self.check_argument(node, name, *argument, *given, &need, known);
            }
        }
        if !succeeds || self.definitions.substitutes {
            return TypeSet::ANY;
        }
        match builtin {
            Builtin::Identity => types.first().copied().unwrap_or(TypeSet::ANY),
            Builtin::MakeStructure | Builtin::MakeValueStructure => {
                let class = arguments.first().and_then(|class| self.core_form().symbol(*class));
                match class {
                    Some(class) => TypeSet::instances(self.definitions.class(class)),
                    None => TypeSet::of(ValueType::INSTANCE),
                }
            }
            _ => builtin.info().gives.map_or(TypeSet::ANY, TypeSet::of),
        }
    }

    /// Calls a function of the program.
    fn call_function(
        &mut self,
        node: NodeId,
        name: &Symbol,
        key: FunctionKey,
        (arguments, types): (&[NodeId], &[TypeSet]),
        spreads: bool,
        known: &mut KnownFacts,
    ) -> TypeSet {
        let summary = self.summary(key);
        if !summary.returns {
            known.leave();
            return TypeSet::NONE;
        }
        let core = &self.forms.forms[key.0 as usize].core;
        let text = &core.lambdas[key.1.index()];
        if arguments.len() < text.required.len() && !spreads {
            // The compiler has told.
            return TypeSet::ANY;
        }
        let shown = name.to_string().to_lowercase();
        let mut succeeds = true;
        let positional = text.required.len() + text.optional.len();
        let keywords =
            text.keys.iter().flatten().map(|key| if key.key.is_keyword() { key.key.name() } else { "" });
        let keys: Vec<&str> = keywords.collect();
        for (place, index) in self.parameters_of(positional, &keys, arguments) {
            let Some(fact) = summary.parameters.get(index).copied() else { continue };
            let key = index.checked_sub(positional).and_then(|index| text.keys.iter().flatten().nth(index));
            let name = match key {
                Some(key) => Some(key.key.clone()),
                None => {
                    let variable = parameter_variable(text, index);
                    variable.map(|variable| core.variables[variable.index()].name.clone())
                }
            };
            let parameter = name.map(|name| (name, fact));
            let need = ArgumentNeed { types: fact.types, kind: None, parameter };
            succeeds &= self.check_argument(node, &shown, arguments[place], types[place], &need, known);
        }
        if succeeds { summary.result } else { TypeSet::ANY }
    }

    /// Calls a function of the library that is written in ESL.
    fn call_library(
        &mut self,
        node: NodeId,
        symbol: &Symbol,
        arguments: &[NodeId],
        types: &[TypeSet],
        known: &mut KnownFacts,
    ) -> TypeSet {
        let found = library::types_of(symbol).filter(|_| !self.definitions.changed.contains(symbol));
        let Some(library) = found else { return TypeSet::ANY };
        let keys: Vec<&str> = library.keys.iter().map(|(key, _)| key.as_str()).collect();
        let of_keys = library.keys.iter().map(|(_, types)| types);
        let needs: Vec<ValueType> = library.positional.iter().chain(of_keys).copied().collect();
        let mut succeeds = true;
        for (place, index) in self.parameters_of(library.positional.len(), &keys, arguments) {
            let need = ArgumentNeed::of_types(TypeSet::of(needs[index]));
            succeeds &=
                self.check_argument(node, symbol.name(), arguments[place], types[place], &need, known);
        }
        let is_known = succeeds && !self.definitions.substitutes;
        if is_known { TypeSet::of(library.result) } else { TypeSet::ANY }
    }

    /// Returns for each argument, by its place, the parameter that takes it, by its index: first those by
    /// position, then those of keys.
    fn parameters_of(&self, positional: usize, keys: &[&str], arguments: &[NodeId]) -> Vec<(usize, usize)> {
        let mut pairs: Vec<(usize, usize)> =
            (0..arguments.len().min(positional)).map(|place| (place, place)).collect();
        let mut taken = vec![false; keys.len()];
        for place in (positional..arguments.len()).step_by(2) {
            let Some(key) = self.core_form().symbol(arguments[place]) else { break };
            let found = keys.iter().position(|known| key.is_keyword() && *known == key.name());
            if let Some(index) = found.filter(|index| !taken[*index] && place + 1 < arguments.len()) {
                // Of two arguments for a key, the first counts.
                taken[index] = true;
                pairs.push((place + 1, positional + index));
            }
        }
        pairs
    }

    /// Reads or writes a slot of a structure.
    pub(super) fn slot(
        &mut self,
        node: NodeId,
        (class, number): (&Symbol, u16),
        instance: NodeId,
        known: &mut KnownFacts,
    ) -> TypeSet {
        let types = self.node(instance, known);
        if known.is_reached {
            let below = self.definitions.classes_below(class);
            let need = ArgumentNeed::of_types(TypeSet::instances(below));
            let name = format!("a slot of {}", class.name().to_lowercase());
            self.check_argument(node, &name, instance, types, &need, known);
        }
        if self.definitions.substitutes { TypeSet::ANY } else { self.definitions.slot(class, number) }
    }

    /// Compares an argument with the need of its function: warns if the call cannot succeed, and otherwise
    /// notes the type of a variable when it has. Returns whether it may succeed.
    fn check_argument(
        &mut self,
        node: NodeId,
        name: &str,
        argument: NodeId,
        given: TypeSet,
        need: &ArgumentNeed,
        known: &mut KnownFacts,
    ) -> bool {
        let common = given.and(need.types);
        if given.is_empty() {
            return true;
        }
        if common.is_empty() {
            self.warn(node, name, argument, given, need);
            return false;
        }
        if let NodeKind::Local(variable) = self.core_form().kind(argument)
            && self.is_fixed(*variable)
            && !self.definitions.substitutes
            && common != self.variable(*variable, known).types
        {
            let span = self.core_form().core.nodes[node.index()].span;
            known.note(*variable, VariableFact { types: common, needed_at: Some(span) });
        }
        true
    }
}

fn parameter_variable(text: &Lambda, index: usize) -> Option<esl_compiler::core::VarId> {
    let required = text.required.iter().copied();
    let optional = text.optional.iter().map(|optional| optional.parameter);
    let keys = text.keys.iter().flatten().map(|key| key.optional.parameter);
    required.chain(optional).chain(keys).nth(index).map(|parameter| parameter.variable)
}
