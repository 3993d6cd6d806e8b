//! Conditionals. A form in test position never makes a boolean: it jumps to one segment or the other.

use super::builder::FunctionBuilder;
use super::dest::Dest;
use super::graph::Cond;
use crate::core::NodeId;

impl FunctionBuilder<'_, '_> {
    /// Lowers `if`.
    pub(super) fn if_form(&mut self, test: NodeId, consequent: NodeId, alternative: NodeId, dest: Dest) {
        let (holds, fails, end) = (self.graph.label(), self.graph.label(), self.graph.label());
        self.form(test, Dest::Test { holds, fails });
        self.graph.bind(holds);
        self.form(consequent, dest);
        self.join(end, dest);
        self.graph.bind(fails);
        self.form(alternative, dest);
        if dest.goes_on() {
            self.graph.bind(end);
        }
    }

    /// Lowers `and`.
    pub(super) fn and(&mut self, forms: &[NodeId], dest: Dest) {
        let Some((&last, others)) = forms.split_last() else { return self.deliver_true(dest) };
        let end = self.graph.label();
        let missing = match dest {
            Dest::Test { fails, .. } => fails,
            Dest::Effect => end,
            _ => self.graph.label(),
        };
        for &form in others {
            let next = self.graph.label();
            self.form(form, Dest::Test { holds: next, fails: missing });
            self.graph.bind(next);
        }
        self.form(last, dest);
        match dest {
            Dest::Test { .. } => return,
            Dest::Effect => {}
            _ => {
                self.join(end, dest);
                self.graph.bind(missing);
                self.deliver_nil(dest);
            }
        }
        if dest.goes_on() {
            self.graph.bind(end);
        }
    }

    /// Lowers `or`.
    pub(super) fn or(&mut self, forms: &[NodeId], dest: Dest) {
        let Some((&last, others)) = forms.split_last() else { return self.deliver_nil(dest) };
        let end = self.graph.label();
        for &form in others {
            let next = self.graph.label();
            match dest {
                Dest::Test { holds, .. } => self.form(form, Dest::Test { holds, fails: next }),
                Dest::Effect => self.form(form, Dest::Test { holds: end, fails: next }),
                _ => {
                    let top = self.registers.top();
                    let value = self.operand(form, &[]);
                    let found = self.graph.label();
                    self.branch(Cond::Nil(value), next, found);
                    self.graph.bind(found);
                    self.deliver(value, dest);
                    self.join(end, dest);
                    self.registers.release(top);
                }
            }
            self.graph.bind(next);
        }
        self.form(last, dest);
        if dest.goes_on() {
            self.graph.bind(end);
        }
    }
}
