//! Functions: `lambda`, `function`, `%named-lambda`, and the text of every other function.

use esl_bytecode::compile::{Arity, Environment};
use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::{Symbol, setf_cell};

use super::binding::check_distinct;
use super::body::Body;
use super::form::{Checked, Form, is_cl_form, is_esl, quoted};
use super::lambda_list::{Kind, LambdaList, Optional};
use super::machine::{Job, Machine, To};
use super::scope::{Entry, Function, Variable, Visible};
use super::unit::Name;
use crate::core::{KeyParameter, Lambda, LambdaId, NodeId, NodeKind, OptionalParameter, Parameter, Target};
use crate::diagnostic::code;

/// A function as written, checked but not expanded.
#[derive(Debug)]
pub(super) struct LambdaText {
    /// Its name, for people.
    pub(super) name: Option<Datum>,
    /// The lambda list to show.
    pub(super) shown: Datum,
    /// The lambda list.
    pub(super) list: LambdaList,
    /// Declarations, documentation and forms.
    pub(super) body: Body,
    /// The name of the block around the forms.
    pub(super) block: Option<Symbol>,
    /// The form that it was written in.
    pub(super) form: Span,
}

impl LambdaText {
    /// How many arguments the function takes.
    pub(super) fn arity(&self) -> Arity {
        self.list.arity()
    }
}

impl Lambda {
    /// The function of no parameters that a top-level form is.
    pub(super) fn top_level(span: Span, body: NodeId) -> Lambda {
        Lambda {
            name: None,
            lambda_list: None,
            documentation: None,
            parent: None,
            span,
            required: Vec::new(),
            optional: Vec::new(),
            rest: None,
            keys: None,
            allow_other_keys: false,
            body,
        }
    }
}

/// The name of a function as it may be written: a symbol, or `(setf symbol)`.
#[derive(Clone, Debug)]
pub(super) struct FunctionName {
    /// The name that the unit knows it by.
    pub(super) name: Name,
    /// The symbol that keeps the function.
    pub(super) cell: Symbol,
    /// The name as written.
    pub(super) datum: Datum,
}

impl FunctionName {
    /// The name that `datum` is, if it is one.
    pub(super) fn of(datum: &Datum) -> Option<FunctionName> {
        if let Some(symbol) = datum.as_symbol() {
            return Some(FunctionName {
                name: Name::plain(symbol),
                cell: symbol.clone(),
                datum: datum.clone(),
            });
        }
        let list = datum.as_list()?;
        let [setf, symbol] = list.as_slice() else { return None };
        let symbol = symbol.as_symbol()?;
        let is_setf = setf.as_symbol().is_some_and(|setf| setf.is_cl("SETF"));
        is_setf.then(|| FunctionName {
            name: Name::setf(symbol),
            cell: setf_cell(symbol),
            datum: datum.clone(),
        })
    }

    /// The name of the block around the function's forms.
    pub(super) fn block(&self) -> Symbol {
        self.name.symbol.clone()
    }
}

/// The parts of a function as written.
#[derive(Clone, Copy, Debug)]
pub(super) struct Parts<'a> {
    /// Its name, for people.
    pub(super) name: Option<&'a Datum>,
    /// The name of the block around its forms.
    pub(super) block: Option<&'a Symbol>,
    /// The lambda list.
    pub(super) list: &'a Datum,
    /// The body.
    pub(super) body: &'a [Datum],
}

impl Machine {
    /// Checks the lambda list and takes the body of a function apart.
    pub(super) fn lambda_text(
        &mut self,
        environment: &dyn Environment,
        parts: Parts<'_>,
        form: &Form,
        origin: Option<u32>,
    ) -> Checked<LambdaText> {
        let Parts { name, block, list, body } = parts;
        let (name, block) = (name.cloned(), block.cloned());
        let shown = list.clone();
        let list = LambdaList::parse(list, Kind::Ordinary, form.at(list.span()))?;
        let mut names = Vec::new();
        for datum in list.variables() {
            names.push((self.variable_name(environment, datum, form, "bound")?, datum.span()));
        }
        check_distinct(names.iter().map(|(symbol, span)| (symbol, *span)), form)?;
        for (datum, _) in &list.aux {
            self.variable_name(environment, datum, form, "bound")?;
        }
        let body = self.take_body(body, true, form, origin)?;
        Ok(LambdaText { name, shown, list, body, block, form: form.datum.span() })
    }

    /// A fresh lambda within that of `to`, to be filled by [`Job::Lambda`].
    pub(super) fn lambda(&mut self, to: To) -> LambdaId {
        let body = self.child(to).node;
        let lambdas = &mut self.core().lambdas;
        lambdas.push(Lambda { parent: Some(to.lambda), ..Lambda::top_level(to.span, body) });
        LambdaId(lambdas.len() as u32 - 1)
    }

    /// Makes `to` the function of this text.
    pub(super) fn closure(&mut self, text: LambdaText, to: To) {
        let lambda = self.lambda(to);
        self.fill(to, NodeKind::Lambda(lambda));
        self.schedule([Job::Lambda(Box::new(text), lambda, to)]);
    }

    /// Expands the text of a function into `lambda`.
    pub(super) fn expand_lambda(
        &mut self,
        environment: &mut dyn Environment,
        text: LambdaText,
        lambda: LambdaId,
        to: To,
    ) {
        let LambdaText { name, shown, list, body, block, form } = text;
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
        let mut entries = body.free_specials(&bound);
        if let Some(block) = block {
            let id = self.block(Some(block.clone()), inner);
            let within = self.child(inner);
            self.fill(inner, NodeKind::Block(id, within.node));
            inner = within;
            entries.push(Entry::Block(block, id));
        }
        count += entries.len();
        jobs.push(Job::Enter(entries));
        jobs.extend(self.body(body.forms, inner));
        jobs.push(Job::Leave(count));
        self.schedule(jobs);

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
        function: &FunctionName,
        form: &Form,
        to: To,
    ) -> Checked {
        let kind = match self.scope.function(&function.cell, self.level()) {
            Visible::Is(Function::Local(variable, _)) => {
                self.note_read(variable, to);
                NodeKind::Local(variable)
            }
            Visible::Is(Function::Macro(_)) => return Err(is_macro(form, function)),
            Visible::OutOfReach => return Err(out_of_reach(form, function)),
            Visible::No => self.global_reference(environment, function, form, to)?,
        };
        self.fill(to, kind);
        Ok(())
    }

    fn global_reference(
        &mut self,
        environment: &mut dyn Environment,
        function: &FunctionName,
        form: &Form,
        to: To,
    ) -> Checked<NodeKind> {
        super::call::check_names_function(function, form)?;
        if !function.name.is_setf {
            if let Some(builtin) = super::call::builtin(&function.cell) {
                return Ok(NodeKind::BuiltinRef(builtin));
            }
            if super::operator::find(&function.cell).is_some() || self.is_macro(environment, &function.cell) {
                return Err(is_macro(form, function));
            }
        }
        self.unit.note_call(function.name.clone(), None, to.span, to.span);
        Ok(NodeKind::FunctionRef(function.cell.clone()))
    }
}

fn is_macro(form: &Form, function: &FunctionName) -> Box<esl_bytecode::diagnostic::Diagnostic> {
    let message = format!("{} is no function, but a macro or special form", function.name.shown());
    let diagnostic = code::MALFORMED_FORM.at(form.span, message);
    Box::new(diagnostic.help(format!(
        "write a `lambda` around it: `(lambda (…) ({} …))`",
        super::form::plain(&function.name.symbol)
    )))
}

/// The complaint about a local function that macro code wants to call.
pub(super) fn out_of_reach(
    form: &Form,
    function: &FunctionName,
) -> Box<esl_bytecode::diagnostic::Diagnostic> {
    let message =
        format!("the local function {} does not exist when macros are expanded", function.name.shown());
    Box::new(code::MALFORMED_FORM.at(form.span, message))
}

/// A lambda while its parameters are filled in.
struct Filling<'a> {
    body: &'a Body,
    form: Span,
    inside: To,
    jobs: Vec<Job>,
    bound: Vec<Symbol>,
}

impl Filling<'_> {
    /// A parameter, and the job that gives its name a meaning.
    fn parameter(
        &mut self,
        machine: &mut Machine,
        environment: &dyn Environment,
        datum: &Datum,
    ) -> Parameter {
        let symbol = datum.as_symbol().expect("the lambda list was checked").clone();
        let span = super::body::span_of(datum, self.inside.span);
        let variable = machine.variable(symbol.clone(), span, self.inside);
        let is_special = machine.is_special(environment, &symbol, self.body);
        let (meaning, report) = if is_special {
            (Variable::Special, None)
        } else {
            (Variable::Lexical(variable), self.report(machine, &symbol, datum))
        };
        self.jobs.push(Job::Enter(vec![Entry::Variable(symbol.clone(), meaning, report)]));
        self.bound.push(symbol);
        Parameter { variable, is_special }
    }

    fn report(&self, machine: &Machine, symbol: &Symbol, datum: &Datum) -> Option<Span> {
        if self.body.ignored.contains(symbol) {
            None
        } else {
            machine.report_unused(symbol, datum, self.form, self.inside.origin)
        }
    }

    fn optional(
        &mut self,
        machine: &mut Machine,
        environment: &dyn Environment,
        item: &Optional,
    ) -> OptionalParameter {
        let (default, job) = machine.part(item.default.clone(), self.inside);
        self.jobs.push(job);
        let parameter = self.parameter(machine, environment, &item.variable);
        let supplied = item.supplied.as_ref().map(|datum| self.parameter(machine, environment, datum));
        OptionalParameter { parameter, default, supplied }
    }

    /// A binding of a sequential `let` around the body.
    fn aux(
        &mut self,
        machine: &mut Machine,
        environment: &dyn Environment,
        datum: &Datum,
        value: &Datum,
    ) -> (Target, NodeId) {
        let (node, job) = machine.part(value.clone(), self.inside);
        self.jobs.push(job);
        let parameter = self.parameter(machine, environment, datum);
        let target = match datum.as_symbol() {
            Some(symbol) if parameter.is_special => Target::Special(symbol.clone()),
            _ => Target::Lexical(parameter.variable),
        };
        (target, node)
    }
}

impl LambdaList {
    /// All variables of an ordinary lambda list, but for the auxiliary ones.
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
    machine: &mut Machine,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    let [named] = form.args.as_slice() else {
        return Err(form.malformed("needs the name of one function, or a `lambda` expression"));
    };
    if let Some(name) = FunctionName::of(named) {
        return machine.function_reference(environment, &name, &form, to);
    }
    let is_named_lambda = super::form::operator(named)
        .is_some_and(|symbol| is_esl(symbol, "%NAMED-LAMBDA") || is_esl(symbol, "%MACRO-LAMBDA"));
    if is_cl_form(named, "LAMBDA") || is_named_lambda {
        machine.schedule([Job::Expand(named.clone(), to)]);
        return Ok(());
    }
    Err(form.malformed(&format!("needs the name of a function, not {}", quoted(named))))
}

/// `(lambda lambda-list . body)`
pub(super) fn lambda(
    machine: &mut Machine,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    form.takes(1..=usize::MAX, "needs a lambda list")?;
    let parts = Parts { name: None, block: None, list: &form.args[0], body: &form.args[1..] };
    let text = machine.lambda_text(environment, parts, &form, to.origin)?;
    machine.closure(text, to);
    Ok(())
}

/// `(%named-lambda name lambda-list . body)`: a function with a name to show, and a block if that names a function.
pub(super) fn named_lambda(
    machine: &mut Machine,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    form.takes(2..=usize::MAX, "needs a name and a lambda list")?;
    let block = FunctionName::of(&form.args[0]).map(|name| name.block());
    let parts = Parts {
        name: Some(&form.args[0]),
        block: block.as_ref(),
        list: &form.args[1],
        body: &form.args[2..],
    };
    let text = machine.lambda_text(environment, parts, &form, to.origin)?;
    machine.closure(text, to);
    Ok(())
}
