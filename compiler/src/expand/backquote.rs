//! Backquote: templates of lists and vectors.
//!
//! The reader represents `` `x `` as `(%backquote x)`, `,x` as `(%unquote
//! x)` and `,@x` as `(%unquote-splicing
//! x)`. A template becomes calls of `list`, `list*`, `cons`, `append` and `vector` that build it. Parts
//! without a comma stay constants, shared by everything that the template makes. A backquote within a
//! backquote is data of the outer one, except for commas that belong to the outer one.
//!
//! Templates are walked with an explicit stack, since they may be as deep as the reader allows.

use esl_bytecode::compile::Environment;
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::symbol::Symbol;

use super::expander::Expander;
use super::form::{Checked, Form, Make, is_constant, is_esl, operator};
use super::job::{Job, To};
use crate::diagnostic::code;

/// Meaning of a part of a template.
#[derive(Debug)]
enum Piece {
    /// The part itself.
    Constant(Datum),
    /// The values of these forms: one form, except after `,` with several arguments within a nested
    /// backquote.
    Forms(Vec<Datum>),
    /// The elements of the lists that these forms return.
    Splices(Vec<Datum>),
}

/// A step of the walk over a template.
enum TemplateStep {
    /// Visits a part at a level of backquotes; leaves a piece.
    Visit(Datum, usize),
    /// Makes a list of the `count` newest pieces, and of one more for the tail if there is a dot.
    List { original: Datum, count: usize, is_dotted: bool },
    /// Makes a vector of the `count` newest pieces.
    Vector { original: Datum, count: usize },
}

/// `(%backquote template)`
pub(super) fn backquote(expander: &mut Expander, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    form.takes(1..=1, "takes one template")?;
    let make = Make(to.span);
    let built = match template(&form.args[0], make) {
        Piece::Constant(datum) => quote(datum, make),
        Piece::Forms(mut forms) if forms.len() == 1 => forms.swap_remove(0),
        Piece::Forms(_) | Piece::Splices(_) => {
            let message = "`,@` needs a list around it within the backquote";
            return Err(Box::new(code::MISPLACED_SPLICE.at(to.span, message)));
        }
    };
    expander.schedule([Job::Expand(built, to)]);
    Ok(())
}

/// `(%unquote form)` outside of a backquote.
pub(super) fn misplaced_unquote(_: &mut Expander, _: &mut dyn Environment, form: Form, _: To) -> Checked {
    let message = "this comma belongs to no backquote";
    Err(Box::new(code::COMMA_OUTSIDE_BACKQUOTE.at(form.span, message)))
}

fn template(datum: &Datum, make: Make) -> Piece {
    let mut steps = vec![TemplateStep::Visit(datum.clone(), 1)];
    let mut pieces: Vec<Piece> = Vec::new();
    while let Some(step) = steps.pop() {
        match step {
            TemplateStep::Visit(datum, level) => {
                if let Some(piece) = visit(&datum, level, &mut steps) {
                    pieces.push(piece);
                }
            }
            TemplateStep::List { original, count, is_dotted } => {
                let tail = if is_dotted { pieces.pop() } else { None };
                let items = pieces.split_off(pieces.len() - count);
                pieces.push(list(original, items, tail, make));
            }
            TemplateStep::Vector { original, count } => {
                let items = pieces.split_off(pieces.len() - count);
                pieces.push(vector(original, items, make));
            }
        }
    }
    pieces.pop().expect("each visit leaves a piece")
}

/// Whether `datum` is a form of an operator of backquote.
fn is_operation(datum: &Datum, name: &str) -> bool {
    operator(datum).is_some_and(|symbol| is_esl(symbol, name))
}

/// Visits a part: returns its piece, or schedules the steps that leave it.
fn visit(datum: &Datum, level: usize, steps: &mut Vec<TemplateStep>) -> Option<Piece> {
    match datum.kind() {
        DatumKind::Vector(items) => {
            steps.push(TemplateStep::Vector { original: datum.clone(), count: items.len() });
            steps.extend(items.iter().rev().map(|item| TemplateStep::Visit(item.clone(), level)));
            None
        }
        DatumKind::Cons(_, args) => {
            let is_splice = is_operation(datum, "%UNQUOTE-SPLICING");
            let is_unquote = is_splice || is_operation(datum, "%UNQUOTE");
            if is_unquote && level == 1 {
                let forms = args.elements().cloned().collect();
                return Some(if is_splice { Piece::Splices(forms) } else { Piece::Forms(forms) });
            }
            // Within a nested backquote, a comma is data, and the parts inside it belong to the level below.
            let inner = match () {
                () if is_unquote => level - 1,
                () if is_operation(datum, "%BACKQUOTE") => level + 1,
                () => level,
            };
            visit_list(datum, level, inner, steps);
            None
        }
        _ => Some(Piece::Constant(datum.clone())),
    }
}

fn visit_list(datum: &Datum, level: usize, inner: usize, steps: &mut Vec<TemplateStep>) {
    let mut items = Vec::new();
    let mut rest = datum;
    let mut tail = None;
    while let Some((item, next)) = rest.as_cons() {
        // `(a . ,b)` reads as `(a %unquote b)`: from the second element on, such a rest is the tail behind a
        // dot.
        let is_tail =
            ["%UNQUOTE", "%UNQUOTE-SPLICING", "%BACKQUOTE"].iter().any(|name| is_operation(rest, name))
                && next.as_cons().is_some_and(|(_, end)| end.is_nil());
        if !items.is_empty() && is_tail {
            tail = Some(rest.clone());
            break;
        }
        let level = if items.is_empty() { level } else { inner };
        items.push(TemplateStep::Visit(item.clone(), level));
        rest = next;
    }
    if tail.is_none() && !rest.is_nil() {
        tail = Some(rest.clone());
    }
    steps.push(TemplateStep::List { original: datum.clone(), count: items.len(), is_dotted: tail.is_some() });
    steps.extend(tail.map(|tail| TemplateStep::Visit(tail, inner)));
    steps.extend(items.into_iter().rev());
}

fn quote(datum: Datum, make: Make) -> Datum {
    match datum.kind() {
        DatumKind::Cons(..) | DatumKind::Symbol(_)
            if !(datum.as_symbol().is_some() && is_constant(&datum)) =>
        {
            make.quote(datum)
        }
        _ => datum,
    }
}

/// Makes a list of pieces: a constant if all of them are.
fn list(original: Datum, items: Vec<Piece>, tail: Option<Piece>, make: Make) -> Piece {
    // The constant end of the list is shared.
    let mut constant_end = match &tail {
        None => Some(items.len()),
        Some(Piece::Constant(_)) => Some(items.len()),
        Some(_) => None,
    };
    if let Some(end) = &mut constant_end {
        while *end > 0 && matches!(items[*end - 1], Piece::Constant(_)) {
            *end -= 1;
        }
        if *end == 0 {
            return Piece::Constant(original);
        }
    }
    let end_form = match (constant_end, tail) {
        (Some(end), _) => {
            let mut rest = &original;
            for _ in 0..end {
                rest = rest.as_cons().map_or(rest, |(_, cdr)| cdr);
            }
            (!rest.is_nil()).then(|| quote(rest.clone(), make))
        }
        (None, Some(Piece::Forms(mut forms))) if forms.len() == 1 => Some(forms.swap_remove(0)),
        // The reader rejects `(a . ,@b)`, which has no meaning. Several forms cannot stand for one tail.
        (None, Some(Piece::Forms(forms) | Piece::Splices(forms))) => Some(make.call_cl("APPEND", forms)),
        (None, Some(Piece::Constant(_)) | None) => None,
    };
    let kept = constant_end.unwrap_or(items.len());

    // Runs of items alternate with spliced lists; the last run includes the end.
    let mut parts: Vec<Datum> = Vec::new();
    let mut run: Vec<Datum> = Vec::new();
    for piece in items.into_iter().take(kept) {
        match piece {
            Piece::Constant(datum) => run.push(quote(datum, make)),
            Piece::Forms(forms) => run.extend(forms),
            Piece::Splices(forms) => {
                if !run.is_empty() {
                    parts.push(make.call_cl("LIST", std::mem::take(&mut run)));
                }
                parts.extend(forms);
            }
        }
    }
    match (run.is_empty(), end_form) {
        (true, None) => {}
        (true, Some(end)) => parts.push(end),
        (false, None) => parts.push(make.call_cl("LIST", run)),
        (false, Some(end)) => {
            let function = if run.len() == 1 { "CONS" } else { "LIST*" };
            run.push(end);
            parts.push(make.call_cl(function, run));
        }
    }
    Piece::Forms(vec![match parts.len() {
        1 => parts.swap_remove(0),
        _ => make.call_cl("APPEND", parts),
    }])
}

fn vector(original: Datum, items: Vec<Piece>, make: Make) -> Piece {
    if items.iter().all(|piece| matches!(piece, Piece::Constant(_))) {
        return Piece::Constant(original);
    }
    if !items.iter().any(|piece| matches!(piece, Piece::Splices(_))) {
        let forms = items.into_iter().flat_map(|piece| match piece {
            Piece::Constant(datum) => vec![quote(datum, make)],
            Piece::Forms(forms) | Piece::Splices(forms) => forms,
        });
        let forms: Vec<Datum> = forms.collect();
        return Piece::Forms(vec![make.call_cl("VECTOR", forms)]);
    }
    // A list of the same elements serves as the constant end.
    let constants: Vec<Datum> = match original.kind() {
        DatumKind::Vector(items) => items.to_vec(),
        _ => Vec::new(),
    };
    let as_list = Datum::list(constants, make.0);
    match list(as_list, items, None, make) {
        Piece::Forms(mut forms) if forms.len() == 1 => Piece::Forms(vec![
            make.esl("%APPLY-GLOBAL", [make.symbol(&Symbol::cl("VECTOR")), forms.swap_remove(0)]),
        ]),
        other => other,
    }
}
