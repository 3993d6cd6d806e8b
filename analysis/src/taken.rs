//! The rows of clauses: the failures that each takes, and its answer.

use std::collections::{BTreeMap, BTreeSet};

use esl_compiler::core::NodeKind;

use crate::cause::shown_cause;
use crate::clause::{Clause, ClauseLimit};
use crate::forms::ScopeKind;
use crate::guard::{FailureId, LeavingFailures};
use crate::row::ClauseRow;
use crate::table::Maker;
use crate::value::Code;

impl Maker<'_, '_> {
    /// Returns the clauses, each with its form, its scope and its position.
    pub(crate) fn clauses(&self) -> Vec<((u32, usize, usize), ClauseRow)> {
        type ClauseGroup = (BTreeSet<(FailureId, bool)>, u8, LeavingFailures, Vec<Code>);
        let mut groups: BTreeMap<(u32, usize, usize), ClauseGroup> = BTreeMap::new();
        for ((number, scope), handled) in &self.solution.handled {
            let code = self.flow.running[*number].code;
            let form = &self.flow.forms.forms[code.form as usize];
            for (position, taken) in handled.taken.iter().enumerate() {
                let group = groups.entry((code.form, *scope, position)).or_default();
                group.0.extend(taken);
                group.3.push(code);
                group.1 |= handled.mistakes[position];
                if let ScopeKind::Recovery { procedures, .. } = &form.scopes[*scope].kind
                    && let Some(runner) = self.flow.number_of(Code { lambda: *procedures, ..code })
                    && let Some(leaving) = self.solution.of_clauses.get(&(runner, position))
                {
                    group.2.add(leaving);
                }
            }
        }
        let mut rows = Vec::new();
        for ((form, scope, position), (taken, mistakes, fails, codes)) in groups {
            let text = &self.flow.forms.forms[form as usize];
            let mut never_ends = false;
            let (node, wanted, answer) = match &text.scopes[scope].kind {
                ScopeKind::Recovery { node, clauses, .. } => {
                    let clause = &clauses[position];
                    let resumes = self.solution.resuming.contains(&(form, *node, position));
                    never_ends = !resumes;
                    let answer = answer_of(clause, resumes, taken.iter().any(|(_, goes_on)| *goes_on));
                    (clause.body, shown_cause(&clause.cause), answer)
                }
                ScopeKind::Cases { node, types } => {
                    let NodeKind::HandlerCase(_, clauses) = text.kind(*node) else { continue };
                    let wanted = types[position].to_string().to_lowercase();
                    (clauses[position].body, wanted, "ends the form, and goes on in the clause".into())
                }
                ScopeKind::Handlers { node, types } => {
                    (*node, types[position].to_string().to_lowercase(), "leaves by the handler".to_string())
                }
                ScopeKind::ClauseBody(_) => continue,
            };
            let span = self.span_of_clause(form, scope, node);
            let place = self.place_of(span);
            if !self.is_own(&place.source) {
                continue;
            }
            let mut causes = self.rows(taken.iter().map(|(failure, _)| *failure), mistakes, &codes);
            for row in &mut causes {
                let goes_on = taken.iter().any(|(failure, goes_on)| {
                    *goes_on && self.cause(self.solution.kinds[*failure as usize]) == row.cause
                });
                if goes_on {
                    row.spent = vec![place.clone()];
                }
            }
            let row = ClauseRow {
                function: self.function_around(form, text.owners[node.index()]),
                place,
                wanted,
                answer,
                causes,
                fails: self.rows_of(&fails, &codes),
                span,
                never_ends,
            };
            rows.push(((form, scope, position), row));
        }
        rows.sort_by(|left, right| (&left.1.place, left.0).cmp(&(&right.1.place, right.0)));
        rows
    }
}

/// Returns the answer of a clause, in words.
fn answer_of(clause: &Clause, resumes: bool, goes_on: bool) -> String {
    let times = match clause.limit {
        ClauseLimit::Times(1) => " once".to_string(),
        ClauseLimit::Times(times) => format!(" at most {times} times"),
        ClauseLimit::None => String::new(),
        ClauseLimit::Computed => " a computed number of times".into(),
    };
    let mut parts = Vec::new();
    if clause.ways.retries {
        let pause = if clause.ways.pauses { " after a pause" } else { "" };
        parts.push(
            format!("begins again{pause},{times}").replace(",,", ",").trim_end_matches(',').to_string(),
        );
    }
    if clause.ways.aborts {
        parts.push("ends the form".to_string());
    }
    if resumes {
        parts.push(format!("goes on after the call{times}"));
    }
    if parts.is_empty() {
        parts.push("leaves otherwise".into());
    }
    let spent = if goes_on && clause.limit != ClauseLimit::None { "; then outward" } else { "" };
    format!("{}{spent}", parts.join(" or "))
}
