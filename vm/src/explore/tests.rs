//! Exploration of programs assembled by hand, and its parts. Programs in ESL are explored in
//! `conformance/tests/language/explore`.

use std::convert::Infallible;

use esl_bytecode::builtin::Builtin;
use esl_bytecode::module::{Constant, FunctionNumber, Module, ModuleFunction, PoolIdx};
use esl_bytecode::opcode::Instr;
use esl_bytecode::operand::*;
use esl_bytecode::symbol::{Symbol, USER_PACKAGE};

use super::fingerprint::Fingerprints;
use super::live::Live;
use super::{Exploration, SearchLimit, Settings, explore};
use crate::names::load::{Alone, load};
use crate::run::RunOutcome;
use crate::schedule::Choices;
use crate::value::Value;
use crate::vm::Vm;

/// Returns the symbol `F` of the program, whose uses are known to a search.
fn variable() -> Symbol {
    Symbol::new(&USER_PACKAGE.into(), "F")
}

fn words(code: &[Instr]) -> Vec<u32> {
    code.iter()
        .flat_map(|instruction| {
            let (word, aux) = instruction.encode();
            std::iter::once(word).chain(aux)
        })
        .collect()
}

/// Makes a machine with a task for each of these codes, which may use eight registers and the symbol `F` as
/// constant 0.
fn machine(tasks: &[&[Instr]]) -> Vm {
    let mut vm = Vm::for_tests();
    for code in tasks {
        let code = words(code);
        let function =
            ModuleFunction { registers: 8, constants: vec![PoolIdx(0)], code, ..ModuleFunction::default() };
        let module = Module {
            constants: vec![Constant::Symbol(variable())],
            functions: vec![function],
            toplevel: vec![FunctionNumber(0)],
            ..Module::default()
        };
        let list = load(&mut vm.heap, &mut vm.names, &module, &mut Alone::default());
        let main = vm.heap.car(list.expect("the module is in order")).expect("one top-level function");
        vm.spawn(main, &[]).expect("there is room");
    }
    vm
}

fn call(builtin: Builtin, count: u8) -> Instr {
    Instr::CallBuiltin {
        window: Window(0),
        count: Count(count),
        want: Want::ONE,
        builtin: BuiltinIdx(builtin as u32),
    }
}

/// Explores; the value of `F` at the end of each run is its ending.
fn endings(tasks: &[&[Instr]], settings: &Settings) -> Exploration<(RunOutcome, String)> {
    let begin = || Ok::<Vm, Infallible>(machine(tasks));
    let judge = |vm: &mut Vm, outcome| {
        let symbol = vm.names.find(&variable()).unwrap_or(Value::NIL);
        let value = vm.symbol_value(symbol).map_or("unbound".into(), |value| vm.describe(value));
        (outcome, value)
    };
    match explore(settings, begin, judge) {
        Ok(found) => found,
        Err(never) => match never {},
    }
}

/// Sets `F` to a number before a point, and doubles it after the point.
fn writer(number: i16) -> Vec<Instr> {
    vec![
        Instr::LoadInt { dst: Dst(5), value: Int16(number) },
        Instr::SetSymbolValue { src: Reg(5), symbol: SymbolIdx(0) },
        call(Builtin::BeginCritical, 0),
        call(Builtin::EndCritical, 0),
        Instr::SymbolValue { dst: Dst(6), symbol: SymbolIdx(0) },
        Instr::Add { dst: Dst(6), left: Reg(6), right: Reg(6) },
        Instr::SetSymbolValue { src: Reg(6), symbol: SymbolIdx(0) },
        Instr::Return { src: Reg(6) },
    ]
}

#[test]
fn all_orders_are_found() {
    let (first, second) = (writer(1), writer(10));
    let found = endings(&[&first, &second], &Settings::default());
    let mut values: Vec<&str> = found.endings.iter().map(|ending| &*ending.what.1).collect();
    values.sort_unstable();
    // Either order without interleaving, and either order with the second number written in between.
    assert_eq!(values, ["2", "20", "4", "40"]);
    assert!(found.limit.is_none() && !found.has_cycle && found.endless.is_none(), "{found:?}");
    // The first ending is that of the schedule without preemption.
    assert!(found.endings[0].choices.iter().all(|&choice| choice == 0), "{found:?}");
    for ending in &found.endings {
        let mut vm = machine(&[&first, &second]);
        assert_eq!(vm.follow(&Settings::default(), &ending.choices), RunOutcome::Done);
        let symbol = vm.names.find(&variable()).unwrap();
        assert_eq!(vm.describe(vm.symbol_value(symbol).unwrap()), ending.what.1);
    }
}

#[test]
fn what_never_ends_is_found() {
    let found = endings(&[&[Instr::Loop { to: Back24(-1) }]], &Settings { turn: 100, ..Settings::default() });
    assert_eq!((found.states, found.endings.len()), (1, 0));
    assert!(found.has_cycle && found.endless == Some(Vec::new()), "{found:?}");
}

#[test]
fn it_gives_up_after_the_given_number_of_states_or_bytes() {
    // A counter makes each state different.
    let counts = [
        Instr::LoadInt { dst: Dst(0), value: Int16(0) },
        Instr::AddInt { dst: Dst(0), left: Reg(0), value: Int8(1) },
        Instr::Loop { to: Back24(-2) },
    ];
    let settings = Settings { turn: 100, states: 50, ..Settings::default() };
    let found = endings(&[&counts, &counts], &settings);
    assert!(found.limit == Some(SearchLimit::States) && found.states >= 50, "{found:?}");
    let settings = Settings { turn: 100, memory: 20_000, ..Settings::default() };
    let found = endings(&[&counts, &counts], &settings);
    assert!(found.limit == Some(SearchLimit::Memory) && found.states < 2_000, "{found:?}");
}

#[test]
fn a_fingerprint_depends_on_the_state_alone() {
    let mut fingerprints = Fingerprints::default();
    let mut of = |prepare: &dyn Fn(&mut Vm, Value)| {
        let mut vm = machine(&[&[Instr::ReturnValues { first: Items(0), count: Count(0) }]]);
        let symbol = vm.names.find(&variable()).unwrap();
        prepare(&mut vm, symbol);
        fingerprints.begin_machine();
        fingerprints.of(&mut vm)
    };
    let list = |vm: &mut Vm, symbol, last: i32| {
        let items = [Value::small(1), Value::small(last)];
        let list = vm.heap.list(&items).unwrap();
        vm.set_symbol_value(symbol, list).unwrap();
    };
    let plain = of(&|vm, symbol| list(vm, symbol, 2));
    let elsewhere = of(&|vm, symbol| {
        // Other addresses, and objects that are garbage.
        for _ in 0..100 {
            vm.heap.list(&[Value::T; 7]).unwrap();
        }
        list(vm, symbol, 2);
    });
    assert_eq!(plain, elsewhere);
    assert_ne!(plain, of(&|vm, symbol| list(vm, symbol, 3)));
    assert_ne!(plain, of(&|_, _| {}));
    // A shared list differs from a list made twice.
    let pair = |vm: &mut Vm, symbol, is_shared: bool| {
        let list = vm.heap.list(&[Value::T]).unwrap();
        let other = if is_shared { list } else { vm.heap.list(&[Value::T]).unwrap() };
        let pair = vm.heap.cons(list, other).unwrap();
        vm.set_symbol_value(symbol, pair).unwrap();
    };
    assert_ne!(of(&|vm, symbol| pair(vm, symbol, true)), of(&|vm, symbol| pair(vm, symbol, false)));
}

#[test]
fn a_strict_fingerprint_depends_on_how_the_state_came_about_and_on_no_address() {
    let of = |prepare: &dyn Fn(&mut Vm)| {
        let mut vm = machine(&[&[Instr::ReturnValues { first: Items(0), count: Count(0) }]]);
        prepare(&mut vm);
        vm.fingerprint()
    };
    let preparations: [&dyn Fn(&mut Vm); 9] = [
        &|_| {},
        // Garbage counts: the next cycle of the collector comes sooner.
        &|vm| _ = vm.heap.list(&[Value::T; 7]).unwrap(),
        &|vm| vm.scheduler.spent += 1,
        &|vm| vm.scheduler.rounds += 1,
        &|vm| _ = vm.scheduler.serial.advance(),
        &|vm| vm.config.slice += 1,
        &|vm| vm.set_choices(Choices::seeded(5)),
        &|vm| vm.pin(Value::T),
        &|vm| vm.outside.senders += 1,
    ];
    let mut found: Vec<u128> = preparations.iter().map(|prepare| of(prepare)).collect();
    assert_eq!(
        found,
        preparations.iter().map(|prepare| of(prepare)).collect::<Vec<_>>(),
        "other machines, other addresses"
    );
    found.sort_unstable();
    found.dedup();
    assert_eq!(found.len(), preparations.len());
}

#[test]
fn facts_and_their_order_belong_to_a_state() {
    let of = |facts: &[i32]| {
        let mut vm = machine(&[&[Instr::ReturnValues { first: Items(0), count: Count(0) }]]);
        let objects = vm.database.prepare(&mut vm.heap).unwrap().unwrap();
        vm.pin(objects);
        for &number in facts {
            let fact = vm.heap.list(&[Value::small(7), Value::small(number)]).unwrap();
            if number < 0 {
                let fact = vm.heap.list(&[Value::small(7), Value::small(-number)]).unwrap();
                vm.database.retract(&mut vm.heap, fact, &mut 0).unwrap();
            } else {
                vm.database.assert(&mut vm.heap, fact, &mut 0).unwrap();
            }
        }
        Fingerprints::default().of(&mut vm)
    };
    assert_eq!(of(&[1, 2]), of(&[3, 1, 2, -3]));
    assert_ne!(of(&[1, 2]), of(&[2, 1]));
    assert_ne!(of(&[1, 2]), of(&[1]));
}

#[test]
fn registers_are_live_while_they_may_be_read() {
    let vm = Vm::for_tests();
    let code = words(&[
        Instr::LoadInt { dst: Dst(0), value: Int16(1) },      // 0
        Instr::JumpIfNil { test: Reg(1), to: Jump16(3) },     // 1
        call(Builtin::Add, 2),                                // 2, 3: reads 2 and 3
        Instr::Return { src: Reg(0) },                        // 4
        Instr::LoopIfNotNil { test: Reg(4), to: Back16(-5) }, // 5
        Instr::Return { src: Reg(5) },                        // 6
    ]);
    let live = Live::of(&vm.heap, &code, &[]);
    let at = |word: usize| (0..8).filter(|&register| live.at(word).contains(register)).collect::<Vec<_>>();
    assert_eq!(at(0), [1, 2, 3, 4, 5]);
    assert_eq!(at(2), [2, 3]);
    assert_eq!(at(4), [0]);
    assert_eq!(at(5), [1, 2, 3, 4, 5]);
    assert_eq!(at(6), [5]);
    // A register read by a landing is live as long as the control entry is in place.
    let code = words(&[
        Instr::PushCleanup { window: Window(4), to: Landing(1) }, // 0, 1
        Instr::EnterCleanup {},                                   // 2
        Instr::Move { dst: Dst(0), src: Reg(3) },                 // 3
        Instr::EndCleanup {},                                     // 4
        Instr::Return { src: Reg(1) },                            // 5
    ]);
    let live = Live::of(&vm.heap, &code, &[]);
    assert!(live.at(0).contains(3) && live.at(2).contains(3) && !live.at(0).contains(0));
}
