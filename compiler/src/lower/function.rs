//! Lowering one function: its entry, and the dispatch over kinds of forms.

use esl_bytecode::compile::Work;
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::diagnostic::Diagnostic;
use esl_bytecode::module::{ModuleFunction, Parameters, PoolIdx, VariablePlace, VariableRange};
use esl_bytecode::opcode::Instr;
use esl_bytecode::operand::{ConstIdx, Count, PassIdx, Reg};
use esl_bytecode::symbol::{ESL_PACKAGE, Symbol};

use super::arithmetic::small_integer;
use super::assemble::{AssembledCode, assemble};
use super::builder::{Excess, FunctionBuilder, ModuleBuilder, OversizedFunction};
use super::dest::Dest;
use super::fuse;
use super::graph::Cond;
use crate::core::*;
use crate::diagnostic::code;
use crate::resolve::Lexical;

/// Native stack that one form may take before [`FunctionBuilder::form`] is called again, in bytes.
const RED_ZONE: usize = 96 * 1024;
/// Native stack that is added when less than that is left, in bytes.
const STACK: usize = 1024 * 1024;

/// Largest number of parameters: each needs a register when the function begins.
const MAX_PARAMETERS: usize = 255;

/// Words of code that count as a unit of work.
const WORDS_PER_UNIT: u64 = 2;

impl ModuleBuilder<'_> {
    /// Lowers functions, beginning with the form itself, and adds them to `functions`. Returns whether these
    /// are all; otherwise the work that is allowed is done.
    pub(super) fn functions(&mut self, functions: &mut Vec<ModuleFunction>, work: &mut Work) -> bool {
        self.number(LambdaId(0));
        // Functions get their numbers when code that refers to them is lowered, and are lowered in that
        // order.
        while let Some(&lambda) = self.numbered.get(functions.len()) {
            if work.is_done() {
                return false;
            }
            let function = self.function(lambda);
            work.add(1 + function.code.len() as u64 / WORDS_PER_UNIT);
            functions.push(function);
        }
        for (function, lambda) in functions.iter_mut().zip(&self.numbered) {
            function.captures = std::mem::take(&mut self.captures[lambda.index()]);
        }
        true
    }

    /// Lowers the function of a lambda. Its captures are left open.
    fn function(&mut self, lambda: LambdaId) -> ModuleFunction {
        let text = &self.core.lambdas[lambda.index()];
        let has_too_many_parameters = text.parameters() > MAX_PARAMETERS;
        if has_too_many_parameters {
            let diagnostic =
                too_large(text, "parameters").help("take the rest of them as a list, with `&rest`");
            self.oversized.push(OversizedFunction {
                lambda,
                has_too_many_parameters,
                has_many_captures: false,
                diagnostic,
            });
            return ModuleFunction::default();
        }
        let mut builder = FunctionBuilder::new(self, lambda);
        let parameters = builder.parameters(text);
        builder.form_inside(text.body, Dest::Tail, 0);
        builder.finish_spill();
        fuse::improve(&mut builder.graph);
        // Even a function without registers has one, for instructions that name an empty range.
        builder.registers.reserve(Reg(0), 1);
        let assembled = {
            let name = |variable: VarId| &builder.core.variables[variable.index()].name;
            let is_shown = |variable| is_shown(name(variable));
            let have_one_name =
                |one, other| name(one).name() == name(other).name() && is_shown(one) && is_shown(other);
            assemble(&builder.graph, builder.module.lines, have_one_name)
        };
        let has_many_captures = builder.excess == Some(Excess::Captures);
        if builder.registers.has_overflowed() {
            builder.excess = Some(Excess::Registers);
        }
        let code = assembled.unwrap_or_else(|_| {
            builder.excess = builder.excess.or(Some(Excess::Instructions));
            Default::default()
        });
        let (registers, constants, excess) = (builder.registers.used(), builder.constants, builder.excess);
        if let Some(excess) = excess {
            let diagnostic = too_large(text, excess.what()).help("divide it into several functions");
            self.oversized.push(OversizedFunction {
                lambda,
                has_too_many_parameters,
                has_many_captures,
                diagnostic,
            });
        }
        let variables = self.variable_ranges(lambda, &code);
        let AssembledCode { words: code, lines, .. } = code;
        let mut datum = |datum: &Option<Datum>| datum.as_ref().map(|datum| self.pool.datum(datum));
        ModuleFunction {
            name: datum(&text.name),
            lambda_list: datum(&text.lambda_list),
            documentation: datum(&text.documentation),
            parameters,
            registers,
            captures: Vec::new(),
            constants,
            code,
            lines,
            variables,
        }
    }

    /// Returns where the variables of a lambda's function are that the program has named.
    fn variable_ranges(&self, lambda: LambdaId, code: &AssembledCode) -> Vec<VariableRange> {
        let range = |variable: VarId, place, from, to| {
            let name = &self.core.variables[variable.index()].name;
            is_shown(name).then(|| VariableRange { name: name.name().into(), place, from, to })
        };
        let captures = self.resolution.captures(lambda).iter().enumerate().filter_map(|(index, lexical)| {
            let Lexical::Variable(variable) = *lexical else { return None };
            let place = VariablePlace::Capture(u8::try_from(index).ok()?);
            let is_function = self.resolution.function(variable).is_some();
            if is_function { None } else { range(variable, place, 0, code.words.len() as u32) }
        });
        let registers = code.variables.iter().filter_map(|&(variable, register, from, to)| {
            range(variable, VariablePlace::Register(register.0), from, to)
        });
        captures.chain(registers).collect()
    }
}

/// Returns whether debuggers show a variable of this name: one that the program has named, and not a macro.
fn is_shown(name: &Symbol) -> bool {
    name.package().is_some() && !(name.name().starts_with('%') && name.is_in(ESL_PACKAGE))
}

/// Returns the diagnostic for a function that has too much of something.
fn too_large(text: &Lambda, what: &str) -> Diagnostic {
    code::FUNCTION_TOO_LARGE.at(text.span, "this function is too large").label(format!("has too many {what}"))
}

impl<'a> FunctionBuilder<'_, 'a> {
    /// Lowers a form inside the extents from `depth` on, which are closed after it.
    pub(super) fn form_inside(&mut self, body: NodeId, dest: Dest, depth: usize) {
        if self.extents.len() == depth {
            return self.form(body, dest);
        }
        let inner = self.inner(dest, self.module.resolution.is_single(body));
        self.form(body, inner);
        self.close(depth);
        self.finish(inner, dest);
    }

    /// Lowers a constant.
    pub(super) fn constant(&mut self, datum: &Datum, dest: Dest) {
        match datum.kind() {
            DatumKind::Nil => self.deliver_nil(dest),
            DatumKind::Symbol(symbol) if symbol.is_cl("T") => self.deliver_true(dest),
            _ => match dest {
                Dest::Effect => {}
                Dest::Test { holds, .. } => self.jump(holds),
                _ => {
                    if let Some(value) = small_integer(datum) {
                        return self.compute(dest, |dst| Instr::LoadInt { dst, value });
                    }
                    let entry = self.module.pool.datum(datum);
                    let constant = ConstIdx(self.constant_index(entry));
                    self.compute(dest, |dst| Instr::LoadConst { dst, constant });
                }
            },
        }
    }

    /// Lowers `node` to `dest`. The registers in use are the same afterwards.
    pub(super) fn form(&mut self, node: NodeId, dest: Dest) {
        // The depth of the recursion is that of the core tree.
        stacker::maybe_grow(RED_ZONE, STACK, || {
            let node = &self.core.nodes[node.index()];
            let span = std::mem::replace(&mut self.span, node.span);
            let top = self.registers.top();
            self.form_of(&node.kind, dest);
            debug_assert_eq!(top, self.registers.top(), "registers are given back");
            self.span = span;
        });
    }

    fn form_of(&mut self, kind: &'a NodeKind, dest: Dest) {
        match kind {
            NodeKind::Hole => unreachable!("the expander fills every hole"),
            NodeKind::Constant(datum) => self.constant(datum, dest),
            NodeKind::Local(variable) => self.local(*variable, dest),
            NodeKind::SetLocal(variable, value) => self.set_local(*variable, *value, dest),
            NodeKind::Special(symbol) => self.special(symbol, dest),
            NodeKind::SetSpecial(symbol, value) => self.set_special(symbol, *value, dest),
            NodeKind::FunctionRef(symbol) => self.function_ref(symbol, dest),
            NodeKind::BuiltinRef(builtin) => self.builtin_ref(*builtin, dest),
            NodeKind::Lambda(lambda) => self.lambda(*lambda, dest),
            NodeKind::If(test, consequent, alternative) => {
                self.if_form(*test, *consequent, *alternative, dest)
            }
            NodeKind::Progn(forms) => self.progn(forms, dest),
            NodeKind::And(forms) => self.and(forms, dest),
            NodeKind::Or(forms) => self.or(forms, dest),
            NodeKind::Let { sequential, bindings, body } => self.let_form(*sequential, bindings, *body, dest),
            NodeKind::Functions { definitions, body } => self.functions(definitions, *body, dest),
            NodeKind::Block(block, body) => self.block(*block, *body, dest),
            NodeKind::ReturnFrom(block, value) => self.return_from(*block, *value, dest),
            NodeKind::Tagbody(tagbody, items) => self.tagbody(*tagbody, items, dest),
            NodeKind::Go(tagbody, tag) => self.go(*tagbody, *tag, dest),
            NodeKind::Catch(tag, body) => self.catch(*tag, *body, dest),
            NodeKind::Throw(tag, values) => self.throw(*tag, *values, dest),
            NodeKind::UnwindProtect(protected, cleanup) => self.unwind_protect(*protected, *cleanup, dest),
            NodeKind::Progv(symbols, values, body) => self.progv(*symbols, *values, *body, dest),
            NodeKind::Call(callee, arguments) => self.call(callee, arguments, dest),
            NodeKind::Apply(callee, arguments) => self.apply(callee, arguments, dest),
            NodeKind::Values(forms) => self.values(forms, dest),
            NodeKind::BindValues(targets, form, body) => self.bind_values(targets, *form, *body, dest),
            NodeKind::CallValues(function, forms) => self.call_values(*function, forms, dest),
            NodeKind::FirstValues(first, second) => self.first_values(*first, *second, dest),
            NodeKind::HandlerCase(body, clauses) => self.handler_case(*body, clauses, dest),
            NodeKind::Recovery { table, procedures, body } => self.recovery(*table, *procedures, *body, dest),
            NodeKind::FailureCleanup(body, cleanup) => self.failure_cleanup(*body, *cleanup, dest),
            NodeKind::Handlers(handlers, body) => self.handlers(*handlers, *body, dest),
            NodeKind::Mask(from, body) => self.mask(*from, *body, dest),
            NodeKind::Slot(class, slot, instance) => self.slot(class, *slot, *instance, dest),
            NodeKind::SetSlot(class, slot, instance, value) => {
                self.set_slot(class, *slot, *instance, *value, dest)
            }
            NodeKind::IsInstance(class, object) => self.is_instance(class, *object, dest),
            NodeKind::Pass(place) => {
                self.emit(Instr::Pass { place: PassIdx(*place) });
                self.deliver_nil(dest);
            }
        }
    }

    /// Lowers forms for effect, and the last one to `dest`.
    pub(super) fn progn(&mut self, forms: &[NodeId], dest: Dest) {
        let Some((&last, others)) = forms.split_last() else { return self.deliver_nil(dest) };
        for &form in others {
            self.form(form, Dest::Effect);
        }
        self.form(last, dest);
    }

    /// Assigns registers to the parameters and lowers the entry: defaults, boxes and special bindings, in
    /// order.
    fn parameters(&mut self, text: &'a Lambda) -> Parameters {
        let keys = text.keys.as_deref().unwrap_or_default();
        let optional = text.optional.iter().map(|optional| optional.parameter);
        let in_registers = (text.required.iter().copied()).chain(optional).chain(text.rest);
        for parameter in in_registers.chain(keys.iter().map(|key| key.optional.parameter)) {
            self.module.variables[parameter.variable.index()] = self.registers.take(1);
        }
        // The others have no value yet.
        for parameter in text.required.iter().copied().chain(text.rest) {
            self.name_parameter(parameter);
        }
        self.entry_scope = self.graph.scopes.current;
        if self.module.spills_from.is_some() {
            self.make_spill();
        }
        for &parameter in &text.required {
            self.settle(parameter);
        }
        for optional in &text.optional {
            self.optional(optional);
        }
        if let Some(rest) = text.rest {
            self.settle(rest);
        }
        for key in keys {
            self.optional(&key.optional);
        }
        let names = keys.iter().map(|key| self.module.pool.symbol(&key.key));
        let names: Vec<PoolIdx> = names.collect();
        Parameters {
            required: text.required.len().min(255) as u8,
            optional: text.optional.len().min(255) as u8,
            rest: text.rest.is_some(),
            keys: text.keys.is_some().then_some(names),
            allow_other_keys: text.allow_other_keys,
        }
    }

    fn optional(&mut self, optional: &OptionalParameter) {
        let register = self.register(optional.parameter.variable);
        let resolution = &self.module.resolution;
        let supplied = optional.supplied.filter(|flag| flag.is_special || resolution.is_used(flag.variable));
        let supplied = supplied.map(|supplied| {
            let flag = self.registers.take(1);
            self.module.variables[supplied.variable.index()] = flag;
            self.emit(Instr::LoadTrue { dst: flag.into() });
            (supplied, flag)
        });
        let (missing, end) = (self.graph.label(), self.graph.label());
        self.branch(Cond::Supplied(register), end, missing);
        self.graph.bind(missing);
        self.form(optional.default, Dest::Keep(register));
        if let Some((_, flag)) = supplied {
            self.emit(Instr::LoadNil { first: flag.into(), count: Count(1) });
        }
        self.graph.bind(end);
        self.name_parameter(optional.parameter);
        self.settle(optional.parameter);
        if let Some((supplied, _)) = supplied {
            self.name_parameter(supplied);
            self.settle(supplied);
        }
    }

    /// Notes that a parameter has its value, for debuggers.
    pub(super) fn name_parameter(&mut self, parameter: Parameter) {
        if !parameter.is_special {
            self.graph.scopes.add(parameter.variable, self.register(parameter.variable));
        }
    }

    /// Boxes or binds a parameter that has its value.
    pub(super) fn settle(&mut self, parameter: Parameter) {
        let register = self.register(parameter.variable);
        if parameter.is_special {
            let name = &self.core.variables[parameter.variable.index()].name;
            self.bind_special(name, register);
        } else {
            self.box_variable(parameter.variable);
        }
    }
}
