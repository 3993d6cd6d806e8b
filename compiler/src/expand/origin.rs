//! Origins: which macro call made a form.
//!
//! Everything that a macro makes has the place of its call. So the author of the program wrote a form if the
//! place of the form is known and differs from that of the call that made it ([`Origins::written`]).

use esl_bytecode::datum::Datum;
use esl_bytecode::span::{SourceId, Span};
use esl_bytecode::symbol::Symbol;
use rustc_hash::FxHashMap;
use std::collections::BTreeMap;

use super::form::{Checked, is_known, name};
use crate::diagnostic::code;

/// Macro calls that one top-level form may take.
const MAX_EXPANSIONS: u32 = 1_000_000;
/// Macros that may expand into one another in one place.
const MAX_CHAIN: u32 = 10_000;

/// A macro call of the top-level form, as an index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct OriginId(u32);

/// A macro call that made a form. Of several calls at one place, the outermost, which the source contains, is
/// named.
#[derive(Clone, Debug)]
pub(super) struct Origin {
    /// Name of the macro.
    pub(super) name: Symbol,
    /// Place of the call.
    pub(super) span: Span,
    /// The call as written, as an index; `None` for a symbol macro.
    form: Option<u32>,
    /// The call that made this one.
    around: Option<OriginId>,
    /// Whether the macro belongs to the language, so that an error in its expansion is not its fault.
    pub(super) is_standard: bool,
    /// Whether the macro of the innermost of these calls belongs to the language.
    is_made_by_standard: bool,
    /// Number of macro calls around this one.
    chain: u32,
}

/// The form of a macro call, whose symbols are looked for one after the other: it is read once, as far as
/// that takes.
#[derive(Debug, Default)]
struct WrittenForm {
    /// Parts that have not been read, the next one last.
    pending: Vec<Datum>,
    /// Places of the symbols that have been read: by source and beginning, their ends.
    places: FxHashMap<Symbol, BTreeMap<(SourceId, u32), u32>>,
}

impl WrittenForm {
    fn new(form: &Datum) -> WrittenForm {
        WrittenForm { pending: vec![form.clone()], places: FxHashMap::default() }
    }

    /// Returns the first place within `extent` at which `symbol` is written.
    fn place_of(&mut self, symbol: &Symbol, extent: Span) -> Option<Span> {
        let first = self.places.get(symbol).and_then(|places| {
            let (&(source, start), &end) = places.range((extent.source, extent.start)..).next()?;
            Some(Span::new(source, start, end)).filter(|place| extent.contains(*place))
        });
        if first.is_some() {
            return first;
        }
        while let Some(datum) = self.pending.pop() {
            if let Some((car, cdr)) = datum.as_cons() {
                self.pending.extend([cdr.clone(), car.clone()]);
                continue;
            }
            let place = datum.span();
            if let Some(read) = datum.as_symbol().filter(|_| is_known(place)) {
                let places = self.places.entry(read.clone()).or_default();
                places.insert((place.source, place.start), place.end);
                if read == symbol && extent.contains(place) {
                    return Some(place);
                }
            }
        }
        None
    }
}

/// The macro calls of one top-level form.
#[derive(Debug, Default)]
pub(super) struct Origins {
    calls: Vec<Origin>,
    /// Forms of the calls.
    forms: Vec<WrittenForm>,
    /// Number of calls so far.
    expansions: u32,
}

impl Origins {
    /// Forgets all calls, for the next top-level form.
    pub(super) fn clear(&mut self) {
        self.calls.clear();
        self.forms.clear();
        self.expansions = 0;
    }

    /// Returns the number of bytes that the calls take.
    pub(super) fn bytes(&self) -> usize {
        self.calls.capacity() * size_of::<Origin>() + self.forms.capacity() * size_of::<WrittenForm>()
    }

    /// Returns a call.
    pub(super) fn get(&self, OriginId(index): OriginId) -> &Origin {
        &self.calls[index as usize]
    }

    /// Returns the place within `extent` at which `symbol` is written in a call, or in those around it:
    /// what a macro passes on keeps its place, but for symbols.
    pub(super) fn place_of(&mut self, symbol: &Symbol, extent: Span, origin: OriginId) -> Option<Span> {
        let mut at = Some(origin);
        while let Some(OriginId(index)) = at {
            let call = &self.calls[index as usize];
            let place = call.form.and_then(|form| self.forms[form as usize].place_of(symbol, extent));
            if place.is_some() {
                return place;
            }
            at = call.around;
        }
        None
    }

    /// Notes a call of the macro `operator` at `span`, in a form that the call `around` made.
    ///
    /// # Errors
    /// `macro-failed`, if the expansion seems endless.
    pub(super) fn enter(
        &mut self,
        operator: &Symbol,
        span: Span,
        form: Option<&Datum>,
        is_standard: bool,
        around: Option<OriginId>,
    ) -> Checked<Option<OriginId>> {
        let parent = around.map(|around| self.get(around));
        let chain = parent.map_or(0, |parent| parent.chain + 1);
        if self.expansions >= MAX_EXPANSIONS || chain > MAX_CHAIN {
            let outermost =
                parent.filter(|parent| parent.span == span).map_or(operator, |parent| &parent.name);
            let message = format!("the expansion of {} does not end", name(outermost));
            let help = format!(
                "after {} calls of macros within one another it still calls {}: add a case that does not",
                chain.max(1),
                name(operator)
            );
            return Err(Box::new(code::MACRO_FAILED.at(span, message).help(help)));
        }
        let is_made_by_standard = is_standard;
        let origin = match parent {
            // A call that a macro has made is shown as the call of that macro.
            Some(parent) if parent.span == span => Origin { is_made_by_standard, chain, ..parent.clone() },
            _ => {
                let name = operator.clone();
                let form = form.map(|form| {
                    self.forms.push(WrittenForm::new(form));
                    self.forms.len() as u32 - 1
                });
                Origin { name, span, form, around, is_standard, is_made_by_standard, chain }
            }
        };
        self.expansions += 1;
        self.calls.push(origin);
        Ok(Some(OriginId(self.calls.len() as u32 - 1)))
    }

    /// Returns `span` if a form at this place was written there, and the empty span if the call `origin` made
    /// it.
    pub(super) fn written(&self, span: Span, origin: Option<OriginId>) -> Span {
        let is_made = origin.is_some_and(|origin| self.get(origin).span == span);
        if is_made { Span::default() } else { span }
    }

    /// Whether a macro of the language made a form at `span`.
    pub(super) fn is_of_library(&self, span: Span, origin: Option<OriginId>) -> bool {
        let is_made = !is_known(self.written(span, origin));
        is_made && origin.is_some_and(|origin| self.get(origin).is_made_by_standard)
    }
}

/// A place at which a global name is used.
#[derive(Clone, Debug)]
pub(super) struct NameUsed {
    /// The place.
    pub(super) span: Span,
    /// The macro of the program whose expansion contains the use.
    pub(super) maker: Option<Symbol>,
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOURCE: SourceId = SourceId(0);

    /// Returns a call with these arguments, each at the place of its number.
    fn call(arguments: &[&str]) -> Datum {
        let place = |number: usize| Span::new(SOURCE, number as u32 * 10, number as u32 * 10 + 5);
        let symbols = arguments.iter().enumerate();
        let items: Vec<Datum> =
            symbols.map(|(number, name)| Datum::symbol(Symbol::keyword(name), place(number))).collect();
        Datum::list(items, place(0).to(place(arguments.len())))
    }

    #[test]
    fn symbols_are_found_in_any_order_and_again() {
        let mut form = WrittenForm::new(&call(&["A", "B", "C", "B"]));
        let mut start_of = |name: &str, from: u32| {
            let extent = Span::new(SOURCE, from, 100);
            form.place_of(&Symbol::keyword(name), extent).map(|place| place.start)
        };
        assert_eq!(start_of("C", 0), Some(20));
        assert_eq!(start_of("B", 0), Some(10));
        assert_eq!(start_of("B", 15), Some(30));
        assert_eq!(start_of("B", 35), None);
        assert_eq!(start_of("A", 0), Some(0));
        assert_eq!(start_of("D", 0), None);
        assert_eq!(start_of("C", 0), Some(20));
    }

    #[test]
    fn a_symbol_is_looked_for_in_the_calls_around() {
        let mut origins = Origins::default();
        let (outer, inner) = (call(&["OUTER", "C"]), call(&["INNER"]));
        let operator = Symbol::keyword("MACRO");
        let mut enter = |form: &Datum, span, around| origins.enter(&operator, span, Some(form), true, around);
        let around = enter(&outer, Span::new(SOURCE, 0, 90), None).expect("it ends");
        let origin = enter(&inner, Span::new(SOURCE, 0, 20), around).expect("it ends");
        let place = origins.place_of(&Symbol::keyword("C"), outer.span(), origin.expect("it is noted"));
        assert_eq!(place.map(|place| place.start), Some(10));
    }
}
