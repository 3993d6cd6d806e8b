//! Blocks, tagbodies, and exits from them; catch and throw.
//!
//! An exit to a place in the same frame, with no cleanup in between, pops the control entries in between and
//! jumps. Otherwise the place makes a tag of its own, which the code that leaves has at hand or captures, and
//! catches it.

use esl_bytecode::opcode::Instr;
use esl_bytecode::operand::*;

use super::builder::{BlockExit, Extent, FunctionBuilder, TagbodyExits};
use super::dest::Dest;
use super::graph::{Cond, SegmentLabel};
use super::variable::VariableLocation;
use crate::core::*;
use crate::resolve::Lexical;

impl FunctionBuilder<'_, '_> {
    /// Lowers a block.
    pub(super) fn block(&mut self, block: BlockId, body: NodeId, dest: Dest) {
        let end = self.graph.label();
        if !self.module.resolution.block_needs_catch(block) {
            self.blocks.insert(block, BlockExit { dest, end, depth: self.extents.len() });
            self.form(body, dest);
            self.blocks.remove(&block);
            if dest.goes_on() {
                self.graph.bind(end);
            }
            return;
        }
        let tag = self.registers.take(1);
        self.module.blocks[block.index()] = tag;
        self.emit(Instr::NewTag { dst: tag.into() });
        // Thrown values are values of the block, which has one value only if all exits have one.
        let inner = self.inner(dest, false);
        let depth = self.extents.len();
        let state = BlockExit { dest: inner, end, depth };
        self.blocks.insert(block, state);
        self.guarded(tag, end, inner, body);
        self.blocks.remove(&block);
        self.registers.release(tag);
        self.finish(inner, dest);
    }

    /// Lowers a body inside a catch for the tag in a register. Both exits meet at `end`.
    fn guarded(&mut self, tag: Reg, end: SegmentLabel, inner: Dest, body: NodeId) {
        let depth = self.extents.len();
        let (window, want) = (self.registers.top(), inner.want());
        self.registers.reserve(window, usize::from(want.registers()));
        let push = Instr::PushCatch { window: window.into(), tag, want, to: Landing(0) };
        self.push_entry(push, end, Extent::Control);
        self.form(body, inner);
        self.close(depth);
        self.graph.bind(end);
    }

    /// Lowers an exit from a block.
    pub(super) fn return_from(&mut self, block: BlockId, value: NodeId, dest: Dest) {
        let state = self.blocks.get(&block).copied();
        let local = state.filter(|state| !self.extents[state.depth..].contains(&Extent::Cleanup));
        let Some(state) = local else {
            self.form(value, Dest::All);
            let register = self.module.blocks[block.index()];
            return self.throw_to_own(Lexical::Block(block), register, ThrowKind::RETURN_FROM, dest);
        };
        if self.extents.len() == state.depth {
            self.form(value, state.dest);
        } else {
            let inner = self.inner(state.dest, self.module.resolution.is_single(value));
            self.form(value, inner);
            self.leave(state.depth);
            self.finish(inner, state.dest);
        }
        self.join(state.end, state.dest);
    }

    /// Lowers a tagbody.
    pub(super) fn tagbody(&mut self, tagbody: TagbodyId, items: &[TagbodyItem], dest: Dest) {
        let count = items.iter().filter(|item| matches!(item, TagbodyItem::Tag)).count();
        let tags: Vec<SegmentLabel> = (0..count).map(|_| self.graph.label()).collect();
        let top = self.registers.top();
        let has_literals = self.load_tagbody_literals(tagbody, items);
        if self.module.resolution.tagbody_needs_catch(tagbody) {
            self.catching_tagbody(tagbody, items, tags);
        } else {
            let depth = self.extents.len();
            self.tagbody_forms(tagbody, items, TagbodyExits { tags, depth });
        }
        if has_literals {
            self.literals = None;
        }
        self.registers.release(top);
        self.deliver_nil(dest);
    }

    fn tagbody_forms(&mut self, tagbody: TagbodyId, items: &[TagbodyItem], state: TagbodyExits) {
        let mut tags = state.tags.clone().into_iter();
        self.tagbodies.insert(tagbody, state);
        for item in items {
            match item {
                TagbodyItem::Tag => {
                    if let Some(tag) = tags.next() {
                        self.graph.bind(tag);
                    }
                }
                TagbodyItem::Form(form) => self.form(*form, Dest::Effect),
            }
        }
        self.tagbodies.remove(&tagbody);
    }

    /// A tagbody with a catch. The number of a tag that is thrown goes to a register, and control back to the
    /// push:
    ///
    /// ```text
    ///       number := -1
    /// again: push the catch, landing at `caught`
    ///       go to the tag with that number, if there is one
    ///       the forms …; pop the catch; go to `end`
    /// caught: number := what was thrown; loop to `again`
    /// end:
    /// ```
    fn catching_tagbody(&mut self, tagbody: TagbodyId, items: &[TagbodyItem], tags: Vec<SegmentLabel>) {
        let [again, caught, end] = [self.graph.label(), self.graph.label(), self.graph.label()];
        let tag = self.registers.take(1);
        let number = self.registers.take(1);
        let window = self.registers.top();
        self.registers.reserve(window, 1);
        self.module.tagbodies[tagbody.index()] = tag;
        self.emit(Instr::NewTag { dst: tag.into() });
        self.emit(Instr::LoadInt { dst: number.into(), value: Int16(-1) });
        self.graph.bind(again);
        let depth = self.extents.len();
        let push = Instr::PushCatch { window: window.into(), tag, want: Want::ONE, to: Landing(0) };
        self.push_entry(push, caught, Extent::Control);
        for (index, &label) in tags.iter().enumerate() {
            let next = self.graph.label();
            let index = Int16(index.min(i16::MAX as usize) as i16);
            self.branch(Cond::NumEqInt(number, index), label, next);
            self.graph.bind(next);
        }
        self.tagbody_forms(tagbody, items, TagbodyExits { tags, depth: depth + 1 });
        self.close(depth);
        self.jump(end);
        self.graph.bind(caught);
        self.move_to(number, window);
        self.jump(again);
        self.graph.bind(end);
        self.registers.release(tag);
    }

    /// Lowers a jump to a tag.
    pub(super) fn go(&mut self, tagbody: TagbodyId, tag: u32, dest: Dest) {
        let local = self
            .tagbodies
            .get(&tagbody)
            .filter(|state| !self.extents[state.depth..].contains(&Extent::Cleanup));
        if let Some(state) = local {
            let (depth, label) = (state.depth, state.tags[tag as usize]);
            self.leave(depth);
            return self.jump(label);
        }
        let number = self.target(Dest::Effect);
        let value = Int16(tag.min(i16::MAX as u32) as i16);
        self.emit(Instr::LoadInt { dst: number.into(), value });
        self.emit(Instr::SetValues { first: number.into(), count: Count(1) });
        let register = self.module.tagbodies[tagbody.index()];
        self.throw_to_own(Lexical::Tagbody(tagbody), register, ThrowKind::GO, dest);
    }

    /// Throws the value list to the tag of a block or tagbody, which is in `register` if this frame owns it.
    /// The throw fails if the place has been left before; the form then has the value with which the program
    /// recovers.
    fn throw_to_own(&mut self, lexical: Lexical, register: Reg, kind: ThrowKind, dest: Dest) {
        let mut tag = register;
        if self.module.resolution.frame(lexical.owner(self.core)) != self.lambda {
            let index = self.capture_index(lexical);
            tag = self.target(Dest::Effect);
            self.fetch(VariableLocation::Capture(index), Dest::Fresh(tag));
        }
        self.emit(Instr::Throw { tag, kind });
        self.deliver_first(dest);
    }

    /// Lowers a catch.
    pub(super) fn catch(&mut self, tag: NodeId, body: NodeId, dest: Dest) {
        let top = self.registers.top();
        let register = self.operand(tag, &[]);
        // Once the entry is pushed, the tag is not needed any more.
        self.registers.release(top);
        let inner = self.inner(dest, false);
        let end = self.graph.label();
        self.guarded(register, end, inner, body);
        self.finish(inner, dest);
    }

    /// Lowers a throw.
    pub(super) fn throw(&mut self, tag: NodeId, values: NodeId, dest: Dest) {
        let top = self.registers.top();
        let register = self.operand(tag, &[values]);
        self.form(values, Dest::All);
        self.emit(Instr::Throw { tag: register, kind: ThrowKind::THROW });
        self.registers.release(top);
        self.deliver_first(dest);
    }
}
