//! Forms of the programs: their text, and forms that are simpler.

use std::fmt::Write;

/// A form. Every form returns a number; each `Out` prints a line.
#[derive(Clone, Debug)]
pub(crate) enum Form {
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
pub(crate) const CAPACITY: u32 = 2;
/// Tasks that no program has at a time.
pub(crate) const ENOUGH: u32 = 100;

#[derive(Clone, Debug)]
pub(crate) struct Clause {
    pub(crate) cause: usize,
    pub(crate) retries: u32,
    pub(crate) backs_off: bool,
    pub(crate) body: Form,
    pub(crate) end: ClauseEnd,
}

#[derive(Clone, Copy, Debug)]
pub(crate) enum ClauseEnd {
    Retry,
    Abort(u32),
    Resume(u32),
    Fail(usize),
}

/// Causes. `ABOVE` lists the causes above each.
pub(crate) const CAUSES: [&str; 10] = [
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
pub(crate) const ABOVE: [&[usize]; 10] = [&[5], &[5], &[0, 5], &[4, 5], &[5], &[], &[5], &[5], &[5], &[5]];
pub(crate) const ALL_FAILED: usize = 6;
pub(crate) const RESTARTS_EXHAUSTED: usize = 7;
pub(crate) const RESOURCE_DENIED: usize = 8;
pub(crate) const QUOTA_EXHAUSTED: usize = 9;

/// Writes a form as a program has it.
pub(crate) fn write(form: &Form, text: &mut String) {
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

/// Returns the forms that are one step simpler.
pub(crate) fn simpler(form: &Form) -> Vec<Form> {
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
