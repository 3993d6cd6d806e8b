//! Names that have to be those of operations: in `define-exclusive` and `start`.
//!
//! Operations are defined by `define-mock`, by the clauses of a `with-world`, and by the host. A name that is
//! undefined may become one before the form is evaluated.

use esl_bytecode::compile::Environment;
use esl_bytecode::datum::Datum;
use esl_bytecode::diagnostic::Diagnostic;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;
use rustc_hash::FxHashSet;

use super::form::name;
use super::origin::NameUsed;
use crate::diagnostic::code;
use crate::similar::is_like;

/// A form that needs the name of an operation.
#[derive(Debug)]
pub(super) struct OperationUse {
    pub(super) operation: Symbol,
    pub(super) place: NameUsed,
    /// The parameter that `define-exclusive` names, and its place.
    pub(super) parameter: Option<(Symbol, Span)>,
    /// Whether a form around it handles failures, so that it may be meant to fail.
    pub(super) is_guarded: bool,
}

/// The operations of a unit.
#[derive(Debug, Default)]
pub(super) struct UnitOperations {
    /// Names that the unit defines as those of operations.
    pub(super) defined: FxHashSet<Symbol>,
    /// Names that `define-exclusive` names.
    pub(super) exclusive: FxHashSet<Symbol>,
    /// Forms that need one.
    pub(super) uses: Vec<OperationUse>,
}

fn has(environment: &dyn Environment, symbol: &Symbol, indicator: &str) -> bool {
    environment.property(symbol, &Symbol::esl(indicator)).is_some_and(|value| !value.is_nil())
}

impl UnitOperations {
    /// Whether the unit defines an operation of this name.
    pub(super) fn define(&self, symbol: &Symbol) -> bool {
        self.defined.contains(symbol)
    }

    /// Whether the name is that of an operation.
    pub(super) fn include(&self, environment: &dyn Environment, symbol: &Symbol) -> bool {
        self.defined.contains(symbol) || has(environment, symbol, "%STARTER")
    }

    /// Whether calls of the operation exclude each other.
    pub(super) fn exclude(&self, environment: &dyn Environment, symbol: &Symbol) -> bool {
        self.exclusive.contains(symbol) || has(environment, symbol, "%EXCLUSIVE")
    }
}

impl OperationUse {
    /// The warning about the name of a function that is not an operation.
    pub(super) fn not_an_operation(&self) -> Diagnostic {
        let message = format!("{} is a function, and not an operation", name(&self.operation));
        code::NOT_AN_OPERATION
            .at(self.place.span, message)
            .help("operations are the functions of the host that wait, and those of `define-mock`")
    }

    /// The warning about a parameter that the operation, with this lambda list, does not have.
    pub(super) fn unknown_parameter(&self, lambda_list: &Datum) -> Option<Diagnostic> {
        let (parameter, span) = self.parameter.as_ref()?;
        let parameters: Vec<&Symbol> = lambda_list
            .elements()
            .filter_map(|item| {
                // A parameter is written alone, before a default, or in a list after its keyword.
                let item = item.as_cons().map_or(item, |(head, _)| head);
                let item = item.elements().nth(1).unwrap_or(item);
                item.as_symbol().filter(|symbol| !symbol.name().starts_with('&'))
            })
            .collect();
        if parameters.iter().any(|known| known.name() == parameter.name()) {
            return None;
        }
        let message = format!("{} has no parameter {}", name(&self.operation), name(parameter));
        let warning = code::NOT_AN_OPERATION.at(*span, message);
        let likely = parameters.iter().find(|known| is_like(known.name(), parameter.name()));
        Some(match (likely, parameters.as_slice()) {
            (Some(known), _) => warning.help(format!("did you mean {}?", name(known))),
            (None, []) => warning.help("it has none"),
            (None, known) => {
                let known: Vec<String> = known.iter().map(|known| name(known)).collect();
                warning.help(format!("it has {}", known.join(", ")))
            }
        })
    }
}
