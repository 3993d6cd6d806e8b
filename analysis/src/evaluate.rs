//! Constraints of the nodes of the core language.

use esl_bytecode::builtin::Builtin;
use esl_bytecode::symbol::Symbol;
use esl_compiler::core::{BoundVariable, Callee, NodeId, NodeKind, Parameter};

use crate::cause::mistakes_named;
use crate::clause::Clause;
use crate::effect::{NodeEffect, mistake};
use crate::flow::{CallArguments, CallPoint, FlowWatcher, Passing, ValueFlow};
use crate::forms::{CoreForm, symbols_inside};
use crate::value::{CellId, CellKey, Code, FlowValue, NO_CONTEXT, Spot, ThingKey};

/// A piece of code that is being looked at.
#[derive(Clone, Copy)]
struct CodePosition {
    code: Code,
}

impl CodePosition {
    fn spot(self, node: NodeId) -> Spot {
        Spot { form: self.code.form, node, context: self.code.context }
    }
}

impl ValueFlow<'_> {
    /// Looks at a piece of code.
    pub(crate) fn read(&mut self, code: Code) {
        let forms = self.forms;
        let form = &forms.forms[code.form as usize];
        let here = CodePosition { code };
        for node in &form.nodes_of[code.lambda.index()] {
            self.evaluate(here, *node);
        }
        let lambda = &form.core.lambdas[code.lambda.index()];
        let result = self.at(here.spot(lambda.body));
        let value = self.cell(CellKey::Return(code));
        self.copy(result, value);
        let optional = lambda.optional.iter();
        for parameter in optional.chain(lambda.keys.iter().flatten().map(|key| &key.optional)) {
            let default = self.at(here.spot(parameter.default));
            self.set_parameter(code, parameter.parameter, default);
        }
    }

    /// Has values flow to a parameter.
    pub(crate) fn set_parameter(&mut self, code: Code, parameter: Parameter, from: CellId) {
        let forms = self.forms;
        let core = &forms.forms[code.form as usize].core;
        let to = self.cell(CellKey::Variable(code.form, parameter.variable, code.context));
        self.copy(from, to);
        if parameter.is_special {
            let name = core.variables[parameter.variable.index()].name.clone();
            let special = self.cell(CellKey::Special(name));
            self.copy(from, special);
        }
    }

    /// Returns the cell of a lexical variable.
    fn variable(&mut self, here: CodePosition, variable: esl_compiler::core::VarId) -> CellId {
        let forms = self.forms;
        let owner = forms.forms[here.code.form as usize].core.variables[variable.index()].owner;
        // Variables around a function's definition are the same in each context of it.
        let context = if owner.0 == 0 { NO_CONTEXT } else { here.code.context };
        self.cell(CellKey::Variable(here.code.form, variable, context))
    }

    fn bound(&mut self, here: CodePosition, variable: &BoundVariable) -> CellId {
        match variable {
            BoundVariable::Lexical(variable) => self.variable(here, *variable),
            BoundVariable::Special(symbol) => self.cell(CellKey::Special(symbol.clone())),
        }
    }

    fn join(&mut self, here: CodePosition, from: NodeId, to: CellId) {
        let from = self.at(here.spot(from));
        self.copy(from, to);
    }

    fn evaluate(&mut self, here: CodePosition, node: NodeId) {
        let forms = self.forms;
        let form = &forms.forms[here.code.form as usize];
        let spot = here.spot(node);
        let value = self.at(spot);
        match form.kind(node) {
            NodeKind::Hole | NodeKind::Go(..) | NodeKind::Pass(_) | NodeKind::IsInstance(..) => {}
            NodeKind::Constant(datum) => self.constant(spot, value, datum),
            NodeKind::Local(variable) => {
                let from = self.variable(here, *variable);
                self.copy(from, value);
            }
            NodeKind::SetLocal(variable, from) => {
                let to = self.variable(here, *variable);
                self.join(here, *from, to);
                self.join(here, *from, value);
            }
            NodeKind::Special(symbol) => {
                for key in [CellKey::Special(symbol.clone()), CellKey::AnySpecial] {
                    let from = self.cell(key);
                    self.copy(from, value);
                }
                self.note(spot, NodeEffect::Mistake(mistake::NAME));
            }
            NodeKind::SetSpecial(symbol, from) => {
                let to = self.cell(CellKey::Special(symbol.clone()));
                self.join(here, *from, to);
                self.join(here, *from, value);
            }
            NodeKind::FunctionRef(symbol) => {
                let name = self.name(symbol);
                self.add(value, FlowValue::Function(name));
            }
            NodeKind::BuiltinRef(builtin) => {
                let name = self.name(&builtin.symbol());
                self.add(value, FlowValue::Function(name));
            }
            NodeKind::Lambda(lambda) => {
                let code = Code { lambda: *lambda, ..here.code };
                self.add(value, FlowValue::Closure(code));
            }
            NodeKind::If(_, then, otherwise) => {
                self.join(here, *then, value);
                self.join(here, *otherwise, value);
            }
            NodeKind::Progn(nodes) | NodeKind::And(nodes) => {
                if let Some(last) = nodes.last() {
                    self.join(here, *last, value);
                }
            }
            NodeKind::Or(nodes) | NodeKind::Values(nodes) => {
                for from in nodes {
                    self.join(here, *from, value);
                }
            }
            NodeKind::Let { bindings, body, .. } => {
                for (variable, from) in bindings {
                    let to = self.bound(here, variable);
                    self.join(here, *from, to);
                    if matches!(variable, BoundVariable::Special(symbol) if symbol.name() == "*%SUSPENSION-PROCEDURES*")
                    {
                        let list = self.at(here.spot(*from));
                        self.call_inside(spot, list, CallArguments::default(), Passing::Through);
                        // The allowance of the procedure.
                        self.fail(spot, "TIMEOUT");
                        self.fail(spot, "BUDGET-EXHAUSTED");
                    }
                }
                self.join(here, *body, value);
            }
            NodeKind::Functions { definitions, body } => {
                for (variable, lambda) in definitions {
                    let to = self.variable(here, *variable);
                    self.add(to, FlowValue::Closure(Code { lambda: *lambda, ..here.code }));
                }
                self.join(here, *body, value);
            }
            NodeKind::Block(_, body) | NodeKind::Mask(_, body) => self.join(here, *body, value),
            NodeKind::ReturnFrom(block, from) => {
                let to = self.at(here.spot(form.block_nodes[block.index()]));
                self.join(here, *from, to);
            }
            NodeKind::Tagbody(..) => {}
            NodeKind::Catch(_, body) => {
                let thrown = self.cell(CellKey::Thrown);
                self.copy(thrown, value);
                self.join(here, *body, value);
            }
            NodeKind::Throw(tag, from) => {
                // There may be no `catch`; a clause leaves for its own form.
                let is_of_clause = matches!(form.kind(*tag), NodeKind::Local(tag) if form.is_state(*tag));
                if !is_of_clause {
                    self.note(spot, NodeEffect::Mistake(mistake::PROGRAM));
                    self.note(spot, NodeEffect::Jump);
                }
                let thrown = self.cell(CellKey::Thrown);
                self.join(here, *from, thrown);
            }
            NodeKind::UnwindProtect(body, _)
            | NodeKind::FailureCleanup(body, _)
            | NodeKind::FirstValues(body, _) => {
                self.join(here, *body, value);
            }
            NodeKind::Progv(symbols, values, body) => {
                let values = self.at(here.spot(*values));
                let keys = match symbols_of(form, *symbols) {
                    Some(symbols) => symbols.into_iter().map(CellKey::Special).collect(),
                    None => vec![CellKey::AnySpecial],
                };
                for key in keys {
                    let to = self.cell(key);
                    self.watch(values, FlowWatcher::Contents(to));
                }
                self.join(here, *body, value);
            }
            NodeKind::Call(callee, arguments) => self.call(here, spot, callee, arguments, false),
            NodeKind::Apply(callee, arguments) => self.call(here, spot, callee, arguments, true),
            NodeKind::BindValues(variables, from, body) => {
                for variable in variables {
                    let to = self.bound(here, variable);
                    self.join(here, *from, to);
                }
                self.join(here, *body, value);
            }
            NodeKind::CallValues(function, from) => {
                let any = from.iter().map(|node| self.at(here.spot(*node))).collect();
                let arguments = CallArguments { any, ..CallArguments::default() };
                let function = self.at(here.spot(*function));
                self.call_values(spot, function, arguments, Some(value), Passing::Through, true);
            }
            NodeKind::HandlerCase(body, clauses) => {
                self.join(here, *body, value);
                for clause in clauses {
                    self.join(here, clause.body, value);
                    let variable = self.variable(here, clause.variable);
                    self.add(variable, FlowValue::Caught(spot));
                }
            }
            NodeKind::Handlers(list, body) => {
                self.join(here, *body, value);
                let condition = self.thing(ThingKey::Made(spot, u8::MAX - 1));
                let caught = self.cell(CellKey::Contents(condition));
                self.add(caught, FlowValue::Caught(spot));
                let arguments = CallArguments { any: vec![caught], ..CallArguments::default() };
                let list = self.at(here.spot(*list));
                self.call_inside(spot, list, arguments, Passing::Through);
            }
            NodeKind::Recovery { procedures, body, .. } => {
                self.join(here, *body, value);
                let thrown = self.cell(CellKey::Thrown);
                self.copy(thrown, value);
                if let NodeKind::Lambda(lambda) = form.kind(*procedures) {
                    let code = Code { lambda: *lambda, ..here.code };
                    self.run(code);
                    let result = self.cell(CellKey::Return(code));
                    let replacements = self.cell(CellKey::Replacements);
                    self.copy(result, replacements);
                    let takes_mistakes = |clause: &Clause| mistakes_named(clause.cause.name()) != (0, 0);
                    if form.clauses(node).iter().any(takes_mistakes) {
                        let replacements = self.cell(CellKey::ReplacementsOfMistakes);
                        self.copy(result, replacements);
                    }
                    let thing = self.thing(ThingKey::FailureArguments);
                    if let Some(parameter) = form.core.lambdas[lambda.index()].required.get(2) {
                        let variable =
                            self.cell(CellKey::Variable(code.form, parameter.variable, code.context));
                        self.add(variable, FlowValue::Thing(thing));
                    }
                }
            }
            NodeKind::Slot(class, number, _) => {
                for key in [CellKey::Slot(forms.base_class(class).clone(), *number), CellKey::SetByName] {
                    let from = self.cell(key);
                    self.copy(from, value);
                }
                self.note(spot, NodeEffect::Mistake(mistake::TYPE));
            }
            NodeKind::SetSlot(class, number, _, from) => {
                let to = self.cell(CellKey::Slot(forms.base_class(class).clone(), *number));
                let by_name = self.cell(CellKey::SlotsByName);
                for to in [to, by_name, value] {
                    self.join(here, *from, to);
                }
                self.note(spot, NodeEffect::Mistake(mistake::TYPE));
            }
        }
    }

    /// Has the symbols of a constant be values.
    fn constant(&mut self, spot: Spot, value: CellId, datum: &esl_bytecode::datum::Datum) {
        if let Some(symbol) = datum.as_symbol() {
            if self.is_interesting(symbol) {
                let name = self.name(symbol);
                self.add(value, FlowValue::Symbol(name));
            }
            return;
        }
        let mut symbols = symbols_inside(datum);
        symbols.retain(|symbol| self.is_interesting(symbol));
        if !symbols.is_empty() {
            // One object stands for all pairs of the constant.
            let is_flat = datum.elements().all(|item| !item.is_compound());
            let head = datum.as_cons().and_then(|(head, _)| head.as_symbol()).filter(|_| is_flat).cloned();
            let (first, contents) = if head.is_some() {
                self.make_exact(spot, 0, value)
            } else {
                let contents = self.make(spot, 0, value);
                (contents, contents)
            };
            let thing = self.thing(ThingKey::Made(spot, 0));
            self.add(contents, FlowValue::Thing(thing));
            for symbol in symbols {
                let name = self.name(&symbol);
                let to = if head.as_ref() == Some(&symbol) { first } else { contents };
                self.add(to, FlowValue::Symbol(name));
            }
        }
    }

    fn is_interesting(&self, symbol: &Symbol) -> bool {
        symbol.is_keyword() || self.interesting.contains(symbol)
    }

    fn call(&mut self, here: CodePosition, spot: Spot, callee: &Callee, nodes: &[NodeId], spreads: bool) {
        let forms = self.forms;
        let form = &forms.forms[here.code.form as usize];
        let mut arguments = CallArguments::default();
        let last = nodes.len().wrapping_sub(1);
        for (index, node) in nodes.iter().enumerate() {
            let cell = self.at(here.spot(*node));
            if spreads && index == last {
                arguments.lists.push(cell);
            } else {
                let keyword = form.symbol(*node).filter(|symbol| symbol.is_keyword()).cloned();
                arguments.given.push((cell, keyword));
            }
        }
        let value = self.at(spot);
        match callee {
            Callee::Local(variable) => {
                let function = self.variable(here, *variable);
                self.call_values(spot, function, arguments, Some(value), Passing::Through, false);
            }
            Callee::Value(function) => {
                let function = self.at(here.spot(*function));
                self.note(spot, NodeEffect::Mistake(mistake::TYPE | mistake::NAME | mistake::PROGRAM));
                self.call_values(spot, function, arguments, Some(value), Passing::Through, true);
            }
            Callee::Global(symbol) => self.call_named(spot, symbol, nodes, arguments, value),
            Callee::Builtin(builtin) => self.call_named(spot, &builtin.symbol(), nodes, arguments, value),
        }
    }

    /// Has the functions in a cell be called.
    pub(crate) fn call_values(
        &mut self,
        spot: Spot,
        function: CellId,
        arguments: CallArguments,
        result: Option<CellId>,
        passing: Passing,
        symbols: bool,
    ) {
        self.call_at(function, CallPoint { spot, arguments, result, passing, symbols });
    }

    /// Has the functions be called that are in the objects of a cell.
    pub(crate) fn call_inside(
        &mut self,
        spot: Spot,
        list: CellId,
        arguments: CallArguments,
        passing: Passing,
    ) {
        let inside = self.make_cell(spot);
        self.copy(list, inside);
        self.watch(list, FlowWatcher::AllContents(inside));
        self.call_values(spot, inside, arguments, None, passing, false);
    }

    /// Returns a cell of its own for the objects inside another.
    fn make_cell(&mut self, spot: Spot) -> CellId {
        let thing = self.thing(ThingKey::Made(spot, u8::MAX));
        self.cell(CellKey::Contents(thing))
    }
}

/// Returns the symbols in a constant list, or in a list of constants; `None` if it is another list.
fn symbols_of(form: &CoreForm, node: NodeId) -> Option<Vec<Symbol>> {
    match form.kind(node) {
        NodeKind::Constant(datum) => Some(symbols_inside(datum)),
        NodeKind::Call(Callee::Builtin(Builtin::List), items) => {
            items.iter().map(|item| form.symbol(*item).cloned()).collect()
        }
        _ => None,
    }
}
