//! Multiple values.

use esl_bytecode::builtin::Builtin;
use esl_bytecode::opcode::Instr;
use esl_bytecode::operand::*;

use super::builder::FunctionBuilder;
use super::call::MAX_DIRECT;
use super::dest::Dest;
use crate::core::*;

impl<'a> FunctionBuilder<'_, 'a> {
    /// Lowers `(values …)`.
    pub(super) fn values(&mut self, forms: &[NodeId], dest: Dest) {
        let top = self.registers.top();
        match dest {
            Dest::All | Dest::Tail => {
                if let (Dest::Tail, [form]) = (dest, forms) {
                    let src = self.operand(*form, &[]);
                    self.end(Instr::Return { src });
                    return self.registers.release(top);
                }
                let count = Count(forms.len().min(255) as u8);
                if forms.len() > MAX_DIRECT {
                    let list = self.target(Dest::Effect);
                    self.list(forms, Dest::Fresh(list));
                    self.emit(Instr::ListToValues { src: list });
                    return self.finish(Dest::All, dest);
                }
                self.arguments(forms);
                self.registers.release(top);
                if let Dest::Tail = dest {
                    self.end(Instr::ReturnValues { first: top.into(), count });
                } else {
                    self.emit(Instr::SetValues { first: top.into(), count });
                }
            }
            Dest::Values(base, count) => {
                // The destination may contain variables of the forms themselves.
                let wanted = forms.len().min(usize::from(count));
                self.arguments(&forms[..wanted]);
                for &form in &forms[wanted..] {
                    self.form(form, Dest::Effect);
                }
                self.registers.release(top);
                self.registers.reserve(base, usize::from(count));
                self.move_range(base, top, wanted as u8);
                let missing = count - wanted as u8;
                if missing > 0 {
                    let first = base.offset(wanted as u8).into();
                    self.emit(Instr::LoadNil { first, count: Count(missing) });
                }
            }
            Dest::Effect => forms.iter().for_each(|&form| self.form(form, Dest::Effect)),
            _ => {
                let Some((&first, others)) = forms.split_first() else { return self.deliver_nil(dest) };
                if others.is_empty() {
                    return self.single(first, dest);
                }
                let register = self.operand(first, others);
                for &form in others {
                    self.form(form, Dest::Effect);
                }
                self.registers.release(top);
                self.deliver(register, dest);
            }
        }
    }

    /// Lowers a form to one value, though it may have several.
    pub(super) fn single(&mut self, form: NodeId, dest: Dest) {
        match dest {
            Dest::All | Dest::Tail | Dest::Values(..) if !self.module.resolution.is_single(form) => {
                let register = self.target(Dest::Effect);
                self.form(form, Dest::Fresh(register));
                self.deliver(register, dest);
            }
            _ => self.form(form, dest),
        }
    }

    /// Lowers `(values-list …)`.
    pub(super) fn values_list(&mut self, list: NodeId, dest: Dest) {
        let top = self.registers.top();
        let src = self.operand(list, &[]);
        self.emit(Instr::ListToValues { src });
        self.registers.release(top);
        self.deliver_values(dest);
    }

    /// Binds variables to the values of a form around a body.
    pub(super) fn bind_values(&mut self, targets: &[BoundVariable], form: NodeId, body: NodeId, dest: Dest) {
        let (scope, top) = (self.begin_scope(), self.registers.top());
        let depth = self.extents.len();
        let base = match targets.len() {
            0 => {
                self.form(form, Dest::Effect);
                top
            }
            1 => {
                self.form(form, Dest::Fresh(top));
                self.registers.take(1)
            }
            count => {
                self.form(form, Dest::Values(top, count.min(usize::from(Want::MAX)) as u8));
                self.registers.take(count)
            }
        };
        for (index, target) in targets.iter().enumerate() {
            let register = base.offset(index.min(255) as u8);
            match target {
                BoundVariable::Lexical(variable) => {
                    self.module.variables[variable.index()] = register;
                    self.graph.scopes.add(*variable, register);
                    self.box_variable(*variable);
                }
                BoundVariable::Special(symbol) => self.bind_special(symbol, register),
            }
        }
        self.form_inside(body, dest, depth);
        self.end_scope(scope);
    }

    /// Lowers a form for all its values, and then a second one for effect.
    pub(super) fn first_values(&mut self, first: NodeId, second: NodeId, dest: Dest) {
        let top = self.registers.top();
        let is_single = self.module.resolution.is_single(first);
        match dest {
            Dest::Effect => {
                self.form(first, Dest::Effect);
                self.form(second, Dest::Effect);
            }
            Dest::Values(_, count) => {
                self.form(first, Dest::Values(top, count));
                self.registers.take(usize::from(count));
                self.form(second, Dest::Effect);
                self.registers.release(top);
                self.finish(Dest::Values(top, count), dest);
            }
            Dest::All | Dest::Tail if !is_single => {
                self.form(first, Dest::All);
                let list = self.registers.take(1);
                self.emit(Instr::ValuesToList { dst: list.into() });
                self.form(second, Dest::Effect);
                self.emit(Instr::ListToValues { src: list });
                self.registers.release(top);
                self.finish(Dest::All, dest);
            }
            _ => {
                let value = self.operand(first, &[second]);
                self.form(second, Dest::Effect);
                self.registers.release(top);
                self.deliver(value, dest);
            }
        }
    }

    /// Lowers `(multiple-value-call function form…)`.
    pub(super) fn call_values(&mut self, function: NodeId, forms: &'a [NodeId], dest: Dest) {
        let resolution = &self.module.resolution;
        // Forms with one value are ordinary arguments, up to the first form that may have more.
        let plain = forms.iter().take_while(|form| resolution.is_single(**form)).count();
        if plain == forms.len() {
            return self.call_value(function, forms, dest);
        }
        let is_list = matches!(self.core.nodes[function.index()].kind, NodeKind::BuiltinRef(Builtin::List));
        if let (true, [form]) = (is_list, forms) {
            self.form(*form, Dest::All);
            return self.compute(dest, |dst| Instr::ValuesToList { dst });
        }
        let window = self.registers.top();
        self.form(function, Dest::Fresh(window));
        self.registers.take(2);
        let (ordinary, others) = forms.split_at(plain.min(MAX_DIRECT));
        self.arguments(ordinary);
        if let [form] = others {
            self.value_list_of(*form);
        } else {
            let inner = self.registers.top();
            self.registers.take(2);
            others.iter().for_each(|&form| self.value_list_of(form));
            self.append(inner, Dest::Fresh(inner));
            self.registers.take(1);
        }
        let count = self.registers.taken_since(window.offset(2));
        self.finish_apply(window, count, dest);
    }

    /// Makes a list of the values of a form, in the next register.
    fn value_list_of(&mut self, form: NodeId) {
        let register = self.registers.top();
        if self.module.resolution.is_single(form) {
            self.list(&[form], Dest::Fresh(register));
        } else {
            self.form(form, Dest::All);
            self.compute(Dest::Fresh(register), |dst| Instr::ValuesToList { dst });
        }
        self.registers.take(1);
    }
}
