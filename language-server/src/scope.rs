//! Local names: which forms bind them, and to which binding a name refers.
//!
//! This works on the text alone, so also in a file that does not compile. It knows the binding forms of the
//! language; a macro of the program that binds names by itself is known only if it is called `do-…` or
//! `with-…` and takes the name first in its first argument, as those of the library do.

use esl_syntax::{NodeId, SyntaxKind, SyntaxTree, bare_name};

/// Operators of the language that are called `do-…` or `with-…` and bind no variable in their first argument.
const NOT_BINDING: &[&str] = &[
    "do-every",
    "with-automatic-recoveries",
    "with-budget",
    "with-cleanup-procedure",
    "with-guardian",
    "with-hash-table-iterator",
    "with-maintained-properties",
    "with-maintained-property",
    "with-query-bindings",
    "with-quota",
    "with-recovery-procedures",
    "with-resource",
    "with-resources",
    "with-rights",
    "with-simple-restart",
    "with-suspension-procedures",
    "with-timeout",
    "with-world",
];

/// Operators of the language that define something without a lambda list behind its name.
const DEFINING_NO_FUNCTION: &[&str] = &[
    "defclass",
    "defconstant",
    "define-cause",
    "define-condition",
    "define-fluent",
    "define-hash-table-test",
    "define-input",
    "defdurable",
    "define-resource",
    "define-rule",
    "define-symbol-macro",
    "defpackage",
    "defparameter",
    "defstruct",
    "deftest",
    "defvar",
];

/// The kind of a local name: each kind has a namespace of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LocalKind {
    Variable,
    Function,
    /// A block that `return-from` leaves.
    Block,
    /// Where `go` goes on.
    Tag,
}

/// A local binding of a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct LocalBinding {
    /// The name where it is bound.
    pub(super) name: NodeId,
    /// The form in which the binding holds.
    pub(super) scope: NodeId,
    pub(super) kind: LocalKind,
}

/// Returns the bindings around a node, the innermost first.
pub(super) fn bindings_around(tree: &SyntaxTree, node: NodeId) -> Vec<LocalBinding> {
    let mut bindings = Vec::new();
    let mut at = Some(node);
    while let Some(scope) = at {
        if tree.kind(scope) == SyntaxKind::List {
            bound_by(tree, scope, &mut bindings);
        }
        at = tree.parent(scope);
    }
    bindings
}

/// Returns the binding to which a name refers; `None` if it is global.
pub(super) fn binding_of(tree: &SyntaxTree, node: NodeId) -> Option<LocalBinding> {
    let name = bare_name(tree.name(node)?);
    let level = template_level(tree, node)?;
    let bindings = bindings_around(tree, node);
    if let Some(own) = bindings.iter().find(|binding| binding.name == node) {
        return Some(*own);
    }
    let kind = kind_at(tree, node);
    let same = |binding: &&LocalBinding| tree.name(binding.name).map(bare_name).as_ref() == Some(&name);
    let mut known = bindings.iter().filter(same).filter(|binding| is_seen(tree, binding, kind, node));
    known.find(|binding| template_level(tree, binding.name) == Some(level)).copied()
}

/// Whether a binding is one of this kind for a name inside its form. The body of a local function is a block
/// of the function's name.
pub(super) fn is_seen(tree: &SyntaxTree, binding: &LocalBinding, kind: LocalKind, node: NodeId) -> bool {
    let is_block = || {
        let definition = tree.parent(binding.name).map(|definition| tree.range(definition));
        binding.kind == LocalKind::Function
            && definition.is_some_and(|place| place.contains(&tree.range(node).start))
    };
    binding.kind == kind || kind == LocalKind::Block && is_block()
}

/// Returns the kind of the name that stands here.
pub(super) fn kind_at(tree: &SyntaxTree, node: NodeId) -> LocalKind {
    let list = tree.parent(node).filter(|&list| tree.kind(list) == SyntaxKind::List);
    let jump = list.filter(|&list| tree.data(list).nth(1) == Some(node)).and_then(|list| tree.operator(list));
    match jump.as_deref() {
        Some("return-from") => LocalKind::Block,
        Some("go") => LocalKind::Tag,
        _ if is_operator(tree, node) => LocalKind::Function,
        _ => LocalKind::Variable,
    }
}

/// Returns the number of backquotes around a node that no comma has left, as names in a template and names
/// of the code that makes it are not the same; `None` for quoted data.
pub(super) fn template_level(tree: &SyntaxTree, node: NodeId) -> Option<i32> {
    use esl_compiler::reader::lexer::Token;
    let (mut level, mut is_left) = (0, false);
    let mut at = tree.parent(node);
    while let Some(outer) = at {
        match tree.kind(outer) {
            SyntaxKind::Mark(Token::Quote) if !is_left => return None,
            SyntaxKind::Mark(Token::Backquote) => level += 1,
            SyntaxKind::Mark(Token::Comma | Token::CommaAt) => (level, is_left) = (level - 1, true),
            _ => {}
        }
        at = tree.parent(outer);
    }
    Some(level)
}

/// Whether a name stands where an operator does, or after `#'`.
pub(super) fn is_operator(tree: &SyntaxTree, node: NodeId) -> bool {
    use esl_compiler::reader::lexer::Token;
    match tree.parent(node).map(|parent| (parent, tree.kind(parent))) {
        Some((_, SyntaxKind::Mark(Token::Function))) => true,
        Some((parent, SyntaxKind::List)) => {
            tree.data(parent).next() == Some(node)
                && !is_clause(tree, parent)
                && !is_description(tree, parent)
        }
        _ => false,
    }
}

/// Whether a list describes something in a definition: parameters, slots, parents.
fn is_description(tree: &SyntaxTree, list: NodeId) -> bool {
    let place = |inner: NodeId| {
        let outer = tree.parent(inner)?;
        let operator = tree.operator(outer).filter(|operator| operator.starts_with("def"))?;
        // Further back nothing is described, but in slots, which are many.
        let at = tree.data(outer).take(6).position(|part| part == inner).unwrap_or(6);
        let qualifiers =
            tree.data(outer).take(6).filter(|&part| part < inner && is_qualifier(tree, part)).count();
        Some((operator, at - qualifiers))
    };
    let has_slots = |operator: &str| matches!(operator, "defstruct" | "defclass" | "define-condition");
    let has_value = |operator: &str| {
        matches!(
            operator,
            "defvar"
                | "defdurable"
                | "defparameter"
                | "defconstant"
                | "deftest"
                | "define-fluent"
                | "define-rule"
        )
    };
    match place(list) {
        Some((operator, at)) if has_slots(&operator) => at >= 1,
        Some((operator, at)) => at == 1 && operator != "define-resource" || at == 2 && !has_value(&operator),
        // A slot with options, a parameter with a default or a class.
        None => tree.parent(list).and_then(place).is_some_and(|(operator, at)| match &*operator {
            "defstruct" => false,
            "defclass" | "define-condition" => at == 3,
            _ => at == 2 && !has_value(&operator),
        }),
    }
}

/// Whether a name is a qualifier of a method, such as `:before`: it stands between name and parameters.
pub(super) fn is_qualifier(tree: &SyntaxTree, node: NodeId) -> bool {
    let Some(method) = tree.parent(node).filter(|&list| tree.kind(list) == SyntaxKind::List) else {
        return false;
    };
    let operator = tree.data(method).next().and_then(|first| tree.name(first)?.rsplit(':').next());
    operator.is_some_and(|operator| operator.eq_ignore_ascii_case("defmethod"))
        && tree
            .data(method)
            .skip(2)
            .take(4)
            .take_while(|&part| tree.name(part).is_some())
            .any(|part| part == node)
}

/// Whether a list is a clause of a `cond` or `case`, or a binding of a `let`: no call.
fn is_clause(tree: &SyntaxTree, list: NodeId) -> bool {
    let Some(parent) = tree.parent(list) else { return false };
    match tree.operator(parent).as_deref() {
        Some("cond") => true,
        Some("case" | "ecase" | "ccase") => tree.data(parent).nth(1) != Some(list),
        _ => {
            let outer = tree.parent(parent).and_then(|outer| Some((outer, tree.operator(outer)?)));
            outer.is_some_and(|(outer, operator)| {
                let is_let = matches!(&*operator, "let" | "let*" | "do" | "do*" | "prog" | "symbol-macrolet");
                is_let && tree.data(outer).nth(1) == Some(parent)
            })
        }
    }
}

/// Adds what a list binds.
pub(super) fn bound_by(tree: &SyntaxTree, list: NodeId, found: &mut Vec<LocalBinding>) {
    let argument = |at: usize| tree.data(list).nth(at);
    let Some(operator) = tree.operator(list) else { return bound_by_clause(tree, list, found) };
    blocks_and_tags(tree, list, &operator, found);
    let mut variable =
        |name: NodeId| found.push(LocalBinding { name, scope: list, kind: LocalKind::Variable });
    match &*operator {
        "let" | "let*" | "do" | "do*" | "prog" | "prog*" | "symbol-macrolet" | "with-slots"
        | "with-accessors" => {
            let bindings = argument(1).into_iter().flat_map(|bindings| tree.data(bindings));
            bindings.filter_map(|binding| head_name(tree, binding)).for_each(variable);
        }
        "lambda" => argument(1).into_iter().for_each(|list| parameters(tree, list, &mut variable)),
        "multiple-value-bind" | "destructuring-bind" => {
            argument(1).into_iter().for_each(|list| parameters(tree, list, &mut variable));
        }
        "%named-lambda" => {
            argument(2).into_iter().for_each(|list| parameters(tree, list, &mut variable));
        }
        "defmethod" => {
            let lists = tree.data(list).skip(2).find(|&part| tree.kind(part) == SyntaxKind::List);
            lists.into_iter().for_each(|list| parameters(tree, list, &mut variable));
        }
        "to-achieve" => {
            let goal = argument(1).into_iter().flat_map(|goal| tree.data(goal).skip(1));
            goal.filter(|&part| tree.name(part).is_some()).for_each(variable);
        }
        "loop" => loop_variables(tree, list, &mut variable),
        "flet" | "labels" | "macrolet" => {
            let functions = argument(1).into_iter().flat_map(|functions| tree.data(functions));
            let names = functions.filter_map(|function| tree.data(function).next());
            let names = names.filter(|&name| tree.name(name).is_some());
            found.extend(names.map(|name| LocalBinding { name, scope: list, kind: LocalKind::Function }));
        }
        "task-net" | "or-parallel" | "try-all" | "pursue" | "try-in-order" | "supervise" => {
            let clauses = tree.data(list).skip(1).filter(|&clause| tree.kind(clause) == SyntaxKind::List);
            clauses.filter_map(|clause| head_name(tree, clause)).for_each(variable);
        }
        name if DEFINING_NO_FUNCTION.contains(&name) => {}
        name if name.starts_with("def") => {
            if let Some(list) = argument(2).filter(|&list| tree.kind(list) == SyntaxKind::List) {
                parameters(tree, list, &mut variable);
            }
        }
        // These take something else there: seconds, clauses, the name of a resource.
        name if NOT_BINDING.contains(&name) => bound_by_clause(tree, list, found),
        name if name.starts_with("do") || name.starts_with("with-") => {
            let first = argument(1).filter(|&header| tree.kind(header) == SyntaxKind::List);
            let first = first.and_then(|header| tree.data(header).next());
            // A server's header begins with a port, or with a list for the connection.
            let name = match (name, first) {
                ("with-server", Some(first)) if tree.kind(first) != SyntaxKind::List => None,
                ("with-server", Some(first)) => tree.data(first).next(),
                _ => first,
            };
            name.filter(|&name| tree.name(name).is_some()).into_iter().for_each(variable);
        }
        _ => bound_by_clause(tree, list, found),
    }
}

/// Adds the block that a form is, and the tags in it.
fn blocks_and_tags(tree: &SyntaxTree, list: NodeId, operator: &str, found: &mut Vec<LocalBinding>) {
    let block = match operator {
        "block" => tree.data(list).nth(1),
        "loop" => {
            let words: Vec<NodeId> = tree.data(list).skip(1).take(2).collect();
            let is_named = words.first().and_then(|&word| tree.name(word)).map(bare_name);
            words.get(1).copied().filter(|_| is_named.as_deref() == Some("named"))
        }
        _ => None,
    };
    let is_name = |&name: &NodeId| tree.name(name).is_some_and(|name| bare_name(name) != "nil");
    found.extend(block.filter(is_name).map(|name| LocalBinding {
        name,
        scope: list,
        kind: LocalKind::Block,
    }));
    let heads = match operator {
        "tagbody" => 1,
        "prog" | "prog*" | "dolist" | "dotimes" => 2,
        "do" | "do*" => 3,
        _ => return,
    };
    let tags = tree.data(list).skip(heads).filter(is_name);
    found.extend(tags.map(|name| LocalBinding { name, scope: list, kind: LocalKind::Tag }));
}

/// Adds what a list binds by its place in another form: a local function, a clause.
fn bound_by_clause(tree: &SyntaxTree, list: NodeId, found: &mut Vec<LocalBinding>) {
    let mut variable =
        |name: NodeId| found.push(LocalBinding { name, scope: list, kind: LocalKind::Variable });
    let Some(parent) = tree.parent(list) else { return };
    if matches!(tree.operator(parent).as_deref(), Some("handler-case" | "restart-case"))
        && tree.data(parent).nth(1) != Some(list)
    {
        return tree.data(list).nth(1).into_iter().for_each(|list| parameters(tree, list, &mut variable));
    }
    let Some(outer) = tree.parent(parent) else { return };
    if tree.data(outer).nth(1) != Some(parent) {
        return;
    }
    match tree.operator(outer).as_deref() {
        Some("flet" | "labels" | "macrolet") => {
            tree.data(list).nth(1).into_iter().for_each(|list| parameters(tree, list, &mut variable));
        }
        Some("with-recovery-procedures") => {
            let cause = tree.data(list).next().into_iter();
            let names = cause.flat_map(|cause| tree.data(cause).skip(1));
            names.filter(|&name| tree.name(name).is_some()).for_each(variable);
        }
        _ => {}
    }
}

/// Returns the name that a binding binds: itself, or the first of a list.
fn head_name(tree: &SyntaxTree, binding: NodeId) -> Option<NodeId> {
    let name = match tree.kind(binding) {
        SyntaxKind::List => tree.data(binding).next()?,
        _ => binding,
    };
    tree.name(name).filter(|name| !name.starts_with(':')).map(|_| name)
}

/// Passes the names that a lambda list or pattern binds to `variable`.
fn parameters(tree: &SyntaxTree, list: NodeId, variable: &mut dyn FnMut(NodeId)) {
    if tree.kind(list) != SyntaxKind::List {
        return;
    }
    let mut waiting = vec![list];
    while let Some(list) = waiting.pop() {
        let mut has_defaults = false;
        for item in tree.data(list) {
            match (tree.name(item), tree.kind(item)) {
                (Some(word), _) if word.starts_with('&') => {
                    has_defaults =
                        !matches!(&*word.to_lowercase(), "&rest" | "&body" | "&whole" | "&environment");
                }
                (Some(word), _) if word.starts_with(':') || word == "." => {}
                (Some(_), _) => variable(item),
                (None, SyntaxKind::List) if has_defaults => {
                    // `(name default supplied-p)`, `((:key name) default)`.
                    let mut parts = tree.data(item);
                    let (first, _, supplied) = (parts.next(), parts.next(), parts.next());
                    for part in [first, supplied].into_iter().flatten() {
                        match tree.kind(part) {
                            SyntaxKind::List => tree.data(part).nth(1).into_iter().for_each(&mut *variable),
                            _ if tree.name(part).is_some() => variable(part),
                            _ => {}
                        }
                    }
                }
                (None, SyntaxKind::List) => waiting.push(item),
                _ => {}
            }
        }
    }
}

fn loop_variables(tree: &SyntaxTree, list: NodeId, variable: &mut dyn FnMut(NodeId)) {
    let items: Vec<NodeId> = tree.data(list).collect();
    let mut binds = false;
    for pair in items.windows(2) {
        let word = tree.name(pair[0]).map(bare_name);
        match word.as_deref() {
            Some("for" | "as" | "with") => binds = true,
            Some("and") => {}
            // Other clauses can be joined by `and` too.
            Some(
                "do" | "collect" | "append" | "sum" | "count" | "when" | "unless" | "if" | "while" | "until",
            ) => {
                binds = false;
                continue;
            }
            _ => continue,
        }
        if binds {
            match tree.kind(pair[1]) {
                SyntaxKind::List => parameters(tree, pair[1], variable),
                _ if tree.name(pair[1]).is_some() => variable(pair[1]),
                _ => {}
            }
        }
    }
}
