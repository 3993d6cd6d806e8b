//! Fused instructions: short sequences of instructions that the loop runs as one.
//!
//! A fused instruction saves the jumps between its parts, and a double that one part computes for the next is
//! not encoded and decoded in between. The loader makes them, so no file contains any, and neither compiler
//! nor verifier knows them.
//!
//! Only the number in the first word of a sequence is changed; its operands and the words behind it stay.
//! Therefore:
//!
//! * code that reads the opcode of a word in loaded code gets that of the first part, by [`original`];
//! * a part that the fast path cannot do is executed as the instruction that it is: a fused instruction
//!   that has done some of its parts goes on at the word of the next one;
//! * a jump may lead behind the first part.
//!
//! So failures, traces and ticks are those of the parts. A part that takes a tick is the last one.
//!
//! Numbers are those from [`FIRST`] on, which belong to the machine.

use esl_bytecode::opcode::Opcode;
use esl_bytecode::word::Word;

/// Calls `$with!` with every fused instruction: its number, its parts, and the rule for their operands.
macro_rules! for_each_fused {
    ($with:ident $($more:tt)*) => {
        $with! {
            $($more)*
            // ---- sums of products
            /// The sum of two products.
            MulMulAdd = 0xC8, [Mul Mul Add], are_products;
            /// The difference of two products.
            MulMulSub = 0xC9, [Mul Mul Sub], are_products_in_order;
            /// An element of a simple vector times something, added to something else.
            VectorRefMulAdd = 0xCA, [VectorRef Mul Add], are_used_in_turn;
            /// An element of an array times something, added to something else.
            ArrayRefMulAdd = 0xCB, [ArrayRef Mul Add], are_used_in_turn;

            // ---- an operation on the result of another
            /// A sum added to something.
            AddAdd = 0xCC, [Add Add], uses_result;
            /// A sum as a factor.
            AddMul = 0xCD, [Add Mul], uses_result;
            /// A sum less something.
            AddSubLeft = 0xCE, [Add Sub], uses_result_left;
            /// Something less a sum.
            AddSubRight = 0xCF, [Add Sub], uses_result_right;
            /// A difference added to something.
            SubAdd = 0xD0, [Sub Add], uses_result;
            /// A difference as a factor.
            SubMul = 0xD1, [Sub Mul], uses_result;
            /// A difference less something.
            SubSubLeft = 0xD2, [Sub Sub], uses_result_left;
            /// Something less a difference.
            SubSubRight = 0xD3, [Sub Sub], uses_result_right;
            /// A product added to something.
            MulAdd = 0xD4, [Mul Add], uses_result;
            /// A product as a factor.
            MulMul = 0xD5, [Mul Mul], uses_result;
            /// A product less something.
            MulSubLeft = 0xD6, [Mul Sub], uses_result_left;
            /// Something less a product.
            MulSubRight = 0xD7, [Mul Sub], uses_result_right;
            /// Something divided by a double counted up or down.
            AddIntDiv = 0xD8, [AddInt Div], uses_result_right;
            /// A number counted up or down, and a product.
            AddIntMul = 0xD9, [AddInt Mul], fits_always;

            // ---- an operation on an element
            /// An element of a simple vector added to something.
            VectorRefAdd = 0xDA, [VectorRef Add], uses_result;
            /// An element of an array added to something.
            ArrayRefAdd = 0xDB, [ArrayRef Add], uses_result;
            /// An element of a simple vector as a factor.
            VectorRefMul = 0xDC, [VectorRef Mul], uses_result;
            /// An element of an array as a factor.
            ArrayRefMul = 0xDD, [ArrayRef Mul], uses_result;
            /// An element of a simple vector less something.
            VectorRefSubLeft = 0xDE, [VectorRef Sub], uses_result_left;
            /// An element of an array less something.
            ArrayRefSubLeft = 0xDF, [ArrayRef Sub], uses_result_left;
            /// Something less an element of a simple vector.
            VectorRefSubRight = 0xE0, [VectorRef Sub], uses_result_right;
            /// Something less an element of an array.
            ArrayRefSubRight = 0xE1, [ArrayRef Sub], uses_result_right;

            // ---- an operation on a constant
            /// A constant, and a sum.
            LoadConstAdd = 0xE2, [LoadConst Add], fits_always;
            /// A constant, and a difference.
            LoadConstSub = 0xE3, [LoadConst Sub], fits_always;
            /// A constant, and a product.
            LoadConstMul = 0xE4, [LoadConst Mul], fits_always;
            /// A constant, and a modulus.
            LoadConstMod = 0xE5, [LoadConst Mod], fits_always;
            /// A number, and a product.
            LoadIntMul = 0xE6, [LoadInt Mul], fits_always;
            /// A number, and a modulus.
            LoadIntMod = 0xE7, [LoadInt Mod], fits_always;

            // ---- two that are often found together
            /// Two moves.
            MoveMove = 0xE8, [Move Move], fits_always;
            /// A move at the end of a loop.
            MoveLoop = 0xE9, [Move Loop], fits_always;
            /// A number counted up or down, and a move.
            AddIntMove = 0xEA, [AddInt Move], fits_always;
            /// An item, and the items behind it.
            CarCdr = 0xEB, [Car Cdr], fits_always;
            /// An item compared as a number.
            CarJumpNumEq = 0xEC, [Car JumpNumEq], fits_always;
            /// An item, and a sum.
            CarAdd = 0xED, [Car Add], fits_always;
            /// An item, and a difference.
            CarSub = 0xEE, [Car Sub], fits_always;
            /// The items behind one, and a number counted up or down.
            CdrAddInt = 0xEF, [Cdr AddInt], fits_always;

            // ---- calls, which take their tick after the first part, and returns
            /// An argument, and a call.
            MoveCallGlobal = 0xF0, [Move CallGlobal], fits_always;
            /// An argument, and a call of the running function.
            MoveCallSelf = 0xF1, [Move CallSelf], fits_always;
            /// A number counted up or down, and a call of the running function.
            AddIntCallSelf = 0xF2, [AddInt CallSelf], fits_always;
            /// A sum that is returned.
            AddReturn = 0xF3, [Add Return], fits_always;
        }
    };
}
pub(crate) use for_each_fused;

/// Least number of a fused instruction.
const FIRST: u8 = 0xC8;

/// A fused instruction.
pub(crate) struct FusedInstruction {
    /// Name of its arm.
    #[cfg(test)]
    pub(crate) name: &'static str,
    number: u8,
    /// All but the last have one word.
    parts: &'static [Opcode],
    /// Whether the operands of the parts are as the loop expects them.
    fits: fn(&[Word]) -> bool,
}

macro_rules! define_fused {
    ($($(#[doc = $doc:literal])* $name:ident = $number:literal, [$($part:ident)+], $fits:ident;)*) => {
        /// Longer sequences come before those with which they begin.
        pub(crate) static FUSED: &[FusedInstruction] = &[$( FusedInstruction {
            #[cfg(test)]
            name: stringify!($name),
            number: $number,
            parts: &[$( Opcode::$part ),+],
            fits: $fits,
        } ),*];

        /// For each opcode, which of [`FUSED`] begin with it, a bit for each.
        static BEGINS: [u64; 256] = {
            let firsts = [$( [$( Opcode::$part as u8 ),+][0] ),*];
            let mut begins = [0; 256];
            let mut index = 0;
            while index < firsts.len() {
                begins[firsts[index] as usize] |= 1 << index;
                index += 1;
            }
            begins
        };

        /// The opcode of the first part of each fused instruction, by its number.
        const ORIGINALS: [u8; 256 - FIRST as usize] = {
            let mut originals = [0; 256 - FIRST as usize];
            $( originals[$number - FIRST as usize] = [$( Opcode::$part as u8 ),+][0]; )*
            let mut number = 0;
            while number < QUICK_LOOPS.len() {
                originals[(QUICK_LOOP + number as u8 - FIRST) as usize] = QUICK_LOOPS[number] as u8;
                number += 1;
            }
            originals
        };
    };
}
for_each_fused!(define_fused);

/// Number of the first loop instruction that has machine code, in the order of [`QUICK_LOOPS`].
pub(crate) const QUICK_LOOP: u8 = 0xF4;

/// The loop instructions. One of a function that has machine code gets another number in its word, so that
/// the loop enters the machine code there.
const QUICK_LOOPS: [Opcode; 7] = [
    Opcode::Loop,
    Opcode::LoopIfNil,
    Opcode::LoopIfNotNil,
    Opcode::LoopIfCons,
    Opcode::LoopLess,
    Opcode::LoopNotLess,
    Opcode::LoopCount,
];

/// Gives the loop instruction at a word of loaded code the number that leads to machine code. An instruction
/// that was fused with it is one of its own again.
#[cfg(feature = "native")]
pub(crate) fn quicken_loop(words: &mut [u32], at: usize) {
    let quick =
        Word(words[at]).opcode().and_then(|opcode| QUICK_LOOPS.iter().position(|&loops| loops == opcode));
    let Some(quick) = quick else { return };
    words[at] = words[at] & !0xff | u32::from(QUICK_LOOP + quick as u8);
    if let Some(before) = at.checked_sub(1)
        && is_instruction(words, before)
        && FUSED.iter().any(|fused| {
            u32::from(fused.number) == words[before] & 0xff
                && fused.parts.len() == 2
                && QUICK_LOOPS.contains(&fused.parts[1])
        })
    {
        words[before] = original(Word(words[before])).0;
    }
}

/// Returns whether an instruction begins at a word of loaded code. The second word of one can look like
/// another: it is any number.
#[cfg(feature = "native")]
fn is_instruction(words: &[u32], at: usize) -> bool {
    let mut begin = 0;
    while begin < at {
        begin += original(Word(words[begin])).opcode().map_or(1, Opcode::words);
    }
    begin == at
}

/// Returns the word of loaded code as it was before the loader fused it with those behind it.
#[inline]
pub(crate) const fn original(word: Word) -> Word {
    if word.number() < FIRST {
        return word;
    }
    Word(word.0 & !0xff | ORIGINALS[(word.number() - FIRST) as usize] as u32)
}

/// Returns the words of loaded code, without those of captures, as they were before the loader fused them.
pub(crate) fn unfused(words: &[u32]) -> Vec<u32> {
    let mut words = words.to_vec();
    let mut at = 0;
    while let Some(word) = words.get_mut(at) {
        *word = original(Word(*word)).0;
        at += Word(*word).opcode().map_or(1, Opcode::words);
    }
    words
}

/// Fuses the instructions of some code.
pub(crate) fn fuse(words: &mut [u32]) {
    let mut at = 0;
    while let Some(opcode) = words.get(at).and_then(|&word| Word(word).opcode()) {
        let Some(fused) = fused_at(opcode, &words[at..]) else {
            at += opcode.words();
            continue;
        };
        words[at] = words[at] & !0xff | u32::from(fused.number);
        at += fused.parts.iter().map(|part| part.words()).sum::<usize>();
    }
}

/// Returns the first fused instruction whose parts these words begin with.
fn fused_at(first: Opcode, words: &[u32]) -> Option<&'static FusedInstruction> {
    let mut open = BEGINS[first as usize];
    while open != 0 {
        let fused = &FUSED[open.trailing_zeros() as usize];
        open &= open - 1;
        let count = fused.parts.len();
        let mut parts = [Word(0); MOST_PARTS];
        if words.len() < count {
            continue;
        }
        for (part, &word) in parts.iter_mut().zip(&words[..count]) {
            *part = Word(word);
        }
        let parts = &parts[..count];
        if parts.iter().zip(fused.parts).all(|(word, &part)| word.opcode() == Some(part))
            && (fused.fits)(parts)
        {
            return Some(fused);
        }
    }
    None
}

/// Largest number of parts.
const MOST_PARTS: usize = 3;

fn fits_always(_: &[Word]) -> bool {
    true
}

/// Whether the second part uses the result of the first for one of its operands.
fn uses_result(parts: &[Word]) -> bool {
    uses_result_left(parts) || uses_result_right(parts)
}

/// Whether the second part uses the result of the first for its left operand only.
fn uses_result_left(parts: &[Word]) -> bool {
    parts[1].b() == parts[0].a() && parts[1].c() != parts[0].a()
}

/// Whether the second part uses the result of the first for its right operand only.
fn uses_result_right(parts: &[Word]) -> bool {
    parts[1].c() == parts[0].a() && parts[1].b() != parts[0].a()
}

/// Whether the third part uses the results of the others, neither of which uses that of the other.
fn are_products(parts: &[Word]) -> bool {
    let (first, second) = (parts[0].a(), parts[1].a());
    let is_apart = first != second && parts[1].b() != first && parts[1].c() != first;
    let operands = (parts[2].b(), parts[2].c());
    is_apart && (operands == (first, second) || operands == (second, first))
}

/// Whether the second part uses the result of the first for one of its operands, and the third that of the
/// second.
fn are_used_in_turn(parts: &[Word]) -> bool {
    uses_result(parts) && uses_result(&parts[1..])
}

/// As [`are_products`], the result of the first part the left operand of the third.
fn are_products_in_order(parts: &[Word]) -> bool {
    are_products(parts) && parts[2].b() == parts[0].a()
}
