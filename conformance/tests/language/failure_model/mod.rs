//! Compares the machine with a model on random nests of recovery forms, cleanups, handlers, throws and
//! failures, and of the forms of coordination: tasks that belong to a form, supervision, resources, quotas
//! and suspension.
//!
//! The model states the promises of the language in a few lines: a failure searches the enclosing forms from
//! the inside out and calls what it finds; leaving a form is an error value; nothing outside of a task is
//! found by its failures, which fail the form that it belongs to. The model shares nothing with the
//! implementation, which has a control stack, masks and an unwinding state, and tasks that run at the same
//! time.

mod form;
mod model;
mod random;

use std::fmt::Write;

use esl::host::VirtualHost;
use esl::program::{self, Source};

use form::{Form, simpler, write};
use model::expectation;
use random::Random;

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
