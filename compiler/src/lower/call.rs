//! Calls: windows, arguments, and what becomes of the results.

use esl_bytecode::builtin::Builtin;
use esl_bytecode::datum::DatumKind;
use esl_bytecode::opcode::Instr;
use esl_bytecode::operand::*;
use esl_bytecode::symbol::Symbol;

use super::dest::Dest;
use super::frame::Frame;
use super::variable::Place;
use crate::core::*;
use crate::resolve::FunctionKind;

/// A call with more arguments than this makes a list of them and applies the function to it.
pub(super) const MAX_DIRECT: usize = 100;
/// A list of more items than this is put together from parts.
const MAX_LIST: usize = 64;

/// What is called, when it is clear how.
#[derive(Clone, Copy)]
pub(super) enum Target<'a> {
    Global(&'a Symbol),
    Builtin(Builtin),
    /// The running function.
    Itself,
    /// The function in a place, which keeps it while the arguments are evaluated, or is a box.
    Place(Place),
    /// The function of a lambda that captures nothing.
    Constant(LambdaId),
    /// What a form gives, before the arguments.
    Form(NodeId),
}

impl Target<'_> {
    /// Whether what is called must be fetched before the arguments.
    fn comes_first(self) -> bool {
        matches!(self, Target::Form(_) | Target::Place(Place::Box(_) | Place::CaptureBox(_)))
    }

    /// So many registers of the window are written only when the arguments are there.
    fn slack(self) -> u8 {
        if self.comes_first() { 0 } else { 2 }
    }
}

impl<'a> Frame<'_, 'a> {
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
            self.emit_call(Target::Global(name), arguments, dest);
        }
    }

    fn call_itself(&mut self, arguments: &'a [NodeId], dest: Dest) {
        if let Dest::Tail = dest {
            self.jump_to_function(self.lambda, self.entry, arguments);
        } else {
            self.emit_call(Target::Itself, arguments, dest);
        }
    }

    fn call_local(&mut self, variable: VarId, arguments: &'a [NodeId], dest: Dest) {
        let resolution = &self.builder.resolution;
        let Some(lambda) = resolution.function(variable) else {
            // A variable that holds a function.
            let place = self.place(variable);
            return self.emit_call(Target::Place(place), arguments, dest);
        };
        let kind = resolution.function_kind(lambda);
        if kind == FunctionKind::Inline {
            self.call_inline(lambda, arguments, dest);
        } else if lambda == self.lambda && self.core.lambdas[lambda.index()].takes_exactly(arguments.len()) {
            self.call_itself(arguments, dest);
        } else if kind == FunctionKind::Closure {
            let place = self.place(variable);
            self.emit_call(Target::Place(place), arguments, dest);
        } else {
            self.emit_call(Target::Constant(lambda), arguments, dest);
        }
    }

    pub(super) fn call_value(&mut self, function: NodeId, arguments: &'a [NodeId], dest: Dest) {
        match &self.core.nodes[function.index()].kind {
            NodeKind::Lambda(lambda) if self.builder.resolution.frame(*lambda) != *lambda => {
                self.call_inline(*lambda, arguments, dest);
            }
            NodeKind::FunctionRef(name) => self.call_global(name, arguments, dest),
            NodeKind::BuiltinRef(builtin) if takes(*builtin, arguments.len()) => {
                self.builtin(*builtin, arguments, dest);
            }
            NodeKind::Constant(datum) if matches!(datum.kind(), DatumKind::Symbol(name) if !name.is_cl("T")) =>
            {
                let DatumKind::Symbol(name) = datum.kind() else { unreachable!("just matched") };
                self.emit_call(Target::Global(name), arguments, dest);
            }
            NodeKind::Local(variable) if self.keeps_its_value(*variable, arguments) => {
                let place = self.place(*variable);
                self.emit_call(Target::Place(place), arguments, dest);
            }
            _ => self.emit_call(Target::Form(function), arguments, dest),
        }
    }

    pub(super) fn apply(&mut self, callee: &'a Callee, arguments: &'a [NodeId], dest: Dest) {
        let load = |frame: &mut Self, dest| match callee {
            Callee::Global(name) => frame.function_ref(name, dest),
            Callee::Builtin(builtin) => frame.builtin_ref(*builtin, dest),
            Callee::Local(variable) => frame.local(*variable, dest),
            Callee::Value(function) => frame.form(*function, dest),
        };
        self.apply_form(load, arguments, dest);
    }

    /// Applies what `load` gives to arguments, the last of which is a list.
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
        let count = self.registers.top().saturating_sub(window.saturating_add(2));
        self.finish_apply(window, count, dest);
    }

    /// Applies what is in `window` to `count` arguments, the last of which is a list. Frees the window.
    pub(super) fn finish_apply(&mut self, window: u8, count: u8, dest: Dest) {
        if self.keeps_its_frame(dest) {
            self.finish_apply(window, count, Dest::All);
            return self.finish(Dest::All, dest);
        }
        let (base, count) = (Base(window), Count(count));
        if let Dest::Tail = dest {
            self.end(Instr::TailApply { window: base, count, pad: Pad(0) });
            return self.registers.release(window);
        }
        self.emit(Instr::Apply { window: base, count, want: dest.want(), pad: Pad(0) });
        self.registers.release(window);
        self.results(window, dest);
    }

    /// Lowers `forms` to the next registers, which stay taken.
    pub(super) fn arguments(&mut self, forms: &[NodeId]) {
        for &form in forms {
            let register = self.registers.top();
            self.form(form, Dest::Fresh(register));
            self.registers.take(1);
        }
    }

    /// Lowers a call whose callee and arguments are not opened up.
    pub(super) fn emit_call(&mut self, target: Target<'a>, arguments: &'a [NodeId], dest: Dest) {
        let fails = matches!(target, Target::Global(name) if fails(name));
        if self.keeps_its_frame(dest) || matches!(dest, Dest::Tail) && fails {
            self.emit_call(target, arguments, Dest::All);
            return self.finish(Dest::All, dest);
        }
        if arguments.len() > MAX_DIRECT && !matches!(target, Target::Itself) {
            return self.call_with_list(target, arguments, dest);
        }
        let top = self.registers.top();
        // The window begins at the destination if all registers above are free by the time it is written.
        let window = match dest {
            Dest::Fresh(first) | Dest::Values(first, _) if top - first <= target.slack() => first,
            _ => top,
        };
        let base = Base(window);
        if target.comes_first() {
            self.load_target(target, window);
        }
        let first = window.saturating_add(2);
        self.registers.take(usize::from(first.saturating_sub(top)));
        self.arguments(arguments);
        if !target.comes_first() && matches!(target, Target::Place(_) | Target::Constant(_)) {
            self.load_target(target, window);
        }
        self.registers.release(top);
        self.registers.reserve(window, usize::from(dest.want().registers()));
        let (count, want, pad) = (Count(arguments.len() as u8), dest.want(), Pad(0));
        if let Dest::Tail = dest {
            let instr = match target {
                Target::Global(name) => {
                    let symbol = WideSymbolIdx(u32::from(self.symbol_index(name).0));
                    Instr::TailCallGlobal { window: base, count, symbol }
                }
                Target::Builtin(builtin) => {
                    Instr::TailCallBuiltin { window: base, count, builtin: BuiltinIdx(builtin.number()) }
                }
                _ => Instr::TailCall { window: base, count, pad },
            };
            return self.end(instr);
        }
        let instr = match target {
            Target::Global(name) => {
                let symbol = WideSymbolIdx(u32::from(self.symbol_index(name).0));
                Instr::CallGlobal { window: base, count, want, symbol }
            }
            Target::Builtin(builtin) => {
                Instr::CallBuiltin { window: base, count, want, builtin: BuiltinIdx(builtin.number()) }
            }
            Target::Itself => Instr::CallSelf { window: base, count, want, pad },
            _ => Instr::Call { window: base, count, want, pad },
        };
        self.emit(instr);
        self.results(window, dest);
    }

    /// Whether a tail call is none after all: the frame of a top-level form is kept, so that backtraces show the form.
    fn keeps_its_frame(&self, dest: Dest) -> bool {
        matches!(dest, Dest::Tail) && self.lambda == LambdaId(0)
    }

    /// Calls a global function with the arguments that are in a window at the top of the registers.
    pub(super) fn call_in_window(&mut self, name: &Symbol, window: u8, count: u8, dest: Dest) {
        if self.keeps_its_frame(dest) {
            self.call_in_window(name, window, count, Dest::All);
            return self.finish(Dest::All, dest);
        }
        self.registers.reserve(window, usize::from(dest.want().registers()));
        let symbol = WideSymbolIdx(u32::from(self.symbol_index(name).0));
        let (base, count, want) = (Base(window), Count(count), dest.want());
        if let Dest::Tail = dest {
            return self.end(Instr::TailCallGlobal { window: base, count, symbol });
        }
        self.emit(Instr::CallGlobal { window: base, count, want, symbol });
        self.results(window, dest);
    }

    /// Puts what is called to `window`.
    fn load_target(&mut self, target: Target<'a>, window: u8) {
        let dest = Dest::Fresh(window);
        match target {
            Target::Global(name) => self.function_ref(name, dest),
            Target::Builtin(builtin) => self.builtin_ref(builtin, dest),
            Target::Place(place) => self.fetch(place, dest),
            Target::Constant(lambda) => self.constant_function(lambda, dest),
            Target::Form(function) => self.form(function, dest),
            Target::Itself => unreachable!("a function that calls itself has its arguments in registers"),
        }
    }

    /// Passes on what a call has put into its window.
    fn results(&mut self, window: u8, dest: Dest) {
        match dest {
            Dest::All => {}
            Dest::Values(first, count) => self.move_range(first, window, count),
            _ => self.deliver(window, dest),
        }
    }

    /// Lowers a call with very many arguments.
    fn call_with_list(&mut self, target: Target<'a>, arguments: &'a [NodeId], dest: Dest) {
        let window = self.registers.top();
        self.load_target(target, window);
        self.registers.take(2);
        let list = self.registers.top();
        self.list(arguments, Dest::Fresh(list));
        self.registers.take(1);
        self.finish_apply(window, 1, dest);
    }

    /// A fresh list of what the forms give.
    pub(super) fn list(&mut self, forms: &[NodeId], dest: Dest) {
        if forms.is_empty() {
            return self.deliver_nil(dest);
        }
        let top = self.registers.top();
        if forms.len() <= MAX_LIST {
            self.arguments(forms);
            self.registers.release(top);
            let count = Count(forms.len() as u8);
            return self.compute(dest, |dst| Instr::List { dst, first: Base(top), count });
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

    /// The list of what the first forms give, joined with the lists that the others give; in the next register.
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

    /// Joins the lists that are the arguments in a window at the top of the registers, and frees it.
    pub(super) fn append(&mut self, window: u8, dest: Dest) {
        let count = Count(self.registers.top().saturating_sub(window.saturating_add(2)));
        let builtin = BuiltinIdx(Builtin::Append.number());
        self.emit(Instr::CallBuiltin { window: Base(window), count, want: Want::ONE, builtin });
        self.registers.release(window);
        self.registers.reserve(window, 1);
        self.deliver(window, dest);
    }
}

/// Whether a function fails: backtraces are to show who has called it.
fn fails(function: &Symbol) -> bool {
    function.is_cl("ERROR") || [Symbol::esl("FAIL"), Symbol::esl("%FAIL-FOR")].contains(function)
}

/// Whether a builtin takes so many arguments.
pub(super) fn takes(builtin: Builtin, count: usize) -> bool {
    let arity = builtin.info().arity;
    count >= arity.min as usize && arity.max.is_none_or(|max| count <= max as usize)
}
