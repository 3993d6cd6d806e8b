//! The domain of the flow analysis: values that matter to failures, and the cells through which they flow.
//!
//! A value is a function, a name that may designate one or may be a cause, a task, a condition, or an object
//! that may contain any of these. Numbers, texts and other data are left out. A cell holds the values that a
//! place of the program may have: a node, a variable, a slot, a special variable, the contents of an object.

use esl_bytecode::symbol::Symbol;
use esl_compiler::core::{LambdaId, NodeId, VarId};
use rustc_hash::FxHashMap;

/// A context: the calls that led to a function whose arguments are functions, the innermost first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) struct ContextId(pub(crate) u32);

/// The context of code that is not told apart by its calls.
pub(crate) const NO_CONTEXT: ContextId = ContextId(0);

/// A node in a context.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) struct Spot {
    pub(crate) form: u32,
    pub(crate) node: NodeId,
    pub(crate) context: ContextId,
}

/// A lambda in a context.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) struct Code {
    pub(crate) form: u32,
    pub(crate) lambda: LambdaId,
    pub(crate) context: ContextId,
}

macro_rules! number {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub(crate) struct $name(pub(crate) u32);

        impl $name {
            /// Returns the index into its table.
            #[allow(dead_code, reason = "things are only compared")]
            pub(crate) fn index(self) -> usize {
                self.0 as usize
            }
        }
    };
}

number!(/** A cell. */ CellId);
number!(/** A call of values. */ PointId);
number!(/** A symbol that is interned here. */ NameId);
number!(/** An object of the program: all that one place makes in one context. */ ThingId);
number!(/** A task, or an operation: all that one place begins in one context. */ WorkId);

/// A value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum FlowValue {
    /// A closure.
    Closure(Code),
    /// The global function of this name.
    Function(NameId),
    /// A symbol, which may name a function or a cause.
    Symbol(NameId),
    /// An object with contents.
    Thing(ThingId),
    /// A task, or the handle of an operation.
    Work(WorkId),
    /// A condition of this type.
    Condition(NameId),
    /// A condition that the handling form at this place has caught.
    Caught(Spot),
    /// The cause of a condition that the handling form at this place has caught.
    CauseOfCaught(Spot),
    /// The cause of a condition of this type.
    CauseOf(NameId),
    /// The cause, or the condition, with which a task has failed.
    EndOf(WorkId),
    /// A generic function of this name.
    Generic(NameId),
    /// The function that `start` passes to the starter of an operation.
    HowToStart,
    /// Some symbol.
    AnySymbol,
}

/// Origin of an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum ThingKey {
    /// A node, and one of the objects that it makes.
    Made(Spot, u8),
    /// The list of the rest of the arguments of a function.
    Rest(Code),
    /// The arguments of failures.
    FailureArguments,
}

/// A place through which values flow.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) enum CellKey {
    /// The value of a node.
    Node(Spot),
    /// A lexical variable.
    Variable(u32, VarId, ContextId),
    /// The value of a function.
    Return(Code),
    /// A special variable.
    Special(Symbol),
    /// A slot of a structure.
    Slot(Symbol, u16),
    /// A global function.
    Function(Symbol),
    /// The property of a symbol: symbol, indicator.
    Property(Symbol, Symbol),
    /// The contents of an object.
    Contents(ThingId),
    /// The first element of an object.
    First(ThingId),
    /// The functions that a task runs.
    Body(WorkId),
    /// The methods of a generic function.
    Methods(Symbol),
    /// The answers of worlds to calls of an operation.
    Answers(Symbol),
    /// The slots of all instances of classes.
    Instances,
    /// The slots of all structures, for functions that find them by their names.
    SlotsByName,
    /// Values for slots of structures, by functions that find these by their names.
    SetByName,
    /// Values of special variables that are found when the program runs.
    AnySpecial,
    /// Properties that are set all together.
    PropertyLists,
    /// Tests in the bodies of rules.
    Rules,
    /// Arguments of signals, of inputs and of reports of progress.
    Signals,
    /// Tests and hash functions of tables.
    TableFunctions,
    /// Values that are thrown.
    Thrown,
    /// Facts.
    Facts,
    /// Values of clauses, which stand for those of failed calls.
    Replacements,
    /// Values of clauses for programming errors.
    ReplacementsOfMistakes,
    /// Arguments of calls of too many functions.
    ManyArguments,
    /// Values of such calls.
    ManyResults,
}

/// Origin of a task or an operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum WorkKey {
    /// A node, and one of the tasks that it begins.
    Begun(Spot, u8),
    /// An operation of the host.
    Host(NameId),
    /// The answers of worlds to calls of an operation.
    Scripted(NameId),
}

/// Kind of a task, as reports call it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum TaskKind {
    /// The main task.
    Main,
    /// A task of `spawn`.
    Spawned,
    /// A body of a form that waits for it: a net, a race, a sequence.
    Part,
    /// The guard of a guardian.
    Guard,
    /// A supervised child.
    Child,
    /// A mock, or a scripted answer.
    Mock,
    /// A clause of a world.
    World,
    /// A test.
    Test,
    /// An operation of the host.
    Host,
}

/// A task or an operation.
#[derive(Clone, Debug)]
pub(crate) struct TaskWork {
    pub(crate) key: WorkKey,
    pub(crate) kind: TaskKind,
    /// Whether a form fails as it does, or takes its failure otherwise.
    pub(crate) is_awaited: bool,
}

/// Numbers for keys.
#[derive(Debug)]
pub(crate) struct Numbering<K> {
    numbers: FxHashMap<K, u32>,
    pub(crate) keys: Vec<K>,
}

impl<K> Default for Numbering<K> {
    fn default() -> Numbering<K> {
        Numbering { numbers: FxHashMap::default(), keys: Vec::new() }
    }
}

impl<K: Clone + Eq + std::hash::Hash> Numbering<K> {
    /// Returns the number of a key, if it has one.
    pub(crate) fn find(&self, key: &K) -> Option<u32> {
        self.numbers.get(key).copied()
    }

    /// Returns the number of a key, and whether it is new.
    pub(crate) fn number(&mut self, key: &K) -> (u32, bool) {
        if let Some(number) = self.numbers.get(key) {
            return (*number, false);
        }
        let number = self.keys.len() as u32;
        self.numbers.insert(key.clone(), number);
        self.keys.push(key.clone());
        (number, true)
    }
}
