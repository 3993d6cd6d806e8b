//! From names to their definitions and uses.

use esl_compiler::reader::lexer::Token;
use esl_syntax::{NodeId, SyntaxKind, SyntaxTree, bare_name};
use lsp_types::{
    DocumentHighlight, DocumentHighlightParams, GotoDefinitionParams, GotoDefinitionResponse, Location,
    ReferenceParams, TextDocumentPositionParams,
};

use super::document::OpenText;
use super::links;
use super::project::Project;
use super::scope::{LocalBinding, binding_of};
use super::uses::NameBindings;

/// The name at a position: the text, the node, and its binding if it is local.
pub(super) struct NameAt<'a> {
    pub(super) text: &'a OpenText,
    pub(super) node: NodeId,
    pub(super) name: String,
    pub(super) binding: Option<LocalBinding>,
}

pub(super) fn name_at<'a>(project: &'a Project, at: &TextDocumentPositionParams) -> Option<NameAt<'a>> {
    let text = project.text(&at.text_document.uri)?;
    let node = text.tree.node_at(text.offset(at.position));
    let name = bare_name(text.tree.name(node)?);
    Some(NameAt { text, node, name, binding: binding_of(&text.tree, node) })
}

/// Answers where the name at a position is defined.
pub(super) fn definition(
    project: &Project,
    parameters: &GotoDefinitionParams,
) -> Option<GotoDefinitionResponse> {
    let at = &parameters.text_document_position_params;
    if let Some(module) = links::module_at(project, at) {
        return Some(GotoDefinitionResponse::Scalar(module));
    }
    let found = name_at(project, at)?;
    if let Some(binding) = found.binding {
        let place = found.text.location(found.text.tree.range(binding.name));
        return Some(GotoDefinitionResponse::Scalar(place));
    }
    let places: Vec<Location> =
        project.find(found.text, &found.name).into_iter().filter_map(|(_, place)| place).collect();
    (!places.is_empty()).then_some(GotoDefinitionResponse::Array(places))
}

/// Returns the uses of a name in one text, definitions included.
pub(super) fn uses_in(text: &OpenText, found: &NameAt<'_>) -> Vec<NodeId> {
    uses_of(text, &found.name, found.binding)
}

/// As [`uses_in`], of a name and its binding if it is local.
pub(super) fn uses_of(text: &OpenText, wanted: &str, bound: Option<LocalBinding>) -> Vec<NodeId> {
    let tree = &text.tree;
    let nodes = match bound {
        Some(binding) => {
            let scope = tree.range(binding.scope);
            tree.first_at(scope.start)..tree.first_at(scope.end)
        }
        None => tree.nodes(),
    };
    let bindings = NameBindings::new(tree, wanted);
    let is_same = |&node: &NodeId| {
        if bound.is_none() && is_designator(tree, node, wanted) {
            return true;
        }
        tree.name(node).is_some_and(|name| bare_name(name) == wanted)
            && bindings.binding_of(node).map(|binding| binding.name) == bound.map(|binding| binding.name)
    };
    nodes.filter(is_same).collect()
}

/// Whether a node names something in the clause of a package: `#:name`, or `:name`.
fn is_designator(tree: &SyntaxTree, node: NodeId, name: &str) -> bool {
    if !matches!(tree.kind(node), SyntaxKind::Leaf(Token::Uninterned | Token::Atom)) {
        return false;
    }
    let written = tree.text(node);
    let bare = written.strip_prefix("#:").or_else(|| written.strip_prefix(':'));
    bare.is_some_and(|bare| bare.to_lowercase() == name)
        && tree.parent(node).and_then(|clause| tree.operator(clause)).is_some_and(|operator| {
            matches!(&*operator, ":export" | ":import-from" | ":shadow" | ":shadowing-import-from")
        })
}

/// Returns the texts in which a name may be used: its own; for a global name the modules, and what of the
/// workspace requires or defines it.
pub(super) fn texts_of(project: &Project, found: &NameAt<'_>) -> Vec<OpenText> {
    if found.binding.is_some() {
        return vec![found.text.clone()];
    }
    let modules = project.modules(found.text);
    let is_module = |text: &OpenText| modules.iter().any(|module| module.uri == text.uri);
    let others = project.workspace().into_iter().filter(|text| {
        text.uri != found.text.uri
            && !is_module(text)
            && project.modules(text).iter().any(|module| module.uri == found.text.uri || is_module(module))
    });
    let mut texts: Vec<OpenText> = others.collect();
    texts.insert(0, found.text.clone());
    texts.extend(modules);
    texts
}

/// Answers where the name at a position is used.
pub(super) fn references(project: &Project, parameters: &ReferenceParams) -> Option<Vec<Location>> {
    let found = name_at(project, &parameters.text_document_position)?;
    let mut places = Vec::new();
    for text in texts_of(project, &found) {
        let definitions: Vec<_> = match parameters.context.include_declaration {
            true => Vec::new(),
            false => super::definition::definitions(&text.tree).into_iter().map(|d| d.name_place).collect(),
        };
        let uses = uses_in(&text, &found).into_iter().map(|node| text.tree.range(node));
        let uses = uses.filter(|place| !definitions.contains(place));
        places.extend(uses.map(|place| text.location(place)));
    }
    Some(places)
}

/// Answers which names in the text are the same as that at a position.
pub(super) fn highlights(
    project: &Project,
    parameters: &DocumentHighlightParams,
) -> Option<Vec<DocumentHighlight>> {
    let found = name_at(project, &parameters.text_document_position_params)?;
    let uses = uses_in(found.text, &found).into_iter();
    let highlight =
        |node| DocumentHighlight { range: found.text.range(found.text.tree.range(node)), kind: None };
    Some(uses.map(highlight).collect())
}
