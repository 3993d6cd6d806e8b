//! Patterns: terms with variables, matched with terms and filled in.

use super::super::effort::Effort;
use super::{Term, TermError, Terms};

impl Terms {
    /// Returns a pattern with its variables replaced, if all of them have values. The caller does not hold
    /// the term; new pairs are appended to `made`, held.
    ///
    /// # Errors
    /// [`TermError::TooLarge`].
    pub(crate) fn instantiate(
        &mut self,
        pattern: Term,
        bindings: &[Term],
        made: &mut Vec<Term>,
        effort: &mut Effort,
    ) -> Result<Option<Term>, TermError> {
        if let Some(variable) = pattern.as_variable() {
            let term = bindings[variable];
            return Ok(if term.is_unbound() { None } else { Some(term) });
        }
        if self.is_ground(pattern) {
            return Ok(Some(pattern));
        }
        self.rebuild(pattern, made, effort, &mut |variable| {
            let term = bindings[variable];
            if term.is_unbound() { None } else { Some(term) }
        })
    }

    /// Returns a pattern with its variables replaced by `replace`; `None` if that returns `None` for one of
    /// them.
    pub(crate) fn rebuild(
        &mut self,
        pattern: Term,
        made: &mut Vec<Term>,
        effort: &mut Effort,
        replace: &mut dyn FnMut(usize) -> Option<Term>,
    ) -> Result<Option<Term>, TermError> {
        enum Open {
            Make(Term),
            Join,
        }
        let mut open = vec![Open::Make(pattern)];
        let mut terms: Vec<Term> = Vec::new();
        while let Some(next) = open.pop() {
            effort.spend(1);
            match next {
                Open::Make(term) if self.is_ground(term) => terms.push(term),
                Open::Make(term) => match (term.as_variable(), self.as_pair(term)) {
                    (Some(variable), _) => match replace(variable) {
                        Some(term) => terms.push(term),
                        None => return Ok(None),
                    },
                    (None, Some((car, cdr))) => {
                        open.push(Open::Join);
                        open.push(Open::Make(cdr));
                        open.push(Open::Make(car));
                    }
                    (None, None) => terms.push(term),
                },
                Open::Join => {
                    let (cdr, car) = (terms.pop().unwrap_or(Term::NIL), terms.pop().unwrap_or(Term::NIL));
                    self.retain(car);
                    self.retain(cdr);
                    let pair = self.pair(car, cdr)?;
                    made.push(pair);
                    terms.push(pair);
                }
            }
        }
        Ok(terms.pop())
    }

    /// Matches a pattern with a ground term: binds variables in `bindings`, and appends them to `trail`.
    pub(crate) fn matches(
        &self,
        pattern: Term,
        term: Term,
        bindings: &mut [Term],
        trail: &mut Vec<u32>,
        effort: &mut Effort,
    ) -> bool {
        if let Some(variable) = pattern.as_variable() {
            let bound = bindings[variable];
            if bound.is_unbound() {
                bindings[variable] = term;
                trail.push(variable as u32);
                return true;
            }
            return bound == term;
        }
        if self.is_ground(pattern) {
            return pattern == term;
        }
        let mut open = vec![(pattern, term)];
        while let Some((pattern, term)) = open.pop() {
            effort.spend(1);
            if let Some(variable) = pattern.as_variable() {
                let bound = bindings[variable];
                if bound.is_unbound() {
                    bindings[variable] = term;
                    trail.push(variable as u32);
                } else if bound != term {
                    return false;
                }
            } else if self.is_ground(pattern) {
                if pattern != term {
                    return false;
                }
            } else {
                let (Some(left), Some(right)) = (self.as_pair(pattern), self.as_pair(term)) else {
                    return false;
                };
                open.push((left.1, right.1));
                open.push((left.0, right.0));
            }
        }
        true
    }

    /// Calls `visit` with the number of each variable in a pattern, in textual order.
    pub(crate) fn variables(&self, pattern: Term, visit: &mut dyn FnMut(usize)) {
        if let Some(variable) = pattern.as_variable() {
            return visit(variable);
        }
        if self.is_ground(pattern) {
            return;
        }
        let mut open = vec![pattern];
        while let Some(term) = open.pop() {
            if let Some(variable) = term.as_variable() {
                visit(variable);
            } else if !self.is_ground(term)
                && let Some((car, cdr)) = self.as_pair(term)
            {
                open.push(cdr);
                open.push(car);
            }
        }
    }
}
