//! Limits and settings of a virtual machine.

use esl_heap::list_state;

/// Ticks that a cleanup may take once an abort or an expired limit is pending.
const CLEANUP_TICKS: u64 = 1_000_000;
/// Nanoseconds that it may take then.
const CLEANUP_TIME: u64 = 60_000_000_000;

/// Most words of a stack: the offsets of frames have 32 bits.
const MAX_STACK: usize = 1 << 30;

/// Limits and settings of a virtual machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Config {
    /// Limit of the heap in bytes.
    pub memory: usize,
    /// Limit of a task's stack in words; also of its bindings and of the entries of its control stack. `None`
    /// for as much as half of the memory has room for.
    pub stack: Option<usize>,
    /// Ticks that a task runs before the next one has its turn.
    pub slice: u32,
    /// Ticks that the whole run may take; `None` without a limit.
    pub budget: Option<u64>,
    /// Seed of all random choices.
    pub seed: u64,
    /// Whether every safepoint collects. For tests: an object that nothing keeps alive is found soon.
    pub collect_always: bool,
    /// Ticks that a critical section may take.
    pub critical_ticks: u32,
    /// Ticks that a cleanup may take once an abort or an expired limit is pending.
    pub cleanup_ticks: u64,
    /// Nanoseconds that it may take then.
    pub cleanup_time: u64,
    /// Whether the state of the machine may be saved and restored ([`crate::vm::Vm::save`]).
    pub snapshots: bool,
    /// Where the heap has its memory, so that the state of the machine may be stored for another process
    /// ([`crate::vm::Vm::store_state`]): the start of a range of addresses; `None` for anywhere.
    pub range: Option<usize>,
}

list_state! { Config {
    memory: Run,
    stack: Run,
    slice: Run,
    budget: Run,
    seed: Run,
    collect_always: Run,
    critical_ticks: Run,
    cleanup_ticks: Run,
    cleanup_time: Run,
    snapshots: Process,
    range: Process,
} }

impl Config {
    /// Default limits and settings.
    pub const DEFAULT: Config = Config {
        memory: 1 << 30,
        stack: None,
        slice: 2000,
        budget: None,
        seed: 0,
        collect_always: false,
        critical_ticks: 20_000,
        cleanup_ticks: CLEANUP_TICKS,
        cleanup_time: CLEANUP_TIME,
        snapshots: false,
        range: None,
    };

    /// Returns the limit of a task's stack in words.
    #[inline]
    pub fn stack_words(&self) -> usize {
        self.stack.unwrap_or(self.memory / 2 / size_of::<u64>()).min(MAX_STACK)
    }
}

impl Default for Config {
    fn default() -> Config {
        Config::DEFAULT
    }
}
