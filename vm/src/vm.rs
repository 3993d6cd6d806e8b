//! The virtual machine: a heap, a world of names, and tasks that run in them.

use crate::heap::{Heap, HeapConfig};
use crate::host::Host;
use crate::raise::Raised;
use crate::value::Value;
use crate::world::World;

/// Limits and settings of a virtual machine.
#[derive(Clone, Debug)]
pub struct Config {
    /// Limit of the heap in bytes.
    pub memory: usize,
    /// Limit of a task's stack in words.
    pub stack: usize,
    /// Ticks that a task runs before the next one has its turn.
    pub slice: u32,
    /// Ticks that the whole run may take; `None` without a limit.
    pub budget: Option<u64>,
    /// Seed of everything that is chosen at random.
    pub seed: u64,
    /// Collect at every safepoint. For tests: what is not rooted is found soon.
    pub collect_always: bool,
}

impl Default for Config {
    fn default() -> Config {
        Config {
            memory: 1 << 30,
            stack: 1 << 16,
            slice: 2000,
            budget: None,
            seed: 0,
            collect_always: false,
        }
    }
}

/// A virtual machine.
pub struct Vm {
    /// Where objects live.
    pub(crate) heap: Heap,
    /// Symbols, packages, classes and loaded modules.
    pub(crate) world: World,
    /// The outside.
    pub(crate) host: Box<dyn Host>,
    /// The value list: all values of the form that was evaluated last, where they are wanted.
    pub(crate) values: Vec<Value>,
    /// The failure that a builtin has noted, until the interpreter takes it.
    pub(crate) raised: Option<Raised>,
    /// The call that a builtin has asked for: the function, then its arguments.
    pub(crate) requested_call: Vec<Value>,
    /// Ticks that the running builtin has charged, beside the one of its call.
    pub(crate) charged: u64,
    /// Limits and settings.
    pub(crate) config: Config,
}

impl Vm {
    /// Charges the running task `units` of work (list cells, elements, characters): a tick for each 64.
    #[inline]
    pub fn charge(&mut self, units: usize) {
        self.charged += units as u64 / 64;
    }
}
