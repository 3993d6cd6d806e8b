//! The translation of a function: its entries and blocks, and what is known of its registers.
//!
//! Each register of the frame, and of the frames of inlined functions, is a variable of the code generator,
//! and every write goes to the stack as well, but for unspilled doubles (N3).

use std::collections::{BTreeMap, HashMap};

use cranelift_codegen::ir::{
    AbiParam, Block, FuncRef, InstBuilder, JumpTableData, SigRef, Signature, Type, Value as Ssa, types,
};
use cranelift_codegen::isa::TargetFrontendConfig;
use cranelift_frontend::{FunctionBuilder, Variable};
use esl_heap::Value;

use crate::abi::GUESSED_WRONG;
use crate::arithmetic::Arithmetic;
use crate::doubles::{DoubleBatch, EdgeWork};
use crate::emit::WORD;
use crate::flow::{FlowFrame, FlowStep, NativeFlow};
use crate::kinds::{Known, NativeKinds};
use crate::maker::NativeSource;
use crate::places::{RegisterBits, SideExit};

/// A translation under way.
pub(crate) struct Translator<'a, 'f> {
    pub(crate) b: FunctionBuilder<'f>,
    pub(crate) source: &'a NativeSource,
    pub(crate) flow: &'a NativeFlow<'a>,
    pub(crate) kinds: &'a NativeKinds,
    /// The function itself, for calls.
    pub(crate) itself: FuncRef,
    pub(crate) pointer: Type,
    pub(crate) context: Ssa,
    pub(crate) base: Ssa,
    pub(crate) variables: Vec<Variable>,
    /// The doubles of those that are known to be doubles.
    pub(crate) doubles: Vec<Variable>,
    /// The known kind of each register here.
    pub(crate) known: Vec<Known>,
    /// RegisterBits that hold doubles that are not in their places, or may hold such.
    pub(crate) unspilled: RegisterBits,
    /// The words of doubles, where they are at hand.
    pub(crate) words: Vec<Option<Ssa>>,
    /// Results that are not tested yet.
    pub(crate) batch: Option<DoubleBatch>,
    /// The results of operations on doubles on all paths to here, tested or in the batch.
    pub(crate) results: HashMap<(Arithmetic, Ssa, Ssa), Ssa>,
    /// The lengths of what is known to be simple vectors on all paths here.
    pub(crate) lengths: HashMap<Ssa, Ssa>,
    blocks: BTreeMap<usize, Block>,
    edges: Vec<(Block, usize, Vec<EdgeWork>)>,
    pub(crate) side_exits: BTreeMap<SideExit, Block>,
    pub(crate) signal: Option<Block>,
    pub(crate) helper_signature: SigRef,
    pub(crate) store_signature: SigRef,
    pub(crate) read_signature: SigRef,
    pub(crate) lookup_signature: SigRef,
    pub(crate) entry_signature: SigRef,
    /// Word of the instruction that is translated.
    pub(crate) at: usize,
    /// Word behind it.
    pub(crate) next: usize,
    /// Its frame.
    pub(crate) frame: FlowFrame<'a>,
    /// The register that is guessed to hold a double behind it.
    pub(crate) guess: Option<u8>,
    /// Whether control goes on behind the instruction.
    is_open: bool,
}

impl<'a, 'f> Translator<'a, 'f> {
    /// Begins a translation.
    pub(crate) fn new(
        mut b: FunctionBuilder<'f>,
        source: &'a NativeSource,
        (flow, kinds): (&'a NativeFlow<'a>, &'a NativeKinds),
        itself: FuncRef,
        pointer: Type,
    ) -> Self {
        let convention = b.func.signature.call_conv;
        let mut signature = |parameters: usize, results: usize| {
            let mut signature = Signature::new(convention);
            signature.params.extend(vec![AbiParam::new(types::I64); parameters]);
            signature.returns.extend(vec![AbiParam::new(types::I64); results]);
            b.import_signature(signature)
        };
        let (helper, store, entry) = (signature(3, 1), signature(3, 0), signature(3, 2));
        let (read, lookup) = (signature(2, 1), signature(5, 1));
        let variables: Vec<Variable> = (0..flow.registers).map(|_| b.declare_var(types::I64)).collect();
        let doubles: Vec<Variable> = (0..flow.registers).map(|_| b.declare_var(types::F64)).collect();
        let first = b.create_block();
        b.append_block_params_for_function_params(first);
        b.switch_to_block(first);
        let (context, base) = (b.block_params(first)[0], b.block_params(first)[1]);
        Translator {
            b,
            source,
            flow,
            kinds,
            itself,
            pointer,
            context,
            base,
            known: vec![Known::Nothing; flow.registers],
            unspilled: RegisterBits::NONE,
            words: vec![None; flow.registers],
            batch: None,
            results: HashMap::new(),
            lengths: HashMap::new(),
            variables,
            doubles,
            blocks: BTreeMap::new(),
            edges: Vec::new(),
            side_exits: BTreeMap::new(),
            signal: None,
            helper_signature: helper,
            store_signature: store,
            read_signature: read,
            lookup_signature: lookup,
            entry_signature: entry,
            at: 0,
            next: 0,
            frame: flow.frames[0],
            guess: None,
            is_open: false,
        }
    }

    /// Translates all instructions that machine code can reach.
    pub(crate) fn translate(mut self, config: TargetFrontendConfig) {
        for (at, step) in self.flow.steps.iter().enumerate() {
            if step.is_some_and(|step| step.is_target) {
                let block = self.b.create_block();
                self.blocks.insert(at, block);
            }
        }
        self.enter();
        let flow = self.flow;
        for (at, step) in flow.steps.iter().enumerate() {
            let Some(step) = step else { continue };
            if !self.is_open && !step.is_target {
                // Only an instruction that is always left leads here.
                continue;
            }
            self.begin(at, step);
            self.is_open = true;
            self.instruction(step);
        }
        for (block, to, works) in std::mem::take(&mut self.edges) {
            self.go_to(block);
            self.do_edge_works(&works);
            self.jump(self.blocks[&to]);
        }
        self.emit_exits();
        self.b.seal_all_blocks();
        self.b.finalize(config);
    }

    /// Writes the entries: each takes the registers from the stack.
    pub(crate) fn enter(&mut self) {
        let first = self.b.current_block().map(|block| self.b.block_params(block)[2]);
        let (Some(place), flow) = (first, self.flow) else { return };
        let mut entries = Vec::new();
        for at in std::iter::once(0).chain(flow.loops.iter().copied()) {
            let block = self.block();
            entries.push((block, at));
        }
        if entries.len() == 1 {
            self.jump(entries[0].0);
        } else {
            let calls: Vec<_> =
                entries.iter().map(|&(block, _)| self.b.func.dfg.block_call(block, &[])).collect();
            let others = self.block();
            let table = self.b.create_jump_table(JumpTableData::new(calls[0], &calls[1..]));
            // The commonest entry is told by one comparison.
            self.branch(place, others, entries[0].0);
            self.go_to(others);
            let place = self.b.ins().iadd_imm_s(place, -1);
            let place = self.b.ins().ireduce(types::I32, place);
            self.b.ins().br_table(place, table);
        }
        for (block, at) in entries {
            self.go_to(block);
            for register in 0..self.variables.len() {
                self.take(register, at);
            }
            let target = self.blocks[&at];
            self.jump(target);
        }
    }

    /// Takes a register from the stack, and leaves the machine code at the instruction at a word unless it is
    /// what it is known to be there.
    fn take(&mut self, register: usize, at: usize) {
        let (base, known) = (self.base, self.kinds.before(at)[register]);
        if matches!(known, Known::Nothing | Known::Fixnum) && !self.kinds.is_live(at, register) {
            return;
        }
        let value = self.load(base, register as i32 * WORD);
        self.b.def_var(self.variables[register], value);
        match known {
            Known::Fixnum => {
                let wrong = self.side_exit(at, GUESSED_WRONG);
                let tag = self.b.ins().band_imm_s(value, 3);
                self.refuse(tag, wrong);
            }
            // A later exit spills it, read or not.
            Known::Double => {
                let wrong = self.side_exit(at, GUESSED_WRONG);
                let double = self.double_of(value, wrong);
                self.b.def_var(self.doubles[register], double);
            }
            Known::Spent => self.do_edge_works(&[EdgeWork::Mark(register)]),
            Known::Nothing => {}
        }
    }

    /// Begins an instruction: a block if jumps lead to it.
    fn begin(&mut self, at: usize, step: &FlowStep) {
        if let Some(&block) = self.blocks.get(&at) {
            if self.is_open {
                self.close_batch();
                let works = self.edge_works(at);
                self.do_edge_works(&works);
                self.jump(block);
            }
            self.b.switch_to_block(block);
            self.unspilled = self.kinds.unspilled(at);
            self.words.fill(None);
            self.results.clear();
            self.lengths.clear();
        }
        self.known.copy_from_slice(self.kinds.before(at));
        (self.at, self.next, self.frame) = (at, step.next, self.flow.frames[step.frame]);
        self.guess = self.kinds.guess(step, &self.known);
    }

    /// Notes that control does not go on behind the instruction.
    pub(crate) fn ended(&mut self) {
        self.is_open = false;
    }

    /// Returns the block to which the instruction jumps.
    pub(crate) fn target(&mut self, step: &FlowStep) -> Block {
        let to = step.target.unwrap_or(step.next);
        let works = self.edge_works(to);
        if works.is_empty() {
            return self.blocks[&to];
        }
        let block = self.block();
        self.edges.push((block, to, works));
        block
    }

    pub(crate) fn operand(&mut self, register: u8) -> (Ssa, Known) {
        (self.get(register), self.known[usize::from(register)])
    }

    pub(crate) fn fixnum(&mut self, n: i32) -> (Ssa, Known) {
        (self.constant_value(Value::small(n)), Known::Fixnum)
    }

    pub(crate) fn set_boolean(&mut self, dst: u8, test: Ssa) {
        let value = self.boolean(test);
        self.set(dst, value, Known::Nothing);
    }

    pub(crate) fn boolean(&mut self, test: Ssa) -> Ssa {
        let (t, nil) = (self.constant_value(Value::T), self.constant_value(Value::NIL));
        self.b.ins().select(test, t, nil)
    }
}
