//! Forms that bind variables: `let`, `let*`, `multiple-value-bind`, `progv`, `symbol-macrolet`, `locally`.

use esl_bytecode::compile::{Environment, GlobalVariable};
use esl_bytecode::datum::Datum;
use esl_bytecode::symbol::Symbol;

use super::expander::Expander;
use super::form::{Checked, Form, Make, bound_twice, check_distinct, name, on_one_line, plain, quoted};
use super::function::Body;
use super::job::{Job, LetBindings, PARTS_AT_ONCE, To, UncheckedLet, VariableBinding};
use super::origin::OriginId;
use super::scope::{ScopeEntry, VariableMeaning};
use super::variable::VariableChange;
use crate::core::{BoundVariable, NodeKind};
use crate::diagnostic::code;

impl Expander {
    /// Whether a binding of `symbol` binds the special variable, given the declarations of the binding form.
    pub(super) fn is_special(&self, environment: &dyn Environment, symbol: &Symbol, body: &Body) -> bool {
        body.specials.contains(symbol)
            || matches!(environment.global(symbol).variable, GlobalVariable::Special)
    }

    /// Returns the variable that a binding of the name `datum` in `form` binds, and the entry for the name.
    fn bound_variable(
        &mut self,
        environment: &dyn Environment,
        symbol: &Symbol,
        datum: &Datum,
        body: &Body,
        form: &Form,
        to: To,
    ) -> (BoundVariable, ScopeEntry) {
        if self.is_special(environment, symbol, body) {
            return (
                BoundVariable::Special(symbol.clone()),
                ScopeEntry::Variable(symbol.clone(), VariableMeaning::Special, None),
            );
        }
        let variable = self.variable(symbol.clone(), form.at(datum.span()), to);
        let report = if body.ignored.contains(symbol) {
            None
        } else {
            self.report_unused(symbol, datum, form.datum.span(), to.origin)
        };
        (
            BoundVariable::Lexical(variable),
            ScopeEntry::Variable(symbol.clone(), VariableMeaning::Lexical(variable), report),
        )
    }
}

/// Returns the bindings of a form as they are written.
fn written_bindings(form: &Form, shape: &str) -> Checked<Vec<Datum>> {
    let Some(list) = form.args.first() else { return Err(form.missing(shape)) };
    let Some(items) = list.as_list() else {
        let what = format!("{shape}, not {}", quoted(list));
        let fault = form.fault(code::MALFORMED_BINDING, list.span(), &what);
        // `(let x 1)` and `(let x = 1)`
        let is_value = |part: &&Datum| part.as_symbol().is_none_or(|symbol| symbol.name() != "=");
        let value = form.args[1..].iter().find(is_value);
        return Err(match (list.as_symbol(), value) {
            (Some(symbol), Some(value)) => {
                let value = on_one_line(value, 20);
                Box::new(fault.help(format!(
                    "write `({} (({} {value})) …)`",
                    plain(&form.operator),
                    plain(symbol)
                )))
            }
            _ => fault,
        });
    };
    Ok(items.into_iter().cloned().collect())
}

/// Takes a binding of a form apart.
fn binding(
    expander: &Expander,
    environment: &dyn Environment,
    form: &Form,
    item: &Datum,
) -> Checked<VariableBinding> {
    let (datum, value) = match item.as_cons() {
        None => (item, None),
        Some((datum, rest)) => match rest.as_list().as_deref() {
            Some([]) => (datum, None),
            Some([value]) => (datum, Some((*value).clone())),
            _ => {
                let what = format!("needs one name and one value in each binding, not {}", quoted(item));
                let fault = form.fault(code::MALFORMED_BINDING, item.span(), &what);
                return Err(match bare_bindings(item).filter(|_| datum.as_symbol().is_some()) {
                    Some(help) => Box::new(fault.help(help)),
                    None => fault,
                });
            }
        },
    };
    if item.as_cons().is_none() && item.as_symbol().is_none() && !item.is_nil() {
        let what = format!("needs bindings of a name and a value, not {}", quoted(item));
        let fault = form.fault(code::MALFORMED_BINDING, item.span(), &what);
        let help = bare_bindings(&form.args[0]);
        return Err(help.map_or(fault.clone(), |help| Box::new(fault.help(help))));
    }
    let symbol = expander.variable_name(environment, datum, form, VariableChange::Bind)?;
    let value = value.unwrap_or_else(|| Datum::nil(form.at(datum.span())));
    Ok(VariableBinding { datum: datum.clone(), symbol, value })
}

/// Returns how bindings are written that lack the parentheses around each: `(x 1 y 2)`.
fn bare_bindings(list: &Datum) -> Option<String> {
    let parts = list.as_list()?;
    // Clojure writes `[x 1]`, and others `x = 1`.
    let plain_parts: Vec<&Datum> =
        parts.into_iter().filter(|part| part.as_symbol().is_none_or(|symbol| symbol.name() != "=")).collect();
    let is_pair = |pair: &&[&Datum]| pair.len() == 2 && pair[0].as_symbol().is_some();
    let pairs: Vec<&[&Datum]> = plain_parts.chunks(2).collect();
    if pairs.len() > 4 || !pairs.iter().all(is_pair) {
        return None;
    }
    let pairs = pairs
        .iter()
        .map(|pair| Some(format!("({} {})", plain(pair[0].as_symbol()?), on_one_line(pair[1], 20))));
    let pairs: Option<Vec<String>> = pairs.collect();
    Some(format!("each binding has parentheses of its own: write `({})`", pairs?.join(" ")))
}

/// `(let ({name | (name [value])}*) . body)`
pub(super) fn let_in_parallel(
    expander: &mut Expander,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    expand_let(expander, environment, form, to, false)
}

/// `(let* ({name | (name [value])}*) . body)`
pub(super) fn let_in_order(
    expander: &mut Expander,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    expand_let(expander, environment, form, to, true)
}

fn expand_let(
    expander: &mut Expander,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
    sequential: bool,
) -> Checked {
    let items = written_bindings(&form, "needs a list of bindings, such as `((x 1) (y 2))`")?.into_iter();
    let (found, seen) = Default::default();
    let state = UncheckedLet { form, to, sequential, items, found, seen };
    expander.check_let(environment, Box::new(state))
}

impl Expander {
    /// Goes on looking at the bindings of a `let`; after the last, binds the variables.
    pub(super) fn check_let(
        &mut self,
        environment: &dyn Environment,
        mut state: Box<UncheckedLet>,
    ) -> Checked {
        let UncheckedLet { form, sequential, items, found, seen, .. } = &mut *state;
        for item in items.by_ref().take(PARTS_AT_ONCE) {
            self.checked_parts += 1;
            let binding = binding(self, environment, form, &item)?;
            let span = binding.datum.span();
            if !*sequential && let Some(first) = seen.insert(binding.symbol.clone(), span) {
                return Err(bound_twice(&binding.symbol, (first, span), form));
            }
            found.push(binding);
        }
        if items.len() > 0 {
            self.schedule([Job::CheckLet(state)]);
            return Ok(());
        }
        let UncheckedLet { form, to, sequential, found, .. } = *state;
        let body = self.take_body(&form.args[1..], false, &form, to.origin)?;
        let found = found.into_iter();
        let (jobs, entries, variables, bound) = Default::default();
        let bindings = LetBindings { form, to, sequential, found, body, jobs, entries, variables, bound };
        self.go_on_with_let(environment, Box::new(bindings));
        Ok(())
    }

    /// Goes on with the variables of a `let`; after the last, schedules what is inside.
    pub(super) fn go_on_with_let(&mut self, environment: &dyn Environment, mut state: Box<LetBindings>) {
        let LetBindings { form, to, sequential, found, body, jobs, entries, variables, bound } = &mut *state;
        let (to, sequential) = (*to, *sequential);
        for VariableBinding { datum, symbol, value } in found.by_ref().take(PARTS_AT_ONCE) {
            let (node, job) = self.part(value, to);
            let (variable, entry) = self.bound_variable(environment, &symbol, &datum, body, form, to);
            variables.push((variable, node));
            bound.push(symbol);
            jobs.push(job);
            if sequential {
                jobs.push(Job::Enter(vec![entry]));
            } else {
                entries.push(entry);
            }
        }
        if found.len() > 0 {
            return self.schedule([Job::Let(state)]);
        }
        let LetBindings { mut body, mut jobs, mut entries, variables, bound, .. } = *state;
        let mut inside = to;
        if !variables.is_empty() {
            inside = self.result(to);
            self.fill(to, NodeKind::Let { sequential, bindings: variables, body: inside.node });
        }
        let free = body.free_declarations(&bound);
        let count = bound.len() + free.len();
        entries.extend(free);
        jobs.push(Job::Enter(entries));
        jobs.extend(self.body(std::mem::take(&mut body.forms), inside));
        jobs.push(Job::Leave(count));
        self.schedule(jobs);
    }
}

/// `(multiple-value-bind (name*) form . body)`
pub(super) fn multiple_value_bind(
    expander: &mut Expander,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    let shape = "needs a list of names and a form";
    form.takes(2..=usize::MAX, shape)?;
    let Some(items) = form.args[0].as_list() else {
        let what = format!("{shape}, not {}", quoted(&form.args[0]));
        return Err(form.fault(code::MALFORMED_BINDING, form.args[0].span(), &what));
    };
    let mut names = Vec::new();
    for item in items {
        names.push((expander.variable_name(environment, item, &form, VariableChange::Bind)?, item.clone()));
    }
    check_distinct(names.iter().map(|(symbol, datum)| (symbol, datum.span())), &form)?;
    if names.len() > MOST_VALUES {
        let names = names.into_iter().map(|(_, datum)| datum);
        let whole = bind_list_of_values(environment, &form, names);
        expander.schedule([Job::Expand(whole, to)]);
        return Ok(());
    }
    let mut body = expander.take_body(&form.args[2..], false, &form, to.origin)?;
    let (values, job) = expander.part(form.args[1].clone(), to);
    let mut variables = Vec::new();
    let mut entries = Vec::new();
    for (symbol, datum) in &names {
        let (variable, entry) = expander.bound_variable(environment, symbol, datum, &body, &form, to);
        variables.push(variable);
        entries.push(entry);
    }
    let inside = expander.result(to);
    expander.fill(to, NodeKind::BindValues(variables, values, inside.node));
    let bound: Vec<Symbol> = names.into_iter().map(|(symbol, _)| symbol).collect();
    entries.extend(body.free_declarations(&bound));
    let count = entries.len();
    let mut jobs = vec![job, Job::Enter(entries)];
    jobs.extend(expander.body(std::mem::take(&mut body.forms), inside));
    jobs.push(Job::Leave(count));
    expander.schedule(jobs);
    Ok(())
}

/// Number of values that may get registers. More are made a list.
const MOST_VALUES: usize = 128;

/// Returns the form that binds variables to the values of a list.
fn bind_list_of_values(
    environment: &mut dyn Environment,
    form: &Form,
    names: impl Iterator<Item = Datum>,
) -> Datum {
    let make = Make(form.datum.span());
    let mut rest = make.fresh(environment, "VALUES");
    let list = make.cl("FUNCTION", [make.symbol(&Symbol::cl("LIST"))]);
    let mut bindings = vec![(rest.clone(), make.cl("MULTIPLE-VALUE-CALL", [list, form.args[1].clone()]))];
    for name in names {
        let next = make.fresh(environment, "VALUES");
        bindings.push((name, make.call_cl("CAR", [rest.clone()])));
        bindings.push((next.clone(), make.call_cl("CDR", [rest])));
        rest = next;
    }
    bindings.pop();
    make.let_in_order(bindings, form.args[2..].to_vec())
}

/// `(progv symbols values . body)`
pub(super) fn progv(expander: &mut Expander, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    form.takes(2..=usize::MAX, "needs a form for the symbols and one for the values")?;
    let (symbols, first) = expander.part(form.args[0].clone(), to);
    let (values, second) = expander.part(form.args[1].clone(), to);
    let inside = expander.child(to);
    expander.fill(to, NodeKind::Progv(symbols, values, inside.node));
    let mut jobs = vec![first, second];
    jobs.extend(expander.body(form.args[2..].to_vec(), inside));
    expander.schedule(jobs);
    Ok(())
}

/// Returns the entries for the names of a `symbol-macrolet`, and its body.
pub(super) fn symbol_macros(
    expander: &mut Expander,
    environment: &dyn Environment,
    form: &Form,
    origin: Option<OriginId>,
) -> Checked<(Vec<ScopeEntry>, Body)> {
    let shape = "needs a list of names and expansions, such as `((x (car y)))`";
    let items = written_bindings(form, shape)?;
    let found: Checked<Vec<VariableBinding>> =
        items.iter().map(|item| binding(expander, environment, form, item)).collect();
    let found = found?;
    let items = form.args[0].as_list().unwrap_or_default();
    if let Some(item) = items.iter().find(|item| item.as_list().is_none_or(|parts| parts.len() != 2)) {
        let what = "needs a name and an expansion in each definition";
        return Err(form.fault(code::MALFORMED_BINDING, item.span(), what));
    }
    check_distinct(found.iter().map(|binding| (&binding.symbol, binding.datum.span())), form)?;
    let body = expander.take_body(&form.args[1..], false, form, origin)?;
    let mut entries = Vec::new();
    for VariableBinding { datum, symbol, value } in found {
        if expander.is_special(environment, &symbol, &body) {
            let what = format!("cannot give {} an expansion: it is a special variable", name(&symbol));
            return Err(form.malformed_at(datum.span(), &what));
        }
        entries.push(ScopeEntry::Variable(symbol, VariableMeaning::SymbolMacro(value), None));
    }
    entries.extend(body.free_declarations(&[]));
    Ok((entries, body))
}

/// `(symbol-macrolet ((name expansion)*) . body)`
pub(super) fn symbol_macrolet(
    expander: &mut Expander,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    let (entries, body) = symbol_macros(expander, environment, &form, to.origin)?;
    expander.scoped_body(entries, body.forms, to);
    Ok(())
}

/// `(locally . body)`
pub(super) fn locally(expander: &mut Expander, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    let body = expander.take_body(&form.args, false, &form, to.origin)?;
    expander.scoped_body(body.free_declarations(&[]), body.forms, to);
    Ok(())
}

impl Expander {
    /// Expands a body within which `entries` are in scope.
    pub(super) fn scoped_body(&mut self, entries: Vec<ScopeEntry>, forms: Vec<Datum>, to: To) {
        let count = entries.len();
        let mut jobs = vec![Job::Enter(entries)];
        jobs.extend(self.body(forms, to));
        jobs.push(Job::Leave(count));
        self.schedule(jobs);
    }
}
