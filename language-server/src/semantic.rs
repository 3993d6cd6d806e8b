//! Semantic tokens: what colours tell. Forms about failure and about tasks have a modifier of their own.

use esl_compiler::reader::lexer::Token;
use esl_syntax::{NodeId, SyntaxKind, bare_name};
use lsp_types::{
    SemanticToken, SemanticTokenModifier, SemanticTokenType, SemanticTokens, SemanticTokensLegend,
    SemanticTokensParams, SemanticTokensRangeParams, SemanticTokensRangeResult, SemanticTokensResult,
};

use super::definition::DefinedAs;
use super::document::OpenText;
use super::library::language;
use super::project::Project;
use super::scope::{is_operator, is_qualifier};

const TYPES: [SemanticTokenType; 8] = [
    SemanticTokenType::COMMENT,
    SemanticTokenType::STRING,
    SemanticTokenType::NUMBER,
    SemanticTokenType::KEYWORD,
    SemanticTokenType::MACRO,
    SemanticTokenType::FUNCTION,
    SemanticTokenType::ENUM_MEMBER,
    SemanticTokenType::PARAMETER,
];

/// The modifiers, each of which is a bit.
const MODIFIERS: [&str; 4] = ["definition", "defaultLibrary", "failure", "task"];
const DEFINITION: u32 = 1;
const LIBRARY: u32 = 2;
const FAILURE: u32 = 4;
const TASK: u32 = 8;

const FAILURE_FORMS: &[&str] = &[
    "fail",
    "abort",
    "retry",
    "with-recovery-procedures",
    "with-cleanup-procedure",
    "unwind-protect",
    "error",
    "signal",
    "handler-case",
    "handler-bind",
    "restart-case",
    "ignore-errors",
    "define-cause",
    "fails",
    "signals",
];
const TASK_FORMS: &[&str] = &[
    "spawn",
    "task-net",
    "or-parallel",
    "try-all",
    "pursue",
    "try-in-order",
    "partial-order",
    "supervise",
    "with-guardian",
    "wait-for-events",
    "wait-until",
    "whenever",
    "sleep",
    "with-timeout",
    "with-budget",
    "with-quota",
    "do-every",
    "abort-task",
    "suspend-task",
    "resume-task",
    "join",
    "on-signal",
    "without-interrupts",
    "with-resource",
    "with-resources",
    "with-maintained-property",
    "with-maintained-properties",
    "start",
];

pub(super) fn legend() -> SemanticTokensLegend {
    SemanticTokensLegend {
        token_types: TYPES.to_vec(),
        token_modifiers: MODIFIERS.map(SemanticTokenModifier::new).to_vec(),
    }
}

pub(super) fn full(project: &Project, parameters: &SemanticTokensParams) -> Option<SemanticTokensResult> {
    let text = project.text(&parameters.text_document.uri)?;
    Some(SemanticTokensResult::Tokens(tokens(text, text.tree.nodes())))
}

pub(super) fn range(
    project: &Project,
    parameters: &SemanticTokensRangeParams,
) -> Option<SemanticTokensRangeResult> {
    let text = project.text(&parameters.text_document.uri)?;
    let (start, end) = (text.offset(parameters.range.start), text.offset(parameters.range.end));
    let nodes = text.tree.first_at(start)..text.tree.first_at(end.max(start));
    Some(SemanticTokensRangeResult::Tokens(tokens(text, nodes)))
}

fn tokens(text: &OpenText, nodes: std::ops::Range<NodeId>) -> SemanticTokens {
    let mut data = Vec::new();
    let (mut line, mut column) = (0, 0);
    for node in nodes {
        let Some((kind, modifiers)) = classify(text, node) else { continue };
        let Some(kind) = TYPES.iter().position(|known| *known == kind) else { continue };
        // A token of several lines is one for each of them.
        let mut at = text.tree.range(node).start;
        for part in text.tree.text(node).split_inclusive('\n') {
            let shown = part.trim_end_matches(['\n', '\r']);
            if !shown.is_empty() {
                let place = text.position(at);
                let delta_line = place.line - line;
                data.push(SemanticToken {
                    delta_line,
                    delta_start: if delta_line == 0 { place.character - column } else { place.character },
                    length: text.width(shown),
                    token_type: kind as u32,
                    token_modifiers_bitset: modifiers,
                });
                (line, column) = (place.line, place.character);
            }
            at += part.len();
        }
    }
    SemanticTokens { result_id: None, data }
}

fn classify(text: &OpenText, node: NodeId) -> Option<(SemanticTokenType, u32)> {
    let tree = &text.tree;
    match tree.kind(node) {
        SyntaxKind::Comment | SyntaxKind::BlockComment => Some((SemanticTokenType::COMMENT, 0)),
        SyntaxKind::Leaf(Token::String | Token::Character) => Some((SemanticTokenType::STRING, 0)),
        SyntaxKind::Leaf(Token::Radix | Token::BitVector) => Some((SemanticTokenType::NUMBER, 0)),
        SyntaxKind::Leaf(Token::LogicalVariable) => Some((SemanticTokenType::PARAMETER, 0)),
        SyntaxKind::Leaf(Token::Atom | Token::Escaped) => of_name(text, node),
        _ => None,
    }
}

fn of_name(text: &OpenText, node: NodeId) -> Option<(SemanticTokenType, u32)> {
    let tree = &text.tree;
    let written = tree.text(node);
    if is_qualifier(tree, node) {
        return Some((SemanticTokenType::KEYWORD, 0));
    }
    if written.starts_with(':') {
        return Some((SemanticTokenType::ENUM_MEMBER, 0));
    }
    let digits = written.trim_start_matches(['+', '-', '.']);
    if digits.starts_with(|c: char| c.is_ascii_digit()) && !matches!(written, "1+" | "1-") {
        return Some((SemanticTokenType::NUMBER, 0));
    }
    if written.starts_with('&') || written.starts_with('?') {
        return Some((SemanticTokenType::PARAMETER, 0));
    }
    let parent = tree.parent(node)?;
    if tree.kind(parent) == SyntaxKind::List
        && tree.data(parent).nth(1) == Some(node)
        && tree.operator(parent).is_some_and(|operator| operator.starts_with("def"))
    {
        return Some((SemanticTokenType::FUNCTION, DEFINITION));
    }
    if !is_operator(tree, node) {
        return None;
    }
    let name = bare_name(written);
    let mut modifiers = 0;
    if FAILURE_FORMS.contains(&&*name) {
        modifiers |= FAILURE;
    }
    if TASK_FORMS.contains(&&*name) {
        modifiers |= TASK;
    }
    match language().find(&name).map(|found| found.definition.kind) {
        Some(DefinedAs::Operator) => Some((SemanticTokenType::KEYWORD, modifiers | LIBRARY)),
        Some(DefinedAs::Macro) => Some((SemanticTokenType::MACRO, modifiers | LIBRARY)),
        Some(_) => Some((SemanticTokenType::FUNCTION, modifiers | LIBRARY)),
        None => Some((SemanticTokenType::FUNCTION, modifiers)),
    }
}
