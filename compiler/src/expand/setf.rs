//! Setf expansions: the five parts of a place, and what is done with places once they are found.
//!
//! All forms that set places are made from these parts: variables and the subforms that they are bound to
//! (evaluated once and in order), variables for the new values, a form that stores them, and a form that
//! reads the old value.

use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;

use super::form::{Checked, Form, Make, quoted};
use crate::diagnostic::code;

/// How the new value is stored.
#[derive(Clone, Debug)]
pub(super) enum PlaceWriter {
    /// By the form `(before… value after…)`.
    Call(Vec<Datum>, Vec<Datum>),
    /// By this form, within which the variables for the new values are bound.
    Form(Datum),
}

/// The five parts of a place.
#[derive(Clone, Debug)]
pub(super) struct SetfExpansion {
    /// Variables and the subforms that they are bound to, in order.
    pub(super) temporaries: Vec<(Datum, Datum)>,
    /// Variables for the new values.
    pub(super) stores: Vec<Datum>,
    pub(super) writer: PlaceWriter,
    /// Form that reads the old value.
    pub(super) reader: Datum,
    /// Whether the writer takes the temporaries in order and the value after them.
    pub(super) is_direct: bool,
    /// Whether the place was faulty, which has been reported.
    pub(super) is_broken: bool,
    pub(super) make: Make,
}

impl SetfExpansion {
    /// Returns the stand-in for a faulty place.
    pub(super) fn broken(span: Span) -> SetfExpansion {
        let make = Make(span);
        let writer = PlaceWriter::Form(make.nil());
        SetfExpansion { is_broken: true, ..SetfExpansion::new(make, Vec::new(), writer, make.nil()) }
    }

    /// Creates an expansion without temporaries.
    pub(super) fn new(make: Make, stores: Vec<Datum>, writer: PlaceWriter, reader: Datum) -> SetfExpansion {
        SetfExpansion {
            temporaries: Vec::new(),
            stores,
            writer,
            reader,
            is_direct: false,
            is_broken: false,
            make,
        }
    }

    /// Takes the five values apart that a `define-setf-expander` has returned for `place`.
    ///
    /// # Errors
    /// `macro-failed`, if they do not have the right shape.
    pub(super) fn from_values(place: &Datum, values: &Datum, span: Span) -> Checked<SetfExpansion> {
        let wrong = || {
            let message = format!(
                "the expander of {} must return five values: variables, forms, stores, writer, reader",
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
        let writer = PlaceWriter::Form((*writer).clone());
        let mut found = SetfExpansion::new(Make(span), stores, writer, (*reader).clone());
        found.temporaries = variables.into_iter().cloned().zip(forms.into_iter().cloned()).collect();
        Ok(found)
    }

    /// Returns the five parts as a list: variables, forms, stores, writer, reader.
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

    /// Whether the place is a variable: reading it has no effect, and nothing has to be bound for it.
    pub(super) fn is_variable(&self) -> bool {
        self.temporaries.is_empty() && self.reader.as_symbol().is_some()
    }

    /// Returns the form that stores the values of `value`, where the temporaries are bound.
    pub(super) fn write(&self, value: Datum) -> Datum {
        let make = self.make;
        match (&self.writer, self.stores.as_slice()) {
            (PlaceWriter::Call(before, after), _) => {
                make.items(before.iter().cloned().chain([value]).chain(after.iter().cloned()))
            }
            (PlaceWriter::Form(form), [store]) => {
                make.let_in_order(vec![(store.clone(), value)], vec![form.clone()])
            }
            (PlaceWriter::Form(form), stores) => {
                make.cl("MULTIPLE-VALUE-BIND", [make.items(stores.iter().cloned()), value, form.clone()])
            }
        }
    }

    /// Returns the form that stores the values of the variables for new values.
    pub(super) fn write_stores(&self) -> Datum {
        match (&self.writer, self.stores.first()) {
            (PlaceWriter::Call(..), Some(store)) => self.write(store.clone()),
            (PlaceWriter::Form(form), _) => form.clone(),
            (PlaceWriter::Call(..), None) => self.make.nil(),
        }
    }

    /// Returns the form that binds the temporaries and stores `value`.
    pub(super) fn set(&self, value: Datum) -> Datum {
        if let (true, PlaceWriter::Call(before, _)) = (self.is_direct, &self.writer) {
            // As arguments, subforms and value are evaluated in the right order: nothing has to be bound.
            let inlined = before.iter().map(|item| {
                let temporary = self.temporaries.iter().find(|(name, _)| name.is_same(item));
                temporary.map_or_else(|| item.clone(), |(_, form)| form.clone())
            });
            return self.make.items(inlined.chain([value]));
        }
        self.make.let_in_order(self.temporaries.clone(), vec![self.write(value)])
    }
}

/// Use of places once they are found.
#[derive(Debug)]
pub(super) enum PlaceUse {
    /// Makes the place `(values place…)` of the newest places.
    Values(usize),
    /// Makes a `getf` place of the newest place.
    Getf(Form),
    /// Makes an `ldb` or `mask-field` place of the newest place.
    Field(Form),
    /// Quotes the five parts of the newest place, as a list.
    Parts,
    /// Stores the values of a form.
    Setf(Datum),
    /// Stores the values of forms once all of them are computed.
    Psetf(Vec<Datum>),
    /// Moves values from place to place, the first one to the last place.
    Rotatef(usize),
    /// Moves values from place to place, the value of the form to the last one.
    Shiftf(usize, Datum),
    /// Replaces a value by one computed from it.
    Modify(Change),
}

/// How a new value is computed from the old one.
#[derive(Debug)]
pub(super) enum Change {
    /// `(function old argument…)`, the arguments evaluated before the old value is read.
    Call(Symbol, Vec<Datum>),
    /// `(function item old argument…)`, the item evaluated before the place.
    Push(Symbol, Datum, Vec<Datum>),
    /// The tail of the old value; the result is its head.
    Pop,
    /// The old value without the property; the result is whether there was one.
    Remf(Datum),
    /// The value of a form in which a variable is bound to the old value, after further bindings.
    Bound {
        /// Variable for the old value.
        old: Datum,
        /// Further bindings.
        bindings: Vec<(Datum, Datum)>,
        /// Form of the new value.
        new: Datum,
        /// Form whose values are the result, instead of the new value.
        result: Option<Datum>,
    },
}
