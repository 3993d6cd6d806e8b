//! One function while it is lowered: its state, its entry, and the dispatch over kinds of forms.

use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::module::{Function, MAX_CONTROL, Parameters, PoolIdx};
use esl_bytecode::opcode::Instr;
use esl_bytecode::operand::*;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;
use rustc_hash::FxHashMap;

use super::assemble::assemble;
use super::dest::Dest;
use super::exit::{BlockState, TagbodyState};
use super::fuse;
use super::graph::{Cond, Exit, Graph, Label};
use super::loops::LoopState;
use super::regalloc::Registers;
use super::spill::Spill;
use super::{Builder, Excess};
use crate::core::*;
use crate::diagnostic::code;

/// Native stack that one form may take before [`Frame::form`] is called again.
const RED_ZONE: usize = 96 * 1024;
/// Native stack that is added when there is less.
const STACK: usize = 1024 * 1024;

/// A dynamic extent that is open in the code of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Extent {
    /// A binding of a special variable.
    Binding,
    /// A control entry that may be popped.
    Control,
    /// A cleanup, waiting or running: it is left by throwing only.
    Cleanup,
}

/// A function that is being lowered.
pub(super) struct Frame<'b, 'a> {
    pub(super) builder: &'b mut Builder<'a>,
    pub(super) core: &'a Core,
    /// The lambda whose frame it is.
    pub(super) lambda: LambdaId,
    pub(super) graph: Graph,
    pub(super) entry: Label,
    pub(super) registers: Registers,
    /// The open dynamic extents, the innermost last.
    pub(super) extents: Vec<Extent>,
    /// Blocks, tagbodies and inlined loops around the form, in this frame.
    pub(super) blocks: FxHashMap<BlockId, BlockState>,
    pub(super) tagbodies: FxHashMap<TagbodyId, TagbodyState>,
    pub(super) loops: FxHashMap<LambdaId, LoopState>,
    /// Variables whose values are computed where they are read, once.
    pub(super) substitutes: FxHashMap<VarId, NodeId>,
    /// Where variables go that find no room in the registers.
    pub(super) spill: Option<Spill>,
    /// Variables that share the register of another one.
    pub(super) sharers: FxHashMap<u8, Vec<VarId>>,
    /// Registers of the literals of the loop around the form, if there is one.
    pub(super) literals: Option<FxHashMap<PoolIdx, u8>>,
    /// Where the form was written that is being lowered.
    pub(super) span: Span,
    constants: Vec<PoolIdx>,
    constant_indexes: FxHashMap<PoolIdx, u16>,
    /// What does not fit the format, if anything.
    pub(super) excess: Option<&'static str>,
}

/// Lowers the function of a lambda. Its captures are left open.
pub(super) fn function(builder: &mut Builder<'_>, lambda: LambdaId) -> Function {
    let core = builder.core;
    let text = &core.lambdas[lambda.index()];
    let (graph, entry) = Graph::new();
    let mut frame = Frame {
        builder,
        core,
        lambda,
        graph,
        entry,
        registers: Registers::default(),
        extents: Vec::new(),
        blocks: FxHashMap::default(),
        tagbodies: FxHashMap::default(),
        loops: FxHashMap::default(),
        substitutes: FxHashMap::default(),
        spill: None,
        sharers: FxHashMap::default(),
        literals: None,
        span: text.span,
        constants: Vec::new(),
        constant_indexes: FxHashMap::default(),
        excess: None,
    };
    let parameters = frame.parameters(text);
    frame.form_inside(text.body, Dest::Tail, 0);
    frame.finish_spill();
    fuse::improve(&mut frame.graph);
    // Even a function without registers has one for instructions that name an empty range.
    frame.registers.reserve(0, 1);
    let assembled = assemble(&frame.graph, frame.builder.lines);
    if frame.registers.overflow() {
        frame.excess = Some("variables and intermediate values");
    }
    let (code, lines) = assembled.unwrap_or_else(|_| {
        frame.excess = frame.excess.or(Some("instructions"));
        Default::default()
    });
    let (registers, constants, excess) = (frame.registers.used(), frame.constants, frame.excess);
    if let Some(what) = excess {
        let diagnostic = code::FUNCTION_TOO_LARGE
            .at(text.span, "this function is too large")
            .label(format!("has too many {what}"))
            .help("divide it into several functions");
        builder.excesses.push(Excess { lambda, diagnostic });
    }
    let mut datum = |datum: &Option<Datum>| datum.as_ref().map(|datum| builder.pool.datum(datum));
    Function {
        name: datum(&text.name),
        lambda_list: datum(&text.lambda_list),
        documentation: datum(&text.documentation),
        parameters,
        registers,
        captures: Vec::new(),
        constants,
        code,
        lines,
    }
}

impl<'a> Frame<'_, 'a> {
    /// Appends an instruction.
    pub(super) fn emit(&mut self, instr: Instr) {
        self.graph.push(instr, None, self.span);
    }

    /// Appends an instruction that does not let control past.
    pub(super) fn end(&mut self, instr: Instr) {
        self.emit(instr);
        self.graph.leave(Exit::End, self.span);
    }

    /// Pushes a control entry with a landing.
    pub(super) fn push_entry(&mut self, instr: Instr, landing: Label, extent: Extent) {
        self.graph.push(instr, Some(landing), self.span);
        self.open(extent);
    }

    /// Notes that a dynamic extent has been opened.
    pub(super) fn open(&mut self, extent: Extent) {
        self.extents.push(extent);
        if self.extents.len() > MAX_CONTROL {
            self.excess = Some("nested dynamic extents");
        }
    }

    /// Leaves the extents down to `depth`, in code that goes elsewhere: they stay open for what follows.
    pub(super) fn leave(&mut self, depth: usize) {
        let inside = &self.extents[depth..];
        let entries = inside.iter().filter(|&&extent| extent != Extent::Binding).count();
        let outermost = inside.iter().position(|&extent| extent != Extent::Binding);
        // Popping an entry undoes the bindings inside it.
        let bindings = outermost.unwrap_or(inside.len());
        if entries > 0 {
            self.emit(Instr::PopControl { count: Count(entries.min(255) as u8) });
        }
        if bindings > 0 {
            self.emit(Instr::Unbind { count: Count(bindings.min(255) as u8) });
        }
    }

    /// Leaves and closes the extents down to `depth`.
    pub(super) fn close(&mut self, depth: usize) {
        self.leave(depth);
        self.extents.truncate(depth);
    }

    /// Lowers a form inside the extents from `depth` on, which are closed after it.
    pub(super) fn form_inside(&mut self, body: NodeId, dest: Dest, depth: usize) {
        if self.extents.len() == depth {
            return self.form(body, dest);
        }
        let inner = self.inner(dest, self.builder.resolution.is_single(body));
        self.form(body, inner);
        self.close(depth);
        self.finish(inner, dest);
    }

    /// The index of a pool entry among the function's constants.
    pub(super) fn constant_index(&mut self, entry: PoolIdx) -> u16 {
        if let Some(&index) = self.constant_indexes.get(&entry) {
            return index;
        }
        let index = self.constants.len();
        if index > usize::from(u16::MAX) {
            self.excess = Some("constants");
            return 0;
        }
        self.constants.push(entry);
        self.constant_indexes.insert(entry, index as u16);
        index as u16
    }

    pub(super) fn symbol_index(&mut self, symbol: &Symbol) -> SymbolIdx {
        let entry = self.builder.pool.symbol(symbol);
        SymbolIdx(self.constant_index(entry))
    }

    /// A constant as a value.
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
                    let entry = self.builder.pool.datum(datum);
                    let constant = ConstIdx(self.constant_index(entry));
                    self.compute(dest, |dst| Instr::LoadConst { dst, constant });
                }
            },
        }
    }

    /// Lowers `node` so that its value goes to `dest`. Registers in use stay so, and no more are.
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
            NodeKind::Recovery { table, procedures, body } => self.recovery(table, *procedures, *body, dest),
            NodeKind::FailureCleanup(body, cleanup) => self.failure_cleanup(*body, *cleanup, dest),
            NodeKind::Handlers(handlers, body) => self.handlers(*handlers, *body, dest),
            NodeKind::Mask(from, body) => self.mask(*from, *body, dest),
            NodeKind::Slot(class, slot, instance) => self.slot(class, *slot, *instance, dest),
            NodeKind::SetSlot(class, slot, instance, value) => {
                self.set_slot(class, *slot, *instance, *value, dest)
            }
            NodeKind::IsInstance(class, object) => self.is_instance(class, *object, dest),
        }
    }

    /// Forms for effect, and the last for its values.
    pub(super) fn progn(&mut self, forms: &[NodeId], dest: Dest) {
        let Some((&last, others)) = forms.split_last() else { return self.deliver_nil(dest) };
        for &form in others {
            self.form(form, Dest::Effect);
        }
        self.form(last, dest);
    }

    /// Gives the parameters their registers and lowers the entry: defaults, boxes and special bindings, in order.
    fn parameters(&mut self, text: &'a Lambda) -> Parameters {
        let keys = text.keys.as_deref().unwrap_or_default();
        let optional = text.optional.iter().map(|optional| optional.parameter);
        let in_registers = (text.required.iter().copied()).chain(optional).chain(text.rest);
        for parameter in in_registers.chain(keys.iter().map(|key| key.optional.parameter)) {
            self.builder.variables[parameter.variable.index()] = self.registers.take(1);
        }
        if self.builder.spills_from.is_some() {
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
        let names = keys.iter().map(|key| self.builder.pool.symbol(&key.key));
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
        let resolution = &self.builder.resolution;
        let supplied = optional.supplied.filter(|flag| flag.is_special || resolution.is_used(flag.variable));
        let supplied = supplied.map(|supplied| {
            let flag = self.registers.take(1);
            self.builder.variables[supplied.variable.index()] = flag;
            self.emit(Instr::LoadTrue { dst: Dst(flag) });
            (supplied, flag)
        });
        let (missing, end) = (self.graph.label(), self.graph.label());
        self.branch(Cond::Supplied(Reg(register)), end, missing);
        self.graph.bind(missing);
        self.form(optional.default, Dest::Keep(register));
        if let Some((_, flag)) = supplied {
            self.emit(Instr::LoadNil { first: Base(flag), count: Count(1) });
        }
        self.graph.bind(end);
        self.settle(optional.parameter);
        if let Some((supplied, _)) = supplied {
            self.settle(supplied);
        }
    }

    /// Boxes or binds a parameter whose value has arrived.
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

/// The value of an integer that fits an instruction.
pub(super) fn small_integer(datum: &Datum) -> Option<Int16> {
    match datum.kind() {
        DatumKind::Integer(value) => i16::try_from(value).ok().map(Int16),
        _ => None,
    }
}
