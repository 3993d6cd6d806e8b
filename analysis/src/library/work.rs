//! The functions that the library's macros for tasks, operations, mocks and worlds expand to.

use esl_bytecode::builtin::Builtin;
use esl_bytecode::symbol::Symbol;
use esl_compiler::core::{Callee, NodeId, NodeKind};

use super::LibraryCall;
use crate::effect::NodeEffect;
use crate::flow::{CallArguments, FlowWatcher, Passing, ValueFlow};
use crate::forms::script_nodes;
use crate::value::{CellId, CellKey, FlowValue, Spot, TaskKind, ThingKey, WorkId, WorkKey};

impl ValueFlow<'_> {
    /// Begins a task at a spot that runs the functions in a cell.
    fn begin(&mut self, spot: Spot, part: u8, kind: TaskKind, function: CellId) -> WorkId {
        let work = self.work(WorkKey::Begun(spot, part), kind);
        self.note(spot, NodeEffect::Start(work));
        self.call_values(spot, function, CallArguments::default(), None, Passing::Task(work), false);
        work
    }

    /// Looks at a call of a function of tasks and operations. Returns whether it is one.
    pub(super) fn call_of_work(&mut self, call: &LibraryCall<'_>) -> bool {
        let spot = call.spot;
        match call.name {
            "%SPAWN" => {
                let Some(function) = call.argument(0) else { return true };
                let work = self.begin(spot, 0, TaskKind::Spawned, function);
                self.add(call.value, FlowValue::Work(work));
                let form = &self.forms.forms[spot.form as usize];
                if !self.is_absent(call, 3) && form.spawn_option(spot.node, "BUDGET").is_some() {
                    let name = self.name(&Symbol::keyword("BUDGET-EXHAUSTED"));
                    self.note(spot, NodeEffect::Limit(work, name));
                }
            }
            "%SPAWN-NET" => {
                let contents = self.make(spot, 0, call.value);
                for index in 2..call.arguments.given.len() {
                    let Some(function) = call.argument(index) else { continue };
                    let work = self.begin(spot, index.min(250) as u8, TaskKind::Part, function);
                    self.works[work.index()].is_awaited = true;
                    self.add(contents, FlowValue::Work(work));
                    self.add(call.value, FlowValue::Work(work));
                }
            }
            "%AWAIT-NET" => {
                // Without statuses it waits for all ends, and returns no task.
                if let Some(net) = call.argument(0).filter(|_| !self.is_absent(call, 1)) {
                    self.watch(net, FlowWatcher::Contents(call.value));
                }
            }
            "%FAIL-AS" => self.fail_as(call),
            "%END-LIKE" => {
                if !self.has_succeeded(spot) {
                    self.fail_as(call);
                    if self.forms.aborts {
                        self.fail(spot, "ABORTED");
                    }
                }
                self.values_of(call);
            }
            "%TASK-VALUE" => self.values_of(call),
            "WAIT-FOR-TASK" | "%TASK-END" => {
                let thing = self.thing(ThingKey::FailureArguments);
                self.add(call.value, FlowValue::Thing(thing));
                if let Some(task) = call.argument(0) {
                    self.watch(task, FlowWatcher::Ends(call.value));
                }
            }
            "%FAIL-ALL" => {
                let name = self.name(&Symbol::keyword("ALL-FAILED"));
                self.note(spot, NodeEffect::FailAllWith(name));
                if let Some(tasks) = call.argument(0) {
                    self.watch(tasks, FlowWatcher::FailAll(spot));
                    let inside = self.beside(spot);
                    self.watch(tasks, FlowWatcher::Contents(inside));
                    self.watch(inside, FlowWatcher::FailAll(spot));
                }
            }
            "%NEW-CHILD" => {
                if let Some(function) = call.argument(1) {
                    let work = self.begin(spot, 0, TaskKind::Child, function);
                    self.works[work.index()].is_awaited = true;
                }
            }
            "%SUPERVISE" => self.fail(spot, "RESTARTS-EXHAUSTED"),
            "%CALL-GUARDED" => {
                if let Some(guard) = call.argument(0) {
                    let work = self.begin(spot, 0, TaskKind::Guard, guard);
                    self.works[work.index()].is_awaited = true;
                }
                if let Some(alarm) = call.argument(1) {
                    let arguments = CallArguments::default();
                    self.call_values(spot, alarm, arguments, None, Passing::Interrupting, true);
                }
                self.call_argument(call, 2, &[]);
            }
            "%DEFINE-TEST" => {
                if let Some(list) = call.argument(0) {
                    let inside = self.make(spot, 1, call.value);
                    self.watch(list, FlowWatcher::AllContents(inside));
                    self.begin(spot, 0, TaskKind::Test, inside);
                }
            }
            "%CALL-IN-WORLD" => self.world(call),
            "%BEGIN-MOCK" => {
                if let Some(function) = call.argument(1) {
                    let work = self.begin(spot, 0, TaskKind::Mock, function);
                    self.works[work.index()].is_awaited = true;
                    self.add(call.value, FlowValue::Work(work));
                }
            }
            "%BEGIN-OPERATION" => {
                if let Some(symbol) = self.quoted(call, 0) {
                    let name = self.name(&symbol);
                    let work = self.work(WorkKey::Host(name), TaskKind::Host);
                    self.works[work.index()].is_awaited = true;
                    self.add(call.value, FlowValue::Work(work));
                }
            }
            "%CALL-HOST" => match self.quoted(call, 0) {
                Some(symbol) => self.fail_as_declared(spot, &symbol),
                None => self.fail_as_declared(spot, &Symbol::esl("%CALL-HOST")),
            },
            "%PERFORM" => self.perform(call, 0),
            "%PERFORM-EXCLUSIVELY" => {
                if self.quoted(call, 0).is_none_or(|name| self.forms.exclusive.contains(&name)) {
                    self.perform(call, 2);
                    self.fail(spot, "OPERATION-BUSY");
                    self.fail(spot, "SUPERSEDED");
                }
            }
            "%STARTER" => {
                if let Some(symbol) = self.quoted(call, 0) {
                    let starter = self.cell(CellKey::Property(symbol, Symbol::esl("%STARTER")));
                    self.copy(starter, call.value);
                }
            }
            "%STARTING" => {
                self.add(call.value, FlowValue::HowToStart);
                if self.quoted(call, 0).is_none_or(|name| self.forms.exclusive.contains(&name)) {
                    self.fail(spot, "OPERATION-BUSY");
                }
            }
            "OPERATION-RESULT" => {
                self.fail_as(call);
                self.values_of(call);
                self.fail(spot, "CANCELLED");
            }
            "%SET-FUNCTION" | "%SET-FUNCTION-NAMED" | "(SETF FDEFINITION)" | "(SETF SYMBOL-FUNCTION)" => {
                if let (Some(name), Some(function)) = (self.quoted_function(call, 0), call.argument(1)) {
                    let to = self.cell(CellKey::Function(name));
                    self.copy(function, to);
                }
            }
            "%ADD-METHOD" => {
                if let Some(name) = self.quoted_function(call, 0) {
                    let to = self.cell(CellKey::Methods(name));
                    for (from, _) in &call.arguments.given {
                        self.copy(*from, to);
                    }
                }
            }
            "%ENSURE-GENERIC" => {
                if let Some(name) = self.quoted_function(call, 0) {
                    let name = self.name(&name);
                    self.add(call.value, FlowValue::Generic(name));
                }
            }
            "%FIND-METHODS" => {
                let contents = self.make(spot, 0, call.value);
                if let Some(generic) = call.argument(0) {
                    self.watch(generic, FlowWatcher::Methods(contents));
                }
                self.call_protocol(call, &["NO-APPLICABLE-METHOD"]);
            }
            "%DEFINE-CLASS" => {
                let forms = self.cell(CellKey::Methods(Symbol::esl("%INITFORMS")));
                for (from, _) in &call.arguments.given {
                    self.watch(*from, FlowWatcher::AllContents(forms));
                }
            }
            "MAKE-INSTANCE" | "CHANGE-CLASS" | "REINITIALIZE-INSTANCE" => {
                let to = self.cell(CellKey::Instances);
                self.store_all(call, to);
                for name in [
                    "%INITFORMS",
                    "INITIALIZE-INSTANCE",
                    "SHARED-INITIALIZE",
                    "REINITIALIZE-INSTANCE",
                    "UPDATE-INSTANCE-FOR-DIFFERENT-CLASS",
                ] {
                    let symbol = if name.starts_with('%') { Symbol::esl(name) } else { Symbol::cl(name) };
                    let methods = self.cell(CellKey::Methods(symbol));
                    let any = call.arguments.given.iter().map(|(cell, _)| *cell).collect();
                    let arguments = CallArguments { any, ..CallArguments::default() };
                    self.call_values(spot, methods, arguments, Some(to), Passing::Through, false);
                }
            }
            _ => return false,
        }
        true
    }

    /// Whether a spot is reached only if a task has succeeded: it is the consequent of such a test.
    fn has_succeeded(&self, spot: Spot) -> bool {
        let form = &self.forms.forms[spot.form as usize];
        let is_test = |node: NodeId| match form.kind(node) {
            NodeKind::Call(_, arguments) => {
                matches!(
                    form.kind(arguments.first().copied().unwrap_or(node)),
                    NodeKind::Call(Callee::Builtin(Builtin::TaskEnd), _)
                ) && arguments
                    .get(1)
                    .and_then(|node| form.symbol(*node))
                    .is_some_and(|one| one.name() == "SUCCEEDED")
            }
            _ => false,
        };
        let is_inside = |root: NodeId| {
            let mut pending = vec![root];
            while let Some(node) = pending.pop() {
                if node == spot.node {
                    return true;
                }
                esl_compiler::children(form.kind(node), &mut |child| pending.push(child));
            }
            false
        };
        form.core.nodes[..spot.node.index()].iter().any(|node| match &node.kind {
            NodeKind::If(test, then, _) => is_test(*test) && is_inside(*then),
            _ => false,
        })
    }

    fn fail_as(&mut self, call: &LibraryCall<'_>) {
        if let Some(task) = call.argument(0) {
            self.watch(task, FlowWatcher::FailAs(call.spot));
        }
    }

    fn values_of(&mut self, call: &LibraryCall<'_>) {
        if let Some(task) = call.argument(0) {
            self.watch(task, FlowWatcher::ValuesOf(call.value));
        }
    }

    /// Performs the operation that a function argument begins.
    fn perform(&mut self, call: &LibraryCall<'_>, index: usize) {
        let handles = self.beside(call.spot);
        if let Some(begin) = call.argument(index) {
            self.call_values(
                call.spot,
                begin,
                CallArguments::default(),
                Some(handles),
                Passing::Through,
                true,
            );
        }
        self.watch(handles, FlowWatcher::FailAs(call.spot));
        self.watch(handles, FlowWatcher::ValuesOf(call.value));
    }

    /// Looks at `with-world`: its clauses are tasks, its answers are those of operations.
    fn world(&mut self, call: &LibraryCall<'_>) {
        let spot = call.spot;
        self.call_argument(call, 2, &[]);
        let form = &self.forms.forms[spot.form as usize];
        if let Some(list) = call.nodes.first() {
            for parts in script_nodes(form, *list) {
                let Some(name) = form.symbol(parts[0]).cloned() else { continue };
                let answers = self.cell(CellKey::Answers(name));
                for part in &parts[2..4] {
                    let answer = self.at(Spot { node: *part, ..spot });
                    self.copy(answer, answers);
                }
            }
        }
        for (index, part) in [(1, 10), (3, 11)] {
            if let Some(list) = call.argument(index) {
                let inside = self.make(spot, part, call.value);
                self.watch(list, FlowWatcher::Contents(inside));
                if index == 3 {
                    // These are functions that return the function of a task.
                    let functions = self.make(spot, part + 1, call.value);
                    self.call_values(
                        spot,
                        inside,
                        CallArguments::default(),
                        Some(functions),
                        Passing::Through,
                        false,
                    );
                    self.begin(spot, part, TaskKind::World, functions);
                } else {
                    self.begin(spot, part, TaskKind::World, inside);
                }
            }
        }
    }
}
