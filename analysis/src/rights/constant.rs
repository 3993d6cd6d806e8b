//! Constants in calls: texts, names, lists of texts.

use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::symbol::Symbol;
use esl_compiler::core::{Core, NodeId, NodeKind};

use super::symbol_of;

/// Returns whether a node is the constant `NIL`.
pub(super) fn is_nil(core: &Core, node: NodeId) -> bool {
    matches!(&core.nodes[node.index()].kind, NodeKind::Constant(datum) if datum.is_nil())
}

/// Returns the keyword that a node is.
pub(super) fn keyword(core: &Core, node: NodeId) -> Option<Symbol> {
    match &core.nodes[node.index()].kind {
        NodeKind::Constant(datum) => datum.as_symbol().filter(|symbol| symbol.is_keyword()).cloned(),
        _ => None,
    }
}

/// Returns the name that a constant is, a string or a symbol, in lower case.
pub(super) fn constant_name(core: &Core, node: NodeId) -> Option<String> {
    let text = constant_text(core, node).or_else(|| match &core.nodes[node.index()].kind {
        NodeKind::Constant(datum) => datum.as_symbol().map(|symbol| symbol.name().to_string()),
        _ => None,
    });
    text.map(|text| text.to_lowercase())
}

/// Returns the strings that a node names: one, a quoted list of some, or a call of `list`.
pub(super) fn constant_texts(core: &Core, node: NodeId) -> Option<Vec<String>> {
    if let Some(text) = constant_text(core, node) {
        return Some(vec![text]);
    }
    match &core.nodes[node.index()].kind {
        NodeKind::Constant(datum) => {
            let text = |item: &Datum| match item.kind() {
                DatumKind::String(text) => Some(text.to_string()),
                _ => None,
            };
            datum.elements().map(text).collect()
        }
        NodeKind::Call(callee, items) if symbol_of(callee)?.is_cl("LIST") => {
            items.iter().map(|item| constant_text(core, *item)).collect()
        }
        _ => None,
    }
}

/// Returns a constant as a text: a string, or the digits of an integer.
pub(super) fn constant_text(core: &Core, node: NodeId) -> Option<String> {
    match &core.nodes[node.index()].kind {
        NodeKind::Constant(datum) => match datum.kind() {
            DatumKind::String(text) => Some(text.to_string()),
            DatumKind::Integer(number) => Some(number.to_string()),
            _ => None,
        },
        _ => None,
    }
}

/// Returns the program of a command that a node names: the first of a quoted list, or of a call of `list`.
pub(super) fn program_of(core: &Core, node: NodeId) -> Option<String> {
    match &core.nodes[node.index()].kind {
        NodeKind::Constant(datum) => match datum.elements().next()?.kind() {
            DatumKind::String(text) => Some(text.to_string()),
            _ => None,
        },
        NodeKind::Call(callee, items) => {
            let symbol = symbol_of(callee)?;
            let is_list = symbol.is_cl("LIST") || symbol.is_cl("LIST*") || symbol.is_cl("CONS");
            is_list.then(|| constant_text(core, *items.first()?))?
        }
        _ => None,
    }
}
