//! Completion: local names, what the file and its modules define, the language, and keywords.

use std::collections::HashSet;

use esl_compiler::reader::lexer::Token;
use esl_syntax::{NodeId, SyntaxKind, SyntaxTree, bare_name};
use lsp_types::{
    CompletionItem, CompletionItemKind, CompletionList, CompletionParams, CompletionResponse,
    CompletionTextEdit, Documentation, MarkupContent, MarkupKind, TextEdit,
};

use super::definition::{DefinedAs, NameDefinition, definitions};
use super::describe::{call_at, markdown, usage};
use super::document::OpenText;
use super::library::language;
use super::project::Project;
use super::scope::{LocalKind, bindings_around, kind_at};

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

impl Candidates<'_> {
    /// Adds a word of the language with a text about it.
    fn add_told(&mut self, name: &str, kind: CompletionItemKind, text: &str) {
        self.add(name, kind, 0, None);
        if let Some(item) = self.items.last_mut().filter(|item| item.label == name) {
            item.documentation = Some(Documentation::String(text.to_owned()));
        }
    }
}

/// Answers which names fit at a position.
pub(super) fn complete(project: &Project, parameters: &CompletionParams) -> Option<CompletionResponse> {
    let at = &parameters.text_document_position;
    let text = project.text(&at.text_document.uri)?;
    let offset = text.offset(at.position);
    let tree = &text.tree;
    let node = tree.node_at(offset);
    // Nothing is completed in strings and comments, but the name of a module.
    let start = match tree.kind(node) {
        SyntaxKind::Leaf(Token::String | Token::Unfinished) if is_module_name(tree, node) => {
            tree.range(node).start + 1
        }
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
    if start > offset {
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
    let list = call_at(text, offset).map(|(list, _)| list);
    if is_module_name(tree, node) {
        project
            .module_names(text)
            .iter()
            .for_each(|name| found.add(name, CompletionItemKind::MODULE, 0, None));
    } else if list.is_some_and(|list| in_declaration(tree, list, &mut found, node)) {
        // Nothing else fits there.
    } else if found.prefix.starts_with(':') {
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
            let tree = esl_syntax::SyntaxTree::new(keys);
            for key in tree.data(esl_syntax::SyntaxTree::ROOT) {
                let name = match tree.kind(key) {
                    SyntaxKind::List => tree.data(key).next().and_then(|name| tree.name(name)),
                    _ => tree.name(key).filter(|name| !name.starts_with('&')),
                };
                if let Some(name) = name {
                    found.add(&format!(":{name}"), CompletionItemKind::FIELD, 0, Some(&definition));
                }
            }
        }
        if name == "make-instance" || name == "make-condition" {
            initargs(project, found, list);
        }
        // Where a call takes keywords, a cause is hardly meant.
        if !found.items.is_empty() {
            return;
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

/// Adds the initargs of the class that a call of `make-instance` names.
fn initargs(project: &Project, found: &mut Candidates<'_>, call: NodeId) {
    let text = found.text;
    let quoted = text.tree.data(call).nth(1).and_then(|class| text.tree.data(class).next());
    let Some(class) = quoted.and_then(|class| text.tree.name(class)).map(bare_name) else { return };
    let modules = project.modules(text);
    for other in std::iter::once(text).chain(&modules) {
        let tree = &other.tree;
        for node in tree.nodes().filter(|&node| tree.kind(node) == SyntaxKind::List) {
            let is_class = matches!(tree.operator(node).as_deref(), Some("defclass" | "define-condition"))
                && tree.data(node).nth(1).and_then(|name| tree.name(name)).map(bare_name).as_ref()
                    == Some(&class);
            if !is_class {
                continue;
            }
            for slot in tree.data(node).nth(3).into_iter().flat_map(|slots| tree.data(slots)) {
                let parts: Vec<NodeId> = tree.data(slot).collect();
                for pair in parts.windows(2).filter(|pair| tree.name(pair[0]) == Some(":initarg")) {
                    if let Some(name) = tree.name(pair[1]) {
                        found.add(&name.to_lowercase(), CompletionItemKind::FIELD, 0, None);
                    }
                }
            }
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
    let jump = jump_at(&text.tree, node, found.place.start);
    for binding in bindings_around(&text.tree, node) {
        let kind = match binding.kind {
            LocalKind::Variable => CompletionItemKind::VARIABLE,
            LocalKind::Function => CompletionItemKind::FUNCTION,
            LocalKind::Block | LocalKind::Tag => CompletionItemKind::REFERENCE,
        };
        let is_wanted = match jump {
            Some(kind) => binding.kind == kind,
            None => matches!(binding.kind, LocalKind::Variable | LocalKind::Function),
        };
        if !is_wanted {
            continue;
        }
        if let Some(name) = text.tree.name(binding.name).filter(|_| binding.name != node) {
            found.add(&bare_name(name), kind, 0, None);
        }
    }
    if let Some(kind) = jump {
        // The body of a function is a block of its name.
        let own = definitions(&text.tree).into_iter();
        let start = found.place.start;
        let is_around = |own: &NameDefinition| own.kind == DefinedAs::Function && own.place.contains(&start);
        for definition in own.filter(|own| kind == LocalKind::Block && is_around(own)) {
            found.add(&definition.name, CompletionItemKind::REFERENCE, 1, Some(&definition));
        }
        return;
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

/// Whether a string is the name of a module, in a `require`.
fn is_module_name(tree: &SyntaxTree, node: NodeId) -> bool {
    let list = tree.parent(node).filter(|&list| tree.data(list).nth(1) == Some(node));
    list.and_then(|list| tree.operator(list)).as_deref() == Some("require")
        && tree.text(node).starts_with('"')
}

/// Returns the kind of the place to go to that is being typed, if one is: after `return-from` or `go`.
fn jump_at(tree: &SyntaxTree, node: NodeId, start: usize) -> Option<LocalKind> {
    if tree.name(node).is_some() {
        return Some(kind_at(tree, node)).filter(|kind| matches!(kind, LocalKind::Block | LocalKind::Tag));
    }
    // Nothing has been typed of it yet.
    let mut before = tree.data(node).take_while(|&part| tree.range(part).start < start);
    match (before.next().and_then(|first| tree.name(first)).map(bare_name).as_deref(), before.next()) {
        (Some("return-from"), None) => Some(LocalKind::Block),
        (Some("go"), None) => Some(LocalKind::Tag),
        _ => None,
    }
}

/// The declarations, and the meaning of each.
const DECLARATIONS: [(&str, &str); 11] = [
    ("ignore", "These variables are not used."),
    ("ignorable", "These variables may not be used."),
    ("special", "These names are dynamic variables."),
    ("type", "These variables have values of a type; not checked."),
    ("ftype", "These functions are of a type; not checked."),
    ("inline", "Calls of these functions may be replaced by their bodies; without effect."),
    ("notinline", "Calls of these functions stay calls; without effect."),
    ("optimize", "The qualities that the compiler favours; without effect."),
    ("dynamic-extent", "These values are not needed later; without effect."),
    ("values", "The types of the values; not checked."),
    ("indent", "The number of arguments of a macro before its body, for `eslc format`."),
];

/// Adds what fits in a declaration. Returns whether the place is in one.
fn in_declaration(tree: &SyntaxTree, list: NodeId, found: &mut Candidates<'_>, node: NodeId) -> bool {
    let is_declare =
        |list: NodeId| matches!(tree.operator(list).as_deref(), Some("declare" | "declaim" | "proclaim"));
    // A quality may be a list with its value: `(optimize (speed 3))`.
    let is_quality = |list: &NodeId| tree.operator(*list).as_deref() == Some("optimize");
    let list = tree.list_around(list).filter(is_quality).unwrap_or(list);
    let outer = tree.list_around(list).filter(|&outer| is_declare(outer));
    // `(declare ig` and `(declare (ig`, where the parenthesis may be all there is so far.
    let is_first = tree.data(list).next() == Some(node);
    if is_declare(list) && !is_first || outer.is_some() && is_first {
        for (name, text) in DECLARATIONS {
            found.add_told(name, CompletionItemKind::KEYWORD, text);
        }
        return true;
    }
    let Some(outer) = outer else { return false };
    match tree.operator(list).as_deref() {
        Some("optimize") => {
            for quality in ["speed", "safety", "debug", "space", "compilation-speed"] {
                found.add(quality, CompletionItemKind::ENUM_MEMBER, 0, None);
            }
        }
        Some("ignore" | "ignorable" | "dynamic-extent") => {
            // The variables of the form of which the declaration is a part.
            let scope = tree.list_around(outer);
            let bindings = bindings_around(tree, outer);
            for binding in bindings.iter().filter(|one| one.kind == LocalKind::Variable) {
                if let Some(name) = tree.name(binding.name).filter(|_| Some(binding.scope) == scope) {
                    found.add(&bare_name(name), CompletionItemKind::VARIABLE, 0, None);
                }
            }
        }
        _ => return false,
    }
    true
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
