//! Declarations `(declaim (fails name cause*))`, compared with the findings of the analysis; the known causes
//! of each function.

use std::collections::BTreeMap;

use esl_bytecode::diagnostic::{Diagnostic, Severity};
use esl_bytecode::symbol::Symbol;
use esl_compiler::core::{Callee, NodeId, NodeKind};
use esl_compiler::diagnostic::Sources;

use crate::cause::{Applies, clause_applies, is_above_cause, is_of_mistake, shown_cause};
use crate::forms::{CoreForm, CoreForms, is_esl, symbols_inside};
use crate::guard::LeavingFailures;
use crate::is_of_program;
use crate::row::{CodePlace, FailingTask, FailureTable};
use crate::table::{Maker, shown_function, top_level};
use crate::value::TaskKind;

/// Beginning of the names of the tasks in which scripts of worlds answer.
pub(crate) const SCRIPTED: &str = "scripted ";

/// The declarations `(fails name cause*)` of a name, which add up.
#[derive(Clone, Debug, Default)]
pub(crate) struct DeclaredCauses {
    pub(crate) causes: Vec<Symbol>,
    /// Form and node of each declaration, with its causes.
    pub(crate) parts: Vec<((usize, NodeId), Vec<Symbol>)>,
}

impl DeclaredCauses {
    pub(crate) fn add(&mut self, place: (usize, NodeId), causes: Vec<Symbol>) {
        let new = causes.iter().filter(|cause| !self.causes.contains(cause)).cloned();
        let new: Vec<Symbol> = new.collect();
        self.causes.extend(new);
        self.parts.push((place, causes));
    }

    /// Returns form and node of the first declaration.
    pub(crate) fn place(&self) -> (usize, NodeId) {
        self.parts.first().map_or((0, NodeId(0)), |(place, _)| *place)
    }
}

impl FailureTable {
    /// Returns the known causes of failures of functions and operations, such as `:timeout`, by the names of
    /// these in lower case: those that the program shows, those of scripts of worlds, declared ones, and
    /// those of functions of modules. Failures of a module because of wrong arguments are left out.
    pub fn causes_by_name(&self) -> BTreeMap<String, Vec<Symbol>> {
        let mut all: BTreeMap<String, Vec<Symbol>> = BTreeMap::new();
        let mut add = |name: &str, cause: &Symbol| {
            let causes = all.entry(name.to_string()).or_default();
            if cause.is_keyword() && !causes.contains(cause) {
                causes.push(cause.clone());
            }
        };
        for function in &self.functions {
            let causes = function.causes.iter().filter(|row| !row.is_mistake);
            causes.filter_map(|row| row.name.as_ref()).for_each(|cause| add(&function.name, cause));
        }
        for task in &self.tasks {
            if let Some(name) = task.name.strip_prefix(SCRIPTED) {
                let causes = task.causes.iter().filter(|row| !row.is_mistake);
                causes.filter_map(|row| row.name.as_ref()).for_each(|cause| add(name, cause));
            }
        }
        for (name, causes) in &self.declared {
            causes.iter().for_each(|cause| add(name, cause));
        }
        let is_own = |name: &String| self.functions.iter().any(|function| function.name == *name);
        for (name, causes) in self.of_modules.iter().filter(|(name, _)| !is_own(name)) {
            causes.iter().filter(|cause| !is_of_mistake(cause)).for_each(|cause| add(name, cause));
        }
        all
    }
}

/// Returns the declared causes of functions, by their names.
pub(crate) fn declared(forms: &CoreForms) -> BTreeMap<String, Vec<Symbol>> {
    let row = |(name, declared): (&Symbol, &DeclaredCauses)| (shown_function(name), declared.causes.clone());
    forms.declared.iter().map(row).collect()
}

/// Whether a name that has a declaration stands anywhere else in the program, or is one of the language.
fn is_mentioned(forms: &CoreForms, name: &Symbol) -> bool {
    let is_known = forms.defined.contains_key(name)
        || forms.generic.contains(name)
        || forms.exclusive.contains(name)
        || forms.scripted.contains(name);
    is_known
        || name.is_in("COMMON-LISP")
        || name.is_in("ESL")
        || forms.forms.iter().any(|form| mentions(form, name))
}

/// Whether a name stands anywhere in a form, but as that of a declaration of failures.
fn mentions(form: &CoreForm, name: &Symbol) -> bool {
    let calls = form.core.nodes.iter().filter_map(|node| match &node.kind {
        NodeKind::Call(_, arguments) => Some(arguments.as_slice()),
        _ => None,
    });
    let is_fails =
        |node: &NodeId| matches!(form.kind(*node), NodeKind::Constant(key) if is_esl(key, "%FAILS"));
    let declared: Vec<NodeId> = calls
        .filter(|arguments| arguments.get(1).is_some_and(is_fails))
        .filter_map(|arguments| arguments.first().copied())
        .collect();
    form.core.nodes.iter().enumerate().any(|(number, node)| match &node.kind {
        NodeKind::Call(Callee::Global(symbol), _)
        | NodeKind::Apply(Callee::Global(symbol), _)
        | NodeKind::FunctionRef(symbol) => symbol == name,
        NodeKind::Constant(datum) => {
            !declared.contains(&NodeId(number as u32)) && symbols_inside(datum).contains(name)
        }
        _ => false,
    })
}

/// Returns errors for the declarations of a program whose failures are not found: a promise that nothing has
/// checked is not kept. Those that nothing ever checks, of functions of the host and of the library, are
/// trusted here, too.
pub(crate) fn unchecked(forms: &CoreForms, sources: &Sources) -> Vec<Diagnostic> {
    let found = |(name, declared): (&Symbol, &DeclaredCauses)| {
        let (form, node) = declared.place();
        let span = forms.forms[form].core.nodes[node.index()].span;
        let is_compared = forms.defined.contains_key(name) || name.is_keyword() || name.name() == "MAIN";
        if !is_compared || !is_of_program(sources, span) {
            return None;
        }
        let message = format!(
            "the failures declared for `{}` are not checked: too many functions flow through the program as values",
            shown_function(name)
        );
        Some(Diagnostic::new("undeclared-failure", Severity::Error, message, span))
    };
    let mut findings: Vec<Diagnostic> = forms.declared.iter().filter_map(found).collect();
    findings.sort_by_key(|found| (found.primary.span.source, found.primary.span.start));
    findings
}

impl Maker<'_, '_> {
    /// Returns the declarations that do not hold: errors for failures that are not declared, warnings for
    /// declared ones that never come.
    pub(crate) fn findings(&self) -> Vec<Diagnostic> {
        let forms = self.flow.forms;
        let mut findings = Vec::new();
        for (name, DeclaredCauses { causes: declared, parts }) in &forms.declared {
            let Some(((form, node), _)) = parts.first().cloned() else { continue };
            let span = forms.forms[form].core.nodes[node.index()].span;
            let shown = shown_function(name);
            if !name.is_keyword() && name.name() != "MAIN" && !is_mentioned(forms, name) {
                let message = format!("`{shown}` declares failures, but nothing defines or calls it");
                findings.push(Diagnostic::new("declared-never", Severity::Warning, message, span));
                continue;
            }
            let leaving = match forms.defined.get(name) {
                Some((form, node)) => self.leaving_of(*form as u32, *node),
                None if name.name() == "MAIN" => Some(self.leaving_main()),
                // It is one of the host, or not part of this program.
                None => None,
            };
            let Some(leaving) = leaving else { continue };
            let kinds = leaving.failures.iter().map(|failure| self.solution.failures.keys[*failure as usize]);
            let crowded = self.crowded_place(name);
            let mut is_seen = vec![false; declared.len()];
            let mut told = Vec::new();
            for failing in kinds {
                let mut best = Applies::No;
                for (index, cause) in declared.iter().enumerate() {
                    let applies = clause_applies(forms, &self.flow.names, failing.kind, cause);
                    is_seen[index] |= applies != Applies::No;
                    best = best.max(applies);
                }
                let cause = self.cause(failing.kind);
                if best != Applies::Yes && !told.contains(&cause) {
                    let message = format!("`{shown}` may fail with {cause}, which it does not declare");
                    let origin = forms.forms[failing.form as usize].core.nodes[failing.node.index()].span;
                    let found = Diagnostic::new("undeclared-failure", Severity::Error, message, span);
                    let found = found.also(origin, "it begins here");
                    findings.push(match &crowded {
                        Some(place) => found.help(format!(
                            "too many functions may be called at {place} to be told apart: the failures of all of them count there"
                        )),
                        None => found,
                    });
                    told.push(cause);
                }
            }
            for (cause, _) in declared.iter().zip(&is_seen).filter(|(_, is_seen)| !**is_seen) {
                let cause = shown_cause(cause);
                let message = format!("`{shown}` declares {cause}, but never fails with it");
                findings.push(Diagnostic::new("declared-never", Severity::Warning, message, span));
            }
        }
        findings.sort_by_key(|found| {
            (found.primary.span.source, found.primary.span.start, found.message.clone())
        });
        findings
    }

    /// Returns errors for tasks that end by failures which a declaration for them does not have. A keyword
    /// that is declared in place of a function names tasks: `:imaging` those of this name, `:tasks` all for
    /// which no form waits and that begin in the source of the declaration, the main task among them.
    pub(crate) fn unhandled(&self, tasks: &[FailingTask]) -> Vec<Diagnostic> {
        let mut findings = Vec::new();
        for (name, declared) in self.flow.forms.declared.iter().filter(|(name, _)| name.is_keyword()) {
            if name.name() != "TASKS" {
                self.add_unhandled(name, declared, tasks, &mut findings);
                continue;
            }
            // Declarations for all tasks are those of their source.
            let mut of_sources: BTreeMap<String, DeclaredCauses> = BTreeMap::new();
            for (place, causes) in &declared.parts {
                let source = self.place(place.0 as u32, place.1).source;
                of_sources.entry(source).or_default().add(*place, causes.clone());
            }
            of_sources.values().for_each(|own| self.add_unhandled(name, own, tasks, &mut findings));
        }
        findings.sort_by_key(|found| {
            (found.primary.span.source, found.primary.span.start, found.message.clone())
        });
        findings
    }

    /// Adds the errors for the declarations of a keyword; those for all tasks are of one source.
    fn add_unhandled(
        &self,
        name: &Symbol,
        declared: &DeclaredCauses,
        tasks: &[FailingTask],
        findings: &mut Vec<Diagnostic>,
    ) {
        let forms = self.flow.forms;
        let (form, node) = declared.place();
        let span = forms.forms[form].core.nodes[node.index()].span;
        let here = self.place(form as u32, node).source;
        let wanted = name.name().to_lowercase();
        let is_meant = |task: &&FailingTask| {
            let is_own = matches!(task.kind, TaskKind::Main | TaskKind::Spawned | TaskKind::Child);
            match &*wanted {
                "tasks" => {
                    is_own && !task.is_awaited && (task.kind == TaskKind::Main || task.place.source == here)
                }
                wanted => task.name == wanted,
            }
        };
        for task in tasks.iter().filter(is_meant) {
            for row in task.causes.iter().filter(|row| !row.is_mistake) {
                let is_declared = |known: &Symbol| {
                    row.name.as_ref().is_some_and(|cause| is_above_cause(forms, cause, known))
                        || known.name() == "GENERAL-FAILURE"
                };
                if declared.causes.iter().any(is_declared) {
                    continue;
                }
                let message = format!("no clause takes {}, which ends the task `{}`", row.cause, task.name);
                let mut found = Diagnostic::new("unhandled-failure", Severity::Error, message, span);
                found = match row.origins.first() {
                    Some(origin) => found.also(origin.span(), "it begins here"),
                    None => found,
                };
                findings.push(found);
            }
        }
    }

    /// Returns a place with too many functions in the code that a function, or the main task, runs.
    fn crowded_place(&self, name: &Symbol) -> Option<CodePlace> {
        if self.flow.many.places.is_empty() {
            return None;
        }
        let defined = self.flow.forms.defined.get(name);
        let codes = match defined.and_then(|(form, node)| Some((*form, self.lambda_defined(*form, *node)?))) {
            Some((form, lambda)) => {
                let numbers = self.numbers.get(&(form as u32, lambda)).into_iter().flatten();
                numbers.map(|number| self.flow.running[*number].code).collect()
            }
            None => top_level(self.flow.forms),
        };
        let is_crowded = |spot: &(u32, NodeId)| self.flow.many.places.contains(spot);
        let places = self.reach(codes).into_iter().flat_map(|number| {
            let running = &self.flow.running[number];
            running.effects.iter().map(|(node, _)| (running.code.form, *node))
        });
        places.filter(is_crowded).min().map(|(form, node)| self.place(form, node))
    }

    fn leaving_main(&self) -> LeavingFailures {
        let mut main = LeavingFailures::default();
        for code in top_level(self.flow.forms) {
            if let Some(number) = self.flow.number_of(code) {
                main.add(&self.solution.leaving[number]);
            }
        }
        main
    }
}
