//! Hash tables: searches in line, as far as one look at the head of a chain tells; a function of the machine
//! goes further.
//!
//! The guess of the last search comes first (`esl_heap::table::LastLookup`), for keys of all kinds. Then the
//! chain of a key that is a fixnum. Nothing is charged for so little, so ticks are those of the machine's own
//! search.

use std::mem::offset_of;

use cranelift_codegen::ir::condcodes::IntCC;
use cranelift_codegen::ir::{Block, InstBuilder, Value as Ssa, types};
use esl_bytecode::builtin::Builtin;
use esl_heap::Value;
use esl_heap::equality::HASH_FACTOR;
use esl_heap::heap::Kind;
use esl_heap::heap::layout::{HashTable, Header};
use esl_heap::table::LastLookup;

use crate::abi::NativeContext;
use crate::arithmetic::Arithmetic;
use crate::emit::{ELEMENTS, WORD, in_object, memory};
use crate::kinds::Known;
use crate::translate::Translator;

/// The operation of a builtin on the entry of a key.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum TableOperation {
    /// Returns the value; a default if there is none.
    Get,
    /// Sets the value, if there is one.
    Set,
    /// Adds a fixnum to the value, if there is one and it is a fixnum.
    Add,
}

impl TableOperation {
    /// Returns what a builtin does, called with so many arguments, if it is one of hash tables.
    pub(crate) fn of(builtin: u32, count: u8) -> Option<TableOperation> {
        let is = |other: Builtin| builtin == other.number();
        match count {
            2 | 3 if is(Builtin::Gethash) => Some(TableOperation::Get),
            3 if is(Builtin::Puthash) => Some(TableOperation::Set),
            4 if is(Builtin::AddToValue) => Some(TableOperation::Add),
            _ => None,
        }
    }

    /// Returns the place in the context of the function of the machine that does it.
    fn helper(self) -> usize {
        match self {
            TableOperation::Get => offset_of!(NativeContext, value_of_key),
            TableOperation::Set => offset_of!(NativeContext, set_value_of_key),
            TableOperation::Add => offset_of!(NativeContext, add_to_value_of_key),
        }
    }
}

/// A search under way.
#[derive(Clone, Copy)]
struct LookupInLine {
    key: Ssa,
    table: Ssa,
    /// Number of entries of the table that were ever in use.
    used: Ssa,
    /// The machine's [`LastLookup`].
    last: Ssa,
    /// Takes the address of the entry, less that of elements.
    found: Block,
    /// The function of the machine.
    slow: Block,
}

impl Translator<'_, '_> {
    /// Does a builtin of hash tables.
    pub(crate) fn lookup(&mut self, window: u8, count: u8, operation: TableOperation) {
        self.spill();
        self.tick();
        let (slow, absent) = (self.cold_block(), self.block());
        let ((found, entry), (done, value)) = (self.block_with_value(), self.block_with_value());
        let (key, table) = (self.operand(window + 2), self.get(window + 3));
        self.find_entry(key, table, (found, absent, slow));

        self.go_to(found);
        let value_at = in_object(ELEMENTS as usize) + WORD;
        match operation {
            TableOperation::Get => {
                let value = self.load(entry, value_at);
                self.jump_with(done, value);
            }
            TableOperation::Set => {
                let given = self.get(window + 4);
                self.store_slot(given, entry, value_at);
                self.jump_with(done, given);
            }
            TableOperation::Add => {
                let old = (self.load(entry, value_at), Known::Nothing);
                let delta = self.operand(window + 5);
                if let Some(other) = self.not_fixnums(old, delta) {
                    self.refuse(other, slow);
                }
                let sum = self.on_fixnums(Arithmetic::Add, old.0, delta.0, slow);
                // No address is overwritten, so that it makes no difference whether objects are marked.
                self.store(sum, entry, value_at);
                self.jump_with(done, sum);
            }
        }

        self.go_to(absent);
        if operation == TableOperation::Get {
            let default = if count == 3 { self.get(window + 4) } else { self.constant_value(Value::NIL) };
            self.jump_with(done, default);
        } else {
            self.jump(slow);
        }

        self.go_to(slow);
        let found = self.lookup_by_machine(window, count, operation);
        self.jump_with(done, found);
        self.go_to(done);
        self.set(window, value, Known::Nothing);
    }

    /// Has the machine search; its builtin does what takes more. Returns the value.
    fn lookup_by_machine(&mut self, window: u8, count: u8, operation: TableOperation) -> Ssa {
        let (context, helper) = (self.context, self.load_context(operation.helper()));
        let mut arguments = vec![context];
        for i in 0..4 {
            let nothing = Value::NIL;
            arguments.push(if i < count { self.get(window + 2 + i) } else { self.constant_value(nothing) });
        }
        let call = self.b.ins().call_indirect(self.lookup_signature, helper, &arguments);
        let found = self.b.inst_results(call)[0];
        let (more, (done, value)) = (self.cold_block(), self.block_with_value());
        let is_more = self.equals(found, Value::UNBOUND.bits());
        self.refuse(is_more, more);
        self.jump_with(done, found);

        self.go_to(more);
        let found = self.value_of_builtin(window);
        self.jump_with(done, found);
        self.go_to(done);
        value
    }

    /// Goes to one of three blocks: that for a key that is found, with its entry's address; that for a key
    /// that is not there; or that of the machine.
    fn find_entry(&mut self, key: (Ssa, Known), table: Ssa, to: (Block, Block, Block)) {
        let (found, absent, slow) = to;
        self.require_nothing_due(slow);
        self.require_kind(table, Kind::HashTable, slow);
        let test = self.b.ins().uload16(types::I64, memory(), table, in_object(offset_of!(Header, aux)));
        let by_value = i64::from(HashTable::BY_VALUE);
        let is_by_value = self.b.ins().icmp_imm_u(IntCC::UnsignedLessThanOrEqual, test, by_value);
        self.require(is_by_value, slow);
        let used = self.load(table, in_object(offset_of!(HashTable, used)));
        let used = self.b.ins().ushr_imm_s(used, 2);
        let last = self.load_context(offset_of!(NativeContext, last_lookup));
        let search = LookupInLine { key: key.0, table, used, last, found, slow };
        let is_fixnum = (key.1 != Known::Fixnum).then(|| {
            let tag = self.b.ins().band_imm_s(key.0, 3);
            self.equals(tag, 0)
        });
        let by_chain = self.block();
        self.find_by_last(&search, is_fixnum, by_chain);
        self.go_to(by_chain);
        if let Some(is_fixnum) = is_fixnum {
            self.require(is_fixnum, slow);
        }
        self.find_by_chain(&search, absent);
    }

    /// Goes on only if a builtin has nothing to see to afterwards that came up before.
    pub(crate) fn require_nothing_due(&mut self, otherwise: Block) {
        let gc_due = self.load_context(offset_of!(NativeContext, gc_due));
        let gc_due = self.b.ins().uload8(types::I64, memory(), gc_due, 0);
        let charges = self.load_context(offset_of!(NativeContext, charges));
        let charges = self.load(charges, 0);
        let due = self.b.ins().bor(gc_due, charges);
        self.refuse(due, otherwise);
    }

    /// Looks at the entry that follows from the last search, if one does; else goes on in `otherwise`.
    fn find_by_last(&mut self, search: &LookupInLine, is_fixnum: Option<Ssa>, otherwise: Block) {
        let &LookupInLine { key, last, .. } = search;
        let steady = offset_of!(LastLookup, is_steady) as i32;
        let mut steady = self.b.ins().uload8(types::I64, memory(), last, steady);
        if let Some(is_fixnum) = is_fixnum {
            let is_fixnum = self.b.ins().uextend(types::I64, is_fixnum);
            steady = self.b.ins().band(steady, is_fixnum);
        }
        let (before, entry_before) = (
            self.load(last, offset_of!(LastLookup, key) as i32),
            self.load(last, offset_of!(LastLookup, entry) as i32),
        );
        let is_same = self.b.ins().icmp(IntCC::Equal, key, before);
        let distance = self.load(last, offset_of!(LastLookup, distance) as i32);
        let n = self.b.ins().sshr_imm_s(key, 2);
        let at_distance = self.b.ins().iadd(n, distance);
        let entry = self.b.ins().select(steady, at_distance, entry_before);
        let is_same = self.b.ins().uextend(types::I64, is_same);
        let may_be = self.b.ins().bor(is_same, steady);
        self.require(may_be, otherwise);
        let entry = self.entry_with_key(search, entry, otherwise);
        self.jump_with(search.found, entry);
    }

    /// Looks at the first link of the chain of a fixnum. Goes to `absent` if there is nothing else in the
    /// chain, to the machine if there is.
    fn find_by_chain(&mut self, search: &LookupInLine, absent: Block) {
        let &LookupInLine { key, last, slow, .. } = search;
        let hash = self.fixnum_hash(key);
        let link = self.first_link(search, hash);
        let hash_of_link = self.b.ins().ushr_imm_s(link, i64::from(HashTable::NUMBER_BITS) + 1);
        let (same, other) = (self.block(), self.block());
        let is_same = self.b.ins().icmp(IntCC::Equal, hash_of_link, hash);
        self.branch(is_same, same, other);
        self.go_to(other);
        let goes_on = self.b.ins().band_imm_s(link, 1);
        self.branch(goes_on, slow, absent);

        self.go_to(same);
        let number = self.b.ins().ushr_imm_s(link, 1);
        let number = self.b.ins().band_imm_s(number, (1 << HashTable::NUMBER_BITS) - 1);
        // A link that leads nowhere has number 0, so that this is not an entry.
        let number = self.b.ins().iadd_imm_s(number, -1);
        let entry = self.entry_with_key(search, number, slow);
        let n = self.b.ins().sshr_imm_s(key, 2);
        let (distance, distance_at) = (self.b.ins().isub(number, n), offset_of!(LastLookup, distance) as i32);
        let before = self.load(last, distance_at);
        let is_steady = self.b.ins().icmp(IntCC::Equal, distance, before);
        self.store(key, last, offset_of!(LastLookup, key) as i32);
        self.store(number, last, offset_of!(LastLookup, entry) as i32);
        self.store(distance, last, distance_at);
        self.b.ins().store(memory(), is_steady, last, offset_of!(LastLookup, is_steady) as i32);
        self.jump_with(search.found, entry);
    }

    /// Returns the hash of a fixnum, as `esl_heap::equality::fixnum_hash` has it.
    fn fixnum_hash(&mut self, key: Ssa) -> Ssa {
        let group = self.b.ins().sshr_imm_s(key, 2 + 4);
        let group = self.b.ins().imul_imm_s(group, HASH_FACTOR as i64);
        let high = self.b.ins().ushr_imm_s(group, 32);
        let group = self.b.ins().bxor(high, group);
        let top = self.b.ins().ushr_imm_s(group, 28);
        let n = self.b.ins().sshr_imm_s(key, 2);
        let low = self.b.ins().bxor(n, top);
        let low = self.b.ins().band_imm_s(low, 15);
        let group = self.b.ins().ishl_imm_s(group, 4);
        let hash = self.b.ins().bor(group, low);
        let hash = self.b.ins().ireduce(types::I32, hash);
        self.b.ins().uextend(types::I64, hash)
    }

    /// Returns the first link of the chain of a hash, as `Storage::first` of the heap finds it.
    fn first_link(&mut self, search: &LookupInLine, hash: Ssa) -> Ssa {
        const SHIFT: u32 = HashTable::SEGMENT_SHIFT + HashTable::PER_ENTRY.ilog2();
        let one = self.word(1);
        let chains = self.b.ins().umax(search.used, one);
        let chains = self.b.ins().imul_imm_s(chains, HashTable::PER_ENTRY as i64);
        let zeros = self.b.ins().clz(chains);
        let most = self.word(u64::MAX);
        let mask = self.b.ins().ushr(most, zeros);
        let whole = self.b.ins().band(hash, mask);
        let mask = self.b.ins().ushr_imm_s(mask, 1);
        let short = self.b.ins().band(hash, mask);
        let is_there = self.b.ins().icmp(IntCC::UnsignedLessThan, whole, chains);
        let chain = self.b.ins().select(is_there, whole, short);
        self.in_segment(search.table, offset_of!(HashTable, heads), (chain, SHIFT, 1)).1
    }

    /// Returns the address of an entry, less that of elements, if there is one that has the key.
    fn entry_with_key(&mut self, search: &LookupInLine, entry: Ssa, otherwise: Block) -> Ssa {
        let is_used = self.b.ins().icmp(IntCC::UnsignedLessThan, entry, search.used);
        self.require(is_used, otherwise);
        let place = (entry, HashTable::SEGMENT_SHIFT, HashTable::ENTRY);
        let (entry, key) = self.in_segment(search.table, offset_of!(HashTable, entries), place);
        let is_same = self.b.ins().icmp(IntCC::Equal, key, search.key);
        self.require(is_same, otherwise);
        entry
    }

    /// Returns the address of a place in the segments of a directory of a table, less that of elements, and
    /// the word there. A place is given by its number, how many of them a segment has, as a binary logarithm,
    /// and its words.
    fn in_segment(&mut self, table: Ssa, directory: usize, place: (Ssa, u32, usize)) -> (Ssa, Ssa) {
        let (number, shift, words) = place;
        let directory = self.load(table, in_object(directory));
        let segment = self.b.ins().ushr_imm_s(number, i64::from(shift));
        let segment = self.b.ins().ishl_imm_s(segment, 3);
        let segment = self.b.ins().iadd(directory, segment);
        let segment = self.load(segment, in_object(ELEMENTS as usize));
        let place = self.b.ins().band_imm_s(number, (1 << shift) - 1);
        let place = self.b.ins().imul_imm_s(place, (words * size_of::<Value>()) as i64);
        let place = self.b.ins().iadd(segment, place);
        (place, self.load(place, in_object(ELEMENTS as usize)))
    }
}
