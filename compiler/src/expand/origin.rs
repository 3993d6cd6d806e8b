//! Origins: which macro call made a form.
//!
//! Everything that a macro makes has the place of its call. So the author of the program wrote a form if the
//! place of the form is known and differs from that of the call that made it ([`Origins::written`]).

use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;

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
    /// The call as written; `None` for a symbol macro.
    form: Option<Datum>,
    /// The call that made this one.
    around: Option<OriginId>,
    /// Whether the macro belongs to the language, so that an error in its expansion is not its fault.
    pub(super) is_standard: bool,
    /// Whether the macro of the innermost of these calls belongs to the language.
    is_made_by_standard: bool,
    /// Number of macro calls around this one.
    chain: u32,
}

/// The macro calls of one top-level form.
#[derive(Debug, Default)]
pub(super) struct Origins {
    calls: Vec<Origin>,
    /// Number of calls so far.
    expansions: u32,
}

impl Origins {
    /// Forgets all calls, for the next top-level form.
    pub(super) fn clear(&mut self) {
        self.calls.clear();
        self.expansions = 0;
    }

    /// Returns the number of bytes that the calls take.
    pub(super) fn bytes(&self) -> usize {
        self.calls.capacity() * size_of::<Origin>()
    }

    /// Returns a call.
    pub(super) fn get(&self, OriginId(index): OriginId) -> &Origin {
        &self.calls[index as usize]
    }

    /// Returns the place within `extent` at which `symbol` is written in a call, or in those around it:
    /// what a macro passes on keeps its place, but for symbols.
    pub(super) fn place_of(&self, symbol: &Symbol, extent: Span, origin: OriginId) -> Option<Span> {
        let mut at = Some(origin);
        while let Some(id) = at {
            let call = self.get(id);
            let mut pending: Vec<&Datum> = call.form.iter().collect();
            while let Some(datum) = pending.pop() {
                if datum.as_symbol() == Some(symbol)
                    && is_known(datum.span())
                    && extent.contains(datum.span())
                {
                    return Some(datum.span());
                }
                if let Some((car, cdr)) = datum.as_cons() {
                    pending.extend([cdr, car]);
                }
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
                let (name, form) = (operator.clone(), form.cloned());
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
