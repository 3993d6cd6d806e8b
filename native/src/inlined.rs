//! Calls of functions that are inlined, and the returns from them (N8).
//!
//! The frame of an inlined function is that of a call: its link is written, and its registers have their
//! places above those of the caller, where the arguments are. So a side exit within it leaves everything as
//! if it had been called.

use std::mem::offset_of;

use cranelift_codegen::ir::{Block, InstBuilder, Value as Ssa};
use esl_bytecode::opcode::Instr;
use esl_bytecode::operand::Want;
use esl_heap::Value;
use esl_heap::heap::Kind;

use crate::abi::{NativeContext, REDEFINED};
use crate::calls::Replaced;
use crate::emit::WORD;
use crate::flow::FlowStep;
use crate::kinds::{Known, dropped, returned};
use crate::places::RegisterBits;
use crate::translate::Translator;

impl Translator<'_, '_> {
    /// Makes the frame of an inlined function, and goes on with its first instruction.
    pub(crate) fn enter_inlined(&mut self, window: u8, count: u8, step: &FlowStep) {
        let callee = step.target.map(|first| self.flow.frames[self.flow.frame_at(first)]);
        let Some(callee) = callee else { return };
        let function = match (step.instr, callee.guard) {
            (Instr::CallGlobal { symbol, .. }, Some(guard)) => {
                let function = self.global(symbol.0);
                let (is_same, redefined) =
                    (self.equals(function, guard.bits()), self.side_exit(self.at, REDEFINED));
                self.require(is_same, redefined);
                function
            }
            _ => self.running(),
        };
        let registers = i64::from(callee.base) + callee.source.registers as i64;
        let top = self.b.ins().iadd_imm_s(self.base, registers * i64::from(WORD));
        self.require_room_below(top);
        self.tick();

        let dropped = dropped(window, count);
        let mut above = dropped;
        above.remove_range(usize::from(window), 2);
        self.clear_places(above);
        self.forget(dropped);
        self.link(window, function, step.next);
        for missing in 0..callee.unsupplied {
            let unsupplied = self.constant_value(Value::UNSUPPLIED);
            self.set(window + 2 + count + missing, unsupplied, Known::Nothing);
        }
        let target = self.target(step);
        self.jump(target);
        self.ended();
    }

    /// Goes on behind the call of an inlined function, with the value in a register of the caller.
    pub(crate) fn leave_inlined(&mut self, to: u8, step: &FlowStep) {
        let above = RegisterBits::all_from(to);
        match step.instr {
            Instr::TailCallBuiltin { .. } => {
                let more = self.builtin_in_place();
                let (done, value) = self.block_with_value();
                let first = self.load_context(offset_of!(NativeContext, value));
                self.jump_with(done, first);
                self.go_to(more);
                self.first_of_values(to, done);
                self.go_to(done);
                self.forget(above);
                self.set(to, value, Known::Nothing);
            }
            Instr::TailCallGlobal { window, count, symbol } => {
                self.spill();
                let function = self.global(symbol.0);
                self.call_in_place(window.0, count.0, function, to);
            }
            Instr::TailCall { window, count, .. } => {
                self.spill();
                let (function, exit) = (self.get(window.0), self.exit());
                self.require_kind(function, Kind::Function, exit);
                self.call_in_place(window.0, count.0, function, to);
            }
            instr => match returned(&instr) {
                Some(register) if self.known[usize::from(register)] == Known::Double => {
                    let (double, word) = (self.get_double(register), self.words[usize::from(register)]);
                    self.clear_places(above);
                    self.forget(above);
                    self.set_double(to, double);
                    self.words[usize::from(to)] = word;
                }
                Some(register) => {
                    let (value, known) = self.operand(register);
                    self.clear_places(above);
                    self.forget(above);
                    self.set(to, value, known);
                }
                None => {
                    if let Instr::ReturnValues { .. } = instr {
                        self.step();
                    }
                    self.spill();
                    self.deliver_values();
                    self.forget(above);
                    self.reload(to, 1);
                    self.check_guess(to);
                }
            },
        }
        let target = self.target(step);
        self.jump(target);
        self.ended();
    }

    /// Calls the running function, of which the short paths are inlined, in the frame that has been made for
    /// it, and goes on behind its call.
    pub(crate) fn call_whole(&mut self, to: u8, step: &FlowStep) {
        self.spill();
        let (frame, itself, pointer) = (self.base_at(self.at), self.itself, self.pointer);
        let address = self.b.ins().func_addr(pointer, itself);
        let value = self.invoke(to, frame, address, true, Want::ONE);
        self.forget(RegisterBits::all_from(to));
        self.set(to, value, Known::Nothing);
        let target = self.target(step);
        self.jump(target);
        self.ended();
    }

    /// Calls a function in the frame of the running one.
    fn call_in_place(&mut self, window: u8, count: u8, function: Ssa, to: u8) {
        let Replaced { address, one, more } = self.replace_frame(window, count, function);
        let (frame, (done, value)) = (self.base_at(self.at), self.block_with_value());
        let first = self.invoke(to, frame, address, false, Want::ONE);
        self.jump_with(done, first);
        self.go_to(one);
        let first = self.load_context(offset_of!(NativeContext, value));
        self.jump_with(done, first);
        self.go_to(more);
        self.first_of_values(to, done);
        self.go_to(done);
        self.forget(RegisterBits::all_from(to));
        self.set(to, value, Known::Nothing);
    }

    /// Returns the value list from the running frame, and goes on with its first value, which is delivered to
    /// a register.
    fn first_of_values(&mut self, to: u8, done: Block) {
        self.deliver_values();
        let first = self.load(self.base, i32::from(to) * WORD);
        self.jump_with(done, first);
    }

    /// Has the machine return the value list from the running frame, which delivers the first one.
    fn deliver_values(&mut self) {
        let base = self.base_at(self.at);
        self.store_context(base, offset_of!(NativeContext, base));
        self.call_helper(offset_of!(NativeContext, all_values));
    }

    /// Forgets what registers hold whose frame begins or ends.
    fn forget(&mut self, registers: RegisterBits) {
        self.unspilled = self.unspilled.without(registers);
        for (register, known) in self.known.iter_mut().enumerate() {
            if registers.contains(register) {
                *known = Known::Nothing;
                self.words[register] = None;
            }
        }
    }
}
