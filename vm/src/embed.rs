//! The embedder's API beside running tasks: making a machine, data in and out, functions of the embedder's,
//! settings.

use std::fmt;

use esl_bytecode::datum::Datum;
use esl_database::Database;
use esl_host::machine::Canary;
use esl_host::{CallEffect, Host, Inbox, Incoming, Output, ProcessSignal};

use crate::builtins::NATIVES;
use crate::compiler::Compilations;
use crate::config::Config;
use crate::cpu::Cpu;
use crate::datum;
use crate::describe::describe;
use crate::embedder::Embedder;
use crate::exchange::Exchange;
use crate::heap::{AllocError, HeapConfig, HeapStats, Kind};
use crate::interp::start::make_starter;
use crate::names::{Names, class};
use crate::observe::Watch;
use crate::outside::{Given, Outside};
use crate::overhead::CollectionOverhead;
use crate::raise::Exit;
use crate::schedule::{Choices, Clock, Scheduler};
use crate::task::TaskId;
use crate::tier::{CompiledFunctions, Tier, TierReport};
use crate::trust;
use crate::value::Value;
use crate::vm::Vm;
use crate::wait::event;

pub use crate::datum::Atom;
pub use crate::datum::DatumError as ExportError;
pub use esl_host::{DataFunction, HostFunction, HostRow, Need};

/// Reason why a function of the library could not be called.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum LibraryError {
    /// The library has no function of this name.
    Missing(String),
    /// Not enough memory for it.
    NoMemory,
}

impl fmt::Display for LibraryError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            LibraryError::Missing(name) => write!(f, "the library has no function {name}"),
            LibraryError::NoMemory => f.write_str("not enough memory for a task"),
        }
    }
}

impl std::error::Error for LibraryError {}

impl Vm {
    /// Creates a machine without a library.
    ///
    /// # Errors
    /// [`AllocError`] if the limit of memory leaves no room for what every machine has.
    pub fn new(config: Config, host: Box<dyn Host + Send>) -> Result<Vm, AllocError> {
        let heap_config = HeapConfig {
            limit: config.memory,
            images: config.snapshots,
            range: config.range,
            ..HeapConfig::default()
        };
        let mut heap = trust::new_heap(heap_config);
        let names = Names::new(&mut heap)?;
        let starter = make_starter(&mut heap)?;
        let any_event = event::make(&mut heap, Value::NIL)?;
        Ok(Vm {
            heap,
            names,
            compiler: Compilations::default(),
            database: Database::default(),
            scheduler: Scheduler::new(config.seed, Clock::of(&*host), starter, any_event),
            outside: Outside::new(host),
            cpu: Cpu::new(),
            natives: &NATIVES,
            exchange: Exchange::new(),
            watch: Watch::default(),
            between_rounds: None,
            compiled: CompiledFunctions::default(),
            embedder: Embedder { pinned: vec![starter, any_event], ..Embedder::default() },
            config,
        })
    }

    /// Creates a machine without a library and with a captured outside, for the unit tests of this crate.
    #[cfg(test)]
    pub(crate) fn for_tests() -> Vm {
        let host = Box::new(esl_host::VirtualHost::new());
        Vm::new(Config::default(), host).expect("there is room for an empty machine")
    }

    /// Returns the limits and settings.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// Sets how functions run from now on.
    #[cfg(not(feature = "native"))]
    pub fn set_tier(&mut self, tier: Tier) {
        self.compiled.tier = tier;
        if tier != Tier::Interpreter {
            self.compiled.report.refused =
                Some("this program was built without the cargo feature `native`".into());
        }
    }

    /// Returns how functions run, and figures of the machine code made so far.
    pub fn tier(&self) -> (Tier, &TierReport) {
        (self.compiled.tier, &self.compiled.report)
    }

    /// Returns the inbox, through which other threads reach the run.
    pub fn inbox(&self) -> Inbox {
        self.outside.inbox.clone()
    }

    /// Returns the canary of the run so far: a hash of the turns of its tasks and of the questions to its
    /// host, with which runs are compared. It does not depend on addresses, nor on the portions of the run.
    pub fn canary(&self) -> u64 {
        self.check().canary
    }

    /// Returns the status that the program has asked to end with.
    pub fn exit_status(&self) -> Option<u8> {
        self.outside.exit_status
    }

    /// Returns the status with which the program has asked to end, and forgets it: calls from then on belong
    /// to another run.
    pub fn take_exit_status(&mut self) -> Option<u8> {
        self.outside.exit_status.take()
    }

    /// Names the task that a signal of the process aborts; reports call it the main task. A signal that has
    /// come while there was none is for this one.
    pub fn set_interruptible(&mut self, id: Option<TaskId>) {
        self.embedder.interruptible = id;
        if let Some(task) = id.and_then(|id| self.scheduler.tasks.get(id)) {
            self.scheduler.main_number = Some(task.number);
            if let Some(signal) = self.embedder.signal_waits.take() {
                self.outside.inbox.put(Incoming::Signal(signal));
            }
        }
    }

    /// Returns the signal of the process that has ended the run, or the task that was named for it.
    pub fn ended_by(&self) -> Option<ProcessSignal> {
        self.embedder.ended_by
    }

    /// Returns the signal of the process that has ended the run, or came while no task was named.
    pub fn asked_to_end(&self) -> Option<ProcessSignal> {
        self.embedder.ended_by.or(self.embedder.signal_waits)
    }

    /// Sets how choices are made where the language leaves the order of tasks open.
    pub fn set_choices(&mut self, choices: Choices) {
        self.scheduler.choices = choices;
    }

    /// Returns how choices are made, with those made so far.
    pub fn choices(&self) -> &Choices {
        &self.scheduler.choices
    }

    /// Keeps a value from being collected, until [`Vm::unpin`].
    pub fn pin(&mut self, value: Value) {
        self.embedder.pin(&mut self.heap, value);
    }

    /// Returns whether a value is a function.
    pub fn is_function(&self, value: Value) -> bool {
        self.heap.is(value, Kind::Function)
    }

    /// Lets go of a pinned value.
    pub fn unpin(&mut self, value: Value) {
        self.embedder.unpin(value);
    }

    /// Adds a function of the embedder's, which `%call-host` or `%begin-operation` reach by its name, in
    /// place of an earlier one of this name.
    pub fn add_host_function(&mut self, name: &str, function: HostFunction) {
        self.add_guarded_function(name, function, &[]);
    }

    /// As [`Vm::add_host_function`]; a call fails unless the program has the rights that the function needs.
    pub fn add_guarded_function(&mut self, name: &str, function: HostFunction, needs: &[Need]) {
        self.add_function_with(name, function, needs, CallEffect::default());
    }

    /// As [`Vm::add_guarded_function`], of a function with a declared effect.
    pub fn add_function_with(
        &mut self,
        name: &str,
        function: HostFunction,
        needs: &[Need],
        effect: CallEffect,
    ) {
        self.outside.functions.insert(name.into(), Given { function, needs: needs.to_vec(), effect });
    }

    /// Adds a function of the host that a row declares, in place of an earlier one of its name.
    pub fn add_host_row(&mut self, row: HostRow) {
        self.add_function_with(row.name, row.function, &row.needs, row.effect);
    }

    /// Returns the functions of the embedder's: their names,
    /// whether they begin operations, and what they need.
    pub fn host_functions(&self) -> impl Iterator<Item = (&str, bool, &[Need])> {
        self.outside.functions.iter().map(|(name, given)| {
            let is_operation = matches!(given.function, HostFunction::Operation(_));
            (name.as_str(), is_operation, given.needs.as_slice())
        })
    }

    /// Returns a value as data. Objects that no data stands for, such as functions and hash tables, become
    /// opaque data that describe them.
    ///
    /// # Errors
    /// [`ExportError`] if the value is circular, or too large.
    pub fn export(&mut self, value: Value) -> Result<Datum, ExportError> {
        let (datum, work) = datum::export(&self.heap, &self.names, value, describe)?;
        self.exchange.charge(work);
        Ok(datum)
    }

    /// Returns the atom that a value is, if it is one: [`Vm::export`] of the others.
    pub fn export_atom(&mut self, value: Value) -> Option<Atom> {
        let atom = datum::atom_of(&self.heap, value)?;
        self.exchange.charge(datum::WORK_OF_ATOM);
        Some(atom)
    }

    /// Returns an atom as a value.
    ///
    /// # Errors
    /// [`Exit::Collect`] without room.
    pub fn import_atom(&mut self, atom: Atom) -> Result<Value, Exit> {
        let value = datum::value_of_atom(&mut self.heap, atom)?;
        self.exchange.charge(datum::WORK_OF_ATOM);
        Ok(value)
    }

    /// Returns data as a value.
    ///
    /// # Errors
    /// [`Exit::Collect`] without room.
    pub fn import(&mut self, datum: &Datum) -> Result<Value, Exit> {
        let (value, work) = datum::import(&mut self.heap, &mut self.names, datum)?;
        self.exchange.charge(work);
        Ok(value)
    }
}

impl Vm {
    /// Returns the function of the library with this name, internal to the package `ESL`.
    ///
    /// # Errors
    /// [`LibraryError`] if the library has none, or there is no memory for its name.
    pub fn library_function(&mut self, name: &str) -> Result<Value, LibraryError> {
        let symbol = self.names.intern_esl(&mut self.heap, name).map_err(|_| LibraryError::NoMemory)?;
        if self.names.is_defined(&self.heap, symbol) {
            Ok(symbol)
        } else {
            Err(LibraryError::Missing(name.into()))
        }
    }

    /// Makes a task that calls a function of the library.
    ///
    /// # Errors
    /// [`LibraryError`] if the library has no such function, or there is no memory for a task.
    pub fn spawn_library(&mut self, name: &str, arguments: &[Value]) -> Result<TaskId, LibraryError> {
        let function = self.library_function(name)?;
        self.spawn(function, arguments).map_err(|_| LibraryError::NoMemory)
    }

    /// Sets limits and settings from here on, except the limit of memory. Ticks are counted anew, and the
    /// canary of turns begins. Nothing that an earlier program has asked for is in force any more: its main
    /// task, its status, the signals of the process that it has handled.
    pub fn begin_program(&mut self, config: Config) {
        self.config = Config { memory: self.config.memory, ..config };
        self.outside.exit_status = None;
        self.outside.senders = self.outside.senders.saturating_sub(self.embedder.begin_program());
        self.outside.inbox.note_none_handled();
        (self.scheduler.main, self.scheduler.main_number, self.scheduler.counts.made_at_end) =
            (None, None, 0);
        self.scheduler.choices = Choices::seeded(self.config.seed);
        self.scheduler.spent = 0;
        self.exchange.overhead = CollectionOverhead::default();
        self.scheduler.canary = Canary::default();
        (
            self.scheduler.clock.looked_at,
            self.scheduler.clock.moved_at,
            self.scheduler.counts.made,
            self.scheduler.counts.turns,
            self.scheduler.counts.switches,
        ) = (0, 0, 0, 0, 0);
    }

    /// Writes what the program has printed and is still in a buffer.
    pub fn flush(&mut self) {
        self.outside.flush();
    }

    /// Writes reports from here on to this stream, in place of the standard error output.
    pub fn complain_to(&mut self, output: Output) {
        self.outside.complaints = output;
    }

    /// Writes a report, on lines of its own.
    pub fn complain(&mut self, text: &str) {
        self.outside.complain(text);
    }

    /// Returns whether a condition that ended a task says that the memory is exhausted.
    pub fn is_heap_exhausted(&self, condition: Value) -> bool {
        if condition == self.names.known.heap_exhausted {
            return true;
        }
        let class = self.heap.structure_class(condition);
        let name = class.and_then(|class| self.heap.symbol(class::name_of(&self.heap, class)));
        name.and_then(|symbol| self.heap.string_text(symbol.name))
            .is_some_and(|name| name == "HEAP-EXHAUSTED")
    }

    /// Returns figures of the heap.
    pub fn heap_stats(&self) -> HeapStats {
        self.heap.stats()
    }
}
