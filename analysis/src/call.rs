//! Calls: of closures, of names, of functions of the library.

use esl_bytecode::symbol::Symbol;
use esl_compiler::core::{Callee, Lambda, NodeId, NodeKind};

use crate::effect::{FailureKind, NodeEffect, Reason, mistake};
use crate::flow::{CallArguments, CallPoint, FlowWatcher, Passing, ValueFlow};
use crate::value::{CellId, CellKey, Code, FlowValue, NameId, PointId, Spot, TaskKind, ThingKey, WorkKey};

/// Whether a symbol is one of the library.
pub(crate) fn is_of_library(symbol: &Symbol) -> bool {
    symbol.is_in("COMMON-LISP") || symbol.is_in("ESL")
}

/// Whether a function takes so many arguments.
fn takes(lambda: &Lambda, arguments: &CallArguments) -> bool {
    if !arguments.lists.is_empty() || !arguments.any.is_empty() {
        return true;
    }
    let count = arguments.given.len();
    let is_open = lambda.rest.is_some() || lambda.keys.is_some();
    lambda.required.len() <= count && (is_open || count <= lambda.required.len() + lambda.optional.len())
}

/// Whether a call is known to give as many arguments as a function takes, and keywords that it has.
fn has_known_keys(lambda: &Lambda, arguments: &CallArguments) -> bool {
    if !arguments.lists.is_empty() || !arguments.any.is_empty() {
        return false;
    }
    let Some(keys) = &lambda.keys else { return true };
    let further = arguments.given.get(lambda.required.len() + lambda.optional.len()..).unwrap_or_default();
    let is_known = |name: &Symbol| lambda.allow_other_keys || keys.iter().any(|key| key.key == *name);
    further.len() % 2 == 0 && further.chunks(2).all(|pair| pair[0].1.as_ref().is_some_and(is_known))
}

/// Arguments whose positions matter to functions of the library that are called as values.
const MOST_POSITIONS: usize = 3;

impl ValueFlow<'_> {
    /// Calls a global function by its name.
    pub(crate) fn call_named(
        &mut self,
        spot: Spot,
        symbol: &Symbol,
        nodes: &[NodeId],
        arguments: CallArguments,
        value: CellId,
    ) {
        let is_scripted = self.call_scripted(spot, symbol, value);
        if self.forms.defined.contains_key(symbol) {
            let function = self.cell(CellKey::Function(symbol.clone()));
            self.call_values(spot, function, arguments, Some(value), Passing::Through, false);
        } else if is_of_library(symbol) {
            self.call_library(spot, symbol, nodes, arguments, value);
        } else if !is_scripted {
            self.note(spot, NodeEffect::Mistake(mistake::NAME));
            self.fail_as_declared(spot, symbol);
            self.call_arguments(spot, &arguments, value, None);
        }
    }

    /// Calls a function that scripts of worlds answer. Returns whether it is one.
    fn call_scripted(&mut self, spot: Spot, symbol: &Symbol, value: CellId) -> bool {
        let is_scripted = self.forms.scripted.contains(symbol);
        if is_scripted {
            let name = self.name(symbol);
            let work = self.work(WorkKey::Scripted(name), TaskKind::Mock);
            self.works[work.index()].is_awaited = true;
            let answers = self.cell(CellKey::Answers(symbol.clone()));
            let arguments = CallArguments::default();
            self.call_values(spot, answers, arguments, Some(value), Passing::Task(work), false);
            self.note(spot, NodeEffect::Start(work));
            self.note(spot, NodeEffect::FailAs(work));
        }
        is_scripted
    }

    /// Fails as a function declares, or in an unknown way.
    pub(crate) fn fail_as_declared(&mut self, spot: Spot, symbol: &Symbol) {
        match self.forms.declared.get(symbol) {
            Some(declared) => {
                for cause in &declared.causes {
                    let kind = self.kind_of(cause);
                    self.note(spot, NodeEffect::Fail(kind));
                }
            }
            None => {
                let name = self.name(symbol);
                self.note(spot, NodeEffect::Fail(FailureKind::Unknown(name)));
            }
        }
    }

    /// Returns the kind of failure that a declared cause stands for.
    pub(crate) fn kind_of(&mut self, cause: &Symbol) -> FailureKind {
        match crate::cause::condition_of(self.forms, cause) {
            Some(condition) => FailureKind::Condition(self.name(&condition)),
            None => FailureKind::Below(self.name(cause)),
        }
    }

    /// Calls a value.
    pub(crate) fn call_value(&mut self, id: PointId, point: &CallPoint, value: FlowValue) {
        if self.calls_among_many(id, point, value) {
            return;
        }
        match value {
            FlowValue::Closure(code) => self.call_closure(point, code),
            FlowValue::Function(name) => self.call_by_name(point, name),
            FlowValue::Symbol(name) if point.symbols => self.call_by_name(point, name),
            FlowValue::AnySymbol if self.calls_a_value(point) => {
                self.note(point.spot, NodeEffect::Fail(FailureKind::Any(Reason::Code)));
            }
            FlowValue::HowToStart => {
                if let Some((begin, _)) = point.arguments.given.get(1).cloned() {
                    let (spot, result) = (point.spot, point.result);
                    // It takes a function that notes the end, or NIL.
                    let arguments =
                        CallArguments { any: vec![self.beside(spot)], ..CallArguments::default() };
                    self.call_values(spot, begin, arguments, result, point.passing, false);
                }
            }
            _ => {}
        }
    }

    /// Whether a call is one of a value that the program computes, as by `funcall`.
    fn calls_a_value(&self, point: &CallPoint) -> bool {
        let spot = point.spot;
        point.symbols
            && point.passing == Passing::Through
            && matches!(
                self.forms.forms[spot.form as usize].kind(spot.node),
                NodeKind::Call(Callee::Value(_), _) | NodeKind::Apply(Callee::Value(_), _)
            )
    }

    fn call_by_name(&mut self, point: &CallPoint, name: NameId) {
        let symbol = self.symbol(name).clone();
        if point.passing == Passing::Through {
            let value = point.result.unwrap_or_else(|| self.at(point.spot));
            self.call_scripted(point.spot, &symbol, value);
        }
        if self.forms.defined.contains_key(&symbol) {
            let function = self.cell(CellKey::Function(symbol));
            self.call_at(function, CallPoint { symbols: false, ..point.clone() });
        } else if is_of_library(&symbol) && point.passing == Passing::Through {
            // A name such as LIST is found among the causes too.
            let value = point.result.unwrap_or_else(|| self.at(point.spot));
            let mut arguments = point.arguments.clone();
            self.give_positions(point.spot, &mut arguments);
            self.call_library(point.spot, &symbol, &[], arguments, value);
        }
    }

    /// Has arguments without a position be those at the first ones, too.
    fn give_positions(&mut self, spot: Spot, arguments: &mut CallArguments) {
        if arguments.any.is_empty() && arguments.lists.is_empty() {
            return;
        }
        let open = self.thing(ThingKey::Made(spot, u8::MAX - 3));
        let open = self.cell(CellKey::Contents(open));
        for any in &arguments.any {
            self.copy(*any, open);
        }
        for list in &arguments.lists {
            self.watch(*list, FlowWatcher::Contents(open));
        }
        arguments.given.resize(arguments.given.len().max(MOST_POSITIONS), (open, None));
    }

    fn call_closure(&mut self, point: &CallPoint, code: Code) {
        let forms = self.forms;
        let lambda = &forms.forms[code.form as usize].core.lambdas[code.lambda.index()];
        let is_through = matches!(point.passing, Passing::Through | Passing::Interrupting);
        if !takes(lambda, &point.arguments) {
            if is_through {
                self.note(point.spot, NodeEffect::Mistake(mistake::PROGRAM));
            }
            return;
        }
        if is_through && !has_known_keys(lambda, &point.arguments) {
            self.note(point.spot, NodeEffect::Mistake(mistake::PROGRAM));
        }
        let code = Code { context: self.context_for(code, point.spot), ..code };
        self.run(code);
        let effect = match point.passing {
            Passing::Through => NodeEffect::Call(code),
            Passing::Interrupting => {
                self.note(point.spot, NodeEffect::InterruptsBy(code));
                NodeEffect::Call(code)
            }
            Passing::Absorbed => NodeEffect::Absorb(code),
            Passing::Task(work) => {
                let body = self.cell(CellKey::Body(work));
                self.add(body, FlowValue::Closure(code));
                NodeEffect::Body(work, code)
            }
        };
        self.note(point.spot, effect);
        self.bind(code, lambda, &point.arguments);
        if let Some(result) = point.result {
            let value = self.cell(CellKey::Return(code));
            self.copy(value, result);
        }
    }

    /// Has arguments flow to the parameters of a function.
    pub(crate) fn bind(&mut self, code: Code, lambda: &Lambda, arguments: &CallArguments) {
        let positional: Vec<_> = lambda
            .required
            .iter()
            .copied()
            .chain(lambda.optional.iter().map(|optional| optional.parameter))
            .collect();
        let count = positional.len();
        for (index, parameter) in positional.into_iter().enumerate() {
            match arguments.given.get(index) {
                Some((given, _)) => self.set_parameter(code, parameter, *given),
                None => self.bind_open(code, parameter, arguments),
            }
        }
        let further = arguments.given.get(count..).unwrap_or_default();
        if let Some(parameter) = lambda.rest {
            let thing = self.thing(ThingKey::Rest(code));
            let contents = self.cell(CellKey::Contents(thing));
            for (given, _) in further {
                self.copy(*given, contents);
            }
            for list in &arguments.lists {
                self.watch(*list, FlowWatcher::Contents(contents));
            }
            for any in &arguments.any {
                self.copy(*any, contents);
            }
            let variable = self.cell(CellKey::Variable(code.form, parameter.variable, code.context));
            self.add(variable, FlowValue::Thing(thing));
        }
        for key in lambda.keys.iter().flatten() {
            let parameter = key.optional.parameter;
            for (index, (given, _)) in further.iter().enumerate().skip(1) {
                let name = &further[index - 1].1;
                if name.as_ref().is_none_or(|name| *name == key.key) {
                    self.set_parameter(code, parameter, *given);
                }
            }
            self.bind_open(code, parameter, arguments);
        }
    }

    /// Has arguments without a position flow to a parameter.
    fn bind_open(&mut self, code: Code, parameter: esl_compiler::core::Parameter, arguments: &CallArguments) {
        for any in &arguments.any {
            self.set_parameter(code, parameter, *any);
        }
        if !arguments.lists.is_empty() {
            let thing = self.thing(ThingKey::Rest(code));
            let spread = self.cell(CellKey::Contents(thing));
            for list in &arguments.lists {
                self.watch(*list, FlowWatcher::Contents(spread));
            }
            self.set_parameter(code, parameter, spread);
        }
    }

    /// Calls the functions among the arguments of a call, as a function of the library may: those at
    /// `positions`, also by their names, or any closure if there are no positions.
    pub(crate) fn call_arguments(
        &mut self,
        spot: Spot,
        arguments: &CallArguments,
        value: CellId,
        positions: Option<&[usize]>,
    ) {
        let (inside, returned) = self.call_with_arguments(spot, arguments, value, positions);
        for (cell, _) in &arguments.given {
            self.copy(*cell, value);
        }
        for cell in arguments.lists.iter().chain(&arguments.any) {
            self.copy(*cell, value);
        }
        self.copy(inside, value);
        self.copy(inside, returned);
        self.copy(returned, value);
    }

    /// Does so, and puts an object with the values of the functions at `to`, and nothing else. Returns the
    /// cells of the contents of the arguments and of that object.
    pub(crate) fn call_with_arguments(
        &mut self,
        spot: Spot,
        arguments: &CallArguments,
        to: CellId,
        positions: Option<&[usize]>,
    ) -> (CellId, CellId) {
        let inside = self.thing(ThingKey::Made(spot, 1));
        let inside = self.cell(CellKey::Contents(inside));
        let returned = self.make(spot, 2, to);
        let cells: Vec<CellId> =
            arguments.given.iter().map(|(cell, _)| *cell).chain(arguments.lists.iter().copied()).collect();
        let any = arguments.any.clone();
        for cell in cells.iter().chain(&any) {
            self.watch(*cell, FlowWatcher::Contents(inside));
            self.watch(*cell, FlowWatcher::Parts);
        }
        // In one order, the function itself included: a function of the library that is called as a value,
        // with these arguments, then leads to the same call again, and not to another one.
        let mut passed: Vec<CellId> = cells.iter().chain(&any).copied().chain([inside, returned]).collect();
        passed.sort_unstable();
        passed.dedup();
        for (index, cell) in cells.iter().chain(&any).enumerate() {
            let is_other = positions.is_some_and(|positions| !positions.contains(&index));
            if is_other && index < arguments.given.len() {
                continue;
            }
            let given = CallArguments { any: passed.clone(), ..CallArguments::default() };
            let function = if arguments.lists.contains(cell) { inside } else { *cell };
            self.call_values(spot, function, given, Some(returned), Passing::Through, positions.is_some());
        }
        (inside, returned)
    }

    /// Fails with a value: a cause, or a condition.
    pub(crate) fn fail_with(&mut self, spot: Spot, value: FlowValue) {
        let effect = match value {
            FlowValue::Symbol(name) => {
                let symbol = self.symbol(name).clone();
                // A program that declares causes is warned of others by the compiler.
                let is_known = self.forms.parents.contains_key(&symbol)
                    || crate::library::all_causes().any(|cause| cause == symbol.name());
                if !is_known && (self.forms.declares_causes || !symbol.is_keyword()) {
                    return;
                }
                NodeEffect::Fail(FailureKind::Cause(name))
            }
            FlowValue::Condition(name) => NodeEffect::Fail(FailureKind::Condition(name)),
            FlowValue::Caught(guard) => NodeEffect::Again(guard),
            FlowValue::CauseOfCaught(guard) => NodeEffect::AgainByCause(guard),
            FlowValue::CauseOf(name) => NodeEffect::Fail(FailureKind::CauseOf(name)),
            FlowValue::EndOf(work) => {
                self.note(spot, NodeEffect::FailByCauseOf(work));
                NodeEffect::FailAs(work)
            }
            FlowValue::AnySymbol => NodeEffect::Fail(FailureKind::Any(Reason::Computed)),
            _ => return,
        };
        self.note(spot, effect);
    }

    /// Fails with the values of a cell.
    pub(crate) fn fail_with_cell(&mut self, spot: Spot, cell: CellId) {
        self.computed.push(spot);
        self.watch(cell, FlowWatcher::Fail(spot));
    }

    /// Has a spot fail for sure with this cause of the library.
    pub(crate) fn fail(&mut self, spot: Spot, cause: &str) {
        let name = self.name(&Symbol::keyword(cause));
        self.note(spot, NodeEffect::Fail(FailureKind::Cause(name)));
    }

    /// Has a spot fail for sure with this cause, which ends the code that it calls.
    pub(crate) fn interrupt(&mut self, spot: Spot, cause: &str) {
        self.fail(spot, cause);
        let name = self.name(&Symbol::keyword(cause));
        self.note(spot, NodeEffect::Interrupts(name));
    }

    /// Has a spot fail with a condition of a type of the library.
    pub(crate) fn fail_condition(&mut self, spot: Spot, condition: &str) {
        let name = self.name(&Symbol::cl(condition));
        self.note(spot, NodeEffect::Fail(FailureKind::Condition(name)));
    }
}
