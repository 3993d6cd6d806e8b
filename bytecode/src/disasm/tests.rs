use super::*;
use crate::assembler::assemble;
use crate::datum::ObjectId;
use crate::module::{Capture, Parameters};
use crate::symbol::Symbol;

fn sample() -> Module {
    let code = "\
        jump-if-supplied r1 L1\n load-int r1 10\n\
        L1: load-const r2 k1\n L2: call-builtin r3.. 0 want all b0\n is-type r3 r3 t0\n call r3.. 0 want 1\n\
        loop-less r0 r1 L2\n push-catch r4.. r0 want 2 L3\n tail-call-global r3.. 1 k0\n L3: return-all";
    let line = |pc, line| LineEntry { pc, source: 0, line, column: 1 };
    let function = ModuleFunction {
        name: Some(PoolIdx(0)),
        lambda_list: Some(PoolIdx(4)),
        parameters: Parameters {
            required: 1,
            optional: 1,
            keys: Some(vec![PoolIdx(0)]),
            ..Parameters::default()
        },
        registers: 8,
        captures: vec![Capture::boxed(CaptureSource::Register(2)), Capture::value(CaptureSource::Later)],
        constants: vec![PoolIdx(0), PoolIdx(4)],
        code: assemble(code).unwrap(),
        lines: vec![line(0, 3), line(1, 3), line(2, 4), line(9, 4)],
        ..ModuleFunction::default()
    };
    Module {
        sources: vec!["count.esl".to_owned()],
        requires: Vec::new(),
        constants: vec![
            Constant::Symbol(Symbol::esl("COUNT-DOWN")),
            Constant::String("odd \"text\"\n".into()),
            Constant::Nil,
            Constant::Cons(PoolIdx(1), PoolIdx(2)),
            Constant::Cons(PoolIdx(0), PoolIdx(3)),
        ],
        functions: vec![function],
        toplevel: vec![FunctionNumber(0)],
    }
}

#[test]
fn a_function_is_shown_with_labels_constants_and_lines() {
    let expected = r#"function 0: COUNT-DOWN (COUNT-DOWN "odd \"text\"\n")
  8 registers; 1 required, 1 optional, keys COUNT-DOWN
  capture #0: r2 of the maker, a box
  capture #1: comes later
  ; count.esl:3
    0  jump-if-supplied r1 L1
    1  load-int r1 10
  ; count.esl:4
L1:
    2  load-const r2 k1  ; (COUNT-DOWN "odd \"text\"\n")
L2:
    3  call-builtin r3.. 0 want all b0  ; %SET-FUNCTION
    5  is-type r3 r3 t0  ; CONS
    6  call r3.. 0 want 1
    8  loop-less r0 r1 L2
   10  push-catch r4.. r0 want 2 L3
   12  tail-call-global r3.. 1 k0  ; COUNT-DOWN
L3:
   14  return-all

top level: 0
"#;
    assert_eq!(module(&sample()), expected);
}

#[test]
fn the_assembler_reads_what_is_shown() {
    let module = sample();
    let text = function(&module, FunctionNumber(0));
    let listing = text.split_once("  ; ").expect("the listing begins with a source place").1;
    assert_eq!(assemble(&format!("; {listing}")).as_ref(), Ok(&module.functions[0].code));
}

#[test]
fn long_and_broken_constants_are_cut_off() {
    let check = |constants: Vec<Constant>, expected: &str| {
        let last = PoolIdx(constants.len() as u32 - 1);
        let module = Module { constants, ..Module::default() };
        assert_eq!(constant(&module, last), expected);
    };
    check(vec![Constant::Cons(PoolIdx(7), PoolIdx(0))], &format!("({}...)", "?7 ".repeat(49)));
    check(vec![Constant::Vector(vec![PoolIdx(0)])], "#(#(#(#(#(#(#(...)))))))");
    check(vec![Constant::String("x".repeat(100).into())], &format!("\"{}...", "x".repeat(59)));
    check(vec![Constant::Symbol(Symbol::cl("a\nb"))], "a\\nb");
    check(vec![Constant::Object(ObjectId(3))], "#<object 3>");
    check(vec![Constant::True, Constant::Cons(PoolIdx(0), PoolIdx(0))], "(T . T)");
}

#[test]
fn words_that_are_no_instructions_are_shown_too() {
    let function = ModuleFunction { code: vec![0xFF, 0x68, 0x20_00_20, 0x73], ..ModuleFunction::default() };
    let module = Module { functions: vec![function], ..Module::default() };
    let text = super::function(&module, FunctionNumber(0));
    let expected = "    0  ; no instruction: 0x000000ff\n    1  call r0.. 0 want 1\n    3  return-all\n";
    assert!(text.ends_with(expected), "{text}");
}
