//! The ways of a cause: from the places where it begins, outward through calls and tasks, to the clauses
//! that take it.

use std::fmt::Write;

use esl_bytecode::symbol::Symbol;
use esl_compiler::core::{LambdaId, NodeId};
use rustc_hash::FxHashSet;

use crate::cause::{Applies, clause_applies, is_of_mistake, shown_cause};
use crate::effect::{FailureKind, NodeEffect};
use crate::forms::ScopeKind;
use crate::guard::FailureId;
use crate::solve::bodies_of_works;
use crate::table::Maker;
use crate::value::{Code, WorkId};

/// Most levels of a tree.
const DEEPEST: usize = 40;
/// Most lines of an explanation.
const MOST_LINES: usize = 2_000;

/// A tree under construction.
struct WayTree {
    text: String,
    lines: usize,
    seen: FxHashSet<(u32, LambdaId, FailureId)>,
    bodies: Vec<Vec<Code>>,
}

impl WayTree {
    fn line(&mut self, depth: usize, text: &str) {
        self.lines += 1;
        if self.lines < MOST_LINES {
            // Writing to a text does not fail.
            _ = writeln!(self.text, "{:indent$}{text}", "", indent = 2 * depth);
        }
    }
}

/// A cause to be explained.
enum WantedCause {
    /// All that are not known.
    Any,
    /// Those of functions that are not known.
    Unknown,
    /// One with all below it.
    Named(Symbol),
}

impl WantedCause {
    /// Reads a cause as the table writes it; the colon may be missing.
    fn read(text: &str) -> WantedCause {
        match text.split(' ').next() {
            Some("any") => return WantedCause::Any,
            Some("unknown") => return WantedCause::Unknown,
            _ => {}
        }
        let name = text.strip_prefix(':').unwrap_or(text);
        let Some(barred) = name.strip_prefix('|').and_then(|name| name.strip_suffix('|')) else {
            return WantedCause::Named(Symbol::keyword(&name.to_uppercase()));
        };
        let mut plain = String::new();
        let mut characters = barred.chars();
        while let Some(c) = characters.next() {
            plain.extend(if c == '\\' { characters.next() } else { Some(c) });
        }
        WantedCause::Named(Symbol::keyword(&plain))
    }

    fn shown(&self) -> String {
        match self {
            WantedCause::Any => "any".into(),
            WantedCause::Unknown => "unknown".into(),
            WantedCause::Named(name) => shown_cause(name),
        }
    }
}

impl Maker<'_, '_> {
    /// Returns whether failures of a kind have a cause, or may have it.
    fn is_wanted(&self, kind: FailureKind, wanted: &WantedCause) -> bool {
        match (wanted, kind) {
            (WantedCause::Any, _) => matches!(kind, FailureKind::Any(_) | FailureKind::Unknown(_)),
            (WantedCause::Unknown, _) => matches!(kind, FailureKind::Unknown(_)),
            (_, FailureKind::Any(_) | FailureKind::Unknown(_)) => false,
            (WantedCause::Named(name), _) => {
                clause_applies(self.flow.forms, &self.flow.names, kind, name) != Applies::No
            }
        }
    }

    /// Returns the ways of all failures with a cause, as a tree with places.
    pub(crate) fn explain(&self, cause: &str) -> String {
        let mut tree = WayTree {
            text: String::new(),
            lines: 0,
            seen: FxHashSet::default(),
            bodies: bodies_of_works(self.flow),
        };
        let wanted = WantedCause::read(cause);
        tree.line(0, &wanted.shown());
        let mut starts: Vec<(String, FailureId)> = Vec::new();
        for (index, failing) in self.solution.failures.keys.iter().enumerate() {
            if self.is_wanted(failing.kind, &wanted) {
                starts.push((self.place(failing.form, failing.node).to_string(), index as FailureId));
            }
        }
        starts.sort();
        match &wanted {
            WantedCause::Named(name) if is_of_mistake(name) => {
                tree.line(1, "programming errors have no ways here; `eslc failures --all` lists them");
            }
            _ if starts.is_empty() => tree.line(1, "no place in this program fails with it"),
            _ => {}
        }
        for (place, failure) in starts {
            let failing = self.solution.failures.keys[failure as usize];
            let owner = self.flow.forms.forms[failing.form as usize].owners[failing.node.index()];
            let shown = self.cause(failing.kind);
            let kind = if shown == wanted.shown() { String::new() } else { format!(", as {shown}") };
            let function = self.function_around(failing.form, owner);
            tree.line(1, &format!("begins at {place}, in {function}{kind}"));
            for number in 0..self.flow.running.len() {
                let code = self.flow.running[number].code;
                if code.form == failing.form && code.lambda == owner {
                    self.go_outward(&mut tree, number, failing.node, failure, 2);
                    break;
                }
            }
        }
        tree.text
    }

    /// Follows a failure from a node outward.
    fn go_outward(&self, tree: &mut WayTree, number: usize, node: NodeId, failure: FailureId, depth: usize) {
        if depth > DEEPEST || tree.lines > MOST_LINES {
            tree.line(depth.min(DEEPEST), "…");
            return;
        }
        let code = self.flow.running[number].code;
        let form = &self.flow.forms.forms[code.form as usize];
        let mut depth = depth;
        let mut scope = form.scope_of[node.index()];
        while let Some(index) = scope {
            if let Some(handled) = self.solution.handled.get(&(number, index)) {
                for (position, taken) in handled.taken.iter().enumerate() {
                    for (_, goes_on) in taken.iter().filter(|(taken, _)| *taken == failure) {
                        let end = if *goes_on { ", perhaps in vain" } else { "" };
                        tree.line(
                            depth,
                            &format!("taken by {}{end}", self.shown_clause(code, index, position)),
                        );
                    }
                }
                if !handled.leaving.failures.contains(&failure) {
                    return;
                }
                if handled.taken.iter().any(|taken| taken.contains(&(failure, true))) {
                    depth += 1;
                }
            } else if let ScopeKind::ClauseBody(_) = form.scopes[index].kind {
                // A failure of a clause goes on from its form.
                self.leave_clause(tree, code, failure, depth);
                return;
            }
            scope = form.scopes[index].parent;
        }
        if !self.solution.leaving[number].failures.contains(&failure) {
            return;
        }
        self.leave_code(tree, number, failure, depth);
    }

    /// Describes a clause of a handling form.
    fn shown_clause(&self, code: Code, scope: usize, position: usize) -> String {
        let form = &self.flow.forms.forms[code.form as usize];
        let (node, wanted) = match &form.scopes[scope].kind {
            ScopeKind::Recovery { clauses, .. } => {
                (clauses[position].body, shown_cause(&clauses[position].cause))
            }
            ScopeKind::Cases { node, types } | ScopeKind::Handlers { node, types } => {
                (*node, types.get(position).map(ToString::to_string).unwrap_or_default().to_lowercase())
            }
            ScopeKind::ClauseBody(_) => return String::new(),
        };
        let function = self.function_around(code.form, form.owners[node.index()]);
        format!(
            "the clause for {} at {}, in {function}",
            wanted,
            self.place_of(self.span_of_clause(code.form, scope, node))
        )
    }

    /// Follows a failure of a clause from the form of the clause.
    fn leave_clause(&self, tree: &mut WayTree, code: Code, failure: FailureId, depth: usize) {
        let form = &self.flow.forms.forms[code.form as usize];
        for scope in &form.scopes {
            if let ScopeKind::Recovery { node, procedures, .. } = &scope.kind
                && *procedures == code.lambda
            {
                let owner = Code { lambda: form.owners[node.index()], ..code };
                if let Some(number) = self.flow.number_of(owner) {
                    tree.line(depth, &format!("leaves the form at {}", self.place(code.form, *node)));
                    self.go_outward(tree, number, *node, failure, depth + 1);
                }
            }
        }
    }

    /// Follows a failure from the end of a piece of code.
    fn leave_code(&self, tree: &mut WayTree, number: usize, failure: FailureId, depth: usize) {
        let code = self.flow.running[number].code;
        if !tree.seen.insert((code.form, code.lambda, failure)) {
            tree.line(depth, "and on as above");
            return;
        }
        if code.lambda == LambdaId(0) {
            tree.line(depth, "leaves the main task: the run ends with this failure");
            return;
        }
        let works: Vec<WorkId> = (0..tree.bodies.len())
            .filter(|work| tree.bodies[*work].contains(&code))
            .map(|work| WorkId(work as u32))
            .collect();
        let mut has_gone_on = false;
        let mut told: FxHashSet<(u32, NodeId)> = FxHashSet::default();
        for (caller, running) in self.flow.running.iter().enumerate() {
            for (node, effect) in &running.effects {
                let word = match effect {
                    NodeEffect::Call(called) if *called == code => "called",
                    NodeEffect::CallMany if self.flow.many.codes.contains(&code) => "called, among many,",
                    NodeEffect::Absorb(called) if *called == code => "ends at the call",
                    NodeEffect::FailAs(work) if works.contains(work) => {
                        "the task's failure is that of the form"
                    }
                    NodeEffect::FailAll(work) if works.contains(work) => {
                        "counts among the failures of the form"
                    }
                    _ => continue,
                };
                if !told.insert((running.code.form, *node)) {
                    continue;
                }
                has_gone_on = true;
                let place = self.place(running.code.form, *node);
                let function = self.function_around(running.code.form, running.code.lambda);
                tree.line(depth, &format!("{word} at {place}, in {function}"));
                if matches!(effect, NodeEffect::Call(_) | NodeEffect::CallMany | NodeEffect::FailAs(_)) {
                    self.go_outward(tree, caller, *node, failure, depth + 1);
                }
            }
        }
        if !has_gone_on {
            let end =
                if works.is_empty() { "leaves it: the program has no call of it" } else { "ends the task" };
            tree.line(depth, end);
        }
    }
}
