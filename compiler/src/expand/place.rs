//! Places: what `setf` and its relatives can set.
//!
//! A place is found as five parts, of which all these forms are made: variables and the forms they are bound to (the
//! subforms of the place, evaluated once and in order), variables for the new values, a form that stores them, and a
//! form that reads the old value. [`Job::Place`] finds the parts of one place, expanding macros as needed, and leaves
//! them on the machine's list of places; [`super::modify`] makes forms of them.
//!
//! How a call `(f …)` is set is looked for in this order: local functions and macros; the forms of [`super::standard_place`];
//! accessors of structures; the property `%setf` of `f`, which `defsetf` and its like record; a builtin `%set-f` that
//! takes the new value last; a macro `f`; and at last the function `(setf f)`, which takes the new value first.

use esl_bytecode::compile::{Accessor, Environment, GlobalFunction, MacroRef};
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::diagnostic::Diagnostic;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::{CL_PACKAGE, Symbol};

use super::form::{Checked, Form, Make, is_constant, name, quoted};
use super::lambda::{FunctionName, out_of_reach};
use super::machine::{Job, Machine, To};
use super::scope::{Function, Variable, Visible};
use super::variable::Meaning;
use crate::diagnostic::code;

/// How the new value is stored.
#[derive(Clone, Debug)]
pub(super) enum Writer {
    /// By the form `(before… value after…)`.
    Call(Vec<Datum>, Vec<Datum>),
    /// By this form, within which the variables for the new values are bound.
    Form(Datum),
}

/// The five parts of a place.
#[derive(Clone, Debug)]
pub(super) struct Place {
    /// Variables and the subforms that they are bound to, in order.
    pub(super) temporaries: Vec<(Datum, Datum)>,
    /// Variables for the new values.
    pub(super) stores: Vec<Datum>,
    pub(super) writer: Writer,
    /// The form that reads the old value.
    pub(super) reader: Datum,
    /// Whether the writer takes the temporaries in order and the value after them.
    pub(super) is_direct: bool,
    /// Whether something was wrong with it, which has been reported.
    pub(super) is_broken: bool,
    pub(super) make: Make,
}

impl Place {
    /// Stands for a place with which something is wrong.
    pub(super) fn broken(span: Span) -> Place {
        let make = Make(span);
        Place {
            temporaries: Vec::new(),
            stores: Vec::new(),
            writer: Writer::Form(make.nil()),
            reader: make.nil(),
            is_direct: false,
            is_broken: true,
            make,
        }
    }

    pub(super) fn new(make: Make, stores: Vec<Datum>, writer: Writer, reader: Datum) -> Place {
        Place { temporaries: Vec::new(), stores, writer, reader, is_direct: false, is_broken: false, make }
    }

    /// The five values that a `define-setf-expander` has given for `place`.
    pub(super) fn from_values(place: &Datum, values: &Datum, span: Span) -> Checked<Place> {
        let wrong = || {
            let message = format!(
                "the expander of {} must give five values: variables, forms, stores, writer, reader",
                quoted(place)
            );
            Box::new(code::MACRO_FAILED.at(span, message))
        };
        let parts = values.as_list().ok_or_else(wrong)?;
        let [variables, forms, stores, writer, reader] = parts.as_slice() else { return Err(wrong()) };
        let (variables, forms) = (variables.as_list().ok_or_else(wrong)?, forms.as_list().ok_or_else(wrong)?);
        let stores: Vec<Datum> = stores.as_list().ok_or_else(wrong)?.into_iter().cloned().collect();
        if variables.len() != forms.len() || stores.is_empty() {
            return Err(wrong());
        }
        let mut found = Place::new(Make(span), stores, Writer::Form((*writer).clone()), (*reader).clone());
        found.temporaries = variables.into_iter().cloned().zip(forms.into_iter().cloned()).collect();
        Ok(found)
    }

    /// The five parts, as a list: variables, forms, stores, writer, reader.
    pub(super) fn parts(&self) -> Datum {
        let make = self.make;
        make.list([
            make.items(self.temporaries.iter().map(|(variable, _)| variable.clone())),
            make.items(self.temporaries.iter().map(|(_, form)| form.clone())),
            make.items(self.stores.iter().cloned()),
            self.write_stores(),
            self.reader.clone(),
        ])
    }

    /// Whether this is a variable: reading it has no effect, and nothing has to be bound for it.
    pub(super) fn is_variable(&self) -> bool {
        self.temporaries.is_empty() && self.reader.as_symbol().is_some()
    }

    /// The form that stores the values of `value`, where the temporaries are bound.
    pub(super) fn write(&self, value: Datum) -> Datum {
        let make = self.make;
        match (&self.writer, self.stores.as_slice()) {
            (Writer::Call(before, after), _) => {
                make.items(before.iter().cloned().chain([value]).chain(after.iter().cloned()))
            }
            (Writer::Form(form), [store]) => {
                make.let_in_order(vec![(store.clone(), value)], vec![form.clone()])
            }
            (Writer::Form(form), stores) => {
                make.cl("MULTIPLE-VALUE-BIND", [make.items(stores.iter().cloned()), value, form.clone()])
            }
        }
    }

    /// The form that stores values already bound to the variables for them.
    pub(super) fn write_stores(&self) -> Datum {
        match (&self.writer, self.stores.first()) {
            (Writer::Call(..), Some(store)) => self.write(store.clone()),
            (Writer::Form(form), _) => form.clone(),
            (Writer::Call(..), None) => self.make.nil(),
        }
    }

    /// The form that stores `value`, all by itself.
    pub(super) fn set(&self, value: Datum) -> Datum {
        if let (true, Writer::Call(before, _)) = (self.is_direct, &self.writer) {
            // Subforms and value are evaluated in the right order as arguments: nothing has to be bound.
            let inlined = before.iter().map(|item| {
                let temporary = self.temporaries.iter().find(|(name, _)| name.is_same(item));
                temporary.map_or_else(|| item.clone(), |(_, form)| form.clone())
            });
            return self.make.items(inlined.chain([value]));
        }
        self.make.let_in_order(self.temporaries.clone(), vec![self.write(value)])
    }
}

impl Machine {
    /// Finds the five parts of a place.
    pub(super) fn find_place(&mut self, environment: &mut dyn Environment, datum: Datum, to: To) -> Checked {
        let make = Make(to.span);
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
                    Visible::Is(Function::Local(..)) => {
                        self.function_place(environment, form, to);
                        Ok(())
                    }
                    Visible::Is(Function::Macro(Some(function))) => {
                        self.stop_for_place(MacroRef::Local(function), &form, false, to)
                    }
                    Visible::Is(Function::Macro(None)) => {
                        self.places.push(Place::broken(to.span));
                        Ok(())
                    }
                    Visible::OutOfReach => {
                        let function = FunctionName::of(&make.symbol(&form.operator));
                        Err(out_of_reach(&form, &function.expect("a symbol names a function")))
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
            Some(Meaning::Variable(Variable::SymbolMacro(form))) => {
                let origin = self.origin(symbol, to.span, true, to.origin)?;
                self.schedule([Job::Place(form, To { origin, ..to })]);
            }
            Some(Meaning::Constant(_)) => {
                let message = format!("{} is a constant and cannot be set", name(symbol));
                return Err(Box::new(code::ASSIGNMENT_TO_CONSTANT.at(to.span, message)));
            }
            Some(Meaning::Variable(_)) | None => {
                let store = make.fresh(environment, "NEW");
                let before = vec![make.symbol(&Symbol::cl("SETQ")), datum.clone()];
                let place = Place::new(make, vec![store], Writer::Call(before, Vec::new()), datum);
                self.places.push(Place { is_direct: true, ..place });
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
                let writer = Writer::Form(make.items(call.into_iter().chain(args.iter().cloned())));
                let place = Place::new(make, stores, writer, reader(&form, args, make));
                self.places.push(Place { temporaries, ..place });
            }
            Some(Update::Expander(expander)) => return self.stop_for_five(expander, &form, to),
            None if super::operator::find(&form.operator).is_some() => {
                return Err(no_place(&form.datum, to.span));
            }
            None if self.unit.is_broken_macro(&form.operator) => self.places.push(Place::broken(to.span)),
            None if self.is_macro(environment, &form.operator) => {
                let function = MacroRef::Global(form.operator.clone());
                return self.stop_for_place(function, &form, global.locked, to);
            }
            None => self.function_place(environment, form, to),
        }
        Ok(())
    }

    /// A place that the function `(setf f)` sets.
    fn function_place(&mut self, environment: &mut dyn Environment, form: Form, to: To) {
        let make = Make(to.span);
        let (temporaries, args) = arguments(environment, &form.args, make);
        let setter = make.cl("SETF", [make.symbol(&form.operator)]);
        let before = vec![make.symbol(&Symbol::cl("FUNCALL")), make.cl("FUNCTION", [setter])];
        let store = make.fresh(environment, "NEW");
        let reader = reader(&form, args.clone(), make);
        let place = Place::new(make, vec![store], Writer::Call(before, args), reader);
        self.places.push(Place { temporaries, ..place });
    }

    /// A place that is set by the form `(prefix… argument… value)`, which takes only the first `taken` arguments.
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
        let place =
            Place::new(make, vec![store], Writer::Call(before, Vec::new()), reader(&form, args, make));
        self.places.push(Place { temporaries, is_direct, ..place });
    }

    fn slot_place(
        &mut self,
        environment: &mut dyn Environment,
        accessor: &Accessor,
        form: Form,
        to: To,
    ) -> Checked {
        if accessor.read_only {
            let message = format!("the slot that {} reads is read-only", name(&form.operator));
            return Err(Box::new(code::MALFORMED_FORM.at(to.span, message)));
        }
        let make = Make(to.span);
        let prefix = vec![
            make.symbol(&Symbol::esl("%CALL-GLOBAL")),
            make.symbol(&Symbol::esl("%SET-SLOT")),
            make.quote(make.symbol(&accessor.class)),
            Datum::integer(accessor.slot, to.span),
        ];
        self.update_place(environment, prefix, form, usize::MAX, to);
        Ok(())
    }

    /// Takes the newest place.
    pub(super) fn take_place(&mut self) -> Place {
        self.places.pop().expect("a place was found for each use")
    }

    /// Takes the newest `count` places, in the order in which they were found.
    pub(super) fn take_places(&mut self, count: usize) -> Vec<Place> {
        self.places.split_off(self.places.len() - count)
    }
}

/// Variables for the subforms of a place that are not constant, and the subforms with these in their place.
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

/// The form that reads the place: its own operator with the temporaries for arguments.
pub(super) fn reader(form: &Form, args: Vec<Datum>, make: Make) -> Datum {
    make.items(std::iter::once(make.symbol(&form.operator)).chain(args))
}

/// How the library says that a place is set.
pub(super) enum Update {
    /// By a global function that takes the new value last.
    Function(Symbol),
    /// By a macro that takes the new value last.
    Operator(Symbol),
    /// By the form `(macro (store…) argument…)`, with so many stores.
    Macro(Symbol, usize),
    /// By what this macro says: a list of the five parts.
    Expander(Symbol),
}

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
    let is_standard = symbol.is_in(CL_PACKAGE) || symbol.is_in(esl_bytecode::symbol::ESL_PACKAGE);
    (is_standard && super::call::builtin(&update).is_some()).then_some(Update::Function(update))
}

pub(super) fn no_place(datum: &Datum, span: Span) -> Box<Diagnostic> {
    let message = format!("{} is no place that can be set", quoted(datum));
    Box::new(
        code::MALFORMED_FORM
            .at(span, message)
            .help("a place is a variable or a call of an accessor, such as `(car x)`"),
    )
}
