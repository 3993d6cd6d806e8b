//! The virtual machine: a heap, a world of names, and tasks that run in them.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

pub use crate::config::Config;
use crate::database::Database;
use crate::describe::describe;
use crate::embed::Embedder;
use crate::environment::Compiler;
use crate::exchange::Exchange;
use crate::heap::{AllocError, Heap, HeapConfig, Kind};
use crate::host::Host;
use crate::interp::start::make_starter;
use crate::interp::{Cpu, trust};
use crate::observe::Watch;
use crate::outside::Outside;
use crate::schedule::{Choices, Scheduler};
use crate::task::TaskId;
use crate::value::Value;
use crate::world::World;

/// A virtual machine.
///
/// The values that it hands out belong to it: they are of no use to another machine, and good until it runs again,
/// unless they are pinned.
pub struct Vm {
    /// Objects.
    pub(crate) heap: Heap,
    /// Symbols, packages, classes and loaded modules.
    pub(crate) world: World,
    /// The compiler, and the compilations that programs run.
    pub(crate) compiler: Compiler,
    /// Facts and rules.
    pub(crate) database: Database,
    /// Tasks, their turns, and what is to happen at which time.
    pub(crate) scheduler: Scheduler,
    /// The host, the standard streams and the embedder's functions.
    pub(crate) outside: Outside,
    /// Registers of the interpreter.
    pub(crate) cpu: Cpu,
    /// What passes between the interpreter and builtins.
    pub(crate) exchange: Exchange,
    /// Those who watch the run, and what is gathered for them.
    pub(crate) watch: Watch,
    /// What the embedder holds on to, and its requests.
    pub(crate) embedder: Embedder,
    /// Limits and settings.
    pub(crate) config: Config,
}

impl Vm {
    /// A machine without a library.
    ///
    /// # Errors
    /// [`AllocError`] if the limit of memory leaves no room for what every machine has.
    pub fn new(config: Config, host: Box<dyn Host + Send>) -> Result<Vm, AllocError> {
        let heap_config = HeapConfig { limit: config.memory, ..HeapConfig::default() };
        let mut heap = trust::new_heap(heap_config);
        let world = World::new(&mut heap)?;
        let starter = make_starter(&mut heap)?;
        let any_event =
            heap.alloc_record(Kind::Event, 0, 0, &[Value::NIL, Value::small(0), Value::NIL, Value::NIL])?;
        Ok(Vm {
            heap,
            world,
            compiler: Compiler::default(),
            database: Database::default(),
            scheduler: Scheduler::new(config.seed, starter, any_event),
            outside: Outside::new(host),
            cpu: Cpu::new(),
            exchange: Exchange::new(),
            watch: Watch::default(),
            embedder: Embedder { pinned: vec![starter, any_event], ..Embedder::default() },
            config,
        })
    }

    /// A machine without a library and with a captured outside, for the unit tests of this crate.
    #[cfg(test)]
    pub(crate) fn for_tests() -> Vm {
        let host = Box::new(crate::host::VirtualHost::new());
        Vm::new(Config::default(), host).expect("there is room for an empty machine")
    }

    /// Returns a short text for a value.
    pub fn describe(&self, value: Value) -> String {
        describe(&self.heap, value)
    }

    /// Limits and settings.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// Whether a symbol has a global function.
    pub(crate) fn is_defined(&self, symbol: Value) -> bool {
        let function = self.world.function_of(&self.heap, symbol);
        function.is_some_and(|function| !self.world.is_undefined(&self.heap, function))
    }

    /// A flag that makes the machine abort a task at the end of its slice when it is set.
    pub fn interrupt_flag(&self) -> Arc<AtomicBool> {
        self.embedder.interrupt.clone()
    }

    /// A flag that makes the run under way, or the next one, come back at the end of a slice when it is set.
    pub fn stop_flag(&self) -> Arc<AtomicBool> {
        self.embedder.stop.clone()
    }

    /// The status that the program has asked to end with.
    pub fn exit_status(&self) -> Option<u8> {
        self.outside.exit_status
    }

    /// Names the task that an interrupt aborts; reports call it the main task.
    pub fn set_interruptible(&mut self, id: Option<TaskId>) {
        self.embedder.interruptible = id;
        if let Some(task) = id.and_then(|id| self.scheduler.tasks.get(id)) {
            self.scheduler.main_number = Some(task.number);
        }
    }

    /// Whether the embedder has interrupted the program.
    pub fn was_interrupted(&self) -> bool {
        self.embedder.was_interrupted
    }

    /// Decides how choices are made where the language leaves the order of tasks open.
    pub fn set_choices(&mut self, choices: Choices) {
        self.scheduler.choices = choices;
    }

    /// How choices are made, and those made so far.
    pub fn choices(&self) -> &Choices {
        &self.scheduler.choices
    }

    /// Keeps a value from being collected, until [`Vm::unpin`].
    pub fn pin(&mut self, value: Value) {
        self.heap.log_if_marking(value);
        self.embedder.pinned.push(value);
    }

    /// Lets go of a pinned value.
    pub fn unpin(&mut self, value: Value) {
        if let Some(index) = self.embedder.pinned.iter().rposition(|&pinned| pinned == value) {
            self.embedder.pinned.swap_remove(index);
        }
    }
}
