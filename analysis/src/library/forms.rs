//! The functions that the library's macros for failures, limits, goals, locks and queries expand to.

use esl_bytecode::symbol::Symbol;
use esl_compiler::core::{NodeId, NodeKind};

use super::LibraryCall;
use crate::clause::can_end;
use crate::effect::{FailureKind, NodeEffect, Reason, mistake};
use crate::flow::{CallArguments, FlowWatcher, Passing, ValueFlow};
use crate::value::{CellId, CellKey, FlowValue, Spot, ThingKey};

impl ValueFlow<'_> {
    /// Looks at a call of a function of forms. Returns whether it is one.
    pub(super) fn call_of_form(&mut self, call: &LibraryCall<'_>) -> bool {
        let spot = call.spot;
        match call.name {
            "FUNCALL" | "APPLY" => self.call_first(call),
            "%FAIL-FOR" => {
                self.note_failure_arguments(&call.arguments);
                self.fail_by_argument(call);
            }
            "FAIL" => {
                self.note_failure_arguments(&call.arguments);
                match call.argument(0) {
                    Some(cause) => self.fail_with_cell(spot, cause),
                    None => self.fail_by_list(call),
                }
            }
            "%FAIL-BECAUSE-OF" => {
                self.note_failure_arguments(&call.arguments);
                match call.argument(1) {
                    Some(cause) => self.fail_with_cell(spot, cause),
                    None => self.fail_by_list(call),
                }
            }
            "ERROR" | "%FAIL-WITH" | "%FAIL-OUTWARD" | "%ASSERTION-FAILED" | "%OTHER-VALUE" => {
                self.error(call, 0)
            }
            "CERROR" => self.error(call, 1),
            "%CHECK-FAILED" | "%NO-CASE" | "%NO-CORRECT-CASE" => {
                self.note(spot, NodeEffect::Mistake(mistake::TYPE))
            }
            "%MAKE-SIGNALLED" | "MAKE-CONDITION" => {
                self.make_condition(call);
                match self.quoted(call, 0) {
                    Some(class) => {
                        let name = self.name(&class);
                        self.add(call.value, FlowValue::Condition(name));
                    }
                    None if self.is_text(call, 0) => {
                        let kind = self.quoted(call, 2).unwrap_or_else(|| Symbol::cl("SIMPLE-ERROR"));
                        let name = self.name(&kind);
                        self.add(call.value, FlowValue::Condition(name));
                    }
                    None => {
                        if let Some(from) = call.argument(0) {
                            self.copy(from, call.value);
                        }
                    }
                }
            }
            "%FAILED-ASSERTION" => {
                let name = self.name(&Symbol::cl("SIMPLE-ERROR"));
                self.add(call.value, FlowValue::Condition(name));
            }
            "FAILURE-CAUSE" => {
                if let Some(from) = call.argument(0) {
                    self.watch(from, FlowWatcher::Causes(call.value));
                }
            }
            "%FAIL-AS-SCRIPTED" => self.fail_by_first(call),
            "%CALL-WITH-LIMIT" => {
                self.call_argument(call, 2, &[]);
                if !self.is_absent(call, 0) {
                    self.interrupt(spot, "TIMEOUT");
                }
                if !self.is_absent(call, 1) {
                    self.interrupt(spot, "BUDGET-EXHAUSTED");
                }
            }
            "%CALL-WITH-QUOTA" => {
                self.call_argument(call, 1, &[]);
                self.interrupt(spot, "QUOTA-EXHAUSTED");
            }
            "%WAIT-UNTIL" => {
                self.call_argument(call, 0, &[]);
                self.may_time_out(call, 2);
            }
            "%WAIT-UNTIL-CHANGED" => {
                self.call_argument(call, 0, &[]);
                self.may_time_out(call, 1);
            }
            "%WAIT-UNTIL-FOR" => {
                self.call_argument(call, 0, &[]);
                self.may_time_out(call, 2);
            }
            "WAIT-FOR-EVENT" | "WAIT-FOR-EVENTS" => {
                if self.has_keyword(call, "TIMEOUT") {
                    self.fail(spot, "TIMEOUT");
                }
                let signals = self.cell(CellKey::Signals);
                if let Some((test, None)) = call.arguments.given.get(1).cloned() {
                    let arguments = CallArguments { any: vec![signals], ..CallArguments::default() };
                    self.call_values(spot, test, arguments, None, Passing::Through, true);
                }
                let lists: Vec<_> = call.arguments.lists.iter().chain(&call.arguments.any).copied().collect();
                for list in lists {
                    self.call_inside(spot, list, CallArguments::default(), Passing::Through);
                }
                if let Some(events) = call.argument(0) {
                    self.watch(events, FlowWatcher::Contents(call.value));
                }
                self.copy(signals, call.value);
            }
            "SIGNAL" | "SIGNAL-EVENT" | "REPORT-PROGRESS" => {
                let signals = self.cell(CellKey::Signals);
                self.store_all(call, signals);
                // `signal` is also that of conditions.
                if let Some(first) = call.argument(0) {
                    self.copy(first, call.value);
                }
            }
            "OPERATION-PROGRESS" => {
                let signals = self.cell(CellKey::Signals);
                self.copy(signals, call.value);
            }
            "FAILURE-ARGUMENTS" | "%FAILURE-ARGUMENTS" => {
                let thing = self.thing(ThingKey::FailureArguments);
                self.add(call.value, FlowValue::Thing(thing));
            }
            "%ADD-RULE" => {
                let rules = self.cell(CellKey::Rules);
                if let Some(query) = call.argument(1) {
                    self.watch(query, FlowWatcher::AllContents(rules));
                }
            }
            "%DEFINE-CONDITION" => {
                let forms = self.cell(CellKey::Methods(Symbol::esl("%CONDITION-INITFORMS")));
                for (from, _) in &call.arguments.given {
                    self.watch(*from, FlowWatcher::AllContents(forms));
                }
            }
            "NEXT-BINDINGS" => self.note(spot, NodeEffect::Jump),
            "%CALL-WITH-QUERY-BINDINGS" => {
                self.call_argument(call, 2, &[]);
                self.call_tests(call, 0);
                self.fail(spot, "NO-BINDINGS");
            }
            "%FIND-ANSWERS" => {
                self.call_tests(call, 0);
                let facts = self.cell(CellKey::Facts);
                self.copy(facts, call.value);
                let contents = self.make(spot, 3, call.value);
                self.copy(facts, contents);
            }
            "%ACHIEVE" => self.achieve(call),
            "%CALL-MAINTAINING" => {
                self.call_argument(call, 2, &[]);
                self.lock_property(call);
            }
            "%SUBSCRIBE-BY-HAND" => self.lock_property(call),
            "%CALL-WITH-RESOURCES" => self.with_resources(call),
            "%CALL-WITH-FLEET-RESOURCES" => {
                self.with_resources(call);
                self.interrupt(spot, "LEASE-LOST");
            }
            "%ACQUIRE" => {
                if self.quoted(call, 1).is_none_or(|denied| denied.name() == "FAIL") {
                    self.fail(spot, "RESOURCE-DENIED");
                }
                self.may_time_out(call, 2);
            }
            "FIND-RESTART" | "COMPUTE-RESTARTS" => {
                let tests = self.cell(CellKey::Slot(Symbol::cl("RESTART"), 3));
                let any = call.arguments.given.iter().map(|(cell, _)| *cell).collect();
                let arguments = CallArguments { any, ..CallArguments::default() };
                self.call_values(spot, tests, arguments, None, Passing::Through, true);
                self.return_parts(call);
            }
            "INVOKE-RESTART"
            | "INVOKE-RESTART-INTERACTIVELY"
            | "USE-VALUE"
            | "STORE-VALUE"
            | "CONTINUE"
            | "MUFFLE-WARNING" => {
                // The function of the restart, its test and its function for arguments.
                let chosen = self.beside(spot);
                for slot in [1, 3, 4] {
                    let from = self.cell(CellKey::Slot(Symbol::cl("RESTART"), slot));
                    self.copy(from, chosen);
                }
                let given = call.arguments.given.iter().map(|(cell, _)| *cell);
                let any = given.chain([call.value]).collect();
                let lists = call.arguments.lists.iter().chain(&call.arguments.any).copied().collect();
                let arguments = CallArguments { any, lists, ..CallArguments::default() };
                self.call_values(spot, chosen, arguments, Some(call.value), Passing::Through, true);
                self.note(spot, NodeEffect::Jump);
            }
            _ => return false,
        }
        true
    }

    /// Calls a function argument.
    pub(super) fn call_argument(&mut self, call: &LibraryCall<'_>, index: usize, given: &[usize]) {
        if let Some(function) = call.argument(index) {
            let given = given.iter().filter_map(|index| call.arguments.given.get(*index).cloned()).collect();
            let arguments = CallArguments { given, ..CallArguments::default() };
            self.call_values(call.spot, function, arguments, Some(call.value), Passing::Through, true);
        }
        let lists: Vec<_> = call.arguments.lists.iter().chain(&call.arguments.any).copied().collect();
        for list in lists {
            self.call_inside(call.spot, list, CallArguments::default(), Passing::Through);
        }
    }

    /// Calls the first argument with the others, in any order: this is a call of `funcall` as a value.
    fn call_first(&mut self, call: &LibraryCall<'_>) {
        let Some(function) = call.argument(0) else { return };
        let others = self.beside(call.spot);
        let arguments = &call.arguments;
        for (from, _) in arguments.given.iter().skip(1) {
            self.copy(*from, others);
            self.watch(*from, FlowWatcher::Contents(others));
        }
        for from in arguments.lists.iter().chain(&arguments.any) {
            self.copy(*from, others);
            self.watch(*from, FlowWatcher::Contents(others));
        }
        let arguments = CallArguments { any: vec![others], ..CallArguments::default() };
        self.call_values(call.spot, function, arguments, Some(call.value), Passing::Through, true);
    }

    /// Has all arguments flow to a cell.
    pub(super) fn store_all(&mut self, call: &LibraryCall<'_>, to: CellId) {
        for (from, _) in &call.arguments.given {
            self.copy(*from, to);
        }
        for list in call.arguments.lists.iter().chain(&call.arguments.any) {
            self.watch(*list, FlowWatcher::Contents(to));
        }
    }

    /// Makes a condition: its slots have the arguments, or the values of their initial forms.
    fn make_condition(&mut self, call: &LibraryCall<'_>) {
        let slots = self.cell(CellKey::Instances);
        self.store_all(call, slots);
        let forms = self.cell(CellKey::Methods(Symbol::esl("%CONDITION-INITFORMS")));
        let arguments = CallArguments::default();
        self.call_values(call.spot, forms, arguments, Some(slots), Passing::Through, false);
    }

    /// Calls the tests of a query, and those of rules.
    fn call_tests(&mut self, call: &LibraryCall<'_>, index: usize) {
        let rules = self.cell(CellKey::Rules);
        self.call_values(call.spot, rules, CallArguments::default(), None, Passing::Through, false);
        if let Some(query) = call.argument(index) {
            self.call_inside(call.spot, query, CallArguments::default(), Passing::Through);
        }
    }

    fn may_time_out(&mut self, call: &LibraryCall<'_>, index: usize) {
        if !self.is_absent(call, index) {
            self.fail(call.spot, "TIMEOUT");
        }
    }

    /// Fails with the cause that is the first argument.
    fn fail_by_argument(&mut self, call: &LibraryCall<'_>) {
        match self.quoted(call, 0) {
            Some(cause) => {
                let name = self.name(&cause);
                self.note(call.spot, NodeEffect::Fail(FailureKind::Cause(name)));
            }
            None => match call.argument(0) {
                Some(cause) => self.fail_with_cell(call.spot, cause),
                None => self.fail_by_list(call),
            },
        }
    }

    /// Fails with a cause in a list of all arguments.
    fn fail_by_list(&mut self, call: &LibraryCall<'_>) {
        let cause = self.beside(call.spot);
        let lists: Vec<_> = call.arguments.lists.iter().chain(&call.arguments.any).copied().collect();
        for list in lists {
            self.watch(list, FlowWatcher::First(cause));
        }
        self.fail_with_cell(call.spot, cause);
    }

    /// Fails with the first item of a constant list.
    fn fail_by_first(&mut self, call: &LibraryCall<'_>) {
        let form = &self.forms.forms[call.spot.form as usize];
        let node = call.nodes.first().map(|node| form.kind(*node));
        let cause = match node {
            Some(NodeKind::Constant(datum)) => {
                datum.as_cons().and_then(|(head, _)| head.as_symbol()).cloned()
            }
            _ => None,
        };
        match cause {
            Some(cause) => {
                let name = self.name(&cause);
                self.note(call.spot, NodeEffect::Fail(FailureKind::Cause(name)));
            }
            None => self.note(call.spot, NodeEffect::Fail(FailureKind::Any(Reason::Computed))),
        }
    }

    /// Fails with the condition that an argument designates.
    fn error(&mut self, call: &LibraryCall<'_>, index: usize) {
        self.make_condition(call);
        if self.is_text(call, index) {
            self.fail_condition(call.spot, "SIMPLE-ERROR");
        } else if let Some(class) = self.quoted(call, index) {
            let name = self.name(&class);
            self.note(call.spot, NodeEffect::Fail(FailureKind::Condition(name)));
        } else if let Some(condition) = call.argument(index) {
            self.watch(condition, FlowWatcher::Fail(call.spot));
            self.computed.push(call.spot);
        } else {
            self.fail_condition(call.spot, "SIMPLE-ERROR");
        }
    }

    /// Looks at `(%achieve 'name #'name arguments)`.
    fn achieve(&mut self, call: &LibraryCall<'_>) {
        let spot = call.spot;
        self.call_argument(call, 2, &[]);
        let given = self.beside(spot);
        if let Some(arguments) = call.argument(2) {
            self.watch(arguments, FlowWatcher::ValuesOf(given));
        }
        let arguments = CallArguments { lists: vec![given], ..CallArguments::default() };
        if let Some(function) = call.argument(1) {
            self.call_values(spot, function, arguments.clone(), None, Passing::Through, false);
        }
        let Some(name) = self.quoted(call, 0) else { return };
        let methods = self.cell(CellKey::Property(name.clone(), Symbol::esl("%ACHIEVE")));
        self.call_values(spot, methods, arguments, None, Passing::Through, false);
        if !self.always_has_method(&name) {
            self.fail(spot, "NO-APPLICABLE-METHOD");
        }
        self.fail(spot, "CONDITION-NOT-ACHIEVED");
    }

    /// Whether each definition of how to achieve `name` ends with a method that is always applicable.
    fn always_has_method(&self, name: &Symbol) -> bool {
        let mut found = 0;
        for form in &self.forms.forms {
            for node in &form.core.nodes {
                let NodeKind::Call(_, arguments) = &node.kind else { continue };
                let [named, indicator, function] = arguments.as_slice() else { continue };
                let is_it = form.symbol(*named) == Some(name)
                    && form.symbol(*indicator).is_some_and(|symbol| symbol.name() == "%ACHIEVE");
                let NodeKind::Lambda(lambda) = form.kind(*function) else { continue };
                if is_it {
                    if may_be_nil(&form.core, form.core.lambdas[lambda.index()].body) {
                        return false;
                    }
                    found += 1;
                }
            }
        }
        found > 0
    }

    /// Looks at a subscription to the lock of the property whose key is the first argument.
    fn lock_property(&mut self, call: &LibraryCall<'_>) {
        let spot = call.spot;
        if let Some(key) = call.argument(0) {
            let names = self.beside(spot);
            self.watch(key, FlowWatcher::Contents(names));
            self.watch(names, FlowWatcher::Lock(spot));
        }
        self.fail(spot, "PROPERTY-LOCK-UNAVAILABLE");
        self.fail(spot, "CONDITION-NOT-ACHIEVED");
        self.interrupt(spot, "MAINTAINED-PROPERTY-VIOLATION");
        self.interrupt(spot, "UNRECOVERABLE-PROPERTY-VIOLATION");
    }

    /// Achieves the property `value` for a lock: a failure of its methods is one of the condition then.
    pub(crate) fn lock(&mut self, spot: Spot, value: FlowValue) {
        let FlowValue::Symbol(name) = value else { return };
        let symbol = self.symbol(name).clone();
        let methods = self.cell(CellKey::Property(symbol, Symbol::esl("%ACHIEVE")));
        // The arguments are in the key, as the name is.
        let arguments = CallArguments { any: vec![self.beside(spot)], ..CallArguments::default() };
        self.call_values(spot, methods, arguments, None, Passing::Absorbed, false);
    }

    fn with_resources(&mut self, call: &LibraryCall<'_>) {
        self.call_argument(call, 1, &[]);
        let form = &self.forms.forms[call.spot.form as usize];
        let mut pending: Vec<NodeId> = call.nodes.first().copied().into_iter().collect();
        let mut words = Vec::new();
        while let Some(node) = pending.pop() {
            words.extend(form.symbol(node).map(|symbol| symbol.name().to_string()));
            esl_compiler::children(form.kind(node), &mut |child| pending.push(child));
        }
        let has = |word: &str| call.nodes.is_empty() || words.iter().any(|known| known == word);
        for (word, cause) in [("TIMEOUT", "TIMEOUT"), ("IF-DENIED", "RESOURCE-DENIED")] {
            if has(word) {
                self.fail(call.spot, cause);
            }
        }
        if has("PREEMPTIBLE") {
            self.interrupt(call.spot, "RESOURCE-PREEMPTED");
        }
    }
}

/// Whether the value of a node, that of the clauses of `cond`, may be `NIL`.
fn may_be_nil(core: &esl_compiler::core::Core, node: NodeId) -> bool {
    let mut pending = vec![node];
    while let Some(node) = pending.pop() {
        match &core.nodes[node.index()].kind {
            NodeKind::If(_, then, otherwise) => pending.extend([*then, *otherwise]),
            NodeKind::Progn(nodes) => pending.extend(nodes.last()),
            NodeKind::Let { body, .. } | NodeKind::Block(_, body) | NodeKind::BindValues(_, _, body) => {
                pending.push(*body);
            }
            NodeKind::Constant(datum) if !datum.is_nil() => {}
            _ if !can_end(core, node, &|_| false) => {}
            _ => return true,
        }
    }
    false
}
