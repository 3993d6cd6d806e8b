//! Places: what `setf` and its relatives can set.
//!
//! [`Job::Place`] finds the setf expansion of one place, expanding macros as needed, and puts it on the
//! expander's list of places; [`super::modify`] makes forms of them.
//!
//! How a call `(f …)` is set is looked up in this order: local functions and macros; the forms of
//! [`super::standard_place`]; accessors of structures; the property `%setf` of `f`, which `defsetf` and its
//! like record; a builtin `%set-f` that takes the new value last; a macro `f`; and last the function
//! `(setf f)`, which takes the new value first.

use esl_bytecode::builtin::Builtin;
use esl_bytecode::compile::{Accessor, Environment, GlobalFunction, MacroRef, SlotAccess};
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::diagnostic::Diagnostic;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::{CL_PACKAGE, ESL_PACKAGE, Symbol};

use super::expander::Expander;
use super::form::{Checked, Form, Make, is_constant, name, quoted};
use super::function::WrittenName;
use super::job::{AwaitedOutcome, Job, To};
use super::scope::{FunctionMeaning, VariableMeaning, Visible};
use super::setf::{PlaceWriter, SetfExpansion};
use super::variable::Meaning;
use crate::diagnostic::code;

impl Expander {
    /// Finds the five parts of a place.
    pub(super) fn find_place(&mut self, environment: &mut dyn Environment, datum: Datum, to: To) -> Checked {
        match datum.kind() {
            DatumKind::Symbol(symbol) => {
                let symbol = symbol.clone();
                self.variable_place(environment, &symbol, datum, to)
            }
            DatumKind::Nil => {
                let message = "`nil` is a constant and cannot be set";
                Err(Box::new(code::ASSIGNMENT_TO_CONSTANT.at(to.span, message)))
            }
            DatumKind::Cons(head, _) if head.as_symbol().is_some() => {
                let form = Form::of(&datum, to.span)?;
                match self.scope.function(&form.operator, self.level()) {
                    Visible::Is(FunctionMeaning::Local(..)) => {
                        self.function_place(environment, form, to);
                        Ok(())
                    }
                    Visible::Is(FunctionMeaning::Macro(Some(function))) => {
                        self.stop_for_place(MacroRef::Local(function), &form, false, to)
                    }
                    Visible::Is(FunctionMeaning::Macro(None)) => {
                        self.places.push(SetfExpansion::broken(to.span));
                        Ok(())
                    }
                    Visible::OutOfReach => {
                        let named = Make(form.head()).symbol(&form.operator);
                        Err(WrittenName::symbol(&form.operator, named).out_of_reach(&form))
                    }
                    Visible::No => self.global_place(environment, form, to),
                }
            }
            _ => Err(no_place(&datum, to.span)),
        }
    }

    fn variable_place(
        &mut self,
        environment: &mut dyn Environment,
        symbol: &Symbol,
        datum: Datum,
        to: To,
    ) -> Checked {
        let make = Make(to.span);
        match self.meaning(environment, symbol, to.span)? {
            Some(Meaning::Variable(VariableMeaning::SymbolMacro(form))) => {
                let origin = self.enter_origin(symbol, to.span, None, true, to.origin)?;
                self.schedule([Job::Place(form, To { origin, ..to })]);
            }
            Some(Meaning::Constant(_)) => {
                let message = format!("{} is a constant and cannot be set", name(symbol));
                return Err(Box::new(code::ASSIGNMENT_TO_CONSTANT.at(to.span, message)));
            }
            Some(Meaning::Variable(_)) | None => {
                let store = make.fresh(environment, "NEW");
                let before = vec![make.symbol(&Symbol::cl("SETQ")), datum.clone()];
                let place =
                    SetfExpansion::new(make, vec![store], PlaceWriter::Call(before, Vec::new()), datum);
                self.places.push(SetfExpansion { is_direct: true, ..place });
            }
        }
        Ok(())
    }

    fn global_place(&mut self, environment: &mut dyn Environment, form: Form, to: To) -> Checked {
        let make = Make(to.span);
        if form.operator.is_in(CL_PACKAGE)
            && let Some(outcome) = self.standard_place(environment, &form, to)
        {
            return outcome;
        }
        let global = environment.global(&form.operator);
        if let (Some(accessor), 1) = (&global.accessor, form.args.len()) {
            return self.slot_place(environment, accessor, form, to);
        }
        match update_of(environment, &form.operator) {
            Some(Update::Function(update)) => {
                let prefix = vec![make.symbol(&Symbol::esl("%CALL-GLOBAL")), make.symbol(&update)];
                self.update_place(environment, prefix, form, usize::MAX, to);
            }
            Some(Update::Operator(update)) => {
                self.update_place(environment, vec![make.symbol(&update)], form, usize::MAX, to);
            }
            Some(Update::Macro(expander, count)) => {
                let (temporaries, args) = arguments(environment, &form.args, make);
                let stores: Vec<Datum> = (0..count).map(|_| make.fresh(environment, "NEW")).collect();
                let call = [make.symbol(&expander), make.items(stores.iter().cloned())];
                let writer = PlaceWriter::Form(make.items(call.into_iter().chain(args.iter().cloned())));
                let place = SetfExpansion::new(make, stores, writer, reader(&form, args, make));
                self.places.push(SetfExpansion { temporaries, ..place });
            }
            Some(Update::Expander(expander)) => {
                let place = form.datum.clone();
                let waiting = |origin| AwaitedOutcome::SetfExpansion(place, To { origin, ..to });
                return self.stop_for_macro(MacroRef::Global(expander), &form, true, to.origin, waiting);
            }
            None if self.is_operator(&form.operator) => {
                return Err(no_place(&form.datum, to.span));
            }
            None if self.globals.is_broken_macro(&form.operator) => {
                self.places.push(SetfExpansion::broken(to.span))
            }
            None if self.is_macro(environment, &form.operator) => {
                let function = MacroRef::Global(form.operator.clone());
                return self.stop_for_place(function, &form, global.locked, to);
            }
            None => self.function_place(environment, form, to),
        }
        Ok(())
    }

    /// Stops for the expansion of a macro call that stands for a place.
    fn stop_for_place(&mut self, function: MacroRef, form: &Form, is_standard: bool, to: To) -> Checked {
        let waiting = |origin| AwaitedOutcome::Place(To { origin, ..to });
        self.stop_for_macro(function, form, is_standard, to.origin, waiting)
    }

    /// Adds a place that the function `(setf f)` sets.
    fn function_place(&mut self, environment: &mut dyn Environment, form: Form, to: To) {
        let make = Make(to.span);
        let (temporaries, args) = arguments(environment, &form.args, make);
        let setter = make.cl("SETF", [make.symbol(&form.operator)]);
        let before = vec![make.symbol(&Symbol::cl("FUNCALL")), make.cl("FUNCTION", [setter])];
        let store = make.fresh(environment, "NEW");
        let reader = reader(&form, args.clone(), make);
        let place = SetfExpansion::new(make, vec![store], PlaceWriter::Call(before, args), reader);
        self.places.push(SetfExpansion { temporaries, ..place });
    }

    /// Adds a place that the form `(prefix… argument… value)` sets, which takes only the first `taken`
    /// arguments.
    pub(super) fn update_place(
        &mut self,
        environment: &mut dyn Environment,
        prefix: Vec<Datum>,
        form: Form,
        taken: usize,
        to: To,
    ) {
        let make = Make(to.span);
        let (temporaries, args) = arguments(environment, &form.args, make);
        let before = prefix.into_iter().chain(args.iter().take(taken).cloned()).collect();
        let store = make.fresh(environment, "NEW");
        let is_direct = args.len() <= taken;
        let place = SetfExpansion::new(
            make,
            vec![store],
            PlaceWriter::Call(before, Vec::new()),
            reader(&form, args, make),
        );
        self.places.push(SetfExpansion { temporaries, is_direct, ..place });
    }

    fn slot_place(
        &mut self,
        environment: &mut dyn Environment,
        accessor: &Accessor,
        form: Form,
        to: To,
    ) -> Checked {
        if accessor.access == SlotAccess::ReadOnly {
            let message =
                format!("the slot that {} reads is read-only and cannot be set", name(&form.operator));
            return Err(Box::new(code::READ_ONLY_SLOT.at(form.head(), message)));
        }
        let make = Make(to.span);
        let prefix = match accessor.access {
            SlotAccess::Checked => {
                vec![make.symbol(&Symbol::esl("%SET-CHECKED-SLOT")), make.symbol(&form.operator)]
            }
            _ => vec![
                make.symbol(&Symbol::esl("%CALL-GLOBAL")),
                make.symbol(&Symbol::esl("%SET-SLOT")),
                make.quote(make.symbol(&accessor.class)),
                Datum::integer(accessor.slot, to.span),
            ],
        };
        self.update_place(environment, prefix, form, usize::MAX, to);
        Ok(())
    }

    /// Takes the newest place.
    pub(super) fn take_place(&mut self) -> SetfExpansion {
        self.places.pop().expect("a place was found for each use")
    }

    /// Takes the newest `count` places, in the order in which they were found.
    pub(super) fn take_places(&mut self, count: usize) -> Vec<SetfExpansion> {
        self.places.split_off(self.places.len() - count)
    }
}

/// Returns variables bound to the subforms of a place that are not constant, and the subforms with these
/// variables in their place.
pub(super) fn arguments(
    environment: &mut dyn Environment,
    args: &[Datum],
    make: Make,
) -> (Vec<(Datum, Datum)>, Vec<Datum>) {
    let mut temporaries = Vec::new();
    let mut names = Vec::new();
    for arg in args {
        if is_constant(arg) {
            names.push(arg.clone());
        } else {
            let name = make.fresh(environment, "PART");
            temporaries.push((name.clone(), arg.clone()));
            names.push(name);
        }
    }
    (temporaries, names)
}

/// Returns the form that reads the place: its own operator with the temporaries as arguments.
pub(super) fn reader(form: &Form, args: Vec<Datum>, make: Make) -> Datum {
    make.items(std::iter::once(make.symbol(&form.operator)).chain(args))
}

/// How a place is set, according to the library.
pub(super) enum Update {
    /// By a global function that takes the new value last.
    Function(Symbol),
    /// By a macro that takes the new value last.
    Operator(Symbol),
    /// By the form `(macro (store…) argument…)`, with this number of stores.
    Macro(Symbol, usize),
    /// By the five parts that this macro returns as a list.
    Expander(Symbol),
}

/// Returns how the place `(symbol …)` is set, if the library or a builtin says so.
pub(super) fn update_of(environment: &dyn Environment, symbol: &Symbol) -> Option<Update> {
    if let Some(recorded) = environment.property(symbol, &Symbol::esl("%SETF")) {
        if let Some(update) = recorded.as_symbol() {
            let is_macro = environment.global(update).function == GlobalFunction::Macro;
            let update = update.clone();
            return Some(if is_macro { Update::Operator(update) } else { Update::Function(update) });
        }
        let parts = recorded.as_list().unwrap_or_default();
        if let [first, second] = parts.as_slice() {
            match (first.as_symbol(), second.kind()) {
                (Some(expander), DatumKind::Integer(count)) => {
                    let count = usize::try_from(count).ok().filter(|count| (1..=100).contains(count))?;
                    return Some(Update::Macro(expander.clone(), count));
                }
                (Some(keyword), DatumKind::Symbol(expander)) if keyword.is_keyword() => {
                    return Some(Update::Expander(expander.clone()));
                }
                _ => {}
            }
        }
    }
    let update = Symbol::esl(&format!("%SET-{}", symbol.name()));
    let is_standard = symbol.is_in(CL_PACKAGE) || symbol.is_in(ESL_PACKAGE);
    (is_standard && Builtin::named(&update).is_some()).then_some(Update::Function(update))
}

/// Returns the error about a form that is used as a place.
pub(super) fn no_place(datum: &Datum, span: Span) -> Box<Diagnostic> {
    let message = format!("expected a place that can be set, found {}", quoted(datum));
    let help = "a place is a variable or a call of an accessor, such as `(car x)`";
    Box::new(code::NOT_A_PLACE.at(span, message).help(help))
}
