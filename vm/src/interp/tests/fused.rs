//! Fused instructions do what their parts do, one after the other: programs of random instructions have the
//! same outcome with a jump between any two, which keeps the loader from fusing them.

use std::collections::BTreeSet;

use esl_bytecode::assembler::assemble;
#[cfg(feature = "native")]
use esl_bytecode::opcode::Opcode;
use esl_bytecode::word::Word;

use super::arms::{Machine, functions};
#[cfg(feature = "native")]
use crate::fused::quicken_loop;
use crate::fused::{FUSED, fuse, original};
use crate::vm::Config;

/// Numbers that look random, the same in every run.
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, limit: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % limit
    }

    fn of<'a>(&mut self, items: &[&'a str]) -> &'a str {
        items[self.below(items.len())]
    }
}

/// The first contents of registers: a fixnum, doubles with and without a box, zero, a large integer, a
/// vector, a pair, and something that fits nowhere.
const VALUES: &[&str] = &[
    "load-int % 3",
    "load-int % 1",
    "load-const % k6",
    "load-const % k6",
    "load-const % k7",
    "load-const % k5",
    "load-true %",
];

/// Returns a program without jumps of random instructions on five registers.
fn program(numbers: &mut Numbers) -> Vec<String> {
    let mut lines: Vec<String> =
        (0..3).map(|register| numbers.of(VALUES).replace('%', &format!("r{register}"))).collect();
    lines.push("load-const r3 k10".into());
    lines.push("load-const r4 k11".into());
    for _ in 0..8 {
        let operation = numbers.of(&[
            "add",
            "add",
            "sub",
            "sub",
            "mul",
            "mul",
            "mul",
            "mod",
            "div",
            "vector-ref",
            "array-ref",
            "load-const",
            "load-int",
            "move",
            "add-int",
            "car",
            "cdr",
        ]);
        let [dst, x, y] = [0; 3].map(|_| numbers.below(3));
        let line = match operation {
            "load-const" => format!("load-const r{dst} k{}", numbers.of(&["4", "5", "6", "7"])),
            "load-int" => format!("load-int r{dst} {x}"),
            "move" => format!("move r{dst} r{x}"),
            "add-int" => format!("add-int r{dst} r{x} {y}"),
            "vector-ref" | "array-ref" => {
                // The index is mostly good.
                lines.push(format!("load-int r5 {}", numbers.below(2) + numbers.below(2) * numbers.below(2)));
                format!("{operation} r{dst} r3 r5")
            }
            "car" | "cdr" => format!("{operation} r{dst} r4"),
            _ => format!("{operation} r{dst} r{x} r{y}"),
        };
        lines.push(line);
    }
    lines.push("list r6 r0.. 3".into());
    lines.push("return r6".into());
    lines
}

/// Returns the numbers of the fused instructions in a program.
fn fused_in(program: &str) -> BTreeSet<u8> {
    fused_in_code(assemble(program).unwrap())
}

fn fused_in_code(code: Vec<u32>) -> BTreeSet<u8> {
    let mut words = code.clone();
    fuse(&mut words);
    let changed = code.into_iter().zip(words).filter(|(before, after)| before != after);
    changed
        .map(|(before, after)| {
            assert_eq!(original(Word(after)), Word(before));
            after as u8
        })
        .collect()
}

#[test]
fn fused_instructions_do_what_their_parts_do() {
    let mut numbers = Numbers(7);
    let count = if cfg!(miri) { 4 } else { 4000 };
    let programs: Vec<Vec<String>> = (0..count).map(|_| program(&mut numbers)).collect();
    let fused: Vec<String> = programs.iter().map(|lines| lines.join("\n")).collect();
    let apart: Vec<String> = programs.iter().map(|lines| lines.join("\njump +0\n")).collect();
    let found: BTreeSet<u8> = fused.iter().flat_map(|program| fused_in(program)).collect();
    assert!(apart.iter().all(|program| fused_in(program).is_empty()));
    // Those with jumps and calls have programs of their own.
    let of_others = functions(PROGRAMS.iter().map(|(program, _)| *program));
    let of_others = of_others.into_iter().flat_map(|function| fused_in_code(function.code));
    let found: BTreeSet<u8> = found.into_iter().chain(of_others).collect();
    assert!(cfg!(miri) || found.len() == FUSED.len(), "{found:x?}");
    let mut machine = Machine::new();
    let (of_fused, of_apart) =
        (machine.load(fused.iter().map(String::as_str)), machine.load(apart.iter().map(String::as_str)));
    for ((program, fused), apart) in fused.iter().zip(of_fused).zip(of_apart) {
        assert_eq!(machine.run(fused), machine.run(apart), "{program}");
    }
}

/// Programs with jumps, and into the middle of fused instructions.
const PROGRAMS: &[(&str, &str)] = &[
    (
        "load-const r0 k11 \n load-int r1 1 \n car r2 r0 \n jump-num-eq r2 r1 L \n load-true r2 \n L: return r2",
        "1",
    ),
    (
        "load-const r0 k11 \n load-int r1 2 \n car r2 r0 \n jump-num-eq r2 r1 L \n load-true r2 \n L: return r2",
        "T",
    ),
    (
        "load-const r0 k11 \n load-true r1 \n car r2 r0 \n jump-num-eq r2 r1 L \n load-true r2 \n L: return r2",
        ":TYPE-ERROR T NUMBER",
    ),
    (
        "load-int r0 0 \n L: jump-greater-int r0 4 M \n add-int r1 r0 1 \n load-nil r3.. 1 \n move r0 r1
         loop L \n M: return r0",
        "5",
    ),
    // The addition alone, then both.
    (
        "load-const r0 k6 \n load-int r1 0 \n load-const r2 k6 \n jump M \n L: mul r2 r0 r0 \n M: add r2 r2 r0
         add-int r1 r1 1 \n load-int r3 2 \n loop-less r1 r3 L \n return r2",
        "3.75",
    ),
    ("load-int r0 5 \n move r4 r0 \n call-global r2.. 1 want 1 k1 \n return r2", "6"),
    ("make-closure r0 k18 \n load-int r2 4 \n call r0.. 1 want 1 \n return r0", "10"),
    ("make-closure r0 k19 \n load-int r2 4 \n load-int r3 1 \n call r0.. 2 want 1 \n return r0", "11"),
];

#[test]
fn jumps_lead_out_of_fused_instructions_and_into_them() {
    assert_eq!(Machine::new().wrong(PROGRAMS.iter().copied()), "");
    let found: BTreeSet<u8> = PROGRAMS.iter().flat_map(|(program, _)| fused_in(program)).collect();
    assert!(found.len() >= 3, "{found:x?}");
}

#[test]
fn fused_instructions_take_the_ticks_of_their_parts() {
    let program = PROGRAMS[3].0;
    let apart = program.replace("\n loop L", "\n jump +0 \n loop L");
    let ticks = |program: &str, slice| {
        let mut machine = Machine::with(Config { slice, ..Config::default() });
        let function = machine.load([program])[0];
        assert_eq!(machine.run(function), "5");
        machine.ticks()
    };
    let slices: &[_] = if cfg!(miri) { &[1] } else { &[1, 2, 2000] };
    for &slice in slices {
        assert_eq!(ticks(program, slice), ticks(&apart, slice), "slice {slice}");
    }
}

/// The second word of an instruction is any number, also that of an instruction that is fused with a loop.
#[cfg(feature = "native")]
#[test]
fn a_loop_that_leads_to_machine_code_leaves_the_word_before_it_alone() {
    let call = |number: usize| vec![Opcode::CallBuiltin as u32, number as u32];
    let fused = |number: usize| vec![number as u32];
    let is_fused_with_loop = |number: usize| original(Word(number as u32)).number() == Opcode::Move as u8;
    let mut parted = 0;
    for number in 0..1024 {
        let mut words = call(number);
        words.push(Opcode::Loop as u32);
        quicken_loop(&mut words, 2);
        assert_eq!(words[..2], call(number), "{number}");
        assert_ne!(words[2], Opcode::Loop as u32);
    }
    for number in (0xC0..0x100).filter(|&number| is_fused_with_loop(number)) {
        let mut words = fused(number);
        words.push(Opcode::Loop as u32);
        quicken_loop(&mut words, 1);
        parted += usize::from(words[0] == Opcode::Move as u32);
    }
    assert_eq!(parted, 1, "a move and a loop");
}
