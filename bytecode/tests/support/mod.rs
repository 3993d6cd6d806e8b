//! Random modules, for the tests of files and of the verifier.
//!
//! All randomness comes from a seed, so that a failure is repeated by its number.

#![allow(dead_code, reason = "each test uses a part of this")]

use esl_bytecode::for_each_opcode;
use esl_bytecode::module::{
    Capture, CaptureSource, Constant, FunctionNumber, LineEntry, Module, ModuleFunction, Parameters, PoolIdx,
    VariablePlace, VariableRange,
};
use esl_bytecode::opcode::{Instr, OPCODES, Opcode};
use esl_bytecode::operand::*;
use esl_bytecode::symbol::Symbol;

/// A generator of random numbers (SplitMix64).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    /// A number of 64 bits.
    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number below `end`.
    pub(crate) fn below(&mut self, end: usize) -> usize {
        (self.next() % end as u64) as usize
    }

    /// True once in `n` times.
    pub(crate) fn once_in(&mut self, n: usize) -> bool {
        self.below(n) == 0
    }

    /// One of `items`.
    pub(crate) fn pick<T: Clone>(&mut self, items: &[T]) -> T {
        items[self.below(items.len())].clone()
    }
}

macro_rules! define_builder {
    ($( $(#[doc = $doc:literal])* $name:ident = $number:literal, $mnemonic:literal, $($kind:ident)+
        { $( $field:ident : $ty:ident ),* } $( , $slow:ident $half:path )? ; )*) => {
        /// The instruction whose operands, of these types, have these bits.
        pub(crate) fn build(opcode: Opcode, mut bits: impl FnMut(&'static str) -> u32) -> Instr {
            match opcode {
                $( Opcode::$name => Instr::$name { $( $field: $ty::from_bits(bits(stringify!($ty))) ),* }, )*
            }
        }
    };
}

for_each_opcode!(define_builder);

/// Registers that random code uses.
pub(crate) const REGISTERS: u8 = 7;

/// Constants by the number that random code knows them by: a symbol, an integer, a function without captures,
/// functions with a value, a box, and a later capture, a function that hands on captures, a class, and a
/// vector of types.
const SYMBOL: u32 = 0;
const INTEGER: u32 = 1;
const FUNCTIONS: std::ops::Range<u32> = 2..7;
const WITH_LATER_CAPTURE: u32 = 5;
const CLASS: u32 = 7;
const TYPES: u32 = 8;

/// A module whose function 0 is random and has a chance to pass the verifier.
pub(crate) fn module_with_random_code(random: &mut Random) -> Module {
    let function = |number| Constant::Function(FunctionNumber(number));
    let mut constants = vec![Constant::Symbol(Symbol::esl("FOO")), Constant::Integer(1.into())];
    constants.extend((1..6).map(function));
    constants.push(Constant::Class(Symbol::esl("POINT")));
    constants.push(Constant::Vector(vec![PoolIdx(SYMBOL)]));
    let code: Vec<u32> = vec![Instr::ReturnValues { first: Items(0), count: Count(0) }.encode().0];
    let captures = [
        vec![],
        vec![Capture::value(CaptureSource::Register(1))],
        vec![Capture::boxed(CaptureSource::Register(2))],
        vec![Capture::value(CaptureSource::Later), Capture::value(CaptureSource::Register(1))],
        vec![Capture::value(CaptureSource::Capture(0)), Capture::boxed(CaptureSource::Capture(1))],
    ];
    let others =
        captures.map(|captures| ModuleFunction { captures, code: code.clone(), ..ModuleFunction::default() });
    let parameters = match random.below(3) {
        0 => Parameters::default(),
        1 => Parameters { required: 1, optional: 1, ..Parameters::default() },
        _ => {
            Parameters { optional: 1, rest: true, keys: Some(vec![PoolIdx(SYMBOL)]), ..Parameters::default() }
        }
    };
    let own = [Capture::value(CaptureSource::Later), Capture::boxed(CaptureSource::Register(0))];
    let captures = if random.once_in(2) { vec![] } else { vec![random.pick(&own), random.pick(&own)] };
    let first = ModuleFunction {
        parameters,
        captures,
        registers: REGISTERS,
        constants: (0..constants.len() as u32).map(PoolIdx).collect(),
        code: random_code(random),
        ..ModuleFunction::default()
    };
    let functions = std::iter::once(first).chain(others).collect();
    Module { constants, functions, ..Module::default() }
}

/// The material of one piece of random code: few opcodes and registers, so that they meet often.
struct Palette {
    leaves: Vec<Opcode>,
    regions: Vec<Region>,
    registers: usize,
}

/// The opcode that begins a region of code, the one that ends it, and the one that ends a part after that.
type Region = (Opcode, Opcode, Option<Opcode>);

const REGIONS: &[Region] = &[
    (Opcode::Bind, Opcode::Unbind, None),
    (Opcode::PushScope, Opcode::PopControl, None),
    (Opcode::PushHandlers, Opcode::PopControl, None),
    (Opcode::PushCatch, Opcode::PopControl, None),
    (Opcode::PushCatch, Opcode::PopControl, None),
    (Opcode::PushHandlerCase, Opcode::PopControl, None),
    (Opcode::PushRecovery, Opcode::PopControl, None),
    (Opcode::PushFailureCleanup, Opcode::PopControl, Some(Opcode::EndCleanup)),
    (Opcode::PushCleanup, Opcode::EnterCleanup, Some(Opcode::EndCleanup)),
    (Opcode::PushCleanup, Opcode::EnterCleanup, Some(Opcode::EndCleanup)),
];

/// Code whose jumps all go to instructions. Often, what is pushed is popped.
fn random_code(random: &mut Random) -> Vec<u32> {
    let source = if random.once_in(2) { LEAVES } else { random.pick(THEMES) };
    let palette = Palette {
        leaves: (0..random.below(6) + 2).map(|_| random.pick(source)).collect(),
        regions: (0..random.below(3) + 1).map(|_| random.pick(REGIONS)).collect(),
        registers: random.below(4) + 2,
    };
    let mut opcodes = Vec::new();
    if !random.once_in(4) {
        opcodes.push(Opcode::LoadNil);
    }
    random_block(random, &palette, 0, &mut opcodes);
    opcodes.push(Opcode::Return);
    encode(&opcodes, &palette, random)
}

/// Opcodes in leaves of random code; those that matter to the verifier are more frequent.
const LEAVES: &[Opcode] = &[
    Opcode::Move,
    Opcode::Move,
    Opcode::LoadInt,
    Opcode::LoadInt,
    Opcode::LoadConst,
    Opcode::LoadNil,
    Opcode::LoadNil,
    Opcode::Add,
    Opcode::Car,
    Opcode::List,
    Opcode::JumpAlways,
    Opcode::JumpIfNil,
    Opcode::JumpLess,
    Opcode::JumpIfSupplied,
    Opcode::JumpIfSupplied,
    Opcode::Loop,
    Opcode::LoopIfNil,
    Opcode::LoopCount,
    Opcode::MakeBox,
    Opcode::MakeBox,
    Opcode::MakeBox,
    Opcode::BoxRef,
    Opcode::BoxSet,
    Opcode::MakeClosure,
    Opcode::MakeClosure,
    Opcode::PatchCapture,
    Opcode::CaptureRef,
    Opcode::CaptureBoxRef,
    Opcode::CaptureBoxSet,
    Opcode::Call,
    Opcode::CallGlobal,
    Opcode::CallGlobal,
    Opcode::Apply,
    Opcode::SetValues,
    Opcode::SetValues,
    Opcode::GetValues,
    Opcode::ValuesToList,
    Opcode::ListToValues,
    Opcode::Throw,
    Opcode::Return,
    Opcode::ReturnAll,
    Opcode::TailCallGlobal,
    Opcode::BindList,
    Opcode::Bind,
    Opcode::Unbind,
    Opcode::NewTag,
];

/// Opcodes that have to do with each other.
const THEMES: &[&[Opcode]] = &[
    &[
        Opcode::MakeBox,
        Opcode::MakeBox,
        Opcode::BoxRef,
        Opcode::BoxSet,
        Opcode::Move,
        Opcode::LoadInt,
        Opcode::JumpIfNil,
        Opcode::LoopIfNil,
        Opcode::CallGlobal,
    ],
    &[
        Opcode::MakeClosure,
        Opcode::MakeClosure,
        Opcode::PatchCapture,
        Opcode::PatchCapture,
        Opcode::Move,
        Opcode::LoadInt,
        Opcode::JumpIfNil,
        Opcode::LoopIfNil,
        Opcode::MakeBox,
    ],
    &[
        Opcode::SetValues,
        Opcode::GetValues,
        Opcode::ListToValues,
        Opcode::ReturnAll,
        Opcode::CallGlobal,
        Opcode::JumpIfNil,
        Opcode::LoopIfNil,
        Opcode::Throw,
    ],
    &[
        Opcode::Bind,
        Opcode::Unbind,
        Opcode::BindList,
        Opcode::PushScope,
        Opcode::PopControl,
        Opcode::JumpIfNil,
        Opcode::EnterCleanup,
        Opcode::EndCleanup,
    ],
];

fn random_block(random: &mut Random, palette: &Palette, depth: usize, opcodes: &mut Vec<Opcode>) {
    for _ in 0..random.below(6) {
        if depth > 3 || !random.once_in(3) {
            // Now and then any opcode at all.
            let any = random.once_in(60);
            let opcode =
                if any { OPCODES[random.below(OPCODES.len())].opcode } else { random.pick(&palette.leaves) };
            opcodes.push(opcode);
            continue;
        }
        let (begin, end, end_after) = random.pick(&palette.regions);
        opcodes.push(begin);
        random_block(random, palette, depth + 1, opcodes);
        // Sometimes the end is missing.
        if !random.once_in(20) {
            opcodes.push(end);
            // Control that lands behind the region may do so without company.
            if end == Opcode::PopControl && random.once_in(3) {
                opcodes.push(Opcode::Return);
            }
        }
        if let Some(end) = end_after {
            random_block(random, palette, depth + 1, opcodes);
            opcodes.push(end);
        }
    }
}

/// Where the code lands after the region that begins at `at`: behind what ends it.
fn region_end(opcodes: &[Opcode], at: usize) -> usize {
    let mut open = 0;
    for (index, opcode) in opcodes.iter().enumerate().skip(at) {
        match opcode {
            Opcode::PushScope
            | Opcode::PushHandlers
            | Opcode::PushCatch
            | Opcode::PushHandlerCase
            | Opcode::PushRecovery
            | Opcode::PushFailureCleanup => open += 1,
            Opcode::PushCleanup => open += 1,
            Opcode::PopControl | Opcode::EnterCleanup => {
                open -= 1;
                if open == 0 {
                    let behind_return = opcodes.get(index + 1) == Some(&Opcode::Return);
                    return (index + 1 + usize::from(behind_return)).min(opcodes.len() - 1);
                }
            }
            _ => {}
        }
    }
    opcodes.len() - 1
}

fn encode(opcodes: &[Opcode], palette: &Palette, random: &mut Random) -> Vec<u32> {
    let mut starts = Vec::new();
    let mut end = 0;
    for opcode in opcodes {
        starts.push(end as i64);
        end += opcode.words();
    }
    let mut code = Vec::new();
    for (index, &opcode) in opcodes.iter().enumerate() {
        let next = starts[index] + opcode.words() as i64;
        let instr = build(opcode, |kind| match kind {
            "Reg" | "Dst" => random.below(palette.registers) as u32,
            "Count" if opcode == Opcode::LoadNil => random.below(5) as u32,
            "Room" if opcode == Opcode::LoadNil => 0,
            "Items" | "Room" | "Window" => random.below(palette.registers) as u32,
            "Count" if matches!(opcode, Opcode::PopControl | Opcode::Unbind) && !random.once_in(10) => 1,
            "Count" => random.below(3) as u32,
            "Want" => random.pick(&[0, 0, 2, 255]),
            "FunctionIdx" if random.once_in(2) => WITH_LATER_CAPTURE,
            "FunctionIdx" => random.below(FUNCTIONS.len()) as u32 + FUNCTIONS.start,
            "SymbolIdx" | "WideSymbolIdx" => SYMBOL,
            "ConstIdx" => INTEGER,
            "ClassIdx" | "WideClassIdx" => CLASS,
            "VectorIdx" => TYPES,
            "Pad" => 0,
            "Index" => random.below(2) as u32,
            "Landing" if !random.once_in(10) => (starts[region_end(opcodes, index)] - next) as u32,
            "Jump" | "Jump16" | "Jump24" | "Landing" => {
                let target = (index + 1 + random.below(4)).min(opcodes.len() - 1);
                (starts[target] - next) as u32
            }
            "Back" | "Back16" | "Back24" => {
                let target = index - random.below(index.min(6) + 1);
                (starts[target] - next) as u32
            }
            "BuiltinIdx" => random.below(10) as u32,
            _ => random.below(4) as u32,
        });
        let (word, aux) = instr.encode();
        code.push(word);
        code.extend(aux);
    }
    code
}

/// A module in which anything may stand that a file can hold, whether it makes sense or not.
pub(crate) fn any_module(random: &mut Random) -> Module {
    let sources = (0..random.below(3)).map(|number| format!("source-{number}.esl")).collect();
    let functions: Vec<ModuleFunction> = Vec::new();
    let mut module = Module { sources, functions, ..Module::default() };
    let function_count = random.below(5);
    for _ in 0..random.below(30) {
        let constant = any_constant(random, module.constants.len(), function_count);
        module.constants.push(constant);
    }
    let pool = module.constants.len();
    module.functions = (0..function_count).map(|_| any_function(random, pool)).collect();
    if function_count > 0 {
        module.toplevel =
            (0..random.below(4)).map(|_| FunctionNumber(random.below(function_count) as u32)).collect();
    }
    module
}

fn any_symbol(random: &mut Random) -> Symbol {
    let name = random.pick(&["FOO", "", "λ", "a b", "CAR"]);
    match random.below(4) {
        0 => Symbol::cl(name),
        1 => Symbol::esl(name),
        2 => Symbol::keyword(name),
        _ => Symbol::uninterned(random.below(3) as u32, name),
    }
}

fn any_constant(random: &mut Random, earlier: usize, functions: usize) -> Constant {
    let big = (num_bigint_of(random.next()) << random.below(100)) - 1_u32;
    let items = |random: &mut Random| -> Vec<PoolIdx> {
        if earlier == 0 {
            return vec![];
        }
        (0..random.below(4)).map(|_| PoolIdx(random.below(earlier) as u32)).collect()
    };
    match random.below(14) {
        0 => Constant::Nil,
        1 => Constant::True,
        2 => Constant::Symbol(any_symbol(random)),
        3 => Constant::Integer(big),
        4 => Constant::Integer(-big),
        5 => Constant::Ratio(big, random.next().into()),
        6 => Constant::Float(random.next() as f64),
        7 => Constant::Character(char::from_u32(random.below(0xD800) as u32).expect("below the surrogates")),
        8 => Constant::String(random.pick(&["", "text", "λ"]).into()),
        9 if earlier > 0 => {
            Constant::Cons(PoolIdx(random.below(earlier) as u32), PoolIdx(random.below(earlier) as u32))
        }
        10 => Constant::Vector(items(random)),
        11 => Constant::Array((0..random.below(3)).map(|_| random.below(4) as u32).collect(), items(random)),
        12 if functions > 0 => Constant::Function(FunctionNumber(random.below(functions) as u32)),
        _ => Constant::Class(any_symbol(random)),
    }
}

fn num_bigint_of(value: u64) -> esl_bytecode::BigInt {
    value.into()
}

fn any_function(random: &mut Random, pool: usize) -> ModuleFunction {
    let index = |random: &mut Random| {
        if pool == 0 || random.once_in(3) { None } else { Some(PoolIdx(random.below(pool) as u32)) }
    };
    let name = index(random);
    let lambda_list = index(random);
    let documentation = index(random);
    let list = |random: &mut Random, length: usize| -> Vec<PoolIdx> {
        (0..random.below(length)).filter_map(|_| index(random)).collect()
    };
    let keys = if random.once_in(2) { None } else { Some(list(random, 4)) };
    let constants = list(random, 10);
    let sources = [
        CaptureSource::Register(random.next() as u8),
        CaptureSource::Capture(random.next() as u8),
        CaptureSource::Later,
    ];
    ModuleFunction {
        name,
        lambda_list,
        documentation,
        parameters: Parameters {
            required: random.next() as u8,
            optional: random.next() as u8,
            rest: random.once_in(2),
            keys,
            allow_other_keys: random.once_in(2),
        },
        registers: random.next() as u8,
        captures: (0..random.below(4))
            .map(|_| Capture { source: random.pick(&sources), boxed: random.once_in(2) })
            .collect(),
        constants,
        code: (0..random.below(20)).map(|_| random.next() as u32).collect(),
        lines: (0..random.below(5))
            .map(|_| LineEntry {
                pc: random.next() as u32,
                source: random.below(3) as u32,
                line: random.next() as u32,
                column: random.below(100) as u32,
            })
            .collect(),
        variables: (0..random.below(4))
            .map(|_| VariableRange {
                name: random.pick(&["", "X", "λ"]).into(),
                place: random.pick(&[VariablePlace::Register(7), VariablePlace::Capture(255)]),
                from: random.next() as u32,
                to: random.next() as u32,
            })
            .collect(),
    }
}
