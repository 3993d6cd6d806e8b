//! The pieces that translations are made of: registers, tests of tags, slow paths, exits.

use std::mem::offset_of;

use cranelift_codegen::ir::condcodes::IntCC;
use cranelift_codegen::ir::{Block, InstBuilder, MemFlagsData, Type, Value as Ssa, types};
use esl_heap::Value;
use esl_heap::heap::Kind;
use esl_heap::heap::layout::{Header, StructureObject};
use esl_heap::value::{TAG_CONS, TAG_MASK, TAG_OBJECT};

use crate::abi::{AGAIN, GUESSED_WRONG, NativeContext, SIGNAL, STEP_SIGNAL};
use crate::kinds::Known;
use crate::places::SideExit;
use crate::translate::Translator;

/// Bytes of a value.
pub(crate) const WORD: i32 = size_of::<Value>() as i32;

/// Offset of the first element behind a header.
pub(crate) const ELEMENTS: i32 = size_of::<Header>() as i32;

/// The bits in which the tags of the words that have addresses are the same, and no other tag.
const ADDRESS_MASK: u64 = 3;
const _: () = assert!(TAG_CONS & ADDRESS_MASK == TAG_OBJECT & ADDRESS_MASK);

/// From the value of an object to the byte `offset` of it.
pub(crate) const fn in_object(offset: usize) -> i32 {
    offset as i32 - TAG_OBJECT as i32
}

/// From the value of a pair to the byte `offset` of it.
pub(crate) const fn in_cons(offset: usize) -> i32 {
    offset as i32 - TAG_CONS as i32
}

/// Memory that is there and aligned, by what the verifier has proved or a test has shown.
pub(crate) fn memory() -> MemFlagsData {
    MemFlagsData::trusted()
}

impl Translator<'_, '_> {
    // Constants and memory.

    pub(crate) fn word(&mut self, word: u64) -> Ssa {
        self.b.ins().iconst(types::I64, word as i64)
    }

    pub(crate) fn constant_value(&mut self, value: Value) -> Ssa {
        self.word(value.bits())
    }

    pub(crate) fn load(&mut self, address: Ssa, offset: i32) -> Ssa {
        self.b.ins().load(types::I64, memory(), address, offset)
    }

    pub(crate) fn load_u32(&mut self, address: Ssa, offset: i32) -> Ssa {
        self.b.ins().uload32(memory(), address, offset)
    }

    pub(crate) fn store(&mut self, value: Ssa, address: Ssa, offset: i32) {
        self.b.ins().store(memory(), value, address, offset);
    }

    pub(crate) fn load_context(&mut self, offset: usize) -> Ssa {
        let context = self.context;
        self.load(context, offset as i32)
    }

    pub(crate) fn store_context(&mut self, value: Ssa, offset: usize) {
        let context = self.context;
        self.store(value, context, offset as i32);
    }

    /// Returns constant `index` of the function, as it is when the machine code runs.
    pub(crate) fn constant(&mut self, index: usize) -> Ssa {
        let address = self.word(self.frame.source.constants_at + (index * WORD as usize) as u64);
        self.load(address, 0)
    }

    // Registers of the frame.

    /// Returns the word that is the content of a register.
    pub(crate) fn get(&mut self, register: u8) -> Ssa {
        if self.known[usize::from(register)] == Known::Double {
            return self.word_of_double(usize::from(register));
        }
        let variable = self.variables[usize::from(register)];
        self.b.use_var(variable)
    }

    /// Writes a register: its place in the stack, and what later instructions read.
    pub(crate) fn set(&mut self, register: u8, value: Ssa, known: Known) {
        debug_assert!(self.batch.is_none() && known != Known::Double, "{} at {}", register, self.at);
        let base = self.base;
        self.store(value, base, i32::from(register) * WORD);
        self.note(register, value, known);
        if known == Known::Nothing {
            self.check_guess(register);
        }
    }

    /// Leaves the machine code behind the instruction if a register is guessed to hold a double, and holds
    /// something else.
    pub(crate) fn check_guess(&mut self, register: u8) {
        if self.guess == Some(register) {
            let (value, wrong) = (self.get(register), self.side_exit(self.next, GUESSED_WRONG));
            let double = self.double_of(value, wrong);
            self.note_double(register, double);
            self.words[usize::from(register)] = Some(value);
        }
    }

    /// Writes a register, and keeps the double back: its place in the stack is not written.
    pub(crate) fn set_double(&mut self, register: u8, double: Ssa) {
        self.note_double(register, double);
        self.unspilled.insert(usize::from(register));
    }

    /// As [`Translator::set_double`], for a double of which the word is at hand.
    pub(crate) fn set_double_of(&mut self, register: u8, double: Ssa, word: Ssa) {
        self.set_double(register, double);
        self.words[usize::from(register)] = Some(word);
    }

    /// Notes that a register has a double in its place already.
    fn note_double(&mut self, register: u8, double: Ssa) {
        self.write_with_batch(register, None);
        let (register, variable) = (usize::from(register), self.doubles[usize::from(register)]);
        self.save_for_batch(register);
        self.unspilled.remove(register);
        self.words[register] = None;
        self.known[register] = Known::Double;
        self.b.def_var(variable, double);
    }

    /// Returns the double in a register that is known to be one.
    pub(crate) fn get_double(&mut self, register: u8) -> Ssa {
        let variable = self.doubles[usize::from(register)];
        self.b.use_var(variable)
    }

    /// Notes what is in the place of a register already.
    pub(crate) fn note(&mut self, register: u8, value: Ssa, known: Known) {
        let variable = self.variables[usize::from(register)];
        self.b.def_var(variable, value);
        self.known[usize::from(register)] = known;
        self.unspilled.remove(usize::from(register));
        self.words[usize::from(register)] = None;
    }

    /// Takes registers from the stack, after a function of the machine has written them.
    pub(crate) fn reload(&mut self, first: u8, count: u8) {
        for register in first..first.saturating_add(count) {
            if usize::from(register) < self.variables.len() {
                let base = self.base;
                let value = self.load(base, i32::from(register) * WORD);
                self.note(register, value, Known::Nothing);
            }
        }
    }

    // Blocks.

    pub(crate) fn block(&mut self) -> Block {
        self.b.create_block()
    }

    pub(crate) fn block_with_value(&mut self) -> (Block, Ssa) {
        self.block_with(types::I64)
    }

    pub(crate) fn block_with(&mut self, kind: Type) -> (Block, Ssa) {
        let block = self.b.create_block();
        let value = self.b.append_block_param(block, kind);
        (block, value)
    }

    pub(crate) fn cold_block(&mut self) -> Block {
        let block = self.b.create_block();
        self.b.set_cold_block(block);
        block
    }

    /// Goes on in a block to which nothing jumps that is still to come.
    pub(crate) fn go_to(&mut self, block: Block) {
        self.b.switch_to_block(block);
        self.b.seal_block(block);
    }

    pub(crate) fn jump(&mut self, block: Block) {
        self.b.ins().jump(block, &[]);
    }

    pub(crate) fn jump_with(&mut self, block: Block, value: Ssa) {
        self.b.ins().jump(block, &[value.into()]);
    }

    pub(crate) fn branch(&mut self, test: Ssa, then: Block, otherwise: Block) {
        self.b.ins().brif(test, then, &[], otherwise, &[]);
    }

    /// Goes on only if `test` is not zero, else with `otherwise`.
    pub(crate) fn require(&mut self, test: Ssa, otherwise: Block) {
        let next = self.block();
        self.branch(test, next, otherwise);
        self.go_to(next);
    }

    /// Goes on only if `test` is zero, else with `otherwise`.
    pub(crate) fn refuse(&mut self, test: Ssa, otherwise: Block) {
        let next = self.block();
        self.branch(test, otherwise, next);
        self.go_to(next);
    }

    // Tests.

    pub(crate) fn equals(&mut self, value: Ssa, word: u64) -> Ssa {
        self.b.ins().icmp_imm_s(IntCC::Equal, value, word as i64)
    }

    /// Returns the sum of a fixnum and a constant one, and whether it is none.
    pub(crate) fn add_constant(&mut self, x: Ssa, addend: i32) -> (Ssa, Ssa) {
        let sum = self.b.ins().iadd_imm_s(x, Value::small(addend).bits() as i64);
        let beyond = if addend < 0 { IntCC::SignedGreaterThan } else { IntCC::SignedLessThan };
        (sum, self.b.ins().icmp(beyond, sum, x))
    }

    /// Not zero unless both are fixnums. `None` if that is known.
    pub(crate) fn not_fixnums(&mut self, x: (Ssa, Known), y: (Ssa, Known)) -> Option<Ssa> {
        let both = match (x.1 == Known::Fixnum, y.1 == Known::Fixnum) {
            (true, true) => return None,
            (true, false) => y.0,
            (false, true) => x.0,
            (false, false) => self.b.ins().bor(x.0, y.0),
        };
        Some(self.b.ins().band_imm_s(both, 3))
    }

    /// Zero if the bits of `mask` in a word are those of a tag.
    pub(crate) fn differs_from_tag(&mut self, value: Ssa, tag: u64, mask: u64) -> Ssa {
        let difference = self.b.ins().iadd_imm_s(value, -(tag as i64));
        self.b.ins().band_imm_s(difference, mask as i64)
    }

    pub(crate) fn is_cons(&mut self, value: Ssa) -> Ssa {
        let difference = self.differs_from_tag(value, TAG_CONS, TAG_MASK);
        self.equals(difference, 0)
    }

    pub(crate) fn is_object(&mut self, value: Ssa) -> Ssa {
        let difference = self.differs_from_tag(value, TAG_OBJECT, TAG_MASK);
        self.equals(difference, 0)
    }

    pub(crate) fn is_character(&mut self, value: Ssa) -> Ssa {
        const MARK: u64 = match Value::character(0) {
            Some(value) => value.bits(),
            None => 0,
        };
        let low = self.b.ins().band_imm_s(value, 0xff);
        self.equals(low, MARK)
    }

    /// Goes on only if `value` is an object of a kind.
    pub(crate) fn require_kind(&mut self, value: Ssa, kind: Kind, otherwise: Block) {
        let is_object = self.is_object(value);
        self.require(is_object, otherwise);
        let found = self.b.ins().uload8(types::I64, memory(), value, in_object(offset_of!(Header, kind)));
        let is_kind = self.equals(found, kind as u64);
        self.require(is_kind, otherwise);
    }

    /// Goes on only if `value` is an instance of just the class that is a constant.
    pub(crate) fn require_class(&mut self, value: Ssa, class: usize, otherwise: Block) {
        self.require_kind(value, Kind::Structure, otherwise);
        let class = self.constant(class);
        let found = self.load(value, in_object(offset_of!(StructureObject, class)));
        let is_same = self.b.ins().icmp(IntCC::Equal, found, class);
        self.require(is_same, otherwise);
    }

    /// Returns the number of elements of an object.
    pub(crate) fn length(&mut self, object: Ssa) -> Ssa {
        self.load_u32(object, in_object(offset_of!(Header, len)))
    }

    /// Overwrites a slot at an address: with the machine's help while objects are marked.
    pub(crate) fn store_slot(&mut self, value: Ssa, address: Ssa, offset: i32) {
        let (context, done, plain, marked) = (self.context, self.block(), self.block(), self.cold_block());
        let is_marking = self.load_u32(context, offset_of!(NativeContext, is_marking) as i32);
        self.branch(is_marking, marked, plain);
        self.go_to(marked);
        let helper = self.load_context(offset_of!(NativeContext, store));
        let place = self.b.ins().iadd_imm_s(address, i64::from(offset));
        self.b.ins().call_indirect(self.store_signature, helper, &[context, place, value]);
        self.jump(done);
        self.go_to(plain);
        self.store(value, address, offset);
        self.jump(done);
        self.go_to(done);
    }

    /// As [`Translator::store_slot`], of a double. While objects are marked, only a slot that holds an
    /// address needs the machine's help: there the machine code is left, so that nothing is called in a loop
    /// whose doubles are in registers of the processor.
    pub(crate) fn store_double_in_slot(&mut self, word: Ssa, address: Ssa, offset: i32) {
        let (context, exit) = (self.context, self.exit());
        let (plain, marked) = (self.block(), self.cold_block());
        let is_marking = self.load_u32(context, offset_of!(NativeContext, is_marking) as i32);
        self.branch(is_marking, marked, plain);
        self.go_to(marked);
        let old = self.load(address, offset);
        let without_address = self.differs_from_tag(old, TAG_CONS, ADDRESS_MASK);
        self.branch(without_address, plain, exit);
        self.go_to(plain);
        self.store(word, address, offset);
    }

    // Slow paths and exits.

    /// Returns the address of a word of the bytecode.
    pub(crate) fn pc(&mut self, at: usize) -> Ssa {
        let frame = &self.flow.frames[self.flow.frame_at(at)];
        self.word(frame.source.words_at + 4 * (at - frame.first) as u64)
    }

    /// Returns the base of the frame in which a word of the bytecode runs.
    pub(crate) fn base_at(&mut self, at: usize) -> Ssa {
        let (base, registers) = (self.base, self.flow.frames[self.flow.frame_at(at)].base);
        if registers == 0 {
            return base;
        }
        self.b.ins().iadd_imm_s(base, i64::from(registers) * i64::from(WORD))
    }

    /// Has a function of the machine do the instruction, and returns what it says.
    ///
    /// Unspilled registers are saved first, on this path only.
    pub(crate) fn call_helper(&mut self, helper: usize) -> Ssa {
        debug_assert!(self.batch.is_none(), "{}", self.at);
        self.save_unspilled(self.unspilled);
        let (context, base, pc) = (self.context, self.base_at(self.at), self.pc(self.at));
        let helper = self.load_context(helper);
        let call = self.b.ins().call_indirect(self.helper_signature, helper, &[context, pc, base]);
        self.b.inst_results(call)[0]
    }

    /// Has the machine do the instruction; goes on if it has no jump to make.
    pub(crate) fn step(&mut self) {
        let outcome = self.call_helper(offset_of!(NativeContext, step));
        let signal = self.signal();
        self.refuse(outcome, signal);
    }

    /// Has the machine do a test, then goes to one of two blocks. The machine's work may be charged, so on a
    /// short path, which is begun again, the machine code is left in its place.
    pub(crate) fn step_test(&mut self, jump: Block, next: Block) {
        if self.frame.is_begun_again() {
            let exit = self.exit();
            return self.jump(exit);
        }
        let outcome = self.call_helper(offset_of!(NativeContext, step));
        let signal = self.signal();
        let is_signal = self.equals(outcome, STEP_SIGNAL);
        self.refuse(is_signal, signal);
        self.branch(outcome, jump, next);
    }

    /// Ends the fast paths of an instruction with a result, which `done` takes; `slow` leads to the machine.
    /// If it is to be a fixnum, and what the machine makes is none, the machine code is left behind the
    /// instruction.
    pub(crate) fn finish_value(&mut self, slow: Block, done: (Block, Ssa), dst: u8, known: Known) {
        self.go_to(slow);
        self.step();
        let base = self.base;
        let value = self.load(base, i32::from(dst) * WORD);
        if known == Known::Fixnum {
            let exit = self.exit_at(self.next);
            let tag = self.b.ins().band_imm_s(value, 3);
            self.refuse(tag, exit);
        }
        self.jump_with(done.0, value);
        self.go_to(done.0);
        self.set(dst, done.1, known);
    }

    /// As [`Translator::finish_value`] when the fast path goes on here with `value`.
    pub(crate) fn finish_with(&mut self, slow: Block, value: Ssa, dst: u8) {
        self.finish_as(slow, value, dst, Known::Nothing);
    }

    /// As [`Translator::finish_with`], for a value of which something is known.
    pub(crate) fn finish_as(&mut self, slow: Block, value: Ssa, dst: u8, known: Known) {
        let done = self.block_with_value();
        self.jump_with(done.0, value);
        self.finish_value(slow, done, dst, known);
    }

    /// Ends the fast path of an instruction without a result.
    pub(crate) fn finish_effect(&mut self, slow: Block) {
        let done = self.block();
        self.jump(done);
        self.go_to(slow);
        self.step();
        self.jump(done);
        self.go_to(done);
    }

    /// Returns the block that leaves at the instruction that is translated.
    pub(crate) fn exit(&mut self) -> Block {
        self.exit_at(self.at)
    }

    /// Returns the block that leaves at the instruction at a word.
    pub(crate) fn exit_at(&mut self, at: usize) -> Block {
        self.side_exit(at, AGAIN)
    }

    /// Returns the block that leaves at the instruction that is translated, since what was taken for a double
    /// is none.
    pub(crate) fn wrong(&mut self) -> Block {
        self.side_exit(self.at, GUESSED_WRONG)
    }

    /// Returns the block that saves unspilled doubles, and leaves at the instruction at a word.
    pub(crate) fn side_exit(&mut self, at: usize, status: u64) -> Block {
        debug_assert!(self.batch.is_none(), "{at}");
        let exit = SideExit { at, status, unspilled: self.unspilled };
        if let Some(&block) = self.side_exits.get(&exit) {
            return block;
        }
        let block = self.cold_block();
        self.side_exits.insert(exit, block);
        block
    }

    /// Returns the block that leaves with a signal.
    pub(crate) fn signal(&mut self) -> Block {
        if let Some(block) = self.signal {
            return block;
        }
        let block = self.cold_block();
        self.signal = Some(block);
        block
    }

    /// Writes the blocks that leave.
    pub(crate) fn emit_exits(&mut self) {
        for (exit, block) in std::mem::take(&mut self.side_exits) {
            self.go_to(block);
            self.save_unspilled(exit.unspilled);
            self.leave_at(exit.at, exit.status);
        }
        if let Some(block) = self.signal.take() {
            self.go_to(block);
            self.reply(SIGNAL);
        }
    }

    /// Leaves at the instruction at a word.
    pub(crate) fn leave_at(&mut self, at: usize, status: u64) {
        let (pc, base, outer) = (self.pc(at), self.base_at(at), self.base);
        self.store_context(pc, offset_of!(NativeContext, pc));
        self.store_context(base, offset_of!(NativeContext, base));
        self.store_context(outer, offset_of!(NativeContext, outer));
        self.reply(status);
    }

    /// Returns from the machine code with a status.
    pub(crate) fn reply(&mut self, status: u64) {
        let zero = self.word(0);
        self.reply_with(status, zero);
    }

    pub(crate) fn reply_with(&mut self, status: u64, value: Ssa) {
        let status = self.word(status);
        self.b.ins().return_(&[status, value]);
    }
}
