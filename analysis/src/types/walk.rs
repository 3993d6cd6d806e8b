//! The walk through a form, in the order of evaluation.

use std::collections::VecDeque;

use esl_bytecode::diagnostic::Diagnostic;
use esl_bytecode::kind::ValueType;
use esl_compiler::core::{BlockId, BoundVariable, LambdaId, NodeId, NodeKind, Parameter, TagbodyItem, VarId};
use esl_compiler::diagnostic::Sources;
use rustc_hash::{FxHashMap, FxHashSet};

use super::messages::MessageTypes;
use super::program::{FunctionKey, ProgramDefinitions};
use super::set::{KnownFacts, TypeSet, VariableFact};
use crate::forms::{CoreForm, CoreForms};

/// Summary of a function.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct FunctionSummary {
    /// Whether a call of it may return.
    pub(super) returns: bool,
    /// Its parameters when it returns: required ones, optional ones, those of keys.
    pub(super) parameters: Vec<VariableFact>,
    /// Its first value.
    pub(super) result: TypeSet,
}

/// The walk, with all that it has found.
pub(super) struct TypeWalk<'p> {
    pub(super) forms: &'p CoreForms,
    pub(super) definitions: &'p ProgramDefinitions,
    pub(super) summaries: FxHashMap<FunctionKey, FunctionSummary>,
    /// Forms that use a summary.
    readers: FxHashMap<FunctionKey, FxHashSet<usize>>,
    /// The types of the variables of each form, apart from the facts of a place.
    bases: Vec<Vec<TypeSet>>,
    /// The local functions of each form.
    pub(super) local: Vec<FxHashMap<VarId, LambdaId>>,
    pending: VecDeque<usize>,
    is_pending: Vec<bool>,
    /// Forms of which nothing is known.
    given_up: Vec<bool>,
    /// The form that is walked.
    pub(super) at: usize,
    lambda: LambdaId,
    /// The facts where control leaves blocks, and the values of these.
    exits: FxHashMap<BlockId, (KnownFacts, TypeSet)>,
    /// How many forms around this place take programming errors.
    pub(super) guards: u32,
    /// How many take the failures of invalid messages.
    pub(super) message_guards: u32,
    /// The types of messages, in the last walk.
    pub(super) messages: Option<MessageTypes>,
    /// Warnings, in the last walk.
    pub(super) found: Option<Vec<Diagnostic>>,
}

impl<'p> TypeWalk<'p> {
    pub(super) fn new(forms: &'p CoreForms, definitions: &'p ProgramDefinitions) -> TypeWalk<'p> {
        let count = forms.forms.len();
        let bases = forms.forms.iter().map(|form| vec![TypeSet::NONE; form.core.variables.len()]);
        let mut walk = TypeWalk {
            forms,
            definitions,
            summaries: FxHashMap::default(),
            readers: FxHashMap::default(),
            bases: bases.collect(),
            local: vec![FxHashMap::default(); count],
            pending: (0..count).collect(),
            is_pending: vec![true; count],
            given_up: definitions.opaque.clone(),
            at: 0,
            lambda: LambdaId(0),
            exits: FxHashMap::default(),
            guards: 0,
            message_guards: 0,
            messages: None,
            found: None,
        };
        for form in 0..count {
            for (index, lambda) in forms.forms[form].core.lambdas.iter().enumerate() {
                let parameters = if definitions.opaque[form] { TypeSet::ANY } else { TypeSet::NONE };
                let summary = FunctionSummary {
                    returns: definitions.opaque[form],
                    parameters: vec![
                        VariableFact { types: parameters, needed_at: None };
                        lambda.parameters()
                    ],
                    result: parameters,
                };
                walk.summaries.insert((form as u32, LambdaId(index as u32)), summary);
            }
        }
        walk
    }

    /// Returns the next form that has to be walked.
    pub(super) fn take_pending(&mut self) -> Option<usize> {
        let form = self.pending.pop_front()?;
        self.is_pending[form] = false;
        Some(form)
    }

    fn add_pending(&mut self, form: usize) {
        if self.found.is_none() && !self.given_up[form] && !self.is_pending[form] {
            self.is_pending[form] = true;
            self.pending.push_back(form);
        }
    }

    /// Lets everything in a form be unknown.
    pub(super) fn give_up(&mut self, form: usize) {
        self.given_up[form] = true;
        for index in 0..self.forms.forms[form].core.lambdas.len() {
            let key = (form as u32, LambdaId(index as u32));
            let parameters = self.summaries[&key].parameters.len();
            let unknown = VariableFact { types: TypeSet::ANY, needed_at: None };
            let summary = FunctionSummary {
                returns: true,
                parameters: vec![unknown; parameters],
                result: TypeSet::ANY,
            };
            self.change_summary(key, summary);
        }
    }

    fn change_summary(&mut self, key: FunctionKey, summary: FunctionSummary) {
        if self.summaries[&key] == summary {
            return;
        }
        self.summaries.insert(key, summary);
        let readers: Vec<usize> = self.readers.get(&key).into_iter().flatten().copied().collect();
        readers.into_iter().for_each(|form| self.add_pending(form));
    }

    /// Walks a form.
    pub(super) fn form(&mut self, form: usize) {
        if self.given_up[form] {
            return;
        }
        self.at = form;
        self.guards = 0;
        self.exits.clear();
        self.function(LambdaId(0), &KnownFacts::new());
    }

    /// Walks all forms once more, and returns the warnings.
    pub(super) fn report(&mut self, sources: &Sources) -> Vec<Diagnostic> {
        self.found = Some(Vec::new());
        for form in 0..self.forms.forms.len() {
            self.form(form);
        }
        let mut found = self.found.take().unwrap_or_default();
        found.retain(|found| crate::is_of_program(sources, found.primary.span));
        found
    }

    pub(super) fn core_form(&self) -> &'p CoreForm {
        &self.forms.forms[self.at]
    }

    /// Returns a summary, whose changes concern this form.
    pub(super) fn summary(&mut self, key: FunctionKey) -> FunctionSummary {
        self.readers.entry(key).or_default().insert(self.at);
        self.summaries[&key].clone()
    }

    /// Returns the fact about a variable.
    pub(super) fn variable(&self, variable: VarId, known: &KnownFacts) -> VariableFact {
        let base = VariableFact { types: self.bases[self.at][variable.index()], needed_at: None };
        known.fact(variable).unwrap_or(base)
    }

    /// Whether facts about a variable stay true.
    pub(super) fn is_fixed(&self, variable: VarId) -> bool {
        !self.core_form().core.variables[variable.index()].is_assigned
    }

    /// Adds values to those that a variable may have.
    fn widen(&mut self, variable: VarId, types: TypeSet) {
        let base = &mut self.bases[self.at][variable.index()];
        let wider = base.or(types);
        if wider != *base {
            *base = wider;
            self.add_pending(self.at);
        }
    }

    /// Binds a variable for the rest of the walk.
    pub(super) fn bind(&mut self, variable: &BoundVariable, types: TypeSet, known: &mut KnownFacts) {
        if let BoundVariable::Lexical(variable) = variable {
            self.widen(*variable, types);
            known.forget(*variable);
        }
    }

    /// Walks a function with the facts around it.
    pub(super) fn function(&mut self, lambda: LambdaId, around: &KnownFacts) {
        let text = &self.core_form().core.lambdas[lambda.index()];
        let outer = std::mem::replace(&mut self.lambda, lambda);
        let guards = if lambda == LambdaId(0) { 0 } else { self.guards };
        let guards = std::mem::replace(&mut self.guards, guards);
        let mut known = around.clone();
        for parameter in &text.required {
            self.bind_parameter(Some(*parameter), TypeSet::ANY, &mut known);
        }
        let keys = text.keys.iter().flatten().map(|key| &key.optional);
        for optional in text.optional.iter().chain(keys.clone()) {
            let mut inside = known.clone();
            self.node(optional.default, &mut inside);
            self.bind_parameter(Some(optional.parameter), TypeSet::ANY, &mut known);
            self.bind_parameter(optional.supplied, TypeSet::of(ValueType::SYMBOL), &mut known);
        }
        self.bind_parameter(text.rest, TypeSet::of(ValueType::LIST), &mut known);
        let result = self.node(text.body, &mut known);
        let mut summary = self.summaries[&(self.at as u32, lambda)].clone();
        if known.is_reached {
            summary.returns = true;
            summary.result = summary.result.or(result);
            let required = text.required.iter().copied();
            let optional = text.optional.iter().map(|optional| optional.parameter);
            let all = required.chain(optional).chain(keys.map(|key| key.parameter));
            for (parameter, old) in all.zip(&mut summary.parameters) {
                let fact = match parameter.is_special || !self.is_fixed(parameter.variable) {
                    true => VariableFact { types: TypeSet::ANY, needed_at: None },
                    false => self.variable(parameter.variable, &known),
                };
                old.types = old.types.or(fact.types);
                old.needed_at = old.needed_at.or(fact.needed_at);
            }
        }
        self.change_summary((self.at as u32, lambda), summary);
        self.lambda = outer;
        self.guards = guards;
    }

    fn bind_parameter(&mut self, parameter: Option<Parameter>, types: TypeSet, known: &mut KnownFacts) {
        if let Some(parameter) = parameter {
            self.bind(&BoundVariable::Lexical(parameter.variable), types, known);
        }
    }

    /// Walks a node. Returns the type of its first value, `NIL` if there is none.
    pub(super) fn node(&mut self, node: NodeId, known: &mut KnownFacts) -> TypeSet {
        if !known.is_reached {
            return TypeSet::NONE;
        }
        let kind = self.core_form().kind(node);
        let types = match kind {
            NodeKind::Hole | NodeKind::Special(_) => TypeSet::ANY,
            NodeKind::Pass(_) => TypeSet::of(ValueType::NIL),
            NodeKind::Constant(datum) => TypeSet::of(ValueType::of_datum(datum.kind())),
            NodeKind::Local(variable) => self.variable(*variable, known).types,
            NodeKind::FunctionRef(_) | NodeKind::BuiltinRef(_) => TypeSet::of(ValueType::FUNCTION),
            NodeKind::Lambda(lambda) => {
                self.function(*lambda, known);
                TypeSet::of(ValueType::FUNCTION)
            }
            NodeKind::SetLocal(variable, value) => {
                let types = self.node(*value, known);
                self.widen(*variable, types);
                types
            }
            NodeKind::SetSpecial(_, value) => self.node(*value, known),
            NodeKind::If(test, yes, no) => self.condition(*test, *yes, *no, known),
            NodeKind::Progn(nodes) => self.all(nodes, known),
            NodeKind::And(nodes) => self.conjunction(nodes, known),
            NodeKind::Or(nodes) => self.disjunction(nodes, known),
            NodeKind::Values(nodes) => {
                let types: Vec<TypeSet> = nodes.iter().map(|node| self.node(*node, known)).collect();
                types.first().copied().unwrap_or(TypeSet::of(ValueType::NIL))
            }
            NodeKind::Call(callee, arguments) => self.call(node, callee, arguments, false, known),
            NodeKind::Apply(callee, arguments) => self.call(node, callee, arguments, true, known),
            NodeKind::Slot(class, number, instance) => self.slot(node, (class, *number), *instance, known),
            NodeKind::SetSlot(class, number, instance, value) => {
                self.slot(node, (class, *number), *instance, known);
                self.node(*value, known)
            }
            NodeKind::IsInstance(_, value) => {
                self.node(*value, known);
                TypeSet::of(ValueType::SYMBOL)
            }
            NodeKind::FirstValues(first, then) => {
                let types = self.node(*first, known);
                self.node(*then, known);
                types
            }
            _ => self.scope(kind, known),
        };
        if known.is_reached { types } else { TypeSet::NONE }
    }

    /// Walks nodes one after another. Returns the type of the last.
    fn all(&mut self, nodes: &[NodeId], known: &mut KnownFacts) -> TypeSet {
        let mut types = TypeSet::of(ValueType::NIL);
        for node in nodes {
            types = self.node(*node, known);
        }
        types
    }

    /// Walks a form that binds, or that control may leave otherwise than at its end.
    #[inline(never)]
    fn scope(&mut self, kind: &NodeKind, known: &mut KnownFacts) -> TypeSet {
        match kind {
            NodeKind::Let { sequential, bindings, body } => {
                let mut values = Vec::new();
                for (variable, value) in bindings {
                    let types = self.node(*value, known);
                    if let (BoundVariable::Lexical(variable), NodeKind::Lambda(lambda)) =
                        (variable, self.core_form().kind(*value))
                        && self.is_fixed(*variable)
                    {
                        self.local[self.at].insert(*variable, *lambda);
                    }
                    if *sequential {
                        self.bind(variable, types, known);
                    } else {
                        values.push(types);
                    }
                }
                for ((variable, _), types) in bindings.iter().zip(values) {
                    self.bind(variable, types, known);
                }
                let types = self.node(*body, known);
                for (variable, _) in bindings {
                    if let BoundVariable::Lexical(variable) = variable {
                        known.forget(*variable);
                    }
                }
                types
            }
            NodeKind::Functions { definitions, body } => {
                for (variable, lambda) in definitions {
                    self.local[self.at].insert(*variable, *lambda);
                    self.widen(*variable, TypeSet::of(ValueType::FUNCTION));
                }
                for (_, lambda) in definitions {
                    self.function(*lambda, known);
                }
                self.node(*body, known)
            }
            NodeKind::Block(block, body) => self.block(*block, *body, known),
            NodeKind::ReturnFrom(block, value) => {
                let types = self.node(*value, known);
                if known.is_reached {
                    let out = known.clone();
                    match self.exits.get_mut(block) {
                        Some((there, all)) => {
                            there.join(out);
                            *all = all.or(types);
                        }
                        None => _ = self.exits.insert(*block, (out, types)),
                    }
                }
                known.leave();
                TypeSet::NONE
            }
            NodeKind::Tagbody(_, items) => {
                let before = known.clone();
                for item in items {
                    match item {
                        // Control may come from any place inside.
                        TagbodyItem::Tag => *known = before.clone(),
                        TagbodyItem::Form(form) => _ = self.node(*form, known),
                    }
                }
                TypeSet::of(ValueType::NIL)
            }
            NodeKind::Go(..) => {
                known.leave();
                TypeSet::NONE
            }
            NodeKind::Catch(tag, body) => {
                self.node(*tag, known);
                let mut inside = known.clone();
                self.node(*body, &mut inside);
                TypeSet::ANY
            }
            NodeKind::Throw(tag, value) => {
                self.node(*tag, known);
                self.node(*value, known);
                known.leave();
                TypeSet::NONE
            }
            NodeKind::UnwindProtect(body, cleanup) | NodeKind::FailureCleanup(body, cleanup) => {
                let mut before = known.clone();
                let types = self.node(*body, known);
                self.node(*cleanup, &mut before);
                if !before.is_reached && matches!(kind, NodeKind::UnwindProtect(..)) {
                    known.leave();
                }
                types
            }
            NodeKind::Progv(symbols, values, body) => {
                self.node(*symbols, known);
                self.node(*values, known);
                self.node(*body, known)
            }
            NodeKind::BindValues(variables, form, body) => {
                let first = self.node(*form, known);
                for (index, variable) in variables.iter().enumerate() {
                    self.bind(variable, if index == 0 { first } else { TypeSet::ANY }, known);
                }
                self.node(*body, known)
            }
            NodeKind::CallValues(function, forms) => {
                self.node(*function, known);
                self.all(forms, known);
                TypeSet::ANY
            }
            _ => self.handling(kind, known),
        }
    }

    fn block(&mut self, block: BlockId, body: NodeId, known: &mut KnownFacts) -> TypeSet {
        let before = known.clone();
        self.exits.remove(&block);
        let types = self.node(body, known);
        let exit = self.exits.remove(&block);
        if self.core_form().core.blocks[block.index()].is_captured {
            // A function that is called inside of it may leave it.
            *known = before;
            return TypeSet::ANY;
        }
        match exit {
            Some((there, out)) => {
                known.join(there);
                types.or(out)
            }
            None => types,
        }
    }
}
