//! The model: what a form evaluates to, and what it prints.

use std::cell::RefCell;
use std::fmt::Write;
use std::rc::Rc;

use super::form::*;

/// Returns the expected output of a program; `None` if it takes too long.
pub(crate) fn expectation(form: &Form) -> Option<String> {
    let mut model = Model {
        output: Vec::new(),
        activations: 0,
        steps: 0,
        catches: Vec::new(),
        held: 0,
        quotas: Vec::new(),
        around: 0,
        cleanups: 0,
        pending: None,
    };
    let value = model.form(form, &[]).ok()?;
    let mut text = String::new();
    model.output.iter().for_each(|out| _ = writeln!(text, "{out}"));
    _ = writeln!(text, "value {value}");
    Some(text)
}

/// A form that encloses the one being evaluated. Numbers identify activations.
#[derive(Clone)]
enum Enclosing {
    Recovery(usize, Rc<Vec<Clause>>, Rc<RefCell<Vec<u32>>>),
    FailureCleanup(usize),
    HandlerCase(usize),
    HandlerBind(Rc<Form>),
}

/// A non-local exit; its target is the number of an activation.
enum NonLocalExit {
    Retry(usize),
    Abort(usize, u32),
    ToCleanup(usize, usize),
    ToCase(usize),
    Throw(u32),
    /// The task fails with this cause.
    Failed(usize),
    /// A quota is exhausted, and ends its form.
    ToQuota(usize),
    /// The program takes too many steps and is not compared.
    TooLong,
}

struct Model {
    output: Vec<u32>,
    activations: usize,
    steps: usize,
    /// Tags that are caught in this task, each with the number of quotas around it.
    catches: Vec<(u32, usize)>,
    held: u32,
    quotas: Vec<Quota>,
    /// Number of the quotas around this task.
    around: usize,
    /// Number of cleanups that run.
    cleanups: usize,
    /// Index of the outermost quota that was exhausted in a cleanup, which is waited for.
    pending: Option<usize>,
}

/// A quota of tasks that is in force.
struct Quota {
    activation: usize,
    left: u32,
    is_spent: bool,
}

type Evaluation = Result<u32, NonLocalExit>;

impl Model {
    fn activation(&mut self) -> usize {
        self.activations += 1;
        self.activations
    }

    fn form(&mut self, form: &Form, enclosing: &[Enclosing]) -> Evaluation {
        self.steps += 1;
        if self.steps > 3000 {
            return Err(NonLocalExit::TooLong);
        }
        let with =
            |entry: Enclosing| -> Vec<Enclosing> { enclosing.iter().cloned().chain([entry]).collect() };
        match form {
            Form::Number(number) => Ok(*number),
            Form::Out(number) => {
                self.output.push(*number);
                Ok(*number)
            }
            Form::Sequence(forms) => forms.iter().try_fold(0, |_, form| self.form(form, enclosing)),
            Form::Fail(cause) => self.fail(*cause, enclosing),
            Form::Wrong => self.fail(3, enclosing),
            Form::Recovery(clauses, body) => {
                let me = self.activation();
                let left = Rc::new(RefCell::new(clauses.iter().map(|clause| clause.retries).collect()));
                let inside = with(Enclosing::Recovery(me, Rc::new(clauses.clone()), left));
                loop {
                    match self.form(body, &inside) {
                        Err(NonLocalExit::Retry(target)) if target == me => {}
                        Err(NonLocalExit::Abort(target, value)) if target == me => return Ok(value),
                        outcome => return outcome,
                    }
                }
            }
            Form::FailureCleanup(body, cleanup) => {
                let me = self.activation();
                match self.form(body, &with(Enclosing::FailureCleanup(me))) {
                    Err(NonLocalExit::ToCleanup(target, cause)) if target == me => {
                        self.cleanup(cleanup, enclosing, Ok(0))?;
                        self.fail(cause, enclosing)
                    }
                    Err(NonLocalExit::ToQuota(quota)) => self.clean_up_for(quota, cleanup, enclosing),
                    outcome => outcome,
                }
            }
            Form::Protect(body, cleanup) => match self.form(body, enclosing) {
                Err(NonLocalExit::TooLong) => Err(NonLocalExit::TooLong),
                Err(NonLocalExit::ToQuota(quota)) => self.clean_up_for(quota, cleanup, enclosing),
                outcome => {
                    self.form(cleanup, enclosing)?;
                    outcome
                }
            },
            Form::Catch(tag, body) => {
                self.catches.push((*tag, self.quotas.len()));
                let outcome = self.form(body, enclosing);
                self.catches.pop();
                match outcome {
                    Err(NonLocalExit::Throw(thrown)) if thrown == *tag => Ok(thrown),
                    outcome => outcome,
                }
            }
            // Without a matching catch, the throw would be a control error.
            Form::Throw(tag) if self.catches.iter().any(|(caught, _)| caught == tag) => {
                Err(NonLocalExit::Throw(*tag))
            }
            Form::Throw(_) => Ok(0),
            Form::HandlerCase(body, clause) => {
                let me = self.activation();
                match self.form(body, &with(Enclosing::HandlerCase(me))) {
                    Err(NonLocalExit::ToCase(target)) if target == me => self.form(clause, enclosing),
                    outcome => outcome,
                }
            }
            Form::HandlerBind(body, handler) => {
                self.form(body, &with(Enclosing::HandlerBind(Rc::new((**handler).clone()))))
            }
            Form::TryInOrder(bodies) => {
                for body in bodies {
                    match self.task(body) {
                        Err(NonLocalExit::Failed(_)) => {}
                        outcome => return outcome,
                    }
                }
                self.fail(ALL_FAILED, enclosing)
            }
            Form::Pursue(body) | Form::Suspended(body) => match self.task(body) {
                Err(NonLocalExit::Failed(cause)) => self.fail(cause, enclosing),
                outcome => outcome,
            },
            Form::PartialOrder(first, second) => {
                let outcome = self.task(first).and_then(|_| self.task(second));
                match outcome {
                    Err(NonLocalExit::Failed(cause)) => self.fail(cause, enclosing),
                    outcome => outcome,
                }
            }
            Form::Supervise(restarts, body) => {
                for _ in 0..=*restarts {
                    match self.task(body) {
                        Err(NonLocalExit::Failed(_)) => {}
                        outcome => return outcome.map(|_| 0),
                    }
                }
                self.fail(RESTARTS_EXHAUSTED, enclosing).map(|_| 0)
            }
            Form::Resource(_) if self.held == CAPACITY => self.fail(RESOURCE_DENIED, enclosing),
            Form::Resource(body) => {
                self.held += 1;
                let outcome = self.form(body, enclosing);
                self.held -= 1;
                outcome
            }
            Form::Quota(tasks, body) => {
                let me = self.activation();
                self.quotas.push(Quota { activation: me, left: *tasks, is_spent: false });
                let outcome = self.form(body, enclosing);
                self.quotas.pop();
                match outcome {
                    Err(NonLocalExit::ToQuota(target)) if target == me => {
                        self.fail(QUOTA_EXHAUSTED, enclosing)
                    }
                    outcome => outcome,
                }
            }
        }
    }

    /// Evaluates a cleanup after a body with this outcome.
    fn cleanup(&mut self, cleanup: &Form, enclosing: &[Enclosing], outcome: Evaluation) -> Evaluation {
        self.cleanups += 1;
        let outcome = self.form(cleanup, enclosing).and(outcome);
        self.cleanups -= 1;
        match self.pending.filter(|_| self.cleanups == 0) {
            None => outcome,
            Some(index) => {
                self.pending = None;
                let quota = self.quotas[index].activation;
                if self.is_left_by(index, &outcome) { outcome } else { Err(NonLocalExit::ToQuota(quota)) }
            }
        }
    }

    /// Returns whether an exit leaves the form of a quota.
    fn is_left_by(&self, index: usize, outcome: &Evaluation) -> bool {
        let activation = self.quotas[index].activation;
        match outcome {
            Ok(_) => false,
            Err(NonLocalExit::TooLong) => true,
            Err(NonLocalExit::Failed(_)) => index >= self.around,
            Err(NonLocalExit::Throw(tag)) => {
                let target = self.catches.iter().rev().find(|(caught, _)| caught == tag);
                target.is_some_and(|&(_, quotas)| quotas <= index)
            }
            Err(
                NonLocalExit::Retry(target)
                | NonLocalExit::Abort(target, _)
                | NonLocalExit::ToCleanup(target, _)
                | NonLocalExit::ToCase(target)
                | NonLocalExit::ToQuota(target),
            ) => *target < activation,
        }
    }

    /// Evaluates a cleanup on the way to a quota's form. No exit from the cleanup changes where it goes.
    fn clean_up_for(&mut self, quota: usize, cleanup: &Form, enclosing: &[Enclosing]) -> Evaluation {
        self.cleanups += 1;
        let outcome = self.form(cleanup, enclosing);
        self.cleanups -= 1;
        match outcome {
            Err(NonLocalExit::TooLong) => Err(NonLocalExit::TooLong),
            _ => Err(NonLocalExit::ToQuota(quota)),
        }
    }

    /// Evaluates a form in a task of its own.
    fn task(&mut self, form: &Form) -> Evaluation {
        let exhausted = self.quotas.iter().position(|quota| quota.left == 0 && !quota.is_spent);
        if let Some(outermost) = exhausted {
            for quota in self.quotas.iter_mut().filter(|quota| quota.left == 0) {
                quota.is_spent = true;
            }
            // A cleanup comes to its end, and may make tasks.
            if self.cleanups == 0 {
                return Err(NonLocalExit::ToQuota(self.quotas[outermost].activation));
            }
            self.pending = Some(self.pending.map_or(outermost, |pending| pending.min(outermost)));
        }
        let catches = std::mem::take(&mut self.catches);
        let around = std::mem::replace(&mut self.around, self.quotas.len());
        let outcome = self.form(form, &[]);
        self.around = around;
        self.catches = catches;
        outcome
    }

    fn fail(&mut self, cause: usize, enclosing: &[Enclosing]) -> Evaluation {
        for (index, entry) in enclosing.iter().enumerate().rev() {
            match entry {
                Enclosing::FailureCleanup(id) => return Err(NonLocalExit::ToCleanup(*id, cause)),
                Enclosing::HandlerCase(id) => return Err(NonLocalExit::ToCase(*id)),
                Enclosing::HandlerBind(handler) => drop(self.form(&handler.clone(), &enclosing[..index])?),
                Enclosing::Recovery(id, clauses, left) => {
                    let applies =
                        |clause: &Clause| clause.cause == cause || ABOVE[cause].contains(&clause.cause);
                    let found = (0..clauses.len()).find(|&at| left.borrow()[at] > 0 && applies(&clauses[at]));
                    let Some(at) = found else { continue };
                    left.borrow_mut()[at] -= 1;
                    // The form's own clauses are in force, and everything outside the form.
                    let enclosing = &enclosing[..=index];
                    self.form(&clauses[at].body, enclosing)?;
                    return match clauses[at].end {
                        ClauseEnd::Retry => Err(NonLocalExit::Retry(*id)),
                        ClauseEnd::Abort(value) => Err(NonLocalExit::Abort(*id, value)),
                        ClauseEnd::Resume(value) => Ok(value),
                        ClauseEnd::Fail(cause) => self.fail(cause, enclosing),
                    };
                }
            }
        }
        Err(NonLocalExit::Failed(cause))
    }
}
