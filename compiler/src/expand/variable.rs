//! Variables: reading them, `setq` and `psetq`.

use esl_bytecode::compile::{Environment, GlobalVariable};
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;

use super::form::{Checked, Form, Make, fresh, is_known, name};
use super::machine::{Job, Machine, To};
use super::scope::{Variable, Visible};
use crate::core::NodeKind;
use crate::diagnostic::code;

/// What a name stands for where a variable is read or set.
pub(super) enum Meaning {
    /// A lexical or special variable.
    Variable(Variable),
    /// A constant.
    Constant(Datum),
}

impl Machine {
    /// What `symbol` means as a variable.
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
                return Err(Box::new(code::MALFORMED_FORM.at(span, message)));
            }
            Visible::No => {}
        }
        if symbol.is_keyword() || symbol.is_cl("T") {
            return Ok(Some(Meaning::Constant(Datum::symbol(symbol.clone(), span))));
        }
        Ok(match environment.global(symbol).variable {
            GlobalVariable::Special => Some(Meaning::Variable(Variable::Special)),
            GlobalVariable::Constant(value) => Some(Meaning::Constant(value)),
            GlobalVariable::Undefined => environment
                .property(symbol, &Symbol::esl("%SYMBOL-MACRO"))
                .map(|form| Meaning::Variable(Variable::SymbolMacro(form))),
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
            Some(Meaning::Variable(Variable::Lexical(variable))) => {
                self.note_read(variable, to);
                NodeKind::Local(variable)
            }
            Some(Meaning::Variable(Variable::Special)) => NodeKind::Special(symbol.clone()),
            Some(Meaning::Variable(Variable::SymbolMacro(form))) => {
                let origin = self.origin(symbol, to.span, true, to.origin)?;
                self.schedule([Job::Expand(form, To { origin, ..to })]);
                return Ok(());
            }
            Some(Meaning::Constant(value)) => match value.kind() {
                DatumKind::Symbol(same) if same == symbol => NodeKind::Constant(datum.clone()),
                // A copy of these cannot be told from the original.
                DatumKind::Nil
                | DatumKind::Symbol(_)
                | DatumKind::Integer(_)
                | DatumKind::Ratio(..)
                | DatumKind::Float(_)
                | DatumKind::Character(_) => NodeKind::Constant(value),
                _ => NodeKind::Special(symbol.clone()),
            },
            None => {
                self.unit.note_variable(symbol, to.span);
                NodeKind::Special(symbol.clone())
            }
        };
        self.fill(to, kind);
        Ok(())
    }

    /// Checks that a name may be bound or set.
    pub(super) fn check_not_constant(
        &self,
        environment: &dyn Environment,
        symbol: &Symbol,
        span: Span,
        deed: &str,
    ) -> Checked {
        let is_constant = symbol.is_keyword()
            || symbol.is_cl("T")
            || symbol.is_cl("NIL")
            || matches!(environment.global(symbol).variable, GlobalVariable::Constant(_));
        if is_constant {
            let message = format!("{} is a constant and cannot be {deed}", name(symbol));
            return Err(Box::new(code::ASSIGNMENT_TO_CONSTANT.at(span, message)));
        }
        Ok(())
    }

    /// Checks that `datum` names a variable that may be bound or set.
    pub(super) fn variable_name(
        &self,
        environment: &dyn Environment,
        datum: &Datum,
        form: &Form,
        deed: &str,
    ) -> Checked<Symbol> {
        let symbol = match datum.kind() {
            DatumKind::Symbol(symbol) => symbol.clone(),
            DatumKind::Nil => Symbol::cl("NIL"),
            _ => {
                let what = format!("needs the name of a variable here, not {}", super::form::quoted(datum));
                return Err(form.malformed_at(datum.span(), &what));
            }
        };
        let is_local = matches!(self.scope.variable(&symbol, self.level()), Visible::Is(_));
        if deed != "set" || !is_local {
            self.check_not_constant(environment, &symbol, form.at(datum.span()), deed)?;
        }
        Ok(symbol)
    }
}

impl Machine {
    /// Where an unused variable of this name, bound by a form at `form`, is to be reported, if at all: only if both were
    /// written in the source. What macros bind for their own use is their own matter.
    pub(super) fn report_unused(
        &self,
        symbol: &Symbol,
        datum: &Datum,
        form: Span,
        origin: Option<u32>,
    ) -> Option<Span> {
        let place = self.written(datum.span(), origin);
        let is_written =
            is_known(place) && is_known(self.written(form, origin)) && symbol.package().is_some();
        is_written.then_some(place)
    }
}

/// `(setq {name form}*)`
pub(super) fn setq(machine: &mut Machine, environment: &mut dyn Environment, form: Form, to: To) -> Checked {
    if form.args.len() % 2 == 1 {
        return Err(form.malformed("needs a value for each variable"));
    }
    if form.args.len() != 2 {
        let make = Make(to.span);
        let pairs = form.args.chunks(2).map(|pair| make.cl("SETQ", pair.iter().cloned()));
        let pairs: Vec<Datum> = pairs.collect();
        let jobs = machine.body(pairs, to);
        machine.schedule(jobs);
        return Ok(());
    }
    let symbol = machine.variable_name(environment, &form.args[0], &form, "set")?;
    let meaning = machine.meaning(environment, &symbol, to.span)?;
    if let Some(Meaning::Variable(Variable::SymbolMacro(_))) = meaning {
        let setf = Make(to.span).cl("SETF", form.args);
        machine.schedule([Job::Expand(setf, to)]);
        return Ok(());
    }
    let (value, job) = machine.part(form.args[1].clone(), to);
    match meaning {
        Some(Meaning::Variable(Variable::Lexical(variable))) => {
            machine.note_assigned(variable, to);
            machine.fill(to, NodeKind::SetLocal(variable, value));
        }
        meaning => {
            if meaning.is_none() {
                machine.unit.note_variable(&symbol, form.at(form.args[0].span()));
            }
            machine.fill(to, NodeKind::SetSpecial(symbol, value));
        }
    }
    machine.schedule([job]);
    Ok(())
}

/// `(psetq {name form}*)`: all values before the first assignment.
pub(super) fn psetq(machine: &mut Machine, environment: &mut dyn Environment, form: Form, to: To) -> Checked {
    if form.args.len() % 2 == 1 {
        return Err(form.malformed("needs a value for each variable"));
    }
    let make = Make(to.span);
    let mut names = Vec::new();
    for pair in form.args.chunks(2) {
        let symbol = machine.variable_name(environment, &pair[0], &form, "set")?;
        if let Some(Meaning::Variable(Variable::SymbolMacro(_))) =
            machine.meaning(environment, &symbol, to.span)?
        {
            let psetf = make.cl("PSETF", form.args);
            machine.schedule([Job::Expand(psetf, to)]);
            return Ok(());
        }
        names.push(symbol);
    }
    let Some(last) = names.len().checked_sub(1) else {
        machine.fill(to, NodeKind::Constant(make.nil()));
        return Ok(());
    };
    // The last variable can take its value at once, since all other values are computed by then; unless it is named
    // twice, when the later assignment is the one to stay.
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
    machine.schedule([Job::Expand(make.let_in_order(bindings, body), to)]);
    Ok(())
}
