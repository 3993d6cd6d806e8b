//! The functions of the host that the module `bt` calls. None of them reaches anything outside: the module
//! reads files by those of the language, which need their rights.

use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;
use esl_host::{HostFailure, HostRows, Inbox, IntoDatum};

use crate::emit::{literal, moment_name, operator};
use crate::model::{Model, PortValue, TreeNode, TreeSource, includes};
use crate::script::{Expression, Script};

/// Returns the functions.
pub(crate) fn rows(inbox: &Inbox) -> HostRows {
    let mut rows = HostRows::new(inbox);
    rows.at_once(
        "%BT-INCLUDES",
        ["name", "text"],
        "Returns the paths of the files that TEXT, of the file NAME, includes.",
        |name: String, text: String| {
            let source = TreeSource { name: name.into(), text: text.into() };
            let found = includes(&source).map_err(|fault| HostFailure::new("TREE-ERROR", fault))?;
            Ok(found.into_iter().map(|include| include.path).collect::<Vec<String>>())
        },
    )
    .everywhere();
    rows.at_once(
        "%BT-READ",
        ["sources", "tree"],
        "Returns the number of the tree that is run, all trees, and their nodes, of SOURCES, lists of a name and a text.",
        |sources: Vec<Vec<String>>, tree: Option<String>| read(&sources, tree.as_deref()),
    )
    .everywhere();
    rows.at_once(
        "%BT-IS-OF-NAV2",
        ["name"],
        "Returns whether the leaf NAME is an action or a service of Nav2.",
        |name: String| Ok(crate::ros::row(&name).is_some()),
    )
    .everywhere();
    rows.at_once(
        "%BT-VALUE",
        ["text"],
        "Returns the value that TEXT, of a port, stands for.",
        |text: String| Ok(value(&text)),
    )
    .everywhere();
    rows
}

fn read(sources: &[Vec<String>], tree: Option<&str>) -> Result<Datum, HostFailure> {
    let sources: Vec<TreeSource> = sources
        .iter()
        .filter_map(|source| match &**source {
            [name, text] => Some(TreeSource { name: name.as_str().into(), text: text.as_str().into() }),
            _ => None,
        })
        .collect();
    let model = Model::read(&sources, tree).map_err(|faults| {
        let texts: Vec<String> = faults.iter().map(ToString::to_string).collect();
        HostFailure::new("TREE-ERROR", texts.join("\n"))
    })?;
    let ends = model.trees.iter().skip(1).map(|tree| tree.root).chain([model.nodes.len()]);
    let trees = model.trees.iter().zip(ends);
    let trees =
        trees.map(|(tree, end)| list([tree.id.clone().into_datum(), number(tree.root), number(end - 1)]));
    let trees = list(trees.collect::<Vec<_>>());
    let nodes = list(model.nodes.iter().map(node).collect::<Vec<_>>());
    Ok(list([number(model.main), trees, nodes]))
}

fn list(items: impl IntoIterator<Item = Datum>) -> Datum {
    Datum::list(items.into_iter().collect::<Vec<_>>(), Span::default())
}

fn number(value: usize) -> Datum {
    i64::try_from(value).unwrap_or(i64::MAX).into_datum()
}

/// Returns the keyword of a name such as `:sequence`.
fn keyword(name: &str) -> Datum {
    Datum::symbol(Symbol::keyword(&name.trim_start_matches(':').to_uppercase()), Span::default())
}

/// Returns the value that a text of a port stands for.
fn value(text: &str) -> Datum {
    let literal = literal(text);
    match &*literal {
        "t" => true.into_datum(),
        "nil" => false.into_datum(),
        written if written.starts_with('"') => text.into_datum(),
        written => written_number(written).unwrap_or_else(|| text.into_datum()),
    }
}

fn written_number(text: &str) -> Option<Datum> {
    let whole = text.parse::<i64>().ok().map(i64::into_datum);
    whole.or_else(|| Some(Datum::new(DatumKind::Float(text.parse().ok()?), Span::default())))
}

fn node(node: &TreeNode) -> Datum {
    let ports = node.ports.iter().map(|port| {
        let (is_entry, value) = match &port.value {
            PortValue::Entry(entry) => (true, entry.clone().into_datum()),
            PortValue::Text(text) if is_plain_text(&port.name) => (false, text.clone().into_datum()),
            PortValue::Text(text) => (false, value(text)),
        };
        list([port.name.clone().into_datum(), is_entry.into_datum(), value])
    });
    let conditions = node
        .conditions
        .iter()
        .map(|(moment, condition)| list([keyword(moment_name(*moment)), script(condition)]));
    list([
        keyword(operator(node.kind)),
        node.id.clone().into_datum(),
        node.name.clone().into_datum(),
        i64::from(node.place.line).into_datum(),
        list(ports.collect::<Vec<_>>()),
        list(conditions.collect::<Vec<_>>()),
        script(&node.script),
        list(node.children.iter().map(|&child| number(child)).collect::<Vec<_>>()),
        node.remaps_all.into_datum(),
    ])
}

/// Returns whether a port holds a name, whatever it looks like.
fn is_plain_text(port: &str) -> bool {
    ["output_key", "key", "else", "if_empty", "return_on_mismatch", "code", "if"].contains(&port)
}

fn script(script: &Script) -> Datum {
    let expressions = script.expressions.iter().map(expression);
    let statements = script.statements.iter().map(|&statement| number(statement));
    list([list(expressions.collect::<Vec<_>>()), list(statements.collect::<Vec<_>>())])
}

fn expression(expression: &Expression) -> Datum {
    let text = |text: &str| text.into_datum();
    match expression {
        Expression::Number(written) => {
            list([keyword("value"), written_number(written).unwrap_or(text(written))])
        }
        Expression::Text(written) => list([keyword("value"), text(written)]),
        Expression::Boolean(value) => list([keyword("value"), value.into_datum()]),
        Expression::Name(name) => list([keyword("name"), text(name)]),
        Expression::Unary(operator, operand) => list([keyword("unary"), text(operator), number(*operand)]),
        Expression::Binary(operator, left, right) => {
            list([keyword("binary"), text(operator), number(*left), number(*right)])
        }
        Expression::Comparison(operators, operands) => {
            let operators = list(operators.iter().map(|operator| text(operator)).collect::<Vec<_>>());
            let operands = list(operands.iter().map(|&operand| number(operand)).collect::<Vec<_>>());
            list([keyword("comparison"), operators, operands])
        }
        Expression::Conditional(condition, then, other) => {
            list([keyword("conditional"), number(*condition), number(*then), number(*other)])
        }
        Expression::Assignment(operator, name, value) => {
            list([keyword("assignment"), text(operator), text(name), number(*value)])
        }
    }
}
