//! Warnings about clauses: those that never apply, and those that begin again without a limit although the
//! failure does not go away by itself. A clause is warned of only where the analysis knows all failures that
//! can reach it.

use esl_bytecode::diagnostic::{Diagnostic, Severity};
use esl_bytecode::symbol::Symbol;
use esl_compiler::children;
use esl_compiler::core::{BoundVariable, Callee, NodeId, NodeKind};
use rustc_hash::{FxHashMap, FxHashSet};

use crate::cause::{Applies, clause_applies, is_above_cause, is_standard, mistakes_named, shown_cause};
use crate::clause::{Clause, ClauseLimit};
use crate::effect::NodeEffect;
use crate::forms::{CoreForm, ScopeKind};
use crate::guard::Handled;
use crate::table::Maker;
use crate::value::{Code, TaskKind};

/// Causes that may come to any code from outside: limits, rights, ends of tasks.
const FROM_OUTSIDE: [&str; 15] = [
    "ABORTED",
    "BUDGET-EXHAUSTED",
    "CANCELLED",
    "HEAP-EXHAUSTED",
    "INTERRUPTED-BY-RESTART",
    "LEASE-LOST",
    "MAINTAINED-PROPERTY-VIOLATION",
    "NOT-IN-THIS-WORLD",
    "PERMISSION-DENIED",
    "PROPERTY-LOCK-UNAVAILABLE",
    "QUOTA-EXHAUSTED",
    "STACK-EXHAUSTED",
    "STORAGE-CONDITION",
    "TIMEOUT",
    "WOULD-BLOCK",
];

/// Causes of failures that do not go away by themselves: the same call fails again.
const LASTING: [&str; 9] = [
    "ARITHMETIC-ERROR",
    "CELL-ERROR",
    "DIVISION-BY-ZERO",
    "NO-APPLICABLE-METHOD",
    "PERMISSION-DENIED",
    "PROGRAM-ERROR",
    "TYPE-ERROR",
    "UNBOUND-VARIABLE",
    "UNDEFINED-FUNCTION",
];

/// Functions after which a program is as it was before.
const ONLY_PRINTING: [&str; 8] =
    ["FORMAT", "PRINT", "PRIN1", "PRINC", "TERPRI", "FRESH-LINE", "WRITE-LINE", "WRITE-STRING"];

impl Maker<'_, '_> {
    /// Returns warnings about the clauses of the program.
    pub(crate) fn advice(&self) -> Vec<Diagnostic> {
        let mut groups: FxHashMap<(u32, usize), Vec<(usize, &Handled)>> = FxHashMap::default();
        for ((number, scope), handled) in &self.solution.handled {
            let form = self.flow.running[*number].code.form;
            groups.entry((form, *scope)).or_default().push((*number, handled));
        }
        let is_interrupted = self.is_interrupted();
        let mut found = Vec::new();
        for ((form, scope), runs) in groups {
            let text = &self.flow.forms.forms[form as usize];
            let ScopeKind::Recovery { node, clauses, .. } = &text.scopes[scope].kind else { continue };
            if !self.is_own(&self.place(form, *node).source) {
                continue;
            }
            let is_closed = std::cell::LazyCell::new(|| {
                self.is_closed(form, *node, runs.iter().map(|(number, _)| *number))
            });
            for (position, clause) in clauses.iter().enumerate() {
                let takes = runs.iter().any(|(_, handled)| {
                    !handled.taken[position].is_empty() || handled.mistakes[position] != 0
                });
                let only_mistakes = runs.iter().all(|(_, handled)| handled.taken[position].is_empty());
                let span = self.span_inside(form, clause.body);
                let cause = shown_cause(&clause.cause);
                let is_counted = clause.limit != ClauseLimit::Times(0);
                if !takes
                    && is_counted
                    && self.comes_only_by_program(&clause.cause, is_interrupted)
                    && *is_closed
                {
                    let message =
                        format!("this clause never applies: the body of its form never fails with {cause}");
                    let help =
                        "leave it out, or compare the name with those of the causes that the body fails with";
                    let warning =
                        Diagnostic::new("clause-never-applies", Severity::Warning, message, span).help(help);
                    found.push(warning);
                } else if takes && self.begins_again_in_vain(text, clause, only_mistakes) {
                    let message = format!(
                        "this clause begins again without a limit, but {cause} does not go away by itself"
                    );
                    let help = "give it a number of `:retries`, or change the reason of the failure before `(retry)`";
                    found.push(Diagnostic::new("endless-retry", Severity::Warning, message, span).help(help));
                }
            }
        }
        found.sort_by_key(|found| (found.primary.span.source, found.primary.span.start));
        found
    }

    /// Whether the program has forms that let failures of one task into code of another.
    fn is_interrupted(&self) -> bool {
        let has_guards = self.flow.works.iter().any(|work| work.kind == TaskKind::Guard);
        let is_of_suspension = |variable: &BoundVariable| matches!(variable, BoundVariable::Special(symbol) if symbol.name() == "*%SUSPENSION-PROCEDURES*");
        has_guards
            || self.flow.forms.forms.iter().any(|form| {
                form.core.nodes.iter().any(|node| match &node.kind {
                    NodeKind::Let { bindings, .. } => {
                        bindings.iter().any(|(variable, _)| is_of_suspension(variable))
                    }
                    _ => false,
                })
            })
    }

    /// Whether a clause for a cause takes only failures that begin in calls of its body.
    fn comes_only_by_program(&self, wanted: &Symbol, is_interrupted: bool) -> bool {
        let forms = self.flow.forms;
        // Causes of modules and of the library may come in ways that the program does not show.
        let is_own = |(form, node): &(usize, NodeId)| self.is_own(&self.place(*form as u32, *node).source);
        if !wanted.is_keyword() || !forms.causes.get(wanted).is_some_and(is_own) {
            return false;
        }
        let is_known = mistakes_named(wanted.name()).1 == 0 && !is_standard(&Symbol::cl(wanted.name()));
        let from_outside =
            FROM_OUTSIDE.iter().any(|name| is_above_cause(forms, &Symbol::keyword(name), wanted));
        let applies = |kind| clause_applies(forms, &self.flow.names, kind, wanted) != Applies::No;
        is_known
            && !from_outside
            && !(is_interrupted && self.solution.kinds.iter().any(|kind| applies(*kind)))
    }

    /// Whether all calls of the code around a form are known: no function that comes from a caller is called,
    /// and no operation whose place a mock or a script takes.
    fn is_closed(&self, form: u32, node: NodeId, runs: impl Iterator<Item = usize>) -> bool {
        let text = &self.flow.forms.forms[form as usize];
        let mut around = Some(text.owners[node.index()]);
        while let Some(lambda) = around {
            if self.flow.calls_arguments.contains(&(form, lambda.0)) {
                return false;
            }
            around = text.core.lambdas[lambda.index()].parent;
        }
        let mut seen: FxHashSet<usize> = FxHashSet::default();
        let mut pending: Vec<usize> = runs.collect();
        while let Some(number) = pending.pop() {
            if !seen.insert(number) {
                continue;
            }
            for (_, effect) in &self.flow.running[number].effects {
                let codes: &[Code] = match effect {
                    NodeEffect::Call(_) | NodeEffect::CallMany | NodeEffect::Absorb(_) => {
                        self.flow.called_by(effect)
                    }
                    NodeEffect::Body(_, code) => std::slice::from_ref(code),
                    NodeEffect::FailAs(work) | NodeEffect::Start(work) | NodeEffect::FailAll(work) => {
                        let kind = self.flow.works[work.index()].kind;
                        if matches!(kind, TaskKind::Mock | TaskKind::World | TaskKind::Host) {
                            return false;
                        }
                        continue;
                    }
                    _ => continue,
                };
                pending.extend(codes.iter().filter_map(|code| self.flow.number_of(*code)));
            }
        }
        true
    }

    /// Whether a clause begins again for ever after a failure that nothing has changed.
    fn begins_again_in_vain(&self, form: &CoreForm, clause: &Clause, only_mistakes: bool) -> bool {
        let name = clause.cause.name();
        let is_lasting = only_mistakes && LASTING.contains(&name);
        let ways = clause.ways;
        is_lasting
            && clause.limit == ClauseLimit::None
            && ways.retries
            && !ways.aborts
            && !ways.pauses
            && only_prints(form, clause.body)
    }
}

/// Whether a node neither calls anything but functions that print nor sets anything.
fn only_prints(form: &CoreForm, node: NodeId) -> bool {
    let mut pending = vec![node];
    while let Some(node) = pending.pop() {
        let kind = form.kind(node);
        let is_harmless = match kind {
            NodeKind::Call(Callee::Global(name), _) => ONLY_PRINTING.contains(&name.name()),
            NodeKind::Call(Callee::Builtin(builtin), _) => ONLY_PRINTING.contains(&builtin.info().name),
            NodeKind::Constant(_)
            | NodeKind::Local(_)
            | NodeKind::Progn(_)
            | NodeKind::Let { .. }
            | NodeKind::Values(_)
            | NodeKind::Throw(..)
            | NodeKind::If(..) => true,
            _ => false,
        };
        if !is_harmless {
            return false;
        }
        children(kind, &mut |child| pending.push(child));
    }
    true
}
