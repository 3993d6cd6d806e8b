//! Inlay hints: which recovery clause handles which failure, as far as the text shows it.
//!
//! A clause is taken to handle the failures of its cause, or of a cause below it, that `(fail :cause …)`
//! raises in the body of its form, or in functions of the file that are called from there, unless a clause
//! further in handles them.

use std::cell::Cell;
use std::collections::{HashMap, HashSet};
use std::rc::Rc;

use esl_compiler::reader::lexer::Token;
use esl_syntax::{NodeId, SyntaxKind, SyntaxTree, bare_name};
use lsp_types::{InlayHint, InlayHintLabel, InlayHintParams};

use super::project::Project;

/// Failures of which a hint names the lines.
const MAX_LINES: usize = 5;
/// Steps of the search for failures in one text.
const MAX_STEPS: usize = 1_000_000;

/// Answers the hints of a part of a text.
pub(super) fn hints(project: &Project, parameters: &InlayHintParams) -> Option<Vec<InlayHint>> {
    let text = project.text(&parameters.text_document.uri)?;
    let (start, end) = (text.offset(parameters.range.start), text.offset(parameters.range.end));
    let handled = handled(&text.tree);
    let line_of = |node: NodeId| text.position(text.tree.range(node).start).line + 1;
    let mut hints = Vec::new();
    for (clause, mut failures) in handled {
        failures.sort_unstable();
        let head = text.tree.data(clause).next()?;
        let at = text.tree.range(head).end;
        if !(start..=end).contains(&at) {
            continue;
        }
        let mut lines: Vec<u32> = failures.into_iter().map(line_of).collect();
        lines.dedup();
        let rest = lines.len().saturating_sub(MAX_LINES);
        let shown: Vec<String> = lines.iter().take(MAX_LINES).map(u32::to_string).collect();
        let more = if rest > 0 { format!(" and {rest} more") } else { String::new() };
        let word = if lines.len() == 1 { "line" } else { "lines" };
        hints.push(InlayHint {
            position: text.position(at),
            label: InlayHintLabel::String(format!("handles {word} {}{more}", shown.join(", "))),
            kind: None,
            text_edits: None,
            tooltip: None,
            padding_left: Some(true),
            padding_right: Some(true),
            data: None,
        });
    }
    hints.sort_by_key(|hint| (hint.position.line, hint.position.character));
    Some(hints)
}

/// The parts of a text that matter for failures.
struct FailureMap<'a> {
    tree: &'a SyntaxTree,
    /// The functions of the text.
    functions: HashMap<String, NodeId>,
    /// Parents of causes.
    parents: HashMap<String, Vec<String>>,
    /// Steps that are left.
    steps: Cell<usize>,
}

/// The clauses around a form, in forms that nest.
struct AroundClauses {
    clauses: Vec<NodeId>,
    outer: Option<Rc<AroundClauses>>,
}

impl Drop for AroundClauses {
    /// Drops what only this one knows without recursion.
    fn drop(&mut self) {
        let mut next = self.outer.take();
        while let Some(mut outer) = next.and_then(|outer| Rc::try_unwrap(outer).ok()) {
            next = outer.outer.take();
        }
    }
}

/// Returns the clauses that handle failures, each with the forms that fail.
fn handled(tree: &SyntaxTree) -> HashMap<NodeId, Vec<NodeId>> {
    let mut map =
        FailureMap { tree, functions: HashMap::new(), parents: HashMap::new(), steps: Cell::new(MAX_STEPS) };
    for form in tree.nodes() {
        let Some(operator) = tree.operator(form) else { continue };
        let data: Vec<NodeId> = tree.data(form).take(3).collect();
        let &[_, name, rest] = &*data else { continue };
        match &*operator {
            "defun" => {
                if let Some(name) = tree.name(name) {
                    map.functions.insert(bare_name(name), form);
                }
            }
            "define-cause" => {
                let parents = tree.data(rest).map(|parent| tree.text(parent).to_lowercase());
                map.parents.insert(tree.text(name).to_lowercase(), parents.collect());
            }
            _ => {}
        }
    }
    let mut handled: HashMap<NodeId, Vec<NodeId>> = HashMap::new();
    for form in tree.nodes() {
        if tree.operator(form).as_deref() != Some("with-recovery-procedures") {
            continue;
        }
        let Some(clauses) = tree.data(form).nth(1) else { continue };
        let clauses: Vec<NodeId> = tree.data(clauses).collect();
        let mut seen = HashSet::new();
        let body: Vec<NodeId> = tree.data(form).skip(2).collect();
        for failure in body.into_iter().flat_map(|part| map.failures(part, &mut seen)) {
            let Some(cause) = map.cause_of(failure) else { continue };
            if let Some(&clause) = clauses.iter().find(|&&clause| map.handles(clause, &cause)) {
                handled.entry(clause).or_default().push(failure);
            }
        }
    }
    handled
}

impl FailureMap<'_> {
    /// Returns the forms that fail in a form, or in functions that it calls, and are not handled inside.
    fn failures(&self, form: NodeId, seen: &mut HashSet<String>) -> Vec<NodeId> {
        let mut found = Vec::new();
        // The forms to be looked at, with the clauses around each.
        let mut waiting: Vec<(NodeId, Option<Rc<AroundClauses>>)> = vec![(form, None)];
        while let Some((node, clauses)) = waiting.pop() {
            let Some(left) = self.steps.get().checked_sub(1) else { return found };
            self.steps.set(left);
            let is_code = !matches!(self.tree.kind(node), SyntaxKind::Mark(Token::Quote));
            if !is_code {
                continue;
            }
            let operator = self.tree.operator(node);
            match operator.as_deref() {
                Some("fail") => {
                    let cause = self.cause_of(node).unwrap_or_default();
                    let around = std::iter::successors(clauses.as_deref(), |around| around.outer.as_deref());
                    let mut all = around.flat_map(|around| &around.clauses).inspect(|_| {
                        self.steps.set(self.steps.get().saturating_sub(1));
                    });
                    if !all.any(|&clause| self.handles(clause, &cause)) {
                        found.push(node);
                    }
                }
                Some("with-recovery-procedures") => {
                    let inner = self.tree.data(node).nth(1).into_iter().flat_map(|list| self.tree.data(list));
                    let all = Some(Rc::new(AroundClauses { clauses: inner.collect(), outer: clauses }));
                    waiting.extend(self.tree.data(node).skip(2).map(|part| (part, all.clone())));
                    continue;
                }
                Some(name) if self.functions.contains_key(name) && seen.insert(name.to_owned()) => {
                    let body = self.tree.data(self.functions[name]).skip(3);
                    waiting.extend(body.map(|part| (part, clauses.clone())));
                }
                _ => {}
            }
            waiting.extend(self.tree.data(node).map(|part| (part, clauses.clone())));
        }
        found
    }

    /// Returns the cause with which a form `(fail :cause …)` fails.
    fn cause_of(&self, fail: NodeId) -> Option<String> {
        let cause = self.tree.data(fail).nth(1)?;
        let text = self.tree.text(cause).to_lowercase();
        text.starts_with(':').then_some(text)
    }

    /// Whether a clause handles a cause: its own, one above it, or any.
    fn handles(&self, clause: NodeId, cause: &str) -> bool {
        let Some(head) = self.tree.data(clause).next() else { return false };
        let head =
            if self.tree.kind(head) == SyntaxKind::List { self.tree.data(head).next() } else { Some(head) };
        let Some(wanted) = head.map(|head| self.tree.text(head).to_lowercase()) else { return false };
        let mut known = HashSet::new();
        let mut waiting = vec![cause.to_owned()];
        while let Some(cause) = waiting.pop() {
            if cause == wanted {
                return true;
            }
            if let Some(parents) = self.parents.get(&cause).filter(|_| known.insert(cause.clone())) {
                waiting.extend(parents.iter().cloned());
            }
        }
        wanted == ":general-failure"
    }
}
