//! Doubles in registers of the processor: what is tested of results, and how they get to the stack.
//!
//! The result of an operation has to be a double without a box, else the interpreter does the operation. The
//! results of several operations in a row, none of which does anything else, are tested together: a *batch*.
//! Loads that give doubles, and small constants, may stand among them. If a result needs a box, or a load
//! gives something else, the machine code is left at the first operation, with the registers as they were
//! there.

use std::mem::offset_of;

use cranelift_codegen::ir::condcodes::{FloatCC, IntCC};
use cranelift_codegen::ir::{Block, Endianness, InstBuilder, MemFlagsData, Value as Ssa, types};
use esl_heap::Value;

use crate::abi::{GUESSED_WRONG, IN_PLACE, NativeContext};
use crate::emit::WORD;
use crate::kinds::Known;
use crate::places::RegisterBits;
use crate::translate::Translator;

/// The two lowest bits of the word of a double that needs no box and is not zero.
pub(crate) const TAG_DOUBLE: u64 = 3;

/// Makes bits 61 and 62 of such doubles zero, where their bias makes them ones.
const TESTING_BIAS: u64 = Value::DOUBLE_BIAS + (1 << 61);

/// Results that are tested together.
#[derive(Debug)]
pub(crate) struct DoubleBatch {
    /// Word of the first operation.
    at: usize,
    /// Registers that were unspilled there.
    unspilled: RegisterBits,
    /// Those that have been overwritten since.
    saved: Vec<(usize, Ssa)>,
    /// The results, and whether they may be zeros.
    results: Vec<(Ssa, bool)>,
    /// The bits that any of the results has with [`TESTING_BIAS`], in both halves of a vector.
    common: Option<Ssa>,
    /// Words that get to their places when the results have been tested.
    unwritten: Vec<(u8, Ssa)>,
    /// Blocks that leave at the first operation, with their statuses.
    side_exits: Vec<(u64, Block)>,
}

/// Work to be done where control goes to another instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum EdgeWork {
    /// The register is not unspilled: it gets the mark.
    Mark(usize),
    /// The double is spilled to its place, and the register is a word from there on.
    Spill(usize),
    /// The word is loaded from its place.
    Reload(usize),
}

impl Translator<'_, '_> {
    // Batches.

    /// Adds a result to the batch. The operation must have no other effect than that a register gets it.
    pub(crate) fn test_later(&mut self, double: Ssa, may_be_zero: bool) {
        let vector = self.b.ins().splat(types::F64X2, double);
        let vector = self.b.ins().bitcast(types::I64X2, little_endian(), vector);
        let mut bias = [0; 16];
        bias[..8].copy_from_slice(&TESTING_BIAS.to_le_bytes());
        let bias = self.b.func.dfg.constants.insert(bias.as_slice().into());
        let bias = self.b.ins().vconst(types::I64X2, bias);
        let biased = self.b.ins().iadd(vector, bias);
        let unspilled = self.unspilled;
        let batch = self.batch.get_or_insert(DoubleBatch {
            at: self.at,
            unspilled,
            saved: Vec::new(),
            results: Vec::new(),
            common: None,
            unwritten: Vec::new(),
            side_exits: Vec::new(),
        });
        batch.results.push((double, may_be_zero));
        batch.common = Some(match batch.common {
            Some(common) => self.b.ins().bor(common, biased),
            None => biased,
        });
    }

    /// Tests the results of the batch, if there is one.
    pub(crate) fn close_batch(&mut self) {
        self.close_batch_for(None);
    }

    /// As [`Translator::close_batch`], before an instruction that needs the word of a double: where it is a
    /// result of the batch, the test of the batch is that of its word.
    pub(crate) fn close_batch_for(&mut self, wanted: Option<u8>) {
        let Some(mut batch) = self.batch.take() else { return };
        let Some(common) = batch.common else { return };
        let wanted = wanted
            .filter(|&register| self.known[usize::from(register)] == Known::Double)
            .map(|register| (usize::from(register), self.get_double(register)))
            .filter(|&(register, double)| {
                self.words[register].is_none() && batch.results.iter().any(|&(result, _)| result == double)
            });
        let (next, again) = (self.block(), self.cold_block());
        let common = self.b.ins().bitcast(types::F64X2, little_endian(), common);
        let common = self.b.ins().extractlane(common, 0);
        let common = self.bits_of(common);
        match wanted {
            Some((register, double)) => {
                let word = self.b.append_block_param(next, types::I64);
                let rotated = match batch.results.as_slice() {
                    // The other bias has made the bits of the tag zero, and turned the sign above them.
                    [_] => {
                        let rotated = self.b.ins().rotl_imm_s(common, 3);
                        self.b.ins().bxor_imm_s(rotated, 7)
                    }
                    _ => {
                        let bits = self.bits_of(double);
                        self.rotated(bits)
                    }
                };
                let fails = self.is_no_word(common);
                self.b.ins().brif(fails, again, &[], next, &[rotated.into()]);
                self.words[register] = Some(word);
            }
            None => {
                let fails = self.is_no_word(common);
                self.branch(fails, again, next);
            }
        }

        self.go_to(again);
        let mut all = None;
        for &(double, may_be_zero) in &batch.results {
            let bits = self.bits_of(double);
            let rotated = self.rotated(bits);
            let mut test = self.is_word(rotated);
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
        if let Some(all) = all {
            let out = self.side_exit_of(&mut batch, GUESSED_WRONG);
            self.require(all, out);
        }
        match wanted {
            Some((_, double)) => {
                let word = self.encode(double);
                self.jump_with(next, word);
            }
            None => self.jump(next),
        }

        for (status, out) in std::mem::take(&mut batch.side_exits) {
            self.go_to(out);
            self.leave_batch(&batch, status);
        }
        self.go_to(next);
        let base = self.base;
        for (register, word) in batch.unwritten {
            self.store(word, base, i32::from(register) * WORD);
        }
    }

    /// Leaves at the first operation of a batch, with the registers as they were there.
    fn leave_batch(&mut self, batch: &DoubleBatch, status: u64) {
        for register in batch.unspilled.iter() {
            let saved = batch.saved.iter().find(|(saved, _)| *saved == register);
            let double = match saved {
                Some(&(_, double)) => double,
                None => self.get_double(register as u8),
            };
            self.save_double(register, double);
        }
        self.name_saved(batch.unspilled);
        self.leave_at(batch.at, status);
    }

    fn side_exit_of(&mut self, batch: &mut DoubleBatch, status: u64) -> Block {
        if let Some(&(_, block)) = batch.side_exits.iter().find(|&&(of, _)| of == status) {
            return block;
        }
        let block = self.cold_block();
        batch.side_exits.push((status, block));
        block
    }

    /// Returns the block that leaves at the instruction that is translated, or at the first one of the batch.
    /// Both read only.
    pub(crate) fn exit_of_batch(&mut self, status: u64) -> Block {
        let Some(mut batch) = self.batch.take() else { return self.side_exit(self.at, status) };
        let block = self.side_exit_of(&mut batch, status);
        self.batch = Some(batch);
        block
    }

    /// Writes a register, with the batch if there is one: then its place is written when that is tested.
    pub(crate) fn set_with_batch(&mut self, register: u8, value: Ssa, known: Known) {
        if self.batch.is_none() {
            return self.set(register, value, known);
        }
        debug_assert!(known != Known::Double && self.guess != Some(register), "{register} at {}", self.at);
        self.save_for_batch(usize::from(register));
        self.note(register, value, known);
        self.write_with_batch(register, Some(value));
    }

    /// Has the place of a register written when the batch is tested, or no more.
    pub(crate) fn write_with_batch(&mut self, register: u8, word: Option<Ssa>) {
        if let Some(batch) = &mut self.batch {
            batch.unwritten.retain(|&(unwritten, _)| unwritten != register);
            batch.unwritten.extend(word.map(|word| (register, word)));
        }
    }

    /// Notes what a register holds that is about to be overwritten, if the batch may have to put it back.
    pub(crate) fn save_for_batch(&mut self, register: usize) {
        let is_needed = self.batch.as_ref().is_some_and(|batch| {
            batch.unspilled.contains(register) && batch.saved.iter().all(|(saved, _)| *saved != register)
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

    /// Zero if these bits, with [`TESTING_BIAS`], are those of a double that is a word, or of several.
    fn is_no_word(&mut self, bits: Ssa) -> Ssa {
        let top = self.b.ins().ushr_imm_s(bits, 61);
        self.b.ins().band_imm_s(top, TAG_DOUBLE as i64)
    }

    /// Returns the word of a double that was tested.
    fn encode(&mut self, double: Ssa) -> Ssa {
        let bits = self.bits_of(double);
        let word = self.rotated(bits);
        let is_word = self.is_word(word);
        let zero = self.zero_of(bits);
        self.b.ins().select(is_word, word, zero)
    }

    /// Returns what the word of a double is, unless it is a zero.
    pub(crate) fn rotated(&mut self, bits: Ssa) -> Ssa {
        let biased = self.biased(bits);
        self.b.ins().rotl_imm_s(biased, 3)
    }

    pub(crate) fn is_word(&mut self, rotated: Ssa) -> Ssa {
        let difference = self.differs_from_tag(rotated, TAG_DOUBLE, TAG_DOUBLE);
        self.equals(difference, 0)
    }

    pub(crate) fn zero_of(&mut self, bits: Ssa) -> Ssa {
        let is_negative = self.b.ins().icmp_imm_s(IntCC::SignedLessThan, bits, 0);
        let negative = self.constant_value(Value::NEGATIVE_ZERO);
        let positive = self.constant_value(Value::POSITIVE_ZERO);
        self.b.ins().select(is_negative, negative, positive)
    }

    /// Returns the word of a double in a register. Cranelift drops it where it is not used.
    pub(crate) fn word_of_double(&mut self, register: usize) -> Ssa {
        if let Some(word) = self.words[register] {
            return word;
        }
        let double = self.get_double(register as u8);
        self.encode(double)
    }

    /// Makes the word of a double in a register that is needed on the fast path.
    pub(crate) fn make_word(&mut self, register: usize) {
        if self.known[register] != Known::Double || self.words[register].is_some() {
            return;
        }
        let double = self.get_double(register as u8);
        let (done, word) = self.block_with_value();
        let zeros = self.cold_block();
        let bits = self.bits_of(double);
        let rotated = self.rotated(bits);
        let difference = self.differs_from_tag(rotated, TAG_DOUBLE, TAG_DOUBLE);
        self.b.ins().brif(difference, zeros, &[], done, &[rotated.into()]);
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
        let difference = self.differs_from_tag(word, TAG_DOUBLE, TAG_DOUBLE);
        self.refuse(difference, others);
        let double = self.decode(word);
        self.jump_with(done, double);
        self.go_to(others);
        self.b.ins().band_imm_s(word, TAG_DOUBLE as i64)
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

    // Unspilled registers.

    /// Returns the unspilled registers: doubles, and those that are spent and may be doubles.
    pub(crate) fn unspilled_by_kind(&self) -> (RegisterBits, RegisterBits) {
        let (mut doubles, mut spent) = (RegisterBits::NONE, RegisterBits::NONE);
        for register in self.unspilled.iter() {
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

    /// Saves unspilled doubles in the context, on a path that leaves machine code. The machine spills them.
    pub(crate) fn save_unspilled(&mut self, unspilled: RegisterBits) {
        for register in unspilled.iter() {
            let double = self.get_double(register as u8);
            self.save_double(register, double);
        }
        self.name_saved(unspilled);
    }

    fn save_double(&mut self, register: usize, double: Ssa) {
        self.store_context(double, offset_of!(NativeContext, doubles) + register * size_of::<u64>());
    }

    /// Names to the machine the registers whose doubles have been saved.
    fn name_saved(&mut self, unspilled: RegisterBits) {
        if unspilled != RegisterBits::NONE {
            let outer = self.base;
            self.store_context(outer, offset_of!(NativeContext, outer));
        }
        for (index, word) in unspilled.words().into_iter().enumerate().filter(|&(_, word)| word != 0) {
            let word = self.word(word);
            self.store_context(word, offset_of!(NativeContext, unspilled) + index * size_of::<u64>());
        }
    }

    fn write_all_spent(&mut self, spent: RegisterBits) {
        for register in spent.iter() {
            let double = self.get_double(register as u8);
            self.write_spent(register, double);
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

    /// Spills all registers: the next instruction reads the stack.
    pub(crate) fn spill(&mut self) {
        self.spill_except(RegisterBits::NONE);
    }

    /// Spills all registers except the places of the link, which a call is going to write.
    pub(crate) fn spill_for_call(&mut self, window: u8) {
        let mut link = RegisterBits::NONE;
        link.insert_range(usize::from(window), 2);
        self.spill_except(link);
    }

    fn spill_except(&mut self, others: RegisterBits) {
        self.close_batch();
        let unspilled = self.unspilled;
        self.unspilled = unspilled.without(others);
        let (doubles, spent) = self.unspilled_by_kind();
        for register in doubles.iter() {
            self.make_word(register);
            let (word, base) = (self.word_of_double(register), self.base);
            self.store(word, base, register as i32 * WORD);
        }
        self.write_all_spent(spent);
        self.unspilled = unspilled.without(self.unspilled);
    }

    /// Writes words that hold no address to the places of unspilled doubles that will not be read, for some
    /// of the registers.
    pub(crate) fn clear_places(&mut self, registers: RegisterBits) {
        let (doubles, spent) = self.unspilled_by_kind();
        let (zero, base) = (self.constant_value(Value::small(0)), self.base);
        for register in doubles.within(registers).iter() {
            self.store(zero, base, register as i32 * WORD);
        }
        self.write_all_spent(spent.within(registers));
        self.unspilled = self.unspilled.without(registers);
    }

    // Edges from one instruction to another.

    /// Returns the work of the edge from here to the instruction at a word.
    pub(crate) fn edge_works(&self, to: usize) -> Vec<EdgeWork> {
        let unspilled_there = self.kinds.unspilled(to);
        let mut works = Vec::new();
        for (register, &said) in self.kinds.before(to).iter().enumerate() {
            let (known, is_unspilled) = (self.known[register], self.unspilled.contains(register));
            match (said, known) {
                (Known::Double | Known::Spent, Known::Double) | (Known::Spent, Known::Spent) => {
                    debug_assert!(
                        !is_unspilled || unspilled_there.contains(register),
                        "{register} from {} to {to}",
                        self.at
                    );
                }
                (Known::Spent, _) => {
                    if unspilled_there.contains(register) {
                        works.push(EdgeWork::Mark(register));
                    }
                }
                (Known::Nothing, Known::Double) if is_unspilled => works.push(EdgeWork::Spill(register)),
                (Known::Nothing, Known::Double) => works.push(EdgeWork::Reload(register)),
                (Known::Nothing, known) => {
                    debug_assert!(!is_unspilled, "{register}, {known:?}, from {} to {to}", self.at);
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
                EdgeWork::Spill(register) => {
                    let double = self.get_double(register as u8);
                    let word = self.encode(double);
                    self.store(word, base, register as i32 * WORD);
                    self.b.def_var(self.variables[register], word);
                }
                EdgeWork::Reload(register) => {
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
