//! Special variables. Functions of the machine do the work that depends on the bindings of the task. Those
//! that read or set a variable read nothing of the frame: unspilled doubles stay so.

use std::mem::offset_of;

use cranelift_codegen::ir::InstBuilder;
use esl_heap::Value;
use esl_heap::heap::layout::SymbolObject;

use crate::abi::NativeContext;
use crate::emit::in_object;
use crate::translate::Translator;

impl Translator<'_, '_> {
    pub(crate) fn symbol_value(&mut self, dst: u8, symbol: u16) {
        let (symbol, slow) = (self.constant(usize::from(symbol)), self.cold_block());
        let (bound, global) = (self.block(), self.block());
        let (read, value) = self.block_with_value();
        let was_bound = self.flags(symbol, SymbolObject::EVER_BOUND);
        self.branch(was_bound, bound, global);

        self.go_to(bound);
        let (context, value_of) = (self.context, self.load_context(offset_of!(NativeContext, value_of)));
        let call = self.b.ins().call_indirect(self.read_signature, value_of, &[context, symbol]);
        let found = self.b.inst_results(call)[0];
        self.jump_with(read, found);

        self.go_to(global);
        let found = self.load(symbol, in_object(offset_of!(SymbolObject, value)));
        self.jump_with(read, found);

        self.go_to(read);
        let is_unbound = self.equals(value, Value::UNBOUND.bits());
        self.refuse(is_unbound, slow);
        self.finish_with(slow, value, dst);
    }

    pub(crate) fn set_symbol_value(&mut self, src: u8, symbol: u16) {
        self.make_word(usize::from(src));
        let (symbol, value, slow) = (self.constant(usize::from(symbol)), self.get(src), self.cold_block());
        let is_constant = self.flags(symbol, SymbolObject::CONSTANT);
        self.refuse(is_constant, slow);
        let (bound, global, set) = (self.block(), self.block(), self.block());
        let was_bound = self.flags(symbol, SymbolObject::EVER_BOUND);
        self.branch(was_bound, bound, global);

        self.go_to(bound);
        let (context, helper) = (self.context, self.load_context(offset_of!(NativeContext, set_value_of)));
        self.b.ins().call_indirect(self.store_signature, helper, &[context, symbol, value]);
        self.jump(set);

        self.go_to(global);
        self.store_slot(value, symbol, in_object(offset_of!(SymbolObject, value)));
        self.jump(set);

        self.go_to(set);
        self.finish_effect(slow);
    }

    /// Has the machine bind a variable, or end bindings.
    pub(crate) fn bind(&mut self, helper: usize) {
        self.spill();
        let (outcome, signal) = (self.call_helper(helper), self.signal());
        self.refuse(outcome, signal);
    }
}
