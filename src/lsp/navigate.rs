//! From names to their definitions and uses.

use std::collections::HashMap;

use esl_compiler::reader::lexer::Token;
use lsp_types::{
    DocumentHighlight, DocumentHighlightParams, GotoDefinitionParams, GotoDefinitionResponse, Location,
    PrepareRenameResponse, ReferenceParams, RenameParams, TextDocumentPositionParams, TextEdit, Uri,
    WorkspaceEdit,
};

use super::document::OpenText;
use super::library::language;
use super::project::Project;
use super::scope::{LocalBinding, binding_of};
use crate::syntax::{NodeId, SyntaxKind, SyntaxTree, bare_name};

/// The name at a position: the text, the node, and its binding if it is local.
struct NameAt<'a> {
    text: &'a OpenText,
    node: NodeId,
    name: String,
    binding: Option<LocalBinding>,
}

fn name_at<'a>(project: &'a Project, at: &TextDocumentPositionParams) -> Option<NameAt<'a>> {
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
    let found = name_at(project, &parameters.text_document_position_params)?;
    if let Some(binding) = found.binding {
        let place = found.text.location(found.text.tree.range(binding.name));
        return Some(GotoDefinitionResponse::Scalar(place));
    }
    let places: Vec<Location> =
        project.find(found.text, &found.name).into_iter().filter_map(|(_, place)| place).collect();
    (!places.is_empty()).then_some(GotoDefinitionResponse::Array(places))
}

/// Returns the uses of a name in one text, definitions included.
fn uses_in(text: &OpenText, found: &NameAt<'_>) -> Vec<NodeId> {
    let tree = &text.tree;
    let nodes = match found.binding {
        Some(binding) => {
            let scope = tree.range(binding.scope);
            tree.first_at(scope.start)..tree.first_at(scope.end)
        }
        None => tree.nodes(),
    };
    let is_same = |&node: &NodeId| {
        if found.binding.is_none() && is_designator(tree, node, &found.name) {
            return true;
        }
        tree.name(node).is_some_and(|name| bare_name(name) == found.name)
            && binding_of(tree, node).map(|binding| binding.name) == found.binding.map(|binding| binding.name)
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
fn texts_of(project: &Project, found: &NameAt<'_>) -> Vec<OpenText> {
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

/// Answers whether the name at a position can be renamed.
pub(super) fn prepare_rename(
    project: &Project,
    at: &TextDocumentPositionParams,
) -> Option<PrepareRenameResponse> {
    let found = name_at(project, at)?;
    let is_own = found.binding.is_some() || is_defined_by_program(project, &found);
    let range = found.text.range(bare_place(found.text, found.node));
    is_own.then_some(PrepareRenameResponse::Range(range))
}

/// Whether the program itself defines a global name, and the language does not.
fn is_defined_by_program(project: &Project, found: &NameAt<'_>) -> bool {
    let is_language = language().find(&found.name).is_some_and(|name| name.is_public);
    let definitions = project.find(found.text, &found.name);
    // A module that comes with the machine is shown as a copy: its file is not to be changed.
    let cache = super::library::cache_folder();
    let is_copy = |place: &Location| super::document::path_of(&place.uri).starts_with(&cache);
    let is_own = |place: &Option<Location>| place.as_ref().is_some_and(|place| !is_copy(place));
    !is_language && definitions.iter().any(|(_, place)| is_own(place))
}

/// Returns the place of a name without its package.
fn bare_place(text: &OpenText, node: NodeId) -> std::ops::Range<usize> {
    let place = text.tree.range(node);
    let name = text.tree.text(node);
    let package = name.rfind(':').map_or(0, |at| at + 1);
    place.start + package..place.end
}

/// Renames the name at a position in its text and, if it is global, in all that share it.
///
/// # Errors
/// Why it cannot be renamed.
pub(super) fn rename(project: &Project, parameters: &RenameParams) -> Result<WorkspaceEdit, String> {
    let found = name_at(project, &parameters.text_document_position).ok_or("there is no name here")?;
    let new = &parameters.new_name;
    let tree = SyntaxTree::new(new.as_str());
    let is_name = tree.data(0).count() == 1 && tree.name(1) == Some(new) && !new.contains(':');
    if !is_name || new.chars().all(|c| c == '.' || c.is_ascii_digit()) {
        return Err(format!("`{new}` is no name"));
    }
    if found.binding.is_none() && !is_defined_by_program(project, &found) {
        return Err(format!("`{}` does not belong to this program", found.name));
    }
    #[allow(clippy::mutable_key_type, reason = "the type of the protocol")]
    let mut changes: HashMap<Uri, Vec<TextEdit>> = HashMap::new();
    for text in texts_of(project, &found) {
        let uses = uses_in(&text, &found).into_iter();
        let edits: Vec<TextEdit> =
            uses.map(|node| TextEdit::new(text.range(bare_place(&text, node)), new.clone())).collect();
        if !edits.is_empty() {
            changes.insert(text.uri.clone(), edits);
        }
    }
    Ok(WorkspaceEdit { changes: Some(changes), ..WorkspaceEdit::default() })
}
