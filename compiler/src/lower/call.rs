//! Calls: windows, arguments, and the delivery of results.

use esl_bytecode::builtin::Builtin;
use esl_bytecode::opcode::Instr;
use esl_bytecode::operand::*;
use esl_bytecode::symbol::Symbol;

use super::builder::FunctionBuilder;
use super::dest::Dest;
use super::variable::VariableLocation;
use crate::core::*;
use crate::resolve::FunctionKind;

/// Arguments that a call passes in registers. With more, it makes a list of them and applies the function to
/// that.
pub(super) const MAX_DIRECT: usize = 100;
/// Items of a list that one instruction makes. A longer list is put together from parts.
const MAX_LIST: usize = 64;

/// Target of a call.
#[derive(Clone, Copy)]
pub(super) enum CallRoute<'a> {
    Global(&'a Symbol),
    Builtin(Builtin),
    /// The running function.
    Itself,
    /// The function in a variable that keeps its value while the arguments are evaluated, or lives in a box.
    Variable(VariableLocation),
    /// The function of a lambda that captures nothing.
    Constant(LambdaId),
    /// The value of a form, which is evaluated before the arguments.
    Form(NodeId),
}

impl CallRoute<'_> {
    /// Whether the function must be fetched before the arguments.
    fn comes_first(self) -> bool {
        matches!(
            self,
            CallRoute::Form(_)
                | CallRoute::Variable(VariableLocation::Box(_) | VariableLocation::CaptureBox(_))
        )
    }

    /// Returns how many registers of the window are written only after the arguments.
    fn slack(self) -> u8 {
        if self.comes_first() { 0 } else { 2 }
    }
}

impl<'a> FunctionBuilder<'_, 'a> {
    /// Lowers a call.
    pub(super) fn call(&mut self, callee: &'a Callee, arguments: &'a [NodeId], dest: Dest) {
        match callee {
            Callee::Builtin(builtin) => self.builtin(*builtin, arguments, dest),
            Callee::Global(name) => self.call_global(name, arguments, dest),
            Callee::Local(variable) => self.call_local(*variable, arguments, dest),
            Callee::Value(function) => self.call_value(*function, arguments, dest),
        }
    }

    fn call_global(&mut self, name: &'a Symbol, arguments: &'a [NodeId], dest: Dest) {
        let own = &self.core.lambdas[self.lambda.index()];
        if own.is_named(name) && own.takes_exactly(arguments.len()) {
            self.call_itself(arguments, dest);
        } else {
            self.emit_call(CallRoute::Global(name), arguments, dest);
        }
    }

    fn call_itself(&mut self, arguments: &'a [NodeId], dest: Dest) {
        if let Dest::Tail = dest {
            self.jump_to_function(self.lambda, self.entry, self.entry_scope, arguments);
        } else {
            self.emit_call(CallRoute::Itself, arguments, dest);
        }
    }

    fn call_local(&mut self, variable: VarId, arguments: &'a [NodeId], dest: Dest) {
        let resolution = &self.module.resolution;
        let Some(lambda) = resolution.function(variable) else {
            // A variable that holds a function.
            let location = self.location(variable);
            return self.emit_call(CallRoute::Variable(location), arguments, dest);
        };
        let kind = resolution.function_kind(lambda);
        if kind == FunctionKind::Inline {
            self.call_inline(lambda, arguments, dest);
        } else if lambda == self.lambda && self.core.lambdas[lambda.index()].takes_exactly(arguments.len()) {
            self.call_itself(arguments, dest);
        } else if kind == FunctionKind::Closure {
            let location = self.location(variable);
            self.emit_call(CallRoute::Variable(location), arguments, dest);
        } else {
            self.emit_call(CallRoute::Constant(lambda), arguments, dest);
        }
    }

    /// Lowers a call of a form's value.
    pub(super) fn call_value(&mut self, function: NodeId, arguments: &'a [NodeId], dest: Dest) {
        match &self.core.nodes[function.index()].kind {
            NodeKind::Lambda(lambda) if self.module.resolution.frame(*lambda) != *lambda => {
                self.call_inline(*lambda, arguments, dest);
            }
            NodeKind::FunctionRef(name) => self.call_global(name, arguments, dest),
            NodeKind::BuiltinRef(builtin) if takes(*builtin, arguments.len()) => {
                self.builtin(*builtin, arguments, dest);
            }
            NodeKind::Constant(datum) => match datum.as_symbol().filter(|name| !name.is_cl("T")) {
                Some(name) => self.emit_call(CallRoute::Global(name), arguments, dest),
                None => self.emit_call(CallRoute::Form(function), arguments, dest),
            },
            NodeKind::Local(variable) if self.keeps_its_value(*variable, arguments) => {
                let location = self.location(*variable);
                self.emit_call(CallRoute::Variable(location), arguments, dest);
            }
            _ => self.emit_call(CallRoute::Form(function), arguments, dest),
        }
    }

    /// Lowers a call whose last argument is a list of arguments.
    pub(super) fn apply(&mut self, callee: &'a Callee, arguments: &'a [NodeId], dest: Dest) {
        let load = |builder: &mut Self, dest| match callee {
            Callee::Global(name) => builder.function_ref(name, dest),
            Callee::Builtin(builtin) => builder.builtin_ref(*builtin, dest),
            Callee::Local(variable) => builder.local(*variable, dest),
            Callee::Value(function) => builder.form(*function, dest),
        };
        self.apply_form(load, arguments, dest);
    }

    /// Applies the function that `load` fetches to arguments, the last of which is a list.
    pub(super) fn apply_form(
        &mut self,
        load: impl FnOnce(&mut Self, Dest),
        arguments: &'a [NodeId],
        dest: Dest,
    ) {
        let window = self.registers.top();
        load(self, Dest::Fresh(window));
        self.registers.take(2);
        if arguments.len() > MAX_DIRECT {
            // The arguments before the list, as a list; then both joined.
            let (items, last) = arguments.split_at(arguments.len() - 1);
            self.joined_list(items, last);
        } else {
            self.arguments(arguments);
        }
        let count = self.registers.taken_since(window.offset(2));
        self.finish_apply(window, count, dest);
    }

    /// Applies the function in `window` to `count` arguments, the last of which is a list. Frees the window.
    pub(super) fn finish_apply(&mut self, window: Reg, count: u8, dest: Dest) {
        if self.keeps_its_frame(dest) {
            self.finish_apply(window, count, Dest::All);
            return self.finish(Dest::All, dest);
        }
        let (base, count) = (Window::from(window), Count(count));
        if let Dest::Tail = dest {
            self.end(Instr::TailApply { window: base, count, pad: Pad(0) });
            return self.registers.release(window);
        }
        self.emit(Instr::Apply { window: base, count, want: dest.want(), pad: Pad(0) });
        self.registers.release(window);
        self.results(window, dest);
    }

    /// Lowers forms to the next registers, which stay taken.
    pub(super) fn arguments(&mut self, forms: &[NodeId]) {
        for &form in forms {
            let register = self.registers.top();
            self.form(form, Dest::Fresh(register));
            self.registers.take(1);
        }
    }

    /// Lowers a call that is not opened up.
    pub(super) fn emit_call(&mut self, target: CallRoute<'a>, arguments: &'a [NodeId], dest: Dest) {
        let fails = matches!(target, CallRoute::Global(name) if fails(name));
        if self.keeps_its_frame(dest) || matches!(dest, Dest::Tail) && fails {
            self.emit_call(target, arguments, Dest::All);
            return self.finish(Dest::All, dest);
        }
        if arguments.len() > MAX_DIRECT && !matches!(target, CallRoute::Itself) {
            return self.call_with_list(target, arguments, dest);
        }
        let top = self.registers.top();
        // The window begins at the destination if all registers above that are free by the time it is
        // written.
        let window = match dest {
            Dest::Fresh(first) | Dest::Values(first, _)
                if self.registers.taken_since(first) <= target.slack() =>
            {
                first
            }
            _ => top,
        };
        let base = Window::from(window);
        if target.comes_first() {
            self.load_target(target, window);
        }
        let first = window.offset(2);
        self.registers.take(usize::from(first.0.saturating_sub(top.0)));
        self.arguments(arguments);
        if !target.comes_first() && matches!(target, CallRoute::Variable(_) | CallRoute::Constant(_)) {
            self.load_target(target, window);
        }
        self.registers.release(top);
        self.registers.reserve(window, usize::from(dest.want().registers()));
        let (count, want, pad) = (Count(arguments.len() as u8), dest.want(), Pad(0));
        if let Dest::Tail = dest {
            let instr = match target {
                CallRoute::Global(name) => {
                    let symbol = WideSymbolIdx(u32::from(self.symbol_index(name).0));
                    Instr::TailCallGlobal { window: base, count, symbol }
                }
                CallRoute::Builtin(builtin) => {
                    Instr::TailCallBuiltin { window: base, count, builtin: BuiltinIdx(builtin.number()) }
                }
                _ => Instr::TailCall { window: base, count, pad },
            };
            return self.end(instr);
        }
        let instr = match target {
            CallRoute::Global(name) => {
                let symbol = WideSymbolIdx(u32::from(self.symbol_index(name).0));
                Instr::CallGlobal { window: base, count, want, symbol }
            }
            CallRoute::Builtin(builtin) => {
                Instr::CallBuiltin { window: base, count, want, builtin: BuiltinIdx(builtin.number()) }
            }
            CallRoute::Itself => Instr::CallSelf { window: base, count, want, pad },
            _ => Instr::Call { window: base, count, want, pad },
        };
        self.emit(instr);
        self.results(window, dest);
    }

    /// Whether a tail call keeps the frame: that of a top-level form is kept, so that backtraces show the
    /// form.
    fn keeps_its_frame(&self, dest: Dest) -> bool {
        matches!(dest, Dest::Tail) && self.lambda == LambdaId(0)
    }

    /// Calls a global function with the arguments that are in a window at the top of the registers.
    pub(super) fn call_in_window(&mut self, name: &Symbol, window: Reg, count: u8, dest: Dest) {
        if self.keeps_its_frame(dest) {
            self.call_in_window(name, window, count, Dest::All);
            return self.finish(Dest::All, dest);
        }
        self.registers.reserve(window, usize::from(dest.want().registers()));
        let symbol = WideSymbolIdx(u32::from(self.symbol_index(name).0));
        let (base, count, want) = (window.into(), Count(count), dest.want());
        if let Dest::Tail = dest {
            return self.end(Instr::TailCallGlobal { window: base, count, symbol });
        }
        self.emit(Instr::CallGlobal { window: base, count, want, symbol });
        self.results(window, dest);
    }

    /// Puts the function that is called into `window`.
    fn load_target(&mut self, target: CallRoute<'a>, window: Reg) {
        let dest = Dest::Fresh(window);
        match target {
            CallRoute::Global(name) => self.function_ref(name, dest),
            CallRoute::Builtin(builtin) => self.builtin_ref(builtin, dest),
            CallRoute::Variable(location) => self.fetch(location, dest),
            CallRoute::Constant(lambda) => self.constant_function(lambda, dest),
            CallRoute::Form(function) => self.form(function, dest),
            CallRoute::Itself => unreachable!("a function that calls itself has its arguments in registers"),
        }
    }

    /// Delivers the results that a call has put into its window.
    fn results(&mut self, window: Reg, dest: Dest) {
        match dest {
            Dest::All => {}
            Dest::Values(first, count) => self.move_range(first, window, count),
            _ => self.deliver(window, dest),
        }
    }

    /// Lowers a call with too many arguments for registers.
    fn call_with_list(&mut self, target: CallRoute<'a>, arguments: &'a [NodeId], dest: Dest) {
        let window = self.registers.top();
        self.load_target(target, window);
        self.registers.take(2);
        let list = self.registers.top();
        self.list(arguments, Dest::Fresh(list));
        self.registers.take(1);
        self.finish_apply(window, 1, dest);
    }

    /// Makes a list of the values of forms.
    pub(super) fn list(&mut self, forms: &[NodeId], dest: Dest) {
        if forms.is_empty() {
            return self.deliver_nil(dest);
        }
        let top = self.registers.top();
        if forms.len() <= MAX_LIST {
            self.arguments(forms);
            self.registers.release(top);
            let count = Count(forms.len() as u8);
            return self.compute(dest, |dst| Instr::List { dst, first: top.into(), count });
        }
        let mut size = MAX_LIST;
        while forms.len().div_ceil(size) > MAX_LIST {
            size *= MAX_LIST;
        }
        self.registers.take(2);
        for part in forms.chunks(size) {
            let register = self.registers.top();
            self.list(part, Dest::Fresh(register));
            self.registers.take(1);
        }
        self.append(top, dest);
    }

    /// Makes the list of the values of `items`, joined with the values of `lists`, in the next register.
    fn joined_list(&mut self, items: &[NodeId], lists: &[NodeId]) {
        let window = self.registers.top();
        self.registers.take(2);
        let register = self.registers.top();
        self.list(items, Dest::Fresh(register));
        self.registers.take(1);
        self.arguments(lists);
        self.append(window, Dest::Fresh(window));
        self.registers.take(1);
    }

    /// Joins the lists that are the arguments in a window at the top of the registers. Frees the window.
    pub(super) fn append(&mut self, window: Reg, dest: Dest) {
        let count = Count(self.registers.taken_since(window.offset(2)));
        let builtin = BuiltinIdx(Builtin::Append.number());
        self.emit(Instr::CallBuiltin { window: window.into(), count, want: Want::ONE, builtin });
        self.registers.release(window);
        self.registers.reserve(window, 1);
        self.deliver(window, dest);
    }
}

/// Whether a function always fails. Its tail calls keep the frame, so that backtraces show the caller.
fn fails(function: &Symbol) -> bool {
    const FAILING: [&str; 4] = ["FAIL", "%FAIL-FOR", "%FAIL-AS", "%FAIL-ALL"];
    function.is_cl("ERROR") || FAILING.iter().any(|name| Symbol::esl(name) == *function)
}

/// Whether a builtin takes `count` arguments.
pub(super) fn takes(builtin: Builtin, count: usize) -> bool {
    let arity = builtin.info().arity;
    count >= arity.min as usize && arity.max.is_none_or(|max| count <= max as usize)
}
