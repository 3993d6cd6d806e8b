//! Calls: of local functions, builtins, global functions, and of what a form evaluates to.

use std::sync::LazyLock;

use esl_bytecode::builtin::{BUILTINS, Builtin};
use esl_bytecode::compile::{Arity, Environment, Global, GlobalFunction, MacroRef};
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::symbol::Symbol;
use rustc_hash::FxHashMap;

use super::form::{Checked, Form, Make, arguments, constant_value, is_cl_form, name};
use super::lambda::{FunctionName, out_of_reach};
use super::lambda_list::{Kind, LambdaList};
use super::machine::{Job, Machine, To};
use super::scope::{Function, Visible};
use super::unit::{Name, accepts, wrong_count};
use crate::core::{Callee, NodeId, NodeKind};
use crate::diagnostic::code;

/// The builtins by name.
static BY_NAME: LazyLock<FxHashMap<Symbol, Builtin>> = LazyLock::new(|| {
    let symbols = BUILTINS.iter().map(|info| (Symbol::new(&info.package().into(), info.name), info.builtin));
    symbols.collect()
});

/// The builtin that `symbol` names.
pub(super) fn builtin(symbol: &Symbol) -> Option<Builtin> {
    BY_NAME.get(symbol).copied()
}

/// How many arguments a call passes in registers. Of more, the rest goes as a list.
pub(super) const DIRECT_ARGUMENTS: usize = 60;

/// What is called, as far as its name tells.
enum Target {
    Local(crate::core::VarId, Arity),
    /// A global function, by name.
    Global(FunctionName),
    /// The function that a symbol names when the call is made: nothing can be said of it before.
    Named(FunctionName),
    /// What a form evaluates to.
    Form(Datum),
}

impl Machine {
    /// Expands a form that begins with a symbol.
    pub(super) fn expand_operation(
        &mut self,
        environment: &mut dyn Environment,
        form: Form,
        to: To,
    ) -> Checked {
        match self.scope.function(&form.operator, self.level()) {
            Visible::Is(Function::Local(variable, arity)) => {
                self.call(environment, Target::Local(variable, arity), &form.args, &form, to)
            }
            Visible::Is(Function::Macro(Some(function))) => {
                self.stop_for_form(MacroRef::Local(function), &form, false, to)
            }
            Visible::Is(Function::Macro(None)) => {
                self.fill(to, NodeKind::Constant(Datum::nil(to.span)));
                Ok(())
            }
            Visible::OutOfReach => {
                let function = FunctionName::of(&Make(form.span).symbol(&form.operator));
                Err(out_of_reach(&form, &function.expect("a symbol names a function")))
            }
            Visible::No => match super::operator::find(&form.operator) {
                Some(operator) => operator(self, environment, form, to),
                None => self.global_operation(environment, form, to),
            },
        }
    }

    fn global_operation(&mut self, environment: &mut dyn Environment, form: Form, to: To) -> Checked {
        let global = environment.global(&form.operator);
        if self.unit.is_broken_macro(&form.operator) {
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
        {
            return self.stop_for_call(compiler_macro.clone(), form, to);
        }
        if global.locked && global.instead.is_some() {
            // What stands in it need not be forms: it is left out of the call, which fails in any case.
            self.unit.note_call(Name::plain(&form.operator), None, form.span, form.span);
            self.fill(to, NodeKind::Call(Callee::Global(form.operator.clone()), Vec::new()));
            return Ok(());
        }
        let named = form.datum.as_cons().map_or(&form.datum, |(head, _)| head);
        let function = FunctionName::of(named).expect("a symbol names a function");
        self.call(environment, Target::Global(function), &form.args, &form, to)
    }

    /// Opens up calls that have nodes of their own: accessors of structures, and what they are defined with.
    fn inline(&mut self, global: &Global, form: &Form, to: To) -> bool {
        let kind = match (&global.accessor, form.args.as_slice()) {
            (Some(accessor), [instance]) => {
                let (node, job) = self.part(instance.clone(), to);
                self.schedule([job]);
                NodeKind::Slot(accessor.class.clone(), accessor.slot, node)
            }
            _ => match (builtin(&form.operator), form.args.as_slice()) {
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
        target: Target,
        args: &[Datum],
        form: &Form,
        to: To,
    ) -> Checked {
        let count = args.len();
        let (callee, mut jobs) = match target {
            Target::Local(variable, arity) => {
                self.note_read(variable, to);
                if !accepts(arity, u32::try_from(count).unwrap_or(u32::MAX)) {
                    let function = name(&self.core().variables[variable.index()].name);
                    self.report(wrong_count(&function, arity, count as u32, to.span), to.origin);
                }
                (Callee::Local(variable), Vec::new())
            }
            Target::Global(function) => {
                (self.global_callee(environment, &function, Some(count), form, to)?, Vec::new())
            }
            Target::Named(function) => (named_callee(&function, Some(count)), Vec::new()),
            Target::Form(function) => {
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

    /// The global function called `function`; with the number of its arguments if that is known.
    fn global_callee(
        &mut self,
        environment: &mut dyn Environment,
        function: &FunctionName,
        count: Option<usize>,
        form: &Form,
        to: To,
    ) -> Checked<Callee> {
        check_names_function(function, form)?;
        let builtin = if function.name.is_setf { None } else { builtin(&function.cell) };
        let Some(builtin) = builtin else {
            let named = form.at(function.datum.span());
            self.unit.note_call(function.name.clone(), count, named, to.span);
            return Ok(Callee::Global(function.cell.clone()));
        };
        let arity = builtin.info().arity;
        let Some(count) = count.map(|count| u32::try_from(count).unwrap_or(u32::MAX)) else {
            return Ok(Callee::Builtin(builtin));
        };
        if !accepts(arity, count) {
            self.report(wrong_count(&function.name.shown(), arity, count, to.span), to.origin);
            return Ok(Callee::Global(function.cell.clone()));
        }
        self.check_defining(environment, builtin, form)?;
        Ok(Callee::Builtin(builtin))
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
            return Err(form.malformed_at(lambda.span(), "needs a lambda list"));
        };
        let parsed = LambdaList::parse(list, Kind::Ordinary, form.at(list.span()))?;
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
        self.call(environment, Target::Form(lambda.clone()), args, form, to)
    }

    /// What the function argument of `funcall` or `apply` stands for.
    fn function_argument(
        &self,
        environment: &dyn Environment,
        argument: &Datum,
        form: &Form,
    ) -> Checked<Target> {
        let other = || Ok(Target::Form(argument.clone()));
        let is_function = is_cl_form(argument, "FUNCTION");
        if !is_function && !is_cl_form(argument, "QUOTE") {
            return other();
        }
        let named = arguments(argument).unwrap_or_default();
        let [named] = named.as_slice() else { return other() };
        let Some(function) = FunctionName::of(named) else { return other() };
        if is_function {
            match self.scope.function(&function.cell, self.level()) {
                Visible::Is(Function::Local(variable, arity)) => return Ok(Target::Local(variable, arity)),
                Visible::Is(Function::Macro(_)) => return other(),
                Visible::OutOfReach => return Err(out_of_reach(form, &function)),
                Visible::No => {}
            }
        } else if function.name.is_setf || function.cell.is_cl("T") {
            return other();
        }
        let is_operator = !function.name.is_setf
            && builtin(&function.cell).is_none()
            && (super::operator::find(&function.cell).is_some()
                || self.is_macro(environment, &function.cell));
        Ok(match (is_operator, is_function) {
            (true, _) => Target::Form(argument.clone()),
            (false, true) => Target::Global(function),
            (false, false) => Target::Named(function),
        })
    }
}

/// What a symbol names when the call is made. Builtins stay what they are.
fn named_callee(function: &FunctionName, count: Option<usize>) -> Callee {
    let fits = |builtin: &Builtin| {
        count.is_none_or(|count| accepts(builtin.info().arity, u32::try_from(count).unwrap_or(u32::MAX)))
    };
    match builtin(&function.cell).filter(fits) {
        Some(builtin) => Callee::Builtin(builtin),
        None => Callee::Global(function.cell.clone()),
    }
}

/// Refuses `t` as the name of a global function: it is no symbol to the module format.
pub(super) fn check_names_function(function: &FunctionName, form: &Form) -> Checked {
    if function.cell.is_cl("T") {
        let message = "`t` is a constant and cannot be called";
        return Err(Box::new(code::MALFORMED_FORM.at(form.at(function.datum.span()), message)));
    }
    Ok(())
}

/// The arguments of a call that passes most of them in a list, the last argument: `a … (list* b … (list z …))`.
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

/// A quoted class name and a literal index.
fn slot(class: &Datum, index: &Datum) -> Option<(Symbol, u16)> {
    let index = match index.kind() {
        DatumKind::Integer(index) => u16::try_from(index).ok()?,
        _ => return None,
    };
    Some((quoted_symbol(class)?, index))
}

/// The symbol that a form quotes.
pub(super) fn quoted_symbol(form: &Datum) -> Option<Symbol> {
    if !is_cl_form(form, "QUOTE") {
        return None;
    }
    constant_value(form)?.as_symbol().cloned()
}

/// `(funcall function argument*)`
pub(super) fn funcall(
    machine: &mut Machine,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    let Some((function, args)) = form.args.split_first() else {
        return as_function(machine, environment, &form, to);
    };
    if let Some(lambda) = lambda_expression(function) {
        return machine.lambda_call(environment, &lambda, args, &form, to);
    }
    let target = machine.function_argument(environment, function, &form)?;
    machine.call(environment, target, args, &form, to)
}

/// `(apply function argument* list)`
pub(super) fn apply(machine: &mut Machine, environment: &mut dyn Environment, form: Form, to: To) -> Checked {
    if form.args.len() < 2 || form.args.len() > DIRECT_ARGUMENTS {
        return as_function(machine, environment, &form, to);
    }
    let (callee, mut jobs) = match machine.function_argument(environment, &form.args[0], &form)? {
        Target::Local(variable, _) => {
            machine.note_read(variable, to);
            (Callee::Local(variable), Vec::new())
        }
        Target::Global(function) => {
            (machine.global_callee(environment, &function, None, &form, to)?, Vec::new())
        }
        Target::Named(function) => (named_callee(&function, None), Vec::new()),
        Target::Form(function) => {
            let (node, job) = machine.part(function, to);
            (Callee::Value(node), vec![job])
        }
    };
    let (nodes, arguments) = machine.children(form.args[1..].to_vec(), to);
    jobs.extend(arguments);
    machine.fill(to, NodeKind::Apply(callee, nodes));
    machine.schedule(jobs);
    Ok(())
}

/// Expands a call of `funcall` or `apply` as one of an ordinary function.
fn as_function(machine: &mut Machine, environment: &mut dyn Environment, form: &Form, to: To) -> Checked {
    let function =
        FunctionName::of(&Make(form.span).symbol(&form.operator)).expect("a symbol names a function");
    machine.call(environment, Target::Global(function), &form.args, form, to)
}

/// The `lambda` expression that a form is or stands for.
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

/// `(%call-global name argument*)`: calls the global function of that name, whatever is local.
pub(super) fn call_global(
    machine: &mut Machine,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    let shape = "needs the name of a function";
    let Some((named, args)) = form.args.split_first() else {
        return Err(form.malformed(shape));
    };
    let Some(function) = FunctionName::of(named) else {
        return Err(form.malformed_at(named.span(), shape));
    };
    if !function.name.is_setf {
        let call = Form { operator: function.cell.clone(), args: args.to_vec(), ..form.clone() };
        let global = environment.global(&function.cell);
        if machine.inline(&global, &call, to) {
            return Ok(());
        }
    }
    machine.call(environment, Target::Global(function), args, &form, to)
}

/// `(%apply-global name argument* list)`: as `%call-global`, the last argument a list of arguments.
pub(super) fn apply_global(
    machine: &mut Machine,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    form.takes(2..=DIRECT_ARGUMENTS, "needs the name of a function and a list of arguments")?;
    let Some(function) = FunctionName::of(&form.args[0]) else {
        return Err(form.malformed_at(form.args[0].span(), "needs the name of a function"));
    };
    let callee = machine.global_callee(environment, &function, None, &form, to)?;
    let (nodes, jobs): (Vec<NodeId>, Vec<Job>) = machine.children(form.args[1..].to_vec(), to);
    machine.fill(to, NodeKind::Apply(callee, nodes));
    machine.schedule(jobs);
    Ok(())
}
