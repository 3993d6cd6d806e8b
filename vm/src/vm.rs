//! The virtual machine: a heap, names, and tasks that run in them.

use esl_bytecode::builtin::BUILTINS;
use esl_database::Database;

use crate::compiler::Compilations;
pub use crate::config::Config;
use crate::cpu::Cpu;
use crate::describe::describe;
use crate::embedder::Embedder;
use crate::exchange::Exchange;
use crate::heap::Heap;
use crate::names::Names;
use crate::observe::Watch;
use crate::outside::Outside;
use crate::raise::{Exit, Outcome};
use crate::schedule::Scheduler;
use crate::tier::CompiledFunctions;
pub use crate::tier::{Tier, TierReport};
use crate::value::Value;

/// A function that is written in Rust. The number of arguments has been checked against the table.
pub type Native = fn(&mut Vm, &[Value]) -> Outcome;

/// The functions that are written in Rust, by the numbers of their rows in the table.
pub(crate) type Natives = [Native; BUILTINS.len()];

/// A function of the embedder's that is called between two rounds of the machine.
pub(crate) type BetweenRounds = Box<dyn FnMut(&mut Vm) + Send>;

/// A virtual machine.
///
/// The values that it hands out belong to it: they are of no use to another machine, and good until it runs
/// again, unless they are pinned.
pub struct Vm {
    /// Objects.
    pub(crate) heap: Heap,
    /// Symbols, packages, classes and loaded modules.
    pub(crate) names: Names,
    /// The compiler, and the compilations that programs run.
    pub(crate) compiler: Compilations,
    /// Facts and rules.
    pub(crate) database: Database,
    /// Tasks, their turns, and what is to happen at which time.
    pub(crate) scheduler: Scheduler,
    /// The host, the standard streams and the embedder's functions.
    pub(crate) outside: Outside,
    /// Registers of the interpreter.
    pub(crate) cpu: Cpu,
    /// The functions written in Rust, by number.
    pub(crate) natives: &'static Natives,
    /// Arguments and results that pass between the interpreter and builtins.
    pub(crate) exchange: Exchange,
    /// Observers of the run, and the data gathered for them.
    pub(crate) watch: Watch,
    /// Objects kept for the embedder, and the embedder's requests.
    pub(crate) embedder: Embedder,
    /// Is called between two rounds.
    pub(crate) between_rounds: Option<BetweenRounds>,
    /// The machine code of functions.
    pub(crate) compiled: CompiledFunctions,
    /// Limits and settings.
    pub(crate) config: Config,
}

impl Vm {
    /// Returns a short text for a value.
    pub fn describe(&self, value: Value) -> String {
        describe(&self.heap, value)
    }

    /// Returns several values; just the first if the caller wants one.
    #[inline]
    pub(crate) fn give_values(&mut self, values: &[Value]) -> Outcome {
        if self.cpu.wants_one {
            return Ok(values.first().copied().unwrap_or(Value::NIL));
        }
        self.exchange.values.clear();
        self.exchange.values.extend_from_slice(values);
        Err(Exit::Values)
    }
}
