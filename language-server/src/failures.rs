//! Possible failures in the editor: those of the function under the pointer, the share of its failures that a
//! form handles, and repairs that add clauses.

use std::collections::BTreeSet;

use esl_analysis::{CauseRow, HandlingForm, causes_of_function, shown_cause};
use esl_syntax::{NodeId, SyntaxKind, SyntaxTree};
use lsp_types::{CodeActionKind, CodeActionParams, CodeLens, Command, NumberOrString, TextEdit};

use super::document::OpenText;
use super::inferred::{InferredText, MovedPlaces};
use super::library::language;
use super::project::Project;
use super::scope::{is_operator, template_level};

/// Causes that a title names, of each sort.
const MAX_CAUSES: usize = 5;
/// Places where failures begin that a note names.
const MAX_PLACES: usize = 8;
/// Operators of the language whose forms have a lens.
const HANDLING: [&str; 4] = ["with-recovery-procedures", "handler-case", "handler-bind", "ignore-errors"];

/// Returns the note about the failures of a function, as Markdown.
pub(super) fn note(project: &Project, text: &OpenText, name: &str) -> Option<String> {
    let inferred = project.inferred.get(text.uri.as_str());
    let table = inferred.as_ref().map(|inferred| &inferred.table);
    let row = table.and_then(|table| table.functions.iter().find(|row| row.name == name));
    if let (Some(row), Some(inferred)) = (row, &inferred) {
        let shown = may_fail(row.causes.iter().map(CauseRow::short));
        let mut out = shown.unwrap_or_else(|| "No failure leaves it, apart from programming errors.".into());
        if row.fails_as_arguments {
            out.push_str(" It also fails as the functions do that it is given.");
        }
        out.push_str(&origins(text, inferred, &row.causes));
        return Some(out);
    }
    let of_table = table.and_then(|table| table.declared.get(name).or_else(|| table.of_modules.get(name)));
    let causes = match of_table {
        Some(causes) => causes.iter().map(shown_cause).collect(),
        None => causes_of_function(name),
    };
    may_fail(causes.iter().map(String::as_str))
}

fn may_fail<'a>(causes: impl Iterator<Item = &'a str>) -> Option<String> {
    let names: BTreeSet<String> = causes.map(|cause| format!("`{cause}`")).collect();
    let names: Vec<String> = names.into_iter().collect();
    (!names.is_empty()).then(|| format!("May fail with {}.", names.join(", ")))
}

/// Returns a list of the places where failures begin.
fn origins(text: &OpenText, inferred: &InferredText, causes: &[CauseRow]) -> String {
    let moved = inferred.moved_to(text.tree.source());
    let mut lines = Vec::new();
    for row in causes {
        for origin in &row.origins {
            let place = match inferred.is_here(&origin.place.source) {
                true => match moved.place(origin.span().start) {
                    Some(offset) => format!(", line {}", text.position(offset).line + 1),
                    None => String::new(),
                },
                false => {
                    let file = origin.place.source.rsplit('/').next().unwrap_or_default();
                    format!(", line {} of {file}", origin.place.line)
                }
            };
            lines.push(format!("- `{}` begins in `{}`{place}", row.short(), origin.function));
        }
    }
    let rest = lines.len().saturating_sub(MAX_PLACES);
    lines.truncate(MAX_PLACES);
    if rest > 0 {
        lines.push(format!("- and {rest} more"));
    }
    if lines.is_empty() { String::new() } else { format!("\n\n{}", lines.join("\n")) }
}

/// Returns the causes of a form's failures that clauses take, and those of which some pass.
fn shares(form: &HandlingForm) -> (BTreeSet<&str>, BTreeSet<&str>) {
    let passing: BTreeSet<&str> = form.passing.iter().map(CauseRow::short).collect();
    let taken = form.taken.iter().map(CauseRow::short).filter(|cause| !passing.contains(cause)).collect();
    (taken, passing)
}

/// Returns a few causes as a text.
fn listed(causes: &BTreeSet<&str>) -> String {
    let shown: Vec<&str> = causes.iter().copied().take(MAX_CAUSES).collect();
    match causes.len().saturating_sub(MAX_CAUSES) {
        0 => shown.join(", "),
        rest => format!("{} and {rest} more", shown.join(", ")),
    }
}

/// Returns the share of its failures that a form handles, in words; `None` if none comes to it.
fn title(form: &HandlingForm) -> Option<String> {
    let (taken, passing) = shares(form);
    let count = taken.len() + passing.len();
    let mut title = format!("handles {} of {count}", taken.len());
    if !taken.is_empty() {
        title.push_str(&format!(": {}", listed(&taken)));
    }
    if !passing.is_empty() {
        title.push_str(&format!("; not {}", listed(&passing)));
    }
    (count > 0).then_some(title)
}

/// Returns the node of a form of the table, as the text is now.
fn node_of(text: &OpenText, moved: MovedPlaces, form: &HandlingForm) -> Option<NodeId> {
    let start = moved.place(form.span.start)?;
    let tree = &text.tree;
    let mut node = tree.node_at(start);
    while tree.range(node).start == start {
        if tree.kind(node) == SyntaxKind::List {
            let operator = tree.operator(node)?;
            let is_other = !HANDLING.contains(&&*operator) && !language().find_all(&operator).is_empty();
            return (!is_other).then_some(node);
        }
        node = tree.parent(node)?;
    }
    None
}

/// Returns the forms of a text that handle failures, each with its node.
fn forms_of<'i>(text: &OpenText, inferred: &'i InferredText) -> Vec<(NodeId, &'i HandlingForm)> {
    let moved = inferred.moved_to(text.tree.source());
    let here = inferred.table.forms.iter().filter(|form| inferred.is_here(&form.place.source));
    here.filter_map(|form| Some((node_of(text, moved, form)?, form))).collect()
}

/// Returns the lenses of the forms that handle failures.
pub(super) fn lenses(project: &Project, text: &OpenText) -> Vec<CodeLens> {
    let Some(inferred) = project.inferred.get(text.uri.as_str()) else { return Vec::new() };
    let lens = |(node, form): (NodeId, &HandlingForm)| {
        let head = text.tree.data(node).next()?;
        // A lens without a command is only shown.
        let command = Command::new(title(form)?, String::new(), None);
        Some(CodeLens { range: text.range(text.tree.range(head)), command: Some(command), data: None })
    };
    forms_of(text, &inferred).into_iter().filter_map(lens).collect()
}

/// Returns the note about the form that handles failures whose operator a node is.
pub(super) fn note_of_form(project: &Project, text: &OpenText, node: NodeId) -> Option<String> {
    let inferred = project.inferred.get(text.uri.as_str())?;
    let list = text.tree.list_around(node)?;
    if text.tree.data(list).next() != Some(node) {
        return None;
    }
    let (_, form) = forms_of(text, &inferred).into_iter().find(|(form, _)| *form == list)?;
    let (_, passing) = shares(form);
    let mut out = format!("This form {}.", title(form)?);
    if !passing.is_empty() {
        out.push_str(&format!(" Outward:{}", origins(text, &inferred, &form.passing)));
    }
    Some(out)
}

/// Returns the end of a node, with a comment about it in the same line.
fn end_with_comment(tree: &SyntaxTree, node: NodeId) -> usize {
    let end = tree.range(node).end;
    let rest = tree.source()[end..].lines().next().unwrap_or_default();
    if rest.trim_start().starts_with(';') { end + rest.len() } else { end }
}

/// Returns blanks that are as wide as the text before a byte in its line.
fn blanks_before(tree: &SyntaxTree, at: usize) -> String {
    let before = &tree.source()[..at];
    let line = &before[before.rfind('\n').map_or(0, |newline| newline + 1)..];
    line.chars().map(|c| if c == '\t' { c } else { ' ' }).collect()
}

/// Returns whether a list whose operator is `name` is a form, as far as the text shows it: not data, a
/// declaration, or the definition of a local function.
fn is_form(tree: &SyntaxTree, list: NodeId, name: NodeId) -> bool {
    if !is_operator(tree, name) || template_level(tree, list).is_none() {
        return false;
    }
    let around = || std::iter::successors(tree.parent(list), |&node| tree.parent(node));
    let operator = |node: NodeId| tree.operator(node).unwrap_or_default();
    let is_declared = around().any(|node| matches!(&*operator(node), "declaim" | "declare" | "proclaim"));
    let defines = |(definitions, form): (NodeId, NodeId)| {
        matches!(&*operator(form), "flet" | "labels" | "macrolet")
            && tree.data(form).nth(1) == Some(definitions)
    };
    !is_declared && !around().next().zip(around().nth(1)).is_some_and(defines)
}

/// Returns the edit that adds clauses to a form of recovery procedures.
fn added(text: &OpenText, form: NodeId, causes: &[&str]) -> Option<TextEdit> {
    let tree = &text.tree;
    if tree.operator(form).as_deref() != Some("with-recovery-procedures") {
        return None;
    }
    let clauses = tree.data(form).nth(1).filter(|&list| tree.kind(list) == SyntaxKind::List)?;
    let clause = |cause: &&str| format!("({cause} :retries 1 (retry))");
    let (at, column, is_first) = match (tree.data(clauses).next(), tree.data(clauses).last()) {
        (Some(first), Some(last)) => (end_with_comment(tree, last), tree.range(first).start, false),
        _ => (tree.opening_end(clauses), tree.opening_end(clauses), true),
    };
    let break_ = format!("{}{}", text.line_end(), blanks_before(tree, column));
    let added = causes.iter().map(clause).collect::<Vec<_>>().join(&break_);
    let new = if is_first { added } else { format!("{break_}{added}") };
    Some(TextEdit::new(text.range(at..at), new))
}

/// Returns repairs that handle failures at a place, each with its title and its kind.
pub(super) fn actions(
    project: &Project,
    text: &OpenText,
    parameters: &CodeActionParams,
) -> Vec<(String, CodeActionKind, TextEdit)> {
    let mut found = Vec::new();
    let Some(inferred) = project.inferred.get(text.uri.as_str()) else { return found };
    let at = text.offset(parameters.range.start);
    let tree = &text.tree;
    let forms = forms_of(text, &inferred);
    let passing = |form: &HandlingForm| -> Vec<String> {
        let (_, passing) = shares(form);
        passing.into_iter().filter(|cause| cause.starts_with(':')).map(str::to_owned).collect()
    };
    // At the head of a form, or in its clauses.
    for (node, form) in &forms {
        let end = tree.data(*node).nth(1).map_or(0, |clauses| tree.range(clauses).end);
        if !(tree.range(*node).start..end).contains(&at) {
            continue;
        }
        let causes = passing(form);
        for cause in causes.iter().take(MAX_CAUSES) {
            let edit = added(text, *node, &[cause]);
            found.extend(
                edit.map(|edit| (format!("Add a clause for {cause}"), CodeActionKind::QUICKFIX, edit)),
            );
        }
        if causes.len() > 1 {
            let all: Vec<&str> = causes.iter().map(String::as_str).collect();
            let title = format!("Add clauses for all {} causes", all.len());
            found.extend(added(text, *node, &all).map(|edit| (title, CodeActionKind::QUICKFIX, edit)));
        }
    }
    // For a failure that ends a task: in the forms that it passes.
    for diagnostic in &parameters.context.diagnostics {
        if diagnostic.code != Some(NumberOrString::String("unhandled-failure".into())) {
            continue;
        }
        let mut words = diagnostic.message.split(|c: char| c.is_whitespace() || c == ',');
        let Some(cause) = words.find(|word| word.starts_with(':')) else { continue };
        for (node, _) in forms.iter().filter(|(_, form)| passing(form).iter().any(|one| one == cause)) {
            let line = text.position(tree.range(*node).start).line + 1;
            let title = format!("Add a clause for {cause} to the form on line {line}");
            found.extend(added(text, *node, &[cause]).map(|edit| (title, CodeActionKind::QUICKFIX, edit)));
        }
    }
    found.extend(wrapped(text, &inferred, at));
    found
}

/// Returns the change that puts a form of recovery procedures around the call whose function is named at a
/// byte.
fn wrapped(
    text: &OpenText,
    inferred: &InferredText,
    at: usize,
) -> Option<(String, CodeActionKind, TextEdit)> {
    let tree = &text.tree;
    let node = tree.node_at(at);
    let call = tree.list_around(node)?;
    if tree.data(call).next() != Some(node) || !tree.is_closed(call) || !is_form(tree, call, node) {
        return None;
    }
    let name = tree.operator(call)?;
    let row = inferred.table.functions.iter().find(|row| row.name == name)?;
    let causes: BTreeSet<&str> =
        row.causes.iter().map(CauseRow::short).filter(|cause| cause.starts_with(':')).collect();
    if causes.is_empty() {
        return None;
    }
    let range = tree.range(call);
    let (blanks, line_end) = (blanks_before(tree, range.start), text.line_end());
    let clauses: Vec<String> = causes.iter().map(|cause| format!("({cause} :retries 1 (retry))")).collect();
    let between = format!("{line_end}{blanks}{}", " ".repeat("(with-recovery-procedures (".len()));
    // A string of several lines would change with them.
    let has_long_string = tree.nodes().any(|node| {
        range.contains(&tree.range(node).start)
            && tree.text(node).starts_with('"')
            && tree.text(node).contains('\n')
    });
    let body = match has_long_string {
        true => tree.text(call).to_owned(),
        false => tree.text(call).replace('\n', "\n  "),
    };
    let new = format!("(with-recovery-procedures ({}){line_end}{blanks}  {body})", clauses.join(&between));
    let title = format!("Recover from {} here", listed(&causes));
    Some((title, CodeActionKind::REFACTOR, TextEdit::new(text.range(range), new)))
}
