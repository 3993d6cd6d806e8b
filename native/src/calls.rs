//! Calls, returns and ticks.

use std::mem::offset_of;

use cranelift_codegen::ir::condcodes::{FloatCC, IntCC};
use cranelift_codegen::ir::{Block, InstBuilder, Value as Ssa, types};
use esl_bytecode::operand::Want;
use esl_heap::heap::Kind;
use esl_heap::heap::layout::{CodeObject, FunctionObject, SymbolObject};

use crate::abi::{
    CALL_AGAIN, CALL_DONE, CALL_SIGNAL, EntryStub, NativeContext, RETURN_VALUES, RETURNED, STEP_SIGNAL, TAIL,
};
use crate::emit::{WORD, in_object, memory};
use crate::kinds::Known;
use crate::places::RegisterBits;
use crate::translate::Translator;

/// Where the link of a frame has its function, from the frame's base on.
const FUNCTION: i32 = -2 * WORD;

/// The outcome of a call in place of the running function.
pub(crate) struct Replaced {
    /// Address of the machine code whose frame it is now.
    pub(crate) address: Ssa,
    /// Where a builtin goes on that was called, with its only value in the context.
    pub(crate) one: Block,
    /// Where a builtin goes on that was called, with its values in the value list.
    pub(crate) more: Block,
}

impl Translator<'_, '_> {
    /// Takes a tick, or leaves at this instruction if there is none.
    pub(crate) fn tick(&mut self) {
        let (context, exit) = (self.context, self.exit());
        let offset = offset_of!(NativeContext, ticks) as i32;
        let ticks = self.b.ins().load(types::I32, memory(), context, offset);
        let is_spent = self.b.ins().icmp_imm_s(IntCC::SignedLessThanOrEqual, ticks, 0);
        self.refuse(is_spent, exit);
        let left = self.b.ins().iadd_imm_s(ticks, -1);
        self.b.ins().store(memory(), left, context, offset);
    }

    /// Returns the function of the symbol that is a constant.
    pub(crate) fn global(&mut self, symbol: u32) -> Ssa {
        let symbol = self.constant(symbol as usize);
        self.load(symbol, in_object(offset_of!(SymbolObject, function)))
    }

    /// Returns the running function.
    pub(crate) fn running(&mut self) -> Ssa {
        let (base, place) = (self.base, self.place(0) + FUNCTION);
        self.load(base, place)
    }

    /// Returns where a register of the running frame is, from the frame of the function itself on.
    fn place(&self, register: u8) -> i32 {
        (i32::from(self.frame.base) + i32::from(register)) * WORD
    }

    /// Goes on only if `function`, a Function, takes exactly `count` arguments; leaves at this instruction
    /// unless it has machine code, of which the address is returned, and room from `base` on.
    fn callee(&mut self, function: Ssa, count: u8, base: Ssa, otherwise: Block) -> Ssa {
        let exit = self.exit();
        let code = self.load(function, in_object(offset_of!(FunctionObject, code)));
        let arity = self.load_u32(code, in_object(offset_of!(CodeObject, arity)));
        let takes_them = self.equals(arity, u64::from(count));
        self.require(takes_them, otherwise);
        let entry = self.load(code, in_object(offset_of!(CodeObject, entry)));
        let word = self.load_u32(entry, offset_of!(EntryStub, word) as i32);
        let is_native = self.equals(word, u64::from(self.source.entry_word));
        self.require(is_native, exit);
        let address = self.load(entry, offset_of!(EntryStub, address) as i32);
        let registers = self.load_u32(code, in_object(offset_of!(CodeObject, nregs)));
        self.require_room(base, registers);
        address
    }

    /// Has the machine do what is left of a call whose callee does not take exactly the given arguments;
    /// leaves at this instruction if that is not done. Returns the address of the callee's machine code; goes
    /// on in `called`, with what the machine says of the call, if it was a builtin.
    fn other_callee(&mut self, helper: usize, called: Block) -> Ssa {
        let (exit, signal, (few, next)) = (self.exit(), self.signal(), (self.cold_block(), self.block()));
        let outcome = self.call_helper(helper);
        let is_address = self.b.ins().icmp_imm_u(IntCC::UnsignedGreaterThan, outcome, CALL_SIGNAL as i64);
        self.branch(is_address, next, few);
        self.go_to(few);
        let is_given_up = self.equals(outcome, CALL_AGAIN);
        self.refuse(is_given_up, exit);
        let is_signal = self.equals(outcome, CALL_SIGNAL);
        self.refuse(is_signal, signal);
        self.jump_with(called, outcome);
        self.go_to(next);
        outcome
    }

    /// Leaves at this instruction unless there is room for so many registers from `base` on.
    fn require_room(&mut self, base: Ssa, registers: Ssa) {
        let bytes = self.b.ins().ishl_imm_s(registers, 3);
        let top = self.b.ins().iadd(base, bytes);
        self.require_room_below(top);
    }

    /// Leaves at this instruction unless there is room below `top`.
    pub(crate) fn require_room_below(&mut self, top: Ssa) {
        let exit = self.exit();
        let limit = self.load_context(offset_of!(NativeContext, limit));
        let fits = self.b.ins().icmp(IntCC::UnsignedLessThanOrEqual, top, limit);
        self.require(fits, exit);
    }

    pub(crate) fn call_global(&mut self, window: u8, count: u8, want: Want, symbol: u32, next: usize) {
        self.spill_for_call(window);
        let function = self.global(symbol);
        self.call((window, count, want), function, next);
    }

    pub(crate) fn call_given(&mut self, window: u8, count: u8, want: Want, next: usize) {
        self.spill_for_call(window);
        let (function, exit) = (self.get(window), self.exit());
        self.require_kind(function, Kind::Function, exit);
        self.call((window, count, want), function, next);
    }

    pub(crate) fn call_self(&mut self, window: u8, want: Want, next: usize) {
        self.spill_for_call(window);
        let (function, frame) = (self.running(), self.frame_in(window));
        let registers = self.word(self.source.function.registers as u64);
        self.require_room(frame, registers);
        self.tick();
        self.link(window, function, next);
        let (itself, pointer) = (self.itself, self.pointer);
        let address = self.b.ins().func_addr(pointer, itself);
        let value = self.invoke(window, frame, address, true, want);
        self.note_values(window, value, want);
    }

    /// Makes the frame of a function in the window, and calls it.
    fn call(&mut self, (window, count, want): (u8, u8, Want), function: Ssa, next: usize) {
        let (frame, others, (ready, address)) =
            (self.frame_in(window), self.cold_block(), self.block_with_value());
        let ((called, _), (done, value)) = (self.block_with_value(), self.block_with_value());
        self.b.set_cold_block(called);
        let of_exact = self.callee(function, count, frame, others);
        self.jump_with(ready, of_exact);
        self.go_to(others);
        let of_others = self.other_callee(offset_of!(NativeContext, call_other), called);
        self.jump_with(ready, of_others);
        self.go_to(called);
        let first = self.load(self.base, i32::from(window) * WORD);
        self.jump_with(done, first);
        self.go_to(ready);
        self.tick();
        self.link(window, function, next);
        let first = self.invoke(window, frame, address, false, want);
        self.jump_with(done, first);
        self.go_to(done);
        self.note_values(window, value, want);
    }

    /// Notes what a call has returned, of which `value` is the first.
    fn note_values(&mut self, window: u8, value: Ssa, want: Want) {
        if want == Want::ONE {
            return self.set(window, value, Known::Nothing);
        }
        self.reload(window, want.registers());
    }

    /// Returns the base of the frame of a call with this window.
    fn frame_in(&mut self, window: u8) -> Ssa {
        let base = self.base;
        self.b.ins().iadd_imm_s(base, i64::from(window) * i64::from(WORD) + 2 * i64::from(WORD))
    }

    /// Writes the link of a frame.
    pub(crate) fn link(&mut self, window: u8, function: Ssa, next: usize) {
        let (base, place, return_to) = (self.base, i32::from(window) * WORD, self.pc(next));
        self.store(function, base, place);
        self.store(return_to, base, place + WORD);
        let mut link = RegisterBits::NONE;
        link.insert_range(usize::from(window), 2);
        self.unspilled = self.unspilled.without(link);
    }

    /// Calls machine code in a frame that has been made, directly if it is that of the function itself, and
    /// returns its value. Tail calls are followed. Other numbers of values than one go to the window.
    pub(crate) fn invoke(&mut self, window: u8, frame: Ssa, given: Ssa, is_itself: bool, want: Want) -> Ssa {
        let (context, base, first) = (self.context, self.base, self.word(0));
        let (again, address) = self.block_with_value();
        let (done, value) = self.block_with_value();
        let (returned, only) = self.block_with_value();
        let other = self.cold_block();
        let status_of_other = self.b.append_block_param(other, types::I64);
        let value_of_other = self.b.append_block_param(other, types::I64);
        let results = |this: &mut Self, call| {
            let results = this.b.inst_results(call);
            let (status, value) = (results[0], results[1]);
            this.b.ins().brif(status, other, &[status.into(), value.into()], returned, &[value.into()]);
        };
        if is_itself {
            let call = self.b.ins().call(self.itself, &[context, frame, first]);
            results(self, call);
            self.b.set_cold_block(again);
        } else {
            self.jump_with(again, given);
        }
        self.b.switch_to_block(again);
        let call = self.b.ins().call_indirect(self.entry_signature, address, &[context, frame, first]);
        results(self, call);

        self.go_to(returned);
        if want == Want::ONE {
            self.jump_with(done, only);
        } else {
            self.store_context(only, offset_of!(NativeContext, value));
            self.store_context(frame, offset_of!(NativeContext, base));
            self.call_helper(offset_of!(NativeContext, only_value));
            let first = self.load(base, i32::from(window) * WORD);
            self.jump_with(done, first);
        }

        self.go_to(other);
        let (further, values, leave) = (self.cold_block(), self.cold_block(), self.cold_block());
        let is_tail = self.equals(status_of_other, TAIL);
        self.b.ins().brif(is_tail, again, &[value_of_other.into()], further, &[]);
        self.go_to(further);
        let is_values = self.equals(status_of_other, RETURN_VALUES);
        self.branch(is_values, values, leave);
        self.go_to(leave);
        self.b.ins().return_(&[status_of_other, value_of_other]);
        self.go_to(values);
        self.call_helper(offset_of!(NativeContext, all_values));
        let first = self.load(base, i32::from(window) * WORD);
        self.jump_with(done, first);
        self.go_to(done);
        value
    }

    pub(crate) fn tail_call_global(&mut self, window: u8, count: u8, symbol: u32) {
        self.spill();
        let function = self.global(symbol);
        self.tail_call(window, count, function);
    }

    pub(crate) fn tail_call_given(&mut self, window: u8, count: u8) {
        self.spill();
        let (function, exit) = (self.get(window), self.exit());
        self.require_kind(function, Kind::Function, exit);
        self.tail_call(window, count, function);
    }

    fn tail_call(&mut self, window: u8, count: u8, function: Ssa) {
        let Replaced { address, one, more } = self.replace_frame(window, count, function);
        self.reply_with(TAIL, address);
        self.go_to(one);
        let value = self.load_context(offset_of!(NativeContext, value));
        self.reply_with(RETURNED, value);
        self.go_to(more);
        self.return_values();
    }

    /// Puts the frame of a callee in place of the running one, or calls it if it is a builtin.
    pub(crate) fn replace_frame(&mut self, window: u8, count: u8, function: Ssa) -> Replaced {
        let (outer, base, others) = (self.base, self.base_at(self.at), self.cold_block());
        let (ready, address) = self.block_with_value();
        let ((called, outcome), one, more) = (self.block_with_value(), self.cold_block(), self.cold_block());
        self.b.set_cold_block(called);
        let of_exact = self.callee(function, count, base, others);
        self.tick();
        let arguments: Vec<Ssa> = (0..count).map(|i| self.get(window + 2 + i)).collect();
        for (i, argument) in arguments.into_iter().enumerate() {
            self.store(argument, outer, self.place(i as u8));
        }
        self.jump_with(ready, of_exact);
        self.go_to(others);
        let of_others = self.other_callee(offset_of!(NativeContext, tail_call_other), called);
        self.tick();
        self.jump_with(ready, of_others);
        self.go_to(called);
        let is_one = self.equals(outcome, CALL_DONE);
        self.branch(is_one, one, more);
        self.go_to(ready);
        self.store(function, outer, self.place(0) + FUNCTION);
        Replaced { address, one, more }
    }

    /// The square root of a double.
    pub(crate) fn root(&mut self, window: u8) {
        let (double, exit) = (self.get_double(window + 2), self.exit());
        let zero = self.b.ins().f64const(0.0);
        let has_root = self.b.ins().fcmp(FloatCC::GreaterThanOrEqual, double, zero);
        self.require(has_root, exit);
        self.tick();
        let root = self.b.ins().sqrt(double);
        self.set_double(window, root);
    }

    /// Has the machine call the builtin of this instruction. Returns its first value.
    pub(crate) fn value_of_builtin(&mut self, window: u8) -> Ssa {
        let outcome = self.call_helper(offset_of!(NativeContext, call_builtin));
        let signal = self.signal();
        self.refuse(outcome, signal);
        self.load(self.base, i32::from(window) * WORD)
    }

    pub(crate) fn call_builtin(&mut self, window: u8, want: Want) {
        self.spill();
        self.tick();
        let outcome = self.call_helper(offset_of!(NativeContext, call_builtin));
        let signal = self.signal();
        self.refuse(outcome, signal);
        self.reload(window, want.registers());
        self.check_guess(window);
    }

    pub(crate) fn tail_call_builtin(&mut self) {
        let more = self.builtin_in_place();
        let value = self.load_context(offset_of!(NativeContext, value));
        self.reply_with(RETURNED, value);
        self.go_to(more);
        self.return_values();
    }

    /// Calls a builtin in place of the running function, and goes on with its value in the context. Returns
    /// the block in which it has left others in the value list.
    pub(crate) fn builtin_in_place(&mut self) -> Block {
        self.spill();
        self.tick();
        let outcome = self.call_helper(offset_of!(NativeContext, tail_builtin));
        let (signal, one, more) = (self.signal(), self.block(), self.cold_block());
        let is_signal = self.equals(outcome, STEP_SIGNAL);
        self.refuse(is_signal, signal);
        self.branch(outcome, more, one);
        self.go_to(one);
        more
    }

    pub(crate) fn return_value(&mut self, register: u8) {
        self.make_word(usize::from(register));
        let value = self.get(register);
        self.clear_places(RegisterBits::all_from(0));
        self.reply_with(RETURNED, value);
        self.ended();
    }

    /// Returns the value list.
    pub(crate) fn return_values(&mut self) {
        self.spill();
        let base = self.base;
        self.store_context(base, offset_of!(NativeContext, base));
        self.reply(RETURN_VALUES);
        self.ended();
    }

    /// Leaves at this instruction whatever happens.
    pub(crate) fn leave(&mut self) {
        let exit: Block = self.exit();
        self.jump(exit);
        self.ended();
    }
}
