//! Compilations from text to module.

use std::sync::Arc;

use esl_bytecode::compile::{Compilation, Compile, Part, SourcePlace, Step, StepOutcome, Work, drive};
use esl_bytecode::diagnostic::Severity;
use esl_bytecode::span::SourceId;
use esl_bytecode::verify::verify;
use esl_compiler::session::Compiler;

use crate::host::FakeHost;

#[test]
fn a_text_becomes_one_module_with_a_function_for_each_form() {
    let mut host = FakeHost::new();
    let compiler = Compiler::default();
    let text = "(defun h (x) (* x x))\n(print (h 2))\n(print (h 3))";
    let (module, found) = drive(&mut *compiler.compile_text("test.esl", text), &mut host);
    assert!(found.is_empty(), "{found:?}");
    let module = module.expect("it compiles");
    assert_eq!(module.toplevel.len(), 3);
    assert_eq!(module.sources, ["test.esl"]);
    verify(&module).expect("it verifies");
    assert_eq!(host.loaded.len(), 1, "the definition of `h` is loaded at compile time");
}

#[test]
fn errors_of_all_phases_are_reported_in_the_order_of_the_text() {
    let compiler = Compiler::for_source(SourceId(3));
    let text = "(let 5)\n(print ,x)\n(undefined)\n(car 1 2)\n(print 1))";
    let mut compilation = compiler.compile_text("test.esl", text);
    let (module, found) = drive(&mut *compilation, &mut FakeHost::new());
    assert!(module.is_none());
    let codes: Vec<&str> = found.iter().map(|finding| finding.code).collect();
    // Names are not looked for in a text that could not be read as a whole.
    let expected =
        ["malformed-binding", "comma-outside-backquote", "wrong-argument-count", "unexpected-close"];
    assert_eq!(codes, expected);
    assert!(found.iter().all(|finding| finding.primary.span.source == SourceId(3)));
    let shown = compilation.render(&found[0]);
    assert!(shown.contains("test.esl:1:6"), "{shown}");
}

#[test]
fn texts_that_are_compiled_together_know_each_other() {
    let texts =
        [("a.esl", "(defun first-one () (second-one))"), ("b.esl", "(defun second-one () (third-one))")];
    let mut host = FakeHost::new();
    let compiler = Compiler::for_source(SourceId(5));
    let mut compilation = compiler.compile_texts(&texts);
    let (module, found) = drive(&mut compilation, &mut host);
    assert_eq!(module.expect("it compiles").sources, ["a.esl", "b.esl"]);
    assert_eq!(found.len(), 1);
    assert_eq!(found[0].message, "no function is called `third-one`");
    assert_eq!(found[0].primary.span.source, SourceId(6));
    let shown = compilation.render(&found[0]);
    assert!(shown.contains("b.esl:1:23"), "{shown}");
}

#[test]
fn warnings_do_not_keep_a_program_from_compiling() {
    let text = "(undefined 1)";
    let (module, found) =
        drive(&mut *Compiler::default().compile_text("test.esl", text), &mut FakeHost::new());
    assert!(module.is_some());
    assert!(found.iter().all(|finding| finding.severity == Severity::Warning));
}

#[test]
fn a_form_becomes_a_module_whose_last_function_gives_its_value() {
    let mut host = FakeHost::new();
    let form = host.read("(progn (print 1) (load-time-value (print 2)))");
    let mut compilation = Compiler::default().compile_form(form, None);
    let (module, found) = drive(&mut *compilation, &mut host);
    assert!(found.is_empty(), "{found:?}");
    assert_eq!(module.expect("it compiles").toplevel.len(), 2);
    assert_eq!(host.loaded.len(), 1, "the first form is evaluated before the second is looked at");
}

#[test]
fn what_is_said_of_a_form_of_a_text_has_its_place_in_the_text() {
    let mut host = FakeHost::new();
    let compiler = Compiler::default();
    let text: Arc<str> = "(list 1)\n(é) (list\n (let 5))\n(car)".into();
    let start = "(list 1)\n(é)".len();
    let (form, end) = compiler.read(&mut host, &text, start).expect("it is a datum");
    let part = Part { name: "test.esl", text: &text, range: start..end, line: 1, column: 3 };
    let mut compilation = compiler.compile_form(form.expect("there is one"), Some(part));
    let (_, found) = drive(&mut *compilation, &mut host);
    let shown = compilation.render(&found[0]);
    let lines: Vec<&str> = shown.lines().skip(1).take(4).collect();
    assert_eq!(lines, [" --> test.esl:3:7", "  |", "3 |  (let 5))", "  |       ^"], "{shown}");
}

#[test]
fn uninterned_symbols_are_the_same_in_all_forms_of_a_text() {
    let mut host = FakeHost::new();
    let text = "(twice (print '#1=#:g)) (print '#:g)";
    let (module, _) = drive(&mut *Compiler::default().compile_text("test.esl", text), &mut host);
    let module = module.expect("it compiles");
    let is_g = |constant: &&esl_bytecode::module::Constant| matches!(constant, esl_bytecode::module::Constant::Symbol(symbol) if symbol.name() == "G");
    assert_eq!(module.constants.iter().filter(is_g).count(), 2);
}

#[test]
fn the_work_between_steps_is_charged() {
    let mut host = FakeHost::new();
    let mut compilation = Compiler::default().compile_text("test.esl", "(list (list 1) (list 2) (list 3))");
    let mut work = Work::unbounded();
    let step = compilation.step(&mut host, StepOutcome::Start, &mut work);
    assert!(matches!(step, Step::Done(Some(_), _)));
    assert!(work.done() >= 10, "{work:?}");
}

#[test]
fn a_step_does_a_bounded_part_of_the_work() {
    let mut host = FakeHost::new();
    let function = format!("(lambda () (list {}))", "(f 1) ".repeat(20));
    let text = format!("(list {})", format!("(list {}) ", function.repeat(20)).repeat(20));
    let mut compilation = Compiler::default().compile_text("test.esl", &text);
    let mut answer = StepOutcome::Start;
    let (mut steps, mut most) = (0, 0);
    loop {
        let mut work = Work::up_to(Work::STEP);
        let step = compilation.step(&mut host, answer, &mut work);
        if let Step::Done(module, _) = step {
            assert!(module.is_some());
            break;
        }
        assert!(matches!(step, Step::More), "{step:?}");
        assert!(compilation.bytes() > 0);
        most = most.max(work.done());
        steps += 1;
        answer = StepOutcome::More;
    }
    assert!(steps >= 10, "{steps}");
    // The walk over the whole form before the first function is in one piece.
    assert!(most < 4 * Work::STEP, "{most}");
}

#[test]
fn a_program_can_be_shown_with_its_macros_expanded() {
    let mut expansion = Compiler::default().expand_text("test.esl", "(when *x* (print 1))\n(defun h () 2)");
    let (module, _) = drive(&mut expansion, &mut FakeHost::new());
    assert!(module.is_some());
    let expected = "(if *x* (print 1) ())\n\n(%set-function 'h (%named-lambda h () (block h 2)))\n\n";
    assert_eq!(expansion.expansion(), expected);
}

#[test]
fn a_failure_of_a_macro_shows_the_line_inside_it_after_the_call() {
    let text = "(defmacro failing (form)\n  (list form\n        (car ())))\n(list 1\n  (failing\n    2))";
    let mut host = FakeHost::new();
    host.failing_place = Some(SourcePlace { source: "test.esl".into(), line: 3, column: 9 });
    let mut compilation = Compiler::for_source(SourceId(2)).compile_text("test.esl", text);
    let (_, found) = drive(&mut *compilation, &mut host);
    let shown = compilation.render(&found[0]);
    let expected = "\
error[macro-failed]: `failing` failed while it was expanded: it did not work
 --> test.esl:5:4
  |
3 |         (car ())))
  |         -------- it failed here
4 | (list 1
5 |   (failing
  |    ^^^^^^^";
    assert_eq!(shown, expected);
    host.failing_place = Some(SourcePlace { source: "macros.esl".into(), line: 7, column: 3 });
    let (_, found) = drive(&mut *Compiler::default().compile_text("test.esl", text), &mut host);
    assert_eq!(found[0].help.as_deref(), Some("it failed at macros.esl:7:3"));
}
