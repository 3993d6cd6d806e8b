//! Doubles in registers of the processor: what is tested of results, and how they get to the stack.
//!
//! The result of an operation has to be a double without a box, else the interpreter does the operation. The
//! results of several operations in a row, none of which does anything else, are tested together: a *batch*.
//! If one of them needs a box, the machine code is left at the first of them, with the registers as they were
//! there.

use std::mem::offset_of;

use cranelift_codegen::ir::condcodes::{FloatCC, IntCC};
use cranelift_codegen::ir::{Block, Endianness, InstBuilder, MemFlagsData, Value as Ssa, types};
use esl_heap::Value;

use crate::abi::{GUESSED_WRONG, NativeContext};
use crate::emit::WORD;
use crate::kinds::Known;
use crate::places::RegisterBits;
use crate::translate::Translator;

/// What is in the register of the processor if the place in the stack is as it should be: no result of an
/// operation, and no double that a program has.
const IN_PLACE: u64 = 0x7FF8_1E57_1E57_1E57;

/// Results that are tested together.
#[derive(Debug)]
pub(crate) struct DoubleBatch {
    /// Word of the first operation.
    at: usize,
    /// RegisterBits that were kept back there: doubles, and such as may be.
    doubles: RegisterBits,
    spent: RegisterBits,
    /// What has been overwritten since of those.
    saved: Vec<(usize, Ssa)>,
    /// The results, and whether they may be zeros.
    results: Vec<(Ssa, bool)>,
    /// The bits that all words of results have, in the first half of a vector.
    common: Option<Ssa>,
}

/// What has to be done where control goes to another instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum EdgeWork {
    /// The register is not kept back: it gets the mark.
    Mark(usize),
    /// What is kept back goes to its place, and is a word from there on.
    PutBack(usize),
    /// The word is taken from its place.
    Take(usize),
}

impl Translator<'_, '_> {
    // Batches.

    /// Adds a result to the batch. The operation must have no other effect than that a register gets it.
    pub(crate) fn test_later(&mut self, double: Ssa, may_be_zero: bool) {
        let vector = self.b.ins().scalar_to_vector(types::F64X2, double);
        let vector = self.b.ins().bitcast(types::I64X2, little_endian(), vector);
        let mut bias = [0; 16];
        bias[..8].copy_from_slice(&Value::DOUBLE_BIAS.to_le_bytes());
        let bias = self.b.func.dfg.constants.insert(bias.as_slice().into());
        let bias = self.b.ins().vconst(types::I64X2, bias);
        let biased = self.b.ins().iadd(vector, bias);
        let (doubles, spent) = self.kept_back();
        let batch = self.batch.get_or_insert(DoubleBatch {
            at: self.at,
            doubles,
            spent,
            saved: Vec::new(),
            results: Vec::new(),
            common: None,
        });
        batch.results.push((double, may_be_zero));
        batch.common = Some(match batch.common {
            Some(common) => self.b.ins().band(common, biased),
            None => biased,
        });
    }

    /// Tests the results of the batch, if there is one.
    pub(crate) fn close_batch(&mut self) {
        let Some(batch) = self.batch.take() else { return };
        let Some(common) = batch.common else { return };
        let (next, again, out) = (self.block(), self.cold_block(), self.cold_block());
        let common = self.b.ins().bitcast(types::F64X2, little_endian(), common);
        let common = self.b.ins().extractlane(common, 0);
        let common = self.bits_of(common);
        let are_words = self.is_biased_word(common);
        self.branch(are_words, next, again);

        self.go_to(again);
        let mut all = None;
        for &(double, may_be_zero) in &batch.results {
            let bits = self.bits_of(double);
            let biased = self.biased(bits);
            let mut test = self.is_biased_word(biased);
            if may_be_zero {
                let zero = self.b.ins().f64const(0.0);
                let is_zero = self.b.ins().fcmp(FloatCC::Equal, double, zero);
                test = self.b.ins().bor(test, is_zero);
            }
            all = Some(match all {
                Some(all) => self.b.ins().band(all, test),
                None => test,
            });
        }
        match all {
            Some(all) => self.branch(all, next, out),
            None => self.jump(next),
        }

        self.go_to(out);
        for register in batch.doubles.iter().chain(batch.spent.iter()) {
            let saved = batch.saved.iter().find(|(saved, _)| *saved == register);
            let double = match saved {
                Some(&(_, double)) => double,
                None => self.get_double(register as u8),
            };
            if batch.spent.contains(register) {
                self.write_spent(register, double);
            } else {
                self.write_raw(register, double);
            }
        }
        self.name_raw(batch.doubles);
        self.leave_at(batch.at, GUESSED_WRONG);
        self.go_to(next);
    }

    /// Notes what a register holds that is about to be overwritten, if the batch may have to put it back.
    pub(crate) fn save_for_batch(&mut self, register: usize) {
        let is_needed = self.batch.as_ref().is_some_and(|batch| {
            (batch.doubles.contains(register) || batch.spent.contains(register))
                && batch.saved.iter().all(|(saved, _)| *saved != register)
        });
        if is_needed {
            let double = self.get_double(register as u8);
            if let Some(batch) = &mut self.batch {
                batch.saved.push((register, double));
            }
        }
    }

    // Words of doubles.

    pub(crate) fn bits_of(&mut self, double: Ssa) -> Ssa {
        self.b.ins().bitcast(types::I64, MemFlagsData::new(), double)
    }

    fn biased(&mut self, bits: Ssa) -> Ssa {
        let bias = self.word(Value::DOUBLE_BIAS);
        self.b.ins().iadd(bits, bias)
    }

    /// Returns whether the rotation of biased bits gives the word of a double.
    fn is_biased_word(&mut self, biased: Ssa) -> Ssa {
        let top = self.b.ins().ushr_imm_s(biased, 61);
        let tag = self.b.ins().band_imm_s(top, 3);
        self.equals(tag, 3)
    }

    /// Returns the word of a double that was tested.
    fn encode(&mut self, double: Ssa) -> Ssa {
        let bits = self.bits_of(double);
        let (word, is_word) = self.rotated(bits);
        let zero = self.zero_of(bits);
        self.b.ins().select(is_word, word, zero)
    }

    /// Returns what the word of a double is, unless it is a zero, and whether it is none.
    fn rotated(&mut self, bits: Ssa) -> (Ssa, Ssa) {
        let biased = self.biased(bits);
        let word = self.b.ins().rotl_imm_s(biased, 3);
        let tag = self.b.ins().band_imm_s(word, 3);
        (word, self.equals(tag, 3))
    }

    fn zero_of(&mut self, bits: Ssa) -> Ssa {
        let is_negative = self.b.ins().icmp_imm_s(IntCC::SignedLessThan, bits, 0);
        let negative = self.constant_value(Value::NEGATIVE_ZERO);
        let positive = self.constant_value(Value::POSITIVE_ZERO);
        self.b.ins().select(is_negative, negative, positive)
    }

    /// Returns the word of a double in a register. Where nobody uses it nothing is made of it.
    pub(crate) fn word_of_double(&mut self, register: usize) -> Ssa {
        if let Some(word) = self.words[register] {
            return word;
        }
        let double = self.get_double(register as u8);
        self.encode(double)
    }

    /// Makes the word of a double in a register that is needed on the fast way.
    pub(crate) fn make_word(&mut self, register: usize) {
        if self.known[register] != Known::Double || self.words[register].is_some() {
            return;
        }
        let double = self.get_double(register as u8);
        let (done, word) = self.block_with_value();
        let zeros = self.cold_block();
        let bits = self.bits_of(double);
        let (rotated, is_word) = self.rotated(bits);
        self.b.ins().brif(is_word, done, &[rotated.into()], zeros, &[]);
        self.go_to(zeros);
        let zero = self.zero_of(bits);
        self.jump_with(done, zero);
        self.go_to(done);
        self.words[register] = Some(word);
    }

    /// Returns the double that a word is; what is none, or needs a box, goes to `otherwise`.
    pub(crate) fn double_of(&mut self, word: Ssa, otherwise: Block) -> Ssa {
        let (done, others) = (self.block_with(types::F64), self.cold_block());
        self.decode_or(word, done.0, others);
        self.zero_or(word, done.0, otherwise);
        self.go_to(done.0);
        done.1
    }

    /// Goes to `done` with the double that a word is, unless it is none or has a constant of its own: then
    /// to `others`, where the code goes on. Returns the tag of the word.
    pub(crate) fn decode_or(&mut self, word: Ssa, done: Block, others: Block) -> Ssa {
        let doubles = self.block();
        let tag = self.b.ins().band_imm_s(word, 3);
        let is_double = self.equals(tag, 3);
        self.branch(is_double, doubles, others);
        self.go_to(doubles);
        let double = self.decode(word);
        self.jump_with(done, double);
        self.go_to(others);
        tag
    }

    /// Jumps to `done` with the zero that a word is, or to `otherwise`.
    pub(crate) fn zero_or(&mut self, word: Ssa, done: Block, otherwise: Block) {
        let is_positive = self.equals(word, Value::POSITIVE_ZERO.bits());
        let is_negative = self.equals(word, Value::NEGATIVE_ZERO.bits());
        let is_zero = self.b.ins().bor(is_positive, is_negative);
        let (positive, negative) = (self.b.ins().f64const(0.0), self.b.ins().f64const(-0.0));
        let zero = self.b.ins().select(is_negative, negative, positive);
        self.b.ins().brif(is_zero, done, &[zero.into()], otherwise, &[]);
    }

    /// Returns the double that a word is, which is one.
    pub(crate) fn decode(&mut self, word: Ssa) -> Ssa {
        let bits = self.b.ins().rotr_imm_s(word, 3);
        let bias = self.word(Value::DOUBLE_BIAS);
        let bits = self.b.ins().isub(bits, bias);
        self.b.ins().bitcast(types::F64, MemFlagsData::new(), bits)
    }

    // What is kept back.

    /// Returns the registers that are kept back here: doubles, and such as may be.
    pub(crate) fn kept_back(&self) -> (RegisterBits, RegisterBits) {
        let (mut doubles, mut spent) = (RegisterBits::NONE, RegisterBits::NONE);
        for register in self.kept_back.iter() {
            match self.known[register] {
                Known::Double => doubles.insert(register),
                known => {
                    debug_assert_eq!(known, Known::Spent, "{register} at {}", self.at);
                    spent.insert(register);
                }
            }
        }
        (doubles, spent)
    }

    /// Writes what is kept back to the stack, on the way that control takes here only. The machine makes
    /// words of the doubles.
    pub(crate) fn write_back(&mut self, doubles: RegisterBits, spent: RegisterBits) {
        for register in doubles.iter() {
            let double = self.get_double(register as u8);
            self.write_raw(register, double);
        }
        for register in spent.iter() {
            let double = self.get_double(register as u8);
            self.write_spent(register, double);
        }
        self.name_raw(doubles);
    }

    fn write_raw(&mut self, register: usize, double: Ssa) {
        let base = self.base;
        self.store(double, base, register as i32 * WORD);
    }

    /// Tells the machine of which places it has to make words.
    fn name_raw(&mut self, doubles: RegisterBits) {
        for (index, word) in doubles.words().into_iter().enumerate().filter(|&(_, word)| word != 0) {
            let word = self.word(word);
            self.store_context(word, offset_of!(NativeContext, raw_doubles) + index * size_of::<u64>());
        }
    }

    fn write_spent(&mut self, register: usize, double: Ssa) {
        let (base, place) = (self.base, register as i32 * WORD);
        let there = self.load(base, place);
        let bits = self.bits_of(double);
        let is_in_place = self.equals(bits, IN_PLACE);
        let word = self.encode(double);
        let word = self.b.ins().select(is_in_place, there, word);
        self.store(word, base, place);
    }

    /// Puts back all that is kept back: what comes next looks at the stack.
    pub(crate) fn put_back(&mut self) {
        self.close_batch();
        let (doubles, spent) = self.kept_back();
        for register in doubles.iter() {
            self.make_word(register);
            let (word, base) = (self.word_of_double(register), self.base);
            self.store(word, base, register as i32 * WORD);
        }
        self.write_back(RegisterBits::NONE, spent);
        self.kept_back = RegisterBits::NONE;
    }

    /// Writes words that hold no address where doubles are kept back that nobody will read.
    pub(crate) fn clear_places(&mut self) {
        let (doubles, spent) = self.kept_back();
        let (zero, base) = (self.constant_value(Value::small(0)), self.base);
        for register in doubles.iter() {
            self.store(zero, base, register as i32 * WORD);
        }
        self.write_back(RegisterBits::NONE, spent);
    }

    // Ways from one instruction to another.

    /// Returns what has to be done on the way from here to the instruction at a word.
    pub(crate) fn edge_works(&self, to: usize) -> Vec<EdgeWork> {
        let kept_back_there = self.kinds.kept_back(to);
        let mut works = Vec::new();
        for (register, &said) in self.kinds.before(to).iter().enumerate() {
            let (known, is_kept_back) = (self.known[register], self.kept_back.contains(register));
            match (said, known) {
                (Known::Double | Known::Spent, Known::Double) | (Known::Spent, Known::Spent) => {
                    debug_assert!(
                        !is_kept_back || kept_back_there.contains(register),
                        "{register} from {} to {to}",
                        self.at
                    );
                }
                (Known::Spent, _) => {
                    if kept_back_there.contains(register) {
                        works.push(EdgeWork::Mark(register));
                    }
                }
                (Known::Nothing, Known::Double) if is_kept_back => works.push(EdgeWork::PutBack(register)),
                (Known::Nothing, Known::Double) => works.push(EdgeWork::Take(register)),
                (Known::Nothing, known) => {
                    debug_assert!(!is_kept_back, "{register}, {known:?}, from {} to {to}", self.at);
                }
                _ => debug_assert_eq!(said, known, "{register} from {} to {to}", self.at),
            }
        }
        works
    }

    pub(crate) fn do_edge_works(&mut self, works: &[EdgeWork]) {
        let base = self.base;
        for &work in works {
            match work {
                EdgeWork::Mark(register) => {
                    let mark = self.b.ins().f64const(f64::from_bits(IN_PLACE));
                    self.b.def_var(self.doubles[register], mark);
                }
                EdgeWork::PutBack(register) => {
                    let double = self.get_double(register as u8);
                    let word = self.encode(double);
                    self.store(word, base, register as i32 * WORD);
                    self.b.def_var(self.variables[register], word);
                }
                EdgeWork::Take(register) => {
                    let word = self.load(base, register as i32 * WORD);
                    self.b.def_var(self.variables[register], word);
                }
            }
        }
    }
}

/// The order of bytes is that of the halves of a vector.
fn little_endian() -> MemFlagsData {
    MemFlagsData::new().with_endianness(Endianness::Little)
}
