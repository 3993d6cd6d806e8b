//! Control: conditionals, blocks, tags, catches, cleanups, multiple values.

use esl_bytecode::compile::Environment;
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::diagnostic::Diagnostic;
use esl_bytecode::symbol::Symbol;
use rustc_hash::FxHashSet;

use super::expander::Expander;
use super::form::{Checked, Form, infix, is_constant, is_known, name, on_one_line, plain, quoted};
use super::job::{Job, LongCond, PARTS_AT_ONCE, To};
use super::scope::{ScopeEntry, Tag, Visible};
use crate::core::{BlockId, BoundVariable, NodeId, NodeKind, TagbodyItem};
use crate::diagnostic::code;
use crate::similar::is_like;

/// `(quote datum)`
pub(super) fn quote(expander: &mut Expander, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    form.takes(1..=1, "takes one datum")?;
    expander.literal(form.args[0].clone(), to);
    Ok(())
}

/// `(%quote-object datum)`: the datum as it is, even if it cannot be written to a file.
pub(super) fn quote_object(expander: &mut Expander, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    form.takes(1..=1, "takes one datum")?;
    expander.fill(to, NodeKind::Constant(form.args[0].clone()));
    Ok(())
}

/// `(if test then [else])`
pub(super) fn if_(expander: &mut Expander, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    form.takes(2..=3, "takes a test, a form for true, and at most one for false")
        .map_err(|fault| foreign_if(&form).map_or(fault, Box::new))?;
    let nil = Datum::nil(to.span);
    let (test, first) = expander.part(form.args[0].clone(), to);
    let then = expander.result(to);
    let otherwise = expander.result(to);
    expander.fill(to, NodeKind::If(test, then.node, otherwise.node));
    let second = Job::Expand(form.args[1].clone(), then);
    let third = Job::Expand(form.args.get(2).cloned().unwrap_or(nil), otherwise);
    expander.schedule([first, second, third]);
    Ok(())
}

/// Returns the error about an `if` with `then` and `else`, or with an operator in its test.
fn foreign_if(form: &Form) -> Option<Diagnostic> {
    let is_word = |part: &Datum, word| part.as_symbol().is_some_and(|symbol| symbol.name() == word);
    let message = "the parts of an `if` stand one after the other, without words between them";
    let written = match form.args.as_slice() {
        [test, word, then] if is_word(word, "THEN") => vec![test, then],
        [test, word, then, otherwise_word, otherwise]
            if is_word(word, "THEN") && is_word(otherwise_word, "ELSE") =>
        {
            vec![test, then, otherwise]
        }
        [test, then, word, otherwise] if is_word(word, "ELSE") => vec![test, then, otherwise],
        [left, operator, right, ..] => {
            return infix(Some(left), &[operator.clone(), right.clone()], form.span);
        }
        _ => return None,
    };
    let written: Vec<String> = written.into_iter().map(|part| on_one_line(part, 20)).collect();
    Some(code::FOREIGN_FORM.at(form.span, message).help(format!("write `(if {})`", written.join(" "))))
}

/// `(progn . body)`
pub(super) fn progn(expander: &mut Expander, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    let jobs = expander.body(form.args, to);
    expander.schedule(jobs);
    Ok(())
}

/// `(the type form)`
pub(super) fn the(expander: &mut Expander, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    form.takes(2..=2, "takes a type and a form")?;
    expander.note_declared(&form.args[0], &form, to.origin);
    expander.schedule([Job::Expand(form.args[1].clone(), to)]);
    Ok(())
}

/// `(and form*)`
pub(super) fn and(expander: &mut Expander, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    connective(expander, form, to, Datum::symbol(Symbol::cl("T"), to.span), NodeKind::And)
}

/// `(or form*)`
pub(super) fn or(expander: &mut Expander, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    connective(expander, form, to, Datum::nil(to.span), NodeKind::Or)
}

/// Builds a node of several forms; one form stands for itself, and `none` for no form.
fn connective(
    expander: &mut Expander,
    form: Form,
    to: To,
    none: Datum,
    node: fn(Vec<NodeId>) -> NodeKind,
) -> Checked {
    match form.args.len() {
        0 => expander.fill(to, NodeKind::Constant(none)),
        1 => expander.schedule([Job::Expand(form.args[0].clone(), to)]),
        _ => {
            let (nodes, jobs) = expander.children(form.args, to);
            expander.fill(to, node(nodes));
            expander.schedule(jobs);
        }
    }
    Ok(())
}

/// Clauses of a `cond` that become nested conditionals. A longer one becomes a block that its clauses leave,
/// so that the depth of nodes does not grow with the length of a form.
const NESTED_CLAUSES: usize = 100;

/// Returns the parts of a clause of a `cond`: a test, and forms.
fn clause_of_cond(form: &Form, clause: &Datum) -> Checked<Vec<Datum>> {
    match clause.as_list() {
        Some(parts) if !parts.is_empty() => Ok(parts.into_iter().cloned().collect()),
        _ => {
            let what = format!("needs clauses, each a list of a test and forms, not {}", quoted(clause));
            Err(form.fault(code::MALFORMED_CLAUSE, clause.span(), &what))
        }
    }
}

/// `(cond (test . body)*)`
pub(super) fn cond(expander: &mut Expander, _: &mut dyn Environment, mut form: Form, to: To) -> Checked {
    if form.args.len() > NESTED_CLAUSES {
        let block = expander.block(None, to);
        expander.core().blocks[block.index()].is_used = true;
        let row = expander.child(to);
        let items = std::mem::take(&mut form.args).into_iter();
        let (nodes, jobs) = Default::default();
        return expander.go_on_with_cond(Box::new(LongCond { form, to, block, row, items, nodes, jobs }));
    }
    let clauses: Checked<Vec<Vec<Datum>>> =
        form.args.iter().map(|clause| clause_of_cond(&form, clause)).collect();
    let mut jobs = Vec::new();
    let mut at = to;
    let mut clauses = clauses?.into_iter().peekable();
    while let Some(mut clause) = clauses.next() {
        let test = clause.remove(0);
        let is_true = is_constant(&test) && !test.is_nil();
        if is_true {
            if let Some(next) = clauses.peek().and_then(|next| next.first())
                && is_known(expander.origins.written(next.span(), to.origin))
                && is_known(expander.origins.written(test.span(), to.origin))
            {
                let message = format!("this clause is never reached: {} is always true", quoted(&test));
                let diagnostic = code::UNREACHABLE_CODE.at(next.span(), message);
                expander.report(diagnostic.also(test.span(), "this test is always true"), to.origin);
            }
            let body = if clause.is_empty() { vec![test] } else { clause };
            jobs.extend(expander.body(body, at));
            expander.schedule(jobs);
            return Ok(());
        }
        let (node, job) = expander.part(test, at);
        jobs.push(job);
        if clause.is_empty() {
            // If the test is true, its first value is the value of the form.
            let rest = expander.child(at);
            expander.fill(at, NodeKind::Or(vec![node, rest.node]));
            at = rest;
        } else {
            let then = expander.result(at);
            jobs.extend(expander.body(clause, then));
            let rest = expander.result(at);
            expander.fill(at, NodeKind::If(node, then.node, rest.node));
            at = rest;
        }
    }
    expander.fill(at, NodeKind::Constant(Datum::nil(to.span)));
    expander.schedule(jobs);
    Ok(())
}

impl Expander {
    /// Goes on with the clauses of a long `cond`, each of which leaves a block with its value.
    pub(super) fn go_on_with_cond(&mut self, mut state: Box<LongCond>) -> Checked {
        let LongCond { form, to, block, row, items, nodes, jobs } = &mut *state;
        for clause in items.by_ref().take(PARTS_AT_ONCE) {
            let mut clause = clause_of_cond(form, &clause)?;
            let item = self.child(*row);
            nodes.push(item.node);
            let (test, job) = self.part(clause.remove(0), item);
            jobs.push(job);
            if clause.is_empty() {
                // If the test is true, its first value is the value of the form. A variable keeps it until
                // then.
                let variable = self.variable(Symbol::cl("COND"), to.span, *to);
                let chosen = self.child(item);
                let bindings = vec![(BoundVariable::Lexical(variable), test)];
                self.fill(item, NodeKind::Let { sequential: false, bindings, body: chosen.node });
                let again = self.child(chosen);
                self.read(variable, again);
                let value = leave_if(self, *block, chosen, again.node);
                self.read(variable, value);
            } else {
                let value = leave_if(self, *block, item, test);
                jobs.extend(self.body(clause, value));
            }
        }
        if items.len() > 0 {
            self.schedule([Job::Cond(state)]);
            return Ok(());
        }
        let LongCond { to, block, row, mut nodes, jobs, .. } = *state;
        let end = self.child(row);
        self.fill(end, NodeKind::Constant(Datum::nil(to.span)));
        nodes.push(end.node);
        self.fill(row, NodeKind::Progn(nodes));
        self.fill(to, NodeKind::Block(block, row.node));
        self.schedule(jobs);
        Ok(())
    }
}

/// Makes `to` leave `block` if `test` is true; returns the destination of the values to leave with.
fn leave_if(expander: &mut Expander, block: BlockId, to: To, test: NodeId) -> To {
    let leave = expander.child(to);
    let value = expander.child(leave);
    let nil = expander.child(to);
    expander.fill(to, NodeKind::If(test, leave.node, nil.node));
    expander.fill(leave, NodeKind::ReturnFrom(block, value.node));
    expander.fill(nil, NodeKind::Constant(Datum::nil(to.span)));
    value
}

/// Returns the first argument as the name of a block: a symbol, `NIL` included.
fn block_name(form: &Form) -> Checked<Symbol> {
    let shape = "needs the name of a block";
    let Some(named) = form.args.first() else { return Err(form.missing(shape)) };
    match named.kind() {
        DatumKind::Nil => Ok(Symbol::cl("NIL")),
        DatumKind::Symbol(symbol) => Ok(symbol.clone()),
        _ => Err(form.not_a_name(named, shape)),
    }
}

/// `(block name . body)`
pub(super) fn block(expander: &mut Expander, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    let name = block_name(&form)?;
    let block = expander.block(Some(name.clone()), to);
    let inside = expander.child(to);
    expander.fill(to, NodeKind::Block(block, inside.node));
    expander.scoped_body(vec![ScopeEntry::Block(name, block)], form.args[1..].to_vec(), inside);
    Ok(())
}

/// `(return-from name [value])`
pub(super) fn return_from(expander: &mut Expander, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    let name = block_name(&form)?;
    form.takes(1..=2, "takes the name of a block and at most one form")?;
    leave(expander, &form, &name, form.args.get(1), to)
}

/// `(return [value])`
pub(super) fn return_(expander: &mut Expander, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    form.takes(0..=1, "takes at most one form")?;
    leave(expander, &form, &Symbol::cl("NIL"), form.args.first(), to)
}

fn leave(expander: &mut Expander, form: &Form, block: &Symbol, value: Option<&Datum>, to: To) -> Checked {
    let id = match expander.scope.block(block, expander.level()) {
        Visible::Is(id) => id,
        Visible::OutOfReach => {
            let what =
                format!("cannot leave the block {}: this code runs when macros are expanded", name(block));
            return Err(form.fault(code::RUN_TIME_ONLY, form.span, &what));
        }
        Visible::No => return Err(unknown_block(expander, form, block)),
    };
    let (node, job) = expander.part(value.cloned().unwrap_or_else(|| Datum::nil(to.span)), to);
    let block = &mut expander.core().blocks[id.index()];
    block.is_used = true;
    block.is_captured |= block.owner != to.lambda;
    expander.fill(to, NodeKind::ReturnFrom(id, node));
    expander.schedule([job]);
    Ok(())
}

/// Returns the name of the only named block around a form; `None` if there are several.
fn named_block(expander: &Expander) -> Option<&Symbol> {
    let mut names = expander.scope.block_names().filter(|name| !name.is_cl("NIL"));
    names.next().filter(|_| names.next().is_none())
}

fn unknown_block(expander: &Expander, form: &Form, block: &Symbol) -> Box<Diagnostic> {
    if block.is_cl("NIL") {
        let message = format!("{} needs a loop or a `(block nil …)` around it", name(&form.operator));
        let diagnostic = code::UNKNOWN_BLOCK.at(form.head(), message);
        // The name of a function is the name of the block around its forms.
        let Some(function) = named_block(expander) else {
            return Box::new(diagnostic);
        };
        let (function, value) = (plain(function), form.args.first().map(|value| on_one_line(value, 20)));
        let value = value.map_or(String::new(), |value| format!(" {value}"));
        let help = format!(
            "the last form of a function is its value; to leave earlier, write `(return-from {function}{value})`"
        );
        return Box::new(diagnostic.help(help));
    }
    let message = format!("no block called {} encloses this {}", name(block), name(&form.operator));
    let named = form.args.first().map_or(form.span, Datum::span);
    let diagnostic = code::UNKNOWN_BLOCK.at(form.at(named), message);
    let like = expander.scope.block_names().filter(|name| is_like(name.name(), block.name()));
    if let Some(like) = like.min_by_key(|name| name.name()) {
        return Box::new(diagnostic.help(format!("did you mean `{}`?", plain(like))));
    }
    let mut around: Vec<String> = expander
        .scope
        .block_names()
        .filter(|name| !name.is_cl("NIL"))
        .map(|name| format!("`{}`", plain(name)))
        .collect();
    around.sort();
    around.truncate(5);
    Box::new(if around.is_empty() {
        diagnostic
    } else {
        diagnostic.help(format!("the blocks around it are: {}", around.join(", ")))
    })
}

/// `(tagbody {tag | form}*)`
pub(super) fn tagbody(expander: &mut Expander, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    let tagbody = expander.tagbody(to);
    let mut entries = Vec::new();
    let mut items = Vec::new();
    let mut jobs = Vec::new();
    let mut seen = FxHashSet::default();
    for item in &form.args {
        match Tag::of(item) {
            Some(tag) => {
                if !seen.insert(tag.clone()) {
                    // A macro without an effect leaves `NIL` behind, so that may occur more than once.
                    if item.is_nil() {
                        continue;
                    }
                    let what = format!("has the tag {} twice", quoted(item));
                    return Err(form.fault(code::DUPLICATE_TAG, item.span(), &what));
                }
                items.push(TagbodyItem::Tag);
                entries.push(ScopeEntry::Tag(tag, tagbody, entries.len() as u32));
            }
            None if item.as_cons().is_some() => {
                let (node, job) = expander.statement(item.clone(), to);
                items.push(TagbodyItem::Form(node));
                jobs.push(job);
            }
            None => {
                let what = format!("needs tags and forms, not {}", quoted(item));
                return Err(form.malformed_at(item.span(), &what));
            }
        }
    }
    expander.check_reachable(&form.args, to);
    expander.fill(to, NodeKind::Tagbody(tagbody, items));
    let count = entries.len();
    expander.schedule(
        std::iter::once(Job::Enter(entries)).chain(jobs).chain([Job::Leave(count)]).collect::<Vec<_>>(),
    );
    Ok(())
}

/// `(go tag)`
pub(super) fn go(expander: &mut Expander, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    form.takes(1..=1, "takes one tag")?;
    let Some(tag) = Tag::of(&form.args[0]) else {
        return Err(form.not_a_name(&form.args[0], "needs a symbol or an integer as the tag"));
    };
    match expander.scope.tag(&tag, expander.level()) {
        Visible::Is((tagbody, number)) => {
            let home = &mut expander.core().tagbodies[tagbody.index()];
            home.is_captured |= home.owner != to.lambda;
            expander.fill(to, NodeKind::Go(tagbody, number));
            Ok(())
        }
        Visible::OutOfReach | Visible::No => {
            let message = format!("no `tagbody` around this `go` has the tag {}", quoted(&form.args[0]));
            let diagnostic = code::UNKNOWN_TAG.at(form.at(form.args[0].span()), message);
            let Tag::Symbol(tag) = tag else { return Err(Box::new(diagnostic)) };
            let like = expander.scope.tag_names().filter(|name| is_like(name.name(), tag.name()));
            Err(Box::new(match like.min_by_key(|name| name.name()) {
                Some(like) => diagnostic.help(format!("did you mean `{}`?", plain(like))),
                None => diagnostic,
            }))
        }
    }
}

/// `(catch tag . body)`
pub(super) fn catch(expander: &mut Expander, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    form.takes(1..=usize::MAX, "needs a form for the tag")?;
    with_body(expander, form, to, NodeKind::Catch)
}

/// `(throw tag value)`
pub(super) fn throw(expander: &mut Expander, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    form.takes(2..=2, "takes a form for the tag and one for the value")?;
    with_body(expander, form, to, NodeKind::Throw)
}

/// `(unwind-protect form . cleanup)`
pub(super) fn unwind_protect(
    expander: &mut Expander,
    _: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    form.takes(1..=usize::MAX, "needs a form to protect")?;
    with_body(expander, form, to, NodeKind::UnwindProtect)
}

/// `(multiple-value-prog1 form . body)`
pub(super) fn multiple_value_prog1(
    expander: &mut Expander,
    _: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    form.takes(1..=usize::MAX, "needs a form")?;
    with_body(expander, form, to, NodeKind::FirstValues)
}

/// `(%with-handlers handlers . body)`
pub(super) fn with_handlers(expander: &mut Expander, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    form.takes(1..=usize::MAX, "needs a form for the handlers")?;
    with_body(expander, form, to, NodeKind::Handlers)
}

/// `(%with-mask height . body)`
pub(super) fn with_mask(expander: &mut Expander, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    form.takes(1..=usize::MAX, "needs a form for the height")?;
    with_body(expander, form, to, NodeKind::Mask)
}

/// Makes `to` a node of one form and a body.
fn with_body(expander: &mut Expander, form: Form, to: To, kind: fn(NodeId, NodeId) -> NodeKind) -> Checked {
    let (first, job) = expander.part(form.args[0].clone(), to);
    let body = expander.child(to);
    expander.fill(to, kind(first, body.node));
    let mut jobs = vec![job];
    jobs.extend(expander.body(form.args[1..].to_vec(), body));
    expander.schedule(jobs);
    Ok(())
}

/// When the body of an `eval-when` is evaluated.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Situations {
    pub(super) compile: bool,
    pub(super) load: bool,
    pub(super) execute: bool,
}

/// Returns the situations of an `eval-when`.
pub(super) fn situations(form: &Form) -> Checked<Situations> {
    let shape = "needs a list of situations";
    let Some(list) = form.args.first() else { return Err(form.missing(shape)) };
    let Some(items) = list.as_list() else {
        return Err(form.malformed_at(list.span(), &format!("{shape}, not {}", quoted(list))));
    };
    let mut situations = Situations::default();
    for item in items {
        match item.as_symbol().map(Symbol::name) {
            Some("COMPILE-TOPLEVEL" | "COMPILE") => situations.compile = true,
            Some("LOAD-TOPLEVEL" | "LOAD") => situations.load = true,
            Some("EXECUTE" | "EVAL") => situations.execute = true,
            _ => {
                let what = format!(
                    "takes the situations `:compile-toplevel`, `:load-toplevel` and `:execute`, not {}",
                    quoted(item)
                );
                return Err(form.malformed_at(item.span(), &what));
            }
        }
    }
    Ok(situations)
}

/// `(eval-when (situation*) . body)` inside another form.
pub(super) fn eval_when(expander: &mut Expander, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    let situations = situations(&form)?;
    let body = if situations.execute { form.args[1..].to_vec() } else { Vec::new() };
    let jobs = expander.body(body, to);
    expander.schedule(jobs);
    Ok(())
}

/// `(declare …)` outside of the places for declarations.
pub(super) fn misplaced_declare(_: &mut Expander, _: &mut dyn Environment, form: Form, _: To) -> Checked {
    Err(form.fault(code::MISPLACED_DECLARATION, form.head(), "can only stand at the beginning of a body"))
}
