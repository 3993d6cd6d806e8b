//! Compares the machine with a model on random nests of recovery forms, cleanups, handlers, throws and
//! failures.
//!
//! The model states the promises of the language in a few lines: a failure searches the enclosing forms from
//! the inside out and calls what it finds; leaving a form is an error value. The model shares nothing with
//! the implementation, which has a control stack, masks and an unwinding state.

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
}

#[derive(Clone, Debug)]
struct Clause {
    cause: usize,
    retries: u32,
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

/// Causes. `ABOVE` lists the causes above each; the last is above all others.
const CAUSES: [&str; 6] = [":a", ":b", ":under-a", ":type-error", ":error", ":general-failure"];
const ABOVE: [&[usize]; 6] = [&[5], &[5], &[0, 5], &[4, 5], &[5], &[]];

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
    /// The program takes too many steps and is not compared.
    TooLong,
}

struct Model {
    output: Vec<u32>,
    activations: usize,
    steps: usize,
    catches: Vec<u32>,
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
                        self.form(cleanup, enclosing)?;
                        self.fail(cause, enclosing)
                    }
                    outcome => outcome,
                }
            }
            Form::Protect(body, cleanup) => {
                let outcome = self.form(body, enclosing);
                if !matches!(outcome, Err(NonLocalExit::TooLong)) {
                    self.form(cleanup, enclosing)?;
                }
                outcome
            }
            Form::Catch(tag, body) => {
                self.catches.push(*tag);
                let outcome = self.form(body, enclosing);
                self.catches.pop();
                match outcome {
                    Err(NonLocalExit::Throw(thrown)) if thrown == *tag => Ok(thrown),
                    outcome => outcome,
                }
            }
            // Without a matching catch, the throw would be a control error.
            Form::Throw(tag) if self.catches.contains(tag) => Err(NonLocalExit::Throw(*tag)),
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
        }
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
        unreachable!("a handler encloses every program")
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
        match self.below(13) {
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
            _ => Form::HandlerBind(self.boxed(depth - 1), self.boxed(depth.min(2) - 1)),
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
        Clause { cause, retries: 1 + self.below(3), body, end }
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
    }
}

/// The tags that are caught are kept in a special variable, which is bound as catches are.
const PRELUDE: &str = "
(define-cause :under-a (:a))
(defvar *tags* '())
(defun out (n) (format t \"~d~%\" n) n)
(defun zero () 0)
(defmacro with-tag (tag &body body) `(catch ,tag (let ((*tags* (cons ,tag *tags*))) ,@body)))
(defun throw-if-caught (tag) (if (member tag *tags*) (throw tag tag) 0))
";

/// What a program is expected to write; `None` if it takes too long.
fn expectation(form: &Form) -> Option<String> {
    let mut model = Model { output: Vec::new(), activations: 0, steps: 0, catches: Vec::new() };
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
