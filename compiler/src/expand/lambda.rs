//! Functions: `lambda`, `function`, `%named-lambda`, and the expansion of every function's text.

use esl_bytecode::builtin::Builtin;
use esl_bytecode::compile::Environment;
use esl_bytecode::datum::Datum;
use esl_bytecode::diagnostic::Diagnostic;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;

use super::destructure::gather_parameters;
use super::expander::Expander;
use super::form::{Checked, Form, check_distinct, is_cl_form, is_esl, operator, plain, span_of};
use super::function::{Body, FunctionParts, FunctionText, WrittenName};
use super::job::{Job, To};
use super::lambda_list::{LambdaList, LambdaListKind, OptionalSpec};
use super::origin::OriginId;
use super::scope::{FunctionMeaning, ScopeEntry, VariableMeaning, Visible};
use super::variable::VariableChange;
use crate::core::{
    BoundVariable, KeyParameter, Lambda, LambdaId, NodeId, NodeKind, OptionalParameter, Parameter,
};
use crate::diagnostic::code;

/// Number of parameters that may have registers. With more, they come as a list.
const MOST_PARAMETERS: usize = 128;

impl Expander {
    /// Checks the lambda list of a function and takes its body apart.
    pub(super) fn lambda_text(
        &mut self,
        environment: &mut dyn Environment,
        parts: FunctionParts<'_>,
        form: &Form,
        origin: Option<OriginId>,
    ) -> Checked<FunctionText> {
        let FunctionParts { name, block, list, body } = parts;
        let (name, block) = (name.cloned(), block.cloned());
        let shown = list.clone();
        let list = LambdaList::parse(list, LambdaListKind::Ordinary, form.at(list.span()))?;
        let mut names = Vec::new();
        for datum in list.variables() {
            names.push((self.variable_name(environment, datum, form, VariableChange::Bind)?, datum.span()));
        }
        check_distinct(names.iter().map(|(symbol, span)| (symbol, *span)), form)?;
        for (datum, _) in &list.aux {
            self.variable_name(environment, datum, form, VariableChange::Bind)?;
        }
        let body = self.take_body(body, true, form, origin)?;
        let text = FunctionText { name, shown, list, body, block, form: form.datum.span() };
        if names.len() > MOST_PARAMETERS {
            return gather_parameters(environment, text, form);
        }
        Ok(text)
    }

    /// Adds a lambda within that of `to`, to be filled by [`Job::Lambda`].
    pub(super) fn lambda(&mut self, to: To) -> LambdaId {
        let body = self.child(to).node;
        let lambdas = &mut self.core().lambdas;
        lambdas.push(Lambda::without_parameters(Some(to.lambda), to.span, body));
        LambdaId(lambdas.len() as u32 - 1)
    }

    /// Makes `to` the function with this text.
    pub(super) fn closure(&mut self, text: FunctionText, to: To) {
        let lambda = self.lambda(to);
        self.fill(to, NodeKind::Lambda(lambda));
        self.schedule([Job::Lambda(Box::new(text), lambda, to)]);
    }

    /// Expands the text of a function into `lambda`.
    pub(super) fn expand_lambda(
        &mut self,
        environment: &mut dyn Environment,
        text: FunctionText,
        lambda: LambdaId,
        to: To,
    ) {
        let FunctionText { name, shown, list, body, block, form } = text;
        let node = self.core().lambdas[lambda.index()].body;
        let inside = To { node, lambda, depth: to.depth + 1, is_dropped: false, ..to };
        let mut filling = Filling { body: &body, form, inside, jobs: Vec::new(), bound: Vec::new() };

        let required =
            list.required.iter().map(|datum| filling.parameter(self, environment, datum)).collect();
        let optional = list.optional.iter().map(|item| filling.optional(self, environment, item)).collect();
        let rest = list.rest.as_ref().map(|datum| filling.parameter(self, environment, datum));
        let keys = list.keys.as_ref().map(|keys| {
            let keys = keys.iter().map(|key| KeyParameter {
                key: key.key.clone(),
                optional: filling.optional(self, environment, &key.optional),
            });
            keys.collect()
        });
        let mut inner = inside;
        if !list.aux.is_empty() {
            let bindings =
                list.aux.iter().map(|(datum, value)| filling.aux(self, environment, datum, value)).collect();
            inner = self.child(inside);
            self.fill(inside, NodeKind::Let { sequential: true, bindings, body: inner.node });
        }

        let Filling { mut jobs, bound, .. } = filling;
        let mut count = bound.len();
        let mut entries = body.free_declarations(&bound);
        if let Some(block) = block {
            let id = self.block(Some(block.clone()), inner);
            let within = self.child(inner);
            self.fill(inner, NodeKind::Block(id, within.node));
            inner = within;
            entries.push(ScopeEntry::Block(block, id));
        }
        count += entries.len();
        jobs.push(Job::Enter(entries));
        jobs.extend(self.body(body.forms, inner));
        jobs.push(Job::Leave(count));
        self.schedule(jobs);

        let shown = if self.is_file && shown.has_objects() { without_objects(&shown) } else { shown };
        let filled = &mut self.core().lambdas[lambda.index()];
        *filled = Lambda {
            name,
            lambda_list: Some(shown),
            documentation: body.documentation,
            required,
            optional,
            rest,
            keys,
            allow_other_keys: list.allow_other_keys,
            ..filled.clone()
        };
    }

    /// Makes `to` the function that `(function name)` names.
    fn function_reference(
        &mut self,
        environment: &mut dyn Environment,
        function: &WrittenName,
        form: &Form,
        to: To,
    ) -> Checked {
        let kind = match self.scope.function(&function.cell, self.level()) {
            Visible::Is(FunctionMeaning::Local(variable, _)) => {
                self.note_read(variable, to);
                NodeKind::Local(variable)
            }
            Visible::Is(FunctionMeaning::Macro(_)) => return Err(no_function(form, function)),
            Visible::OutOfReach => return Err(function.out_of_reach(form)),
            Visible::No => self.global_reference(environment, function, form, to)?,
        };
        self.fill(to, kind);
        Ok(())
    }

    fn global_reference(
        &mut self,
        environment: &mut dyn Environment,
        function: &WrittenName,
        form: &Form,
        to: To,
    ) -> Checked<NodeKind> {
        function.check_callable(form)?;
        if !function.name.is_setf {
            if let Some(builtin) = Builtin::named(&function.cell) {
                return Ok(NodeKind::BuiltinRef(builtin));
            }
            if self.is_operator(&function.cell) || self.is_macro(environment, &function.cell) {
                return Err(no_function(form, function));
            }
        }
        let place = self.place_of_use(to.span, to.origin);
        self.globals.note_reference(function.name.clone(), place);
        Ok(NodeKind::FunctionRef(function.cell.clone()))
    }
}

fn no_function(form: &Form, function: &WrittenName) -> Box<Diagnostic> {
    let message = format!("expected a function, found the macro or special form {}", function.name.shown());
    let diagnostic = code::MACRO_AS_FUNCTION.at(form.at(function.datum.span()), message);
    let operator = plain(&function.name.symbol);
    Box::new(diagnostic.help(format!("write a `lambda` around it: `(lambda (…) ({operator} …))`")))
}

/// A lambda whose parameters are being filled in.
struct Filling<'a> {
    body: &'a Body,
    form: Span,
    inside: To,
    jobs: Vec<Job>,
    bound: Vec<Symbol>,
}

impl Filling<'_> {
    /// Adds a parameter, and the job that enters its name.
    fn parameter(
        &mut self,
        expander: &mut Expander,
        environment: &dyn Environment,
        datum: &Datum,
    ) -> Parameter {
        let symbol = datum.as_symbol().expect("the lambda list was checked").clone();
        let span = span_of(datum, self.inside.span);
        let variable = expander.variable(symbol.clone(), span, self.inside);
        let is_special = expander.is_special(environment, &symbol, self.body);
        let (meaning, report) = if is_special {
            (VariableMeaning::Special, None)
        } else {
            (VariableMeaning::Lexical(variable), self.report(expander, &symbol, datum))
        };
        self.jobs.push(Job::Enter(vec![ScopeEntry::Variable(symbol.clone(), meaning, report)]));
        self.bound.push(symbol);
        Parameter { variable, is_special }
    }

    fn report(&self, expander: &Expander, symbol: &Symbol, datum: &Datum) -> Option<Span> {
        if self.body.ignored.contains(symbol) {
            None
        } else {
            expander.report_unused(symbol, datum, self.form, self.inside.origin)
        }
    }

    fn optional(
        &mut self,
        expander: &mut Expander,
        environment: &dyn Environment,
        item: &OptionalSpec,
    ) -> OptionalParameter {
        let (default, job) = expander.part(item.default.clone(), self.inside);
        self.jobs.push(job);
        let parameter = self.parameter(expander, environment, &item.variable);
        let supplied = item.supplied.as_ref().map(|datum| self.parameter(expander, environment, datum));
        OptionalParameter { parameter, default, supplied }
    }

    /// Adds a binding of the sequential `let` around the body.
    fn aux(
        &mut self,
        expander: &mut Expander,
        environment: &dyn Environment,
        datum: &Datum,
        value: &Datum,
    ) -> (BoundVariable, NodeId) {
        let (node, job) = expander.part(value.clone(), self.inside);
        self.jobs.push(job);
        let parameter = self.parameter(expander, environment, datum);
        let target = match datum.as_symbol() {
            Some(symbol) if parameter.is_special => BoundVariable::Special(symbol.clone()),
            _ => BoundVariable::Lexical(parameter.variable),
        };
        (target, node)
    }
}

impl LambdaList {
    /// Returns the variables of an ordinary lambda list, without the auxiliary ones.
    fn variables(&self) -> impl Iterator<Item = &Datum> {
        let keys = self.keys.iter().flatten().map(|key| &key.optional);
        self.required
            .iter()
            .chain(
                self.optional
                    .iter()
                    .chain(keys)
                    .flat_map(|item| std::iter::once(&item.variable).chain(&item.supplied)),
            )
            .chain(&self.rest)
    }
}

/// `(function name)`, `(function (lambda …))`
pub(super) fn function(
    expander: &mut Expander,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    let shape = "takes the name of one function, or a `lambda` expression";
    form.takes(1..=1, shape)?;
    let named = &form.args[0];
    if let Some(name) = WrittenName::of(named) {
        return expander.function_reference(environment, &name, &form, to);
    }
    let is_named_lambda = operator(named)
        .is_some_and(|symbol| is_esl(symbol, "%NAMED-LAMBDA") || is_esl(symbol, "%MACRO-LAMBDA"));
    if is_cl_form(named, "LAMBDA") || is_named_lambda {
        expander.schedule([Job::Expand(named.clone(), to)]);
        return Ok(());
    }
    Err(form.not_a_name(named, shape))
}

/// `(lambda lambda-list . body)`
pub(super) fn lambda(
    expander: &mut Expander,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    form.takes(1..=usize::MAX, "needs a lambda list")?;
    let parts = FunctionParts { name: None, block: None, list: &form.args[0], body: &form.args[1..] };
    let text = expander.lambda_text(environment, parts, &form, to.origin)?;
    expander.closure(text, to);
    Ok(())
}

/// `(%named-lambda name lambda-list . body)`: a function that is shown as `name`, with a block if that names
/// a function.
pub(super) fn named_lambda(
    expander: &mut Expander,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    form.takes(2..=usize::MAX, "needs a name and a lambda list")?;
    let block = WrittenName::of(&form.args[0]).map(|name| name.block());
    let parts = FunctionParts {
        name: Some(&form.args[0]),
        block: block.as_ref(),
        list: &form.args[1],
        body: &form.args[2..],
    };
    let text = expander.lambda_text(environment, parts, &form, to.origin)?;
    expander.closure(text, to);
    Ok(())
}

/// Returns a lambda list, which is kept for people to read, without the initial forms that contain objects: a
/// file cannot hold these.
fn without_objects(list: &Datum) -> Datum {
    let mut elements = list.elements();
    let items = elements.by_ref().map(|item| match item.as_cons() {
        _ if !item.has_objects() => item.clone(),
        Some((name, _)) if !name.has_objects() => Datum::list([name.clone()], item.span()),
        _ => Datum::nil(item.span()),
    });
    let items: Vec<Datum> = items.collect();
    Datum::list_with_tail(items, elements.tail().clone(), list.span())
}
