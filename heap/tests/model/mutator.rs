//! The actions of a program on the heap: it makes objects, stores, and forgets.

use super::*;

impl Model {
    /// Some value that the running task can get at without reading the heap.
    pub(super) fn pick(&mut self) -> Shade {
        let stack = &self.tasks[self.running].values;
        match self.random.below(8) {
            0 => Shade::Plain(Value::small(self.random.next() as i32)),
            1 => self.globals[self.random.below(GLOBALS)],
            _ if stack.is_empty() => Shade::Plain(Value::NIL),
            _ => stack[self.random.below(stack.len())],
        }
    }

    /// Some object that the running task can get at, by a few reads of the heap.
    pub(super) fn pick_object(&mut self) -> Option<usize> {
        let mut found = None;
        let mut shade = self.pick();
        for _ in 0..self.random.below(6) {
            let Shade::Object(object) = shade else { break };
            found = Some(object);
            let slots = &self.shadows[&object].slots;
            if slots.is_empty() {
                break;
            }
            shade = slots[self.random.below(slots.len())];
        }
        found
    }

    /// A length: mostly short, sometimes medium, rarely large.
    pub(super) fn length(&mut self) -> usize {
        let scale = if cfg!(miri) { 16 } else { 1 };
        self.bulk
            * match self.random.below(64) {
                0 => self.random.below(4000) / scale,
                1..4 => self.random.below(900) / scale,
                4..20 => self.random.below(40),
                _ => self.random.below(6),
            }
    }

    /// Makes an object of random values with its shadow; collects when the heap says so.
    pub(super) fn make(
        &mut self,
        kind: Option<Kind>,
        slots: usize,
        raw_len: usize,
    ) -> Result<Shade, AllocError> {
        let mut shades: Vec<Shade> = (0..slots).map(|_| self.pick()).collect();
        match kind {
            Some(Kind::Function) => shades[0] = self.globals[CODE],
            Some(Kind::Symbol) => shades[3] = self.globals[FUNCTION],
            _ => {}
        }
        let object = self.next_object;
        let value = match self.make_value(object, kind, &shades, raw_len) {
            Err(AllocError::NeedCollection) => {
                self.collect_fully(&shades);
                self.totals.forced += 1;
                self.make_value(object, kind, &shades, raw_len)?
            }
            other => other?,
        };
        self.next_object += 1;
        let len = self.heap.header(value).map_or(0, |header| header.len as usize);
        let bytes = kind.map_or(16, |kind| kind.size(len)) as u64;
        self.shadows.insert(object, Shadow { value, kind, slots: shades, raw_len, bytes });
        self.may_survive.insert(object);
        Ok(Shade::Object(object))
    }

    pub(super) fn make_value(
        &mut self,
        object: usize,
        kind: Option<Kind>,
        shades: &[Shade],
        raw_len: usize,
    ) -> Result<Value, AllocError> {
        let values: Vec<Value> = shades.iter().map(|&shade| self.value(shade)).collect();
        let raw: Vec<u32> = (0..raw_len).map(|i| raw_element(object, i)).collect();
        let heap = &mut self.heap;
        let Some(kind) = kind else { return heap.cons(values[0], values[1]) };
        match kind {
            Kind::Code => {
                let parts = CodeParts {
                    name: values[0],
                    debug: values[1],
                    owner: values[2],
                    arity: CodeObject::ANY_ARITY,
                    nregs: 3,
                    spare: [0; 2],
                    constants: &values[3..],
                    words: &raw,
                };
                // SAFETY: this code is not run.
                unsafe { heap.alloc_code(parts) }
            }
            // SAFETY: the code of this function is not run.
            Kind::Function => unsafe { heap.alloc_function(values[0], &values[1..]) },
            Kind::Box => heap.alloc_box(values[0]),
            Kind::Structure => heap.alloc_structure(values[0], &values[1..]),
            Kind::Symbol => {
                let symbol = heap.alloc_symbol(0, values[0], values[1], values[3])?;
                heap.symbol_set_value(symbol, values[2]).unwrap();
                heap.symbol_set_macro_function(symbol, values[4]).unwrap();
                heap.symbol_set_plist(symbol, values[5]).unwrap();
                Ok(symbol)
            }
            Kind::String => heap.alloc_string(&raw),
            Kind::Words32 => {
                let words = heap.alloc_words(raw_len, 0)?;
                heap.words_mut(words).unwrap().copy_from_slice(&raw);
                Ok(words)
            }
            Kind::Bytes => heap.alloc_bytes(&raw.iter().map(|&x| x as u8).collect::<Vec<_>>()),
            Kind::Bignum => heap.alloc_bignum(true, &raw.iter().map(|&x| u64::from(x)).collect::<Vec<_>>()),
            _ => heap.alloc_record(kind, 0, 0, &values),
        }
    }

    pub(super) fn allocate(&mut self) -> Result<(), AllocError> {
        let len = self.length();
        let class_and_more = len + 1;
        let made = match self.random.below(16) {
            0..6 => self.make(None, 2, 0),
            6..9 => self.make(Some(Kind::SimpleVector), len, 0),
            9 => self.make(Some(Kind::Box), 1, 0),
            10 => self.make(Some(Kind::Function), 1 + len % 4, 0),
            11 => self.make(Some(Kind::Code), 3 + len, self.random.0 as usize % 9),
            12 => {
                let name = self.make(Some(Kind::String), 0, len)?;
                self.tasks[self.running].values.push(name);
                self.make_with(Kind::Symbol, 6, name)
            }
            13 => {
                let class = self.make(Some(Kind::Class), len % 7, 0)?;
                self.tasks[self.running].values.push(class);
                self.make_with(Kind::Structure, class_and_more, class)
            }
            14 => self.make(Some([Kind::String, Kind::Bytes, Kind::Words32][len % 3]), 0, len),
            _ => self.make(Some(Kind::Bignum), 0, 1 + len),
        };
        self.tasks[self.running].values.push(made?);
        Ok(())
    }

    /// Moves the values of the running task's stack into a new vector, or forgets them: so structures grow
    /// deep, and most objects are in use through the heap alone.
    pub(super) fn bundle(&mut self) {
        let values = std::mem::take(&mut self.tasks[self.running].values);
        if self.random.one_in(8) {
            return;
        }
        let (slots, first) = (values.len(), values[0]);
        if let Ok(vector) = self.make_with(Kind::SimpleVector, slots, first) {
            let Shade::Object(object) = vector else { unreachable!("a vector is an object") };
            for (index, &shade) in values.iter().enumerate() {
                let shadow = self.shadows.get_mut(&object).unwrap();
                shadow.slots[index] = shade;
                let (v, new) = (shadow.value, self.value(shade));
                self.heap.vector_set(v, index, new).unwrap();
            }
            self.tasks[self.running].values.push(vector);
        }
    }

    /// As `make`, with a given first slot.
    pub(super) fn make_with(&mut self, kind: Kind, slots: usize, first: Shade) -> Result<Shade, AllocError> {
        let mut shades: Vec<Shade> = (0..slots).map(|_| self.pick()).collect();
        shades[0] = first;
        if kind == Kind::Symbol {
            shades[3] = self.globals[FUNCTION];
        }
        let object = self.next_object;
        let value = self.make_value(object, Some(kind), &shades, 0)?;
        self.next_object += 1;
        let bytes = kind.size(slots) as u64;
        self.shadows.insert(object, Shadow { value, kind: Some(kind), slots: shades, raw_len: 0, bytes });
        self.may_survive.insert(object);
        Ok(Shade::Object(object))
    }

    pub(super) fn forget_much(&mut self) {
        for task in 0..self.tasks.len() {
            self.enter(task);
            self.tasks[task].values.clear();
        }
    }

    /// Overwrites a slot of an object, through the heap's own functions, which hold the barrier. The running
    /// task may have read the old value first, and then holds the only reference to it.
    pub(super) fn store(&mut self) {
        let Some(object) = self.pick_object() else { return };
        let new = self.pick();
        let reads = self.random.one_in(2);
        let value = self.value(new);
        let shadow = self.shadows.get_mut(&object).unwrap();
        if shadow.slots.is_empty() {
            return;
        }
        let index = self.random.below(shadow.slots.len());
        let heap = &mut self.heap;
        let old = heap_slots(heap, shadow.kind, shadow.value)[index];
        let tests_barrier = heap.phase() == Phase::Marking && !heap.is_marked(old);
        let stored = match shadow.kind {
            None if index == 0 => heap.set_car(shadow.value, value),
            None => heap.set_cdr(shadow.value, value),
            Some(Kind::SimpleVector) => heap.vector_set(shadow.value, index, value),
            Some(Kind::Symbol) => match index {
                2 => heap.symbol_set_value(shadow.value, value),
                3 => heap.symbol_set_function(shadow.value, value),
                4 => heap.symbol_set_macro_function(shadow.value, value),
                5 => heap.symbol_set_plist(shadow.value, value),
                _ => None,
            },
            Some(Kind::Function) if index > 0 => {
                // SAFETY: the code of this function is not run.
                unsafe { heap.function_set_capture(shadow.value, index - 1, value) }
            }
            Some(Kind::Structure) if index > 0 => heap.structure_set(shadow.value, index - 1, value),
            // Half of them as one of several slots.
            Some(kind) => match heap.slots_mut::<2>(shadow.value, kind) {
                Some(slots) if index < 2 => {
                    slots[index] = value;
                    Some(())
                }
                _ => heap.record_set(shadow.value, kind, index, value),
            },
        };
        if stored.is_some() {
            let old = std::mem::replace(&mut shadow.slots[index], new);
            if reads {
                self.tasks[self.running].values.push(old);
            }
            self.totals.barriers += usize::from(tests_barrier);
        }
    }
}
