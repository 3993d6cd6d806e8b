//! Findings at the end of a compilation unit: undefined functions and variables, undeclared causes, unknown
//! types, and calls whose arguments do not fit the function.

use esl_bytecode::compile::{Arity, Environment, GlobalFunction, GlobalVariable, NameUse};
use esl_bytecode::datum::Datum;
use esl_bytecode::diagnostic::{Diagnostic, Label};
use esl_bytecode::span::Span;
use esl_bytecode::symbol::{Symbol, setf_cell};
use rustc_hash::{FxHashMap, FxHashSet};

use super::argument::{refused_by, usage};
use super::form::{is_known, name, name_with_package, plain, with_namesake};
use super::function::FunctionName;
use super::global::{GlobalUses, PendingCall, accepts, wrong_count};
use super::origin::NameUsed;
use super::warning::AND_HERE;
use crate::diagnostic::code;
use crate::habit::word;
use crate::similar::is_like;

/// Undefined names for which similar ones are suggested; each suggestion looks at all names.
const COMPARED: usize = 50;

/// The findings of a unit.
#[derive(Debug, Default)]
pub struct UnitFindings {
    /// The findings.
    pub diagnostics: Vec<Diagnostic>,
    /// Foreign forms that have been reported. Other findings about what is inside follow from that.
    pub foreign: Vec<Span>,
}

/// Known parameters of a function.
#[derive(Clone, Debug)]
struct KnownFunction {
    arity: Option<Arity>,
    lambda_list: Option<Datum>,
    /// Greatest number of arguments before the keyword arguments.
    positional: u32,
    keys: Option<Vec<Symbol>>,
    /// Place of the definition, if that is in the unit.
    place: Option<Span>,
    is_of_language: bool,
}

impl GlobalUses {
    /// Returns the findings at the end of the unit. Names are looked for only if the unit `is_whole`: what
    /// could not be read may define them.
    pub(super) fn finish(&mut self, environment: &dyn Environment, is_whole: bool) -> UnitFindings {
        let mut findings = UnitFindings::default();
        let mut undefined: Vec<(FunctionName, Vec<NameUsed>)> = Vec::new();
        let mut known: FxHashMap<FunctionName, usize> = FxHashMap::default();
        let mut signatures: FxHashMap<FunctionName, KnownFunction> = FxHashMap::default();
        for call in std::mem::take(&mut self.calls) {
            if !self.functions.contains_key(&call.function) {
                match global(environment, &call.function) {
                    // A call before the definition of the macro fails when it is made.
                    GlobalFunction::Macro if is_whole => {
                        let message =
                            format!("{} is used as a function here, and a macro", call.function.shown());
                        let warning = code::UNDEFINED_FUNCTION.at(call.name.span, message);
                        findings.diagnostics.push(warning.help("define the macro first"));
                        continue;
                    }
                    GlobalFunction::Macro => continue,
                    // A script of a world may answer the calls of a name that is nothing else.
                    GlobalFunction::Undefined if self.operations.define(&call.function.symbol) => continue,
                    GlobalFunction::Undefined => {
                        if let Some(foreign) = foreign_call(&call) {
                            findings.diagnostics.push(foreign);
                            findings.foreign.push(call.span);
                        } else if is_whole {
                            let index = *known.entry(call.function.clone()).or_insert(undefined.len());
                            match undefined.get_mut(index) {
                                Some((_, uses)) => uses.push(call.name),
                                None => undefined.push((call.function, vec![call.name])),
                            }
                        }
                        continue;
                    }
                    GlobalFunction::Function(_) => {}
                }
            }
            self.check_arguments(environment, &call, &mut signatures, &mut findings.diagnostics);
        }
        self.check_failures(&mut findings.diagnostics);
        self.check_traps(environment, &mut findings.diagnostics);
        if !is_whole {
            return findings;
        }
        for used in std::mem::take(&mut self.operations.uses) {
            let function = FunctionName::plain(&used.operation);
            if self.operations.include(environment, &used.operation) {
                let known = self.known(environment, &function).filter(|_| !used.is_guarded);
                let list = known.and_then(|known| known.lambda_list);
                findings.diagnostics.extend(list.and_then(|list| used.unknown_parameter(&list)));
            } else if self.functions.contains_key(&function)
                || self.macros.contains_key(&used.operation)
                || !matches!(global(environment, &function), GlobalFunction::Undefined)
            {
                if !used.is_guarded {
                    findings.diagnostics.push(self.with_maker(used.not_an_operation(), &used.place));
                }
            } else {
                let index = *known.entry(function.clone()).or_insert(undefined.len());
                match undefined.get_mut(index) {
                    Some((_, uses)) => uses.push(used.place),
                    None => undefined.push((function, vec![used.place])),
                }
            }
        }
        let mut similar = Similar { environment, left: COMPARED };
        let mut reported = FxHashSet::default();
        for (cause, span) in std::mem::take(&mut self.causes) {
            if let Some(warning) = similar.undeclared(&cause, span)
                && reported.insert(cause)
            {
                findings.diagnostics.push(warning);
            }
        }
        for (function, uses) in undefined {
            let warning = similar.undefined_function(&function, &uses);
            if warning.code == code::FOREIGN_WORD.name {
                findings.foreign.push(uses[0].span);
            }
            findings.diagnostics.push(self.with_maker(warning, &uses[0]));
        }
        for (symbol, places) in self.take_unknown_types(environment) {
            let warning = similar.unknown_type(&symbol, &places);
            findings.diagnostics.push(self.with_maker(warning, &places[0]));
        }
        self.undefined_variables(similar, &mut findings.diagnostics);
        findings
    }

    /// Adds the definition of the macro whose expansion contains a use.
    fn with_maker(&self, warning: Diagnostic, place: &NameUsed) -> Diagnostic {
        let Some(maker) = &place.maker else { return warning };
        let warning = warning.label(format!("in the expansion of {}", name(maker)));
        match self.macros.get(maker) {
            Some(&span) => warning.also(span, format!("{} is defined here", name(maker))),
            None => warning,
        }
    }

    /// Returns what is known of the parameters of a defined function; `None` if its definitions differ.
    fn known(&self, environment: &dyn Environment, function: &FunctionName) -> Option<KnownFunction> {
        if let Some(defined) = self.functions.get(function) {
            let defined = defined.as_deref()?;
            let positional = match (&defined.keys, defined.arity.max) {
                (Some(_), _) | (None, None) => positional(&defined.lambda_list),
                (None, Some(max)) => max,
            };
            return Some(KnownFunction {
                arity: Some(defined.arity),
                lambda_list: Some(defined.lambda_list.clone()),
                positional,
                keys: defined.keys.clone(),
                place: Some(defined.place),
                is_of_language: false,
            });
        }
        let GlobalFunction::Function(arity) = global(environment, function) else { return None };
        let cell = if function.is_setf { setf_cell(&function.symbol) } else { function.symbol.clone() };
        let signature = environment.signature(&cell);
        Some(KnownFunction {
            arity,
            positional: signature.as_ref().map_or(0, |signature| signature.positional),
            keys: signature.as_ref().and_then(|signature| signature.keys.clone()),
            lambda_list: signature.map(|signature| signature.lambda_list),
            place: None,
            is_of_language: environment.global(&function.symbol).locked,
        })
    }

    /// Checks the arguments of a call: their number, keywords, and constants.
    fn check_arguments(
        &self,
        environment: &dyn Environment,
        call: &PendingCall,
        signatures: &mut FxHashMap<FunctionName, KnownFunction>,
        findings: &mut Vec<Diagnostic>,
    ) {
        let Some(count) = call.arguments else { return };
        if !signatures.contains_key(&call.function) {
            let Some(known) = self.known(environment, &call.function) else { return };
            signatures.insert(call.function.clone(), known);
        }
        let Some(known) = signatures.get(&call.function) else { return };
        if let Some(arity) = known.arity
            && !accepts(arity, count)
        {
            let warning = wrong_count(&call.function.shown(), arity, count, call.span);
            findings.push(with_namesake(known.explain(warning, &call.function), &call.function.symbol));
            return;
        }
        if call.constants.is_empty() {
            return;
        }
        if let Some(keys) = &known.keys
            && !call.is_guarded
        {
            findings.extend(known.check_keys(keys, call, count));
        }
        if known.is_of_language
            && !call.is_guarded
            && !call.function.symbol.name().starts_with('%')
            && let Some(list) = &known.lambda_list
        {
            for (index, constant) in &call.constants {
                let Some(parameter) = list.elements().nth(*index as usize) else { break };
                let Some(parameter) = parameter.as_symbol().filter(|name| !name.name().starts_with('&'))
                else {
                    break;
                };
                // Only this name means the same all over the library, where NIL may stand for no limit.
                if parameter.name() == "SECONDS"
                    && !constant.is_nil()
                    && let Some(what) = refused_by("seconds", constant)
                {
                    let span = if is_known(constant.span()) { constant.span() } else { call.span };
                    let message = format!("{} takes {what}", call.function.shown());
                    findings.push(known.explain(code::WRONG_ARGUMENT.at(span, message), &call.function));
                }
            }
        }
    }

    /// Warns of failures with fewer arguments than all recovery procedures for their cause name.
    fn check_failures(&mut self, findings: &mut Vec<Diagnostic>) {
        for (cause, given) in std::mem::take(&mut self.failures) {
            let Some(least) = self.procedures.get(&cause).filter(|least| least.count > given.count) else {
                continue;
            };
            let arguments = |count| match count {
                0 => "no argument".to_string(),
                1 => "1 argument".to_string(),
                count => format!("{count} arguments"),
            };
            let message = format!(
                "this failure has {}, but the recovery procedure for {} names {}",
                arguments(given.count),
                name(&cause),
                least.count
            );
            let warning = code::WRONG_ARGUMENT_COUNT.at(given.place, message);
            findings.push(warning.also(least.place, "the procedure names its arguments here"));
        }
    }

    /// Warns of recovery procedures that call an operation which the interrupted form performs.
    fn check_traps(&mut self, environment: &dyn Environment, findings: &mut Vec<Diagnostic>) {
        for trap in std::mem::take(&mut self.traps) {
            let (operation, operations) = (&trap.operation, &self.operations);
            let is_operation = operations.include(environment, operation)
                || operations.uses.iter().any(|used| used.operation == *operation);
            if !is_operation || operations.exclude(environment, operation) {
                continue;
            }
            let shown = name(operation);
            let message =
                format!("{shown} is called here while the interrupted call of {shown} is under way");
            let help = "a procedure runs above the call that a guardian interrupts: leave the body first, by \
                        `(abort …)`, and call the operation after it";
            let warning = code::CONCURRENT_OPERATION.at(trap.in_procedure, message).help(help);
            findings.push(warning.also(trap.in_body, "the guardian interrupts this call"));
        }
    }

    fn undefined_variables(&mut self, mut similar: Similar<'_>, findings: &mut Vec<Diagnostic>) {
        let mut uses: Vec<(Symbol, Vec<NameUsed>, bool)> = Vec::new();
        let mut known: FxHashMap<Symbol, usize> = FxHashMap::default();
        for variable in std::mem::take(&mut self.variables) {
            let symbol = variable.symbol;
            let is_defined = self.defined_variables.contains(&symbol)
                || !matches!(similar.environment.global(&symbol).variable, GlobalVariable::Undefined);
            if is_defined {
                continue;
            }
            let index = *known.entry(symbol.clone()).or_insert(uses.len());
            match uses.get_mut(index) {
                Some((_, places, _)) => places.push(variable.place),
                None => uses.push((symbol, vec![variable.place], variable.is_bound_later)),
            }
        }
        for (symbol, places, is_bound_later) in uses {
            let span = places[0].span;
            let warning = if let Some(instead) = similar.environment.global(&symbol).instead {
                let message = format!("{} is not in the subset of Common Lisp that ESL has", name(&symbol));
                code::NAME_NOT_IN_SUBSET.at(span, message).help(instead)
            } else if let Some(word) = word::value(symbol.name()) {
                with_uses(code::FOREIGN_WORD.at(span, word.message()).help(word.help()), &places[1..])
            } else {
                let message = format!("no variable is called {}", name(&symbol));
                let warning = with_uses(code::UNDEFINED_VARIABLE.at(span, message), &places[1..]);
                if is_bound_later {
                    let help = "`let` binds all its variables at once; `let*` binds them one after the other";
                    warning.help(help)
                } else if self.is_function(similar.environment, &symbol) {
                    let shown = plain(&symbol);
                    warning.help(format!("`{shown}` is a function: write `#'{shown}` to pass it"))
                } else {
                    similar.help(warning, &symbol, NameUse::Variable)
                }
            };
            findings.push(self.with_maker(warning, &places[0]));
        }
    }

    /// Whether a symbol names a function, and not only one of another package.
    fn is_function(&self, environment: &dyn Environment, symbol: &Symbol) -> bool {
        self.functions.contains_key(&FunctionName::plain(symbol))
            || matches!(environment.global(symbol).function, GlobalFunction::Function(_))
    }
}

impl KnownFunction {
    /// Adds to a warning how the function is called, and where it is defined.
    fn explain(&self, warning: Diagnostic, function: &FunctionName) -> Diagnostic {
        if function.is_setf {
            return warning;
        }
        let usage = self.lambda_list.as_ref().map(|list| usage(&function.symbol, list));
        match (self.place.filter(|&place| is_known(place)), usage) {
            (Some(place), Some(usage)) => warning.also(place, format!("defined here as {usage}")),
            (None, Some(usage)) => warning.help(format!("it is called as {usage}")),
            (Some(place), None) => warning.also(place, "defined here"),
            (None, None) => warning,
        }
    }

    /// Checks the keyword arguments of a call with `count` arguments.
    fn check_keys(&self, keys: &[Symbol], call: &PendingCall, count: u32) -> Option<Diagnostic> {
        let shown = call.function.shown();
        let is_key_place =
            |index: u32| index >= self.positional && (index - self.positional).is_multiple_of(2);
        let given = call.constants.iter().filter(|(index, _)| is_key_place(*index));
        let mut given = given.filter_map(|(_, datum)| Some((datum.as_symbol()?, datum)));
        if given.clone().any(|(symbol, _)| symbol.name() == "ALLOW-OTHER-KEYS") {
            return None;
        }
        if count > self.positional && !(count - self.positional).is_multiple_of(2) {
            let message = format!("{shown} takes keywords and values in pairs, but one of them is alone");
            return Some(self.explain(code::WRONG_ARGUMENT_COUNT.at(call.span, message), &call.function));
        }
        let (symbol, datum) = given.find(|(symbol, _)| !keys.contains(symbol))?;
        if !symbol.is_keyword() {
            return None;
        }
        let span = if is_known(datum.span()) { datum.span() } else { call.span };
        let message = format!("{shown} takes no keyword `:{}`", plain(symbol).trim_start_matches(':'));
        let warning = code::UNKNOWN_KEYWORD.at(span, message);
        let likely = keys.iter().find(|key| is_like(key.name(), symbol.name()));
        let warning = match likely {
            Some(key) => warning.help(format!("did you mean `:{}`?", key.name().to_lowercase())),
            None => warning,
        };
        // Advice on the spelling is better than the lambda list, which the definition shows.
        Some(if warning.help.is_some() && self.place.is_none() {
            warning
        } else {
            self.explain(warning, &call.function)
        })
    }
}

/// Returns the number of parameters before `&rest` and `&key`.
fn positional(lambda_list: &Datum) -> u32 {
    let is_end = |item: &&Datum| {
        item.as_symbol().is_none_or(|symbol| !matches!(symbol.name(), "&REST" | "&KEY" | "&AUX" | "&BODY"))
    };
    let before = lambda_list.elements().take_while(is_end);
    before.filter(|item| item.as_symbol().is_none_or(|symbol| symbol.name() != "&OPTIONAL")).count() as u32
}

/// Returns the report about a call of an undefined function that other languages have.
fn foreign_call(call: &PendingCall) -> Option<Diagnostic> {
    if let Some(infix) = &call.infix {
        return Some((**infix).clone());
    }
    call.arguments?;
    let word = word::call(call.function.symbol.name()).filter(|_| !call.function.is_setf)?;
    Some(code::FOREIGN_WORD.at(call.name.span, word.message()).help(word.help()))
}

fn global(environment: &dyn Environment, function: &FunctionName) -> GlobalFunction {
    if function.is_setf {
        environment.setf_function(&function.symbol)
    } else {
        environment.global(&function.symbol).function
    }
}

/// Suggests names that resemble undefined ones.
struct Similar<'a> {
    environment: &'a dyn Environment,
    /// Number of further suggestions.
    left: usize,
}

impl Similar<'_> {
    fn undefined_function(&mut self, function: &FunctionName, uses: &[NameUsed]) -> Diagnostic {
        let span = uses[0].span;
        if !function.is_setf
            && let Some(instead) = self.environment.global(&function.symbol).instead
        {
            if let Some(word) = word::call(function.symbol.name()) {
                return code::FOREIGN_WORD.at(span, word.message()).help(word.help());
            }
            let message = format!("{} is not in the subset of Common Lisp that ESL has", function.shown());
            return code::NAME_NOT_IN_SUBSET.at(span, message).help(instead);
        }
        let message = format!("no function is called {}", function.shown());
        let diagnostic = with_uses(code::UNDEFINED_FUNCTION.at(span, message), &uses[1..]);
        if function.is_setf {
            let place = plain(&function.symbol);
            let help =
                format!("define it with `(defun (setf {place}) (value …) …)` or `(defsetf {place} …)`");
            return diagnostic.help(help);
        }
        self.help(diagnostic, &function.symbol, NameUse::Function)
    }

    fn unknown_type(&mut self, symbol: &Symbol, uses: &[NameUsed]) -> Diagnostic {
        let message = format!("no type is called {}", name(symbol));
        let warning = with_uses(code::UNKNOWN_TYPE.at(uses[0].span, message), &uses[1..]);
        self.help(warning, symbol, NameUse::Type)
    }

    /// The warning about an undeclared cause, if the program declares causes at all.
    fn undeclared(&mut self, cause: &Symbol, span: Span) -> Option<Diagnostic> {
        let environment = self.environment;
        let property = |of: &Symbol, indicator: &str| -> Option<Datum> {
            environment.property(of, &Symbol::esl(indicator)).filter(|value| !value.is_nil())
        };
        property(&Symbol::esl("DEFINE-CAUSE"), "%USED")?;
        if cause.name() == "GENERAL-FAILURE" || property(cause, "%CAUSE").is_some() {
            return None;
        }
        let message = format!("no cause is called {}", name(cause));
        let warning = self.help(code::UNDECLARED_CAUSE.at(span, message), cause, NameUse::Cause);
        if warning.help.is_some() {
            return Some(warning);
        }
        let help = format!("declare it with `(define-cause {} ())`", plain(cause));
        Some(warning.help(help))
    }

    fn help(&mut self, diagnostic: Diagnostic, symbol: &Symbol, wanted: NameUse) -> Diagnostic {
        if self.left == 0 {
            return diagnostic;
        }
        self.left -= 1;
        match self.environment.similar(symbol, wanted).first() {
            Some(similar) if similar.name() == symbol.name() => {
                diagnostic.help(format!("did you mean {}?", name_with_package(similar)))
            }
            Some(similar) => diagnostic.help(format!("did you mean {}?", name(similar))),
            None => diagnostic,
        }
    }
}

fn with_uses(mut diagnostic: Diagnostic, further: &[NameUsed]) -> Diagnostic {
    let first = diagnostic.primary.span;
    for place in further.iter().filter(|place| place.span != first) {
        diagnostic.secondary.push(Label { span: place.span, text: AND_HERE.into() });
    }
    diagnostic
}
