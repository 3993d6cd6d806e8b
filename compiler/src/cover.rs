//! Places whose passages are counted, for reports of what a program has run.
//!
//! `cover` puts a [`NodeKind::Pass`] in front of the forms of a top-level form: before each that may be
//! evaluated more or less often than what is around it, as the arms of an `if`, and before each that begins
//! a line of the source. The expansion of a macro has the place of the macro's call and is not counted apart.
//!
//! Guarantees: the meaning of the form stays, and its ticks. Not here: which places are the clauses of the
//! forms that people know (the package `esl-testing`).

use esl_bytecode::span::Span;

use crate::core::*;
use crate::lower::SourceLines;
use crate::resolve::{children, children_mut, lambda_nodes};

/// A place whose passages are counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CountedPlace {
    /// Text of the form.
    pub span: Span,
    /// The event that a passage stands for.
    pub kind: PassageKind,
}

/// The event for which control passes a counted place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PassageKind {
    /// The form is evaluated.
    Form,
    /// The form, a conditional, chooses none of the arms that are written.
    NoArm,
    /// The function that the form defines is called.
    Call,
}

/// Largest number of places, which an instruction can name.
const MOST_PLACES: usize = 1 << 24;

/// The form around a node, and the role of the node in it.
#[derive(Clone, Copy)]
struct Surroundings {
    /// Place of the form around it.
    around: Span,
    role: Position,
}

/// Where a node stands in the form around it.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Position {
    /// A part whose value is used, such as an argument: evaluated as often as the whole.
    Part,
    /// One of several forms in a row.
    Statement,
    /// Evaluated or not.
    Arm,
    /// Has to stay as it is.
    Fixed,
}

/// Counts passages in a top-level form. Places get the numbers that follow those in `places`, each a lower
/// one than the places inside its form, and are added to it.
pub(crate) fn cover(core: &mut Core, lines: &SourceLines, places: &mut Vec<CountedPlace>) {
    let found = find(core, lines, places);
    let mut numbers = Vec::with_capacity(core.nodes.len());
    let mut next = 0;
    for counted in &found {
        numbers.push(next);
        next += if counted.is_empty() { 1 } else { counted.len() as u32 + 2 };
    }
    let number = |node: NodeId| NodeId(numbers[node.index()]);
    let mut nodes = Vec::with_capacity(next as usize);
    for (mut node, counted) in std::mem::take(&mut core.nodes).into_iter().zip(found) {
        children_mut(&mut node.kind, &mut |child| *child = number(*child));
        if !counted.is_empty() {
            let span = node.span;
            let first = nodes.len() as u32 + 1;
            let row = (first..=first + counted.len() as u32).map(NodeId).collect();
            nodes.push(Node { kind: NodeKind::Progn(row), span });
            nodes.extend(counted.iter().map(|&place| Node { kind: NodeKind::Pass(place), span }));
        }
        nodes.push(node);
    }
    core.nodes = nodes;
    for lambda in &mut core.lambdas {
        lambda.body = number(lambda.body);
        let keys = lambda.keys.iter_mut().flatten().map(|key| &mut key.optional);
        for optional in lambda.optional.iter_mut().chain(keys) {
            optional.default = number(optional.default);
        }
    }
}

/// Returns the numbers of the places that are passed in front of each node.
fn find(core: &Core, lines: &SourceLines, places: &mut Vec<CountedPlace>) -> Vec<Vec<u32>> {
    let mut found = vec![Vec::new(); core.nodes.len()];
    let mut add = |places: &mut Vec<CountedPlace>, node: NodeId, span: Span, kind: PassageKind| {
        if places.len() < MOST_PLACES {
            found[node.index()].push(places.len() as u32);
            places.push(CountedPlace { span, kind });
        }
    };
    let line = |span: Span| lines.line_and_column(span).map(|(line, _)| line);
    let is_at = |one: Span, other: Span| (one.source, one.start) == (other.source, other.start);
    for (index, at) in surroundings(core).into_iter().enumerate() {
        let Some(Surroundings { around, role }) = at else { continue };
        let Node { kind, span } = &core.nodes[index];
        let node = NodeId(index as u32);
        if span.start == span.end || line(*span).is_none() {
            continue;
        }
        if is_at(*span, around) {
            let is_nil = matches!(kind, NodeKind::Constant(datum) if datum.is_nil());
            if role == Position::Arm && is_nil {
                add(places, node, *span, PassageKind::NoArm);
            }
            continue;
        }
        let is_atom = matches!(
            kind,
            NodeKind::Constant(_)
                | NodeKind::Local(_)
                | NodeKind::Special(_)
                | NodeKind::FunctionRef(_)
                | NodeKind::BuiltinRef(_)
                | NodeKind::Lambda(_)
        );
        let is_counted = match role {
            Position::Fixed => false,
            // One of several forms that were made of a form of the text, which is counted already.
            _ if around == Span::default() && is_counted(places, *span) => false,
            Position::Statement | Position::Arm => true,
            Position::Part => !is_atom && line(*span) != line(around),
        };
        if is_counted {
            add(places, node, *span, PassageKind::Form);
        }
    }
    for lambda in core.lambdas.iter().skip(1).filter(|lambda| lambda.name.is_some()) {
        if lambda.span.start < lambda.span.end {
            add(places, lambda.body, lambda.span, PassageKind::Call);
        }
    }
    found
}

/// Whether a form of the text is counted, which is the last one so far.
fn is_counted(places: &[CountedPlace], span: Span) -> bool {
    let inside = |place: &&CountedPlace| {
        place.span.source == span.source && (span.start..span.end).contains(&place.span.start)
    };
    let mut inside = places.iter().rev().take_while(inside);
    inside.any(|place| place.span == span && place.kind == PassageKind::Form)
}

/// Returns what is around each node; nothing for nodes that belong to nothing.
fn surroundings(core: &Core) -> Vec<Option<Surroundings>> {
    let mut known: Vec<Option<Surroundings>> = vec![None; core.nodes.len()];
    let of_lambda = |known: &mut Vec<Option<Surroundings>>, lambda: LambdaId, around: Span| {
        let lambda = &core.lambdas[lambda.index()];
        lambda_nodes(lambda, &mut |node| {
            let role = if node == lambda.body { Position::Statement } else { Position::Part };
            known[node.index()] = Some(Surroundings { around, role });
        });
    };
    if !core.lambdas.is_empty() {
        of_lambda(&mut known, LambdaId(0), Span::default());
    }
    for Node { kind, span } in &core.nodes {
        let around = *span;
        children(kind, &mut |child| {
            known[child.index()] = Some(Surroundings { around, role: Position::Part });
        });
        let mut set = |node: &NodeId, role| known[node.index()] = Some(Surroundings { around, role });
        match kind {
            NodeKind::If(_, consequent, alternative) => {
                [consequent, alternative].iter().for_each(|arm| set(arm, Position::Arm));
            }
            NodeKind::And(forms) | NodeKind::Or(forms) => {
                forms.iter().skip(1).for_each(|form| set(form, Position::Arm));
            }
            NodeKind::Progn(forms) => forms.iter().for_each(|form| set(form, Position::Statement)),
            NodeKind::Tagbody(_, items) => {
                for item in items {
                    if let TagbodyItem::Form(form) = item {
                        set(form, Position::Statement);
                    }
                }
            }
            NodeKind::Let { body, .. }
            | NodeKind::Functions { body, .. }
            | NodeKind::Block(_, body)
            | NodeKind::Catch(_, body)
            | NodeKind::Progv(_, _, body)
            | NodeKind::BindValues(_, _, body) => set(body, Position::Statement),
            NodeKind::UnwindProtect(body, cleanup) | NodeKind::FailureCleanup(body, cleanup) => {
                set(body, Position::Statement);
                set(cleanup, Position::Statement);
            }
            NodeKind::HandlerCase(body, clauses) => {
                set(body, Position::Statement);
                clauses.iter().for_each(|clause| set(&clause.body, Position::Arm));
            }
            NodeKind::Recovery { table, procedures, body } => {
                set(table, Position::Fixed);
                set(procedures, Position::Fixed);
                set(body, Position::Statement);
            }
            NodeKind::Handlers(first, body) | NodeKind::Mask(first, body) => {
                set(first, Position::Fixed);
                set(body, Position::Statement);
            }
            _ => {}
        }
        match kind {
            NodeKind::Lambda(lambda) => of_lambda(&mut known, *lambda, around),
            NodeKind::Functions { definitions, .. } => {
                definitions.iter().for_each(|(_, lambda)| of_lambda(&mut known, *lambda, around));
            }
            _ => {}
        }
    }
    known
}
