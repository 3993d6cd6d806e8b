//! Global names of a compilation unit: findings that are known only at its end, namely undefined functions
//! and variables, undeclared causes, and calls with a wrong number of arguments.

use esl_bytecode::compile::{Arity, Environment, GlobalFunction, GlobalVariable};
use esl_bytecode::datum::Datum;
use esl_bytecode::diagnostic::{Diagnostic, Label};
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;
use rustc_hash::{FxHashMap, FxHashSet};

use super::form::{name, name_with_package, plain, with_namesake};
use super::function::FunctionName;
use crate::diagnostic::code;

/// Uses of an undefined name that are shown besides the first.
const SHOWN: usize = 3;
/// Undefined names for which similar ones are suggested; each suggestion looks at all names.
const COMPARED: usize = 50;

/// A call of a global function.
#[derive(Debug)]
struct PendingCall {
    function: FunctionName,
    /// Number of arguments; `None` if it is unknown, or the function is only referred to.
    arguments: Option<u32>,
    /// Place of the name.
    name: Span,
    /// Place of the call.
    span: Span,
}

/// Uses and definitions of global names in a compilation unit.
#[derive(Debug, Default)]
pub(super) struct GlobalUses {
    calls: Vec<PendingCall>,
    variables: Vec<(Symbol, Span)>,
    /// Variables that forms of the unit define at run time.
    defined_variables: FxHashSet<Symbol>,
    /// Causes of failures that the unit names.
    causes: Vec<(Symbol, Span)>,
    /// Functions that the unit defines; without an arity if several definitions differ in it.
    functions: FxHashMap<FunctionName, Option<Arity>>,
    /// Macros with faulty definitions, whose calls are not checked.
    broken_macros: FxHashSet<Symbol>,
}

impl GlobalUses {
    /// Notes a call or a reference.
    pub(super) fn note_call(
        &mut self,
        function: FunctionName,
        arguments: Option<usize>,
        name: Span,
        span: Span,
    ) {
        let arguments = arguments.map(|count| u32::try_from(count).unwrap_or(u32::MAX));
        self.calls.push(PendingCall { function, arguments, name, span });
    }

    /// Notes a use of a variable that has no definition so far.
    pub(super) fn note_variable(&mut self, symbol: &Symbol, span: Span) {
        self.variables.push((symbol.clone(), span));
    }

    /// Notes that a form of the unit defines a variable at run time.
    pub(super) fn note_variable_definition(&mut self, symbol: &Symbol) {
        self.defined_variables.insert(symbol.clone());
    }

    /// Notes the definition of a function.
    pub(super) fn note_definition(&mut self, function: FunctionName, arity: Arity) {
        self.functions
            .entry(function)
            .and_modify(|known| {
                if *known != Some(arity) {
                    *known = None;
                }
            })
            .or_insert(Some(arity));
    }

    /// Notes that the definition of a function is faulty, so that its calls are not checked.
    pub(super) fn note_broken_function(&mut self, function: FunctionName) {
        self.functions.insert(function, None);
    }

    /// Notes a use of a cause of failures.
    pub(super) fn note_cause(&mut self, cause: &Symbol, span: Span) {
        self.causes.push((cause.clone(), span));
    }

    /// Notes that the definition of a macro is faulty.
    pub(super) fn note_broken_macro(&mut self, symbol: &Symbol) {
        self.broken_macros.insert(symbol.clone());
    }

    /// Whether the definition of this macro is faulty.
    pub(super) fn is_broken_macro(&self, symbol: &Symbol) -> bool {
        self.broken_macros.contains(symbol)
    }

    /// Returns the findings at the end of the unit.
    pub(super) fn finish(&mut self, environment: &dyn Environment) -> Vec<Diagnostic> {
        let mut findings = Vec::new();
        let mut undefined: Vec<(FunctionName, Vec<Span>)> = Vec::new();
        let mut known: FxHashMap<FunctionName, usize> = FxHashMap::default();
        for call in std::mem::take(&mut self.calls) {
            let arity = match self.functions.get(&call.function) {
                Some(arity) => *arity,
                None => match global(environment, &call.function) {
                    GlobalFunction::Function(arity) => arity,
                    // A call before the definition of the macro fails when it is made.
                    GlobalFunction::Macro => {
                        let message =
                            format!("{} is used as a function here, and a macro", call.function.shown());
                        findings.push(
                            code::UNDEFINED_FUNCTION.at(call.name, message).help("define the macro first"),
                        );
                        continue;
                    }
                    GlobalFunction::Undefined => {
                        match known.get(&call.function) {
                            Some(&index) => undefined[index].1.push(call.name),
                            None => {
                                known.insert(call.function.clone(), undefined.len());
                                undefined.push((call.function, vec![call.name]));
                            }
                        }
                        continue;
                    }
                },
            };
            if let (Some(arity), Some(count)) = (arity, call.arguments)
                && !accepts(arity, count)
            {
                let warning = wrong_count(&call.function.shown(), arity, count, call.span);
                findings.push(with_namesake(warning, &call.function.symbol));
            }
        }
        let mut reported = FxHashSet::default();
        for (cause, span) in std::mem::take(&mut self.causes) {
            if let Some(warning) = undeclared(environment, &cause, span)
                && reported.insert(cause)
            {
                findings.push(warning);
            }
        }
        let mut similar = Similar { environment, left: COMPARED };
        findings.extend(
            undefined.into_iter().map(|(function, uses)| similar.undefined_function(&function, &uses)),
        );
        findings.extend(self.undefined_variables(similar));
        findings
    }

    fn undefined_variables(&mut self, mut similar: Similar<'_>) -> Vec<Diagnostic> {
        let mut uses: Vec<(Symbol, Vec<Span>)> = Vec::new();
        let mut known: FxHashMap<Symbol, usize> = FxHashMap::default();
        for (symbol, span) in std::mem::take(&mut self.variables) {
            let is_defined = self.defined_variables.contains(&symbol)
                || !matches!(similar.environment.global(&symbol).variable, GlobalVariable::Undefined);
            if is_defined {
                continue;
            }
            let index = *known.entry(symbol.clone()).or_insert(uses.len());
            match uses.get_mut(index) {
                Some((_, spans)) => spans.push(span),
                None => uses.push((symbol, vec![span])),
            }
        }
        uses.into_iter()
            .map(|(symbol, spans)| {
                if let Some(instead) = similar.environment.global(&symbol).instead {
                    let message =
                        format!("{} is not in the subset of Common Lisp that ESL has", name(&symbol));
                    return code::NAME_NOT_IN_SUBSET.at(spans[0], message).help(instead);
                }
                let message = format!("no variable is called {}", name(&symbol));
                let diagnostic = with_uses(code::UNDEFINED_VARIABLE.at(spans[0], message), &spans[1..]);
                similar.help(diagnostic, &symbol, true)
            })
            .collect()
    }
}

fn global(environment: &dyn Environment, function: &FunctionName) -> GlobalFunction {
    if function.is_setf {
        environment.setf_function(&function.symbol)
    } else {
        environment.global(&function.symbol).function
    }
}

/// The warning about an undeclared cause, if the program declares causes at all.
fn undeclared(environment: &dyn Environment, cause: &Symbol, span: Span) -> Option<Diagnostic> {
    let property = |of: &Symbol, indicator: &str| -> Option<Datum> {
        environment.property(of, &Symbol::esl(indicator)).filter(|value| !value.is_nil())
    };
    property(&Symbol::esl("DEFINE-CAUSE"), "%USED")?;
    if cause.name() == "GENERAL-FAILURE" || property(cause, "%CAUSE").is_some() {
        return None;
    }
    let message = format!("no cause is called {}", name(cause));
    let help = format!("declare it with `(define-cause {} ())`", plain(cause));
    Some(code::UNDECLARED_CAUSE.at(span, message).help(help))
}

/// Suggests names that resemble undefined ones.
struct Similar<'a> {
    environment: &'a dyn Environment,
    /// Number of further suggestions.
    left: usize,
}

impl Similar<'_> {
    fn undefined_function(&mut self, function: &FunctionName, uses: &[Span]) -> Diagnostic {
        if !function.is_setf
            && let Some(instead) = self.environment.global(&function.symbol).instead
        {
            let message = format!("{} is not in the subset of Common Lisp that ESL has", function.shown());
            return code::NAME_NOT_IN_SUBSET.at(uses[0], message).help(instead);
        }
        let message = format!("no function is called {}", function.shown());
        let diagnostic = with_uses(code::UNDEFINED_FUNCTION.at(uses[0], message), &uses[1..]);
        if function.is_setf {
            let place = plain(&function.symbol);
            let help =
                format!("define it with `(defun (setf {place}) (value …) …)` or `(defsetf {place} …)`");
            return diagnostic.help(help);
        }
        self.help(diagnostic, &function.symbol, false)
    }

    fn help(&mut self, diagnostic: Diagnostic, symbol: &Symbol, variable: bool) -> Diagnostic {
        if self.left == 0 {
            return diagnostic;
        }
        self.left -= 1;
        match self.environment.similar(symbol, variable).first() {
            Some(similar) if similar.name() == symbol.name() => {
                diagnostic.help(format!("did you mean {}?", name_with_package(similar)))
            }
            Some(similar) => diagnostic.help(format!("did you mean {}?", name(similar))),
            None => diagnostic,
        }
    }
}

fn with_uses(mut diagnostic: Diagnostic, further: &[Span]) -> Diagnostic {
    for &span in further.iter().filter(|span| **span != diagnostic.primary.span).take(SHOWN) {
        diagnostic.secondary.push(Label { span, text: "and here".into() });
    }
    diagnostic
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
