//! The loop on programs assembled by hand: calls, ticks, unwinding, tasks that take turns.

use esl_bytecode::module::{Constant, FunctionNumber, Module, ModuleFunction, Parameters, PoolIdx};
use esl_bytecode::opcode::{Instr, OPCODES};
use esl_bytecode::operand::*;
use esl_bytecode::symbol::Symbol;
use esl_host::VirtualHost;

use crate::fused::FUSED;
use crate::names::load::{Alone, load};
use crate::run::RunOutcome;
use crate::task::TaskResult;
use crate::value::Value;
use crate::vm::{Config, Vm};

mod arms;
mod fused;

/// Returns a machine without a library.
fn machine(config: Config) -> Vm {
    Vm::new(config, Box::new(VirtualHost::new())).expect("there is room for an empty machine")
}

/// Returns a function of some required parameters.
fn function(required: u8, registers: u8, constants: &[u32], code: &[Instr]) -> ModuleFunction {
    let code = code.iter().flat_map(|instruction| {
        let (word, aux) = instruction.encode();
        std::iter::once(word).chain(aux)
    });
    ModuleFunction {
        parameters: Parameters::exactly(required),
        registers,
        constants: constants.iter().map(|&index| PoolIdx(index)).collect(),
        code: code.collect(),
        ..ModuleFunction::default()
    }
}

/// Loads the functions as a module of which the first runs at top level. Its pool is the symbol `F`, then the
/// functions from the second on.
fn install(vm: &mut Vm, functions: Vec<ModuleFunction>) -> Value {
    let mut constants = vec![Constant::Symbol(Symbol::esl("F"))];
    constants.extend((1..functions.len()).map(|number| Constant::Function(FunctionNumber(number as u32))));
    let module = Module { constants, functions, toplevel: vec![FunctionNumber(0)], ..Module::default() };
    let list =
        load(&mut vm.heap, &mut vm.names, &module, &mut Alone::default()).expect("the module is in order");
    let toplevel = vm.heap.car(list).expect("one top-level function");
    vm.pin(toplevel);
    toplevel
}

/// `(f n)` with the naive definition of the Fibonacci numbers, defined as the second function of a module.
fn fibonacci(vm: &mut Vm, n: i16) -> Value {
    let main = function(
        0,
        4,
        &[1, 0],
        &[
            Instr::LoadInt { dst: Dst(2), value: Int16(n) },
            Instr::MakeClosure { dst: Dst(0), function: FunctionIdx(0) },
            Instr::TailCall { window: Window(0), count: Count(1), pad: Pad(0) },
        ],
    );
    let fib = function(
        1,
        5,
        &[],
        &[
            Instr::JumpNotLessInt { left: Reg(0), value: Int16(2), to: Jump(1) },
            Instr::Return { src: Reg(0) },
            Instr::AddInt { dst: Dst(3), left: Reg(0), value: Int8(-1) },
            Instr::CallSelf { window: Window(1), count: Count(1), want: Want::ONE, pad: Pad(0) },
            Instr::AddInt { dst: Dst(4), left: Reg(0), value: Int8(-2) },
            Instr::CallSelf { window: Window(2), count: Count(1), want: Want::ONE, pad: Pad(0) },
            Instr::Add { dst: Dst(1), left: Reg(1), right: Reg(2) },
            Instr::Return { src: Reg(1) },
        ],
    );
    install(vm, vec![main, fib])
}

/// Returns a loop that never ends.
fn endless(vm: &mut Vm) -> Value {
    install(vm, vec![function(0, 1, &[], &[Instr::Loop { to: Back24(-1) }])])
}

#[test]
fn calls_return_their_values() {
    let mut vm = machine(Config::default());
    // Miri is some thousand times slower.
    let (n, expected) = if cfg!(miri) { (8, 21) } else { (20, 6765) };
    let main = fibonacci(&mut vm, n);
    assert_eq!(vm.call(main, &[], u64::MAX), Ok(vec![Value::small(expected)]));
}

#[test]
fn a_run_takes_the_same_ticks_however_it_is_cut() {
    // Each call of the function takes a tick; beginning the task takes none.
    let (n, result, expected) = if cfg!(miri) { (4, 3, 9) } else { (12, 144, 465) };
    let ticks = |slice, collect_always| {
        let mut vm = machine(Config { slice, collect_always, ..Config::default() });
        let main = fibonacci(&mut vm, n);
        let id = vm.spawn(main, &[]).unwrap();
        assert_eq!(vm.run(u64::MAX), RunOutcome::Done);
        assert_eq!(vm.result(id), TaskResult::Succeeded(vec![Value::small(result)]));
        vm.ticks()
    };
    assert_eq!(ticks(2000, false), expected);
    let slices: &[_] = if cfg!(miri) { &[1, 7] } else { &[1, 2, 7, 100] };
    for &slice in slices {
        assert_eq!(ticks(slice, false), expected, "slice {slice}");
        if !cfg!(miri) {
            // A collection at every tick would take Miri hours.
            assert_eq!(ticks(slice, true), expected, "slice {slice}, collecting");
        }
    }
}

#[test]
fn the_budget_of_a_run_is_spent_to_the_tick() {
    let budget = if cfg!(miri) { 123 } else { 12_345 };
    let slices: &[_] = if cfg!(miri) { &[3] } else { &[1, 3, 2000] };
    for &slice in slices {
        let mut vm = machine(Config { slice, budget: Some(budget), ..Config::default() });
        let main = endless(&mut vm);
        vm.spawn(main, &[]).unwrap();
        assert_eq!(vm.run(u64::MAX), RunOutcome::BudgetSpent);
        assert_eq!(vm.ticks(), budget);
    }
}

#[test]
fn an_endless_loop_lets_others_run_and_can_be_aborted() {
    let (slice, each) = if cfg!(miri) { (20, 100) } else { (2000, 50_000) };
    let mut vm = machine(Config { slice, ..Config::default() });
    let main = endless(&mut vm);
    let first = vm.spawn(main, &[]).unwrap();
    let second = vm.spawn(main, &[]).unwrap();
    assert_eq!(vm.run(2 * each), RunOutcome::TicksUsed);
    assert_eq!(vm.ticks_of(first), each);
    assert_eq!(vm.ticks_of(second), each);
    vm.abort(first);
    assert_eq!(vm.run(each), RunOutcome::TicksUsed);
    assert_eq!(vm.result(first), TaskResult::Aborted);
    assert_eq!(vm.result(second), TaskResult::Running);
    assert!(vm.ticks_of(first) <= each);
}

#[test]
fn a_throw_runs_the_cleanups_between_it_and_its_catch() {
    // (catch tag (unwind-protect (throw tag 7) (setq x 5))) => 7, x => 5
    let main = function(
        0,
        6,
        &[],
        &[
            Instr::LoadInt { dst: Dst(0), value: Int16(0) },
            Instr::NewTag { dst: Dst(1) },
            Instr::PushCatch { window: Window(2), tag: Reg(1), want: Want::ONE, to: Landing(10) },
            Instr::PushCleanup { window: Window(3), to: Landing(4) },
            Instr::LoadInt { dst: Dst(3), value: Int16(7) },
            Instr::SetValues { first: Items(3), count: Count(1) },
            Instr::Throw { tag: Reg(1), kind: ThrowKind(0) },
            Instr::EnterCleanup {},
            Instr::LoadInt { dst: Dst(0), value: Int16(5) },
            Instr::EndCleanup {},
            Instr::LoadNil { first: Room(2), count: Count(1) },
            Instr::PopControl { count: Count(1) },
            Instr::Move { dst: Dst(3), src: Reg(0) },
            Instr::ReturnValues { first: Items(2), count: Count(2) },
        ],
    );
    let mut vm = machine(Config::default());
    let main = install(&mut vm, vec![main]);
    assert_eq!(vm.call(main, &[], u64::MAX), Ok(vec![Value::small(7), Value::small(5)]));
}

#[test]
fn without_a_library_a_failure_ends_the_task_and_says_why() {
    let car = function(
        0,
        2,
        &[],
        &[
            Instr::LoadInt { dst: Dst(0), value: Int16(5) },
            Instr::Car { dst: Dst(0), list: Reg(0) },
            Instr::Return { src: Reg(0) },
        ],
    );
    let mut vm = machine(Config::default());
    let main = install(&mut vm, vec![car]);
    let error = vm.call(main, &[], u64::MAX).expect_err("it fails");
    assert_eq!(error.to_string(), ":TYPE-ERROR 5 LIST");
}

#[test]
#[cfg_attr(miri, ignore = "there is nothing unsafe in a text")]
fn the_loop_has_an_arm_for_each_row_in_the_order_of_the_table() {
    // An arm begins with its opcodes, one or several, in a column of its own.
    const ARM: &str = "\n                LoopOperation::";
    let source = include_str!("../mod.rs");
    let arms = source.split(ARM).skip(1).filter_map(|arm| Some(arm.split_once(" =>")?.0));
    let operations: Vec<&str> = arms
        .flat_map(|names| names.split("LoopOperation::"))
        .map(|name| name.trim_matches([' ', '\n', '|']))
        .collect();
    let rows: Vec<String> = OPCODES.iter().map(|row| format!("{:?}", row.opcode)).collect();
    let (of_rows, others) = operations.split_at(rows.len());
    assert_eq!(of_rows, rows);
    let (of_stubs, fused) = others.split_at(3);
    assert_eq!(of_stubs, ["ErrorReturn", "InterruptReturn", "TaskExit"]);
    let (of_machine_code, fused) = fused.split_at(9);
    let quick = ["", "IfNil", "IfNotNil", "IfCons", "Less", "NotLess", "Count"];
    let quick = quick.map(|sort| format!("QuickLoop{sort}"));
    assert_eq!(of_machine_code[..2], ["NativeEntry", "MakeAtEntry"]);
    assert_eq!(of_machine_code[2..], quick);
    assert_eq!(fused, FUSED.iter().map(|fused| fused.name).collect::<Vec<_>>());
}

/// Machine code has these instructions done by the function alone, as if their arm had run.
#[test]
#[cfg_attr(miri, ignore = "there is nothing unsafe in a text")]
fn an_instruction_that_its_slow_half_does_has_no_more_in_its_arm() {
    let source = include_str!("../mod.rs");
    let done = OPCODES.iter().map(|row| row.opcode).filter(|opcode| opcode.is_done_by_slow_half());
    let others: Vec<_> = done
        .filter(|opcode| {
            !source.contains(&format!("\n                LoopOperation::{opcode:?} => slow!({opcode:?}),\n"))
        })
        .collect();
    assert_eq!(others, []);
}
