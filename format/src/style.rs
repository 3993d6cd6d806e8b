//! Indentation styles: what an operator says about the lines of its form.

use std::collections::HashMap;
use std::sync::Arc;

use esl_syntax::{NodeId, SyntaxKind, SyntaxTree, bare_name};

/// How the lines of a list are indented, and what its elements are.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Indentation {
    /// Code, by the style of its operator.
    Form,
    /// Data: elements under each other, in all lists inside too.
    Data,
    /// A lambda list.
    Parameters,
    /// Elements under each other: the first, and the others.
    Column(Arc<Indentation>, Arc<Indentation>),
    /// As [`Indentation::Column`]; but if the first is a name or a number and the second one beside it, the
    /// others stand under the second.
    Clause(Arc<Indentation>, Arc<Indentation>),
    /// A call: arguments under the first one, if that is on the line of the operator.
    Call(Arc<Indentation>),
    /// Elements that stand out, so many columns further in than the list, then a body.
    Body(Arc<[Indentation]>, usize, Arc<Indentation>),
    /// A body: under its first form, if that is on the line of the operator, or else two columns in.
    Sequence(Arc<Indentation>),
    /// As [`Indentation::Body`]; names in the body are tags.
    Tagbody(usize),
    /// A loop, simple or with clauses.
    Loop,
}

/// Columns of a distinguished argument on a line of its own.
const HEAD: usize = 4;

/// The style of each operator that is not indented as a function is.
#[derive(Clone, Debug, Default)]
pub struct Styles {
    shapes: HashMap<String, Indentation>,
}

fn body(heads: impl Into<Arc<[Indentation]>>, rest: Indentation) -> Indentation {
    Indentation::Body(heads.into(), HEAD, Arc::new(rest))
}

fn column(first: Indentation, rest: Indentation) -> Indentation {
    Indentation::Column(Arc::new(first), Arc::new(rest))
}

fn keyed(first: Indentation, rest: Indentation) -> Indentation {
    Indentation::Clause(Arc::new(first), Arc::new(rest))
}

fn each(shape: Indentation) -> Indentation {
    column(shape.clone(), shape)
}

fn sequence(rest: Indentation) -> Indentation {
    Indentation::Sequence(Arc::new(rest))
}

/// A list that is indented as a call, whatever it begins with.
fn header() -> Indentation {
    Indentation::Call(Arc::new(Indentation::Form))
}

impl Styles {
    /// Creates the styles of the operators that the compiler itself knows, and of the macros of the library
    /// whose lambda lists say too little: `&rest clauses`.
    pub fn standard() -> Styles {
        use Indentation::{Data, Form, Parameters};
        let clause = || body([], Form);
        let function = || body([Parameters], Form);
        let bindings = || each(sequence(Form));
        let keys = || body([Form], keyed(Data, Form));
        let handlers = || body([Form], function());
        let forms = |heads: usize| body(vec![Form; heads], Form);
        let rows: [(&str, Indentation); 28] = [
            ("block catch eval-when unless when return-from prog1 the-environment", forms(1)),
            ("multiple-value-call multiple-value-prog1 multiple-value-setq %with-failure-cleanup", forms(1)),
            ("progn locally", sequence(Form)),
            ("prog2 progv %with-recovery", forms(2)),
            ("unwind-protect", Indentation::Body([Form].into(), 5, Arc::new(Form))),
            ("cond", Indentation::Call(Arc::new(keyed(Form, Form)))),
            ("case ccase ecase typecase ctypecase etypecase", keys()),
            ("handler-case %handler-case restart-case", handlers()),
            ("let let* symbol-macrolet handler-bind restart-bind", body([bindings()], Form)),
            ("flet labels macrolet", body([each(function())], Form)),
            ("lambda", function()),
            ("%named-lambda %macro-lambda", body([Data, Parameters], Form)),
            ("destructuring-bind multiple-value-bind with-slots with-accessors", body([Data, Form], Form)),
            ("do do*", body([bindings(), column(Form, Form)], Form)),
            ("dolist dotimes", body([header()], Form)),
            ("tagbody", Indentation::Tagbody(0)),
            ("prog prog*", Indentation::Tagbody(1)),
            ("loop", Indentation::Loop),
            (
                "defun defmacro deftype define-compiler-macro define-setf-expander",
                body([Data, Parameters], Form),
            ),
            (
                "defvar defdurable defparameter defconstant",
                Indentation::Body([Data, Form].into(), 2, Arc::new(Form)),
            ),
            ("defclass define-condition", body([Data, Data], each(header()))),
            ("with-recovery-procedures", body([each(clause())], Form)),
            ("task-net or-parallel try-all pursue try-in-order", sequence(sequence(Form))),
            ("spawn", body([], Form)),
            ("with-server", body([header()], clause())),
            ("supervise", body([header()], clause())),
            ("partial-order with-world", body([each(clause())], Form)),
            ("with-resources with-maintained-properties", body([each(header())], Form)),
        ];
        let mut shapes = HashMap::new();
        for (names, shape) in rows {
            shapes.extend(names.split(' ').map(|name| (name.to_owned(), shape.clone())));
        }
        shapes.insert("to-achieve".into(), body([header()], column(Form, Form)));
        Styles { shapes }
    }

    /// Adds the macros that a text defines, also local ones. Earlier macros of their names are forgotten if
    /// `is_newer`, and kept otherwise.
    pub fn add_macros(&mut self, tree: &SyntaxTree, is_newer: bool) {
        for node in tree.nodes().filter(|&node| tree.kind(node) == SyntaxKind::List) {
            match tree.operator(node).as_deref() {
                Some("defmacro") => self.add_macro(tree, tree.data(node).skip(1), is_newer),
                Some("macrolet") => {
                    for definition in tree.data(node).nth(1).into_iter().flat_map(|list| tree.data(list)) {
                        self.add_macro(tree, tree.data(definition), is_newer);
                    }
                }
                _ => {}
            }
        }
    }

    /// Adds a macro with this name, lambda list and body.
    fn add_macro(&mut self, tree: &SyntaxTree, mut parts: impl Iterator<Item = NodeId>, is_newer: bool) {
        let Some(name) = parts.next().and_then(|name| tree.name(name)).map(bare_name) else { return };
        let Some(lambda_list) = parts.next() else { return };
        if !is_newer && self.shapes.contains_key(&name) {
            return;
        }
        let declared = parts.take(3).find_map(|form| declared(tree, form));
        let is_definer = name.trim_start_matches('%').starts_with("def");
        match declared.or_else(|| of_lambda_list(tree, lambda_list)) {
            // All parts after the name of a definition are two columns in.
            Some(Indentation::Body(heads, _, rest)) if is_definer => {
                self.shapes.insert(name, Indentation::Body(heads, 2, rest));
            }
            Some(Indentation::Sequence(_)) if is_definer => {}
            Some(shape) => _ = self.shapes.insert(name, shape),
            // Rows of a table, which begin with what they define.
            None if is_definer && is_rest_only(tree, lambda_list) => {
                self.shapes.insert(name, body([], body([], Indentation::Form)));
            }
            // It has no body: it is indented as a function is, unless more is known.
            None => {}
        }
    }

    /// Returns the shape of a form with this operator.
    pub(super) fn of_operator(&self, operator: &str) -> Indentation {
        if let Some(shape) = self.shapes.get(operator) {
            return shape.clone();
        }
        let name = operator.trim_start_matches('%');
        if name.starts_with("def") {
            body([], Indentation::Form)
        } else if name.starts_with("with-") {
            body([header()], Indentation::Form)
        } else if name.starts_with("without-") {
            body([], Indentation::Form)
        } else {
            header()
        }
    }

    /// Returns the shape of a form whose operator a template takes in from a variable of this name: `,let` is
    /// mostly a kind of `let`.
    pub(super) fn of_filled_in(&self, variable: &str) -> Indentation {
        self.shapes.get(variable).cloned().unwrap_or_else(header)
    }
}

/// Returns the style that `(declare (indent N))` gives a macro: N arguments stand out, the rest is a body.
fn declared(tree: &SyntaxTree, form: NodeId) -> Option<Indentation> {
    if tree.operator(form).as_deref() != Some("declare") {
        return None;
    }
    let specifier = tree.data(form).skip(1).find(|&item| tree.operator(item).as_deref() == Some("indent"))?;
    let heads: usize = tree.data(specifier).nth(1).map(|count| tree.text(count))?.parse().ok()?;
    (heads < 100).then(|| body(vec![Indentation::Form; heads], Indentation::Form))
}

/// Whether a lambda list has nothing but a rest parameter.
fn is_rest_only(tree: &SyntaxTree, list: NodeId) -> bool {
    let first = tree.data(list).next().and_then(|item| tree.name(item)).map(bare_name);
    tree.kind(list) == SyntaxKind::List && first.as_deref() == Some("&rest")
}

/// Returns the style that a macro's lambda list implies; `None` without `&body`.
fn of_lambda_list(tree: &SyntaxTree, list: NodeId) -> Option<Indentation> {
    if tree.kind(list) != SyntaxKind::List {
        return None;
    }
    let mut heads = Vec::new();
    let mut is_optional = false;
    let mut items = tree.data(list);
    while let Some(item) = items.next() {
        match tree.name(item).map(bare_name).as_deref() {
            Some("&whole" | "&environment") => _ = items.next(),
            Some("&optional") => is_optional = true,
            Some("&body") if heads.is_empty() => return Some(sequence(Indentation::Form)),
            Some("&body") => return Some(body(heads, Indentation::Form)),
            Some(word) if word.starts_with('&') => return None,
            Some(_) => heads.push(Indentation::Form),
            None if is_optional => heads.push(Indentation::Form),
            // Nested lambda lists are as deep as the text nests, so
            // only this level and the next are looked at.
            None => heads.push(of_nested(tree, item)),
        }
    }
    None
}

/// Returns the shape of an argument that a lambda list takes apart.
fn of_nested(tree: &SyntaxTree, list: NodeId) -> Indentation {
    let names = tree.data(list).map(|item| tree.name(item).map(bare_name));
    let names: Vec<Option<String>> = names.take_while(|name| name.as_deref() != Some("&key")).collect();
    let body_at = names.iter().position(|name| name.as_deref() == Some("&body"));
    match body_at {
        Some(before) => body(vec![Indentation::Form; before.saturating_sub(1)], Indentation::Form),
        None => header(),
    }
}
