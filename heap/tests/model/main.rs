//! The collector against a model: a random program over heap, globals and several task stacks, with slices of
//! the collector between any two of its steps, and a shadow of the object graph that says what must and what
//! may survive.
//!
//! Checked at the end of each marking: everything reachable is marked (nothing in use is freed), and nothing
//! is marked but what was reachable when the cycle began or was allocated since (garbage floats for at most
//! one cycle). Checked all the time: every object that the program meets holds what the shadow says. The
//! stacks follow the rule that the collector is built on: a stack is scanned before its task runs in a cycle,
//! otherwise any time, once.

#![allow(unsafe_code, reason = "tests keep the promises that the heap asks of its owner")]

mod mutator;

use esl_heap::heap::layout::CodeObject;
use esl_heap::heap::{AllocError, CodeParts, Heap, HeapConfig, Kind, Phase, SliceOutcome};
use esl_heap::value::Value;
use std::collections::{BTreeMap, BTreeSet};

/// A small generator (splitmix64), so that a seed is all that a failure needs.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ z >> 31
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }

    fn one_in(&mut self, n: usize) -> bool {
        self.below(n) == 0
    }
}

/// A value as the shadow knows it: an object by number, or itself.
#[derive(Copy, Clone, PartialEq, Debug)]
enum Shade {
    Object(usize),
    Plain(Value),
}

/// The shadow of an object.
struct Shadow {
    value: Value,
    /// `None` is a cons.
    kind: Option<Kind>,
    /// The traced slots, in the order of the layout.
    slots: Vec<Shade>,
    /// Elements of a raw object; their contents follow from number and index.
    raw_len: usize,
    bytes: u64,
}

struct TaskStack {
    values: Vec<Shade>,
    scanned_in: u64,
}

struct Model {
    random: Random,
    heap: Heap,
    shadows: BTreeMap<usize, Shadow>,
    next_object: usize,
    /// Fixed roots: marked at the beginning of a cycle, overwritten through the barrier.
    globals: Vec<Shade>,
    tasks: Vec<TaskStack>,
    running: usize,
    /// Reachable when the cycle began, or allocated since.
    may_survive: BTreeSet<usize>,
    /// The collector gets a slice after one in so many steps.
    laziness: usize,
    /// Factor on the lengths of objects.
    bulk: usize,
    totals: Totals,
}

/// Counters that show that the test has reached the interesting places.
#[derive(Default, Debug)]
struct Totals {
    /// Cycles that ended in the ordinary way.
    cycles: usize,
    /// Collections because the limit was reached.
    forced: usize,
    /// Objects not marked yet whose address was overwritten while marking.
    barriers: usize,
}

const GLOBALS: usize = 8;
/// Globals that always hold a code and a function, for the objects that need one.
const CODE: usize = 0;
const FUNCTION: usize = 1;

fn raw_element(object: usize, index: usize) -> u32 {
    (object as u32).wrapping_mul(0x9E37_79B9).wrapping_add(index as u32) | 1
}

/// The slots of an object as the heap has them.
fn heap_slots(heap: &Heap, kind: Option<Kind>, v: Value) -> Vec<Value> {
    match kind {
        None => vec![heap.car(v).unwrap(), heap.cdr(v).unwrap()],
        Some(Kind::Code) => {
            let code = heap.code(v).unwrap();
            let mut slots = vec![code.name, code.debug, code.owner];
            slots.extend(heap.code_constants(v).unwrap());
            slots
        }
        Some(kind) if kind.is_record() => heap.record(v, kind).unwrap().to_vec(),
        Some(_) => vec![],
    }
}

impl Model {
    fn new(seed: u64, config: HeapConfig, laziness: usize, bulk: usize) -> Model {
        // SAFETY: the values stay in this model.
        let heap = unsafe { Heap::new(config) };
        let stack = || TaskStack { values: Vec::new(), scanned_in: 0 };
        let mut model = Model {
            random: Random(seed),
            heap,
            shadows: BTreeMap::new(),
            next_object: 0,
            globals: vec![Shade::Plain(Value::NIL); GLOBALS],
            tasks: (0..4).map(|_| stack()).collect(),
            running: 0,
            may_survive: BTreeSet::new(),
            laziness,
            bulk,
            totals: Totals::default(),
        };
        model.globals[CODE] = model.make(Some(Kind::Code), 3, 0).unwrap();
        model.globals[FUNCTION] = model.make(Some(Kind::Function), 1, 0).unwrap();
        model
    }

    fn value(&self, shade: Shade) -> Value {
        match shade {
            Shade::Object(object) => self.shadows[&object].value,
            Shade::Plain(value) => value,
        }
    }

    // The program.

    fn step(&mut self) {
        let running = self.running;
        match self.random.below(20) {
            // When the heap is full of reachable objects the program forgets most of them.
            0..6 => self.allocate().unwrap_or_else(|_| self.forget_much()),
            6..10 => self.store(),
            10..13 => {
                if let Some(object) = self.pick_object() {
                    self.verify(object);
                    let slots = &self.shadows[&object].slots;
                    if !slots.is_empty() {
                        let slot = slots[self.random.below(slots.len())];
                        self.tasks[running].values.push(slot);
                    }
                }
            }
            13..15 => {
                self.tasks[running].values.pop();
                if self.tasks[running].values.len() > 30 {
                    self.bundle();
                }
            }
            15 => {
                let new = self.pick();
                let global = 2 + self.random.below(GLOBALS - 2);
                let old = self.value(self.globals[global]);
                self.heap.log_if_marking(old);
                self.globals[global] = new;
            }
            16 => {
                // A message: it lands in a stack that may not have been scanned.
                let message = self.pick();
                let to = self.random.below(self.tasks.len());
                let stack = &mut self.tasks[to].values;
                if !stack.is_empty() && self.random.one_in(2) {
                    let slot = self.random.below(stack.len());
                    stack[slot] = message;
                } else {
                    stack.push(message);
                }
            }
            17 if self.tasks.len() < 12 => {
                // A new task is born scanned.
                let values = (0..3).map(|_| self.pick()).collect();
                self.tasks.push(TaskStack { values, scanned_in: self.heap.cycle_id() });
            }
            17 if self.random.one_in(20) => {
                let task = self.random.below(self.tasks.len());
                self.tasks.swap_remove(task);
                self.enter(0);
            }
            _ => self.enter(self.random.0 as usize % self.tasks.len()),
        }
    }

    /// Switches to a task; its stack is scanned first if it was not in this cycle.
    fn enter(&mut self, task: usize) {
        self.scan(task);
        self.running = task;
    }

    // The collector's driver.

    fn scan(&mut self, task: usize) {
        if self.tasks[task].scanned_in == self.heap.cycle_id() {
            return;
        }
        self.tasks[task].scanned_in = self.heap.cycle_id();
        let values: Vec<Value> = self.tasks[task].values.iter().map(|&shade| self.value(shade)).collect();
        self.heap.mark_slice(&values);
    }

    fn collector_step(&mut self) {
        match self.heap.phase() {
            Phase::Idle => {
                if self.heap.gc_due() || self.random.one_in(50) {
                    self.begin_cycle();
                }
            }
            Phase::Marking => {
                let visits = 1 + self.random.below(8) as u32;
                let SliceOutcome::Drained { .. } = self.heap.slice(visits) else { return };
                let waiting = |task: &TaskStack| task.scanned_in != self.heap.cycle_id();
                match self.tasks.iter().position(waiting) {
                    Some(task) => self.scan(task),
                    None => self.end_marking(),
                }
            }
            Phase::Sweeping => {
                let _ = self.heap.slice(1 + self.random.below(2000) as u32);
                if self.heap.phase() == Phase::Idle || self.random.one_in(100) {
                    self.heap.check().unwrap();
                }
            }
        }
    }

    fn begin_cycle(&mut self) {
        self.may_survive = self.reachable(&[]);
        self.heap.begin_cycle();
        let globals: Vec<Value> = self.globals.iter().map(|&shade| self.value(shade)).collect();
        self.heap.mark_slice(&globals);
        // The running task goes on, so its stack is due at once.
        self.scan(self.running);
    }

    fn end_marking(&mut self) {
        for object in self.reachable(&[]) {
            assert!(
                self.heap.is_marked(self.shadows[&object].value),
                "object {object} is in use and not marked: {:?} of {} bytes, snapshot {}",
                self.shadows[&object].kind,
                self.shadows[&object].bytes,
                self.may_survive.contains(&object),
            );
        }
        for (object, shadow) in &self.shadows {
            if self.heap.is_marked(shadow.value) {
                assert!(self.may_survive.contains(object), "object {object} was garbage and is marked");
            }
        }
        let heap = &self.heap;
        self.shadows.retain(|_, shadow| heap.is_marked(shadow.value));
        // SAFETY: everything reachable was seen to be marked just now.
        unsafe { self.heap.end_marking() };
        self.check_live();
        self.totals.cycles += 1;
    }

    fn check_live(&self) {
        let live: u64 = self.shadows.values().map(|shadow| shadow.bytes).sum();
        assert_eq!(self.heap.stats().live, live);
    }

    fn collect_fully(&mut self, extra: &[Shade]) {
        let mut roots: Vec<Shade> = self.globals.clone();
        roots.extend(self.tasks.iter().flat_map(|task| &task.values));
        roots.extend(extra);
        let values: Vec<Value> = roots.iter().map(|&shade| self.value(shade)).collect();
        let reachable = self.reachable(extra);
        self.shadows.retain(|object, _| reachable.contains(object));
        // SAFETY: `values` are all roots of the model and what the caller holds.
        unsafe { self.heap.collect_fully(|heap| heap.mark_slice(&values)) };
        self.may_survive = reachable;
        self.check_live();
        self.heap.check().unwrap();
        for task in &mut self.tasks {
            task.scanned_in = self.heap.cycle_id();
        }
    }

    // The oracle.

    fn reachable(&self, extra: &[Shade]) -> BTreeSet<usize> {
        let mut found = BTreeSet::new();
        let mut open: Vec<Shade> = self.globals.clone();
        open.extend(self.tasks.iter().flat_map(|task| &task.values));
        open.extend(extra);
        while let Some(shade) = open.pop() {
            if let Shade::Object(object) = shade
                && found.insert(object)
            {
                open.extend(&self.shadows[&object].slots);
            }
        }
        found
    }

    /// Compares an object with its shadow.
    fn verify(&self, object: usize) {
        let shadow = &self.shadows[&object];
        let (heap, v) = (&self.heap, shadow.value);
        let expected: Vec<Value> = shadow.slots.iter().map(|&shade| self.value(shade)).collect();
        assert_eq!(heap.kind(v), shadow.kind, "object {object}");
        assert_eq!(heap_slots(heap, shadow.kind, v), expected, "slots of object {object}");
        let mut raw = (0..shadow.raw_len).map(|i| raw_element(object, i));
        let same = match shadow.kind {
            Some(Kind::Code) => heap.code_words(v).unwrap().iter().copied().eq(raw),
            Some(Kind::String) => heap.string(v).unwrap().iter().copied().eq(raw),
            Some(Kind::Words32) => heap.words(v).unwrap().iter().copied().eq(raw),
            Some(Kind::Bytes) => heap.bytes(v).unwrap().iter().copied().eq(raw.map(|x| x as u8)),
            Some(Kind::Bignum) => heap.bignum(v).unwrap().limbs.iter().copied().eq(raw.map(u64::from)),
            _ => raw.next().is_none(),
        };
        assert!(same, "contents of object {object}");
    }

    fn verify_reachable(&self) {
        for object in self.reachable(&[]) {
            self.verify(object);
        }
    }

    fn run(&mut self, steps: usize) {
        for step in 0..steps {
            self.step();
            if self.random.one_in(self.laziness) {
                self.collector_step();
            }
            if step % 1000 == 999 {
                self.verify_reachable();
            }
        }
        self.verify_reachable();
        self.collect_fully(&[]);
        self.verify_reachable();
        // Nothing but the globals' garbage is left when everything is forgotten, and the memory is given
        // back.
        self.tasks.iter_mut().for_each(|task| task.values.clear());
        self.globals.iter_mut().for_each(|global| *global = Shade::Plain(Value::NIL));
        self.collect_fully(&[]);
        assert_eq!(self.heap.stats().live, 0);
        assert!(self.heap.stats().committed <= 2 << 20);
    }
}

fn run(seeds: std::ops::Range<u64>, laziness: usize, bulk: usize, config: HeapConfig) -> Totals {
    let (seeds, steps) = if cfg!(miri) { (seeds.start..seeds.start + 1, 500) } else { (seeds, 10_000) };
    let mut totals = Totals::default();
    for seed in seeds {
        // The seed is what a failure needs to be repeated.
        let outcome = std::panic::catch_unwind(|| {
            let mut model = Model::new(seed, config.clone(), laziness, bulk);
            model.run(steps);
            model.totals
        });
        let one = outcome.unwrap_or_else(|_| panic!("seed {seed} fails with {config:?}"));
        totals.cycles += one.cycles;
        totals.forced += one.forced;
        totals.barriers += one.barriers;
    }
    totals
}

#[test]
fn what_is_in_use_survives() {
    let config = HeapConfig { cycle_floor: 64 << 10, ..HeapConfig::default() };
    let totals = run(0..6, 5, 1, config);
    assert!(cfg!(miri) || totals.cycles > 20 && totals.barriers > 50, "{totals:?}");
}

#[test]
fn what_is_in_use_survives_a_full_mark_stack() {
    let config = HeapConfig { cycle_floor: 64 << 10, mark_stack: 3, ..HeapConfig::default() };
    let totals = run(100..106, 5, 1, config);
    assert!(cfg!(miri) || totals.cycles > 20 && totals.barriers > 50, "{totals:?}");
}

#[test]
fn what_is_in_use_survives_at_the_limit() {
    // One arena, and half as much for large objects; arenas are smaller under Miri.
    let (limit, bulk) = if cfg!(miri) { (3 << 15, 1) } else { (3 << 19, 5) };
    let config = HeapConfig { limit, cycle_floor: 1 << 20, ..HeapConfig::default() };
    let totals = run(200..206, 20, bulk, config);
    assert!(cfg!(miri) || totals.cycles > 5 && totals.forced > 5, "{totals:?}");
}
