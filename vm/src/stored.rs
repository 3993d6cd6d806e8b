//! The state of a machine between two turns as bytes, from which another process goes on.
//!
//! The other process makes a machine by the same steps up to the beginning of the program: with the same
//! library, the same functions of the host, and a heap in the same range of addresses. Then it replaces the
//! state of that machine. So addresses mean the same, also those of instructions; parts of the
//! process, such as the library's image and the functions of the host, are those of the new machine.
//! Machine code is left out, and made again.
//!
//! The structs are taken apart without `..`, as in `snapshot`: a new field does not compile until it
//! is stored, or named as one that need not be.
//!
//! Guarantees: after [`Vm::load_state`] the machine goes on as the other one did after [`Vm::store_state`],
//! to the tick, the work of the collector included.
//!
//! Not here: the journal, the file and its checksum (`esl-durable`); copies for explorations ([`Vm::save`]).
//! There is no such state while a query or a compilation is under way.

use esl_bytecode::compile::SourcePlace;
use esl_bytecode::datum::Datum;
pub use esl_heap::fork::{Fork, ForkContents};
use esl_heap::store::{Stored, StoredBytes};
use esl_host::{ActionId, ProcessSignal};

use crate::embedder::Embedder;
use crate::exchange::{Charges, Exchange};
use crate::heap::HeapMemory;
use crate::interp::stubs;
use crate::lookup::Lookups;
use crate::outside::{ExpectedOperators, Outside};
use crate::task::{Task, TaskId};
use crate::tier::CompiledFunctions;
use crate::trust;
pub use crate::trust::MachineState;
use crate::vm::Vm;
use crate::wait::input::{self, WhenFull};

esl_heap::stored_enum! { ExpectedOperators { None = 0, MayCome = 1, IsAwaited = 2 } }

/// Written first, and compared: a machine with other parts has another state.
fn signature() -> u64 {
    let parts = [cfg!(feature = "native"), cfg!(debug_assertions)];
    parts.into_iter().fold(size_of::<Vm>() as u64, |word, has| word << 1 | u64::from(has))
}

/// Bytes of the length that comes first.
const LENGTH: usize = size_of::<u64>();

/// The state of a machine between two turns, while it stands still.
pub struct StateParts<'m> {
    head: Vec<u8>,
    memory: HeapMemory<'m>,
}

impl StateParts<'_> {
    /// Returns the first bytes of the state.
    pub fn head(&self) -> &[u8] {
        &self.head
    }

    /// Returns the memory, which is the rest.
    pub fn memory(&self) -> &HeapMemory<'_> {
        &self.memory
    }

    /// Returns a copy of the state.
    pub fn to_state(&self) -> MachineState {
        let mut bytes = Vec::with_capacity(self.head.len() + self.memory.bytes());
        bytes.extend_from_slice(&self.head);
        self.memory.append_to(&mut bytes);
        MachineState::from_trusted_bytes(bytes)
    }
}

impl Vm {
    /// Returns the state of the machine, between two turns. `None` if it cannot have one: its memory is not
    /// in a range of addresses of its own ([`Config::range`](crate::vm::Config::range)); and while there is
    /// something under way that cannot be stored: a query, a compilation, a call from outside that goes
    /// first.
    pub fn store_state(&mut self) -> Option<MachineState> {
        self.with_state(|parts| parts.to_state())
    }

    /// Calls a function with the state of the machine, as [`Vm::store_state`] returns it, before its memory
    /// is copied.
    pub fn with_state<T>(&mut self, function: impl FnOnce(&StateParts<'_>) -> T) -> Option<T> {
        let Vm {
            heap,
            names,
            compiler,
            database,
            scheduler,
            outside,
            cpu: _,
            natives: _,
            compiled,
            exchange,
            watch: _,
            embedder,
            between_rounds: _,
            config: _,
        } = self;
        if !stubs::are_placed()
            || !compiler.jobs.is_empty()
            || !outside.answers.is_empty()
            || embedder.first.is_some()
            || !embedder.deferred.is_empty()
            || !database.is_quiet()
        {
            return None;
        }
        let mut out = vec![0; LENGTH];
        signature().store(&mut out);
        names.store(&mut out);
        database.store(&mut out);
        if !scheduler.store(&mut out) {
            return None;
        }
        store_outside(outside, &mut out);
        store_exchange(exchange, &mut out);
        store_embedder(embedder, &mut out);
        compiled.lead_to_interpreter(true);
        let result = heap.store_contents(&mut out).map(|memory| {
            let length = (out.len() - LENGTH) as u64;
            out[..LENGTH].copy_from_slice(&length.to_le_bytes());
            function(&StateParts { head: out, memory })
        });
        compiled.lead_to_interpreter(false);
        result
    }

    /// Makes the state of the machine one that was stored in a machine that was made by the same steps.
    /// Returns whether that was possible; if not, the machine is of no use any more.
    ///
    /// Values that the machine has handed out before are of no use any more, even if they were pinned.
    #[must_use]
    pub fn load_state(&mut self, state: &MachineState) -> bool {
        stubs::are_placed() && self.load(state).is_some()
    }

    fn load(&mut self, state: &MachineState) -> Option<()> {
        let mut memory = trust::stored_bytes(state);
        let length = u64::load(&mut memory)?;
        let from = &mut memory.take_part(usize::try_from(length).ok()?)?;
        if u64::load(from)? != signature() {
            return None;
        }
        self.compiled = CompiledFunctions { tier: self.compiled.tier, ..CompiledFunctions::default() };
        self.names.load(from)?;
        self.database = Stored::load(from)?;
        self.scheduler.load(from)?;
        load_outside(&mut self.outside, from)?;
        self.exchange = load_exchange(from)?;
        self.embedder = load_embedder(from)?;
        trust::load_heap(&mut self.heap, from, &mut memory)?;
        self.tell_inbox();
        (from.is_empty() && memory.is_empty()).then_some(())
    }

    /// Begins an operation again that is under way by the state of the machine, but has ended with its
    /// process. Returns whether there is such an operation, and such a function of the host.
    pub fn begin_again(&mut self, number: u64, name: &str, arguments: &[Datum], action: ActionId) -> bool {
        if !self.outside.begin_again(number, name, arguments, action) {
            return false;
        }
        let Some(open) = self.outside.operations.open.get(&number) else { return false };
        let is_of_it = |task: &&Task| task.number == open.begun_by;
        if self.scheduler.tasks.iter().find(is_of_it).is_some_and(|task| task.flags.suspended()) {
            open.canceller.suspend(true);
        }
        if open.is_cancelled {
            open.canceller.cancel();
        }
        true
    }

    /// Returns the number of the object that stands for a thing of the host with this identity, the same in
    /// every process of the run; `None` if the program does not hold it.
    pub fn number_of_thing(&self, identity: usize) -> Option<u64> {
        self.names.opaques.number_of(identity)
    }

    /// Returns the datum of a thing of the host by that number.
    pub fn thing_numbered(&self, number: u64) -> Option<Datum> {
        self.names.opaques.numbered(number).cloned()
    }

    /// Tells a new inbox of the inputs and of the handled signals, as the program has told the one before.
    fn tell_inbox(&self) {
        let inbox = &self.outside.inbox;
        inbox.note_none_handled();
        let handled = self.embedder.handlers.keys();
        handled
            .filter_map(|&number| ProcessSignal::from_number(number.into()))
            .for_each(|signal| inbox.note_handled(signal));
        for (name, &object) in &self.outside.inputs {
            let waits = input::when_full(&self.heap, object) == WhenFull::Wait;
            inbox.open_input(name, waits.then(|| input::capacity(&self.heap, object)));
            if waits {
                inbox.note_kept(name, input::size(&self.heap, object));
            }
        }
    }

    /// Returns the start of the range of addresses in which the machine has its memory, if there is one.
    pub fn heap_range(&self) -> Option<usize> {
        self.heap.range()
    }

    /// Returns the main task of the program.
    pub fn main_task(&self) -> Option<TaskId> {
        self.scheduler.main
    }

    /// Returns the numbers of the operations that are under way.
    pub fn open_operations(&self) -> Vec<u64> {
        self.outside.operations.open.keys().copied().collect()
    }
}

fn store_outside(outside: &Outside, out: &mut Vec<u8>) {
    let Outside {
        host,
        inbox: _,
        console,
        functions: _,
        found: _,
        calls,
        arguments: _,
        answers: _,
        operations,
        inputs,
        senders,
        attendance,
        complaints: _,
        exit_status,
    } = outside;
    host.canary().store(out);
    console.store(out);
    calls.store(out);
    operations.store(out);
    inputs.store(out);
    senders.store(out);
    attendance.store(out);
    exit_status.store(out);
}

fn load_outside(outside: &mut Outside, from: &mut StoredBytes<'_>) -> Option<()> {
    outside.host.set_canary(Stored::load(from)?);
    outside.console = Stored::load(from)?;
    outside.calls = Stored::load(from)?;
    outside.operations = Stored::load(from)?;
    outside.inputs = Stored::load(from)?;
    outside.senders = Stored::load(from)?;
    outside.attendance = Stored::load(from)?;
    outside.exit_status = Stored::load(from)?;
    outside.answers.clear();
    Some(())
}

fn store_exchange(exchange: &Exchange, out: &mut Vec<u8>) {
    let Exchange {
        values,
        raised: _,
        requested_call: _,
        lookups,
        charges: _,
        collected_at,
        overhead,
        sought: _,
        found: _,
    } = exchange;
    values.store(out);
    lookups.last.store(out);
    collected_at.store(out);
    overhead.store(out);
}

fn load_exchange(from: &mut StoredBytes<'_>) -> Option<Exchange> {
    let values = Stored::load(from)?;
    let lookups = Lookups::after(Stored::load(from)?);
    Some(Exchange {
        values,
        raised: None,
        requested_call: Vec::new(),
        lookups,
        charges: Charges::default(),
        collected_at: Stored::load(from)?,
        overhead: Stored::load(from)?,
        sought: None,
        found: None,
    })
}

fn store_embedder(embedder: &Embedder, out: &mut Vec<u8>) {
    let Embedder {
        pinned,
        calls,
        first: _,
        deferred: _,
        kept,
        kept_so_far,
        interruptible,
        handlers,
        signal_waits,
        ended_by,
        is_ending,
        is_cut_short,
        last_words,
        last_place,
    } = embedder;
    pinned.store(out);
    calls.store(out);
    kept.store(out);
    kept_so_far.store(out);
    interruptible.store(out);
    handlers.store(out);
    signal_waits.store(out);
    ended_by.store(out);
    (*is_ending, *is_cut_short).store(out);
    last_words.store(out);
    let place = last_place.as_ref().map(|place| (place.source.clone(), place.line, place.column));
    place.store(out);
}

fn load_embedder(from: &mut StoredBytes<'_>) -> Option<Embedder> {
    let (pinned, calls) = (Stored::load(from)?, Stored::load(from)?);
    let (kept, kept_so_far) = (Stored::load(from)?, Stored::load(from)?);
    let (interruptible, handlers) = (Stored::load(from)?, Stored::load(from)?);
    let (signal_waits, ended_by) = (Stored::load(from)?, Stored::load(from)?);
    let (is_ending, is_cut_short) = Stored::load(from)?;
    let last_words = Stored::load(from)?;
    let place: Option<(String, u32, u32)> = Stored::load(from)?;
    Some(Embedder {
        pinned,
        calls,
        kept,
        kept_so_far,
        interruptible,
        handlers,
        signal_waits,
        ended_by,
        is_ending,
        is_cut_short,
        last_words,
        last_place: place.map(|(source, line, column)| SourcePlace { source, line, column }),
        ..Embedder::default()
    })
}
