//! Renaming: the edits, and the reasons why a name cannot be another one.
//!
//! A new name must not change what any name refers to: neither may a use of the old name come under another
//! binding of the new one, nor a use of the new name under the renamed binding.

use std::collections::HashMap;
use std::fmt;
use std::ops::Range;

use esl_compiler::reader::lexer::Token;
use esl_syntax::{NodeId, SyntaxKind, SyntaxTree, bare_name};
use lsp_types::{
    Location, PrepareRenameResponse, RenameParams, TextDocumentPositionParams, TextEdit, Uri, WorkspaceEdit,
};

use super::definition::DefinedAs;
use super::document::OpenText;
use super::family::{RenamedName, family, is_made, is_slot};
use super::library::language;
use super::navigate::{NameAt, name_at, texts_of, uses_in, uses_of};
use super::project::Project;
use super::scope::{LocalBinding, LocalKind, binding_of, bindings_around, kind_at};

/// Answers whether the name at a position can be renamed.
pub(super) fn prepare_rename(
    project: &Project,
    at: &TextDocumentPositionParams,
) -> Option<PrepareRenameResponse> {
    let found = name_at(project, at)?;
    let is_own = found.binding.is_some()
        || (is_defined_by_program(project, &found) || is_made(&texts_of(project, &found), &found.name))
            && refuse_kind(project, &found).is_ok()
            && !is_slot(&found.text.tree, found.node);
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
    /// The text is not a name.
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
    /// The name is a part of other names, which are not known.
    Package(String),
    /// The name stands for a slot.
    Slot(String),
    /// A structure makes the name by a pattern, which the new name does not fit.
    Made { name: String, by: String, pattern: String },
    /// The parent of a structure, whose slots it has, is not known.
    UnknownParent { name: String, parent: String },
    /// The slot is also named in a form of this operator.
    SlotElsewhere { slot: String, form: String },
    /// The cause is also a keyword of something else, on this line.
    OtherKeyword(String, u32),
}

impl fmt::Display for RenameRefusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            RenameRefusal::NothingHere => f.write_str("expected a name here"),
            RenameRefusal::NotAName(text) => write!(f, "`{text}` is not a name"),
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
            RenameRefusal::Package(name) => {
                write!(f, "`{name}` is a package, whose name is a part of other names; change it by hand")
            }
            RenameRefusal::Slot(name) => {
                write!(f, "`{name}` is a slot here; rename an accessor of it, or change it by hand")
            }
            RenameRefusal::Made { name, by, pattern } => {
                write!(
                    f,
                    "`{name}` is made by the structure `{by}`, so a new name is of the form `{pattern}`"
                )
            }
            RenameRefusal::UnknownParent { name, parent } => write!(
                f,
                "`{name}` includes the structure `{parent}`, whose definition is not among the files that \
                 are known here"
            ),
            RenameRefusal::SlotElsewhere { slot, form } => {
                write!(f, "the slot `{slot}` is also named in a form `{form}`; change it by hand")
            }
            RenameRefusal::OtherKeyword(name, line) => {
                write!(f, "`{name}` on line {line} is an initarg, not the cause; change it by hand")
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
    // A cause may be written with its colon.
    let is_cause = found.binding.is_none() && found.name.starts_with(':');
    let new = &*parameters.new_name;
    let new = if is_cause { new.strip_prefix(':').unwrap_or(new) } else { new };
    let tree = SyntaxTree::new(new);
    let is_name = tree.data(0).count() == 1 && tree.name(1) == Some(new) && !new.contains(':');
    if !is_name || new.chars().all(|c| c == '.' || c.is_ascii_digit()) {
        return Err(RenameRefusal::NotAName(parameters.new_name.clone()));
    }
    if found.binding.is_some() {
        return rename_local(project, &found, new);
    }
    if is_slot(&found.text.tree, found.node) {
        return Err(RenameRefusal::Slot(found.name));
    }
    let texts = texts_of(project, &found);
    if !is_defined_by_program(project, &found) && !is_made(&texts, &found.name) {
        return Err(RenameRefusal::Foreign(found.name));
    }
    refuse_kind(project, &found)?;
    let wanted = format!("{}{}", if is_cause { ":" } else { "" }, new.to_lowercase());
    let family = family(&texts, &found.name, &wanted)?;
    for RenamedName { old, new } in family.names.iter().filter(|renamed| renamed.old != renamed.new) {
        refuse_defined(project, found.text, None, old, new)?;
    }
    #[allow(clippy::mutable_key_type, reason = "the type of the protocol")]
    let mut changes: HashMap<Uri, Vec<TextEdit>> = HashMap::new();
    for (at, text) in texts.iter().enumerate() {
        let mut edits = Vec::new();
        for renamed in &family.names {
            let uses: Vec<NodeId> = uses_of(text, &renamed.old, None);
            let uses = match renamed.old.starts_with(':') {
                true => causes(project, text, uses)?,
                false => uses.into_iter().filter(|&node| !is_slot(&text.tree, node)).collect(),
            };
            if renamed.old != renamed.new {
                refuse_capture(text, &uses, None, &renamed.new)?;
            }
            // The name that was asked for is written as it was asked for.
            let written = if renamed.new == wanted { new } else { renamed.new.trim_start_matches(':') };
            edits.extend(uses.into_iter().map(|node| edit(text, node, None, written)));
        }
        for (_, node, new) in family.places.iter().filter(|place| place.0 == at) {
            edits.push(TextEdit::new(text.range(bare_place(text, *node)), new.clone()));
        }
        edits.sort_by_key(|edit| (edit.range.start.line, edit.range.start.character));
        edits.dedup();
        if !edits.is_empty() {
            changes.insert(text.uri.clone(), edits);
        }
    }
    Ok(WorkspaceEdit { changes: Some(changes), ..WorkspaceEdit::default() })
}

fn rename_local(project: &Project, found: &NameAt<'_>, new: &str) -> Result<WorkspaceEdit, RenameRefusal> {
    let wanted = new.to_lowercase();
    let uses = uses_in(found.text, found);
    // Another way to write the same name changes nothing.
    if wanted != found.name {
        if found.binding.is_some_and(|binding| binding.kind == LocalKind::Function) {
            refuse_defined(project, found.text, found.binding, &found.name, &wanted)?;
        }
        refuse_capture(found.text, &uses, found.binding, &wanted)?;
    }
    let edits = uses.into_iter().map(|node| edit(found.text, node, found.binding, new)).collect();
    #[allow(clippy::mutable_key_type, reason = "the type of the protocol")]
    let changes = HashMap::from([(found.text.uri.clone(), edits)]);
    Ok(WorkspaceEdit { changes: Some(changes), ..WorkspaceEdit::default() })
}

/// Refuses to rename what cannot be renamed safely, whatever it becomes.
fn refuse_kind(project: &Project, found: &NameAt<'_>) -> Result<(), RenameRefusal> {
    let definitions = project.find(found.text, &found.name);
    match definitions.iter().any(|(definition, _)| definition.kind == DefinedAs::Package) {
        true => Err(RenameRefusal::Package(found.name.clone())),
        false => Ok(()),
    }
}

/// Returns those of the uses of a keyword that stand for a cause, and not for a parameter of what is called.
///
/// # Errors
/// One is an initarg.
fn causes(project: &Project, text: &OpenText, uses: Vec<NodeId>) -> Result<Vec<NodeId>, RenameRefusal> {
    let tree = &text.tree;
    let mut found = Vec::new();
    for node in uses {
        let list = tree.parent(node).filter(|&list| tree.kind(list) == SyntaxKind::List);
        let before = list.and_then(|list| tree.data(list).take_while(|&part| part < node).last());
        if before.is_some_and(|before| tree.text(before).eq_ignore_ascii_case(":initarg")) {
            let line = text.position(tree.range(node).start).line + 1;
            return Err(RenameRefusal::OtherKeyword(tree.text(node).to_lowercase(), line));
        }
        let is_key = list.is_some_and(|list| is_key(project, text, list, node));
        if !is_key {
            found.push(node);
        }
    }
    Ok(found)
}

/// Whether a keyword in a call names a parameter of the function.
fn is_key(project: &Project, text: &OpenText, call: NodeId, node: NodeId) -> bool {
    let tree = &text.tree;
    let Some(operator) = tree.operator(call).filter(|_| tree.data(call).next() != Some(node)) else {
        return false;
    };
    let name = tree.text(node)[1..].to_lowercase();
    if matches!(&*operator, "make-instance" | "make-condition") {
        return true;
    }
    project.find(text, &operator).iter().any(|(definition, _)| {
        let list = definition.lambda_list.clone().unwrap_or_default().to_lowercase();
        let keys = SyntaxTree::new(list.split_once("&key").map_or("", |(_, keys)| keys));
        keys.nodes().any(|key| keys.name(key).is_some_and(|key| key.trim_start_matches(':') == name))
    })
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

/// Refuses the name of another definition in the same namespace, and for functions those of the language.
fn refuse_defined(
    project: &Project,
    text: &OpenText,
    binding: Option<LocalBinding>,
    old: &str,
    new: &str,
) -> Result<(), RenameRefusal> {
    let namespace = |kind: DefinedAs| match kind {
        DefinedAs::Function | DefinedAs::Macro | DefinedAs::Operator | DefinedAs::Slot => 0,
        DefinedAs::Variable | DefinedAs::Constant => 1,
        DefinedAs::Type => 2,
        DefinedAs::Cause => 3,
        DefinedAs::Package => 4,
        DefinedAs::Test => 5,
        DefinedAs::Other => 6,
    };
    let own: Vec<u8> = match binding {
        Some(_) => vec![0],
        None => project.find(text, old).iter().map(|(name, _)| namespace(name.kind)).collect(),
    };
    if let Some(name) =
        language().find(new).filter(|name| name.is_public && own.contains(&namespace(name.definition.kind)))
    {
        return Err(RenameRefusal::OfLanguage(name.definition.name.to_string()));
    }
    let is_same_namespace =
        |kind| binding.is_none() && (own.contains(&namespace(kind)) || kind == DefinedAs::Other);
    match project.find(text, new).into_iter().find(|(name, _)| is_same_namespace(name.kind)) {
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
        let kind = binding.map_or_else(|| kind_at(tree, node), |binding| binding.kind);
        let scope = binding.map(|binding| tree.range(binding.scope));
        let captures = |other: &LocalBinding| {
            let is_inside = scope.as_ref().is_none_or(|scope| scope.start <= tree.range(other.scope).start);
            is_inside && other.kind == kind && is_new(other.name)
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
        let is_same_kind = kind_at(tree, node) == binding.kind;
        let is_free = binding_of(tree, node).is_none_or(|other| tree.range(other.scope).start < scope.start);
        if !is_quoted && is_same_kind && is_free {
            return Err(RenameRefusal::Captured(new.into(), line(node)));
        }
    }
    Ok(())
}
