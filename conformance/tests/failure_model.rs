//! Compares the machine with a model on random nests of recovery forms, cleanups, handlers, throws and
//! failures, and of the forms of coordination: tasks that belong to a form, supervision, resources, quotas
//! and suspension.
//!
//! The model states the promises of the language in a few lines: a failure searches the enclosing forms from
//! the inside out and calls what it finds; leaving a form is an error value; nothing outside of a task is
//! found by its failures, which fail the form that it belongs to. The model shares nothing with the
//! implementation, which has a control stack, masks and an unwinding state, and tasks that run at the same
//! time.

use std::cell::RefCell;
use std::fmt::Write;
use std::rc::Rc;

use esl::host::VirtualHost;
use esl::program::{self, Source};

/// A form. Every form returns a number; each `Out` prints a line.
#[derive(Clone, Debug)]
enum Form {
    Number(u32),
    Out(u32),
    Sequence(Vec<Form>),
    Fail(usize),
    /// `(car 0)`: the cause is `:type-error`.
    Wrong,
    Recovery(Vec<Clause>, Box<Form>),
    /// Body and cleanup.
    FailureCleanup(Box<Form>, Box<Form>),
    /// Body and cleanup.
    Protect(Box<Form>, Box<Form>),
    /// Tag and body.
    Catch(u32, Box<Form>),
    Throw(u32),
    /// Body, and the clause whose value a failure returns.
    HandlerCase(Box<Form>, Box<Form>),
    /// Body, and the form that the handler evaluates before it declines.
    HandlerBind(Box<Form>, Box<Form>),
    /// `try-in-order`.
    TryInOrder(Vec<Form>),
    /// `pursue`, beside a task that sleeps.
    Pursue(Box<Form>),
    /// `partial-order`, the first body before the second.
    PartialOrder(Box<Form>, Box<Form>),
    /// `supervise` with a transient child, and its number of restarts.
    Supervise(u32, Box<Form>),
    /// `with-resource`, of [`CAPACITY`]; fails if there is none left.
    Resource(Box<Form>),
    /// A body in a task that another one suspends and resumes.
    Suspended(Box<Form>),
    /// `with-quota` for as many tasks.
    Quota(u32, Box<Form>),
}

/// Capacity of the resource.
const CAPACITY: u32 = 2;
/// Tasks that no program has at a time.
const ENOUGH: u32 = 100;

#[derive(Clone, Debug)]
struct Clause {
    cause: usize,
    retries: u32,
    backs_off: bool,
    body: Form,
    end: ClauseEnd,
}

#[derive(Clone, Copy, Debug)]
enum ClauseEnd {
    Retry,
    Abort(u32),
    Resume(u32),
    Fail(usize),
}

/// Causes. `ABOVE` lists the causes above each.
const CAUSES: [&str; 10] = [
    ":a",
    ":b",
    ":under-a",
    ":type-error",
    ":error",
    ":general-failure",
    ":all-failed",
    ":restarts-exhausted",
    ":resource-denied",
    ":quota-exhausted",
];
const ABOVE: [&[usize]; 10] = [&[5], &[5], &[0, 5], &[4, 5], &[5], &[], &[5], &[5], &[5], &[5]];
const ALL_FAILED: usize = 6;
const RESTARTS_EXHAUSTED: usize = 7;
const RESOURCE_DENIED: usize = 8;
const QUOTA_EXHAUSTED: usize = 9;

// ---- the model

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

// ---- programs

struct Random(u64);

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

    fn form(&mut self, depth: u32) -> Form {
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

fn write(form: &Form, text: &mut String) {
    let two = |before: &str, first: &Form, between: &str, second: &Form, after: &str, text: &mut String| {
        text.push_str(before);
        write(first, text);
        text.push_str(between);
        write(second, text);
        text.push_str(after);
    };
    match form {
        Form::Number(number) => _ = write!(text, "{number}"),
        Form::Out(number) => _ = write!(text, "(out {number})"),
        Form::Sequence(forms) => {
            text.push_str("(progn");
            for form in forms {
                text.push(' ');
                write(form, text);
            }
            text.push(')');
        }
        Form::Fail(cause) => _ = write!(text, "(fail {})", CAUSES[*cause]),
        Form::Wrong => text.push_str("(car (zero))"),
        Form::Recovery(clauses, body) => {
            text.push_str("(with-recovery-procedures (");
            for clause in clauses {
                _ = write!(text, "({} :retries {} ", CAUSES[clause.cause], clause.retries);
                text.push_str(if clause.backs_off { ":backoff (0.1 2 1) " } else { "" });
                write(&clause.body, text);
                _ = match clause.end {
                    ClauseEnd::Retry => write!(text, "(retry))"),
                    ClauseEnd::Abort(value) => write!(text, "(abort {value}))"),
                    ClauseEnd::Resume(value) => write!(text, "(values {value}))"),
                    ClauseEnd::Fail(cause) => write!(text, "(fail {}))", CAUSES[cause]),
                };
            }
            text.push(')');
            write(body, text);
            text.push(')');
        }
        Form::FailureCleanup(body, cleanup) => {
            two("(with-cleanup-procedure ", cleanup, " ", body, ")", text);
        }
        Form::Protect(body, cleanup) => two("(unwind-protect ", body, " ", cleanup, ")", text),
        Form::Catch(tag, body) => {
            _ = write!(text, "(with-tag {tag} ");
            write(body, text);
            text.push(')');
        }
        Form::Throw(tag) => _ = write!(text, "(throw-if-caught {tag})"),
        Form::HandlerCase(body, clause) => {
            two("(handler-case ", body, " (serious-condition () ", clause, "))", text);
        }
        Form::HandlerBind(body, handler) => {
            two(
                "(handler-bind ((serious-condition (lambda (c) (declare (ignore c)) ",
                handler,
                "))) ",
                body,
                ")",
                text,
            );
        }
        Form::TryInOrder(bodies) => {
            text.push_str("(try-in-order");
            for (number, body) in bodies.iter().enumerate() {
                _ = write!(text, " (a{number} ");
                write_task(body, text);
                text.push(')');
            }
            text.push(')');
        }
        Form::Pursue(body) => {
            text.push_str("(pursue (a ");
            write_task(body, text);
            text.push_str(") (b (sleep 1000000)))");
        }
        Form::PartialOrder(first, second) => {
            text.push_str("(values (partial-order ((b ");
            write_task(second, text);
            text.push_str(") (a ");
            write_task(first, text);
            text.push_str(")) (:order a b)))");
        }
        Form::Supervise(restarts, body) => {
            _ = write!(text, "(progn (supervise (:restarts {restarts} :within 1000000) ");
            text.push_str("(a :restart :transient :backoff (0 1 0) ");
            write_task(body, text);
            text.push_str(")) 0)");
        }
        Form::Resource(body) => {
            text.push_str("(with-resource (arm :if-denied :fail) ");
            write(body, text);
            text.push(')');
        }
        Form::Suspended(body) => {
            text.push_str("(values (task-net (a ");
            write_task(body, text);
            text.push_str(") (b (suspend-task a) (resume-task a))))");
        }
        Form::Quota(tasks, body) => {
            _ = write!(text, "(with-quota (:tasks {tasks}) ");
            write(body, text);
            text.push(')');
        }
    }
}

/// Writes the body of a task, in which no tag is caught.
fn write_task(form: &Form, text: &mut String) {
    text.push_str("(let ((*tags* '())) ");
    write(form, text);
    text.push(')');
}

/// The tags that are caught are kept in a special variable, which is bound as catches are.
const PRELUDE: &str = "
(define-cause :under-a (:a))
(defvar *tags* '())
(defun out (n) (format t \"~d~%\" n) n)
(defun zero () 0)
(defmacro with-tag (tag &body body) `(catch ,tag (let ((*tags* (cons ,tag *tags*))) ,@body)))
(define-resource arm :capacity 2)
(defun throw-if-caught (tag) (if (member tag *tags*) (throw tag tag) 0))
";

/// What a program is expected to write; `None` if it takes too long.
fn expectation(form: &Form) -> Option<String> {
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

/// Returns the output of a program run alone.
fn outcome(form: &Form, slice: u32) -> String {
    let mut text = format!("{PRELUDE}(format t \"value ~d~%\" ");
    write(form, &mut text);
    text.push(')');
    let compiled = program::compile(&[Source::new("random", text)]);
    let host = VirtualHost::new();
    let captured = host.captured();
    let config = esl::Config { slice, ..esl::Config::default() };
    let program = compiled.program.expect("random programs compile");
    program::run(&program, config, Box::new(host)).expect("the program can start");
    captured.output()
}

/// Returns the forms that are one step simpler.
fn simpler(form: &Form) -> Vec<Form> {
    let mut found = Vec::new();
    let mut pair = |a: &Form, b: &Form, make: &dyn Fn(Box<Form>, Box<Form>) -> Form| {
        found.extend([a.clone(), b.clone()]);
        found.extend(simpler(a).into_iter().map(|a| make(Box::new(a), Box::new(b.clone()))));
        found.extend(simpler(b).into_iter().map(|b| make(Box::new(a.clone()), Box::new(b))));
    };
    match form {
        Form::Number(_) => {}
        Form::Out(_) | Form::Wrong | Form::Throw(_) | Form::Fail(_) => found.push(Form::Number(0)),
        Form::FailureCleanup(a, b) => pair(a, b, &Form::FailureCleanup),
        Form::Protect(a, b) => pair(a, b, &Form::Protect),
        Form::HandlerCase(a, b) => pair(a, b, &Form::HandlerCase),
        Form::HandlerBind(a, b) => pair(a, b, &Form::HandlerBind),
        Form::Catch(tag, body) => {
            found.push((**body).clone());
            found.extend(simpler(body).into_iter().map(|body| Form::Catch(*tag, Box::new(body))));
        }
        Form::PartialOrder(a, b) => pair(a, b, &Form::PartialOrder),
        Form::Pursue(body) | Form::Resource(body) | Form::Suspended(body) => {
            let make: fn(Box<Form>) -> Form = match form {
                Form::Pursue(_) => Form::Pursue,
                Form::Resource(_) => Form::Resource,
                _ => Form::Suspended,
            };
            found.push((**body).clone());
            found.extend(simpler(body).into_iter().map(|body| make(Box::new(body))));
        }
        Form::Supervise(number, body) | Form::Quota(number, body) => {
            let make: fn(u32, Box<Form>) -> Form =
                if matches!(form, Form::Quota(..)) { Form::Quota } else { Form::Supervise };
            found.push((**body).clone());
            found.extend(simpler(body).into_iter().map(|body| make(*number, Box::new(body))));
        }
        Form::TryInOrder(forms) => {
            found.extend(forms.iter().cloned());
            for at in 0..forms.len() {
                let mut fewer = forms.clone();
                fewer.remove(at);
                if !fewer.is_empty() {
                    found.push(Form::TryInOrder(fewer));
                }
                for form in simpler(&forms[at]) {
                    let mut forms = forms.clone();
                    forms[at] = form;
                    found.push(Form::TryInOrder(forms));
                }
            }
        }
        Form::Sequence(forms) => {
            found.extend(forms.iter().cloned());
            for at in 0..forms.len() {
                let mut fewer = forms.clone();
                fewer.remove(at);
                found.push(Form::Sequence(fewer));
                for form in simpler(&forms[at]) {
                    let mut forms = forms.clone();
                    forms[at] = form;
                    found.push(Form::Sequence(forms));
                }
            }
        }
        Form::Recovery(clauses, body) => {
            found.push((**body).clone());
            for at in 0..clauses.len() {
                let mut fewer = clauses.clone();
                fewer.remove(at);
                found.push(Form::Recovery(fewer, body.clone()));
                for form in simpler(&clauses[at].body) {
                    let mut clauses = clauses.clone();
                    clauses[at].body = form;
                    found.push(Form::Recovery(clauses, body.clone()));
                }
            }
            found.extend(
                simpler(body).into_iter().map(|body| Form::Recovery(clauses.clone(), Box::new(body))),
            );
        }
    }
    found
}

/// Simplifies a form for which machine and model differ, as long as they still differ.
fn simplest(mut form: Form, slice: u32) -> Form {
    let differs = |form: &Form| expectation(form).is_some_and(|expected| expected != outcome(form, slice));
    while let Some(next) =
        simpler(&form).into_iter().find(|form| matches!(form, Form::HandlerCase(..)) && differs(form))
    {
        form = next;
    }
    form
}

#[test]
fn the_machine_does_what_the_model_says() {
    let mut random = Random(0x2545_F491_4F6C_DD1D);
    for batch in 0..25 {
        let mut text = PRELUDE.to_string();
        let mut expected = Vec::new();
        while expected.len() < 60 {
            let form = random.form(5);
            let whole = Form::HandlerCase(Box::new(form), Box::new(Form::Out(7777)));
            let Some(output) = expectation(&whole) else { continue };
            _ = write!(text, "(defun program-{} () ", expected.len());
            write(&whole, &mut text);
            text.push_str(")\n");
            expected.push((whole, output));
        }
        for number in 0..expected.len() {
            _ = writeln!(text, "(format t \"value ~d~%\" (program-{number}))");
        }
        let compiled = program::compile(&[Source::new("random", text)]);
        let program = compiled.program.expect("random programs compile");
        for slice in [2000, 1] {
            let host = VirtualHost::new();
            let captured = host.captured();
            let config = esl::Config { slice, ..esl::Config::default() };
            program::run(&program, config, Box::new(host)).expect("the program can start");
            let output = captured.output();
            let mut rest = output.as_str();
            for (form, expected) in &expected {
                let Some(after) = rest.strip_prefix(expected.as_str()) else {
                    let form = simplest(form.clone(), slice);
                    let mut source = String::new();
                    write(&form, &mut source);
                    panic!(
                        "batch {batch}, slice {slice}:\n{source}\nexpected\n{}found\n{}",
                        expectation(&form).unwrap_or_default(),
                        outcome(&form, slice)
                    );
                };
                rest = after;
            }
            assert_eq!(rest, "");
        }
    }
}
