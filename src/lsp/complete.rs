//! Completion: local names, what the file and its modules define, the language, and keywords.

use std::collections::HashSet;

use esl_compiler::reader::lexer::Token;
use lsp_types::{
    CompletionItem, CompletionItemKind, CompletionList, CompletionParams, CompletionResponse,
    CompletionTextEdit, Documentation, MarkupContent, MarkupKind, TextEdit,
};

use super::definition::{DefinedAs, NameDefinition, definitions};
use super::describe::{call_at, markdown, usage};
use super::document::OpenText;
use super::library::language;
use super::project::Project;
use super::scope::bindings_around;
use crate::syntax::{SyntaxKind, bare_name};

/// Names that are offered at once; the rest comes as more is typed.
const MAX_ITEMS: usize = 400;

/// The names found so far.
struct Candidates<'a> {
    text: &'a OpenText,
    place: std::ops::Range<usize>,
    prefix: String,
    items: Vec<CompletionItem>,
    known: HashSet<String>,
    is_cut: bool,
}

impl Candidates<'_> {
    fn add(&mut self, name: &str, kind: CompletionItemKind, rank: u32, definition: Option<&NameDefinition>) {
        if !name.starts_with(&self.prefix) || !self.known.insert(name.to_owned()) {
            return;
        }
        if self.items.len() == MAX_ITEMS {
            self.is_cut = true;
            return;
        }
        let edit = TextEdit::new(self.text.range(self.place.clone()), name.to_owned());
        let documentation = definition.map(|definition| {
            let value = markdown(definition);
            Documentation::MarkupContent(MarkupContent { kind: MarkupKind::Markdown, value })
        });
        self.items.push(CompletionItem {
            label: name.to_owned(),
            kind: Some(kind),
            detail: definition.map(usage),
            documentation,
            sort_text: Some(format!("{rank}{name}")),
            text_edit: Some(CompletionTextEdit::Edit(edit)),
            ..CompletionItem::default()
        });
    }
}

/// Answers which names fit at a position.
pub(super) fn complete(project: &Project, parameters: &CompletionParams) -> Option<CompletionResponse> {
    let at = &parameters.text_document_position;
    let text = project.text(&at.text_document.uri)?;
    let offset = text.offset(at.position);
    let tree = &text.tree;
    let node = tree.node_at(offset);
    // Nothing is completed in strings and comments.
    let start = match tree.kind(node) {
        SyntaxKind::Leaf(Token::Atom | Token::Escaped) => tree.range(node).start,
        SyntaxKind::Leaf(_) | SyntaxKind::Comment | SyntaxKind::BlockComment => return None,
        _ => offset,
    };
    let is_comment = tree.nodes().contains(&(tree.first_at(offset).wrapping_sub(1)))
        && tree.kind(tree.first_at(offset) - 1) == SyntaxKind::Comment
        && tree.range(tree.first_at(offset) - 1).end >= offset;
    if is_comment {
        return None;
    }
    let prefix = tree.source()[start..offset].to_lowercase();
    let mut found = Candidates {
        text,
        place: start..offset,
        prefix,
        items: Vec::new(),
        known: HashSet::new(),
        is_cut: false,
    };
    if found.prefix.starts_with(':') {
        keywords(project, &mut found, offset);
    } else if let Some((package, _)) = found.prefix.clone().split_once(':') {
        in_package(project, &mut found, package);
    } else {
        names(project, &mut found, node);
    }
    let is_incomplete = found.is_cut;
    Some(CompletionResponse::List(CompletionList { is_incomplete, items: found.items }))
}

/// Adds keywords: those of the call, then those that the file uses, its causes among them.
fn keywords(project: &Project, found: &mut Candidates<'_>, offset: usize) {
    let text = found.text;
    if let Some((list, _)) = call_at(text, offset)
        && let Some(name) = text.tree.operator(list)
    {
        for (definition, _) in project.find(text, &name) {
            let list = definition.lambda_list.clone().unwrap_or_default().to_lowercase();
            let Some((_, keys)) = list.split_once("&key") else { continue };
            let tree = crate::syntax::SyntaxTree::new(keys);
            for key in tree.data(crate::syntax::SyntaxTree::ROOT) {
                let name = match tree.kind(key) {
                    SyntaxKind::List => tree.data(key).next().and_then(|name| tree.name(name)),
                    _ => tree.name(key).filter(|name| !name.starts_with('&')),
                };
                if let Some(name) = name {
                    found.add(&format!(":{name}"), CompletionItemKind::FIELD, 0, Some(&definition));
                }
            }
        }
    }
    let modules = project.modules(text);
    for text in std::iter::once(text).chain(&modules) {
        for definition in definitions(&text.tree).iter().filter(|found| found.kind == DefinedAs::Cause) {
            found.add(&definition.name, CompletionItemKind::ENUM_MEMBER, 1, Some(definition));
        }
    }
    for name in language().public().filter(|name| name.definition.kind == DefinedAs::Cause) {
        found.add(&name.definition.name, CompletionItemKind::ENUM_MEMBER, 3, Some(&name.definition));
    }
    let tree = &text.tree;
    let own = found.place.clone();
    for node in tree.nodes().filter(|&node| tree.range(node) != own) {
        if let Some(name) = tree.name(node).filter(|name| name.starts_with(':') && name.len() > 1) {
            found.add(&name.to_lowercase(), CompletionItemKind::ENUM_MEMBER, 2, None);
        }
    }
}

/// Adds the names of a package that a module defines.
fn in_package(project: &Project, found: &mut Candidates<'_>, package: &str) {
    let marks = if found.prefix.contains("::") { "::" } else { ":" };
    for module in project.modules(found.text) {
        for definition in definitions(&module.tree).iter().filter(|found| found.package == package) {
            let name = format!("{package}{marks}{}", definition.name);
            found.add(&name, item_kind(definition.kind), 0, Some(definition));
        }
    }
}

fn names(project: &Project, found: &mut Candidates<'_>, node: u32) {
    let text = found.text;
    for binding in bindings_around(&text.tree, node) {
        let kind =
            if binding.is_function { CompletionItemKind::FUNCTION } else { CompletionItemKind::VARIABLE };
        if let Some(name) = text.tree.name(binding.name).filter(|_| binding.name != node) {
            found.add(&bare_name(name), kind, 0, None);
        }
    }
    let modules = project.modules(text);
    for other in std::iter::once(text).chain(&modules) {
        for definition in definitions(&other.tree) {
            if definition.name_place == found.place || definition.name.starts_with(':') {
                continue;
            }
            let is_elsewhere = !std::ptr::eq(other, text) && !definition.package.is_empty();
            let name = if is_elsewhere {
                format!("{}:{}", definition.package, definition.name)
            } else {
                definition.name.clone()
            };
            found.add(&name, item_kind(definition.kind), 1, Some(&definition));
        }
    }
    for name in language().public() {
        let definition = &name.definition;
        if definition.kind != DefinedAs::Cause {
            found.add(&definition.name, item_kind(definition.kind), 2, Some(definition));
        }
    }
}

fn item_kind(kind: DefinedAs) -> CompletionItemKind {
    match kind {
        DefinedAs::Function | DefinedAs::Test => CompletionItemKind::FUNCTION,
        DefinedAs::Macro | DefinedAs::Operator | DefinedAs::Other => CompletionItemKind::KEYWORD,
        DefinedAs::Variable => CompletionItemKind::VARIABLE,
        DefinedAs::Constant => CompletionItemKind::CONSTANT,
        DefinedAs::Type => CompletionItemKind::STRUCT,
        DefinedAs::Cause => CompletionItemKind::ENUM_MEMBER,
        DefinedAs::Package => CompletionItemKind::MODULE,
        DefinedAs::Slot => CompletionItemKind::FIELD,
    }
}
