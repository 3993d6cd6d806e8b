//! The arms of conditionals and the clauses of recovery forms, as they are written.

use esl_syntax::{NodeId, SyntaxKind, SyntaxTree};

/// A form that chooses between arms.
#[derive(Debug)]
pub(super) struct WrittenConditional {
    /// The form.
    pub(super) list: NodeId,
    /// Its operator, without a package.
    pub(super) operator: String,
    /// Its arms that have forms, in order.
    pub(super) arms: Vec<WrittenArm>,
    /// Whether it always chooses one of its arms.
    pub(super) always_chooses: bool,
}

impl WrittenConditional {
    /// Returns what the test is if the only arm is taken.
    pub(super) fn sense(&self) -> &'static str {
        if self.operator == "unless" { "false" } else { "true" }
    }
}

/// An arm.
#[derive(Debug)]
pub(super) struct WrittenArm {
    /// The whole of it.
    pub(super) clause: NodeId,
    /// The first form in it.
    pub(super) body: NodeId,
    /// Its name in reports.
    pub(super) name: String,
}

/// Characters of a text that are shown.
const SHOWN: usize = 40;

/// Returns the definitions of functions with their names.
pub(super) fn definitions(tree: &SyntaxTree) -> impl Iterator<Item = (NodeId, String)> {
    tree.nodes().filter_map(|list| {
        let operator = tree.operator(list)?;
        if !["defun", "defmacro", "defmethod", "deftest"].contains(&operator.as_str()) {
            return None;
        }
        let name = tree.text(tree.data(list).nth(1)?);
        Some((list, name.split_whitespace().collect::<Vec<_>>().join(" ")))
    })
}

/// Returns the forms that look like conditionals. Those in data, or in what a macro makes, are among them.
pub(super) fn conditionals(tree: &SyntaxTree) -> impl Iterator<Item = WrittenConditional> {
    tree.nodes().filter_map(|list| {
        let operator = tree.operator(list)?;
        let arms = match operator.as_str() {
            "if" => tree.data(list).skip(2).take(2).map(|arm| written_arm(tree, arm, arm, arm)).collect(),
            "when" | "unless" => {
                tree.data(list).nth(2).map(|body| written_arm(tree, body, body, body)).into_iter().collect()
            }
            "cond" => clauses(tree, tree.data(list).skip(1), 1),
            "case" | "ecase" | "ccase" | "typecase" | "etypecase" | "ctypecase" => {
                clauses(tree, tree.data(list).skip(2), 1)
            }
            "handler-case" | "restart-case" => clauses(tree, tree.data(list).skip(2), 2),
            "with-recovery-procedures" => clauses(tree, tree.data(tree.data(list).nth(1)?), 1),
            _ => return None,
        };
        let always_chooses =
            ["handler-case", "restart-case", "with-recovery-procedures"].contains(&operator.as_str());
        (!arms.is_empty()).then_some(WrittenConditional { list, operator, arms, always_chooses })
    })
}

/// Returns the arms that are clauses, each with so many data before its forms.
fn clauses(tree: &SyntaxTree, clauses: impl Iterator<Item = NodeId>, head: usize) -> Vec<WrittenArm> {
    let arm = |clause: NodeId| {
        if tree.kind(clause) != SyntaxKind::List {
            return None;
        }
        let mut data = tree.data(clause);
        let named = data.next()?;
        let mut rest = data.skip(head - 1).peekable();
        loop {
            let form = rest.next()?;
            if tree.name(form).is_some_and(|name| name.starts_with(':')) && rest.peek().is_some() {
                // An option and its value.
                rest.next();
            } else if tree.operator(form).as_deref() != Some("declare") {
                return Some(written_arm(tree, clause, form, named));
            }
        }
    };
    clauses.filter_map(arm).collect()
}

fn written_arm(tree: &SyntaxTree, clause: NodeId, body: NodeId, named: NodeId) -> WrittenArm {
    let text = tree.text(named).trim_start_matches(['\'', '`']);
    let mut name: String = text.split_whitespace().collect::<Vec<_>>().join(" ");
    if name.chars().count() > SHOWN {
        name = name.chars().take(SHOWN).chain(['…']).collect();
    }
    WrittenArm { clause, body, name }
}
