//! Forms with an entry on the control stack while their body runs: cleanups, handlers, masks and scopes.

use esl_bytecode::opcode::Instr;
use esl_bytecode::operand::*;

use super::builder::{Extent, FunctionBuilder};
use super::dest::Dest;
use super::graph::{Cond, SegmentExit};
use crate::core::*;

impl FunctionBuilder<'_, '_> {
    /// Lowers a protected form and its cleanup, which control enters behind the form, and unwindings from
    /// anywhere in it:
    ///
    /// ```text
    ///       push-cleanup landing at `cleanup`
    ///       the protected form
    ///       enter-cleanup
    /// cleanup: the cleanup
    ///       end-cleanup
    /// ```
    pub(super) fn unwind_protect(&mut self, protected: NodeId, cleanup: NodeId, dest: Dest) {
        let top = self.registers.top();
        let is_single = self.module.resolution.is_single(protected);
        // A single value waits in a register below the window, several in the value list.
        let inner = match dest {
            Dest::Effect => Dest::Effect,
            Dest::All | Dest::Values(..) => Dest::All,
            Dest::Tail if !is_single => Dest::All,
            _ => Dest::Keep(self.registers.take(1)),
        };
        let depth = self.extents.len();
        let landing = self.graph.label();
        let window = Window::from(self.registers.top());
        self.push_entry(Instr::PushCleanup { window, to: Landing(0) }, landing, Extent::Cleanup);
        self.form(protected, inner);
        let returns = self.graph.is_open();
        self.emit(Instr::EnterCleanup {});
        self.graph.leave(SegmentExit::Fall(landing), self.span);
        self.graph.bind(landing);
        self.form(cleanup, Dest::Effect);
        self.emit(Instr::EndCleanup {});
        self.extents.truncate(depth);
        self.registers.release(top);
        match (inner, dest) {
            // Control never leaves the cleanup either.
            _ if !returns => self.deliver_nil(dest),
            (Dest::Keep(register), _) => self.deliver(register, dest),
            (Dest::All, Dest::Values(..)) => self.deliver_values(dest),
            _ => self.finish(inner, dest),
        }
    }

    /// Lowers `progv`.
    pub(super) fn progv(&mut self, symbols: NodeId, values: NodeId, body: NodeId, dest: Dest) {
        let top = self.registers.top();
        let depth = self.extents.len();
        let symbols = self.operand(symbols, &[values]);
        let values = self.operand(values, &[]);
        let window = Window::from(self.registers.top());
        self.emit(Instr::PushScope { window });
        self.open(Extent::Control);
        self.emit(Instr::BindList { symbols, values });
        self.form_inside(body, dest, depth);
        self.registers.release(top);
    }

    /// Lowers a body with handlers.
    pub(super) fn handlers(&mut self, handlers: NodeId, body: NodeId, dest: Dest) {
        self.under_entry(handlers, body, dest, |window, handlers| Instr::PushHandlers { window, handlers });
    }

    /// Lowers a body within which control entries are masked.
    pub(super) fn mask(&mut self, from: NodeId, body: NodeId, dest: Dest) {
        self.under_entry(from, body, dest, |window, from| Instr::PushMask { window, from });
    }

    /// Lowers a body under a control entry, which an instruction pushes with the value of an operand.
    fn under_entry(&mut self, operand: NodeId, body: NodeId, dest: Dest, push: fn(Window, Reg) -> Instr) {
        let top = self.registers.top();
        let depth = self.extents.len();
        let operand = self.operand(operand, &[]);
        self.registers.release(top);
        self.emit(push(top.into(), operand));
        self.open(Extent::Control);
        self.form_inside(body, dest, depth);
    }

    /// Lowers a body with clauses for conditions.
    pub(super) fn handler_case(&mut self, body: NodeId, clauses: &[HandlerClause], dest: Dest) {
        if clauses.is_empty() {
            return self.form(body, dest);
        }
        let depth = self.extents.len();
        let (landing, end) = (self.graph.label(), self.graph.label());
        let window = self.registers.top();
        let types = clauses.iter().map(|clause| self.module.pool.datum(&clause.condition_type)).collect();
        let types = self.module.pool.vector(types);
        let types = VectorIdx(self.constant_index(types));
        self.push_entry(
            Instr::PushHandlerCase { window: window.into(), types, to: Landing(0) },
            landing,
            Extent::Control,
        );
        self.form_inside(body, dest, depth);
        self.join(end, dest);
        self.graph.bind(landing);
        let index = self.registers.take(1);
        let condition = self.registers.take(1);
        for (number, clause) in clauses.iter().enumerate() {
            let next = self.graph.label();
            if number + 1 < clauses.len() {
                let this = self.graph.label();
                let number = Int16(number.min(i16::MAX as usize) as i16);
                self.branch(Cond::NumEqInt(index, number), this, next);
                self.graph.bind(this);
            }
            let scope = self.begin_scope();
            self.module.variables[clause.variable.index()] = condition;
            self.graph.scopes.add(clause.variable, condition);
            self.box_variable(clause.variable);
            self.form(clause.body, dest);
            self.end_scope(scope);
            self.join(end, dest);
            self.graph.bind(next);
        }
        // Control does not reach the code behind the last clause.
        self.graph.leave(SegmentExit::Jump(end), self.span);
        self.registers.release(window);
        if dest.goes_on() {
            self.graph.bind(end);
        }
    }
}
