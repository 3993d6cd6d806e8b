//! Calls that become jumps, assignments in parallel, and the shapes of loops that profit.
//!
//! A loop is best if each turn executes one jump, which is conditional and goes back. [`super::fuse`]
//! achieves this for every loop that begins with a short test:
//!
//! ```lisp
//! (tagbody                                 ; while
//!  top  (if test nil (go end))
//!       body…
//!       (go top)
//!  end)
//! (tagbody                                 ; the same, test last
//!       (go test)
//!  top  body…
//!  test (if test (go top)))
//! ```
//!
//! Tests that can jump back by themselves are `x`, `(not x)`, `(null x)`, `(consp x)` with `x` a variable,
//! and `(< a b)`, `(> a b)` and their negations with `a` and `b` variables. So bind a limit to a variable,
//! even a constant one, and end a loop that includes its limit with `(if (> i limit) (go end))`.
//!
//! Counting up takes one instruction for the step, the comparison and the jump if the step, by a literal
//! integer that fits a byte, comes right before the test, and the test to continue is `(< i limit)`:
//!
//! ```lisp
//! (let ((i 0) (limit n))                   ; dotimes
//!   (tagbody
//!    top  (if (< i limit) nil (go end))
//!         body…
//!         (setq i (+ i 1))
//!         (go top)
//!    end))
//! ```
//!
//! Variables that are both assigned and captured by a closure live in boxes and miss all this. So bind a
//! fresh variable to the counter around the body if the body may make closures.
//!
//! Two further shapes are recognised. `(let ((t1 e1) …) (setq v1 t1 …) …)`, as `psetq` and `do` expand to,
//! assigns in parallel without the temporaries. Tail calls of the running function and of inlined local
//! functions assign the parameters in parallel and jump.

use esl_bytecode::operand::Reg;

use super::builder::{FunctionBuilder, LoopHead};
use super::dest::Dest;
use super::graph::SegmentLabel;
use super::scopes::VariableScope;
use super::variable::VariableLocation;
use crate::core::*;

impl<'a> FunctionBuilder<'_, 'a> {
    /// Enters an inlined function, or jumps to its head from inside.
    pub(super) fn call_inline(&mut self, lambda: LambdaId, arguments: &'a [NodeId], dest: Dest) {
        if let Some(state) = self.loops.get(&lambda).copied() {
            debug_assert_eq!(
                state.depth,
                self.extents.len(),
                "self calls of inlined functions are in tail position"
            );
            return self.jump_to_function(lambda, state.label, state.scope, arguments);
        }
        let text = &self.core.lambdas[lambda.index()];
        let scope = self.begin_scope();
        let depth = self.extents.len();
        let is_loop = self.module.resolution.is_self_called(lambda);
        for (parameter, &argument) in text.required.iter().zip(arguments) {
            if is_loop || parameter.is_special || self.module.resolution.is_assigned(parameter.variable) {
                let register = self.registers.top();
                self.form(argument, Dest::Fresh(register));
                self.module.variables[parameter.variable.index()] = self.registers.take(1);
                self.name_parameter(*parameter);
            } else {
                self.bind_lexical(parameter.variable, argument);
            }
        }
        let has_literals = is_loop && self.load_body_literals(text.body);
        if is_loop {
            let head = self.graph.label();
            self.graph.bind(head);
            self.loops.insert(lambda, LoopHead { label: head, depth, scope: self.graph.scopes.current });
        }
        for &parameter in &text.required {
            if parameter.is_special || self.module.resolution.is_assigned(parameter.variable) {
                self.settle(parameter);
            }
        }
        self.form_inside(text.body, dest, depth);
        self.loops.remove(&lambda);
        if has_literals {
            self.literals = None;
        }
        self.end_scope(scope);
    }

    /// Assigns new values to the parameters of a function and jumps to `head`, before the code that boxes
    /// them.
    pub(super) fn jump_to_function(
        &mut self,
        lambda: LambdaId,
        head: SegmentLabel,
        scope: VariableScope,
        arguments: &'a [NodeId],
    ) {
        let text = &self.core.lambdas[lambda.index()];
        let targets: Vec<VarId> = text.required.iter().map(|parameter| parameter.variable).collect();
        let here = self.graph.scopes.current;
        self.assign(&targets, arguments);
        self.graph.scopes.current = scope;
        self.jump(head);
        self.graph.scopes.current = here;
    }

    /// Sets the registers of `targets` to the values of forms, all of which are computed before the first is
    /// set.
    fn assign(&mut self, targets: &[VarId], values: &[NodeId]) {
        let top = self.registers.top();
        let mut waiting: Vec<(Reg, Reg)> = Vec::new();
        for (index, (&target, &value)) in targets.iter().zip(values).enumerate() {
            let register = self.register(target);
            let later = &values[index + 1..];
            let resolution = &self.module.resolution;
            let is_set_later = resolution.is_set_in(target, later);
            if self.is_plain_read(value, target) && !is_set_later {
                continue;
            }
            let sharers = self.sharers.get(&register).map_or(&[][..], Vec::as_slice);
            let mut readers = std::iter::once(&target).chain(sharers);
            if is_set_later || readers.any(|&reader| resolution.is_read_in(reader, later)) {
                let temporary = self.registers.top();
                self.form(value, Dest::Fresh(temporary));
                waiting.push((register, self.registers.take(1)));
            } else {
                self.form(value, Dest::Keep(register));
                // While the other values are computed, this is one of the next turn.
                self.graph.scopes.hide(register);
            }
        }
        for (register, temporary) in waiting {
            self.move_to(register, temporary);
        }
        self.registers.release(top);
    }

    /// Whether `node` reads `variable` from its register.
    fn is_plain_read(&self, node: NodeId, variable: VarId) -> bool {
        matches!(self.core.nodes[node.index()].kind, NodeKind::Local(read) if read == variable)
            && !self.module.resolution.is_boxed(variable)
    }

    /// Lowers `(let ((t1 e1) …) (setq v1 t1) … rest…)` without temporaries. A further assignment
    /// `(setq v e)`, whose value needs no temporary, may come first. Returns whether the form has this shape.
    pub(super) fn parallel_assignment(
        &mut self,
        bindings: &'a [(BoundVariable, NodeId)],
        body: NodeId,
        dest: Dest,
    ) -> bool {
        let NodeKind::Progn(forms) = &self.core.nodes[body.index()].kind else { return false };
        let Some(first) = bindings.first() else { return false };
        let direct = forms.len() > bindings.len() && self.assigns_temporary(first, forms[0]).is_none();
        let sets = if direct { &forms[1..] } else { &forms[..] };
        let count = bindings.len() + usize::from(direct);
        // With one assignment there is no temporary to save. The value of the last one must be unused.
        if count < 2 || forms.len() < count || (forms.len() == count && !matches!(dest, Dest::Effect)) {
            return false;
        }
        let mut targets = Vec::with_capacity(count);
        let mut values = Vec::with_capacity(count);
        for (binding, &form) in bindings.iter().zip(sets) {
            // Each temporary is read just once, so values of a sequential `let` do not refer to the
            // temporaries either.
            let Some(variable) = self.assigns_temporary(binding, form) else { return false };
            targets.push(variable);
            values.push(binding.1);
        }
        if direct {
            let NodeKind::SetLocal(variable, value) = self.core.nodes[forms[0].index()].kind else {
                return false;
            };
            targets.push(variable);
            values.push(value);
        }
        let in_registers =
            targets.iter().all(|&target| matches!(self.location(target), VariableLocation::Register(_)));
        let mut distinct = targets.clone();
        distinct.sort_unstable();
        distinct.dedup();
        if !in_registers || distinct.len() != targets.len() {
            return false;
        }
        let scope = self.graph.scopes.current;
        self.assign(&targets, &values);
        self.graph.scopes.current = scope;
        self.progn_rest(&forms[count..], dest);
        true
    }

    /// Returns the variable that `form` sets to the temporary of `binding`, if the temporary has no other
    /// use.
    fn assigns_temporary(&self, binding: &(BoundVariable, NodeId), form: NodeId) -> Option<VarId> {
        let BoundVariable::Lexical(temporary) = binding.0 else { return None };
        let NodeKind::SetLocal(variable, read) = self.core.nodes[form.index()].kind else { return None };
        let resolution = &self.module.resolution;
        let read = &self.core.nodes[read.index()].kind;
        let serves = matches!(read, NodeKind::Local(source) if *source == temporary)
            && !resolution.is_assigned(temporary)
            && resolution.reads_of(temporary) == 1;
        serves.then_some(variable)
    }

    fn progn_rest(&mut self, forms: &[NodeId], dest: Dest) {
        if !forms.is_empty() {
            self.progn(forms, dest);
        }
    }
}
