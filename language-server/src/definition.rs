//! The definitions of a text at any depth: functions, macros, variables, causes and all forms that begin with
//! `def`.

use std::ops::Range;

use esl_compiler::reader::lexer::Token;
use esl_syntax::{NodeId, SyntaxKind, SyntaxTree, bare_name};

/// The kind of a definition.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum DefinedAs {
    Function,
    Macro,
    /// An operator of the compiler itself.
    Operator,
    Variable,
    Constant,
    /// A structure, class, condition or type.
    Type,
    Cause,
    Package,
    Test,
    /// A slot or its accessor.
    Slot,
    /// Defined by another operator that begins with `def`.
    Other,
}

/// A definition of a name.
#[derive(Clone, Debug)]
pub(super) struct NameDefinition {
    /// Name without its package, in lower case.
    pub(super) name: String,
    /// Package in which it stands, in lower case; empty for that of the user.
    pub(super) package: String,
    pub(super) kind: DefinedAs,
    /// Place of the name.
    pub(super) name_place: Range<usize>,
    /// Place of the whole form.
    pub(super) place: Range<usize>,
    /// Lambda list as written, with its parentheses; `None` if it has none.
    pub(super) lambda_list: Option<String>,
    /// Documentation string.
    pub(super) text: String,
}

/// Returns the definitions of a text, in order.
pub(super) fn definitions(tree: &SyntaxTree) -> Vec<NameDefinition> {
    let mut found = Vec::new();
    let mut package = String::new();
    for node in tree.nodes() {
        if tree.kind(node) != SyntaxKind::List {
            continue;
        }
        let Some(operator) = tree.operator(node) else { continue };
        if operator == "in-package" {
            let name = tree.data(node).nth(1).map(|name| tree.text(name)).unwrap_or_default();
            package = name.trim_matches(['#', ':', '"', '\'']).to_lowercase();
            if matches!(&*package, "esl-user" | "esl" | "cl-user") {
                package.clear();
            }
        } else if operator.trim_start_matches('%').starts_with("def") {
            add(tree, node, &operator, &package, &mut found);
        }
    }
    found
}

fn add(tree: &SyntaxTree, form: NodeId, operator: &str, package: &str, found: &mut Vec<NameDefinition>) {
    let data: Vec<NodeId> = tree.data(form).take(6).collect();
    let Some(&second) = data.get(1) else { return };
    // `(name option…)`, `(setf name)`.
    let name_node = match tree.kind(second) {
        SyntaxKind::List => {
            let mut parts = tree.data(second);
            let first = parts.next();
            let is_setf = first.and_then(|first| tree.name(first)).map(bare_name).as_deref() == Some("setf");
            if is_setf { parts.next() } else { first }
        }
        _ => Some(second),
    };
    let Some(name_node) = name_node else { return };
    let name = match tree.kind(name_node) {
        SyntaxKind::Leaf(Token::Atom | Token::Escaped) => bare_name(tree.text(name_node)),
        SyntaxKind::Leaf(Token::Uninterned) => tree.text(name_node)[2..].to_lowercase(),
        SyntaxKind::Leaf(Token::String) if operator == "defpackage" => {
            string(tree.text(name_node)).to_lowercase()
        }
        _ => return,
    };
    let kind = match operator {
        "defun" | "defgeneric" | "defmethod" | "define-mock" | "define-property" | "define-operation" => {
            DefinedAs::Function
        }
        "defmacro" | "define-modify-macro" => DefinedAs::Macro,
        "defvar"
        | "defparameter"
        | "define-fluent"
        | "define-symbol-macro"
        | "define-input"
        | "defdurable"
        | "define-resource" => DefinedAs::Variable,
        "defconstant" => DefinedAs::Constant,
        "defstruct" | "defclass" | "define-condition" | "deftype" => DefinedAs::Type,
        "define-cause" => DefinedAs::Cause,
        "defpackage" => DefinedAs::Package,
        "deftest" => DefinedAs::Test,
        _ => DefinedAs::Other,
    };
    let is_list = |node: &NodeId| matches!(tree.kind(*node), SyntaxKind::List);
    let after_name = &data[2..];
    let lambda_list = match kind {
        DefinedAs::Function | DefinedAs::Macro => after_name.iter().copied().find(|node| is_list(node)),
        _ => None,
    };
    let text_at = match kind {
        DefinedAs::Function | DefinedAs::Macro => after_name.iter().position(is_list).map(|at| at + 3),
        DefinedAs::Type if operator == "defstruct" => Some(2),
        _ => Some(3),
    };
    let strings = |node: &NodeId| tree.kind(*node) == SyntaxKind::Leaf(Token::String);
    let text = text_at.and_then(|at| data.get(at).copied().filter(strings));
    found.push(NameDefinition {
        name: name.clone(),
        package: package.to_owned(),
        kind,
        name_place: tree.range(name_node),
        place: tree.range(form),
        lambda_list: lambda_list.map(|list| tree.text(list).to_owned()),
        text: text.map(|text| string(tree.text(text))).unwrap_or_default(),
    });
    if operator == "define-condition" {
        // Failures by the condition have this cause.
        let told = found.last().map(|condition| condition.text.clone()).unwrap_or_default();
        found.push(NameDefinition {
            name: format!(":{name}"),
            package: package.to_owned(),
            kind: DefinedAs::Cause,
            name_place: tree.range(name_node),
            place: tree.range(form),
            lambda_list: None,
            text: told,
        });
    }
    match operator {
        "defstruct" => add_structure(tree, form, &name, package, found),
        "defclass" | "define-condition" => add_accessors(tree, form, package, found),
        _ => {}
    }
}

/// Adds the functions that a structure defines besides.
fn add_structure(
    tree: &SyntaxTree,
    form: NodeId,
    name: &str,
    package: &str,
    found: &mut Vec<NameDefinition>,
) {
    let slots: Vec<NodeId> = tree.data(form).skip(2).collect();
    let slot_name = |slot: NodeId| match tree.kind(slot) {
        SyntaxKind::List => tree.data(slot).next().filter(|&name| tree.name(name).is_some()),
        _ => tree.name(slot).map(|_| slot),
    };
    let names: Vec<NodeId> = slots.into_iter().filter_map(slot_name).collect();
    let place = tree.range(form);
    let mut push = |name: String, kind, name_place: Range<usize>, lambda_list: String| {
        let (package, place) = (package.to_owned(), place.clone());
        let text = String::new();
        let lambda_list = Some(lambda_list);
        found.push(NameDefinition { name, package, kind, name_place, place, lambda_list, text });
    };
    let keys: Vec<&str> = names.iter().map(|&name| tree.text(name)).collect();
    let head = place.start..place.start + 1;
    push(format!("make-{name}"), DefinedAs::Function, head.clone(), format!("(&key {})", keys.join(" ")));
    push(format!("{name}-p"), DefinedAs::Function, head, "(object)".into());
    for slot in names {
        let accessor = format!("{name}-{}", bare_name(tree.text(slot)));
        push(accessor, DefinedAs::Slot, tree.range(slot), format!("({name})"));
    }
}

/// Adds the accessors and readers of the slots of a class.
fn add_accessors(tree: &SyntaxTree, form: NodeId, package: &str, found: &mut Vec<NameDefinition>) {
    let slots = tree.data(form).nth(3).into_iter().flat_map(|slots| tree.data(slots));
    for slot in slots.filter(|&slot| tree.kind(slot) == SyntaxKind::List) {
        let parts: Vec<NodeId> = tree.data(slot).collect();
        for pair in parts.windows(2) {
            if matches!(&*tree.text(pair[0]).to_lowercase(), ":accessor" | ":reader")
                && let Some(name) = tree.name(pair[1])
            {
                found.push(NameDefinition {
                    name: bare_name(name),
                    package: package.to_owned(),
                    kind: DefinedAs::Slot,
                    name_place: tree.range(pair[1]),
                    place: tree.range(slot),
                    lambda_list: Some("(object)".into()),
                    text: String::new(),
                });
            }
        }
    }
}

/// Returns the string that a token denotes.
pub(super) fn string(token: &str) -> String {
    let inner = token.strip_prefix('"').unwrap_or(token);
    let inner = inner.strip_suffix('"').unwrap_or(inner);
    let mut text = String::with_capacity(inner.len());
    let mut characters = inner.chars();
    while let Some(c) = characters.next() {
        match c {
            '\\' => text.extend(characters.next()),
            c => text.push(c),
        }
    }
    text
}
