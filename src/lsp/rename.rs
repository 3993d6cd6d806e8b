//! Renaming: the edits, and the reasons why a name cannot be another one.
//!
//! A new name must not change what any name refers to: neither may a use of the old name come under another
//! binding of the new one, nor a use of the new name under the renamed binding.

use std::collections::HashMap;
use std::fmt;
use std::ops::Range;

use esl_compiler::reader::lexer::Token;
use lsp_types::{
    Location, PrepareRenameResponse, RenameParams, TextDocumentPositionParams, TextEdit, Uri, WorkspaceEdit,
};

use super::definition::DefinedAs;
use super::document::OpenText;
use super::library::language;
use super::navigate::{NameAt, name_at, texts_of, uses_in};
use super::project::Project;
use super::scope::{LocalBinding, LocalSort, binding_of, bindings_around, sort_at};
use crate::syntax::{NodeId, SyntaxKind, SyntaxTree, bare_name};

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
fn bare_place(text: &OpenText, node: NodeId) -> Range<usize> {
    let place = text.tree.range(node);
    let name = text.tree.text(node);
    let package = name.rfind(':').map_or(0, |at| at + 1);
    place.start + package..place.end
}

/// Reason why a name is not renamed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum RenameRefusal {
    /// There is no name at the position.
    NothingHere,
    /// The text is no name.
    NotAName(String),
    /// The name does not belong to this program.
    Foreign(String),
    /// The new name belongs to the language.
    OfLanguage(String),
    /// The new name is defined already, on this line if that is known.
    Defined(String, Option<u32>),
    /// The new name is bound where the old one is used, on this line.
    Bound(String, u32),
    /// The new name, on this line, would mean the renamed one.
    Captured(String, u32),
}

impl fmt::Display for RenameRefusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            RenameRefusal::NothingHere => f.write_str("there is no name here"),
            RenameRefusal::NotAName(text) => write!(f, "`{text}` is no name"),
            RenameRefusal::Foreign(name) => write!(f, "`{name}` does not belong to this program"),
            RenameRefusal::OfLanguage(name) => write!(f, "`{name}` belongs to the language"),
            RenameRefusal::Defined(name, None) => write!(f, "`{name}` is defined already"),
            RenameRefusal::Defined(name, Some(line)) => {
                write!(f, "`{name}` is defined already, on line {line}")
            }
            RenameRefusal::Bound(name, line) => {
                write!(f, "`{name}` is another local name here: it is bound on line {line}")
            }
            RenameRefusal::Captured(name, line) => {
                write!(f, "`{name}` on line {line} would mean the renamed one")
            }
        }
    }
}

/// Renames the name at a position in its text and, if it is global, in all that share it.
///
/// # Errors
/// Why it cannot be renamed.
pub(super) fn rename(project: &Project, parameters: &RenameParams) -> Result<WorkspaceEdit, RenameRefusal> {
    let found = name_at(project, &parameters.text_document_position).ok_or(RenameRefusal::NothingHere)?;
    let new = &parameters.new_name;
    let tree = SyntaxTree::new(new.as_str());
    let is_name = tree.data(0).count() == 1 && tree.name(1) == Some(new) && !new.contains(':');
    if !is_name || new.chars().all(|c| c == '.' || c.is_ascii_digit()) {
        return Err(RenameRefusal::NotAName(new.clone()));
    }
    if found.binding.is_none() && !is_defined_by_program(project, &found) {
        return Err(RenameRefusal::Foreign(found.name.to_string()));
    }
    let wanted = new.to_lowercase();
    // Another way to write the same name changes nothing.
    let is_other = wanted != found.name;
    if is_other && found.binding.is_none_or(|binding| binding.sort == LocalSort::Function) {
        refuse_defined(project, &found, &wanted)?;
    }
    #[allow(clippy::mutable_key_type, reason = "the type of the protocol")]
    let mut changes: HashMap<Uri, Vec<TextEdit>> = HashMap::new();
    for text in texts_of(project, &found) {
        let uses = uses_in(&text, &found);
        if is_other {
            refuse_capture(&text, &uses, found.binding, &wanted)?;
        }
        let edits: Vec<TextEdit> =
            uses.into_iter().map(|node| edit(&text, node, found.binding, new)).collect();
        if !edits.is_empty() {
            changes.insert(text.uri.clone(), edits);
        }
    }
    Ok(WorkspaceEdit { changes: Some(changes), ..WorkspaceEdit::default() })
}

/// Returns the edit of one use. A keyword parameter keeps its keyword, by which callers name it.
fn edit(text: &OpenText, node: NodeId, binding: Option<LocalBinding>, new: &str) -> TextEdit {
    let place = bare_place(text, node);
    let old = &text.tree.source()[place.clone()];
    let written =
        match binding.filter(|binding| binding.name == node).and_then(|_| key_parameter(&text.tree, node)) {
            Some(WrittenKey::Alone) => format!("((:{old} {new}))"),
            Some(WrittenKey::WithDefault) => format!("(:{old} {new})"),
            None => new.to_owned(),
        };
    TextEdit::new(text.range(place), written)
}

/// How a parameter after `&key` is written.
enum WrittenKey {
    /// `name`
    Alone,
    /// `(name default)`
    WithDefault,
}

fn key_parameter(tree: &SyntaxTree, name: NodeId) -> Option<WrittenKey> {
    let parent = tree.parent(name)?;
    let follows_key = |list: NodeId, item: NodeId| {
        let before = tree.data(list).take_while(|&other| other != item);
        let words = before.filter_map(|other| tree.name(other)).filter(|word| word.starts_with('&'));
        words.last().is_some_and(|word| word.eq_ignore_ascii_case("&key"))
    };
    if follows_key(parent, name) {
        return Some(WrittenKey::Alone);
    }
    let list = tree.parent(parent)?;
    let is_first = tree.data(parent).next() == Some(name);
    (is_first && tree.kind(list) == SyntaxKind::List && follows_key(list, parent))
        .then_some(WrittenKey::WithDefault)
}

/// Refuses the name of another definition of the same sort, and for functions those of the language.
fn refuse_defined(project: &Project, found: &NameAt<'_>, new: &str) -> Result<(), RenameRefusal> {
    let sort = |kind: DefinedAs| match kind {
        DefinedAs::Function | DefinedAs::Macro | DefinedAs::Operator | DefinedAs::Slot => 0,
        DefinedAs::Variable | DefinedAs::Constant => 1,
        DefinedAs::Type => 2,
        DefinedAs::Cause => 3,
        DefinedAs::Package => 4,
        DefinedAs::Test => 5,
        DefinedAs::Other => 6,
    };
    let own: Vec<u8> = match found.binding {
        Some(_) => vec![0],
        None => project.find(found.text, &found.name).iter().map(|(name, _)| sort(name.kind)).collect(),
    };
    if let Some(name) =
        language().find(new).filter(|name| name.is_public && own.contains(&sort(name.definition.kind)))
    {
        return Err(RenameRefusal::OfLanguage(name.definition.name.to_string()));
    }
    let is_same_sort =
        |kind| found.binding.is_none() && (own.contains(&sort(kind)) || kind == DefinedAs::Other);
    match project.find(found.text, new).into_iter().find(|(name, _)| is_same_sort(name.kind)) {
        Some((_, place)) => {
            let line = place.map(|place| place.range.start.line + 1);
            Err(RenameRefusal::Defined(new.into(), line))
        }
        None => Ok(()),
    }
}

/// Refuses a name by which a use would come under another binding, or another name under this one.
fn refuse_capture(
    text: &OpenText,
    uses: &[NodeId],
    binding: Option<LocalBinding>,
    new: &str,
) -> Result<(), RenameRefusal> {
    let tree = &text.tree;
    let line = |node: NodeId| text.position(tree.range(node).start).line + 1;
    let is_new = |name: NodeId| tree.name(name).map(bare_name).is_some_and(|name| name == new);
    for &node in uses {
        let sort = binding.map_or_else(|| sort_at(tree, node), |binding| binding.sort);
        let scope = binding.map(|binding| tree.range(binding.scope));
        let captures = |other: &LocalBinding| {
            let is_inside = scope.as_ref().is_none_or(|scope| scope.start <= tree.range(other.scope).start);
            is_inside && other.sort == sort && is_new(other.name)
        };
        if let Some(other) = bindings_around(tree, node).into_iter().find(captures) {
            return Err(RenameRefusal::Bound(new.into(), line(other.name)));
        }
    }
    let Some(binding) = binding else { return Ok(()) };
    let scope = tree.range(binding.scope);
    for node in (tree.first_at(scope.start)..tree.first_at(scope.end)).filter(|&node| is_new(node)) {
        let is_quoted =
            tree.parent(node).is_some_and(|mark| tree.kind(mark) == SyntaxKind::Mark(Token::Quote));
        let is_same_sort = sort_at(tree, node) == binding.sort;
        let is_free = binding_of(tree, node).is_none_or(|other| tree.range(other.scope).start < scope.start);
        if !is_quoted && is_same_sort && is_free {
            return Err(RenameRefusal::Captured(new.into(), line(node)));
        }
    }
    Ok(())
}
