//! Recovery procedures, and cleanups for failures.

use esl_bytecode::opcode::Instr;
use esl_bytecode::operand::*;
use esl_bytecode::symbol::Symbol;

use super::builder::{Extent, FunctionBuilder};
use super::dest::Dest;
use super::graph::Cond;
use crate::core::*;

impl FunctionBuilder<'_, '_> {
    /// Lowers a body with recovery procedures. Entering it with a literal table takes two instructions and no
    /// memory: the first instruction at the landing makes the function that runs the clauses, and the machine
    /// executes it when a failure needs it.
    ///
    /// ```text
    ///       state := the table
    /// again: push-recovery state, landing at `landing`
    ///       the body; pop it; go to `end`
    /// landing: make the function
    ///       window = NIL: the value is window+1; go to `end`
    ///       state := window; loop to `again`
    /// end:
    /// ```
    pub(super) fn recovery(&mut self, table: NodeId, procedures: NodeId, body: NodeId, dest: Dest) {
        let depth = self.extents.len();
        let [again, landing, aborted, retry, end] = std::array::from_fn(|_| self.graph.label());
        let state = self.registers.top();
        self.form(table, Dest::Fresh(state));
        self.jump(again);
        self.graph.bind(again);
        let window = self.registers.top();
        self.registers.reserve(window, 2);
        let push = Instr::PushRecovery { window: window.into(), state, to: Landing(0) };
        self.push_entry(push, landing, Extent::Control);
        self.form_inside(body, dest, depth);
        self.join(end, dest);
        self.graph.bind(landing);
        let kind = self.registers.take(1);
        let result = self.registers.take(1);
        let function = self.registers.top();
        self.form(procedures, Dest::Fresh(function));
        self.branch(Cond::Nil(kind), aborted, retry);
        self.graph.bind(retry);
        self.move_to(state, kind);
        self.jump(again);
        self.graph.bind(aborted);
        self.deliver(result, dest);
        self.registers.release(state);
        if dest.goes_on() {
            self.join(end, dest);
            self.graph.bind(end);
        }
    }

    /// Lowers a body with a cleanup for failures:
    ///
    /// ```text
    ///       push-failure-cleanup landing at `landing`
    ///       the body; pop it; go to `end`
    /// landing: the cleanup
    ///       end-cleanup
    ///       call %fail-again with the value list
    /// end:
    /// ```
    pub(super) fn failure_cleanup(&mut self, body: NodeId, cleanup: NodeId, dest: Dest) {
        let depth = self.extents.len();
        let [landing, end] = std::array::from_fn(|_| self.graph.label());
        let top = self.registers.top();
        let push = Instr::PushFailureCleanup { window: top.into(), to: Landing(0) };
        self.push_entry(push, landing, Extent::Control);
        self.form_inside(body, dest, depth);
        self.join(end, dest);
        self.graph.bind(landing);
        self.open(Extent::Cleanup);
        self.form(cleanup, Dest::Effect);
        self.emit(Instr::EndCleanup {});
        self.extents.truncate(depth);
        let window = self.registers.top();
        self.registers.take(2);
        let failure = self.registers.take(1);
        self.emit(Instr::ValuesToList { dst: failure.into() });
        self.registers.release(top);
        self.call_in_window(&Symbol::esl("%FAIL-AGAIN"), window, 1, dest);
        if dest.goes_on() {
            self.join(end, dest);
            self.graph.bind(end);
        }
    }
}
