//! The table: which failures leave each function and each task, and which clauses take which.

use std::cell::OnceCell;
use std::collections::{BTreeMap, BTreeSet};

use esl_bytecode::compile::MODULE_SOURCES;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::{Symbol, symbol_of_setf_cell};
use esl_compiler::core::{LambdaId, NodeId, NodeKind};
use esl_compiler::diagnostic::Sources;
use rustc_hash::{FxHashMap, FxHashSet};

use crate::cause::{MISTAKES, cause_of_condition, shown_cause};
use crate::declared::{SCRIPTED, declared};
use crate::effect::{FailureKind, Reason, mistake};
use crate::flow::ValueFlow;
use crate::folded::FoldedModules;
use crate::forms::{CoreForms, ScopeKind};
use crate::guard::{FailureId, LeavingFailures};
use crate::row::{CauseRow, CodePlace, FailingTask, FailureOrigin, FailureTable, FunctionRow};
use crate::solve::{Solution, bodies_of_works};
use crate::value::{Code, NO_CONTEXT, TaskKind, WorkKey};

/// The maker of the table.
pub(crate) struct Maker<'m, 'f> {
    pub(crate) flow: &'m ValueFlow<'f>,
    pub(crate) solution: &'m Solution,
    pub(crate) folded: FoldedModules,
    pub(crate) sources: &'m Sources,
    /// Whether programming errors are listed.
    pub(crate) all: bool,
    /// Numbers of the pieces of code of each lambda.
    pub(crate) numbers: FxHashMap<(u32, LambdaId), Vec<usize>>,
}

/// Returns the numbers of the pieces of code of each lambda.
pub(crate) fn numbers_of(flow: &ValueFlow<'_>) -> FxHashMap<(u32, LambdaId), Vec<usize>> {
    let mut numbers: FxHashMap<(u32, LambdaId), Vec<usize>> = FxHashMap::default();
    for (number, running) in flow.running.iter().enumerate() {
        numbers.entry((running.code.form, running.code.lambda)).or_default().push(number);
    }
    numbers
}

impl Maker<'_, '_> {
    /// Returns the place of a node.
    pub(crate) fn place(&self, form: u32, node: NodeId) -> CodePlace {
        let span = self.flow.forms.forms[form as usize].core.nodes[node.index()].span;
        self.place_of(span)
    }

    /// Returns the range of the body of a clause. The parts of a macro have the range of its call; then it is
    /// that of the first part with a range of its own.
    pub(crate) fn span_of_clause(&self, form: u32, scope: usize, body: NodeId) -> Span {
        let text = &self.flow.forms.forms[form as usize];
        let span_of = |node: NodeId| text.core.nodes[node.index()].span;
        let is_own = |of: NodeId| of != body && span_of(of) != span_of(body);
        match text.scopes[scope].kind.node() {
            Some(of) if is_own(of) => span_of(body),
            _ => self.span_inside(form, body),
        }
    }

    /// Returns the range of the first part of a node that has a range of its own.
    pub(crate) fn span_inside(&self, form: u32, node: NodeId) -> Span {
        let text = &self.flow.forms.forms[form as usize];
        let whole = text.core.nodes[node.index()].span;
        let mut best: Option<Span> = None;
        let mut pending = vec![node];
        while let Some(node) = pending.pop() {
            let span = text.core.nodes[node.index()].span;
            let is_better = best.is_none_or(|best| (span.start, best.end) < (best.start, span.end));
            if whole.contains(span) && span != whole && span.end > span.start && is_better {
                best = Some(span);
            }
            esl_compiler::children(text.kind(node), &mut |child| pending.push(child));
            if let NodeKind::Lambda(lambda) = text.kind(node) {
                pending.push(text.core.lambdas[lambda.index()].body);
            }
        }
        best.unwrap_or(whole)
    }

    /// Returns the place of a range.
    pub(crate) fn place_of(&self, span: Span) -> CodePlace {
        let source = self.sources.name(span.source).unwrap_or_default().to_string();
        match self.sources.place(span) {
            Some(place) => CodePlace { source, line: place.line, column: place.column },
            None => CodePlace { source, line: 0, column: 0 },
        }
    }

    /// Returns the name of the function around a lambda.
    pub(crate) fn function_around(&self, form: u32, lambda: LambdaId) -> String {
        let core = &self.flow.forms.forms[form as usize].core;
        let mut current = Some(lambda);
        let mut inner: Option<String> = None;
        while let Some(lambda) = current {
            let text = &core.lambdas[lambda.index()];
            if let Some(name) = &text.name {
                let shown = name.to_string().to_lowercase();
                if name.as_symbol().is_some() || shown.starts_with("(setf") {
                    return shown;
                }
                if inner.is_none() && is_telling(&shown) {
                    inner = Some(shown);
                }
            }
            current = text.parent;
        }
        inner.unwrap_or_else(|| "the top level".into())
    }

    /// Returns the text of a cause.
    pub(crate) fn cause(&self, kind: FailureKind) -> String {
        match kind {
            FailureKind::Cause(name) => shown_cause(self.flow.symbol(name)),
            FailureKind::Below(name) => {
                let symbol = self.flow.symbol(name);
                let has_kinds = self.flow.forms.parents.values().any(|parents| parents.contains(symbol));
                let kinds = if has_kinds { " (or a kind of it)" } else { "" };
                shown_cause(symbol) + kinds
            }
            FailureKind::Condition(name) | FailureKind::CauseOf(name) => {
                shown_cause(&cause_of_condition(self.flow.symbol(name)))
            }
            FailureKind::Any(Reason::Computed) => "any (a computed cause)".into(),
            FailureKind::Any(Reason::Code) => "any (code that is made at run time)".into(),
            FailureKind::Unknown(name) => {
                format!("unknown ({} declares no failures)", shown_function(self.flow.symbol(name)))
            }
        }
    }

    /// Returns a cause, if it is known.
    fn name_of_cause(&self, kind: FailureKind) -> Option<Symbol> {
        match kind {
            FailureKind::Cause(name) | FailureKind::Below(name) => Some(self.flow.symbol(name).clone()),
            FailureKind::Condition(name) | FailureKind::CauseOf(name) => {
                Some(cause_of_condition(self.flow.symbol(name)))
            }
            FailureKind::Any(_) | FailureKind::Unknown(_) => None,
        }
    }

    fn origin(&self, form: u32, node: NodeId) -> FailureOrigin {
        let text = &self.flow.forms.forms[form as usize];
        let span = text.core.nodes[node.index()].span;
        FailureOrigin {
            place: self.place(form, node),
            function: self.function_around(form, text.owners[node.index()]),
            range: (span.source.0, span.start, span.end),
        }
    }

    /// Returns rows of failures, by their causes. Those that begin in modules begin where code that `codes`
    /// reach calls these.
    pub(crate) fn rows(
        &self,
        failures: impl IntoIterator<Item = FailureId>,
        mistakes: u8,
        codes: &[Code],
    ) -> Vec<CauseRow> {
        let mut by_cause: BTreeMap<String, (Option<Symbol>, BTreeSet<FailureOrigin>)> = BTreeMap::new();
        let reached = OnceCell::new();
        for failure in failures {
            let failing = self.solution.failures.keys[failure as usize];
            let entry = by_cause.entry(self.cause(failing.kind)).or_default();
            entry.0 = self.name_of_cause(failing.kind);
            let mut places: FxHashSet<(u32, NodeId)> = FxHashSet::default();
            if self.folded.is_of_module(failing.form) {
                let reached = reached.get_or_init(|| self.reach(codes.to_vec()));
                let entries = self.folded.entries(failure, reached);
                places.extend(entries.map(|(number, node)| (self.flow.running[number].code.form, node)));
            }
            if places.is_empty() {
                places.insert((failing.form, failing.node));
            }
            entry.1.extend(places.into_iter().map(|(form, node)| self.origin(form, node)));
        }
        let row = |(cause, (name, origins)): (String, (Option<Symbol>, BTreeSet<FailureOrigin>))| CauseRow {
            cause,
            name,
            origins: origins.into_iter().collect(),
            spent: Vec::new(),
            is_mistake: false,
        };
        let mut rows: Vec<CauseRow> = by_cause.into_iter().map(row).collect();
        if self.all {
            let kinds = MISTAKES.iter().filter(|(kind, _)| mistakes & kind != 0);
            rows.extend(kinds.map(|(kind, cause)| {
                let name = Symbol::keyword(cause);
                let remark = if *kind == mistake::CAUSE { " (as a cause)" } else { "" };
                CauseRow {
                    cause: shown_cause(&name) + remark,
                    name: Some(name),
                    origins: Vec::new(),
                    spent: Vec::new(),
                    is_mistake: true,
                }
            }));
        }
        rows
    }

    pub(crate) fn rows_of(&self, leaving: &LeavingFailures, codes: &[Code]) -> Vec<CauseRow> {
        self.rows(leaving.failures.iter().copied(), leaving.mistakes, codes)
    }

    /// Whether a source is one of the program's own, not of a module that comes with the system.
    pub(crate) fn is_own(&self, source: &str) -> bool {
        !source.starts_with(MODULE_SOURCES)
    }

    /// Makes the table.
    pub(crate) fn table(&self) -> FailureTable {
        let clauses = self.clauses();
        let by_scope: FxHashMap<(u32, usize, usize), usize> =
            clauses.iter().enumerate().map(|(index, (key, _))| (*key, index)).collect();
        let mut table = FailureTable {
            functions: self.functions(),
            tasks: self.tasks(&by_scope),
            clauses: clauses.into_iter().map(|(_, row)| row).collect(),
            forms: self.handling_forms(),
            goals: self.goals(),
            of_modules: self.of_modules(),
            declared: declared(self.flow.forms),
            findings: self.findings(),
            crowded: self.crowded(),
            is_incomplete: false,
        };
        table.findings.extend(self.unhandled(&table.tasks));
        table.findings.extend(self.advice());
        table.findings.extend(crate::orders::findings(self.flow));
        table
    }

    /// Returns the places that call too many functions.
    fn crowded(&self) -> Vec<CodePlace> {
        let places = self.flow.many.places.iter().map(|(form, node)| self.place(*form, *node));
        places.collect::<BTreeSet<CodePlace>>().into_iter().collect()
    }

    /// Returns the causes that may leave functions of modules that come with the system.
    fn of_modules(&self) -> BTreeMap<String, Vec<Symbol>> {
        let mut rows: BTreeMap<String, Vec<Symbol>> = BTreeMap::new();
        for (name, (form, node)) in &self.flow.forms.defined {
            if name.name().starts_with('%') || self.is_own(&self.place(*form as u32, *node).source) {
                continue;
            }
            let Some(leaving) = self.leaving_of(*form as u32, *node) else { continue };
            let causes =
                self.rows(leaving.failures.iter().copied(), 0, &[]).into_iter().filter_map(|row| row.name);
            rows.entry(shown_function(name)).or_default().extend(causes);
        }
        rows.retain(|_, causes| !causes.is_empty());
        rows
    }

    fn functions(&self) -> Vec<FunctionRow> {
        let mut rows = Vec::new();
        for (name, (form, node)) in &self.flow.forms.defined {
            let place = self.place(*form as u32, *node);
            if !self.is_own(&place.source) {
                continue;
            }
            let Some(leaving) = self.leaving_of(*form as u32, *node) else { continue };
            let lambda = self.lambda_defined(*form, *node);
            let fails_as_arguments =
                lambda.is_some_and(|lambda| self.flow.calls_arguments.contains(&(*form as u32, lambda.0)));
            let causes = self.rows_of(&leaving, &self.codes_of(*form as u32, *node));
            let span = self.flow.forms.forms[*form].core.nodes[node.index()].span;
            let last = Span { start: span.end.saturating_sub(1).max(span.start), ..span };
            let last_line = self.sources.place(last).map_or(place.line, |place| place.line);
            let name = shown_function(name);
            rows.push(FunctionRow { name, place, last_line, causes, fails_as_arguments });
        }
        rows.sort_by(|left, right| (&left.place, &left.name).cmp(&(&right.place, &right.name)));
        rows
    }

    pub(crate) fn lambda_defined(&self, form: usize, node: NodeId) -> Option<LambdaId> {
        let form = &self.flow.forms.forms[form];
        let NodeKind::Call(_, arguments) = form.kind(node) else { return None };
        match form.kind(*arguments.get(1)?) {
            NodeKind::Lambda(lambda) => Some(*lambda),
            _ => None,
        }
    }

    /// Returns the failures of the function that a node defines.
    pub(crate) fn leaving_of(&self, form: u32, node: NodeId) -> Option<LeavingFailures> {
        let lambda = self.lambda_defined(form as usize, node)?;
        // A function that calls its arguments is shown as it is by itself.
        let bare = Code { form, lambda, context: NO_CONTEXT };
        if self.flow.calls_arguments.contains(&(form, lambda.0))
            && let Some(number) = self.flow.number_of(bare)
        {
            return Some(self.solution.leaving[number].clone());
        }
        let numbers = self.numbers.get(&(form, lambda))?;
        let mut all = LeavingFailures::default();
        for number in numbers {
            all.add(&self.solution.leaving[*number]);
        }
        Some(all)
    }

    /// Returns the code of the function that a node defines.
    fn codes_of(&self, form: u32, node: NodeId) -> Vec<Code> {
        let lambda = self.lambda_defined(form as usize, node);
        let numbers = lambda.and_then(|lambda| self.numbers.get(&(form, lambda)));
        numbers.into_iter().flatten().map(|number| self.flow.running[*number].code).collect()
    }

    /// Returns the code that a task runs, calls included.
    pub(crate) fn reach(&self, codes: Vec<Code>) -> FxHashSet<usize> {
        let mut found = FxHashSet::default();
        let mut pending = codes;
        while let Some(code) = pending.pop() {
            let Some(number) = self.flow.number_of(code) else { continue };
            if !found.insert(number) {
                continue;
            }
            for (_, effect) in &self.flow.running[number].effects {
                pending.extend(self.flow.called_by(effect));
            }
            let form = &self.flow.forms.forms[code.form as usize];
            for scope in &form.scopes_of[code.lambda.index()] {
                if let ScopeKind::Recovery { procedures, .. } = &form.scopes[*scope].kind {
                    pending.push(Code { lambda: *procedures, ..code });
                }
            }
        }
        found
    }

    fn tasks(&self, by_scope: &FxHashMap<(u32, usize, usize), usize>) -> Vec<FailingTask> {
        let bodies = bodies_of_works(self.flow);
        let clauses_of = |codes: Vec<Code>| {
            let mut rows: BTreeSet<usize> = BTreeSet::new();
            for number in self.reach(codes) {
                let code = self.flow.running[number].code;
                let form = &self.flow.forms.forms[code.form as usize];
                for scope in &form.scopes_of[code.lambda.index()] {
                    let found = (0..).map_while(|position| by_scope.get(&(code.form, *scope, position)));
                    if self.solution.handled.contains_key(&(number, *scope)) {
                        rows.extend(found);
                    }
                }
            }
            rows.into_iter().collect::<Vec<usize>>()
        };
        let tops = top_level(self.flow.forms);
        let mut main = LeavingFailures::default();
        for code in &tops {
            if let Some(number) = self.flow.number_of(*code) {
                main.add(&self.solution.leaving[number]);
            }
        }
        let mut rows = vec![FailingTask {
            name: "main".into(),
            kind: TaskKind::Main,
            place: CodePlace::default(),
            causes: self.rows_of(&main, &tops),
            is_awaited: false,
            clauses: clauses_of(tops),
        }];
        /// The works that begin at one place under one name.
        struct TaskGroup {
            leaving: LeavingFailures,
            codes: Vec<Code>,
            kind: TaskKind,
            is_awaited: bool,
        }

        let mut groups = BTreeMap::<(CodePlace, String), TaskGroup>::new();
        for (index, work) in self.flow.works.iter().enumerate() {
            let (place, name) = match work.key {
                WorkKey::Begun(spot, _) => {
                    let place = self.place(spot.form, spot.node);
                    let name = self.given_name(spot.form, spot.node);
                    (place, name.unwrap_or_else(|| self.name_of_task(&bodies[index], work.kind)))
                }
                WorkKey::Scripted(name) => {
                    (CodePlace::default(), format!("{SCRIPTED}{}", shown_function(self.flow.symbol(name))))
                }
                WorkKey::Host(_) => continue,
            };
            if !self.is_own(&place.source) || bodies[index].is_empty() {
                continue;
            }
            let group = groups.entry((place, name)).or_insert_with(|| TaskGroup {
                leaving: LeavingFailures::default(),
                codes: Vec::new(),
                kind: work.kind,
                is_awaited: work.is_awaited,
            });
            group.leaving.add(&self.solution.of_works[index]);
            group.codes.extend(&bodies[index]);
            group.is_awaited |= work.is_awaited;
        }
        rows.extend(groups.into_iter().map(|((place, name), group)| FailingTask {
            name,
            kind: group.kind,
            place,
            causes: self.rows_of(&group.leaving, &group.codes),
            is_awaited: group.is_awaited,
            clauses: clauses_of(group.codes),
        }));
        rows
    }

    /// Returns the name that the options of a `spawn` give to the task.
    fn given_name(&self, form: u32, node: NodeId) -> Option<String> {
        let text = &self.flow.forms.forms[form as usize];
        let NodeKind::Constant(name) = text.kind(text.spawn_option(node, "NAME")?) else { return None };
        let shown = name.to_string().to_lowercase();
        Some(shown.trim_matches('"').to_string())
    }

    fn name_of_task(&self, bodies: &[Code], kind: TaskKind) -> String {
        let mut names: BTreeSet<String> = BTreeSet::new();
        for code in bodies {
            let lambda = &self.flow.forms.forms[code.form as usize].core.lambdas[code.lambda.index()];
            if let Some(name) = &lambda.name {
                let mut parts = name.elements();
                let shown = match (parts.next(), parts.next()) {
                    (Some(_), Some(second)) => second.to_string(),
                    _ => name.to_string(),
                };
                names.insert(shown.to_lowercase());
            }
        }
        let word = match kind {
            TaskKind::Guard => return "guard".into(),
            TaskKind::Spawned if names.iter().any(|name| name == "(spawn)") => return "spawned".into(),
            TaskKind::Mock => "mock ",
            TaskKind::World => "world ",
            TaskKind::Test => "test ",
            _ => "",
        };
        if names.len() == 1 {
            format!("{word}{}", names.first().map_or("", |name| name))
        } else {
            format!("{word}task")
        }
    }
}

/// Returns the code of the top-level forms.
pub(crate) fn top_level(forms: &CoreForms) -> Vec<Code> {
    let code = |form| Code { form: form as u32, lambda: LambdaId(0), context: NO_CONTEXT };
    (0..forms.forms.len()).map(code).collect()
}

/// Whether the name of a lambda tells more than its form.
fn is_telling(name: &str) -> bool {
    ["(mock", "(task", "(test", "(to-achieve", "(with-world"].iter().any(|start| name.starts_with(start))
}

/// Returns the name of a function in lower case.
pub(crate) fn shown_function(symbol: &Symbol) -> String {
    match symbol_of_setf_cell(symbol) {
        Some(named) => format!("(setf {})", named.name().to_lowercase()),
        None => symbol.name().to_lowercase(),
    }
}
