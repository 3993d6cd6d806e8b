//! For each rule, code that keeps it and code that breaks just this one.

mod entries;

use super::*;
use crate::assembler::assemble;
use crate::module::{
    Capture, Constant, LineEntry, ModuleFunction, Parameters, PoolIdx, VariablePlace, VariableRange,
};
use crate::symbol::Symbol;

/// The functions that code under test can refer to, besides itself, which is function 0.
const PLAIN: u32 = 1;
const CAPTURES_VALUE: u32 = 2;
const CAPTURES_BOX: u32 = 3;
const CAPTURES_LATER: u32 = 4;
const PASSES_CAPTURES: u32 = 5;

/// Constants: `k0` a symbol, `k1` an integer, `k2` a plain function, `k3` a class, `k4` a vector of types,
/// `k5` to `k7` functions that capture `r0` as a value, `r0` as a box, and something later, `k8` a vector
/// that lists no types, `k9` a function that takes on both captures of its maker.
fn constants() -> Vec<Constant> {
    let function = |number| Constant::Function(FunctionNumber(number));
    vec![
        Constant::Symbol(Symbol::esl("FOO")),
        Constant::Integer(1.into()),
        function(PLAIN),
        Constant::Class(Symbol::esl("POINT")),
        Constant::Vector(vec![PoolIdx(0)]),
        function(CAPTURES_VALUE),
        function(CAPTURES_BOX),
        function(CAPTURES_LATER),
        Constant::Vector(vec![PoolIdx(1)]),
        function(PASSES_CAPTURES),
    ]
}

fn function(code: &str) -> ModuleFunction {
    ModuleFunction {
        registers: 10,
        constants: (0..constants().len() as u32).map(PoolIdx).collect(),
        code: assemble(code).unwrap(),
        ..ModuleFunction::default()
    }
}

fn with_captures(captures: impl IntoIterator<Item = Capture>) -> ModuleFunction {
    ModuleFunction { captures: captures.into_iter().collect(), ..function("load-true r0 \n return r0") }
}

/// Returns a module with `first` as its function 0.
fn module(first: ModuleFunction) -> Module {
    Module {
        sources: vec!["a.esl".to_owned()],
        requires: Vec::new(),
        constants: constants(),
        functions: vec![
            first,
            with_captures([]),
            with_captures([Capture::value(CaptureSource::Register(0))]),
            with_captures([Capture::boxed(CaptureSource::Register(0))]),
            with_captures([Capture::value(CaptureSource::Later), Capture::value(CaptureSource::Register(0))]),
            with_captures([
                Capture::value(CaptureSource::Capture(0)),
                Capture::boxed(CaptureSource::Capture(1)),
            ]),
        ],
        toplevel: Vec::new(),
    }
}

#[track_caller]
fn check_function(function: ModuleFunction, expected: Result<(), Fault>) {
    let text = crate::disasm::function(&module(function.clone()), FunctionNumber(0));
    assert_eq!(verify(&module(function)).map_err(|error| error.fault), expected, "{text}");
}

/// Checks code without parameters.
#[track_caller]
fn check(code: &str, expected: Result<(), Fault>) {
    check_function(function(code), expected);
}

#[track_caller]
fn check_module(change: impl FnOnce(&mut Module), expected: Fault) {
    let mut module = module(function("return-values r0 0"));
    assert_eq!(verify(&module), Ok(()));
    change(&mut module);
    assert_eq!(verify(&module).map_err(|error| error.fault), Err(expected));
}

#[track_caller]
fn check_header(change: impl FnOnce(&mut ModuleFunction), expected: Result<(), Fault>) {
    let mut function = function("load-true r0 \n return r0");
    change(&mut function);
    check_function(function, expected);
}

#[track_caller]
fn check_with_parameters(parameters: Parameters, code: &str, expected: Result<(), Fault>) {
    check_function(ModuleFunction { parameters, ..function(code) }, expected);
}

#[test]
fn v1_control_stays_within_instructions() {
    check("load-true r0 \n return r0", Ok(()));
    check("load-true r0", Err(Fault::FallsOff));
    check("load-true r0 \n jump-if-nil r0 L1 \n return r0 \n L1: load-true r1", Err(Fault::FallsOff));
    // Unreachable code may run off the end.
    check("load-true r0 \n return r0 \n load-true r1", Ok(()));
    check_header(|f| f.code.clear(), Err(Fault::CodeLength(0)));
    check_header(|f| f.code = vec![f.code[0]; MAX_CODE + 1], Err(Fault::CodeLength(MAX_CODE + 1)));
    check_header(|f| f.code.push(0xC0), Err(Fault::UnknownOpcode(0xC0)));
    check_header(|f| f.code.push(0), Err(Fault::UnknownOpcode(0)));
    check_header(|f| f.code.push(0x68), Err(Fault::MissingAux));
    check_header(|f| f.code[1] |= 1 << 31, Err(Fault::SpareBits));
    check_header(|f| f.code.extend([0x68, 1]), Err(Fault::SpareBits));
}

#[test]
fn v2_jumps_land_on_instructions_and_only_loops_go_back() {
    check("load-true r0 \n L1: loop-if-nil r0 L1 \n return r0", Ok(()));
    check("jump +1 \n call-global r0.. 0 want 1 k0 \n return r0", Err(Fault::JumpTarget(2)));
    check("jump +1 \n return-values r0 0", Err(Fault::JumpTarget(2)));
    check("L1: load-true r0 \n loop -5", Err(Fault::JumpTarget(-3)));
    check("L1: load-true r0 \n jump L1", Err(Fault::JumpDirection(-2)));
    check("loop +0 \n return-values r0 0", Err(Fault::JumpDirection(0)));
    check("jump +0 \n return-values r0 0", Ok(()));
}

#[test]
fn v3_registers_are_in_the_frame() {
    check("load-true r9 \n return r9", Ok(()));
    check("load-true r10 \n return r10", Err(Fault::Register { end: 11, registers: 10 }));
    check("load-nil r5.. 5 \n return r9", Ok(()));
    check("load-nil r5.. 6 \n return r9", Err(Fault::Register { end: 11, registers: 10 }));
    check("load-nil r9.. 1 \n call-global r7.. 1 want 1 k0 \n return r7", Ok(()));
    check("call-global r8.. 1 want 1 k0 \n return r8", Err(Fault::Register { end: 11, registers: 10 }));
    check("call-global r7.. 0 want 3 k0 \n return r9", Ok(()));
    check("call-global r7.. 0 want 4 k0 \n return r9", Err(Fault::Register { end: 11, registers: 10 }));
    check("tail-call-global r9.. 0 k0", Err(Fault::Register { end: 11, registers: 10 }));
    let push = |push: &str| format!("load-true r0 \n {push} \n pop-control 1 \n L1: return r0");
    check(&push("push-catch r8.. r0 want 2 L1"), Ok(()));
    check(&push("push-catch r8.. r0 want 3 L1"), Err(Fault::Register { end: 11, registers: 10 }));
    check(&push("push-handler-case r8.. k4 L1"), Ok(()));
    check(&push("push-handler-case r9.. k4 L1"), Err(Fault::Register { end: 11, registers: 10 }));
    check(&push("push-scope r10.."), Ok(()));
    check(&push("push-scope r11.."), Err(Fault::Register { end: 11, registers: 10 }));
    check_header(|f| f.registers = 251, Err(Fault::Registers(251)));
}

#[test]
fn v4_constants_are_of_the_kind_that_is_needed() {
    let kind = |found, expected| Err(Fault::ConstantKind { found, expected });
    let use_constant = |code: &str| format!("load-true r0 \n {code} \n return r0");
    check(&use_constant("load-const r1 k0"), Ok(()));
    check(&use_constant("load-const r1 k10"), Err(Fault::Constant { found: 10, count: 10 }));
    check(&use_constant("load-const r1 k2"), Ok(()));
    check(&use_constant("load-const r1 k3"), Err(Fault::NotData));
    check(&use_constant("load-const r1 k5"), Err(Fault::NotData));
    check(&use_constant("jump-eql-const r0 k3 +0"), Err(Fault::NotData));
    check(&use_constant("symbol-value r1 k0"), Ok(()));
    check(&use_constant("symbol-value r1 k1"), kind(1, "a symbol"));
    check(&use_constant("call-global r2.. 0 want 1 k1"), kind(1, "a symbol"));
    check(&use_constant("make-closure r1 k2"), Ok(()));
    check(&use_constant("make-closure r1 k0"), kind(0, "a function"));
    check(&use_constant("slot r1 r0 #0 k3"), Ok(()));
    check(&use_constant("slot r1 r0 #0 k0"), kind(0, "a class"));
    check(&use_constant("jump-if-not-instance r0 k0 +0"), kind(0, "a class"));
    let handler_case =
        |types: &str| use_constant(&format!("push-handler-case r2.. {types} +1 \n pop-control 1"));
    check(&handler_case("k4"), Ok(()));
    check(&handler_case("k0"), kind(0, "a vector of types"));
    check(&handler_case("k8"), kind(8, "a vector of types"));
    check_header(|f| f.constants.push(PoolIdx(99)), Err(Fault::PoolIndex(PoolIdx(99))));
    check_header(|f| f.name = Some(PoolIdx(99)), Err(Fault::PoolIndex(PoolIdx(99))));
    check_header(|f| f.lambda_list = Some(PoolIdx(5)), Err(Fault::NotData));
}

#[test]
fn v5_small_operands_mean_something() {
    let then = |code: &str| format!("load-nil r0.. 9 \n {code} \n return r0");
    check(&then("is-type r1 r0 t21"), Ok(()));
    check(&then("is-type r1 r0 t22"), Err(Fault::TypeCode(22)));
    check(&then("call-builtin r2.. 2 want 1 b0"), Ok(()));
    check(&then("call-builtin r2.. 1 want 1 b0"), Err(Fault::Arguments(1)));
    check(&then("tail-call-builtin r2.. 3 b0"), Err(Fault::Arguments(3)));
    check(&then("call-builtin r2.. 2 want 1 b65535"), Err(Fault::Builtin(65535)));
    check(&then("apply r2.. 1 want 1"), Ok(()));
    check(&then("apply r2.. 0 want 1"), Err(Fault::Arguments(0)));
    check(&then("tail-apply r2.. 0"), Err(Fault::Arguments(0)));
    check(&then("call r2.. 0 want 251"), Err(Fault::Want(251)));
    check(&then("call-global r2.. 0 want 254 k0"), Err(Fault::Want(254)));
    check(&then("push-catch r2.. r0 want 252 +0 \n pop-control 1"), Err(Fault::Want(252)));
    check(&then("set-values r0.. 1 \n throw r0 2"), Ok(()));
    check(&then("set-values r0.. 1 \n throw r0 3"), Err(Fault::ThrowKind(3)));
    check(&then("call-self r2.. 0 want 1"), Ok(()));
    check(&then("call-self r2.. 1 want 1"), Err(Fault::Arguments(1)));
    let optional = Parameters { optional: 1, ..Parameters::default() };
    check_with_parameters(optional, &then("call-self r2.. 0 want 1"), Err(Fault::Arguments(0)));
}

#[test]
fn a_single_value_is_wanted_in_one_way() {
    let mut function = function("load-nil r0.. 9 \n call r2.. 0 want 1 \n return r2");
    function.code[1] |= 1 << 24;
    check_function(function, Err(Fault::Want(1)));
}

#[test]
fn v6_registers_are_read_after_they_were_written() {
    check("return r0", Err(Fault::Unassigned(0)));
    check_with_parameters(Parameters::exactly(1), "return r0", Ok(()));
    check_with_parameters(Parameters::exactly(1), "return r1", Err(Fault::Unassigned(1)));
    check("load-true r0 \n jump-if-nil r0 L1 \n load-true r1 \n L1: return r1", Err(Fault::Unassigned(1)));
    check("load-true r0 \n jump-if-nil r0 L1 \n load-true r0 \n L1: return r0", Ok(()));
    // A window and what is above it is the callee's.
    check("load-nil r0.. 6 \n call-global r2.. 1 want 1 k0 \n return r1", Ok(()));
    check("load-nil r0.. 6 \n call-global r2.. 1 want 1 k0 \n return r2", Ok(()));
    check("load-nil r0.. 6 \n call-global r2.. 1 want 1 k0 \n return r3", Err(Fault::Unassigned(3)));
    check("load-nil r0.. 6 \n call-global r2.. 1 want 1 k0 \n return r5", Err(Fault::Unassigned(5)));
    check("load-nil r0.. 6 \n call-global r2.. 1 want 3 k0 \n return r4", Ok(()));
    check("load-true r0 \n call-global r0.. 1 want 1 k0 \n return r0", Err(Fault::Unassigned(2)));
    check("call r0.. 0 want 1 \n return r0", Err(Fault::Unassigned(0)));
    check("tail-call r0.. 0", Err(Fault::Unassigned(0)));
    check("tail-call-global r0.. 1 k0", Err(Fault::Unassigned(2)));
    check("list r0 r1.. 1 \n return r0", Err(Fault::Unassigned(1)));
    check("return-values r1.. 1", Err(Fault::Unassigned(1)));
    check("make-closure r1 k5 \n return r1", Err(Fault::Unassigned(0)));
    // A register that a loop destroys is unassigned at its head.
    let body = "L1: move r1 r3 \n call-global r2.. 0 want 1 k0 \n loop-if-nil r2 L1 \n return r2";
    check(&format!("load-nil r0.. 4 \n {body}"), Err(Fault::Unassigned(3)));
}

#[test]
fn v6_optional_parameters_are_tested_before_they_are_read() {
    let parameters = || Parameters { required: 1, optional: 1, rest: true, ..Parameters::default() };
    let check = |code: &str, expected| check_with_parameters(parameters(), code, expected);
    check("return r1", Err(Fault::MaybeUnsupplied(1)));
    check("move r3 r1 \n return r3", Err(Fault::MaybeUnsupplied(1)));
    check("jump-if-supplied r1 L1 \n load-nil r1.. 1 \n L1: return r1", Ok(()));
    check("jump-if-supplied r1 L1 \n move r2 r1 \n L1: return r1", Err(Fault::Unassigned(1)));
    check("jump-if-supplied r1 L1 \n L1: return r1", Err(Fault::Unassigned(1)));
    check("load-nil r1.. 1 \n return r1", Ok(()));
    check("jump-if-supplied r0 L1 \n L1: return r0", Err(Fault::NotParameter(0)));
    check("return r2", Ok(()));
    check("jump-if-supplied r2 L1 \n L1: return r0", Err(Fault::NotParameter(2)));
    check("jump-if-supplied r3 L1 \n L1: return r0", Err(Fault::NotParameter(3)));
    let keys = Parameters { keys: Some(vec![PoolIdx(0)]), ..Parameters::default() };
    check_with_parameters(keys, "jump-if-supplied r0 L1 \n load-true r0 \n L1: return r0", Ok(()));
}

#[test]
fn v7_boxes_are_known_and_never_given_away() {
    check("load-true r0 \n make-box r1 r0 \n box-set r1 r0 \n box-ref r2 r1 \n return r2", Ok(()));
    check("load-true r0 \n make-box r1 r0 \n move r2 r1 \n box-ref r2 r2 \n return r2", Ok(()));
    check("load-true r0 \n box-ref r1 r0 \n return r1", Err(Fault::NotBox(0)));
    check("load-true r0 \n box-set r0 r0 \n return r0", Err(Fault::NotBox(0)));
    check("box-ref r1 r0 \n return r1", Err(Fault::Unassigned(0)));
    let boxed = |code: &str| format!("load-true r1 \n make-box r0 r1 \n {code} \n return r1");
    for code in [
        "return r0",
        "cons r2 r1 r0",
        "make-box r2 r0",
        "box-set r0 r0",
        "set-symbol-value r0 k0",
        "bind r0 k0",
        "jump-if-nil r0 +0",
        "call r0.. 0 want 1",
        "set-values r0.. 1",
        "list r2 r0.. 2",
        "make-closure r2 k5",
        "push-catch r2.. r0 want 1 +0",
    ] {
        check(&boxed(code), Err(Fault::Box(0)));
    }
    check(&boxed("make-closure r2 k6"), Ok(()));
    check("load-true r0 \n make-closure r1 k6 \n return r1", Err(Fault::NotBox(0)));
    // On one path a box, on the other none: then it is neither.
    let joined = "load-true r0 \n jump-if-nil r0 L1 \n make-box r0 r0 \n L1:";
    check(&format!("{joined} box-ref r1 r0 \n return r1"), Err(Fault::Unassigned(0)));
    check(&format!("{joined} return r0"), Err(Fault::Unassigned(0)));
}

#[test]
fn v7_captures_are_used_as_they_are_declared() {
    let check = |code: &str, expected| {
        let captures = [
            Capture::value(CaptureSource::Register(0)),
            Capture::boxed(CaptureSource::Register(1)),
            Capture::value(CaptureSource::Later),
        ];
        check_function(ModuleFunction { captures: captures.to_vec(), ..function(code) }, expected);
    };
    check("capture-ref r0 #0 \n capture-box-set r0 #1 \n capture-box-ref r0 #1 \n return r0", Ok(()));
    check("capture-ref r0 #2 \n return r0", Ok(()));
    check("capture-ref r0 #1 \n box-ref r0 r0 \n return r0", Ok(()));
    check("capture-ref r0 #1 \n return r0", Err(Fault::Box(0)));
    check("capture-ref r0 #0 \n box-ref r0 r0 \n return r0", Err(Fault::NotBox(0)));
    check("capture-box-ref r0 #0 \n return r0", Err(Fault::CaptureKind(0)));
    check("load-true r0 \n capture-box-set r0 #2 \n return r0", Err(Fault::CaptureKind(2)));
    check("capture-ref r0 #3 \n return r0", Err(Fault::Capture(3)));
    check("make-closure r0 k9 \n return r0", Ok(()));
}

#[test]
fn v8_makers_provide_what_is_captured() {
    check("make-closure r0 k9 \n return r0", Err(Fault::Capture(0)));
    let swapped = ModuleFunction {
        captures: vec![
            Capture::boxed(CaptureSource::Register(0)),
            Capture::boxed(CaptureSource::Register(0)),
        ],
        ..function("make-closure r0 k9 \n return r0")
    };
    check_function(swapped, Err(Fault::CaptureKind(0)));
    let later_box = |f: &mut ModuleFunction| f.captures.push(Capture::boxed(CaptureSource::Later));
    check_header(later_box, Err(Fault::LaterBox(0)));
    let many =
        |f: &mut ModuleFunction| f.captures = vec![Capture::value(CaptureSource::Later); MAX_CAPTURES + 1];
    check_header(many, Err(Fault::CaptureCount(MAX_CAPTURES + 1)));
}

#[test]
fn v8_only_closures_of_this_frame_are_patched_where_they_say_so() {
    let make = |code: &str| format!("load-true r0 \n make-closure r1 k7 \n {code} \n return r0");
    check(&make("patch-capture r1 #0 r1"), Ok(()));
    check(&make("move r2 r1 \n patch-capture r2 #0 r0"), Ok(()));
    check(&make("patch-capture r1 #1 r0"), Err(Fault::Patch(1)));
    check(&make("patch-capture r1 #2 r0"), Err(Fault::Patch(1)));
    check(&make("patch-capture r0 #0 r0"), Err(Fault::Patch(0)));
    check(&make("load-true r1 \n patch-capture r1 #0 r0"), Err(Fault::Patch(1)));
    check(&make("make-closure r1 k5 \n patch-capture r1 #0 r0"), Err(Fault::Patch(1)));
    check(&make("make-box r2 r0 \n patch-capture r1 #0 r2"), Err(Fault::Box(2)));
    check(&make("call-global r1.. 0 want 1 k0 \n patch-capture r1 #0 r0"), Err(Fault::Patch(1)));
    check(&make("jump-if-nil r0 L1 \n load-true r1 \n L1: patch-capture r1 #0 r0"), Err(Fault::Patch(1)));
}

#[test]
fn v12_parameters_have_registers_and_keys_have_names() {
    check_header(|f| f.parameters.required = 10, Ok(()));
    check_header(|f| f.parameters.required = 11, Err(Fault::Parameters(11)));
    check_header(|f| f.parameters.keys = Some(vec![PoolIdx(0); 11]), Err(Fault::Parameters(11)));
    check_header(|f| f.parameters.keys = Some(vec![PoolIdx(1)]), Err(Fault::KeyName(PoolIdx(1))));
    check_header(|f| f.parameters.keys = Some(vec![PoolIdx(99)]), Err(Fault::PoolIndex(PoolIdx(99))));
    let toplevel = |number| move |module: &mut Module| module.toplevel = vec![FunctionNumber(number)];
    check_module(toplevel(CAPTURES_LATER), Fault::ToplevelCaptures);
    check_module(toplevel(99), Fault::FunctionNumber(FunctionNumber(99)));
    check_module(
        |module| {
            module.functions[0].parameters.rest = true;
            module.toplevel = vec![FunctionNumber(0)];
        },
        Fault::ToplevelParameters,
    );
}

#[test]
fn v13_constants_are_well_formed() {
    let later = Fault::PoolIndex(PoolIdx(10));
    let check =
        |constant: Constant, expected| check_module(|module| module.constants.push(constant), expected);
    check(Constant::Cons(PoolIdx(10), PoolIdx(0)), later);
    check(Constant::Vector(vec![PoolIdx(0), PoolIdx(10)]), later);
    check(Constant::Array(vec![1, 1], vec![PoolIdx(10)]), later);
    check(Constant::Array(vec![1, 2], vec![PoolIdx(0)]), Fault::Array);
    check(Constant::Array(vec![1], vec![PoolIdx(0)]), Fault::Array);
    check(Constant::Array(vec![u32::MAX, u32::MAX, u32::MAX], vec![]), Fault::Array);
    check(Constant::Cons(PoolIdx(0), PoolIdx(3)), Fault::NotData);
    check(Constant::Vector(vec![PoolIdx(5)]), Fault::NotData);
    check(Constant::Function(FunctionNumber(99)), Fault::FunctionNumber(FunctionNumber(99)));
    check(Constant::Symbol(Symbol::cl("NIL")), Fault::StandardSymbol);
    check(Constant::Class(Symbol::cl("T")), Fault::StandardSymbol);
    check(Constant::Ratio(2.into(), 4.into()), Fault::Ratio);
    check(Constant::Ratio(2.into(), 1.into()), Fault::Ratio);
    check(Constant::Ratio(2.into(), (-3).into()), Fault::Ratio);
    check(Constant::Ratio(2.into(), 0.into()), Fault::Ratio);
    let mut module = module(function("return-values r0 0"));
    module.constants.extend([
        Constant::Ratio((-2).into(), 3.into()),
        Constant::Array(vec![], vec![PoolIdx(0)]),
        Constant::Array(vec![u32::MAX, u32::MAX, u32::MAX, 0], vec![]),
        Constant::Cons(PoolIdx(0), PoolIdx(2)),
    ]);
    assert_eq!(verify(&module), Ok(()));
}

#[test]
fn source_places_are_in_order() {
    let line = |pc, source| LineEntry { pc, source, line: 1, column: 1 };
    check_header(|f| f.lines = vec![line(0, 0), line(1, 0)], Ok(()));
    check_header(|f| f.lines = vec![line(1, 0), line(0, 0)], Err(Fault::Lines));
    check_header(|f| f.lines = vec![line(0, 0), line(2, 0)], Err(Fault::Lines));
    check_header(|f| f.lines = vec![line(0, 1)], Err(Fault::Lines));
}

#[test]
fn v14_variables_are_where_they_are_said_to_be() {
    let ranges = |ranges: &[(VariablePlace, u32, u32)]| -> Vec<VariableRange> {
        let variable = |&(place, from, to)| VariableRange { name: "X".into(), place, from, to };
        ranges.iter().map(variable).collect()
    };
    let register = VariablePlace::Register;
    let check_ranges = |given: &[_], expected| check_header(|f| f.variables = ranges(given), expected);
    check_ranges(&[(register(0), 1, 2)], Ok(()));
    check_ranges(&[(register(0), 1, 2), (register(0), 1, 2)], Ok(()));
    check_ranges(&[(register(0), 1, 1)], Err(Fault::Variables));
    check_ranges(&[(register(0), 1, 3)], Err(Fault::Variables));
    check_ranges(&[(register(10), 1, 2)], Err(Fault::Variables));
    check_ranges(&[(VariablePlace::Capture(0), 0, 2)], Err(Fault::Variables));
    // Before it is set, and one that is never set.
    check_ranges(&[(register(0), 0, 2)], Err(Fault::Variable(0)));
    check_ranges(&[(register(9), 1, 2)], Err(Fault::Variable(9)));
    // On one of two paths, and where a callee's frame has lain.
    let check_code = |code: &str, given: &[_], expected| {
        check_function(ModuleFunction { variables: ranges(given), ..function(code) }, expected);
    };
    let joins = "load-true r0 \n jump-if-nil r0 L1 \n load-true r1 \n L1: return r0";
    check_code(joins, &[(register(0), 1, 4)], Ok(()));
    check_code(joins, &[(register(1), 3, 4)], Err(Fault::Variable(1)));
    let calls = "load-true r2 \n call-global r2.. 0 want 1 k0 \n move r1 r2 \n return r1";
    let after = assemble("load-true r2 \n call-global r2.. 0 want 1 k0").unwrap().len() as u32;
    check_code(calls, &[(register(2), 1, after)], Ok(()));
    check_code(calls, &[(register(2), after, after + 1)], Ok(()));
    check_code(calls, &[(register(3), after, after + 1)], Err(Fault::Variable(3)));
    // Boxes are looked into, and the marker of a parameter without an argument is not a value.
    let boxed = "load-true r0 \n make-box r1 r0 \n return r0";
    check_code(boxed, &[(register(1), 2, 3)], Ok(()));
    let optional = "jump-if-supplied r0 L1 \n load-nil r0.. 1 \n L1: return r0";
    let parameters = Parameters { optional: 1, ..Parameters::default() };
    let given = |from| ModuleFunction {
        variables: ranges(&[(register(0), from, 3)]),
        parameters: parameters.clone(),
        ..function(optional)
    };
    check_function(given(2), Ok(()));
    check_function(given(0), Err(Fault::Variable(0)));
}

#[test]
fn faults_name_their_place() {
    let module = module(function("load-true r0 \n return r1"));
    let error = verify(&module).unwrap_err();
    assert_eq!(error.to_string(), "function 0, word 1: reads r1, which holds nothing on some path");
}

#[test]
fn nested_loops_take_little_work() {
    let depth = 60;
    let mut code = "load-nil r0.. 2 \n".to_owned();
    for level in 0..depth {
        code += &format!("A{level}: call-global r2.. 0 want 1 k0 \n");
    }
    for level in (0..depth).rev() {
        code += &format!("move r1 r0 \n call-global r1.. 0 want 1 k0 \n loop-if-nil r0 A{level} \n");
    }
    code += "return r0";
    check(&code, Ok(()));
}
