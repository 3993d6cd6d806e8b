//! Global names of a compilation unit: their uses and definitions, as far as they matter for findings that
//! are known only at the end of the unit (`unit`).

use esl_bytecode::compile::Arity;
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::diagnostic::Diagnostic;
use esl_bytecode::span::{SourceId, Span};
use esl_bytecode::symbol::Symbol;
use rustc_hash::{FxHashMap, FxHashSet};

use super::function::FunctionName;
use super::operation::UnitOperations;
use super::origin::NameUsed;
use super::trap::GuardianTrap;
use crate::diagnostic::code;

/// A call of a global function, or a reference to it.
#[derive(Debug)]
pub(super) struct PendingCall {
    pub(super) function: FunctionName,
    /// Number of arguments; `None` if it is unknown, or the function is only referred to.
    pub(super) arguments: Option<u32>,
    /// Arguments that are constants, with their positions.
    pub(super) constants: Vec<(u32, Datum)>,
    /// The form, if it is one with an operator between its operands.
    pub(super) infix: Option<Box<Diagnostic>>,
    /// Whether a form around it handles failures, so that the call may be meant to fail.
    pub(super) is_guarded: bool,
    /// Place of the name.
    pub(super) name: NameUsed,
    /// Place of the call.
    pub(super) span: Span,
}

/// A use of a variable that had no definition.
#[derive(Debug)]
pub(super) struct PendingVariable {
    pub(super) symbol: Symbol,
    pub(super) place: NameUsed,
    /// Whether a form that is being looked at binds the name, though not there.
    pub(super) is_bound_later: bool,
}

/// A function that the unit defines.
#[derive(Clone, Debug)]
pub(super) struct DefinedFunction {
    pub(super) arity: Arity,
    pub(super) lambda_list: Datum,
    /// The names that select keyword arguments; `None` if it takes none, or any.
    pub(super) keys: Option<Vec<Symbol>>,
    /// Place of its name.
    pub(super) place: Span,
}

/// Arguments that the program gives to a cause of failures, or that its procedures name.
#[derive(Clone, Copy, Debug)]
pub(super) struct CauseArguments {
    pub(super) count: u32,
    pub(super) place: Span,
}

/// Uses and definitions of global names in a compilation unit.
#[derive(Debug, Default)]
pub(super) struct GlobalUses {
    pub(super) calls: Vec<PendingCall>,
    pub(super) variables: Vec<PendingVariable>,
    /// Variables that forms of the unit define at run time.
    pub(super) defined_variables: FxHashSet<Symbol>,
    /// Causes of failures that the unit names.
    pub(super) causes: Vec<(Symbol, Span)>,
    /// Calls of `fail` with a constant cause.
    pub(super) failures: Vec<(Symbol, CauseArguments)>,
    /// Of the recovery procedures for a cause, the one that names the fewest arguments.
    pub(super) procedures: FxHashMap<Symbol, CauseArguments>,
    /// UnitOperations that recovery procedures call above calls of the same.
    pub(super) traps: Vec<GuardianTrap>,
    /// UnitOperations that the unit defines and uses.
    pub(super) operations: UnitOperations,
    /// Causes, goals and the like that top-level forms define, by source, kind and name, and their places.
    pub(super) definitions: FxHashMap<(SourceId, &'static str, String), Span>,
    /// Names that the unit uses as types.
    pub(super) types: Vec<(Symbol, NameUsed)>,
    /// Names that forms of the unit define as types.
    pub(super) defined_types: FxHashSet<Symbol>,
    /// Functions that the unit defines; `None` if several definitions differ in the number of arguments.
    pub(super) functions: FxHashMap<FunctionName, Option<Box<DefinedFunction>>>,
    /// Macros that the unit defines, and the places of their names.
    pub(super) macros: FxHashMap<Symbol, Span>,
    /// Macros with faulty definitions, whose calls are not checked.
    broken_macros: FxHashSet<Symbol>,
}

impl GlobalUses {
    /// Notes a call.
    pub(super) fn note_call(&mut self, call: PendingCall) {
        self.calls.push(call);
    }

    /// Notes a reference to a function, of which no number of arguments is known.
    pub(super) fn note_reference(&mut self, function: FunctionName, name: NameUsed) {
        let span = name.span;
        let (constants, infix) = Default::default();
        let call = PendingCall { function, arguments: None, constants, infix, is_guarded: false, name, span };
        self.calls.push(call);
    }

    /// Notes a use of a variable that has no definition so far.
    pub(super) fn note_variable(&mut self, variable: PendingVariable) {
        self.variables.push(variable);
    }

    /// Notes that a form of the unit defines a variable at run time.
    pub(super) fn note_variable_definition(&mut self, symbol: &Symbol) {
        self.defined_variables.insert(symbol.clone());
    }

    /// Notes the definition of a function.
    pub(super) fn note_definition(&mut self, function: FunctionName, defined: DefinedFunction) {
        let arity = defined.arity;
        self.functions
            .entry(function)
            .and_modify(|known| {
                if known.as_ref().is_some_and(|known| known.arity != arity) {
                    *known = None;
                } else if let Some(known) = known {
                    // The definition in force at the time of a call is unknown.
                    known.keys = None;
                }
            })
            .or_insert(Some(Box::new(defined)));
    }

    /// Notes that the definition of a function is faulty, so that its calls are not checked.
    pub(super) fn note_broken_function(&mut self, function: FunctionName) {
        self.functions.insert(function, None);
    }

    /// Notes a use of a cause of failures.
    pub(super) fn note_cause(&mut self, cause: &Symbol, span: Span) {
        self.causes.push((cause.clone(), span));
    }

    /// Notes a call of `fail` with this cause.
    pub(super) fn note_failure(&mut self, cause: &Symbol, given: CauseArguments) {
        self.failures.push((cause.clone(), given));
    }

    /// Notes a recovery procedure for this cause.
    pub(super) fn note_procedure(&mut self, cause: &Symbol, named: CauseArguments) {
        let least = self.procedures.entry(cause.clone()).or_insert(named);
        if named.count < least.count {
            *least = named;
        }
    }

    /// Notes the definition of a macro, whose name stands at `span`.
    pub(super) fn note_macro(&mut self, symbol: &Symbol, span: Span) {
        self.macros.insert(symbol.clone(), span);
    }

    /// Notes that the definition of a macro is faulty.
    pub(super) fn note_broken_macro(&mut self, symbol: &Symbol) {
        self.broken_macros.insert(symbol.clone());
    }

    /// Whether the definition of this macro is faulty.
    pub(super) fn is_broken_macro(&self, symbol: &Symbol) -> bool {
        self.broken_macros.contains(symbol)
    }
}

/// Whether a function of this arity takes `count` arguments.
pub(super) fn accepts(arity: Arity, count: u32) -> bool {
    count >= arity.min && arity.max.is_none_or(|max| count <= max)
}

/// The warning about a call with the wrong number of arguments.
pub(super) fn wrong_count(function: &str, arity: Arity, count: u32, span: Span) -> Diagnostic {
    let takes = match (arity.min, arity.max) {
        (0, Some(0)) => "no arguments".to_string(),
        (min, Some(max)) if min == max => arguments(min),
        (0, Some(max)) => format!("at most {}", arguments(max)),
        (min, None) => format!("at least {}", arguments(min)),
        (min, Some(max)) if min + 1 == max => format!("{min} or {}", arguments(max)),
        (min, Some(max)) => format!("{min} to {}", arguments(max)),
    };
    let message = format!("{function} takes {takes}, but is given {count}");
    code::WRONG_ARGUMENT_COUNT.at(span, message)
}

fn arguments(count: u32) -> String {
    if count == 1 { "1 argument".to_string() } else { format!("{count} arguments") }
}

/// Whether a datum is a constant that calls are checked for.
pub(super) fn is_checked_constant(datum: &Datum) -> bool {
    match datum.kind() {
        DatumKind::Symbol(symbol) => symbol.is_keyword(),
        DatumKind::Cons(..) | DatumKind::Object(_) => false,
        _ => true,
    }
}
