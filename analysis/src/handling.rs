//! The rows of forms that handle failures: those of the body that a clause takes, and those that pass.

use std::collections::BTreeMap;

use rustc_hash::FxHashSet;

use crate::forms::ScopeKind;
use crate::guard::{FailureId, LeavingFailures};
use crate::row::HandlingForm;
use crate::table::Maker;
use crate::value::Code;

impl Maker<'_, '_> {
    /// Returns the forms of the program's own sources that handle failures.
    pub(crate) fn handling_forms(&self) -> Vec<HandlingForm> {
        /// Failures of the body of a form in all code that runs it.
        #[derive(Default)]
        struct BodyFailures {
            arriving: LeavingFailures,
            taken: FxHashSet<FailureId>,
            codes: Vec<Code>,
        }

        let mut groups: BTreeMap<(u32, usize), BodyFailures> = BTreeMap::new();
        for ((number, scope), handled) in &self.solution.handled {
            let code = self.flow.running[*number].code;
            let group = groups.entry((code.form, *scope)).or_default();
            group.codes.push(code);
            group.arriving.add(&handled.arriving);
            group.taken.extend(handled.taken.iter().flatten().map(|(failure, _)| *failure));
        }
        let mut rows = Vec::new();
        for ((form, scope), group) in groups {
            let text = &self.flow.forms.forms[form as usize];
            let (ScopeKind::Recovery { node, .. }
            | ScopeKind::Cases { node, .. }
            | ScopeKind::Handlers { node, .. }) = text.scopes[scope].kind
            else {
                continue;
            };
            let place = self.place(form, node);
            if !self.is_own(&place.source) {
                continue;
            }
            // A clause may take failures that begin in another one, too.
            let is_taken = |failure: &FailureId| group.taken.contains(failure);
            let (taken, passing): (Vec<FailureId>, Vec<FailureId>) =
                group.arriving.failures.iter().partition(|failure| is_taken(failure));
            rows.push(HandlingForm {
                place,
                span: text.core.nodes[node.index()].span,
                taken: self.rows(taken, 0, &group.codes),
                passing: self.rows(passing, 0, &group.codes),
            });
        }
        rows.sort_by(|left, right| left.place.cmp(&right.place));
        rows
    }
}
