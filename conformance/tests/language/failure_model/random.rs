//! Random forms.

use super::form::*;

/// Source of random forms.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    fn below(&mut self, limit: u32) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 33) as u32 % limit
    }

    fn cause(&mut self) -> usize {
        self.below(3) as usize
    }

    fn boxed(&mut self, depth: u32) -> Box<Form> {
        Box::new(self.form(depth))
    }

    /// Returns a form that is at most so deep.
    pub(crate) fn form(&mut self, depth: u32) -> Form {
        let number = self.below(1000);
        if depth == 0 {
            return match self.below(6) {
                0 => Form::Number(number),
                1 => Form::Wrong,
                2 => Form::Throw(self.below(2)),
                3 => Form::Out(number),
                _ => Form::Fail(self.cause()),
            };
        }
        match self.below(22) {
            0..=3 => {
                let forms = (0..1 + self.below(4)).map(|_| self.form(depth - 1)).collect();
                Form::Sequence(forms)
            }
            4..=7 => {
                let clauses = (0..1 + self.below(3)).map(|_| self.clause(depth - 1)).collect();
                Form::Recovery(clauses, self.boxed(depth - 1))
            }
            8 => Form::FailureCleanup(self.boxed(depth - 1), self.boxed(depth.min(2) - 1)),
            9 => Form::Protect(self.boxed(depth - 1), self.boxed(depth.min(2) - 1)),
            10 => Form::Catch(self.below(2), self.boxed(depth - 1)),
            11 => Form::HandlerCase(self.boxed(depth - 1), self.boxed(depth - 1)),
            12 => Form::HandlerBind(self.boxed(depth - 1), self.boxed(depth.min(2) - 1)),
            13 => Form::TryInOrder((0..1 + self.below(3)).map(|_| self.form(depth - 1)).collect()),
            14 => Form::Pursue(self.boxed(depth - 1)),
            15 => Form::PartialOrder(self.boxed(depth - 1), self.boxed(depth - 1)),
            16 => Form::Supervise(self.below(3), self.boxed(depth - 1)),
            17 | 18 => Form::Resource(self.boxed(depth - 1)),
            19 => Form::Suspended(self.boxed(depth - 1)),
            // Tasks that a cleanup makes are not counted once the quota is exhausted, so cleanups have none.
            _ if depth > 2 => Form::Quota(if self.below(2) == 0 { 0 } else { ENOUGH }, self.boxed(depth - 1)),
            _ => Form::Number(number),
        }
    }

    fn clause(&mut self, depth: u32) -> Clause {
        let cause = self.below(CAUSES.len() as u32) as usize;
        let number = self.below(1000);
        let body = self.form(depth.min(2));
        let end = match self.below(6) {
            0 | 1 => ClauseEnd::Retry,
            2 => ClauseEnd::Abort(number),
            3 | 4 => ClauseEnd::Resume(number),
            _ => ClauseEnd::Fail(self.cause()),
        };
        Clause { cause, retries: 1 + self.below(3), backs_off: self.below(4) == 0, body, end }
    }
}
