//! Code actions: repairs of what diagnostics are about, where it is known how.

use std::collections::HashMap;

use esl_syntax::{NodeId, SyntaxKind, SyntaxTree};
use lsp_types::{
    CodeAction, CodeActionKind, CodeActionOrCommand, CodeActionParams, Diagnostic, NumberOrString, TextEdit,
    Uri, WorkspaceEdit,
};

use super::document::OpenText;
use super::failures;
use super::project::Project;
use super::scope::binding_of;

/// Answers how the diagnostics at a place can be repaired.
pub(super) fn actions(project: &Project, parameters: &CodeActionParams) -> Option<Vec<CodeActionOrCommand>> {
    let text = project.text(&parameters.text_document.uri)?;
    let mut actions = Vec::new();
    for diagnostic in &parameters.context.diagnostics {
        let Some((title, edit)) = repair(text, diagnostic) else { continue };
        #[allow(clippy::mutable_key_type, reason = "the type of the protocol")]
        let changes: HashMap<Uri, Vec<TextEdit>> = HashMap::from([(text.uri.clone(), vec![edit])]);
        actions.push(CodeActionOrCommand::CodeAction(CodeAction {
            title,
            kind: Some(CodeActionKind::QUICKFIX),
            diagnostics: Some(vec![diagnostic.clone()]),
            edit: Some(WorkspaceEdit { changes: Some(changes), ..WorkspaceEdit::default() }),
            is_preferred: Some(true),
            ..CodeAction::default()
        }));
    }
    for (title, kind, edit) in failures::actions(project, text, parameters) {
        #[allow(clippy::mutable_key_type, reason = "the type of the protocol")]
        let changes: HashMap<Uri, Vec<TextEdit>> = HashMap::from([(text.uri.clone(), vec![edit])]);
        actions.push(CodeActionOrCommand::CodeAction(CodeAction {
            title,
            kind: Some(kind),
            edit: Some(WorkspaceEdit { changes: Some(changes), ..WorkspaceEdit::default() }),
            ..CodeAction::default()
        }));
    }
    Some(actions)
}

fn repair(text: &OpenText, diagnostic: &Diagnostic) -> Option<(String, TextEdit)> {
    let Some(NumberOrString::String(code)) = &diagnostic.code else { return None };
    let help = diagnostic.data.as_ref().and_then(|data| data.get("help")?.as_str()).unwrap_or_default();
    let quoted = help.split('`').nth(1);
    let start = text.offset(diagnostic.range.start);
    let (tree, line_end) = (&text.tree, text.line_end());
    let insert = |at: usize, new: String| TextEdit::new(text.range(at..at), new);
    match (&**code, quoted) {
        ("undeclared-cause", Some(name)) if help.starts_with("did you mean") => {
            // The finding may be about the whole form that names the cause.
            let cause = diagnostic.message.split('`').nth(1)?;
            let end = text.offset(diagnostic.range.end);
            let is_cause = |&node: &NodeId| {
                let range = tree.range(node);
                (start..end).contains(&range.start)
                    && tree.name(node).is_some_and(|name| name.eq_ignore_ascii_case(cause))
            };
            let place = tree.range(tree.nodes().find(is_cause)?);
            Some((format!("Write `{name}`"), TextEdit::new(text.range(place), name.to_owned())))
        }
        ("foreign-word", Some(name)) if help.starts_with("write `") && !name.contains(['(', ' ']) => {
            let place = tree.range(name_at(tree, start)?);
            Some((format!("Write `{name}`"), TextEdit::new(text.range(place), name.to_owned())))
        }
        ("unhandled-failure" | "undeclared-failure", _) => {
            // The range is that of the declaration.
            let words = diagnostic.message.split(|c: char| c.is_whitespace() || c == ',');
            let cause = words.into_iter().find(|word| word.starts_with(':'))?;
            let end = text.offset(diagnostic.range.end).checked_sub(1)?;
            Some((format!("Declare {cause}"), insert(end, format!(" {cause}"))))
        }
        (_, Some(name)) if help.starts_with("did you mean") => {
            let place = tree.range(name_at(tree, start)?);
            Some((format!("Write `{name}`"), TextEdit::new(text.range(place), name.to_owned())))
        }
        ("unexpected-close" | "stray-character", _) => {
            let edit = TextEdit::new(diagnostic.range, String::new());
            Some(("Remove it".into(), edit))
        }
        ("unclosed-list", _) => {
            let list = tree.nodes().find(|&node| tree.range(node).start == start)?;
            Some(("Close the list with `)`".into(), insert(end_of_contents(tree, list), ")".into())))
        }
        ("undeclared-cause", Some(form)) => {
            let top = tree.data(SyntaxTree::ROOT).find(|&form| tree.range(form).contains(&start))?;
            let at = tree.range(top).start;
            Some((format!("Declare it: `{form}`"), insert(at, format!("{form}{line_end}{line_end}"))))
        }
        ("unused-variable", Some(form)) => {
            let (at, column) = place_of_declarations(text, start)?;
            let new = format!("{line_end}{}{form}", " ".repeat(column));
            Some((format!("Declare it: `{form}`"), insert(at, new)))
        }
        _ => None,
    }
}

/// Returns where the last thing in an unclosed list ends; comments may follow.
fn end_of_contents(tree: &SyntaxTree, mut list: NodeId) -> usize {
    while let Some(last) = tree.data(list).last() {
        if tree.kind(last) != SyntaxKind::List || tree.is_closed(last) {
            return tree.range(last).end;
        }
        list = last;
    }
    tree.opening_end(list)
}

/// Returns the name at a byte: itself, or the operator of the list that begins there.
fn name_at(tree: &SyntaxTree, start: usize) -> Option<NodeId> {
    let node = tree.node_at(start);
    if tree.name(node).is_some() {
        return Some(node);
    }
    (tree.kind(node) == SyntaxKind::List)
        .then(|| tree.data(node).next())?
        .filter(|&name| tree.name(name).is_some())
}

/// Returns where declarations about the variable that is bound at a byte stand, and in which column.
fn place_of_declarations(text: &OpenText, start: usize) -> Option<(usize, usize)> {
    let tree = &text.tree;
    let binding = binding_of(tree, tree.node_at(start))?;
    let data: Vec<NodeId> = tree.data(binding.scope).collect();
    let holds = |&node: &NodeId| tree.range(node).contains(&start);
    let mut at = data.iter().position(holds)?;
    match tree.operator(binding.scope).as_deref() {
        Some(
            "multiple-value-bind" | "destructuring-bind" | "do" | "do*" | "with-slots" | "with-accessors",
        ) => at += 1,
        Some("loop") => return None,
        Some(name) if name.starts_with("def") || name == "lambda" => {
            // A documentation string comes first.
            let is_string = data.get(at + 1).is_some_and(|&node| tree.text(node).starts_with('"'));
            at += usize::from(is_string && data.len() > at + 2);
        }
        _ => {}
    }
    let column = text.position(tree.range(binding.scope).start).character as usize + 2;
    Some((tree.range(*data.get(at)?).end, column))
}
