//! What an embedder does with a machine beside running it: data in and out, and functions of its own.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::Relaxed;

use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;

use crate::datum::Unit;
use crate::heap::HeapStats;
use crate::host::Output;
use crate::raise::{Exit, Outcome, Raised};
use crate::schedule::Choices;
use crate::task::TaskId;
use crate::value::Value;
use crate::vm::{Config, Vm};
use crate::world::class;

pub use crate::datum::DatumError as ExportError;
pub use crate::outside::HostFunction;

/// Why a function of the library could not be called.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum LibraryError {
    /// The library has no function of this name.
    Missing(String),
    /// There is no memory left for it.
    NoMemory,
}

impl fmt::Display for LibraryError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            LibraryError::Missing(name) => write!(f, "the library has no function {name}"),
            LibraryError::NoMemory => f.write_str("there is no memory left for a task"),
        }
    }
}

impl std::error::Error for LibraryError {}

/// What the embedder holds on to, and its requests.
#[derive(Default)]
pub(crate) struct Embedder {
    /// Values that are kept from being collected.
    pub(crate) pinned: Vec<Value>,
    /// Set from outside to abort the task named in `interruptible`.
    pub(crate) interrupt: Arc<AtomicBool>,
    /// Set from outside to have a run come back.
    pub(crate) stop: Arc<AtomicBool>,
    /// The task that an interrupt aborts.
    pub(crate) interruptible: Option<TaskId>,
    /// Whether an interrupt has aborted one.
    pub(crate) was_interrupted: bool,
    /// Text of a failure that ended a task while there was no library to deal with it.
    pub(crate) last_words: Option<String>,
}

impl Embedder {
    /// Takes an interrupt, and returns the task that it aborts.
    pub(crate) fn take_interrupt(&self) -> Option<TaskId> {
        let id = self.interruptible?;
        take(&self.interrupt).then_some(id)
    }

    /// Takes a request to have the run come back.
    pub(crate) fn take_stop(&self) -> bool {
        take(&self.stop)
    }
}

/// Takes a flag that is set from outside.
fn take(flag: &AtomicBool) -> bool {
    // A plain look first: it is done once a turn, and writing would cost more.
    flag.load(Relaxed) && flag.swap(false, Relaxed)
}

impl Vm {
    /// Takes in a function of the embedder: its number, for `%call-host`.
    pub fn add_host_function(&mut self, function: HostFunction) -> usize {
        self.outside.functions.push(function);
        self.outside.functions.len() - 1
    }

    /// A value as data. Objects that no data stands for, such as functions and hash tables, come out as a string that
    /// describes them.
    ///
    /// # Errors
    /// [`ExportError`] if the value is circular, or too large.
    pub fn export(&mut self, value: Value) -> Result<Datum, ExportError> {
        let mut unit = Unit::default();
        let datum = unit.datum_of(&self.heap, &self.world, value, Span::default())?;
        self.exchange.charge(unit.take_work() as usize);
        Ok(datum)
    }

    /// Data as a value.
    ///
    /// # Errors
    /// [`Exit::Collect`] without room.
    pub fn import(&mut self, datum: &Datum) -> Result<Value, Exit> {
        let mut unit = Unit::default();
        let value = unit.value_of(&mut self.heap, &mut self.world, datum)?;
        self.exchange.charge(unit.take_work() as usize);
        Ok(value)
    }
}

/// `(%call-host number &rest arguments)`
pub(crate) fn call_host(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let number = arguments[0].as_index().filter(|&number| number < vm.outside.functions.len());
    let Some(number) = number else {
        return vm.exchange.index_error(arguments[0], vm.outside.functions.len());
    };
    let mut data = Vec::with_capacity(arguments.len());
    for &argument in &arguments[1..] {
        match vm.export(argument) {
            Ok(datum) => data.push(datum),
            Err(error) => return vm.exchange.raise(Raised::Simple(error.to_string())),
        }
    }
    // The function has effects that cannot be done twice, so what it gives is kept until there is room for it.
    let answer = match vm.outside.answer.take() {
        Some(answer) => answer,
        None => (vm.outside.functions[number])(&data),
    };
    match answer {
        Ok(datum) => match vm.import(&datum) {
            Ok(value) => Ok(value),
            Err(exit) => {
                vm.outside.answer = Some(Ok(datum));
                Err(exit)
            }
        },
        Err(text) => vm.exchange.raise(Raised::Simple(text)),
    }
}

impl Vm {
    /// The function of the library with this name, internal to the package `ESL`.
    ///
    /// # Errors
    /// [`LibraryError`] if the library has none, or there is no memory for its name.
    pub fn library_function(&mut self, name: &str) -> Result<Value, LibraryError> {
        let symbol = self.world.intern_esl(&mut self.heap, name).map_err(|_| LibraryError::NoMemory)?;
        if self.is_defined(symbol) { Ok(symbol) } else { Err(LibraryError::Missing(name.into())) }
    }

    /// Makes a task that calls a function of the library.
    ///
    /// # Errors
    /// [`LibraryError`] if the library has no such function, or there is no memory for a task.
    pub fn spawn_library(&mut self, name: &str, arguments: &[Value]) -> Result<TaskId, LibraryError> {
        let function = self.library_function(name)?;
        self.spawn(function, arguments).map_err(|_| LibraryError::NoMemory)
    }

    /// Settings that count from here on; ticks are counted anew.
    pub fn begin_program(&mut self, config: Config) {
        self.config = Config { memory: self.config.memory, ..config };
        self.scheduler.choices = Choices::seeded(self.config.seed);
        self.scheduler.spent = 0;
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

    /// Whether a condition that ended a task says that the memory is exhausted.
    pub fn is_heap_exhausted(&self, condition: Value) -> bool {
        if condition == self.world.known.heap_exhausted {
            return true;
        }
        let class = self.heap.structure_class(condition);
        let name = class.and_then(|class| self.heap.symbol(class::name_of(&self.heap, class)));
        name.and_then(|symbol| self.heap.string_text(symbol.name))
            .is_some_and(|name| name == "HEAP-EXHAUSTED")
    }

    /// Figures of the heap.
    pub fn heap_stats(&self) -> HeapStats {
        self.heap.stats()
    }
}
