//! Calls: of local functions, builtins, global functions, and of the value of a form.

use esl_bytecode::builtin::Builtin;
use esl_bytecode::compile::{Environment, Global, GlobalFunction, MacroRef};
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::symbol::Symbol;

use super::argument::{refused, usage};
use super::check::wrong_key;
use super::expander::Expander;
use super::form::{Checked, Form, Make, arguments, constant_value, infix, is_cl_form, is_known, name};
use super::function::{FunctionName, WrittenName};
use super::global::{PendingCall, accepts, is_checked_constant, wrong_count};
use super::job::{AwaitedOutcome, Job, To};
use super::lambda_list::{LambdaList, LambdaListKind};
use super::scope::{FunctionMeaning, LocalSignature, Visible};
use crate::core::{Callee, NodeId, NodeKind, VarId};
use crate::diagnostic::code;

/// Arguments that a call passes in registers. Further arguments are passed as a list.
pub(super) const DIRECT_ARGUMENTS: usize = 60;

/// Function that a call designates.
enum FunctionDesignator {
    /// A local function, kept in this variable.
    Local(VarId, LocalSignature),
    /// A global function, by name.
    Global(WrittenName),
    /// The function that a symbol names when the call is made, unknown until then.
    Named(WrittenName),
    /// The value of a form.
    Form(Datum),
}

impl Expander {
    /// Expands a form that begins with a symbol.
    pub(super) fn expand_operation(
        &mut self,
        environment: &mut dyn Environment,
        form: Form,
        to: To,
    ) -> Checked {
        match self.scope.function(&form.operator, self.level()) {
            Visible::Is(FunctionMeaning::Local(variable, signature)) => {
                self.call(environment, FunctionDesignator::Local(variable, signature), &form.args, &form, to)
            }
            Visible::Is(FunctionMeaning::Macro(Some(function))) => {
                self.stop_for_form(MacroRef::Local(function), &form, false, to)
            }
            Visible::Is(FunctionMeaning::Macro(None)) => {
                self.fill(to, NodeKind::Constant(Datum::nil(to.span)));
                Ok(())
            }
            Visible::OutOfReach => {
                let named = Make(form.head()).symbol(&form.operator);
                Err(WrittenName::symbol(&form.operator, named).out_of_reach(&form))
            }
            Visible::No => match (self.find_operator)(&form.operator) {
                Some(operator) => operator(self, environment, form, to),
                None => self.global_operation(environment, form, to),
            },
        }
    }

    fn global_operation(&mut self, environment: &mut dyn Environment, form: Form, to: To) -> Checked {
        let global = environment.global(&form.operator);
        if global.locked {
            self.check_written(environment, &form, to.origin);
        }
        if self.globals.is_broken_macro(&form.operator) {
            self.fill(to, NodeKind::Constant(Datum::nil(to.span)));
            return Ok(());
        }
        if global.function == GlobalFunction::Macro {
            let function = MacroRef::Global(form.operator.clone());
            return self.stop_for_form(function, &form, global.locked, to);
        }
        if self.inline(&global, &form, to) {
            return Ok(());
        }
        if let Some(compiler_macro) = environment.property(&form.operator, &Symbol::esl("%COMPILER-MACRO"))
            && let Some(compiler_macro) = compiler_macro.as_symbol()
            && !self
                .scope
                .is_written(&form.operator)
                .unwrap_or_else(|| environment.property(&form.operator, &Symbol::esl("%NOTINLINE")).is_some())
        {
            let function = MacroRef::Global(compiler_macro.clone());
            let waiting = |origin| AwaitedOutcome::Call(form.clone(), To { origin, ..to });
            return self.stop_for_macro(function, &form, true, to.origin, waiting);
        }
        if global.locked && global.instead.is_some() {
            // The arguments need not be forms. They are left out of the call, which fails in any case.
            let place = self.place_of_use(form.span, to.origin);
            self.globals.note_reference(FunctionName::plain(&form.operator), place);
            self.fill(to, NodeKind::Call(Callee::Global(form.operator.clone()), Vec::new()));
            return Ok(());
        }
        let named = form.datum.as_cons().map_or(&form.datum, |(head, _)| head);
        let function = WrittenName::symbol(&form.operator, named.clone());
        self.call(environment, FunctionDesignator::Global(function), &form.args, &form, to)
    }

    /// Stops for the expansion of a macro call in a form.
    fn stop_for_form(&mut self, function: MacroRef, form: &Form, is_standard: bool, to: To) -> Checked {
        let waiting = |origin| AwaitedOutcome::Form(To { origin, ..to });
        self.stop_for_macro(function, form, is_standard, to.origin, waiting)
    }

    /// Opens up calls that have nodes of their own: accessors of structures, and the functions they are
    /// defined with.
    fn inline(&mut self, global: &Global, form: &Form, to: To) -> bool {
        let kind = match (&global.accessor, form.args.as_slice()) {
            (Some(accessor), [instance]) => {
                let (node, job) = self.part(instance.clone(), to);
                self.schedule([job]);
                NodeKind::Slot(accessor.class.clone(), accessor.slot, node)
            }
            _ => match (Builtin::named(&form.operator), form.args.as_slice()) {
                (Some(Builtin::SlotOf), [class, index, instance]) => {
                    let Some((class, index)) = slot(class, index) else { return false };
                    let (node, job) = self.part(instance.clone(), to);
                    self.schedule([job]);
                    NodeKind::Slot(class, index, node)
                }
                (Some(Builtin::SetSlotOf), [class, index, instance, value]) => {
                    let Some((class, index)) = slot(class, index) else { return false };
                    let (instance, first) = self.part(instance.clone(), to);
                    let (value, second) = self.part(value.clone(), to);
                    self.schedule([first, second]);
                    NodeKind::SetSlot(class, index, instance, value)
                }
                (Some(Builtin::IsInstance), [class, object]) => {
                    let Some(class) = quoted_symbol(class) else { return false };
                    let (node, job) = self.part(object.clone(), to);
                    self.schedule([job]);
                    NodeKind::IsInstance(class, node)
                }
                _ => return false,
            },
        };
        self.fill(to, kind);
        true
    }

    /// Whether `symbol` names a global macro.
    pub(super) fn is_macro(&self, environment: &dyn Environment, symbol: &Symbol) -> bool {
        environment.global(symbol).function == GlobalFunction::Macro
    }

    /// Expands a call with arguments.
    fn call(
        &mut self,
        environment: &mut dyn Environment,
        target: FunctionDesignator,
        args: &[Datum],
        form: &Form,
        to: To,
    ) -> Checked {
        let count = args.len();
        let (callee, mut jobs) = match target {
            FunctionDesignator::Local(variable, LocalSignature { arity, keys }) => {
                self.note_read(variable, to);
                if !accepts(arity, u32::try_from(count).unwrap_or(u32::MAX)) {
                    let function = name(&self.core().variables[variable.index()].name);
                    self.report(wrong_count(&function, arity, count as u32, to.span), to.origin);
                } else if let Some(keys) = keys {
                    let function = name(&self.core().variables[variable.index()].name);
                    if let Some(warning) = wrong_key(&function, &keys, args, form) {
                        self.report(warning, to.origin);
                    }
                }
                (Callee::Local(variable), Vec::new())
            }
            FunctionDesignator::Global(function) => {
                (self.global_callee(environment, &function, Some(args), form, to)?, Vec::new())
            }
            FunctionDesignator::Named(function) => (named_callee(&function, Some(count)), Vec::new()),
            FunctionDesignator::Form(function) => {
                let (node, job) = self.part(function, to);
                (Callee::Value(node), vec![job])
            }
        };
        let is_direct = count <= DIRECT_ARGUMENTS;
        let args = if is_direct { args.to_vec() } else { spread(args, Make(to.span)) };
        let (nodes, arguments) = self.children(args, to);
        jobs.extend(arguments);
        let kind = if is_direct { NodeKind::Call(callee, nodes) } else { NodeKind::Apply(callee, nodes) };
        self.fill(to, kind);
        self.schedule(jobs);
        Ok(())
    }

    /// Returns the global function `function` as a callee. `args` are all arguments, if these are known.
    fn global_callee(
        &mut self,
        environment: &mut dyn Environment,
        function: &WrittenName,
        args: Option<&[Datum]>,
        form: &Form,
        to: To,
    ) -> Checked<Callee> {
        function.check_callable(form)?;
        let builtin = if function.name.is_setf { None } else { Builtin::named(&function.cell) };
        let Some(builtin) = builtin else {
            let name = self.place_of_use(form.at(function.datum.span()), to.origin);
            match args {
                None => self.globals.note_reference(function.name.clone(), name),
                Some(args) => {
                    let constants = args.iter().enumerate().filter(|(_, datum)| is_checked_constant(datum));
                    let constants = constants.map(|(index, datum)| (index as u32, datum.clone())).collect();
                    self.globals.note_call(PendingCall {
                        function: function.name.clone(),
                        arguments: Some(u32::try_from(args.len()).unwrap_or(u32::MAX)),
                        constants,
                        infix: infix(function.datum.as_symbol().map(|_| &function.datum), args, to.span)
                            .map(Box::new),
                        is_guarded: self.is_guarded(to.span),
                        name,
                        span: to.span,
                    });
                }
            }
            return Ok(Callee::Global(function.cell.clone()));
        };
        let arity = builtin.info().arity;
        let Some(args) = args else { return Ok(Callee::Builtin(builtin)) };
        let count = u32::try_from(args.len()).unwrap_or(u32::MAX);
        if !accepts(arity, count) {
            let warning = wrong_count(&function.name.shown(), arity, count, to.span);
            let list = environment.signature(&function.cell);
            let called =
                list.map(|known| format!("it is called as {}", usage(&function.cell, &known.lambda_list)));
            self.report(called.into_iter().fold(warning, |warning, help| warning.help(help)), to.origin);
            return Ok(Callee::Global(function.cell.clone()));
        }
        self.check_constants(environment, builtin, args, form, to);
        self.check_defining(environment, builtin, form, to)?;
        Ok(Callee::Builtin(builtin))
    }

    /// Warns of the first constant argument that a builtin refuses, unless the failure is handled.
    fn check_constants(
        &mut self,
        environment: &dyn Environment,
        builtin: Builtin,
        args: &[Datum],
        form: &Form,
        to: To,
    ) {
        let Some((argument, what)) = refused(builtin, args) else { return };
        if self.is_guarded(to.span) || !is_known(self.origins.written(form.datum.span(), to.origin)) {
            return;
        }
        let function = builtin.symbol();
        let warning =
            code::WRONG_ARGUMENT.at(form.at(argument.span()), format!("{} takes {what}", name(&function)));
        let known = environment.signature(&function);
        let called = known.map(|known| format!("it is called as {}", usage(&function, &known.lambda_list)));
        self.report(called.into_iter().fold(warning, |warning, help| warning.help(help)), to.origin);
    }

    /// Expands `((lambda …) …)`.
    pub(super) fn expand_lambda_call(
        &mut self,
        environment: &mut dyn Environment,
        form: Form,
        to: To,
    ) -> Checked {
        let Some((lambda, _)) = form.datum.as_cons() else {
            return Err(form.malformed("is called without being a function"));
        };
        let lambda = lambda.clone();
        self.lambda_call(environment, &lambda, &form.args, &form, to)
    }

    /// Expands a call of a `lambda` expression: a `let`, if the lambda list is plain.
    fn lambda_call(
        &mut self,
        environment: &mut dyn Environment,
        lambda: &Datum,
        args: &[Datum],
        form: &Form,
        to: To,
    ) -> Checked {
        let parts = arguments(lambda).unwrap_or_default();
        let Some((list, body)) = parts.split_first() else {
            return Err(form.fault(code::MISSING_PART, lambda.span(), "needs a lambda list"));
        };
        let parsed = LambdaList::parse(list, LambdaListKind::Ordinary, form.at(list.span()))?;
        let arity = parsed.arity();
        if !accepts(arity, u32::try_from(args.len()).unwrap_or(u32::MAX)) {
            self.report(wrong_count("this function", arity, args.len() as u32, to.span), to.origin);
        } else if arity.max == Some(arity.min) && parsed.aux.is_empty() && args.len() <= DIRECT_ARGUMENTS {
            let make = Make(lambda.span());
            let is_documented = body.len() > 1 && matches!(body[0].kind(), DatumKind::String(_));
            let body = &body[usize::from(is_documented)..];
            let bindings = parsed.required.into_iter().zip(args.iter().cloned());
            let bindings = make.items(bindings.map(|(name, value)| make.list([name, value])));
            let form = make.cl("LET", std::iter::once(bindings).chain(body.iter().cloned()));
            self.schedule([Job::Expand(form, to)]);
            return Ok(());
        }
        self.call(environment, FunctionDesignator::Form(lambda.clone()), args, form, to)
    }

    /// Returns what the function argument of `funcall` or `apply` designates.
    fn function_argument(
        &self,
        environment: &dyn Environment,
        argument: &Datum,
        form: &Form,
    ) -> Checked<FunctionDesignator> {
        let other = || Ok(FunctionDesignator::Form(argument.clone()));
        let is_function = is_cl_form(argument, "FUNCTION");
        if !is_function && !is_cl_form(argument, "QUOTE") {
            return other();
        }
        let named = arguments(argument).unwrap_or_default();
        let [named] = named.as_slice() else { return other() };
        let Some(function) = WrittenName::of(named) else { return other() };
        if is_function {
            match self.scope.function(&function.cell, self.level()) {
                Visible::Is(FunctionMeaning::Local(variable, signature)) => {
                    return Ok(FunctionDesignator::Local(variable, signature));
                }
                Visible::Is(FunctionMeaning::Macro(_)) => return other(),
                Visible::OutOfReach => return Err(function.out_of_reach(form)),
                Visible::No => {}
            }
        } else if function.name.is_setf || function.cell.is_cl("T") {
            return other();
        }
        let is_operator = !function.name.is_setf
            && Builtin::named(&function.cell).is_none()
            && (self.is_operator(&function.cell) || self.is_macro(environment, &function.cell));
        Ok(match (is_operator, is_function) {
            (true, _) => FunctionDesignator::Form(argument.clone()),
            (false, true) => FunctionDesignator::Global(function),
            (false, false) => FunctionDesignator::Named(function),
        })
    }
}

/// Returns what a symbol names when the call is made. A builtin cannot change until then.
fn named_callee(function: &WrittenName, count: Option<usize>) -> Callee {
    let fits = |builtin: &Builtin| {
        count.is_none_or(|count| accepts(builtin.info().arity, u32::try_from(count).unwrap_or(u32::MAX)))
    };
    match Builtin::named(&function.cell).filter(fits) {
        Some(builtin) => Callee::Builtin(builtin),
        None => Callee::Global(function.cell.clone()),
    }
}

/// Returns the arguments of a call that passes most of them in a list, its last argument:
/// `a … (list* b … (list z …))`.
fn spread(args: &[Datum], make: Make) -> Vec<Datum> {
    let (direct, rest) = args.split_at(DIRECT_ARGUMENTS / 2);
    let mut chunks = rest.rchunks(DIRECT_ARGUMENTS - 1);
    let last = chunks.next().unwrap_or_default();
    let mut list = make.call_cl("LIST", last.iter().cloned());
    for chunk in chunks {
        list = make.call_cl("LIST*", chunk.iter().cloned().chain([list]));
    }
    direct.iter().cloned().chain([list]).collect()
}

/// Returns a class and an index, if they are a quoted symbol and a literal.
fn slot(class: &Datum, index: &Datum) -> Option<(Symbol, u16)> {
    let index = match index.kind() {
        DatumKind::Integer(index) => u16::try_from(index).ok()?,
        _ => return None,
    };
    Some((quoted_symbol(class)?, index))
}

/// Returns the symbol that a form quotes.
pub(super) fn quoted_symbol(form: &Datum) -> Option<Symbol> {
    if !is_cl_form(form, "QUOTE") {
        return None;
    }
    constant_value(form)?.as_symbol().cloned()
}

/// `(funcall function argument*)`
pub(super) fn funcall(
    expander: &mut Expander,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    let Some((function, args)) = form.args.split_first() else {
        return as_function(expander, environment, &form, to);
    };
    if let Some(lambda) = lambda_expression(function) {
        return expander.lambda_call(environment, &lambda, args, &form, to);
    }
    let target = expander.function_argument(environment, function, &form)?;
    expander.call(environment, target, args, &form, to)
}

/// `(apply function argument* list)`
pub(super) fn apply(
    expander: &mut Expander,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    if form.args.len() < 2 || form.args.len() > DIRECT_ARGUMENTS {
        return as_function(expander, environment, &form, to);
    }
    let (callee, mut jobs) = match expander.function_argument(environment, &form.args[0], &form)? {
        FunctionDesignator::Local(variable, _) => {
            expander.note_read(variable, to);
            (Callee::Local(variable), Vec::new())
        }
        FunctionDesignator::Global(function) => {
            (expander.global_callee(environment, &function, None, &form, to)?, Vec::new())
        }
        FunctionDesignator::Named(function) => (named_callee(&function, None), Vec::new()),
        FunctionDesignator::Form(function) => {
            let (node, job) = expander.part(function, to);
            (Callee::Value(node), vec![job])
        }
    };
    let (nodes, arguments) = expander.children(form.args[1..].to_vec(), to);
    jobs.extend(arguments);
    expander.fill(to, NodeKind::Apply(callee, nodes));
    expander.schedule(jobs);
    Ok(())
}

/// Expands a call of `funcall` or `apply` as one of an ordinary function.
fn as_function(expander: &mut Expander, environment: &mut dyn Environment, form: &Form, to: To) -> Checked {
    let function = WrittenName::symbol(&form.operator, Make(form.span).symbol(&form.operator));
    expander.call(environment, FunctionDesignator::Global(function), &form.args, form, to)
}

/// Returns the `lambda` expression that a form is or quotes by `#'`.
fn lambda_expression(form: &Datum) -> Option<Datum> {
    if is_cl_form(form, "LAMBDA") {
        return Some(form.clone());
    }
    if !is_cl_form(form, "FUNCTION") {
        return None;
    }
    let named = arguments(form)?;
    match named.as_slice() {
        [lambda] if is_cl_form(lambda, "LAMBDA") => Some(lambda.clone()),
        _ => None,
    }
}

/// `(%call-global name argument*)`: calls the global function of that name, even where a local one has it.
pub(super) fn call_global(
    expander: &mut Expander,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    let shape = "needs the name of a function";
    let Some((named, args)) = form.args.split_first() else { return Err(form.missing(shape)) };
    let Some(function) = WrittenName::of(named) else { return Err(form.not_a_name(named, shape)) };
    if !function.name.is_setf {
        let call = Form { operator: function.cell.clone(), args: args.to_vec(), ..form.clone() };
        let global = environment.global(&function.cell);
        if expander.inline(&global, &call, to) {
            return Ok(());
        }
    }
    expander.call(environment, FunctionDesignator::Global(function), args, &form, to)
}

/// `(%apply-global name argument* list)`: as `%call-global`; the last argument is a list of arguments.
pub(super) fn apply_global(
    expander: &mut Expander,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    form.takes(2..=DIRECT_ARGUMENTS, "needs the name of a function and a list of arguments")?;
    let Some(function) = WrittenName::of(&form.args[0]) else {
        return Err(form.not_a_name(&form.args[0], "needs the name of a function"));
    };
    let callee = expander.global_callee(environment, &function, None, &form, to)?;
    let (nodes, jobs): (Vec<NodeId>, Vec<Job>) = expander.children(form.args[1..].to_vec(), to);
    expander.fill(to, NodeKind::Apply(callee, nodes));
    expander.schedule(jobs);
    Ok(())
}
