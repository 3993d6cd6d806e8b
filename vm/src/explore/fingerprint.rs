//! Fingerprints of states: what a program may still do depends on what is hashed here, and on the schedule.
//!
//! A state consists of the tasks that have not ended (frames, control stacks, bindings, waits, what is noted
//! of them), the values, functions and properties of symbols, facts and rules, timers, and all objects that
//! can be reached from there. Objects have no addresses in it: each is the number of those that were met
//! before it, in an order that depends on the state alone. Tables are hashed in the order of their entries,
//! facts in that of their assertion, times relative to now; also the time itself if the program may know it.
//!
//! Which fields of the machine belong to it is said by `state`, and visited in `content`. Not part of a
//! state: ticks (but for budgets), the numbers of tasks, the order of queues, registers that will not be read
//! (`live`), where failures began, objects that only code of the library reaches, and the outside. While a
//! query or a compilation is under way at a point, the state equals no other.
//!
//! A *strict* fingerprint is of all that the list calls state of the run: ticks, numbers, the order of
//! queues, times as they are, all objects in registers, the collector's state, and where objects lie. Two
//! runs that agree in it go on alike to the tick, and it says so of a run and its replay, in other processes
//! too.

use std::rc::Rc;
use std::sync::Arc;

use super::content::is_of_program;
use super::digest::Digest;
use super::live::Live;
use super::numbers::ObjectNumbers;
use esl_bytecode::symbol::Symbol;
use esl_heap::state::{StateSink, Stated};
use esl_host::machine::CopyOnWrite;

use crate::fused::unfused;
use crate::heap::{Heap, Kind};
use crate::interp::frames::Frames;
use crate::names::load::image_origin;
use crate::names::{GivenMap, Names};
use crate::shape::{CodeKind, Shape};
use crate::state::{VisitCourse, VisitVm};
use crate::table::Table;
use crate::task::{Task, TaskEnd, UnwindTarget, Unwinding};
use crate::value::{TAG_MASK, TAG_OBJECT, Value};
use crate::vm::Vm;
use crate::wait::{event, link};

/// A symbol of a package, and what tells it from others.
#[derive(Clone)]
pub(super) struct NamedSymbol {
    symbol: Symbol,
    pub(super) digest: Digest,
    /// The object.
    pub(super) object: Value,
    /// The function of the library that it had when it was noted; `NIL` if it had none.
    pub(super) function: Value,
    /// The documentation that it has from the library; `NIL` if it has none.
    documentation: Value,
}

/// Makes fingerprints, and remembers of functions what does not change.
#[derive(Default)]
pub(super) struct Fingerprints {
    /// Digests of the codes of functions and of the symbols of packages, by their addresses in the present
    /// machine.
    codes: CopyOnWrite<GivenMap<u64, Digest>>,
    /// The symbols of packages that are objects, by name.
    named: Rc<Vec<NamedSymbol>>,
    /// Number of all symbols of packages at that time.
    named_of: usize,
    /// The collector's cycle in which the addresses are good.
    cycle: u64,
    /// The live registers, by the digest of the code.
    live: CopyOnWrite<GivenMap<Digest, Rc<Live>>>,
    numbers: ObjectNumbers,
    /// Digest of the order in which the last walk has visited the tasks, if like ones can be exchanged.
    pub(super) order: u64,
    /// Room for the objects that a walk meets.
    met: Vec<Value>,
}

impl NamedSymbol {
    fn of(heap: &Heap, names: &Names, symbol: &Symbol, object: Value) -> NamedSymbol {
        let cells = heap.symbol(object);
        let function = cells.map(|cells| cells.function);
        let function = function.filter(|&function| !is_of_program(heap, function)).unwrap_or(Value::NIL);
        let documentation = cells
            .filter(|cells| cells.plist.is_true())
            .and_then(|_| names.images.text_of(heap, symbol))
            .unwrap_or(Value::NIL);
        NamedSymbol {
            symbol: symbol.clone(),
            digest: Digest::of_symbol(symbol),
            object,
            function,
            documentation,
        }
    }

    fn name(&self) -> (Option<&Arc<str>>, &str) {
        (self.symbol.package(), self.symbol.name())
    }
}

/// The memory of [`Fingerprints`] about a machine in an earlier state.
pub(super) struct MachineMemory {
    codes: CopyOnWrite<GivenMap<u64, Digest>>,
    named: Rc<Vec<NamedSymbol>>,
    named_of: usize,
    cycle: u64,
}

impl Fingerprints {
    /// Another machine comes, or another cycle of the collector, with other addresses.
    pub(super) fn begin_machine(&mut self) {
        self.codes = CopyOnWrite::default();
        (self.named, self.named_of) = (Rc::default(), 0);
    }

    /// Returns a copy of what is remembered of the present machine, as it stands.
    pub(super) fn of_machine(&self) -> MachineMemory {
        let (codes, named) = (self.codes.clone(), self.named.clone());
        MachineMemory { codes, named, named_of: self.named_of, cycle: self.cycle }
    }

    /// Returns to what was remembered at the time of such a copy, with the machine.
    pub(super) fn restore(&mut self, copy: &MachineMemory) {
        (self.codes, self.named) = (copy.codes.clone(), copy.named.clone());
        (self.named_of, self.cycle) = (copy.named_of, copy.cycle);
    }

    /// Takes note of the symbols that the machine has got since.
    fn note_symbols(&mut self, heap: &Heap, names: &Names) {
        // A machine gets more symbols, and loses none.
        if self.named_of == names.symbols.len() {
            return;
        }
        self.numbers.begin();
        for named in &*self.named {
            self.numbers.of(named.object, 0);
        }
        let numbers = &mut self.numbers;
        let mut is_new = |object: Value| object.is_address() && numbers.of(object, 1) == 1;
        let new = names.symbols.iter().filter(|&(_, &object)| is_new(object));
        let mut new: Vec<NamedSymbol> =
            new.map(|(symbol, &object)| NamedSymbol::of(heap, names, symbol, object)).collect();
        new.sort_unstable_by(|a, b| a.name().cmp(&b.name()));
        let mut all = Vec::with_capacity(self.named.len() + new.len());
        let mut old = self.named.iter().peekable();
        for symbol in new {
            while let Some(before) = old.next_if(|old| old.name() < symbol.name()) {
                all.push(before.clone());
            }
            all.push(symbol);
        }
        all.extend(old.cloned());
        (self.named, self.named_of) = (Rc::new(all), names.symbols.len());
    }

    /// Gives the documentation of the library numbers that follow from the names of its symbols. It need not
    /// be looked into.
    fn number_documentation(&mut self) {
        for NamedSymbol { digest, documentation, .. } in &*self.named {
            if documentation.is_address() {
                self.numbers.of(*documentation, 1 << 31 | digest.0 as u32);
            }
        }
    }

    /// Returns the fingerprint of the state of a machine in which no task runs.
    pub(super) fn of(&mut self, vm: &mut Vm) -> u128 {
        if self.cycle != vm.heap.cycle_id() {
            self.cycle = vm.heap.cycle_id();
            self.begin_machine();
        }
        let now = vm.scheduler.clock.read(&mut vm.outside.host);
        self.walk(vm, now, false)
    }

    fn walk(&mut self, vm: &Vm, now: u64, is_strict: bool) -> u128 {
        self.note_symbols(&vm.heap, &vm.names);
        self.numbers.begin();
        if !is_strict {
            self.number_documentation();
        }
        let mut met = std::mem::take(&mut self.met);
        met.clear();
        let mut digest = Digest::default();
        if !is_strict && vm.scheduler.points.has_clock {
            digest.add(now);
        }
        let histories = vm.names.find_class(vm.names.known.history);
        let marks = Vec::new();
        let mut walk =
            Walk { vm, known: self, digest, met, next: 0, marks, now, task: None, histories, is_strict };
        walk.machine(walk.vm);
        while let Some(&object) = walk.met.get(walk.next) {
            walk.next += 1;
            walk.object(object);
        }
        walk.marks();
        let Walk { digest, met, .. } = walk;
        self.met = met;
        digest.bits()
    }
}

impl Vm {
    /// Returns the strict fingerprint of the state between two portions of a run: of all that decides how the
    /// run goes on, and how it came here. It does not depend on addresses, and changes nothing.
    pub fn fingerprint(&self) -> u128 {
        Fingerprints::default().walk(self, 0, true)
    }
}

/// Kind of the code of a function.
pub(super) fn code_kind(heap: &Heap, function: Value) -> Option<CodeKind> {
    let code = heap.code(heap.function_code(function)?)?;
    Some(Shape::unpack(code.spare[0]).kind)
}

/// One walk through a state.
pub(super) struct Walk<'a> {
    pub(super) vm: &'a Vm,
    known: &'a mut Fingerprints,
    pub(super) digest: Digest,
    /// The objects that were met, and how many of them were looked into.
    met: Vec<Value>,
    next: usize,
    /// The marks of the events that were met, or their counts.
    marks: Vec<Value>,
    /// The time to which others are relative.
    now: u64,
    /// The task that is being visited.
    pub(super) task: Option<&'a Task>,
    /// The class of histories of failures, if it is defined.
    histories: Option<Value>,
    /// Whether the course belongs to the fingerprint.
    pub(super) is_strict: bool,
}

impl StateSink for Walk<'_> {
    fn word(&mut self, word: u64) {
        self.digest.add(word);
    }

    fn value(&mut self, v: Value) {
        Walk::value(self, v);
    }

    fn address(&mut self, address: usize) {
        self.digest.add(self.vm.heap.place(address));
    }
}

impl VisitCourse for Walk<'_> {
    fn course(&mut self, whole: &dyn Stated) {
        if self.is_strict {
            whole.tell(self);
        }
    }
}

impl Walk<'_> {
    pub(super) fn heap(&self) -> &Heap {
        &self.vm.heap
    }

    /// Notes the order in which tasks are visited.
    pub(super) fn note_order(&mut self, order: u64) {
        self.known.order = order;
    }

    pub(super) fn word(&mut self, word: u64) {
        self.digest.add(word);
    }

    /// A value: the word that it is, or the number of the object.
    pub(super) fn value(&mut self, v: Value) {
        if self.is_strict {
            return self.strict_value(v);
        }
        if !v.is_address() {
            return self.word(v.bits());
        }
        // Words with the tag of a cons or an object are addresses, so numbers with these tags are
        // unambiguous.
        let number = self.number(v);
        self.word(u64::from(number) << TAG_MASK.count_ones() | v.bits() & TAG_MASK);
    }

    /// Something that is not a value, in the place of one: a word of which nothing else begins there.
    pub(super) fn no_value(&mut self) {
        // No object has this number.
        self.word(u64::MAX << TAG_MASK.count_ones() | TAG_OBJECT);
    }

    fn strict_value(&mut self, v: Value) {
        if !v.is_address() {
            self.word(0);
            return self.word(v.bits());
        }
        let known = self.met.len();
        let number = self.number(v);
        if known < self.met.len() {
            self.word(self.vm.heap.identity(v));
        }
        self.word(1);
        self.word(u64::from(number));
    }

    /// Returns the number of an object, which is to be looked into if it is met for the first time.
    fn number(&mut self, v: Value) -> u32 {
        let next = self.met.len() as u32;
        let number = self.known.numbers.of(v, next);
        if number == next {
            self.met.push(v);
        }
        number
    }

    pub(super) fn values(&mut self, values: &[Value]) {
        self.word(values.len() as u64);
        values.iter().for_each(|&v| self.value(v));
    }

    pub(super) fn time(&mut self, time: u64) {
        self.word(time.wrapping_sub(self.now));
    }

    /// Makes this state another one than all others.
    pub(super) fn unlike_any_other(&mut self) {
        self.word(self.vm.scheduler.serial.0);
        self.word(self.vm.scheduler.spent);
    }

    pub(super) fn frames(&mut self, task: &Task) {
        let mut is_innermost = true;
        for frame in Frames::of_task(task) {
            self.word(frame.word as u64);
            self.value(frame.function);
            let live = self.live(frame.function);
            let mut registers = live.at(frame.word);
            if frame.is_exact && !is_innermost {
                // The call in place of this instruction may be followed by it or by the next one.
                registers = registers.with(live.at(frame.word + 1)).with(live.at(frame.word + 2));
            }
            is_innermost = false;
            for (register, &v) in frame.registers().iter().enumerate() {
                // A value that is kept alive matters to the collector, even if nothing will read it. Other
                // dead words do not matter, and may be the return addresses of calls that are over.
                if registers.contains(register) || self.is_strict && v.is_address() {
                    self.word(register as u64);
                    if self.is_return_address(v) {
                        if self.is_strict { self.word(2) } else { self.no_value() }
                    } else {
                        self.value(v);
                    }
                }
            }
        }
    }

    /// Whether a word in a register is the return address of a call that is over: another one in each
    /// machine. Those of calls under way are known by the places of their frames. A program that has
    /// computed just such a number is as unlikely as two states with one fingerprint.
    pub(super) fn is_return_address(&self, v: Value) -> bool {
        let bits = v.bits();
        bits > u64::from(u32::MAX) && bits.is_multiple_of(4) && self.heap().place(bits as usize) != 0
    }

    pub(super) fn unwinding(&mut self, unwinding: Option<&Unwinding>) {
        let Some(Unwinding { target, values }) = unwinding else { return self.word(0) };
        match *target {
            UnwindTarget::Root(TaskEnd::Succeeded) => self.word(1),
            UnwindTarget::Root(TaskEnd::Aborted) => self.word(2),
            UnwindTarget::Root(TaskEnd::Spent) => self.word(3),
            UnwindTarget::Root(TaskEnd::Failed(condition)) => {
                self.word(4);
                self.value(condition);
            }
            UnwindTarget::Entry(index) => self.word((index as u64) << 4 | 5),
            UnwindTarget::Limit(index) => self.word((index as u64) << 4 | 6),
            UnwindTarget::Cleanup(index) => self.word((index as u64) << 4 | 7),
            UnwindTarget::Return { entries, base } => {
                self.word((entries as u64) << 4 | 8);
                self.word(u64::from(base));
            }
        }
        self.values(values);
    }

    /// Mixes in the contents of an object.
    fn object(&mut self, v: Value) {
        if let Some(pair) = self.heap().as_cons(v) {
            self.value(pair.car);
            return self.value(pair.cdr);
        }
        let Some(header) = self.heap().header(v) else { return };
        self.word(header.kind as u64 | u64::from(header.flags) << 8 | u64::from(header.aux) << 16);
        let vm = self.vm;
        match header.kind {
            Kind::Symbol => match self.symbol(v) {
                Some(digest) => self.digest_of(digest),
                None => {
                    let Some(&object) = vm.heap.symbol(v) else { return };
                    [object.name, object.value, object.plist].into_iter().for_each(|v| self.value(v));
                    if is_of_program(&vm.heap, object.function) {
                        self.value(object.function);
                    }
                }
            },
            Kind::Function => self.function(v),
            Kind::Code => {
                let code = self.code(v);
                self.digest.add_all([code.0, code.1].into_iter());
                self.constants(v);
            }
            Kind::HashTable => {
                let Some(table) = Table::of(&vm.heap, v) else { return };
                self.word(table.count(&vm.heap) as u64);
                for (key, value) in (0..table.used(&vm.heap)).filter_map(|at| table.entry(&vm.heap, at)) {
                    self.value(key);
                    self.value(value);
                }
                table.functions(&vm.heap).into_iter().for_each(|v| self.value(v));
            }
            Kind::Task => {
                let slots = vm.heap.record(v, Kind::Task).unwrap_or_default().to_vec();
                let is_alive = slots[event::STATE].is_fixnum();
                for (index, v) in slots.into_iter().enumerate() {
                    // Where it is, and what it belongs to.
                    if index == event::COUNT {
                        self.count(v);
                    } else if self.is_strict
                        || !(is_alive && (index == event::STATE || index == event::RESULT))
                    {
                        self.value(v);
                    }
                }
            }
            Kind::Wait => {
                for (index, &v) in vm.heap.record(v, Kind::Wait).unwrap_or_default().iter().enumerate() {
                    match v.as_index() {
                        Some(time) if index == link::DEADLINE => {
                            if !self.is_strict {
                                self.no_value();
                            }
                            self.time(time as u64);
                        }
                        _ => self.value(v),
                    }
                }
            }
            // The place at which a failure began makes no difference.
            Kind::Structure if !self.is_strict && self.is_history(v) => {}
            Kind::Package | Kind::Class => self.digest.add_text(&vm.describe(v)),
            Kind::Event => {
                for (index, &v) in vm.heap.record(v, Kind::Event).unwrap_or_default().iter().enumerate() {
                    if index == event::COUNT { self.count(v) } else { self.value(v) }
                }
            }
            Kind::Tag if !self.has_counts() && event::is_mark(&vm.heap, v) => {}
            kind if kind.is_record() => {
                let slots = vm.heap.record(v, kind).unwrap_or_default();
                self.values(slots);
            }
            _ => self.raw(v),
        }
    }

    /// Whether states differ by how often events were signalled.
    fn has_counts(&self) -> bool {
        self.is_strict || self.vm.scheduler.points.has_counts
    }

    /// Mixes in the count of an event, if that belongs to a state. Its mark is mixed in at the end, if
    /// something else holds it.
    fn count(&mut self, v: Value) {
        if self.has_counts() { self.value(v) } else { self.marks.push(v) }
    }

    /// Mixes in the marks of all events that were met, in order. All that knows one of them was met before.
    fn marks(&mut self) {
        for mark in std::mem::take(&mut self.marks) {
            let number = if mark.is_address() { self.known.numbers.of(mark, u32::MAX) } else { u32::MAX };
            self.word(u64::from(number));
        }
    }

    /// Returns whether an object is the history of a failure.
    fn is_history(&self, v: Value) -> bool {
        self.histories.is_some() && self.heap().structure_class(v) == self.histories
    }

    /// An object that its digest identifies.
    pub(super) fn digest_of(&mut self, digest: Digest) {
        self.word(digest.0);
        self.word(digest.1);
    }

    /// Returns the digest of a symbol of a package; `None` for another symbol.
    pub(super) fn symbol(&mut self, v: Value) -> Option<Digest> {
        if let Some(&digest) = self.known.codes.get(&v.bits()) {
            return Some(digest);
        }
        let symbol = self.vm.names.name_of(&self.vm.heap, v)?;
        let digest = Digest::of_symbol(&symbol);
        if self.vm.names.symbols.contains_key(&symbol) {
            self.known.codes.insert(v.bits(), digest);
        }
        Some(digest)
    }

    /// The symbols of packages, by name.
    pub(super) fn named(&self) -> Rc<Vec<NamedSymbol>> {
        self.known.named.clone()
    }

    /// An object without values in it.
    fn raw(&mut self, v: Value) {
        let heap = &self.vm.heap;
        if let Some(numbers) = heap.string(v).or_else(|| heap.words(v)).filter(|_| !self.is_strict) {
            self.digest.add_numbers(numbers);
        } else if let Some(bytes) = heap.bytes(v).filter(|_| !self.is_strict) {
            self.digest.add_bytes(bytes);
        } else if let Some(characters) = heap.string(v) {
            self.digest.add_all(characters.iter().map(|&c| u64::from(c)));
        } else if let Some(words) = heap.words(v) {
            self.digest.add_all(words.iter().map(|&word| u64::from(word)));
        } else if let Some(bytes) = heap.bytes(v) {
            self.digest.add_all(bytes.iter().map(|&byte| u64::from(byte)));
        } else if let Some(number) = heap.bignum(v) {
            self.digest.add_all(number.limbs.iter().copied());
        } else if let Some(number) = heap.as_double(v) {
            self.digest.add(number.to_bits());
        } else if let Some((filled, len)) = heap.filled(v) {
            self.digest.add_all([filled as u64, len as u64].into_iter());
        }
    }

    fn function(&mut self, function: Value) {
        let code = self.code_of_function(function);
        self.digest.add_all([code.0, code.1].into_iter());
        // A lazy function of the library has its number in the place of captures.
        let heap = &self.vm.heap;
        let count = match code_kind(heap, function) {
            Some(CodeKind::Lazy) | None => 0,
            Some(CodeKind::Bytecode) => {
                let code = heap.function_code(function).and_then(|code| heap.code(code));
                code.map_or(0, |code| code.spare[1] as usize)
            }
            Some(CodeKind::Native | CodeKind::Undefined) => usize::MAX,
        };
        let captures = heap.function_captures(function).unwrap_or_default();
        self.values(&captures[..captures.len().min(count)]);
        if is_of_program(heap, function)
            && let Some(code) = heap.function_code(function)
        {
            self.constants(code);
        }
    }

    /// Mixes in the constants of a code of the program that can change: symbols of no package, which have
    /// values, and objects with parts, which a program makes by `load-time-value`.
    fn constants(&mut self, code: Value) {
        if self.is_strict {
            return;
        }
        for &v in self.vm.heap.code_constants(code).unwrap_or_default() {
            let can_change = match self.vm.heap.kind(v) {
                None => v.is_cons(),
                Some(Kind::Symbol) => self.symbol(v).is_none(),
                Some(
                    Kind::Package | Kind::Class | Kind::Ratio | Kind::Complex | Kind::Float | Kind::Bignum,
                ) => false,
                Some(_) => true,
            };
            if can_change {
                self.value(v);
            }
        }
    }

    /// Returns the digest of the code of a function: for one of the library its number.
    pub(super) fn code_of_function(&mut self, function: Value) -> Digest {
        match image_origin(self.heap(), function) {
            Some((image, number)) => Digest(image as u64, u64::from(number)),
            None => self.heap().function_code(function).map_or(Digest::default(), |code| self.code(code)),
        }
    }

    /// Returns the digest of a code: of its words, their places in the source, and its constants.
    fn code(&mut self, code: Value) -> Digest {
        if let Some(&digest) = self.known.codes.get(&code.bits()) {
            return digest;
        }
        let heap = &self.vm.heap;
        let mut digest = Digest(1, 1);
        let words = unfused(heap.code_words(code).unwrap_or_default());
        digest.add_all(words.into_iter().map(u64::from));
        let mut open: Vec<Value> = heap.code(code).map_or(Vec::new(), |code| vec![code.debug, code.name]);
        open.extend(heap.code_constants(code).unwrap_or_default());
        // Constants are not looked into further than a look shows; the places in the source tell the rest.
        for v in open.into_iter().rev() {
            match heap.kind(v) {
                Some(Kind::Function | Kind::Code) => digest.add(2),
                Some(Kind::Record) => {
                    let slots = heap.record(v, Kind::Record).unwrap_or_default();
                    let places = slots.iter().find_map(|&slot| heap.words(slot)).unwrap_or_default();
                    digest.add_all(places.iter().map(|&word| u64::from(word)));
                }
                _ => digest.add_text(&self.vm.describe(v)),
            }
        }
        self.known.codes.insert(code.bits(), digest);
        digest
    }

    /// Returns the registers that a function may still read, by place.
    pub(super) fn live(&mut self, function: Value) -> Rc<Live> {
        let digest = self.code_of_function(function);
        if let Some(live) = self.known.live.get(&digest) {
            return live.clone();
        }
        let heap = &self.vm.heap;
        let code = heap.function_code(function).unwrap_or(Value::NIL);
        let words = heap.code_words(code).unwrap_or_default();
        let captures = heap.code(code).map_or(0, |code| code.spare[1] as usize);
        let words = &words[..words.len().saturating_sub(captures)];
        let live = Rc::new(Live::of(heap, &unfused(words), heap.code_constants(code).unwrap_or_default()));
        self.known.live.insert(digest, live.clone());
        live
    }
}
