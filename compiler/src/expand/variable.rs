//! Variables: reading them, `setq` and `psetq`.

use esl_bytecode::compile::{Environment, GlobalVariable};
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::diagnostic::Diagnostic;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;

use super::expander::Expander;
use super::form::{Checked, Form, Make, fresh, is_known, name, on_one_line, plain};
use super::global::PendingVariable;
use super::job::{Job, To};
use super::origin::{NameUsed, OriginId};
use super::scope::{ScopeEntry, VariableMeaning, Visible, global_symbol_macro};
use crate::core::NodeKind;
use crate::diagnostic::code;

/// Meaning of a name where a variable is read or set.
pub(super) enum Meaning {
    /// A variable or a symbol macro.
    Variable(VariableMeaning),
    /// A constant with this value.
    Constant(Datum),
}

/// A change of a variable by its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum VariableChange {
    /// It is bound.
    Bind,
    /// It is set.
    Set,
}

impl Expander {
    /// Returns the meaning of `symbol` as a variable.
    pub(super) fn meaning(
        &self,
        environment: &dyn Environment,
        symbol: &Symbol,
        span: Span,
    ) -> Checked<Option<Meaning>> {
        match self.scope.variable(symbol, self.level()) {
            Visible::Is(meaning) => return Ok(Some(Meaning::Variable(meaning))),
            Visible::OutOfReach => {
                let message = format!("the variable {} has no value when macros are expanded", name(symbol));
                return Err(Box::new(code::RUN_TIME_ONLY.at(span, message)));
            }
            Visible::No => {}
        }
        if symbol.is_keyword() || symbol.is_cl("T") {
            return Ok(Some(Meaning::Constant(Datum::symbol(symbol.clone(), span))));
        }
        Ok(match environment.global(symbol).variable {
            GlobalVariable::Special => Some(Meaning::Variable(VariableMeaning::Special)),
            GlobalVariable::Constant(value) => Some(Meaning::Constant(value)),
            GlobalVariable::Undefined => global_symbol_macro(environment, symbol)
                .map(|form| Meaning::Variable(VariableMeaning::SymbolMacro(form))),
        })
    }

    /// Expands a reference to a variable.
    pub(super) fn expand_variable(
        &mut self,
        environment: &mut dyn Environment,
        symbol: &Symbol,
        datum: &Datum,
        to: To,
    ) -> Checked {
        let kind = match self.meaning(environment, symbol, to.span)? {
            Some(Meaning::Variable(VariableMeaning::Lexical(variable))) => {
                self.note_read(variable, to);
                NodeKind::Local(variable)
            }
            Some(Meaning::Variable(VariableMeaning::Special)) => NodeKind::Special(symbol.clone()),
            Some(Meaning::Variable(VariableMeaning::SymbolMacro(form))) => {
                let origin = self.enter_origin(symbol, to.span, None, true, to.origin)?;
                self.schedule([Job::Expand(form, To { origin, ..to })]);
                return Ok(());
            }
            Some(Meaning::Constant(value)) => match value.kind() {
                DatumKind::Symbol(same) if same == symbol => NodeKind::Constant(datum.clone()),
                // No program can tell a copy of these from the original.
                DatumKind::Nil
                | DatumKind::Symbol(_)
                | DatumKind::Integer(_)
                | DatumKind::Ratio(..)
                | DatumKind::Float(_)
                | DatumKind::Character(_) => NodeKind::Constant(value),
                _ => NodeKind::Special(symbol.clone()),
            },
            None => {
                self.note_undefined(symbol, to.span, to);
                NodeKind::Special(symbol.clone())
            }
        };
        self.fill(to, kind);
        Ok(())
    }

    /// Checks that a name may be bound or set.
    fn check_not_constant(
        &self,
        environment: &dyn Environment,
        symbol: &Symbol,
        span: Span,
        change: VariableChange,
    ) -> Checked {
        let is_constant = symbol.is_keyword()
            || symbol.is_cl("T")
            || symbol.is_cl("NIL")
            || matches!(environment.global(symbol).variable, GlobalVariable::Constant(_));
        if is_constant {
            let change = match change {
                VariableChange::Bind => "bound",
                VariableChange::Set => "set",
            };
            let message = format!("{} is a constant and cannot be {change}", name(symbol));
            return Err(Box::new(code::ASSIGNMENT_TO_CONSTANT.at(span, message)));
        }
        Ok(())
    }

    /// Returns the name of a variable that `datum` is, if it may be bound or set.
    pub(super) fn variable_name(
        &self,
        environment: &dyn Environment,
        datum: &Datum,
        form: &Form,
        change: VariableChange,
    ) -> Checked<Symbol> {
        let symbol = match datum.kind() {
            DatumKind::Symbol(symbol) => symbol.clone(),
            DatumKind::Nil => Symbol::cl("NIL"),
            _ => return Err(form.not_a_name(datum, "needs the name of a variable here")),
        };
        let is_local = matches!(self.scope.variable(&symbol, self.level()), Visible::Is(_));
        if change == VariableChange::Bind || !is_local {
            self.check_not_constant(environment, &symbol, form.at(datum.span()), change)?;
        }
        Ok(symbol)
    }
}

impl Expander {
    /// Returns the place at which an unused variable of this name, bound by a form at `form`, is reported.
    /// `None` if a macro made one of them: variables that macros bind for their own use may be unused.
    pub(super) fn report_unused(
        &self,
        symbol: &Symbol,
        datum: &Datum,
        form: Span,
        origin: Option<OriginId>,
    ) -> Option<Span> {
        let place = self.origins.written(datum.span(), origin);
        let is_written =
            is_known(place) && is_known(self.origins.written(form, origin)) && symbol.package().is_some();
        is_written.then_some(place)
    }
}

impl Expander {
    /// Returns the place `span` of a name that is used, and the macro of the program that made the use.
    pub(super) fn place_of_use(&self, span: Span, origin: Option<OriginId>) -> NameUsed {
        let maker = origin.filter(|_| !is_known(self.origins.written(span, origin)));
        let maker = maker.map(|origin| self.origins.get(origin)).filter(|origin| !origin.is_standard);
        NameUsed { span, maker: maker.map(|origin| origin.name.clone()) }
    }

    /// Notes a use of a variable that has no definition so far.
    fn note_undefined(&mut self, symbol: &Symbol, span: Span, to: To) {
        let is_entry = |entry: &ScopeEntry| matches!(entry, ScopeEntry::Variable(name, ..) if name == symbol);
        // The names of a `let` come into scope after all its values.
        let is_bound_later =
            self.jobs.iter().any(|job| matches!(job, Job::Enter(entries) if entries.iter().any(is_entry)));
        let mut place = self.place_of_use(span, to.origin);
        // A symbol that a macro has passed on has lost its place.
        if let Some(origin) = to.origin.filter(|_| !is_known(self.origins.written(span, to.origin)))
            && let Some(written) = self.origins.place_of(symbol, span, origin)
        {
            place = NameUsed { span: written, maker: None };
        }
        self.globals.note_variable(PendingVariable { symbol: symbol.clone(), place, is_bound_later });
    }
}

/// The error for a form of pairs whose last part has no value.
pub(super) fn value_missing(form: &Form) -> Box<Diagnostic> {
    let span = form.args.last().map_or(form.head(), |last| form.at(last.span()));
    let fault = form.fault(code::MISSING_PART, span, "needs a value after this");
    match form.args.as_slice() {
        [place, equals, value] if equals.as_symbol().is_some_and(|symbol| symbol.name() == "=") => {
            let (place, value) = (on_one_line(place, 20), on_one_line(value, 20));
            Box::new(fault.help(format!("write `({} {place} {value})`", plain(&form.operator))))
        }
        _ => fault,
    }
}

/// `(setq {name form}*)`
pub(super) fn setq(
    expander: &mut Expander,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    if form.args.len() % 2 == 1 {
        return Err(value_missing(&form));
    }
    if form.args.len() != 2 {
        let make = Make(to.span);
        let pairs = form.args.chunks(2).map(|pair| make.cl("SETQ", pair.iter().cloned()));
        let pairs: Vec<Datum> = pairs.collect();
        let jobs = expander.body(pairs, to);
        expander.schedule(jobs);
        return Ok(());
    }
    let symbol = expander.variable_name(environment, &form.args[0], &form, VariableChange::Set)?;
    let meaning = expander.meaning(environment, &symbol, to.span)?;
    if let Some(Meaning::Variable(VariableMeaning::SymbolMacro(_))) = meaning {
        let setf = Make(to.span).cl("SETF", form.args);
        expander.schedule([Job::Expand(setf, to)]);
        return Ok(());
    }
    let (value, job) = expander.part(form.args[1].clone(), to);
    match meaning {
        Some(Meaning::Variable(VariableMeaning::Lexical(variable))) => {
            expander.note_assigned(variable, to);
            expander.fill(to, NodeKind::SetLocal(variable, value));
        }
        meaning => {
            if meaning.is_none() {
                expander.note_undefined(&symbol, form.at(form.args[0].span()), to);
            }
            expander.fill(to, NodeKind::SetSpecial(symbol, value));
        }
    }
    expander.schedule([job]);
    Ok(())
}

/// `(psetq {name form}*)`: all values before the first assignment.
pub(super) fn psetq(
    expander: &mut Expander,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    if form.args.len() % 2 == 1 {
        return Err(value_missing(&form));
    }
    let make = Make(to.span);
    let mut names = Vec::new();
    for pair in form.args.chunks(2) {
        let symbol = expander.variable_name(environment, &pair[0], &form, VariableChange::Set)?;
        if let Some(Meaning::Variable(VariableMeaning::SymbolMacro(_))) =
            expander.meaning(environment, &symbol, to.span)?
        {
            let psetf = make.cl("PSETF", form.args);
            expander.schedule([Job::Expand(psetf, to)]);
            return Ok(());
        }
        names.push(symbol);
    }
    let Some(last) = names.len().checked_sub(1) else {
        expander.fill(to, NodeKind::Constant(make.nil()));
        return Ok(());
    };
    // The last variable can take its value at once, since all other values are computed by then; except if it
    // is named twice, because the later assignment has to prevail.
    let direct = !names[..last].contains(&names[last]);
    let mut bindings = Vec::new();
    let mut body = Vec::new();
    if direct {
        body.push(make.cl("SETQ", [form.args[2 * last].clone(), form.args[2 * last + 1].clone()]));
    }
    for (index, pair) in form.args.chunks(2).enumerate() {
        if direct && index == last {
            continue;
        }
        let new = Datum::symbol(fresh(environment, "NEW"), to.span);
        bindings.push((new.clone(), pair[1].clone()));
        body.push(make.cl("SETQ", [pair[0].clone(), new]));
    }
    body.push(make.nil());
    expander.schedule([Job::Expand(make.let_in_order(bindings, body), to)]);
    Ok(())
}
