//! Forms that bind variables: `let`, `let*`, `multiple-value-bind`, `progv`, `symbol-macrolet`, `locally`.

use esl_bytecode::compile::{Environment, GlobalVariable};
use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;

use super::body::Body;
use super::form::{Checked, Form, name};
use super::machine::{Job, Machine, To};
use super::scope::{Entry, Variable};
use crate::core::{NodeKind, Target};
use crate::diagnostic::code;

impl Machine {
    /// Whether binding `symbol` binds the special variable, given the declarations of the binding form.
    pub(super) fn is_special(&self, environment: &dyn Environment, symbol: &Symbol, body: &Body) -> bool {
        body.specials.contains(symbol)
            || matches!(environment.global(symbol).variable, GlobalVariable::Special)
    }

    /// What binding the name `datum` in `form` binds, and what the name means from then on.
    fn target(
        &mut self,
        environment: &dyn Environment,
        symbol: &Symbol,
        datum: &Datum,
        body: &Body,
        form: &Form,
        to: To,
    ) -> (Target, Entry) {
        if self.is_special(environment, symbol, body) {
            return (
                Target::Special(symbol.clone()),
                Entry::Variable(symbol.clone(), Variable::Special, None),
            );
        }
        let variable = self.variable(symbol.clone(), form.at(datum.span()), to);
        let report = if body.ignored.contains(symbol) {
            None
        } else {
            self.report_unused(symbol, datum, form.datum.span(), to.origin)
        };
        (Target::Lexical(variable), Entry::Variable(symbol.clone(), Variable::Lexical(variable), report))
    }
}

/// One binding of a `let`: the name as written, its symbol, and the value's form.
struct Binding {
    datum: Datum,
    symbol: Symbol,
    value: Datum,
}

fn bindings(
    machine: &Machine,
    environment: &dyn Environment,
    form: &Form,
    shape: &str,
) -> Checked<Vec<Binding>> {
    let Some(list) = form.args.first() else {
        return Err(form.malformed(shape));
    };
    let Some(items) = list.as_list() else {
        return Err(form.malformed_at(list.span(), shape));
    };
    let mut bindings = Vec::with_capacity(items.len());
    for item in items {
        let (datum, value) = match item.as_cons() {
            None => (item, None),
            Some((datum, rest)) => match rest.as_list().as_deref() {
                Some([]) => (datum, None),
                Some([value]) => (datum, Some((*value).clone())),
                _ => {
                    return Err(
                        form.malformed_at(item.span(), "needs one name and one value in each binding")
                    );
                }
            },
        };
        let symbol = machine.variable_name(environment, datum, form, "bound")?;
        let value = value.unwrap_or_else(|| Datum::nil(form.at(datum.span())));
        bindings.push(Binding { datum: datum.clone(), symbol, value });
    }
    Ok(bindings)
}

/// Refuses the same name twice.
pub(super) fn check_distinct<'a>(
    names: impl IntoIterator<Item = (&'a Symbol, Span)>,
    form: &Form,
) -> Checked {
    let mut seen = rustc_hash::FxHashMap::default();
    for (symbol, span) in names {
        if let Some(first) = seen.insert(symbol, span) {
            let message = format!("{} is bound twice", name(symbol));
            let diagnostic = code::DUPLICATE_PARAMETER.at(form.at(span), message);
            return Err(Box::new(diagnostic.also(form.at(first), "it is bound here already")));
        }
    }
    Ok(())
}

/// `(let ({name | (name [value])}*) . body)`
pub(super) fn let_in_parallel(
    m: &mut Machine,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    expand_let(m, environment, &form, to, false)
}

/// `(let* ({name | (name [value])}*) . body)`
pub(super) fn let_in_order(
    m: &mut Machine,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    expand_let(m, environment, &form, to, true)
}

fn expand_let(
    machine: &mut Machine,
    environment: &mut dyn Environment,
    form: &Form,
    to: To,
    sequential: bool,
) -> Checked {
    let found = bindings(machine, environment, form, "needs a list of bindings, such as `((x 1) (y 2))`")?;
    if !sequential {
        check_distinct(found.iter().map(|binding| (&binding.symbol, binding.datum.span())), form)?;
    }
    let mut body = machine.take_body(&form.args[1..], false, form, to.origin)?;
    let mut jobs = Vec::new();
    let mut entries = Vec::new();
    let mut targets = Vec::new();
    let mut bound = Vec::new();
    for Binding { datum, symbol, value } in found {
        let (node, job) = machine.part(value, to);
        let (target, entry) = machine.target(environment, &symbol, &datum, &body, form, to);
        targets.push((target, node));
        bound.push(symbol);
        jobs.push(job);
        if sequential {
            jobs.push(Job::Enter(vec![entry]));
        } else {
            entries.push(entry);
        }
    }
    let mut inside = to;
    if !targets.is_empty() {
        inside = machine.result(to);
        machine.fill(to, NodeKind::Let { sequential, bindings: targets, body: inside.node });
    }
    let free = body.free_specials(&bound);
    let count = bound.len() + free.len();
    entries.extend(free);
    jobs.push(Job::Enter(entries));
    jobs.extend(machine.body(std::mem::take(&mut body.forms), inside));
    jobs.push(Job::Leave(count));
    machine.schedule(jobs);
    Ok(())
}

/// `(multiple-value-bind (name*) form . body)`
pub(super) fn multiple_value_bind(
    machine: &mut Machine,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    let shape = "needs a list of names and a form";
    form.takes(2..=usize::MAX, shape)?;
    let Some(items) = form.args[0].as_list() else {
        return Err(form.malformed_at(form.args[0].span(), shape));
    };
    let mut names = Vec::new();
    for item in items {
        names.push((machine.variable_name(environment, item, &form, "bound")?, item.clone()));
    }
    check_distinct(names.iter().map(|(symbol, datum)| (symbol, datum.span())), &form)?;
    let mut body = machine.take_body(&form.args[2..], false, &form, to.origin)?;
    let (values, job) = machine.part(form.args[1].clone(), to);
    let mut targets = Vec::new();
    let mut entries = Vec::new();
    for (symbol, datum) in &names {
        let (target, entry) = machine.target(environment, symbol, datum, &body, &form, to);
        targets.push(target);
        entries.push(entry);
    }
    let inside = machine.result(to);
    machine.fill(to, NodeKind::BindValues(targets, values, inside.node));
    let bound: Vec<Symbol> = names.into_iter().map(|(symbol, _)| symbol).collect();
    entries.extend(body.free_specials(&bound));
    let count = entries.len();
    let mut jobs = vec![job, Job::Enter(entries)];
    jobs.extend(machine.body(std::mem::take(&mut body.forms), inside));
    jobs.push(Job::Leave(count));
    machine.schedule(jobs);
    Ok(())
}

/// `(progv symbols values . body)`
pub(super) fn progv(machine: &mut Machine, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    form.takes(2..=usize::MAX, "needs a form for the symbols and one for the values")?;
    let (symbols, first) = machine.part(form.args[0].clone(), to);
    let (values, second) = machine.part(form.args[1].clone(), to);
    let inside = machine.child(to);
    machine.fill(to, NodeKind::Progv(symbols, values, inside.node));
    let mut jobs = vec![first, second];
    jobs.extend(machine.body(form.args[2..].to_vec(), inside));
    machine.schedule(jobs);
    Ok(())
}

/// The entries that a `symbol-macrolet` makes, and its body.
pub(super) fn symbol_macros(
    machine: &mut Machine,
    environment: &dyn Environment,
    form: &Form,
    origin: Option<u32>,
) -> Checked<(Vec<Entry>, Body)> {
    let shape = "needs a list of names and expansions, such as `((x (car y)))`";
    let found = bindings(machine, environment, form, shape)?;
    let items = form.args[0].as_list().unwrap_or_default();
    if let Some(item) = items.iter().find(|item| item.as_list().is_none_or(|parts| parts.len() != 2)) {
        return Err(form.malformed_at(item.span(), "needs a name and an expansion in each definition"));
    }
    check_distinct(found.iter().map(|binding| (&binding.symbol, binding.datum.span())), form)?;
    let body = machine.take_body(&form.args[1..], false, form, origin)?;
    let mut entries = Vec::new();
    for Binding { datum, symbol, value } in found {
        if machine.is_special(environment, &symbol, &body) {
            let what = format!("cannot give {} an expansion: it is a special variable", name(&symbol));
            return Err(form.malformed_at(datum.span(), &what));
        }
        entries.push(Entry::Variable(symbol, Variable::SymbolMacro(value), None));
    }
    entries.extend(body.free_specials(&[]));
    Ok((entries, body))
}

/// `(symbol-macrolet ((name expansion)*) . body)`
pub(super) fn symbol_macrolet(
    machine: &mut Machine,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    let (entries, body) = symbol_macros(machine, environment, &form, to.origin)?;
    machine.scoped_body(entries, body.forms, to);
    Ok(())
}

/// `(locally . body)`
pub(super) fn locally(machine: &mut Machine, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    let body = machine.take_body(&form.args, false, &form, to.origin)?;
    machine.scoped_body(body.free_specials(&[]), body.forms, to);
    Ok(())
}

impl Machine {
    /// Expands a body in which some names have further meanings.
    pub(super) fn scoped_body(&mut self, entries: Vec<Entry>, forms: Vec<Datum>, to: To) {
        let count = entries.len();
        let mut jobs = vec![Job::Enter(entries)];
        jobs.extend(self.body(forms, to));
        jobs.push(Job::Leave(count));
        self.schedule(jobs);
    }
}
