//! Control: conditionals, blocks, tags, catches, cleanups, multiple values.

use esl_bytecode::compile::Environment;
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::symbol::Symbol;

use super::form::{Checked, Form, Make, is_constant, name, plain, quoted};
use super::machine::{Job, Machine, To};
use super::scope::{Entry, Tag, Visible};
use crate::core::{BlockId, Callee, NodeId, NodeKind, TagbodyItem, Target};
use crate::diagnostic::code;

/// `(quote datum)`
pub(super) fn quote(machine: &mut Machine, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    form.takes(1..=1, "takes one datum")?;
    machine.fill(to, NodeKind::Constant(form.args[0].clone()));
    Ok(())
}

/// `(if test then [else])`
pub(super) fn if_(machine: &mut Machine, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    form.takes(2..=3, "takes a test, a form for true, and at most one for false")?;
    let nil = Datum::nil(to.span);
    let (test, first) = machine.part(form.args[0].clone(), to);
    let then = machine.result(to);
    let otherwise = machine.result(to);
    machine.fill(to, NodeKind::If(test, then.node, otherwise.node));
    let second = Job::Expand(form.args[1].clone(), then);
    let third = Job::Expand(form.args.get(2).cloned().unwrap_or(nil), otherwise);
    machine.schedule([first, second, third]);
    Ok(())
}

/// `(progn . body)`
pub(super) fn progn(machine: &mut Machine, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    let jobs = machine.body(form.args, to);
    machine.schedule(jobs);
    Ok(())
}

/// `(the type form)`
pub(super) fn the(machine: &mut Machine, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    form.takes(2..=2, "takes a type and a form")?;
    machine.schedule([Job::Expand(form.args[1].clone(), to)]);
    Ok(())
}

/// `(and form*)`
pub(super) fn and(machine: &mut Machine, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    match form.args.len() {
        0 => machine.fill(to, NodeKind::Constant(Datum::symbol(Symbol::cl("T"), to.span))),
        1 => machine.schedule([Job::Expand(form.args[0].clone(), to)]),
        _ => {
            let (nodes, jobs) = machine.children(form.args, to);
            machine.fill(to, NodeKind::And(nodes));
            machine.schedule(jobs);
        }
    }
    Ok(())
}

/// `(or form*)`
pub(super) fn or(machine: &mut Machine, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    match form.args.len() {
        0 => machine.fill(to, NodeKind::Constant(Datum::nil(to.span))),
        1 => machine.schedule([Job::Expand(form.args[0].clone(), to)]),
        _ => {
            let (nodes, jobs) = machine.children(form.args, to);
            machine.fill(to, NodeKind::Or(nodes));
            machine.schedule(jobs);
        }
    }
    Ok(())
}

/// How many clauses of a `cond` become nested conditionals. A longer one becomes a block that its clauses leave, so
/// that the depth of nodes does not grow with the length of a form.
const NESTED_CLAUSES: usize = 100;

/// `(cond (test . body)*)`
pub(super) fn cond(machine: &mut Machine, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    let mut clauses = Vec::new();
    for clause in &form.args {
        match clause.as_list() {
            Some(parts) if !parts.is_empty() => {
                clauses.push(parts.into_iter().cloned().collect::<Vec<Datum>>());
            }
            _ => {
                return Err(
                    form.malformed_at(clause.span(), "needs clauses, each a list of a test and forms")
                );
            }
        }
    }
    if clauses.len() > NESTED_CLAUSES {
        return long_cond(machine, clauses, to);
    }
    let mut jobs = Vec::new();
    let mut at = to;
    let mut clauses = clauses.into_iter().peekable();
    while let Some(mut clause) = clauses.next() {
        let test = clause.remove(0);
        let is_true = is_constant(&test) && !test.is_nil();
        if is_true {
            if let Some(next) = clauses.peek().and_then(|next| next.first())
                && super::form::is_known(machine.written(next.span(), to.origin))
                && super::form::is_known(machine.written(test.span(), to.origin))
            {
                let message = format!("this clause is never reached: {} is always true", quoted(&test));
                let diagnostic = code::UNREACHABLE_CODE.at(next.span(), message);
                machine.report(diagnostic.also(test.span(), "this test is always true"), to.origin);
            }
            let body = if clause.is_empty() { vec![test] } else { clause };
            jobs.extend(machine.body(body, at));
            machine.schedule(jobs);
            return Ok(());
        }
        let (node, job) = machine.part(test, at);
        jobs.push(job);
        if clause.is_empty() {
            // The value of the test, one value, if it is true.
            let rest = machine.child(at);
            machine.fill(at, NodeKind::Or(vec![node, rest.node]));
            at = rest;
        } else {
            let then = machine.result(at);
            jobs.extend(machine.body(clause, then));
            let rest = machine.result(at);
            machine.fill(at, NodeKind::If(node, then.node, rest.node));
            at = rest;
        }
    }
    machine.fill(at, NodeKind::Constant(Datum::nil(to.span)));
    machine.schedule(jobs);
    Ok(())
}

fn long_cond(machine: &mut Machine, clauses: Vec<Vec<Datum>>, to: To) -> Checked {
    let block = machine.block(None, to);
    machine.core().blocks[block.index()].is_used = true;
    let row = machine.child(to);
    machine.fill(to, NodeKind::Block(block, row.node));
    let mut nodes = Vec::new();
    let mut jobs = Vec::new();
    for mut clause in clauses {
        let item = machine.child(row);
        nodes.push(item.node);
        let (test, job) = machine.part(clause.remove(0), item);
        jobs.push(job);
        if clause.is_empty() {
            // The test's one value is the value of the form: a variable keeps it until then.
            let variable = machine.variable(Symbol::cl("COND"), to.span, to);
            let chosen = machine.child(item);
            let bindings = vec![(Target::Lexical(variable), test)];
            machine.fill(item, NodeKind::Let { sequential: false, bindings, body: chosen.node });
            let again = machine.child(chosen);
            machine.read(variable, again);
            let value = leave_if(machine, block, chosen, again.node);
            machine.read(variable, value);
        } else {
            let value = leave_if(machine, block, item, test);
            jobs.extend(machine.body(clause, value));
        }
    }
    let end = machine.child(row);
    machine.fill(end, NodeKind::Constant(Datum::nil(to.span)));
    nodes.push(end.node);
    machine.fill(row, NodeKind::Progn(nodes));
    machine.schedule(jobs);
    Ok(())
}

/// Makes `to` leave `block` if `test` is true, and gives the node of the values to leave with.
fn leave_if(machine: &mut Machine, block: BlockId, to: To, test: NodeId) -> To {
    let leave = machine.child(to);
    let value = machine.child(leave);
    let nil = machine.child(to);
    machine.fill(to, NodeKind::If(test, leave.node, nil.node));
    machine.fill(leave, NodeKind::ReturnFrom(block, value.node));
    machine.fill(nil, NodeKind::Constant(Datum::nil(to.span)));
    value
}

/// The name of a block: a symbol, `NIL` too.
fn block_name(form: &Form) -> Checked<Symbol> {
    match form.args.first().map(Datum::kind) {
        Some(DatumKind::Nil) => Ok(Symbol::cl("NIL")),
        Some(DatumKind::Symbol(symbol)) => Ok(symbol.clone()),
        Some(_) => Err(form.malformed_at(form.args[0].span(), "needs the name of a block")),
        None => Err(form.malformed("needs the name of a block")),
    }
}

/// `(block name . body)`
pub(super) fn block(machine: &mut Machine, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    let name = block_name(&form)?;
    let block = machine.block(Some(name.clone()), to);
    let inside = machine.child(to);
    machine.fill(to, NodeKind::Block(block, inside.node));
    machine.scoped_body(vec![Entry::Block(name, block)], form.args[1..].to_vec(), inside);
    Ok(())
}

/// `(return-from name [value])`
pub(super) fn return_from(machine: &mut Machine, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    let name = block_name(&form)?;
    form.takes(1..=2, "takes the name of a block and at most one form")?;
    leave(machine, &form, &name, form.args.get(1), to)
}

/// `(return [value])`
pub(super) fn return_(machine: &mut Machine, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    form.takes(0..=1, "takes at most one form")?;
    leave(machine, &form, &Symbol::cl("NIL"), form.args.first(), to)
}

fn leave(machine: &mut Machine, form: &Form, block: &Symbol, value: Option<&Datum>, to: To) -> Checked {
    let id = match machine.scope.block(block, machine.level()) {
        Visible::Is(id) => id,
        Visible::OutOfReach => {
            let what =
                format!("cannot leave the block {}: this code runs when macros are expanded", name(block));
            return Err(form.malformed(&what));
        }
        Visible::No => return Err(unknown_block(machine, form, block)),
    };
    let (node, job) = machine.part(value.cloned().unwrap_or_else(|| Datum::nil(to.span)), to);
    let block = &mut machine.core().blocks[id.index()];
    block.is_used = true;
    block.is_captured |= block.owner != to.lambda;
    machine.fill(to, NodeKind::ReturnFrom(id, node));
    machine.schedule([job]);
    Ok(())
}

fn unknown_block(
    machine: &Machine,
    form: &Form,
    block: &Symbol,
) -> Box<esl_bytecode::diagnostic::Diagnostic> {
    if block.is_cl("NIL") {
        let message = format!("{} needs a loop or a `(block nil …)` around it", name(&form.operator));
        return Box::new(code::UNKNOWN_BLOCK.at(form.span, message));
    }
    let message = format!("there is no block called {} around this {}", name(block), name(&form.operator));
    let diagnostic = code::UNKNOWN_BLOCK.at(form.span, message);
    let mut around: Vec<String> = machine
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
pub(super) fn tagbody(machine: &mut Machine, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    let tagbody = machine.tagbody(to);
    let mut entries = Vec::new();
    let mut items = Vec::new();
    let mut jobs = Vec::new();
    let mut seen = rustc_hash::FxHashSet::default();
    for item in &form.args {
        match Tag::of(item) {
            Some(tag) => {
                if !seen.insert(tag.clone()) {
                    // `NIL` twice is what macros leave behind that had nothing to say.
                    if item.is_nil() {
                        continue;
                    }
                    return Err(
                        form.malformed_at(item.span(), &format!("has the tag {} twice", quoted(item)))
                    );
                }
                items.push(TagbodyItem::Tag);
                entries.push(Entry::Tag(tag, tagbody, entries.len() as u32));
            }
            None if item.as_cons().is_some() => {
                let (node, job) = machine.statement(item.clone(), to);
                items.push(TagbodyItem::Form(node));
                jobs.push(job);
            }
            None => {
                return Err(form.malformed_at(
                    item.span(),
                    &format!("has {}, which is no tag and no form", quoted(item)),
                ));
            }
        }
    }
    machine.check_reachable(&form.args, to);
    machine.fill(to, NodeKind::Tagbody(tagbody, items));
    let count = entries.len();
    machine.schedule(
        std::iter::once(Job::Enter(entries)).chain(jobs).chain([Job::Leave(count)]).collect::<Vec<_>>(),
    );
    Ok(())
}

/// `(go tag)`
pub(super) fn go(machine: &mut Machine, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    form.takes(1..=1, "takes one tag")?;
    let Some(tag) = Tag::of(&form.args[0]) else {
        return Err(form.malformed("needs a symbol or an integer as the tag"));
    };
    match machine.scope.tag(&tag, machine.level()) {
        Visible::Is((tagbody, number)) => {
            let target = &mut machine.core().tagbodies[tagbody.index()];
            target.is_captured |= target.owner != to.lambda;
            machine.fill(to, NodeKind::Go(tagbody, number));
            Ok(())
        }
        Visible::OutOfReach | Visible::No => {
            let message = format!("there is no tag {} around this `go`", quoted(&form.args[0]));
            Err(Box::new(code::UNKNOWN_TAG.at(form.span, message)))
        }
    }
}

/// `(catch tag . body)`
pub(super) fn catch(machine: &mut Machine, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    form.takes(1..=usize::MAX, "needs a form for the tag")?;
    with_body(machine, form, to, NodeKind::Catch)
}

/// `(throw tag value)`
pub(super) fn throw(machine: &mut Machine, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    form.takes(2..=2, "takes a form for the tag and one for the value")?;
    with_body(machine, form, to, NodeKind::Throw)
}

/// `(unwind-protect form . cleanup)`
pub(super) fn unwind_protect(machine: &mut Machine, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    form.takes(1..=usize::MAX, "needs a form to protect")?;
    with_body(machine, form, to, NodeKind::UnwindProtect)
}

/// `(multiple-value-prog1 form . body)`
pub(super) fn multiple_value_prog1(
    machine: &mut Machine,
    _: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    form.takes(1..=usize::MAX, "needs a form")?;
    with_body(machine, form, to, NodeKind::FirstValues)
}

/// `(%with-handlers handlers . body)`
pub(super) fn with_handlers(machine: &mut Machine, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    form.takes(1..=usize::MAX, "needs a form for the handlers")?;
    with_body(machine, form, to, NodeKind::Handlers)
}

/// `(%with-mask height . body)`
pub(super) fn with_mask(machine: &mut Machine, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    form.takes(1..=usize::MAX, "needs a form for the height")?;
    with_body(machine, form, to, NodeKind::Mask)
}

/// Makes `to` a node of one form and a body.
fn with_body(machine: &mut Machine, form: Form, to: To, kind: fn(NodeId, NodeId) -> NodeKind) -> Checked {
    let (first, job) = machine.part(form.args[0].clone(), to);
    let body = machine.child(to);
    machine.fill(to, kind(first, body.node));
    let mut jobs = vec![job];
    jobs.extend(machine.body(form.args[1..].to_vec(), body));
    machine.schedule(jobs);
    Ok(())
}

/// `(multiple-value-call function form*)`
pub(super) fn multiple_value_call(
    machine: &mut Machine,
    _: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    form.takes(1..=usize::MAX, "needs a function")?;
    let (mut nodes, jobs) = machine.children(form.args, to);
    let function = nodes.remove(0);
    machine.fill(to, NodeKind::CallValues(function, nodes));
    machine.schedule(jobs);
    Ok(())
}

/// `(multiple-value-list form)`
pub(super) fn multiple_value_list(
    machine: &mut Machine,
    _: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    form.takes(1..=1, "takes one form")?;
    let function = machine.child(to);
    machine.fill(function, NodeKind::BuiltinRef(esl_bytecode::builtin::Builtin::List));
    let (values, job) = machine.part(form.args[0].clone(), to);
    machine.fill(to, NodeKind::CallValues(function.node, vec![values]));
    machine.schedule([job]);
    Ok(())
}

/// `(multiple-value-setq (name*) form)`
pub(super) fn multiple_value_setq(
    machine: &mut Machine,
    _: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    form.takes(2..=2, "takes a list of names and a form")?;
    let Some(names) = form.args[0].as_list() else {
        return Err(form.malformed("needs a list of names"));
    };
    let make = Make(to.span);
    let places = make.cl("VALUES", names.into_iter().cloned());
    let setf = make.cl("SETF", [places, form.args[1].clone()]);
    // The value of the form is the first of its values, also when there is no name to take it.
    let values = make.cl("VALUES", [if form.args[0].is_nil() { form.args[1].clone() } else { setf }]);
    machine.schedule([Job::Expand(values, to)]);
    Ok(())
}

/// `(values form*)`
pub(super) fn values(machine: &mut Machine, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    if form.args.len() > super::call::DIRECT_ARGUMENTS {
        let list = Make(to.span).call_cl("LIST", form.args);
        let (node, job) = machine.part(list, to);
        let callee = Callee::Builtin(esl_bytecode::builtin::Builtin::ValuesList);
        machine.fill(to, NodeKind::Call(callee, vec![node]));
        machine.schedule([job]);
        return Ok(());
    }
    let mut nodes = Vec::with_capacity(form.args.len());
    let mut jobs = Vec::with_capacity(form.args.len());
    for arg in form.args {
        let value = machine.result(to);
        nodes.push(value.node);
        jobs.push(Job::Expand(arg, value));
    }
    machine.fill(to, NodeKind::Values(nodes));
    machine.schedule(jobs);
    Ok(())
}

/// `(eval-when (situation*) . body)` where it is no top-level form.
pub(super) fn eval_when(machine: &mut Machine, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    let situations = super::toplevel::situations(&form)?;
    let body = if situations.execute { form.args[1..].to_vec() } else { Vec::new() };
    let jobs = machine.body(body, to);
    machine.schedule(jobs);
    Ok(())
}

/// `(declare …)` where no declaration can be.
pub(super) fn misplaced_declare(_: &mut Machine, _: &mut dyn Environment, form: Form, _: To) -> Checked {
    Err(form.malformed("can only stand at the beginning of a body"))
}
