//! The virtual machine: a heap, a world of names, and tasks that run in them.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use esl_bytecode::datum::Datum;

use crate::control::End;
use crate::database::Database;
use crate::embed::HostFunction;
use crate::environment::Compiler;
use crate::explore::Points;
use crate::figures::Figures;
use crate::finish::EndOfAll;
use crate::heap::{AllocError, Heap, HeapConfig, Kind};
use crate::host::{Console, Host, Output};
use crate::interp::arguments::Arguments;
use crate::interp::start::make_starter;
use crate::interp::{Cpu, trust};
use crate::limit::{Accounts, CLEANUP_TICKS, CLEANUP_TIME};
use crate::observe::Observers;
use crate::raise::Raised;
use crate::schedule::{Choices, RunQueues};
use crate::task::{Task, TaskId, Tasks};
use crate::timer::Timers;
use crate::value::Value;
use crate::wait::{Delivery, Parking};
use crate::world::World;

/// Limits and settings of a virtual machine.
#[derive(Clone, Debug)]
pub struct Config {
    /// Limit of the heap in bytes.
    pub memory: usize,
    /// Limit of a task's stack in words; also of its bindings and of the entries of its control stack.
    pub stack: usize,
    /// Ticks that a task runs before the next one has its turn.
    pub slice: u32,
    /// Ticks that the whole run may take; `None` without a limit.
    pub budget: Option<u64>,
    /// Seed of everything that is chosen at random.
    pub seed: u64,
    /// Collect at every safepoint. For tests: what is not rooted is found soon.
    pub collect_always: bool,
    /// Ticks that a critical section may take.
    pub critical_ticks: u32,
    /// Ticks that a cleanup may take once an abort or an expired limit is pending.
    pub cleanup_ticks: u64,
    /// Nanoseconds that it may take then.
    pub cleanup_time: u64,
}

impl Config {
    /// What holds where nothing else is said.
    pub const DEFAULT: Config = Config {
        memory: 1 << 30,
        stack: 1 << 16,
        slice: 2000,
        budget: None,
        seed: 0,
        collect_always: false,
        critical_ticks: 20_000,
        cleanup_ticks: CLEANUP_TICKS,
        cleanup_time: CLEANUP_TIME,
    };
}

impl Default for Config {
    fn default() -> Config {
        Config::DEFAULT
    }
}

/// A virtual machine.
///
/// The values that it hands out belong to it: they are of no use to another machine, and good until it runs again,
/// unless they are pinned.
pub struct Vm {
    // ---- where things are
    /// Where objects live.
    pub(crate) heap: Heap,
    /// Symbols, packages, classes and loaded modules.
    pub(crate) world: World,
    /// The outside.
    pub(crate) host: Box<dyn Host + Send>,
    /// The standard streams, buffered.
    pub(crate) console: Console,
    /// Values that the embedder holds on to.
    pub(crate) pinned: Vec<Value>,
    /// The embedder's functions.
    pub(crate) host_functions: Vec<HostFunction>,
    /// What one of them has given, while there is no room for it.
    pub(crate) host_answer: Option<Result<Datum, String>>,

    /// The compiler, and the compilations that programs run.
    pub(crate) compiler: Compiler,
    /// Facts and rules.
    pub(crate) database: Database,

    // ---- tasks
    /// The tasks.
    pub(crate) tasks: Tasks,
    /// Those that are runnable.
    pub(crate) queues: RunQueues,
    /// The choices among them.
    pub(crate) choices: Choices,
    /// What is to happen at a time.
    pub(crate) timers: Timers,
    /// Budgets of forms and tasks.
    pub(crate) accounts: Accounts,
    /// Signals that are being handed out, in the order in which they were given.
    pub(crate) deliveries: VecDeque<Delivery>,
    /// Tasks that are held back until then, each with its serial number.
    pub(crate) held: Vec<(u32, u64)>,
    /// How far all tasks have been asked to end, while that is under way.
    pub(crate) end_of_all: Option<EndOfAll>,
    /// Whether the running task is to be held back.
    pub(crate) holds_task: bool,
    /// Whether more timers are due than were seen to.
    pub(crate) more_is_due: bool,
    /// Tasks that wait for input.
    pub(crate) readers: Vec<TaskId>,
    /// The event that every signal signals too.
    pub(crate) any_event: Value,
    /// The task with whose failure the run ends; without one, tasks come and go as they like.
    pub(crate) main: Option<TaskId>,
    /// Its number.
    pub(crate) main_number: Option<u64>,
    /// How many tasks have not ended.
    pub(crate) alive: usize,
    /// How many of them are no daemons.
    pub(crate) foreground: usize,
    /// How many tasks were made.
    pub(crate) made: u64,
    /// How many turns they had.
    pub(crate) turns: u64,
    /// How many of them came after one of another task.
    pub(crate) switches: u64,
    /// Whether anybody has to be told what happens.
    pub(crate) is_watched: bool,
    /// Who watches the run.
    pub(crate) observers: Observers,
    /// What is gathered of it.
    pub(crate) figures: Figures,
    /// Whether what happens to tasks is written.
    pub(crate) traces_tasks: bool,
    /// The newest serial number of a task's state.
    pub(crate) serial: u64,
    /// The clock when it was read last, in nanoseconds.
    pub(crate) now: u64,
    /// Ticks spent when the scheduler read the clock last, and when virtual time moved last.
    pub(crate) looked_at: u64,
    pub(crate) moved_at: u64,
    /// The one that runs, out of its place in `tasks`.
    pub(crate) running: Option<Box<Task>>,
    /// Its place.
    pub(crate) running_index: u32,
    /// Ticks that are left of its critical section.
    pub(crate) critical_left: i64,
    /// Whether its slice was cut short and goes on with another one.
    pub(crate) slice_is_cut: bool,
    /// Whether it wants others to have their turns.
    pub(crate) passes_turn: bool,
    /// Whether its critical section has begun in this slice, whose ticks so far do not count.
    pub(crate) critical_is_new: bool,
    /// Whether something was noted of it when its slice began.
    pub(crate) had_attention: bool,
    /// For what it is to be parked.
    pub(crate) parking: Parking,
    /// Its registers.
    pub(crate) cpu: Cpu,
    /// How it ends, once its unwinding has reached the root.
    pub(crate) ending: Option<End>,
    /// Ticks that all tasks have used.
    pub(crate) spent: u64,
    /// The function with which every task begins.
    pub(crate) starter: Value,
    /// Set from outside to abort the task that the embedder names with [`Vm::interruptible`].
    pub(crate) interrupt: Arc<AtomicBool>,
    /// Set from outside to have a run come back.
    pub(crate) stop: Arc<AtomicBool>,
    /// The task that an interrupt aborts.
    pub(crate) interruptible: Option<TaskId>,
    /// Whether an interrupt has aborted one.
    pub(crate) was_interrupted: bool,

    // ---- between the interpreter and builtins
    /// The value list: all values of the form that was evaluated last, where they are wanted.
    pub(crate) values: Vec<Value>,
    /// The failure that a builtin has noted, until the interpreter takes it.
    pub(crate) raised: Option<Raised>,
    /// The call that a builtin has asked for: the function, then its arguments.
    pub(crate) requested_call: Vec<Value>,
    /// The key that was found last in a hash table, and the number of its entry there.
    pub(crate) last_lookup: (Value, usize),
    /// Ticks that builtins have charged, beside those of their calls, until the interpreter takes them.
    pub(crate) charged: u64,
    /// Place and time of the last collection for want of room; a second one there would not help.
    pub(crate) collected_at: Option<(*const u32, u64, i32)>,
    /// The text of a failure that no library was there to deal with.
    pub(crate) last_words: Option<String>,
    /// Where reports are written.
    pub(crate) complaints: Output,

    /// The status that the program has asked to end with.
    pub(crate) exit_status: Option<u8>,

    /// Where tasks stop while schedules are explored.
    pub(crate) points: Points,
    /// Limits and settings.
    pub(crate) config: Config,
}

// SAFETY: the raw pointers of a machine point into what the machine owns, or into static tables.
#[allow(unsafe_code, reason = "the machine owns what its pointers point to")]
unsafe impl Send for Vm {}

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
            host,
            console: Console::default(),
            pinned: vec![starter, any_event],
            host_functions: Vec::new(),
            host_answer: None,
            tasks: Tasks::default(),
            queues: RunQueues::default(),
            choices: Choices::seeded(config.seed),
            timers: Timers::default(),
            accounts: Accounts::default(),
            deliveries: VecDeque::new(),
            end_of_all: None,
            held: Vec::new(),
            holds_task: false,
            more_is_due: false,
            readers: Vec::new(),
            any_event,
            main: None,
            main_number: None,
            alive: 0,
            foreground: 0,
            made: 0,
            turns: 0,
            switches: 0,
            is_watched: false,
            observers: Observers::default(),
            figures: Figures::default(),
            traces_tasks: false,
            serial: 0,
            now: 0,
            looked_at: 0,
            moved_at: 0,
            compiler: Compiler::default(),
            database: Database::default(),
            running: None,
            running_index: u32::MAX,
            critical_left: 0,
            slice_is_cut: false,
            passes_turn: false,
            critical_is_new: false,
            had_attention: false,
            parking: Parking::default(),
            cpu: Cpu::new(),
            ending: None,
            spent: 0,
            starter,
            interrupt: Arc::default(),
            stop: Arc::default(),
            interruptible: None,
            was_interrupted: false,
            values: Vec::new(),
            raised: None,
            requested_call: Vec::new(),
            last_lookup: (Value::UNBOUND, 0),
            charged: 0,
            collected_at: None,
            last_words: None,
            complaints: Output::Error,
            exit_status: None,
            points: Points::default(),
            config,
        })
    }

    /// A machine without a library and with a captured outside, for the unit tests of this crate.
    #[cfg(test)]
    pub(crate) fn for_tests() -> Vm {
        let host = Box::new(crate::host::VirtualHost::new());
        Vm::new(Config::default(), host).expect("there is room for an empty machine")
    }

    /// Limits and settings.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// Charges the running task units of work, of which 64 are a tick. One takes about as long as a step of arithmetic on limbs.
    #[inline]
    pub fn charge(&mut self, units: usize) {
        self.charged += units as u64 / 64;
    }

    /// Charges the running task for list cells, elements or characters that were walked over, compared, copied or filled: a
    /// tick for each 16. That takes a few nanoseconds for each, as they come from memory.
    #[inline]
    pub(crate) fn charge_elements(&mut self, count: usize) {
        self.charged += count as u64 / 16;
    }

    /// Asks for a call in the place of the builtin, which gives [`crate::raise::Exit::Call`].
    pub(crate) fn request_call(&mut self, function: Value, arguments: &[Value]) {
        self.requested_call.clear();
        self.requested_call.push(function);
        self.requested_call.extend_from_slice(arguments);
    }

    /// The call that a builtin has asked for.
    pub(crate) fn take_requested_call(&mut self) -> (Value, Arguments) {
        let mut call = self.requested_call.drain(..);
        let function = call.next().unwrap_or(Value::NIL);
        (function, call.collect())
    }

    /// Whether a symbol has a global function.
    pub(crate) fn is_defined(&self, symbol: Value) -> bool {
        let function = self.world.function_of(&self.heap, symbol);
        function.is_some_and(|function| !self.world.is_undefined(&self.heap, function))
    }

    /// A flag that makes the machine abort a task at the end of its slice when it is set.
    pub fn interrupt_flag(&self) -> Arc<AtomicBool> {
        self.interrupt.clone()
    }

    /// A flag that makes the run under way, or the next one, come back at the end of a slice when it is set.
    pub fn stop_flag(&self) -> Arc<AtomicBool> {
        self.stop.clone()
    }

    /// The status that the program has asked to end with.
    pub fn exit_status(&self) -> Option<u8> {
        self.exit_status
    }

    /// Names the task that an interrupt aborts; reports call it the main task.
    pub fn set_interruptible(&mut self, id: Option<TaskId>) {
        self.interruptible = id;
        if let Some(task) = id.and_then(|id| self.tasks.get(id)) {
            self.main_number = Some(task.number);
        }
    }

    /// Takes an interrupt: the task that it aborts.
    pub(crate) fn take_interrupt(&mut self) -> Option<TaskId> {
        use std::sync::atomic::Ordering::Relaxed;
        let id = self.interruptible?;
        (self.interrupt.load(Relaxed) && self.interrupt.swap(false, Relaxed)).then_some(id)
    }

    /// Whether the embedder has interrupted the program.
    pub fn was_interrupted(&self) -> bool {
        self.was_interrupted
    }

    /// Decides how choices are made where the language leaves the order of tasks open.
    pub fn set_choices(&mut self, choices: Choices) {
        self.choices = choices;
    }

    /// How choices are made, and those made so far.
    pub fn choices(&self) -> &Choices {
        &self.choices
    }

    /// Keeps a value from being collected, until [`Vm::unpin`].
    pub fn pin(&mut self, value: Value) {
        self.heap.log_if_marking(value);
        self.pinned.push(value);
    }

    /// Lets go of a pinned value.
    pub fn unpin(&mut self, value: Value) {
        if let Some(index) = self.pinned.iter().rposition(|&pinned| pinned == value) {
            self.pinned.swap_remove(index);
        }
    }
}
